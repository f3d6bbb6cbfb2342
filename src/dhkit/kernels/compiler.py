"""The elementary functions compiled by Numba, for kernels to call, and the settings that all of them share."""

from __future__ import annotations

import types
from collections.abc import Callable, Sequence
from typing import Any

import numba
from numba.extending import intrinsic
from numba.types import boolean, float64

from dhkit.kernels import elementary

__all__ = ["absolute", "atan2", "compiled", "floor", "logical_not", "maximum", "minimum", "select", "sincos", "sqrt"]

SETTINGS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "nsz"}, "nogil": True}
"""Products may be fused into sums and the sign of zero may go; NaN must survive, so no other liberty."""


def compiled(
    inputs: int, outputs: Sequence[str], *, cache: bool
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Compile a kernel of parameters, inputs and outputs; with a cache, load it from the folder its module lies in.

    Inputs may be read-only; outputs are arrays of the named types. All are C-contiguous.
    """

    def array(kind: str, axes: int, readonly: bool) -> numba.types.Type:
        return numba.types.Array(getattr(numba.types, kind), axes, "C", readonly=readonly)

    arguments = [array("float64", 1, True), *(array("float64", 2, True) for _ in range(inputs))]
    arguments += [array(kind, 2, False) for kind in outputs]
    signature = numba.types.void(*arguments)
    return numba.njit(signature, cache=cache, boundscheck=False, **SETTINGS)  # type: ignore[no-any-return]


# What is one instruction of the machine is given to LLVM as such: a jitted function would be compiled on its own.


@intrinsic  # type: ignore[untyped-decorator]
def select(context: Any, condition: Any, true: Any, false: Any) -> Any:
    """Return one of two values without a branch."""
    signature = float64(boolean, float64, float64)
    return signature, lambda context, builder, signature, values: builder.select(*values)


def _unary(instruction: str) -> Any:
    """Return a function of one number that LLVM knows."""

    @intrinsic  # type: ignore[untyped-decorator]
    def function(context: Any, x: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.call(builder.module.declare_intrinsic(f"llvm.{instruction}", [values[0].type]), values)

        return float64(float64), code

    return function


absolute, sqrt, floor = _unary("fabs"), _unary("sqrt"), _unary("floor")


@intrinsic  # type: ignore[untyped-decorator]
def logical_not(context: Any, x: Any) -> Any:
    """Return the opposite of a condition."""
    return boolean(boolean), lambda context, builder, signature, values: builder.not_(values[0])


def _twin(function: Any) -> Callable[..., Any]:
    """Compile a function of ``elementary`` with what is compiled here in place of what it calls."""
    names = vars(elementary) | {name: globals()[name] for name in elementary.__all__ if name in globals()}
    return numba.njit(types.FunctionType(function.__code__, names), **SETTINGS)  # type: ignore[no-any-return]


minimum = _twin(elementary.minimum)
maximum = _twin(elementary.maximum)
sincos = _twin(elementary.sincos)
atan2 = _twin(elementary.atan2)
