"""A serial chain of a URDF: its moving joints between two links, what each of them carries, and Pinocchio's reading."""

from __future__ import annotations

import copy
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias
from xml.etree import ElementTree

import numpy as np

from dhkit.description import Array
from dhkit.errors import ModelError
from dhkit.model.reference import PinocchioModel, import_pinocchio
from dhkit.model.urdf_reader import read_urdf
from dhkit.model.urdf_tree import UrdfJoint, UrdfTree
from dhkit.model.urdf_xml import Element, child_name

Side: TypeAlias = Literal["freeze", "drop"]
"""What becomes of links behind moving joints beside the chain: carried along with those joints at zero, or left out."""

BASE_FRAME, TIP_FRAME = "dhkit:base", "dhkit:tip"
"""Links that are added to Pinocchio's reading: links and joints of a URDF may share a name, these are found."""
CONVENTIONAL_TIPS = ("tool", "tool0")
"""Names of tool frames: dhkit's own, and that of ROS-Industrial's robots (REP 199)."""
MAX_NOTES = 50
"""Notes of the reader that are listed; robot files hold 20,000 characters of them."""
FAR = 1e3
"""rad or m: limits of joints that a URDF leaves unlimited; Pinocchio asks for numbers."""


@dataclass(frozen=True, eq=False)
class Chain:
    """A serial chain between two links of a URDF.

    Attributes
    ----------
    tree
        The URDF.
    base, tip
        The first and the last link; the base is the world.
    joints
        The moving joints from the base to the tip.
    groups
        Names of the links that move together, from the base's group to that of the last joint: a joint's child, what
        is fixed to it, and what stands frozen behind joints beside the chain.
    frozen
        Names of the moving joints outside the chain, which stand at zero.
    dropped
        Names of the links left out.
    zero_poses
        Every link in the base link, shape (4, 4) each, with all joints at zero.
    notes
        What is odd about the file, and what was done to get a chain.
    """

    tree: UrdfTree
    base: str
    tip: str
    joints: tuple[UrdfJoint, ...]
    groups: tuple[tuple[str, ...], ...]
    frozen: tuple[str, ...]
    dropped: tuple[str, ...]
    zero_poses: Mapping[str, Array]
    notes: tuple[str, ...]

    @property
    def path(self) -> Path:
        """The file."""
        return self.tree.path

    @property
    def T_base_root(self) -> Array:
        """The URDF's root in the base with all joints at zero, shape (4, 4)."""
        return self.zero_poses[self.tree.root]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the moving joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def kinds(self) -> str:
        """One letter a joint, R or P."""
        return "".join("P" if joint.kind == "prismatic" else "R" for joint in self.joints)

    @property
    def limits(self) -> Mapping[str, tuple[float, float]]:
        """Lowest and highest value by joint, rad or m, where it has them."""
        return {joint.name: joint.limits for joint in self.joints if joint.limits is not None}


def read_chain(
    path: str | Path,
    base: str | None = None,
    tip: str | None = None,
    *,
    side: Side = "freeze",
    as_designed: bool = False,
) -> Chain:
    """Read a URDF and cut the chain between two of its links out of it.

    Parameters
    ----------
    path
        The file; read by :func:`dhkit.model.urdf_reader.read_urdf`.
    base
        The chain's first link, which becomes the world; the root if not given.
    tip
        Its last link. May be left out where the URDF has one chain.
    side
        Whether links behind moving joints beside the chain are carried along, with those joints at zero, or dropped.
    as_designed
        Read rounded right angles as right angles.

    Raises
    ------
    ModelError
        The file is refused, has no such chain, or several and no tip was given; says what and where.
    """
    return chain_of(read_urdf(path, as_designed=as_designed), base, tip, side=side)


