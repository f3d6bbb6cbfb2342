"""Samples from elsewhere: columns by names, ROS messages as its tools print them, and what is wrong by its line."""

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory

ARM, COBRA = library_robot("planar2r"), library_robot("cobra600")


def read(tmp_path, text, arm=ARM, suffix=".csv", **options):
    path = tmp_path / f"samples{suffix}"
    path.write_text(text)
    return Trajectory.read(path, arm, **options)


@pytest.mark.parametrize(
    "header",
    [
        "t,q1,q2",
        "time,shoulder,elbow",
        "elbow,TIME,load,shoulder",
        "# log\n\nq2,t,note,q1",
        '"t","q_1","q_2"',
    ],
)
def test_columns_are_found_by_name(header, tmp_path):
    names = [name.strip('"').lower() for name in header.splitlines()[-1].split(",")]
    column = {"t": 0, "time": 0, "q1": 1, "shoulder": 1, "q_1": 1, "q2": 2, "elbow": 2, "q_2": 2}
    times = np.array([5.0, 5.5, 6.0, 7.0])
    values = np.stack([times, np.sin(times), times**2, times], axis=1)
    rows = [",".join(repr(float(row[column.get(name, 3)])) for name in names) for row in values]
    motion = read(tmp_path, "\n".join([header, *rows]))
    expected = Trajectory.from_samples(ARM, times, values[:, 1:3])
    assert motion == expected
    assert motion.duration == 2


@pytest.mark.parametrize("prefixes", [("qd", "qdd"), ("dq", "ddq"), ("vel", "acc")])
def test_rates_and_accelerations_are_used_where_they_are(prefixes, tmp_path):
    q, qd, qdd = np.random.default_rng(0).uniform(-1, 1, (3, 3, 2)).round(3)
    first, second = prefixes
    header = f"t,q1,q2,{first}1,{first}2,{second}1,{second}2"
    rows = [",".join(map(str, [k, *q[k], *qd[k], *qdd[k]])) for k in range(3)]
    assert read(tmp_path, "\n".join([header, *rows])) == Trajectory.from_samples(
        ARM, [0, 1, 2], q, qd, qdd
    )
    rows = [",".join(map(str, [k, *q[k], *qd[k]])) for k in range(3)]
    assert read(
        tmp_path, "\n".join([header[: header.index(second) - 1], *rows])
    ) == Trajectory.from_samples(ARM, [0, 1, 2], q, qd)


def test_columns_are_mapped(tmp_path):
    text = "Time (s),axis A,axis B,q1\n0,10,20,7\n1,30,40,7\n"
    motion = read(tmp_path, text, columns={"t": "Time (s)", "shoulder": "axis A", "q2": "AXIS B"})
    assert motion == Trajectory.from_samples(ARM, [0, 1], [[10, 20], [30, 40]])
    exchanged = read(tmp_path, "t,q1,q2\n0,20,10\n1,40,30\n", columns={"q1": "q2", "q2": "q1"})
    assert exchanged == motion
    with pytest.raises(DescriptionError, match=r"no column 'axis C': found Time \(s\), axis A"):
        read(tmp_path, text, columns={"t": "Time (s)", "q1": "axis A", "q2": "axis C"})
    with pytest.raises(
        ValueError, match=r"columns: found 'q'; expected each at most once of t, q1 ... q2"
    ):
        read(tmp_path, text, columns={"q": "axis A"})
    with pytest.raises(ValueError, match=r"columns is given; expected none for .yaml"):
        read(tmp_path, "", suffix=".yaml", columns={"q1": "axis A"})


def test_degrees_are_those_of_angles_alone(tmp_path):
    motion = read(tmp_path, "t,q1,q2,q3,q4\n0,90,0,0.1,0\n1,180,0,0.2,0\n", COBRA, degrees=True)
    assert motion.q(0.0) == pytest.approx([np.pi / 2, 0, 0.1, 0])


ROS2 = """header:
  stamp:
    sec: 0
    nanosec: 0
  frame_id: ''
joint_names:
- elbow
- shoulder
points:
- positions:
  - 0.5
  - -1.0e-01
  velocities: []
  accelerations: []
  effort: []
  time_from_start:
    sec: 0
    nanosec: 0
- positions:
  - 1.0
  - 0.25
  velocities: []
  accelerations: []
  effort: []
  time_from_start:
    sec: 1
    nanosec: 500000000
---
"""
ROS1 = """header:
  seq: 1
  stamp:
    secs: 0
    nsecs: 0
  frame_id: ''
joint_names: [elbow, shoulder]
points:
  -
    positions: [0.5, -0.1]
    velocities: []
    accelerations: []
    effort: []
    time_from_start:
      secs: 0
      nsecs:         0
  -
    positions: [1.0, 0.25]
    velocities: []
    accelerations: []
    effort: []
    time_from_start:
      secs: 1
      nsecs: 500000000
---
"""


@pytest.mark.parametrize("text", [ROS2, ROS1, "---\n" + ROS2, ROS1.replace("elbow", "'elbow'")])
def test_messages_are_read_as_ros_prints_them(text, tmp_path):
    motion = read(tmp_path, text, suffix=".yaml")
    assert motion == Trajectory.from_samples(ARM, [0, 1.5], [[-0.1, 0.5], [0.25, 1.0]])


