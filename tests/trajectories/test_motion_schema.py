"""The schema of motion files: what is written and read fits, and what does not fit is not read."""

import copy
import json
import textwrap

import jsonschema
import numpy as np
import pytest

from dhkit.cli import main
from dhkit.description import library_robot
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory
from dhkit.trajectories.schema import motion_schema
from trajectories.test_read import ROS1, ROS2

yaml = pytest.importorskip("yaml")
ARM = library_robot("planar2r")
SCHEMA = jsonschema.Draft202012Validator(motion_schema())
WHOLE = """header:
  frame_id: world
joint_names: [shoulder, elbow]
points:
- positions: [0.0, 0.5]
  velocities: [0.0, 1]
  accelerations: [0, -1.5]
  effort: []
  time_from_start:
    sec: 0
    nanosec: 0
- positions: [1.0, 0.25]
  velocities: [2.0, 0]
  accelerations: [0.0, 0]
  effort: []
  time_from_start:
    sec: 1
    nanosec: 500000000
"""
"""A file with every key."""


def fits(text):
    return SCHEMA.is_valid(yaml.safe_load(text))


@pytest.fixture
def is_read(tmp_path):
    def is_read(text):
        path = tmp_path / "motion.yaml"
        path.write_text(text)
        try:
            Trajectory.read(path, ARM)
        except DescriptionError:
            return False
        return True

    return is_read


def test_the_schema_is_one_and_tells_what_every_key_means():
    jsonschema.Draft202012Validator.check_schema(SCHEMA.schema)
    assert json.loads(json.dumps(SCHEMA.schema)) == SCHEMA.schema
    point = SCHEMA.schema["properties"]["points"]["items"]
    for table in (SCHEMA.schema, point, point["properties"]["time_from_start"]):
        assert all(key["description"] for key in (table, *table["properties"].values()))


@pytest.mark.parametrize("name", ["planar2r", "puma560", "stanford"])
def test_what_is_written_fits(name, tmp_path):
    """Numbers as small as 1e-300, and a prismatic joint among the Stanford arm's."""
    arm = library_robot(name)
    motion = Trajectory(arm, [0, 0.1], np.outer([0.1, 1e-300, -3.0, 1e-9], np.ones(arm.n))[None])
    for rate in (None, 3.0):
        SCHEMA.validate(
            yaml.safe_load(motion.save(tmp_path / "motion.yaml", rate=rate).read_text())
        )


def test_what_the_command_plans_fits(tmp_path, capsys):
    path = tmp_path / "planned.yaml"
    with pytest.raises(SystemExit) as exit:
        main(["plan", "planar2r", "--to", "1", "1", "--intervals", "6", "-o", str(path)])
    assert exit.value.code == 0, capsys.readouterr()
    SCHEMA.validate(yaml.safe_load(path.read_text()))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("", ""),
        ("header:\n  frame_id: world\n", ""),
        ("[shoulder, elbow]", "['elbow', shoulder]"),
        ("[0.0, 0.5]", "['0.0', \"+.5\"]"),
        ("[0.0, 0.5]", "[1e-05, -1E+3]"),  # text by YAML 1.1
        ("sec: 1\n", "sec: '1'\n"),
        ("sec: 0\n    nanosec: 0", "secs: 0\n    nsecs: 0"),
        ("  effort: []\n", ""),
        ("  effort: []\n", "  effort: [1.5, 2]\n"),
    ],
)
def test_a_right_file_fits_and_is_read(old, new, is_read):
    text = WHOLE.replace(old, new)
    SCHEMA.validate(yaml.safe_load(text))
    assert is_read(text)


@pytest.mark.parametrize("rows", [("velocities", "accelerations"), ("accelerations",)])
@pytest.mark.parametrize("left_out", [None, "", "''", "[]"])
def test_rows_may_be_left_out(rows, left_out, is_read):
    lines = WHOLE.splitlines()
    for row in rows:
        empty = [] if left_out is None else [f"  {row}: {left_out}"]
        lines = [
            new for line in lines for new in (empty if line.startswith(f"  {row}") else [line])
        ]
    text = "\n".join(lines)
    SCHEMA.validate(yaml.safe_load(text))
    assert is_read(text)


@pytest.mark.parametrize("text", [ROS1, ROS2])
def test_what_ros_prints_fits(text):
    SCHEMA.validate(next(yaml.safe_load_all(text)))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("joint_names:", "joint_name:"),
        ("points:", "point:"),
        ("positions:", "position:"),
        ("time_from_start:", "time:"),
        ("    sec: 1", "    second: 1"),
        ("    nanosec: 0\n", ""),
        ("    sec: 1", "    secs: 1"),
        ("    sec: 1", "    sec: -1"),
        ("    sec: 1", "    sec: 1.5"),
        ("    sec: 1", "    sec: true"),
        ("    sec: 1", "    sec: one"),
        ("    sec: 1", f"    sec: {10**20}"),
        ("    sec: 1", f"    sec: '{10**20}'"),
        ("[shoulder, elbow]", "shoulder"),
        ("[shoulder, elbow]", "[]"),
        ("[shoulder, elbow]", "[shoulder, shoulder]"),
        ("[0.0, 0.5]", "0.5"),
        ("[0.0, 0.5]", "[]"),
        ("[0.0, 0.5]", "[0.0, half]"),
        ("[0.0, 0.5]", "[0.0, true]"),
        ("[0.0, 0.5]", "[0.0, nan]"),
        ("[0.0, 1]", "fast"),
        ("[0.0, 1]", "[fast, 1]"),
        ("  velocities: [0.0, 1]\n", ""),
        ("[0.0, 1]", "[]"),
        (WHOLE[WHOLE.index("points:") :], "points: []\n"),
        (WHOLE[WHOLE.index("- positions: [1.0") :], ""),
        (WHOLE, "trajectory:\n" + textwrap.indent(WHOLE, "  ")),
    ],
)
def test_a_wrong_file_neither_fits_nor_is_read(old, new, is_read):
    text = WHOLE.replace(old, new, 1)
    assert text != WHOLE
    assert not fits(text)
    assert not is_read(text)


@pytest.mark.parametrize("key", ["header", "velocities", "accelerations", "effort"])
def test_a_misspelt_key_that_may_be_missing_does_not_fit(key):
    """The reader passes it over: only the schema tells."""
    assert not fits(WHOLE.replace(f"{key}:", f"{key}s:"))


def places(document, above=()):
    """Yield the paths of all keys and entries."""
    for key, value in document.items() if isinstance(document, dict) else enumerate(document):
        yield (*above, key)
        if isinstance(value, dict | list):
            yield from places(value, (*above, key))


@pytest.mark.slow
def test_the_schema_raises_no_false_alarm(is_read):
    """A value of another type, at whichever place, or none: what does not fit is not read either."""
    document = yaml.safe_load(WHOLE)
    for path in places(document):
        for value in (None, True, -1, 0.5, "text", "", [], [1.5], {"a": 1}):
            changed = copy.deepcopy(document)
            table = changed
            for key in path[:-1]:
                table = table[key]
            if value is None:
                del table[path[-1]]
            else:
                table[path[-1]] = value
            text = yaml.safe_dump(changed, default_flow_style=False)
            assert fits(text) or not is_read(text), (path, value)
