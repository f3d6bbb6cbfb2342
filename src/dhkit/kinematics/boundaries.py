"""Boundary curves of the workspace of arms with a closed form, revolute joints without limits.

A wrist centre that two links move in the arm's plane stays in the ring between abs(L2 - L3) and L2 + L3 about axis 2;
joint 1 turns that ring about axis 1, outside the cylinder whose radius is the arm's lateral offset (Siciliano et al.,
Robotics, 2009, section 2.10).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit.description import Array, Description, takes_robot
from dhkit.display import repr_line
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.arm_plane import ArmPlane
from dhkit.kinematics.closed_form.family import Fit
from dhkit.kinematics.singular_factors import ShoulderFactor, link_radii, slide_radii
from dhkit.kinematics.singularities import singularities

_ARMS_IN_A_PLANE = {"elbow_wrist", "slide_wrist", "three_parallel", "yaw_two", "yaw_three"}
"""Families with an arm in a plane that joint 1 turns."""
_PLANAR = {"parallel_chain", "polar"}
"""Families whose tool moves in a plane across the first axis, or also along that axis."""
_NAMES = {
    "elbow_wrist": "wrist centre",
    "slide_wrist": "wrist centre",
    "three_parallel": "meeting point of axes 5 and 6",
}
_CIRCLE_SEGMENTS = 180
"""Number of chords that a circle, or a part of one, is drawn with."""
_TOUCHING = 1e-9
"""Share of a1 by which two circles that touch may miss each other; at x = 0 each touches its mirror image."""
_MIN_RADIUS = 1e-3
"""A circle with a radius below this share of the reach is drawn as a point."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """A surface that bounds the positions of a point of an arm, as two curves in the world."""

    name: str
    """Name of the boundary: outer, inner or shoulder."""
    point: str
    """The point whose positions it bounds, such as ``wrist centre``."""
    section: Array
    """Section with joint 1 at zero, shape (k, 3), m."""
    circle: Array
    """Outline seen along axis 1, shape (m, 3), m; empty if the surface has no outline from there."""

    def __repr__(self) -> str:
        return repr_line("Boundary", self.point, f"{self.name}, {len(self.section)} points")


@takes_robot
def boundaries(description: Description) -> tuple[Boundary, ...]:
    """Return an arm's boundaries in closed form: outer, inner and shoulder, as far as they exist.

    Limits of revolute joints are ignored. Without limits of a prismatic joint there is no outer boundary.
    The result is empty if no boundaries are known in closed form, or if the first joint is prismatic.

    Parameters
    ----------
    description
        The arm.

    Returns
    -------
    tuple[Boundary, ...]
        The boundaries; empty if none is known.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> [boundary.name for boundary in boundaries(library_robot("stanford"))]
    ['outer', 'inner', 'shoulder']
    """
    found = classify(description)
    family = found.family
    fit = found.fit
    if family is None or fit is None or not description.joints[0].is_revolute:
        return ()
    if family.name in _ARMS_IN_A_PLANE:
        return _turned_ring(description, _NAMES.get(family.name, "tool"))
    return _ring(description, fit) if family.name in _PLANAR else ()


def _turned_ring(description: Description, point: str) -> tuple[Boundary, ...]:
    """Return the boundaries of a ring in a plane that joint 1 turns about axis 1, with an offset across the plane."""
    (side,) = (
        factor
        for factor in singularities(description).factors
        if isinstance(factor, ShoulderFactor)
    )
    plane = ArmPlane.of(Axes.of(description))
    least, most = side.radii(description.numbers.lower, description.numbers.upper)
    # Over all q1 together: a point in front of axis 1 is reached from the front, from behind, or both.
    a1 = abs(side.a1)
    sign = -1.0 if side.a1 < 0 else 1.0
    ring = _Ring(a1, least, most)

    def world(section: Array) -> Array:
        # p = origin + x e_x + u e_u + v e_v, with the plane's axes e_x, e_u and e_v as rows of R, and v = offset.
        across = np.full((len(section), 1), side.offset)
        return np.asarray(plane.origin + np.hstack([section * (sign, 1.0), across]) @ plane.R)

    def around(radius: float) -> Array:
        # A circle about axis 1, along e_u: p = origin + radius (cos(t) e_x + sin(t) e_v).
        turns = _unit_circle()
        return np.asarray(
            plane.origin + radius * (turns[:, :1] * plane.R[0] + turns[:, 1:] * plane.R[2])
        )

    nowhere = np.empty((0, 3))
    found = []
    if np.isfinite(most):
        # The farthest point of the ring is at x = a1 + most in a plane that passes axis 1 at the distance offset.
        found.append(
            Boundary(
                "outer", point, world(ring.outer), around(float(np.hypot(a1 + most, side.offset)))
            )
        )
    inner = ring.inner
    if np.isfinite(inner).any() and least > _MIN_RADIUS * side.size:
        found.append(Boundary("inner", point, world(inner), nowhere))
    # Only where the ring reaches x = 0 does the point come as near to axis 1 as the plane does.
    if side.offset and np.isfinite(most) and most > a1:
        found.append(Boundary("shoulder", point, world(ring.edge), around(abs(side.offset))))
    return tuple(found)


@dataclass(frozen=True)
class _Ring:
    """A ring about (a1, 0) and its mirror image at the axis x = 0, restricted to x >= 0."""

    a1: float
    """Distance of the ring's centre from the axis, m, not negative."""
    least: float
    """Inner radius, m."""
    most: float
    """Outer radius, m; may be infinite."""

    @property
    def outer(self) -> Array:
        """The outer boundary, shape (k, 2), m; the mirror image lies inside it."""
        return self._circle(self.a1, self.most)

    @property
    def inner(self) -> Array:
        """The boundary of the hole that neither ring covers, shape (k, 2), m, pieces separated by NaN."""
        if not self.a1:
            return self._circle(0.0, self.least)

        # The hole's boundary: both inner circles, and the mirror image's outer circle where it crosses the ring's hole.
        pieces = [
            self._uncovered(self._circle(self.a1, self.least), -self.a1),
            self._uncovered(self._circle(-self.a1, self.least), self.a1),
        ]
        if np.isfinite(self.most):
            pieces.append(self._uncovered(self._circle(-self.a1, self.most), self.a1))
        return np.vstack([np.vstack([piece, np.full(2, np.nan)]) for piece in pieces])

    @property
    def edge(self) -> Array:
        """The covered part of the axis x = 0, shape (k, 2), m, NaN at the hole."""
        # A circle of radius rho about (a1, 0) meets the axis at u = +-sqrt(rho^2 - a1^2).
        high = np.sqrt(max(0.0, self.most**2 - self.a1**2))
        low = np.sqrt(max(0.0, self.least**2 - self.a1**2))
        if low:
            upper = np.linspace(low, high, _CIRCLE_SEGMENTS + 1)
            heights = np.concatenate([-upper[::-1], [np.nan], upper])
        else:
            heights = np.linspace(-high, high, _CIRCLE_SEGMENTS + 1)
        return np.stack([0.0 * heights, heights], axis=1)

    def _circle(self, centre: float, radius: float) -> Array:
        """Return the part of a circle that has x >= 0, shape (k, 2)."""
        if radius <= -centre or not radius:
            return np.empty((0, 2))

        # x = centre + radius cos(t) >= 0 for |t| <= arccos(-centre / radius); the whole circle if centre >= radius.
        half = np.arccos(max(-1.0, -centre / radius))
        angles = np.linspace(-half, half, _CIRCLE_SEGMENTS + 1)
        return np.stack([centre + radius * np.cos(angles), radius * np.sin(angles)], axis=1)

    def _uncovered(self, points: Array, centre: float) -> Array:
        """Return points with NaN for those inside the ring about the other centre."""
        distance = np.hypot(points[:, 0] - centre, points[:, 1])
        touching = _TOUCHING * self.a1
        covered = (distance > self.least - touching) & (distance < self.most + touching)
        return np.where(covered[:, None], np.nan, points)


