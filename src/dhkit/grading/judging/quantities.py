"""Comparison of quantities with the truth, entry by entry: M, C, h, g, tau, K, V, L and the table's transforms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Name, Product, Sum, Tree
from dhkit.grading.answers.given import LEFT_EMPTY, Given
from dhkit.grading.answers.sheet_values import Requirements
from dhkit.grading.grade_report import Verdict
from dhkit.grading.judging.coordinates import Coordinates
from dhkit.grading.judging.findings import Comparison, Finding, compare, exact_difference, names_in
from dhkit.grading.judging.letters import WrittenNumbers
from dhkit.grading.judging.numeric import doubles, general_state
from dhkit.grading.judging.quotients import OutsideTheRingError, Quotient
from dhkit.grading.judging.rounding import Residuals
from dhkit.grading.judging.truth import Truth
from dhkit.symbolic.ring import Element, Elements, RingError, element_array

Index: TypeAlias = tuple[int, ...]
"""Indices of an entry in its quantity, from 0."""
_ROUNDED_DECIMALS = 5e-3
"""Largest relative difference of two sides of a chain that are equal but for the rounding of four digits."""


@dataclass(frozen=True, eq=False)
class JudgedQuantity:
    """A quantity that was compared with the truth.

    Attributes
    ----------
    name
        Name of the quantity.
    given
        Entries that were handed in.
    findings
        Findings by index; those of C concern the rows' products with the rates.
    truth
        Right value, with numbers where the answer has them; of C that of C qd.
    numbers
        Parameters that the answer has as numbers.
    contradictions
        Indices of entries with a chain ``V = a = b`` whose sides differ.
    """

    name: str
    given: tuple[Given, ...]
    findings: Mapping[Index, Finding]
    truth: Elements
    numbers: frozenset[str] = frozenset()
    contradictions: tuple[Index, ...] = ()

    @property
    def wrong(self) -> int:
        """Number of wrong entries."""
        return len(self.wrong_indices)

    def right(self, index: Index) -> Element:
        """Return the right value of an entry; of C that of the row's torque."""
        return self.truth[place_of(self.name, index)]  # type: ignore[no-any-return]

    @property
    def wrong_indices(self) -> list[Index]:
        """Indices of the wrong entries."""
        return [
            index for index, finding in self.findings.items() if finding.verdict is Verdict.WRONG
        ]

    @property
    def is_zero(self) -> bool:
        """Whether everything that was handed in is zero."""
        findings = [
            finding
            for finding in self.findings.values()
            if finding.verdict is not Verdict.INCOMPLETE
        ]
        answers = [finding.answer.element() if finding.answer else None for finding in findings]
        return bool(answers) and all(answer is not None and answer.is_zero for answer in answers)

    @property
    def answers(self) -> Mapping[Index, Quotient] | None:
        """The answer in the ring; None if an entry is outside."""
        answers: dict[Index, Quotient] = {}
        for index, finding in self.findings.items():
            if finding.answer is None:
                return None
            answers[index] = finding.answer
        return answers

    @property
    def differences(self) -> Mapping[Index, Element] | None:
        """Answer less truth of the entries that were handed in, zero for right ones.

        None if the difference of an entry is not an element of the ring.
        """
        differences: dict[Index, Element] = {}
        wrong_rows = {index[0] for index in self.wrong_indices if index}
        for index, finding in self.findings.items():
            if finding.verdict is Verdict.INCOMPLETE:
                continue
            zero = self.right(index).ring.zero
            is_in_wrong_row = self.name == "C" and index[0] in wrong_rows
            element = zero if finding.verdict.passes and not is_in_wrong_row else finding.difference
            if element is None:
                return None
            differences[index] = element
        return differences


def place_of(quantity: str, index: Index) -> Index:
    """Return the index at which an entry is judged: for C, which is judged by C qd, that of the row."""
    return index[:1] if quantity == "C" else index


