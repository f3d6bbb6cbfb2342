"""Poses as goals: every configuration of the arm that has its tool there, and which ways to try first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, check_pose, joint_array
from dhkit.description.arrays import number_array
from dhkit.description.joint_words import joint_words
from dhkit.errors import DescriptionError, ModelError, PlanningError, UnreachableError
from dhkit.kinematics import inverse_kinematics, solve_numerically
from dhkit.trajectories import Limits

SEARCHES = 24
"""Starts of the iteration for arms without a closed form."""
SAME = 1e-3
"""rad and m: solutions nearer to each other are one."""
MOST = 32
"""Ways through all branches that are thought of at most, the shortest ones."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where a motion is to be: one configuration, or all that have the tool in a pose."""

    name: str
    """``"start"``, ``"goal"`` or ``"via 2"``."""
    q: Array | None
    T: Array | None = None


@dataclass(frozen=True, eq=False)
class Route:
    """One way through all places."""

    points: Array
    """Shape (legs + 1, n)."""
    label: str
    """The branches taken, empty where there was no choice."""
    bound: float
    """s: no motion along it is faster."""
    length: float
    """By which ways are ordered that are not bounded: of the straight joint path, joints measured by their speeds."""


def place(description: Description, value: ArrayLike | str, name: str) -> Place:
    """Return what an argument means: joint values (n,), the name of a configuration, or a pose (4, 4) of the tool.

    Raises
    ------
    PlanningError
        No such configuration.
    ValueError, TypeError
        Another shape, values that are not finite, or not numbers.
    """
    if isinstance(value, str):
        known = description.numbers.configurations
        if value not in known:
            raise PlanningError(
                f"{name}: {description.name} has no configuration {value!r}; it has {', '.join(known) or 'none'}"
            )
        return Place(name, np.array(known[value]))
    array = number_array(value, name, f"({description.n},) or (4, 4)")
    if array.shape == (4, 4):
        try:
            return Place(name, None, check_pose(array))
        except (DescriptionError, ValueError) as error:
            raise PlanningError(f"{name}: {error}") from None
    q = joint_array(description, array, name)
    if q.shape != (description.n,):
        raise ValueError(f"{name} has shape {q.shape}; expected ({description.n},) or (4, 4)")
    if not np.isfinite(q).all():
        raise ValueError(f"{name} has values that are not finite")
    return Place(name, q)


def routes(description: Description, limits: Limits, places: Sequence[Place]) -> list[Route]:
    """Return the ways through places, the most promising first.

    Raises
    ------
    UnreachableError
        A pose that the arm cannot reach.
    PlanningError
        A pose that it reaches only outside its limits.
    """
    ways: list[tuple[list[Array], list[str]]] = [([], [])]
    for spot in places:
        longer = []
        for points, labels in ways:
            near = points[-1] if points else None
            for q, label in _configurations(description, limits, spot, near):
                longer.append(([*points, q], [*labels, label] if label else labels))
        longer.sort(key=lambda way: _length(limits, np.stack(way[0])))
        ways = longer[:MOST]
    made = [
        Route(
            np.stack(points), " then ".join(labels), _bound(limits, np.stack(points)), _length(limits, np.stack(points))
        )
        for points, labels in ways
    ]
    return sorted(made, key=lambda route: (route.bound, route.length))


def _configurations(
    description: Description, limits: Limits, spot: Place, near: Array | None
) -> list[tuple[Array, str]]:
    if spot.q is not None:
        return [(spot.q, "")]
    T = np.asarray(spot.T)
    try:
        found = inverse_kinematics(description, T)
        every, labels = found.q, [str(label) for label in found.branches]
        angles = found.within_limits(near)
    except (DescriptionError, ModelError):
        every, labels = _iterated(description, T, near)
        angles = every
    if not np.isfinite(every).all(axis=-1).any():
        raise UnreachableError(f"{spot.name}: no joint values have the tool in the pose: {_where(T)} is out of reach")
    inside = np.atleast_1d(((angles >= limits.lower - SAME**3) & (angles <= limits.upper + SAME**3)).all(axis=-1))
    if not inside.any():
        raise PlanningError(
            f"{spot.name}: {_count(every)} of the pose at {_where(T)}, all outside the joint limits: "
            f"{_excess(description, limits, every)}"
        )
    return [
        (np.clip(q, limits.lower, limits.upper), label)
        for q, label, good in zip(angles, labels, inside, strict=True)
        if good
    ]


def _count(every: Array) -> str:
    """Return how many solutions there are, in words."""
    count = int(np.isfinite(every).all(axis=-1).sum())
    return f"{count} solution{'s' * (count != 1)}"


def _excess(description: Description, limits: Limits, every: Array) -> str:
    """Return which joint of the solution nearest to the limits is outside."""
    finite = every[np.isfinite(every).all(axis=-1)]
    excess = np.maximum(limits.lower - finite, finite - limits.upper)
    best = excess[np.argmin(np.maximum(excess, 0.0).sum(axis=1))]
    i = int(np.argmax(best))
    words = joint_words(best[i], slides=bool(description.numbers.prismatic[i]), digits=4)
    return f"at best joint {description.joints[i].name} by {words}"


def _iterated(description: Description, T: Array, near: Array | None) -> tuple[Array, list[str]]:
    """Return different solutions of a pose by iteration from several starts."""
    numbers = description.numbers
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -np.pi)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, np.pi)
    starts = np.random.default_rng(0).uniform(lower, upper, (SEARCHES, description.n))
    if near is not None:
        starts[0] = near
    found = solve_numerically(description, np.broadcast_to(T, (SEARCHES, 4, 4)), starts).q[:, 0]
    different: list[Array] = []
    for q in found[np.isfinite(found).all(axis=1)]:
        if not any(np.abs(q - other).max() < SAME for other in different):
            different.append(q)
    if not different:
        return np.full((1, description.n), np.nan), [""]
    return np.stack(different), [f"solution {k + 1}" for k in range(len(different))]


def _bound(limits: Limits, points: Array) -> float:
    """Return the duration that speeds alone allow, s."""
    return float(sum(np.max(np.abs(b - a) / limits.velocity) for a, b in pairwise(points)))


def _length(limits: Limits, points: Array) -> float:
    """Return the length of a way, joints measured by their speed limits where they have one."""
    speed = np.where(np.isfinite(limits.velocity), limits.velocity, 1.0)
    return float(sum(np.linalg.norm((b - a) / speed) for a, b in pairwise(points)))


def _where(T: Array) -> str:
    x, y, z = T[:3, 3]
    return f"({x:.4g}, {y:.4g}, {z:.4g}) m"
