"""A motion as a nonlinear program: variables at knots, rows of continuity and of limits; built once, solved often.

Acceleration is constant, linear or quadratic inside an interval and integrated exactly, so that a solution is exactly
a motion; limits can be exceeded only between the points where they are imposed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.constraints import Constraint
from dhkit.planning.integration import MotionPieces
from dhkit.planning.mesh import Curve, Mesh
from dhkit.planning.objectives import Effort, Energy, Jerk, Objective, Time
from dhkit.planning.point import LOAD, Point
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits

if TYPE_CHECKING:
    import casadi

SMOOTHING_WEIGHTS = {Curve.CONSTANT: 1e-3, Curve.JUMPING: 1e-5, Curve.LINEAR: 1e-4, Curve.QUADRATIC: 1e-3}
"""Weight of squared accelerations in objectives of time or energy, as a share of the objective: joints with spare time
then move smoothly. Curves for arms of few joints, whose joints have little spare time, get less."""
MIN_LEG_DURATION = 1e-4
"""Shortest duration of a leg, s."""


@dataclass(frozen=True, eq=False)
class Knots:
    """A motion on a mesh: the variables of the program."""

    durations: Array
    """Durations of the legs, shape (legs,), s."""
    q: Array
    """Joint values at the knots, shape (intervals + 1, n), rad and m."""
    qd: Array
    """Joint rates at the knots, shape (intervals + 1, n), rad/s and m/s."""
    qdd: Array
    """Accelerations, shape (columns, n), rad/s^2 and m/s^2; see :class:`Curve`."""

    @property
    def vector(self) -> Array:
        """The variables in the program's order, shape (variables,), SI units."""
        return np.concatenate([self.durations, self.q.ravel(), self.qd.ravel(), self.qdd.ravel()])

    @classmethod
    def of(cls, vector: Array, mesh: Mesh, n: int) -> Knots:
        """Return the knots of a vector of variables, shape (variables,), SI units."""
        legs, knots, columns = len(mesh.legs), mesh.intervals + 1, mesh.curve.columns(mesh.intervals)
        parts = np.split(vector, np.cumsum([legs, n * knots, n * knots]))
        return cls(
            parts[0], *(part.reshape(count, n) for part, count in zip(parts[1:], (knots, knots, columns), strict=True))
        )


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one kind, repeated at several points."""

    what: str
    """Name of the limited quantity, such as ``"torque"``."""
    count: int
    """Number of rows at each point."""
    points: int
    low: Array
    """Lower bounds, shape (count,)."""
    high: Array


class Problem:
    """The nonlinear program of one arm, objective and set of constraints on one mesh.

    Start, goal, limits, payload, durations and the constraints' parameters are arguments of the program.
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
        """Whether motions begin and end with zero acceleration."""
        return self.jerk_limited or self.objective.has_jerk

    # Arguments

    @cached_property
    def parameter_sizes(self) -> tuple[int, ...]:
        """Lengths of the parameters: payload, each constraint, scale of the cost, scales of accelerations."""
        each = (constraint.size(self.description) for constraint in self.constraints)
        return (LOAD if self.payload else 0, *each, 1, self.n)

    def parameters(self, load: Array | None, each: tuple[Array, ...], scale: float, usual: Array) -> Array:
        """Return the program's parameters as one array; ``usual`` are the scales of accelerations, shape (n,)."""
        return np.concatenate([np.zeros(0) if load is None else load, *each, [scale], 1 / usual])

    # The program

    @cached_property
    def program(self) -> tuple[dict[str, Any], list[Rows]]:
        """The program's x, p, f and g for Ipopt, and the kinds of its rows."""
        import casadi

        n, mesh = self.n, self.mesh
        K, legs = mesh.intervals, len(mesh.legs)
        D = casadi.MX.sym("durations", legs)
        Q, V = casadi.MX.sym("q", n, K + 1), casadi.MX.sym("qd", n, K + 1)
        A = casadi.MX.sym("qdd", n, mesh.curve.columns(K))
        p = casadi.MX.sym("p", sum(self.parameter_sizes))
        H = casadi.repmat(casadi.DM(mesh.shares).T * casadi.horzcat(*(D[int(leg)] for leg in mesh.leg)), n, 1)
        dense = any(constraint.moving for constraint in self.constraints)
        motion = MotionPieces.of(mesh.curve, Q, V, A, H, dense=dense)
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
        if motion.qdd_inside is not None:
            add("acceleration", motion.qdd_inside, -np.inf, np.inf)
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
                add(constraint.what, values[begin : begin + count, :], _lower_bound(constraint), 1.0)
                begin += count
        f = self._cost(D, motion, integrals, A, p)
        x = casadi.vertcat(D, casadi.vec(Q), casadi.vec(V), casadi.vec(A))
        return {"x": x, "p": p, "f": f, "g": casadi.vertcat(*g)}, rows

    def _cost(
        self, D: casadi.MX, motion: MotionPieces, integrals: list[casadi.MX], A: casadi.MX, p: casadi.MX
    ) -> casadi.MX:
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
        if self.objective.needs_smoothing:
            # Weighted by shares of time, since meshes are finer at their ends.
            squares = casadi.sum1((A * casadi.repmat(usual, 1, A.shape[1])) ** 2)
            cost += (
                SMOOTHING_WEIGHTS[self.mesh.curve]
                / (self.n * len(self.mesh.legs))
                * casadi.dot(casadi.DM(self._column_shares), squares.T)
            )
        return cost

    @property
    def _column_shares(self) -> Array:
        """The share of time of each acceleration variable."""
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

    # Rows at one point

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
        return [
            constraint.checked_rows(self.point, symbols) for constraint, symbols in given if constraint.moving == moving
        ]

    @cached_property
    def _state_rows(self) -> list[tuple[str, int, Any, Any]]:
        made = [("torque", self.n, -np.inf, np.inf)] if self.with_torque else []
        moving = [constraint for constraint in self.constraints if constraint.moving]
        for constraint, rows in zip(moving, self._rows_of(moving=True), strict=True):
            made.append((constraint.what, int(rows.numel()), _lower_bound(constraint), 1.0))
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


def _lower_bound(constraint: Constraint) -> float:
    return -1.0 if constraint.two_sided else -np.inf
