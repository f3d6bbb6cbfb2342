"""Obstacles of a lab: placed, moved and resized by requests, drawn, measured, planned around and certified."""

import numpy as np
import pytest

from dhkit import Arm
from dhkit.lab.contacts import nearest
from lab.controls import button, labelled, panel
from lab.test_browser import ARROW, LENGTH, in_scene
from lab.test_requests import states, wait_for

pytest.importorskip("coal")
START = [0.0, -0.6, 0.4, 0.0, 0.6, 0.0]
GOAL = [1.9, -0.6, 0.4, 0.0, 0.6, 0.0]
BETWEEN = np.array([[1, 0, 0, 0.35], [0, 1, 0, 0.45], [0, 0, 1, 0.5], [0, 0, 0, 1.0]])


def test_an_obstacle_is_placed_moved_resized_and_removed(open_lab):
    lab = open_lab("puma560")
    assert lab.answer("obstacles.add", {"kind": "box"}) == {"index": 0}
    assert lab.answer("obstacles.add", {"kind": "cylinder"}) == {"index": 1}
    lab.answer(
        "obstacles.set", {"index": 0, "T": BETWEEN.ravel().tolist(), "sizes": [0.1, 0.2, 0.3]}
    )
    box, cylinder = lab.desk.scene
    assert np.array_equal(box.T_world_obstacle, BETWEEN)
    assert np.allclose(2 * box.half_sizes, [0.1, 0.2, 0.3])
    shown = states(lab)["obstacles"]
    assert [each["name"] for each in shown] == ["box 1", "cylinder 1"]
    assert shown[0]["sizes"] == [0.1, 0.2, 0.3]
    lab.answer("obstacles.remove", {"index": 0})
    assert lab.desk.scene == (cylinder,)
    assert lab.answer("obstacles.add", {"kind": "box"}) == {"index": 1}
    lab.answer("obstacles.clear", {})
    assert states(lab)["obstacles"] == []


