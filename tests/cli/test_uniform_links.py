"""Robots without bodies: rods for links on request, in every command that needs dynamics."""

import pytest

from acceptance import slow_if
from dhkit import Arm, Trajectory
from dhkit.cli import main
from dhkit.description import from_dh, read_robot, write_robot


@pytest.fixture
def robot(tmp_path):
    """Write a robot without bodies; return its file."""
    arm = from_dh([(0, 0, 0.3, 0), (0, 0, 0.2, 0)], name="bare", limits=[(-2, 2), (-2, 2)])
    path = tmp_path / "bare.toml"
    write_robot(Arm(arm).with_limits(velocity=[2, 2], torque=[20, 20]).description, path)
    return path


@pytest.mark.parametrize(
    "command",
    [
        slow_if(True, "plan {} --from 0 0 --to 1 1 --intervals 24 -o {}.npz"),
        "simulate {} --duration 0.5",
        "compare {} --controllers pid --duration 0.5",
        "equations {}",
        "verify {} --samples 5",
    ],
)
def test_rods_stand_in_for_bodies(command, robot, capsys):
    words = [word.replace("{}", str(robot)) for word in command.split()]
    with pytest.raises(SystemExit) as ended:
        main([*words, "--uniform-links"])
    assert ended.value.code == 0, capsys.readouterr().err
    if command.startswith("plan"):
        rods = Arm.load(robot).with_uniform_links()
        assert Trajectory.load(f"{robot}.npz", rods).matches(rods.description)
        for shown in (["play", str(robot), f"{robot}.npz", "--html", f"{robot}.html"],):
            with pytest.raises(SystemExit) as ended:
                main([*shown, "--uniform-links"])
            assert ended.value.code == 0
    if command.startswith("equations"):
        assert "M22 = m2/75" in capsys.readouterr().out


def test_without_rods_the_option_is_named(robot, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["simulate", str(robot)])
    assert ended.value.code == 2
    assert "--uniform-links" in capsys.readouterr().err


def test_a_urdf_has_them_too(robot, tmp_path):
    with pytest.raises(SystemExit):
        main(["build", str(robot), "--uniform-links", "-o", str(tmp_path / "rods.urdf")])
    assert (tmp_path / "rods.urdf").read_text().count('<mass value="1" />') == 2
    assert not any(joint.bodies for joint in read_robot(robot).joints)
