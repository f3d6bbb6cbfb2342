"""Poses as people state them, position with Euler angles or a quaternion, to and from homogeneous matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description.arrays import Array, number_array

ORTHONORMAL = 2e-6
"""Largest entry of R^T R - 1 of a matrix that is accepted as a rotation. Users type six decimals: errors of up to 5e-7
in each entry of R change R^T R by up to 2 sqrt(3) 5e-7 = 1.7e-6."""


def pose(
    xyz: ArrayLike = (0.0, 0.0, 0.0),
    *,
    euler: ArrayLike | None = None,
    order: str = "XYZ",
    degrees: bool = False,
    quat: ArrayLike | None = None,
) -> Array:
    """Return the homogeneous matrix of a pose.

    Parameters
    ----------
    xyz
        Position, shape (..., 3), m.
    euler
        Three angles, shape (..., 3), rad or degrees, one for each letter of ``order``.
    order
        Three axes, neighbours different. Capitals turn about the moving axes, as in SciPy: ``"XYZ"`` is Rx Ry Rz;
        small letters about the fixed ones: ``"xyz"`` is Rz Ry Rx, a URDF's rpy.
    degrees
        Whether angles are in degrees. Multiples of 90 degrees give exact zeros and ones.
    quat
        Quaternion (x, y, z, w) instead, shape (..., 4), of any length but zero.

    Returns
    -------
    Array
        Shape (..., 4, 4), m, batch axes broadcast.

    Raises
    ------
    ValueError
        Another shape or order, both euler and quat, or a quaternion of zero length.
    TypeError
        Not numbers.

    Examples
    --------
    >>> pose((0.4, 0.1, 0.2), euler=(0, 90, 0), degrees=True)[:3, 2]
    array([1., 0., 0.])
    """
    position = _array("xyz", xyz, 3)
    if euler is not None and quat is not None:
        raise ValueError("pose: both euler and quat given; expected one of them")
    if quat is not None:
        rotation = _from_quaternion(_array("quat", quat, 4))
    else:
        rotation = _from_euler(
            _array("euler", (0.0, 0.0, 0.0) if euler is None else euler, 3), order, degrees
        )
    batch = np.broadcast_shapes(position.shape[:-1], rotation.shape[:-2])
    T = np.zeros((*batch, 4, 4))
    T[..., :3, :3] = rotation
    T[..., :3, 3] = position
    T[..., 3, 3] = 1.0
    return T


def pose_parts(T: ArrayLike, *, order: str = "XYZ", degrees: bool = False) -> tuple[Array, Array]:
    """Return position and Euler angles of a pose.

    Where the first and third axis coincide exactly (gimbal lock), only the sum or difference of their angles is
    determined: the third angle is then 0, and for an order in small letters the first. Angles come from arc tangents
    alone, which keep full precision near gimbal lock.

    Parameters
    ----------
    T
        Shape (..., 4, 4), m.
    order, degrees
        As for :func:`pose`.

    Returns
    -------
    tuple[Array, Array]
        Position, shape (..., 3), m, and angles, shape (..., 3), the middle one in [-90, 90] degrees or, for an order
        that ends as it begins, in [0, 180].

    Raises
    ------
    ValueError
        Another shape or order, or a matrix that is not a rigid transform.

    Examples
    --------
    >>> xyz, angles = pose_parts(pose((1, 2, 3), euler=(10, 20, 30), degrees=True), degrees=True)
    >>> angles.round(9)
    array([10., 20., 30.])
    """
    T = check_pose(T)
    angles = _to_euler(T[..., :3, :3], order)
    return T[..., :3, 3].copy(), np.degrees(angles) if degrees else angles


def pose_quaternion(T: ArrayLike) -> Array:
    """Return the unit quaternions (x, y, z, w) with w >= 0, shape (..., 4), of poses, shape (..., 4, 4), m.

    Parameters
    ----------
    T
        Poses, shape (..., 4, 4), m.

    Returns
    -------
    Array
        Shape (..., 4): x, y, z, w, of unit length, w >= 0.

    Raises
    ------
    ValueError
        Another shape, a matrix that is not a rigid transform, or NaN.

    Examples
    --------
    >>> pose_quaternion(pose((0, 0, 0), euler=(0, 0, 180), degrees=True)).round(12) + 0.0
    array([0., 0., 1., 0.])
    """
    from scipy.spatial.transform import Rotation

    R = check_pose(T)[..., :3, :3]
    quaternions = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(canonical=True)
    return np.asarray(quaternions, dtype=float).reshape(*R.shape[:-2], 4)


def check_pose(T: ArrayLike, name: str = "T") -> Array:
    """Return T as an array of poses, shape (..., 4, 4), m; NaN passes: it stands for a pose that is not known.

    Parameters
    ----------
    T
        Poses, shape (..., 4, 4), m.
    name
        Name of the argument in messages.

    Returns
    -------
    Array
        T as float64, shape (..., 4, 4), m.

    Raises
    ------
    ValueError
        Not of shape (..., 4, 4), or some matrix is not a rigid transform within 2e-6.

    Examples
    --------
    >>> check_pose([[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]).shape
    (4, 4)
    """
    array = number_array(T, name, "(..., 4, 4)")
    if array.shape[-2:] != (4, 4):
        raise ValueError(f"{name} has shape {array.shape}; expected (..., 4, 4)")
    # R^T R = 1, det(R) = +1 and the last row (0, 0, 0, 1). NaN compares as false, and passes.
    R = array[..., :3, :3]
    defect = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(-1, -2))
    bottom = np.abs(array[..., 3, :] - (0, 0, 0, 1)).max(axis=-1)
    improper = np.linalg.det(R) < 0
    if np.any((defect > ORTHONORMAL) | (bottom > ORTHONORMAL) | improper):
        raise ValueError(
            f"{name} is not a pose: its rotation must be orthonormal, its last row 0 0 0 1"
        )
    return array


def one_pose(T: ArrayLike, name: str = "T") -> Array:
    """Return T as a single pose, shape (4, 4), m, all finite.

    Raises
    ------
    ValueError
        Another shape, values that are not finite, or no rigid transform within 2e-6.
    """
    array = number_array(T, name, "(4, 4)")
    if array.shape != (4, 4):
        raise ValueError(f"{name} has shape {array.shape}; expected (4, 4)")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has values that are not finite; expected a pose")
    return check_pose(array, name)


def inverse_pose(T: Array) -> Array:
    """Return the inverses of rigid transforms (R, p), T (..., 4, 4), m: (R^T, -R^T p)."""
    inverse = np.zeros_like(T)
    inverse[..., :3, :3] = np.swapaxes(T[..., :3, :3], -1, -2)
    inverse[..., :3, 3] = -(inverse[..., :3, :3] @ T[..., :3, 3, None])[..., 0]
    inverse[..., 3, 3] = 1.0
    return inverse


def turned_about(axis: Array, angles: Array) -> Array:
    """Return the rotations about a unit vector (3,) by angles (...), rad, shape (..., 3, 3).

    R = n n^T + cos (1 - n n^T) + sin [n].
    """
    along = np.outer(axis, axis)
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    c = np.cos(angles)[..., None, None]
    s = np.sin(angles)[..., None, None]
    rotations: Array = along + c * (np.eye(3) - along) + s * across
    return rotations


def _array(name: str, value: ArrayLike, size: int) -> Array:
    """Return a value as an array of numbers, shape (..., size)."""
    array = number_array(value, name, f"(..., {size})")
    if array.shape[-1:] != (size,):
        raise ValueError(f"{name} has shape {array.shape}; expected (..., {size})")
    return array


def _axes(order: str) -> tuple[tuple[int, int, int], bool]:
    """Return the indices i, j, k (0 for x) of R = R_i R_j R_k, and whether the order is extrinsic (about fixed axes).

    Rotations about fixed axes are multiplied in the reverse order of their letters.
    """
    upper = order.upper()
    intrinsic = order == upper
    extrinsic = order == order.lower()
    if (
        len(order) != 3
        or set(upper) - set("XYZ")
        or not (intrinsic or extrinsic)
        or upper[1] in (upper[0], upper[2])
    ):
        raise ValueError(
            f"order is {order!r}; expected three of XYZ (moving) or xyz (fixed), neighbours different"
        )
    first, second, third = ("XYZ".index(letter) for letter in (upper if intrinsic else upper[::-1]))
    return (first, second, third), extrinsic


def _cos_sin(angles: Array, degrees: bool) -> tuple[Array, Array]:
    """Return cosines and sines of angles, rad or degrees; those of right angles in degrees are exact."""
    if not degrees:
        return np.cos(angles), np.sin(angles)
    # Multiples of 90 degrees are split off in degrees, which is exact, so that 90 degrees have the cosine 0.
    quarter = np.round(angles / 90.0)
    remainder = np.radians(angles - 90.0 * quarter)
    c = np.cos(remainder)
    s = np.sin(remainder)

    # cos(90 k + r) and sin(90 k + r) for k mod 4 = 0, 1, 2 and 3.
    quadrant = np.where(np.isfinite(quarter), np.mod(quarter, 4), 0)
    cosine = np.select([quadrant == 0, quadrant == 1, quadrant == 2], [c, -s, -c], s)
    sine = np.select([quadrant == 0, quadrant == 1, quadrant == 2], [s, c, -s], -c)
    return cosine + 0.0, sine + 0.0  # no -0.0


def _from_euler(angles: Array, order: str, degrees: bool) -> Array:
    """Return R = R_i(p) R_j(q) R_k(r), shape (..., 3, 3); angles about fixed axes are multiplied in reverse order."""
    axes, extrinsic = _axes(order)
    cosines, sines = _cos_sin(angles[..., ::-1] if extrinsic else angles, degrees)
    rotation = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
    for k, axis in enumerate(axes):
        factor = np.zeros((*angles.shape[:-1], 3, 3))

        # The axes (axis, i, j) are right-handed: the rotation turns i towards j.
        i = (axis + 1) % 3
        j = (axis + 2) % 3
        factor[..., axis, axis] = 1.0
        factor[..., i, i] = factor[..., j, j] = cosines[..., k]
        factor[..., i, j] = -sines[..., k]
        factor[..., j, i] = sines[..., k]
        rotation = rotation @ factor
    return rotation


def _to_euler(R: Array, order: str) -> Array:
    """Return the angles of R = R_i(first) R_j(middle) R_k(third) (Shoemake, Graphics Gems IV, 1994).

    o is the axis that is neither i nor j, and e = +1 where (i, j, o) is right-handed, -1 otherwise. With p, q and r for
    the three angles, the entries that are used are

        k = o:  R_io = e sin q,    (R_ii, R_ij) = cos q (cos r, -e sin r),    (R_jo, R_oo) = cos q (-e sin p, cos p);
        k = i:  R_ii = cos q,      (R_ji, R_oi) = sin q (sin p, -e cos p);
        gimbal lock, r = 0:        (R_jj, R_oj) = (cos p, e sin p).
    """
    (i, j, k), extrinsic = _axes(order)
    o = 3 - i - j
    parity = 1.0 if (j - i) % 3 == 1 else -1.0
    ends_as_it_begins = i == k
    if ends_as_it_begins:
        level = np.hypot(R[..., j, i], R[..., o, i])
        first = np.arctan2(R[..., j, i], -parity * R[..., o, i])
        middle = np.arctan2(level, R[..., i, i])
    else:
        level = np.hypot(R[..., i, i], R[..., i, j])
        first = np.arctan2(-parity * R[..., j, k], R[..., k, k])
        middle = np.arctan2(parity * R[..., i, k], level)
    locked = level == 0.0
    first = np.where(locked, np.arctan2(parity * R[..., o, j], R[..., j, j]), first)

    # Row j of R_i(-p) R = R_j(q) R_k(r) is that of R_k(r): (R_ji, R_jj) = (e sin r, cos r) for k = o, (R_jj, R_jo) =
    # (cos r, -e sin r) for k = i. It depends on the third angle alone, however near gimbal lock is.
    c = np.cos(first)
    s = np.sin(first)
    row = c[..., None] * R[..., j, :] + parity * s[..., None] * R[..., o, :]
    sine = -row[..., o] if ends_as_it_begins else row[..., i]
    third = np.where(locked, 0.0, np.arctan2(parity * sine, row[..., j]))
    angles = np.stack([first, middle, third], axis=-1) + 0.0
    return angles[..., ::-1] if extrinsic else angles


def _from_quaternion(quaternion: Array) -> Array:
    """Return the rotations of quaternions (x, y, z, w) of any length, shapes (..., 3, 3) and (..., 4)."""
    norm = np.linalg.norm(quaternion, axis=-1, keepdims=True)
    if np.any(norm == 0.0):
        raise ValueError("quat has zero length; expected (x, y, z, w) of a rotation")
    x, y, z, w = np.moveaxis(quaternion / norm, -1, 0)

    # R = 1 + 2 w [v]_x + 2 [v]_x^2 with v = (x, y, z) (Euler-Rodrigues).
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
