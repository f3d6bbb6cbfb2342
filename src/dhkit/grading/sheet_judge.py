"""Judging of a whole answer sheet: every quantity on it judged, explained and noted in one report."""

from __future__ import annotations

import difflib
import secrets
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from itertools import chain
from typing import NamedTuple, TypeAlias

import numpy as np

from dhkit.description import Description
from dhkit.errors import AnswerError, DescriptionError, DhkitError
from dhkit.expressions.syntax import Name, Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.answers.given import (
    Given,
    given_branches,
    given_quantity,
    given_rows,
    vocabulary_of,
    with_entries_gathered,
)
from dhkit.grading.answers.quantity_names import QuantityNames
from dhkit.grading.answers.sampled import SampledAnswer
from dhkit.grading.answers.sheet import ALIASES, quantity_names, shape_of
from dhkit.grading.answers.sheet_matrices import SheetMatrices
from dhkit.grading.answers.sheet_values import AnswerSheet, Requirements
from dhkit.grading.answers.typeset import typeset, typeset_equations
from dhkit.grading.answers.vocabulary import Vocabulary
from dhkit.grading.grade_report import (
    Diagnosis,
    Entry,
    GradeReport,
    KinematicJudgement,
    Verdict,
    entry_name,
)
from dhkit.grading.judging.consistency import Consistency
from dhkit.grading.judging.functions import judge_function, judge_sampled
from dhkit.grading.judging.quantities import JudgedQuantity, judge_quantity
from dhkit.grading.judging.quotients import RingReader
from dhkit.grading.judging.truth import Truth, truth_of
from dhkit.grading.mistakes.entries import shown_in_student_angles
from dhkit.grading.mistakes.explaining import explain as explain_mistakes
from dhkit.grading.remarks import Note, NoteKind
from dhkit.symbolic.ring import RingError


def judge_sheet(
    description: Description,
    sheet: AnswerSheet,
    digits: int = 4,
    *,
    seed: int | None = None,
    explain: bool = True,
) -> GradeReport:
    """Judge everything on a sheet.

    Parameters
    ----------
    description
        The robot.
    sheet
        The answers, names and task.
    digits
        Significant digits from which a decimal may have been rounded.
    seed
        Seed of the random states at which answers outside the exact ring are tried. By default from the system's
        entropy, so that no sheet can be written for the states that are tried. The report holds it, for replay.
    explain
        Whether to look for mistakes; verdicts do not depend on it.

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
    judge = _SheetJudge(sheet, truth, vocabulary, digits, seed)
    judged, refused = judge.quantities()
    others, other_refused = judge.kinematics(explain)
    refused |= other_refused
    if not judged and not others:
        raise next(
            iter(refused.values()),
            AnswerError(
                f"{sheet.file}: answer: every entry is empty; expected at least one quantity"
            ),
        )
    explanation = _explain(truth, judged, digits) if explain else _Explanation()
    diagnosis = [*explanation.diagnosis]
    entries: list[Entry] = []
    at_values: dict[str, float] = {}
    for name, quantity in judged.items():
        entries += _entries(truth, quantity, explanation.follows.get(name, {}))
        at_values |= _numbers_in(truth, quantity)
    notes = [Note(NoteKind.PROGRAM, values=(text,)) for text in sheet.notes]
    notes += [*_notes(truth, judged, vocabulary), *explanation.notes]
    entries += [
        Entry(name, (), Verdict.UNREADABLE, statement=str(error)) for name, error in refused.items()
    ]
    for other in others:
        at_values |= other.at_values
        entries += other.entries
        diagnosis += other.diagnosis if explain else ()
        notes += other.notes
    on_sheet = {entry.quantity for entry in entries}
    entries += [
        Entry(name, (), Verdict.INCOMPLETE, statement="asked for, and not on the sheet")
        for name in sheet.task.asked
        if name not in on_sheet
    ]
    return GradeReport(
        robot=description.name,
        digest=description.digest,
        version=package_version(),
        entries=tuple(entries),
        diagnosis=tuple(diagnosis),
        notes=tuple(notes),
        sheet=sheet.file,
        student=sheet.student,
        seconds=time.perf_counter() - start,
        left_out=sheet.left_out,
        at_values=at_values,
        seed=seed,
        proof_required=sheet.task.proof_required,
    )


def package_version() -> str:
    """Return dhkit's version as it is installed; unknown where it is run from a folder of sources."""
    try:
        return version("dhkit-robotics")
    except PackageNotFoundError:
        return "unknown"


