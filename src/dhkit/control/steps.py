"""One step of the classical Runge-Kutta method, split where a joint stops, breaks away or hits its limit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import brentq

from dhkit.control.plant import Contact, Plant
from dhkit.control.pushes import Push
from dhkit.description import Array
from dhkit.errors import SimulationError

__all__ = ["State", "advanced"]

MOST_EVENTS = 1_000
"""In one step: more are a motion that the model does not describe, such as a joint that chatters."""
SLOWEST_REBOUND = 1e-6
"""rad/s or m/s: a slower rebound ends at the stop, or bounces would follow each other without end."""
EXCEEDED = 1e-9
"""Of a holding torque beyond its bound, over the largest torque: below it is rounding."""


@dataclass(frozen=True, eq=False)
class State:
    """Where the arm is, how it moves, and what work was done so far."""

    t: float
    q: Array
    qd: Array
    friction_work: float = 0.0
    """Taken by friction, J."""
    push_work: float = 0.0
    """Done by pushes, J."""
    impact_loss: float = 0.0
    """Kinetic energy lost at stops, J."""


def runge_kutta(plant: Plant, state: State, tau: Array, contact: Contact, pushes: Sequence[Push], h: float) -> State:
    """Return the state after a step of length h under constant torques, while the contact lasts (Kutta 1901)."""
    q, qd = state.q, state.qd
    a1 = plant.moving(q, qd, tau, contact, pushes)
    q2, v2 = q + h / 2 * qd, qd + h / 2 * a1
    a2 = plant.moving(q2, v2, tau, contact, pushes)
    q3, v3 = q + h / 2 * v2, qd + h / 2 * a2
    a3 = plant.moving(q3, v3, tau, contact, pushes)
    q4, v4 = q + h * v3, qd + h * a3
    a4 = plant.moving(q4, v4, tau, contact, pushes)
    stages = ((q, qd), (q2, v2), (q3, v3), (q4, v4))
    friction, push = state.friction_work, state.push_work
    if plant.friction is not None:
        friction += h * _weighted([float(v @ plant.resistance(v, contact.directions)) for _, v in stages])
    if pushes:
        push += h * _weighted([float(v @ plant.pushed(pushes, x)) for x, v in stages])
    q_next = q + h / 6 * (qd + 2 * v2 + 2 * v3 + v4)
    qd_next = qd + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    if contact.holds.any():
        q_next[contact.holds], qd_next[contact.holds] = q[contact.holds], 0.0
    return State(state.t + h, q_next, qd_next, friction, push, state.impact_loss)


def _weighted(powers: Sequence[float]) -> float:
    first, second, third, fourth = powers
    return (first + 2 * second + 2 * third + fourth) / 6


def advanced(plant: Plant, state: State, tau: Array, pushes: Sequence[Push], end: float) -> State:
    """Return the state at a later time under constant torques and pushes.

    Raises
    ------
    SimulationError
        More than a thousand impacts, stops and breakaways in one step.
    """
    for _ in range(MOST_EVENTS):
        contact = plant.contact(state.q, state.qd, tau, pushes)
        later = runge_kutta(plant, state, tau, contact, pushes, end - state.t)
        event = None if plant.undisturbed else _first_event(plant, state, later, tau, contact, pushes, end)
        if event is None:
            return replace(later, t=end)
        state = event
        if state.t >= end:
            return state
    raise SimulationError(f"more than {MOST_EVENTS} impacts and stops before {end:g} s, from {state.t:g} s on")


Measure = Callable[[State], float]
"""Of a state: positive until something happens, negative behind."""


def _first_event(
    plant: Plant, state: State, later: State, tau: Array, contact: Contact, pushes: Sequence[Push], end: float
) -> State | None:
    """Return the state right after the first sudden change before ``later``, or None if there is none."""
    if not contact.holds.any() and not _anything(plant, later, contact):
        return None

    def at(t: float) -> State:
        return later if t == end else runge_kutta(plant, state, tau, contact, pushes, t - state.t)

    first: tuple[float, Callable[[State], State]] | None = None
    for measure, change in _measures(plant, state, tau, contact, pushes):
        if measure(later) >= 0:
            continue
        # At its beginning a measure may be 0, as of a joint that has just broken away: it is positive right after.
        time = state.t if measure(state) < 0 else _crossing(measure, at, state.t, end)
        if first is None or time < first[0]:
            first = (time, change)
    if first is None:
        return None
    time, change = first
    return change(at(time))


def _anything(plant: Plant, later: State, contact: Contact) -> bool:
    """Return whether a joint has turned, or passed its stop."""
    lower, upper = plant.limits
    turned = plant.dry & (contact.directions * later.qd < 0)
    return bool((turned | (later.q < lower) | (later.q > upper)).any())


def _crossing(measure: Measure, at: Callable[[float], State], begin: float, end: float) -> float:
    """Return a time at which a measure, below 0 at the end, gets there."""
    inside = begin + (end - begin) * 1e-6
    if measure(at(inside)) <= 0:
        return inside
    found: float = brentq(lambda t: measure(at(t)), inside, end, xtol=1e-15, rtol=4 * np.finfo(float).eps)
    return found


def _measures(
    plant: Plant, state: State, tau: Array, contact: Contact, pushes: Sequence[Push]
) -> list[tuple[Measure, Callable[[State], State]]]:
    """Return what can happen to a contact: a measure that it crosses 0 by, and what then changes."""
    found: list[tuple[Measure, Callable[[State], State]]] = []
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
        found.append((_margin(plant, state, tau, contact, pushes), lambda s: s))
    return found


def _rate(i: int, direction: int) -> Measure:
    return lambda state: float(direction * state.qd[i])


def _room(i: int, limit: float, side: float) -> Measure:
    return lambda state: float(side * (state.q[i] - limit))


def _margin(plant: Plant, state: State, tau: Array, contact: Contact, pushes: Sequence[Push]) -> Measure:
    """Return what is left of the bounds of the torques that hold joints."""
    least, most = (bound[contact.holds] for bound in plant.holding_bounds(state.q))

    def measure(state: State) -> float:
        needed = plant.held(state.q, state.qd, tau, contact, pushes)[contact.holds]
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
    loss = before - plant.kinetic_energy(q, qd)
    return replace(state, q=q, qd=qd, impact_loss=state.impact_loss + loss)
