"""The nearest pose of arms of five joints: reached, at the wanted position, and turned by the least angle."""

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize
from scipy.spatial.transform import Rotation

from dhkit import Arm
from dhkit.errors import ModelError
from kinematics.closed_form.test_five_joints import ARMS, random_states

pytestmark = pytest.mark.filterwarnings("error")


def turned(T, seed):
    """Return poses at the same positions with random rotations."""
    poses = T.copy()
    poses[:, :3, :3] = Rotation.random(len(T), random_state=seed).as_matrix()
    return poses


def angles_between(A, B):
    return Rotation.from_matrix(np.swapaxes(A[..., :3, :3], -1, -2) @ B[..., :3, :3]).magnitude()


@pytest.mark.law
@pytest.mark.parametrize("name", ARMS)
def test_a_pose_that_is_reached_is_its_own_nearest(name, law):
    arm = ARMS[name]
    T = arm.fk(random_states(law.samples(20_000, 500)))
    found = arm.nearest_pose(T)
    law.holds("distance", np.abs(found - T).max(), 1e-6, name)


def states_near_the_edge(arm, rng, count):
    """Return states around local extremes of the tool's distance from axis 1, and from the origin."""

    def square(q, across):
        return float((arm.fk(q)[:3, 3] ** 2)[:across].sum())

    extremes = [
        minimize(
            lambda q, across=across, sign=sign: sign * square(q, across), rng.uniform(-3, 3, 5)
        ).x
        for across, sign in [(2, 1), (2, -1), (3, 1), (3, -1)] * 2
    ]
    q = np.repeat(extremes, count // len(extremes), axis=0)
    return q + rng.normal(size=q.shape) * 10 ** rng.uniform(-6, -0.5, (len(q), 1))


@pytest.mark.law
@pytest.mark.parametrize("across", [0.02, 0.3, 1.0])
@pytest.mark.parametrize("name", ARMS)
def test_a_pose_at_the_edge_of_reach_is_its_own_nearest(name, across, law):
    """With tools far beside axis 5, positions are reached in narrow intervals of q5 only."""
    rng = np.random.default_rng(int(100 * across))
    tool = np.eye(4)
    tool[:3, 3] = across * rng.uniform(-1, 1, 3)
    arm = ARMS[name].with_tool(tool)
    T = arm.fk(states_near_the_edge(arm, rng, law.samples(4_000, 160)))
    found = arm.nearest_pose(T)
    law.holds("distance", np.abs(found - T).max(), 1e-6, name)


def test_a_base_far_away_leaves_positions_at_the_edge_reached():
    base = np.eye(4)
    base[:3, 3] = 1e4
    arm = ARMS["scorbot"].with_base(base)
    q = random_states(200)
    q[:, 2] *= np.resize([0.0, 1e-9, 1e-6], 200)
    T = arm.fk(q)
    assert np.abs(arm.nearest_pose(T) - T).max() < 1e-6


@pytest.mark.law
@pytest.mark.parametrize("name", ARMS)
def test_the_nearest_pose_is_reached_at_the_wanted_position(name, law):
    arm = ARMS[name]
    T = turned(arm.fk(random_states(law.samples(20_000, 300), seed=1)), seed=2)
    found = arm.nearest_pose(T)
    assert np.array_equal(found[:, :3, 3], T[:, :3, 3])
    solutions = arm.ik(found)
    assert set(np.unique(solutions.status)) <= {"ok", "singular"}
    q = solutions.q[np.arange(len(T)), solutions.valid.argmax(axis=-1)]
    law.holds("closure", np.abs(arm.fk(q) - found).max(), 1e-8, name)


def test_both_shoulders_reach_a_position_on_axis_1():
    """Joint 1 is given by axis 5 there; where the arm is stretched too, one shoulder alone reaches."""
    arm = ARMS["scorbot"]
    T = arm.fk(random_states(10))
    T[:, :2, 3] = 0.0
    T[:, 2, 3] = np.linspace(0.1, 0.8, 10)
    found = arm.nearest_pose(T)
    is_reached = np.isfinite(found[:, 0, 0])
    assert is_reached.all()
    assert arm.ik(found[is_reached]).valid.any(axis=-1).all()


@pytest.mark.slow
@pytest.mark.parametrize("aside", [0.0, 0.05])
def test_joint_1_is_free_at_a_position_on_axis_1(aside):
    tool = np.eye(4)
    tool[0, 3] = aside
    arm = ARMS["scorbot"].with_tool(tool)
    rng = np.random.default_rng(7)
    q = [
        least_squares(lambda q: arm.fk(q)[:2, 3], start, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        for start in rng.uniform(-2.0, 2.0, (8, 5))
    ]
    T = arm.fk(q)
    T = T[np.abs(T[:, :2, 3]).max(axis=1) < 1e-12]
    T[:, :2, 3] = 0.0
    assert len(T) > 4
    assert np.abs(arm.nearest_pose(T) - T).max() < 1e-6


@pytest.mark.law
@pytest.mark.parametrize("name", ARMS)
def test_no_other_joint_values_come_nearer(name, law):
    arm = ARMS[name]
    rng = np.random.default_rng(3)
    T = turned(arm.fk(random_states(law.samples(20, 2), seed=4)), seed=5)
    found = arm.nearest_pose(T)
    for goal, angle in zip(T, angles_between(T, found), strict=True):
        least = np.inf
        for _ in range(25):
            result = minimize(
                lambda q, R=goal[:3, :3]: -np.trace(R.T @ arm.fk(q)[:3, :3]),
                rng.uniform(-np.pi, np.pi, 5),
                constraints={"type": "eq", "fun": lambda q, p=goal[:3, 3]: arm.fk(q)[:3, 3] - p},
                method="SLSQP",
                options={"maxiter": 300, "ftol": 1e-12},
            )
            reached = arm.fk(result.x)
            if np.abs(reached[:3, 3] - goal[:3, 3]).max() < 1e-8:
                least = min(least, float(angles_between(goal, reached)))
        law.holds("angle above that of a search", angle - least, 1e-5, name)


@pytest.mark.parametrize("name", ARMS)
def test_a_position_is_out_of_reach_where_no_joint_values_reach_it(name):
    arm = ARMS[name]
    q = random_states(40, seed=6)
    q[:, 2] *= 0.02
    stretched = arm.fk(q)[:, :3, 3]
    centre = arm.fk(np.zeros((1, 5)))[0, :3, 3] * [0.0, 0.0, 1.0]
    T = np.tile(np.eye(4), (40, 1, 1))
    T[:, :3, 3] = centre + (stretched - centre) * np.linspace(0.9, 1.2, 40)[:, None]
    is_reached = np.isfinite(arm.nearest_pose(T)).all(axis=(1, 2))
    expected = arm.ik_numeric(T, position_only=True, limits=False, restarts=50).valid.any(axis=-1)
    assert np.array_equal(is_reached, expected)
    assert 0 < is_reached.sum() < 40


def test_what_is_no_pose_or_another_arm_is_told():
    arm = ARMS["scorbot"]
    T = np.stack([np.full((4, 4), np.nan), 2.0 * np.eye(4), arm.fk([0.1, 0.2, 0.3, 0.4, 0.5])])
    assert np.isnan(arm.nearest_pose(T)).all(axis=(1, 2)).tolist() == [True, True, False]
    assert arm.nearest_pose(np.empty((0, 4, 4))).shape == (0, 4, 4)
    assert arm.nearest_pose(T[None]).shape == (1, 3, 4, 4)
    with pytest.raises(ValueError, match="T has shape"):
        arm.nearest_pose(np.eye(3))
    with pytest.raises(ModelError, match=r"puma560 is .*; nearest_pose is for"):
        Arm.load("puma560").nearest_pose(np.eye(4))
