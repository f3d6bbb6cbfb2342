"""Judging a Denavit-Hartenberg table: the same arm in the same frames, in other frames, or another arm.

Same frames is decided exactly: every A_i of the answer equals the file's in the ring. A table of the other convention
is held against the file's table rewritten in it, which is exact too: Rz Tz and Tx Rx only change partners. Whether two
tables are one arm in different frames is numerical, to 1e-9: their joint axes are laid over one another.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import combinations

import numpy as np

from dhkit.description import Convention, Description
from dhkit.errors import AnswerError, ExpressionError
from dhkit.expressions import CONSTANTS, PI, ZERO, Expression, exact_angle, substitute
from dhkit.expressions.budget import budgeted
from dhkit.expressions.parser import value_of
from dhkit.expressions.syntax import Tree
from dhkit.grading.judging.numeric import doubles, names_of
from dhkit.grading.judging.same_arm import STATES, Overlay, overlaid
from dhkit.grading.judging.table_arms import (
    ROUNDING,
    Row,
    TableArm,
    link_in_doubles,
    number_of,
    parameter_values,
    row_numbers,
)
from dhkit.grading.mistakes.library import LIBRARY
from dhkit.grading.report import Note, NoteKind, Verdict
from dhkit.symbolic import Element, Elements, ExactArm, RingError, exact_arm
from dhkit.symbolic.exact.naming import Naming
from dhkit.symbolic.ring import Direction, Ring
from dhkit.symbolic.textbook_kinematics import with_massless_links

__all__ = ["TableExplanation", "TableJudgement", "judge_table"]

MOST = 8
"""The largest multiple of a joint variable in an angle that is compared exactly."""
COLUMNS = ("theta", "d", "a", "alpha")


@dataclass(frozen=True)
class TableExplanation:
    """What went wrong in a table.

    Attributes
    ----------
    mistake
        The identity of a mistake of the library; None where the entries are only described.
    sentence
        What a student learns from it.
    row
        Which row, from 0; None where the whole table is meant.
    """

    mistake: str | None
    sentence: str
    row: int | None = None


@dataclass(frozen=True)
class TableJudgement:
    """What is decided of a table.

    Attributes
    ----------
    rows
        A verdict a row. CORRECT is proved: A_i equals the file's. UNDECIDED: A_i agrees in doubles but is outside the
        exact ring, or the whole table is the same arm in other frames, which is numerical.
    statements
        Why, in a line a row.
    explanations
        What would explain the rows that are not proved.
    other_frames
        How frames and joint variables differ from the file's where the table is the same arm in other frames; empty
        otherwise.
    notes
        What a reader should know: the other convention.
    judged_at
        Values of the parameters that rows hold as numbers.
    moves_zero
        Whether, in other frames, a joint variable counts from another zero or the other way round.
    moved_rows
        Rows, from 0, that are undecided because the whole table is the same arm in other frames.
    """

    rows: tuple[Verdict, ...]
    statements: tuple[str, ...]
    explanations: tuple[TableExplanation, ...] = ()
    other_frames: tuple[str, ...] = ()
    notes: tuple[Note, ...] = ()
    judged_at: Mapping[str, float] = field(default_factory=dict)
    moves_zero: bool = False
    moved_rows: tuple[int, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The worst of the rows."""
        return max(self.rows, key=lambda verdict: verdict.severity)

    def is_in_other_frames(self, i: int) -> bool:
        """Whether row i, from 0, is undecided because the whole table is the same arm in other frames."""
        return i in self.moved_rows


def judge_table(
    description: Description, rows: Sequence[Sequence[Tree]], convention: Convention | str, seed: int = 0
) -> TableJudgement:
    """Judge a table against a robot's.

    Parameters
    ----------
    description
        The robot; links may lack bodies.
    rows
        One a joint: theta, d, a, alpha (modified: theta_i, d_i, a_(i-1), alpha_(i-1)), in metres and radians, of the
        joint variables q1 ... qn, the robot's parameters, pi, deg, mm, cm and inch.
    convention
        What the answer says that its table is.
    seed
        Of the random states that entries outside the exact ring are tried at.

    Raises
    ------
    AnswerError
        Another number of rows or columns, an unknown name or function.
    ValueError
        No such convention.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.expressions import read
    >>> rows = [[read(entry) for entry in row] for row in (("q1", "0", "l1", "0"), ("q2", "l2", "0", "0"))]
    >>> judgement = judge_table(library_robot("planar2r"), rows, "standard")
    >>> [verdict.value for verdict in judgement.rows], judgement.explanations[0].mistake
    (['correct', 'wrong'], 'a_d_exchanged')
    """
    judge = _Judge(description, _Answer.of(description, rows), Convention(convention), seed)
    with np.errstate(all="ignore"):
        return judge.judgement()


