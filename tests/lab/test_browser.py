"""The lab in a headless Chromium, driven by mouse and keyboard as a person drives it."""

# ruff: noqa: E501 - JavaScript in one line

import json
import math
import os
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from PIL import Image

from acceptance import only_accepting
from dhkit import Arm
from dhkit.description import pose
from dhkit.lab.desk import start_configuration
from lab.conftest import COMPLETE
from lab.controls import button, labelled, panel, set_joints
from viewer.chromium import HANGS
from waiting import wait_for

PANELS = ["joints", "tool", "table", "motion", "control"]
DEGREE = math.pi / 180
PRINTED = 5.1e-6
"""m: half of the last digit of a position on the page, and rounding."""
FOLLOWS = 1e-6
"""m and rad between the arm and its target."""
SLACK = 2.0
"""On every gate of LAB.md: the machine is shared."""
ARROW, RING, LENGTH = 0.9, 0.72, 0.16
"""Where an arrow's tip and a ring are, in lengths of the handles; that length over the arm's reach: lab/gizmo.js."""
SMALL = {"width": 1280, "height": 800}


@pytest.fixture
def visit(open_page):
    """Return what opens a lab and a page on it."""
    return open_page


def enter(page, lab):
    page.open(lab.url)
    page.until(COMPLETE)


def write(page, label, text):
    page.click(labelled(label))
    page.write(text)


def near(lab, q, tolerance=1e-9):
    """Wait until these are the lab's joint values."""
    wait_for(lambda: np.abs(lab.desk.q - q).max() < tolerance)


def told(page, name):
    return page.evaluate(f"dhkit.lab.state.{name}")


# Joints


def test_a_slider_is_dragged_and_the_number_shown_is_the_number_sent(kept_page):
    lab, page = kept_page("puma560")
    _, y = page.centre(labelled("shoulder"))
    share = (90 + 45) / 270  # the ready state: 90 of -45 to 225 degrees
    start = page.evaluate(
        f"(b => b.left + 8 + {share} * (b.width - 16))({labelled('shoulder')}.getBoundingClientRect())"
    )
    page.drag([(start, y), (start + 20, y), (start + 45, y)])
    wait_for(lambda: abs(lab.desk.q[1] - math.pi / 2) > 0.1)
    page.settle()
    shown = float(page.evaluate(f"{labelled('shoulder, value')}.value"))
    wait_for(lambda: abs(lab.desk.q[1] / DEGREE - shown) < 1e-9)
    assert np.abs(np.delete(lab.desk.q - start_configuration(lab.desk.arm), 1)).max() == 0


def test_a_number_is_typed_and_a_wrong_one_is_refused(kept_page):
    lab, page = kept_page("puma560")
    write(page, "waist, value", "-33.125")
    wait_for(lambda: lab.desk.q[0] == -33.125 / (180 / math.pi))
    page.settle()
    assert page.evaluate(f"{labelled('waist, value')}.value") == "-33.125"
    write(page, "waist, value", "many")
    page.until("!document.querySelector('#lab .message').hidden")
    assert "expected a number" in page.evaluate(
        "document.querySelector('#lab .message').textContent"
    )
    assert page.evaluate(f"{labelled('waist, value')}.value") == "-33.125"
    write(page, "waist, value", "170")
    page.until("document.querySelector('.joint').classList.contains('outside')")


@pytest.mark.slow
def test_arrow_keys_move_by_one_ten_and_a_tenth_of_a_degree(visit):
    lab, page = visit("puma560")
    q = lab.desk.q.copy()
    for label in ("elbow", "elbow, value"):
        page.evaluate(f"{labelled(label)}.focus()")
        for key, modifiers, step in (("ArrowUp", 0, 1), ("ArrowUp", 8, 10), ("ArrowDown", 1, -0.1)):
            page.press(key, modifiers)
            q[2] += step * DEGREE
            near(lab, q)
        page.settle()
        assert page.evaluate(f"{labelled('elbow, value')}.value") == f"{q[2] / DEGREE:.2f}"


def unit(name):
    return f"[...document.querySelectorAll('#card .units button')].find((button) => button.textContent === '{name}')"


def test_units_change_what_is_shown_and_not_the_arm(visit):
    lab, page = visit("stanford")
    before = lab.desk.q.copy()
    slide = next(
        i for i, joint in enumerate(lab.desk.arm.description.joints) if not joint.is_revolute
    )
    field = f"document.querySelectorAll('.joint .number')[{slide}]"
    page.click(unit("mm"))
    assert page.evaluate(f"{field}.value") == f"{1000 * before[slide]:.1f}"
    page.click(unit("in"))
    assert page.evaluate(f"{field}.value") == f"{before[slide] / 0.0254:.3f}"
    page.click(unit("rad"))
    assert page.evaluate("document.querySelector('.joint .number').value") == f"{before[0]:.4f}"
    assert np.array_equal(lab.desk.q, before)
    page.click(field)
    page.write("12.5")
    wait_for(lambda: abs(lab.desk.q[slide] - 12.5 * 0.0254) < 1e-15)


@only_accepting
def test_configurations_by_name(visit):
    lab, page = visit("puma560")
    for name, q in ({"zero": np.zeros(6)} | dict(lab.desk.arm.configurations)).items():
        page.click(button(name, "#panel-joints"))
        near(lab, q)
    page.click(button("random", "#panel-joints"))
    wait_for(lambda: np.abs(lab.desk.q - q).max() > 0.1)
    assert told(page, "joints")["within"] is True


# Tool


def of(name):
    """Return a panel's object, as JavaScript."""
    return f"dhkit.lab.panels.find(p => p.name === '{name}').panel"


GIZMO = f"{of('tool')}.gizmo"


def in_scene(page, point):
    """Return where a point of the world is on the page, px."""
    return page.evaluate(
        f"(() => {{ const p = dhkit.stage.project(new MeshCat.THREE.Vector3({','.join(map(repr, map(float, point)))}));"
        " const box = document.getElementById('pane').getBoundingClientRect();"
        " return [p.x + box.left, p.y + box.top]; })()"
    )


