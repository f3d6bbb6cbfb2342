"""The planner: programs made once, solved for many motions, each certified before it is handed out."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Payload, Robot, description_of
from dhkit.description.frames import world_to_tool
from dhkit.display import repr_line
from dhkit.errors import PlanningError
from dhkit.planning.certificate import Checker
from dhkit.planning.clear import Clear, Surroundings
from dhkit.planning.constraints import Constraint
from dhkit.planning.feasibility import (
    classical,
    require_bounded,
    require_holdable,
    require_inside_limits,
    require_kept,
    require_speed,
)
from dhkit.planning.goals import Place, Route, place, routes
from dhkit.planning.guess import leg_durations
from dhkit.planning.mesh import LEAST, Curve, Mesh
from dhkit.planning.objectives import Objective, ObjectiveLike
from dhkit.planning.obstacles import Scene
from dhkit.planning.problem import Problem
from dhkit.planning.report import BranchReport, PlanReport
from dhkit.planning.search import Found, Program, Search, coarser
from dhkit.planning.solver import ProgressCall
from dhkit.planning.states import prepare
from dhkit.planning.task import FEW, Task, curve_for
from dhkit.planning.wish import Wish, checked_limits, end_velocity
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits, Trajectory
from dhkit.trajectories.timing import check_duration

EXPANDED = 400
"""Up to so many joints times intervals a program is expanded into scalars: solved twice as fast, made in ten times."""
CONVERGENCE = {Curve.CONSTANT: 1e-6, Curve.JUMPING: 1e-8, Curve.LINEAR: 1e-8, Curve.QUADRATIC: 1e-8}
"""Ipopt's tolerance: of arms of many joints, the mesh counts for more."""
USUAL = 48
"""Intervals of arms of six joints; of fewer joints more, as they cost less."""
MOST, LEAST_USUAL = 2000, 24
NUMBERS = 384
"""Joints times intervals: what arms of few joints get."""
NEARLY = 1e-3
"""By what share the fastest motion must be longer than a duration that is called too short."""
LEISURELY = 2.0
"""Where a duration is needed and none is given: times that of the fastest cubics."""
SMOOTHED = Friction(width=1e-2)
"""What a step of friction is taken as: rad/s or m/s."""


