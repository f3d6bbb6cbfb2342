"""Conversion between arrays with any batch axes and a kernel's rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array
from dhkit.description.arrays import number_array
from dhkit.kernels.kernel import Kernel
from dhkit.kernels.large_arrays import large_array


def fill(
    kernel: Kernel,
    parameters: Array,
    states: Sequence[Array],
    tail: tuple[int, ...],
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return a kernel's results, ``(..., *tail)``, for states of shape (..., n).

    Parameters
    ----------
    kernel, parameters
        The kernel and the arm's values of its parameters.
    states
        Arrays of shape (..., n); their batch axes are broadcast.
    tail
        Axes of the result after the batch axes.
    out
        Array to write into: float64, C-contiguous, of the result's shape; a new array if not given.
    threads
        Number of threads for a large batch.

    Returns
    -------
    Array
        Shape ``(..., *tail)``.

    Raises
    ------
    ValueError
        The batch axes do not broadcast, ``out`` has another shape, type or layout, or ``threads`` is below 1.

    Examples
    --------
    >>> import numpy as np
    >>> from dhkit.description import library_robot
    >>> from dhkit.kinematics.forward import tool_kernel
    >>> run, parameters = tool_kernel(library_robot("planar2r"))
    >>> fill(run, parameters, [np.zeros((5, 3, 2))], (4, 4)).shape
    (5, 3, 4, 4)
    """
    if threads != 1:
        check_whole("threads", threads, 1)
    batch = _batch(states)
    result = result_array((*batch, *tail), out)
    if not result.size:
        return result
    rows = (
        [state[None] for state in states]
        if not batch
        else [_rows(state, batch) for state in states]
    )
    # A kernel writes the first results before it has read the last inputs.
    if out is not None and any(np.may_share_memory(out, row) for row in rows):
        rows = [row.copy() for row in rows]
    kernel(parameters, rows, [result.reshape(len(rows[0]), -1)], threads)
    return result


def _batch(states: Sequence[Array]) -> tuple[int, ...]:
    """Return the batch axes that all states broadcast to."""
    first = states[0].shape[:-1]
    for state in states[1:]:
        if state.shape[:-1] != first:
            break
    else:
        return first
    shapes = [state.shape[:-1] for state in states]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        raise ValueError(
            f"the arguments' batch axes {', '.join(map(str, shapes))} do not broadcast"
        ) from None


def check_whole(name: str, value: object, least: int) -> None:
    """Check that a value is a whole number of at least ``least``.

    Parameters
    ----------
    name
        Name of the argument in messages.
    value
        Value to check.
    least
        Smallest value accepted.

    Raises
    ------
    ValueError
        It is not; gives the name, the value found and the value expected.

    Examples
    --------
    >>> check_whole("samples", 10, 1)
    >>> check_whole("samples", 0, 1)
    Traceback (most recent call last):
        ...
    ValueError: samples is 0; expected a whole number, 1 or more
    """
    if not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{name} is {value!r}; expected a whole number, {least} or more")


def pose_rows(T: ArrayLike) -> Array:
    """Return poses T as a C-contiguous float64 array (..., 4, 4), m.

    Parameters
    ----------
    T
        Poses, shape (..., 4, 4), m.

    Returns
    -------
    Array
        T itself where it is such an array already.

    Raises
    ------
    ValueError
        Another shape.
    TypeError
        Not numbers.

    Examples
    --------
    >>> import numpy as np
    >>> pose_rows(np.eye(4)).flags.c_contiguous
    True
    """
    poses = np.ascontiguousarray(number_array(T, "T", "(..., 4, 4)"))
    if poses.shape[-2:] != (4, 4):
        raise ValueError(f"T has shape {poses.shape}; expected (..., 4, 4)")
    return poses


def result_array(shape: tuple[int, ...], out: Array | None) -> Array:
    """Return ``out`` of this shape, or a new array if it is None; in any unit.

    Parameters
    ----------
    shape
        Shape of the result.
    out
        Array to write into, or None.

    Returns
    -------
    Array
        ``out``, or a new array whose values are not set.

    Raises
    ------
    ValueError
        ``out`` is not a writeable, contiguous float64 array of the shape.

    Examples
    --------
    >>> result_array((2, 3), None).shape
    (2, 3)
    """
    if out is None:
        return large_array(shape)
    if not isinstance(out, np.ndarray):
        raise ValueError(
            f"out is {type(out).__name__}; expected an array of shape {shape}, float64"
        )
    if (
        out.shape != shape
        or out.dtype != np.float64
        or not out.flags.c_contiguous
        or not out.flags.writeable
    ):
        other_layout = "Fortran" if out.flags.f_contiguous else "strided"
        layout = "C" if out.flags.c_contiguous else other_layout
        raise ValueError(
            f"out has shape {out.shape}, type {out.dtype} and layout {layout}; expected {shape}, float64, C-contiguous"
            " and writeable"
        )
    return out


def _rows(state: Array, batch: tuple[int, ...]) -> Array:
    if state.shape[:-1] != batch:
        state = np.broadcast_to(state, (*batch, state.shape[-1]))
    return np.ascontiguousarray(state).reshape(-1, state.shape[-1])
