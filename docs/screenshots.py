"""`make assets`: the pictures of the lab in docs/, taken in a headless Chromium; where that is missing, says so."""

from __future__ import annotations

import io
import json
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image

import dhkit
from dhkit.lab import Assignment, Lab

ROOT = Path(__file__).resolve().parents[1]
SIZE = 1280, 720
LARGEST = 200_000
"""Bytes of a picture."""
STATE = "dhkit.lab.state"


def joints(lab, page):
    """Show the sliders of a PUMA."""
    lab.answer("joints.named", {"name": "nominal"})
    page.settle()


def tool(lab, page):
    """Show a target, the branch that is followed, and the others as ghosts."""
    lab.answer("joints.set", {"q": [0.9, 0.9, -2.7, 0.5, 0.8, 0.2]})
    lab.answer("tool.target", {"T": lab.desk.arm.fk(lab.desk.q).ravel().tolist()})
    page.until(f"{STATE}.target && {STATE}.target.branches.length === 8")
    lab.answer("tool.choose", {"branch": "left down no-flip"})
    page.until(f"{STATE}.target.chosen === 'left down no-flip'")
    time.sleep(0.5)
    page.evaluate("document.getElementById('reset').click()")


def table(lab, page):
    """Show an edited table, the frames, and the third of the four transforms of row 2."""
    lab.answer("tool.clear", {})
    lab.answer("joints.named", {"name": "nominal"})
    lab.answer("table.edit", {"row": 1, "column": "a", "text": "0.5"})
    page.until(f"{STATE}.table.changed")
    time.sleep(1.0)  # the arm is drawn anew
    switch_frames(page, "true")
    page.evaluate(
        "[...document.querySelectorAll('#panel-table button')].find(b => b.textContent.trim() === '2')?.click()"
    )
    time.sleep(1.2)


def switch_frames(page, wanted):
    """Show the frames of the arm, or hide them."""
    if page.evaluate("document.getElementById('frames').getAttribute('aria-pressed')") != wanted:
        page.evaluate("document.getElementById('frames').click()")


def motion(lab, page):
    """Show a motion in least time, at 60 % of its way."""
    lab.answer("table.reset", {})
    switch_frames(page, "false")
    lab.answer("joints.named", {"name": "nominal"})
    lab.answer(
        "motion.plan", {"kind": "least-time", "goal": {"q": [1.2, 0.3, -0.8, 0.5, -0.6, 1.0]}}
    )
    page.until(f"{STATE}.motion && !{STATE}.job")
    page.evaluate("document.querySelector('#panel-motion select').value = 'least-time'")
    time.sleep(2.0)  # the player has shown the whole way, and the trace
    page.evaluate(
        "(time => { time.value = 0.6 * time.max; time.dispatchEvent(new Event('input')); })"
        "(document.getElementById('time'))"
    )


def control(lab, page):
    """Show a controller that follows a sine with a load it does not know of, and was pushed."""
    lab.answer("motion.clear", {})
    lab.answer("joints.named", {"name": "nominal"})
    settings = {
        "controller": "computed-torque",
        "bandwidth": 20.0,
        "payload": 2.5,
        "reference": "sine",
    }
    lab.answer("control.start", settings)
    page.until(f"{STATE}.control.time > 4")
    lab.answer("control.push", {"link": None, "force": [0.0, 60.0, 0.0], "duration": 0.3})
    page.until(f"{STATE}.control.time > 7")
    page.evaluate("document.querySelector('.panels').scrollTop = 470")


def dynamics(lab, page):
    """Show gravity torques, the mass matrix, a formula, and the ellipsoid of the tool's velocities."""
    lab.answer("control.stop", {})
    lab.answer("joints.named", {"name": "nominal"})
    lab.answer("dynamics.entry", {"name": "M33"})
    lab.answer("dynamics.ellipsoid", {"on": True})
    page.until("document.querySelector('#panel-dynamics .entry math')")
    time.sleep(0.5)


