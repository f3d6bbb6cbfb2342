"""Comparison of a table with the file's, row by row: each A_i in the exact ring or, outside it, in doubles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from dhkit.description import Convention, Description
from dhkit.description.parameters import resolved
from dhkit.errors import AnswerError, ExpressionError
from dhkit.expressions import CONSTANTS, ZERO, Expression, exact_angle, substitute
from dhkit.expressions.budget import budgeted
from dhkit.expressions.parser import value_of
from dhkit.expressions.syntax import Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.grade_report import Verdict
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.numeric import doubles
from dhkit.grading.judging.quotients import multiple_angle, sum_of_angles
from dhkit.grading.judging.same_arm import STATES
from dhkit.grading.judging.table_arms import (
    SAME_TRANSFORM,
    Row,
    link_entries,
    link_in_doubles,
    number_of,
    parameter_values,
    row_numbers,
)
from dhkit.symbolic import Element, Elements, ExactArm, RingError, exact_arm
from dhkit.symbolic.exact.naming import Naming
from dhkit.symbolic.ring import Direction, Ring
from dhkit.symbolic.textbook_kinematics import with_massless_links

COLUMNS = ("theta", "d", "a", "alpha")
"""Columns of a table, in their order."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Rows of the table that was handed in.

    Attributes
    ----------
    trees
        Rows of theta, d, a, alpha, one for each joint; rad and m.
    entries
        Exact values of the same entries; None for entries outside exact arithmetic.
    """

    trees: tuple[tuple[Tree, ...], ...]
    entries: tuple[tuple[Expression | None, ...], ...]

    @classmethod
    def of(cls, description: Description, rows: Sequence[Sequence[Tree]]) -> Answer:
        """Read rows.

        Raises
        ------
        AnswerError
            Another number of rows or columns, an unknown name or function.
        """
        n = description.n
        if len(rows) != n:
            raise AnswerError(
                f"dh: {len(rows)} row{'s' * (len(rows) != 1)}; expected {n}, one a joint"
            )
        names = [*(f"q{i + 1}" for i in range(n)), *description.parameters]
        for i, row in enumerate(rows, start=1):
            if len(row) != len(COLUMNS):
                raise AnswerError(f"dh, row {i}: {len(row)} entries; expected {', '.join(COLUMNS)}")
        entries: list[tuple[Expression | None, ...]] = []
        for i, row in enumerate(rows, start=1):
            columns = zip(row, COLUMNS, strict=True)
            entries.append(
                tuple(_entry(tree, names, f"dh, row {i}, {column}") for tree, column in columns)
            )
        return cls(tuple(tuple(row) for row in rows), tuple(entries))


def _entry(tree: Tree, names: Sequence[str], where: str) -> Expression | None:
    """Return the exact value of an entry; None if it has none.

    Raises
    ------
    AnswerError
        An unknown name or function.
    """
    unknown = sorted(names_of(tree) - {*names, *CONSTANTS})
    if unknown:
        raise AnswerError(
            f"{where}: unknown name {unknown[0]!r}; expected {', '.join([*names, 'pi', 'deg'])}"
        )
    try:
        with budgeted():
            return value_of(tree, names)
    except ExpressionError:
        # Evaluated for the error that an unknown function raises.
        doubles(tree, dict.fromkeys([*names, *CONSTANTS], 1.0))
        return None


@dataclass(frozen=True)
class JudgedRow:
    """Verdict on a row, with its reason."""

    verdict: Verdict
    statement: str
    numbers: frozenset[str] = frozenset()
    """Parameters of the file that a right row has as numbers."""


@dataclass(frozen=True, eq=False)
class TableRows:
    """Rows of an answer, compared with the file's.

    Attributes
    ----------
    description
        The robot.
    answer
        Rows that were handed in.
    convention
        Convention that the answer states.
    seed
        Seed of the random states at which entries outside the exact ring are tried.
    """

    description: Description
    answer: Answer
    convention: Convention
    seed: int = 0

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.description.n

    @property
    def converted(self) -> bool:
        """Whether the answer is in another convention than the file."""
        return self.convention is not self.description.convention

    def row(self, i: int) -> JudgedRow:
        """Return the verdict on A_i, i from 0."""
        entries = self.answer.entries[i]
        written = self.written(i)
        if None not in entries:
            if self.is_proved(i, self.reference[i]):
                return JudgedRow(Verdict.CORRECT, f"A{i + 1} is proved")
            if written and self.is_proved(i, self.reference_in_numbers(i)):
                return JudgedRow(
                    Verdict.CORRECT, f"A{i + 1} is proved with the file's numbers", written
                )
        if self.agrees_in_doubles(i):
            statement = (
                f"A{i + 1} agrees at {STATES} random states to {SAME_TRANSFORM:g}, without a proof"
            )
            return JudgedRow(Verdict.UNDECIDED, statement)
        return JudgedRow(Verdict.WRONG, f"A{i + 1} differs")

    @cached_property
    def has_letters(self) -> bool:
        """Whether the answer has a parameter of the file anywhere."""
        names: set[str] = set()
        for row in self.answer.trees:
            names.update(*map(names_of, row))
        return bool(self.description.parameters.keys() & names)

    def is_written(self, i: int, column: int) -> bool:
        """Whether an entry of row i is written in numbers where the file has letters.

        If other entries of the answer have letters, a letter of value 0 in the file was left out, and not written as 0.
        """
        parameters = self.description.parameters
        letters = self.reference[i][column].symbols & parameters.keys()
        if not letters or names_of(self.answer.trees[i][column]) & parameters.keys():
            return False
        return not self.has_letters or all(self.states[0][letter] != 0 for letter in letters)

    def written(self, i: int) -> frozenset[str]:
        """Return the letters that row i has as numbers."""
        letters = (
            self.reference[i][k].symbols for k in range(len(COLUMNS)) if self.is_written(i, k)
        )
        return frozenset().union(*letters) & self.description.parameters.keys()

    def reference_in_numbers(self, i: int) -> Row:
        """Return row i of the file, with numbers where the answer has them."""
        theta, d, a, alpha = (
            self._in_numbers(i, k, entry) for k, entry in enumerate(self.reference[i])
        )
        return theta, d, a, alpha

    def _in_numbers(self, i: int, column: int, truth: Expression) -> Expression:
        """Return an entry with the file's numbers where the answer has them."""
        return substitute(truth, self._values) if self.is_written(i, column) else truth

    @cached_property
    def _values(self) -> dict[str, Expression]:
        """Exact values of the file's parameters by name, SI units and rad."""
        return resolved(self.description.parameters)

    def is_proved(self, i: int, reference: Row) -> bool:
        """Whether A_i, i from 0, equals that of a row of the file in the ring of the file's parameters."""
        try:
            answer = self.reader.link(self.answer.entries[i], self.convention)
            truth = self.reader.link(reference, self.convention)
            return bool((truth == answer).all())
        except (RingError, ExpressionError):
            return False

    def agrees_in_doubles(self, i: int) -> bool:
        """Whether A_i, i from 0, agrees with the file's in doubles, at other values of the parameters as well."""
        fixed = {name: self.states[0][name] for name in self.written(i)}
        for state in self.states:
            values = state | fixed
            entries = row_numbers(self.answer.trees[i], values)
            if not np.all(np.isfinite(entries)):
                return False
            answer = link_in_doubles(self.convention, *entries)
            truth = link_in_doubles(
                self.convention, *(number_of(entry, values) for entry in self.reference[i])
            )
            largest = max(1.0, float(np.max(np.abs(truth))))
            if not np.max(np.abs(answer - truth)) <= SAME_TRANSFORM * largest:
                return False
        return True

    @cached_property
    def reference(self) -> tuple[Row, ...]:
        """The file's table in the convention of the answer."""
        return _file_rows(self.description, self.convention)

    @cached_property
    def reader(self) -> _RowReader:
        """Reader into the ring with the file's parameters."""
        return _RowReader(exact_arm(with_massless_links(self.description), "file"))

    @cached_property
    def states(self) -> list[dict[str, float]]:
        """Values of joint variables and parameters by name, rad and SI units; the first with the file's parameters.

        The others have parameters between a quarter and four times of the file's.
        """
        random = np.random.default_rng(self.seed)
        states = []
        for k in range(STATES):
            q = random.uniform(-3, 3, self.n)
            exponents = random.uniform(-1, 1, len(self.description.parameters))
            factors = 4.0 ** ((k > 0) * exponents)
            joints = {f"q{i + 1}": float(x) for i, x in enumerate(q)}
            states.append(parameter_values(self.description, factors) | joints)
        return states

    def equal(self, i: int, column: int, truth: Expression) -> bool:
        """Whether an entry of row i equals a value, angles up to full turns; numbers may stand for parameters."""
        given = self.answer.entries[i][column]
        if given is None:
            return False
        naming = self.reader.naming
        difference = naming.known(given) - naming.known(self._in_numbers(i, column, truth))
        if COLUMNS[column] in ("d", "a"):
            return difference.is_zero
        half_turns = exact_angle(difference).half_turns
        return half_turns is not None and half_turns % 2 == 0


