"""Comparison of one entry with the truth: proved equal, equal within rounding, sampled, or different with a witness."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Number, Sum, Tree
from dhkit.expressions.trees import names_of, parts_of
from dhkit.grading.grade_report import Verdict, Witness
from dhkit.grading.judging import sampling
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.enclosures import LostDigitsError, TooLargeError, enclosed
from dhkit.grading.judging.numeric import doubles, state_arrays
from dhkit.grading.judging.quotients import OutsideTheRingError, Quotient, RingReader
from dhkit.grading.judging.rounding import Residuals, rounding_share
from dhkit.symbolic import ExactArm
from dhkit.symbolic.equations import latex_text, plain_text
from dhkit.symbolic.exact.compact import shortened
from dhkit.symbolic.ring import Element, RingError, element_array

_MAX_NAMED_DIVISORS = 3
"""Largest number of divisors that a statement names."""
_PROVED = "proved equal"


def exact_difference(answer: Quotient, truth: Element) -> Sequence[Element]:
    """Return the numerator of the difference: the residual of quantities that are determined exactly."""
    return [answer.numerator_of_difference(truth)]


@dataclass(frozen=True)
class Comparison:
    """Rules by which answers are compared with the truth.

    Attributes
    ----------
    arm
        The robot in the ring.
    reader
        Reads answers into the ring.
    digits
        Number of significant digits from which a decimal may have been rounded.
    numbers
        Parameters that the answer has as numbers: verdicts hold at their values in the file.
    residuals
        Function that returns elements which are zero for a right answer.
    seed
        Seed of the random states at which answers outside the ring are tried.
    up_to_constant
        Whether answers outside the ring may differ from the truth by a constant; None if such answers cannot be tried.
    """

    arm: ExactArm
    reader: RingReader
    digits: int = 4
    numbers: frozenset[str] = frozenset()
    residuals: Residuals = exact_difference
    seed: int = 0
    up_to_constant: bool | None = False

    @property
    def condition(self) -> str:
        """Parameter values at which a verdict holds, in words; empty if it holds for all."""
        values = self.arm.parameters
        listed = ", ".join(f"{name} = {values[name]:g}" for name in sorted(self.numbers))
        return f" at {listed}" if listed else ""

    def passes(self, answer: Quotient, truth: Element) -> bool:
        """Whether all residuals are zero.

        Raises
        ------
        RingError
            A residual is too long to be multiplied out.
        """
        return all(residual.is_zero for residual in self.residuals(answer, truth))


@dataclass(frozen=True)
class Finding:
    """Verdict on one entry, with the values computed for it.

    Attributes
    ----------
    verdict, statement, witness
        As in :class:`dhkit.grading.grade_report.Entry`.
    answer
        The answer in the ring; None if it is outside.
    difference
        Answer less truth as an element; None if the division leaves a remainder.
    texts
        The difference as text and in LaTeX.
    """

    verdict: Verdict
    statement: str
    answer: Quotient | None = None
    difference: Element | None = None
    witness: Witness | None = None
    texts: tuple[str | None, str] = (None, "")


def compare(tree: Tree, truth: Element, by: Comparison) -> Finding:
    """Judge one entry.

    Raises
    ------
    AnswerError
        The answer has no value, or takes too much work.
    """
    try:
        return _compare(tree, truth, by)
    except (RingError, RecursionError) as error:
        raise AnswerError(f"too long to be judged: {error}"[:200]) from None


def _compare(tree: Tree, truth: Element, by: Comparison) -> Finding:
    # Outside the exact ring?
    try:
        answer = by.reader.read(tree)
    except OutsideTheRingError as reason:
        return _sample(tree, truth, by, str(reason))
    divisors = list(by.reader.divisors)

    # Equal, exactly?
    try:
        is_equal = by.passes(answer, truth)
    except RingError:
        return _sample(tree, truth, by, "it multiplies out to too many terms")
    if is_equal:
        return Finding(Verdict.CORRECT, _proof_statement(by, divisors), answer)

    # Equal within the rounding of its decimals?
    share = rounding_share(tree, truth, by.reader, by.residuals, by.digits)
    if share is not None:
        statement = (
            f"equal within rounding{by.condition}: each coefficient is off by at most {max(share, 0.01):.2f} of half a "
            f"unit in the last place of its coarsest decimal of {by.digits} digits or more"
        )
        return Finding(Verdict.ROUNDED, statement, answer)

    difference = Quotient(answer.numerator_of_difference(truth), answer.denominator).element()
    return Finding(
        Verdict.WRONG,
        "proved different",
        answer,
        difference,
        _find_witness(tree, truth, by),
        _difference_texts(by.arm, answer, truth, difference),
    )


def _proof_statement(by: Comparison, divisors: Sequence[Element]) -> str:
    """Return a statement of the states for which an answer is proved: it has no value where it divides by zero."""
    if not divisors:
        parameters = "" if by.condition else " and every value of the parameters"
        return f"{_PROVED}{by.condition}, for every state{parameters}"
    short = [
        divisor
        for divisor in divisors[:_MAX_NAMED_DIVISORS]
        if len(divisor) <= BOUNDS.written_terms
    ]
    texts = [plain_text(readable(by.arm, divisor)) for divisor in short]
    more = " or another divisor is 0" if len(texts) < len(divisors) else ""
    zeros = " or ".join(f"{text} = 0" for text in texts) + more
    return f"{_PROVED}{by.condition} wherever the answer is defined: it has no value where {zeros}"


def equal(tree: Tree, truth: Element, by: Comparison) -> bool:
    """Whether an answer equals an element, exactly or within the rounding of its decimals."""
    try:
        if by.passes(by.reader.read(tree), truth):
            return True
        return rounding_share(tree, truth, by.reader, by.residuals, by.digits) is not None
    except (OutsideTheRingError, AnswerError, RingError):
        return False


def readable(arm: ExactArm, element: Element) -> Element:
    """Return an element in the sums of angles that make it shortest."""
    return shortened(arm, element_array(element)).item()  # type: ignore[no-any-return]


def _difference_texts(
    arm: ExactArm, answer: Quotient, truth: Element, difference: Element | None
) -> tuple[str | None, str]:
    """Return the difference as text and in LaTeX; None and empty if it is too long."""
    if difference is not None:
        if len(difference) > BOUNDS.written_terms:
            return plain_text(difference), ""
        short = readable(arm, difference)
        return plain_text(short), latex_text(short)
    numerator = answer.numerator_of_difference(truth)
    denominator = answer.denominator
    if max(len(numerator), len(denominator)) > BOUNDS.written_terms:
        return None, ""
    numerator = readable(arm, numerator)
    denominator = readable(arm, denominator)
    text = f"({plain_text(numerator)})/({plain_text(denominator)})"
    latex = rf"\frac{{{latex_text(numerator)}}}{{{latex_text(denominator)}}}"
    return text, latex


# Witnesses

_WITNESS_TRIALS = 24
"""Largest number of states from which a witness is chosen; the second half has other parameters than the file's."""
_FEWEST_TRIALS = 6
"""Smallest number of states from which a witness is chosen."""
_CLEARER = 1.5
"""Ratio of the differences at which a further state replaces the witness."""
_CLEAR = 1e-6
"""Difference, relative to the right value, at which no further state is tried."""


