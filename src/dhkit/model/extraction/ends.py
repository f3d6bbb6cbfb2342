"""The first and last row of a table: entries chosen so that base, tool and row have the fewest nonzero numbers.

Between the base and the first common normal are the base's pose (three lengths, roll, pitch and yaw) and the entries
of the first row that no normal determines; likewise between the last normal and the tip. Together they are more numbers
than a pose has, so some can be zero. Angles are tried that make one of the other numbers zero: that reaches every
representation by up to three angles, and those by four whose fourth spares a length.
"""

from __future__ import annotations

from collections.abc import Iterator
from operator import itemgetter

import numpy as np

from dhkit.description import Array, Convention
from dhkit.model.extraction.axes import ZERO, Choice, EndRow, Normal, angle_costs, length_costs

_OUTSIDE_COST = 5.0
"""Extra cost of a number of the base or the tool: a number that the table can hold is put there."""
_IN_LAST_ROW_COST = 1.0
"""Extra cost of theta and d in a modified table's last row: they belong to the tool (Craig, 2005, section 3.4)."""
_MIN_DIVISOR = 1e-6
"""Smallest component, or determinant, by which a length is divided to make a coordinate zero."""
_MAX_OFFSET = 1e3
"""Largest offset d that is tried, in units of about the arm's size."""


def frame(x: Array, z: Array, origin: Array) -> Array:
    """Return the pose, shape (4, 4), m, of a frame with this z axis, and an x axis perpendicular to it near x.

    x and z are unit vectors, shape (3,); the origin is of shape (3,), m.
    """
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    T = np.eye(4)
    T[:3, 0] = x
    T[:3, 1] = np.cross(z, x)
    T[:3, 2] = z
    T[:3, 3] = origin
    return T


