"""Paths of files: the package's own assets, and relative paths that must stay inside a folder."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path, PurePosixPath

from dhkit.description.bounds import BOUNDS
from dhkit.errors import DescriptionError

MESH_FORMATS = (".stl", ".obj", ".dae", ".ply")

_PACKAGE = Path(__file__).resolve().parents[1]
_CHECKOUT = _PACKAGE.parents[1]
"""Root of the repository when dhkit runs from its sources; otherwise a folder without assets of dhkit."""


def asset(name: str) -> Path:
    """Return the path of a packaged file or folder, such as ``urdf/puma560.urdf`` or ``meshes``.

    Parameters
    ----------
    name
        Path below the package's folder of assets.

    Returns
    -------
    Path
        Path of the file in the installed package, or in the checkout.

    Raises
    ------
    DescriptionError
        The package has no such file.

    Examples
    --------
    >>> asset("urdf/puma560.urdf").name
    'puma560.urdf'
    """
    if name.split("/")[0] in ("urdf", "meshes") and ".." not in PurePosixPath(name).parts:
        for root in (_PACKAGE, _CHECKOUT):
            if (root / name).exists():
                return root / name
    raise DescriptionError(
        f"no packaged file {name!r}; there are urdf/NAME.urdf and meshes/NAME/LINK.stl"
    )


def inside(
    folder: Path | None, path: str, subject: str, root: str = "the robot's folder"
) -> Path | None:
    """Return the file that a relative path names inside a folder, None for an unknown folder.

    Parameters
    ----------
    folder
        The folder that the path is relative to; None checks the path's text alone.
    path
        The relative path, with slashes or backslashes.
    subject, root
        What the path stands for and what the folder is, for messages.

    Raises
    ------
    DescriptionError
        The path is absolute, a URL or too long, or leaves the folder, also by a symbolic link.
    """
    parts = PurePosixPath(path.replace("\\", "/"))
    if (
        not path
        or len(path) > BOUNDS.path_characters
        or max(map(len, parts.parts), default=0) > BOUNDS.path_part_characters
        or not path.isprintable()
        or ":" in path
        or parts.is_absolute()
        or ".." in parts.parts
    ):
        raise DescriptionError(
            f"{subject} is {path[:80]!r}; expected a relative path inside {root}"
        )
    if folder is None:
        return None
    file = folder / parts
    try:
        with suppress(FileNotFoundError):  # a mesh may be missing
            file.stat()  # refuses a loop of links, which `resolve` does not from Python 3.13 on
        leaves_folder = not file.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError):  # a loop of links, or a name that no file can have
        raise DescriptionError(f"{subject} is {path[:80]!r}, which cannot be found") from None
    if leaves_folder:
        raise DescriptionError(f"{subject} is {path[:80]!r}, a link that leaves {root}")
    return file
