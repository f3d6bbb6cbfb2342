"""The parts of a CAD export as meshes of each link, in assembly coordinates and in the files' units."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dhkit.errors import ModelError
from dhkit.model.cad_files import assigned, file_inside, mat_file, mesh_files
from dhkit.model.cad_units import UNITS
from dhkit.model.collada import collada_unit
from dhkit.model.mat_parts import mat_parts
from dhkit.model.mesh_reader import mesh_header, read_mesh
from dhkit.model.triangle_mesh import TriangleMesh

MAX_CAD_BYTES = 600_000_000
MAX_CAD_TRIANGLES = 200_000
"""Of a file without ``simplify``: seven of them are drawn well by a browser."""
MAX_READ_TRIANGLES = 6_000_000
"""Of a file that is simplified."""
FEWEST = 4

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class CadPart:
    """A mesh of a link as it was exported."""

    name: str
    """The file's, or the variable's of a MAT file."""
    mesh: TriangleMesh
    unit: float | None = None
    """What its file states as its unit, m, as COLLADA files can; then the mesh is in m. None: in the file's unit."""

    def metres(self, unit: str | None, found: float) -> TriangleMesh:
        """Return the mesh in m: by the unit that the user states for all files, by its own, or by the one found."""
        if unit is not None:
            return self.mesh.scaled(UNITS[unit] / (self.unit or 1.0))
        return self.mesh.scaled(found if self.unit is None else 1.0)


def cad_parts(
    folder: Path, links: int, *, files: Mapping[int, Sequence[str]] | None = None, simplify: int | None = None
) -> tuple[dict[int, tuple[CadPart, ...]], tuple[str, ...]]:
    """Read the parts of an assembly.

    Parameters
    ----------
    folder
        A folder of STL, OBJ, PLY and COLLADA files; a MAT file, or a folder that holds one and no meshes.
    links
        Number of joints n.
    files
        Names of files by link; those that are not named here are found by the numbers in their names.
    simplify
        Whether files over :data:`MAX_CAD_TRIANGLES` are read at all; they are reduced later, by :func:`simplified`.

    Returns
    -------
    tuple
        Parts by link, 0 to n, and notes on how they were found.

    Raises
    ------
    ModelError
        See :func:`dhkit.model.cad_files.assigned` and :func:`dhkit.model.mesh_reader.read_mesh`; a file with too many
        triangles, which is told from its header.
    """
    if simplify is not None and simplify < FEWEST:
        raise ModelError(f"simplify is {simplify}; expected the number of triangles to keep, {FEWEST} at least")
    named = folder.suffix.lower() == ".mat" and not folder.is_dir()
    mat = folder if named else mat_file(folder)
    if mat is not None:
        meshes = mat_parts(mat)
        found = assigned(tuple(meshes), links, files, str(mat), suffixes=False)
        for name, mesh in meshes.items():
            _check_budget(f"{mat}: {name}", len(mesh.faces), simplify)
        parts = {i: tuple(CadPart(name, meshes[name]) for name in names) for i, names in found.parts.items()}
        return parts, (found.note,)
    names = mesh_files(folder)
    if not names:
        raise ModelError(f"{folder}: no mesh files; expected .stl, .obj, .ply or .dae files, or one .mat file")
    found = assigned(names, links, files, str(folder))
    chosen = {name: file_inside(folder, name) for several in found.parts.values() for name in several}
    for path in chosen.values():  # all headers before the first file is read
        _check_budget(str(path), mesh_header(path, MAX_CAD_BYTES).triangles or 0, simplify)
    most = MAX_CAD_TRIANGLES if simplify is None else MAX_READ_TRIANGLES
    read = {name: CadPart(name, _read(path, most), _unit(path)) for name, path in chosen.items()}
    return {i: tuple(read[name] for name in several) for i, several in found.parts.items()}, (found.note,)


def _check_budget(where: str, count: int, simplify: int | None) -> None:
    if simplify is None and count > MAX_CAD_TRIANGLES:
        raise ModelError(
            f"{where}: {count} triangles; expected at most {MAX_CAD_TRIANGLES}; export it more coarsely, or reduce "
            "it with --simplify 20000"
        )
    if count > MAX_READ_TRIANGLES:
        raise ModelError(f"{where}: {count} triangles; expected at most {MAX_READ_TRIANGLES}, even to simplify")


def _unit(path: Path) -> float | None:
    """Return the unit that a file which was read states, m; of all formats only COLLADA can."""
    return collada_unit(path.read_bytes()) if path.suffix.lower() == ".dae" else None


def _read(path: Path, most: int) -> TriangleMesh:
    started = time.perf_counter()
    mesh = read_mesh(path, max_triangles=most, max_bytes=MAX_CAD_BYTES).merged()
    if not len(mesh.faces):
        raise ModelError(f"{path}: no triangles with three different corners")
    if (took := time.perf_counter() - started) > 1:
        log.info("read %s: %d triangles, %.1f s", path.name, len(mesh.faces), took)
    return mesh


def simplified(mesh: TriangleMesh, count: int, name: str) -> TriangleMesh:
    """Return a mesh with at most about ``count`` triangles, by quadric edge collapses (Garland, Heckbert 1997).

    Raises
    ------
    ModelError
        fast-simplification is not installed, or leaves nothing.
    """
    if len(mesh.faces) <= count:
        return mesh
    try:
        import fast_simplification
    except ImportError as error:
        raise ModelError(f"simplifying needs fast-simplification ({error}); pip install fast-simplification") from None
    started = time.perf_counter()
    log.info("simplifying %s: %d triangles to %d ...", name, len(mesh.faces), count)
    # In shares of the size: collapses are ordered by distances in single precision.
    size, middle = mesh.size or 1.0, mesh.bounds.mean(axis=0)
    points = ((mesh.vertices - middle) / size).astype(np.float32)
    vertices, faces = fast_simplification.simplify(points, mesh.faces.astype(np.int32), target_count=count)
    reduced = TriangleMesh(np.asarray(vertices, dtype=np.float64) * size + middle, np.asarray(faces, dtype=np.intp))
    if not len(reduced.faces) or not np.isfinite(reduced.vertices).all():
        raise ModelError(f"{name}: nothing is left of {len(mesh.faces)} triangles reduced to {count}")
    log.info("simplified %s: %d triangles, %.1f s", name, len(reduced.faces), time.perf_counter() - started)
    if mesh.colours is None:
        return reduced
    mean = np.round(mesh.colours.mean(axis=0)).astype(np.uint8)
    return TriangleMesh(reduced.vertices, reduced.faces, np.tile(mean, (len(reduced.faces), 1)))
