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
from dhkit.symbolic.ring import Element, Ring, RingError

MAX_EXPONENT = 64
MAX_WORK = 300_000
"""Work that reading one entry may take: pairs of terms in products, weighted by the size of their coefficients. A
PUMA's longest entry takes 60,000; the bound is about a second on sympy's rings."""
WEIGHED_BITS = 256
"""Size of a coefficient, in bits, from which a pair of terms counts as more than one."""
MAX_TERMS = 60_000
MAX_BITS = 8_192
"""Largest size of a coefficient in bits. Doubles need 1,100; products of 8,192 bits still take microseconds."""
MAX_DIVISORS = 16
"""Divisors that are kept, to say where an entry is undefined."""
CHECKED = 64
"""Terms of a sum after which its coefficients' size is measured."""
TOO_LONG = "a number too long to be kept exactly"
TOO_MUCH = "it multiplies out to too many terms"


class OutsideTheRingError(Exception):
    """An answer that cannot be decided exactly: half angles, roots of the state, cases, or too long to multiply out."""


@dataclass(frozen=True, eq=False)
class Quotient:
    """An answer as a quotient; its denominator is not zero."""

    numerator: Element
    denominator: Element
    bits: int = 1
    """Bound on the size of its coefficients in bits."""

    @property
    def is_polynomial(self) -> bool:
        """Whether the denominator is 1."""
        return self.denominator == 1

    def numerator_of_difference(self, truth: Element) -> Element:
        """Return the numerator of the difference from an element: zero if and only if both are equal."""
        return self.numerator - truth * self.denominator

    def equals(self, other: Quotient) -> bool:
        """Whether two answers are the same quotient."""
        return (self.numerator * other.denominator - other.numerator * self.denominator).is_zero

    def element(self) -> Element | None:
        """Return the element that this is, where the division leaves no remainder."""
        if self.is_polynomial:
            return self.numerator
        ring = self.numerator.ring
        polynomial = ring.polynomials.quotient(self.numerator.polynomial, self.denominator.polynomial)
        return None if polynomial is None else Element(ring, polynomial).reduced()


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
        A division by zero.
    """

    def __init__(
        self, ring: Ring, degrees: Fraction | None = None, others: Mapping[str, Fraction] | None = None
    ) -> None:
        self.ring = ring
        self.others = others or {}
        self.degrees = degrees
        self.divisors: list[Element] = []
        """What the last entry divides by, numbers left out: where one is zero, the entry is undefined."""
        self._work = 0
        self._shared: dict[int, Quotient] = {}
        self._angles: dict[Expression, tuple[Element, Element]] = {}
        self._names = [f"q{i + 1}" for i in range(ring.n)]
        self._constants = set(ring.constants)

    def read(self, tree: Tree) -> Quotient:
        """Return what a tree in the robot's own names is.

        Raises
        ------
        OutsideTheRingError
            It cannot be written in the ring, or only with too much work.
        AnswerError
            A division by zero.
        """
        self._work = 0
        self._shared = {}
        self.divisors = []
        try:
            return self._quotient(tree)
        except RingError:
            raise OutsideTheRingError(TOO_MUCH) from None

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
                return Quotient(self.ring.number(value), self.ring.one, bits)
            case Name(text):
                return self._whole(self._name(text))
            case Sum(terms):
                return self._sum(terms)
            case Product(factors):
                return self._product(factors)
            case Power(base, exponent):
                return self._power(base, self.exponent(exponent))
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
            above = quotient.numerator if added else -quotient.numerator
            if quotient.denominator is one:
                whole.append(above)
                over_one = Quotient(over_one.numerator, one, over_one.bits + quotient.bits)
            elif total is None:
                total = Quotient(above, quotient.denominator, quotient.bits)
            elif total.denominator.polynomial == quotient.denominator.polynomial:
                total = Quotient(total.numerator + above, total.denominator, total.bits + quotient.bits)
            else:
                above = self._times(total.numerator, quotient.denominator) + self._times(above, total.denominator)
                below = self._times(total.denominator, quotient.denominator)
                total = self._bounded(Quotient(above, below, total.bits + quotient.bits))
            if k % CHECKED == 0 or k == len(terms):
                over_one = self._bounded(Quotient(self.ring.sum([over_one.numerator, *whole]), one, over_one.bits))
                whole = []
        if total is None:
            return over_one
        above = total.numerator + self._times(over_one.numerator, total.denominator)
        return self._bounded(Quotient(above, total.denominator, total.bits + over_one.bits))

    def _product(self, factors: tuple[tuple[bool, Tree], ...]) -> Quotient:
        product = Quotient(self.ring.one, self.ring.one)
        for multiplied, factor in factors:
            quotient = self._quotient(factor)
            if not multiplied:
                self._divides_by(quotient.numerator)
            top, bottom = (
                (quotient.numerator, quotient.denominator) if multiplied else (quotient.denominator, quotient.numerator)
            )
            above, below = self._times(product.numerator, top), self._times(product.denominator, bottom)
            product = self._bounded(Quotient(above, below, product.bits + quotient.bits))
        return self._divided(product.numerator, product.denominator, product.bits)

    def _divided(self, numerator: Element, denominator: Element, bits: int = 1) -> Quotient:
        if denominator is self.ring.one:
            return Quotient(numerator, denominator, bits)
        if denominator.is_zero:
            raise AnswerError("divides by zero")
        number = _rational(denominator)
        if number is None:
            return Quotient(numerator, denominator, bits)
        return Quotient(numerator * (1 / number), self.ring.one, bits)

    def _divides_by(self, element: Element) -> None:
        """Note a divisor that is no number."""
        if _rational(element) is not None or len(self.divisors) >= MAX_DIVISORS:
            return
        if not any(element.polynomial == other.polynomial for other in self.divisors):
            self.divisors.append(element)

    def _power(self, base: Tree, exponent: int) -> Quotient:
        quotient = self._quotient(base)
        if quotient.bits * abs(exponent) > MAX_BITS:
            quotient = self._bounded(Quotient(quotient.numerator, quotient.denominator, MAX_BITS + 1))
            if quotient.bits * abs(exponent) > 4 * MAX_BITS:
                raise OutsideTheRingError(TOO_LONG)
        above, below = (self._raised(part, abs(exponent)) for part in (quotient.numerator, quotient.denominator))
        if exponent < 0:
            self._divides_by(quotient.numerator)
            above, below = below, above
        return self._bounded(self._divided(above, below, max(1, quotient.bits * abs(exponent))))

    def _bounded(self, quotient: Quotient) -> Quotient:
        """Refuse coefficients of thousands of digits, whose arithmetic nobody waits for."""
        if quotient.bits <= MAX_BITS:
            return quotient
        bits = max((_bits(element) for element in (quotient.numerator, quotient.denominator)), default=1)
        if bits > MAX_BITS:
            raise OutsideTheRingError(TOO_LONG)
        return Quotient(quotient.numerator, quotient.denominator, bits)

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
        pairs = len(left) * len(right)
        self._work += pairs + (pairs * _bits(right) // WEIGHED_BITS if pairs > CHECKED else 0)
        if self._work > MAX_WORK:
            raise OutsideTheRingError(TOO_MUCH)
        product = left * right
        if len(product) > MAX_TERMS:
            raise OutsideTheRingError(TOO_MUCH)
        return product

    def exponent(self, tree: Tree) -> int:
        """Return the whole number that an exponent is.

        Raises
        ------
        OutsideTheRingError
            It is none, or too large to multiply out.
        """
        try:
            number = value_of(tree, ()).rational
        except ExpressionError:
            number = None
        if number is None or number.denominator != 1:
            raise OutsideTheRingError("an exponent that is no whole number")
        if abs(number) > MAX_EXPONENT:
            raise OutsideTheRingError(f"an exponent of {str(number)[:20]}, beyond {MAX_EXPONENT}")
        return int(number)

    def _call(self, function: str, arguments: tuple[Tree, ...]) -> Quotient:
        if function in ("sin", "cos", "tan"):
            cosine, sine = self._direction(arguments[0])
            if function == "tan":
                self._divides_by(cosine)
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
            raise OutsideTheRingError(f"an angle of {str(times)[:20]} q{i + 1}, beyond {MAX_EXPONENT} times")
        one = (self.ring.cosine(i), self.ring.sine(i))
        turn = (self.ring.one, self.ring.zero)
        for _ in range(abs(int(times))):
            turn = self._turn(turn, one)
        return turn if times > 0 else (turn[0], -turn[1])

    def _turn(self, a: tuple[Element, Element], b: tuple[Element, Element]) -> tuple[Element, Element]:
        times = self._times
        return times(a[0], b[0]) - times(a[1], b[1]), times(a[1], b[0]) + times(a[0], b[1])


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
