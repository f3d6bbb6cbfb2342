"""Commands and their modules, exit statuses, and files that commands write."""

import importlib
import json

import numpy as np
import pytest
import typer

from acceptance import slow_if
from dhkit import Arm
from dhkit.cli import main
from dhkit.cli.app import COMMANDS, app, load_command
from dhkit.cli.bench import write
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import load_arm
from dhkit.cli.output import MotionFiles, finite, output_folder
from dhkit.cli.units import joint_entry
from dhkit.errors import DescriptionError
from mesh_shapes import ONE_LINK_WITH_A_MESH


def test_the_commands_are_those_of_the_modules():
    assert list(typer.main.get_command(app).commands) == list(COMMANDS)
    modules = [importlib.import_module(f"dhkit.cli.{module}") for module in set(COMMANDS.values())]
    assert {
        name for module in modules for name in typer.main.get_group(module.app).commands
    } == set(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_is_named_by_its_module_and_its_options_have_help(name):
    command = load_command(name)
    assert f"`dhkit {name}`" in importlib.import_module(f"dhkit.cli.{COMMANDS[name]}").__doc__
    assert all(
        getattr(parameter, "help", None) for parameter in command.params if parameter.name != "help"
    )


def test_statuses_are_those_of_shells():
    assert [int(status) for status in ExitStatus] == [0, 1, 2, 130, 141]


def test_motion_files_are_checked_before_they_are_written_and_listed_after(tmp_path):
    arm = load_arm("planar2r", uniform=True)
    with pytest.raises(DescriptionError, match=r"ends in .\.txt.; expected \.npz"):
        MotionFiles(tmp_path / "motion.txt", None, None).check((".npz",))
    files = MotionFiles(tmp_path / "motion.npz", tmp_path / "page.html", tmp_path / "figure.png")
    files.check((".npz",))
    written = files.write(arm, arm.quintic([0.0, 0.0], [0.5, 0.5], 1.0), "there", "A motion.")
    assert written == [str(tmp_path / name) for name in ("motion.npz", "page.html", "figure.png")]
    assert all(
        (tmp_path / name).stat().st_size for name in ("motion.npz", "page.html", "figure.png")
    )


def test_an_output_folder_is_no_file(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DescriptionError, match="not a folder"):
        output_folder(tmp_path / "file", "planar2r")
    assert output_folder(None, "planar2r").parts == ("out", "planar2r")


def test_json_has_units_in_its_keys_and_null_for_what_is_not_finite():
    arm = Arm.load("stanford")
    q = np.full(6, np.pi)
    entry = joint_entry(arm, "q", q, degrees=True)
    assert (
        list(entry) == ["q_deg"]
        and entry["q_deg"][0] == pytest.approx(180)
        and entry["q_deg"][2] == np.pi
    )
    assert finite({"a": (1.0, float("inf")), "b": float("nan")}) == {"a": [1.0, None], "b": None}


def test_a_benchmark_is_written_as_markdown_and_json_whatever_the_suffix(tmp_path):
    class Report:
        def markdown(self):
            return "# Times\n"

        def json(self):
            return {"unit": "µs"}

    written = write(Report(), tmp_path / "times.txt")
    assert written == (tmp_path / "times.md", tmp_path / "times.json")
    assert written[0].read_text() == "# Times\n" and json.loads(written[1].read_text("utf-8")) == {
        "unit": "µs"
    }


@pytest.mark.parametrize(
    "words",
    [
        ["build", "r.toml", "-o", "r.urdf"],
        ["verify", "r.toml"],
        slow_if(True, ["demo", "--quick", "--robot", "r.toml"]),
    ],
)
def test_commands_print_the_warnings_of_a_robot_file(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "r.toml").write_text(ONE_LINK_WITH_A_MESH)
    (tmp_path / "link.stl").write_text("no mesh")
    with pytest.raises(SystemExit):
        main(words)
    written = capsys.readouterr().err
    assert (
        "dhkit: warning: link of turn: shape.mesh: 'link.stl' is not a mesh that can be read"
        in written
    )
