"""A path and the arm's dynamics along it on a grid: torques are tau = m sdd + c sd^2 + g.

Bobrow, Dubowsky and Gibson 1985, Time-optimal control of robotic manipulators along specified paths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit import dynamics, kinematics
from dhkit.description import Array, Description
from dhkit.trajectories import JointPath
from dhkit.trajectories.pieces import Side


@dataclass(frozen=True, eq=False)
class PathStates:
    """A path and the arm's dynamics at both ends of K intervals: shapes (2, K, ...), left ends first."""

    s: Array
    """Path parameter, shape (2, K)."""
    q: Array
    """Joint values, shape (2, K, n), rad and m."""
    qs: Array
    """First derivatives of q by s, shape (2, K, n)."""
    qss: Array
    m: Array
    """Torque per sdd, shape (2, K, n); zeros without bodies."""
    c: Array
    """Torque per sd^2, shape (2, K, n)."""
    g: Array
    """Gravity torque, shape (2, K, n), N m and N."""
    ps: Array
    """Derivatives of the tool's position by s, shape (2, K, 3), m; zeros unless requested."""
    pss: Array

    @classmethod
    def of(cls, description: Description, path: JointPath, knots: Array, *, torque: bool, tool: bool) -> PathStates:
        """Evaluate a path (rad and m) on knots (K+1,); at jumps of curvature each interval has its side's value."""
        first, second = path.pieces.derivative, path.pieces.derivative.derivative
        ends: tuple[tuple[Array, Side], ...] = ((knots[:-1], "right"), (knots[1:], "left"))
        q, qs, qss = (np.stack([piece(s, side) for s, side in ends]) for piece in (path.pieces, first, second))
        still = np.zeros_like(q)
        m = c = g = still
        if torque:
            g = dynamics.inverse_dynamics(description, q, still, still)
            m = dynamics.inverse_dynamics(description, q, still, qs) - g
            c = dynamics.inverse_dynamics(description, q, qs, qss) - g
        ps = pss = np.zeros((*q.shape[:2], 3))
        if tool:
            J, Jd = kinematics.jacobian(description, q), kinematics.jacobian_dot(description, q, qs)
            ps = np.einsum("...ij,...j->...i", J[..., :3, :], qs)
            pss = np.einsum("...ij,...j->...i", J[..., :3, :], qss) + np.einsum("...ij,...j->...i", Jd[..., :3, :], qs)
        return cls(np.stack([knots[:-1], knots[1:]]), q, qs, qss, m, c, g, ps, pss)

    @property
    def steps(self) -> Array:
        """Lengths of the intervals in s, shape (K,)."""
        steps: Array = self.s[1] - self.s[0]
        return steps

    @property
    def coefficients(self) -> Array:
        """Arguments of :class:`PathPoint` at both ends of the intervals, shape (2, K, 6 n + 6)."""
        return np.concatenate([self.q, self.qs, self.qss, self.m, self.c, self.g, self.ps, self.pss], axis=-1)
