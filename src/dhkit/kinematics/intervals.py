"""Intervals of the redundancy in which an arm of seven joints reaches a pose inside its limits.

With a closed form at a given redundancy they end at roots of equations in the redundancy, see
:mod:`dhkit.kinematics.arm_angle_program` and :mod:`dhkit.kinematics.joint_7_program`. For other arms, and without
limits, the redundancy is sampled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description, takes_robot
from dhkit.kernels import pose_rows
from dhkit.kinematics.candidates import are_poses
from dhkit.kinematics.redundant import AtRedundancy, check_seven, values_to_try
from dhkit.kinematics.root_intervals import intervals_by_roots
from dhkit.kinematics.turn_parts import BEYOND, KNOWN

_ANSWERED = (KNOWN, BEYOND)
"""States of intervals by roots that have a meaning."""
_STEP = np.pi / 360
_ACCURACY = 1e-9
"""Steps in which intervals of the redundancy are looked for, and accuracy of their ends, rad."""
_DIVISIONS = 16
"""Parts into which the place of an end is divided again and again: a call takes about as long as 100 values in it."""


@takes_robot
def redundancy_intervals(
    description: Description, T: ArrayLike, *, limits: bool = True
) -> list[tuple[float, float]]:
    """Return the intervals of the redundancy in which an arm of seven joints reaches a pose.

    Of an arm with a closed form at a given redundancy their ends are roots of equations. Those of an arm angle are
    known to rounding, those of joint 7 to 1e-9 rad (99 of 100), or 1e-4 rad where roots nearly coincide. An interval
    narrower than 3e-6 rad may be missing.

    For other arms, and without limits, the redundancy is tried at steps of half a degree, and the ends are found to
    1e-9 rad: an interval that is narrower than a step may be missing. So is an arm angle where the arm is stretched
    along axis 1, or axis 7, so that joints 1 and 3, or 5 and 7, turn about one line at every angle; and joint 7 where
    the equations are not known well, at a few poses in a thousand. There the middles of the intervals that these
    equations give are tried as well.

    Parameters
    ----------
    description
        The robot; seven revolute joints.
    T
        Pose of the tool in the world, shape (4, 4), m.
    limits
        Whether all joints must be inside their limits.

    Returns
    -------
    list[tuple[float, float]]
        Beginning and end of each interval, rad, in ascending order; of an arm angle in [-pi, pi], where one that goes
        through pi is in two parts.

    Raises
    ------
    ModelError, ValueError, TypeError
        As for :func:`solve_redundant`; T has not shape (4, 4).

    Examples
    --------
    >>> from dhkit.description import library_robot, world_to_tool
    >>> panda = library_robot("panda")
    >>> T = world_to_tool(panda, [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    >>> [(round(begin, 3), round(end, 3)) for begin, end in redundancy_intervals(panda, T)]
    [(-0.684, 2.254)]
    """
    by_roots = intervals_by_roots(description) if limits else None
    found = None if by_roots is None else by_roots(T)
    if found is not None and found[0] in _ANSWERED:
        return found[1]
    pose = pose_rows(T)
    if pose.ndim != 2:
        raise ValueError(f"T has shape {pose.shape}; expected (4, 4)")
    if not are_poses(pose):
        raise ValueError("T is not a pose; expected a finite position and an orthonormal rotation")
    check_seven(description)
    if by_roots is not None and found is None:
        found = by_roots.interpreted(pose)
        if found[0] in _ANSWERED:
            return found[1]
    middles = [] if found is None else [(begin + end) / 2 for begin, end in found[1]]
    solver = AtRedundancy.of(description)

    def is_reached(values: Array) -> NDArray[np.bool_]:
        found = solver(np.broadcast_to(pose, (len(values), 4, 4)), values)
        usable = found.allowed if limits else found.valid
        return np.asarray(usable.any(axis=-1))

    return _sampled(is_reached, values_to_try(description), middles)


def _sampled(
    is_reached: Callable[[Array], NDArray[np.bool_]], tried: Array, middles: Sequence[float]
) -> list[tuple[float, float]]:
    """Return the intervals between the least and the largest of ``tried`` by samples, and their ends by bisection.

    Parameters
    ----------
    is_reached
        Returns at which values, shape (N,), the pose is reached.
    tried
        Values, rad.
    middles
        Further values that are tried.
    """
    tried = np.sort(tried)
    count = int(np.ceil((tried[-1] - tried[0]) / _STEP)) + 1
    grid = np.union1d(np.linspace(tried[0], tried[-1], count), middles)
    inside = is_reached(grid)
    change = np.flatnonzero(inside[1:] != inside[:-1])
    within = np.where(inside[change], grid[change], grid[change + 1])
    beyond = np.where(inside[change], grid[change + 1], grid[change])
    shares = np.arange(_DIVISIONS + 1) / _DIVISIONS
    while len(change) and np.abs(within - beyond).max() > _ACCURACY:
        places = within[:, None] + (beyond - within)[:, None] * shares
        reached = np.ones(places.shape, dtype=bool)
        reached[:, 1:-1] = is_reached(places[:, 1:-1].ravel()).reshape(len(change), -1)
        reached[:, -1] = False
        # The first place that is not reached, and the one before it.
        first = reached.argmin(axis=1)
        rows = np.arange(len(change))
        within = places[rows, first - 1]
        beyond = places[rows, first]

    ends = [*grid[:1][inside[:1]], *within, *grid[-1:][inside[-1:]]]
    return [(float(a), float(b)) for a, b in zip(ends[::2], ends[1::2], strict=True)]
