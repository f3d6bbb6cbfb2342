"""A serial chain of a URDF: its moving joints between two links, the links that they carry, and Pinocchio's model."""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias
from xml.etree import ElementTree

import numpy as np

from dhkit.description import Array
from dhkit.errors import ModelError
from dhkit.model.bounds import BOUNDS
from dhkit.model.reference import PinocchioModel, import_pinocchio
from dhkit.model.urdf_reader import read_urdf
from dhkit.model.urdf_tree import JointKind, UrdfJoint, UrdfLink, UrdfTree
from dhkit.model.urdf_xml import Element, child_name

Side: TypeAlias = Literal["freeze", "drop"]
"""Links after moving joints beside the chain are carried along with those joints at zero, or left out."""

JointNames: TypeAlias = tuple[str, ...]
"""Names of the moving joints of a chain, from the base to the tip."""

BASE_FRAME = "dhkit:base"
TIP_FRAME = "dhkit:tip"
"""Links that are added for Pinocchio: links and joints of a URDF may share a name, these names are unique."""
_CONVENTIONAL_TIPS = ("tool", "tool0")
"""Names of tool frames: dhkit's own, and that of ROS-Industrial's robots (REP 199)."""
_UNLIMITED = 1e3
"""rad or m: limits of joints that a URDF leaves unlimited, since Pinocchio requires numbers."""


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
        Names of the links that move together, from the base's group to that of the last joint: a joint's child, the
        links fixed to it, and those frozen after joints beside the chain.
    frozen
        Names of the moving joints outside the chain, which are at zero.
    dropped
        Names of the links left out.
    zero_poses
        Every link in the base link, shape (4, 4) each, m, with all joints at zero.
    notes
        Unusual elements of the file, and changes that make a chain of it.
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
        """The URDF's root in the base with all joints at zero, shape (4, 4), m."""
        return self.zero_poses[self.tree.root]

    @property
    def names(self) -> JointNames:
        """Names of the moving joints."""
        return _names(self.joints)

    @property
    def kinds(self) -> str:
        """One letter a joint, R or P."""
        return "".join("P" if joint.is_prismatic else "R" for joint in self.joints)

    @property
    def limits(self) -> Mapping[str, tuple[float, float]]:
        """Lowest and highest value of the limited joints, rad or m, by joint."""
        return {joint.name: joint.limits for joint in self.joints if joint.limits is not None}


def read_chain(
    path: str | Path,
    base: str | None = None,
    tip: str | None = None,
    *,
    side: Side = "freeze",
    as_designed: bool = False,
) -> Chain:
    """Read a URDF and return the chain between two of its links.

    Parameters
    ----------
    path
        The file; read by :func:`dhkit.model.urdf_reader.read_urdf`.
    base
        The chain's first link, which becomes the world; the root if not given.
    tip
        Its last link. May be left out if the URDF has one chain.
    side
        Whether links after moving joints beside the chain are carried along, with those joints at zero, or dropped.
    as_designed
        Read rounded right angles as right angles.

    Raises
    ------
    ModelError
        The file is refused, has no such chain, or several and no tip was given; names file and element.
    """
    return chain_of(read_urdf(path, as_designed=as_designed), base, tip, side=side)


