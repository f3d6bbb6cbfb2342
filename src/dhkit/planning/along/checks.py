"""Why there is no motion along a path: said before a solver would find out, or of what it came to."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import PlanningError
from dhkit.planning.along.excesses import POINTS
from dhkit.planning.along.grid import CORNER, jumps
from dhkit.planning.along.timing_task import TimingTask
from dhkit.planning.feasibility import BARELY, require_holdable, require_inside_limits
from dhkit.planning.search import FEASIBLE
from dhkit.planning.solver import Solution
from dhkit.trajectories import JointPath, Limits

__all__ = ["not_converged", "require_kept", "require_path"]

STANDS_STILL, TOO_STEEP = 1e-6, 1e4
"""Of the path's mean derivative: below the one the path stands still, above the other it is singular."""


def require_path(description: Description, path: JointPath, limits: Limits) -> None:
    """Refuse a path that no motion can follow from rest to rest without stopping."""
    names = [joint.name for joint in description.joints]
    if np.isfinite(limits.jerk).any():
        raise PlanningError("jerk is limited: along a path accelerations jump; give limits without those of jerk")
    _require_inside(path, limits)
    jumps = np.abs(_jumps(path, 1))
    if jumps.size and jumps.max() > CORNER * np.abs(path.qs(path.breaks)).max():
        k, i = np.unravel_index(int(np.argmax(jumps)), jumps.shape)
        raise PlanningError(
            f"the path has a corner at s = {path.breaks[k + 1]:.4g}, where joint {names[i]} turns suddenly: "
            "plan to it and on from it"
        )
    s, slopes = path.pieces.derivative.inside(POINTS)
    steepness = np.abs(slopes).max(axis=2)
    mean = float(np.sum(steepness.mean(axis=1) * np.diff(path.breaks)))
    if not steepness.min() > STANDS_STILL * mean:
        raise PlanningError(
            f"the path stands still at s = {s.flat[int(np.argmin(steepness))]:.4g}: no joint moves there"
        )
    if steepness.max() > TOO_STEEP * mean:
        k, j, i = np.unravel_index(int(np.argmax(np.abs(slopes))), slopes.shape)
        raise PlanningError(f"the path is singular at s = {s[k, j]:.4g}: joint {names[i]} turns ever faster there")
    for where, q in (("the path's beginning", path.q(0.0)), ("the path's end", path.q(1.0))):
        require_holdable(description, limits, q, where)


def _require_inside(path: JointPath, limits: Limits) -> None:
    """Refuse a path that leaves the joint limits."""
    s, q = (array.reshape(-1, path.description.n) for array in path.pieces.turning())
    excess = np.maximum(limits.lower - q, q - limits.upper)
    if excess.max() <= OUTSIDE:
        return
    k, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
    side, limit = ("lower", limits.lower[i]) if q[k, i] < limits.lower[i] else ("upper", limits.upper[i])
    raise PlanningError(
        f"{path.description.joints[i].name} leaves its {side} limit, {limit:.6g} {unit_of(path.description, int(i))}, "
        f"along the path: it comes to {q[k, i]:.6g} at s = {s[k, i]:.4g}"
    )


def require_kept(task: TimingTask) -> None:
    """Refuse a path that breaks a constraint at any speed, and one that nothing keeps from being jumped along."""
    resting = {constraint.what for constraint in task.checker.constraints if not constraint.moving}
    for what, use in task.checker.measured(task.still) if resting else []:
        if what in resting and use.max() > 1 + CORNER:
            s = task.states.s.flat[int(np.argmax(use.max(axis=1)))]
            raise PlanningError(f"{what} is exceeded by {100 * (use.max() - 1):.2g} % at s = {s:.4g}, at any speed")
    moves = np.abs(task.states.qs).max(axis=(0, 1)) > 0
    limited = np.isfinite(task.limits.torque) | np.isfinite(task.limits.acceleration)
    if task.objective.only_time and not (moves & limited).any():
        raise PlanningError(
            "nothing limits acceleration along the path: no joint that moves has a limit of it or of torque"
        )


def not_converged(task: TimingTask, solution: Solution, bounds: tuple[Array, Array]) -> PlanningError:
    """Say what stands in the way: a joint that cannot hold the arm, or else the row that misses its bounds most."""
    names = [joint.name for joint in task.description.joints]
    use = np.abs(task.states.g) / task.limits.torque
    if use.max() > 1:
        end, k, i = np.unravel_index(int(np.argmax(use)), use.shape)
        unit = "N" if task.description.numbers.prismatic[i] else "N m"
        return PlanningError(
            f"joint {names[i]} cannot hold the arm at s = {task.states.s[end, k]:.4g}: it takes "
            f"{abs(task.states.g[end, k, i]):.5g} {unit}, its limit is {task.limits.torque[i]:.5g} {unit}"
        )
    rows = [(row.what, names[i]) for row in task.rows for i in np.flatnonzero(row.limited)]
    misses = np.maximum(bounds[0] - solution.g, solution.g - bounds[1])
    misses = np.where(np.isnan(misses), np.inf, misses)[: 2 * task.intervals * len(rows)]
    where = ""
    if misses.size and misses.max() > FEASIBLE:
        end, k, i = np.unravel_index(int(np.argmax(misses)), (2, task.intervals, len(rows)))
        what, joint = rows[i]
        where = f": {what} of joint {joint} misses its limit by {misses.max():.2g} at s = {task.states.s[end, k]:.4g}"
    return PlanningError(f"not converged ({solution.status} after {solution.iterations} iterations){where}")
