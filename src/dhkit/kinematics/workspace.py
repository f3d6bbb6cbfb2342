"""Workspace of an arm by sampling: joint values inside the limits, the points reached, and manipulability there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Convention, Description, takes_robot, world_to_tool
from dhkit.display import counted, html_block, html_lines, html_table, listed, repr_line
from dhkit.kinematics.forward import forward_kinematics
from dhkit.kinematics.manipulability import freedoms, manipulability

_STATES_FOR_REACH = 5_000
Progress: TypeAlias = Callable[[int, int], None]
"""Called with how many samples are done and how many there will be."""

CHUNK = 65_536
"""Samples worked on at once: their Jacobians take about 20 MB."""
PER_CELL = 20
"""Samples for each cell of the box around them: fewer leave holes in the reachable set."""
_FINEST = 256
"""Cells along the longest edge at most."""
_MOST_CELLS = 1 << 24
"""Cells of a grid at most: their counts take 128 MB."""
_FLAT = 1e-9
"""Points that leave a plane, a line or a point by less than this share of the arm's size lie in it."""


@dataclass(frozen=True)
class Estimate:
    """The size of a set of points as a grid sees it: the cells reached, those at its border counted by half."""

    value: float
    """m, m^2 or m^3."""
    margin: float
    """Half the size of the border's cells, in the same unit; what too few samples miss is not in it."""
    dimension: int
    """1: a length, 2: an area, 3: a volume."""

    def __str__(self) -> str:
        unit = ("m", "m²", "m³")[self.dimension - 1]
        digits = max(0, -int(np.floor(np.log10(self.margin)))) if self.margin > 0 else 3
        return f"{self.value:.{digits}f} ± {self.margin:.{digits}f} {unit}"

    def __repr__(self) -> str:
        return repr_line("Estimate", summary=str(self))


@dataclass(frozen=True, eq=False)
class Grid:
    """Number of points in each cell of a grid of cubes, squares or pieces of a line."""

    origin: Array
    """Corner of cell (0, ...), shape (3,), m, world."""
    axes: Array
    """Unit vectors along the grid's d edges, shape (d, 3): x, y and z in space."""
    edge: float
    """A cell's edge, m."""
    counts: NDArray[np.int64]
    """Points in each cell, d axes."""

    @property
    def estimate(self) -> Estimate:
        """Measure of the set of points: length, area or volume, with its uncertainty.

        It lies between the cells with a point (outer) and those of them that have only such neighbours, diagonal ones
        included (inner). A smooth border halves, on average, the cells that it goes through.
        """
        reached = self.counts > 0
        outer = np.count_nonzero(reached)
        inner = np.count_nonzero(_without_border(reached))
        cell = self.edge**self.counts.ndim
        return Estimate(cell * (outer + inner) / 2, cell * (outer - inner) / 2, self.counts.ndim)

    def __repr__(self) -> str:
        cells = " x ".join(map(str, self.counts.shape))
        summary = f"{cells} of {self.edge:.3g} m, {np.count_nonzero(self.counts)} with points"
        return repr_line("Grid", counted(self.counts.size, "cell"), summary)


@dataclass(frozen=True, eq=False, repr=False)
class Workspace:
    """Positions that random joint values reach; equal arguments of :func:`workspace` give equal arrays."""

    description: Description
    """The arm."""
    seed: int
    """Seed of the random joint values."""
    lower: Array
    """Lower ends of the ranges in which joint values were sampled, shape (n,), rad and m."""
    upper: Array
    """Upper ends of the ranges in which joint values were sampled, shape (n,), rad and m."""
    assumed: tuple[str, ...]
    """Assumptions about ranges that the description does not give."""
    positions: Array
    """The tool's origin, shape (N, 3), m, world."""
    manipulability: Array
    """Translational manipulability there, shape (N,); see :func:`dhkit.kinematics.manipulability.manipulability`."""
    best: Array
    """The joint values with the largest manipulability, shape (n,), rad and m."""
    freedoms: int
    """Number of directions in which the tool can move: 3, or 2, 1, 0 if it keeps to a surface, a curve or a point."""
    grid: Grid | None
    """Grid of space, or of the plane or line that the tool keeps to; None for a point."""

    def __repr__(self) -> str:
        estimate = "" if self.estimate is None else f", {self.estimate}"
        return repr_line(
            "Workspace", self.description.name, f"{counted(self.samples, 'sample')}{estimate}"
        )

    def _repr_html_(self) -> str:
        box = self.bounds
        best = int(np.argmax(self.manipulability))
        facts = [
            ("samples", f"{self.samples}, seed {self.seed}"),
            ("distance from axis 1", _range(self.radii)),
            ("distance from frame 0", _range(self.distances)),
            *(
                (f"{axis}, world", _range((low, high)))
                for axis, low, high in zip("xyz", *box, strict=True)
            ),
            (
                "largest manipulability",
                f"{self.manipulability[best]:.4g} at {listed(self.positions[best])} m",
            ),
        ]
        size = ("length", "area", "volume")[
            (self.grid.counts.ndim if self.grid is not None else 3) - 1
        ]
        facts += [] if self.estimate is None else [(size, str(self.estimate))]
        return html_block(
            f"Workspace of {self.description.name}", html_table((), facts), html_lines(self.assumed)
        )

    @property
    def samples(self) -> int:
        """The number of samples."""
        return len(self.positions)

    @property
    def bounds(self) -> Array:
        """The corners of the box around the positions, shape (2, 3), m, world."""
        return np.stack([self.positions.min(axis=0), self.positions.max(axis=0)])

    @property
    def distances(self) -> tuple[float, float]:
        """The least and the largest distance of the tool from frame 0's origin, m."""
        return _extremes(
            np.linalg.norm(self.positions - self.description.numbers.T_world_base[:3, 3], axis=1)
        )

    @property
    def radii(self) -> tuple[float, float]:
        """The least and the largest distance of the tool from the first joint's axis, m."""
        return _radii(self.description, self.positions)

    @property
    def estimate(self) -> Estimate | None:
        """The volume, area or length of the reached set; None for a curved surface, a curve or a point.

        It is an estimate by cells of edge ``grid.edge``: see :class:`Estimate`.
        """
        if self.grid is None or self.grid.counts.ndim > self.freedoms:
            return None
        return self.grid.estimate


