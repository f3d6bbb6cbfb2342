"""`dhkit import-cad`: the parts of a CAD assembly and a DH table into a robot file, a URDF and meshes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.arguments import joint_values
from dhkit.cli.output import print_json, say
from dhkit.errors import DescriptionError
from dhkit.model.cad_assembly import import_cad
from dhkit.model.cad_files import LEFT_OUT

PAIR = re.compile(r"\s*(?:link\s*)?(\d{1,3})\s*=\s*(.*?)\s*", re.IGNORECASE | re.DOTALL)

WITHOUT = re.compile(r"\s*-\s*=\s*(.*?)\s*", re.DOTALL)


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
) -> int:
    """Import an assembly, write it, and print what was found; return 0.

    Raises
    ------
    DhkitError
        A part, a unit, a mass or an option that is not clear.
    """
    imported = import_cad(
        folder,
        arm.description,
        unit=unit,
        q=None if at is None else joint_values(arm, [at], degrees, "values of --at"),
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
        return 0
    for note in imported.notes:
        say(note, "yellow" if note in warnings else "")
    bare = [i for i, joint in enumerate(imported.description.joints, start=1) if not joint.bodies]
    if bare:
        say(f"no body: link{'s' * (len(bare) > 1)} {', '.join(map(str, bare))}; state --density, --mass or --report")
    for path in written:
        say(f"wrote {path}")
    return 0


def _pairs(words: Sequence[str], option: str, example: str) -> dict[int, str]:
    """Read LINK=VALUE pairs.

    Raises
    ------
    DescriptionError
        No such pair, or a link twice.
    """
    pairs: dict[int, str] = {}
    for word in words:
        found = PAIR.fullmatch(word)
        if found is None:
            raise DescriptionError(f"{option} {word[:60]}: expected LINK=VALUE, such as {example}")
        if int(found[1]) in pairs:
            raise DescriptionError(f"{option}: link {int(found[1])} twice")
        pairs[int(found[1])] = found[2]
    return pairs


def _mass(link: int, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise DescriptionError(f"--mass {link}={text[:40]}: expected a number of kg") from None


def _files(mapping: Sequence[str]) -> dict[int, list[str]] | None:
    """Read --map: the files of links, and after "-=" those of none."""
    out = [found[1] for word in mapping if (found := WITHOUT.fullmatch(word))]
    pairs = _pairs([word for word in mapping if not WITHOUT.fullmatch(word)], "--map", '"3=forearm.stl"')
    files = {link: _names(text) for link, text in pairs.items()}
    if out:
        files[LEFT_OUT] = _names(",".join(out))
    return files or None


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]
