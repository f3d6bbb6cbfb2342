"""The real number that a syntax tree stands for, by interval arithmetic, in as many digits as it needs.

Digits alone prove nothing: ``(10^250 + V) - 10^250`` and ``(cos(10^-120) - 1)*10^240`` are zero in two hundred of them.
An interval that is too wide says so, and the tree is worked out again in more digits (Moore, Kearfott & Cloud,
Introduction to Interval Analysis, 2009). Functions are real: a root of a negative number has no value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree

if TYPE_CHECKING:
    from mpmath import mpf

PRECISIONS = (60, 250, 1000, 6000)
"""Digits in which a tree is worked out, one after the other until its value is known."""
MAX_WORK = 1_000_000
"""Parts of a tree times digits, beyond the first precision: a second's work at most."""
RELATIVE = 26
"""Digits of a value that are enough to tell it from another one."""
LARGEST, LARGEST_POWER = 2_000, 100_000
"""Bits: of a function's argument, and of a power."""

Interval = Any
"""An interval of mpmath, which has no types."""


class TooLargeError(AnswerError):
    """A number that would fill the memory if it were worked out."""


class LostDigitsError(AnswerError):
    """A tree whose value is not known to the digits that are asked for."""


class _UndecidedError(Exception):
    """An interval that is too wide for a function: it holds zero, or the end of the function's domain."""


def enclosed(tree: Tree, parts: int, values: Mapping[str, mpf], tolerance: mpf, shares: bool = True) -> tuple[mpf, int]:
    """Return a tree's value, known to ``tolerance``, and in how many digits it was worked out.

    Parameters
    ----------
    tree
        An answer as :func:`dhkit.grading.answers.read_answer` reads it.
    parts
        How many it has.
    values
        Numbers of mpmath by name; ``pi`` and units need not be given.
    tolerance
        By how much the value may be off.
    shares
        Whether a value whose first :data:`RELATIVE` digits are known is known well enough, however large it is.

    Raises
    ------
    AnswerError
        No real, finite value; a name without value; or a function that is not known.
    TooLargeError
        A number that is too large to be worked out.
    LostDigitsError
        No number of digits in :data:`PRECISIONS` gives it within the work that is allowed: they cancel, or a function
        has no value nearby.
    """
    import mpmath

    for digits in PRECISIONS:
        if digits > PRECISIONS[0] and parts * digits > MAX_WORK:
            break
        iv, before = mpmath.iv, mpmath.iv.dps
        iv.dps = digits
        try:
            interval = _Evaluation(values).of(tree)
            with mpmath.workdps(digits):
                middle, width = mpmath.mpf(interval.mid), mpmath.mpf(interval.delta.b)
            allowed = max(tolerance, abs(middle) * mpmath.mpf(10) ** -RELATIVE) if shares else tolerance
            if mpmath.isfinite(width) and width <= allowed:
                return middle, digits
        except _UndecidedError:
            continue
        finally:
            iv.dps = before
    raise LostDigitsError("its digits cancel so far that they do not decide it")


class _Evaluation:
    """One walk over a tree, in the precision that is set."""

    def __init__(self, values: Mapping[str, mpf]) -> None:
        from mpmath import iv

        self.iv = iv
        units = {name: _rational(unit.rational) for name, unit in CONSTANTS.items() if unit.rational is not None}
        self.values = {**units, "pi": +iv.pi, "deg": iv.pi / 180, **{name: iv.mpf(x) for name, x in values.items()}}
        self.shared: dict[int, Interval] = {}

    def of(self, tree: Tree) -> Interval:
        # CasADi's graphs share what is used twice.
        if id(tree) not in self.shared:
            self.shared[id(tree)] = self._value(tree)
        return self.shared[id(tree)]

    def _value(self, tree: Tree) -> Interval:
        match tree:
            case Number(value=value):
                return _rational(value)
            case Name(text):
                if text not in self.values:
                    raise AnswerError(f"{text} has no value")
                return self.values[text]
            case Call(function, arguments):
                if function not in _FUNCTIONS:
                    raise AnswerError(f"unknown function {function!r}; known are {', '.join(_FUNCTIONS)}")
                found = [self.of(argument) for argument in arguments]
                if any(_bits(x) > LARGEST for x in found):
                    raise TooLargeError("a number too large to be worked out")
                return _FUNCTIONS[function](*found)
            case Power(base, exponent):
                return _power(self.of(base), self.of(exponent))
            case Sum(terms):
                total = self.iv.mpf(0)
                for added, term in terms:
                    total = total + self.of(term) if added else total - self.of(term)
                return total
            case Product(factors):
                product = self.iv.mpf(1)
                for multiplied, factor in factors:
                    x = self.of(factor)
                    product = product * x if multiplied else _quotient(product, x)
                return product


