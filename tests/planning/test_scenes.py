"""Spheres and boxes on the direct way, passed at the clearance that was asked for.

Modules: collision_avoidance, avoiding.
"""

import itertools

import numpy as np
import pytest
from benchmarks.scenes import SceneKind, scenes as random_scenes

from dhkit.description import library_robot
from dhkit.description.frames import world_to_frames, world_to_tool
from dhkit.dynamics import gravity_torque
from dhkit.planning import Floor, Obstacle, Planner, distance
from dhkit.planning.obstacles import link_capsules
from planning_reference import worst_excess

pytestmark = pytest.mark.slow

PUMA = library_robot("puma560")
CLEARANCE = 0.02
"""m."""
ROUNDING = 1e-6
"""m: what the certificate's grid may leave between its states."""


def scenes(count, seed=0):
    """Yield start, goal and an obstacle that the straight joint path hits and neither end is near."""
    numbers, rng = PUMA.numbers, np.random.default_rng(seed)
    lower, upper = 0.6 * numbers.lower, 0.6 * numbers.upper
    found = 0
    while found < count:
        start, goal = rng.uniform(lower, upper), rng.uniform(lower, upper)
        if min(world_to_tool(PUMA, q)[2, 3] for q in (start, goal)) < 0.3:
            continue
        middle = world_to_tool(PUMA, (start + goal) / 2)[:3, 3]
        size = rng.uniform(0.04, 0.1)
        if found % 2:
            obstacle = Obstacle.box(2 * size * rng.uniform(0.6, 1.2, 3), middle, name="crate")
        else:
            obstacle = Obstacle.sphere(size, middle, name="ball")
        ends = distance(PUMA, np.array([start, goal]), [obstacle]).distance
        if ends.min() > 3 * CLEARANCE:
            found += 1
            yield start, goal, obstacle


def coal_gap(motion, obstacle, rate=500.0):
    """Return the smallest distance of the arm's capsules from an obstacle, by coal alone, m."""
    import coal

    def transform(R, p):
        return coal.Transform3s(np.asarray(R), np.asarray(p))

    kind = type(obstacle.geometry).__name__
    solid = coal.Box(*(2 * obstacle.half_sizes)) if kind == "Box" else coal.Sphere(obstacle.radius)
    there = transform(obstacle.T_world_obstacle[:3, :3], obstacle.T_world_obstacle[:3, 3])
    worst = np.inf
    for q in motion.q(np.append(np.arange(0, motion.duration, 1 / rate), motion.duration)):
        frames = world_to_frames(PUMA, q)
        for capsule in link_capsules(PUMA):
            if capsule.link < 2:
                continue  # the base and the waist turn on the spot
            T = frames[capsule.link]
            a, b = (T[:3, :3] @ np.asarray(end) + T[:3, 3] for end in (capsule.start, capsule.end))
            length = np.linalg.norm(b - a)
            z = (b - a) / length if length > 1e-12 else np.array([0, 0, 1.0])
            x = np.cross(z, [1, 0, 0]) if abs(z[0]) < 0.9 else np.cross(z, [0, 1, 0])
            x /= np.linalg.norm(x)
            here = transform(np.stack([x, np.cross(z, x), z], axis=1), (a + b) / 2)
            result = coal.DistanceResult()
            shape = coal.Capsule(capsule.radius, length)
            worst = min(worst, coal.distance(shape, here, solid, there, coal.DistanceRequest(), result))
    return worst


def test_scenes(law):
    planner = Planner(PUMA)
    seconds, solves, longer = [], [], []
    for k, (start, goal, obstacle) in enumerate(scenes(law.samples(20))):
        motion = planner.solve(start, goal, obstacles=[obstacle], clearance=CLEARANCE, time_limit=30)
        law.holds("m short of the clearance, by coal", CLEARANCE - coal_gap(motion, obstacle), ROUNDING, k)
        for what, excess in worst_excess(PUMA, motion, planner.limits).items():
            law.holds(f"{what} above its limit", excess, 1e-6, k)
        seconds.append(motion.report.solve_seconds)
        solves.append(motion.report.solves)
        longer.append(motion.duration / planner.solve(start, goal).duration)
    law.takes("median seconds a scene", np.median(seconds), 3.0)
    print(
        f"\n  {np.median(seconds):.2f} s (at most {max(seconds):.2f}), {np.mean(solves):.1f} programs,"
        f" {100 * (np.mean(longer) - 1):.1f} % longer than without",
        end="",
    )


def test_the_direct_way_is_really_blocked():
    planner = Planner(PUMA, intervals=24)
    for start, goal, obstacle in scenes(2, seed=3):
        free = planner.solve(start, goal)
        assert distance(PUMA, free.q(np.linspace(0, free.duration, 400)), [obstacle]).distance.min() < CLEARANCE


def test_an_obstacle_that_is_far_away_changes_nothing():
    start, goal, _ = next(scenes(1))
    planner = Planner(PUMA, intervals=24)
    far = planner.solve(start, goal, obstacles=[Obstacle.sphere(0.1, (5, 5, 5))])
    assert far.duration == pytest.approx(planner.solve(start, goal).duration, rel=1e-4)


