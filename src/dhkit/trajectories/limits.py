"""Limits of joint position, velocity, acceleration, jerk and torque."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, Robot, description_of
from dhkit.description.arrays import number_array
from dhkit.description.frames import one_each
from dhkit.display import counted, html_table, repr_line
from dhkit.trajectories.pieces import Pieces

_POSITION_ROUNDING = 1e-10
"""Distance of a proved bound of joint values from values that are reached, rad and m."""
ADVICE_ON_LIMITS = "give a duration, or limits such as arm = arm.with_limits(velocity=2.0)"
"""Advice of errors about a motion that nothing limits."""


def advice_on_acceleration(description: Description) -> str:
    """Return advice on limits for a motion in least time, which speeds alone do not bound, with an example.

    Torques limit an arm whose links have bodies; otherwise accelerations do.
    """
    acceleration = "limits=dhkit.Limits.of(arm, acceleration=5.0)"
    if all(joint.bodies for joint in description.joints):
        example = "arm = arm.with_limits(velocity=2.0, torque=50.0)"
        return f"give the arm limits such as {example}, or this motion {acceleration}"
    return (
        f"give this motion {acceleration}, and the arm those of speed, such as arm = "
        "arm.with_limits(velocity=2.0); its links have no bodies, so that torques cannot be limited"
    )


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of n joints, shape (n,) each, infinite where there are none; read-only.

    Raises
    ------
    ValueError
        Other shapes, NaN, a limit that is not positive, or a lower one above the upper one.
    """

    lower: Array
    """Lowest joint values, rad or m."""
    upper: Array
    """Highest joint values, rad or m."""
    velocity: Array
    """Largest absolute velocities, rad/s or m/s."""
    acceleration: Array
    """Largest absolute accelerations, rad/s^2 or m/s^2."""
    jerk: Array
    """Largest absolute jerks, rad/s^3 or m/s^3."""
    torque: Array
    """Largest absolute torques or forces, N m or N."""

    def __post_init__(self) -> None:
        n = np.size(self.lower)
        for item in fields(self):
            array = np.array(number_array(getattr(self, item.name), item.name, f"({n},)"))
            if array.shape != (n,):
                raise ValueError(f"{item.name} has shape {array.shape}; expected ({n},)")
            bounds = item.name in ("lower", "upper")
            # No joint value is allowed.
            nowhere = {"lower": np.inf, "upper": -np.inf}.get(item.name)
            wrong = np.isnan(array) | (array == nowhere) if bounds else ~(array > 0)
            if wrong.any():
                i = int(np.flatnonzero(wrong)[0])
                free = "-inf" if item.name == "lower" else "inf"
                expected = (
                    f"a number, or {free} for none" if bounds else "a positive number, or inf"
                )
                raise ValueError(
                    f"{item.name} of joint {i + 1} is {array[i]:g}; expected {expected}"
                )
            array.flags.writeable = False
            object.__setattr__(self, item.name, array)
        if (self.lower > self.upper).any():
            i = int(np.flatnonzero(self.lower > self.upper)[0])
            raise ValueError(
                f"lower of joint {i + 1} is {self.lower[i]:g}, above upper, {self.upper[i]:g}"
            )

    @property
    def unlimited(self) -> tuple[str, ...]:
        """Quantities without limit: ``acceleration`` if no joint has one, else such as ``torque of joint 2``."""
        found = []
        for name in ("velocity", "acceleration", "jerk", "torque"):
            free = np.flatnonzero(np.isinf(getattr(self, name)))
            joints = ", ".join(str(i + 1) for i in free)
            if len(free):
                all_free = len(free) == len(self.velocity)
                found.append(
                    name if all_free else f"{name} of joint{'s' * (len(free) > 1)} {joints}"
                )
        return tuple(found)

    @classmethod
    def of(
        cls,
        description: Robot,
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

        Parameters
        ----------
        description
            The robot, or an arm.
        velocity
            Largest speeds, rad/s and m/s.
        acceleration
            Largest accelerations, rad/s^2 and m/s^2.
        jerk
            Largest jerks, rad/s^3 and m/s^3.
        torque
            Largest torques and forces, N m and N.
        lower, upper
            Lowest and highest joint values, rad and m.

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
        description = description_of(description)
        numbers = description.numbers
        anything = np.full(description.n, np.inf)
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
        values = {}
        for name, value in given.items():
            values[name] = own[name] if value is None else one_each(value, name, description.n)
        return cls(**values)

    def scaled(
        self,
        velocity: float = 1.0,
        acceleration: float = 1.0,
        jerk: float = 1.0,
        torque: float = 1.0,
    ) -> Limits:
        """Return the limits times factors; those of position stay.

        Parameters
        ----------
        velocity, acceleration, jerk, torque
            Factors.

        Raises
        ------
        ValueError
            A share that is not positive.

        Examples
        --------
        >>> from dhkit import Arm
        >>> limits = Arm.load("puma560").limits
        >>> bool((limits.scaled(velocity=0.5).velocity == 0.5 * limits.velocity).all())
        True
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

    def __repr__(self) -> str:
        position = {"position": np.append(self.lower, self.upper)}
        given = position | {item.name: getattr(self, item.name) for item in fields(self)[2:]}
        limited = [name for name, limit in given.items() if np.isfinite(limit).any()]
        return repr_line(
            "Limits", counted(len(self.lower), "joint"), ", ".join(limited) or "unlimited"
        )

    def _repr_html_(self) -> str:
        names = [item.name for item in fields(self)]
        columns = [getattr(self, name) for name in names]
        rows = [
            (str(i), *map(_limit_text, row))
            for i, row in enumerate(zip(*columns, strict=True), start=1)
        ]
        caption = "Limits: rad or m, over s, s² and s³; torques N m or N"
        return html_table(("joint", *names), rows, caption, align="r")


def _limit_text(limit: float) -> str:
    return f"{limit:.4g}" if np.isfinite(limit) else "unlimited"


class Farthest(NamedTuple):
    """The joint value of a motion or a path that is farthest outside its limits, or nearest to them."""

    joint: int
    """Index of the joint, from 0."""
    excess: float
    """Distance from the limit, rad or m; negative inside."""
    is_below: bool
    """Whether the limit is the lower one."""
    value: float
    """The joint value, rad or m."""
    place: float
    """Its time, s, or its place on a path."""


def farthest_outside(limits: Limits, q: Pieces) -> Farthest:
    """Return the joint value that is farthest outside its limits, of joint values as polynomials of n columns."""
    found = q.bounds(_POSITION_ROUNDING)
    below = limits.lower - found.lowest
    above = found.highest - limits.upper
    i = int(np.argmax(np.maximum(below, above)))
    if below[i] > above[i]:
        return Farthest(i, float(below[i]), True, float(found.lowest[i]), float(found.at_lowest[i]))
    return Farthest(i, float(above[i]), False, float(found.highest[i]), float(found.at_highest[i]))
