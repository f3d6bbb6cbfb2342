"""Mass matrices that are singular everywhere, or somewhere; and arms whose numbers are unusual."""

import logging
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from acceptance import different_robots_first
from dhkit.description import Body, Inertia, from_dh, library_robot, robots, with_payload
from dhkit.dynamics import forward_dynamics, inverse_dynamics, mass_matrix
from dhkit.errors import DescriptionError
from dhkit.expressions import ZERO, exact
from dhkit.model import pinocchio_model
from dynamics_reference import hold, motions


def without_drives(arm):
    return replace(arm, joints=tuple(replace(joint, drive=None) for joint in arm.joints))


def with_bodies(arm, *bodies):
    return replace(
        arm,
        joints=tuple(
            replace(j, bodies=(body,)) for j, body in zip(arm.joints, bodies, strict=True)
        ),
    )


def point(mass, x):
    return Body(exact(mass), (exact(x), ZERO, ZERO), Inertia())


def test_a_wrist_without_inertia_is_named():
    # The masses of UR3 and UR5 are often published without inertia.
    arm = without_drives(library_robot("ur3"))
    arm = with_bodies(arm, *(replace(joint.body, inertia=Inertia()) for joint in arm.joints))
    with pytest.raises(
        DescriptionError,
        match=r"ur3: the mass matrix is singular: joint 6 \(\w+\) carries no inertia",
    ):
        forward_dynamics(arm, np.zeros(6), np.zeros(6), np.zeros(6))
    assert np.all(np.isfinite(inverse_dynamics(arm, np.zeros(6), np.zeros(6), np.zeros(6))))


def test_a_joint_whose_link_carries_nothing_of_its_own_is_named():
    # Two joints about one axis: what the second carries swings freely, the first has nothing but that.
    arm = with_bodies(from_dh([(0, 0, 0, 0), (0, 0, 0.3, 0)]), point(0, 0), point(1, 0.1))
    with pytest.raises(DescriptionError, match=r"joint 1 \(joint1\) carries no inertia"):
        forward_dynamics(arm, np.zeros((3, 2)), np.zeros(2), np.zeros(2))


def test_a_state_without_an_answer_is_nan_and_in_the_log(caplog):
    # A point mass that comes onto the axis of the first joint when the second is stretched upwards.
    arm = with_bodies(from_dh([(0, 0, 0, "pi/2"), (0, 0, 0.3, 0)]), point(0, 0), point(1, 0))
    q = np.array([[0.3, 0.2], [0.1, np.pi / 2], [np.nan, 0.0], [0.0, -0.4]])
    with caplog.at_level(logging.WARNING, "dhkit"):
        qdd = forward_dynamics(arm, q, np.zeros(2), np.ones(2))
    assert np.isnan(qdd).all(axis=1).tolist() == [False, True, True, False]
    (record,) = caplog.records
    assert "1 of 4 states" in record.getMessage()
    assert "joint 1 (joint1) carries no inertia there" in record.getMessage()


def test_angles_too_large_are_nan_without_a_warning(caplog):
    arm = library_robot("puma560")
    q = np.zeros((2, 6))
    q[1, 1] = 1e8
    assert np.isnan(forward_dynamics(arm, q, np.zeros(6), np.zeros(6))).all(axis=1).tolist() == [
        False,
        True,
    ]
    assert not caplog.records


@pytest.mark.parametrize("kinds", ["R", "P", "RP", "PR", "PRP", "PPP", "RPRP"])
@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_prismatic_joints_first_and_last_and_one_joint_arms(kinds, convention, law):
    law.samples(1000)
    rows = [
        (0.3, 0.1, 0.2, "pi/2"),
        (0.0, 0.2, 0.0, -0.4),
        (0.7, 0.0, 0.1, "pi"),
        (0.1, 0.1, 0.3, 0.2),
    ][: len(kinds)]
    arm = from_dh(rows, kinds=kinds, convention=convention)
    body = Body(
        exact(2),
        (exact(0.1), exact(0.05), exact(-0.2)),
        Inertia(xx=exact(0.1), yy=exact(0.2), zz=exact(0.15), xy=exact(0.02)),
    )
    arm = with_bodies(arm, *[body] * len(kinds))
    q, qd, x = motions(arm, 10)
    ours = {
        "M": mass_matrix(arm, q),
        "tau": inverse_dynamics(arm, q, qd, x),
        "qdd": forward_dynamics(arm, q, qd, x),
    }
    hold(law, arm, ours, q, qd, x, "of short arms")


def test_a_wrench_is_pinocchios_external_force(law):
    arm = library_robot("puma560")
    arm = with_payload(arm, 1.5, (0.1, 0, 0.05))
    model = pinocchio_model(arm)
    data, tool = model.createData(), model.getFrameId("tool")
    wrench = np.array([3.0, -2.0, 5.0, 0.4, 0.5, -0.6])
    for q, qd, qdd in zip(*motions(arm, law.samples(1000)), strict=True):
        pin.framesForwardKinematics(model, data, q)
        at_tool = pin.SE3(np.eye(3), data.oMf[tool].translation)
        forces = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
        forces[model.njoints - 1] = data.oMi[model.njoints - 1].actInv(
            at_tool.act(pin.Force(wrench))
        )
        theirs = pin.rnea(model, data, q, qd, qdd, forces)
        error = (
            np.abs(inverse_dynamics(arm, q, qd, qdd, wrench=wrench) - theirs).max()
            / np.abs(theirs).max()
        )
        law.holds("tau with a wrench against Pinocchio", error, 1e-12, q)


@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_the_library_can_be_accelerated(name):
    arm = library_robot(name)
    assert np.all(np.isfinite(forward_dynamics(arm, *motions(arm, 3))))
