"""Whether decimals that were rounded allow the truth, coefficient by coefficient.

An answer is multiplied out as it was typed: sines and cosines of the angles that stand there are left as they are, no
relation between them is used, and each coefficient keeps a relative allowance, half a unit in the last place of its
coarsest decimal. The answer is right within rounding if coefficients within their allowances make it equal to the
truth, which is a linear program. Cancellation grants nothing: where contributions of both signs meet in a coefficient,
it is allowed no more than the finest of them; and what the answer differs by in the ring's normal form must be small
beside the truth's own coefficients, so that sines and cosines that cancel by an identity grant nothing either.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.grading.judging.numeric import parts_of
from dhkit.grading.judging.quotients import Quotient, Reading
from dhkit.symbolic.ring import Element, Ring, RingError

Residuals = Callable[[Quotient, Element], Sequence[Element]]
"""What must be zero for an answer to be right, given the answer and the truth."""
Monomial = tuple[tuple[int, int], ...]
"""Atoms by their numbers with their exponents: names, and sines and cosines of whole angles."""

DOUBLE_DIGITS = 15
"""Significant digits from which a decimal is taken for the print of a computed double."""
DOUBLE_ALLOWANCE = Fraction(8, 2**52)
"""Relative: eight units in the last place of a double, what a few dozen operations may lose."""
MAX_WORK = 200_000
"""Products of two terms that multiplying an answer out may take; a second."""
MAX_COEFFICIENTS = 2_000
"""Coefficients with an allowance: a PUMA's longest entry in numbers has 300."""
SLACK = Fraction(1, 10**9)
"""Relative: what the linear program's doubles may differ by at the edge of an allowance."""
NOISE = 1e-15
"""Relative: equations without a rounded coefficient hold to this where the ring has numbers such as sqrt(2), which are
doubles here; exactly elsewhere."""


class _TooLongError(Exception):
    """Multiplying out takes more work than an allowance is worth."""


@dataclass(frozen=True)
class _Coefficient:
    """The contributions to one monomial, those of each sign added up.

    Attributes
    ----------
    positive, negative
        Sizes of the contributions of each sign.
    allowed
        Sum of the contributions' sizes, each times its relative allowance.
    finest, coarsest
        The least and the largest relative allowance of a contribution.
    is_printed
        Whether a contribution holds the print of a computed double.
    """

    positive: Fraction
    negative: Fraction
    allowed: Fraction
    finest: Fraction
    coarsest: Fraction
    is_printed: bool

    @classmethod
    def of(cls, value: Fraction, share: Fraction, is_printed: bool = False) -> _Coefficient:
        size, zero = abs(value), Fraction(0)
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


Polynomial = dict[Monomial, _Coefficient]


