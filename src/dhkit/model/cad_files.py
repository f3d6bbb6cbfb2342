"""Which file of a CAD export belongs to which link: by the number in its name, or as the user states it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dhkit.description.assets import MESH_FORMATS, inside
from dhkit.errors import DescriptionError, ModelError

LEFT_OUT = -1
"""The link that stands for none, where parts are mapped."""
MOST_FILES = 500
SHOWN = 12
"""Names that a message lists."""
BASE = re.compile(r"(?<![a-z])(base|pedestal|foot|fixed)(?![a-z])", re.IGNORECASE)
NUMBERED = re.compile(r"(?:link|part|body|segment|teil)[ _.\-]*(\d{1,3})(?!\d)", re.IGNORECASE)
NUMBER = re.compile(r"(?<!\d)\d{1,3}(?!\d)")
INSTANCE = re.compile(r"-\d+$")
"""SolidWorks numbers the instances of a part: "Assem1 - Part2-1" is the first instance of Part2."""


@dataclass(frozen=True)
class Assignment:
    """The names of parts for each link, 0 (the base) to n, and how they were found."""

    parts: Mapping[int, tuple[str, ...]]
    note: str


def mesh_files(folder: Path) -> tuple[str, ...]:
    """Return the names of a folder's mesh files, sorted; hidden files and folders within are not looked at.

    Raises
    ------
    ModelError
        No such folder, more files than :data:`MOST_FILES`, or a link that leaves the folder.
    """
    try:
        if not folder.is_dir():
            raise ModelError(f"{folder}: {'not a folder' if folder.exists() else 'no such folder'}")
        names = sorted(path.name for path in folder.iterdir() if _is_seen(path) and path.suffix.lower() in MESH_FORMATS)
    except OSError as error:
        raise ModelError(f"{folder}: {error.strerror or error}") from None
    if len(names) > MOST_FILES:
        raise ModelError(f"{folder}: {len(names)} mesh files; expected at most {MOST_FILES}")
    for name in names:
        file_inside(folder, name)
    return tuple(names)


def _is_seen(path: Path) -> bool:
    """Return whether a file is not hidden: macOS writes ._link1.stl beside link1.stl on foreign disks."""
    return not path.name.startswith(".")


def mat_file(folder: Path) -> Path | None:
    """Return the only MAT file of a folder that has no mesh files; None where there is none or several.

    Raises
    ------
    ModelError
        A link that leaves the folder.
    """
    if not folder.is_dir() or mesh_files(folder):
        return None
    found = sorted(path for path in folder.iterdir() if _is_seen(path) and path.suffix.lower() == ".mat")
    return file_inside(folder, found[0].name) if len(found) == 1 else None


def file_inside(folder: Path, name: str) -> Path:
    """Return the file that a name means inside a folder.

    Raises
    ------
    ModelError
        The name is absolute, a URL, or leaves the folder, by a link too.
    """
    try:
        file = inside(folder, name, "part")
    except DescriptionError as error:
        raise ModelError(
            f"{folder}: {error}".replace("part.mesh", "a part").replace("robot's folder", "folder")
        ) from None
    if file is None:
        raise ModelError(f"{folder}: no folder")
    return file


def link_number(name: str) -> int | None:
    """Return the number that a part's name carries, 0 for a base, None where there is none or several.

    Examples
    --------
    >>> link_number("PUMA560 assembly - link3-1"), link_number("base"), link_number("part 4"), link_number("arm")
    (3, 0, 4, None)
    """
    last = name.rsplit(" - ", 1)[-1]
    if NUMBER.search(INSTANCE.sub("", last)) or BASE.search(INSTANCE.sub("", last)):
        last = INSTANCE.sub("", last)
    if BASE.search(last.replace("_", " ")):
        return 0
    named = {int(number) for number in NUMBERED.findall(last)} or {int(number) for number in NUMBER.findall(last)}
    return named.pop() if len(named) == 1 else None


def assigned(
    names: Sequence[str], links: int, stated: Mapping[int, Sequence[str]] | None, where: str, *, suffixes: bool = True
) -> Assignment:
    """Return the parts of each link, 0 to ``links``.

    Numbers are those of the table, 0 or "base" for the part that stands still. Where there is none, n + 1 parts that
    are numbered 1 to n + 1 are taken as the course does: part 1 is the base.

    Parameters
    ----------
    names
        What there is: files' or variables' names.
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
        A name without a number, two of one number, or a link without a part; lists what was found.
    """
    stated = dict(stated or {})
    _check_stated(stated, names, links, where)
    left_out = tuple(stated.pop(LEFT_OUT, ()))
    names = [name for name in names if name not in left_out]
    taken = {name for several in stated.values() for name in several}
    numbers: dict[int, list[str]] = {}
    nameless = []
    for name in names:
        if name in taken:
            continue
        number = link_number(Path(name).stem if suffixes else name)
        if number is None:
            nameless.append(name)
        else:
            numbers.setdefault(number, []).append(name)
    first = names[0] if names else "forearm.stl"
    found_names = f"; found {_listed(names)}; "
    hint = f'{found_names}say which by a mapping, such as --map "3={first}", or --map "-={first}" for a part of no link'
    if nameless:
        raise ModelError(f"{where}: no single link number in {_listed(nameless)}{hint}")
    for number, doubled in numbers.items():
        if len(doubled) > 1:
            raise ModelError(
                f"{where}: {_listed(doubled)} have the same link number{found_names}if all are of that link, "
                f'--map "{number}={",".join(doubled[:SHOWN])}"; --map "-={doubled[-1]}" leaves a part out'
            )
    note = "parts by the numbers in their names"
    if 0 not in numbers and not stated and set(numbers) == set(range(1, links + 2)):
        numbers = {number - 1: several for number, several in numbers.items()}
        note = f"parts numbered 1 to {links + 1}: part 1 is the base, part 2 link 1, and so on"
    found = {number: tuple(several) for number, several in numbers.items()}
    if clash := sorted(set(found) & set(stated)):
        raise ModelError(f"{where}: link {clash[0]} is mapped, and {_listed(found[clash[0]])} has its number too{hint}")
    found |= {number: tuple(several) for number, several in stated.items()}
    if beyond := sorted(number for number in found if not 0 <= number <= links):
        raise ModelError(
            f"{where}: {_listed(found[beyond[0]])} for link {beyond[0]}; the table has links 0 to {links}{hint}"
        )
    if missing := [number for number in range(1, links + 1) if number not in found]:
        raise ModelError(f"{where}: no part for link{'s' * (len(missing) > 1)} {', '.join(map(str, missing))}{hint}")
    if not found.get(0):
        note += "; no base part"
    if left_out:
        note += f"; left out: {_listed(left_out)}"
    return Assignment({number: parts for number, parts in sorted(found.items()) if parts}, note)


def _check_stated(stated: Mapping[int, Sequence[str]], names: Sequence[str], links: int, where: str) -> None:
    seen: set[str] = set()
    for number, several in stated.items():
        if number != LEFT_OUT and not 0 <= number <= links:
            raise ModelError(f"{where}: the mapping names link {number}; the table has links 0 to {links}")
        for name in several:
            if name not in names:
                raise ModelError(f"{where}: the mapping names {name[:80]!r}; found {_listed(names)}")
            if name in seen:
                raise ModelError(f"{where}: the mapping names {name[:80]!r} twice")
            seen.add(name)


def _listed(names: Iterable[str]) -> str:
    listed = [name[:60] for name in names]
    more = f" and {len(listed) - SHOWN} more" if len(listed) > SHOWN else ""
    return (", ".join(listed[:SHOWN]) + more) or "nothing"
