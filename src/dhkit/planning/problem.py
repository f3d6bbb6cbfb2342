"""A motion as a nonlinear program: knots, the rows that hold it together, and its limits; built once, solved often.

Acceleration is constant, linear or quadratic inside an interval and integrated exactly, so that a solution is a
motion and no approximation of one; only between the points where limits are asked for can they be missed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.constraints import Constraint
from dhkit.planning.mesh import Curve, Mesh
from dhkit.planning.objectives import Effort, Energy, Jerk, Objective, Time
from dhkit.planning.point import LOAD, Point
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits

if TYPE_CHECKING:
    import casadi

__all__ = ["Knots", "Problem", "Rows"]

CALM = 1e-4
"""Share of the objective that accelerations have in least time or energy: joints with slack then move calmly."""
TINY_TIME = 1e-4
"""s: the shortest duration of a leg."""


@dataclass(frozen=True, eq=False)
class Knots:
    """A motion on a mesh: what the program decides on."""

    durations: Array
    """Shape (legs,), s."""
    q: Array
    """Shape (intervals + 1, n)."""
    qd: Array
    """Likewise."""
    qdd: Array
    """Shape (columns, n); see :class:`Curve`."""

    @property
    def vector(self) -> Array:
        """All numbers in the program's order."""
        return np.concatenate([self.durations, self.q.ravel(), self.qd.ravel(), self.qdd.ravel()])

    @classmethod
    def of(cls, vector: Array, mesh: Mesh, n: int) -> Knots:
        """Return the motion that a program's numbers are."""
        legs, knots, columns = len(mesh.legs), mesh.intervals + 1, mesh.curve.columns(mesh.intervals)
        parts = np.split(vector, np.cumsum([legs, n * knots, n * knots]))
        return cls(
            parts[0], *(part.reshape(count, n) for part, count in zip(parts[1:], (knots, knots, columns), strict=True))
        )


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one kind: the same few at many points."""

    what: str
    """In words: ``"torque"``."""
    count: int
    """Rows at each point."""
    points: int
    low: Array
    """Shape (count,)."""
    high: Array


class Problem:
    """The program of one arm, objective and set of constraints on one mesh.

    Start, goal, limits, payload, durations and the constraints' parameters are its arguments.
    """

    def __init__(
        self,
        description: Description,
        objective: Objective,
        constraints: tuple[Constraint, ...],
        limits: Limits,
        mesh: Mesh,
        *,
        friction: Friction | None = None,
        payload: bool = False,
        jerk_limited: bool = False,
    ) -> None:
        self.description, self.objective, self.constraints, self.mesh = description, objective, constraints, mesh
        self.n, self.payload, self.jerk_limited = description.n, payload, jerk_limited
        self.point = Point(description, limits, friction, payload)
        self.with_torque = bool(
            np.isfinite(limits.torque).any()
            or objective.needs_torque
            or any(constraint.needs_torque for constraint in constraints)
        )

    @property
    def jerk_counts(self) -> bool:
        """Whether motions begin and end without acceleration."""
        return self.jerk_limited or self.objective.has_jerk

    # Arguments

    @cached_property
    def parameter_sizes(self) -> tuple[int, ...]:
        """The load's numbers, then each constraint's, the cost's scale, and each joint's usual acceleration."""
        each = (constraint.size(self.description) for constraint in self.constraints)
        return (LOAD if self.payload else 0, *each, 1, self.n)

    def parameters(self, load: Array | None, each: tuple[Array, ...], scale: float, usual: Array) -> Array:
        """Return the program's parameters as one array; ``usual``: accelerations to be measured by, shape (n,)."""
        return np.concatenate([np.zeros(0) if load is None else load, *each, [scale], 1 / usual])

    # The program

    @cached_property
    def program(self) -> tuple[dict[str, Any], list[Rows]]:
        """The program's x, p, f and g, and what its rows are."""
        import casadi

        n, mesh = self.n, self.mesh
        K, legs = mesh.intervals, len(mesh.legs)
        D = casadi.MX.sym("durations", legs)
        Q, V = casadi.MX.sym("q", n, K + 1), casadi.MX.sym("qd", n, K + 1)
        A = casadi.MX.sym("qdd", n, mesh.curve.columns(K))
        p = casadi.MX.sym("p", sum(self.parameter_sizes))
        H = casadi.repmat(casadi.DM(mesh.shares).T * casadi.horzcat(*(D[int(leg)] for leg in mesh.leg)), n, 1)
        dense = any(constraint.moving for constraint in self.constraints)
        motion = _Motion.of(mesh.curve, Q, V, A, H, dense=dense)
        rows: list[Rows] = []
        g: list[casadi.MX] = []

        def add(what: str, expression: casadi.MX, low: Any, high: Any) -> None:
            count, points = expression.shape
            rows.append(Rows(what, count, points, *(np.broadcast_to(x, count).astype(float) for x in (low, high))))
            g.append(casadi.vec(expression))

        add("joint positions", Q[:, 1:] - motion.q_end, 0.0, 0.0)
        add("joint velocities", V[:, 1:] - motion.qd_end, 0.0, 0.0)
        add("position", motion.q_inside, -np.inf, np.inf)
        if motion.qd_inside is not None:
            add("velocity", motion.qd_inside, -np.inf, np.inf)
        if self.jerk_limited:
            add("jerk", motion.jerk, -np.inf, np.inf)
        add("duration", casadi.sum1(D), -np.inf, np.inf)
        integrals = []
        if self.with_torque or any(constraint.moving for constraint in self.constraints):
            states = self._state_function
            values = states.map("states", "serial", motion.weights.shape[1], [3], [])(*motion.states, p)
            begin = 0
            for what, count, low, high in self._state_rows:
                add(what, values[0][begin : begin + count, :], low, high)
                begin += count
            integrals = [casadi.dot(motion.weights, values[1][k, :]) for k in range(values[1].shape[0])]
        if any(not constraint.moving for constraint in self.constraints):
            places = casadi.horzcat(Q[:, 1:-1], motion.q_middle)
            values = self._place_function.map("places", "serial", places.shape[1], [1], [])(places, p)
            begin = 0
            for constraint, count in zip(self._places, self._place_counts, strict=True):
                add(constraint.what, values[begin : begin + count, :], constraint.low, constraint.high)
                begin += count
        f = self._cost(D, motion, integrals, A, p)
        x = casadi.vertcat(D, casadi.vec(Q), casadi.vec(V), casadi.vec(A))
        return {"x": x, "p": p, "f": f, "g": casadi.vertcat(*g)}, rows

    def _cost(self, D: casadi.MX, motion: _Motion, integrals: list[casadi.MX], A: casadi.MX, p: casadi.MX) -> casadi.MX:
        import casadi

        *_, scale, usual = casadi.vertsplit(p, np.cumsum([0, *self.parameter_sizes]).tolist())
        cost, waiting = casadi.MX(0), iter(integrals)
        for term in self.objective.terms:
            match term:
                case Time():
                    cost += term.weight * casadi.sum1(D)
                case Jerk():
                    cost += term.weight * motion.squared_jerk
                case _:
                    cost += term.weight * next(waiting)
        cost = scale * cost
        if self.objective.needs_calm:
            # By shares of time: what counts is how long joints are busy, and meshes are finer at their ends.
            squares = casadi.sum1((A * casadi.repmat(usual, 1, A.shape[1])) ** 2)
            cost += CALM / (self.n * len(self.mesh.legs)) * casadi.dot(casadi.DM(self._column_shares), squares.T)
        return cost

    @property
    def _column_shares(self) -> Array:
        """The share of time of each column of accelerations."""
        shares = self.mesh.shares
        if self.mesh.curve is Curve.CONSTANT:
            return shares
        if self.mesh.curve is Curve.JUMPING:
            return np.repeat(shares / 2, 2)
        around: Array = (np.append(shares, 0.0) + np.append(0.0, shares)) / 2
        if self.mesh.curve is Curve.LINEAR:
            return around
        both = np.empty(2 * len(shares) + 1)
        both[0::2], both[1::2] = around / 3, shares * 2 / 3
        return both

    # What is asked at one point

    @property
    def _places(self) -> tuple[Constraint, ...]:
        return tuple(constraint for constraint in self.constraints if not constraint.moving)

    @cached_property
    def _place_counts(self) -> tuple[int, ...]:
        return tuple(int(rows.numel()) for rows in self._rows_of(moving=False))

    @cached_property
    def _parameter_symbols(self) -> list[casadi.SX]:
        import casadi

        sizes = self.parameter_sizes
        return [self.point.load, *(casadi.SX.sym(f"p{k}", size) for k, size in enumerate(sizes[1:]))]

    def _rows_of(self, *, moving: bool) -> list[casadi.SX]:
        given = zip(self.constraints, self._parameter_symbols[1:], strict=False)
        return [constraint.rows(self.point, symbols) for constraint, symbols in given if constraint.moving == moving]

    @cached_property
    def _state_rows(self) -> list[tuple[str, int, Any, Any]]:
        made = [("torque", self.n, -np.inf, np.inf)] if self.with_torque else []
        moving = [constraint for constraint in self.constraints if constraint.moving]
        for constraint, rows in zip(moving, self._rows_of(moving=True), strict=True):
            made.append((constraint.what, int(rows.numel()), constraint.low, constraint.high))
        return made

    @cached_property
    def _state_function(self) -> casadi.Function:
        import casadi

        point = self.point
        rows = [point.tau / point.torque_scale] if self.with_torque else []
        integrands = [term.integrand(point) for term in self.objective.terms if isinstance(term, Effort | Energy)]
        inputs = [point.q, point.qd, point.qdd, casadi.vertcat(*self._parameter_symbols)]
        outputs = [casadi.vertcat(*rows, *self._rows_of(moving=True)), casadi.vertcat(*integrands)]
        return casadi.Function("state", inputs, outputs, {"cse": True})

    @cached_property
    def _place_function(self) -> casadi.Function:
        import casadi

        inputs = [self.point.q, casadi.vertcat(*self._parameter_symbols)]
        return casadi.Function("place", inputs, [casadi.vertcat(*self._rows_of(moving=False))], {"cse": True})