@dataclass(frozen=True, eq=False)
class _SheetJudge:
    """Judges the quantities of one sheet; ``digits`` and ``seed`` as for :func:`judge_sheet`."""

    sheet: AnswerSheet
    truth: Truth
    vocabulary: Vocabulary
    digits: int
    seed: int

    def quantities(self) -> tuple[dict[str, JudgedQuantity], dict[str, DhkitError]]:
        """Judge the equations and transforms; return them by name, and the errors of those that were refused."""
        judged: dict[str, JudgedQuantity] = {}
        refused: dict[str, DhkitError] = {}
        names = QuantityNames(self.truth.description)
        read: dict[str, tuple[Given, ...]] = {}
        answers = with_entries_gathered(self.sheet.answers, names)
        matrix_of = SheetMatrices(answers, self.vocabulary, names)
        for name, value in answers.items():
            if _is_empty(value):
                continue
            try:
                self._require_known(name, names)
                if isinstance(value, SampledAnswer):
                    judged[name] = judge_sampled(name, value, self.truth, self.seed)
                elif callable(value):
                    judged[name] = judge_function(name, value, self.truth, self.seed)
                elif name == "J":
                    read[name] = self._jacobian(value, names, matrix_of)
                else:
                    shape = shape_of(name, names.n)
                    read[name] = given_quantity(
                        name, value, shape, self.vocabulary, names, matrix_of.without(name)
                    )
            except (AnswerError, DescriptionError) as error:
                refused[name] = self._refusal(error)
        read_entries = chain.from_iterable(read.values())
        trees = [entry.tree for entry in read_entries if entry.tree is not None]
        used = frozenset[str]().union(*map(names_of, trees))
        letters = used & frozenset(self.truth.description.parameters)
        for name, given in read.items():
            try:
                judged[name] = judge_quantity(
                    name,
                    given,
                    self.truth,
                    self.sheet.task,
                    self.digits,
                    self.seed,
                    letters=letters,
                )
            except (AnswerError, DescriptionError) as error:
                refused[name] = self._refusal(error)
        return judged, refused

    def _refusal(self, error: AnswerError | DescriptionError) -> DhkitError:
        """Return the error of an answer with the file in front; that of a robot as it is."""
        if isinstance(error, DescriptionError):
            return error
        return AnswerError(f"{self.sheet.file}: answer: {error}")

    def _jacobian(
        self, value: object, names: QuantityNames, matrix_of: SheetMatrices
    ) -> tuple[Given, ...]:
        """Return the entries of a Jacobian: of the task's rows, of six, or of those that an arm's motion has.

        Of an arm in a plane these are the two positions in it, with the angle about its normal or without; of others
        three rows are those of the position, and four or five those that are not zero.
        """
        asked = self.sheet.task.jacobian_rows
        errors = list[AnswerError]()
        for rows in [asked] if asked else [(0, 1, 2, 3, 4, 5), *self._rows_of_few()]:
            size = (len(rows), names.n)
            try:
                given = given_quantity(
                    "J", value, size, self.vocabulary, names, matrix_of.without("J")
                )
            except AnswerError as error:
                errors.append(error)
                continue
            return tuple(
                replace(entry, index=(rows[entry.index[0]], entry.index[1])) for entry in given
            )
        raise errors[0]

    def _rows_of_few(self) -> list[tuple[int, ...]]:
        """Return the rows, from 0, that a Jacobian of fewer than six has."""
        J = self.truth.of("J")
        is_moving = np.array([not element.is_zero for element in J.flat]).reshape(J.shape)
        moving = np.flatnonzero(is_moving.any(axis=1)).tolist()
        position = tuple(row for row in moving if row < 3)
        is_planar = len(position) == 2 and len(moving) <= 3
        if is_planar:
            return [position, tuple(moving)]
        # A SCARA has the rows vx, vy, vz and wz.
        return [(0, 1, 2), tuple(moving)] if 3 < len(moving) < 6 else [(0, 1, 2)]

    def _require_known(self, name: str, names: QuantityNames) -> None:
        """Refuse a name that is none of a quantity."""
        known = quantity_names(names.n)
        if name not in known:
            meant = ALIASES.get(name) or next(iter(difflib.get_close_matches(name, known, n=1)), "")
            hint = f"did you mean {meant!r}?" if meant else f"expected {', '.join(known)}, dh, ik"
            if name in self.truth.description.parameters:
                hint = f"it is a parameter of the robot; give all of {meant or 'the quantity'} as a list"
            raise AnswerError(f"unknown quantity {name[:40]!r}; {hint}")

    def kinematics(self, explain: bool) -> tuple[list[KinematicJudgement], dict[str, DhkitError]]:
        """Judge the table and the inverse kinematics; return them, and the errors of those that were refused."""
        judged: list[KinematicJudgement] = []
        refused: dict[str, DhkitError] = {}
        for name, is_given in (
            ("dh", self.sheet.table),
            ("ik", self.sheet.branches or self.sheet.steps),
        ):
            if is_given:
                try:
                    judged.append(self._table() if name == "dh" else self._inverse(explain))
                except AnswerError as error:
                    refused[name] = self._refusal(error)
        return judged, refused

    # Tables and inverse kinematics are imported here: few sheets have them, and they import all of kinematics.

    def _table(self) -> KinematicJudgement:
        from dhkit.grading.judging.tables import judge_table

        description = self.truth.description
        convention, rows = self.sheet.table or ("", ())
        return _judge_rows(
            "dh",
            given_rows(rows, description.n, self.vocabulary),
            lambda trees: self._table_in_numbers(
                judge_table(description, trees, convention, self.seed, self.sheet.task)
            ),
        )

    def _table_in_numbers(self, judged: KinematicJudgement) -> KinematicJudgement:
        return _in_numbers(judged, judged.at_values, self.sheet.task)

    def _inverse(self, explain: bool) -> KinematicJudgement:
        from dhkit.grading.judging.inverse import judge_inverse

        description = self.truth.description
        vocabulary = vocabulary_of(description, self.sheet, inverse=True)
        if self.sheet.steps:
            from dhkit.grading.answers.inverse_steps import given_steps
            from dhkit.grading.judging.inverse_steps import judge_steps

            steps = given_steps(self.sheet.steps, vocabulary)
            step_trees: list[Tree] = []
            for step in steps:
                step_trees += [*step.solutions, *chain.from_iterable(step.equations)]

            def judge_changed_steps(
                arm: Description, formula: _Change, explain: bool
            ) -> KinematicJudgement:
                changed = [step.changed(formula) for step in steps]
                return judge_steps(arm, changed, seed=self.seed, explain=explain)

            return self._at_other_values(step_trees, judge_changed_steps, explain)

        def judge_branches(branches: Sequence[Sequence[Tree]]) -> KinematicJudgement:
            def judge_changed_branches(
                arm: Description, formula: _Change, explain: bool
            ) -> KinematicJudgement:
                changed = [list(map(formula, branch)) for branch in branches]
                return judge_inverse(arm, changed, seed=self.seed, explain=explain)

            return self._at_other_values(
                list(chain.from_iterable(branches)), judge_changed_branches, explain
            )

        given = given_branches(self.sheet.branches, description.n, vocabulary)
        return _judge_rows("ik", given, judge_branches)

    def _at_other_values(
        self, trees: Sequence[Tree], judge: _FormulaJudge, explain: bool
    ) -> KinematicJudgement:
        """Judge formulas at the file's values; those that pass at other values of the arm's letters too.

        Where letters have equal values, mistakes are looked for at other values: one would look like another.
        """
        from dhkit.grading.judging.other_values import are_ambiguous, with_other_values

        description = self.truth.description
        is_ambiguous = explain and are_ambiguous(description, trees)
        judged = judge(description, _unchanged, explain and not is_ambiguous)
        other = with_other_values(description, trees, self.seed)
        passing = {entry.index for entry in judged.entries if entry.verdict.passes}
        if other.description is not None and (passing or is_ambiguous):
            elsewhere = judge(other.description, other.formula, explain)
            failing = {
                entry.index: entry for entry in elsewhere.entries if not entry.verdict.passes
            }
            if by_chance := passing & failing.keys():
                values = tuple(f"{name} = {value:.6g}" for name, value in other.changed.items())
                entries = tuple(
                    failing[e.index] if e.index in by_chance else e for e in judged.entries
                )
                notes = (*elsewhere.notes, Note(NoteKind.ONLY_AT_VALUES, "ik", values))
                judged = replace(
                    judged, entries=entries, notes=notes, diagnosis=elsewhere.diagnosis
                )
            elif is_ambiguous:
                judged = replace(judged, diagnosis=elsewhere.diagnosis)
        elif is_ambiguous:
            judged = judge(description, _unchanged, explain)
        return _in_numbers(judged, other.at_values, self.sheet.task)