class Planner:
    """Plans motions of one arm with one objective and one set of constraints.

    Programs are made when first needed and then solved for any start, goal, limits, payload and obstacles. Calls from
    several threads take turns. Every motion that is returned was checked on a dense grid with Pinocchio.

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
        What else must be kept: ``ToolSpeed(0.5)`` and the like.
    intervals
        Of the mesh. Unless given 48 for arms of six joints and more, and more for smaller ones; half of that for
        objectives without time, and around obstacles. Finer meshes find slightly better motions in more time.
    friction
        Of the drives, as for inverse dynamics; a step is smoothed over 0.01 rad/s.

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
        if intervals is not None and (type(intervals) is not int or not LEAST <= intervals <= MOST):
            raise ValueError(f"intervals is {intervals!r}; expected a whole number from {LEAST} to {MOST}")
        constraints = (constraints,) if isinstance(constraints, Constraint) else tuple(constraints)
        for constraint in constraints:
            if not isinstance(constraint, Constraint):
                raise TypeError(f"constraints has {constraint!r}; expected ToolSpeed(...) and the like")
        self.description = description
        self.objective = Objective.of(objective)
        self.limits = checked_limits(description, limits)
        self.constraints = constraints
        usual = NUMBERS // description.n if description.n <= FEW else USUAL
        # Smooth motions need half as many: their accelerations are parabolas.
        self._given = intervals
        self.intervals = intervals or (usual if self.objective.has_time else usual // 2)
        chosen = Friction.chosen(friction)
        self.friction = SMOOTHED if chosen is not None and chosen.width == 0 else chosen
        self._programs: dict[tuple[object, ...], Program] = {}
        self._making = threading.Lock()

    def __repr__(self) -> str:
        return repr_line(
            f"Planner of {self.description.name}", said=f"least {self.objective}, {self.intervals} intervals"
        )

    def solve(
        self,
        start: ArrayLike | str,
        goal: ArrayLike | str,
        *,
        via: Sequence[ArrayLike | str] = (),
        duration: float | None = None,
        start_velocity: ArrayLike | None = None,
        goal_velocity: ArrayLike | None = None,
        limits: Limits | None = None,
        payload: Payload | None = None,
        obstacles: Scene = (),
        clearance: float = 0.01,
        self_collision: bool = False,
        warm: Trajectory | None = None,
        time_limit: float = 10.0,
        progress: ProgressCall | None = None,
        compare: bool = False,
    ) -> Trajectory:
        """Return the best motion, certified; its ``report`` says how good it is.

        Parameters
        ----------
        start
            Joint values (n,), rad and m, or the name of a configuration.
        goal
            The same, or a pose (4, 4) of the tool in the world: then all branches of inverse kinematics are tried.
        via
            Where to pass on the way, likewise, in order; when is free.
        duration
            s. Objectives without time need one: without it, they get twice what cubics along the straight path take.
        start_velocity, goal_velocity
            Shape (n,), rad/s and m/s; at rest unless given.
        limits
            In place of the planner's.
        payload
            What the tool carries.
        obstacles
            What to keep away from: ``Obstacle.box(...)`` and the like, ``Floor()``.
        clearance
            By how much, m.
        self_collision
            Whether links keep away from each other too.
        warm
            A similar motion to start from.
        time_limit
            s; after it the search ends with an error, or the best motion found so far among branches.
        progress
            Called once an iteration; an exception in it ends the search.
        compare
            Whether the report also says what classical motions and a coarser mesh would have cost.

        Raises
        ------
        PlanningError
            There is no such motion, or none was found: says what stands against it.
        ValueError, TypeError
            Arguments of another shape or type.
        """
        began = time.perf_counter()
        if not isinstance(time_limit, Real) or not time_limit > 0:
            raise ValueError(f"time_limit is {time_limit!r}; expected a positive number, s")
        description = self.description
        if payload is not None and not isinstance(payload, Payload):
            raise TypeError(f"payload is {payload!r}; expected Payload(mass, com, inertia)")
        if progress is not None and not callable(progress):
            raise TypeError(f"progress is {progress!r}; expected a function")
        if warm is not None:
            if not isinstance(warm, Trajectory):
                raise TypeError(f"warm is {type(warm).__name__}; expected a Trajectory")
            warm.require(description)
        if isinstance(via, str) or (len(via) and not isinstance(via[0], str) and np.ndim(via[0]) == 0):
            via = [via]  # one place alone
        check_duration(duration)
        names = ["start", *(f"via {k}" for k in range(1, len(via) + 1)), "goal"]
        places = [place(description, value, name) for value, name in zip((start, *via, goal), names, strict=True)]
        if places[0].q is None:
            raise ValueError("start is a pose; expected joint values: choose one of inverse kinematics' solutions")
        wish = Wish(
            checked_limits(description, self.limits if limits is None else limits),
            duration,
            *(end_velocity(description, v, name) for v, name in ((start_velocity, "start"), (goal_velocity, "goal"))),
            payload,
            Surroundings.of(obstacles, clearance, self_collision),
        )
        for spot in places:
            if spot.q is not None:
                require_inside_limits(description, wish.limits, spot.q, spot.name)
        ways = routes(description, wish.limits, places)
        self._require(wish, places, ways)
        deadline = began + time_limit
        try:
            found, branches, seconds, counts = self._best(wish, ways, warm, deadline, progress)
        except PlanningError as error:
            raise self._explained(error, wish, ways, deadline) from None
        task, best = found
        report = PlanReport(
            objective=str(self.objective),
            cost=best.cost,
            duration=best.trajectory.duration,
            certificate=best.certificate,
            joints=tuple(joint.name for joint in description.joints),
            intervals=len(best.trajectory.breaks) - 1,
            iterations=counts[0],
            solves=counts[1],
            build_seconds=seconds,
            solve_seconds=time.perf_counter() - began - seconds,
            slow_down=best.slow_down,
            tightened=best.tightened,
            branches=branches,
            unlimited=wish.limits.unlimited,
        )
        if compare:
            report = replace(report, classical=classical(task), coarse=self._coarse(task, best, deadline))
        return replace(best.trajectory, report=report, payload=payload, friction=self.friction)

    # Programs

    def program(self, task: Task, intervals: int | None = None) -> tuple[Program, float]:
        """Return the program for a task, and the seconds that it took to make just now."""
        intervals = self.intervals_for(task) if intervals is None else intervals
        legs, limits, slots = len(task.points) - 1, task.limits, task.surroundings.slots
        jerk_limited = bool(np.isfinite(limits.jerk).any())
        with_torque = bool(np.isfinite(limits.torque).any())
        key = (legs, task.is_loaded, slots, jerk_limited, with_torque, intervals)
        with self._making:
            if key in self._programs:
                return self._programs[key], 0.0
            began = time.perf_counter()
            prepare(self.description)
            curve = curve_for(self.description.n, self.objective.has_time, jerk_limited or self.objective.has_jerk)
            problem = Problem(
                self.description,
                self.objective,
                (*self.constraints, Clear(slots)) if task.surroundings else self.constraints,
                limits,
                Mesh.of(intervals, legs, curve),
                friction=self.friction,
                payload=task.is_loaded,
                jerk_limited=jerk_limited,
            )
            expand = self.description.n * problem.mesh.intervals <= EXPANDED
            made = Program.of(problem, CONVERGENCE[curve], expand=expand)
            self._programs[key] = made
            return made, time.perf_counter() - began

    def intervals_for(self, task: Task) -> int:
        """Return the intervals of a task's mesh: half where every knot is held against obstacles, unless given."""
        if self._given is None and task.surroundings:
            return max(LEAST_USUAL, self.intervals // 2)
        return self.intervals

    # One motion

    def _require(self, wish: Wish, places: Sequence[Place], ways: Sequence[Route]) -> None:
        """Refuse what no solver could find, of places that leave no choice."""
        description, limits = self.description, wish.limits
        loaded = wish.loaded(description)
        require_speed(description, limits, wish.start_velocity, "start")
        require_speed(description, limits, wish.goal_velocity, "goal")
        for spot in places:
            if spot.q is None:
                continue
            if wish.rests_at(spot.name):
                require_holdable(loaded, limits, spot.q, spot.name)
            if wish.surroundings:
                wish.surroundings.require(description, spot.q, spot.name)
        resting = [constraint for constraint in self.constraints if not constraint.moving]
        T_start = world_to_tool(description, ways[0].points[0])
        for spot in places:
            require_kept(description, resting, T_start, spot)
        if wish.duration is not None and wish.duration < ways[0].bound:
            least = f"the speed limits alone ask for {ways[0].bound:.6g} s"
            raise PlanningError(f"a duration of {wish.duration:.6g} s is too short: {least}")
        moves = np.max([np.ptp(way.points, axis=0) for way in ways], axis=0) > 0
        if not moves.any() and wish.rests_at("start") and wish.rests_at("goal"):
            raise PlanningError("start and goal are the same configuration")
        require_bounded(description, limits, self.objective, moves)

    def _task(self, wish: Wish, points: Array) -> Task:
        description, limits = self.description, wish.limits
        loaded = wish.loaded(description)
        T_start = world_to_tool(description, points[0])
        parameters = tuple(constraint.values(description, T_start) for constraint in self.constraints)
        duration = wish.duration
        if duration is None and not self.objective.has_time:
            duration = LEISURELY * float(leg_durations(loaded, limits, points).sum())
            if not duration > 0:
                raise PlanningError(f"nothing limits how fast {self.objective} may be: give a duration, or limits")
        checker = Checker(loaded, limits, self.constraints, parameters, self.friction, wish.surroundings)
        return Task(
            description,
            loaded,
            points,
            wish.start_velocity,
            wish.goal_velocity,
            duration,
            limits,
            checker,
            load=wish.payload.numbers if wish.payload else None,
            parameters=parameters,
            friction=self.friction,
            surroundings=wish.surroundings,
        )

    def _best(
        self,
        wish: Wish,
        ways: Sequence[Route],
        warm: Trajectory | None,
        deadline: float,
        progress: ProgressCall | None,
    ) -> tuple[tuple[Task, Found], tuple[BranchReport, ...], float, tuple[int, int]]:
        """Return the best motion along any way, what the others cost, seconds of making, iterations and solves."""
        best: tuple[Task, Found] | None = None
        failure: PlanningError | None = None
        reports: list[BranchReport] = []
        seconds, iterations, solves, chosen = 0.0, 0, 0, -1
        for number, way in enumerate(ways):
            hopeless = best is not None and self.objective.only_time and way.bound >= best[1].trajectory.duration
            late = best is not None and time.perf_counter() > deadline
            if hopeless or late:
                reports.append(BranchReport(way.label, way.bound, solved=False))
                continue
            try:
                if way.label:  # a branch that was chosen here: of others _require has seen the ends
                    self._require_ends(wish, way.points)
                task = self._task(wish, way.points)
                program, made = self.program(task)
                seconds += made
                search = Search(task, program, deadline + seconds, progress)
                try:
                    found = search(warm)
                finally:
                    iterations, solves = iterations + search.iterations, solves + search.solves
            except PlanningError as error:
                failure = failure or error
                reports.append(BranchReport(way.label, float("inf"), solved=True, reason=str(error)))
                continue
            reports.append(BranchReport(way.label, found.trajectory.duration, solved=True))
            if best is None or found.cost < best[1].cost:
                best, chosen = (task, found), number
        if best is None:
            if failure is None or len(ways) == 1:
                raise failure or PlanningError("no motion found")
            raise PlanningError(f"none of {len(ways)} branches has a motion; the first, {ways[0].label}: {failure}")
        told = tuple(replace(report, chosen=k == chosen) for k, report in enumerate(reports)) if len(ways) > 1 else ()
        return best, told, seconds, (iterations, solves)

    def _explained(self, error: PlanningError, wish: Wish, ways: Sequence[Route], deadline: float) -> PlanningError:
        """Return why a motion of a given duration was not found: because there is no faster one, where that is it."""
        late = time.perf_counter() > deadline
        if late or wish.duration is None or len(ways) > 1 or wish.surroundings:
            return error
        quickest = Planner(self.description, "time", wish.limits, self.constraints, LEAST_USUAL, self.friction or False)
        try:
            program, made = quickest.program(quick := quickest._task(replace(wish, duration=None), ways[0].points))
            least = Search(quick, program, deadline + made)().trajectory.duration
        except PlanningError:
            return error
        if least <= wish.duration * (1 + NEARLY):
            return error
        fastest = f"the fastest motion found takes {least:.6g} s"
        return PlanningError(f"a duration of {wish.duration:.6g} s is too short: {fastest}")

    def _coarse(self, task: Task, best: Found, deadline: float) -> tuple[int, float] | None:
        half = max(LEAST, self.intervals_for(task) // 2)
        if half == self.intervals_for(task):
            return None
        program, made = self.program(task, half)
        return coarser(Search(task, program, deadline + made), best.trajectory)

    def _require_ends(self, wish: Wish, points: Array) -> None:
        loaded = wish.loaded(self.description)
        if wish.rests_at("goal"):
            require_holdable(loaded, wish.limits, points[-1], "goal")
        if wish.surroundings:
            for k, point in enumerate(points[1:], start=1):
                wish.surroundings.require(self.description, point, "goal" if k == len(points) - 1 else f"via {k}")
