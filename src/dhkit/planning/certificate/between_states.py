"""Distances between the sampled states of a motion: an obstacle thinner than a step is not missed.

The distance of a link from an obstacle, or from another link, changes by no more than the link's points travel. Where
two neighbouring states are so near, or so far apart, that this does not exclude a distance below what is asked for,
the motion is sampled there again (conservative advancement: Mirtich 1996; Tang, Kim & Manocha 2009).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.description.frames import carrying, world_to_frames
from dhkit.planning.criteria import States
from dhkit.planning.obstacles import link_capsules, world_axes
from dhkit.trajectories.pieces import Pieces

SMALLEST_TRAVEL, SMALLEST_SHARE = 1e-4, 0.1
"""Travel of a link, m and as a share of the thinnest capsule's radius, below which a motion is not sampled again."""
MAX_PARTS = 64
"""Largest number of parts into which a step is divided at once."""
MAX_TURN = 0.5
"""Largest sum of the joints' turns in a step, rad, for which its travel is bounded by the levers at its ends."""


def smallest_between(
    states: States, found: Array, gaps: Callable[[Array], Array], least: Array, beside_axes: float = 0.0
) -> Array:
    """Return the smallest distances that are found after each state, before the next, shape (N, G), m.

    If none of them is below ``least``, no distance is anywhere, to half of ``SMALLEST_TRAVEL`` or ``SMALLEST_SHARE``.
    They are infinite where the distances at the states suffice to tell.

    Parameters
    ----------
    states
        N states of a motion on a grid, see :class:`States`.
    found
        G distances at the states, shape (N, G), m.
    gaps
        Returns them for joint values (M, n), rad and m, as (M, G).
    least
        Distances that are asked for between each state and the next, shape (N, G), m.
    beside_axes
        Largest distance of the points that are measured from the capsules' axes, m; 0 where capsules are measured.
    """
    smallest = np.full(found.shape, np.inf)
    step = np.append(np.diff(states.times), 0.0)
    steps = np.flatnonzero(step > 0)
    if not len(steps):
        return smallest
    least = least[steps]
    travels = _travels(states, steps, beside_axes)
    radii = [capsule.radius for capsule in link_capsules(states.description) if capsule.radius > 0]
    smallest_travel = min([SMALLEST_TRAVEL, *(SMALLEST_SHARE * radius for radius in radii)])
    # Parts of steps: their step, as an index of ``steps``, beginning and end, 0 to 1, and the distances there.
    which = np.arange(len(steps))
    low = np.zeros(len(steps))
    high = np.ones(len(steps))
    at_low = found[steps]
    at_high = found[steps + 1]
    while len(which):
        travel = travels[which] * (high - low)
        near = np.minimum(at_low, at_high)
        needed = least[which]
        open_ = (near >= needed) & ((at_low + at_high - travel[:, None]) / 2 < needed)
        kept = open_.any(axis=1) & (travel > smallest_travel)
        which = which[kept]
        low = low[kept]
        high = high[kept]
        travel = travel[kept]
        room = np.where(open_, at_low + at_high - 2 * needed, np.inf)[kept].min(axis=1, initial=np.inf)
        at_low, at_high = at_low[kept], at_high[kept]
        if not len(which):
            break
        parts = np.clip(np.ceil(1.5 * travel / np.maximum(room, smallest_travel)), 2, MAX_PARTS).astype(int)
        which, low, high, at_low, at_high = _divided(states, steps, (which, low, high, at_low, at_high), parts, gaps)
        np.minimum.at(smallest, steps[which], at_low)
    return smallest


_Parts = tuple[NDArray[np.int_], Array, Array, Array, Array]


