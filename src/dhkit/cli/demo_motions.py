"""Motions of `dhkit demo`: a tour of an arm's configurations, and a motion in least time beside a quintic."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.straight import PREFERRED_CONFIGURATIONS
from dhkit.description import Array
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory

TOUR_RATE = 50.0
"""Samples of a tour per second, Hz."""
STOP_TIME = 0.4
"""Rest at each stop of a tour, s."""
SPEED_SHARE = 0.6
"""Share of the joints' speed limits that a tour uses."""
DEFAULT_SPEED = 1.5
"""Speed of joints without a speed limit, rad/s or m/s."""
MIN_PIECE_TIME = 0.8
"""Shortest duration of a piece of a tour, s."""
PEAK_SPEED_RATIO = 15 / 8
"""Peak over mean speed of a quintic blend."""
MAX_ROTATION = 1.0
"""Largest motion of a revolute joint, rad."""
MAX_TRANSLATION = 0.3
"""Largest motion of a prismatic joint, as a share of the arm's reach."""
LIMIT_SHARE = 0.8
"""Largest motion of a joint as a share of the way to its limit."""
REST_TIME = 0.6
"""Rest at both ends of a motion there and back, s."""


def tour(arm: Arm, line: Array | None = None) -> tuple[Array, Array]:
    """Return times, shape (N,), s, and joint values, shape (N, n), rad and m, of a tour of configurations.

    Parameters
    ----------
    arm
        The arm.
    line
        Joint values of poses along a line, shape (k, n), rad and m: the tour begins and ends at the first of them, and
        goes along the line first.
    """
    stops = _stops(arm)
    pieces = []
    start = stops[0]
    if line is not None:
        start = line[0]
        pieces += [_along(arm, line), _along(arm, line[::-1])]
    places = [start, *stops[line is None :], start]
    pieces += [_along(arm, np.stack(ends)) for ends in pairwise(places)]
    q = np.concatenate([start[None], *pieces])
    return np.arange(len(q)) / TOUR_RATE, q


def _along(arm: Arm, path: Array) -> Array:
    """Return joint values from the second sample on of a smooth motion along a path (k, n), with a rest at its end."""
    velocity = arm.description.numbers.velocity
    speed = SPEED_SHARE * np.where(np.isfinite(velocity), velocity, DEFAULT_SPEED)
    shares = np.linspace(0.0, 1.0, len(path))
    steepest = np.abs(np.diff(path, axis=0)).max(axis=0) * (len(path) - 1)
    duration = max(MIN_PIECE_TIME, float(np.max(PEAK_SPEED_RATIO * steepest / speed)))
    s = np.linspace(0.0, 1.0, max(2, round(duration * TOUR_RATE)))[1:]
    blend = s**3 * (10 - 15 * s + 6 * s**2)
    q = np.stack([np.interp(blend, shares, joint) for joint in path.T], axis=1)
    return np.concatenate([q, np.repeat(path[-1:], round(STOP_TIME * TOUR_RATE), axis=0)])


def _stops(arm: Arm) -> list[Array]:
    """Return the named configurations inside the limits, each once; with few, states with a single joint moved too."""
    numbers = arm.description.numbers
    inside = [
        q
        for q in arm.configurations.values()
        if np.all((q >= numbers.lower) & (q <= numbers.upper))
    ]
    stops: list[Array] = []
    for q in inside or [np.clip(np.zeros(arm.n), numbers.lower, numbers.upper)]:
        if not any(np.array_equal(q, stop) for stop in stops):
            stops.append(q)
    first = stops[0]
    for i in range(arm.n):
        moved = first.copy()
        room = 0.7 if not numbers.prismatic[i] else 0.3 * max(arm.description.reach, 0.1)
        moved[i] = (
            moved[i] + room
            if moved[i] + room <= numbers.upper[i]
            else max(moved[i] - room, numbers.lower[i])
        )
        stops += [moved] if len(stops) < 4 else []
    return stops


def race(arm: Arm, intervals: int | None = None) -> tuple[Trajectory, Trajectory]:
    """Return the motion in least time between two configurations, and the quintic under the same limits.

    Raises
    ------
    DescriptionError
        A link has no body, or a joint has no limit of speed or torque.
    PlanningError
        There are no such motions.
    """
    numbers = arm.description.numbers
    needed = (
        (numbers.mass, "body"),
        (numbers.velocity, "speed limit"),
        (numbers.effort, "torque limit"),
    )
    for values, quantity in needed:
        if not np.isfinite(values).all():
            i = int(np.flatnonzero(~np.isfinite(values))[0])
            raise DescriptionError(f"{arm.description.joints[i].name} has no {quantity}")
    start, goal = moved_configurations(arm)
    return arm.plan(start, goal, intervals=intervals, compare=False), arm.quintic(start, goal)


def moved_configurations(arm: Arm) -> tuple[Array, Array]:
    """Return a configuration inside the limits, a named one if possible, and one with every joint moved; (n,) each."""
    numbers = arm.description.numbers
    inside = {
        name: q
        for name, q in arm.configurations.items()
        if np.all((q >= numbers.lower) & (q <= numbers.upper))
    }
    name = next((name for name in (*PREFERRED_CONFIGURATIONS, *inside) if name in inside), None)
    start = np.clip(np.zeros(arm.n), numbers.lower, numbers.upper) if name is None else inside[name]
    distance = np.where(numbers.prismatic, MAX_TRANSLATION * arm.description.reach, MAX_ROTATION)
    up, down = (
        np.minimum(distance, LIMIT_SHARE * room)
        for room in (numbers.upper - start, start - numbers.lower)
    )
    return start, start + np.where(up >= down, up, -down)


def there_and_back(there: Trajectory, back: Trajectory) -> Trajectory:
    """Return one motion followed by the other reversed, with a rest at both ends.

    A reversed motion has the same torques at the same places: without friction it keeps the same limits.
    """
    goal = there.q(there.duration)
    start = there.q(0.0)
    return there.then(_rest(there, goal)).then(back.reversed()).then(_rest(there, start))


def _rest(motion: Trajectory, q: Array) -> Trajectory:
    return Trajectory(motion.description, np.array([0.0, REST_TIME]), q[None, None])
