"""Mass matrix and potential energy in the exact ring, by composite bodies.

All links that a joint carries are one rigid body. A unit rate of the joint gives it a momentum, whose components along
the joints before are a column of M (Walker & Orin, 1982, method 3). Every step is linear in the inertial parameters,
which keeps expressions short.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from dhkit.symbolic.exact.exact_arm import ExactArm, ExactRow
from dhkit.symbolic.ring import Element, Elements, Ring


@dataclass(frozen=True, eq=False)
class JointTransform:
    """A joint's frame, with its z axis along the joint, in the frame of the joint before; p in m."""

    R: Elements
    """Shape (3, 3)."""
    p: Elements
    """Shape (3,)."""

    @classmethod
    def of(cls, ring: Ring, a: Element, alpha: tuple[Element, Element], row: ExactRow) -> JointTransform:
        """Return Tx(a) Rx(alpha) Rz(theta) Tz(d) (Craig 2005, eq. 3.6)."""
        ca, sa = alpha
        c, s = row.theta
        R = np.array([[c, -s, ring.zero], [s * ca, c * ca, -sa], [s * sa, c * sa, ca]], dtype=object)
        return cls(R, np.array([a, -(sa * row.d), ca * row.d], dtype=object))


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A rigid body in a joint's frame: mass, kg, first moments, kg m, and inertia about the origin, kg m^2."""

    mass: Element
    moment: Elements
    """Shape (3,)."""
    second: Elements
    """Shape (3, 3)."""

    def __add__(self, other: RigidBody) -> RigidBody:
        return RigidBody(self.mass + other.mass, self.moment + other.moment, self.second + other.second)

    def moved(self, step: JointTransform) -> RigidBody:
        """Return the body in the frame before, by Steiner's theorem in first moments."""
        # h' = R h + m p  and, with h for R h,
        # J' = R J R^T + (2 p . h + m p^2) 1 - (p h^T + h p^T + m p p^T).
        p = step.p
        m = self.mass
        h = step.R @ self.moment
        square = 2 * (p @ h) + m * (p @ p)
        J = step.R @ self.second @ step.R.T
        second = np.empty((3, 3), dtype=object)
        for i in range(3):
            for j in range(i, 3):
                lever = p[i] * h[j] + h[i] * p[j] + m * p[i] * p[j]
                second[i, j] = second[j, i] = J[i, j] - lever + (square if i == j else 0)
        return RigidBody(m, h + m * p, second)


def mass_matrix(arm: ExactArm, bodies: Sequence[RigidBody] | None = None) -> Elements:
    """Return M, shape (n, n), with reflected rotor inertia; ``bodies`` in joint frames replace the arm's own."""
    n = arm.n
    ring = arm.ring
    # Composite rigid bodies (Featherstone 2008, section 6.2): column j of M is the momentum that joint j's unit rate
    # gives to all links after it, taken about and along the axes of joints i <= j.
    steps = joint_steps(arm)
    bodies = bodies or joint_bodies(arm)
    M = np.empty((n, n), dtype=object)
    beyond = bodies[n - 1]
    for j in reversed(range(n)):
        if j < n - 1:
            beyond = bodies[j] + beyond.moved(steps[j + 1])
        force, torque = _momentum(ring, arm.ring.kinds[j], beyond)
        for i in reversed(range(j + 1)):
            M[i, j] = M[j, i] = torque[2] if ring.kinds[i] == "R" else force[2]
            if i:
                force = steps[i].R @ force
                torque = steps[i].R @ torque + np.cross(steps[i].p, force)
        M[j, j] = M[j, j] + arm.armature[j]
    for i, j, inertia in arm.couplings:
        M[i, j] = M[j, i] = M[i, j] + inertia
    return M


def potential_energy(arm: ExactArm, bodies: Sequence[RigidBody] | None = None) -> Element:
    """Return V = -sum m g.c, J, zero at the world's origin; ``bodies`` in joint frames replace the arm's own."""
    steps = joint_steps(arm)
    bodies = bodies or joint_bodies(arm)
    beyond = bodies[-1]
    for j in reversed(range(arm.n - 1)):
        beyond = RigidBody(
            bodies[j].mass + beyond.mass,
            bodies[j].moment + steps[j + 1].R @ beyond.moment + beyond.mass * steps[j + 1].p,
            beyond.second,
        )
    moment = steps[0].R @ beyond.moment + beyond.mass * (steps[0].p + arm.origin)
    return -(arm.gravity @ moment)  # type: ignore[no-any-return]


def _momentum(ring: Ring, kind: str, body: RigidBody) -> tuple[Elements, Elements]:
    """Return linear and angular momentum of a body about the frame's origin, for a unit rate of its joint."""
    x, y, _ = body.moment
    if kind == "R":
        return np.array([-y, x, ring.zero], dtype=object), body.second[:, 2].copy()
    return np.array([ring.zero, ring.zero, body.mass], dtype=object), np.array([y, -x, ring.zero], dtype=object)


def joint_steps(arm: ExactArm) -> list[JointTransform]:
    """Return the transform of each joint's frame from the one before; the first is from frame 0."""
    ring = arm.ring
    if not arm.is_standard:
        return [JointTransform.of(ring, row.a, row.alpha, row) for row in arm.rows]
    # In a standard row a and alpha follow the joint: they belong to the next joint's transform.
    before = [(ring.zero, (ring.one, ring.zero)), *((row.a, row.alpha) for row in arm.rows[:-1])]
    return [JointTransform.of(ring, a, alpha, row) for (a, alpha), row in zip(before, arm.rows, strict=True)]


def joint_bodies(arm: ExactArm) -> list[RigidBody]:
    """Return each link's bodies as one, in the frame of its joint."""
    masses = [
        reduce(operator.add, (RigidBody(body.mass, body.moment, body.second) for body in bodies))
        for bodies in arm.bodies
    ]
    if not arm.is_standard:
        return masses
    return [body.moved(_behind(arm.ring, row)) for body, row in zip(masses, arm.rows, strict=True)]


def _behind(ring: Ring, row: ExactRow) -> JointTransform:
    """Return Tx(a) Rx(alpha): DH frame i in joint i's frame, for a standard row."""
    ca, sa = row.alpha
    zero = ring.zero
    one = ring.one
    R = np.array([[one, zero, zero], [zero, ca, -sa], [zero, sa, ca]], dtype=object)
    return JointTransform(R, np.array([row.a, zero, zero], dtype=object))
