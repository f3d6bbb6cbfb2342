"""Rounding: whether an answer's decimals, moved within their last digit, make it the truth, coefficient by coefficient.

An answer is multiplied out as it was typed: sines and cosines of the angles that it contains are left as they are, no
relation between them is used, and each coefficient keeps a relative allowance, half a unit in the last place of its
coarsest decimal. The answer is right within rounding if coefficients within their allowances make it equal to the
truth, which is a linear program. Cancellation grants no allowance: a coefficient with contributions of both signs gets
no more than the finest of them; and the answer's difference in the ring's normal form must be small beside the truth's
own coefficients, so that sines and cosines that cancel by an identity grant none either.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.expressions.syntax import Call, Name, Number, Power, Tree
from dhkit.expressions.trees import Algebra, parts_of
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.quotients import Quotient, RingReader, varying
from dhkit.symbolic.ring import Element, RingError
from dhkit.symbolic.ring.elements import PolynomialRing

Residuals = Callable[[Quotient, Element], Sequence[Element]]
"""Returns elements that are zero for a right answer, given the answer and the truth."""
_Monomial = tuple[tuple[int, int], ...]
"""Numbers of atoms (names, sines and cosines of whole angles) with their exponents."""

_DOUBLE_DIGITS = 15
"""Significant digits from which a decimal is taken for a printed double."""
_DOUBLE_ALLOWANCE = Fraction(8, 2**52)
"""Relative allowance of a printed double: eight units in its last place, the loss of a few dozen operations."""
_SOLVER_MARGIN = Fraction(1, 10**9)
"""Relative error of the linear program's doubles at the edge of an allowance."""
_DOUBLE_NOISE = 1e-15
"""Relative tolerance of equations without a rounded coefficient if the ring has numbers such as sqrt(2), which are
doubles here; without such numbers they hold exactly."""


class _TooLongError(Exception):
    """Multiplying an answer out exceeds ``BOUNDS.rounding_products``."""


@dataclass(frozen=True)
class _Coefficient:
    """Sum of the contributions to the coefficient of one monomial, kept apart by their signs.

    Attributes
    ----------
    positive, negative
        Sums of the sizes of contributions of each sign.
    allowed
        Sum of the contributions' sizes, each times its relative allowance.
    finest, coarsest
        Smallest and largest relative allowance of a contribution.
    is_printed
        Whether a contribution contains a printed double.
    """

    positive: Fraction
    negative: Fraction
    allowed: Fraction
    finest: Fraction
    coarsest: Fraction
    is_printed: bool

    @classmethod
    def of(cls, value: Fraction, share: Fraction, is_printed: bool = False) -> _Coefficient:
        size = abs(value)
        zero = Fraction(0)
        return cls(size if value > 0 else zero, size if value < 0 else zero, size * share, share, share, is_printed)

    def __add__(self, other: _Coefficient) -> _Coefficient:
        return _Coefficient(
            self.positive + other.positive,
            self.negative + other.negative,
            self.allowed + other.allowed,
            min(self.finest, other.finest),
            max(self.coarsest, other.coarsest),
            self.is_printed or other.is_printed,
        )

    def __neg__(self) -> _Coefficient:
        return replace(self, positive=self.negative, negative=self.positive)

    @property
    def value(self) -> Fraction:
        return self.positive - self.negative

    @property
    def share(self) -> Fraction:
        """The relative allowance of the value."""
        if self.positive and self.negative:
            return self.finest
        return self.allowed / (self.positive + self.negative) if self.allowed else Fraction(0)


_Polynomial = dict[_Monomial, _Coefficient]


