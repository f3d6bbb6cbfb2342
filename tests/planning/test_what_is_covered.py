"""What a certificate of clearance covers: lengths in metres, links with shapes, arms with locked joints.

Modules: collision_avoidance, goals, report, work.
"""

import numpy as np
import pytest
import trimesh

import dhkit
from acceptance import different_robots_first
from dhkit.description import asset, library_robot, pose, robots
from dhkit.errors import PlanningError
from dhkit.model.shapes import link_parts
from dhkit.planning import Obstacle
from mesh_shapes import ONE_LINK_WITH_A_MESH

START, GOAL = np.array([-0.8, -0.5, 0.5, 0, 0, 0.0]), np.array([0.8, -0.5, 0.5, 0, 0, 0])
UR5 = asset("urdf/ur5.urdf").read_text()


def planned(arm, ball, **options):
    return arm.plan(START, GOAL, obstacles=[ball], intervals=24, compare=False, **options)


@pytest.mark.slow
def test_a_table_of_large_lengths_does_not_widen_the_clearance(tmp_path):
    """Axes 1e-6 rad off parallel have a common normal hundreds of kilometres away."""
    elbow = '<joint name="elbow" type="revolute">\n    <origin xyz="-0.425 0 0" rpy="0 0 0" />'
    assert elbow in UR5
    (tmp_path / "tilted.urdf").write_text(UR5.replace(elbow, elbow.replace('rpy="0 0 0"', 'rpy="0 1e-6 0"')))
    arm = dhkit.Arm.load(tmp_path / "tilted.urdf")
    assert arm.description.numbers.table_length > 1e4
    assert arm.description.reach < 2
    free = arm.plan(START, GOAL, intervals=24, compare=False)
    ball = Obstacle.sphere(0.02, arm.fk(free.q(free.duration / 2))[:3, 3])
    motion = planned(arm, ball, clearance=0.0)
    assert arm.distance(motion.q(np.linspace(0, motion.duration, 2000)), [ball]).distance.min() > -1e-6


def test_a_link_whose_mesh_is_missing_is_named(tmp_path):
    begin = UR5.index('<link name="link3"')
    end = UR5.index("</link>", begin)
    link = UR5[begin:end]
    for shape in ("cylinder", "sphere", "box"):
        while (at := link.find(f"<{shape} ")) >= 0:
            link = link[:at] + '<mesh filename="forearm.stl"/>' + link[link.index("/>", at) + 2 :]
    (tmp_path / "bare.urdf").write_text(UR5[:begin] + link + UR5[end:])
    arm = dhkit.Arm.load(tmp_path / "bare.urdf")
    report = planned(arm, Obstacle.sphere(0.05, (2.0, 2.0, 2.0))).report
    assert report.not_checked == ("link 3 without a shape",)
    assert "not checked for collisions: link 3 without a shape" in str(report)
    whole = planned(dhkit.Arm.load("ur5"), Obstacle.sphere(0.05, (2.0, 2.0, 2.0))).report
    assert whole.not_checked == ()


def test_parts_that_stay_beside_an_obstacle_are_named_if_they_are_near_it():
    arm = dhkit.Arm.load("ur5")
    post = Obstacle.box((0.05, 0.05, 0.3), (0.1, 0.0, -0.15), name="post")
    q = np.array([[0.0, -1.2, 0.5, 0, 0, 0], [2.0, -1.2, 0.5, 0, 0, 0]])
    assert arm.distance(q, [post]).not_checked == ("part of link 1 and post, 19.6 mm apart in all configurations",)
    far = Obstacle.box((0.05, 0.05, 0.3), (0.8, 0.0, 0.5), name="far")
    assert arm.distance(q, [far]).not_checked == ()
    motion = arm.quintic(q[0], q[1])
    near = arm.plan(q[0], q[1], obstacles=[post], clearance=0.03, compare=False, intervals=24)
    assert near.report.not_checked == ("part of link 1 and post, 19.6 mm apart in all configurations",)
    assert arm.certify(motion, obstacles=[post], clearance=0.005, independent=True).independent.ok


def test_links_that_turn_about_the_vertical_alone_are_named_beside_a_floor():
    """No motion changes their heights; a certificate says so where they are nearer than the clearance."""
    floor = dhkit.planning.Floor(-0.3)
    arm = dhkit.Arm.load("ur5")
    motion = arm.quintic("zero", np.full(6, 0.1), duration=2.0)
    assert arm.certify(motion, obstacles=[floor], clearance=0.01).not_checked == ()
    planar = dhkit.Arm.load("planar3r")
    inside = planar.certify(planar.quintic(np.zeros(3), np.full(3, 0.1)), obstacles=[dhkit.planning.Floor(0.9)])
    assert [words.split(",")[0] for words in inside.not_checked] == [f"part of link {k} and floor" for k in (1, 2, 3)]


