"""New descriptions from old: another tool, base, payload, parameter values, uniform links."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description.arrays import number_array
from dhkit.description.bodies import INERTIA_PLACES, ORIGIN, Body, ExactPose, Inertia, Vector, moved_body, rod
from dhkit.description.exact_poses import fixed_row, inverse, pose_of
from dhkit.description.frames import one_each
from dhkit.description.named import Named
from dhkit.description.parameters import resolved
from dhkit.description.poses import check_pose, pose_parts
from dhkit.description.robot import Description, takes_robot
from dhkit.description.table_rows import Quantity, quantity
from dhkit.description.traversal import names_in
from dhkit.description.validation import check_body
from dhkit.description.values import Base, Convention, Placement, Tool
from dhkit.errors import DescriptionError
from dhkit.expressions import Expression, exact, exact_angle

SYMMETRIC = 1e-12
"""How unequal the products of an inertia may be, of its largest entry: what R I R^T leaves."""


@takes_robot
def with_tool(description: Description, T: ArrayLike) -> Description:
    """Return the arm with its tool's frame at T in DH frame n, shape (4, 4), in place of the one it has."""
    return replace(description, tool=Tool(_placement(T, "tool"), description.tool.shapes))


@takes_robot
def with_base(description: Description, T: ArrayLike) -> Description:
    """Return the arm with frame 0 at T in the world, shape (4, 4), in place of where it stood."""
    base = description.base
    return replace(description, base=Base(_placement(T, "base"), base.shapes, base.body))


@takes_robot
def with_parameters(description: Description, /, **values: Quantity) -> Description:
    """Return the arm with other values of its parameters, SI and radians.

    Raises
    ------
    DescriptionError
        It has no such parameter, or the robot with this value is none.
    """
    known = description.parameters
    for name in values:
        if name not in known:
            raise DescriptionError(f"{description.name} has no parameter {name!r}; it has {', '.join(known) or 'none'}")
    new = {name: quantity(f"parameters.{name}", value, known) for name, value in values.items()}
    return replace(description, parameters=Named(dict(known) | new))


@takes_robot
def with_limits(
    description: Description,
    *,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    torque: ArrayLike | None = None,
) -> Description:
    """Return the arm with other limits of its joints; those not given stay.

    Parameters
    ----------
    lower, upper
        Lowest and highest joint values, rad and m, one number for all joints or shape (n,). Infinite on both sides:
        the joint is unlimited.
    velocity, torque
        Largest speeds, rad/s and m/s, and torques or forces, N m and N, likewise; inf: unlimited.

    Raises
    ------
    DescriptionError
        A lower limit above the upper one, one side infinite, NaN, or a speed or torque that is not positive.
    ValueError
        Another shape.
    """
    numbers, n = description.numbers, description.n
    own = {"lower": numbers.lower, "upper": numbers.upper, "velocity": numbers.velocity, "torque": numbers.effort}
    given = {"lower": lower, "upper": upper, "velocity": velocity, "torque": torque}
    arrays = {name: own[name] if value is None else one_each(value, name, n) for name, value in given.items()}
    joints = []
    for i, joint in enumerate(description.joints):
        row = {name: float(array[i]) for name, array in arrays.items()}
        where = f"joint {i + 1} ({joint.name})"
        if np.isnan(list(row.values())).any() or np.isinf(row["lower"]) != np.isinf(row["upper"]):
            raise DescriptionError(
                f"{where}: limits [{row['lower']:g}, {row['upper']:g}]; expected two numbers, or both inf"
            )
        changed = joint
        if lower is not None or upper is not None:
            changed = replace(
                changed, limits=None if np.isinf(row["lower"]) else (exact(row["lower"]), exact(row["upper"]))
            )
        if velocity is not None:
            changed = replace(changed, velocity=None if np.isinf(row["velocity"]) else exact(row["velocity"]))
        if torque is not None:
            changed = replace(changed, effort=None if np.isinf(row["torque"]) else exact(row["torque"]))
        joints.append(changed)
    return replace(description, joints=tuple(joints))


@takes_robot
def with_payload(
    description: Description,
    mass: Quantity,
    com: Sequence[Quantity] = (0, 0, 0),
    inertia: ArrayLike | None = None,
) -> Description:
    """Return the arm with a rigid load on its last link: a body of its own, named ``payload``.

    Parameters
    ----------
    mass
        kg; text may use the description's parameters.
    com
        Centre of mass in the tool's frame, m.
    inertia
        Tensor about the load's centre of mass in the tool's axes, shape (3, 3), kg m^2; a point mass if not given.

    Raises
    ------
    DescriptionError
        The last link has no body to join it to, or the load is no body.
    """
    last = description.joints[-1]
    if not last.bodies:
        raise DescriptionError(
            f"joint {description.n} ({last.name}) has no body to join a payload to; see with_uniform_links"
        )
    names = description.parameters
    if len(com) != 3:
        raise DescriptionError(f"payload: com has {len(com)} numbers; expected 3")
    x, y, z = (quantity(f"payload: com[{i}]", entry, names) for i, entry in enumerate(com))
    load = Body(quantity("payload: mass", mass, names), (x, y, z), _tensor(inertia), name=_payload_name(last.bodies))
    check_body(load, "payload", resolved(names))
    bodies = (*last.bodies, moved_body(load, pose_of(description.tool.placement)))
    return replace(description, joints=(*description.joints[:-1], replace(last, bodies=bodies)))


