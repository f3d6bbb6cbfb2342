"""A path of poses is followed on one branch, through whole turns, and what stands in the way is reported."""

import numpy as np
import pytest

from arms_without_closed_form import SEVEN
from dhkit import Arm, pose
from dhkit.description import from_dh, library_robot
from dhkit.errors import ModelError, UnreachableError
from dhkit.kinematics import follow_path, forward_kinematics, path as paths, singular_configurations


def line(T, to, count=200):
    """Return poses along a straight line, the rotation kept."""
    poses = np.repeat(np.asarray(T)[None], count, axis=0)
    poses[:, :3, 3] += np.linspace(0, 1, count)[:, None] * to
    return poses


def smooth(q):
    return np.abs(np.diff(q, axis=0)).max() < 0.2


def test_a_line_is_followed_on_one_branch():
    arm = Arm.load("puma560")
    q0 = arm.configurations["nominal"]
    T = line(arm.fk(q0), [0, 0.5, -0.2])
    path = arm.ik_path(T, q0)
    assert path.ok
    assert set(path.branch) == {"right up no-flip"}
    assert np.abs(path.q[0] - q0).max() < 1e-9
    assert smooth(path.q)
    assert np.abs(arm.fk(path.require()) - T).max() < 1e-12


def test_other_branches_are_followed_from_other_starts():
    arm = Arm.load("puma560")
    solutions = arm.ik(arm.fk(arm.configurations["nominal"]))
    T = line(arm.fk(arm.configurations["nominal"]), [0, 0.2, 0.1])
    for name in ("right up flip", "left down flip", "left down no-flip"):
        path = arm.ik_path(T, solutions.branch(name), limits=False)
        assert path.ok
        assert set(path.branch) == {name}


def test_joints_go_on_through_whole_turns():
    arm = Arm.load("ur5")
    q0 = np.array([0.0, -1.2, 1.5, -0.8, 1.0, 0.4])
    turns = np.linspace(0, 3 * 2 * np.pi, 600)
    q = np.repeat(q0[None], len(turns), axis=0)
    q[:, 0], q[:, 5] = q0[0] + turns, q0[5] - turns
    path = arm.ik_path(arm.fk(q), q0, limits=False)
    assert path.ok
    assert np.abs(path.q - q).max() < 1e-9


def test_the_wrist_keeps_its_angle_through_a_straight_wrist():
    arm = Arm.load("irb140")
    q = np.repeat([[0.2, 0.3, 0.1, 0.7, 0.0, -0.4]], 101, axis=0)
    q[:, 4] = np.linspace(-0.5, 0.5, 101)
    q[50, 4] = 0.0
    path = arm.ik_path(arm.fk(q), q[0], limits=False)
    assert path.ok
    assert np.abs(path.q - q).max() < 1e-6
    assert 50 in path.near_singular
    assert len(set(path.branch[:50])) == 1
    assert path.branch[0].replace(" flip", " no-flip") == path.branch[-1]


def test_poses_out_of_reach_are_lost_and_the_rest_is_followed():
    arm = Arm.load("puma560")
    q0 = arm.configurations["nominal"]
    T = line(arm.fk(q0), [0.8, 0, 0], 100)
    path = arm.ik_path(T, q0)
    assert path.lost
    assert path.lost == tuple(range(path.lost[0], 100))
    assert np.isnan(path.q[path.lost[0] :]).all()
    assert path.branch[-1] == ""
    assert not path.ok
    with pytest.raises(UnreachableError, match=f"pose {path.lost[0]}"):
        path.require()
    assert path.near_singular  # it stretches before it is lost


def test_a_limit_in_the_way_makes_the_arm_switch_and_that_is_said():
    arm = Arm.load("puma560")
    q0 = np.radians([150, 45, 180, 0, 45, 0])
    q0[2] -= 2 * np.pi
    turn = np.linspace(0, np.radians(40), 80)
    q = np.repeat(q0[None], 80, axis=0)
    q[:, 0] += turn  # past the waist's 160 degrees
    free = arm.ik_path(arm.fk(q), q0, limits=False)
    assert free.ok
    assert np.abs(free.q - q).max() < 1e-9
    path = arm.ik_path(arm.fk(q), q0)
    assert not path.ok
    assert path.switches or path.lost
    numbers = arm.description.numbers
    reached = path.q[~np.isnan(path.q).any(axis=1)]
    assert ((reached >= numbers.lower - 1e-8) & (reached <= numbers.upper + 1e-8)).all()
    if path.switches:
        with pytest.raises(UnreachableError, match="has to switch branches"):
            path.require()


