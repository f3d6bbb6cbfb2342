"""Other values of an arm's parameters, at which formulas in letters must be right too.

At the file's values a formula may be right by chance: a letter is missing whose value is 1, or one length stands for
another of the same value.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from dhkit.description import Description
from dhkit.description.changes import with_parameters
from dhkit.errors import DescriptionError
from dhkit.expressions.syntax import Number, Tree
from dhkit.grading.judging.numeric import names_of, parts_of

LEAST, MOST = 0.8, 1.25
"""Factors by which a value is changed."""
SAME = 1e-9
"""Relative difference up to which a number that is written is a parameter's value."""


def with_other_values(description: Description, trees: Collection[Tree], seed: int) -> Description | None:
    """Return the arm with other values of its parameters; None if the formulas have none of its letters.

    A parameter keeps its value if the formulas have the value as a number in its place, 0.5 for l1 = 0.5; not if that
    is 1, which may mean anything.

    Parameters
    ----------
    trees
        The formulas.
    seed
        Seed of the random values.
    """
    parameters = frozenset(description.parameters)
    used = frozenset().union(*(names_of(tree) for tree in trees)) & parameters
    if not used:
        return None
    written = {abs(float(part.value)) for tree in trees for part in parts_of(tree) if isinstance(part, Number)} - {
        0.0,
        1.0,
    }
    values = description.numbers.values
    kept = {
        name
        for name in parameters - used
        if any(abs(abs(values[name]) - number) <= SAME * number for number in written)
    }
    rng = np.random.default_rng(seed)
    changed = {name: round(float(values[name] * rng.uniform(LEAST, MOST)), 6) for name in sorted(parameters - kept)}
    try:
        return with_parameters(description, **changed)
    except DescriptionError:  # the other values make no robot
        return None
