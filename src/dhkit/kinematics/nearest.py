"""The pose nearest to a wanted one that an arm of five joints reaches: the same position, turned by the least angle.

Axis 5 stays in a plane that joint 1 turns (:mod:`dhkit.kinematics.closed_form.five_joints`). For a position of the
tool there are two shoulders, and for each a surface of rotations, by the angle rho of axis 5 in the plane and by q5:

    R(q1, rho, q5) = Rot(u, q1) Rot(v, rho) Rot(d, q5) R_0,

with axis 1 along u, axes 2 to 4 along v, and axis 5 along d at zero joint values. q1 follows from q5: the tool's origin
lies beside the plane by s(q5). At a given q5 the best rho is known in closed form; q5 is searched for on the arcs
where s(q5) is no larger than the position's distance from axis 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description, takes_robot
from dhkit.description.poses import turned_about
from dhkit.errors import ModelError
from dhkit.kernels import pose_rows
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.candidates import are_poses, orthonormal
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.arm_plane import ArmPlane
from dhkit.kinematics.closed_form.five_joints import five_joints_fit

_SAMPLES = 64
"""Parts of an arc of q5 at whose ends the search begins."""
_LEVELS = 3
"""Number of times that the surroundings of samples nearly in reach are sampled again: intervals of q5 in which the
position is in reach may be as narrow as 1e-6 rad beside others."""
_NEARLY = 10.0
"""How far such a sample is out of reach at most, over the square of the distance between samples."""
_PARTS = 8
"""Parts into which the interval around a peak is divided again and again."""
_TIMES = 13
"""Number of divisions: the interval shrinks by 4 each time, to 2e-10 of the arc."""
_OUT_OF_REACH = -5.0
"""Value below those of all traces of rotations, which are -1 to 3."""
_ROUNDING = 1e-14
"""Share of the reach, and of the distance from the world's origin, by which a position may be out of reach."""
_SLACK = 0.1
"""Part of that by which solutions may be out of reach: ``ik`` has to reach them."""
_FLAT = 1e-13
"""Difference of two traces that is rounding."""
_SHORT = 1e-3
"""Product of two lengths, over the reach squared, that is small."""
_ON_AXIS = 1e-9
"""Distance from axis 1, over the reach, at which a position counts as on it, as ``ik`` has it."""
_LEAST_ROOM = 1e-30
"""Divisor, over the reach squared, instead of 0."""
_U = np.array([0.0, 1.0, 0.0])
_V = np.array([0.0, 0.0, 1.0])
"""Directions u and v in the frame (x, u, v)."""
_TOGETHER = 256
"""Poses that are searched together, some 40 MB."""


@takes_robot
def nearest_pose(description: Description, T: ArrayLike) -> Array:
    """Return the nearest pose that an arm of five joints reaches: the same position, turned by the least angle.

    Joint limits are not regarded. The angle is the least to 1e-7 rad. A pose takes about 0.5 ms, and one at a position
    on axis 1, which joint 1 leaves in place, 0.1 s.

    Parameters
    ----------
    description
        The robot: a turntable, three parallel axes, and a last axis that rolls the tool, such as SO-101 or ScorBot.
    T
        Poses of the tool in the world, shape (..., 4, 4), m.

    Returns
    -------
    Array
        Shape (..., 4, 4), m; NaN where the position is out of reach, or T is no pose.

    Raises
    ------
    ModelError
        Another arm.
    ValueError, TypeError
        T has not shape (..., 4, 4), or is not numeric.

    Examples
    --------
    >>> from dhkit import Arm
    >>> rows = [[0, 349, 16, -90], [0, 0, 221, 0], [0, 0, 221, 0], [90, 0, 0, 90], [0, 145, 0, 0]]
    >>> scorbot = Arm.from_dh(rows, length="mm", angle="deg")
    >>> T = np.array([[0, 0, 1, 0.3], [0, 1, 0, 0.2], [-1, 0, 0, 0.4], [0, 0, 0, 1]])
    >>> nearest_pose(scorbot, T)[:2, 2].round(3).tolist()
    [0.832, 0.555]
    """
    arm = _Plane.of(description)
    poses = pose_rows(T)
    rows = poses.reshape(-1, 4, 4)
    posed = np.flatnonzero(are_poses(rows))
    nearest = np.full(rows.shape, np.nan)
    for begin in range(0, len(posed), _TOGETHER):
        some = posed[begin : begin + _TOGETHER]
        nearest[some] = arm.nearest(orthonormal(rows[some]))
    return nearest.reshape(poses.shape)


