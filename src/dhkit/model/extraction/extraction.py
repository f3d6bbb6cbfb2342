"""The door: a chain of a URDF as a description, with what was done and how far it is from the file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from dhkit.description import (
    Array,
    Base,
    Body,
    Box,
    Capsule,
    Convention,
    Cylinder,
    Description,
    Drive,
    Geometry,
    Joint,
    JointType,
    Mesh,
    Named,
    Shape,
    Sphere,
    Tool,
    world_to_frames,
)
from dhkit.description.table import DHTable
from dhkit.description.validation import MAX_JOINTS
from dhkit.display import html_block, html_lines, html_table, repr_line
from dhkit.errors import DhkitError, ModelError
from dhkit.expressions import ZERO, Expression, exact
from dhkit.model.extraction import numbers
from dhkit.model.extraction.residual import Original, Residual
from dhkit.model.extraction.table import Table, chain_axes, near_parallel, tidiest_table
from dhkit.model.mesh_paths import MeshFinder
from dhkit.model.urdf_chain import Chain, Side, only_tip, read_chain
from dhkit.model.urdf_tree import UrdfJoint, UrdfShape

AGREED = 5e-10
"""Numbers are rounded while M and g stay this close to the URDF, relative: a half of what is asked of a table."""
AGREED_TOOL = 5e-11
"""The same for the tool's pose, m and rotation entries."""
GRAVITY = np.array([0.0, 0.0, -9.81])
GRAVITY_DECIMALS = 14
"""Decimals of gravity: torques about axes that are nearly vertical are small, and are to be right all the same."""
MAX_SHAPES = 200
"""Shapes of a link that a description holds."""
LISTED = 5
"""Meshes that are left out are named one by one up to this many."""
MAX_NAME = 64
MAX_NOTES = 20_000
"""Characters of notes that a robot file holds."""
BEYOND = 1e-6
"""Share of the arm's size by which no table may be off: tilts that doubles do not hold leave 3e-8."""
SHOWN = 12
"""Decimals of where shapes stand, m and rad: they are only seen."""
RESERVED = re.compile(r"(world|base|tool|dh\d+|link\d+)(_fixed)?")
"""Names that the URDF of a description takes itself."""


@dataclass(frozen=True)
class Extraction:
    """A description taken from a URDF.

    Attributes
    ----------
    description
        The robot: table, base, tool, bodies, limits, friction and shapes. Joint values mean what they mean in the URDF.
    residual
        How far its tool, M and g are from the file's, over random states.
    notes
        What was odd about the file and what was done; also in ``description.notes``.
    changes
        What ``as_designed`` read differently from how it is written.
    decimals
        What its numbers are rounded to; None: they are kept as computed.
    """

    description: Description
    residual: Residual
    notes: tuple[str, ...]
    changes: tuple[str, ...]
    decimals: int | None

    def __repr__(self) -> str:
        said = f"{self.description.kinds}, {self.description.convention.value} DH, off by {self.residual.largest:.1e}"
        return repr_line("Extraction", self.description.name, said)

    def _repr_html_(self) -> str:
        kept = "as computed" if self.decimals is None else f"rounded to {self.decimals} decimals"
        facts = [("residual", str(self.residual)), ("numbers", kept)]
        lines = html_lines([*self.changes, *self.notes])
        title = f"{self.description.name} from a URDF"
        return html_block(title, html_table((), facts), DHTable.of(self.description)._repr_html_(), lines)


def extract_dh(
    path: str | Path,
    base: str | None = None,
    tip: str | None = None,
    *,
    convention: Literal["standard", "modified"] = "standard",
    side: Side = "freeze",
    as_designed: bool = False,
    package_dirs: Sequence[str | Path] = (),
    name: str | None = None,
) -> Extraction:
    """Return the Denavit-Hartenberg table of a chain of a URDF, with bodies, limits and shapes.

    Parameters
    ----------
    path
        The URDF. Its text is never trusted, and no mesh is opened.
    base, tip
        The chain's first and last link: the root, and the end of the only chain, if not given. The base is the world;
        gravity is the root's (0, 0, -9.81) m/s^2 seen from it.
    convention
        Which table.
    side
        What becomes of links behind moving joints beside the chain: ``"freeze"`` carries them along with those joints
        at zero, ``"drop"`` leaves them out.
    as_designed
        Read rounded angles such as 1.5708 as the right angles that they stand for; the result says what that changes.
    package_dirs
        Folders with the packages that ``package://NAME/...`` names.
    name
        The robot's name; the URDF's, with the tip's where it has several chains, if not given.

    Raises
    ------
    ModelError
        The file is refused, or has no such chain.
    """
    known = [one.value for one in Convention]
    if convention not in known:
        raise ModelError(f"convention is {convention!r}; expected one of {', '.join(known)}")
    chain = read_chain(path, base, tip, side=side, as_designed=as_designed)
    if chain.tree.changes:  # what is changed on request must not hide that the file is read wrongly
        Original(read_chain(path, chain.base, chain.tip, side=side)).check_reading()
    return extracted(chain, convention=Convention(convention), package_dirs=package_dirs, name=name)


