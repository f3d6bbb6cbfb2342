"""A URDF as data: links and joints of one tree, as :mod:`dhkit.model.urdf_reader` reads them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from dhkit.description import Array, Geometry
from dhkit.model.urdf_xml import Element


class JointKind(StrEnum):
    """Types of joints in a URDF."""

    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"
    FIXED = "fixed"
    FLOATING = "floating"
    PLANAR = "planar"


AXIS_KINDS = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


class ElementName(NamedTuple):
    """A link or joint of a URDF; prints as ``joint 'elbow'``."""

    tag: Literal["link", "joint"]
    name: str

    def __str__(self) -> str:
        return f"{self.tag} {self.name!r}"


class UrdfWarning(NamedTuple):
    """An unusual element of a URDF, and how it was read.

    It prints as the element and its text, which brings its own first space or sign: ``joint 'elbow': no limits``.
    """

    element: ElementName
    text: str

    def __str__(self) -> str:
        return f"{self.element}{self.text}"


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass, kg, centre of mass, m, shape (3,), and inertia about it, kg m^2, shape (3, 3), in the link's axes."""

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True, eq=False)
class UrdfShape:
    """A visual or collision shape of a link.

    Attributes
    ----------
    geometry
        Sizes in m; the path of a mesh is the URDF's file name or URI.
    T_link_shape
        Pose of the shape in the link's frame, shape (4, 4), m.
    color
        ``#rrggbb``, or None.
    """

    geometry: Geometry
    T_link_shape: Array
    color: str | None = None


@dataclass(frozen=True, eq=False)
class UrdfLink:
    """A link: its inertial, visual and collision elements.

    ``fault`` says what is wrong with them; they are left out, and a chain with the link is refused.
    """

    name: str
    inertial: Inertial | None
    visuals: tuple[UrdfShape, ...]
    collisions: tuple[UrdfShape, ...]
    fault: str | None = None


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint between two links.

    Attributes
    ----------
    T_parent_joint
        Shape (4, 4), m: the pose of the joint, and of the child link with the joint at zero, in the parent link.
    rounding, axis_rounding
        By how much its orientation and its axis may be off, rad: a unit in the last decimal of each number.
    axis
        Unit vector in the joint's frame, shape (3,); without meaning for fixed, floating and planar joints.
    limits
        Lowest and highest value, rad or m; None: unlimited.
    velocity, effort
        Largest speed, rad/s or m/s, and torque or force, N m or N; None: unlimited.
    damping, friction
        Viscous damping, N m s/rad or N s/m, and Coulomb friction, N m or N.
    mimics
        The joint that this one follows, or None.
    fault
        Fault of its limits or its dynamics, which are left out; a chain with it is refused.
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    T_parent_joint: Array
    rounding: float
    axis: Array
    axis_rounding: float
    limits: tuple[float, float] | None
    velocity: float | None
    effort: float | None
    damping: float
    friction: float
    mimics: str | None
    fault: str | None

    @property
    def is_fixed(self) -> bool:
        """Whether the joint cannot move."""
        return self.kind is JointKind.FIXED

    @property
    def is_prismatic(self) -> bool:
        """Whether the joint translates along its axis."""
        return self.kind is JointKind.PRISMATIC

    @property
    def has_axis(self) -> bool:
        """Whether the joint is revolute, continuous or prismatic."""
        return self.kind in AXIS_KINDS


@dataclass(frozen=True, eq=False)
class UrdfTree:
    """Links and joints of a URDF, one tree.

    Attributes
    ----------
    path, name
        The file, and the robot's name in it.
    element
        The XML that was read, for other readers of this checked text.
    links, joints
        By name, in the file's order.
    parent_joint
        The joint between a link and its parent, by the link's name; the root has none.
    root
        The link without a parent.
    warnings
        Unusual elements, and how they were read.
    changes
        Numbers that :func:`read_urdf` rounded to their intended values (``as_designed=True``), one sentence each.
    unconnected
        Names of links that no joint connects with the root; they are left out.
    """

    path: Path
    name: str
    element: Element
    links: Mapping[str, UrdfLink]
    joints: Mapping[str, UrdfJoint]
    parent_joint: Mapping[str, UrdfJoint]
    root: str
    warnings: tuple[UrdfWarning, ...]
    changes: tuple[str, ...]
    unconnected: tuple[str, ...] = ()

    def joints_to(self, link: str, base: str | None = None) -> tuple[UrdfJoint, ...] | None:
        """Return the joints from a base (the root if not given) to a link; None if the base is not on that path.

        Every link has one parent joint, so that the path is followed from the link to the base, and then reversed.
        """
        end = self.root if base is None else base
        joints = []
        while link != end:
            joint = self.parent_joint.get(link)
            if joint is None:
                return None
            joints.append(joint)
            link = joint.parent
        return tuple(joints[::-1])

    def zero_poses(self) -> dict[str, Array]:
        """Return the poses of all links in the root link, shape (4, 4) each, m, with every joint at zero."""
        poses: dict[str, Array] = {self.root: np.eye(4)}
        for link in self.links:
            without_pose = []
            while link not in poses:
                without_pose.append(link)
                link = self.parent_joint[link].parent
            for child in reversed(without_pose):
                joint = self.parent_joint[child]
                poses[child] = poses[joint.parent] @ joint.T_parent_joint
        return poses
