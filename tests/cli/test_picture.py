"""`dhkit picture`: files of an arm and of motions, and one line where they cannot be written."""

import pytest
from PIL import Image

from dhkit import Arm
from dhkit.cli import main


def run(*arguments):
    with pytest.raises(SystemExit) as exit:
        main([str(argument) for argument in arguments])
    return exit.value.code


@pytest.fixture
def motion(tmp_path):
    return Arm.load("planar2r").quintic([0, 0], [1, 1], 1.0).save(tmp_path / "motion.npz")


def test_an_arm_is_drawn_where_it_is_told(tmp_path, capsys):
    for name, at in (
        ("ready.png", ()),
        ("named.png", ("--at", "ready")),
        ("there.png", ("--at", "30 20", "--degrees")),
    ):
        assert run("picture", "planar2r", "-o", tmp_path / name, "--size", "160x120", *at) == 0
        assert f"wrote {tmp_path / name}" in capsys.readouterr().out.replace("\n", "")
        with Image.open(tmp_path / name) as image:
            assert image.size == (160, 120)
    assert (tmp_path / "ready.png").read_bytes() == (tmp_path / "named.png").read_bytes()
    assert (tmp_path / "ready.png").read_bytes() != (tmp_path / "there.png").read_bytes()


def test_a_motion_is_a_gif_or_numbered_pictures(tmp_path, motion):
    assert (
        run(
            "picture",
            "planar2r",
            "--motion",
            motion,
            "-o",
            tmp_path / "m.gif",
            "--rate",
            "5",
            "--size",
            "80x60",
        )
        == 0
    )
    with Image.open(tmp_path / "m.gif") as gif:
        assert gif.n_frames == 6
    assert (
        run(
            "picture",
            "planar2r",
            "--motion",
            motion,
            "-o",
            tmp_path / "m.png",
            "--count",
            "3",
            "--size",
            "80x60",
        )
        == 0
    )
    assert sorted(path.name for path in tmp_path.glob("*.png")) == ["m-1.png", "m-2.png", "m-3.png"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("-o", "a.gif"), "ends in '.gif'; expected .png"),
        (("-o", "/dev/null/a.png"), "/dev/null: a file; expected a folder"),
        (("-o", "a.png", "--size", "big"), "expected width and height"),
        (("-o", "a.png", "--size", "9x9"), "expected 16 to 4000 px"),
        (("-o", "a.png", "--at", "up"), "has no configuration 'up'"),
        (("-o", "a.png", "--at", "1 2", "--motion", "m.npz"), "expected one of them"),
    ],
)
def test_what_cannot_be_written_is_said_in_a_line(
    tmp_path, monkeypatch, capsys, arguments, complaint
):
    monkeypatch.chdir(tmp_path)
    assert run("picture", "planar2r", *arguments) == 2
    assert complaint in " ".join(capsys.readouterr().err.split())
    assert not list(tmp_path.iterdir())
