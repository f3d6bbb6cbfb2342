"""Inverse dynamics by recursion over the links: the fewest operations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from dhkit.symbolic.differentiable.bodies import Moments
from dhkit.symbolic.differentiable.inertial_table import InertialTable
from dhkit.symbolic.differentiable.joint_frames import Station, stations
from dhkit.symbolic.differentiable.vectors import Scalar, Vector3, cross, plus, times

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class Spin:
    """How a link turns: a point at r from its origin accelerates by U r against it, U = [wd]x + [w]x [w]x.

    Only what U is made of is kept: w, wd_z, and U's last column, which stays the same across a joint about z.
    """

    w: Vector3
    wd_z: Scalar
    column: Vector3
    """U_xz, U_yz, U_zz."""

    @cached_property
    def wd_y(self) -> Scalar:
        """wd_y = U_xz - w_x w_z."""
        return self.column[0] - self.w[0] * self.w[2]

    @cached_property
    def U(self) -> tuple[Vector3, Vector3, Vector3]:
        """U, row by row."""
        x, y, z = self.w
        xy, xx, zz = x * y, x * x, z * z
        U_xz, U_yz, U_zz = self.column
        return (
            (U_zz + (xx - zz), xy - self.wd_z, U_xz),
            (xy + self.wd_z, -(xx + zz), U_yz),
            (x * z - self.wd_y, (y + y) * z - U_yz, U_zz),
        )

    def times(self, r: Vector3) -> Vector3:
        """Return U r."""
        a, b, c = (row[0] * r[0] + row[1] * r[1] + row[2] * r[2] for row in self.U)
        return a, b, c

    def crossed(self, station: Station) -> Spin:
        """Return it in the approach of the next joint."""
        c, s = station.cos_alpha, station.sin_alpha
        axis = self.times((0.0, -s, c))
        return Spin(station.to_approach(self.w), c * self.wd_z - s * self.wd_y, station.to_approach(axis))

    def driven(self, qd: Scalar, qdd: Scalar) -> Spin:
        """Return it behind a revolute joint."""
        return Spin((self.w[0], self.w[1], self.w[2] + qd), self.wd_z + qdd, self.column)

    def turned(self, station: Station) -> Spin:
        """Return it in the axes of a link's equations."""
        return Spin(station.to_link(self.w), self.wd_z, station.to_link(self.column))

    def moment(self, link: Moments) -> Vector3:
        """Return the integral of r x U r over a link's mass."""
        (U_xx, U_xy, U_xz), (U_yx, U_yy, U_yz), (U_zx, U_zy, U_zz) = self.U
        x, y, z = self.w
        S = link
        return (
            S.yy * U_zy - S.zz * U_yz + S.yz * (U_zz - U_yy) + S.xy * U_zx - S.xz * U_yx,
            S.zz * U_xz - S.xx * U_zx + S.xz * (x * x - z * z) + S.yz * U_xy - S.xy * U_zy,
            (S.xx + S.yy) * self.wd_z + S.difference * (x * y) + S.xy * (U_yy - U_xx) + S.xz * U_yz - S.yz * U_xz,
        )


def recursive_inverse_dynamics(
    table: InertialTable, q: casadi.SX, qd: Sequence[Scalar] | casadi.SX, qdd: Sequence[Scalar] | casadi.SX
) -> casadi.SX:
    """Return the joint torques of a motion by Newton's and Euler's equations, n x 1, N m and N; drives included.

    Luh, Walker & Paul 1980, with accelerations by U and base parameters (Khalil & Kleinfinger 1987), in the axes that
    :class:`dhkit.symbolic.differentiable.joint_frames.Station` chooses.
    """
    import casadi

    made = stations(table, q)
    spin = Spin((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0))
    a = times(-1.0, table.gravity)  # an arm that accelerates upwards feels its weight
    wrenches = []
    for i, station in enumerate(made):
        a = station.to_approach(plus(a, spin.times(station.lever)))
        spin = spin.crossed(station)
        if station.prismatic:
            double = qd[i] + qd[i]
            a = a[0] + double * spin.w[1], a[1] - double * spin.w[0], a[2] + qdd[i]
        else:
            spin = spin.driven(qd[i], qdd[i])
        a, spin = station.to_link(a), spin.turned(station)
        own = station.own
        wrenches.append((plus(times(own.mass, a), spin.times(own.first)), plus(spin.moment(own), cross(own.first, a))))
    f: Vector3 = (0.0, 0.0, 0.0)
    n: Vector3 = (0.0, 0.0, 0.0)
    tau = [0.0] * table.n
    for i in reversed(range(table.n)):
        station = made[i]
        f, n = plus(wrenches[i][0], f), plus(wrenches[i][1], n)
        tau[i] = (f if station.prismatic else n)[2] + table.armature[i] * qdd[i]
        f, n = station.down(f), station.down(n)
        n = plus(n, cross(station.lever, f))
    return casadi.SX(casadi.vertcat(*tau))


def recursive_bias(table: InertialTable, q: casadi.SX, qd: casadi.SX) -> casadi.SX:
    """Return C qd + g, n x 1: the torques of a motion without acceleration."""
    return recursive_inverse_dynamics(table, q, qd, [0.0] * table.n)


def recursive_gravity(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return g, n x 1: the torques at rest."""
    return recursive_inverse_dynamics(table, q, [0.0] * table.n, [0.0] * table.n)
