"""Descriptions as URDF text: the first step of the reference path.

Link i of the URDF has its frame directly after joint i, where the joint variable ends. In the standard convention the
rest of row i, its own theta included, comes after the joint; in the modified one a, alpha and d come before it, and
theta after. So every origin of a row is a translation with rpy (alpha, 0, theta), computed from no rotation matrix;
those of base, tool and shapes are. Each DH frame is a link of its own, ``dh0`` ... ``dhn``, and so is ``tool``.

A URDF cannot hold gravity or the rotors' reflected inertia: a comment states them, and
:func:`dhkit.model.pinocchio_model` sets them.

The origins of rows are derived here independently of :func:`dhkit.description.link_transforms` and of
:func:`dhkit.description.exact_poses.fixed_row`, so that Pinocchio's model checks those.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import NamedTuple, SupportsFloat
from xml.etree import ElementTree

import numpy as np

from dhkit.description import (
    Array,
    Box,
    Capsule,
    Convention,
    Cylinder,
    Description,
    Mesh,
    Sphere,
    pose_parts,
    takes_robot,
    write_atomically,
)
from dhkit.description.bodies import INERTIA_PLACES
from dhkit.model.robot_folder import MESHES, copy_files, model_errors
from dhkit.model.shapes import Part, link_parts

UNLIMITED = 1e6
"""Effort and velocity of a joint that the description leaves unlimited; a URDF must give numbers."""
_SHAPE_DECIMALS = 12
"""Decimals of the poses of shapes, m and rad: further decimals are rounding errors."""

_Element = ElementTree.Element
PathMap = Callable[[str], str]
"""Function from a mesh's path in the robot file to its path in the URDF."""


class Origin(NamedTuple):
    """A URDF origin, m and rad: R = Rz(yaw) Ry(pitch) Rx(roll)."""

    xyz: Array
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)


@takes_robot
def urdf_text(
    description: Description,
    mesh_path: PathMap | None = None,
    collision_path: PathMap | None = None,
) -> str:
    """Return a description as URDF text, SI and radians, numbers as the shortest decimals that read back equal.

    Parameters
    ----------
    description
        The robot. Links without a body have no inertial element.
    mesh_path
        From a mesh's path in the robot file to its path in the URDF; ``meshes/...`` if not given.
    collision_path
        The same for collisions, which may use another mesh of the same scale; ``mesh_path`` if not given.

    Returns
    -------
    str
        The text; every DH frame is a link ``dh0`` ... ``dhn``, the tool is ``tool``.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> urdf_text(library_robot("planar2r")).splitlines()[1]
    '<robot name="planar2r">'
    """
    visual_path = mesh_path or (lambda path: f"{MESHES}/{path}")
    paths = {"visual": visual_path, "collision": collision_path or visual_path}
    return _urdf(description, link_parts(description), paths)


def mechanics_urdf_text(description: Description) -> str:
    """Return a description as URDF text without visual and collision elements, for a Pinocchio model."""
    return _urdf(description, (), {})


def _urdf(description: Description, drawn: Iterable[Part], paths: Mapping[str, PathMap]) -> str:
    robot = ElementTree.Element("robot", name=description.name)
    numbers = description.numbers
    n = description.n
    robot.append(ElementTree.Comment(_comment(description)))
    parts: dict[int, list[Part]] = {}
    for part in drawn:
        parts.setdefault(part.link, []).append(part)

    _child(robot, "link", name="world")
    _add_fixed_joint(robot, "world", "dh0", _origin_of(numbers.T_world_base))
    base = _child(robot, "link", name="dh0")
    if description.base.body is not None:
        mass, com, tensor = numbers.base_body
        _add_inertial(base, Origin(com), mass, tensor)
    for part in parts.get(0, []):
        _add_part(base, part, np.eye(4), paths)
    for i in range(1, n + 1):
        _add_joint(robot, description, i)
        link = _child(robot, "link", name=f"link{i}")
        frame_origin = _frame_origin(description, i)
        T_link_frame = _frame_matrix(description, i)
        if not np.isnan(mass := numbers.mass[i - 1]):
            com = T_link_frame[:3, :3] @ numbers.com[i - 1] + frame_origin.xyz
            _add_inertial(link, Origin(com, frame_origin.rpy), mass, numbers.inertia[i - 1])
        for part in parts.get(i, []):
            _add_part(link, part, T_link_frame, paths)
        _add_fixed_joint(robot, f"link{i}", f"dh{i}", frame_origin)
        _child(robot, "link", name=f"dh{i}")
    _add_fixed_joint(robot, f"dh{n}", "tool", _origin_of(numbers.T_last_tool))
    _child(robot, "link", name="tool")
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


