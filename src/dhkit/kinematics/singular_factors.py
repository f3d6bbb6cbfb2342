"""The factors of a Jacobian's determinant that vanish at the singularities of arms with a closed form.

A factor is its :attr:`size` times a measure without unit of at most about 1. The flags of inverse kinematics
(:class:`dhkit.kinematics.IKFlag`) compare these measures with a threshold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

Kind: TypeAlias = Literal["shoulder", "elbow", "wrist"]
_MIN_TERM = 1e-12
"""Terms below this share of the largest length are rounding and are left out of equations."""


@dataclass(frozen=True)
class AngleFactor:
    """A factor size abs(sin(sense q + zero)) of one revolute joint."""

    kind: Kind
    joint: int
    """Index of the joint, from 0."""
    sense: float
    """+1 or -1."""
    zero: float
    """The angle at q = 0, rad."""
    size: float
    """Factor of the measure, m^2 or 1."""
    descriptions: tuple[str, str]
    """Geometric meaning of the singularity at angle 0 and at angle pi, for printing."""

    def measure(self, q: Array) -> Array:
        """Return abs(sin), shape (...), at joint positions (..., n), rad and m."""
        return np.asarray(np.abs(np.sin(self.sense * q[..., self.joint] + self.zero)))

    @property
    def values(self) -> tuple[float, ...]:
        """The joint's two singular positions, rad, in (-pi, pi]: at angle 0, then at pi."""
        # sense q + zero = 0 or pi, and 1 / sense = sense.
        return _wrap_angle(-self.sense * self.zero), _wrap_angle(self.sense * (np.pi - self.zero))

    def words(self, point: str) -> str:
        """Return the joint positions where the factor vanishes, in words."""
        first, second = (_degrees(value) for value in self.values)
        name = f"q{self.joint + 1}"
        at_zero, at_pi = self.descriptions
        if at_zero == at_pi:
            return f"{name} = {first} or {second}: {at_zero}"
        return f"{name} = {first} ({at_zero}) or {second} ({at_pi})"

    def moved_onto_singularity(
        self, q: Array, lower: Array, upper: Array, rng: np.random.Generator
    ) -> Array:
        """Return joint values q (k, n), rad and m, with this joint at a zero of the factor, inside limits if it can."""
        low = lower[self.joint]
        high = upper[self.joint]
        values = _wind_into_limits(np.array(self.values), low, high)
        inside = values[(values >= low) & (values <= high)]
        moved = q.copy()
        moved[:, self.joint] = rng.choice(inside if len(inside) else values, len(q))
        return moved


@dataclass(frozen=True)
class SlideFactor:
    """A factor abs(q + start) of a prismatic joint."""

    kind: ClassVar[Kind] = "elbow"
    joint: int
    """Index of the joint, from 0."""
    start: float
    """The length at q = 0, m."""
    lift: float
    """Constant part of the distance from the axis to the point, m."""
    size: float
    """The reach, m."""

    def measure(self, q: Array) -> Array:
        """Return abs(q + start) over the reach, shape (...), at joint positions (..., n), rad and m."""
        return np.abs(q[..., self.joint] + self.start) / self.size

    @property
    def values(self) -> tuple[float, ...]:
        """The joint's singular position, m."""
        return (-self.start + 0.0,)

    def words(self, point: str) -> str:
        """Return the joint positions where the factor vanishes, in words."""
        axis = f"axis {self.joint}"
        near = f"{self.lift:.6g} m from {axis}, as near as it gets" if self.lift else f"on {axis}"
        return f"q{self.joint + 1} = {self.values[0]:.6g} m: {point} is {near}"

    def moved_onto_singularity(
        self, q: Array, lower: Array, upper: Array, rng: np.random.Generator
    ) -> Array:
        """Return joint values q (k, n), rad and m, with this joint moved to the zero of the factor."""
        moved = q.copy()
        moved[:, self.joint] = self.values[0]
        return moved


