"""`dhkit extract`: the Denavit-Hartenberg table of a URDF's chain."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from dhkit.arm import Arm
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import Json
from dhkit.cli.output import print_json, print_table, say
from dhkit.description import Array, Description, pose_parts
from dhkit.errors import DescriptionError
from dhkit.model import Extraction, example_chains, extract_dh, urdf_source
from dhkit.model.robot_folder import write_robot_with_meshes

TURNED = 4.0
"""Largest difference, in sizes of the arm, for each radian by which axes were turned to be parallel."""
TOLERANCE = 1e-9
"""Largest difference from the file, as a share of the reach, of a table that is the same robot."""

app = typer.Typer(rich_markup_mode=None)


@app.command()
def extract(
    urdf: Annotated[
        str, typer.Argument(metavar="FILE", help="A URDF, or example:NAME of example-robot-data.")
    ],
    base: Annotated[
        str | None,
        typer.Option(help="First link of the chain, which becomes the world; default: the root."),
    ] = None,
    tip: Annotated[
        str | None, typer.Option(help="Last link of the chain; not needed if there is one chain.")
    ] = None,
    modified: Annotated[
        bool,
        typer.Option("--modified", help="Return a modified (Craig's) table, not a standard one."),
    ] = False,
    as_designed: Annotated[
        bool,
        typer.Option(
            "--as-designed", help="Read 1.5708 as a right angle, and say what that changes."
        ),
    ] = False,
    exact: Annotated[
        bool,
        typer.Option(
            "--exact",
            help="Keep axes that rounded angles leave a little from parallel as they are.",
        ),
    ] = False,
    drop: Annotated[
        bool,
        typer.Option(
            "--drop-side",
            help="Leave out links after joints beside the chain; else they are frozen.",
        ),
    ] = False,
    package_dir: Annotated[
        list[Path] | None,
        typer.Option(help="Folder with packages that package:// names; may be given again."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The robot file to write (.toml).")
    ] = None,
    json: Json = False,
) -> ExitStatus:
    """Find the Denavit-Hartenberg table of a URDF's chain, with its bodies, limits and meshes.

    Prints how far the table is from the file; exit status 1 where that is more than 1e-9, and more than the angles by
    which axes were made parallel.
    """
    if output is not None and output.suffix.lower() != ".toml":
        raise DescriptionError(f"{output}: expected a robot file that ends in .toml")
    path, base, tip = chain_of(urdf, base, tip)
    extraction = extract_dh(
        path,
        base,
        tip,
        convention="modified" if modified else "standard",
        side="drop" if drop else "freeze",
        as_designed=as_designed,
        exact=exact,
        package_dirs=package_dir or (),
    )
    files = [] if output is None else write_robot_with_meshes(extraction.description, output)
    if json:
        print_json(_facts(extraction) | {"files": [str(file) for file in files]})
    else:
        _show(extraction)
        if files:
            say(f"wrote {files[0]}" + (f" and {len(files) - 1} meshes" if len(files) > 1 else ""))
    size = max(1.0, extraction.description.reach)
    agrees = (
        extraction.changes
        or extraction.residual.largest <= (TOLERANCE + TURNED * extraction.turned) * size
    )
    return ExitStatus.FINE if agrees else ExitStatus.NO


def chain_of(name: str, base: str | None, tip: str | None) -> tuple[Path, str | None, str | None]:
    """Return the file, base and tip of a name such as FILE#TIP and of the options --base and --tip.

    Raises
    ------
    DescriptionError
        A link is given twice.
    """
    path, own_base, own_tip = urdf_source(name)
    for name_of_link, option, own in (("base", base, own_base), ("tip", tip, own_tip)):
        if option is not None and own is not None:
            raise DescriptionError(
                f"{name}: --{name_of_link} {option}: found #{own} too; expected one of them"
            )
    return path, own_base if base is None else base, own_tip if tip is None else tip


def list_examples(json: bool) -> None:
    """Print the chains of example-robot-data that load by name."""
    chains = list(example_chains())
    if json:
        print_json(
            [
                {"name": c.name, "joints": list(c.joints), "base": c.base, "tip": c.tip}
                for c in chains
            ]
        )
        return
    print_table(
        ("name", "joints", "tip"),
        [(chain.name, str(len(chain.joints)), chain.tip) for chain in chains],
    )


def _show(extraction: Extraction) -> None:
    arm = Arm(extraction.description)
    say(f"{arm.name}: {arm.description.source}", "bold")
    say(f"\n{arm.dh}\n")
    for frame, T in _ends(arm.description).items():
        if not np.array_equal(T, np.eye(4)):
            xyz, rpy = pose_parts(T, order="xyz", degrees=True)
            say(f"{frame}: xyz ({_text(xyz)}) m, rpy ({_text(rpy)})°")
    for change in extraction.changes:
        say(f"as designed: {change}")
    for note in (*extraction.notes, *arm.description.warnings):
        say(note)


def _facts(extraction: Extraction) -> dict[str, Any]:
    description = extraction.description
    residual = extraction.residual
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
        **{frame: T.tolist() for frame, T in _ends(description).items()},
        "residual": {"tool": residual.tool, "M": residual.mass_matrix, "g": residual.gravity},
        "decimals": extraction.decimals,
        "changes": list(extraction.changes),
        "notes": [*extraction.notes, *description.warnings],
    }


def _ends(description: Description) -> dict[str, Array]:
    return {"base": description.numbers.T_world_base, "tool": description.numbers.T_last_tool}


def _text(values: Array) -> str:
    return ", ".join(f"{value + 0.0:.10g}" for value in np.round(values, 9))
