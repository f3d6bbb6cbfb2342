"""Task of one motion along a path on a grid, and the bounds of the program's variables and rows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dhkit.description import Array, Description, world_to_tool
from dhkit.planning.along.grid import even_speeds, knots_of
from dhkit.planning.along.path_states import PathStates
from dhkit.planning.along.program import MIN_SQUARED_SPEED, TimingProgram, timing_program
from dhkit.planning.along.rows import TimingRows, speed_bounds, timing_rows, tool_speeds
from dhkit.planning.along.terms import Terms
from dhkit.planning.certificate import Checker
from dhkit.planning.constraints import Constraint
from dhkit.planning.objectives import Objective
from dhkit.planning.states import States
from dhkit.planning.tool_constraints import ToolAcceleration, ToolSpeed
from dhkit.trajectories import JointPath, Limits, Trajectory

QUICKEST = Objective.of("time")
POINTS = 8
"""Number of states in an interval for the certificate; few, because there are many intervals."""
GUESS_SPEED_SHARE = 0.5
"""Speed of the initial guess as a share of the largest possible."""


@dataclass(frozen=True, eq=False)
class TimingTask:
    """A path with the limits and constraints of its motion, on a grid."""

    description: Description
    path: JointPath
    objective: Objective
    duration: float | None
    limits: Limits
    checker: Checker
    needs: dict[str, bool]
    """Options of :class:`PathStates`."""
    states: PathStates
    rows: list[TimingRows]
    terms: Terms | None
    quickest_terms: Terms | None
    """Terms of the constraints alone."""

    @classmethod
    def of(
        cls,
        description: Description,
        path: JointPath,
        objective: Objective,
        duration: float | None,
        limits: Limits,
        constraints: tuple[Constraint, ...],
        intervals: int,
    ) -> TimingTask:
        """Evaluate a path on a grid; a motion along it must exist, see ``checks.py``."""
        needed = (objective.needs_torque, *(constraint.needs_torque for constraint in constraints))
        torque = any((*needed, *np.isfinite(limits.torque)))
        tool = any(isinstance(constraint, ToolSpeed | ToolAcceleration) for constraint in constraints)
        needs = {"torque": torque, "tool": tool}
        rough = np.union1d(np.linspace(0.0, 1.0, intervals + 1), path.breaks)
        states = PathStates.of(description, path, rough, **needs)
        knots = knots_of(path, intervals, rough, even_speeds(states, limits, constraints))
        states = PathStates.of(description, path, knots, **needs)
        rows = timing_rows(states, limits)
        T_start = world_to_tool(description, path.q(0.0)) if constraints else np.eye(4)
        parameters = tuple(constraint.values(description, T_start) for constraint in constraints)
        others = tuple(c for c in constraints if c.moving and not isinstance(c, ToolSpeed))
        checker = Checker(description, limits, constraints, parameters, points=POINTS)
        terms, quickest = (Terms.of(description, wanted, others, limits) for wanted in (objective, QUICKEST))
        return cls(description, path, objective, duration, limits, checker, needs, states, rows, terms, quickest)

    @property
    def intervals(self) -> int:
        """Number of intervals of the grid."""
        return len(self.states.steps)

    @property
    def knots(self) -> Array:
        """Path parameters (without unit) at the ends of intervals, shape (K+1,)."""
        return np.append(self.states.s[0], 1.0)

    @property
    def still(self) -> States:
        """The arm at rest at the ends of intervals."""
        q = self.states.q.reshape(-1, self.description.n)
        return States(self.description, self.states.s.ravel(), q, 0 * q, 0 * q)

    def shares(self, reserved: dict[str, Array], what: str, count: int) -> Array:
        """Return the reserved shares (without unit) of a limit in each interval, shape (K, count)."""
        return reserved.get(what, np.zeros((self.intervals, count)))

    def largest_b(self, reserved: dict[str, Array]) -> Array:
        """Return the upper bounds of b by limits of speed, shape (K+1,), 1/s^2."""
        tools = [(tool, self.shares(reserved, tool.what, 1)) for tool in tool_speeds(self.checker.constraints)]
        return speed_bounds(self.states, self.limits, self.shares(reserved, "velocity", self.description.n), tools)

    @property
    def program(self) -> TimingProgram:
        """The program of the task, built on first use."""
        return timing_program(self.intervals, sum(int(row.limited.sum()) for row in self.rows), self.terms)

    def halved(self, which: Array) -> TimingTask:
        """Return the task on a grid with the intervals halved for which ``which`` (K,), whether to halve, is true."""
        middles = (self.knots[1:] + self.knots[:-1])[which] / 2
        knots = np.sort(np.concatenate([self.knots, middles]))
        states = PathStates.of(self.description, self.path, knots, **self.needs)
        return replace(self, states=states, rows=timing_rows(states, self.limits))

    @property
    def steps(self) -> list[TimingTask]:
        """Tasks that are solved in order: other objectives start from the fastest motion."""
        if self.objective.only_time and self.duration is None:
            return [self]
        return [replace(self, objective=QUICKEST, duration=None, terms=self.quickest_terms), self]

    def usual_duration(self) -> float:
        """Return an estimate of the duration, s: pi / (2 sqrt beta) for b = 4 beta s (1 - s)."""
        shape = 4 * self.knots * (1 - self.knots)
        with np.errstate(divide="ignore"):
            beta = min(float(np.min(self.largest_b({}) / shape)), *(row.largest(shape) for row in self.rows))
        return float(np.pi / (2 * np.sqrt(GUESS_SPEED_SHARE * beta)))

    def b_bounds(self, reserved: dict[str, Array], unit: float) -> tuple[Array, Array]:
        """Return the bounds of b at the inner knots, shape (K-1,), for a unit of time, s."""
        high = np.maximum(self.largest_b(reserved)[1:-1] * unit**2, 2 * MIN_SQUARED_SPEED)
        return np.full_like(high, MIN_SQUARED_SPEED), high

    def g_bounds(self, reserved: dict[str, Array]) -> tuple[Array, Array]:
        """Return the lower and upper bounds of the program's rows, shape (rows,) each, without unit."""
        K = self.intervals
        linear = [row.bounds(self.shares(reserved, row.what, self.description.n)) for row in self.rows]
        others = []
        if self.terms is not None:
            for constraint, count in zip(self.terms.constraints, self.terms.counts, strict=True):
                most = np.tile(1 - self.shares(reserved, constraint.what, count), (2, 1, 1))
                others.append((-most if constraint.two_sided else np.full_like(most, -np.inf), most))

        def side(k: int, time: float, total: float) -> Array:
            each = [np.full((K, 1), time)]
            for kinds in (linear, others):
                if kinds:
                    # First the rows of the left end of an interval, then those of the right.
                    each.extend(np.concatenate([bounds[k] for bounds in kinds], axis=-1))
            return np.append(np.hstack(each).ravel(), total)

        # For least time the intervals may take less than their durations, which keeps the program convex.
        least, (shortest, longest) = -np.inf if self.objective.only_time else 0.0, (0.0, np.inf)
        if self.duration is not None:
            shortest = longest = 1.0  # in the unit of time
        return side(0, least, shortest), side(1, 0.0, longest)

    def motion(self, b: Array) -> tuple[Trajectory, Array]:
        """Return the motion with b at all knots, shape (K+1,), 1/s^2, and the times of its knots, shape (K+1,), s."""
        speed, steps = np.sqrt(b), self.states.steps
        sdd = (speed[1:] - speed[:-1]) * (speed[1:] + speed[:-1]) / (2 * steps)
        ends = np.concatenate([[0.0], np.cumsum(2 * steps / (speed[1:] + speed[:-1]))])
        law = np.stack([self.knots[:-1], speed[:-1], sdd / 2], axis=1)
        trajectory = self.path.timed(ends, law)
        if self.duration is not None:
            c = self.duration / ends[-1]
            return trajectory.slowed(c), ends * c
        return trajectory, ends
