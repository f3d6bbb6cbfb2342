"""Timing of a path as a program in the squared path speed b = sd^2, with limits that are linear in b.

The time-optimal program is convex in b: Verscheure et al. 2009, Time-optimal path tracking for robots, section III.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.path_states import PathStates
from dhkit.planning.along.rows import TimingRows
from dhkit.planning.along.terms import Terms
from dhkit.planning.objectives import Time
from dhkit.planning.solver import Solver, delayed_interrupts

MIN_SQUARED_SPEED = 1e-7
"""Smallest b at inner knots, relative to about the path's mean: Ipopt relaxes bounds by a tenth of it."""
TIME_TOLERANCE, SMOOTH_TOLERANCE = 1e-7, 1e-8
"""Ipopt's tolerances for time (scaled to 1) and for other objectives; each active limit costs a tenth of it."""


class TimingProgram:
    """A program for K intervals with a number of linear rows at each end; built once for each combination.

    The variables are the duration and b at the inner knots, in a unit of time that the caller chooses. The rows are the
    linear ones, (2, K, rows) flattened; those of ``terms``, a column for each end, left ends first; and the excess of
    the intervals' time over the duration. For least time the program is convex. For other objectives it is not: slow
    motions stay longest where gravity torques are smallest, and logarithms of b cover their range of decades.
    """

    def __init__(self, intervals: int, rows: int, terms: Terms | None) -> None:
        import casadi

        K = intervals
        self.intervals, self.rows, self.terms = intervals, rows, terms
        x, steps = casadi.MX.sym("x", K), casadi.MX.sym("steps", 1, K)
        left, right = casadi.MX.sym("left", rows, 2 * K), casadi.MX.sym("right", rows, 2 * K)
        path = casadi.MX.sym("path", terms.function.numel_in(3) if terms else 0, 2 * K)
        rate, scale = casadi.MX.sym("rate"), casadi.MX.sym("scale")
        self.logarithmic = terms is not None and not terms.objective.only_time
        inside = casadi.exp(x[1:]).T if self.logarithmic else x[1:].T
        duration, rest = x[0], casadi.DM(1, 1)
        b, speed = casadi.horzcat(rest, inside, rest), casadi.horzcat(rest, casadi.sqrt(inside), rest)
        # As a sum of speeds: the square root has no derivative at rest, and there the speed is a constant.
        times = 2 * steps / (speed[:-1] + speed[1:])
        b0, b1 = (casadi.repmat(casadi.horzcat(part, part), rows, 1) for part in (b[:-1], b[1:]))
        g, f = [casadi.vec(left * b0 + right * b1)], scale * duration
        if terms is not None:
            sdd = (b[1:] - b[:-1]) / (2 * steps)
            both = [casadi.horzcat(*pair) for pair in ((sdd, sdd), (b[:-1], b[1:]), (speed[:-1], speed[1:]))]
            values = terms.function.map("along", "serial", 2 * K, [], [])(
                both[0] * rate**2, both[1] * rate**2, both[2] * rate, path
            )
            g.append(casadi.vec(values[0]))
            weight = sum(term.weight for term in terms.objective.terms if isinstance(term, Time))
            f = scale / rate * (weight * duration + casadi.dot(casadi.horzcat(times, times) / 2, values[1]))
        g.append(casadi.sum2(times) - duration)
        p = casadi.vertcat(*(casadi.vec(part) for part in (steps, left, right, path, rate, scale)))
        tolerance = TIME_TOLERANCE if terms is None or terms.objective.has_time else SMOOTH_TOLERANCE
        program = {"x": x, "p": p, "f": f, "g": casadi.vertcat(*g)}
        self.solver = Solver(program, 1, tolerance=tolerance, expand=False)

    def numbers(self, duration: float, b: Array) -> Array:
        """Return the program's variables for b at the inner knots, shape (K-1,)."""
        with np.errstate(divide="ignore"):
            return np.concatenate([[duration], np.log(b) if self.logarithmic else b])

    def squares(self, x: Array) -> Array:
        """Return b at all knots, shape (K+1,), from the program's variables."""
        inside = np.exp(x[1:]) if self.logarithmic else np.maximum(x[1:], 0.0)
        return np.concatenate([[0.0], inside, [0.0]])

    def parameters(self, states: PathStates, rows: list[TimingRows], unit: float, scale: float) -> Array:
        """Return the program's parameters, shape (parameters,); ``unit`` is the unit of time, s."""
        left, right = (self._side(rows, side) / unit**2 for side in ("left", "right"))
        path = states.coefficients.ravel(order="F") if self.terms else np.zeros(0)
        return np.concatenate([states.steps, left.ravel(), right.ravel(), path, [1 / unit, scale]])

    def _side(self, rows: list[TimingRows], side: str) -> Array:
        arrays = [getattr(row, side) for row in rows]
        return np.concatenate(arrays, axis=-1) if arrays else np.zeros((2, self.intervals, 0))


@lru_cache(maxsize=16)
@delayed_interrupts()
def timing_program(intervals: int, rows: int, terms: Terms | None) -> TimingProgram:
    """Return the program of these sizes, built on first use."""
    return TimingProgram(intervals, rows, terms)
