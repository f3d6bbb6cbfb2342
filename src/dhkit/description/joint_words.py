"""Joint values in words: with their unit, and angles in degrees where the person who reads them gives degrees."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextvars import ContextVar

DEGREES: ContextVar[bool] = ContextVar("dhkit_degrees", default=False)
"""Whether messages tell angles in degrees; the command sets it by ``--degrees``."""

EDGE = 1e-9
"""rad or m: how far outside its limits rounding may put a joint."""


def joint_words(value: float, *, slides: bool, digits: int = 6, rate: str = "") -> str:
    """Return a joint's value with its unit.

    Parameters
    ----------
    value
        rad or m, or a rate of these.
    slides
        Whether the joint is prismatic.
    digits
        Significant ones.
    rate
        What follows the unit, such as ``/s``.

    Examples
    --------
    >>> joint_words(1.5, slides=False), joint_words(0.25, slides=True, rate="/s")
    ('1.5 rad', '0.25 m/s')
    """
    if slides:
        return f"{value:.{digits}g} m{rate}"
    if DEGREES.get():
        return f"{math.degrees(value):.{digits}g}°{rate}"
    return f"{value:.{digits}g} rad{rate}"


def joint_unit(prismatic: Iterable[bool]) -> str:
    """Return the unit of joint values: ``rad``, ``m``, or ``rad or m`` where some joints slide and others turn.

    Examples
    --------
    >>> joint_unit([False, True]), joint_unit([True])
    ('rad or m', 'm')
    """
    units = {"m" if slides else "rad" for slides in prismatic} or {"rad"}
    return " or ".join(sorted(units, reverse=True))


def degrees_hint(value: float, *, slides: bool) -> str:
    """Return a question to append where an angle, rad, is more than a turn and nobody said degrees; else nothing."""
    if slides or DEGREES.get() or abs(value) <= math.tau + EDGE:
        return ""
    return f" ({abs(value) / math.tau:.3g} turns; were degrees meant?)"


def outside_words(value: float, lower: float, upper: float, *, slides: bool, digits: int = 6) -> str:
    """Return which limit a joint's value is beyond, in words; nothing where it is inside or at one within rounding."""
    if lower - EDGE <= value <= upper + EDGE:
        return ""
    side, limit = ("below its lower", lower) if value < lower else ("above its upper", upper)
    found, bound = joint_words(value, slides=slides, digits=digits), joint_words(limit, slides=slides, digits=digits)
    return f"{found}{degrees_hint(value, slides=slides)}, {side} limit, {bound}"