def hit(page, place):
    """Return the axis of the handle at a place of the page, and whether it turns; None beside the handles."""
    return page.evaluate(
        f"(h => h && [h.userData.axis, h.userData.turns])({GIZMO}.hit({{clientX: {place[0]}, clientY: {place[1]}}}))"
    )


def handle(page, lab, turns):
    """Return a place where an arrow or a ring is, its axis, and how the place moves on the page, px for 1 mm or 1 mrad."""
    T, reach = lab._tool.T, lab.desk.arm.description.reach
    found = []
    for axis in range(3):
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        for angle in np.linspace(0, 2 * math.pi, 24, endpoint=False) if turns else [0.0]:
            local = (
                RING * (math.cos(angle) * u + math.sin(angle) * v)
                if turns
                else ARROW * np.eye(3)[axis]
            )
            way = (
                RING * (math.cos(angle) * v - math.sin(angle) * u)
                if turns
                else np.eye(3)[axis] / (LENGTH * reach)
            )
            place, moved = (
                np.array(
                    in_scene(page, T[:3, :3] @ (LENGTH * reach * (local + step * way)) + T[:3, 3])
                )
                for step in (0.0, 1e-3)
            )
            found.append((float(np.linalg.norm(moved - place)), place, axis, moved - place))
    for _, place, axis, way in sorted(found, key=lambda entry: -entry[0]):
        if hit(page, place) == [axis, turns]:
            return place, axis, way
    raise AssertionError("no handle can be grabbed")


def take_target(page, lab):
    panel(page, "tool")
    page.click(button("Move the tool by a target"))
    wait_for(lambda: lab._tool.T is not None)
    page.until(f"{GIZMO}.group.visible")
    page.settle()


def inside(lab, axis, length):
    """Return whether the arm can follow the target so far along an axis, m, within its limits."""
    steps = [pose(share * length * np.eye(3)[axis]) for share in np.linspace(0, 1, 7)]
    found = [lab.desk.arm.ik(lab._tool.T @ step) for step in steps]
    return all(np.any(solutions.valid & solutions.allowed) for solutions in found)


def at_target(lab):
    """Return how far the tool is from the target, m and rad."""
    T, goal = lab.desk.arm.fk(lab.desk.q), lab._tool.T
    return np.abs(T - goal).max()


def reached(lab):
    """Return whether the tool is where the target is; an arm of few joints cannot turn as it does."""
    return np.abs(lab.desk.arm.fk(lab.desk.q) - lab._tool.T)[:3, 3].max() < 1e-5


def count_states(page, name):
    page.evaluate(
        "(() => { const take = dhkit.lab.take; globalThis.came = []; globalThis.cameras = new Set();"
        f" dhkit.lab.take = function (m) {{ if (m.name === '{name}') came.push(performance.now()); if (dhkit.stage.held) cameras.add(String(dhkit.stage.viewer.camera.position.toArray())); return take.call(this, m); }}; }})()"
    )


@only_accepting
@pytest.mark.parametrize("turns", [False, True], ids=["arrow", "ring"])
def test_a_dragged_target_is_followed_at_twenty_updates_a_second(visit, slack, turns):
    lab, page = visit("puma560", width=860, height=720)
    set_joints(lab, page, [0.2, 0.3, -0.3, 0.4, 0.7, 0.2])
    take_target(page, lab)
    first = lab._tool.T.copy()
    place, axis, way = handle(page, lab, turns)
    count_states(page, "target")
    steps = 60
    size = 250.0 if turns else 60.0  # mm or mrad, there and back by a part
    if not turns and not inside(lab, axis, size / 1000):
        size = -size
    shares = np.concatenate([np.linspace(0, 1, steps), np.linspace(1, 0.6, steps)])
    started = time.monotonic()
    page.drag([tuple(place + share * size * way) for share in shares])
    elapsed = time.monotonic() - started
    came = len(page.evaluate("came"))
    wait_for(lambda: at_target(lab) < FOLLOWS)
    print(f"{'ring' if turns else 'arrow'}: {came / elapsed:.0f} updates a second")
    assert came / elapsed > 20 / slack()
    moved = np.linalg.inv(first) @ lab._tool.T
    if turns:
        angle = math.acos(np.clip((np.trace(moved[:3, :3]) - 1) / 2, -1, 1))
        assert 0.05 < angle < 0.4
        assert np.abs(moved[:3, :3] @ np.eye(3)[axis] - np.eye(3)[axis]).max() < 1e-6
        assert np.abs(moved[:3, 3]).max() < 1e-6
    else:
        assert 0.015 < abs(moved[axis, 3]) < 0.07
        assert page.evaluate("dhkit.stage.trail.count") > 5
        assert np.abs(np.delete(moved[:3, 3], axis)).max() < 1e-6
    assert page.evaluate("cameras.size") == 1
    q = lab.desk.q.copy()
    page.settle()
    xyz = [
        float(text)
        for text in page.evaluate(
            "[...document.querySelectorAll('.pose .number')].map(i => i.value)"
        )
    ]
    assert np.abs(np.array(xyz[:3]) - lab.desk.arm.fk(q)[:3, 3]).max() < PRINTED


def test_eight_branches_are_counted_on_screen_and_one_is_chosen(kept_page):
    lab, page = kept_page("puma560")
    set_joints(lab, page, [0.2, 0.3, -0.3, 0.4, 0.7, 0.2])
    take_target(page, lab)
    rows = "[...document.querySelectorAll('.branches button')].filter(b => b.getBoundingClientRect().height > 0)"
    page.until(f"{rows}.length === 8")
    assert (
        page.evaluate(f"{rows}.filter(b => b.getAttribute('aria-pressed') === 'true').length") == 1
    )
    page.until("dhkit.stage.overlays.skeletons.count === 7")
    inside = page.evaluate(
        f"{rows}.find(b => b.getAttribute('aria-pressed') === 'false' && !b.querySelector('small')).dataset.branch"
    )
    before = lab.desk.q.copy()
    page.click(f"document.querySelector('[data-branch={json.dumps(inside)}]')")
    wait_for(lambda: np.abs(lab.desk.q - before).max() > 0.1)
    assert at_target(lab) < FOLLOWS
    page.until(f"dhkit.lab.state.target.chosen === {json.dumps(inside)}")


