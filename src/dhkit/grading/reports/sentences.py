"""Lines of plain text that all forms of a report share, and how much of a report a student is shown.

Answers and file names come from students. Every line returned here passes through :func:`plain`, which makes it one
line of printable characters.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import PurePath

from dhkit import display
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.grade_report import Diagnosis, Entry, GradeReport, Verdict, Witness
from dhkit.grading.marks import Mark, Marks
from dhkit.grading.remarks import NoteKind
from dhkit.grading.reports.notes import note_text
from dhkit.grading.rubric import Feedback

_MOST_REPEATED = 5
"""Students with several sheets who are named one by one; more are counted."""


def plain(text: str, most: int = BOUNDS.shown_characters) -> str:
    """Return text as one line of at most ``most`` printable characters; see :func:`dhkit.display.plain`."""
    return display.plain(text, most)


def points(number: float) -> str:
    """Return a number of points with two decimals at most, without trailing zeros."""
    return f"{number:.2f}".rstrip("0").rstrip(".")


def points_of(mark: Mark | Marks) -> str:
    """Return the points given and the points possible, such as ``2.5 of 10``."""
    return f"{points(mark.points)} of {points(mark.most)}"


def lateness_of(marks: Marks) -> str:
    """Return the points before lateness and how late a sheet is, in parentheses; empty if it is in time."""
    return f" ({points(marks.before)} before; {plain(marks.late)})" if marks.late else ""


def with_feedback(report: GradeReport, level: Feedback) -> GradeReport:
    """Return a report reduced to a level of feedback.

    ``"full"`` shows everything; ``"hint"`` shows verdicts and where to look, without differences, witnesses and names
    of mistakes; ``"verdict"`` shows verdicts alone. A reduced report cannot be marked again: marks come from full
    reports.
    """
    if level == "full":
        return report
    hints = level == "hint"
    diagnosis = (
        Diagnosis(None, one.hint, one.where, one.entries, one.hint)
        for one in report.diagnosis
        if one.hint
    )
    entries = []
    for entry in report.entries:
        shown = replace(entry, difference=None, difference_latex="", witness=None)
        # The statement on a wrong entry may say by how much it is wrong; why one cannot be read gives nothing away.
        is_harmless = entry.verdict.passes or entry.verdict is Verdict.UNREADABLE
        if not (hints and is_harmless):
            shown = replace(shown, statement="")
        entries.append(shown if hints else replace(shown, latex="", follows=""))
    return replace(
        report,
        entries=tuple(entries),
        diagnosis=tuple(dict.fromkeys(diagnosis)) if hints else (),
        notes=report.notes if hints else (),  # notes say which quantities agree with each other
    )


def summary(report: GradeReport, marks: Marks) -> str:
    """Return a sheet's verdict and points in one line, or why the sheet could not be judged."""
    verdict = f"unreadable: {plain(report.error)}" if report.error else plain(report.conclusion)
    return f"{verdict} ({points_of(marks)} points){lateness_of(marks)}"


def fault_of(report: GradeReport) -> str:
    """Return which sheet could not be judged, and why; the sheet is named once, though the error may name it too."""
    error = plain(report.error, 1000)
    sheet = plain(report.sheet or "")
    return error if not sheet or error.startswith(sheet) else f"{sheet}: {error}"


def entry_lines(entry: Entry, mark: Mark) -> Iterator[str]:
    """Yield the lines on one entry: answer, reason of the verdict, difference, witness, origin of the error, points."""
    if entry.answer:
        yield f"answer: {plain(entry.answer)}"
    if entry.statement:
        yield plain(entry.statement)
    if entry.difference is not None:
        yield f"answer less the truth: {plain(entry.difference)}"
    if entry.witness is not None:
        yield witness_sentence(entry.witness)
    if entry.follows:
        yield f"right in itself; follows from {plain(entry.follows)}"
    if mark.rule and mark.rule != entry.verdict.value:
        yield f"points: {plain(mark.rule)}"


def reading_lines(report: GradeReport) -> Iterator[str]:
    """Yield how each entry was read, in the robot's own names, or why it was not read."""
    for entry in report.entries:
        if entry.answer and (entry.read or entry.verdict is Verdict.UNREADABLE):
            meaning = plain(entry.read) if entry.read else f"not read: {plain(entry.statement)}"
            yield f"{plain(entry.name)}: {plain(entry.answer)} was read as {meaning}"