@dataclass(frozen=True)
class Link:
    """A vector c e^(i (q2 + ...)) in an arm's plane as a complex number, or that times a joint's position."""

    c: complex
    """The vector x + i u at zero joint positions, m; its direction if a prismatic joint is a factor."""
    senses: tuple[float, ...] = ()
    """Senses, +1 or -1, in which joints 3, 4 ... turn it in addition to joint 2."""
    slide: int | None = None
    """Index, from 0, of the prismatic joint whose position is a factor; None if there is none."""

    def value(self, q: Array) -> NDArray[np.complex128]:
        """Return the vector at q2 = 0, shape (...), m, for joint positions (..., n), rad and m."""
        turned = self.c * np.exp(1j * (q[..., 2 : 2 + len(self.senses)] @ np.array(self.senses)))
        return np.asarray(turned if self.slide is None else turned * q[..., self.slide])

    def terms(self, least: float) -> list[tuple[float, str]]:
        """Return the terms of its x with numbers of at least ``least``: number, and function of q."""
        names = "".join(f" {'+' if s > 0 else '-'} q{k + 3}" for k, s in enumerate(self.senses))
        angle = f"(q2{names})" if names else " q2"

        # Re(c e^(i angle)) = Re(c) cos(angle) - Im(c) sin(angle).
        slide = "" if self.slide is None else f"q{self.slide + 1} "
        parts = [(self.c.real, f"{slide}cos{angle}"), (-self.c.imag, f"{slide}sin{angle}")]
        return [(number, text) for number, text in parts if abs(number) > least]


@dataclass(frozen=True)
class ShoulderFactor:
    """The factor abs(x), with x the distance of a point from axis 1 along the arm's plane.

    x = a1 + Re(sum of links) (:mod:`dhkit.kinematics.closed_form.arm_plane`).
    """

    kind: ClassVar[Kind] = "shoulder"
    a1: float
    """Distance of axis 2 from axis 1 along the plane, m."""
    links: tuple[Link, ...]
    offset: float
    """Signed distance of the point from axis 1 across the plane, m."""
    size: float
    """The reach, m."""
    values: ClassVar[tuple[float, ...]] = ()

    def measure(self, q: Array) -> Array:
        """Return abs(x) over the reach, shape (...), at joint positions (..., n), rad and m."""
        # x = a1 + Re(e^(i q2) A), where A is the sum of the links at q2 = 0.
        x = self.a1 + (np.exp(1j * q[..., 1]) * self._arm(q)).real
        return np.asarray(np.abs(x) / self.size)

    def radii(self, lower: Array, upper: Array) -> tuple[float, float]:
        """Return the least and largest distance of the point from axis 2, m, with joint limits (n,), rad and m."""
        fixed = [link.c for link in self.links if link.slide is None]
        slides = [(link.c, link.slide) for link in self.links if link.slide is not None]
        if not slides:
            return link_radii([abs(c) for c in fixed])

        # The vector from axis 2 is fixed + direction q with |direction| = 1: its length is |fixed / direction + q|.
        ((direction, joint),) = slides
        start = sum(fixed) / direction
        return slide_radii(start.real, start.imag, float(lower[joint]), float(upper[joint]))

    @property
    def never_vanishes(self) -> bool:
        """Whether the factor vanishes nowhere, because axis 2 is farther from axis 1 than the arm is long."""
        if any(link.slide is not None for link in self.links):
            return False
        return abs(self.a1) > sum(abs(link.c) for link in self.links)

    def words(self, point: str) -> str:
        """Return the joint positions where the factor vanishes, in words."""
        if self.never_vanishes:
            return f"never: {point} cannot come to axis 1"
        place = (
            f"on the cylinder of radius {abs(self.offset):.6g} m about axis 1"
            if self.offset
            else "on axis 1"
        )
        return f"{point} is {place}: {self.equation}"

    @property
    def equation(self) -> str:
        """The equation x = 0 with the arm's numbers, m, the first of them positive."""
        least = _MIN_TERM * self.size
        terms = [(self.a1, "")] if abs(self.a1) > least else []
        for link in self.links:
            terms += link.terms(least)
        turned = np.sign(terms[0][0])
        text = "".join(
            f" {'+' if turned * c > 0 else '-'} {_product(abs(c), name)}" for c, name in terms
        )
        return text.removeprefix(" + ") + " = 0"

    def moved_onto_singularity(
        self, q: Array, lower: Array, upper: Array, rng: np.random.Generator
    ) -> Array:
        """Return joint values q (k, n), rad and m, with joint 2 moved to x = 0, inside limits if possible; else NaN."""
        # a1 + Re(e^(i q2) A) = a1 + |A| cos(q2 + arg A) = 0, so that q2 = +-arccos(-a1 / |A|) - arg A. The arccosine is
        # NaN where the links are too short, |A| < |a1|. With a1 = 0 it is pi / 2 for every A, 0 included.
        arm = self._arm(q)
        length = np.abs(arm)
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = np.arccos(-self.a1 / length) if self.a1 else np.full(len(q), np.pi / 2)
        side = rng.choice([-1.0, 1.0], len(q))
        both = _wind_into_limits(
            np.stack([side * apart, -side * apart]) - np.angle(arm), lower[1], upper[1]
        )
        inside = (both[0] >= lower[1]) & (both[0] <= upper[1])
        moved = q.copy()
        moved[:, 1] = np.where(inside, both[0], both[1])
        return moved

    def _arm(self, q: Array) -> NDArray[np.complex128]:
        return np.asarray(sum(link.value(q) for link in self.links))


