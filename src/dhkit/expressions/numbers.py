"""Numbers of Python as exact values."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real

from dhkit.errors import ExpressionError
from dhkit.expressions.exact import LARGEST, PI, PI_DIGITS, STEPS_IN_PI, Expression
from dhkit.expressions.syntax import decimal_fraction


def exact(value: object) -> Expression:
    """Return a number as the exact value that was typed: 0.1 is 1/10, not the nearest double.

    Parameters
    ----------
    value
        Number; an expression is returned as it is.

    Returns
    -------
    Expression
        The exact value; an expression as it is.

    Raises
    ------
    ExpressionError
        The value is not a number, or not finite.

    Examples
    --------
    >>> exact(0.1).rational
    Fraction(1, 10)
    """
    if isinstance(value, Expression):
        return value
    if isinstance(value, bool) or not isinstance(value, (Real, Decimal)):
        raise ExpressionError(f"{value!r} is not a number")
    if isinstance(value, Integral):
        whole = int(value)
        if abs(whole) > LARGEST:
            raise ExpressionError("an integer beyond the range of a double")
        return Expression.number(whole)
    if isinstance(value, Rational):
        return Expression.number(Fraction(int(value.numerator), int(value.denominator)))
    number = value if isinstance(value, Decimal) else Decimal(repr(float(value)))
    if not number.is_finite():
        raise ExpressionError(f"{value} is not finite")
    sign, digits = ("-", str(number)[1:]) if number.is_signed() else ("", str(number))
    magnitude = decimal_fraction(digits)
    return Expression.number(-magnitude if sign else magnitude)


def exact_angle(value: Expression) -> Expression:
    """Return an angle, rad, in which a decimal that is the nearest double to k pi/12 is read as k pi/12.

    1.5707963267948966 is pi/2; all other decimals stay as they are.

    Parameters
    ----------
    value
        Angle, rad.

    Returns
    -------
    Expression
        The exact angle.

    Examples
    --------
    >>> from dhkit.expressions import exact
    >>> print(exact_angle(exact(1.5707963267948966)).text)
    pi/2
    """
    number = value.rational
    if not number:
        return value
    step = round(number * STEPS_IN_PI / PI_DIGITS)
    candidate = PI * Fraction(step, STEPS_IN_PI)
    return (
        replace(candidate, written=value.written)
        if step and float(candidate) == float(number)
        else value
    )
