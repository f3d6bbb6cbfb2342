"""Detection of a sampled controller whose torque alternates at every sample and grows: too much damping for its rate.

For a joint of inertia m under tau = -kd qd, held for h seconds, qd_(k+1) = (1 - kd h / m) qd_k. Beyond kd h = 2 m the
velocity, and with it the torque, changes its sign at every sample and grows: the sampled loop is unstable although the
continuous one is not (Franklin, Powell, Workman, Digital Control of Dynamic Systems, 1998, ch. 8).
"""

from __future__ import annotations

import numpy as np

from dhkit.description import Array

ALTERNATIONS = 20
"""Changes of sign, one at every sample, from which growth counts."""
GROWTH = 10.0
"""Growth of the torque since the first of them that counts as unstable; a sliding mode alternates without growing."""
NEGLIGIBLE = 1e-6
"""Torque, N m or N, below which rounding changes signs."""


class AlternationWatch:
    """The changes of sign of n torques."""

    def __init__(self, n: int) -> None:
        self._last = np.zeros(n)
        self._count = np.zeros(n, dtype=int)
        self._first = np.zeros(n)
        """Size of each torque when its present run of alternations began."""

    def unstable_joint(self, tau: Array) -> int | None:
        """Take the next torques, shape (n,), N m and N; return the first joint, from 0, that is unstable, if any is."""
        alternates = (tau * self._last < 0) & (np.abs(tau) > NEGLIGIBLE)
        self._count = np.where(alternates, self._count + 1, 0)
        self._first = np.where(self._count <= 1, np.abs(tau), self._first)
        self._last = tau.copy()
        grows = (self._count >= ALTERNATIONS) & (np.abs(tau) > GROWTH * self._first)
        return int(np.argmax(grows)) if grows.any() else None
