"""Search for a motion around obstacles: sampled paths as starts, improved between planes that separate pairs.

The best motion without obstacles is found first. If it collides, paths around the obstacles are sampled, and each is
improved: planes between the arm and the obstacles near a motion that is clear of them keep the next one clear, in which
the planes turn, until the cost no longer falls.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.errors import PlanningError
from dhkit.planning.certificate import Certificate
from dhkit.planning.criteria import Limit
from dhkit.planning.obstacles import Gaps, Separation
from dhkit.planning.program import (
    Knots,
    Margins,
    MotionProgram,
    SearchLimitError,
    Task,
    knots_along,
)
from dhkit.planning.search.sampling import PathSampler
from dhkit.planning.search.search import Excess, MotionSearch, PlannedMotion
from dhkit.trajectories import Trajectory

POINTS = 9
"""Number of states of an interval at which gaps are measured, with both ends."""
ACTIVE_GAP = 0.05
"""Gap beyond the clearance, m, below which pairs are kept apart by planes; others only once they have come too near."""
NO_SHORTFALL = 1e-6
"""Largest difference, m, between the required gap and a gap that still counts as kept."""
INFLATION_FACTOR = 1.2
"""Factor of a gap's shortfall between knots that is added to its margin: planes are imposed at knots only."""
FINER = 2.0
"""Factor of the number of intervals of a finer mesh."""
MAX_SOLUTIONS = 16
"""Largest number of solutions in the improvement of one path."""
EXPECTED_ROUNDS = 4
"""Number of further improvements like the last one that a motion may need to become the best."""
MIN_IMPROVEMENT = 2e-3
"""Relative decrease of the cost below which a motion is no longer improved."""
PATHS = 4
"""Number of sampled paths that are improved."""
MAX_PATHS = 24
"""Largest number of searches for a path, each with its own random samples, if earlier ones found none."""
MAX_LENGTH_RATIO = 1.5
"""Largest length of a path that is improved, relative to the shortest one."""
PATH_CLEARANCES = (5e-3, 1e-3)
"""Distances beyond the clearance, m, that sampled paths keep where their ends do. Searches use them in turns: a narrow
passage may be open to the second only."""
FIRST_SAMPLES = 500
"""Largest number of samples of the first searches for a path; it doubles when all ``PATH_CLEARANCES`` were tried."""
MAX_SAMPLES = 4000
"""Largest number of samples of any search for a path."""
LIKE_POINTS = 16
"""Number of points at which a path is compared with a motion, and of states on the line between two of them."""
PATH_SPEED = 0.6
"""Speed of the initial guess along a sampled path, as a share of the speed limits."""


@dataclass(eq=False)
class Planes:
    """Planes between the pairs of a separation, beside one motion that is clear."""

    gaps: Gaps
    """Gaps of that motion in each interval, which place the planes."""
    active: NDArray[np.bool_]
    """Pairs that are kept apart, shape (K, P)."""
    required: Array
    """Distances to keep, shape (K, P), m."""
    inflation: Array | float
    """Additions to them for gaps that are too small between knots, shape (K, P), m."""

    @classmethod
    def of(cls, gaps: Gaps, required: Array, inflation: Array | float) -> Planes:
        """Return the planes beside a motion with these gaps."""
        return cls(gaps, gaps.gap < required + ACTIVE_GAP, required, inflation)

    def widened(self, gap: Array, required: Array) -> bool:
        """Include pairs of another motion that came too near, and inflate others; return whether pairs were new."""
        shortfall = required - gap
        new = (shortfall > NO_SHORTFALL) & ~self.active

        # The planes keep an active pair apart at the knots, so that it is too near only between them.
        missing = np.where(self.active, np.maximum(shortfall, 0.0), 0.0)
        self.inflation = self.inflation + INFLATION_FACTOR * missing
        if new.any():
            self.active = self.active | (gap < required + ACTIVE_GAP / 2)
        return bool(new.any())


