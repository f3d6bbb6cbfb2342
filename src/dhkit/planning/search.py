"""From one task to a certified motion: solve, check, slow down or tighten, solve again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from dhkit.description import Array
from dhkit.errors import PlanningError
from dhkit.planning.assembly import assembled, knots_along
from dhkit.planning.certificate import Certificate
from dhkit.planning.clear import BEYOND
from dhkit.planning.costs import cost_of, size_of
from dhkit.planning.guess import detour, leg_durations, straight_knots, usual_accelerations
from dhkit.planning.mesh import Curve, Mesh
from dhkit.planning.problem import Knots, Problem, Rows
from dhkit.planning.report import JOINTWISE
from dhkit.planning.solver import ProgressCall, Solution, Solver, Stopped
from dhkit.planning.states import States
from dhkit.planning.task import FEW, Margins, Task, g_bounds, worst_row, x_bounds
from dhkit.trajectories import Trajectory

FEASIBLE = 1e-5
"""What a solution's rows may miss at most to be taken: the certificate decides about the rest."""
SMALL_STEP = {Curve.CONSTANT: 1e-3, Curve.JUMPING: 1e-5, Curve.LINEAR: 1e-3, Curve.QUADRATIC: 1e-3}
"""A solution that needs less of a slow-down is slowed down; else limits are tightened where they are exceeded."""
LARGER = 3.0
"""What that limit is multiplied by with each round: some excesses wander."""
WIDER, DOUBLE = 1.1, 2.0
"""What an excess is multiplied by to widen a margin, and that factor with each round: some bulge between knots."""
ROUNDS = 8
"""How often a motion is solved for anew at most, to be certified."""
SLACK = 2e-7
"""What a slow-down adds, for what lies between the certificate's states."""
FACTORS = (2.5, 0.6)
"""What guessed durations are multiplied by where the first start fails."""
STARTS = 4
"""Of arms of two or three joints: their programs have more than one optimum, and are small."""
SHORTEST = 1e-3
"""s: of a leg, where a search starts."""
LONGEST, FACTORS_TRIED = 100.0, 24
"""Durations that are tried for objectives of time and something else: from the fastest to so many seconds."""
DETOURS = 8
"""Starts around obstacles at most."""


@dataclass(frozen=True, eq=False)
class Program:
    """A problem that is made ready to be solved."""

    problem: Problem
    rows: list[Rows]
    solver: Solver

    @classmethod
    def of(cls, problem: Problem, tolerance: float, *, expand: bool) -> Program:
        """Make a problem ready."""
        program, rows = problem.program
        return cls(problem, rows, Solver(program, len(problem.mesh.legs), tolerance=tolerance, expand=expand))

    @property
    def mesh(self) -> Mesh:
        """The problem's mesh."""
        return self.problem.mesh


@dataclass(frozen=True, eq=False)
class Found:
    """A certified motion, and what it took."""

    trajectory: Trajectory
    certificate: Certificate
    cost: float
    slow_down: float
    tightened: tuple[str, ...]
    iterations: int
    solves: int


