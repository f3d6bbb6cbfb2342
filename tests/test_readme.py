"""README's commands and files are run as they stand; its Python is run as doctests."""

import re
import shlex
from pathlib import Path

import pytest
from tools.readme_table import with_tables

from acceptance import slow_if
from dhkit.bench import Mode, rounds
from dhkit.cli import main
from dhkit.description import read_robot

README = (Path(__file__).resolve().parents[1] / "README.md").read_text("utf-8")
COMMANDS = re.findall(r"^\$ dhkit ([^#\n]*)", README, re.MULTILINE)
FILES = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)


@pytest.mark.parametrize(
    "command", [slow_if(x.startswith(("bench", "compare", "demo")), x) for x in COMMANDS]
)
def test_a_command_of_the_readme_works(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("webbrowser.open", lambda url: True)
    if command.startswith("bench"):  # no figure is judged
        monkeypatch.setattr(rounds, "MIN_TIMING", 1e-4)
        monkeypatch.setattr(rounds, "BUDGET", dict.fromkeys(Mode, 1e-3))
    if command.startswith("lab"):
        monkeypatch.setattr("dhkit.cli.browser.time.sleep", press_ctrl_c)
    (tmp_path / "answer.toml").write_text(
        'robot = "planar2r"\n[answer]\nV = "m1*g*l1*s1/2 + m2*g*(l1*s1 + l2*s12/2)"\n'
    )
    with pytest.raises(SystemExit) as exit:
        main(shlex.split(command))
    assert exit.value.code == 0, capsys.readouterr()


def press_ctrl_c(seconds):
    raise KeyboardInterrupt


def test_there_are_commands_and_a_file_to_run():
    assert len(COMMANDS) >= 6
    assert len(FILES) == 1


def test_the_robot_file_of_the_readme_is_one(tmp_path):
    path = tmp_path / "two_rods.toml"
    path.write_text(FILES[0])
    arm = read_robot(path)
    assert float(arm.numbers.a.sum()) == 0.8
    assert not arm.warnings


def test_the_tables_are_those_of_the_benchmarks():
    """Run `python -m tools.readme_table` when this fails."""
    assert with_tables(README) == README


def test_the_readme_is_short():
    prose = re.sub(r"```.*?```", "", README, flags=re.DOTALL)
    assert sum(bool(line.strip()) for line in prose.splitlines()) <= 120


def test_the_documents_that_the_readme_names_are_there():
    root = Path(__file__).resolve().parents[1]
    for name in re.findall(r"\]\(([\w./-]+)\)", README):
        assert (root / name).is_file(), name


def test_nothing_installs_the_strangers_package():
    """The name dhkit belongs to somebody else on PyPI."""
    root = Path(__file__).parents[1]
    texts = [
        root / "README.md",
        *root.glob("docs/**/*.md"),
        *root.glob("src/dhkit/**/*.py"),
        root / "CONTRIBUTING.md",
    ]
    found = [
        path.name
        for path in texts
        if re.search(r"pip3? install ['\"]?dhkit(?!-robotics)", path.read_text())
    ]
    assert found == []
    assert 'name = "dhkit-robotics"' in (root / "pyproject.toml").read_text()