def _divided(
    states: States, steps: NDArray[np.int_], whole: _Parts, parts: NDArray[np.int_], gaps: Callable[[Array], Array]
) -> _Parts:
    """Return parts of steps divided into ``parts`` equal ones each, with the distances at their ends."""
    which, low, high, at_low, at_high = whole
    first = np.cumsum(parts) - parts  # index of the first part of each
    place = np.arange(parts.sum()) - np.repeat(first, parts)
    size = np.repeat((high - low) / parts, parts)
    begin = np.repeat(low, parts) + size * place
    which = np.repeat(which, parts)
    inner = place > 0
    begins = np.repeat(at_low, parts, axis=0)
    begins[inner] = gaps(_joint_values(states, steps[which[inner]], begin[inner]))
    ends = np.append(begins[1:], begins[:1], axis=0)
    ends[first + parts - 1] = at_high
    return which, begin, begin + size, begins, ends


def _motion(states: States) -> Pieces:
    """Return the joint values of which states are a grid."""
    if states.motion is None:
        raise ValueError("states of no motion; expected those of Checker.states")
    return states.motion


def _joint_values(states: States, step: NDArray[np.int_], s: Array) -> Array:
    """Return the motion's joint values at shares s (M,) of steps, shape (M, n)."""
    motion = _motion(states)
    piece = step // states.points
    share = (step % states.points + s) / (states.points - 1)
    return motion.on(piece, share * np.diff(motion.breaks)[piece])


def _ways(states: States, steps: NDArray[np.int_]) -> Array:
    """Return how far each joint moves at most in steps, shape (K, n), rad and m: by hulls of its rate in each step."""
    motion = _motion(states)
    parts = states.points - 1
    rates = motion.differentiated(1).divided(parts)
    fastest = np.abs(rates.bernstein).max(axis=1)
    in_order = steps // states.points * parts + steps % states.points
    ways: Array = fastest[in_order] * np.diff(rates.breaks)[in_order, None]
    return ways


def _travels(states: States, steps: NDArray[np.int_], beside_axes: float) -> Array:
    """Return bounds of the distance that a point beside the capsules' axes travels in steps, shape (K,), m."""
    numbers = states.description.numbers

    def larger(values: Array) -> Array:
        return np.maximum(np.abs(values[steps]), np.abs(values[steps + 1]))

    way = _ways(states, steps)
    turn = way[:, ~numbers.prismatic].sum(axis=1)
    # Inside a step a lever is longer than at its ends by no more than a point travels; in large turns by any length
    # that the arm has.
    levers = larger(_levers(states)) + np.where(numbers.prismatic, 0.0, beside_axes)
    near = np.einsum("ki,ki->k", way, levers) / np.where(turn < MAX_TURN, 1 - turn, 1.0)
    far = way @ np.where(numbers.prismatic, 1.0, _longest_lever(states) + beside_axes)
    travels: Array = np.where(turn < MAX_TURN, np.minimum(near, far), far)
    return travels


def _longest_lever(states: States) -> float:
    """Return a distance, m, that no capsule's axis exceeds from any joint's axis."""
    ends = [point for capsule in link_capsules(states.description) for point in (capsule.start, capsule.end)]
    outside = max((float(np.linalg.norm(point)) for point in ends), default=0.0)
    strokes = np.abs(states.q[:, states.description.numbers.prismatic]).max(axis=0, initial=0.0)
    return states.description.reach + outside + float(strokes.sum())


def _levers(states: States) -> Array:
    """Return the largest distance of a capsule's axis that a joint moves from the joint's own axis, shape (N, n), m.

    1 for a prismatic joint, which moves all points alike.
    """
    description = states.description
    capsules = link_capsules(description)
    ends = world_axes(description, states.q)
    frames = np.moveaxis(world_to_frames(description, states.q), -3, 0)
    levers = np.ones(states.q.shape)
    for i, T in enumerate(carrying(description.convention, frames)):
        if not description.numbers.prismatic[i]:
            carried = ends[:, [k for k, capsule in enumerate(capsules) if capsule.link > i]]
            across = np.cross(carried - T[:, None, None, :3, 3], T[:, None, None, :3, 2])
            levers[:, i] = np.linalg.norm(across, axis=-1).max(axis=(1, 2), initial=0.0)
    return levers
