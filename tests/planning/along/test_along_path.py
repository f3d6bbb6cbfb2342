"""Motions along a path against the textbook's bang-bang, toppra, and limits on another grid by another library."""

from dataclasses import dataclass

import casadi
import numpy as np
import pytest

from acceptance import slow_if
from dhkit.description import library_robot, pose, world_to_tool
from dhkit.dynamics import friction_torque, gravity_torque, inverse_dynamics, mass_matrix
from dhkit.errors import PlanningError
from dhkit.planning import (
    Constraint,
    Effort,
    Energy,
    Jerk,
    MotorPower,
    Obstacle,
    Planner,
    Time,
    ToolAcceleration,
    ToolDirection,
    ToolOrientation,
    ToolSpeed,
    TorqueSpeedLine,
    along_path,
)
from dhkit.planning.criteria.states import gear_ratios
from dhkit.trajectories import JointPath, Limits, joint_path, tool_line
from trajectories_reference import reference_torques

KEPT = 1e-6
"""By what share of a limit a motion may exceed it."""
GRID = 2e-4
"""What 200 intervals and the interior-point method's distance from its limits cost in duration."""
NEAR_TOPPRA = 5e-3
ON_THE_LINE = 1e-6
"""m."""
LINES = {"puma560": "nominal", "panda": "ready", "cobra600": "nominal"}
PUMA, COBRA, ARM = library_robot("puma560"), library_robot("cobra600"), library_robot("planar2r")
STEP, BY_DIFFERENCES = 1e-4, 1e-4
"""s, and what second differences miss of an acceleration."""
SLIDE = 2
"""The cobra's prismatic joint, and where it begins."""
HOME = np.array([0.2, -0.4, 0.01, 0.0])
WRIST = np.array(
    [[-0.325, 2.415, 0.449, 1.812, -0.376, -0.035], [-0.149, 1.976, 0.505, 1.583, 0.004, -0.471]]
)
"""Where a line of the PUMA's tool begins and where it ends, next to a singularity."""
STRONG = Limits.of(COBRA, velocity=np.inf, torque=2e3)


def slide(d):
    return JointPath.straight(COBRA, HOME, HOME + d * np.eye(4)[SLIDE])


def random_straight(description, seed):
    limits = Limits.of(description)
    ends = np.random.default_rng(seed).uniform(limits.lower, limits.upper, (2, description.n))
    return JointPath.straight(description, *ends)


def line_of(name):
    arm = library_robot(name)
    q = arm.numbers.configurations[LINES[name]]
    T0 = world_to_tool(arm, q)
    T1 = pose([0, 0, 0], euler=[0, 0, 0.3]) @ T0
    T1[:3, 3] = T0[:3, 3] + ([0.03, -0.15, 0.05] if arm.n == 4 else [-0.1, -0.12, 0.05])
    return arm, T0, T1, joint_path(arm, tool_line(T0, T1), q)


def excess(motion, limits):
    """Return by what share limits are exceeded at most on a grid of 1 kHz, torques by Pinocchio."""
    t = motion.sample_times(1000.0)
    values = (motion.q(t), motion.qd(t), motion.qdd(t))
    tau = reference_torques(motion.description)(*values)
    used = [abs(x) / most for x, most in zip((*values[1:], tau), limits_of(limits), strict=True)]
    return max(float(np.max(use)) for use in used) - 1


def limits_of(limits):
    return limits.velocity, limits.acceleration, limits.torque


@pytest.fixture(scope="module")
def tool_motion():
    arm, *_, path = line_of("puma560")
    return arm, path, along_path(arm, path)


# What is known in closed form


@pytest.mark.parametrize(("d", "v", "a"), [(0.2, 0.3, 2.0), (0.1, 5.0, 3.0), (0.05, 0.01, 40.0)])
def test_a_slide_is_bang_bang(d, v, a):
    limits = Limits.of(COBRA, velocity=v, acceleration=a, torque=np.inf)
    best = d / v + v / a if d > v**2 / a else 2 * np.sqrt(d / a)
    motion = along_path(COBRA, slide(d), limits=limits)
    assert motion.duration == pytest.approx(best, rel=GRID)
    assert motion.duration >= best


