"""`dhkit workspace`: what it says and writes."""

import json

import numpy as np
import pytest
from PIL import Image

from acceptance import different_robots_first
from dhkit import Arm, robots
from dhkit.cli import main
from dhkit.kinematics.workspace import workspace


@pytest.fixture
def dhkit(capsys, tmp_path, monkeypatch):
    """Run `dhkit workspace` in an empty folder; return its status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        with pytest.raises(SystemExit) as exit:
            main(("workspace", *arguments))
        out, err = capsys.readouterr()
        return exit.value.code, out, err

    return run


def test_it_says_what_is_reached_and_writes_a_picture_and_a_page(dhkit, tmp_path):
    status, out, err = dhkit("planar2r", "--samples", "5000", "--output", "here")
    assert (status, err) == (0, "")
    assert "area reached: about 2." in out
    assert "distance from axis 1 [m]" in out
    assert "best 0.2 with the tool at" in out
    assert sorted(path.name for path in (tmp_path / "here").iterdir()) == [
        "workspace.html",
        "workspace.png",
    ]
    with Image.open(tmp_path / "here" / "workspace.png") as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 50
    assert (tmp_path / "here" / "workspace.html").stat().st_size < 2_000_000


@pytest.mark.slow
@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_machines_are_told_the_same_as_python(dhkit, name):
    status, out, err = dhkit(name, "--samples", "500", "--seed", "3", "--json")
    assert (status, err) == (0, "")
    facts, space = json.loads(out), workspace(Arm.load(name).description, 500, 3)
    assert facts["samples"] == 500
    assert facts["radii_m"] == list(space.radii)
    assert facts["best"]["q_rad"] == space.best.tolist()
    assert facts["best"]["manipulability"] == space.manipulability.max()
    assert (facts["estimate"] or {}).get("value") == (
        space.estimate.value if space.estimate else None
    )
    assert facts["files"] == [f"out/{name}/workspace.png", f"out/{name}/workspace.html"]


def test_what_is_assumed_is_said(dhkit, tmp_path):
    (tmp_path / "slide.toml").write_text(
        'format = 1\nname = "slide"\nconvention = "standard"\n'
        '[[joint]]\ntype = "prismatic"\na = 0\nalpha = 0\nd = 0\ntheta = 0\n'
        '[[joint]]\ntype = "revolute"\na = 0.4\nalpha = 0\nd = 0\ntheta = 0\n'
    )
    status, out, _ = dhkit("slide.toml", "--samples", "500")
    assert status == 0
    assert "assumed: joint 1 joint1 has no limits: it was moved 0.4 m to both sides" in out
    assert "a curved surface, which has no volume" in out


def test_the_page_shows_the_arm_among_its_points(dhkit, tmp_path, chromium):
    assert dhkit("puma560", "--samples", "20000")[0] == 0
    page = chromium.page()
    try:
        page.open(f"file://{tmp_path}/out/puma560/workspace.html")
        with_points = page.screenshot()
        layers = "Object.entries(dhkit.stage.overlays.layers)"
        filled = page.evaluate(
            f"{layers}.filter(([, layer]) => layer.group.children.length).map(([name]) => name)"
        )
        assert filled == ["points", "ellipsoids"]
        page.press("o")
        without = page.screenshot()
        assert np.any(np.abs(with_points - without) > 20, axis=-1).sum() > 3_000
        assert [
            url for url in page.requests if not url.startswith(("file:///", "data:", "blob:"))
        ] == []
        assert page.errors == []
    finally:
        page.close()


def test_nobody_looks_at_a_pipe(dhkit):
    assert dhkit("planar2r", "--samples", "100")[2] == ""


@pytest.mark.usefixtures("bar_at_once")
def test_long_work_shows_how_far_it_is_to_someone_who_looks(dhkit):
    assert "sampling" in dhkit("planar2r", "--samples", "100")[2]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["cake"], "no robot 'cake'"),
        (["planar2r", "--samples", "0"], "Invalid value"),
        (["planar2r", "--samples", "many"], "Invalid value"),
        (["planar2r", "--seed", "-1"], "Invalid value"),
        (["planar2r", "--output", "taken"], "taken: not a folder"),
    ],
)
def test_bad_input_is_one_line_and_status_2(dhkit, arguments, complaint, tmp_path):
    (tmp_path / "taken").write_text("keep me")
    status, out, err = dhkit(*arguments)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert complaint in err
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]