def workspace(lab, page):
    """Show a slice of what the tool reaches."""
    lab.answer("dynamics.ellipsoid", {"on": False})
    lab.answer("workspace.show", {"kind": "slice"})
    page.until(f"{STATE}.workspace.count > 1000")
    time.sleep(1.5)


def transforms(lab, page):
    """Show the course's box after two of three steps, without the arm."""
    lab.answer("workspace.show", {"kind": "none"})
    own = "dhkit.lab.panels.find(panel => panel.name === 'transforms').panel"
    steps = [
        ("turn", "z", "30°", "fixed"),
        ("move", "y", "0.3", "current"),
        ("turn", "x", "60°", "current"),
    ]
    listed = [dict(zip(("kind", "axis", "amount", "about"), step, strict=True)) for step in steps]
    page.evaluate(f"{own}.change(() => ({own}.steps = {json.dumps(listed)}))")
    page.evaluate("document.querySelector('#panel-transforms input[type=checkbox]').click()")
    page.evaluate(f"{own}.run()")
    page.until("document.querySelectorAll('#panel-transforms .step li').length === 3")
    time.sleep(3.2)
    page.evaluate("document.getElementById('reset').click()")


PANELS = {
    "joints": joints,
    "tool": tool,
    "table": table,
    "motion": motion,
    "control": control,
    "dynamics": dynamics,
    "workspace": workspace,
    "transforms": transforms,
}


def task(browser):
    """Return a picture of an assignment of which a part is done."""
    assignment = Assignment.read(ROOT / "docs" / "examples" / "assignment_puma.toml")
    with Lab(assignment.arm, assignment=assignment) as lab:
        page = browser.page(*SIZE)
        page.open(lab.url)
        page.until(f"globalThis.dhkit?.lab?.state.task && {STATE}.control")
        lab.answer("joints.set", {"q": [np.pi / 2, 0.0, 0.0, 0.0, 0.0, 0.0]})
        page.until(f"{STATE}.task.points === 1")
        page.settle()
        picture = page.screenshot(fine=True)
        page.close()
    return picture


def write(name, picture):
    """Write a picture, shape (height, width, 3), as docs/lab-NAME.png."""
    content = compressed(picture)
    if len(content) > LARGEST:
        raise ValueError(f"lab-{name}.png has {len(content)} bytes; expected {LARGEST} at most")
    (ROOT / "docs" / f"lab-{name}.png").write_bytes(content)


def compressed(picture: np.ndarray) -> bytes:
    """Return a picture, shape (height, width, 3), as a PNG; if too large, with a palette, a little off in color."""
    image = Image.fromarray(picture.astype(np.uint8))
    file = io.BytesIO()
    image.save(file, "PNG", optimize=True)
    if len(file.getvalue()) > LARGEST:
        file = io.BytesIO()
        image.quantize(256, dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
    return file.getvalue()


def main() -> None:
    """Write docs/lab-PANEL.png for every panel."""
    sys.path.insert(0, str(ROOT / "tests"))
    try:
        from viewer.chromium import BINARY, Chromium
    except ImportError as error:
        sys.stderr.write(f"docs/lab-*.png stay as they are: {error} (pip install '.[test]')\n")
        return
    if BINARY is None:
        sys.stderr.write(
            "docs/lab-*.png stay as they are: Chromium is not installed (apt-get install chromium)\n"
        )
        return
    browser = Chromium()
    try:
        with Lab(dhkit.Arm.load("puma560")) as lab:
            page = browser.page(*SIZE)
            page.open(lab.url)
            page.until(
                "globalThis.dhkit?.lab?.state.control && dhkit.lab.state.table && dhkit.lab.state.waypoints"
            )
            for name, prepare in PANELS.items():
                page.evaluate(f"document.getElementById('tab-{name}').click()")
                prepare(lab, page)
                time.sleep(0.5)
                write(name, page.screenshot(fine=True))
            page.close()
        write("task", task(browser))
    finally:
        browser.close()


if __name__ == "__main__":
    main()
