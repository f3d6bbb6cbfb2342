"""Pairs of capsules and obstacles that are checked for an arm."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from dhkit.description import Array, Convention, Description, link_transforms, world_to_frames
from dhkit.model.shapes import MeshVersions, link_parts, mesh_versions
from dhkit.planning.obstacles.capsules import LinkBody, link_capsules, world_axes
from dhkit.planning.obstacles.scene import Floor, Obstacle
from dhkit.planning.obstacles.solids import obstacle_distances, segment_distances, shape_distances

SAMPLES = 4000
"""Number of random configurations from which the pairs are chosen."""
SEED = 0
"""Seed of the random configurations: an arm has the same pairs in every run."""
OVERLAP_SHARE = 0.4
"""Share of configurations with an overlap from which two capsules are too wide for the shapes in them."""
SHAPE_SAMPLES = 200
"""Number of configurations in which the shapes of two links are measured."""
STEADY = 1e-3
"""Change of a distance over all sampled configurations, m, below which a proof that no motion matters is tried."""
MOST_JOINTS = 2
"""Number of joints between two links up to which their distance is computed on a grid."""
GRID = 256
"""Number of values of a joint on that grid."""
STILL = 1e-9
"""Largest travel, as a share of a capsule's largest coordinate, that is rounding."""
LEAST_TURN = 0.2
"""Smallest range of a revolute joint that is sampled, rad."""
LEAST_STROKE = 0.1
"""Smallest range of a prismatic joint that is sampled, as a share of the arm's reach."""
STANDING_SAMPLES = 400
"""Number of configurations from which an arm is found to stand in an obstacle: it overlaps it in all of them."""
FOOT = LinkBody(0)
"""The base itself, without links that were locked to it."""
MAX_OBSTACLES = 65_536
"""Number of obstacles whose capsules are remembered; of more, every call would find them anew."""


@dataclass(frozen=True)
class CheckedPairs:
    """Capsules of an arm that are checked against obstacles and the floor: indices of ``link_capsules(description)``.

    - Obstacles: capsules with an end that moves; so never the base's, nor a shoulder's that turns about its own axis.
    - Floor: ends whose height changes.
    - Links that were locked to the base move as if their joints still turned.

    Determined from 4,000 random configurations within the limits (unlimited joints: pi, or the reach, each way).
    """

    moving: tuple[int, ...]
    """Indices of capsules that are checked against obstacles, see :func:`capsules_beside`."""
    heights: tuple[tuple[int, int], ...]
    """Capsules and their ends (0 or 1) that are checked against the floor, see :func:`ends_above`."""
    size: float
    """Largest edge of the box around all axes of capsules in these configurations, m."""


class SteadyPair(NamedTuple):
    """Two bodies of links, and the smallest distance of capsules of theirs that no motion changes, m."""

    first: LinkBody
    second: LinkBody
    distance: float


@dataclass(frozen=True)
class LinkPairs:
    """Pairs of an arm's links that are checked against each other.

    - Every two links that no joint connects are checked by their capsules, or by their shapes where the capsules are
      too wide: where they overlap in more than 40 % of 4,000 random configurations.
    - Left out are capsules whose distance changes by less than 1 mm and is proved to stay above 0, see
      :func:`_least_of_turns`: those of a wrist's first and third link, for example.
    - Links that a joint connects are left out where their shapes overlap in each of 200 random configurations: they
      touch by construction. Others are checked like those that no joint connects.
    - Of other links whose shapes overlap in each of these 200, such as those of a spherical wrist whose drums are drawn
      about one point, only the capsules that are not too wide are checked. Reports name them.
    - Links that were locked together count as links of their own.
    """

    capsules: tuple[tuple[int, int], ...]
    """Pairs of capsules that are checked against each other."""
    shapes: tuple[tuple[LinkBody, LinkBody], ...]
    """Pairs of links whose shapes are checked against each other."""
    unchecked: tuple[tuple[LinkBody, LinkBody], ...]
    """Pairs of links whose shapes overlap in all sampled configurations."""
    steady: tuple[SteadyPair, ...] = ()
    """Pairs of links, connected by no joint, with capsules whose distance no motion changes: they are not checked."""

    @property
    def unchecked_text(self) -> str:
        """The links that are not checked, as text; empty if all are."""
        return ", ".join(dict.fromkeys(pair_text(a, b) for a, b in self.unchecked))


def pair_text(first: LinkBody, second: LinkBody) -> str:
    """Return two bodies of links, as text."""
    if first.link == second.link:
        return f"links that are locked together as {first.name}"
    return f"{first.name} and {second.name}"


