"""IKSolutions: names as a person sees them, status, windings, the nearest; and what is refused."""

import pickle

import numpy as np
import pytest

from dhkit import Arm, pose
from dhkit.description import library_robot
from dhkit.errors import ModelError, UnreachableError
from dhkit.kinematics import IKFlag, IKStatus, forward_kinematics, inverse_kinematics
from ik_checks import FAMILY_A, FAMILY_B, SIX_JOINTS, axes_of, gaps
from random_arms import states

ELBOWS = (*FAMILY_A, *FAMILY_B)


def solved(name, count=400, seed=0):
    arm = library_robot(name)
    T = forward_kinematics(arm, states(arm, count, seed))
    return arm, T, inverse_kinematics(arm, T)


def elbow_points(arm, q):
    """Return axis 2, axis 3 and the end of the second link, each in the plane of the arm through axis 2's point."""
    z, p, origins = axes_of(arm, q)
    end = p[:, 3] if arm.name in FAMILY_B else origins[:, 4]
    foot = p[:, 1]
    return [
        x - np.sum((x - foot) * z[:, 1], axis=-1, keepdims=True) * z[:, 1]
        for x in (foot, p[:, 2], end)
    ]


@pytest.mark.parametrize("name", ELBOWS)
def test_up_is_the_branch_whose_elbow_is_higher(name):
    """Seen by a person: the elbow's height above the floor, and above the line from the shoulder to the wrist."""
    arm, _, solutions = solved(name)
    for i, label in enumerate(solutions.branches):
        if " up " not in label:
            continue
        j = solutions.branches.index(label.replace(" up ", " down "))
        both = solutions.valid[:, i] & solutions.valid[:, j]
        upper, lower = solutions.q[both, i], solutions.q[both, j]
        shoulder, elbow, end = elbow_points(arm, upper)
        _, low_elbow, low_end = elbow_points(arm, lower)
        if arm.name in FAMILY_A:
            assert (elbow[:, 2] >= low_elbow[:, 2] - 1e-9).all()
        for joint, tip, above in ((elbow, end, 1), (low_elbow, low_end, -1)):
            line, out = tip - shoulder, joint - shoulder
            level = np.linalg.norm(line[:, :2], axis=1)
            steep = level < 1e-2 * arm.reach  # the line is vertical: neither elbow is higher
            ahead = np.sum(out[:, :2] * line[:, :2], axis=1) / np.where(steep, 1, level)
            height = out[:, 2] - line[:, 2] / np.where(steep, 1, level) * ahead
            assert (above * height[~steep] >= -1e-9).all()


@pytest.mark.parametrize("name", ["puma560", "puma560_akb", "puma560_cao", *FAMILY_B, "stanford"])
def test_left_is_the_branch_whose_arm_passes_axis_1_on_the_left(name):
    """Seen by a person who stands at axis 1 and looks at the wrist, up being up."""
    arm, _, solutions = solved(name)
    for i, label in enumerate(solutions.branches):
        q = solutions.q[solutions.valid[:, i], i]
        z, p, origins = axes_of(arm, q)
        wrist = origins[:, 5] if name in FAMILY_B else origins[:, 4]
        # Axis 1 to the arm's plane.
        across = np.sum((wrist - p[:, 0]) * z[:, 1], axis=1, keepdims=True) * z[:, 1]
        sight = (wrist - p[:, 0])[:, :2]
        side = sight[:, 0] * across[:, 1] - sight[:, 1] * across[:, 0]
        assert ((side > -1e-9) if label.startswith("left") else (side < 1e-9)).all()


