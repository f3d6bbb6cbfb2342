"""Motions as a page plays them: joint values over time, sampled densely enough that the eye sees no steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control import SimulationResult
from dhkit.description import Array, Description
from dhkit.description.frames import joint_array
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory

Motion = Trajectory | SimulationResult | tuple[ArrayLike, ArrayLike]
"""A motion that can be played; the last kind is times, shape (N,), s, and joint values, shape (N, n), rad and m."""

_FRAME_RATE = 60.0
"""Frames per second of a page, Hz: the rate of most screens."""
MIN_FRAMES = 121
"""Least number of frames of a motion, for slow motion."""
MAX_FRAMES = 6001
"""Largest number of frames of a motion: 2.5 MB for a 6-axis arm and 2.3 MB more for its ghost."""


class PlayedMotion(NamedTuple):
    """A motion at the times of a page's frames.

    Attributes
    ----------
    times
        Times, shape (N,), s, at equal steps from 0.
    q
        Joint values, shape (N, n), rad and m.
    reference_q
        Joint values of the reference that a simulation follows, shape (N, n), rad and m; None for other motions.
    """

    times: Array
    q: Array
    reference_q: Array | None


def played_motion(description: Description, motion: Motion) -> PlayedMotion:
    """Return a motion of an arm as a page plays it.

    Raises
    ------
    ValueError
        Times or joint values have other shapes, are fewer than two or not finite, or times do not increase.
    TypeError
        Times or joint values are not numbers.
    DescriptionError
        The motion is another robot's.
    """
    if isinstance(motion, Trajectory):
        motion.require(description)
        times = _frame_times(motion.duration)
        return PlayedMotion(times, motion.q(times), None)
    if isinstance(motion, SimulationResult):
        simulated = motion.description  # may carry a payload, or differ in its parameters
        same = simulated.digest == description.digest
        if not same and (simulated.name, simulated.kinds) != (description.name, description.kinds):
            raise DescriptionError(
                f"the simulation is one of {simulated.name} ({simulated.digest}); expected one of {description.name}"
                f" ({description.digest})"
            )
        times, q = resample(*check_motion(description, motion.t, motion.q))
        _, reference_q = resample(*check_motion(description, motion.t, motion.reference_q))
        return PlayedMotion(times, q, reference_q)
    return PlayedMotion(*resample(*check_motion(description, *motion)), None)


def check_motion(description: Description, times: ArrayLike, q: ArrayLike) -> tuple[Array, Array]:
    """Return a motion as arrays: times, shape (N,), s, and joint values, shape (N, n), rad and m.

    Raises
    ------
    ValueError
        Times or joint values have other shapes, are fewer than two or not finite, or times do not increase.
    TypeError
        Times or joint values are not numbers.
    """
    t = np.asarray(times, dtype=float)
    q = joint_array(description, q)
    if t.ndim != 1 or len(t) < 2:
        raise ValueError(f"times has shape {t.shape}; expected (N,) with N >= 2")
    if q.shape != (len(t), description.n):
        raise ValueError(
            f"q has shape {q.shape}; expected ({len(t)}, {description.n}) for {len(t)} times"
        )
    for name, array in (("times", t), ("q", q)):
        rows = np.argwhere(~np.isfinite(array))
        if len(rows):
            raise ValueError(
                f"{name} has values that are not finite, the first in row {rows[0, 0]}"
            )
    steps_back = np.flatnonzero(np.diff(t) <= 0)
    if len(steps_back):
        k = int(steps_back[0])
        raise ValueError(
            f"times do not increase: times[{k}] is {t[k]:g} s, times[{k + 1}] is {t[k + 1]:g} s"
        )
    return t, q


def resample(times: Array, q: Array) -> tuple[Array, Array]:
    """Return a motion at the times of a page's frames, which begin at 0.

    Joint values are interpolated here, and not poses in the page: an arm given by few samples keeps its lengths.

    Parameters
    ----------
    times, q
        Times, shape (N,), s, increasing, and joint values, shape (N, n), rad and m.
    """
    frames = _frame_times(float(times[-1] - times[0]))
    return frames, interpolate(times, q, times[0] + frames)


def interpolate(times: Array, rows: Array, at: Array) -> Array:
    """Return rows, linear between the given ones, shape (M, n).

    Parameters
    ----------
    times
        Times of the given rows, shape (N,), increasing.
    rows
        The given rows, shape (N, n).
    at
        Times of the rows to return, shape (M,).
    """
    return np.stack([np.interp(at, times, column) for column in rows.T], axis=1)


def _frame_times(duration: float) -> Array:
    """Return the times of a page's frames, shape (N,), s, from 0 to a duration, s."""
    return np.linspace(
        0.0, duration, int(np.clip(np.ceil(_FRAME_RATE * duration) + 1, MIN_FRAMES, MAX_FRAMES))
    )


def exceeded_limit(description: Description, q: Array, qd: Array, tau: Array | None) -> str | None:
    """Return the limit that a motion exceeds most, in words; None if it keeps all limits.

    Parameters
    ----------
    description
        The arm.
    q, qd
        Joint values, shape (N, n), rad and m, and their rates, rad/s and m/s.
    tau
        Torques, shape (N, n), N m and N; None if they are not known.
    """
    numbers = description.numbers
    shares = {
        "speed": np.abs(qd).max(axis=0) / numbers.velocity,
        "range": np.maximum(q - numbers.upper, numbers.lower - q).max(axis=0) + 1.0,
    }
    if tau is not None:
        shares["torque"] = np.abs(tau).max(axis=0) / numbers.effort
    share, name, joint = max(
        (float(np.max(share)), name, int(np.argmax(share))) for name, share in shares.items()
    )
    if share <= 1 + 1e-6:
        return None
    joint_name = description.joints[joint].name
    if name == "range":
        return f"{joint_name} leaves its range"
    return f"the {name} of {joint_name} is {100 * share:.0f} % of its limit"
