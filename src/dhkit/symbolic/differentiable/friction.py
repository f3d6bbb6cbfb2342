"""Joint friction: viscous, and dry friction that differs by direction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Array, Numbers

if TYPE_CHECKING:
    import casadi

_SMALLEST_WIDTH = 1e-9
"""Smallest positive width, rad/s or m/s: its square neither underflows nor makes the quotient overflow."""


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
    """Rate at which the direction factor s reaches 1/sqrt(2), rad/s or m/s; 0: a step with stiction."""

    def __post_init__(self) -> None:
        is_finite = isinstance(self.width, Real) and math.isfinite(self.width)
        if not is_finite or (self.width != 0 and self.width < _SMALLEST_WIDTH):
            raise ValueError(
                f"friction: width is {self.width!r}; expected 0, or a finite number from {_SMALLEST_WIDTH:g} on"
            )

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


def friction_parameters(numbers: Numbers, width: float) -> Array:
    """Return the inputs of :func:`friction_torque` for an arm.

    Parameters
    ----------
    numbers
        The arm's numbers, ``description.numbers``.
    width
        Rate, rad/s and m/s, over which smooth dry friction changes its direction; 0 for a step.

    Returns
    -------
    Array
        Shape (3 n + 1,): viscous coefficients, N m s/rad and N s/m, dry friction for positive and negative rates of
        each joint, N m and N, and the width.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> friction_parameters(library_robot("planar2r").numbers, 0.01)
    array([0.05, 0.02, 0.  , 0.  , 0.  , 0.  , 0.01])
    """
    return np.concatenate([numbers.viscous, numbers.coulomb.ravel(), [width]])


def friction_torque(qd: casadi.SX, parameters: casadi.SX, *, smooth: bool) -> casadi.SX:
    """Return friction torques, n x 1, N m and N: viscous qd, plus c_pos for positive and c_neg for negative rates.

    Parameters
    ----------
    qd
        Joint rates, n x 1, rad/s and m/s.
    parameters
        Those of :func:`friction_parameters`: N m s/rad and N m (or N s/m and N) at the joint side, c_neg at most 0.
    smooth
        Whether dry friction changes its direction smoothly, over the width; else by a step, 0 at rest.

    Returns
    -------
    casadi.SX
        n x 1, N m and N, with the sign of the motion.

    Examples
    --------
    >>> import casadi
    >>> qd, parameters = casadi.SX.sym("qd", 1), casadi.SX.sym("p", 4)
    >>> f = casadi.Function("f", [qd, parameters], [friction_torque(qd, parameters, smooth=False)])
    >>> f(2.0, [0.1, 3.0, -2.0, 0.0])  # 0.1 * 2 + 3
    DM(3.2)
    >>> f(-2.0, [0.1, 3.0, -2.0, 0.0])
    DM(-2.2)
    """
    import casadi

    n = qd.numel()
    width = parameters[3 * n]
    torques = []
    for i in range(n):
        v = qd[i]
        viscous = parameters[i]
        c_pos = parameters[n + 2 * i]
        c_neg = parameters[n + 2 * i + 1]

        # Direction s from -1 to 1; dry friction is c_pos at s = 1, c_neg at s = -1, 0 at s = 0.
        s = v / casadi.sqrt(v * v + width * width) if smooth else casadi.sign(v)
        dry = (c_pos - c_neg) / 2 * s + (c_pos + c_neg) / 2 * (s * s)
        torques.append(viscous * v + dry)
    return casadi.vertcat(*torques)
