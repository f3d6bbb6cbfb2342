"""Random poses that formulas of inverse kinematics are tried on, with the solutions that are known of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description, world_to_tool
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.kinematics import classify, inverse_kinematics, jacobian

CLOSES = 1e-9
"""rad, and share of the reach: how near to a pose joint values have to bring the tool."""
MATCHES = 1e-6
"""rad, and share of the reach: joint values this near to a solution's are its: poses near singular ones widen gaps."""
TOOL_AXES = {f"pitch of the tool's {axis} axis": k for k, axis in enumerate("xyz")}
"""Which column of the tool's rotation an arm meets that meets this part of a pose."""
FEW_JOINTS = 3
"""An arm of so many joints, without a closed form, is asked for positions alone where these determine its joints."""
STARTS, STEPS = 12, 30
"""Of Newton's method for one pose: random joint values to begin at, and steps from each."""
DAMPING = 1e-9
"""Levenberg's, in units of the squared singular values: keeps steps finite at singular poses."""
DIFFERENCE = 1e-7
"""rad and m: of finite differences; Newton's method then converges linearly, by this factor a step."""

Mask: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Poses:
    """Random poses, with the solutions that are known of them.

    Attributes
    ----------
    description
        The robot.
    q
        Joint values that the poses come from, shape (S, n), rad and m.
    T
        The poses, world to tool, shape (S, 4, 4).
    solutions
        Those of the closed form, shape (S, B, n), NaN where a branch does not reach; B = 0 without a closed form.
    met
        The parts of a pose that the closed form meets; empty without one.
    asks_rotation
        Whether the tool's whole rotation is asked for.
    axis
        Which of the tool's axes is asked for besides the position, from 0; None if none is.
    lower, upper
        The range of joint values, shape (n,), rad and m.
    """

    description: Description
    q: Array
    T: Array
    solutions: Array
    met: tuple[str, ...]
    asks_rotation: bool
    axis: int | None
    lower: Array
    upper: Array

    @classmethod
    def random(cls, description: Description, samples: int, seed: int) -> Poses:
        """Return poses of random joint values in :func:`joint_ranges`."""
        lower, upper = joint_ranges(description)
        q = np.random.default_rng(seed).uniform(lower, upper, (samples, description.n))
        T = world_to_tool(description, q)
        if classify(description).family is None:
            known = np.empty((samples, 0, description.n))
            whole = not _positions_determine_joints(description, q[0])
            return cls(description, q, T, known, (), whole, None, lower, upper)
        found = inverse_kinematics(description, T)
        solutions = np.where(found.valid[..., None], found.q, np.nan)
        # A yaw with all positions is all that a planar arm or a SCARA leaves open.
        whole = len(found.met) == 6 or "yaw" in found.met
        axis = next((TOOL_AXES[part] for part in found.met if part in TOOL_AXES), None)
        return cls(description, q, T, solutions, found.met, whole, axis, lower, upper)

    def at(self, chosen: Sequence[int] | NDArray[np.intp]) -> Poses:
        """Return some of the poses."""
        index = np.asarray(chosen, dtype=int)
        return replace(self, q=self.q[index], T=self.T[index], solutions=self.solutions[index])

    @property
    def has_closed_form(self) -> bool:
        """Whether the solutions are those of a closed form, all of them."""
        return bool(self.solutions.shape[1])

    @cached_property
    def scale(self) -> float:
        """The reach, m; 1 where there is none."""
        reach = self.description.reach
        return reach if np.isfinite(reach) and reach > 0 else 1.0

    @cached_property
    def values(self) -> dict[str, Array | float]:
        """Values by name: of the poses, shape (S,), and of parameters."""
        entries = [*np.moveaxis(self.T[:, :3, 3], -1, 0), *self.T[:, :3, :3].reshape(-1, 9).T]
        return {**self.description.numbers.values, **dict(zip(POSE_NAMES, entries, strict=True))}

    @cached_property
    def truths(self) -> Array:
        """All solutions known, the joint values that a pose comes from last, shape (S, B + 1, n)."""
        known = self.solutions if self.has_closed_form else self._found()
        return np.concatenate([known, self.q[:, None]], axis=1)

    @cached_property
    def isolated(self) -> bool:
        """Whether solutions do not move: an arm with more joints than it is asked for has whole curves of them."""
        if self.has_closed_form:
            return True
        J = self._derivatives(self.q[:1], self.T[:1])[0]
        return int(np.linalg.matrix_rank(J, 1e-5)) == self.description.n

    def _found(self) -> Array:
        """Return solutions found by Newton's method from random starts, shape (S, STARTS, n); NaN where none is."""
        S, n = self.q.shape
        if not self.isolated:
            return np.empty((S, 0, n))
        q = np.random.default_rng(0).uniform(self.lower, self.upper, (S, STARTS, n)).reshape(-1, n)
        T = np.repeat(self.T, STARTS, axis=0)
        stroke = np.where(self.description.numbers.prismatic, self.scale, 1.0)
        for _ in range(STEPS):
            gap, J = self.residuals(q, T), self._derivatives(q, T)
            normal = np.swapaxes(J, 1, 2) @ J + DAMPING * np.eye(n)
            step = np.linalg.solve(normal, -np.einsum("sij,si->sj", J, gap)[..., None])[..., 0]
            longest = np.max(np.abs(step / stroke), axis=1, keepdims=True)
            q = q + step * np.minimum(1.0, 1.0 / np.maximum(longest, 1e-300))
        met = np.max(np.abs(self.residuals(q, T)), axis=1) <= CLOSES
        return np.where(met[:, None], q, np.nan).reshape(S, STARTS, n)

    def _derivatives(self, q: Array, T: Array) -> Array:
        """Return the derivatives of :meth:`residuals` by the joint values, shape (S, k, n)."""
        at = self.residuals(q, T)
        units = np.eye(self.description.n) * DIFFERENCE
        return np.stack([(self.residuals(q + unit, T) - at) / DIFFERENCE for unit in units], axis=-1)

    def residuals(self, q: Array, T: Array) -> Array:
        """Return how far joint values (S, n) are from what is asked of poses: shape (S, k), lengths over the reach."""
        gap = world_to_tool(self.description, np.where(np.isfinite(q), q, np.nan)) - T
        columns = [gap[:, :3, 3] / self.scale]
        if self.asks_rotation:
            columns.append(gap[:, :3, :3].reshape(-1, 9))
        elif self.axis is not None:
            columns.append(gap[:, :3, self.axis])
        return np.concatenate(columns, axis=1)

    def closes(self, q: Array) -> Mask:
        """Return which poses joint values of shape (S, n) bring the tool to."""
        near: Mask = np.max(np.abs(self.residuals(q, self.T)), axis=1) <= CLOSES
        return near

    def gaps(self, a: Array, b: Array, joint: int | slice = slice(None)) -> Array:
        """Return how far joint values are apart: angles the short way round, slides over the reach."""
        prismatic = self.description.numbers.prismatic[joint]
        with np.errstate(invalid="ignore"):
            turned = np.abs(np.remainder(a - b + np.pi, 2 * np.pi) - np.pi)
            return np.where(prismatic, np.abs(a - b) / self.scale, turned)

    def matches(self, q: Array, solutions: Array) -> Mask:
        """Return which solutions, shape (S, B, n), joint values of shape (S, n) are."""
        near: Mask = np.all(self.gaps(q[:, None], solutions) < MATCHES, axis=-1)
        return near

    def same(self, a: Array, b: Array) -> bool:
        """Return whether two branches give the same joint values wherever both have some."""
        both = np.all(np.isfinite(a) & np.isfinite(b), axis=1)
        return bool(np.any(both) and np.all(self.gaps(a[both], b[both]) < MATCHES))


def joint_ranges(description: Description) -> tuple[Array, Array]:
    """Return the joint values that poses are drawn from, shape (n,) each, rad and m.

    A joint's limits; without both of them a whole turn about zero, or a slide of a metre outwards from zero: people
    mean slides to be positive unless limits say otherwise.
    """
    numbers = description.numbers
    width = np.where(numbers.prismatic, 1.0, 2 * np.pi)
    low, high = np.isfinite(numbers.lower), np.isfinite(numbers.upper)
    free = np.where(numbers.prismatic, 0.0, -np.pi)
    lower = np.where(low, numbers.lower, np.where(high, numbers.upper - width, free))
    return lower, np.where(high, numbers.upper, lower + width)


def _positions_determine_joints(description: Description, q: Array) -> bool:
    """Whether the tool's position alone determines an arm's joints: three at most, and none only turns the tool."""
    if description.n > FEW_JOINTS:
        return False
    return bool(np.linalg.matrix_rank(jacobian(description, q)[:3], 1e-9) == description.n)
