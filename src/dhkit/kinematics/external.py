"""Inverse kinematics of arms without a closed form of ours, by the package ssik (Srinivasa), which is optional."""

from __future__ import annotations

import logging
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description
from dhkit.errors import ModelError, from_checkout
from dhkit.kernels import pose_rows
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.candidates import are_poses, collect, orthonormal
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.family import ALL_COORDINATES
from dhkit.kinematics.manipulability import freedoms
from dhkit.kinematics.numeric import refined, solve_numerically
from dhkit.kinematics.solutions import IKSolutions

log = logging.getLogger(__name__)

_RESTARTED_JOINTS = 6
"""Number of joints of arms with finitely many solutions."""
_STARTS = 32
_MAX_ROUNDS = 8
"""Number of random starts in a round of iterations, and largest number of rounds."""
_CLOSES = 1e-11
"""Error to which a solution closes that iteration finds: share of the reach, and rad."""
_SAME_SOLUTION = 1e-5
"""Solutions that differ by less, rad, are one: near singularities iterations end that far apart."""
SAME_ANGLE = 1e-6
"""Angles that differ by less, rad, count as equal when solutions are sorted."""


def solve_externally(description: Description, T: ArrayLike) -> IKSolutions:
    """Return the solutions of T_world_tool(q) = T that ssik finds, polished and checked by our own kinematics.

    Of arms of six joints ssik misses some now and then: iterations from random starts add what they find, until a round
    of them finds nothing new. That proves nothing: ``complete`` is False. An arm of seven joints has infinitely many
    solutions, in curves; ssik returns points of them, by the defaults of its solver for the arm: up to eight or so for
    each of sixteen values of the redundant coordinate, or a few values in each interval where there is a solution (as
    for the Panda). The first call for an arm prepares a solver, which takes up to a minute for arms of six joints
    without any special geometry; ssik keeps what it derived in a cache of its own. A pose takes milliseconds.

    Parameters
    ----------
    description
        The robot; six or seven revolute joints.
    T
        Poses of the tool in the world, shape (..., 4, 4).

    Returns
    -------
    IKSolutions
        Branches ``"solution 1"`` ... ``"solution B"``, B the largest number found for a pose of the batch and at least
        1. They are ordered by their joint values, the first joint's first: the same number at another pose need not
        be the same way to reach. Singular branches are not flagged. Where nothing was found, the status is
        ``not_found``, or ``out_of_reach`` where all links in one line are too short, and ``distance`` is NaN.

    Raises
    ------
    ModelError
        The arm has prismatic joints, or not six or seven, or ssik is not installed. An arm that ssik refuses is solved
        by iteration alone.
    ValueError, TypeError
        T has not shape (..., 4, 4), or is not numeric.
    """
    poses = pose_rows(T)
    solver = _solver(description)
    posed = are_poses(poses)
    goals = orthonormal(poses[posed])
    n = description.n
    if solver is None:
        found = [np.empty((0, n)) for _ in goals]
    else:
        found = [_solutions(solver, goal, n) for goal in goals @ _tool_axes(description)]
    counts = np.array([len(q) for q in found], dtype=int)
    owner = np.repeat(np.flatnonzero(posed), counts)
    q = np.concatenate([np.empty((0, n)), *found])
    q, closed = refined(description, q, np.repeat(goals.reshape(-1, 16), counts, axis=0))
    q = q[closed]
    owner = owner[closed]
    if n == _RESTARTED_JOINTS or solver is None:
        q, owner = _with_restarts(
            description, poses.reshape(-1, 4, 4), np.flatnonzero(posed), q, owner
        )
    table = _ordered(q, owner, posed.size)
    B = table.shape[1]
    return collect(
        description,
        table.reshape(*poses.shape[:-2], B, n),
        np.full(posed.shape, np.nan),
        positions=poses[..., :3, 3],
        posed=posed,
        branches=tuple(f"solution {k + 1}" for k in range(B)),
        met=ALL_COORDINATES,
        complete=False,
    )