@pytest.mark.parametrize("name", ["planar2r", "cobra600", "al5d", "stanford"])
def test_any_arm_with_a_closed_form_follows(name):
    arm = Arm.load(name)
    numbers = arm.description.numbers
    middle = np.where(
        np.isfinite(numbers.lower + numbers.upper), (numbers.lower + numbers.upper) / 2, 0.0
    )
    q0 = middle + np.where(numbers.prismatic, 0.0, 0.2)
    q = q0 + np.linspace(0, 0.3, 50)[:, None] * np.where(numbers.prismatic, 0.1, 1.0)
    path = arm.ik_path(arm.fk(q), q0, limits=False)
    assert path.ok
    assert np.abs(path.q - q).max() < 1e-6
    assert "50 poses: 0 switches" in repr(path)


def test_what_is_refused():
    arm = Arm.load("puma560")
    with pytest.raises(ValueError, match=r"expected \(N, 4, 4\)"):
        arm.ik_path(np.eye(4), np.zeros(6))
    with pytest.raises(ValueError, match="expected"):
        arm.ik_path(np.eye(4)[None], np.zeros(5))
    with pytest.raises(ValueError, match="finite"):
        arm.ik_path(np.eye(4)[None], np.full(6, np.nan))
    with pytest.raises(ModelError, match="ik_numeric"):
        Arm.from_dh([(0, 0.1, 0.2, 0.3), (0, 0.1, 0.2, 0.4)]).ik_path(np.eye(4)[None], np.zeros(2))


def test_a_circle_with_turning_tool_is_followed_and_closes():
    arm = Arm.load("kr5")
    q0 = np.radians([0, -60, 60, 0, -50, 0])
    phi = np.linspace(0, 2 * np.pi, 300)
    T = np.repeat(arm.fk(q0)[None], len(phi), axis=0)
    T[:, :3, 3] += 0.15 * np.stack([0 * phi, np.sin(phi), 1 - np.cos(phi)], axis=1)
    T = T @ pose((0, 0, 0), euler=np.stack([0.3 * np.sin(phi), 0 * phi, 0 * phi], axis=1))
    path = arm.ik_path(T, q0)
    assert path.ok, path
    assert np.abs(path.q[0] - path.q[-1]).max() < 1e-9


@pytest.mark.parametrize("digits", [7, 9, 12, "float32"])
def test_poses_known_to_a_few_digits_do_not_spin_a_straight_wrist(digits):
    """Only joint 1 moves; the wrist is straight all along, so that rounding decides where q4 seems to be."""
    arm = Arm.load("puma560")
    q = np.repeat([[0.1, 0.7, -2.5, 0.9, 0, 0.4]], 100, axis=0)
    q[:, 0] += np.linspace(0, 0.5, 100)
    T = arm.fk(q).astype(np.float32) if digits == "float32" else arm.fk(q).round(digits)
    path = arm.ik_path(T, q[0], limits=False)
    assert path.ok
    assert np.abs(path.q - q).max() < 1e-4


def test_joint_1_keeps_its_angle_where_the_wrist_passes_axis_1():
    arm = Arm.load("irb140")
    q0 = singular_configurations(arm.description, "shoulder", 1)[0]
    q0[0] = 1.0
    q = np.repeat(q0[None], 41, axis=0)
    q[:, 1] += np.linspace(-0.2, 0.2, 41)
    q[20] = q0
    path = arm.ik_path(arm.fk(q), q[0], limits=False)
    assert path.ok
    assert np.abs(path.q - q).max() < 1e-6


def test_a_start_some_turns_away_ends_inside_the_limits_and_is_said():
    arm = Arm.load("puma560")
    q0 = arm.configurations["nominal"]
    path = arm.ik_path(arm.fk(q0)[None], q0 + 4 * np.pi * np.eye(6)[0])
    numbers = arm.description.numbers
    assert ((path.q >= numbers.lower) & (path.q <= numbers.upper)).all()
    assert path.start > 2 * np.pi
    assert arm.ik_path(arm.fk(q0)[None], q0).start < 1e-9


def test_an_arm_of_seven_joints_follows_a_line():
    arm = library_robot("panda")
    q0 = np.array([0.1, -0.7, 0.2, -2.2, 0.1, 1.6, 0.8])
    T = np.repeat(forward_kinematics(arm, q0)[None], 60, axis=0)
    T[:, 0, 3] -= np.linspace(0, 0.2, 60)
    for limits in (True, False):
        path = follow_path(arm, T, q0, limits=limits)
        assert path.ok and set(path.branch) == {"q2- q4- front"} and path.start < 1e-9
        assert np.abs(forward_kinematics(arm, path.q) - T).max() < 1e-11
        assert np.abs(np.diff(path.q, axis=0)).max() < 0.05
    far = T.copy()
    far[20:25, 0, 3] = 5.0
    path = follow_path(arm, far, q0)
    assert path.lost == tuple(range(20, 25)) and not path.switches
    assert path.branch[20] == "" and path.branch[25] == "q2- q4- front"


