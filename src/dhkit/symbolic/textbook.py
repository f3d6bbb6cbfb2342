"""Equations of motion derived as in a textbook, step by step, with optional mistakes that students make.

Positions of the centres of mass, their velocities by differentiation, angular velocities as sums over the joints'
axes, kinetic and potential energy of each body of each link, the Lagrangian, and d/dt dL/dqd - dL/dq (Spong,
Hutchinson & Vidyasagar, Robot Modeling and Control, 2006, chapter 7; Siciliano et al., Robotics, 2009, section 7.1).
The derivation is independent of :mod:`dhkit.symbolic.exact.composite`: both share the table and the bodies only.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, lru_cache, reduce

import numpy as np

from dhkit.description import Description, takes_robot
from dhkit.display import repr_line
from dhkit.symbolic.exact.compact import parallel_runs
from dhkit.symbolic.exact.exact_arm import ExactArm, ExactBody, ExactRow, exact_arm, point_inertia
from dhkit.symbolic.exact.naming import Symbols
from dhkit.symbolic.mistakes import LINK_MISTAKES, STEP_FACTORS, VELOCITY_FACTORS, MadeAt, check_mistake, has, made_at
from dhkit.symbolic.ring import Element, Elements, Ring, translated
from dhkit.symbolic.ring.elements import PolynomialRing

_HALF = Fraction(1, 2)


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """Motion and energies of a body of a link; vectors have shape (3,).

    Attributes
    ----------
    body
        The body.
    com
        Its centre of mass in frame 0, m.
    velocity, omega
        Velocity of the centre of mass, m/s, and angular velocity, rad/s, in the link's own axes.
    K, V
        Kinetic and potential energy, J.
    """

    body: ExactBody
    com: Elements
    velocity: Elements
    omega: Elements
    K: Element
    V: Element


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """Pose of a link, and motion of its bodies.

    Attributes
    ----------
    R
        Rotation of the link's DH frame in frame 0, shape (3, 3).
    origin
        The frame's origin in frame 0, shape (3,), m.
    bodies
        Motion of each body.
    """

    R: Elements
    origin: Elements
    bodies: tuple[BodyMotion, ...]

    @property
    def K(self) -> Element:
        """Kinetic energy, J."""
        return reduce(operator.add, (body.K for body in self.bodies))

    @property
    def V(self) -> Element:
        """Potential energy, J."""
        return reduce(operator.add, (body.V for body in self.bodies))


@dataclass(frozen=True, eq=False, repr=False)
class TextbookDerivation:
    """A derivation of an arm's equations of motion, step by step.

    Attributes
    ----------
    arm
        The description in the ring.
    links
        Pose and motion of each link.
    mistakes
        The mistakes that were made.
    """

    arm: ExactArm
    links: tuple[LinkMotion, ...]
    mistakes: frozenset[MadeAt] = field(default=frozenset())

    def __repr__(self) -> str:
        made = ", ".join(sorted(map(str, self.mistakes))) or "no mistakes"
        return repr_line("TextbookDerivation", self.arm.description.name, made)

    @cached_property
    def rotors(self) -> Element:
        """Kinetic energy of the rotors, the sum of Jm (G qd)^2 / 2, and that of couplings, b qd_i qd_j each, J."""
        arm = self.arm
        energies = []
        for i, (gear, rotor) in enumerate(zip(arm.gear, arm.rotor, strict=True)):
            if not self._has("rotor_forgotten", i):
                ratio = gear if self._has("rotor_gear", i) else gear * gear
                if self._has("rotor_without_gear", i):
                    ratio = arm.ring.one
                energies.append(rotor * ratio * arm.ring.rate(i) * arm.ring.rate(i) * _HALF)
        energies += [inertia * arm.ring.rate(i) * arm.ring.rate(j) for i, j, inertia in arm.couplings]
        return arm.ring.sum(energies)

    @cached_property
    def K(self) -> Element:
        """Kinetic energy of links and rotors, J."""
        return self.arm.ring.sum([*(link.K for link in self.links), self.rotors])

    @cached_property
    def V(self) -> Element:
        """Potential energy, J; zero at the world's origin."""
        return self.arm.ring.sum(link.V for link in self.links)

    @property
    def L(self) -> Element:
        """The Lagrangian K - V, J."""
        return self.K - self.V

    @cached_property
    def momenta(self) -> Elements:
        """Generalized momenta dL/dqd, shape (n,), kg m^2/s and kg m/s."""
        return np.array([self.K.by_rate(i) for i in range(self.arm.n)], dtype=object)

    @cached_property
    def M(self) -> Elements:
        """Mass matrix, the derivatives of the momenta by the rates, shape (n, n)."""
        return np.array([[p.by_rate(j) for j in range(self.arm.n)] for p in self.momenta], dtype=object)

    @cached_property
    def g(self) -> Elements:
        """Gravity torques dV/dq, shape (n,)."""
        sign = -1 if self._has("potential_gradient_sign") else 1
        return np.array([self.V.by_position(i) * sign for i in range(self.arm.n)], dtype=object)

    @cached_property
    def h(self) -> Elements:
        """Coriolis and centrifugal torques, shape (n,): tau minus the terms with accelerations and gravity."""
        return velocity_torques(self.arm.ring, self.K, self.momenta, self.mistakes)

    @cached_property
    def tau(self) -> Elements:
        """The Euler-Lagrange equation d/dt dL/dqd - dL/dq, shape (n,), N m and N."""
        ring = self.arm.ring
        n = self.arm.n
        inertial = [ring.sum(p.by_rate(j) * ring.acceleration(j) for j in range(n)) for p in self.momenta]
        return np.array(inertial, dtype=object) + self.h + self.g

    def _has(self, mistake: str, i: int | None = None) -> bool:
        return has(self.mistakes, mistake, i)


