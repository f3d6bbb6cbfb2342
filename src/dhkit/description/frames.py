"""DH frames by a plain product of the table's matrices, for one state or a batch; checks of joint arguments."""

from __future__ import annotations

from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description.arrays import Array, number_array
from dhkit.description.robot import Description, description_of, takes_robot
from dhkit.description.values import Convention

_RATE_NAMES = ("qd", "tau", "start_velocity", "goal_velocity")
"""Beginnings of the names of arguments that hold speeds, accelerations or torques: no configuration has a value."""

S = TypeVar("S", bound="_Sliceable")


class _Sliceable(Protocol):
    """An array or a list: a slice of it has its own type."""

    def __getitem__(self: S, index: slice, /) -> S:
        """Return some of the entries."""


def joint_array(description: Description, q: ArrayLike, name: str = "q") -> Array:
    """Return an array of joint values; positions may be given by configurations' names, alone or in a list.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m, or names.
    name
        The argument's name, for messages.

    Returns
    -------
    Array
        Shape (..., n), rad and m.

    Raises
    ------
    ValueError
        Another last axis than n, or no configuration of that name.
    TypeError
        Not numbers.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("puma560")
    >>> joint_array(arm, "ready").round(4)
    array([ 0.    ,  1.5708, -1.5708,  0.    ,  0.    ,  0.    ])
    >>> joint_array(arm, ["zero", "ready"]).shape
    (2, 6)
    """
    if type(q) is not np.ndarray:
        if isinstance(q, str) and not name.startswith(_RATE_NAMES):
            return configuration(description, q, name)
        if isinstance(q, (list, tuple)) and any(isinstance(row, str) for row in q):
            rows = [joint_array(description, row, name) for row in q]
            if any(row.shape != rows[0].shape for row in rows):
                shapes = ", ".join(str(row.shape) for row in rows)
                raise ValueError(f"{name} has rows of shapes {shapes}; expected equal ones")
            return np.stack(rows)
    array = number_array(q, name, "(..., n)")
    if array.shape[-1:] != (description.n,):
        raise ValueError(
            f"{name} has shape {array.shape}; expected (..., {description.n}) for {description.name}"
        )
    return array


def configuration(description: Description, name: str, argument: str = "q") -> Array:
    """Return a configuration's joint values by its name, shape (n,), rad and m.

    Raises
    ------
    ValueError
        The robot has none of that name; ``argument`` begins the message.
    """
    known = description_of(description).numbers.configurations
    if name not in known:
        raise ValueError(
            f"{argument}: {description.name} has no configuration {name[:60]!r}; it has {', '.join(known) or 'none'}"
        )
    return known[name]


def joint_vector(description: Description, q: ArrayLike, name: str = "q") -> Array:
    """Return the joint values of one state, shape (n,), rad and m, all finite.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (n,), or the name of a configuration.
    name
        Name of the argument in messages.

    Returns
    -------
    Array
        Shape (n,), rad and m.

    Raises
    ------
    ValueError
        Another shape, or a value that is not finite.
    TypeError
        Not numbers.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> joint_vector(library_robot("planar2r"), [0.1, 0.2])
    array([0.1, 0.2])
    >>> joint_vector(library_robot("planar2r"), [0.1, 0.2, 0.3])
    Traceback (most recent call last):
        ...
    ValueError: q has shape (3,); expected (..., 2) for planar2r
    """
    vector = joint_array(description, q, name)
    if vector.shape != (description.n,):
        raise ValueError(f"{name} has shape {vector.shape}; expected ({description.n},)")
    if not np.isfinite(vector).all():
        raise ValueError(
            f"{name} has values that are not finite: {vector.tolist()}; expected finite values"
        )
    return vector


def one_each(value: ArrayLike, name: str, n: int) -> Array:
    """Return a number for each joint, shape (n,), in the unit of ``value``: n numbers, or one repeated n times.

    Raises
    ------
    ValueError
        Another shape.
    TypeError
        Not numbers.
    """
    array = number_array(value, name, f"({n},) or ()")
    if array.shape not in ((), (n,)):
        raise ValueError(f"{name} has shape {array.shape}; expected ({n},) or one number")
    return np.broadcast_to(array, (n,))


