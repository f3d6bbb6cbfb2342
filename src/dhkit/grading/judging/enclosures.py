"""Real values of syntax trees by interval arithmetic, in as many digits as are needed.

A large number of digits alone proves nothing: ``(10^250 + V) - 10^250`` and ``(cos(10^-120) - 1)*10^240`` are zero in
two hundred digits. An interval shows by its width that digits are lost, and the tree is then worked out again in more
digits (Moore, Kearfott & Cloud, Introduction to Interval Analysis, 2009). Functions are real: the root of a negative
number has no value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.numeric import Evaluation

if TYPE_CHECKING:
    from mpmath import mpf

PRECISIONS = (60, 250, 1000, 6000)
"""Decimal digits in which a tree is worked out, one after the other until its value is known."""
RELATIVE_DIGITS = 26
"""Number of leading digits that suffices to tell a value from another one."""
_TOO_LARGE = "a number too large to be worked out"

_Interval = Any
"""An interval of mpmath, which has no types."""


class TooLargeError(AnswerError):
    """A number so large that it would fill the memory."""


class LostDigitsError(AnswerError):
    """A tree whose value is not known to the digits that are needed."""


class _UndecidedError(Exception):
    """An interval too wide for a function: it contains a zero of the divisor, or an end of the function's domain."""


def enclosed(
    tree: Tree, parts: int, values: Mapping[str, mpf], tolerance: mpf, relative: bool = True
) -> tuple[mpf, int]:
    """Return the value of a tree, known to a tolerance, and the decimal digits in which it was worked out.

    Parameters
    ----------
    tree
        An answer as :func:`dhkit.grading.answers.read_answer` reads it.
    parts
        Number of the tree's parts.
    values
        Numbers of mpmath by name, in SI units and rad; ``pi`` and units need not be given.
    tolerance
        Largest absolute error of the value.
    relative
        Whether a value is known well enough if its first :data:`RELATIVE_DIGITS` digits are, however large it is.

    Raises
    ------
    AnswerError
        No real, finite value; a name without value; or a function that is not known.
    TooLargeError
        A number is too large to be worked out.
    LostDigitsError
        No precision in :data:`PRECISIONS` gives the value within ``BOUNDS.enclosure_work``: digits cancel, or a
        function has no value nearby.
    """
    import mpmath

    used = names_of(tree)
    for digits in PRECISIONS:
        if digits > PRECISIONS[0] and parts * digits > BOUNDS.enclosure_work:
            break
        iv = mpmath.iv
        previous = iv.dps
        iv.dps = digits
        try:
            given = {name: iv.mpf(x) for name, x in values.items() if name in used}
            numbers = {**_units(digits), **given}
            evaluation = Evaluation(
                numbers, partial(_rational, digits=digits), _functions(), _power, _divide
            )
            interval = evaluation.of(tree)
            with mpmath.workdps(digits):
                middle = mpmath.mpf(interval.mid)
                width = mpmath.mpf(interval.delta.b)

            # width <= max(tolerance, |value| 10^-RELATIVE_DIGITS)
            allowed = tolerance
            if relative:
                allowed = max(tolerance, abs(middle) * mpmath.mpf(10) ** -RELATIVE_DIGITS)
            if mpmath.isfinite(width) and width <= allowed:
                return middle, digits
        except _UndecidedError:
            continue
        finally:
            iv.dps = previous
    raise LostDigitsError("its digits cancel so far that they do not decide it")


@lru_cache(maxsize=4096)
def _rational(value: Fraction, digits: int) -> _Interval:
    """Return a rational number in the working precision, which is ``digits``."""
    from mpmath import iv

    return iv.mpf(value.numerator) / value.denominator


@lru_cache(maxsize=len(PRECISIONS))
def _units(digits: int) -> Mapping[str, _Interval]:
    """Return pi and the units in the working precision, which is ``digits``."""
    from mpmath import iv

    units = {
        name: _rational(unit.rational, digits)
        for name, unit in CONSTANTS.items()
        if unit.rational is not None
    }
    return {**units, "pi": +iv.pi, "deg": iv.pi / 180}


def _magnitudes(x: _Interval) -> list[int]:
    """Return the binary magnitudes m of an interval's bounds, |bound| <= 2^m, without those of zeros."""
    import mpmath

    bounds = [mpmath.mpf(bound) for bound in (x.a, x.b)]
    if not all(map(mpmath.isfinite, bounds)):
        raise _UndecidedError
    return [int(mpmath.mag(bound)) for bound in bounds if bound]


