"""Gaps of a motion from obstacles and between links, and planes that separate each pair, for an optimizer.

Solids are convex. The plane at a solid's nearest point, at right angles to the shortest connection, therefore has the
solid on one side: while a link stays on the other side, the two cannot meet. Planes are linear in the positions of the
links, so that an optimizer needs no distances. A plane between two links moves with one of them, so that it need not
move when they move together.

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
"""Length (m) of the shortest connection below which its direction is undefined."""
UP = np.array([0.0, 0.0, 1.0])
BEHIND_TOLERANCE = 1e-9
"""Distance (m) by which a solid may stand before a plane and counts as behind it: of copies only rounding differs."""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Smallest gaps of P pairs in K groups of states, and a plane between each pair.

    The plane is that of the state whose plane both the first and the last state of the group keep best. Beside an
    obstacle it is fixed in the world and touches the obstacle; between links it is fixed in the frame of the pair's
    first capsule and touches that one.
    """

    gap: Array
    """Shape (K, P), m; for axes that intersect, minus the sum of the radii."""
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
    point: Array
    """In that frame, shape (3,), m."""
    normal: Array
    """In that frame, shape (3,)."""
    level: float
    """m."""


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
        self, description: Description, obstacles: Sequence[Obstacle | Floor], self_collision: bool = False
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
            alike = [(k, item) for k, item in solids if isinstance(item.geometry, Box) == is_box]
            self._add([Pair(i, k) for k, item in alike for i in capsules_beside(description, item)])
        for k, item in enumerate(self.obstacles):
            if isinstance(item, Floor):
                above = ends_above(description, item.height)
                ends = {i: tuple(end for j, end in above if j == i) for i, _ in above}
                self._add([Pair(i, k, None, which) for i, which in ends.items()])
        if self_collision:
            self._add([Pair(i, None, j) for i, j in link_pairs(description).capsules])

    def _add(self, pairs: list[Pair]) -> None:
        """Append pairs of one kind: with boxes, with other solids, with the floor, or between links."""
        if not pairs:
            return
        part = slice(len(self.pairs), len(self.pairs) + len(pairs))
        capsules = np.array([pair.capsule for pair in pairs])
        others = [None if pair.obstacle is None else self.obstacles[pair.obstacle] for pair in pairs]
        solids = [item for item in others if isinstance(item, Obstacle)]
        floor = others[0] if isinstance(others[0], Floor) else None
        second = np.array([-1 if pair.other is None else pair.other for pair in pairs])
        self._groups.append(_Group(part, capsules, second, Solids.of(solids) if solids else None, floor))
        self.pairs += pairs

    def gaps(self, q: Array, near: float = np.inf) -> Gaps:
        """Return the gaps of K groups of states, shape (K, S, n), rad and m; infinite if surely above ``near``, m."""
        axes = world_axes(self.description, q)
        shape = (len(q), len(self.pairs))
        found = Gaps(np.full(shape, np.inf), np.zeros((*shape, 3)), np.zeros(shape))
        for group in self._groups:
            at = self._near(axes, group, near)
            if group.is_of_links:
                self._measure_links(world_to_frames(self.description, q), axes, group, found)
            elif len(at[0]):
                self._measure(axes, group, at, found)
        return found

    def smallest(self, q: Array, near: float = np.inf) -> Array:
        """Return the smallest gap at states q (N, n), shape (N,), m; infinite if certainly above ``near``, m."""
        smallest: Array = self.gaps(q[:, None], near).gap.min(axis=1, initial=np.inf)
        return smallest

    def rows(self, gaps: Gaps, active: NDArray[np.bool_], margins: Array, fixed: Container[int] = ()) -> list[PlaneRow]:
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
        rows = []
        for k, p in np.argwhere(self._needed(gaps, active, margins)):
            pair = self.pairs[p]
            n = gaps.normal[k, p]
            capsule = self.capsules[pair.capsule]
            need = float(margins[k, p])
            body = capsule if pair.other is None else self.capsules[pair.other]
            frame = None if pair.other is None else capsule.link
            points = [(body.start, body.end)[end] for end in (pair.ends if body.length > 0 else pair.ends[:1])]
            rows += [
                PlaneRow(body.link, frame, knot, point, n, float(gaps.level[k, p]) + need + body.radius)
                for point in points
                for knot in (int(k), int(k) + 1)
                if body.link > 0 and knot not in fixed
            ]
        return rows

    def _needed(self, gaps: Gaps, active: NDArray[np.bool_], margins: Array) -> NDArray[np.bool_]:
        """Return the active pairs without those of obstacles behind the planes of others, shape (K, P)."""
        needed = active.copy()
        for group in self._groups:
            if group.solids is None:
                continue
            for capsule in np.unique(group.capsules):
                beside = np.flatnonzero(group.capsules == capsule)
                for k in np.flatnonzero(active[:, beside + group.part.start].sum(axis=1) > 1):
                    which = beside[active[k, beside + group.part.start]]
                    which = which[np.argsort(gaps.gap[k, which + group.part.start], kind="stable")]
                    p = which + group.part.start
                    planes = gaps.normal[k, p], gaps.level[k, p], margins[k, p]
                    needed[k, p] = _needed_planes(group.solids, which, *planes)
        return needed

    def _near(self, axes: Array, group: _Group, near: float) -> tuple[Indices, Indices]:
        """Return the groups of states and the pairs of a group whose balls around them come nearer than ``near``."""
        capsules, solids = group.capsules, group.solids
        if solids is None or np.isinf(near):
            k, p = np.indices((len(axes), len(capsules))).reshape(2, -1)
            return k, p
        is_near = np.zeros((len(axes), len(capsules)), dtype=bool)
        for capsule in np.unique(capsules):
            beside = np.flatnonzero(capsules == capsule)
            middles = axes[:, :, capsule].mean(axis=2)
            away = middles[:, :, None] - solids.centres[beside]
            reach = near + self.radii[capsule] + self._half_lengths[capsule] + solids.bounds[beside]
            squares = np.min(np.einsum("kspx,kspx->ksp", away, away), axis=1)
            is_near[:, beside] = squares < np.maximum(reach, 0.0) ** 2
        k, p = np.nonzero(is_near)
        return k, p

    def _measure(self, axes: Array, group: _Group, at: tuple[Indices, Indices], found: Gaps) -> None:
        """Write the gaps of some groups of states and pairs, each at its smallest."""
        k, p = at
        pairs = self.pairs[group.part]
        capsules = group.capsules[p]
        own = axes[k[:, None], np.arange(axes.shape[1]), capsules[:, None]]
        solids = group.solids
        radius = np.zeros(len(k))
        if group.floor is not None:
            is_checked = np.array([[end in pair.ends for end in (0, 1)] for pair in pairs])[p][:, None]
            low = np.argmin(np.where(is_checked, own[..., 2], np.inf), axis=-1)[..., None, None]
            nearest = np.take_along_axis(own, low, axis=-2)[..., 0, :]
            on_axis = nearest.copy()
            nearest[..., 2] = group.floor.height
            # Gaps of axes are not negative: an axis below the floor counts as on it.
            on_axis[..., 2] = np.maximum(on_axis[..., 2], group.floor.height)
        elif solids is not None and solids.are_boxes:
            on_axis, nearest = nearest_on_box(own, solids.placements[p][:, None], solids.half_sizes[p][:, None])
        elif solids is not None:
            radius = solids.radii[p]
            on_axis, nearest = nearest_points(own, solids.axes[p][:, None])
        # The states that decide which plane is kept best.
        ends = own[:, [0, -1]] if group.floor is None else on_axis[:, [0, -1], None]
        _keep(found, (k, p + group.part.start), (nearest, radius), (on_axis, self.radii[capsules]), ends)

    def _measure_links(self, frames: Array, axes: Array, group: _Group, found: Gaps) -> None:
        """Write the gaps between links in groups of states; frames are those of links, shape (K, S, n+1, 4, 4)."""
        K, S = axes.shape[:2]
        firsts, seconds = group.capsules, group.others
        frame = frames[:, :, [self.capsules[i].link for i in firsts]]

        def in_frame(which: Indices) -> Array:
            """Return axes in the frames of the first capsules, shape (K P, S, 2, 3), m."""
            away = axes[:, :, which] - frame[..., None, :3, 3]
            return np.moveaxis(away @ frame[..., :3, :3], 1, 2).reshape(-1, S, 2, 3)

        own, other = in_frame(firsts), in_frame(seconds)
        nearest, on_other = nearest_points(own, other)
        k, p = np.indices((K, len(firsts))).reshape(2, -1)
        touched = (nearest, self.radii[firsts[p]])
        beyond = (on_other, self.radii[seconds[p]])
        _keep(found, (k, p + group.part.start), touched, beyond, other[:, [0, -1]])


