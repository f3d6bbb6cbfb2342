"""Commands and their modules, exit statuses, and files that commands write."""

import importlib
import pkgutil
import re

import numpy as np
import pytest
import typer

import dhkit.cli
from dhkit import Arm
from dhkit.cli import analysis_commands, motion_commands, robot_commands
from dhkit.cli.app import app
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import load_arm
from dhkit.cli.output import MotionFiles, finite, output_folder
from dhkit.cli.units import joint_entry
from dhkit.errors import DescriptionError

OWN = {"build", "schema"}
"""Commands without a module of their own."""


def test_each_command_is_named_by_the_module_that_carries_it_out():
    commands = set(typer.main.get_command(app).commands)
    groups = (robot_commands, motion_commands, analysis_commands)
    assert commands == {name for group in groups for name in typer.main.get_command(group.app).commands}
    named = set()
    for module in pkgutil.iter_modules(dhkit.cli.__path__):
        text = importlib.import_module(f"dhkit.cli.{module.name}").__doc__
        named |= set(re.findall(r"`dhkit ([a-z-]+)`", text))
    assert commands - OWN == named


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
    assert all((tmp_path / name).stat().st_size for name in ("motion.npz", "page.html", "figure.png"))


def test_an_output_folder_is_no_file(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DescriptionError, match="not a folder"):
        output_folder(tmp_path / "file", "planar2r")
    assert output_folder(None, "planar2r").parts == ("out", "planar2r")


def test_json_has_units_in_its_keys_and_null_for_what_is_not_finite():
    arm = Arm.load("stanford")
    q = np.full(6, np.pi)
    entry = joint_entry(arm, "q", q, degrees=True)
    assert list(entry) == ["q_deg"] and entry["q_deg"][0] == pytest.approx(180) and entry["q_deg"][2] == np.pi
    assert finite({"a": (1.0, float("inf")), "b": float("nan")}) == {"a": [1.0, None], "b": None}