def judge_quantity(
    name: str,
    given: tuple[Given, ...],
    truth: Truth,
    task: Requirements,
    digits: int = 4,
    seed: int = 0,
    *,
    letters: frozenset[str] = frozenset(),
) -> JudgedQuantity:
    """Judge a quantity with its parameters as letters.

    Wrong entries are judged once more with numbers for those letters that they have as numbers. A number may stand
    where it is written, 9.81 for g; a letter that is left out is not a number. A sheet without any letter is judged at
    the file's values.

    Parameters
    ----------
    name
        Name of the quantity.
    given
        All its entries.
    truth
        The right answers.
    task
        The task, for friction and total derivatives.
    digits
        Number of significant digits from which a decimal may have been rounded.
    seed
        Seed of the random states at which answers outside the ring are tried.
    letters
        Letters of the robot's file that the sheet has anywhere.

    Raises
    ------
    DescriptionError
        A link has no body, and the quantity needs it.
    """
    arm = truth.arm(name)
    right = truth.of("h" if name == "C" else name)
    reader = truth.reader(name)
    up_to_constant = None if name == "L" and task.total_derivative else name in ("V", "L")
    by = Comparison(
        arm,
        reader,
        digits,
        residuals=_residuals(name, task),
        seed=seed,
        up_to_constant=up_to_constant,
    )
    judged = JudgedQuantity(name, given, _findings(name, given, right, by, truth), right)
    if judged.wrong and not judged.is_zero:
        judged = _in_written_numbers(judged, truth, by, letters)
    if task.in_letters and judged.numbers:
        judged = replace(
            judged, findings={index: _in_numbers(found) for index, found in judged.findings.items()}
        )
    contradictions = tuple(entry.index for entry in given if _contradicts(entry, judged, by))
    return replace(judged, contradictions=contradictions)


def _in_numbers(finding: Finding) -> Finding:
    """Return the finding on an entry that is right at the file's values, where the task asks for letters."""
    if not finding.verdict.passes:
        return finding
    statement = "right at the file's values; the task asks for letters"
    return replace(finding, verdict=Verdict.INCOMPLETE, statement=statement)


def _contradicts(entry: Given, judged: JudgedQuantity, by: Comparison) -> bool:
    """Whether an earlier side of a chain differs from its last one."""
    if entry.tree is None or judged.name == "C":
        return False
    verdict = judged.findings[entry.index].verdict
    for side in entry.earlier:
        try:
            if by.reader.read(side).equals(by.reader.read(entry.tree)):
                continue
            right = compare(side, judged.right(entry.index), replace(by, numbers=judged.numbers))
            if not (right.verdict.passes and verdict.passes):
                return True
        except (OutsideTheRingError, AnswerError, RingError):
            values = {**by.arm.parameters, **general_state(by.arm.n)}
            first = float(doubles(side, values))
            last = float(doubles(entry.tree, values))
            if not abs(first - last) <= _ROUNDED_DECIMALS * max(abs(first), abs(last), 1e-9):
                return True
    return False


