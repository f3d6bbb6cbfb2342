"""The simulated arm: accelerations at a state under torques, friction, stops and pushes."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dhkit.control.pushes import Push
from dhkit.control.step_kernel import StepKernel
from dhkit.description import Array, Description, description_of
from dhkit.display import counted, repr_line
from dhkit.dynamics import (
    Friction,
    bias,
    friction_torque,
    kinetic_energy,
    mass_matrix,
    potential_energy,
    require_inertia,
)
from dhkit.dynamics.programs import dynamics_kernel
from dhkit.kernels import Kernel
from dhkit.verification import random_motions

log = logging.getLogger(__name__)

RANDOM_CONFIGURATIONS = 256
"""Number of random configurations over which the stiffness of friction is maximized."""


@dataclass(frozen=True, eq=False)
class Plant:
    """The arm that moves in a simulation, with friction, stops and pushes.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    friction
        Friction model of the joints, None for none; with width 0, dry friction is a step with stiction.
    restitution
        Coefficient of restitution of the joint stops, 0 to 1; None for no stops.
    pushes
        Wrenches on the tool or on links, each over a time window.

    Raises
    ------
    DescriptionError
        A link without a body, or a joint that carries no inertia.
    ValueError
        A restitution that is not from 0 to 1.
    """

    description: Description
    friction: Friction | None = None
    restitution: float | None = 0.0
    pushes: tuple[Push, ...] = ()
    _single: tuple[Kernel, Array] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "description", description_of(self.description))
        require_inertia(self.description)
        for push in self.pushes:
            if not isinstance(push, Push):
                raise TypeError(f"pushes has {type(push).__name__}; expected Push objects")
            if push.link is not None and push.link > self.n:
                raise ValueError(f"link is {push.link}; {self.description.name} has {self.n}")
        numbers = self.description.numbers
        if self.friction is not None and not (numbers.viscous.any() or numbers.coulomb.any()):
            log.warning(
                "%s has no friction in its file: friction changes nothing", self.description.name
            )
        if self.restitution is not None and not 0 <= self.restitution <= 1:
            raise ValueError(
                f"restitution is {self.restitution!r}; expected 0 to 1, or None for no stops"
            )
        object.__setattr__(self, "_single", dynamics_kernel("forward_dynamics", self.description))

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.description.n

    @cached_property
    def has_stiction(self) -> NDArray[np.bool_]:
        """Whether a joint's dry friction is a step with stiction, shape (n,)."""
        none = np.zeros(self.n, dtype=bool)
        if self.friction is None or self.friction.width:
            return none
        joints: NDArray[np.bool_] = np.any(self.description.numbers.coulomb != 0, axis=1)
        return joints

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """Joint values of the lower and upper stops, shape (n,) each, rad and m; infinite without stops."""
        numbers = self.description.numbers
        free = np.full(self.n, np.inf)
        return (-free, free) if self.restitution is None else (numbers.lower, numbers.upper)

    @cached_property
    def has_no_events(self) -> bool:
        """Whether no joint has stiction or a stop, so that no event can happen."""
        return not self.has_stiction.any() and not np.isfinite(self.limits).any()

    @cached_property
    def stiffness(self) -> float:
        """Rate at which friction decelerates the joints near rest, 1/s, maximum over random configurations.

        Near rest M qdd = -D qd with D the diagonal matrix of the steepest slopes of friction over the rate, so that
        rates decay with the eigenvalues of M^-1 D. Those of the symmetric D^(1/2) M^-1 D^(1/2) are the same.
        """
        if self.friction is None:
            return 0.0
        numbers = self.description.numbers

        # Smooth dry friction, coulomb * qd / sqrt(qd^2 + width^2), is steepest at rest: coulomb / width.
        D = numbers.viscous.copy()
        if self.friction.width:
            D += np.abs(numbers.coulomb).max(axis=1) / self.friction.width
        root_D = np.sqrt(D)

        q = random_motions(self.description, RANDOM_CONFIGURATIONS).q
        M_inverse = np.linalg.pinv(mass_matrix(self.description, q), hermitian=True)
        symmetric = root_D[:, None] * M_inverse * root_D
        return float(np.linalg.eigvalsh(symmetric).max())

    @cached_property
    def step_kernel(self) -> StepKernel | None:
        """Program of a step without holding joints and pushes; None if friction is a step."""
        if self.friction is not None and not self.friction.width:
            return None
        return StepKernel.open([self.description], self.friction, 0.0)

    @cached_property
    def nothing_holds(self) -> Contact:
        """The contact in which no joint holds."""
        return Contact(np.zeros(self.n, dtype=np.int8), np.zeros(self.n, dtype=bool))

    def active_pushes(self, t: float) -> tuple[Push, ...]:
        """Return the pushes that act at a time t, s."""
        return tuple(push for push in self.pushes if push.begin <= t < push.end)

    def holding_bounds(self, q: Array) -> tuple[Array, Array]:
        """Return the bounds of the torques that hold joints at rest, shape (n,) each, N m and N; infinite at stops."""
        # A resisting torque f > 0 acts against positive rates: a lower stop bears any f < 0, an upper stop any f > 0.
        lower, upper = self.limits
        coulomb = np.where(self.has_stiction[:, None], self.description.numbers.coulomb, 0.0)
        least = np.where(q <= lower, -np.inf, coulomb[:, 1])
        most = np.where(q >= upper, np.inf, coulomb[:, 0])
        return least, most

    def accelerations(self, q: Array, qd: Array, tau: Array) -> Array:
        """Return the accelerations of a state under net torques, shape (n,), rad/s^2 and m/s^2.

        Net torques are those of the drives and pushes, minus friction.

        Parameters
        ----------
        q, qd, tau
            Joint values, rates and torques, shape (n,), rad, m, seconds, N m and N.
        """
        qdd: Array = np.empty((1, self.n))
        run, parameters = self._single
        run(parameters, [q[None], qd[None], tau[None]], [qdd])
        return qdd.reshape(-1)

    def resistance(self, qd: Array, directions: NDArray[np.int8]) -> Array:
        """Return the friction torques, shape (n,), N m and N, positive for positive rates.

        Parameters
        ----------
        qd
            Joint rates, shape (n,), rad/s and m/s.
        directions
            Directions in which joints with stiction move or begin to move, shape (n,): 1, -1, or 0 for holding joints.
        """
        if self.friction is None:
            return np.zeros(self.n)
        if not self.has_stiction.any():
            return friction_torque(self.description, qd, self.friction)

        # r_i = viscous_i qd_i + coulomb_i in the direction of motion. The dry friction of holding joints is not part of
        # it: it follows from the contact.
        numbers = self.description.numbers
        dry = np.zeros(self.n)
        forwards = directions > 0
        backwards = directions < 0
        dry[forwards] = numbers.coulomb[forwards, 0]
        dry[backwards] = numbers.coulomb[backwards, 1]
        return numbers.viscous * qd + dry

    def push_torques(self, pushes: Sequence[Push], q: Array) -> Array:
        """Return the joint torques of some pushes, shape (n,), N m and N."""
        return sum((push.torque(self.description, q) for push in pushes), np.zeros(self.n))

    def contact(self, q: Array, qd: Array, tau: Array, pushes: Sequence[Push] = ()) -> Contact:
        """Return the joints that hold, by friction or at a stop, and the directions of the others.

        q, qd and tau are of shape (n,), in rad, m, per second, N m and N.

        Joints whose rate is exactly 0 hold if the holding torques are within the bounds of their friction; a stop bears
        any torque towards it. All joints are decided together, since each loads the others through the mass matrix:
        with holding torques f of the joints R at rest,

            M qdd = tau + J' w - r(qd) - C qd - g - f,    so that    qdd_R = (M^-1 drive)_R - (M^-1)_RR f_R.
        """
        if self.has_no_events:
            return self.nothing_holds
        lower, upper = self.limits
        directions = np.sign(qd).astype(np.int8)
        at_rest = (qd == 0) & (self.has_stiction | (q <= lower) | (q >= upper))
        if not at_rest.any():
            return Contact(directions, at_rest)

        drive = (
            tau
            + self.push_torques(pushes, q)
            - self.resistance(qd, directions)
            - bias(self.description, q, qd)
        )

        # The joints R accelerate by w = b - A f_R, with A = (M^-1)_RR and b = (M^-1 drive)_R.
        M_inverse = np.linalg.inv(mass_matrix(self.description, q)).astype(float)
        block = M_inverse[np.ix_(at_rest, at_rest)]
        unresisted = (M_inverse @ drive)[at_rest]
        least, most = self.holding_bounds(q)
        _, side = bounded_forces(block, unresisted, least[at_rest], most[at_rest])

        holds = at_rest.copy()
        holds[at_rest] = side == 0
        directions[at_rest] = side
        return Contact(directions, holds)

    def constrained_accelerations(
        self, q: Array, qd: Array, tau: Array, contact: Contact, pushes: Sequence[Push] = ()
    ) -> Array:
        """Return the accelerations under a contact, shape (n,), rad/s^2 and m/s^2: exactly 0 for holding joints.

        The rows and columns of the free joints F are those of the arm whose other joints are fixed:
        M_FF qdd_F = (net - C qd - g)_F.
        """
        net = tau - self.resistance(qd, contact.directions)
        if pushes:
            net += self.push_torques(pushes, q)
        if not contact.holds.any():
            return self.accelerations(q, qd, net)
        qdd = np.zeros(self.n)
        free = ~contact.holds
        if free.any():
            M_free = mass_matrix(self.description, q)[np.ix_(free, free)]
            torque = net - bias(self.description, q, qd)
            qdd[free] = np.linalg.solve(M_free, torque[free])
        return qdd

    def phase(self, q: Array, qd: Array, tau: Array, pushes: tuple[Push, ...] = ()) -> Phase:
        """Return the phase from a state (q, qd and tau of shape (n,), SI units) to the next event."""
        contact = self.contact(q, qd, tau, pushes)
        return Phase(contact, pushes, self.constrained_accelerations(q, qd, tau, contact, pushes))

    def holding_torques(
        self, q: Array, qd: Array, tau: Array, contact: Contact, pushes: Sequence[Push] = ()
    ) -> Array:
        """Return the resisting torques of holding joints, shape (n,), N m and N; 0 for the others.

        They are what the equation of motion leaves over: f = net - M qdd - C qd - g.
        """
        qdd = self.constrained_accelerations(q, qd, tau, contact, pushes)
        net = tau + self.push_torques(pushes, q) - self.resistance(qd, contact.directions)
        needed = net - mass_matrix(self.description, q) @ qdd - bias(self.description, q, qd)
        return np.where(contact.holds, needed, 0.0)

    def after_impact(self, q: Array, qd: Array, joint: int, *, rebounds: bool) -> Array:
        """Return the rates after the impact of a joint at its stop, shape (n,), rad/s and m/s.

        The stop's impulse p acts along joint i alone, and Newton's law of restitution gives its size:

            M (qd' - qd) = e_i p,    qd'_i = -r qd_i,    so that    p = -(1 + r) qd_i / (M^-1)_ii.
        """
        e_i = np.eye(self.n)[joint]
        column = np.linalg.solve(mass_matrix(self.description, q), e_i)
        r = (self.restitution or 0.0) if rebounds else 0.0
        impulse = -(1 + r) * qd[joint] / column[joint]
        after: Array = qd + column * impulse
        after[joint] = -r * qd[joint] + 0.0  # exactly, and 0 without a sign
        return after

    def kinetic_energy(self, q: Array, qd: Array) -> float:
        """Return the kinetic energy with the drives' rotors, J; q and qd of shape (n,).

        Parameters
        ----------
        q, qd
            Joint values and rates, shape (n,), rad, m and per second.
        """
        return float(kinetic_energy(self.description, q, qd))

    def energy(self, q: Array, qd: Array) -> float:
        """Return kinetic plus potential energy, J; q and qd of shape (n,).

        Parameters
        ----------
        q, qd
            Joint values and rates, shape (n,), rad, m and per second.
        """
        return self.kinetic_energy(q, qd) + float(potential_energy(self.description, q))

    def __repr__(self) -> str:
        friction = "no friction" if self.friction is None else str(self.friction)
        stops = (
            "no stops" if self.restitution is None else f"stops of restitution {self.restitution:g}"
        )
        pushes = counted(len(self.pushes), "push")
        return repr_line("Plant", self.description.name, f"{friction}, {stops}, {pushes}")