@pytest.mark.parametrize(
    "name", [name for name in FAMILY_A if name not in ("puma560", "puma560_akb", "puma560_cao")]
)
def test_front_is_the_branch_that_faces_the_wrist(name):
    arm, _, solutions = solved(name)
    assert {label.split()[0] for label in solutions.branches} == {"front", "back"}
    for i, label in enumerate(solutions.branches):
        q = solutions.q[solutions.valid[:, i], i]
        z, p, origins = axes_of(arm, q)
        ahead = np.cross(z[:, 0], z[:, 1])
        along = np.sum((origins[:, 4] - p[:, 0]) * ahead, axis=1)
        assert ((along >= -1e-9) if label.startswith("front") else (along <= 1e-9)).all()


@pytest.mark.parametrize("name", SIX_JOINTS)
def test_no_flip_turns_joint_5_to_its_positive_side(name):
    arm, _, solutions = solved(name)
    first = 1 if name in FAMILY_B else 3
    for i, label in enumerate(solutions.branches):
        q = solutions.q[solutions.valid[:, i], i]
        z, _, _ = axes_of(arm, q)
        sine = np.sum(np.cross(z[:, first], z[:, 5]) * z[:, 4], axis=1)
        assert ((sine > -1e-9) if label.endswith("no-flip") else (sine < 1e-9)).all()


def test_branches_are_found_by_words_in_any_order():
    _, _, solutions = solved("puma560", 5)
    expected = solutions.q[:, solutions.branches.index("left up flip")]
    for words in ("left up flip", "flip, up, left", "LEFT UP FLIP"):
        assert np.array_equal(solutions.branch(words), expected, equal_nan=True)
    no_flip = solutions.q[:, solutions.branches.index("right down no-flip")]
    for words in ("right down no-flip", "right down no flip", "noflip right down"):
        assert np.array_equal(solutions.branch(words), no_flip, equal_nan=True)
    with pytest.raises(ValueError, match="fits 4 branches; expected one of 'left up no-flip'"):
        solutions.branch("left")
    with pytest.raises(ValueError, match="'sideways' fits no branch"):
        solutions.branch("sideways")


def test_status_says_what_became_of_a_pose():
    arm = library_robot("puma560")
    T = np.repeat(forward_kinematics(arm, [0.3, 0.4, -1.0, 0.5, 0.6, 0.7])[None], 9, axis=0)
    T[1, :3, 3] = 3, 0, 0
    T[2, 0, 0] = np.nan
    T[3, :3, :3] *= 1.001
    T[4, :3, :3] = -T[4, :3, :3]
    T[5, 3, 0] = 0.1
    T[6, 1, 3] = np.inf
    T[7] = forward_kinematics(arm, [0.3, 0.4, -1.0, 0.5, 0.0, 0.7])
    T[8] = 0.0
    solutions = inverse_kinematics(arm, T)
    assert solutions.status.tolist() == [
        "ok",
        "out_of_reach",
        *["not_a_pose"] * 5,
        "singular",
        "not_a_pose",
    ]
    assert np.array_equal(
        solutions.status_code == IKStatus.not_a_pose, np.isnan(solutions.distance)
    )
    assert (solutions.distance[[0, 7]] == 0).all()
    # The nearest of the points that the wrist's centre reaches, by brute force over the stretched arm.
    lean = np.linspace(-np.pi, np.pi, 100_001)
    along, height = (0.4318 + np.hypot(0.0203, 0.4318)) * np.array([np.cos(lean), np.sin(lean)])
    nearest = np.hypot(3 - np.hypot(along, 0.15005), 0 - 0.67183 - height).min()
    assert nearest - 1e-9 <= solutions.distance[1] <= 1.001 * nearest
    assert not solutions.valid[1:7].any()
    assert not solutions.flags[1:7].any()
    one = inverse_kinematics(arm, T[1])
    assert one.status == "out_of_reach"
    assert one.q.shape == (8, 6)
    assert one.distance.shape == ()


