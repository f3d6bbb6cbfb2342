"""Robot files, tables and meshes of others: small inputs that once failed, with their right values."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import dhkit
from dhkit import Arm
from dhkit.cli import main
from dhkit.errors import DhkitError, PlanningError
from dhkit.model import read_mesh, shape_inertia

DATA = Path(__file__).with_name("data") / "public"
ROUNDED_JOINTS = 0.01
"""m: published poses of the KR 210 belong to joint values rounded to 0.01 rad, at 2.5 m."""


def words(capsys, *arguments):
    """Run a command; return its exit status and everything that it wrote."""
    with pytest.raises(SystemExit) as exit:
        main(arguments)
    out, err = capsys.readouterr()
    return exit.value.code, err + out


# Meshes


def test_a_tiny_hole_beside_shared_walls_does_not_count_a_block_twice():
    shape = shape_inertia(
        read_mesh(DATA / "c01_tiny_hole_beside_shared_walls" / "part.stl"), density=1.0
    )
    outer, inner, shared = 480000.0, 198000.0, 108000.0
    assert 0.99 * (outer + inner) < shape.volume < 1.01 * (outer + inner + shared)


def test_a_binary_mesh_that_begins_with_solid():
    shape = shape_inertia(read_mesh(DATA / "c03_binary_named_solid" / "part.stl"), density=1.0)
    assert shape.volume == pytest.approx(24000, abs=1e-6)


def test_two_bodies_one_of_them_inside_out():
    shape = shape_inertia(read_mesh(DATA / "c04_two_bodies_bad_winding" / "part.stl"), density=1.0)
    assert shape.volume == pytest.approx(24000 + 1000, abs=1e-6)


def test_a_last_link_without_a_part_says_how_to_map_it(capsys, tmp_path):
    folder = DATA / "c06_last_link_without_part"
    status, said = words(
        capsys,
        "import-cad",
        f"{folder}/parts",
        "--table",
        f"{folder}/arm.toml",
        "-o",
        str(tmp_path / "new"),
    )
    assert status == 0 or '2="' in said


# Tables


def test_four_axes_that_meet_are_solved_or_refused_in_one_line():
    rows = [(0, 0, 0.3, -np.pi / 2), (0, 1.0, 0.4, np.pi / 2), (0, 0.65, 0, np.pi / 2)]
    rows += [(0, 0, 0, np.pi / 2), (0, 0, 0, np.pi / 2), (0, 0, 0.15, -np.pi / 2)]
    arm = Arm.from_dh(rows)
    T = arm.fk([0.3, 0.4, -0.5, 0.6, 0.7, 0.2])
    found = arm.ik(T)
    assert found.status != "out_of_reach"
    assert np.abs(arm.fk(found.q[found.valid]) - T).max() < 1e-9


def test_published_poses_of_the_kr210():
    rows = [
        (0, 0, 0.75, 0),
        (-90, 0.35, 0, -90),
        (0, 1.25, 0, 0),
        (-90, -0.054, 1.5, 0),
        (90, 0, 0, 0),
        (-90, 0, 0, 0),
    ]
    table = Arm.from_dh(
        rows, order=("alpha", "a", "d", "theta"), convention="modified", angle="deg", name="kr210"
    )
    arm = table.with_tool(dhkit.pose((0, 0, 0.303)))
    published = [
        (
            [-0.65, 0.45, -0.36, 0.95, 0.79, 0.49],
            [2.16135, -1.42635, 1.55109],
            [1.89451, -1.44302, 1.69366],
        ),
        (
            [-0.79, -0.11, -2.33, 1.94, 1.14, -3.68],
            [-0.56754, 0.93663, 3.0038],
            [-0.638, 0.64198, 2.9988],
        ),
        (
            [-2.99, -0.12, 0.94, 4.06, 1.29, -4.12],
            [-1.3863, 0.02074, 0.90986],
            [-1.1669, -0.17989, 0.85137],
        ),
    ]
    for q, tool, wrist in published:
        assert np.abs(arm.fk(q)[:3, 3] - tool).max() < ROUNDED_JOINTS
        assert np.abs(arm.frames(q)[5][:3, 3] - wrist).max() < ROUNDED_JOINTS
    assert "closed form, 8" in str(arm.family)
    assert len(arm.ik(arm.fk([0.3, -0.4, 0.5, 0.6, 0.7, 0.8]))) == 8


@pytest.mark.slow
def test_the_published_table_of_the_gen3_lite_finds_the_joint_values_of_every_pose():
    rows = [
        (0, 0, 0, 243.3),
        (90, 0, 90, 30),
        (180, 280, 90, 20),
        (90, 0, 90, 245),
        (90, 0, 180, 57),
        (90, 0, 90, 235),
    ]
    order = ("alpha", "a", "theta", "d")
    arm = Arm.from_dh(rows, order=order, angle="deg", length="mm", convention="modified")
    q = np.random.default_rng(0).uniform(-2.5, 2.5, (40, 6))
    found = arm.ik(arm.fk(q))
    turns = np.angle(np.exp(1j * (found.q - q[:, None])))
    nearest = np.nanmin(np.abs(turns).max(-1), -1)
    is_regular = np.linalg.svd(arm.jacobian(q), compute_uv=False)[:, -1] > 1e-3
    assert np.all(nearest[is_regular] < 1e-6)


def test_uniform_links_of_a_calibrated_ur_are_as_long_as_the_arm():
    rows = [
        (-1e-5, 0.089, 0.00028, 1.5703),
        (-1.437, 574.2, -0.0567, -0.000734),
        (2.0254, -507.4, -0.3265, 0.003256),
    ]
    rows += [(-0.5883, -66.77, 0, 1.5704), (0, 0.095, 0, -1.571), (0, 0.0826, 0, 0)]
    arm = Arm.from_dh(rows).with_uniform_links()
    reach, mass_of_a_link = 1.2, 1.0
    assert arm.mass_matrix([0.3, -1, 1, 0.4, 0.5, 0.6])[0, 0] < arm.n * mass_of_a_link * reach**2


def test_home_of_the_open_manipulator():
    bend = np.degrees(np.arctan2(24, 128))
    rows = [
        (0, 0, 77, 0),
        (0, -90, 0, bend - 90),
        (np.hypot(24, 128), 0, 0, 90 - bend),
        (124, 0, 0, 0),
    ]
    order = ("a", "alpha", "d", "theta")
    table = Arm.from_dh(rows, order=order, convention="modified", angle="deg", length="mm")
    arm = table.with_tool(dhkit.pose((0.126, 0, 0)))
    assert arm.fk([0] * 4)[:3, 3] == pytest.approx([0.274, 0, 0.205], abs=1e-12)
    assert "closed form" in str(arm.family)


def test_numbers_as_text_without_a_unit_are_refused_with_the_cure():
    with pytest.raises(
        DhkitError, match=r"row 1: d: '243\.3' is text without a unit; .* 243\.3\*mm"
    ):
        Arm.from_dh(
            [("0", "243.3", "0", "90"), ("0", "30", "280", "180")], angle="deg", length="mm"
        )


def test_a_modified_table_with_every_column_makes_the_urdf_of_its_product():
    rows = [(0.4, 0.1, 0.3, 0.2), (1.1, 0.2, -0.7, 0.1), (-0.9, 0.3, 2.0, -0.2)]
    arm = Arm.from_dh(rows, order=("alpha", "a", "theta", "d"), convention="modified")
    q = np.array([0.5, -0.3, 0.8])
    T = np.eye(4)
    for (alpha, a, theta, d), x in zip(rows, q, strict=True):
        # Craig (2005), eq. 3.6.
        ct, st, ca, sa = np.cos(theta + x), np.sin(theta + x), np.cos(alpha), np.sin(alpha)
        T = T @ [
            [ct, -st, 0, a],
            [st * ca, ct * ca, -sa, -d * sa],
            [st * sa, ct * sa, ca, d * ca],
            [0, 0, 0, 1],
        ]
    model = pin.buildModelFromXML(arm.urdf())
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    assert arm.fk(q) == pytest.approx(T, abs=1e-14)
    assert data.oMf[model.getFrameId("tool")].homogeneous == pytest.approx(T, abs=1e-14)


# Dynamics and motions


def test_payloads_of_no_mass_and_away_from_the_tool():
    arm = Arm.load("puma560")
    q = np.radians([45, 70, -100, 60, 25, -140])
    rest = np.zeros(6)
    torque = arm.inverse_dynamics(q, rest, rest)
    assert arm.with_payload(0.0).inverse_dynamics(q, rest, rest) == pytest.approx(torque, abs=1e-12)
    J = arm.with_tool(dhkit.pose((0, 0, 0.5))).jacobian(q)
    loaded = arm.with_payload(5.0, com=(0, 0, 0.5)).inverse_dynamics(q, rest, rest)
    assert loaded == pytest.approx(torque + J[:3].T @ [0, 0, 5 * 9.81], abs=1e-12)


@pytest.mark.slow
def test_a_plan_between_nearly_equal_joint_values():
    arm = Arm.load("puma560")
    goal = [0, -0.464, -0.576, 0, -1.7, 0]
    start = [-9e-7, -0.4640044, -0.5760015, -3.9e-7, -1.699997, 5.4e-6]
    motion = arm.plan(start, goal)
    assert 0 < motion.duration < 0.01
    assert motion.report.certificate.ok
    with pytest.raises(PlanningError, match="same"):
        arm.plan(goal, goal)


def test_a_sphere_three_metres_away_is_no_obstacle(capsys):
    urdf = str(DATA / "u24_sphere_three_metres_away" / "arm.urdf")
    sphere = ("--sphere", "0.1", "@", "0", "-3", "0.3")
    status, said = words(capsys, "plan", urdf, "--from", "zero", "--to", *["0.3"] * 6, *sphere)
    assert status == 0, said


# URDFs


def test_lengths_of_a_table_with_a_tilted_first_axis():
    numbers = Arm.load(DATA / "u01_axis1_tilted_base" / "arm.urdf").description.numbers
    assert np.abs([numbers.d, numbers.a]).max() < 5


@pytest.mark.slow
def test_verify_agrees_for_nearly_parallel_axes():
    assert Arm.load(DATA / "u03_nearly_parallel_verify" / "arm.urdf").verify(200).ok


def test_three_nearly_parallel_axes_are_a_closed_form_or_a_hint():
    family = str(Arm.load(DATA / "u07_no_hint_three_parallel" / "arm.urdf").family)
    assert "closed form, 8" in family or "nearly" in family


def test_complements_of_rounded_right_angles_are_designed():
    arm = Arm.from_urdf(DATA / "u09_ur_complement_angle" / "arm.urdf", as_designed=True)
    assert "closed form, 8" in str(arm.family)


def test_an_effort_of_minus_one_is_no_limit():
    assert Arm.load(DATA / "u11_effort_minus_one" / "arm.urdf", tip="part3").n == 3


def test_crooked_axes_agree_with_pinocchio():
    file = DATA / "u16_crooked_axes" / "arm.urdf"
    arm = Arm.load(file)
    model = pin.buildModelFromUrdf(str(file))
    data = model.createData()
    for q in np.random.default_rng(0).uniform(-1, 1, (20, 3)):
        turns = [np.cos(q[0]), np.sin(q[0]), np.cos(q[1]), np.sin(q[1])]
        pin.framesForwardKinematics(model, data, np.array([*turns, q[2]]))
        assert data.oMf[model.getFrameId("part3")].homogeneous == pytest.approx(
            arm.fk(q), abs=1e-10
        )


def test_dynamics_with_continuous_joints_beside_the_chain():
    file = DATA / "u17_continuous_joints_beside" / "arm.urdf"
    arm = Arm.load(file, tip="part3")
    model = pin.buildModelFromUrdf(str(file))
    data = model.createData()
    joints = [model.joints[model.getJointId(f"j{i}")] for i in (1, 2, 3)]
    rates = [joint.idx_v for joint in joints]
    for q in np.random.default_rng(0).uniform(-1, 1, (20, 3)):
        state = pin.neutral(model)
        state[[joint.idx_q for joint in joints]] = q
        upper = np.triu(pin.crba(model, data, state))
        M = upper + np.triu(upper, 1).T
        g = pin.computeGeneralizedGravity(model, data, state)
        assert arm.mass_matrix(q) == pytest.approx(M[np.ix_(rates, rates)], abs=1e-9)
        assert arm.gravity_torque(q) == pytest.approx(g[rates], abs=1e-9)


def test_a_revolute_joint_without_limits():
    numbers = Arm.load(DATA / "u18_revolute_without_limit" / "arm.urdf").description.numbers
    assert numbers.lower[0] < -1e9
    assert numbers.upper[1] == pytest.approx(1.7)


def test_a_blank_line_before_the_header_is_no_fault():
    assert Arm.load(DATA / "u19_blank_line_before_header" / "arm.urdf").n == 3


def test_iteration_reaches_the_poses_of_a_rounded_file():
    arm = Arm.load(DATA / "u21_numeric_ik_out_of_reach" / "arm.urdf")
    numbers = arm.description.numbers
    q = np.random.default_rng(0).uniform(
        np.maximum(numbers.lower, -np.pi), np.minimum(numbers.upper, np.pi), (60, 6)
    )
    status = arm.ik_numeric(arm.fk(q)).status
    assert np.mean(status == "ok") > 0.98


def test_a_xacro_file_has_a_cure(capsys):
    _, said = words(capsys, "info", str(DATA / "u23_xacro_message" / "arm.urdf.xacro"))
    assert "xacro" in said.replace("arm.urdf.xacro", "")


# Answers and programs


def test_coriolis_terms_at_numbers_are_not_called_skew_or_not():
    report = Arm.load(DATA / "s04_coriolis_note_at_numbers" / "rr.toml").grade(
        C=[["-0.09996*s2*qd2", "-0.09996*s2*(qd1+qd2)"], ["0.09996*s2*qd1", "0"]]
    )
    assert report.verdict.value.startswith("correct")
    assert not any("not_skew" in str(note) for note in report.notes)


def test_forward_kinematics_in_millimetres_are_recognised(capsys):
    file = DATA / "s08_fk_in_mm" / "mine.py"
    _, said = words(capsys, "check", "planar2r", str(file), "--seed", "1", "--samples", "40")
    assert "whose axis is wrong" not in said
    assert any(unit in said for unit in ("mm", "millimet", "factor of 1000", "1000 times"))
