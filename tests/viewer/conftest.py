"""A small arm in colors that nothing else on the page has."""

import pytest

from dhkit.description.robot_file import from_toml

ARM = """
format = 1
name = "signal"
convention = "standard"
base = { shape = { cylinder = { radius = 0.08, length = 0.1 }, xyz = [0, 0, 0.05], color = "#00c0c0" } }

[[joint]]
name = "turn"
type = "revolute"
a = 0
alpha = "pi/2"
d = 0.3
theta = 0
shape = { cylinder = { radius = 0.05, length = 0.3 }, xyz = [0, -0.15, 0], rpy = ["pi/2", 0, 0], color = "#c000c0" }

[[joint]]
name = "reach"
type = "revolute"
a = 0.4
alpha = 0
d = 0
theta = 0
shape = { sphere = { radius = 0.06 }, color = "#00d000" }
"""


@pytest.fixture(scope="session")
def signal_arm():
    """An arm with a magenta column and, around its tool, a green ball."""
    return from_toml(ARM, file="signal.toml")
