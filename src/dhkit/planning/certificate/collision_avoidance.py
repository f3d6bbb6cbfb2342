"""Obstacles of a motion, and the clearance that a certificate checks by coal."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.errors import PlanningError
from dhkit.planning.certificate.between_states import smallest_between
from dhkit.planning.criteria import Constraint, States, joint_limits
from dhkit.planning.obstacles import (
    Floor,
    LinkBody,
    Obstacle,
    Pair,
    Scene,
    Separation,
    check_obstacles,
    checked_pairs,
    distance,
    link_capsules,
    link_pairs,
    not_checked,
    pair_distances,
    shape_distances,
    smallest_distances,
    standing,
    world_axes,
)
from dhkit.planning.second_check import Claim
from dhkit.trajectories import Limits

FROM_OBSTACLES = "from obstacles"
BETWEEN_LINKS = "between links"
"""Bodies that a motion is kept clear of, in words of reports."""
NOT_LOOKED_FOR = "collisions not looked for"
"""Heading of the collisions that nobody asked to avoid, in reports and certificates."""
BETWEEN = 0.1
"""Share of the clearance by which a distance may fall below it between two states of a certificate."""
MIN_BETWEEN = 1e-3
"""The same in m; the larger of both counts."""
MEASURED = 0.02
"""Distance, m, beyond the required one up to which distances between shapes are measured; others are bounded."""
KEPT_SHARE = 0.75
"""Share of a gap at an end of a motion to which the clearance is reduced there: a link may come a little nearer on its
way out of a narrow place."""
LEAVING = 10.0
"""Travel of a link from its place at an end of a motion, as a multiple of the clearance, within which its clearance is
reduced."""


def collisions_not_asked_for(clear_of: str) -> str:
    """Return the bodies whose contact nobody asked to avoid, in words; empty if obstacles and links were asked for.

    Parameters
    ----------
    clear_of
        Bodies from or between which a clearance is kept, in words.
    """
    missing = []
    if FROM_OBSTACLES not in clear_of:
        missing.append("with obstacles")
    if BETWEEN_LINKS not in clear_of:
        missing.append(BETWEEN_LINKS)
    return ", ".join(missing)


def _without_slack(required: Array) -> Array:
    """Return the distances that are asked for between two states, m, of those that are required at states."""
    slack = np.minimum(np.maximum(BETWEEN * required, MIN_BETWEEN), required)
    return np.asarray(required - slack)


@dataclass(frozen=True)
class ReducedClearance:
    """A pair that is nearer than the clearance at the start or the goal of a motion, and the distances it keeps."""

    pair: Pair
    names: tuple[str, str]
    """Names of the link, and of the obstacle or link that it is near."""
    start: float
    """Distance to keep near the start, m; without effect where it is above the clearance."""
    goal: float
    """Distance to keep near the goal, m; likewise."""

    def __str__(self) -> str:
        link, other = self.names
        return f"{1000 * min(self.start, self.goal):.3g} mm between {link} and {other}"


@dataclass(frozen=True)
class LinkClearance:
    """Two links that are measured by their shapes, and the distance that they keep during a whole motion."""

    bodies: tuple[LinkBody, LinkBody]
    kept: float
    """Distance to keep, m: the clearance, or less where the links are nearer at the start or the goal."""

    def __str__(self) -> str:
        first, second = (body.name for body in self.bodies)
        return f"{1000 * self.kept:.3g} mm between {first} and {second}"


@dataclass(frozen=True, eq=False)
class CollisionAvoidance:
    """Obstacles of a motion, and the clearance from them and between links."""

    obstacles: tuple[Obstacle | Floor, ...] = ()
    clearance: float = 0.01
    """Smallest distance, m."""
    self_collision: bool = False
    reduced: tuple[ReducedClearance, ...] = ()
    by_shapes: tuple[LinkClearance, ...] = ()
    """Links that are measured by their shapes."""
    ends: Array | None = None
    """Joint values at the start and the goal, shape (2, n), rad and m, where clearances are reduced."""
    is_reduced_throughout: bool = False
    """Whether they are reduced during the whole motion, not only near the ends."""

    @classmethod
    def of(cls, obstacles: Scene, clearance: float, self_collision: bool) -> CollisionAvoidance:
        """Return checked settings.

        Raises
        ------
        ValueError, TypeError
            A clearance that is negative, not finite or not a number; a choice that is neither True nor False.
        """
        if isinstance(clearance, bool) or not isinstance(clearance, Real):
            raise TypeError(f"clearance is {clearance!r}; expected a number of at least 0, m")
        if not isinstance(self_collision, bool | np.bool_):
            raise TypeError(f"self_collision is {self_collision!r}; expected True or False")
        if not (math.isfinite(clearance) and clearance >= 0):
            raise ValueError(f"clearance is {clearance!r}; expected a number of at least 0, m")
        obstacles = check_obstacles(obstacles)
        # One of each set of identical solids is kept.
        distinct: dict[object, Obstacle | Floor] = {}
        for item in obstacles:
            key = (item.geometry, item.placement) if isinstance(item, Obstacle) else item
            distinct[key] = item
        return cls(tuple(distinct.values()), float(clearance), bool(self_collision))

    def __bool__(self) -> bool:
        return bool(self.obstacles) or self.self_collision

    @property
    def names(self) -> str:
        """Names of the obstacles, as text."""
        names = [item.name for item in self.obstacles]
        if self.self_collision:
            names.append("itself")
        counted = Counter(names)
        return ", ".join(
            name if count == 1 else f"{count} x {name}" for name, count in counted.items()
        )

    def report(self, arm: Description, excess: float) -> dict[str, Any]:
        """Return the fields of a :class:`dhkit.planning.PlanReport`; ``excess`` is the certificate's, m."""
        if not self:
            return {}
        reduced = (*self.reduced, *self._reduced_by_shapes)
        return {
            "clearance": self.clearance,
            "clear_of": self.clear_of,
            "spare_clearance": -excess,
            "reduced_clearances": tuple(str(pair) for pair in reduced),
            "not_checked": not_checked(arm, self.obstacles, self.self_collision, self.clearance),
            "is_clearance_reduced_throughout": self.is_reduced_throughout,
        }

    @property
    def clear_of(self) -> str:
        """Bodies from or between which the clearance is kept, in words; empty in free space."""
        kept = []
        if self.obstacles:
            kept.append(FROM_OBSTACLES)
        if self.self_collision:
            kept.append(BETWEEN_LINKS)
        return " and ".join(kept)

    @property
    def is_reduced(self) -> bool:
        """Whether two bodies keep less than the clearance near the ends, or throughout."""
        return bool(self.reduced or self._reduced_by_shapes)

    @property
    def _reduced_by_shapes(self) -> tuple[LinkClearance, ...]:
        """Links that are measured by their shapes and keep less than the clearance."""
        return tuple(pair for pair in self.by_shapes if pair.kept < self.clearance)

    @property
    def kept_in_part(self) -> tuple[str, ...]:
        """Places where less than the clearance is kept, in words."""
        where = "during the whole motion" if self.is_reduced_throughout else "near the ends"
        near_ends = [pair for pair in self.reduced if min(pair.start, pair.goal) > 0]
        return (
            *(f"all of the clearance {where}: {pair}" for pair in near_ends),
            *(
                f"all of the clearance during the whole motion: {pair}"
                for pair in self._reduced_by_shapes
            ),
        )

    def between(self, description: Description, start: Array, goal: Array) -> CollisionAvoidance:
        """Return the settings for a motion between two configurations (n,), with the reduced clearances of its ends.

        Raises
        ------
        PlanningError
            A clearance larger than the space in which the arm moves.
        """
        size = checked_pairs(description).size
        if self.clearance > size:
            raise PlanningError(
                f"clearance is {self.clearance:.4g} m; the arm itself reaches over {size:.4g} m"
            )
        at_ends = np.stack([start, goal])

        separation = Separation(description, self.obstacles, self.self_collision)
        gaps = separation.gaps(at_ends[:, None]).gap
        reduced = []
        for p in np.flatnonzero(gaps.min(axis=0, initial=np.inf) < self.clearance):
            pair = separation.pairs[p]
            if pair.other is not None:
                near = separation.capsules[pair.other].name
            else:
                near = self.obstacles[pair.obstacle or 0].name
            names = (separation.capsules[pair.capsule].name, near)
            at_start, at_goal = (KEPT_SHARE * gaps[:, p]).tolist()
            reduced.append(ReducedClearance(pair, names, at_start, at_goal))

        by_shapes = []
        for bodies in link_pairs(description).shapes if self.self_collision else ():
            gap = float(shape_distances(description, at_ends, bodies).min())
            kept = self.clearance if gap >= self.clearance else KEPT_SHARE * gap
            by_shapes.append(LinkClearance(bodies, kept))
        return replace(self, reduced=tuple(reduced), by_shapes=tuple(by_shapes), ends=at_ends)

    def claims(self, description: Description) -> tuple[Claim, ...]:
        """Return the distances that a certificate claims: of all links but those that reports name as not checked.

        A clearance that is reduced at an end counts as reduced during the whole motion.
        """
        return (
            *self._claims_beside_obstacles(description),
            *self._claims_between_links(description),
        )

    def _claims_beside_obstacles(self, description: Description) -> list[Claim]:
        """Return the claimed distances of links from obstacles."""
        capsules = link_capsules(description)

        # Reduced distance of a link from an obstacle, m.
        least: dict[tuple[int, int], float] = {}
        for reduced in self.reduced:
            if reduced.pair.other is None:
                place = (capsules[reduced.pair.capsule].link, reduced.pair.obstacle or 0)
                gap = min(reduced.start, reduced.goal, self.clearance)
                least[place] = min(gap, least.get(place, gap))

        claims = []
        for k, obstacle in enumerate(self.obstacles):
            unchecked = {
                link for link, gap in standing(description, obstacle) if gap < self.clearance
            }
            links = [link for link in range(1, description.n + 1) if link not in unchecked]
            claims += [
                Claim(link, obstacle, least.get((link, k), self.clearance)) for link in links
            ]
        return claims

    def _claims_between_links(self, description: Description) -> list[Claim]:
        """Return the claimed distances between links that are not neighbours."""
        if not self.self_collision:
            return []
        capsules = link_capsules(description)

        # Reduced distance of two links, m.
        least: dict[tuple[int, int], float] = {}
        for reduced in self.reduced:
            if reduced.pair.other is not None:
                first = capsules[reduced.pair.capsule].link
                second = capsules[reduced.pair.other].link
                links = (min(first, second), max(first, second))
                gap = min(reduced.start, reduced.goal, self.clearance)
                least[links] = min(gap, least.get(links, gap))
        for pair in self.by_shapes:
            links = (pair.bodies[0].link, pair.bodies[1].link)
            least[links] = min(pair.kept, least.get(links, pair.kept))

        pairs = link_pairs(description)
        unchecked = {(a.link, b.link) for a, b in pairs.unchecked}
        unchecked |= {(a.link, b.link) for a, b, gap in pairs.steady if gap < self.clearance}
        claims = []
        for a, b in combinations(range(description.n + 1), 2):
            if b - a > 1 and (a, b) not in unchecked:
                claims.append(Claim(b, a, least.get((a, b), self.clearance)))
        return claims

    @property
    def reduced_throughout(self) -> CollisionAvoidance:
        """The same, with clearances that are reduced at an end reduced during the whole motion."""
        return replace(self, is_reduced_throughout=True)

    def at_ends(self, pairs: Sequence[Pair]) -> Array:
        """Return the reduced clearances of pairs at the start and the goal, shape (P, 2), m; inf if not reduced."""
        ends = {reduced.pair: (reduced.start, reduced.goal) for reduced in self.reduced}
        return np.array([ends.get(pair, (np.inf, np.inf)) for pair in pairs]).reshape(-1, 2)

    def required(self, description: Description, q: Array, pairs: Sequence[Pair]) -> Array:
        """Return the required gaps of pairs at states q (N, n), shape (N, P), m.

        A pair that is nearer than the clearance at an end keeps less while its links are near where they are there.
        """
        need = np.full((len(q), len(pairs)), self.clearance)
        if not self.reduced or self.ends is None:
            return need
        axes = world_axes(description, q)
        axes_at_ends = world_axes(description, self.ends)
        for p, (pair, kept) in enumerate(zip(pairs, self.at_ends(pairs), strict=True)):
            capsules = [capsule for capsule in (pair.capsule, pair.other) if capsule is not None]
            for end in np.flatnonzero(kept < self.clearance):
                # Distance of the capsules' axes from their places at that end of the motion.
                travel = np.linalg.norm(
                    axes[:, capsules] - axes_at_ends[end, capsules], axis=-1
                ).max(axis=(1, 2))
                near = (travel < LEAVING * self.clearance) | self.is_reduced_throughout
                need[near, p] = np.minimum(need[near, p], kept[end])
        return need

    def shortfalls(self, states: States) -> Array:
        """Return the largest shortfall, required less measured distance, along a motion, shape (N,), m; by coal.

        At the states the distances themselves are required, and between them all but ``BETWEEN`` of them.
        """
        pairs = [reduced.pair for reduced in self.reduced]
        description = states.description

        def gaps(q: Array) -> Array:
            return np.column_stack(
                [self._distances(description, q), self._reduced_distances(description, q)]
            )

        found = gaps(states.q)
        required = np.full(found.shape, self.clearance)
        if pairs:
            required[:, 1:] = self.required(description, states.q, pairs)
        # Between two states, the distance that is required at one of them.
        required_between = np.minimum(required, np.append(required[1:], required[-1:], axis=0))
        least = _without_slack(required_between)
        between = smallest_between(states, found, gaps, least)
        result: Array = np.maximum(
            _largest_shortfall(required, found, required_between, between, least),
            self._shortfalls_of_shapes(states),
        )
        return result

    def _shortfalls_of_shapes(self, states: States) -> Array:
        """Return the largest shortfall of distances between links that are measured by their shapes, shape (N,), m."""
        if not self.by_shapes:
            return np.full(len(states.q), -np.inf)
        kept = np.array([pair.kept for pair in self.by_shapes])
        found = self._shape_gaps(states.description, states.q, MEASURED)
        least = np.broadcast_to(_without_slack(kept), found.shape)

        def gaps(q: Array) -> Array:
            return self._shape_gaps(states.description, q, MEASURED)

        # A shape lies in its link's capsules, so that its points are at most a radius away from their axes.
        largest_radius = max(capsule.radius for capsule in link_capsules(states.description))
        between = smallest_between(states, found, gaps, least, largest_radius)
        return _largest_shortfall(kept, found, kept, between, least)

    def _shape_gaps(self, description: Description, q: Array, more: float) -> Array:
        """Return the distances of the links that are measured by their shapes, shape (N, E), m.

        They are lower bounds where they exceed the required distances by ``more``, m.
        """
        gaps = [
            shape_distances(description, q, pair.bodies, pair.kept + more)
            for pair in self.by_shapes
        ]
        return np.stack(gaps, axis=1) if gaps else np.zeros((len(q), 0))

    def keeps_shapes_apart(self, description: Description, q: Array) -> NDArray[np.bool_]:
        """Return whether links that are measured by their shapes keep their distances at states q (N, n)."""
        kept = np.array([pair.kept for pair in self.by_shapes])
        apart: NDArray[np.bool_] = np.all(self._shape_gaps(description, q, 0.0) >= kept, axis=1)
        return apart

    def _distances(self, description: Description, q: Array) -> Array:
        """Return the smallest distance of pairs whose clearance is not reduced, shape (N,), m."""
        without = [reduced.pair for reduced in self.reduced]
        return smallest_distances(description, q, self.obstacles, self.self_collision, without)

    def _reduced_distances(self, description: Description, q: Array) -> Array:
        """Return the distances of the pairs whose clearance is reduced, shape (N, P), m."""
        each = [
            pair_distances(description, q, self.obstacles, reduced.pair) for reduced in self.reduced
        ]
        return np.stack(each, axis=1) if each else np.zeros((len(q), 0))

    def require_gap(self, description: Description, q: Array, where: str, least: float) -> None:
        """Require a distance of at least ``least`` (m), and no collision, at one configuration q (n,), rad and m.

        Raises
        ------
        PlanningError
            Names the link, the obstacle and the gap.
        """
        found = distance(description, q, self.obstacles, self.self_collision)
        gap = float(found.distance)
        if gap >= least and gap > 0:
            return
        link, obstacle = found.pair or ("the arm", "an obstacle")
        state = f"{1000 * gap:.3g} mm from" if gap > 0 else f"{-1000 * gap:.3g} mm inside"
        raise PlanningError(
            f"{where}: {link} is {state} {obstacle}, {1000 * self.clearance:.3g} mm are asked for"
        )


