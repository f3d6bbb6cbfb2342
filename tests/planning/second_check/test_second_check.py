"""The second check refutes what is wrong, and no certificate that is right."""

from dataclasses import replace

import numpy as np
import pytest

from dhkit import Arm, Friction, Limits, Obstacle, Payload, Trajectory
from dhkit.errors import PlanningError
from dhkit.planning.certificate import CollisionAvoidance
from dhkit.planning.obstacles import Floor
from dhkit.planning.second_check import Claim, recheck
from planning.second_check.random_motions import (
    KINDS,
    has_bodies,
    random_arm,
    random_case,
    random_scene,
    ranges,
)

PLANNED = ("library", "locked", "table", "urdf")
"""Kinds of arms of planned motions."""


@pytest.mark.slow
def test_no_certificate_is_refuted(law, tmp_path):
    """Of random motions with limits and clearances that a certificate just accepts, or with room."""
    certified = 0
    count = law.samples(1000, quick=len(KINDS) // 2)
    for k in range(count):
        case = random_case(np.random.default_rng(k), KINDS[k % len(KINDS)], tmp_path)
        if case.certify().ok:
            certified += 1
            second = case.certify(independent=True).independent
            law.holds(
                "refuted certificates", len(second.refutations), 0, (k, case, second.refutations)
            )
    assert certified >= 0.9 * count


@pytest.mark.slow
def test_no_planned_motion_is_refuted(law, tmp_path):
    """Of arms between random configurations, among random solids."""
    found = 0
    count = law.samples(100, quick=3)
    for k in range(count):
        rng = np.random.default_rng(1000 + k)
        arm = random_arm(rng, PLANNED[k % len(PLANNED)], tmp_path)
        if not has_bodies(arm):
            arm = arm.with_limits(velocity=1.0)
        lower, upper = ranges(arm)
        ends = rng.uniform(lower, upper, (2, arm.n))
        scene = random_scene(rng, arm, ends)
        itself = bool(rng.random() < 0.5)
        gaps = arm.distance(ends, scene, self_collision=True)
        scene = [
            item for item, gap in zip(scene, gaps.per_obstacle.T, strict=True) if gap.min() > 0
        ]
        itself = itself and bool(gaps.itself.min() > 0)
        options = {"obstacles": scene, "clearance": 0.005, "self_collision": itself}
        try:
            motion = arm.plan(*ends, **options, intervals=12, max_iterations=300, compare=False)
        except PlanningError:
            continue
        found += 1
        certificate = arm.certify(motion, **options, independent=True)
        # Where the clearance is reduced all the way, `certify` asks for all of it between the ends.
        assert certificate.ok or motion.report.is_clearance_reduced_throughout, (k, certificate)
        refuted = certificate.independent.refutations
        law.holds("refuted certificates", len(refuted), 0, (k, arm, refuted))
    assert found >= count / 2


@pytest.fixture(scope="module")
def puma():
    return Arm.load("puma560")


@pytest.fixture(scope="module")
def motion(puma):
    return puma.quintic(
        [0.1, 0.4, -0.3, 0.2, 0.5, 0.1], [1.2, -0.6, 0.5, -0.8, -0.4, 0.9], duration=1.0
    )


def peaks(arm, motion, **torque_options):
    """Return the largest magnitudes along a motion, at 20,001 states."""
    t = np.linspace(0, motion.duration, 20_001)
    q, qd, qdd = motion.q(t), motion.qd(t), motion.qdd(t)
    tau = arm.inverse_dynamics(q, qd, qdd, **torque_options)
    own = {"velocity": qd, "acceleration": qdd, "jerk": motion.jerk(t), "torque": tau}
    return {name: np.abs(values).max(axis=0) for name, values in own.items()}


@pytest.mark.parametrize("kind", ["velocity", "acceleration", "jerk", "torque"])
@pytest.mark.parametrize("joint", [0, 1, 5])
def test_a_limit_is_refuted_to_a_hundred_thousandth(kind, joint, puma, motion):
    largest = peaks(puma, motion)[kind][joint]
    free = np.full(6, np.inf)
    for factor, refuted in ((1 - 1e-5, True), (1 + 1e-5, False)):
        limit = free.copy()
        limit[joint] = factor * largest
        limits = replace(Limits(-free, free, free, free, free, free), **{kind: limit})
        found = recheck(puma.description, motion, limits).refutations
        assert [one.what for one in found] == [f"{kind} of {puma.joint_names[joint]}"] * refuted


def test_positions_are_refuted(puma, motion):
    upper = motion.q(np.linspace(0, 1, 1001)).max(axis=0)
    limits = Limits.of(puma, lower=-10, upper=upper - 1e-4, velocity=np.inf, torque=np.inf)
    found = recheck(puma.description, motion, limits).refutations
    assert {one.what for one in found} == {f"position of {name}" for name in puma.joint_names}


def test_torques_include_payload_friction_and_drives_that_two_joints_turn(puma, motion):
    load = Payload(2.0, com=(0.05, 0, 0.1), inertia=0.01 * np.eye(3))
    manutec = Arm.load("manutec_r3")
    swing = manutec.quintic(np.zeros(3), [0.5, 0.6, -0.7], duration=1.0)
    for arm, along, payload, friction in (
        (puma, motion, load, None),
        (puma, motion, None, Friction()),
        (puma, motion, load, Friction(0.1)),
        (manutec, swing, None, None),
    ):
        loaded = arm if payload is None else arm.with_payload(payload)
        largest = peaks(loaded, along, friction=friction or False)["torque"]
        for factor, refuted in ((1 - 1e-5, arm.n), (1 + 1e-5, 0)):
            limits = Limits.of(arm, lower=-10, upper=10, velocity=np.inf, torque=factor * largest)
            found = recheck(arm.description, along, limits, payload, friction).refutations
            assert len(found) == refuted, (arm, payload, friction, found)


def test_a_jump_is_refuted(puma):
    q = np.zeros(6)
    leap = Trajectory(puma.description, [0, 1, 2], [[q, q], [q + 1e-3, q]])
    found = recheck(puma.description, leap, Limits.of(puma)).refutations
    assert found[0].what == "jump of position of joint 1" and found[0].time == 1.0


FREE = {"velocity": np.inf, "torque": np.inf}


def test_a_needle_that_is_passed_between_two_states_is_found(puma):
    """It is 1 mm thick, and stands where link 3 passes in a small part of its way."""
    motion = puma.quintic([-1.5, -0.5, 0, 0, 0, 0], [1.5, -0.5, 0, 0, 0, 0], duration=0.2)
    at = motion.q(0.1317)
    reach = puma.frames(at)[..., 3, :3, 3]
    up = np.array([0, 0, 0.05])
    needle = Obstacle.capsule(5e-4, reach - up, reach + up, name="needle")
    limits = Limits.of(puma, lower=-10, upper=10, **FREE)
    second = recheck(puma.description, motion, limits, claims=[Claim(3, needle, 0.01)])
    assert [one.what for one in second.refutations] == ["distance of link 3 and needle"]


def test_distances_are_refuted_and_no_foot_on_the_floor(puma, motion):
    ball = Obstacle.sphere(0.05, (0.5, 0.5, 0.4), name="ball")
    limits = Limits.of(puma, lower=-10, upper=10, **FREE)
    q = motion.q(np.linspace(0, 1, 300))
    least = recheck(
        puma.description, motion, limits, claims=[Claim(3, ball, 1.0)]
    ).smallest_distance
    assert least >= puma.distance(q, [ball]).distance.min() - 1e-3  # shapes lie in capsules
    for kept, refuted in ((least, False), (1.2 * least + 2e-3, True)):
        assert (
            recheck(puma.description, motion, limits, claims=[Claim(3, ball, kept)]).ok
            is not refuted
        )
    on_floor = [Claim(link, Floor(), 0.01) for link in range(1, 7)]
    assert recheck(puma.description, motion, limits, claims=on_floor).ok
    assert not recheck(puma.description, motion, limits, claims=[Claim(6, Floor(2.0), 0.01)]).ok


def test_a_certificate_that_overlooks_a_collision_is_refuted(puma, motion, monkeypatch):
    through = puma.frames(motion.q(0.5))[..., 4, :3, 3]
    scene = [Obstacle.sphere(0.05, through, name="ball")]
    limits = Limits.of(puma, lower=-10, upper=10, **FREE)
    monkeypatch.setattr(
        CollisionAvoidance, "shortfalls", lambda self, states: np.full(len(states.q), -1.0)
    )
    assert puma.certify(motion, limits, obstacles=scene).ok
    certificate = puma.certify(motion, limits, obstacles=scene, independent=True)
    assert not certificate.ok and certificate.violation <= 0
    assert "refuted by the second check, " in repr(certificate)
    assert "ball" in certificate.independent.refutations[0].what


@pytest.mark.slow
def test_planned_motions_are_not_refuted(puma):
    scene = [Obstacle.box((0.1, 0.1, 0.6), (0.55, 0.2, 0.3), name="post"), Floor()]
    start, goal = [-0.6, -0.3, 0.2, 0, 0.5, 0], [1.4, -0.2, 0.1, 0, 0.4, 0]
    motion = puma.plan(start, goal, obstacles=scene, clearance=0.02, self_collision=True)
    certificate = puma.certify(
        motion, obstacles=scene, clearance=0.02, self_collision=True, independent=True
    )
    assert certificate.ok and certificate.independent.smallest_distance < 0.1
