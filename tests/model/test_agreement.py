"""Three readers of one table agree: our frames, Pinocchio's and yourdfpy's from the URDF that dhkit writes."""

import subprocess

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from hypothesis import given

from dhkit.description import library_robot, robots, world_to_frames, world_to_tool
from dhkit.kinematics import jacobian, jacobian_dot
from dhkit.model import pinocchio_model, urdf_text, write_urdf
from dhkit.verification import random_states, verify
from random_arms import arms, states, tables

FRAMES = 1e-13
JACOBIANS = 1e-12
DIFFERENCES = 1e-6
MASSES = 1e-12
STEP = 1e-6  # rad or m: central differences then err by about 1e-10 in theory and rounding alike


def yourdfpy_frames(text, tmp_path, q):
    """Frames dh0 ... dhn and tool of one state, by yourdfpy."""
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    robot = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    names = [*(f"dh{i}" for i in range(len(q[0]) + 1)), "tool"]
    for state in q:
        robot.update_cfg(state)
        yield np.array([robot.get_transform(name, "world") for name in names])


def central_difference(arm, q):
    """The tool's Jacobian by moving each joint: linear velocity and the rotation's axial vector."""
    J = np.empty((6, arm.n))
    for i in range(arm.n):
        step = np.zeros(arm.n)
        step[i] = STEP
        ahead, behind = world_to_tool(arm, q + step), world_to_tool(arm, q - step)
        J[:3, i] = (ahead[:3, 3] - behind[:3, 3]) / (2 * STEP)
        spin = ahead[:3, :3] @ behind[:3, :3].T
        J[3:, i] = np.array(
            [spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]
        ) / (4 * STEP)
    return J


@pytest.mark.parametrize("name", robots())
def test_library_robots_agree_with_yourdfpy(name, law, tmp_path):
    arm = library_robot(name)
    q = random_states(arm, law.samples(1000))
    ours = np.concatenate([world_to_frames(arm, q), world_to_tool(arm, q)[:, None]], axis=1)
    scale = max(1.0, arm.reach)
    for frames, theirs in zip(ours, yourdfpy_frames(urdf_text(arm), tmp_path, q), strict=True):
        difference = np.abs(frames - theirs)
        law.holds(
            "frame positions against yourdfpy", difference[:, :3, 3].max() / scale, FRAMES, name
        )
        law.holds("frame rotations against yourdfpy", difference[:, :3, :3].max(), FRAMES, name)


@pytest.mark.parametrize("name", robots())
def test_jacobians_agree_with_central_differences(name, law):
    arm = library_robot(name)
    scale = max(1.0, arm.reach)
    rng = np.random.default_rng(5)
    for q in random_states(arm, law.samples(1000)):
        difference = np.abs(jacobian(arm, q) - central_difference(arm, q))
        error = max(difference[:3].max() / scale, difference[3:].max())
        law.holds("Jacobian against central differences", error, DIFFERENCES, name)
        qd = rng.uniform(-1, 1, arm.n)
        for frame in ("world", "tool"):
            numeric = (
                jacobian(arm, q + STEP * qd, frame) - jacobian(arm, q - STEP * qd, frame)
            ) / (2 * STEP)
            difference = np.abs(jacobian_dot(arm, q, qd, frame) - numeric)
            error = max(difference[:3].max() / scale, difference[3:].max())
            law.holds("Jacobian's rate against central differences", error, DIFFERENCES, name)


