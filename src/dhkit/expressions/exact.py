"""Exact expressions: sums of products with rational coefficients, in a normal form.

An :class:`Expression` is a Laurent polynomial with rational coefficients in *atoms*: pi, parameters, and functions such
as ``sin(q1)`` or ``sqrt(2)``. Texts of the same sum of products are equal values: 17 inches equal 0.4318 m, and
``m1*l1^2/12`` equals ``l1^2*m1/12``. ``float()`` rounds once, at the end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from decimal import Context, Decimal
from fractions import Fraction
from typing import TypeAlias

from dhkit.cached_property import cached_property
from dhkit.display import LONGEST_LINE, plain
from dhkit.errors import ExpressionError
from dhkit.expressions.bounds import BOUNDS
from dhkit.expressions.budget import spend
from dhkit.expressions.syntax import decimal_text

PI_DIGITS = Fraction("3.14159265358979323846264338327950288419716939937510582097494459")
STEPS_IN_PI = 12
"""Steps of 15 degrees in pi: multiples of 15 degrees have exact cosines."""
LARGEST = 10**308
"""Nearly the largest double."""
MAX_FRACTION_PART = 16
"""Fractions with parts up to this are printed as fractions (l1/12), others as decimals (0.4318*l1)."""

_Scalar: TypeAlias = "Expression | int | Fraction"


@dataclass(frozen=True)
class Atom:
    """An indivisible factor: pi, a parameter, or a function of expressions.

    Two names have rules of their own: even powers of ``sqrt`` are resolved, and ``group`` is a sum in a denominator.
    """

    name: str
    arguments: tuple[Expression, ...] = ()

    @cached_property
    def text(self) -> str:
        """The atom as text; atoms are sorted by it."""
        if not self.arguments:
            return self.name
        inner = ", ".join(argument.text for argument in self.arguments)
        return f"({inner})" if self.name == "group" else f"{self.name}({inner})"

    @cached_property
    def _hash(self) -> int:
        return hash((self.name, self.arguments))

    def __hash__(self) -> int:
        return self._hash

    def __reduce__(self) -> tuple[type[Atom], tuple[str, tuple[Expression, ...]]]:
        # Without the cached hash, which differs from process to process.
        return Atom, (
            self.name,
            self.arguments,
        )

    @property
    def is_symbol(self) -> bool:
        """Whether the atom is a parameter, and not pi or a function."""
        return not self.arguments and self.name != "pi"

    def value(self) -> Fraction:
        """Return the atom's value, with the precision of a double (pi: 60 digits).

        Raises
        ------
        ExpressionError
            A parameter, or a function outside its domain.
        """
        if self.name == "pi":
            return PI_DIGITS
        if self.is_symbol:
            raise ExpressionError(f"{self.name} has no value")
        if self.name == "group":
            return self.arguments[0].value()
        arguments = [float(argument) for argument in self.arguments]
        try:
            return Fraction(
                abs(*arguments) if self.name == "abs" else getattr(math, self.name)(*arguments)
            )
        except (ValueError, OverflowError):
            raise ExpressionError(f"{self} is not a finite number") from None

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"Atom({plain(self.text, LONGEST_LINE - len('Atom()') - 2)!r})"


Monomial: TypeAlias = tuple[tuple[Atom, int], ...]


@dataclass(frozen=True)
class Expression:
    """An exact value: a sum of products of atoms, in normal form.

    Attributes
    ----------
    terms
        Pairs of a monomial (atoms with their exponents) and its rational coefficient, sorted, none zero.
    written
        The text that it was read from; ignored by comparison.

    Examples
    --------
    >>> from dhkit.expressions import exact, parse
    >>> parse("17*inch") == exact(0.4318)
    True
    >>> str(parse("m1*l1^2/12", names=["l1", "m1"]) * 2)
    'l1^2*m1/6'
    """

    terms: tuple[tuple[Monomial, Fraction], ...] = ()
    written: str | None = field(default=None, compare=False)

    @classmethod
    def number(cls, value: int | Fraction) -> Expression:
        """Return a rational number."""
        return _collected({(): Fraction(value)})

    @classmethod
    def symbol(cls, name: str) -> Expression:
        """Return a parameter by its name.

        Parameters
        ----------
        name
            Name of the symbol.
        """
        return cls.of_atom(Atom(name))

    @classmethod
    def of_atom(cls, atom: Atom) -> Expression:
        """Return the expression of a single atom.

        Raises
        ------
        ExpressionError
            The text is longer than ``BOUNDS.atom_characters``; nested functions double it with each level.
        """
        if atom.arguments:
            spend(len(atom.text) // 16)
            if len(atom.text) > BOUNDS.atom_characters:
                raise ExpressionError(
                    f"a function of more than {BOUNDS.atom_characters} characters"
                )
        return cls(((((atom, 1),), Fraction(1)),))

    @classmethod
    def sum(cls, values: Iterable[Expression]) -> Expression:
        """Return the sum of many values."""
        total: dict[Monomial, Fraction] = {}
        for value in values:
            for monomial, coefficient in value.terms:
                total[monomial] = total.get(monomial, Fraction(0)) + coefficient
        return _collected(total)

    # Reading

    @property
    def is_zero(self) -> bool:
        """Whether the value is identically zero."""
        return not self.terms

    @property
    def rational(self) -> Fraction | None:
        """The value as a rational number; None if it is not one."""
        if not self.terms:
            return Fraction(0)
        monomial, coefficient = self.terms[0]
        return coefficient if len(self.terms) == 1 and not monomial else None

    @property
    def half_turns(self) -> Fraction | None:
        """The rational r with value r pi; None if there is none."""
        if not self.terms:
            return Fraction(0)
        monomial, coefficient = self.terms[0]
        return coefficient if len(self.terms) == 1 and monomial == ((Atom("pi"), 1),) else None

    @property
    def symbols(self) -> frozenset[str]:
        """The parameters that the value depends on."""
        return frozenset(_symbols(self))

    def value(self) -> Fraction:
        """Return the value as a rational number; only pi and functions are rounded.

        Raises
        ------
        ExpressionError
            A parameter, a function outside its domain, or a division by zero.
        """
        total = Fraction(0)
        for monomial, coefficient in self.terms:
            value = coefficient
            for atom, exponent in monomial:
                base = atom.value()
                if exponent < 0 and (base == 0 or _is_rounding(atom, base)):
                    raise ExpressionError(
                        f"{plain(self.text, _SHOWN_LENGTH)} divides by zero"
                        + (", to rounding" if base else "")
                    )
                value *= _power(base, exponent)
            total += value
        return total

    def __float__(self) -> float:
        return self._double

    @cached_property
    def _double(self) -> float:
        try:
            return float(self.value())
        except OverflowError:
            raise ExpressionError(
                f"{plain(self.text, _SHOWN_LENGTH)} is not a finite double"
            ) from None

    @property
    def text(self) -> str:
        """The normal form as text that :func:`parse` reads back to an equal value."""
        if not self.terms:
            return "0"
        first, *rest = (_term_text(monomial, coefficient) for monomial, coefficient in self.terms)
        return first + "".join(
            f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in rest
        )

    def __str__(self) -> str:
        return self.written if self.written is not None else self.text

    def __repr__(self) -> str:
        return f"Expression({plain(str(self), LONGEST_LINE - len('Expression()') - 2)!r})"

    def as_written(self, text: str) -> Expression:
        """Return the same value with another text to show it by."""
        return replace(self, written=text)

    def with_digits(self, digits: int) -> Expression:
        """Return the value with longer coefficients rounded to this number of digits.

        Parameters
        ----------
        digits
            Number of significant digits.
        """
        limit = 10**digits
        context = Context(prec=digits)

        def rounded(c: Fraction) -> Fraction:
            if abs(c.numerator) < limit and c.denominator < limit:
                return c
            return Fraction(context.divide(Decimal(c.numerator), Decimal(c.denominator)))

        return _collected({monomial: rounded(coefficient) for monomial, coefficient in self.terms})

    # Arithmetic

    def __add__(self, other: _Scalar) -> Expression:
        return Expression.sum((self, _expression(other)))

    def __neg__(self) -> Expression:
        return Expression(tuple((monomial, -coefficient) for monomial, coefficient in self.terms))

    def __sub__(self, other: _Scalar) -> Expression:
        return self + -_expression(other)

    def __rsub__(self, other: _Scalar) -> Expression:
        return -self + other

    def __mul__(self, other: _Scalar) -> Expression:
        total: dict[Monomial, Fraction] = {}
        unresolved = ZERO
        right = _expression(other).terms
        spend(
            len(self.terms)
            * len(right)
            * (1 + (_bits(self.terms) + _bits(right)) // _BITS_PER_WORK)
        )
        for left_monomial, left in self.terms:
            for right_monomial, coefficient in right:
                monomial, factor = _merged(left_monomial, right_monomial)
                if factor is None:
                    total[monomial] = total.get(monomial, Fraction(0)) + left * coefficient
                else:
                    unresolved = unresolved + Expression(((monomial, left * coefficient),)) * factor
        product = _collected(total)
        return product if unresolved.is_zero else product + unresolved

    __radd__ = __add__
    __rmul__ = __mul__

    def __truediv__(self, other: _Scalar) -> Expression:
        divisor = _expression(other)
        ratio = _ratio(self, divisor)
        return self * _reciprocal(divisor) if ratio is None else Expression.number(ratio)

    def __rtruediv__(self, other: _Scalar) -> Expression:
        return _expression(other) / self

    def __pow__(self, exponent: int) -> Expression:
        if abs(exponent) > BOUNDS.exponent:
            raise ExpressionError(f"an exponent beyond {BOUNDS.exponent}")
        if exponent < 0:
            return (1 / self) ** -exponent
        result = Expression.number(1)
        for bit in f"{exponent:b}":
            result = result * result * (self if bit == "1" else 1)
        return result


def _bits(terms: Iterable[tuple[Monomial, Fraction]]) -> int:
    """Return the size of the longest coefficient."""
    return max((c.numerator.bit_length() + c.denominator.bit_length() for _, c in terms), default=0)


def _power(base: Fraction, exponent: int) -> Fraction:
    """Return a power of a rounded number, rounded to more digits than the number has; exact powers would grow long."""
    if exponent < 0:
        return 1 / _power(base, -exponent)
    result = Fraction(1)
    for bit in f"{exponent:b}":
        result = _shortened(result * result * (base if bit == "1" else 1))
    return result


def _shortened(value: Fraction) -> Fraction:
    size = value.numerator.bit_length() - value.denominator.bit_length()
    if value.numerator.bit_length() + value.denominator.bit_length() <= 2 * _POWER_BITS:
        return value
    scale = Fraction(2) ** (_POWER_BITS - size)
    return Fraction(round(value * scale)) / scale


_BITS_PER_WORK = 256
"""Size of two coefficients, bits, whose product takes as long as adding a term; a budget counts both."""
_POWER_BITS = 400
"""Precision of powers of pi and functions, bits: 120 digits, twice those of pi."""
_SHOWN_LENGTH = 120
"""Longest expression in a message, characters."""
_CANCELLED = Fraction(1, 10**14)
"""A sum of rounded values may be zero if it is below this share of its terms' sizes; each is rounded to 1e-16."""