def chain_of(
    tree: UrdfTree, base: str | None = None, tip: str | None = None, *, side: Side = "freeze"
) -> Chain:
    """Return the chain between two links of a URDF that was read; see :func:`read_chain`.

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
            raise ModelError(
                f"{tree.path}: {what}: no link {link[:60]!r}; it has {_shortened(tree.links, 400)}"
            )
    first = tree.root if base is None else base
    try:
        last = _required_tip(tree, first) if tip is None else tip
        joints = _moving_joints(tree, first, last)
    except ModelError as error:
        raise ModelError(f"{tree.path}: {error}") from None
    groups, dropped = _groups(tree, first, joints, side)
    _require_no_fault(tree, joints, groups)
    poses = tree.zero_poses()
    to_base = np.linalg.inv(poses[first])
    return Chain(
        tree=tree,
        base=first,
        tip=last,
        joints=joints,
        groups=groups,
        frozen=_names(
            joint for joint in tree.joints.values() if not joint.is_fixed and joint not in joints
        ),
        dropped=dropped,
        zero_poses={link: to_base @ T for link, T in poses.items()},
        notes=tuple(_notes(tree, first, joints, groups, dropped, side)),
    )


def _require_no_fault(
    tree: UrdfTree, joints: Sequence[UrdfJoint], groups: Sequence[Sequence[str]]
) -> None:
    """Refuse a chain with a joint or a link that could not be read."""
    links = [tree.links[link] for link in itertools.chain.from_iterable(groups)]
    parts: list[UrdfJoint | UrdfLink] = [*joints, *links]
    for part in parts:
        if part.fault is not None:
            raise ModelError(f"{tree.path}: {part.fault}")


def _names(joints: Iterator[UrdfJoint] | Sequence[UrdfJoint]) -> JointNames:
    return tuple(joint.name for joint in joints)


def chain_tips(tree: UrdfTree, base: str | None = None) -> dict[JointNames, list[str]]:
    """Return a URDF's chains from a base to its leaves, and the leaves at the end of each.

    Chains with joints that follow others, or that are neither revolute nor prismatic, are left out.
    """
    tips: dict[JointNames, list[str]] = {}
    for leaf, joints in _leaves(tree, base):
        if all(joint.has_axis and joint.mimics is None for joint in joints):
            tips.setdefault(_names(joints), []).append(leaf)
    return tips


def tool_frame(leaves: Sequence[str]) -> str | None:
    """Return the tool among several frames after the same joint: the only one, or the one of a conventional name."""
    if len(leaves) == 1:
        return leaves[0]
    return next((name for name in _CONVENTIONAL_TIPS if name in leaves), None)


def only_tip(tree: UrdfTree, base: str) -> str | None:
    """Return the end of the only chain below a link; None if there are several.

    Frames on the links before a tool of a conventional name, such as dhkit's own dh1, dh2 ..., are not other chains.
    """
    tips = chain_tips(tree, base)
    longest = max(tips, key=len, default=())
    tip = tool_frame(tips[longest]) if tips else None
    chains = {*tips, *_mimic_chains(tree, base)}
    if len(chains) > 1 and (
        tip not in _CONVENTIONAL_TIPS or any(longest[: len(chain)] != chain for chain in chains)
    ):
        return None
    return tip


def _mimic_chains(tree: UrdfTree, base: str) -> set[JointNames]:
    """Return the chains to leaves with joints that follow others, such as fingers; :func:`chain_tips` omits them."""
    chains = set()
    for _, joints in _leaves(tree, base):
        if any(joint.mimics is not None for joint in joints):
            chains.add(_names(joints))
    return chains


def _leaves(tree: UrdfTree, base: str | None) -> Iterator[tuple[str, tuple[UrdfJoint, ...]]]:
    """Yield the links without children, in the file's order, and the moving joints from a base to each."""
    parents = {joint.parent for joint in tree.joints.values()}
    for link in tree.links:
        path = tree.joints_to(link, base) if link not in parents else None
        if joints := tuple(joint for joint in path or () if not joint.is_fixed):
            yield link, joints


def _required_tip(tree: UrdfTree, base: str) -> str:
    """Return the end of the only chain below a link; refuse none and several, listing them."""
    if (tip := only_tip(tree, base)) is not None:
        return tip
    tips = chain_tips(tree, base)
    others = _mimic_chains(tree, base)
    if not tips:
        if before := _before_mimics(tree, others):
            listed = ", ".join(
                f"{link} ({joint} follows another joint)" for link, joint in before.items()
            )
            raise ModelError(
                f"every chain has joints that follow others (mimic); choose an end before them (tip): {listed}"
            )
        raise ModelError(f"no moving joints below link {base!r} that do not follow others (mimic)")
    if len(tips) == 1 and not others:
        (leaves,) = tips.values()
        raise ModelError(
            f"several frames end the chain: {_shortened(leaves, 400)}; choose one (tip)"
        )
    ends = {tool_frame(leaves) or leaves[0]: len(joints) for joints, leaves in tips.items()}
    ends = _branchings(tree, {*tips, *others}) | ends
    texts = [f"{link} ({count} joint{'s' * (count > 1)})" for link, count in ends.items()]
    raise ModelError(f"chains end at {_shortened(texts, 600)}; choose one (tip)")


def _before_mimics(tree: UrdfTree, chains: Collection[JointNames]) -> dict[str, str]:
    """Return the links after moving joints at which joints begin that follow others, each with that joint."""
    ends: dict[str, str] = {}
    for chain in sorted(chains):
        joints = [tree.joints[name] for name in chain]
        first = next((k for k, joint in enumerate(joints) if joint.mimics is not None), 0)
        if first:
            ends.setdefault(joints[first - 1].child, joints[first].name)
    return ends