_Change: TypeAlias = Callable[[Tree], Tree]
"""Change of a formula."""
_FormulaJudge: TypeAlias = Callable[[Description, _Change, bool], KinematicJudgement]
"""Function from an arm, a change of formulas, and whether to look for mistakes, to the judgement of a sheet."""


def _unchanged(tree: Tree) -> Tree:
    return tree


def _in_numbers(
    judged: KinematicJudgement, at_values: Mapping[str, float], task: Requirements
) -> KinematicJudgement:
    """Return a judgement of an answer that has letters as numbers: it is incomplete where the task asks for letters."""
    if not at_values:
        return judged
    entries = judged.entries
    if task.in_letters:
        statement = "right at the file's values; the task asks for letters"
        entries = tuple(_incomplete_if_passing(entry, statement) for entry in entries)
    return replace(judged, entries=entries, at_values=at_values)


def _incomplete_if_passing(entry: Entry, statement: str) -> Entry:
    if not entry.verdict.passes:
        return entry
    return replace(entry, verdict=Verdict.INCOMPLETE, statement=statement)


def _judge_rows(
    name: str,
    rows: Sequence[Sequence[Given]],
    judge: Callable[[Sequence[Sequence[Tree]]], KinematicJudgement],
) -> KinematicJudgement:
    """Judge rows of a table, or branches of inverse kinematics; all are unreadable if an entry cannot be read."""
    texts = []
    trees = []
    errors = []
    for row in rows:
        texts.append(", ".join(entry.text for entry in row))
        trees.append([entry.tree for entry in row if entry.tree is not None])
        errors.append([entry.error for entry in row if entry.error])

    if all(len(read) == len(row) for read, row in zip(trees, rows, strict=True)):
        judgement = judge(trees)
        entries = []
        for entry, text, formulas in zip(judgement.entries, texts, trees, strict=True):
            joints = [(Name(f"q{k + 1}", 0), tree) for k, tree in enumerate(formulas)]
            read, latex = typeset_equations(joints) if name == "ik" else ("", "")
            entries.append(replace(entry, answer=text, read=read, latex=latex))
        return replace(judgement, entries=tuple(entries))

    unreadable = []
    for i, (text, of_row) in enumerate(zip(texts, errors, strict=True)):
        statement = of_row[0] if of_row else "not judged: another row cannot be read"
        unreadable.append(Entry(name, (i,), Verdict.UNREADABLE, text, statement=statement))
    return KinematicJudgement(tuple(unreadable))


