"""One entry held against the truth: proved equal, equal within rounding, sampled, or different with a witness."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Sum, Tree
from dhkit.grading.judging.numeric import doubles, many_digits, names_of, parts_of, state_arrays
from dhkit.grading.judging.quotients import OutsideTheRingError, Quotient, Reading, decimals_in
from dhkit.grading.judging.rounding import MOST, Rounding, rounded
from dhkit.grading.judging.sampling import DIGITS, SAMPLES, Sample, checked, differ, element_value, samples, show_state
from dhkit.grading.report import Verdict, Witness
from dhkit.symbolic import ExactArm
from dhkit.symbolic.equations import latex_text, plain_text
from dhkit.symbolic.exact.compact import shortened
from dhkit.symbolic.ring import Element, RingError, element_array

__all__ = ["EXACT", "Comparison", "Finding", "compare", "equal", "names_in", "readable"]

Residuals = Callable[[Quotient, Element], Sequence[Element]]
"""What must be zero for an answer to be right, given the answer and the truth."""
LONGEST = 400
"""Terms of a difference that is written out."""
PROVED = "proved equal, for every state and every value of the parameters"


def EXACT(answer: Quotient, truth: Element) -> Sequence[Element]:
    """Return the difference itself."""
    return [answer.less(truth)]


@dataclass(frozen=True)
class Comparison:
    """How answers are held against the truth.

    Attributes
    ----------
    arm
        The robot in the ring.
    reading
        Reads answers into it.
    digits
        Significant digits from which a decimal may have been rounded.
    numbers
        Parameters that stand for their numbers in the file.
    residuals
        What must be zero.
    """

    arm: ExactArm
    reading: Reading
    digits: int = 4
    numbers: frozenset[str] = frozenset()
    residuals: Residuals = EXACT


@dataclass(frozen=True)
class Finding:
    """What is found of one entry.

    Attributes
    ----------
    verdict, statement, witness
        As in :class:`dhkit.grading.report.Entry`.
    answer
        The answer in the ring; None where it is outside.
    difference
        Answer less truth, an element where the division leaves no remainder.
    """

    verdict: Verdict
    statement: str
    answer: Quotient | None = None
    difference: Element | None = None
    witness: Witness | None = None
    texts: tuple[str | None, str] = field(default=(None, ""))
    """The difference as text and in LaTeX."""


def compare(tree: Tree, truth: Element, by: Comparison) -> Finding:
    """Decide one entry.

    Raises
    ------
    AnswerError
        It has no value, or costs too much work.
    """
    try:
        return _compared(tree, truth, by)
    except (RingError, RecursionError) as error:
        raise AnswerError(f"too long to be judged: {error}"[:200]) from None


def _compared(tree: Tree, truth: Element, by: Comparison) -> Finding:
    try:
        answer = by.reading.read(tree)
    except OutsideTheRingError as reason:
        return _sampled(tree, truth, by, str(reason))
    residuals = by.residuals(answer, truth)
    if all(residual.is_zero for residual in residuals):
        return Finding(Verdict.CORRECT, PROVED, answer)
    rounding = _rounding(tree, truth, by)
    if rounding is not None:
        statement = (
            f"its decimals of {by.digits} digits or more allow the truth: none must move by more than "
            f"{rounding.share:.2f} of half a unit of its last digit"
        )
        return Finding(Verdict.ROUNDED, statement, answer)
    difference = Quotient(answer.less(truth), answer.below).element()
    return Finding(
        Verdict.WRONG,
        "proved different",
        answer,
        difference,
        _witness(tree, truth, by),
        _texts(by.arm, answer, truth, difference),
    )


def equal(tree: Tree, truth: Element, by: Comparison) -> bool:
    """Whether an answer is an element, exactly or within the rounding of its decimals."""
    try:
        if all(residual.is_zero for residual in by.residuals(by.reading.read(tree), truth)):
            return True
        moved = _rounding(tree, truth, by)
    except (OutsideTheRingError, AnswerError, RingError):
        return False
    return moved is not None


def _rounding(tree: Tree, truth: Element, by: Comparison) -> Rounding | None:
    """Return how an answer's decimals must be moved for it to be the truth."""
    units = decimals_in(tree, by.digits)
    if not units or len(units) > MOST:
        return None
    terms = tree.terms if isinstance(tree, Sum) else ((True, tree),)
    owned = [{id(part) for part in parts_of(term, coefficients=True)} & set(units) for _, term in terms]

    def residuals(moves: Mapping[int, Fraction]) -> Sequence[Element]:
        return by.residuals(by.reading.read(tree, moves), truth)

    def slopes(moves: Mapping[int, Fraction]) -> dict[int, Sequence[Element]]:
        """Move one decimal after the other, and read its own term anew."""
        found: dict[int, Sequence[Element]] = {}
        for (added, term), own in zip(terms, owned, strict=True):
            before = by.reading.read(term, moves).above if own else truth
            for at in own:
                change = by.reading.read(term, {**moves, at: moves[at] + units[at]}).above - before
                one = Quotient(truth + (change if added else -change), truth.ring.one)
                found[at] = by.residuals(one, truth)
        return found

    sizes = [sum(1 for _ in parts_of(term)) for _, term in terms]
    if sum(len(own) * size for own, size in zip(owned, sizes, strict=True)) > MAX_READ:
        return None
    apart = sum(map(len, owned)) == len(units) and by.reading.read(tree).below is truth.ring.one
    linear = apart and all(by.reading.read(term).below is truth.ring.one for _, term in terms)
    if not linear and len(units) > MOST_IN_QUOTIENTS:
        return None
    return rounded(residuals, units, slopes if linear else None)


