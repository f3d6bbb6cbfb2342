"""What judges of tables and of inverse kinematics return, in the report's own terms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from dhkit.grading.answers.given import Given
from dhkit.grading.report import Diagnosis, Entry, Note, Verdict


@dataclass(frozen=True)
class KinematicJudgement:
    """What is decided of a table, or of formulas of inverse kinematics.

    Attributes
    ----------
    entries
        One a row of the table, or one a branch.
    diagnosis
        What went wrong, row by row or branch by branch.
    notes
        What a reader should know beside the verdicts.
    judged_at
        Values of the parameters that the answer holds as numbers.
    """

    entries: tuple[Entry, ...]
    diagnosis: tuple[Diagnosis, ...] = ()
    notes: tuple[Note, ...] = ()
    judged_at: Mapping[str, float] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """The worst of the entries."""
        return max((entry.verdict for entry in self.entries), key=lambda verdict: verdict.severity)


def with_texts(entries: Sequence[Entry], rows: Sequence[Sequence[Given]]) -> tuple[Entry, ...]:
    """Return entries with the text that was handed in, those of a row joined by commas."""
    return tuple(replace(entry, answer=_text(row)) for entry, row in zip(entries, rows, strict=True))


def unreadable_entries(name: str, rows: Sequence[Sequence[Given]]) -> tuple[Entry, ...]:
    """Return entries of rows of which some cannot be read, so that none is judged; empty where all can be."""
    if all(entry.tree is not None for row in rows for entry in row):
        return ()
    errors = (
        next((entry.error for entry in row if entry.error), "not judged: another row cannot be read") for row in rows
    )
    return tuple(
        Entry(name, (i,), Verdict.UNREADABLE, _text(row), statement=error)
        for i, (row, error) in enumerate(zip(rows, errors, strict=True))
    )


def _text(row: Sequence[Given]) -> str:
    return ", ".join(entry.text for entry in row)
