"""The ends of a table: what of base and tool goes into its first and last row, chosen for the fewest nonzero entries.

Between the base and the first common normal stand the base's pose (three lengths, roll, pitch and yaw) and the entries
of the first row that no normal determines; likewise between the last normal and the tip. Together they are more numbers
than a pose has, so some can be zero. Angles are tried that make one number of the rest zero: that reaches every
representation by up to three angles, and those by four whose fourth spares a length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit.description import Array, Convention
from dhkit.model.extraction.axes import ZERO, Normal, angle_costs, length_costs

OUTSIDE = 5.0
"""Extra cost of a number of the base or the tool: where the table can hold it, it does."""
INSIDE = 1.0
"""Extra cost of theta and d in a modified table's last row: they belong to the tool (Craig, 2005, section 3.4)."""


@dataclass(frozen=True)
class FirstRow:
    """What the first row holds beside its normal; alpha and a only in modified tables (alpha_0, a_0), rad and m."""

    theta: float
    d: float
    alpha: float = 0.0
    a: float = 0.0


@dataclass(frozen=True)
class LastRow:
    """What the last row holds beside its normal; alpha and a only in standard tables, rad and m."""

    theta: float
    d: float
    a: float = 0.0
    alpha: float = 0.0


@dataclass(frozen=True, eq=False)
class Tip:
    """The tip in the base, shape (4, 4), and whether the last joint's theta and d are still free."""

    T_base_tip: Array
    with_theta: bool = True


def frame(x: Array, z: Array, origin: Array) -> Array:
    """Return a pose with these x and z axes, made perpendicular, shape (4, 4)."""
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = x, np.cross(z, x), z, origin
    return T


def screw(axis: int, angle: float, length: float) -> Array:
    """Return a turn about and a shift along the x (0) or z (2) axis, shape (4, 4)."""
    T = np.eye(4)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    c, s = np.cos(angle), np.sin(angle)
    T[i, i], T[i, j], T[j, i], T[j, j] = c, -s, s, c
    T[axis, 3] = length
    return T