def velocity_torques(
    ring: PolynomialRing, K: Element, momenta: Elements, mistakes: frozenset[MadeAt] = frozenset()
) -> Elements:
    """Return d/dt dK/dqd - dK/dq without accelerations, shape (n,): linear in K.

    Parameters
    ----------
    ring
        The ring of the elements.
    K
        Kinetic energy, J.
    momenta
        Derivatives of K by the rates, shape (n,).
    mistakes
        Mistakes to make; those of other steps have no effect.
    """
    of_rate = Fraction(1)
    of_gradient = Fraction(1)
    for name, (rate, gradient) in STEP_FACTORS.items():
        if MadeAt(name) in mistakes:
            of_rate = of_rate * rate
            of_gradient = of_gradient * gradient
    torques = []
    for i, momentum in enumerate(momenta):
        rates = ring.sum(momentum.by_position(k) * ring.rate(k) for k in range(ring.n))
        torque = rates * of_rate - K.by_position(i) * of_gradient
        for name, (squares, factor) in VELOCITY_FACTORS.items():
            if MadeAt(name) in mistakes:
                torque = scaled(torque, squares, factor)
        torques.append(torque)
    return np.array(torques, dtype=object)


@takes_robot
def derive(
    description: Description, mistakes: Iterable[MadeAt | str] = frozenset(), symbols: Symbols = "file"
) -> TextbookDerivation:
    """Derive an arm's equations of motion as a textbook does.

    Parameters
    ----------
    description
        The robot.
    mistakes
        Of :data:`dhkit.symbolic.MISTAKES`, by identity where they are made at every link, ``MadeAt(identity, 2)`` for
        link 2 alone, or ``MadeAt(identity, 2, "payload")`` for its body of that name.
    symbols
        See :func:`dhkit.symbolic.exact.exact_arm`.

    Raises
    ------
    DescriptionError
        A link has no body.
    ValueError
        No such mistake, no such link, or no such body.
    TypeError
        Mistakes that are none of these.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> wrong = derive(library_robot("planar2r"), {"gravity_sign"})
    >>> print(derive(library_robot("planar2r")).g[1] - wrong.g[1] == -2 * wrong.g[1])
    True
    """
    made = made_at(mistakes)
    arm = exact_arm(description, symbols)
    names = [[body.name for body in bodies] for bodies in arm.bodies]
    for mistake in made:
        check_mistake(mistake, description.n, bodies=names)
    links = []
    for i, place in enumerate(_places(arm)):
        motions = []
        for body in arm.bodies[i]:
            concerned = frozenset(mistake for mistake in LINK_MISTAKES if has(made, mistake, i, body.name))
            motions.append(_motion(arm, i, body, concerned))
        links.append(LinkMotion(place.R, place.origin, tuple(motions)))
    return TextbookDerivation(arm, tuple(links), made)


@lru_cache(maxsize=4096)
def _motion(arm: ExactArm, i: int, body: ExactBody, mistakes: frozenset[str]) -> BodyMotion:
    """Return what is found of a body of link i, from 0; derivations that share it do not find it twice."""
    places = _places(arm)
    axes = [place.axis for place in places[: i + 1]]
    return _MovingBody(arm, mistakes, i, body, places[i]).motion(axes)