def _in_written_numbers(
    judged: JudgedQuantity, truth: Truth, by: Comparison, letters: frozenset[str]
) -> JudgedQuantity:
    """Return the judgement with numbers for the letters that wrong entries have as numbers.

    It is returned if it makes an entry right, or if the sheet has no letter at all; else ``judged`` stays as it is.
    """
    # The letters that each wrong entry, or row of C, has as numbers, and the truth with these numbers.
    written = WrittenNumbers(truth, judged.name, by.reader, letters)
    in_numbers = judged.truth.copy()
    numbers: dict[Index, frozenset[str]] = {}
    for place, tree in _wrong_trees(judged, truth).items():
        right = judged.truth[place]
        found = (
            written.letters(tree, right)
            if letters
            else parameters_in(element_array([right]), truth)
        )
        if found:
            numbers[place] = found
            in_numbers[place] = truth.with_numbers(judged.name, element_array([right]), found)[0]
    if not numbers:
        return judged
    every = frozenset[str]().union(*numbers.values())

    # The findings at these places.
    findings = dict(judged.findings)
    if judged.name == "C":
        findings |= _row_findings(judged.given, in_numbers, replace(by, numbers=every), truth)
    else:
        for entry in judged.given:
            if entry.index in numbers:
                by_numbers = replace(by, numbers=numbers[entry.index])
                findings[entry.index] = _finding(
                    entry.tree, entry.error, in_numbers[entry.index], by_numbers
                )
    other = replace(judged, findings=findings, truth=in_numbers, numbers=every)
    if letters and not other.wrong < judged.wrong:
        return judged

    # Entries that stay wrong are shown in letters, beside entries that are right in numbers.
    still_wrong = {place_of(other.name, index) for index in other.wrong_indices}
    of_right_places = [found for place, found in numbers.items() if place not in still_wrong]
    return replace(other, numbers=frozenset[str]().union(*of_right_places) or every)


def _wrong_trees(judged: JudgedQuantity, truth: Truth) -> dict[Index, Tree]:
    """Return the formula at each place that is wrong: of an entry, or of a row of C qd."""
    trees: dict[Index, Tree] = {}
    for index in judged.wrong_indices:
        place = place_of(judged.name, index)
        entries = [
            entry
            for entry in judged.given
            if place_of(judged.name, entry.index) == place and entry.tree
        ]
        if judged.name == "C":
            trees[place] = _row_times_rates(entries, truth.coordinates)
        elif entries and entries[0].tree is not None:
            trees[place] = entries[0].tree
    return trees


def _row_times_rates(row: Sequence[Given], coordinates: Coordinates) -> Tree:
    """Return the formula of a row of C qd: sum over j of C_ij qd_j; entries without a formula are left out."""
    terms: list[tuple[bool, Tree]] = []
    for entry in row:
        if entry.tree:
            rate = _rate(coordinates, entry.index[1])
            terms.append((True, Product(((True, entry.tree), (True, rate)))))
    return Sum(tuple(terms))


def parameters_in(array: Elements, truth: Truth) -> frozenset[str]:
    """Return the file's parameters that occur in elements."""
    return frozenset().union(*map(names_in, array.flat)) & frozenset(truth.description.parameters)


def _findings(
    name: str, given: Sequence[Given], right: Elements, by: Comparison, truth: Truth
) -> dict[Index, Finding]:
    if name == "C":
        return _row_findings(given, right, by, truth)
    return {
        entry.index: _finding(entry.tree, entry.error, right[entry.index], by) for entry in given
    }


def _finding(tree: Tree | None, error: str, right: Element, by: Comparison) -> Finding:
    if tree is None:
        return Finding(Verdict.INCOMPLETE if error == LEFT_EMPTY else Verdict.UNREADABLE, error)
    try:
        return compare(tree, right, by)
    except AnswerError as refusal:
        return Finding(Verdict.UNREADABLE, str(refusal))


def _row_findings(
    given: Sequence[Given], right: Elements, by: Comparison, truth: Truth
) -> dict[Index, Finding]:
    """Return the findings on C, which is judged by C qd: the entries of a row share that on the row of C qd."""
    findings: dict[Index, Finding] = {}
    for i in range(len(right)):
        row = [entry for entry in given if entry.index[0] == i]
        if any(entry.is_missing for entry in row):
            findings |= _judge_partial_row(row, by, truth)
            continue
        error = next((entry.error for entry in row if entry.tree is None), "")
        tree = None if error else _row_times_rates(row, truth.coordinates)
        finding = _finding(tree, error, right[i], by)
        is_wrong = finding.verdict is Verdict.WRONG
        if is_wrong:
            statement = f"{finding.statement}: row {i + 1} of C qd, to which the difference belongs"
            finding = replace(finding, statement=statement)
        findings |= {entry.index: finding for entry in row}
        if is_wrong:
            findings |= _judge_wrong_row(row, finding, by, truth)
    return findings


