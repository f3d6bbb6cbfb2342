"""A controller simulated in real time, step by step, with gains and loads that change while it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.control import Plant, Push, Setpoint, SimulationResult
from dhkit.control.controller import called, reset, torques
from dhkit.control.events import advanced
from dhkit.control.integrators import RungeKutta, State
from dhkit.control.runs import result_of
from dhkit.description import Array
from dhkit.dynamics import Friction

MOST_ROWS = 20_000
"""Rows that are kept: the first 20 s at 1 kHz, 7 MB for six joints. When they are full every second one is dropped, and
from then on half as many are added, so that a run of any length is kept whole."""
MOST_PUSHES = 32
"""Pushes that act at a time."""

COLUMNS = ("q", "qd", "qdd", "tau", "tau_asked", "reference_q", "reference_qd")
"""What is kept of a period behind its time."""
Wanted = Callable[[float], tuple[Array, Array, Array]]
"""Joint values, rates and accelerations that are asked for at a time."""


class Live:
    """A run that goes on for as long as it is told to.

    Parameters
    ----------
    arm
        What the controller knows.
    plant
        What moves.
    friction
        Of the joints.
    q
        Where it begins, at rest, shape (n,).
    rate
        Calls of the controller, Hz.
    """

    def __init__(self, arm: Arm, plant: Arm, friction: Friction | None, q: Array, rate: float) -> None:
        self.arm, self.rate = arm, rate
        self.controller: Any = None
        self.wanted: Wanted = lambda t: (q, np.zeros(len(q)), np.zeros(len(q)))
        self._pushes: tuple[Push, ...] = ()
        self._friction = friction
        self._plant = self._moving(plant)
        self._state = State(0.0, np.array(q, dtype=float), np.zeros(len(q)), np.zeros(0))
        self._start = self._state
        self._rows = np.zeros((MOST_ROWS, 1 + 7 * len(q)))
        self._count, self._steps, self._stride = 0, 0, 1
        self._turnover = 0.0

    @property
    def t(self) -> float:
        """The time of the run, s."""
        return self._state.t

    @property
    def q(self) -> Array:
        """The joint values now, shape (n,)."""
        return self._state.q

    def take(self, controller: Any) -> None:
        """Put another controller in place of the one there is."""
        reset(controller)
        self.controller = controller

    def change(self, plant: Arm, friction: Friction | None) -> None:
        """Go on with another load or friction.

        What is recorded begins anew: the work of one run is that of one arm.
        """
        self._friction = friction
        self._plant = self._moving(plant)
        state = self._state
        self._start = self._state = State(state.t, state.q, state.qd, state.memory)  # no work is done yet
        self._turnover = 0.0
        self._count, self._steps, self._stride = 0, 0, 1

    def push(self, link: int | None, force: Array, duration: float) -> None:
        """Push from now on for a while.

        Raises
        ------
        ValueError
            Too many pushes act already.
        """
        active = [push for push in self._pushes if push.end > self.t]
        if len(active) >= MOST_PUSHES:
            raise ValueError(f"{MOST_PUSHES} pushes act already; expected at most so many at a time")
        self._pushes = (*active, Push(force, link=link, begin=self.t, end=self.t + duration))
        self._plant = replace(self._plant, pushes=self._pushes)

    def advance(self) -> tuple[Array, Array]:
        """Take one period of the controller; return the errors and the torques, shape (n,) each.

        Raises
        ------
        SimulationError
            The controller fails, or the state is no longer finite.
        """
        plant, state, n = self._plant, self._state, self.arm.n
        setpoint = Setpoint(self.arm.description, *self.wanted(state.t))
        asked = torques(called(self.controller, state.t, state.q.copy(), state.qd.copy(), setpoint), n, state.t)
        effort = plant.description.numbers.effort
        tau = np.clip(asked, -effort, effort)
        phase = plant.phase(state.q, state.qd, tau, plant.active_pushes(state.t))
        self._keep((state.t, *state.q, *state.qd, *phase.qdd, *tau, *asked, *setpoint.q, *setpoint.qd))
        begin, end = state.t, state.t + 1 / self.rate
        edges = sorted({edge for push in self._pushes for edge in (push.begin, push.end) if begin < edge < end})
        integrator = RungeKutta(plant, tau)
        state = advanced(plant, integrator, state, [*edges, end][0], phase)
        for until in [*edges, end][1:]:
            state = advanced(plant, integrator, state, until)
        self._turnover += float(np.abs(tau * (state.q - self._state.q)).sum())
        self._state = state
        return setpoint.q - state.q, tau

    def result(self) -> SimulationResult:
        """Return the run so far.

        Raises
        ------
        ValueError
            Nothing has moved yet.
        """
        if not self._count:
            raise ValueError("nothing has been simulated yet")
        rows = self._rows[: self._count]
        recorded = {"t": rows[:, 0] - rows[0, 0]}
        recorded |= zip(COLUMNS, (x.copy() for x in np.split(rows[:, 1:], len(COLUMNS), axis=1)), strict=True)
        return result_of(
            self.arm.description, self._plant, recorded, self._start, self._state, self._turnover, self.controller
        )

    def _keep(self, row: tuple[float, ...]) -> None:
        if self._steps % self._stride == 0:
            if self._count == MOST_ROWS:
                self._count, self._stride = MOST_ROWS // 2, 2 * self._stride
                self._rows[: self._count] = self._rows[::2].copy()
            self._rows[self._count] = row
            self._count += 1
        self._steps += 1

    def _moving(self, plant: Arm) -> Plant:
        return Plant(plant.description, self._friction, 0.0, self._pushes)
