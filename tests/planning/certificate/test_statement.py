"""Statements of certificates: distances in millimetres, collisions that nobody looked for, and nothing cut off."""

import numpy as np
import pytest

import dhkit
from dhkit.planning import Obstacle
from dhkit.planning.certificate.checker import Check
from dhkit.trajectories import Limits, Trajectory


@pytest.fixture(scope="module")
def arm():
    return dhkit.Arm.load("puma560")


@pytest.fixture(scope="module")
def motion(arm):
    return arm.quintic("nominal", "ready", duration=3)


@pytest.fixture(scope="module")
def ball(arm, motion):
    """A ball around the tool in the middle of the motion."""
    return Obstacle.sphere(0.05, arm.fk(motion.q(1.5))[:3, 3], "ball")


@pytest.mark.parametrize("clearance", [0.0, 0.01])
def test_a_missed_clearance_is_told_in_millimetres(arm, motion, ball, clearance):
    certificate = arm.certify(motion, obstacles=[ball], clearance=clearance)
    missed = 1000 * certificate.violation
    overlap = missed - 1000 * clearance
    asked = f"{1000 * clearance:.3g} mm asked for"
    words = f"clearance missed by {missed:.3g} mm (an overlap of {overlap:.3g} mm found, {asked})"
    head, first, *_ = str(certificate).splitlines()
    assert head == f"1 limit exceeded, in {certificate.states} states by {certificate.reference}"
    assert first == f"{words}, at {certificate.worst.time:.4g} s"
    assert words in repr(certificate)
    assert words in certificate._repr_html_()


@pytest.mark.parametrize(
    ("check", "words"),
    [
        (
            Check("clearance", 0.004, 0, 1.0, False, 5, 0.01),
            "clearance missed by 4 mm (a distance of 6 mm found, 10 mm asked for)",
        ),
        (
            Check("clearance", 0.004, 0, 1.0, False, 5, 0.01, is_clearance_reduced=True),
            "clearance missed by 4 mm (10 mm asked for)",
        ),
        (Check("torque", 1.8, 0, 1.0, True, 4), "torque exceeded by 180 %"),
        (Check("jump of velocity", 0.2, 0, 1.0), "jump of velocity: 20 % of the motion's own size"),
        (Check("clearance", -0.002, 0, 1.0, False, 5, 0.01), "clearance kept"),
    ],
)
def test_a_check_says_what_is_exceeded(check, words):
    assert check.statement == words


def test_what_is_left_of_a_clearance_is_a_distance():
    assert Check("clearance", -0.0025, 0, 1.0, False, 5, 0.01).margin == "2.5 mm to spare"
    assert Check("torque", -0.25, 0, 1.0).margin == "25 % left"


@pytest.mark.parametrize("asked", [{}, {"self_collision": True}, {"obstacles": True}])
def test_a_bare_certificate_names_collisions_as_a_plan_does(arm, motion, asked):
    """The same words in the certificate of any motion, and in the report of a planned one."""
    far = {"obstacles": [Obstacle.sphere(0.1, (3.0, 0.0, 0.0), "far")]}
    options = far if "obstacles" in asked else asked
    certificate = arm.certify(motion, **options)
    planned = arm.plan("nominal", "ready", compare=False, intervals=12, **options)
    words = planned.report.collisions_not_asked_for
    assert certificate.collisions_not_asked_for == words
    assert planned.report.certificate.collisions_not_asked_for == words
    line = f"collisions not looked for: {words}"
    assert line in str(planned.report).splitlines()
    assert line in str(certificate).splitlines()
    assert line in repr(certificate)
    assert line in certificate._repr_html_()


def test_nothing_is_not_asked_for_where_all_was(arm, motion, ball):
    certificate = arm.certify(motion, obstacles=[ball], self_collision=True)
    assert certificate.collisions_not_asked_for == ""
    assert "not looked for" not in str(certificate)


def test_a_print_is_not_cut_off(arm, motion, ball):
    certificate = arm.certify(motion, obstacles=[ball], self_collision=True, independent=True)
    text = str(certificate)
    assert "…" not in text
    for part in (*certificate.not_checked, *certificate.sampled):
        assert part in text
    refuted = certificate.independent.refutations
    assert len(refuted) > 1
    for one in refuted:
        assert one.statement in text
        assert "mm found" in one.statement


def test_a_print_has_every_limit_that_is_exceeded(arm):
    fast = arm.quintic("nominal", "ready", duration=0.5)
    limits = Limits.of(arm.description, acceleration=0.1)
    certificate = arm.certify(fast, limits, independent=True)
    exceeded = [check for check in certificate.checks if check.excess > 0]
    assert len(exceeded) > 1
    for check in exceeded:
        assert f"{check.statement}, joint {check.row + 1}, at " in str(certificate)
    assert all("% of its limit" in one.statement for one in certificate.independent.refutations)


def test_a_jump_is_told_as_one():
    planar = dhkit.Arm.load("planar2r")
    coefficients = np.array([[[0.0, 0.1], [1.0, 1.0]], [[5.0, 1.1], [1.0, 1.0]]])
    broken = Trajectory(planar.description, np.array([0.0, 1.0, 2.0]), coefficients)
    assert "jump of position: " in str(planar.certify(broken))
