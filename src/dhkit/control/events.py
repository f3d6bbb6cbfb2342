"""Motion from one time to another, split where a joint stops, breaks away or hits its limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import brentq

from dhkit.control.integrators import Integrator, State
from dhkit.control.plant import Contact, Phase, Plant
from dhkit.errors import SimulationError

MOST_EVENTS = 1_000
"""In one step: more are a motion that the model does not describe, such as a joint that chatters."""
SLOWEST_REBOUND = 1e-4
"""rad/s or m/s: a slower rebound ends at the stop, or bounces would follow each other without end: of one joint that
gets slower from bounce to bounce, or of two that throw each other against their stops."""
FRACTIONS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1)
"""Fractions of a step at which a measure that is 0 at its beginning is looked for above 0. A joint that leaves its stop
at 1e-4 rad/s has not moved by a unit of rounding after 1e-12 s, and may be back within the step."""
EXCEEDED = 1e-9
"""Of a holding torque beyond its bound, over the largest torque: below it is rounding."""


def advanced(plant: Plant, integrator: Integrator, state: State, end: float, phase: Phase | None = None) -> State:
    """Return the state at a later time, between which no push begins or ends.

    Parameters
    ----------
    plant, integrator
        What moves, and how.
    state
        Where it begins.
    end
        s.
    phase
        That of the beginning, if it is known.

    Raises
    ------
    SimulationError
        More than a thousand impacts, stops and breakaways in one step.
    """
    for _ in range(MOST_EVENTS):
        if phase is None:
            phase = plant.phase(state.q, state.qd, integrator.torque(state), plant.active_pushes(state.t))
        later = _stepped(integrator, state, phase, end)
        event = None if plant.undisturbed else _first_event(plant, integrator, state, later, phase)
        while event is None:
            if later.t >= end:
                return later
            # An integrator with steps of its own goes on under the same contact.
            state, later = later, _stepped(integrator, later, phase, end)
            event = None if plant.undisturbed else _first_event(plant, integrator, state, later, phase)
        state, phase = event, None
        if state.t >= end:
            return state
    raise SimulationError(f"more than {MOST_EVENTS} impacts and stops before {end:g} s, from {state.t:g} s on")


def _stepped(integrator: Integrator, state: State, phase: Phase, end: float) -> State:
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
"""Of a state: positive until something happens, negative behind."""


def _first_event(plant: Plant, integrator: Integrator, state: State, later: State, phase: Phase) -> State | None:
    """Return the state right after the first sudden change before ``later``, or None if there is none."""
    if not phase.contact.holds.any() and not _anything(plant, later, phase.contact):
        beyond = _beyond_between(plant, state, later)
        if beyond is None:
            return None
        # A joint passes its stop and comes back within the step: the search ends where it is farthest beyond.
        farthest = integrator.step(state, phase, beyond)
        return None if farthest.t < beyond else _first_event(plant, integrator, state, farthest, phase)

    def at(t: float) -> State:
        if t == later.t:
            return later
        between = integrator.step(state, phase, t)
        while between.t < t:
            between = integrator.step(between, phase, t)
        return between

    first: tuple[float, Callable[[State], State]] | None = None
    for measure, change in _measures(plant, integrator, state, phase):
        if measure(later) >= 0:
            continue
        # At its beginning a measure may be 0, as of a joint that has just broken away: it is positive right after.
        time = state.t if measure(state) < 0 else _crossing(measure, at, state.t, later.t)
        if first is None or time < first[0]:
            first = (time, change)
    if first is None:
        return None
    time, change = first
    return change(at(time) if time > state.t else state)


def _anything(plant: Plant, later: State, contact: Contact) -> bool:
    """Return whether a joint has turned, or passed its stop."""
    lower, upper = plant.limits
    turned = plant.dry & (contact.directions * later.qd < 0)
    return bool((turned | (later.q < lower) | (later.q > upper)).any())


def _beyond_between(plant: Plant, state: State, later: State) -> float | None:
    """Return when a joint that turns back within a step is beyond its stop, by the cubic through both states."""
    lower, upper = plant.limits
    turning = (state.qd * later.qd < 0) & (np.isfinite(lower) | np.isfinite(upper))
    for i in np.flatnonzero(turning):
        h, q0, q1 = later.t - state.t, state.q[i], later.q[i]
        v0, v1 = h * state.qd[i], h * later.qd[i]
        cubic = np.array([2 * (q0 - q1) + v0 + v1, 3 * (q1 - q0) - 2 * v0 - v1, v0, q0])
        for s in np.roots(np.polyder(cubic)):
            if np.isreal(s) and 0 < s.real < 1 and not lower[i] <= np.polyval(cubic, s.real) <= upper[i]:
                return float(state.t + s.real * h)
    return None


def _crossing(measure: Measure, at: Callable[[float], State], begin: float, end: float) -> float:
    """Return a time at which a measure, below 0 at the end, gets there."""
    for fraction in FRACTIONS:
        inside = begin + (end - begin) * fraction
        value = measure(at(inside))
        if value < 0:
            return inside
        if value > 0:
            found: float = brentq(lambda t: measure(at(t)), inside, end, xtol=1e-15, rtol=4 * np.finfo(float).eps)
            return found
    return end


def _measures(
    plant: Plant, integrator: Integrator, state: State, phase: Phase
) -> list[tuple[Measure, Callable[[State], State]]]:
    """Return what can happen to a contact: a measure that it crosses 0 by, and what then changes."""
    found: list[tuple[Measure, Callable[[State], State]]] = []
    contact = phase.contact
    lower, upper = plant.limits
    for i in range(plant.n):
        if contact.holds[i]:
            continue
        if plant.dry[i] and contact.directions[i]:
            found.append((_rate(i, int(contact.directions[i])), partial(_stopped, i)))
        for limit, side in ((lower[i], 1.0), (upper[i], -1.0)):
            if np.isfinite(limit):
                found.append((_room(i, limit, side), partial(_hit, plant, i, limit)))
    if contact.holds.any():
        found.append((_margin(plant, integrator, state, phase), lambda s: s))
    return found


def _rate(i: int, direction: int) -> Measure:
    return lambda state: float(direction * state.qd[i])


def _room(i: int, limit: float, side: float) -> Measure:
    return lambda state: float(side * (state.q[i] - limit))


def _margin(plant: Plant, integrator: Integrator, state: State, phase: Phase) -> Measure:
    """Return what is left of the bounds of the torques that hold joints."""
    holds = phase.contact.holds
    least, most = (bound[holds] for bound in plant.holding_bounds(state.q))

    def measure(state: State) -> float:
        tau = integrator.torque(state)
        needed = plant.held(state.q, state.qd, tau, phase.contact, phase.pushes)[holds]
        rounding = EXCEEDED * max(1.0, float(np.abs(needed).max()))
        return float(min((most - needed).min(), (needed - least).min())) + rounding

    return measure


def _stopped(joint: int, state: State) -> State:
    """Return the state with a joint's rate exactly 0."""
    qd = state.qd.copy()
    qd[joint] = 0.0
    return replace(state, qd=qd)


def _hit(plant: Plant, joint: int, limit: float, state: State) -> State:
    """Return the state after a joint has hit its stop, and others that this throws against theirs."""
    q, qd = state.q.copy(), state.qd
    q[joint] = limit
    lower, upper = plant.limits
    before = plant.kinetic_energy(q, qd)
    for _ in range(MOST_EVENTS):
        into = ((q <= lower) & (qd < 0)) | ((q >= upper) & (qd > 0))
        if not into.any():
            break
        i = int(np.argmax(np.where(into, np.abs(qd), -1.0)))
        qd = plant.after_impact(q, qd, i, rebounds=abs(qd[i]) * (plant.restitution or 0.0) > SLOWEST_REBOUND)
    # Joints that leave a stop as slowly as that are at rest there: which of them leave it, contact says of all at once.
    qd = np.where(((q == lower) | (q == upper)) & (np.abs(qd) < SLOWEST_REBOUND), 0.0, qd)
    loss = before - plant.kinetic_energy(q, qd)
    return replace(state, q=q, qd=qd, impact_loss=state.impact_loss + loss)
