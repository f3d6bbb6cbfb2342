"""Workspace of an arm by sampling: joint values inside the limits, the points reached, and manipulability there.

Samples are worked on in chunks, by this process or by others: see :class:`Distribute`. Results of chunks have a fixed
size and are merged by minima, maxima and integer sums. These are exact, so that no digit depends on the order of
merging, or on the process that computed a chunk.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Convention, Description, takes_robot, world_to_tool
from dhkit.display import counted, html_block, html_lines, html_table, listed, repr_line
from dhkit.kinematics.forward import forward_kinematics, tool_kernel
from dhkit.kinematics.jacobian import jacobian_kernel
from dhkit.kinematics.manipulability import freedoms, manipulability

_STATES_FOR_REACH = 5_000
Progress: TypeAlias = Callable[[int, int], None]
"""Called with how many samples are done and how many there will be."""

CHUNK = 65_536
"""Samples worked on at once: their Jacobians take about 20 MB."""
KEPT_CHUNKS = 64
"""Chunks, the first ones, whose positions a workspace holds: 4,194,304 samples of 32 bytes."""
_RUNS = 64
"""Runs of chunks of one process: each ends in a merge, which for the largest grid takes as long as 100,000 samples."""
PER_CELL = 20
"""Samples for each cell of the box around them: fewer leave holes in the reachable set."""
_FINEST = 256
"""Cells along the longest edge at most."""
_MOST_CELLS = 1 << 24
"""Cells of a grid at most: their counts and manipulabilities take 256 MB."""
_FLAT = 1e-9
"""Points that leave a plane, a line or a point by less than this share of the arm's size lie in it."""
_MAX_PIXELS = 160
"""Most pixels along the longer side of a flat map."""
_SAMPLES_PER_PIXEL = 12
"""Samples for each pixel of the box around them: with fewer, the largest value in a pixel is noise."""
PIXEL_MARGIN = 2
"""Pixels that are left free at the edges of a flat map."""

# A histogram of manipulability has equal bins in each octave [2^e, 2^(e+1)): the leading bits of a double.
_MANTISSA_BITS = 12
"""Bits of the mantissa that tell bins apart: a bin is 1 part in 4,096 wide."""
_OCTAVES = (-40, 24)
"""Exponents of the first octave and after the last one; values outside are counted in the first or the last bin."""
_BINS = (_OCTAVES[1] - _OCTAVES[0]) << _MANTISSA_BITS
_FIRST_BIN = (1023 + _OCTAVES[0]) << _MANTISSA_BITS
"""Leading bits of the smallest double of the first octave."""
_DROPPED_BITS = 52 - _MANTISSA_BITS


Result = TypeVar("Result")


class Distribute(Protocol):
    """Has a function of runs of chunks computed, by whatever processes.

    It divides the chunks into runs as it likes, and yields each run with its result, in any order. The function and its
    results can be pickled.
    """

    def __call__(
        self, function: Callable[[range], Result], chunks: range
    ) -> Iterator[tuple[range, Result]]:
        """Yield runs of chunks with their results."""
        ...


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
    manipulability: Array
    """Largest translational manipulability in each cell, d axes; NaN in cells without points."""

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


@dataclass(frozen=True, eq=False)
class Projection:
    """A flat view of points: two coordinates in a frame, or the distance from the frame's z axis and the height."""

    origin: Array
    """Shape (3,), m, world."""
    axes: Array
    """Unit vectors of the two coordinates, shape (2, 3); of x, y and z for a section, shape (3, 3)."""

    def __call__(self, points: Array) -> Array:
        """Return the places in the view, shape (..., 2), m, of points in the world, shape (..., 3), m."""
        local = _along(self.axes, points - self.origin)
        if not self.is_section:
            return local
        return _columns([_length(local[..., :2]), local[..., 2]])

    @property
    def is_section(self) -> bool:
        """Whether a point is seen at its distance from the z axis, so that all turns about it are one."""
        return len(self.axes) == 3

    def __repr__(self) -> str:
        return repr_line("Projection", summary="section" if self.is_section else "along an axis")