@takes_robot
def write_urdf(
    description: Description, path: str | Path, mesh_prefix: str | None = None
) -> tuple[Path, ...]:
    """Write a URDF, with the meshes that it names in ``meshes/`` beside it; return the files, the URDF first.

    Parameters
    ----------
    description
        The robot.
    path
        The file; its folder is created.
    mesh_prefix
        Beginning of the meshes' names in the URDF, instead of ``meshes/``: ``package://my_robot/meshes/`` for ROS.

    Returns
    -------
    tuple[Path, ...]
        The files written, the URDF first.

    Raises
    ------
    ModelError
        A file cannot be written or read.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> [path.name for path in write_urdf(library_robot("planar2r"), "mine/planar2r.urdf")]
    ['planar2r.urdf']
    """
    path = Path(path)
    prefix = f"{MESHES}/" if mesh_prefix is None else mesh_prefix
    with model_errors(path):
        sources = {
            str(MESHES / PurePosixPath(part.geometry.path)): part.file
            for part in link_parts(description)
            if isinstance(part.geometry, Mesh) and part.file is not None
        }
        copies = copy_files(sources, path.parent)
        write_atomically(path, urdf_text(description, lambda mesh: f"{prefix}{mesh}"))
    return (path, *copies)


def _comment(description: Description) -> str:
    """Return the values that a URDF cannot hold, as text for an XML comment."""
    lines = [
        f"Made by dhkit from the {description.convention.value} DH table of {description.name}.",
        f"A URDF cannot carry: gravity ({_texts(description.numbers.gravity)}) m/s^2 in the world frame; reflected "
        f"rotor inertia, joint 1 to {description.n}: {_texts(description.numbers.armature)}.",
    ]
    for coupling in description.couplings:
        i, j = coupling.joints
        inertia = description.numbers.coupling[i - 1, j - 1]
        lines.append(
            f"Nor the inertia of a drive that joints {i} and {j} both turn: {inertia:.9g}."
        )
    if description.source:
        lines.append(f"Source: {description.source}")
    # Two hyphens would end an XML comment.
    return " " + re.sub("-(?=-)", "- ", " ".join(lines)) + " "


def _frame_origin(description: Description, i: int) -> Origin:
    """Return the origin of DH frame i in link i (i from 1)."""
    k = i - 1
    n = description.numbers
    if description.convention is Convention.MODIFIED:
        return Origin(np.zeros(3), (0.0, 0.0, n.theta[k]))

    # Rz(theta) Tz(d) Tx(a) Rx(alpha) is at (a cos(theta), a sin(theta), d) and has the rotation Rz(theta) Rx(alpha).
    along_x = np.array([n.a[k] * n.cos_theta[k], n.a[k] * n.sin_theta[k], n.d[k]])
    return Origin(along_x, (n.alpha[k], 0.0, n.theta[k]))


def _frame_matrix(description: Description, i: int) -> Array:
    """Return :func:`_frame_origin` as a (4, 4) matrix, from the exact cosines."""
    k = i - 1
    n = description.numbers
    ct = n.cos_theta[k]
    st = n.sin_theta[k]
    ca = n.cos_alpha[k]
    sa = n.sin_alpha[k]
    if description.convention is Convention.MODIFIED:
        ca = 1.0
        sa = 0.0

    # Rz(theta) Rx(alpha), alpha = 0 in the modified convention.
    T = np.eye(4)
    T[:3, :3] = [[ct, -st * ca, st * sa], [st, ct * ca, -ct * sa], [0.0, sa, ca]]
    T[:3, 3] = _frame_origin(description, i).xyz
    return T


def _joint_origin(description: Description, i: int) -> Origin:
    """Return the origin of joint i in the link before it (dh0 for the first)."""
    k = i - 1
    n = description.numbers
    if description.convention is Convention.STANDARD:
        return _frame_origin(description, i - 1) if k else Origin(np.zeros(3))

    # Frame i - 1 is rotated by the theta of its own row against the link, so that the origin is
    #     Rz(theta_(i-1)) Tx(a) Rx(alpha) Tz(d), with a, alpha and d of row i,
    # which is at Rz(theta_(i-1)) (a, -d sin(alpha), d cos(alpha)) and has the rotation Rz(theta_(i-1)) Rx(alpha).
    ct, st, theta = (n.cos_theta[k - 1], n.sin_theta[k - 1], n.theta[k - 1]) if k else (1, 0, 0)
    x = n.a[k]
    y = -n.d[k] * n.sin_alpha[k]
    z = n.d[k] * n.cos_alpha[k]
    return Origin(np.array([ct * x - st * y, st * x + ct * y, z]), (n.alpha[k], 0.0, theta))