@pytest.mark.parametrize(("name", "locked"), [("ur5", {2: 1.6}), ("ur5", {0: 0.4, 4: -1.0}), ("stanford", {2: 0.4})])
def test_links_of_a_locked_arm_are_where_they_were(name, locked):
    """Points of the solids are those of the whole arm with these joints held."""
    whole = dhkit.Arm.load(name)
    arm = whole.lock(locked)
    free = [i for i in range(whole.n) if i not in locked]
    q = np.full(whole.n, 0.3)
    q[list(locked)] = list(locked.values())

    def centres(robot, joints):
        frames = robot.frames(joints)
        parts = link_parts(robot.description)
        found = [(frames[part.link] @ part.T_link_part)[:3, 3] for part in parts]
        return np.array(sorted(map(tuple, np.round(found, 9))))

    assert np.abs(centres(arm, q[free]) - centres(whole, q)).max() < 1e-8
    assert not arm.description.drawn


@pytest.mark.parametrize("name", different_robots_first([name for name in robots() if library_robot(name).n > 2]))
def test_distances_of_a_locked_arm_from_obstacles_are_those_of_the_whole_arm(tmp_path, name):
    """Random joints are held at random values; the robot file of the locked arm says the same."""
    whole = dhkit.Arm.load(name)
    rng = np.random.default_rng(robots().index(name))
    lower = whole.limits.lower.clip(-np.pi)
    upper = whole.limits.upper.clip(None, np.pi)
    obstacles = [
        Obstacle.sphere(0.05 * whole.description.reach, tuple(whole.fk(rng.uniform(lower, upper))[:3, 3]), name=f"{k}")
        for k in range(3)
    ]
    held = np.sort(rng.permutation(whole.n)[: rng.integers(1, whole.n - 1)])
    q = rng.uniform(lower, upper, (40, whole.n))
    q[:, held] = q[0, held]
    locked = whole.lock({int(joint): float(q[0, joint]) for joint in held})
    expected = whole.distance(q, obstacles).per_obstacle
    locked.save(tmp_path / "locked.toml")
    for arm in (locked, dhkit.Arm.load(tmp_path / "locked.toml")):
        found = arm.distance(np.delete(q, held, axis=1), obstacles).per_obstacle
        assert np.abs(found - expected).max() < 1e-9


@pytest.mark.parametrize("name", ["al5d", "cobra600", "pan_tilt"])
def test_a_pose_that_is_not_met_is_refused_unless_its_coordinates_are_named(name):
    arm = dhkit.Arm.load(name)
    q = np.array([0.3, 0.4, 0.2, 0.1])[: arm.n].clip(arm.limits.lower, arm.limits.upper)
    start = np.full(arm.n, 0.05).clip(arm.limits.lower, arm.limits.upper)
    T = arm.fk(q) @ pose((0, 0, 0), euler=(0.9, 0.7, 0.4))
    with pytest.raises(PlanningError, match=rf"^goal: {name} does not meet this pose: of its coordinates it meets"):
        arm.plan(start, T, intervals=12, compare=False)
    met = arm.ik(T).met
    motion = arm.plan(start, T, coordinates=met, intervals=12, compare=False)
    assert "counted and no other coordinates" in str(motion.report)
    with pytest.raises(ValueError, match=r"coordinates is \('x',\); .* meets"):
        arm.plan(start, T, coordinates=("x",), intervals=12, compare=False)
    assert arm.plan(start, arm.fk(q), intervals=12, compare=False).report.coordinates == ()


def test_a_mesh_that_is_replaced_is_read_again(tmp_path):
    """In one process, and for an arm that was loaded before."""
    (tmp_path / "box.toml").write_text(ONE_LINK_WITH_A_MESH)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "link.stl")
    arm = dhkit.Arm.load(tmp_path / "box.toml")
    ball = Obstacle.sphere(0.1, (1.0, 0.0, 0.0))
    small = arm.distance([0.0], [ball]).distance
    trimesh.creation.box((0.4, 0.1, 0.1)).export(tmp_path / "link.stl")
    large = arm.distance([0.0], [ball]).distance
    assert small - large > 0.1
    assert dhkit.Arm.load(tmp_path / "box.toml").distance([0.0], [ball]).distance == large