def _find_witness(tree: Tree, truth: Element, by: Comparison) -> Witness | None:
    """Return a state of short numbers at which answer and truth differ clearly, with the file's parameters if possible.

    All numbers are in SI units and rad.
    """
    arm = by.arm
    rng = np.random.default_rng(7)
    best: Witness | None = None
    largest_gap = 0.0
    used = names_of(tree) | names_in(truth)
    for k in range(_WITNESS_TRIALS):
        state: dict[str, float] = {}
        for kind in ("q", "qd", "qdd"):
            for i in range(arm.n):
                state[f"{kind}{i + 1}"] = float(np.round(rng.uniform(-1.5, 1.5), 1))
        parameters = dict(arm.parameters)
        if k >= _WITNESS_TRIALS // 2:
            parameters |= {
                p: float(np.round(v * rng.uniform(0.5, 2.0), 3)) for p, v in parameters.items()
            }

        value = float(doubles(tree, {**parameters, **state}))
        generators = arm.ring.values({**arm.values, **parameters}, *state_arrays(state, arm.n))
        right = float(truth.value(generators))
        gap = abs(value - right) if np.isfinite(value) else float("inf")
        if best is None or gap > _CLEARER * largest_gap:
            shown = {name: x for name, x in {**state, **parameters}.items() if name in used}
            best = Witness(shown, value if np.isfinite(value) else None, right)
            largest_gap = gap
        if k + 1 >= _FEWEST_TRIALS and largest_gap > _CLEAR * max(1.0, abs(right)):
            break
    return best


def names_in(element: Element) -> set[str]:
    """Return the names of joint variables and constants that an element depends on."""
    names: set[str] = set()
    for monomial in element.terms:
        for generator, exponent in zip(element.ring.generators, monomial, strict=True):
            if exponent:
                names |= {f"q{j + 1}" for j in generator.joints} or {generator.text}
    return names


