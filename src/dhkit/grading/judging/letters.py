"""Letters of a robot's file that an answer has as numbers: their values are written where the letters stand.

A number may stand for a letter where it is written: 9.81 for g, 0.5 for l1. A letter that is left out is not a number,
though its value is 1, or 2 beside a factor 1/2 of the truth. Numbers that may stand for letters are decimals, and whole
numbers that are the value of a letter that the sheet has nowhere; 2, 1/2 or 1/3 are also factors of the truth.

With all such numbers replaced by 0, an answer keeps the terms in which none is written. Where the truth has a letter in
one of these terms, the letter was left out there.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.expressions.trees import names_of, parts_of
from dhkit.grading.judging.findings import names_in
from dhkit.grading.judging.quotients import OutsideTheRingError, RingReader
from dhkit.grading.judging.truth import Truth, exact_number, substituted
from dhkit.symbolic.ring import Element, RingError, element_array

_NOTHING = Number(Fraction(0), "0", 0)
"""Zero that replaces a number which may stand for a letter."""


@dataclass(frozen=True, eq=False)
class WrittenNumbers:
    """Finds the letters that entries of a quantity have as numbers.

    Attributes
    ----------
    truth
        The right answers.
    quantity
        The quantity.
    reader
        Reader into its ring.
    on_sheet
        Letters that the sheet has anywhere.
    """

    truth: Truth
    quantity: str
    reader: RingReader
    on_sheet: frozenset[str]

    def letters(self, tree: Tree, right: Element) -> frozenset[str]:
        """Return the letters that an entry has as numbers where the right value has the letters."""
        values = self._values(tree, right)
        candidates = frozenset(name for name, value in values.items() if value != 0)
        whole = {values[name] for name in candidates - self.on_sheet if values[name] not in (0, 1)}
        bare = _without_written(tree, whole)
        if bare is tree:
            return frozenset()

        element = self._element(tree)
        remaining = self._element(bare)
        if element is None or remaining is None:
            # Its terms cannot be told apart.
            return candidates if _has_written(tree) else frozenset()

        # Whether a letter was left out depends on the others that are letters: the set shrinks until it stays.
        while candidates:
            left_out = self._left_out(remaining, right, candidates, values)
            if not left_out:
                break
            candidates -= left_out
        return candidates

    def _element(self, tree: Tree) -> Element | None:
        """Return a formula as an element of the ring; None if it is outside."""
        try:
            return self.reader.read(tree).element()
        except (OutsideTheRingError, AnswerError, RingError):
            return None

    def _values(self, tree: Tree, right: Element) -> dict[str, Fraction]:
        """Return the values of the letters that the right value contains and the entry does not."""
        description = self.truth.description
        missing = names_in(right) & frozenset(description.parameters) - names_of(tree)
        return {name: exact_number(description, name) for name in missing}

    def _left_out(
        self,
        remaining: Element,
        right: Element,
        letters: frozenset[str],
        values: Mapping[str, Fraction],
    ) -> frozenset[str]:
        """Return the letters that the right value has in a term which remains where no number is written.

        Parameters
        ----------
        remaining
            The answer without the terms in which numbers are written.
        right
            The right value.
        letters
            Letters that may be numbers.
        values
            Values of the letters.
        """
        in_numbers = self._with(right, letters, values)
        without = self._with(right, letters, values, zeros=letters)

        # Terms that come from letters, and in which the answer has something else than the terms without letters.
        own = remaining.terms
        known = without.terms
        of_letters = (in_numbers - without).terms
        terms = [
            monomial
            for monomial in of_letters
            if own.get(monomial, 0) not in (0, known.get(monomial, 0))
        ]

        found = set()
        for letter in letters:
            share = in_numbers - self._with(right, letters, values, zeros=(letter,))
            if any(monomial in share.terms for monomial in terms):
                found.add(letter)
        return frozenset(found)

    def _with(
        self,
        right: Element,
        letters: Collection[str],
        values: Mapping[str, Fraction],
        zeros: Collection[str] = (),
    ) -> Element:
        """Return an element with their values for letters, and 0 for those in ``zeros``."""
        ring = self.truth.arm(self.quantity).ring
        numbers = {
            name: ring.zero if name in zeros else ring.number(values[name]) for name in letters
        }
        return substituted(element_array([right]), numbers, ring)[0]  # type: ignore[no-any-return]


def _is_written(number: Number, whole: Collection[Fraction] = ()) -> bool:
    """Whether a number may stand for a letter: a decimal, or one of the given whole numbers."""
    return "." in number.text or "e" in number.text.lower() or number.value in whole


def _has_written(tree: Tree) -> bool:
    """Whether a formula has a decimal."""
    return any(isinstance(part, Number) and _is_written(part) for part in parts_of(tree))


def _without_written(tree: Tree, whole: Collection[Fraction] = ()) -> Tree:
    """Return a formula with 0 for each number that may stand for a letter; the formula itself if it has none.

    Exponents and the arguments of functions keep their numbers. A quotient by such a number is 0 too, as the product
    with its reciprocal is; a divisor is never one of the whole numbers.
    """
    match tree:
        case Number():
            return _NOTHING if _is_written(tree, whole) else tree
        case Power(base, exponent):
            inner = _without_written(base, whole)
            return tree if inner is base else replace(tree, base=inner, exponent=exponent)
        case Sum(terms):
            changed = tuple((added, _without_written(term, whole)) for added, term in terms)
            return Sum(changed) if _differ(changed, terms) else tree
        case Product(factors):
            parts: list[tuple[bool, Tree]] = []
            for is_factor, factor in factors:
                inner = _without_written(factor, whole if is_factor else ())
                if inner is _NOTHING:
                    return _NOTHING
                parts.append((is_factor, inner))
            return Product(tuple(parts)) if _differ(parts, factors) else tree
        case Name() | Call():
            return tree
    return tree


def _differ(changed: Sequence[tuple[bool, Tree]], parts: Sequence[tuple[bool, Tree]]) -> bool:
    """Whether a term or factor was replaced: the trees that were not are the same objects."""
    return any(new is not old for (_, new), (_, old) in zip(changed, parts, strict=True))