def _branchings(tree: UrdfTree, chains: Collection[JointNames]) -> dict[str, int]:
    """Return the links at which chains separate, with the number of joints before them."""
    branchings: dict[str, int] = {}
    for chain in chains:
        for k in range(1, len(chain)):
            next_joints = {
                other[k] for other in chains if other[:k] == chain[:k] and len(other) > k
            }
            if len(next_joints) > 1:
                branchings[tree.joints[chain[k]].parent] = k
    return branchings


def _moving_joints(tree: UrdfTree, base: str, tip: str) -> tuple[UrdfJoint, ...]:
    """Return the moving joints from a base to a tip; refuse none, and joints that a DH table cannot have."""
    path = tree.joints_to(tip, base)
    if path is None:
        hint = "; swap base and tip" if tree.joints_to(base, tip) is not None else ""
        raise ModelError(f"base {base!r} is not on the way from the root to tip {tip!r}{hint}")
    joints = tuple(joint for joint in path if not joint.is_fixed)
    if not joints:
        raise ModelError(f"no moving joints from link {base!r} to link {tip!r}")
    for joint in joints:
        if not joint.has_axis:
            raise ModelError(
                f"joint {joint.name!r} is {joint.kind}; expected revolute, continuous, prismatic or fixed"
                f" from link {base!r} to link {tip!r} (base= may be a link after it)"
            )
        if joint.mimics is not None:
            raise ModelError(
                f"joint {joint.name!r} follows joint {joint.mimics!r} (mimic); a DH table has only joints "
                "that move on their own; choose a tip before it"
            )
    return joints


def _groups(
    tree: UrdfTree, base: str, joints: Sequence[UrdfJoint], side: Side
) -> tuple[tuple[tuple[str, ...], ...], tuple[str, ...]]:
    """Return the links that move together, and those that are dropped."""
    starts = [base, *(joint.child for joint in joints)]
    children: dict[str, list[UrdfJoint]] = {}
    for joint in tree.joints.values():
        children.setdefault(joint.parent, []).append(joint)
    groups: list[list[str]] = []
    dropped: list[str] = []
    for start in starts:
        groups.append([])
        waiting = [(start, True)]
        while waiting:
            link, is_kept = waiting.pop()
            (groups[-1] if is_kept else dropped).append(link)
            waiting += [
                (joint.child, is_kept and (side == "freeze" or joint.is_fixed))
                for joint in children.get(link, ())
                if joint.child not in starts
            ]
    return tuple(map(tuple, groups)), tuple(dropped)


def _notes(
    tree: UrdfTree,
    base: str,
    joints: Sequence[UrdfJoint],
    groups: Sequence[Sequence[str]],
    dropped: Collection[str],
    side: Side,
) -> list[str]:
    names = _names(joints)
    links = set(itertools.chain.from_iterable(groups))
    notes = [
        str(warning)
        for warning in tree.warnings
        if warning.element.name in (names if warning.element.tag == "joint" else links)
    ]
    if len(notes) > BOUNDS.listed_warnings:
        notes = [
            *notes[: BOUNDS.listed_warnings],
            f"and {len(notes) - BOUNDS.listed_warnings} more notes of this kind",
        ]
    others = [joint for joint in tree.joints.values() if joint.name not in names]
    outside: list[UrdfJoint | UrdfLink] = [*others]
    outside += [tree.links[link] for link in tree.links if link not in links]
    faults = [
        f"{part.fault}; the chain does not use it" for part in outside if part.fault is not None
    ]
    notes += faults[: BOUNDS.listed_warnings]
    if tree.unconnected:
        notes.append(
            f"links that no joint connects with {tree.root!r} left out: {_shortened(tree.unconnected, 300)}"
        )
    beside = [
        joint.name
        for joint in others
        if not joint.is_fixed
        and joint.child != base
        and (joint.child in links or joint.child in dropped)
    ]
    if beside and side == "freeze":
        notes.append(
            f"joints off the chain stand at zero, their links carried along: {_shortened(beside, 300)}"
        )
    notes += [
        f"joint {joint.name!r} follows {joint.mimics!r} in the file; here it stands at zero"
        for joint in others
        if joint.mimics in names and joint.child in links
    ]
    if dropped:
        notes.append(
            f"links after joints off the chain left out: {_shortened(sorted(dropped), 300)}"
        )
    if base != tree.root:
        notes.append(
            f"the world is link {base!r}, with the joints between it and the root {tree.root!r} at zero"
        )
    with_mass = {name for name, link in tree.links.items() if link.inertial is not None}
    massless = [group[0] for group in groups[1:] if with_mass.isdisjoint(group)]
    if massless and with_mass:
        notes.append(f"links without <inertial> are bodies of mass 0: {_shortened(massless, 300)}")
    return notes


