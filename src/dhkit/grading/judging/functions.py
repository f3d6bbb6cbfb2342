"""Judging of answers that are functions of numbers: compared with the truth at random states, never proved."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.grading.answers.given import Given
from dhkit.grading.answers.sampled import SampledAnswer
from dhkit.grading.answers.sheet import shape_of
from dhkit.grading.grade_report import Verdict, Witness
from dhkit.grading.isolation import WorkerLimits, result_of
from dhkit.grading.judging.findings import Finding
from dhkit.grading.judging.quantities import JudgedQuantity, parameters_in, place_of
from dhkit.grading.judging.sampling import samples
from dhkit.grading.judging.truth import Truth
from dhkit.symbolic.ring import Elements

_SAMPLES = 1_000
"""Number of random states."""
GROUP = 10
"""Number of random states in a row with the same parameters."""
_TOLERANCE = 1e-9
"""Largest difference relative to a quantity's largest entry at a state: room for the rounding of a long formula."""
_STATES = ("q", "qd", "qdd")
"""Arguments of functions, in their order: joint values, rates and accelerations."""
LIMITS = WorkerLimits(seconds=15.0, memory=2 * 1024**3)
"""Limits of the process that calls a function at all states: a function that hangs or exits ends that process alone."""
_ERROR_MARK = b"!"
"""First byte of a process's result that is an error message instead of an array."""


@dataclass(frozen=True, eq=False)
class _SampledValues:
    """An answer and the truth at all states.

    Attributes
    ----------
    called
        Name of the function or program, as it is printed.
    answer
        Values of the answer, shape (_SAMPLES, *shape).
    expected
        Right values, shape (_SAMPLES, *shape); of C those of C qd.
    rates
        Rates of the student's variables, shape (_SAMPLES, n).
    state_of
        Function that returns the state of an index by name, SI units and rad.
    group
        Number of states in a row with the same parameters.
    verdict
        Verdict on an entry that agrees at all states.
    """

    called: str
    answer: Array
    expected: Array
    rates: Array
    state_of: Callable[[int], Mapping[str, float]]
    group: int
    verdict: Verdict


def judge_function(
    name: str, function: Callable[..., object], truth: Truth, seed: int = 0
) -> JudgedQuantity:
    """Judge a quantity that is a function of (q), (q, qd) or (q, qd, qdd), each of shape (n,), SI units and rad.

    The function is called in a process of its own.

    Raises
    ------
    AnswerError
        The function takes other arguments, fails, hangs, ends its process, or returns another shape.
    """
    n = truth.description.n
    shape = shape_of(name, n)
    count = _argument_count(name, function)
    rng = np.random.default_rng(seed)

    # The student's joint variables are y, with q = B y; rows are states.
    y = [_random_states(rng, n) for _ in _STATES]
    B = truth.coordinates.B.astype(float)
    q_qd_qdd = [of_kind @ B.T for of_kind in y]

    values = _call_at_states(name, function, y[:count], shape)
    right = truth.of("h" if name == "C" else name)
    sampled = _SampledValues(
        called=getattr(function, "__name__", "function") + "(...)",
        answer=values,
        expected=truth.arm(name).evaluate(right, *q_qd_qdd),
        rates=y[1],
        state_of=partial(_state_at, y),
        group=_SAMPLES,
        verdict=Verdict.UNDECIDED,
    )
    return _compared(name, sampled, right, truth)


def _state_at(rows: Sequence[Array], k: int) -> dict[str, float]:
    """Return state k by name, given joint values, rates and accelerations of shape (_SAMPLES, n) each."""
    state: dict[str, float] = {}
    for kind, values in zip(_STATES, rows, strict=True):
        state |= {f"{kind}{i + 1}": float(x) for i, x in enumerate(values[k])}
    return state


def judge_sampled(name: str, answer: SampledAnswer, truth: Truth, seed: int = 0) -> JudgedQuantity:
    """Judge a quantity that an executed program calculates from numbers.

    Parameters that the program takes have random values, the same at :data:`GROUP` states in a row.

    Raises
    ------
    AnswerError
        The program fails, or returns another shape.
    """
    arm = truth.arm(name)
    n = truth.description.n
    shape = shape_of(name, n)
    right = truth.of("h" if name == "C" else name)
    varied = answer.parameters & arm.parameters.keys()
    if answer.parameters - varied:
        # A parameter that others define would not follow them.
        varied = frozenset()
    fixed = frozenset(truth.description.numbers.values) - varied
    listed = list(samples(arm, fixed, seed, every=GROUP, count=_SAMPLES))

    # The student's joint variables are y = B^-1 q.
    B_inverse = np.linalg.inv(truth.coordinates.B.astype(float))
    states = [_student_state(sample.names, B_inverse, n) for sample in listed]
    values = answer.at(states, shape)

    generators = np.array([np.array(sample.generators, dtype=float) for sample in listed]).T
    flat = [np.broadcast_to(element.value(generators), _SAMPLES) for element in right.reshape(-1)]
    rates = np.empty((_SAMPLES, n))
    for i in range(n):
        rates[:, i] = [state[f"qd{i + 1}"] for state in states]
    sampled = _SampledValues(
        called=answer.name,
        answer=values,
        expected=np.stack(flat, axis=-1).reshape(_SAMPLES, *right.shape),
        rates=rates,
        state_of=states.__getitem__,
        group=GROUP,
        verdict=Verdict.SAMPLED,
    )
    return _compared(name, sampled, right, truth)


def _student_state(names: Mapping[str, Any], B_inverse: Array, n: int) -> dict[str, float]:
    """Return a state with the student's joint variables y = B^-1 q instead of the robot's."""
    state = {name: float(value) for name, value in names.items()}
    for kind in _STATES:
        y = B_inverse @ np.array([state[f"{kind}{i + 1}"] for i in range(n)])
        state |= {f"{kind}{i + 1}": float(x) for i, x in enumerate(y)}
    return state


