"""Assignment of a CAD export's files to links: by the number in a file's name, or as the user states it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import cast

from dhkit.description.assets import MESH_FORMATS, inside
from dhkit.errors import DescriptionError, ModelError
from dhkit.model.bounds import BOUNDS

LEFT_OUT = -1
"""Key of a mapping from links to parts for the parts that belong to no link."""
_MAX_LISTED_NAMES = 12
"""Largest number of names that a message lists."""
_BASE = re.compile(r"(?<![a-z])(base|pedestal|foot|fixed)(?![a-z])", re.IGNORECASE)
_NUMBERED_LINK = re.compile(
    r"(?:link|part|body|segment|teil)[ _.\-]*(\d{1,3})(?!\d)", re.IGNORECASE
)
_NUMBER = re.compile(r"(?<!\d)\d{1,3}(?!\d)")
_INSTANCE = re.compile(r"-\d+$")
"""Number of an instance of a part in SolidWorks: "Assem1 - Part2-1" is the first instance of Part2."""


@dataclass(frozen=True)
class Assignment:
    """The names of parts for each link, 0 (the base) to n, and a note how they were assigned."""

    parts: Mapping[int, tuple[str, ...]]
    note: str


def mesh_file_names(folder: Path) -> tuple[str, ...]:
    """Return the names of a folder's mesh files, sorted; hidden files and folders within are skipped.

    Raises
    ------
    ModelError
        No such folder, more files than ``BOUNDS.cad_files``, or a symbolic link to a file outside the folder.
    """
    try:
        if not folder.is_dir():
            raise ModelError(f"{folder}: {'not a folder' if folder.exists() else 'no such folder'}")
        names = _visible_names(folder, MESH_FORMATS)
    except OSError as error:
        raise ModelError(f"{folder}: {error.strerror or error}") from None
    if len(names) > BOUNDS.cad_files:
        raise ModelError(f"{folder}: {len(names)} mesh files; expected at most {BOUNDS.cad_files}")
    for name in names:
        file_inside(folder, name)
    return names


def _visible_names(folder: Path, suffixes: Iterable[str]) -> tuple[str, ...]:
    """Return the names of a folder's files by suffix; macOS writes hidden ._link1.stl beside link1.stl."""
    names = (path.name for path in folder.iterdir() if path.suffix.lower() in suffixes)
    return tuple(sorted(name for name in names if not name.startswith(".")))


def mat_file(folder: Path) -> Path | None:
    """Return the only MAT file of a folder that has no mesh files; None if there is none or several.

    Raises
    ------
    ModelError
        A symbolic link to a file outside the folder.
    """
    if not folder.is_dir() or mesh_file_names(folder):
        return None
    names = _visible_names(folder, [".mat"])
    return file_inside(folder, names[0]) if len(names) == 1 else None


def file_inside(folder: Path, name: str) -> Path:
    """Return the file of a name inside a folder.

    Raises
    ------
    ModelError
        The name is absolute, a URL, or leaves the folder, also by a symbolic link.
    """
    try:
        return cast("Path", inside(folder, name, "a part", "the folder"))
    except DescriptionError as error:
        raise ModelError(f"{folder}: {error}") from None


def link_number(name: str) -> int | None:
    """Return the link's number in a part's name, 0 for a base, None if there is none or several.

    Examples
    --------
    >>> link_number("PUMA560 assembly - link3-1"), link_number("base"), link_number("part 4"), link_number("arm")
    (3, 0, 4, None)
    """
    name = name.rsplit(" - ", 1)[-1]
    without_instance = _INSTANCE.sub("", name)
    if _NUMBER.search(without_instance) or _BASE.search(without_instance):
        name = without_instance
    if _BASE.search(name.replace("_", " ")):
        return 0
    numbers = set(map(int, _NUMBERED_LINK.findall(name))) or set(map(int, _NUMBER.findall(name)))
    return numbers.pop() if len(numbers) == 1 else None


