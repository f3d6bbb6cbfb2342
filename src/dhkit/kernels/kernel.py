"""Kernels: programs as functions of batches, interpreted or compiled, whichever answers sooner."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.display import repr_line
from dhkit.errors import DhkitError
from dhkit.kernels.threads import all_in_threads
from dhkit.symbolic import Graph

if TYPE_CHECKING:
    from dhkit.kernels.interpreter import Interpreter
    from dhkit.kernels.machine_code import CompiledFunction

log = logging.getLogger(__name__)

MODES = ("auto", "on", "off")

SMALL = 64
"""Items: smaller batches are interpreted and do not count towards compiling, so that no control loop waits for it."""
COMPILE_AFTER = 65_536
"""Items that larger batches have asked for when a kernel is compiled: interpreting so many takes about as long as
compiling (30 to 250 ms)."""
SHARE = 4_096
"""Items that a thread must have to itself: below that handing them over costs more than it saves."""
KEPT = 2_048
"""Kernels that a process keeps; the oldest goes first."""


def kernel_mode() -> str:
    """Return what ``DHKIT_KERNELS`` asks for: ``auto``, ``on`` (always compiled) or ``off`` (never).

    Raises
    ------
    DhkitError
        The variable has another value.
    """
    mode = os.environ.get("DHKIT_KERNELS") or "auto"
    if mode not in MODES:
        raise DhkitError(f"DHKIT_KERNELS is {mode!r}; expected auto, on or off")
    return mode


class Kernel:
    """A program as a function of batches: ``kernel(parameters, inputs, outputs)`` fills the outputs.

    Inputs are (N, size) float64, C-contiguous; outputs likewise, of the types that :func:`kernel` was given. Items are
    independent; where an item's input is not finite, its float results are NaN.
    """

    def __init__(self, name: str, pattern: str, derive: Callable[[], Graph], types: Sequence[str]) -> None:
        self.name = name
        self._pattern = pattern
        self._derive = derive
        self._types = types
        self._graph: Graph | None = None
        self._interpreter: Interpreter | None = None
        self._function: CompiledFunction | None = None
        self._looked_up = False
        """Whether the cache has been asked for machine code."""
        self._failed = False
        """Whether there will be no machine code on this machine."""
        self._items = 0
        """What has been asked for in batches that are not small."""

    def __call__(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]], threads: int = 1
    ) -> None:
        """Fill ``outputs``; with several threads each takes a share of a large compiled batch."""
        count = len(inputs[0])
        function = self._function_for(count)
        if function is None:
            interpreter = self._interpreter or self._interpreted()
            interpreter(parameters, inputs, outputs)
            return
        shares = max(1, min(threads, count // SHARE))
        if shares == 1:
            function(parameters, inputs, outputs)
            return

        def work(rows: slice) -> None:
            function(parameters, [x[rows] for x in inputs], [y[rows] for y in outputs])

        edges = [count * k // shares for k in range(shares + 1)]
        all_in_threads(work, [slice(begin, end) for begin, end in pairwise(edges)])

    def compile(self) -> None:
        """Have machine code from now on: from the cache, or compiled now; unless ``DHKIT_KERNELS`` is ``off``."""
        if kernel_mode() == "off":
            return
        with _compiling:
            if self._function is None and not self._failed:
                self._look_up()
            if self._function is None and not self._failed:
                self._compile()

    def __repr__(self) -> str:
        return repr_line(f"Kernel {self.name}", said="interpreted" if self._function is None else "compiled")

    def _function_for(self, count: int) -> CompiledFunction | None:
        """Return the machine code for a batch, or None if it is to be interpreted.

        Once there, it serves batches of any size; small ones never wait for it to be compiled or loaded.
        """
        mode = kernel_mode()
        if mode == "off":
            return None
        if self._function is None and not self._failed and (mode == "on" or (count >= SMALL and _counting())):
            self._items += count
            if mode == "on" or self._items >= COMPILE_AFTER:
                self.compile()
            elif not self._looked_up:
                with _compiling:
                    self._look_up()
        return self._function

    def _look_up(self) -> None:
        """Take machine code from the cache, if it is there."""
        if self._looked_up:
            return
        try:
            from dhkit.kernels import machine_code, store

            code = store.read(self.name, store.digest(self.name, self._pattern))
            if code is not None:
                self._function = machine_code.CompiledFunction(code)
        except MACHINE_CODE_ERRORS as error:
            self._give_up(error)
        self._looked_up = True

    def _compile(self) -> None:
        program = self._program()
        log.info("compiling %s", self.name)
        try:
            from dhkit.kernels import machine_code, store
            from dhkit.kernels.llvm_source import llvm_source

            code = machine_code.compiled(llvm_source(program, self._types))
            self._function = machine_code.CompiledFunction(code)
        except MACHINE_CODE_ERRORS as error:
            self._give_up(error)
            return
        store.write(self.name, store.digest(self.name, self._pattern), code)

    def _give_up(self, error: Exception) -> None:
        """Interpret from now on: a processor that LLVM does not know must never stop a computation."""
        self._failed = True
        log.warning("%s is interpreted: it cannot be compiled here (%s)", self.name, error)

    def _interpreted(self) -> Interpreter:
        program = self._program()
        with _deriving:
            if self._interpreter is None:
                from dhkit.kernels.interpreter import Interpreter

                self._interpreter = Interpreter(program, self._types)
            return self._interpreter

    def _program(self) -> Graph:
        with _deriving:
            if self._graph is None:
                self._graph = self._derive()
            return self._graph


MACHINE_CODE_ERRORS = (ImportError, OSError, RuntimeError)
"""What llvmlite and the loader raise on a machine that they do not serve."""

_kernels: dict[tuple[str, str], Kernel] = {}
_compiling = threading.RLock()
"""Held while kernels are compiled and loaded. Who holds both locks took this one first."""
_deriving = threading.RLock()
"""Held while programs are derived: CasADi's expressions are not for two threads at once. A first answer that is
interpreted waits for no compilation, only for this."""


class _Uncounted(threading.local):
    depth = 0


_uncounted = _Uncounted()


def _counting() -> bool:
    return _uncounted.depth == 0


@contextmanager
def uncounted() -> Iterator[None]:
    """Let this thread's batches not count towards compiling: those inside a call that a control loop may make."""
    _uncounted.depth += 1
    try:
        yield
    finally:
        _uncounted.depth -= 1


def kernel(name: str, pattern: str, derive: Callable[[], Graph], types: Sequence[str] = ("float64",)) -> Kernel:
    """Return the kernel of a program, the same one each time.

    Parameters
    ----------
    name, pattern
        Together say which program it is: ``derive`` is only called when it is new.
    derive
        Returns the program; its first input holds the parameters, which all items share.
    types
        Of each output: float64, or uint8 for whole numbers from 0 to 255.
    """
    found = _kernels.get((name, pattern))
    if found is None:
        with _deriving:
            found = _kernels.setdefault((name, pattern), Kernel(name, pattern, derive, types))
            while len(_kernels) > KEPT:
                del _kernels[next(iter(_kernels))]
    return found


def _before_fork() -> None:
    """Wait for what is being compiled: LLVM's own locks would stay closed in the child."""
    _compiling.acquire()
    _deriving.acquire()


def _after_fork_in_parent() -> None:
    _deriving.release()
    _compiling.release()


def _after_fork_in_child() -> None:
    """Make new locks: the child's only thread does not hold what it held in the parent."""
    global _compiling, _deriving
    _compiling, _deriving = threading.RLock(), threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before_fork, after_in_parent=_after_fork_in_parent, after_in_child=_after_fork_in_child)