def remark_lines(report: GradeReport) -> Iterator[str]:
    """Yield the sentences besides verdicts: unfinished and missing entries, statements left out, notes."""
    yield from (f"{plain(entry.name)}: {plain(entry.statement)}" for entry in report.unfinished)
    if report.missing:
        yield f"missing: {plain(report.missing_text, 1000)}"
    yield from (f"left out: {plain(line)}" for line in report.left_out)
    yield from (f"note: {plain(note_text(note))}" for note in report.notes)


def witness_sentence(witness: Witness) -> str:
    """Return the state at which an answer and the truth differ, and both values there."""
    state = ", ".join(f"{plain(name, 40)} = {value:.6g}" for name, value in witness.state.items())
    answer, truth = (
        "has no value" if x is None else f"{x:.6g}" for x in (witness.answer, witness.truth)
    )
    return f"{f'at {state}' if state else 'everywhere'}: answer {answer}, truth {truth}"


def diagnosis_lines(report: GradeReport, entry: Entry | None = None) -> Iterator[str]:
    """Yield the diagnoses of a sheet, or those that concern one entry."""
    for one in report.diagnosis:
        if entry is None or entry.name in one.entries:
            yield f"{plain(one.place)}: {plain(one.sentence)}" if one.place else plain(one.sentence)
            if one.second_hint:
                yield f"second hint: {plain(one.second_hint)}"


def provenance(report: GradeReport) -> str:
    """Return the version of dhkit, the robot with its digest, and the seed of the random states."""
    seed = "" if report.seed is None else f", seed {report.seed}"
    return f"dhkit {plain(report.version, 40)}, {plain(report.robot, 80)}, digest {plain(report.digest, 80)}{seed}"


def class_warnings(reports: Sequence[GradeReport]) -> Iterator[str]:
    """Yield what a teacher has to know before reading the marks of a class."""
    yield from _own_robot_warnings(reports)
    yield from _repeated_students(reports)
    for report, other in equal_records(reports):
        yield (
            f"the lab records of {plain(other.student, 60)} and {plain(report.student, 60)} "
            "began and ended at the same seconds"
        )


def equal_records(reports: Sequence[GradeReport]) -> Iterator[tuple[GradeReport, GradeReport]]:
    """Yield each lab record that began and ended when an earlier one of another student did, with that one.

    A file that several students of a group handed in together is one record.
    """
    first: dict[tuple[str, ...], GradeReport] = {}
    for report in reports:
        times = next((note.values for note in report.notes if note.kind is NoteKind.LAB_WORK), ())
        if not all(times) or not times:
            continue
        other = first.setdefault(times, report)
        if other.student != report.student and other.sheet != report.sheet:
            yield report, other


def _own_robot_warnings(reports: Sequence[GradeReport]) -> Iterator[str]:
    """Yield a warning if sheets named the robots they were judged by: a student may choose an easier robot."""
    own = sorted(
        {plain(report.robot, 40) for report in reports if report.own_robot and report.robot}
    )
    if own:
        yield f"each sheet named its own robot ({', '.join(own)}): give the task's by --robot or --task"


def _repeated_students(reports: Sequence[GradeReport]) -> Iterator[str]:
    """Yield a line for each student with several sheets, which says that none of them is preferred."""
    sheets: dict[str, list[str]] = {}
    for report in reports:
        if report.student and not report.is_lab_record:
            sheets.setdefault(report.student, []).append(PurePath(report.sheet or "").name)
    several = {student: names for student, names in sheets.items() if len(names) > 1}
    if len(several) > _MOST_REPEATED:
        yield (
            f"{len(several)} students have several sheets: each is judged and has a row of its own, and none is "
            "preferred (--keep best chooses)"
        )
        return
    for student, names in several.items():
        yield (
            f"{plain(student, 60)} has {len(names)} sheets ({plain(', '.join(names), 200)}): "
            "each is judged and has a row of its own, and none is preferred"
        )


def mistake_counts(reports: Iterable[GradeReport]) -> list[tuple[str, int]]:
    """Return every mistake with the number of sheets that have it, the most frequent first."""
    count = Counter[str]()
    for report in reports:
        count.update({one.mistake for one in report.diagnosis if one.mistake})
    return sorted(count.items(), key=lambda item: (-item[1], item[0]))