def readable(arm: ExactArm, element: Element) -> Element:
    """Return an element in the angles that make it shortest."""
    return shortened(arm, element_array(element)).item()  # type: ignore[no-any-return]


def _texts(arm: ExactArm, answer: Quotient, truth: Element, difference: Element | None) -> tuple[str | None, str]:
    if difference is not None:
        if len(difference) > LONGEST:
            return plain_text(difference), ""
        short = readable(arm, difference)
        return plain_text(short), latex_text(short)
    above, below = answer.less(truth), answer.below
    if max(len(above), len(below)) > LONGEST:
        return None, ""
    above, below = readable(arm, above), readable(arm, below)
    return f"({plain_text(above)})/({plain_text(below)})", rf"\frac{{{latex_text(above)}}}{{{latex_text(below)}}}"


# Witnesses

MAX_READ = 50_000
"""Nodes that are read to see what each decimal changes: seconds."""
MOST_IN_QUOTIENTS = 40
"""Decimals of an answer that has to be read as a whole for each of them."""
MAX_NODES = 20_000
MAX_EVALUATIONS = 600_000
"""Nodes times states: seconds."""
TRIED = 24
GROUP = 100
"""States that share parameters where an energy's zero is free."""


def _witness(tree: Tree, truth: Element, by: Comparison) -> Witness | None:
    """Return a state of short numbers, parameters as in the file, in which both differ most."""
    arm, rng = by.arm, np.random.default_rng(7)
    best: tuple[float, Witness] | None = None
    used = names_of(tree) | names_in(truth)
    for k in range(TRIED):
        state = {
            f"{kind}{i + 1}": float(np.round(rng.uniform(-1.5, 1.5), 1))
            for kind in ("q", "qd", "qdd")
            for i in range(arm.n)
        }
        parameters = dict(arm.parameters)
        if k >= TRIED // 2:
            parameters |= {p: float(np.round(v * rng.uniform(0.5, 2.0), 3)) for p, v in parameters.items()}
        value = float(doubles(tree, {**parameters, **state}))
        values = arm.ring.values({**arm.values, **parameters}, *state_arrays(state, arm.n))
        right = float(truth.value(values))
        gap = abs(value - right) if np.isfinite(value) else float("inf")
        if best is None or gap > 1.5 * best[0]:
            shown = {name: x for name, x in {**state, **parameters}.items() if name in used}
            best = (gap, Witness(shown, value if np.isfinite(value) else None, right))
        if k >= 5 and best[0] > 1e-6 * max(1.0, abs(right)):
            break
    return best[1] if best else None


def names_in(element: Element) -> set[str]:
    """Return the names of joint variables and constants that an element depends on."""
    names: set[str] = set()
    for monomial in element.terms:
        for k, exponent in enumerate(monomial):
            if exponent:
                generator = element.ring.generators[k]
                names |= {f"q{j + 1}" for j in generator.joints} if generator.joints else {generator.text}
    return names


# Outside the ring


def _sampled(tree: Tree, truth: Element, by: Comparison, reason: str) -> Finding:
    """Hold an answer against the truth at many states, each in fifty digits."""
    import mpmath

    energy = by.residuals is not EXACT
    nodes = sum(1 for _ in parts_of(tree)) + len(truth)
    if nodes > MAX_NODES:
        raise AnswerError(f"outside the exact ring ({reason}), and too long to be tried: {nodes} terms and factors")
    with mpmath.workdps(DIGITS):
        count = min(SAMPLES, MAX_EVALUATIONS // nodes)
        states = samples(by.arm, by.numbers, every=GROUP if energy else 1, count=count)
        used = names_of(tree) | names_in(truth)
        shift: Any = 0
        for k, state in enumerate(states):
            right = element_value(truth, state)
            try:
                value = checked(many_digits(tree, state.names))
            except AnswerError as error:
                return _different(state, used, None, right, f"{error} there")
            if energy and k % GROUP == 0:
                shift = value - right  # energies count from any zero
            if differ(value - shift, right):
                return _different(state, used, value - shift, right, f"outside the exact ring ({reason})")
    return Finding(
        Verdict.UNDECIDED,
        f"not proved, since it is outside the exact ring ({reason}); equal to the truth at {len(states)} random states "
        "in 50 digits, to 25 of them",
    )


def _different(state: Sample, used: set[str], value: Any, right: Any, why: str) -> Finding:
    witness = Witness(show_state(state, used), None if value is None else float(value), float(right))
    return Finding(Verdict.WRONG, f"a state shows it: {why}", witness=witness)
