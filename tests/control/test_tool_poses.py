"""References in the tool's space: poses held, and poses reached at times."""

import numpy as np
import pytest

from dhkit import Arm, PlanningError, ToolPoses, UnreachableError
from dhkit.control import ComputedTorque
from dhkit.control.references import reference_of

PUMA = Arm.load("puma560")
NOMINAL = PUMA.configurations["nominal"]
T = PUMA.fk(NOMINAL)
FAR = T.copy()
FAR[0, 3] = 3.0
PANDA = Arm.load("panda")
ON_THE_LINE = 2e-7
"""m and rad: what joint_path promises of a line, and a rounding."""


def test_a_pose_is_held_by_the_nearest_joint_values():
    for near in PUMA.ik(T).q:
        if np.isnan(near).any() or np.any(PUMA.description.numbers.lower > near):
            continue
        held = reference_of(PUMA.description, T, near)
        assert np.abs(PUMA.fk(held.q) - T).max() < 1e-12
    assert np.abs(reference_of(PUMA.description, T, NOMINAL + 0.1).q - NOMINAL).max() < 1e-12
    assert np.abs(PUMA.fk(reference_of(PUMA.description, T).q) - T).max() < 1e-12


def test_an_arm_without_a_closed_form_holds_a_pose():
    q = PANDA.configurations["ready"]
    held = reference_of(PANDA.description, PANDA.fk(q), q + 0.05)
    assert np.abs(PANDA.fk(held.q) - PANDA.fk(q)).max() < 1e-11
    assert np.abs(held.q - q).max() < 0.1


def test_a_run_holds_a_pose():
    run = PUMA.simulate(ComputedTorque.tuned(PUMA), T, 0.02)
    assert np.abs(PUMA.fk(run.q[-1]) - T).max() < 1e-9


def test_poses_are_reached_on_straight_lines(law):
    law.samples(1)
    offsets = np.array([[0.0, 0.0, 0.0], [0.1, 0.1, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, -0.1]])
    times = np.array([0.5, 1.5, 2.0, 3.0])
    reference = ToolPoses(PUMA, T[:3, 3] + offsets, times, q0=NOMINAL)
    assert reference.duration == 3.0
    t = np.linspace(0.0, 4.0, 4001)
    q, qd, qdd = reference.sampled(t)
    poses = PUMA.fk(q)
    for time, offset in zip(times, offsets, strict=True):
        at = round(time * 1000)
        law.holds("m, at a pose", np.abs(poses[at, :3, 3] - T[:3, 3] - offset).max(), ON_THE_LINE)
        assert np.abs(qd[at]).max() < 1e-9
    law.holds("rad, orientation kept", np.abs(poses[:, :3, :3] - T[:3, :3]).max(), ON_THE_LINE)
    way = poses[500:1501, :3, 3] - poses[500, :3, 3]
    across = way - np.outer(way @ [1, 1, 0], [0.5, 0.5, 0])
    law.holds("m, off the line", np.abs(across).max(), ON_THE_LINE)
    # Joint values, rates and accelerations belong together.
    law.holds(
        "rad/s, rates against differences", np.abs(np.gradient(q, t, axis=0) - qd)[1:-1].max(), 2e-5
    )
    law.holds(
        "rad/s^2, accelerations against differences",
        np.abs(np.gradient(qd, t, axis=0) - qdd)[1:-1].max(),
        2e-2,
    )
    assert np.all(q[t < 0.5] == q[0]) and np.all(qd[t < 0.5] == 0)
    assert np.all(q[t >= 3.0] == q[-1]) and np.all(qdd[t >= 3.0] == 0)
    assert set(times) <= set(reference.jumps)


def test_a_planar_and_a_redundant_arm_follow_poses():
    planar = Arm.load("planar2r")
    reference = ToolPoses(planar, [[0.6, 0.3, 0.0], [0.3, 0.6, 0.0]], [0.0, 1.0], q0=[0.1, 0.9])
    assert np.allclose(
        planar.fk(reference.sampled(np.array([1.0]))[0][0])[:2, 3], [0.3, 0.6], atol=ON_THE_LINE
    )
    q = PANDA.configurations["ready"]
    goal = PANDA.fk(q)
    goal[:3, 3] += [0.0, 0.1, 0.05]
    reference = ToolPoses(PANDA, [PANDA.fk(q), goal], [0.0, 1.0], q0=q)
    assert np.abs(PANDA.fk(reference.sampled(np.array([2.0]))[0][0]) - goal).max() < ON_THE_LINE


BAD = {
    "a pose out of reach": (
        lambda: reference_of(PUMA.description, FAR, NOMINAL),
        "reference: puma560 cannot hold it",
    ),
    "one that an iteration does not reach": (
        lambda: reference_of(PANDA.description, FAR),
        "panda cannot hold it",
    ),
    "no pose": (lambda: reference_of(PUMA.description, np.ones((4, 4))), "reference is not a pose"),
    "a pose of NaN": (
        lambda: reference_of(PUMA.description, T * np.nan),
        "reference has values that are not finite",
    ),
    "another matrix": (
        lambda: reference_of(PUMA.description, np.eye(3)),
        r"reference has shape \(3, 3\); expected",
    ),
    "q0 of another arm": (
        lambda: reference_of(PUMA.description, T, np.zeros(7)),
        r"q0 has shape \(7,\)",
    ),
    "a first pose out of reach": (
        lambda: ToolPoses(PUMA, [FAR, T], [0, 1]),
        "pose 0: puma560 cannot hold it",
    ),
    "a line out of reach": (
        lambda: ToolPoses(PUMA, [T, FAR], [0, 1]),
        "from pose 0 to pose 1: the path leaves",
    ),
    "positions without orientation": (
        lambda: ToolPoses(PUMA, [[0.5, 0, 0]], [0]),
        "q0 is not given",
    ),
    "times that stand still": (
        lambda: ToolPoses(PUMA, [T, T], [1, 1]),
        r"times is \[1.0, 1.0\]; expected seconds",
    ),
    "times before 0": (
        lambda: ToolPoses(PUMA, [T, T], [-1, 0]),
        "expected seconds that ascend, from 0 on",
    ),
    "times that are fewer": (
        lambda: ToolPoses(PUMA, [T, T], [0]),
        r"times has shape \(1,\); expected \(2,\)",
    ),
    "poses of five numbers": (
        lambda: ToolPoses(PUMA, np.ones((2, 5)), [0, 1]),
        r"poses has shape \(2, 5\)",
    ),
    "no pose at all": (lambda: ToolPoses(PUMA, np.zeros((0, 3)), []), r"poses has shape \(0, 3\)"),
    "poses of NaN": (
        lambda: ToolPoses(PUMA, [T * np.nan], [0]),
        "poses has values that are not finite",
    ),
    "poses that are words": (
        lambda: ToolPoses(PUMA, "here", [0]),
        "poses: found 'here'; expected numbers",
    ),
    "no arm": (lambda: ToolPoses("puma560", [T], [0]), "found str; expected an arm"),
}


@pytest.mark.parametrize("name", BAD)
def test_it_is_refused_in_one_line(name):
    call, message = BAD[name]
    with pytest.raises(
        (ValueError, TypeError, UnreachableError, PlanningError), match=message
    ) as caught:
        call()
    assert "\n" not in str(caught.value)