@dataclass(frozen=True, eq=False)
class _Plane:
    """An arm of five joints in the frame (x, u, v) of its plane at zero joint values."""

    R: Array
    """Directions x, u and v in the world, one a row, shape (3, 3)."""
    t: Array
    """The world's origin in this frame, shape (3,), m."""
    R_0: Array
    """Rotation of the tool at zero joint values, shape (3, 3)."""
    d: Array
    """Direction of axis 5 at zero joint values, shape (3,)."""
    arm: Array
    """From axis 5 to the tool's origin, across the axis, at zero joint values, shape (3,), m."""
    first_roll: float
    """The roll at zero joint values: the angle of ``arm`` about axis 5 from v."""
    foot: Array
    """From axis 4 to the point of axis 5 next to the tool's origin, in the plane; and its v coordinate; (3,), m."""
    a1: float
    """Distance of axis 2 from axis 1 along x, m."""
    reach: tuple[float, float]
    """Least and largest distance of axis 4 from axis 2, m."""

    @classmethod
    @lru_cache(maxsize=64)
    def of(cls, description: Description) -> _Plane:
        """Return an arm's plane; raise ModelError for arms of another kind."""
        axes = Axes.of(description)
        fit = five_joints_fit(axes)
        if fit is None:
            words = classify(description).words
            raise ModelError(
                f"{description.name} is {words}; nearest_pose is for a turntable, three parallel axes and a last one"
                " across them"
            )
        p = {name: np.asarray(value, dtype=float) for name, value in fit.parameters.items()}
        R = ArmPlane.of(axes).R
        R_0 = R @ axes.T_world_tool[:3, :3]
        L2, L3 = float(p["L2"]), float(p["L3"])
        d = R_0 @ p["axis"]
        arm = -R_0 @ p["foot"]
        return cls(
            R=R,
            t=p["T_plane_world"][:3, 3],
            R_0=R_0,
            d=d,
            arm=arm,
            first_roll=float(np.arctan2(np.cross(d, _V) @ arm, arm[2])),
            foot=np.array([*p["lever"], float(p["offset"])]),
            a1=float(p["a1"]),
            reach=(abs(L2 - L3), L2 + L3),
        )

    def nearest(self, T: Array) -> Array:
        """Return the nearest poses of poses (N, 4, 4), NaN where the position is out of reach."""
        R = self.R @ T[:, :3, :3]
        p = T[:, :3, 3] @ self.R.T + self.t
        far = np.linalg.norm(T[:, :3, 3], axis=1) + np.linalg.norm(self.t)
        far += np.linalg.norm(self.arm) + np.linalg.norm(self.foot)
        rounding = _ROUNDING * (1.0 + far / self.reach[1])

        # Joint 1 turns x + i v to e^(-i q1) (x + i v).
        azimuth = np.arctan2(p[:, 2], p[:, 0])
        trace, turned = self._search(R, p, azimuth, rounding)
        for k in np.flatnonzero(np.hypot(p[:, 0], p[:, 2]) < _ON_AXIS * self.reach[1]):
            trace[k], turned[k] = self._with_joint_1_free(R[k], p[k], rounding[k])
        nearest = T.copy()
        nearest[:, :3, :3] = self.R.T @ turned
        nearest[trace < _OUT_OF_REACH] = np.nan
        return nearest

    def _with_joint_1_free(self, R: Array, p: Array, rounding: float) -> tuple[float, Array]:
        """Return the largest trace, and the rotation, of a pose at a position on axis 1, which joint 1 leaves in place.

        Its azimuth is searched for as well: R is (3, 3), p is (3,), m.
        """
        on_axis = np.array([0.0, p[1], 0.0])

        def at(azimuth: Array) -> tuple[Array, Array]:
            """Return traces (...) and rotations (..., 3, 3) at azimuths (...)."""
            count = azimuth.size
            trace, turned = self._search(
                np.broadcast_to(R, (count, 3, 3)),
                np.broadcast_to(on_axis, (count, 3)),
                azimuth.ravel(),
                np.full(count, rounding),
            )
            return trace.reshape(azimuth.shape), turned.reshape(*azimuth.shape, 3, 3)

        # A little more than one turn, so that a peak at its end is one inside.
        tried = np.linspace(-np.pi, np.pi + 4 * np.pi / _SAMPLES, _SAMPLES + 3)[None]
        row, place = _peaks(at(tried)[0])
        middle = tried[row, place]
        step = 2 * np.pi / _SAMPLES
        for _ in range(_TIMES):
            tried = middle[:, None] + step * np.linspace(-1.0, 1.0, _PARTS + 1)
            trace, turned = at(tried)
            step *= 2 / _PARTS
            best = np.arange(len(tried)), trace.argmax(axis=1)
            # A trace changes by 2 a radian at most; what is reached on the axis does not depend on the azimuth.
            is_kept = trace[best] >= trace.max() - 4 * step
            middle = tried[best][is_kept]
        k = int(trace[best].argmax())
        return float(trace[best][k]), turned[best][k]

    def _search(self, R: Array, p: Array, azimuth: Array, rounding: Array) -> tuple[Array, Array]:
        """Return the largest trace(R^T rotation) of poses, (N,), and the rotations (N, 3, 3).

        Parameters
        ----------
        R, p
            The wanted poses in the frame (x, u, v), shapes (N, 3, 3) and (N, 3), m.
        azimuth
            Of the positions about axis 1 in that frame, shape (N,), rad.
        rounding
            Share of the reach by which a position may be out of reach by rounding, shape (N,).
        """
        # Four rows for each pose: two shoulders, and two arcs of the roll.
        owner = np.repeat(np.arange(len(p)), 4)
        shoulder = np.tile([1.0, 1.0, -1.0, -1.0], len(p))
        turn = np.tile([1.0, -1.0, 1.0, -1.0], len(p))
        from_axis_1 = np.hypot(p[:, 0], p[:, 2]) + _SLACK * rounding * self.reach[1]
        begin, end = (np.repeat(values, 4) for values in self._arc(from_axis_1))

        def best(row: NDArray[np.intp], share: Array) -> tuple[Array, Array, Array, Array]:
            """Return what _best returns at parts of the rows' arcs, and q5; the parts are closer at an arc's ends."""
            part = (1.0 - np.cos(np.pi * share)) / 2
            roll = begin[row, None] + (end - begin)[row, None] * part
            q5 = turn[row, None] * roll - self.first_roll
            pose = owner[row]
            return *self._best(
                R[pose], p[pose], azimuth[pose], shoulder[row], q5, rounding[pose]
            ), q5

        # Rows that are sampled, and around which part of the arc. Every peak is a row of the search below.
        row = np.arange(len(owner))
        middle = np.full(len(row), 0.5)
        step = 0.5
        peaks = []
        for _ in range(_LEVELS):
            share = middle[:, None] + step * np.linspace(-1.0, 1.0, _SAMPLES + 1)
            value, *_ = best(row, share)
            step *= 2 / _SAMPLES
            at = _peaks(value)
            peaks.append((row[at[0]], share[at], np.full(len(at[0]), step)))
            missed = 2 * _OUT_OF_REACH - value
            at = np.nonzero((missed > 0.0) & (missed < _NEARLY * step**2))
            row = row[at[0]]
            middle = share[at]
        row, middle, size = (np.concatenate(parts) for parts in zip(*peaks, strict=True))
        for _ in range(_TIMES):
            share = middle[:, None] + size[:, None] * np.linspace(-1.0, 1.0, _PARTS + 1)
            value, q1, rho, q5 = best(row, share)
            at = np.arange(len(row)), value.argmax(axis=1)
            middle = share[at]
            size = size * (2 / _PARTS)
        height = value[at]
        # The highest peak of each pose is its last one in this order.
        order = np.lexsort([height, owner[row]])
        last = order[np.append(np.flatnonzero(np.diff(owner[row][order])), len(order) - 1)]
        q1, rho, q5 = (angles[at][last] for angles in (q1, rho, q5))
        turned = turned_about(_U, q1) @ turned_about(_V, rho) @ turned_about(self.d, q5) @ self.R_0
        return height[last], turned

    def _arc(self, far: Array) -> tuple[Array, Array]:
        """Return the least and the largest roll at which the tool is beside the plane by no more than ``far``, (N,), m.

        The tool's origin lies beside the plane by foot + |arm| cos(roll), at rolls and at their negatives.
        """
        radius = max(float(np.linalg.norm(self.arm)), _LEAST_ROOM * self.reach[1])
        least = np.arccos(np.clip((far - self.foot[2]) / radius, -1.0, 1.0))
        most = np.arccos(np.clip((-far - self.foot[2]) / radius, -1.0, 1.0))
        return least, most

    def _best(
        self, R: Array, p: Array, azimuth: Array, shoulder: Array, q5: Array, rounding: Array
    ) -> tuple[Array, Array, Array]:
        """Return the largest trace(R^T rotation) at values (N, k) of joint 5, and the angles q1 and rho it is at.

        Where the position is out of reach, the trace is below ``_OUT_OF_REACH``, by how far it is.

        Parameters
        ----------
        R, p
            The wanted poses in the frame (x, u, v), shapes (N, 3, 3) and (N, 3), m.
        azimuth
            Of the positions about axis 1, shape (N,), rad.
        shoulder
            1 where the tool is in front of axis 1 in the plane, -1 where it is behind it, shape (N,).
        q5
            Shape (N, k), rad.
        rounding
            Share of the reach by which a position may be out of reach by rounding, shape (N,).
        """
        roll = turned_about(self.d, q5)
        lever = roll @ self.arm + self.foot
        rolled = roll @ self.R_0
        s = lever[..., 2]
        square = (p[:, 0] ** 2 + p[:, 2] ** 2)[:, None] - s**2
        beside = np.maximum(-square, 0.0) / self.reach[1] ** 2
        x = shoulder[:, None] * np.sqrt(np.maximum(square, 0.0))
        # On axis 1 both are 0 but for rounding.
        in_plane = np.where(np.hypot(s, x) < _ON_AXIS * self.reach[1], 0.0, np.arctan2(s, x))
        q1 = in_plane - azimuth[:, None]
        turn = turned_about(_U, q1)
        # trace(R^T turn Rot(v, rho) rolled) = trace(Rot(v, rho) B).
        B = rolled @ np.swapaxes(R, -1, -2)[:, None] @ turn
        along = B[..., 0, 0] + B[..., 1, 1]
        across = B[..., 0, 1] - B[..., 1, 0]
        to_axis_2 = np.stack([x - self.a1, np.broadcast_to(p[:, 1, None], x.shape)], axis=-1)
        wanted = np.arctan2(across, along)
        rho, missed = self._angle(wanted, to_axis_2, lever[..., :2], rounding)
        missed = missed + beside
        trace = B[..., 2, 2] + np.cos(rho) * along + np.sin(rho) * across
        value = np.where(missed > rounding[:, None], 2 * _OUT_OF_REACH - missed, trace)
        return value, q1, rho

    def _angle(
        self, wanted: Array, tool: Array, lever: Array, rounding: Array
    ) -> tuple[Array, Array]:
        """Return the angles nearest to the wanted ones (...) at which two links reach axis 4, and how far they miss it.

        Axis 4 is at tool - e^(i rho) lever from axis 2, both (..., 2):

            |axis 4|^2 = |tool|^2 + |lever|^2 - 2 |tool| |lever| cos(rho - middle).
        """
        middle = np.arctan2(tool[..., 1], tool[..., 0]) - np.arctan2(lever[..., 1], lever[..., 0])
        squares = (tool**2).sum(axis=-1) + (lever**2).sum(axis=-1)
        product = 2 * np.linalg.norm(tool, axis=-1) * np.linalg.norm(lever, axis=-1)
        least, most = self.reach
        # By how much |axis 4|^2 is too large or too small at any angle, over the reach squared.
        excess = np.maximum(squares - product - most**2, least**2 - squares - product)
        missed = np.maximum(excess, 0.0) / most**2
        # The cosine is at least (squares - most^2) / product, so that |rho - middle| is between two angles of [0, pi].
        # With the tool nearly on axis 4 there is no lever: only rounding tells whether any angle is possible.
        slack = np.where(product < _SHORT * most**2, _SLACK * rounding[:, None] * most**2, 0.0)
        room = np.maximum(product, _LEAST_ROOM * most**2)
        near = np.arccos(np.clip((squares - least**2 + slack) / room, -1.0, 1.0))
        far = np.arccos(np.clip((squares - most**2 - slack) / room, -1.0, 1.0))
        gap = np.remainder(wanted - middle + np.pi, 2 * np.pi) - np.pi
        rho: Array = middle + np.copysign(np.clip(np.abs(gap), near, far), gap)
        return rho, missed


def _peaks(value: Array) -> tuple[NDArray[np.intp], ...]:
    """Return row and column of every sample (N, k) that is larger than the next, and no smaller than the one before.

    Differences of rounding count for nothing: where all are equal, the last one is returned.
    """
    beside = np.pad(value, ((0, 0), (1, 1)), constant_values=-np.inf)
    return np.nonzero((value >= beside[:, :-2] - _FLAT) & (value > beside[:, 2:] + _FLAT))
