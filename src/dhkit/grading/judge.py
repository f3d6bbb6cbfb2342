"""From an answer sheet to a report: everything on it judged, explained and noted."""

from __future__ import annotations

import difflib
import secrets
import time
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from dhkit.description import Description
from dhkit.errors import AnswerError, DescriptionError, DhkitError
from dhkit.grading.answers.given import (
    Given,
    given_branches,
    given_quantity,
    given_rows,
    vocabulary_of,
    with_entries_gathered,
)
from dhkit.grading.answers.quantity_names import QuantityNames
from dhkit.grading.answers.sheet import ALIASES, AnswerSheet, quantity_names, shape_of
from dhkit.grading.answers.typeset import typeset
from dhkit.grading.answers.vocabulary import Vocabulary
from dhkit.grading.judging.consistency import Consistency
from dhkit.grading.judging.findings import Finding
from dhkit.grading.judging.functions import judge_function
from dhkit.grading.judging.kinematic_judgement import KinematicJudgement
from dhkit.grading.judging.quantities import JudgedQuantity, judge_quantity
from dhkit.grading.judging.quotients import OutsideTheRingError, Reading
from dhkit.grading.judging.truth import Truth, truth_of
from dhkit.grading.mistakes.explaining import explain
from dhkit.grading.report import Diagnosis, Entry, GradeReport, Note, NoteKind, Verdict
from dhkit.symbolic import ExactArm
from dhkit.symbolic.ring import RingError


def judge(
    description: Description, sheet: AnswerSheet, digits: int = 4, *, seed: int | None = None, explained: bool = True
) -> GradeReport:
    """Judge everything on a sheet.

    Parameters
    ----------
    description
        The robot.
    sheet
        What was handed in.
    digits
        Significant digits from which a decimal may have been rounded.
    seed
        Of the random states that answers outside the exact ring are tried at; from the system's entropy unless given,
        so that no sheet can be made for the states that are tried. The report has it, for replay.
    explained
        Whether mistakes are looked for; verdicts do not depend on it.

    Raises
    ------
    AnswerError
        Answers of another shape, unknown quantities, names that stand for two things.
    DescriptionError
        The robot has no bodies, and equations of motion were handed in.
    """
    start = time.perf_counter()
    seed = secrets.randbits(53) if seed is None else seed
    truth = truth_of(description, sheet.names.absolute, sheet.task.friction)
    vocabulary = vocabulary_of(description, sheet, truth.coordinates.sums)
    judged, refused = _judged(description, sheet, vocabulary, truth, digits, seed)
    others, refused_others = _kinematic(description, sheet, vocabulary, seed, explained)
    refused |= refused_others
    if refused and not judged and not others:
        raise next(iter(refused.values()))
    if not judged and not others:
        raise AnswerError(f"{sheet.file}: answer: every entry is empty; expected at least one quantity")
    follows, agreement, diagnosis = _explained(truth, judged, digits) if explained else ({}, [], [])
    entries = [
        entry
        for name, quantity in judged.items()
        for entry in _entries(truth.arm(name), quantity, follows.get(name, {}))
    ]
    read = [Note(NoteKind.PROGRAM, values=(text,)) for text in sheet.notes]
    notes = [*read, *_notes(truth, judged, vocabulary), *agreement]
    entries += [Entry(name, (), Verdict.UNREADABLE, statement=str(error)) for name, error in refused.items()]
    judged_at = _judged_at(truth, judged)
    for other in others:
        judged_at |= other.judged_at
        entries += other.entries
        diagnosis += other.diagnosis if explained else ()
        notes += other.notes
    on_sheet = {entry.quantity for entry in entries}
    entries += [
        Entry(name, (), Verdict.INCOMPLETE, statement="asked for, and not on the sheet")
        for name in sheet.task.asked
        if name not in on_sheet
    ]
    return GradeReport(
        description.name,
        description.digest,
        _version(),
        tuple(entries),
        tuple(diagnosis),
        tuple(notes),
        sheet.file,
        sheet.student,
        "",
        time.perf_counter() - start,
        sheet.left_out,
        judged_at,
        seed,
        sheet.task.proof_required,
    )