def extracted(
    chain: Chain,
    *,
    convention: Convention = Convention.STANDARD,
    package_dirs: Sequence[str | Path] = (),
    name: str | None = None,
) -> Extraction:
    """Return the table of a chain that was cut out of a URDF; see :func:`extract_dh`.

    Raises
    ------
    ModelError
        The chain makes no description.
    """
    if not 1 <= len(chain.joints) <= MAX_JOINTS:
        raise ModelError(f"{chain.path}: {len(chain.joints)} joints; expected 1 to {MAX_JOINTS}")
    notes = [*chain.notes]
    original = Original(chain)
    if not chain.tree.changes:
        original.check_reading()
    meshes = MeshFinder(chain.path, package_dirs)
    shapes = _shapes(chain, meshes, notes)
    draft = _Draft(chain, convention, shapes, meshes.mesh_folder, name or _robot_name(chain))
    try:
        table = _best_table(chain, convention, draft, original, notes)
        description, residual, decimals = _rounded(draft, table, original)
    except DhkitError as error:
        raise ModelError(f"{chain.path}: {error}") from None
    if original.model is None:
        notes.append("M and g not compared with the file: Pinocchio is not installed")
    if chain.tree.changes:
        notes.append(f"read as designed: {len(chain.tree.changes)} numbers; the file as written differs by {residual}")
    else:
        notes.append(f"differs from the file by {residual}")
    description = replace(description, notes="\n".join(notes)[:MAX_NOTES])
    return Extraction(description, residual, tuple(notes), chain.tree.changes, decimals)


@dataclass(frozen=True, eq=False)
class _Draft:
    """All of a description but the numbers of its table."""

    chain: Chain
    convention: Convention
    shapes: tuple[tuple[tuple[UrdfShape, str, Array], ...], ...]
    """Of each group: shapes, the mesh's path, and the shape in the base at zero."""
    mesh_folder: Path
    name: str

    def description(self, table: Table, decimals: int | None) -> Description:
        """Return the description of a table, its numbers rounded."""
        chain, bare = self.chain, self._bare(table, decimals)
        # bodies stand where the rounded table has its frames
        frames = world_to_frames(bare, np.zeros(bare.n))
        tool_pose = np.linalg.inv(frames[-1]) @ chain.zero_poses[chain.tip]
        with_bodies = any(chain.tree.links[link].inertial is not None for group in chain.groups[1:] for link in group)
        joints = tuple(
            replace(
                joint,
                bodies=(self._body(i, frames[i], decimals),) if with_bodies else (),
                shapes=self._placed(i, frames[i]),
            )
            for i, joint in enumerate(bare.joints, start=1)
        )
        base_body = self._body(0, frames[0], decimals)
        base = replace(bare.base, shapes=self._placed(0, frames[0]), body=base_body if base_body.mass != ZERO else None)
        tool = Tool(numbers.placement(tool_pose, decimals))
        return replace(bare, joints=joints, base=base, tool=tool)

    def _bare(self, table: Table, decimals: int | None) -> Description:
        """Return the description without bodies, shapes and tool."""
        chain = self.chain
        names = _joint_names(chain.names)
        gravity = chain.T_base_root[:3, :3] @ GRAVITY
        return Description(
            name=self.name,
            convention=self.convention,
            joints=tuple(
                _joint(name, joint, row, decimals)
                for name, joint, row in zip(names, chain.joints, table.rows, strict=True)
            ),
            gravity=numbers.vector(gravity, None if decimals is None else GRAVITY_DECIMALS),
            base=Base(numbers.placement(table.T_base_first, decimals)),
            configurations=_configurations(chain),
            drawn=not any(self.shapes),
            source=f"{chain.path.name}, link {chain.base} to link {chain.tip}",
            mesh_folder=self.mesh_folder,
        )

    def _body(self, i: int, T_base_frame: Array, decimals: int | None) -> Body:
        """Return what moves with joint i (0: the base) as one body in a frame."""
        chain = self.chain
        to_frame = np.linalg.inv(T_base_frame)
        mass, moment, second = 0.0, np.zeros(3), np.zeros((3, 3))
        parts = []
        for link in chain.groups[i]:
            inertial = chain.tree.links[link].inertial
            if inertial is None:
                continue
            T = to_frame @ chain.zero_poses[link]
            com = T[:3, :3] @ inertial.com + T[:3, 3]
            parts.append((inertial.mass, com, T[:3, :3] @ inertial.inertia @ T[:3, :3].T))
            mass, moment = mass + inertial.mass, moment + inertial.mass * com
        center = moment / mass if mass else np.zeros(3)
        for weight, com, inertia in parts:
            arm = com - center
            second += inertia + weight * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return numbers.body(mass, center, second, decimals)

    def _placed(self, i: int, T_base_frame: Array) -> tuple[Shape, ...]:
        to_frame = np.linalg.inv(T_base_frame)
        return tuple(
            Shape(_geometry(shape, path), numbers.placement(to_frame @ T, SHOWN), shape.color)
            for shape, path, T in self.shapes[i]
        )


