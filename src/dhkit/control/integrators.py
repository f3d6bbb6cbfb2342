"""Integrators: a Runge-Kutta step under constant torques, and DOP853 for continuous controllers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.integrate import DOP853

from dhkit.control.plant import Phase, Plant
from dhkit.description import Array
from dhkit.errors import SimulationError

USUAL_STEPS_PER_SECOND = 30_000.0
"""Steps of DOP853 in a second of the simulated time that a run may always take: about one in a thousand of them is
usual, and a stiff controller of 1e5 1/s takes about so many."""
STEPS_BEFORE_JUMPS = 30
"""Number of steps beyond the usual ones after which jumps of the torques are looked for."""
MAX_JUMPS = 50
"""Largest number of steps with such a jump before the run takes its usual steps again: a controller may switch at
times, not all the time."""
STEPS_BEFORE_DIVERGENCE = 2_000
"""Number of steps beyond the usual ones after which a run ends whose joints move faster than FASTEST_RATE."""
FASTEST_RATE = 1_000.0
"""Joint rate, rad/s or m/s, that no arm reaches: where a run that takes too many steps is faster, it diverges."""
MAX_EXCESS_STEPS = 50_000
"""Largest number of steps beyond the usual ones, whatever the reason."""
HALVINGS = 24
"""Number of bisections in the search for a jump: a smooth change becomes 2^-24 of itself, 6e-8."""
JUMP_SHARE = 1e-6
"""Share of the torques' whole change on the line searched: a larger change left after all bisections is a jump."""
LOOK_AHEAD = 10.0
"""Length of the line on which a jump is looked for, in steps: a step that is accepted often ends just before the jump
that the rejected, longer steps crossed."""
TORQUE_NOISE = 1e-12
"""Change of torques relative to the largest torque below which it is rounding."""
Torques = Callable[[float, Array, Array, Array], tuple[Array, Array]]
"""Function of time (s), joint values and rates (n,) and the controller's internal states (m,), that returns torques
(n,) and the derivatives of the internal states (m,)."""


@dataclass(frozen=True, eq=False)
class State:
    """State of a run: time, joint values and rates, the controller's internal states, and the works so far."""

    t: float
    q: Array
    qd: Array
    memory: Array
    """Internal states of a continuous controller, shape (m,)."""
    drive_work: float = 0.0
    """Work of the drives' torques from the start, J."""
    friction_work: float = 0.0
    """Work lost to friction from the start, J."""
    push_work: float = 0.0
    """Work of pushes from the start, J."""
    impact_loss: float = 0.0
    """Kinetic energy lost in impacts at stops from the start, J."""


class Integrator(Protocol):
    """Advances a state while the contact does not change."""

    def torque(self, state: State) -> Array:
        """Return the drives' torques at a state, shape (n,), N m and N."""

    def step(self, state: State, phase: Phase, end: float) -> State:
        """Return a later state, not after the time ``end``, s."""


@dataclass(frozen=True, eq=False)
class RungeKutta:
    """The classical Runge-Kutta method of order 4 (Kutta 1901), one step to the end, under constant torques."""

    plant: Plant
    tau: Array

    def torque(self, state: State) -> Array:
        """Return the constant torques, shape (n,), N m and N."""
        return self.tau

    def step(self, state: State, phase: Phase, end: float) -> State:
        """Return the state at the time ``end``, s."""
        kernel = self.plant.step_kernel
        if kernel is None or phase.pushes or phase.contact.holds.any():
            return self._stages(state, phase, end)
        q = state.q
        qd = state.qd
        works = np.array([[state.drive_work, 0.0, state.friction_work]])
        into = (np.empty((1, len(q))), np.empty((1, len(q))), np.empty((1, 3)))
        kernel.with_length(end - state.t)((q[None], qd[None], works), self.tau[None], into)
        drives, _, friction = into[2][0].tolist()
        return State(
            end,
            into[0][0],
            into[1][0],
            state.memory,
            drives,
            friction,
            state.push_work,
            state.impact_loss,
        )

    def _stages(self, state: State, phase: Phase, end: float) -> State:
        """Return the state at ``end`` from accelerations of the plant under an unchanged contact."""
        plant = self.plant
        tau = self.tau
        h = end - state.t

        def acceleration(q: Array, v: Array) -> Array:
            return plant.constrained_accelerations(q, v, tau, phase.contact, phase.pushes)

        # Stages k = 1 ... 4 of the state (q, qd), with rates v_k and accelerations a_k.
        q1 = state.q
        v1 = state.qd
        a1 = phase.qdd

        q2 = q1 + h / 2 * v1
        v2 = v1 + h / 2 * a1
        a2 = acceleration(q2, v2)

        q3 = q1 + h / 2 * v2
        v3 = v1 + h / 2 * a2
        a3 = acceleration(q3, v3)

        q4 = q1 + h * v3
        v4 = v1 + h * a3
        a4 = acceleration(q4, v4)

        q_next = q1 + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        qd_next = v1 + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        _hold(phase, q1, q_next, qd_next)

        # Works are integrals of powers, by the same weights; torques of the drives are constant.
        drives = state.drive_work + float(tau @ (q_next - q1))
        friction = state.friction_work
        if plant.friction is not None:
            powers = [
                float(v @ plant.resistance(v, phase.contact.directions)) for v in (v1, v2, v3, v4)
            ]
            friction += h * _weighted(powers)
        push = state.push_work
        if phase.pushes:
            stages = ((q1, v1), (q2, v2), (q3, v3), (q4, v4))
            push += h * _weighted(
                [float(v @ plant.push_torques(phase.pushes, q)) for q, v in stages]
            )
        return State(end, q_next, qd_next, state.memory, drives, friction, push, state.impact_loss)