def _rational(value: Fraction) -> Interval:
    from mpmath import iv

    return iv.mpf(value.numerator) / value.denominator


def _magnitudes(x: Interval) -> list[int]:
    """Return the binary magnitudes of an interval's bounds; those of zeros are left out."""
    import mpmath

    bounds = [mpmath.mpf(bound) for bound in (x.a, x.b)]
    if not all(map(mpmath.isfinite, bounds)):
        raise _UndecidedError
    return [int(mpmath.mag(bound)) for bound in bounds if bound]


def _bits(x: Interval) -> int:
    """Return how many bits the larger bound has before its point; negative for numbers below 1/2."""
    return max(_magnitudes(x), default=0)


def _refuse_below(x: Interval, bound: int) -> None:
    """Refuse an argument that lies outside a function's domain, for certain or perhaps."""
    if x.b < bound:
        raise AnswerError("no real value")
    if x.a < bound:
        raise _UndecidedError


def _quotient(x: Interval, y: Interval) -> Interval:
    if 0 in y:
        if y.a == y.b:
            raise AnswerError("no finite value")
        raise _UndecidedError
    return x / y


def _power(base: Interval, exponent: Interval) -> Interval:
    import mpmath

    if _bits(exponent) > LARGEST:
        raise TooLargeError("a number too large to be worked out")
    size = max(map(abs, _magnitudes(base)), default=0)
    power = mpmath.mpf(exponent.mid)
    if size * abs(power) > LARGEST_POWER:
        raise TooLargeError("a number too large to be worked out")
    if exponent.a == exponent.b and power == int(power):
        whole = int(power)
        return base**whole if whole >= 0 else _quotient(mpmath.iv.mpf(1), base**-whole)
    if base.a == base.b == 0 and exponent.a > 0:
        return base
    _refuse_below(base, 0)
    if base.a == 0:
        raise _UndecidedError
    return mpmath.iv.exp(exponent * mpmath.iv.log(base))


def _square_root(x: Interval) -> Interval:
    from mpmath import iv

    _refuse_below(x, 0)
    return iv.sqrt(x)


def _other_side(x: Interval) -> Interval:
    """Return the cosine of an arc sine: the other side of a triangle whose longest side is 1."""
    _refuse_below(1 - abs(x), 0)
    return _square_root((1 - x) * (1 + x))


def _arc_tangent(y: Interval, x: Interval) -> Interval:
    from mpmath import iv

    if 0 in x and 0 in y:
        if x.a == x.b and y.a == y.b:
            raise AnswerError("no finite value")
        raise _UndecidedError
    return iv.atan2(y, x)


def _tangent(x: Interval) -> Interval:
    from mpmath import iv

    return _quotient(iv.sin(x), iv.cos(x))


def _sign(x: Interval) -> Interval:
    from mpmath import iv

    if 0 in x and x.a != x.b:
        raise _UndecidedError
    return iv.mpf(int(x.a > 0) - int(x.a < 0))


def _ordered(choose: Callable[..., Interval]) -> Callable[..., Interval]:
    """Return the smallest or the largest of intervals."""

    def chosen(*arguments: Interval) -> Interval:
        from mpmath import iv

        return iv.mpf([choose(x.a for x in arguments), choose(x.b for x in arguments)])

    return chosen


def _of_iv(name: str) -> Callable[[Interval], Interval]:
    def function(x: Interval) -> Interval:
        from mpmath import iv

        return getattr(iv, name)(x)

    return function


_FUNCTIONS: Mapping[str, Callable[..., Interval]] = {
    "sin": _of_iv("sin"),
    "cos": _of_iv("cos"),
    "tan": _tangent,
    "asin": lambda x: _arc_tangent(x, _other_side(x)),
    "acos": lambda x: _arc_tangent(_other_side(x), x),
    "atan": lambda x: _arc_tangent(x, _rational(Fraction(1))),
    "atan2": _arc_tangent,
    "sqrt": _square_root,
    "abs": abs,
    "sign": _sign,
    "exp": _of_iv("exp"),
    "min": _ordered(min),
    "max": _ordered(max),
}
