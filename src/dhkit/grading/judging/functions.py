"""Answers that are functions of numbers: compared with the truth at random states, never proved."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.grading.answers.given import Given
from dhkit.grading.answers.sampled import SampledAnswer
from dhkit.grading.answers.sheet import shape_of
from dhkit.grading.isolation import WorkerLimits, result_of
from dhkit.grading.judging.findings import Finding
from dhkit.grading.judging.quantities import JudgedQuantity, parameters_in, place_of
from dhkit.grading.judging.sampling import samples
from dhkit.grading.judging.truth import Truth
from dhkit.grading.report import Verdict, Witness
from dhkit.symbolic.ring import Elements

_SAMPLES = 1_000
"""Number of random states."""
GROUP = 10
"""Number of random states in a row with the same parameters."""
_TOLERANCE = 1e-9
"""Tolerance relative to a quantity's largest entry at a state: doubles, with room for a long formula's rounding."""
_STATES = ("q", "qd", "qdd")
LIMITS = WorkerLimits(seconds=15.0, memory=2 * 1024**3)
"""Limits of the process that calls a function at all states: a function that hangs or exits ends that process alone."""
_ERROR_MARK = b"!"
"""First byte of a process's result that is an error message and no array."""


def judge_function(name: str, function: Callable[..., object], truth: Truth, seed: int = 0) -> JudgedQuantity:
    """Judge a quantity that is a function of (q), (q, qd) or (q, qd, qdd), each of shape (n,), SI units and rad.

    The function is called in a process of its own.

    Raises
    ------
    AnswerError
        The function takes other arguments, fails, hangs, ends its process, or returns another shape.
    """
    n = truth.description.n
    shape = shape_of(name, truth.description.n)
    count = _argument_count(name, function)
    rng = np.random.default_rng(seed)
    y = [_random_states(rng, n) for _ in _STATES]
    states = [v @ truth.coordinates.B.T.astype(float) for v in y]
    values = _call_at_states(name, function, y[:count], shape)
    right = truth.of("h" if name == "C" else name)
    expected = truth.arm(name).evaluate(right, *states)
    states_by_name = dict(zip(_STATES, y, strict=True))
    return _compared(
        name,
        getattr(function, "__name__", "function") + "(...)",
        values,
        expected,
        y[1],
        right,
        truth,
        lambda k: {f"{kind}{i + 1}": float(x) for kind, rows in states_by_name.items() for i, x in enumerate(rows[k])},
        Verdict.UNDECIDED,
        group=_SAMPLES,
    )


def judge_sampled(name: str, answer: SampledAnswer, truth: Truth, seed: int = 0) -> JudgedQuantity:
    """Judge a quantity that an executed program calculates from numbers.

    Parameters that the program takes have random values, the same at :data:`GROUP` states in a row.

    Raises
    ------
    AnswerError
        It fails, or returns another shape.
    """
    arm = truth.arm(name)
    n = truth.description.n
    shape = shape_of(name, n)
    right = truth.of("h" if name == "C" else name)
    varied = answer.parameters & arm.parameters.keys()
    if answer.parameters - varied:  # one that others define would not follow them
        varied = frozenset()
    fixed = frozenset(truth.description.numbers.values) - varied
    listed = list(samples(arm, fixed, seed, every=GROUP, count=_SAMPLES))
    # The student's joint variables y, where q = B y.
    inverse = np.linalg.inv(truth.coordinates.B.astype(float))
    states = [_own_state(sample.names, inverse, n) for sample in listed]
    values = answer.at(states, shape)
    generators = np.array([[float(x) for x in sample.generators] for sample in listed]).T
    flat = [np.broadcast_to(element.value(generators), _SAMPLES) for element in right.reshape(-1)]
    expected = np.stack(flat, axis=-1).reshape(_SAMPLES, *right.shape)
    rates = np.array([[state[f"qd{i + 1}"] for i in range(n)] for state in states])
    return _compared(
        name, answer.name, values, expected, rates, right, truth, states.__getitem__, Verdict.SAMPLED, group=GROUP
    )


def _own_state(names: Mapping[str, Any], inverse: Array, n: int) -> dict[str, float]:
    """Return a state with the student's joint variables instead of the robot's."""
    state = {name: float(value) for name, value in names.items()}
    for kind in _STATES:
        own = inverse @ np.array([state[f"{kind}{i + 1}"] for i in range(n)])
        state |= {f"{kind}{i + 1}": float(x) for i, x in enumerate(own)}
    return state


