"""A table row by row: each A_i against the file's, in the exact ring and, outside it, in doubles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from dhkit.description import Convention, Description
from dhkit.errors import AnswerError, ExpressionError
from dhkit.expressions import CONSTANTS, ZERO, Expression, exact_angle
from dhkit.expressions.budget import budgeted
from dhkit.expressions.parser import value_of
from dhkit.expressions.syntax import Tree
from dhkit.grading.judging.numeric import doubles, names_of
from dhkit.grading.judging.same_arm import STATES
from dhkit.grading.judging.table_arms import (
    ROUNDING,
    Row,
    link_in_doubles,
    number_of,
    parameter_values,
    row_numbers,
)
from dhkit.grading.report import Verdict
from dhkit.symbolic import Element, Elements, ExactArm, RingError, exact_arm
from dhkit.symbolic.exact.naming import Naming
from dhkit.symbolic.ring import Direction, Ring
from dhkit.symbolic.textbook_kinematics import with_massless_links

MOST = 8
"""The largest multiple of a joint variable in an angle that is compared exactly."""
COLUMNS = ("theta", "d", "a", "alpha")


@dataclass(frozen=True, eq=False)
class Answer:
    """The rows that were handed in.

    Attributes
    ----------
    trees
        A row a joint: theta, d, a, alpha.
    entries
        The same exactly; None where an entry is outside exact arithmetic.
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
            raise AnswerError(f"dh: {len(rows)} row{'s' * (len(rows) != 1)}; expected {n}, one a joint")
        names = [*(f"q{i + 1}" for i in range(n)), *description.parameters]
        for i, row in enumerate(rows, start=1):
            if len(row) != len(COLUMNS):
                raise AnswerError(f"dh, row {i}: {len(row)} entries; expected {', '.join(COLUMNS)}")
        listed = tuple(
            tuple(_entry(tree, names, f"dh, row {i}, {column}") for tree, column in zip(row, COLUMNS, strict=True))
            for i, row in enumerate(rows, start=1)
        )
        return cls(tuple(tuple(row) for row in rows), listed)


def _entry(tree: Tree, names: Sequence[str], where: str) -> Expression | None:
    """Return an entry's exact value, None where it has none."""
    for name in sorted(names_of(tree) - {*names, *CONSTANTS}):
        raise AnswerError(f"{where}: unknown name {name!r}; expected {', '.join([*names, 'pi', 'deg'])}")
    try:
        with budgeted():
            return value_of(tree, names)
    except ExpressionError:
        doubles(tree, dict.fromkeys([*names, *CONSTANTS], 1.0))
        return None


@dataclass(frozen=True)
class JudgedRow:
    """What is found of a row, and the names that its numbers stand for."""

    verdict: Verdict
    statement: str
    numbers: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class TableRows:
    """The rows of an answer beside the file's.

    Attributes
    ----------
    description
        The robot.
    answer
        The rows that were handed in.
    convention
        What the answer says that its table is.
    seed
        Of the random states that entries outside the exact ring are tried at.
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
        """Judge A_i, i from 0."""
        entries = self.answer.entries[i]
        if None not in entries:
            if self.proved(i, numbers=False):
                return JudgedRow(Verdict.CORRECT, f"A{i + 1} is proved")
            if self.has_numbers(i) and self.proved(i, numbers=True):
                used = frozenset().union(*(entry.symbols for entry in self.reference[i]))
                return JudgedRow(Verdict.CORRECT, f"A{i + 1} is proved with the file's numbers", used)
        if self.agrees(i):
            statement = f"A{i + 1} agrees at {STATES} random states to {ROUNDING:g}, without a proof"
            return JudgedRow(Verdict.UNDECIDED, statement)
        return JudgedRow(Verdict.WRONG, f"A{i + 1} differs")

    def has_numbers(self, i: int) -> bool:
        """Whether row i has numbers where the file has parameters."""
        parameters = set(self.description.parameters)
        given = set().union(*(entry.symbols for entry in self.answer.entries[i] if entry is not None))
        return not given & parameters and any(entry.symbols & parameters for entry in self.reference[i])

    def proved(self, i: int, numbers: bool) -> bool:
        """Return whether A_i equals the file's in the exact ring."""
        reader = self.readers[numbers]
        try:
            A = reader.link(self.answer.entries[i], self.convention)
            return bool((reader.link(self.reference[i], self.convention) == A).all())
        except (RingError, ExpressionError):
            return False

    def agrees(self, i: int) -> bool:
        """Return whether A_i agrees with the file's in doubles, for other values of the parameters as well."""
        fixed = {name: self.states[0][name] for name in self.description.parameters} if self.has_numbers(i) else {}
        for state in self.states:
            values = state | fixed
            entries = row_numbers(self.answer.trees[i], values)
            if not np.all(np.isfinite(entries)):
                return False
            answer = link_in_doubles(self.convention, *entries)
            truth = link_in_doubles(self.convention, *(number_of(entry, values) for entry in self.reference[i]))
            if not np.max(np.abs(answer - truth)) <= ROUNDING * max(1.0, float(np.max(np.abs(truth)))):
                return False
        return True

    @cached_property
    def reference(self) -> tuple[Row, ...]:
        """The file's table in the convention of the answer."""
        return _file_rows(self.description, self.convention)

    @cached_property
    def readers(self) -> tuple[_Reader, _Reader]:
        """Into the ring with the file's parameters, and into the one with its numbers."""
        whole = with_massless_links(self.description)
        return _Reader(exact_arm(whole, "file")), _Reader(exact_arm(whole, "none"))

    @cached_property
    def states(self) -> list[dict[str, float]]:
        """Values of joint variables, parameters and units; the first with the file's parameters."""
        random = np.random.default_rng(self.seed)
        states = []
        for k in range(STATES):
            q = random.uniform(-3, 3, self.n)
            factors = 4.0 ** ((k > 0) * random.uniform(-1, 1, len(self.description.parameters)))
            states.append(
                parameter_values(self.description, factors) | {f"q{i + 1}": float(x) for i, x in enumerate(q)}
            )
        return states

    def equal(self, i: int, column: int, truth: Expression) -> bool:
        """Return whether an entry of row i is this, angles up to full turns, numbers in place of parameters allowed."""
        given = self.answer.entries[i][column]
        if given is None:
            return False
        naming = self.readers[self.has_numbers(i)].naming
        difference = naming.known(given) - naming.known(truth)
        if COLUMNS[column] in ("d", "a"):
            return difference.is_zero
        turns = exact_angle(difference).half_turns
        return turns is not None and turns % 2 == 0


