"""Judging of Denavit-Hartenberg tables: the same arm in the same frames, the same arm in other frames, or another arm.

Equality in the same frames is decided exactly: every A_i of the answer equals the file's in the ring. A table of the
other convention is compared with the file's table rewritten in that convention, which is exact too: Rz Tz and Tx Rx
only change partners. Whether two tables describe one arm in different frames is decided numerically, to 1e-9, by the
positions of their joint axes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from dhkit.description import Convention, Description
from dhkit.expressions import PI, ZERO, Expression, substitute
from dhkit.expressions.syntax import Tree
from dhkit.grading.answers.sheet_values import Requirements
from dhkit.grading.catalogue import hint_of, sentence_of
from dhkit.grading.grade_report import Diagnosis, Entry, KinematicJudgement, Verdict, entry_name
from dhkit.grading.judging.frame_changes import FrameChange
from dhkit.grading.judging.same_arm import Overlay, overlaid
from dhkit.grading.judging.table_arms import TableArm
from dhkit.grading.judging.table_rows import COLUMNS, Answer, JudgedRow, TableRows, other_convention
from dhkit.grading.remarks import Note, NoteKind

_OPEN_TASK = Requirements()
"""Requirements that leaves frames and zero pose open."""
_UNEXPLAINED = {
    "theta": "wrong_theta",
    "d": "wrong_length",
    "a": "wrong_length",
    "alpha": "wrong_twist",
}
"""Mistake for each column that is named if no more specific one explains a wrong entry."""


@dataclass(frozen=True)
class TableJudgement(KinematicJudgement):
    """Judgement of a table, with one entry for each row.

    CORRECT is proved: A_i equals the file's. UNDECIDED means that A_i agrees in doubles but is outside the exact ring,
    or that the whole table is the same arm in other frames, which is decided numerically. A table that has the file's
    frames and counts joints from another zero is WRONG, whatever the constants; a note says that it is the same arm.

    Attributes
    ----------
    other_frames
        Changes of frames and joint variables from the file's, if the table is the same arm in other frames.
    moves_zero
        Whether, in other frames, a joint variable has another zero or the opposite sense.
    """

    other_frames: tuple[FrameChange, ...] = ()
    moves_zero: bool = False


def judge_table(
    description: Description,
    rows: Sequence[Sequence[Tree]],
    convention: Convention | str,
    seed: int = 0,
    task: Requirements = _OPEN_TASK,
) -> TableJudgement:
    """Judge a table against a robot's.

    Parameters
    ----------
    description
        The robot; links may lack bodies.
    rows
        One row for each joint: theta, d, a, alpha (modified: theta_i, d_i, a_(i-1), alpha_(i-1)), in m and rad, of the
        joint variables q1 ... qn, the robot's parameters, pi, deg, mm, cm and inch.
    convention
        Convention that the answer states.
    seed
        Seed of the random states at which entries outside the exact ring are tried.
    task
        Whether the task gives the frames or the zero pose: a table with others is then wrong.

    Raises
    ------
    AnswerError
        Another number of rows or columns, an unknown name or function.
    ValueError
        No such convention.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.expressions import read
    >>> rows = [[read(entry) for entry in row] for row in (("q1", "0", "l1", "0"), ("q2", "l2", "0", "0"))]
    >>> judgement = judge_table(library_robot("planar2r"), rows, "standard")
    >>> [entry.verdict.value for entry in judgement.entries], judgement.diagnosis[0].mistake
    (['correct', 'wrong'], 'a_d_exchanged')
    """
    table = TableRows(description, Answer.of(description, rows), Convention(convention), seed)
    with np.errstate(all="ignore"):
        return _judge(table, task)


def _judge(table: TableRows, task: Requirements) -> TableJudgement:
    rows = [table.row(i) for i in range(table.n)]
    entries = _entries(rows)
    notes = _notes(table)
    in_numbers = frozenset[str]().union(*(row.numbers for row in rows))
    at_values = _file_values(table, in_numbers)

    wrong = _wrong_rows(rows)
    if not wrong:
        return TableJudgement(entries, notes=notes, at_values=at_values)

    mistakes = _row_mistakes(table, wrong)
    overlay = _overlay(table)
    # Without changes all frames are the file's to 1e-9: the numbers that are wrong by less belong to another arm.
    if overlay is not None and overlay.changes:
        return _judge_in_other_frames(table, rows, mistakes, overlay, task)

    diagnosis = tuple(mistake.diagnosis() for mistake in mistakes)
    if _is_of_other_convention(table):
        other = other_convention(table.convention).value
        given = table.convention.value
        detail = f"it is the {other} one, and was handed in as {given}"
        diagnosis = (_diagnosis_of_table("other_convention", entries, detail),)
    return TableJudgement(entries, diagnosis, notes, at_values)


def _wrong_rows(rows: Sequence[JudgedRow]) -> list[int]:
    """Return the numbers of the wrong rows, from 0."""
    return [i for i, row in enumerate(rows) if row.verdict is Verdict.WRONG]


def _notes(table: TableRows) -> tuple[Note, ...]:
    if not table.converted:
        return ()
    conventions = (table.description.convention.value, table.convention.value)
    return (Note(NoteKind.OTHER_CONVENTION, "dh", conventions),)


def _file_values(table: TableRows, names: Collection[str]) -> dict[str, float]:
    """Return the file's values of some parameters, SI units and rad."""
    return {name: table.states[0][name] for name in table.description.parameters if name in names}