@dataclass(frozen=True, eq=False)
class FlatMap:
    """Largest manipulability in the pixels of a flat view."""

    projection: Projection
    corner: Array
    """Corner of pixel (0, 0), shape (2,), m."""
    edge: float
    """Edge of a pixel, m."""
    manipulability: Array
    """Largest translational manipulability in each pixel, shape (nx, ny); NaN in pixels without points."""

    def __repr__(self) -> str:
        pixels = " x ".join(map(str, self.manipulability.shape))
        return repr_line("FlatMap", summary=f"{pixels} pixels of {self.edge:.3g} m")


@dataclass(frozen=True, eq=False, repr=False)
class Workspace:
    """Positions that random joint values reach; equal arguments of :func:`workspace` give equal arrays."""

    description: Description
    """The arm."""
    samples: int
    """Number of samples N."""
    seed: int
    """Seed of the random joint values."""
    lower: Array
    """Lower ends of the ranges in which joint values were sampled, shape (n,), rad and m."""
    upper: Array
    """Upper ends of the ranges in which joint values were sampled, shape (n,), rad and m."""
    assumed: tuple[str, ...]
    """Assumptions about ranges that the description does not give."""
    positions: Array
    """The tool's origin, shape (K, 3), m, world, in the first K samples: all, or 4,194,304 of more."""
    manipulability: Array
    """Translational manipulability there, shape (K,); see :func:`dhkit.kinematics.manipulability.manipulability`."""
    bounds: Array
    """The corners of the box around all positions, shape (2, 3), m, world."""
    distances: tuple[float, float]
    """The least and the largest distance of the tool from frame 0's origin, m."""
    radii: tuple[float, float]
    """The least and the largest distance of the tool from the first joint's axis, m."""
    best: Array
    """The joint values with the largest manipulability, shape (n,), rad and m."""
    largest_manipulability: float
    """The largest translational manipulability of all samples."""
    histogram: NDArray[np.int64]
    """Number of samples by manipulability, in bins 1 part in 4,096 wide: see :meth:`quantile`."""
    freedoms: int
    """Number of directions in which the tool can move: 3, or 2, 1, 0 if it keeps to a surface, a curve or a point."""
    grid: Grid | None
    """Grid of space, or of the plane or line that the tool keeps to; None for a point."""
    maps: tuple[FlatMap, ...]
    """Flat maps of manipulability: one in the plane that the tool keeps to, or two of space: a section through the
    first joint's axis and a view along it, or views along y and z if the first joint is prismatic."""

    def __repr__(self) -> str:
        estimate = "" if self.estimate is None else f", {self.estimate}"
        return repr_line(
            "Workspace", self.description.name, f"{counted(self.samples, 'sample')}{estimate}"
        )

    def _repr_html_(self) -> str:
        place = world_to_tool(self.description, self.best)[:3, 3]
        facts = [
            ("samples", f"{self.samples}, seed {self.seed}"),
            ("distance from axis 1", _range(self.radii)),
            ("distance from frame 0", _range(self.distances)),
            *(
                (f"{axis}, world", _range((low, high)))
                for axis, low, high in zip("xyz", *self.bounds, strict=True)
            ),
            (
                "largest manipulability",
                f"{self.largest_manipulability:.4g} at {listed(place)} m",
            ),
        ]
        size = ("length", "area", "volume")[
            (self.grid.counts.ndim if self.grid is not None else 3) - 1
        ]
        facts += [] if self.estimate is None else [(size, str(self.estimate))]
        return html_block(
            f"Workspace of {self.description.name}", html_table((), facts), html_lines(self.assumed)
        )

    def quantile(self, share: float) -> float:
        """Return the manipulability that a share of the samples does not exceed, to 1 part in 8,192.

        Parameters
        ----------
        share
            From 0 to 1.

        Returns
        -------
        float
            A value of the histogram: the middle of a bin; 0 below 2^-40.

        Examples
        --------
        >>> from dhkit.description import library_robot
        >>> space = workspace(library_robot("planar2r"))
        >>> round(space.quantile(0.5), 2)
        0.15
        """
        # The sample of rank r = ceil(share N), from 1, lies in the first bin up to which r samples are counted.
        rank = max(1, int(np.ceil(share * self.samples)))
        bin = int(np.searchsorted(np.cumsum(self.histogram), rank))
        if bin == 0:
            return 0.0

        ends = (np.arange(bin, bin + 2) + _FIRST_BIN) << _DROPPED_BITS
        middle = float(ends.view(np.float64).mean())
        return min(middle, self.largest_manipulability)

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
    return float(_radii(description, world_to_tool(description, q)[:, :3, 3]).max())


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
        How many. The first 4,194,304 positions are kept, in 32 bytes each; the rest takes at most 1 GB in all.
    seed
        Of the random joint values.
    edge
        Edge of the grid's cells, m; by default as small as the number of samples bears.
    threads
        How many threads share the kinematics.
    progress
        Called now and then, with the finished part of the work in samples; an exception in it ends the work.

    Returns
    -------
    Workspace
        Positions and manipulability, the occupied grid, flat maps, and estimates of size.

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
    return distributed_workspace(
        description,
        samples,
        seed,
        edge=edge,
        threads=threads,
        progress=progress,
        distribute=_in_this_process,
    )


