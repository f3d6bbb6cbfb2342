"""`dhkit report`: an arm written up as an article, as PDF, HTML or LaTeX."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dhkit.cli.options import Json, Robot, Uniform, load_arm
from dhkit.cli.output import output_folder, print_json, say, say_written
from dhkit.errors import DescriptionError
from dhkit.report import FORMATS

app = typer.Typer(rich_markup_mode=None)


@app.command()
def report(
    robot: Robot,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write; default: out/NAME.")
    ] = None,
    motion: Annotated[
        Path | None, typer.Option(help="File of the motion to show; default: a quintic.")
    ] = None,
    run: Annotated[
        Path | None,
        typer.Option(
            help="File of a simulation to show, of the robot or of it with locked joints."
        ),
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help=f"Format: {', '.join(FORMATS)}; pdf needs typst.")
    ] = "pdf",
    uniform: Uniform = False,
    json: Json = False,
) -> None:
    """Write a robot up as an article of at most 30 pages: PDF, HTML or LaTeX, with its programs beside it.

    Kinematics, inverse kinematics worked out, dynamics, verification, a motion and controllers, with empty places for
    the student's own text.
    """
    if form not in FORMATS:
        raise DescriptionError(f"--format: found {form!r}; expected {', '.join(FORMATS)}")
    arm = load_arm(robot, uniform)
    folder = output_folder(output, arm.name)
    written = arm.report(folder, motion, run, form)
    if json:
        files = [str(path) for path in written.files]
        print_json({"robot": arm.name, "files": files, "pages": written.pages})
        return
    say_written(written.files)
    if written.pages is not None:
        say(f"{written.pages} pages")