Factor: TypeAlias = AngleFactor | SlideFactor | ShoulderFactor


def link_radii(lengths: Sequence[float]) -> tuple[float, float]:
    """Return the least and largest distance, m, that links of these lengths, m, reach in a plane."""
    # The others, folded back, shorten the longest one: L_max - (sum L - L_max), or 0 if they are longer together.
    return max(0.0, 2 * max(lengths) - sum(lengths)), sum(lengths)


def slide_radii(start: float, lift: float, lower: float, upper: float) -> tuple[float, float]:
    """Return the least and largest of abs(start + q + i lift) for q inside limits; all in m."""
    # |start + q + i lift|^2 = (start + q)^2 + lift^2: least where |start + q| is, which may be 0 inside the limits.
    ends = (start + lower, start + upper)
    near = 0.0 if ends[0] <= 0 <= ends[1] else min(abs(end) for end in ends)
    return float(np.hypot(near, lift)), float(np.hypot(max(abs(end) for end in ends), lift))


def _degrees(angle: float) -> str:
    """Return an angle in words, to a hundredth of a degree."""
    return f"{round(float(np.degrees(angle)), 2) + 0.0:g}°"


def _product(number: float, name: str) -> str:
    if not name:
        return f"{number:.6g}"
    return name if name.startswith("q") and abs(number - 1) < _MIN_TERM else f"{number:.6g} {name}"


def _wrap_angle(angle: float) -> float:
    """Return an angle in (-pi, pi]."""
    # x - ceil(x - 1/2) is in (-1/2, 1/2], for x = angle / (2 pi) turns.
    turned = float(angle - math.tau * np.ceil(angle / math.tau - 0.5))
    return turned + 0.0


def _wind_into_limits(angles: Array, lower: float, upper: float) -> Array:
    """Return angles with whole turns added to lie inside limits, or reduced to (-pi, pi] where none do."""
    near = angles - math.tau * np.ceil(angles / math.tau - 0.5)

    # The smallest angle near + 2 pi k >= lower.
    first = near + math.tau * np.ceil((lower - near) / math.tau)
    return np.where((near < lower) | (near > upper), np.where(first <= upper, first, near), near)