def test_velocities_of_a_message_are_used(tmp_path):
    text = ROS1.replace("velocities: []", "velocities: [0.3, 0.2]  # rad/s")
    expected = Trajectory.from_samples(ARM, [0, 1.5], [[-0.1, 0.5], [0.25, 1.0]], [[0.2, 0.3]] * 2)
    assert read(tmp_path, text, suffix=".yml") == expected


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", r"no samples in it"),
        ("t,q1,q2\n", r"no samples in it"),
        ("t,q1,q2\n0,1\n", r"line 2: 2 values; expected 3, as in the header"),
        ("t,q1,q2\n0,1,x\n", r"line 2: q2 is 'x'; expected a number"),
        ("# a\nt,q1,q2\n0,1,2\n1,nan,2\n", r"line 4: q1 is nan; expected a finite number"),
        ("t,q1,q1\n0,1,2\n", r"line 1: a column's name stands there twice"),
        ("q1,q2\n0,1\n", r"no column of times: found q1, q2; expected t or time"),
        ("t,q1,q3\n0,1,2\n", r"no column q2 or elbow: found t, q1, q3"),
        ("t,q1,q2,qd1\n0,1,2,3\n", r"no column qd2 or elbow_velocity: found"),
        ("t,q1,q2\n0,1,2\n", r"times has shape \(1,\); expected"),
        ("t,q1,q2\n1,1,2\n0,1,2\n", r"times do not increase: times\[0\] is 1 s, times\[1\] is 0 s"),
        ("t,q1,q2\n" + "0,1,2," * 900, r"line 2: 1001 values|line 2: .* values"),
    ],
)
def test_what_is_wrong_with_a_table_is_named(text, complaint, tmp_path):
    with pytest.raises(DescriptionError, match=complaint) as error:
        read(tmp_path, text)
    assert str(error.value).startswith(str(tmp_path))


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        (
            "- elbow\n",
            "- wrist\n",
            r"joint_names: found wrist, shoulder; expected shoulder, elbow, in any order",
        ),
        ("- elbow\n", "", r"joint_names: found shoulder; expected"),
        ("  - 0.5\n", "", r"points\[0\].positions: found 1 values; expected 2"),
        ("  - 0.5\n", "  - fast\n", r"points\[0\].positions: found .*; expected numbers"),
        ("  - 0.5\n", "  - .nan\n", r"points\[0\].positions: found .*; expected numbers"),
        ("  - 0.5\n", "  - nan\n", r"points\[0\].positions: found .*; expected finite numbers"),
        (
            "    sec: 1\n",
            "    sec: -1\n",
            r"points\[1\].time_from_start: found '-1'; expected a whole number",
        ),
        ("    sec: 1\n", "", r"points\[1\].time_from_start: expected sec and nanosec"),
        (
            "    sec: 1\n    nanosec: 500000000\n",
            "    sec: 0\n    nanosec: 0\n",
            r"times do not increase",
        ),
        (
            "  velocities: []\n",
            "  velocities: [1, 2]\n",
            r"points\[1\]: expected positions, and velocities .* as in",
        ),
        ("points:", "pionts:", r"unknown key 'pionts'; expected header, joint_names, points"),
        (
            "    sec: 0\n",
            "    sec: &a 0\n",
            r"line 3: found 'sec: &a 0'; expected a number or a name",
        ),
        ("    sec: 0\n", "   sec: 0\n", r"line 4: found 'nanosec: 0'; expected"),
        ("    sec: 0\n", "\tsec: 0\n", r"line 3: .*expected"),
        (
            "  frame_id: ''",
            "  frame_id: '",
            r"line 5: .*expected YAML \(while scanning a quoted scalar",
        ),
        ("  frame_id: ''", "  stamp: 1", r"line 5: found 'stamp: 1'; expected 'stamp' once"),
        ("---\n", "---\nheader: 1\n", r"expected one message, not several"),
        ("- elbow\n", "- " * 40 + "elbow\n", r"line 7: .*expected"),
        ("header:\n", "".join(f"{' ' * k}a:\n" for k in range(20)), r"line \d+: .*expected"),
        ("points:", "points: [[1]]", r"line 10: found '- positions:'; expected YAML"),
    ],
)
def test_what_is_wrong_with_a_message_is_named(old, new, complaint, tmp_path):
    assert old in ROS2
    with pytest.raises(DescriptionError, match=complaint) as error:
        read(tmp_path, ROS2.replace(old, new, 1), suffix=".yaml")
    assert "\n" not in str(error.value)


def test_archives_are_not_read_as_samples(tmp_path):
    with pytest.raises(
        DescriptionError, match=r"found suffix '.npz'; expected one of .csv, .yaml, .yml, .mat"
    ):
        Trajectory.read(tmp_path / "x.npz", ARM)


def test_a_file_of_ours_is_one_of_its_robot(tmp_path):
    puma, ur5 = library_robot("puma560"), library_robot("ur5")
    path = Trajectory.from_samples(puma, [0, 1], [[0.0] * 6, [0.1] * 6]).save(
        tmp_path / "puma.csv", rate=10
    )
    assert Trajectory.read(path, puma).n == 6
    with pytest.raises(
        DescriptionError,
        match=r"trajectory was made for the robot puma560 .*; expected one for ur5",
    ):
        Trajectory.read(path, ur5)
