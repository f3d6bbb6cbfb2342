"""Inverse kinematics of seven revolute joints: all solutions at a given value of the redundancy.

The redundancy is the arm angle of arms with a spherical shoulder and a spherical wrist
(:mod:`dhkit.kinematics.closed_form.arm_angle`), and joint 7 of all others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import (
    Array,
    Description,
    joint_array,
    lock,
    takes_robot,
    world_to_frames,
    world_to_tool,
)
from dhkit.description.arrays import number_array
from dhkit.description.frames import carrying
from dhkit.description.poses import inverse_pose, turned_about
from dhkit.errors import ModelError
from dhkit.kernels import EXACT_RANGE, Kernel
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.candidates import collect, is_beyond_all_links
from dhkit.kinematics.chain import Chain
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.family import LAST_JOINT
from dhkit.kinematics.closed_form.formulas import MIN_DIRECTION
from dhkit.kinematics.eliminated import elimination_kernels, solve_by_elimination
from dhkit.kinematics.manipulability import manipulability
from dhkit.kinematics.numeric import solve_numerically
from dhkit.kinematics.preference import Preference, checked_preference, share_of_limits
from dhkit.kinematics.solutions import IKSolutions, IKStatus
from dhkit.kinematics.solver import Solver, solve_in_closed_form, solver_for

JOINTS = 7
_LAST = JOINTS - 1
_TRIED = 32
"""Number of steps between the values that are tried where none is asked for."""
_WHOLE_TURN = (-np.pi, np.pi)
_TRIED_AT_ONCE = 32
"""Number of values that are tried together in a closed form; by elimination they are tried one by one."""
_RESTARTS = 31
"""Number of restarts of the search for a solution between the tried values; where there is one, few are needed."""
_AROUND = np.linspace(-1.0, 1.0, 9)
_REFINEMENTS = 3
"""Values around the best one, in steps between them, and how often the steps become a quarter."""
_PREFERRED_TOGETHER = 256
"""Poses whose solutions at all tried values are held together, some 4 MB."""


def solve_redundant(
    description: Description,
    T: Array,
    seed: ArrayLike | None = None,
    redundancy: ArrayLike | None = None,
    threads: int = 1,
    prefer: Preference | None = None,
    out: Array | None = None,
) -> IKSolutions:
    """Return the solutions of T_world_tool(q) = T that have a given value of the redundancy.

    Parameters
    ----------
    description
        The robot; seven revolute joints.
    T
        Poses of the tool in the world, shape (..., 4, 4).
    seed
        Joint positions, shape (7,) or (..., 7), rad, whose redundancy is taken if ``redundancy`` is not given, and from
        which joints 1 and 5 take their angles where a singularity leaves them free.
    redundancy
        Joint position 7, or the arm angle, shape () or (...), rad. If neither is given, 33 values are tried, of joint 7
        from the middle of its limits outward, of the arm angle from 0 to both sides. Each pose has the first one with a
        solution inside all limits, or that of a solution by iteration, or else the first one with any solution.
    threads
        Number of threads for a large batch of a closed form.
    prefer
        How a value is chosen, for the best solution inside the limits at the 33 values and then, 64 times as fine,
        around the best of them: ``"limits"``, the farthest from the limits; ``"manipulability"``, that of
        :func:`dhkit.kinematics.manipulability` for whole motions; or joint positions (7,), rad, the nearest to them.
    out
        Array for the joint positions, shape (..., 8, 7), float64, contiguous. Only for closed forms.

    Raises
    ------
    ModelError
        The arm has prismatic joints, or not seven joints.
    ValueError, TypeError
        ``redundancy``, ``seed`` or ``prefer`` does not fit, or is not finite; or ``prefer`` is given with another.
    """
    check_seven(description)
    solver = AtRedundancy.of(description)
    if prefer is not None:
        if redundancy is not None or seed is not None:
            raise ValueError("prefer is given with redundancy or seed, which leave no choice")
        values = _preferred_values(solver, T, _score_of(description, prefer), threads)
        return solver(T, values, threads, out)
    asked_for = _asked_for(description, seed, redundancy, T.shape[:-2])
    if asked_for is not None:
        joints = None if seed is None else joint_array(description, seed, "seed")
        return solver(T, asked_for, threads, out, joints)
    found = _at_tried_values(solver, T, threads)
    return found if out is None else solver(T, np.asarray(found.redundancy), threads, out)


@takes_robot
def redundancy_of(description: Description, q: ArrayLike) -> Array:
    """Return the redundancy of joint positions (..., 7), shape (...), rad: the arm angle in (-pi, pi], or joint 7.

    Parameters
    ----------
    description
        The robot; seven revolute joints.
    q
        Joint positions, shape (..., 7), rad.

    Returns
    -------
    Array
        Shape (...), rad.

    Raises
    ------
    ModelError
        The arm has prismatic joints, or not seven joints.
    ValueError, TypeError
        q has not shape (..., 7), or is not numeric.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> panda = library_robot("panda")
    >>> float(redundancy_of(panda, [0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8]))
    0.8
    """
    check_seven(description)
    q = joint_array(description, q)
    found = classify(description).redundant
    if found is None or found[0].redundancy == LAST_JOINT:
        return q[..., _LAST]

    # The arm angle is that of axis 4 about the line from S to W, from the direction u x (W - S), with axis 1 along u.
    axes = Axes.of(description)
    chain = Chain.of(axes)
    frames = carrying(description.convention, np.moveaxis(world_to_frames(description, q), -3, 0))
    axis_4 = frames[3, ..., :3, 2]
    shoulder = chain.T_world_first[:3, 3]
    wrist = (world_to_tool(description, q) @ inverse_pose(chain.T_last_tool))[..., :3, 3]
    line = _unit(wrist - shoulder)
    across = np.cross(axes.direction(1), line)
    # With the wrist on axis 1, the first frame's y axis stands for it, as in the closed form.
    on_axis_1 = np.linalg.norm(across, axis=-1, keepdims=True) <= MIN_DIRECTION
    level = np.where(on_axis_1, chain.T_world_first[:3, 1], _unit(across))
    up = np.cross(line, level)
    angle: Array = np.arctan2((axis_4 * up).sum(axis=-1), (axis_4 * level).sum(axis=-1))
    return angle


def _unit(vectors: Array) -> Array:
    """Return vectors (..., 3) over their lengths; 0 stays 0."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    directions: Array = vectors / np.where(length > 0, length, 1.0)
    return directions


