"""The nearest links of an arm: beside the distances of all checked pairs."""

from itertools import product

import numpy as np
import pytest

from acceptance import different_robots_first, slow_if
from dhkit import robots
from dhkit.description import library_robot
from dhkit.planning.obstacles import link_capsules, link_pairs, may_touch, nearest_links, shape_distances

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
    states = np.random.default_rng(0).uniform(lower, upper, (law.samples(1000, quick=6), description.n))
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
