"""Judging a Denavit-Hartenberg table: the same arm in the same frames, in other frames, or another arm.

Same frames is decided exactly: every A_i of the answer equals the file's in the ring. A table of the other convention
is held against the file's table rewritten in it, which is exact too: Rz Tz and Tx Rx only change partners. Whether two
tables are one arm in different frames is numerical, to 1e-9: their joint axes are laid over one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dhkit.description import Convention, Description
from dhkit.expressions.syntax import Tree
from dhkit.grading.answers.given import Given
from dhkit.grading.answers.sheet import Task
from dhkit.grading.judging.frame_changes import FrameChange
from dhkit.grading.judging.kinematic_judgement import KinematicJudgement, unreadable_entries, with_texts
from dhkit.grading.judging.same_arm import Overlay, overlaid
from dhkit.grading.judging.table_arms import TableArm
from dhkit.grading.judging.table_mistakes import RowMistake, row_mistakes
from dhkit.grading.judging.table_rows import Answer, JudgedRow, TableRows, other_convention
from dhkit.grading.mistakes.library import hint_of, sentence_of
from dhkit.grading.report import Diagnosis, Entry, Note, NoteKind, Verdict

ASKED = Task()
"""A task that leaves frames and zero pose open."""


@dataclass(frozen=True)
class TableJudgement(KinematicJudgement):
    """What is decided of a table, an entry a row.

    CORRECT is proved: A_i equals the file's. UNDECIDED: A_i agrees in doubles but is outside the exact ring, or the
    whole table is the same arm in other frames, which is numerical.

    Attributes
    ----------
    other_frames
        How frames and joint variables differ from the file's where the table is the same arm in other frames; empty
        otherwise.
    moves_zero
        Whether, in other frames, a joint variable counts from another zero or the other way round.
    """

    other_frames: tuple[FrameChange, ...] = ()
    moves_zero: bool = False


def table_entries(
    description: Description, rows: Sequence[Sequence[Given]], convention: str, task: Task, seed: int = 0
) -> KinematicJudgement:
    """Judge the table of a sheet; see :func:`judge_table`.

    Raises
    ------
    AnswerError
        An entry with a name or a function that tables do not have.
    """
    if unreadable := unreadable_entries("dh", rows):
        return KinematicJudgement(unreadable)
    trees = [[entry.tree for entry in row if entry.tree is not None] for row in rows]
    judgement = judge_table(description, trees, convention, seed, task)
    return replace(judgement, entries=with_texts(judgement.entries, rows))


def judge_table(
    description: Description,
    rows: Sequence[Sequence[Tree]],
    convention: Convention | str,
    seed: int = 0,
    task: Task = ASKED,
) -> TableJudgement:
    """Judge a table against a robot's.

    Parameters
    ----------
    description
        The robot; links may lack bodies.
    rows
        One a joint: theta, d, a, alpha (modified: theta_i, d_i, a_(i-1), alpha_(i-1)), in metres and radians, of the
        joint variables q1 ... qn, the robot's parameters, pi, deg, mm, cm and inch.
    convention
        What the answer says that its table is.
    seed
        Of the random states that entries outside the exact ring are tried at.
    task
        Whether frames or the zero pose are given: a table with others is then wrong.

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
        return _judged(table, task)


def _judged(table: TableRows, task: Task) -> TableJudgement:
    rows = [table.row(i) for i in range(table.n)]
    in_numbers = frozenset().union(*(row.numbers for row in rows))
    at = {name: table.states[0][name] for name in table.description.parameters if name in in_numbers}
    notes: tuple[Note, ...] = ()
    if table.converted:
        conventions = (table.description.convention.value, table.convention.value)
        notes = (Note(NoteKind.OTHER_CONVENTION, "dh", conventions),)
    wrong = [i for i, row in enumerate(rows) if row.verdict is Verdict.WRONG]
    if not wrong:
        return TableJudgement(_entries(rows), notes=notes, judged_at=at)
    mistakes = row_mistakes(table, wrong)
    overlay = _overlay(table)
    # Without changes all frames are the file's, within 1e-9: a number is off by less, which is another arm's.
    if overlay is not None and overlay.changes:
        return _in_other_frames(rows, wrong, mistakes, overlay, task, notes, at)
    entries = _entries(rows)
    diagnosis = tuple(mistake.diagnosis() for mistake in mistakes)
    if _is_of_other_convention(table):
        other, given = other_convention(table.convention).value, table.convention.value
        detail = f"it is the {other} one, and was handed in as {given}"
        diagnosis = (_of_table("other_convention", entries, detail),)
    return TableJudgement(entries, diagnosis, notes, at)


