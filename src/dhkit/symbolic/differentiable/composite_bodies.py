"""Mass and Coriolis matrices by composite bodies: all links behind a joint, taken as one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dhkit.symbolic.differentiable.bodies import Moments
from dhkit.symbolic.differentiable.inertial_table import InertialTable
from dhkit.symbolic.differentiable.joint_frames import Station, stations
from dhkit.symbolic.differentiable.vectors import Scalar, Vector3, cross, dot, plus, times

if TYPE_CHECKING:
    import casadi

Wrench = tuple[Vector3, Vector3]
"""Force, and moment about a joint's origin."""
Matrix3 = tuple[Vector3, Vector3, Vector3]
NOTHING: Vector3 = (0.0, 0.0, 0.0)


def composite_mass_matrix(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return M, n x n, with drives, by the composite rigid body method (Walker & Orin 1982, method 3)."""
    made = stations(table, q)
    entries: list[list[Scalar]] = [[0.0] * table.n for _ in made]
    for j, composite in _composites(made):
        wrench = _driven(made[j], composite)
        for i, (force, moment) in _carried(made, j, wrench):
            entries[i][j] = entries[j][i] = (force if made[i].prismatic else moment)[2]
        entries[j][j] = entries[j][j] + table.armature[j]
    return _matrix(entries)


def composite_coriolis_matrix(table: InertialTable, q: casadi.SX, qd: casadi.SX) -> casadi.SX:
    """Return the Christoffel C, n x n, so that C_ij = sum over all mass of J_i . dJ_j/dt dm.

    With J_j(r) the velocity that joint j alone gives to a point. What depends on the velocities of the links behind a
    joint is summed over them: the integrals of V and of r V^T (the 12 numbers that are left of the 36 of the Coriolis
    inertia of Echeandia & Wensing 2021, for a column's rate is the field w_j x V(r) and what the axis itself does).
    """
    made = stations(table, q)
    velocities = link_velocities(made, qd)
    entries: list[list[Scalar]] = [[0.0] * table.n for _ in made]
    flow = Flow.none()
    for j, composite in _composites(made):
        station, (w, v) = made[j], velocities[j]
        flow = flow.joined(Flow.of_link(station.own, w, v))
        column = _column_rate(station, composite, flow, w, v)
        for i, (force, moment) in _carried(made, j, column):
            entries[i][j] = (force if made[i].prismatic else moment)[2]
        couples = dict(_turned_down(made, j, flow.couple(station.prismatic)))
        for i, wrench in _carried(made, j, _driven(station, composite)):
            if i < j:
                entries[j][i] = _row_rate(made[i], wrench, couples[i], *velocities[i])
        flow = flow.before(station)
    return _matrix(entries)


@dataclass(frozen=True)
class Flow:
    """Velocities integrated over mass: of V, and of r V^T, about an origin."""

    momentum: Vector3
    G: Matrix3
    """Row i, column j: the integral of r_i V_j."""

    @classmethod
    def none(cls) -> Flow:
        """Return that of no mass."""
        return cls(NOTHING, (NOTHING, NOTHING, NOTHING))

    @classmethod
    def of_link(cls, link: Moments, w: Vector3, v: Vector3) -> Flow:
        """Return those of a body whose origin moves with v: V = v + w x r."""
        rows = zip(link.first, link.tensor, strict=True)
        x, y, z = (plus(times(first, v), cross(w, row)) for first, row in rows)
        return cls(plus(times(link.mass, v), cross(w, link.first)), (x, y, z))

    def joined(self, other: Flow) -> Flow:
        """Return the sum of both, about one origin and in one frame's axes."""
        x, y, z = (plus(a, b) for a, b in zip(self.G, other.G, strict=True))
        return Flow(plus(self.momentum, other.momentum), (x, y, z))

    def couple(self, prismatic: bool) -> Vector3:
        """Return the integral of V x J_j, J_j = z x r of a revolute joint and z of a prismatic one."""
        if prismatic:
            return self.momentum[1], -self.momentum[0], 0.0
        return -self.G[0][2], -self.G[1][2], self.G[0][0] + self.G[1][1]

    def before(self, station: Station) -> Flow:
        """Return it about the joint before, in the axes of its link's equations."""
        p = station.down(self.momentum)
        half = [station.down(row) for row in self.G]
        columns = [station.down((c[0], c[1], c[2])) for c in zip(*half, strict=True)]
        rows = [(r[0], r[1], r[2]) for r in zip(*columns, strict=True)]
        x, y, z = (plus(row, times(lever, p)) for row, lever in zip(rows, station.lever, strict=True))
        return Flow(p, (x, y, z))


def _composites(made: list[Station]) -> Iterator[tuple[int, Moments]]:
    """Yield, from the last joint on, the moments of all that it carries, in the axes of its link's equations."""
    composite = Moments.none()
    for j in reversed(range(len(made))):
        station = made[j]
        composite = composite.joined(station.own)
        yield j, composite
        composite = composite.about_z(*station.turn).about_x(station.cos_alpha, station.sin_alpha).moved(station.lever)


def _driven(station: Station, body: Moments) -> Wrench:
    """Return what a unit acceleration of a joint takes, at rest."""
    x, y, _ = body.first
    if station.prismatic:
        return (0.0, 0.0, body.mass), (y, -x, 0.0)
    return (-y, x, 0.0), (-body.xz, -body.yz, body.xx + body.yy)


def _column_rate(station: Station, body: Moments, flow: Flow, w: Vector3, v: Vector3) -> Wrench:
    """Return the integral of the rate of a joint's column, over all that it carries."""
    axis_rate = (w[1], -w[0], 0.0)  # w x z
    if station.prismatic:
        return times(body.mass, axis_rate), cross(body.first, axis_rate)
    # z x (V - v) + (w x z) x r
    slip = (v[1], -v[0], 0.0)
    p, G = flow.momentum, flow.G
    force = plus((-p[1], p[0], 0.0), plus(times(body.mass, slip), cross(axis_rate, body.first)))
    moment = plus((-G[2][0], -G[2][1], G[0][0] + G[1][1]), cross(body.first, slip))
    return force, plus(moment, _turning(body, axis_rate))


def _row_rate(station: Station, wrench: Wrench, couple: Vector3, w: Vector3, v: Vector3) -> Scalar:
    """Return the power of a wrench along the rate of a joint's column."""
    force, moment = wrench
    axis_rate = (w[1], -w[0], 0.0)
    if station.prismatic:
        return dot(axis_rate, force)
    return dot(axis_rate, moment) + dot((v[1], -v[0], 0.0), force) + couple[2]


def _turning(body: Moments, w: Vector3) -> Vector3:
    """Return J w for w without z: J = tr(S) 1 - S."""
    x, y, _ = w
    return (
        (body.yy + body.zz) * x - body.xy * y,
        (body.xx + body.zz) * y - body.xy * x,
        -(body.xz * x) - body.yz * y,
    )


def _carried(made: list[Station], j: int, wrench: Wrench) -> Iterator[tuple[int, Wrench]]:
    """Yield joint j's wrench as every joint from j to the first feels it."""
    force, moment = wrench
    for i in reversed(range(j + 1)):
        yield i, (force, moment)
        force, moment = made[i].down(force), made[i].down(moment)
        moment = plus(moment, cross(made[i].lever, force))


def _turned_down(made: list[Station], j: int, couple: Vector3) -> Iterator[tuple[int, Vector3]]:
    for i in reversed(range(j + 1)):
        yield i, couple
        couple = made[i].down(couple)


def link_velocities(made: list[Station], qd: casadi.SX) -> list[tuple[Vector3, Vector3]]:
    """Return angular velocity and that of the joint's origin, in the axes of each link's equations."""
    w, v = NOTHING, NOTHING
    found = []
    for i, station in enumerate(made):
        v = station.to_approach(plus(v, cross(w, station.lever)))
        w = station.to_approach(w)
        if station.prismatic:
            v = v[0], v[1], v[2] + qd[i]
        else:
            w = w[0], w[1], w[2] + qd[i]
        w, v = station.to_link(w), station.to_link(v)
        found.append((w, v))
    return found


def _matrix(entries: list[list[Scalar]]) -> casadi.SX:
    import casadi

    return casadi.SX(casadi.vertcat(*(casadi.horzcat(*row) for row in entries)))
