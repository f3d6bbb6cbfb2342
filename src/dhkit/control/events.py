"""Integration from one time to another, split where a joint comes to rest, breaks away or hits its stop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import brentq

from dhkit.control.integrators import Integrator, State
from dhkit.control.plant import Contact, Phase, Plant
from dhkit.errors import SimulationError

MAX_EVENTS_PER_STEP = 1_000
"""Largest number of events in one step: more are a motion outside the model, such as a chattering joint."""
SLOWEST_REBOUND = 1e-4
"""Rebound rate (rad/s or m/s) below which a joint stays at its stop. Otherwise impacts could follow each other without
end, of one joint that gets slower from bounce to bounce or of two that throw each other against their stops."""
FRACTIONS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1)
"""Fractions of a step at which a measure that is 0 at its beginning is looked for above 0. A joint that leaves its stop
at 1e-4 rad/s has not moved by a unit of rounding after 1e-12 s, and may be back within the step."""
EXCEEDED = 1e-9
"""Excess of a holding torque over its bound, relative to the largest torque, below which it counts as rounding."""


def advance(
    plant: Plant, integrator: Integrator, state: State, end: float, phase: Phase | None = None
) -> State:
    """Integrate to a later time, before which no push begins or ends, and return the state there.

    Parameters
    ----------
    plant, integrator
        The arm, and the integration method.
    state
        State at the start.
    end
        Time at the end, s.
    phase
        Phase at the start, if it is known.

    Raises
    ------
    SimulationError
        More than a thousand impacts, stops and breakaways in one step.
    """
    for _ in range(MAX_EVENTS_PER_STEP):
        if phase is None:
            phase = plant.phase(
                state.q, state.qd, integrator.torque(state), plant.active_pushes(state.t)
            )
        later = _checked_step(integrator, state, phase, end)
        event = (
            None if plant.has_no_events else _first_event(plant, integrator, state, later, phase)
        )
        while event is None:
            if later.t >= end:
                return later
            # An integrator with steps of its own goes on under the same contact.
            state = later
            later = _checked_step(integrator, later, phase, end)
            event = (
                None
                if plant.has_no_events
                else _first_event(plant, integrator, state, later, phase)
            )
        state = event
        phase = None
        if state.t >= end:
            return state
    raise SimulationError(
        f"more than {MAX_EVENTS_PER_STEP} impacts and stops before {end:g} s, from {state.t:g} s on"
    )


def _checked_step(integrator: Integrator, state: State, phase: Phase, end: float) -> State:
    """Return the state after a step.

    Raises
    ------
    SimulationError
        It is not finite.
    """
    later = integrator.step(state, phase, end)
    if not np.isfinite(later.q.sum() + later.qd.sum()):
        raise SimulationError(f"the arm's state is no longer finite after {later.t:g} s")
    return later


Measure = Callable[[State], float]
"""Function of a state that is positive until an event and negative after it."""


@dataclass(frozen=True)
class Event:
    """Something that may happen to an arm between two times."""

    measure: Measure
    change: Callable[[State], State]
    """Returns the state right after it, of the state at its time."""


def _first_event(
    plant: Plant, integrator: Integrator, state: State, later: State, phase: Phase
) -> State | None:
    """Return the state right after the first sudden change before ``later``, or None if there is none."""
    if not phase.contact.holds.any() and not _may_have_event(plant, later, phase.contact):
        beyond = _beyond_between(plant, state, later)
        if beyond is None:
            return None
        # A joint passes its stop and comes back within the step: search only until it is farthest beyond.
        farthest = integrator.step(state, phase, beyond)
        return (
            None if farthest.t < beyond else _first_event(plant, integrator, state, farthest, phase)
        )

    def at(t: float) -> State:
        if t == later.t:
            return later
        between = integrator.step(state, phase, t)
        while between.t < t:
            between = integrator.step(between, phase, t)
        return between

    times: dict[Event, float] = {}
    for event in _possible_events(plant, integrator, state, phase):
        if event.measure(later) >= 0:
            continue
        # A measure may be 0 at the start, as for a joint that has just broken away: it is positive right after.
        is_over = event.measure(state) < 0
        times[event] = state.t if is_over else _crossing(event.measure, at, state.t, later.t)
    if not times:
        return None
    first = min(times, key=times.__getitem__)
    at_event = at(times[first]) if times[first] > state.t else state
    return first.change(at_event)


def _may_have_event(plant: Plant, later: State, contact: Contact) -> bool:
    """Return whether a joint has reversed its direction or passed its stop."""
    lower, upper = plant.limits
    turned = plant.has_stiction & (contact.directions * later.qd < 0)
    return bool((turned | (later.q < lower) | (later.q > upper)).any())


def _beyond_between(plant: Plant, state: State, later: State) -> float | None:
    """Return a time (s) at which a joint that turns back within a step is beyond its stop, or None.

    In the step of length h a joint is taken for Hermite's cubic of s = (t - t0) / h:

        q(s) = (2 (q0 - q1) + v0 + v1) s^3 + (3 (q1 - q0) - 2 v0 - v1) s^2 + v0 s + q0,    v = h qd.
    """
    lower, upper = plant.limits
    h = later.t - state.t
    turns_back = (state.qd * later.qd < 0) & (np.isfinite(lower) | np.isfinite(upper))
    for i in np.flatnonzero(turns_back):
        q0 = state.q[i]
        q1 = later.q[i]
        v0 = h * state.qd[i]
        v1 = h * later.qd[i]
        cubic = np.array([2 * (q0 - q1) + v0 + v1, 3 * (q1 - q0) - 2 * v0 - v1, v0, q0])

        # The joint is farthest where its rate is 0.
        for s in np.roots(np.polyder(cubic)):
            is_inside = np.isreal(s) and 0 < s.real < 1
            if is_inside and not lower[i] <= np.polyval(cubic, s.real) <= upper[i]:
                return float(state.t + s.real * h)
    return None


def _crossing(measure: Measure, at: Callable[[float], State], begin: float, end: float) -> float:
    """Return the time at which a measure that is negative at ``end`` becomes negative."""
    # The measure may be 0 at ``begin``, which brackets no root: a time soon after it, where it is positive, does.
    for fraction in FRACTIONS:
        inside = begin + (end - begin) * fraction
        value = measure(at(inside))
        if value < 0:
            return inside
        if value > 0:
            found: float = brentq(
                lambda t: measure(at(t)), inside, end, xtol=1e-15, rtol=4 * np.finfo(float).eps
            )
            return found
    return end


def _possible_events(
    plant: Plant, integrator: Integrator, state: State, phase: Phase
) -> list[Event]:
    """Return the possible events of a contact: joints that come to rest, hit a stop, or break away."""
    # Measures, positive until the event: s_i qd_i of a joint that moves in the direction s_i, the room q_i - lower_i
    # and upper_i - q_i before stops, and the distance of holding torques from their bounds.
    found: list[Event] = []
    contact = phase.contact
    lower, upper = plant.limits
    for i in np.flatnonzero(~contact.holds).tolist():
        if plant.has_stiction[i] and contact.directions[i]:
            rate = _rate(i, int(contact.directions[i]))
            found.append(Event(rate, partial(_with_joint_at_rest, i)))
        for limit, side in ((lower[i], 1.0), (upper[i], -1.0)):
            if np.isfinite(limit):
                found.append(Event(_room(i, limit, side), partial(_after_impact, plant, i, limit)))
    if contact.holds.any():
        breakaway = _margin(plant, integrator, state, phase)
        found.append(Event(breakaway, lambda state: state))
    return found


def _rate(i: int, direction: int) -> Measure:
    return lambda state: float(direction * state.qd[i])


def _room(i: int, limit: float, side: float) -> Measure:
    return lambda state: float(side * (state.q[i] - limit))


def _margin(plant: Plant, integrator: Integrator, state: State, phase: Phase) -> Measure:
    """Return the measure of breakaway: the distance of the holding torques from their bounds, N m and N."""
    holds = phase.contact.holds
    least, most = plant.holding_bounds(state.q)

    def measure(state: State) -> float:
        tau = integrator.torque(state)
        f = plant.holding_torques(state.q, state.qd, tau, phase.contact, phase.pushes)[holds]
        margin = np.minimum(most[holds] - f, f - least[holds]).min()

        # A torque that is at its bound but for rounding holds: otherwise breakaways could follow without end.
        rounding = EXCEEDED * max(1.0, float(np.abs(f).max()))
        return float(margin) + rounding

    return measure


def _with_joint_at_rest(joint: int, state: State) -> State:
    """Return the state with one joint's rate set to exactly 0."""
    qd = state.qd.copy()
    qd[joint] = 0.0
    return replace(state, qd=qd)


