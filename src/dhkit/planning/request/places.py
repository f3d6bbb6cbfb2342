"""Places of a motion and routes through them: all configurations with the tool at a pose, and which to try first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, check_pose, joint_array, world_to_tool
from dhkit.description.arrays import number_array
from dhkit.description.joint_text import joint_text
from dhkit.errors import DescriptionError, ModelError, PlanningError, UnreachableError
from dhkit.kinematics import IKStatus, inverse_kinematics, solve_numerically
from dhkit.kinematics.closed_form.family import ALL_COORDINATES
from dhkit.trajectories import Limits

ITERATION_STARTS = 24
"""Number of starts of the iterative solution, for arms without a closed form."""
SAME_SOLUTION = 1e-3
"""Largest difference of joint values (rad or m) between two solutions that count as the same."""
MAX_POSITION_ERROR = 1e-6
"""Largest distance of the tool, m, from a pose that counts as met."""
MAX_ROTATION_ERROR = 1e-6
"""Largest difference of an entry of the tool's rotation matrix from that of a pose that counts as met."""
MAX_ROUTES = 32
"""Largest number of routes through the branches of all places; the shortest are kept."""


@dataclass(frozen=True, eq=False)
class Place:
    """A place that a motion passes: one configuration q, or all configurations with the tool at a pose T."""

    name: str
    """``"start"``, ``"goal"`` or ``"via 2"``, for messages."""
    q: Array | None
    T: Array | None = None


@dataclass(frozen=True, eq=False)
class Route:
    """One configuration for each place, in order."""

    points: Array
    """Configurations, shape (legs + 1, n), rad and m."""
    label: str
    """Names of the chosen branches; empty if there was no choice."""
    bound: float
    """Lower bound of the duration from the speed limits, s."""
    length: float
    """Length of the straight joint path, each joint divided by its speed limit: orders routes without a bound."""


def parse_places(
    description: Description,
    start: ArrayLike | str,
    via: Sequence[ArrayLike | str],
    goal: ArrayLike | str,
) -> list[Place]:
    """Return the places of a motion in order, as :func:`_parse_place`; the start must be joint values (n,), rad and m.

    Raises
    ------
    PlanningError
        A name that is not one of the arm's configurations.
    ValueError, TypeError
        Another shape, values that are not finite, not numbers, or a pose as the start.
    """
    if not hasattr(via, "__len__"):
        raise TypeError(f"via is {type(via).__name__}; expected a list of places")
    is_single = isinstance(via, str) or (
        len(via) and not isinstance(via[0], str) and np.ndim(via[0]) == 0
    )
    between: list[Any] = [via] if is_single else list(via)
    names = ["start", *(f"via {k}" for k in range(1, len(between) + 1)), "goal"]
    values = (start, *between, goal)
    places = [
        _parse_place(description, value, name) for value, name in zip(values, names, strict=True)
    ]
    if places[0].q is None:
        raise ValueError(
            "start is a pose; expected joint values: choose one of inverse kinematics' solutions"
        )
    return places


