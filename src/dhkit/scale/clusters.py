"""Connection to a scheduler of dask, and tasks that its workers do."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar
from uuid import uuid4

import dhkit
from dhkit.errors import DhkitError, from_checkout
from dhkit.kernels import kernel_mode
from dhkit.packages import imported

if TYPE_CHECKING:
    Client: TypeAlias = Any
    """A client of dask, ``distributed.Client``."""

TIMEOUT = 10.0
"""Longest time until a scheduler answers and has a worker, s."""
TASKS_AHEAD = 2
"""Tasks sent out for each thread: one that it works on, and one that waits. More would fill memory with results."""

DEAF_TO_CTRL_C = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""Program that workers on this machine run at first: a terminal sends Ctrl-C to them too, and they are ended here."""

MALLOC = {"MALLOC_TRIM_THRESHOLD_": 256 << 20, "MALLOC_MMAP_THRESHOLD_": 32 << 20}
"""Memory that workers keep for their next arrays, bytes (glibc). Dask has them return all that is free, and arrays of a
chunk, 0.5 to 8 MB, then take twice as long: the system clears each page again."""

Item = TypeVar("Item")
Result = TypeVar("Result")


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
    dask_module("dask.config").set({"logging": {"distributed": "critical"}})
    distributed = dask_module("distributed")
    where, _, number = scheduler.partition(":")
    if where == "local":
        workers = _worker_count(scheduler, number)
        dask_module("dask.config").set(
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
    distributed = dask_module("distributed")

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


def dask_module(module: str) -> Any:
    """Return a package of the extra ``scale``.

    Raises
    ------
    MissingPackageError
        It is not installed.
    """
    return imported(module, "scaling", from_checkout("scale"))


def completed(
    client: Client, function: Callable[[Item], Result], items: Iterable[Item]
) -> Iterator[tuple[int, Result]]:
    """Yield the number of each item and the function's result, as soon as it is there, in any order.

    Few items are taken and sent out at a time, so that the memory in use does not depend on their number.
    """
    distributed = dask_module("distributed")
    threads = sum(client.nthreads().values())
    waiting = enumerate(items)
    running = distributed.as_completed()
    numbers: dict[str, int] = {}

    def send(tasks: int) -> None:
        for number, item in islice(waiting, tasks):
            key = f"{type(function).__name__.strip('_').lower()}-{uuid4().hex}"
            numbers[key] = number
            # The function travels with each task: dask could not make scattered data again if it were lost.
            running.add(client.submit(function, item, key=key))

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
