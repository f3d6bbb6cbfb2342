"""`dhkit picture` and `dhkit play`: an arm or a motion of a file, as PNG or GIF, in the browser, or as a page."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from dhkit.arm import Arm
from dhkit.cli.arguments import columns as column_names, joint_values, with_long_options
from dhkit.cli.browser import until_interrupted
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import Columns, Robot, Uniform, degrees_option, load_arm
from dhkit.cli.output import PAGES, check_outputs, say, say_written
from dhkit.control import SimulationResult
from dhkit.control.result_files import SIMULATION
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory, read_motion, written_by_dhkit
from dhkit.viewer.picture_files import write_motion_gif, write_motion_pngs, write_png
from dhkit.viewer.pictures import picture as draw_picture

SIZE = re.compile(r"(\d{1,5})x(\d{1,5})")

app = typer.Typer(rich_markup_mode=None)


@app.command(cls=with_long_options({"--at": None}))
def picture(
    robot: Robot,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="File to write: .png, or .gif of a motion.")
    ],
    at: Annotated[
        str | None,
        typer.Option(metavar="Q ...", help="Joint values, or the name of a configuration."),
    ] = None,
    motion: Annotated[
        Path | None, typer.Option(help="File of a motion or a simulation to draw.")
    ] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Width and height, px.")] = None,
    count: Annotated[
        int, typer.Option(min=2, max=900, help="Number of PNG files of a motion.")
    ] = 6,
    rate: Annotated[
        float, typer.Option(min=1, max=50, help="Pictures per second of a GIF.")
    ] = 15.0,
    frames: Annotated[bool, typer.Option("--frames", help="Draw the DH frames.")] = False,
    degrees: Annotated[bool, degrees_option("Angles are in degrees.")] = False,
    uniform: Uniform = False,
) -> None:
    """Write a picture of an arm, or of a motion: PNG files or a GIF; no browser is needed."""
    arm = load_arm(robot, uniform)
    check_outputs(((output, (".png",) if motion is None else (".png", ".gif")),))
    if motion is not None and at is not None:
        raise DescriptionError("--at and --motion: expected one of them")
    shape = _size(size or ("480x360" if output.suffix.lower() == ".gif" else "960x720"))
    if motion is None:
        q = None if at is None else joint_values(arm, [at], degrees)
        say(
            f"wrote {write_png(draw_picture(arm.description, q, size=shape, frames=frames), output)}"
        )
        return
    played = _read(arm, motion, degrees=degrees)
    if output.suffix.lower() == ".gif":
        say(
            f"wrote {write_motion_gif(arm.description, played, output, rate=rate, size=shape, frames=frames)}"
        )
        return
    say_written(
        write_motion_pngs(arm.description, played, output, count=count, size=shape, frames=frames)
    )


def _size(text: str) -> tuple[int, int]:
    match = SIZE.fullmatch(text)
    if match is None:
        raise DescriptionError(
            f"--size {text[:40]}: expected width and height in px, such as 960x720"
        )
    return int(match[1]), int(match[2])


@app.command()
def play(
    robot: Robot,
    file: Annotated[Path, typer.Argument(help="File of a motion or a simulation.")],
    html: Annotated[
        Path | None, typer.Option(help="Write a page instead of opening the browser.")
    ] = None,
    columns: Columns = None,
    degrees: Annotated[
        bool, degrees_option("Angles in a file of another program are in degrees.")
    ] = False,
    uniform: Uniform = False,
) -> ExitStatus:
    """Play a motion or a simulation in the browser, or write a page of it."""
    arm = load_arm(robot, uniform)
    check_outputs(((html, PAGES),))
    played = _read(arm, file, degrees=degrees, names=columns)
    with arm.view() as view:
        view.play(played)
        if html is not None:
            caption = f"The motion of {file.name}."
            say(
                f"wrote {view.save_html(html, interactive=True, motions={file.name: played}, caption=caption)}"
            )
            return ExitStatus.FINE
        return until_interrupted(view.url, f"playing {file}", open_browser=True)


def _read(
    arm: Arm, path: Path, *, degrees: bool, names: str | None = None
) -> SimulationResult | Trajectory:
    """Return the simulation or the motion of a file."""
    if written_by_dhkit(path) == SIMULATION.title:
        return SimulationResult.load(path)
    return read_motion(path, arm.description, degrees=degrees, columns=column_names(names))