def _configurations(chain: Chain) -> Named[tuple[Expression, ...]]:
    """Return the zero configuration; ``middle`` of the limits where zero is outside them."""
    limits = [joint.limits for joint in chain.joints]
    outside = [limit for limit in limits if limit is not None and not limit[0] <= 0 <= limit[1]]
    if not outside:
        return Named({"zero": (ZERO,) * len(limits)})
    middle = ((exact(limit[0]) + exact(limit[1])) / 2 if limit in outside and limit else ZERO for limit in limits)
    return Named({"middle": tuple(middle)})


def _best_table(chain: Chain, convention: Convention, draft: _Draft, original: Original, notes: list[str]) -> Table:
    """Return the tidiest table; of nearly parallel axes take the treatment that is nearer to the file."""
    poses = np.array([chain.zero_poses[joint.child] for joint in chain.joints])
    directions = np.array([T[:3, :3] @ joint.axis for T, joint in zip(poses, chain.joints, strict=True)])
    prismatic = [kind == "P" for kind in chain.kinds]
    tip = chain.zero_poses[chain.tip]
    axes = chain_axes(poses, directions, prismatic, tip)
    table = tidiest_table(axes, convention)
    nearly = near_parallel(axes)
    if not nearly:
        return table
    tried = [(original.residual(draft.description(table, None)).tool, axes.parallel_below, table)]
    for _, sine in nearly:
        other = tidiest_table(replace(axes, parallel_below=2 * sine), convention)
        tried.append((original.residual(draft.description(other, None)).tool, 2 * sine, other))
    tried.sort(key=lambda one: one[0])
    (error, below, table), *others = tried
    beside = f"; otherwise {others[0][0]:.1e}" if others else ""
    for i, sine in nearly:
        taken = "as parallel" if sine <= below else "with their own common normal"
        notes.append(
            f"axes {i} and {i + 1} are {sine:.2g} rad from parallel; taken {taken}: tool within {error:.1e}{beside}"
        )
    return table


def _rounded(draft: _Draft, table: Table, original: Original) -> tuple[Description, Residual, int | None]:
    """Return the description with the shortest numbers that leave tool, M and g where they are."""
    kept = draft.description(table, None)
    unrounded = original.residual(kept)
    # what is read as designed, or has nearly parallel axes, is not that near: then rounding may add no more than that
    if not original.chain.tree.changes and unrounded.tool > BEYOND * max(original.size, 1.0):
        raise ModelError(f"no table within {BEYOND:g} of the file: the tool differs by {unrounded.tool:.2g}")
    most_tool, most = (
        bound + (seen if seen > bound else 0.0)
        for bound, seen in (
            (AGREED_TOOL * min(original.size, 1.0), unrounded.tool),
            (AGREED * max(original.size, 1.0), unrounded.largest),
        )
    )
    for decimals in numbers.ROUNDINGS[:-1]:
        description = draft.description(table, decimals)
        residual = original.residual(description)
        if residual.tool <= most_tool and residual.largest <= most:
            return description, residual, decimals
    return kept, unrounded, None


