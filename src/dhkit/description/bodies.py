"""Rigid bodies with exact numbers: uniform rods, bodies moved to another frame, several bodies joined to one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description.arrays import Array
from dhkit.display import repr_line
from dhkit.expressions import ZERO, Expression, exact, settled

ExactArray: TypeAlias = NDArray[np.object_]
"""An array of any shape with entries of type Expression."""

ExactPose: TypeAlias = ExactArray
"""A homogeneous transform, shape (4, 4), lengths in m."""

Vector: TypeAlias = tuple[Expression, Expression, Expression]
"""Three coordinates."""

ORIGIN: Vector = (ZERO, ZERO, ZERO)
INERTIA_PLACES = {
    "xx": (0, 0),
    "yy": (1, 1),
    "zz": (2, 2),
    "xy": (0, 1),
    "yz": (1, 2),
    "xz": (0, 2),
}
"""Row and column of each moment and product in the inertia tensor, in the order in which six of them are listed."""
MIN_EIGENVALUE_TOLERANCE = 1e-12
"""kg m^2: the lowest eigenvalue of a published inertia may be this far below zero ..."""
_RELATIVE_EIGENVALUE_TOLERANCE = 1e-9
"""... or this share of the largest eigenvalue, for tensors given to ten digits."""


def eigenvalue_tolerance(largest: float) -> float:
    """Return how far below zero rounding may put an eigenvalue of an inertia, kg m^2, given its largest one."""
    return MIN_EIGENVALUE_TOLERANCE + _RELATIVE_EIGENVALUE_TOLERANCE * abs(largest)


@dataclass(frozen=True)
class Inertia:
    """Moments and products of inertia about the centre of mass, kg m^2; xy = -integral of x y dm."""

    xx: Expression = ZERO
    yy: Expression = ZERO
    zz: Expression = ZERO
    xy: Expression = ZERO
    yz: Expression = ZERO
    xz: Expression = ZERO

    @classmethod
    def of_tensor(cls, tensor: Array) -> Inertia:
        """Return the inertia of a symmetric tensor, shape (3, 3), kg m^2; every double is kept exactly."""
        return cls(**{key: exact(float(tensor[place])) for key, place in INERTIA_PLACES.items()})

    @property
    def rows(self) -> tuple[Vector, Vector, Vector]:
        """The symmetric 3x3 tensor."""
        return (self.xx, self.xy, self.xz), (self.xy, self.yy, self.yz), (self.xz, self.yz, self.zz)

    def __repr__(self) -> str:
        entries = ", ".join(f"{key} {getattr(self, key)}" for key in INERTIA_PLACES)
        return repr_line("Inertia", "", f"{entries} kg m^2")


PAYLOAD = "payload"
"""Name of the body that :func:`dhkit.description.changes.with_payload` adds; of several, further ones are numbered."""


@dataclass(frozen=True)
class Body:
    """A rigid body's mass, kg, centre of mass, m, and inertia about it, in the axes of its link's own DH frame."""

    mass: Expression
    com: Vector = ORIGIN
    inertia: Inertia = Inertia()
    unphysical: bool = False
    """The inertia is known to be impossible and kept as published: a warning, no error."""
    name: str = ""
    """Empty for a link's only body; of several, the joint names those without a name ``body 1``, ``body 2`` ..."""

    @property
    def is_payload(self) -> bool:
        """Whether its name is that of a payload: ``payload``, ``payload 2`` ..."""
        return self.name.partition(" ")[0] == PAYLOAD

    def __repr__(self) -> str:
        return repr_line(
            "Body", self.name, f"{self.mass} kg, centre of mass {vector_text(self.com)} m"
        )


def settled_vector(entries: Sequence[Expression] | ExactArray) -> Vector:
    """Return three coordinates as a vector, each in settled (simplified) form; shape (3,), any unit."""
    x, y, z = (settled(entry) for entry in entries)
    return x, y, z


def moved_body(body: Body, T: ExactPose) -> Body:
    """Return a body in the frame that T, shape (4, 4), maps its frame to: com -> R com + p, I -> R I R^T."""
    R = T[:3, :3]
    com = R @ np.array(body.com, dtype=object) + T[:3, 3]
    tensor = R @ np.array(body.inertia.rows, dtype=object) @ R.T
    return replace(body, com=settled_vector(com), inertia=_inertia(tensor))


def joined(bodies: Sequence[Body]) -> Body:
    """Return bodies of one frame joined to one body, by Steiner's theorem about the common centre of mass.

    All bodies are joined in one step, which keeps symbolic masses short: with c the centre of mass,
    I = sum(I_i + m_i S(c_i)) - m S(c), S(r) = r^2 1 - r r^T, and m S(c) = S(sum(m_i c_i)) / m. A body of mass 0 with
    inertia (Corke's PUMA link 1) contributes its inertia and no Steiner term.
    """
    if len(bodies) == 1:
        return bodies[0]
    unphysical = any(body.unphysical for body in bodies)
    tensor = sum(
        (np.array(body.inertia.rows, dtype=object) for body in bodies),
        np.full((3, 3), ZERO, dtype=object),
    )
    heavy = [body for body in bodies if not body.mass.is_zero]
    if len(heavy) < 2:
        located = (heavy or bodies)[0]
        return Body(located.mass, located.com, _inertia(tensor), unphysical)

    # With m = sum m_k, s = sum m_k c_k and S(m, l) = m (l^2 1 - l l^T), about the common origin
    #     J = sum (I_k + S(m_k, c_k)),
    # and about the common centre of mass c = s / m
    #     I = J - S(m, c) = J - S(1/m, s).
    mass = Expression.sum(body.mass for body in heavy)
    first_moment = np.full(3, ZERO, dtype=object)
    about_origin = tensor
    for body in heavy:
        com = np.array(body.com, dtype=object)
        first_moment = first_moment + com * body.mass
        about_origin = about_origin + _steiner_term(com, body.mass)
    common_com = settled_vector([entry / mass for entry in first_moment])
    inertia = _inertia(about_origin - _steiner_term(first_moment, 1 / mass))
    return Body(mass, common_com, inertia, unphysical)


def rod(mass: Expression, start: Vector, end: Vector) -> Body:
    """Return a thin uniform rod between two points, m: inertia m (l^2 1 - l l^T) / 12 about its middle."""
    first = np.array(start, dtype=object)
    last = np.array(end, dtype=object)
    return Body(
        mass, settled_vector((first + last) / 2), _inertia(_steiner_term(last - first, mass / 12))
    )


def _steiner_term(lever: ExactArray, mass: Expression) -> ExactArray:
    """Return mass (l^2 1 - l l^T), shape (3, 3), of a lever l, shape (3,)."""
    square = sum((x * x for x in lever), ZERO)
    square_times_identity = np.full((3, 3), ZERO, dtype=object)
    np.fill_diagonal(square_times_identity, square)
    term: ExactArray = (square_times_identity - np.outer(lever, lever)) * mass
    return term


def _inertia(tensor: ExactArray) -> Inertia:
    return Inertia(**{key: settled(tensor[place]) for key, place in INERTIA_PLACES.items()})


def vector_text(vector: Vector) -> str:
    """Return three coordinates as text: ``(0, l1/2, 0.1)``."""
    return f"({', '.join(map(str, vector))})"
