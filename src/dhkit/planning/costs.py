"""What a motion costs: objectives integrated over it, by the path that certifies."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.objectives import Objective
from dhkit.planning.states import States
from dhkit.symbolic import Friction
from dhkit.trajectories import Trajectory

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
"""Exact to degree 9: of a motion's squared jerk, and of its squared torques up to their curvature in an interval."""


def cost_of(
    objective: Objective, trajectory: Trajectory, description: Description, friction: Friction | None = None
) -> float:
    """Return an objective's value for a motion, in the units of its terms; ``description`` may carry a load."""
    rates, weights = _rates(objective, trajectory, description, friction)
    return float(weights @ sum(rates))


def size_of(
    objective: Objective, trajectory: Trajectory, description: Description, friction: Friction | None = None
) -> float:
    """Return how large an objective is along a motion: its terms without their signs."""
    rates, weights = _rates(objective, trajectory, description, friction)
    return float(weights @ sum(np.abs(rate) for rate in rates))


def _rates(
    objective: Objective, trajectory: Trajectory, description: Description, friction: Friction | None
) -> tuple[list[Array], Array]:
    """Return each term's rate at a quadrature's nodes, shape (N,), and the nodes' weights."""
    h = np.diff(trajectory.breaks)[:, None]
    times = trajectory.breaks[:-1, None] + h * (NODES + 1) / 2
    weights = (h * WEIGHTS / 2).ravel()
    states = States.of(description, trajectory, times, friction)
    return [term.weight * term.measured(states) for term in objective.terms], weights
