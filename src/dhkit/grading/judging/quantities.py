"""Quantities held against the truth entry by entry: M, C, h, g, tau, K, V, L and the table's transforms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Name, Product, Sum, Tree
from dhkit.grading.answers.given import LEFT_EMPTY, Given
from dhkit.grading.answers.sheet import Task
from dhkit.grading.judging.coordinates import Coordinates
from dhkit.grading.judging.findings import EXACT, Comparison, Finding, compare, names_in
from dhkit.grading.judging.numeric import doubles, general_state, names_of, state_arrays
from dhkit.grading.judging.quotients import OutsideTheRingError, Quotient, Reading
from dhkit.grading.judging.rounding import Residuals
from dhkit.grading.judging.truth import Truth, exact_number, substituted
from dhkit.grading.report import Verdict
from dhkit.symbolic import ExactArm
from dhkit.symbolic.ring import Element, Elements, RingError

Index = tuple[int, ...]
NEAR = 5e-3
"""Relative: decimals of four digits are off by less."""


@dataclass(frozen=True, eq=False)
class JudgedQuantity:
    """What is found of a quantity.

    Attributes
    ----------
    name
        Which.
    given
        What was handed in.
    findings
        By index; of C those of the rows' products with the rates.
    truth
        What is right, with numbers where the answer has them.
    numbers
        Parameters that the answer has as numbers.
    contradictions
        Entries of which a chain ``V = a = b`` has sides that differ.
    """

    name: str
    given: tuple[Given, ...]
    findings: Mapping[Index, Finding]
    truth: Elements
    numbers: frozenset[str] = frozenset()
    contradictions: tuple[Index, ...] = ()

    @property
    def wrong(self) -> int:
        """How many entries are wrong."""
        return sum(finding.verdict is Verdict.WRONG for finding in self.findings.values())

    def right(self, index: Index) -> Element:
        """Return what an entry should be; of C the row's torque."""
        return self.truth[index[:1] if self.name == "C" else index]  # type: ignore[no-any-return]

    @property
    def is_zero(self) -> bool:
        """Whether everything that was handed in is zero."""
        findings = [finding for finding in self.findings.values() if finding.verdict is not Verdict.INCOMPLETE]
        answers = [finding.answer.element() if finding.answer else None for finding in findings]
        return bool(answers) and all(answer is not None and answer.is_zero for answer in answers)

    @property
    def answers(self) -> Mapping[Index, Quotient] | None:
        """The answer in the ring; None where an entry is not in it."""
        found = {index: finding.answer for index, finding in self.findings.items()}
        return None if any(answer is None for answer in found.values()) else found  # type: ignore[return-value]

    @property
    def differences(self) -> Mapping[Index, Element] | None:
        """Answer less truth of the entries that were handed in, zero where one is right.

        None where an entry's difference is no element of the ring.
        """
        found: dict[Index, Element] = {}
        rows = {index[0] for index, finding in self.findings.items() if finding.verdict is Verdict.WRONG and index}
        for index, finding in self.findings.items():
            if finding.verdict is Verdict.INCOMPLETE:
                continue
            zero = self.right(index).ring.zero
            passes = finding.verdict.passes and not (self.name == "C" and index[0] in rows)
            element = zero if passes else finding.difference
            if element is None:
                return None
            found[index] = element
        return found


def judge_quantity(
    name: str, given: tuple[Given, ...], truth: Truth, task: Task, digits: int = 4, seed: int = 0
) -> JudgedQuantity:
    """Judge a quantity, with its parameters as symbols or, where it has none of one, with the file's number.

    Parameters
    ----------
    name
        Which.
    given
        All its entries.
    truth
        What is right.
    task
        What was asked for.
    digits
        Significant digits from which a decimal may have been rounded.
    seed
        Of the random states that answers outside the ring are tried at.

    Raises
    ------
    DescriptionError
        A link has no body, and the quantity needs it.
    """
    arm = truth.arm(name)
    right = truth.of("h" if name == "C" else name)
    reading = Reading(arm.ring, others=truth.others(name))
    up_to_constant = None if name == "L" and task.total_derivative else name in ("V", "L")
    by = Comparison(arm, reading, digits, residuals=_residuals(name, task), seed=seed, up_to_constant=up_to_constant)
    judged = JudgedQuantity(name, given, _findings(name, given, right, by, truth), right)
    missing = _missing(truth, right, given)
    all_numbers = bool(missing) and missing == parameters_in(right, truth)
    likely = [entry for entry in given if _is_near(judged, entry, arm)] if missing and judged.wrong else []
    if judged.wrong and not judged.is_zero and (all_numbers or likely or (missing and name == "C")):
        in_numbers = _at_numbers(truth, name, right, missing)
        findings = _findings(name, given, in_numbers, replace(by, numbers=missing), truth)
        other = JudgedQuantity(name, given, findings, in_numbers, missing)
        judged = other if all_numbers or other.wrong < judged.wrong else judged
    if name != "C" and judged.wrong:
        judged = _with_mixed_numbers(judged, missing, truth, by)
    differing = tuple(entry.index for entry in given if _contradicts(entry, judged, by))
    return replace(judged, contradictions=differing)


