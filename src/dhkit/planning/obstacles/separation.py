"""Gaps of a motion from obstacles and between links, and planes that separate each pair, for an optimizer.

Solids are convex. The plane at a solid's nearest point, at right angles to the shortest connection, therefore has the
solid on one side: while a link stays on the other side, the two cannot meet. With the nearest points a on one solid's
axis and b on the other's, and their radii r_a and r_b, the plane that touches the first has

    n = (b - a) / |b - a|,    level = n . a + r_a,    gap = |b - a| - r_a - r_b,

and points x of the other's axis keep a distance d if n . x >= level + d + r_b. Planes are linear in the positions of
the links, so that an optimizer needs no distances. A plane between two links moves with one of them, so that it need
not move when they move together.

A plane that separates a link from one obstacle separates it from every solid behind that plane too. Of copies, and of
the obstacles of a wall or a heap, few planes are left, with the same motions allowed.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Box, Description, world_to_frames
from dhkit.planning.obstacles.capsules import link_capsules, world_axes
from dhkit.planning.obstacles.pairs import Pair, capsules_beside, ends_above, link_pairs
from dhkit.planning.obstacles.scene import Floor, Obstacle, Solids
from dhkit.planning.obstacles.solids import nearest_on_box, nearest_points

Indices = NDArray[np.int_]

ZERO = 1e-12
"""Length of the shortest connection, m, below which its direction is undefined."""
UP = np.array([0.0, 0.0, 1.0])
"""Normal of a plane where the direction of the shortest connection is undefined."""
BEHIND_TOLERANCE = 1e-9
"""Tolerance, m, for deciding whether a solid lies behind a plane; it absorbs the rounding between identical solids."""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Smallest gaps of P pairs in K groups of states, and a plane between each pair.

    The plane is that of the state whose plane both the first and the last state of the group keep best. Beside an
    obstacle it is fixed in the world and touches the obstacle; between links it is fixed in the frame of the pair's
    first capsule and touches that one.
    """

    gap: Array
    """Smallest gaps, shape (K, P), m; for axes that intersect, minus the sum of the radii."""
    normal: Array
    """Normals of the planes, from the body that they touch to the other one, shape (K, P, 3)."""
    level: Array
    """Position of that body's surface along the normal, shape (K, P), m."""


class PlaneRow(NamedTuple):
    """A point of a link that must stay on one side of a plane, at a knot: normal . x >= level."""

    link: int
    """Index of its DH frame."""
    frame: int | None
    """Index of the DH frame in which the plane is fixed; None for the world."""
    knot: int
    """Index of the knot."""
    point: Array
    """The point in the link's frame, shape (3,), m."""
    normal: Array
    """Normal of the plane in the plane's frame, a unit vector, shape (3,)."""
    level: float
    """Position of the plane along its normal, m, with the distance to keep."""