class Start(NamedTuple):
    """A motion that is about clear of obstacles, from which a search begins."""

    motion: Trajectory
    ends: Array
    """Times at which its legs end, shape (legs,), s."""


class AvoidingSearch:
    """The search for one motion among obstacles.

    Parameters
    ----------
    task
        The motion, with its obstacles.
    search
        The search of the same motion without obstacles.
    program
        Its program.
    finer
        Returns the program of a finer mesh, on which paths that led to no motion are tried again.
    """

    def __init__(
        self,
        task: Task,
        search: MotionSearch[Knots],
        program: MotionProgram,
        finer: Callable[[], MotionProgram],
    ) -> None:
        avoidance = task.avoidance
        self.task = task
        self.search = search
        self.clearance = avoidance.clearance
        self.program = program
        self.separation = Separation(task.arm, avoidance.obstacles, avoidance.self_collision)
        self.paths = 0
        self._speed = np.where(np.isfinite(task.limits.velocity), task.limits.velocity, 1.0)
        self._finer = finer
        self._found = list[Trajectory]()
        self._paths: dict[int, list[Array] | None] = {}

    def __call__(self, warm: Trajectory | None = None) -> PlannedMotion:
        """Return the best motion found.

        Raises
        ------
        PlanningError
            None was found: says in how many starts, and why the first failed.
        """
        search = self.search
        best = None
        try:
            # On the coarse mesh the arm may move too far in an interval for one plane to separate it from an obstacle.
            for is_finer in (False, True):
                if is_finer:
                    self.program = search.program = self._finer()
                for start in self._starts(warm):
                    try:
                        found = self._improved(start, np.inf if best is None else best.cost)
                    except PlanningError as error:
                        search.keep_first_failure(error)
                        continue
                    self._found.append(found.trajectory)
                    best = found if best is None or found.cost < best.cost else best
                if best is not None:
                    break
        except SearchLimitError:
            when = f" within {search.work.limit_text}"
        else:
            when = ""
        best = best or self._slowed_path()
        if best is None:
            raise self._none_found(when) from None
        return best

    def _slowed_path(self) -> PlannedMotion | None:
        """Return the shortest sampled path, followed from rest to rest between its corners; None if there is none."""
        paths = sorted(
            (path for path in self._paths.values() if path is not None), key=self._length
        )
        for path in paths:
            corners = np.vstack([path[0][:1], *(leg[1:] for leg in path)])
            task = replace(self.task, points=corners)
            failure = self.search.failure or PlanningError(
                f"no motion found within {self.search.work.limit_text}"
            )
            slow = PlannedMotion.slowed_straight(task, self.program.mesh.intervals, failure)
            if slow is not None:
                return slow
        return None

    def _none_found(self, when: str) -> PlanningError:
        failure = self.search.failure
        clear = f"{1000 * self.clearance:.3g} mm clear of {self.task.avoidance.names}"
        starts = "sampling found no way around"
        if self.paths:
            starts = f"in {self.paths} start{'s' * (self.paths > 1)}"
        reason = f"; the first: {failure}" if failure else ""
        return PlanningError(f"no motion found that keeps {clear}{when}, {starts}{reason}")

    # Starts

    def _starts(self, warm: Trajectory | None) -> Iterator[Start]:
        """Yield motions that are about clear of obstacles: a given one, then along sampled paths, short ones first.

        Paths are left out that are much longer than the shortest one, or like a motion that was found.
        """
        if warm is not None and len(self.program.mesh.legs) == 1:
            self.paths += 1
            yield Start(warm, np.array([warm.duration]))

        found: list[list[Array]] = []
        for seed in range(MAX_PATHS):
            if seed not in self._paths:
                self._paths[seed] = self._path(seed)
            path = self._paths[seed]
            if path is not None:
                found.append(path)
            if len(found) == PATHS or (found and seed >= PATHS):
                break
            if path is not None and all(len(leg) == 2 for leg in path):
                break  # the straight path: others are not shorter

        found.sort(key=self._length)
        for path in found:
            is_long = self._length(path) > MAX_LENGTH_RATIO * self._length(found[0])
            if is_long or any(self._is_like(path, motion) for motion in self._found):
                continue
            self.paths += 1
            yield self._timed(path)

    def _path(self, seed: int) -> list[Array] | None:
        """Return a path around the obstacles, shape (k, n) for each leg, or None."""
        task = self.task
        limits = self.task.limits
        arm = task.arm.numbers

        # The box from which samples are taken: the joint ranges; without a limit, one turn or the arm's reach beyond
        # the given configurations.
        span = np.where(arm.prismatic, max(task.arm.reach, 1e-3), np.pi)
        lower = np.where(
            np.isfinite(limits.lower), limits.lower, np.minimum(task.points.min(axis=0), 0) - span
        )
        upper = np.where(
            np.isfinite(limits.upper), limits.upper, np.maximum(task.points.max(axis=0), 0) + span
        )

        # The gap that each pair keeps: the clearance and a little more, or the gap that it has at the ends if that is
        # less.
        turn, which = divmod(seed, len(PATH_CLEARANCES))
        ends = self.separation.gaps(task.points[:, None]).gap
        reduced = task.avoidance.at_ends(self.separation.pairs).min(axis=1)
        at_ends = np.minimum(ends.min(axis=0) - NO_SHORTFALL, reduced)
        need = np.minimum(self.clearance + PATH_CLEARANCES[which], at_ends)
        largest = float(need.max(initial=0.0))

        def is_free(q: Array) -> NDArray[np.bool_]:
            free: NDArray[np.bool_] = np.all(
                self.separation.gaps(q[:, None], largest).gap >= need, axis=1
            )
            free[free] = task.avoidance.keeps_shapes_apart(task.arm, q[free])
            return free

        samples = min(FIRST_SAMPLES * 2**turn, MAX_SAMPLES)
        sampler = PathSampler(
            is_free, lower, upper, self._speed / self._speed.mean(), seed, self.search.work, samples
        )
        path = []
        for start, goal in zip(task.points[:-1], task.points[1:], strict=True):
            leg = sampler.path(start, goal)
            if leg is None:
                return None
            path.append(sampler.shortened(leg))
        return path

    def _is_like(self, path: list[Array], motion: Trajectory) -> bool:
        """Return whether a path can be deformed into a motion without collision, on straight lines in joint space.

        Points at the same share of the length are joined; a path of several legs counts as unlike.
        """
        if len(path) > 1:
            return False
        share = np.linspace(0.0, 1.0, LIKE_POINTS)
        of_path = _evenly(path[0], share)
        of_motion = _evenly(motion.q(np.linspace(0.0, motion.duration, 8 * LIKE_POINTS)), share)

        # States (1 - s) path + s motion on the line between two points, for s in ``share``.
        between = of_path + share[:, None, None] * (of_motion - of_path)
        return bool(
            self.separation.smallest(between.reshape(-1, self.task.arm.n), 0.0).min() >= 0.0
        )

    def _length(self, path: list[Array]) -> float:
        """Return the time that a path takes at the speed limits, s."""
        return float(sum(self._durations(leg).sum() for leg in path))

    def _durations(self, leg: Array) -> Array:
        """Return the times, s, that the straight lines between a leg's points (k, n) take, shape (k-1,).

        Each is max_i |dq_i| / v_i, with the speed limits v.
        """
        times: Array = np.max(np.abs(np.diff(leg, axis=0)) / self._speed, axis=1)
        return times

    def _timed(self, path: list[Array]) -> Start:
        """Return a motion along a path that rests at the ends of legs; its velocities are rough.

        The share of a leg's length that is covered at x = t / T is s = 3 x^2 - 2 x^3. T is the guessed duration of the
        straight motion times the ratio of the lengths, and slower, since the path has corners.
        """
        task = self.task
        mesh = self.program.mesh
        guessed = self.program.guessed_durations(self.search.task)
        times = [np.zeros(1)]
        q = [task.points[:1]]
        for k, leg in enumerate(path):
            steps = self._durations(leg)
            length = float(steps.sum())
            straight = max(float(self._durations(leg[[0, -1]]).sum()), 1e-6)
            slower = 1.0 if task.duration is not None else max(length / straight, 1.0) / PATH_SPEED

            x = np.linspace(0.0, 1.0, 4 * mesh.legs[k] + 1)[1:]
            s = x * x * (3 - 2 * x)
            along = np.concatenate([[0.0], np.cumsum(steps)]) / max(length, 1e-9)
            q.append(np.stack([np.interp(s, along, column) for column in leg.T], axis=1))
            times.append(times[-1][-1] + guessed[k] * slower * x)
        t = np.concatenate(times)
        states = np.vstack(q)
        qd = np.gradient(states, t, axis=0)
        qd[0] = task.start_velocity
        qd[-1] = task.goal_velocity
        ends = np.array([part[-1] for part in times[1:]])
        return Start(Trajectory.from_samples(task.arm, t, states, qd), ends)

    # Improvement

    def _improved(self, start: Start, best_cost: float) -> PlannedMotion:
        """Return the best motion near a start that is about clear of obstacles.

        The improvement ends early where it will hardly lead below ``best_cost``.
        """
        search = self.search
        mesh = self.program.mesh
        guess = knots_along(start.motion, mesh, start.ends)
        gaps, required = self._measured(start.motion, guess, np.inf)
        planes = Planes.of(self._with_planes_of_ends(gaps), required, 0.0)
        margins = Margins(mesh.intervals)
        best: PlannedMotion | None = None
        turn = 0
        for _ in range(MAX_SOLUTIONS):
            # The best motion between the planes.
            kept = planes.required + planes.inflation
            rows = self.separation.rows(planes.gaps, planes.active, kept, {0, *mesh.ends})
            try:
                solved = search.solution(guess, margins, self.program.with_planes(rows))
                found = search.checked(solved, turn)
            except PlanningError:
                if best is not None:
                    return best
                raise

            # Its gaps between the knots.
            knots = self.program.knots_of(found.trajectory)
            gaps, required = self._measured(found.trajectory, knots, self.clearance + ACTIVE_GAP)
            shortfall = float(np.max(required - gaps.gap, initial=-np.inf))
            missing = 0.0
            if isinstance(found, PlannedMotion) and shortfall <= NO_SHORTFALL:
                found = self._certified(found)
                if isinstance(found, PlannedMotion):
                    # It is clear: planes beside it allow the next motion to be better.
                    saved = np.inf if best is None else best.cost - found.cost
                    best = found if saved > 0 else best
                    if (
                        saved < MIN_IMPROVEMENT * found.cost
                        or found.cost - EXPECTED_ROUNDS * saved > best_cost
                    ):
                        break
                    gaps, required = self._measured(found.trajectory, knots, np.inf)
                    planes = Planes.of(self._with_planes_of_ends(gaps), required, planes.inflation)
                    guess = knots
                    continue
                # The certificate's grid is finer.
                missing = self._shortfall(found.certificate) - shortfall

            # It is not: the same planes with larger margins, and those of pairs that came too near.
            planes.required = np.maximum(planes.required, required)
            is_new = planes.widened(gaps.gap - missing, required)
            if is_new and shortfall > ACTIVE_GAP:
                continue  # from the same guess: this motion went far astray
            if isinstance(found, Excess) and _exceeds_limits(found.certificate):
                margins = search.widen_margins(margins, solved, found, turn)
                turn += 1
            guess = knots
        if best is not None:
            return best
        if isinstance(found, Excess):
            raise search.stays_exceeded(found.certificate, MAX_SOLUTIONS)
        raise PlanningError(
            f"a distance is still {1000 * shortfall:.2g} mm below the clearance after {MAX_SOLUTIONS} solutions"
        )

    def _certified(self, found: PlannedMotion) -> PlannedMotion | Excess:
        """Return a motion with the certificate of its clearance, by coal on the finer grid, or its excess."""
        checker = self.task.checker
        states = checker.states(found.trajectory)
        certificate = checker.check(found.trajectory, states)
        if certificate.ok:
            return replace(found, certificate=certificate)
        if Limit.CLEARANCE.what not in self.search.tightened:
            self.search.tightened.append(Limit.CLEARANCE.what)
        return Excess(found.trajectory, states, certificate)

    def _with_planes_of_ends(self, gaps: Gaps) -> Gaps:
        """Return gaps with the planes of the start and the goal in the first and the last interval.

        Only for pairs that are within the clearance there: another plane leaves them less of the little room that they
        have at the end itself, which cannot move.
        """
        pairs = self.separation.pairs
        reduced = self.task.avoidance.at_ends(pairs) < self.clearance
        ends = self.separation.gaps(self.task.points[[0, -1], None])
        normal = gaps.normal.copy()
        level = gaps.level.copy()
        for end, interval in ((0, 0), (1, -1)):
            which = reduced[:, end]
            normal[interval, which] = ends.normal[end, which]
            level[interval, which] = ends.level[end, which]
        return replace(gaps, normal=normal, level=level)

    def _shortfall(self, certificate: Certificate) -> float:
        """Return the largest shortfall of a gap on the certificate's grid and between its states, m; at least 0."""
        return max(0.0, certificate.excess_of(Limit.CLEARANCE))

    def _measured(self, motion: Trajectory, knots: Knots, near: float) -> tuple[Gaps, Array]:
        """Return the gaps in each interval of the mesh, those above ``near`` (m) perhaps infinite, and those required.

        Required gaps have shape (K, P), m: the largest of an interval.
        """
        inside = self._inside(motion, knots, POINTS)
        avoidance = self.task.avoidance
        pairs = self.separation.pairs
        required = avoidance.required(self.task.arm, inside.reshape(-1, self.task.arm.n), pairs)
        return self.separation.gaps(inside, near), required.reshape(*inside.shape[:2], -1).max(
            axis=1
        )

    def _inside(self, motion: Trajectory, knots: Knots, points: int) -> Array:
        """Return states of a motion in each interval of the mesh, both ends included, shape (K, points, n)."""
        times = self.program.mesh.times(knots.durations)
        share = np.linspace(0.0, 1.0, points)
        return motion.q(times[:-1, None] + np.diff(times)[:, None] * share)


