"""Running a controller on a plant: sampled, with the torque held from one sample to the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NoReturn, Protocol

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.plant import Plant
from dhkit.control.references import Held, Reference, Setpoint, reference_of
from dhkit.control.result import EnergyAudit, SimulationResult
from dhkit.control.steps import State, advanced
from dhkit.description import Array, Description, joint_vector
from dhkit.dynamics import kinetic_energy
from dhkit.errors import SimulationError
from dhkit.trajectories import Trajectory

__all__ = ["Controller", "simulate"]

MOST_STEPS = 10_000_000
"""Of one run: what is kept of them is about 5 kB a step for each joint."""

Progress = Callable[[int, int], None]
"""Called with how many steps are done and how many there are."""


class Controller(Protocol):
    """Anything that is called with the time, the joint values, their rates and a setpoint, and returns torques (n,).

    Where it has a method ``reset()``, that is called before each run.
    """

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint, /) -> ArrayLike:
        """Return the torques to give from now on, N m and N."""


def simulate(
    description: Description,
    controller: Controller | None = None,
    reference: Reference | Trajectory | ArrayLike | None = None,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    qd0: ArrayLike | None = None,
    rate: float = 1000.0,
    plant: Plant | None = None,
    plant_rate: float | None = None,
    *,
    saturation: bool = True,
    progress: Progress | None = None,
) -> SimulationResult:
    """Return how an arm moves under a controller that is called at a rate and whose torques are held in between.

    The plant is integrated by the classical Runge-Kutta method in steps of 1 / ``plant_rate``, split where a joint
    with stiction stops or breaks away and where one hits its stop.

    Parameters
    ----------
    description
        The robot.
    controller
        See :class:`Controller`; None for no torque.
    reference
        What is to be followed: a motion, joint values (n,) to hold, or a :class:`Reference`. None holds ``q0``.
    duration
        s; that of the reference unless given.
    q0, qd0
        Where the run begins, shape (n,), rad, m and per second; where the reference begins, at rest, unless given.
    rate
        Calls of the controller, Hz.
    plant
        What moves, where it differs from the robot: see :class:`Plant`. The robot without friction, with inelastic
        stops, unless given.
    plant_rate
        Steps of the integration, Hz, a multiple of ``rate``; ``rate`` unless given.
    saturation
        Whether torques are cut off at the drives' limits.
    progress
        Called after every thousand steps; an exception in it ends the run.

    Returns
    -------
    SimulationResult
        N+1 states.

    Raises
    ------
    SimulationError
        The controller raises or returns what is no finite (n,) array, or the arm's state is no longer finite: names the
        time; ``result`` holds what was simulated until then.
    DescriptionError
        A link without a body.
    ValueError, TypeError
        An argument that does not fit: says which, and what is expected.
    """
    moved = Plant(description) if plant is None else plant
    if moved.description.kinds != description.kinds:
        raise ValueError(f"the plant has joints {moved.description.kinds}; expected {description.kinds}")
    wanted = _wanted(description, reference, q0)
    steps, substeps = _step_counts(wanted, duration, rate, plant_rate)
    t = np.arange(steps + 1) / rate
    asked = _sampled(description, wanted, t)
    start = State(0.0, _state(description, q0, asked[0][0], "q0"), _state(description, qd0, asked[1][0], "qd0"))
    run = _Run(description, moved, controller, t, asked, saturation)
    return run(start, substeps, progress)


def _wanted(description: Description, reference: Any, q0: ArrayLike | None) -> Reference:
    if reference is not None:
        return reference_of(description, reference)
    return Held(_state(description, q0, np.zeros(description.n), "q0"))


def _step_counts(
    reference: Reference, duration: float | None, rate: float, plant_rate: float | None
) -> tuple[int, int]:
    """Return the control steps of a run, and the integration's steps in each."""
    for name, value in (("rate", rate), ("plant_rate", plant_rate), ("duration", duration)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value!r}; expected a positive number")
    span = reference.duration if duration is None else duration
    if span is None:
        raise ValueError("duration is not given, and the reference has no end")
    steps = max(1, round(span * rate))
    if steps > MOST_STEPS:
        raise ValueError(f"{span:g} s at {rate:g} Hz are {span * rate:.3g} steps; expected at most {MOST_STEPS:,}")
    substeps = 1 if plant_rate is None else plant_rate / rate
    if abs(substeps - round(substeps)) > 1e-9 or substeps < 1 - 1e-9:
        raise ValueError(f"plant_rate is {plant_rate:g}; expected a multiple of rate, {rate:g}")
    return steps, round(substeps)


def _state(description: Description, given: ArrayLike | None, default: Array, name: str) -> Array:
    return (default if given is None else joint_vector(description, given, name)).copy()


