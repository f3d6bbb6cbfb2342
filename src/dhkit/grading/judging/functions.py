"""Answers that are Python functions of the state: held against the truth in numbers, never proved."""

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
from dhkit.grading.judging.quantities import JudgedQuantity, parameters_in
from dhkit.grading.judging.truth import Truth
from dhkit.grading.report import Verdict, Witness

SAMPLES = 1_000
TOLERANCE = 1e-9
"""Relative to a quantity's largest entry in a state: a student's doubles, with room for a long formula's rounding."""
STATES = ("q", "qd", "qdd")
LIMITS = Limits(seconds=15.0, memory=2 * 1024**3)
"""Of the process that calls a function at all states: one that hangs or exits ends itself alone."""
FAILED = b"!"
"""How a worker's result begins that is a message and no array."""


def judge_function(name: str, function: Callable[..., Any], truth: Truth, seed: int = 0) -> JudgedQuantity:
    """Judge a quantity that is a function of (q), (q, qd) or (q, qd, qdd), each of shape (n,), SI and radians.

    It is called in a process of its own.

    Raises
    ------
    AnswerError
        It takes other arguments, fails, hangs, ends its process, or returns another shape.
    """
    n, shape = truth.description.n, shape_of(name, truth.description.n)
    count = _arguments(name, function)
    rng = np.random.default_rng(seed)
    y = [_spread(rng, n) for _ in STATES]
    states = [v @ truth.coordinates.B.T.astype(float) for v in y]
    answers = _called_at(name, function, y[:count], shape)
    right = truth.of("h" if name == "C" else name)
    expected = truth.arm(name).evaluate(right, *states)
    held = np.einsum("...ij,...j->...i", answers, y[1]) if name == "C" else answers
    if name in ("V", "L"):
        held = held - held[0] + expected[0]
    size = np.max(np.abs(expected).reshape(SAMPLES, -1), axis=1, initial=0.0)
    if name in ("V", "L", "J", "T") or name[:1] == "A":
        size = np.maximum(size, np.median(size))
    size = np.maximum(size, 1e-3 * np.median(size) + 1e-12).reshape(SAMPLES, *(1,) * (expected.ndim - 1))
    differs = ~(np.abs(held - expected) <= TOLERANCE * size)
    findings = {}
    for index in np.ndindex(shape):
        place = index[:1] if name == "C" else index
        findings[index] = _finding(
            differs[(slice(None), *place)], held, expected, place, dict(zip(STATES, y, strict=True))
        )
    given = tuple(Given(index, f"{getattr(function, '__name__', 'function')}(...)") for index in np.ndindex(shape))
    return JudgedQuantity(name, given, findings, right, parameters_in(right, truth))


def _spread(rng: np.random.Generator, n: int) -> Array:
    """Return states of shape (SAMPLES, n): half within 2 rad or m, half at scales from 0.01 to 100."""
    scale = np.where(np.arange(SAMPLES) % 2, 2.0, 10.0 ** rng.uniform(-2.0, 2.0, SAMPLES))
    return rng.uniform(-1.0, 1.0, (SAMPLES, n)) * scale[:, None]


def _called_at(name: str, function: Callable[..., Any], states: Sequence[Array], shape: tuple[int, ...]) -> Array:
    """Return the function's results, shape (SAMPLES, *shape)."""

    def work() -> bytes:
        try:
            results = [_called(name, function, [state[k] for state in states], shape) for k in range(SAMPLES)]
        except AnswerError as error:
            return FAILED + str(error).encode("utf-8", "replace")
        return np.array(results).tobytes()

    try:
        received = result_of(work, LIMITS)
    except TimeoutError as error:
        raise AnswerError(f"{name}: the function {error}") from None
    except (ChildProcessError, OSError) as error:
        raise AnswerError(f"{name}: the function gave no result: {error}") from None
    size = 8 * SAMPLES * int(np.prod(shape, dtype=int))
    if len(received) != size:
        raise AnswerError(received.removeprefix(FAILED).decode("utf-8", "replace")[:500])
    return np.frombuffer(received).reshape(SAMPLES, *shape)


def _arguments(name: str, function: Callable[..., Any]) -> int:
    try:
        count = len(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        raise AnswerError(
            f"{name}: a function whose arguments cannot be seen; expected (q), (q, qd) or (q, qd, qdd)"
        ) from None
    if not 1 <= count <= len(STATES):
        raise AnswerError(f"{name}: a function of {count} arguments; expected (q), (q, qd) or (q, qd, qdd)")
    return count


def _called(name: str, function: Callable[..., Any], arguments: list[Array], shape: tuple[int, ...]) -> Array:
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


def _finding(differs: Any, held: Array, expected: Array, place: tuple[int, ...], states: dict[str, Array]) -> Finding:
    if not differs.any():
        statement = f"not proved, since it is a function: equal to the truth at {SAMPLES} random states, in doubles"
        return Finding(Verdict.UNDECIDED, statement)
    gap = np.moveaxis(np.abs(held - expected), 0, -1)[place]
    worst = int(np.argmax(np.where(np.isfinite(gap), gap, np.inf)))
    state = {f"{kind}{i + 1}": float(x) for kind, values in states.items() for i, x in enumerate(values[worst])}
    answer, right = float(held[(worst, *place)]), float(expected[(worst, *place)])
    witness = Witness(state, answer if np.isfinite(answer) else None, right)
    share = f"{int(differs.sum())} of {SAMPLES} random states show it"
    return Finding(Verdict.WRONG, share, witness=witness)
