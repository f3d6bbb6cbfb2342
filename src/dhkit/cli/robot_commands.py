"""Commands about a robot itself: list, show, build, import, forward and inverse kinematics."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dhkit.arm import Arm
from dhkit.cli.arguments import OutsideLimits, option_values, target, with_long_options
from dhkit.cli.options import Degrees, Json, Robot, Uniform, degrees_option, load_arm
from dhkit.cli.output import print_json, say_written
from dhkit.description.files import check_place
from dhkit.errors import DescriptionError

app = typer.Typer()


@app.command()
def robots(
    examples: Annotated[
        bool, typer.Option("--examples", help="Those of the package example-robot-data instead.")
    ] = False,
    json: Json = False,
) -> None:
    """List the robots of the library."""
    if examples:
        from dhkit.cli import extract as extract_command

        extract_command.list_examples(json)
        return
    from dhkit.cli import info as info_command

    info_command.list_robots(json)


@app.command()
def info(robot: Robot, json: Json = False) -> None:
    """Show a robot: its DH table, limits, masses, configurations and what is odd about it."""
    from dhkit.cli import info as info_command

    info_command.show(Arm.load(robot), json)


@app.command()
def build(
    robot: Robot,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The URDF to write; ./NAME.urdf.")] = None,
    mesh_prefix: Annotated[
        str | None, typer.Option(help="What it names its meshes by, as package://my_robot/meshes/; meshes/.")
    ] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> None:
    """Write a robot's URDF, with its meshes beside it."""
    arm = load_arm(robot, uniform)
    path = output or Path(f"{arm.name}.urdf")
    if path.suffix == ".toml":
        raise DescriptionError(f"{path}: a URDF would overwrite a robot file; expected another name")
    check_place(path)
    files = arm.write_urdf(path, mesh_prefix)
    if json:
        print_json({"files": [str(file) for file in files]})
    else:
        say_written(files)


@app.command(name="import-cad", cls=with_long_options({"--at": None}))
def import_cad(
    folder: Annotated[
        Path,
        typer.Argument(help="Mesh files, one a link, exported in one pose in assembly coordinates; or a .mat file."),
    ],
    table: Annotated[str, typer.Option("--table", help="The DH table: a robot file (.toml) or a library name.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The new folder: robot.toml, robot.urdf, meshes.")],
    density: Annotated[float | None, typer.Option(help="Of all links, kg/m^3; nothing is assumed.")] = None,
    mass: Annotated[list[str] | None, typer.Option(metavar="LINK=KG", help="Of one link; may be given again.")] = None,
    report: Annotated[
        list[Path] | None, typer.Option(help="Mass properties from the CAD program: SolidWorks' text or a .csv.")
    ] = None,
    unit: Annotated[str | None, typer.Option(help="Of the files: m, cm, mm or in; by size unless given.")] = None,
    simplify: Annotated[int | None, typer.Option(metavar="N", help="Reduce parts to N triangles.")] = None,
    mapping: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="LINK=FILE", help="Where names do not say it; may be given again."),
    ] = None,
    at: Annotated[
        str | None, typer.Option(metavar="Q ...", help="Joint values of the export; ready, else zero, unless given.")
    ] = None,
    degrees: Annotated[bool, degrees_option("Angles of --at are in degrees.")] = False,
    json: Json = False,
) -> int:
    """Make a robot of a CAD assembly's parts and a DH table: meshes in their links' frames, masses, TOML and URDF."""
    from dhkit.cli import import_cad as import_cad_command

    return import_cad_command.run(
        folder,
        Arm.load(table),
        output,
        density=density,
        masses=mass or (),
        reports=report or (),
        unit=unit,
        simplify=simplify,
        mapping=mapping or (),
        at=at,
        degrees=degrees,
        json=json,
    )


@app.command(context_settings={"ignore_unknown_options": True})
def fk(
    robot: Robot,
    q: Annotated[list[str], typer.Argument(help="Joint values, or the name of a configuration such as ready.")],
    degrees: Degrees = False,
    frames: Annotated[bool, typer.Option("--frames", help="All DH frames too.")] = False,
    json: Json = False,
) -> None:
    """Print where the tool is for given joint values (rad and m)."""
    from dhkit.cli import info as info_command

    info_command.forward(Arm.load(robot), q, degrees=degrees, with_frames=frames, json=json)


@app.command(cls=with_long_options({"--xyz": 3, "--euler": 3, "--matrix": None, "--like": None, "--near": None}))
def ik(
    robot: Robot,
    xyz: Annotated[str | None, typer.Option(metavar="X Y Z", help="The tool's position, m.")] = None,
    euler: Annotated[str, typer.Option(metavar="A B C", help="Its Euler angles, rad.")] = "0 0 0",
    order: Annotated[str, typer.Option(help="Of the Euler angles: XYZ moving axes, xyz fixed ones.")] = "XYZ",
    matrix: Annotated[
        str | None, typer.Option(metavar="M11 ... M44", help="The pose by row, 16 or 12 numbers; or a file of them.")
    ] = None,
    like: Annotated[str | None, typer.Option(metavar="Q ...", help="Where these joint values put the tool.")] = None,
    near: Annotated[str | None, typer.Option(metavar="Q ...", help="Mark the branch nearest to these values.")] = None,
    degrees: Degrees = False,
    limits: Annotated[bool, typer.Option("--limits", help="Only branches inside the joint limits.")] = False,
    numeric: Annotated[bool, typer.Option("--numeric", help="One solution, by iteration, for any arm.")] = False,
    json: Json = False,
) -> int:
    """Print every way to put the tool at a pose, given by --xyz, --matrix or --like; exit status 1 where there is none.

    Numbers may be expressions such as 17*inch or pi/2; joint values may be the name of a configuration.
    """
    from dhkit.cli import inverse as inverse_command

    arm = Arm.load(robot)
    return inverse_command.run(
        arm,
        target(arm, xyz=xyz, euler=euler, order=order, matrix=matrix, like=like, degrees=degrees),
        near=None if near is None else option_values(arm, near, "--near", degrees, OutsideLimits.ALLOWED),
        order=order,
        degrees=degrees,
        limits=limits,
        numeric=numeric,
        json=json,
    )
