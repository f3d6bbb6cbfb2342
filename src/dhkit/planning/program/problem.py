"""A motion as a nonlinear program: variables at knots, rows of continuity and of limits.

Acceleration is constant, linear or quadratic inside an interval and integrated exactly, so that a solution is exactly
a motion; limits can be exceeded only between the points where they are imposed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.planning.certificate import NO_AVOIDANCE, motion_constraints
from dhkit.planning.criteria import LOAD, Constraint, Limit, Objective, Point
from dhkit.planning.obstacles import PlaneRow
from dhkit.planning.program.blocks import (
    Block,
    BlockProgram,
    Indices,
    LocalFunction,
    RowKind,
    Rows,
    Scaling,
)
from dhkit.planning.program.mesh import Curve, Interval, Knots, Mesh
from dhkit.planning.program.optimization_program import limit_rows
from dhkit.symbolic import Friction
from dhkit.symbolic.differentiable.frames import SymbolicTable
from dhkit.trajectories import Limits

if TYPE_CHECKING:
    import casadi

SMOOTHING_WEIGHTS = {
    Curve.CONSTANT: 1e-3,
    Curve.JUMPING: 1e-5,
    Curve.LINEAR: 1e-4,
    Curve.QUADRATIC: 1e-3,
}
"""Weight of squared accelerations in objectives of time or energy, as a share of the objective: joints with spare time
then move smoothly. Curves for arms of few joints, whose joints have little spare time, get less."""
USUAL_MOVE = 0.1
"""Largest joint move, rad or m, from which a motion is planned in SI units; a smaller one is scaled to order 1."""
USUAL_DURATIONS = (0.1, 10.0)
"""Range of durations, s, of motions that are planned with the second as the unit of time."""


class Middles(NamedTuple):
    """Indices of the variables at the middles of intervals, shape (n, intervals) each or empty."""

    q: Indices
    """Joint values."""
    qd: Indices
    """Joint rates."""
    qdd: Indices
    """Accelerations."""


@dataclass(frozen=True, eq=False)
class Variables:
    """Indices of a program's variables: a row for each joint, a column for each point; empty where there are none."""

    durations: Indices
    """Durations of the legs, shape (legs,)."""
    q: Indices
    """Joint values at the knots, shape (n, intervals + 1)."""
    qd: Indices
    """Joint rates at the knots, shape (n, intervals + 1)."""
    qdd: Indices
    """Accelerations, shape (n, columns), see :class:`Curve`."""
    middles: Middles
    """States at the middles of intervals, where they are variables."""
    positive_parts: Indices
    """Positive parts of the objective's quantities at the points of the states, shape (k, P)."""

    @classmethod
    def of(cls, n: int, mesh: Mesh, middles: tuple[bool, bool, bool]) -> Variables:
        """Return the indices of variables in the order of the fields, point by point."""
        K = mesh.intervals
        legs = len(mesh.legs)
        counts = [K + 1, K + 1, mesh.curve.columns(K), *(K * is_there for is_there in middles)]
        edges = legs + n * np.cumsum([0, *counts])
        blocks = [
            np.arange(edge, edge + n * count).reshape(n, count, order="F")
            for edge, count in zip(edges[:-1], counts, strict=True)
        ]
        q, qd, qdd, q_middle, qd_middle, qdd_middle = blocks
        none = np.zeros((0, 0), dtype=int)
        return cls(np.arange(legs), q, qd, qdd, Middles(q_middle, qd_middle, qdd_middle), none)

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
    """Joint values, shape (n, P)."""
    qd: Indices
    """Joint rates, shape (n, P)."""
    qdd: Indices
    """Accelerations, shape (n, P)."""
    intervals: Indices
    """First and last interval of each point, shape (P, 2)."""
    weights: Array
    """Weights in an integral over time as shares of the leg's duration, shape (P,)."""
    leg: Indices
    """Leg of each point, shape (P,)."""
    is_limited: NDArray[np.bool_]
    """Whether limits apply, shape (P,): a point that appears twice is limited once."""

    @classmethod
    def of(cls, mesh: Mesh, at: Variables, *, with_middles: bool) -> StatePoints:
        """Return the ends of intervals, and their middles on request; a curve without jumps has both ends in common.

        The weights are those of Simpson's rule with middles, else of the trapezoidal rule, for an interval of length h:

            integral f dt = h/6 (f_begin + 4 f_middle + f_end),    integral f dt = h/2 (f_begin + f_end).
        """
        if mesh.curve in (Curve.CONSTANT, Curve.JUMPING):
            ends = cls._ends_of_intervals(mesh, at, weight=1 / 6 if with_middles else 1 / 2)
        else:
            ends = cls._knots(mesh, at)
        if not with_middles:
            return ends

        k = np.arange(mesh.intervals)
        q, qd, qdd = at.middles
        if not qdd.size:  # quadratic accelerations: those at the middles are variables of the curve
            qdd = at.qdd[:, [mesh.curve.columns_of(i)[1] for i in range(mesh.intervals)]]
        return ends._with_points(
            cls._of(q, qd, qdd, np.stack([k, k], axis=1), 2 / 3 * mesh.shares, mesh.leg)
        )

    @classmethod
    def _ends_of_intervals(cls, mesh: Mesh, at: Variables, weight: float) -> StatePoints:
        """Return the beginnings of all intervals, then their ends: two points a knot, where accelerations jump."""
        k = np.arange(mesh.intervals)
        each = np.stack([k, k], axis=1)
        columns = np.array([mesh.curve.columns_of(i) for i in range(mesh.intervals)])
        return cls._of(
            np.hstack([at.q[:, :-1], at.q[:, 1:]]),
            np.hstack([at.qd[:, :-1], at.qd[:, 1:]]),
            np.hstack([at.qdd[:, columns[:, 0]], at.qdd[:, columns[:, -1]]]),
            np.vstack([each, each]),
            np.tile(mesh.shares, 2) * weight,
            np.tile(mesh.leg, 2),
        )

    @classmethod
    def _knots(cls, mesh: Mesh, at: Variables) -> StatePoints:
        """Return the knots, with the weights of Simpson's rule; a knot between two legs appears once for each.

        Its weights depend on both durations.
        """
        # A knot has h/6 of each interval beside it: as its end in the one, and as its beginning in the other.
        K = mesh.intervals
        leg = mesh.leg
        sixth = mesh.shares / 6
        points = [_KnotPoint(leg[0], 0, 0, 0, sixth[0])]
        for k in range(1, K):
            if leg[k] == leg[k - 1]:
                points.append(_KnotPoint(leg[k], k, k - 1, k, sixth[k - 1] + sixth[k]))
            else:
                points.append(_KnotPoint(leg[k - 1], k, k - 1, k, sixth[k - 1]))
                points.append(_KnotPoint(leg[k], k, k - 1, k, sixth[k]))
        points.append(_KnotPoint(leg[-1], K, K - 1, K - 1, sixth[-1]))

        knot = np.array([point.knot for point in points])
        columns = [mesh.curve.columns_of(k) for k in range(K)]
        column_at = np.array([*(of_interval[0] for of_interval in columns), columns[-1][-1]])
        return cls._of(
            at.q[:, knot],
            at.qd[:, knot],
            at.qdd[:, column_at[knot]],
            np.array([(point.before, point.after) for point in points]),
            np.array([point.weight for point in points]),
            np.array([point.leg for point in points]),
            np.append(True, np.diff(knot) > 0),
        )

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


