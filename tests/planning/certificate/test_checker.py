"""A certificate for any motion: limits of one's own, jumps between pieces, payloads and friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dhkit
from dhkit import Arm, Limits, Trajectory
from dhkit.description import from_dh
from dhkit.expressions import exact
from dhkit.planning import Payload, certify
from dhkit.planning.certificate.checker import _proved_check
from dhkit.planning.criteria import Limit


def test_a_motion_is_certified_against_the_arms_limits_or_others():
    arm = Arm.load("planar2r")
    motion = arm.quintic([0, 0], [1.0, 0.5])
    assert arm.certify(motion).ok
    slow = Limits.of(
        arm.description,
        velocity=0.5 * np.abs(motion.qd(np.linspace(0, motion.duration, 500))).max(axis=0),
    )
    certificate = arm.certify(motion, slow)
    assert not certificate.ok
    assert certificate.worst.what == "velocity"
    assert certificate.violation == pytest.approx(1.0, rel=1e-3)
    assert arm.certify(motion, Limits.of(arm.description, jerk=1e-3)).worst.what == "jerk"


def test_a_polynomial_that_overflows_is_not_certified():
    limits = Limits([-3.0], [3.0], *([np.inf],) * 4)
    arm = dhkit.Arm.from_dh([(0, 0, 1, 0)])
    motion = Trajectory(arm.description, [0, 1e3], [[[0.0], [1e306], [-1e306], [1e303]]])
    with np.errstate(all="ignore"):
        check = _proved_check(motion, limits, Limit.POSITION)
    assert check.excess == np.inf


@pytest.mark.slow
def test_what_is_not_checked_is_said():
    rows = [(0, 0.3, 0, "pi/2"), (0, 0, 0.4, 0), (0, 0, 0.3, 0)]
    bare = dhkit.Arm.from_dh(rows).with_limits(velocity=[2.0] * 3, torque=[50.0] * 3)
    certificate = bare.certify(bare.quintic([0, 0, 0], [1, 0.5, 0.4]))
    assert certificate.not_checked == (
        "torques, as the links of joint1, joint2, joint3 have no body",
    )
    assert "<li>not checked: torques" in certificate._repr_html_()
    arm = dhkit.Arm.load("panda")
    swing = arm.quintic("ready", np.array([0.2, -0.4, 0.1, -2.0, 0.1, 1.7, 0.9]))
    assert arm.certify(swing, self_collision=True, clearance=0.001).not_checked == (
        "link 1 and link 3, link 3 and link 5, which overlap in all sampled configurations",
    )
    assert arm.certify(swing).not_checked == ()


@pytest.mark.slow
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


@pytest.mark.slow
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


def roots_between_states(count=24):
    """Return coefficients of a joint's value whose rate vanishes at so many even times, and is 3 between them."""
    polynomial = np.polynomial.polynomial
    rate = polynomial.polyfromroots(np.linspace(0, 1, count))
    s = np.linspace(0, 1, 20_001)
    return polynomial.polyint(rate) * 3 / np.abs(polynomial.polyval(s, rate)).max()


def motion_of(*columns):
    coefficients = np.zeros((1, max(map(len, columns)), 2))
    for i, column in enumerate(columns):
        coefficients[0, : len(column), i] = column
    return Trajectory(ARM.description, [0, 1], coefficients)


ARM = Arm.load("planar2r")
FREE = {"torque": np.inf, "velocity": np.inf, "acceleration": np.inf}
NOT_KEPT = {
    "jumps of acceleration where jerk is limited": (
        ARM.trapezoidal([0, 0], [0.5, 0.5]),
        Limits.of(ARM.description, jerk=0.01),
        "jump of acceleration",
    ),
    "jerk inside an interval": (
        motion_of([0, 0, 0, 0, 60 / 24, -60 / 60]),
        Limits.of(ARM.description, jerk=1.0, **FREE),
        "jerk",
    ),
    "an upper limit alone": (
        ARM.quintic([0, 0], [2, 0.5], duration=5),
        Limits.of(ARM.description, lower=-np.inf, upper=0.1),
        "position",
    ),
    "a rate between states": (
        motion_of(roots_between_states()),
        Limits.of(ARM.description, velocity=1.0, torque=np.inf),
        "velocity",
    ),
}


@pytest.mark.parametrize("name", NOT_KEPT)
def test_what_is_not_kept_is_seen(name):
    motion, limits, what = NOT_KEPT[name]
    certificate = ARM.certify(motion, limits)
    assert not certificate.ok
    assert what in [check.what for check in certificate.checks if check.excess > 0]


def test_planned_motions_with_limited_jerk_stay_certified():
    limits = Limits.of(ARM.description, jerk=200, acceleration=20)
    motion = ARM.plan([0, 0], [1, 1], limits=limits, intervals=24, compare=False)
    assert ARM.certify(motion, limits).ok


def test_arguments_are_checked():
    motion = ARM.quintic([0, 0], [1, 1])
    one = Arm.from_dh([(0, 0, 0.5, 0)], kinds="R", name="one")
    with pytest.raises(ValueError, match="limits are of 1 joints; expected 2"):
        ARM.certify(motion, Limits.of(one))
    for wrong in ((None,), ("m.npz",), (motion, {"velocity": 1}), (motion, None, None, 2.0)):
        with pytest.raises(TypeError, match="expected"):
            ARM.certify(*wrong)


def test_a_table_read_as_samples_keeps_its_payload(tmp_path):
    motion = ARM.quintic("zero", "ready", duration=0.35).carrying(dhkit.Payload(6.0))
    text = motion.save(tmp_path / "loaded.csv").read_text()
    for changed in (
        text,
        f"\n{text}",
        text.replace("# dhkit", "#  DHkit"),
        text.replace("# payload:", "#payload :"),
    ):
        (tmp_path / "changed.csv").write_text(changed)
        again = Trajectory.read(tmp_path / "changed.csv", ARM)
        assert again.payload == motion.payload
        assert not ARM.certify(again).ok


@pytest.mark.parametrize("turns", [11.5, 23, 46])
def test_whole_turns_between_the_points_of_a_piece_are_seen(turns):
    """23 turns in 23 steps put all states of a piece at one phase of gravity."""
    arm = from_dh(
        [(0, 0, 1.0, 0)], bodies=[{"mass": 1, "com": [-0.5, 0, 0], "inertia": np.eye(3) * 0.01}]
    )
    arm = replace(arm, gravity=(exact(0), exact(-9.81), exact(0)))
    rate = 2 * np.pi * turns / 2.0
    motion = Trajectory.from_samples(
        arm, [0, 2.0], [[-np.pi / 2], [-np.pi / 2 + 2 * rate]], [[rate], [rate]]
    )
    limits = Limits.of(arm, velocity=400.0, torque=3.0)
    certificate = certify(arm, motion, limits)
    assert not certificate.ok
    assert certificate.violation == pytest.approx(0.5 * 9.81 / 3 - 1, rel=1e-2)