def test_gravity_makes_starting_and_stopping_differ():
    force = Limits.of(COBRA).torque[SLIDE]
    mass, weight = mass_matrix(COBRA, HOME)[SLIDE, SLIDE], gravity_torque(COBRA, HOME)[SLIDE]
    assert abs(weight) > 0.05 * force
    start, stop = (force - weight) / mass, (force + weight) / mass
    limits = Limits.of(COBRA, velocity=np.inf)
    best = np.sqrt(2 * 0.2 * (1 / start + 1 / stop))
    assert along_path(COBRA, slide(0.2), limits=limits).duration == pytest.approx(best, rel=GRID)


@pytest.mark.parametrize("duration", [0.3, 1.0])
def test_least_effort_is_a_cubic(duration):
    # Force m a + w on a slide: without weight the cubic, and weight adds w^2 T whatever the motion.
    mass, weight = mass_matrix(COBRA, HOME)[SLIDE, SLIDE], gravity_torque(COBRA, HOME)[SLIDE]
    motion = along_path(COBRA, slide(0.1), objective="effort", duration=duration, limits=STRONG)
    t = np.linspace(0, duration, 50)
    x = t / duration
    assert motion.duration == pytest.approx(duration, rel=1e-12)
    np.testing.assert_allclose(
        motion.q(t)[:, SLIDE], HOME[SLIDE] + 0.1 * x**2 * (3 - 2 * x), atol=0.1 * 1e-3
    )
    least = 12 * mass**2 * 0.1**2 / duration**3 + weight**2 * duration
    assert motion.report.cost == pytest.approx(least, rel=1e-3)


def test_time_and_effort_are_weighed():
    mass, weight = mass_matrix(COBRA, HOME)[SLIDE, SLIDE], gravity_torque(COBRA, HOME)[SLIDE]
    w = 1e-3
    best = (36 * w * mass**2 * 0.1**2 / (1 + w * weight**2)) ** 0.25
    motion = along_path(COBRA, slide(0.1), objective=Time() + w * Effort(), limits=STRONG)
    assert motion.duration == pytest.approx(best, rel=2e-3)


# Another library


@pytest.mark.parametrize("speed", [1, 3])
@pytest.mark.slow
def test_it_is_as_quick_as_toppra(speed, law):
    toppra = pytest.importorskip("toppra")
    limits = Limits.of(PUMA).scaled(velocity=speed)
    for seed in range(law.samples(100)):
        path = random_straight(PUMA, seed)
        motion = along_path(PUMA, path, limits=limits)
        other = toppra_duration(toppra, path, limits)
        law.holds("duration over toppra's", abs(motion.duration / other - 1), NEAR_TOPPRA, seed)
        law.holds("excess", excess(motion, limits), KEPT, seed)


@pytest.mark.parametrize("name", [slow_if(name == "panda", name) for name in LINES])
def test_it_is_as_quick_as_toppra_along_a_line(name):
    toppra = pytest.importorskip("toppra")
    arm, *_, path = line_of(name)
    other = toppra_duration(toppra, path, Limits.of(arm))
    assert along_path(arm, path).duration == pytest.approx(other, rel=NEAR_TOPPRA)


def toppra_duration(toppra, path, limits, points=500):
    """Return the duration by toppra's Interpolation scheme; Collocation exceeds torques between points."""
    arm = path.description

    class Geometry(toppra.interpolator.AbstractGeometricPath):
        dof, path_interval, waypoints = arm.n, np.array([0.0, 1.0]), None

        def __call__(self, s, order=0):
            return (path.q, path.qs, path.qss)[order](np.minimum(s, 1.0))

    scheme = toppra.constraint.DiscretizationType.Interpolation
    speed = toppra.constraint.JointVelocityConstraint(
        np.stack([-limits.velocity, limits.velocity], axis=1)
    )
    torque = toppra.constraint.JointTorqueConstraint(
        lambda q, qd, qdd: inverse_dynamics(arm, q, qd, qdd),
        np.stack([-limits.torque, limits.torque], axis=1),
        np.zeros(arm.n),
        discretization_scheme=scheme,
    )
    s = np.linspace(0, 1, points + 1)
    _, sd, *_ = toppra.algorithm.TOPPRA(
        [speed, torque], Geometry(), gridpoints=s
    ).compute_parameterization(0, 0)
    return float(np.sum(2 * np.diff(s) / (sd[1:] + sd[:-1])))


# The path and its limits are kept


