"""The nearest links of an arm: beside the distances of all checked pairs."""

from itertools import product

import numpy as np
import pytest

from acceptance import different_robots_first, slow_if
from dhkit import robots
from dhkit.description import library_robot
from dhkit.planning.obstacles import (
    Floor,
    Obstacle,
    link_capsules,
    link_pairs,
    may_touch,
    nearest_links,
    nearest_obstacle,
    shape_distances,
    world_axes,
)
from dhkit.planning.obstacles.solids import obstacle_distances

pytest.importorskip("coal")


def checked_bodies(description):
    """The bodies of links whose shapes are measured."""
    capsules, pairs = link_capsules(description), link_pairs(description)
    bodies = {(capsules[i].body, capsules[j].body) for i, j in pairs.capsules} | set(pairs.shapes)
    return bodies - set(pairs.unchecked)


@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_it_is_the_smallest_distance_of_all_checked_pairs(name, law):
    description = library_robot(name)
    bodies = checked_bodies(description)
    numbers = description.numbers
    bound = np.where(numbers.prismatic, 1.0, np.pi)
    lower, upper = np.maximum(numbers.lower, -bound), np.minimum(numbers.upper, bound)
    states = np.random.default_rng(0).uniform(
        lower, upper, (law.samples(1000, quick=6), description.n)
    )
    for q in states:
        found = nearest_links(description, q)
        if not bodies:
            assert found is None
            continue
        every = {pair: shape_distances(description, q[None], pair)[0] for pair in bodies}
        law.holds("m to the smallest distance", abs(found.distance - min(every.values())), 1e-9)
        between = np.linalg.norm(found.points[0] - found.points[1])
        law.holds("m of the points' distance to it", abs(between - abs(found.distance)), 1e-6)


@pytest.mark.parametrize("name", ["puma560", slow_if(True, "panda")])
def test_links_that_touch_have_capsules_that_do(name):
    """Capsules contain the shapes: where shapes touch, ``may_touch`` names two links, perhaps others."""
    description = library_robot(name)
    states = np.random.default_rng(1).uniform(-2.5, 2.5, (40, description.n))
    touching = [q for q in states if nearest_links(description, q).distance < 0]
    assert touching
    assert all(may_touch(description, q) is not None for q in touching)


def test_an_arm_without_pairs_has_no_nearest_links():
    description = library_robot("cart_pendulum")
    assert not checked_bodies(description)
    assert all(nearest_links(description, q) is None for q in product((-1.0, 1.0), repeat=2))


@pytest.mark.parametrize(
    "name", different_robots_first(["puma560", "panda", "stanford", "cobra600"])
)
def test_the_points_of_a_link_and_an_obstacle_are_on_both_and_no_nearer_than_capsules(name, law):
    description = library_robot(name)
    reach = description.reach
    rng = np.random.default_rng(3)
    numbers = description.numbers
    bound = np.where(numbers.prismatic, 0.3, 2.5)
    for _ in range(law.samples(200, quick=5)):
        q = np.clip(rng.uniform(-bound, bound), numbers.lower, numbers.upper)
        centre = rng.uniform(-reach, reach, 3)
        ball = Obstacle.sphere(0.1 * reach, centre, name="ball")
        box = Obstacle.box((0.2 * reach, 0.1 * reach, 0.3 * reach), centre, name="box")
        for obstacle in (ball, box):
            found = nearest_obstacle(description, q, [obstacle])
            own, other = found.points
            gap = np.linalg.norm(own - other)
            law.holds("m of the points' distance to it", abs(gap - abs(found.distance)), 1e-6)
            # The capsules contain the shapes: their distance is at most that of the shapes.
            assert found.distance >= capsule_distance(description, q, obstacle, found.link) - 1e-6
            # The point of the obstacle lies on its surface.
            law.holds("m of the point to the surface", abs(outside(obstacle, other)), 1e-6)


def capsule_distance(description, q, obstacle, body):
    """Distance of the capsules of a body from an obstacle, m."""
    capsules = link_capsules(description)
    axes = world_axes(description, q[None])
    own = [i for i, capsule in enumerate(capsules) if capsule.body == body]
    return min(obstacle_distances(capsules[i].radius, axes[:, i], obstacle)[0] for i in own)


def outside(obstacle, point):
    """Signed distance of a point from a ball or a box whose edges lie along the axes, m."""
    excess = np.abs(point - obstacle.centre) - obstacle.half_sizes
    return np.linalg.norm(np.maximum(excess, 0)) + min(excess.max(), 0) - obstacle.radius


def test_a_floor_is_as_near_as_the_lowest_point():
    description = library_robot("puma560")
    q = [0.3, 0.9, -2.0, 0.2, 0.4, 0.0]
    low, high = (nearest_obstacle(description, q, [Floor(height)]) for height in (-2.0, -0.5))
    assert low.distance == pytest.approx(high.distance + 1.5, abs=1e-9)
    assert low.points[0][2] == pytest.approx(low.distance - 2.0, abs=1e-9)
    assert nearest_obstacle(description, q, []) is None


def test_the_nearest_of_several_obstacles_is_that_of_each_alone():
    description = library_robot("puma560")
    rng = np.random.default_rng(5)
    scene = [Obstacle.sphere(0.05, rng.uniform(-1, 1, 3), name=f"ball {k}") for k in range(6)] + [
        Floor(-0.7)
    ]
    for q in rng.uniform(-2, 2, (5, 6)):
        alone = [nearest_obstacle(description, q, [obstacle]) for obstacle in scene]
        least = min(alone, key=lambda found: found.distance)
        found = nearest_obstacle(description, q, scene)
        assert (found.obstacle, found.link) == (least.obstacle, least.link)
        assert found.distance == pytest.approx(least.distance, abs=1e-12)