def _judge_in_other_frames(
    table: TableRows,
    rows: Sequence[JudgedRow],
    mistakes: tuple[_RowMistake, ...],
    overlay: Overlay,
    task: Requirements,
) -> TableJudgement:
    """Judge a table that is the same arm in other frames.

    It is wrong if it has the file's frames with another zero, whatever the constants, or if a single slip explains it:
    a slip is likelier than a choice of frames that differs in one entry alone. Otherwise the frames are a choice.
    """
    wrong = _wrong_rows(rows)
    moves_zeros_only = all(_moves_zero_only(table, i) for i in wrong)
    is_slip = len(mistakes) == 1 and mistakes[0].is_specific
    refusal = _refusal(overlay, task)

    rows = list(rows)
    for i in wrong:
        if moves_zeros_only or is_slip or refusal:
            rows[i] = replace(rows[i], statement=rows[i].statement + refusal)
        else:
            statement = "the same arm in other frames, numerically"
            rows[i] = replace(rows[i], verdict=Verdict.UNDECIDED, statement=statement)
    entries = _entries(rows)

    other_frames = _diagnosis_of_table(
        "other_frames", entries, "; ".join(map(str, overlay.changes))
    )
    named = tuple(mistake.diagnosis() for mistake in mistakes if mistake.is_specific)
    diagnosis: tuple[Diagnosis, ...] = (other_frames,)
    if moves_zeros_only:
        diagnosis = (*named, other_frames)
    elif is_slip:
        diagnosis = named

    notes = _notes(table)
    if moves_zeros_only or is_slip:
        notes = (*notes, Note(NoteKind.RIGHT_IN_OTHER_FRAMES, "dh"))

    at_values = _file_values(table, _written(table))
    return TableJudgement(entries, diagnosis, notes, at_values, overlay.changes, overlay.moves_zero)


def _moves_zero_only(table: TableRows, i: int) -> bool:
    """Whether row i, from 0, differs from the file's only by a constant added to its joint variable."""
    own_column = COLUMNS.index("theta" if table.description.kinds[i] == "R" else "d")
    for k, truth in enumerate(table.reference[i]):
        if k != own_column and not table.equal(i, k, truth):
            return False
    entry = table.answer.entries[i][own_column]
    if entry is None:
        return False
    difference = entry - table.reference[i][own_column]
    return not any(f"q{j + 1}" in difference.symbols for j in range(table.n))


def _refusal(overlay: Overlay, task: Requirements) -> str:
    """Return the reason for which a table in other frames is wrong for a task; empty if it is allowed."""
    if task.frames_given:
        return ": the task gives the frames"
    if overlay.moves_zero and task.zero_given:
        return ": the task gives the zero pose"
    return ""


def _entries(rows: Sequence[JudgedRow]) -> tuple[Entry, ...]:
    return tuple(
        Entry("dh", (i,), row.verdict, statement=row.statement) for i, row in enumerate(rows)
    )


def _diagnosis_of_table(mistake: str, entries: Sequence[Entry], detail: str) -> Diagnosis:
    """Return a diagnosis of the whole table, which concerns all rows that are not right."""
    concerned = tuple(entry.name for entry in entries if entry.verdict is not Verdict.CORRECT)
    return Diagnosis(
        mistake, sentence_of(mistake, detail=detail), "dh", concerned, hint_of(mistake)
    )


def _written(table: TableRows) -> frozenset[str]:
    """Return the letters of the file that the answer has as numbers in some row."""
    return frozenset[str]().union(*(table.written(i) for i in range(table.n)))


def _overlay(table: TableRows) -> Overlay | None:
    """Return the relation of the answer's frames to the file's; None if the answer is another arm.

    A table in letters has to be this arm at two sets of values: the file's, and random ones.
    """
    strict = not table.converted
    kinds = table.description.kinds
    fixed = {name: table.states[0][name] for name in _written(table)}
    best: Overlay | None = None
    for state in table.states[: 2 if table.description.parameters else 1]:
        values = state | fixed
        answer = TableArm.of_trees(table.answer.trees, kinds, table.convention, values)
        truth = TableArm.of_rows(table.reference, kinds, table.convention, values)
        overlay = None if answer is None else overlaid(answer, truth, strict)
        if overlay is None:
            return None
        if best is None or not best.changes:
            best = overlay
    return best