# Answers outside the ring

_STATES_PER_SET = 5
"""Number of states that share parameters if an energy's zero is free: the first of them sets it, the others are
compared. A small number leaves many sets of parameters: a difference may exist in a part of their range alone."""


def _sample(tree: Tree, truth: Element, by: Comparison, reason: str) -> Finding:
    """Compare an answer with the truth at many random states, to 25 digits each."""
    import mpmath

    nodes = sum(1 for _ in parts_of(tree)) + len(truth)
    if by.up_to_constant is None:
        raise AnswerError(
            f"outside the exact ring ({reason}), where L is not judged up to a total derivative"
        )
    if nodes > BOUNDS.sampled_nodes:
        raise AnswerError(
            f"outside the exact ring ({reason}), and too long to be tried: {nodes} terms and factors"
        )
    with mpmath.workdps(sampling.DIGITS):
        count = max(BOUNDS.fewest_states, min(BOUNDS.states, BOUNDS.evaluations // nodes))
        every = _STATES_PER_SET if by.up_to_constant else 1
        states = sampling.samples(by.arm, by.numbers, by.seed, every=every, count=count)
        try:
            result = _first_difference(tree, nodes, truth, by, reason, states)
        except (TooLargeError, LostDigitsError) as error:
            raise AnswerError(f"outside the exact ring ({reason}), and {error}") from None
    if isinstance(result, Finding):
        return result
    return Finding(
        Verdict.UNDECIDED,
        f"not proved, since it is outside the exact ring ({reason}); equal to the truth{by.condition} at {result} "
        "random states, to 25 digits",
    )


def _split_constants(tree: Tree, constants: set[str]) -> tuple[Tree, list[Tree]]:
    """Return a sum without its terms that do not depend on the state, and these terms."""
    if names_of(tree) <= constants:
        return Number(Fraction(0), "0", 0), [tree]
    if not isinstance(tree, Sum):
        return tree, []
    kept: list[tuple[bool, Tree]] = []
    left_out: list[Tree] = []
    for added, term in tree.terms:
        varying, constant = _split_constants(term, constants)
        left_out += constant
        if not (isinstance(varying, Number) and not varying.value):
            kept.append((added, varying))
    return Sum(tuple(kept)), left_out


def _first_difference(
    tree: Tree,
    nodes: int,
    truth: Element,
    by: Comparison,
    reason: str,
    states: Iterable[sampling.Sample],
) -> Finding | int:
    """Return the finding at the first state where answer and truth differ; if none does, the number of states tried.

    An energy counts from any zero: its value at the first state of each set, less the truth's, is subtracted from its
    values at the others.
    """
    used = names_of(tree) | names_in(truth)

    def differs(state: sampling.Sample, value: Any, right: Any, reason: str) -> Finding:
        shown = {name: float(x) for name, x in state.names.items() if name in used}
        witness = Witness(shown, _finite(value), _finite(right))
        return Finding(Verdict.WRONG, f"a state shows it: {reason}", witness=witness)

    # The constant terms of an energy, however large, need only have a value.
    constants: list[Tree] = []
    if by.up_to_constant:
        tree, constants = _split_constants(tree, {*by.arm.parameters, *CONSTANTS})

    shift: Any = 0
    work = 0
    k = -1
    for k, state in enumerate(states):
        is_first_of_set = k % _STATES_PER_SET == 0
        sets_zero = by.up_to_constant and is_first_of_set
        right = sampling.element_value(truth, state)
        try:
            if is_first_of_set:
                for constant in constants:
                    enclosed(constant, nodes, state.names, sampling.MIN_SIZE)

            # The error of the state that sets the zero is that of all states after it, however small their values.
            size = sampling.MIN_SIZE if sets_zero else max(abs(right), sampling.MIN_SIZE)
            tolerance = sampling.TOLERANCE / 10 * size
            value, digits = enclosed(
                tree, nodes, state.names, tolerance, relative=not by.up_to_constant
            )
        except (TooLargeError, LostDigitsError):
            raise
        except AnswerError as error:
            return differs(state, None, right, f"{error} there")

        if sets_zero:
            shift = value - right
        if sampling.differ(value - shift, right):
            return differs(state, value - shift, right, f"outside the exact ring ({reason})")
        work += nodes * digits
        if work > BOUNDS.sampling_work and k + 1 >= BOUNDS.fewest_states:
            return k + 1
    return k + 1


def _finite(value: Any) -> float | None:
    """Return a value as a float; None for no value and for one that is not finite."""
    number = float("nan") if value is None else float(value)
    return number if np.isfinite(number) else None