def _largest_shortfall(
    required: Array, found: Array, required_between: Array, between: Array, least: Array
) -> Array:
    """Return the largest shortfall of distances at states and between them, shape (N,), m.

    Parameters
    ----------
    required, found
        Required and measured distances at the states, shape (N, G) or (G,) and (N, G), m.
    required_between, between, least
        Required distances after each state, the smallest ones found there, and those below which they count, m.
    """
    at_states = required - found
    missing = np.where(between < least, required_between - between, -np.inf)
    largest: Array = np.maximum(at_states, missing).max(axis=1)
    return largest


NO_AVOIDANCE = CollisionAvoidance()
"""The settings of a motion in free space: without obstacles, and without distances between links."""


@dataclass(frozen=True, eq=False)
class Clearance(Constraint):
    """The clearance from obstacles, measured by coal; an optimizer keeps it by planes, see ``avoiding.py``."""

    avoidance: CollisionAvoidance
    moving = False
    active_share = 0.999

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "clearance"

    @property
    def is_limiting(self) -> bool:
        """Whether there are obstacles."""
        return bool(self.avoidance)

    def measured(self, states: States, parameters: Array) -> Array:
        """Return 1 plus the largest shortfall of the required distances in m, shape (N, 1); at least 0."""
        shortfalls = self.avoidance.shortfalls(states)
        return 1 + np.maximum(shortfalls[:, None], -1.0)


def motion_constraints(
    limits: Limits, avoidance: CollisionAvoidance, constraints: Sequence[Constraint]
) -> tuple[Constraint, ...]:
    """Return all constraints of a motion: those of :class:`dhkit.planning.criteria.Limit`, then the given ones."""
    return (*joint_limits(limits), Clearance(avoidance), *constraints)
