"""Tables and inverse kinematics of a sheet as entries, diagnoses and notes of its report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from dhkit.description import Description
from dhkit.grading.answers.given import Given
from dhkit.grading.capitals import capitalised
from dhkit.grading.judging.inverse import BranchJudgement, judge_inverse
from dhkit.grading.judging.tables import table_entries
from dhkit.grading.report import Diagnosis, Entry, Note, Verdict, Witness

__all__ = ["KinematicEntries", "inverse_entries", "table_entries"]

INVERSE_HINT = "Look again at this branch: in which quadrant is the angle, and where is it counted from?"


@dataclass(frozen=True)
class KinematicEntries:
    """What a table or formulas add to a report."""

    entries: tuple[Entry, ...]
    diagnosis: tuple[Diagnosis, ...] = ()
    notes: tuple[Note, ...] = ()
    judged_at: Mapping[str, float] = field(default_factory=dict)


def inverse_entries(description: Description, branches: Sequence[Sequence[Given]], seed: int = 0) -> KinematicEntries:
    """Judge formulas of inverse kinematics, a branch an entry.

    Raises
    ------
    AnswerError
        A formula with a name that is not known yet.
    """
    unreadable = _unreadable("ik", branches)
    if unreadable:
        return unreadable
    judgement = judge_inverse(
        description, [[e.tree for e in branch if e.tree is not None] for branch in branches], seed=seed
    )
    entries, diagnosis = [], []
    for k, (branch, given) in enumerate(zip(judgement.branches, branches, strict=True)):
        entry = Entry(
            "ik", (k,), branch.verdict, _row_text(given), statement=_statement(branch), witness=_witness(branch)
        )
        entries.append(entry)
        for explanation in branch.explanations:
            where = f"ik, branch {k + 1}" + ("" if explanation.joint is None else f", q{explanation.joint + 1}")
            sentence = _sentence(explanation.sentence)
            diagnosis.append(Diagnosis(explanation.mistake, sentence, where, (entry.name,), INVERSE_HINT))
    return KinematicEntries(tuple(entries), tuple(diagnosis), judgement.notes)


def _statement(branch: BranchJudgement) -> str:
    said = branch.statement
    return f"{said} to 1e-9; tried, not proved" if branch.verdict is Verdict.CORRECT else said


def _witness(branch: BranchJudgement) -> Witness | None:
    """Return a pose that is not reached, with the first joint value that is wrong."""
    if branch.witness is None:
        return None
    joint = branch.joint or 0
    return Witness(branch.witness.pose, branch.witness.answer[joint], branch.witness.truth[joint])


def _row_text(row: Sequence[Given]) -> str:
    return ", ".join(entry.text for entry in row)


def _sentence(text: str) -> str:
    return capitalised(f"{text.rstrip('.')}.")


def _unreadable(name: str, rows: Sequence[Sequence[Given]]) -> KinematicEntries | None:
    """Return entries of which some cannot be read, so that none is judged; nothing where all can."""
    if all(entry.tree is not None for row in rows for entry in row):
        return None
    entries = []
    for i, row in enumerate(rows):
        error = next((entry.error for entry in row if entry.error), "another row cannot be read")
        entries.append(Entry(name, (i,), Verdict.UNREADABLE, _row_text(row), statement=error))
    return KinematicEntries(tuple(entries))
