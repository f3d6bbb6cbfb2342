"""Program that moves a redundant arm along its self-motion, with the tool at rest, to a better solution."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import casadi as ca

from dhkit.description import Description
from dhkit.kinematics.descent_program import BASE_DAMPING, SymbolicArm, orthonormal_goal
from dhkit.kinematics.newton_program import moved_inside, solve_definite, stays
from dhkit.kinematics.preference import Aim
from dhkit.symbolic import Graph
from dhkit.symbolic.programs.loop import Loop

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_MOST_STEPS = 200
"""Largest number of steps; most self-motions end after 10 to 40."""
_FIRST_STEP = 0.1
"""Length of the first step, rad or share of the reach."""
_MAX_STEP = 0.3
"""Largest step of a joint: the tool is brought back by Newton's method, which must not find another branch."""
_CORRECTIONS = 3
"""Newton steps that bring the tool back after each step: its error falls to about the 16th power of the step."""
_FINISHED = 1e-7
"""A self-motion ends when its next step is shorter, rad or share of the reach."""
_SHRINK = 0.25
"""Factor of the step after one that does not improve the score."""
_GROWTH = 4.0
"""Largest factor of the step after one that does."""
_DOUBLINGS = 5
"""Shares of limits are summed in their 32nd powers, whose root is at most 6 % above the largest of seven."""
_TINY = 1e-300
"""Added to denominators to avoid 0 / 0."""


@dataclass(frozen=True)
class _State:
    """A solution, with the score's derivative along the self-motion, and the length of the next step over it."""

    q: _SX
    score: _SX
    slope: _SX
    """Gradient of the score in the null space of the Jacobian, without units, n x 1."""
    rate: _SX
    """Length of the next step over that of ``slope``."""

    @classmethod
    def read(cls, state: _SX, n: int) -> _State:
        """Return the parts of a state vector."""
        return cls(*ca.vertsplit(state, [0, n, n + 1, 2 * n + 1, 2 * n + 2]))

    @property
    def vector(self) -> _SX:
        """The state vector."""
        return ca.vertcat(self.q, self.score, self.slope, self.rate)


@dataclass(frozen=True)
class _SelfMotion:
    """An arm with what its self-motion improves."""

    arm: SymbolicArm
    aim: Aim
    freedoms: int
    """Number of directions in which the tool can move, of those that are held."""
    goal: _SX
    """The pose that is held, 3 x 4."""
    posture: _SX
    """Joint values to come near to, n x 1, for the aim ``"posture"``."""

    def at(self, q: _SX) -> tuple[_SX, _SX, _SX]:
        """Return error, score and slope at joint values."""
        own = ca.SX.sym("q", q.shape[0])
        error, A = self.arm.at(own, self.goal)
        score = self._score(own, A)
        gradient = ca.gradient(score, own) * self.arm.units
        slope = self._along(own, A, gradient)
        error, score, slope = ca.substitute([error, score, slope], [own], [q])
        return error, score, slope

    def _score(self, q: _SX, A: _SX) -> _SX:
        """Return how good joint values are, larger is better."""
        arm = self.arm
        endless = ca.vertsplit(arm.turns != 0)
        if self.aim == "posture":
            squares = []
            for i, x in enumerate(ca.vertsplit((q - self.posture) / arm.units)):
                # Whole turns of a joint that turns without end do not count.
                around = x - math.tau * ca.floor(x / math.tau + 0.5)
                x = ca.if_else(endless[i], around, x)
                squares.append(x * x)
            return -sum(squares)
        if self.aim == "limits":
            powers = []
            for i, x in enumerate(ca.vertsplit(q)):
                half = (arm.upper[i] - arm.lower[i]) / 2
                share = (x - (arm.upper[i] + arm.lower[i]) / 2) / half
                has_limits = ca.logic_and(half < math.inf, half > 0.0)
                power = share
                for _ in range(_DOUBLINGS):
                    power = power * power
                powers.append(ca.if_else(has_limits, power, 0.0))
            root = ca.fmax(sum(powers), _TINY)
            for _ in range(_DOUBLINGS):
                root = ca.sqrt(root)
            return -root
        # The product of the largest singular values, squared, of the Jacobian in units of m and rad.
        J = A @ ca.diag(1.0 / arm.units)
        J = ca.vertcat(J[:3, :] * arm.length, J[3:, :])
        return ca.sqrt(ca.fmax(_principal_minors(J @ J.T, self.freedoms), _TINY))

    def _along(self, q: _SX, A: _SX, gradient: _SX) -> _SX:
        """Return the part of a gradient that moves neither the tool nor a joint at its limit outward."""
        n = q.shape[0]
        arm = self.arm
        endless = arm.turns != 0
        moves = ca.SX.ones(n)
        slope = gradient
        # Without the joints that stop, others may be pushed outward.
        for _ in range(2):
            stopped = [
                stays(q[i], slope[i], arm.lower[i], arm.upper[i], endless[i]) for i in range(n)
            ]
            moves = moves * (1.0 - ca.vertcat(*(ca.if_else(stop, 1.0, 0.0) for stop in stopped)))
            A_moving = A @ ca.diag(moves)
            # (1 - A^T (A A^T)^-1 A) gradient
            square = A_moving @ A_moving.T + BASE_DAMPING * ca.SX.eye(A.shape[0])
            held = solve_definite(square, A_moving @ gradient)
            slope = moves * (gradient - A_moving.T @ held)
        return slope

    def stepped(self, state: _State, tolerance: _SX) -> tuple[_State, _SX]:
        """Return the state after a step, and whether another one follows."""
        arm = self.arm
        n = state.q.shape[0]
        step = state.rate * state.slope
        step = step * ca.fmin(1.0, _MAX_STEP / (ca.norm_inf(step) + _TINY))
        q = state.q + arm.units * step
        limits = [(arm.lower[i], arm.upper[i], arm.turns[i] != 0) for i in range(n)]
        q = ca.vertcat(*(moved_inside(q[i], *limits[i]) for i in range(n)))
        for _ in range(_CORRECTIONS):
            q = arm.step(q, *arm.at(q, self.goal), ca.SX(BASE_DAMPING))
        error, score, slope = self.at(q)

        square = ca.fmax(ca.sumsqr(error[:3]), ca.sumsqr(error[3:]) if arm.size > 3 else 0.0)
        is_better = ca.logic_and(square <= tolerance**2, score > state.score)
        # Barzilai and Borwein's rate s.s / s.y, by which slopes y change along the step s.
        curvature = ca.fabs(ca.dot(step, slope - state.slope))
        secant = ca.sumsqr(step) / (curvature + _TINY)
        rate = ca.if_else(is_better, ca.fmin(secant, _GROWTH * state.rate), _SHRINK * state.rate)
        after = _State(
            ca.if_else(is_better, q, state.q),
            ca.if_else(is_better, score, state.score),
            ca.if_else(is_better, slope, state.slope),
            rate,
        )
        return after, rate * ca.norm_inf(after.slope) > _FINISHED


