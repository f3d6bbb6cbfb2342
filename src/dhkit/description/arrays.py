"""Array arguments of the public functions: converted to float64, or refused with the argument's name."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
_FLOAT64 = np.dtype(np.float64)
"""Compared by identity, which takes half the time of an equality, in every call of a public function."""


def number_array(value: ArrayLike, name: str, shape: str) -> Array:
    """Return an argument as a float64 array; a float64 array is returned as it is, not copied.

    Complex numbers, texts and masked arrays are refused and never cast.

    Parameters
    ----------
    value
        Numbers of any shape and unit, unchecked: the caller compares the shape.
    name, shape
        The argument's name and expected shape, for the message.

    Raises
    ------
    TypeError
        Not numbers; names the argument and the shape expected.
    """
    if type(value) is np.ndarray and value.dtype is _FLOAT64:
        return value
    if isinstance(value, np.ma.MaskedArray):
        raise TypeError(f"{name}: found a masked array; expected numbers, shape {shape}")
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.empty(1, dtype=object)
    if array.dtype.kind in "fiu" or not array.size:
        return array.astype(float, copy=False)
    kind = repr(value)[:60] if isinstance(value, str) else f"{type(value).__name__} of other things"
    raise TypeError(
        f"{name}: found {'complex numbers' if array.dtype.kind == 'c' else kind}; expected numbers, shape {shape}"
    )
