"""A path and the arm's dynamics along it on a grid: torques are tau = m sdd + c sd^2 + g.

Bobrow, Dubowsky and Gibson 1985, Time-optimal control of robotic manipulators along specified paths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit import dynamics, kinematics
from dhkit.description import Array
from dhkit.planning.criteria import LoadedArm
from dhkit.trajectories import JointPath, Limits
from dhkit.trajectories.pieces import Side

CANCELLED_SHARE = 1e-9
"""Magnitude of a sum relative to that of its parts below which it counts as zero."""


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
    """Derivatives of the tool's position by s, shape (2, K, 3), m."""
    pss: Array
    qsss: Array

    @classmethod
    def of(cls, arm: LoadedArm, path: JointPath, knots: Array) -> PathStates:
        """Evaluate a path (rad and m) on knots (K+1,); at jumps of curvature each interval has its side's value."""
        pieces = [path.pieces.differentiated(order) for order in range(4)]
        ends: tuple[tuple[Array, Side], ...] = ((knots[:-1], "right"), (knots[1:], "left"))
        q, qs, qss, qsss = (np.stack([piece(s, side) for s, side in ends]) for piece in pieces)
        still = np.zeros_like(q)
        m = c = g = still
        if np.isfinite(arm.numbers.mass).all():
            g = dynamics.inverse_dynamics(arm, q, still, still)
            m = dynamics.inverse_dynamics(arm, q, still, qs) - g
            c = dynamics.inverse_dynamics(arm, q, qs, qss) - g
        J, Jd = kinematics.jacobian(arm, q), kinematics.jacobian_dot(arm, q, qs)
        ps = np.einsum("...ij,...j->...i", J[..., :3, :], qs)
        pss = np.einsum("...ij,...j->...i", J[..., :3, :], qss) + np.einsum("...ij,...j->...i", Jd[..., :3, :], qs)
        return cls(np.stack([knots[:-1], knots[1:]]), q, qs, qss, m, c, g, ps, pss, qsss)

    @property
    def steps(self) -> Array:
        """Lengths of the intervals in s, shape (K,)."""
        steps: Array = self.s[1] - self.s[0]
        return steps

    @property
    def coefficients(self) -> Array:
        """Arguments of :class:`PathPoint` at both ends of the intervals, shape (2, K, 7 n + 6)."""
        parts = [self.q, self.qs, self.qss, self.m, self.c, self.g, self.ps, self.pss, self.qsss]
        return np.concatenate(parts, axis=-1)

    # Speeds without friction and further constraints, for grids and guesses

    def fastest(self, limits: Limits, shares: Array | float = 0.0) -> Array:
        """Return the largest sd^2 at each knot by the limits of joint rates, shape (K+1,), 1/s^2.

        Parameters
        ----------
        shares
            Margins of each joint's speed limit, shape (K, n).
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            joints = ((1 - shares) * limits.velocity / np.abs(self.qs)) ** 2
            most = np.where(np.isnan(joints), np.inf, joints).min(axis=2)
        bounds = np.full(most.shape[1] + 1, np.inf)
        bounds[:-1] = most[0]
        bounds[1:] = np.minimum(bounds[1:], most[1])
        return bounds

    def even_speeds(self, limits: Limits) -> Array:
        """Return the largest constant speed along the path in each interval, shape (K,), 1/s."""
        fastest = self.fastest(limits)
        ones = np.ones(len(fastest))
        most = np.minimum(np.minimum(fastest[:-1], fastest[1:]), self._factors(limits, ones).min(axis=0))
        speeds: Array = np.sqrt(most)
        return speeds

    def largest(self, limits: Limits, shape: Array) -> float:
        """Return the largest factor of sd^2 = shape (K+1,), 1/s^2, that the limits allow which are kept at rest."""
        with np.errstate(divide="ignore"):
            return min(float(np.min(self.fastest(limits) / shape)), float(self._factors(limits, shape).min()))

    def _factors(self, limits: Limits, shape: Array) -> Array:
        """Return the largest factors of sd^2 = shape (K+1,) by limits of torque and acceleration, shape (2, K)."""
        b, sdd = np.stack([shape[:-1], shape[1:]])[..., None], (np.diff(shape) / (2 * self.steps))[:, None]
        found = np.full(self.s.shape, np.inf)
        for by_sdd, by_b, rest, limit in (
            (self.m, self.c, self.g, limits.torque),
            (self.qs, self.qss, 0 * self.q, limits.acceleration),
        ):
            used = by_sdd * sdd + by_b * b
            used[np.abs(used) < CANCELLED_SHARE * (np.abs(by_sdd * sdd) + np.abs(by_b * b) + np.abs(rest))] = 0.0
            spare = limit - np.sign(used) * rest
            with np.errstate(divide="ignore", invalid="ignore"):
                most = np.where((spare > 0) & (used != 0), spare / np.abs(used), np.inf)
            found = np.minimum(found, most.min(axis=2))
        return found
