"""What an arm's joints may do: limits of position, velocity, acceleration, jerk and torque."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.frames import number_array, one_each

__all__ = ["Limits"]


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of n joints, shape (n,) each, infinite where there are none; read-only.

    Raises
    ------
    ValueError
        Other shapes, NaN, a limit that is not positive, or a lower one above the upper one.
    """

    lower: Array
    """rad or m."""
    upper: Array
    velocity: Array
    """Of absolute values, rad/s or m/s."""
    acceleration: Array
    """rad/s^2 or m/s^2."""
    jerk: Array
    """rad/s^3 or m/s^3."""
    torque: Array
    """N m or N."""

    def __post_init__(self) -> None:
        n = np.size(self.lower)
        for item in fields(self):
            array = np.array(number_array(getattr(self, item.name), item.name, f"({n},)"))
            if array.shape != (n,):
                raise ValueError(f"{item.name} has shape {array.shape}; expected ({n},)")
            bounds = item.name in ("lower", "upper")
            wrong = np.isnan(array) if bounds else ~(array > 0)
            if wrong.any():
                i = int(np.flatnonzero(wrong)[0])
                expected = "a number" if bounds else "a positive number, or inf"
                raise ValueError(f"{item.name} of joint {i + 1} is {array[i]:g}; expected {expected}")
            array.flags.writeable = False
            object.__setattr__(self, item.name, array)
        if (self.lower > self.upper).any():
            i = int(np.flatnonzero(self.lower > self.upper)[0])
            raise ValueError(f"lower of joint {i + 1} is {self.lower[i]:g}, above upper, {self.upper[i]:g}")

    @classmethod
    def of(
        cls,
        description: Description,
        *,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        jerk: ArrayLike | None = None,
        torque: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Limits:
        """Return a robot's own limits, some of them replaced: by a number for all joints, or by shape (n,).

        Descriptions limit neither acceleration nor jerk.

        Raises
        ------
        ValueError
            Other shapes, NaN, a limit that is not positive, or a lower one above the upper one.
        TypeError
            Not numbers.

        Examples
        --------
        >>> from dhkit.description import library_robot
        >>> Limits.of(library_robot("planar2r"), acceleration=5).acceleration
        array([5., 5.])
        """
        numbers, anything = description.numbers, np.full(description.n, np.inf)
        own = {
            "lower": numbers.lower,
            "upper": numbers.upper,
            "velocity": numbers.velocity,
            "acceleration": anything,
            "jerk": anything,
            "torque": numbers.effort,
        }
        given = {
            "lower": lower,
            "upper": upper,
            "velocity": velocity,
            "acceleration": acceleration,
            "jerk": jerk,
            "torque": torque,
        }
        n = description.n
        return cls(**{name: own[name] if value is None else one_each(value, name, n) for name, value in given.items()})

    def scaled(
        self, velocity: float = 1.0, acceleration: float = 1.0, jerk: float = 1.0, torque: float = 1.0
    ) -> Limits:
        """Return shares of the limits; those of position stay.

        Raises
        ------
        ValueError
            A share that is not positive.
        """
        return replace(
            self,
            velocity=self.velocity * velocity,
            acceleration=self.acceleration * acceleration,
            jerk=self.jerk * jerk,
            torque=self.torque * torque,
        )

    def __reduce__(self) -> tuple[type[Limits], tuple[Any, ...]]:
        return Limits, tuple(getattr(self, item.name) for item in fields(self))
