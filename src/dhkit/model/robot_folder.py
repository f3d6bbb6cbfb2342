"""A robot file together with the meshes that it names, so that the folder can be moved and shared."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path, PurePosixPath

from dhkit.description import Description, Mesh, Shape, takes_robot, to_toml, write_atomically
from dhkit.errors import DescriptionError, ModelError

MESHES = "meshes"


@takes_robot
def write_robot_with_meshes(description: Description, path: str | Path) -> tuple[Path, ...]:
    """Write a robot file and copies of its meshes in ``meshes/NAME`` beside it; return the files, robot file first.

    Meshes come first, so that no robot file is left that names missing ones.

    Raises
    ------
    ModelError
        A mesh cannot be read, or a file cannot be written.
    """
    path = Path(path)
    names, folder = _copies(description), description.mesh_folder
    written = [path]
    try:
        for source, name in names.items():
            if folder is None:
                raise ModelError(f"{description.name}: where its mesh {source!r} lies is not known")
            copy = path.parent / name
            write_atomically(copy, (folder / source).read_bytes())
            written.append(copy)
        write_atomically(path, to_toml(_renamed(description, names)))
    except OSError as error:
        raise ModelError(f"{error.filename or path}: {error.strerror}") from None
    except DescriptionError as error:
        raise ModelError(str(error)) from None
    return tuple(written)


def _shapes(description: Description) -> Iterator[Shape]:
    yield from description.base.shapes
    for joint in description.joints:
        yield from joint.shapes
    yield from description.tool.shapes


def _copies(description: Description) -> dict[str, str]:
    """Return the path of each mesh's copy by its own path; files of one name from two folders are told apart."""
    sources = dict.fromkeys(shape.geometry.path for shape in _shapes(description) if isinstance(shape.geometry, Mesh))
    names: dict[str, str] = {}
    for source in sources:
        own = PurePosixPath(source)
        name, count = own.name, 1
        while f"{MESHES}/{description.name}/{name}" in names.values():
            count += 1
            name = f"{own.stem}_{count}{own.suffix}"
        names[source] = f"{MESHES}/{description.name}/{name}"
    return names


def _renamed(description: Description, names: dict[str, str]) -> Description:
    def moved(shapes: tuple[Shape, ...]) -> tuple[Shape, ...]:
        return tuple(
            replace(shape, geometry=replace(shape.geometry, path=names[shape.geometry.path]))
            if isinstance(shape.geometry, Mesh)
            else shape
            for shape in shapes
        )

    return replace(
        description,
        base=replace(description.base, shapes=moved(description.base.shapes)),
        joints=tuple(replace(joint, shapes=moved(joint.shapes)) for joint in description.joints),
        tool=replace(description.tool, shapes=moved(description.tool.shapes)),
        mesh_folder=None,
    )