def _integer_bits(x: _Interval) -> int:
    """Return the number of bits before the point in the larger of the bounds; negative for numbers below 1/2."""
    return max(_magnitudes(x), default=0)


def _refuse_below(x: _Interval, bound: int) -> None:
    """Refuse an argument that is below ``bound``, the lower end of a function's domain, and one that may be.

    Raises
    ------
    AnswerError
        The argument is certainly outside the domain.
    _UndecidedError
        The interval is too wide to decide it.
    """
    if x.b < bound:
        raise AnswerError("no real value")
    if x.a < bound:
        raise _UndecidedError


def _divide(x: _Interval, y: _Interval) -> _Interval:
    if 0 in y:
        if y.a == y.b:
            raise AnswerError("no finite value")
        raise _UndecidedError
    return x / y


def _power(base: _Interval, exponent: _Interval) -> _Interval:
    import mpmath

    if _integer_bits(exponent) > BOUNDS.argument_bits:
        raise TooLargeError(_TOO_LARGE)
    size = max(map(abs, _magnitudes(base)), default=0)
    power = mpmath.mpf(exponent.mid)
    if size * abs(power) > BOUNDS.power_bits:
        raise TooLargeError(_TOO_LARGE)

    is_whole = exponent.a == exponent.b and power == int(power)
    if is_whole:
        k = int(power)
        return base**k if k >= 0 else _divide(mpmath.iv.mpf(1), base**-k)

    # 0^y = 0 for y > 0
    if base.a == base.b == 0 and exponent.a > 0:
        return base

    # x^y = exp(y log(x)) for x > 0
    _refuse_below(base, 0)
    if base.a == 0:
        raise _UndecidedError
    return mpmath.iv.exp(exponent * mpmath.iv.log(base))


@lru_cache(maxsize=1)
def _functions() -> Mapping[str, Callable[..., _Interval]]:
    """Return the functions of :data:`dhkit.grading.judging.numeric.FUNCTIONS` for intervals."""
    from mpmath import iv

    def square_root(x: _Interval) -> _Interval:
        _refuse_below(x, 0)
        return iv.sqrt(x)

    def other_leg(x: _Interval) -> _Interval:
        """Return sqrt(1 - x^2): the cosine of an arc sine, and the sine of an arc cosine.

        The product sqrt((1 - x)(1 + x)) keeps the digits that 1 - x^2 loses where |x| is near 1.
        """
        _refuse_below(1 - abs(x), 0)
        return square_root((1 - x) * (1 + x))

    def arc_tangent(y: _Interval, x: _Interval) -> _Interval:
        if 0 in x and 0 in y:
            if x.a == x.b and y.a == y.b:
                raise AnswerError("no finite value")
            raise _UndecidedError
        return iv.atan2(y, x)

    def sign(x: _Interval) -> _Interval:
        if 0 in x and x.a != x.b:
            raise _UndecidedError
        return iv.mpf(int(x.a > 0) - int(x.a < 0))

    def bounded(function: Callable[..., _Interval]) -> Callable[..., _Interval]:
        """Return a function that refuses arguments too large to be worked out."""

        def apply(*arguments: _Interval) -> _Interval:
            if any(_integer_bits(x) > BOUNDS.argument_bits for x in arguments):
                raise TooLargeError(_TOO_LARGE)
            return function(*arguments)

        return apply

    functions: dict[str, Callable[..., _Interval]] = {
        "sin": iv.sin,
        "cos": iv.cos,
        "tan": lambda x: _divide(iv.sin(x), iv.cos(x)),
        # asin(x) = atan2(x, sqrt(1 - x^2)),    acos(x) = atan2(sqrt(1 - x^2), x)
        "asin": lambda x: arc_tangent(x, other_leg(x)),
        "acos": lambda x: arc_tangent(other_leg(x), x),
        "atan": lambda x: arc_tangent(x, iv.mpf(1)),
        "atan2": arc_tangent,
        "sqrt": square_root,
        "abs": abs,
        "sign": sign,
        "exp": iv.exp,
        "min": lambda *x: iv.mpf([min(y.a for y in x), min(y.b for y in x)]),
        "max": lambda *x: iv.mpf([max(y.a for y in x), max(y.b for y in x)]),
    }
    return {name: bounded(function) for name, function in functions.items()}