@takes_robot
def tool_reach(description: Description) -> float:
    """Return the tool's greatest distance from the first joint's axis inside the limits, m, over 5,000 random states.

    ``description.reach`` is an upper bound of another distance: the sum of all lengths.

    Parameters
    ----------
    description
        The arm.

    Returns
    -------
    float
        m; the largest of the sampled distances, a lower bound of the exact one.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> round(tool_reach(library_robot("planar2r")), 3)
    0.9
    """
    lower, upper, _ = _ranges(description)
    q = lower + (upper - lower) * np.random.default_rng(0).random(
        (_STATES_FOR_REACH, description.n)
    )
    return _radii(description, world_to_tool(description, q)[:, :3, 3])[1]


@takes_robot
def workspace(
    description: Description,
    samples: int = 100_000,
    seed: int = 0,
    *,
    edge: float | None = None,
    threads: int = 1,
    progress: Progress | None = None,
) -> Workspace:
    """Sample where an arm's tool can be, with its manipulability there.

    Joint values are uniform inside the limits, and those of unlimited revolute joints over a full turn. An unlimited
    prismatic joint is given the arm's reach to both sides, and ``assumed`` says so. The first N of more samples are
    the N samples.

    Parameters
    ----------
    description
        The arm.
    samples
        How many, 32 bytes each.
    seed
        Of the random joint values.
    edge
        Edge of the grid's cells, m; by default as small as the number of samples bears.
    threads
        How many threads share the kinematics.
    progress
        Called now and then; an exception in it ends the work.

    Returns
    -------
    Workspace
        Positions and manipulability of all samples, the occupied grid, and estimates of size.

    Raises
    ------
    ValueError
        ``samples`` is below 1, or ``edge`` is not positive or makes too many cells.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> space = workspace(library_robot("planar2r"), samples=20_000)
    >>> space.positions.shape, space.estimate.dimension
    ((20000, 3), 2)
    """
    if samples < 1:
        raise ValueError(f"samples is {samples}; expected 1 or more")
    if edge is not None and not (np.isfinite(edge) and edge > 0):
        raise ValueError(f"edge is {edge} m; expected a positive length")
    lower, upper, assumed = _ranges(description)
    rng = np.random.default_rng(seed)
    positions = np.empty((samples, 3))
    measures = np.empty(samples)
    best = lower
    most = -np.inf
    for start in range(0, samples, CHUNK):
        chunk = slice(start, min(start + CHUNK, samples))
        q = lower + (upper - lower) * rng.random((chunk.stop - start, description.n))
        positions[chunk] = forward_kinematics(description, q, threads=threads)[:, :3, 3]
        measures[chunk] = manipulability(description, q)
        k = int(np.argmax(measures[chunk]))
        if measures[start + k] > most:
            best = q[k]
            most = measures[start + k]
        if progress is not None:
            progress(chunk.stop, samples)
    return Workspace(
        description=description,
        seed=seed,
        lower=lower,
        upper=upper,
        assumed=assumed,
        positions=positions,
        manipulability=measures,
        best=best,
        freedoms=freedoms(description),
        grid=occupancy(
            positions, edge, _FLAT * max(description.reach, float(np.abs(positions).max()))
        ),
    )


