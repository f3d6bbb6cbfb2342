"""Exact distances against closed forms, a quadratic program, and laws."""

import builtins
from itertools import product

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from dhkit.description import library_robot, pose
from dhkit.errors import ModelError
from dhkit.planning.obstacles import (
    Floor,
    Obstacle,
    checked_pairs,
    distance,
    link_capsules,
    link_pairs,
    shape_distances,
    world_axes,
)
from dhkit.planning.obstacles.scene import Solids
from dhkit.planning.obstacles.solids import (
    axis_bounds,
    capsule_distances,
    obstacle_distances,
    segment_distances,
)

COAL = 1e-7
"""m: coal's iterations stop at 1e-9 of a bound, not of the distance."""
ROUNDING = 1e-12
ROBOTS = ("puma560", "ur5", "panda", "cobra600", "planar3r")
SCENE = (
    Obstacle.box((0.4, 0.3, 0.5), pose((0.6, 0.1, 0.4), euler=(0.3, 0.2, 0.5)), name="crate"),
    Obstacle.sphere(0.15, (-0.3, 0.5, 0.5), name="ball"),
    Floor(0.05),
    Obstacle.capsule(0.05, (0.3, -0.5, 0), (0.3, -0.5, 1), name="post"),
)


def states(arm, count=40, seed=0):
    return np.random.default_rng(seed).uniform(-2, 2, (count, arm.n))


def by_sampling(first, second):
    """Distance of two segments from 200 x 200 pairs of their points, and half a step's length."""
    share = np.linspace(0, 1, 200)[:, None]
    p, q = (s[0] + share * (s[1] - s[0]) for s in (first, second))
    step = sum(np.linalg.norm(s[1] - s[0]) for s in (first, second)) / 2 / 199
    return np.linalg.norm(p[:, None] - q[None], axis=-1).min(), step


def box_distance(axis, obstacle):
    """Distance of a segment from a box by a bounded least squares problem in the share and a point of the box."""
    T = obstacle.T_world_obstacle
    start, end = (axis - T[:3, 3]) @ T[:3, :3]
    A = np.column_stack([end - start, -np.eye(3)])
    bounds = ([0, *-obstacle.half_sizes], [1, *obstacle.half_sizes])
    return np.sqrt(2 * lsq_linear(A, -start, bounds, method="bvls", tol=1e-15).cost)


def test_segments_against_sampling():
    rng = np.random.default_rng(0)
    pairs = rng.uniform(-1, 1, (60, 2, 2, 3))
    pairs[:10, 1, 1] = pairs[:10, 1, 0]  # points
    # Parallel.
    pairs[10:20, 1, 1] = pairs[10:20, 1, 0] + 0.7 * (pairs[10:20, 0, 1] - pairs[10:20, 0, 0])
    pairs[20:25, 1] = pairs[20:25, 0]  # one and the same
    for first, second in pairs:
        sampled, step = by_sampling(first, second)
        exact = segment_distances(first, second)
        assert exact <= sampled + ROUNDING and exact >= sampled - step
        assert abs(segment_distances(second, first) - exact) < 1e-8


def test_coal_agrees_with_the_closed_form_of_capsules():
    rng = np.random.default_rng(1)
    axes = rng.uniform(-0.5, 0.5, (200, 2, 3))
    axes[:, 1] = (
        axes[:, 0]
        + 0.4
        * (axes[:, 1] - axes[:, 0])
        / np.linalg.norm(np.diff(axes, axis=1)[:, 0], axis=1)[:, None]
    )
    for obstacle in (SCENE[1], SCENE[3]):
        closed = segment_distances(axes, obstacle.axis) - obstacle.radius - 0.07
        assert np.abs(obstacle_distances(0.07, axes, obstacle) - closed).max() < COAL
    others = axes[::-1]
    closed = segment_distances(axes, others) - 0.12
    assert np.abs(capsule_distances((0.07, 0.05), axes, others) - closed).max() < COAL


def test_coal_agrees_with_a_quadratic_program_about_boxes():
    rng = np.random.default_rng(2)
    crate, checked = SCENE[0], 0
    for _ in range(150):
        axis = crate.centre + rng.uniform(-0.6, 0.6, (2, 3))
        expected = box_distance(axis, crate)
        found = obstacle_distances(0.05, axis[None], crate)[0]
        if expected < 1e-6:  # the axis is in the box: deeper than any of its points
            assert found < -0.05 + COAL
            continue
        checked += 1
        assert abs(found - (expected - 0.05)) < COAL
    assert checked > 50


def test_penetration_is_how_far_to_move_out():
    crate = Obstacle.box((0.4, 0.4, 0.4), (0, 0, 0))
    axis = np.array([[(0.15, -0.1, 0), (0.15, 0.1, 0)]])
    assert abs(obstacle_distances(0.05, axis, crate)[0] - (-0.05 - 0.05)) < COAL


