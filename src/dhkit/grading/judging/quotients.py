"""Answers in the exact ring: quotients of two elements, which decide equality; work and size are bounded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from dhkit.errors import AnswerError, ExpressionError
from dhkit.expressions import CONSTANTS, Budget, Expression, exact_angle
from dhkit.expressions.exact import Atom
from dhkit.expressions.parser import value_of
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.grading.judging.numeric import parts_of
from dhkit.symbolic.ring import Element, Ring, RingError

__all__ = ["OutsideTheRingError", "Quotient", "Reading", "decimals_in"]

MAX_EXPONENT = 64
MAX_WORK = 3_000_000
"""Pairs of terms that all products of an entry may have together: seconds."""
MAX_TERMS = 60_000
MAX_BITS = 8_192
"""Of a coefficient: beyond the range of a double by far, and still fast."""
CHECKED = 64
"""Terms of a sum after which its coefficients are looked at."""
TOO_LONG = "a number too long to be kept exactly"


class OutsideTheRingError(Exception):
    """An answer with half angles, roots of what depends on the state, or cases: it cannot be decided exactly."""


@dataclass(frozen=True, eq=False)
class Quotient:
    """An answer as a quotient; its denominator is not zero."""

    above: Element
    below: Element
    bits: int = 1
    """At most so many bits have its coefficients."""

    @property
    def is_polynomial(self) -> bool:
        """Whether nothing stands below the bar but 1."""
        return self.below == 1

    def less(self, truth: Element) -> Element:
        """Return the numerator of the difference from an element: zero if and only if both are equal."""
        return self.above - truth * self.below

    def element(self) -> Element | None:
        """Return the element that this is, where the division leaves no remainder."""
        if self.is_polynomial:
            return self.above
        polynomial = self.above.ring.polynomials.quotient(self.above.polynomial, self.below.polynomial)
        return None if polynomial is None else Element(self.above.ring, polynomial).reduced()


class Reading:
    """Reads syntax trees into a ring.

    Parameters
    ----------
    ring
        Where the truth is.
    others
        Numbers of the file's parameters that the ring does not have.
    degrees
        Whether the joint variables in angles are multiplied by a factor that is to be taken off: what an answer would
        be if its angles were not confused with degrees.

    Raises
    ------
    AnswerError
        Too much work, a division by zero, an exponent out of bounds.
    """

    def __init__(
        self, ring: Ring, degrees: Fraction | None = None, others: Mapping[str, Fraction] | None = None
    ) -> None:
        self.ring = ring
        self.others = others or {}
        self.degrees = degrees
        self.moved: Mapping[int, Fraction] = {}
        self._work = 0
        self._shared: dict[int, Quotient] = {}
        self._angles: dict[Expression, tuple[Element, Element]] = {}
        self._names = [f"q{i + 1}" for i in range(ring.n)]
        self._constants = set(ring.constants)

    def read(self, tree: Tree, moved: Mapping[int, Fraction] | None = None) -> Quotient:
        """Return what a tree is.

        Parameters
        ----------
        tree
            In the robot's own names.
        moved
            How much numbers are moved, by the identity of their nodes; never those in angles or exponents.

        Raises
        ------
        OutsideTheRingError
            It cannot be written in the ring.
        AnswerError
            Too much work, a division by zero, an exponent out of bounds.
        """
        self.moved = moved or {}
        self._work = 0
        self._shared = {}
        try:
            return self._quotient(tree)
        except RingError as error:
            raise AnswerError(f"too long to be multiplied out: {error}") from None

    def _quotient(self, tree: Tree) -> Quotient:
        # CasADi's graphs share what is used twice.
        found = self._shared.get(id(tree))
        if found is None:
            found = self._shared[id(tree)] = self._read(tree)
        return found

    def _read(self, tree: Tree) -> Quotient:
        match tree:
            case Number(value=value):
                bits = value.numerator.bit_length() + value.denominator.bit_length()
                return Quotient(self.ring.number(value + self.moved.get(id(tree), 0)), self.ring.one, bits)
            case Name(text):
                return self._whole(self._name(text))
            case Sum(terms):
                return self._sum(terms)
            case Product(factors):
                return self._product(factors)
            case Power(base, exponent):
                return self._power(base, self._exponent(exponent))
            case Call(function, arguments):
                return self._call(function, arguments)

    def _whole(self, element: Element) -> Quotient:
        return Quotient(element, self.ring.one)

    def _name(self, text: str) -> Element:
        ring = self.ring
        if text in self._constants:
            return ring.constant(text)
        if text in self.others:
            return ring.number(self.others[text])
        if text in CONSTANTS:
            unit = CONSTANTS[text].rational
            if unit is None:
                raise OutsideTheRingError(f"{text} outside an angle")
            return ring.number(unit)
        for kind, prefix in (("acceleration", "qdd"), ("rate", "qd"), ("position", "q")):
            if text.startswith(prefix) and text[len(prefix) :].isdecimal():
                try:
                    place = ring.place(kind, int(text[len(prefix) :]) - 1)
                except KeyError:
                    raise OutsideTheRingError(f"{text} outside a sine or a cosine") from None
                return Element(ring, ring.polynomials.generator(place))
        raise OutsideTheRingError(f"{text}, which the equations do not have,")

    def _sum(self, terms: tuple[tuple[bool, Tree], ...]) -> Quotient:
        """Add terms, those over 1 first."""
        one = self.ring.one
        whole: list[Element] = []
        over_one = Quotient(self.ring.zero, one)
        total: Quotient | None = None
        for k, (added, term) in enumerate(terms, start=1):
            quotient = self._quotient(term)
            above = quotient.above if added else -quotient.above
            if quotient.below is one:
                whole.append(above)
                over_one = Quotient(over_one.above, one, over_one.bits + quotient.bits)
            elif total is None:
                total = Quotient(above, quotient.below, quotient.bits)
            elif total.below.polynomial == quotient.below.polynomial:
                total = Quotient(total.above + above, total.below, total.bits + quotient.bits)
            else:
                above = self._times(total.above, quotient.below) + self._times(above, total.below)
                below = self._times(total.below, quotient.below)
                total = self._bounded(Quotient(above, below, total.bits + quotient.bits))
            if k % CHECKED == 0 or k == len(terms):
                over_one = self._bounded(Quotient(self.ring.sum([over_one.above, *whole]), one, over_one.bits))
                whole = []
        if total is None:
            return over_one
        above = total.above + self._times(over_one.above, total.below)
        return self._bounded(Quotient(above, total.below, total.bits + over_one.bits))

    def _product(self, factors: tuple[tuple[bool, Tree], ...]) -> Quotient:
        product = Quotient(self.ring.one, self.ring.one)
        for multiplied, factor in factors:
            quotient = self._quotient(factor)
            top, bottom = (quotient.above, quotient.below) if multiplied else (quotient.below, quotient.above)
            above, below = self._times(product.above, top), self._times(product.below, bottom)
            product = self._bounded(Quotient(above, below, product.bits + quotient.bits))
        return self._divided(product.above, product.below, product.bits)

    def _divided(self, above: Element, below: Element, bits: int = 1) -> Quotient:
        if below.is_zero:
            raise AnswerError("divides by zero")
        number = _rational(below)
        if number is None:
            return Quotient(above, below, bits)
        return Quotient(above * (1 / number), self.ring.one, bits)

    def _power(self, base: Tree, exponent: int) -> Quotient:
        quotient = self._quotient(base)
        if quotient.bits * abs(exponent) > MAX_BITS:
            quotient = self._bounded(Quotient(quotient.above, quotient.below, MAX_BITS + 1))
            if quotient.bits * abs(exponent) > 4 * MAX_BITS:
                raise AnswerError(TOO_LONG)
        above, below = self._raised(quotient.above, abs(exponent)), self._raised(quotient.below, abs(exponent))
        if exponent < 0:
            above, below = below, above
        return self._bounded(self._divided(above, below, max(1, quotient.bits * abs(exponent))))

    def _bounded(self, quotient: Quotient) -> Quotient:
        """Refuse coefficients of thousands of digits, whose arithmetic nobody waits for."""
        if quotient.bits <= MAX_BITS:
            return quotient
        bits = max((_bits(element) for element in (quotient.above, quotient.below)), default=1)
        if bits > MAX_BITS:
            raise AnswerError(TOO_LONG)
        return Quotient(quotient.above, quotient.below, bits)

    def _raised(self, element: Element, exponent: int) -> Element:
        result = self.ring.one
        for bit in f"{exponent:b}" if exponent else "":
            result = self._times(result, result)
            if bit == "1":
                result = self._times(result, element)
        return result

    def _times(self, left: Element, right: Element) -> Element:
        if left is self.ring.one:
            return right
        if right is self.ring.one:
            return left
        self._work += len(left) * len(right)
        if self._work > MAX_WORK:
            raise AnswerError("multiplies out to too many terms")
        product = left * right
        if len(product) > MAX_TERMS:
            raise AnswerError(f"an expression of {len(product)} terms; expected at most {MAX_TERMS}")
        return product

    def _exponent(self, tree: Tree) -> int:
        try:
            number = value_of(tree, ()).rational
        except ExpressionError:
            number = None
        if number is None or number.denominator != 1:
            raise OutsideTheRingError("an exponent that is no whole number")
        if abs(number) > MAX_EXPONENT:
            raise AnswerError(f"an exponent of {str(number)[:20]}; expected at most {MAX_EXPONENT}")
        return int(number)

    def _call(self, function: str, arguments: tuple[Tree, ...]) -> Quotient:
        if function in ("sin", "cos", "tan"):
            cosine, sine = self._direction(arguments[0])
            if function == "tan":
                return self._divided(sine, cosine)
            return self._whole(cosine if function == "cos" else sine)
        if function in ("sign", "abs", "sqrt", "asin", "acos", "atan", "atan2"):
            return self._constant(function, arguments)
        raise OutsideTheRingError(f"{function}()")

    def _constant(self, function: str, arguments: tuple[Tree, ...]) -> Quotient:
        """Read a function of parameters alone: a root of a number, or what the file has too."""
        try:
            with Budget():
                expression = value_of(Call(function, arguments, 0), [*self._constants, *self._names])
            return self._whole(self.ring.read(expression))
        except (ExpressionError, RingError):
            raise OutsideTheRingError(f"{function}()") from None

    def _direction(self, angle: Tree) -> tuple[Element, Element]:
        """Return cosine and sine of whole multiples of joint variables and of constant angles."""
        try:
            with Budget():
                expression = exact_angle(value_of(angle, [*self._symbols, *self._names]))
        except ExpressionError:
            raise OutsideTheRingError("an angle that is no sum") from None
        if expression not in self._angles:
            self._angles[expression] = self._turned(expression)
        return self._angles[expression]

    @property
    def _symbols(self) -> set[str]:
        return {name for constant in self.ring.given for name in constant.symbols}

    def _turned(self, angle: Expression) -> tuple[Element, Element]:
        c, s = self.ring.one, self.ring.zero
        rest = []
        for monomial, coefficient in angle.terms:
            name = monomial[0][0].name if monomial else ""
            if name in self._names and monomial == ((Atom(name), 1),) and self.degrees is None:
                turn = self._multiple(int(name[1:]) - 1, coefficient)
            elif self.degrees is not None and (own := _with_degrees(monomial, coefficient, self.degrees)):
                turn = self._multiple(own[0], own[1])
            else:
                rest.append((monomial, coefficient))
                continue
            c, s = self._turn((c, s), turn)
        if rest:
            try:
                constant = self.ring.direction(exact_angle(Expression(tuple(rest))))
            except (RingError, ExpressionError):
                raise OutsideTheRingError(f"an angle of {Expression(tuple(rest))}") from None
            c, s = self._turn((c, s), constant)
        return c, s

    def _multiple(self, i: int, times: Fraction) -> tuple[Element, Element]:
        """Return cosine and sine of a whole multiple of joint i's variable."""
        if times.denominator != 1 or i not in self.ring.angles:
            raise OutsideTheRingError(
                f"an angle of {times} q{i + 1}" if i in self.ring.angles else f"an angle of q{i + 1}"
            )
        if abs(times) > MAX_EXPONENT:
            raise AnswerError(f"an angle of {str(times)[:20]} q{i + 1}; expected at most {MAX_EXPONENT} times")
        one = (self.ring.cosine(i), self.ring.sine(i))
        turn = (self.ring.one, self.ring.zero)
        for _ in range(abs(int(times))):
            turn = self._turn(turn, one)
        return turn if times > 0 else (turn[0], -turn[1])

    def _turn(self, a: tuple[Element, Element], b: tuple[Element, Element]) -> tuple[Element, Element]:
        times = self._times
        return times(a[0], b[0]) - times(a[1], b[1]), times(a[1], b[0]) + times(a[0], b[1])


