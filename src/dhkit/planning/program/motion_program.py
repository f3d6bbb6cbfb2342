"""The nonlinear program (NLP) of motions between configurations: its guesses, bounds, and trajectories."""

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
from dhkit.planning.program.optimization_program import (
    Arguments,
    Margins,
    OptimizationProgram,
    Starts,
    Task,
)
from dhkit.planning.program.problem import USUAL_MOVE, Problem
from dhkit.planning.program.solver import Solver
from dhkit.trajectories import Limits, Trajectory

SAMPLES = 17
"""Number of states of a leg from which its duration is estimated."""
MIN_TORQUE_SHARE = 0.05
"""Smallest share of a torque limit assumed free for acceleration, where gravity needs nearly all of it."""
DETOUR_SHARE = 0.7
"""Largest deviation of a detour, as a share of half a joint's range."""
MIN_STROKE = 1e-3
"""Half the range, m, of a prismatic joint without limits on an arm without lengths."""
DETOUR_DURATION_FACTOR = 2.0
"""Factor of the duration of a detour over that of the straight path."""
CONVERGENCE = {Curve.CONSTANT: 1e-6, Curve.JUMPING: 1e-8, Curve.LINEAR: 1e-8, Curve.QUADRATIC: 1e-8}
"""Ipopt's tolerance for each curve: with constant accelerations, the error of the mesh is larger than 1e-6."""
SMALL_STEP = {Curve.CONSTANT: 1e-3, Curve.JUMPING: 1e-5, Curve.LINEAR: 1e-3, Curve.QUADRATIC: 1e-3}
"""Largest relative excess of a solution over its limits, as a slow-down minus 1, that is removed by slowing the motion
down; a larger one is removed by tightening the exceeded limits and solving again. Jumping accelerations keep limits
almost exactly at every instant."""
SMALL_ARM_JOINTS = 3
"""Largest number of joints of arms whose programs are small."""
RESTART_FACTORS = (2.5, 0.6)
"""Factors of the guessed durations for further starts, if the first one fails."""
DETOURS = 3
"""Number of detours among the initial guesses; see :meth:`MotionProgram.starts`."""
MIN_LEG_SHARE = 1e-4
"""Shortest duration of a leg, as a share of the guessed duration of the motion."""
STILL_DURATION = 1e-3
"""Guessed duration (s) of a motion that nothing limits."""
MAX_GUESSED_DURATION = 100.0
"""Longest duration, s, that is compared for the initial guess of a mixed objective."""
GUESSED_DURATIONS = 24
"""Number of durations that are compared for the initial guess of a mixed objective."""
MIN_ACCELERATION_SCALE = 1e-3
"""Smallest scale of an acceleration, rad/s^2 and m/s^2, of a joint that hardly moves."""
MIN_ACCELERATION_SHARE = 0.05
"""Smallest ratio of a joint's scale to that of the fastest joint."""
MIN_INERTIA = 1e-12
"""Smallest inertia, kg m^2 and kg, that a torque limit is divided by."""
MIN_COST_SCALE = 1e-9
"""Smallest scale of an objective, in its unit: the cost of a guess may be 0, and the objective is divided by it."""


def leg_durations(arm: LoadedArm, limits: Limits, points: Array) -> Array:
    """Return estimates of the durations of legs between configurations, from rest to rest, shape (legs,), s.

    Each is the least duration of a cubic, with the torques that gravity leaves in SAMPLES states; 0 without limits.
    Torques that are linear in the rates (friction) are left out.
    """
    return np.array([_leg(arm, limits, a, b) for a, b in pairwise(points)])


def _leg(arm: LoadedArm, limits: Limits, start: Array, goal: Array) -> float:
    """Return the estimate of one leg's duration, s.

    The cubic from rest to rest, with x = t / T, is q = start + step (3 x^2 - 2 x^3). Its derivatives by x are those by
    t for T = 1; in a duration T they are divided by T, T^2 and T^3, and torques beyond gravity's by T^2. Each limit
    thus gives the shortest T.
    """
    step = goal - start
    x = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    q = start + step * x * x * (3 - 2 * x)
    qd = step * 6 * x * (1 - x)
    qdd = step * (6 - 12 * x)
    jerk = 12 * np.abs(step)

    # |q'| / T <= v,    |q''| / T^2 <= a,    |q'''| / T^3 <= j
    durations = [
        np.max(np.abs(qd) / limits.velocity),
        np.sqrt(np.max(np.abs(qdd) / limits.acceleration)),
        np.cbrt(np.max(jerk / limits.jerk)),
    ]
    if np.isfinite(limits.torque).any():
        states = States(arm, times=x[:, 0], q=q, qd=qd, qdd=qdd)
        g = states.gravity_torque

        # |tau - g| / T^2 <= tau_max - |g|, with tau at T = 1.
        room = np.maximum(limits.torque - np.abs(g), MIN_TORQUE_SHARE * limits.torque)
        durations.append(np.sqrt(np.max(np.abs(states.tau - g) / room)))
    return float(max(durations))