@pytest.mark.parametrize("name", LINES)
def test_the_tool_stays_on_its_line(name):
    arm, T0, T1, path = line_of(name)
    motion = along_path(arm, path)
    x = world_to_tool(arm, motion.q(np.linspace(0, motion.duration, 20_000)))[:, :3, 3] - T0[:3, 3]
    u = (T1 - T0)[:3, 3] / np.linalg.norm((T1 - T0)[:3, 3])
    assert np.linalg.norm(x - np.outer(x @ u, u), axis=1).max() < ON_THE_LINE
    np.testing.assert_allclose(motion.q([0.0, motion.duration]), path.q([0.0, 1.0]), atol=1e-9)
    assert np.abs(motion.qd([0.0, motion.duration])).max() < 1e-9
    assert excess(motion, Limits.of(arm)) < KEPT
    assert motion.report.certificate.ok
    assert motion.report.certificate.any_active > 0.9


@pytest.mark.parametrize("intervals", [8, 12])
def test_what_a_coarse_grid_misses_is_made_good(intervals, tool_motion):
    arm, path, fine = tool_motion
    coarse = along_path(arm, path, intervals=intervals)
    assert (coarse.report.slow_down > 1) == (intervals == 12)
    assert (
        (coarse.report.intervals > intervals) == bool(coarse.report.tightened) == (intervals == 8)
    )
    assert excess(coarse, Limits.of(arm)) < KEPT
    assert fine.duration < coarse.duration < 1.01 * fine.duration


@pytest.mark.slow
def test_a_grid_is_finer_where_the_joints_must_go_slowly():
    # The end is next to a singular wrist: there joints 4 and 6 turn 500 times as fast as on average.
    path = joint_path(PUMA, tool_line(*world_to_tool(PUMA, WRIST)), WRIST[0])
    assert np.abs(path.qs(np.linspace(0, 1, 1000))).max() > 400
    motion, fine = along_path(PUMA, path), along_path(PUMA, path, intervals=800)
    assert excess(motion, Limits.of(PUMA)) < KEPT
    assert motion.duration == pytest.approx(fine.duration, rel=5e-3)


def test_bends_of_the_path_are_knots():
    # A quadratic spline: the curvature jumps at each break, and accelerations and torques with it.
    breaks = np.array([0.0, 0.31, 0.64, 1.0])
    start = np.array([0.0, 0.8, -1.5, 0.0, 0.0, 0.0])
    bends = np.random.default_rng(3).uniform(-1.5, 1.5, (3, 6))
    rows, q, slope = [], start, np.full(6, 0.3)
    for h, bend in zip(np.diff(breaks), bends, strict=True):
        rows.append([q, slope, bend])
        q, slope = q + slope * h + bend * h**2, slope + 2 * bend * h
    path = JointPath(PUMA, breaks, rows)
    limits = Limits.of(PUMA, acceleration=8.0)
    motion = along_path(PUMA, path, limits=limits)
    assert excess(motion, limits) < KEPT
    # Each bend is a knot, so that no interval has to be refined.
    assert motion.report.intervals == 200


def test_tool_speed_is_kept():
    arm, T0, T1, path = line_of("puma560")
    motion = along_path(arm, path, constraints=[ToolSpeed(0.1)])
    t = motion.sample_times(1000.0)
    x = world_to_tool(arm, motion.q(t))[:, :3, 3]
    speed = np.linalg.norm(np.diff(x, axis=0), axis=1) / np.diff(t)
    assert speed.max() < 0.1 * (1 + KEPT)
    assert np.median(speed) > 0.1 * (1 - 1e-3)
    length = np.linalg.norm((T1 - T0)[:3, 3])
    assert motion.duration == pytest.approx(length / 0.1, rel=0.02)


@pytest.mark.parametrize(
    "constraint",
    [
        MotorPower(20.0),
        slow_if(True, TorqueSpeedLine(tuple(Limits.of(PUMA).torque), 3.0)),
        ToolAcceleration(3.0),
    ],
    ids=lambda constraint: constraint.what,
)
def test_other_constraints_are_kept_and_used(constraint, tool_motion):
    arm, path, free = tool_motion
    motion = along_path(arm, path, constraints=[constraint])
    t = motion.sample_times(1000.0)[1:-1]
    qd, tau = motion.qd(t), reference_torques(arm)(motion.q(t), motion.qd(t), motion.qdd(t))
    match constraint:
        case MotorPower(watts=watts):
            use = np.abs(tau * qd) / watts
        case TorqueSpeedLine(stall_torque=stall, no_load_speed=speed):
            use = np.abs(tau / np.array(stall) + qd / speed)
        case _:
            x = world_to_tool(arm, motion.q(t[:, None] + [-STEP, 0, STEP]))[..., :3, 3]
            use = (
                np.linalg.norm(x[:, 0] - 2 * x[:, 1] + x[:, 2], axis=1) / STEP**2 / constraint.limit
            )
            use /= 1 + BY_DIFFERENCES
    assert use.max() < 1 + KEPT
    assert motion.duration > 1.01 * free.duration
    assert motion.report.certificate.worst.excess > -1e-3


