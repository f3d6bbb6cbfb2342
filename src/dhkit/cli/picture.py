"""`dhkit picture` and `dhkit play`: an arm or a motion of a file, as PNG or GIF, in the browser, or as a page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.arguments import columns, joint_values
from dhkit.cli.browser import until_interrupted
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.output import PAGES, check_outputs, say, say_written
from dhkit.control import SimulationResult
from dhkit.control.result_files import SIMULATION
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory, read_motion, written_by_dhkit
from dhkit.viewer.picture_files import write_motion_gif, write_motion_pngs, write_png
from dhkit.viewer.pictures import picture

SIZE = re.compile(r"(\d{1,5})x(\d{1,5})")


def run(
    arm: Arm,
    output: Path,
    *,
    at: Sequence[str] | None,
    motion: Path | None,
    size: str | None,
    count: int,
    rate: float,
    frames: bool,
    degrees: bool,
) -> ExitStatus:
    """Write a picture of an arm, or pictures of a motion."""
    check_outputs(((output, (".png",) if motion is None else (".png", ".gif")),))
    if motion is not None and at is not None:
        raise DescriptionError("--at and --motion: expected one of them")
    shape = _size(size or ("480x360" if output.suffix.lower() == ".gif" else "960x720"))
    if motion is None:
        q = None if at is None else joint_values(arm, at, degrees)
        say(f"wrote {write_png(picture(arm.description, q, size=shape, frames=frames), output)}")
        return ExitStatus.FINE
    played = _read(arm, motion, degrees=degrees)
    if output.suffix.lower() == ".gif":
        say(f"wrote {write_motion_gif(arm.description, played, output, rate=rate, size=shape, frames=frames)}")
        return ExitStatus.FINE
    say_written(write_motion_pngs(arm.description, played, output, count=count, size=shape, frames=frames))
    return ExitStatus.FINE


def _size(text: str) -> tuple[int, int]:
    match = SIZE.fullmatch(text)
    if match is None:
        raise DescriptionError(f"--size {text[:40]}: expected width and height in px, such as 960x720")
    return int(match[1]), int(match[2])


def play(arm: Arm, path: Path, page: Path | None, *, degrees: bool, names: str | None = None) -> ExitStatus:
    """Play a motion or a simulation of a file in the browser until it is interrupted, or write a page of it."""
    check_outputs(((page, PAGES),))
    played = _read(arm, path, degrees=degrees, names=names)
    with arm.view() as view:
        view.play(played)
        if page is not None:
            caption = f"The motion of {path.name}."
            say(f"wrote {view.save_html(page, interactive=True, motions={path.name: played}, caption=caption)}")
            return ExitStatus.FINE
        return until_interrupted(view.url, f"playing {path}", open_browser=True)


def _read(arm: Arm, path: Path, *, degrees: bool, names: str | None = None) -> SimulationResult | Trajectory:
    """Return the simulation or the motion of a file."""
    if written_by_dhkit(path) == SIMULATION.title:
        return SimulationResult.load(path)
    return read_motion(path, arm.description, degrees=degrees, columns=columns(names))
