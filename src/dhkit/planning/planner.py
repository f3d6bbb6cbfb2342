"""The planner: one program for many motions, each certified before it is returned."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Robot, description_of
from dhkit.description.frames import world_to_tool
from dhkit.display import repr_line
from dhkit.errors import PlanningError
from dhkit.planning.certificate import Checker
from dhkit.planning.criteria import Constraint, Objective, ObjectiveLike, prepare
from dhkit.planning.many import ManyProgress, SimilarMotions, solve_many
from dhkit.planning.plan_report import BranchReport, classical_motions, report_of
from dhkit.planning.program import (
    MIN_LEG_INTERVALS,
    SMALL_ARM_JOINTS,
    Curve,
    Mesh,
    MotionProgram,
    Problem,
    ProgressCall,
    Task,
    Work,
    curves_for,
    delayed_interrupts,
    leg_durations,
)
from dhkit.planning.request import (
    PlanKeywords,
    PlanOptions,
    PlanRequest,
    Route,
    checked_constraints,
    checked_limits,
    end_velocity,
    find_routes,
    parse_places,
    require_inside_limits,
    require_place,
    require_possible,
    smoothed,
)
from dhkit.planning.search import (
    FINER,
    RESOLUTION,
    MotionSearch,
    PlannedMotion,
    coarser,
    motion_around,
)
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits, Trajectory
from dhkit.trajectories.limits import ADVICE_ON_LIMITS

DEFAULT_INTERVALS = 48
"""Default number of intervals for arms of six joints; more for fewer joints, since they cost less."""
MIN_DEFAULT_INTERVALS = 24
"""Smallest default number of intervals."""
MAX_INTERVALS = 2000
"""Largest number of intervals."""
SMALL_ARM_SIZE = 384
"""Product of joints and default intervals for arms of few joints."""
DURATION_TOLERANCE = 1e-3
"""Relative excess of the fastest motion over a given duration from which an error calls the duration too short."""
DEFAULT_DURATION_FACTOR = 2.0
"""Factor over the duration of the fastest cubics that gives the default duration of objectives without time."""


class _TaskMotion(NamedTuple):
    """The best motion of a route, with the task whose clearance it keeps."""

    task: Task
    motion: PlannedMotion


class Planner:
    """Plans motions of one arm with one objective and one set of constraints.

    Programs are built when first needed and then solved for any start, goal, limits, payload and obstacles. Calls from
    several threads take turns. Every returned motion was checked on a dense grid with Pinocchio.

    Parameters
    ----------
    description
        The robot; torque limits and objectives of torque need a body on every link.
    objective
        ``"time"``, ``"effort"``, ``"energy"``, ``"jerk"``, a term such as ``Time()``, or a sum such as
        ``Time() + 0.01 * Effort()``.
    limits
        The robot's own unless given; see :class:`dhkit.trajectories.Limits`.
    constraints
        Further constraints, such as ``ToolSpeed(0.5)``.
    intervals
        Number of intervals of the mesh; by default 48 for six joints or more, and more for fewer joints; half of that
        for smooth objectives, for all without time of up to three joints, and with obstacles. Finer meshes find
        slightly better motions in more time.
    friction
        Friction of the joints, as for inverse dynamics; a step is smoothed over 0.01 rad/s.

    Raises
    ------
    ValueError, TypeError
        An argument that is none of these.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> planner = Planner(library_robot("planar2r"), intervals=24)
    >>> motion = planner.solve([0.0, 0.0], [1.0, 0.5])
    >>> motion.report.certificate.ok, bool(abs(motion.q(motion.duration) - [1.0, 0.5]).max() < 1e-12)
    (True, True)
    """

    def __init__(
        self,
        description: Robot,
        objective: ObjectiveLike = "time",
        limits: Limits | None = None,
        constraints: Constraint | Sequence[Constraint] = (),
        intervals: int | None = None,
        friction: bool | Friction = False,
    ) -> None:
        description = description_of(description)
        if intervals is not None and (
            type(intervals) is not int or not MIN_LEG_INTERVALS <= intervals <= MAX_INTERVALS
        ):
            raise ValueError(
                f"intervals is {intervals!r}; expected a whole number from {MIN_LEG_INTERVALS} to {MAX_INTERVALS}"
            )
        self.description = description
        self.objective = Objective.of(objective)
        self.limits = checked_limits(description, limits)
        self.constraints = checked_constraints(constraints)
        usual = (
            SMALL_ARM_SIZE // description.n
            if description.n <= SMALL_ARM_JOINTS
            else DEFAULT_INTERVALS
        )
        # Smooth objectives need half as many intervals: their accelerations are parabolas. Meshes of arms of few joints
        # are fine enough for half of them to find least energy, whose torques jump.
        self._requested_intervals = intervals
        has_jumps = self.objective.has_time or (
            not self.objective.is_smooth and description.n > SMALL_ARM_JOINTS
        )
        self.intervals = intervals or (usual if has_jumps else usual // 2)
        self.friction = smoothed(Friction.chosen(friction))
        self._programs: dict[tuple[object, ...], MotionProgram] = {}
        self._making = threading.Lock()

    def __reduce__(self) -> tuple[type[Planner], tuple[object, ...]]:
        # Programs cannot be sent to another process: they are made again.
        friction = False if self.friction is None else self.friction
        arguments = self.description, self.objective, self.limits, self.constraints
        return type(self), (*arguments, self._requested_intervals, friction)

    def __repr__(self) -> str:
        return repr_line(
            f"Planner of {self.description.name}",
            summary=f"least {self.objective}, {self.intervals} intervals",
        )

    def solve(
        self,
        start: ArrayLike | str,
        goal: ArrayLike | str,
        *,
        options: PlanOptions | None = None,
        **keywords: Unpack[PlanKeywords],
    ) -> Trajectory:
        """Return the best motion, certified; its ``report`` says how good it is.

        Parameters
        ----------
        start
            Joint values (n,), rad and m, or the name of a configuration.
        goal
            The same, or a pose (4, 4) of the tool in the world, of which all branches of inverse kinematics are tried.
        options, **keywords
            Fields of :class:`PlanOptions`, as one value or one by one: ``via``, ``coordinates``, ``duration``,
            ``start_velocity``, ``goal_velocity``, ``limits``, ``payload``, ``obstacles``, ``clearance``,
            ``self_collision``, ``warm``, ``max_iterations``, ``time_limit``, ``progress``, ``compare``.

        Raises
        ------
        PlanningError
            There is no such motion, or none was found: says which limit or obstacle prevents it.
        ValueError, TypeError
            Arguments of another shape or type.
        """
        chosen = PlanOptions.of(options, keywords)
        description = self.description
        work = chosen.work()
        if chosen.warm is not None:
            chosen.warm.require(description)
        places = parse_places(description, start, chosen.via, goal)
        request = PlanRequest(
            checked_limits(description, self.limits if chosen.limits is None else chosen.limits),
            chosen.duration,
            end_velocity(description, chosen.start_velocity, "start"),
            end_velocity(description, chosen.goal_velocity, "goal"),
            chosen.payload,
            chosen.avoidance(),
        )
        for place in places:
            if place.q is not None:
                require_inside_limits(description, request.limits, place.q, place.name)
        routes = find_routes(description, request.limits, places, chosen.coordinates)
        require_possible(description, self.objective, self.constraints, request, places, routes)
        try:
            task, best, branches = self._best(request, routes, chosen.warm, work, chosen.progress)
        except PlanningError as error:
            raise self._with_reason(error, request, routes, work) from None
        report = replace(
            report_of(task, best, work),
            branches=branches,
            coordinates=tuple(chosen.coordinates or ()),
        )
        is_choice = task.duration is None or not self.objective.only_time
        if chosen.compare and best.is_resolved and is_choice:
            report = replace(
                report, classical=classical_motions(task), coarse=self._coarse(task, best, work)
            )
        return replace(
            best.trajectory, report=report, payload=chosen.payload, friction=self.friction
        )

    def solve_many(
        self,
        starts: ArrayLike,
        goals: ArrayLike,
        *,
        warm: SimilarMotions = None,
        workers: int | None = None,
        progress: ManyProgress | None = None,
        **options: Any,
    ) -> list[Trajectory | PlanningError]:
        """Return the best motions between N pairs of places, or why there is none, found by several processes.

        A script that calls this needs ``if __name__ == "__main__":``, as for Python's ``multiprocessing``.

        Parameters
        ----------
        starts, goals
            Joint values, shape (N, n), or (n,) for all, rad and m; goals may be poses (N, 4, 4) or (4, 4) of the tool.
        warm
            A motion like all of them, or N motions, such as those found for places nearby: initial guesses.
        workers
            Number of processes: as many as the machine has cores unless given, 1 for none.
        progress
            Called after each motion with the numbers of motions done and of all; an exception in it ends the rest.
        options
            Arguments of :meth:`solve` for all motions.

        Raises
        ------
        ValueError, TypeError
            Arguments of another shape or type.
        """
        return solve_many(
            self, starts, goals, warm=warm, workers=workers, progress=progress, options=options
        )

    # Programs

    @delayed_interrupts()
    def program(
        self, task: Task, attempt: int = 0, scale: float = 1.0
    ) -> tuple[MotionProgram, float]:
        """Return the program for a task, and the time for building it now, s.

        Parameters
        ----------
        attempt
            Index of its curve, see :func:`curves_for`; later ones have twice as many intervals.
        scale
            Factor of the number of intervals.
        """
        legs = len(task.points) - 1
        limits = task.limits
        jerk_limited = bool(np.isfinite(limits.jerk).any())
        with_torque = bool(np.isfinite(limits.torque).any())
        intervals = max(
            MIN_LEG_INTERVALS, int(scale * self.intervals_for(task) * (2 if attempt else 1))
        )
        key = (legs, task.is_loaded, jerk_limited, with_torque, intervals, attempt)
        with self._making:
            if key in self._programs:
                return self._programs[key], 0.0
            began = time.perf_counter()
            prepare(self.description)
            curve = self._curves(task)[attempt]
            problem = Problem(
                self.description,
                self.objective,
                self.constraints,
                limits,
                Mesh.of(intervals, legs, curve),
                friction=self.friction,
                payload=task.is_loaded,
                jerk_limited=jerk_limited,
            )
            program = MotionProgram(problem)
            self._programs[key] = program
            return program, time.perf_counter() - began

    def intervals_for(self, task: Task) -> int:
        """Return the number of intervals of a task's mesh: by default half with obstacles, whose rows are many."""
        if self._requested_intervals is None and task.avoidance:
            return max(MIN_DEFAULT_INTERVALS, self.intervals // 2)
        return self.intervals

    def _curves(self, task: Task) -> tuple[Curve, ...]:
        jerk_counts = bool(np.isfinite(task.limits.jerk).any()) or self.objective.has_jerk
        has_friction = self.friction is not None
        return curves_for(
            self.description.n, self.objective, jerk_counts=jerk_counts, friction=has_friction
        )

    def _task(self, request: PlanRequest, points: Array) -> Task:
        description = self.description
        limits = request.limits
        arm = request.loaded(description)
        T_start = world_to_tool(description, points[0])
        parameters = tuple(
            constraint.values(description, T_start) for constraint in self.constraints
        )
        duration = request.duration
        if duration is None and not self.objective.has_time:
            duration = DEFAULT_DURATION_FACTOR * float(leg_durations(arm, limits, points).sum())
            if not duration > 0:
                raise PlanningError(
                    f"nothing limits how fast {self.objective} may be: {ADVICE_ON_LIMITS}"
                )
        avoidance = request.avoidance
        if avoidance:
            avoidance = avoidance.between(description, points[0], points[-1])
        return Task(
            description,
            arm,
            self.objective,
            points,
            request.start_velocity,
            request.goal_velocity,
            duration,
            Checker(arm, limits, self.constraints, parameters, self.friction, avoidance),
            load=request.payload.numbers if request.payload else None,
        )

    def _best(
        self,
        request: PlanRequest,
        routes: Sequence[Route],
        warm: Trajectory | None,
        work: Work,
        progress: ProgressCall | None,
    ) -> tuple[Task, PlannedMotion, tuple[BranchReport, ...]]:
        """Return the best motion of all routes with its task, and the branches' reports; count the work."""
        best: _TaskMotion | None = None
        failure: PlanningError | None = None
        reports = list[BranchReport]()
        chosen = -1
        for number, route in enumerate(routes):
            # Every motion of the route lasts at least ``bound``; for least time that decides.
            hopeless = (
                best is not None
                and self.objective.only_time
                and route.bound >= best.motion.trajectory.duration
            )
            if hopeless or (best is not None and work.is_over):
                reports.append(BranchReport(route.label, route.bound, solved=False))
                continue
            try:
                # A chosen branch; the places of a single route were checked by require_possible.
                if route.label:
                    last = len(route.points) - 1
                    for k, point in enumerate(route.points[1:], start=1):
                        require_place(
                            self.description, request, point, "goal" if k == last else f"via {k}"
                        )
                task = self._task(request, route.points)
                task, found = self._route_motion(task, warm, work, progress)
            except PlanningError as error:
                failure = failure or error
                reports.append(
                    BranchReport(route.label, float("inf"), solved=True, reason=str(error))
                )
                continue
            reports.append(BranchReport(route.label, found.trajectory.duration, solved=True))
            if best is None or found.cost < best.motion.cost:
                best = _TaskMotion(task, found)
                chosen = number
        if best is None:
            if failure is None or len(routes) == 1:
                raise failure or PlanningError("no motion found")
            raise PlanningError(
                f"none of {len(routes)} branches has a motion; the first, {routes[0].label}: {failure}"
            )
        reports_of_branches = (
            tuple(replace(report, chosen=k == chosen) for k, report in enumerate(reports))
            if len(routes) > 1
            else ()
        )
        return *best, reports_of_branches

    def _route_motion(
        self, task: Task, warm: Trajectory | None, work: Work, progress: ProgressCall | None
    ) -> tuple[Task, PlannedMotion]:
        """Return the best motion of a task, with the task whose clearance it keeps, and count the work."""
        if task.rests and task.span < RESOLUTION:
            return task, PlannedMotion.unresolved(task)
        last = len(self._curves(task)) - 1
        attempt = 0
        while True:
            program = self._counted_program(task, attempt, work)
            search = MotionSearch(
                task.without_obstacles, program, work, progress, is_last=attempt == last
            )
            finer = partial(self._counted_program, task, attempt, work, FINER)
            try:
                found = replace(search(warm), attempt=attempt)
                return motion_around(task, found, search, program, finer, warm)
            except PlanningError as error:
                if attempt < last and not work.is_over:
                    attempt += 1
                    continue
                slow = None
                if task.checker.constraints:  # which may leave the optimizer a flat objective
                    slow = PlannedMotion.slowed_straight(task, program.intervals, error)
                if slow is None:
                    raise
                return task, slow

    def _counted_program(
        self, task: Task, attempt: int, work: Work, scale: float = 1.0
    ) -> MotionProgram:
        """Return the program of a task as :meth:`program` does, and count the time for building it."""
        program, seconds = self.program(task, attempt, scale)
        work.build_seconds += seconds
        return program

    def _with_reason(
        self, error: PlanningError, request: PlanRequest, routes: Sequence[Route], work: Work
    ) -> PlanningError:
        """Return the error for a motion that was not found: a duration below that of the fastest motion, if so."""
        if work.is_over or request.duration is None or len(routes) > 1:
            return error
        quickest = Planner(
            self.description,
            "time",
            request.limits,
            self.constraints,
            MIN_DEFAULT_INTERVALS,
            self.friction or False,
        )
        try:
            task = quickest._task(replace(request, duration=None), routes[0].points)
            quick = task.without_obstacles
            program, _ = quickest.program(quick)
            least = MotionSearch(quick, program, work)().trajectory.duration
        except PlanningError:
            return error
        if least <= request.duration * (1 + DURATION_TOLERANCE):
            return error
        return PlanningError(
            f"a duration of {request.duration:.6g} s is too short: the fastest motion found"
            f"{' without the obstacles' * bool(request.avoidance)} takes {least:.6g} s"
        )

    def _coarse(self, task: Task, best: PlannedMotion, work: Work) -> tuple[int, float] | None:
        # Among obstacles a coarser mesh may lead around them on another side.
        if task.avoidance or self.intervals_for(task) <= MIN_LEG_INTERVALS:
            return None
        program, _ = self.program(task, best.attempt, scale=0.5)
        return coarser(MotionSearch(task.without_obstacles, program, work), best.trajectory)
