"""Bounds of a time derivative of joint torques, from bounds of the joints' motion.

Between samples a function differs from a polynomial of degree m - 1 through m of them by at most h^m times a constant
times the largest magnitude of its m-th derivative. So a bound of that derivative turns sampled torques into bounds of
the torques in between.

Each vector v(t) of Newton and Euler's equations is represented by bounds of |v|, |v'|, |v''| ..., its jet. Sums add
jets, and the product rule multiplies them, for a scalar times a vector, a dot and a cross product alike:

    |(u v)^(m)| <= sum_j binomial(m, j) |u^(j)| |v^(m-j)|.

A vector of length l that is fixed in a body of angular velocity w has v' = w x v, which gives its jet order by order.

Smooth dry friction is (c_pos - c_neg) / 2 s + (c_pos + c_neg) / 2 s^2 with s = x / r, r = sqrt(1 + x^2) and
x = v / width. The k-th derivatives of both with respect to x are polynomials over powers of r:

    s' = r^-3,    s'' = -3 x r^-5,    s''' = (12 x^2 - 3) r^-7,    s'''' = (45 x - 60 x^3) r^-9,    s^2 = 1 - r^-2,

and as |x| < r they are at most c_k / r^(k+2) and 2 c_k / r^(k+2), with c = 1, 3, 12, 60.
"""

from __future__ import annotations

from math import comb

import numpy as np

from dhkit.description import Array, Convention, Description, Numbers

_FRICTION_FACTORS = (1.0, 3.0, 12.0, 60.0)
"""The factors c_1 ... c_4 of smooth dry friction."""


def torque_derivative_bounds(description: Description, motion: Array) -> Array:
    """Return bounds of the m-th time derivatives of joint torques without friction.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    motion
        Bounds of |q| and of the magnitudes of its first m + 2 derivatives in K intervals, shape (m + 3, K, n), SI
        units: the m-th derivative of a torque contains that of an acceleration.

    Returns
    -------
    Array
        Shape (K, n), N m/s^m and N/s^m: the m-th derivative of the torques of inverse dynamics, with drives.
    """
    numbers = description.numbers
    n = description.n
    K = motion.shape[1]

    # Lengths of jets: positions have all orders of the motion, velocities one less, accelerations and forces two less.
    of_positions = len(motion)
    of_velocities = len(motion) - 1
    of_forces = len(motion) - 2

    # Axis i is fixed in link i - 1. In the standard convention the vector from axis i to axis i + 1 is fixed in link i,
    # in the modified one the vector from axis i - 1 to axis i is fixed in link i - 1.
    is_standard = description.convention is Convention.STANDARD

    # From the base to the last link: jets of motion, of forces and of moments about centres of mass.
    w = np.zeros((of_velocities, K))  # angular velocity of the link
    fixed = _fixed_in(w)  # a unit vector that is fixed in the link
    position = np.zeros((of_positions, K))  # sum of the vectors from the base to the link's frame
    axes: list[Array] = []
    spans: list[Array] = []
    coms: list[Array] = []
    forces: list[Array] = []
    moments: list[Array] = []
    for i in range(n):
        axis = fixed
        axes.append(axis)
        q = motion[:, :, i]
        length = float(np.hypot(numbers.a[i], numbers.d[i]))
        if numbers.prismatic[i]:
            # A vector of constant length, and q along the axis.
            span = length * axis + _product(axis, q)
        else:
            # w_i = w_(i-1) + z qd
            w = w + _product(axis[:of_velocities], q[1:])
            fixed = _fixed_in(w)
            span = length * (fixed if is_standard else axis)
        spans.append(span)
        position = position + span
        com = float(np.linalg.norm(numbers.com[i])) * fixed
        coms.append(com)

        # Force m (p'' - g); the moment is the derivative of I w.
        acceleration = (position + com)[2:]
        acceleration[0] += np.linalg.norm(numbers.gravity)
        forces.append(numbers.mass[i] * acceleration)
        angular_momentum = _product(_rotating_inertia(numbers.inertia[i], w), w)
        moments.append(angular_momentum[1:])

    # Torque at joint j: z . sum of forces (prismatic), or z . sum of (moments + levers x forces), over links i >= j.
    bounds = np.zeros((K, n))
    for j in range(n):
        if numbers.prismatic[j]:
            load = np.sum(forces[j:], axis=0)
        else:
            load = np.zeros((of_forces, K))
            lever = np.zeros((of_positions, K))  # from axis j to the link's frame
            for i in range(j, n):
                if is_standard or i > j:
                    lever = lever + spans[i]
                load = load + moments[i] + _product((lever + coms[i])[:of_forces], forces[i])
        bounds[:, j] = _product(axes[j][:of_forces], load)[-1]

    # Drives: B qdd
    result: Array = bounds + motion[-1] @ np.abs(numbers.drive_inertia)
    return result


