"""OMPL: sampled paths around obstacles, by another method than the one that seeds our planner."""

from __future__ import annotations

import numpy as np

from dhkit.bench.contenders import import_peer
from dhkit.description import Array, Description
from dhkit.planning import Obstacle, distance

RESOLUTION = 0.02
"""Largest part of the space's extent between two checked states of a path."""


class SampledPaths:
    """Paths of an arm through free states, by bidirectional KPIECE (BKPIECE1).

    Parameters
    ----------
    description
        The robot.
    obstacles
        What to avoid.
    clearance
        Distance to keep, m.
    self_collision
        Whether links keep it from each other too.
    """

    def __init__(
        self,
        description: Description,
        obstacles: list[Obstacle],
        clearance: float,
        self_collision: bool = False,
    ) -> None:
        self._base, self._geometric = import_peer("ompl.base"), import_peer("ompl.geometric")
        self._util = import_peer("ompl.util")
        self._util.setLogLevel(self._util.LOG_ERROR)
        self.description, self.obstacles, self.clearance = description, obstacles, clearance
        self.self_collision, self.checked = self_collision, 0

    def path(self, start: Array, goal: Array, seconds: float) -> Array | None:
        """Return the configurations of a path, shape (k, n), rad and m; None if none is found within a time, s.

        Each call continues OMPL's random numbers, and finds another path.
        """
        base, n, numbers = self._base, self.description.n, self.description.numbers
        space = base.RealVectorStateSpace(n)
        bounds = base.RealVectorBounds(n)
        for i in range(n):
            bounds.setLow(i, float(max(numbers.lower[i], min(-np.pi, start[i], goal[i]))))
            bounds.setHigh(i, float(min(numbers.upper[i], max(np.pi, start[i], goal[i]))))
        space.setBounds(bounds)
        space.setLongestValidSegmentFraction(RESOLUTION)
        setup = self._geometric.SimpleSetup(space)
        setup.setStateValidityChecker(self._is_free)
        ends = []
        for values in (start, goal):
            state = space.allocState()
            for i in range(n):
                state[i] = float(values[i])
            ends.append(state)
        setup.setStartAndGoalStates(*ends)
        setup.setPlanner(self._geometric.BKPIECE1(setup.getSpaceInformation()))
        setup.solve(float(seconds))
        if not setup.haveExactSolutionPath():
            return None
        setup.simplifySolution()
        states = setup.getSolutionPath().getStates()
        return np.array([[state[i] for i in range(n)] for state in states])

    def _is_free(self, state: object) -> bool:
        self.checked += 1
        q = np.array([state[i] for i in range(self.description.n)])  # type: ignore[index]
        found = distance(self.description, q, self.obstacles, self.self_collision)
        return float(found.distance) >= self.clearance