def motion_around(
    task: Task,
    free: PlannedMotion,
    search: MotionSearch[Knots],
    program: MotionProgram,
    finer: Callable[[], MotionProgram],
    warm: Trajectory | None,
) -> tuple[Task, PlannedMotion]:
    """Return the best motion among obstacles, with the task whose clearance it keeps.

    A clearance that is reduced at an end is reduced during the whole motion first: the motion then found is the
    start of the search for one that keeps the clearance farther away, and the result if there is none.
    """
    if not task.avoidance:
        return task, free
    certificate = task.checker.check(free.trajectory)
    if certificate.ok:
        return task, replace(free, certificate=certificate)
    if not task.avoidance.reduced or task.avoidance.is_reduced_throughout:
        return task, AvoidingSearch(task, search, program, finer)(warm)
    easier = task.avoiding(task.avoidance.reduced_throughout)
    _, near = motion_around(easier, free, search, program, finer, warm)
    search.program = program
    certificate = task.checker.check(near.trajectory)
    if certificate.ok:
        return task, replace(near, certificate=certificate)
    try:
        return task, AvoidingSearch(task, search, program, finer)(near.trajectory)
    except PlanningError:
        return easier, near


def _exceeds_limits(certificate: Certificate) -> bool:
    """Return whether a limit other than the clearance is exceeded."""
    return any(check.excess > 0 and check.limit != Limit.CLEARANCE for check in certificate.checks)


def _evenly(points: Array, share: Array) -> Array:
    """Return the points of a polygon (k, n) at shares (N,) of its length, shape (N, n)."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.stack([np.interp(share * along[-1], along, column) for column in points.T], axis=1)