@dataclass(frozen=True, eq=False)
class Contact:
    """Modes of joints with stiction or at stops: holding, or moving in a direction."""

    directions: NDArray[np.int8]
    """Direction in which each joint moves or begins to move, 1 or -1, and 0 for none, shape (n,)."""
    holds: NDArray[np.bool_]
    """Joints that hold their position, shape (n,)."""


@dataclass(frozen=True, eq=False)
class Phase:
    """Contact and pushes that do not change until the next event."""

    contact: Contact
    pushes: tuple[Push, ...]
    qdd: Array
    """Accelerations at its start, shape (n,), rad/s^2 and m/s^2."""


MAX_STALLED_ROUNDS = 10
"""Rounds without fewer violations after which Murty's rule exchanges single indices, which cannot cycle."""


def bounded_forces(
    A: Array, b: Array, lower: Array, upper: Array
) -> tuple[Array, NDArray[np.int8]]:
    """Return the resisting torques f of joints at rest, and the bound that each is at.

    The accelerations are w = b - A f. A joint holds (w = 0) while its torque is between the bounds; it breaks away
    forwards (w >= 0) against its upper bound, backwards (w <= 0) against its lower one. With A positive definite there
    is exactly one solution (Cottle, Pang and Stone 2009, The Linear Complementarity Problem, theorem 3.3.7). It is
    found by block principal pivoting (Judice and Pires 1994, A block principal pivoting algorithm for large-scale
    strictly monotone linear complementarity problems), with Murty's least-index rule as its fallback.

    Parameters
    ----------
    A
        The block of the inverse mass matrix, shape (m, m), positive definite.
    b
        Accelerations without resistance, shape (m,).
    lower, upper
        Bounds of the torques, shape (m,), lower <= upper; infinite at a stop.

    Returns
    -------
    tuple[Array, NDArray[np.int8]]
        f, shape (m,); and 0 where a joint holds, 1 at the upper bound, -1 at the lower one, shape (m,).
    """
    side = np.zeros(len(b), dtype=np.int8)
    fewest_violations = len(b) + 1
    patience = MAX_STALLED_ROUNDS
    while True:
        held = side == 0
        moving = ~held

        # Moving joints resist with their bounds; of the held ones, 0 = b_h - A_hh f_h - A_hm f_m.
        f = np.select([side > 0, side < 0], [upper, lower], 0.0)
        if held.any():
            of_moving = A[np.ix_(held, moving)] @ f[moving]
            f[held] = np.linalg.solve(A[np.ix_(held, held)], b[held] - of_moving)
        w = b - A @ f

        # A held joint whose torque is over a bound breaks away; one that would move against its direction holds.
        wanted = side.copy()
        wanted[held & (f > upper)] = 1
        wanted[held & (f < lower)] = -1
        wanted[moving & (side * w < 0)] = 0
        violated = np.flatnonzero(wanted != side)
        if not len(violated):
            return f, side

        # Exchanging all violated indices takes few rounds but may cycle; exchanging one, always the last, cannot.
        if len(violated) < fewest_violations:
            fewest_violations = len(violated)
            patience = MAX_STALLED_ROUNDS
        else:
            patience -= 1
        exchanged = violated if patience > 0 else violated[-1:]
        side[exchanged] = wanted[exchanged]
