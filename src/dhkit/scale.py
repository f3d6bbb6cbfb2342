"""Work on many processes or machines by dask: workspaces, batches of states, simulations and plans (extra ``scale``).

The result of a task depends on its arguments alone. A worker that is lost costs the tasks that it was working on, and
those whose results it still held: dask computes them again elsewhere, with the same digits.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache
from itertools import count, islice, pairwise
from pathlib import Path
from pickle import dumps, loads
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, TypeVar
from uuid import uuid4

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

import dhkit
from dhkit.arm import Arm
from dhkit.control import BatchResult, Controller, Reference
from dhkit.control.options import BatchOptions
from dhkit.description import Array
from dhkit.description.files import check_place, whole_folder
from dhkit.errors import DescriptionError, DhkitError, PlanningError, from_checkout
from dhkit.kernels import kernel_mode
from dhkit.kinematics import Workspace
from dhkit.kinematics.workspace import CHUNK, Progress, distributed_workspace
from dhkit.packages import imported
from dhkit.planning import Planner
from dhkit.trajectories import Trajectory

if TYPE_CHECKING:
    Client: TypeAlias = Any
    """A client of dask, ``distributed.Client``."""
    DaskArray: TypeAlias = Any
    """An array of dask, ``dask.array.Array``."""

__all__ = [
    "connected",
    "fk",
    "forward_dynamics",
    "ik",
    "inverse_dynamics",
    "jacobian",
    "map_states",
    "plan_many",
    "prepare",
    "save_workspace",
    "simulate_many",
    "workspace",
]

TIMEOUT = 10.0
"""Longest time until a scheduler answers and has a worker, s."""
LEAST_TASKS = 64
"""Tasks into which a workspace is divided at least; of these a lost worker costs one or two."""
CHUNKS_PER_TASK = 2
"""Chunks in a task of a workspace at least: sending a task takes about a third of the time of a chunk."""
TASKS_PER_THREAD = 8
"""Tasks of a workspace for each thread of a large cluster, so that all threads end at about the same time."""
TASKS_AHEAD = 2
"""Tasks sent out for each thread: one that it works on, and one that waits. More would fill memory with results."""
RUNS_PER_TASK = 1_024
"""Simulations in a task at least: fewer do not fill the vectors of a processor for long."""

DEAF_TO_CTRL_C = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""Program that workers on this machine run at first: a terminal sends Ctrl-C to them too, and they are ended here."""

MALLOC = {"MALLOC_TRIM_THRESHOLD_": 256 << 20, "MALLOC_MMAP_THRESHOLD_": 32 << 20}
"""Memory that workers keep for their next arrays, bytes (glibc). Dask has them return all that is free, and arrays of a
chunk, 0.5 to 8 MB, then take twice as long: the system clears each page again."""

Item = TypeVar("Item")
Result = TypeVar("Result")


# Clusters