def test_distance_shrinks_to_zero_at_the_boundary():
    arm = library_robot("irb140")
    direction = np.array([0.8, 0.36, 0.48])
    T = np.tile(np.eye(4), (400, 1, 1))
    T[:, :3, 3] = [0, 0, 0.352] + np.linspace(0.3, 2.0, 400)[:, None] * direction
    solutions = inverse_kinematics(arm, T)
    beyond = solutions.distance > 0
    assert np.array_equal(beyond, solutions.status == "out_of_reach")
    assert beyond[-1]
    assert not beyond[0]
    steps = np.diff(solutions.distance[beyond])
    assert (np.abs(steps / np.linalg.norm(np.diff(T[:2, :3, 3], axis=0)) - 1) < 0.2).all()


def test_on_the_boundary_both_elbows_are_one_and_clamped():
    arm = library_robot("puma560")
    # Axis 3 to wrist in line with the upper arm.
    q = np.array([0.3, 0.4, np.arctan2(-0.4318, 0.0203), 0.5, 0.6, 0.7])
    found = 0
    for shift in np.linspace(-2e-8, 2e-8, 201):
        T = forward_kinematics(arm, q + shift * np.eye(6)[2])
        solutions = inverse_kinematics(arm, T)
        assert solutions.valid.any()
        assert solutions.status == "singular"
        clamped = solutions.valid & (solutions.flags & IKFlag.clamped > 0)
        found += bool(clamped.any())
    assert found


def test_windings_and_limits():
    arm = Arm.load("puma560")
    q = np.radians([-150, 200, -220, 150, 50, -260])
    solutions = arm.ik(arm.fk(q))
    assert np.abs(solutions.nearest(q) - q).max() < 1e-12
    kept = solutions.within_limits(near=q)
    lower, upper = solutions.lower, solutions.upper
    inside = ~np.isnan(kept).any(axis=-1)
    assert inside.any()
    assert ((kept[inside] >= lower - 1e-9) & (kept[inside] <= upper + 1e-9)).all()
    assert np.array_equal(inside, solutions.allowed)
    closest = kept[inside][np.argmin(np.abs(kept[inside] - q).max(axis=-1))]
    assert np.abs(closest - q).max() < 1e-12
    assert np.abs(solutions.require(near=q) - q).max() < 1e-12
    # The last joint goes from -266 to 266 degrees: -260 is 100 as well.
    name = solutions.branches[
        int(np.nanargmin(np.abs(solutions.within_limits(q) - q).max(axis=-1)))
    ]
    windings = np.array(solutions.windings(name))
    assert len(np.unique(windings.round(9), axis=0)) == len(windings) == 2
    assert np.abs(arm.fk(windings) - arm.fk(q)).max() < 1e-14
    assert ((windings >= lower - 1e-9) & (windings <= upper + 1e-9)).all()


def test_the_out_of_limits_flag_is_that_of_every_winding():
    arm, _, solutions = solved("puma560", 300)
    lower, upper = arm.numbers.lower, arm.numbers.upper
    turns = 2 * np.pi * np.arange(-3, 4)[:, None, None, None]
    with np.errstate(invalid="ignore"):
        inside = (
            ((solutions.q + turns >= lower) & (solutions.q + turns <= upper))
            .any(axis=0)
            .all(axis=-1)
        )
    flagged = solutions.flags & IKFlag.out_of_limits > 0
    assert np.array_equal(solutions.valid & ~flagged, inside)


@pytest.mark.parametrize("name", ["planar2r", "ur5", "panda", "cart_pendulum"])
def test_arms_with_unlimited_joints_have_windings_too(name):
    arm = Arm.load(name)
    numbers = arm.description.numbers
    q = np.clip(np.full(arm.n, 0.3), numbers.lower, numbers.upper)
    solutions = arm.ik(arm.fk(q)) if name != "panda" else arm.ik_numeric(arm.fk(q), q)
    assert np.abs(solutions.require(near=q) - q).max() < 1e-9
    assert not np.isnan(solutions.within_limits()).all()
    assert solutions.windings(solutions.branches[0])


