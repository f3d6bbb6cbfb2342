"""Mass matrix and potential energy in the exact ring, by composite bodies.

All links that a joint carries are one rigid body. A unit rate of the joint gives it a momentum, whose components along
this joint and the joints before it are a column of M (Walker & Orin, 1982, method 3). Every step is linear in the
inertial parameters, which keeps expressions short.
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
    def of(
        cls, ring: Ring, a: Element, alpha: tuple[Element, Element], row: ExactRow
    ) -> JointTransform:
        """Return Tx(a) Rx(alpha) Rz(theta) Tz(d)."""
        ca, sa = alpha
        c, s = row.theta
        d = row.d
        R = np.array(
            [
                [c, -s, ring.zero],
                [s * ca, c * ca, -sa],
                [s * sa, c * sa, ca],
            ],
            dtype=object,
        )
        p = np.array([a, -(sa * d), ca * d], dtype=object)
        return cls(R, p)


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A rigid body in a joint's frame: mass, kg, first moments, kg m, and inertia about the origin, kg m^2."""

    mass: Element
    moment: Elements
    """Shape (3,)."""
    second: Elements
    """Shape (3, 3)."""

    def __add__(self, other: RigidBody) -> RigidBody:
        return RigidBody(
            self.mass + other.mass, self.moment + other.moment, self.second + other.second
        )

    def moved(self, step: JointTransform) -> RigidBody:
        """Return the body in the frame before, by Steiner's theorem in first moments."""
        m = self.mass
        p = step.p
        h = step.R @ self.moment
        J = step.R @ self.second @ step.R.T

        # The body's points, at r in axes of the frame before, move to r + p. With h = sum m r:
        #   sum m ((r + p)^2 1 - (r + p)(r + p)^T) = J + (2 p.h + m p^2) 1 - (p h^T + h p^T + m p p^T)
        square = 2 * (p @ h) + m * (p @ p)
        second = np.empty((3, 3), dtype=object)
        for i in range(3):
            for j in range(i, 3):
                product = p[i] * h[j] + h[i] * p[j] + m * p[i] * p[j]
                second[i, j] = second[j, i] = J[i, j] - product + (square if i == j else 0)
        return RigidBody(m, h + m * p, second)


def mass_matrix(arm: ExactArm, bodies: Sequence[RigidBody] | None = None) -> Elements:
    """Return M, shape (n, n), with reflected rotor inertia; ``bodies`` in joint frames replace the arm's own."""
    n = arm.n
    ring = arm.ring
    steps = joint_steps(arm)
    bodies = bodies or joint_bodies(arm)

    M = np.empty((n, n), dtype=object)
    composite = bodies[n - 1]
    for j in reversed(range(n)):
        if j < n - 1:
            composite = bodies[j] + composite.moved(steps[j + 1])

        # Momentum of all that joint j carries, for qd_j = 1. M_ij is its component along joint i.
        p, L = _momentum(ring, ring.kinds[j], composite)
        for i in reversed(range(j + 1)):
            M[i, j] = M[j, i] = L[2] if ring.kinds[i] == "R" else p[2]
            if i:
                p = steps[i].R @ p
                L = steps[i].R @ L + np.cross(steps[i].p, p)
        M[j, j] = M[j, j] + arm.armature[j]

    for i, j, inertia in arm.couplings:
        M[i, j] = M[j, i] = M[i, j] + inertia
    return M


def potential_energy(arm: ExactArm, bodies: Sequence[RigidBody] | None = None) -> Element:
    """Return V = -sum m g.c, J, zero at the world's origin; ``bodies`` in joint frames replace the arm's own."""
    steps = joint_steps(arm)
    bodies = bodies or joint_bodies(arm)

    # Mass m and first moments h of the links from j on, in joint j's frame: h <- h_j + R h + m p
    m = bodies[-1].mass
    h = bodies[-1].moment
    for j in reversed(range(arm.n - 1)):
        step = steps[j + 1]
        h = bodies[j].moment + step.R @ h + m * step.p
        m = bodies[j].mass + m

    # From the world's origin, in the axes of frame 0; V = -g . h
    h = steps[0].R @ h + m * (steps[0].p + arm.origin)
    return -(arm.gravity @ h)  # type: ignore[no-any-return]


def _momentum(ring: Ring, kind: str, body: RigidBody) -> tuple[Elements, Elements]:
    """Return linear and angular momentum of a body about the frame's origin, for a unit rate of its joint."""
    x, y, _ = body.moment
    zero = ring.zero
    if kind == "R":
        # w = z: linear z x h, angular I z
        return np.array([-y, x, zero], dtype=object), body.second[:, 2].copy()
    # v = z: linear m z, angular h x z
    return np.array([zero, zero, body.mass], dtype=object), np.array([y, -x, zero], dtype=object)


def joint_steps(arm: ExactArm) -> list[JointTransform]:
    """Return the transform of each joint's frame from the one before; the first is from frame 0."""
    ring = arm.ring
    if not arm.is_standard:
        return [JointTransform.of(ring, row.a, row.alpha, row) for row in arm.rows]
    # In a standard row a and alpha follow the joint: they belong to the next joint's transform.
    before = [(ring.zero, (ring.one, ring.zero)), *((row.a, row.alpha) for row in arm.rows[:-1])]
    return [
        JointTransform.of(ring, a, alpha, row)
        for (a, alpha), row in zip(before, arm.rows, strict=True)
    ]


def joint_bodies(arm: ExactArm) -> list[RigidBody]:
    """Return each link's bodies as one, in the frame of its joint."""
    links: list[RigidBody] = []
    for bodies in arm.bodies:
        rigid_bodies = [RigidBody(body.mass, body.moment, body.second) for body in bodies]
        links.append(reduce(operator.add, rigid_bodies))

    # Bodies are given in DH frames; a modified DH frame is the joint's frame.
    if not arm.is_standard:
        return links
    return [
        link.moved(_dh_frame_in_joint_frame(arm.ring, row))
        for link, row in zip(links, arm.rows, strict=True)
    ]


def _dh_frame_in_joint_frame(ring: Ring, row: ExactRow) -> JointTransform:
    """Return Tx(a) Rx(alpha): DH frame i in joint i's frame, for a standard row."""
    ca, sa = row.alpha
    zero = ring.zero
    one = ring.one
    R = np.array([[one, zero, zero], [zero, ca, -sa], [zero, sa, ca]], dtype=object)
    p = np.array([row.a, zero, zero], dtype=object)
    return JointTransform(R, p)
