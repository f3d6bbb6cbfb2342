"""What a ratio table does not show: scaling over threads, peak memory, the first call of a new process."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.contenders import Call, UnavailableError, Workload
from dhkit.bench.geometry import bare
from dhkit.bench.machine import cores
from dhkit.bench.peers.dhkit_arm import method, new_output
from dhkit.bench.rounds import lasting, repeated, rounds
from dhkit.description import write_robot
from dhkit.display import value_line

BLOCK, BLOCKS = bytes(256 * 1024), 128
"""What the control loop hashes: a block that stays in the core's cache, and how often."""
PROCESS_TIME = 120.0
"""s a new process may take."""
PROCESSES = 3
"""New processes with a warm cache; the median counts."""


@dataclass(frozen=True)
class ThreadScaling:
    """One thread's time over two threads', for dhkit and for a loop that only computes, in the same rounds."""

    COLUMNS: ClassVar[tuple[str, ...]] = ("quantity", "dhkit", "control loop", "share")
    quantity: str
    dhkit: float
    control: float

    @property
    def share(self) -> float:
        """How much of what the machine gives dhkit takes."""
        return self.dhkit / self.control

    @property
    def derived(self) -> dict[str, Any]:
        """What JSON carries beyond the fields."""
        return {"share": self.share}

    @property
    def cells(self) -> tuple[str, ...]:
        """A line of a table under :attr:`COLUMNS`."""
        return (self.quantity, f"{self.dhkit:.2f}", f"{self.control:.2f}", f"{self.share:.2f}")

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True)
class PeakMemory:
    """How much more memory a process holds at the worst moment of a batch call, all threads and native code counted.

    Attributes
    ----------
    called
        One of :attr:`CALLED`.
    inputs, outputs
        Bytes of the call's arrays.
    extra
        Bytes beyond those held before the call.
    """

    CALLED: ClassVar[tuple[str, ...]] = ("out=", "new arrays")
    COLUMNS: ClassVar[tuple[str, ...]] = ("quantity", "called with", "inputs and outputs [MB]", "peak [MB]", "share")
    quantity: str
    called: str
    inputs: int
    outputs: int
    extra: int

    @property
    def peak(self) -> int:
        """Bytes that the call needs in all: its arrays and what it took beside them."""
        held = self.inputs + (self.outputs if self.called == "out=" else 0)
        return held + self.extra

    @property
    def share(self) -> float:
        """The peak over inputs plus outputs."""
        return self.peak / (self.inputs + self.outputs)

    @property
    def derived(self) -> dict[str, Any]:
        """What JSON carries beyond the fields."""
        return {"peak": self.peak, "share": self.share}

    @property
    def cells(self) -> tuple[str, ...]:
        """A line of a table under :attr:`COLUMNS`."""
        arrays, peak = (f"{count / 1e6:.1f}" for count in (self.inputs + self.outputs, self.peak))
        return (self.quantity, self.called, arrays, peak, f"{self.share:.2f}")

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True)
class FirstCall:
    """Seconds from the start of a new Python to the end of its first batch call, imports included.

    Attributes
    ----------
    first
        With an empty kernel cache.
    second
        With a warm one.
    """

    COLUMNS: ClassVar[tuple[str, ...]] = ("quantity", "cold cache [s]", "warm cache [s]")
    quantity: str
    first: float
    second: float

    @property
    def cells(self) -> tuple[str, ...]:
        """A line of a table under :attr:`COLUMNS`."""
        return (self.quantity, f"{self.first:.2f}", f"{self.second:.2f}")

    def __repr__(self) -> str:
        return value_line(self)