@pytest.mark.slow
def test_a_given_duration_is_kept(tool_motion):
    arm, path, quickest = tool_motion
    for objective in ("effort", "time", Time() + Effort()):
        motion = along_path(arm, path, objective=objective, duration=1.3 * quickest.duration)
        assert motion.duration == pytest.approx(1.3 * quickest.duration, rel=1e-12)
        assert excess(motion, Limits.of(arm)) < KEPT
    slowed = np.sum(reference_torques(arm)(*states_of(quickest.slowed(1.3))) ** 2)
    least = along_path(arm, path, objective="effort", duration=1.3 * quickest.duration)
    assert np.sum(reference_torques(arm)(*states_of(least)) ** 2) < 0.99 * slowed


def states_of(motion):
    t = np.linspace(0, motion.duration, 2001)
    return motion.q(t), motion.qd(t), motion.qdd(t)


# What it says


def test_the_report_says_how_it_was_found(tool_motion):
    arm, _, motion = tool_motion
    report = motion.report
    assert report.duration == motion.duration == pytest.approx(report.cost, rel=1e-12)
    assert report.intervals == 200
    assert report.joints == tuple(joint.name for joint in arm.joints)
    assert report.certificate.reference == "Pinocchio"
    assert "certified" in str(report)
    assert report.build_seconds > 0 < report.solve_seconds


def test_progress_is_told_in_seconds(tool_motion):
    arm, path, motion = tool_motion
    told = []
    along_path(arm, path, objective=Time() + 1e-4 * Effort(), progress=told.append)
    assert [each.iteration for each in told[:3]] == [0, 1, 2]
    assert told[-1].duration == pytest.approx(motion.duration, rel=0.5)


def test_an_exception_in_progress_ends_it(tool_motion):
    arm, path, _ = tool_motion

    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        along_path(arm, path, progress=stop)


# Failures


def test_too_weak_an_arm_is_named():
    # From hanging down past the horizontal, with half of what holds it there.
    path = JointPath.straight(ARM, [-np.pi / 2, 0.0], [np.pi / 2, 0.0])
    most = np.abs(gravity_torque(ARM, [0.0, 0.0]))
    limits = Limits.of(ARM, torque=most / 2, velocity=np.inf)
    with pytest.raises(
        PlanningError, match=rf"at s = 0\.5: joint {ARM.joints[0].name} cannot hold the arm there"
    ):
        along_path(ARM, path, limits=limits)
    with pytest.raises(PlanningError, match=r"the path's end: joint .* cannot hold the arm"):
        along_path(ARM, JointPath.straight(ARM, [-np.pi / 2, 0.0], [0.0, 0.0]), limits=limits)


CORNER = JointPath(ARM, [0, 0.5, 1], [[[0, 0], [1, 0]], [[0.5, 0], [0, 1]]])
W, PEAK = 1e-5, 1e5
"""A spike of the first derivative: how wide each flank is, and how high."""
SPIKE = JointPath(
    ARM,
    [0, 0.5, 0.5 + W, 0.5 + 2 * W, 1],
    [
        [[-1, 0], [0.5, 0], [0, 0]],
        [[-0.75, 0], [0.5, 0], [PEAK / (2 * W), 0]],
        [[-0.75 + W * (0.5 + PEAK / 2), 0], [0.5 + PEAK, 0], [-PEAK / (2 * W), 0]],
        [[-0.75 + W * (1 + PEAK), 0], [0.5, 0], [0, 0]],
    ],
)
BEND = JointPath(ARM, [0, 0.5, 1], [[[0, 0], [1, 0], [1, 0]], [[0.75, 0], [2, 0], [0, 0]]])
SHORT = JointPath.straight(ARM, [0, 0], [1, 0])
LINGERS = JointPath(ARM, [0, 1], [[[0, 0], [0, 0], [3, 3], [-2, -2]]])


