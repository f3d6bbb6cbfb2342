"""One entry held against the truth: proved equal, equal within rounding, sampled, or different with a witness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Number, Sum, Tree
from dhkit.grading.judging.enclosures import LostDigitsError, TooLargeError, enclosed
from dhkit.grading.judging.numeric import doubles, names_of, parts_of, state_arrays
from dhkit.grading.judging.quotients import OutsideTheRingError, Quotient, Reading
from dhkit.grading.judging.rounding import Residuals, rounding_share
from dhkit.grading.judging.sampling import (
    DIGITS,
    LEAST,
    SAMPLES,
    TOLERANCE,
    Sample,
    differ,
    element_value,
    samples,
    show_state,
)
from dhkit.grading.report import Verdict, Witness
from dhkit.symbolic import ExactArm
from dhkit.symbolic.equations import latex_text, plain_text
from dhkit.symbolic.exact.compact import shortened
from dhkit.symbolic.ring import Element, RingError, element_array

MAX_WRITTEN_TERMS = 400
"""Terms of a difference that is written out."""
MAX_DIVISORS = 3
"""Divisors that a statement names."""
PROVED = "proved equal"
ALWAYS = ", for every state and every value of the parameters"


def EXACT(answer: Quotient, truth: Element) -> Sequence[Element]:
    """Return the difference itself."""
    return [answer.numerator_of_difference(truth)]


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
    seed
        Of the random states that answers outside the ring are tried at.
    up_to_constant
        Whether answers outside the ring may be off by a constant; None where they cannot be tried.
    """

    arm: ExactArm
    reading: Reading
    digits: int = 4
    numbers: frozenset[str] = frozenset()
    residuals: Residuals = EXACT
    seed: int = 0
    up_to_constant: bool | None = False

    @property
    def place(self) -> str:
        """At which parameter values a verdict holds, in words; empty where it holds for all."""
        values = self.arm.parameters
        listed = ", ".join(f"{name} = {values[name]:g}" for name in sorted(self.numbers))
        return f" at {listed}" if listed else ""


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
    divisors = list(by.reading.divisors)
    try:
        is_equal = all(residual.is_zero for residual in by.residuals(answer, truth))
    except RingError:
        return _sampled(tree, truth, by, "it multiplies out to too many terms")
    if is_equal:
        return Finding(Verdict.CORRECT, _proved(by, divisors), answer)
    share = rounding_share(tree, truth, by.reading, by.residuals, by.digits)
    if share is not None:
        statement = (
            f"equal within rounding{by.place}: each coefficient is off by at most {max(share, 0.01):.2f} of half a "
            f"unit in the last place of its coarsest decimal of {by.digits} digits or more"
        )
        return Finding(Verdict.ROUNDED, statement, answer)
    difference = Quotient(answer.numerator_of_difference(truth), answer.denominator).element()
    return Finding(
        Verdict.WRONG,
        "proved different",
        answer,
        difference,
        _witness(tree, truth, by),
        _texts(by.arm, answer, truth, difference),
    )


def _proved(by: Comparison, divisors: Sequence[Element]) -> str:
    """Say for which states an answer is proved: where it divides by zero it has no value."""
    held = by.place or ALWAYS
    if not divisors:
        return f"{PROVED}{held}{', for every state' if by.place else ''}"
    shown = [plain_text(readable(by.arm, one)) for one in divisors[:MAX_DIVISORS] if len(one) <= MAX_WRITTEN_TERMS]
    more = " or another divisor is 0" if len(shown) < len(divisors) else ""
    where = " or ".join(f"{text} = 0" for text in shown) + more
    return f"{PROVED}{by.place} wherever the answer is defined: it has no value where {where}"


def equal(tree: Tree, truth: Element, by: Comparison) -> bool:
    """Whether an answer is an element, exactly or within the rounding of its decimals."""
    try:
        if all(residual.is_zero for residual in by.residuals(by.reading.read(tree), truth)):
            return True
        return rounding_share(tree, truth, by.reading, by.residuals, by.digits) is not None
    except (OutsideTheRingError, AnswerError, RingError):
        return False


def readable(arm: ExactArm, element: Element) -> Element:
    """Return an element in the angles that make it shortest."""
    return shortened(arm, element_array(element)).item()  # type: ignore[no-any-return]


