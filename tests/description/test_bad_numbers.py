"""Robot files with numbers that no robot has, and with names that no file has: one line each, and soon."""

from __future__ import annotations

import os
import time

import pytest

from dhkit import Arm
from dhkit.errors import DescriptionError

HEAD = 'format = 1\nname = "t"\nconvention = "standard"\n'


def row(extra: str = "", **entries: str) -> str:
    own = {"a": "0.1", "alpha": "0", "d": "0", "theta": "0"} | entries
    return (
        '[[joint]]\ntype = "revolute"\n'
        + "".join(f"{key} = {value}\n" for key, value in own.items())
        + extra
    )


BODY = "body = {{ mass = {}, com = [{}, 0, 0], inertia = {{ xx = {}, yy = 1, zz = 1 }} }}\n"
CYCLE = "[parameters]\n" + "".join(f'p{i} = "p{(i + 1) % 150}"\n' for i in range(150))
REFUSED = {
    "theta": (row(theta="1e308"), "theta: 1e+308 in SI units; expected at most 1e+12"),
    "alpha": (row(alpha="1e308"), "alpha: 1e+308"),
    "a": (row(a="1e308"), "a: 1e+308"),
    "d": (row(d="-1e308"), "d: -1e+308"),
    "mass": (row(BODY.format("1e308", 0, 1)), "body.mass: 1e+308"),
    "com": (row(BODY.format(1, "1e308", 1)), "body.com[0]: 1e+308"),
    "inertia": (row(BODY.format(1, 0, "1e308")), "body.inertia: 1e+308"),
    "gear": (row("drive = { gear = 1e308, rotor_inertia = 1e308 }\n"), "drive.gear: 1e+308"),
    "limits": (row("limits = [-1e308, 1e308]\n"), "limits[0]: -1e+308"),
    "a reciprocal of zero to rounding": (
        row(a='"1/(sin(1)^2 + cos(1)^2 - 1)"'),
        "divides by zero, to rounding",
    ),
    "a share of it": (row(a='"1e-9/(sin(1)^2 + cos(1)^2 - 1)"'), "divides by zero, to rounding"),
    "a tower of powers": (row(a='"((1 + pi)^8)^8^2"'), "multiplies out to too many terms"),
    "roots and pi, raised": (row(a='"(((1/3 + pi)^9)^9)^9"'), "multiplies out to too many terms"),
    "beyond doubles": (
        row(a='"(pi^9)^9*(pi^9)^9*(pi^9)^9*(pi^9)^9*(pi^9)^9*(pi^9)^9*(pi^9)^9*(pi^9)^9"'),
        "a: ",
    ),
    "a cycle": (CYCLE + row(a='"p0"'), "p0 -> p1 -> p2 -> ... -> p149 -> p0 is a cycle"),
    "a long mesh name": (
        row(f'shape = {{ mesh = "{"x" * 5000}.stl" }}\n'),
        "expected a relative path",
    ),
    "a long component": (
        row(f'shape = {{ mesh = "{"x" * 400}.stl" }}\n'),
        "expected a relative path",
    ),
    "a loop of links": (
        row('shape = { mesh = "loop.stl" }\n'),
        "'loop.stl', which cannot be found",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_each_is_refused_in_one_line(name, tmp_path):
    text, message = REFUSED[name]
    (tmp_path / "loop.stl").symlink_to("loop.stl")
    (tmp_path / "robot.toml").write_text(HEAD + text)
    begin = time.process_time()
    with pytest.raises(DescriptionError) as caught:
        Arm.load(tmp_path / "robot.toml")
    assert time.process_time() - begin < 5
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_a_mesh_that_is_a_pipe_is_a_warning(tmp_path):
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "robot.toml").write_text(HEAD + row('shape = { mesh = "pipe.stl" }\n'))
    arm = Arm.load(tmp_path / "robot.toml")
    assert "not a regular file" in arm.description.warnings[0]
    assert arm.urdf()


@pytest.mark.parametrize(
    ("text", "value"), [("1/1e-9", 1e9), ("1/(1 - cos(1e-3))", 1 / 4.999999583e-7)]
)
def test_small_divisors_are_divisors(text, value, tmp_path):
    (tmp_path / "robot.toml").write_text(HEAD + row(a=f'"{text}"'))
    assert float(Arm.load(tmp_path / "robot.toml").description.numbers.a[0]) == pytest.approx(
        value, rel=1e-9
    )
