"""A motion that shows an arm: through its configurations, and along a straight line with its tool."""

from __future__ import annotations

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array

RATE = 50.0
"""Hz: how densely the motion is sampled."""
PAUSE = 0.4
"""s: rest at each stop."""
GENTLE = 0.6
"""Share of the joints' speeds that the motion uses."""
DEFAULT_SPEED = 1.5
"""rad/s or m/s, of joints without a speed limit."""
SHORTEST = 0.8
"""s, of a piece of the motion."""
FASTEST = 15 / 8
"""A quintic blend is fastest in its middle, at this multiple of its mean speed."""


def tour(arm: Arm, line: Array | None = None) -> tuple[Array, Array]:
    """Return times (N,), s, and joint values (N, n) of a smooth motion through the arm's configurations and back.

    Parameters
    ----------
    arm
        The arm.
    line
        Joint values of poses along a line, shape (k, n), rad and m: there the motion begins and ends, and it goes
        along the line first.
    """
    stops = _stops(arm)
    pieces, at = [], stops[0]
    if line is not None:
        at = line[0]
        pieces += [_along(arm, line), _along(arm, line[::-1])]
    start = at
    for stop in [*stops[line is None :], start]:
        pieces.append(_along(arm, np.stack([at, stop])))
        at = stop
    q = np.concatenate([start[None], *pieces])
    return np.arange(len(q)) / RATE, q


def _along(arm: Arm, path: Array) -> Array:
    """Return joint values from the second sample on of a smooth motion along a path (k, n), with a rest at its end."""
    velocity = arm.description.numbers.velocity
    speed = GENTLE * np.where(np.isfinite(velocity), velocity, DEFAULT_SPEED)
    places = np.linspace(0.0, 1.0, len(path))
    steepest = np.abs(np.diff(path, axis=0)).max(axis=0) * (len(path) - 1)
    duration = max(SHORTEST, float(np.max(FASTEST * steepest / speed)))
    s = np.linspace(0.0, 1.0, max(2, round(duration * RATE)))[1:]
    blend = s**3 * (10 - 15 * s + 6 * s**2)
    q = np.stack([np.interp(blend, places, joint) for joint in path.T], axis=1)
    return np.concatenate([q, np.repeat(path[-1:], round(PAUSE * RATE), axis=0)])


def _stops(arm: Arm) -> list[Array]:
    """Return the named configurations in the limits, each once; single joints moved where there is only one."""
    numbers = arm.description.numbers
    inside = [q for q in arm.configurations.values() if np.all((q >= numbers.lower) & (q <= numbers.upper))]
    stops: list[Array] = []
    for q in inside or [np.clip(np.zeros(arm.n), numbers.lower, numbers.upper)]:
        if not any(np.array_equal(q, stop) for stop in stops):
            stops.append(q)
    first = stops[0]
    for i in range(arm.n):
        moved = first.copy()
        room = 0.7 if not numbers.prismatic[i] else 0.3 * max(arm.description.reach, 0.1)
        moved[i] = moved[i] + room if moved[i] + room <= numbers.upper[i] else max(moved[i] - room, numbers.lower[i])
        stops += [moved] if len(stops) < 4 else []
    return stops