def _payload_name(bodies: Sequence[Body]) -> str:
    """Return a name for one more payload beside these bodies."""
    taken = {body.name for body in bodies}
    names = itertools.chain(["payload"], (f"payload {k}" for k in itertools.count(2)))
    return next(name for name in names if name not in taken)


@takes_robot
def with_uniform_links(description: Description, masses: Sequence[Quantity] | None = None) -> Description:
    """Return the arm with each link a thin uniform rod, its mass a parameter ``m1`` ... ``mn``.

    In the standard convention link i lies from frame i-1's origin to frame i's, in the modified one from frame i's to
    frame i+1's; the last ends at the tool. A prismatic joint stands at zero.

    Parameters
    ----------
    masses
        One a link, kg; 1 kg each if not given.

    Raises
    ------
    DescriptionError
        Another number of masses, or ``m1`` ... is a parameter with a meaning of its own.
    """
    n = description.n
    if masses is not None and len(masses) != n:
        raise DescriptionError(f"{len(masses)} masses; expected {n}, one a link")
    symbols = [f"m{i}" for i in range(1, n + 1)]
    bare = replace(description, joints=tuple(replace(joint, bodies=()) for joint in description.joints))
    if taken := names_in(bare) & set(symbols):
        raise DescriptionError(f"{description.name} uses {', '.join(sorted(taken))} for something else than a mass")
    values = [exact(1)] * n if masses is None else [quantity(f"masses[{i}]", m, {}) for i, m in enumerate(masses)]
    ends = _link_ends(description)
    joints = tuple(
        replace(
            joint,
            bodies=(rod(Expression.symbol(symbol), *end),),
            assumed=tuple(dict.fromkeys((*joint.assumed, "body"))),
        )
        for joint, symbol, end in zip(description.joints, symbols, ends, strict=True)
    )
    parameters = Named(dict(description.parameters) | dict(zip(symbols, values, strict=True)))
    return replace(description, joints=joints, parameters=parameters)


def _link_ends(description: Description) -> list[tuple[Vector, Vector]]:
    """Return where each link's rod begins and ends, in its own frame."""
    rows = [fixed_row(joint, description.convention) for joint in description.joints]
    tool = _origin(pose_of(description.tool.placement))
    if description.convention is Convention.MODIFIED:
        return [(ORIGIN, _origin(row)) for row in rows[1:]] + [(ORIGIN, tool)]
    ends = [(_origin(inverse(row)), ORIGIN) for row in rows]
    return [*ends[:-1], (ends[-1][0], tool)]


def _origin(T: ExactPose) -> Vector:
    x, y, z = T[:3, 3]
    return x, y, z


def _placement(T: ArrayLike, name: str) -> Placement:
    matrix = number_array(T, name, "(4, 4)")
    if matrix.shape != (4, 4) or not np.all(np.isfinite(matrix)):
        raise ValueError(f"{name}: found shape {matrix.shape}; expected a finite (4, 4) pose")
    xyz, (yaw, pitch, roll) = pose_parts(check_pose(matrix, name), order="ZYX")
    x, y, z = (exact(float(entry)) for entry in xyz)
    angles = (exact_angle(exact(_rounded(angle))) for angle in (roll, pitch, yaw))
    r, p, w = angles
    return Placement((x, y, z), (r, p, w))


def _rounded(angle: float) -> float:
    """Return an angle, with one within rounding of a multiple of 15 degrees put onto it."""
    step = round(float(angle) * 12 / math.pi) * math.pi / 12
    return step if math.isclose(angle, step, rel_tol=4e-16, abs_tol=4e-16) else float(angle)


def _tensor(inertia: ArrayLike | None) -> Inertia:
    if inertia is None:
        return Inertia()
    I = number_array(inertia, "payload: inertia", "(3, 3)")  # noqa: E741 - the field's letter
    if I.shape != (3, 3) or np.abs(I - I.T).max() > SYMMETRIC * np.abs(I).max():
        raise DescriptionError(f"payload: inertia has shape {I.shape}; expected a symmetric (3, 3) matrix")
    if not np.all(np.isfinite(I)):
        raise DescriptionError("payload: inertia is not finite")
    return Inertia(**{key: exact(float(I[place])) for key, place in INERTIA_PLACES.items()})