class _Explanation(NamedTuple):
    """Reasons of wrong entries of equations and transforms."""

    follows: Mapping[str, Mapping[tuple[int, ...], str]] = {}
    """Wrong answer from which a wrong entry follows, by quantity and index."""
    notes: Sequence[Note] = ()
    """Which quantities agree with each other; that an answer is too long to be explained."""
    diagnosis: Sequence[Diagnosis] = ()
    """Mistakes."""


def _explain(truth: Truth, judged: Mapping[str, JudgedQuantity], digits: int) -> _Explanation:
    """Return the reasons of wrong entries; only a note if an answer is too long for that."""
    consistency = Consistency(truth, judged)
    try:
        follows = {name: consistency.follows(name) for name in judged}
        return _Explanation(
            follows, consistency.notes(), explain_mistakes(truth, judged, digits, follows)
        )
    except RingError as error:
        note = Note(NoteKind.NOT_EXPLAINED, values=(str(error)[:160],))
        return _Explanation(notes=[note])


def _is_empty(value: object) -> bool:
    """Whether nothing was handed in: an entry of a template that stayed empty."""
    if isinstance(value, list):
        return all(map(_is_empty, value))
    return isinstance(value, str) and not value.strip()


def _entries(
    truth: Truth, quantity: JudgedQuantity, follows: Mapping[tuple[int, ...], str]
) -> Iterator[Entry]:
    for given in quantity.given:
        finding = shown_in_student_angles(truth, quantity.name, quantity.findings[given.index])
        text, latex = typeset(given.tree) if given.tree is not None else ("", "")
        yield Entry(
            quantity.name,
            given.index,
            finding.verdict,
            given.text,
            latex,
            "missing" if given.is_missing else finding.statement,
            *finding.texts,
            finding.witness,
            follows.get(given.index, ""),
            text,
        )