class _Expansion(Algebra[tuple[_Polynomial, _Polynomial]]):
    """Multiplies trees out into pairs of numerator and denominator, polynomials in atoms."""

    def __init__(self, reader: RingReader, digits: int) -> None:
        super().__init__()
        self.reader = reader
        self.digits = digits
        self.work = 0
        self.atoms: list[Element] = []
        self.one: _Polynomial = {(): _Coefficient.of(Fraction(1), Fraction(0))}
        self._numbers: dict[Any, int] = {}
        self._images: dict[_Monomial, Element] = {(): reader.ring.one}

    def number(self, tree: Number) -> tuple[_Polynomial, _Polynomial]:
        """Return a number with what its decimals allow."""
        share = _allowance(tree.value, tree.text, self.digits)
        return self._number(tree.value, share, share == _DOUBLE_ALLOWANCE), self.one

    def name(self, tree: Name) -> tuple[_Polynomial, _Polynomial]:
        """Return a name as an atom."""
        return self._atoms(tree)

    def call(self, tree: Call) -> tuple[_Polynomial, _Polynomial]:
        """Return a call as an atom: decimals in it are not rounded."""
        return self._atoms(tree)

    def _atoms(self, tree: Tree) -> tuple[_Polynomial, _Polynomial]:
        quotient = self.reader.read(tree)
        return self._atom(quotient.numerator), self._atom(quotient.denominator)

    def power(self, tree: Power) -> tuple[_Polynomial, _Polynomial]:
        """Return a power, multiplied out."""
        base = self.of(tree.base)
        exponent = self.reader.exponent(tree.exponent)
        numerator, denominator = base if exponent >= 0 else base[::-1]
        top, bottom = self.one, self.one
        for _ in range(abs(exponent)):
            top = self._multiply(top, numerator)
            bottom = self._multiply(bottom, denominator)
        return self._normalize(top, bottom)

    def product(
        self, factors: Sequence[tuple[bool, tuple[_Polynomial, _Polynomial]]]
    ) -> tuple[_Polynomial, _Polynomial]:
        """Return a product, multiplied out."""
        top, bottom = self.one, self.one
        for is_factor, quotient in factors:
            numerator, denominator = quotient if is_factor else quotient[::-1]
            top, bottom = self._normalize(self._multiply(top, numerator), self._multiply(bottom, denominator))
        return top, bottom

    def image(self, monomial: _Monomial) -> Element:
        """Return a monomial as an element of the ring."""
        if monomial not in self._images:
            (atom, exponent), *rest = monomial
            lower = (*(((atom, exponent - 1),) if exponent > 1 else ()), *rest)
            self._images[monomial] = self.image(lower) * self.atoms[atom]
        return self._images[monomial]

    def _number(self, value: Fraction, share: Fraction, is_printed: bool = False) -> _Polynomial:
        return {(): _Coefficient.of(value, share, is_printed)} if value else {}

    def _atom(self, element: Element) -> _Polynomial:
        key = frozenset(element.terms.items())
        if len(element) <= 1 and not any(any(monomial) for monomial in element.terms):
            return self._number(sum(element.terms.values(), Fraction(0)), Fraction(0)) if element != 1 else self.one
        if key not in self._numbers:
            self._numbers[key] = len(self.atoms)
            self.atoms.append(element)
        return {((self._numbers[key], 1),): _Coefficient.of(Fraction(1), Fraction(0))}

    def sum(self, terms: Sequence[tuple[bool, tuple[_Polynomial, _Polynomial]]]) -> tuple[_Polynomial, _Polynomial]:
        """Return a sum over one denominator."""
        top: _Polynomial = {}
        bottom = self.one
        for added, (numerator, denominator) in terms:
            if not added:
                numerator = {m: -c for m, c in numerator.items()}
            if bottom != denominator:
                top = self._multiply(top, denominator)
                numerator = self._multiply(numerator, bottom)
                bottom = self._multiply(bottom, denominator)
            top = dict(top)
            for m, c in numerator.items():
                top[m] = top[m] + c if m in top else c
        return top, bottom

    def _multiply(self, left: _Polynomial, right: _Polynomial) -> _Polynomial:
        if left is self.one:
            return right
        if right is self.one:
            return left
        self.work += len(left) * len(right)
        if self.work > BOUNDS.rounding_products:
            raise _TooLongError
        product: _Polynomial = {}
        for a, x in left.items():
            for b, y in right.items():
                value = x.value * y.value
                if value:
                    m = _product(a, b)
                    contribution = _Coefficient.of(value, max(x.share, y.share), x.is_printed or y.is_printed)
                    product[m] = product[m] + contribution if m in product else contribution
        return product

    def _normalize(self, top: _Polynomial, bottom: _Polynomial) -> tuple[_Polynomial, _Polynomial]:
        """Return numerator and denominator, divided by the denominator if that is a number."""
        if bottom is self.one or set(bottom) != {()} or not bottom[()].value:
            return top, bottom
        divisor = bottom[()]
        return self._multiply(top, self._number(1 / divisor.value, divisor.share, divisor.is_printed)), self.one


