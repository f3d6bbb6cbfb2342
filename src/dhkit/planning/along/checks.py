"""Checks of a path before a solution, and error messages from a solution that did not converge."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import PlanningError
from dhkit.planning.along.grid import JUMP_ROUNDING, jumps
from dhkit.planning.along.timing_task import POINTS, TimingTask
from dhkit.planning.feasibility import CONSTRAINT_ROUNDING, require_holdable, require_inside_limits
from dhkit.planning.search import FEASIBILITY_TOLERANCE
from dhkit.planning.solver import Solution
from dhkit.trajectories import JointPath, Limits

MIN_DERIVATIVE_RATIO, MAX_DERIVATIVE_RATIO = 1e-6, 1e4
"""Ratios of the path's derivative to its mean: below the first the path stops, above the second it is singular."""


def require_path(description: Description, path: JointPath, limits: Limits) -> None:
    """Require a path that a motion can follow from rest to rest without stopping.

    Raises
    ------
    PlanningError
        Jerk is limited, the path leaves the joint limits, has a corner, stands still or is singular, or the arm cannot
        hold itself at one of its ends.
    """
    if np.isfinite(limits.jerk).any():
        raise PlanningError("jerk is limited: along a path accelerations jump; give limits without those of jerk")
    s, q = (array.reshape(-1, description.n) for array in path.pieces.extremes())
    k, i = np.unravel_index(int(np.argmax(np.maximum(limits.lower - q, q - limits.upper))), q.shape)
    require_inside_limits(description, limits, q[k], f"the path at s = {s[k, i]:.4g}")
    _require_no_corner(path)
    _require_regular(path)
    for where, end in (("the path's beginning", 0.0), ("the path's end", 1.0)):
        require_holdable(description, limits, path.q(end), where)


def _require_no_corner(path: JointPath) -> None:
    steps = np.abs(jumps(path, 1))
    if steps.size and steps.max() > JUMP_ROUNDING * np.abs(path.qs(path.breaks)).max():
        k, i = np.unravel_index(int(np.argmax(steps)), steps.shape)
        raise PlanningError(
            f"the path has a corner at s = {path.breaks[k + 1]:.4g}, where joint {path.description.joints[i].name} "
            "turns suddenly: plan to it and on from it"
        )


def _require_regular(path: JointPath) -> None:
    """Require a path whose derivative by s is neither near zero nor very large."""
    s, slopes = path.pieces.derivative.inside(POINTS)
    steepness = np.abs(slopes).max(axis=2)
    mean = float(np.sum(steepness.mean(axis=1) * np.diff(path.breaks)))
    if not steepness.min() > MIN_DERIVATIVE_RATIO * mean:
        raise PlanningError(
            f"the path stands still at s = {s.flat[int(np.argmin(steepness))]:.4g}: no joint moves there"
        )
    if steepness.max() > MAX_DERIVATIVE_RATIO * mean:
        k, j, i = np.unravel_index(int(np.argmax(np.abs(slopes))), slopes.shape)
        name = path.description.joints[i].name
        raise PlanningError(f"the path is singular at s = {s[k, j]:.4g}: joint {name} turns ever faster there")


def require_kept(task: TimingTask) -> None:
    """Require that a path keeps the constraints at rest, and that some limit bounds the speed along it.

    Raises
    ------
    PlanningError
        Names the constraint and the place.
    """
    resting = {constraint.what for constraint in task.checker.constraints if not constraint.moving}
    for what, use in task.checker.measured(task.still) if resting else []:
        if what in resting and use.max() > 1 + CONSTRAINT_ROUNDING:
            s = task.states.s.flat[int(np.argmax(use.max(axis=1)))]
            raise PlanningError(f"{what} is exceeded by {100 * (use.max() - 1):.2g} % at s = {s:.4g}, at any speed")
    moves = np.abs(task.states.qs).max(axis=(0, 1)) > 0
    limited = np.isfinite(task.limits.torque) | np.isfinite(task.limits.acceleration)
    if task.objective.only_time and not (moves & limited).any():
        raise PlanningError(
            "nothing limits acceleration along the path: no joint that moves has a limit of it or of torque"
        )


def refuse(task: TimingTask, solution: Solution, bounds: tuple[Array, Array]) -> NoReturn:
    """Raise the reason of a failed solution: a joint that cannot hold the arm, or the row with the largest violation.

    ``bounds`` are the lower and upper bounds of the rows, shape (rows,) each, without unit.

    Raises
    ------
    PlanningError
        Always.
    """
    states, names = task.states, [joint.name for joint in task.description.joints]
    use = np.abs(states.g) / task.limits.torque
    end, k, _ = np.unravel_index(int(np.argmax(use)), use.shape)
    require_holdable(task.description, task.limits, states.q[end, k], f"the path at s = {states.s[end, k]:.4g}")
    rows = [(row.what, names[i]) for row in task.rows for i in np.flatnonzero(row.limited)]
    misses = np.maximum(bounds[0] - solution.g, solution.g - bounds[1])
    misses = np.where(np.isnan(misses), np.inf, misses)[:-1].reshape(task.intervals, -1)[:, 1 : 1 + 2 * len(rows)]
    where = ""
    if misses.size and misses.max() > FEASIBILITY_TOLERANCE:
        k, end, i = np.unravel_index(int(np.argmax(misses)), (task.intervals, 2, len(rows)))
        what, joint = rows[i]
        where = f": {what} of joint {joint} misses its limit by {misses.max():.2g} at s = {states.s[end, k]:.4g}"
    raise PlanningError(f"not converged ({solution.status} after {solution.iterations} iterations){where}")
