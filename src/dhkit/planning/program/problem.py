"""A motion as a nonlinear program: variables at knots, rows of continuity and of limits.

Acceleration is constant, linear or quadratic inside an interval and integrated exactly, so that a solution is exactly
a motion; limits can be exceeded only between the points where they are imposed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.planning.certificate import NO_AVOIDANCE, motion_constraints
from dhkit.planning.criteria import LOAD, Constraint, Limit, Objective, Point
from dhkit.planning.obstacles import PlaneRow
from dhkit.planning.program.blocks import Block, BlockProgram, Indices, LocalFunction, RowKind, Rows, Scaling
from dhkit.planning.program.mesh import Curve, Interval, Knots, Mesh
from dhkit.planning.program.program import limit_rows
from dhkit.symbolic import Friction
from dhkit.symbolic.differentiable.frames import SymbolicTable
from dhkit.trajectories import Limits

if TYPE_CHECKING:
    import casadi

SMOOTHING_WEIGHTS = {Curve.CONSTANT: 1e-3, Curve.JUMPING: 1e-5, Curve.LINEAR: 1e-4, Curve.QUADRATIC: 1e-3}
"""Weight of squared accelerations in objectives of time or energy, as a share of the objective: joints with spare time
then move smoothly. Curves for arms of few joints, whose joints have little spare time, get less."""
USUAL_MOVE, USUAL_DURATIONS = 0.1, (0.1, 10.0)
"""Smallest largest move (rad or m) and range of durations (s) of motions that are planned in SI units."""


@dataclass(frozen=True, eq=False)
class Variables:
    """Indices of a program's variables: a row for each joint, a column for each point; empty where there are none."""

    durations: Indices
    """Of each leg, shape (legs,)."""
    q: Indices
    """At the knots, shape (n, intervals + 1)."""
    qd: Indices
    qdd: Indices
    """Shape (n, columns), see :class:`Curve`."""
    middles: tuple[Indices, Indices, Indices]
    """Joint values, rates and accelerations at the middles of intervals, shape (n, intervals) each or empty."""
    positive_parts: Indices
    """Of the objective's quantities at the points of the states, shape (k, P)."""

    @classmethod
    def of(cls, n: int, mesh: Mesh, middles: tuple[bool, bool, bool]) -> Variables:
        """Return the indices of variables in the order of the fields, point by point."""
        K = mesh.intervals
        counts = (K + 1, K + 1, mesh.curve.columns(K), *(K * is_there for is_there in middles))
        edges = len(mesh.legs) + n * np.cumsum([0, *counts])
        q, qd, qdd, *rest = (
            np.arange(edge, edge + n * count).reshape(n, count, order="F")
            for edge, count in zip(edges[:-1], counts, strict=True)
        )
        none = np.zeros((0, 0), dtype=int)
        return cls(np.arange(len(mesh.legs)), q, qd, qdd, (rest[0], rest[1], rest[2]), none)

    def with_positive_parts(self, quantities: int, points: int) -> Variables:
        """Return the same with the positive parts of so many quantities at so many points of the states."""
        indices = self.count + np.arange(quantities * points)
        return replace(self, positive_parts=indices.reshape(quantities, points, order="F"))

    @property
    def count(self) -> int:
        """The number of variables."""
        rest = (self.q, self.qd, self.qdd, *self.middles, self.positive_parts)
        return len(self.durations) + sum(indices.size for indices in rest)


