"""Objectives integrated over a motion, from the states that certify it."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array
from dhkit.planning.loaded import LoadedArm
from dhkit.planning.objectives import Objective
from dhkit.planning.states import States
from dhkit.symbolic import Friction
from dhkit.trajectories import Trajectory

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
"""Gauss-Legendre rule of 5 points, exact to degree 9: for squared jerk, and nearly so for squared torques."""


def cost_of(objective: Objective, trajectory: Trajectory, arm: LoadedArm, friction: Friction | None = None) -> float:
    """Return an objective's value for a motion, in the units of its terms."""
    rates, weights = _rates(objective, trajectory, arm, friction)
    return float(weights @ sum(rates))


def size_of(objective: Objective, trajectory: Trajectory, arm: LoadedArm, friction: Friction | None = None) -> float:
    """Return the magnitude of an objective along a motion: the integral of its terms' absolute values."""
    rates, weights = _rates(objective, trajectory, arm, friction)
    return float(weights @ sum(np.abs(rate) for rate in rates))


def _rates(
    objective: Objective, trajectory: Trajectory, arm: LoadedArm, friction: Friction | None
) -> tuple[list[Array], Array]:
    """Return each term's integrand at the quadrature's nodes, shape (N,), and the weights of the nodes, s."""
    h = np.diff(trajectory.breaks)[:, None]
    times = trajectory.breaks[:-1, None] + h * (NODES + 1) / 2
    weights = (h * WEIGHTS / 2).ravel()
    states = States.of(arm, trajectory, times, friction)
    return [term.weight * term.measured(states) for term in objective.terms], weights
