"""Search for a certified motion of one task: solve, check, slow down or tighten limits, solve again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from dhkit.description import Array
from dhkit.errors import PlanningError
from dhkit.planning.assembly import assemble_trajectory, knots_along
from dhkit.planning.blocks import BlockProgram
from dhkit.planning.certificate import Certificate
from dhkit.planning.costs import cost_of, size_of
from dhkit.planning.guess import detour, leg_durations, straight_knots, usual_accelerations
from dhkit.planning.mesh import Curve, Mesh
from dhkit.planning.objectives import Objective
from dhkit.planning.obstacles.separation import PlaneRow
from dhkit.planning.problem import USUAL_MOVE, Problem
from dhkit.planning.report import JOINT_LIMITS
from dhkit.planning.solver import ProgressCall, Solver, Stopped
from dhkit.planning.states import States
from dhkit.planning.task import MAX_SMALL_JOINTS, Margins, PlanTask, g_bounds, worst_row, x_bounds
from dhkit.planning.variables import Knots
from dhkit.trajectories import Trajectory, quintic

FEASIBILITY_TOLERANCE = 1e-5
"""Largest violation of a solution's rows with which it is used; the certificate then decides."""
SMALL_STEP = {Curve.CONSTANT: 1e-3, Curve.JUMPING: 1e-5, Curve.LINEAR: 1e-3, Curve.QUADRATIC: 1e-3}
"""Relative slow-down up to which a solution is slowed down; beyond it, exceeded limits are tightened."""
STEP_GROWTH = 3.0
"""Growth of SMALL_STEP in each round: some excesses move from interval to interval."""
MARGIN_FACTOR, MARGIN_GROWTH = 1.1, 2.0
"""Factor of an excess that is added to the margin of a limit, and its growth in each round: some limits are exceeded
only between knots."""
UNCONVERGED_TOLERANCE = 1e-7
"""Largest violation of a solution's rows with which it is used although it is not optimal."""
FIRST_ROUNDS = 3
"""Largest number of solutions with tightened limits, before another curve of accelerations is tried."""
MAX_ROUNDS = 8
"""Largest number of solutions with tightened limits, before the search fails."""
TIME_SCALING_MARGIN = 2e-7
"""Relative margin added to a time scaling: the certificate samples states, and a peak may lie between two of them."""
RESTART_FACTORS = (2.5, 0.6)
"""Factors of the guessed durations for further starts, if the first one fails."""
SMALL_ARM_STARTS = 4
"""Number of starts for arms of two or three joints: their programs are small and have several local optima."""
MIN_LEG_SHARE = 1e-4
"""Shortest duration of a leg, as a share of the guessed duration of the motion."""
RESOLUTION = 1e-10
"""Smallest move (rad or m) that is optimized: below it, joint values are rounded by more than a millionth of it."""
SHORTEST_DURATION = 1e-6
"""Shortest duration of smaller moves, s."""
SLOWNESS = 2.0
"""Duration of smaller moves over that of the fastest cubic."""
STILL_DURATION = 1e-3
"""Guessed duration (s) of a motion that nothing limits."""
MAX_GUESSED_DURATION, GUESSED_DURATIONS = 100.0, 24
"""Longest duration (s) and number of durations that are compared for the initial guess of mixed objectives."""