@dataclass(frozen=True, eq=False)
class AtRedundancy:
    """The solver of an arm at given redundancies: a closed form, or elimination for the joints before the last."""

    description: Description
    method: Solver | Description
    """A closed form, or the arm with joint 7 locked at 0, for elimination."""

    @classmethod
    @lru_cache(maxsize=64)
    def of(cls, description: Description) -> AtRedundancy:
        """Return the solver of an arm."""
        found = classify(description).redundant
        if found is not None:
            return cls(description, solver_for(description, *found))
        return cls(description, lock(description, {_LAST: 0}))

    def __call__(
        self,
        T: Array,
        values: Array,
        threads: int = 1,
        out: Array | None = None,
        seed: Array | None = None,
    ) -> IKSolutions:
        """Return the solutions of poses (..., 4, 4) at redundancies (...), rad; ``out`` is for closed forms.

        Joints 1 and 5 have the angles of ``seed``, shape (7,) or (..., 7), rad, or 0, where a singularity leaves them
        free.
        """
        if isinstance(self.method, Description):
            return self._by_elimination(self.method, T, values)
        free = np.zeros((3, *values.shape))
        free[1] = values
        if seed is not None:
            free[0] = seed[..., 0]
            free[2] = seed[..., 4]
        found = solve_in_closed_form(self.description, self.method, T, free, out, threads)
        status = found.status_code
        is_missed = status == IKStatus.out_of_reach
        if is_missed.any():
            # Another value may have a solution, unless all links in one line are too short.
            is_beyond = is_beyond_all_links(self.description, T[..., :3, 3])
            status[is_missed & ~is_beyond] = IKStatus.not_found
        return replace(found, complete=False, redundancy=values)

    def _by_elimination(self, six: Description, T: Array, values: Array) -> IKSolutions:
        """Return the solutions of the arm without joint 7, for the poses before joint 7 moves the tool."""
        axes = Axes.of(self.description)
        # T = E_1 ... E_6 E_7 T_0, so that E_1 ... E_6 T_0 = T (T_0^-1 E_7^-1 T_0).
        T_0 = axes.T_world_tool
        back = (
            inverse_pose(T_0) @ _turned(axes.direction(JOINTS), axes.point(JOINTS), -values) @ T_0
        )
        found = solve_by_elimination(six, T @ back)

        B = len(found.branches)
        # In (-pi, pi], as the other joints.
        last = np.pi - np.mod(np.pi - values, 2 * np.pi)
        last = np.broadcast_to(last[..., None], (*values.shape, B))
        q = np.concatenate([found.q, np.where(found.valid, last, np.nan)[..., None]], axis=-1)
        return collect(
            self.description,
            q,
            found.distance,
            positions=T[..., :3, 3],
            posed=found.status_code != IKStatus.not_a_pose,
            branches=found.branches,
            met=found.met,
            complete=False,
            redundancy=values,
        )