def _is_of_other_convention(table: TableRows) -> bool:
    """Whether the rows, read in the other convention, are this arm."""
    other = replace(table, convention=other_convention(table.convention))
    return (
        all(other.row(i).verdict is Verdict.CORRECT for i in range(table.n))
        or _overlay(other) is not None
    )


# Mistakes in rows


@dataclass(frozen=True)
class _RowMistake:
    """Mistake in a row.

    Attributes
    ----------
    mistake
        Identifier of the mistake in the catalogue.
    row
        Number of the row, from 0.
    where
        Rows or entry that the mistake concerns, in words.
    is_specific
        Whether the mistake names the error in an entry, and not only that the entry is wrong.
    """

    mistake: str
    row: int
    where: str
    is_specific: bool = True

    def diagnosis(self) -> Diagnosis:
        """Return the diagnosis for a report."""
        sentence = sentence_of(self.mistake, self.where)
        names = (entry_name("dh", (self.row,)),)
        return Diagnosis(
            self.mistake, sentence, f"dh, row {self.row + 1}", names, hint_of(self.mistake)
        )


def _row_mistakes(table: TableRows, wrong: Sequence[int]) -> tuple[_RowMistake, ...]:
    """Return the mistakes in wrong rows, from 0, in their order; rows outside exact arithmetic are left out."""
    mistakes: list[_RowMistake] = []
    unexplained = list(wrong)
    for i, j in combinations(wrong, 2):
        if i not in unexplained or j not in unexplained:
            continue
        if _matches(table, i, j) and _matches(table, j, i):
            unexplained = [k for k in unexplained if k not in (i, j)]
            where = f"rows {i + 1} and {j + 1}"
            mistakes += [
                _RowMistake("rows_exchanged", i, where),
                _RowMistake("rows_exchanged", j, where),
            ]
    for i in unexplained:
        if None not in table.answer.entries[i]:
            mistakes += _explain_row(table, i)
    return tuple(sorted(mistakes, key=lambda mistake: mistake.row))


def _matches(table: TableRows, i: int, j: int) -> bool:
    """Whether row i of the answer is row j of the file, with the variable of joint i or of joint j."""
    own = {f"q{j + 1}": Expression.symbol(f"q{i + 1}")}
    moved = tuple(substitute(entry, own) for entry in table.reference[j])
    return _is_row(table, i, moved) or _is_row(table, i, table.reference[j])


def _is_row(table: TableRows, i: int, row: Sequence[Expression]) -> bool:
    """Whether row i of the answer, from 0, equals another row, entry by entry."""
    return all(table.equal(i, k, entry) for k, entry in enumerate(row))


def _explain_row(table: TableRows, i: int) -> Iterator[_RowMistake]:
    """Yield the mistakes in row i: one of the whole row, or one for each wrong entry."""
    theta, d, a, alpha = table.reference[i]
    q = Expression.symbol(f"q{i + 1}")
    if table.description.kinds[i] == "R":
        exchanged = (theta, a, d, alpha)
        other_column = (theta - q, d + q, a, alpha)
    else:
        exchanged = (theta, a + q, d - q, alpha)
        other_column = (theta + q, d - q, a, alpha)
    for name, row in (("a_d_exchanged", exchanged), ("variable_column", other_column)):
        if _is_row(table, i, row):
            yield _RowMistake(name, i, f"row {i + 1}")
            return
    for k, truth in enumerate(table.reference[i]):
        if not table.equal(i, k, truth):
            yield _explain_entry(table, i, k, truth)


def _explain_entry(table: TableRows, i: int, k: int, truth: Expression) -> _RowMistake:
    where = f"row {i + 1}, {COLUMNS[k]} = {table.answer.entries[i][k]}"
    for name, entry in _wrong_entries(table, i, k, truth):
        if table.equal(i, k, entry):
            return _RowMistake(name, i, where)
    return _RowMistake(_UNEXPLAINED[COLUMNS[k]], i, where, is_specific=False)


def _wrong_entries(
    table: TableRows, i: int, k: int, truth: Expression
) -> Iterator[tuple[str, Expression]]:
    """Yield mistakes in an entry, each with the entry that it gives.

    The right entry is the joint variable plus an offset in the joint's own column, and the offset alone elsewhere.
    """
    own_column = "theta" if table.description.kinds[i] == "R" else "d"
    has_variable = COLUMNS[k] == own_column
    q = Expression.symbol(f"q{i + 1}") if has_variable else ZERO
    offset = truth - q
    if has_variable:
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