def _ring(description: Description, fit: Fit) -> tuple[Boundary, ...]:
    """Return the boundaries of a ring across the first axis, or of the tube if a prismatic joint moves along it."""
    p = fit.parameters
    T_plane_world = np.asarray(p["T_plane_world"])
    R = T_plane_world[:, :3]

    # The plane's coordinates of a world point p are R p + t; those of its origin are 0 at p = -R^T t.
    origin = -T_plane_world[:, :3].T @ T_plane_world[:, 3]
    heights = float(np.asarray(p["height"])) + _rises(description, fit)

    def boundary(name: str, radius: float) -> Boundary:
        line = np.stack([[radius, 0.0, height] for height in heights])
        circle = np.hstack(
            [radius * _unit_circle(), np.full((_CIRCLE_SEGMENTS + 1, 1), heights[0])]
        )
        return Boundary(
            name, "tool", np.asarray(origin + line @ R), np.asarray(origin + circle @ R)
        )

    radii = zip(("inner", "outer"), _radii(description, fit), strict=True)
    least = _MIN_RADIUS * float(np.asarray(p["reach"]))
    return tuple(boundary(name, radius) for name, radius in radii if least < radius < np.inf)[::-1]


def _radii(description: Description, fit: Fit) -> tuple[float, float]:
    """Return the least and largest distance of the tool from the first axis, m."""
    p = {key: np.asarray(value, dtype=float) for key, value in fit.parameters.items()}
    numbers = description.numbers
    if "start" in p:
        return slide_radii(
            float(p["start"]), float(p["lift"]), float(numbers.lower[1]), float(numbers.upper[1])
        )
    return link_radii(
        [float(p["L2"]), float(p["L3"]), float(np.linalg.norm(p["lever"]))][
            : fit.structure.count("R")
        ]
    )


def _rises(description: Description, fit: Fit) -> Array:
    """Return the tool's displacement along the first axis at the prismatic joint's limits, shape (2,), m."""
    if "P" not in fit.structure:
        return np.zeros(2)
    joint = fit.structure.index("P")
    numbers = description.numbers
    limits = np.array([numbers.lower[joint], numbers.upper[joint]])
    return np.asarray(
        np.where(np.isfinite(limits), np.asarray(fit.parameters["senses"])[joint] * limits, 0.0)
    )


def _unit_circle() -> Array:
    angles = np.linspace(0, 2 * np.pi, _CIRCLE_SEGMENTS + 1)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)
