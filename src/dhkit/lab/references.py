"""What a run of the control panel follows."""

from __future__ import annotations

import numpy as np

from dhkit.arm import Arm
from dhkit.control import Sine
from dhkit.description import Array
from dhkit.trajectories import Trajectory

AMPLITUDE, FREQUENCY = 0.3, 0.25
"""Of a sine: rad (and shares of the reach) from end to end, less where limits are near; and Hz."""
ROOM = 0.9
"""Share of the way to a limit that a sine takes at most."""
REST = 1.0
"""s that a motion is held at either end."""


def back_and_forth(motion: Trajectory, t: float, free: list[int]) -> tuple[Array, Array, Array]:
    """Return the free joints' values, velocities and accelerations, shape (k,) each, of a motion that is repeated.

    It is held at its end, goes back the same way, is held again, and begins anew.
    """
    period = 2 * (motion.duration + REST)
    s = t % period
    back = s >= period / 2
    if back:
        s -= period / 2
    rests = s >= motion.duration
    at = min(s, motion.duration)
    at = motion.duration - at if back else at
    still = np.zeros(len(free))
    if rests:
        return motion.q(at)[free], still, still
    sign = -1.0 if back else 1.0
    return motion.q(at)[free], sign * motion.qd(at)[free], motion.qdd(at)[free]


def gentle_sine(arm: Arm, held: Array, free: list[int]) -> Sine:
    """Return a sine of the free joints that begins at rest, to the side on which there is more room."""
    numbers = arm.description.numbers
    size = np.where(numbers.prismatic, AMPLITUDE * arm.description.reach, AMPLITUDE)[free]
    above, below = numbers.upper[free] - held, held - numbers.lower[free]
    up = np.clip(np.where(above >= np.minimum(size, below), np.minimum(size, ROOM * above), 0.0), 0.0, None)
    down = np.clip(np.minimum(size, ROOM * below), 0.0, None)
    way = np.where(up > 0, up, -down) / 2
    return Sine(held + way, way, FREQUENCY, -np.pi / 2)