class Pair(NamedTuple):
    """A capsule of the arm, and the obstacle or other capsule from which it keeps a distance."""

    capsule: int
    """Index of the capsule."""
    obstacle: int | None
    """Index of an obstacle, or None for another capsule."""
    other: int | None = None
    """Index of the other capsule."""
    ends: tuple[int, ...] = (0, 1)
    """Ends of the capsule's axis that are checked: of the floor, those whose height changes."""


def checked_pairs(description: Description) -> CheckedPairs:
    """Return the checked pairs of an arm."""
    return _checked_pairs(description, mesh_versions(description))


@lru_cache(maxsize=64)
def _checked_pairs(description: Description, meshes: MeshVersions) -> CheckedPairs:
    axes = _sampled_axes(description)
    if not axes.shape[1]:
        return CheckedPairs((), (), 0.0)
    size = float(np.ptp(axes.reshape(-1, 3), axis=0).max())
    # Travel of each end of each capsule along x, y and z, compared with its own coordinates: a prismatic joint without
    # sensible limits takes others a million kilometres away.
    travels = np.ptp(axes, axis=0)
    rounding = STILL * np.abs(axes).max(axis=(0, 2, 3), initial=0.0)
    moves = travels > rounding[:, None, None]
    return CheckedPairs(
        moving=tuple(int(i) for i in np.flatnonzero(moves.any(axis=(1, 2)))),
        heights=tuple((i, end) for i, end in np.argwhere(moves[:, :, 2]).tolist()),
        size=size,
    )


def link_pairs(description: Description) -> LinkPairs:
    """Return the pairs of links of an arm.

    Raises
    ------
    ModelError
        coal is not installed, or a mesh cannot be read.
    """
    return _link_pairs(description, mesh_versions(description))


@lru_cache(maxsize=64)
def _link_pairs(description: Description, meshes: MeshVersions) -> LinkPairs:
    capsules = link_capsules(description)
    q = _configurations(description)
    axes = world_axes(description, q)
    of_body: dict[LinkBody, list[int]] = {}
    for i, capsule in enumerate(capsules):
        of_body.setdefault(capsule.body, []).append(i)
    order = _chain_order(description)

    checked: list[tuple[int, int]] = []
    shapes: list[tuple[LinkBody, LinkBody]] = []
    unchecked: list[tuple[LinkBody, LinkBody]] = []
    steady: list[SteadyPair] = []
    for a, b in combinations(sorted(of_body), 2):
        are_connected = order[b] - order[a] == 1
        narrow: list[tuple[int, int]] = []
        has_wide = False
        same = np.inf
        for i, j in product(of_body[a], of_body[b]):
            gap = (
                segment_distances(axes[:, i], axes[:, j]) - capsules[i].radius - capsules[j].radius
            )
            if np.mean(gap < 0) > OVERLAP_SHARE:
                has_wide = True
                continue
            least = _least_of_turns(description, i, j) if np.ptp(gap) <= STEADY else None
            if least is None:
                narrow.append((i, j))
            else:
                same = min(same, float(gap.min()), least)
        overlaps = has_wide and bool(
            (shape_distances(description, q[:SHAPE_SAMPLES], (a, b), enough=0.0) < 0).all()
        )
        touches_by_construction = overlaps and are_connected
        if touches_by_construction:
            continue
        checked += narrow
        if not are_connected and np.isfinite(same):
            steady.append(SteadyPair(a, b, same))
        if overlaps:
            unchecked.append((a, b))
        elif has_wide:
            shapes.append((a, b))
    return LinkPairs(tuple(checked), tuple(shapes), tuple(unchecked), tuple(steady))


def _chain_order(description: Description) -> dict[LinkBody, int]:
    """Return the place of each body along the chain, from 0: a joint, moving or locked, connects neighbours."""
    last: dict[int, int] = {}
    for capsule in link_capsules(description):
        last[capsule.link] = max(capsule.body.number, last.get(capsule.link, 0))
    bodies: list[LinkBody] = []
    for link in range(description.n + 1):
        bodies += [LinkBody(link, k) for k in range(last.get(link, 0) + 1)]
    return {body: place for place, body in enumerate(bodies)}


def _sampled_axes(description: Description) -> Array:
    """Return the axes of capsules in random configurations, shape (SAMPLES, m, 2, 3), m."""
    return _axes_with_locked_joints_turned(description, _configurations(description))


def _axes_in_whole_turns(description: Description) -> Array:
    """Return the axes of capsules in whole turns of the revolute joints, shape (STANDING_SAMPLES, m, 2, 3)."""
    q = _configurations(description, whole_turns=True)[:STANDING_SAMPLES]
    return _axes_with_locked_joints_turned(description, q)