@dataclass(frozen=True, eq=False)
class Program:
    """A problem with its solver."""

    problem: Problem
    blocks: BlockProgram
    solver: Solver
    planes: Array
    """Parameters of the planes that keep links apart from obstacles, shape (k,)."""

    @classmethod
    def of(cls, problem: Problem, tolerance: float, planes: Sequence[PlaneRow] = ()) -> Program:
        """Build the solver of a problem, with planes on one side of which points of links stay."""
        blocks, values = problem.apart(planes)
        return cls(problem, blocks, Solver(blocks, len(problem.mesh.legs), tolerance=tolerance), values)

    def apart(self, planes: Sequence[PlaneRow]) -> Program:
        """Return the same program with other planes."""
        return Program.of(self.problem, self.solver.tolerance, planes)

    @property
    def mesh(self) -> Mesh:
        """The problem's mesh."""
        return self.problem.mesh


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A certified motion, with its cost."""

    trajectory: Trajectory
    certificate: Certificate
    cost: float
    curve: Curve
    """Shape of the acceleration in the program's intervals."""
    slow_down: float = 1.0
    tightened: tuple[str, ...] = ()
    is_resolved: bool = True
    """Whether the motion was optimized; a move below ``RESOLUTION`` is not."""
    is_converged: bool = True
    """Whether it is optimal to the solver's tolerance, near where the search began."""

    @classmethod
    def unresolved(cls, task: PlanTask, objective: Objective) -> PlannedMotion:
        """Return a quintic for a move that is too small to be optimized, slow enough for its limits.

        Raises
        ------
        PlanningError
            The given duration is too short.
        """
        least = leg_durations(task.description, task.limits, task.points[[0, -1]])
        duration = task.duration or max(SLOWNESS * float(least.sum()), SHORTEST_DURATION)
        trajectory = quintic(task.arm, task.points[0], task.points[-1], duration)
        certificate = task.checker.check(trajectory)
        if not certificate.ok:
            worst = max(certificate.checks, key=lambda check: check.excess)
            raise PlanningError(f"{worst.what} is exceeded by {100 * worst.excess:.2g} % at {worst.time:.3g} s")
        cost = cost_of(objective, trajectory, task.description, task.friction)
        return cls(trajectory, certificate, cost, Curve.QUADRATIC, is_resolved=False)


@dataclass
class Work:
    """Work of all searches for one motion, of failed branches too."""

    iterations: int = 0
    solves: int = 0
    build_seconds: float = 0.0
    """Time for making programs, s."""