def redundant_kernels(description: Description) -> list[Kernel]:
    """Return the kernels that solve an arm of seven revolute joints at a redundancy.

    Parameters
    ----------
    description
        The robot.
    """
    method = AtRedundancy.of(description).method
    return [method.kernel] if isinstance(method, Solver) else elimination_kernels(method)


def _asked_for(
    description: Description,
    seed: ArrayLike | None,
    redundancy: ArrayLike | None,
    batch: tuple[int, ...],
) -> Array | None:
    """Return the redundancies that a caller asks for, shape ``batch``; None if any will do."""
    if redundancy is not None and seed is not None:
        raise ValueError("redundancy and seed are given, which has a redundancy of its own")
    shapes = f"{batch}" if not batch else f"() or {batch}"
    if redundancy is not None:
        given = number_array(redundancy, "redundancy", shapes)
        values = _broadcast(given, batch, f"redundancy has shape {given.shape}; expected {shapes}")
        name = "redundancy"
    elif seed is not None:
        joints = joint_array(description, seed, "seed")
        expected = f"seed has shape {joints.shape}; expected ({JOINTS},) or {(*batch, JOINTS)}"
        values = _broadcast(redundancy_of(description, joints), batch, expected)
        name = "seed"
    else:
        return None
    if not (np.abs(values) <= EXACT_RANGE).all():
        raise ValueError(f"{name} is not finite or too large; expected at most {EXACT_RANGE:g} rad")
    return values


def _broadcast(values: Array, batch: tuple[int, ...], message: str) -> Array:
    """Return values as a new array of the shape ``batch``."""
    try:
        return np.array(np.broadcast_to(values, batch))
    except ValueError:
        raise ValueError(message) from None


