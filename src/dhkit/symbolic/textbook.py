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
from dhkit.symbolic.exact.transforms import identity
from dhkit.symbolic.mistakes import (
    LINK_MISTAKES,
    STEP_FACTORS,
    VELOCITY_FACTORS,
    MadeAt,
    check_mistake,
    has,
    made_at,
)
from dhkit.symbolic.ring import Element, Elements, Monomial, translated
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
        ring = arm.ring
        energies = []
        for i, (gear, rotor) in enumerate(zip(arm.gear, arm.rotor, strict=True)):
            if self._has("rotor_forgotten", i):
                continue
            ratio = gear * gear
            if self._has("rotor_gear", i):
                ratio = gear
            if self._has("rotor_without_gear", i):
                ratio = ring.one
            energies.append(rotor * ratio * ring.rate(i) * ring.rate(i) * _HALF)
        for i, j, inertia in arm.couplings:
            energies.append(inertia * ring.rate(i) * ring.rate(j))
        return ring.sum(energies)

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
        n = self.arm.n
        M = np.empty((n, n), dtype=object)
        for i, p in enumerate(self.momenta):
            for j in range(n):
                M[i, j] = p.by_rate(j)
        return M

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
        # d/dt dL/dqd - dL/dq = M qdd + h + g, with M_ij = dp_i/dqd_j
        ring = self.arm.ring
        n = self.arm.n
        M_qdd = np.empty(n, dtype=object)
        for i, p in enumerate(self.momenta):
            M_qdd[i] = ring.sum(p.by_rate(j) * ring.acceleration(j) for j in range(n))
        return M_qdd + self.h + self.g

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
    # Factors of both terms: 1 without mistakes.
    rate_factor = Fraction(1)
    gradient_factor = Fraction(1)
    for name, (of_rate, of_gradient) in STEP_FACTORS.items():
        if MadeAt(name) in mistakes:
            rate_factor = rate_factor * of_rate
            gradient_factor = gradient_factor * of_gradient

    torques = []
    for i, p in enumerate(momenta):
        # h_i = sum of dp_i/dq_k qd_k - dK/dq_i
        momentum_rate = ring.sum(p.by_position(k) * ring.rate(k) for k in range(ring.n))
        torque = momentum_rate * rate_factor - K.by_position(i) * gradient_factor
        for name, (squares, factor) in VELOCITY_FACTORS.items():
            if MadeAt(name) in mistakes:
                torque = scaled(torque, squares, factor)
        torques.append(torque)
    return np.array(torques, dtype=object)


@takes_robot
def derive(
    description: Description,
    mistakes: Iterable[MadeAt | str] = frozenset(),
    symbols: Symbols = "file",
) -> TextbookDerivation:
    """Derive an arm's equations of motion as a textbook does.

    Parameters
    ----------
    description
        The robot.
    mistakes
        Mistakes of :data:`dhkit.symbolic.MISTAKES`, by identity where they are made at every link,
        ``MadeAt(identity, 2)`` for link 2 alone, or ``MadeAt(identity, 2, "payload")`` for its body of that name.
    symbols
        See :func:`dhkit.symbolic.exact.exact_arm`.

    Returns
    -------
    TextbookDerivation
        Every step: positions, velocities, energies, Lagrange's equations.

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
    body_names = []
    for bodies in arm.bodies:
        names = [body.name for body in bodies]
        body_names.append(names)
    for mistake in made:
        check_mistake(mistake, description.n, bodies=body_names)

    links = []
    for i, place in enumerate(_places(arm)):
        motions = []
        for body in arm.bodies[i]:
            made_here = frozenset(
                mistake for mistake in LINK_MISTAKES if has(made, mistake, i, body.name)
            )
            motions.append(_motion(arm, i, body, made_here))
        links.append(LinkMotion(place.R, place.origin, tuple(motions)))
    return TextbookDerivation(arm, tuple(links), made)


@lru_cache(maxsize=4096)
def _motion(arm: ExactArm, i: int, body: ExactBody, mistakes: frozenset[str]) -> BodyMotion:
    """Return motion and energies of a body of link i, from 0; cached, because many derivations share them."""
    places = _places(arm)
    axes = [place.axis for place in places[: i + 1]]
    return _MovingBody(arm, mistakes, i, body, places[i]).motion(axes)


@dataclass(frozen=True, eq=False)
class _Place:
    """The pose of a link's frame in frame 0, and the pose that a student finds who forgets that joints add up."""

    R: Elements
    """Rotation of the frame, shape (3, 3)."""
    origin: Elements
    """Origin of the frame, shape (3,), m."""
    before: Elements
    """Origin of the frame before, shape (3,), m."""
    axis: Elements
    """The joint's axis, shape (3,)."""
    R_alone: Elements
    """Rotation of the frame with earlier joints at zero: those of parallel axes, or all if none is parallel."""
    origin_alone: Elements
    """Origin of the frame if the frame before had its place, and the rotation with these joints at zero; m."""