def occupancy(points: Array, edge: float | None = None, flat: float = 0.0) -> Grid | None:
    """Return a grid over points, shape (N, 3), m: of space, or of the plane or line that they lie in.

    Parameters
    ----------
    points
        Shape (N, 3), m, finite.
    edge
        A cell's edge, m; by default one that gives the box around the points :data:`PER_CELL` of them a cell.
    flat
        How far points may be from a plane, a line or a point that they lie in, m.

    Returns
    -------
    Grid or None
        None where all points are one.

    Raises
    ------
    ValueError
        ``edge`` makes more than 2^24 cells.
    """
    axes = _hull_axes(points, flat)
    if not len(axes):
        return None
    places = points @ axes.T
    low = places.min(axis=0)
    spans = np.ptp(places, axis=0)
    edge = _fitting_edge(spans, len(points)) if edge is None else float(edge)
    wanted = [float(span / edge) for span in spans]
    if np.prod(np.ceil(wanted)) > _MOST_CELLS:
        least = float(np.prod(spans) / _MOST_CELLS) ** (1 / len(spans))
        raise ValueError(
            f"edge {edge:g} m makes more than {_MOST_CELLS} cells; expected about {least:.2g} m or more"
        )
    # A span that is a whole number of edges but for rounding does not get another cell.
    shape = tuple(max(1, int(np.ceil(cells * (1 - 1e-12)))) for cells in wanted)
    # The box's middle is the grid's, so that no border cell is a sliver by rounding.
    corner = low + spans / 2 - edge * np.array(shape) / 2
    counts = np.zeros(shape, dtype=np.int64)
    for start in range(0, len(places), CHUNK):
        cells = ((places[start : start + CHUNK] - corner) / edge).astype(np.intp)
        np.add.at(counts, tuple(np.clip(cells, 0, np.array(shape) - 1).T), 1)

    # With the axes as rows of A, the corner c in the grid and the mean m of the points: A^T c + (1 - A^T A) m, where
    # the second term is the grid's offset across its own axes.
    mean = points.mean(axis=0)
    origin = corner @ axes + mean - (mean @ axes.T) @ axes
    return Grid(origin, axes, edge, counts)


def first_axis(description: Description) -> Array:
    """Return a frame whose z is the first joint's axis, with frame 0's height along it and x, shape (4, 4), world.

    It is frame 0 itself in the standard convention.
    """
    numbers = description.numbers
    if description.convention is Convention.STANDARD:
        return numbers.T_world_base
    a = numbers.a[0]
    c = numbers.cos_alpha[0]
    s = numbers.sin_alpha[0]

    # Tx(a_0) Rx(alpha_0)
    T: Array = numbers.T_world_base @ [[1, 0, 0, a], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]]
    return T


def _ranges(description: Description) -> tuple[Array, Array, tuple[str, ...]]:
    """Return the lower and upper ends of the ranges in which joints are sampled, and the assumptions in words."""
    numbers = description.numbers
    lower = numbers.lower.copy()
    upper = numbers.upper.copy()
    assumed = []
    for i in np.flatnonzero(~np.isfinite(lower) | ~np.isfinite(upper)):
        room = (description.reach or 1.0) if numbers.prismatic[i] else np.pi
        lower[i] = -room
        upper[i] = room
        if numbers.prismatic[i]:
            name = description.joints[i].name
            assumed.append(
                f"joint {i + 1} {name} has no limits: it was moved {room:.4g} m to both sides"
            )
    return lower, upper, tuple(assumed)


def _hull_axes(points: Array, flat: float) -> Array:
    """Return axes of the space, plane, line or point that points lie in, shape (d, 3): the world's where they do."""
    # Principal axes: eigenvectors of sum_k (x_k - mean)(x_k - mean)^T, the one of the largest eigenvalue first. They
    # replace the world's only where the points lie in an oblique plane or line.
    axes = np.eye(3)[np.ptp(points, axis=0) > flat]
    places = (points - points.mean(axis=0)) @ axes.T
    principal = np.linalg.eigh(places.T @ places)[1].T[::-1] @ axes
    thick = np.ptp(points @ principal.T, axis=0) > flat
    return np.asarray(axes if thick.all() else principal[thick])


def _fitting_edge(spans: Array, count: int) -> float:
    """Return the edge of cells of which a box has one for every so many points."""
    # Cells of edge e in d dimensions with PER_CELL points each: count / PER_CELL = prod(spans) / e^d.
    edge = float(np.prod(spans) * PER_CELL / count) ** (1 / len(spans))
    longest = float(spans.max())
    return float(np.clip(edge, longest / _FINEST, longest))


def _without_border(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells whose neighbours, diagonal ones included, are all marked; beyond the grid none is."""
    # The minimum over a cube of 3^d cells is that along one axis of those along the others.
    for axis in range(cells.ndim):
        width = [(int(axis == k), int(axis == k)) for k in range(cells.ndim)]
        padded = np.moveaxis(np.pad(cells, width), axis, 0)
        cells = np.moveaxis(padded[:-2] & padded[1:-1] & padded[2:], 0, axis)
    return cells


def _radii(description: Description, positions: Array) -> tuple[float, float]:
    """Return the least and the largest distance of positions from the first joint's axis, m."""
    T = first_axis(description)
    return _extremes(np.linalg.norm((positions - T[:3, 3]) @ T[:3, :2], axis=1))


def _extremes(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:.4g} to {ends[1]:.4g} m"
