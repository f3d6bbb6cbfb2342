"""The command as a person and as a machine use it."""

import json

import numpy as np
import pytest

from dhkit import Arm, robots
from dhkit.cli import main
from dhkit.description import write_robot


@pytest.fixture
def dhkit(capsys):
    """Run the command in this process; return its status, stdout and stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as exit:
            main(arguments)
        out, err = capsys.readouterr()
        return exit.value.code, out, err

    return run


def test_robots_are_listed(dhkit):
    status, out, err = dhkit("robots")
    assert (status, err) == (0, "")
    assert all(name in out for name in robots())
    listed = json.loads(dhkit("robots", "--json")[1])
    assert [robot["name"] for robot in listed] == list(robots())


@pytest.mark.parametrize("name", robots())
def test_info_shows_what_the_robot_is(dhkit, name):
    status, out, err = dhkit("info", name)
    assert (status, err) == (0, "")
    arm = Arm.load(name)
    assert str(arm.dh) in out
    assert "m/s²" in out
    assert "[kg]" in out
    for warning in arm.description.warnings:
        assert warning in out
    assert f"inverse kinematics: {arm.family}" in out
    facts = json.loads(dhkit("info", name, "--json")[1])
    assert facts["n"] == arm.n
    assert facts["inverse_kinematics"] == str(arm.family)
    assert bool(facts["branches"]) == (arm.family.closed_form)
    assert facts["joints"][0]["alpha_rad"] == arm.description.numbers.alpha[0]


def test_fk_takes_configurations_expressions_and_degrees(dhkit):
    arm = Arm.load("puma560")
    expected = arm.fk(arm.configurations["ready"])
    for arguments in (
        ["ready"],
        ["0", "pi/2", "-pi/2", "0", "0", "0"],
        ["0,90,-90,0,0,0", "--degrees"],
        ["0", "90", "-90", "0", "0", "0", "--degrees"],
    ):
        status, out, _ = dhkit("fk", "puma560", *arguments, "--json")
        assert status == 0
        assert np.allclose(json.loads(out)["T"], expected, atol=1e-15)
    status, out, _ = dhkit("fk", "puma560", "ready", "--frames")
    assert "frame 6" in out
    assert "1.535430" in out


def test_info_lists_the_bodies_of_a_link_that_has_several(dhkit, tmp_path):
    path = tmp_path / "loaded.toml"
    write_robot(Arm.load("planar2r").with_payload(0.5, (0.1, 0, 0)).description, path)
    assert (
        "link 2: body 1 of 1.5 kg at (-0.2, 0, 0) m, payload of 0.5 kg at (0.1, 0, 0) m"
        in dhkit("info", str(path))[1]
    )
    bodies = json.loads(dhkit("info", str(path), "--json")[1])["joints"][1]["bodies"]
    assert bodies[1] == {"name": "payload", "mass_kg": 0.5, "com_m": [0.1, 0.0, 0.0]}


def test_info_names_the_branches(dhkit):
    facts = json.loads(dhkit("info", "puma560", "--json")[1])
    assert facts["branches"] == list(Arm.load("puma560").ik(np.eye(4)).branches)


def test_build_writes_a_urdf_with_its_meshes(dhkit, tmp_path):
    status, out, _ = dhkit("build", "puma560", "-o", str(tmp_path / "arm.urdf"))
    assert status == 0
    assert out.count("wrote") == 8
    assert (tmp_path / "meshes" / "puma560" / "base.stl").is_file()


def test_verify_says_how_well_and_fails_where_it_does_not(dhkit, monkeypatch):
    status, out, _ = dhkit("verify", "ur5", "--samples", "10")
    assert status == 0
    assert "agrees" in out
    report = json.loads(dhkit("verify", "ur5", "--samples", "10", "--json")[1])
    assert report["ok"]
    assert {"frame positions", "Jacobian (tool)", "mass matrix M", "regressor Y"} <= {
        a["quantity"] for a in report["agreements"]
    }
    # Our frames off by a nanometre: the check must see it.
    from dhkit import kinematics

    right = kinematics.forward_kinematics
    monkeypatch.setattr(kinematics, "forward_kinematics", lambda arm, q: right(arm, q) + 1e-9)
    status, out, _ = dhkit("verify", "ur5", "--samples", "10")
    assert status == 1
    assert "DISAGREES at q" in out


def test_the_schema_is_printed(dhkit):
    assert json.loads(dhkit("schema", "robot")[1])["title"] == "dhkit robot file, format 1"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["info", "pume560"], "no robot 'pume560' in the library; did you mean 'puma560'?"),
        (["info", "none.toml"], "none.toml: no such file"),
        (["info"], "Missing argument"),
        (["nonsense"], "No such command"),
        (["info", "ur5", "--jsn"], "No such option"),
        (["fk", "ur5", "raedy"], "no configuration 'raedy'; it has zero, ready"),
        (["fk", "ur5", "1", "2"], "2 joint values; expected 6"),
        (["fk", "planar2r", "nan", "1"], "unknown name 'nan'"),
        (["fk", "planar2r", "1/0", "1"], "division by zero"),
        (["verify", "ur5", "--samples", "0"], "Invalid value"),
        (["verify", "ur5", "--samples", "many"], "Invalid value"),
        (["build", "ur5", "-o", "/dev/null/all.urdf"], "/dev/null: a file; expected a folder"),
        (
            ["schema", "cake"],
            "no schema 'cake'; expected robot, assignment, sheet, rubric, task, motion",
        ),
        (["demo", "--robot", "cake"], "no robot 'cake'"),
    ],
)
def test_bad_input_is_one_line_and_status_2(dhkit, arguments, complaint, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, err = dhkit(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith("dhkit: ")
    assert err.count("\n") == 1
    assert complaint in err
    assert not list(tmp_path.iterdir())


def test_reach_is_the_tools_and_the_sum_of_lengths_has_its_own_name(capsys):
    import json

    for command in (
        ["info", "puma560", "--json"],
        ["workspace", "puma560", "--samples", "2000", "--json"],
    ):
        with pytest.raises(SystemExit):
            main(command)
        facts = json.loads(capsys.readouterr().out.splitlines()[-1])
        assert facts["reach_m"] == pytest.approx(0.88, abs=0.02)
        assert facts["length_sum_m"] == pytest.approx(1.70578)


@pytest.mark.parametrize(
    ("words", "position", "completed"),
    [("dhkit ext", 1, "extract"), ("dhkit extract --pa", 2, "--package-dir")],
)
def test_a_shell_completes_commands_and_options(words, position, completed):
    import os
    import subprocess
    import sys

    asked = {"_DHKIT_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(position)}
    command = [
        sys.executable,
        "-c",
        "import sys; sys.argv[0] = 'dhkit'; from dhkit.cli import main; main()",
    ]
    done = subprocess.run(
        command, env=os.environ | asked, capture_output=True, text=True, check=False
    )
    assert completed in done.stdout.split(), done