def _contradicts(entry: Given, judged: JudgedQuantity, by: Comparison) -> bool:
    """Whether an earlier side of a chain differs from its last one."""
    if entry.tree is None or judged.name == "C":
        return False
    verdict = judged.findings[entry.index].verdict
    for side in entry.earlier:
        try:
            if by.reading.read(side).equals(by.reading.read(entry.tree)):
                continue
            right = compare(side, judged.right(entry.index), replace(by, numbers=judged.numbers))
            if not (right.verdict.passes and verdict.passes):
                return True
        except (OutsideTheRingError, AnswerError, RingError):
            values = {**by.arm.parameters, **general_state(by.arm.n)}
            first, last = float(doubles(side, values)), float(doubles(entry.tree, values))
            if not abs(first - last) <= NEAR * max(abs(first), abs(last), 1e-9):
                return True
    return False


def _is_near(judged: JudgedQuantity, entry: Given, arm: ExactArm) -> bool:
    """Whether a wrong entry is nearly right with the file's numbers, in one state."""
    if entry.tree is None or judged.findings[entry.index].verdict is not Verdict.WRONG or judged.name == "C":
        return False
    state = general_state(arm.n)
    answer = float(doubles(entry.tree, {**arm.parameters, **state}))
    right = float(arm.evaluate(judged.right(entry.index), *state_arrays(state, arm.n)))
    return judged.name in ("V", "L") or bool(abs(answer - right) <= NEAR * max(abs(right), 1e-9))


def _at_numbers(truth: Truth, name: str, right: Elements, numbers: frozenset[str]) -> Elements:
    ring = truth.arm(name).ring
    values = {p: ring.number(exact_number(truth.description, p)) for p in numbers}
    return substituted(right, values, ring)


def _with_mixed_numbers(judged: JudgedQuantity, tried: frozenset[str], truth: Truth, by: Comparison) -> JudgedQuantity:
    """Judge wrong entries with numbers that stand where other entries have symbols.

    A number that is 1 is never seen in a product: a parameter worth 1 that is missing is then missing.
    """
    findings, mixed = dict(judged.findings), set(judged.numbers)
    for entry in judged.given:
        if not _is_near(judged, entry, by.arm):
            continue
        right = np.array([judged.right(entry.index)], dtype=object)
        numbers = frozenset(p for p in _missing(truth, right, [entry]) if exact_number(truth.description, p) != 1)
        if not numbers or numbers == tried:
            continue
        finding = _finding(entry.tree, entry.error, _at_numbers(truth, judged.name, right, numbers)[0], by)
        if finding.verdict in (Verdict.CORRECT, Verdict.ROUNDED):
            findings[entry.index] = finding
            mixed |= numbers
    return replace(judged, findings=findings, numbers=frozenset(mixed)) if mixed != judged.numbers else judged


def _missing(truth: Truth, right: Elements, given: Sequence[Given]) -> frozenset[str]:
    """Return the parameters that the truth has, and no entry of the answer."""
    used = [names_of(entry.tree) for entry in given if entry.tree is not None]
    return parameters_in(right, truth).difference(*used)


def parameters_in(array: Elements, truth: Truth) -> frozenset[str]:
    """Return the file's parameters that elements have."""
    return frozenset().union(*map(names_in, array.flat)) & frozenset(truth.description.parameters)


def _findings(name: str, given: Sequence[Given], right: Elements, by: Comparison, truth: Truth) -> dict[Index, Finding]:
    if name == "C":
        return _row_findings(given, right, by, truth)
    return {entry.index: _finding(entry.tree, entry.error, right[entry.index], by) for entry in given}


def _finding(tree: Tree | None, error: str, right: Element, by: Comparison) -> Finding:
    if tree is None:
        return Finding(Verdict.INCOMPLETE if error == LEFT_EMPTY else Verdict.UNREADABLE, error)
    try:
        return compare(tree, right, by)
    except AnswerError as refusal:
        return Finding(Verdict.UNREADABLE, str(refusal))


