"""The named robots that come with dhkit."""

from __future__ import annotations

import difflib
from functools import cache
from importlib import resources

from dhkit.description.assets import asset
from dhkit.description.robot import Description
from dhkit.description.robot_file import from_toml
from dhkit.errors import DescriptionError

FOLDER = resources.files("dhkit.description") / "library"


@cache
def robots() -> tuple[str, ...]:
    """Return the names of the library's robots, sorted.

    Returns
    -------
    tuple[str, ...]
        Names that :func:`library_robot` and ``Arm.load`` accept.

    Examples
    --------
    >>> "puma560" in robots()
    True
    """
    names = (file.name for file in FOLDER.iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


@cache
def library_robot(name: str) -> Description:
    """Return a robot of the library.

    Parameters
    ----------
    name
        Name, one of :func:`robots`.

    Returns
    -------
    Description
        The robot.

    Raises
    ------
    DescriptionError
        No robot of that name; names the nearest.

    Examples
    --------
    >>> library_robot("puma560").n
    6
    """
    if name not in robots():
        close = difflib.get_close_matches(name.lower(), robots(), n=1, cutoff=0.5)
        hint = f"did you mean {close[0]!r}?" if close else f"there are {', '.join(robots())}"
        raise DescriptionError(f"no robot {name[:80]!r} in the library; {hint}")
    return from_toml(
        (FOLDER / f"{name}.toml").read_text("utf-8"),
        file=f"{name}.toml",
        mesh_folder=asset("meshes"),
    )
