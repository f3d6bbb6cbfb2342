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
from dhkit.expressions.syntax import Name, Number, Tree
from dhkit.expressions.trees import names_of, parts_of
from dhkit.grading.judging.changed_formulas import leaf_text, renamed, square_of, times
from dhkit.symbolic import table_lengths
from dhkit.symbolic.inverse.chain import with_table_lengths

_LEAST_FACTOR, _MOST_FACTOR = 0.8, 1.25
"""Factors by which values are changed."""
_SAME_VALUE = 1e-9
"""Relative difference up to which a number that is written is the value of a letter."""
_MAX_FACTOR = 12
"""Largest numerator and denominator of a factor that formulas have whatever the lengths are: 2, 1/2, 1/12."""


_TWO = Number(Fraction(2), "2", 0)


@dataclass(frozen=True)
class OtherValues:
    """An arm with other values, and what formulas for the file's arm are for it.

    Attributes
    ----------
    description
        The arm; None if the formulas have none of its letters.
    in_letters
        Letters, or formulas of them, for numbers that are written, by the text of the number.
    at_values
        Letters that keep the file's values, since the formulas have them as numbers, or have no letter at all.
    changed
        The other values by letter.
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
    used = frozenset().union(*map(names_of, trees)) & letters.keys()
    if not used:
        return OtherValues(None, {}, parameters)
    parts = [part for tree in trees for part in parts_of(tree)]
    written = {leaf_text(part): part.value for part in parts if isinstance(part, Number) and _is_value(part)}
    in_letters: dict[str, Tree] = {}
    kept: set[str] = set()
    for text, number in written.items():
        found = _letters_of(float(number), letters)
        if len(found) == 1:
            in_letters[text] = found[0]
        else:  # a number of several letters, or of none: what it may be keeps its value
            kept |= set().union(*map(names_of, found)) if found else {name for name in parameters if name not in used}
    varied = letters.keys() - kept
    at_values = {name: letters[name] for name in kept | _names_of_all(in_letters.values()) if name not in used}
    rng = np.random.default_rng(seed)
    values = {
        name: round(letters[name] * float(rng.uniform(_LEAST_FACTOR, _MOST_FACTOR)), 6) for name in sorted(varied)
    }
    try:
        other = with_parameters(description, **{name: x for name, x in values.items() if name in parameters})
        lengths = {name: Fraction(str(x)) for name, x in values.items() if name in table}
        other = with_table_lengths(other, lengths)
    except DescriptionError:  # the other values make no robot
        return OtherValues(None, {}, at_values)
    return OtherValues(other, in_letters, at_values, values)


def _kinematic_parameters(description: Description) -> list[str]:
    """Return the parameters that the table, the base and the tool have."""
    expressions = [x for joint in description.joints for x in (joint.theta, joint.d, joint.a, joint.alpha)]
    used: set[str] = set().union(*(x.symbols for x in expressions))
    for placement in (description.base.placement, description.tool.placement):
        used |= {symbol for x in (*placement.xyz, *placement.rpy) for symbol in x.symbols}
    waiting = list(used)
    while waiting:  # parameters that others are made of
        for name in description.parameters[waiting.pop()].symbols:
            if name not in used:
                used.add(name)
                waiting.append(name)
    return [name for name in description.parameters if name in used]


def _is_value(part: Number) -> bool:
    """Whether a number may be a length: a decimal, not a factor such as 2 or 1/2."""
    is_factor = part.value.denominator <= _MAX_FACTOR and abs(part.value.numerator) <= _MAX_FACTOR
    return "." in part.text or not is_factor


def _names_of_all(trees: Iterable[Tree]) -> frozenset[str]:
    return frozenset[str]().union(*map(names_of, trees))


def _letters_of(number: float, letters: Mapping[str, float]) -> list[Tree]:
    """Return the letters, and the simplest formulas of letters, whose value a number is."""
    for formulas in (_powers(letters), _products(letters)):
        found = [tree for value, tree in formulas if abs(value - number) <= _SAME_VALUE * abs(value)]
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
    used = frozenset().union(*map(names_of, trees))
    sizes = [abs(float(values[name])) for name in description.parameters if name in used]
    sizes += [abs(value) for name, value in table.items() if name in used]
    return any(abs(x - 1) < _SAME_VALUE for x in sizes) or len({round(x, 9) for x in sizes}) < len(sizes)
