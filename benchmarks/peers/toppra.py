"""toppra: the quickest timing of the straight joint path, with limits kept between its grid's points too."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np

from dhkit.bench.contenders import import_peer
from dhkit.description import Array, Description
from dhkit.errors import PlanningError
from dhkit.model import pinocchio_model
from dhkit.trajectories import Limits

GRID_INTERVALS = 500
"""Intervals of the path's parameter s."""


@dataclass(frozen=True)
class ToppraMotion:
    """A motion of toppra, with the methods of ours."""

    motion: Any

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.motion.duration)

    def q(self, t: Array) -> Array:
        """Return joint values at times, shape (N,), s, as shape (N, n)."""
        return np.asarray(self.motion(t))

    def qd(self, t: Array) -> Array:
        """Return rates at times, shape (N,), s, as shape (N, n)."""
        return np.asarray(self.motion(t, 1))

    def qdd(self, t: Array) -> Array:
        """Return accelerations at times, shape (N,), s, as shape (N, n)."""
        return np.asarray(self.motion(t, 2))


class StraightTiming:
    """toppra on one arm, with Pinocchio's torques.

    The scheme is Interpolation: by Collocation, its default, torques exceed their limits between points (toppra's
    issue 198). Accelerations of s are constant in each interval: its default, a spline, exceeds torques by several
    per cent.

    Raises
    ------
    UnavailableError
        toppra is not installed.
    """

    def __init__(self, description: Description) -> None:
        self._toppra = import_peer("toppra")
        self._constraint, self._algorithm = (
            import_peer("toppra.constraint"),
            import_peer("toppra.algorithm"),
        )
        self._model = pinocchio_model(description)
        self._data = self._model.createData()
        logging.getLogger("toppra").setLevel(logging.ERROR)  # it logs every instance

    def __call__(self, start: Array, goal: Array, limits: Limits) -> ToppraMotion:
        """Return the quickest motion straight from start to goal.

        Raises
        ------
        PlanningError
            toppra finds no motion.
        """
        path = self._toppra.SplineInterpolator([0, 1], np.array([start, goal]))
        speed = self._constraint.JointVelocityConstraint(_both_sides(limits.velocity))
        torque = self._constraint.JointTorqueConstraint(
            self._torque,
            _both_sides(limits.torque),
            np.zeros(len(start)),
            discretization_scheme=self._constraint.DiscretizationType.Interpolation,
        )
        instance = self._algorithm.TOPPRA(
            [speed, torque],
            path,
            gridpoints=np.linspace(0, 1, GRID_INTERVALS + 1),
            solver_wrapper="seidel",
            parametrizer="ParametrizeConstAccel",
        )
        motion = instance.compute_trajectory(0, 0)
        if motion is None:
            raise PlanningError("toppra finds no motion along the straight joint path")
        return ToppraMotion(motion)

    def _torque(self, q: Array, qd: Array, qdd: Array) -> Array:
        import pinocchio as pin

        torque: Array = pin.rnea(self._model, self._data, q, qd, qdd)
        return torque


def _both_sides(limit: Array) -> Array:
    return np.stack([-limit, limit], axis=1)
