"""Search for a certified motion of one task: solve, check, slow down or tighten limits, solve again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Generic

import numpy as np

from dhkit.errors import PlanningError
from dhkit.planning.certificate import Certificate
from dhkit.planning.criteria import Limit, States, cost_of
from dhkit.planning.program import (
    Iterate,
    Margins,
    OptimizationProgram,
    ProgressCall,
    SearchLimitError,
    Solution,
    Starts,
    Task,
    Work,
    leg_durations,
    row_bounds,
    straight_motion,
    worst_row,
)
from dhkit.trajectories import Trajectory, quintic

FEASIBILITY_TOLERANCE = 1e-5
"""Largest violation of rows, in their units, with which a solution is used; the certificate then decides."""
STEP_GROWTH = 3.0
"""Growth of the largest slow-down in each round: some excesses move from interval to interval."""
LAST_STEP = 1.0
"""Largest relative slow-down after the last round."""
MARGIN_FACTOR = 1.1
"""Factor of an excess that is added to the margin of a limit, in the first round."""
MARGIN_GROWTH = 2.0
"""Growth of that factor in each round: some limits are exceeded only between knots."""
UNCONVERGED_TOLERANCE = 1e-7
"""Largest violation of rows, in their units, with which a solution is used although it is not optimal."""
FIRST_ROUNDS = 3
"""Largest number of solutions with tightened limits, before another curve of accelerations is tried."""
MAX_ROUNDS = 8
"""Largest number of solutions with tightened limits, before the search fails."""
TIME_SCALING_MARGIN = 2e-7
"""Relative margin added to a time scaling: the certificate samples states, and a peak may lie between two of them."""
RESOLUTION = 1e-10
"""Smallest move (rad or m) that is optimized: below it, joint values are rounded by more than a millionth of it."""
SHORTEST_DURATION = 1e-6
"""Shortest duration of a move that is not optimized, s."""
SLOWNESS = 2.0
"""Ratio of durations, of a move that is too small to be optimized over the fastest cubic that keeps its limits."""


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A certified motion, with its cost."""

    trajectory: Trajectory
    certificate: Certificate
    cost: float
    intervals: int
    """Number of intervals of the program's mesh."""
    slow_down: float = 1.0
    tightened: tuple[str, ...] = ()
    is_resolved: bool = True
    """Whether the motion was optimized; a move below ``RESOLUTION`` is not."""
    is_converged: bool = True
    """Whether it is optimal to the solver's tolerance, near where the search began."""
    attempt: int = 0
    """Index of the curve of accelerations of its program."""
    failure: str = ""
    """The optimizer's error, for a given path slowed down that is returned instead of an optimum; else empty."""

    @classmethod
    def unresolved(cls, task: Task) -> PlannedMotion:
        """Return a quintic for a move that is too small to be optimized, slow enough for its limits.

        Raises
        ------
        PlanningError
            The given duration is too short.
        """
        least = leg_durations(task.loaded, task.limits, task.points[[0, -1]])
        duration = task.duration or max(SLOWNESS * float(least.sum()), SHORTEST_DURATION)
        trajectory = quintic(task.arm, task.points[0], task.points[-1], duration)
        certificate = task.checker.check(trajectory)
        if not certificate.ok:
            worst = max(certificate.checks, key=lambda check: check.excess)
            raise PlanningError(f"{worst.statement} at {worst.time:.3g} s")
        cost = cost_of(task.objective, trajectory, task.loaded, task.friction)
        return cls(trajectory, certificate, cost, 1, is_resolved=False)

    @classmethod
    def slowed_straight(
        cls, task: Task, intervals: int, failure: PlanningError
    ) -> PlannedMotion | None:
        """Return cubics between the task's points, slowed down until they keep all limits; None if they cannot.

        For tasks in which the optimizer finds nothing; ``failure`` is its error.
        """
        if not task.rests or task.duration is not None:
            return None
        durations = np.maximum(
            leg_durations(task.loaded, task.limits, task.points), SHORTEST_DURATION
        )
        straight = straight_motion(task, durations)
        c = task.checker.slow_down(task.checker.states(straight))
        if not np.isfinite(c):
            return None
        trajectory = straight.slowed(c * (1 + TIME_SCALING_MARGIN))
        certificate = task.checker.check(trajectory)
        if not certificate.ok:
            return None
        cost = cost_of(task.objective, trajectory, task.loaded, task.friction)
        return cls(
            trajectory, certificate, cost, intervals, is_converged=False, failure=str(failure)
        )


@dataclass(frozen=True, eq=False)
class _Solved(Generic[Iterate]):
    """A guess, its solution as a motion, and Ipopt's result."""

    guess: Iterate
    found: Iterate
    solution: Solution


