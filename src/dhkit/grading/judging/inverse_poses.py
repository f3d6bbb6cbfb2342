"""Random poses at which formulas of inverse kinematics are tried, with their known solutions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description, world_to_frames, world_to_tool
from dhkit.description.frames import carrying
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.kinematics import classify, inverse_kinematics, jacobian
from dhkit.symbolic import table_lengths

CLOSES = 1e-9
"""Largest error of a pose that is reached, in entries of the rotation, and of the position relative to the reach."""
MATCHES = 1e-6
"""Largest distance of joint values from a solution that they equal, rad and relative to the reach. It exceeds CLOSES
because small errors of a pose near a singular one are large errors of joint values."""
KNOWN = "known"
"""Beginning of the names of joint values that are known from elsewhere; no answer can contain them."""
_TOOL_AXES = {f"pitch of the tool's {axis} axis": k for k, axis in enumerate("xyz")}
"""Column of the tool's rotation that a part of a pose determines, by the names of parts that closed forms reach."""
_FEW_JOINTS = 3
"""Largest number of joints at which an arm without a closed form is asked for positions alone, if these determine its
joints."""
_STARTS = 12
"""Number of random starts of Newton's method for one pose."""
_STEPS = 30
"""Largest number of Newton steps from one start."""
_DAMPING = 1e-9
"""Levenberg's damping, in units of squared singular values: keeps steps finite at singular poses."""
_ARRIVES = 1e-13
"""Residual at which Newton's method stops: about the rounding errors of a product of ten transforms."""