def other_convention(convention: Convention) -> Convention:
    """Return the other of the two conventions."""
    return Convention.MODIFIED if convention is Convention.STANDARD else Convention.STANDARD


def _file_rows(description: Description, convention: Convention) -> tuple[Row, ...]:
    """Return the file's table in a convention: in the other one, a and alpha move to the neighbouring row.

    Standard:   ... Rz(theta_i) Tz(d_i) [Tx(a_i) Rx(alpha_i)] Rz(theta_(i+1)) ...
    Modified:   ... [Rx(alpha_i) Tx(a_i)] Rz(theta_(i+1)) Tz(d_(i+1)) ..., in row i + 1
    """
    joints = description.joints
    links = [(joint.a, exact_angle(joint.alpha)) for joint in joints]
    if convention is not description.convention:
        none = (ZERO, ZERO)
        links = [*links[1:], none] if convention is Convention.STANDARD else [none, *links[:-1]]

    rows: list[Row] = []
    for i, (joint, (a, alpha)) in enumerate(zip(joints, links, strict=True), start=1):
        q = Expression.symbol(f"q{i}")
        theta = exact_angle(joint.theta)
        if joint.is_revolute:
            rows.append((theta + q, joint.d, a, alpha))
        else:
            rows.append((theta, joint.d + q, a, alpha))
    return tuple(rows)


