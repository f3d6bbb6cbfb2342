"""`dhkit lab` and `dhkit view`: an arm in the browser, until Ctrl-C."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from dhkit.cli.endings import end_in_order_on_signals
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.isolating import Isolated, isolation_for
from dhkit.cli.options import Robot, load_arm
from dhkit.cli.output import PAGES, check_outputs, say
from dhkit.errors import DescriptionError
from dhkit.lab import Assignment, serve
from dhkit.lab.assignment import is_assignment
from dhkit.programs import protect_from_children
from dhkit.viewer.opening import open_in_browser

app = typer.Typer(rich_markup_mode=None)


def until_interrupted(url: str, what: str, *, open_browser: bool) -> ExitStatus:
    """Print the address of a page, open it, and wait for Ctrl-C, SIGTERM or SIGHUP."""
    end_in_order_on_signals()
    try:
        say(f"{what} at {url}; Ctrl-C ends it")
        if open_browser:
            open_in_browser(url)
        while True:
            time.sleep(3600)
    except KeyboardInterrupt:
        return ExitStatus.FINE


@app.command()
def lab(
    robot: Annotated[
        str, typer.Argument(help="A library name, a robot file or an assignment (.toml).")
    ],
    port: Annotated[
        int | None,
        typer.Option(
            min=1024,
            max=65535,
            help="Port of the page; the address, token included, stays the same.",
        ),
    ] = None,
    mine: Annotated[
        Path | None, typer.Option(help="Your file (.py, .m) with fk, ik or controller.")
    ] = None,
    run: Annotated[
        str | None, typer.Option(help="Your program instead of a file; ARGUMENTS follow the robot.")
    ] = None,
    arguments: Annotated[
        list[str] | None, typer.Argument(help="Arguments of the program of --run.")
    ] = None,
    isolated: Isolated = False,
    solid: Annotated[
        Path | None, typer.Option(help="STL file for the panel of transforms.")
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(
            help="Folder in which the work on an assignment is recorded, to be handed in."
        ),
    ] = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address, and open no browser.")
    ] = False,
) -> ExitStatus:
    """Open an arm in the browser: move, drive, edit, plan and control it; Ctrl-C ends it."""
    if mine is not None and run is not None:
        raise DescriptionError("--mine and --run; expected one of them")
    if arguments and run is None:
        raise DescriptionError(
            f"{arguments[0]!r} after the robot; expected --run PROGRAM for arguments"
        )
    own = mine if run is None else [run, *(arguments or [])]
    assignment = Assignment.read(robot) if is_assignment(robot) else None
    if record is not None and assignment is None:
        raise DescriptionError(
            f'--record: {robot} is not an assignment; expected a file with kind = "assignment"'
        )
    arm = load_arm(robot) if assignment is None else assignment.arm
    what = f"the lab of {arm.name}" if assignment is None else f"{assignment.title}: the lab"
    found = None
    if own is not None:
        protect_from_children()
        found = isolation_for(Path(str(mine or run)).name, isolated)
    with serve(
        arm,
        block=False,
        port=port,
        open_browser=False,
        own=own,
        isolation=found,
        solid=solid,
        assignment=None if assignment is None else robot,
        loaded_from=robot if assignment is None else None,
        record=record,
    ) as served:
        return until_interrupted(served.url, what, open_browser=not no_browser)


@app.command()
def view(
    robot: Robot,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address, and open no browser.")
    ] = False,
    html: Annotated[
        Path | None, typer.Option(help="Write a page instead of opening the browser.")
    ] = None,
) -> ExitStatus:
    """Show an arm in the browser, to look at; Ctrl-C ends it."""
    arm = load_arm(robot)
    check_outputs(((html, PAGES),))
    with arm.view() as shown:
        if html is not None:
            say(f"wrote {shown.save_html(html, interactive=True)}")
            return ExitStatus.FINE
        return until_interrupted(shown.url, arm.name, open_browser=not no_browser)