Mask: TypeAlias = NDArray[np.bool_]
"""Array of truth values, such as one for each pose."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Random poses with their known solutions: S poses of an arm with n joints and B branches of its closed form.

    Attributes
    ----------
    description
        The robot.
    q
        Joint values from which the poses are computed, shape (S, n), rad and m.
    T
        The poses of the tool in the world, shape (S, 4, 4), m.
    solutions
        Solutions of the closed form, shape (S, B, n), rad and m, NaN where a branch does not reach a pose; B = 0
        without a closed form.
    pose_parts
        Names of the parts of a pose that the closed form reaches; empty without one.
    asks_rotation
        Whether the tool's whole rotation is required.
    axis
        Axis of the tool, from 0, that is required besides the position; None if none is.
    lower, upper
        Range of joint values, shape (n,), rad and m.
    known
        Joint values that formulas may use as known1, known2 ..., shape (S, n), rad and m; None for none.
    """

    description: Description
    q: Array
    T: Array
    solutions: Array
    pose_parts: tuple[str, ...]
    asks_rotation: bool
    axis: int | None
    lower: Array
    upper: Array
    known: Array | None = None

    @classmethod
    def random(
        cls, description: Description, samples: int, seed: int, *, whole_turns: bool = False
    ) -> Poses:
        """Return the poses of random joint values in the ranges of :func:`_joint_ranges`.

        With ``whole_turns`` all angles are in [-pi, pi), whatever their limits.
        """
        lower, upper = _joint_ranges(description)
        if whole_turns:
            is_revolute = ~description.numbers.prismatic
            lower = np.where(is_revolute, -np.pi, lower)
            upper = np.where(is_revolute, np.pi, upper)
        q = np.random.default_rng(seed).uniform(lower, upper, (samples, description.n))
        T = world_to_tool(description, q)

        if classify(description).family is None:
            return cls(
                description,
                q,
                T,
                solutions=np.empty((samples, 0, description.n)),
                pose_parts=(),
                asks_rotation=not _positions_determine_joints(description, q[0]),
                axis=None,
                lower=lower,
                upper=upper,
            )

        closed_form = inverse_kinematics(description, T)
        parts = closed_form.met
        return cls(
            description,
            q,
            T,
            solutions=np.where(closed_form.valid[..., None], closed_form.q, np.nan),
            pose_parts=parts,
            # The tool of a planar arm or a SCARA only turns about one axis: its yaw is its whole rotation.
            asks_rotation=len(parts) == 6 or "yaw" in parts,
            axis=next((_TOOL_AXES[part] for part in parts if part in _TOOL_AXES), None),
            lower=lower,
            upper=upper,
        )

    def at(self, chosen: Sequence[int] | NDArray[np.intp]) -> Poses:
        """Return the poses of some indices, shape (k,)."""
        index = np.asarray(chosen, dtype=int)
        known = None if self.known is None else self.known[index]
        return replace(
            self, q=self.q[index], T=self.T[index], solutions=self.solutions[index], known=known
        )

    def followed_by(self, other: Poses) -> Poses:
        """Return these poses and then those of another set of the same arm."""
        return replace(
            self,
            q=np.concatenate([self.q, other.q]),
            T=np.concatenate([self.T, other.T]),
            solutions=np.concatenate([self.solutions, other.solutions]),
            known=None,
        )

    @property
    def has_closed_form(self) -> bool:
        """Whether the solutions come from a closed form, which gives all of them."""
        return bool(self.solutions.shape[1])

    @cached_property
    def scale(self) -> float:
        """The reach, m; 1 if the arm has none."""
        reach = self.description.reach
        return reach if np.isfinite(reach) and reach > 0 else 1.0

    @cached_property
    def values(self) -> dict[str, Array | float]:
        """Values by name, SI units and rad: lengths and parameters, px ... r33 and known joint values of shape (S,)."""
        values: dict[str, Array | float] = {}
        values |= {name: float(value) for name, value in table_lengths(self.description).items()}
        values |= self.description.numbers.values

        position = np.moveaxis(self.T[:, :3, 3], -1, 0)
        rotation = self.T[:, :3, :3].reshape(-1, 9).T
        values |= zip(POSE_NAMES, [*position, *rotation], strict=True)

        if self.known is not None:
            values |= {f"{KNOWN}{i + 1}": column for i, column in enumerate(self.known.T)}
        return values

    @cached_property
    def truths(self) -> Array:
        """All known solutions, shape (S, B + 1, n), rad and m; the last are the joint values that gave the poses."""
        known = self.solutions if self.has_closed_form else self._search()
        return np.concatenate([known, self.q[:, None]], axis=1)

    @cached_property
    def isolated(self) -> bool:
        """Whether solutions are single points: an arm with more joints than the pose determines has curves of them."""
        if self.has_closed_form:
            return True
        J = self._linearised(self.q[:1], self.T[:1])[1][0]
        return int(np.linalg.matrix_rank(J, 1e-5)) == self.description.n

    def _search(self) -> Array:
        """Return solutions by Newton's method from random starts, (S, _STARTS, n), rad and m; NaN for no solution."""
        S, n = self.q.shape
        if not self.isolated:
            return np.empty((S, 0, n))

        q = np.random.default_rng(0).uniform(self.lower, self.upper, (S, _STARTS, n)).reshape(-1, n)
        T = np.repeat(self.T, _STARTS, axis=0)
        stroke = np.where(self.description.numbers.prismatic, self.scale, 1.0)

        # Newton's method with Levenberg's damping; starts that have arrived are left out of further steps.
        going = np.arange(len(q))
        for _ in range(_STEPS):
            gap, J = self._linearised(q[going], T[going])
            has_arrived = np.max(np.abs(gap), axis=1) <= _ARRIVES
            going = going[~has_arrived]
            gap = gap[~has_arrived]
            J = J[~has_arrived]
            if not len(going):
                break

            # (J^T J + damping) step = -J^T gap
            normal = np.swapaxes(J, 1, 2) @ J + _DAMPING * np.eye(n)
            right = -np.einsum("sij,si->sj", J, gap)
            step = np.linalg.solve(normal, right[..., None])[..., 0]

            # No joint moves by more than 1 rad, or by the reach, in one step.
            longest = np.max(np.abs(step / stroke), axis=1, keepdims=True)
            q[going] += step * np.minimum(1.0, 1.0 / np.maximum(longest, 1e-300))

        converged = np.max(np.abs(self.residuals(q, T)), axis=1) <= CLOSES
        return np.where(converged[:, None], q, np.nan).reshape(S, _STARTS, n)

    def _linearised(self, q: Array, T: Array) -> tuple[Array, Array]:
        """Return :meth:`residuals` (S, k) and their derivatives by the joint values (S, k, n)."""
        numbers = self.description.numbers
        frames = world_to_frames(self.description, q)
        tool = frames[:, -1] @ numbers.T_last_tool
        joints = carrying(self.description.convention, np.moveaxis(frames, 1, 0))
        derivatives = []
        for joint, is_prismatic in zip(joints, numbers.prismatic, strict=True):
            z = joint[:, :3, 2]
            o = joint[:, :3, 3]
            derivative = np.zeros_like(tool)
            if is_prismatic:
                # dp/dq = z, and the axes stay
                derivative[:, :3, 3] = z
            else:
                # d(x_t, y_t, z_t, p)/dq = z x (x_t, y_t, z_t, p - o)
                vectors = tool[:, :3].copy()
                vectors[:, :, 3] -= o
                derivative[:, :3] = np.cross(z[:, :, None], vectors, axis=1)
            derivatives.append(self._required(derivative))
        return self._required(tool - T), np.stack(derivatives, axis=-1)

    def residuals(self, q: Array, T: Array) -> Array:
        """Return the errors (S, k) of q (S, n), rad and m, in required parts of poses; lengths over the reach."""
        finite = np.where(np.isfinite(q), q, np.nan)
        return self._required(world_to_tool(self.description, finite) - T)

    def _required(self, gap: Array) -> Array:
        """Return the required parts of differences of poses or of derivatives, (S, 4, 4), as rows (S, k)."""
        columns = [gap[:, :3, 3] / self.scale]
        if self.asks_rotation:
            columns.append(gap[:, :3, :3].reshape(-1, 9))
        elif self.axis is not None:
            columns.append(gap[:, :3, self.axis])
        return np.concatenate(columns, axis=1)

    def closes(self, q: Array) -> Mask:
        """Return a mask (S,) of the poses that joint values of shape (S, n), rad and m, reach."""
        near: Mask = np.max(np.abs(self.residuals(q, self.T)), axis=1) <= CLOSES
        return near

    def gaps(self, a: Array, b: Array, joint: int | slice | list[int] = slice(None)) -> Array:
        """Return the distances of joint values (..., n): of angles the short way in rad, else relative to the reach."""
        prismatic = self.description.numbers.prismatic[joint]
        gap = a - b
        # Subtracting the nearest whole number of turns is many times faster than a remainder.
        wrapped = gap - 2 * np.pi * np.rint(gap / (2 * np.pi))
        return np.abs(np.where(prismatic, gap / self.scale, wrapped))

    def matches(self, q: Array, solutions: Array) -> Mask:
        """Return a mask (S, B) of the solutions (S, B, n), rad and m, that equal joint values q (S, n)."""
        near: Mask = np.all(self.gaps(q[:, None], solutions) < MATCHES, axis=-1)
        return near

    def same(self, a: Array, b: Array) -> bool:
        """Whether the joint values of two branches, shape (S, n), are equal wherever both have values."""
        both = np.all(np.isfinite(a) & np.isfinite(b), axis=1)
        return bool(np.any(both) and np.all(self.gaps(a[both], b[both]) < MATCHES))


def _joint_ranges(description: Description) -> tuple[Array, Array]:
    """Return the lower and upper ends of the random joint values, shape (n,) each, rad and m.

    They are a joint's limits. A joint without limits has a turn about zero, or a metre outwards from zero, because
    displacements of prismatic joints are positive by custom; one with a single limit has as much from there.
    """
    numbers = description.numbers
    width = np.where(numbers.prismatic, 1.0, 2 * np.pi)
    has_lower = np.isfinite(numbers.lower)
    has_upper = np.isfinite(numbers.upper)

    start = np.where(numbers.prismatic, 0.0, -np.pi)
    start = np.where(has_upper, numbers.upper - width, start)
    lower = np.where(has_lower, numbers.lower, start)
    upper = np.where(has_upper, numbers.upper, lower + width)
    return lower, upper


def _positions_determine_joints(description: Description, q: Array) -> bool:
    """Whether the tool's position determines the joints near q, shape (n,): no joint only turns the tool."""
    if description.n > _FEW_JOINTS:
        return False
    return bool(np.linalg.matrix_rank(jacobian(description, q)[:3], 1e-9) == description.n)
