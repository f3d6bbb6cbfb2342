"""CAD assemblies as robots: parts exported in the READY pose, moved into the DH frames of their links.

The export gives the position of every part in the assembly, and the table the pose of every frame in the READY pose. So
a vertex v of link i in assembly coordinates is (T_i^0)^-1 v in frame i (Cao 2011, steps 1, 2 and 4).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import (
    Array,
    Base,
    Description,
    Joint,
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
from dhkit.description.files import whole_folder
from dhkit.description.poses import inverse_pose
from dhkit.display import counted, html_block, html_lines, html_table, repr_line
from dhkit.errors import DescriptionError, ModelError
from dhkit.model.cad_masses import LinkBody, StatedMasses
from dhkit.model.cad_parts import CadPart, cad_parts, simplified
from dhkit.model.cad_units import (
    UNITS,
    Assembly,
    check_positions,
    check_size,
    distant_part_warnings,
    unit_of,
)
from dhkit.model.robot_folder import MESHES, copy_files, mesh_paths, model_errors
from dhkit.model.shape_inertia import convex_hull
from dhkit.model.stl import binary_stl
from dhkit.model.triangle_mesh import TriangleMesh, joined_meshes
from dhkit.model.urdf import urdf_text

_ROBOT_FILE = "robot.toml"
_URDF_FILE = "robot.urdf"
_USUAL_SIZES = (0.1, 20.0)
"""Size of an assembly as a share of the arm's length, outside of which a stated unit is probably wrong."""


