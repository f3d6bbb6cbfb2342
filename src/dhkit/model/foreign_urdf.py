"""URDFs that others wrote: read with suspicion, one chain of them as a Pinocchio model."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from dhkit.errors import ModelError
from dhkit.model.reference import PinocchioModel

__all__ = ["Chain", "chain_model", "read_chain"]

MAX_BYTES = 5_000_000
MAX_DEPTH = 64
MAX_JOINTS = 500
"""Thousands of fixed joints in a row crash Pinocchio."""
MOVING = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}


@dataclass(frozen=True)
class Chain:
    """The joints from a URDF's root to one of its links.

    Attributes
    ----------
    path
        The file.
    text
        The URDF as Pinocchio shall read it: no document type, continuous joints made revolute.
    joints
        Names of the moving joints from the root to the tip.
    kinds
        One letter a joint, R or P.
    locked
        Names of the other moving joints, which stand at zero.
    tip
        The link at the end.
    limits
        Lowest and highest value by joint, where it has them.
    """

    path: Path
    text: str
    joints: tuple[str, ...]
    kinds: str
    locked: tuple[str, ...]
    tip: str
    limits: Mapping[str, tuple[float, float]]


def read_chain(path: str | Path, tip: str | None = None) -> Chain:
    """Read a URDF and choose the chain from its root to a link.

    The text is never trusted: no document types or entities, bounded size and depth, one tree of links, finite numbers.
    Meshes are not opened.

    Parameters
    ----------
    path
        The file.
    tip
        The chain's last link; the leaf with the most moving joints before it if not given.

    Raises
    ------
    ModelError
        The file cannot be read, is no URDF, or has no such chain; says what and where.
    """
    path = Path(path)
    robot = _parsed(path)
    joints = {name: joint for joint in robot.findall("joint") if (name := joint.get("name"))}
    parents = _tree(path, robot, joints)
    for element in robot.iter():
        _check_numbers(path, element)
    links = [link.get("name", "") for link in robot.findall("link")]
    end = _tip(path, links, parents, joints, tip)
    along = _along(end, parents, joints)
    moving = [name for name, joint in joints.items() if joint.get("type") in MOVING]
    text = ElementTree.tostring(_readable(robot), encoding="unicode")
    return Chain(
        path,
        text,
        tuple(along),
        "".join("P" if joints[name].get("type") == "prismatic" else "R" for name in along),
        tuple(name for name in moving if name not in along),
        end,
        {name: limits for name in along if (limits := _limits(joints[name]))},
    )


def chain_model(chain: Chain) -> PinocchioModel:
    """Return a chain as a Pinocchio model, its other joints locked at zero; joint i of the chain is joint i of it.

    Raises
    ------
    ModelError
        Pinocchio is not installed, or refuses the URDF.
    """
    try:
        import pinocchio as pin
    except ImportError as error:
        raise ModelError(f"Pinocchio cannot be imported ({error}); pip install pin (Linux, macOS)") from None
    try:
        model = pin.buildModelFromXML(chain.text)
        if chain.locked:
            ids = [model.getJointId(name) for name in chain.locked]
            model = pin.buildReducedModel(model, ids, pin.neutral(model))
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{chain.path}: Pinocchio refuses the URDF: {' '.join(str(error).split())[:200]}") from None
    if list(model.names[1:]) != list(chain.joints):
        raise ModelError(f"{chain.path}: joints {', '.join(model.names[1:])}; expected {', '.join(chain.joints)}")
    return model


def _parsed(path: Path) -> ElementTree.Element:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ModelError(f"{path}: more than {MAX_BYTES // 1_000_000} MB; expected a URDF")
        content = path.read_bytes()
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror or error}") from None
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


def _tree(path: Path, robot: ElementTree.Element, joints: Mapping[str, ElementTree.Element]) -> dict[str, str]:
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
        child, parent = _link_of(joint, "child"), _link_of(joint, "parent")
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
        reached |= {child for child, name in parents.items() if _link_of(joints[name], "parent") in reached}
    if beyond := [link for link in links if link not in reached]:
        raise ModelError(f"{path}: links {', '.join(map(str, beyond))[:200]} go round in a circle")
    return parents


def _link_of(joint: ElementTree.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


NUMBERS = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "limit": ("lower", "upper", "effort", "velocity"),
}


def _check_numbers(path: Path, element: ElementTree.Element) -> None:
    """Refuse numbers that Pinocchio would take for others in silence."""
    for key in NUMBERS.get(element.tag, ()):
        for word in element.get(key, "").split():
            try:
                finite = math.isfinite(float(word))
            except ValueError:
                finite = False
            if not finite:
                raise ModelError(f"{path}: <{element.tag} {key}>: found {word[:40]!r}; expected a finite number")
    if element.tag == "axis" and not any(float(word) for word in element.get("xyz", "1 0 0").split()):
        raise ModelError(f"{path}: <axis xyz={element.get('xyz')!r}>: expected a direction")
    if element.tag == "inertial" and (element.find("mass") is None or element.find("inertia") is None):
        raise ModelError(f"{path}: <inertial> without <mass> or <inertia>")


def _tip(
    path: Path,
    links: list[str],
    parents: Mapping[str, str],
    joints: Mapping[str, ElementTree.Element],
    wanted: str | None,
) -> str:
    if wanted is not None:
        if wanted not in links:
            raise ModelError(f"{path}: no link {wanted!r}; it has {', '.join(links)[:400]}")
        return wanted
    inner = {_link_of(joint, "parent") for joint in joints.values()}
    leaves = [link for link in links if link not in inner]
    counts = {leaf: len(_along(leaf, parents, joints)) for leaf in leaves}
    most = max(counts.values())
    best = [leaf for leaf, count in counts.items() if count == most]
    if "tool" in best:
        return "tool"
    if len(best) > 1:
        raise ModelError(f"{path}: chains end at {', '.join(best)[:400]}; choose one (tip)")
    return best[0]


def _along(link: str, parents: Mapping[str, str], joints: Mapping[str, ElementTree.Element]) -> list[str]:
    """Return the moving joints from the root to a link."""
    along: list[str] = []
    for _ in range(len(joints)):
        if link not in parents:
            break
        name = parents[link]
        if joints[name].get("type") in MOVING:
            along.append(name)
        link = _link_of(joints[name], "parent")
    return along[::-1]


def _limits(joint: ElementTree.Element) -> tuple[float, float] | None:
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return None
    return float(limit.get("lower", "0")), float(limit.get("upper", "0"))


def _readable(robot: ElementTree.Element) -> ElementTree.Element:
    """Make continuous joints revolute, which Pinocchio would give two entries, and drop what is only seen."""
    for joint in robot.findall("joint"):
        kind = joint.get("type", "")
        if kind == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
            limit.attrib |= {"lower": "-100", "upper": "100"}
            limit.attrib.setdefault("effort", "1000")
            limit.attrib.setdefault("velocity", "100")
    for link in robot.findall("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    return robot
