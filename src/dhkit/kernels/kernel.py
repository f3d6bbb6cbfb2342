"""Kernels: programs as functions of batches, interpreted or compiled, whichever answers sooner."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.display import repr_line
from dhkit.errors import DhkitError
from dhkit.kernels.threads import all_in_threads
from dhkit.symbolic import Loop, Pipeline, Program

if TYPE_CHECKING:
    from dhkit.kernels.interpreter import Interpreter, LoopInterpreter, PipelineInterpreter
    from dhkit.kernels.machine_code import CompiledCall, CompiledFunction

log = logging.getLogger(__name__)

_MODES = ("auto", "on", "off")

SMALL_BATCH = 64
"""Smaller batches are interpreted and do not count towards compiling, so that no control loop waits for it."""
COMPILE_AFTER = 65_536
"""A kernel is compiled when larger batches have asked for this number of items: interpreting them takes about as long
as compiling (30 to 250 ms)."""
_STEPS_OF_A_LOOP = 128
"""Number of items of a straight-line program that an item of a loop counts as."""
MIN_ITEMS_PER_THREAD = 4_096
"""Smallest number of items for a thread; for fewer, the transfer takes longer than it saves."""
_MAX_KERNELS = 2_048
"""Largest number of kernels that a process keeps; the oldest is dropped first."""


@cache
def kernel_mode() -> str:
    """Return the value of ``DHKIT_KERNELS`` at the first call: ``auto``, ``on`` (always compile) or ``off`` (never).

    Returns
    -------
    str
        ``auto`` unless the variable is set.

    Raises
    ------
    DhkitError
        The variable has another value.

    Examples
    --------
    >>> kernel_mode() in ("auto", "on", "off")
    True
    """
    mode = os.environ.get("DHKIT_KERNELS") or "auto"
    if mode not in _MODES:
        raise DhkitError(f"DHKIT_KERNELS is {mode!r}; expected auto, on or off")
    return mode


class Kernel:
    """A program as a function of batches: ``kernel(parameters, inputs, outputs)`` fills the outputs.

    Inputs are (N, size) float64, C-contiguous; outputs likewise, of the types that :func:`kernel` was given. Items are
    independent; where an item's input is not finite, its float results are NaN.
    """

    def __init__(
        self,
        name: str,
        pattern: str,
        derive: Callable[[], Program],
        types: Sequence[str],
        is_loop: bool = False,
    ) -> None:
        self.name = name
        self._pattern = pattern
        self._derive = derive
        self.types = tuple(types)
        self._graph: Program | None = None
        self._interpreter: Interpreter | LoopInterpreter | PipelineInterpreter | None = None
        self._function: CompiledFunction | None = None
        self._is_loop = is_loop
        self._call: CompiledCall | None = None
        self._looked_up = False
        """Whether the cache was searched for machine code."""
        self._failed = False
        """Whether compiling failed, so that this kernel stays interpreted."""
        self._items = 0
        """Number of items asked for in batches that are not small."""

    def __call__(
        self,
        parameters: Array,
        inputs: Sequence[Array],
        outputs: Sequence[NDArray[Any]],
        threads: int = 1,
    ) -> None:
        """Fill ``outputs``; with several threads each takes a share of a large compiled batch."""
        count = len(inputs[0])
        function = self._function_for(count)
        if function is None:
            interpreter = self._interpreter or self._interpreted()
            interpreter(parameters, inputs, outputs)
            return
        shares = max(1, min(threads, count // MIN_ITEMS_PER_THREAD))
        if shares == 1:
            function(parameters, inputs, outputs)
            return

        def work(rows: slice) -> None:
            function(parameters, [x[rows] for x in inputs], [y[rows] for y in outputs])

        # Share k has the rows floor(N k / shares) to floor(N (k + 1) / shares) - 1: sizes differ by one at most.
        edges = [count * k // shares for k in range(shares + 1)]
        all_in_threads(work, [slice(begin, end) for begin, end in pairwise(edges)])

    def is_compiled_for(self, count: int) -> bool:
        """Return whether a batch would be computed by machine code; counts and compiles as a call does."""
        return self._function_for(count) is not None

    def compile(self) -> CompiledFunction | None:
        """Return machine code from the cache, or compiled now; None if it fails or ``DHKIT_KERNELS`` is ``off``."""
        if kernel_mode() == "off":
            return None
        with _compiling:
            if self._function is None and not self._failed:
                self._look_up()
            if self._function is None and not self._failed:
                self._compile()
            return self._function

    def compiled_call(self, tail: tuple[int, ...], refuses_nan: bool) -> CompiledCall | None:
        """Return the program as a function for single calls, from the cache or compiled now; None if both fail.

        Parameters
        ----------
        tail
            Axes of the result after those of the batch; the same at each call.
        refuses_nan
            Whether it refuses arguments whose result is not finite; the same at each call.
        """
        with _compiling:
            if self._call is None and not self._failed:
                try:
                    self._call = self._compiled_call(tail, refuses_nan)
                except _MACHINE_CODE_ERRORS as error:
                    self._give_up(error)
            return self._call

    def _compiled_call(self, tail: tuple[int, ...], refuses_nan: bool) -> CompiledCall:
        from dhkit.kernels import machine_code, store
        from dhkit.kernels.call_source import call_source

        name = f"{self.name}_call"
        key = store.digest(name, self._pattern)
        code = store.read(name, key)
        if code is None:
            log.info("compiling %s", name)
            source = call_source(self.program(), self.types, tail, refuses_nan=refuses_nan)
            code = machine_code.compile_module(source)
            store.write(name, key, code)
        return machine_code.CompiledCall(code)

    def __repr__(self) -> str:
        return repr_line(
            f"Kernel {self.name}", summary="interpreted" if self._function is None else "compiled"
        )

    def _function_for(self, count: int) -> CompiledFunction | None:
        """Return the machine code for a batch; None if the batch is to be interpreted.

        Existing machine code serves batches of any size; small batches never wait for compiling or loading.
        """
        mode = kernel_mode()
        if mode == "off":
            return None
        if self._function is not None or self._failed:
            return self._function
        if mode == "on" or (count >= SMALL_BATCH and not _uncounted.depth):
            self._items += count * (_STEPS_OF_A_LOOP if self._is_loop else 1)
            if mode == "on" or self._items >= COMPILE_AFTER:
                self.compile()
            elif not self._looked_up:
                with _compiling:
                    self._look_up()
        return self._function

    def _look_up(self) -> None:
        """Load machine code from the cache if it is there."""
        if self._looked_up:
            return
        try:
            from dhkit.kernels import machine_code, store

            code = store.read(self.name, store.digest(self.name, self._pattern))
            if code is not None:
                self._function = machine_code.CompiledFunction(code)
        except _MACHINE_CODE_ERRORS as error:
            self._give_up(error)
        self._looked_up = True

    def _compile(self) -> None:
        program = self.program()
        log.info("compiling %s", self.name)
        try:
            from dhkit.kernels import machine_code, store

            source = self._source(program)
            code = machine_code.compile_module(source)
            self._function = machine_code.CompiledFunction(code)
        except _MACHINE_CODE_ERRORS as error:
            self._give_up(error)
            return
        store.write(self.name, store.digest(self.name, self._pattern), code)

    def _source(self, program: Program) -> str:
        """Return the text of the kernel that is compiled."""
        if isinstance(program, Pipeline) or (isinstance(program, Loop) and not program.in_lanes):
            from dhkit.kernels.scalar_source import item_source

            return item_source(program, self.types)
        from dhkit.kernels.llvm_source import llvm_source

        return llvm_source(program, self.types)

    def _give_up(self, error: Exception) -> None:
        """Interpret from now on, so that a processor unknown to LLVM stops no computation."""
        self._failed = True
        log.warning("%s is interpreted: it cannot be compiled here (%s)", self.name, error)

    def _interpreted(self) -> Interpreter | LoopInterpreter | PipelineInterpreter:
        program = self.program()
        with _deriving:
            if self._interpreter is None:
                from dhkit.kernels.interpreter import (
                    Interpreter,
                    LoopInterpreter,
                    PipelineInterpreter,
                )

                if isinstance(program, Pipeline):
                    self._interpreter = PipelineInterpreter(program)
                elif isinstance(program, Loop):
                    self._interpreter = LoopInterpreter(program)
                else:
                    self._interpreter = Interpreter(program, self.types)
            return self._interpreter

    @property
    def mode(self) -> str:
        """Whether kernels are compiled: see :func:`kernel_mode`."""
        return kernel_mode()

    def program(self) -> Program:
        """Return the program, derived at the first call."""
        with _deriving:
            if self._graph is None:
                self._graph = self._derive().with_reciprocals()
            return self._graph


_MACHINE_CODE_ERRORS = (ImportError, OSError, RuntimeError)
"""Errors of llvmlite and the loader on machines that they do not support."""

_kernels: dict[tuple[str, str], Kernel] = {}
_compiling = threading.RLock()
"""Held while kernels are compiled and loaded. Of both locks, this one is always taken first."""
_deriving = threading.RLock()
"""Held while programs are derived, because CasADi's expressions are not thread-safe. A first answer that is interpreted
waits for this lock, not for a compilation."""


class _Uncounted(threading.local):
    depth = 0


_uncounted = _Uncounted()


@contextmanager
def compiling() -> Iterator[None]:
    """Hold the lock under which kernels are compiled: no process is forked meanwhile.

    Imports belong inside as well: a module that another thread is importing stays locked for ever in a forked child.
    """
    with _compiling:
        yield


@contextmanager
def uncounted() -> Iterator[None]:
    """Exclude this thread's batches from counting towards compiling, for calls that control loops may make.

    Yields
    ------
    None
        Nothing; the exclusion lasts until the block ends.

    Examples
    --------
    >>> from dhkit import Arm
    >>> arm = Arm.load("planar2r")
    >>> with uncounted():
    ...     T = arm.fk([0.0, 0.0])
    """
    _uncounted.depth += 1
    try:
        yield
    finally:
        _uncounted.depth -= 1


def kernel(
    name: str,
    pattern: str,
    derive: Callable[[], Program],
    types: Sequence[str] = ("float64",),
    is_loop: bool = False,
) -> Kernel:
    """Return the kernel of a program, the same one each time.

    Parameters
    ----------
    name, pattern
        Together they identify the program: ``derive`` is called only for a new one.
    derive
        Returns the program; its first input holds the parameters, which all items share.
    types
        Type of each output: float64, or uint8 for whole numbers from 0 to 255, which a loop does not have.
    is_loop
        Whether the program is a loop, so that an item takes many steps.

    Returns
    -------
    Kernel
        The kernel, interpreted until compiling pays.

    Examples
    --------
    >>> import casadi
    >>> import numpy as np
    >>> from dhkit.symbolic import Graph
    >>> p, x = casadi.SX.sym("p"), casadi.SX.sym("x")
    >>> program = Graph.of("scaled", {"parameters": p, "x": x}, {"y": p * x})
    >>> run = kernel("scaled", "", lambda: program)
    >>> y = np.empty((3, 1))
    >>> run(np.array([2.0]), [np.array([[1.0], [2.0], [3.0]])], [y])
    >>> y.ravel()
    array([2., 4., 6.])
    """
    found = _kernels.get((name, pattern))
    if found is None:
        with _deriving:
            found = _kernels.setdefault(
                (name, pattern), Kernel(name, pattern, derive, types, is_loop)
            )
            while len(_kernels) > _MAX_KERNELS:
                del _kernels[next(iter(_kernels))]
    return found


def _before_fork() -> None:
    """Wait for running compilations: LLVM's own locks would stay locked in the child."""
    _compiling.acquire()
    _deriving.acquire()


def _after_fork_in_parent() -> None:
    _deriving.release()
    _compiling.release()


def _after_fork_in_child() -> None:
    """Make new locks: the child's only thread does not hold the parent's."""
    global _compiling, _deriving
    _compiling = threading.RLock()
    _deriving = threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=_before_fork,
        after_in_parent=_after_fork_in_parent,
        after_in_child=_after_fork_in_child,
    )