@dataclass(frozen=True, eq=False)
class CadImport:
    """An arm with the shapes of its CAD parts."""

    description: Description
    """The table as it was, with the parts as shapes and with bodies from the stated masses."""
    meshes: Mapping[int, TriangleMesh]
    """Meshes by link, in the link's DH frame, m; link 0 is the base, in frame 0."""
    notes: tuple[str, ...]
    """Findings, choices and changes, a line each."""

    def write(self, directory: str | Path, *, force: bool = False) -> tuple[Path, ...]:
        """Write ``robot.toml``, ``robot.urdf`` and ``meshes/``, all or nothing; return the files.

        ``meshes/linkN.stl`` is the visible shape, in single precision, ``meshes/linkN_hull.stl`` its convex hull,
        which the URDF names for collisions.

        Parameters
        ----------
        directory
            The folder: new, empty, or with ``force`` one that an earlier import made.
        force
            Whether an earlier import in the folder is replaced; a folder with any other file is refused all the same.

        Raises
        ------
        ModelError
            The folder has content already, or cannot be written.
        """
        folder = Path(directory)
        with model_errors(folder):
            if folder.exists() and not folder.is_dir():
                raise ModelError(f"{folder} is not a folder; expected a new folder")
            has_content = folder.exists() and any(folder.iterdir())
            if has_content and not force:
                again = (
                    "; --force (force=True) replaces an earlier import"
                    if _is_import(folder)
                    else ""
                )
                raise ModelError(f"{folder} is not empty; expected a new folder{again}")
            if has_content and not _is_import(folder):
                raise ModelError(
                    f"{folder} has files that an import does not make; expected a new folder"
                )
            with whole_folder(folder) as complete:
                names = self._write_files(complete)
        return tuple(folder / name for name in names)

    def __repr__(self) -> str:
        triangles = sum(len(mesh.faces) for mesh in self.meshes.values())
        text = f"shapes of {counted(len(self.meshes), 'link')}, {triangles} triangles"
        return repr_line("CadImport", self.description.name, text)

    def _repr_html_(self) -> str:
        rows = []
        for link, mesh in self.meshes.items():
            size = " x ".join(f"{x:.4g}" for x in np.ptp(mesh.bounds, axis=0))
            rows.append((str(link), str(len(mesh.faces)), size))
        table = html_table(("link", "triangles", "box around it [m]"), rows, align="rrl")
        return html_block(f"{self.description.name} from CAD", table, html_lines(self.notes))

    def _write_files(self, folder: Path) -> list[str]:
        """Write all files; return their names. Meshes that the table had before, such as the tool's, are copied."""
        description = self.description
        hulls = dict[str, str]()
        files: dict[str, bytes] = {}
        for link, mesh in self.meshes.items():
            name = _mesh_path(link)
            files[name] = binary_stl(f"link {link} of {description.name}, m, dhkit", mesh.corners)
            try:
                hull = convex_hull(mesh)
            except ModelError:  # flat: collisions use the mesh itself
                continue
            hulls[name] = name.replace(".stl", "_hull.stl")
            files[hulls[name]] = binary_stl(
                f"hull of link {link} of {description.name}, m, dhkit", hull.corners
            )
        (folder / MESHES).mkdir()
        for name, content in files.items():
            write_atomically(folder / name, content)
        others = {
            path: inside(description.mesh_folder, path, "shape.mesh")
            for path in mesh_paths(description)
            if path not in files
        }
        copies = {
            path: file for path, file in others.items() if file is not None and file.is_file()
        }
        copy_files(copies, folder)
        write_robot(description, folder / _ROBOT_FILE)
        written = read_robot(folder / _ROBOT_FILE)
        text = urdf_text(
            written, mesh_path=lambda path: path, collision_path=lambda path: hulls.get(path, path)
        )
        write_atomically(folder / _URDF_FILE, text)
        return [_ROBOT_FILE, _URDF_FILE, *files, *copies]


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

    Returns
    -------
    CadImport
        The description with its new shapes and bodies, and for each part what was found.

    Raises
    ------
    ModelError
        A part that is missing, cannot be assigned or read, was moved on export, or whose unit is not clear: one line.

    Examples
    --------
    >>> from pathlib import Path
    >>> from trimesh.creation import box
    >>> from dhkit.description import library_robot
    >>> Path("parts").mkdir()
    >>> size = Path("parts/link1.stl").write_bytes(box(bounds=[[0, -30, 0], [500, 30, 40]]).export(file_type="stl"))
    >>> size = Path("parts/link2.stl").write_bytes(box(bounds=[[500, -30, 0], [900, 30, 40]]).export(file_type="stl"))
    >>> imported = import_cad("parts", library_robot("planar2r"), unit="mm", q=[0, 0], density=2700)
    >>> [round(float(joint.body.mass), 3) for joint in imported.description.joints]
    [3.24, 2.592]
    """
    folder = Path(folder)
    description = description_of(description)
    if unit is not None and unit not in UNITS:
        raise ModelError(f"unit is {unit[:20]!r}; expected one of {', '.join(UNITS)}")
    stated = StatedMasses.of(description.n, density, mass, [Path(report) for report in reports])
    pose, pose_note = _export_pose(description, q)
    parts, parts_note = cad_parts(folder, description.n, files=files, simplify=simplify)
    all_parts = chain.from_iterable(parts.values())
    check_positions({part.name: part.mesh for part in all_parts}, str(folder))
    assembly, unit_note, is_usual = _in_metres(
        folder, description, world_to_frames(description, pose), parts, unit
    )
    notes = [
        parts_note,
        pose_note,
        unit_note if is_usual else f"warning: {unit_note}",
        *stated.notes,
    ]
    notes += distant_part_warnings(assembly)

    meshes = {}
    bodies = {}
    # A vertex of the part of link i is v_i = T_world_i^-1 v_world in the link's frame.
    to_frames = [inverse_pose(T_world_i) for T_world_i in assembly.frames]
    placed_meshes = dict(assembly.meshes)
    del assembly  # frees the memory of each mesh once it is moved
    for link, several in parts.items():
        own = [mesh.moved(to_frames[link]) for mesh in placed_meshes.pop(link)]
        bodies[link] = stated.body(link, own, to_frames[link])
        if simplify is not None:
            own = [
                simplified(mesh, simplify, part.name)
                for mesh, part in zip(own, several, strict=True)
            ]
        meshes[link] = joined_meshes(own)
        notes.append(_link_note(link, several, meshes[link], bodies[link]))
    for link in sorted((set(stated.masses) | set(stated.reports)) - set(parts)):
        if link in stated.masses:
            raise ModelError(f"{folder}: a mass of link {link}, which has no part")
        bodies[link] = stated.body(link, [], to_frames[link])
    try:
        with_parts = _with_parts(description, meshes, bodies)
    except DescriptionError as error:
        raise ModelError(f"{folder}: {error} ({unit_note})") from None
    return CadImport(with_parts, meshes, tuple(notes))


def _export_pose(description: Description, q: ArrayLike | None) -> tuple[Array, str]:
    """Return the joint values in the pose of the export, shape (n,), and a note on their source."""
    ready = description.numbers.configurations.get("ready")
    if q is not None:
        pose = joint_vector(description, q)
        source = "as given"
    elif ready is not None:
        pose = ready
        source = "the configuration ready"
    else:
        return np.zeros(
            description.n
        ), "pose of the export: all joint values 0 (the table has no configuration ready)"
    joints = zip(description.joints, pose.tolist(), strict=True)
    values = ", ".join(f"{x:.4g}" if joint.is_revolute else f"{x:.4g} m" for joint, x in joints)
    return pose, f"pose of the export: {source}: q = {values}"


def _in_metres(
    folder: Path,
    description: Description,
    frames: Array,
    parts: Mapping[int, Sequence[CadPart]],
    unit: str | None,
) -> tuple[Assembly, str, bool]:
    """Return the assembly with meshes in m, a note how their unit was found, and whether its size is usual."""
    units = {part.unit for part in chain.from_iterable(parts.values())}
    file_units = sorted(known for known in units if known is not None)
    without_unit = {}
    for i, several in parts.items():
        if meshes_without_unit := [part.mesh for part in several if part.unit is None]:
            without_unit[i] = meshes_without_unit

    # The option's unit, else the one in which the parts without a unit of their own are as large as the arm.
    found_unit = unit or "m"
    if unit is None and without_unit:
        found_unit = unit_of(Assembly(description, frames, without_unit, str(folder)))

    meshes = {}
    for i, several in parts.items():
        meshes[i] = [part.in_metres(unit, found_unit) for part in several]
    assembly = Assembly(description, frames, meshes, str(folder))
    listed = " and ".join(f"{file_unit:g} m" for file_unit in file_units)
    if unit is None and file_units:
        check_size(assembly)
        others = f"; {found_unit} for the other files, found by size" if without_unit else ""
        return (
            assembly,
            f"unit: {listed}, as the files state it{others}: {assembly.sizes_text}",
            True,
        )
    size = assembly.size
    length = description.reach
    sizes = f"the assembly is {size:.4g} m across, the arm {length:.4g} m long"
    if unit is None:
        return assembly, f"unit: {found_unit}, found by size: {sizes}", True
    is_usual = _USUAL_SIZES[0] * length <= size <= _USUAL_SIZES[1] * length
    is_overridden = any(file_unit != UNITS[unit] for file_unit in file_units)
    override = f", for all files instead of the {listed} that files state" if is_overridden else ""
    return assembly, f"unit: {unit}, as stated{override}: {sizes}", is_usual


def _link_note(
    link: int, parts: Sequence[CadPart], mesh: TriangleMesh, body: LinkBody | None
) -> str:
    note = f"link {link}: {', '.join(part.name for part in parts)}, {len(mesh.faces)} triangles"
    original = sum(len(part.mesh.faces) for part in parts)
    if original > len(mesh.faces):
        note += f" of {original}"
    return (
        note if body is None else f"{note}, {body.properties.mass:.6g} kg; {'; '.join(body.notes)}"
    )


def _mesh_path(link: int) -> str:
    return f"{MESHES}/link{link}.stl"


def _with_parts(
    description: Description,
    meshes: Mapping[int, TriangleMesh],
    link_bodies: Mapping[int, LinkBody | None],
) -> Description:
    """Return the description with new shapes and bodies; the table keeps its expressions."""
    shapes = {i: (Shape(Mesh(_mesh_path(i)), color=mesh.colour),) for i, mesh in meshes.items()}
    bodies = {i: body.properties.body() for i, body in link_bodies.items() if body is not None}

    def with_part(i: int, joint: Joint) -> Joint:
        replaced = {
            key for key, links in (("shape", shapes.keys()), ("body", bodies.keys())) if i in links
        }
        return replace(
            joint,
            shapes=shapes.get(i, joint.shapes),
            bodies=(bodies[i],) if i in bodies else joint.bodies,
            assumed=tuple(key for key in joint.assumed if key not in replaced),
        )

    old = description.base
    base = Base(old.placement, shapes.get(0, old.shapes), bodies.get(0, old.body))
    joints = tuple(with_part(i, joint) for i, joint in enumerate(description.joints, start=1))
    source = f"Shapes of links {_link_list(shapes)}"
    if bodies:
        source += f" and bodies of links {_link_list(bodies)}"
    notes = "\n".join(
        text
        for text in (description.notes, f"{source} are from CAD parts (dhkit import-cad).")
        if text
    )
    return replace(description, joints=joints, base=base, notes=notes)


def _link_list(links: Iterable[int]) -> str:
    return ", ".join(map(str, sorted(links)))


def _is_import(folder: Path) -> bool:
    """Return whether a folder holds what :meth:`CadImport.write` makes, and nothing else."""
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}
    others = {name for name in names if not name.lower().endswith((".stl", ".dae", ".obj"))}
    return others == {_ROBOT_FILE, _URDF_FILE}
