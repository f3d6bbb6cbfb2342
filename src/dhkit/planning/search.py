"""From one task to a certified motion: solve, check, slow down or tighten, solve again."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from dhkit.description import Array
from dhkit.errors import PlanningError
from dhkit.planning.assembly import assembled, knots_along
from dhkit.planning.certificate import Certificate
from dhkit.planning.clear import BEYOND
from dhkit.planning.costs import cost_of
from dhkit.planning.guess import detour, leg_durations, straight_knots
from dhkit.planning.mesh import Curve, Mesh
from dhkit.planning.problem import Knots, Problem, Rows
from dhkit.planning.solver import ProgressCall, Solution, Solver, Stopped
from dhkit.planning.task import FEW, Margins, Task, g_bounds, usual_accelerations, worst_row, x_bounds
from dhkit.trajectories import Trajectory

__all__ = ["Found", "Program", "Search"]

FEASIBLE = 1e-5
"""What a solution's rows may miss at most to be taken: the certificate decides about the rest."""
SMALL_STEP = {Curve.CONSTANT: 1e-3, Curve.JUMPING: 1e-5, Curve.LINEAR: 1e-3, Curve.QUADRATIC: 1e-3}
"""A solution that needs less of a slow-down is slowed down; else limits are tightened where they are exceeded."""
WIDER = 1.1
"""What an excess is multiplied by to be the next margin."""
ROUNDS = 8
"""How often a motion is solved for anew at most, to be certified."""
SLACK = 2e-7
"""What a slow-down adds, for what lies between the certificate's states."""
FACTORS = (1.0, 2.5, 0.6)
"""What guessed durations are multiplied by, one start after another."""
STARTS = 4
"""Of arms of two or three joints: their programs have more than one optimum, and are small."""
DETOURS = 8
"""Starts around obstacles at most."""


