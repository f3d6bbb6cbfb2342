"""Solutions of redundant arms, moved along the self-motion to better ones."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array
from dhkit.kernels import Kernel, kernel
from dhkit.kinematics.newton import Newton
from dhkit.kinematics.preference import Aim, Preferred, share_of_limits
from dhkit.kinematics.solutions import wound
from dhkit.symbolic import Loop, table_pattern


def improve_by_self_motion(
    newton: Newton, goals: Array, q: Array, preferred: Preferred, tolerance: float
) -> Array:
    """Return solutions with the same poses and scores that are not worse, shape (N, n), rad and m.

    See :func:`dhkit.kinematics.self_motion_program.self_motion_program`: the ends are local maxima. Angles near a
    posture get the whole turns that bring them nearest to it inside the limits.

    Parameters
    ----------
    newton
        The arm, with the limits that are kept.
    goals
        Poses, shape (N, 16), m.
    q
        Solutions, shape (N, n), rad and m, inside the limits.
    preferred
        What they are improved for.
    tolerance
        Largest error, see :func:`dhkit.kinematics.newton.closes`.
    """
    run, parameters = _kernel(newton, preferred.aim)
    count = len(q)
    better = np.empty_like(q)
    run(
        np.concatenate([parameters, newton.parameters]),
        [
            np.ascontiguousarray(goals),
            np.ascontiguousarray(q),
            np.full((count, 1), tolerance),
            np.tile(preferred.posture, (count, 1)),
        ],
        [better],
    )
    lower = newton.lower
    upper = newton.upper
    is_usable = np.asarray(np.isfinite(better).all(axis=1))
    if preferred.aim == "limits":
        # A smooth score stands for the smallest distance.
        is_usable &= share_of_limits(lower, upper, better) >= share_of_limits(lower, upper, q)
    better = np.where(is_usable[:, None], better, q)
    if preferred.aim == "posture":
        stays = newton.description.numbers.prismatic | ~np.isfinite(upper - lower)
        better = wound(better, preferred.posture, lower, upper, stays)
    return better


def _kernel(newton: Newton, aim: Aim) -> tuple[Kernel, Array]:
    """Return the kernel, and the first of its parameters: those of the arm's table."""
    description = newton.description
    size = newton.size
    rank = newton.freedoms

    def derived() -> Loop:
        from dhkit.kinematics.self_motion_program import self_motion_program

        return self_motion_program(description, size, aim, rank)

    pattern, parameters = table_pattern(description)
    key = f"{size} {aim} {rank} {pattern}"
    return kernel("self_motion", key, derived, is_loop=True), parameters
