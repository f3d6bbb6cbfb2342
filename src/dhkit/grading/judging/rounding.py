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
from typing import Any, NamedTuple

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
"""Number of significant digits from which a decimal is taken for a printed double."""
_DOUBLE_ALLOWANCE = Fraction(8, 2**52)
"""Relative allowance of a printed double: eight units in its last place, the loss of a few dozen operations."""
_SOLVER_MARGIN = Fraction(1, 10**9)
"""Relative margin of an allowance for rounding in the linear program, which is solved in doubles."""
_DOUBLE_NOISE = 1e-15
"""Relative tolerance of equations without a rounded coefficient if the ring has numbers such as sqrt(2), which are
doubles here; without such numbers they hold exactly."""


class _TooLongError(Exception):
    """Multiplying an answer out exceeds ``BOUNDS.rounding_products``."""


@dataclass(frozen=True)
class _Coefficient:
    """Coefficient of one monomial, a sum of contributions that are kept apart by their signs.

    Attributes
    ----------
    positive, negative
        Sums of the absolute values of the contributions of each sign.
    allowed
        Sum over the contributions of absolute value times relative allowance.
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
        """Return the coefficient of one contribution with its relative allowance."""
        size = abs(value)
        zero = Fraction(0)
        return cls(
            positive=size if value > 0 else zero,
            negative=size if value < 0 else zero,
            allowed=size * share,
            finest=share,
            coarsest=share,
            is_printed=is_printed,
        )

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
        """Relative allowance of the value: the mean of those of its contributions, the finest if any cancel."""
        if self.positive and self.negative:
            return self.finest
        if not self.allowed:
            return Fraction(0)
        return self.allowed / (self.positive + self.negative)


_Polynomial = dict[_Monomial, _Coefficient]


class _Ratio(NamedTuple):
    """An answer, or a part of one, as a quotient of polynomials in atoms."""

    numerator: _Polynomial
    denominator: _Polynomial

    @property
    def inverse(self) -> _Ratio:
        return _Ratio(self.denominator, self.numerator)


class _Expansion(Algebra[_Ratio]):
    """Multiplies trees out into quotients of polynomials in atoms.

    Parameters
    ----------
    reader
        Reads atoms into the ring.
    digits
        Number of significant digits from which a decimal may have been rounded.
    """

    def __init__(self, reader: RingReader, digits: int) -> None:
        super().__init__()
        self.reader = reader
        self.digits = digits
        self.work = 0
        """Number of products of two terms so far."""
        self.atoms: list[Element] = []
        """Atoms by their numbers."""
        self.one: _Polynomial = {(): _Coefficient.of(Fraction(1), Fraction(0))}
        self._numbers: dict[Any, int] = {}
        """Numbers of atoms by their terms."""
        self._images: dict[_Monomial, Element] = {(): reader.ring.one}
        """Monomials as elements of the ring."""

    def number(self, tree: Number) -> _Ratio:
        """Return a number with the allowance of its decimals."""
        share = _allowance(tree.value, tree.text, self.digits)
        is_printed = share == _DOUBLE_ALLOWANCE
        return _Ratio(self._number(tree.value, share, is_printed), self.one)

    def name(self, tree: Name) -> _Ratio:
        """Return a name as an atom."""
        return self._atoms(tree)

    def call(self, tree: Call) -> _Ratio:
        """Return a call as an atom: decimals in it are not rounded."""
        return self._atoms(tree)

    def _atoms(self, tree: Tree) -> _Ratio:
        quotient = self.reader.read(tree)
        return _Ratio(self._atom(quotient.numerator), self._atom(quotient.denominator))

    def power(self, tree: Power) -> _Ratio:
        """Return a power, multiplied out."""
        base = self.of(tree.base)
        exponent = self.reader.exponent(tree.exponent)
        if exponent < 0:
            base = base.inverse
        power = _Ratio(self.one, self.one)
        for _ in range(abs(exponent)):
            power = self._product(power, base)
        return self._normalize(power)

    def product(self, factors: Sequence[tuple[bool, _Ratio]]) -> _Ratio:
        """Return a product, multiplied out."""
        product = _Ratio(self.one, self.one)
        for is_factor, ratio in factors:
            factor = ratio if is_factor else ratio.inverse
            product = self._normalize(self._product(product, factor))
        return product

    def sum(self, terms: Sequence[tuple[bool, _Ratio]]) -> _Ratio:
        """Return a sum over one denominator."""
        total: _Polynomial = {}
        common = self.one
        for added, (numerator, denominator) in terms:
            if not added:
                numerator = {m: -c for m, c in numerator.items()}

            # T / C + N / D = (T D + N C) / (C D)
            if common != denominator:
                total = self._multiply(total, denominator)
                numerator = self._multiply(numerator, common)
                common = self._multiply(common, denominator)

            total = dict(total)
            for m, c in numerator.items():
                total[m] = total[m] + c if m in total else c
        return _Ratio(total, common)

    def element(self, polynomial: _Polynomial) -> Element:
        """Return a polynomial as an element of the ring, without the allowances."""
        return self.reader.ring.sum(self.image(m) * c.value for m, c in polynomial.items())

    def image(self, monomial: _Monomial) -> Element:
        """Return a monomial as an element of the ring."""
        if monomial not in self._images:
            # x^k ... = (x^(k-1) ...) x for the first atom x
            (atom, exponent), *others = monomial
            lower = [(atom, exponent - 1)] if exponent > 1 else []
            self._images[monomial] = self.image((*lower, *others)) * self.atoms[atom]
        return self._images[monomial]

    def _number(self, value: Fraction, share: Fraction, is_printed: bool = False) -> _Polynomial:
        return {(): _Coefficient.of(value, share, is_printed)} if value else {}

    def _atom(self, element: Element) -> _Polynomial:
        """Return an element as a polynomial: a number, or an atom of its own."""
        is_number = len(element) <= 1 and not any(any(monomial) for monomial in element.terms)
        if is_number:
            if element == 1:
                return self.one
            return self._number(sum(element.terms.values(), Fraction(0)), Fraction(0))

        key = frozenset(element.terms.items())
        if key not in self._numbers:
            self._numbers[key] = len(self.atoms)
            self.atoms.append(element)
        return {((self._numbers[key], 1),): _Coefficient.of(Fraction(1), Fraction(0))}

    def _product(self, left: _Ratio, right: _Ratio) -> _Ratio:
        numerator = self._multiply(left.numerator, right.numerator)
        denominator = self._multiply(left.denominator, right.denominator)
        return _Ratio(numerator, denominator)

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
                if not value:
                    continue
                m = _product_of_monomials(a, b)
                contribution = _Coefficient.of(
                    value, max(x.share, y.share), x.is_printed or y.is_printed
                )
                product[m] = product[m] + contribution if m in product else contribution
        return product

    def _normalize(self, ratio: _Ratio) -> _Ratio:
        """Return a quotient, divided by its denominator if that is a number."""
        numerator, denominator = ratio
        if denominator is self.one or set(denominator) != {()}:
            return ratio
        divisor = denominator[()]
        if not divisor.value:
            return ratio
        reciprocal = self._number(1 / divisor.value, divisor.share, divisor.is_printed)
        return _Ratio(self._multiply(numerator, reciprocal), self.one)


def _product_of_monomials(a: _Monomial, b: _Monomial) -> _Monomial:
    exponents = dict(a)
    for atom, exponent in b:
        exponents[atom] = exponents.get(atom, 0) + exponent
    return tuple(sorted(exponents.items()))


def has_decimals(tree: Tree, digits: int) -> bool:
    """Whether an answer has a decimal of at least so many significant digits outside angles and exponents."""
    parts = parts_of(tree, coefficients=True)
    return any(
        isinstance(part, Number) and _allowance(part.value, part.text, digits) for part in parts
    )


def rounding_share(
    tree: Tree, truth: Element, reader: RingReader, residuals: Residuals, digits: int
) -> float | None:
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
        Returns elements that are zero for a right answer; linear in the answer.
    digits
        Number of significant digits from which a decimal may have been rounded.

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
        answer = expansion.of(tree)
    except _TooLongError:
        return None
    is_quotient = answer.denominator != expansion.one
    if is_quotient and not _is_plain(residuals, truth):
        return None
    ring = truth.ring

    def residual_changes(change: Element) -> list[Element]:
        """Return the change of the residuals by a change of the numerator."""
        if is_quotient:
            return [change]
        return list(residuals(Quotient(truth + change, ring.one), truth))

    # N / D = t if and only if N - t D = 0. Each coefficient may change by x times its allowance a, |x| <= 1, which
    # adds x a m to N - t D for a monomial m of N, and -x t a m for one of D.
    largest = max((abs(c) for c in truth.terms.values()), default=Fraction(0))
    columns = []
    shares: dict[Any, Fraction] = {}
    try:
        numerator = expansion.element(answer.numerator)
        denominator = expansion.element(answer.denominator)
        for polynomial, factor in ((answer.numerator, ring.one), (answer.denominator, -truth)):
            for monomial, coefficient in polynomial.items():
                allowance = abs(coefficient.value) * coefficient.share
                if coefficient.is_printed and polynomial is answer.numerator:
                    # A printed double may stand for zero: cos(pi/2) prints as 6e-17.
                    allowance = max(allowance, _DOUBLE_ALLOWANCE * largest)
                if not allowance:
                    continue
                change = expansion.image(monomial) * factor * allowance
                columns.append(_coefficients(residual_changes(change), ring))
                for group in _groups(change):
                    shares[group] = max(shares.get(group, Fraction(0)), coefficient.coarsest)
    except RingError:
        return None
    columns = [column for column in columns if column]
    if not columns or len(columns) > BOUNDS.rounded_coefficients:
        return None

    reference = truth * denominator
    difference = numerator - reference
    is_energy = not is_quotient and not _is_plain(residuals, truth)
    if not _is_small(difference, reference, shares, is_energy):
        return None

    unchanged = _coefficients(residual_changes(difference), ring)
    noise = Fraction(_DOUBLE_NOISE) * largest if _numbers(ring) else Fraction(0)
    share = _least_share(unchanged, columns, noise)
    return share if share is not None and share <= 1 + 1e-9 else None


def _groups(element: Element) -> dict[Any, list[Fraction]]:
    """Return the sizes of coefficients, grouped by the exponents of all but sines and cosines.

    These are parameters, rates, accelerations and variables of prismatic joints: terms of one group differ in angles.
    """
    is_beside = [generator.kind not in ("sine", "cosine") for generator in element.ring.generators]
    groups: dict[Any, list[Fraction]] = {}
    for (_, monomial), coefficient in _coefficients([element], element.ring).items():
        group = tuple(
            exponent for exponent, beside in zip(monomial, is_beside, strict=True) if beside
        )
        groups.setdefault(group, []).append(abs(coefficient))
    return groups


def _is_small(
    difference: Element, reference: Element, shares: Mapping[Any, Fraction], is_energy: bool
) -> bool:
    """Whether a difference is within the coarsest decimals' allowance of the truth's own coefficients.

    An energy's terms that do not depend on the state are left out: energies count from any zero.
    """
    if is_energy:
        difference = varying(difference)
    references = {group: sum(sizes) for group, sizes in _groups(reference).items()}
    for group, sizes in _groups(difference).items():
        # In each group:  largest |difference| <= share (sum of |reference| + largest |difference|)
        share = shares.get(group, Fraction(0)) + _DOUBLE_ALLOWANCE
        largest = max(sizes)
        allowed = share * (references.get(group, Fraction(0)) + largest)
        if largest > allowed * (1 + _SOLVER_MARGIN):
            return False
    return True


def _is_plain(residuals: Residuals, truth: Element) -> bool:
    """Whether the residual is the difference itself: then quotients are linear in their coefficients too."""
    one = truth.ring.one
    return list(residuals(Quotient(truth + one, one), truth)) == [one]


def _allowance(value: Fraction, text: str, digits: int) -> Fraction:
    """Return half a unit of a decimal's last digit relative to the decimal; 0 for shorter ones and other numbers."""
    mantissa, _, exponent = text.lower().partition("e")
    is_decimal = "." in mantissa or bool(exponent)
    significant = len(mantissa.replace(".", "").lstrip("0"))
    if not value or not is_decimal or significant < digits:
        return Fraction(0)

    # 1.234e-5 has 3 decimal places: half a unit of its last digit is 10^(-5 - 3) / 2.
    places = len(mantissa.partition(".")[2])
    half_unit = Fraction(1, 2) * Fraction(10) ** (int(exponent or 0) - places)
    share = half_unit / abs(value)
    return max(share, _DOUBLE_ALLOWANCE) if significant >= _DOUBLE_DIGITS else share


