"""The second check of a motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dhkit.description import Description, Payload
from dhkit.planning.second_check.distances import DrawnArm
from dhkit.planning.second_check.instants import dense, time_of
from dhkit.planning.second_check.joints import exceeded_limits, jumps
from dhkit.planning.second_check.result import Claim, Recheck, Refutation
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits, Trajectory

TURN = 0.02
"""Largest turn of a joint between two states, rad; for prismatic joints, m."""


def recheck(
    description: Description,
    motion: Trajectory,
    limits: Limits,
    payload: Payload | None = None,
    friction: Friction | None = None,
    claims: Sequence[Claim] = (),
) -> Recheck:
    """Search a motion for limits that it exceeds, and for distances that are smaller than claimed.

    Parameters
    ----------
    description
        The robot, without its payload.
    motion
        The motion.
    limits
        Limits of position, velocity, acceleration, jerk and torque.
    payload, friction
        Payload and friction that the torques include.
    claims
        Distances that are claimed.

    Raises
    ------
    ModelError
        Pinocchio is not installed, or a mesh cannot be read.
    """
    instants = dense(motion, TURN)
    refutations = [
        *jumps(motion),
        *exceeded_limits(description, motion, instants, limits, payload, friction),
    ]
    smallest = np.inf
    if claims:
        drawn = DrawnArm(description, motion)
        for claim in claims:
            gap, instant = drawn.smallest(claim)
            smallest = min(smallest, gap)
            if gap < claim.refuting:
                refutations.append(
                    Refutation(str(claim), gap, claim.kept, time_of(motion, instant), "m")
                )
    return Recheck(len(instants), smallest, tuple(refutations))
