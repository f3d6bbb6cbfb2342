"""The regressor in numbers: torques are linear in the links' inertial parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import INERTIA_PLACES, Array, Description, joint_array, takes_robot
from dhkit.description.frames import carrying, world_to_frames


@takes_robot
def inertial_parameters(description: Description) -> Array:
    """Return the links' inertial parameters, shape (10 n,), that :func:`regressor` is to be multiplied by.

    Of each link its mass, kg, first moments m c, kg m, and second moments xx, yy, zz, xy, yz, xz about its DH frame's
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
    states = [joint_array(description, x, name) for x, name in ((q, "q"), (qd, "qd"), (qdd, "qdd"))]
    q, qd, qdd = np.broadcast_arrays(*states)
    T = world_to_frames(description, q)
    frames = np.moveaxis(T, -3, 0)
    carriers = carrying(description.convention, frames)
    prismatic = description.numbers.prismatic
    omega, rate = np.zeros((2, *q.shape[:-1], 3))
    # Gravity acts like an acceleration of the base upwards.
    a = np.broadcast_to(-description.numbers.gravity, omega.shape)
    Y = np.zeros((*q.shape, 10 * n))
    for i in range(n):
        axis = carriers[i][..., :3, 2]
        at = carriers[i][..., :3, 3]
        lever = frames[i + 1][..., :3, 3] - frames[i][..., :3, 3]
        v, dv = (x[..., i, None] for x in (qd, qdd))
        if prismatic[i]:
            a = a + _relative_acceleration(omega, rate, lever) + 2 * v * np.cross(omega, axis) + dv * axis
        else:
            # The joint's axis passes through a point of the link before; the link's own frame turns about it.
            a = a + _relative_acceleration(omega, rate, at - frames[i][..., :3, 3])
            rate = rate + dv * axis + v * np.cross(omega, axis)
            omega = omega + v * axis
            a = a + _relative_acceleration(omega, rate, frames[i + 1][..., :3, 3] - at)
        force, moment = _force_and_moment(frames[i + 1][..., :3, :3], omega, rate, a)
        for j in range(i + 1):
            # Joint j feels z . f if prismatic, z . (moment + (o_i - p) x f) if revolute, o_i the link's origin.
            z = carriers[j][..., :3, 2]
            p = carriers[j][..., :3, 3]
            effort = force
            if not prismatic[j]:
                arm = frames[i + 1][..., :3, 3] - p
                effort = moment + np.cross(arm[..., None], force, axisa=-2, axisb=-2, axisc=-2)
            Y[..., j, 10 * i : 10 * i + 10] = np.einsum("...k,...kp->...p", z, effort)
    Y[~np.isfinite(q + qd + qdd).all(axis=-1)] = np.nan
    return Y


def _relative_acceleration(omega: Array, rate: Array, lever: Array) -> Array:
    """Return the acceleration of a point of a link relative to another, which is at -``lever`` from it."""
    return np.cross(rate, lever) + np.cross(omega, np.cross(omega, lever))


def _force_and_moment(R: Array, omega: Array, rate: Array, a: Array) -> tuple[Array, Array]:
    """Return a link's force and moment about its frame's origin, world axes, as matrices (..., 3, 10)."""
    # In the link's axes, with mass m, first moment h = m c and second moments I about the origin:
    #     f = m a + ([w'] + [w]^2) h,    n = -[a] h + I w' + [w] I w.
    w, dw, acceleration = (np.einsum("...ji,...j->...i", R, x) for x in (omega, rate, a))
    force, moment = np.zeros((2, *w.shape, 10))
    W = _cross_matrix(w)
    force[..., :, 0] = acceleration
    force[..., :, 1:4] = _cross_matrix(dw) + W @ W
    moment[..., :, 1:4] = -_cross_matrix(acceleration)
    moment[..., :, 4:] = _tensor_times(dw) + W @ _tensor_times(w)
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
