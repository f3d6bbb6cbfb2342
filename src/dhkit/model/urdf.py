"""Descriptions as URDF text: the reference path's first step.

Link i of the URDF has its frame right behind joint i, where the joint variable ends; what is left of row i, its own
theta included, lies behind it. So every origin is a shift with rpy (alpha, 0, theta), and no angle is ever taken back
out of a rotation matrix. Each DH frame is a link of its own, ``dh0`` ... ``dhn``, and so is ``tool``.

A URDF has no place for gravity and for the rotors' reflected inertia: a comment says what they are, and
:func:`dhkit.model.pinocchio_model` sets them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import NamedTuple
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
from dhkit.errors import ModelError
from dhkit.model.shapes import Part, link_parts

MESHES = "meshes"
"""Folder beside a URDF that its meshes are copied into."""
UNLIMITED = 1e6
"""Effort and velocity of a joint that the description leaves unlimited; a URDF must give numbers."""

DRAWN = 12
"""Decimals of where a part is drawn, m and rad: what is below is rounding."""


class Origin(NamedTuple):
    """A URDF origin: R = Rz(yaw) Ry(pitch) Rx(roll)."""

    xyz: Array
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)


@takes_robot
def urdf_text(
    description: Description,
    mesh_path: Callable[[str], str] | None = None,
    collision_path: Callable[[str], str] | None = None,
) -> str:
    """Return a description as URDF text, SI and radians, numbers as the shortest decimals that read back equal.

    Parameters
    ----------
    description
        The robot. Links without a body have no inertial element.
    mesh_path
        From a mesh's path in the robot file to its path in the URDF; ``meshes/...`` if not given.
    collision_path
        The same for collisions, where another mesh of the same scale stands for it; ``mesh_path`` if not given.
    """
    name_mesh = mesh_path or (lambda path: f"{MESHES}/{path}")
    names = {"visual": name_mesh, "collision": collision_path or name_mesh}
    return _urdf(description, link_parts(description), names)


def mechanics_urdf_text(description: Description) -> str:
    """Return a description as URDF text without visual and collision elements: what a Pinocchio model needs."""
    return _urdf(description, (), {})


def _urdf(description: Description, drawn: Iterable[Part], names: Mapping[str, Callable[[str], str]]) -> str:
    robot = ElementTree.Element("robot", name=description.name)
    robot.append(ElementTree.Comment(_what_a_urdf_cannot_say(description)))
    parts: dict[int, list[Part]] = {}
    for part in drawn:
        parts.setdefault(part.link, []).append(part)

    ElementTree.SubElement(robot, "link", name="world")
    _fixed(robot, "world", "dh0", _origin_of(description.numbers.T_world_base))
    base = ElementTree.SubElement(robot, "link", name="dh0")
    if description.base.body is not None:
        _add_base_inertial(base, description)
    for part in parts.get(0, []):
        _add_part(base, part, np.eye(4), names)
    for i in range(1, description.n + 1):
        _add_joint(robot, description, i)
        link = ElementTree.SubElement(robot, "link", name=f"link{i}")
        _add_inertial(link, description, i)
        for part in parts.get(i, []):
            _add_part(link, part, _behind_matrix(description, i), names)
        _fixed(robot, f"link{i}", f"dh{i}", _behind(description, i))
        ElementTree.SubElement(robot, "link", name=f"dh{i}")
    _fixed(robot, f"dh{description.n}", "tool", _origin_of(description.numbers.T_last_tool))
    ElementTree.SubElement(robot, "link", name="tool")
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


@takes_robot
def write_urdf(description: Description, path: str | Path, mesh_prefix: str | None = None) -> tuple[Path, ...]:
    """Write a URDF, with the meshes that it names in ``meshes/`` beside it; return the files, the URDF first.

    Parameters
    ----------
    path
        The file; its folder is created.
    mesh_prefix
        What the URDF names its meshes by, in place of ``meshes/``: ``package://my_robot/meshes/`` for ROS.

    Raises
    ------
    ModelError
        A file cannot be written or read.
    """
    path = Path(path)
    written = [path]
    try:
        for part in link_parts(description):
            if isinstance(part.geometry, Mesh) and part.file is not None:
                copy = path.parent / MESHES / PurePosixPath(part.geometry.path)
                copy.parent.mkdir(parents=True, exist_ok=True)
                if copy not in written:
                    write_atomically(copy, part.file.read_bytes())
                    written.append(copy)
        prefix = f"{MESHES}/" if mesh_prefix is None else mesh_prefix
        write_atomically(path, urdf_text(description, lambda mesh: f"{prefix}{mesh}"))
    except OSError as error:
        raise ModelError(f"{error.filename or path}: {error.strerror}") from None
    return tuple(written)


def _what_a_urdf_cannot_say(description: Description) -> str:
    numbers = description.numbers
    armature = " ".join(map(_text, numbers.armature))
    gravity = " ".join(map(_text, numbers.gravity))
    lines = [
        f"Made by dhkit from the {description.convention.value} DH table of {description.name}.",
        "A URDF cannot carry: gravity "
        f"({gravity}) m/s^2 in the world frame; reflected rotor inertia, joint 1 to {description.n}: {armature}.",
    ]
    if description.source:
        lines.append(f"Source: {description.source}")
    # Two hyphens would end an XML comment, whatever stands around them.
    return " " + re.sub("-(?=-)", "- ", " ".join(lines)) + " "


def _behind(description: Description, i: int) -> Origin:
    """Return where DH frame i lies in link i (i from 1)."""
    k, n = i - 1, description.numbers
    if description.convention is Convention.MODIFIED:
        return Origin(np.zeros(3), (0.0, 0.0, n.theta[k]))
    along_x = np.array([n.a[k] * n.cos_theta[k], n.a[k] * n.sin_theta[k], n.d[k]])
    return Origin(along_x, (n.alpha[k], 0.0, n.theta[k]))


def _behind_matrix(description: Description, i: int) -> Array:
    """Return :func:`_behind` as a (4, 4) matrix, from the exact cosines."""
    k, n = i - 1, description.numbers
    ct, st, ca, sa = n.cos_theta[k], n.sin_theta[k], n.cos_alpha[k], n.sin_alpha[k]
    if description.convention is Convention.MODIFIED:
        ca, sa = 1.0, 0.0
    T = np.eye(4)
    T[:3, :3] = [[ct, -st * ca, st * sa], [st, ct * ca, -ct * sa], [0.0, sa, ca]]
    T[:3, 3] = _behind(description, i).xyz
    return T


def _joint_origin(description: Description, i: int) -> Origin:
    """Return where joint i lies in the link before it (dh0 for the first)."""
    k, n = i - 1, description.numbers
    if description.convention is Convention.STANDARD:
        return _behind(description, i - 1) if k else Origin(np.zeros(3))
    cos_before, sin_before, theta_before = (n.cos_theta[k - 1], n.sin_theta[k - 1], n.theta[k - 1]) if k else (1, 0, 0)
    x, y, z = n.a[k], -n.d[k] * n.sin_alpha[k], n.d[k] * n.cos_alpha[k]
    turned = np.array([cos_before * x - sin_before * y, sin_before * x + cos_before * y, z])
    return Origin(turned, (n.alpha[k], 0.0, theta_before))


def _add_joint(robot: ElementTree.Element, description: Description, i: int) -> None:
    k, numbers, joint = i - 1, description.numbers, description.joints[i - 1]
    element = ElementTree.SubElement(robot, "joint", name=joint.name, type=joint.type.value)
    _add_origin(element, _joint_origin(description, i))
    ElementTree.SubElement(element, "parent", link=f"link{i - 1}" if k else "dh0")
    ElementTree.SubElement(element, "child", link=f"link{i}")
    ElementTree.SubElement(element, "axis", xyz="0 0 1")
    free = 2 * math.pi if joint.is_revolute else max(1.0, description.reach)
    lower, upper = numbers.lower[k], numbers.upper[k]
    ElementTree.SubElement(
        element,
        "limit",
        lower=_text(lower if np.isfinite(lower) else -free),
        upper=_text(upper if np.isfinite(upper) else free),
        effort=_text(min(numbers.effort[k], UNLIMITED)),
        velocity=_text(min(numbers.velocity[k], UNLIMITED)),
    )
    if numbers.viscous[k] or numbers.coulomb[k].any():
        friction = float(np.abs(numbers.coulomb[k]).mean())
        ElementTree.SubElement(element, "dynamics", damping=_text(numbers.viscous[k]), friction=_text(friction))


def _fixed(robot: ElementTree.Element, parent: str, child: str, origin: Origin) -> None:
    joint = ElementTree.SubElement(robot, "joint", name=f"{child}_fixed", type="fixed")
    _add_origin(joint, origin)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)


def _add_inertial(link: ElementTree.Element, description: Description, i: int) -> None:
    k, numbers = i - 1, description.numbers
    if np.isnan(numbers.mass[k]):
        return
    behind = _behind(description, i)
    element = ElementTree.SubElement(link, "inertial")
    T_link_frame = _behind_matrix(description, i)
    com = T_link_frame[:3, :3] @ numbers.com[k] + behind.xyz
    _add_origin(element, Origin(com, behind.rpy))
    _add_mass(element, numbers.mass[k], numbers.inertia[k])


def _add_base_inertial(link: ElementTree.Element, description: Description) -> None:
    mass, com, tensor = description.numbers.base_body
    element = ElementTree.SubElement(link, "inertial")
    _add_origin(element, Origin(com))
    _add_mass(element, mass, tensor)


def _add_mass(element: ElementTree.Element, mass: float, tensor: Array) -> None:
    ElementTree.SubElement(element, "mass", value=_text(mass))
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ElementTree.SubElement(element, "inertia", {name: _text(tensor[place]) for name, place in names.items()})


def _add_part(
    link: ElementTree.Element, part: Part, T_link_frame: Array, names: Mapping[str, Callable[[str], str]]
) -> None:
    """Add a drawn part as visual and as collision."""
    rgb = [int(part.color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    for T, tag, attributes in _solids(part):
        for purpose, name_mesh in names.items():
            named = {key: name_mesh(text) if key == "filename" else text for key, text in attributes.items()}
            element = ElementTree.SubElement(link, purpose)
            origin = _origin_of(T_link_frame @ part.T_link_part @ T)
            _add_origin(element, Origin(np.round(origin.xyz, DRAWN), tuple(np.round(origin.rpy, DRAWN))))
            ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), tag, named)
            if purpose == "visual":
                material = ElementTree.SubElement(element, "material", name=f"color_{part.color[1:].lower()}")
                ElementTree.SubElement(material, "color", rgba=" ".join(f"{c:.4g}" for c in (*rgb, 1.0)))


def _solids(part: Part) -> list[tuple[Array, str, dict[str, str]]]:
    """Return URDF geometries of a part, with where they lie in it; a capsule is a cylinder and two balls."""
    at = np.eye(4)
    match part.geometry:
        case Mesh(path, scale):
            return [(at, "mesh", {"filename": path, "scale": " ".join(_text(float(factor)) for factor in scale)})]
        case Box(size):
            return [(at, "box", {"size": " ".join(_text(float(edge)) for edge in size)})]
        case Sphere(radius):
            return [(at, "sphere", {"radius": _text(float(radius))})]
        case Cylinder(radius, length):
            return [(at, "cylinder", {"radius": _text(float(radius)), "length": _text(float(length))})]
        case Capsule(radius, length):
            ends = []
            for side in (-0.5, 0.5):
                end = np.eye(4)
                end[2, 3] = side * float(length)
                ends.append((end, "sphere", {"radius": _text(float(radius))}))
            return [(at, "cylinder", {"radius": _text(float(radius)), "length": _text(float(length))}), *ends]


def _origin_of(T: Array) -> Origin:
    xyz, (yaw, pitch, roll) = pose_parts(T, order="ZYX")
    return Origin(xyz, (float(roll), float(pitch), float(yaw)))


def _add_origin(element: ElementTree.Element, origin: Origin) -> None:
    ElementTree.SubElement(
        element, "origin", xyz=" ".join(map(_text, origin.xyz)), rpy=" ".join(_text(angle) for angle in origin.rpy)
    )


def _text(number: float) -> str:
    """Return the shortest decimal that reads back as this double (at most 17 digits)."""
    return repr(float(number) + 0.0).removesuffix(".0")