def _add_joint(robot: _Element, description: Description, i: int) -> None:
    k = i - 1
    numbers = description.numbers
    joint = description.joints[i - 1]
    element = _child(robot, "joint", name=joint.name, type=joint.type.value)
    _add_origin(element, _joint_origin(description, i))
    _child(element, "parent", link=f"link{i - 1}" if k else "dh0")
    _child(element, "child", link=f"link{i}")
    _child(element, "axis", xyz="0 0 1")
    free = math.tau if joint.is_revolute else max(1.0, description.reach)
    lower = numbers.lower[k]
    upper = numbers.upper[k]
    _child(
        element,
        "limit",
        lower=_texts([lower if np.isfinite(lower) else -free]),
        upper=_texts([upper if np.isfinite(upper) else free]),
        effort=_texts([min(numbers.effort[k], UNLIMITED)]),
        velocity=_texts([min(numbers.velocity[k], UNLIMITED)]),
    )
    if numbers.viscous[k] or numbers.coulomb[k].any():
        friction = float(np.abs(numbers.coulomb[k]).mean())
        _child(
            element, "dynamics", damping=_texts([numbers.viscous[k]]), friction=_texts([friction])
        )


def _add_fixed_joint(robot: _Element, parent: str, child: str, origin: Origin) -> None:
    joint = _child(robot, "joint", name=f"{child}_fixed", type="fixed")
    _add_origin(joint, origin)
    _child(joint, "parent", link=parent)
    _child(joint, "child", link=child)


def _add_inertial(link: _Element, origin: Origin, mass: float, tensor: Array) -> None:
    inertial = _child(link, "inertial")
    _add_origin(inertial, origin)
    _child(inertial, "mass", value=_texts([mass]))
    moments = {f"i{key}": _texts([tensor[place]]) for key, place in sorted(INERTIA_PLACES.items())}
    _child(inertial, "inertia", **moments)


def _add_part(
    link: _Element, part: Part, T_link_frame: Array, paths: Mapping[str, PathMap]
) -> None:
    """Add a drawn part as visual and as collision."""
    rgb = [int(part.color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    for z, tag, attributes in _solids(part):
        T_part_solid = np.eye(4)
        T_part_solid[2, 3] = z
        origin = _origin_of(T_link_frame @ part.T_link_part @ T_part_solid)
        for purpose, path in paths.items():
            named = {
                key: path(text) if key == "filename" else text for key, text in attributes.items()
            }
            element = _child(link, purpose)
            _add_origin(
                element,
                Origin(
                    np.round(origin.xyz, _SHAPE_DECIMALS),
                    tuple(np.round(origin.rpy, _SHAPE_DECIMALS)),
                ),
            )
            _child(_child(element, "geometry"), tag, **named)
            if purpose == "visual":
                material = _child(element, "material", name=f"color_{part.color[1:].lower()}")
                _child(material, "color", rgba=" ".join(f"{c:.4g}" for c in (*rgb, 1.0)))


def _solids(part: Part) -> list[tuple[float, str, dict[str, str]]]:
    """Return URDF geometries of a part with their heights on its z axis, m; a capsule is a cylinder and two balls."""
    match part.geometry:
        case Mesh(path, scale):
            return [(0.0, "mesh", {"filename": path, "scale": _texts(scale)})]
        case Box(size):
            return [(0.0, "box", {"size": _texts(size)})]
        case Sphere(radius):
            return [(0.0, "sphere", {"radius": _texts([radius])})]
        case Cylinder(radius, length) | Capsule(radius, length):
            cylinder = (0.0, "cylinder", {"radius": _texts([radius]), "length": _texts([length])})
            if isinstance(part.geometry, Cylinder):
                return [cylinder]
            ends = (side * float(length) for side in (-0.5, 0.5))
            return [cylinder, *((end, "sphere", {"radius": _texts([radius])}) for end in ends)]


def _origin_of(T: Array) -> Origin:
    xyz, (yaw, pitch, roll) = pose_parts(T, order="ZYX")
    return Origin(xyz, (float(roll), float(pitch), float(yaw)))


def _add_origin(element: _Element, origin: Origin) -> None:
    _child(element, "origin", xyz=_texts(origin.xyz), rpy=_texts(origin.rpy))


def _child(parent: _Element, tag: str, **attributes: str) -> _Element:
    return ElementTree.SubElement(parent, tag, attributes)


def _texts(numbers: Iterable[SupportsFloat]) -> str:
    """Return the shortest decimals, of at most 17 digits, that read back as the same doubles."""
    return " ".join(repr(float(number) + 0.0).removesuffix(".0") for number in numbers)
