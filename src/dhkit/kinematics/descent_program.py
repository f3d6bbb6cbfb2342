"""Levenberg's descent to a pose as one program: the start, a step that is repeated, and a last step."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi as ca

from dhkit.description import Description
from dhkit.kinematics.closed_form.program import is_pose
from dhkit.kinematics.newton_program import levenberg_step, moved_inside, pose_error, stays
from dhkit.symbolic import Graph, SymbolicTable, jacobian
from dhkit.symbolic.programs.loop import Loop

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_MOST_STEPS = 500
"""Largest number of steps of a search; stalled ones end after 10 to 60."""
_ALWAYS_STEP = 1e-2
"""Squared error, (rad, share of the reach)^2, below which every step is taken, because along a curved valley the error
of Newton's method grows before it falls."""
_STALL_RATIO = 0.7
"""A search is stalled, and given up, when its squared error has not fallen below this ratio times its value
_STALL_STEPS steps earlier."""
_STALL_STEPS = 10
"""Number of steps in which the squared error of a search must fall below _STALL_RATIO times its value."""
_MIN_DAMPING = 1e-4
"""Smallest ratio of the damping to the squared error."""
_DAMPING_DECREASE = 0.25
"""Factor of the damping after a step that reduces the error."""
_DAMPING_INCREASE = 4.0
"""Factor of the damping after a step that is rejected because it increases the error."""
BASE_DAMPING = 1e-13
"""Damping that is always added, for Jacobians without full rank."""


@dataclass(frozen=True)
class _Search:
    """The state of a search: joint values, with the error and the scaled Jacobian there, and its history."""

    q: _SX
    error: _SX
    A: _SX
    """Jacobian without units, see :func:`levenberg_step`."""
    cost: _SX
    """The squared error."""
    damping: _SX
    """Ratio mu of the damping to the squared error."""
    reference_cost: _SX
    """Squared error at the last progress by _STALL_RATIO."""
    steps_since: _SX
    """Number of steps since that progress."""

    @classmethod
    def read(cls, state: _SX, n: int, size: int) -> _Search:
        """Return the parts of a state vector."""
        sizes = [n, size, size * n, 1, 1, 1, 1]
        ends = [sum(sizes[: k + 1]) for k in range(len(sizes))]
        q, error, A, *rest = ca.vertsplit(state, [0, *ends])
        return cls(q, error, ca.reshape(A, size, n), *rest)

    @property
    def vector(self) -> _SX:
        """The state vector."""
        return ca.vertcat(
            self.q,
            self.error,
            ca.vec(self.A),
            self.cost,
            self.damping,
            self.reference_cost,
            self.steps_since,
        )


@dataclass(frozen=True)
class SymbolicArm:
    """An arm in symbols, with the units and limits of its steps."""

    table: SymbolicTable
    table_parameters: _SX
    size: int
    length: _SX
    units: _SX
    turns: _SX
    lower: _SX
    upper: _SX

    @classmethod
    def of(cls, description: Description, size: int) -> SymbolicArm:
        """Return an arm whose numbers are parameters."""
        table, parameters = SymbolicTable.parametric(description)
        names = ("units", "turns", "lower", "upper")
        vectors = [ca.SX.sym(name, description.n) for name in names]
        return cls(table, parameters, size, ca.SX.sym("length"), *vectors)

    @property
    def parameters(self) -> _SX:
        """All parameters: those of the table, then those of :meth:`dhkit.kinematics.newton.Newton.parameters`."""
        own = (self.length, self.units, self.turns, self.lower, self.upper)
        return ca.vertcat(self.table_parameters, *own)

    def at(self, q: _SX, goal: _SX) -> tuple[_SX, _SX]:
        """Return the error of the tool's pose at q, and the Jacobian without units."""
        error = pose_error(self.table.world_to_tool(q), goal, self.length)[: self.size]
        J = jacobian(self.table, q)
        A = ca.vertcat(J[:3, :] / self.length, J[3:, :])[: self.size, :] @ ca.diag(self.units)
        return error, A

    def step(self, q: _SX, error: _SX, A: _SX, damping: _SX) -> _SX:
        """Return the joint values after one step of Levenberg, inside the limits; error and A are those at q."""
        endless = self.turns != 0
        n = q.shape[0]
        limits = [(self.lower[i], self.upper[i], endless[i]) for i in range(n)]
        descent = A.T @ error
        stuck = [stays(q[i], descent[i], *limits[i]) for i in range(n)]
        new = q + self.units * levenberg_step(A, error, damping, stuck)
        return ca.vertcat(*(moved_inside(new[i], *limits[i]) for i in range(n)))

    def inside(self, q: _SX) -> _SX:
        """Return joint values moved into the limits, angles by whole turns to the one nearest to the middle first."""
        joints = []
        for i, is_prismatic in enumerate(self.table.prismatic):
            lower = self.lower[i]
            upper = self.upper[i]
            x = q[i]
            if not is_prismatic:
                middle = 0.5 * (lower + upper)
                turns = ca.floor((x - middle) / math.tau + 0.5)
                is_outside = ca.logic_or(x < lower, x > upper)
                x = ca.if_else(is_outside, x - math.tau * turns, x)
            joints.append(ca.fmin(ca.fmax(x, lower), upper))
        return ca.vertcat(*joints)

    def wrapped(self, q: _SX) -> _SX:
        """Return joint values with angles of joints without limits in (-pi, pi]."""
        joints = []
        for i, is_prismatic in enumerate(self.table.prismatic):
            x = q[i]
            if not is_prismatic:
                # x - 2 pi ceil((x - pi) / (2 pi)); an angle that is there already stays as it is.
                turns = -ca.floor((math.pi - x) / math.tau)
                is_there = ca.logic_and(x > -math.pi, x <= math.pi)
                has_limits = self.upper[i] < math.inf
                stays_there = ca.logic_or(is_there, has_limits)
                x = ca.if_else(stays_there, x, x - math.tau * turns)
            joints.append(x)
        return ca.vertcat(*joints)


