"""Smooth distances against exact ones, and their gradients wherever an optimizer may get."""

from functools import cache
from itertools import pairwise

import casadi
import numpy as np
import pytest

from dhkit.description import library_robot, pose
from dhkit.planning.obstacles import Floor, Obstacle, SceneSlots, checked_pairs, clearances, distance, world_axes
from dhkit.planning.obstacles.smooth import _Axis, _between, _signed_distance

SHORT = 0.012
"""m: what a smooth value of 1 may hide: 10 mm between points for a box (SAG) and 2 mm of bends; 5.5 were seen."""
TIMID = 0.001
"""m: what a smooth value below 1 may claim too much: a box's bends; squared distances of segments none at all."""
ROUNDING = 1e-9
ROBOTS = ("puma560", "ur5", "panda", "cobra600", "planar3r")
FAR = (0.0, 0.0, -50.0)


@cache
def smooth(name, slots):
    """Values and Jacobian of an arm's clearances as one function of q and parameters."""
    q, p = casadi.SX.sym("q", library_robot(name).n), casadi.SX.sym("p", slots.size)
    g = clearances(library_robot(name), q, p, slots)
    return casadi.Function(
        "clearances", [q, p], [casadi.densify(g), casadi.densify(casadi.jacobian(g, q))], {"cse": True}
    )


def values(name, slots, q, parameters):
    """Smooth clearances, shape (N, k)."""
    found = smooth(name, slots).map(len(q))(q.T, np.repeat(parameters[:, None], len(q), axis=1))
    return np.asarray(found[0]).T


def states(name, count, seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, library_robot(name).n)) * (
        0.2 if name == "cobra600" else 1
    )


def obstacles(kind, rng, count):
    """Obstacles of a kind where arms of a metre's reach may touch them."""
    for _ in range(count):
        direction = rng.normal(size=3)
        at = direction / np.linalg.norm(direction) * rng.uniform(0.3, 1.0) + (0, 0, 0.3)
        match kind:
            case "sphere":
                yield Obstacle.sphere(rng.uniform(0.02, 0.2), at)
            case "capsule":
                yield Obstacle.capsule(rng.uniform(0.02, 0.1), at, at + rng.uniform(-0.4, 0.4, 3))
            case "box":
                yield Obstacle.box(rng.uniform(0.05, 0.8, 3), pose(at, euler=rng.uniform(-3, 3, 3)))
            case "floor":
                yield Floor(rng.uniform(-0.2, 0.5))


@pytest.mark.parametrize("kind", ["sphere", "capsule", "box", "floor"])
@pytest.mark.parametrize("name", ROBOTS)
def test_one_means_clear(name, kind):
    """A value of at least 1 means a clearance, but for SHORT; one below means less, but for TIMID."""
    arm, clearance, q = library_robot(name), 0.03, states(name, 400)
    for obstacle in obstacles(kind, np.random.default_rng(1), 8):
        slots = SceneSlots.of([obstacle])
        if not smooth(name, slots).size1_out(0):  # a planar arm and a floor
            continue
        found = values(name, slots, q, slots.values([obstacle], clearance)).min(axis=1)
        exact = distance(arm, q, [obstacle]).distance
        assert np.all(exact[found >= 1] > clearance - SHORT)
        assert np.all(exact[found < 1] < clearance + (TIMID if kind == "box" else ROUNDING))


@pytest.mark.parametrize("name", ["puma560", "ur5", "planar3r"])
def test_one_means_clear_of_itself(name):
    arm, slots, q = library_robot(name), SceneSlots(self_collision=True), states(name, 3000)
    found = values(name, slots, q, slots.values([], 0.01)).min(axis=1)
    exact = distance(arm, q, self_collision=True).itself
    assert np.all(exact[found >= 1] > 0.01 - SHORT)
    assert np.all(exact[found < 1] < 0.01 + ROUNDING)


@pytest.mark.parametrize("kind", ["sphere", "capsule", "box", "floor"])
def test_more_clearance_or_inflation_is_less_clear(kind):
    q = states("puma560", 100)
    (obstacle,) = obstacles(kind, np.random.default_rng(2), 1)
    slots = SceneSlots.of([obstacle])
    rising = [values("puma560", slots, q, slots.values([obstacle], c)) for c in (0.0, 0.01, 0.05)]
    inflated = values("puma560", slots, q, slots.values([obstacle], 0.01, [0.04]))
    for wide, narrow in pairwise(rising):
        assert np.all((narrow < wide) | (wide <= 0))
    assert np.abs(inflated - rising[-1]).max() < ROUNDING * np.abs(inflated).max()


@pytest.mark.parametrize("name", ["puma560", "panda"])
def test_derivatives_are_finite_wherever_obstacles_are(name):
    """Around every link and inside it: an arm's own frames are where its obstacles are put."""
    slots, q = SceneSlots(2, 2, True, True), states(name, 30)
    f = smooth(name, slots)
    axes = world_axes(library_robot(name), q)
    for k, state in enumerate(q):
        start, end = axes[k, -1 - k % 5]
        scene = [
            Obstacle.box((0.3, 0.2, 0.1), pose((start + end) / 2)),
            Obstacle.sphere(0.1, start),
            Obstacle.capsule(0.1, start, end if np.linalg.norm(end - start) > 0.01 else end + np.array([0, 0, 0.1])),
            Floor(start[2]),
        ]
        value, slope = (np.asarray(x) for x in f(state, slots.values(scene, 0.02, 0.01)))
        assert np.isfinite(value).all() and np.isfinite(slope).all()