@contextmanager
def connected(scheduler: str = "local", timeout: float = TIMEOUT) -> Iterator[Client]:
    """Connect to a scheduler of dask, or start one with workers on this machine.

    Parameters
    ----------
    scheduler
        Address such as ``tcp://10.0.0.1:8786``; or ``local``, which starts a process for each core, or ``local:4`` for
        four processes. They end with the context.
    timeout
        Longest time until the scheduler answers and has a worker, s.

    Yields
    ------
    Client
        A client of dask, which is also the default for arrays of dask.

    Raises
    ------
    MissingPackageError
        The extra ``scale`` is not installed.
    DhkitError
        No scheduler answers, it has no worker, or a worker has another dhkit or none.

    Examples
    --------
    >>> with connected("local:0") as client:
    ...     pass
    Traceback (most recent call last):
        ...
    dhkit.errors.DhkitError: scheduler 'local:0': expected an address such as tcp://10.0.0.1:8786, local or local:4
    """
    # Otherwise each connection is told of on stderr, and each error twice. This is read when distributed is first
    # imported, and by its workers.
    _dask("dask.config").set({"logging": {"distributed": "critical"}})
    distributed = _dask("distributed")
    where, _, number = scheduler.partition(":")
    if where == "local":
        workers = _worker_count(scheduler, number)
        _dask("dask.config").set(
            {f"distributed.nanny.pre-spawn-environ.{name}": size for name, size in MALLOC.items()}
        )
        # One thread a worker: kernels and NumPy keep a core busy. The dashboard takes any port that is free.
        cluster = distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            silence_logs="CRITICAL",
            dashboard_address=":0",
            preload=[DEAF_TO_CTRL_C],
        )
        with cluster, distributed.Client(cluster) as client:
            prepare(client)
            yield client
        return
    if "://" not in scheduler:
        raise _bad_address(scheduler)
    try:
        client = distributed.Client(scheduler, timeout=timeout)
    except OSError:
        raise DhkitError(
            f"no scheduler of dask answers at {scheduler} within {timeout:g} s"
        ) from None
    except ValueError as error:
        raise DhkitError(f"scheduler {scheduler!r}: {error}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=timeout)
        except TimeoutError:
            raise DhkitError(
                f"the scheduler at {scheduler} has no worker after {timeout:g} s: "
                f"start one with `dask worker {scheduler} --nthreads 1`"
            ) from None
        prepare(client)
        yield client


def prepare(client: Client) -> None:
    """Make present and future workers of a client compile kernels at their first use, and check their dhkit.

    Otherwise a worker would interpret small batches at first, and compiled code rounds otherwise. :func:`connected` has
    called this; call it for a client of your own before you compute arrays. Functions that take a client call it.

    Parameters
    ----------
    client
        A client of dask.

    Raises
    ------
    DhkitError
        A worker has another dhkit or none.
    """
    distributed = _dask("distributed")

    class Compiling(distributed.WorkerPlugin):  # type: ignore[misc, name-defined]
        """Sets the mode of kernels in a worker before anything else."""

        name = "dhkit"

        def setup(self, worker: object) -> None:
            os.environ["DHKIT_KERNELS"] = "on"
            kernel_mode.cache_clear()

    try:
        versions = client.run(_version)
        client.register_plugin(Compiling())
    except ModuleNotFoundError as error:
        raise DhkitError(f"a worker lacks {error.name}: install dhkit there") from None
    for address, version in versions.items():
        if version != dhkit.__version__:
            raise DhkitError(
                f"worker {address} has dhkit {version}; expected {dhkit.__version__}, as here"
            )


def _version() -> str:
    return dhkit.__version__


def _worker_count(scheduler: str, number: str) -> int:
    if not number:
        return os.cpu_count() or 1
    if not number.isdecimal() or int(number) < 1:
        raise _bad_address(scheduler)
    return int(number)


def _bad_address(scheduler: str) -> DhkitError:
    return DhkitError(
        f"scheduler {scheduler!r}: expected an address such as tcp://10.0.0.1:8786, local or local:4"
    )


def _dask(module: str) -> Any:
    return imported(module, "scaling", from_checkout("scale"))


def _completed(
    client: Client, function: Callable[[Item], Result], items: Sequence[Item]
) -> Iterator[tuple[int, Result]]:
    """Yield the number of each item and the function's result, as soon as it is there, in any order.

    Few tasks are sent out at a time, so that the memory that results take does not depend on the number of items.
    """
    distributed = _dask("distributed")
    threads = sum(client.nthreads().values())
    waiting = iter(range(len(items)))
    running = distributed.as_completed()
    numbers: dict[str, int] = {}

    def send(tasks: int) -> None:
        for number in islice(waiting, tasks):
            key = f"{type(function).__name__.strip('_').lower()}-{uuid4().hex}"
            numbers[key] = number
            # The function travels with each task: dask could not make scattered data again if it were lost.
            running.add(client.submit(function, items[number], key=key))

    try:
        send(TASKS_AHEAD * max(1, threads))
        for future in running:
            try:
                result = future.result()
            except distributed.KilledWorker:
                raise DhkitError(
                    "a task ended its worker again and again, for want of memory perhaps"
                ) from None
            except CancelledError:
                raise DhkitError("the connection to the scheduler is lost") from None
            number = numbers.pop(future.key)
            del future
            send(1)
            yield number, result
    finally:
        # Empty unless the caller stopped or a task failed.
        client.cancel(list(running.futures))


# Workspace


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
        for number, result in _completed(client, function, runs):
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
    zarr = _dask("zarr")
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
    zarr = _dask("zarr")
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


# Arrays


def map_states(
    function: Callable[..., ArrayLike],
    *arrays: ArrayLike | DaskArray,
    tail: tuple[int, ...],
    dtype: DTypeLike = float,
    chunk: int = CHUNK,
) -> DaskArray:
    """Return an array of dask whose blocks are a function of blocks of states.

    Nothing is computed before dask is asked to, by whatever scheduler it uses.

    Parameters
    ----------
    function
        Takes an array of some rows of each array, and returns one of as many rows; it can be pickled.
    *arrays
        Arrays of dask or NumPy, shape (N, ...), each with N rows.
    tail
        Shape of a row of the result.
    dtype
        Type of the result.
    chunk
        Rows in a block of arrays that are not of dask.

    Returns
    -------
    DaskArray
        Rows of shape ``tail``, in the blocks of the first array.

    Raises
    ------
    MissingPackageError
        The extra ``scale`` is not installed.
    ValueError
        No array, or arrays of other numbers of rows.

    Examples
    --------
    >>> import numpy as np
    >>> speeds = map_states(lambda qd: np.linalg.norm(qd, axis=1), np.ones((1000, 4)), tail=())
    >>> speeds.shape, float(speeds.compute().max())
    ((1000,), 2.0)
    """
    da = _dask("dask.array")
    if not arrays:
        raise ValueError("no arrays; expected one or more")
    rows = [_in_blocks(da, array, chunk) for array in arrays]
    sizes = {len(array) for array in rows}
    if len(sizes) > 1:
        raise ValueError(f"arrays have {sorted(sizes)} rows; expected as many in each")

    # Axis 0 is that of the rows; all other axes have a label of their own, and one block.
    labels = count(1)
    new = [next(labels) for _ in tail]
    pairs: list[object] = []
    for array in rows:
        pairs += [array, (0, *(next(labels) for _ in array.shape[1:]))]
    return da.blockwise(
        function,
        (0, *new),
        *pairs,
        token=getattr(function, "name", None),
        new_axes=dict(zip(new, tail, strict=True)),
        concatenate=True,
        dtype=np.dtype(dtype),
        meta=np.empty((0,) * (1 + len(tail)), dtype),
    )


def _in_blocks(da: Any, array: ArrayLike | DaskArray, chunk: int) -> DaskArray:
    """Return an array of dask whose blocks have whole rows."""
    if not isinstance(array, da.Array):
        array = np.asarray(array)
        if not array.ndim:
            raise ValueError("found a number; expected an array with a row for each state")
        array = da.from_array(array, chunks=(chunk, *array.shape[1:]))
    return array.rechunk(dict.fromkeys(range(1, array.ndim), -1))


@dataclass(frozen=True)
class _Method:
    """A method of an arm as a function of arrays that can be sent to workers: an arm is 4 to 13 kB."""

    arm: Arm
    name: str

    def __call__(self, *arrays: Array) -> Array:
        result: Array = getattr(self.arm, self.name)(*arrays)
        return result


@dataclass(frozen=True)
class _Solutions:
    """Joint values of all solutions of the inverse kinematics, as a function that can be sent to workers."""

    arm: Arm
    name: ClassVar[str] = "ik"

    def __call__(self, T: Array) -> Array:
        return self.arm.ik(T).q


def fk(arm: Arm, q: ArrayLike | DaskArray) -> DaskArray:
    """Return the poses of the tool in the world, shape (N, 4, 4), as an array of dask; see :meth:`dhkit.Arm.fk`.

    Parameters
    ----------
    arm
        The arm.
    q
        Joint values, shape (N, n), rad and m, of dask or NumPy.

    Returns
    -------
    DaskArray
        Shape (N, 4, 4), m.

    Examples
    --------
    >>> import dask.array as da
    >>> arm = Arm.load("puma560")
    >>> q = da.random.default_rng(0).uniform(-1, 1, (100_000, 6), chunks=(50_000, 6))
    >>> fk(arm, q)[:, 2, 3].mean().compute().round(2)
    np.float64(0.98)
    """
    return map_states(_Method(arm, "fk"), q, tail=(4, 4))


def jacobian(arm: Arm, q: ArrayLike | DaskArray) -> DaskArray:
    """Return the Jacobians of the tool, shape (N, 6, n), as an array of dask; see :meth:`dhkit.Arm.jacobian`.

    Parameters
    ----------
    arm
        The arm.
    q
        Joint values, shape (N, n), rad and m, of dask or NumPy.

    Returns
    -------
    DaskArray
        Shape (N, 6, n), in world axes.

    Examples
    --------
    >>> import numpy as np
    >>> jacobian(Arm.load("planar2r"), np.zeros((1000, 2))).shape
    (1000, 6, 2)
    """
    return map_states(_Method(arm, "jacobian"), q, tail=(6, arm.n))


def ik(arm: Arm, T: ArrayLike | DaskArray) -> DaskArray:
    """Return all solutions of poses, shape (N, B, n), as an array of dask; see :meth:`dhkit.Arm.ik`.

    Parameters
    ----------
    arm
        The arm.
    T
        Poses of the tool in the world, shape (N, 4, 4), m, of dask or NumPy.

    Returns
    -------
    DaskArray
        Joint values of B branches, shape (N, B, n), rad and m; NaN where a branch does not reach the pose.

    Raises
    ------
    ModelError
        The arm has no closed form, and prismatic joints or not six or seven.

    Examples
    --------
    >>> import numpy as np
    >>> arm = Arm.load("puma560")
    >>> ik(arm, fk(arm, np.zeros((1000, 6)))).shape
    (1000, 8, 6)
    """
    branches = _Solutions(arm)(arm.fk(np.zeros((1, arm.n)))).shape[1]
    return map_states(_Solutions(arm), T, tail=(branches, arm.n))


def inverse_dynamics(
    arm: Arm,
    q: ArrayLike | DaskArray,
    qd: ArrayLike | DaskArray,
    qdd: ArrayLike | DaskArray,
) -> DaskArray:
    """Return joint torques, shape (N, n), as an array of dask; see :meth:`dhkit.Arm.inverse_dynamics`.

    Parameters
    ----------
    arm
        The arm.
    q, qd, qdd
        Joint values, rates and accelerations, shape (N, n) each, rad, m, s, of dask or NumPy.

    Returns
    -------
    DaskArray
        Shape (N, n), N m and N.

    Examples
    --------
    >>> import numpy as np
    >>> rest = np.zeros((1000, 2))
    >>> inverse_dynamics(Arm.load("planar2r"), rest, rest, rest).shape
    (1000, 2)
    """
    return map_states(_Method(arm, "inverse_dynamics"), q, qd, qdd, tail=(arm.n,))


def forward_dynamics(
    arm: Arm,
    q: ArrayLike | DaskArray,
    qd: ArrayLike | DaskArray,
    tau: ArrayLike | DaskArray,
) -> DaskArray:
    """Return joint accelerations, shape (N, n), as an array of dask; see :meth:`dhkit.Arm.forward_dynamics`.

    Parameters
    ----------
    arm
        The arm.
    q, qd, tau
        Joint values, rates and torques, shape (N, n) each, rad, m, s, N m and N, of dask or NumPy.

    Returns
    -------
    DaskArray
        Shape (N, n), rad/s^2 and m/s^2.

    Examples
    --------
    >>> import numpy as np
    >>> rest = np.zeros((1000, 2))
    >>> forward_dynamics(Arm.load("planar2r"), rest, rest, rest).shape
    (1000, 2)
    """
    return map_states(_Method(arm, "forward_dynamics"), q, qd, tau, tail=(arm.n,))


# Simulations


def simulate_many(
    client: Client,
    arm: Arm,
    controller: Controller | None = None,
    reference: Reference | Trajectory | ArrayLike | None = None,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    qd0: ArrayLike | None = None,
    *,
    options: BatchOptions | None = None,
    size: int = RUNS_PER_TASK,
    progress: Progress | None = None,
) -> BatchResult:
    """Simulate many runs by the workers of a cluster, in tasks of many runs each; see :meth:`dhkit.Arm.simulate_batch`.

    The number of runs B is that of the rows of ``q0``, ``qd0``, of joint values to hold, or of ``options.plant``: arms
    with other masses or payloads, for instance. Gains are the same in all runs.

    Parameters
    ----------
    client
        A client of dask, as :func:`connected` yields it.
    arm
        The robot that the controller and the reference know.
    controller, reference, duration
        As for :meth:`dhkit.Arm.simulate_batch`; joint values to hold may have shape (B, n).
    q0, qd0
        Joint values and rates at the start, shape (n,) or (B, n), rad, m and per second.
    options
        Options of the simulation but ``progress``. ``keep="all"`` needs memory for all states in this process.
    size
        Runs in a task at least.
    progress
        Called with how many runs are done and how many there will be; an exception in it ends the work.

    Returns
    -------
    BatchResult
        The runs in their order.

    Raises
    ------
    SimulationError, ValueError, TypeError
        As for :meth:`dhkit.Arm.simulate_batch`.
    """
    prepare(client)
    options = options or BatchOptions()
    followed = reference if isinstance(reference, Trajectory | Reference) else None
    q0 = _rows(q0)
    qd0 = _rows(qd0)
    held = None if followed is not None else _rows(reference)
    plants = options.plant if isinstance(options.plant, Sequence) else None
    runs = max(1 if rows is None else len(rows) for rows in (q0, qd0, held, plants))

    def cut(rows: Any, part: slice) -> Any:
        return rows if rows is None or len(rows) == 1 else rows[part]

    # Equal parts, so that each has ``size`` rows at least if there are so many.
    ends = np.linspace(0, runs, max(1, runs // size) + 1).astype(int).tolist()
    parts = [slice(*pair) for pair in pairwise(ends)]
    items = [
        {
            "controller": controller,
            "reference": cut(held, part) if followed is None else followed,
            "duration": duration,
            "q0": cut(q0, part),
            "qd0": cut(qd0, part),
            "options": options if plants is None else replace(options, plant=cut(plants, part)),
        }
        for part in parts
    ]
    found: dict[int, BatchResult] = {}
    done = 0
    for number, result in _completed(client, _Simulate(arm), items):
        found[number] = result
        done += parts[number].stop - parts[number].start
        if progress is not None:
            progress(done, runs)
    return _joined([found[number] for number in range(len(parts))])


def _rows(values: object) -> Array | None:
    """Return joint values, shape (n,) or (B, n), as rows: one, or one for each run."""
    return None if values is None else np.atleast_2d(np.asarray(values, dtype=float))


@dataclass(frozen=True)
class _Simulate:
    arm: Arm

    def __call__(self, arguments: dict[str, Any]) -> BatchResult:
        return self.arm.simulate_batch(**arguments)


def _joined(results: Sequence[BatchResult]) -> BatchResult:
    """Return results of consecutive runs as one."""
    first = results[0]
    if len(results) == 1:
        return first
    joined = {
        each.name: _joined_field([getattr(result, each.name) for result in results])
        for each in fields(first)
        if each.name not in ("arms", "friction", "t")
    }
    if len(first.arms) > 1:
        joined["arms"] = sum((result.arms for result in results), ())
    return replace(first, **joined)


def _joined_field(values: Sequence[Any]) -> Any:
    """Return arrays joined along the runs; None where there are none; the same for each field of a dataclass."""
    first = values[0]
    if is_dataclass(first) and not isinstance(first, type):
        parts = {
            each.name: _joined_field([getattr(value, each.name) for value in values])
            for each in fields(first)
        }
        return replace(first, **parts)
    return None if first is None else np.concatenate(values)


# Plans


def plan_many(
    client: Client,
    planner: Planner,
    starts: ArrayLike,
    goals: ArrayLike,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> list[Trajectory | PlanningError]:
    """Plan the best motions between N pairs of places by the workers of a cluster, a task each.

    Parameters
    ----------
    client
        A client of dask, as :func:`connected` yields it.
    planner
        Of :meth:`dhkit.Arm.planner`.
    starts, goals
        Joint values, shape (N, n), or (n,) for all, rad and m; goals may be poses (N, 4, 4) or (4, 4) of the tool.
    progress
        Called with how many motions are done and how many there will be; an exception in it ends the work.
    **options
        Arguments of :meth:`dhkit.Planner.solve` for all motions.

    Returns
    -------
    list[Trajectory | PlanningError]
        For each pair the motion, or why there is none.

    Raises
    ------
    ValueError, TypeError
        Arguments of another shape or type.
    """
    prepare(client)
    n = planner.description.n
    first = _places(starts, n, poses=False)
    last = _places(goals, n, poses=True)
    pairs = max(len(first), len(last))
    for name, places in (("starts", first), ("goals", last)):
        if len(places) not in (1, pairs):
            raise ValueError(f"{name} has {len(places)} places; expected 1 or {pairs}")
    items = [(first[k % len(first)], last[k % len(last)]) for k in range(pairs)]
    found: dict[int, Trajectory | PlanningError] = {}
    for number, motion in _completed(client, _Plan(dumps(planner), options), items):
        found[number] = motion
        if progress is not None:
            progress(len(found), pairs)
    return [found[number] for number in range(pairs)]


@dataclass(frozen=True)
class _Plan:
    planner: bytes
    options: dict[str, Any]

    def __call__(self, pair: tuple[Array, Array]) -> Trajectory | PlanningError:
        return _planner(self.planner).solve_many(*pair, workers=1, **self.options)[0]


@lru_cache(maxsize=4)
def _planner(pickled: bytes) -> Planner:
    """Return a planner that this worker keeps: it holds programs that take long to build."""
    planner: Planner = loads(pickled)  # noqa: S301 - dask sends pickles in any case
    return planner


def _places(values: ArrayLike, n: int, *, poses: bool) -> Sequence[Array]:
    """Return places, each of shape (n,) or with ``poses`` (4, 4), from one or several of them."""
    array = np.asarray(values, dtype=float)
    is_one = array.ndim == 1 or (poses and array.shape == (4, 4))
    return [array] if is_one else list(array)