def thread_scaling(workload: Workload, quantity: str, repeats: int) -> ThreadScaling:
    """Time a batch call and a control loop on one thread and on two, interleaved.

    Raises
    ------
    UnavailableError
        There is one core, or no such method.
    """
    if cores() < 2:
        raise UnavailableError("needs two cores")
    function, inputs = method(workload.arm, quantity), workload.inputs(quantity)
    out = new_output(function, inputs)

    def on(threads: int) -> Call:
        return lambda: function(*inputs, out=out, threads=threads)

    on(2)()
    times = lasting(on(1))
    with ThreadPoolExecutor(2) as pool:
        calls = (
            repeated(on(1), times),
            repeated(on(2), times),
            lambda: _hash_blocks(BLOCKS),
            lambda: list(pool.map(_hash_blocks, (BLOCKS // 2, BLOCKS // 2))),
        )
        seconds = np.array(list(rounds(calls, repeats)))
    one, two, control_one, control_two = np.median(seconds, axis=0)
    return ThreadScaling(quantity, float(one / two), float(control_one / control_two))


def _hash_blocks(count: int) -> None:
    """Compute without memory traffic and without Python's lock, which hashlib lets go of."""
    digest = hashlib.sha256()
    for _ in range(count):
        digest.update(BLOCK)


def peak_memory(workload: Workload, quantity: str, called: str) -> PeakMemory:
    """Measure a batch call in a process of its own.

    Raises
    ------
    UnavailableError
        The system does not count peaks, or there is no such method.
    """
    method(workload.arm, quantity)
    if not Path("/proc/self/clear_refs").exists():
        raise UnavailableError("needs Linux's /proc/self/clear_refs")
    # Freed memory goes back to the system at once: none of the peak hides in what was free before.
    calm = {"MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"}
    code = "from dhkit.bench import probes; probes.report_peak()"
    with tempfile.TemporaryDirectory() as folder:
        robot = _robot_file(workload.arm, folder)
        printed = _python(code, robot, quantity, called, str(len(workload.q)), str(workload.threads), environment=calm)
    return PeakMemory(quantity, called, **json.loads(printed))


def report_peak() -> None:
    """Print one call's bytes as JSON; the arguments are what :func:`peak_memory` passes."""
    robot, quantity, called, batch, threads = sys.argv[1:]
    workload = Workload.of(Arm.load(robot), int(batch), int(threads), seed=0)
    workload.arm.compile()
    function, inputs = method(workload.arm, quantity), workload.inputs(quantity)
    out = new_output(function, inputs) if called == "out=" else None
    warm = min(len(inputs[0]), 1024)
    few = [x[:warm] for x in inputs]
    function(*few, out=None if out is None else out[:warm], threads=workload.threads)
    result, extra = _watched(lambda: function(*inputs, out=out, threads=workload.threads))
    sizes = {"inputs": sum(x.nbytes for x in inputs), "outputs": _bytes_of(result), "extra": extra}
    sys.stdout.write(json.dumps(sizes))


def _watched(call: Callable[[], Any]) -> tuple[Any, int]:
    """Return a call's result and how far the resident memory rose above what it was, bytes."""
    Path("/proc/self/clear_refs").write_text("5")  # the peak starts anew
    before = _status("VmRSS")
    result = call()
    return result, max(0, _status("VmHWM") - before)


def _status(key: str) -> int:
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(f"{key}:"))


def _bytes_of(result: Any) -> int:
    """Return the bytes of an array, or of the arrays that a result is made of."""
    if isinstance(result, np.ndarray):
        return result.nbytes
    parts = result._asdict().values() if hasattr(result, "_asdict") else vars(result).values()
    return sum(part.nbytes for part in parts if isinstance(part, np.ndarray))


def first_call(workload: Workload, quantity: str) -> FirstCall:
    """Time new processes that load the robot and make one batch call, with an empty and then a warm kernel cache.

    Raises
    ------
    UnavailableError
        A process fails, or there is no such method.
    """
    method(workload.arm, quantity)
    given = {"ik": "arm.fk(q)", "inverse_dynamics": "q, q, q", "forward_dynamics": "q, q, q"}.get(quantity, "q")
    code = (
        "import sys, numpy as np, dhkit; arm = dhkit.Arm.load(sys.argv[1]); "
        f"q = np.random.default_rng(0).uniform(-1, 1, (int(sys.argv[2]), arm.n)); arm.{quantity}({given})"
    )
    with tempfile.TemporaryDirectory() as folder:
        robot, cache = _robot_file(workload.arm, folder), {"DHKIT_CACHE_DIR": str(Path(folder) / "cache")}

        def seconds() -> float:
            start = perf_counter()
            _python(code, robot, str(len(workload.q)), environment=cache)
            return perf_counter() - start

        return FirstCall(quantity, seconds(), median(seconds() for _ in range(PROCESSES)))


def _robot_file(arm: Arm, folder: str) -> str:
    path = Path(folder) / "robot.toml"
    write_robot(bare(arm.description), path)
    return str(path)


def _python(code: str, *arguments: str, environment: Mapping[str, str]) -> str:
    """Run code in a new Python and return what it prints."""
    command = [sys.executable, "-c", code, *arguments]
    with suppress(subprocess.TimeoutExpired):
        done = subprocess.run(  # noqa: S603 - our own code
            command,
            capture_output=True,
            text=True,
            timeout=PROCESS_TIME,
            check=False,
            env=os.environ | dict(environment),
        )
        if done.returncode:
            raise UnavailableError(f"a new process failed: {(done.stderr.strip().splitlines() or ['no output'])[-1]}")
        return done.stdout
    raise UnavailableError(f"a new process took more than {PROCESS_TIME:.0f} s")
