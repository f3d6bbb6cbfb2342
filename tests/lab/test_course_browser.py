"""The course project of Cao (2011), steps 3 to 6, done in the page; the actions of a person are counted."""

import json

import pytest

from lab.controls import button, labelled, panel
from waiting import wait_for

ACTIONS = {
    "3: forward kinematics with read-outs": 1,
    "3 and 5: inverse kinematics with the tool's path": 2,
    "4: frames and the DH table": 2,
    "4: the dimensions of another arm": 1,
    "4: the joints in motion": 3,
    "5: a circle of the tool": 3,
    "6: independent PID control": 3,
    "6: computed torque control": 2,
    "6: the two-link arm of joints 2 and 3": 2,
    "6: its equations of motion": 2,
    "6: two-link control": 2,
}
"""Clicks, drags, choices and entries that each task takes."""


class Person:
    """Does things on a page, and counts them.

    Parameters
    ----------
    page
        The lab's page.
    """

    def __init__(self, page):
        self.page = page
        self.actions = 0

    def click(self, element):
        """Click, once the page shows what the action before has changed."""
        self.actions += 1
        self.page.until(element)
        self.page.settle()
        self.page.click(element)

    def open_panel(self, name):
        self.actions += 1
        panel(self.page, name)

    def choose(self, element, value):
        self.actions += 1
        self.page.choose(element, value)

    def write(self, label, text):
        """Click a field and type; the click and the typing are one entry."""
        self.actions += 1
        self.page.click(labelled(label))
        self.page.write(text)

    def drag(self, places):
        self.actions += 1
        self.page.drag(places)

    def has_done(self, task):
        assert self.actions == ACTIONS[task], task
        self.actions = 0


def outputs(page):
    """Return the numbers of the tool in the status card: position and Euler angles."""
    return page.evaluate("[...document.querySelectorAll('#card .tool output')].map(o => o.value)")


def controller_list(text):
    return (
        "[...document.querySelectorAll('#panel-control label')]"
        f".find(l => l.textContent.startsWith({json.dumps(text)})).querySelector('select')"
    )


@pytest.mark.slow
def test_the_course_project_takes_these_actions(open_page):
    lab, page = open_page("puma560", width=1600, height=1000)
    person = Person(page)

    # Step 3: joint angles and the tool's pose are on screen while a joint is dragged.
    before = outputs(page)
    x, y = page.centre(labelled("shoulder"))
    person.drag([(x - 50, y), (x - 20, y), (x, y)])
    page.settle()
    after = outputs(page)
    assert len(after) == 6
    assert after != before
    assert all(text.endswith(("m", "°")) for text in after)
    person.has_done("3: forward kinematics with read-outs")

    # Steps 3 and 5: a target of the tool; its path is drawn as it moves.
    person.open_panel("tool")
    goal = 1000 * lab.desk.arm.fk(lab.desk.q)[2, 3] + 30
    person.write("z of the tool", f"{goal / 1000:.3f}")
    page.until("dhkit.stage.trail.count > 1")
    person.has_done("3 and 5: inverse kinematics with the tool's path")

    # Step 4
    person.click("document.getElementById('frames')")
    person.open_panel("table")
    assert len(page.evaluate("dhkit.lab.state.table.rows")) == 6
    person.has_done("4: frames and the DH table")
    person.write("a of row 2", "0.5")
    page.until("dhkit.stage.awaited === 0")
    wait_for(lambda: lab.desk.arm.description.numbers.a[1] == 0.5)
    person.has_done("4: the dimensions of another arm")
    person.open_panel("motion")
    person.choose(labelled("Goal"), "named nominal")
    person.click(button("Plan from here"))
    page.until("dhkit.player.playing")
    page.until("!dhkit.player.playing")
    person.has_done("4: the joints in motion")

    # Step 5: a circle of the tool, planned, shown and plotted.
    page.until("dhkit.lab.state.motion")
    person.choose(labelled("Kind of motion"), "circle")
    person.write("Radius of the circle", "0.08")
    person.click(button("Plan from here"))
    page.until("dhkit.lab.state.motion?.kind === 'circle'")
    person.has_done("5: a circle of the tool")

    # Step 6
    person.open_panel("control")
    person.choose(controller_list("Controller"), "pid")
    person.click(button("Start"))
    page.until("dhkit.lab.state.control.running")
    person.has_done("6: independent PID control")
    page.until("dhkit.lab.card.root.textContent.includes('of real time')")
    page.until("document.querySelectorAll('#dock .plot canvas').length >= 2")
    person.choose(controller_list("Controller"), "computed-torque")
    wait_for(lambda: lab._control.settings.controller == "computed-torque")
    person.click(button("Stop"))
    page.until("!dhkit.lab.state.control.running")
    person.has_done("6: computed torque control")

    person.open_panel("table")
    person.click(button("Lock the others"))
    page.until("dhkit.lab.state.arm.n === 2")
    person.has_done("6: the two-link arm of joints 2 and 3")
    person.open_panel("dynamics")
    person.click(labelled("M11"))
    page.until("document.querySelector('#panel-dynamics .entry math')")
    person.has_done("6: its equations of motion")
    person.open_panel("control")
    person.click(button("Start"))
    page.until("dhkit.lab.state.control.running")
    person.has_done("6: two-link control")
    page.click(button("Stop"))
    page.until("!dhkit.lab.state.control.running")