class Separation:
    """The pairs of an arm and a scene.

    Parameters
    ----------
    description
        The robot.
    obstacles
        K obstacles, of which at most one is a floor.
    self_collision
        Whether pairs of links are included.
    """

    def __init__(
        self,
        description: Description,
        obstacles: Sequence[Obstacle | Floor],
        self_collision: bool = False,
    ) -> None:
        self.description = description
        self.obstacles = tuple(obstacles)
        self.capsules = link_capsules(description)
        self.radii = np.array([capsule.radius for capsule in self.capsules])
        self._half_lengths = np.array([capsule.length / 2 for capsule in self.capsules])
        self.pairs: list[Pair] = []
        self._groups: list[_Group] = []
        solids = [(k, item) for k, item in enumerate(self.obstacles) if isinstance(item, Obstacle)]
        for is_box in (False, True):
            pairs = []
            for k, solid in solids:
                if isinstance(solid.geometry, Box) == is_box:
                    pairs += [Pair(i, k) for i in capsules_beside(description, solid)]
            self._add(pairs)
        for k, item in enumerate(self.obstacles):
            if isinstance(item, Floor):
                ends: dict[int, tuple[int, ...]] = {}
                for i, end in ends_above(description, item.height):
                    ends[i] = (*ends.get(i, ()), end)
                self._add([Pair(i, k, None, which) for i, which in ends.items()])
        if self_collision:
            self._add([Pair(i, None, j) for i, j in link_pairs(description).capsules])

    def _add(self, pairs: list[Pair]) -> None:
        """Append pairs of one kind: with boxes, with other solids, with the floor, or between links."""
        if not pairs:
            return
        part = slice(len(self.pairs), len(self.pairs) + len(pairs))
        capsules = np.array([pair.capsule for pair in pairs])
        others = [
            None if pair.obstacle is None else self.obstacles[pair.obstacle] for pair in pairs
        ]
        solids = [item for item in others if isinstance(item, Obstacle)]
        floor = others[0] if isinstance(others[0], Floor) else None
        second = np.array([-1 if pair.other is None else pair.other for pair in pairs])
        self._groups.append(
            _Group(part, capsules, second, Solids.of(solids) if solids else None, floor)
        )
        self.pairs += pairs

    def gaps(self, q: Array, near: float = np.inf) -> Gaps:
        """Return the gaps of K groups of states, shape (K, S, n), rad and m; infinite if surely above ``near``, m."""
        axes = world_axes(self.description, q)
        shape = (len(q), len(self.pairs))
        found = Gaps(np.full(shape, np.inf), np.zeros((*shape, 3)), np.zeros(shape))
        for group in self._groups:
            if group.is_of_links:
                self._measure_links(world_to_frames(self.description, q), axes, group, found)
                continue
            k, p = self._near(axes, group, near)
            if len(k):
                self._measure(axes, group, k, p, found)
        return found

    def smallest(self, q: Array, near: float = np.inf) -> Array:
        """Return the smallest gap at states q (N, n), shape (N,), m; infinite if certainly above ``near``, m."""
        smallest: Array = self.gaps(q[:, None], near).gap.min(axis=1, initial=np.inf)
        return smallest

    def rows(
        self, gaps: Gaps, active: NDArray[np.bool_], margins: Array, fixed: Container[int] = ()
    ) -> list[PlaneRow]:
        """Return the rows that keep pairs apart in the intervals of a mesh, at both of their knots.

        Parameters
        ----------
        gaps
            Gaps of a motion that is clear of obstacles, in K intervals.
        active
            Pairs to include, shape (K, P).
        margins
            Distances to keep, shape (K, P), m.
        fixed
            Knots whose joint values are given, without rows.
        """
        rows: list[PlaneRow] = []
        for k, p in np.argwhere(self._needed(gaps, active, margins)).tolist():
            # The plane touches an obstacle and the capsule stays beyond it, or the first of two capsules.
            pair = self.pairs[p]
            first = self.capsules[pair.capsule]
            if pair.other is None:
                body = first
                frame = None
            else:
                body = self.capsules[pair.other]
                frame = first.link
            if body.link == 0:
                continue

            # n . x >= level + margin + radius, for the ends x of the axis; a ball has one.
            normal = gaps.normal[k, p]
            level = float(gaps.level[k, p]) + float(margins[k, p]) + body.radius
            ends = pair.ends if body.length > 0 else pair.ends[:1]
            for end in ends:
                point = (body.start, body.end)[end]
                knots = [knot for knot in (k, k + 1) if knot not in fixed]
                rows += [PlaneRow(body.link, frame, knot, point, normal, level) for knot in knots]
        return rows

    def _needed(self, gaps: Gaps, active: NDArray[np.bool_], margins: Array) -> NDArray[np.bool_]:
        """Return the active pairs without those of obstacles behind the planes of others, shape (K, P)."""
        needed = active.copy()
        for group in self._groups:
            if group.solids is None:
                continue
            active_in_group = active[:, group.part]
            for capsule in np.unique(group.capsules):
                beside = np.flatnonzero(group.capsules == capsule)
                has_several = active_in_group[:, beside].sum(axis=1) > 1
                for k in np.flatnonzero(has_several):
                    # The nearest first.
                    solids = beside[active_in_group[k, beside]]
                    solids = solids[
                        np.argsort(gaps.gap[k, solids + group.part.start], kind="stable")
                    ]
                    p = solids + group.part.start
                    needed[k, p] = _needed_planes(
                        group.solids, solids, gaps.normal[k, p], gaps.level[k, p], margins[k, p]
                    )
        return needed

    def _near(self, axes: Array, group: _Group, near: float) -> tuple[Indices, Indices]:
        """Return indices of groups of states and of a group's pairs that may be nearer than ``near``, shape (m,) each.

        A capsule and a solid lie in balls about their middles, of radius half length + radius and ``bounds``: they are
        not nearer than that of the balls.
        """
        capsules = group.capsules
        solids = group.solids
        if solids is None or np.isinf(near):
            k, p = np.indices((len(axes), len(capsules))).reshape(2, -1)
            return k, p
        is_near = np.zeros((len(axes), len(capsules)), dtype=bool)
        for capsule in np.unique(capsules):
            beside = np.flatnonzero(capsules == capsule)
            middles = axes[:, :, capsule].mean(axis=2)
            away = middles[:, :, None] - solids.centres[beside]
            squares = np.min(np.einsum("kspx,kspx->ksp", away, away), axis=1)
            reach = near + self.radii[capsule] + self._half_lengths[capsule] + solids.bounds[beside]
            is_near[:, beside] = squares < np.maximum(reach, 0.0) ** 2
        k, p = np.nonzero(is_near)
        return k, p

    def _measure(self, axes: Array, group: _Group, k: Indices, p: Indices, found: Gaps) -> None:
        """Write the gaps of pairs p of a group in groups k of states, shape (m,) each, each at its smallest."""
        capsules = group.capsules[p]
        own = axes[k[:, None], np.arange(axes.shape[1]), capsules[:, None]]  # (m, S, 2, 3)
        solids = group.solids
        radius = np.zeros(len(k))
        ends = own[:, [0, -1]]
        if group.floor is not None:
            on_axis, nearest = self._above_floor(own, group, p)
            ends = on_axis[:, [0, -1], None]
        elif solids is not None and solids.are_boxes:
            on_axis, nearest = nearest_on_box(
                own, solids.placements[p][:, None], solids.half_sizes[p][:, None]
            )
        elif solids is not None:
            radius = solids.radii[p]
            on_axis, nearest = nearest_points(own, solids.axes[p][:, None])
        obstacle = _Nearest(nearest, radius)
        link = _Nearest(on_axis, self.radii[capsules])
        _keep(found, (k, p + group.part.start), obstacle, link, ends)

    def _above_floor(self, own: Array, group: _Group, p: Indices) -> tuple[Array, Array]:
        """Return the lower checked ends of axes (m, S, 2, 3), and the points of the floor below them, (m, S, 3), m."""
        height = 0.0 if group.floor is None else group.floor.height
        pairs = self.pairs[group.part]
        is_checked = np.array([[0 in pair.ends, 1 in pair.ends] for pair in pairs])[p][:, None]
        low = np.argmin(np.where(is_checked, own[..., 2], np.inf), axis=-1)[..., None, None]
        on_floor = np.take_along_axis(own, low, axis=-2)[..., 0, :]
        on_axis = on_floor.copy()
        on_floor[..., 2] = height
        # Gaps of axes are not negative: an axis below the floor counts as on it.
        on_axis[..., 2] = np.maximum(on_axis[..., 2], height)
        return on_axis, on_floor

    def _measure_links(self, frames: Array, axes: Array, group: _Group, found: Gaps) -> None:
        """Write the gaps between links in groups of states; frames are those of links, shape (K, S, n+1, 4, 4)."""
        K, S = axes.shape[:2]
        firsts = group.capsules
        seconds = group.others
        T = frames[:, :, [self.capsules[i].link for i in firsts]]
        R = T[..., :3, :3]
        t = T[..., None, :3, 3]

        def in_frame(which: Indices) -> Array:
            """Return axes in the frames of the first capsules, R' (x - t), shape (K P, S, 2, 3), m."""
            return np.moveaxis((axes[:, :, which] - t) @ R, 1, 2).reshape(-1, S, 2, 3)

        own = in_frame(firsts)
        other = in_frame(seconds)
        on_own, on_other = nearest_points(own, other)
        k, p = np.indices((K, len(firsts))).reshape(2, -1)
        touched = _Nearest(on_own, self.radii[firsts[p]])
        beyond = _Nearest(on_other, self.radii[seconds[p]])
        _keep(found, (k, p + group.part.start), touched, beyond, other[:, [0, -1]])


