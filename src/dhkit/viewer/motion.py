"""A motion as a page plays it: joint vectors over time, sampled densely enough that the eye sees no steps."""

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
"""What can be played: the last are times (N,), s, and joint values (N, n), rad and m."""

RATE = 60.0
"""Frames a second: what a screen shows."""
MIN_FRAMES, MAX_FRAMES = 121, 6001
"""At least so many, for slow motion; at most so many, 2.5 MB for a 6-axis arm, and 2.3 MB more for its ghost."""


class PlayedMotion(NamedTuple):
    """A motion at the times of a page's frames."""

    times: Array
    """Shape (N,), s, at equal steps from 0."""
    q: Array
    """Shape (N, n), rad and m."""
    reference_q: Array | None
    """What was to be followed, shape (N, n), rad and m; None for a motion that follows nothing."""


def played_motion(description: Description, motion: Motion) -> PlayedMotion:
    """Return a motion of an arm as a page plays it.

    Raises
    ------
    ValueError
        Times or joint values of other shapes, fewer than two of them, values that are not finite, or times that do
        not increase.
    TypeError
        Not numbers.
    DescriptionError
        A motion of another robot.
    """
    if isinstance(motion, Trajectory):
        motion.require(description)
        times = frame_times(motion.duration)
        return PlayedMotion(times, motion.q(times), None)
    if isinstance(motion, SimulationResult):
        _require_same_arm(description, motion.description)
        times, q = sampled(*check_motion(description, motion.t, motion.q))
        _, reference_q = sampled(*check_motion(description, motion.t, motion.reference_q))
        return PlayedMotion(times, q, reference_q)
    return PlayedMotion(*sampled(*check_motion(description, *motion)), None)


def _require_same_arm(description: Description, simulated: Description) -> None:
    """Refuse another robot; the arm that was simulated may carry a payload or differ in its parameters."""
    same = simulated.digest == description.digest
    if not same and (simulated.name, simulated.kinds) != (description.name, description.kinds):
        raise DescriptionError(
            f"the simulation is one of {simulated.name} ({simulated.digest}); expected one of {description.name}"
            f" ({description.digest})"
        )


def check_motion(description: Description, times: ArrayLike, q: ArrayLike) -> tuple[Array, Array]:
    """Return a motion as arrays, times (N,), s, and joint values (N, n), rad and m.

    Raises
    ------
    ValueError
        Other shapes, fewer than two samples, values that are not finite, or times that do not increase.
    TypeError
        Not numbers.
    """
    t, q = np.asarray(times, dtype=float), joint_array(description, q)
    if t.ndim != 1 or len(t) < 2:
        raise ValueError(f"times has shape {t.shape}; expected (N,) with N >= 2")
    if q.shape != (len(t), description.n):
        raise ValueError(f"q has shape {q.shape}; expected ({len(t)}, {description.n}) for {len(t)} times")
    for name, array in (("times", t), ("q", q)):
        if not np.isfinite(array).all():
            raise ValueError(f"{name} has values that are not finite, the first in row {_first(~np.isfinite(array))}")
    if (np.diff(t) <= 0).any():
        k = _first(np.diff(t) <= 0)
        raise ValueError(f"times do not increase: times[{k}] is {t[k]:g} s, times[{k + 1}] is {t[k + 1]:g} s")
    return t, q


def sampled(times: Array, q: Array) -> tuple[Array, Array]:
    """Return a motion at equal time steps from 0, joint values linear between the given ones.

    Joints are interpolated here and not poses in the page, so that an arm given by few samples keeps its lengths.

    Parameters
    ----------
    times, q
        Shapes (N,), s, increasing, and (N, n), rad and m.
    """
    frames = frame_times(float(times[-1] - times[0]))
    grid = times[0] + frames
    return frames, np.stack([np.interp(grid, times, column) for column in q.T], axis=1)


def frame_times(duration: float) -> Array:
    """Return the times of a page's frames from 0 to a duration, shape (N,), s."""
    return np.linspace(0.0, duration, int(np.clip(np.ceil(RATE * duration) + 1, MIN_FRAMES, MAX_FRAMES)))


def exceeded_limit(description: Description, q: Array, qd: Array, tau: Array | None) -> str | None:
    """Return the limit that is exceeded most by samples, shape (N, n) each, in words, or None."""
    numbers = description.numbers
    shares = {
        "speed": np.abs(qd).max(axis=0) / numbers.velocity,
        "range": np.maximum(q - numbers.upper, numbers.lower - q).max(axis=0) + 1.0,
    }
    if tau is not None:
        shares["torque"] = np.abs(tau).max(axis=0) / numbers.effort
    worst = max(((float(np.max(share)), name, int(np.argmax(share))) for name, share in shares.items()))
    share, name, joint = worst
    if share <= 1 + 1e-6:
        return None
    who = description.joints[joint].name
    if name == "range":
        return f"{who} leaves its range"
    return f"the {name} of {who} is {100 * share:.0f} % of its limit"


def _first(wrong: np.ndarray) -> int:
    return int(np.argwhere(wrong)[0, 0])
