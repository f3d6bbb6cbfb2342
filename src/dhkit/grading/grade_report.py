"""Reports: the verdict on each entry of an answer sheet, and the mistakes that explain it, as plain data."""

from __future__ import annotations

import json as jsons
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import datetime
from enum import Enum
from typing import Annotated

from pydantic import AfterValidator, TypeAdapter

from dhkit.display import counted, html_block, html_lines, html_table, plain, repr_line
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.remarks import Note

NO_STEP = "no step finds"
"""Beginning of the statement of an entry that stands for a joint without a step."""
_MAX_ENTRIES_NAMED = 6
"""Entries that a message names; of more, the rest is counted."""


class Verdict(Enum):
    """Verdict on an entry or a sheet, from best to worst."""

    CORRECT = "correct"
    ROUNDED = "correct within rounding"
    SAMPLED = "agrees at sampled states"
    RECORDED = "taken from the record"
    UNDECIDED = "undecided"
    INCOMPLETE = "incomplete"
    WRONG = "wrong"
    UNREADABLE = "unreadable"

    @property
    def severity(self) -> int:
        """Position in the order from best, 0, to worst."""
        return list(Verdict).index(self)

    @property
    def is_proved(self) -> bool:
        """Whether a verdict that passes was proved: correct, or correct within rounding."""
        return self not in (Verdict.SAMPLED, Verdict.RECORDED, Verdict.UNDECIDED)

    @property
    def passes(self) -> bool:
        """Whether the entry is correct, sampled, taken from a record or undecided: no error was found."""
        return self.severity <= Verdict.UNDECIDED.severity


@dataclass(frozen=True)
class Witness:
    """State at which an answer and the truth differ, in SI units and rad.

    Attributes
    ----------
    state
        Values by name: q1, qd1, parameters; of inverse kinematics the tool's pose px ... r33.
    answer, truth
        Value of each at the state; None if the answer has no value there.
    """

    state: Mapping[str, float]
    answer: float | None
    truth: float | None

    def __repr__(self) -> str:
        answer, truth = (
            "no value" if value is None else f"{value:.6g}" for value in (self.answer, self.truth)
        )
        state = ", ".join(f"{name} = {value:.4g}" for name, value in self.state.items())
        return repr_line(
            "Witness", summary=f"answer {answer}, truth {truth}{f' at {state}' if state else ''}"
        )


@dataclass(frozen=True)
class Entry:
    """Verdict on one entry of a quantity, with its reason.

    Attributes
    ----------
    quantity
        M, C, h, g, tau, K, V, L, A1 ... An, T, J, dh or ik; of a lab's record a goal, such as goal1.2.
    index
        Indices of the entry in the quantity, from 0; empty for a scalar such as K.
    verdict
        Verdict on the entry.
    answer
        Text of the answer as it was handed in.
    latex
        The answer as it was read, in LaTeX and in the robot's own names; empty if it could not be read or is too long.
    statement
        Reason of the verdict in one line: proved, sampled, or within which rounding.
    difference
        The answer less the truth as text, for a wrong entry; None if it cannot be written.
    difference_latex
        The same difference in LaTeX; empty without one.
    witness
        State at which the answer and the truth differ, for a wrong entry.
    follows
        Earlier answers of the same sheet from which this one follows: it is derived correctly from wrong answers.
    read
        The answer as it was read, as plain text in the robot's own names; empty whenever ``latex`` is.
    """

    quantity: str
    index: tuple[int, ...]
    verdict: Verdict
    answer: str = ""
    latex: str = ""
    statement: str = ""
    difference: str | None = None
    difference_latex: str = ""
    witness: Witness | None = None
    follows: str = ""
    read: str = ""

    @property
    def name(self) -> str:
        """Name of the entry with indices from 1, as people write it: M12, g1, K."""
        return entry_name(self.quantity, self.index)

    def __repr__(self) -> str:
        answer = f", {plain(self.answer, 60)}" if self.answer else ""
        return repr_line("Entry", self.name, f"{self.verdict.value}{answer}")

    def _repr_html_(self) -> str:
        texts = {
            "answer": self.answer,
            "read as": self.read,
            "why": self.statement,
            "answer less the truth": self.difference or "",
            "follows from": self.follows,
            "witness": ""
            if self.witness is None
            else repr(self.witness)[1:-1].removeprefix("Witness: "),
        }
        rows = [(name, text) for name, text in texts.items() if text]
        return html_block(
            f"{self.name}: {self.verdict.value}",
            html_table((), rows, longest=BOUNDS.notebook_characters),
        )