def chain_of(tree: UrdfTree, base: str | None = None, tip: str | None = None, *, side: Side = "freeze") -> Chain:
    """Cut the chain between two links out of a URDF that was read; see :func:`read_chain`.

    Raises
    ------
    ModelError
        No such chain, or several and no tip was given.
    """
    if side not in ("freeze", "drop"):
        raise ModelError(f"side is {side!r}; expected 'freeze' or 'drop'")
    for what, link in (("base", base), ("tip", tip)):
        if link is not None and not isinstance(link, str):
            raise TypeError(f"{what} is {link!r}; expected the name of a link")
        if link is not None and link not in tree.links:
            raise ModelError(f"{tree.path}: {what}: no link {link[:60]!r}; it has {_listed(tree.links, 400)}")
    first = tree.root if base is None else base
    last = _only_tip(tree, first) if tip is None else tip
    way = tree.joints_to(last, first)
    if way is None:
        hint = "; swap base and tip" if tree.joints_to(first, last) is not None else ""
        raise ModelError(f"{tree.path}: base {first!r} is not on the way from the root to tip {last!r}{hint}")
    joints = tuple(joint for joint in way if joint.kind != "fixed")
    _check_moving(tree, joints, first, last)
    frozen = tuple(joint.name for joint in tree.joints.values() if joint.kind != "fixed" and joint not in joints)
    groups, dropped = _groups(tree, first, joints, side)
    poses = tree.zero_poses()
    to_base = np.linalg.inv(poses[first])
    return Chain(
        tree=tree,
        base=first,
        tip=last,
        joints=joints,
        groups=groups,
        frozen=frozen,
        dropped=dropped,
        zero_poses={link: to_base @ T for link, T in poses.items()},
        notes=tuple(_notes(tree, first, joints, groups, dropped, side)),
    )


def chain_tips(tree: UrdfTree, base: str | None = None) -> dict[tuple[str, ...], list[str]]:
    """Return a URDF's chains from a base to its leaves: names of moving joints, and the leaves that end each.

    Chains with joints that follow others, or that are neither revolute nor prismatic, are left out.
    """
    tips: dict[tuple[str, ...], list[str]] = {}
    for link, moving in _moving_to_leaves(tree, base):
        if all(joint.is_moving and joint.mimics is None for joint in moving):
            tips.setdefault(tuple(joint.name for joint in moving), []).append(link)
    return tips


def tool_frame(leaves: Sequence[str]) -> str | None:
    """Return the one of several frames behind the same joint that is the tool: the only one, or that by convention."""
    if len(leaves) == 1:
        return leaves[0]
    return next((name for name in CONVENTIONAL_TIPS if name in leaves), None)


def chain_text(chain: Chain) -> str:
    """Return the original URDF for other readers: joints off the chain fixed, nothing that is only seen."""
    return ElementTree.tostring(_readable(chain), encoding="unicode")


def only_tip(tree: UrdfTree, base: str) -> str | None:
    """Return the end of the only chain below a link; None where there are several.

    Frames on the links before a tool by convention, such as dhkit's own dh1, dh2 ..., do not make it several.
    """
    tips = chain_tips(tree, base)
    longest = max(tips, key=len, default=())
    tip = tool_frame(tips[longest]) if tips else None
    chains = {*tips, *_other_chains(tree, base)}
    if len(chains) > 1 and (tip not in CONVENTIONAL_TIPS or any(longest[: len(chain)] != chain for chain in chains)):
        return None
    return tip


def _other_chains(tree: UrdfTree, base: str) -> set[tuple[str, ...]]:
    """Return the moving joints to leaves that :func:`chain_tips` leaves out: fingers that follow others."""
    return {
        tuple(joint.name for joint in moving)
        for _, moving in _moving_to_leaves(tree, base)
        if any(joint.mimics is not None for joint in moving)
    }


def _moving_to_leaves(tree: UrdfTree, base: str | None) -> Iterator[tuple[str, tuple[UrdfJoint, ...]]]:
    """Yield the links that nothing hangs on, in the file's order, and the moving joints from a base to each."""
    inner = {joint.parent for joint in tree.joints.values()}
    for link in tree.links:
        way = tree.joints_to(link, base) if link not in inner else None
        if moving := tuple(joint for joint in way or () if joint.kind != "fixed"):
            yield link, moving


def _branchings(tree: UrdfTree, base: str, chains: Collection[tuple[str, ...]]) -> dict[str, int]:
    """Return the links on which chains part, with the number of joints before them."""
    found: dict[str, int] = {}
    for chain in chains:
        for k in range(1, len(chain)):
            others = {other[k] for other in chains if other[:k] == chain[:k] and len(other) > k}
            if len(others) > 1:
                found[tree.joints[chain[k]].parent] = k
    return found


