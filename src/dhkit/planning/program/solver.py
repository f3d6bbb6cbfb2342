"""Ipopt with options chosen by measurement, and a callback for progress, limits and interruption."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dhkit.description import Array
from dhkit.display import value_line
from dhkit.planning.program.blocks import BlockProgram, Scaling
from dhkit.planning.program.work import Work

if TYPE_CHECKING:
    import casadi

OPTIONS: dict[str, Any] = {
    "print_level": 0,
    "sb": "yes",
    "mu_strategy": "monotone",
    "mu_init": 1e-3,
    "nlp_scaling_method": "none",
    "tol": 1e-4,
    "constr_viol_tol": 1e-7,
    "acceptable_iter": 0,
    "max_iter": 500,
    "first_hessian_perturbation": 1e-8,
    "max_hessian_perturbation": 1e4,
}
"""Options of Ipopt: for minimum time, twice as fast as its defaults and as reliable.

Where the Hessian is not positive definite, Ipopt adds a multiple of 1 to it. Its first try, 1e-4, is large for
variables of order one, and made some motions creep along curved paths in 60 to 70 iterations; so tries begin at 1e-8.
They end at 1e4, beyond which a step is next to nothing: with Ipopt's 1e20 an iteration that diverges factorizes its
matrix thirty times, and took 130 ms instead of 10.
"""
WARM_PUSH = 1e-6
"""Least distance from bounds, in scaled units, to which Ipopt moves a warm start; its default, 1e-3, moves it far."""
WARM_OPTIONS: dict[str, Any] = {
    **OPTIONS,
    "mu_init": 1e-6,
    "warm_start_init_point": "yes",
    "warm_start_bound_push": WARM_PUSH,
    "warm_start_bound_frac": WARM_PUSH,
    "warm_start_slack_bound_push": WARM_PUSH,
    "warm_start_slack_bound_frac": WARM_PUSH,
    "warm_start_mult_bound_push": WARM_PUSH,
}
"""Options from a solution with other bounds and its multipliers: half to a fifth of the iterations."""

INVALID_NUMBER = "Invalid_Number_Detected"
"""Ipopt's status where rows, costs or derivatives are NaN or infinite."""


@dataclass(frozen=True)
class Progress:
    """State of a running solution."""

    iteration: int
    duration: float
    """Duration of the present iterate, s."""
    infeasibility: float
    """Largest violation of a row's bounds."""
    seconds: float
    """Time since the solution began, s."""
    spent: float
    """Share of the search's limit that is spent, with earlier solutions, 0 to 1."""

    __repr__ = value_line


ProgressCall: TypeAlias = Callable[[Progress], object]
"""Callback in each iteration; an exception in it ends the solution."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of Ipopt."""

    x: Array
    g: Array
    converged: bool
    status: str
    """Ipopt's return status."""
    iterations: int
    infeasibility: float
    cost: float
    multipliers: tuple[Any, Any]
    """Multipliers of the variables' bounds and of the rows, in the units of the solution."""


class Solver:
    """Ipopt for one program; calls from several threads take turns."""

    def __init__(self, program: BlockProgram, legs: int, *, tolerance: float) -> None:
        import casadi

        self.tolerance = tolerance
        self._unscaled = program.unscaled
        function, derivatives = program.functions
        sizes = program.variables, program.rows, program.parameters + len(program.unscaled.vector)
        self._watch = _watch(*sizes, legs)
        self._function = function

        def made(options: dict[str, Any]) -> casadi.Function:
            of_all: dict[str, Any] = {
                **derivatives,
                "print_time": False,
                "calc_lam_p": False,
                "show_eval_warnings": False,
                "iteration_callback": self._watch,
                "ipopt": {**options, "tol": tolerance},
            }
            return casadi.nlpsol("plan", "ipopt", function, of_all)

        self._cold = made(OPTIONS)
        self._warm = cache(lambda: made(WARM_OPTIONS))
        self._turn = threading.Lock()

    def __call__(
        self,
        x0: Array,
        parameters: Array,
        x_bounds: tuple[Array, Array],
        g_bounds: tuple[Array, Array],
        work: Work,
        progress: ProgressCall | None = None,
        scaling: Scaling | None = None,
        warm: Solution | None = None,
    ) -> Solution:
        """Solve from x0.

        Parameters
        ----------
        warm
            A solution with other bounds in the same units, to start from instead of x0.
        scaling
            Units in which tolerances hold.
        work
            Counts the iterations, and says when to stop.

        Raises
        ------
        SearchLimitError
            The limit of the work was reached.
        """
        units = scaling or self._unscaled
        lower_x, upper_x = x_bounds
        lower_g, upper_g = g_bounds

        # Ipopt's variables are y = (x - offset) / unit and its rows h = g / row_unit, see :class:`BlockProgram`.
        lbx = units.scaled(lower_x)
        ubx = units.scaled(upper_x)
        lbg = lower_g / units.row_unit
        ubg = upper_g / units.row_unit
        p = np.concatenate([parameters, units.vector])
        with self._turn, delayed_interrupts() as interrupts:
            self._watch.begin((lbg, ubg), units, work, progress, interrupts)
            given = {"x0": units.scaled(x0), "p": p, "lbx": lbx, "ubx": ubx, "lbg": lbg, "ubg": ubg}
            function = self._cold
            if warm is not None:
                function = self._warm()
                of_bounds, of_rows = warm.multipliers
                given |= {"x0": units.scaled(warm.x), "lam_x0": of_bounds, "lam_g0": of_rows}
            found = function(**given)
            raised = self._watch.end()
            stats = function.stats()
        if raised is not None:
            raise raised
        success = bool(stats["success"])
        status = str(stats["return_status"])
        iterations = int(stats["iter_count"])
        if status == INVALID_NUMBER:  # Ipopt returns no rows then
            found |= self._function(x=found["x"], p=p)
        x = np.array(found["x"]).ravel()
        g = np.array(found["g"]).ravel()
        misses = max(_outside(x, lbx, ubx), _outside(g, lbg, ubg))
        return Solution(
            units.variables(x),
            g * units.row_unit,
            success,
            status,
            iterations,
            misses,
            float(found["f"]),
            (found["lam_x"], found["lam_g"]),
        )


