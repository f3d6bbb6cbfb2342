"""Rigid bodies with exact numbers: moved to another frame, joined, and made from a uniform rod."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description.exact_poses import ExactPose, settled, vector
from dhkit.description.robot import takes_robot
from dhkit.description.values import INERTIA_PLACES, Body, Inertia, Vector
from dhkit.errors import DescriptionError
from dhkit.expressions import ZERO, Expression

if TYPE_CHECKING:
    from dhkit.description.robot import Description


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


@takes_robot
def require_bodies(description: Description) -> tuple[tuple[Body, ...], ...]:
    """Return the bodies of each link, and refuse an arm whose dynamics are unknown.

    Raises
    ------
    DescriptionError
        Names the joints whose links have no body.
    """
    bare = [f"{i} ({joint.name})" for i, joint in enumerate(description.joints, start=1) if not joint.bodies]
    if bare:
        raise DescriptionError(
            f"{description.name}: the link{'s' * (len(bare) > 1)} of joint{'s' * (len(bare) > 1)} {', '.join(bare)} "
            f"{'have' if len(bare) > 1 else 'has'} no body, so the dynamics are unknown; add [joint.body], "
            "or use with_uniform_links (--uniform-links in the command)"
        )
    return tuple(joint.bodies for joint in description.joints)


def _steiner(lever: NDArray[Any], mass: Expression) -> NDArray[Any]:
    """Return mass (l^2 1 - l l^T)."""
    square = sum((x * x for x in lever), ZERO)
    return np.array(
        [[mass * ((square if i == j else ZERO) - lever[i] * lever[j]) for j in range(3)] for i in range(3)],
        dtype=object,
    )


def _inertia(tensor: NDArray[Any]) -> Inertia:
    return Inertia(**{key: settled(tensor[place]) for key, place in INERTIA_PLACES.items()})