def screw(axis: int, angle: float, length: float) -> Array:
    """Return a rotation by an angle, rad, about the x (0) or z (2) axis and a translation along it, m, shape (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = _rotations(axis, np.array([angle]))[0]
    T[axis, 3] = length
    return T


def _rotations(axis: int, angles: Array) -> Array:
    """Return rotations about the x (0) or z (2) axis by angles, shape (k,), rad; shape (k, 3, 3)."""
    # Rotation takes axis i to axis j, and j to -i, where i, j follow the axis in the cycle x, y, z.
    i = (axis + 1) % 3
    j = (axis + 2) % 3
    cosines = np.cos(angles)
    sines = np.sin(angles)

    R = np.zeros((len(angles), 3, 3))
    R[:, axis, axis] = 1.0
    R[:, i, i] = cosines
    R[:, j, j] = cosines
    R[:, j, i] = sines
    R[:, i, j] = -sines
    return R


def first_row(convention: Convention, normal: Normal, z: Array) -> Choice:
    """Return the cheapest first row of a table with its cost, for its first normal and first axis in the base.

    z is the axis' unit vector, shape (3,); lengths are in units of about the arm's size.
    """
    T = frame(normal.x, z, normal.start)
    R = T[:3, :3]
    t = T[:3, 3]

    # The base's rotation R Rz(-theta) has the first column c R_x - s R_y and the second s R_x + c R_y, with c and s of
    # theta. Its yaw is 0 if entry y of the first is 0, its pitch if entry z of the first is, its roll if entry z of the
    # second is.
    thetas = [0.0]
    thetas += _and_opposite(np.arctan2(R[1, 0], R[1, 1]))  # the base's yaw is 0
    thetas += _and_opposite(np.arctan2(R[2, 0], R[2, 1]))  # its pitch
    thetas += _and_opposite(np.arctan2(-R[2, 1], R[2, 0]))  # its roll
    if convention is Convention.STANDARD:
        angles = np.array(thetas)
        shifts = np.array([0.0, *_zeroing_shifts(t, z)])

        # The base's rotation is R Rz(-theta), its origin t - d z: theta and d are chosen independently.
        base_turns = angle_costs(_roll_pitch_yaw(R @ _rotations(2, -angles)))
        base_lengths = length_costs(t - shifts[:, None] * z)
        turns = angle_costs(angles) + _outside_costs(base_turns)
        lengths = length_costs(shifts) + _outside_costs(base_lengths)
        k = int(np.argmin(turns))
        j = int(np.argmin(lengths))
        return float(turns[k] + lengths[j]), EndRow(theta=float(angles[k]), d=float(shifts[j]))

    # In the normal's axes the base's x axis is (c, -s, 0): it is parallel to the part of t across z.
    across = R.T @ t
    # The base's x axis points at the first axis.
    thetas += _and_opposite(-np.arctan2(across[1], across[0]))
    return min(_modified_starts(R, t, z, thetas), key=itemgetter(0))


def _modified_starts(R: Array, t: Array, z: Array, thetas: list[float]) -> Iterator[Choice]:
    """Yield first rows of a modified table for the frame (R, t) of its first normal.

    The base's rotation is R Rz(-theta), whose part about x may be alpha_0 of the table; its origin is t - a x - d z.
    """
    for theta in thetas:
        R_base = R @ _rotations(2, np.array([-theta]))[0]
        roll, pitch, yaw = _roll_pitch_yaw(R_base[None])[0]
        is_about_x = abs(pitch) <= ZERO and abs(yaw) <= ZERO
        alpha = float(roll) if is_about_x else 0.0
        base_turns = angle_costs(np.array([[0.0 if is_about_x else roll, pitch, yaw]]))
        turns = float(_outside_costs(base_turns)[0]) + float(
            angle_costs(np.array([alpha, theta])).sum()
        )
        x = R_base[:, 0]
        for a, d in _zeroing_pairs(t, x, z):
            origin = t - a * x - d * z
            lengths = (
                length_costs(np.array([a, d])).sum() + _outside_costs(length_costs(origin[None]))[0]
            )
            yield turns + float(lengths), EndRow(float(theta), d, alpha, a)


def last_row(
    convention: Convention, normal: Normal, z: Array, T_base_tip: Array, with_theta: bool = True
) -> Choice:
    """Return the cheapest last row of a table with its cost, for its last normal and last axis in the base.

    z is the axis' unit vector, shape (3,), T_base_tip the tip's pose, shape (4, 4); lengths are in units of about the
    arm's size. Without ``with_theta`` the row's theta and d are already taken, and stay 0 here.
    """
    G = np.linalg.inv(frame(normal.x, z, normal.end)) @ T_base_tip
    ends = _standard_ends if convention is Convention.STANDARD else _modified_ends
    return min(ends(G[:3, :3], G[:3, 3], with_theta), key=itemgetter(0))


def _modified_ends(R: Array, t: Array, with_theta: bool) -> Iterator[Choice]:
    """Yield last rows of a modified table for the tip's pose (R, t) after the last normal.

    theta and d leave the tool Rz(-theta) R at Rz(-theta) t - (0, 0, d).
    """
    candidates = [0.0]
    if with_theta:
        candidates += _and_opposite(np.arctan2(R[1, 0], R[0, 0]))  # the tool's yaw is 0
        candidates += _quarters(np.arctan2(t[1], t[0]))  # its x or y is 0
    thetas = np.array(candidates)
    back = _rotations(2, -thetas)
    turns = _in_last_row(angle_costs(thetas)) + angle_costs(_roll_pitch_yaw(back @ R)).sum(axis=-1)
    for d in (0.0, float(t[2])) if with_theta else (0.0,):
        origin = back @ t - np.array([0.0, 0.0, d])
        costs = (
            turns + _in_last_row(length_costs(np.array([d])))[0] + length_costs(origin).sum(axis=-1)
        )
        k = int(np.argmin(costs))
        yield float(costs[k]), EndRow(float(thetas[k]), d)


def _standard_ends(R: Array, t: Array, with_theta: bool) -> Iterator[Choice]:
    """Yield last rows of a standard table for the tip's pose (R, t) after the last normal.

    The tool is Rx(-alpha) P at Rx(-alpha) (p - (a, 0, d)), with P = Rz(-theta) R and p = Rz(-theta) t. The entry
    a = p_x leaves it x = 0; with c, s the cosine and sine of alpha,

        y = c p_y + s (p_z - d),    z = -s p_y + c (p_z - d),

    so that d = p_z + (c / s) p_y makes y zero, and d = p_z - (s / c) p_y makes z zero.
    """
    thetas = [0.0]
    if with_theta:
        thetas += _and_opposite(np.arctan2(R[1, 0], R[0, 0]))  # the tool's yaw is 0 if alpha is
        thetas += _quarters(np.arctan2(t[1], t[0]))  # p_y is 0, or p_x, which is the entry a
        # The tool rotates about x and then z.
        thetas += _and_opposite(np.arctan2(R[0, 2], -R[1, 2]))
        # The tool rotates about x and then y.
        thetas += _and_opposite(np.arctan2(-R[0, 1], R[1, 1]))
    for theta in thetas:
        back = _rotations(2, np.array([-theta]))[0]
        P = back @ R
        p = back @ t

        # Rows y and z of Rx(-alpha) P are c P_y + s P_z and c P_z - s P_y, with c and s of alpha: the yaw is 0 if entry
        # x of row y is 0, the pitch if entry x of row z is, the roll if entry y of row z is.
        angles = [0.0]
        angles += _and_opposite(np.arctan2(-P[1, 0], P[2, 0]))  # the tool's yaw is 0
        angles += _and_opposite(np.arctan2(P[2, 0], P[1, 0]))  # its pitch
        angles += _and_opposite(np.arctan2(P[2, 1], P[1, 1]))  # its roll
        alphas = np.array([*angles, *_quarters(np.arctan2(p[2], p[1]))])
        tool_turns = _roll_pitch_yaw(_rotations(0, -alphas) @ P)
        turns = (
            float(angle_costs(np.array([theta]))[0])
            + angle_costs(alphas)
            + _outside_costs(angle_costs(tool_turns))
        )
        costs = turns + float(length_costs(p[:1])[0])

        c = np.cos(alphas)
        s = np.sin(alphas)
        with np.errstate(divide="ignore", invalid="ignore"):
            offsets = [
                np.zeros_like(alphas),
                np.full_like(alphas, p[2]),
                p[2] - s / c * p[1],
                p[2] + c / s * p[1],
            ]
        for d in offsets if with_theta else offsets[:1]:
            d = np.where(np.isfinite(d) & (np.abs(d) < _MAX_OFFSET), d, 0.0)
            y = c * p[1] + s * (p[2] - d)
            z = -s * p[1] + c * (p[2] - d)
            total = (
                costs + length_costs(d) + _outside_costs(length_costs(np.stack([y, z], axis=-1)))
            )
            k = int(np.argmin(total))
            yield float(total[k]), EndRow(float(theta), float(d[k]), float(alphas[k]), float(p[0]))


def _and_opposite(angle: float) -> list[float]:
    """Return an angle and the opposite one, in (-pi, pi]."""
    return [_wrapped(angle), _wrapped(angle + np.pi)]


def _quarters(angle: float) -> list[float]:
    """Return an angle plus the multiples of 90 degrees, in (-pi, pi]."""
    return [_wrapped(angle + k * np.pi / 2) for k in range(4)]


def _wrapped(angle: float) -> float:
    """Return an angle in (-pi, pi]; rounding errors about 0 and -pi become 0 and pi."""
    wrapped = float(np.arctan2(np.sin(angle), np.cos(angle)))
    if abs(wrapped) < 1e-15:
        return 0.0
    return float(np.pi) if wrapped < -np.pi + 1e-15 else wrapped


def _roll_pitch_yaw(R: Array) -> Array:
    """Return roll, pitch and yaw of rotations R = Rz(yaw) Ry(pitch) Rx(roll), shape (k, 3, 3); their shape is (k, 3).

    At gimbal lock, where cos(pitch) = 0, yaw is 0.
    """
    # The first column of R is cos(pitch) (cos(yaw), sin(yaw)), -sin(pitch).
    level = np.hypot(R[:, 0, 0], R[:, 1, 0])
    is_locked = level < 1e-12
    pitch = np.arctan2(-R[:, 2, 0], level)
    yaw = np.where(is_locked, 0.0, np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    roll = np.where(
        is_locked, np.arctan2(-R[:, 1, 2], R[:, 1, 1]), np.arctan2(R[:, 2, 1], R[:, 2, 2])
    )
    return np.stack([roll, pitch, yaw], axis=-1)


def _outside_costs(costs: Array) -> Array:
    """Return the costs of numbers of the base or tool, summed over the last axis."""
    return np.asarray((costs + _OUTSIDE_COST * (costs > 0)).sum(axis=-1))


def _in_last_row(costs: Array) -> Array:
    """Return the costs of entries theta or d of a modified table's last row, of any shape."""
    return np.asarray(costs + _IN_LAST_ROW_COST * (costs > 0))


def _zeroing_shifts(t: Array, z: Array) -> list[float]:
    """Return the shifts along z that make a coordinate of t zero, m."""
    return [float(t[k] / z[k]) for k in range(3) if abs(z[k]) > _MIN_DIVISOR]


def _zeroing_pairs(t: Array, x: Array, z: Array) -> list[tuple[float, float]]:
    """Return shifts along x and z that make up to two coordinates of t zero, m."""
    pairs = [(0.0, 0.0)]
    pairs += [(0.0, d) for d in _zeroing_shifts(t, z)]
    pairs += [(a, 0.0) for a in _zeroing_shifts(t, x)]

    # Two coordinates of t - a x - d z are zero.
    for rows in ([0, 1], [0, 2], [1, 2]):
        A = np.stack([x[rows], z[rows]], axis=1)
        if abs(np.linalg.det(A)) > _MIN_DIVISOR:
            a, d = np.linalg.solve(A, t[rows])
            pairs.append((float(a), float(d)))
    return pairs
