"""Inverse kinematics at other values of the arm's letters than the file's.

At the file's values a formula may be right by chance: a letter is missing whose value is 1, or one length stands for
another of the same value. Letters are the file's parameters, and the names of the table's lengths, such as a2 and d4.
A number that is written stands for the letter whose value it is: 0.5 for l1, 0.25 for l1^2, 1 for 2 l1.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import combinations

import numpy as np

from dhkit.description import Description
from dhkit.description.changes import with_parameters
from dhkit.errors import DescriptionError
from dhkit.expressions import Expression
from dhkit.expressions.syntax import Name, Number, Tree
from dhkit.expressions.trees import names_of, parts_of
from dhkit.grading.judging.changed_formulas import leaf_text, renamed, square_of, times
from dhkit.symbolic import table_lengths
from dhkit.symbolic.inverse.chain import with_table_lengths

_MIN_FACTOR = 0.8
"""Smallest factor by which values are changed."""
_MAX_FACTOR = 1.25
"""Largest factor by which values are changed."""
_SAME_VALUE = 1e-9
"""Largest relative difference of a number that is written from the value of the letter for which it stands."""
_MAX_PURE_NUMBER = 12
"""Largest numerator and denominator of a factor that formulas have whatever the lengths are: 2, 1/2, 1/12."""
_TWO = Number(Fraction(2), "2", 0)


@dataclass(frozen=True)
class OtherValues:
    """An arm with other values of its letters, and the change of formulas for the file's arm into formulas for it.

    Attributes
    ----------
    description
        The arm; None if the formulas have none of its letters.
    in_letters
        Letters, or formulas of them, that replace numbers, by the text of the number.
    at_values
        File's values of the letters at which alone the formulas are judged: those that they have as numbers.
    changed
        Other values by letter.
    """

    description: Description | None
    in_letters: Mapping[str, Tree]
    at_values: Mapping[str, float]
    changed: Mapping[str, float] = field(default_factory=dict)

    def formula(self, tree: Tree) -> Tree:
        """Return a formula for the arm with other values."""
        return renamed(tree, self.in_letters)


def with_other_values(description: Description, trees: Sequence[Tree], seed: int) -> OtherValues:
    """Return the arm with other values of its letters.

    Parameters
    ----------
    trees
        The formulas.
    seed
        Seed of the random values.
    """
    table = {name: float(value) for name, value in table_lengths(description).items()}
    numbers = description.numbers.values
    parameters = {name: float(numbers[name]) for name in _kinematic_parameters(description)}
    letters = parameters | table
    used = _names_of_all(trees) & letters.keys()
    if not used:
        return OtherValues(None, {}, parameters)

    # Numbers that are written, and the letters for which they stand.
    in_letters: dict[str, Tree] = {}
    kept: set[str] = set()
    for text, number in _written_values(trees).items():
        found = _letters_of(float(number), letters)
        if len(found) == 1:
            in_letters[text] = found[0]
        elif found:
            # It may be any of several letters: all of them keep their values.
            kept |= _names_of_all(found)
        else:
            # It may be made of letters that the formulas do not have: these keep their values.
            kept |= {name for name in parameters if name not in used}
    varied = letters.keys() - kept
    at_values = {
        name: letters[name]
        for name in kept | _names_of_all(in_letters.values())
        if name not in used
    }

    # The arm at other values.
    rng = np.random.default_rng(seed)
    values: dict[str, float] = {}
    for name in sorted(varied):
        values[name] = round(letters[name] * float(rng.uniform(_MIN_FACTOR, _MAX_FACTOR)), 6)
    try:
        other = with_parameters(
            description, **{name: x for name, x in values.items() if name in parameters}
        )
        lengths = {name: Fraction(str(x)) for name, x in values.items() if name in table}
        other = with_table_lengths(other, lengths)
    except DescriptionError:
        # There is no robot with these values.
        return OtherValues(None, {}, at_values)
    return OtherValues(other, in_letters, at_values, values)


def _written_values(trees: Sequence[Tree]) -> dict[str, Fraction]:
    """Return the numbers in formulas that may be lengths, by their texts."""
    written: dict[str, Fraction] = {}
    for tree in trees:
        for part in parts_of(tree):
            if isinstance(part, Number) and _is_value(part):
                written[leaf_text(part)] = part.value
    return written


def _kinematic_parameters(description: Description) -> list[str]:
    """Return the parameters on which the table, the base and the tool depend."""
    expressions: list[Expression] = []
    for joint in description.joints:
        expressions += [joint.theta, joint.d, joint.a, joint.alpha]
    for placement in (description.base.placement, description.tool.placement):
        expressions += [*placement.xyz, *placement.rpy]
    used: set[str] = set().union(*(expression.symbols for expression in expressions))

    # Parameters may be made of others.
    waiting = list(used)
    while waiting:
        for name in description.parameters[waiting.pop()].symbols:
            if name not in used:
                used.add(name)
                waiting.append(name)
    return [name for name in description.parameters if name in used]


def _is_value(part: Number) -> bool:
    """Whether a number may be a length: a decimal, not a factor such as 2 or 1/2."""
    is_pure = (
        part.value.denominator <= _MAX_PURE_NUMBER and abs(part.value.numerator) <= _MAX_PURE_NUMBER
    )
    return "." in part.text or not is_pure


def _names_of_all(trees: Iterable[Tree]) -> frozenset[str]:
    """Return the names that occur in formulas."""
    return frozenset[str]().union(*map(names_of, trees))


def _letters_of(number: float, letters: Mapping[str, float]) -> list[Tree]:
    """Return the simplest formulas of letters that have a number as their value: l, l^2, 2 l, else l m and 2 l m."""
    for formulas in (_powers(letters), _products(letters)):
        found = [
            tree for value, tree in formulas if abs(value - number) <= _SAME_VALUE * abs(value)
        ]
        if found:
            return found
    return []


def _powers(letters: Mapping[str, float]) -> Iterator[tuple[float, Tree]]:
    """Yield l, l^2 and 2 l, with their values, of letters that are not 0."""
    for name, value in letters.items():
        if value:
            tree = Name(name, 0)
            yield abs(value), tree
            yield value**2, square_of(tree)
            yield 2 * abs(value), times(_TWO, tree)


def _products(letters: Mapping[str, float]) -> Iterator[tuple[float, Tree]]:
    """Yield the products of two letters, and twice these, with their values."""
    for (one, first), (two, second) in combinations(letters.items(), 2):
        if first and second:
            tree = times(Name(one, 0), Name(two, 0))
            yield abs(first * second), tree
            yield 2 * abs(first * second), times(_TWO, tree)


def are_ambiguous(description: Description, trees: Iterable[Tree]) -> bool:
    """Whether letters of some formulas have equal values, or the value 1, so that one mistake looks like another."""
    table = {name: float(value) for name, value in table_lengths(description).items()}
    values = description.numbers.values
    used = _names_of_all(trees)
    sizes = [abs(float(values[name])) for name in description.parameters if name in used]
    sizes += [abs(value) for name, value in table.items() if name in used]
    has_one = any(abs(size - 1) < _SAME_VALUE for size in sizes)
    has_equal = len({round(size, 9) for size in sizes}) < len(sizes)
    return has_one or has_equal
