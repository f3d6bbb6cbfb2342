"""The parts of a CAD export as meshes of each link, in assembly coordinates and in the files' units."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from dhkit.errors import ModelError
from dhkit.model.bounds import BOUNDS
from dhkit.model.cad_files import assign_parts, file_inside, mat_file, mesh_file_names
from dhkit.model.cad_units import UNITS
from dhkit.model.collada import collada_unit
from dhkit.model.mat_parts import mat_parts
from dhkit.model.mesh_reader import mesh_header, read_mesh
from dhkit.model.triangle_mesh import TriangleMesh
from dhkit.packages import imported

_MIN_TRIANGLES = 4
"""Smallest number of triangles that a part may be simplified to."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class CadPart:
    """A mesh of a link as it was exported."""

    name: str
    """The file's name, or the variable's of a MAT file."""
    mesh: TriangleMesh
    unit: float | None = None
    """The unit that its file states, m, as COLLADA files can; then the mesh is in m. None: in the file's unit."""

    def in_metres(self, stated_unit: str | None, found_unit: str) -> TriangleMesh:
        """Return the mesh in m: by the unit that the user states for all files, by its own, or by the one found."""
        if stated_unit is not None:
            return self.mesh.scaled(UNITS[stated_unit] / (self.unit or 1.0))
        return self.mesh.scaled(UNITS[found_unit] if self.unit is None else 1.0)


def cad_parts(
    folder: Path,
    links: int,
    *,
    files: Mapping[int, Sequence[str]] | None = None,
    simplify: int | None = None,
) -> tuple[dict[int, tuple[CadPart, ...]], str]:
    """Read the parts of an assembly.

    Parameters
    ----------
    folder
        A folder of STL, OBJ, PLY and COLLADA files; a MAT file, or a folder that holds one and no meshes.
    links
        Number of joints n.
    files
        Names of files by link; other files are assigned by the numbers in their names.
    simplify
        Whether files over ``BOUNDS.cad_triangles`` are read at all; they are reduced later, by :func:`simplified`.

    Returns
    -------
    tuple
        Parts by link, 0 to n, and a note how they were assigned.

    Raises
    ------
    ModelError
        See :func:`dhkit.model.cad_files.assign_parts` and :func:`dhkit.model.mesh_reader.read_mesh`; a file with too
        many triangles, judged by its header.
    """
    if simplify is not None and simplify < _MIN_TRIANGLES:
        raise ModelError(
            f"simplify is {simplify}; expected the number of triangles to keep, {_MIN_TRIANGLES} at least"
        )
    is_mat = folder.suffix.lower() == ".mat" and not folder.is_dir()
    mat = folder if is_mat else mat_file(folder)
    if mat is not None:
        meshes = mat_parts(mat)
        assignment = assign_parts(tuple(meshes), links, files, str(mat), suffixes=False)
        for name, mesh in meshes.items():
            _check_count(f"{mat}: {name}", len(mesh.faces), simplify)
        parts = {name: CadPart(name, mesh) for name, mesh in meshes.items()}
    else:
        names = mesh_file_names(folder)
        if not names:
            raise ModelError(
                f"{folder}: no mesh files; expected .stl, .obj, .ply or .dae files, or one .mat file"
            )
        assignment = assign_parts(names, links, files, str(folder))
        assigned = chain.from_iterable(assignment.parts.values())
        paths = {name: file_inside(folder, name) for name in assigned}
        for path in paths.values():  # all headers before the first file is read
            _check_count(str(path), mesh_header(path, BOUNDS.cad_bytes).triangles or 0, simplify)
        max_triangles = BOUNDS.cad_triangles if simplify is None else BOUNDS.simplified_triangles
        parts = {name: _read_part(name, path, max_triangles) for name, path in paths.items()}
    parts_by_link = {}
    for link, part_names in assignment.parts.items():
        parts_by_link[link] = tuple(parts[name] for name in part_names)
    return parts_by_link, assignment.note


def _check_count(where: str, count: int, simplify: int | None) -> None:
    if simplify is None and count > BOUNDS.cad_triangles:
        raise ModelError(
            f"{where}: {count} triangles; expected at most {BOUNDS.cad_triangles}; export it more coarsely, or reduce "
            "it with --simplify 20000"
        )
    if count > BOUNDS.simplified_triangles:
        raise ModelError(
            f"{where}: {count} triangles; expected at most {BOUNDS.simplified_triangles}, even to simplify"
        )


def _read_part(name: str, path: Path, max_triangles: int) -> CadPart:
    started = time.perf_counter()
    mesh = read_mesh(path, max_triangles=max_triangles, max_bytes=BOUNDS.cad_bytes).merged()
    if not len(mesh.faces):
        raise ModelError(f"{path}: no triangles with three different corners")
    if (duration := time.perf_counter() - started) > 1:
        log.info("read %s: %d triangles, %.1f s", path.name, len(mesh.faces), duration)
    # Of all formats only COLLADA states its unit.
    return CadPart(
        name, mesh, collada_unit(path.read_bytes()) if path.suffix.lower() == ".dae" else None
    )


def simplified(mesh: TriangleMesh, count: int, name: str) -> TriangleMesh:
    """Return a mesh with at most about ``count`` triangles, by quadric edge collapses (Garland, Heckbert 1997).

    Raises
    ------
    MissingPackageError
        fast-simplification is not installed.
    ModelError
        It leaves nothing.
    """
    if len(mesh.faces) <= count:
        return mesh
    fast_simplification = imported(
        "fast_simplification", "simplifying a mesh", "pip install fast-simplification"
    )
    started = time.perf_counter()
    log.info("simplifying %s: %d triangles to %d ...", name, len(mesh.faces), count)
    # Relative to the mesh's size: collapses are ordered by distances in single precision.
    size = mesh.size or 1.0
    middle = mesh.bounds.mean(axis=0)
    points = ((mesh.vertices - middle) / size).astype(np.float32)
    vertices, faces = fast_simplification.simplify(
        points, mesh.faces.astype(np.int32), target_count=count
    )
    reduced = TriangleMesh(
        np.asarray(vertices, dtype=np.float64) * size + middle, np.asarray(faces, dtype=np.intp)
    )
    if not len(reduced.faces) or not np.isfinite(reduced.vertices).all():
        raise ModelError(
            f"{name}: nothing is left of {len(mesh.faces)} triangles reduced to {count}"
        )
    log.info(
        "simplified %s: %d triangles, %.1f s",
        name,
        len(reduced.faces),
        time.perf_counter() - started,
    )
    if mesh.colours is None:
        return reduced
    mean = np.round(mesh.colours.mean(axis=0)).astype(np.uint8)
    return TriangleMesh(reduced.vertices, reduced.faces, np.tile(mean, (len(reduced.faces), 1)))
