"""Laws of iterative inverse kinematics: what closes, what is near, what limits keep, what is said of failures."""

import time

import numpy as np
import pytest
from hypothesis import given, settings

import acceptance
from dhkit import Arm
from dhkit.description import from_dh, library_robot, pose, robots, with_tool
from dhkit.description.robot_file import from_toml
from dhkit.kinematics import (
    IKFlag,
    classify,
    forward_kinematics,
    inverse_kinematics,
    solve_numerically,
)
from dhkit.kinematics.newton import Newton, descent_kernel
from dhkit.kinematics.numeric import CHUNK
from random_arms import states, tables

CLOSES = 1e-12  # share of the reach and rad: the default tolerance
ROUNDING = 1e-14  # what a last step of Newton leaves where nothing is singular
FAILS = 5e-4  # share of poses that a search with default settings may miss
NEAR = 0.1  # rad, or share of the reach: where a search starts that is to find the solution nearby


def inside(arm, count, seed=0):
    """Joint values inside the limits, and their poses."""
    numbers = arm.numbers
    q = np.random.default_rng(seed).uniform(numbers.lower, numbers.upper, (count, arm.n))
    return q, forward_kinematics(arm, q)


def gaps(arm, q, T):
    """Position over the reach and rotation (as a chord, rad) that joint values miss a pose by, the larger."""
    apart = forward_kinematics(arm, q) - T
    way = np.linalg.norm(apart[..., :3, 3], axis=-1) / arm.reach
    return np.maximum(way, np.linalg.norm(apart[..., :3, :3], axis=(-1, -2)) / np.sqrt(2))


def moved(arm, q, before):
    """The largest change of a joint, angles the short way round, lengths over the reach."""
    prismatic = arm.numbers.prismatic
    change = np.where(
        prismatic, (q - before) / arm.reach, (q - before + np.pi) % (2 * np.pi) - np.pi
    )
    return np.abs(change).max(axis=-1)


@pytest.mark.parametrize("name", robots())
def test_poses_that_are_reached_are_found(name, law):
    arm = library_robot(name)
    _, T = inside(arm, law.samples(4_000))
    found = solve_numerically(arm, T)
    law.holds("share of poses missed", 1 - found.valid.mean(), FAILS)
    q = found.q[found.valid]
    law.holds("closure", gaps(arm, q, T[found.valid[:, 0]]).max(), CLOSES)
    assert np.all((q >= arm.numbers.lower) & (q <= arm.numbers.upper))
    assert np.array_equal(found.status == "ok", found.valid[:, 0])
    assert np.array_equal(found.distance == 0, found.valid[:, 0])
    assert found.branches == ("numeric",)
    assert not found.flags.any()


@pytest.mark.parametrize("name", robots())
def test_from_near_a_solution_all_poses_are_found(name, law):
    arm = library_robot(name)
    q, T = inside(arm, law.samples(4_000), seed=1)
    away = (
        NEAR
        * np.random.default_rng(2).uniform(-1, 1, q.shape)
        * np.where(arm.numbers.prismatic, arm.reach, 1.0)
    )
    found = solve_numerically(arm, T, q + away)
    law.holds("share of poses missed", 1 - found.valid.mean(), 0.0)
    # Beside a singularity the next branch, or for a redundant arm all its curve of solutions, is near too.
    far = np.mean(moved(arm, found.q[:, 0], q) > 5 * NEAR)
    law.holds("share of solutions that are not the near one", far, FAILS)