def test_require_says_what_is_missing():
    arm = Arm.load("puma560")
    T = np.repeat(arm.fk(arm.configurations["nominal"])[None], 3, axis=0)
    T[1, :3, 3] = 2, 0, 0
    with pytest.raises(UnreachableError, match=r"pose 1 is out of reach by 1\.\d+ m"):
        arm.ik(T).require()
    T[1, :3, 3] = np.nan
    T[2] = T[1]
    with pytest.raises(UnreachableError, match=r"pose 1 \(one of 2 without a sol.* is not a pose"):
        arm.ik(T).require()
    q = np.radians([170, 0, 0, 0, 30, 0])  # the waist ends at 160 degrees
    T = arm.fk(q)
    if not arm.ik(T).allowed.any():
        with pytest.raises(UnreachableError, match="outside the joint limits"):
            arm.ik(T).require()


def test_nearest_of_a_batch_takes_one_start_or_many():
    arm = library_robot("ur5")
    q = states(arm, 50)
    solutions = inverse_kinematics(arm, forward_kinematics(arm, q))
    assert gaps(arm, solutions.nearest(q), q).max() < 1e-8
    assert solutions.nearest(np.zeros(6)).shape == (50, 6)
    with pytest.raises(ValueError, match=r"expected \(..., 6\)|expected \(6,\) or \(50, 6\)"):
        solutions.nearest(np.zeros(5))
    with pytest.raises(ValueError, match="windings of a batch"):
        solutions.windings("left up flip")


@pytest.mark.parametrize(
    ("T", "error", "complaint"),
    [
        (np.eye(3), ValueError, r"T has shape \(3, 3\); expected \(\.\.\., 4, 4\)"),
        (1.0, ValueError, "T has shape"),
        ("up", TypeError, "expected numbers"),
        ([[None] * 4] * 4, TypeError, "expected numbers"),
        ([[1, 2], [3]], TypeError, "expected numbers"),
        (np.eye(4) * 1j, TypeError, "expected numbers"),
    ],
)
def test_arguments_of_the_wrong_shape_or_type_are_said(T, error, complaint):
    with pytest.raises(error, match=complaint):
        Arm.load("puma560").ik(T)


def test_other_arguments_are_checked():
    arm = Arm.load("puma560")
    T = arm.fk(np.zeros((3, 6)))
    for seed in (np.zeros(5), np.zeros((2, 6))):
        with pytest.raises(ValueError, match=r"seed has shape|expected \(\.\.\., 6\)"):
            arm.ik(T, seed=seed)
    with pytest.raises(ValueError, match=r"expected \(3, 8, 6\)"):
        arm.ik(T, out=np.empty((3, 6)))
    with pytest.raises(ValueError, match="threads is 0"):
        arm.ik(T, threads=0)
    with pytest.raises(ModelError, match="ik_numeric"):
        Arm.from_dh([(0, 0.1, 0.2, 0.3), (0, 0.1, 0.2, 0.4), (0, 0.3, 0.1, 0.5)]).ik(T)


def test_batches_threads_and_out():
    arm = Arm.load("puma560")
    T = arm.fk(states(arm.description, 9_000).reshape(3, 3000, 6))
    expected = arm.ik(T)
    assert expected.q.shape == (3, 3000, 8, 6)
    assert expected.status.shape == (3, 3000)
    out = np.empty_like(expected.q)
    solutions = arm.ik(T, out=out, threads=2)
    assert solutions.q is out
    assert np.nanmax(np.abs(np.angle(np.exp(1j * (out - expected.q))))) < 1e-9
    assert np.array_equal(solutions.flags, expected.flags)
    assert arm.ik(np.empty((0, 4, 4))).q.shape == (0, 8, 6)
    frozen = T[0, :5].copy()
    frozen.flags.writeable = False
    assert np.array_equal(arm.ik(frozen).valid, expected.valid[0, :5])
    again = pickle.loads(pickle.dumps(solutions))
    assert np.array_equal(again.valid, solutions.valid)
    assert "9000 poses, 8 branches" in repr(solutions)