# The linear program

_Coefficients = Mapping[Any, Fraction]
"""Coefficients by the number of the residual and the monomial."""


def _coefficients(residuals: Sequence[Element], ring: PolynomialRing) -> _Coefficients:
    """Return coefficients by residual and monomial; constants that are numbers, such as roots, go into coefficients."""
    numbers = _numbers(ring)
    sums: dict[Any, Fraction] = {}
    for k, element in enumerate(residuals):
        for monomial, coefficient in element.terms.items():
            for place, number in numbers.items():
                coefficient *= number ** monomial[place]
            rest = monomial
            if numbers:
                rest = tuple(
                    0 if place in numbers else exponent for place, exponent in enumerate(monomial)
                )
            sums[k, rest] = sums.get((k, rest), Fraction(0)) + coefficient
    return {place: value for place, value in sums.items() if value}


def _numbers(ring: PolynomialRing) -> dict[int, Fraction]:
    """Return the values of the ring's constants that are numbers, by their places."""
    return {
        place: generator.meaning.value()
        for place, generator in enumerate(ring.generators)
        if generator.meaning is not None and not generator.meaning.symbols
    }


def _least_share(
    unchanged: _Coefficients, columns: Sequence[_Coefficients], noise: Fraction
) -> float | None:
    """Return the smallest possible maximum of |x_j| with b + A x = 0; None if there is no such x.

    Parameters
    ----------
    unchanged
        b: the residuals' coefficients of the answer as it is written.
    columns
        Columns of A: changes of these coefficients by one whole allowance.
    noise
        Largest coefficient that counts as zero if no column contributes to it.
    """
    # Each row is scaled by its largest entry, so that the solver's tolerance is a share of an allowance.
    scales: dict[Any, Fraction] = {}
    for column in columns:
        for place, value in column.items():
            scales[place] = max(scales.get(place, Fraction(0)), abs(value))

    for place, value in unchanged.items():
        if place not in scales:
            if abs(value) > noise:
                return None  # a coefficient to which no decimal contributes
        elif abs(value) > scales[place] * len(columns):
            return None  # |x_j| <= 1 does not suffice

    # Each row has one unknown, and each unknown one row: x_j = -b_j / A_jj.
    is_diagonal = all(len(column) == 1 for column in columns) and len(scales) == len(columns)
    if is_diagonal:
        shares = [
            float(abs(unchanged.get(place, Fraction(0))) / scale) for place, scale in scales.items()
        ]
        return max(shares, default=0.0)
    return _solve(unchanged, columns, scales)