class _Expansion:
    """Multiplies trees out in atoms, as pairs of numerator and denominator."""

    def __init__(self, reading: Reading, digits: int) -> None:
        self.reading = reading
        self.digits = digits
        self.work = 0
        self.atoms: list[Element] = []
        self.one: Polynomial = {(): _Coefficient.of(Fraction(1), Fraction(0))}
        self._numbers: dict[Any, int] = {}
        self._shared: dict[int, tuple[Polynomial, Polynomial]] = {}
        self._images: dict[Monomial, Element] = {(): reading.ring.one}

    def of(self, tree: Tree) -> tuple[Polynomial, Polynomial]:
        # CasADi's graphs share what is used twice.
        if id(tree) not in self._shared:
            self._shared[id(tree)] = self._read(tree)
        return self._shared[id(tree)]

    def _read(self, tree: Tree) -> tuple[Polynomial, Polynomial]:
        match tree:
            case Number(value=value, text=text):
                share = _allowance(value, text, self.digits)
                return self._number(value, share, share == DOUBLE_ALLOWANCE), self.one
            case Name() | Call():
                quotient = self.reading.read(tree)
                return self._atom(quotient.numerator), self._atom(quotient.denominator)
            case Power(base, exponent):
                return self._power(self.of(base), self.reading.exponent(exponent))
            case Sum(terms):
                return self._sum(terms)
            case Product(factors):
                top, bottom = self.one, self.one
                for multiplied, factor in factors:
                    above, below = self.of(factor) if multiplied else self.of(factor)[::-1]
                    top, bottom = self._normalised(self._times(top, above), self._times(bottom, below))
                return top, bottom

    def image(self, monomial: Monomial) -> Element:
        """Return what a monomial is in the ring."""
        if monomial not in self._images:
            (atom, exponent), *rest = monomial
            lower = (*(((atom, exponent - 1),) if exponent > 1 else ()), *rest)
            self._images[monomial] = self.image(lower) * self.atoms[atom]
        return self._images[monomial]

    def _number(self, value: Fraction, share: Fraction, is_printed: bool = False) -> Polynomial:
        return {(): _Coefficient.of(value, share, is_printed)} if value else {}

    def _atom(self, element: Element) -> Polynomial:
        key = frozenset(element.terms.items())
        if len(element) <= 1 and not any(any(monomial) for monomial in element.terms):
            return self._number(sum(element.terms.values(), Fraction(0)), Fraction(0)) if element != 1 else self.one
        if key not in self._numbers:
            self._numbers[key] = len(self.atoms)
            self.atoms.append(element)
        return {((self._numbers[key], 1),): _Coefficient.of(Fraction(1), Fraction(0))}

    def _sum(self, terms: Iterable[tuple[bool, Tree]]) -> tuple[Polynomial, Polynomial]:
        top: Polynomial = {}
        bottom = self.one
        for added, term in terms:
            above, below = self.of(term)
            if not added:
                above = {m: -c for m, c in above.items()}
            if not _same(bottom, below):
                top, above = self._times(top, below), self._times(above, bottom)
                bottom = self._times(bottom, below)
            top = dict(top)
            for m, c in above.items():
                top[m] = top[m] + c if m in top else c
        return top, bottom

    def _times(self, left: Polynomial, right: Polynomial) -> Polynomial:
        if left is self.one:
            return right
        if right is self.one:
            return left
        self.work += len(left) * len(right)
        if self.work > MAX_WORK:
            raise _TooLongError
        product: Polynomial = {}
        for a, x in left.items():
            for b, y in right.items():
                value = x.value * y.value
                if value:
                    m = _product(a, b)
                    made = _Coefficient.of(value, max(x.share, y.share), x.is_printed or y.is_printed)
                    product[m] = product[m] + made if m in product else made
        return product

    def _normalised(self, top: Polynomial, bottom: Polynomial) -> tuple[Polynomial, Polynomial]:
        """Divide by a denominator that is a number."""
        if bottom is self.one or set(bottom) != {()} or not bottom[()].value:
            return top, bottom
        divisor = bottom[()]
        return self._times(top, self._number(1 / divisor.value, divisor.share, divisor.is_printed)), self.one

    def _power(self, base: tuple[Polynomial, Polynomial], exponent: int) -> tuple[Polynomial, Polynomial]:
        above, below = base if exponent >= 0 else base[::-1]
        top, bottom = self.one, self.one
        for _ in range(abs(exponent)):
            top, bottom = self._times(top, above), self._times(bottom, below)
        return self._normalised(top, bottom)


def _product(a: Monomial, b: Monomial) -> Monomial:
    powers = dict(a)
    for atom, exponent in b:
        powers[atom] = powers.get(atom, 0) + exponent
    return tuple(sorted(powers.items()))


def has_decimals(tree: Tree, digits: int) -> bool:
    """Whether an answer has a decimal, outside angles and exponents, of so many significant digits or more."""
    parts = parts_of(tree, coefficients=True)
    return any(isinstance(part, Number) and _allowance(part.value, part.text, digits) for part in parts)


def rounding_share(tree: Tree, truth: Element, reading: Reading, residuals: Residuals, digits: int) -> float | None:
    """Return how much of its allowance the most changed coefficient needs for an answer to be the truth.

    Parameters
    ----------
    tree
        The answer.
    truth
        What is right.
    reading
        Reads angles and names into the truth's ring.
    residuals
        What must be zero; linear in the answer.
    digits
        Significant digits from which a decimal may have been rounded.

    Returns
    -------
    float or None
        At most 1; None where no coefficients within their allowances make the answer right.
    """
    if not has_decimals(tree, digits):
        return None
    expansion = _Expansion(reading, digits)
    try:
        top, bottom = expansion.of(tree)
    except _TooLongError:
        return None
    is_quotient = not _same(bottom, expansion.one)
    if is_quotient and not _is_plain(residuals, truth):
        return None
    ring = truth.ring

    def whole(polynomial: Polynomial) -> Element:
        return ring.sum(expansion.image(m) * c.value for m, c in polynomial.items())

    def vanishing(change: Element) -> list[Element]:
        """Return by how much a change of the numerator moves what must be zero."""
        return [change] if is_quotient else list(residuals(Quotient(truth + change, ring.one), truth))

    printed_zero = DOUBLE_ALLOWANCE * max((abs(c) for c in truth.terms.values()), default=Fraction(0))
    try:
        numerator, denominator = whole(top), whole(bottom)
        columns = []
        shares: dict[Any, Fraction] = {}
        for polynomial, factor in ((top, ring.one), (bottom, -truth)):
            for monomial, coefficient in polynomial.items():
                allowed = abs(coefficient.value) * coefficient.share
                if coefficient.is_printed and polynomial is top:
                    allowed = max(allowed, printed_zero)  # cos(pi/2) prints as 6e-17
                if allowed:
                    change = expansion.image(monomial) * factor * allowed
                    columns.append(_coefficients(vanishing(change), ring))
                    for group in _groups(change):
                        shares[group] = max(shares.get(group, Fraction(0)), coefficient.coarsest)
    except RingError:
        return None
    columns = [column for column in columns if column]
    if not columns or len(columns) > MAX_COEFFICIENTS:
        return None
    difference, reference = numerator - truth * denominator, truth * denominator
    is_energy = not is_quotient and not _is_plain(residuals, truth)
    if not _is_small(difference, reference, shares, is_energy):
        return None
    here = vanishing(difference)
    noise = Fraction(NOISE) * max((abs(c) for c in truth.terms.values()), default=Fraction(0)) if _numbers(ring) else 0
    share = _least_share(_coefficients(here, ring), columns, Fraction(noise))
    return share if share is not None and share <= 1 + 1e-9 else None


