"""The regressor in numbers: torques are linear in the links' inertial parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import INERTIA_PLACES, Array, Description, joint_array, takes_robot
from dhkit.description.frames import carrying, world_to_frames


@takes_robot
def inertial_parameters(description: Description) -> Array:
    """Return the links' inertial parameters, shape (10 n,), that :func:`regressor` is to be multiplied by.

    Ten for each link: mass, kg, first moments m c, kg m, and second moments xx, yy, zz, xy, yz, xz about its DH frame's
    origin, kg m^2, in the axes of that frame: m2, rx2, ry2, rz2, Ixx2, Iyy2, Izz2, Ixy2, Iyz2, Ixz2.
    """
    return description.numbers.inertial_parameters.ravel()


@takes_robot
def regressor(description: Description, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
    """Return Y with tau = Y theta + B qdd, B ``numbers.drive_inertia``, theta of :func:`inertial_parameters`.

    The force and moment that a link needs are linear in its parameters (Atkeson, An & Hollerbach, 1986, eq. 8); the
    joints before it feel them by the principle of virtual work.

    Parameters
    ----------
    description
        The robot; its links' bodies do not matter.
    q, qd, qdd
        Joint values, rates and accelerations, shapes (..., n), rad, m and seconds; batch axes broadcast.

    Returns
    -------
    Array
        Shape (..., n, 10 n); NaN where a state is not finite.

    Raises
    ------
    ValueError, TypeError
        An argument of another shape, or not numeric.
    """
    n = description.n
    prismatic = description.numbers.prismatic
    q, qd, qdd = np.broadcast_arrays(
        joint_array(description, q, "q"),
        joint_array(description, qd, "qd"),
        joint_array(description, qdd, "qdd"),
    )
    frames = np.moveaxis(world_to_frames(description, q), -3, 0)
    origins = frames[..., :3, 3]
    # The frames whose z axis and origin lie on the joints' axes.
    carriers = carrying(description.convention, frames)

    # Everything is in world axes. Gravity acts like an acceleration of the base upwards.
    w, wd = np.zeros((2, *q.shape[:-1], 3))
    a = np.broadcast_to(-description.numbers.gravity, w.shape)
    Y = np.zeros((*q.shape, 10 * n))
    for i in range(n):
        z = carriers[i][..., :3, 2]
        on_axis = carriers[i][..., :3, 3]
        v = qd[..., i, None]
        vd = qdd[..., i, None]
        if prismatic[i]:
            # a_i = a_(i-1) + wd x r + w x (w x r) + 2 w x z qd + z qdd
            lever = origins[i + 1] - origins[i]
            a = a + _relative_acceleration(w, wd, lever) + 2 * v * np.cross(w, z) + vd * z
        else:
            # To a point on the axis with the link before, then on to the origin with the link itself:
            # wd_i = wd_(i-1) + z qdd + w_(i-1) x z qd,  w_i = w_(i-1) + z qd
            a = a + _relative_acceleration(w, wd, on_axis - origins[i])
            wd = wd + vd * z + v * np.cross(w, z)
            w = w + v * z
            a = a + _relative_acceleration(w, wd, origins[i + 1] - on_axis)

        # The torque at joint j is the component along its axis of the force, or of the moment about a point on it.
        force, moment = _force_and_moment(frames[i + 1][..., :3, :3], w, wd, a)
        for j in range(i + 1):
            z = carriers[j][..., :3, 2]
            effort = force
            if not prismatic[j]:
                lever = origins[i + 1] - carriers[j][..., :3, 3]
                effort = moment + np.cross(lever[..., None], force, axisa=-2, axisb=-2, axisc=-2)
            Y[..., j, 10 * i : 10 * i + 10] = np.einsum("...k,...kp->...p", z, effort)
    Y[~np.isfinite(q + qd + qdd).all(axis=-1)] = np.nan
    return Y


def _relative_acceleration(w: Array, wd: Array, r: Array) -> Array:
    """Return the acceleration of a point at r from another point of a link: wd x r + w x (w x r)."""
    return np.cross(wd, r) + np.cross(w, np.cross(w, r))


def _force_and_moment(R: Array, w: Array, wd: Array, a: Array) -> tuple[Array, Array]:
    """Return a link's force and moment about its frame's origin, world axes, as matrices (..., 3, 10).

    They are multiplied by mass, first moments and second moments in the link's axes, whose rotation is R.
    """
    # R^T: in the axes of the link.
    w = np.einsum("...ji,...j->...i", R, w)
    wd = np.einsum("...ji,...j->...i", R, wd)
    a = np.einsum("...ji,...j->...i", R, a)

    # Force m a + ([wd]x + [w]x [w]x) m c, moment -[a]x m c + I wd + [w]x I w
    force, moment = np.zeros((2, *w.shape, 10))
    W = _cross_matrix(w)
    force[..., :, 0] = a
    force[..., :, 1:4] = _cross_matrix(wd) + W @ W
    moment[..., :, 1:4] = -_cross_matrix(a)
    moment[..., :, 4:] = _tensor_times(wd) + W @ _tensor_times(w)
    return R @ force, R @ moment


def _tensor_times(w: Array) -> Array:
    """Return the matrix (..., 3, 6) that takes second moments to I w."""
    matrix = np.zeros((*w.shape, 6))
    for k, (i, j) in enumerate(INERTIA_PLACES.values()):
        matrix[..., i, k] = w[..., j]
        matrix[..., j, k] = w[..., i]
    return matrix


def _cross_matrix(w: Array) -> Array:
    """Return [w]x, shape (..., 3, 3)."""
    matrix = np.zeros((*w.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[..., j, i] = w[..., k]
        matrix[..., i, j] = -w[..., k]
    return matrix
