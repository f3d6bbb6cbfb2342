"""Shapes of an arm's links: those of its description, or solids drawn from the table for links without shapes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import TypeAlias

import numpy as np

from dhkit.cached_property import cached_property
from dhkit.description import Array, Description, Geometry, Mesh, Shape, takes_robot
from dhkit.description.assets import inside
from dhkit.description.changes import placement_of_pose
from dhkit.description.mesh_files import is_mesh_file
from dhkit.description.numbers import matrix
from dhkit.description.parameters import resolved
from dhkit.description.traversal import with_values
from dhkit.description.validation import shapes_left_out
from dhkit.display import repr_line
from dhkit.model.drawing import Drawing, Solid

_BASE_COLOR = "#4a4f57"
"""Foot and gripper: dark, to tell them from links."""
_PALETTE = ("#e6e2da", "#b4bac4")
"""Links 1, 2 ... in turn: neutral, so that colors are left to axes, curves, ghosts and the tool's path."""
_IDENTITY: Array = np.eye(4)


@dataclass(frozen=True, eq=False)
class Part:
    """One solid that moves with a link."""

    link: int
    """The DH frame that it is fixed to: 0 (the base) to n."""
    geometry: Geometry
    """Sizes in m, numbers without parameters; cylinders and capsules lie along z, centred."""
    T_body_part: Array
    """The solid in the frame of its body, shape (4, 4), m."""
    color: str
    """``#rrggbb``."""
    file: Path | None = None
    """The mesh's file; None for other geometry."""
    body: int = 0
    """Number of its body in the link, from 0: links that were locked together remain bodies of one link."""
    T_link_body: Array = field(default_factory=lambda: np.eye(4))
    """Frame of the body in DH frame ``link``, shape (4, 4), m: that of the link before it was locked."""

    @cached_property
    def T_link_part(self) -> Array:
        """The solid in DH frame ``link``, shape (4, 4), m."""
        T: Array = self.T_link_body @ self.T_body_part
        return T

    def __repr__(self) -> str:
        return repr_line(
            "Part", f"link {self.link}", f"{type(self.geometry).__name__.lower()}, {self.color}"
        )


@takes_robot
def link_parts(description: Description) -> tuple[Part, ...]:
    """Return the solids of an arm's links, from the base to the tool.

    A link with shapes in its description has those, without meshes whose files are missing or unreadable, see
    :func:`missing_shapes`. A link without any is drawn from the table, and so is the tool: a gripper that reaches along
    the tool's z (along x_n where the arm has no tool and ends in a common normal, as planar arms do) and opens along
    its x. A description that is not ``drawn``, such as one from a URDF with its own shapes, gets none of that unless it
    has no shape at all.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    tuple[Part, ...]
        Solids with their link, from 0 for the base, their place in the link's frame and their colour.

    Examples
    --------
    >>> from dhkit.description.table_rows import from_dh
    >>> parts = link_parts(from_dh([(0, 0.4, 0, "pi/2"), (0, 0, 0.3, 0)]))
    >>> sorted({part.link for part in parts})
    [0, 1, 2]
    """
    described, drawn = _parts(description)
    parts = [own or others for own, others in zip(described, drawn, strict=True)]
    return tuple(chain.from_iterable(parts))


MeshVersions: TypeAlias = tuple[Path | None, tuple[tuple[int, int, int] | None, ...]]
"""Folder of a robot's meshes, and of each file its size, time of change and inode, None if it is missing."""


def mesh_versions(description: Description) -> MeshVersions:
    """Return the dependencies of a cache of a robot's shapes beside the description: the files of its meshes.

    A file that is replaced has another version, and values computed from it are computed again.
    """
    folder = description.mesh_folder
    if folder is None:
        return None, ()
    return folder, tuple(_version(f"{folder}/{path}") for path in _mesh_paths(description))


@lru_cache(maxsize=256)
def _mesh_paths(description: Description) -> tuple[str, ...]:
    """Return the paths of a robot's meshes, as its shapes name them."""
    own = (
        description.base.shapes,
        *(joint.shapes for joint in description.joints),
        description.tool.shapes,
    )
    geometries = [shape.geometry for shape in chain.from_iterable(own)]
    meshes = [geometry for geometry in geometries if isinstance(geometry, Mesh)]
    return tuple(dict.fromkeys(mesh.path.replace("\\", "/") for mesh in meshes))


def _version(file: str) -> tuple[int, int, int] | None:
    try:
        status = os.stat(file)  # noqa: PTH116 - a Path takes longer than the call, which every distance makes
    except (OSError, ValueError):
        return None
    return status.st_size, status.st_mtime_ns, status.st_ino


def links_without_shapes(description: Description) -> tuple[int, ...]:
    """Return the links without any shape, 1 to n: their meshes are missing, or they have none."""
    shown = {part.link for part in link_parts(description)}
    return tuple(link for link in range(1, description.n + 1) if link not in shown)