def self_motion_program(description: Description, size: int, aim: Aim, freedoms: int) -> Loop:
    """Return the program of a self-motion: T, a solution, tolerance and posture to a solution with a better score.

    The score rises with each step: against its gradient in the null space of the Jacobian (Liégeois 1977, Automatic
    supervisory control of the configuration and behavior of multibody mechanisms), as long as the two last slopes say
    (Barzilai and Borwein 1988, Two-point step size gradient methods), after which Newton's method brings the tool back.
    The end is a local maximum on the self-motion, inside the limits.

    Parameters
    ----------
    description
        The robot, with more joints than ``size``.
    size
        Number of coordinates that are held, 6 or 3.
    aim
        What is improved.
    freedoms
        Number of directions in which the tool can move, of those that are held.
    """
    n = description.n
    arm = SymbolicArm.of(description, size)
    T = ca.SX.sym("T", 4, 4)
    start = ca.SX.sym("start", n)
    tolerance = ca.SX.sym("tolerance")
    posture = ca.SX.sym("posture", n)
    inputs: dict[str, Any] = {
        "parameters": arm.parameters,
        "T": T,
        "start": start,
        "tolerance": tolerance,
        "posture": posture,
    }
    goal = ca.SX.sym("goal", 3, 4)
    motion = _SelfMotion(arm, aim, freedoms, goal, posture)

    first_goal = orthonormal_goal(T)
    _, score, slope = replace(motion, goal=first_goal).at(start)
    rate = _FIRST_STEP / (ca.norm_inf(slope) + _TINY)
    first = _State(start, score, slope, rate)
    begin = Graph.of(
        "self_motion_start", inputs, {"state": first.vector, "fixed": ca.SX(ca.vec(first_goal))}
    )

    vector = ca.SX.sym("state", first.vector.shape[0])
    state = _State.read(vector, n)
    within: dict[str, Any] = {**inputs, "fixed": ca.SX(ca.vec(goal)), "state": vector}
    after, goes_on = motion.stepped(state, tolerance)
    step = Graph.of("self_motion_step", within, {"state": after.vector, "goes_on": goes_on})
    finish = Graph.of("self_motion", within, {"q": arm.wrapped(state.q)})
    return Loop(begin, step, finish, _MOST_STEPS)


def _principal_minors(square: _SX, rank: int) -> _SX:
    """Return the sum of the principal minors of a rank of a symmetric matrix: of its eigenvalues' products.

    They are coefficients of the characteristic polynomial (Faddeev and LeVerrier); of the full rank it is the
    determinant.
    """
    size = square.shape[0]
    if rank == size:
        D, _, _ = ca.ldl(square + _TINY * ca.SX.eye(size), False)
        product = ca.SX(1.0)
        for pivot in ca.vertsplit(D):
            product = product * pivot
        return product
    power = ca.SX.eye(size)
    coefficient = ca.SX(1.0)
    for k in range(1, rank + 1):
        product = square @ power
        coefficient = ca.trace(product) / k
        power = coefficient * ca.SX.eye(size) - product
    return coefficient
