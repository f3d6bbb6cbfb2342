"""`dhkit demo`: what it writes, for any robot; the page shows the arm without a network."""

import contextlib
import io
import json
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from acceptance import different_robots_first, only_accepting
from dhkit import Arm, Trajectory, robots
from dhkit.cli import main
from dhkit.cli.demo_motions import TOUR_RATE, moved_configurations, race, there_and_back, tour
from dhkit.cli.straight import branches, straight_line

KEPT = 1e-6
"""Share of a limit that a certified motion may exceed it by."""
CLOSES = 1e-12
"""m: rounding of solutions found by iteration included."""


@pytest.fixture(scope="module", params=robots())
def line_of(request):
    """A robot's name and its line."""
    return request.param, straight_line(Arm.load(request.param))


def run(*arguments):
    with pytest.raises(SystemExit) as exit:
        main(arguments)
    return exit.value.code


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """Return what runs `dhkit demo --quick` for a robot, once, and returns its folder and what it printed."""
    run_already = {}

    def once(name):
        if name not in run_already:
            folder, printed = tmp_path_factory.mktemp(name) / "out", io.StringIO()
            robot = () if name == "puma560" else ("--robot", name)  # which it is without an option
            with contextlib.redirect_stdout(printed):
                assert run("demo", *robot, "--quick", "--output", str(folder)) == 0
            run_already[name] = folder, printed.getvalue()
        return run_already[name]

    return once


def test_the_demo_writes_a_urdf_a_figure_and_a_page(demo):
    folder, out = demo("puma560")
    assert "agrees with Pinocchio" in out
    assert "2 shoulder" in out
    assert "8 branches of one pose close FK to" in out
    assert "proved equal to Euler and Lagrange's equation" in out
    assert re.search(
        r"plan +[\d.]+ s +0\.8\d+ s with torques up to 100 %, the quintic 1\.4\d+ s .*all limits kept",
        out,
    )
    assert sorted(path.name for path in folder.iterdir()) == [
        "control.html",
        "control.png",
        "equations.html",
        "equations.tex",
        "ik.html",
        "index.html",
        "meshes",
        "plan.html",
        "plan.npz",
        "plan.png",
        "puma560.png",
        "puma560.urdf",
        "verification.md",
    ]
    assert "<math" in (folder / "equations.html").read_text("utf-8")
    assert "worked out and proved: " in out and "<svg" in (folder / "ik.html").read_text("utf-8")
    assert ElementTree.parse(folder / "puma560.urdf").getroot().get("name") == "puma560"
    with Image.open(folder / "puma560.png") as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 50
    page = (folder / "index.html").read_text("utf-8")
    assert len(page) < 2_500_000


def test_the_page_of_the_demo_shows_the_arm_moves_it_and_asks_nobody(demo, chromium):
    folder, _ = demo("puma560")
    page = chromium.page()
    page.open(f"file://{folder}/index.html")
    page.press(" ")  # pause
    with_arm = page.screenshot()
    page.evaluate(
        "dhkit.stage.nodes.forEach(node => { node.visible = false; }); dhkit.stage.viewer.set_dirty()"
    )
    without = page.screenshot()
    page.evaluate(
        "dhkit.stage.nodes.forEach(node => { node.visible = true; }); dhkit.stage.viewer.set_dirty()"
    )
    page.press(" ")
    page.until("dhkit.motion && !document.hidden")
    page.settle()
    page.settle()
    later = page.screenshot()
    try:
        # The arm and its shadow cover a good part of the page; an empty scene would differ by nothing.
        assert np.any(np.abs(with_arm - without) > 20, axis=-1).sum() > 10_000
        assert np.any(np.abs(with_arm - later) > 20, axis=-1).sum() > 200
        assert [
            url for url in page.requests if not url.startswith(("file:///", "data:", "blob:"))
        ] == []
        assert page.errors == []
    finally:
        page.close()


@pytest.mark.slow
def test_the_demo_tells_machines_what_it_did(tmp_path, capsys):
    assert run("demo", "--robot", "stanford", "--quick", "--json", "--output", str(tmp_path)) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["ok"]
    stages = ["build", "verify", "equations", "figure", "ik", "plan", "control", "page"]
    assert [stage["stage"] for stage in report["stages"]] == stages
    assert re.fullmatch(
        r"8 branches of one pose close FK to \de-16; a line of 0\.\d+ m in 200 poses: 0 switches; "
        r"worked out and proved: .*ik\.html",
        report["stages"][4]["result"],
    )


def test_the_demo_works_for_a_robot_of_ones_own(tmp_path, monkeypatch, capsys):
    (tmp_path / "mine.toml").write_text(
        'format = 1\nname = "mine"\nconvention = "modified"\n'
        '[[joint]]\ntype = "prismatic"\na = 0.1\nalpha = 0\nd = 0\ntheta = 0\n'
        '[[joint]]\ntype = "revolute"\na = 0\nalpha = "pi/2"\nd = 0.2\ntheta = 0\n'
    )
    monkeypatch.chdir(tmp_path)
    assert run("demo", "--robot", "mine.toml", "--quick") == 0
    assert (tmp_path / "out" / "mine" / "index.html").is_file()
    assert "skipped: joint1 has no body" in capsys.readouterr().out