def other_convention(convention: Convention) -> Convention:
    """Return the convention that this one is not."""
    return Convention.MODIFIED if convention is Convention.STANDARD else Convention.STANDARD


def _file_rows(description: Description, convention: Convention) -> tuple[Row, ...]:
    """Return the file's table, a and alpha moved to the neighbouring row where the convention is the other."""
    joints = description.joints
    links = [(joint.a, exact_angle(joint.alpha)) for joint in joints]
    if convention is not description.convention:
        links = [*links[1:], (ZERO, ZERO)] if convention is Convention.STANDARD else [(ZERO, ZERO), *links[:-1]]
    rows: list[Row] = []
    for i, (joint, (a, alpha)) in enumerate(zip(joints, links, strict=True), start=1):
        q, theta = Expression.symbol(f"q{i}"), exact_angle(joint.theta)
        rows.append((theta + q, joint.d, a, alpha) if joint.is_revolute else (theta, joint.d + q, a, alpha))
    return tuple(rows)


class _Reader:
    """Reads rows into an arm's ring."""

    def __init__(self, arm: ExactArm) -> None:
        self.ring: Ring = arm.ring
        self.naming = Naming(arm.description, arm.symbols)
        self.joints = {f"q{i + 1}": i for i in range(arm.n)}

    def link(self, row: Sequence[Expression | None], convention: Convention) -> Elements:
        """Return A_i of a row, shape (4, 4).

        Raises
        ------
        RingError
            An entry that the ring has not.
        """
        theta, d, a, alpha = (ZERO if entry is None else self.naming.known(entry) for entry in row)
        ring, (c, s), (ca, sa) = self.ring, self.angle(theta), self.angle(alpha)
        a_, d_, o = self.length(a), self.length(d), self.ring.zero
        if convention is Convention.STANDARD:
            A = [[c, -s * ca, s * sa, a_ * c], [s, c * ca, -c * sa, a_ * s], [o, sa, ca, d_]]
        else:
            A = [[c, -s, o, a_], [s * ca, c * ca, -sa, -sa * d_], [s * sa, c * sa, ca, ca * d_]]
        return np.array([*A, [o, o, o, ring.one]], dtype=object)

    def length(self, length: Expression) -> Element:
        """Return a length, which may hold the variables of sliding joints."""
        ring, total = self.ring, []
        for monomial, coefficient in length.terms:
            product = ring.number(coefficient)
            for atom, exponent in monomial:
                joint = self.joints.get(atom.text)
                if joint is None:
                    product = product * ring.read(Expression(((((atom, exponent),), Fraction(1)),)))
                elif ring.kinds[joint] != "R" and exponent > 0:
                    product = product * ring.position(joint) ** exponent
                else:
                    raise RingError(f"{atom.text} in a length")
            total.append(product)
        return ring.sum(total)

    def angle(self, angle: Expression) -> Direction:
        """Return cosine and sine of whole multiples of turning joints' variables and a constant."""
        ring = self.ring
        c, s = ring.one, ring.zero
        constant = []
        for monomial, coefficient in angle.terms:
            joint = self.joints.get(monomial[0][0].text) if monomial and len(monomial) == 1 else None
            if joint is None:
                constant.append(Expression(((monomial, coefficient),)))
                continue
            whole = coefficient.denominator == 1 and abs(coefficient) <= MOST
            if ring.kinds[joint] != "R" or monomial[0][1] != 1 or not whole:
                raise RingError(f"{monomial[0][0].text} in an angle")
            x, y = ring.cosine(joint), ring.sine(joint) * (1 if coefficient > 0 else -1)
            for _ in range(int(abs(coefficient))):
                c, s = c * x - s * y, s * x + c * y
        x, y = ring.direction(exact_angle(Expression.sum(constant)))
        return c * x - s * y, s * x + c * y