def test_a_pose_is_typed_and_what_is_out_of_reach_is_said(kept_page):
    lab, page = kept_page("puma560")
    set_joints(lab, page, [0.2, 0.3, -0.3, 0.4, 0.7, 0.2])
    panel(page, "tool")
    before = page.evaluate("[...document.querySelectorAll('.pose .number')].map(i => i.value)")
    write(page, "z of the tool", f"{float(before[2]) - 0.05:.5f}")
    wait_for(lambda: lab._tool.T is not None)
    expected = pose(
        [float(before[0]), float(before[1]), float(f"{float(before[2]) - 0.05:.5f}")],
        euler=[float(x) * DEGREE for x in before[3:]],
    )
    assert np.abs(lab._tool.T - expected).max() < 1e-9
    wait_for(lambda: at_target(lab) < FOLLOWS)
    q = lab.desk.q.copy()
    write(page, "x of the tool", "3")
    page.until("/out of reach by/.test(document.querySelector('#panel-tool .note').textContent)")
    assert np.array_equal(lab.desk.q, q)
    page.click(button("Remove the target"))
    page.until("!document.querySelector('.branches button')")


def test_the_tool_is_jogged_in_the_axes_of_world_and_tool(kept_page):
    lab, page = kept_page("puma560")
    set_joints(lab, page, [0.2, 0.3, -0.3, 0.4, 0.7, 0.2])
    panel(page, "tool")
    T = lab.desk.arm.fk(lab.desk.q)
    for frame in ("world", "tool"):
        page.choose(labelled("Axes of a step"), frame)
        for _ in range(3):
            page.click(labelled("move along plus z"))
        step = 0.03 * (T[:3, 2] if frame == "tool" else np.eye(3)[2])
        T = T.copy()
        T[:3, 3] += step
        wait_for(lambda goal=T: lab._tool.T is not None and np.abs(lab._tool.T - goal).max() < 1e-9)
        wait_for(lambda: at_target(lab) < FOLLOWS)
    page.click(labelled("turn about minus x"))
    wait_for(lambda goal=T: np.abs(lab._tool.T - goal).max() > 0.1)


# DH table


def numbers(page):
    """Return what the page says of the tool after an edit: its matrix as it was told."""
    return np.reshape(told(page, "tool")["T"], (4, 4))


def test_an_edit_shows_the_numbers_that_the_api_gives_and_is_undone(kept_page):
    lab, page = kept_page("puma560")
    first = lab.desk.arm
    set_joints(lab, page, [0.2, 0.3, -0.3, 0.4, 0.7, 0.2])
    panel(page, "table")
    write(page, "a of row 2", "17*inch + 0.001")
    joints = list(first.description.joints)
    wait_for(lambda: lab.desk.arm is not first)
    joints[1] = replace(joints[1], a=lab.desk.arm.description.joints[1].a)
    assert float(joints[1].a) == pytest.approx(17 * 0.0254 + 1e-3, abs=1e-15)
    expected = Arm(replace(first.description, joints=tuple(joints))).fk(lab.desk.q)
    page.until(f"Math.abs(dhkit.lab.state.tool.T[3] - {float(expected[0, 3])!r}) < 1e-12")
    assert np.abs(numbers(page) - expected).max() < 1e-9
    panel(page, "tool")
    shown = page.evaluate(
        "[...document.querySelectorAll('.pose .number')].map(i => Number(i.value))"
    )
    assert np.abs(np.array(shown[:3]) - expected[:3, 3]).max() < PRINTED
    panel(page, "table")
    write(page, "alpha of row 1", "pi/no")
    page.until(f"{labelled('alpha of row 1')}.getAttribute('aria-invalid') === 'true'")
    assert (
        page.evaluate("document.querySelector('#panel-table .note').classList.contains('bad')")
        is True
    )
    assert np.abs(numbers(page) - expected).max() < 1e-12  # the last good arm stands
    for _ in range(2):
        page.click(button("Undo"))
    page.until(
        f"Math.abs(dhkit.lab.state.tool.T[3] - {float(first.fk(lab.desk.q)[0, 3])!r}) < 1e-12"
    )
    page.until(f"{labelled('alpha of row 1')}.getAttribute('aria-invalid') === 'false'")
    page.settle()
    page.choose(labelled("Convention"), "modified")
    wait_for(lambda: lab.desk.arm.description.convention.value == "modified")
    page.until("dhkit.lab.state.table.convention === 'modified' && dhkit.lab.state.table.changed")
    page.settle()
    page.click(button("Reset"))
    wait_for(lambda: lab.desk.arm.description.convention.value == "standard")


def test_letters_in_a_field_are_no_shortcuts(kept_page):
    _, page = kept_page("puma560")
    panel(page, "table")
    write(page, "d of row 1", "sqrt(2)/2")
    page.until(f"{labelled('d of row 1')}.value === 'sqrt(2)/2'")


def test_two_edits_in_a_row_are_both_made(kept_page):
    lab, page = kept_page("puma560")
    panel(page, "table")
    page.click(labelled("a of row 2"))
    page.call(
        "Input.dispatchKeyEvent", type="keyDown", key="a", modifiers=2, commands=["selectAll"]
    )
    for letter in "0.5":
        page.press(letter)
    page.press("Tab")  # to alpha of row 2, and on while the first edit is under way
    page.call(
        "Input.dispatchKeyEvent", type="keyDown", key="a", modifiers=2, commands=["selectAll"]
    )
    for letter in "0.1":
        page.press(letter)
    page.press("Tab")
    wait_for(
        lambda: (
            lab.desk.arm.description.numbers.a[1] == 0.5
            and lab.desk.arm.description.numbers.alpha[1] == 0.1
        )
    )


