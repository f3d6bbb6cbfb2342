"""CAD assemblies as robots: parts exported in the READY pose, moved into the DH frames of their links.

The export knows where every part stands in the assembly, and the table where every frame stands in that pose. So a
vertex v of link i in assembly coordinates is (T_i^0)^-1 v in frame i (Cao 2011, steps 1, 2 and 4).
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import (
    Array,
    Base,
    Description,
    Joint,
    JointType,
    Mesh,
    Robot,
    Shape,
    description_of,
    joint_vector,
    read_robot,
    world_to_frames,
    write_atomically,
    write_robot,
)
from dhkit.description.assets import inside
from dhkit.display import counted, html_block, html_lines, html_table, repr_line
from dhkit.errors import DescriptionError, ModelError
from dhkit.model.cad_masses import LinkBody, StatedMasses
from dhkit.model.cad_parts import CadPart, cad_parts, simplified
from dhkit.model.cad_units import UNITS, check_positions, check_size, far_from_axes, size_of, unit_of
from dhkit.model.shape_inertia import convex_hull
from dhkit.model.stl import binary_stl
from dhkit.model.triangle_mesh import TriangleMesh, joined_meshes
from dhkit.model.urdf import urdf_text

ROBOT, URDF, MESHES = "robot.toml", "robot.urdf", "meshes"
FOREIGN_SIZE = (0.1, 20.0)
"""Size of an assembly as a share of the arm's length, beyond which a stated unit is probably wrong."""


@dataclass(frozen=True, eq=False)
class CadImport:
    """An arm with the shapes of its CAD parts."""

    description: Description
    """The table as it was, with the parts as shapes and what was stated of their masses as bodies."""
    meshes: Mapping[int, TriangleMesh]
    """By link, in its DH frame, m; link 0 is the base, in frame 0."""
    notes: tuple[str, ...]
    """What was found, chosen and changed, a line each."""

    def write(self, directory: str | Path) -> tuple[Path, ...]:
        """Write ``robot.toml``, ``robot.urdf`` and ``meshes/``, all or nothing; return the files.

        ``meshes/linkN.stl`` is what is seen, in single precision, ``meshes/linkN_hull.stl`` its convex hull, which the
        URDF names for collisions.

        Raises
        ------
        ModelError
            The folder has content already, or cannot be written.
        """
        target = Path(directory)
        try:
            if target.exists() and (not target.is_dir() or any(target.iterdir())):
                what = "is not empty" if target.is_dir() else "is not a folder"
                raise ModelError(f"{target} {what}; expected a new folder")
            target.absolute().parent.mkdir(parents=True, exist_ok=True)
            # Written beside it under another name and renamed: a folder that is there is whole.
            with tempfile.TemporaryDirectory(dir=target.absolute().parent, prefix=f".{target.name}.") as holder:
                made = Path(holder) / "made"
                made.mkdir()
                names = self._write_all(made)
                if target.exists():
                    target.rmdir()
                made.replace(target)
        except OSError as error:
            raise ModelError(f"{error.filename or target}: {error.strerror or error}") from None
        return tuple(target / name for name in names)

    def __repr__(self) -> str:
        triangles = sum(len(mesh.faces) for mesh in self.meshes.values())
        said = f"shapes of {counted(len(self.meshes), 'link')}, {triangles} triangles"
        return repr_line("CadImport", self.description.name, said)

    def _repr_html_(self) -> str:
        rows = [
            (str(link), str(len(mesh.faces)), " x ".join(f"{x:.4g}" for x in np.ptp(mesh.bounds, axis=0)))
            for link, mesh in self.meshes.items()
        ]
        table = html_table(("link", "triangles", "box around it [m]"), rows, align="rrl")
        return html_block(f"{self.description.name} from CAD", table, html_lines(self.notes))

    def _write_all(self, folder: Path) -> list[str]:
        (folder / MESHES).mkdir()
        names, hulls = [ROBOT, URDF], {}
        for link, mesh in self.meshes.items():
            name = _mesh_path(link)
            write_atomically(
                folder / name, binary_stl(f"link {link} of {self.description.name}, m, dhkit", mesh.corners)
            )
            names.append(name)
            try:
                hull = convex_hull(mesh)
            except ModelError:  # flat: nothing that could be hit from the side
                continue
            hulls[name] = name.replace(".stl", "_hull.stl")
            content = binary_stl(f"hull of link {link} of {self.description.name}, m, dhkit", hull.corners)
            write_atomically(folder / hulls[name], content)
            names.append(hulls[name])
        names += self._copy_others(folder, names)
        write_robot(self.description, folder / ROBOT)
        again = read_robot(folder / ROBOT)
        text = urdf_text(again, mesh_path=lambda path: path, collision_path=lambda path: hulls.get(path, path))
        write_atomically(folder / URDF, text)
        return names

    def _copy_others(self, folder: Path, taken: Sequence[str]) -> list[str]:
        """Copy meshes that the table had before, such as the tool's, and that no part has replaced."""
        description = self.description
        shapes = [
            *description.base.shapes,
            *description.tool.shapes,
            *(s for j in description.joints for s in j.shapes),
        ]
        copied: list[str] = []
        for shape in shapes:
            if not isinstance(shape.geometry, Mesh) or shape.geometry.path in (*taken, *copied):
                continue
            path = shape.geometry.path
            source = inside(description.mesh_folder, path, "shape")
            if source is not None and source.is_file():
                place = folder / PurePosixPath(path)
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, place)
                copied.append(path)
        return copied


