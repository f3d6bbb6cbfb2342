"""A rigid load in the tool's frame, as symbols."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dhkit.description import Convention, Description
from dhkit.symbolic.differentiable.bodies import Moments
from dhkit.symbolic.differentiable.vectors import Vector3, dot, plus

if TYPE_CHECKING:
    import casadi


def payload_moments(description: Description, mass: casadi.SX, com: casadi.SX, inertia: casadi.SX) -> Moments:
    """Return the moments of a load in the joint frame of an arm's last link.

    Parameters
    ----------
    description
        The arm that carries it.
    mass
        kg.
    com
        3 x 1, centre of mass in the tool's frame, m.
    inertia
        6 x 1: xx, yy, zz, xy, yz, xz of the tensor about the centre of mass in the tool's axes, kg m^2.
    """
    (R, p) = _tool_in_joint_frame(description)
    xx, yy, zz, xy, yz, xz = (inertia[i] for i in range(6))
    tensor: list[Vector3] = [(xx, xy, xz), (xy, yy, yz), (xz, yz, zz)]
    half = [_turned(R, row) for row in tensor]
    turned = [_turned(R, (column[0], column[1], column[2])) for column in zip(*half, strict=True)]
    return Moments.of_body(mass, plus(p, _turned(R, (com[0], com[1], com[2]))), turned)


def _turned(R: list[Vector3], a: Vector3) -> Vector3:
    return dot(R[0], a), dot(R[1], a), dot(R[2], a)


def _tool_in_joint_frame(description: Description) -> tuple[list[Vector3], Vector3]:
    numbers = description.numbers
    T = numbers.T_last_tool.tolist()
    rows: list[Vector3] = [(row[0], row[1], row[2]) for row in T[:3]]
    x, y, z = (row[3] for row in T[:3])
    if description.convention is Convention.MODIFIED:
        return rows, (x, y, z)
    # DH frame n lies behind the joint: Tx(a) Rx(alpha) from the joint frame.
    a, c, s = (float(column[-1]) for column in (numbers.a, numbers.cos_alpha, numbers.sin_alpha))
    behind: list[Vector3] = [(1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)]
    columns = [_turned(behind, (column[0], column[1], column[2])) for column in zip(*rows, strict=True)]
    return [(r[0], r[1], r[2]) for r in zip(*columns, strict=True)], plus((a, 0.0, 0.0), _turned(behind, (x, y, z)))