@only_accepting
def test_the_four_transforms_of_a_row_are_animated(visit):
    lab, page = visit("puma560")
    panel(page, "table")
    page.click("document.querySelector('#panel-table tbody tr:nth-child(2) button')")
    page.until("dhkit.stage.moving?.visible")
    page.until(
        "document.querySelectorAll('.step li').length === 4 && document.querySelector('.step li.now')"
    )
    seen = set()
    deadline = time.monotonic() + 6
    while (
        page.evaluate("Boolean(document.querySelector('.step li.now'))")
        and time.monotonic() < deadline
    ):
        seen.add(
            page.evaluate(
                "[...document.querySelectorAll('.step li')].findIndex(li => li.className === 'now')"
            )
        )
    assert {0, 1, 2, 3} <= seen | {-1}
    end = lab.desk.arm.frames(lab.desk.q)[2]
    assert (
        np.abs(np.array(page.evaluate("dhkit.stage.moving.position.toArray()")) - end[:3, 3]).max()
        < 1e-6
    )
    page.until("!dhkit.stage.moving.visible")


@pytest.mark.slow
def test_the_transforms_of_all_rows_are_animated_with_their_entries_lit(visit):
    lab, page = visit("planar2r")
    panel(page, "table")
    page.click(button("Animate"))
    lit = "(cell => cell && cell.getAttribute('aria-label'))(document.querySelector('#panel-table td.now input'))"
    seen = []
    deadline = time.monotonic() + HANGS
    while not (seen and page.evaluate(lit) is None) and time.monotonic() < deadline:
        label = page.evaluate(lit)
        if label is not None and label not in seen[-1:]:
            seen.append(label)
    order = [f"{name} of row {row}" for row in (1, 2) for name in ("theta", "d", "a", "alpha")]
    assert seen[-1] == order[-1]
    assert [label for label in order if label in seen] == seen  # a busy page may leave some out
    end = lab.desk.arm.frames(lab.desk.q)[2]
    assert (
        np.abs(np.array(page.evaluate("dhkit.stage.moving.position.toArray()")) - end[:3, 3]).max()
        < 1e-6
    )


def test_a_person_makes_an_arm_of_two_joints(visit):
    lab, page = visit("puma560")
    panel(page, "table")
    page.click(button("Lock the others"))
    page.until("dhkit.lab.state.arm.n === 2 && dhkit.lab.state.table.rows.length === 2")
    assert lab.desk.arm.n == 2
    page.click(button("Free all joints"))
    page.until("dhkit.lab.state.arm.n === 6 && dhkit.lab.state.table.rows.length === 6")


# Motion


def plots(page, name):
    """Return how many plots of a panel have a picture with curves."""
    return page.evaluate(
        "[...document.querySelectorAll('#dock .plot canvas')].filter(c => c.offsetWidth > 100 &&"
        " new Set(c.getContext('2d').getImageData(0, 0, c.width, c.height).data).size > 20).length"
    )


def test_a_motion_is_planned_played_scrubbed_and_taken_over(kept_page):
    lab, page = kept_page("puma560")
    panel(page, "motion")
    start, goal = lab.desk.q.copy(), np.zeros(6)
    page.choose(labelled("Goal"), "named zero")
    write(page, "Duration in seconds", "1.5")  # with Enter, which plans
    page.until("dhkit.player.playing")
    page.until("dhkit.player.time > 0.2")
    page.until("!dhkit.player.playing")
    wait_for(lambda: plots(page, "motion") == 3)
    assert np.abs(np.array(page.evaluate(f"[...{of('joints')}.q]")) - goal).max() < 1e-6
    x, y = page.centre("document.getElementById('time')")
    page.drag([(x + 40, y), (x + 20, y), (x, y)])
    middle = page.evaluate("dhkit.player.time")
    assert middle == pytest.approx(0.75, abs=0.05)
    assert (
        np.abs(page.evaluate(f"[...{of('joints')}.q]") - lab._motions.motion.q(middle)).max() < 1e-3
    )
    assert np.abs(lab.desk.q - start).max() == 0
    page.click(button("Teach this state"))
    wait_for(lambda: len(lab._motions.waypoints) == 1)
    assert np.abs(lab._motions.waypoints[0] - lab._motions.motion.q(middle)).max() < 1e-9
    page.until("!dhkit.player.active")
    page.click(button("Play", "#panel-motion"))
    page.until("dhkit.player.playing")
    page.click(button("Remove"))
    page.until("dhkit.lab.state.motion === null")


@only_accepting
def test_waypoints_are_taught_and_gone_through(visit):
    lab, page = visit("puma560")
    named = {"zero": np.zeros(6)} | dict(lab.desk.arm.configurations)
    for k, name in enumerate(("ready", "zero", "nominal"), start=1):
        panel(page, "joints")
        page.click(button(name, "#panel-joints"))
        near(lab, named[name])
        panel(page, "motion")
        page.click(button("Teach this state"))
        page.until(f"document.querySelectorAll('.points li').length === {k}")
    page.click(button("waypoint 1"))
    near(lab, named["ready"])
    page.choose(labelled("Goal"), "waypoints")
    page.click(button("Plan from here"))
    page.until("dhkit.lab.state.motion")
    motion = lab._motions.motion
    ends = [named[name] for name in ("ready", "nominal")]
    assert np.abs(motion.q(np.array([0.0, motion.duration])) - ends).max() < 1e-9
    page.click(labelled("Forget waypoint 2"))
    page.until("document.querySelectorAll('.points li').length === 2")


