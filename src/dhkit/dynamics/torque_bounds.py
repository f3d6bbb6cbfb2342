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

_FRICTION_FACTORS = 1.0, 3.0, 12.0, 60.0
"""The factors c_k of smooth dry friction."""


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
    orders = len(motion) - 1
    K = motion.shape[1]
    of_torques = orders - 1  # lengths of jets: of torques, accelerations and forces
    # Axis i is fixed in link i - 1. In the standard convention the vector from axis i to axis i + 1 is fixed in link i,
    # in the modified one the vector from axis i - 1 to axis i is fixed in link i - 1.
    is_standard = description.convention is Convention.STANDARD
    spin = np.zeros((orders, K))  # jet of the angular velocity of the link
    fixed = _fixed_in(spin)
    axes = []
    spans = []
    coms = []
    positions = np.zeros((orders + 1, K))  # jet of the sum of vectors from the base to the link's frame
    forces = []
    moments = []
    for i in range(n):
        before = fixed
        axes.append(before)
        q = motion[:, :, i]
        length = float(np.hypot(numbers.a[i], numbers.d[i]))
        if numbers.prismatic[i]:
            span = length * before + _product(before, q)
        else:
            spin = spin + _product(before[:orders], q[1:])
            fixed = _fixed_in(spin)
            span = length * (fixed if is_standard else before)
        spans.append(span)
        positions = positions + span
        com = float(np.linalg.norm(numbers.com[i])) * fixed
        coms.append(com)
        acceleration = (positions + com)[2:]
        acceleration[0] += np.linalg.norm(numbers.gravity)
        forces.append(numbers.mass[i] * acceleration)
        # The moment is the derivative of I w.
        moments.append(_product(_rotating_inertia(numbers.inertia[i], spin), spin)[1:])
    bounds = np.zeros((K, n))
    for j in range(n):
        if numbers.prismatic[j]:
            load = np.sum(forces[j:], axis=0)
        else:
            load = np.zeros((of_torques, K))
            lever = np.zeros((orders + 1, K))
            for i in range(j, n):
                if is_standard or i > j:
                    lever = lever + spans[i]
                load = load + moments[i] + _product((lever + coms[i])[:of_torques], forces[i])
        bounds[:, j] = _product(axes[j][:of_torques], load)[-1]
    result: Array = bounds + motion[-1] @ np.abs(numbers.drive_inertia)
    return result


def _product(u: Array, v: Array) -> Array:
    """Return the jet of a product, shape (m, K), from two of them: (u v)^(m) = sum_j C(m, j) u^(j) v^(m - j)."""

    def derivative(m: int) -> Array:
        return np.asarray(sum(comb(m, j) * u[j] * v[m - j] for j in range(m + 1)))

    return np.stack([derivative(m) for m in range(len(u))])


def _fixed_in(spin: Array) -> Array:
    """Return the jet of a unit vector fixed in a body, one order longer, from that of the angular velocity."""
    # e' = w x e, so |e^(m + 1)| <= sum_j C(m, j) |w^(j)| |e^(m - j)|.
    jet = [np.ones(spin.shape[1])]
    for m in range(len(spin)):
        jet.append(sum(comb(m, j) * spin[j] * jet[m - j] for j in range(m + 1)))
    return np.stack(jet)


def _rotating_inertia(inertia: Array, spin: Array) -> Array:
    """Return the jet of a body's inertia in world axes, in the spectral norm, as long as that of the angular velocity.

    I = c 1 + D with c the mean of the extreme eigenvalues: c 1 does not change, and D' = [w] D - D [w].
    """
    low, *_, high = np.linalg.eigvalsh(inertia)

    # |D^(m + 1)| <= 2 sum_j C(m, j) |w^(j)| |D^(m - j)|, from |D| = (high - low) / 2.
    jet = [np.full(spin.shape[1], (high - low) / 2)]
    for m in range(len(spin) - 1):
        jet.append(2 * sum(comb(m, j) * spin[j] * jet[m - j] for j in range(m + 1)))
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
    # |f^(k)(v)| <= size F_k / (width^k r^(k + 2)) with r = sqrt(1 + (v / width)^2).
    forwards, backwards = numbers.coulomb.T
    size = np.abs(forwards - backwards) / 2 + np.abs(forwards + backwards)
    r = np.hypot(1.0, least_speed / width)
    f1, f2, f3, f4 = (size * _FRICTION_FACTORS[k - 1] / (width**k * r ** (k + 2)) for k in (1, 2, 3, 4))
    v1, v2, v3, v4 = motion[2:6]

    # d^4 f(v(t)) / dt^4 (Faa di Bruno).
    bounds: Array = f4 * v1**4 + 6 * f3 * v1**2 * v2 + f2 * (3 * v2**2 + 4 * v1 * v3) + f1 * v4
    return bounds
