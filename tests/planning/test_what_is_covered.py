"""What a certificate of clearance covers: lengths in metres, links with shapes, arms with locked joints."""

import numpy as np
import pytest
import trimesh

import dhkit
from acceptance import different_robots_first
from dhkit.description import asset, library_robot, pose, robots
from dhkit.errors import DescriptionError, PlanningError
from dhkit.model.shapes import link_parts
from dhkit.planning import Floor, Obstacle
from dhkit.trajectories import joint_path, tool_line
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
    (tmp_path / "tilted.urdf").write_text(
        UR5.replace(elbow, elbow.replace('rpy="0 0 0"', 'rpy="0 1e-6 0"'))
    )
    arm = dhkit.Arm.load(tmp_path / "tilted.urdf")
    assert arm.description.numbers.table_length > 1e4
    assert arm.description.reach < 2
    free = arm.plan(START, GOAL, intervals=24, compare=False)
    ball = Obstacle.sphere(0.02, arm.fk(free.q(free.duration / 2))[:3, 3])
    motion = planned(arm, ball, clearance=0.0)
    assert (
        arm.distance(motion.q(np.linspace(0, motion.duration, 2000)), [ball]).distance.min() > -1e-6
    )


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
    assert report.not_checked[0] == "link 3 without a shape"
    assert report.not_checked[1:] == arm.description.warnings
    assert (
        "link 'link3': mesh 'forearm.stl' is not there; this shape is left out"
        in arm.description.warnings
    )
    assert "not checked for collisions: link 3 without a shape" in str(report)
    whole = planned(dhkit.Arm.load("ur5"), Obstacle.sphere(0.05, (2.0, 2.0, 2.0))).report
    assert whole.not_checked == ()


def test_parts_that_stay_beside_an_obstacle_are_named_if_they_are_near_it():
    arm = dhkit.Arm.load("ur5")
    post = Obstacle.box((0.05, 0.05, 0.3), (0.1, 0.0, -0.15), name="post")
    q = np.array([[0.0, -1.2, 0.5, 0, 0, 0], [2.0, -1.2, 0.5, 0, 0, 0]])
    assert arm.distance(q, [post]).not_checked == (
        "part of link 1 and post, 19.6 mm apart in all configurations",
    )
    far = Obstacle.box((0.05, 0.05, 0.3), (0.8, 0.0, 0.5), name="far")
    assert arm.distance(q, [far]).not_checked == ()
    motion = arm.quintic(q[0], q[1])
    near = arm.plan(q[0], q[1], obstacles=[post], clearance=0.03, compare=False, intervals=24)
    assert near.report.not_checked == (
        "part of link 1 and post, 19.6 mm apart in all configurations",
    )
    assert arm.certify(motion, obstacles=[post], clearance=0.005, independent=True).independent.ok


def test_links_that_turn_about_the_vertical_alone_are_named_beside_a_floor():
    """No motion changes their heights; a certificate says so where they are nearer than the clearance."""
    floor = dhkit.planning.Floor(-0.3)
    arm = dhkit.Arm.load("ur5")
    motion = arm.quintic("zero", np.full(6, 0.1), duration=2.0)
    assert arm.certify(motion, obstacles=[floor], clearance=0.01).not_checked == ()
    planar = dhkit.Arm.load("planar3r")
    inside = planar.certify(
        planar.quintic(np.zeros(3), np.full(3, 0.1)), obstacles=[dhkit.planning.Floor(0.9)]
    )
    assert [words.split(",")[0] for words in inside.not_checked] == [
        f"part of link {k} and floor" for k in (1, 2, 3)
    ]


