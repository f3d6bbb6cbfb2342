"""`dhkit import-cad`: from the parts of docs/cad.md to a robot that simulates, and one line otherwise."""

import json
import runpy
import sys
from pathlib import Path

import pytest

from dhkit import Arm
from dhkit.cli import main

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
TABLE = str(EXAMPLES / "cad_arm.toml")


@pytest.fixture
def dhkit(capsys):
    def run(*arguments):
        with pytest.raises(SystemExit) as exit:
            main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return exit.value.code, out, err

    return run


@pytest.fixture
def parts(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["cad_arm.py", str(tmp_path / "parts")])
    runpy.run_path(str(EXAMPLES / "cad_arm.py"), run_name="__main__")
    capsys.readouterr()
    return tmp_path / "parts"


def test_an_assembly_becomes_a_robot(dhkit, parts, tmp_path):
    status, out, err = dhkit(
        "import-cad", parts, "--table", TABLE, "--density", "2700", "-o", tmp_path / "arm"
    )
    assert (status, err) == (0, "")
    assert (
        "unit: mm, found by size" in out
        and "link 3: arm assembly - link3-1.STL, 12 triangles, 0.3888 kg" in out
    )
    assert f"wrote {tmp_path / 'arm' / 'robot.toml'}" in out
    arm = Arm.load(tmp_path / "arm" / "robot.toml")
    assert arm.description.warnings == ()
    assert arm.verify(20).ok
    assert arm.gravity_torque(arm.configurations["ready"]).shape == (3,)
    assert arm.description.joints[1].a.text == "upper"
    assert (
        dhkit(
            "picture",
            tmp_path / "arm" / "robot.toml",
            "-o",
            tmp_path / "arm.png",
            "--size",
            "160x120",
        )[0]
        == 0
    )


def test_masses_maps_and_poses_as_json(dhkit, parts, tmp_path):
    (parts / "arm assembly - link3-1.STL").rename(parts / "forearm.stl")
    status, out, err = dhkit(
        "import-cad", parts, "--table", TABLE, "--mass", "1=3.2", "--mass", "2=1.5", "--map", "3=forearm.stl",
        "--at", "0", "60", "-60", "--degrees", "--unit", "mm", "-o", tmp_path / "arm", "--json",
    )  # fmt: skip
    assert (status, err) == (0, "")
    told = json.loads(out)
    assert told["triangles"]["3"] == 12 and len(told["files"]) == 10
    assert any("as given" in note for note in told["notes"])
    description = Arm.load(tmp_path / "arm" / "robot.toml").description
    assert [joint.body and float(joint.body.mass) for joint in description.joints] == pytest.approx(
        [3.2, 1.5, None]
    )


def test_a_part_is_left_out_by_a_map_to_no_link(dhkit, parts, tmp_path):
    (parts / "gripper.stl").write_bytes((parts / "arm assembly - link3-1.STL").read_bytes())
    status, _, err = dhkit("import-cad", parts, "--table", TABLE, "-o", tmp_path / "arm")
    assert status == 2 and "for a part of no link" in err
    status, out, err = dhkit(
        "import-cad", parts, "--table", TABLE, "--map", "-=gripper.stl", "-o", tmp_path / "arm"
    )
    assert (status, err) == (0, "") and "left out: gripper.stl" in out
    assert "pose of the export: the configuration ready: q = 0, 1.047, -1.047" in out


def test_links_without_masses_are_named(dhkit, parts, tmp_path):
    status, out, _ = dhkit("import-cad", parts, "--table", TABLE, "-o", tmp_path / "arm")
    assert status == 0
    assert "no body: links 1, 2, 3; state --density, --mass or --report" in out


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--mass", "heavy"], "--mass heavy: expected LINK=VALUE, such as 1=3.2"),
        (["--mass", "1=heavy"], "--mass 1=heavy: expected a number of kg"),
        (["--mass", "1=1", "--mass", "1=2"], "--mass: link 1 twice"),
        (["--mass", "9=1"], "links 0 to 3"),
        (
            ["--map", "forearm.stl"],
            '--map forearm.stl: expected LINK=VALUE, such as "3=forearm.stl"',
        ),
        (["--map", "3=../../etc/passwd"], "the mapping names '../../etc/passwd'"),
        (["--unit", "furlong"], "unit is 'furlong'"),
        (["--density", "-1"], "density is -1"),
        (["--simplify", "0"], "simplify is 0"),
        (["--report", "none.txt"], "none.txt: no such file"),
        (["--at", "1"], "values of --at"),
        (["--table", "none.toml"], "none.toml: no such file"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(
    dhkit, parts, tmp_path, options, complaint
):
    status, out, err = dhkit(
        "import-cad", parts, "--table", TABLE, "-o", tmp_path / "arm", *options
    )
    assert (status, out) == (2, "")
    assert complaint in err and err.startswith("dhkit: ") and err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["parts"]


def test_a_folder_with_content_is_not_written_to(dhkit, parts, tmp_path):
    before = sorted(parts.iterdir())
    status, _, err = dhkit("import-cad", parts, "--table", TABLE, "-o", parts)
    assert status == 2 and "is not empty; expected a new folder" in err
    assert sorted(parts.iterdir()) == before