@pytest.mark.parametrize(
    ("path", "options", "words"),
    [
        (CORNER, {}, "corner at s = 0.5"),
        (LINGERS, {}, "stands still at s = 0:"),
        (SPIKE, {}, "singular at s = 0.5: joint .* turns ever faster"),
        (
            JointPath.straight(ARM, [0, 0], [9, 0]),
            {},
            "the path at s = 1: joint .* above its upper limit",
        ),
        (
            BEND,
            {"limits": Limits.of(ARM, jerk=9.0)},
            "curvature jumps at s = 0.5, where joint .* infinite jerk",
        ),
        (SHORT, {"limits": Limits.of(ARM, torque=np.inf)}, "nothing limits acceleration"),
        (SHORT, {"objective": "effort", "duration": 1e-2}, "0.01 s are too short: .* in "),
        (SHORT, {"max_iterations": 2}, "within 2 iterations, in 1 start"),
        (SHORT, {"time_limit": 1e-9}, "within 1000 iterations and 1e-09 s"),
        (SHORT, {"constraints": [ToolOrientation(0.1)]}, "tool orientation is exceeded"),
    ],
)
def test_what_is_in_the_way_is_said(path, options, words):
    with pytest.raises(PlanningError, match=words):
        along_path(ARM, path, **{"limits": Limits.of(ARM), **options})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"objective": "effort"}, "expected duration="),
        ({"objective": Jerk()}, "expected time, effort or energy"),
        ({"objective": Energy()}, "expected duration="),
        ({"intervals": 3}, "intervals is 3"),
        ({"duration": -1.0}, "duration"),
    ],
)
def test_senseless_wishes_are_refused(options, words):
    with pytest.raises(ValueError, match=words):
        along_path(ARM, SHORT, **options)


def test_another_arm_is_refused():
    with pytest.raises(ValueError, match="2 joints; expected 6"):
        along_path(PUMA, SHORT)


def test_a_kept_direction_is_no_hindrance():
    arm, *_, path = line_of("cobra600")
    motion = along_path(arm, path, constraints=[ToolDirection()])
    assert motion.report.certificate.ok


# Friction, energy, obstacles, and a constraint of one's own


@dataclass(frozen=True)
class SupplyPower(Constraint):
    """Power of all motors together, which may also not be fed back, W; its limit is a parameter."""

    watts: float
    what = "supply power"
    two_sided = True

    def size(self, description):
        return 1

    def values(self, description, T_start):
        return np.array([1 / self.watts])

    def rows(self, point, parameters):
        return casadi.dot(point.tau, point.qd) * parameters

    def measured(self, states, parameters):
        return np.sum(states.tau * states.qd, axis=1, keepdims=True) * parameters


@pytest.mark.parametrize("robot", ["puma560", "cobra600"])
@pytest.mark.parametrize("objective", ["time", "effort"])
@pytest.mark.slow
def test_a_constraint_of_ones_own_holds_in_both_programs(robot, objective):
    arm, *_, path = line_of(robot)
    ends = path.q(0.0), path.q(1.0)
    for free, make in (
        (
            along_path(arm, path),
            lambda **options: along_path(arm, path, objective=objective, **options),
        ),
        (Planner(arm).solve(*ends), lambda **options: planned(arm, objective, ends, **options)),
    ):
        most = np.abs(power(free)).max() / 3
        duration = None if objective == "time" else 2 * free.duration
        motion = make(constraints=[SupplyPower(most)], duration=duration)
        assert np.abs(power(motion)).max() < most * (1 + KEPT)
        if objective == "time":
            assert np.abs(power(motion)).max() > most * (1 - 1e-2)
            assert "supply power" in {limit.what for limit in motion.report.certificate.active}


def planned(arm, objective, ends, constraints, duration):
    return Planner(arm, objective, constraints=constraints).solve(*ends, duration=duration)


def power(motion):
    t = motion.sample_times(1000.0)
    qd = motion.qd(t)
    return np.sum(
        reference_torques(motion.description)(motion.q(t), qd, motion.qdd(t)) * qd, axis=1
    )


@pytest.mark.slow
def test_friction_slows_a_motion_down_and_is_in_its_torques(tool_motion):
    arm, path, free = tool_motion
    for wanted in ("time", "effort"):
        duration = None if wanted == "time" else 2 * free.duration
        motion = along_path(arm, path, objective=wanted, duration=duration, friction=True)
        t = motion.sample_times(1000.0)
        qd = motion.qd(t)
        tau = reference_torques(arm)(motion.q(t), qd, motion.qdd(t)) + friction_torque(
            arm, qd, motion.friction
        )
        assert (np.abs(tau) / Limits.of(arm).torque).max() < 1 + KEPT
        np.testing.assert_allclose(motion.tau(t), tau, atol=1e-9)
        if wanted == "time":
            assert motion.duration > free.duration


