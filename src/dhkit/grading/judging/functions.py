"""Answers that are Python functions of the state: compared with the truth at random states, never proved."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.grading.answers.given import Given
from dhkit.grading.answers.sheet import shape_of
from dhkit.grading.isolation import Limits, result_of
from dhkit.grading.judging.findings import Finding
from dhkit.grading.judging.quantities import JudgedQuantity, parameters_in, place_of
from dhkit.grading.judging.truth import Truth
from dhkit.grading.report import Verdict, Witness

SAMPLES = 1_000
"""Number of random states."""
TOLERANCE = 1e-9
"""Tolerance relative to a quantity's largest entry at a state: doubles, with room for a long formula's rounding."""
STATES = ("q", "qd", "qdd")
LIMITS = Limits(seconds=15.0, memory=2 * 1024**3)
"""Limits of the process that calls a function at all states: a function that hangs or exits ends that process alone."""
ERROR_MARK = b"!"
"""First byte of a process's result that is an error message and no array."""


def judge_function(name: str, function: Callable[..., object], truth: Truth, seed: int = 0) -> JudgedQuantity:
    """Judge a quantity that is a function of (q), (q, qd) or (q, qd, qdd), each of shape (n,), SI units and rad.

    The function is called in a process of its own.

    Raises
    ------
    AnswerError
        The function takes other arguments, fails, hangs, ends its process, or returns another shape.
    """
    n, shape = truth.description.n, shape_of(name, truth.description.n)
    count = _argument_count(name, function)
    rng = np.random.default_rng(seed)
    y = [_random_states(rng, n) for _ in STATES]
    states = [v @ truth.coordinates.B.T.astype(float) for v in y]
    values = _call_at_states(name, function, y[:count], shape)
    right = truth.of("h" if name == "C" else name)
    expected = truth.arm(name).evaluate(right, *states)
    values = np.einsum("...ij,...j->...i", values, y[1]) if name == "C" else values
    if name in ("V", "L"):
        values = values - values[0] + expected[0]
    size = np.max(np.abs(expected).reshape(SAMPLES, -1), axis=1, initial=0.0)
    if name in ("V", "L", "J", "T") or name[:1] == "A":
        size = np.maximum(size, np.median(size))
    size = np.maximum(size, 1e-3 * np.median(size) + 1e-12).reshape(SAMPLES, *(1,) * (expected.ndim - 1))
    differs = ~(np.abs(values - expected) <= TOLERANCE * size)
    states_by_name = dict(zip(STATES, y, strict=True))
    findings = {}
    for index in np.ndindex(shape):
        place = place_of(name, index)
        findings[index] = _finding(differs[(slice(None), *place)], values, expected, place, states_by_name)
    given = tuple(Given(index, f"{getattr(function, '__name__', 'function')}(...)") for index in np.ndindex(shape))
    return JudgedQuantity(name, given, findings, right, parameters_in(right, truth))


def _random_states(rng: np.random.Generator, n: int) -> Array:
    """Return random values, shape (SAMPLES, n): half within 2 rad or m, half at scales from 0.01 to 100."""
    scale = np.where(np.arange(SAMPLES) % 2, 2.0, 10.0 ** rng.uniform(-2.0, 2.0, SAMPLES))
    return rng.uniform(-1.0, 1.0, (SAMPLES, n)) * scale[:, None]


def _call_at_states(
    name: str, function: Callable[..., object], states: Sequence[Array], shape: tuple[int, ...]
) -> Array:
    """Return the function's results, shape (SAMPLES, *shape)."""

    def work() -> bytes:
        try:
            results = [_call(name, function, [state[k] for state in states], shape) for k in range(SAMPLES)]
        except AnswerError as error:
            return ERROR_MARK + str(error).encode("utf-8", "replace")
        return np.array(results).tobytes()

    try:
        received = result_of(work, LIMITS)
    except TimeoutError as error:
        raise AnswerError(f"{name}: the function {error}") from None
    except (ChildProcessError, OSError) as error:
        raise AnswerError(f"{name}: the function gave no result: {error}") from None
    size = 8 * SAMPLES * int(np.prod(shape, dtype=int))
    if len(received) != size:
        raise AnswerError(received.removeprefix(ERROR_MARK).decode("utf-8", "replace")[:500])
    return np.frombuffer(received).reshape(SAMPLES, *shape)


def _argument_count(name: str, function: Callable[..., object]) -> int:
    try:
        count = len(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        raise AnswerError(
            f"{name}: a function whose arguments cannot be seen; expected (q), (q, qd) or (q, qd, qdd)"
        ) from None
    if not 1 <= count <= len(STATES):
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


def _finding(differs: Any, values: Array, expected: Array, place: tuple[int, ...], states: dict[str, Array]) -> Finding:
    if not differs.any():
        statement = f"not proved, since it is a function: equal to the truth at {SAMPLES} random states, in doubles"
        return Finding(Verdict.UNDECIDED, statement)
    gap = np.moveaxis(np.abs(values - expected), 0, -1)[place]
    worst = int(np.argmax(np.where(np.isfinite(gap), gap, np.inf)))
    state = {f"{kind}{i + 1}": float(x) for kind, rows in states.items() for i, x in enumerate(rows[worst])}
    answer, right = float(values[(worst, *place)]), float(expected[(worst, *place)])
    witness = Witness(state, answer if np.isfinite(answer) else None, right)
    share = f"{int(differs.sum())} of {SAMPLES} random states show it"
    return Finding(Verdict.WRONG, share, witness=witness)
