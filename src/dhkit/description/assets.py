"""Where the package's own files lie, installed or in a checkout, and what a mesh path may reach."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from dhkit.errors import DescriptionError

MESH_FORMATS = (".stl", ".obj", ".dae", ".ply")

MAX_PATH = 500
"""Characters of a mesh's path."""
MAX_NAME = 120
"""Characters of a file or folder in it: names of 255 bytes are the longest that a file can have."""

PACKAGE = Path(__file__).resolve().parents[1]
CHECKOUT = PACKAGE.parents[1]
"""The repository root when the package is used from its sources; elsewhere a folder without our assets."""


def asset(name: str) -> Path:
    """Return the path of a packaged file or folder, such as ``urdf/puma560.urdf`` or ``meshes``.

    Raises
    ------
    DescriptionError
        There is no such file in the package.
    """
    if name.split("/")[0] in ("urdf", "meshes") and ".." not in PurePosixPath(name).parts:
        for root in (PACKAGE, CHECKOUT):
            if (root / name).exists():
                return root / name
    raise DescriptionError(f"no packaged file {name!r}; there are urdf/NAME.urdf and meshes/NAME/LINK.stl")


def inside(folder: Path | None, path: str, where: str) -> Path | None:
    """Return the file that a relative path names, None where its folder is unknown.

    Raises
    ------
    DescriptionError
        The path is absolute, a URL, or leaves the folder.
    """
    parts = PurePosixPath(path.replace("\\", "/"))
    if (
        not path
        or len(path) > MAX_PATH
        or max(map(len, parts.parts), default=0) > MAX_NAME
        or not path.isprintable()
        or ":" in path
        or parts.is_absolute()
        or ".." in parts.parts
    ):
        raise DescriptionError(f"{where}.mesh is {path[:80]!r}; expected a relative path inside the robot's folder")
    if folder is None:
        return None
    file = folder / parts
    try:
        leaves = not file.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError):  # a loop of links, or a name that no file can have
        raise DescriptionError(f"{where}.mesh is {path[:80]!r}, which cannot be found") from None
    if leaves:
        raise DescriptionError(f"{where}.mesh is {path[:80]!r}, a link that leaves the robot's folder")
    return file