def _in_other_frames(
    rows: Sequence[JudgedRow],
    wrong: Sequence[int],
    mistakes: tuple[RowMistake, ...],
    overlay: Overlay,
    task: Task,
    notes: tuple[Note, ...],
    at: dict[str, float],
) -> TableJudgement:
    """Return the judgement of a table that is the same arm in other frames: a choice, unless it is rather a slip.

    One slip is more likely than a choice of frames that differs in one entry alone; several slips are a choice.
    """
    slips = mistakes if len(mistakes) == 1 and mistakes[0].is_specific else ()
    refused = _refused(overlay, task)
    verdict, statement = Verdict.UNDECIDED, "the same arm in other frames, numerically"
    moved = [replace(row, verdict=verdict, statement=statement) if i in wrong else row for i, row in enumerate(rows)]
    if slips or refused:
        moved = [replace(row, statement=row.statement + refused) if i in wrong else row for i, row in enumerate(rows)]
    entries = _entries(moved)
    diagnosis = tuple(slip.diagnosis() for slip in slips)
    if slips:
        notes = (*notes, Note(NoteKind.RIGHT_IN_OTHER_FRAMES, "dh"))
    else:
        diagnosis = (_of_table("other_frames", entries, "; ".join(map(str, overlay.changes))),)
    return TableJudgement(entries, diagnosis, notes, at, overlay.changes, overlay.moves_zero)


def _refused(overlay: Overlay, task: Task) -> str:
    """Return why a table in other frames is wrong for this task; empty where it is allowed."""
    if task.frames_given:
        return ": the task gives the frames"
    if overlay.moves_zero and task.zero_given:
        return ": the task gives the zero pose"
    return ""


def _entries(rows: Sequence[JudgedRow]) -> tuple[Entry, ...]:
    return tuple(Entry("dh", (i,), row.verdict, statement=row.statement) for i, row in enumerate(rows))


def _of_table(mistake: str, entries: Sequence[Entry], detail: str) -> Diagnosis:
    """Return a diagnosis of the whole table: it concerns all rows that are not right."""
    concerned = tuple(entry.name for entry in entries if entry.verdict is not Verdict.CORRECT)
    return Diagnosis(mistake, sentence_of(mistake, detail=detail), "dh", concerned, hint_of(mistake))


def _overlay(table: TableRows) -> Overlay | None:
    """Return how the frames lie on the file's where the table is the same arm; None where it is another arm."""
    strict, kinds = not table.converted, table.description.kinds
    found: Overlay | None = None
    symbolic = table.description.parameters and not any(table.has_numbers(i) for i in range(table.n))
    for values in table.states[: 2 if symbolic else 1]:
        answer = TableArm.of_trees(table.answer.trees, kinds, table.convention, values)
        truth = TableArm.of_rows(table.reference, kinds, table.convention, values)
        overlay = None if answer is None else overlaid(answer, truth, strict)
        if overlay is None:
            return None
        found = found if found is not None and found.changes else overlay
    return found


def _is_of_other_convention(table: TableRows) -> bool:
    """Return whether the rows, read in the other convention, are this arm."""
    other = replace(table, convention=other_convention(table.convention))
    return all(other.row(i).verdict is Verdict.CORRECT for i in range(table.n)) or _overlay(other) is not None
