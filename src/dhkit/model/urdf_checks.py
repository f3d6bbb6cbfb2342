"""What makes a URDF safe and unmistakable to read: bounded text, one tree, numbers that mean what they say."""

from __future__ import annotations

import io
import math
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from dhkit.errors import ModelError

__all__ = ["MAX_BYTES", "check_joint", "check_link", "check_moving", "link_of", "parents_of", "parsed"]

MAX_BYTES = 5_000_000
MAX_DEPTH = 64
MAX_JOINTS = 500
"""Thousands of fixed joints in a row crash Pinocchio."""
MOVING = ("revolute", "continuous", "prismatic")


def parsed(path: Path) -> ElementTree.Element:
    """Return the root of a URDF, read as UTF-8 without entities, bounded in size and depth."""
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise ModelError(f"{path}: {'a folder' if stat.S_ISDIR(mode) else 'not a regular file'}; expected a URDF")
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror or error}") from None
    if len(content) > MAX_BYTES:
        raise ModelError(f"{path}: more than {MAX_BYTES // 1_000_000} MB; expected a URDF")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ModelError(f"{path}: not UTF-8 text; expected a URDF") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ModelError(f"{path}: has a document type or entities, which a URDF does not need and dhkit does not read")
    depth = 0
    try:
        for event, _ in ElementTree.iterparse(io.BytesIO(text.encode()), events=("start", "end")):  # noqa: S314
            depth += 1 if event == "start" else -1
            if depth > MAX_DEPTH:
                raise ModelError(f"{path}: elements nested more than {MAX_DEPTH} deep")
        robot = ElementTree.fromstring(text.encode())  # noqa: S314 - no entities, bounded
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ModelError(f"{path}: no XML: {error}") from None
    if robot.tag != "robot":
        raise ModelError(f"{path}: found <{robot.tag[:40]}>; expected <robot>")
    return robot


def parents_of(path: Path, robot: ElementTree.Element, joints: Mapping[str, ElementTree.Element]) -> dict[str, str]:
    """Return each link's joint to its parent, and refuse what is no tree."""
    links = [link.get("name") for link in robot.findall("link")]
    found = robot.findall("joint")
    if len(set(links)) != len(links) or None in links:
        raise ModelError(f"{path}: links without a name, or two of one name")
    if len(joints) != len(found):
        raise ModelError(f"{path}: joints without a name, or two of one name")
    if len(joints) > MAX_JOINTS:
        raise ModelError(f"{path}: {len(joints)} joints; expected {MAX_JOINTS} at most")
    parents: dict[str, str] = {}
    for name, joint in joints.items():
        child, parent = link_of(joint, "child"), link_of(joint, "parent")
        for link in (child, parent):
            if link not in links:
                raise ModelError(f"{path}: joint {name!r}: no link {link!r}")
        if child in parents:
            raise ModelError(f"{path}: link {child!r} has two parents, by joints {parents[child]!r} and {name!r}")
        parents[child] = name
    roots = [link for link in links if link not in parents]
    if len(roots) != 1:
        raise ModelError(f"{path}: {len(roots)} links without a parent; expected 1, the root of a tree")
    reached, count = set(roots), 0
    while len(reached) > count:
        count = len(reached)
        reached |= {child for child, name in parents.items() if link_of(joints[name], "parent") in reached}
    if beyond := [link for link in links if link not in reached]:
        raise ModelError(f"{path}: links {', '.join(map(str, beyond))[:200]} go round in a circle")
    return parents


def link_of(joint: ElementTree.Element, tag: str) -> str:
    """Return the name of a joint's parent or child."""
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def _numbers(path: Path, where: str, element: ElementTree.Element | None, key: str, count: int) -> list[float]:
    """Return an attribute's numbers, none where it is missing; refuse what Pinocchio would misread in silence."""
    text = None if element is None else element.get(key)
    if element is None or text is None:
        return []
    values = []
    for word in text.split():
        try:
            values.append(float(word))
        except ValueError:
            values.append(math.nan)
        if not math.isfinite(values[-1]):
            raise ModelError(f"{path}: {where}: <{element.tag} {key}>: found {word[:40]!r}; expected a finite number")
    if len(values) != count:
        raise ModelError(f"{path}: {where}: <{element.tag} {key}> has {len(values)} numbers; expected {count}")
    return values


def check_joint(path: Path, joint: ElementTree.Element) -> None:
    """Refuse an origin that is not six numbers."""
    where = f"joint {joint.get('name')!r}"
    for key in ("xyz", "rpy"):
        _numbers(path, where, joint.find("origin"), key, 3)


def check_moving(path: Path, joint: ElementTree.Element) -> None:
    """Refuse a joint of the chain that is no revolute or prismatic joint of its own."""
    where = f"joint {joint.get('name')!r}"
    if joint.get("type") not in MOVING:
        raise ModelError(f"{path}: {where} is {joint.get('type', '')[:40]!r}; expected {', '.join(MOVING)} or fixed")
    axis = _numbers(path, where, joint.find("axis"), "xyz", 3)
    if axis and not any(axis):
        raise ModelError(f"{path}: {where}: <axis xyz>: found 0 0 0; expected a direction")
    if joint.find("mimic") is not None:
        raise ModelError(f"{path}: {where} follows another (mimic); expected joints that move on their own")
    limit = joint.find("limit")
    for key in ("lower", "upper", "effort", "velocity"):
        _numbers(path, where, limit, key, 1)
    if joint.get("type") != "continuous" and limit is None:
        raise ModelError(f"{path}: {where} is {joint.get('type')} and has no <limit>; expected one")


def check_link(path: Path, link: ElementTree.Element) -> Iterator[str]:
    """Refuse a body that Pinocchio would take for another one, and say what is impossible about it."""
    inertial, where = link.find("inertial"), f"link {link.get('name')!r}"
    if inertial is None:
        return
    for key in ("xyz", "rpy"):
        _numbers(path, where, inertial.find("origin"), key, 3)
    mass = _numbers(path, where, inertial.find("mass"), "value", 1)
    moments = [
        _numbers(path, where, inertial.find("inertia"), f"i{key}", 1) for key in ("xx", "yy", "zz", "xy", "yz", "xz")
    ]
    if not mass or not all(moments):
        raise ModelError(
            f"{path}: {where}: <inertial> lacks mass or inertia; expected value, ixx, iyy, izz, ixy, iyz, ixz"
        )
    if mass[0] < 0:
        raise ModelError(f"{path}: {where}: mass is {mass[0]:g}; expected none below 0")
    (xx,), (yy,), (zz,), (xy,), (yz,), (xz,) = moments
    lowest, *_, highest = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if lowest < -(1e-12 + 1e-9 * abs(highest)):
        yield f"{where}: no body has this inertia: a principal moment is {lowest:.3g} kg m^2"
