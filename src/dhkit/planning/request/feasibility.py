"""Checks before a solution starts: reasons why no motion can exist, as error messages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.frames import world_to_tool
from dhkit.description.joint_text import joint_text, violated_limit_text
from dhkit.dynamics import require_inertia
from dhkit.errors import PlanningError
from dhkit.planning.criteria import Constraint, LoadedArm, Objective, States
from dhkit.planning.request.places import Place, Route
from dhkit.planning.request.request import PlanRequest
from dhkit.trajectories import Limits
from dhkit.trajectories.limits import advice_on_acceleration

CONSTRAINT_ROUNDING = 1e-6
"""Excess of a constraint, as a share of it, that counts as rounding."""
LIMIT_ROUNDING = 1e-9
"""Distance of a joint value from its limits (rad or m) that counts as rounding."""


def require_inside_limits(description: Description, limits: Limits, q: Array, where: str) -> None:
    """Require joint values q (n,), rad and m, inside the joint limits.

    Raises
    ------
    PlanningError
        Names the joint and the limit.
    """
    excess = np.maximum(limits.lower - q, q - limits.upper)
    if not excess.max() > LIMIT_ROUNDING:
        return
    i = int(np.argmax(excess))
    words = violated_limit_text(
        q[i], limits.lower[i], limits.upper[i], slides=bool(description.numbers.prismatic[i])
    )
    raise PlanningError(f"{where}: joint {description.joints[i].name} is at {words}")


def _require_speed(description: Description, limits: Limits, qd: Array, where: str) -> None:
    """Require joint rates qd (n,), rad/s and m/s, within their limits.

    Raises
    ------
    PlanningError
        Names the joint and the limit.
    """
    excess = np.abs(qd) - limits.velocity
    if not excess.max() > 0:
        return
    i = int(np.argmax(excess))
    is_prismatic = bool(description.numbers.prismatic[i])
    speed = joint_text(abs(qd[i]), slides=is_prismatic, rate="/s")
    bound = joint_text(limits.velocity[i], slides=is_prismatic, rate="/s")
    raise PlanningError(
        f"{where}: joint {description.joints[i].name} moves with {speed}, above its limit, {bound}"
    )


def require_holdable(description: LoadedArm, limits: Limits, q: Array, where: str) -> None:
    """Require joint values q (n,), rad and m, at which the torque limits suffice to hold the arm.

    Raises
    ------
    PlanningError
        Names the joint, the torque for holding it, and its limit.
    """
    if np.isinf(limits.torque).all():
        return
    still = np.zeros((1, description.n))
    g = States(description, np.zeros(1), q[None], still, still).gravity_torque[0]
    excess = np.abs(g) - limits.torque
    if not (excess > LIMIT_ROUNDING * limits.torque).any():
        return
    i = int(np.argmax(np.abs(g) / limits.torque))
    unit = "N" if description.numbers.prismatic[i] else "N m"
    raise PlanningError(
        f"{where}: joint {description.joints[i].name} cannot hold the arm there: it takes {abs(g[i]):.5g} {unit}, "
        f"its limit is {limits.torque[i]:.5g} {unit}"
    )


def require_kept(
    description: LoadedArm, constraints: Sequence[Constraint], T_start: Array, place: Place
) -> None:
    """Require that a place keeps the constraints at rest; ``T_start`` (4, 4), m, is the tool's pose at the start.

    Raises
    ------
    PlanningError
        Names the constraint.
    """
    q = np.zeros(description.n) if place.q is None else place.q
    still = np.zeros((1, description.n))
    states = States(description, np.zeros(1), q[None], still, still)
    if place.T is not None:
        states = states.with_tool(place.T[None])
    for constraint in constraints:
        use = float(constraint.use(states, constraint.values(description, T_start)).max())
        if use > 1 + CONSTRAINT_ROUNDING:
            raise PlanningError(
                f"{place.name}: its {constraint.what} is not allowed: {constraint.use_text(use)}"
            )


def _require_bounded(
    description: Description, limits: Limits, objective: Objective, moves: Array
) -> None:
    """Require limits that keep every moving joint of a time-optimal motion from jumping.

    Parameters
    ----------
    moves
        Whether each joint has to move, shape (n,), without unit.

    Raises
    ------
    PlanningError
        Names a joint without any limit of torque, acceleration or jerk.
    """
    if not objective.has_time or not objective.only_time:
        return
    free = moves & np.isinf(limits.torque) & np.isinf(limits.acceleration) & np.isinf(limits.jerk)
    if free.any():
        name = description.joints[int(np.flatnonzero(free)[0])].name
        raise PlanningError(
            f"joint {name} has neither a torque, an acceleration nor a jerk limit, so least time has no bound below; "
            f"{advice_on_acceleration(description)}"
        )


def require_possible(
    description: Description,
    objective: Objective,
    constraints: Sequence[Constraint],
    request: PlanRequest,
    places: Sequence[Place],
    routes: Sequence[Route],
) -> None:
    """Require that the given places and limits allow a motion, as far as can be checked without a solution.

    Raises
    ------
    PlanningError
        Says which place, limit or obstacle does not.
    DescriptionError
        Couplings of drives make the mass matrix indefinite.
    """
    if description.couplings:
        require_inertia(description)
    limits = request.limits
    _require_speed(description, limits, request.start_velocity, "start")
    _require_speed(description, limits, request.goal_velocity, "goal")
    for place in places:
        if place.q is not None:
            require_place(description, request, place.q, place.name)
    resting = [constraint for constraint in constraints if not constraint.moving]
    T_start = world_to_tool(description, routes[0].points[0])
    for place in places:
        require_kept(request.loaded(description), resting, T_start, place)
    if request.duration is not None and request.duration < routes[0].bound:
        least = f"the speed limits alone ask for {routes[0].bound:.6g} s"
        raise PlanningError(f"a duration of {request.duration:.6g} s is too short: {least}")
    moves = np.max([np.ptp(route.points, axis=0) for route in routes], axis=0) > 0
    if not moves.any() and request.rests_at("start") and request.rests_at("goal"):
        raise PlanningError("start and goal are the same configuration")
    _require_bounded(description, limits, objective, moves)


def require_place(description: Description, request: PlanRequest, q: Array, name: str) -> None:
    """Require that the arm can be at a place, by joint values q (n,), rad and m.

    Raises
    ------
    PlanningError
        Torque limits do not hold it there, or it is nearer to obstacles than the clearance; at the start and the goal,
        where the clearance may be reduced: it collides.
    """
    if request.rests_at(name):
        require_holdable(request.loaded(description), request.limits, q, name)
    if request.avoidance:
        least = 0.0 if name in ("start", "goal") else request.avoidance.clearance
        request.avoidance.require_gap(description, q, name, least)
