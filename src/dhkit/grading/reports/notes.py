"""Notes of a report as sentences, one for each kind of note."""

from __future__ import annotations

from collections.abc import Mapping

from dhkit.grading.remarks import Note, NoteKind

_AGREEMENT = {
    "M": "the matrix of second derivatives of the sheet's own {} by the rates",
    "C": "what the sheet's own {} gives: C qd = dM/dt qd - dK/dq",
    "h": "what the sheet's own {} gives: h = dM/dt qd - dK/dq",
    "g": "the gradient of the sheet's own {}",
    "tau": "what the sheet's own {} give",
    "L": "the difference of energies, with the sheet's own {}",
    "T": "the product of the transforms, with the sheet's own {}",
    "J": "the Jacobian of the sheet's own {}",
}
"""Derivation of a quantity from other quantities of the sheet, whose names replace ``{}``."""

SENTENCES: Mapping[NoteKind, str] = {
    NoteKind.AGREES: "{quantity} is {agreement}",
    NoteKind.DISAGREES: "{quantity} is not {agreement}",
    NoteKind.ONLY_AT_VALUES: "{quantity}: right at the file's values alone, by chance; judged at other ones: {values}",
    NoteKind.NUMBERS: "{quantity}: judged at the file's numbers: {values}",
    NoteKind.SIDES_DIFFER: "{quantity}: the sides of its chain of equations differ; the last one is judged",
    NoteKind.SIDES_UNREAD: "{quantity}: a side of its chain of equations could not be read; the last one is judged",
    NoteKind.CHRISTOFFEL: "C: judged by C qd; it is the one of the Christoffel symbols, so dM/dt - 2 C is "
    "skew-symmetric",
    NoteKind.SKEW: "C: judged by C qd; it is another valid factorization than that of the Christoffel symbols, and "
    "dM/dt - 2 C is skew-symmetric",
    NoteKind.NOT_SKEW: "C: judged by C qd; it is another valid factorization than that of the Christoffel symbols, and "
    "dM/dt - 2 C is not skew-symmetric, which some controllers need",
    NoteKind.BY_TORQUES: "C: judged by C qd",
    NoteKind.TAKEN_FOR: "{first!r} was read as {second}",
    NoteKind.UP_TO_A_CONSTANT: "V and L count from any zero: {quantity} is right up to a constant",
    NoteKind.NOT_EXPLAINED: "not explained, since an answer is too long: {values}",
    NoteKind.OTHER_CONVENTION: "{quantity}: the file's table is {first}: held against it in the {second} convention; "
    "base and tool take up what is left over at the ends",
    NoteKind.RIGHT_IN_OTHER_FRAMES: "{quantity}: it would be right for the same arm in other frames than the file's",
    NoteKind.ASKED_FOR: "{quantity}: asked for what the arm can meet: {values}",
    NoteKind.POSITIONS_ONLY: "{quantity}: asked for positions alone, which determine the joints of this arm",
    NoteKind.NO_CLOSED_FORM: "{quantity}: no closed form of ours for this arm: how many solutions there are is open",
    NoteKind.TABLE_ANGLES: "{quantity}: angles are read as the table's theta, joint value plus offset, as the worked "
    "solution writes them",
    NoteKind.STEP_REMARK: "{quantity}: {first}",
    NoteKind.ROOTS_MISSING: "{quantity}: gives {first} of the {second} values that the joint has in general",
    NoteKind.SOLUTIONS_MISSING: "{quantity}: the branches give {first} of the {second} solutions that the arm has in "
    "general",
    NoteKind.PROGRAM: "{values}",
    NoteKind.LAB_WORK: "work began at {first}; time of the last goal: {second}",
    NoteKind.SIGNED: "the name typed in the lab is {first!r}, which is not the student's",
}


def note_text(note: Note) -> str:
    """Return the sentence of a note, whatever names and texts it contains.

    Examples
    --------
    >>> note_text(Note(NoteKind.DISAGREES, "g", ("V",)))
    "g is not the gradient of the sheet's own V"
    """
    values = ", ".join(note.values)
    first, second, *_ = (*note.values, "", "")
    agreement = _AGREEMENT.get(note.quantity, "what the sheet's own {} give").format(values)
    return SENTENCES[note.kind].format(
        quantity=note.quantity, values=values, first=first, second=second, agreement=agreement
    )