def descent_program(description: Description, size: int) -> Loop:
    """Return the program of a search for ``size`` coordinates of a pose: T, start and tolerance to q, error and posed.

    ``posed`` is 1 where T is a pose, else 0. The start is moved into the limits, see
    :meth:`dhkit.kinematics.newton.Newton.inside`; angles of joints without limits end in (-pi, pi].

    The damping of Newton's step is lambda = mu |e|^2 + lambda_0, with the error e: it vanishes with the error, so that
    the last steps are Newton's, which converge quadratically, for redundant arms too (Yamashita and Fukushima 2001, On
    the rate of convergence of the Levenberg-Marquardt method; Sugihara 2011, Solvability-unconcerned inverse kinematics
    by the Levenberg-Marquardt method). A search ends when position and rotation are within the tolerance each, or when
    it is stalled. Then comes one more step, taken where it helps: it squares the error, down to rounding.
    """
    n = description.n
    arm = SymbolicArm.of(description, size)
    T = ca.SX.sym("T", 4, 4)
    start = ca.SX.sym("start", n)
    tolerance = ca.SX.sym("tolerance")
    goal = ca.SX.sym("goal", 3, 4)
    inputs: dict[str, Any] = {
        "parameters": arm.parameters,
        "T": T,
        "start": start,
        "tolerance": tolerance,
    }

    first_goal = orthonormal_goal(T)
    inside = arm.inside(start)
    error, A = arm.at(inside, first_goal)
    cost = ca.sumsqr(error)
    first = _Search(inside, error, A, cost, ca.SX(1), cost, ca.SX(0))
    start_graph = Graph.of(
        "descent_start", inputs, {"state": first.vector, "fixed": ca.SX(ca.vec(first_goal))}
    )

    state = ca.SX.sym("state", first.vector.shape[0])
    search = _Search.read(state, n, size)
    within: dict[str, Any] = {**inputs, "fixed": ca.vec(goal), "state": state}
    after = _stepped(arm, search, goal)
    position = ca.sumsqr(after.error[:3])
    rotation = ca.sumsqr(after.error[3:]) if size > 3 else ca.SX(0)
    is_closed = ca.fmax(position, rotation) <= tolerance**2
    goes_on = ca.logic_and(ca.logic_not(is_closed), after.steps_since < _STALL_STEPS)
    step_graph = Graph.of("descent_step", within, {"state": after.vector, "goes_on": goes_on})

    q = arm.step(search.q, search.error, search.A, ca.SX(BASE_DAMPING))
    error, _ = arm.at(q, goal)
    helps = ca.sumsqr(error) < search.cost
    finish_graph = Graph.of(
        "descent",
        within,
        {
            "q": arm.wrapped(ca.if_else(helps, q, search.q)),
            "error": ca.if_else(helps, error, search.error),
            "posed": ca.if_else(is_pose(T), 1.0, 0.0),
        },
    )
    return Loop(start_graph, step_graph, finish_graph, _MOST_STEPS)


def _stepped(arm: SymbolicArm, search: _Search, goal: _SX) -> _Search:
    """Return a search after a step; where it does not help, the damping is raised instead."""
    q = arm.step(search.q, search.error, search.A, search.damping * search.cost + BASE_DAMPING)
    error, A = arm.at(q, goal)
    cost = ca.sumsqr(error)

    helps = cost < search.cost
    taken = ca.logic_or(helps, ca.fmax(cost, search.cost) < _ALWAYS_STEP)
    new_cost = ca.if_else(taken, cost, search.cost)

    # mu is decreased after a step that helps, kept after one that is taken all the same, else increased.
    decreased = ca.fmax(search.damping * _DAMPING_DECREASE, _MIN_DAMPING)
    rejected = ca.if_else(taken, search.damping, search.damping * _DAMPING_INCREASE)
    damping = ca.if_else(helps, decreased, rejected)

    progresses = new_cost < _STALL_RATIO * search.reference_cost
    return _Search(
        ca.if_else(taken, q, search.q),
        ca.if_else(taken, error, search.error),
        ca.if_else(taken, A, search.A),
        new_cost,
        damping,
        ca.if_else(progresses, new_cost, search.reference_cost),
        ca.if_else(progresses, 0, search.steps_since + 1),
    )


def orthonormal_goal(T: _SX) -> _SX:
    """Return (R, p) of a pose, 3 x 4, with an orthonormal rotation, from one that is orthonormal to 2e-6.

    Each iteration R (3 - R^T R) / 2 squares the defect (Björck and Bowie 1971).
    """
    R = T[:3, :3]
    for _ in range(2):
        R = R @ (1.5 * ca.SX.eye(3) - 0.5 * (R.T @ R))
    return ca.horzcat(R, T[:3, 3])