@only_accepting
def test_a_least_time_motion_is_planned_in_the_background(visit):
    lab, page = visit("planar2r")
    panel(page, "motion")
    if told(page, "arm")["bodies"] is False:
        panel(page, "control")
        page.click(button("Assume uniform links"))
        page.until("dhkit.lab.state.arm.bodies")
        panel(page, "motion")
    set_joints(lab, page, [0.4, 0.6])
    page.choose(labelled("Kind of motion"), "least-time")
    page.click(button("Plan from here"))
    page.until("dhkit.lab.state.job?.running")
    page.until("dhkit.lab.state.motion || dhkit.lab.state.job?.error")
    assert page.evaluate("dhkit.lab.state.job?.error ?? null") is None


def test_a_file_is_chosen(kept_page, tmp_path):
    lab, page = kept_page("puma560")
    saved = lab.desk.arm.quintic(np.zeros(6), lab.desk.q, 2.0).save(tmp_path / "mine.csv")
    panel(page, "motion")
    root = page.call("DOM.getDocument")["root"]["nodeId"]
    node = page.call("DOM.querySelector", nodeId=root, selector="#panel-motion input[type=file]")[
        "nodeId"
    ]
    page.call("DOM.setFileInputFiles", nodeId=node, files=[str(saved)])
    page.until("dhkit.lab.state.motion?.kind === 'file'")
    assert told(page, "motion")["duration"] == pytest.approx(2.0)
    (tmp_path / "bad.csv").write_text("t,q1\n0,no\n")
    page.call("DOM.setFileInputFiles", nodeId=node, files=[str(tmp_path / "bad.csv")])
    page.until("/bad.csv/.test(document.querySelector('#lab .message').textContent)")
    assert "/tmp" not in page.evaluate("document.querySelector('#lab .message').textContent")


# Control


@pytest.mark.slow
def test_a_controller_is_started_pushed_changed_and_stopped(visit):
    lab, page = visit("puma560")
    lab.answer("joints.named", {"name": "nominal"})
    panel(page, "control")
    page.click(button("Start"))
    page.until(f"dhkit.lab.state.control.running && {of('control')}.rows.length > 20")
    wait_for(lambda: plots(page, "control") >= 1)
    calm = np.abs(lab.desk.q - lab.desk.arm.configurations["nominal"]).max()
    assert calm < 1e-3
    write(page, "Force along z, N", "-200")
    page.click(button("Push"))
    wait_for(
        lambda: (
            np.abs(lab.desk.q - lab.desk.arm.configurations["nominal"]).max() > 10 * max(calm, 1e-5)
        )
    )
    page.choose(labelled_list("Controller"), "pid")
    wait_for(lambda: lab._control.settings.controller == "pid")
    write(page, "Payload", "2")
    wait_for(lambda: lab._control.settings.payload == 2.0)
    count = page.evaluate(f"{of('control')}.rows.length")
    page.until(f"{of('control')}.rows.length > {count} + 20")
    page.click(button("Pause"))
    page.until("dhkit.lab.state.control.paused")
    page.click(button("Go on"))
    page.click(button("Stop"))
    page.until("!dhkit.lab.state.control.running")
    assert lab.desk.running is False


def labelled_list(text):
    """Return the list beside this text, as JavaScript."""
    return (
        "[...document.querySelectorAll('#panel-control label')]"
        f".find(l => l.textContent.startsWith({json.dumps(text)})).querySelector('select')"
    )


def test_joints_2_and_3_alone_and_an_arm_without_bodies(visit):
    _, page = visit("puma560")
    panel(page, "control")
    page.click(button("Only joints 2 and 3"))
    page.until("dhkit.lab.state.control.planar")
    page.choose(labelled_list("Follows"), "sine")
    page.click(button("Start"))
    page.until(f"{of('control')}.rows.length > 10")
    assert page.evaluate(f"{of('control')}.columns") == [
        "t",
        "q2",
        "q3",
        "e2",
        "e3",
        "tau2",
        "tau3",
        "tool",
    ]
    page.click(button("Stop"))
    page.until("!dhkit.lab.state.control.running")


# All panels


@pytest.mark.slow
def test_two_tabs_show_the_same_and_a_reload_restores_it(visit, chromium):
    lab, page = visit("puma560")
    other = chromium.page(**SMALL)
    try:
        enter(other, lab)
        write(page, "waist, value", "25")
        other.until(f"{labelled('waist, value')}.value === '25.00'")
        panel(other, "table")
        write(other, "d of row 1", "0.7")
        panel(page, "table")
        page.until(f"{labelled('d of row 1')}.value === '0.7'")
        lab.answer("tool.jog", {"axis": 2, "step": -0.05})
        states = "JSON.stringify(['arm', 'joints', 'tool', 'target', 'table', 'waypoints', 'control'].map(n => dhkit.lab.state[n]))"
        for tab in (page, other):
            tab.until("dhkit.lab.state.target && dhkit.lab.state.joints.nearest")
        wait_for(lambda: page.evaluate(states) == other.evaluate(states))
        before = page.evaluate(states)
        enter_again(page, lab)
        assert page.evaluate(states) == before
        assert page.evaluate("document.getElementById('panel-table').hidden") is False
        page.until(f"{GIZMO}.group.visible")
        assert other.errors == []
    finally:
        other.close()


def enter_again(page, lab):
    page.open(lab.url)
    page.until("globalThis.dhkit?.lab?.state.control && dhkit.lab.state.waypoints")
    page.settle()


