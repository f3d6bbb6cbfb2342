"""Poses: every Euler order, near and at gimbal lock, against SciPy; quaternions; bad input."""

import itertools

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from dhkit.description import check_pose, pose, pose_parts, pose_quaternion

ROUNDED = 2e-15  # of rotation entries put together from three rounded turns
ORDERS = [
    order
    for axes in itertools.product("XYZ", repeat=3)
    if axes[0] != axes[1] != axes[2]
    for order in ("".join(axes), "".join(axes).lower())
]
angle = st.one_of(
    st.floats(-np.pi, np.pi),
    st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi]),
    st.floats(-1e-7, 1e-7).map(lambda off: np.pi / 2 + off),
    st.floats(-1e-7, 1e-7),
)


def test_there_are_24_orders():
    assert len(ORDERS) == 24


@pytest.mark.parametrize("order", ORDERS)
@given(st.tuples(angle, angle, angle))
def test_a_pose_is_scipys_and_its_parts_make_it_again(order, euler):
    T = pose((1, 2, 3), euler=euler, order=order)
    assert np.abs(T[:3, :3] - Rotation.from_euler(order, euler).as_matrix()).max() < ROUNDED
    xyz, angles = pose_parts(T, order=order)
    assert np.array_equal(xyz, [1, 2, 3])
    assert np.abs(pose(xyz, euler=angles, order=order) - T).max() < ROUNDED


@pytest.mark.parametrize("order", ORDERS)
def test_angles_away_from_gimbal_lock_are_scipys(order):
    euler = np.random.default_rng(0).uniform(-np.pi, np.pi, (50, 3))
    T = pose(euler=euler, order=order)
    _, angles = pose_parts(T, order=order)
    middle = angles[:, 1] if order[0] != order[2] else angles[:, 1] - np.pi / 2
    apart = np.abs(np.abs(middle) - np.pi / 2) > 0.1
    expected = Rotation.from_matrix(T[:, :3, :3]).as_euler(order)
    assert apart.sum() > 20
    assert np.abs((angles - expected)[apart]).max() < 1e-13


@pytest.mark.parametrize("order", ORDERS)
def test_right_angles_in_degrees_are_exact(order):
    euler = np.array(list(itertools.product([0, 90, 180, -90, 450], repeat=3)))
    T = pose(euler=euler, order=order, degrees=True)
    assert set(np.unique(T)) <= {-1.0, 0.0, 1.0}
    _, angles = pose_parts(T, order=order, degrees=True)
    assert np.array_equal(pose(euler=angles, order=order, degrees=True), T)


def test_capitals_turn_about_moving_axes():
    """The seed's XYZ is Rx Ry Rz: after turning 90 degrees about x, y is the world's z."""
    T = pose(euler=(90, 90, 0), order="XYZ", degrees=True)
    assert np.array_equal(T[:3, :3], [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    assert np.array_equal(T, pose(euler=(0, 90, 90), order="zyx", degrees=True))


@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_quaternions_are_scipys_and_come_back(quaternion):
    T = pose(quat=quaternion)
    assert np.abs(T[:3, :3] - Rotation.from_quat(quaternion).as_matrix()).max() < ROUNDED
    again = pose_quaternion(T)
    assert abs(abs(again @ quaternion) / np.linalg.norm(quaternion) - 1) < 1e-14
    assert again[3] >= 0


def test_batches_broadcast():
    assert pose(np.zeros((5, 1, 3)), euler=np.zeros((4, 3))).shape == (5, 4, 4, 4)
    xyz, angles = pose_parts(pose(np.zeros((5, 1, 3)), euler=np.zeros((4, 3))))
    assert xyz.shape == angles.shape == (5, 4, 3)
    assert pose_quaternion(pose(np.zeros((5, 3)))).shape == (5, 4)
    assert np.isnan(pose((np.nan, 0, 0))[0, 3])


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: pose((1, 2)), r"xyz has shape \(2,\); expected \(\.\.\., 3\)"),
        (lambda: pose(euler=(1, 2)), "euler has shape"),
        (lambda: pose(euler=(1, 2, 3), order="XXY"), "order is 'XXY'"),
        (lambda: pose(euler=(1, 2, 3), order="xYz"), "order is 'xYz'"),
        (lambda: pose(euler=(1, 2, 3), order="ABC"), "order is 'ABC'"),
        (lambda: pose(quat=(0, 0, 0, 0)), "zero length"),
        (lambda: pose(quat=(0, 0, 0, 1), euler=(0, 0, 0)), "both euler and quat"),
        (lambda: pose_parts(np.eye(3)), r"expected \(\.\.\., 4, 4\)"),
        (lambda: pose_parts(2 * np.eye(4)), "is not a pose"),
        (lambda: pose_parts(np.diag([1.0, 1, -1, 1])), "is not a pose"),
        (lambda: check_pose(np.ones((4, 4)), "goal"), "goal is not a pose"),
    ],
)
def test_what_is_no_pose_is_said(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call()


def test_rotations_typed_with_six_decimals_are_poses():
    rng = np.random.default_rng(0)
    R = Rotation.random(20_000, random_state=rng).as_matrix().round(6)
    T = np.tile(np.eye(4), (len(R), 1, 1))
    T[:, :3, :3] = R
    assert check_pose(T).shape == T.shape
