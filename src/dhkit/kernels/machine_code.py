"""From LLVM's text to machine code of this processor, and from machine code to a function of arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.kernels.llvm_source import BLOCK

__all__ = ["CompiledFunction", "compiled", "processor"]

OPTIMIZATION = 2
"""Of instruction selection and scheduling; a straight-line body of vectors leaves other passes nothing to do."""
ALIGNMENT = 64
"""Bytes: of a block's rows."""
SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)


@cache
def processor() -> tuple[str, str, str]:
    """Return this machine's triple, its processor's name and its features, as LLVM names them."""
    return llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def compiled(source: str, target: tuple[str, str, str] | None = None) -> bytes:
    """Return the object code of a module.

    Parameters
    ----------
    source
        LLVM's text.
    target
        Triple, processor and features, as of :func:`processor`, which is the default.

    Raises
    ------
    RuntimeError
        LLVM does not take the text, or does not know the processor.
    """
    _start()
    module = llvm.parse_assembly(source)
    module.verify()
    code: bytes = _machine(*(target or processor())).emit_object(module)
    return code


class CompiledFunction:
    """The function ``kernel`` of object code of this processor, called with arrays; it lets go of Python's lock.

    The code is trusted: what is no object code of this processor may end the process.

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
        address = self._engine.get_function_address("kernel")
        if not address:
            raise RuntimeError("object code without a function named kernel")
        self._function = SIGNATURE(address)

    def __call__(self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]) -> None:
        """Fill ``outputs``; all are arrays (N, size), C-contiguous."""
        arrays = (*inputs, *outputs)
        count = len(arrays[0])
        for array in (parameters, *arrays):
            # The machine code trusts its pointers.
            if not array.flags.c_contiguous or (array is not parameters and len(array) != count):
                raise ValueError(f"a kernel was given an array of shape {array.shape} and strides {array.strides}")
        columns = sum(array.shape[1] for array in arrays)
        work = np.empty(columns * BLOCK + ALIGNMENT // 8)
        start = -(-_address(work) // ALIGNMENT) * ALIGNMENT
        addresses = np.array([_address(array) for array in arrays], dtype=np.uintp)
        self._function(_address(parameters), _address(addresses), start, count)


def _address(array: NDArray[Any]) -> int:
    address: int = array.__array_interface__["data"][0]
    return address


@cache
def _start() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


def _machine(triple: str, name: str, features: str) -> Any:
    return llvm.Target.from_triple(triple).create_target_machine(
        cpu=name, features=features, opt=OPTIMIZATION, reloc="static", codemodel="jitdefault", jit=True
    )