class _RowReader:
    """Reads exact rows into an arm's ring."""

    def __init__(self, arm: ExactArm) -> None:
        self.ring: Ring = arm.ring
        self.naming = Naming(arm.description, arm.symbols)
        self.joints = {f"q{i + 1}": i for i in range(arm.n)}
        """Numbers of the joints, from 0, by the names of their variables."""

    def link(self, row: Sequence[Expression | None], convention: Convention) -> Elements:
        """Return A_i of a row, shape (4, 4).

        Raises
        ------
        RingError
            An entry that the ring does not have.
        """
        theta, d, a, alpha = (ZERO if entry is None else self.naming.known(entry) for entry in row)
        theta_direction = self.angle(theta)
        alpha_direction = self.angle(alpha)
        unit = (self.ring.zero, self.ring.one)
        entries = link_entries(
            convention, theta_direction, self.length(d), self.length(a), alpha_direction, unit
        )
        return np.array(entries, dtype=object)

    def length(self, length: Expression) -> Element:
        """Return a length, in which variables of prismatic joints may occur.

        Raises
        ------
        RingError
            Another variable in the length, or a constant that the ring does not have.
        """
        ring = self.ring
        terms = []
        for monomial, coefficient in length.terms:
            product = ring.number(coefficient)
            for atom, exponent in monomial:
                joint = self.joints.get(atom.text)
                if joint is None:
                    power = ((atom, exponent),)
                    product = product * ring.read(Expression(((power, Fraction(1)),)))
                elif ring.kinds[joint] != "R" and exponent > 0:
                    product = product * ring.position(joint) ** exponent
                else:
                    raise RingError(f"{atom.text} in a length")
            terms.append(product)
        return ring.sum(terms)

    def angle(self, angle: Expression) -> Direction:
        """Return cosine and sine of an angle: whole multiples of revolute joints' variables, and a constant.

        Raises
        ------
        RingError
            Another angle.
        """
        ring = self.ring
        constants = []
        multiples = []
        for monomial, coefficient in angle.terms:
            joint = self.joints.get(monomial[0][0].text) if len(monomial) == 1 else None
            if joint is None:
                constants.append(Expression(((monomial, coefficient),)))
                continue
            ((atom, exponent),) = monomial
            is_multiple = coefficient.denominator == 1 and abs(coefficient) <= BOUNDS.angle_multiple
            if ring.kinds[joint] != "R" or exponent != 1 or not is_multiple:
                raise RingError(f"{atom.text} in an angle")
            multiples.append(multiple_angle(ring, joint, int(coefficient)))
        constant = ring.direction(exact_angle(Expression.sum(constants)))
        return sum_of_angles(ring, [*multiples, constant])
