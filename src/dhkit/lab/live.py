"""A controller simulated in real time, step by step, with gains and loads that change while it runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dhkit.arm import Arm
from dhkit.control import Controller, Plant, Push, Setpoint, SimulationResult
from dhkit.control.controller import call_controller, reset, torques
from dhkit.control.events import advance
from dhkit.control.gains import effective_inertia
from dhkit.control.integrators import RungeKutta, State
from dhkit.control.runs import result_of
from dhkit.description import Array
from dhkit.dynamics import Friction
from dhkit.errors import SimulationError
from dhkit.lab.run_settings import Setpoints

MAX_ROWS = 20_000
"""Largest number of rows that are recorded: 20 s at 1 kHz, 7 MB for six joints. When they are full every second one is
dropped, and from then on half as many are added, so that a run of any length is recorded whole."""
MAX_PUSHES = 32
"""Largest number of pushes that act at a time."""
ALTERNATIONS = 20
"""Changes of sign, one at every sample, from which growth counts."""
GROWTH = 10.0
"""Growth of the torque since the first of them that counts as unstable; a sliding mode alternates without growing."""
NEGLIGIBLE = 1e-6
"""Torque, N m or N, below which rounding changes signs."""
COLUMNS = ("q", "qd", "qdd", "tau", "tau_asked", "reference_q", "reference_qd")
"""Quantities, of n numbers each, that a recorded row holds after its time."""


class Live:
    """A run that goes on for as long as it is advanced.

    Parameters
    ----------
    arm
        The arm that the controller knows, of n joints.
    plant
        The arm that is simulated.
    friction
        Friction of the joints.
    q
        Joint values at the beginning, at rest, shape (n,), rad and m.
    rate
        Calls of the controller per second, Hz.
    """

    def __init__(
        self, arm: Arm, plant: Arm, friction: Friction | None, q: Array, rate: float
    ) -> None:
        self.arm = arm
        self.rate = rate
        self.controller: Controller | None = None
        self._watch = AlternationWatch(arm.n)
        self.setpoints: Setpoints = lambda t: (q, np.zeros(len(q)), np.zeros(len(q)))
        self._pushes: tuple[Push, ...] = ()
        self._plant = Plant(plant.description, friction, 0.0, ())
        self._state = State(0.0, np.array(q, dtype=float), np.zeros(len(q)), np.zeros(0))
        self._rows = np.zeros((MAX_ROWS, 1 + len(COLUMNS) * len(q)))
        self._begin_record(self._state)

    @property
    def t(self) -> float:
        """The time of the run, s."""
        return self._state.t

    @property
    def q(self) -> Array:
        """The joint values now, shape (n,), rad and m."""
        return self._state.q

    @property
    def setpoint_q(self) -> Array:
        """The joint values to follow now, shape (n,), rad and m."""
        return self.setpoints(self.t)[0]

    def take(self, controller: Controller) -> None:
        """Use another controller from now on; it is reset."""
        reset(controller)
        self.controller = controller
        self._watch = AlternationWatch(self.arm.n)

    def change(self, plant: Arm, friction: Friction | None) -> None:
        """Simulate another load or friction from now on.

        The record begins anew, since the work in a record is that of one arm.
        """
        self._plant = Plant(plant.description, friction, 0.0, self._pushes)
        state = self._state
        # The new record has done no work yet.
        self._begin_record(State(state.t, state.q, state.qd, state.memory))

    def push(self, link: int | None, force: Array, duration: float) -> None:
        """Push from now on for a duration, s.

        Parameters
        ----------
        link
            The link, from 1, or None for the tool.
        force
            Force in the world, shape (3,), N.
        duration
            Duration, s.

        Raises
        ------
        ValueError
            Too many pushes act already.
        """
        active = [push for push in self._pushes if push.end > self.t]
        if len(active) >= MAX_PUSHES:
            raise ValueError(f"{MAX_PUSHES} pushes act already; expected at most so many at a time")
        self._pushes = (*active, Push(force, link=link, begin=self.t, end=self.t + duration))
        self._plant = replace(self._plant, pushes=self._pushes)

    def advance(self) -> tuple[Array, Array]:
        """Simulate one period of the controller.

        Returns
        -------
        tuple[Array, Array]
            Errors of the joint values (rad and m) and torques (N m and N) at its beginning, shape (n,) each.

        Raises
        ------
        SimulationError
            The controller fails, its torque alternates and grows, or the state is no longer finite.
        """
        plant = self._plant
        state = self._state
        n = self.arm.n
        assert self.controller is not None  # noqa: S101 - for mypy: a controller was taken before
        setpoint = Setpoint(self.arm.description, *self.setpoints(state.t))
        returned = call_controller(
            self.controller, state.t, state.q.copy(), state.qd.copy(), setpoint
        )
        commanded = torques(returned, n, state.t)
        self._require_stable(commanded, state.t)
        effort = plant.description.numbers.effort
        tau = np.clip(commanded, -effort, effort)
        phase = plant.phase(state.q, state.qd, tau, plant.active_pushes(state.t))
        self._record(
            (state.t, *state.q, *state.qd, *phase.qdd, *tau, *commanded, *setpoint.q, *setpoint.qd)
        )
        begin = state.t
        end = state.t + 1 / self.rate
        edges = {push.begin for push in self._pushes} | {push.end for push in self._pushes}
        inner_edges = sorted(edge for edge in edges if begin < edge < end)
        integrator = RungeKutta(plant, tau)
        first_end, *later_ends = [*inner_edges, end]
        state = advance(plant, integrator, state, first_end, phase)
        for time in later_ends:
            state = advance(plant, integrator, state, time)
        self._turnover += float(np.abs(tau * (state.q - self._state.q)).sum())
        self._state = state
        return setpoint.q - state.q, tau

    def _require_stable(self, tau: Array, t: float) -> None:
        """Refuse torques, shape (n,), of which one has alternated at every sample and grown."""
        joint = self._watch.unstable_joint(tau)
        if joint is None:
            return
        m = float(effective_inertia(self._plant.description, self._state.q)[joint])
        name = self.arm.description.joints[joint].name
        unit = "N m s/rad" if self.arm.description.joints[joint].is_revolute else "N s/m"
        raise SimulationError(
            f"unstable after {t:.3g} s: the torque of {name} changes its sign at every sample and grows; at"
            f" {self.rate:g} Hz its damping kd has to stay below 2 m rate = {2 * m * self.rate:.3g} {unit},"
            f" with the effective inertia m = {m:.3g}"
        )

    def result(self) -> SimulationResult:
        """Return the recorded run.

        Raises
        ------
        ValueError
            Nothing has moved yet.
        """
        if not self._count:
            raise ValueError("nothing has been simulated yet")
        rows = self._rows[: self._count]
        recorded = {"t": rows[:, 0] - rows[0, 0]}
        recorded |= zip(
            COLUMNS, (x.copy() for x in np.split(rows[:, 1:], len(COLUMNS), axis=1)), strict=True
        )
        return result_of(
            self.arm.description,
            self._plant,
            recorded,
            self._start,
            self._state,
            self._turnover,
            self.controller,
        )

    def _begin_record(self, state: State) -> None:
        self._start = self._state = state
        self._turnover = 0.0
        self._count = 0
        self._steps = 0
        self._stride = 1

    def _record(self, row: tuple[float, ...]) -> None:
        if self._steps % self._stride == 0:
            if self._count == MAX_ROWS:
                self._count = MAX_ROWS // 2
                self._stride = 2 * self._stride
                self._rows[: self._count] = self._rows[::2].copy()
            self._rows[self._count] = row
            self._count += 1
        self._steps += 1


class AlternationWatch:
    """The changes of sign of n torques: of a sampled controller with too much damping for its rate.

    For a joint of inertia m under tau = -kd qd, held for h seconds, qd_(k+1) = (1 - kd h / m) qd_k. Beyond kd h = 2 m
    the velocity, and with it the torque, changes its sign at every sample and grows: the sampled loop is unstable
    although the continuous one is not (Franklin, Powell, Workman, Digital Control of Dynamic Systems, 1998, ch. 8).
    """

    def __init__(self, n: int) -> None:
        self._last = np.zeros(n)
        self._count = np.zeros(n, dtype=int)
        self._first = np.zeros(n)
        """Size of each torque when its present run of alternations began."""

    def unstable_joint(self, tau: Array) -> int | None:
        """Take the next torques, shape (n,), N m and N; return the first joint, from 0, that is unstable, if any is."""
        alternates = (tau * self._last < 0) & (np.abs(tau) > NEGLIGIBLE)
        self._count = np.where(alternates, self._count + 1, 0)
        self._first = np.where(self._count <= 1, np.abs(tau), self._first)
        self._last = tau.copy()
        grows = (self._count >= ALTERNATIONS) & (np.abs(tau) > GROWTH * self._first)
        return int(np.argmax(grows)) if grows.any() else None