def _judge_wrong_row(
    row: Sequence[Given], wrong: Finding, by: Comparison, truth: Truth
) -> dict[Index, Finding]:
    """Return the right entries of a wrong row of C: those of the Christoffel factorization.

    Zeros are right only beside other entries: a row of zeros is a row that was left out.
    """
    christoffel = truth.coordinates.in_y("C", truth.lagrangian.C)
    alike: list[Given] = []
    for entry in row:
        finding = _finding(entry.tree, entry.error, christoffel[entry.index], by)
        if finding.verdict is Verdict.CORRECT:
            alike.append(entry)
    answer = wrong.answer.element() if wrong.answer is not None else None
    if (
        answer is not None
        and answer.is_zero
        and not any(christoffel[entry.index] for entry in alike)
    ):
        return {}
    statement = "proved equal to the Christoffel symbols' entry; another entry of its row is wrong"
    right = replace(wrong, verdict=Verdict.CORRECT, statement=statement, witness=None)
    return {entry.index: right for entry in alike}


def _judge_partial_row(row: Sequence[Given], by: Comparison, truth: Truth) -> dict[Index, Finding]:
    """Return the findings on a row of C that lacks entries: those of the Christoffel factorization are right.

    Another factorization may be right too, but only the whole row could show it.
    """
    christoffel = truth.coordinates.in_y("C", truth.lagrangian.C)
    lacking = ", ".join(
        f"C{entry.index[0] + 1}{entry.index[1] + 1}" for entry in row if entry.is_missing
    )
    findings: dict[Index, Finding] = {}
    for entry in row:
        finding = _finding(entry.tree, entry.error, christoffel[entry.index], by)
        if finding.verdict is Verdict.WRONG:
            finding = Finding(
                Verdict.INCOMPLETE,
                f"not judged: C is judged by rows of C qd, and {lacking} is missing",
            )
        findings[entry.index] = finding
    return findings


def _rate(coordinates: Coordinates, j: int) -> Tree:
    """Return the rate of variable j as a tree."""
    names = tuple((True, Name(f"qd{joint + 1}", 0)) for joint in coordinates.sums[j])
    return names[0][1] if len(names) == 1 else Sum(names)


# Residuals


def _residuals(name: str, task: Requirements) -> Residuals:
    """Return the residuals of a quantity: energies count from any zero, L perhaps up to a total derivative."""
    if name == "V":
        return _slopes
    if name == "L":
        return _euler_lagrange if task.total_derivative else _slopes
    return exact_difference


def _slopes(answer: Quotient, truth: Element) -> Sequence[Element]:
    """Return the derivatives of the difference by q and qd, times the square of the denominator.

    (N / D)' D^2 = N' D - N D', or N' where D is 1.
    """
    numerator = answer.numerator_of_difference(truth)
    denominator = answer.denominator
    if _accelerates(numerator) or _accelerates(denominator):
        return [numerator]
    slopes = []
    for derivative in (Element.by_position, Element.by_rate):
        for i in range(truth.ring.n):
            slope = derivative(numerator, i)
            if not answer.is_polynomial:
                slope = slope * denominator - numerator * derivative(denominator, i)
            slopes.append(slope)
    return slopes


def _euler_lagrange(answer: Quotient, truth: Element) -> Sequence[Element]:
    """Return d/dt dD/dqd - dD/dq of the difference D: zero for a total derivative of a function of q and t."""
    element = answer.element()
    if element is None or _accelerates(element):
        return _slopes(answer, truth)
    difference = element - truth
    return [
        difference.by_rate(i).by_time() - difference.by_position(i) for i in range(truth.ring.n)
    ]


def _accelerates(element: Element) -> bool:
    """Whether an element depends on an acceleration."""
    ring = element.ring
    return element.contains_any(ring.place("acceleration", i) for i in range(ring.n))
