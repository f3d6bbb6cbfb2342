"""Remarks that a reader of a report needs besides the verdicts, as data."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from dhkit.display import repr_line


class NoteKind(Enum):
    """Subject of a note; :func:`dhkit.grading.reports.notes.note_text` writes the sentence."""

    ONLY_AT_VALUES = "only_at_values"
    """Formulas are right at the robot file's values of its parameters, and wrong at the ``values``."""
    AGREES = "agrees"
    """A quantity is what the sheet's own quantities ``values`` give, right or wrong."""
    DISAGREES = "disagrees"
    """A quantity is not what the sheet's own quantities ``values`` give."""
    NUMBERS = "numbers"
    """A quantity holds parameters as numbers: ``values`` has a text such as ``l2 = 0.4`` for each."""
    SIDES_DIFFER = "sides_differ"
    """The sides of an entry's chain of equations differ; the last one is judged."""
    SIDES_UNREAD = "sides_unread"
    """A side of an entry's chain of equations before the last could not be read, and was not compared with it."""
    CHRISTOFFEL = "christoffel"
    """C is the factorization of the Christoffel symbols."""
    SKEW = "skew"
    """C is another factorization, for which dM/dt - 2 C is skew-symmetric."""
    NOT_SKEW = "not_skew"
    """C is another factorization, for which dM/dt - 2 C is not skew-symmetric."""
    BY_TORQUES = "by_torques"
    """C is judged by C qd alone: its factorization could not be determined."""
    TAKEN_FOR = "taken_for"
    """The name ``values[0]`` was read as ``values[1]``."""
    UP_TO_A_CONSTANT = "up_to_a_constant"
    """An energy is right up to a constant."""
    NOT_EXPLAINED = "not_explained"
    """Mistakes were not looked for, because an answer is too long; ``values`` has the limit that it exceeds."""
    OTHER_CONVENTION = "other_convention"
    """The file's table is in the convention ``values[0]``, and the answer in ``values[1]``."""
    RIGHT_IN_OTHER_FRAMES = "right_in_other_frames"
    """A table with a slip would be right for the same arm in frames other than the file's."""
    ASKED_FOR = "asked_for"
    """Inverse kinematics are asked for the parts ``values`` of the pose, which the arm can reach."""
    POSITIONS_ONLY = "positions_only"
    """Inverse kinematics of an arm without a closed form in dhkit are asked for positions alone."""
    NO_CLOSED_FORM = "no_closed_form"
    """The number of solutions is unknown: dhkit has no closed form for the arm."""
    SOLUTIONS_MISSING = "solutions_missing"
    """The branches give ``values[0]`` of the ``values[1]`` solutions that the arm has in general."""
    ROOTS_MISSING = "roots_missing"
    """A step gives ``values[0]`` of the ``values[1]`` values that its joint has in general."""
    STEP_REMARK = "step_remark"
    """A step passes; ``values`` has a sentence on a part of it that earns nothing, or on where it holds."""
    TABLE_ANGLES = "table_angles"
    """Angles of steps are read as those of the table, joint values plus offsets: more steps pass so."""
    PROGRAM = "program"
    """Remark on how a program or paper was read: ``values`` has the reader's text, with its line."""
    LAB_WORK = "lab_work"
    """Work on a lab's assignment began at ``values[0]``, and the last goal that counts was reached at ``values[1]``,
    empty if there is none: ISO 8601, UTC."""
    SIGNED = "signed"
    """In the lab the name ``values[0]`` was typed, by which the class does not know the student."""


@dataclass(frozen=True)
class Note:
    """Remark that a reader needs besides the verdicts, as data.

    Attributes
    ----------
    kind
        Subject of the note.
    quantity
        The quantity or entry that it concerns; empty if it concerns the sheet.
    values
        Names, numbers and texts that the sentence contains.
    """

    kind: NoteKind
    quantity: str = ""
    values: tuple[str, ...] = ()

    def __repr__(self) -> str:
        about = f" about {self.quantity}" if self.quantity else ""
        return repr_line(f"Note {self.kind.value}{about}", summary=", ".join(self.values))
