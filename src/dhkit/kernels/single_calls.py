"""Calls for one state or a short batch, in a fraction of a microsecond: a program as a built-in function of Python.

A kernel's ordinary way spends 6 to 20 microseconds on checking, converting and allocating arrays. The function here is
machine code with CPython's own signature (``METH_FASTCALL``), see :mod:`dhkit.kernels.call_source`. It answers None for
whatever it does not take (lists, other types and layouts, large batches, errors), and the caller goes the ordinary way.
It is made after ``CALLS_BEFORE_COMPILING`` calls, in a thread, so that no call waits for it.
"""

from __future__ import annotations

import ctypes
import logging
import sys
import sysconfig
from collections.abc import Callable, Sequence
from functools import cache
from math import prod
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array
from dhkit.display import repr_line
from dhkit.kernels.background import CALLS_BEFORE_COMPILING, Background
from dhkit.kernels.call_source import (
    AXES_OFFSET,
    CONTEXT,
    DATA_OFFSET,
    DTYPE_OFFSET,
    FLAGS_OFFSET,
    FLOAT_OFFSET,
    SHAPE_OFFSET,
    TYPE_OFFSET,
    state_shapes,
    takes_lanes,
)
from dhkit.kernels.kernel import Kernel, compiling
from dhkit.symbolic import Program

if TYPE_CHECKING:
    from dhkit.kernels.machine_code import CompiledCall, CompiledFunction

log = logging.getLogger(__name__)

_METH_FASTCALL = 0x0080
_NUMPY_ABI = 0x02000000
"""NumPy's binary interface, the same for all versions 2.x."""
_GET_ABI = 0
_ARRAY_TYPE = 2
_NEW_ARRAY = 93
"""Indices in NumPy's C interface: ``PyArray_GetNDArrayCVersion``, ``PyArray_Type`` and ``PyArray_New``."""
_AGREEMENT = 1e-9
"""Largest difference from the ordinary way at which a new function is used, relative to the largest entry."""
_SEVERAL = 9
"""Number of items at which the vector kernel behind a new function is compared: more than one vector."""

FastCall: TypeAlias = Callable[..., Any]
"""Takes the states and ``out`` or None; returns the result, or None of arguments that it does not take.

The result is an array, or for a program with several outputs the pair of the first one and of ``bytes``, see
:func:`unpacked`.
"""


Agreement: TypeAlias = Callable[[Sequence[NDArray[Any]], Sequence[NDArray[Any]]], bool]
"""Tells whether two lists of outputs agree."""


def never(*_: object) -> None:
    """Take no arguments: every call goes the ordinary way."""