class _Nearest(NamedTuple):
    """The points of m bodies that are nearest to others, in S states."""

    points: Array
    """Points of the axes, shape (m, S, 3), m."""
    radii: Array
    """Radii about the axes, shape (m,), m."""


def _keep(
    found: Gaps, here: tuple[Indices, Indices], touched: _Nearest, other: _Nearest, ends: Array
) -> None:
    """Write gaps, each at its smallest, and the planes that are kept best.

    Parameters
    ----------
    found
        The gaps to write.
    here
        Groups of states and pairs, shape (m,) each.
    touched, other
        The body that the plane touches, and the one beyond it.
    ends
        Points of the other body at the first and the last state, shape (m, 2, e, 3), m.
    """
    a = touched.points
    b = other.points
    r_a = touched.radii[:, None]
    r_b = other.radii[:, None]

    # n = (b - a) / |b - a|,  level = n . a + r_a,  gap = |b - a| - r_a - r_b
    along = b - a
    length = np.sqrt(np.sum(along * along, axis=-1))
    normal = along / np.maximum(length, ZERO)[..., None]
    normal[length < ZERO] = UP
    level = np.sum(normal * a, axis=-1) + r_a
    gap = length - r_b - r_a

    # Least n . x - r_b of the other body's ends x at the first and the last state, for the normal of each state, shape
    # (m, S): less the level it is the distance beyond that state's plane.
    beyond = np.einsum("msi,mkei->mske", normal, ends).min(axis=(2, 3)) - r_b
    best = (np.arange(len(gap)), np.argmax(beyond - level, axis=1))
    found.gap[here] = gap.min(axis=1)
    found.normal[here] = normal[best]
    found.level[here] = level[best]