ZERO = Expression()
PI = Expression.of_atom(Atom("pi"))


def _expression(value: _Scalar) -> Expression:
    return value if isinstance(value, Expression) else Expression.number(value)


def _symbols(expression: Expression) -> Iterator[str]:
    for monomial, _ in expression.terms:
        for atom, _ in monomial:
            if atom.is_symbol:
                yield atom.name
            for argument in atom.arguments:
                yield from _symbols(argument)


def _order(term: tuple[Monomial, Fraction]) -> tuple[int, str]:
    """Sort terms by falling degree, then by name."""
    monomial, _ = term
    return -sum(abs(exponent) for _, exponent in monomial), " ".join(
        f"{atom.text}^{exponent}" for atom, exponent in monomial
    )


def _collected(total: Mapping[Monomial, Fraction]) -> Expression:
    spend(1 + len(total))
    terms = [term for term in total.items() if term[1]]
    if len(terms) > BOUNDS.terms:
        raise ExpressionError(f"an expression of more than {BOUNDS.terms} terms")
    if any(
        c.numerator.bit_length() + c.denominator.bit_length() > BOUNDS.coefficient_bits
        for _, c in terms
    ):
        raise ExpressionError("a number too long to be kept exactly")
    return Expression(tuple(sorted(terms, key=_order) if len(terms) > 1 else terms))