def import_cad(
    folder: str | Path,
    description: Robot,
    *,
    unit: str | None = None,
    q: ArrayLike | None = None,
    density: float | None = None,
    mass: Mapping[int, float] | None = None,
    reports: Sequence[str | Path] = (),
    simplify: int | None = None,
    files: Mapping[int, Sequence[str]] | None = None,
) -> CadImport:
    """Return an arm with the parts of a CAD assembly as its links.

    Parameters
    ----------
    folder
        Mesh files, one a link, exported in one pose and in the coordinates of the assembly, which are the world's; or
        a MAT file of them.
    description
        The DH table; everything of it stays but the shapes and bodies that the import replaces.
    unit
        Of the files' coordinates: m, cm, mm or in; found by the size of the assembly unless given.
    q
        Joint values in the pose of the export, shape (n,), rad and m; the configuration ``ready`` unless given, and
        zero where the table has none.
    density
        kg/m^3, of all links about which nothing else is stated. Without density, masses and reports no body is made.
    mass
        kg, by link.
    reports
        Mass properties from the CAD program, in assembly coordinates; see
        :func:`dhkit.model.mass_report.read_mass_report`.
    simplify
        Triangles that a part keeps at most; masses are those of the whole part.
    files
        Names of files by link, where their names do not say it; by -1 those that are left out.

    Raises
    ------
    ModelError
        A part that is missing, cannot be told or read, was moved on export, or whose unit is not clear: one line.
    """
    folder, description = Path(folder), description_of(description)
    if unit is not None and unit not in UNITS:
        raise ModelError(f"unit is {unit[:20]!r}; expected one of {', '.join(UNITS)}")
    stated = StatedMasses.of(description.n, density, mass, [Path(report) for report in reports])
    pose, pose_note = _pose(description, q)
    frames = world_to_frames(description, pose)
    parts, found_notes = cad_parts(folder, description.n, files=files, simplify=simplify)
    check_positions({part.name: part.mesh for several in parts.values() for part in several}, str(folder))
    standing, unit_note = _in_metres(folder, description, frames, parts, unit)
    notes = [*found_notes, pose_note, unit_note, *stated.notes]

    notes += far_from_axes(description, frames, standing)

    meshes, bodies = {}, {}
    for link, several in parts.items():
        T_frame_world = _inverse(frames[link])
        own = [mesh.moved(T_frame_world) for mesh in standing.pop(link)]
        bodies[link] = stated.body(link, own, T_frame_world)
        if simplify is not None:
            own = [simplified(mesh, simplify, part.name) for mesh, part in zip(own, several, strict=True)]
        meshes[link] = joined_meshes(own)
        notes.append(_link_note(link, several, meshes[link], bodies[link]))
    for link in sorted((set(stated.masses) | set(stated.reports)) - set(parts)):
        if link in stated.masses:
            raise ModelError(f"{folder}: a mass of link {link}, which has no part")
        bodies[link] = stated.body(link, [], _inverse(frames[link]))
    try:
        made = _with_parts(description, meshes, bodies)
    except DescriptionError as error:
        raise ModelError(f"{folder}: {error} ({unit_note.removeprefix('warning: ')})") from None
    return CadImport(made, meshes, tuple(notes))