class SingleCall:
    """A quantity of one robot while it is not compiled: it counts calls, takes none, and replaces itself.

    Parameters
    ----------
    kernel, parameters
        The program, with one output, and the robot's values of its parameters, shape (p,).
    tail
        Axes of the result after those of the batch.
    install
        Called with the compiled function, or with :func:`never` if it cannot be made here.
    refuses_nan
        Whether a result that is not finite goes the ordinary way, which says why.
    example
        States at which a new function is compared with the kernel; arbitrary ones unless given.
    are_alike
        Tells of the function's and the kernel's outputs there, as flat arrays, whether the function may be used; by
        default whether they differ by rounding.
    counts_as
        Number of calls that one counts as, where the ordinary way takes long.
    """

    def __init__(
        self,
        kernel: Kernel,
        parameters: Array,
        tail: tuple[int, ...],
        install: Callable[[FastCall], None],
        refuses_nan: bool = False,
        example: Sequence[ArrayLike] | None = None,
        are_alike: Agreement | None = None,
        counts_as: int = 1,
    ) -> None:
        self._kernel = kernel
        self._parameters = parameters
        self._tail = tail
        self._install = install
        self._refuses_nan = refuses_nan
        self._example = example
        self._are_alike = are_alike or _are_near
        self._counts_as = counts_as
        self._background = Background(kernel.name, self._compile_in_thread)

    def __call__(self, *arguments: object) -> Any:
        """Count a call; return None, or the result where ``DHKIT_KERNELS`` is ``on``."""
        mode = self._kernel.mode
        if mode == "on":
            return self.compile()(*arguments)
        if mode == "off":
            self._install(never)
            return None
        self._background.count(self._counts_as)
        return None

    def __repr__(self) -> str:
        counted = f"{self._background.calls} of {CALLS_BEFORE_COMPILING} calls"
        return repr_line(f"SingleCall {self._kernel.name}", summary=f"not compiled, {counted}")

    def compile(self) -> FastCall:
        """Make the function now and install it; :func:`never` if it cannot be made here."""
        with compiling():
            function = self._compiled()
        self._install(function)
        return function

    def _compile_in_thread(self) -> None:
        try:
            self.compile()
        except Exception as error:
            log.warning("%s: single calls stay as they are (%s)", self._kernel.name, error)
            self._install(never)

    def _compiled(self) -> FastCall:
        if self._kernel.mode == "off" or not is_supported():
            return never
        code = self._kernel.compiled_call(self._tail, self._refuses_nan)
        if code is None:
            return never
        lanes = None
        if takes_lanes(self._kernel.program()):
            lanes = self._kernel.compile()
            if lanes is None:
                return never
        function = _bound(code, lanes, self._parameters)
        if not self._agrees(function):
            log.warning(
                "%s: the function for single calls differs from the ordinary way, and is not used",
                self._kernel.name,
            )
            return never
        return function

    def _agrees(self, function: FastCall) -> bool:
        """Whether a function gives the kernel's results at the example, and takes no list."""
        graph = self._kernel.program()
        states = [np.asarray(x) for x in self._example or _different_states(state_shapes(graph))]
        kinds = zip(graph.outputs, self._kernel.types, strict=True)
        expected: list[NDArray[Any]] = [np.empty((1, output.size), kind) for output, kind in kinds]
        rows = [state.reshape(1, -1) for state in states]
        self._kernel(self._parameters, rows, expected)

        if function(*(state.tolist() for state in states), None) is not None:
            return False
        found = function(*states, None)
        if found is None:
            return self._refuses_nan and not np.isfinite(expected[0]).all()
        if len(expected) == 1:
            batch = [np.repeat(state[None], _SEVERAL, axis=0) for state in states]
            many = function(*batch, None)
            return many is not None and all(
                self._are_alike([one], expected) for one in (found, *many)
            )
        array, packed = found
        return self._are_alike([array, *unpacked(packed, graph, self._kernel.types)], expected)


def _different_states(shapes: Sequence[tuple[int, ...]]) -> list[Array]:
    """Return states whose entries differ, between -1 and 1."""
    return [
        np.sin(np.arange(1.0, prod(shape) + 1.0) * (k + 1.0)).reshape(shape)
        for k, shape in enumerate(shapes)
    ]


def _are_near(found: Sequence[NDArray[Any]], expected: Sequence[NDArray[Any]]) -> bool:
    """Whether outputs agree to ``_AGREEMENT`` of their largest entry, and are NaN in the same entries."""
    for one, other in zip(found, expected, strict=True):
        if one.size != other.size:
            return False
        largest = np.abs(np.nan_to_num(other)).max(initial=1.0)
        difference = np.abs(one.ravel() - other.ravel().astype(float))
        same_missing = np.array_equal(np.isnan(one.ravel()), np.isnan(other.ravel()))
        if not same_missing or np.nanmax(difference, initial=0.0) > _AGREEMENT * largest:
            return False
    return True


def unpacked(packed: bytes, program: Program, types: Sequence[str]) -> list[NDArray[Any]]:
    """Return the outputs of a program after the first one from what a function packed.

    Parameters
    ----------
    packed
        The second part of a function's result.
    program, types
        The program, and the types of its outputs.

    Returns
    -------
    list
        The entries of each output, shape (size,), as new arrays.
    """
    outputs: list[NDArray[Any]] = []
    start = 0
    for output, kind in zip(program.outputs[1:], types[1:], strict=True):
        entries = np.frombuffer(packed, kind, output.size, start)
        outputs.append(entries.copy())
        start += entries.nbytes
    return outputs