@dataclass(eq=False)
class Search:
    """The search for one motion, which counts its solutions and iterations."""

    task: PlanTask
    program: Program
    deadline: float
    """Time at which the search ends, on the clock of ``time.perf_counter``, s."""
    progress: ProgressCall | None = None
    is_last: bool = True
    """Whether no other curve of accelerations is tried after this search."""
    is_converged: bool = True
    """Whether the last solution is optimal to the solver's tolerance."""
    iterations: int = 0
    solves: int = 0
    tightened: list[str] = field(default_factory=list)
    value: float = np.inf
    """Value of the objective in the last solution."""
    failure: PlanningError | None = None
    """The first failure."""

    def __call__(self, warm: Trajectory | None = None) -> PlannedMotion:
        """Return the best certified motion.

        Raises
        ------
        PlanningError
            No start converges, limits stay exceeded, or the time is over.
        """
        try:
            for knots in self._solutions(warm):
                try:
                    return self._certify(knots)
                except PlanningError as error:
                    self.keep_first_failure(error)
        except TimeLimitError:
            starts = f"{self.solves} start{'s' * (self.solves > 1)}"
            reason = f"; the first: {self.failure}" if self.failure else ""
            raise PlanningError(f"no motion found within the time limit, in {starts}{reason}") from None
        raise self.failure or PlanningError("no motion found")

    def keep_first_failure(self, error: PlanningError) -> None:
        """Remember the first failure of several starts; the end of the time is raised again."""
        if isinstance(error, TimeLimitError):
            raise error
        self.failure = self.failure or error

    def _certify(self, knots: Knots) -> PlannedMotion:
        """Return a solution as a certified motion, solved again with tightened limits where necessary."""
        margins = Margins(self.program.mesh)
        for turn in range(self._rounds):
            found = self.checked(knots, turn)
            if isinstance(found, PlannedMotion):
                return found
            margins = self.widen_margins(margins, found.states, turn)
            knots = self.solution(self.knots_of(found.trajectory), margins)
        raise self.stays_exceeded(found.certificate)

    @property
    def _rounds(self) -> int:
        return MAX_ROUNDS if self.is_last else FIRST_ROUNDS

    def knots_of(self, trajectory: Trajectory) -> Knots:
        """Return a motion of the program's mesh as the start of the next solution."""
        return knots_along(trajectory, self.program.mesh, trajectory.breaks[list(self.program.mesh.ends)])

    def checked(self, knots: Knots, turn: int) -> PlannedMotion | Excess:
        """Return a solution as a certified motion, or what it exceeds; in later turns it may be slowed down further."""
        task, mesh = self.task, self.program.mesh
        trajectory = assemble_trajectory(task.arm, mesh, knots, fixed_ends=self.program.problem.jerk_counts)
        trajectory, states, certificate, c = self._slow_down(trajectory, SMALL_STEP[mesh.curve] * STEP_GROWTH**turn)
        if certificate.ok:
            cost, tightened = self._cost(trajectory), tuple(self.tightened)
            return PlannedMotion(
                trajectory, certificate, cost, mesh.curve, c, tightened, is_converged=self.is_converged
            )
        exceeded = [check.what for check in certificate.checks if check.excess > 0]
        self.tightened += [what for what in exceeded if what not in self.tightened]
        return Excess(trajectory, states, certificate)

    def stays_exceeded(self, certificate: Certificate) -> PlanningError:
        """Return the error for a limit that tightening does not help."""
        worst = max(certificate.checks, key=lambda check: check.excess)
        name = self._row_name(worst.what, worst.row)
        return PlanningError(f"{name} stays exceeded at {worst.time:.3g} s, after {self._rounds} rounds")

    def _slow_down(self, trajectory: Trajectory, step: float) -> tuple[Trajectory, States, Certificate, float]:
        """Return a motion, slowed down if a factor up to 1 + ``step`` suffices, its states, certificate and factor."""
        task = self.task
        states, c = task.checker.states(trajectory), 1.0
        if task.rests and task.duration is None:
            c = task.checker.slow_down(states)
            if 1 < c < 1 + step:
                c *= 1 + TIME_SCALING_MARGIN
                # The states are computed again, so that the certificate does not rely on the law of time scaling.
                trajectory = trajectory.slowed(c)
                states = task.checker.states(trajectory)
            else:
                c = 1.0
        return trajectory, states, task.checker.check(trajectory, states), c

    def widen_margins(self, margins: Margins, states: States, turn: int) -> Margins:
        """Return margins raised in each interval in proportion to the excess of a motion, more in later turns."""
        checker, factor = self.task.checker, MARGIN_FACTOR * MARGIN_GROWTH**turn
        excesses = [(what, use - 1) for what, use in checker.peaks(states) if what != "clearance"]
        for what, excess in [*excesses, ("position", checker.positions(states))]:
            worst = excess.reshape(margins.mesh.intervals, -1, excess.shape[1]).max(axis=1)
            if (worst > 0).any():
                margins = margins.raised(what, factor * worst)
        return margins

    # Starts

    def _solutions(self, warm: Trajectory | None) -> Iterator[Knots]:
        """Yield solutions; several starts of a small arm are sorted by their cost."""
        task = self.task
        is_small_arm = 1 < task.arm.n <= MAX_SMALL_JOINTS and self.program.problem.objective.has_time
        # In small moves gravity and inertia hardly change, so that detours do not pay.
        is_multistart = is_small_arm and task.span >= USUAL_MOVE
        found: list[tuple[float, Knots]] = []
        for guess in self._guesses(warm, SMALL_ARM_STARTS if is_multistart else 1):
            try:
                knots = self.solution(guess())
            except PlanningError as error:
                if found and isinstance(error, TimeLimitError):
                    break
                self.keep_first_failure(error)
                continue
            if not is_multistart:
                yield knots
            else:
                found.append((self.value, knots))
        yield from (knots for _, knots in sorted(found, key=lambda item: item[0]))

    def _guesses(self, warm: Trajectory | None, starts: int) -> Iterator[Callable[[], Knots]]:
        """Yield initial guesses: a given motion, straight paths, and detours."""
        task, mesh = self.task, self.program.mesh
        if warm is not None and len(mesh.legs) == 1:
            yield lambda: knots_along(warm, mesh, np.array([warm.duration]))
        durations = self.guessed_durations()
        yield lambda: straight_knots(task, mesh, durations)
        for seed in range(starts - 1):
            yield lambda seed=seed: detour(task, mesh, durations, seed)  # type: ignore[misc]
        if self.failure is not None and task.duration is None:
            for factor in RESTART_FACTORS:
                yield lambda factor=factor: straight_knots(task, mesh, durations * factor)  # type: ignore[misc]

    def guessed_durations(self) -> Array:
        """Return durations of the legs for an initial guess, shape (legs,), s."""
        task = self.task
        durations = leg_durations(task.description, task.limits, task.points)
        durations = np.maximum(durations, 10 * MIN_LEG_SHARE * float(durations.sum()) or STILL_DURATION)
        if task.duration is not None:
            durations *= task.duration / durations.sum()
        elif not self.program.problem.objective.only_time:
            durations *= self._best_factor(durations)
        return durations

    def _best_factor(self, durations: Array) -> float:
        """Return the factor of the durations with which the straight path costs least."""
        factors = np.geomspace(1.0, MAX_GUESSED_DURATION / max(float(durations.sum()), 1e-6), GUESSED_DURATIONS)
        costs = []
        for factor in factors:
            knots = straight_knots(self.task, self.program.mesh, durations * factor)
            costs.append(self._cost(assemble_trajectory(self.task.arm, self.program.mesh, knots, fixed_ends=False)))
        return float(factors[int(np.argmin(costs))])

    def _cost(self, trajectory: Trajectory) -> float:
        return cost_of(self.program.problem.objective, trajectory, self.task.description, self.task.friction)

    def solution(self, guess: Knots, margins: Margins | None = None, program: Program | None = None) -> Knots:
        """Return a solution from an initial guess.

        Raises
        ------
        PlanningError
            Not converged: names the row with the largest violation.
        """
        task, program = self.task, program or self.program
        problem, margins = program.problem, margins or Margins(program.mesh)
        bounds = g_bounds(task, problem, program.blocks, margins)
        parameters = problem.parameters(
            task.load, task.parameters, 1.0 / self._cost_scale(guess), usual_accelerations(task, guess)
        )
        inside = x_bounds(task, problem, margins, MIN_LEG_SHARE * float(guess.durations.sum()))
        self.solves += 1
        try:
            solution = program.solver(
                problem.vector(guess),
                np.append(parameters, program.planes),
                inside,
                bounds,
                self.deadline,
                self.progress,
                problem.scaling(program.blocks, guess),
            )
        except Stopped:
            raise TimeLimitError from None
        self.iterations += solution.iterations
        # A feasible motion that is not optimal is better than none: friction and absolute powers have kinks.
        is_usable = solution.converged or (self.is_last and solution.infeasibility <= UNCONVERGED_TOLERANCE)
        if is_usable and solution.infeasibility <= FEASIBILITY_TOLERANCE:
            self.is_converged = solution.converged
            self.value = solution.cost
            return problem.knots(solution.x)
        what, which, share, misses = worst_row(solution, problem, program.blocks, bounds)
        raise PlanningError(
            f"not converged ({solution.status.replace('_', ' ').lower()}, {solution.iterations} iterations): "
            f"{self._row_name(what, which)} misses its bound by {misses:.2g} at {100 * share:.0f} % of the way"
        )

    def _row_name(self, what: str, row: int) -> str:
        names = [joint.name for joint in self.task.description.joints]
        return f"{what} of joint {names[row]}" if what in JOINT_ROWS else what

    def _cost_scale(self, guess: Knots) -> float:
        """Return the cost of a guess, which scales the objective."""
        if self.program.problem.objective.only_time:
            return float(guess.durations.sum())
        trajectory = assemble_trajectory(self.task.arm, self.program.mesh, guess, fixed_ends=False)
        objective, task = self.program.problem.objective, self.task
        return max(size_of(objective, trajectory, task.description, task.friction), MIN_COST_SCALE)


@dataclass(frozen=True, eq=False)
class Excess:
    """A motion that exceeds limits."""

    trajectory: Trajectory
    states: States
    certificate: Certificate


class TimeLimitError(PlanningError):
    """The time limit was reached."""


MIN_COST_SCALE = 1e-9
JOINT_ROWS = (*JOINT_LIMITS, "joint positions", "joint velocities", "joint accelerations")
"""Names of rows that apply to each joint."""


def coarser(search: Search, motion: Trajectory) -> tuple[int, float] | None:
    """Return the number of intervals of a coarser program and the cost of its motion; None if time has run out."""
    if time.perf_counter() > search.deadline:
        return None
    try:
        found = search(motion)
    except PlanningError:
        return None
    return len(found.trajectory.breaks) - 1, found.cost