def _compared(
    name: str,
    called: str,
    values: Array,
    expected: Array,
    rates: Array,
    right: Elements,
    truth: Truth,
    state_of: Callable[[int], Mapping[str, float]],
    verdict: Verdict,
    group: int,
) -> JudgedQuantity:
    """Judge values at all states; potentials may differ by a constant, which is that of the first state of a group."""
    shape = values.shape[1:]
    values = np.einsum("...ij,...j->...i", values, rates) if name == "C" else values
    if name in ("V", "L"):
        first = np.arange(_SAMPLES) // group * group
        values = values - values[first] + expected[first]
    size = np.max(np.abs(expected).reshape(_SAMPLES, -1), axis=1, initial=0.0)
    if name in ("V", "L", "J", "T") or name[:1] == "A":
        size = np.maximum(size, np.median(size))
    size = np.maximum(size, 1e-3 * np.median(size) + 1e-12).reshape(_SAMPLES, *(1,) * (expected.ndim - 1))
    differs = ~(np.abs(values - expected) <= _TOLERANCE * size)
    findings = {}
    for index in np.ndindex(shape):
        place = place_of(name, index)
        findings[index] = _finding(differs[(slice(None), *place)], values, expected, place, state_of, verdict)
    given = tuple(Given(index, called) for index in np.ndindex(shape))
    return JudgedQuantity(name, given, findings, right, parameters_in(right, truth))


def _random_states(rng: np.random.Generator, n: int) -> Array:
    """Return random values, shape (_SAMPLES, n): half within 2 rad or m, half at scales from 0.01 to 100."""
    scale = np.where(np.arange(_SAMPLES) % 2, 2.0, 10.0 ** rng.uniform(-2.0, 2.0, _SAMPLES))
    return rng.uniform(-1.0, 1.0, (_SAMPLES, n)) * scale[:, None]


def _call_at_states(
    name: str, function: Callable[..., object], states: Sequence[Array], shape: tuple[int, ...]
) -> Array:
    """Return the function's results, shape (_SAMPLES, *shape)."""

    def work() -> bytes:
        try:
            results = [_call(name, function, [state[k] for state in states], shape) for k in range(_SAMPLES)]
        except AnswerError as error:
            return _ERROR_MARK + str(error).encode("utf-8", "replace")
        return np.array(results).tobytes()

    try:
        received = result_of(work, LIMITS)
    except TimeoutError as error:
        raise AnswerError(f"{name}: the function {error}") from None
    except (ChildProcessError, OSError) as error:
        raise AnswerError(f"{name}: the function gave no result: {error}") from None
    size = 8 * _SAMPLES * int(np.prod(shape, dtype=int))
    if len(received) != size:
        raise AnswerError(received.removeprefix(_ERROR_MARK).decode("utf-8", "replace")[:500])
    return np.frombuffer(received).reshape(_SAMPLES, *shape)


def _argument_count(name: str, function: Callable[..., object]) -> int:
    try:
        count = len(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        raise AnswerError(
            f"{name}: a function whose arguments cannot be seen; expected (q), (q, qd) or (q, qd, qdd)"
        ) from None
    if not 1 <= count <= len(_STATES):
        raise AnswerError(f"{name}: a function of {count} arguments; expected (q), (q, qd) or (q, qd, qdd)")
    return count


def _call(name: str, function: Callable[..., object], arguments: list[Array], shape: tuple[int, ...]) -> Array:
    try:
        returned = np.asarray(function(*arguments))
        if np.iscomplexobj(returned):
            raise TypeError("complex numbers; expected real ones")
        result = returned.astype(float)
    except Exception as error:
        raise AnswerError(f"{name}: the function fails: {type(error).__name__}: {str(error)[:200]}") from error
    if result.size != np.prod(shape, dtype=int):
        raise AnswerError(f"{name}: the function returns shape {result.shape}; expected {shape}")
    return result.reshape(shape)


def _finding(
    differs: Any,
    values: Array,
    expected: Array,
    place: tuple[int, ...],
    state_of: Callable[[int], Mapping[str, float]],
    verdict: Verdict,
) -> Finding:
    if not differs.any():
        found = "agrees" if verdict is Verdict.SAMPLED else "equal to the truth"
        statement = f"not proved, since it is a function: {found} at {_SAMPLES} random states, in doubles"
        return Finding(verdict, statement)
    gap = np.moveaxis(np.abs(values - expected), 0, -1)[place]
    worst = int(np.argmax(np.where(np.isfinite(gap), gap, np.inf)))
    answer = float(values[(worst, *place)])
    right = float(expected[(worst, *place)])
    witness = Witness(dict(state_of(worst)), answer if np.isfinite(answer) else None, right)
    share = f"{int(differs.sum())} of {_SAMPLES} random states show it"
    return Finding(Verdict.WRONG, share, witness=witness)
