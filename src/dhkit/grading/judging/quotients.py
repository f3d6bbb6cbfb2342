"""Answers in the exact ring: quotients of two elements, which decide equality; work and size are bounded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from dhkit.errors import AnswerError, ExpressionError
from dhkit.expressions import CONSTANTS, Budget, Expression, exact_angle
from dhkit.expressions.exact import Atom
from dhkit.expressions.parser import value_of
from dhkit.expressions.syntax import Call, Name, Number, Power, Tree
from dhkit.expressions.trees import Algebra
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.symbolic.ring import Direction, Element, Monomial, Ring, RingError

_WEIGHTED_BITS = 256
"""Size of a coefficient, in bits, from which a pair of terms counts as more than one: long numbers multiply slowly."""
_CHECK_INTERVAL = 64
"""Number of terms of a sum after which the size of its coefficients is measured; measuring each term would cost more
than adding it. Products of fewer pairs of terms are not weighted by the size of their coefficients either."""
_NUMBER_TOO_LONG = "a number too long to be kept exactly"
_TOO_MANY_TERMS = "it multiplies out to too many terms"


class OutsideTheRingError(Exception):
    """An answer that cannot be decided exactly: half angles, roots of the state, cases, or too long to multiply out."""


@dataclass(frozen=True, eq=False)
class Quotient:
    """An answer as a quotient N / D of ring elements; its denominator D is not zero."""

    numerator: Element
    denominator: Element
    bits: int = 1
    """Upper bound on the size of its coefficients in bits: estimated, and measured only where the estimate is large."""

    @property
    def is_polynomial(self) -> bool:
        """Whether the denominator is 1."""
        return self.denominator == 1

    def numerator_of_difference(self, truth: Element) -> Element:
        """Return the numerator of the difference from an element: zero if and only if both are equal.

        N / D - t = (N - t D) / D, and D is not zero.
        """
        return self.numerator - truth * self.denominator

    def equals(self, other: Quotient) -> bool:
        """Whether two answers are the same quotient: N / D = N' / D' if and only if N D' - N' D = 0."""
        return (self.numerator * other.denominator - other.numerator * self.denominator).is_zero

    def element(self) -> Element | None:
        """Return this quotient as an element; None if the division leaves a remainder."""
        if self.is_polynomial:
            return self.numerator
        ring = self.numerator.ring
        polynomial = ring.polynomials.quotient(
            self.numerator.polynomial, self.denominator.polynomial
        )
        return None if polynomial is None else Element(ring, polynomial).reduced()


class RingReader(Algebra[Quotient]):
    """Reads syntax trees into a ring.

    Parameters
    ----------
    ring
        Ring of the truth.
    angle_factor
        Factor, 1/180 or 180, that joint variables in angles have besides pi or 1/pi. The reader removes it: it reads an
        answer that confuses degrees and radians as if it did not. None to read angles as they are written.
    numbers
        Values of the file's parameters that the ring does not have, in SI units and rad.
    """

    def __init__(
        self,
        ring: Ring,
        angle_factor: Fraction | None = None,
        numbers: Mapping[str, Fraction] | None = None,
    ) -> None:
        super().__init__()
        self.ring = ring
        self.numbers = numbers or {}
        self.angle_factor = angle_factor
        self.divisors: list[Element] = []
        """Divisors of the last entry that are not numbers: the entry is undefined at states where one is zero."""
        self._work = 0
        """Pairs of terms multiplied for the last entry, weighted by the size of their coefficients."""
        self._angles: dict[Expression, Direction] = {}
        """Cosine and sine of the angles read so far."""
        self._names = [f"q{i + 1}" for i in range(ring.n)]
        self._constants = set(ring.constants)

    def read(self, tree: Tree) -> Quotient:
        """Return a tree in the robot's own names as a quotient.

        Raises
        ------
        OutsideTheRingError
            The tree cannot be written in the ring, or only with too much work.
        AnswerError
            A division by zero.
        """
        self._work = 0
        self.shared = {}
        self.divisors = []
        try:
            return self.of(tree)
        except RingError:
            raise OutsideTheRingError(_TOO_MANY_TERMS) from None

    def element(self, tree: Tree) -> Element | None:
        """Return a syntax tree as an element of the ring; None if it is not one, or cannot be read."""
        try:
            return self.read(tree).element()
        except (OutsideTheRingError, AnswerError):
            return None

    def number(self, tree: Number) -> Quotient:
        """Return a number as a quotient with denominator 1."""
        bits = tree.value.numerator.bit_length() + tree.value.denominator.bit_length()
        return self._polynomial(self.ring.number(tree.value), bits)

    def name(self, tree: Name) -> Quotient:
        """Return a name (joint variable, rate, acceleration, parameter, unit) as a quotient with denominator 1."""
        return self._polynomial(self._name(tree.text))

    def call(self, tree: Call) -> Quotient:
        """Return the value of a function: sines, cosines and tangents of angles, and roots that the ring has."""
        return self._call(tree.function, tree.arguments)

    def power(self, tree: Power) -> Quotient:
        """Return a power with a whole exponent, multiplied out."""
        return self._power(tree.base, self.exponent(tree.exponent))

    def _name(self, text: str) -> Element:
        ring = self.ring
        if text in self._constants:
            return ring.constant(text)
        if text in self.numbers:
            return ring.number(self.numbers[text])
        if text in CONSTANTS:
            unit = CONSTANTS[text].rational
            if unit is None:
                raise OutsideTheRingError(f"{text} outside an angle")
            return ring.number(unit)

        for kind, prefix in (("acceleration", "qdd"), ("rate", "qd"), ("position", "q")):
            number = text.removeprefix(prefix)
            if number == text or not number.isdecimal():
                continue
            joint = int(number) - 1
            try:
                place = ring.place(kind, joint)
            except KeyError:
                raise OutsideTheRingError(f"{text} outside a sine or a cosine") from None
            return Element(ring, ring.polynomials.generator(place))

        raise OutsideTheRingError(f"{text}, which the equations do not have,")

    def _polynomial(self, element: Element, bits: int = 1) -> Quotient:
        return Quotient(element, self.ring.one, bits)

    def sum(self, terms: Sequence[tuple[bool, Quotient]]) -> Quotient:
        """Add terms: those with denominator 1 in groups, the others one after the other."""
        one = self.ring.one
        polynomials = Quotient(self.ring.zero, one)
        pending: list[Element] = []
        pending_bits = 0
        fractions: Quotient | None = None

        for k, (added, quotient) in enumerate(terms, start=1):
            numerator = quotient.numerator if added else -quotient.numerator
            if quotient.denominator is one:
                pending.append(numerator)
                pending_bits += quotient.bits
            else:
                signed = Quotient(numerator, quotient.denominator, quotient.bits)
                fractions = signed if fractions is None else self._add_fractions(fractions, signed)

            if k % _CHECK_INTERVAL == 0 or k == len(terms):
                total = self.ring.sum([polynomials.numerator, *pending])
                polynomials = self._bound_coefficients(
                    Quotient(total, one, polynomials.bits + pending_bits)
                )
                pending = []
                pending_bits = 0

        if fractions is None:
            return polynomials

        # p + N / D = (N + p D) / D
        numerator = fractions.numerator + self._multiply(
            polynomials.numerator, fractions.denominator
        )
        bits = fractions.bits + polynomials.bits
        return self._bound_coefficients(Quotient(numerator, fractions.denominator, bits))

    def _add_fractions(self, a: Quotient, b: Quotient) -> Quotient:
        bits = a.bits + b.bits
        if a.denominator.polynomial == b.denominator.polynomial:
            return Quotient(a.numerator + b.numerator, a.denominator, bits)
        # N_a / D_a + N_b / D_b = (N_a D_b + N_b D_a) / (D_a D_b)
        numerator = self._multiply(a.numerator, b.denominator) + self._multiply(
            b.numerator, a.denominator
        )
        denominator = self._multiply(a.denominator, b.denominator)
        return self._bound_coefficients(Quotient(numerator, denominator, bits))

    def product(self, factors: Sequence[tuple[bool, Quotient]]) -> Quotient:
        """Multiply and divide, from left to right."""
        product = self._polynomial(self.ring.one)
        for is_factor, quotient in factors:
            above = quotient.numerator
            below = quotient.denominator
            if not is_factor:
                # 1 / (N / D) = D / N
                self._note_divisor(quotient.numerator)
                above, below = below, above
            numerator = self._multiply(product.numerator, above)
            denominator = self._multiply(product.denominator, below)
            bits = product.bits + quotient.bits
            product = self._bound_coefficients(Quotient(numerator, denominator, bits))
        return self._divide(product.numerator, product.denominator, product.bits)

    def _divide(self, numerator: Element, denominator: Element, bits: int = 1) -> Quotient:
        """Return a quotient of elements, a polynomial if the denominator is a number."""
        if denominator is self.ring.one:
            return Quotient(numerator, denominator, bits)
        if denominator.is_zero:
            raise AnswerError("divides by zero")
        number = _rational(denominator)
        if number is None:
            return Quotient(numerator, denominator, bits)
        return self._polynomial(numerator * (1 / number), bits)

    def _note_divisor(self, element: Element) -> None:
        """Keep a divisor unless it is a number."""
        if _rational(element) is not None or len(self.divisors) >= BOUNDS.divisors:
            return
        if not any(element.polynomial == other.polynomial for other in self.divisors):
            self.divisors.append(element)

    def _power(self, base: Tree, exponent: int) -> Quotient:
        quotient = self.of(base)
        power = abs(exponent)

        # Coefficients of x^k are about k times as long as those of x. The size of those of x is only estimated: it is
        # measured (a quotient said to be beyond the bound is) before the power is refused. Up to four times the bound
        # the power is multiplied out all the same, and its own coefficients are measured below.
        if quotient.bits * power > BOUNDS.coefficient_bits:
            unmeasured = Quotient(
                quotient.numerator, quotient.denominator, BOUNDS.coefficient_bits + 1
            )
            quotient = self._bound_coefficients(unmeasured)
            if quotient.bits * power > 4 * BOUNDS.coefficient_bits:
                raise OutsideTheRingError(_NUMBER_TOO_LONG)

        numerator = self._raise(quotient.numerator, power)
        denominator = self._raise(quotient.denominator, power)
        if exponent < 0:
            # (N / D)^-k = D^k / N^k
            self._note_divisor(quotient.numerator)
            numerator, denominator = denominator, numerator
        bits = max(1, quotient.bits * power)
        return self._bound_coefficients(self._divide(numerator, denominator, bits))

    def _bound_coefficients(self, quotient: Quotient) -> Quotient:
        """Return a quotient after a check of its coefficients' size, measured if the estimate exceeds the bound.

        Raises
        ------
        OutsideTheRingError
            A coefficient exceeds ``BOUNDS.coefficient_bits``.
        """
        if quotient.bits <= BOUNDS.coefficient_bits:
            return quotient
        bits = max(_bits(quotient.numerator), _bits(quotient.denominator))
        if bits > BOUNDS.coefficient_bits:
            raise OutsideTheRingError(_NUMBER_TOO_LONG)
        return Quotient(quotient.numerator, quotient.denominator, bits)

    def _raise(self, element: Element, exponent: int) -> Element:
        """Return a power by repeated squaring: x^(2 k + b) = (x^k)^2 x^b, over the binary digits b of the exponent."""
        result = self.ring.one
        digits = f"{exponent:b}" if exponent else ""
        for bit in digits:
            result = self._multiply(result, result)
            if bit == "1":
                result = self._multiply(result, element)
        return result

    def _multiply(self, left: Element, right: Element) -> Element:
        """Return a product, its work counted.

        Raises
        ------
        OutsideTheRingError
            The entry exceeds ``BOUNDS.reading_work``, or the product ``BOUNDS.product_terms``.
        """
        if left is self.ring.one:
            return right
        if right is self.ring.one:
            return left

        pairs = len(left) * len(right)
        self._work += pairs
        if pairs > _CHECK_INTERVAL:  # long coefficients take longer to multiply
            self._work += pairs * _bits(right) // _WEIGHTED_BITS
        if self._work > BOUNDS.reading_work:
            raise OutsideTheRingError(_TOO_MANY_TERMS)

        product = left * right
        if len(product) > BOUNDS.product_terms:
            raise OutsideTheRingError(_TOO_MANY_TERMS)
        return product

    def exponent(self, tree: Tree) -> int:
        """Return the value of an exponent.

        Raises
        ------
        OutsideTheRingError
            The exponent is not a whole number, or exceeds ``BOUNDS.exponent``.
        """
        try:
            number = value_of(tree, ()).rational
        except ExpressionError:
            number = None
        if number is None or number.denominator != 1:
            raise OutsideTheRingError("an exponent that is not a whole number")
        if abs(number) > BOUNDS.exponent:
            raise OutsideTheRingError(
                f"an exponent of {str(number)[:20]}, beyond {BOUNDS.exponent}"
            )
        return int(number)

    def _call(self, function: str, arguments: tuple[Tree, ...]) -> Quotient:
        match function:
            case "sin" | "cos" | "tan":
                cosine, sine = self._direction(arguments[0])
                if function == "cos":
                    return self._polynomial(cosine)
                if function == "sin":
                    return self._polynomial(sine)
                self._note_divisor(cosine)
                return self._divide(sine, cosine)
            case "sign" | "abs" | "sqrt" | "asin" | "acos" | "atan" | "atan2":
                # Such a function of numbers and parameters is a constant that the ring may have.
                try:
                    with Budget():
                        expression = value_of(
                            Call(function, arguments, 0), [*self._constants, *self._names]
                        )
                    return self._polynomial(self.ring.read(expression))
                except (ExpressionError, RingError):
                    pass
        raise OutsideTheRingError(f"{function}()")

    def _direction(self, angle: Tree) -> Direction:
        """Return cosine and sine of a sum of whole multiples of joint variables and constant angles."""
        symbols: set[str] = set()
        for constant in self.ring.given:
            symbols |= constant.symbols
        try:
            with Budget():
                expression = exact_angle(value_of(angle, [*symbols, *self._names]))
        except ExpressionError:
            raise OutsideTheRingError("an angle that is not a sum") from None
        if expression not in self._angles:
            self._angles[expression] = self._direction_of(expression)
        return self._angles[expression]

    def _direction_of(self, angle: Expression) -> Direction:
        """Return cosine and sine of an angle, term by term: k1 q1 + k2 q2 + ... + constant."""
        direction = (self.ring.one, self.ring.zero)
        constant_terms = []
        for monomial, coefficient in angle.terms:
            joint_multiple = self._joint_multiple(monomial, coefficient)
            if joint_multiple is None:
                constant_terms.append((monomial, coefficient))
            else:
                direction = self._add_angles(direction, self._multiple_angle(*joint_multiple))

        if constant_terms:
            constant = Expression(tuple(constant_terms))
            try:
                direction = self._add_angles(direction, self.ring.direction(exact_angle(constant)))
            except (RingError, ExpressionError):
                raise OutsideTheRingError(f"an angle of {constant}") from None
        return direction

    def _joint_multiple(
        self, monomial: tuple[tuple[Atom, int], ...], coefficient: Fraction
    ) -> tuple[int, Fraction] | None:
        """Return the joint, from 0, and the multiple k of a term k q; None for a term of another form.

        Where degrees and radians are confused (``angle_factor``), the term is k (pi/180) q or k (180/pi) q.
        """
        powers = {atom.name: exponent for atom, exponent in monomial}
        variables = [name for name in powers if name.startswith("q") and name[1:].isdecimal()]
        if len(variables) != 1:
            return None
        variable = variables[0]
        if powers[variable] != 1:
            return None
        joint = int(variable[1:]) - 1

        if self.angle_factor is None:
            is_plain = variable in self._names and len(monomial) == 1
            return (joint, coefficient) if is_plain else None

        # Degrees taken for radians have the factor pi/180, radians taken for degrees 180/pi.
        power_of_pi = 1 if self.angle_factor < 1 else -1
        is_confused = powers == {variable: 1, "pi": power_of_pi}
        return (joint, coefficient / self.angle_factor) if is_confused else None

    def _multiple_angle(self, i: int, times: Fraction) -> Direction:
        """Return cosine and sine of a whole multiple of the variable of joint i, from 0."""
        if i not in self.ring.angles:
            raise OutsideTheRingError(f"an angle of q{i + 1}")
        if times.denominator != 1:
            raise OutsideTheRingError(f"an angle of {times} q{i + 1}")
        if abs(times) > BOUNDS.exponent:
            raise OutsideTheRingError(
                f"an angle of {str(times)[:20]} q{i + 1}, beyond {BOUNDS.exponent} times"
            )

        single = (self.ring.cosine(i), self.ring.sine(i))
        total = (self.ring.one, self.ring.zero)
        for _ in range(abs(int(times))):
            total = self._add_angles(total, single)

        # cos(-k q) = cos(k q),    sin(-k q) = -sin(k q)
        cosine, sine = total
        return (cosine, sine if times > 0 else -sine)

    def _add_angles(self, a: Direction, b: Direction) -> Direction:
        """Return cosine and sine of a sum of angles, the work counted.

        cos(a + b) = cos a cos b - sin a sin b,    sin(a + b) = sin a cos b + cos a sin b
        """
        cos_a, sin_a = a
        cos_b, sin_b = b
        times = self._multiply
        cosine = times(cos_a, cos_b) - times(sin_a, sin_b)
        sine = times(sin_a, cos_b) + times(cos_a, sin_b)
        return cosine, sine


def multiple_angle(ring: Ring, joint: int, times: int) -> Direction:
    """Return cosine and sine of a whole multiple of the variable of a revolute joint, counted from 0."""
    # cos(-q) = cos(q),    sin(-q) = -sin(q)
    sign = 1 if times > 0 else -1
    single = (ring.cosine(joint), ring.sine(joint) * sign)
    return sum_of_angles(ring, [single] * abs(times))


def sum_of_angles(ring: Ring, directions: Iterable[Direction]) -> Direction:
    """Return cosine and sine of the sum of angles that are given by their cosines and sines."""
    cosine, sine = ring.one, ring.zero
    for cos_b, sin_b in directions:
        cos_a, sin_a = cosine, sine
        # cos(a + b) = cos a cos b - sin a sin b,    sin(a + b) = sin a cos b + cos a sin b
        cosine = cos_a * cos_b - sin_a * sin_b
        sine = sin_a * cos_b + cos_a * sin_b
    return cosine, sine


def varying(element: Element) -> Element:
    """Return an element without its terms that do not depend on the state."""
    ring = element.ring
    of_state = [
        place for place, generator in enumerate(ring.generators) if generator.kind != "constant"
    ]

    def varies(monomial: Monomial) -> bool:
        return any(monomial[place] for place in of_state)

    return ring.from_terms(
        {monomial: c for monomial, c in element.terms.items() if varies(monomial)}
    )


def _rational(element: Element) -> Fraction | None:
    """Return an element's value; None if it is not a number."""
    if len(element) != 1:
        return None
    ((monomial, coefficient),) = element.terms.items()
    return None if any(monomial) else coefficient


def _bits(element: Element) -> int:
    """Return the size of the longest coefficient, numerator and denominator together, in bits; 1 for zero."""
    return max(
        (c.numerator.bit_length() + c.denominator.bit_length() for c in element.terms.values()),
        default=1,
    )
