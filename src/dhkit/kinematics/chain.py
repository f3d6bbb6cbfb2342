"""Six revolute axes as links of standard Denavit-Hartenberg parameters, whatever the robot's own table is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dhkit.description import Array
from dhkit.description.poses import inverse_pose
from dhkit.kinematics.axes import Axes


@dataclass(frozen=True, eq=False)
class Chain:
    """Links between consecutive axes, with the frames before the first and behind the last joint.

    With theta_i = q_i + offset_i, and a_n = alpha_n = 0, the tool's pose is

        T = T_world_first A_1 ... A_n T_last_tool,    A_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i).
    """

    offset: Array
    """Joint angle at zero joint position, shape (n,), rad."""
    d: Array
    """Shape (n,), m."""
    a: Array
    """Shape (n,), m."""
    alpha: Array
    """Shape (n,), rad."""
    T_world_first: Array
    """Shape (4, 4), m."""
    T_last_tool: Array
    """Shape (4, 4), m."""

    @classmethod
    @lru_cache(maxsize=64)
    def of(cls, axes: Axes) -> Chain:
        """Return the chain of an arm with revolute joints.

        Link i is the common normal of axes i and i + 1. Parallel axes have many: theirs begins where the link before
        ends, so that d_i is 0.
        """
        n = axes.n
        offset, d, a, alpha = np.zeros((4, n))
        # theta_1 and d_1 count from the first normal itself.
        x_before, end_before, _ = _common_normal(axes, 1, axes.point(1), None)
        first = _frame(x_before, axes.direction(1), end_before)
        for i in range(1, n):
            x, start, end = _common_normal(axes, i, end_before, x_before)
            z = axes.direction(i)
            offset[i - 1] = _angle(x_before, x, about=z)
            d[i - 1] = z @ (start - end_before)
            a[i - 1] = x @ (end - start)
            alpha[i - 1] = _angle(z, axes.direction(i + 1), about=x)
            x_before = x
            end_before = end
        last = _frame(x_before, axes.direction(n), end_before)
        return cls(offset, d, a, alpha, first, inverse_pose(last) @ axes.T_world_tool)


def _common_normal(
    axes: Axes, i: int, near: Array, x_before: Array | None
) -> tuple[Array, Array, Array]:
    """Return the direction of the common normal of axes i and i + 1, its end on axis i, and that on axis i + 1.

    Parameters
    ----------
    near
        Point of axis i, shape (3,), m, at which the normal of parallel axes begins.
    x_before
        Direction of the normal before, which one of coincident axes takes over; None for the first.
    """
    z = axes.direction(i)
    z_next = axes.direction(i + 1)
    if axes.parallel(i, i + 1):
        to_next = axes.point(i + 1) - near
        across = to_next - z * (z @ to_next)
        length = np.linalg.norm(across)
        if length > axes.tolerance * axes.scale:
            return across / length, near, near + across
        x = _any_perpendicular(z) if x_before is None else x_before
        return x, near, near

    # Points p_i + s z_i and p_j + t z_j, j = i + 1, of least distance: with w = p_j - p_i and m = z_i x z_j,
    # s = (w x z_j) . m / |m|^2 and t = (w x z_i) . m / |m|^2.
    m = np.cross(z, z_next)
    w = axes.point(i + 1) - axes.point(i)
    s = np.cross(w, z_next) @ m / (m @ m)
    t = np.cross(w, z) @ m / (m @ m)
    return m / np.linalg.norm(m), axes.point(i) + s * z, axes.point(i + 1) + t * z_next


def _any_perpendicular(z: Array) -> Array:
    """Return a unit vector at right angles to a unit vector."""
    across = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    perpendicular: Array = across / np.linalg.norm(across)
    return perpendicular


def _angle(start: Array, end: Array, about: Array) -> float:
    """Return the angle from one unit vector to another about a unit vector at right angles to both, rad."""
    return float(np.arctan2(about @ np.cross(start, end), start @ end))


def _frame(x: Array, z: Array, origin: Array) -> Array:
    """Return the pose with these axes and this origin, shape (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T[:3, 3] = origin
    return T
