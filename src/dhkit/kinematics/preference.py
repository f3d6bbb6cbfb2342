"""What the redundancy of an arm is chosen for."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_vector

Preference: TypeAlias = 'Literal["limits", "manipulability"] | ArrayLike'
"""Far from the limits, manipulability, or joint positions to be near to, shape (n,), rad and m, or their name."""
Aim: TypeAlias = Literal["limits", "manipulability", "posture"]


class Preferred(NamedTuple):
    """A preference that was checked."""

    aim: Aim
    posture: Array
    """Joint positions to be near to, shape (n,), rad and m; zeros for other aims."""


def checked_preference(description: Description, prefer: Preference) -> Preferred:
    """Return a preference as an aim and a posture.

    Parameters
    ----------
    description
        The robot.
    prefer
        ``"limits"``, ``"manipulability"``, joint positions (n,) or the name of a configuration.

    Raises
    ------
    ValueError, TypeError
        Another name, or joint positions that do not fit.
    """
    if isinstance(prefer, str):
        if prefer == "limits":
            return Preferred("limits", np.zeros(description.n))
        if prefer == "manipulability":
            return Preferred("manipulability", np.zeros(description.n))
        if prefer not in description.configurations:
            raise ValueError(
                f"prefer is {prefer!r}; expected 'limits', 'manipulability', joint positions or a configuration"
            )
    return Preferred("posture", joint_vector(description, prefer, "prefer"))


def share_of_limits(lower: Array, upper: Array, q: Array) -> Array:
    """Return the smallest distance of joint positions (..., n) from a limit, as a share of half the joint's range.

    Joints without limits, and those that cannot move, do not count.
    """
    has_limits = np.isfinite(upper - lower) & (upper > lower)
    begin = lower[has_limits]
    end = upper[has_limits]
    with_limits = q[..., has_limits]
    shares = np.minimum(with_limits - begin, end - with_limits) / ((end - begin) / 2)
    smallest: Array = shares.min(axis=-1, initial=1.0)
    return smallest