class _MethodDefinition(ctypes.Structure):
    """Python's ``PyMethodDef``."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


class _Owner:
    """Owns the memory of a context, and all that its addresses point to."""

    def __init__(self, addresses: NDArray[np.uintp], *kept: object) -> None:
        self.__array_interface__ = addresses.__array_interface__
        self.kept = (addresses, *kept)


def _bound(code: CompiledCall, lanes: CompiledFunction | None, parameters: Array) -> FastCall:
    """Return machine code as a built-in function with these parameters, and with the kernel that it passes batches to.

    The function refers to its context, which is a plain array, and the array to its owner. The cycle collector does not
    follow arrays: while the function lives, it cannot clear what the function needs, the method's definition included.
    """
    numbers = np.array(parameters, dtype=float, order="C")
    addresses = np.array(
        [
            id(np.ndarray),
            id(np.dtype(np.float64)),
            id(None),
            numbers.ctypes.data,
            _numpy_interface()[_NEW_ARRAY],
            id(float),
            *map(_python_function, CONTEXT[6:-1]),
            0 if lanes is None else lanes.address,
        ],
        dtype=np.uintp,
    )
    definition = _MethodDefinition(b"single_call", code.address, _METH_FASTCALL, b"")
    context = np.asarray(_Owner(addresses, code, lanes, definition, numbers))
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype = ctypes.py_object
    make.argtypes = [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p]
    function: FastCall = make(ctypes.addressof(definition), context, None)
    return function


# What the machine code assumes of Python and NumPy


@cache
def is_supported() -> bool:
    """Whether objects lie in memory here as the machine code reads them."""
    return (
        sys.implementation.name == "cpython"
        and not sysconfig.get_config_var("Py_GIL_DISABLED")
        and sys.maxsize == 2**63 - 1
        and sys.byteorder == "little"
        and _is_main_interpreter()
        and _has_known_layout()
    )


def _is_main_interpreter() -> bool:
    """Whether this is the process's first interpreter: the objects of another one have other addresses."""
    api = ctypes.pythonapi
    for function in (api.PyInterpreterState_Get, api.PyInterpreterState_Main):
        function.restype = ctypes.c_void_p
        function.argtypes = []
    found: bool = api.PyInterpreterState_Get() == api.PyInterpreterState_Main()
    return found


def _has_known_layout() -> bool:
    """Whether NumPy's interface and array struct are those of ``CONTEXT`` and the offsets, by a look at an array."""
    try:
        interface = _numpy_interface()
    except (AttributeError, ValueError):
        return False
    abi = ctypes.CFUNCTYPE(ctypes.c_uint)(interface[_GET_ABI])()
    if abi != _NUMPY_ABI or interface[_ARRAY_TYPE] != id(np.ndarray):
        return False
    array = np.zeros((2, 3, 5))
    number = 1.5
    shape = _read(id(array) + SHAPE_OFFSET, ctypes.c_void_p)
    return (
        _read(id(array) + TYPE_OFFSET, ctypes.c_void_p) == id(np.ndarray)
        and _read(id(array) + DATA_OFFSET, ctypes.c_void_p) == array.ctypes.data
        and _read(id(array) + AXES_OFFSET, ctypes.c_int) == array.ndim
        and tuple(_read(shape + 8 * k, ctypes.c_int64) for k in range(3)) == array.shape
        and _read(id(array) + DTYPE_OFFSET, ctypes.c_void_p) == id(np.dtype(np.float64))
        and _read(id(array) + FLAGS_OFFSET, ctypes.c_int) == array.flags.num
        and _read(id(number) + FLOAT_OFFSET, ctypes.c_double) == number
    )


def _read(address: int, kind: Any) -> Any:
    return kind.from_address(address).value


@cache
def _numpy_interface() -> Any:
    """Return NumPy's table of C functions and types."""
    from numpy._core import _multiarray_umath  # type: ignore[attr-defined]

    get = ctypes.pythonapi.PyCapsule_GetPointer
    get.restype = ctypes.c_void_p
    get.argtypes = [ctypes.py_object, ctypes.c_char_p]
    table = get(_multiarray_umath._ARRAY_API, None)
    return ctypes.cast(table, ctypes.POINTER(ctypes.c_void_p))


def _python_function(name: str) -> int:
    address = ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value
    assert address is not None  # noqa: S101 - a function that Python exports
    return address
