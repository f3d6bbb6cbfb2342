"""Timing of a path as a program in the squared path speed b = sd^2, with limits that are linear in b.

The time-optimal program is convex in b: Verscheure et al. 2009, Time-optimal path tracking for robots, section III.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array
from dhkit.planning.along.path_states import PathStates
from dhkit.planning.along.rows import TimingRows
from dhkit.planning.along.terms import Terms
from dhkit.planning.blocks import Block, BlockProgram, LocalFunction
from dhkit.planning.objectives import Time
from dhkit.planning.solver import Solver, delayed_interrupts

MIN_SQUARED_SPEED = 1e-7
"""Smallest b at inner knots, relative to about the path's mean: Ipopt relaxes bounds by a tenth of it."""
TIME_TOLERANCE, SMOOTH_TOLERANCE = 1e-7, 1e-8
"""Ipopt's tolerances for time (scaled to 1) and for other objectives; each active limit costs a tenth of it."""


class TimingProgram:
    """A program for K intervals with a number of linear rows at each end; built once for each combination.

    The variables are the durations of the intervals and b at the inner knots, in a unit of time that the caller
    chooses. The rows of an interval are the time that it takes beyond its duration; the linear ones, first those of its
    left end; and those of ``terms``, likewise. The last row is the duration. For least time the program is convex. For
    other objectives it is not: slow motions stay longest where gravity torques are smallest, and logarithms of b cover
    their range of decades.
    """

    def __init__(self, intervals: int, rows: int, terms: Terms | None) -> None:
        import casadi

        K = intervals
        self.intervals, self.rows, self.terms = intervals, rows, terms
        self.logarithmic = terms is not None and not terms.objective.only_time
        path = terms.function.numel_in(3) if terms else 0
        sizes = (1, rows, rows, path)
        # Parameters: for each interval its length and the coefficients of both ends; the unit of time, and the scale.
        self.parameter_sizes = (1, *(2 * size for size in sizes[1:]))
        each, scales = sum(self.parameter_sizes), K * sum(self.parameter_sizes) + np.arange(2)
        step = np.arange(K)
        parameters = np.vstack([each * step + np.arange(each)[:, None], np.tile(scales[:, None], K)])
        durations, inner = step[None], K + step[None, :-1]
        total, scale = casadi.SX.sym("total", K), casadi.SX(0, 1)
        blocks = (
            Block(self._interval(first=True), np.vstack([durations[:, :1], inner[:, :1]]), parameters[:, :1]),
            Block(self._interval(), np.vstack([durations[:, 1:-1], inner[:, :-1], inner[:, 1:]]), parameters[:, 1:-1]),
            Block(self._interval(last=True), np.vstack([durations[:, -1:], inner[:, -1:]]), parameters[:, -1:]),
            Block(LocalFunction(total, scale, casadi.sum1(total)), durations.T, np.zeros((0, 1), dtype=int)),
        )
        tolerance = TIME_TOLERANCE if terms is None or terms.objective.has_time else SMOOTH_TOLERANCE
        self.solver = Solver(BlockProgram(2 * K - 1, int(scales[-1]) + 1, blocks), K, tolerance=tolerance)

    def _interval(self, *, first: bool = False, last: bool = False) -> LocalFunction:
        """Return the rows and the cost of an interval; the first begins at rest, the last ends there."""
        import casadi

        symbol, terms = casadi.SX.sym, self.terms
        duration, inner = symbol("duration"), symbol("b", 2 - first - last)
        step, left, right, path = (symbol(f"p{k}", size) for k, size in enumerate(self.parameter_sizes))
        rate, scale = symbol("rate"), symbol("scale")
        known = casadi.vertsplit(casadi.exp(inner) if self.logarithmic else inner)
        # At rest the speed is a constant: the square root has no derivative there.
        rest = [casadi.SX(0)]
        b = [*rest * first, *known, *rest * last]
        speed = [*rest * first, *(casadi.sqrt(part) for part in known), *rest * last]
        rows = [2 * step / (speed[0] + speed[1]) - duration, left * b[0] + right * b[1]]
        cost = scale * duration
        if terms is not None:
            sdd = (b[1] - b[0]) / (2 * step)
            ends = zip(b, speed, casadi.vertsplit(path, path.numel() // 2), strict=True)
            values = [terms.function(sdd * rate**2, x * rate**2, v * rate, given) for x, v, given in ends]
            rows += [value[0] for value in values]
            weight = sum(term.weight for term in terms.objective.terms if isinstance(term, Time))
            cost = scale / rate * duration * (weight + (values[0][1] + values[1][1]) / 2)
        z, p = casadi.vertcat(duration, inner), casadi.vertcat(step, left, right, path, rate, scale)
        return LocalFunction(z, p, casadi.vertcat(*rows), cost)

    def numbers(self, durations: ArrayLike, b: ArrayLike) -> Array:
        """Return the program's variables for durations of the intervals (K,) and b at the inner knots, (K-1,)."""
        K = self.intervals
        with np.errstate(divide="ignore"):
            inner = np.log(b) if self.logarithmic else np.asarray(b)
        return np.concatenate([np.broadcast_to(durations, K), np.broadcast_to(inner, K - 1)])

    def squares(self, x: Array) -> Array:
        """Return b at all knots, shape (K+1,), from the program's variables."""
        inner = x[self.intervals :]
        inside = np.exp(inner) if self.logarithmic else np.maximum(inner, 0.0)
        return np.concatenate([[0.0], inside, [0.0]])

    def parameters(self, states: PathStates, rows: list[TimingRows], unit: float, scale: float) -> Array:
        """Return the program's parameters, shape (parameters,); ``unit`` is the unit of time, s."""
        left, right = (self._side(rows, side) / unit**2 for side in ("left", "right"))
        path = states.coefficients if self.terms else np.zeros((2, self.intervals, 0))
        ends = [np.concatenate([*part], axis=-1) for part in (left, right, path)]
        each = np.concatenate([states.steps[:, None], *ends], axis=1)
        return np.concatenate([each.ravel(), [1 / unit, scale]])

    def _side(self, rows: list[TimingRows], side: str) -> Array:
        arrays = [getattr(row, side) for row in rows]
        return np.concatenate(arrays, axis=-1) if arrays else np.zeros((2, self.intervals, 0))


@lru_cache(maxsize=16)
@delayed_interrupts()
def timing_program(intervals: int, rows: int, terms: Terms | None) -> TimingProgram:
    """Return the program of these sizes, built on first use."""
    return TimingProgram(intervals, rows, terms)
