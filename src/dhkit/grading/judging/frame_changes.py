"""Changes of frames and joint variables between two tables of one arm."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from dhkit.description import Array

SAME = 1e-9
"""Largest difference of poses of one arm in two tables, in rad and relative to the reach, at every tried state."""


class Change(Enum):
    """Kind of a change, with the text that a report prints."""

    Z_REVERSED = "frame {number}'s z axis points the other way"
    Z_ELSEWHERE = (
        "frame {number}'s z axis points elsewhere: along {vector} of the file's frame {number}"
    )
    X_REVERSED = "frame {number}'s x axis points the other way"
    X_TURNED = "frame {number}'s x axis is another: turned by {first:.6g} degrees about z"
    X_ELSEWHERE = "frame {number}'s x axis is another: along {vector}"
    ORIGIN_ELSEWHERE = (
        "frame {number}'s origin is elsewhere: at {vector} m in the file's frame {number}"
    )
    FRAME_SLID = "frame {number} is slid along its z axis, by {first:.6g} m"
    JOINT_REVERSED = "q{number} is counted the other way round"
    JOINT_HALF_TURN = "q{number} is counted from the other end: by 180 degrees"
    JOINT_TURNED = (
        "q{number} is counted from another zero: there the file's q{number} is {first:.6g} degrees"
    )
    JOINT_SLID = (
        "q{number} is counted from another zero: there the file's q{number} is {first:.6g} m"
    )

    @property
    def concerns_joint(self) -> bool:
        """Whether the change is one of a joint variable, and not of a frame."""
        return self in (
            Change.JOINT_REVERSED,
            Change.JOINT_HALF_TURN,
            Change.JOINT_TURNED,
            Change.JOINT_SLID,
        )


@dataclass(frozen=True)
class FrameChange:
    """Choice of a frame or joint variable that is not the file's.

    Attributes
    ----------
    change
        Kind of the change.
    number
        Number of the frame, from 0, or of the joint, from 1.
    values
        Size of the change, m or degrees; three numbers for a direction or a point, m.
    """

    change: Change
    number: int
    values: tuple[float, ...] = ()

    def __str__(self) -> str:
        """Return the text of the change."""
        vector = "(" + ", ".join(f"{x:.4g}" for x in self.values) + ")"
        first = self.values[0] if self.values else 0.0
        return self.change.value.format(number=self.number, vector=vector, first=first)


def frame_changes(i: int, D: Array, tolerance: float) -> Iterator[FrameChange]:
    """Yield the changes of frame i; D is its pose in the file's frame i, shape (4, 4), m.

    Lengths that differ by no more than the tolerance, m, are equal.
    """
    # The z axis (0, 0, +-1).
    if abs(abs(D[2, 2]) - 1) > SAME:
        yield FrameChange(Change.Z_ELSEWHERE, i, _vector(D[:3, 2]))
    elif D[2, 2] < 0:
        yield FrameChange(Change.Z_REVERSED, i)

    # The x axis (cos, sin, 0) of an angle about z.
    angle = float(np.arctan2(D[1, 0], D[0, 0])) if abs(D[2, 0]) < SAME else np.nan
    if abs(abs(angle) - np.pi) < SAME:
        yield FrameChange(Change.X_REVERSED, i)
    elif np.isnan(angle):
        yield FrameChange(Change.X_ELSEWHERE, i, _vector(D[:3, 0]))
    elif not abs(angle) < SAME:
        yield FrameChange(Change.X_TURNED, i, (float(np.degrees(angle)),))

    # The origin.
    if np.max(np.abs(D[:2, 3])) > tolerance:
        yield FrameChange(Change.ORIGIN_ELSEWHERE, i, _vector(D[:3, 3]))
    elif abs(D[2, 3]) > tolerance:
        yield FrameChange(Change.FRAME_SLID, i, (float(D[2, 3]),))


def joint_changes(
    i: int, is_revolute: bool, sense: float, offset: float, tolerance: float
) -> Iterator[FrameChange]:
    """Yield the changes of joint i, from 1.

    Parameters
    ----------
    i
        Number of the joint, from 1.
    is_revolute
        Whether the joint is revolute.
    sense
        +1, or -1 for a variable of the opposite sign.
    offset
        The file's joint value at the answer's zero, rad or m.
    tolerance
        Largest difference of equal lengths, m.
    """
    if sense < 0:
        yield FrameChange(Change.JOINT_REVERSED, i)
    if not is_revolute:
        if abs(offset) > tolerance:
            yield FrameChange(Change.JOINT_SLID, i, (float(offset),))
        return
    angle = wrapped(offset)
    if abs(abs(angle) - np.pi) < SAME:
        yield FrameChange(Change.JOINT_HALF_TURN, i)
    elif abs(angle) > SAME:
        yield FrameChange(Change.JOINT_TURNED, i, (float(np.degrees(angle)),))


def wrapped(angle: float) -> float:
    """Return an angle in (-pi, pi]."""
    return float(np.arctan2(np.sin(angle), np.cos(angle)))


def _vector(vector: Array) -> tuple[float, ...]:
    """Return the entries of a vector (3,), with 0 for entries that are rounding errors."""
    return tuple(float(x) + 0.0 for x in np.where(np.abs(vector) < SAME, 0.0, vector))