@only_accepting
def test_every_control_is_reached_by_the_keyboard(visit):
    lab, page = visit("puma560")
    lab.answer("tool.jog", {"axis": 2, "step": -0.05, "frame": "world"})
    lab.answer("motion.plan", {"kind": "quintic", "goal": {"q": [0.0] * 6}})
    page.evaluate("document.getElementById('tab-joints').focus()")
    reach = (
        "[...document.querySelectorAll('button, input, select, textarea, summary')].filter(e => e.getClientRects().length"
        " && !e.disabled && e.tabIndex >= 0)"
    )
    names = page.evaluate(
        "[...document.querySelectorAll('[role=tab]')].filter(e => e.getClientRects().length).map(e => e.id.slice(4))"
    )
    assert set(PANELS) <= set(names)
    for k, name in enumerate(names):
        if k:
            page.press("ArrowRight")
        assert page.evaluate("document.activeElement.id") == f"tab-{name}"
        assert page.evaluate(f"document.getElementById('panel-{name}').hidden") is False
        page.until("dhkit.lab.state.motion")
        page.settle()
        count = page.evaluate(
            f"(() => {{ globalThis.wanted = new Set({reach}); globalThis.visited = new Set(); return wanted.size; }})()"
        )
        for _ in range(count + 3):
            page.evaluate("visited.add(document.activeElement)")
            page.press("Tab")
        assert (
            page.evaluate(
                "[...wanted].filter(e => !visited.has(e)).map(e => e.outerHTML.slice(0, 120))"
            )
            == []
        )
        unnamed = page.evaluate(
            "[...wanted].filter(e => !(e.ariaLabel || e.labels?.length || e.textContent.trim() || e.title))"
            ".map(e => e.outerHTML.slice(0, 120))"
        )
        assert unnamed == []
        page.evaluate(f"document.getElementById('tab-{name}').focus()")


HOSTILE = "<img src=x onerror=window.hacked=1>"


def test_names_with_html_are_text_everywhere(visit):
    lab, page = visit("planar2r")
    lab.answer("bodies.assume", {}) if not told(page, "arm")["bodies"] else None
    lab.answer("motion.plan", {"kind": "quintic", "goal": {"q": nearby(lab).tolist()}})
    lab.answer("tool.jog", {"axis": 0, "step": -0.01})
    lab.answer("waypoints.add", {})
    page.until(
        "dhkit.lab.state.motion && dhkit.lab.state.target && dhkit.lab.state.waypoints.length"
    )
    # Python refuses such names in a robot file; the page relies on nobody.
    page.evaluate(
        f"""(() => {{
          const hostile = (value, key) => typeof value === 'string' && NAMED.has(key) ? {json.dumps(HOSTILE)}
            : Array.isArray(value) ? value.map(entry => hostile(entry, key))
            : value && typeof value === 'object' ? Object.fromEntries(Object.entries(value).map(([k, v]) => [k, hostile(v, k)])) : value;
          const NAMED = new Set(['name', 'joint', 'configurations', 'family', 'message', 'error', 'note', 'title', 'excess', 'kind', 'theta']);
          for (const name of ['arm', 'joints', 'tool', 'target', 'table', 'motion', 'waypoints', 'control'])
            dhkit.lab.take({{ name, data: hostile(structuredClone(dhkit.lab.state[name])) }});
          dhkit.lab.take({{ name: 'job', data: {{ id: 1, title: {json.dumps(HOSTILE)}, progress: {json.dumps(HOSTILE)}, running: true, error: null }} }});
          dhkit.lab.samples({{ columns: ['t', 'q1', 'e1', 'tau1', 'tool'], rows: new Float32Array([0, 1, 1, 1, 1, 1, 2, 2, 2, 2]), restart: true }});
          dhkit.lab.complain({json.dumps(HOSTILE)});
          dhkit.readout.set({{ name: {json.dumps(HOSTILE)}, joints: [{{ name: {json.dumps(HOSTILE)}, unit: 'deg' }}, {{ name: {json.dumps(HOSTILE)}, unit: 'deg' }}] }});
        }})()"""
    )
    for name in PANELS:
        panel(page, name)
        page.settle()
    page.images_have_failed()
    assert page.evaluate("document.querySelectorAll('img').length") == 0
    assert page.evaluate("globalThis.hacked ?? null") is None
    for place in (
        "#lab h1",
        "#lab .message",
        ".joint .name",
        ".points button",
        "#dock .legend li",
    ):
        assert page.evaluate(f"document.querySelector({json.dumps(place)}).textContent") == HOSTILE
    assert page.evaluate("document.title").startswith(HOSTILE)


def test_a_lost_connection_is_said_and_a_wish_meanwhile_too(visit):
    lab, page = visit("planar2r")
    lab.close()
    page.until("/lost/.test(document.getElementById('banner').textContent)")
    page.click(button("zero", "#panel-joints"))
    page.until("/not connected/.test(document.querySelector('#lab .message').textContent)")
    page.errors.clear()  # Chromium logs each attempt to come back


# What it looks like

LAYOUTS = [
    (390, 844, True),
    (768, 1024, False),
    (768, 1024, True),
    (1280, 720, False),
    (1280, 720, True),
]


def nearby(lab):
    """Return joint values inside the limits, not far from the state on show."""
    numbers = lab.desk.arm.description.numbers
    return np.clip(lab.desk.q - 0.5, numbers.lower, numbers.upper)


def act(page, lab, name):
    """Show a panel with something in it."""
    page.evaluate(f"dhkit.lab.openPanel('{name}')")
    if name == "tool":
        lab.answer("tool.target", {"T": lab.desk.arm.fk(lab.desk.q).ravel().tolist()})
        page.until("dhkit.lab.state.target")
    if name == "table":
        lab.answer("tool.clear", {})
        page.evaluate("document.querySelector('#panel-table tbody button').click()")
        page.until("dhkit.stage.moving?.visible")
    if name == "motion":
        lab.answer("motion.plan", {"kind": "quintic", "goal": {"q": nearby(lab).tolist()}})
        page.until(
            "dhkit.lab.state.motion && dhkit.player.time > Math.min(0.3, 0.9 * dhkit.lab.state.motion.duration)"
        )
        page.evaluate("dhkit.lab.dock.open || dhkit.lab.dock.toggle()")  # folded on phones
        wait_for(lambda: plots(page, "motion") >= 2)
    if name == "control":
        lab.answer("motion.clear", {})
        lab.answer("control.start", {"reference": "sine", "controller": "pid"})
        page.until(f"{of('control')}.rows.length > 90")
    page.settle()


