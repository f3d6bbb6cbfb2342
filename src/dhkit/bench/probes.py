"""Probes beside the ratios: scaling over threads, peak memory, and the first call of a new process."""

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

_BLOCK = bytes(256 * 1024)
"""Block that the control loop hashes; it stays in the core's cache."""
_BLOCKS = 128
"""Number of times that the control loop hashes the block."""
_MAX_PROCESS_TIME = 120.0
"""Longest time of a new process, s."""
_WARM_PROCESSES = 3
"""New processes with a warm cache, of which the median time counts."""


@dataclass(frozen=True)
class ThreadScaling:
    """The time of one thread over that of two, for dhkit and for a control loop that only computes."""

    COLUMNS: ClassVar[tuple[str, ...]] = ("quantity", "dhkit", "control loop", "share")
    quantity: str
    dhkit: float
    control: float

    @property
    def share(self) -> float:
        """Dhkit's gain over that of the control loop, which is the machine's own."""
        return self.dhkit / self.control

    @property
    def derived(self) -> dict[str, object]:
        """Entries in JSON besides the fields."""
        return {"share": self.share}

    @property
    def cells(self) -> tuple[str, ...]:
        """The cells of a row under :attr:`COLUMNS`."""
        return (self.quantity, f"{self.dhkit:.2f}", f"{self.control:.2f}", f"{self.share:.2f}")

    __repr__ = value_line


@dataclass(frozen=True)
class PeakMemory:
    """The peak of a process's memory during a batch call, with all threads and native code.

    Attributes
    ----------
    called
        How the call is made: one of :attr:`CALLED`.
    inputs, outputs
        Sizes of the call's arrays, bytes.
    extra
        Memory beyond that before the call, bytes.
    """

    CALLED: ClassVar[tuple[str, ...]] = ("out=", "new arrays")
    COLUMNS: ClassVar[tuple[str, ...]] = (
        "quantity",
        "called with",
        "inputs and outputs [MB]",
        "peak [MB]",
        "share",
    )
    quantity: str
    called: str
    inputs: int
    outputs: int
    extra: int

    @property
    def peak(self) -> int:
        """Memory that the call needs, bytes: its arrays, and other allocations."""
        held = self.inputs + (self.outputs if self.called == "out=" else 0)
        return held + self.extra

    @property
    def share(self) -> float:
        """The peak over the sum of inputs and outputs."""
        return self.peak / (self.inputs + self.outputs)

    @property
    def derived(self) -> dict[str, object]:
        """Entries in JSON besides the fields."""
        return {"peak": self.peak, "share": self.share}

    @property
    def cells(self) -> tuple[str, ...]:
        """The cells of a row under :attr:`COLUMNS`."""
        arrays, peak = (f"{count / 1e6:.1f}" for count in (self.inputs + self.outputs, self.peak))
        return (self.quantity, self.called, arrays, peak, f"{self.share:.2f}")

    __repr__ = value_line


@dataclass(frozen=True)
class FirstCall:
    """The time from the start of a new Python to the end of its first batch call, imports included.

    Attributes
    ----------
    first
        Time with an empty kernel cache, s.
    second
        Time with a warm kernel cache, s.
    """

    COLUMNS: ClassVar[tuple[str, ...]] = ("quantity", "cold cache [s]", "warm cache [s]")
    quantity: str
    first: float
    second: float

    @property
    def cells(self) -> tuple[str, ...]:
        """The cells of a row under :attr:`COLUMNS`."""
        return (self.quantity, f"{self.first:.2f}", f"{self.second:.2f}")

    __repr__ = value_line


