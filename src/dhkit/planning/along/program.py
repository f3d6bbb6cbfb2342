"""How fast along a given path, as a program: its squares of speed b = sd^2, and limits that are linear in them.

In b it is convex: Verscheure et al. 2009, Time-optimal path tracking for robots, section III.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.path_states import PathStates
from dhkit.planning.along.rows import TimingRows
from dhkit.planning.along.terms import Terms
from dhkit.planning.objectives import Time
from dhkit.planning.solver import Solver

SMALLEST = 1e-7
"""The smallest b inside, where 1 is about the path's mean: ipopt widens bounds by a tenth of it."""
LEAST_TIME, SMOOTH = 1e-7, 1e-8
"""Ipopt's tolerances where time counts, which is then 1, and for other objectives; each limit that is reached costs a
tenth of it."""


class TimingProgram:
    """A program for K intervals with so many linear rows at each end; made once for each combination.

    Its numbers are the duration and b at the knots inside, in units of a time that its caller chooses; its rows are
    the linear ones, (2, K, rows) flattened; those of ``terms``, a column of rows for each end, left ends first; and by
    how much the intervals take longer than the duration. In least time it is convex. Other objectives are not: slow
    motions linger where gravity is least, and logarithms of b follow them over their decades.
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
        # Written as a sum of speeds: at rest the square root has no derivative, and there it is a constant.
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
        tolerance = LEAST_TIME if terms is None or terms.objective.has_time else SMOOTH
        program = {"x": x, "p": p, "f": f, "g": casadi.vertcat(*g)}
        self.solver = Solver(program, 1, tolerance=tolerance, expand=False)

    def numbers(self, duration: float, b: Array) -> Array:
        """Return the program's numbers for b at the knots inside, shape (K-1,)."""
        with np.errstate(divide="ignore"):
            return np.concatenate([[duration], np.log(b) if self.logarithmic else b])

    def squares(self, x: Array) -> Array:
        """Return b at all knots, shape (K+1,), of the program's numbers."""
        inside = np.exp(x[1:]) if self.logarithmic else np.maximum(x[1:], 0.0)
        return np.concatenate([[0.0], inside, [0.0]])

    def parameters(self, states: PathStates, rows: list[TimingRows], unit: float, scale: float) -> Array:
        """Return the program's parameters; ``unit``: its time, s."""
        left, right = (self._side(rows, side) / unit**2 for side in ("left", "right"))
        path = states.coefficients.ravel(order="F") if self.terms else np.zeros(0)
        return np.concatenate([states.steps, left.ravel(), right.ravel(), path, [1 / unit, scale]])

    def _side(self, rows: list[TimingRows], side: str) -> Array:
        arrays = [getattr(row, side) for row in rows]
        return np.concatenate(arrays, axis=-1) if arrays else np.zeros((2, self.intervals, 0))


@lru_cache(maxsize=16)
def timing_program(intervals: int, rows: int, terms: Terms | None) -> TimingProgram:
    """Return a program, made when it is first asked for."""
    return TimingProgram(intervals, rows, terms)
