"""What reviews from outside found, by class: stale numbers, half-made changes, states that lie, files that hang."""

import base64
import io
import socket
import time
from pathlib import Path

import numpy as np
import pytest

import dhkit
from acceptance import sample_size
from dhkit import Arm
from dhkit.description import from_toml, pose
from lab.test_requests import samples, states
from waiting import wait_for


def held(lab, t):
    return lab._control._live.setpoints(t)


@pytest.fixture
def puma(open_lab):
    return open_lab("puma560")


def moved(lab, size=0.4):
    return (lab.desk.q + np.array([size, 0.2, 0.2, 0, 0, 0])).tolist()


# References and runs


def test_a_reference_that_stands_still_has_no_acceleration(puma):
    puma.answer("motion.plan", {"kind": "trapezoidal", "goal": {"q": moved(puma)}, "duration": 1.0})
    puma.answer("control.start", {"reference": "motion"})
    q, qd, qdd = held(puma, 1.5)
    assert np.abs(q - puma._motions.motion.q(1.0)).max() < 1e-12 and not qd.any() and not qdd.any()
    back = held(puma, 2.5)
    assert back[1][0] < 0


def test_a_change_leaves_alone_what_it_does_not_concern(puma):
    puma.answer("control.start", {"reference": "sine", "controller": "adaptive"})
    live = puma._control._live
    wanted, controller, plant = live.setpoints, live.controller, live._plant
    puma.answer("control.change", {"payload": 1.0})
    assert live.setpoints is wanted and live.controller is controller and live._plant is not plant
    puma.answer("control.change", {"bandwidth": 15.0})
    assert live.setpoints is wanted and live.controller is not controller
    controller = live.controller
    puma.answer("control.change", {"reference": "hold"})
    assert live.setpoints is not wanted and live.controller is controller


def test_what_cannot_be_followed_changes_nothing(puma):
    puma.answer("control.start", {"reference": "sine"})
    before = states(puma)["control"]
    for request, data in (
        ("control.change", {"reference": "motion", "payload": 3.0}),
        ("control.change", {"reference": "target"}),
        ("control.start", {"reference": "motion"}),
        ("control.change", {"controller": "own"}),
    ):
        with pytest.raises((ValueError, dhkit.DhkitError), match="expected"):
            puma.answer(request, data)
        now = states(puma)["control"]
        assert now["running"] and all(
            now[name] == before[name] for name in ("reference", "payload", "controller")
        )
    assert puma.desk.running and puma._control._thread.is_alive()


def test_a_download_is_of_the_arm_that_ran(puma):
    puma.answer("control.start", {"reference": "sine"})
    wait_for(lambda: samples(puma) and len(samples(puma)[0].rows) > 20)
    puma.answer("control.stop", {})
    first = puma.answer("control.download", {"format": "csv"})
    puma.answer("control.change", {"controller": "pd", "payload": 8.0, "friction": "stiction"})
    assert puma.answer("control.download", {"format": "csv"}) == first


def stands(live):
    """Return whether a run makes no steps during some frames."""
    count = live._count
    time.sleep(0.1)
    return live._count == count


@pytest.mark.slow
def test_a_load_that_comes_during_a_run_leaves_its_energies_right(puma):
    puma.answer("control.start", {"reference": "sine"})
    wait_for(lambda: samples(puma) and np.any(samples(puma)[0].rows[:, 0] > 0.5))
    puma.answer("control.change", {"payload": 5.0})
    wait_for(lambda: puma._control._live._count > 300)
    puma.answer("control.pause", {})
    wait_for(lambda: stands(puma._control._live))
    audit = puma._control._live.result().audit
    assert audit.error < 1e-9


def test_another_motion_is_followed_and_none_is_held(puma):
    puma.answer("motion.plan", {"kind": "quintic", "goal": {"q": moved(puma)}, "duration": 1.0})
    puma.answer("control.start", {"reference": "motion"})
    goal = puma.desk.q + np.array([0, 0, 0, 0, 0, 0.5])
    puma.answer("motion.plan", {"kind": "quintic", "goal": {"q": goal.tolist()}, "duration": 1.0})
    live = puma._control._live
    assert np.abs(held(puma, live.t + 1.5)[0] - puma._motions.motion.q(1.0)).max() < 1e-2
    puma.answer("motion.clear", {})
    assert states(puma)["control"]["reference"] == "hold"
    assert not held(puma, live.t + 0.3)[1].any()