@dataclass(frozen=True, eq=False)
class _Answer:
    """The rows that were handed in."""

    trees: tuple[tuple[Tree, ...], ...]
    entries: tuple[tuple[Expression | None, ...], ...]
    """None where an entry is outside exact arithmetic."""

    @classmethod
    def of(cls, description: Description, rows: Sequence[Sequence[Tree]]) -> _Answer:
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
class _JudgedRow:
    """What is found of a row, and the names that its numbers stand for."""

    verdict: Verdict
    statement: str
    numbers: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class _Judge:
    """One table against the file's."""

    description: Description
    answer: _Answer
    convention: Convention
    seed: int = 0

    @property
    def n(self) -> int:
        return self.description.n

    @property
    def converted(self) -> bool:
        """Whether the answer is in another convention than the file."""
        return self.convention is not self.description.convention

    def judgement(self) -> TableJudgement:
        judged = [self.row(i) for i in range(self.n)]
        verdicts, statements = tuple(row.verdict for row in judged), tuple(row.statement for row in judged)
        in_numbers = frozenset().union(*(row.numbers for row in judged))
        at = {name: self.states[0][name] for name in self.description.parameters if name in in_numbers}
        notes: tuple[Note, ...] = ()
        if self.converted:
            conventions = (self.description.convention.value, self.convention.value)
            notes = (Note(NoteKind.OTHER_CONVENTION, "dh", conventions),)
        wrong = [i for i in range(self.n) if verdicts[i] is Verdict.WRONG]
        if not wrong:
            return TableJudgement(verdicts, statements, notes=notes, judged_at=at)
        explanations = self.explanations(wrong)
        overlay = self.overlay()
        # Without words all frames are the file's, within 1e-9: a number is off by less, which is another arm's.
        if overlay and (words := overlay.words()):
            said = "the same arm in other frames, numerically"
            statements = tuple(said if i in wrong else s for i, s in enumerate(statements))
            verdicts = tuple(Verdict.UNDECIDED if i in wrong else v for i, v in enumerate(verdicts))
            likely = _likely(explanations)
            return TableJudgement(verdicts, statements, likely, words, notes, at, overlay.moves_zero, tuple(wrong))
        if self.is_table_of_other_convention():
            sentence = LIBRARY["other_convention"].sentence
            other = _other(self.convention).value
            said = f"{sentence}; it is the {other} one, and was handed in as {self.convention.value}"
            explanations = (TableExplanation("other_convention", said),)
        return TableJudgement(verdicts, statements, explanations, notes=notes, judged_at=at)

    # One row

    def row(self, i: int) -> _JudgedRow:
        """Judge A_i, i from 0."""
        entries = self.answer.entries[i]
        if None not in entries:
            if self.proved(i, numbers=False):
                return _JudgedRow(Verdict.CORRECT, f"A{i + 1} is proved")
            if self.has_numbers(i) and self.proved(i, numbers=True):
                used = frozenset().union(*(entry.symbols for entry in self.reference.rows[i]))
                return _JudgedRow(Verdict.CORRECT, f"A{i + 1} is proved with the file's numbers", used)
        if self.agrees(i):
            statement = f"A{i + 1} agrees at {STATES} random states to {ROUNDING:g}, without a proof"
            return _JudgedRow(Verdict.UNDECIDED, statement)
        return _JudgedRow(Verdict.WRONG, f"A{i + 1} differs")

    def has_numbers(self, i: int) -> bool:
        """Whether row i has numbers where the file has parameters."""
        parameters = set(self.description.parameters)
        given = set().union(*(entry.symbols for entry in self.answer.entries[i] if entry is not None))
        return not given & parameters and any(entry.symbols & parameters for entry in self.reference.rows[i])

    def proved(self, i: int, numbers: bool) -> bool:
        """Return whether A_i equals the file's in the exact ring."""
        reader = self.readers[numbers]
        try:
            A = reader.link(self.answer.entries[i], self.convention)
            return bool((reader.link(self.reference.rows[i], self.convention) == A).all())
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
            truth = link_in_doubles(self.convention, *(number_of(entry, values) for entry in self.reference.rows[i]))
            if not np.max(np.abs(answer - truth)) <= ROUNDING * max(1.0, float(np.max(np.abs(truth)))):
                return False
        return True

    @cached_property
    def reference(self) -> _Reference:
        """The file's table in the convention of the answer."""
        return _Reference.of(self.description, self.convention)

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

    # The whole arm

    def overlay(self) -> Overlay | None:
        """Return how the frames lie on the file's where the table is the same arm; None where it is another arm."""
        strict = not self.converted
        found: Overlay | None = None
        symbolic = self.description.parameters and not any(self.has_numbers(i) for i in range(self.n))
        for values in self.states[: 2 if symbolic else 1]:
            answer = TableArm.of_trees(self.answer.trees, self.description.kinds, self.convention, values)
            truth = TableArm.of_rows(self.reference.rows, self.description.kinds, self.convention, values)
            overlay = None if answer is None else overlaid(answer, truth, strict)
            if overlay is None:
                return None
            found = found if found is not None and found.words() else overlay
        return found

    def is_table_of_other_convention(self) -> bool:
        """Return whether the rows, read in the other convention, are this arm."""
        other = replace(self, convention=_other(self.convention))
        return all(other.row(i).verdict is Verdict.CORRECT for i in range(self.n)) or other.overlay() is not None

    # What went wrong

    def explanations(self, rows: Sequence[int]) -> tuple[TableExplanation, ...]:
        found = []
        left = list(rows)
        for i, j in combinations(rows, 2):
            if i in left and j in left and self.matches(i, j) and self.matches(j, i):
                left = [k for k in left if k not in (i, j)]
                sentence = f"rows {i + 1} and {j + 1} are exchanged"
                found += [TableExplanation("rows_exchanged", sentence, k) for k in (i, j)]
        for i in left:
            if None not in self.answer.entries[i]:
                found += list(self.explained(i))
        return tuple(sorted(found, key=lambda explanation: explanation.row or 0))

    def matches(self, i: int, j: int) -> bool:
        """Return whether row i of the answer is row j of the file, with row i's joint variable or row j's."""
        own = {f"q{j + 1}": Expression.symbol(f"q{i + 1}")}
        moved = tuple(substitute(entry, own) for entry in self.reference.rows[j])
        return any(
            all(self.equal(i, column, row[column]) for column in range(4)) for row in (moved, self.reference.rows[j])
        )

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

    def explained(self, i: int) -> Iterator[TableExplanation]:
        """Yield what explains row i: a mistake of the whole row, or one an entry."""
        theta, d, a, alpha = self.reference.rows[i]
        q = Expression.symbol(f"q{i + 1}")
        turning = self.description.kinds[i] == "R"
        exchanged = (theta, a, d, alpha) if turning else (theta, a + q, d - q, alpha)
        column = (theta - q, d + q, a, alpha) if turning else (theta + q, d - q, a, alpha)
        for name, row in (("a_d_exchanged", exchanged), ("variable_column", column)):
            if all(self.equal(i, k, entry) for k, entry in enumerate(row)):
                yield TableExplanation(name, LIBRARY[name].sentence, i)
                return
        for k, truth in enumerate(self.reference.rows[i]):
            if not self.equal(i, k, truth):
                yield self.explained_entry(i, k, truth)

    def explained_entry(self, i: int, k: int, truth: Expression) -> TableExplanation:
        given = self.answer.entries[i][k]
        subject = f"row {i + 1}: {COLUMNS[k]} is {given}"
        for name, entry in self.wrong_entries(i, k, truth):
            if self.equal(i, k, entry):
                return TableExplanation(name, f"{subject}: {LIBRARY[name].sentence}", i)
        name = {"theta": "wrong_theta", "alpha": "wrong_twist"}.get(COLUMNS[k], "wrong_length")
        return TableExplanation(name, f"{subject}: {LIBRARY[name].sentence}", i)

    def wrong_entries(self, i: int, k: int, truth: Expression) -> Iterator[tuple[str, Expression]]:
        """Yield what an entry would be with each mistake."""
        own = COLUMNS[k] == ("theta" if self.description.kinds[i] == "R" else "d")
        q = Expression.symbol(f"q{i + 1}") if own else ZERO
        offset = truth - q
        if own:
            yield "variable_forgotten", offset
            for j in range(self.n):
                yield "variable_of_another_joint", offset + Expression.symbol(f"q{j + 1}")
        if COLUMNS[k] in ("d", "a"):
            yield "length_sign", q - offset
            yield f"{COLUMNS[k]}_forgotten", q
            yield "millimetres_for_metres", q + offset * 1000
            return
        yield "degrees_for_radians", q + offset * 180 / PI
        if COLUMNS[k] == "alpha":
            yield "alpha_sign", -truth
            yield "alpha_forgotten", ZERO
            return
        yield "theta_offset_forgotten", q
        yield "theta_offset_sign", q - offset
        yield "theta_sign", -truth