def _texts(arm: ExactArm, answer: Quotient, truth: Element, difference: Element | None) -> tuple[str | None, str]:
    if difference is not None:
        if len(difference) > MAX_WRITTEN_TERMS:
            return plain_text(difference), ""
        short = readable(arm, difference)
        return plain_text(short), latex_text(short)
    numerator, denominator = answer.numerator_of_difference(truth), answer.denominator
    if max(len(numerator), len(denominator)) > MAX_WRITTEN_TERMS:
        return None, ""
    numerator, denominator = readable(arm, numerator), readable(arm, denominator)
    return (
        f"({plain_text(numerator)})/({plain_text(denominator)})",
        rf"\frac{{{latex_text(numerator)}}}{{{latex_text(denominator)}}}",
    )


# Witnesses

MAX_NODES = 20_000
MAX_EVALUATIONS = 300_000
"""Nodes times states that an answer outside the ring is evaluated at."""
MAX_WORK = 60 * MAX_EVALUATIONS
"""Nodes times digits, of all states together."""
LEAST_STATES = 15
"""An answer too long to be evaluated at so many states cannot be judged."""
TRIED = 24
GROUP = 5
"""States that share parameters where an energy's zero is free: the first of them sets it, the others are compared.

Few, for many sets of parameters: a difference may be there in a part of their range alone.
"""


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
    """Hold an answer against the truth at many states, each to 25 digits."""
    import mpmath

    nodes = sum(1 for _ in parts_of(tree)) + len(truth)
    if by.up_to_constant is None:
        raise AnswerError(f"outside the exact ring ({reason}), where L is not judged up to a total derivative")
    if nodes > MAX_NODES:
        raise AnswerError(f"outside the exact ring ({reason}), and too long to be tried: {nodes} terms and factors")
    with mpmath.workdps(DIGITS):
        count = max(LEAST_STATES, min(SAMPLES, MAX_EVALUATIONS // nodes))
        states = samples(by.arm, by.numbers, by.seed, every=GROUP if by.up_to_constant else 1, count=count)
        try:
            found = _first_difference(tree, nodes, truth, by, reason, states)
        except (TooLargeError, LostDigitsError) as error:
            raise AnswerError(f"outside the exact ring ({reason}), and {error}") from None
    if isinstance(found, Finding):
        return found
    return Finding(
        Verdict.UNDECIDED,
        f"not proved, since it is outside the exact ring ({reason}); equal to the truth{by.place} at {found} random "
        "states, to 25 digits",
    )


def _divided(tree: Tree, constants: set[str]) -> tuple[Tree, list[Tree]]:
    """Return a sum without its terms that do not depend on the state, and these."""
    if names_of(tree) <= constants:
        return Number(Fraction(0), "0", 0), [tree]
    if not isinstance(tree, Sum):
        return tree, []
    kept: list[tuple[bool, Tree]] = []
    left_out: list[Tree] = []
    for added, term in tree.terms:
        varying, still = _divided(term, constants)
        left_out += still
        if not (isinstance(varying, Number) and not varying.value):
            kept.append((added, varying))
    return Sum(tuple(kept)), left_out


def _first_difference(
    tree: Tree, nodes: int, truth: Element, by: Comparison, reason: str, states: Sequence[Sample]
) -> Finding | int:
    """Return what the first state shows at which an answer differs from the truth; at how many it does not, if none."""
    used = names_of(tree) | names_in(truth)
    shift: Any = 0
    work, constants = 0, list[Tree]()
    if by.up_to_constant:  # energies count from any zero, however large, if it is a number at all
        tree, constants = _divided(tree, {*by.arm.parameters, *CONSTANTS})
    for k, state in enumerate(states):
        right = element_value(truth, state)
        try:
            for constant in constants if k % GROUP == 0 else ():
                enclosed(constant, nodes, state.names, LEAST)
            tolerance = TOLERANCE / 10 * max(abs(right), LEAST)
            value, digits = enclosed(tree, nodes, state.names, tolerance, shares=not by.up_to_constant)
        except (TooLargeError, LostDigitsError):
            raise
        except AnswerError as error:
            return _different(state, used, None, right, f"{error} there")
        if by.up_to_constant and k % GROUP == 0:
            shift = value - right
        if differ(value - shift, right):
            return _different(state, used, value - shift, right, f"outside the exact ring ({reason})")
        work += nodes * digits
        if work > MAX_WORK and k + 1 >= LEAST_STATES:
            return k + 1
    return len(states)


def _different(state: Sample, used: set[str], value: Any, right: Any, why: str) -> Finding:
    witness = Witness(show_state(state, used), _finite(value), _finite(right))
    return Finding(Verdict.WRONG, f"a state shows it: {why}", witness=witness)


def _finite(value: Any) -> float | None:
    number = float("nan") if value is None else float(value)
    return number if np.isfinite(number) else None
