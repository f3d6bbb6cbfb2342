"""Numbers that people give, as arrays: complex values, texts and other things are refused, never cast."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]


def number_array(value: ArrayLike, name: str, shape: str) -> Array:
    """Return numbers as a float64 array, itself where it is one.

    Raises
    ------
    TypeError
        Not numbers; names the argument and the shape expected.
    """
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if isinstance(value, np.ma.MaskedArray):
        raise TypeError(f"{name}: found a masked array; expected numbers, shape {shape}")
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.empty(1, dtype=object)
    if array.dtype.kind in "fiu" or not array.size:
        return array.astype(float, copy=False)
    found = repr(value)[:60] if isinstance(value, str) else f"{type(value).__name__} of other things"
    if array.dtype.kind == "c":
        found = "complex numbers"
    raise TypeError(f"{name}: found {found}; expected numbers, shape {shape}")