@dataclass(frozen=True, eq=False)
class _Motion:
    """A motion's pieces as MX expressions; K intervals."""

    q_end: casadi.MX
    """Where intervals lead, n x K."""
    qd_end: casadi.MX
    q_inside: casadi.MX
    """What bounds positions inside intervals, n x many."""
    qd_inside: casadi.MX | None
    """What bounds velocities inside; None where knots do."""
    q_middle: casadi.MX
    """At the midpoints, n x K."""
    jerk: casadi.MX
    """At the ends of intervals, n x many."""
    squared_jerk: casadi.MX
    """Its integral."""
    states: tuple[casadi.MX, casadi.MX, casadi.MX]
    """q, qd, qdd where torques are asked for, n x P."""
    weights: casadi.MX
    """By which values there are integrated over time, 1 x P."""

    @classmethod
    def of(cls, curve: Curve, Q: casadi.MX, V: casadi.MX, A: casadi.MX, H: casadi.MX, *, dense: bool) -> _Motion:
        """Return a curve's pieces; ``dense``: with the midpoints among the states, where what is limited may bulge."""
        import casadi

        q, v, h = Q[:, :-1], V[:, :-1], H[0, :]
        if curve is Curve.CONSTANT:
            # Positions are parabolas: those of an interval lie between its ends and q + h v / 2 (Bernstein).
            return cls(
                q_end=q + H * v + H * H / 2 * A,
                qd_end=v + H * A,
                q_inside=q + H / 2 * v,
                qd_inside=None,
                q_middle=q + H / 2 * v + H * H / 8 * A,
                jerk=casadi.MX(Q.shape[0], 0),
                squared_jerk=casadi.MX(0),
                states=(casadi.horzcat(q, Q[:, 1:]), casadi.horzcat(v, V[:, 1:]), casadi.horzcat(A, A)),
                weights=casadi.horzcat(h / 2, h / 2),
            )
        if curve is Curve.JUMPING:
            a, c = A[:, 0::2], A[:, 1::2]
            middle = (
                q + H / 2 * v + H * H * (5 * a + c) / 48,
                v + H * (3 * a + c) / 8,
                (a + c) / 2,
            )
            states = [(q, Q[:, 1:]), (v, V[:, 1:]), (a, c)]
            weights = [h / 2, h / 2]
            if dense:
                states, weights = (
                    [(*pair, x) for pair, x in zip(states, middle, strict=True)],
                    [h / 6, h / 6, 2 * h / 3],
                )
            # Positions are cubics, velocities parabolas: both inside the hulls of their Bernstein coefficients.
            return cls(
                q_end=q + H * v + H * H * (a / 3 + c / 6),
                qd_end=v + H * (a + c) / 2,
                q_inside=casadi.horzcat(q + H / 3 * v, Q[:, 1:] - H / 3 * V[:, 1:]),
                qd_inside=v + H / 2 * a,
                q_middle=middle[0],
                jerk=(c - a) / H,
                squared_jerk=casadi.MX(0),
                states=tuple(casadi.horzcat(*values) for values in states),
                weights=casadi.horzcat(*weights),
            )
        if curve is Curve.LINEAR:
            a, c = A[:, :-1], A[:, 1:]
            b = (a + c) / 2
        else:
            a, b, c = A[:, 0:-1:2], A[:, 1::2], A[:, 2::2]
        q_middle = q + H / 2 * v + H * H * (7 * a + 6 * b - c) / 96
        qd_middle = v + H * (5 * a + 8 * b - c) / 24
        first, last = (-3 * a + 4 * b - c) / H, (a - 4 * b + 3 * c) / H
        ends = casadi.MX(1, 1)
        around = (casadi.horzcat(h, ends) + casadi.horzcat(ends, h)) / 6
        return cls(
            q_end=q + H * v + H * H * (a / 6 + b / 3),
            qd_end=v + H * (a + 4 * b + c) / 6,
            q_inside=q_middle,
            # Velocities are parabolas or cubics, inside the hulls of their Bernstein coefficients.
            qd_inside=v + H / 2 * a if curve is Curve.LINEAR else casadi.horzcat(v + H / 3 * a, V[:, 1:] - H / 3 * c),
            q_middle=q_middle,
            jerk=first if curve is Curve.LINEAR else casadi.horzcat(first, last),
            squared_jerk=casadi.sum2(casadi.sum1(H / 3 * (first * first + first * last + last * last))),
            states=(
                casadi.horzcat(Q, q_middle),
                casadi.horzcat(V, qd_middle),
                casadi.horzcat(_knots_of(curve, A), b),
            ),
            weights=casadi.horzcat(around, 2 * h / 3),
        )


def _knots_of(curve: Curve, A: casadi.MX) -> casadi.MX:
    """Return the accelerations at knots."""
    return A if curve is Curve.LINEAR else A[:, 0::2]