@takes_robot
def link_transforms(description: Description, q: ArrayLike) -> Array:
    """Return the table's matrices A_1 ... A_n, in closed form: the plain path that kernels are checked against.

    Derived independently of :func:`dhkit.description.exact_poses.fixed_row`, the product of elementary exact
    transforms, and of the origins of :mod:`dhkit.model.urdf`.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.

    Returns
    -------
    Array
        Shape (..., n, 4, 4): A_i maps coordinates in frame i to frame i - 1, m. NaN rows where q is not finite.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n), or is not numeric.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> A = link_transforms(library_robot("planar2r"), [0.0, 0.0])
    >>> A.shape
    (2, 4, 4)
    >>> A[0][:3, 3]  # the origin of frame 1 in frame 0, m
    array([0.5, 0. , 0. ])
    """
    numbers = description.numbers
    q = joint_array(description, q)
    missing = ~np.all(np.isfinite(q), axis=-1)
    q = np.where(missing[..., None], np.nan, q)

    # A_i = Rz(theta) Tz(d) Tx(a) Rx(alpha) in the standard convention, Tx(a) Rx(alpha) Rz(theta) Tz(d) in the modified
    # one; q is added to theta of a revolute joint, to d of a prismatic one.
    angle = np.where(numbers.prismatic, 0.0, q)
    offset = np.where(numbers.prismatic, q, 0.0)
    cos_q = np.cos(angle)
    sin_q = np.sin(angle)

    # The table's own theta enters by the addition theorem, so that an offset of 90 degrees is exact:
    #     cos(q + theta) = cos(q) cos(theta) - sin(q) sin(theta),
    #     sin(q + theta) = sin(q) cos(theta) + cos(q) sin(theta).
    cos_theta = cos_q * numbers.cos_theta - sin_q * numbers.sin_theta
    sin_theta = sin_q * numbers.cos_theta + cos_q * numbers.sin_theta
    cos_alpha = numbers.cos_alpha
    sin_alpha = numbers.sin_alpha
    a = numbers.a
    d = numbers.d + offset

    A = np.zeros((*q.shape, 4, 4))
    A[..., 3, 3] = 1.0
    A[..., 0, 0] = cos_theta
    A[..., 2, 2] = cos_alpha
    if description.convention is Convention.STANDARD:
        A[..., 0, 1] = -sin_theta * cos_alpha
        A[..., 0, 2] = sin_theta * sin_alpha
        A[..., 0, 3] = a * cos_theta
        A[..., 1, 0] = sin_theta
        A[..., 1, 1] = cos_theta * cos_alpha
        A[..., 1, 2] = -cos_theta * sin_alpha
        A[..., 1, 3] = a * sin_theta
        A[..., 2, 1] = sin_alpha
        A[..., 2, 3] = d
    else:
        A[..., 0, 1] = -sin_theta
        A[..., 0, 3] = a
        A[..., 1, 0] = sin_theta * cos_alpha
        A[..., 1, 1] = cos_theta * cos_alpha
        A[..., 1, 2] = -sin_alpha
        A[..., 1, 3] = -sin_alpha * d
        A[..., 2, 0] = sin_theta * sin_alpha
        A[..., 2, 1] = cos_theta * sin_alpha
        A[..., 2, 3] = cos_alpha * d
    A[missing] = np.nan
    return A


def carrying(convention: Convention, frames: S) -> S:
    """Return the n of frames 0 ... n along whose z axes the joints move.

    Joint i moves about or along z_(i-1) in the standard convention, z_i in the modified one.
    """
    return frames[:-1] if convention is Convention.STANDARD else frames[1:]


@takes_robot
def world_to_frames(description: Description, q: ArrayLike) -> Array:
    """Return DH frames 0 ... n in the world, shape (..., n+1, 4, 4), m.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.

    Returns
    -------
    Array
        Shape (..., n+1, 4, 4), m; NaN where q is not finite.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n), or is not numeric.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> T = world_to_frames(library_robot("planar2r"), [0.0, 0.0])
    >>> T[:, 0, 3]  # x of the frames' origins, m
    array([0. , 0.5, 0.9])
    """
    # T_0 = base,  T_i = T_(i-1) A_i
    A = link_transforms(description, q)
    frames = np.empty((*A.shape[:-3], description.n + 1, 4, 4))
    frames[..., 0, :, :] = description.numbers.T_world_base
    frames[..., 0, :, :] += 0.0 * A[..., 0, :, :]  # frame 0 is NaN too in a state that is NaN
    for i in range(description.n):
        np.matmul(frames[..., i, :, :], A[..., i, :, :], out=frames[..., i + 1, :, :])
    return frames


@takes_robot
def world_to_tool(description: Description, q: ArrayLike) -> Array:
    """Return the tool's frame in the world, shape (..., 4, 4), m: base A_1 ... A_n tool.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.

    Returns
    -------
    Array
        Shape (..., 4, 4), m; NaN where q is not finite.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n), or is not numeric.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> world_to_tool(library_robot("planar2r"), [0.0, 0.0])[:3, 3]
    array([0.9, 0. , 0. ])
    """
    return world_to_frames(description, q)[..., -1, :, :] @ description.numbers.T_last_tool


_GEOMETRY = ("theta", "d", "a", "alpha", "T_world_base", "T_last_tool")
"""Fields of :class:`~dhkit.description.numbers.Numbers` that decide where the frames are."""


def has_same_geometry(first: Description, second: Description) -> bool:
    """Return whether all frames of two arms are at the same places for equal joint values; their bodies may differ."""
    if first.convention is not second.convention or first.kinds != second.kinds:
        return False
    return all(
        np.array_equal(getattr(first.numbers, name), getattr(second.numbers, name))
        for name in _GEOMETRY
    )
