"""Gaps in closed form against coal, and planes against the shapes that they separate."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acceptance import sample_size
from dhkit.description import library_robot
from dhkit.description.frames import world_to_frames
from dhkit.planning import Floor, Obstacle, distance
from dhkit.planning.obstacles import (
    Separation,
    link_capsules,
    link_pairs,
    pair_distances,
    shape_distances,
    smallest_distances,
    world_axes,
)
from dhkit.planning.obstacles.solids import nearest_on_box

TILTED = np.eye(4)
TILTED[:3, :3] = Rotation.from_rotvec([0.3, 0.5, -0.7]).as_matrix()
TILTED[:3, 3] = 0.3, -0.5, 0.4
SCENE = (
    Obstacle.sphere(0.1, (0.4, 0.2, 0.5)),
    Obstacle.box((0.1, 0.4, 0.2), TILTED),
    Obstacle.capsule(0.05, (0.1, 0.5, 0.1), (0.3, 0.5, 0.9)),
    Floor(-0.05),
    Obstacle.box((0.3, 0.2, 0.5), (-0.4, 0.3, 0.3)),
)


@pytest.fixture(scope="module")
def ur5():
    return library_robot("ur5")


def states(arm, count=300, seed=0):
    return np.random.default_rng(seed).uniform(-3, 3, (count, arm.n))


def or_of_shapes(arm, q, least):
    """Return the smaller of given distances and those of the links that are measured by their shapes, (N,), m."""
    return np.min(
        [least, *(shape_distances(arm, q, links) for links in link_pairs(arm).shapes)], axis=0
    )


def test_gaps_are_coals_distances(law, ur5):
    q = states(ur5, law.samples(3000))
    ours = or_of_shapes(ur5, q, Separation(ur5, SCENE, self_collision=True).smallest(q))
    theirs = distance(ur5, q, SCENE, self_collision=True).distance
    clear = theirs > 1e-6
    assert clear.any() and (~clear).any()
    law.holds("m beside coal, clear", np.abs(ours - theirs)[clear].max(), 1e-9, 0)
    law.holds("m above 0 in a collision", ours[~clear].max(), 1e-6, 0)


def test_gaps_far_away_may_be_left_out(ur5):
    q, separation = states(ur5), Separation(ur5, SCENE, self_collision=True)
    every, near = separation.gaps(q[:, None]), separation.gaps(q[:, None], 0.05)
    measured = np.isfinite(near.gap)
    assert np.all(every.gap[~measured] > 0.05)
    np.testing.assert_array_equal(near.gap[measured], every.gap[measured])
    assert 0.05 < measured.mean() < 0.9


def test_each_group_of_states_has_its_smallest_gap(ur5):
    q, separation = states(ur5, 60).reshape(12, 5, 6), Separation(ur5, SCENE)
    each = separation.gaps(q.reshape(60, 1, 6)).gap.reshape(12, 5, -1)
    np.testing.assert_allclose(separation.gaps(q).gap, each.min(axis=1), atol=1e-12)


def test_planes_have_the_obstacle_on_one_side_and_the_link_on_the_other(ur5):
    """Corners, ends and centres of solids, moved out by their radii, against the planes."""
    q, separation = states(ur5), Separation(ur5, SCENE, self_collision=True)
    gaps, axes, capsules = separation.gaps(q[:, None]), world_axes(ur5, q), link_capsules(ur5)
    for p, pair in enumerate(separation.pairs):
        clear = gaps.gap[:, p] > 1e-6
        n, level = gaps.normal[clear, p], gaps.level[clear, p]
        np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-12)
        # The plane touches the first link, in its frame, and the other is beyond.
        if pair.obstacle is None:
            frame = world_to_frames(ur5, q[clear])[:, capsules[pair.capsule].link]
            first, second = (
                np.einsum(
                    "kei,kij,kj->ke", axes[clear, i] - frame[:, None, :3, 3], frame[:, :3, :3], n
                )
                for i in (pair.capsule, pair.other)
            )
            np.testing.assert_allclose(
                first.max(axis=1) + capsules[pair.capsule].radius, level, atol=1e-9
            )
            beyond = second.min(axis=1) - capsules[pair.other].radius - level
            np.testing.assert_allclose(beyond, gaps.gap[clear, p], atol=1e-9)
            continue
        own = np.einsum("kei,ki->ke", axes[clear, pair.capsule], n)[:, list(pair.ends)]
        beyond = own.min(axis=1) - capsules[pair.capsule].radius - level
        np.testing.assert_allclose(beyond, gaps.gap[clear, p], atol=1e-9)
        if isinstance(SCENE[pair.obstacle], Obstacle):
            solid = SCENE[pair.obstacle]
            corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * solid.half_sizes
            world = corners @ solid.T_world_obstacle[:3, :3].T + solid.centre
            assert np.all((world @ n.T).max(axis=0) + solid.radius <= level + 1e-9)


def test_rows_hold_at_a_clear_state_by_their_gaps(ur5):
    separation = Separation(ur5, SCENE, self_collision=True)
    q = states(ur5, 2000)
    q = q[separation.smallest(q) > 0.03][:4]
    assert len(q) == 4
    for state in q:
        gaps = separation.gaps(np.repeat(state[None, None], 2, axis=0))
        rows = separation.rows(gaps, gaps.gap < 0.3, np.full(gaps.gap.shape, 0.03))
        frames = world_to_frames(ur5, state)
        for row in rows:
            T = (
                frames[row.link]
                if row.frame is None
                else np.linalg.solve(frames[row.frame], frames[row.link])
            )
            assert row.normal @ (T[:3, :3] @ row.point + T[:3, 3]) >= row.level - 1e-12
        assert {row.knot for row in rows} == {0, 1, 2}


@pytest.mark.slow
def test_nearest_points_of_segments_and_boxes():
    """Against a dense search along the segment; segments that cross the box, touch it, or are points."""
    rng = np.random.default_rng(1)
    axes, half = rng.uniform(-1, 1, (500, 2, 3)), np.array([0.3, 0.2, 0.0])
    axes[:50, 1] = axes[:50, 0]
    axes[50:100, 1, :2] = axes[50:100, 0, :2]  # parallel to an edge
    own, theirs = nearest_on_box(axes, np.eye(4), half)
    found = np.linalg.norm(own - theirs, axis=1)
    points = axes[:, :1] + np.linspace(0, 1, 20001)[:, None] * (axes[:, 1:] - axes[:, :1])
    truth = np.linalg.norm(points - np.clip(points, -half, half), axis=2).min(axis=1)
    assert np.all(found <= truth + 1e-12) and np.all(found >= truth - 1e-4)
    assert np.all(np.abs(theirs) <= half + 1e-15)


def test_floor_counts_only_ends_that_change_their_height(ur5):
    separation = Separation(ur5, [Floor(0.0)])
    assert all(pair.capsule > 0 for pair in separation.pairs)
    below = separation.smallest(np.array([[0, 1.2, 0, 0, 0, 0.0]]))
    assert below[0] < 0
    assert Separation(ur5, []).smallest(np.zeros((2, 6))).tolist() == [np.inf, np.inf]


def test_distances_of_single_pairs_are_those_of_all(ur5):
    q = states(ur5, 100)
    separation = Separation(ur5, SCENE, self_collision=True)
    each = np.stack([pair_distances(ur5, q, SCENE, pair) for pair in separation.pairs], axis=1)
    np.testing.assert_allclose(
        or_of_shapes(ur5, q, each.min(axis=1)),
        distance(ur5, q, SCENE, self_collision=True).distance,
        atol=1e-8,
    )
    left_out = separation.pairs[::2]
    rest = smallest_distances(ur5, q, SCENE, True, left_out)
    np.testing.assert_allclose(each[:, 1::2].min(axis=1), rest, atol=1e-8)


def heap(rng, count=60):
    """Overlapping solids of all kinds in a small place, with copies."""
    spread = lambda: np.array([0.5, 0.1, 0.5]) + rng.uniform(-0.2, 0.2, 3)  # noqa: E731
    items = []
    for _ in range(count // 3):
        first, tilted = spread(), np.eye(4)
        tilted[:3, :3], tilted[:3, 3] = Rotation.random(rng=rng).as_matrix(), spread()
        items += [
            Obstacle.sphere(rng.uniform(0.01, 0.08), spread()),
            Obstacle.box(rng.uniform(0.02, 0.2, 3), tilted),
            Obstacle.capsule(0.02, first, first + rng.uniform(-0.1, 0.1, 3)),
        ]
    return (*items, *items[:5], Floor(-0.1))


@pytest.mark.parametrize("itself", [False, True])
def test_the_smallest_distance_is_that_of_all_pairs(law, ur5, itself):
    scene, q = heap(np.random.default_rng(1)), states(ur5, law.samples(2000), 1)
    theirs = distance(ur5, q, scene, self_collision=itself).distance
    ours = smallest_distances(ur5, q, scene, itself, ())
    if itself:
        ours = or_of_shapes(ur5, q, ours)
    assert (theirs > 0.01).any() and (theirs < -0.01).any()
    law.holds(
        "m between the smallest and the smallest of all", np.abs(ours - theirs).max(), 1e-8, 0
    )


@pytest.mark.slow
def test_the_planes_that_are_kept_separate_all_solids(ur5):
    rng = np.random.default_rng(2)
    scene = heap(rng)
    separation = Separation(ur5, scene)
    q = states(ur5, 4000, 2)
    q = q[separation.smallest(q) > 0.02][:40]
    gaps = separation.gaps(q[:, None])
    active, margins = np.isfinite(gaps.gap), np.full(gaps.gap.shape, 0.01)
    rows = separation.rows(gaps, active, margins)
    needed = {(row.knot, row.link, tuple(row.point)) for row in rows}
    assert len(rows) < 0.3 * 2 * 2 * active.sum()
    tried = kept = 0
    for k, state in enumerate(q):
        mine = [row for row in rows if row.knot == k]
        assert {link for knot, link, _ in needed if knot == k} == {row.link for row in mine}
        near = state + rng.uniform(-0.3, 0.3, (sample_size(300, quick=100), 6))
        frames = world_to_frames(ur5, near)
        clear = np.ones(len(near), dtype=bool)
        for row in mine:
            x = frames[:, row.link, :3, :3] @ row.point + frames[:, row.link, :3, 3]
            clear &= x @ row.normal >= row.level
        tried += len(near)
        kept += clear.sum()
        assert np.all(separation.smallest(near[clear]) >= 0.01 - 1e-8)
    assert 0.05 < kept / tried < 0.95


def test_copies_add_no_planes(ur5):
    q = states(ur5, 200, 3)
    once, thrice = Separation(ur5, SCENE), Separation(ur5, SCENE[:3] * 4 + SCENE[3:])
    q = q[once.smallest(q) > 0.02]

    def rows(separation):
        gaps = separation.gaps(q[:, None])
        return len(separation.rows(gaps, gaps.gap < 0.3, np.full(gaps.gap.shape, 0.01)))

    assert rows(once) == rows(thrice)
