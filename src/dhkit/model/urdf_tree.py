"""A URDF as data: links and joints of one tree, as :mod:`dhkit.model.urdf_reader` makes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dhkit.description import Array
from dhkit.model.urdf_xml import Element

MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass, kg, centre of mass, m, shape (3,), and inertia about it, kg m^2, shape (3, 3), in the link's axes."""

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True, eq=False)
class UrdfShape:
    """What a link looks like or collides with, as the URDF states it.

    Attributes
    ----------
    kind
        mesh, box, cylinder, sphere or capsule.
    sizes
        Edges of a box, radius and length of a cylinder or capsule, radius of a sphere, scale (3) of a mesh.
    T_link_shape
        Shape (4, 4), m.
    file
        The mesh's file name or URI; empty for other kinds.
    color
        ``#rrggbb``, or None.
    """

    kind: str
    sizes: tuple[float, ...]
    T_link_shape: Array
    file: str = ""
    color: str | None = None


@dataclass(frozen=True, eq=False)
class UrdfLink:
    """A link: its inertial, visual and collision elements."""

    name: str
    inertial: Inertial | None
    visuals: tuple[UrdfShape, ...]
    collisions: tuple[UrdfShape, ...]


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint between two links.

    Attributes
    ----------
    T_parent_joint
        Shape (4, 4), m: where the joint, and the child link with it at zero, stands in the parent link.
    axis
        Unit vector, shape (3,), in the joint's frame; of moving joints.
    limits
        Lowest and highest value, rad or m; None: unlimited.
    velocity, effort
        Largest speed, rad/s or m/s, and torque or force, N m or N; None: unlimited.
    damping, friction
        N m s/rad and N m, or N s/m and N.
    mimics
        The joint that this one follows, or None.
    """

    name: str
    kind: str
    parent: str
    child: str
    T_parent_joint: Array
    axis: Array
    limits: tuple[float, float] | None
    velocity: float | None
    effort: float | None
    damping: float
    friction: float
    mimics: str | None

    @property
    def is_moving(self) -> bool:
        """Whether it is one of revolute, continuous and prismatic."""
        return self.kind in MOVING


@dataclass(frozen=True, eq=False)
class UrdfTree:
    """Links and joints of a URDF, one tree.

    Attributes
    ----------
    path, name
        The file, and the robot's name in it.
    element
        The XML that was read, for readers behind this gate.
    links, joints
        By name, in the file's order.
    parent_joint
        The joint between a link and its parent, by the link's name; the root has none.
    root
        The link without a parent.
    warnings
        What was odd, with how it was read.
    changes
        What ``as_designed`` read differently from how it is written.
    """

    path: Path
    name: str
    element: Element
    links: Mapping[str, UrdfLink]
    joints: Mapping[str, UrdfJoint]
    parent_joint: Mapping[str, UrdfJoint]
    root: str
    warnings: tuple[str, ...]
    changes: tuple[str, ...]

    def joints_to(self, link: str, base: str | None = None) -> tuple[UrdfJoint, ...] | None:
        """Return the joints from a base (the root if not given) to a link; None if the base is not on the way."""
        end, along = self.root if base is None else base, []
        while link != end:
            joint = self.parent_joint.get(link)
            if joint is None:
                return None
            along.append(joint)
            link = joint.parent
        return tuple(along[::-1])

    def zero_poses(self) -> dict[str, Array]:
        """Return all links in the root link, shape (4, 4) each, with every joint at zero."""
        poses: dict[str, Array] = {self.root: np.eye(4)}
        for link in self.links:
            along = []
            while link not in poses:
                along.append(link)
                link = self.parent_joint[link].parent
            for below in reversed(along):
                joint = self.parent_joint[below]
                poses[below] = poses[joint.parent] @ joint.T_parent_joint
        return poses