@dataclass(eq=False)
class Search:
    """The search for one motion; keeps count."""

    task: Task
    program: Program
    deadline: float
    """As of ``time.perf_counter``."""
    progress: ProgressCall | None = None
    iterations: int = 0
    solves: int = 0
    tightened: list[str] = field(default_factory=list)
    value: float = np.inf
    """Of the last solution's objective."""
    failure: PlanningError | None = None
    """The first."""

    def __call__(self, warm: Trajectory | None = None) -> Found:
        """Return the best certified motion.

        Raises
        ------
        PlanningError
            No start converges, limits stay exceeded, or the time is over.
        """
        try:
            for knots in self._solutions(warm):
                try:
                    return self._certified(knots)
                except PlanningError as error:
                    self._note(error)
        except _TimeIsOver:
            starts = f"{self.solves} start{'s' * (self.solves > 1)}"
            raise PlanningError(
                f"no motion found{self._around} within the time limit, in {starts}{self._why}"
            ) from None
        if self.failure is None or not self.task.surroundings:
            raise self.failure or PlanningError("no motion found")
        raise PlanningError(f"no motion found{self._around}, in {self.solves} starts{self._why}") from None

    @property
    def _around(self) -> str:
        surroundings = self.task.surroundings
        if not surroundings:
            return ""
        return f" that keeps {1000 * surroundings.clearance:.3g} mm clear of {surroundings.names}"

    @property
    def _why(self) -> str:
        return f"; the first: {self.failure}" if self.failure else ""

    def _note(self, error: PlanningError) -> None:
        if isinstance(error, _TimeIsOver):
            raise error
        self.failure = self.failure or error

    def _certified(self, knots: Knots) -> Found:
        """Return a solution as a motion that keeps its limits everywhere, solved anew where it must be."""
        task, mesh = self.task, self.program.mesh
        margins, inflation = Margins(mesh), np.zeros(len(task.surroundings.obstacles) + 1)
        for turn in range(ROUNDS):
            trajectory = assembled(task.arm, mesh, knots, fixed_ends=self.program.problem.jerk_counts)
            trajectory, states, certificate, c = self._kept(trajectory, SMALL_STEP[mesh.curve] * LARGER**turn)
            if certificate.ok:
                cost = self._cost(trajectory)
                return Found(trajectory, certificate, cost, c, tuple(self.tightened), self.iterations, self.solves)
            exceeded = [check.what for check in certificate.checks if check.excess > 0]
            self.tightened += [what for what in exceeded if what not in self.tightened]
            margins = self._wider(margins, states, WIDER * DOUBLE**turn)
            if "clearance" in exceeded:
                inflation = inflation + BEYOND * task.surroundings.short(task.description, states.q)
            guess = knots_along(trajectory, mesh, trajectory.breaks[list(mesh.ends)])
            knots = self._solution(guess, margins, inflation)
        worst = max(certificate.checks, key=lambda check: check.excess)
        raise PlanningError(
            f"{self._whose(worst.what, worst.row)} stays exceeded at {worst.time:.3g} s, after {ROUNDS} rounds"
        )

    def _kept(self, trajectory: Trajectory, step: float) -> tuple[Trajectory, States, Certificate, float]:
        """Return a motion, slowed down where a small step is all it takes, its states, certificate, and that factor."""
        task = self.task
        states, c = task.checker.states(trajectory), 1.0
        if task.rests and task.duration is None:
            c = task.checker.slow_down(states)
            if 1 < c < 1 + step:
                c *= 1 + SLACK
                # Worked out anew: that torques follow the law of slower motions is not taken for granted.
                trajectory = trajectory.slowed(c)
                states = task.checker.states(trajectory)
            else:
                c = 1.0
        return trajectory, states, task.checker.check(trajectory, states), c

    def _wider(self, margins: Margins, states: States, factor: float) -> Margins:
        """Return margins that are wider by a multiple of what a motion exceeds in each interval."""
        checker = self.task.checker
        excesses = [(what, use - 1) for what, use in checker.peaks(states) if what != "clearance"]
        for what, excess in [*excesses, ("position", checker.positions(states))]:
            worst = excess.reshape(margins.mesh.intervals, -1, excess.shape[1]).max(axis=1)
            if (worst > 0).any():
                margins = margins.raised(what, factor * worst)
        return margins

    # Starts

    def _solutions(self, warm: Trajectory | None) -> Iterator[Knots]:
        """Yield solutions, those to be tried first first."""
        task, mesh = self.task, self.program.mesh
        margins, inflation = Margins(mesh), np.zeros(len(task.surroundings.obstacles) + 1)
        many = 1 < task.arm.n <= FEW and self.program.problem.objective.has_time and not task.surroundings
        found: list[tuple[float, Knots]] = []
        for guess in self._guesses(warm, STARTS if many else 1):
            try:
                knots = self._solution(guess(), margins, inflation)
            except PlanningError as error:
                if found and isinstance(error, _TimeIsOver):
                    break
                self._note(error)
                continue
            if not many:
                yield knots
            else:
                found.append((self.value, knots))
        yield from (knots for _, knots in sorted(found, key=lambda item: item[0]))

    def _guesses(self, warm: Trajectory | None, many: int) -> Iterator[Callable[[], Knots]]:
        """Yield what to start from: a motion that is known, straight ways, and detours."""
        task, mesh = self.task, self.program.mesh
        if warm is not None and len(mesh.legs) == 1:
            yield lambda: knots_along(warm, mesh, np.array([warm.duration]))
        durations = np.maximum(leg_durations(task.description, task.limits, task.points), SHORTEST)
        if task.duration is not None:
            durations *= task.duration / durations.sum()
        elif not self.program.problem.objective.only_time:
            durations *= self._best_factor(durations)
        yield lambda: straight_knots(task, mesh, durations)
        for seed in range(DETOURS if task.surroundings else many - 1):
            yield lambda seed=seed: detour(task, mesh, durations, seed)  # type: ignore[misc]
        if self.failure is not None and task.duration is None:
            for factor in FACTORS:
                yield lambda factor=factor: straight_knots(task, mesh, durations * factor)  # type: ignore[misc]

    def _best_factor(self, durations: Array) -> float:
        """Return by what to slow down a straight way so that it costs least."""
        factors = np.geomspace(1.0, LONGEST / max(float(durations.sum()), 1e-6), FACTORS_TRIED)
        costs = []
        for factor in factors:
            knots = straight_knots(self.task, self.program.mesh, durations * factor)
            costs.append(self._cost(assembled(self.task.arm, self.program.mesh, knots, fixed_ends=False)))
        return float(factors[int(np.argmin(costs))])

    def _cost(self, trajectory: Trajectory) -> float:
        return cost_of(self.program.problem.objective, trajectory, self.task.description, self.task.friction)

    def _solution(self, guess: Knots, margins: Margins, inflation: Array) -> Knots:
        """Solve from a guess.

        Raises
        ------
        PlanningError
            Says what is missed most.
        """
        task, problem, mesh = self.task, self.program.problem, self.program.mesh
        bounds = g_bounds(task, problem, self.program.rows, margins)
        parameters = problem.parameters(
            task.load,
            (*task.parameters, task.surroundings.values(inflation)) if task.surroundings else task.parameters,
            1.0 / self._scale(guess),
            usual_accelerations(task, guess),
        )
        inside = x_bounds(task, mesh, margins, jerk_counts=problem.jerk_counts)
        self.solves += 1
        try:
            solution = self.program.solver(guess.vector, parameters, inside, bounds, self.deadline, self.progress)
        except Stopped:
            raise _TimeIsOver from None
        self.iterations += solution.iterations
        if solution.converged and solution.infeasibility <= FEASIBLE:
            self.value = solution.cost
            return Knots.of(solution.x, mesh, problem.n)
        raise PlanningError(self._missed(solution, bounds))

    def _missed(self, solution: Solution, bounds: tuple[Array, Array]) -> str:
        row, which, share, misses = worst_row(solution, self.program.rows, bounds)
        return (
            f"not converged ({solution.status.replace('_', ' ').lower()}, {solution.iterations} iterations): "
            f"{self._whose(row.what, which)} misses its bound by {misses:.2g} at {100 * share:.0f} % of the way"
        )

    def _whose(self, what: str, row: int) -> str:
        names = [joint.name for joint in self.task.description.joints]
        return f"{what} of joint {names[row]}" if what in ROWS_OF_JOINTS else what

    def _scale(self, guess: Knots) -> float:
        """Return the cost of a guess, by which costs are divided."""
        if self.program.problem.objective.only_time:
            return float(guess.durations.sum())
        trajectory = assembled(self.task.arm, self.program.mesh, guess, fixed_ends=False)
        objective, task = self.program.problem.objective, self.task
        return max(size_of(objective, trajectory, task.description, task.friction), SMALLEST)


class _TimeIsOver(PlanningError):  # noqa: N818 (it never leaves this file)
    """The deadline has passed."""


SMALLEST = 1e-9
ROWS_OF_JOINTS = (*JOINTWISE, "joint positions", "joint velocities")
"""What has a row for each joint."""


def coarser(search: Search, motion: Trajectory) -> tuple[int, float] | None:
    """Return the intervals of a coarser program and a motion's cost on it; nothing where the time is over."""
    if time.perf_counter() > search.deadline:
        return None
    try:
        found = search(motion)
    except PlanningError:
        return None
    return len(found.trajectory.breaks) - 1, found.cost