def _after_impact(plant: Plant, joint: int, limit: float, state: State) -> State:
    """Return the state after a joint has hit its stop, and after the impacts of other joints that this causes."""
    qd = state.qd
    q = state.q.copy()
    q[joint] = limit
    lower, upper = plant.limits
    before = plant.kinetic_energy(q, qd)

    # The fastest joint that moves into its stop is stopped first; its impact may throw others against theirs.
    for _ in range(MAX_EVENTS_PER_STEP):
        moves_into = ((q <= lower) & (qd < 0)) | ((q >= upper) & (qd > 0))
        if not moves_into.any():
            break
        i = int(np.argmax(np.where(moves_into, np.abs(qd), -1.0)))
        rebound = abs(qd[i]) * (plant.restitution or 0.0)
        qd = plant.after_impact(q, qd, i, rebounds=rebound > SLOWEST_REBOUND)

    # Joints that leave a stop slower than that are at rest there: the contact decides for all together which leave.
    is_at_stop = (q == lower) | (q == upper)
    qd = np.where(is_at_stop & (np.abs(qd) < SLOWEST_REBOUND), 0.0, qd)

    # (qd^T M qd - qd'^T M qd') / 2, which the energy audit counts as lost.
    loss = before - plant.kinetic_energy(q, qd)
    return replace(state, q=q, qd=qd, impact_loss=state.impact_loss + loss)
