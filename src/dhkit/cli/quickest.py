"""What `dhkit demo` shows of planning: a motion in least time beside the quintic between the same configurations."""

from __future__ import annotations

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.straight import PREFERRED
from dhkit.description import Array
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory

TURN, SLIDE = 1.0, 0.3
"""How far a joint is moved at most: rad, and shares of the reach."""
ROOM = 0.8
"""Share of the room up to its limit that a joint is moved at most."""
PAUSE = 0.6
"""s: rest at both ends."""


def race(arm: Arm, intervals: int | None = None) -> tuple[Trajectory, Trajectory]:
    """Return the motion in least time between two configurations, and the quintic under the same limits.

    Raises
    ------
    DescriptionError
        A link without body, or a joint without limits of speed and torque.
    PlanningError
        There are no such motions.
    """
    numbers = arm.description.numbers
    wanted = ((numbers.mass, "body"), (numbers.velocity, "speed limit"), (numbers.effort, "torque limit"))
    for values, what in wanted:
        if not np.isfinite(values).all():
            i = int(np.flatnonzero(~np.isfinite(values))[0])
            raise DescriptionError(f"{arm.description.joints[i].name} has no {what}")
    start, goal = ends(arm)
    return arm.plan(start, goal, intervals=intervals, compare=False), arm.quintic(start, goal)


def ends(arm: Arm) -> tuple[Array, Array]:
    """Return a configuration inside the limits, named where there is one, and one with every joint moved from it."""
    numbers = arm.description.numbers
    inside = {name: q for name, q in arm.configurations.items() if np.all((q >= numbers.lower) & (q <= numbers.upper))}
    name = next((name for name in (*PREFERRED, *inside) if name in inside), None)
    start = np.clip(np.zeros(arm.n), numbers.lower, numbers.upper) if name is None else inside[name]
    farthest = np.where(numbers.prismatic, SLIDE * arm.description.reach, TURN)
    up, down = (np.minimum(farthest, ROOM * room) for room in (numbers.upper - start, start - numbers.lower))
    return start, start + np.where(up >= down, up, -down)


def there_and_back(there: Trajectory, back: Trajectory) -> Trajectory:
    """Return one motion and the other reversed, with a rest at both ends.

    Reversed, a motion has the same torques at the same places: without friction it keeps the same limits.
    """
    goal, start = there.q(there.duration), there.q(0.0)
    return there.then(_rest(there, goal)).then(back.reversed()).then(_rest(there, start))


def _rest(motion: Trajectory, q: Array) -> Trajectory:
    return Trajectory(motion.description, np.array([0.0, PAUSE]), q[None, None])