def chain_model(chain: Chain) -> PinocchioModel:
    """Return a chain as a Pinocchio model of the original file; joint i of the chain is joint i of the model.

    Other joints are fixed at zero; frames :data:`BASE_FRAME` and :data:`TIP_FRAME` are added. Its world is the chain's
    base; gravity is (0, 0, -9.81) in the URDF's root.

    Raises
    ------
    ModelError
        Pinocchio is not installed, or refuses the URDF.
    """
    pin = import_pinocchio()
    try:
        model = pin.buildModelFromXML(chain_text(chain))
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{chain.path}: Pinocchio refuses the URDF: {' '.join(str(error).split())[:200]}") from None
    if list(model.names[1:]) != list(chain.names):
        raise ModelError(f"{chain.path}: joints {', '.join(model.names[1:])}; expected {', '.join(chain.names)}")
    root_in_base = pin.SE3(chain.T_base_root)
    model.jointPlacements[1] = root_in_base * model.jointPlacements[1]
    for frame in model.frames:
        if frame.parentJoint == 0:
            frame.placement = root_in_base * frame.placement
    model.gravity.linear = root_in_base.rotation @ model.gravity.linear
    return model


def _only_tip(tree: UrdfTree, base: str) -> str:
    """Return the end of the only chain below a link; refuse none and several, listing them."""
    if (tip := only_tip(tree, base)) is not None:
        return tip
    tips = chain_tips(tree, base)
    if not tips:
        raise ModelError(f"{tree.path}: no moving joints below link {base!r} that do not follow others (mimic)")
    others = _other_chains(tree, base)
    if len(tips) == 1 and not others:
        (leaves,) = tips.values()
        raise ModelError(f"{tree.path}: several frames end the chain: {_listed(leaves, 400)}; choose one (tip)")
    ends = {tool_frame(leaves) or leaves[0]: len(joints) for joints, leaves in tips.items()}
    ends = _branchings(tree, base, {*tips, *others}) | ends
    listed = [f"{link} ({count} joint{'s' * (count > 1)})" for link, count in ends.items()]
    raise ModelError(f"{tree.path}: chains end at {_listed(listed, 600)}; choose one (tip)")


def _check_moving(tree: UrdfTree, joints: Sequence[UrdfJoint], base: str, tip: str) -> None:
    """Refuse a chain without moving joints, or with one that is no revolute or prismatic joint of its own."""
    if not joints:
        raise ModelError(f"{tree.path}: no moving joints from link {base!r} to link {tip!r}")
    for joint in joints:
        if not joint.is_moving:
            raise ModelError(
                f"{tree.path}: joint {joint.name!r} is {joint.kind}; expected revolute, continuous, prismatic or fixed"
                f" from link {base!r} to link {tip!r} (base= may be a link behind it)"
            )
        if joint.mimics is not None:
            raise ModelError(
                f"{tree.path}: joint {joint.name!r} follows joint {joint.mimics!r} (mimic); a DH table has only joints "
                "that move on their own; choose a tip before it"
            )


def _groups(
    tree: UrdfTree, base: str, joints: Sequence[UrdfJoint], side: Side
) -> tuple[tuple[tuple[str, ...], ...], tuple[str, ...]]:
    """Return the links that move together, and those that are dropped."""
    starts = [base, *(joint.child for joint in joints)]
    children: dict[str, list[UrdfJoint]] = {}
    for joint in tree.joints.values():
        children.setdefault(joint.parent, []).append(joint)
    groups: list[tuple[str, ...]] = []
    dropped: list[str] = []
    for start in starts:
        group: list[str] = []
        waiting = [(start, True)]
        while waiting:
            link, kept = waiting.pop()
            (group if kept else dropped).append(link)
            waiting += [
                (joint.child, kept and (side == "freeze" or joint.kind == "fixed"))
                for joint in children.get(link, ())
                if joint.child not in starts
            ]
        groups.append(tuple(group))
    return tuple(groups), tuple(dropped)