def _sampled(description: Description, reference: Reference, t: Array) -> tuple[Array, Array, Array]:
    q, qd, qdd = reference.sampled(t)
    for name, value in (("q", q), ("qd", qd), ("qdd", qdd)):
        if np.shape(value) != (len(t), description.n) or not np.isfinite(value).all():
            shape = (len(t), description.n)
            raise ValueError(f"the reference's {name} has shape {np.shape(value)}; expected {shape}, finite")
    return np.asarray(q, dtype=float), np.asarray(qd, dtype=float), np.asarray(qdd, dtype=float)


class _Run:
    """One run, and what it has seen so far."""

    def __init__(
        self,
        description: Description,
        plant: Plant,
        controller: Controller | None,
        t: Array,
        asked: tuple[Array, Array, Array],
        saturation: bool,
    ) -> None:
        self.description, self.plant, self.controller = description, plant, controller
        self.t, self.asked = t, asked
        self.most = plant.description.numbers.effort if saturation else np.full(plant.n, np.inf)
        shape = (len(t), plant.n)
        self.q, self.qd, self.qdd, self.tau, self.tau_asked = (np.zeros(shape) for _ in range(5))
        self.work, self.turnover, self.energy = 0.0, 0.0, 0.0

    def __call__(self, state: State, substeps: int, progress: Progress | None) -> SimulationResult:
        plant, steps = self.plant, len(self.t) - 1
        reset = getattr(self.controller, "reset", None)
        if callable(reset):
            reset()
        self.energy = plant.energy(state.q, state.qd)
        edges = sorted({edge for push in plant.pushes for edge in (push.begin, push.end)})
        for k in range(steps + 1):
            tau = self._commanded(k, state)
            self._keep(k, state, tau)
            if k == steps:
                break
            begin, end = self.t[k], self.t[k + 1]
            times = [begin + (end - begin) * (i + 1) / substeps for i in range(substeps - 1)]
            q_before = state.q
            for until in _split([*times, end], begin, edges):
                state = advanced(plant, state, tau, plant.active_pushes(state.t), until)
            if not (np.isfinite(state.q).all() and np.isfinite(state.qd).all()):
                self._fail(k, f"the arm's state is no longer finite after {end:g} s", state)
            given = tau * (state.q - q_before)
            self.work += float(given.sum())
            self.turnover += float(np.abs(given).sum())
            if progress is not None and k % 1000 == 999:
                progress(k + 1, steps)
        return self._result(steps, state)

    def _commanded(self, k: int, state: State) -> Array:
        """Return the torques that the drives give from a sample on."""
        n = self.plant.n
        if self.controller is None:
            return np.zeros(n)
        time = float(self.t[k])
        setpoint = Setpoint(self.description, *(array[k] for array in self.asked))
        try:
            asked = np.asarray(self.controller(time, state.q.copy(), state.qd.copy(), setpoint), dtype=float)
        except Exception as error:
            self._fail(k - 1, f"the controller raised {type(error).__name__} at {time:g} s: {error}", state, error)
        if asked.shape != (n,) or not np.isfinite(asked).all():
            found = f"shape {asked.shape}" if asked.shape != (n,) else f"{asked.tolist()}"
            self._fail(k - 1, f"the controller returned {found} at {time:g} s; expected ({n},) finite torques", state)
        self.tau_asked[k] = asked
        given: Array = np.clip(asked, -self.most, self.most)
        return given

    def _keep(self, k: int, state: State, tau: Array) -> None:
        plant = self.plant
        self.q[k], self.qd[k], self.tau[k] = state.q, state.qd, tau
        pushes = plant.active_pushes(state.t)
        contact = plant.contact(state.q, state.qd, tau, pushes)
        self.qdd[k] = plant.moving(state.q, state.qd, tau, contact, pushes)

    def _fail(self, k: int, message: str, state: State, cause: Exception | None = None) -> NoReturn:
        error = SimulationError(message)
        error.result = self._result(k, state) if k >= 0 else None
        raise error from cause

    def _result(self, k: int, state: State) -> SimulationResult:
        rows = slice(0, k + 1)
        moving = float(kinetic_energy(self.plant.description, self.q[rows], self.qd[rows]).max())
        audit = EnergyAudit(
            change=self.plant.energy(self.q[k], self.qd[k]) - self.energy,
            drives=self.work,
            pushes=state.push_work,
            friction=state.friction_work,
            impacts=state.impact_loss,
            turnover=self.turnover + moving,
        )
        return SimulationResult(
            description=self.plant.description,
            t=self.t[rows],
            q=self.q[rows],
            qd=self.qd[rows],
            qdd=self.qdd[rows],
            tau=self.tau[rows],
            tau_asked=self.tau_asked[rows],
            reference_q=self.asked[0][rows],
            reference_qd=self.asked[1][rows],
            audit=audit,
            saturated=np.mean(self.tau[rows] != self.tau_asked[rows], axis=0),
        )


def _split(times: Sequence[float], begin: float, edges: Sequence[float]) -> list[float]:
    """Return times with the edges of pushes that lie between them."""
    return sorted({*times, *(edge for edge in edges if begin < edge < times[-1])})
