"""Reports to write down and to mark: one with a bit of everything, and any at all."""

from hypothesis import strategies as st

from dhkit.grading.grade_report import Diagnosis, Entry, GradeReport, Verdict, Witness
from dhkit.grading.remarks import Note, NoteKind

SIGN = Diagnosis(
    "gravity_sign", "gravity has the wrong sign", "g", ("g1",), hint="look at the sign of V"
)
REPORT = GradeReport(
    robot="planar2r",
    digest="abc123",
    version="0.1.0",
    entries=(
        Entry("M", (0, 0), Verdict.CORRECT, "m1*l1^2/3", r"\frac{m_1 l_1^2}{3}", "proved"),
        Entry("M", (0, 1), Verdict.ROUNDED, "0.3333", "0.3333", "within rounding"),
        Entry("M", (1, 0), Verdict.UNDECIDED, "atan2(q1, q2)"),
        Entry("M", (1, 1), Verdict.CORRECT, "m2"),
        Entry(
            "g",
            (0,),
            Verdict.WRONG,
            "-m1*g*cos(q1)",
            r"-m_1 g \cos(q_1)",
            "differs by 2*m1*g",
            "-2*m1*g*cos(q1)",
            r"-2 m_1 g \cos(q_1)",
            Witness({"q1": 0.5, "m1": 1.0}, -8.6, 8.6),
        ),
        Entry("g", (1,), Verdict.WRONG, "0", follows="V"),
    ),
    diagnosis=(SIGN,),
    notes=(Note(NoteKind.CHRISTOFFEL, "C"),),
    sheet="class/ada.toml",
    student="ada",
    seconds=0.25,
)

anything = st.text(st.characters(), max_size=12)
readable = st.text(st.characters(codec="utf-8"), max_size=12)


@st.composite
def reports(draw, words=readable):
    """A report whose texts may hold anything."""
    entries = [
        Entry(
            draw(st.sampled_from(("M", "g", "K", "A1"))),
            tuple(draw(st.lists(st.integers(0, 11), max_size=2))),
            draw(st.sampled_from(Verdict)),
            *(draw(words) for _ in range(3)),
            draw(st.none() | words),
            draw(words),
            draw(
                st.none()
                | st.builds(Witness, st.dictionaries(words, numbers, max_size=2), numbers, numbers)
            ),
            draw(words),
        )
        for _ in range(draw(st.integers(0, 4)))
    ]
    names = st.lists(st.sampled_from([entry.name for entry in entries] or ["M11"]), max_size=3).map(
        tuple
    )
    mistake = st.none() | words
    diagnosis = st.builds(Diagnosis, mistake, words, words, names, words, st.tuples(words))
    notes = st.builds(
        Note, st.sampled_from(NoteKind), words, st.lists(words, max_size=3).map(tuple)
    )
    return GradeReport(
        *(draw(words) for _ in range(3)),
        tuple(entries),
        tuple(draw(st.lists(diagnosis, max_size=2))),
        tuple(draw(st.lists(notes, max_size=2))),
        draw(st.none() | words),
        draw(words),
        draw(st.just("") | words),
    )


numbers = st.floats(allow_nan=False, allow_infinity=False)