def _judged_at(truth: Truth, judged: Mapping[str, JudgedQuantity]) -> dict[str, float]:
    """Return the values of the parameters that answers hold as numbers."""
    found: dict[str, float] = {}
    for name, quantity in judged.items():
        values = truth.arm(name).parameters
        found |= {parameter: values[parameter] for parameter in sorted(quantity.numbers)}
    return found


def _explained(
    truth: Truth, judged: Mapping[str, JudgedQuantity], digits: int
) -> tuple[dict[str, dict[tuple[int, ...], str]], list[Note], list[Diagnosis]]:
    """Return what wrong entries follow from, which parts agree or why that is not told, and what went wrong."""
    parts = Consistency(truth, judged)
    try:
        follows = {name: parts.follows(name) for name in parts.judged}
        return follows, parts.notes(), explain(truth, parts.judged, digits, follows)
    except RingError as error:
        return {}, [Note(NoteKind.NOT_EXPLAINED, values=(str(error)[:160],))], []


def _version() -> str:
    try:
        return version("dhkit-robotics")
    except PackageNotFoundError:
        return "unknown"


def _judged(
    description: Description, sheet: AnswerSheet, vocabulary: Vocabulary, truth: Truth, digits: int, seed: int
) -> tuple[dict[str, JudgedQuantity], dict[str, DhkitError]]:
    """Judge a sheet's quantities; return them, and why others could not be: one does not stop the rest."""
    judged: dict[str, JudgedQuantity] = {}
    refused: dict[str, DhkitError] = {}
    names = QuantityNames(description)
    for name, value in with_entries_gathered(sheet.answers, names).items():
        if _is_empty(value):
            continue
        try:
            judged[name] = _judge_one(name, value, names, sheet, vocabulary, truth, digits, seed)
        except AnswerError as error:
            refused[name] = AnswerError(f"{sheet.file}: answer: {error}")
        except DescriptionError as error:
            refused[name] = error
    return judged, refused


def _judge_one(
    name: str,
    value: Any,
    names: QuantityNames,
    sheet: AnswerSheet,
    vocabulary: Vocabulary,
    truth: Truth,
    digits: int,
    seed: int,
) -> JudgedQuantity:
    known = quantity_names(names.n)
    if name not in known:
        meant = ALIASES.get(name) or next(iter(difflib.get_close_matches(name, known, n=1)), "")
        hint = f"did you mean {meant!r}?" if meant else f"expected {', '.join(known)}, dh, ik"
        if name in truth.description.parameters:
            hint = f"it is a parameter of the robot; give all of {meant or 'the quantity'} as a list"
        raise AnswerError(f"unknown quantity {name[:40]!r}; {hint}")
    if callable(value):
        return judge_function(name, value, truth, seed)
    given = given_quantity(name, value, shape_of(name, names.n), vocabulary, names)
    return judge_quantity(name, given, truth, sheet.task, digits, seed)


def _kinematic(
    description: Description, sheet: AnswerSheet, vocabulary: Vocabulary, seed: int, explained: bool
) -> tuple[list[KinematicJudgement], dict[str, DhkitError]]:
    """Judge a sheet's table and formulas of inverse kinematics, as :func:`_judged` does its quantities."""
    n = description.n

    # Imported where they are used: few sheets have them, and they bring all of kinematics along.
    def table() -> KinematicJudgement:
        from dhkit.grading.judging.tables import table_entries

        convention, rows = sheet.table or ("", ())
        return table_entries(description, given_rows(rows, n, vocabulary), convention, sheet.task, seed)

    def inverse() -> KinematicJudgement:
        from dhkit.grading.judging.inverse import inverse_entries

        own = vocabulary_of(description, sheet, inverse=True)
        return inverse_entries(description, given_branches(sheet.branches, n, own), seed, explained=explained)

    found, refused = [], dict[str, DhkitError]()
    for name, judge_it, is_there in (("dh", table, sheet.table), ("ik", inverse, sheet.branches)):
        try:
            found += [judge_it()] if is_there else []
        except AnswerError as error:
            refused[name] = AnswerError(f"{sheet.file}: answer: {error}")
    return found, refused