def _compared(name: str, sampled: _SampledValues, right: Elements, truth: Truth) -> JudgedQuantity:
    """Judge values at all states; potentials may differ by a constant, which the first state of a group determines."""
    shape = sampled.answer.shape[1:]
    expected = sampled.expected
    values = sampled.answer
    if name == "C":
        # (C qd)_i = sum over j of C_ij qd_j
        values = np.einsum("...ij,...j->...i", values, sampled.rates)
    if name in ("V", "L"):
        first_of_group = np.arange(_SAMPLES) // sampled.group * sampled.group
        values = values - values[first_of_group] + expected[first_of_group]

    # The size to which differences are relative: the largest entry at the state, or a share of the usual one if that
    # is larger. Potentials and lengths count from zeros that are a choice: they are at least of the usual size.
    size = np.max(np.abs(expected).reshape(_SAMPLES, -1), axis=1, initial=0.0)
    if name in ("V", "L", "J", "T") or name[:1] == "A":
        size = np.maximum(size, np.median(size))
    size = np.maximum(size, 1e-3 * np.median(size) + 1e-12)
    size = size.reshape(_SAMPLES, *(1,) * (expected.ndim - 1))
    differs = ~(np.abs(values - expected) <= _TOLERANCE * size)

    compared = replace(sampled, answer=values)
    findings = {}
    for index in np.ndindex(shape):
        place = place_of(name, index)
        findings[index] = _finding(differs[(slice(None), *place)], compared, place)
    given = tuple(Given(index, sampled.called) for index in np.ndindex(shape))
    return JudgedQuantity(name, given, findings, right, parameters_in(right, truth))


def _random_states(rng: np.random.Generator, n: int) -> Array:
    """Return random values, shape (_SAMPLES, n): every other row within 2, the others at scales from 0.01 to 100.

    They are joint values, rates or accelerations, in rad, m and s.
    """
    scale = np.where(np.arange(_SAMPLES) % 2, 2.0, 10.0 ** rng.uniform(-2.0, 2.0, _SAMPLES))
    return rng.uniform(-1.0, 1.0, (_SAMPLES, n)) * scale[:, None]


def _call_at_states(
    name: str, function: Callable[..., object], states: Sequence[Array], shape: tuple[int, ...]
) -> Array:
    """Return the function's results, shape (_SAMPLES, *shape), from a process of its own.

    Raises
    ------
    AnswerError
        The function fails, hangs, ends its process, or returns another shape.
    """

    def work() -> bytes:
        try:
            # A sample is one row of each of the arrays q, qd and qdd.
            results = [
                _call(name, function, list(sample), shape) for sample in zip(*states, strict=True)
            ]
        except AnswerError as error:
            return _ERROR_MARK + str(error).encode("utf-8", "replace")
        return np.array(results).tobytes()

    try:
        received = result_of(work, LIMITS)
    except TimeoutError as error:
        raise AnswerError(f"{name}: the function {error}") from None
    except (ChildProcessError, OSError) as error:
        raise AnswerError(f"{name}: the function gave no result: {error}") from None
    doubles = _SAMPLES * int(np.prod(shape, dtype=int))
    if len(received) != 8 * doubles:
        raise AnswerError(received.removeprefix(_ERROR_MARK).decode("utf-8", "replace")[:500])
    return np.frombuffer(received).reshape(_SAMPLES, *shape)


def _argument_count(name: str, function: Callable[..., object]) -> int:
    """Return the number of a function's arguments: 1 for (q), 2 for (q, qd), 3 for (q, qd, qdd)."""
    try:
        count = len(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        raise AnswerError(
            f"{name}: a function whose arguments cannot be seen; expected (q), (q, qd) or (q, qd, qdd)"
        ) from None
    if not 1 <= count <= len(_STATES):
        raise AnswerError(
            f"{name}: a function of {count} arguments; expected (q), (q, qd) or (q, qd, qdd)"
        )
    return count


def _call(
    name: str, function: Callable[..., object], arguments: list[Array], shape: tuple[int, ...]
) -> Array:
    """Return a function's result at one state, in a shape."""
    try:
        returned = np.asarray(function(*arguments))
        if np.iscomplexobj(returned):
            raise TypeError("complex numbers; expected real ones")
        result = returned.astype(float)
    except Exception as error:
        raise AnswerError(
            f"{name}: the function fails: {type(error).__name__}: {str(error)[:200]}"
        ) from error
    if result.size != np.prod(shape, dtype=int):
        raise AnswerError(f"{name}: the function returns shape {result.shape}; expected {shape}")
    return result.reshape(shape)


def _finding(differs: Any, sampled: _SampledValues, place: tuple[int, ...]) -> Finding:
    """Return the finding on an entry, given a mask (_SAMPLES,) of the states at which it differs from the truth."""
    if not differs.any():
        found = "agrees" if sampled.verdict is Verdict.SAMPLED else "equal to the truth"
        statement = (
            f"not proved, since it is a function: {found} at {_SAMPLES} random states, in doubles"
        )
        return Finding(sampled.verdict, statement)

    gap = np.moveaxis(np.abs(sampled.answer - sampled.expected), 0, -1)[place]
    worst = int(np.argmax(np.where(np.isfinite(gap), gap, np.inf)))
    answer = float(sampled.answer[(worst, *place)])
    right = float(sampled.expected[(worst, *place)])
    witness = Witness(dict(sampled.state_of(worst)), answer if np.isfinite(answer) else None, right)
    share = f"{int(differs.sum())} of {_SAMPLES} random states show it"
    return Finding(Verdict.WRONG, share, witness=witness)