@contextmanager
def delayed_interrupts() -> Iterator[list[BaseException]]:
    """Delay KeyboardInterrupt until the end of the block; the block can look at the list of those that arrived.

    CasADi discards exceptions: those in callbacks, and those in the properties of its Python classes, which its
    operators read. A KeyboardInterrupt that is raised there is lost.
    """
    arrived: list[BaseException] = []
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield arrived
        return

    def keep(number: int, frame: FrameType | None) -> None:
        try:
            # Without the frame: wherever it is, what the handler raises is not lost.
            handler(number, None)
        except BaseException as error:
            arrived.append(error)

    signal.signal(signal.SIGINT, keep)
    try:
        yield arrived
    finally:
        signal.signal(signal.SIGINT, handler)
        if arrived:
            raise arrived[0]


def _outside(values: Array, low: Array, high: Array) -> float:
    """Return the largest violation of bounds; infinite if it is not a number."""
    worst = np.max(np.maximum(low - values, values - high), initial=0.0)
    return float(worst) if np.isfinite(worst) else float("inf")


def _watch(nx: int, ng: int, np_: int, legs: int) -> Any:
    """Return the callback that Ipopt calls in each iteration."""
    import casadi

    class Watch(casadi.Callback):
        raised: BaseException | None = None

        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.construct("watch", {})

        def begin(
            self,
            bounds: tuple[Array, Array],
            units: Scaling,
            work: Work,
            progress: ProgressCall | None,
            interrupts: list[BaseException],
        ) -> None:
            self.bounds = bounds
            self.units = units
            self.work = work
            self.progress = progress
            self.interrupts = interrupts
            self.started = time.perf_counter()
            self.iteration = 0
            self.raised = None

        def end(self) -> BaseException | None:
            raised = self.raised
            self.raised = None
            self.progress = None
            return raised

        def get_n_in(self) -> int:
            return int(casadi.nlpsol_n_out())

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> casadi.Sparsity:
            size = {"x": nx, "lam_x": nx, "f": 1, "g": ng, "lam_g": ng, "lam_p": np_}[
                casadi.nlpsol_out(i)
            ]
            return casadi.Sparsity.dense(size, 1)

        def eval(self, arguments: Any) -> list[int]:
            self.iteration += 1
            # The first call is before the first iteration.
            self.work.iterations += self.iteration > 1
            try:
                self.work.require_left()
                if self.interrupts:
                    return [1]
                if self.progress is not None:
                    values = dict(zip(casadi.nlpsol_out(), arguments, strict=True))
                    duration = float(
                        self.units.variables(np.array(values["x"]).ravel())[:legs].sum()
                    )
                    misses = _outside(np.array(values["g"]).ravel(), *self.bounds)
                    seconds = time.perf_counter() - self.started
                    self.progress(
                        Progress(self.iteration - 1, duration, misses, seconds, self.work.spent)
                    )
            except BaseException as error:  # Ipopt would discard it, KeyboardInterrupt too
                self.raised = error
                return [1]
            return [0]

    return Watch()
