"""The program of motions between configurations: its guesses, bounds, and trajectories."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from dhkit.description import Array
from dhkit.planning.criteria import Limit, LoadedArm, Objective, States, cost_of, size_of
from dhkit.planning.obstacles import PlaneRow
from dhkit.planning.program.blocks import Indices
from dhkit.planning.program.mesh import Curve, Knots, Mesh, assemble_trajectory, knots_along
from dhkit.planning.program.problem import USUAL_MOVE, Problem
from dhkit.planning.program.program import Arguments, Margins, Program, Starts, Task
from dhkit.planning.program.solver import Solver
from dhkit.trajectories import Limits, Trajectory

SAMPLES = 17
"""Number of states of a leg from which its duration is estimated."""
MIN_TORQUE_SHARE = 0.05
"""Smallest share of a torque limit assumed free for acceleration, where gravity needs nearly all of it."""
DETOUR_SHARE = 0.7
"""Largest deviation of a detour, as a share of half a joint's range."""
DETOUR_DURATION_FACTOR = 2.0
"""Factor of the duration of a detour over that of the straight path."""
CONVERGENCE = {Curve.CONSTANT: 1e-6, Curve.JUMPING: 1e-8, Curve.LINEAR: 1e-8, Curve.QUADRATIC: 1e-8}
"""Ipopt's tolerance for each curve: with constant accelerations, the error of the mesh is larger than 1e-6."""
SMALL_STEP = {Curve.CONSTANT: 1e-3, Curve.JUMPING: 1e-5, Curve.LINEAR: 1e-3, Curve.QUADRATIC: 1e-3}
"""Relative slow-down up to which a solution is slowed down; beyond it, exceeded limits are tightened."""
MAX_SMALL_JOINTS = 3
"""Largest number of joints of arms whose programs are small."""
RESTART_FACTORS = (2.5, 0.6)
"""Factors of the guessed durations for further starts, if the first one fails."""
DETOURS = 3
"""Number of detours from which programs are solved too: those of arms of two or three joints are small and have several
local optima; with a given duration they are what is tried if the straight path fails."""
MIN_LEG_SHARE = 1e-4
"""Shortest duration of a leg, as a share of the guessed duration of the motion."""
STILL_DURATION = 1e-3
"""Guessed duration (s) of a motion that nothing limits."""
MAX_GUESSED_DURATION, GUESSED_DURATIONS = 100.0, 24
"""Longest duration (s) and number of durations that are compared for the initial guess of mixed objectives."""
MIN_COST_SCALE = 1e-9


def leg_durations(arm: LoadedArm, limits: Limits, points: Array) -> Array:
    """Return estimates of the durations of legs between configurations, from rest to rest, shape (legs,), s.

    Each is the least duration of a cubic, with the torques that gravity leaves at each state; 0 without limits.
    """
    return np.array([_leg(arm, limits, a, b) for a, b in pairwise(points)])


def _leg(arm: LoadedArm, limits: Limits, start: Array, goal: Array) -> float:
    step = goal - start
    x = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    q = start + step * x * x * (3 - 2 * x)
    qd = step * 6 * x * (1 - x)
    qdd = step * (6 - 12 * x)
    found = [np.max(np.abs(qd) / limits.velocity), np.sqrt(np.max(np.abs(qdd) / limits.acceleration))]
    found.append(np.cbrt(np.max(12 * np.abs(step) / limits.jerk)))
    if np.isfinite(limits.torque).any():
        states = States(arm, x[:, 0], q, qd, qdd)
        room = np.maximum(limits.torque - np.abs(states.gravity_torque), MIN_TORQUE_SHARE * limits.torque)
        found.append(np.sqrt(np.max(np.abs(states.tau - states.gravity_torque) / room)))
    return float(max(found))


def straight_motion(task: Task, durations: Array) -> Trajectory:
    """Return cubics between a task's configurations, at rest in between; durations of legs (legs,), s."""
    velocities = np.zeros_like(task.points)
    velocities[0], velocities[-1] = task.start_velocity, task.goal_velocity
    return Trajectory.from_samples(task.arm, np.concatenate([[0.0], np.cumsum(durations)]), task.points, velocities)


def straight_knots(task: Task, mesh: Mesh, durations: Array) -> Knots:
    """Return :func:`straight_motion` on a mesh."""
    return knots_along(straight_motion(task, durations), mesh, np.cumsum(durations))


def usual_accelerations(task: Task, guess: Knots) -> Array:
    """Return the scales of accelerations, shape (n,), rad/s^2 and m/s^2.

    The acceleration that the torque limit gives a joint alone, or its limit of acceleration; where neither is limited,
    twice the largest of the initial guess.
    """
    limits = task.limits
    n = task.arm.n
    largest = np.maximum(2 * np.abs(guess.qdd).max(axis=0), 1e-3)
    usual = np.where(np.isfinite(limits.acceleration), limits.acceleration, np.inf)
    if np.isfinite(limits.torque).any():
        q = np.tile((task.points[0] + task.points[-1]) / 2, (n, 1))
        pushed = States(task.loaded, np.zeros(n), q, np.zeros((n, n)), np.eye(n))
        inertia = np.diagonal(pushed.tau - pushed.gravity_torque)
        usual = np.minimum(usual, limits.torque / np.maximum(inertia, 1e-12))
    return np.where(np.isfinite(usual), usual, np.maximum(largest, 0.05 * largest.max()))


