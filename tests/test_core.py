"""The core installation: dhkit without Pinocchio, meshcat and the packages that draw (requirements-core.txt)."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ABSENT = "pinocchio coal hppfcl meshcat IPython matplotlib PIL trimesh manifold3d fast_simplification yourdfpy tornado"
"""Modules of packages that a core installation lacks; other packages of an environment may need some of them."""
RUN = f"""
import json, sys
ABSENT = {ABSENT!r}.split()

class WithoutAbsent:
    def __init__(self, finder):
        self.finder = finder

    def __getattr__(self, name):
        return getattr(self.finder, name)

    def find_spec(self, name, path=None, target=None):
        return None if name.partition(".")[0] in ABSENT else self.finder.find_spec(name, path, target)

sys.meta_path[:] = [WithoutAbsent(finder) for finder in sys.meta_path]
from dhkit.cli import main

for arguments in json.loads(sys.argv[1]):
    sys.argv = ["dhkit", *arguments]
    try:
        main()
        status = 0
    except SystemExit as exit:
        status = exit.code or 0
    print(f"<{{' '.join(arguments)}}: {{status}}>", file=sys.stderr)
"""

WORKS = [
    ["robots"],
    ["fk", "puma560", "0", "45", "-90", "0", "30", "0", "--degrees"],
    ["ik", "puma560", "--like", "nominal"],
    ["build", "ur5", "-o", "ur5.urdf"],
    ["extract", "ur5.urdf"],
    ["equations", "planar2r", "--what", "M,C,g", "-o", "equations.html"],
    [
        "plan",
        "puma560",
        "--from",
        "nominal",
        "--to",
        "ready",
        "--intervals",
        "12",
        "-o",
        "motion.npz",
    ],
    ["simulate", "puma560", "--controller", "pid", "--motion", "motion.npz", "-o", "run.npz"],
    ["grade", "answer.toml", "-o", "graded"],
    ["check", "puma560", "own.py"],
    ["demo", "--robot", "planar2r", "--quick"],
]
"""Commands that a core installation answers."""
ASKS = {
    "verify puma560": "pip install pin",
    "workspace planar2r --samples 100": "a figure needs matplotlib, which is not installed: pip install matplotlib",
    "picture puma560 -o p.png": "a picture needs trimesh, which is not installed: pip install trimesh",
    "lab puma560 --no-browser": "the viewer needs meshcat, which is not installed: pip install meshcat",
}
"""Commands that need more, and a part of the line that says so."""
ANSWER = """
format = 1
robot = "planar2r"
[answer]
g = ["(m1/2 + m2)*g*l1*c1 + m2*g*l2*c12/2", "m2*g*l2*c12/2"]
"""


def run(commands, folder):
    """Return what commands print on stderr, each ended by its arguments and exit status."""
    return subprocess.run(
        [sys.executable, "-c", RUN, json.dumps(commands)],
        cwd=folder,
        env=os.environ | {"PYTHONWARNINGS": "ignore"},
        capture_output=True,
        text=True,
        check=False,
    ).stderr


@pytest.mark.slow
def test_a_core_installation_answers_without_the_others(tmp_path):
    (tmp_path / "answer.toml").write_text(ANSWER)
    own = (ROOT / "docs/examples/puma_ik.py").read_text()
    (tmp_path / "own.py").write_text(own)
    said = run(WORKS, tmp_path)
    for arguments in WORKS:
        assert f"<{' '.join(arguments)}: 0>" in said, said
    assert "Traceback" not in said
    assert (tmp_path / "equations.html").exists()


def test_a_missing_package_is_named_with_its_command(tmp_path):
    said = run([command.split() for command in ASKS], tmp_path)
    for command, complaint in ASKS.items():
        before = said.partition(f"<{command}: 2>")
        assert before[1], said
        assert complaint in before[0]
    assert "Traceback" not in said


def test_core_requirements_are_those_of_the_package():
    text = (ROOT / "requirements-core.txt").read_text()
    core = {line for line in text.splitlines() if line and not line.startswith("#")}
    whole = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"])
    assert core <= whole
    left_out = {re.split("[><=;]", line)[0].strip() for line in whole - core}
    drawing = {"meshcat", "matplotlib", "trimesh", "manifold3d", "fast-simplification", "yourdfpy"}
    assert left_out == drawing | {"pin", "tornado", "msgpack", "u-msgpack-python"}
