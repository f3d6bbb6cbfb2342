"""New descriptions from old ones: another tool, base, payload, limits, parameter values, or uniform links."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description.arrays import Array, number_array
from dhkit.description.bodies import (
    ORIGIN,
    PAYLOAD,
    Body,
    ExactPose,
    Inertia,
    Vector,
    moved_body,
    rod,
)
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

_ROD_DECIMALS = 9
"""Decimals of the ends of rods between points on the axes, m."""

_ASYMMETRY_TOLERANCE = 1e-12
"""Largest difference of two symmetric entries of an inertia, relative to its largest entry: rounding of R I R^T."""


@takes_robot
def with_tool(description: Description, T: ArrayLike) -> Description:
    """Return the arm with its tool's frame at T in DH frame n, shape (4, 4), m, instead of its own.

    Parameters
    ----------
    description
        The arm.
    T
        Pose of the tool in DH frame n, shape (4, 4), m.

    Returns
    -------
    Description
        The arm with this tool; bodies stay as they are.

    Raises
    ------
    ValueError
        T is not one pose, shape (4, 4).

    Examples
    --------
    >>> from dhkit.description import library_robot, pose, world_to_tool
    >>> arm = with_tool(library_robot("planar2r"), pose((0.1, 0, 0)))
    >>> world_to_tool(arm, [0, 0])[:3, 3].round(3)
    array([1., 0., 0.])
    """
    return replace(description, tool=Tool(placement_of_pose(T, "tool"), description.tool.shapes))


@takes_robot
def with_base(description: Description, T: ArrayLike) -> Description:
    """Return the arm with frame 0 at T in the world, shape (4, 4), m, instead of its own base.

    Parameters
    ----------
    description
        The arm.
    T
        Pose of frame 0 in the world, shape (4, 4), m.

    Returns
    -------
    Description
        The same arm elsewhere; gravity stays as it is in the world.

    Raises
    ------
    ValueError
        T is not one pose, shape (4, 4).
    DescriptionError
        Values that make no robot.

    Examples
    --------
    >>> from dhkit.description import library_robot, pose, world_to_tool
    >>> arm = with_base(library_robot("planar2r"), pose((0, 0, 1)))
    >>> world_to_tool(arm, [0, 0])[:3, 3]
    array([0.9, 0. , 1. ])
    """
    base = description.base
    return replace(description, base=Base(placement_of_pose(T, "base"), base.shapes, base.body))


@takes_robot
def with_parameters(description: Description, /, **values: Quantity) -> Description:
    """Return the arm with other values of its parameters, SI and radians.

    Parameters
    ----------
    description
        The arm.
    **values
        Values by name; text may name other parameters.

    Returns
    -------
    Description
        The arm with these values; what depends on them changes with them.

    Raises
    ------
    DescriptionError
        It has no such parameter, or the values make no robot.

    Examples
    --------
    >>> from dhkit.description.library import library_robot
    >>> float(with_parameters(library_robot("planar2r"), l1=0.6).numbers.a[0])
    0.6
    """
    known = description.parameters
    for name in values:
        if name not in known:
            raise DescriptionError(
                f"{description.name} has no parameter {name!r}; it has {', '.join(known) or 'none'}"
            )
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
    description
        The arm.
    lower, upper
        Lowest and highest joint values, rad and m, one number for all joints or shape (n,). Infinite on both sides:
        the joint is unlimited.
    velocity, torque
        Largest speeds, rad/s and m/s, and torques or forces, N m and N, likewise; inf: unlimited.

    Returns
    -------
    Description
        The arm with the new limits.

    Raises
    ------
    DescriptionError
        A lower limit above the upper one, one side infinite, NaN, or a speed or torque that is not positive.
    ValueError
        Another shape.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = with_limits(library_robot("planar2r"), velocity=2.0, torque=[30, 10])
    >>> arm.numbers.velocity, arm.numbers.effort
    (array([2., 2.]), array([30., 10.]))
    """
    numbers = description.numbers
    n = description.n
    own = {
        "lower": numbers.lower,
        "upper": numbers.upper,
        "velocity": numbers.velocity,
        "torque": numbers.effort,
    }
    new = {"lower": lower, "upper": upper, "velocity": velocity, "torque": torque}
    arrays = {
        name: own[name] if value is None else one_each(value, name, n)
        for name, value in new.items()
    }
    joints = []
    for i, joint in enumerate(description.joints):
        low, high, speed, effort = (float(array[i]) for array in arrays.values())
        if np.isnan([low, high, speed, effort]).any() or np.isinf(low) != np.isinf(high):
            raise DescriptionError(
                f"joint {i + 1} ({joint.name}): limits [{low:g}, {high:g}]; expected two numbers, or both inf"
            )
        if lower is not None or upper is not None:
            joint = replace(joint, limits=None if np.isinf(low) else (exact(low), exact(high)))
        if velocity is not None:
            joint = replace(joint, velocity=None if np.isinf(speed) else exact(speed))
        if torque is not None:
            joint = replace(joint, effort=None if np.isinf(effort) else exact(effort))
        joints.append(joint)
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
    description
        The arm.
    mass
        kg; text may use the description's parameters.
    com
        Centre of mass in the tool's frame, m.
    inertia
        Tensor about the load's centre of mass in the tool's axes, shape (3, 3), kg m^2; a point mass if not given.

    Returns
    -------
    Description
        The arm with the load.

    Raises
    ------
    DescriptionError
        The last link has no body to join it to, or the load is an impossible body.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = with_payload(library_robot("planar2r"), 1.5, com=(0.05, 0, 0))
    >>> [body.name for body in arm.joints[-1].bodies]
    ['body 1', 'payload']
    """
    last = description.joints[-1]
    if not last.bodies:
        raise DescriptionError(
            f"joint {description.n} ({last.name}) has no body to join a payload to; see with_uniform_links"
        )
    parameters = description.parameters
    if len(com) != 3:
        raise DescriptionError(f"payload: com has {len(com)} numbers; expected 3")
    x, y, z = (quantity(f"payload: com[{i}]", entry, parameters) for i, entry in enumerate(com))
    weight = quantity("payload: mass", mass, parameters)
    taken = {body.name for body in last.bodies}
    numbered_names = (f"{PAYLOAD} {k}" for k in itertools.count(2))
    name = next(name for name in itertools.chain([PAYLOAD], numbered_names) if name not in taken)
    tensor = Inertia() if inertia is None else Inertia.of_tensor(_inertia_tensor(inertia))
    load = Body(weight, (x, y, z), tensor, name=name)
    check_body(load, "payload", resolved(parameters))
    bodies = (*last.bodies, moved_body(load, pose_of(description.tool.placement)))
    return replace(description, joints=(*description.joints[:-1], replace(last, bodies=bodies)))


@takes_robot
def with_uniform_links(
    description: Description, masses: Sequence[Quantity] | None = None
) -> Description:
    """Return the arm with each link a thin uniform rod, its mass a parameter ``m1`` ... ``mn``.

    In the standard convention link i lies from frame i-1's origin to frame i's, in the modified one from frame i's to
    frame i+1's; the last ends at the tool. A prismatic joint is at zero. Where nearly parallel axes take the origins
    far away, links lie between points on the axes, see :mod:`dhkit.description.joint_centres`.

    Parameters
    ----------
    description
        The arm.
    masses
        One a link, kg; 1 kg each if not given.

    Returns
    -------
    Description
        The arm with one body a link; earlier bodies are replaced.

    Raises
    ------
    DescriptionError
        Another number of masses, or ``m1`` ... is a parameter with a meaning of its own.

    Examples
    --------
    >>> from dhkit.description import from_dh
    >>> arm = with_uniform_links(from_dh([(0, 0, 0.5, 0), (0, 0, 0.4, 0)]), masses=[2.0, 1.0])
    >>> arm.numbers.com.tolist()
    [[-0.25, 0.0, 0.0], [-0.2, 0.0, 0.0]]
    """
    n = description.n
    if masses is not None and len(masses) != n:
        raise DescriptionError(f"{len(masses)} masses; expected {n}, one a link")
    symbols = [f"m{i}" for i in range(1, n + 1)]
    bare = replace(
        description, joints=tuple(replace(joint, bodies=()) for joint in description.joints)
    )
    if taken := names_in(bare) & set(symbols):
        raise DescriptionError(
            f"{description.name} uses {', '.join(sorted(taken))} for something else than a mass"
        )
    values = (
        [exact(1)] * n
        if masses is None
        else [quantity(f"masses[{i}]", m, {}) for i, m in enumerate(masses)]
    )
    joints = tuple(
        replace(
            joint,
            bodies=(rod(Expression.symbol(symbol), *ends),),
            assumed=tuple(dict.fromkeys((*joint.assumed, "body"))),
        )
        for joint, symbol, ends in zip(
            description.joints, symbols, _link_ends(description), strict=True
        )
    )
    parameters = Named(dict(description.parameters) | dict(zip(symbols, values, strict=True)))
    return replace(description, joints=joints, parameters=parameters)


def _link_ends(description: Description) -> list[tuple[Vector, Vector]]:
    """Return where each link's rod begins and ends, in the link's own frame, m."""
    if (far := description.numbers.link_ends) is not None:
        return [
            (_exact_vector(begin), _exact_vector(end)) for begin, end in zip(*far, strict=True)
        ][1:]

    # Frame i of the modified convention is at the beginning of link i, and frame i + 1, at A_(i+1) (0, 0, 0) in it, at
    # its end. Frame i of the standard convention is at the end, and frame i - 1, at A_i^-1 (0, 0, 0) in it, at the
    # beginning.
    rows = [fixed_row(joint, description.convention) for joint in description.joints]
    tool = _origin(pose_of(description.tool.placement))
    if description.convention is Convention.MODIFIED:
        return [(ORIGIN, _origin(row)) for row in rows[1:]] + [(ORIGIN, tool)]
    starts = [_origin(inverse(row)) for row in rows]
    return [*((start, ORIGIN) for start in starts[:-1]), (starts[-1], tool)]


def _exact_vector(point: Array) -> Vector:
    x, y, z = (exact(round(float(entry), _ROD_DECIMALS) + 0.0) for entry in point)
    return x, y, z


def _origin(T: ExactPose) -> Vector:
    x, y, z = T[:3, 3]
    return x, y, z


def placement_of_pose(T: ArrayLike, name: str) -> Placement:
    """Return a pose, shape (4, 4), m, as a placement of exact numbers; ``name`` is the argument's, for messages.

    Raises
    ------
    ValueError
        Another shape, or no pose.
    """
    matrix = number_array(T, name, "(4, 4)")
    if matrix.shape != (4, 4) or not np.all(np.isfinite(matrix)):
        raise ValueError(f"{name}: found shape {matrix.shape}; expected a finite (4, 4) pose")
    xyz, (yaw, pitch, roll) = pose_parts(check_pose(matrix, name), order="ZYX")
    x, y, z = (exact(float(entry)) for entry in xyz)
    r, p, w = (exact_angle(exact(_without_rounding(angle))) for angle in (roll, pitch, yaw))
    return Placement((x, y, z), (r, p, w))


def _without_rounding(angle: float) -> float:
    """Return an angle, rad; one within rounding of a multiple of 15 degrees becomes that multiple."""
    multiple = round(float(angle) * 12 / math.pi) * math.pi / 12
    return multiple if math.isclose(angle, multiple, rel_tol=4e-16, abs_tol=4e-16) else float(angle)


def _inertia_tensor(inertia: ArrayLike) -> Array:
    tensor = number_array(inertia, "payload: inertia", "(3, 3)")
    if tensor.shape != (3, 3) or is_asymmetric(tensor):
        raise DescriptionError(
            f"payload: inertia has shape {tensor.shape}; expected a symmetric (3, 3) matrix"
        )
    if not np.all(np.isfinite(tensor)):
        raise DescriptionError("payload: inertia is not finite")
    return tensor


def is_asymmetric(tensor: Array) -> bool:
    """Return whether symmetric entries of an inertia, shape (3, 3), kg m^2, differ by more than rounding."""
    return bool(np.abs(tensor - tensor.T).max() > _ASYMMETRY_TOLERANCE * np.abs(tensor).max())