def _pose(description: Description, q: ArrayLike | None) -> tuple[Array, str]:
    if q is not None:
        given = joint_vector(description, q)
        return given, f"pose of the export: as given{_joint_values(description, given)}"
    ready = description.numbers.configurations.get("ready")
    if ready is not None:
        return ready, f"pose of the export: the configuration ready{_joint_values(description, ready)}"
    return np.zeros(description.n), "pose of the export: all joint values 0 (the table has no configuration ready)"


def _joint_values(description: Description, q: Array) -> str:
    kinds = zip(description.joints, q.tolist(), strict=True)
    values = ", ".join(f"{x:.4g} m" if joint.type is JointType.PRISMATIC else f"{x:.4g}" for joint, x in kinds)
    return f": q = {values}"


def _inverse(T: Array) -> Array:
    inverse = np.eye(4)
    inverse[:3, :3] = T[:3, :3].T
    inverse[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return inverse


def _in_metres(
    folder: Path,
    description: Description,
    frames: Array,
    parts: Mapping[int, Sequence[CadPart]],
    unit: str | None,
) -> tuple[dict[int, list[TriangleMesh]], str]:
    """Return the meshes of each link in m, where they stand, and how their unit was found."""
    without = {i: [part.mesh for part in several if part.unit is None] for i, several in parts.items()}
    without = {i: meshes for i, meshes in without.items() if meshes}
    stated = sorted({part.unit for several in parts.values() for part in several if part.unit is not None})
    found = unit or (unit_of(description, frames, without, str(folder)) if without else "m")
    standing = {i: [part.metres(unit, UNITS[found]) for part in several] for i, several in parts.items()}
    listed = " and ".join(f"{one:g} m" for one in stated)
    if unit is None and stated:
        across = check_size(description, frames, standing, str(folder))
        others = f"; {found} for the other files, found by size" if without else ""
        return standing, f"unit: {listed}, as the files state it{others}: {across}"
    size = size_of(standing)
    across = f"the assembly is {size:.4g} m across, the arm {description.reach:.4g} m long"
    if unit is None:
        return standing, f"unit: {found}, found by size: {across}"
    low, high = (share * description.reach for share in FOREIGN_SIZE)
    odd = "" if low <= size <= high else "warning: "
    over = f", for all files in place of the {listed} that files state" if any(o != UNITS[unit] for o in stated) else ""
    return standing, f"{odd}unit: {unit}, as stated{over}: {across}"


def _link_note(link: int, parts: Sequence[CadPart], mesh: TriangleMesh, body: LinkBody | None) -> str:
    names = ", ".join(part.name for part in parts)
    said = f"link {link}: {names}, {len(mesh.faces)} triangles"
    before = sum(len(part.mesh.faces) for part in parts)
    if before > len(mesh.faces):
        said += f" of {before}"
    if body is None:
        return said
    return f"{said}, {body.properties.mass:.6g} kg; " + "; ".join(body.notes)


def _mesh_path(link: int) -> str:
    return f"{MESHES}/link{link}.stl"


def _with_parts(
    description: Description, meshes: Mapping[int, TriangleMesh], bodies: Mapping[int, LinkBody | None]
) -> Description:
    """Return the description with new shapes and bodies; its numbers stay the expressions that they were."""
    shapes = {i: (Shape(Mesh(_mesh_path(i)), color=mesh.colour),) for i, mesh in meshes.items()}
    made = {i: body.properties.body() for i, body in bodies.items() if body is not None}

    def changed(i: int, joint: Joint) -> Joint:
        replaced = ({"shape"} if i in shapes else set()) | ({"body"} if i in made else set())
        return replace(
            joint,
            shapes=shapes.get(i, joint.shapes),
            bodies=(made[i],) if i in made else joint.bodies,
            assumed=tuple(key for key in joint.assumed if key not in replaced),
        )

    old = description.base
    base = Base(old.placement, shapes.get(0, old.shapes), made.get(0, old.body))
    joints = tuple(changed(i, joint) for i, joint in enumerate(description.joints, start=1))
    said = f"Shapes of links {_listed(shapes)}"
    if made:
        said += f" and bodies of links {_listed(made)}"
    notes = "\n".join(text for text in (description.notes, f"{said} are from CAD parts (dhkit import-cad).") if text)
    return replace(description, joints=joints, base=base, notes=notes)


def _listed(links: Iterable[int]) -> str:
    return ", ".join(map(str, sorted(links)))