def _joint(name: str, joint: UrdfJoint, row: Array, decimals: int | None) -> Joint:
    theta, d, a, alpha = (float(entry) for entry in row)
    drive = None
    if joint.damping or joint.friction:
        dry = exact(joint.friction)
        drive = Drive(viscous=exact(joint.damping), coulomb=(dry, -dry))
    return Joint(
        type=JointType.PRISMATIC if joint.kind == "prismatic" else JointType.REVOLUTE,
        a=numbers.length(a, decimals),
        alpha=numbers.angle(alpha, decimals),
        d=numbers.length(d, decimals),
        theta=numbers.angle(theta, decimals),
        name=name,
        limits=None if joint.limits is None else (exact(joint.limits[0]), exact(joint.limits[1])),
        velocity=None if joint.velocity is None else exact(joint.velocity),
        effort=None if joint.effort is None else exact(joint.effort),
        drive=drive,
    )


def _geometry(shape: UrdfShape, path: str) -> Geometry:
    sizes = tuple(exact(size) for size in shape.sizes)
    match shape.kind:
        case "mesh":
            return Mesh(path, (sizes[0], sizes[1], sizes[2]))
        case "box":
            return Box((sizes[0], sizes[1], sizes[2]))
        case "sphere":
            return Sphere(sizes[0])
        case "capsule":
            return Capsule(sizes[0], sizes[1])
    return Cylinder(sizes[0], sizes[1])


def _shapes(chain: Chain, meshes: MeshFinder, notes: list[str]) -> tuple[tuple[tuple[UrdfShape, str, Array], ...], ...]:
    """Return what each group of links looks like; what cannot be shown is left out and noted."""
    links = [chain.tree.links[link] for group in chain.groups for link in group]
    visible = any(link.visuals for link in links)
    groups = []
    left_out: list[str] = []
    for group in chain.groups:
        found = list(_group_shapes(chain, group, meshes, left_out, visible=visible))
        if len(found) > MAX_SHAPES:
            notes.append(f"{len(found)} shapes move with link {group[0]!r}; the first {MAX_SHAPES} are shown")
        groups.append(tuple(found[:MAX_SHAPES]))
    notes += left_out[:LISTED]
    if len(left_out) > LISTED:
        notes.append(f"{len(left_out) - LISTED} more meshes left out")
    return tuple(groups)


def _group_shapes(
    chain: Chain, group: Sequence[str], meshes: MeshFinder, left_out: list[str], *, visible: bool
) -> Iterator[tuple[UrdfShape, str, Array]]:
    from dhkit.description.assets import inside
    from dhkit.description.mesh_files import check_mesh_file

    for name in group:
        link = chain.tree.links[name]
        for shape in link.visuals if visible else link.collisions:
            path = ""
            if shape.kind == "mesh":
                try:
                    path = meshes.path(shape.file)
                    inside(meshes.mesh_folder, path, "shape")
                    check_mesh_file(meshes.mesh_folder / path)
                except DhkitError as error:
                    left_out.append(f"link {name!r}: {_without_folder(str(error), meshes.mesh_folder)}; left out")
                    continue
            yield shape, path, chain.zero_poses[name] @ shape.T_link_shape


def _without_folder(message: str, folder: Path) -> str:
    """Shorten paths: notes go into robot files, which others read."""
    return message if folder == folder.parent else message.replace(f"{folder}/", "").replace(str(folder), folder.name)


def _robot_name(chain: Chain) -> str:
    """Return a name: the URDF's, with the tip's where the file has several chains."""
    name = chain.tree.name or chain.path.stem
    alone = chain.base == chain.tree.root and chain.tip == only_tip(chain.tree, chain.base)
    return _plain(name if alone else f"{name}_{chain.tip}", "robot")


def _joint_names(names: Sequence[str]) -> list[str]:
    """Return names that a robot file allows, each once: other characters become underscores."""
    taken: list[str] = []
    for number, name in enumerate(names, start=1):
        plain = _plain(name, f"joint{number}")
        if RESERVED.fullmatch(plain):
            plain = f"{plain}_joint"
        own, count = plain, 1
        while plain in taken:
            count += 1
            plain = f"{own[: MAX_NAME - 4]}_{count}"
        taken.append(plain)
    return taken


def _plain(name: str, otherwise: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_.\-]", "_", name)[:MAX_NAME]
    return plain if re.match(r"[A-Za-z_]", plain) else f"{otherwise}_{plain}"[:MAX_NAME].rstrip("_")
