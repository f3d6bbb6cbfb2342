"""Rigid bodies with exact numbers: made from a uniform rod, moved to another frame, and joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.display import repr_line
from dhkit.expressions import ZERO, Expression, settled

ExactPose: TypeAlias = NDArray[Any]
"""A homogeneous transform, shape (4, 4), entries Expression."""

Vector: TypeAlias = tuple[Expression, Expression, Expression]
"""Three coordinates."""

ORIGIN: Vector = (ZERO, ZERO, ZERO)
INERTIA_PLACES = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
"""Where moments and products stand in a tensor, in the order in which six of them are listed."""


@dataclass(frozen=True)
class Inertia:
    """Moments and products of inertia about the centre of mass, kg m^2; xy = -integral of x y dm."""

    xx: Expression = ZERO
    yy: Expression = ZERO
    zz: Expression = ZERO
    xy: Expression = ZERO
    yz: Expression = ZERO
    xz: Expression = ZERO

    @property
    def rows(self) -> tuple[Vector, Vector, Vector]:
        """The symmetric 3x3 tensor."""
        return (self.xx, self.xy, self.xz), (self.xy, self.yy, self.yz), (self.xz, self.yz, self.zz)

    def __repr__(self) -> str:
        said = ", ".join(f"{key} {getattr(self, key)}" for key in INERTIA_PLACES)
        return repr_line("Inertia", said=f"{said} kg m^2")


@dataclass(frozen=True)
class Body:
    """A rigid body's mass, kg, centre of mass, m, and inertia about it, in the axes of its link's own DH frame."""

    mass: Expression
    com: Vector = ORIGIN
    inertia: Inertia = Inertia()
    unphysical: bool = False
    """The inertia is known to be impossible and kept as published: a warning, no error."""
    name: str = ""
    """Empty: the joint calls it ``body 1``, ``body 2`` ... by its place, where its link has several bodies."""

    def __repr__(self) -> str:
        return repr_line("Body", self.name, f"{self.mass} kg, centre of mass {vector_text(self.com)} m")


def vector(entries: Sequence[Expression] | NDArray[Any]) -> Vector:
    """Return three settled coordinates."""
    x, y, z = (settled(entry) for entry in entries)
    return x, y, z


def moved_body(body: Body, T: ExactPose) -> Body:
    """Return a body in the frame that T maps its frame to: com -> R com + p, I -> R I R^T."""
    R = T[:3, :3]
    com = R @ np.array(body.com, dtype=object) + T[:3, 3]
    tensor = R @ np.array(body.inertia.rows, dtype=object) @ R.T
    return replace(body, com=vector(com), inertia=_inertia(tensor))


def joined(bodies: Sequence[Body]) -> Body:
    """Return bodies of one frame as one: Steiner's theorem about the common centre of mass.

    All at once, which keeps symbolic masses short: with c the centre of mass,
    I = sum(I_i + m_i S(c_i)) - m S(c), S(r) = r^2 1 - r r^T, and m S(c) = S(sum(m_i c_i)) / m. A body of mass 0 with
    inertia (Corke's PUMA link 1) joins with its inertia and no lever.
    """
    if len(bodies) == 1:
        return bodies[0]
    unphysical = any(body.unphysical for body in bodies)
    tensor = sum((np.array(body.inertia.rows, dtype=object) for body in bodies), np.full((3, 3), ZERO, dtype=object))
    heavy = [body for body in bodies if not body.mass.is_zero]
    if len(heavy) < 2:
        one = (heavy or bodies)[0]
        return Body(one.mass, one.com, _inertia(tensor), unphysical)
    mass = Expression.sum(body.mass for body in heavy)
    moment = sum(
        (np.array([body.mass * x for x in body.com], dtype=object) for body in heavy), np.full(3, ZERO, dtype=object)
    )
    levers = sum((_steiner(np.array(body.com, dtype=object), body.mass) for body in heavy), tensor)
    com = vector([entry / mass for entry in moment])
    return Body(mass, com, _inertia(levers - _steiner(moment, 1 / mass)), unphysical)


def rod(mass: Expression, start: Vector, end: Vector) -> Body:
    """Return a thin uniform rod between two points: inertia m (l^2 1 - l l^T) / 12 about its middle."""
    first, last = np.array(start, dtype=object), np.array(end, dtype=object)
    return Body(mass, vector((first + last) / 2), _inertia(_steiner(last - first, mass / 12)))


def _steiner(lever: NDArray[Any], mass: Expression) -> NDArray[Any]:
    """Return mass (l^2 1 - l l^T)."""
    square = sum((x * x for x in lever), ZERO)
    return np.array(
        [[mass * ((square if i == j else ZERO) - lever[i] * lever[j]) for j in range(3)] for i in range(3)],
        dtype=object,
    )


def _inertia(tensor: NDArray[Any]) -> Inertia:
    return Inertia(**{key: settled(tensor[place]) for key, place in INERTIA_PLACES.items()})


def vector_text(vector: Vector) -> str:
    """Return three coordinates as text: ``(0, l1/2, 0.1)``."""
    return f"({', '.join(map(str, vector))})"
