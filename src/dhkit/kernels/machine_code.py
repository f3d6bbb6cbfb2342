"""Machine code of this processor from LLVM's text, and functions of arrays from machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.kernels.llvm_source import BLOCK
from dhkit.kernels.stages import Stage, Stages, address, aligned

_OPTIMIZATION = 2
"""LLVM's level for instruction selection and scheduling; for straight-line code no other passes are useful."""
_ALIGNMENT = 64
"""Alignment of a block's rows, bytes."""
_SIGNATURE = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64
)


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


class CompiledFunction:
    """The function ``kernel`` of object code of this processor, called with arrays without Python's lock.

    The code is trusted: other bytes may end the process.

    Raises
    ------
    RuntimeError
        LLVM refuses the code, or it has no such function.
    """

    def __init__(self, code: bytes) -> None:
        _start()
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine(*processor()))
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        place = self._engine.get_function_address("kernel")
        if not place:
            raise RuntimeError("object code without a function named kernel")
        self._function = _SIGNATURE(place)
        self._alone: Stages | None = None
        """Stages for single items."""

    def __call__(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]
    ) -> None:
        """Fill ``outputs``; all are arrays (N, size), C-contiguous."""
        count = len(inputs[0])
        if count == 1:
            stages = self._alone or self._stages(parameters, inputs, outputs)
            stages.work(1, parameters, inputs, outputs)
            return
        for array in (*inputs, *outputs):
            # The machine code does not check its pointers.
            if not array.flags.c_contiguous or len(array) != count:
                raise ValueError(
                    f"a kernel was given an array of shape {array.shape} and strides {array.strides}"
                )
        self._call(np.ascontiguousarray(parameters), [*inputs, *outputs])()

    def _stages(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]
    ) -> Stages:
        """Return stages for single items of arrays such as these."""
        sizes = [array.shape[1] for array in inputs]
        kinds = [(array.shape[1], array.dtype) for array in outputs]

        def staged(items: int) -> Stage:
            own = np.zeros(parameters.shape)
            read = [np.zeros((items, size)) for size in sizes]
            written: list[NDArray[Any]] = [np.zeros((items, size), kind) for size, kind in kinds]
            return Stage(own, read, written, self._call(own, [*read, *written]))

        self._alone = Stages(staged)
        return self._alone

    def _call(self, parameters: Array, arrays: Sequence[NDArray[Any]]) -> Callable[[], object]:
        """Return a call of the function with these arrays, which it keeps."""
        work = aligned(sum(array.shape[1] for array in arrays) * BLOCK, _ALIGNMENT)
        addresses = np.array([address(array) for array in arrays], dtype=np.uintp)
        kept = (parameters, arrays, addresses, work)
        places = (address(parameters), address(addresses), address(work), len(arrays[0]))
        return lambda function=self._function, kept=kept: function(*places)  # type: ignore[misc]


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
