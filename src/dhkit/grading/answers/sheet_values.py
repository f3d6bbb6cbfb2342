"""Answer sheets as values: the answers of a student, meanings of names, and requirements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Refusal:
    """Stands instead of a text that a program or a document assigns and that is not to be judged.

    Attributes
    ----------
    reason
        Why it is not judged, with the line.
    advice
        Advice to the student; empty if the reason says it.
    """

    reason: str
    advice: str = "files are read, not run: state it in one formula, or on a sheet, or have it executed (--execute)"


@dataclass(frozen=True)
class EqualFormulas:
    """The formulas of one statement ``V = a = b``: the last is the answer, and those before it must equal it.

    Attributes
    ----------
    formulas
        As they were typed, two or more.
    """

    formulas: tuple[str, ...]


@dataclass(frozen=True)
class Entries:
    """A quantity that was given entry by entry, perhaps not all of them.

    Attributes
    ----------
    texts
        Text, :class:`EqualFormulas` or :class:`Refusal` by index, from 0.
    """

    texts: Mapping[tuple[int, ...], str | EqualFormulas | Refusal]


@dataclass(frozen=True)
class Names:
    """Meanings of a student's names.

    Attributes
    ----------
    q, qd, qdd
        Names of the joint variables, their rates and accelerations; the usual ones where empty.
    absolute
        Whether angles count from a fixed direction rather than from the link before.
    parameters
        The student's further names, each as text in the robot's parameters and in the names before it.
    state
        Joint variables and rates in the order of a state vector x, such as q and qd.
    lenient
        Whether a further name may be unreadable, and replaces any other meaning: names that a program defines.
    """

    q: tuple[str, ...] = ()
    qd: tuple[str, ...] = ()
    qdd: tuple[str, ...] = ()
    absolute: bool = False
    parameters: Mapping[str, str | Refusal] = field(default_factory=dict)
    state: tuple[str, ...] = ()
    lenient: bool = False


NO_NAMES = Names()


@dataclass(frozen=True)
class Requirements:
    """Requirements of the instructor where there is a choice: the table ``[task]``.

    Attributes
    ----------
    friction
        Whether tau includes viscous friction.
    total_derivative
        Whether L is right up to the total derivative of a function of q and t.
    asked
        Quantities that were assigned; a sheet without one of them is incomplete. Empty: the quantities on the sheet.
    proof_required
        Whether answers that are not proved do not pass (``proof = "required"``).
    frames_given
        Whether a table must have the file's own frames (``frames = "given"``).
    zero_given
        Whether a table's joint variables must be zero in the file's own zero pose (``zero = "given"``).
    in_letters
        Whether answers in numbers do not pass, though they are right at the file's values (``values = false``).
    may_execute
        Whether programs may be executed where a person asks for it (``execute = true``); without a task they may.
    packages
        Packages that programs may import when they are executed (``packages``); empty for the usual ones.
    jacobian_rows
        Rows of the Jacobian that are asked for, from 0, in their order (``J_rows``); empty if the answer decides.
    """

    friction: bool = False
    total_derivative: bool = False
    asked: tuple[str, ...] = ()
    proof_required: bool = False
    frames_given: bool = False
    zero_given: bool = False
    in_letters: bool = False
    jacobian_rows: tuple[int, ...] = ()
    may_execute: bool = False
    packages: tuple[str, ...] = ()


@dataclass(frozen=True)
class InverseStep:
    """A step of inverse kinematics on a sheet.

    Attributes
    ----------
    joint
        The joint that it finds, from 1.
    equations
        Equations as text, with one equals sign each.
    solutions
        Formulas of the joint's value as text, in joints of earlier steps: one, or one for each root.
    """

    joint: int
    equations: tuple[str, ...]
    solutions: tuple[str, ...]


@dataclass(frozen=True)
class AnswerSheet:
    """Answers that were handed in, as text.

    Attributes
    ----------
    robot
        A library name, or a path inside the sheet's folder; empty where the caller knows the robot.
    names, task
        Meanings of names, and requirements.
    answers
        Text, or lists of text, by quantity.
    table
        Convention and rows (theta, d, a, alpha) of a table; None without one.
    branches
        Formulas of inverse kinematics, n for each branch.
    rubric
        How points are given; the instructor's own file comes first.
    student
        Student's name; empty if unknown.
    file
        File name with which messages begin.
    notes
        Remarks on how a program or a document was read, each with its line.
    left_out
        Statements that were not read as answers, each with its line.
    variants
        A task's table of variants, as it was typed.
    """

    robot: str = ""
    names: Names = field(default=Names())
    task: Requirements = field(default=Requirements())
    answers: Mapping[str, object] = field(default_factory=dict)
    table: tuple[str, tuple[tuple[str, ...], ...]] | None = None
    branches: tuple[tuple[str, ...], ...] = ()
    steps: tuple[InverseStep, ...] = ()
    rubric: Mapping[str, object] = field(default_factory=dict)
    student: str = ""
    file: str = "answers"
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    variants: Mapping[str, object] = field(default_factory=dict)
