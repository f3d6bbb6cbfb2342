"""Limits of joints, searched for excesses in dense states of a motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from dhkit.description import Array, Description, Payload
from dhkit.model import pinocchio_model
from dhkit.model.reference import import_pinocchio
from dhkit.planning.second_check.instants import derivative, time_of
from dhkit.planning.second_check.result import Refutation
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits, Trajectory

ACCEPTED = 1e-6
"""Share of a limit by which it may be exceeded: what certificates promise."""
ZOOMS = 3
"""Number of times that the states around a largest value are replaced by closer ones."""
ZOOM_STATES = 33
"""Number of these closer states."""

Measure = Callable[[Array], Array]
"""A function of instants (N, 2) that returns shares of the limits of all joints, shape (N, n), 1 at the limit."""


def jumps(motion: Trajectory) -> Iterator[Refutation]:
    """Yield positions and velocities that jump between pieces, by more than a millionth of the largest."""
    K = len(motion.breaks) - 1
    ends = np.column_stack([np.arange(K - 1.0), np.diff(motion.breaks)[:-1]])
    beginnings = np.column_stack([np.arange(1.0, K), np.zeros(K - 1)])
    for order, name in enumerate(("position", "velocity")):
        before = derivative(motion, ends, order)
        after = derivative(motion, beginnings, order)
        jump = np.abs(after - before)
        size = max(1.0, float(np.abs(before).max(initial=0.0)))
        for k, i in np.argwhere(jump > ACCEPTED * size):
            yield Refutation(
                f"jump of {name} of joint {i + 1}",
                float(jump[k, i]),
                0.0,
                float(motion.breaks[k + 1]),
            )


def exceeded_limits(
    description: Description,
    motion: Trajectory,
    instants: Array,
    limits: Limits,
    payload: Payload | None,
    friction: Friction | None,
) -> Iterator[Refutation]:
    """Yield the limits of joints that a motion exceeds by more than ``ACCEPTED``.

    Parameters
    ----------
    description
        The robot, without its payload.
    motion, instants
        The motion, and instants of it, shape (N, 2).
    limits
        Limits of position, velocity, acceleration, jerk and torque.
    payload, friction
        Payload and friction that the torques include.
    """
    bound = np.maximum(np.abs(limits.lower), np.abs(limits.upper))
    size = np.where(np.isfinite(bound) & (bound > 0), bound, 1.0)

    def position(at: Array) -> Array:
        q = derivative(motion, at, 0)
        return 1 + np.maximum(limits.lower - q, q - limits.upper) / size

    def velocity(at: Array) -> Array:
        return np.abs(derivative(motion, at, 1)) / limits.velocity

    def acceleration(at: Array) -> Array:
        return np.abs(derivative(motion, at, 2)) / limits.acceleration

    def jerk(at: Array) -> Array:
        return np.abs(derivative(motion, at, 3)) / limits.jerk

    measures: list[Measure] = [position, velocity, acceleration, jerk]
    if np.isfinite(limits.torque).any():
        torques = _torques(description, motion, payload, friction)

        def torque(at: Array) -> Array:
            return np.abs(torques(at)) / limits.torque

        measures.append(torque)
    for measure in measures:
        for i, (share, instant) in enumerate(_largest(measure, instants)):
            if not share <= 1 + ACCEPTED:
                what = f"{measure.__name__} of {description.joints[i].name}"
                yield Refutation(what, share, 1.0, time_of(motion, instant))


def _largest(measure: Measure, instants: Array) -> Iterator[tuple[float, Array]]:
    """Yield the largest value of each column of a measure and its instant, searched closer around the largest."""
    every = measure(instants)
    for i in range(every.shape[1]):
        at = instants
        values = every[:, i]
        k = int(np.argmax(values))
        for _ in range(ZOOMS):
            # Between the neighbours of the largest value, in the same piece.
            piece = at[at[:, 0] == at[k, 0]]
            here = int(np.searchsorted(piece[:, 1], at[k, 1]))
            low = piece[max(here - 1, 0)]
            high = piece[min(here + 1, len(piece) - 1)]
            at = np.linspace(low, high, ZOOM_STATES)
            values = measure(at)[:, i]
            k = int(np.argmax(values))
        yield float(values[k]), at[k]


def _torques(
    description: Description, motion: Trajectory, payload: Payload | None, friction: Friction | None
) -> Measure:
    """Return a function of instants (N, 2) that returns tau = M qdd + h + friction, shape (N, n), N m and N."""
    pin = import_pinocchio()
    model = pinocchio_model(description)
    numbers = description.numbers
    if payload is not None:
        inertia = np.zeros((3, 3)) if payload.inertia is None else np.array(payload.inertia)
        T_joint_last = model.frames[model.getFrameId(f"dh{description.n}")].placement
        load = pin.Inertia(payload.mass, np.array(payload.com), inertia)
        model.appendBodyToJoint(description.n, load, T_joint_last * pin.SE3(numbers.T_last_tool))
    data = model.createData()

    def torques(at: Array) -> Array:
        q = derivative(motion, at, 0)
        qd = derivative(motion, at, 1)
        qdd = derivative(motion, at, 2)
        tau = np.array([pin.rnea(model, data, *state) for state in zip(q, qd, qdd, strict=True)])
        # Of drives that two joints turn; Pinocchio has no place for it.
        tau += qdd @ numbers.coupling
        if friction is not None:
            # s goes from -1 to 1 with the direction of motion; dry friction is c+ at s = 1 and c- at s = -1:
            #   viscous qd + (c+ - c-) / 2 s + (c+ + c-) / 2 s^2.
            s = np.sign(qd) if friction.width == 0 else qd / np.hypot(qd, friction.width)
            forwards, backwards = numbers.coulomb.T
            tau += (
                numbers.viscous * qd
                + (forwards - backwards) / 2 * s
                + (forwards + backwards) / 2 * s**2
            )
        return tau

    return torques
