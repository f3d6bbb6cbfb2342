"""Obstacles as users write them."""

import pickle

import numpy as np
import pytest

from dhkit.description import Box, Capsule, Sphere, pose
from dhkit.planning.obstacles import Floor, Obstacle, check_obstacles

ROUNDING = 1e-15


def test_a_box_stands_where_its_pose_says():
    T = pose((0.4, 0.1, 0.2), euler=(0, 90, 0), degrees=True)
    table = Obstacle.box((0.6, 0.4, 0.05), at=T, name="table")
    assert isinstance(table.geometry, Box)
    assert np.array_equal(table.T_world_obstacle, T)
    assert np.array_equal(table.half_sizes, (0.3, 0.2, 0.025))
    assert table.name == "table" and table.radius == 0
    assert np.array_equal(Obstacle.box((1, 1, 1), at=(1, 2, 3)).T_world_obstacle, pose((1, 2, 3)))


@pytest.mark.parametrize(
    "end", [(0.3, 0.1, 0.9), (0.3, 0.1, -0.9), (1.0, 0.1, 0.2), (-2.0, 5.0, 0.7)]
)
def test_a_capsule_goes_from_start_to_end(end):
    bar = Obstacle.capsule(0.05, (0.3, 0.1, 0.2), end)
    assert isinstance(bar.geometry, Capsule)
    assert np.abs(bar.axis - [(0.3, 0.1, 0.2), end]).max() < 5 * ROUNDING
    R = bar.T_world_obstacle[:3, :3]
    assert np.abs(R @ R.T - np.eye(3)).max() < ROUNDING and np.linalg.det(R) > 0


def test_a_sphere_is_an_axis_without_length():
    ball = Obstacle.sphere(0.1, (1, 2, 3))
    assert isinstance(ball.geometry, Sphere)
    assert np.array_equal(ball.axis, [(1, 2, 3), (1, 2, 3)])


def test_obstacles_are_values():
    ball, twin = Obstacle.sphere(0.1, (1, 2, 3)), Obstacle.sphere(0.1, (1, 2, 3))
    assert ball == twin and hash(ball) == hash(twin) and pickle.loads(pickle.dumps(ball)) == ball
    assert ball != Obstacle.sphere(0.1, (1, 2, 3.5)) and Floor(0.1) == Floor(0.1)
    with pytest.raises(ValueError, match="read-only"):
        ball.T_world_obstacle[0, 0] = 2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Obstacle.box((1, 2), (0, 0, 0)),
            r"box: size is \(1.0, 2.0\); expected three positive numbers, m",
        ),
        (lambda: Obstacle.box((1, -2, 1), (0, 0, 0)), "expected three positive numbers"),
        (lambda: Obstacle.box((1, 2, np.inf), (0, 0, 0)), "expected three positive numbers"),
        (lambda: Obstacle.box((1, 1, 1), (0, 0)), r"box: at is of shape \(2,\); expected a pose"),
        (lambda: Obstacle.box((1, 1, 1), 2 * np.eye(4)), "box: at is not a pose"),
        (lambda: Obstacle.box((1, 1, 1), np.full((4, 4), np.nan)), "expected a pose"),
        (
            lambda: Obstacle.sphere(0, (0, 0, 0)),
            "sphere: radius is 0.0; expected a positive number, m",
        ),
        (lambda: Obstacle.sphere((1, 2), (0, 0, 0)), "expected a positive number"),
        (
            lambda: Obstacle.sphere(1, (0, 0, np.nan)),
            "sphere: centre is .*; expected a finite position",
        ),
        (lambda: Obstacle.capsule(1, (0, 0, 0), (0, 0, 0)), "expected two points"),
        (lambda: Obstacle.sphere(1, (0, 0, 0), name=""), "name is empty"),
        (lambda: Floor(np.nan), "floor: height is nan; expected a finite number, m"),
        (lambda: check_obstacles([Floor(), Floor(1.0)]), "found 2 floors"),
    ],
)
def test_bad_values_say_what_is_expected(make, message):
    with pytest.raises(ValueError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_what_is_no_obstacle_is_refused():
    with pytest.raises(TypeError, match="found str; expected Obstacle or Floor"):
        check_obstacles(["table"])
    with pytest.raises(TypeError, match="expected a list"):
        check_obstacles(Floor())
    with pytest.raises(TypeError, match="expected numbers"):
        Obstacle.sphere("big", (0, 0, 0))