@dataclass(frozen=True, eq=False)
class StatePoints:
    """Points of a motion: the indices of their variables, their intervals, and their weights in an integral."""

    q: Indices
    """Shape (n, P)."""
    qd: Indices
    qdd: Indices
    intervals: Indices
    """First and last interval of each point, shape (P, 2)."""
    weights: Array
    """Shape (P,), shares of the leg's duration."""
    leg: Indices
    """Shape (P,)."""
    is_limited: NDArray[np.bool_]
    """Whether limits apply, shape (P,): a point that appears twice is limited once."""

    @classmethod
    def of(cls, mesh: Mesh, at: Variables, *, with_middles: bool) -> StatePoints:
        """Return the ends of intervals, and their middles on request; a curve without jumps has both ends in common."""
        K = mesh.intervals
        step = np.arange(mesh.intervals)
        columns = np.array([mesh.curve.columns_of(k) for k in range(K)])
        each = np.stack([step, step], axis=1)
        if mesh.curve in (Curve.CONSTANT, Curve.JUMPING):
            ends = cls._of(
                np.hstack([at.q[:, :-1], at.q[:, 1:]]),
                np.hstack([at.qd[:, :-1], at.qd[:, 1:]]),
                np.hstack([at.qdd[:, columns[:, 0]], at.qdd[:, columns[:, -1]]]),
                np.vstack([each, each]),
                np.tile(mesh.shares, 2) * (1 / 6 if with_middles else 1 / 2),
                np.tile(mesh.leg, 2),
            )
        else:
            # A knot between two legs appears once for each, since its weights depend on both durations.
            leg, shares = mesh.leg, mesh.shares
            knots = [(leg[0], 0, 0, 0, shares[0] / 6)]
            for k in range(1, K):
                before = shares[k - 1] / 6
                after = shares[k] / 6
                if leg[k] == leg[k - 1]:
                    knots.append((leg[k], k, k - 1, k, before + after))
                else:
                    knots += [(leg[k - 1], k, k - 1, k, before), (leg[k], k, k - 1, k, after)]
            knots.append((leg[-1], K, K - 1, K - 1, shares[-1] / 6))
            which = np.array([knot[:4] for knot in knots], dtype=int)
            at_knot = np.append(columns[:, 0], columns[-1, -1])
            ends = cls._of(
                at.q[:, which[:, 1]],
                at.qd[:, which[:, 1]],
                at.qdd[:, at_knot[which[:, 1]]],
                which[:, 2:],
                np.array([knot[4] for knot in knots]),
                which[:, 0],
                np.append(True, np.diff(which[:, 1]) > 0),
            )
        if not with_middles:
            return ends
        q, qd, qdd = at.middles
        qdd = qdd if qdd.size else at.qdd[:, columns[:, 1]]
        return ends._with_points(cls._of(q, qd, qdd, each, 2 / 3 * mesh.shares, mesh.leg))

    @classmethod
    def _of(
        cls,
        q: Indices,
        qd: Indices,
        qdd: Indices,
        intervals: Indices,
        weights: Array,
        leg: Indices,
        is_limited: NDArray[np.bool_] | None = None,
    ) -> StatePoints:
        """Return points that are all limited, unless told otherwise."""
        is_limited = np.ones(len(leg), dtype=bool) if is_limited is None else is_limited
        return cls(q, qd, qdd, intervals, weights, leg, is_limited)

    @property
    def count(self) -> int:
        """The number of points."""
        return len(self.leg)

    def _with_points(self, other: StatePoints) -> StatePoints:
        """Return these points followed by others."""
        return StatePoints(
            np.hstack([self.q, other.q]),
            np.hstack([self.qd, other.qd]),
            np.hstack([self.qdd, other.qdd]),
            np.vstack([self.intervals, other.intervals]),
            np.append(self.weights, other.weights),
            np.append(self.leg, other.leg),
            np.append(self.is_limited, other.is_limited),
        )


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
        self.description = description
        self.objective = objective
        self.constraints = constraints
        self.mesh = mesh
        self.n = description.n
        self.payload = payload
        self.jerk_limited = jerk_limited
        self.point = Point(description, limits, friction, payload)
        self._plane_functions: dict[tuple[int, int | None], LocalFunction] = {}
        every = enumerate(motion_constraints(limits, NO_AVOIDANCE, constraints))
        # Positions, rates and accelerations are variables; their limits are bounds, and rows inside intervals.
        self._every = dict(every)
        others = [(k, constraint) for k, constraint in self._every.items() if k >= Limit.TORQUE]
        others = [(k, constraint) for k, constraint in others if constraint.is_limiting]
        self.moving = tuple(pair for pair in others if pair[1].moving)
        self.places = tuple(pair for pair in others if not pair[1].moving)
        self.with_states = bool(self.moving) or objective.has_integral
        self._power = objective.positive_parts(self.point)

    @property
    def jerk_counts(self) -> bool:
        """Whether motions begin and end with zero acceleration."""
        return self.jerk_limited or self.objective.has_jerk

    # Variables: of the motion, and its states at the middles of intervals where limits apply there too

    @cached_property
    def variables(self) -> Variables:
        """Indices of the program's variables."""
        curve = self.mesh.curve
        has_middles = self.with_states and self._states_at_middles
        variables = Variables.of(
            self.n,
            self.mesh,
            middles=(
                has_middles or bool(self.places) or curve is Curve.QUADRATIC,
                has_middles,
                has_middles and curve is not Curve.QUADRATIC,
            ),
        )
        if not self.with_states:
            return variables
        points = StatePoints.of(self.mesh, variables, with_middles=has_middles)
        return variables.with_positive_parts(self._power.numel(), points.count)

    @property
    def _states_at_middles(self) -> bool:
        has_constraints = any(k > Limit.CLEARANCE for k, _ in self.moving)
        return self.mesh.curve in (Curve.LINEAR, Curve.QUADRATIC) or (
            self.mesh.curve is Curve.JUMPING and has_constraints
        )

    def vector(self, knots: Knots, load: Array | None) -> Array:
        """Return the variables of a motion, shape (variables,), SI units; a payload's parameters are shape (10,)."""
        at = self.variables
        interval = knots.intervals(self.mesh)
        x = np.empty(at.count)
        middles = (interval.q_middle, interval.qd_middle, interval.b)
        given = zip((at.q, at.qd, at.qdd, *at.middles), (knots.q, knots.qd, knots.qdd, *middles), strict=True)
        x[at.durations] = knots.durations
        for indices, values in given:
            x[indices.ravel()] = values.T.ravel() if indices.size else []
        if at.positive_parts.size:
            points = self._state_points
            states = (x[points.q], x[points.qd], x[points.qdd])
            powers = self._powers(*states, np.zeros(0) if load is None else load).toarray()
            x[at.positive_parts] = np.maximum(powers, 0.0)
        return x

    @cached_property
    def _powers(self) -> casadi.Function:
        """The quantities whose positive parts are in the objective, as a function of states and payload."""
        import casadi

        point = self.point
        return casadi.Function("powers", [point.q, point.qd, point.qdd, point.load], [self._power], {"cse": True})

    def knots(self, x: Array) -> Knots:
        """Return the motion of variables, shape (variables,), SI units."""
        at = self.variables
        return Knots(x[at.durations], x[at.q].T, x[at.qd].T, x[at.qdd].T)

    def scaling(self, program: BlockProgram, guess: Knots, cost: float) -> Scaling:
        """Return units in which a small, fast or slow motion is of order one; SI units for others.

        Parameters
        ----------
        cost
            Size of the guess's cost, in the unit of the objective.
        """
        at = self.variables
        span = float(np.ptp(guess.q, axis=0).max())
        total = float(guess.durations.sum())
        length = span if 0 < span < USUAL_MOVE else 1.0
        time = 1.0 if USUAL_DURATIONS[0] < total < USUAL_DURATIONS[1] else total
        units = program.unscaled
        rate = cost / total
        for k, indices in enumerate((at.q, at.qd, at.qdd, *at.middles)):
            units.unit[indices] = length / time ** (k % 3)
        units.unit[at.durations] = time
        units.unit[at.positive_parts] = rate
        if length < 1.0:
            for indices in (at.q, at.middles[0]):
                units.offset[indices] = guess.q[:1].T
        row_units = program.row_units(lambda rows: _unit(rows, length, time, rate))
        return Scaling(units.offset, units.unit, row_units)

    # Arguments

    @cached_property
    def parameter_sizes(self) -> tuple[int, ...]:
        """Lengths of the parameters: payload, each constraint, scale of the cost, scales of accelerations, shares."""
        each = (constraint.size(self.description) for constraint in self._every.values())
        return (LOAD if self.payload else 0, *each, 1, self.n, self.mesh.intervals, len(self._weights))

    def parameters(self, load: Array | None, each: Sequence[Array], scale: float, usual: Array) -> Array:
        """Return the program's parameters as one array.

        Parameters
        ----------
        each
            Parameters of all constraints of the motion.
        usual
            Scales of accelerations, shape (n,).
        """
        given = [np.zeros(0) if load is None else load, *each, [scale], 1 / usual]
        return np.concatenate([*given, self.mesh.shares, self._weights])

    @cached_property
    def _parameter_indices(self) -> list[Indices]:
        """Indices of each of ``parameter_sizes``."""
        edges = np.cumsum([0, *self.parameter_sizes])
        return [np.arange(a, b) for a, b in pairwise(edges)]

    # The program

    @cached_property
    def program(self) -> BlockProgram:
        """The program's blocks."""
        blocks = [self._durations, self._intervals]
        if self.with_states:
            blocks.append(self._states)
        if self.places:
            blocks.append(self._resting_places)
        return BlockProgram(self.variables.count, sum(self.parameter_sizes), tuple(blocks))

    def apart(self, rows: Sequence[PlaneRow]) -> tuple[BlockProgram, Array]:
        """Return the program with points of links kept on their sides of planes, and its additional parameters."""
        at = self.variables
        begin = self.program.parameters
        blocks = list(self.program.blocks)
        values = [np.zeros(0)]
        for link, frame in dict.fromkeys((row.link, row.frame) for row in rows):
            of_link = [row for row in rows if (row.link, row.frame) == (link, frame)]
            knots = np.array([row.knot for row in of_link])
            planes = np.array([[*row.point, *row.normal, row.level] for row in of_link])
            intervals = np.clip(np.stack([knots - 1, knots], axis=1), 0, self.mesh.intervals - 1)
            parameters = (begin + np.arange(planes.size)).reshape(planes.shape).T
            kinds = (Rows(RowKind.PLANE, Limit.CLEARANCE.what, 1),)
            blocks.append(Block(self._beside_plane(link, frame), at.q[:, knots], parameters, kinds, intervals))
            values.append(planes.ravel())
            begin += planes.size
        return BlockProgram(at.count, begin, tuple(blocks)), np.concatenate(values)

    def _beside_plane(self, link: int, frame: int | None) -> LocalFunction:
        """Return how far a point of a link, given in its frame, is beyond a plane of the world or another frame, m."""
        import casadi

        if (link, frame) not in self._plane_functions:
            point = casadi.SX.sym("point", 3)
            normal = casadi.SX.sym("normal", 3)
            level = casadi.SX.sym("level")
            table = SymbolicTable.of(self.description)
            q = self.point.q
            x = casadi.vertcat(point, 1)
            for i in reversed(range(frame or 0, link)):
                x = table.link_transform(i, q[i]) @ x
            if frame is None:
                x = table.world_to_frames(q)[0] @ x
            x = x[:3]
            parameters = casadi.vertcat(point, normal, level)
            beyond = casadi.dot(normal, x) - level
            self._plane_functions[link, frame] = LocalFunction(self.point.q, parameters, beyond)
        return self._plane_functions[link, frame]

    @property
    def _durations(self) -> Block:
        """The block of the legs' durations."""
        import casadi

        D = casadi.SX.sym("durations", len(self.mesh.legs))
        scale = casadi.SX.sym("scale")
        total = casadi.sum1(D)
        function = LocalFunction(D, scale, total, scale * self.objective.time_weight * total)
        scale_index = self._parameter_indices[-4]
        kinds = (Rows(RowKind.DURATION, "duration", 1),)
        return Block(function, self.variables.durations[:, None], scale_index[:, None], kinds)

    @property
    def _intervals(self) -> Block:
        """The block of the intervals: continuity, and bounds of what lies inside."""
        import casadi

        n = self.n
        mesh = self.mesh
        at = self.variables
        K = mesh.intervals
        curve = mesh.curve
        symbol = casadi.SX.sym
        duration = symbol("duration")
        share = symbol("share")
        scale = symbol("scale")
        usual = symbol("usual", n)
        q, qd, q_next, qd_next = (symbol(name, n) for name in ("q", "qd", "q_next", "qd_next"))
        accelerations = [symbol(f"qdd{k}", n) for k in range(len(curve.columns_of(0)))]
        lifted = [symbol(f"middle{k}", n if indices.size else 0) for k, indices in enumerate(at.middles)]
        interval = Interval(share * duration, q, qd, *curve.abc(accelerations))
        a = interval.a
        b = interval.b
        c = interval.c
        h = interval.h
        continuity = [
            Rows(RowKind.CONTINUITY, f"continuity of {what}", n, order=order, of_joints=True)
            for order, what in enumerate(("position", "velocity", "acceleration"))
        ]
        rows = [(continuity[0], q_next - interval.q_end), (continuity[1], qd_next - interval.qd_end)]
        for kind, symbols, value in zip(continuity, lifted, (interval.q_middle, interval.qd_middle, b), strict=True):
            if symbols.numel():
                rows.append((kind, symbols - value))
        # Polynomials are inside the hull of their Bernstein coefficients: of positions, velocities, accelerations.
        inside: dict[Limit, list[casadi.SX]] = {}
        match curve:
            case Curve.CONSTANT:
                inside[Limit.POSITION] = [q + h / 2 * qd]
            case Curve.JUMPING | Curve.LINEAR:
                inside[Limit.POSITION] = [q + h / 3 * qd, q_next - h / 3 * qd_next]
                inside[Limit.VELOCITY] = [qd + h / 2 * a]
            case Curve.QUADRATIC:
                inside[Limit.VELOCITY] = [qd + h / 3 * a, qd_next - h / 3 * c]
                inside[Limit.ACCELERATION] = [2 * b - (a + c) / 2]
        if self.jerk_limited:
            inside[Limit.JERK] = list(interval.jerks)[: 1 if curve is Curve.LINEAR else 2]
        reciprocals = {limit: symbol(limit.what, n) for limit in inside if limit is not Limit.POSITION}
        for limit, values in inside.items():
            order = 0 if limit is Limit.POSITION else None
            kind = Rows(RowKind.LIMIT, limit.what, n, limit, order, of_joints=True)
            rows += [(kind, value * reciprocals[limit] if limit in reciprocals else value) for value in values]
        cost = casadi.SX(1, 1)
        if self.objective.needs_smoothing:
            weights = curve.column_weights
            mean = sum(w * casadi.sumsqr(x * usual) for w, x in zip(weights, accelerations, strict=True))
            # Weighted by shares of time, since meshes are finer at their ends.
            cost += SMOOTHING_WEIGHTS[curve] / (n * len(mesh.legs)) * share * mean
        if self.objective.has_jerk:
            first, last = interval.jerks
            squares = casadi.sum1(first * first + first * last + last * last) / 3
            cost += scale * self.objective.jerk_weight * h * squares
        z = casadi.vertcat(duration, q, qd, q_next, qd_next, *accelerations, *lifted)
        p = casadi.vertcat(share, scale, usual, *reciprocals.values())
        columns = np.array([curve.columns_of(k) for k in range(K)])
        *_, scale_at, usual_at, shares_at, _ = self._parameter_indices
        variables = [
            at.durations[mesh.leg][None],
            *(side for ends in (slice(None, -1), slice(1, None)) for side in (at.q[:, ends], at.qd[:, ends])),
            *(at.qdd[:, column] for column in columns.T),
            *(indices for indices in at.middles if indices.size),
        ]
        of_limits = [self._parameter_indices[1 + limit] for limit in reciprocals]
        parameters = [shares_at[None], np.tile(np.concatenate([scale_at, usual_at, *of_limits])[:, None], K)]
        return Block(
            LocalFunction(z, p, casadi.vertcat(*(value for _, value in rows)), cost),
            np.vstack(variables),
            np.vstack(parameters),
            tuple(kind for kind, _ in rows),
            np.tile(np.arange(K)[:, None], 2),
        )

    @cached_property
    def _state_points(self) -> StatePoints:
        """The points where torques are limited and integrands are summed."""
        return StatePoints.of(self.mesh, self.variables, with_middles=self._states_at_middles)

    @property
    def _weights(self) -> Array:
        """Weights of the states in an integral over time, as shares of their legs' durations."""
        return self._state_points.weights if self.objective.has_integral else np.zeros(0)

    @property
    def _states(self) -> Block:
        """The block of the states: torques, moving constraints, and the integrands of the objective."""
        import casadi

        point = self.point
        points = self._state_points
        symbols = self._parameter_symbols
        rows = limit_rows(self.moving, point, symbols[1:])
        duration, scale, weight = (casadi.SX.sym(name) for name in ("duration", "scale", "weight"))
        z = [point.q, point.qd, point.qdd]
        p = list(symbols)
        cost = None
        variables: list[Indices] = [points.q, points.qd, points.qdd]
        parameters = np.concatenate(self._parameter_indices[: len(symbols)])[:, None]
        parameters = np.tile(parameters, points.count)
        if self.objective.has_integral:
            power = self._power
            parts = casadi.SX.sym("parts", self._power.numel())
            rows.append((Rows(RowKind.POSITIVE_PART, "positive power", power.numel()), parts - power))
            cost = scale * weight * duration * (self.objective.integrand(point) + casadi.sum1(parts))
            z += [duration, parts]
            variables += [self.variables.durations[points.leg][None], self.variables.positive_parts]
            *_, scale_at, _, _, weights_at = self._parameter_indices
            parameters = np.vstack([parameters, np.tile(scale_at, points.count)[None], weights_at[None]])
            p += [scale, weight]
        return Block(
            LocalFunction(casadi.vertcat(*z), casadi.vertcat(*p), casadi.vertcat(*(value for _, value in rows)), cost),
            np.vstack(variables),
            parameters,
            tuple(kind for kind, _ in rows),
            points.intervals,
            points.is_limited,
        )

    @property
    def _resting_places(self) -> Block:
        """The block of the constraints of positions: at inner knots and at middles."""
        import casadi

        at = self.variables
        K = self.mesh.intervals
        symbols = self._parameter_symbols
        rows = limit_rows(self.places, self.point, symbols[1:])
        step = np.arange(K)
        parameters = np.concatenate(self._parameter_indices[: len(symbols)])[:, None]
        return Block(
            LocalFunction(self.point.q, casadi.vertcat(*symbols), casadi.vertcat(*(value for _, value in rows))),
            np.hstack([at.q[:, 1:-1], at.middles[0]]),
            np.tile(parameters, 2 * K - 1),
            tuple(kind for kind, _ in rows),
            np.vstack([np.stack([step[:-1], step[1:]], axis=1), np.stack([step, step], axis=1)]),
        )

    @cached_property
    def _parameter_symbols(self) -> list[casadi.SX]:
        """Symbols of the payload and of each constraint's parameters."""
        import casadi

        sizes = self.parameter_sizes[1 : 1 + len(self._every)]
        return [self.point.load, *(casadi.SX.sym(f"p{k}", size) for k, size in enumerate(sizes))]


def _unit(rows: Rows, length: float, time: float, rate: float) -> float:
    """Return the unit of rows, for units of joint values, of time (s) and of the cost over time."""
    if rows.kind is RowKind.DURATION:
        return time
    if rows.kind is RowKind.POSITIVE_PART:
        return rate
    return 1.0 if rows.order is None else length / time**rows.order