@pytest.mark.parametrize(
    ("request_name", "data", "complaint"),
    [
        ("obstacles.add", {"kind": "cone"}, "expected one of box"),
        ("obstacles.add", {"kind": "floor"}, "a floor already"),
        ("obstacles.set", {"index": 7}, "0 to 1"),
        ("obstacles.set", {"index": 0, "sizes": [1, 2]}, "3 finite numbers"),
        ("obstacles.set", {"index": 0, "sizes": [1, 2, 0]}, "at least 0.001 m"),
        ("obstacles.set", {"index": 0, "sizes": [1, 2, 1e9]}, "at most 1000"),
        ("obstacles.set", {"index": 0, "T": [1.0] * 16}, "a pose"),
        (
            "obstacles.set",
            {"index": 0, "T": [1, 0, 0, 1e9, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
            "farther than",
        ),
    ],
)
def test_what_is_wrong_is_said_and_nothing_changes(open_lab, request_name, data, complaint):
    lab = open_lab("planar2r")
    lab.answer("obstacles.add", {"kind": "box"})
    lab.answer("obstacles.add", {"kind": "floor"})
    scene = lab.desk.scene
    with pytest.raises(ValueError, match=complaint):
        lab.answer(request_name, data)
    assert lab.desk.scene is scene


def test_there_are_twenty_at_most(open_lab):
    lab = open_lab("planar2r")
    for _ in range(20):
        lab.answer("obstacles.add", {"kind": "sphere"})
    with pytest.raises(ValueError, match="20 obstacles are enough"):
        lab.answer("obstacles.add", {"kind": "sphere"})
    lab.answer("obstacles.remove", {"index": 3})
    lab.answer("obstacles.add", {"kind": "sphere"})
    assert len({each["name"] for each in states(lab)["obstacles"]}) == 20


def test_a_link_that_touches_an_obstacle_is_named(open_lab):
    lab = open_lab("puma560")
    wait_for(lambda: lab.desk._contacts._arm is lab.desk.arm)
    lab.answer("obstacles.add", {"kind": "sphere"})
    T = np.eye(4)
    T[:3, 3] = lab.desk.arm.fk(lab.desk.q)[:3, 3]
    lab.answer("obstacles.set", {"index": 0, "T": T.ravel().tolist()})
    found = states(lab)["joints"]["nearest"]
    assert found["obstacle"] == "sphere 1"
    assert found["links"] in ([5], [6])  # the flange is in the middle of the ball
    assert found["distance"] < 0
    assert found == nearest(lab.desk.arm, lab.desk.q, lab.desk.scene)


def plan(lab, kind="least-time"):
    lab.answer("joints.set", {"q": START})
    lab.answer("motion.plan", {"kind": kind, "goal": {"q": GOAL}})
    # The state is published last.
    wait_for(lambda: states(lab)["motion"] is not None or (states(lab)["job"] or {}).get("error"))
    return states(lab)


def test_a_motion_in_least_time_goes_around_them_and_python_says_how(open_lab):
    lab = open_lab("puma560")
    lab.answer("obstacles.add", {"kind": "box"})
    lab.answer(
        "obstacles.set", {"index": 0, "T": BETWEEN.ravel().tolist(), "sizes": [0.1, 0.1, 0.5]}
    )
    shown = plan(lab)
    assert "clearance: 10 mm kept from obstacles" in shown["motion"]["notes"][0]
    motion = lab._motions.motion
    certificate = lab.desk.arm.certify(motion, obstacles=lab.desk.scene)
    assert certificate.ok, certificate
    scope = {}
    text = lab.answer("python", {})["text"]
    exec(text, scope)
    assert scope["motion"].duration == pytest.approx(motion.duration, rel=1e-6)

    # The certificate is about the obstacles where they were.
    lab.answer("obstacles.set", {"index": 0, "sizes": [0.1, 0.1, 0.6]})
    assert states(lab)["motion"]["notes"] == []


def test_a_motion_that_hits_an_obstacle_says_where(open_lab):
    lab = open_lab("puma560")
    lab.answer("obstacles.add", {"kind": "cylinder"})
    lab.answer("obstacles.set", {"index": 0, "T": BETWEEN.ravel().tolist(), "sizes": [0.05, 0.5]})
    plan(lab, "quintic")
    wait_for(lambda: states(lab)["motion"]["contacts"])
    touched = [found for found in states(lab)["motion"]["contacts"] if found]
    assert {found["obstacle"] for found in touched} == {"cylinder 1"}
    lab.answer("obstacles.clear", {})
    wait_for(lambda: states(lab)["motion"]["contacts"] is None)


def test_a_goal_inside_an_obstacle_is_refused(open_lab):
    lab = open_lab("puma560")
    lab.answer("obstacles.add", {"kind": "box"})
    T = np.eye(4)
    T[:3, 3] = lab.desk.arm.fk(GOAL)[:3, 3]
    lab.answer("obstacles.set", {"index": 0, "T": T.ravel().tolist()})
    lab.answer("joints.set", {"q": START})
    lab.answer("motion.plan", {"kind": "least-time", "goal": {"q": GOAL}})
    wait_for(lambda: (states(lab)["job"] or {}).get("error"))
    assert "goal: link" in states(lab)["job"]["error"]


def test_obstacles_stay_with_another_arm(open_lab):
    lab = open_lab("puma560")
    lab.answer("obstacles.add", {"kind": "box"})
    lab.answer("table.edit", {"row": 0, "column": "d", "text": "0.7"})
    assert len(lab.desk.scene) == 1
    assert isinstance(lab.desk.arm, Arm)


@pytest.mark.browser
def test_a_person_places_drags_resizes_and_removes_one(open_page):
    lab, page = open_page("puma560")
    panel(page, "motion")
    page.click(button("Box"))
    page.until("dhkit.lab.state.obstacles.length === 1")
    assert page.evaluate(
        "dhkit.lab.panels.find(p => p.name === 'motion').panel.obstacles.gizmo.group.visible"
    )
    before = lab.desk.scene[0].centre.copy()

    # The tip of the upward arrow, on screen, is dragged upwards.
    page.settle()
    height = ARROW * LENGTH * lab.desk.arm.description.reach
    x, y = in_scene(page, before + np.array([0.0, 0.0, height]))
    page.drag([(x, y), (x, y - 20), (x, y - 60)])
    page.until(f"dhkit.lab.state.obstacles[0].T[11] > {before[2] + 0.02}")
    moved = lab.desk.scene[0].centre
    assert np.allclose(moved[:2], before[:2], atol=1e-6)

    sizes = labelled("Sizes of box 1: edges")
    page.evaluate(
        f"{sizes}.focus(), {sizes}.value = '0.1 0.2 0.3', {sizes}.dispatchEvent(new Event('change'))"
    )
    page.until("dhkit.lab.state.obstacles[0].sizes[1] === 0.2")
    page.evaluate(f"{sizes}.value = '0.1 nothing', {sizes}.dispatchEvent(new Event('change'))")
    page.until(
        "document.querySelector('#lab .message').textContent.includes('three positive numbers')"
    )
    page.click(labelled("Remove box 1"))
    page.until("dhkit.lab.state.obstacles.length === 0")
    assert lab.desk.scene == ()