def distributed_workspace(
    description: Description,
    samples: int,
    seed: int,
    *,
    edge: float | None,
    threads: int,
    progress: Progress | None,
    distribute: Distribute,
) -> Workspace:
    """Return the workspace that :func:`workspace` returns, with its chunks computed by any processes.

    Parameters
    ----------
    description, samples, seed, edge, threads, progress
        As for :func:`workspace`.
    distribute
        Has the chunks computed.

    Returns
    -------
    Workspace
        The same digits for every ``distribute``, on processors with the same vector instructions.

    Raises
    ------
    ValueError
        As :func:`workspace`.
    """
    if samples < 1:
        raise ValueError(f"samples is {samples}; expected 1 or more")
    if edge is not None and not (np.isfinite(edge) and edge > 0):
        raise ValueError(f"edge is {edge} m; expected a positive length")
    lower, upper, assumed = _ranges(description)
    states = _States(description, samples, seed, lower, upper)

    def report(measured: int, counted: int) -> None:
        if progress is not None:
            # The second pass takes about three times as long as the first.
            progress((measured + 3 * counted) // 4, samples)

    # First pass: how far the positions extend in all coordinates, so that cells can be laid around them.
    coordinates = _Coordinates.of(description, states.positions(0, threads))
    extent = _Extent.empty(coordinates.count)
    done = 0
    for run, extent_of_run in distribute(_Measure(states, coordinates, threads), states.chunks):
        extent = extent.merged(extent_of_run)
        done += states.count(run)
        report(done, 0)
    measured = coordinates.measured(extent)
    cells = _grid_cells(measured.along_grid, samples, edge)
    pixels = tuple(_pixels(description, part, samples) for part in measured.in_views)

    # Second pass: which cells they fall into, and how well the tool moves there.
    tally = _Tally.empty(cells, pixels)
    done = 0
    count = _Count(states, coordinates, cells, pixels, threads)
    for run, tally_of_run in distribute(count, states.chunks):
        tally.merge(tally_of_run)
        done += states.count(run)
        report(samples, done)

    kept = [tally.kept[k] for k in sorted(tally.kept)]
    bounds = np.stack([measured.world.low, measured.world.high])
    maps = tuple(
        FlatMap(view, lattice.corner, lattice.edge, _shaped(best, lattice.shape))
        for view, lattice, best in zip(coordinates.views, pixels, tally.pixels, strict=True)
    )
    return Workspace(
        description=description,
        samples=samples,
        seed=seed,
        lower=lower,
        upper=upper,
        assumed=assumed,
        positions=np.concatenate([positions for positions, _ in kept]),
        manipulability=np.concatenate([measures for _, measures in kept]),
        bounds=bounds,
        distances=measured.distance.ends,
        radii=measured.radius.ends,
        best=states.joint_values(tally.best.sample),
        largest_manipulability=tally.best.manipulability,
        histogram=tally.histogram,
        freedoms=freedoms(description),
        grid=_grid(coordinates, cells, tally),
        maps=maps,
    )


@dataclass(frozen=True, eq=False)
class _States:
    """Random joint values, uniform between two ends. Chunk k has samples k CHUNK to (k + 1) CHUNK - 1."""

    description: Description
    samples: int
    seed: int
    lower: Array
    upper: Array

    @property
    def chunks(self) -> range:
        return range(-(-self.samples // CHUNK))

    def count(self, run: range) -> int:
        """Return the number of samples in a run of chunks; the last chunk may be smaller."""
        return min(run.stop * CHUNK, self.samples) - run.start * CHUNK

    def joint_values(self, first: int, count: int | None = None) -> Array:
        """Return the joint values of samples, shape (count, n), or of one, shape (n,), rad and m."""
        # A double takes one output of PCG64, which can jump: whoever computes a chunk gets the same numbers.
        n = self.description.n
        generator = np.random.PCG64(self.seed)
        generator.advance(first * n)
        shape = (n,) if count is None else (count, n)
        q = np.random.Generator(generator).random(shape)
        q *= self.upper - self.lower
        q += self.lower
        return q

    def chunk(self, k: int) -> Array:
        """Return the joint values of a chunk, shape (count, n), rad and m."""
        return self.joint_values(k * CHUNK, self.count(range(k, k + 1)))

    def positions(self, k: int, threads: int) -> Array:
        """Return the tool's origins of a chunk, shape (count, 3), m, world; each coordinate is contiguous."""
        self.compile()
        T = forward_kinematics(self.description, self.chunk(k), threads=threads)
        return np.ascontiguousarray(T[:, :3, 3].T).T

    def compile(self) -> None:
        """Compile the kernels if there is a whole chunk: compiled and interpreted code may round otherwise."""
        if self.samples >= CHUNK:
            tool_kernel(self.description)[0].compile()
            jacobian_kernel(self.description, "world")[0].compile()


@dataclass(frozen=True, eq=False)
class _Extent:
    """Least and largest value of each of k coordinates."""

    low: Array
    """Shape (k,)."""
    high: Array
    """Shape (k,)."""

    @classmethod
    def empty(cls, count: int) -> _Extent:
        return cls(np.full(count, np.inf), np.full(count, -np.inf))

    @classmethod
    def of(cls, values: Array) -> _Extent:
        """Return the extent of values, shape (k, N)."""
        return cls(values.min(axis=1), values.max(axis=1))

    def merged(self, other: _Extent) -> _Extent:
        return _Extent(np.minimum(self.low, other.low), np.maximum(self.high, other.high))

    def part(self, rows: slice) -> _Extent:
        return _Extent(self.low[rows], self.high[rows])

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the largest value of a single coordinate."""
        return float(self.low[0]), float(self.high[0])


@dataclass(frozen=True, eq=False)
class _Measured:
    """Extents of the positions in all coordinates, m."""

    world: _Extent
    """Of x, y and z."""
    along_grid: _Extent
    """Along the grid's d axes."""
    in_views: tuple[_Extent, ...]
    """Of the two coordinates of each flat view."""
    distance: _Extent
    """From frame 0's origin."""
    radius: _Extent
    """From the first joint's axis."""


@dataclass(frozen=True, eq=False)
class _Coordinates:
    """Coordinates in which the positions of an arm's tool are measured, m."""

    description: Description
    axes: Array
    """Axes of the space, plane, line or point that the tool keeps to, shape (d, 3)."""
    point: Array
    """A point of it, shape (3,), m, world."""
    views: tuple[Projection, ...]

    @classmethod
    def of(cls, description: Description, positions: Array) -> _Coordinates:
        """Return the coordinates for an arm, of which some positions are given.

        An arm whose tool leaves a plane or a line does so in almost all states: a few tell where it keeps to.
        """
        flat = _FLAT * max(description.reach, float(np.abs(positions).max()))
        axes = _hull_axes(positions, flat)
        return cls(description, axes, positions.mean(axis=0), _views(description, axes))

    @property
    def count(self) -> int:
        """Number of rows of :meth:`values`."""
        return 3 + len(self.axes) + 2 * len(self.views) + 2

    def values(self, positions: Array) -> Array:
        """Return all coordinates of positions (N, 3), shape (count, N): see :meth:`measured`."""
        origin = self.description.numbers.T_world_base[:3, 3]
        rows = [
            positions.T,
            _along(self.axes, positions).T,
            *(view(positions).T for view in self.views),
            _length(positions - origin)[None],
            _radii(self.description, positions)[None],
        ]
        return np.concatenate(rows)

    def measured(self, extent: _Extent) -> _Measured:
        """Return an extent of all coordinates by their names."""
        d = len(self.axes)
        ends = 3 + d + 2 * len(self.views)
        return _Measured(
            world=extent.part(slice(0, 3)),
            along_grid=extent.part(slice(3, 3 + d)),
            in_views=tuple(extent.part(slice(k, k + 2)) for k in range(3 + d, ends, 2)),
            distance=extent.part(slice(ends, ends + 1)),
            radius=extent.part(slice(ends + 1, ends + 2)),
        )


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Equal cells in d dimensions."""

    corner: Array
    """Corner of cell (0, ...), shape (d,), m."""
    edge: float
    """A cell's edge, m."""
    shape: tuple[int, ...]
    """Number of cells along each axis."""

    @property
    def size(self) -> int:
        return int(np.prod(self.shape))

    def cells(self, places: Array) -> NDArray[np.intp]:
        """Return the number of the cell that each place, shape (N, d), is in, shape (N,), the last axis fastest."""
        number = np.zeros(len(places), dtype=np.intp)
        for axis, size in enumerate(self.shape):
            index = ((places[:, axis] - self.corner[axis]) / self.edge).astype(np.intp)
            # By rounding a place at the border may lie outside.
            number = number * size + np.clip(index, 0, size - 1)
        return number


@dataclass(frozen=True, eq=False)
class _Best:
    """The sample with the largest manipulability; the first of equal ones."""

    manipulability: float
    sample: int

    def better(self, other: _Best) -> _Best:
        return max(self, other, key=lambda one: (one.manipulability, -one.sample))


@dataclass(eq=False)
class _Tally:
    """Samples in cells, pixels and bins: counts and largest manipulabilities, -inf where no sample is."""

    counts: NDArray[np.int64]
    """Samples in each cell of the grid, shape (cells,)."""
    cells: Array
    """Largest manipulability in each cell of the grid, shape (cells,)."""
    pixels: tuple[Array, ...]
    """Largest manipulability in each pixel of each flat view, shape (pixels,)."""
    histogram: NDArray[np.int64]
    """Samples in each bin of manipulability, shape (bins,)."""
    best: _Best = _Best(-np.inf, 0)
    kept: dict[int, tuple[Array, Array]] = field(default_factory=dict)
    """Positions (count, 3), m, and manipulabilities (count,) of chunks that are kept, by the chunk's number."""

    @classmethod
    def empty(cls, cells: _Lattice, pixels: tuple[_Lattice, ...]) -> _Tally:
        return cls(
            counts=np.zeros(cells.size, dtype=np.int64),
            cells=np.full(cells.size, -np.inf),
            pixels=tuple(np.full(lattice.size, -np.inf) for lattice in pixels),
            histogram=np.zeros(_BINS, dtype=np.int64),
        )

    def merge(self, other: _Tally) -> None:
        """Add another tally to this one."""
        self.counts += other.counts
        np.maximum(self.cells, other.cells, out=self.cells)
        for mine, others in zip(self.pixels, other.pixels, strict=True):
            np.maximum(mine, others, out=mine)
        self.histogram += other.histogram
        self.best = self.best.better(other.best)
        self.kept.update(other.kept)


@dataclass(frozen=True, eq=False)
class _Measure:
    """First pass over a run of chunks: the extent of the positions in all coordinates."""

    states: _States
    coordinates: _Coordinates
    threads: int

    def __call__(self, run: range) -> _Extent:
        extent = _Extent.empty(self.coordinates.count)
        for k in run:
            positions = self.states.positions(k, self.threads)
            extent = extent.merged(_Extent.of(self.coordinates.values(positions)))
        return extent


@dataclass(frozen=True, eq=False)
class _Count:
    """Second pass over a run of chunks: the cells, pixels and bins that the samples fall into."""

    states: _States
    coordinates: _Coordinates
    cells: _Lattice
    pixels: tuple[_Lattice, ...]
    threads: int

    def __call__(self, run: range) -> _Tally:
        tally = _Tally.empty(self.cells, self.pixels)
        for k in run:
            positions = self.states.positions(k, self.threads)
            measures = manipulability(self.states.description, self.states.chunk(k))

            cells = self.cells.cells(_along(self.coordinates.axes, positions))
            np.add.at(tally.counts, cells, 1)
            np.maximum.at(tally.cells, cells, measures)
            for view, lattice, best in zip(
                self.coordinates.views, self.pixels, tally.pixels, strict=True
            ):
                np.maximum.at(best, lattice.cells(view(positions)), measures)
            tally.histogram += np.bincount(_bins(measures), minlength=_BINS)

            top = int(np.argmax(measures))
            tally.best = tally.best.better(_Best(float(measures[top]), k * CHUNK + top))
            if k < KEPT_CHUNKS:
                tally.kept[k] = positions.copy(order="C"), measures
        return tally


def _in_this_process(
    function: Callable[[range], Result], chunks: range
) -> Iterator[tuple[range, Result]]:
    """Yield runs of chunks with their results, computed one after the other: see :class:`Distribute`."""
    size = -(-len(chunks) // _RUNS)
    for begin in range(0, len(chunks), size):
        run = chunks[begin : begin + size]
        yield run, function(run)


def _bins(measures: Array) -> NDArray[np.int64]:
    """Return the bin of the histogram for each manipulability, shape (N,)."""
    # Doubles from 0 on are ordered like their bits read as integers.
    leading = np.ascontiguousarray(measures).view(np.int64) >> _DROPPED_BITS
    return np.asarray(np.clip(leading - _FIRST_BIN, 0, _BINS - 1))


def _grid_cells(extent: _Extent, samples: int, edge: float | None) -> _Lattice:
    """Return the cells of the grid for the extent along its d axes; a single one for a point."""
    spans = extent.high - extent.low
    if not len(spans):
        return _Lattice(np.zeros(0), 1.0, ())
    edge = _fitting_edge(spans, samples) if edge is None else float(edge)
    wanted = [float(span / edge) for span in spans]
    if np.prod(np.ceil(wanted)) > _MOST_CELLS:
        least = float(np.prod(spans) / _MOST_CELLS) ** (1 / len(spans))
        raise ValueError(
            f"edge {edge:g} m makes more than {_MOST_CELLS} cells; expected about {least:.2g} m or more"
        )
    # A span that is a whole number of edges but for rounding does not get another cell.
    shape = tuple(max(1, int(np.ceil(cells * (1 - 1e-12)))) for cells in wanted)
    # The box's middle is the grid's, so that no border cell is a sliver by rounding.
    corner = extent.low + spans / 2 - edge * np.array(shape) / 2
    return _Lattice(corner, edge, shape)


def _pixels(description: Description, extent: _Extent, samples: int) -> _Lattice:
    """Return the pixels of a flat view for the extent of its two coordinates, with a free margin."""
    spans = extent.high - extent.low
    longest = float(spans.max()) or description.reach or 1.0
    count = float(np.clip(np.sqrt(samples / _SAMPLES_PER_PIXEL), 8, _MAX_PIXELS))
    edge = longest / count
    shape = np.ceil(spans / edge).astype(int) + 2 * PIXEL_MARGIN
    corner = (extent.low + extent.high - edge * shape) / 2
    return _Lattice(corner, edge, tuple(shape.tolist()))


def _grid(coordinates: _Coordinates, cells: _Lattice, tally: _Tally) -> Grid | None:
    """Return the grid with its counts; None for a point."""
    axes = coordinates.axes
    if not len(axes):
        return None
    # With the axes as rows of A, the corner c in the grid and a point m of the plane: A^T c + (1 - A^T A) m, where the
    # second term is the grid's offset across its own axes.
    point = coordinates.point
    origin = cells.corner @ axes + point - (point @ axes.T) @ axes
    counts = tally.counts.reshape(cells.shape)
    return Grid(origin, axes, cells.edge, counts, _shaped(tally.cells, cells.shape))


def _shaped(best: Array, shape: tuple[int, ...]) -> Array:
    """Return largest values by cell, of some shape, NaN in cells without samples."""
    best[np.isneginf(best)] = np.nan
    return best.reshape(shape)


def _views(description: Description, axes: Array) -> tuple[Projection, ...]:
    """Return the flat views of positions that keep to a space, plane, line or point with given axes (d, 3)."""
    if len(axes) == 2:
        return (Projection(np.zeros(3), axes),)
    x, y, z = np.eye(3)
    if not description.joints[0].is_revolute:
        from_the_side = Projection(np.zeros(3), np.stack([x, z]))
        from_above = Projection(np.zeros(3), np.stack([x, y]))
        return from_the_side, from_above
    T = first_axis(description)
    section = Projection(T[:3, 3], T[:3, :3].T)
    along_axis = Projection(T[:3, 3], T[:3, :2].T)
    return section, along_axis


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


def _along(axes: Array, points: Array) -> Array:
    """Return the coordinates of points (..., 3) along axes (d, 3), shape (..., d)."""
    # Without BLAS, whose rounding may depend on its number of threads.
    x, y, z = np.moveaxis(points, -1, 0)
    if not len(axes):
        return np.empty((*x.shape, 0))
    return _columns([a_x * x + a_y * y + a_z * z for a_x, a_y, a_z in axes])


def _columns(coordinates: Sequence[Array]) -> Array:
    """Return d coordinates, shape (...) each, as an array (..., d) in which each of them is contiguous."""
    return np.moveaxis(np.stack(coordinates), 0, -1)


def _length(vectors: Array) -> Array:
    """Return the lengths of vectors, shape (..., d), as an array (...)."""
    first, *others = np.moveaxis(vectors, -1, 0)
    total = first * first
    for x in others:
        total += x * x
    return np.asarray(np.sqrt(total))


def _radii(description: Description, positions: Array) -> Array:
    """Return the distance of positions, shape (N, 3), from the first joint's axis, shape (N,), m."""
    T = first_axis(description)
    return _length(_along(T[:3, :2].T, positions - T[:3, 3]))


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:.4g} to {ends[1]:.4g} m"