@dataclass(frozen=True, eq=False)
class _Place:
    """Place of a link's frame."""

    R_alone: Elements
    """The frame's rotation if the joints before it stood still: those of parallel axes, or all where there are none."""
    R: Elements
    before: Elements
    """Origin of the frame before, in frame 0."""
    origin: Elements
    alone: Elements
    """The frame's origin if frame i - 1 were so turned."""
    axis: Elements
    """The joint's axis in frame 0."""


@lru_cache(maxsize=32)
def _places(arm: ExactArm) -> tuple[_Place, ...]:
    """Walk along the arm."""
    ring = arm.ring
    places: list[_Place] = []
    R = _identity(ring)
    p = np.array([ring.zero] * 3, dtype=object)
    for row in arm.rows:
        R_before = R
        p_before = p
        R_own, p_own = _transform(arm, row)
        R = R_before @ R_own
        p = p_before + R_before @ p_own
        axis = (R_before if arm.is_standard else R)[:, 2]
        # What a student turns by the joint's own angle alone: the link from its joint on.
        R_still = _with_joints_still(R_before, _joints_before(arm, len(places)))
        alone = p_before + R_still @ p_own if arm.is_standard else p
        places.append(_Place(R_still @ R_own, R, p_before, p, alone, axis))
    return tuple(places)


def _joints_before(arm: ExactArm, i: int) -> list[int]:
    """Return the revolute joints before joint i, from 0, whose axes are parallel to its own; all where none is."""
    run = next((run for run in parallel_runs(arm) if i in run), ())
    turning = [j for j in range(i) if arm.ring.kinds[j] == "R"]
    return [j for j in turning if j in run] or turning


def _with_joints_still(R: Elements, joints: list[int]) -> Elements:
    """Return a rotation with joints at zero."""
    still = np.empty(R.shape, dtype=object)
    for place, element in np.ndenumerate(R):
        ring = element.ring
        zeros = {ring.place("cosine", j): ring.one for j in joints} | {ring.place("sine", j): ring.zero for j in joints}
        still[place] = translated(element, ring, zeros)
    return still