@dataclass(frozen=True, eq=False)
class Program:
    """A problem that is made ready to be solved."""

    problem: Problem
    rows: list[Rows]
    solver: Solver
    seconds: float
    """What it took."""

    @classmethod
    def of(cls, problem: Problem, tolerance: float, *, expand: bool) -> Program:
        """Make a problem ready."""
        began = time.perf_counter()
        program, rows = problem.program
        solver = Solver(program, len(problem.mesh.legs), tolerance=tolerance, expand=expand)
        return cls(problem, rows, solver, time.perf_counter() - began)

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

    def __call__(self, warm: Trajectory | None = None) -> Found:
        """Return the best certified motion.

        Raises
        ------
        PlanningError
            No start converges, limits stay exceeded, or the time is over.
        """
        task, mesh = self.task, self.program.mesh
        margins, inflation = Margins(mesh), np.zeros(len(task.surroundings.obstacles) + 1)
        knots = self._first(margins, inflation, warm)
        for _ in range(ROUNDS):
            trajectory = assembled(task.arm, mesh, knots, fixed_ends=self.program.problem.jerk_counts)
            trajectory, certificate, c = self._kept(trajectory)
            if certificate.ok:
                cost = cost_of(self.program.problem.objective, trajectory, task.description, task.friction)
                return Found(trajectory, certificate, cost, c, tuple(self.tightened), self.iterations, self.solves)
            exceeded = [check.what for check in certificate.checks if check.excess > 0]
            self.tightened += [what for what in exceeded if what not in self.tightened]
            margins = self._wider(margins, trajectory)
            if "clearance" in exceeded:
                states = task.checker.states(trajectory)
                inflation = inflation + BEYOND * task.surroundings.short(task.description, states.q)
            guess = knots_along(trajectory, mesh, trajectory.breaks[list(mesh.ends)])
            knots = self._solution(guess, margins, inflation)
        worst = certificate.worst
        raise PlanningError(f"{self._whose(worst.what, worst.row)} stays exceeded at {worst.time:.3g} s, after {ROUNDS} rounds")

    def _kept(self, trajectory: Trajectory) -> tuple[Trajectory, Certificate, float]:
        """Return a motion, slowed down where that is all it takes, its certificate, and by what it was slowed down."""
        task = self.task
        states, c = task.checker.states(trajectory), 1.0
        if task.rests and task.duration is None:
            c = task.checker.slow_down(states)
            if 1 < c < 1 + SMALL_STEP[self.program.mesh.curve]:
                c *= 1 + SLACK
                trajectory = trajectory.slowed(c)
                return trajectory, task.checker.check(trajectory), c
        return trajectory, task.checker.check(trajectory, states), 1.0

    def _wider(self, margins: Margins, trajectory: Trajectory) -> Margins:
        """Return margins that are wider by what a motion exceeds in each interval."""
        checker = self.task.checker
        states = checker.states(trajectory)
        excesses = [(what, use - 1) for what, use in checker.measured(states) if what != "clearance"]
        for what, excess in [*excesses, ("position", checker.positions(states))]:
            worst = excess.reshape(margins.mesh.intervals, -1, excess.shape[1]).max(axis=1)
            if (worst > 0).any():
                margins = margins.raised(what, WIDER * worst)
        return margins

    # Starts

    def _first(self, margins: Margins, inflation: Array, warm: Trajectory | None) -> Knots:
        """Return the best solution of a few starts."""
        task, mesh, problem = self.task, self.program.mesh, self.program.problem
        if warm is not None and len(mesh.legs) == 1:
            try:
                return self._solution(knots_along(warm, mesh, np.array([warm.duration])), margins, inflation)
            except PlanningError:
                pass
        durations = leg_durations(task.description, task.limits, task.points)
        if task.duration is not None:
            durations *= task.duration / durations.sum()
        open_time = task.duration is None
        straight = [durations * (factor if open_time else 1.0) for factor in (FACTORS if open_time else (1.0,))]
        guesses = [lambda d=d: straight_knots(task, mesh, d) for d in straight]
        more = STARTS - 1 if 1 < problem.n <= FEW and problem.objective.has_time else 0
        if task.surroundings:
            more = max(more, DETOURS)
        guesses += [lambda k=k: detour(task, mesh, durations, seed=k) for k in range(more)]
        want = 1 + (more if not task.surroundings else 0)
        best: tuple[float, Knots] | None = None
        failure: PlanningError | None = None
        solved = 0
        for number, guess in enumerate(guesses):
            if solved and 0 < number < len(straight):
                continue  # another speed is for starts that fail
            try:
                knots = self._solution(guess(), margins, inflation)
            except _Late as error:
                if best is None:
                    raise PlanningError(f"{error}{self._lately(failure)}") from None
                break
            except PlanningError as error:
                failure = failure or error
                continue
            solved += 1
            if best is None or self._value < best[0]:
                best = self._value, knots
            if solved >= want:
                break
        if best is None:
            assert failure is not None
            if task.surroundings:
                raise PlanningError(
                    f"no way found around {task.surroundings.names} that keeps {1000 * task.surroundings.clearance:.3g} mm "
                    f"clear, from {len(guesses)} starts; the first: {failure}"
                )
            raise failure
        return best[1]

    def _lately(self, failure: PlanningError | None) -> str:
        around = f" around {self.task.surroundings.names}" if self.task.surroundings else ""
        return f"{around}; the first start: {failure}" if failure else around

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
            usual_accelerations(task.limits, guess.qdd),
        )
        inside = x_bounds(task, mesh, margins, jerk_counts=problem.jerk_counts)
        self.solves += 1
        try:
            solution = self.program.solver(guess.vector, parameters, inside, bounds, self.deadline, self.progress)
        except Stopped:
            raise _Late(f"no motion found within the time limit, after {self.solves} start{'s' * (self.solves > 1)}") from None
        self.iterations += solution.iterations
        if solution.converged and solution.infeasibility <= FEASIBLE:
            self._value = solution.cost
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
        return f"{what} of joint {names[row]}" if what in JOINTWISE else what

    def _scale(self, guess: Knots) -> float:
        """Return the cost of a guess, by which costs are divided."""
        objective, task = self.program.problem.objective, self.task
        if objective.only_time:
            return float(guess.durations.sum())
        trajectory = assembled(task.arm, self.program.mesh, guess, fixed_ends=False)
        return max(cost_of(objective, trajectory, task.description, task.friction), SMALLEST)


class _Late(PlanningError):
    """The time is over."""


SMALLEST = 1e-9
JOINTWISE = (
    "position",
    "velocity",
    "acceleration",
    "jerk",
    "torque",
    "motor power",
    "torque-speed line",
    "joint positions",
    "joint velocities",
)
"""What has a row for each joint."""