@lru_cache(maxsize=32)
def _places(arm: ExactArm) -> tuple[_Place, ...]:
    """Return the place of each link's frame, from the base to the tool."""
    ring = arm.ring
    places: list[_Place] = []
    R = identity(ring)[:3, :3]
    p = np.array([ring.zero] * 3, dtype=object)
    for i, row in enumerate(arm.rows):
        # T_0i = T_0(i-1) A_i
        R_before = R
        p_before = p
        R_own, p_own = _transform(arm, row)
        R = R_before @ R_own
        p = p_before + R_before @ p_own
        axis = (R_before if arm.is_standard else R)[:, 2]

        # The link from its joint on, turned by the joint's own angle alone.
        R_zero = _with_joints_at_zero(R_before, _joints_before(arm, i))
        origin_alone = p_before + R_zero @ p_own if arm.is_standard else p
        place = _Place(
            R=R,
            origin=p,
            before=p_before,
            axis=axis,
            R_alone=R_zero @ R_own,
            origin_alone=origin_alone,
        )
        places.append(place)
    return tuple(places)


def _joints_before(arm: ExactArm, i: int) -> list[int]:
    """Return the revolute joints before joint i, from 0, whose axes are parallel to its own; all if none is."""
    run = next((run for run in parallel_runs(arm) if i in run), ())
    revolute = [j for j in range(i) if arm.ring.kinds[j] == "R"]
    return [j for j in revolute if j in run] or revolute


def _with_joints_at_zero(R: Elements, joints: list[int]) -> Elements:
    """Return a rotation, shape (3, 3), with the angles of joints at zero."""
    at_zero = np.empty(R.shape, dtype=object)
    for place, element in np.ndenumerate(R):
        ring = element.ring
        cosines = {ring.place("cosine", j): ring.one for j in joints}
        sines = {ring.place("sine", j): ring.zero for j in joints}
        at_zero[place] = translated(element, ring, cosines | sines)
    return at_zero