def _axes_with_locked_joints_turned(description: Description, q: Array) -> Array:
    """Return the axes of capsules at q, shape (N, n), of which locked joints turn at random.

    Locked prismatic joints count as revolute ones: so the same parts move beside an obstacle or a floor in a locked arm
    and in the whole arm. A turn by an angle about the axis z through p takes a point x to R (x - p) + p, with the
    rotation R of that angle about z.
    """
    from scipy.spatial.transform import Rotation

    count = len(q)
    axes = world_axes(description, q).copy()
    links = world_to_frames(description, q)
    frames = {(part.link, part.body): part.T_link_body for part in link_parts(description)}
    bodies = [capsule.body for capsule in link_capsules(description)]
    rng = np.random.default_rng(SEED)
    last: dict[int, int] = {}
    for link, number in frames:
        last[link] = max(number, last.get(link, 0))

    # From the tip to the base, so that no axis has been moved before it turns the links after it.
    for link in sorted(last, reverse=True):
        for joint in range(last[link], 0, -1):
            # Joint k of a link's bodies turns about z of body k - 1, in the modified convention about z of body k.
            T = frames.get(
                (link, joint - 1 if description.convention is Convention.STANDARD else joint)
            )
            carried = []
            for i, body in enumerate(bodies):
                if body.link > link or (body.link == link and body.number >= joint):
                    carried.append(i)
            # Of a link without shapes: its axis is not known, and all links after it move.
            if T is None:
                size = float(np.ptp(axes.reshape(-1, 3), axis=0).max(initial=0.0)) or 1.0
                axes[:, carried] += rng.uniform(-size, size, (count, 1, 1, 3))
                continue
            T_world = links[:, link] @ T
            z = T_world[:, :3, 2]
            p = T_world[:, None, None, :3, 3]
            angles = rng.uniform(-np.pi, np.pi, (count, 1))
            R = Rotation.from_rotvec(angles * z).as_matrix()
            axes[:, carried] = (axes[:, carried] - p) @ np.swapaxes(R, -1, -2)[:, None] + p
    return axes


def _least_of_turns(description: Description, i: int, j: int) -> float | None:
    """Return a lower bound of the distance of two capsules, m, in all configurations; None where none is proved.

    It is proved for at most two revolute joints between the links, where the distance changes by less than ``STEADY``
    over a grid of whole turns, and the bound is above 0.

    The distance depends on the joints between the links alone, and is computed on a grid of their whole turns. From the
    axis of joint k, whose own offset d_k lies along it, a point of the outer link is at most

        r_k = |a_k| + sum over the joints i after k of sqrt(a_i^2 + d_i^2) + |end|

    away, so that within half a step h of each joint the distance changes by at most the sum of r_k h / 2.
    """
    capsules = link_capsules(description)
    inner = capsules[i].link
    outer = capsules[j].link
    numbers = description.numbers
    joints = range(inner, outer)
    if not joints:
        return np.inf  # locked together: not even one configuration differs from another
    if len(joints) > MOST_JOINTS or numbers.prismatic[inner:outer].any():
        return None
    # The outer capsule's ends in the inner link's frame, A_(inner+1) ... A_outer applied to them: every joint from the
    # last to the first adds an axis of GRID values to the front, shape (GRID, ..., 2, 3).
    values = np.linspace(-np.pi, np.pi, GRID, endpoint=False)
    A = link_transforms(description, np.broadcast_to(values[:, None], (GRID, description.n)))
    outer_ends = np.stack([capsules[j].start, capsules[j].end])
    for k in reversed(joints):
        R = A[:, k, :3, :3]
        p = A[:, k, :3, 3]
        turned = np.tensordot(R, outer_ends, axes=(-1, -1))  # (GRID, 3, ..., 2)
        outer_ends = np.moveaxis(turned, 1, -1) + p.reshape(GRID, *(1,) * (outer_ends.ndim - 1), 3)
    inner_ends = np.broadcast_to(np.stack([capsules[i].start, capsules[i].end]), outer_ends.shape)
    gap = segment_distances(inner_ends, outer_ends) - capsules[i].radius - capsules[j].radius

    # The distance between two values of the grid differs by at most sum r_k h / 2 from that at the nearest one.
    end = max(float(np.linalg.norm(capsules[j].start)), float(np.linalg.norm(capsules[j].end)))
    lengths = np.hypot(numbers.a, numbers.d)
    r = [abs(float(numbers.a[k])) + float(lengths[k + 1 : outer].sum()) + end for k in joints]
    half_step = np.pi / GRID
    change = sum(r) * half_step
    is_steady = np.ptp(gap) <= STEADY and gap.min() > change
    return float(gap.min() - change) if is_steady else None


