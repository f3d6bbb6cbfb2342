"""Paths of the tool against their geometry, and their derivatives against differences."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation, Slerp

from dhkit.description import pose
from dhkit.trajectories import tool_circle, tool_line

STEP = 1e-5
NUMERIC = 1e-8  # central differences with that step


def random_pose(rng):
    return pose(rng.uniform(-1, 1, 3), quat=rng.normal(size=4))


def paths(seed):
    rng = np.random.default_rng(seed)
    T0, T1 = random_pose(rng), random_pose(rng)
    centre, axis, angle = rng.uniform(-1, 1, 3), rng.normal(size=3), rng.uniform(-7, 7)
    return (
        T0,
        T1,
        [
            tool_line(T0, T1),
            *(tool_circle(T0, centre, axis, angle, turning) for turning in (False, True)),
        ],
    )


@given(st.integers(0, 10_000))
def test_twists_and_their_rates_are_those_of_differences(seed):
    s = np.linspace(0.1, 0.9, 7)
    for path in paths(seed)[2]:
        before, here, after = (path.poses(s + step) for step in (-STEP, 0.0, STEP))
        velocity = (after - before)[:, :3, 3] / (2 * STEP)
        spin = (after - before)[:, :3, :3] / (2 * STEP) @ np.swapaxes(here[:, :3, :3], 1, 2)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        assert (
            np.abs(path.twists(s) - np.concatenate([velocity, omega], axis=1)).max() < 100 * NUMERIC
        )
        rates = (path.twists(s + STEP) - path.twists(s - STEP)) / (2 * STEP)
        assert np.abs(path.twist_rates(s) - rates).max() < 100 * NUMERIC


@given(st.integers(0, 10_000))
def test_a_line_is_straight_and_turns_as_slerp(seed):
    T0, T1, (line, *_) = paths(seed)
    s = np.linspace(0, 1, 9)
    T = line.poses(s)
    assert np.abs(T[[0, -1]] - [T0, T1]).max() < 1e-12
    assert (
        np.abs(T[:, :3, 3] - ((1 - s)[:, None] * T0[:3, 3] + s[:, None] * T1[:3, 3])).max() < 1e-12
    )
    slerp = Slerp([0, 1], Rotation.from_matrix([T0[:3, :3], T1[:3, :3]]))
    assert np.abs(T[:, :3, :3] - slerp(s).as_matrix()).max() < 1e-9


@given(st.integers(0, 10_000))
def test_a_circle_keeps_its_distance_and_plane(seed):
    rng = np.random.default_rng(seed)
    T0, centre, axis = random_pose(rng), rng.uniform(-1, 1, 3), rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    T = tool_circle(T0, centre, 3 * axis).poses(np.linspace(0, 1, 13))
    arms = T[:, :3, 3] - centre
    assert np.ptp(np.linalg.norm(arms, axis=1)) < 1e-12
    assert np.ptp(arms @ axis) < 1e-12
    assert np.abs(T[0] - T0).max() < 1e-12
    assert np.abs(T[-1] - T0).max() < 1e-12
    assert np.abs(T[:, :3, :3] - T0[:3, :3]).max() == 0
    turned = tool_circle(T0, centre, axis, np.pi / 2, turning=True).poses(np.array([1.0]))[0]
    assert (
        np.abs(
            turned[:3, :3] - Rotation.from_rotvec(axis * np.pi / 2).as_matrix() @ T0[:3, :3]
        ).max()
        < 1e-12
    )


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: tool_line(np.eye(3), np.eye(4)), r"T0 has shape \(3, 3\)"),
        (lambda: tool_line(np.eye(4), 2 * np.eye(4)), r"T1 is not a pose"),
        (lambda: tool_line([np.eye(4)], np.eye(4)), r"T0 has shape \(1, 4, 4\); expected \(4, 4\)"),
        (
            lambda: tool_circle(np.eye(4), [1, 0], [0, 0, 1]),
            r"centre has shape \(2,\); expected \(3,\)",
        ),
        (lambda: tool_circle(np.eye(4), [1, 0, 0], [0, 0, 0]), r"axis has length 0"),
        (lambda: tool_circle(np.eye(4), [0, 0, 1], [0, 0, 1]), r"T0 lies on the axis"),
        (lambda: tool_circle(np.eye(4), [1, 0, 0], [0, 0, 1], np.inf), r"angle is inf"),
    ],
)
def test_what_is_no_path_is_named(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call()
