"""Arguments and options of several commands."""

from __future__ import annotations

import sys
from contextvars import ContextVar
from typing import Annotated, Any

import typer

from dhkit.arm import Arm
from dhkit.description import robots as library_names
from dhkit.description.joint_text import DEGREES

Robot = Annotated[
    str,
    typer.Argument(
        help="A library name (see `dhkit robots`), a robot file (.toml) or a URDF; FILE.urdf#TIP."
    ),
]


def _use_degrees(degrees: bool) -> bool:
    """Set the unit of angles in messages to that of the command's arguments."""
    DEGREES.set(degrees)
    return degrees


def degrees_option(text: str) -> Any:
    """Return the option ``--degrees`` with a help text; with it, messages have angles in degrees too."""
    return typer.Option("--degrees", callback=_use_degrees, help=text)


Degrees = Annotated[bool, degrees_option("Angles in and out are in degrees.")]
Uniform = Annotated[
    bool,
    typer.Option(
        "--uniform-links", help="Replace the bodies of the links by thin uniform rods of 1 kg each."
    ),
]
Columns = Annotated[
    str | None,
    typer.Option(
        "--columns",
        metavar="OURS=THEIRS ...",
        help='Columns of a file of another program, such as "t=tout q=yout".',
    ),
]
EulerAngles = Annotated[str, typer.Option(metavar="A B C", help="Euler angles of the tool, rad.")]
EulerOrder = Annotated[
    str,
    typer.Option(
        help="Convention of the Euler angles: XYZ about moving axes, xyz about fixed ones."
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the random states.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]


AS_DESIGNED: ContextVar[bool] = ContextVar("as_designed", default=False)
"""Whether rounded angles of URDFs are read as right angles; set by the option that all commands with a robot have."""


def as_designed_option() -> Any:
    """Return the option ``--as-designed``, as typer makes it of a command's parameter."""

    def use(value: bool) -> bool:
        AS_DESIGNED.set(value)
        return value

    option = typer.Option(
        "--as-designed",
        callback=use,
        help="Read rounded angles of a URDF, such as 1.5708, as the right angles that they stand for.",
    )

    def command(as_designed: Annotated[bool, option] = False) -> None:
        """Have the option."""

    # Annotations of this file are text, and typer does not see the names inside this function.
    command.__annotations__["as_designed"] = Annotated[bool, option]
    app = typer.Typer()
    app.command()(command)
    parameter = next(
        each for each in typer.main.get_command(app).params if each.name == "as_designed"
    )
    parameter.expose_value = False
    return parameter


def read_arm(robot: str) -> Arm:
    """Return a robot by name or file."""
    return Arm.load(robot, as_designed=AS_DESIGNED.get())


def load_arm(robot: str, uniform: bool = False) -> Arm:
    """Return a robot by name or file; ``uniform`` replaces its bodies by uniform rods.

    Warnings about a file are printed on stderr: a mesh that is missing is not free space. Those about robots of the
    library concern published data, and `dhkit info` prints them.
    """
    arm = read_arm(robot)
    if robot not in library_names():
        for warning in arm.description.warnings:
            sys.stderr.write(f"dhkit: warning: {warning}\n")
    return arm.with_uniform_links() if uniform else arm