def test_bounds_bound():
    rng = np.random.default_rng(3)
    axes = rng.uniform(-1, 1, (300, 2, 3))
    axes[:, 1] = (
        axes[:, 0]
        + 0.5
        * (axes[:, 1] - axes[:, 0])
        / np.linalg.norm(np.diff(axes, axis=1)[:, 0], axis=1)[:, None]
    )
    for obstacle in (SCENE[0], SCENE[1], SCENE[3]):
        low, high = axis_bounds(Solids.of([obstacle] * len(axes)), axes)
        exact = obstacle_distances(0.01, axes, obstacle) + 0.01
        assert np.all(low <= exact + COAL) and np.all(exact <= high + COAL)


@pytest.mark.parametrize("name", ROBOTS)
def test_nothing_near_is_skipped(name):
    arm = library_robot(name)
    capsules, pairs, q = link_capsules(arm), checked_pairs(arm), states(arm)
    axes = world_axes(arm, q)
    found = distance(arm, q, SCENE, self_collision=True)
    for k, obstacle in enumerate(SCENE):
        if isinstance(obstacle, Floor):
            continue
        every = [obstacle_distances(capsules[i].radius, axes[:, i], obstacle) for i in pairs.moving]
        assert np.abs(found.per_obstacle[:, k] - np.min(every, axis=0)).max() < COAL
    every = [
        capsule_distances((capsules[i].radius, capsules[j].radius), axes[:, i], axes[:, j])
        for i, j in link_pairs(arm).capsules
    ]
    every += [shape_distances(arm, q, links) for links in link_pairs(arm).shapes]
    assert np.abs(found.itself - np.min(every, axis=0)).max() < COAL
    assert np.array_equal(found.distance, np.minimum(found.per_obstacle.min(axis=-1), found.itself))


def test_the_floor_is_coals_half_space():
    import coal

    arm = library_robot("puma560")
    q, capsules = states(arm), link_capsules(arm)
    found = distance(arm, q, [Floor(0.05)]).per_obstacle[:, 0]
    ground = coal.Halfspace(np.array([0, 0, 1.0]), 0.05)
    ends, expected = world_axes(arm, q), np.full(len(q), np.inf)
    for (i, end), k in product(checked_pairs(arm).heights, range(len(q))):
        place = coal.Transform3s(np.eye(3), ends[k, i, end])
        result = coal.DistanceResult()
        gap = coal.distance(
            coal.Sphere(capsules[i].radius),
            place,
            ground,
            coal.Transform3s(),
            coal.DistanceRequest(),
            result,
        )
        expected[k] = min(expected[k], gap)
    assert np.abs(found - expected).max() < COAL


def test_the_worst_pair_has_names():
    arm = library_robot("puma560")
    found = distance(arm, states(arm), SCENE, self_collision=True)
    link, other = found.pair
    assert link.startswith("link ") and other in {"crate", "ball", "post", "floor"}
    assert (
        distance(arm, np.zeros(6), [Obstacle.sphere(0.1, (9, 9, 9), name="far")]).pair[1] == "far"
    )


def test_nan_stays_in_its_row():
    arm = library_robot("puma560")
    q = states(arm, 6).reshape(2, 3, 6)
    clean = distance(arm, q, SCENE, self_collision=True)
    q[1, 0, 3], q[0, 2, 0] = np.nan, np.inf
    found = distance(arm, q, SCENE, self_collision=True)
    bad = np.array([[False, False, True], [True, False, False]])
    for got, want in (
        (found.distance, clean.distance),
        (found.per_obstacle, clean.per_obstacle),
        (found.itself, clean.itself),
    ):
        assert np.isnan(got[bad]).all() and np.array_equal(got[~bad], want[~bad])


def test_shapes_and_nothing_to_check():
    arm = library_robot("puma560")
    free = distance(arm, np.zeros((2, 6)))
    assert free.distance.shape == (2,) and np.isinf(free.distance).all()
    assert free.per_obstacle.shape == (2, 0) and free.pair is None
    assert distance(arm, np.zeros(6), SCENE).per_obstacle.shape == (4,)
    assert distance(arm, np.zeros((0, 6)), SCENE).per_obstacle.shape == (0, 4)
    with pytest.raises(ValueError, match=r"expected \(..., 6\)"):
        distance(arm, np.zeros(5), SCENE)


def test_the_foot_of_an_arm_may_stand_on_the_floor():
    ready = np.array([0, -np.pi / 2, 0, -np.pi / 2, 0, 0])
    assert distance(library_robot("ur5"), ready, [Floor()]).distance > 0.3


def test_without_coal_it_says_so(monkeypatch):
    real = builtins.__import__

    def missing(name, *args, **kwargs):
        if name == "coal":
            raise ImportError("No module named 'coal'")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(ModelError, match="pip install pin"):
        distance(library_robot("puma560"), np.zeros(6), SCENE[:1])
