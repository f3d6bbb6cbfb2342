"""Machine code of this processor from LLVM's text, and functions of arrays from machine code."""

from __future__ import annotations

import ctypes
import mmap
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.kernels.llvm_source import work_size
from dhkit.kernels.stages import Stage, Stages, address, aligned

_OPTIMIZATION = 2
"""LLVM's level for instruction selection and scheduling; for straight-line code no other passes are useful."""
_STAGED_ITEMS = 32
"""Largest number of items that are copied into arrays of their own."""
_ALIGNMENT = 64
"""Alignment of a block's rows, bytes."""
_SIGNATURE = ctypes.CFUNCTYPE(
    None,
    ctypes.c_void_p,  # parameters: double[p]
    ctypes.c_void_p,  # arrays: addresses of the inputs and then the outputs, each [items][size]
    ctypes.c_void_p,  # work: double[work_size], where a block's inputs and outputs are transposed
    ctypes.c_int64,  # number of items
)
"""The C function ``void kernel(double *parameters, void **arrays, double *work, int64_t items)``."""


@cache
def processor() -> tuple[str, str, str]:
    """Return this machine's triple, its processor's name and its features, as LLVM names them."""
    return (
        llvm.get_process_triple(),
        llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(),
    )


def compile_module(source: str, target: tuple[str, str, str] | None = None) -> bytes:
    """Return the object code of a module.

    Parameters
    ----------
    source
        LLVM's text.
    target
        Triple, processor and features; those of :func:`processor` if not given.

    Raises
    ------
    RuntimeError
        LLVM rejects the text, or does not know the processor.
    """
    _start()
    module = llvm.parse_assembly(source)
    module.verify()
    code: bytes = _machine(*(target or processor())).emit_object(module)
    return code


class CompiledCall:
    """The function ``call`` of object code of this processor, which Python calls; see :mod:`dhkit.kernels.call_source`.

    The code is trusted: other bytes may end the process.

    Raises
    ------
    RuntimeError
        LLVM refuses the code, or it has no such function.
    """

    def __init__(self, code: bytes) -> None:
        self._engine, self.address = _loaded(code, "call")


class CompiledFunction:
    """The function ``kernel`` of object code of this processor, called with arrays without Python's lock.

    The code is trusted: other bytes may end the process.

    Raises
    ------
    RuntimeError
        LLVM refuses the code, or it has no such function.
    """

    def __init__(self, code: bytes) -> None:
        self._engine, self.address = _loaded(code, "kernel")
        self._function = _SIGNATURE(self.address)
        self._few_items: Stages | None = None
        """Arrays for few items, made at the first call."""

    def __call__(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]
    ) -> None:
        """Fill ``outputs``; all are arrays (N, size), C-contiguous."""
        items = len(inputs[0])
        if 0 < items <= _STAGED_ITEMS:
            # Looking up addresses and allocating the work array takes longer than a few items: they are copied into
            # arrays whose addresses are already known (a stage), and their results are copied out.
            if self._few_items is None:
                self._few_items = self._stages(parameters, inputs, outputs)
            self._few_items.work(items, parameters, inputs, outputs)
            return
        for array in (*inputs, *outputs):
            # The machine code does not check its pointers.
            if not array.flags.c_contiguous or len(array) != items:
                raise ValueError(
                    f"a kernel was given an array of shape {array.shape} and strides {array.strides}"
                )
        run = self._bind(np.ascontiguousarray(parameters), [*inputs, *outputs])
        run()

    def _stages(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]
    ) -> Stages:
        """Return stages whose arrays have the sizes and types of these."""
        input_sizes = [array.shape[1] for array in inputs]
        output_types = [(array.shape[1], array.dtype) for array in outputs]
        parameter_shape = parameters.shape

        def new_stage(items: int) -> Stage:
            stage_parameters = np.zeros(parameter_shape)
            stage_inputs = [np.zeros((items, size)) for size in input_sizes]
            stage_outputs: list[NDArray[Any]] = [
                np.zeros((items, size), dtype) for size, dtype in output_types
            ]
            run = self._bind(stage_parameters, [*stage_inputs, *stage_outputs])
            return Stage(stage_parameters, stage_inputs, stage_outputs, run)

        return Stages(new_stage)

    def _bind(self, parameters: Array, arrays: Sequence[NDArray[Any]]) -> Callable[[], object]:
        """Return the function bound to these arrays, which it reads and writes each time it is called.

        The machine code knows addresses alone: the bound function keeps the arrays alive, also the work array that no
        other object refers to.
        """
        work = aligned(work_size(sum(array.shape[1] for array in arrays)), _ALIGNMENT)
        addresses = np.array([address(array) for array in arrays], dtype=np.uintp)
        arguments = (address(parameters), address(addresses), address(work), len(arrays[0]))
        kept = (parameters, arrays, addresses, work)
        return lambda function=self._function, kept=kept: function(*arguments)  # type: ignore[misc]


def _loaded(code: bytes, name: str) -> tuple[Any, int]:
    """Return the owner of loaded object code, which must be kept, and the address of a function in it."""
    _start()
    _require_executable_memory()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine(*processor()))
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    place = engine.get_function_address(name)
    if not place:
        raise RuntimeError(f"object code without a function named {name}")
    return engine, place


def _require_executable_memory() -> None:
    """Check that written memory may become executable, which a system can forbid a process; LLVM would crash.

    Raises
    ------
    OSError
        It may not.
    """
    if not hasattr(mmap, "PROT_EXEC"):
        return
    with mmap.mmap(-1, mmap.PAGESIZE, prot=mmap.PROT_READ | mmap.PROT_WRITE) as page:
        place = ctypes.addressof(ctypes.c_char.from_buffer(page))
        protect = ctypes.CDLL(None, use_errno=True).mprotect
        protect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
        if protect(place, mmap.PAGESIZE, mmap.PROT_READ | mmap.PROT_EXEC):
            raise OSError(ctypes.get_errno(), "memory may not become executable in this process")


@cache
def _start() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


def _machine(triple: str, name: str, features: str) -> Any:
    return llvm.Target.from_triple(triple).create_target_machine(
        cpu=name,
        features=features,
        opt=_OPTIMIZATION,
        reloc="static",
        codemodel="jitdefault",
        jit=True,
    )