def _row_findings(given: Sequence[Given], right: Elements, by: Comparison, truth: Truth) -> dict[Index, Finding]:
    """Judge C by C qd: each row's entries share what is found of their sum with the rates."""
    found: dict[Index, Finding] = {}
    for i in range(len(right)):
        row = [entry for entry in given if entry.index[0] == i]
        if any(entry.is_missing for entry in row):
            found |= _part_of_row(row, by, truth)
            continue
        error = next((entry.error for entry in row if entry.tree is None), "")
        terms = tuple(
            (True, Product(((True, e.tree), (True, _rate(truth.coordinates, e.index[1]))))) for e in row if e.tree
        )
        finding = _finding(None if error else Sum(terms), error, right[i], by)
        if finding.verdict is Verdict.WRONG:
            finding = replace(
                finding, statement=f"{finding.statement}: row {i + 1} of C qd, to which the difference belongs"
            )
        found |= {entry.index: finding for entry in row}
        if finding.verdict is Verdict.WRONG:
            found |= _right_in_wrong_row(row, finding, by, truth)
    return found


def _right_in_wrong_row(row: Sequence[Given], wrong: Finding, by: Comparison, truth: Truth) -> dict[Index, Finding]:
    """Return what is right in a wrong row of C: the entries of the Christoffel factorization.

    Zeros are right beside others only: a row of zeros is a row that was left out.
    """
    christoffel = truth.coordinates.in_y("C", truth.lagrangian.C)
    alike = [e for e in row if _finding(e.tree, e.error, christoffel[e.index], by).verdict is Verdict.CORRECT]
    answer = wrong.answer.element() if wrong.answer is not None else None
    if answer is not None and answer.is_zero and not any(christoffel[entry.index] for entry in alike):
        return {}
    statement = "proved equal to the Christoffel symbols' entry; another entry of its row is wrong"
    right = replace(wrong, verdict=Verdict.CORRECT, statement=statement, witness=None)
    return {entry.index: right for entry in alike}


def _part_of_row(row: Sequence[Given], by: Comparison, truth: Truth) -> dict[Index, Finding]:
    """Judge a row of C that lacks entries: what is there is right if it is the Christoffel factorization's.

    Another factorization may be right too, but its row alone would show that.
    """
    christoffel = truth.coordinates.in_y("C", truth.lagrangian.C)
    lacking = ", ".join(f"C{entry.index[0] + 1}{entry.index[1] + 1}" for entry in row if entry.is_missing)
    found: dict[Index, Finding] = {}
    for entry in row:
        finding = _finding(entry.tree, entry.error, christoffel[entry.index], by)
        if finding.verdict is Verdict.WRONG:
            finding = Finding(Verdict.INCOMPLETE, f"not judged: C is judged by rows of C qd, and {lacking} is missing")
        found[entry.index] = finding
    return found


def _rate(coordinates: Coordinates, j: int) -> Tree:
    """Return the rate of variable j as a tree."""
    names = tuple((True, Name(f"qd{joint + 1}", 0)) for joint in coordinates.sums[j])
    return names[0][1] if len(names) == 1 else Sum(names)


# What must vanish


def _residuals(name: str, task: Task) -> Residuals:
    """Return what must be zero: energies count from any zero, L perhaps up to a total derivative."""
    if name == "V":
        return _slopes
    if name == "L":
        return _euler_lagrange if task.total_derivative else _slopes
    return EXACT


def _slopes(answer: Quotient, truth: Element) -> Sequence[Element]:
    """Return the derivatives of the difference by the state, times the square of the denominator."""
    numerator, denominator = answer.numerator_of_difference(truth), answer.denominator
    if _accelerates(numerator) or _accelerates(denominator):
        return [numerator]
    slopes = []
    for derivative in ("by_position", "by_rate"):
        for i in range(truth.ring.n):
            change = getattr(numerator, derivative)(i)
            if not answer.is_polynomial:
                change = change * denominator - numerator * getattr(denominator, derivative)(i)
            slopes.append(change)
    return slopes


def _euler_lagrange(answer: Quotient, truth: Element) -> Sequence[Element]:
    """Return d/dt dD/dqd - dD/dq of the difference D: zero for a total derivative of a function of q and t."""
    element = answer.element()
    if element is None or _accelerates(element):
        return _slopes(answer, truth)
    difference = element - truth
    return [difference.by_rate(i).by_time() - difference.by_position(i) for i in range(truth.ring.n)]


def _accelerates(element: Element) -> bool:
    places = [element.ring.place("acceleration", i) for i in range(element.ring.n)]
    return any(monomial[place] for monomial in element.terms for place in places)