def straight_motion(task: Task, durations: Array) -> Trajectory:
    """Return cubics between a task's configurations, at rest in between; durations of legs (legs,), s."""
    velocities = np.zeros_like(task.points)
    velocities[0] = task.start_velocity
    velocities[-1] = task.goal_velocity
    times = np.concatenate([[0.0], np.cumsum(durations)])
    return Trajectory.from_samples(task.arm, times, task.points, velocities)


def straight_knots(task: Task, mesh: Mesh, durations: Array) -> Knots:
    """Return :func:`straight_motion` on a mesh."""
    return knots_along(straight_motion(task, durations), mesh, np.cumsum(durations))


def acceleration_scales(task: Task, guess: Knots) -> Array:
    """Return the scales of accelerations, shape (n,), rad/s^2 and m/s^2.

    A scale is the acceleration that the torque limit gives a joint alone, tau_max / M_ii, or its limit of acceleration,
    whichever is less; where neither is limited, twice the largest of the initial guess, and at least
    MIN_ACCELERATION_SCALE and MIN_ACCELERATION_SHARE of the largest scale of the joints.
    """
    limits = task.limits
    n = task.arm.n
    scales = limits.acceleration
    if np.isfinite(limits.torque).any():
        # M at rest halfway between start and goal: with unit acceleration of joint i, tau - g is column i of M.
        q = np.tile((task.points[0] + task.points[-1]) / 2, (n, 1))
        pushed = States(task.loaded, times=np.zeros(n), q=q, qd=np.zeros((n, n)), qdd=np.eye(n))
        M_ii = np.diagonal(pushed.tau - pushed.gravity_torque)
        scales = np.minimum(scales, limits.torque / np.maximum(M_ii, MIN_INERTIA))

    of_guess = np.maximum(2 * np.abs(guess.qdd).max(axis=0), MIN_ACCELERATION_SCALE)
    of_guess = np.maximum(of_guess, MIN_ACCELERATION_SHARE * of_guess.max())
    return np.where(np.isfinite(scales), scales, of_guess)


def detour(task: Task, mesh: Mesh, durations: Array, seed: int) -> Knots:
    """Return a guess through random configurations, one halfway along each leg; durations (legs,), s."""
    rng = np.random.default_rng(seed)
    limits = task.limits
    legs = len(durations)
    half_turn_or_reach = np.where(
        task.arm.numbers.prismatic, max(task.arm.reach, MIN_STROKE), np.pi
    )
    width = limits.upper - limits.lower
    half_range = np.where(np.isfinite(width), width / 2, half_turn_or_reach)

    middles = (task.points[1:] + task.points[:-1]) / 2
    halfway = middles + DETOUR_SHARE * half_range * rng.uniform(-1, 1, (legs, task.arm.n))
    q = np.empty((2 * legs + 1, task.arm.n))
    q[0::2] = task.points
    q[1::2] = np.clip(halfway, limits.lower, limits.upper)
    qd = np.zeros_like(q)
    qd[0] = task.start_velocity
    qd[-1] = task.goal_velocity

    # Each leg in two halves of equal duration.
    factor = DETOUR_DURATION_FACTOR if task.duration is None else 1.0
    halves = np.repeat(durations * factor / 2, 2)
    times = np.concatenate([[0.0], np.cumsum(halves)])
    return knots_along(Trajectory.from_samples(task.arm, times, q, qd), mesh, times[2::2])