def test_a_running_controller_owns_the_arm(puma):
    puma.answer("waypoints.add", {})
    puma.answer("motion.plan", {"kind": "quintic", "goal": {"q": moved(puma)}, "duration": 1.0})
    puma.answer("control.start", {"reference": "hold"})
    for request, data in (("motion.show", {"time": 0.5}), ("motion.play", {})):
        with pytest.raises(ValueError, match="stopped first"):
            puma.answer(request, data)
    puma.answer("waypoints.go", {"index": 0})
    assert states(puma)["control"]["reference"] == "sliders"
    puma.answer("control.stop", {})
    with pytest.raises(ValueError, match="nothing runs"):
        puma.answer("control.pause", {})


def test_a_locked_joint_is_said_to_be_locked(puma):
    puma.answer("arm.planar", {"on": True})
    puma.answer("control.start", {"reference": "sine"})
    with pytest.raises(ValueError, match="joint 1 is locked"):
        puma.answer("joints.set", {"q": [0.3, 0, 0, 0, 0, 0], "joint": 0})
    assert states(puma)["control"]["reference"] == "sine"


@pytest.mark.parametrize("name", ["cobra600", "stanford", "puma560", "cart_pendulum"])
def test_a_sine_stays_inside_the_limits(name, open_lab):
    lab = open_lab(name)
    numbers = lab.desk.arm.description.numbers
    lab.answer("joints.named", {"name": "random"})
    lab.answer("control.start", {"reference": "sine"})
    q = np.array([held(lab, t)[0] for t in np.linspace(0, 4, 60)])
    assert np.all(q <= numbers.upper + 1e-12) and np.all(q >= numbers.lower - 1e-12)
    assert not np.abs(held(lab, 0.0)[1]).max() > 1e-12  # it begins at rest


# Edits

ROW = '[[joint]]\nname = "j{}"\ntype = "revolute"\na = {}\nalpha = 0\nd = 0\ntheta = 0\n'


def test_an_edit_is_made_whole_or_not_at_all(open_lab):
    text = (
        'format = 1\nname = "p"\nconvention = "standard"\n[parameters]\nL1 = 1.0\n'
        + ROW.format(1, '"L1"')
        + ROW.format(2, 0.5)
    )
    lab = open_lab(Arm(from_toml(text, file="p")))
    for entry in ("L1*1e200", "L1*1e5", "L1/0", "1e308*10"):
        lab.answer("table.edit", {"row": 0, "column": "a", "text": entry})
        assert states(lab)["table"]["errors"]
        assert lab.desk.arm.description.numbers.a[0] == 1.0
        lab.answer("table.undo", {})
    lab.answer("table.edit", {"row": 0, "column": "a", "text": "L1*2"})
    assert lab.desk.arm.description.numbers.a[0] == 2.0 and states(lab)["table"]["undo"]


def test_when_pages_cannot_be_told_the_arm_stays(puma, monkeypatch):
    before = puma.desk.arm
    panel, failing = puma.view.panel, [True]

    def fail(name, data):
        if name == "arm" and failing:
            failing.clear()
            raise ValueError("cannot be told")
        return panel(name, data)

    monkeypatch.setattr(puma.view, "panel", fail)
    with pytest.raises(ValueError, match="cannot be told"):
        puma.answer("table.edit", {"row": 1, "column": "a", "text": "0.5"})
    assert puma.desk.arm is before
    assert states(puma)["table"]["rows"][1]["a"] == str(before.description.joints[1].a)


@pytest.mark.parametrize(
    ("typed", "value"), [("90°", np.pi / 2), ("π/2", np.pi / 2), ("0,5", 0.5), ("−1", -1.0)]
)
def test_entries_as_people_write_them(typed, value, puma):
    puma.answer("table.edit", {"row": 0, "column": "alpha", "text": typed})
    assert puma.desk.arm.description.numbers.alpha[0] == pytest.approx(value, abs=1e-15)


def test_assumed_links_follow_the_table_and_the_table_is_kept(open_lab):
    lab = open_lab(Arm.from_dh([(0, 0.3, 0, "pi/2"), (0, 0, 0.4, 0), (0, 0, 0.3, 0)]))
    lab.answer("table.edit", {"row": 1, "column": "a", "text": "0.8"})
    lab.answer("bodies.assume", {})
    assert states(lab)["table"]["undo"]
    lab.answer("table.edit", {"row": 1, "column": "a", "text": "2.0"})
    expected = Arm(lab.desk.arm.description).with_uniform_links().description
    assert lab.desk.arm.description.joints[1].bodies == expected.joints[1].bodies
    with pytest.raises(ValueError, match="every link has a mass"):
        lab.answer("bodies.assume", {})
    lab.answer("table.reset", {})
    assert lab.desk.arm.description.numbers.a[1] == 0.4


