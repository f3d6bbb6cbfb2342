"""Notes: every kind has a sentence, whatever a stranger's report puts into it."""

import pytest
from hypothesis import given, strategies as st

from dhkit.grading.grade_report import GradeReport
from dhkit.grading.remarks import Note, NoteKind
from dhkit.grading.reports import report_of
from dhkit.grading.reports.notes import SENTENCES, note_text

texts = st.text(max_size=12)
notes = st.builds(Note, st.sampled_from(NoteKind), texts, st.lists(texts, max_size=3).map(tuple))


def test_every_kind_has_a_sentence():
    assert set(SENTENCES) == set(NoteKind)


@given(notes)
def test_any_note_is_told(note):
    assert isinstance(note_text(note), str)


@given(st.lists(notes, max_size=3).map(tuple))
def test_notes_are_data(listed):
    report = GradeReport("planar2r", notes=listed)
    assert GradeReport.from_data(report.data()) == report
    assert report_of(report.to_json()) == report


@pytest.mark.parametrize(
    ("note", "sentence"),
    [
        (Note(NoteKind.AGREES, "tau", ("M", "h", "g")), "tau is what the sheet's own M, h, g give"),
        (Note(NoteKind.DISAGREES, "J", ("T",)), "J is not the Jacobian of the sheet's own T"),
        (
            Note(NoteKind.NUMBERS, "M", ("l1 = 0.5", "l2 = 0.4")),
            "M: judged at the file's numbers: l1 = 0.5, l2 = 0.4",
        ),
        (Note(NoteKind.TAKEN_FOR, values=("L_1", "l1")), "'L_1' was read as l1"),
        (
            Note(NoteKind.UP_TO_A_CONSTANT, "V"),
            "V and L count from any zero: V is right up to a constant",
        ),
        (
            Note(NoteKind.SOLUTIONS_MISSING, "ik", ("3", "8")),
            "ik: the branches give 3 of the 8 solutions that the arm has in general",
        ),
        (
            Note(NoteKind.PROGRAM, values=("line 3: Mass is read as M",)),
            "line 3: Mass is read as M",
        ),
    ],
)
def test_what_notes_say(note, sentence):
    assert note_text(note) == sentence