class MotionProgram(OptimizationProgram[Knots]):
    """The NLP of motions on one mesh, with the planes that separate links from obstacles, and its solver.

    Parameters
    ----------
    problem
        Variables, cost and constraints on the mesh.
    planes
        Separating planes, each a row: points of a link stay on the side that its normal points to.
    """

    def __init__(self, problem: Problem, planes: Sequence[PlaneRow] = ()) -> None:
        self.problem = problem
        self.mesh = problem.mesh
        self.blocks, self._planes = problem.with_planes(planes)
        self.solver = Solver(
            self.blocks, len(self.mesh.legs), tolerance=CONVERGENCE[self.mesh.curve]
        )
        self.intervals = self.mesh.intervals
        self.small_step = SMALL_STEP[self.mesh.curve]

    def with_planes(self, planes: Sequence[PlaneRow]) -> MotionProgram:
        """Return the same program with other planes."""
        return MotionProgram(self.problem, planes)

    # Guesses

    def starts(self, task: Task, warm: Trajectory | None) -> Starts[Knots]:
        """Return guesses in the order in which they are tried, and how many of them are all solved and compared.

        Programs of arms of two or three joints are small and have several local optima: their straight path and detours
        are compared. With a given duration, detours are tried if the straight path fails, and without one, straight
        paths of other durations.
        """
        # A single joint has one path. In small moves gravity and inertia hardly change, so that detours do not pay.
        has_detours = 1 < task.arm.n <= SMALL_ARM_JOINTS
        is_compared = has_detours and task.objective.has_time and task.span >= USUAL_MOVE
        durations = self.guessed_durations(task)
        guesses: list[Callable[[], Knots]] = []
        # The times of via points in ``warm`` are not known.
        if warm is not None and len(self.mesh.legs) == 1:
            guesses.append(partial(knots_along, warm, self.mesh, np.array([warm.duration])))
        guesses.append(partial(straight_knots, task, self.mesh, durations))
        if is_compared or task.duration is not None:
            guesses += [
                partial(detour, task, self.mesh, durations, seed) for seed in range(DETOURS)
            ]
        number_compared = len(guesses) if is_compared else 0
        if task.duration is None:
            guesses += [
                partial(straight_knots, task, self.mesh, durations * factor)
                for factor in RESTART_FACTORS
            ]
        return Starts(guesses, number_compared)

    def next_guess(self, guess: Knots, found: Knots) -> Knots:
        """Return the first guess: Ipopt converges more slowly from the ends of its bounds, where solutions are."""
        return guess

    def guessed_durations(self, task: Task) -> Array:
        """Return durations of the legs for an initial guess, shape (legs,), s."""
        durations = leg_durations(task.loaded, task.limits, task.points)
        total = float(durations.sum())
        # Ten times the lower bound of a leg, so that the guess lies well inside its bounds.
        shortest = 10 * MIN_LEG_SHARE * total if total > 0 else STILL_DURATION
        durations = np.maximum(durations, shortest)
        if task.duration is not None:
            durations *= task.duration / durations.sum()
            return durations
        if task.rests and any(constraint.moving for constraint in task.checker.constraints):
            durations *= self._slowness(task, durations)
        if not task.objective.only_time:
            durations *= self._best_factor(task, durations)
        return durations

    def _slowness(self, task: Task, durations: Array) -> float:
        """Return the factor of the durations that the constraints ask of the straight path."""
        c = task.checker.slow_down(task.checker.states(straight_motion(task, durations)))
        return c if np.isfinite(c) else 1.0

    def _best_factor(self, task: Task, durations: Array) -> float:
        """Return the factor, at least 1, of the durations with which the straight path costs least."""
        largest = MAX_GUESSED_DURATION / max(float(durations.sum()), 1e-6)
        factors = np.geomspace(1.0, max(largest, 1.0), GUESSED_DURATIONS)
        motions = (
            self._assembled(task, straight_knots(task, self.mesh, durations * factor))
            for factor in factors
        )
        costs = [cost_of(task.objective, motion, task.loaded, task.friction) for motion in motions]
        return float(factors[int(np.argmin(costs))])

    def _assembled(self, task: Task, knots: Knots) -> Trajectory:
        return assemble_trajectory(task.arm, self.mesh, knots, fixed_ends=False)

    # Arguments

    def arguments(self, task: Task, guess: Knots, margins: Margins) -> Arguments:
        """Return the inputs of the solver for a guess."""
        problem = self.problem
        constraint_parameters = [parameters for _, parameters in task.checker.every]
        cost = self._cost_scale(task, guess)
        accelerations = acceleration_scales(task, guess)
        parameters = problem.parameters(task.load, constraint_parameters, 1 / cost, accelerations)
        shortest_leg = MIN_LEG_SHARE * float(guess.durations.sum())
        return Arguments(
            problem.vector(guess, task.load),
            np.append(parameters, self._planes),
            self._bounds(task, margins, shortest_leg),
            problem.scaling(self.blocks, guess, cost),
        )

    def _cost_scale(self, task: Task, guess: Knots) -> float:
        """Return the magnitude of a guess's cost, which scales the objective."""
        if task.objective.only_time:
            return float(guess.durations.sum())
        cost = size_of(task.objective, self._assembled(task, guess), task.loaded, task.friction)
        return max(cost, MIN_COST_SCALE)

    def _bounds(self, task: Task, margins: Margins, shortest_leg: float) -> tuple[Array, Array]:
        """Return the lower and upper bounds of the variables, shape (variables,) each, SI units.

        ``margins`` tighten limits that a solution exceeded between knots; ``shortest_leg`` is in s.
        """
        limits = task.limits
        mesh = self.mesh
        index = self.problem.variables
        n = task.arm.n
        low = np.full(index.count, -np.inf)
        high = np.full(index.count, np.inf)

        def set_bounds(indices: Indices, lower: Array | float, upper: Array | float) -> None:
            low[indices] = lower
            high[indices] = upper

        # The joint limits; those of positions and velocities less their margins.
        position, limit_values = task.checker.every[Limit.POSITION]
        lower, upper = position.bounds(limit_values, margins.at_knots(Limit.POSITION, n))
        set_bounds(index.q, lower.T, upper.T)
        if index.middles.q.size:
            lower, upper = position.bounds(limit_values, margins.of(Limit.POSITION, n))
            set_bounds(index.middles.q, lower.T, upper.T)
        speed = limits.velocity[:, None] * (1 - margins.at_knots(Limit.VELOCITY, n).T)
        set_bounds(index.qd, -speed, speed)
        set_bounds(index.qdd, -limits.acceleration[:, None], limits.acceleration[:, None])

        # The given configurations at the ends of legs, and the states at the start and the goal.
        for k, point in zip((0, *mesh.ends), task.points, strict=True):
            set_bounds(index.q[:, k], point, point)
        for k, velocity in ((0, task.start_velocity), (-1, task.goal_velocity)):
            set_bounds(index.qd[:, k], velocity, velocity)
            if self.problem.jerk_counts:
                set_bounds(index.qdd[:, k], np.zeros(n), np.zeros(n))

        low[index.durations] = shortest_leg
        low[index.positive_parts] = 0.0
        if task.duration is not None and len(mesh.legs) == 1:  # of several legs a row fixes the sum
            set_bounds(index.durations, task.duration, task.duration)
        return low, high

    # Solutions

    def iterate(self, x: Array) -> Knots:
        """Return the motion that variables, shape (variables,), SI units, describe."""
        return self.problem.knots(x)

    def trajectory(self, task: Task, found: Knots) -> Trajectory:
        """Return a solution as a trajectory."""
        return assemble_trajectory(task.arm, self.mesh, found, fixed_ends=self.problem.jerk_counts)

    def interval_of(self, trajectory: Trajectory, found: Knots) -> Indices:
        """Return the interval of the mesh that each piece lies in, shape (pieces,): piece k is interval k."""
        return np.arange(self.intervals)

    def place(self, interval: float) -> str:
        """Return a place of the motion as text; an infinite interval is that of a row of the whole motion."""
        if not np.isfinite(interval):
            return "the motion as a whole"
        return f"{100 * min(interval / max(self.intervals - 1, 1), 1.0):.0f} % of the way"

    def knots_of(self, trajectory: Trajectory) -> Knots:
        """Return a motion on the program's mesh as a guess."""
        return knots_along(trajectory, self.mesh, trajectory.breaks[list(self.mesh.ends)])


