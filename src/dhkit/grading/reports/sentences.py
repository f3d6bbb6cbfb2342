"""The sentences of a report that every form of it shares, as plain lines that are safe to print."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from dhkit.grading.marks import Mark, Marks
from dhkit.grading.report import Entry, GradeReport, Verdict, Witness
from dhkit.grading.reports.notes import note_text
from dhkit.grading.reports.plain import plain, points


def summary(report: GradeReport, marks: Marks) -> str:
    """Return a sheet's verdict and points in a line, or why it could not be judged."""
    verdict = f"unreadable: {plain(report.error)}" if report.error else plain(report.conclusion)
    return f"{verdict} ({points(marks.points)} of {points(marks.most)} points)"


def fault_of(report: GradeReport) -> str:
    """Return which sheet could not be judged, and why; an error may name the sheet itself."""
    error, sheet = plain(report.error, 1000), plain(report.sheet or "")
    return error if not sheet or error.startswith(sheet) else f"{sheet}: {error}"


def told(entry: Entry, mark: Mark) -> Iterator[str]:
    """Yield what is said of an entry: the answer, why the verdict holds, the difference, a state that shows it."""
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


def reading(report: GradeReport) -> Iterator[str]:
    """Yield how each entry was read, in the robot's own names, and what was not read."""
    for entry in report.entries:
        if entry.answer and (entry.read or entry.verdict is Verdict.UNREADABLE):
            was = plain(entry.read) if entry.read else f"not read: {plain(entry.statement)}"
            yield f"{plain(entry.name)}: {plain(entry.answer)} was read as {was}"


def remarks(report: GradeReport) -> Iterator[str]:
    """Yield what a reader should know beside verdicts: what is missing, what was left out, notes."""
    if report.missing:
        yield f"missing: {', '.join(map(plain, report.missing))}"
    yield from (f"left out: {plain(line)}" for line in report.left_out)
    yield from (f"note: {plain(note_text(note))}" for note in report.notes)


def witness_sentence(witness: Witness) -> str:
    """Return in words where an answer and the truth differ."""
    state = ", ".join(f"{plain(name, 40)} = {value:.6g}" for name, value in witness.state.items())
    return f"{f'at {state}' if state else 'everywhere'}: answer {_value(witness.answer)}, truth {_value(witness.truth)}"


def _value(value: float | None) -> str:
    return "has no value" if value is None else f"{value:.6g}"


def found(report: GradeReport, entry: Entry | None = None) -> Iterator[str]:
    """Yield what went wrong, of the sheet or of an entry."""
    for one in report.diagnosis:
        if entry is None or entry.name in one.entries:
            yield f"{plain(one.place)}: {plain(one.sentence)}" if one.place else plain(one.sentence)


def provenance(report: GradeReport) -> str:
    """Return which dhkit judged by which robot, and the seed of its random states."""
    seed = "" if report.seed is None else f", seed {report.seed}"
    return f"dhkit {plain(report.version, 40)}, {plain(report.robot, 80)}, digest {plain(report.digest, 80)}{seed}"


def own_robots(reports: Sequence[GradeReport]) -> Iterator[str]:
    """Yield a warning where sheets named the robots that they were judged by: a student may choose an easier one."""
    own = sorted({plain(report.robot, 40) for report in reports if report.own_robot and report.robot})
    if own:
        yield f"each sheet named its own robot ({', '.join(own)}): give the task's by --robot or --task"


def mistakes_of(reports: Iterable[GradeReport]) -> list[tuple[str, int]]:
    """Return which mistakes were made, and on how many sheets; the most frequent first."""
    count = Counter(
        mistake for report in reports for mistake in {one.mistake for one in report.diagnosis if one.mistake}
    )
    return sorted(count.items(), key=lambda item: (-item[1], item[0]))