def test_a_result_may_be_written_over_the_poses():
    arm = Arm.load("puma560")
    T = arm.fk(states(arm.description, 5000))
    expected = arm.ik(T)
    memory = np.empty(5000 * 48)
    poses = memory[: 5000 * 16].reshape(5000, 4, 4)
    poses[:] = T
    solutions = arm.ik(poses, out=memory.reshape(5000, 8, 6))
    assert np.array_equal(solutions.q, expected.q, equal_nan=True)


def test_poses_in_single_precision_are_reached_at_a_urs_singularity():
    arm = Arm.load("ur5")
    q = states(arm.description, 500)
    q[:, 4] = 0.0
    T = arm.fk(q).astype(np.float32)
    for seed in (None, q):
        solutions = arm.ik(T, seed=seed)
        assert solutions.valid.any(axis=-1).mean() > 0.995
        assert np.nanmax(np.abs(arm.fk(solutions.q) - T[:, None])) < 1e-5


@pytest.mark.parametrize("tilt", [0, 45, 80, 135, 180])
def test_up_is_higher_however_the_base_is_mounted(tilt):
    arm = Arm.load("kr5").with_base(pose((1, 2, 3), euler=(tilt, 20, 10), degrees=True)).description
    solutions = inverse_kinematics(arm, forward_kinematics(arm, states(arm, 400)))
    for i, label in enumerate(solutions.branches):
        if " up " in label:
            j = solutions.branches.index(label.replace(" up ", " down "))
            both = solutions.valid[:, i] & solutions.valid[:, j]
            elbow, lower = (axes_of(arm, solutions.q[both, k])[1][:, 2] for k in (i, j))
            assert (elbow[:, 2] >= lower[:, 2] - 1e-9).all()


def test_distance_is_that_to_the_nearest_point_reached():
    """An arm with an offset at full stretch: the way to the wrist's reach is shorter in space than in its plane."""
    rows = [
        (0, 0.5, 0, "pi/2"),
        (0, 0.3, 0.6, 0),
        (0, 0, 0, "-pi/2"),
        (0, 0.3, 0, "pi/2"),
        (0, 0, 0, "-pi/2"),
        (0,) * 4,
    ]
    arm = Arm.from_dh(rows)
    T = arm.fk([0, 0.3, 0, 0, 0.4, 0])
    T[:3, 3] = [0.32, 0, 0.5]
    distance = float(arm.ik(T).distance)
    for step, status in ((0.999, "out_of_reach"), (1.001, "ok")):
        T[0, 3] = 0.32 + step * distance
        assert arm.ik(T).status == status or (step > 1 and arm.ik(T).status == "singular")


@pytest.mark.parametrize("name", ["puma560", "kr5", "panda"])
def test_angles_at_the_edge_of_the_limits_slack_keep_their_turn(name):
    """A flag that says inside, and whole turns whose rounding said outside, had put joints a turn away."""
    arm = Arm.load(name)
    numbers = arm.description.numbers
    rng = np.random.default_rng(21)
    checked = 0
    for _ in range(300):
        q = rng.uniform(numbers.lower, numbers.upper)
        joint = rng.integers(arm.n - 1)
        side = (numbers.lower, numbers.upper)[rng.integers(2)]
        q[joint] = side[joint] + rng.choice([-1.0, 1.0]) * 1e-9 * (1 + rng.uniform(-1e-6, 1e-6))
        seed = q if arm.n == 7 else None
        found = arm.ik(arm.fk(q), seed=seed)
        inside = found.within_limits()[found.allowed]
        checked += len(inside)
        assert (inside >= numbers.lower - 1.01e-9).all()
        assert (inside <= numbers.upper + 1.01e-9).all()
        for branch in np.array(found.branches)[found.allowed]:
            assert found.windings(branch)
    assert checked > 300