def test_the_solution_of_a_redundant_arm_is_beside_the_start(law):
    """Away from singularities a search ends no further from its start than twice the known solution is."""
    panda = library_robot("panda")
    ready = np.array([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
    rng = np.random.default_rng(3)
    q = ready + rng.uniform(-0.5, 0.5, (law.samples(2_000), 7))
    start = q + rng.uniform(-0.2, 0.2, q.shape)
    found = solve_numerically(panda, forward_kinematics(panda, q), start)
    asked, gone = np.linalg.norm(q - start, axis=1), np.linalg.norm(found.q[:, 0] - start, axis=1)
    law.holds("way over the way to the known solution", np.max(gone / asked), 2.0)


@pytest.mark.parametrize("name", ["puma560", "ur5", "stanford", "cobra600"])
def test_it_is_one_of_the_closed_form_s_branches(name):
    arm = library_robot(name)
    q, T = inside(arm, 100, seed=4)
    found, exact = solve_numerically(arm, T, q + 0.01), inverse_kinematics(arm, T)
    if len(exact.met) == 6:
        usual = ~(exact.status == "singular")
        assert np.all(moved(arm, exact.nearest(found.q[:, 0]), found.q[:, 0])[usual] < 1e-8)
    assert np.all(gaps(arm, found.q[:, 0], T) < ROUNDING * 100)


@settings(max_examples=acceptance.sample_size(400))
@given(arm=tables(least=1, most=8))
def test_any_arm_without_limits_is_solved_from_near_by(arm):
    """Prismatic joints, few joints and many, any table: the pose is met, angles are in (-pi, pi]."""
    q = states(arm, 3)
    T = forward_kinematics(arm, q)
    found = solve_numerically(arm, T, q + 1e-3, tolerance=1e-10, restarts=7)
    assert found.valid.all()
    newton = Newton.of(arm, position_only=False, limits=False)
    error = newton.error(np.ascontiguousarray(found.q[:, 0]), T.reshape(-1, 16))
    assert np.abs(error).max() <= 2e-10
    angles = found.q[..., ~arm.numbers.prismatic]
    assert np.all((angles > -np.pi) & (angles <= np.pi))


@pytest.mark.parametrize("name", ["puma560", "jaco", "al5d"])
def test_position_only(name):
    arm = library_robot(name)
    _, T = inside(arm, 200, seed=5)
    found = solve_numerically(arm, T, position_only=True)
    assert found.met == ("x", "y", "z")
    assert found.valid.mean() >= 1 - FAILS
    apart = forward_kinematics(arm, found.q)[:, 0, :3, 3] - T[:, :3, 3]
    assert np.nanmax(np.linalg.norm(apart, axis=1)) <= CLOSES * arm.reach


def test_few_joints_meet_a_whole_pose_or_none():
    arm = library_robot("al5d")
    T = forward_kinematics(arm, [0.1, 0.2, 0.3, 0.4])
    tilted = T @ pose(euler=(0.3, 0, 0))
    found = solve_numerically(arm, np.stack([T, tilted]))
    assert found.status.tolist() == ["ok", "not_found"]
    assert len(found.met) == 6
    assert np.isnan(found.q[1]).all()
    assert solve_numerically(arm, tilted, position_only=True).valid.all()


def test_limits_are_kept_or_flagged():
    """An elbow that may only bend the other way: nothing is found inside, and said to be outside otherwise."""
    arm = from_toml(
        'format = 1\nname = "stiff"\nconvention = "standard"\n'
        '[[joint]]\ntype = "revolute"\na = 1\nalpha = 0\nd = 0\ntheta = 0\nlimits = [-0.5, 0.5]\n'
        '[[joint]]\ntype = "revolute"\na = 1\nalpha = 0\nd = 0\ntheta = 0\nlimits = [0, 2]\n',
        file="stiff.toml",
    )
    T = forward_kinematics(arm, np.array([[0.4, 1.0], [0.0, -1.0]]))
    kept, free = solve_numerically(arm, T), solve_numerically(arm, T, limits=False)
    assert kept.status.tolist() == ["ok", "not_found"]
    assert kept.q[0, 0] == pytest.approx([0.4, 1.0], abs=1e-10)
    assert free.status.tolist() == ["ok", "ok"]
    assert free.q[1, 0] == pytest.approx([0.0, -1.0], abs=1e-10)
    assert free.flags[:, 0].tolist() == [0, IKFlag.out_of_limits]
    assert free.allowed[:, 0].tolist() == [True, False]


def test_windings_inside_the_limits_are_kept():
    """A UR5 turns twice: its solution is a few degrees from the start, not a turn away from it."""
    arm = library_robot("ur5")
    q = np.array([5.9, -1.2, 1.3, -4.0, 1.1, -6.0])
    found = solve_numerically(arm, forward_kinematics(arm, q), q + 0.05)
    assert found.q[0] == pytest.approx(q, abs=1e-9)
    outside = solve_numerically(
        library_robot("puma560"), forward_kinematics(library_robot("puma560"), q * 0), q * 10
    )
    assert outside.allowed.all()


@pytest.mark.parametrize("beyond", [1e-6, 0.05, 1.0])
def test_what_is_missing_is_how_far_the_position_is_out_of_reach(beyond):
    arm = library_robot("planar2r")
    T = pose((0.6 * (arm.reach + beyond), -0.8 * (arm.reach + beyond), 0))
    found = solve_numerically(arm, T, position_only=True)
    assert found.status == "out_of_reach"
    assert found.distance == pytest.approx(beyond, rel=1e-3)
    assert np.isnan(found.q).all()
    assert solve_numerically(
        arm, pose((0.6 * arm.reach, -0.8 * arm.reach, 0)), position_only=True
    ).valid.all()


def test_what_is_no_pose_is_said_and_disturbs_no_other():
    arm = library_robot("puma560")
    _, T = inside(arm, 7, seed=6)
    expected = solve_numerically(arm, T)
    broken = T.copy()
    broken[0, 0, 0] = np.nan
    broken[1, :3, :3] *= 1 + 1e-5
    broken[2, 3, 3] = 2
    broken[3, :3, 0] *= -1
    broken[4, 0, 3] = np.inf
    broken[5, :3, :3] *= 1 + 1e-8  # a rotation to seven digits is one
    found = solve_numerically(arm, broken)
    assert found.status.tolist() == ["not_a_pose"] * 5 + ["ok", "ok"]
    assert np.isnan(found.q[:5]).all() and np.isnan(found.distance[:5]).all()
    assert np.allclose(found.q[5:], expected.q[5:], rtol=0, atol=1e-6)
    # Not to the bit: a block's last items may be compiled for fewer lanes, with other products fused into sums.
    assert np.allclose(found.q[6], expected.q[6], rtol=0, atol=1e-13)
    far = T.copy()
    far[:, :3, 3] = 1e300
    assert (solve_numerically(arm, far, restarts=1).status == "out_of_reach").all()


def test_a_batch_is_its_elements():
    arm = library_robot("kr5")
    _, T = inside(arm, 12, seed=7)
    batch = solve_numerically(arm, T.reshape(3, 4, 4, 4))
    assert batch.q.shape == (3, 4, 1, 6)
    assert batch.status_code.shape == batch.distance.shape == (3, 4)
    one = solve_numerically(arm, T[6])
    assert one.q.shape == (1, 6)
    assert np.allclose(one.q, batch.q[1, 2], rtol=0, atol=1e-9)
    assert solve_numerically(arm, T[:0]).q.shape == (0, 1, 6)
    assert solve_numerically(arm, T.reshape(3, 4, 4, 4)[:, :0], np.zeros(6)).q.shape == (3, 0, 1, 6)


def test_equal_seeds_give_equal_results_and_other_starts_other_solutions():
    arm = library_robot("puma560")
    q, T = inside(arm, 40, seed=8)
    assert np.array_equal(solve_numerically(arm, T, seed=3).q, solve_numerically(arm, T, seed=3).q)
    assert not np.array_equal(solve_numerically(arm, T).q, solve_numerically(arm, T, q).q)
    q[3] = np.nan  # starts from the middle of the limits, like a pose without a start
    assert np.allclose(
        solve_numerically(arm, T, q).q[3], solve_numerically(arm, T[3]).q, rtol=0, atol=1e-9
    )


def test_restarts_find_more():
    arm = library_robot("kr5")
    _, T = inside(arm, 200, seed=9)
    found = [solve_numerically(arm, T, restarts=count).valid.mean() for count in (0, 3, 63)]
    assert found[0] < found[1] <= found[2]


def test_progress_counts_poses_and_may_end_the_work():
    arm = library_robot("polar_rp")
    T = np.broadcast_to(forward_kinematics(arm, [0.1, 0.3]), (CHUNK + 5, 4, 4))
    seen = []
    solve_numerically(arm, T, progress=lambda done, of: seen.append((done, of)))
    assert seen == [(CHUNK, CHUNK + 5), (CHUNK + 5, CHUNK + 5)]

    def stop(done, of):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve_numerically(arm, T, progress=stop)


@pytest.mark.slow
def test_threads_change_nothing():
    arm = library_robot("ur5")
    q, T = inside(arm, 9_000, seed=10)
    descent_kernel(arm, 6)[0].compile()  # interpreted code differs by rounding
    assert np.array_equal(solve_numerically(arm, T, q, threads=2).q, solve_numerically(arm, T, q).q)


def test_an_arm_without_an_exact_closed_form_and_with_a_tool():
    arm = with_tool(
        from_dh([(0, 0.2, 0.1, 0.3 * k) for k in range(7)], kinds="RRPRRRR"), pose((0.1, 0.2, 0.3))
    )
    assert classify(arm).family is None
    q = states(arm, 20)
    T = forward_kinematics(arm, q)
    found = Arm(arm).ik_numeric(T)
    assert found.valid.mean() > 0.9
    assert np.nanmax(np.abs(forward_kinematics(arm, found.q)[:, 0] - T)) < 1e-11


def test_throughput(law):
    """PUMA 560, batches of 10,000 without a start."""
    arm = library_robot("puma560")
    _, T = inside(arm, law.samples(10_000))
    solve_numerically(arm, T[:10])
    begin = time.perf_counter()
    solve_numerically(arm, T)
    law.takes("seconds a pose", (time.perf_counter() - begin) / len(T), 50e-6)
    assert law.size == len(T)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1e-3, 1.0, np.pi - 1e-3, np.pi - 1e-9])