def _keep(
    found: Gaps,
    here: tuple[Indices, Indices],
    touched: tuple[Array, Array],
    other: tuple[Array, Array],
    ends: Array,
) -> None:
    """Write gaps, each at its smallest, and the planes that are kept best.

    Parameters
    ----------
    found
        Where they are written.
    here
        Groups of states and pairs, shape (m,) each.
    touched, other
        Nearest points of the axes, shape (m, S, 3), and radii, shape (m,), of the body that the plane touches and of
        the other one; m.
    ends
        Points of the other body at the first and the last state, shape (m, 2, e, 3), m.
    """
    (nearest, radius) = touched
    (on_axis, own_radius) = other
    along = on_axis - nearest
    length = np.sqrt(np.sum(along * along, axis=-1))
    normal = along / np.maximum(length, ZERO)[..., None]
    normal[length < ZERO] = UP
    level = np.sum(normal * nearest, axis=-1) + radius[:, None]
    gap = length - own_radius[:, None] - radius[:, None]
    # How far the first and the last state are on their side of each state's plane, shape (m, S).
    beyond = np.einsum("msi,mkei->mske", normal, ends).min(axis=(2, 3)) - own_radius[:, None]
    which = np.arange(len(gap)), np.argmax(beyond - level, axis=1)
    found.gap[here] = gap.min(axis=1)
    found.normal[here], found.level[here] = normal[which], level[which]


