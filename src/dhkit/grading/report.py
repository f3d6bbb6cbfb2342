"""What a judgement says: verdicts entry by entry, and which mistakes would give these answers; plain data."""

from __future__ import annotations

import json as jsons
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

from dhkit.display import counted, html_block, html_lines, html_table, plain, repr_line

MOST_NAMED = 6
LONGEST_SHOWN = 400
"""Characters of an answer, and of what is said about it, that a notebook shows."""


class Verdict(Enum):
    """What is decided of an entry, or of a sheet; the worst last."""

    CORRECT = "correct"
    ROUNDED = "correct within rounding"
    UNDECIDED = "undecided"
    INCOMPLETE = "incomplete"
    WRONG = "wrong"
    UNREADABLE = "unreadable"

    @property
    def severity(self) -> int:
        """How bad it is, from 0."""
        return list(Verdict).index(self)

    @property
    def passes(self) -> bool:
        """Whether nothing was found wrong."""
        return self.severity <= Verdict.UNDECIDED.severity


@dataclass(frozen=True)
class Witness:
    """A state in which an answer and the truth differ, SI and radians.

    Attributes
    ----------
    state
        Values by name: q1, qd1, parameters, or px ... r33 for inverse kinematics.
    answer, truth
        What each gives there; None where the answer has no value.
    """

    state: Mapping[str, float]
    answer: float | None
    truth: float | None

    def __repr__(self) -> str:
        answer, truth = ("no value" if value is None else f"{value:.6g}" for value in (self.answer, self.truth))
        state = ", ".join(f"{name} = {value:.4g}" for name, value in self.state.items())
        return repr_line("Witness", said=f"answer {answer}, truth {truth}{f' at {state}' if state else ''}")


@dataclass(frozen=True)
class Entry:
    """The judgement of one entry of a quantity.

    Attributes
    ----------
    quantity
        M, C, h, g, tau, K, V, L, A1 ... An, T, J, dh or ik.
    index
        Where it stands, from 0; empty for a number such as K.
    verdict
        What is decided of it.
    answer
        The text as it was handed in.
    latex
        The answer as it was read, in LaTeX, names in the robot's own; empty where it could not be read, or is too long.
    statement
        Why the verdict holds, in a line: proved, sampled, within which rounding.
    difference
        The answer less the truth, as text, where it is wrong; None where it cannot be written.
    difference_latex
        The same in LaTeX; empty without one.
    witness
        A state in which both differ, where it is wrong.
    follows
        Which earlier answers of the same sheet this follows from: right in itself, wrong because they are.
    read
        The answer as it was read, as plain text in the robot's own names; empty where ``latex`` is.
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
        """The entry as people write it, counted from 1: M12, g1, K."""
        return self.quantity + ("_" if any(k > 8 for k in self.index) else "").join(str(k + 1) for k in self.index)

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
            "witness": "" if self.witness is None else repr(self.witness)[1:-1].removeprefix("Witness: "),
        }
        rows = [(name, text) for name, text in texts.items() if text]
        return html_block(f"{self.name}: {self.verdict.value}", html_table((), rows, longest=LONGEST_SHOWN))


@dataclass(frozen=True)
class Diagnosis:
    """A mistake that gives exactly these answers, or what the terms show where none does.

    Attributes
    ----------
    mistake
        A stable name; None where only terms are described.
    sentence
        What a student learns from it.
    where
        The quantity and, where it is one alone, the link: ``g, link 2``.
    entries
        Names of the wrong entries that it explains.
    hint
        Where to look, without saying what is wrong.
    equivalent
        Other mistakes of the library that give the same answers.
    """

    mistake: str | None
    sentence: str
    where: str
    entries: tuple[str, ...] = ()
    hint: str = ""
    equivalent: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """The entries in a few words, for messages."""
        if len(self.entries) > MOST_NAMED:
            return f"{', '.join(self.entries[: MOST_NAMED - 1])} and {len(self.entries) - MOST_NAMED + 1} more"
        return ", ".join(self.entries) or self.where

    def __repr__(self) -> str:
        return repr_line("Diagnosis", self.place, self.sentence)


class NoteKind(Enum):
    """What a note is about; :func:`dhkit.grading.reports.notes.note_text` puts it into words."""

    AGREES = "agrees"
    """A quantity is what the sheet's own quantities ``values`` give, right or wrong."""
    DISAGREES = "disagrees"
    """A quantity is not what the sheet's own quantities ``values`` give."""
    NUMBERS = "numbers"
    """A quantity holds parameters as numbers: ``values`` has a text such as ``l2 = 0.4`` for each."""
    SIDES_DIFFER = "sides_differ"
    """The sides of an entry's chain of equations differ; the last one is judged."""
    SIDES_UNREAD = "sides_unread"
    """A side of an entry's chain of equations before the last could not be read, and was not held against it."""
    CHRISTOFFEL = "christoffel"
    """C is the factorization of the Christoffel symbols."""
    SKEW = "skew"
    """C is another factorization, for which dM/dt - 2 C is skew-symmetric."""
    NOT_SKEW = "not_skew"
    """C is another factorization, for which dM/dt - 2 C is not skew-symmetric."""
    BY_TORQUES = "by_torques"
    """C is judged by C qd alone: which factorization it is could not be decided."""
    TAKEN_FOR = "taken_for"
    """The name ``values[0]`` was read as ``values[1]``."""
    UP_TO_A_CONSTANT = "up_to_a_constant"
    """An energy is right up to a constant."""
    NOT_EXPLAINED = "not_explained"
    """Mistakes were not looked for, since an answer is too long; ``values`` has the limit that it breaks."""
    OTHER_CONVENTION = "other_convention"
    """The file's table is in the convention ``values[0]``, and the answer in ``values[1]``."""
    RIGHT_IN_OTHER_FRAMES = "right_in_other_frames"
    """A table with a slip would be right for the same arm in other frames than the file's."""
    ASKED_FOR = "asked_for"
    """Inverse kinematics are asked for the parts ``values`` of the pose, which the arm can meet."""
    POSITIONS_ONLY = "positions_only"
    """Inverse kinematics of an arm without a closed form of ours are asked for positions alone."""
    NO_CLOSED_FORM = "no_closed_form"
    """How many solutions there are is open: the arm has no closed form of ours."""
    SOLUTIONS_MISSING = "solutions_missing"
    """The branches give ``values[0]`` of the ``values[1]`` solutions that the arm has in general."""
    PROGRAM = "program"
    """How a program or paper was read: ``values`` has the reader's text, with its line."""


