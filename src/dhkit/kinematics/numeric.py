"""Inverse kinematics of any arm by iteration: damped Newton steps from several starts, for batches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.cached_property import cached_property
from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.display import counted
from dhkit.kernels import SMALL_BATCH, check_whole, in_threads, pose_rows, uncounted
from dhkit.kinematics.candidates import are_poses, collect
from dhkit.kinematics.closed_form.family import ALL_COORDINATES
from dhkit.kinematics.forward import forward_kinematics
from dhkit.kinematics.newton import Newton, closes
from dhkit.kinematics.preference import Preference, checked_preference
from dhkit.kinematics.self_motion import improve_by_self_motion
from dhkit.kinematics.solutions import IKSolutions

Progress: TypeAlias = Callable[[int, int], None]
"""Called with the number of finished poses and of all poses."""

RESTARTS = 511
"""Largest number of further starts unless another is asked for: of poses that arms in general position reach inside
their limits, 99.99 % are found, and 99 % with 63 (their share of the time is a tenth)."""
CHUNK = 8_192
"""Number of searches that run together; their arrays take about 5 MB."""
_MIN_POSES_PER_THREAD = 64
"""Smallest number of poses that a thread gets at a time: fewer take less time than handing them over."""
_MIN_CANDIDATES = 512
"""Smallest number of random joint positions from which starts are chosen."""
_REFINED = 1e-13
"""Error at which Newton's method stops refining a solution of another solver: share of the reach, and rad."""
_FEW = 1_024
"""Fewer solutions to refine are perhaps those of one pose."""
_REFINED_CLOSES = 1e-10
"""Largest error of a refined solution: position as a share of the reach, rotation in rad."""


