"""`dhkit build`, `dhkit import-cad` and `dhkit schema`: files of a robot, from its table or a CAD assembly; formats."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from dhkit.arm import Arm
from dhkit.cli.arguments import OutsideLimits, option_values, with_long_options
from dhkit.cli.options import Json, Robot, Uniform, degrees_option, load_arm
from dhkit.cli.output import print_json, report_files, say, say_written
from dhkit.cli.quantities import quantity
from dhkit.description.files import check_place
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.model.cad_assembly import import_cad as import_assembly
from dhkit.model.cad_files import LEFT_OUT

LINK_PAIR = re.compile(r"\s*(?:link\s*)?(\d{1,3})\s*=\s*(.*?)\s*", re.IGNORECASE | re.DOTALL)
LEFT_OUT_PAIR = re.compile(r"\s*-\s*=\s*(.*?)\s*", re.DOTALL)

SCHEMAS = {
    "robot": "dhkit.description.schema",
    "assignment": "dhkit.lab.assignment_form",
    "sheet": "dhkit.grading.schema",
    "rubric": "dhkit.grading.schema",
    "task": "dhkit.grading.schema",
    "motion": "dhkit.trajectories.schema",
}
"""Modules with a function ``NAME_schema``, by NAME."""

app = typer.Typer(rich_markup_mode=None)


@app.command()
def build(
    robot: Robot,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="URDF to write; default: ./NAME.urdf.")
    ] = None,
    mesh_prefix: Annotated[
        str | None,
        typer.Option(
            help="Prefix of the meshes' names, as package://my_robot/meshes/; default: meshes/."
        ),
    ] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> None:
    """Write a robot's URDF, with its meshes beside it."""
    arm = load_arm(robot, uniform)
    path = output or Path(f"{arm.name}.urdf")
    if path.suffix == ".toml":
        raise DescriptionError(
            f"{path}: a URDF would overwrite a robot file; expected another name"
        )
    check_place(path)
    files = arm.write_urdf(path, mesh_prefix)
    report_files(files, json=json)


@app.command(name="import-cad", cls=with_long_options({"--at": None}))
def import_cad(
    folder: Annotated[
        Path,
        typer.Argument(
            help="Mesh files, one a link, exported in one pose in assembly coordinates; or a .mat file."
        ),
    ],
    table: Annotated[
        str, typer.Option("--table", help="The DH table: a robot file (.toml) or a library name.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The new folder: robot.toml, robot.urdf, meshes.")
    ],
    density: Annotated[
        float | None, typer.Option(help="Density of all links, kg/m^3; none is assumed.")
    ] = None,
    mass: Annotated[
        list[str] | None,
        typer.Option(metavar="LINK=KG", help="Mass of one link; may be given again."),
    ] = None,
    report: Annotated[
        list[Path] | None,
        typer.Option(help="Mass properties from the CAD program: SolidWorks' text or a .csv."),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(help="Unit of the files: m, cm, mm or in; default: guessed from the size."),
    ] = None,
    simplify: Annotated[
        int | None, typer.Option(metavar="N", help="Reduce each part to N triangles.")
    ] = None,
    mapping: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="LINK=FILE",
            help="File of a link whose name does not say it; may be given again.",
        ),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="Q ...",
            help="Joint values of the export; default: the configuration ready if there is one, else zero.",
        ),
    ] = None,
    degrees: Annotated[bool, degrees_option("Angles of --at are in degrees.")] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace an earlier import in the folder.")
    ] = False,
    json: Json = False,
) -> None:
    """Make a robot of a CAD assembly's parts and a DH table: meshes in their links' frames, masses, TOML and URDF."""
    arm = Arm.load(table)
    imported = import_assembly(
        folder,
        arm.description,
        unit=unit,
        q=None if at is None else option_values(arm, at, "--at", degrees, OutsideLimits.WARN),
        density=density,
        mass={
            link: _mass(link, text) for link, text in _pairs(mass or (), "--mass", "1=3.2").items()
        },
        reports=report or (),
        simplify=simplify,
        files=_files(mapping or ()),
    )
    written = imported.write(output, force=force)
    warnings = [note for note in imported.notes if note.startswith("warning: ")]
    if json:
        links = {str(link): len(mesh.faces) for link, mesh in imported.meshes.items()}
        print_json(
            {
                "files": [str(path) for path in written],
                "notes": list(imported.notes),
                "triangles": links,
            }
        )
        return
    for note in imported.notes:
        say(note, "yellow" if note in warnings else "")
    bare = [i for i, joint in enumerate(imported.description.joints, start=1) if not joint.bodies]
    if bare:
        say(
            f"no body: link{'s' * (len(bare) > 1)} {', '.join(map(str, bare))}; state --density, --mass or --report"
        )
    say_written(written)


def _pairs(words: Sequence[str], option: str, example: str) -> dict[int, str]:
    """Read LINK=VALUE pairs.

    Raises
    ------
    DescriptionError
        A word is not such a pair, or a link is there twice.
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
        return quantity(text)
    except ExpressionError:
        raise DescriptionError(f"--mass {link}={text[:40]}: expected a number of kg") from None


def _files(mapping: Sequence[str]) -> dict[int, list[str]] | None:
    """Read --map: the files of links, and after "-=" those that are left out."""
    left_out = [match[1] for match in map(LEFT_OUT_PAIR.fullmatch, mapping) if match]
    pairs = _pairs(
        [word for word in mapping if not LEFT_OUT_PAIR.fullmatch(word)], "--map", '"3=forearm.stl"'
    )
    files = {link: _names(text) for link, text in pairs.items()}
    if left_out:
        files[LEFT_OUT] = _names(",".join(left_out))
    return files or None


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


@app.command()
def schema(what: Annotated[str, typer.Argument(help=f"Format: {', '.join(SCHEMAS)}.")]) -> None:
    """Print the JSON Schema of a file format."""
    if what not in SCHEMAS:
        raise DescriptionError(f"no schema {what!r}; expected {', '.join(SCHEMAS)}")
    print_json(getattr(import_module(SCHEMAS[what]), f"{what}_schema")(), indent=2)
