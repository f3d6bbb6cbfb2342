"""Robot files: nothing is lost on the way in and out, and units do not matter."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from bad_robot_files import GOOD
from dhkit.description import (
    DHTable,
    Units,
    from_toml,
    library_robot,
    read_robot,
    robots,
    to_toml,
    write_robot,
)
from dhkit.errors import DescriptionError
from dhkit.expressions import PI, exact
from random_arms import arms

INCHES_AND_DEGREES = """
format = 1
name = "two"
convention = "standard"
units = { length = "in", angle = "deg" }
gravity = [0, 0, -9.81]

[[joint]]
name = "shoulder"
type = "revolute"
a = 17
alpha = 90
d = 2.5
theta = -45
limits = [-160, 160]
velocity = 90
effort = 40
body = { mass = 2, com = [-8.5, 0, 1], inertia = { xx = 0.1, yy = 0.2, zz = 0.2 } }
shape = { box = [1, 2, 3], xyz = [1, 0, 0], rpy = [0, 90, 0], color = "#aabbcc" }

[[joint]]
name = "slide"
type = "prismatic"
a = 0
alpha = 0
d = 1
theta = 180
limits = [0, 20]
velocity = 10

[tool]
xyz = [0, 0, 4]
rpy = [0, 0, 30]

[configurations]
ready = [90, 10]
"""

METRES_AND_RADIANS = """
format = 1
name = "two"
convention = "standard"

[[joint]]
name = "shoulder"
type = "revolute"
a = 0.4318
alpha = 1.5707963267948966
d = "2.5*inch"
theta = -0.7853981633974483
limits = ["-160*deg", "8*pi/9"]
velocity = 1.5707963267948966
effort = 40
body = { mass = 2.0, com = [-0.2159, 0, 0.0254], inertia = [[0.1, 0, 0], [0, 0.2, 0], [0, 0, 2e-1]] }
shape = { box = [0.0254, 0.0508, 0.0762], xyz = [0.0254, 0, 0], rpy = [0, "pi/2", 0], color = "#aabbcc" }

[[joint]]
name = "slide"
type = "prismatic"
a = 0
alpha = 0
d = 0.0254
theta = 3.141592653589793
limits = [0, "20*inch"]
velocity = 0.254

[tool]
xyz = [0, 0, 0.1016]
rpy = [0, 0, "30*deg"]

[configurations]
ready = ["90*deg", 0.254]
"""


@pytest.mark.parametrize("name", robots())
def test_a_library_robot_survives_writing_and_reading(name):
    arm = library_robot(name)
    text = to_toml(arm)
    again = from_toml(text, mesh_folder=arm.mesh_folder)
    assert again == arm
    assert again.units == arm.units
    assert hash(again) == hash(arm)
    assert to_toml(again) == text
    for joint, other in zip(arm.joints, again.joints, strict=True):
        assert (str(joint.a), str(joint.d), str(joint.theta)) == (
            str(other.a),
            str(other.d),
            str(other.theta),
        )


@given(arms())
def test_any_arm_survives_writing_and_reading_in_any_units(law, arm):
    law.samples(1000)
    for units in (Units(), Units("in", "deg"), Units("mm", "rad"), Units("cm", "deg")):
        changed = replace(arm, units=units)
        again = from_toml(to_toml(changed))
        law.holds("changed by writing and reading", again != arm or again.units != units, 0)


@pytest.mark.parametrize(
    ("written", "factors", "again"),
    [
        ("", (1, 1, 1), '{mesh = "a.stl"}'),
        (", scale = 1", (1, 1, 1), '{mesh = "a.stl"}'),
        (", scale = 0.001", (0.001, 0.001, 0.001), "scale = 0.001}"),
        (', scale = "mm"', (0.001, 0.001, 0.001), 'scale = "mm"}'),
        (", scale = [1, -1, 1]", (1, -1, 1), "scale = [1, -1, 1]}"),
        (', scale = [0.5, "2*mm", -3]', (0.5, 0.002, -3), 'scale = [0.5, "2*mm", -3]}'),
    ],
)
def test_a_mesh_has_one_factor_or_three(written, factors, again):
    arm = from_toml(GOOD + f'shape = {{ mesh = "a.stl"{written} }}\n')
    assert [float(factor) for factor in arm.joints[0].shapes[0].geometry.scale] == list(factors)
    assert again in to_toml(arm)
    assert from_toml(to_toml(arm)) == arm


def test_units_do_not_matter():
    inches, metres = from_toml(INCHES_AND_DEGREES), from_toml(METRES_AND_RADIANS)
    assert inches == metres
    assert inches.units != metres.units
    assert inches.joints[0].a == exact(0.4318)
    assert float(inches.joints[0].a) == 0.4318
    assert inches.joints[0].alpha == PI / 2
    assert inches.numbers.cos_alpha[0] == 0.0
    assert np.array_equal(inches.numbers.lower, metres.numbers.lower)


def test_numbers_stay_as_they_were_written():
    text = to_toml(from_toml(INCHES_AND_DEGREES))
    for line in (
        "a = 17\n",
        "alpha = 90\n",
        "d = 2.5\n",
        "limits = [-160, 160]\n",
        "com = [-8.5, 0, 1]",
    ):
        assert line in text
    assert "0.67183" in to_toml(library_robot("puma560"))
    assert 'a = "l1"' in to_toml(library_robot("planar2r"))
    assert 'alpha = "-pi/2"' in to_toml(library_robot("panda"))


def test_a_file_is_written_whole(tmp_path):
    path = tmp_path / "arm.toml"
    arm = from_toml(INCHES_AND_DEGREES)
    write_robot(arm, path)
    assert read_robot(path) == arm
    assert [file.name for file in tmp_path.iterdir()] == ["arm.toml"]


def test_decimals_are_not_rounded_to_doubles():
    text = INCHES_AND_DEGREES.replace("d = 2.5", "d = 0.1000000000000000000000000000001")
    arm = from_toml(text)
    assert (
        arm.joints[0].d != from_toml(INCHES_AND_DEGREES.replace("d = 2.5", "d = 0.1")).joints[0].d
    )
    assert from_toml(to_toml(arm)) == arm


def test_the_table_prints_as_people_expect():
    table = DHTable.of(from_toml(INCHES_AND_DEGREES))
    assert "q1 - 45°" in str(table)
    assert "17" in str(table)
    assert "d [in]" in str(table)
    assert "q2 + 1" in str(table)
    assert "<table>" in table._repr_html_()
    assert r"\begin{tabular}" in table.latex()
    assert "l1" in str(DHTable.of(library_robot("planar2r")))


@pytest.mark.parametrize(
    ("line", "value"),
    [
        ("theta = q1", "q1"),
        ("a = 17*inch", "17*inch"),
        ("limits = [-1, pi/2]", "pi/2"),
        ("name = puma # x", "puma"),
    ],
)
def test_expressions_without_quotes_get_a_hint(line, value):
    with pytest.raises(
        DescriptionError, match=r"not TOML: .*; names and expressions are in quotes: "
    ) as caught:
        from_toml(f"format = 1\n{line}\n")
    assert str(caught.value).endswith(f'"{value}"')


def test_a_file_may_write_the_joint_variable():
    text = to_toml(library_robot("planar2r"))
    written = iter(("q1", "q2"))
    lines = [
        f'theta = "{next(written)}"' if line.startswith("theta") else line
        for line in text.split("\n")
    ]
    assert from_toml("\n".join(lines)) == library_robot("planar2r")