@dataclass(frozen=True, eq=False)
class _MovingBody:
    """A body of link i, from 0, and the mistakes that are made in its motion and energies.

    Vectors have shape (3,).
    """

    arm: ExactArm
    mistakes: frozenset[str]
    i: int
    body: ExactBody
    at: _Place

    def has(self, mistake: str) -> bool:
        """Return whether a mistake is made."""
        return mistake in self.mistakes

    def motion(self, axes: list[Elements]) -> BodyMotion:
        """Return motion and energies, from the axes of the joints up to this link, in frame 0."""
        velocity = self.velocity()
        omega = self._unturned_omega() if self.has("omega_unturned") else self.omega(axes)
        K = self.kinetic(velocity, omega)
        return BodyMotion(
            self.body, self.place("velocity_relative_angle"), velocity, omega, K, self.potential()
        )

    @property
    def mass(self) -> Element:
        """Mass, kg."""
        return self.body.mass * (0 if self.has("mass_forgotten") else 1)

    @property
    def com(self) -> Elements:
        """The centre of mass in the link's own frame, m."""
        return self.end if self.has("com_at_end") else self.body.com

    @property
    def joint(self) -> Elements:
        """The link's joint in frame 0, m: the origin of the frame that the joint moves the link about."""
        return self.at.before if self.arm.is_standard else self.at.origin

    @property
    def end(self) -> Elements:
        """The far end of the link in its own frame, m.

        The origin of its own frame (standard) or of the next one (modified); of the last link, the tool's origin.
        """
        ring = self.arm.ring
        following = self.i + 1
        if following == self.arm.n:
            return self.arm.tool
        if self.arm.is_standard:
            return np.array([ring.zero] * 3, dtype=object)
        _, p = _transform(self.arm, self.arm.rows[following])
        return p

    def place(self, mistake: str) -> Elements:
        """Return the centre of mass in frame 0, m; ``mistake`` is that of using the joint's own angle alone."""
        at = self.at
        if self.has(mistake):
            return at.origin_alone + at.R_alone @ self.com  # type: ignore[no-any-return]
        R = at.R.T if self.has("com_rotation_transposed") else at.R
        return at.origin + R @ self.com  # type: ignore[no-any-return]

    def velocity(self) -> Elements:
        """Return the derivative of the position, m/s, in the link's axes, where it is shortest."""
        place = (
            self.joint if self.has("velocity_at_joint") else self.place("velocity_relative_angle")
        )
        place_rate = np.array([x.by_time() for x in place], dtype=object)
        return self.at.R.T @ place_rate  # type: ignore[no-any-return]

    def omega(self, axes: list[Elements]) -> Elements:
        """Return the angular velocity in the link's axes, rad/s: R^T times the sum of z_j qd_j over revolute joints."""
        ring = self.arm.ring
        joints = range(self.i, self.i + 1) if self.has("omega_relative") else range(self.i + 1)
        total = np.array([ring.zero] * 3, dtype=object)
        for j in joints:
            if ring.kinds[j] == "R":
                total = total + (self.at.R.T @ axes[j]) * ring.rate(j)
        return total

    def _unturned_omega(self) -> Elements:
        """Return the angular velocity passed from link to link, turned by the constant angles of the table alone.

        omega_j = R_j^T (omega_(j-1) + qd_j z) in the standard convention, R_j^T omega_(j-1) + qd_j z in the modified.
        """
        ring = self.arm.ring
        omega = np.array([ring.zero] * 3, dtype=object)
        for j, row in enumerate(self.arm.rows[: self.i + 1]):
            R, _ = _transform(self.arm, row)
            qd_z = np.array([ring.zero] * 3, dtype=object)
            if ring.kinds[j] == "R":
                R = _with_joints_at_zero(R, [j])
                qd_z[2] = ring.rate(j)
            omega = R.T @ (omega + qd_z) if self.arm.is_standard else R.T @ omega + qd_z
        return omega

    def inertia(self) -> Elements:
        """Return the tensor about the centre of mass, in the link's axes, shape (3, 3), kg m^2."""
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
        """Return m v^2 / 2 + omega^T I omega / 2, J."""
        factor = _HALF
        if self.has("half_squared"):
            factor = _HALF * _HALF
        if self.has("half_forgotten"):
            factor = Fraction(1)

        square = velocity @ velocity
        if self.has("velocity_cross_term") or self.has("inertia_about_com_at_joint"):
            # v = v_joint + omega x r, so v^2 = v_joint^2 + 2 v_joint.(omega x r) + (omega x r)^2: one term is left out.
            v_joint = self.at.R.T @ np.array([x.by_time() for x in self.joint], dtype=object)
            omega_r = velocity - v_joint
            square = square - (
                2 * (v_joint @ omega_r) if self.has("velocity_cross_term") else omega_r @ omega_r
            )

        translation = self.mass * square
        if self.has("translation_half_forgotten"):
            translation = translation * 2
        rotation = omega @ self.inertia() @ omega
        if self.has("rotation_half_forgotten"):
            rotation = rotation * 2
        return (translation + rotation) * factor  # type: ignore[no-any-return]

    def potential(self) -> Element:
        """Return -m g.p, J, with p the centre of mass seen from the world's origin."""
        arm = self.arm
        gravity = self.arm.gravity
        if self.has("gravity_forgotten") or self.has("height_forgotten"):
            return arm.ring.zero

        # The axes that are exchanged are those of the world.
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
    """Return rotation, shape (3, 3), and translation, shape (3,), m, of A_i."""
    zero = arm.ring.zero
    a = row.a
    d = row.d
    c, s = row.theta
    ca, sa = row.alpha
    if arm.is_standard:
        # Rz(theta) Tz(d) Tx(a) Rx(alpha)
        R = [
            [c, -s * ca, s * sa],
            [s, c * ca, -c * sa],
            [zero, sa, ca],
        ]
        p = [a * c, a * s, d]
    else:
        # Rx(alpha) Tx(a) Rz(theta) Tz(d)
        R = [
            [c, -s, zero],
            [s * ca, c * ca, -sa],
            [s * sa, c * sa, ca],
        ]
        p = [a, -sa * d, ca * d]
    return np.array(R, dtype=object), np.array(p, dtype=object)


def scaled(torque: Element, squares: bool, factor: Fraction) -> Element:
    """Multiply the squares of rates, or the products of two different ones, by a factor."""
    ring = torque.ring
    rates = [ring.place("rate", i) for i in range(ring.n)]
    terms: dict[Monomial, Fraction] = {}
    for monomial, coefficient in torque.terms.items():
        is_square = max(monomial[k] for k in rates) == 2
        terms[monomial] = coefficient * factor if is_square == squares else coefficient
    return ring.from_terms(terms)