def test_energy_of_a_slide_in_a_given_time():
    # Heat in the windings alone counts where power is fed back: least squared force, a cubic.
    mass, weight = mass_matrix(COBRA, HOME)[SLIDE, SLIDE], gravity_torque(COBRA, HOME)[SLIDE]
    wanted = Energy(motor_constants=2.0, regenerates=True)
    motion = along_path(COBRA, slide(0.1), objective=wanted, duration=0.5, limits=STRONG)
    gear = gear_ratios(COBRA)[SLIDE]
    least = (12 * mass**2 * 0.1**2 / 0.5**3 + weight**2 * 0.5) / (2.0 * gear) ** 2
    still = np.delete(gravity_torque(COBRA, HOME), SLIDE)
    assert np.abs(still).max() < 1e-9
    assert motion.report.cost == pytest.approx(least + weight * 0.1, rel=1e-3)


def test_a_path_that_comes_too_near_an_obstacle_is_refused(tool_motion):
    arm, path, free = tool_motion
    middle = world_to_tool(arm, path.q(0.5))[:3, 3]
    far = Obstacle.sphere(0.05, middle + np.array([0.0, 0.0, 3.0]), name="far")
    assert along_path(arm, path, obstacles=[far], clearance=0.02).duration == pytest.approx(
        free.duration, rel=1e-9
    )
    with pytest.raises(
        PlanningError, match=r"the path at s = .*: .* mm inside ball, 20 mm are asked for"
    ):
        along_path(
            arm, path, obstacles=[Obstacle.sphere(0.05, middle, name="ball")], clearance=0.02
        )


# Limits of jerk


@pytest.mark.parametrize(
    ("d", "v", "a"),
    [(0.2, np.inf, np.inf), (0.2, 0.3, np.inf), (0.2, np.inf, 0.5), (0.2, 0.3, 0.5)],
)
def test_under_a_limit_of_jerk_a_slide_is_a_double_s(d, v, a):
    j = 3.0
    v, a = min(v, 1e3), min(a, 1e3)
    # Biagiotti and Melchiorri 2008, Trajectory Planning for Automatic Machines and Robots, section 3.4, from rest.
    rise = a / j if v * j >= a**2 else np.sqrt(v / j)
    speeding = rise + v / a if v * j >= a**2 else 2 * rise
    best = d / v + speeding
    if d < v * speeding:  # the speed is not reached
        best = (
            4 * (d / (2 * j)) ** (1 / 3)
            if d < 2 * a**3 / j**2
            else a / j + np.sqrt((a / j) ** 2 + 4 * d / a)
        )
    limits = Limits.of(COBRA, velocity=v, acceleration=a, torque=np.inf, jerk=j)
    motion = along_path(COBRA, slide(d), limits=limits)
    assert motion.duration == pytest.approx(best, rel=1e-3)
    assert motion.duration >= best * (1 - 1e-6)
    assert np.abs(motion.jerk(motion.sample_times(1000.0))).max() < j * (1 + KEPT)


@pytest.mark.parametrize("name", LINES)
@pytest.mark.parametrize("objective", ["time", "effort"])
@pytest.mark.slow
def test_jerk_is_limited_along_a_line(name, objective):
    arm, *_, path = line_of(name)
    free, limits = along_path(arm, path), Limits.of(arm, jerk=300.0)
    motion = along_path(arm, path, limits=limits)
    assert motion.duration > free.duration
    if objective == "effort":
        slow = along_path(
            arm, path, objective="effort", duration=1.5 * motion.duration, limits=limits
        )
        assert slow.report.cost < motion_cost(motion.slowed(1.5))
        motion = slow
    t = motion.sample_times(5000.0)
    by_differences = np.diff(motion.qdd(t), axis=0) / np.diff(t)[:, None]
    assert np.abs(by_differences).max() < 300.0 * (1 + 1e-5)
    assert excess(motion, limits) < KEPT
    for end in (0.0, motion.duration):
        assert np.abs(motion.qd(end)).max() < 1e-9 > np.abs(motion.qdd(end)).max() * 1e-3
    if objective == "time":
        assert np.abs(motion.jerk(t)).max() > 300.0 * (1 - 1e-2)


def motion_cost(motion):
    t = np.linspace(0, motion.duration, 20_000)
    tau = reference_torques(motion.description)(motion.q(t), motion.qd(t), motion.qdd(t))
    return np.trapezoid(np.sum(tau**2, axis=1), t)