def missing_shapes(description: Description) -> tuple[str, ...]:
    """Return, in words, the shapes that are missing from an arm's parts because their meshes cannot be read.

    They are shapes of the description, and those of the file that it comes from, which its notes name.
    """
    places = ["the base", *(f"link {i + 1}" for i in range(description.n)), "the tool"]
    own = (
        description.base.shapes,
        *(joint.shapes for joint in description.joints),
        description.tool.shapes,
    )
    found = []
    for place, shapes in zip(places, own, strict=True):
        for shape in shapes:
            mesh = shape.geometry
            if isinstance(mesh, Mesh) and _mesh_file(description, mesh) is None:
                found.append(f"mesh {mesh.path!r} of {place}, which cannot be read")
    return (*found, *shapes_left_out(description.notes))


def _mesh_file(description: Description, mesh: Mesh) -> Path | None:
    """Return the file of a mesh; None if it is missing or cannot be read."""
    file = inside(description.mesh_folder, mesh.path, "shape.mesh")
    return file if file is not None and is_mesh_file(file) else None


def with_drawn_shapes(description: Description) -> Description:
    """Return the same arm with the solids that are drawn from its table as shapes of its links.

    A change of the table, such as a locked joint, moves them then, and does not draw others.
    """
    described, drawn = _parts(description)
    explicit: list[tuple[Shape, ...]] = []
    own = (
        description.base.shapes,
        *(joint.shapes for joint in description.joints),
        description.tool.shapes,
    )
    for given, here, others in zip(own, described, drawn, strict=True):
        solids = tuple(
            Shape(part.geometry, placement_of_pose(part.T_link_part, "shape"), part.color)
            for part in others
        )
        # Meshes that cannot be read stay missing.
        explicit.append(given if here else (*given, *solids))
    base, *links, at_tool = explicit
    if not described[-1]:  # drawn in the frame of the last link
        links[-1] = (*links[-1], *at_tool)
        at_tool = ()
    return replace(
        description,
        base=replace(description.base, shapes=base),
        joints=tuple(
            replace(joint, shapes=shapes)
            for joint, shapes in zip(description.joints, links, strict=True)
        ),
        tool=replace(description.tool, shapes=at_tool),
        drawn=False,
    )


def _parts(description: Description) -> tuple[list[list[Part]], list[list[Part]]]:
    """Return the described and the drawn parts of the base, each link and the tool; drawn are those without shapes."""
    n = description.n
    T_last_tool = description.numbers.T_last_tool
    arm = Drawing(description)
    colors = [_BASE_COLOR, *(_PALETTE[i % len(_PALETTE)] for i in range(n))]
    own = (description.base.shapes, *(joint.shapes for joint in description.joints))
    described = [
        _described_parts(description, shapes, i, colors[i]) for i, shapes in enumerate(own)
    ]
    at_tool = _tool_parts(description, described[-1])
    if any(described) and not description.drawn:
        return [*described, at_tool], [[] for _ in range(n + 2)]
    drawn = [
        [] if parts else _drawn_parts(i, arm.link(i), colors[i])
        for i, parts in enumerate(described)
    ]
    gripper: list[Part] = []
    if not at_tool and (not described[-1] or not np.array_equal(T_last_tool, _IDENTITY)):
        gripper = [
            *_drawn_parts(n, arm.neck(), colors[-1]),
            *_drawn_parts(n, arm.gripper(), _BASE_COLOR),
        ]
    return [*described, at_tool], [*drawn, gripper]


def _drawn_parts(link: int, solids: Iterable[Solid], color: str) -> list[Part]:
    return [Part(link, geometry, T, color) for geometry, T in solids]


def _tool_parts(description: Description, last_link: Sequence[Part]) -> list[Part]:
    """Return the tool's shapes as parts of the last body of the last link."""
    n = description.n
    T_last_tool = description.numbers.T_last_tool
    in_tool = _described_parts(description, description.tool.shapes, n, _BASE_COLOR)
    body, T_link_body = (
        (last_link[-1].body, last_link[-1].T_link_body) if last_link else (0, _IDENTITY)
    )
    T_body_tool = (
        T_last_tool
        if np.array_equal(T_link_body, _IDENTITY)
        else np.linalg.solve(T_link_body, T_last_tool)
    )
    return [
        replace(
            part, T_body_part=T_body_tool @ part.T_link_part, body=body, T_link_body=T_link_body
        )
        for part in in_tool
    ]


def _described_parts(
    description: Description, shapes: Sequence[Shape], link: int, color: str
) -> list[Part]:
    """Return shapes of a link as parts, without meshes whose files are missing or unreadable."""
    values = resolved(description.parameters)
    frames = dict.fromkeys(shape.frame for shape in shapes)
    poses = {frame: matrix(frame, values) for frame in frames}
    parts: list[Part] = []
    for shape in shapes:
        geometry = shape.geometry
        file = None
        if isinstance(geometry, Mesh):
            file = _mesh_file(description, geometry)
            if file is None:
                continue
        T_body_part = matrix(shape.placement, values)
        own_color = shape.color or color
        T_link_body = poses[shape.frame]
        parts.append(
            Part(
                link,
                with_values(geometry, values),
                T_body_part,
                own_color,
                file,
                shape.body,
                T_link_body,
            )
        )
    return parts
