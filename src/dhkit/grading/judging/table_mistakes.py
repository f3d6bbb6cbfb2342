"""Which mistakes explain the wrong rows of a table: in a whole row, in one entry, or two rows exchanged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

from dhkit.expressions import PI, ZERO, Expression, substitute
from dhkit.grading.judging.table_rows import COLUMNS, TableRows
from dhkit.grading.mistakes.library import hint_of, sentence_of
from dhkit.grading.report import Diagnosis, Entry, Verdict

WRONG_COLUMNS = {"theta": "wrong_theta", "d": "wrong_length", "a": "wrong_length", "alpha": "wrong_twist"}
"""What is said of an entry that no mistake explains, by column."""


@dataclass(frozen=True)
class RowMistake:
    """A mistake in a row.

    Attributes
    ----------
    mistake
        The identity of a mistake of the library.
    row
        Which row, from 0.
    where
        The rows or the entry that it concerns, in words.
    is_specific
        Whether it says what is wrong with the entry, and not only that it is wrong.
    """

    mistake: str
    row: int
    where: str
    is_specific: bool = True

    def diagnosis(self) -> Diagnosis:
        """Return what a report says of it."""
        return Diagnosis(
            self.mistake,
            sentence_of(self.mistake, self.where),
            f"dh, row {self.row + 1}",
            (Entry("dh", (self.row,), Verdict.WRONG).name,),
            hint_of(self.mistake),
        )


def row_mistakes(table: TableRows, wrong: Sequence[int]) -> tuple[RowMistake, ...]:
    """Return what explains wrong rows, from 0, in their order; rows outside exact arithmetic are left out."""
    found = []
    left = list(wrong)
    for i, j in combinations(wrong, 2):
        if i in left and j in left and _matches(table, i, j) and _matches(table, j, i):
            left = [k for k in left if k not in (i, j)]
            found += [RowMistake("rows_exchanged", k, f"rows {i + 1} and {j + 1}") for k in (i, j)]
    for i in left:
        if None not in table.answer.entries[i]:
            found += _explained(table, i)
    return tuple(sorted(found, key=lambda mistake: mistake.row))


def _matches(table: TableRows, i: int, j: int) -> bool:
    """Return whether row i of the answer is row j of the file, with row i's joint variable or row j's."""
    own = {f"q{j + 1}": Expression.symbol(f"q{i + 1}")}
    moved = tuple(substitute(entry, own) for entry in table.reference[j])
    return any(all(table.equal(i, column, row[column]) for column in range(4)) for row in (moved, table.reference[j]))


def _explained(table: TableRows, i: int) -> Iterator[RowMistake]:
    """Yield what explains row i: a mistake of the whole row, or one an entry."""
    theta, d, a, alpha = table.reference[i]
    q = Expression.symbol(f"q{i + 1}")
    turning = table.description.kinds[i] == "R"
    exchanged = (theta, a, d, alpha) if turning else (theta, a + q, d - q, alpha)
    column = (theta - q, d + q, a, alpha) if turning else (theta + q, d - q, a, alpha)
    for name, row in (("a_d_exchanged", exchanged), ("variable_column", column)):
        if all(table.equal(i, k, entry) for k, entry in enumerate(row)):
            yield RowMistake(name, i, f"row {i + 1}")
            return
    for k, truth in enumerate(table.reference[i]):
        if not table.equal(i, k, truth):
            yield _explained_entry(table, i, k, truth)


def _explained_entry(table: TableRows, i: int, k: int, truth: Expression) -> RowMistake:
    where = f"row {i + 1}, {COLUMNS[k]} = {table.answer.entries[i][k]}"
    for name, entry in _wrong_entries(table, i, k, truth):
        if table.equal(i, k, entry):
            return RowMistake(name, i, where)
    return RowMistake(WRONG_COLUMNS[COLUMNS[k]], i, where, is_specific=False)


def _wrong_entries(table: TableRows, i: int, k: int, truth: Expression) -> Iterator[tuple[str, Expression]]:
    """Yield what an entry would be with each mistake."""
    own = COLUMNS[k] == ("theta" if table.description.kinds[i] == "R" else "d")
    q = Expression.symbol(f"q{i + 1}") if own else ZERO
    offset = truth - q
    if own:
        yield "variable_forgotten", offset
        for j in range(table.n):
            yield "variable_of_another_joint", offset + Expression.symbol(f"q{j + 1}")
    if COLUMNS[k] in ("d", "a"):
        yield "length_sign", q - offset
        yield f"{COLUMNS[k]}_forgotten", q
        yield "millimetres_for_metres", q + offset * 1000
        return
    yield "degrees_for_radians", q + offset * 180 / PI
    if COLUMNS[k] == "alpha":
        yield "alpha_sign", -truth
        yield "alpha_forgotten", ZERO
        return
    yield "theta_offset_forgotten", q
    yield "theta_offset_sign", q - offset
    yield "theta_sign", -truth