def test_a_target_stays_over_an_edit(puma):
    puma.answer("joints.set", {"q": [0.2, 0.3, -0.3, 0.4, 0.7, 0.2]})
    T = puma.desk.arm.fk(puma.desk.q)
    puma.answer("tool.target", {"T": T.ravel().tolist()})
    puma.answer("table.edit", {"row": 1, "column": "a", "text": "0.44"})
    assert states(puma)["target"]["reached"]
    assert np.abs(puma.desk.arm.fk(puma.desk.q) - T).max() < 1e-9
    puma.answer("table.undo", {})
    assert np.abs(puma.desk.arm.fk(puma.desk.q) - T).max() < 1e-9


def test_what_is_not_met_is_said(open_lab):
    lab = open_lab("planar2r")
    T = lab.desk.arm.fk(lab.desk.q) @ pose(euler=[0, 0, 0.4])
    lab.answer("tool.target", {"T": T.ravel().tolist()})
    assert "rotation is off by" in states(lab)["target"]["message"]
    lab.answer("tool.target", {"T": pose([4.0, 0, 0]).ravel().tolist()})
    assert " m" in states(lab)["target"]["message"] and "mm" not in states(lab)["target"]["message"]


def test_a_branch_outside_the_limits_is_only_shown(puma):
    puma.answer("joints.set", {"q": [0.2, 0.3, -0.3, 0.4, 0.7, 0.2]})
    puma.answer("tool.target", {"T": puma.desk.arm.fk(puma.desk.q).ravel().tolist()})
    outside = next(
        branch["name"] for branch in states(puma)["target"]["branches"] if not branch["within"]
    )
    chosen = states(puma)["target"]["chosen"]
    with pytest.raises(ValueError, match="outside the joint limits"):
        puma.answer("tool.choose", {"branch": outside})
    assert states(puma)["target"]["chosen"] == chosen


@pytest.mark.slow
def test_a_motion_of_an_old_arm_is_never_shown(open_lab):
    lab = open_lab("planar2r")
    rng = np.random.default_rng(0)
    for k in range(sample_size(30, quick=12)):
        lab.answer("motion.plan", {"kind": "line", "goal": {"q": [0.6, 0.9]}})
        time.sleep(rng.uniform(0, 0.05))
        lab.answer("table.edit", {"row": 1, "column": "a", "text": f"0.4{k:02d}"})
        wait_for(lambda: lab._motions.jobs._thread is None)
        assert (states(lab)["motion"] is None) == (lab._motions.motion is None)


# Motions


def test_the_arm_is_there_already(puma):
    q = puma.desk.q + 1e-15
    for kind in ("quintic", "trapezoidal", "least-time"):
        with pytest.raises(ValueError, match="there already"):
            puma.answer("motion.plan", {"kind": kind, "goal": {"q": q.tolist()}})
    puma.answer("waypoints.add", {})
    puma.answer("waypoints.add", {})
    with pytest.raises(ValueError, match="waypoints 1 and 2 are the same"):
        puma.answer("motion.plan", {"kind": "quintic", "goal": {"waypoints": True}})
    for kind in ("line", "trapezoidal"):
        with pytest.raises(ValueError, match="quintic spline or in least time"):
            puma.answer("motion.plan", {"kind": kind, "goal": {"waypoints": True}})
    for _ in range(2):
        puma.answer("waypoints.remove", {"index": 0})
    with pytest.raises(ValueError, match="no waypoints"):
        puma.answer("waypoints.remove", {"index": 0})


def test_a_file_that_goes_beyond_leaves_the_last_motion(open_lab):
    lab = open_lab("planar2r")
    lab.answer("motion.plan", {"kind": "quintic", "goal": {"q": [0.5, 0.5]}, "duration": 1.0})
    before = lab._motions.motion, states(lab)["motion"]
    for value in ("1e300", "1e17"):
        content = base64.b64encode(f"t,q1,q2\n0,0,0\n1,{value},1\n2,0,0\n".encode()).decode()
        with pytest.raises((ValueError, dhkit.DhkitError)):
            lab.answer("motion.file", {"name": "x.csv", "content": content})
        assert (
            lab._motions.motion is before[0]
            and states(lab)["motion"]["duration"] == before[1]["duration"]
        )


def test_a_file_of_huge_degree_is_refused_at_once(open_lab, tmp_path):
    lab = open_lab("planar2r")
    path = lab.desk.arm.quintic([0, 0], [1, 1], 2.0).save(tmp_path / "m.npz")
    arrays = dict(np.load(path))
    file = io.BytesIO()
    np.savez_compressed(file, **(arrays | {"coefficients": np.zeros((1, 300_000, 2))}))
    with pytest.raises(ValueError, match="degree 299999"):
        lab.answer(
            "motion.file", {"name": "x.npz", "content": base64.b64encode(file.getvalue()).decode()}
        )


# Copy as Python


