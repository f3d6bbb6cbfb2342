"""Rigid bodies with exact numbers: moved to another frame, joined, and made from a uniform rod."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description.exact_poses import ExactPose, settled, vector
from dhkit.description.values import Body, Inertia, Vector
from dhkit.expressions import ZERO, Expression

__all__ = ["joined", "moved_body", "rod"]


def moved_body(body: Body, T: ExactPose) -> Body:
    """Return a body in the frame that T maps its frame to: com -> R com + p, I -> R I R^T."""
    R = T[:3, :3]
    com = R @ np.array(body.com, dtype=object) + T[:3, 3]
    tensor = R @ np.array(body.inertia.rows, dtype=object) @ R.T
    return Body(body.mass, vector(com), _inertia(tensor), body.unphysical)


def joined(first: Body, second: Body) -> Body:
    """Return two bodies of one frame as one: Steiner's theorem about the common centre of mass.

    A body of mass 0 with inertia (Corke's PUMA link 1) joins with its inertia and no lever.
    """
    mass = first.mass + second.mass
    tensor = np.array(first.inertia.rows, dtype=object) + np.array(second.inertia.rows, dtype=object)
    if mass.is_zero or first.mass.is_zero or second.mass.is_zero:
        com = second.com if first.mass.is_zero else first.com
        return Body(mass, com, _inertia(tensor), first.unphysical or second.unphysical)
    c1, c2 = np.array(first.com, dtype=object), np.array(second.com, dtype=object)
    com = vector(np.array([(first.mass * x + second.mass * y) / mass for x, y in zip(c1, c2, strict=True)]))
    reduced = first.mass * second.mass / mass
    tensor = tensor + _steiner(c1 - c2, reduced)
    return Body(mass, com, _inertia(tensor), first.unphysical or second.unphysical)


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
    entries = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
    return Inertia(**{key: settled(tensor[place]) for key, place in entries.items()})
