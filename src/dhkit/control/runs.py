"""One run of a controller on a plant: sampled, with torques held between samples, or continuous."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from dhkit.control.controller import (
    Controller,
    call_controller,
    continuous_law,
    name_of,
    reset,
    torques,
)
from dhkit.control.events import advance
from dhkit.control.integrators import DormandPrince, Integrator, RungeKutta, State
from dhkit.control.plant import Plant
from dhkit.control.references import Reference, Setpoint
from dhkit.control.result import EnergyAudit, SimulationResult
from dhkit.control.sensors import Measuring
from dhkit.control.timing import sampled_reference
from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.description.frames import has_same_geometry
from dhkit.dynamics import kinetic_energy
from dhkit.errors import SimulationError
from dhkit.kinematics import forward_kinematics

Progress: TypeAlias = Callable[[int, int], None]
"""Callback with the number of steps done and the number of all steps."""
LONGEST_STEP = 2e-3
"""Longest integration step (s) where a controller, friction or a stop may change the torques suddenly: a longer step
could pass over the change."""
PAIR = ("torques", "derivatives of the states")
PROGRESS_EVERY = 1000
"""Steps between two calls of the progress callback."""


class Run(ABC):
    """A simulation run, with the rows recorded so far.

    Parameters
    ----------
    description
        The robot that the controller and the reference know.
    plant
        The arm that moves.
    controller
        The controller; None for no torques.
    t
        Times of the rows, shape (N+1,), s.
    reference
        Joint values, rates and accelerations at these times, shape (N+1, n) each.
    effort_limits
        Largest torques of the drives, shape (n,), N m and N.
    """

    def __init__(
        self,
        description: Description,
        plant: Plant,
        controller: Controller | None,
        t: Array,
        reference: tuple[Array, Array, Array],
        effort_limits: Array,
    ) -> None:
        self.description = description
        self.plant = plant
        self.controller = controller
        self.t = t
        self.reference = reference
        self.effort_limits = effort_limits
        self.q, self.qd, self.qdd, self.tau, self.tau_asked = (
            np.zeros((len(t), plant.n)) for _ in range(5)
        )
        self.turnover = 0.0

    @abstractmethod
    def integrator(self, k: int, state: State) -> tuple[Array, Integrator]:
        """Return the commanded torques in row k, shape (n,), N m and N, and the integrator to the next row."""

    def __call__(self, state: State, progress: Progress | None = None) -> SimulationResult:
        """Run from a state to the last row and return the result.

        Raises
        ------
        SimulationError
            With the result of all rows so far.
        """
        plant = self.plant
        steps = len(self.t) - 1
        edges = self.edges()
        first = state
        kept = -1
        try:
            for k in range(steps + 1):
                commanded, integrator = self.integrator(k, state)
                tau = integrator.torque(state)
                phase = plant.phase(state.q, state.qd, tau, plant.active_pushes(state.t))
                self.q[k] = state.q
                self.qd[k] = state.qd
                self.qdd[k] = phase.qdd
                self.tau[k] = tau
                self.tau_asked[k] = commanded
                kept = k
                last = state
                if k == steps:
                    break
                stops = self.stops(k, edges)
                state = advance(plant, integrator, state, stops[0], phase)
                for until in stops[1:]:
                    state = advance(plant, integrator, state, until)
                # Integral of |tau_i qd_i| over the row, for torques that are held and rates that keep their sign: the
                # audit's error is relative to it.
                self.turnover += float(np.abs(tau * (state.q - last.q)).sum())
                if progress is not None and k % PROGRESS_EVERY == PROGRESS_EVERY - 1:
                    progress(k + 1, steps)
        except SimulationError as error:
            error.result = self.result(kept, first, last) if kept >= 0 else None
            raise
        return self.result(steps, first, state)

    def edges(self) -> list[float]:
        """Return the times (s) at which torques jump, apart from those of the rows, ascending."""
        begins = {push.begin for push in self.plant.pushes}
        ends = {push.end for push in self.plant.pushes}
        return sorted(begins | ends)

    def stops(self, k: int, edges: Sequence[float]) -> list[float]:
        """Return the times at which integration from row k to the next one pauses, the next row's at the end."""
        begin = self.t[k]
        end = self.t[k + 1]
        return [edge for edge in edges if begin < edge < end] + [float(end)]

    def setpoint(self, k: int) -> Setpoint:
        """Return the setpoint of row k."""
        return Setpoint(self.description, *(array[k] for array in self.reference))

    def result(self, k: int, first: State, last: State) -> SimulationResult:
        """Return the result of the rows up to k."""
        rows = slice(0, k + 1)
        recorded = {
            name: getattr(self, name)[rows] for name in ("t", "q", "qd", "qdd", "tau", "tau_asked")
        }
        recorded |= {
            "reference_q": self.reference[0][rows],
            "reference_qd": self.reference[1][rows],
        }
        return result_of(
            self.description, self.plant, recorded, first, last, self.turnover, self.controller
        )