@dataclass(frozen=True)
class Note:
    """What a reader should know beside the verdicts, as data.

    Attributes
    ----------
    kind
        What it is about.
    quantity
        The quantity or entry that it concerns; empty if it is the sheet.
    values
        Names, numbers and texts that the kind tells of.
    """

    kind: NoteKind
    quantity: str = ""
    values: tuple[str, ...] = ()

    def __repr__(self) -> str:
        about = f" about {self.quantity}" if self.quantity else ""
        return repr_line(f"Note {self.kind.value}{about}", said=", ".join(self.values))


@dataclass(frozen=True)
class GradeReport:
    """What is decided of an answer sheet.

    Attributes
    ----------
    robot
        The robot's name.
    digest
        Of the robot as data: two reports with one digest judged by the same truth.
    version
        Of dhkit.
    entries
        One an entry, in the order of the sheet.
    diagnosis
        What went wrong, quantity by quantity.
    notes
        What a reader should know: numbers taken from the file, a different valid factorization, conventions.
    sheet
        The file, or what else it was; None for answers of the Python API.
    student
        Student's name; empty if unknown.
    error
        Why the sheet could not be judged; empty where it was.
    seconds
        How long it took.
    left_out
        Statements and files of the student's that were not read as answers.
    judged_at
        Parameters that the answers hold as numbers: what is right is right at these values alone, the file's.
    seed
        Seed of the random states that answers outside the exact ring were tried at; None where the sheet was not
        judged.
    proof_required
        Whether the task asks for proof: what is undecided then does not pass.
    own_robot
        Whether the sheet itself names the robot that it was judged by.

    Examples
    --------
    >>> from dhkit.grading.report import Entry, GradeReport, Verdict
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
    judged_at: Mapping[str, float] = field(default_factory=dict)
    seed: int | None = field(default=None, compare=False)
    proof_required: bool = False
    own_robot: bool = False

    @property
    def verdict(self) -> Verdict:
        """The worst of the entries."""
        if self.error or not self.entries:
            return Verdict.UNREADABLE
        return max((entry.verdict for entry in self.entries), key=lambda verdict: verdict.severity)

    def __bool__(self) -> bool:
        """Whether the sheet passes: nothing is wrong, missing or unread, and all is proved where that is asked for."""
        return self.verdict.passes and not (self.proof_required and self.verdict is Verdict.UNDECIDED)

    @property
    def conclusion(self) -> str:
        """The verdict in words, with the parameter values at which it holds and what it lacks to pass."""
        said = self.verdict.value
        if self.judged_at:
            said += f", judged at {', '.join(f'{name} = {value:g}' for name, value in self.judged_at.items())}"
        if self.proof_required and self.verdict is Verdict.UNDECIDED:
            said += ", and a proof is asked for"
        return said

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the entries and quantities that were begun or asked for, and are not on the sheet."""
        return tuple(entry.name for entry in self.entries if entry.verdict is Verdict.INCOMPLETE)

    @property
    def fault(self) -> str:
        """Why the sheet, or its first entry that could not be read, was not judged; empty where all was."""
        unread = (entry for entry in self.entries if entry.verdict is Verdict.UNREADABLE)
        return self.error or next((f"{entry.name}: {entry.statement}" for entry in unread), "")

    def __str__(self) -> str:
        """Return the verdict, what is wrong, and why, in a few lines."""
        if self.error:
            return f"{self.robot or self.sheet}: unreadable: {self.error}"
        failed = [
            entry.name for entry in self.entries if not entry.verdict.passes and entry.verdict is not Verdict.INCOMPLETE
        ]
        head = f"{self.robot}: {self.conclusion}" + (f": {', '.join(failed)}" if failed else "")
        lines = [f"  {found.place}: {found.sentence}" for found in self.diagnosis]
        lines += [f"  missing: {', '.join(self.missing)}"] if self.missing else []
        return "\n".join([head, *lines])

    @property
    def quantities(self) -> tuple[str, ...]:
        """Which quantities were judged, in the order of the sheet."""
        return tuple(dict.fromkeys(entry.quantity for entry in self.entries))

    def of(self, quantity: str) -> tuple[Entry, ...]:
        """Return a quantity's entries."""
        return tuple(entry for entry in self.entries if entry.quantity == quantity)

    def data(self) -> dict[str, Any]:
        """Return everything as plain data, which :meth:`from_data` reads back."""
        data = asdict(self)
        for entry, own in zip(data["entries"], self.entries, strict=True):
            entry["verdict"] = own.verdict.value
        for note, own_note in zip(data["notes"], self.notes, strict=True):
            note["kind"] = own_note.kind.value
        return data

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> GradeReport:
        """Return the report that :meth:`data` was made of, by way of JSON perhaps.

        Raises
        ------
        KeyError, TypeError, ValueError
            Other data.
        """
        entries = tuple(
            Entry(
                **{
                    **entry,
                    "index": tuple(entry["index"]),
                    "verdict": Verdict(entry["verdict"]),
                    "witness": Witness(**entry["witness"]) if entry["witness"] else None,
                }
            )
            for entry in data["entries"]
        )
        diagnosis = tuple(
            Diagnosis(**{**found, "entries": tuple(found["entries"]), "equivalent": tuple(found["equivalent"])})
            for found in data["diagnosis"]
        )
        notes = tuple(Note(NoteKind(note["kind"]), note["quantity"], tuple(note["values"])) for note in data["notes"])
        listed = {"notes": notes, "left_out": tuple(data["left_out"])}
        return cls(**{**data, "entries": entries, "diagnosis": diagnosis, **listed})

    def to_json(self) -> str:
        """Return :meth:`data` as JSON."""
        return jsons.dumps(self.data(), ensure_ascii=False, allow_nan=False)

    def __repr__(self) -> str:
        return repr_line("GradeReport", self.robot or self.sheet or "", self._said)

    def _repr_html_(self) -> str:
        whose = " by ".join(filter(None, (self.robot or self.sheet, self.student)))
        # The worst first: a table shows so many.
        entries = sorted(self.entries, key=lambda entry: -entry.verdict.severity)
        rows = [(entry.name, entry.verdict.value, entry.answer, entry.statement) for entry in entries]
        table = html_table(("entry", "verdict", "answer", "why"), rows) if rows else ""
        lines = [f"{found.place}: {found.sentence}" for found in self.diagnosis]
        lines += [f"missing: {', '.join(self.missing)}"] if self.missing else []
        return html_block(f"{whose}: {self._said}", table, html_lines(lines))

    @property
    def _said(self) -> str:
        """The conclusion, and how many entries pass."""
        if self.error:
            return f"unreadable: {self.error}"
        passed = sum(entry.verdict.passes for entry in self.entries)
        return f"{self.conclusion}, {passed} of {counted(len(self.entries), 'answer')} right"