def detour(task: Task, mesh: Mesh, durations: Array, seed: int) -> Knots:
    """Return a guess through random configurations, one halfway along each leg; durations (legs,), s."""
    rng = np.random.default_rng(seed)
    limits = task.limits
    points = task.points
    reach = np.where(task.arm.numbers.prismatic, max(task.arm.reach, 1e-3), np.pi)
    half = np.where(np.isfinite(limits.upper - limits.lower), (limits.upper - limits.lower) / 2, reach)
    halfway = (points[1:] + points[:-1]) / 2 + DETOUR_SHARE * half * rng.uniform(-1, 1, (len(durations), task.arm.n))
    rows = np.empty((2 * len(durations) + 1, task.arm.n))
    rows[0::2] = points
    rows[1::2] = np.clip(halfway, limits.lower, limits.upper)
    velocities = np.zeros_like(rows)
    velocities[0], velocities[-1] = task.start_velocity, task.goal_velocity
    times = np.concatenate(
        [[0.0], np.cumsum(np.repeat(durations * (1.0 if task.duration else DETOUR_DURATION_FACTOR) / 2, 2))]
    )
    return knots_along(Trajectory.from_samples(task.arm, times, rows, velocities), mesh, times[2::2])


class MotionProgram(Program[Knots]):
    """A problem with its solver.

    Parameters
    ----------
    problem
        The problem.
    planes
        Planes on one side of which points of links stay.
    """

    def __init__(self, problem: Problem, planes: Sequence[PlaneRow] = ()) -> None:
        self.problem = problem
        self.mesh = problem.mesh
        self.blocks, self._planes = problem.apart(planes)
        self.solver = Solver(self.blocks, len(self.mesh.legs), tolerance=CONVERGENCE[self.mesh.curve])
        self.intervals = self.mesh.intervals
        self.small_step = SMALL_STEP[self.mesh.curve]

    def apart(self, planes: Sequence[PlaneRow]) -> MotionProgram:
        """Return the same program with other planes."""
        return MotionProgram(self.problem, planes)

    # Guesses

    def starts(self, task: Task, warm: Trajectory | None) -> Starts[Knots]:
        """Return guesses: a given motion, straight paths, and detours, which are compared for arms with few joints."""
        # In small moves gravity and inertia hardly change, so that detours do not pay.
        is_small_arm = 1 < task.arm.n <= MAX_SMALL_JOINTS
        is_compared = is_small_arm and task.objective.has_time and task.span >= USUAL_MOVE
        durations = self.guessed_durations(task)
        guesses: list[Callable[[], Knots]] = []
        if warm is not None and len(self.mesh.legs) == 1:
            guesses.append(partial(knots_along, warm, self.mesh, np.array([warm.duration])))
        guesses.append(partial(straight_knots, task, self.mesh, durations))
        if is_compared or task.duration is not None:
            guesses += [partial(detour, task, self.mesh, durations, seed) for seed in range(DETOURS)]
        compared = len(guesses) if is_compared else 0
        if task.duration is None:
            guesses += [partial(straight_knots, task, self.mesh, durations * factor) for factor in RESTART_FACTORS]
        return Starts(guesses, compared)

    def again(self, guess: Knots, found: Knots) -> Knots:
        """Return the first guess: Ipopt converges more slowly from the ends of its bounds, where solutions are."""
        return guess

    def guessed_durations(self, task: Task) -> Array:
        """Return durations of the legs for an initial guess, shape (legs,), s."""
        durations = leg_durations(task.loaded, task.limits, task.points)
        durations = np.maximum(durations, 10 * MIN_LEG_SHARE * float(durations.sum()) or STILL_DURATION)
        if task.duration is not None:
            durations *= task.duration / durations.sum()
        else:
            if task.rests and any(constraint.moving for constraint in task.checker.constraints):
                durations *= self._slowness(task, durations)
            if not task.objective.only_time:
                durations *= self._best_factor(task, durations)
        return durations

    def _slowness(self, task: Task, durations: Array) -> float:
        """Return how much slower the straight path must be for constraints, which may be far below the limits."""
        slower = task.checker.slow_down(task.checker.states(straight_motion(task, durations)))
        return slower if np.isfinite(slower) else 1.0

    def _best_factor(self, task: Task, durations: Array) -> float:
        """Return the factor of the durations with which the straight path costs least."""
        factors = np.geomspace(1.0, MAX_GUESSED_DURATION / max(float(durations.sum()), 1e-6), GUESSED_DURATIONS)
        motions = (self._assembled(task, straight_knots(task, self.mesh, durations * factor)) for factor in factors)
        costs = [cost_of(task.objective, motion, task.loaded, task.friction) for motion in motions]
        return float(factors[int(np.argmin(costs))])

    def _assembled(self, task: Task, knots: Knots) -> Trajectory:
        return assemble_trajectory(task.arm, self.mesh, knots, fixed_ends=False)

    # Arguments

    def arguments(self, task: Task, guess: Knots, margins: Margins) -> Arguments:
        """Return the arguments of a solution."""
        problem = self.problem
        each = [parameters for _, parameters in task.checker.every]
        cost = self._cost_scale(task, guess)
        usual = usual_accelerations(task, guess)
        return Arguments(
            problem.vector(guess, task.load),
            np.append(problem.parameters(task.load, each, 1 / cost, usual), self._planes),
            self._bounds(task, margins, MIN_LEG_SHARE * float(guess.durations.sum())),
            problem.scaling(self.blocks, guess, cost),
        )

    def _cost_scale(self, task: Task, guess: Knots) -> float:
        """Return the cost of a guess, which scales the objective."""
        if task.objective.only_time:
            return float(guess.durations.sum())
        cost = size_of(task.objective, self._assembled(task, guess), task.loaded, task.friction)
        return max(cost, MIN_COST_SCALE)

    def _bounds(self, task: Task, margins: Margins, shortest_leg: float) -> tuple[Array, Array]:
        """Return the lower and upper bounds of the variables, shape (variables,) each, SI units.

        Parameters
        ----------
        shortest_leg
            Shortest duration of a leg, s.
        """
        limits = task.limits
        mesh = self.mesh
        at = self.problem.variables
        n = task.arm.n
        low = np.full(at.count, -np.inf)
        high = np.full(at.count, np.inf)
        position, given = task.checker.every[Limit.POSITION]

        def set_bounds(indices: Indices, lower: Array, upper: Array) -> None:
            low[indices] = lower
            high[indices] = upper

        lower, upper = position.bounds(given, margins.at_knots(Limit.POSITION, n))
        set_bounds(at.q, lower.T, upper.T)
        if at.middles[0].size:
            lower, upper = position.bounds(given, margins.of(Limit.POSITION, n))
            set_bounds(at.middles[0], lower.T, upper.T)
        speed = limits.velocity[:, None] * (1 - margins.at_knots(Limit.VELOCITY, n).T)
        set_bounds(at.qd, -speed, speed)
        set_bounds(at.qdd, -limits.acceleration[:, None], limits.acceleration[:, None])
        for k, point in zip((0, *mesh.ends), task.points, strict=True):
            set_bounds(at.q[:, k], point, point)
        for k, velocity in ((0, task.start_velocity), (-1, task.goal_velocity)):
            set_bounds(at.qd[:, k], velocity, velocity)
            if self.problem.jerk_counts:
                set_bounds(at.qdd[:, k], np.zeros(n), np.zeros(n))
        low[at.durations] = shortest_leg
        low[at.positive_parts] = 0.0
        if task.duration is not None and len(mesh.legs) == 1:
            low[at.durations] = high[at.durations] = task.duration
        return low, high

    # Solutions

    def iterate(self, x: Array) -> Knots:
        """Return the motion of variables, shape (variables,), SI units."""
        return self.problem.knots(x)

    def trajectory(self, task: Task, found: Knots) -> Trajectory:
        """Return a solution as a trajectory."""
        return assemble_trajectory(task.arm, self.mesh, found, fixed_ends=self.problem.jerk_counts)

    def interval_of(self, trajectory: Trajectory, found: Knots) -> Indices:
        """Return the interval of the mesh that each piece lies in, shape (pieces,): its own."""
        return np.arange(self.intervals)

    def place(self, interval: float) -> str:
        """Return a place of the motion as text."""
        return f"{100 * min(interval / max(self.intervals - 1, 1), 1.0):.0f} % of the way"

    def knots_of(self, trajectory: Trajectory) -> Knots:
        """Return a motion on the program's mesh as a guess."""
        return knots_along(trajectory, self.mesh, trajectory.breaks[list(self.mesh.ends)])


def curves_for(n: int, objective: Objective, *, jerk_counts: bool, friction: bool) -> tuple[Curve, ...]:
    """Return the curves of accelerations that are tried in turn.

    Torques of time-optimal motions jump, and so do those of least energy without losses in windings and, with friction,
    where a joint turns back. Constant accelerations need twice as many intervals as linear ones, but are solved faster
    for arms of many joints. Smooth objectives are nearest to their optimum with parabolas; these exceed limits between
    their points where torques nearly jump, as in motions in little more than the least time, for which the second
    curve serves.
    """
    if objective.has_time:
        if jerk_counts:
            return (Curve.LINEAR,)
        return (Curve.JUMPING if n <= MAX_SMALL_JOINTS else Curve.CONSTANT,)
    if jerk_counts:
        return (Curve.QUADRATIC, Curve.LINEAR)
    return (Curve.QUADRATIC, Curve.CONSTANT) if objective.is_smooth and not friction else (Curve.CONSTANT,)