class DormandPrince:
    """SciPy's DOP853, of order 8 with a step size of its own (Hairer, Norsett and Wanner 1993, section II.5).

    The works of drives, friction and pushes and the controller's internal states are integrated with the arm's state.
    Where no event can happen, steps go beyond the requested times, and the states there come from the method's
    interpolation of order 7; otherwise each step ends at the next requested time.

    Parameters
    ----------
    plant
        The arm that moves.
    torques
        Function of the drives' torques and the derivatives of the controller's states.
    tolerance
        Tolerance of a step's error, relative and absolute in every state.
    edges
        Times that no step crosses, ascending, the end of the run last, s: torques may jump there.
    longest
        Longest step, s: a shorter pulse of torque may be passed over.
    """

    def __init__(
        self,
        plant: Plant,
        torques: Torques,
        tolerance: float,
        edges: Sequence[float],
        longest: float = np.inf,
    ) -> None:
        self.plant = plant
        self.torques = torques
        self.tolerance = tolerance
        self.edges = edges
        self.longest = longest
        self._length: float | None = None
        self._usual_rate = max(USUAL_STEPS_PER_SECOND, plant.stiffness)
        """Number of steps in a second that a run may always take; stiff friction needs a sixth of its stiffness."""
        self._excess = 0.0
        """Number of steps beyond the usual ones, since the run last took no more than these."""
        self._jumps = 0
        """Number of those steps in which torques jump."""
        self._solver: DOP853 | None = None
        self._last: State | None = None

    def torque(self, state: State) -> Array:
        """Return the torques at a state, shape (n,), N m and N."""
        return self.torques(state.t, state.q, state.qd, state.memory)[0]

    def step(self, state: State, phase: Phase, end: float) -> State:
        """Return a later state, not after the time ``end``, s.

        Raises
        ------
        SimulationError
            The torques jump in every step, the motion diverges, or the tolerance cannot be met with any step length.
        """
        if self.plant.has_no_events:
            return self._passing(state, phase, end)
        solver = self._started(state, phase, end)
        self._advance(solver)
        later = self._state(
            state, solver.y.copy(), end if solver.status == "finished" else float(solver.t)
        )
        _hold(phase, state.q, later.q, later.qd)
        return later

    def _passing(self, state: State, phase: Phase, end: float) -> State:
        """Return the state at ``end``, with steps that pass it."""
        if self._solver is None or state is not self._last or self._solver.t_bound < end:
            edge = next((edge for edge in self.edges if edge > state.t), end)
            self._solver = self._started(state, phase, max(edge, end))
        while self._solver.t < end:
            self._advance(self._solver)
        y = self._solver.y.copy() if self._solver.t == end else self._solver.dense_output()(end)
        self._last = self._state(state, y, end)
        return self._last

    def _started(self, state: State, phase: Phase, end: float) -> DOP853:
        plant = self.plant
        n = self.plant.n
        contact = phase.contact
        pushes = phase.pushes
        # A setpoint that jumps at the end keeps its earlier value until then.
        latest = float(np.nextafter(end, state.t))

        # y = (q, qd, controller's states, works), where the works grow by powers:
        #     dW_drives/dt = qd . tau,    dW_friction/dt = qd . r(qd),    dW_pushes/dt = qd . J^T w.
        def rates(t: float, y: Array) -> Array:
            q = y[:n]
            qd = y[n : 2 * n]
            tau, memory = self.torques(min(t, latest), q, qd, y[2 * n : -3])
            friction = (
                0.0
                if plant.friction is None
                else float(qd @ plant.resistance(qd, contact.directions))
            )
            push = float(qd @ plant.push_torques(pushes, q)) if pushes else 0.0
            qdd = plant.constrained_accelerations(q, qd, tau, contact, pushes)
            if not np.isfinite(qdd).all():
                # Without this, DOP853 would reduce its step length without end.
                raise SimulationError(f"the arm has no finite accelerations at {t:g} s")
            return np.concatenate([qd, qdd, memory, [float(tau @ qd), friction, push]])

        works = [state.drive_work, state.friction_work, state.push_work]
        start = np.concatenate([state.q, state.qd, state.memory, works])
        # After a jump the previous step length does not apply: SciPy chooses a new one.
        jump = any(edge == state.t for edge in self.edges)
        length = None if self._length is None or jump else min(self._length, end - state.t)
        options = {"rtol": self.tolerance, "atol": self.tolerance, "max_step": self.longest}
        with np.errstate(over="ignore", invalid="ignore"):  # _advance raises the error
            return DOP853(rates, state.t, start, end, first_step=length, **options)

    def _advance(self, solver: DOP853) -> None:
        """Take one step.

        Raises
        ------
        SimulationError
            The steps are too short: says whether torques jump, the motion diverges, or neither is seen.
        """
        begin = solver.t
        with np.errstate(over="ignore", invalid="ignore"):  # the error is raised below
            message = solver.step()
        if message is not None or not np.isfinite(solver.y).all():
            self._raise_jumping_or_diverging(begin, solver.y_old if message is None else solver.y)
            raise SimulationError(
                f"no step from {begin:g} s on meets the tolerance of {self.tolerance:g}"
            )
        self._length = solver.h_abs

        # Every step adds 1, its length h takes off usual_rate h. The excess is not below 0: long steps earlier do not
        # excuse short ones later.
        usual = self._usual_rate * (solver.t - begin)
        self._excess = max(0.0, self._excess + 1.0 - usual)
        if not self._excess:
            self._jumps = 0
        if self._excess > STEPS_BEFORE_JUMPS and self._torques_jump(solver):
            self._jumps += 1
            if self._jumps >= MAX_JUMPS:
                self._raise_jumping_or_diverging(begin, solver.y)
        if self._excess > STEPS_BEFORE_DIVERGENCE:
            self._raise_diverging(begin, solver.y)
        if self._excess > MAX_EXCESS_STEPS:
            raise SimulationError(
                f"the last of {MAX_EXCESS_STEPS:,} too short steps begins at {begin:g} s: torques are too steep in the"
                " state or in time; expected smaller gains, or a rate in Hz"
            )

    def _raise_jumping_or_diverging(self, t: float, y: Array) -> None:
        """Raise the error of torques that jump, if some of the last steps had a jump, or of a motion that diverges."""
        if self._jumps:
            raise SimulationError(
                f"torques jump in step after step, the last at {t:g} s: torques that jump with the state, as those of"
                " a relay, have no continuous solution; expected a rate in Hz"
            )
        self._raise_diverging(t, y)

    def _raise_diverging(self, t: float, y: Array) -> None:
        """Raise the error of a motion that diverges if a joint is faster than ``FASTEST_RATE``."""
        rates = np.abs(y[self.plant.n : 2 * self.plant.n])
        i = int(rates.argmax())
        if rates[i] <= FASTEST_RATE:
            return
        description = self.plant.description
        unit = "m/s" if description.numbers.prismatic[i] else "rad/s"
        raise SimulationError(
            f"the motion diverges: {description.joints[i].name} moves at {rates[i]:.3g} {unit} at {t:g} s; expected a"
            " controller that is stable, or effort limits"
        )

    def _torques_jump(self, solver: DOP853) -> bool:
        """Return whether torques jump on the line through the states at both ends of the last step, by bisection.

        The line begins with the step and is ``LOOK_AHEAD`` times as long. Of the two halves the one with the larger
        change is kept. The change of continuous torques becomes as small as the part of the step, that of a jump does
        not, however small the jump is beside the torques.
        """
        n = self.plant.n

        def torques_at(s: float) -> Array:
            t = solver.t_old + s * (solver.t - solver.t_old)
            y = solver.y_old + s * (solver.y - solver.y_old)
            return self.torques(t, y[:n], y[n : 2 * n], y[2 * n : -3])[0]

        # The torques of a continuous controller change by less and less as the interval is halved: below the floor
        #     max(JUMP_SHARE |tau(high) - tau(low)|, TORQUE_NOISE |tau|)
        # after some halvings. Those of a jump keep its height.
        low = 0.0
        high = LOOK_AHEAD
        below = torques_at(low)
        above = torques_at(high)
        largest = max(float(np.abs(below).max()), float(np.abs(above).max()))
        first = float(np.abs(above - below).max())
        least = max(JUMP_SHARE * first, TORQUE_NOISE * largest)
        for _ in range(HALVINGS):
            if np.abs(above - below).max() <= least:
                return False
            middle = (low + high) / 2
            between = torques_at(middle)
            if np.abs(between - below).max() > np.abs(above - between).max():
                high = middle
                above = between
            else:
                low = middle
                below = between
        return True

    def _state(self, before: State, y: Array, t: float) -> State:
        n = self.plant.n
        drives, friction, push = y[-3:].tolist()
        return State(
            t, y[:n], y[n : 2 * n], y[2 * n : -3], drives, friction, push, before.impact_loss
        )


def _hold(phase: Phase, before: Array, q: Array, qd: Array) -> None:
    """Set joints that hold back to exactly their earlier joint values, with rate 0."""
    holds = phase.contact.holds
    if holds.any():
        q[holds] = before[holds]
        qd[holds] = 0.0


def _weighted(powers: Sequence[float]) -> float:
    # The weights of the four stages, as for the state: (p_1 + 2 p_2 + 2 p_3 + p_4) / 6.
    first, second, third, fourth = powers
    return (first + 2 * second + 2 * third + fourth) / 6