def test_the_error_of_a_rotation_is_its_rotation_vector(angle):
    """A wrist turned by an angle about some axis is off by angle times axis, to rounding, near 0 and near pi too."""
    arm = library_robot("puma560")
    q, T = inside(arm, 30, seed=11)
    axis = np.random.default_rng(12).normal(size=(30, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    half = angle / 2
    turn = pose(quat=np.concatenate([np.sin(half) * axis, np.full((30, 1), np.cos(half))], axis=1))
    goals = T.copy()
    goals[:, :3, :3] = turn[:, :3, :3] @ T[:, :3, :3]
    error = Newton.of(arm, position_only=False, limits=True).error(q, goals.reshape(-1, 16))
    assert np.abs(error[:, :3]).max() < 1e-15
    assert np.abs(error[:, 3:] - angle * axis).max() < 4e-15


@pytest.mark.parametrize(
    ("options", "error", "complaint"),
    [
        ({"T": np.eye(3)}, ValueError, r"T has shape \(3, 3\); expected \(\.\.\., 4, 4\)"),
        ({"T": "pose"}, TypeError, "expected numbers"),
        ({"q0": np.zeros(5)}, ValueError, r"q0 has shape \(5,\); expected \(\.\.\., 6\)"),
        (
            {"q0": np.zeros((3, 6))},
            ValueError,
            r"q0 has shape \(3, 6\); expected \(6,\) or \(2, 6\)",
        ),
        ({"restarts": -1}, ValueError, "restarts is -1; expected a whole number, 0 or more"),
        ({"tolerance": 0.0}, ValueError, "tolerance is 0.0; expected a positive number"),
        ({"tolerance": np.nan}, ValueError, "tolerance is nan"),
        ({"threads": 0}, ValueError, "threads is 0"),
    ],
)
def test_arguments_that_do_not_fit_are_said(options, error, complaint):
    arguments = {"T": np.broadcast_to(np.eye(4), (2, 4, 4)), **options}
    with pytest.raises(error, match=complaint):
        solve_numerically(library_robot("puma560"), **arguments)