@dataclass(frozen=True, eq=False)
class _Group:
    """Pairs of one kind: with boxes, with other solids, with the floor, or between links."""

    part: slice
    """Their indices."""
    capsules: Indices
    """Of each pair, shape (P,)."""
    others: Indices
    """The other capsule of each pair of links, shape (P,); -1 of other pairs."""
    solids: Solids | None
    """Of each pair."""
    floor: Floor | None

    @property
    def is_of_links(self) -> bool:
        """Whether its pairs are links."""
        return self.solids is None and self.floor is None


def _needed_planes(
    solids: Solids, which: NDArray[np.int_], normal: Array, level: Array, required: Array
) -> NDArray[np.bool_]:
    """Return which planes between a link and solids are needed, shape (P,).

    Parameters
    ----------
    which
        Indices of the solids, the nearest first, shape (P,).
    normal, level
        Their planes: normals towards the link, shape (P, 3), and positions along them, shape (P,), m.
    required
        Distances of the link from each plane, shape (P,), m.
    """
    # Entry (i, j): whether solid j, with the distance required from it, is behind what the link keeps from plane i.
    shields = solids.reach(which, normal) + required <= (level + required)[:, None] + BEHIND_TOLERANCE
    needed, is_shielded = np.zeros((2, len(which)), dtype=bool)
    for i in range(len(which)):
        if not is_shielded[i]:
            needed[i] = True
            is_shielded |= shields[i]
    return needed