def copied(lab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    space = {}
    exec(lab.answer("python", {})["text"], space)
    return space


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["quintic", "trapezoidal", "line", "least-time", "spline", "through", "circle"]
)
def test_copied_lines_make_the_same_motion(kind, open_lab, tmp_path, monkeypatch):
    lab = open_lab("planar2r")
    lab.answer("joints.set", {"q": [0.3, 0.6]})
    if kind in ("spline", "through"):
        for q in ([0.3, 0.6], [0.8, 0.9], [1.0, 0.4]):
            lab.answer("joints.set", {"q": q})
            lab.answer("waypoints.add", {})
        lab.answer(
            "motion.plan",
            {"kind": "quintic" if kind == "spline" else "least-time", "goal": {"waypoints": True}},
        )
    else:
        lab.answer(
            "motion.plan", {"kind": kind, "goal": {} if kind == "circle" else {"q": [0.7, 1.0]}}
        )
    wait_for(lambda: states(lab)["motion"] or (states(lab)["job"] or {}).get("error"))
    if kind == "circle" and states(lab)["motion"] is None:
        pytest.skip("a planar arm has no circle about its own axis here")
    motion = copied(lab, tmp_path, monkeypatch)["motion"]
    ours = lab._motions.motion
    assert motion.duration == pytest.approx(ours.duration, rel=1e-6)
    t = np.linspace(0, ours.duration, 50)
    assert np.abs(motion.q(t) - ours.q(t)).max() < 1e-5


def test_copied_lines_write_an_edited_arm(puma, tmp_path, monkeypatch):
    puma.answer("table.edit", {"row": 1, "column": "a", "text": "0.5"})
    space = copied(puma, tmp_path, monkeypatch)
    assert space["arm"].description == puma.desk.arm.description


def test_copied_lines_follow_the_chosen_branch_or_iterate(
    puma, open_lab, tmp_path, monkeypatch, capsys
):
    puma.answer("joints.set", {"q": [0.2, 0.3, -0.3, 0.4, 0.7, 0.2]})
    puma.answer("tool.target", {"T": puma.desk.arm.fk(puma.desk.q).ravel().tolist()})
    copied(puma, tmp_path, monkeypatch)
    assert states(puma)["target"]["chosen"] in puma.answer("python", {})["text"]
    panda = open_lab("panda")
    panda.answer("tool.target", {"T": panda.desk.arm.fk(panda.desk.q).ravel().tolist()})
    assert "ik_numeric" in panda.answer("python", {})["text"]
    copied(panda, tmp_path, monkeypatch)
    capsys.readouterr()


@pytest.mark.parametrize("reference", ["hold", "sine", "motion"])
@pytest.mark.parametrize("locked", [False, True])
@pytest.mark.slow
def test_copied_lines_simulate_what_runs(reference, locked, open_lab, tmp_path, monkeypatch):
    if reference == "motion" and locked:
        pytest.skip("said in a comment")
    lab = open_lab("puma560" if locked else "planar2r")
    goal = lab.desk.q + 0.2
    if reference == "motion":
        lab.answer(
            "motion.plan", {"kind": "quintic", "goal": {"q": goal.tolist()}, "duration": 1.0}
        )
    if locked:
        lab.answer("arm.planar", {"on": True})
    lab.answer(
        "control.start",
        {
            "reference": reference,
            "controller": "pd-gravity",
            "bandwidth": 12.3456789,
            "payload": 0.3,
        },
    )
    text = lab.answer("python", {})["text"]
    wanted = [held(lab, t)[0] for t in (0.0, 0.4, 0.9)]
    lab.answer("control.stop", {})
    assert "12.3456789" in text
    monkeypatch.chdir(tmp_path)
    space = {}
    exec(
        text.replace("duration=10.0", "duration=1.0").replace("duration=5.0", "duration=1.0"), space
    )
    run = space["run"]
    for t, q in zip((0.0, 0.4, 0.9), wanted, strict=True):
        assert np.abs(run.reference_q[np.searchsorted(run.t, t - 1e-9)] - q).max() < 1e-6
    assert (tmp_path / "run.png").stat().st_size > 1000


# The server


@pytest.mark.slow
def test_strangers_who_say_nothing_are_bounded(puma):
    port = int(puma.url.split(":")[2].split("/")[0])
    idle = [socket.create_connection(("127.0.0.1", port)) for _ in range(200)]
    try:
        time.sleep(0.3)
        descriptors = len(list(Path("/proc/self/fd").iterdir()))
        assert descriptors < 200 + 150 + 100
        time.sleep(0.2)
        spent = time.process_time()
        time.sleep(0.5)
        assert time.process_time() - spent < 0.3
    finally:
        for one in idle:
            one.close()
    puma.answer("joints.named", {"name": "zero"})