def test_joints_without_limits_go_on_through_whole_turns_by_iteration():
    # Six joints in general position, which no closed form covers, and no limits.
    rows = [
        (0, 0.3, 0.1, 1.2),
        (0, 0.1, 0.4, 0.3),
        (0, 0.05, 0.3, -1.0),
        (0, 0.2, 0.1, 0.9),
        (0, 0.1, 0.05, -1.3),
        (0, 0.1, 0.02, 0.4),
    ]
    arm = from_dh(rows)
    q0 = np.array([0.2, 0.4, -0.6, 0.3, 0.8, -0.2])
    q = q0 + np.linspace(0, 2.5 * 2 * np.pi, 400)[:, None] * np.eye(6)[0]
    path = follow_path(arm, forward_kinematics(arm, q), q0)
    assert path.ok
    assert np.abs(path.q - q).max() < 1e-6


# Of an arm of seven joints a path by iteration may be taken instead, which is another matter.
follow_by_branches = paths._followed_by_branches


@pytest.mark.parametrize("name", ["puma560", "panda", "ur5", "irb140", "planar2r", "stanford"])
@pytest.mark.parametrize("limits", [True, False])
def test_paths_are_the_same_whether_all_poses_are_known_or_one_after_the_other(
    name, limits, monkeypatch
):
    arm = Arm.load(name)
    rng = np.random.default_rng(7)
    for _ in range(5):
        # Waves of several turns, so that joints come to their limits and wind.
        t = np.linspace(0, 2 * np.pi, 60)
        middle, size = rng.uniform(-1, 1, (2, arm.n))
        q = middle + np.outer(np.sin(t), 2 * size)
        T = arm.fk(q)
        together = follow_by_branches(arm.description, T, q[0], limits)
        with monkeypatch.context() as patched:
            patched.setattr(paths._NearestBranch, "chained", lambda self, at: None)
            single = follow_by_branches(arm.description, T, q[0], limits)
        assert together.branch == single.branch
        assert np.allclose(together.q, single.q, rtol=0, atol=1e-9, equal_nan=True)
        assert (together.switches, together.lost) == (single.switches, single.lost)


@pytest.mark.parametrize("name", ["ur5", "panda", "puma560", "cobra600"])
def test_a_branch_that_does_not_reach_is_never_taken(name):
    """Joints with any number of turns: the start is far from all solutions, and some branches have none."""
    arm = Arm.load(name)
    q = np.random.default_rng(3).uniform(-3, 3, (300, arm.n))
    for state in q:
        T = arm.fk(state)[None]
        path = arm.ik_path(T, np.zeros(arm.n), limits=False)
        if not path.lost:
            assert np.abs(arm.fk(path.q) - T).max() < 1e-8
    jumping = arm.ik_path(arm.fk(q), q[0], limits=False)
    reached = np.setdiff1d(np.arange(len(q)), jumping.lost)
    assert np.abs(arm.fk(jumping.q[reached]) - arm.fk(q[reached])).max() < 1e-8


ELBOWS = {"puma560": (2, np.pi / 2 + 0.0469), "ur5": (2, 0.0), "iiwa": (3, 0.0)}
"""Joint of the elbow, counted from 0, and about where the arm is stretched, rad."""


@pytest.mark.parametrize("name", ELBOWS)
@pytest.mark.parametrize("passes", [True, False])
def test_joint_motions_through_and_beside_the_stretched_elbow_are_followed(name, passes):
    """Where two branches nearly coincide, the last step tells whether the path goes through or turns back."""
    arm = SEVEN["KUKA iiwa 14"] if name == "iiwa" else Arm.load(name)
    joint, straight = ELBOWS[name]
    rng = np.random.default_rng(31)
    deviating = 0
    for _ in range(40):
        count = int(rng.integers(60, 300))
        start = rng.uniform(-1, 1, arm.n)
        shares = np.linspace(0, 1, count)[:, None]
        q = start + shares * rng.uniform(-0.5, 0.5, arm.n)
        if passes:
            q[:, joint] = straight + np.linspace(
                -rng.uniform(0.1, 0.6), rng.uniform(0.1, 0.6), count
            )
        else:
            q[:, joint] = straight - rng.uniform(0.01, 0.1) - (shares[:, 0] - 0.5) ** 2
        redundancy = arm.redundancy(q) if arm.n == 7 else None
        path = arm.ik_path(arm.fk(q), q[0], limits=False, redundancy=redundancy)
        deviating += not path.ok or np.abs(path.q - q).max() > 1e-3
    assert deviating <= 1
