"""Robot files together with the meshes that they name, so that the folder can be moved and shared."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath

from dhkit.description import Description, Mesh, Shape, takes_robot, to_toml, write_atomically
from dhkit.errors import DescriptionError, ModelError

MESHES = "meshes"
"""Folder for meshes, beside a robot file or URDF."""


@contextmanager
def model_errors(path: Path) -> Iterator[None]:
    """Raise failed file operations, in one line that begins with the file, or ``path``, as ModelError."""
    try:
        yield
    except OSError as error:
        raise ModelError(f"{error.filename or path}: {error.strerror or error}") from None
    except DescriptionError as error:
        raise ModelError(str(error)) from None


def mesh_paths(description: Description) -> tuple[str, ...]:
    """Return the paths of a description's meshes, each once: base, links, tool."""
    shapes = (
        description.base.shapes,
        *(joint.shapes for joint in description.joints),
        description.tool.shapes,
    )
    geometries = (shape.geometry for shape in itertools.chain(*shapes))
    return tuple(
        dict.fromkeys(geometry.path for geometry in geometries if isinstance(geometry, Mesh))
    )


def copy_files(sources: Mapping[str, Path], folder: Path) -> list[Path]:
    """Copy files to these relative paths in a folder, each whole or not at all; return the copies."""
    for name, source in sources.items():
        write_atomically(folder / name, source.read_bytes())
    return [folder / name for name in sources]


@takes_robot
def write_robot_with_meshes(description: Description, path: str | Path) -> tuple[Path, ...]:
    """Write a robot file and copies of its meshes in ``meshes/NAME`` beside it; return the files, robot file first.

    Meshes are written first, so that no robot file is left that names missing ones.

    Parameters
    ----------
    description
        The robot.
    path
        Robot file to write, which ends in ``.toml``.

    Returns
    -------
    tuple[Path, ...]
        The files written, the robot file first.

    Raises
    ------
    ModelError
        A mesh cannot be read, or a file cannot be written.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> [path.name for path in write_robot_with_meshes(library_robot("planar2r"), "mine.toml")]
    ['mine.toml']
    """
    path = Path(path)
    names = _copy_names(description)
    folder = description.mesh_folder
    with model_errors(path):
        if names and folder is None:
            raise ModelError(
                f"{description.name}: where its mesh {next(iter(names))!r} lies is not known"
            )
        sources = (
            {} if folder is None else {name: folder / source for source, name in names.items()}
        )
        copies = copy_files(sources, path.parent)
        write_atomically(path, to_toml(_with_mesh_paths(description, names.__getitem__)))
    return (path, *copies)


def _copy_names(description: Description) -> dict[str, str]:
    """Return the path of each mesh's copy by its own path; equal file names from two folders are numbered."""
    names: dict[str, str] = {}
    for source in mesh_paths(description):
        own = PurePosixPath(source)
        name = own.name
        count = 1
        while f"{MESHES}/{description.name}/{name}" in names.values():
            count += 1
            name = f"{own.stem}_{count}{own.suffix}"
        names[source] = f"{MESHES}/{description.name}/{name}"
    return names


def _with_mesh_paths(description: Description, new_path: Callable[[str], str]) -> Description:
    """Return a description without a mesh folder, its meshes named by other paths."""

    def renamed(shapes: tuple[Shape, ...]) -> tuple[Shape, ...]:
        return tuple(
            replace(shape, geometry=replace(shape.geometry, path=new_path(shape.geometry.path)))
            if isinstance(shape.geometry, Mesh)
            else shape
            for shape in shapes
        )

    return replace(
        description,
        base=replace(description.base, shapes=renamed(description.base.shapes)),
        joints=tuple(replace(joint, shapes=renamed(joint.shapes)) for joint in description.joints),
        tool=replace(description.tool, shapes=renamed(description.tool.shapes)),
        mesh_folder=None,
    )