def _product(u: Array, v: Array) -> Array:
    """Return the jet of a product, shape (m, K), from two of them."""
    return np.stack([_product_rule(u, v, m) for m in range(len(u))])


def _product_rule(u: Array | list[Array], v: Array | list[Array], m: int) -> Array:
    """Return the bound of the m-th derivative of a product, shape (K,): sum of binomial(m, j) |u^(j)| |v^(m-j)|."""
    total: Array = sum(comb(m, j) * u[j] * v[m - j] for j in range(m + 1))  # type: ignore[assignment]
    return total


def _fixed_in(w: Array) -> Array:
    """Return the jet of a unit vector fixed in a body, one order longer, from that of the angular velocity."""
    # v' = w x v, so that v^(m+1) is the m-th derivative of the product of w and v.
    jet = [np.ones(w.shape[1])]
    for m in range(len(w)):
        jet.append(_product_rule(w, jet, m))
    return np.stack(jet)


def _rotating_inertia(inertia: Array, w: Array) -> Array:
    """Return the jet of a body's inertia in world axes, in the spectral norm, as long as that of the angular velocity.

    I = c 1 + D with c the mean of the extreme eigenvalues: c 1 does not change, and D' = [w]x D - D [w]x.
    """
    # |D'| <= 2 |w| |D|, order by order; |D| is half the difference of the extreme eigenvalues.
    low, *_, high = np.linalg.eigvalsh(inertia)
    jet = [np.full(w.shape[1], (high - low) / 2)]
    for m in range(len(w) - 1):
        jet.append(2 * _product_rule(w, jet, m))
    result = np.stack(jet)
    result[0] = max(abs(low), abs(high))
    return result


def dry_friction_bounds(numbers: Numbers, width: float, least_speed: Array, motion: Array) -> Array:
    """Return bounds of the fourth time derivative of smooth dry friction in K intervals, shape (K, n), N m/s^4, N/s^4.

    Parameters
    ----------
    numbers
        The robot's.
    width
        Width of the friction, rad/s or m/s, above 0.
    least_speed
        Lower bounds of |qd|, shape (K, n), rad/s and m/s.
    motion
        Upper bounds of |q|, |q'| ... |q^(5)| at least, shape (6, K, n).
    """
    # Derivatives of friction by the rate: |f_k| = |d^k f / dv^k| <= size c_k / (width^k r^(k+2)), with
    # size = |c_pos - c_neg| / 2 + 2 |c_pos + c_neg| / 2
    c_pos, c_neg = numbers.coulomb.T
    size = np.abs(c_pos - c_neg) / 2 + np.abs(c_pos + c_neg)
    r = np.hypot(1.0, least_speed / width)
    f1, f2, f3, f4 = (
        size * c / (width**k * r ** (k + 2)) for k, c in enumerate(_FRICTION_FACTORS, start=1)
    )

    # d^4 f(v(t)) / dt^4 = f4 v'^4 + 6 f3 v'^2 v'' + f2 (3 v''^2 + 4 v' v''') + f1 v'''' (Faa di Bruno)
    v1, v2, v3, v4 = motion[2:6]
    bounds: Array = f4 * v1**4 + 6 * f3 * v1**2 * v2 + f2 * (3 * v2**2 + 4 * v1 * v3) + f1 * v4
    return bounds