class SampledRun(Run):
    """A controller that is called once a row, and whose torques are held until the next.

    Parameters
    ----------
    substeps
        Steps of Runge and Kutta's method from one row to the next.
    measuring
        The sensors whose values the controller gets; the true state unless given.
    others
        As for :class:`Run`.
    """

    def __init__(self, *others: Any, substeps: int = 1, measuring: Measuring | None = None) -> None:
        super().__init__(*others)
        self.substeps = substeps
        self.measuring = measuring
        reset(self.controller)

    def integrator(self, k: int, state: State) -> tuple[Array, Integrator]:
        """Return the controller's torques, shape (n,), N m and N, and an integrator that holds them."""
        n = self.plant.n
        t = float(self.t[k])
        if self.controller is None:
            none = np.zeros(n)
            return none, RungeKutta(self.plant, none)
        q, qd = (
            (state.q.copy(), state.qd.copy())
            if self.measuring is None
            else self.measuring(state.q, state.qd)
        )
        commanded = torques(call_controller(self.controller, t, q, qd, self.setpoint(k)), n, t)
        return commanded, RungeKutta(
            self.plant, np.clip(commanded, -self.effort_limits, self.effort_limits)
        )

    def stops(self, k: int, edges: Sequence[float]) -> list[float]:
        """Return the ends of all steps to the next row."""
        begin = self.t[k]
        m = self.substeps
        between = [float(begin + (self.t[k + 1] - begin) * i / m) for i in range(1, m)]
        return sorted({*between, *super().stops(k, edges)})


class ContinuousRun(Run):
    """A controller in continuous time: a part of the differential equation, as are its own states.

    Parameters
    ----------
    continuous_reference
        The reference, sampled at the times of the integrator.
    q0
        Joint values at the start, shape (n,), rad and m.
    tolerance
        Tolerance of a step's error, relative and absolute.
    others
        As for :class:`Run`.
    """

    def __init__(
        self, *others: Any, continuous_reference: Reference, q0: Array, tolerance: float
    ) -> None:
        super().__init__(*others)
        self.continuous_reference = continuous_reference
        self.memory = np.zeros(0)
        if self.controller is not None:
            reset(self.controller)
            self.memory, self._law = continuous_law(self.controller, q0)
        end = float(self.t[-1])
        inside = [edge for edge in self.edges() if 0 < edge < end]
        longest = np.inf if self.plant.has_no_events and self.controller is None else LONGEST_STEP
        self._integrator = DormandPrince(
            self.plant, self._torques, tolerance, [*inside, end], longest
        )

    def integrator(self, k: int, state: State) -> tuple[Array, Integrator]:
        """Return the torques at a row, shape (n,), N m and N, and the integrator of the whole run."""
        return self._commanded(state.t, state.q, state.qd, state.memory)[0], self._integrator

    def edges(self) -> list[float]:
        """Return the times (s) at which pushes begin or end or the reference jumps, ascending."""
        return sorted(
            {*super().edges(), *(float(x) for x in getattr(self.continuous_reference, "jumps", ()))}
        )

    def _torques(self, t: float, q: Array, qd: Array, memory: Array) -> tuple[Array, Array]:
        commanded, derivative = self._commanded(t, q, qd, memory)
        return np.clip(commanded, -self.effort_limits, self.effort_limits), derivative

    def _commanded(self, t: float, q: Array, qd: Array, memory: Array) -> tuple[Array, Array]:
        n = self.plant.n
        if self.controller is None:
            return np.zeros(n), self.memory
        samples = sampled_reference(self.description, self.continuous_reference, np.array([t]))
        setpoint = Setpoint(self.description, *(array[0] for array in samples))
        returned = call_controller(self._law, t, q.copy(), qd.copy(), setpoint, memory.copy())
        if not isinstance(returned, tuple) or len(returned) != len(PAIR):
            raise SimulationError(
                f"the controller returned {type(returned).__name__} at {t:g} s; expected {PAIR}"
            )
        commanded = torques(returned[0], n, t)
        derivative = number_array(
            returned[1], "derivatives of the controller's states", "(m,)"
        ).reshape(-1)
        if not np.isfinite(derivative).all():
            raise SimulationError(
                f"the controller's states have derivatives that are not finite at {t:g} s"
            )
        if derivative.shape != self.memory.shape:
            raise SimulationError(
                f"the controller's states have {derivative.size} derivatives at {t:g} s; expected {self.memory.size}"
            )
        return commanded, derivative


def result_of(
    description: Description,
    plant: Plant,
    recorded: Mapping[str, Array],
    first: State,
    last: State,
    turnover: float,
    controller: Controller | None,
) -> SimulationResult:
    """Return the result of a run.

    Parameters
    ----------
    description
        The robot that the controller and the reference know.
    plant
        The arm that moved.
    recorded
        Recorded arrays by the names of :class:`SimulationResult`.
    first, last
        The states of the first row and of the last.
    turnover
        Integral of the drives' absolute power, J.
    controller
        The controller, for its name; None for none.
    """
    moving = float(kinetic_energy(plant.description, recorded["q"], recorded["qd"]).max())
    audit = EnergyAudit(
        change=plant.energy(last.q, last.qd) - plant.energy(first.q, first.qd),
        drives=last.drive_work,
        pushes=last.push_work,
        friction=last.friction_work,
        impacts=last.impact_loss,
        turnover=turnover + moving,
    )
    arrays: dict[str, Any] = dict(recorded)
    return SimulationResult(
        description=plant.description,
        **arrays,
        audit=audit,
        reference_poses=_reference_poses(description, plant, recorded["reference_q"]),
        controller=name_of(controller),
        saturated=np.mean(recorded["tau"] != recorded["tau_asked"], axis=0),
    )


def _reference_poses(description: Description, plant: Plant, q: Array) -> Array:
    """Return the poses of the reference if the moving arm has another geometry, shape (N+1, 12); else shape (0, 12)."""
    if has_same_geometry(description, plant.description):
        return np.zeros((0, 12))
    return forward_kinematics(description, q)[:, :3].reshape(-1, 12)
