"""`dhkit extract`: the Denavit-Hartenberg table of a chain of a URDF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.output import print_json, print_table, say
from dhkit.description import Description, pose_parts
from dhkit.errors import DescriptionError
from dhkit.model import Extraction, example_chains, extract_dh, urdf_source
from dhkit.model.robot_folder import write_robot_with_meshes

AGREES = 1e-9
"""The largest difference from the file that counts as the same robot."""


def run(
    name: str,
    *,
    base: str | None,
    tip: str | None,
    modified: bool,
    as_designed: bool,
    drop: bool,
    package_dirs: Sequence[Path],
    output: Path | None,
    json: bool,
) -> int:
    """Extract a table, print it and perhaps write it; return 0, or 1 where it is not within 1e-9 of the file.

    Raises
    ------
    DescriptionError
        An output file that is no robot file.
    """
    if output is not None and output.suffix.lower() != ".toml":
        raise DescriptionError(f"{output}: expected a robot file that ends in .toml")
    path, base, tip = chain_words(name, base, tip)
    extraction = extract_dh(
        path,
        base,
        tip,
        convention="modified" if modified else "standard",
        side="drop" if drop else "freeze",
        as_designed=as_designed,
        package_dirs=package_dirs,
    )
    files = [] if output is None else write_robot_with_meshes(extraction.description, output)
    if json:
        print_json(_facts(extraction) | {"files": [str(file) for file in files]})
    else:
        _show(extraction)
        if files:
            say(f"wrote {files[0]}" + (f" and {len(files) - 1} meshes" if len(files) > 1 else ""))
    size = max(1.0, extraction.description.reach)
    return 0 if extraction.changes or extraction.residual.largest <= AGREES * size else 1


def chain_words(name: str, base: str | None, tip: str | None) -> tuple[Path, str | None, str | None]:
    """Return the file, base and tip that a name and its options stand for.

    Raises
    ------
    DescriptionError
        A link is given twice.
    """
    path, own_base, own_tip = urdf_source(name)
    for what, option, own in (("base", base, own_base), ("tip", tip, own_tip)):
        if option is not None and own is not None:
            raise DescriptionError(f"{name}: --{what} {option}: found #{own} too; expected one of them")
    return path, own_base if base is None else base, own_tip if tip is None else tip


def list_examples(json: bool) -> None:
    """Print the chains of example-robot-data that load by name."""
    chains = list(example_chains())
    if json:
        print_json(
            [
                {"name": chain.name, "joints": list(chain.joints), "base": chain.base, "tip": chain.tip}
                for chain in chains
            ]
        )
        return
    print_table(("name", "joints", "tip"), [(chain.name, str(len(chain.joints)), chain.tip) for chain in chains])


def _show(extraction: Extraction) -> None:
    arm = Arm(extraction.description)
    say(f"{arm.name}: {arm.description.source}", "bold")
    say(f"\n{arm.dh}\n")
    for what, T in _ends(arm.description).items():
        if not np.array_equal(T, np.eye(4)):
            xyz, rpy = pose_parts(T, order="xyz", degrees=True)
            say(f"{what}: xyz ({_listed(xyz)}) m, rpy ({_listed(rpy)})°")
    for change in extraction.changes:
        say(f"as designed: {change}")
    for note in (*extraction.notes, *arm.description.warnings):
        say(note)


def _facts(extraction: Extraction) -> dict[str, Any]:
    description, residual = extraction.description, extraction.residual
    numbers = description.numbers
    return {
        "name": description.name,
        "convention": description.convention.value,
        "joints": [
            {
                "name": joint.name,
                "type": joint.type.value,
                "theta_rad": float(numbers.theta[i]),
                "d_m": float(numbers.d[i]),
                "a_m": float(numbers.a[i]),
                "alpha_rad": float(numbers.alpha[i]),
            }
            for i, joint in enumerate(description.joints)
        ],
        **{what: T.tolist() for what, T in _ends(description).items()},
        "residual": {"tool": residual.tool, "M": residual.mass_matrix, "g": residual.gravity},
        "decimals": extraction.decimals,
        "changes": list(extraction.changes),
        "notes": [*extraction.notes, *description.warnings],
    }


def _ends(description: Description) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    return {"base": description.numbers.T_world_base, "tool": description.numbers.T_last_tool}


def _listed(values: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    return ", ".join(f"{value + 0.0:.10g}" for value in np.round(values, 9))