def _notes(
    tree: UrdfTree,
    base: str,
    joints: Sequence[UrdfJoint],
    groups: Sequence[Sequence[str]],
    dropped: Collection[str],
    side: Side,
) -> list[str]:
    concerned = {joint.name for joint in joints}
    kept = {link for group in groups for link in group}
    notes = [note for note in tree.warnings if _concerns(note, concerned, kept)]
    if len(notes) > MAX_NOTES:
        notes = [*notes[:MAX_NOTES], f"and {len(notes) - MAX_NOTES} more notes of this kind"]
    beside = [
        joint.name
        for joint in tree.joints.values()
        if joint.kind != "fixed"
        and joint.name not in concerned
        and joint.child != base
        and (joint.child in kept or joint.child in dropped)
    ]
    if beside and side == "freeze":
        notes.append(f"joints off the chain stand at zero, their links carried along: {_listed(beside, 300)}")
    for joint in tree.joints.values():
        if joint.mimics in concerned and joint.child in kept and joint.name not in concerned:
            notes.append(f"joint {joint.name!r} follows {joint.mimics!r} in the file; here it stands at zero")
    if dropped:
        notes.append(f"links behind joints off the chain left out: {_listed(sorted(dropped), 300)}")
    if base != tree.root:
        notes.append(f"the world is link {base!r}, with the joints between it and the root {tree.root!r} at zero")
    massless = [group[0] for group in groups[1:] if not any(tree.links[link].inertial is not None for link in group)]
    if massless and any(link.inertial is not None for link in tree.links.values()):
        notes.append(f"links without <inertial> are bodies of mass 0: {_listed(massless, 300)}")
    return notes


def _concerns(note: str, joints: Collection[str], links: Collection[str]) -> bool:
    """Return whether a warning of the reader is about the chain."""
    what, _, rest = note.partition(" ")
    name = rest[1:].partition(rest[:1])[0]
    return name in (joints if what == "joint" else links)


def _readable(chain: Chain) -> Element:
    """Return the URDF for other readers: joints off the chain fixed, continuous ones revolute, without shapes."""
    robot = copy.deepcopy(chain.tree.element)
    robot.attrib.setdefault("name", "robot")
    for tag in ("material", "gazebo", "transmission"):
        for element in robot.findall(tag):
            robot.remove(element)
    dropped = set(chain.dropped)
    for joint in robot.findall("joint"):
        if child_name(joint, "child") in dropped:
            robot.remove(joint)
        elif joint.get("name") in chain.names:
            _make_movable(joint, chain.tree.joints[joint.get("name", "")].axis)
        else:
            joint.set("type", "fixed")
            for tag in ("axis", "limit", "mimic", "dynamics", "safety_controller", "calibration"):
                for element in joint.findall(tag):
                    joint.remove(element)
    for link in robot.findall("link"):
        if link.get("name") in dropped:
            robot.remove(link)
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    for frame, link_name in ((BASE_FRAME, chain.base), (TIP_FRAME, chain.tip)):
        ElementTree.SubElement(robot, "link", name=frame)
        fixed = ElementTree.SubElement(robot, "joint", name=f"{frame}:fixed", type="fixed")
        ElementTree.SubElement(fixed, "parent", link=link_name)
        ElementTree.SubElement(fixed, "child", link=frame)
    return robot


def _make_movable(joint: Element, axis: Array) -> None:
    """Give a joint of the chain one entry in Pinocchio's configuration, limits, which it demands, and a unit axis."""
    given = joint.find("axis")
    if given is not None and not math.isclose(
        math.hypot(*map(float, given.get("xyz", "1 0 0").split())), 1, rel_tol=0.01
    ):
        given.set("xyz", " ".join(repr(float(x)) for x in axis))  # squares of long ones overflow in other readers
    if joint.get("type") == "continuous":
        joint.set("type", "revolute")
    for element in [*joint.findall("limit"), *joint.findall("safety_controller"), *joint.findall("calibration")]:
        joint.remove(element)
    ElementTree.SubElement(joint, "limit", lower=f"{-FAR}", upper=f"{FAR}", effort=f"{FAR}", velocity=f"{FAR}")


def _listed(names: Collection[str], most: int) -> str:
    text = ", ".join(names)
    return text if len(text) <= most else f"{text[:most]} ..."
