"""A certificate for any motion: limits of one's own, jumps between pieces, payloads and friction."""

from __future__ import annotations

import numpy as np
import pytest

import dhkit
from dhkit import Arm, Limits, Trajectory
from dhkit.planning import Payload


def test_a_motion_is_certified_against_the_arms_limits_or_others():
    arm = Arm.load("planar2r")
    motion = arm.quintic([0, 0], [1.0, 0.5])
    assert arm.certify(motion).ok
    slow = Limits.of(
        arm.description, velocity=0.5 * np.abs(motion.qd(np.linspace(0, motion.duration, 500))).max(axis=0)
    )
    certificate = arm.certify(motion, slow)
    assert not certificate.ok
    assert certificate.worst.what == "velocity"
    assert certificate.violation == pytest.approx(1.0, rel=1e-3)
    assert arm.certify(motion, Limits.of(arm.description, jerk=1e-3)).worst.what == "jerk"


def test_a_payload_and_friction_count():
    arm = Arm.load("puma560")
    motion = arm.plan("ready", "nominal")
    assert motion.report.certificate.ok
    assert arm.certify(motion).ok
    heavy = arm.certify(motion, payload=Payload(5.0))
    assert heavy.violation > 0.01
    assert heavy.worst.what == "torque"
    assert arm.certify(motion, friction=True).violation > 0


@pytest.mark.parametrize(("order", "what"), [(0, "jump of position"), (1, "jump of velocity")])
def test_jumps_between_pieces_are_seen(order, what):
    arm = Arm.load("planar2r")
    coefficients = np.zeros((2, 4, 2))
    coefficients[1, order, 1] = 1e-3
    motion = Trajectory(arm, [0.0, 1.0, 2.0], coefficients)
    certificate = arm.certify(motion)
    assert not certificate.ok
    assert certificate.worst.what == what
    assert (certificate.worst.row, certificate.worst.time) == (1, 1.0)


def test_a_motion_of_another_arm_is_refused():
    with pytest.raises(dhkit.DescriptionError, match="the trajectory is one of planar2r"):
        Arm.load("puma560").certify(Arm.load("planar2r").quintic([0, 0], [1, 1], 1.0))


def test_a_motion_keeps_its_payload_and_friction(tmp_path):
    arm = Arm.load("puma560")
    load = dhkit.Payload(2.0, (0, 0, 0.05))
    motion = arm.plan("ready", "nominal", payload=load, friction=True)
    assert motion.payload == load and motion.friction is not None
    assert motion.description == arm.description
    again = Trajectory.load(motion.save(tmp_path / "loaded.npz"))
    limits = arm.description.numbers.effort
    for one in (motion, again, again.slowed(1.0), again.reversed().reversed()):
        assert one.payload == load
        share = np.abs(one.sample(n=2001).tau) / limits
        assert 0.98 < share.max() < 1 + 1e-3
    assert arm.certify(again).ok
    assert not arm.certify(again, payload=dhkit.Payload(6.0)).ok
    bare = again.carrying()
    assert bare.payload is None and bare != again
    assert np.abs(bare.tau(0.1) - again.tau(0.1)).max() > 0.1
    with pytest.raises(ValueError, match="payload is None and then Payload"):
        bare.then(again.reversed())
