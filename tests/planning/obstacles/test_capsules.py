"""Capsules contain what a link looks like, and are few and small."""

from collections import Counter
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import trimesh

from acceptance import different_robots_first
from dhkit.description import Box, Capsule, Cylinder, Sphere, library_robot, robots
from dhkit.description.table_rows import from_dh
from dhkit.model.shapes import link_parts
from dhkit.planning.obstacles import checked_pairs, link_capsules, link_pairs, world_axes
from dhkit.planning.obstacles.capsules import Balls, enclose, refine
from dhkit.planning.obstacles.solids import capsule_distances

OUTSIDE = 1e-9
"""m: rounding, and of a mesh's single precision."""


def surface(part):
    """Points on a part in its link's frame, drawn without the code under test."""
    rng = np.random.default_rng(0)
    u = rng.normal(size=(400, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    match part.geometry:
        case Sphere(radius):
            local = float(radius) * u
        case Capsule(radius, length):
            local = float(radius) * u + np.sign(u[:, 2:]) * [0, 0, float(length) / 2]
        case Cylinder(radius, length):
            rim = u[:, :2] / np.linalg.norm(u[:, :2], axis=1, keepdims=True) * float(radius)
            local = np.column_stack([rim, np.sign(u[:, 2]) * float(length) / 2])
        case Box(size):
            local = np.sign(u) * [float(edge) / 2 for edge in size]
        case _:
            local = trimesh.load_mesh(part.file).vertices * [
                float(factor) for factor in part.geometry.scale
            ]
    return local @ part.T_link_part[:3, :3].T + part.T_link_part[:3, 3]


def depth(capsule, points):
    """How deep points are in a capsule, m: along and across its axis."""
    along = capsule.end - capsule.start
    share = np.clip((points - capsule.start) @ along / max(along @ along, 1e-30), 0, 1)
    return capsule.radius - np.linalg.norm(points - capsule.start - share[:, None] * along, axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", robots())
def test_every_part_lies_in_its_links_capsules(name):
    arm = library_robot(name)
    capsules = link_capsules(arm)
    for part in link_parts(arm):
        points = surface(part)
        # Convex parts are in one capsule if their surface is.
        best = max(
            depth(capsule, points).min() for capsule in capsules if capsule.link == part.link
        )
        assert best > -OUTSIDE


@pytest.mark.slow
@pytest.mark.parametrize("name", robots())
def test_a_link_has_one_or_two_capsules(name):
    arm = library_robot(name)
    counts = Counter(capsule.link for capsule in link_capsules(arm))
    assert set(counts) == set(range(arm.n + 1))
    assert max(counts.values()) <= 2
    assert link_capsules(arm) is link_capsules(library_robot(name))


def test_a_capsules_own_capsule_is_itself():
    bar = Balls(np.array([(0.1, 0.2, 0.3), (0.5, -0.1, 0.9)]), np.array([0.05, 0.05]))
    found = refine(bar)
    assert abs(found.radius - 0.05) < OUTSIDE
    assert (
        abs(np.linalg.norm(found.end - found.start) - np.linalg.norm(np.diff(bar.centres, axis=0)))
        < OUTSIDE
    )


def test_capsules_are_not_much_larger_than_what_they_enclose():
    rng = np.random.default_rng(0)
    for _ in range(5):
        points = rng.uniform(-1, 1, (200, 3)) * (0.05, 0.08, 0.4)
        balls = Balls(points, np.zeros(200))
        assert refine(balls).volume <= enclose(balls).volume
        assert enclose(balls).volume < 3 * 0.1 * 0.16 * 0.8


def test_axes_move_with_their_frames():
    arm = library_robot("ur5")
    q = np.random.default_rng(1).uniform(-3, 3, (2, 3, 6))
    axes = world_axes(arm, q)
    capsules = link_capsules(arm)
    assert axes.shape == (2, 3, len(capsules), 2, 3)
    lengths = np.linalg.norm(np.diff(axes, axis=-2), axis=-1)[..., 0]
    assert np.abs(lengths - [capsule.length for capsule in capsules]).max() < OUTSIDE
    assert np.isnan(world_axes(arm, [np.nan, 0, 0, 0, 0, 0])).all()


@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_what_cannot_move_is_not_checked(name):
    arm = library_robot(name)
    capsules, pairs = link_capsules(arm), checked_pairs(arm)
    assert all(capsules[i].link > 0 for i in pairs.moving)
    assert {i for i, _ in pairs.heights} <= set(pairs.moving)


@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_every_two_links_that_no_joint_connects_are_checked_or_named(name):
    """Or their capsules are apart in all configurations, by coal: no motion changes their distance by 1 mm."""
    arm = library_robot(name)
    capsules, pairs = link_capsules(arm), link_pairs(arm)
    assert not set(pairs.shapes) & set(pairs.unchecked)
    axes = world_axes(arm, np.random.default_rng(1).uniform(-np.pi, np.pi, (300, arm.n)))
    for i, j in combinations(range(len(capsules)), 2):
        bodies = capsules[i].body, capsules[j].body
        are_connected = bodies[1].link - bodies[0].link <= 1
        if are_connected or bodies in {*pairs.shapes, *pairs.unchecked} or (i, j) in pairs.capsules:
            continue
        gaps = capsule_distances((capsules[i].radius, capsules[j].radius), axes[:, i], axes[:, j])
        assert gaps.min() > 0 and np.ptp(gaps) < 1.1e-3


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_pairs_do_not_depend_on_the_size_of_an_arm(size):
    arm = from_dh(
        [(0, 0.1 * size, 0.4 * size, "pi/2"), (0, 0, 0.4 * size, 0), (0, 0, 0.3 * size, 0)]
    )
    same = link_pairs(from_dh([(0, 0.1, 0.4, "pi/2"), (0, 0, 0.4, 0), (0, 0, 0.3, 0)]))
    pairs = link_pairs(arm)
    assert replace(pairs, steady=()) == replace(same, steady=()) and same.capsules
    assert [pair.distance / size for pair in pairs.steady] == pytest.approx(
        [pair.distance for pair in same.steady]
    )


def test_a_planar_arm_does_not_care_for_the_floor():
    assert checked_pairs(library_robot("planar3r")).heights == ()