@dataclass(frozen=True, eq=False)
class _Slowed:
    """A motion that was slowed down by a factor, which may be 1, with its states and certificate."""

    trajectory: Trajectory
    states: States
    certificate: Certificate
    factor: float


@dataclass(eq=False)
class MotionSearch(Generic[Iterate]):
    """The search for one motion."""

    task: Task
    program: OptimizationProgram[Iterate]
    work: Work
    """Counts the solutions and iterations, and says when the search ends."""
    progress: ProgressCall | None = None
    is_last: bool = True
    """Whether no other curve of accelerations is tried after this search."""
    tightened: list[str] = field(default_factory=list)
    found: Iterate | None = None
    """The last motion that was certified."""
    failure: PlanningError | None = None
    """The first failure."""
    tried: int = 0
    """Number of solutions of this search."""
    _last: Solution = field(init=False)

    def __call__(
        self, warm: Trajectory | None = None, starts: Starts[Iterate] | None = None
    ) -> PlannedMotion:
        """Return the best certified motion.

        Raises
        ------
        PlanningError
            No start converges, limits stay exceeded, or the limit of the work is reached.
        """
        try:
            for start in self._solutions(starts or self.program.starts(self.task, warm)):
                self._last = start.solution
                try:
                    return self._certify(start.guess, start.found)
                except PlanningError as error:
                    self.keep_first_failure(error)
        except SearchLimitError as limit:
            count = f"{self.tried} start{'s' * (self.tried > 1)}"
            reason = f"; the first: {self.failure}" if self.failure else ""
            raise PlanningError(f"{limit}, in {count}{reason}") from None
        raise self.failure or PlanningError("no motion found")

    def keep_first_failure(self, error: PlanningError) -> None:
        """Remember the first failure of several starts; the limit of the search is raised again."""
        if isinstance(error, SearchLimitError):
            raise error
        self.failure = self.failure or error

    def _solutions(self, starts: Starts[Iterate]) -> Iterator[_Solved[Iterate]]:
        """Yield guesses with their solutions; those that are compared come first, in the order of their cost."""
        compared: list[_Solved[Iterate]] = []
        for k, make in enumerate(starts.guesses):
            if k == starts.compared:
                yield from sorted(compared, key=lambda solved: solved.solution.cost)
                compared.clear()
            guess = make()
            try:
                found = self.solution(guess)
            except PlanningError as error:
                if compared and isinstance(error, SearchLimitError):
                    break
                self.keep_first_failure(error)
                continue
            solved = _Solved(guess, found, self._last)
            if k < starts.compared:
                compared.append(solved)
            else:
                yield solved
        yield from sorted(compared, key=lambda solved: solved.solution.cost)

    def _certify(self, guess: Iterate, found: Iterate) -> PlannedMotion:
        """Return a solution as a certified motion, solved again with tightened limits where necessary."""
        program = self.program
        margins = Margins(self.program.intervals)
        try:
            for turn in range(self._rounds):
                checked = self.checked(
                    found, turn, is_last=self.is_last and turn == self._rounds - 1
                )
                if isinstance(checked, PlannedMotion):
                    return checked
                before = self.program
                margins = self.widen_margins(margins, found, checked, turn)
                if (
                    self.program is before
                    and (again := self._solved_again(guess, margins)) is not None
                ):
                    found = again
                    continue
                guess = self.program.next_guess(guess, found)
                found = self.solution(guess, margins)
            raise self.stays_exceeded(checked.certificate, self._rounds)
        finally:
            self.program = program

    def _solved_again(self, guess: Iterate, margins: Margins) -> Iterate | None:
        """Return a solution with other margins from the last one and its multipliers; None if it did not converge."""
        try:
            return self.solution(guess, margins, warm=self._last)
        except SearchLimitError:
            raise
        except PlanningError:
            return None

    @property
    def _rounds(self) -> int:
        return MAX_ROUNDS if self.is_last else FIRST_ROUNDS

    def checked(
        self, found: Iterate, turn: int, *, is_last: bool = False
    ) -> PlannedMotion | Excess:
        """Return a solution as a certified motion, or its excess; in later turns it may be slowed down further."""
        task = self.task
        program = self.program
        step = LAST_STEP if is_last else program.small_step * STEP_GROWTH**turn
        slowed = self._slow_down(program.trajectory(task, found), step)
        certificate = slowed.certificate
        if certificate.ok:
            self.found = found
            return PlannedMotion(
                slowed.trajectory,
                certificate,
                cost_of(task.objective, slowed.trajectory, task.loaded, task.friction),
                program.intervals,
                slowed.factor,
                tuple(self.tightened),
                is_converged=self._last.converged,
            )
        exceeded = [check.what for check in certificate.checks if check.excess > 0]
        self.tightened += [what for what in exceeded if what not in self.tightened]
        return Excess(slowed.trajectory, slowed.states, certificate)

    def stays_exceeded(self, certificate: Certificate, solutions: int) -> PlanningError:
        """Return the error for a limit that is exceeded after some solutions with tightened limits."""
        worst = max(certificate.checks, key=lambda check: check.excess)
        name = self._row_name(worst.what, worst.row, of_joint=worst.of_joint)
        return PlanningError(
            f"limit of {name} is still exceeded at {worst.time:.3g} s after {solutions} solutions with tightened "
            f"limits; try more intervals"
        )

    def _slow_down(self, trajectory: Trajectory, step: float) -> _Slowed:
        """Return a motion with its certificate, slowed down if a factor up to 1 + ``step`` suffices."""
        task = self.task
        states = task.checker.states(trajectory)
        c = 1.0
        if task.rests and task.duration is None:
            c = task.checker.slow_down(states)
            if 1 < c < 1 + step:
                c *= 1 + TIME_SCALING_MARGIN
                # The states are computed again, so that the certificate does not rely on the law of time scaling.
                trajectory = trajectory.slowed(c)
                states = task.checker.states(trajectory)
            else:
                c = 1.0
        return _Slowed(trajectory, states, task.checker.check(trajectory, states), c)

    def widen_margins(self, margins: Margins, found: Iterate, excess: Excess, turn: int) -> Margins:
        """Return margins raised in each interval in proportion to the excess of a motion, more in later turns.

        The mesh may become finer.
        """
        interval = self.program.interval_of(excess.trajectory, found)
        factor = MARGIN_FACTOR * MARGIN_GROWTH**turn
        more = {}
        for limit, use in self.task.checker.peaks(excess.states).items():
            # The largest excess in each piece of the motion, then in each interval of the mesh.
            over = use.reshape(len(interval), -1, use.shape[1]).max(axis=1) - 1
            worst = np.zeros((self.program.intervals, use.shape[1]))
            np.maximum.at(worst, interval, over)
            if limit != Limit.CLEARANCE and (worst > 0).any():
                more[limit] = factor * worst
        self.program, margins = self.program.tightened(margins, more)
        return margins

    def solution(
        self,
        guess: Iterate,
        margins: Margins | None = None,
        program: OptimizationProgram[Iterate] | None = None,
        warm: Solution | None = None,
    ) -> Iterate:
        """Return a solution from an initial guess, or from a solution from it with other margins, ``warm``.

        Raises
        ------
        PlanningError
            Not converged: names the row with the largest violation.
        """
        task = self.task
        program = program or self.program
        margins = margins or Margins(program.intervals)
        given = program.arguments(task, guess, margins)
        rows = row_bounds(task, program.blocks, margins)
        self.tried += 1
        self.work.solves += 1
        solution = program.solver(
            given.x,
            given.parameters,
            given.bounds,
            rows,
            self.work,
            self.progress,
            given.scaling,
            warm,
        )
        # A feasible motion that is not optimal is better than none: friction and absolute powers have kinks.
        is_usable = solution.converged or (
            self.is_last and solution.infeasibility <= UNCONVERGED_TOLERANCE
        )
        if is_usable and solution.infeasibility <= FEASIBILITY_TOLERANCE:
            self._last = solution
            return program.iterate(solution.x)
        worst = worst_row(solution, program.blocks, rows)
        name = self._row_name(worst.rows.what, worst.place, of_joint=worst.rows.of_joints)
        state = (
            f"misses its bound by {worst.violation:.2g}"
            if np.isfinite(worst.violation)
            else "is not a number"
        )
        raise PlanningError(
            f"not converged ({solution.status.replace('_', ' ').lower()}, {solution.iterations} iterations): "
            f"{name} {state} at {program.place(worst.interval)}"
        )

    def _row_name(self, what: str, row: int, *, of_joint: bool) -> str:
        return f"{what} of joint {self.task.arm.joints[row].name}" if of_joint else what


@dataclass(frozen=True, eq=False)
class Excess:
    """A motion that exceeds limits."""

    trajectory: Trajectory
    states: States
    certificate: Certificate


def coarser(search: MotionSearch[Iterate], motion: Trajectory) -> tuple[int, float] | None:
    """Return the number of intervals of a coarser program and the cost of its motion; None if the limit is reached."""
    if search.work.is_over:
        return None
    try:
        found = search(motion)
    except PlanningError:
        return None
    return found.intervals, found.cost