def _numbers_in(truth: Truth, quantity: JudgedQuantity) -> dict[str, float]:
    """Return the parameters that an answer holds as numbers, with the file's values, SI units and rad."""
    values = truth.arm(quantity.name).parameters
    return {parameter: values[parameter] for parameter in sorted(quantity.numbers)}


def _notes(
    truth: Truth, judged: Mapping[str, JudgedQuantity], vocabulary: Vocabulary
) -> list[Note]:
    """Return the notes on quantities of equations and transforms."""
    notes = []
    for name, quantity in judged.items():
        if quantity.numbers:
            numbers = tuple(f"{p} = {value:g}" for p, value in _numbers_in(truth, quantity).items())
            notes.append(Note(NoteKind.NUMBERS, name, numbers))
        notes += [
            Note(NoteKind.SIDES_DIFFER, entry_name(name, index))
            for index in quantity.contradictions
        ]
        unread = (entry.index for entry in quantity.given if entry.is_partly_read)
        notes += [Note(NoteKind.SIDES_UNREAD, entry_name(name, index)) for index in unread]
    if "C" in judged and (kind := _factorization(truth, judged["C"])):
        notes.append(Note(kind, "C"))
    notes += [
        Note(NoteKind.TAKEN_FOR, values=(typed, meant))
        for typed, meant in vocabulary.taken_for.items()
    ]
    notes += [
        Note(NoteKind.UP_TO_A_CONSTANT, name)
        for name in ("V", "L")
        if _is_shifted(judged.get(name))
    ]
    return notes


def _is_shifted(energy: JudgedQuantity | None) -> bool:
    """Whether an energy is right and differs from the truth, by a constant then."""
    if energy is None or energy.wrong or energy.answers is None:
        return False
    return not energy.answers[()].numerator_of_difference(energy.right(())).is_zero


def _factorization(truth: Truth, judged: JudgedQuantity) -> NoteKind | None:
    """Return which factorization of the Coriolis torques a right C is; None for a wrong or unreadable C.

    C is judged by C qd, which alone is determined.
    """
    if judged.wrong or any(entry.tree is None for entry in judged.given):
        return None
    lag = truth.lagrangian
    coordinates = truth.coordinates
    C = np.empty((lag.n, lag.n), dtype=object)
    reader = RingReader(lag.arm.ring)
    for entry in judged.given:
        element = reader.element(entry.tree) if entry.tree else None
        if element is None:
            return NoteKind.BY_TORQUES
        C[entry.index] = element
    christoffel = truth.with_numbers("C", coordinates.in_y("C", lag.C), judged.numbers)
    if all(element.is_zero for element in (C - christoffel).flat):
        return NoteKind.CHRISTOFFEL
    if any(finding.verdict is Verdict.ROUNDED for finding in judged.findings.values()):
        return NoteKind.BY_TORQUES  # of rounded decimals only the torques are known to be right
    M = truth.with_numbers("M", truth.of("M"), judged.numbers)
    rate = np.empty_like(M)
    for index, entry in np.ndenumerate(M):
        rate[index] = entry.by_time()
    N = rate - 2 * C
    is_skew = all(element.is_zero for element in (N + N.T).flat)
    return NoteKind.SKEW if is_skew else NoteKind.NOT_SKEW
