"""`dhkit play`: a motion or a simulation of a file, in the browser or as a page."""

from __future__ import annotations

from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.arguments import columns
from dhkit.cli.browser import until_interrupted
from dhkit.cli.output import say
from dhkit.cli.outputs import PAGES, check_outputs
from dhkit.control import SimulationResult
from dhkit.control.result_files import SIMULATION
from dhkit.trajectories import read_motion, written_by_dhkit


def run(arm: Arm, path: Path, page: Path | None, *, degrees: bool, names: str | None = None) -> int:
    """Play a motion or a simulation of a file in the browser until it is interrupted, or write a page of it."""
    check_outputs(((page, PAGES),))
    title = written_by_dhkit(path)
    played = (
        SimulationResult.load(path)
        if title == SIMULATION.title
        else read_motion(path, arm.description, degrees=degrees, columns=columns(names))
    )
    with arm.view() as view:
        view.play(played)
        if page is not None:
            caption = f"The motion of {path.name}."
            say(f"wrote {view.save_html(page, interactive=True, motions={path.name: played}, caption=caption)}")
            return 0
        return until_interrupted(view.url, f"playing {path}", open_browser=True)