def _at_tried_values(solver: AtRedundancy, T: Array, threads: int) -> IKSolutions:
    """Return each pose's solutions at a value with some inside the limits, or else with some at all."""
    batch = T.shape[:-2]
    poses = T.reshape(-1, 4, 4)
    tried = values_to_try(solver.description)
    first = solver(T, np.full(batch, tried[0]), threads)
    has_some = first.valid.any(axis=-1).ravel()
    posed = first.status_code.ravel() != IKStatus.not_a_pose
    has_allowed = first.allowed.any(axis=-1).ravel() | ~posed
    waiting = np.flatnonzero(~has_allowed)
    if not len(waiting):
        return first
    chosen = np.full(len(poses), tried[0])
    at_once = 1 if isinstance(solver.method, Description) else _TRIED_AT_ONCE
    for begin in range(1, len(tried), at_once):
        values = tried[begin : begin + at_once]
        for some in np.array_split(waiting, -(-len(waiting) // _PREFERRED_TOGETHER)):
            shape = (len(values), len(some))
            repeated = np.broadcast_to(poses[some], (*shape, 4, 4))
            found = solver(repeated, np.broadcast_to(values[:, None], shape), threads)
            is_allowed = found.allowed.any(axis=-1)
            is_some = found.valid.any(axis=-1)
            # The first value that allows a solution, or else the first with any.
            is_better = is_allowed.any(axis=0) | (is_some.any(axis=0) & ~has_some[some])
            first_allowed = is_allowed.argmax(axis=0)
            first_some = is_some.argmax(axis=0)
            place = np.where(is_allowed.any(axis=0), first_allowed, first_some)
            chosen[some[is_better]] = values[place[is_better]]
            has_some[some[is_better]] = True
            has_allowed[some] = is_allowed.any(axis=0)
        waiting = waiting[~has_allowed[waiting]]
        if not len(waiting):
            break
    else:
        _choose_by_iteration(solver.description, poses, chosen, waiting, has_some)
    return solver(T, chosen.reshape(batch), threads)


@dataclass(frozen=True, eq=False)
class _Score:
    """How good joint positions are."""

    of: Callable[[Array], Array]
    """Returns scores (...) of joint positions (..., 7) inside the limits."""
    near: Array | None = None
    """Joint positions near to which angles are wound, shape (7,), rad."""


def _score_of(description: Description, prefer: Preference) -> _Score:
    """Return the score that a preference stands for."""
    aim, posture = checked_preference(description, prefer)
    numbers = description.numbers
    if aim == "limits":
        return _Score(partial(share_of_limits, numbers.lower, numbers.upper))
    if aim == "manipulability":
        return _Score(lambda q: manipulability(description, q, "whole"))
    return _Score(lambda q: -np.sum((q - posture) ** 2, axis=-1), posture)


def _preferred_values(solver: AtRedundancy, T: Array, score: _Score, threads: int) -> Array:
    """Return each pose's value of the best score, shape (...); where no solution is allowed, one with solutions.

    Tried are the 33 values and that of the posture to be near to, and then values between the best one's neighbours.
    """
    batch = T.shape[:-2]
    poses = T.reshape(-1, 4, 4)
    description = solver.description
    tried = values_to_try(description)
    if score.near is not None:
        tried = np.append(tried, redundancy_of(description, score.near))
    lower, upper = redundancy_range(description)
    chosen = np.full(len(poses), np.nan)
    for begin in range(0, len(poses), _PREFERRED_TOGETHER):
        some = slice(begin, begin + _PREFERRED_TOGETHER)
        here = poses[some]
        values = np.broadcast_to(tried[:, None], (len(tried), len(here)))
        best, value = _best_values(solver, here, values, score, threads)
        step = (upper - lower) / _TRIED
        for _ in range(_REFINEMENTS):
            around = np.clip(value + step * _AROUND[:, None], lower, upper)
            # Where nothing is allowed, nothing is refined.
            around = np.where(np.isfinite(best), around, value)
            found, at = _best_values(solver, here, around, score, threads)
            value = np.where(found > best, at, value)
            best = np.maximum(best, found)
            step /= _AROUND.size // 2
        chosen[some] = np.where(np.isfinite(best), value, np.nan)
    open_rows = np.flatnonzero(np.isnan(chosen))
    if len(open_rows):
        chosen[open_rows] = np.asarray(
            _at_tried_values(solver, poses[open_rows], threads).redundancy
        )
    return chosen.reshape(batch)


def _best_values(
    solver: AtRedundancy, poses: Array, values: Array, score: _Score, threads: int
) -> tuple[Array, Array]:
    """Return the best scores of poses (N, 4, 4) at values (V, N), -inf if none is allowed, and their values, (N,)."""
    found = solver(np.broadcast_to(poses, (*values.shape, 4, 4)), np.array(values), threads)
    q = found.within_limits(score.near)
    is_allowed = found.allowed
    scores = np.full(is_allowed.shape, -np.inf)
    scores[is_allowed] = score.of(q[is_allowed])
    of_value = scores.max(axis=-1)
    place = of_value.argmax(axis=0)
    columns = np.arange(len(poses))
    return of_value[place, columns], values[place, columns]


def check_seven(description: Description) -> None:
    """Raise ModelError unless the arm has seven revolute joints."""
    if description.n != JOINTS or description.numbers.prismatic.any():
        words = classify(description).words
        raise ModelError(f"{description.name} is {words}; ik_numeric solves any arm")


def _choose_by_iteration(
    description: Description,
    poses: Array,
    chosen: Array,
    waiting: NDArray[np.intp],
    has_some: NDArray[np.bool_],
) -> None:
    """Set ``chosen`` for poses whose solutions lie between the tried values, from solutions by iteration."""
    for limits in (True, False):
        if not limits:
            waiting = waiting[~has_some[waiting]]
        if not len(waiting):
            return
        found = solve_numerically(description, poses[waiting], restarts=_RESTARTS, limits=limits)
        is_found = found.valid[:, 0]
        chosen[waiting[is_found]] = redundancy_of(description, found.q[is_found, 0])
        has_some[waiting[is_found]] = True
        waiting = waiting[~is_found]


def redundancy_range(description: Description) -> tuple[float, float]:
    """Return the range of the redundancy, rad: the limits of joint 7, or -pi and pi.

    Parameters
    ----------
    description
        The robot; seven revolute joints.
    """
    found = classify(description).redundant
    numbers = description.numbers
    lower = float(numbers.lower[_LAST])
    upper = float(numbers.upper[_LAST])
    is_joint = found is None or found[0].redundancy == LAST_JOINT
    has_limits = is_joint and np.isfinite(lower) and np.isfinite(upper)
    return (lower, upper) if has_limits else _WHOLE_TURN


def values_to_try(description: Description) -> Array:
    """Return redundancies from the middle outward, shape (33,), rad."""
    lower, upper = redundancy_range(description)
    values = np.linspace(lower, upper, _TRIED + 1)
    order = np.argsort(np.abs(values - (lower + upper) / 2), kind="stable")
    return np.asarray(values[order])


def _turned(direction: Array, point: Array, angle: Array) -> Array:
    """Return the motions that turn about an axis by angles (...), shape (..., 4, 4).

    A point x moves to p + R (x - p).
    """
    R = turned_about(direction, angle)
    motion = np.zeros((*np.shape(angle), 4, 4))
    motion[..., :3, :3] = R
    motion[..., :3, 3] = point - R @ point
    motion[..., 3, 3] = 1.0
    return motion
