"""Checks of a path: reasons why no motion along it can exist, as error messages."""

from __future__ import annotations

from typing import cast

import numpy as np

from dhkit.errors import PlanningError
from dhkit.planning.along.path_program import PathProgram, Profile
from dhkit.planning.along.path_states import JUMP_ROUNDING, jumps
from dhkit.planning.criteria import Limit, LoadedArm, States
from dhkit.planning.request import CONSTRAINT_ROUNDING, require_holdable, require_inside_limits
from dhkit.trajectories import JointPath, Limits
from dhkit.trajectories.limits import advice_on_acceleration, farthest_outside

REGULAR_POINTS = 8
"""Number of points of each piece of a path at which its derivative is examined."""

MIN_DERIVATIVE_RATIO = 1e-6
"""Ratio of the path's derivative by s to its mean at and below which the path stands still."""
MAX_DERIVATIVE_RATIO = 1e4
"""Ratio of the path's derivative by s to its mean above which the path is singular."""


def require_path(description: LoadedArm, path: JointPath, limits: Limits) -> None:
    """Require a path that a motion can follow from rest to rest without stopping.

    Raises
    ------
    PlanningError
        The path leaves the joint limits, has a corner (or a jump of curvature, if jerk is limited), stands still or is
        singular, or the arm cannot hold itself at one of its ends.
    """
    s = farthest_outside(limits, path.pieces).place
    require_inside_limits(description, limits, path.q(s), f"the path at s = {s:.4g}")
    _require_no_jump(path, 1, "the path has a corner", "turns suddenly: plan to it and on from it")
    if np.isfinite(limits.jerk).any():
        _require_no_jump(
            path, 2, "the path's curvature jumps", "would need infinite jerk, which is limited"
        )
    _require_regular(path)
    for where, end in (("the path's beginning", 0.0), ("the path's end", 1.0)):
        require_holdable(description, limits, path.q(end), where)


def _require_no_jump(path: JointPath, order: int, what: str, joint_does: str) -> None:
    """Require a path whose derivative by s of an order does not jump."""
    steps = np.abs(jumps(path, order))
    values = path.pieces.differentiated(order)(path.breaks)
    if steps.size and steps.max() > JUMP_ROUNDING * np.abs(values).max():
        k, i = np.unravel_index(int(np.argmax(steps)), steps.shape)
        name = path.description.joints[i].name
        raise PlanningError(
            f"{what} at s = {path.breaks[k + 1]:.4g}, where joint {name} {joint_does}"
        )


def _require_regular(path: JointPath) -> None:
    """Require a path whose derivative by s is neither near zero nor very large."""
    s, slopes = path.pieces.derivative.inside(REGULAR_POINTS)
    steepness = np.abs(slopes).max(axis=2)

    # The mean of max_i |q'_i| over s, which has the length 1: that in each piece times the length of the piece.
    mean = float(np.sum(steepness.mean(axis=1) * np.diff(path.breaks)))
    if not steepness.min() > MIN_DERIVATIVE_RATIO * mean:
        raise PlanningError(
            f"the path stands still at s = {s.flat[int(np.argmin(steepness))]:.4g}: no joint moves there"
        )
    if steepness.max() > MAX_DERIVATIVE_RATIO * mean:
        k, j, i = np.unravel_index(int(np.argmax(np.abs(slopes))), slopes.shape)
        name = path.description.joints[i].name
        raise PlanningError(
            f"the path is singular at s = {s[k, j]:.4g}: joint {name} turns ever faster there"
        )


def require_kept(program: PathProgram[Profile]) -> None:
    """Require that a path keeps the constraints at rest, and that some limit bounds the speed along it.

    Raises
    ------
    PlanningError
        Names the constraint or the obstacle, and the place.
    """
    task = program.task
    states = program.states
    n = task.arm.n

    # Both ends of each interval in the order of s, with derivatives by s instead of rates: between two places the
    # clearance is measured along the path itself.
    s = states.s.T.ravel()
    q = np.swapaxes(states.q, 0, 1).reshape(-1, n)
    qs = np.swapaxes(states.qs, 0, 1).reshape(-1, n)
    qss = np.swapaxes(states.qss, 0, 1).reshape(-1, n)
    knots = np.append(states.s[0], states.s[1, -1])
    along = cast("JointPath", task.path).pieces.with_breaks(knots)
    still = States(task.loaded, s, q, qs, qss, motion=along, points=2)
    for limit, (constraint, parameters) in task.checker.limiting.items():
        if constraint.moving or limit == Limit.POSITION:
            continue
        use = constraint.use(still, parameters).max(axis=1)
        k = int(np.argmax(use))
        if use[k] > 1 + CONSTRAINT_ROUNDING:
            if limit == Limit.CLEARANCE:
                where = f"the path at s = {s[k]:.4g}"
                task.avoidance.require_gap(task.arm, q[k], where, task.avoidance.clearance)
                raise PlanningError(
                    f"{where}: the way to the next place leads too near to {task.avoidance.names}"
                )
            raise PlanningError(
                f"{constraint.what} is exceeded by {100 * (use[k] - 1):.2g} % at s = {s[k]:.4g}, at any speed"
            )
    moves = np.abs(states.qs).max(axis=(0, 1)) > 0
    limited = np.isfinite([task.limits.torque, task.limits.acceleration, task.limits.jerk]).any(
        axis=0
    )
    if task.objective.only_time and not (moves & limited).any():
        raise PlanningError(
            "nothing limits acceleration along the path: no joint that moves has a limit of it, of jerk or of torque; "
            f"{advice_on_acceleration(task.arm)}"
        )


def require_holdable_along(program: PathProgram[Profile]) -> None:
    """Require torque limits that hold the arm everywhere on a path; asked only of paths without a solution.

    Raises
    ------
    PlanningError
        Names the joint and the place.
    """
    task = program.task
    states = program.states
    use = np.abs(states.g) / task.limits.torque
    end, k, _ = np.unravel_index(int(np.argmax(use)), use.shape)
    require_holdable(
        task.loaded, task.limits, states.q[end, k], f"the path at s = {states.s[end, k]:.4g}"
    )
