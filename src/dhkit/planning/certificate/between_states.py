"""Distances between the sampled states of a motion: an obstacle thinner than a step is not missed.

The distance of a link from an obstacle, or from another link, changes by no more than the link's points travel. If
they travel by at most L between two states with the distances d_0 and d_1, the distance after a travel x is at least

    max(d_0 - x, d_1 - (L - x)) >= (d_0 + d_1 - L) / 2.

Where this bound is below the distance that is asked for, the motion is sampled there again (conservative advancement:
Mirtich 1996; Tang, Kim & Manocha 2009).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.description.frames import carrying, world_to_frames
from dhkit.planning.criteria import States
from dhkit.planning.obstacles import link_capsules, world_axes
from dhkit.trajectories.pieces import Pieces

SMALLEST_TRAVEL = 1e-4
"""Travel of a link, m, below which a motion is not sampled again."""
SMALLEST_SHARE = 0.1
"""The same as a share of the thinnest capsule's radius; the smaller one counts."""
MAX_PARTS = 64
"""Largest number of parts into which a step is divided at once."""
SPARE_PARTS = 1.5
"""Factor of the number of parts that would suffice if the distance fell evenly."""
MAX_TURN = 0.5
"""Largest sum of the joints' turns in a step, rad, for which its travel is bounded by the levers at its ends."""