def _parse_place(description: Description, value: ArrayLike | str, name: str) -> Place:
    """Return the place of an argument: joint values (n,), the name of a configuration, or a pose (4, 4) of the tool.

    Raises
    ------
    PlanningError
        A name that is not one of the arm's configurations.
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
        if not np.isfinite(array).all():
            raise ValueError(f"{name} has values that are not finite")
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


def find_routes(
    description: Description,
    limits: Limits,
    places: Sequence[Place],
    coordinates: Sequence[str] | None = None,
) -> list[Route]:
    """Return the routes through all places, sorted by their lower bounds of the duration.

    Parameters
    ----------
    coordinates
        Names of the coordinates of a pose that count, for arms that meet no more of them; all six unless given.

    Raises
    ------
    UnreachableError
        A pose that the arm cannot reach, or for which no solution was found.
    PlanningError
        A pose that it reaches only outside its limits, or of which it meets some coordinates alone.
    ValueError
        Coordinates that are not those that the arm meets.
    """
    routes: list[tuple[list[Array], list[str]]] = [([], [])]
    for place in places:
        longer = []
        for points, labels in routes:
            near = points[-1] if points else None
            for q, label in _configurations(description, limits, place, near, coordinates):
                longer.append(([*points, q], [*labels, label] if label else labels))
        longer.sort(key=lambda route: _length(limits, np.stack(route[0])))
        routes = longer[:MAX_ROUTES]
    made = []
    for configurations, labels in routes:
        q = np.stack(configurations)
        made.append(Route(q, " then ".join(labels), _bound(limits, q), _length(limits, q)))
    return sorted(made, key=lambda route: (route.bound, route.length))


def _configurations(
    description: Description,
    limits: Limits,
    place: Place,
    near: Array | None,
    coordinates: Sequence[str] | None,
) -> list[tuple[Array, str]]:
    if place.q is not None:
        return [(place.q, "")]
    T = np.asarray(place.T)
    try:
        solutions = inverse_kinematics(description, T)
        every = solutions.q
        labels = [str(label) for label in solutions.branches]
        met = solutions.met
        angles = solutions.within_limits(near)
        is_proved = int(solutions.status_code) == IKStatus.out_of_reach
    except (DescriptionError, ModelError):
        every, labels = _iterative_solutions(description, T, near)
        angles = every
        met = ALL_COORDINATES
        is_proved = False
    if coordinates is not None and tuple(coordinates) not in (met, ALL_COORDINATES):
        raise ValueError(f"coordinates is {coordinates!r}; {description.name} meets {met}")
    if not np.isfinite(every).all(axis=-1).any():
        if is_proved:
            problem = (
                f"no joint values bring the tool to this pose; {_position_text(T)} is out of reach"
            )
        else:
            problem = (
                f"no joint values were found that bring the tool to this pose, at {_position_text(T)}; "
                "that does not prove that there are none"
            )
        raise UnreachableError(f"{place.name}: {problem}")
    if coordinates is None or tuple(coordinates) != met:
        _require_met(description, place, every, met)
    rounding = SAME_SOLUTION**3
    is_inside = (angles >= limits.lower - rounding) & (angles <= limits.upper + rounding)
    inside = np.atleast_1d(is_inside.all(axis=-1))
    if not inside.any():
        raise PlanningError(
            f"{place.name}: {_count(every)} of the pose at {_position_text(T)}, all outside the joint limits: "
            f"{_excess(description, limits, every)}"
        )
    return [
        (np.clip(q, limits.lower, limits.upper), label)
        for q, label, good in zip(angles, labels, inside, strict=True)
        if good
    ]


def _require_met(
    description: Description, place: Place, every: Array, met: tuple[str, ...]
) -> None:
    """Require that a solution has the tool at the pose of a place; arms of fewer freedoms meet some coordinates alone.

    Raises
    ------
    PlanningError
        Says how far the nearest solution is from the pose, and which coordinates the arm meets.
    """
    found = world_to_tool(description, every[np.isfinite(every).all(axis=-1)])
    T = np.asarray(place.T)
    away = np.linalg.norm(found[:, :3, 3] - T[:3, 3], axis=1)
    turned = np.abs(found[:, :3, :3] - T[:3, :3]).max(axis=(1, 2))
    if ((away <= MAX_POSITION_ERROR) & (turned <= MAX_ROTATION_ERROR)).any():
        return
    best = int(np.argmin(away / MAX_POSITION_ERROR + turned / MAX_ROTATION_ERROR))
    # R - R' = 2 sin(angle) [axis]x, of Frobenius norm 2 sqrt(2) sin(angle), and trace R = 1 + 2 cos(angle).
    R = found[best, :3, :3].T @ T[:3, :3]
    angle = np.degrees(np.arctan2(np.linalg.norm(R - R.T) / np.sqrt(2), np.trace(R) - 1))
    raise PlanningError(
        f"{place.name}: {description.name} does not meet this pose: of its coordinates it meets {', '.join(met)}, and "
        f"is {1000 * away[best]:.3g} mm and {angle:.3g} deg away; coordinates={met} says that these alone count"
    )


def _count(every: Array) -> str:
    """Return the number of solutions as text."""
    count = int(np.isfinite(every).all(axis=-1).sum())
    return f"{count} solution{'s' * (count != 1)}"


def _excess(description: Description, limits: Limits, every: Array) -> str:
    """Return the joint that is outside in the solution nearest to the limits, and its limit, as text."""
    finite = every[np.isfinite(every).all(axis=-1)]
    excess = np.maximum(limits.lower - finite, finite - limits.upper)
    best = excess[np.argmin(np.maximum(excess, 0.0).sum(axis=1))]
    i = int(np.argmax(best))
    words = joint_text(best[i], slides=bool(description.numbers.prismatic[i]), digits=4)
    return f"at best joint {description.joints[i].name} by {words}"


def _iterative_solutions(
    description: Description, T: Array, near: Array | None
) -> tuple[Array, list[str]]:
    """Return the distinct iterative solutions of a pose from several starts, and their (empty) labels."""
    numbers = description.numbers
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -np.pi)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, np.pi)
    starts = np.random.default_rng(0).uniform(lower, upper, (ITERATION_STARTS, description.n))
    if near is not None:
        starts[0] = near
    solutions = solve_numerically(
        description, np.broadcast_to(T, (ITERATION_STARTS, 4, 4)), starts
    ).q[:, 0]
    different: list[Array] = []
    for q in solutions[np.isfinite(solutions).all(axis=1)]:
        if not any(np.abs(q - other).max() < SAME_SOLUTION for other in different):
            different.append(q)
    if not different:
        return np.full((1, description.n), np.nan), [""]
    return np.stack(different), [f"solution {k + 1}" for k in range(len(different))]


def _bound(limits: Limits, points: Array) -> float:
    """Return the lower bound of the duration from the speed limits v, s: the sum of max_i |dq_i| / v_i."""
    return float(sum(np.max(np.abs(b - a) / limits.velocity) for a, b in pairwise(points)))


def _length(limits: Limits, points: Array) -> float:
    """Return the length of a route, each joint divided by its speed limit if it has one."""
    speed = np.where(np.isfinite(limits.velocity), limits.velocity, 1.0)
    return float(sum(np.linalg.norm((b - a) / speed) for a, b in pairwise(points)))


def _position_text(T: Array) -> str:
    x, y, z = T[:3, 3]
    return f"({x:.4g}, {y:.4g}, {z:.4g}) m"