def test_a_demo_into_a_file_is_refused(tmp_path, capsys):
    (tmp_path / "taken").write_text("keep me")
    assert run("demo", "--output", str(tmp_path / "taken")) == 2
    assert "not a folder" in capsys.readouterr().err
    assert (tmp_path / "taken").read_text() == "keep me"


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["planar2r", *(pytest.param(x, marks=only_accepting) for x in ("puma560", "panda"))]
)
def test_the_page_shows_the_other_branches_as_ghosts_that_can_be_hidden(name, demo, chromium):
    folder, _ = demo(name)
    page = chromium.page()
    try:
        page.open(f"file://{folder}/index.html")
        page.press(" ")  # pause
        page.press("Home")
        with_ghosts = page.screenshot()
        page.press("o")
        without = page.screenshot()
        assert (
            page.evaluate("document.getElementById('overlays').getAttribute('aria-pressed')")
            == "false"
        )
        assert np.any(np.abs(with_ghosts - without) > 20, axis=-1).sum() > 1000
        assert page.errors == []
    finally:
        page.close()


def test_the_tour_keeps_limits_and_speeds_and_begins_with_a_line(line_of):
    name, line = line_of
    arm = Arm.load(name)
    times, q = tour(arm, line.q if line else None)
    numbers = arm.description.numbers
    assert np.all(np.diff(times) > 0)
    assert np.ptp(q, axis=0).max() > 0.05
    assert np.all(q >= numbers.lower - 1e-9)
    assert np.all(q <= numbers.upper + 1e-9)
    assert np.all(np.abs(np.diff(q, axis=0)) * TOUR_RATE <= numbers.velocity)
    assert np.array_equal(q[0], q[-1])
    assert np.array_equal(q[0], line.q[0])


def test_a_straight_line_is_found_and_followed_by_every_robot(line_of):
    name, line = line_of
    arm = Arm.load(name)
    assert line.length > 0.05 * arm.description.reach
    assert line.switches == 0
    assert np.abs(np.diff(line.q, axis=0)).max() < 0.2
    placed = arm.fk(line.q)[:, :3, 3]
    if name == "pan_tilt":  # it only aims
        return
    assert np.abs(placed - line.T[:, :3, 3]).max() < CLOSES
    # What lies between the poses is on the line too, as far as one sees.
    halfway = arm.fk((line.q[1:] + line.q[:-1]) / 2)[:, :3, 3]
    assert np.abs(halfway - (placed[1:] + placed[:-1]) / 2).max() < 1e-3 * line.length


def test_every_way_to_reach_the_lines_first_pose_closes(line_of):
    name, line = line_of
    arm = Arm.load(name)
    ways = branches(arm, line.q[0])
    assert len(ways.q) >= 2
    assert ways.closed_form == (arm.family.closed_form)
    assert (ways.error is None) == (name == "pan_tilt")
    assert (ways.error or 0.0) < CLOSES
    # The arm stands in one of them.
    assert np.abs(np.exp(1j * ways.q) - np.exp(1j * line.q[0])).max(axis=1).min() < 1e-6


def test_without_a_line_the_tour_goes_through_the_configurations():
    arm = Arm.load("puma560")
    times, q = tour(arm)
    assert len(times) == len(q)
    assert np.array_equal(q[0], arm.configurations["zero"])
    assert np.array_equal(q[0], q[-1])
    for stop in arm.configurations.values():
        assert np.abs(q - stop).max(axis=1).min() == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_the_race_keeps_the_limits_and_is_faster_than_the_quintic(name):
    arm = Arm.load(name)
    best, quintic = race(arm, 16)
    numbers = arm.description.numbers
    start, goal = moved_configurations(arm)
    assert np.abs(goal - start).min() > 0
    assert best.report.certificate.ok
    assert best.duration < quintic.duration
    both = there_and_back(best, quintic)
    assert both.duration > best.duration + quintic.duration
    t = np.linspace(0, both.duration, 2001)
    q = both.q(t)
    assert np.array_equal(q[0], start)
    assert np.abs(q[-1] - start).max() < 1e-9
    assert np.abs(q - goal).max(axis=1).min() < 1e-9
    assert np.all(q >= numbers.lower - 1e-9)
    assert np.all(q <= numbers.upper + 1e-9)
    assert np.all(np.abs(both.qd(t)) <= numbers.velocity * (1 + KEPT))
    assert np.all(np.abs(both.tau(t)) <= numbers.effort * (1 + KEPT))


def test_the_page_of_the_plan_plays_without_a_jump(demo, chromium):
    folder, _ = demo("planar2r")
    page = chromium.page()
    try:
        page.open(f"file://{folder}/plan.html")
        arm = Arm.load("planar2r")
        best = Trajectory.load(folder / "plan.npz", arm.description)
        times, q = (np.array(page.evaluate(f"[...dhkit.motion.{what}]")) for what in ("times", "q"))
        assert np.abs(np.diff(q.reshape(-1, 2), axis=0)).max() < 0.1
        assert times[-1] > 2 * best.duration
        assert page.errors == []
    finally:
        page.close()