def smallest_between(
    states: States,
    found: Array,
    gaps: Callable[[Array], Array],
    least: Array,
    beside_axes: float = 0.0,
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
    L = _travels(states, steps, beside_axes)
    radii = [capsule.radius for capsule in link_capsules(states.description) if capsule.radius > 0]
    smallest_travel = min([SMALLEST_TRAVEL, *(SMALLEST_SHARE * radius for radius in radii)])

    parts = Parts(
        np.arange(len(steps)),
        np.zeros(len(steps)),
        np.ones(len(steps)),
        found[steps],
        found[steps + 1],
    )
    while parts.count:
        travel = L[parts.step] * (parts.end - parts.begin)
        needed = least[parts.step]
        both = parts.distance_at_begin + parts.distance_at_end

        # A distance that is too small at an end is known already; open are those that may be too small inside, by their
        # bound (d_0 + d_1 - L) / 2.
        near = np.minimum(parts.distance_at_begin, parts.distance_at_end)
        is_open = (near >= needed) & ((both - travel[:, None]) / 2 < needed)

        # A part whose travel L is at most d_0 + d_1 - 2 needed, for each open distance, needs no more states.
        room = np.where(is_open, both - 2 * needed, np.inf).min(axis=1, initial=np.inf)
        is_kept = is_open.any(axis=1) & (travel > smallest_travel)
        if not is_kept.any():
            break
        wanted = SPARE_PARTS * travel[is_kept] / np.maximum(room[is_kept], smallest_travel)
        counts = np.clip(np.ceil(wanted), 2, MAX_PARTS).astype(int)
        parts = parts.kept(is_kept).divided(counts, states, steps, gaps)
        np.minimum.at(smallest, steps[parts.step], parts.distance_at_begin)
    return smallest


@dataclass(frozen=True, eq=False)
class Parts:
    """M parts of the steps between states, with the G distances at both ends of each."""

    step: NDArray[np.int_]
    """Step of each part, as an index among those that are examined, shape (M,)."""
    begin: Array
    """Share of the step at which the part begins, shape (M,), 0 to 1."""
    end: Array
    """Share of the step at which the part ends, shape (M,), 0 to 1."""
    distance_at_begin: Array
    """Distances at its beginning, shape (M, G), m."""
    distance_at_end: Array
    """Distances at its end, shape (M, G), m."""

    @property
    def count(self) -> int:
        """The number of parts."""
        return len(self.step)

    def kept(self, mask: NDArray[np.bool_]) -> Parts:
        """Return the parts of a mask (M,)."""
        return Parts(
            self.step[mask],
            self.begin[mask],
            self.end[mask],
            self.distance_at_begin[mask],
            self.distance_at_end[mask],
        )

    def divided(
        self,
        counts: NDArray[np.int_],
        states: States,
        steps: NDArray[np.int_],
        gaps: Callable[[Array], Array],
    ) -> Parts:
        """Return each part divided into ``counts`` (M,) equal ones, and measure the distances where they meet.

        Parameters
        ----------
        states, steps
            The states, and the indices of the steps that are examined.
        gaps
            Returns the distances at joint values, as in :func:`smallest_between`.
        """
        first = np.cumsum(counts) - counts  # index of the first part of each
        place = np.arange(counts.sum()) - np.repeat(first, counts)
        size = np.repeat((self.end - self.begin) / counts, counts)
        step = np.repeat(self.step, counts)
        begin = np.repeat(self.begin, counts) + size * place

        at_begin = np.repeat(self.distance_at_begin, counts, axis=0)
        is_new = place > 0
        at_begin[is_new] = gaps(_joint_values(states, steps[step[is_new]], begin[is_new]))

        # A part ends where the next one begins, and the last of each where the whole one ended.
        at_end = np.append(at_begin[1:], at_begin[:1], axis=0)
        at_end[first + counts - 1] = self.distance_at_end
        return Parts(step, begin, begin + size, at_begin, at_end)


def _motion(states: States) -> Pieces:
    """Return the joint values of which states are a grid."""
    if states.motion is None:
        raise ValueError("states are not those of a motion; expected those of Checker.states")
    return states.motion


def _joint_values(states: States, step: NDArray[np.int_], s: Array) -> Array:
    """Return the motion's joint values at shares s (M,) of steps, shape (M, n)."""
    motion = _motion(states)
    piece = step // states.points
    share = (step % states.points + s) / (states.points - 1)
    return motion.on(piece, share * np.diff(motion.breaks)[piece])


def _ways(states: States, steps: NDArray[np.int_]) -> Array:
    """Return a bound of each joint's move in steps, shape (K, n), rad and m.

    The rate lies in the convex hull of its Bernstein coefficients in a step, so that a joint moves by at most h times
    the largest of them.
    """
    motion = _motion(states)
    parts = states.points - 1
    rates = motion.differentiated(1).divided(parts)
    fastest = np.abs(rates.bernstein).max(axis=1)
    # Pieces have one state more than they have steps.
    in_order = steps // states.points * parts + steps % states.points
    ways: Array = fastest[in_order] * np.diff(rates.breaks)[in_order, None]
    return ways


def _travels(states: States, steps: NDArray[np.int_], beside_axes: float) -> Array:
    """Return bounds L of the distance that a point beside the capsules' axes travels in steps, shape (K,), m.

    Joint i moves by at most w_i and a point by w_i times its lever, the distance from the joint's axis (1 for a
    prismatic joint). A lever inside a step exceeds the larger one r_i at its ends by at most L, so that

        L <= sum w_i r_i + L sum w_i (revolute joints),    L <= sum w_i r_i / (1 - turn)    for turn = sum w_i < 1.

    In large turns the bound is that of the longest lever that the arm has.
    """
    numbers = states.description.numbers
    w = _ways(states, steps)
    turn = w[:, ~numbers.prismatic].sum(axis=1)

    levers = np.abs(_levers(states))
    r = np.maximum(levers[steps], levers[steps + 1]) + np.where(numbers.prismatic, 0.0, beside_axes)
    near = np.einsum("ki,ki->k", w, r) / np.where(turn < MAX_TURN, 1 - turn, 1.0)
    far = w @ np.where(numbers.prismatic, 1.0, _longest_lever(states) + beside_axes)
    travels: Array = np.where(turn < MAX_TURN, np.minimum(near, far), far)
    return travels


def _longest_lever(states: States) -> float:
    """Return a bound, m, of the distance of any point of a capsule's axis from any joint's axis."""
    ends: list[Array] = []
    for capsule in link_capsules(states.description):
        ends += [capsule.start, capsule.end]
    outside = max((float(np.linalg.norm(point)) for point in ends), default=0.0)
    strokes = np.abs(states.q[:, states.description.numbers.prismatic]).max(axis=0, initial=0.0)
    return states.description.reach + outside + float(strokes.sum())


def _levers(states: States) -> Array:
    """Return the largest distance from a joint's axis of the capsules' axes that it moves, shape (N, n), m.

    The distance of a point x from the axis z through p is |(x - p) x z|; it is convex along a capsule's axis, and
    largest at one of its ends. 1 stands for a prismatic joint, which moves all points alike.
    """
    description = states.description
    capsules = link_capsules(description)
    ends = world_axes(description, states.q)
    frames = np.moveaxis(world_to_frames(description, states.q), -3, 0)
    levers = np.ones(states.q.shape)
    for i, T in enumerate(carrying(description.convention, frames)):
        if not description.numbers.prismatic[i]:
            carried = ends[:, [k for k, capsule in enumerate(capsules) if capsule.link > i]]
            p = T[:, None, None, :3, 3]
            z = T[:, None, None, :3, 2]
            across = np.cross(carried - p, z)
            levers[:, i] = np.linalg.norm(across, axis=-1).max(axis=(1, 2), initial=0.0)
    return levers