def _is_empty(value: Any) -> bool:
    """Whether nothing was handed in: a template's entries that stayed empty."""
    if isinstance(value, list):
        return all(map(_is_empty, value))
    return isinstance(value, str) and not value.strip()


def _entries(arm: ExactArm, quantity: JudgedQuantity, follows: Mapping[tuple[int, ...], str]) -> list[Entry]:
    return [_entry(arm, quantity.name, given, quantity.findings[given.index], follows) for given in quantity.given]


def _entry(arm: ExactArm, name: str, given: Given, finding: Finding, follows: Mapping[tuple[int, ...], str]) -> Entry:
    text, latex = typeset(given.tree) if given.tree is not None else ("", "")
    return Entry(
        name,
        given.index,
        finding.verdict,
        given.text,
        latex,
        "missing" if given.is_missing else finding.statement,
        finding.texts[0],
        finding.texts[1],
        finding.witness,
        follows.get(given.index, ""),
        text,
    )


def _notes(truth: Truth, judged: Mapping[str, JudgedQuantity], vocabulary: Vocabulary) -> list[Note]:
    """Return what a reader should know beside verdicts."""
    notes = []
    for name, quantity in judged.items():
        if quantity.numbers:
            values = truth.arm(name).parameters
            listed = tuple(f"{p} = {values[p]:g}" for p in sorted(quantity.numbers))
            notes.append(Note(NoteKind.NUMBERS, name, listed))
        contradictory = (Entry(name, index, Verdict.WRONG).name for index in quantity.contradictions)
        notes += [Note(NoteKind.SIDES_DIFFER, entry) for entry in contradictory]
        unread = (Entry(name, given.index, Verdict.WRONG).name for given in quantity.given if given.is_partly_read)
        notes += [Note(NoteKind.SIDES_UNREAD, entry) for entry in unread]
    if "C" in judged:
        notes += _about_C(truth, judged["C"])
    notes += [Note(NoteKind.TAKEN_FOR, values=(typed, meant)) for typed, meant in vocabulary.taken_for.items()]
    notes += [Note(NoteKind.UP_TO_A_CONSTANT, name) for name in ("V", "L") if _is_shifted(judged.get(name))]
    return notes


def _is_shifted(quantity: JudgedQuantity | None) -> bool:
    if quantity is None or quantity.wrong:
        return False
    answers = quantity.answers
    return answers is not None and not answers[()].numerator_of_difference(quantity.right(())).is_zero


def _about_C(truth: Truth, judged: JudgedQuantity) -> list[Note]:
    """Say which factorization a right C is: C is judged by C qd, which alone is determined."""
    if judged.wrong or any(entry.tree is None for entry in judged.given):
        return []
    lag, coordinates = truth.lagrangian, truth.coordinates
    C = np.empty((lag.n, lag.n), dtype=object)
    reading = Reading(lag.arm.ring)
    try:
        for entry in judged.given:
            element = reading.read(entry.tree).element() if entry.tree else None
            if element is None:
                return [Note(NoteKind.BY_TORQUES, "C")]
            C[entry.index] = element
    except (OutsideTheRingError, AnswerError):
        return [Note(NoteKind.BY_TORQUES, "C")]
    M, right = truth.of("M"), coordinates.in_y("C", lag.C)
    if all(element.is_zero for element in (C - right).flat):
        return [Note(NoteKind.CHRISTOFFEL, "C")]
    rate = np.array([[entry.by_time() for entry in row] for row in M], dtype=object)
    N = rate - 2 * C
    skew = all(element.is_zero for element in (N + N.T).flat)
    return [Note(NoteKind.SKEW if skew else NoteKind.NOT_SKEW, "C")]
