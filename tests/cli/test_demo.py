"""`dhkit demo`: what it writes, for any robot; the page shows the arm without a network."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from dhkit import Arm, robots
from dhkit.cli import main
from dhkit.cli.demo import RATE, tour


def run(*arguments):
    with pytest.raises(SystemExit) as exit:
        main(arguments)
    return exit.value.code


def test_the_demo_writes_a_urdf_a_figure_and_a_page(tmp_path, capsys):
    folder = tmp_path / "out"
    assert run("demo", "--quick", "--output", str(folder)) == 0
    out = capsys.readouterr().out
    assert "agrees with Pinocchio" in out
    assert "2 shoulder" in out
    assert sorted(path.name for path in folder.iterdir()) == ["index.html", "meshes", "puma560.png", "puma560.urdf"]
    assert ElementTree.parse(folder / "puma560.urdf").getroot().get("name") == "puma560"
    with Image.open(folder / "puma560.png") as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 50
    page = (folder / "index.html").read_text("utf-8")
    assert len(page) < 2_500_000


def test_the_page_of_the_demo_shows_the_arm_moves_it_and_asks_nobody(tmp_path, chromium):
    assert run("demo", "--quick", "--output", str(tmp_path)) == 0
    page = chromium.page()
    page.open(f"file://{tmp_path}/index.html")
    page.press(" ")  # pause
    with_arm = page.screenshot()
    page.evaluate("dhkit.stage.nodes.forEach(node => { node.visible = false; }); dhkit.stage.viewer.set_dirty()")
    without = page.screenshot()
    page.evaluate("dhkit.stage.nodes.forEach(node => { node.visible = true; }); dhkit.stage.viewer.set_dirty()")
    page.press(" ")
    page.until("dhkit.motion && !document.hidden")
    page.settle()
    page.settle()
    later = page.screenshot()
    try:
        # The arm and its shadow cover a good part of the page; an empty scene would differ by nothing.
        assert np.any(np.abs(with_arm - without) > 20, axis=-1).sum() > 10_000
        assert np.any(np.abs(with_arm - later) > 20, axis=-1).sum() > 200
        assert [url for url in page.requests if not url.startswith(("file:///", "data:", "blob:"))] == []
        assert page.errors == []
    finally:
        page.close()


def test_the_demo_tells_machines_what_it_did(tmp_path, capsys):
    assert run("demo", "--robot", "stanford", "--quick", "--json", "--output", str(tmp_path)) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["ok"]
    assert [stage["stage"] for stage in report["stages"]] == ["build", "verify", "figure", "page"]


def test_the_demo_works_for_a_robot_of_ones_own(tmp_path, monkeypatch, capsys):
    (tmp_path / "mine.toml").write_text(
        'format = 1\nname = "mine"\nconvention = "modified"\n'
        '[[joint]]\ntype = "prismatic"\na = 0.1\nalpha = 0\nd = 0\ntheta = 0\n'
        '[[joint]]\ntype = "revolute"\na = 0\nalpha = "pi/2"\nd = 0.2\ntheta = 0\n'
    )
    monkeypatch.chdir(tmp_path)
    assert run("demo", "--robot", "mine.toml", "--quick") == 0
    assert (tmp_path / "out" / "mine" / "index.html").is_file()


def test_a_demo_into_a_file_is_refused(tmp_path, capsys):
    (tmp_path / "taken").write_text("keep me")
    assert run("demo", "--output", str(tmp_path / "taken")) == 2
    assert "not a folder" in capsys.readouterr().err
    assert (tmp_path / "taken").read_text() == "keep me"


@pytest.mark.parametrize("name", robots())
def test_the_tour_keeps_the_limits_and_the_speeds(name):
    arm = Arm.load(name)
    times, q = tour(arm)
    numbers = arm.description.numbers
    assert np.all(np.diff(times) > 0)
    assert np.ptp(q, axis=0).max() > 0.05
    assert np.all(q >= numbers.lower - 1e-12)
    assert np.all(q <= numbers.upper + 1e-12)
    assert np.all(np.abs(np.diff(q, axis=0)) * RATE <= numbers.velocity)
    assert np.array_equal(q[0], q[-1])