def curves_for(
    n: int, objective: Objective, *, jerk_counts: bool, friction: bool
) -> tuple[Curve, ...]:
    """Return the curves of accelerations that are tried in turn.

    =====================================  ==================================
    objective                              accelerations in an interval
    =====================================  ==================================
    time, jerk limited                     linear
    time, at most SMALL_ARM_JOINTS joints  linear, with jumps at knots
    time, more joints                      constant
    no time, jerk limited                  quadratic, then linear
    smooth, without friction               quadratic, then constant
    other                                  constant
    =====================================  ==================================

    Torques of time-optimal motions jump, and so do those of least energy without losses in windings and, with friction,
    those of a joint that reverses. Constant accelerations need twice as many intervals as linear ones, but are solved
    faster for arms of many joints. Smooth objectives come nearest to their optimum with quadratic accelerations.
    Quadratic accelerations exceed limits between knots where torques nearly jump, as they do in motions of little more
    than the least time; for such motions the second curve is tried.
    """
    if objective.has_time:
        if jerk_counts:
            return (Curve.LINEAR,)
        return (Curve.JUMPING,) if n <= SMALL_ARM_JOINTS else (Curve.CONSTANT,)
    if jerk_counts:
        return (Curve.QUADRATIC, Curve.LINEAR)
    if objective.is_smooth and not friction:
        return (Curve.QUADRATIC, Curve.CONSTANT)
    return (Curve.CONSTANT,)