@pytest.mark.parametrize("name", robots())
def test_check_urdf_accepts_the_library(name, tmp_path, check_urdf):
    for path in write_urdf(library_robot(name), tmp_path / f"{name}.urdf"):
        if path.suffix == ".urdf":
            done = subprocess.run(
                [check_urdf, str(path)], capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, done.stderr
            assert "Successfully Parsed XML" in done.stdout


@given(tables())
def test_any_table_agrees_with_pinocchio_and_yourdfpy(tmp_path, law, arm):
    law.samples(1000)
    for agreement in verify(arm, 5).agreements:
        law.holds(
            f"{agreement.quantity} against Pinocchio", agreement.error, agreement.tolerance, arm
        )
    scale = max(1.0, arm.reach)
    q = states(arm, 3)
    ours = np.concatenate([world_to_frames(arm, q), world_to_tool(arm, q)[:, None]], axis=1)
    if yourdfpy_can_read(arm):
        for frames, theirs in zip(ours, yourdfpy_frames(urdf_text(arm), tmp_path, q), strict=True):
            difference = np.abs(frames - theirs)
            law.holds(
                "frame positions against yourdfpy", difference[:, :3, 3].max() / scale, FRAMES, arm
            )
            law.holds("frame rotations against yourdfpy", difference[:, :3, :3].max(), FRAMES, arm)
    model = pinocchio_model(arm)
    data, tool = model.createData(), model.getFrameId("tool")
    qd = states(arm, 3, seed=1)
    for state, rate in zip(q, qd, strict=True):
        pin.computeJointJacobiansTimeVariation(model, data, state, rate)
        pin.updateFramePlacements(model, data)
        for frame, axes in (("world", pin.LOCAL_WORLD_ALIGNED), ("tool", pin.LOCAL)):
            theirs = np.reshape(
                pin.getFrameJacobianTimeVariation(model, data, tool, axes), (6, arm.n)
            )
            difference = np.abs(jacobian_dot(arm, state, rate, frame) - theirs)
            # Speeds add up to that.
            error = max(difference[:3].max() / scale, difference[3:].max()) / (np.pi * arm.n)
            law.holds("Jacobian's rate against Pinocchio", error, JACOBIANS, arm)


def yourdfpy_can_read(arm) -> bool:
    """Trimesh, which multiplies yourdfpy's frames, takes a transform within 1e-8 of the identity for the identity."""
    small = (*arm.numbers.sin_alpha, *arm.numbers.sin_theta, *arm.numbers.a, *arm.numbers.d)
    placed = np.concatenate(
        [(T - np.eye(4)).ravel() for T in (arm.numbers.T_world_base, arm.numbers.T_last_tool)]
    )
    return not any(0 < abs(x) < 1e-7 for x in (*small, *placed))


def mass_matrix(arm, q):
    """The sum over links of m Jc^T Jc + Jw^T R I R^T Jw, Jacobians by differencing nothing: from the frames' axes."""
    numbers, n = arm.numbers, arm.n
    T = world_to_frames(arm, q)
    first = 0 if arm.convention.value == "standard" else 1
    M = np.diag(numbers.armature)
    for i in range(n):
        R = T[i + 1, :3, :3]
        com = T[i + 1, :3, 3] + R @ numbers.com[i]
        linear, angular = np.zeros((3, n)), np.zeros((3, n))
        for k in range(i + 1):
            axis, point = T[k + first, :3, 2], T[k + first, :3, 3]
            if numbers.prismatic[k]:
                linear[:, k] = axis
            else:
                linear[:, k], angular[:, k] = np.cross(axis, com - point), axis
        M += (
            numbers.mass[i] * linear.T @ linear + angular.T @ R @ numbers.inertia[i] @ R.T @ angular
        )
    return M


def hold_masses(arm, count):
    model = pinocchio_model(arm)
    data = model.createData()
    yield (
        "total mass",
        abs(pin.computeTotalMass(model) - numbers_sum(arm)) / max(1.0, numbers_sum(arm)),
    )
    scale = max(1.0, arm.reach)
    for q in states(arm, count):
        M = np.array(pin.crba(model, data, q, pin.Convention.WORLD))
        M = np.triu(M) + np.triu(M, 1).T
        yield "mass matrix", np.abs(M - mass_matrix(arm, q)).max() / np.abs(M).max()
        T = world_to_frames(arm, q)[1:]
        coms = np.einsum("ijk,ik->ij", T[:, :3, :3], arm.numbers.com) + T[:, :3, 3]
        if numbers_sum(arm):
            com = arm.numbers.mass @ coms / numbers_sum(arm)
            yield "centre of mass", np.abs(pin.centerOfMass(model, data, q) - com).max() / scale


def numbers_sum(arm):
    return float(arm.numbers.mass.sum())


@pytest.mark.parametrize("name", robots())
def test_masses_of_library_robots_are_in_the_model(name, law):
    for quantity, error in hold_masses(library_robot(name), law.samples(1000)):
        law.holds(quantity, error, MASSES, name)


@given(arms())
def test_masses_of_any_arm_are_in_the_model(law, arm):
    law.samples(1000)
    for quantity, error in hold_masses(arm, 3):
        law.holds(quantity, error, MASSES, arm)
