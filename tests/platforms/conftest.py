"""A task, and right and wrong answers to it."""

from pathlib import Path

import pytest

TASK = """\
robot = "planar2r"
[task]
asked = ["M", "g"]
[rubric]
points = 20
feedback = "hint"
[rubric.weights]
M = 4
g = 2
"""
M = (
    "[[m1*l1**2/3 + m2*(l1**2 + l2**2/3 + l1*l2*cos(q2)), m2*l2*(l2/3 + l1*cos(q2)/2)],"
    " [m2*l2*(l2/3 + l1*cos(q2)/2), m2*l2**2/3]]"
)
RIGHT_G = "[9.81*(m1/2 + m2)*l1*cos(q1) + m2*9.81*l2*cos(q1 + q2)/2, m2*9.81*l2*cos(q1 + q2)/2]"
WRONG_G = RIGHT_G.replace("m2*9.81*l2*cos(q1 + q2)/2]", "m2*9.81*l2*cos(q2)/2]")
PROGRAM = f"M = {M}\ng = {WRONG_G}\n"
"""One of six entries is wrong: half of the points of g, 3.33 of 20."""


@pytest.fixture
def task(tmp_path: Path) -> Path:
    """Return a task's file."""
    path = tmp_path / "dynamics.toml"
    path.write_text(TASK)
    return path
