"""Programs of Newton's method without branches: the error of a pose, and the step that reduces it."""

from __future__ import annotations

import math
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
    """Return the program of :meth:`dhkit.kinematics.newton.Newton.error`."""
    length = ca.SX.sym("length")
    T = ca.SX.sym("T", 4, 4)
    goal = ca.SX.sym("goal", 4, 4)
    way = (goal[:3, 3] - T[:3, 3]) / length
    turn = _rotation_vector(goal[:3, :3] @ T[:3, :3].T)
    error = ca.vertcat(way, turn)[:size]
    return Graph.of("pose_error", {"length": length, "T": T, "goal": goal}, {"error": error})


def step_program(n: int, size: int) -> Graph:
    """Return the program of :meth:`dhkit.kinematics.newton.Newton.step` for n joints.

    It solves (J^T J + damping) dq = J^T error (Levenberg 1944), or with as many joints as coordinates the equal
    dq = J^T (J J^T + damping)^-1 error. A joint at a limit that the error pushes outward stays (Bertsekas 1982,
    Projected Newton methods for optimization problems with simple constraints); the others end at theirs.
    """
    length = ca.SX.sym("length")
    q = ca.SX.sym("q", n)
    error = ca.SX.sym("error", size)
    J = ca.SX.sym("J", 6, n)
    units, turns, lower, upper = (ca.SX.sym(name, n) for name in ("units", "turns", "lower", "upper"))
    damping = ca.SX.sym("damping")
    endless = turns != 0
    A = ca.vertcat(J[:3, :] / length, J[3:, :])[:size, :] @ ca.diag(units)
    push = A.T @ error
    stays = [_stays(q[i], push[i], lower[i], upper[i], endless[i]) for i in range(n)]
    A = A @ ca.diag(ca.vertcat(*(ca.if_else(stuck, 0.0, 1.0) for stuck in stays)))
    if n < size:
        dq = _solve(A.T @ A + damping * ca.SX.eye(n), A.T @ error)
    else:
        dq = A.T @ _solve(A @ A.T + damping * ca.SX.eye(size), error)
    new = q + dq * units * ca.fmin(1.0, _MAX_STEP / (ca.norm_inf(dq) + _TINY))
    ends = [_ends(new[i], lower[i], upper[i], endless[i]) for i in range(n)]
    parameters = ca.vertcat(length, units, turns, lower, upper)
    inputs = {"parameters": parameters, "q": q, "error": error, "J": J, "damping": damping}
    return Graph.of("newton_step", inputs, {"q": ca.vertcat(*ends)})


def _stays(x: _SX, push: _SX, lower: _SX, upper: _SX, endless: _SX) -> _SX:
    outward = ca.logic_or(ca.logic_and(x >= upper, push > 0), ca.logic_and(x <= lower, push < 0))
    return ca.logic_and(outward, ca.logic_not(endless))


def _ends(x: _SX, lower: _SX, upper: _SX, endless: _SX) -> _SX:
    """Return a joint position inside its limits, by a whole turn back where the range allows one."""
    x = ca.if_else(ca.logic_and(x > upper, endless), x - math.tau, x)
    x = ca.if_else(ca.logic_and(x < lower, endless), x + math.tau, x)
    return ca.fmin(ca.fmax(x, lower), upper)


def _solve(A: _SX, b: _SX) -> _SX:
    """Return A^-1 b of a positive definite matrix, by its factors L D L^T."""
    D, LT, order = ca.ldl(A, False)
    return ca.ldl_solve(b, D, LT, order)


def _rotation_vector(R: _SX) -> _SX:
    """Return the rotation vector of a matrix, of length up to pi, accurate near 0 and near pi.

    It is computed from the quaternion, whose entries are taken from the products with its largest entry (Shepperd 1978,
    Quaternion from rotation matrix).
    """
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    odd = (R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    xy, xz, yz = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    x2, y2, z2 = (1 + 2 * R[k, k] - trace for k in range(3))
    products = ((1 + trace, *odd), (odd[0], x2, xy, xz), (odd[1], xy, y2, yz), (odd[2], xz, yz, z2))
    largest = products[0][0]
    best = ca.vertcat(*products[0])
    for k in range(1, 4):
        larger = products[k][k] > largest
        best = ca.if_else(larger, ca.vertcat(*products[k]), best)
        largest = ca.if_else(larger, products[k][k], largest)
    w = best[0]
    v = best[1:]
    w, v = ca.fabs(w), ca.if_else(w < 0, -v, v)
    size = ca.norm_2(v)
    return v * (2 * ca.atan2(size, w) / (size + _TINY))