def _product(a: _Monomial, b: _Monomial) -> _Monomial:
    powers = dict(a)
    for atom, exponent in b:
        powers[atom] = powers.get(atom, 0) + exponent
    return tuple(sorted(powers.items()))


def has_decimals(tree: Tree, digits: int) -> bool:
    """Whether an answer has a decimal of at least so many significant digits outside angles and exponents."""
    parts = parts_of(tree, coefficients=True)
    return any(isinstance(part, Number) and _allowance(part.value, part.text, digits) for part in parts)


def rounding_share(tree: Tree, truth: Element, reader: RingReader, residuals: Residuals, digits: int) -> float | None:
    """Return the smallest share of their allowances by which coefficients have to change to make an answer the truth.

    Parameters
    ----------
    tree
        The answer.
    truth
        The right value.
    reader
        Reads angles and names into the truth's ring.
    residuals
        Returns what is zero for a right answer; linear in the answer.
    digits
        Significant digits from which a decimal may have been rounded.

    Returns
    -------
    float or None
        Share of the most changed coefficient, at most 1; None if no coefficients within their allowances make the
        answer right.
    """
    if not has_decimals(tree, digits):
        return None
    expansion = _Expansion(reader, digits)
    try:
        top, bottom = expansion.of(tree)
    except _TooLongError:
        return None
    is_quotient = bottom != expansion.one
    if is_quotient and not _is_plain(residuals, truth):
        return None
    ring = truth.ring

    def whole(polynomial: _Polynomial) -> Element:
        return ring.sum(expansion.image(m) * c.value for m, c in polynomial.items())

    def residual_changes(change: Element) -> list[Element]:
        """Return the change of the residuals by a change of the numerator."""
        return [change] if is_quotient else list(residuals(Quotient(truth + change, ring.one), truth))

    largest = max((abs(c) for c in truth.terms.values()), default=Fraction(0))
    try:
        numerator, denominator = whole(top), whole(bottom)
        columns = []
        shares: dict[Any, Fraction] = {}
        for polynomial, factor in ((top, ring.one), (bottom, -truth)):
            for monomial, coefficient in polynomial.items():
                allowed = abs(coefficient.value) * coefficient.share
                if coefficient.is_printed and polynomial is top:
                    allowed = max(allowed, _DOUBLE_ALLOWANCE * largest)  # cos(pi/2) prints as 6e-17
                if allowed:
                    change = expansion.image(monomial) * factor * allowed
                    columns.append(_coefficients(residual_changes(change), ring))
                    for group in _groups(change):
                        shares[group] = max(shares.get(group, Fraction(0)), coefficient.coarsest)
    except RingError:
        return None
    columns = [column for column in columns if column]
    if not columns or len(columns) > BOUNDS.rounded_coefficients:
        return None
    difference = numerator - truth * denominator
    reference = truth * denominator
    is_energy = not is_quotient and not _is_plain(residuals, truth)
    if not _is_small(difference, reference, shares, is_energy):
        return None
    here = residual_changes(difference)
    noise = Fraction(_DOUBLE_NOISE) * largest if _numbers(ring) else Fraction(0)
    share = _least_share(_coefficients(here, ring), columns, noise)
    return share if share is not None and share <= 1 + 1e-9 else None


def _groups(element: Element) -> dict[Any, list[Fraction]]:
    """Return the sizes of coefficients, grouped by the factors besides sines and cosines: parameters, rates, slides."""
    beside = [generator.kind not in ("sine", "cosine") for generator in element.ring.generators]
    groups: dict[Any, list[Fraction]] = {}
    for (_, monomial), coefficient in _coefficients([element], element.ring).items():
        group = tuple(e for e, counts in zip(monomial, beside, strict=True) if counts)
        groups.setdefault(group, []).append(abs(coefficient))
    return groups


def _is_small(difference: Element, reference: Element, shares: Mapping[Any, Fraction], is_energy: bool) -> bool:
    """Whether a difference is within the coarsest decimals' allowance of the truth's own coefficients.

    An energy's terms that do not depend on the state are left out: energies count from any zero.
    """
    if is_energy:
        difference = varying(difference)
    references = {group: sum(sizes) for group, sizes in _groups(reference).items()}
    for group, sizes in _groups(difference).items():
        share = shares.get(group, Fraction(0)) + _DOUBLE_ALLOWANCE
        largest = max(sizes)
        if largest > share * (references.get(group, Fraction(0)) + largest) * (1 + _SOLVER_MARGIN):
            return False
    return True