OVERLAPPING = """(() => {
  const boxes = [...document.querySelectorAll('#lab button, #lab input, #lab select, #lab summary, #tools button, #tools select, #player button, #player input')]
    .filter(e => e.getClientRects().length && !e.closest('.three + .x')).map(e => [e, e.getBoundingClientRect()]);
  const found = [];
  for (const [e, a] of boxes) {
    if (!e.closest('nav') && (a.left < -0.5 || a.right > innerWidth + 0.5)) found.push(['outside', e.outerHTML.slice(0, 100)]);
    if (e.matches('input.number, .dh input') && e.scrollWidth > e.clientWidth + 1) found.push(['clipped', e.outerHTML.slice(0, 100), e.value]);
    for (const [f, b] of boxes) if (e !== f && e.parentElement.closest('section, header, #tools, #player') === f.parentElement.closest('section, header, #tools, #player') && a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1) found.push(['overlap', e.outerHTML.slice(0, 90), f.outerHTML.slice(0, 90)]);
  }
  for (const [a, b] of [['tools', 'player'], ['lab', 'tools'], ['lab', 'player']]) {
    const [p, q] = [a, b].map(id => document.getElementById(id).getBoundingClientRect());
    if (p.width && q.width && p.left < q.right && q.left < p.right && p.top < q.bottom && q.top < p.bottom) found.push(['overlap', a, b]);
  }
  return found;
})()"""


def sheet(pictures, file):
    """Write pictures side by side."""
    Image.fromarray(np.concatenate(pictures, axis=1).astype(np.uint8)).save(file)


def folder(tmp_path):
    """Return where contact sheets go: DHKIT_SHEETS, or the test's own folder."""
    chosen = Path(os.environ.get("DHKIT_SHEETS", tmp_path))
    chosen.mkdir(parents=True, exist_ok=True)
    return chosen


@only_accepting
@pytest.mark.parametrize(("width", "height", "dark"), LAYOUTS)
def test_nothing_is_clipped_or_covered(visit, tmp_path, width, height, dark):
    lab, page = visit("puma560", width=width, height=height, dark=dark)
    set_joints(lab, page, [0.2, 0.3, -0.3, 0.4, 0.7, 0.2])
    pictures = []
    for name in PANELS:
        act(page, lab, name)
        assert page.evaluate(OVERLAPPING) == []
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        pictures.append(page.screenshot())
        assert (np.median(pictures[-1].mean(axis=2)) < 80) == dark
    sheet(pictures, folder(tmp_path) / f"puma560-{width}-{'dark' if dark else 'light'}.png")


@only_accepting
@pytest.mark.parametrize("name", ["planar2r", "cobra600", "stanford", "panda"])
def test_other_arms_have_their_panels_too(visit, tmp_path, name):
    lab, page = visit(name, width=900, height=700)
    page.evaluate("dhkit.lab.setUnits({ length: 'm' })")  # a file in mm opens in mm
    n = lab.desk.arm.n
    write(page, f"{lab.desk.arm.description.joints[0].name}, value", "20")
    wait_for(lambda: abs(lab.desk.q[0] - 20 * DEGREE) < 1e-12)
    pictures = [page.screenshot()]
    act(page, lab, "tool")
    count = page.evaluate("document.querySelectorAll('.branches button').length")
    assert count >= 1
    axis = 0
    page.click(labelled("move along plus x"))
    wait_for(lambda: lab._tool.T is not None and (reached(lab) or told(page, "target")["message"]))
    pictures.append(page.screenshot())
    act(page, lab, "table")
    write(page, "a of row 2" if n == 2 else "d of row 1", "0.41")
    index = 1 if n == 2 else 0
    values = "a" if n == 2 else "d"
    wait_for(lambda: getattr(lab.desk.arm.description.numbers, values)[index] == 0.41)
    page.until(f"dhkit.lab.state.table.values[{index}][{2 if n == 2 else 1}] === 0.41")
    expected = lab.desk.arm.fk(lab.desk.q)
    wait_for(lambda: np.abs(numbers(page) - expected).max() < 1e-9)
    pictures.append(page.screenshot())
    act(page, lab, "motion")
    pictures.append(page.screenshot())
    assert axis == 0
    assert page.evaluate(OVERLAPPING) == []
    sheet(pictures, folder(tmp_path) / f"{name}.png")


# Gates of LAB.md

STOCK = 2.7e-3
"""s that Pinocchio's own display in meshcat takes on the machine of LAB.md's figures."""


@pytest.fixture(scope="module")
def stock():
    """Return Pinocchio's own display of the PUMA in meshcat."""
    visualize = pytest.importorskip("pinocchio.visualize")
    folder = Path(__file__).resolve().parents[2] / "urdf"
    model = pin.buildModelFromUrdf(str(folder / "puma560.urdf"))
    drawings = pin.buildGeomFromUrdf(
        model, str(folder / "puma560.urdf"), pin.GeometryType.VISUAL, package_dirs=[str(folder)]
    )
    display = visualize.MeshcatVisualizer(model, drawings, drawings)
    display.initViewer(open=False)
    display.loadViewerModel()
    yield display
    window = display.viewer.window
    window.zmq_socket.close()
    window.context.term()
    window.server_proc.kill()
    window.server_proc.wait()


@pytest.fixture
def slack(stock):
    """Return by how much gates are widened: twice, and by what the stock display is slower than on that machine."""

    def measured():
        took = []
        for k in range(60):
            start = time.perf_counter()
            stock.display(np.full(6, 0.01 * k))
            took.append(time.perf_counter() - start)
        return SLACK * max(1.0, float(np.median(took)) / STOCK)

    before = measured()
    return lambda: max(before, measured())


def drawn(page, seconds):
    """Return how many pictures of the scene are drawn each second."""
    page.evaluate(
        "(() => { globalThis.pictures = 0; const stage = dhkit.stage, render = dhkit.stage.render;"
        " stage.render = function (now) { if (this.viewer.needs_render) pictures++; return render.call(this, now); }; })()"
    )
    time.sleep(0.3)
    before, started = page.evaluate("pictures"), time.monotonic()
    time.sleep(seconds)
    return (page.evaluate("pictures") - before) / (time.monotonic() - started)