def test_segments_parallel_crossing_and_coincident():
    """The smooth distance of two segments is the closed form's but for its bends, with a gradient everywhere."""
    x = casadi.SX.sym("x", 12)

    def axis(start, end):
        along = end - start
        return _Axis(start, along, casadi.sumsqr(along), 0.5)

    g = _between(axis(x[0:3], x[3:6]), axis(x[6:9], x[9:12]), 0.0)
    f = casadi.Function("f", [x], [g, casadi.jacobian(g, x), casadi.hessian(g, x)[0]])
    cases = {
        "parallel": ([0, 0, 0, 1, 0, 0, 0.2, 0.3, 0, 0.8, 0.3, 0], 0.09),
        "parallel, one behind the other": ([0, 0, 0, 1, 0, 0, 1.5, 0, 0, 2, 0, 0], 0.25),
        "crossing": ([-1, 0, 0, 1, 0, 0, 0, -1, 0.4, 0, 1, 0.4], 0.16),
        "intersecting": ([-1, 0, 0, 1, 0, 0, 0, -1, 0, 0, 1, 0], 0.0),
        "coincident": ([0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0], 0.0),
        "two points": ([0, 0, 0, 0, 0, 0, 0.3, 0, 0, 0.3, 0, 0], 0.09),
        "one point": ([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], 0.0),
    }
    for name, (ends, square) in cases.items():
        value, slope, curvature = (np.asarray(y) for y in f(ends))
        assert np.isfinite(slope).all() and np.isfinite(curvature).all(), name
        assert square - ROUNDING <= value[0, 0] < (np.sqrt(square) + 0.011) ** 2, name  # CLAMP of 1 m, at both ends


def test_a_boxes_distance_leads_out_from_inside():
    x = casadi.SX.sym("x", 3)
    g = _signed_distance(x, casadi.DM([0.3, 0.2, 0.05]))
    f = casadi.Function("f", [x], [g, casadi.gradient(g, x)])
    rng = np.random.default_rng(0)
    for point in rng.uniform(-1, 1, (300, 3)) * (0.3, 0.2, 0.05):
        value, slope = (np.asarray(y).ravel() for y in f(point))
        beyond = np.abs(point) - (0.3, 0.2, 0.05)
        assert abs(value[0] - beyond.max()) < 0.02  # EDGE, at an edge and at a corner
        if np.abs(point[2]) > 0.01:
            assert np.linalg.norm(slope) > 0.4 and slope @ point > 0
    centre = [np.asarray(y) for y in f([0, 0, 0])]
    assert np.isfinite(centre[0]).all() and np.isfinite(centre[1]).all()
    for point in rng.uniform(-1, 1, (300, 3)):
        beyond = np.maximum(np.abs(point) - (0.3, 0.2, 0.05), 0)
        exact = np.linalg.norm(beyond)
        if exact > 0.05:
            assert -0.0005 < float(f(point)[0]) - exact < 0.002


def test_unused_slots_are_clear():
    slots = SceneSlots(3, 2, True, True)
    few = [Obstacle.sphere(0.1, (0.5, 0, 0.5))]
    q = states("puma560", 20)
    found = values("puma560", slots, q, slots.values(few, 0.02))
    moving = len(checked_pairs(library_robot("puma560")).moving)
    alone = values("puma560", SceneSlots(1), q, SceneSlots(1).values(few, 0.02))
    assert np.abs(found[:, :moving] - alone).max() < ROUNDING * alone.max()
    itself = len(checked_pairs(library_robot("puma560")).near)
    assert np.all(found[:, moving:-itself] > 100)


def test_order_of_inflations_is_that_of_the_scene():
    scene = [Obstacle.box((1, 1, 1), (2, 0, 0)), Floor(0.1), Obstacle.sphere(0.1, (1, 0, 0))]
    slots = SceneSlots.of(scene, self_collision=True)
    assert slots == SceneSlots(1, 1, True, True)
    p = slots.values(scene, 0.5, [1, 2, 3, 4])
    assert p.shape == (slots.size,) == (26,)
    assert (p[6], p[22], p[23], p[24], p[25]) == (3.6, 1.5, 0.1, 2.5, 4.5)
    assert slots.values(scene, 0.5, [1, 2, 3])[25] == 0.5


def test_what_does_not_fit_is_refused():
    slots = SceneSlots(1)
    assert slots.fits([]) and slots.fits([Obstacle.sphere(1, FAR)]) and not slots.fits([Floor()])
    with pytest.raises(ValueError, match="there is room for"):
        slots.values([Obstacle.sphere(1, FAR)] * 2)
    with pytest.raises(ValueError, match=r"inflation has shape \(3,\); expected \(1,\) or \(2,\)"):
        slots.values([Obstacle.sphere(1, FAR)], 0.0, [1, 2, 3])
    with pytest.raises(ValueError, match="boxes is -1"):
        SceneSlots(boxes=-1)
