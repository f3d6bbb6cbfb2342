"""Programs of Newton's method without branches: the error of a pose, and the step that reduces it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import casadi as ca

from dhkit.symbolic import Graph

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_MAX_STEP = 1.0
"""Largest step of a joint, rad or share of the reach, so that a search does not leave its neighbourhood."""
_TINY = 1e-300
"""Added to denominators to avoid 0 / 0."""


def error_program(size: int) -> Graph:
    """Return the program of :meth:`dhkit.kinematics.newton.Newton.error`.

    With the pose (R, p) of the tool, the goal (R_g, p_g) and the length L,

        error = ((p_g - p) / L,  phi),    where phi is the rotation vector of R_g R^T.
    """
    length = ca.SX.sym("length")
    T = ca.SX.sym("T", 4, 4)
    goal = ca.SX.sym("goal", 4, 4)

    error = pose_error(T, goal, length)[:size]
    return Graph.of("pose_error", {"length": length, "T": T, "goal": goal}, {"error": error})


def pose_error(T: _SX, goal: _SX, length: _SX) -> _SX:
    """Return the error of :func:`error_program`, 6 x 1."""
    displacement = (goal[:3, 3] - T[:3, 3]) / length
    phi = _rotation_vector(goal[:3, :3] @ T[:3, :3].T)
    return ca.vertcat(displacement, phi)


def step_program(n: int, size: int) -> Graph:
    """Return the program of :meth:`dhkit.kinematics.newton.Newton.step` for n joints; see :func:`levenberg_step`.

    A joint at a limit that the error pushes outward stays (Bertsekas 1982, Projected Newton methods for optimization
    problems with simple constraints); the others end at theirs.
    """
    length = ca.SX.sym("length")
    q = ca.SX.sym("q", n)
    error = ca.SX.sym("error", size)
    J = ca.SX.sym("J", 6, n)
    units = ca.SX.sym("units", n)
    turns = ca.SX.sym("turns", n)
    lower = ca.SX.sym("lower", n)
    upper = ca.SX.sym("upper", n)
    damping = ca.SX.sym("damping")

    # Without units: positions over the length L, joints over their units U, so that dq = U dx and A = diag(1/L, 1) J U.
    A = ca.vertcat(J[:3, :] / length, J[3:, :])[:size, :] @ ca.diag(units)

    # A^T error is the steepest descent of |error|^2 / 2. A joint that stays gets a column of zeros: dx_i = 0.
    descent = A.T @ error
    endless = turns != 0
    stuck = [stays(q[i], descent[i], lower[i], upper[i], endless[i]) for i in range(n)]
    new = q + units * levenberg_step(A, error, damping, stuck)
    ends = [moved_inside(new[i], lower[i], upper[i], endless[i]) for i in range(n)]

    parameters = ca.vertcat(length, units, turns, lower, upper)
    inputs = {"parameters": parameters, "q": q, "error": error, "J": J, "damping": damping}
    return Graph.of("newton_step", inputs, {"q": ca.vertcat(*ends)})


def levenberg_step(A: _SX, error: _SX, damping: _SX, stuck: Sequence[_SX]) -> _SX:
    """Return Levenberg's step dx without units, n x 1 (Levenberg 1944).

    For the Jacobian A without units and the damping lambda,

        (A^T A + lambda 1) dx = A^T error,    or, the same,    dx = A^T (A A^T + lambda 1)^-1 error,

    of which the smaller system is solved.

    Parameters
    ----------
    A, error, damping
        size x n, size x 1, and a number.
    stuck
        Whether each joint stays where it is: it gets a column of zeros, so that dx_i = 0.
    """
    size, n = A.shape
    A = A @ ca.diag(ca.vertcat(*(ca.if_else(stays_there, 0.0, 1.0) for stays_there in stuck)))
    if n < size:
        dx = solve_definite(A.T @ A + damping * ca.SX.eye(n), A.T @ error)
    else:
        dx = A.T @ solve_definite(A @ A.T + damping * ca.SX.eye(size), error)

    # The whole step is shortened, which keeps its direction, until no joint moves by more than _MAX_STEP.
    return dx * ca.fmin(1.0, _MAX_STEP / (ca.norm_inf(dx) + _TINY))


def stays(q: _SX, descent: _SX, lower: _SX, upper: _SX, endless: _SX) -> _SX:
    """Return whether a joint is at a limit and descent pushes it outward; an endless joint never stays."""
    outward = ca.logic_or(
        ca.logic_and(q >= upper, descent > 0), ca.logic_and(q <= lower, descent < 0)
    )
    return ca.logic_and(outward, ca.logic_not(endless))


def moved_inside(x: _SX, lower: _SX, upper: _SX, endless: _SX) -> _SX:
    """Return a joint position inside its limits, by a whole turn back where the range allows one."""
    x = ca.if_else(ca.logic_and(x > upper, endless), x - math.tau, x)
    x = ca.if_else(ca.logic_and(x < lower, endless), x + math.tau, x)
    return ca.fmin(ca.fmax(x, lower), upper)


def solve_definite(A: _SX, b: _SX) -> _SX:
    """Return A^-1 b of a positive definite matrix, by its factors L D L^T."""
    D, LT, order = ca.ldl(A, False)
    return ca.ldl_solve(b, D, LT, order)


def _rotation_vector(R: _SX) -> _SX:
    """Return the rotation vector of a matrix, of length up to pi, accurate near 0 and near pi.

    It is computed from the unit quaternion (w, v) = (cos(phi / 2), sin(phi / 2) axis), whose entries are taken from
    their products with the largest of them (Shepperd 1978, Quaternion from rotation matrix).
    """
    # Four times the products of the quaternion's entries w, x, y, z; ww stands for 4 w w.
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    ww = 1 + trace
    xx = 1 + 2 * R[0, 0] - trace
    yy = 1 + 2 * R[1, 1] - trace
    zz = 1 + 2 * R[2, 2] - trace
    wx = R[2, 1] - R[1, 2]
    wy = R[0, 2] - R[2, 0]
    wz = R[1, 0] - R[0, 1]
    xy = R[0, 1] + R[1, 0]
    xz = R[0, 2] + R[2, 0]
    yz = R[1, 2] + R[2, 1]
    products = ((ww, wx, wy, wz), (wx, xx, xy, xz), (wy, xy, yy, yz), (wz, xz, yz, zz))

    # Each row is a multiple of the quaternion; the one with the largest square has the fewest rounding errors.
    largest = products[0][0]
    best = ca.vertcat(*products[0])
    for k in range(1, 4):
        larger = products[k][k] > largest
        best = ca.if_else(larger, ca.vertcat(*products[k]), best)
        largest = ca.if_else(larger, products[k][k], largest)

    # (w, v) and (-w, -v) are the same rotation; w >= 0 gives phi = 2 atan2(|v|, w) in [0, pi], for any multiple.
    w = ca.fabs(best[0])
    v = ca.if_else(best[0] < 0, -best[1:], best[1:])
    sine = ca.norm_2(v)
    return v * (2 * ca.atan2(sine, w) / (sine + _TINY))