def _likely(explanations: tuple[TableExplanation, ...]) -> tuple[TableExplanation, ...]:
    """Return what may explain a table that is right in other frames: one slip with a name; several are a choice."""
    one = len(explanations) == 1 and not str(explanations[0].mistake).startswith("wrong_")
    return explanations if one else ()


def _other(convention: Convention) -> Convention:
    return Convention.MODIFIED if convention is Convention.STANDARD else Convention.STANDARD


@dataclass(frozen=True, eq=False)
class _Reference:
    """The file's table in one of the conventions."""

    rows: tuple[Row, ...]

    @classmethod
    def of(cls, description: Description, convention: Convention) -> _Reference:
        """Read the file's table, with a and alpha moved to the neighbouring row where the convention is the other."""
        joints = description.joints
        links = [(joint.a, exact_angle(joint.alpha)) for joint in joints]
        if convention is not description.convention:
            links = [*links[1:], (ZERO, ZERO)] if convention is Convention.STANDARD else [(ZERO, ZERO), *links[:-1]]
        rows: list[Row] = []
        for i, (joint, (a, alpha)) in enumerate(zip(joints, links, strict=True), start=1):
            q, theta = Expression.symbol(f"q{i}"), exact_angle(joint.theta)
            rows.append((theta + q, joint.d, a, alpha) if joint.is_revolute else (theta, joint.d + q, a, alpha))
        return cls(tuple(rows))


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