def _is_plain(residuals: Residuals, truth: Element) -> bool:
    """Whether the residual is the difference itself: then quotients are linear in their coefficients too."""
    one = truth.ring.one
    return list(residuals(Quotient(truth + one, one), truth)) == [one]


def _allowance(value: Fraction, text: str, digits: int) -> Fraction:
    """Return half a unit of a decimal's last digit relative to the decimal; 0 for shorter ones and other numbers."""
    mantissa, _, exponent = text.lower().partition("e")
    significant = len(mantissa.replace(".", "").lstrip("0"))
    if not value or ("." not in mantissa and not exponent) or significant < digits:
        return Fraction(0)
    half_unit = Fraction(1, 2) * Fraction(10) ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    share = half_unit / abs(value)
    return max(share, _DOUBLE_ALLOWANCE) if significant >= _DOUBLE_DIGITS else share


_Coefficients = Mapping[Any, Fraction]


def _coefficients(residuals: Sequence[Element], ring: PolynomialRing) -> _Coefficients:
    """Return coefficients by residual and monomial; constants that are numbers, such as roots, go into coefficients."""
    numbers = _numbers(ring)
    sums: dict[Any, Fraction] = {}
    for k, element in enumerate(residuals):
        for monomial, coefficient in element.terms.items():
            for place, number in numbers.items():
                coefficient *= number ** monomial[place]
            rest = tuple(0 if place in numbers else e for place, e in enumerate(monomial)) if numbers else monomial
            sums[k, rest] = sums.get((k, rest), Fraction(0)) + coefficient
    return {place: value for place, value in sums.items() if value}


def _numbers(ring: PolynomialRing) -> dict[int, Fraction]:
    """Return the values of the ring's constants that are numbers, by their places."""
    return {
        place: generator.meaning.value()
        for place, generator in enumerate(ring.generators)
        if generator.meaning is not None and not generator.meaning.symbols
    }


def _least_share(here: _Coefficients, columns: Sequence[_Coefficients], noise: Fraction) -> float | None:
    """Return the smallest possible maximum of |x| with here + sum x columns = 0; None if there is no such x.

    Equations are scaled by their largest entry, so that the solver's tolerance is a share of an allowance.
    """
    size: dict[Any, Fraction] = {}
    for column in columns:
        for place, value in column.items():
            size[place] = max(size.get(place, Fraction(0)), abs(value))
    if any(place not in size and abs(value) > noise for place, value in here.items()):
        return None  # a coefficient to which no decimal contributes
    if any(place in size and abs(value) > size[place] * len(columns) for place, value in here.items()):
        return None
    if all(len(column) == 1 for column in columns) and len(size) == len(columns):
        return max((float(abs(here.get(place, Fraction(0))) / most) for place, most in size.items()), default=0.0)
    return _solve(here, columns, size)


def _solve(here: _Coefficients, columns: Sequence[_Coefficients], size: Mapping[Any, Fraction]) -> float | None:
    from scipy.optimize import linprog
    from scipy.sparse import csr_array, eye_array, hstack, vstack

    row_of = {place: k for k, place in enumerate(size)}
    entries = [
        (row_of[place], j, float(value / size[place]))
        for j, column in enumerate(columns)
        for place, value in column.items()
    ]
    right = [-float(here.get(place, Fraction(0)) / most) for place, most in size.items()]
    # Variables: the changes in allowances, then the largest of them; |x| <= largest.
    k = len(columns)
    rows, places, values = zip(*entries, strict=True)
    equations = csr_array((values, (rows, places)), shape=(len(size), k + 1))
    largest = -np.ones((k, 1))
    bounds = vstack([hstack([eye_array(k), largest]), hstack([-eye_array(k), largest])], format="csr")
    result = linprog(
        np.r_[np.zeros(k), 1.0],
        A_ub=bounds,
        b_ub=np.zeros(2 * k),
        A_eq=equations,
        b_eq=right,
        bounds=[(-1.5, 1.5)] * k + [(0, 1.5)],
        method="highs",
        options={"primal_feasibility_tolerance": 1e-9},
    )
    return float(result.x[k]) if result.status == 0 else None
