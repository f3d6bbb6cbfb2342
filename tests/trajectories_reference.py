"""Random motions, and torques by Pinocchio for them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from dhkit.model import pinocchio_model
from dhkit.trajectories import Trajectory


def random_motion(arm, pieces=4, degree=5, seed=0, duration=2.0):
    """Return a motion whose values jump at its breaks."""
    rng = np.random.default_rng(seed)
    breaks = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, pieces))])
    return Trajectory(
        arm, duration * breaks / breaks[-1], rng.uniform(-1, 1, (pieces, degree + 1, arm.n))
    )


def continuous_motion(arm, pieces=4, degree=5, seed=0, duration=2.0):
    """Return a motion whose accelerations jump at its breaks, and whose values and speeds do not."""
    motion = random_motion(arm, pieces, degree, seed, duration)
    coefficients = motion.coefficients.copy()
    for k, h in enumerate(np.diff(motion.breaks)[:-1]):
        powers = h ** np.arange(degree + 1)
        coefficients[k + 1, 0] = powers @ coefficients[k]
        coefficients[k + 1, 1] = (np.arange(1, degree + 1) * powers[:-1]) @ coefficients[k, 1:]
    return Trajectory(arm, motion.breaks, coefficients)


def reference_torques(arm):
    """Return a function of q, qd and qdd, shape (N, n) each: torques by Pinocchio's rnea."""
    model = pinocchio_model(arm)
    data = model.createData()

    def torques(q, qd, qdd):
        rows = zip(*(np.reshape(x, (-1, arm.n)) for x in (q, qd, qdd)), strict=True)
        return np.array([np.array(pin.rnea(model, data, *row)) for row in rows]).reshape(
            np.shape(q)
        )

    return torques
