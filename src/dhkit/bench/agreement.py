"""Agreement of a contender's answers with dhkit's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.contenders import INVERSE_KINEMATICS, Task, Workload
from dhkit.description import Array
from dhkit.display import value_line

_TOLERANCE = 1e-9
"""Largest error of answers that agree. Errors of ik are in m or rotation entries; all others are divided by the largest
entry of dhkit's results over the compared items, if that is above 1."""
_CHECKED_ITEMS = 32
"""Items that are compared: enough to meet every branch, few enough for a solver that takes 50 ms."""


@dataclass(frozen=True)
class Verdict:
    """The difference of a contender's answers from dhkit's.

    Attributes
    ----------
    error
        Largest difference of an entry, divided by dhkit's largest entry if that is above 1; for ``ik`` the largest
        difference, m or rotation entry, between the pose asked for and the pose that a solution reaches (its position
        alone if the arm's closed form does not reach whole poses). None if there is no answer, or if a compared entry
        is not finite.
    solutions
        Mean number of solutions that lead to the pose, for ``ik``; None for other quantities.
    """

    error: float | None
    solutions: float | None = None

    @property
    def ok(self) -> bool:
        """Whether the two agree."""
        return self.error is not None and self.error <= _TOLERANCE

    def __str__(self) -> str:
        error = "no answer" if self.error is None else f"{self.error:.0e}"
        return error if self.ok else f"DISAGREES: {error}"

    __repr__ = value_line


def judge(workload: Workload, quantity: str, task: Task) -> Verdict:
    """Compare the first answers of a task with dhkit's own."""
    count = min(_CHECKED_ITEMS, len(workload.q))
    answers = task.answers(count)
    if quantity in INVERSE_KINEMATICS:
        return _judge_solutions(workload, workload.inputs(quantity)[0], answers)
    ours = stacked(getattr(workload.arm, quantity)(*(x[:count] for x in workload.inputs(quantity))))
    return Verdict(_worst((np.asarray(answers) - ours) / max(1.0, float(np.abs(ours).max()))))


def stacked(result: Any) -> Array:
    """Return a quantity of N items with N as its first axis: derivatives, which are three arrays, as (N, 3, n, n)."""
    return np.stack(result, axis=-3) if isinstance(result, tuple) else np.asarray(result)


def _judge_solutions(workload: Workload, T: Array, answers: Sequence[Array]) -> Verdict:
    counts = [len(solutions) for solutions in answers]
    poses = np.repeat(T[: len(answers)], counts, axis=0)
    q = np.concatenate([np.reshape(solutions, (-1, workload.arm.n)) for solutions in answers])
    errors = np.abs(workload.arm.fk(q) - poses)
    if not _meets_whole_poses(workload.arm):
        errors = errors[:, :3, 3:]
    closed = int(np.sum(errors.max(axis=(1, 2)) <= _TOLERANCE)) if len(q) else 0
    return Verdict(_worst(errors), closed / len(counts))


def _meets_whole_poses(arm: Arm) -> bool:
    """Return whether inverse kinematics of an arm meet whole poses; arms of few joints may meet the position alone."""
    fit = arm.family.fit
    # A planar arm or a SCARA that meets position and yaw meets the whole pose.
    return fit is None or len(fit.coordinates) == 6 or "yaw" in fit.coordinates


def _worst(difference: Array) -> float | None:
    worst = float(np.abs(difference).max()) if difference.size else np.nan
    return worst if np.isfinite(worst) else None
