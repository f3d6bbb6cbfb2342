"""Work done in the search for a motion, and the limits at which the search ends."""

from __future__ import annotations

import time
from dataclasses import dataclass
from numbers import Integral, Real

import numpy as np

from dhkit.errors import PlanningError

MAX_ITERATIONS = 1000
"""Default limit of a search, iterations of the optimizer in all its solutions.

It counts work, not time, so that the result does not depend on what else the machine does. An iteration takes 5 to
10 ms for two joints, 8 to 20 ms for six and 15 to 30 ms for seven, so that a search without a result ends after 5 to
30 s. Searches that find a motion take 10 to 40 iterations without obstacles, 30 to 600 with them or for least energy.
"""
STATES_PER_ITERATION = 250
"""Number of states tested for collisions, for sampled paths, that count as one iteration: they take about as long."""


class SearchLimitError(PlanningError):
    """The limit of a search was reached."""


@dataclass
class Work:
    """Work of all solutions for one motion, those of failed branches too, and its limits."""

    max_iterations: int = MAX_ITERATIONS
    """Iterations of the optimizer, with those that the tested states count for, at which the search ends."""
    time_limit: float = np.inf
    """Time at which it ends as well, s; not limited unless the caller asks for it."""
    began: float = 0.0
    """Time at which the search began, on the clock of ``time.perf_counter``, s."""
    iterations: int = 0
    states: int = 0
    """States tested for collisions by the sampling of paths."""
    solves: int = 0
    build_seconds: float = 0.0
    """Time for making programs, s."""

    @classmethod
    def limited(cls, max_iterations: object, time_limit: object) -> Work:
        """Return the work of a search that begins now; ``time_limit`` (s) may be None.

        Raises
        ------
        ValueError
            A limit that is not positive, or not a number.
        """
        if (
            isinstance(max_iterations, bool)
            or not isinstance(max_iterations, Integral)
            or max_iterations < 1
        ):
            raise ValueError(
                f"max_iterations is {max_iterations!r}; expected a positive whole number"
            )
        if time_limit is None:
            time_limit = np.inf
        if not isinstance(time_limit, Real) or not float(time_limit) > 0:
            raise ValueError(
                f"time_limit is {time_limit!r}; expected a positive number, s, or None"
            )
        return cls(int(max_iterations), float(time_limit), time.perf_counter())

    @property
    def spent(self) -> float:
        """Share of the limits that is spent, of the one that is nearer; the search ends at 1."""
        of_work = (self.iterations + self.states / STATES_PER_ITERATION) / self.max_iterations
        if self.time_limit == np.inf:
            return of_work
        return max(of_work, (time.perf_counter() - self.began) / self.time_limit)

    @property
    def is_over(self) -> bool:
        """Whether a limit is reached."""
        return self.spent >= 1

    @property
    def limit_text(self) -> str:
        """The limits as words of a sentence."""
        limit = f"{self.max_iterations} iterations"
        return limit if self.time_limit == np.inf else f"{limit} and {self.time_limit:g} s"

    def require_left(self) -> None:
        """Raise SearchLimitError if a limit is reached."""
        if self.is_over:
            raise SearchLimitError(f"no motion found within {self.limit_text}")
