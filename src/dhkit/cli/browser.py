"""`dhkit lab` and `dhkit view`: an arm in the browser, until Ctrl-C."""

from __future__ import annotations

import signal
import threading
import time
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.output import PAGES, check_outputs, say
from dhkit.lab import Assignment, serve
from dhkit.lab.assignment import is_assignment
from dhkit.programs import protect_from_children


def until_interrupted(url: str, what: str, *, open_browser: bool) -> ExitStatus:
    """Print the address of a page, open it, and wait for Ctrl-C or SIGTERM."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _raise_interrupt)  # processes are ended, and folders removed
    try:
        say(f"{what} at {url}; Ctrl-C ends it")
        if open_browser:
            webbrowser.open(url)
        while True:
            time.sleep(3600)
    except KeyboardInterrupt:
        return ExitStatus.FINE


def _raise_interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def run_lab(
    robot: str,
    port: int | None,
    *,
    open_browser: bool,
    own: Path | Sequence[str] | None = None,
    sandbox: str | None = None,
    solid: Path | None = None,
) -> ExitStatus:
    """Serve a lab of a robot, or of an assignment, until it is interrupted."""
    assignment = Assignment.read(robot) if is_assignment(robot) else None
    arm = Arm.load(robot) if assignment is None else assignment.arm
    what = f"the lab of {arm.name}" if assignment is None else f"{assignment.title}: the lab"
    if own is not None:
        protect_from_children()
    with serve(
        arm,
        block=False,
        port=port,
        open_browser=False,
        own=own,
        sandbox=sandbox,
        solid=solid,
        assignment=assignment,
    ) as lab:
        return until_interrupted(lab.url, what, open_browser=open_browser)


def run_view(arm: Arm, page: Path | None, *, open_browser: bool) -> ExitStatus:
    """Show an arm until it is interrupted, or write a page of it."""
    check_outputs(((page, PAGES),))
    with arm.view() as view:
        if page is not None:
            say(f"wrote {view.save_html(page, interactive=True)}")
            return ExitStatus.FINE
        return until_interrupted(view.url, arm.name, open_browser=open_browser)
