"""Whether a contender's answers are the ones that dhkit gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.contenders import Task, Workload
from dhkit.description import Array
from dhkit.display import value_line

TOLERANCE = 1e-9
"""Largest error that counts as agreement, m or rotation entry: a nanometre, far above any rounding. Of dynamics over
the largest entry where that is above 1."""
CHECKED = 32
"""Items that are compared: enough to meet every branch, few enough for a solver of 50 ms."""


@dataclass(frozen=True)
class Verdict:
    """How far a contender's answers are from dhkit's.

    Attributes
    ----------
    error
        The largest difference of an entry: of the poses, of the Jacobians, or of the pose where a solution puts the
        tool from the one asked for (the position alone where inverse kinematics of the arm do not meet whole poses);
        None if there was nothing finite to compare.
    solutions
        Solutions a pose on average that put the tool where it was asked for, for ``ik``; None for the rest.
    """

    error: float | None
    solutions: float | None = None

    @property
    def ok(self) -> bool:
        """Whether the two agree."""
        return self.error is not None and self.error <= TOLERANCE

    def __str__(self) -> str:
        error = "no answer" if self.error is None else f"{self.error:.0e}"
        return error if self.ok else f"DISAGREES: {error}"

    def __repr__(self) -> str:
        return value_line(self)


def judge(workload: Workload, quantity: str, task: Task) -> Verdict:
    """Compare the first answers of a task with dhkit's own."""
    count = min(CHECKED, len(workload.q))
    answers = task.answers(count)
    if quantity == "ik":
        return _closes(workload, answers)
    ours = getattr(workload.arm, quantity)(*(x[:count] for x in workload.inputs(quantity)))
    return Verdict(_worst((np.asarray(answers) - ours) / max(1.0, float(np.abs(ours).max()))))


def _closes(workload: Workload, answers: Sequence[Array]) -> Verdict:
    counts = [len(solutions) for solutions in answers]
    wanted = np.repeat(workload.T[: len(answers)], counts, axis=0)
    q = np.concatenate([np.reshape(solutions, (-1, workload.arm.n)) for solutions in answers])
    misses = np.abs(workload.arm.fk(q) - wanted)
    if not _meets_whole_poses(workload.arm):
        misses = misses[:, :3, 3:]
    closing = int(np.sum(misses.max(axis=(1, 2)) <= TOLERANCE)) if len(q) else 0
    return Verdict(_worst(misses), closing / len(counts))


def _meets_whole_poses(arm: Arm) -> bool:
    """Whether inverse kinematics of an arm meet whole poses; those of few joints may meet the position alone."""
    fit = arm.family.fit
    # Position and yaw are all that a planar arm or a SCARA leaves open.
    return fit is None or len(fit.met) == 6 or "yaw" in fit.met


def _worst(difference: Array) -> float | None:
    worst = float(np.abs(difference).max()) if difference.size else np.nan
    return worst if np.isfinite(worst) else None
