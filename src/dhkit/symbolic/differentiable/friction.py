"""Joint friction: viscous, and dry friction that differs by direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING

from dhkit.symbolic.differentiable.vectors import Scalar

if TYPE_CHECKING:
    import casadi

NARROWEST = 1e-9
"""Smallest width, rad/s or m/s: its square neither underflows nor makes the quotient overflow."""


@dataclass(frozen=True)
class Friction:
    """Dry friction near rest: how its torque changes sign with the direction of motion.

    With width 0 it is a step, 0 at rest. Otherwise it is smooth: with s = v / sqrt(v^2 + width^2) the torque is
    (c_pos - c_neg) / 2 s + (c_pos + c_neg) / 2 s^2, which tends to c_pos and c_neg far from 0 and takes energy at every
    speed.

    Raises
    ------
    ValueError
        A width that is not 0 and below 1e-9, or not finite.
    """

    width: float = 0.0
    """rad/s or m/s."""

    def __post_init__(self) -> None:
        known = isinstance(self.width, Real) and math.isfinite(self.width)
        if not known or (self.width != 0 and self.width < NARROWEST):
            raise ValueError(f"friction: width is {self.width!r}; expected 0, or a finite number from {NARROWEST:g} on")

    @classmethod
    def chosen(cls, friction: bool | Friction | None) -> Friction | None:
        """Return the model that an argument ``friction=`` means: None for False, a step for True, or itself.

        Raises
        ------
        TypeError
            The argument is neither.
        """
        if friction is None or isinstance(friction, Friction):
            return friction
        if type(friction).__name__ not in ("bool", "bool_"):
            raise TypeError(f"friction is {friction!r}; expected False, True or a Friction")
        return cls() if friction else None

    def direction(self, speed: Scalar) -> Scalar:
        """Return the direction of a speed, rad/s or m/s: -1 to 1."""
        import casadi

        return smooth_direction(speed, self.width) if self.width else casadi.sign(speed)


def smooth_direction(speed: Scalar, width: Scalar) -> Scalar:
    """Return v / sqrt(v^2 + width^2), without unit; speed and width in rad/s or m/s."""
    import casadi

    return speed / casadi.sqrt(speed * speed + width * width)


def friction_torque(
    qd: casadi.SX, viscous: Sequence[Scalar], coulomb: Sequence[tuple[Scalar, Scalar]], directions: Sequence[Scalar]
) -> casadi.SX:
    """Return friction torques, n x 1, N m and N: viscous qd, plus c_pos for positive and c_neg for negative rates.

    Parameters
    ----------
    qd
        Joint rates, n x 1.
    viscous, coulomb
        At the joint side, N m s/rad and N m (or N s/m and N), one entry a joint; c_neg is at most 0.
    directions
        Direction of each joint's motion, -1 to 1; see :class:`Friction`.
    """
    import casadi

    torques = []
    for i, s in enumerate(directions):
        positive, negative = coulomb[i]
        dry = (positive - negative) / 2 * s + (positive + negative) / 2 * (s * s)
        torques.append(viscous[i] * qd[i] + dry)
    stacked: casadi.SX = casadi.vertcat(*torques)
    return stacked