class _KnotPoint(NamedTuple):
    """A knot of a mesh as a point of one leg's integral."""

    leg: int
    knot: int
    before: int
    """Interval before the knot; that after the first one."""
    after: int
    weight: float
    """Share of the leg's duration."""


@dataclass(frozen=True, eq=False)
class _ParameterIndices:
    """Indices of a program's parameters."""

    load: Indices
    """Indices of the payload's parameters; empty without a payload."""
    constraints: list[Indices]
    """Indices of the parameters of each constraint of the motion."""
    scale: Indices
    """Index of the scale of the cost, shape (1,)."""
    usual: Indices
    """Indices of the reciprocals of the accelerations' scales, shape (n,)."""
    shares: Indices
    """Indices of the shares of intervals in their legs, shape (K,)."""
    weights: Indices
    """Indices of the weights of the states in an integral, shape (P,) or empty."""

    @property
    def count(self) -> int:
        """The number of parameters."""
        others = (self.scale, self.usual, self.shares, self.weights)
        return len(self.of_point) + sum(len(indices) for indices in others)

    @property
    def of_point(self) -> Indices:
        """Indices of the parameters of the payload and of all constraints."""
        return np.concatenate([self.load, *self.constraints])


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
        self._every = dict(enumerate(motion_constraints(limits, NO_AVOIDANCE, constraints)))

        # Positions, rates and accelerations are variables; their limits are bounds, and rows inside intervals.
        others = [
            pair for pair in self._every.items() if pair[0] >= Limit.TORQUE and pair[1].is_limiting
        ]
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
        curve = self.mesh.curve
        has_constraints = any(k > Limit.CLEARANCE for k, _ in self.moving)
        return curve in (Curve.LINEAR, Curve.QUADRATIC) or (
            curve is Curve.JUMPING and has_constraints
        )

    def vector(self, knots: Knots, load: Array | None) -> Array:
        """Return the variables of a motion, shape (variables,), SI units; a payload's parameters are shape (10,)."""
        at = self.variables
        interval = knots.intervals(self.mesh)
        x = np.empty(at.count)
        x[at.durations] = knots.durations
        x[at.q] = knots.q.T
        x[at.qd] = knots.qd.T
        x[at.qdd] = knots.qdd.T
        middles = (interval.q_middle, interval.qd_middle, interval.b)
        for indices, values in zip(at.middles, middles, strict=True):
            if indices.size:
                x[indices] = values.T
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
        return casadi.Function(
            "powers", [point.q, point.qd, point.qdd, point.load], [self._power], {"cse": True}
        )

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
        rate = cost / total

        # A derivative of order k has the unit length / time^k.
        units = program.unscaled
        for order, (at_knots, at_middles) in enumerate(
            zip((at.q, at.qd, at.qdd), at.middles, strict=True)
        ):
            units.unit[at_knots] = length / time**order
            units.unit[at_middles] = length / time**order
        units.unit[at.durations] = time
        units.unit[at.positive_parts] = rate
        if length < 1.0:
            # Joint values count from the start of a small move, so that they are of order one too.
            for indices in (at.q, at.middles.q):
                units.offset[indices] = guess.q[:1].T
        row_units = program.row_units(lambda rows: _unit(rows, length, time, rate))
        return Scaling(units.offset, units.unit, row_units)

    # Arguments

    @cached_property
    def _parameter_indices(self) -> _ParameterIndices:
        """Indices of the program's parameters, in the order of :meth:`parameters`."""
        of_constraints = [constraint.size(self.description) for constraint in self._every.values()]
        counts = [
            LOAD if self.payload else 0,
            *of_constraints,
            1,
            self.n,
            self.mesh.intervals,
            len(self._weights),
        ]
        edges = np.cumsum([0, *counts])
        load, *constraints, scale, usual, shares, weights = [
            np.arange(a, b) for a, b in pairwise(edges)
        ]
        return _ParameterIndices(load, constraints, scale, usual, shares, weights)

    def parameters(
        self, load: Array | None, each: Sequence[Array], scale: float, usual: Array
    ) -> Array:
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

    # The program

    @cached_property
    def program(self) -> BlockProgram:
        """The program's blocks."""
        blocks = [self._durations, self._intervals]
        if self.with_states:
            blocks.append(self._states)
        if self.places:
            blocks.append(self._resting_places)
        return BlockProgram(self.variables.count, self._parameter_indices.count, tuple(blocks))

    def with_planes(self, rows: Sequence[PlaneRow]) -> tuple[BlockProgram, Array]:
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
            blocks.append(
                Block(self._beside_plane(link, frame), at.q[:, knots], parameters, kinds, intervals)
            )
            values.append(planes.ravel())
            begin += planes.size
        return BlockProgram(at.count, begin, tuple(blocks)), np.concatenate(values)

    def _beside_plane(self, link: int, frame: int | None) -> LocalFunction:
        """Return how far a point of a link, given in its frame, is beyond a plane of the world or another frame, m.

        With the point p in frame ``link`` and the plane n . x = level in frame f, or in the world w with f = 0:

            n . x - level,    x = A_(f+1) ... A_link p,    before which T_w0 stands for a plane of the world.
        """
        import casadi

        if (link, frame) in self._plane_functions:
            return self._plane_functions[link, frame]
        p = casadi.SX.sym("point", 3)
        normal = casadi.SX.sym("normal", 3)
        level = casadi.SX.sym("level")
        table = SymbolicTable.of(self.description)
        q = self.point.q

        x = casadi.vertcat(p, 1)
        for i in reversed(range(frame or 0, link)):
            x = table.link_transform(i, q[i]) @ x
        if frame is None:
            x = table.world_to_frames(q)[0] @ x

        beyond = casadi.dot(normal, x[:3]) - level
        function = LocalFunction(q, casadi.vertcat(p, normal, level), beyond)
        self._plane_functions[link, frame] = function
        return function

    @property
    def _durations(self) -> Block:
        """The block of the legs' durations D: the row sum D, and the objective's w_time sum D, scaled."""
        import casadi

        D = casadi.SX.sym("durations", len(self.mesh.legs))
        scale = casadi.SX.sym("scale")
        total = casadi.sum1(D)
        function = LocalFunction(D, scale, total, scale * self.objective.time_weight * total)
        scale_index = self._parameter_indices.scale
        kinds = (Rows(RowKind.DURATION, "duration", 1),)
        return Block(function, self.variables.durations[:, None], scale_index[:, None], kinds)

    @property
    def _intervals(self) -> Block:
        """The block of the intervals: continuity, bounds inside them, and costs of accelerations and jerks."""
        import casadi

        n = self.n
        mesh = self.mesh
        at = self.variables
        K = mesh.intervals
        curve = mesh.curve
        symbol = casadi.SX.sym

        # Interval k lasts h = share * (duration of its leg). Its variables are the states at both its ends, the columns
        # of its accelerations, and the state at its middle where limits apply there.
        duration = symbol("duration")
        share = symbol("share")
        q = symbol("q", n)
        qd = symbol("qd", n)
        q_next = symbol("q_next", n)
        qd_next = symbol("qd_next", n)
        columns = [symbol(f"qdd{k}", n) for k in range(len(curve.columns_of(0)))]
        lifted = [
            symbol(f"middle{k}", n if indices.size else 0) for k, indices in enumerate(at.middles)
        ]
        scale = symbol("scale")
        usual = symbol("usual", n)
        interval = Interval(share * duration, q, qd, *curve.abc(columns))
        h = interval.h
        a = interval.a
        b = interval.b
        c = interval.c

        # Continuity: the variables at the end and at the middle are those of the motion.
        position, velocity, acceleration = (
            Rows(RowKind.CONTINUITY, f"continuity of {what}", n, order=order, of_joints=True)
            for order, what in enumerate(("position", "velocity", "acceleration"))
        )
        rows = [(position, q_next - interval.q_end), (velocity, qd_next - interval.qd_end)]
        of_motion = (interval.q_middle, interval.qd_middle, b)
        for kind, variable, value in zip(
            (position, velocity, acceleration), lifted, of_motion, strict=True
        ):
            if variable.numel():
                rows.append((kind, variable - value))

        # Inside an interval a polynomial lies in the convex hull of its Bernstein coefficients (Farin, Curves and
        # Surfaces for CAGD, 2002, ch. 5). The first and the last are its values at the ends, which are bounded as
        # variables; those between them are rows. With v = qd, from the derivatives at the ends:
        #   square    x,  x + h/2 x',  x_next
        #   cubic     x,  x + h/3 x',  x_next - h/3 x'_next,  x_next
        # A quadratic acceleration through a, b, c has the middle coefficient 2 b - (a + c) / 2.
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
            # The jerk is linear, and constant where the acceleration is linear.
            inside[Limit.JERK] = list(interval.jerks)[: 1 if curve is Curve.LINEAR else 2]

        # Rows of positions are in rad and m; the others are shares of their limits.
        reciprocals = {
            limit: symbol(limit.what, n) for limit in inside if limit is not Limit.POSITION
        }
        for limit, values in inside.items():
            if limit is Limit.POSITION:
                kind = Rows(RowKind.LIMIT, limit.what, n, limit, order=0, of_joints=True)
                rows += [(kind, value) for value in values]
            else:
                kind = Rows(RowKind.LIMIT, limit.what, n, limit, of_joints=True)
                rows += [(kind, value * reciprocals[limit]) for value in values]

        cost = casadi.SX(1, 1)
        if self.objective.needs_smoothing:
            # The mean square of accelerations relative to the usual ones. Intervals count by their shares of time,
            # since meshes are finer at their ends.
            weights = curve.column_weights
            mean_square = sum(
                w * casadi.sumsqr(x * usual) for w, x in zip(weights, columns, strict=True)
            )
            cost += SMOOTHING_WEIGHTS[curve] / (n * len(mesh.legs)) * share * mean_square
        if self.objective.has_jerk:
            # The jerk is linear from j0 to j1, so that the integral of its square is h/3 (j0^2 + j0 j1 + j1^2).
            j0, j1 = interval.jerks
            mean_square = casadi.sum1(j0 * j0 + j0 * j1 + j1 * j1) / 3
            cost += scale * self.objective.jerk_weight * h * mean_square

        z = casadi.vertcat(duration, q, qd, q_next, qd_next, *columns, *lifted)
        column_at = np.array([curve.columns_of(k) for k in range(K)])
        variables = [
            at.durations[mesh.leg][None],
            at.q[:, :-1],
            at.qd[:, :-1],
            at.q[:, 1:],
            at.qd[:, 1:],
            *(at.qdd[:, column] for column in column_at.T),
            *(indices for indices in at.middles if indices.size),
        ]

        p = casadi.vertcat(share, scale, usual, *reciprocals.values())
        indices = self._parameter_indices
        common = np.concatenate(
            [indices.scale, indices.usual, *(indices.constraints[limit] for limit in reciprocals)]
        )
        parameters = [indices.shares[None], np.tile(common[:, None], K)]
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
        """The block of the states: torques, moving constraints, and the integrands of the objective.

        An objective's positive parts max(0, P) are not smooth. Each is replaced by a variable u >= 0 with the row
        u - P >= 0, which a minimum keeps at max(0, P). The cost of a point is

            scale * weight * duration * (integrand + sum u).
        """
        import casadi

        point = self.point
        points = self._state_points
        symbols = self._parameter_symbols
        rows = limit_rows(self.moving, point, symbols[1:])
        cost = None

        z = [point.q, point.qd, point.qdd]
        variables: list[Indices] = [points.q, points.qd, points.qdd]
        p = list(symbols)
        indices = self._parameter_indices
        parameters = np.tile(indices.of_point[:, None], points.count)

        if self.objective.has_integral:
            duration = casadi.SX.sym("duration")
            scale = casadi.SX.sym("scale")
            weight = casadi.SX.sym("weight")
            power = self._power
            u = casadi.SX.sym("parts", power.numel())
            rows.append((Rows(RowKind.POSITIVE_PART, "positive power", power.numel()), u - power))
            cost = scale * weight * duration * (self.objective.integrand(point) + casadi.sum1(u))

            z += [duration, u]
            variables += [self.variables.durations[points.leg][None], self.variables.positive_parts]
            p += [scale, weight]
            scales = np.tile(indices.scale, points.count)
            parameters = np.vstack([parameters, scales[None], indices.weights[None]])

        return Block(
            LocalFunction(
                casadi.vertcat(*z),
                casadi.vertcat(*p),
                casadi.vertcat(*(value for _, value in rows)),
                cost,
            ),
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
        parameters = self._parameter_indices.of_point[:, None]
        k = np.arange(K)
        beside_knots = np.stack([k[:-1], k[1:]], axis=1)
        around_middles = np.stack([k, k], axis=1)
        return Block(
            LocalFunction(
                self.point.q,
                casadi.vertcat(*symbols),
                casadi.vertcat(*(value for _, value in rows)),
            ),
            np.hstack([at.q[:, 1:-1], at.middles.q]),
            np.tile(parameters, 2 * K - 1),
            tuple(kind for kind, _ in rows),
            np.vstack([beside_knots, around_middles]),
        )

    @cached_property
    def _parameter_symbols(self) -> list[casadi.SX]:
        """Symbols of the payload and of each constraint's parameters."""
        import casadi

        constraints = self._parameter_indices.constraints
        return [
            self.point.load,
            *(casadi.SX.sym(f"p{k}", len(at)) for k, at in enumerate(constraints)),
        ]


def _unit(rows: Rows, length: float, time: float, rate: float) -> float:
    """Return the unit of rows, for units of joint values, of time (s) and of the cost over time."""
    if rows.kind is RowKind.DURATION:
        return time
    if rows.kind is RowKind.POSITIVE_PART:
        return rate
    return 1.0 if rows.order is None else length / time**rows.order
