"""Joint values as text in messages: with their unit, angles in degrees where the user works in degrees."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextvars import ContextVar

DEGREES: ContextVar[bool] = ContextVar("dhkit_degrees", default=False)
"""Whether messages give angles in degrees instead of rad; the command line sets it by ``--degrees``."""

LIMIT_ROUNDING = 1e-9
"""Distance in rad or m beyond a limit that is attributed to rounding and not reported."""


def joint_text(value: float, *, slides: bool, digits: int = 6, rate: str = "") -> str:
    """Return a joint's value with its unit.

    Parameters
    ----------
    value
        Joint value, rad (revolute) or m (prismatic), or a time derivative of it.
    slides
        Whether the joint is prismatic.
    digits
        Number of significant digits.
    rate
        Text that follows the unit, such as ``/s`` for a speed.

    Examples
    --------
    >>> joint_text(1.5, slides=False), joint_text(0.25, slides=True, rate="/s")
    ('1.5 rad', '0.25 m/s')
    """
    if slides:
        return f"{value:.{digits}g} m{rate}"
    if DEGREES.get():
        return f"{math.degrees(value):.{digits}g}°{rate}"
    return f"{value:.{digits}g} rad{rate}"


def joint_unit(prismatic: Iterable[bool]) -> str:
    """Return the unit of joint values: ``rad``, ``m``, or ``rad or m`` for an arm with both kinds of joints.

    Examples
    --------
    >>> joint_unit([False, True]), joint_unit([True])
    ('rad or m', 'm')
    """
    units = {"m" if slides else "rad" for slides in prismatic} or {"rad"}
    return " or ".join(sorted(units, reverse=True))


def degrees_hint(value: float, *, slides: bool) -> str:
    """Return a question whether degrees were meant, for an angle in rad beyond one turn; empty otherwise."""
    if slides or DEGREES.get() or abs(value) <= math.tau + LIMIT_ROUNDING:
        return ""
    return f" ({abs(value) / math.tau:.3g} turns; were degrees meant?)"


def violated_limit_text(
    value: float, lower: float, upper: float, *, slides: bool, digits: int = 6
) -> str:
    """Return which limit a joint value violates and by which numbers; empty for a value within the limits.

    All numbers are in rad, or in m where the joint ``slides``. A violation below :data:`LIMIT_ROUNDING` is none.
    """
    if lower - LIMIT_ROUNDING <= value <= upper + LIMIT_ROUNDING:
        return ""
    side, limit = ("below its lower", lower) if value < lower else ("above its upper", upper)
    value_text, limit_text = (joint_text(x, slides=slides, digits=digits) for x in (value, limit))
    return f"{value_text}{degrees_hint(value, slides=slides)}, {side} limit, {limit_text}"