def _with_restarts(
    description: Description,
    poses: Array,
    rows: NDArray[np.intp],
    q: Array,
    owner: NDArray[np.intp],
) -> tuple[Array, NDArray[np.intp]]:
    """Return solutions (K, n) and the poses that they belong to, with those that iteration finds from random starts.

    Parameters
    ----------
    poses, rows
        Poses of the tool, shape (N, 4, 4), m, and which of them are poses.
    q, owner
        Solutions, shape (K, n), and the indices of their poses, shape (K,).
    """
    rng = np.random.default_rng(0)
    # Infinitely many solutions: one is enough.
    has_curves = freedoms(description, "whole") < description.n
    waiting = rows
    for _ in range(_MAX_ROUNDS):
        if has_curves:
            waiting = np.setdiff1d(waiting, owner)
        if not len(waiting):
            break
        of_start = np.repeat(waiting, _STARTS)
        starts = rng.uniform(-np.pi, np.pi, (len(of_start), description.n))
        found = solve_numerically(
            description, poses[of_start], starts, restarts=0, tolerance=_CLOSES, limits=False
        )
        reached = found.valid[:, 0]
        before = np.bincount(owner, minlength=len(poses))
        q, owner = _distinct(
            np.concatenate([q, found.q[reached, 0]]), np.concatenate([owner, of_start[reached]])
        )
        waiting = waiting[np.bincount(owner, minlength=len(poses))[waiting] > before[waiting]]
    return q, owner


def _distinct(q: Array, owner: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
    """Return solutions (K, n) without those that an earlier one of the same pose equals, and their poses (K,)."""
    kept = np.ones(len(q), dtype=bool)
    order = np.argsort(owner, kind="stable")
    for places in np.split(order, np.flatnonzero(np.diff(owner[order])) + 1):
        # arg e^(i d) is the difference d of two angles the short way round, in (-pi, pi].
        turns = np.abs(np.angle(np.exp(1j * (q[places, None] - q[places])))).max(axis=-1)
        kept[places] = ~np.any(np.tril(turns < _SAME_SOLUTION, k=-1), axis=1)
    return q[kept], owner[kept]


@lru_cache(maxsize=64)
def _solver(description: Description) -> Any:
    """Return ssik's ``Manipulator`` for an arm, prepared; None if it refuses the arm."""
    words = f"{description.name} is {classify(description).words}"
    if description.numbers.prismatic.any() or description.n not in (6, 7):
        raise ModelError(f"{words}; ik_numeric solves any arm")
    try:
        import ssik
    except ImportError:
        message = f"{words}; {from_checkout('ik')} brings ssik, which finds its solutions; ik_numeric solves any arm"
        raise ModelError(message) from None
    log.info("preparing ssik for %s, which may take a minute the first time", description.name)
    axes = Axes.of(description)
    # ssik's P: from the world to the first axis, from axis to axis, and to the tool; its H: the axes' directions.
    offsets = np.diff(axes.points, axis=0, prepend=0.0, append=axes.T_world_tool[None, :3, 3])
    try:
        solver = ssik.Manipulator.from_axes(axes.directions, offsets)
        solver.prepare()
    except (ValueError, ArithmeticError, NotImplementedError, np.linalg.LinAlgError) as error:
        log.info(
            "ssik refuses %s, which is solved by iteration: %s", description.name, str(error)[:200]
        )
        return None
    return solver


def _tool_axes(description: Description) -> Array:
    """Return the transform, shape (4, 4), from our tool to ssik's, whose axes at q = 0 are the world's."""
    turn = np.eye(4)
    turn[:3, :3] = Axes.of(description).T_world_tool[:3, :3].T
    return turn


def _solutions(solver: Any, goal: Array, n: int) -> Array:
    """Return ssik's solutions for one pose, inside limits or not, shape (K, n), rad."""
    try:
        with np.errstate(all="ignore"):
            found = solver.solve(goal, respect_limits=False)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        log.warning("ssik failed at a pose, which counts as not reached: %s", error)
        found = []
    return np.array([solution.q for solution in found], dtype=float).reshape(-1, n)


def _ordered(q: Array, owner: NDArray[np.intp], poses: int) -> Array:
    """Return solutions (K, n) sorted by the poses that they belong to, shape (poses, B, n), filled up with NaN."""
    counts = np.bincount(owner, minlength=poses)
    order = np.lexsort([*np.rint(q.T / SAME_ANGLE)[::-1], owner])
    place = np.arange(len(q)) - np.repeat(np.cumsum(counts) - counts, counts)
    table = np.full((poses, max(1, int(counts.max(initial=0))), q.shape[1]), np.nan)
    table[owner[order], place] = q[order]
    return table