def cluttered(arm, count, seed):
    """Yield start, goal and ten spheres and boxes around an arm; the straight joint path collides."""
    rng, numbers = np.random.default_rng(seed), arm.numbers
    lower, upper = np.maximum(numbers.lower, -3.0), np.minimum(numbers.upper, 3.0)
    found = 0
    while found < count:
        obstacles = []
        while len(obstacles) < 10:
            at = rng.uniform(-1, 1, 3) * arm.reach
            at[2] = abs(at[2]) + 0.1
            if np.linalg.norm(at[:2]) < 0.25 * arm.reach:
                continue
            box = rng.uniform() < 0.5
            obstacles.append(
                Obstacle.box(rng.uniform(0.1, 0.3, 3), at) if box else Obstacle.sphere(rng.uniform(0.05, 0.15), at)
            )
        states = rng.uniform(lower, upper, (200, arm.n))
        clear = states[distance(arm, states, obstacles).distance > 0.03]
        clear = clear[(np.abs(gravity_torque(arm, clear)) < 0.9 * numbers.effort).all(axis=1)]
        if len(clear) < 2:
            continue
        way = clear[0] + np.linspace(0, 1, 60)[:, None] * (clear[1] - clear[0])
        if distance(arm, way, obstacles).distance.min() < CLEARANCE:
            found += 1
            yield clear[0], clear[1], obstacles


@pytest.mark.parametrize("name", ["puma560", "ur5", "panda"])
def test_ten_obstacles(law, name):
    arm = library_robot(name)
    planner = Planner(arm)
    for k, (start, goal, obstacles) in enumerate(cluttered(arm, law.samples(30) // 10, seed=7)):
        motion = planner.solve(start, goal, obstacles=obstacles, clearance=CLEARANCE, time_limit=30)
        q = motion.q(np.linspace(0, motion.duration, 2000))
        law.holds("m short of the clearance", CLEARANCE - distance(arm, q, obstacles).distance.min(), ROUNDING, k)
        for what, excess in worst_excess(arm, motion, planner.limits).items():
            law.holds(f"{what} above its limit", excess, 1e-6, k)


def test_a_way_that_is_hardly_wider_than_the_clearance_is_found():
    # Paths that keep 5 mm more than the clearance do not exist here; OMPL's BKPIECE1 finds one that keeps 20 mm in 2 s.
    *_, scene = itertools.islice(random_scenes(SceneKind("puma560"), 0), 22)
    motion = Planner(PUMA).solve(scene.start, scene.goal, obstacles=scene.obstacles, clearance=CLEARANCE, time_limit=30)
    q = motion.q(np.linspace(0, motion.duration, 5000))
    assert CLEARANCE - ROUNDING < distance(PUMA, q, scene.obstacles).distance.min() < CLEARANCE + 5e-3


@pytest.mark.parametrize("backwards", [False, True])
def test_at_an_end_within_the_clearance_it_is_reduced_and_the_report_says_so(backwards):
    """The gap starts at 4 mm; it keeps three quarters of that until it has reached the clearance, then all of it."""
    start, goal = np.array([0, 0.8, -1.0, 0, 0.5, 0]), np.array([1.2, 0.3, -0.8, 0.5, -0.6, 1.0])
    tool, low, high = world_to_tool(PUMA, start)[:3, 3], 0.0, 0.5
    for _ in range(50):
        middle = (low + high) / 2
        ball = Obstacle.sphere(0.05, tool - [middle, 0, middle / 5], name="ball")
        low, high = (middle, high) if distance(PUMA, start, [ball]).distance < 0.004 else (low, middle)
    ends = (goal, start) if backwards else (start, goal)
    motion = Planner(PUMA).solve(*ends, obstacles=[ball], clearance=CLEARANCE)
    gap = distance(PUMA, motion.q(np.linspace(0, motion.duration, 4000)), [ball]).distance
    gap = gap[::-1] if backwards else gap
    assert gap[0] == pytest.approx(0.004, abs=1e-6) and gap.min() > 0.003 - ROUNDING
    assert gap[np.argmax(gap >= CLEARANCE) :].min() > CLEARANCE - ROUNDING
    assert "but less near the ends, until they are that far apart: 3 mm between link" in str(motion.report)
    assert motion.report.as_dict()["reduced_clearances"] == list(motion.report.reduced_clearances)


def test_an_obstacle_thinner_than_the_way_between_two_points_is_not_missed():
    arm = library_robot("planar2r")
    sheet = Obstacle.box((0.5, 1e-3, 0.5), (1.6, 0.0, 0.0), name="sheet")
    motion = Planner(arm, intervals=12).solve([-0.6, 0.1], [0.6, 0.1], obstacles=[sheet], clearance=0.0)
    q = motion.q(np.linspace(0, motion.duration, 5000))
    assert distance(arm, q, [sheet]).distance.min() > -ROUNDING


def test_floor_and_itself():
    arm = library_robot("ur5")
    planner = Planner(arm, intervals=16)
    start, goal = np.array([0, -1.2, 1.5, -1.8, -1.57, 0]), np.array([1.6, -1.0, 1.2, -1.0, -1.0, 0.5])
    motion = planner.solve(start, goal, obstacles=[Floor(0.0)], clearance=0.01, self_collision=True)
    q = motion.q(np.linspace(0, motion.duration, 1000))
    assert distance(arm, q, [Floor(0.0)], self_collision=True).distance.min() > 0.01 - ROUNDING


def test_programs_are_made_once_for_scenes_of_a_size():
    planner = Planner(library_robot("planar2r"), intervals=12)
    balls = [
        Obstacle.sphere(0.05, (0.3, 0.95, 0)),
        Obstacle.sphere(0.05, (0.9, -0.5, 0)),
        Obstacle.sphere(0.02, (0, -2, 0)),
    ]
    first = planner.solve([0, 0], [0.4, 0.3], obstacles=balls)
    again = planner.solve([0, 0], [0.4, 0.3], obstacles=[*balls, Obstacle.sphere(0.02, (0, 2, 0))])
    assert first.report.build_seconds > 0 and again.report.build_seconds == 0