def entry_name(quantity: str, index: tuple[int, ...]) -> str:
    """Return the name of an entry, counted from 1: M12, and M1_10 if an index has two digits."""
    numbers = [str(k + 1) for k in index]
    separator = "_" if any(len(number) > 1 for number in numbers) else ""
    return quantity + separator.join(numbers)


def worst_verdict(entries: Iterable[Entry]) -> Verdict | None:
    """Return the worst verdict on some entries; None without entries."""
    return max(
        (entry.verdict for entry in entries), key=lambda verdict: verdict.severity, default=None
    )


@dataclass(frozen=True)
class Diagnosis:
    """Mistake that gives exactly the answers of a sheet, or a description of their terms if no mistake does.

    Attributes
    ----------
    mistake
        Identity of the mistake in the library; None if the terms alone are described.
    sentence
        Explanation for the student.
    where
        The quantity and, if the mistake was made at one link alone, the link: ``g, link 2``.
    entries
        Names of the wrong entries that the mistake explains.
    hint
        Where to look, without naming the mistake.
    equivalent
        Other mistakes of the library that give the same answers.
    second_hint
        Terms that are missing, which give the answer away; empty for other mistakes.
    """

    mistake: str | None
    sentence: str
    where: str
    entries: tuple[str, ...] = ()
    hint: str = ""
    equivalent: tuple[str, ...] = ()
    second_hint: str = ""

    @property
    def place(self) -> str:
        """The entries in a few words, for messages."""
        if len(self.entries) > _MAX_ENTRIES_NAMED:
            named = ", ".join(self.entries[: _MAX_ENTRIES_NAMED - 1])
            return f"{named} and {len(self.entries) - _MAX_ENTRIES_NAMED + 1} more"
        return ", ".join(self.entries) or self.where

    def __repr__(self) -> str:
        return repr_line("Diagnosis", self.place, self.sentence)


@dataclass(frozen=True)
class KinematicJudgement:
    """Part of a report that concerns a Denavit-Hartenberg table, or formulas of inverse kinematics.

    Attributes
    ----------
    entries
        One for each row of the table, or one for each branch.
    diagnosis
        Mistakes, row by row or branch by branch.
    notes
        Remarks that a reader needs besides the verdicts.
    at_values
        Values of the parameters that the answer holds as numbers, SI units and rad.
    """

    entries: tuple[Entry, ...]
    diagnosis: tuple[Diagnosis, ...] = ()
    notes: tuple[Note, ...] = ()
    at_values: Mapping[str, float] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """The worst verdict on an entry."""
        return worst_verdict(self.entries) or Verdict.UNREADABLE


def _time_or_empty(text: str) -> str:
    """Return a time as text; refuse one that is none, or has no zone."""
    if text and datetime.fromisoformat(text).tzinfo is None:
        raise ValueError("a time without a zone")
    return text