def _solve(
    unchanged: _Coefficients, columns: Sequence[_Coefficients], scales: Mapping[Any, Fraction]
) -> float | None:
    """Return the smallest s of a linear program: minimise s subject to A x = -b and -s <= x_j <= s; None without x."""
    from scipy.optimize import linprog
    from scipy.sparse import csr_array, eye_array, hstack, vstack

    # The unknowns are x_1 ... x_k, then s.
    k = len(columns)
    row_of = {place: row for row, place in enumerate(scales)}
    rows: list[int] = []
    places: list[int] = []
    values: list[float] = []
    for j, column in enumerate(columns):
        for place, value in column.items():
            rows.append(row_of[place])
            places.append(j)
            values.append(float(value / scales[place]))
    A = csr_array((values, (rows, places)), shape=(len(scales), k + 1))
    minus_b = [-float(unchanged.get(place, Fraction(0)) / scale) for place, scale in scales.items()]

    # x_j - s <= 0 and -x_j - s <= 0
    minus_s = -np.ones((k, 1))
    upper = hstack([eye_array(k), minus_s])
    lower = hstack([-eye_array(k), minus_s])

    result = linprog(
        np.r_[np.zeros(k), 1.0],
        A_ub=vstack([upper, lower], format="csr"),
        b_ub=np.zeros(2 * k),
        A_eq=A,
        b_eq=minus_b,
        bounds=[(-1.5, 1.5)] * k + [(0, 1.5)],
        method="highs",
        options={"primal_feasibility_tolerance": 1e-9},
    )
    return float(result.x[k]) if result.status == 0 else None