@only_accepting
def test_gate_from_slider_to_picture(visit, slack):
    _, page = visit("puma560")
    took = page.evaluate(
        """(async () => {
          const slider = document.querySelector('.joint input[type=range]'), times = [];
          const next = () => new Promise(done => requestAnimationFrame(done));
          for (let k = 0; k < 120; k++) {
            const value = 0.3 * Math.sin(k / 5), start = performance.now();
            const came = new Promise(done => { const take = dhkit.takePose; dhkit.takePose = function (m) { take.call(this, m); dhkit.takePose = take; done(); }; });
            slider.value = value;
            slider.dispatchEvent(new Event('input', { bubbles: true }));
            await came;
            await next();
            times.push(performance.now() - start);
            await new Promise(done => setTimeout(done, 7 * Math.random()));
          }
          return times;
        })()"""
    )
    p50, p95 = np.percentile(took, [50, 95])
    print(f"slider to rendered: p50 {p50:.1f} ms, p95 {p95:.1f} ms")
    assert p50 < 25 * slack()
    assert p95 < 60 * slack()


@only_accepting
def test_gate_of_a_stream_of_poses(visit, slack):
    lab, page = visit("puma560", width=860, height=720)
    q, seconds = lab.desk.q.copy(), 6.0
    last = q + 0.123

    def stream():
        frames = 0
        while (now := time.monotonic() - started) < seconds:
            frames += 1
            lab.view.show(q + 0.3 * math.sin(2 * now))
            time.sleep(max(0.0, frames / 60.0 - (time.monotonic() - started)))
        lab.view.show(last)

    started, cpu = time.monotonic(), time.process_time()
    thread = threading.Thread(target=stream)
    thread.start()
    rate = drawn(page, seconds - 1.0)
    thread.join()
    share = (time.process_time() - cpu) / (time.monotonic() - started)
    print(
        f"60 Hz at 860x720: {rate:.1f} pictures a second, {100 * share:.1f} % of a core in Python"
    )
    assert rate > 20 / slack()
    assert share < 0.10 * slack()
    page.settle()
    assert np.abs(np.array(page.evaluate("[...dhkit.motion.q]")) - last).max() < 1e-6


@only_accepting
def test_gate_of_one_message_against_one_a_link(visit, stock):
    lab, _ = visit("puma560")
    took = {"ours": [], "stock": []}
    for k in range(200):
        for name, show in (("ours", lab.view.show), ("stock", stock.display)):
            start = time.perf_counter()
            show(np.full(6, 0.01 * k))
            took[name].append(time.perf_counter() - start)
    ours, theirs = (float(np.median(took[name])) for name in ("ours", "stock"))
    print(
        f"to show a state: {1e3 * ours:.3f} ms, a message a link with the stock display {1e3 * theirs:.3f} ms"
    )
    assert theirs > 4 * ours


@only_accepting
def test_gate_of_a_running_controller(visit, slack):
    lab, page = visit("puma560", width=860, height=720)
    panel(page, "control")
    page.choose(labelled_list("Follows"), "sine")
    page.click(button("Start"))
    page.until(f"{of('control')}.rows.length > 60")
    rate = drawn(page, 4.0)
    print(
        f"control at 60 Hz, 860x720: {rate:.1f} pictures a second, {lab._control._speed:.2f} of real time"
    )
    assert rate > 20 / slack()
    page.click(button("Stop"))


@only_accepting
def test_gate_of_eight_ghosts(visit, slack):
    lab, page = visit("puma560", width=640, height=480)
    q = np.array([0.2, 0.3, -0.3, 0.4, 0.7, 0.2])
    lab.view.ghosts(q + 0.15 * np.arange(1, 9)[:, None])
    end = time.monotonic() + 12.0

    def stream():
        k = 0
        while time.monotonic() < end and not done.is_set():
            lab.view.show(q + 0.3 * math.sin(k / 30))
            k += 1
            time.sleep(1 / 60)

    done = threading.Event()
    thread = threading.Thread(target=stream)
    thread.start()
    time.sleep(2.0)
    rate = drawn(page, 4.0)
    done.set()
    thread.join()
    print(f"8 ghosts at 640x480: {rate:.1f} pictures a second")
    assert rate > 25 / slack()


@only_accepting
def test_gate_of_an_edit(visit, slack):
    lab, page = visit("puma560")
    python = []
    for k in range(40):
        start = time.perf_counter()
        lab.answer("table.edit", {"row": 1, "column": "a", "text": f"{0.4318 + 0.001 * k:.4f}"})
        python.append(1000 * (time.perf_counter() - start))
    panel(page, "table")
    # Shown: the table has the number, and the edited arm is drawn in its pose. A person's edits are a while apart.
    took = page.evaluate(
        """(async () => {
          const times = [], { stage } = dhkit, rest = (time) => new Promise(done => setTimeout(done, time));
          const { build } = stage, { render } = stage.viewer;
          let drawn = true;
          stage.build = function (message) { build.call(this, message); drawn = false; };
          stage.viewer.render = function () { render.call(this); drawn = true; };
          for (let k = 0; k < 40; k++) {
            await rest(250);
            const start = performance.now(), value = 0.6718 + 0.001 * k;
            const cell = document.querySelector('#lab [aria-label="d of row 1"]');
            cell.focus(); cell.value = value.toFixed(4); cell.dispatchEvent(new Event('change')); cell.blur();
            const old = stage.commands;
            while (stage.commands === old || !drawn || Math.abs(dhkit.lab.state.table.values[0][1] - value) > 1e-9) await rest(1);
            times.push(performance.now() - start);
          }
          return times;
        })()"""
    )
    (p, shown) = (np.percentile(x, 95) for x in (python, took))
    print(
        f"edit of the table, p95: {p:.0f} ms in Python, {shown:.0f} ms until it is drawn; median {np.median(took):.0f} ms, "
        f"the first {took[0]:.0f} ms"
    )
    assert p < 100 * slack()
    assert shown < 100 * slack()