def decimals_in(tree: Tree, least: int) -> dict[int, Fraction]:
    """Return half a unit of the last digit of every decimal of so many significant digits, by its node's identity.

    Those in angles and exponents are not rounded: they are left out.
    """
    found: dict[int, Fraction] = {}
    for part in parts_of(tree, coefficients=True):
        if isinstance(part, Number) and ("." in part.text or "e" in part.text.lower()):
            digits = part.text.lower().partition("e")[0].replace(".", "").lstrip("0")
            if len(digits) >= least:
                found[id(part)] = _half_unit(part.text)
    return found


def _half_unit(text: str) -> Fraction:
    mantissa, _, exponent = text.lower().partition("e")
    return Fraction(1, 2) * Fraction(10) ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def _rational(element: Element) -> Fraction | None:
    """Return the number that an element is."""
    if len(element) != 1:
        return None
    ((monomial, coefficient),) = element.terms.items()
    return None if any(monomial) else coefficient


def _with_degrees(
    monomial: tuple[tuple[Atom, int], ...], coefficient: Fraction, factor: Fraction
) -> tuple[int, Fraction] | None:
    """Return the joint, from 0, and its multiple, of a term q pi/180 or q 180/pi; nothing of another term."""
    powers = {atom.name: exponent for atom, exponent in monomial}
    joints = [name for name in powers if name.startswith("q") and name[1:].isdecimal()]
    if len(joints) != 1 or powers[joints[0]] != 1:
        return None
    expected = {"pi": 1} if factor < 1 else {"pi": -1}
    return (int(joints[0][1:]) - 1, coefficient / factor) if powers == {joints[0]: 1, **expected} else None


def _bits(element: Element) -> int:
    """Return how long the longest coefficient is."""
    return max((c.numerator.bit_length() + c.denominator.bit_length() for c in element.terms.values()), default=1)