@dataclass(frozen=True)
class GradeReport:
    """Result of judging an answer sheet.

    Attributes
    ----------
    robot
        The robot's name.
    digest
        Digest of the robot's description: reports with equal digests were judged by the same truth.
    version
        Version of dhkit.
    entries
        Verdicts entry by entry, in the order of the sheet.
    diagnosis
        Mistakes, quantity by quantity.
    notes
        Remarks that a reader needs: numbers taken from the file, another valid factorization, conventions.
    sheet
        File of the sheet, or another source; None for answers of the Python API.
    student
        Student's name; empty if unknown.
    error
        Why the sheet could not be judged; empty if it was.
    seconds
        Time that judging took, s.
    left_out
        Statements and files of the student's that were not read as answers.
    at_values
        Parameters that the answers hold as numbers, in SI units and rad: verdicts hold at these values, the file's,
        alone.
    seed
        Seed of the random states at which answers outside the exact ring were tried; None if the sheet was not judged.
    proof_required
        Whether the task asks for proof: sampled and undecided entries then do not pass.
    own_robot
        Whether the sheet itself names the robot that it was judged by.
    handed_in
        When the sheet was handed in: ISO 8601 with a zone; empty if nothing says it.
    goals
        Points of each goal of a lab's assignment, by the name of its entry, if the report is about a record of work on
        it; empty for a sheet, whose points the rubric gives.

    Examples
    --------
    >>> from dhkit.grading.grade_report import Entry, GradeReport, Verdict
    >>> report = GradeReport("planar2r", entries=(Entry("V", (), Verdict.CORRECT),))
    >>> report.verdict.value, bool(report)
    ('correct', True)
    """

    robot: str = ""
    digest: str = ""
    version: str = ""
    entries: tuple[Entry, ...] = ()
    diagnosis: tuple[Diagnosis, ...] = ()
    notes: tuple[Note, ...] = ()
    sheet: str | None = None
    student: str = ""
    error: str = ""
    seconds: float = field(default=0.0, compare=False)
    left_out: tuple[str, ...] = ()
    at_values: Mapping[str, float] = field(default_factory=dict)
    seed: int | None = field(default=None, compare=False)
    proof_required: bool = False
    own_robot: bool = False
    handed_in: Annotated[str, AfterValidator(_time_or_empty)] = ""
    goals: Mapping[str, float] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """The worst verdict on an entry; unreadable if the sheet could not be judged."""
        return (None if self.error else worst_verdict(self.entries)) or Verdict.UNREADABLE

    def __bool__(self) -> bool:
        """Whether the sheet passes: nothing is wrong, missing or unread, and all is proved if the task asks for it."""
        return self.verdict.passes and not self._lacks_proof

    @property
    def _lacks_proof(self) -> bool:
        return self.proof_required and not self.verdict.is_proved

    @property
    def is_lab_record(self) -> bool:
        """Whether the report is about the record of work on a lab's assignment."""
        return bool(self.goals)

    @property
    def conclusion(self) -> str:
        """The verdict in words, with the parameter values at which it holds and the reasons for not passing."""
        values = ", ".join(f"{name} = {value:g}" for name, value in self.at_values.items())
        proof = ", and a proof is asked for" if self._lacks_proof else ""
        return f"{self.verdict.value}{f', judged at {values}' if values else ''}{proof}"

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the entries and quantities that were begun or asked for, and are not on the sheet."""
        return tuple(entry.name for entry in self._incomplete if not entry.answer)

    @property
    def missing_text(self) -> str:
        """Missing quantities, by name; of steps of inverse kinematics with the joint that none finds."""
        texts = []
        for entry in self._incomplete:
            if entry.answer:
                continue
            is_step = entry.statement.startswith(NO_STEP)
            texts.append(f"{entry.name} ({entry.statement})" if is_step else entry.name)
        return ", ".join(texts)

    @property
    def unfinished(self) -> tuple[Entry, ...]:
        """Entries on the sheet that are not wrong, but do not answer the question; their statements say why."""
        return tuple(entry for entry in self._incomplete if entry.answer)

    @property
    def _incomplete(self) -> list[Entry]:
        return [entry for entry in self.entries if entry.verdict is Verdict.INCOMPLETE]

    @property
    def fault(self) -> str:
        """Why the sheet, or its first unreadable entry, was not judged; empty if all were judged."""
        unread = (entry for entry in self.entries if entry.verdict is Verdict.UNREADABLE)
        return self.error or next((f"{entry.name}: {entry.statement}" for entry in unread), "")

    def __str__(self) -> str:
        """Return the verdict, the wrong entries and the diagnoses in a few lines."""
        if self.error:
            return f"{self.robot or self.sheet}: unreadable: {self.error}"
        failed = [
            entry.name
            for entry in self.entries
            if not entry.verdict.passes and entry.verdict is not Verdict.INCOMPLETE
        ]
        head = f"{self.robot}: {self.conclusion}" + (f": {', '.join(failed)}" if failed else "")
        return "\n".join([head, *(f"  {line}" for line in self._diagnosis_lines)])

    @property
    def _diagnosis_lines(self) -> list[str]:
        lines = []
        for diagnosis in self.diagnosis:
            lines.append(f"{diagnosis.place}: {diagnosis.sentence}")
            lines += [f"second hint: {diagnosis.second_hint}"] if diagnosis.second_hint else []
        unreadable = [entry for entry in self.entries if entry.verdict is Verdict.UNREADABLE]
        told = (*unreadable, *self.unfinished)
        lines += [f"{entry.name}: {entry.statement}" for entry in told if entry.statement]
        return lines + ([f"missing: {self.missing_text}"] if self.missing else [])

    @property
    def quantities(self) -> tuple[str, ...]:
        """Quantities that were judged, in the order of the sheet."""
        return tuple(dict.fromkeys(entry.quantity for entry in self.entries))

    def of(self, quantity: str) -> tuple[Entry, ...]:
        """Return the entries of a quantity.

        Parameters
        ----------
        quantity
            Quantity, such as ``"M"``.
        """
        return tuple(entry for entry in self.entries if entry.quantity == quantity)

    def data(self) -> dict[str, object]:
        """Return all fields as plain data, which :meth:`from_data` reads back."""

        def with_plain_values(fields: Iterable[tuple[str, object]]) -> dict[str, object]:
            plain = dict(fields)
            for name, value in plain.items():
                if isinstance(value, Enum):
                    plain[name] = value.value
            return plain

        return asdict(self, dict_factory=with_plain_values)

    @classmethod
    def from_data(cls, data: object) -> GradeReport:
        """Return the report that :meth:`data` was made of, by way of JSON perhaps; every field is checked.

        Raises
        ------
        ValueError
            Other data: not a report, or a field of another type.
        """
        return _FORM.validate_python(data)

    def to_json(self) -> str:
        """Return :meth:`data` as JSON.

        Raises
        ------
        ValueError
            A number is not finite.
        """
        return jsons.dumps(self.data(), ensure_ascii=False, allow_nan=False)

    def __repr__(self) -> str:
        return repr_line("GradeReport", self.robot or self.sheet or "", self._summary)

    def _repr_html_(self) -> str:
        title = " by ".join(filter(None, (self.robot or self.sheet, self.student)))
        # The worst first, because the table of a notebook is cut.
        entries = sorted(self.entries, key=lambda entry: -entry.verdict.severity)
        rows = [
            (entry.name, entry.verdict.value, entry.answer, entry.statement) for entry in entries
        ]
        table = html_table(("entry", "verdict", "answer", "why"), rows) if rows else ""
        return html_block(f"{title}: {self._summary}", table, html_lines(self._diagnosis_lines))

    @property
    def _summary(self) -> str:
        """The conclusion, and the number of entries that pass."""
        if self.error:
            return f"unreadable: {self.error}"
        passed = sum(entry.verdict.passes for entry in self.entries)
        return f"{self.conclusion}, {passed} of {counted(len(self.entries), 'answer')} right"


_FORM = TypeAdapter(GradeReport)
"""Checks every field of a report from JSON."""