def capsules_beside(description: Description, obstacle: Obstacle) -> tuple[int, ...]:
    """Return the indices of the capsules that are checked against an obstacle.

    They are those that move, without those that travel by no more than their radius and overlap the obstacle in all
    configurations: a foot in the box or table that the arm stands on, which no motion changes.
    """
    return _capsules_beside(description, mesh_versions(description), obstacle)


@lru_cache(maxsize=MAX_OBSTACLES)
def _capsules_beside(
    description: Description, meshes: MeshVersions, obstacle: Obstacle
) -> tuple[int, ...]:
    capsules = link_capsules(description)
    axes = _axes_in_whole_turns(description)

    def stands_in(i: int) -> bool:
        radius = capsules[i].radius
        if np.ptp(axes[:, i], axis=0).max() > radius or not overlaps(axes[:1, i], radius):
            return False
        return overlaps(axes[:, i], radius)

    def overlaps(states: Array, radius: float) -> bool:
        return bool((obstacle_distances(radius, states, obstacle) < 0).all())

    return tuple(i for i in checked_pairs(description).moving if not stands_in(i))


def ends_above(description: Description, height: float) -> tuple[tuple[int, int], ...]:
    """Return the capsules and their ends (0 or 1) that are checked against a floor at a height, m.

    They are those whose height changes, without those that change it by no more than their radius and are below the
    floor in all configurations: an arm may stand in it.
    """
    return _ends_above(description, mesh_versions(description), height)


@lru_cache(maxsize=256)
def _ends_above(
    description: Description, meshes: MeshVersions, height: float
) -> tuple[tuple[int, int], ...]:
    capsules = link_capsules(description)
    axes = _axes_in_whole_turns(description)

    def stands_in(i: int, end: int) -> bool:
        radius = capsules[i].radius
        lowest = axes[:, i, end, 2]
        return bool(np.ptp(lowest) <= radius and (lowest < radius + height).all())

    return tuple((i, end) for i, end in checked_pairs(description).heights if not stands_in(i, end))


class Standing(NamedTuple):
    """A link of which some part does not move beside an obstacle, so that no distance is checked there."""

    link: int
    distance: float
    """Distance of that part's capsule from the obstacle, the largest in random configurations, m."""


def standing(description: Description, obstacle: Obstacle | Floor) -> tuple[Standing, ...]:
    """Return the links with parts that are not checked against an obstacle since they stay where they are.

    A capsule that turns about its own axis stays where it is, but what it contains need not be round. Links that turn
    about vertical axes alone keep their heights above a floor.
    """
    return _standing(description, mesh_versions(description), obstacle)


@lru_cache(maxsize=MAX_OBSTACLES)
def _standing(
    description: Description, meshes: MeshVersions, obstacle: Obstacle | Floor
) -> tuple[Standing, ...]:
    capsules = link_capsules(description)
    q = _configurations(description)[:STANDING_SAMPLES]
    axes = world_axes(description, q)
    found: dict[int, float] = {}
    if isinstance(obstacle, Floor):
        checked = ends_above(description, obstacle.height)
        for i, end in product(range(len(capsules)), (0, 1)):
            link = capsules[i].link
            if capsules[i].body != FOOT and (i, end) not in checked:
                gap = float(axes[:, i, end, 2].max()) - capsules[i].radius - obstacle.height
                found[link] = min(gap, found.get(link, gap))
    else:
        beside = capsules_beside(description, obstacle)
        for i, capsule in enumerate(capsules):
            if capsule.body != FOOT and i not in beside:
                gap = float(obstacle_distances(capsule.radius, axes[:, i], obstacle).max())
                found[capsule.link] = min(gap, found.get(capsule.link, gap))
    return tuple(Standing(link, gap) for link, gap in sorted(found.items()))


def _configurations(description: Description, whole_turns: bool = False) -> Array:
    """Return random configurations, shape (SAMPLES, n), inside the limits, or of whole turns about their middle.

    A range that is smaller than ``LEAST_TURN`` or ``LEAST_STROKE`` is widened about its middle.
    """
    numbers = description.numbers
    span = np.where(numbers.prismatic, max(description.reach, 1.0), np.pi)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -span)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, span)
    low = np.minimum(lower, upper)
    high = np.maximum(lower, upper)
    # A joint whose range is a point may move by the limits of a motion.
    least = np.where(
        numbers.prismatic, LEAST_STROKE * max(description.reach, LEAST_STROKE), LEAST_TURN
    )
    if whole_turns:
        least = np.where(numbers.prismatic, least, 2 * np.pi)
    widened = np.maximum(least - (high - low), 0.0) / 2
    low = low - widened
    high = high + widened
    return np.random.default_rng(SEED).uniform(low, high, (SAMPLES, description.n))