@takes_robot
def solve_numerically(
    description: Description,
    T: ArrayLike,
    q0: ArrayLike | None = None,
    *,
    position_only: bool = False,
    restarts: int = RESTARTS,
    tolerance: float = 1e-12,
    seed: int = 0,
    limits: bool = True,
    prefer: Preference | None = None,
    threads: int = 1,
    progress: Progress | None = None,
) -> IKSolutions:
    """Return one solution of T_world_tool(q) = T for each pose, by iteration, for any arm.

    Newton's method with Levenberg's damping, which is in proportion to the squared error, so that the last steps are
    undamped and converge quadratically, for redundant arms too (Yamashita and Fukushima 2001, On the rate of
    convergence of the Levenberg-Marquardt method; Sugihara 2011, Solvability-unconcerned inverse kinematics by the
    Levenberg-Marquardt method). A stalled search is restarted from random joint positions, those with the nearest poses
    first, twice as many each time; of solutions found together the one nearest to the first start is returned. The
    result for a pose does not depend on the other poses.

    Parameters
    ----------
    description
        The robot, with any kinds and number of joints.
    T
        Poses of the tool in the world, shape (..., 4, 4).
    q0
        Start, shape (n,) or (..., n), rad and m; moved into the limits. For None, and in rows that are not finite, the
        middle of the limits, or 0 without limits.
    position_only
        Whether only the tool's position is to be reached. Otherwise the whole pose is, also by arms with fewer than six
        joints: a pose that such an arm does not reach in full is out of its reach.
    restarts
        Largest number of further starts for a pose.
    tolerance
        Largest error: position as a share of the reach, rotation in rad. Rounding allows about 1e-14.
    seed
        Seed of the random starts.
    limits
        Whether joints stay inside their limits. Otherwise a flag tells where they are not.
    prefer
        What the solution of a redundant arm is moved for along its self-motion, with the tool at rest, to a local
        maximum: ``"limits"``, the smallest distance from a limit as a share of half the joint's range, or a smooth
        bound of it that is up to 6 % of the range off for seven joints;
        ``"manipulability"``, that of :func:`dhkit.kinematics.manipulability` for whole motions, or for translations
        with ``position_only``; or joint positions (n,), rad and m, or the name of a configuration, to come near to.
    threads
        Number of threads for a large batch.
    progress
        Called after every few thousand poses; an exception in it ends the work.

    Returns
    -------
    IKSolutions
        One branch, ``"numeric"``. Angles of joints without limits are in (-pi, pi], all are with ``limits=False``;
        others are inside their limits. Singular branches are not flagged. Where no solution was found, the status is
        ``not_found``, or ``out_of_reach`` where all links in one line are too short, and ``distance`` is the position
        error of the best search: 0 means that only the rotation is not reached.

    Raises
    ------
    ValueError
        T has not shape (..., 4, 4); ``q0`` or ``prefer`` does not fit; ``restarts`` is negative, ``tolerance`` not
        positive or ``threads`` below 1; ``prefer`` is given for an arm that is not redundant.
    TypeError
        T, ``q0`` or ``prefer`` is not numeric.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> panda = library_robot("panda")
    >>> q = np.array([0.1, -0.7, 0.2, -2.2, 0.1, 1.6, 0.8])
    >>> found = solve_numerically(panda, forward_kinematics(panda, q), q0=q + 0.05)
    >>> str(found.status), bool(abs(found.q[0] - q).max() < 0.1)
    ('ok', True)
    """
    check_whole("threads", threads, 1)
    check_whole("restarts", restarts, 0)
    check_whole("seed", seed, 0)
    if not tolerance > 0:
        raise ValueError(f"tolerance is {tolerance}; expected a positive number")
    poses = pose_rows(T)
    batch = poses.shape[:-2]
    n = description.n
    newton = Newton.of(description, position_only=position_only, limits=limits)
    preferred = None if prefer is None else checked_preference(description, prefer)
    if preferred is not None and n == newton.freedoms:
        raise ValueError(
            f"prefer is given, but {description.name} is not redundant: "
            f"{counted(n, 'joint')} move the tool in {n} directions that count"
        )
    starts = _first_starts(newton, q0, batch).reshape(-1, n)
    posed = are_poses(poses)
    q = np.full((posed.size, n), np.nan)
    distance = np.full(posed.size, np.nan)
    search = NumericSearch(newton, tolerance, restarts, seed)
    rows = np.flatnonzero(posed)
    goals = poses[posed].reshape(-1, 16)

    # Not counted for a few poses, so that their many starts do not start a compilation in a control loop.
    few = uncounted if posed.size < SMALL_BATCH else nullcontext

    def solve(some: slice) -> int:
        with np.errstate(all="ignore"), few():
            found, distance[rows[some]] = search(goals[some], starts[rows[some]])
            if preferred is not None:
                closed = np.flatnonzero(~np.isnan(found).any(axis=1))
                better = improve_by_self_motion(
                    newton, goals[some][closed], found[closed], preferred, tolerance
                )
                found[closed] = better
            q[rows[some]] = found
        return int(rows[some][-1]) + 1

    poses_per_thread = -(-len(rows) // threads)
    chunk = min(CHUNK, max(_MIN_POSES_PER_THREAD, poses_per_thread))
    for done in in_threads(solve, _chunks(len(rows), chunk), threads):
        if progress is not None:
            progress(done, posed.size)
    return collect(
        description,
        q.reshape(*batch, 1, n),
        distance.reshape(batch),
        positions=poses[..., :3, 3],
        posed=posed,
        branches=("numeric",),
        met=ALL_COORDINATES[: newton.size],
        complete=False,
    )


@dataclass(frozen=True, eq=False)
class NumericSearch:
    """The search for one solution of each pose."""

    newton: Newton
    tolerance: float
    restarts: int
    seed: int

    def __call__(self, goals: Array, first: Array) -> tuple[Array, Array]:
        """Return joint positions (N, n), NaN where none were found, and position errors, m, shape (N,).

        Parameters
        ----------
        goals
            Poses, shape (N, 16).
        first
            First start of each pose, shape (N, n), rad and m.
        """
        q, error = self.newton.descend(goals, first, self.tolerance)
        open_rows = np.flatnonzero(~closes(error, self.tolerance))
        if len(open_rows) and self.restarts:
            more = self.starts(goals[open_rows])
            for begin, end in doubling(self.restarts):
                poses_at_once = max(1, CHUNK // (end - begin))
                for some in _chunks(len(open_rows), poses_at_once):
                    rows = open_rows[some]
                    self._improve(q, error, rows, goals[rows], first[rows], more[some, begin:end])

                left = ~closes(error[open_rows], self.tolerance)
                open_rows = open_rows[left]
                more = more[left]
        q[~closes(error, self.tolerance)] = np.nan
        return q, self.newton.length * np.linalg.norm(error[:, :3], axis=1)

    def starts(self, goals: Array) -> Array:
        """Return random joint positions whose poses are near the goals, nearest first, shape (N, restarts, n)."""
        # Goal a and candidate b: |a - b|^2 = a.a - 2 a.b + b.b; a.a is the same for all candidates, and left out.
        q, b, squares = self._candidates
        a = self._coordinates(goals)
        gaps = squares - 2 * a @ b.T
        return q[np.argsort(gaps, axis=1)[:, : self.restarts]]

    @cached_property
    def _candidates(self) -> tuple[Array, Array, Array]:
        """Random joint positions (K, n), the coordinates b (K, 12 or 3) of their poses, and b.b, shape (K,).

        They are the same for all poses, so that the result for a pose does not depend on the others.
        """
        newton = self.newton
        description = newton.description
        lower, upper = newton.ranges(np.where(description.numbers.prismatic, newton.length, np.pi))
        count = max(_MIN_CANDIDATES, self.restarts)
        draws = np.random.default_rng(self.seed).random((count, description.n))
        q = lower + (upper - lower) * draws
        b = self._coordinates(forward_kinematics(description, q).reshape(-1, 16))
        return q, b, np.sum(b**2, axis=1)

    def _coordinates(self, poses: Array) -> Array:
        """Return points whose distances are about those of poses (N, 16): lengths over the reach, angles in rad.

        Their shape is (N, 12); (N, 3) if only positions are to be reached. Rotations R and S that are an angle t apart
        have the distance |R - S|_F = sqrt(8) sin(t / 2) by their entries, which over sqrt(2) is t for small angles.
        """
        rows = poses.reshape(-1, 4, 4)[:, :3]
        position = rows[:, :, 3] / self.newton.length
        if self.newton.size == 3:
            return position
        return np.concatenate([position, rows[:, :, :3].reshape(-1, 9) / np.sqrt(2)], axis=1)

    def _improve(
        self,
        q: Array,
        error: Array,
        rows: NDArray[np.intp],
        goals: Array,
        first: Array,
        starts: Array,
    ) -> None:
        """Search from starts (M, k, n) and store better results in rows of ``q`` and ``error``."""
        count, k, n = starts.shape
        many = np.ascontiguousarray(starts.reshape(-1, n))
        found, misses = self.newton.descend(np.repeat(goals, k, axis=0), many, self.tolerance)
        found = found.reshape(count, k, n)
        misses = misses.reshape(count, k, -1)
        closed = closes(misses, self.tolerance)

        # The lowest rank is best. Results that reach the pose have negative ranks, the one nearest to the first start
        # the lowest: -1 / (1 + distance^2). The others have their squared error.
        square_of_distance = np.sum(((found - first[:, None]) / self.newton.units) ** 2, axis=-1)
        rank = np.where(closed, -1 / (1 + square_of_distance), np.sum(misses**2, axis=-1))
        best = np.argmin(rank, axis=1)

        is_nearer = rank.min(axis=1) < np.sum(error[rows] ** 2, axis=-1)
        better = closed.any(axis=1) | is_nearer
        chosen = (np.flatnonzero(better), best[better])
        q[rows[better]] = found[chosen]
        error[rows[better]] = misses[chosen]


def refined(description: Description, q: Array, goals: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return joint values after Newton's method, and whether they close.

    Parameters
    ----------
    description
        The robot; limits do not count.
    q
        Joint values near solutions, shape (K, n), rad and m.
    goals
        Their poses, with orthonormal rotations, shape (K, 16), m.

    Returns
    -------
    tuple[Array, NDArray[np.bool_]]
        Joint values (K, n), angles in (-pi, pi], and whether their pose is the goal to ``_REFINED_CLOSES``, shape (K,).
    """
    newton = Newton.of(description, position_only=False, limits=False)
    # Not counted for a few, so that many solutions of one pose do not start a compilation in a control loop.
    few = uncounted if len(q) < _FEW else nullcontext
    with np.errstate(all="ignore"), few():
        q, error = newton.descend(goals, q, _REFINED)
    return q, closes(error, _REFINED_CLOSES)


def _first_starts(newton: Newton, q0: ArrayLike | None, batch: tuple[int, ...]) -> Array:
    """Return the first starts, inside the limits, shape (..., n), rad and m."""
    description = newton.description
    if q0 is None:
        return np.broadcast_to(newton.middle, (*batch, description.n))
    given = joint_array(description, q0, "q0")
    try:
        given = np.broadcast_to(given, (*batch, description.n))
    except ValueError:
        expected = f"({description.n},) or {(*batch, description.n)}"
        raise ValueError(f"q0 has shape {given.shape}; expected {expected}") from None
    finite = np.isfinite(given).all(axis=-1, keepdims=True)
    return newton.inside(np.where(finite, given, newton.middle))


def doubling(count: int) -> Iterator[tuple[int, int]]:
    """Yield 0, 1; 1, 3; 3, 7 ... up to a count."""
    begin = 0
    while begin < count:
        end = min(2 * begin + 1, count)
        yield begin, end
        begin = end


def _chunks(count: int, size: int) -> Iterator[slice]:
    """Yield slices of at most ``size`` that together are the numbers below ``count``."""
    for begin in range(0, count, size):
        yield slice(begin, min(begin + size, count))