def _groups(element: Element) -> dict[Any, list[Fraction]]:
    """Return the coefficients' sizes by what stands beside sines, cosines and numbers: parameters, rates, slides."""
    beside = [generator.kind not in ("sine", "cosine") for generator in element.ring.generators]
    found: dict[Any, list[Fraction]] = {}
    for (_, monomial), coefficient in _coefficients([element], element.ring).items():
        group = tuple(e for e, counts in zip(monomial, beside, strict=True) if counts)
        found.setdefault(group, []).append(abs(coefficient))
    return found


def _is_small(difference: Element, reference: Element, shares: Mapping[Any, Fraction], is_energy: bool) -> bool:
    """Whether a difference is within the coarsest decimals' allowance of the truth's own coefficients.

    Of an energy the terms without state do not count: it is measured from any zero.
    """
    ring = difference.ring
    if is_energy:
        constant = [generator.kind == "constant" for generator in ring.generators]
        free = {m for m in difference.terms if all(c or not e for e, c in zip(m, constant, strict=True))}
        difference = ring.from_terms({m: c for m, c in difference.terms.items() if m not in free})
    references = {group: sum(sizes) for group, sizes in _groups(reference).items()}
    for group, sizes in _groups(difference).items():
        share = shares.get(group, Fraction(0)) + DOUBLE_ALLOWANCE
        largest = max(sizes)
        if largest > share * (references.get(group, Fraction(0)) + largest) * (1 + SLACK):
            return False
    return True


def _is_plain(residuals: Residuals, truth: Element) -> bool:
    """Whether the difference itself must be zero: then quotients are linear in their coefficients too."""
    one = truth.ring.one
    return list(residuals(Quotient(truth + one, one), truth)) == [one]


def _same(left: Polynomial, right: Polynomial) -> bool:
    return left is right or left == right


def _allowance(value: Fraction, text: str, digits: int) -> Fraction:
    """Return half a unit of a decimal's last digit relative to the decimal; 0 for other numbers and shorter ones."""
    mantissa, _, exponent = text.lower().partition("e")
    significant = len(mantissa.replace(".", "").lstrip("0"))
    if not value or ("." not in mantissa and not exponent) or significant < digits:
        return Fraction(0)
    half_unit = Fraction(1, 2) * Fraction(10) ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    share = half_unit / abs(value)
    return max(share, DOUBLE_ALLOWANCE) if significant >= DOUBLE_DIGITS else share


Coefficients = Mapping[Any, Fraction]


def _coefficients(residuals: Sequence[Element], ring: Ring) -> Coefficients:
    """Return coefficients by residual and monomial; roots and cosines that are numbers are part of coefficients."""
    numbers = _numbers(ring)
    found: dict[Any, Fraction] = {}
    for k, element in enumerate(residuals):
        for monomial, coefficient in element.terms.items():
            for place, number in numbers.items():
                coefficient *= number ** monomial[place]
            rest = tuple(0 if place in numbers else e for place, e in enumerate(monomial)) if numbers else monomial
            found[k, rest] = found.get((k, rest), Fraction(0)) + coefficient
    return {place: value for place, value in found.items() if value}


def _numbers(ring: Ring) -> dict[int, Fraction]:
    """Return the ring's constants that are numbers, by their places."""
    return {
        place: generator.meaning.value()
        for place, generator in enumerate(ring.generators)
        if generator.meaning is not None and not generator.meaning.symbols
    }


def _least_share(here: Coefficients, columns: Sequence[Coefficients], noise: Fraction) -> float | None:
    """Return the least largest |x| with here + sum x columns = 0; None where there is no such x.

    Equations are scaled by their largest entry, so that the solver's tolerance is a share of an allowance.
    """
    size: dict[Any, Fraction] = {}
    for column in columns:
        for place, value in column.items():
            size[place] = max(size.get(place, Fraction(0)), abs(value))
    if any(place not in size and abs(value) > noise for place, value in here.items()):
        return None  # a coefficient that no decimal has a part in
    if any(place in size and abs(value) > size[place] * len(columns) for place, value in here.items()):
        return None
    if all(len(column) == 1 for column in columns) and len(size) == len(columns):
        return max((float(abs(here.get(place, Fraction(0))) / most) for place, most in size.items()), default=0.0)
    return _solved(here, columns, size)


def _solved(here: Coefficients, columns: Sequence[Coefficients], size: Mapping[Any, Fraction]) -> float | None:
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
