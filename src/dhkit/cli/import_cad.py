"""`dhkit import-cad`: the parts of a CAD assembly and a DH table into a robot file, a URDF and meshes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.arguments import OutsideLimits, option_values
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.output import print_json, say, say_written
from dhkit.errors import DescriptionError
from dhkit.model.cad_assembly import import_cad
from dhkit.model.cad_files import LEFT_OUT

LINK_PAIR = re.compile(r"\s*(?:link\s*)?(\d{1,3})\s*=\s*(.*?)\s*", re.IGNORECASE | re.DOTALL)
LEFT_OUT_PAIR = re.compile(r"\s*-\s*=\s*(.*?)\s*", re.DOTALL)


def run(
    folder: Path,
    arm: Arm,
    output: Path,
    *,
    density: float | None,
    masses: Sequence[str],
    reports: Sequence[Path],
    unit: str | None,
    simplify: int | None,
    mapping: Sequence[str],
    at: str | None,
    degrees: bool,
    json: bool,
) -> ExitStatus:
    """Import an assembly, write it, and print the notes of the import.

    Raises
    ------
    DhkitError
        A part, a unit, a mass or an option is not clear.
    """
    imported = import_cad(
        folder,
        arm.description,
        unit=unit,
        q=None if at is None else option_values(arm, at, "--at", degrees, OutsideLimits.WARN),
        density=density,
        mass={link: _mass(link, text) for link, text in _pairs(masses, "--mass", "1=3.2").items()},
        reports=reports,
        simplify=simplify,
        files=_files(mapping),
    )
    written = imported.write(output)
    warnings = [note for note in imported.notes if note.startswith("warning: ")]
    if json:
        links = {str(link): len(mesh.faces) for link, mesh in imported.meshes.items()}
        print_json({"files": [str(path) for path in written], "notes": list(imported.notes), "triangles": links})
        return ExitStatus.FINE
    for note in imported.notes:
        say(note, "yellow" if note in warnings else "")
    bare = [i for i, joint in enumerate(imported.description.joints, start=1) if not joint.bodies]
    if bare:
        say(f"no body: link{'s' * (len(bare) > 1)} {', '.join(map(str, bare))}; state --density, --mass or --report")
    say_written(written)
    return ExitStatus.FINE


def _pairs(words: Sequence[str], option: str, example: str) -> dict[int, str]:
    """Read LINK=VALUE pairs.

    Raises
    ------
    DescriptionError
        A word is no such pair, or a link is there twice.
    """
    pairs: dict[int, str] = {}
    for word in words:
        match = LINK_PAIR.fullmatch(word)
        if match is None:
            raise DescriptionError(f"{option} {word[:60]}: expected LINK=VALUE, such as {example}")
        if int(match[1]) in pairs:
            raise DescriptionError(f"{option}: link {int(match[1])} twice")
        pairs[int(match[1])] = match[2]
    return pairs


def _mass(link: int, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise DescriptionError(f"--mass {link}={text[:40]}: expected a number of kg") from None


def _files(mapping: Sequence[str]) -> dict[int, list[str]] | None:
    """Read --map: the files of links, and after "-=" those that are left out."""
    left_out = [match[1] for word in mapping if (match := LEFT_OUT_PAIR.fullmatch(word))]
    pairs = _pairs([word for word in mapping if not LEFT_OUT_PAIR.fullmatch(word)], "--map", '"3=forearm.stl"')
    files = {link: _names(text) for link, text in pairs.items()}
    if left_out:
        files[LEFT_OUT] = _names(",".join(left_out))
    return files or None


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]