@dataclass(frozen=True, eq=False)
class _MovingBody:
    """One body of link i in one state of the derivation."""

    arm: ExactArm
    mistakes: frozenset[str]
    i: int
    body: ExactBody
    at: _Place

    def has(self, mistake: str) -> bool:
        return mistake in self.mistakes

    def motion(self, axes: list[Elements]) -> BodyMotion:
        velocity = self.velocity()
        omega = self._unturned_omega() if self.has("omega_unturned") else self.omega(axes)
        K = self.kinetic(velocity, omega)
        return BodyMotion(self.body, self.place("velocity_relative_angle"), velocity, omega, K, self.potential())

    @property
    def mass(self) -> Element:
        return self.body.mass * (0 if self.has("mass_forgotten") else 1)

    @property
    def com(self) -> Elements:
        """The centre of mass in the link's own frame."""
        return self.end if self.has("com_at_end") else self.body.com

    @property
    def joint(self) -> Elements:
        """The link's joint, the origin of the frame that it moves about, in frame 0."""
        return self.at.before if self.arm.is_standard else self.at.origin

    @property
    def end(self) -> Elements:
        """The far end of the link, in its own frame: its origin, or (modified) the next one's; the last's: the tool."""
        ring = self.arm.ring
        following = self.i + 1
        if following == self.arm.n:
            return self.arm.tool
        if self.arm.is_standard:
            return np.array([ring.zero] * 3, dtype=object)
        return _transform(self.arm, self.arm.rows[following])[1]

    def place(self, mistake: str) -> Elements:
        """Return where the centre of mass is, in frame 0."""
        if self.has(mistake):
            return self.at.alone + self.at.R_alone @ self.com  # type: ignore[no-any-return]
        R = self.at.R.T if self.has("com_rotation_transposed") else self.at.R
        return self.at.origin + R @ self.com  # type: ignore[no-any-return]

    def velocity(self) -> Elements:
        """Differentiate the position, and resolve it in the link's axes, where it is shortest."""
        place = self.joint if self.has("velocity_at_joint") else self.place("velocity_relative_angle")
        rate = np.array([x.by_time() for x in place], dtype=object)
        return self.at.R.T @ rate  # type: ignore[no-any-return]

    def omega(self, axes: list[Elements]) -> Elements:
        """Sum the axes of the revolute joints up to this link, each times its rate."""
        ring = self.arm.ring
        joints = range(self.i, self.i + 1) if self.has("omega_relative") else range(self.i + 1)
        total = np.array([ring.zero] * 3, dtype=object)
        for j in joints:
            if ring.kinds[j] == "R":
                total = total + (self.at.R.T @ axes[j]) * ring.rate(j)
        return total

    def _unturned_omega(self) -> Elements:
        """Pass the angular velocity from link to link, turned by the constant angles of the table alone.

        omega_j = R_j^T (omega_(j-1) + qd_j z) in the standard convention, R_j^T omega_(j-1) + qd_j z in the modified.
        """
        ring = self.arm.ring
        omega = np.array([ring.zero] * 3, dtype=object)
        for j, row in enumerate(self.arm.rows[: self.i + 1]):
            R = _transform(self.arm, row)[0]
            own = np.array([ring.zero] * 3, dtype=object)
            if ring.kinds[j] == "R":
                R = _with_joints_still(R, [j])
                own[2] = ring.rate(j)
            omega = R.T @ (omega + own) if self.arm.is_standard else R.T @ omega + own
        return omega

    def inertia(self) -> Elements:
        """Return the tensor about the centre of mass, in the link's axes."""
        tensor = self.body.inertia
        if self.has("inertia_forgotten"):
            return 0 * tensor
        if self.has("inertia_doubled"):
            tensor = 2 * tensor
        if self.has("inertia_axes"):
            tensor = np.roll(tensor, (-1, -1), (0, 1))
        if self.has("inertia_about_joint"):
            lever = self.com - self.at.R.T @ (self.joint - self.at.origin)
            tensor = tensor + point_inertia(lever, self.mass * lever)
        return tensor

    def kinetic(self, velocity: Elements, omega: Elements) -> Element:
        """Return m v^2 / 2 + omega^T I omega / 2."""
        factor = Fraction(1) if self.has("half_forgotten") else _HALF * _HALF if self.has("half_squared") else _HALF
        square = velocity @ velocity
        if self.has("velocity_cross_term") or self.has("inertia_about_com_at_joint"):
            own = self.at.R.T @ np.array([x.by_time() for x in self.joint], dtype=object)
            swing = velocity - own
            square = square - (2 * (own @ swing) if self.has("velocity_cross_term") else swing @ swing)
        translation = self.mass * square * (2 if self.has("translation_half_forgotten") else 1)
        rotation = omega @ self.inertia() @ omega * (2 if self.has("rotation_half_forgotten") else 1)
        return (translation + rotation) * factor  # type: ignore[no-any-return]

    def potential(self) -> Element:
        """Return -m g.p, with p the centre of mass seen from the world's origin."""
        arm = self.arm
        gravity = self.arm.gravity
        if self.has("gravity_forgotten") or self.has("height_forgotten"):
            return arm.ring.zero
        for name, places in (("gravity_axis", 1), ("gravity_axis_back", -1)):
            if self.has(name):
                gravity = arm.base.T @ np.roll(arm.base @ gravity, places)
        place = self.place("height_relative_angle")
        if self.has("height_at_joint"):
            place = self.joint
        if self.has("height_at_end"):
            place = self.at.origin + self.at.R @ self.end
        sign = 1 if self.has("gravity_sign") else -1
        return sign * self.mass * (gravity @ (place + arm.origin))  # type: ignore[no-any-return]


def _transform(arm: ExactArm, row: ExactRow) -> tuple[Elements, Elements]:
    """Return rotation and translation of A_i."""
    zero = arm.ring.zero
    c, s = row.theta
    ca, sa = row.alpha
    # A_i = Rz(theta) Tz(d) Tx(a) Rx(alpha), or Rx(alpha) Tx(a) Rz(theta) Tz(d) with the modified table.
    if arm.is_standard:
        R = [[c, -s * ca, s * sa], [s, c * ca, -c * sa], [zero, sa, ca]]
        return np.array(R, dtype=object), np.array([row.a * c, row.a * s, row.d], dtype=object)
    R = [[c, -s, zero], [s * ca, c * ca, -sa], [s * sa, c * sa, ca]]
    return np.array(R, dtype=object), np.array([row.a, -sa * row.d, ca * row.d], dtype=object)


def _identity(ring: Ring) -> Elements:
    return np.array([[ring.one if i == j else ring.zero for j in range(3)] for i in range(3)], dtype=object)


def scaled(torque: Element, squares: bool, factor: Fraction) -> Element:
    """Multiply the squares of rates, or the products of two different ones, by a factor."""
    ring = torque.ring
    rates = [ring.place("rate", i) for i in range(ring.n)]
    return ring.from_terms(
        {
            monomial: coefficient * (factor if (max(monomial[k] for k in rates) == 2) == squares else 1)
            for monomial, coefficient in torque.terms.items()
        }
    )