def turned(axis: int, angles: Array) -> Array:
    """Return rotations about the x (0) or z (2) axis, shape (k, 3, 3)."""
    R = np.zeros((len(angles), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[:, axis, axis] = 1.0
    R[:, i, i] = R[:, j, j] = np.cos(angles)
    R[:, j, i] = np.sin(angles)
    R[:, i, j] = -R[:, j, i]
    return R


def first_row(convention: Convention, normal: Normal, z: Array) -> tuple[float, FirstRow]:
    """Return the cheapest start of a table whose first normal and first axis are given in the base, and its cost."""
    T = frame(normal.x, z, normal.start)
    R, t = T[:3, :3], T[:3, 3]
    thetas = [0.0]
    thetas += _both(np.arctan2(R[1, 0], R[1, 1]))  # the base's yaw is 0
    thetas += _both(np.arctan2(R[2, 0], R[2, 1]))  # its pitch
    thetas += _both(np.arctan2(-R[2, 1], R[2, 0]))  # its roll
    if convention is Convention.STANDARD:
        theta_array = np.array(thetas)
        costs = angle_costs(theta_array) + _outside(angle_costs(_angles(R @ turned(2, -theta_array))))
        shifts = np.array([0.0, *_zeroing(t, z)])
        lengths = length_costs(shifts) + _outside(length_costs(t - shifts[:, None] * z))
        k, j = int(np.argmin(costs)), int(np.argmin(lengths))
        return float(costs[k] + lengths[j]), FirstRow(float(theta_array[k]), float(shifts[j]))
    across = R.T @ t
    thetas += _both(-np.arctan2(across[1], across[0]))  # the base's x axis points at the first axis
    best: tuple[float, FirstRow] | None = None
    for theta in thetas:
        R_base = R @ turned(2, np.array([-theta]))[0]
        roll, pitch, yaw = _angles(R_base[None])[0]
        alone = abs(pitch) <= ZERO and abs(yaw) <= ZERO
        alpha = float(roll) if alone else 0.0
        turns = float(_outside(angle_costs(np.array([[0.0 if alone else roll, pitch, yaw]])))[0])
        turns += float(angle_costs(np.array([alpha, theta])).sum())
        x = R_base[:, 0]
        for a, d in _pairs(t, x, z):
            rest = t - a * x - d * z
            total = turns + float(length_costs(np.array([a, d])).sum() + _outside(length_costs(rest[None]))[0])
            if best is None or total < best[0]:
                best = total, FirstRow(float(theta), d, alpha, a)
    if best is None:
        raise AssertionError("no start of a table")
    return best


def last_row(convention: Convention, normal: Normal, z: Array, tip: Tip) -> tuple[float, LastRow]:
    """Return the cheapest end of a table whose last normal and last axis are given in the base, and its cost."""
    G = np.linalg.inv(frame(normal.x, z, normal.end)) @ tip.T_base_tip
    if convention is Convention.STANDARD:
        return _standard_end(G[:3, :3], G[:3, 3], tip.with_theta)
    return _modified_end(G[:3, :3], G[:3, 3], tip.with_theta)


def _modified_end(R: Array, t: Array, with_theta: bool) -> tuple[float, LastRow]:
    thetas = np.array([0.0])
    if with_theta:
        towards = np.arctan2(t[1], t[0])
        thetas = np.array([0.0, *_both(np.arctan2(R[1, 0], R[0, 0])), *_quarters(towards)])
    back = turned(2, -thetas)
    costs = _in_tool(angle_costs(thetas)) + angle_costs(_angles(back @ R)).sum(axis=-1)
    shifted = back @ t
    best: tuple[float, LastRow] | None = None
    for d in (0.0, float(t[2])) if with_theta else (0.0,):
        rest = shifted - np.array([0.0, 0.0, d])
        total = costs + _in_tool(length_costs(np.array([d])))[0] + length_costs(rest).sum(axis=-1)
        k = int(np.argmin(total))
        if best is None or total[k] < best[0]:
            best = float(total[k]), LastRow(float(thetas[k]), d)
    if best is None:
        raise AssertionError("no end of a table")
    return best


def _standard_end(R: Array, t: Array, with_theta: bool) -> tuple[float, LastRow]:
    thetas = np.array([0.0])
    if with_theta:
        thetas = np.array(
            [
                0.0,
                *_both(np.arctan2(R[1, 0], R[0, 0])),
                *_quarters(np.arctan2(t[1], t[0])),
                *_both(np.arctan2(R[0, 2], -R[1, 2])),  # the rest turns about x and then z
                *_both(np.arctan2(-R[0, 1], R[1, 1])),  # the rest turns about x and then y
            ]
        )
    best: tuple[float, LastRow] | None = None
    for theta in thetas:
        back = turned(2, np.array([-theta]))[0]
        P, p = back @ R, back @ t
        alphas = np.array(
            [
                0.0,
                *_both(np.arctan2(-P[1, 0], P[2, 0])),  # yaw, pitch and roll of the tool are 0
                *_both(np.arctan2(P[2, 0], P[1, 0])),
                *_both(np.arctan2(P[2, 1], P[1, 1])),
                *_quarters(np.arctan2(p[2], p[1])),
            ]
        )
        turns = _angles(turned(0, -alphas) @ P)
        costs = float(angle_costs(np.array([theta]))[0]) + angle_costs(alphas) + _outside(angle_costs(turns))
        # x goes into a; y and z are shared by d and the tool
        costs = costs + float(length_costs(p[:1])[0])
        c, s = np.cos(alphas), np.sin(alphas)
        with np.errstate(divide="ignore", invalid="ignore"):
            options = [
                np.zeros_like(alphas),
                np.full_like(alphas, p[2]),
                p[2] - s / c * p[1],
                p[2] + c / s * p[1],
            ]
        for d in options if with_theta else options[:1]:
            d = np.where(np.isfinite(d) & (np.abs(d) < 1e3), d, 0.0)
            y, z = c * p[1] + s * (p[2] - d), -s * p[1] + c * (p[2] - d)
            total = costs + length_costs(d) + _outside(length_costs(np.stack([y, z], axis=-1)))
            k = int(np.argmin(total))
            if best is None or total[k] < best[0]:
                best = float(total[k]), LastRow(float(theta), float(d[k]), float(p[0]), float(alphas[k]))
    if best is None:
        raise AssertionError("no end of a table")
    return best


def _both(angle: float) -> list[float]:
    """Return an angle and its opposite, those near multiples of 90 degrees as such."""
    return [_wrapped(angle), _wrapped(angle + np.pi)]


def _quarters(angle: float) -> list[float]:
    return [_wrapped(angle + k * np.pi / 2) for k in range(4)]


def _wrapped(angle: float) -> float:
    wrapped = float(np.arctan2(np.sin(angle), np.cos(angle)))
    if abs(wrapped) < 1e-15:
        return 0.0
    return float(np.pi) if wrapped < -np.pi + 1e-15 else wrapped


def _angles(R: Array) -> Array:
    """Return roll, pitch and yaw of rotations (k, 3, 3), shape (k, 3); yaw is 0 where roll could take it."""
    level = np.hypot(R[:, 0, 0], R[:, 1, 0])
    locked = level < 1e-12
    pitch = np.arctan2(-R[:, 2, 0], level)
    yaw = np.where(locked, 0.0, np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    roll = np.where(locked, np.arctan2(-R[:, 1, 2], R[:, 1, 1]), np.arctan2(R[:, 2, 1], R[:, 2, 2]))
    return np.stack([roll, pitch, yaw], axis=-1)


def _outside(costs: Array) -> Array:
    """Return the costs of numbers of the base or tool, summed over the last axis."""
    return np.asarray((costs + OUTSIDE * (costs > 0)).sum(axis=-1))


def _in_tool(costs: Array) -> Array:
    return np.asarray(costs + INSIDE * (costs > 0))


def _zeroing(t: Array, z: Array) -> list[float]:
    """Return the shifts along z that make a coordinate of t zero, m."""
    return [float(t[k] / z[k]) for k in range(3) if abs(z[k]) > 1e-6]


def _pairs(t: Array, x: Array, z: Array) -> list[tuple[float, float]]:
    """Return shifts along x and z that make up to two coordinates of t zero, m."""
    pairs = [(0.0, 0.0)]
    pairs += [(0.0, d) for d in _zeroing(t, z)] + [(a, 0.0) for a in _zeroing(t, x)]
    for rows in ((0, 1), (0, 2), (1, 2)):
        A = np.stack([x[list(rows)], z[list(rows)]], axis=1)
        if abs(np.linalg.det(A)) > 1e-6:
            a, d = np.linalg.solve(A, t[list(rows)])
            pairs.append((float(a), float(d)))
    return pairs