def assign_parts(
    names: Sequence[str],
    links: int,
    stated: Mapping[int, Sequence[str]] | None,
    where: str,
    *,
    suffixes: bool = True,
) -> Assignment:
    """Return the parts of each link, 0 to ``links``.

    Numbers are those of the table, 0 or "base" for the part that does not move. If no part has number 0, n + 1 parts
    that are numbered 1 to n + 1 are numbered from the base, if nothing is stated: part 1 is link 0.

    Parameters
    ----------
    names
        Names of the files or variables.
    links
        Number of joints n.
    stated
        Names of parts by link, as the user maps them; an empty list for a link without a part, and
        :data:`LEFT_OUT` for parts of no link.
    where
        Folder or file, for messages.
    suffixes
        Whether names end in a format.

    Raises
    ------
    ModelError
        A name without a number, two of one number, or a link without a part; lists the names.
    """
    stated = dict(stated or {})
    _check_stated(stated, names, links, where)
    left_out = tuple(stated.pop(LEFT_OUT, ()))
    names = [name for name in names if name not in left_out]
    mapped = set(chain.from_iterable(stated.values()))
    numbers = {
        name: link_number(Path(name).stem if suffixes else name)
        for name in names
        if name not in mapped
    }
    first = names[0] if names else "forearm.stl"
    names_found = f"; found {_name_list(names)}; "
    hint = f'{names_found}say which by a mapping, such as --map "3={first}", or --map "-={first}" for a part of no link'
    if without_number := [name for name, number in numbers.items() if number is None]:
        raise ModelError(f"{where}: no single link number in {_name_list(without_number)}{hint}")
    parts: dict[int, tuple[str, ...]] = {}
    for name, number in numbers.items():
        if number is not None:
            parts[number] = (*parts.get(number, ()), name)
    for number, several in parts.items():
        if len(several) > 1:
            raise ModelError(
                f"{where}: {_name_list(several)} have the same link number{names_found}if all are of that link, "
                f'--map "{number}={",".join(several[:_MAX_LISTED_NAMES])}"; --map "-={several[-1]}" leaves a part out'
            )
    note = "parts by the numbers in their names"
    if 0 not in parts and not stated and set(parts) == set(range(1, links + 2)):
        parts = {number - 1: several for number, several in parts.items()}
        note = f"parts numbered 1 to {links + 1}: part 1 is the base, part 2 link 1, and so on"
    if both := sorted(set(parts) & set(stated)):
        raise ModelError(
            f"{where}: link {both[0]} is mapped, and {_name_list(parts[both[0]])} has its number too{hint}"
        )
    parts |= {number: tuple(several) for number, several in stated.items()}
    if beyond := sorted(number for number in parts if not 0 <= number <= links):
        raise ModelError(
            f"{where}: {_name_list(parts[beyond[0]])} for link {beyond[0]}; the table has links 0 to {links}{hint}"
        )
    if missing := [number for number in range(1, links + 1) if number not in parts]:
        without = f'; --map "{missing[0]}=" is a link with no part of its own'
        words = f"no part for link{'s' * (len(missing) > 1)} {', '.join(map(str, missing))}{hint}{without}"
        raise ModelError(f"{where}: {words}")
    if not parts.get(0):
        note += "; no base part"
    if left_out:
        note += f"; left out: {_name_list(left_out)}"
    return Assignment(
        {number: several for number, several in sorted(parts.items()) if several}, note
    )


def _check_stated(
    stated: Mapping[int, Sequence[str]], names: Sequence[str], links: int, where: str
) -> None:
    seen: set[str] = set()
    for number, several in stated.items():
        if number != LEFT_OUT and not 0 <= number <= links:
            raise ModelError(
                f"{where}: the mapping names link {number}; the table has links 0 to {links}"
            )
        for name in several:
            if name not in names:
                raise ModelError(
                    f"{where}: the mapping names {name[:80]!r}; found {_name_list(names)}"
                )
            if name in seen:
                raise ModelError(f"{where}: the mapping names {name[:80]!r} twice")
            seen.add(name)


def _name_list(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MAX_LISTED_NAMES} more" if len(names) > _MAX_LISTED_NAMES else ""
    return (", ".join(name[:60] for name in names[:_MAX_LISTED_NAMES]) + more) or "nothing"
