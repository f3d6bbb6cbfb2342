"""The matrices that names stand for on a sheet: its own answers, and the vectors of the joints' state."""

from __future__ import annotations

import re
from collections.abc import Mapping

from dhkit.errors import AnswerError
from dhkit.grading.answers.given import given_quantity
from dhkit.grading.answers.matrix_algebra import MatrixOf, Rows
from dhkit.grading.answers.quantity_names import QuantityNames, Target
from dhkit.grading.answers.reading import read_answer
from dhkit.grading.answers.sheet_values import Entries
from dhkit.grading.answers.vocabulary import Vocabulary, plain_name

_VECTOR = re.compile(r"(?:d|dd|dot|ddot|d2)?(?:q|th|theta|Theta|vartheta)(?:d|dd|dot|ddot)?")
"""Names of the columns of joint values, rates and accelerations; t is the time."""


class SheetMatrices:
    """The matrices that names stand for on a sheet: its own answers, and the vectors of the joints' state.

    Parameters
    ----------
    answers
        The sheet's answers by quantity.
    vocabulary
        Meanings of names; a name that has a meaning of its own is not a matrix.
    names
        Which names stand for quantities.
    """

    def __init__(
        self, answers: Mapping[str, object], vocabulary: Vocabulary, names: QuantityNames
    ) -> None:
        self.answers = answers
        self.vocabulary = vocabulary
        self.names = names
        self._read: dict[str, Rows] = {}

    def without(self, *quantities: str) -> MatrixOf:
        """Return which names stand for matrices, where some quantities are not known yet."""
        return lambda name: self._matrix(name, quantities)

    def _matrix(self, name: str, unknown: tuple[str, ...]) -> Rows | None:
        vocabulary = self.vocabulary
        quantity = self.names.quantity(name)
        # G is taken for a parameter g only where it is not an answer.
        is_answer = (
            quantity and quantity in self.answers and not vocabulary.is_own(plain_name(name))
        )
        if vocabulary.knows(name) and not is_answer:
            return None
        if _VECTOR.fullmatch(plain_name(name)) and vocabulary.is_state(f"{name}1"):
            return [[read_answer(f"{name}{i + 1}", vocabulary)] for i in range(self.names.n)]
        if quantity in unknown or not isinstance(self.answers.get(quantity), str | list | Entries):
            return None
        if quantity not in self._read:
            shape = self.names.shape(quantity)
            value = self.answers[quantity]
            given = given_quantity(
                quantity, value, shape, vocabulary, self.names, self.without(*unknown, quantity)
            )
            if unread := next((entry for entry in given if entry.tree is None), None):
                raise AnswerError(
                    f"{name}: {Target(quantity, unread.index)} is not read: {unread.error}"
                )
            trees = [entry.tree for entry in given if entry.tree is not None]
            columns = shape[1] if len(shape) == 2 else 1
            self._read[quantity] = [trees[k : k + columns] for k in range(0, len(trees), columns)]
        return self._read[quantity]