def _merged(left: Monomial, right: Monomial) -> tuple[Monomial, Expression | None]:
    """Return the product of two monomials, and the factor that powers of square roots and groups resolve to."""
    if not left or not right:
        return left or right, None
    spend((len(left) + len(right)) // 4)
    powers = dict(left)
    for atom, exponent in right:
        powers[atom] = powers.get(atom, 0) + exponent
    if any(abs(exponent) > BOUNDS.exponent**2 for exponent in powers.values()):
        raise ExpressionError(f"an exponent of more than {BOUNDS.exponent**2}")
    factor: Expression | None = None
    for atom, exponent in list(powers.items()):
        resolved = 0
        left_over = exponent
        if atom.name == "sqrt" and atom.arguments:
            resolved, left_over = divmod(exponent, 2)
        elif atom.name == "group" and exponent > 0:
            resolved = exponent
            left_over = 0
        if resolved:
            factor = (factor or Expression.number(1)) * atom.arguments[0] ** resolved
        powers[atom] = left_over
    return tuple(
        sorted(((a, e) for a, e in powers.items() if e), key=lambda power: power[0].text)
    ), factor


def _ratio(dividend: Expression, divisor: Expression) -> Fraction | None:
    """Return the rational r with dividend = r divisor; None if there is none. Groups in denominators would hide it."""
    if not dividend.terms or not divisor.terms:
        return None
    ratio = dividend.terms[0][1] / divisor.terms[0][1]
    return ratio if dividend.terms == tuple((m, c * ratio) for m, c in divisor.terms) else None


def _is_rounding(atom: Atom, value: Fraction) -> bool:
    """Return whether a group's value is within the rounding of its terms, as for sin^2 + cos^2 - 1."""
    if atom.name != "group":
        return False
    terms = sum(abs(Expression((term,)).value()) for term in atom.arguments[0].terms)
    return abs(value) <= _CANCELLED * terms


def _reciprocal(divisor: Expression) -> Expression:
    """Return 1/divisor; a sum is divided by its leading coefficient and kept whole as a group."""
    if divisor.is_zero:
        raise ExpressionError("division by zero")
    monomial, leading = divisor.terms[0]
    if len(divisor.terms) > 1:
        group = Expression.of_atom(Atom("group", (divisor * (1 / leading),)))
        ((((atom, _),), _),) = group.terms
        return Expression(((((atom, -1),), 1 / leading),))
    inverse = Expression.number(1 / leading)
    for atom, exponent in monomial:
        inverse = inverse * _atom_power(atom, -exponent)
    return inverse


def _atom_power(atom: Atom, exponent: int) -> Expression:
    monomial, factor = _merged(((atom, exponent),), ((atom, 0),))
    power = Expression(((monomial, Fraction(1)),))
    return power if factor is None else power * factor


def _term_text(monomial: Monomial, coefficient: Fraction) -> str:
    numerator = [_power_text(atom, exponent) for atom, exponent in monomial if exponent > 0]
    denominator = [_power_text(atom, -exponent) for atom, exponent in monomial if exponent < 0]
    magnitude = abs(coefficient)
    has_pi = any(atom.name == "pi" for atom, _ in monomial)
    small = max(magnitude.numerator, magnitude.denominator) <= MAX_FRACTION_PART
    decimal = None if monomial and (has_pi or small) else decimal_text(magnitude)
    if decimal is not None:
        numerator[:0] = [decimal] if not monomial or magnitude != 1 else []
    else:
        numerator[:0] = (
            [str(magnitude.numerator)] if magnitude.numerator != 1 or not numerator else []
        )
        denominator[:0] = [str(magnitude.denominator)] if magnitude.denominator != 1 else []
    text = "*".join(numerator or ["1"]) + "".join(f"/{factor}" for factor in denominator)
    return f"-{text}" if coefficient < 0 else text


def _power_text(atom: Atom, exponent: int) -> str:
    return str(atom) if exponent == 1 else f"{atom}^{exponent}"