@dataclass(frozen=True, eq=False)
class _Group:
    """Pairs of one kind: with boxes, with other solids, with the floor, or between links."""

    part: slice
    """Indices of the pairs."""
    capsules: Indices
    """Capsule of each pair, shape (P,)."""
    others: Indices
    """The other capsule of each pair of links, shape (P,); -1 of other pairs."""
    solids: Solids | None
    """Solid of each pair; None for a floor and for links."""
    floor: Floor | None
    """The floor; None for other pairs."""

    @property
    def is_of_links(self) -> bool:
        """Whether its pairs are links."""
        return self.solids is None and self.floor is None


def _needed_planes(
    solids: Solids, which: NDArray[np.int_], normal: Array, level: Array, required: Array
) -> NDArray[np.bool_]:
    """Return a mask (P,) of the planes between a link and solids that are needed.

    Plane i makes plane j needless if solid j, with the distance required from it, is behind the plane from which the
    link keeps away: max over points x of solid j of n_i . x + required_j <= level_i + required_i.

    Parameters
    ----------
    which
        Indices of the solids, the nearest first, shape (P,).
    normal, level
        Their planes: normals towards the link, shape (P, 3), and positions along them, shape (P,), m.
    required
        Distances of the link from each plane, shape (P,), m.
    """
    # Entry (i, j): whether plane i makes plane j needless.
    shields = (
        solids.reach(which, normal) + required <= (level + required)[:, None] + BEHIND_TOLERANCE
    )
    needed = np.zeros(len(which), dtype=bool)
    is_shielded = np.zeros(len(which), dtype=bool)
    for i in range(len(which)):
        if not is_shielded[i]:
            needed[i] = True
            is_shielded |= shields[i]
    return needed
