"""URDFs that others wrote: read with suspicion, one chain of them as a Pinocchio model."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from dhkit.errors import ModelError
from dhkit.model.reference import PinocchioModel
from dhkit.model.urdf_checks import check_joint, check_link, check_moving, link_of, parents_of, parsed

__all__ = ["Chain", "chain_model", "read_chain"]


@dataclass(frozen=True)
class Chain:
    """The joints from a URDF's root to one of its links.

    Attributes
    ----------
    path
        The file.
    text
        The URDF as Pinocchio shall read it: no document type, joints off the chain fixed, continuous ones revolute.
    joints
        Names of the moving joints from the root to the tip.
    kinds
        One letter a joint, R or P.
    locked
        Names of the other moving joints, which are fixed where they are at zero.
    tip
        The link at the end.
    limits
        Lowest and highest value by joint, where it has them.
    notes
        What is odd about it.
    """

    path: Path
    text: str
    joints: tuple[str, ...]
    kinds: str
    locked: tuple[str, ...]
    tip: str
    limits: Mapping[str, tuple[float, float]]
    notes: tuple[str, ...] = ()


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
    robot = parsed(path)
    joints = {name: joint for joint in robot.findall("joint") if (name := joint.get("name"))}
    parents = parents_of(path, robot, joints)
    for joint in joints.values():
        check_joint(path, joint)
    notes = [note for link in robot.findall("link") for note in check_link(path, link)]
    links = [link.get("name", "") for link in robot.findall("link")]
    end = _tip(path, links, parents, joints, tip)
    along = _along(end, parents, joints)
    if not along:
        raise ModelError(f"{path}: no moving joints from the root to link {end!r}")
    for name in along:
        check_moving(path, joints[name])
    locked = tuple(name for name, joint in joints.items() if joint.get("type") != "fixed" and name not in along)
    if locked:
        notes.append(f"joints off the chain stand at zero, their links' masses included: {', '.join(locked)}")
    kinds = "".join("P" if joints[name].get("type") == "prismatic" else "R" for name in along)
    limits = {name: limits for name in along if (limits := _limits(joints[name]))}
    text = ElementTree.tostring(_readable(robot, locked), encoding="unicode")
    return Chain(path, text, tuple(along), kinds, locked, end, limits, tuple(notes))


def chain_model(chain: Chain) -> PinocchioModel:
    """Return a chain as a Pinocchio model; joint i of the chain is joint i of the model.

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
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{chain.path}: Pinocchio refuses the URDF: {' '.join(str(error).split())[:200]}") from None
    if list(model.names[1:]) != list(chain.joints):
        raise ModelError(f"{chain.path}: joints {', '.join(model.names[1:])}; expected {', '.join(chain.joints)}")
    return model


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
    inner = {link_of(joint, "parent") for joint in joints.values()}
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
        if joints[name].get("type") != "fixed":
            along.append(name)
        link = link_of(joints[name], "parent")
    return along[::-1]


def _limits(joint: ElementTree.Element) -> tuple[float, float] | None:
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return None
    return float(limit.get("lower", "0")), float(limit.get("upper", "0"))


def _readable(robot: ElementTree.Element, locked: Collection[str]) -> ElementTree.Element:
    """Make continuous joints revolute, which Pinocchio would give two entries; drop what is only seen."""
    robot.attrib.setdefault("name", "robot")
    for joint in robot.findall("joint"):
        kind = joint.get("type", "")
        if kind == "fixed" or joint.get("name") in locked:
            joint.set("type", "fixed")
            for element in [*joint.findall("axis"), *joint.findall("limit"), *joint.findall("mimic")]:
                joint.remove(element)
        elif kind == "continuous":
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