def thread_scaling(workload: Workload, quantity: str, repeats: int) -> ThreadScaling:
    """Time a batch call and a control loop on one thread and on two, interleaved.

    Raises
    ------
    UnavailableError
        There is only one core, or no such method.
    """
    if cores() < 2:
        raise UnavailableError("needs two cores")
    function = method(workload.arm, quantity)
    inputs = workload.inputs(quantity)
    out = new_output(function, inputs)

    def on(threads: int) -> Call:
        return lambda: function(*inputs, out=out, threads=threads)

    on(2)()
    times = lasting(on(1))
    with ThreadPoolExecutor(2) as pool:
        calls = (
            repeated(on(1), times),
            repeated(on(2), times),
            lambda: _hash_blocks(_BLOCKS),
            lambda: list(pool.map(_hash_blocks, (_BLOCKS // 2, _BLOCKS // 2))),
        )
        seconds = np.array(list(rounds(calls, repeats)))
    one, two, control_one, control_two = np.median(seconds, axis=0)
    return ThreadScaling(quantity, float(one / two), float(control_one / control_two))


def _hash_blocks(count: int) -> None:
    """Compute without memory traffic and without Python's global lock, which hashlib releases."""
    digest = hashlib.sha256()
    for _ in range(count):
        digest.update(_BLOCK)


def peak_memory(workload: Workload, quantity: str, called: str) -> PeakMemory:
    """Measure a batch call in a process of its own.

    Raises
    ------
    UnavailableError
        The system does not record peaks, or there is no such method.
    """
    method(workload.arm, quantity)
    if not Path("/proc/self/clear_refs").exists():
        raise UnavailableError("needs Linux's /proc/self/clear_refs")
    # With these settings freed memory is returned to the system at once, so that it cannot hide a part of the peak.
    malloc = {"MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"}
    code = "from dhkit.bench import probes; probes.report_peak()"
    with tempfile.TemporaryDirectory() as folder:
        robot = _robot_file(workload.arm, folder)
        printed = _python(
            code,
            robot,
            quantity,
            called,
            str(len(workload.q)),
            str(workload.threads),
            environment=malloc,
        )
    return PeakMemory(quantity, called, **json.loads(printed))


def report_peak() -> None:
    """Print the sizes of one call, bytes, as JSON; the arguments are those that :func:`peak_memory` passes."""
    robot, quantity, called, batch, threads = sys.argv[1:]
    workload = Workload.of(Arm.load(robot), int(batch), int(threads), seed=0)
    workload.arm.compile()
    function = method(workload.arm, quantity)
    inputs = workload.inputs(quantity)
    out = new_output(function, inputs) if called == "out=" else None
    count = min(len(inputs[0]), 1024)
    warm_up = [x[:count] for x in inputs]
    function(*warm_up, out=None if out is None else out[:count], threads=workload.threads)
    result, extra = _with_memory(lambda: function(*inputs, out=out, threads=workload.threads))
    sizes = {"inputs": sum(x.nbytes for x in inputs), "outputs": _size_of(result), "extra": extra}
    sys.stdout.write(json.dumps(sizes))


def _with_memory(call: Callable[[], Any]) -> tuple[Any, int]:
    """Return a call's result, and how far the resident memory rose during the call, bytes."""
    Path("/proc/self/clear_refs").write_text("5")  # this resets the recorded peak
    initial = _memory("VmRSS")
    result = call()
    return result, max(0, _memory("VmHWM") - initial)


def _memory(key: str) -> int:
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(f"{key}:"))


def _size_of(result: Any) -> int:
    """Return the size of an array, or of the arrays in a result, bytes."""
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
    arguments = {
        "ik": "arm.fk(q)",
        "ik_numeric": "arm.fk(q)",
        "inverse_dynamics": "q, q, q",
        "inverse_dynamics_derivatives": "q, q, q",
        "regressor": "q, q, q",
        "forward_dynamics": "q, q, q",
    }.get(quantity, "q")
    code = (
        "import sys, numpy as np, dhkit; arm = dhkit.Arm.load(sys.argv[1]); "
        f"q = np.random.default_rng(0).uniform(-1, 1, (int(sys.argv[2]), arm.n)); arm.{quantity}({arguments})"
    )
    with tempfile.TemporaryDirectory() as folder:
        robot = _robot_file(workload.arm, folder)
        cache = {"DHKIT_CACHE_DIR": str(Path(folder) / "cache")}

        def seconds() -> float:
            start = perf_counter()
            _python(code, robot, str(len(workload.q)), environment=cache)
            return perf_counter() - start

        return FirstCall(quantity, seconds(), median(seconds() for _ in range(_WARM_PROCESSES)))


def _robot_file(arm: Arm, folder: str) -> str:
    path = Path(folder) / "robot.toml"
    write_robot(bare(arm.description), path)
    return str(path)


def _python(code: str, *arguments: str, environment: Mapping[str, str]) -> str:
    """Run code in a new Python and return its output."""
    command = [sys.executable, "-c", code, *arguments]
    with suppress(subprocess.TimeoutExpired):
        process = subprocess.run(  # noqa: S603 - our own code
            command,
            capture_output=True,
            text=True,
            timeout=_MAX_PROCESS_TIME,
            check=False,
            env=os.environ | dict(environment),
        )
        if process.returncode:
            raise UnavailableError(
                f"a new process failed: {(process.stderr.strip().splitlines() or ['no output'])[-1]}"
            )
        return process.stdout
    raise UnavailableError(f"a new process took more than {_MAX_PROCESS_TIME:.0f} s")
