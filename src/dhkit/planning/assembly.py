"""Trajectories from the variables of a program, corrected to pass exactly through the given configurations."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.blocks import Indices
from dhkit.planning.mesh import Curve, Interval, Mesh
from dhkit.planning.variables import Knots
from dhkit.trajectories import Trajectory

ROUNDS = 2
"""Number of corrections: the second removes the rounding error of the first."""


def assemble_trajectory(description: Description, mesh: Mesh, knots: Knots, *, fixed_ends: bool) -> Trajectory:
    """Return the motion of a program's accelerations.

    Ipopt leaves gaps of about 1e-8 between intervals, which would add up at the goal. The accelerations are therefore
    changed by the least squares correction that makes the motion pass exactly through the end of every leg.

    Parameters
    ----------
    fixed_ends
        Whether the first and the last acceleration must not be changed.
    """
    h = mesh.shares * knots.durations[mesh.leg]
    coefficients = corrected(mesh.curve, h, np.array(mesh.ends), knots, fixed_ends=fixed_ends)
    return Trajectory(description, np.concatenate([[0.0], np.cumsum(h)]), coefficients)


def corrected(curve: Curve, h: Array, ends: Indices, knots: Knots, *, fixed_ends: bool) -> Array:
    """Return a motion's polynomials after that correction, shape (K, p+1, columns), ascending powers.

    Parameters
    ----------
    h
        Durations of the K intervals, shape (K,), s.
    ends
        Indices of the knots at which legs end.
    """
    W, U = _weights(curve, len(h))
    qdd = knots.qdd.copy()
    free = slice(1, -1) if fixed_ends else slice(None)
    # The state at the legs' ends is linear in the accelerations: v = v0 + sum h W a, q = q0 + sum (h v + h^2 U a).
    velocity = np.cumsum(h[:, None] * W, axis=0)
    before = np.vstack([np.zeros(W.shape[1]), velocity[:-1]])
    position = np.cumsum(h[:, None] * before + (h**2)[:, None] * U, axis=0)
    length = max(float(h.sum()), 1e-12)
    influence = np.vstack([position[ends - 1] / length, velocity[ends - 1]])[:, free]
    for _ in range(ROUNDS):
        q, qd = _integrated(knots, qdd, h, W, U)
        gap = np.vstack([(knots.q[ends] - q[ends]) / length, knots.qd[ends] - qd[ends]])
        qdd[free] += np.linalg.lstsq(influence, gap, rcond=None)[0]
    q, qd = _integrated(knots, qdd, h, W, U)
    interval = Interval(h[:, None], q[:-1], qd[:-1], *curve.values(qdd))
    first, last = interval.jerks
    coefficients = np.stack([q[:-1], qd[:-1], interval.a / 2, first / 6, (last - first) / (24 * interval.h)], axis=1)
    degree = (2, 3, 3, 4)[curve.value]
    return coefficients[:, : degree + 1]


def _integrated(knots: Knots, qdd: Array, h: Array, W: Array, U: Array) -> tuple[Array, Array]:
    steps = h[:, None] * (W @ qdd)
    qd = np.vstack([knots.qd[:1], knots.qd[0] + np.cumsum(steps, axis=0)])
    moves = h[:, None] * qd[:-1] + (h**2)[:, None] * (U @ qdd)
    return np.vstack([knots.q[:1], knots.q[0] + np.cumsum(moves, axis=0)]), qd


@lru_cache(maxsize=32)
def _weights(curve: Curve, intervals: int) -> tuple[Array, Array]:
    """Return the weights of accelerations in an interval's changes of velocity (times h) and position (times h^2).

    Shape (K, columns) each.
    """
    step = (1, 2, 1, 2)[curve.value]
    w = ((1.0,), (1 / 2, 1 / 2), (1 / 2, 1 / 2), (1 / 6, 4 / 6, 1 / 6))[curve.value]
    u = ((1 / 2,), (1 / 3, 1 / 6), (1 / 3, 1 / 6), (1 / 6, 1 / 3, 0.0))[curve.value]
    W, U = np.zeros((2, intervals, curve.columns(intervals)))
    for k in range(intervals):
        W[k, step * k : step * k + len(w)], U[k, step * k : step * k + len(u)] = w, u
    return W, U


def knots_along(trajectory: Trajectory, mesh: Mesh, ends: Array) -> Knots:
    """Return the values of a trajectory on a mesh, as the start of a solution.

    Parameters
    ----------
    ends
        Times at which its legs end, shape (legs,), s.
    """
    durations = np.diff(np.concatenate([[0.0], ends]))
    t = mesh.times(durations)
    middle = (t[1:] + t[:-1]) / 2
    match mesh.curve:
        case Curve.CONSTANT:
            qdd = trajectory.qdd(middle)
        case Curve.JUMPING:
            both = [trajectory.qdd(t[:-1], "right"), trajectory.qdd(t[1:], "left")]
            qdd = np.stack(both, axis=1).reshape(-1, trajectory.n)
        case Curve.LINEAR:
            qdd = trajectory.qdd(t)
        case Curve.QUADRATIC:
            qdd = np.empty((2 * len(middle) + 1, trajectory.n))
            qdd[0::2], qdd[1::2] = trajectory.qdd(t), trajectory.qdd(middle)
    return Knots(durations, trajectory.q(t), trajectory.qd(t), qdd)