@pytest.mark.parametrize(
    ("name", "locked"), [("ur5", {2: 1.6}), ("ur5", {0: 0.4, 4: -1.0}), ("stanford", {2: 0.4})]
)
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


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", different_robots_first([name for name in robots() if library_robot(name).n > 2])
)
def test_distances_of_a_locked_arm_from_obstacles_are_those_of_the_whole_arm(tmp_path, name):
    """Random joints are held at random values; the robot file of the locked arm says the same."""
    whole = dhkit.Arm.load(name)
    rng = np.random.default_rng(robots().index(name))
    lower = whole.limits.lower.clip(-np.pi)
    upper = whole.limits.upper.clip(None, np.pi)
    obstacles = [
        Obstacle.sphere(
            0.05 * whole.description.reach,
            tuple(whole.fk(rng.uniform(lower, upper))[:3, 3]),
            name=f"{k}",
        )
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
    with pytest.raises(
        PlanningError, match=rf"^goal: {name} does not meet this pose: of its coordinates it meets"
    ):
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


# Found by a review from outside

THREE_LINKS = """format = 1
name = "three"
convention = "standard"
[base]
shape = {base}
[[joint]]
type = "revolute"
a = 0
alpha = "pi/2"
d = 0.5
theta = 0
[[joint]]
type = "revolute"
a = 0.6
alpha = 0
d = 0
theta = 0
shape = [{{ box = [0.6, 0.4, 0.4], xyz = [-0.3, 0, 0] }}{mesh}]
[[joint]]
type = "revolute"
a = 0.4
alpha = 0
d = 0
theta = 0
"""


def robot_file(folder, text):
    (folder / "robot.toml").write_text(text)
    return dhkit.Arm.load(folder / "robot.toml")


@pytest.mark.parametrize("content", [None, "", "solid nothing\nendsolid\n"])
def test_shapes_beside_a_mesh_that_cannot_be_read_stay(tmp_path, content):
    if content is not None:
        (tmp_path / "cover.stl").write_text(content)
    ball = Obstacle.sphere(0.05, (0.3, 0.15, 0.5), name="ball")
    whole = robot_file(tmp_path, THREE_LINKS.format(base="[]", mesh=""))
    arm = robot_file(tmp_path, THREE_LINKS.format(base="[]", mesh=', { mesh = "cover.stl" }'))
    assert np.array_equal(
        arm.distance([0, 0, 0], [ball]).per_obstacle, whole.distance([0, 0, 0], [ball]).per_obstacle
    )
    named = ("mesh 'cover.stl' of link 2, which cannot be read",)
    assert arm.distance([0, 0, 0], [ball]).not_checked == named
    for robot in (arm, arm.lock({2: 0.1})):
        motion = robot.quintic([0] * robot.n, [0.02] * robot.n, duration=2)
        certificate = robot.certify(motion, obstacles=[ball], independent=True)
        assert not certificate.ok and set(named) <= set(certificate.not_checked)


@pytest.mark.parametrize("place", ["base", "tool"])
def test_missing_meshes_of_base_and_tool_are_named(tmp_path, place):
    mesh = '[{ mesh = "gone.stl" }]'
    text = THREE_LINKS.format(base=mesh if place == "base" else "[]", mesh="")
    arm = robot_file(
        tmp_path,
        text if place == "base" else text.replace("[base]", f"[tool]\nshape = {mesh}\n[base]"),
    )
    motion = arm.quintic([0] * 3, [0.02] * 3, duration=2)
    far = Obstacle.sphere(0.05, (3, 0, 0), name="far")
    assert (
        f"mesh 'gone.stl' of the {place}, which cannot be read"
        in arm.certify(motion, obstacles=[far]).not_checked
    )


def test_a_reduced_clearance_between_shapes_is_named_in_every_certificate():
    arm = dhkit.Arm.load("cobra600")
    q0 = np.array([-0.33, -0.24, 0.05, -1.14])
    q1 = q0 + np.array([0, 0, -0.012, 0])
    named = "all of the clearance near the ends: 14.4 mm between link 2 and link 4"
    certificate = arm.certify(arm.quintic(q0, q1), self_collision=True, clearance=0.1)
    assert named in certificate.not_checked
    path = joint_path(arm.description, tool_line(arm.fk(q0), arm.fk(q1)), q0)
    along = arm.plan_path(path, self_collision=True, clearance=0.1)
    assert along.report.certificate.not_checked == certificate.not_checked


def test_a_planned_motions_certificate_names_what_certify_names():
    arm = dhkit.Arm.load("puma560")
    motion = arm.plan("nominal", "ready", self_collision=True, compare=False, intervals=12)
    own = motion.report.certificate.not_checked
    assert own and own == arm.certify(motion, self_collision=True).not_checked


def test_a_pair_that_is_steady_within_limits_alone_is_checked(tmp_path):
    """Its distance changes beyond the file's limits, which ``limits=`` may exceed."""
    joint = (
        '[[joint]]\ntype = "revolute"\na = 0\nalpha = 0\nd = 0\ntheta = 0\nlimits = [{}]\n'
        "shape = [{{ sphere = {{ radius = {} }}, xyz = [{}] }}]\n"
    )
    text = 'format = 1\nname = "s"\nconvention = "standard"\n[base]\n'
    text += "shape = [{ sphere = { radius = 0.01 }, xyz = [0.12, 0, 0] }]\n"
    text += joint.format("-0.05, 0.05", "0.005", "0, 0, 0.3") + joint.format(
        "3.1, 3.2", "0.01", "0.06, 0, 0"
    )
    arm = robot_file(tmp_path, text)
    wide = dhkit.Limits.of(arm, lower=-4, upper=4, velocity=9.0)
    motion = arm.quintic([0, 3.14], [0, -3.14], duration=3, limits=wide)
    assert not arm.certify(motion, wide, self_collision=True, clearance=0.05).ok
    assert arm.distance([0.0, 0.0], [], True).distance == pytest.approx(0.04, abs=1e-9)


@pytest.mark.parametrize("stroke", [10.0, 1e9])
def test_a_slide_without_sensible_limits_hides_no_other_link(tmp_path, stroke):
    text = 'format = 1\nname = "t"\nconvention = "standard"\n'
    for kind, a, alpha, d, limits, shape in (
        ("revolute", 0, '"pi/2"', 0.3, "-3, 3", "sphere = { radius = 0.02 }"),
        ("revolute", 0.5, '"pi/2"', 0, "-3, 3", "box = [0.5, 0.04, 0.04], xyz = [-0.25, 0, 0]"),
        ("prismatic", 0, 0, 0, f"{-stroke}, {stroke}", "sphere = { radius = 0.03 }"),
    ):
        text += f'[[joint]]\ntype = "{kind}"\na = {a}\nalpha = {alpha}\nd = {d}\ntheta = 0\n'
        text += f"limits = [{limits}]\nshape = [{{ {shape} }}]\n"
    arm = robot_file(tmp_path, text)
    ball = Obstacle.sphere(0.1, (0.35, 0.35, 0.3), name="ball")
    motion = arm.quintic([0, 0, 1], [1.5, 0, 1], duration=3)
    assert not arm.certify(motion, obstacles=[ball]).ok
    assert arm.distance(motion.q(1.5), [ball]).distance < -0.1


@pytest.mark.parametrize(
    "vertices",
    ["0 0 0, 1 0 0, 0 1 0, 1 1 0", "0 0 0, 1 0 0, 0 1 0", "0 0 0, 1 0 0, 2 0 0", "1 1 1"],
)
def test_a_flat_mesh_is_measured(tmp_path, vertices):
    corners = vertices.split(", ")
    corners += corners[-1:] * (3 - len(corners))
    faces = [(1, 2, 3)] + [(2, 4, 3)] * (len(corners) == 4)
    lines = [f"v {corner}" for corner in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    (tmp_path / "plate.obj").write_text("\n".join(lines) + "\n")
    text = 'format = 1\nname = "p"\nconvention = "standard"\n[[joint]]\ntype = "revolute"\na = 1\nalpha = 0\nd = 0\n'
    arm = robot_file(tmp_path, text + 'theta = 0\nshape = { mesh = "plate.obj" }\n')
    ball = Obstacle.sphere(0.05, (1, 0, 1), name="ball")
    motion = arm.quintic([0.0], [0.5], duration=1)
    certificate = arm.certify(motion, obstacles=[ball], independent=True)
    assert certificate.ok and certificate.independent.ok
    if len(set(corners)) == 1:
        true = np.linalg.norm(np.array([2, 1, 1]) - [1, 0, 1]) - 0.05
        assert arm.distance([0.0], [ball]).distance == pytest.approx(true, abs=1e-5)


def test_a_locked_arm_keeps_its_distance_from_the_floor():
    arm = dhkit.Arm.load("manutec_r3")
    q = [0.41088506, -0.69063986, -1.37707943]
    locked = arm.lock({1: q[1], 2: q[2]})
    floor = [Floor(0.3)]
    assert locked.distance(q[:1], floor).distance == pytest.approx(
        float(arm.distance(q, floor).distance), abs=1e-9
    )
    assert not locked.certify(locked.quintic([0.0], [1.0], duration=3), obstacles=floor).ok


def test_torque_limits_of_an_arm_without_bodies_are_refused():
    arm = dhkit.Arm.from_dh([(0, 0, 0.5, 0), (0, 0, 0.4, 0)])
    free = dhkit.Limits.of(arm, lower=-4, upper=4)
    # A duration is given: nothing has to limit it.
    motion = arm.quintic([0, 0], [1, 1], duration=2, limits=free)
    with pytest.raises(DescriptionError, match="no body, so the dynamics are unknown"):
        arm.certify(motion, dhkit.Limits.of(arm, torque=5))
    with pytest.raises(
        ValueError, match="lower of joint 1 is inf; expected a number, or -inf for none"
    ):
        dhkit.Limits.of(arm, lower=np.inf)
