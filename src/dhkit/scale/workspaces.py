"""Workspaces sampled by the workers of a cluster, and their maps as files of Zarr."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

import dhkit
from dhkit.arm import Arm
from dhkit.description.files import check_place, whole_folder
from dhkit.errors import DescriptionError
from dhkit.kinematics import Workspace
from dhkit.kinematics.workspace import Progress, distributed_workspace
from dhkit.scale.clusters import completed, dask_module, prepare

if TYPE_CHECKING:
    from dhkit.scale.clusters import Client


LEAST_TASKS = 64
"""Tasks into which a workspace is divided at least; of these a lost worker costs one or two."""
CHUNKS_PER_TASK = 2
"""Chunks in a task of a workspace at least: sending a task takes about a third of the time of a chunk."""
TASKS_PER_THREAD = 8
"""Tasks of a workspace for each thread of a large cluster, so that all threads end at about the same time."""

Result = TypeVar("Result")


def workspace(
    client: Client,
    arm: Arm,
    samples: int = 100_000,
    seed: int = 0,
    *,
    edge: float | None = None,
    progress: Progress | None = None,
) -> Workspace:
    """Sample where an arm's tool can be, by the workers of a cluster; see :meth:`dhkit.Arm.workspace`.

    All digits are those of one process, if the processors have the same vector instructions. A worker takes at most
    2 GB of memory, whatever the number of samples.

    Parameters
    ----------
    client
        A client of dask, as :func:`connected` yields it.
    arm
        The arm.
    samples
        How many.
    seed
        Of the random joint values.
    edge
        Edge of the grid's cells, m; by default as small as the number of samples bears.
    progress
        Called with how many samples are done and how many there will be; an exception in it ends the work.

    Returns
    -------
    Workspace
        Counts, extents and maps of all samples, and the positions of the first 4,194,304.

    Raises
    ------
    ValueError
        ``samples`` is below 1, or ``edge`` is not positive or makes too many cells.

    Examples
    --------
    >>> arm = Arm.load("planar2r")
    >>> with connected("local:2") as client:                               # doctest: +SKIP
    ...     space = workspace(client, arm, samples=1_000_000_000)
    """
    prepare(client)

    def distribute(
        function: Callable[[range], Result], chunks: range
    ) -> Iterator[tuple[range, Result]]:
        threads = sum(client.nthreads().values())
        tasks = max(LEAST_TASKS, TASKS_PER_THREAD * threads)
        size = max(CHUNKS_PER_TASK, -(-len(chunks) // tasks))
        runs = [chunks[begin : begin + size] for begin in range(0, len(chunks), size)]
        for number, result in completed(client, function, runs):
            yield runs[number], result

    return distributed_workspace(
        arm.description,
        samples,
        seed,
        edge=edge,
        threads=1,
        progress=progress,
        distribute=distribute,
    )


def save_workspace(space: Workspace, path: str | Path) -> Path:
    """Write the grid and the flat maps of a workspace as a Zarr group, whole or not at all.

    ``counts`` and ``manipulability`` have an entry for each cell; ``edges_0`` ... are the cells' ends along the rows of
    ``axes``, m, from ``origin``. ``map_0`` ... are flat maps. Attributes tell the robot, its digest, the seed, the
    number of samples and dhkit's version.

    Parameters
    ----------
    space
        A workspace; its tool must not keep to one point.
    path
        Folder to write. A workspace that is there is replaced, and nothing else.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    MissingPackageError
        The extra ``scale`` is not installed.
    DescriptionError
        The folder is there and not a workspace of dhkit, or cannot be made.
    ValueError
        The tool keeps to one point.

    Examples
    --------
    >>> space = Arm.load("planar2r").workspace(samples=5000)
    >>> save_workspace(space, "out/planar2r.zarr").name
    'planar2r.zarr'
    """
    zarr = dask_module("zarr")
    path = Path(path)
    check_zarr_place(path)
    grid = space.grid
    if grid is None:
        raise ValueError("the tool keeps to one point: it has no grid")
    with whole_folder(path) as folder:
        group = zarr.open_group(folder, mode="w")
        group.attrs.update(_attributes(space))
        group.create_array("counts", data=grid.counts)
        group.create_array("manipulability", data=grid.manipulability)
        group.create_array("origin", data=grid.origin)
        group.create_array("axes", data=grid.axes)
        for axis, cells in enumerate(grid.counts.shape):
            group.create_array(f"edges_{axis}", data=grid.edge * np.arange(cells + 1))
        for k, flat in enumerate(space.maps):
            array = group.create_array(f"map_{k}", data=flat.manipulability)
            array.attrs.update(
                corner_m=flat.corner.tolist(),
                edge_m=flat.edge,
                origin_m=flat.projection.origin.tolist(),
                axes=flat.projection.axes.tolist(),
                is_section=flat.projection.is_section,
            )
    return path


def check_zarr_place(path: Path) -> None:
    """Refuse a path that no Zarr group can be written to, before long work is done for it.

    Raises
    ------
    MissingPackageError
        The extra ``scale`` is not installed.
    DescriptionError
        The path is there and not a workspace of dhkit, or its folder cannot be written to.
    """
    zarr = dask_module("zarr")
    if path.exists():
        is_group = (path / "zarr.json").is_file()
        if not is_group or "dhkit_version" not in zarr.open(path, mode="r").attrs:
            raise DescriptionError(
                f"{path}: not a workspace of dhkit; expected one, or a free path"
            )
    check_place(path / "zarr.json")


def _attributes(space: Workspace) -> dict[str, Any]:
    estimate = space.estimate
    return {
        "robot": space.description.name,
        "robot_digest": space.description.digest,
        "dhkit_version": dhkit.__version__,
        "samples": space.samples,
        "seed": space.seed,
        "assumed": list(space.assumed),
        "edge_m": space.grid and space.grid.edge,
        "bounds_m": space.bounds.tolist(),
        "distances_m": list(space.distances),
        "radii_m": list(space.radii),
        "best_q": space.best.tolist(),
        "largest_manipulability": space.largest_manipulability,
        "estimate": None if estimate is None else vars(estimate),
    }
