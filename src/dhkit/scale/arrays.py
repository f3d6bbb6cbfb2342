"""Batches of states as arrays of dask, in and out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.kinematics.workspace import CHUNK
from dhkit.scale.clusters import dask_module

if TYPE_CHECKING:
    DaskArray: TypeAlias = Any
    """An array of dask, ``dask.array.Array``."""


def map_states(
    function: Callable[..., ArrayLike],
    *arrays: ArrayLike | DaskArray,
    tail: tuple[int, ...],
    dtype: DTypeLike = float,
    chunk: int = CHUNK,
) -> DaskArray:
    """Return an array of dask whose blocks are a function of blocks of states.

    Nothing is computed before dask is asked to, by whatever scheduler it uses.

    Parameters
    ----------
    function
        Takes an array of some rows of each array, and returns one of as many rows; it can be pickled.
    *arrays
        Arrays of dask or NumPy, shape (N, ...), each with N rows.
    tail
        Shape of a row of the result.
    dtype
        Type of the result.
    chunk
        Rows in a block of arrays that are not of dask.

    Returns
    -------
    DaskArray
        Rows of shape ``tail``, in the blocks of the first array.

    Raises
    ------
    MissingPackageError
        The extra ``scale`` is not installed.
    ValueError
        No array, or arrays of other numbers of rows.

    Examples
    --------
    >>> import numpy as np
    >>> speeds = map_states(lambda qd: np.linalg.norm(qd, axis=1), np.ones((1000, 4)), tail=())
    >>> speeds.shape, float(speeds.compute().max())
    ((1000,), 2.0)
    """
    da = dask_module("dask.array")
    if not arrays:
        raise ValueError("no arrays; expected one or more")
    rows = [_in_blocks(da, array, chunk) for array in arrays]
    sizes = {len(array) for array in rows}
    if len(sizes) > 1:
        raise ValueError(f"arrays have {sorted(sizes)} rows; expected as many in each")

    # Axis 0 is that of the rows; all other axes have a label of their own, and one block.
    labels = count(1)
    new = [next(labels) for _ in tail]
    pairs: list[object] = []
    for array in rows:
        pairs += [array, (0, *(next(labels) for _ in array.shape[1:]))]
    return da.blockwise(
        function,
        (0, *new),
        *pairs,
        token=getattr(function, "name", None),
        new_axes=dict(zip(new, tail, strict=True)),
        concatenate=True,
        dtype=np.dtype(dtype),
        meta=np.empty((0,) * (1 + len(tail)), dtype),
    )


def _in_blocks(da: Any, array: ArrayLike | DaskArray, chunk: int) -> DaskArray:
    """Return an array of dask whose blocks have whole rows."""
    if not isinstance(array, da.Array):
        array = np.asarray(array)
        if not array.ndim:
            raise ValueError("found a number; expected an array with a row for each state")
        array = da.from_array(array, chunks=(chunk, *array.shape[1:]))
    return array.rechunk(dict.fromkeys(range(1, array.ndim), -1))


@dataclass(frozen=True)
class _Method:
    """A method of an arm as a function of arrays that can be sent to workers: an arm is 4 to 13 kB."""

    arm: Arm
    name: str

    def __call__(self, *arrays: Array) -> Array:
        result: Array = getattr(self.arm, self.name)(*arrays)
        return result


@dataclass(frozen=True)
class _Solutions:
    """Joint values of all solutions of the inverse kinematics, as a function that can be sent to workers."""

    arm: Arm
    name: ClassVar[str] = "ik"

    def __call__(self, T: Array) -> Array:
        return self.arm.ik(T).q


def fk(arm: Arm, q: ArrayLike | DaskArray) -> DaskArray:
    """Return the poses of the tool in the world, shape (N, 4, 4), as an array of dask; see :meth:`dhkit.Arm.fk`.

    Parameters
    ----------
    arm
        The arm.
    q
        Joint values, shape (N, n), rad and m, of dask or NumPy.

    Returns
    -------
    DaskArray
        Shape (N, 4, 4), m.

    Examples
    --------
    >>> import dask.array as da
    >>> arm = Arm.load("puma560")
    >>> q = da.random.default_rng(0).uniform(-1, 1, (100_000, 6), chunks=(50_000, 6))
    >>> fk(arm, q)[:, 2, 3].mean().compute().round(2)
    np.float64(0.98)
    """
    return map_states(_Method(arm, "fk"), q, tail=(4, 4))


def jacobian(arm: Arm, q: ArrayLike | DaskArray) -> DaskArray:
    """Return the Jacobians of the tool, shape (N, 6, n), as an array of dask; see :meth:`dhkit.Arm.jacobian`.

    Parameters
    ----------
    arm
        The arm.
    q
        Joint values, shape (N, n), rad and m, of dask or NumPy.

    Returns
    -------
    DaskArray
        Shape (N, 6, n), in world axes.

    Examples
    --------
    >>> import numpy as np
    >>> jacobian(Arm.load("planar2r"), np.zeros((1000, 2))).shape
    (1000, 6, 2)
    """
    return map_states(_Method(arm, "jacobian"), q, tail=(6, arm.n))


def ik(arm: Arm, T: ArrayLike | DaskArray) -> DaskArray:
    """Return all solutions of poses, shape (N, B, n), as an array of dask; see :meth:`dhkit.Arm.ik`.

    Parameters
    ----------
    arm
        The arm.
    T
        Poses of the tool in the world, shape (N, 4, 4), m, of dask or NumPy.

    Returns
    -------
    DaskArray
        Joint values of B branches, shape (N, B, n), rad and m; NaN where a branch does not reach the pose.

    Raises
    ------
    ModelError
        The arm has no closed form, and prismatic joints or not six or seven.

    Examples
    --------
    >>> import numpy as np
    >>> arm = Arm.load("puma560")
    >>> ik(arm, fk(arm, np.zeros((1000, 6)))).shape
    (1000, 8, 6)
    """
    branches = _Solutions(arm)(arm.fk(np.zeros((1, arm.n)))).shape[1]
    return map_states(_Solutions(arm), T, tail=(branches, arm.n))


def inverse_dynamics(
    arm: Arm,
    q: ArrayLike | DaskArray,
    qd: ArrayLike | DaskArray,
    qdd: ArrayLike | DaskArray,
) -> DaskArray:
    """Return joint torques, shape (N, n), as an array of dask; see :meth:`dhkit.Arm.inverse_dynamics`.

    Parameters
    ----------
    arm
        The arm.
    q, qd, qdd
        Joint values, rates and accelerations, shape (N, n) each, rad, m, s, of dask or NumPy.

    Returns
    -------
    DaskArray
        Shape (N, n), N m and N.

    Examples
    --------
    >>> import numpy as np
    >>> rest = np.zeros((1000, 2))
    >>> inverse_dynamics(Arm.load("planar2r"), rest, rest, rest).shape
    (1000, 2)
    """
    return map_states(_Method(arm, "inverse_dynamics"), q, qd, qdd, tail=(arm.n,))


def forward_dynamics(
    arm: Arm,
    q: ArrayLike | DaskArray,
    qd: ArrayLike | DaskArray,
    tau: ArrayLike | DaskArray,
) -> DaskArray:
    """Return joint accelerations, shape (N, n), as an array of dask; see :meth:`dhkit.Arm.forward_dynamics`.

    Parameters
    ----------
    arm
        The arm.
    q, qd, tau
        Joint values, rates and torques, shape (N, n) each, rad, m, s, N m and N, of dask or NumPy.

    Returns
    -------
    DaskArray
        Shape (N, n), rad/s^2 and m/s^2.

    Examples
    --------
    >>> import numpy as np
    >>> rest = np.zeros((1000, 2))
    >>> forward_dynamics(Arm.load("planar2r"), rest, rest, rest).shape
    (1000, 2)
    """
    return map_states(_Method(arm, "forward_dynamics"), q, qd, tau, tail=(arm.n,))