def tip_in_base(chain: Chain, q: Array) -> Array:
    """Return the tip in the base at joint values q (n,), rad and m, as a product of the URDF's transforms, (4, 4)."""
    from scipy.spatial.transform import Rotation

    # T_base_tip is the product over the joints of T_parent_joint and their motion, Rot(axis, q) or Trans(q axis).
    values = dict(zip(chain.names, q, strict=True))
    T = np.eye(4)
    for joint in chain.tree.joints_to(chain.tip, chain.base) or ():
        motion = np.eye(4)
        if (value := values.get(joint.name)) is not None:
            if joint.is_prismatic:
                motion[:3, 3] = value * joint.axis
            else:
                motion[:3, :3] = Rotation.from_rotvec(value * joint.axis).as_matrix()
        T = T @ joint.T_parent_joint @ motion
    return T


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
        raise ModelError(
            f"{chain.path}: Pinocchio refuses the URDF: {' '.join(str(error).split())[:200]}"
        ) from None
    if list(model.names[1:]) != list(chain.names):
        raise ModelError(
            f"{chain.path}: joints {', '.join(model.names[1:])}; expected {', '.join(chain.names)}"
        )

    # The model's world is the root. Joint 1 and all frames before it are placed in it, and so is gravity:
    # T_base_x = T_base_root T_root_x and g_base = R_base_root g_root.
    root_in_base = pin.SE3(chain.T_base_root)
    model.jointPlacements[1] = root_in_base * model.jointPlacements[1]
    for frame in model.frames:
        if frame.parentJoint == 0:
            frame.placement = root_in_base * frame.placement
    model.gravity.linear = root_in_base.rotation @ model.gravity.linear
    return model


def chain_text(chain: Chain) -> str:
    """Return the original URDF for other readers: other joints fixed, continuous ones revolute, without shapes."""
    robot = copy.deepcopy(chain.tree.element)
    robot.attrib.setdefault("name", "robot")
    _remove_all(robot, "material", "gazebo", "transmission")
    _remove_prefixed(robot)
    left_out = {*chain.dropped, *chain.tree.unconnected}
    for joint in robot.findall("joint"):
        if child_name(joint, "child") in left_out:
            robot.remove(joint)
        elif joint.get("name") in chain.names:
            _make_movable(joint, chain.tree.joints[joint.get("name", "")].axis)
        else:
            joint.set("type", JointKind.FIXED)
            _remove_all(
                joint, "axis", "limit", "mimic", "dynamics", "safety_controller", "calibration"
            )
    for link in robot.findall("link"):
        if link.get("name") in left_out:
            robot.remove(link)
        _remove_all(link, "visual", "collision")
    for frame, link_name in ((BASE_FRAME, chain.base), (TIP_FRAME, chain.tip)):
        ElementTree.SubElement(robot, "link", name=frame)
        fixed = ElementTree.SubElement(robot, "joint", name=f"{frame}:fixed", type="fixed")
        ElementTree.SubElement(fixed, "parent", link=link_name)
        ElementTree.SubElement(fixed, "child", link=frame)
    return ElementTree.tostring(robot, encoding="unicode")


def _remove_all(parent: Element, *tags: str) -> None:
    for tag in tags:
        for element in parent.findall(tag):
            parent.remove(element)


def _remove_prefixed(element: Element) -> None:
    """Remove elements and attributes with the prefix of a namespace, which other readers want declared."""
    for key in [key for key in element.attrib if ":" in key]:
        del element.attrib[key]
    for child in list(element):
        if ":" in child.tag:
            element.remove(child)
        else:
            _remove_prefixed(child)


def _make_movable(joint: Element, axis: Array) -> None:
    """Give a joint of the chain one entry in Pinocchio's configuration, limits, which it requires, and a unit axis."""
    element = joint.find("axis")
    if element is not None and not math.isclose(
        math.hypot(*map(float, element.get("xyz", "1 0 0").split())), 1, rel_tol=0.01
    ):
        # Squares of long ones overflow in other readers.
        element.set("xyz", " ".join(repr(float(x)) for x in axis))
    if joint.get("type") == JointKind.CONTINUOUS:
        joint.set("type", JointKind.REVOLUTE)
    _remove_all(joint, "limit", "safety_controller", "calibration")
    limits = dict.fromkeys(("upper", "effort", "velocity"), f"{_UNLIMITED}")
    ElementTree.SubElement(joint, "limit", {"lower": f"{-_UNLIMITED}"} | limits)


def _shortened(names: Collection[str], max_length: int) -> str:
    text = ", ".join(names)
    return text if len(text) <= max_length else f"{text[:max_length]} ..."
