"""What a planner is asked for: ways, loads, constraints, time, interruption."""

import pickle
import threading
from dataclasses import dataclass

import casadi
import numpy as np
import pinocchio as pin
import pytest

import dhkit
from dhkit.description import library_robot, pose
from dhkit.description.frames import world_to_tool
from dhkit.dynamics import Friction, inverse_dynamics
from dhkit.errors import PlanningError
from dhkit.model import pinocchio_model
from dhkit.planning import (
    Effort,
    Energy,
    Jerk,
    MotorPower,
    Obstacle,
    Payload,
    Planner,
    Time,
    ToolAcceleration,
    ToolDirection,
    ToolOrientation,
    ToolSpeed,
    TorqueSpeedLine,
)
from dhkit.planning.certificate import Checker
from dhkit.planning.criteria import Constraint, Objective, cost_of
from dhkit.trajectories import Limits
from planning_reference import grids, slide, worst_excess

PUMA = library_robot("puma560")
START = np.array([0.0, 0.8, -1.0, 0.0, 0.5, 0.0])
GOAL = np.array([1.2, 0.3, -0.8, 0.5, -0.6, 1.0])
ALLOWED = 1e-6


@pytest.fixture(scope="module")
def planner():
    return Planner(PUMA, intervals=24)


def kept(arm, motion, limits, allowed=ALLOWED):
    for what, excess in worst_excess(arm, motion, limits).items():
        assert excess <= allowed, what


# Ways


def test_configurations_on_the_way_are_met(planner):
    via = [np.array([0.5, 1.0, -0.5, 0.2, 0.0, 0.3]), np.array([0.9, 0.2, -0.9, 0.4, 0.3, 0.6])]
    motion = planner.solve(START, GOAL, via=via)
    kept(PUMA, motion, planner.limits)
    legs = len(motion.breaks) // 3
    for k, q in enumerate(via, start=1):
        assert np.abs(motion.q(motion.breaks[legs * k]) - q).max() < 1e-9
        assert np.abs(motion.qd(motion.breaks[legs * k])).max() > 0.1, "passed, not stopped at"


def test_a_pose_is_reached_by_the_best_branch(planner):
    T = world_to_tool(PUMA, GOAL)
    motion = planner.solve(START, T)
    assert np.abs(world_to_tool(PUMA, motion.q(motion.duration)) - T).max() < 1e-9
    branches = motion.report.branches
    assert sum(branch.chosen for branch in branches) == 1
    assert all(branch.duration >= motion.duration for branch in branches)
    assert motion.duration <= planner.solve(START, GOAL).duration * (1 + 1e-6)
    unsolved = [branch for branch in branches if not branch.solved]
    assert unsolved, "branches whose speeds alone take longer need not be solved"
    # What is said of one that was not solved is a bound: the true cost is no less.
    solutions = dhkit.Arm(PUMA).ik(T)
    q = solutions.within_limits(near=START)[list(solutions.branches).index(unsolved[0].branch)]
    assert planner.solve(START, q).duration >= unsolved[0].duration


def test_poses_on_the_way(planner):
    T = world_to_tool(PUMA, np.array([0.5, 1.0, -0.5, 0.2, 0.4, 0.3]))
    motion = planner.solve(START, GOAL, via=[T])
    nearest = min(np.abs(world_to_tool(PUMA, q) - T).max() for q in motion.q(motion.breaks))
    assert nearest < 1e-9


@pytest.mark.slow
def test_seven_joints_reach_a_pose():
    arm = library_robot("panda")
    start = np.array([0, -0.4, 0, -1.8, 0, 1.4, 0.5])
    T = world_to_tool(arm, np.add(start, [0.4, 0.2, -0.3, 0.3, 0.2, 0.2, -0.4]))
    motion = Planner(arm, intervals=12).solve(start, T)
    assert np.abs(world_to_tool(arm, motion.q(motion.duration)) - T).max() < 1e-8
    kept(arm, motion, Limits.of(arm))


def test_names_of_configurations(planner):
    motion = planner.solve("nominal", "ready") if "nominal" in PUMA.numbers.configurations else None
    if motion is not None:
        assert np.array_equal(motion.q(0.0), PUMA.numbers.configurations["nominal"])


def test_velocities_at_the_ends(planner):
    v0, v1 = np.array([0.5, 0, 0, 0, 0, 0]), np.array([0, 0.3, 0, 0, 0, -1.0])
    motion = planner.solve(START, GOAL, start_velocity=v0, goal_velocity=v1)
    assert np.abs(motion.qd(0.0) - v0).max() < 1e-12
    assert np.abs(motion.qd(motion.duration) - v1).max() < 1e-9
    kept(PUMA, motion, planner.limits)


def test_limits_of_one_motion(planner):
    slow = planner.limits.scaled(velocity=0.5)
    motion = planner.solve(START, GOAL, limits=slow)
    assert motion.report.build_seconds == 0 or motion.duration > 0
    kept(PUMA, motion, slow)
    assert motion.duration > 1.5 * planner.solve(START, GOAL).duration


@pytest.mark.slow
def test_jerk_limits():
    limits = Limits.of(PUMA, jerk=200.0, acceleration=20.0)
    motion = Planner(PUMA, limits=limits, intervals=24).solve(START, GOAL)
    kept(PUMA, motion, limits)
    for side in ("left", "right"):
        assert np.abs(motion.jerk(motion.breaks, side=side)).max() <= 200 * (1 + ALLOWED)
    assert np.abs(motion.qdd([0.0, motion.duration])).max() < 1e-9


# Loads


def test_a_payload_is_carried_and_needs_no_new_program(planner):
    planner.solve(START, GOAL, payload=Payload(1.0))
    load = Payload(3.0, (0.01, 0, 0.05), ((0.02, 0, 0), (0, 0.02, 0), (0, 0, 0.01)))
    motion = planner.solve(START, GOAL, payload=load)
    assert motion.report.build_seconds == 0
    kept(load.carried(PUMA), motion, planner.limits)
    assert motion.duration > planner.solve(START, GOAL).duration


def test_friction_takes_torque():
    planner = Planner(PUMA, friction=True, intervals=24)
    motion = planner.solve(START, GOAL)
    q, qd, qdd = grids(motion)
    tau = inverse_dynamics(PUMA, q, qd, qdd, friction=Friction(1e-2))
    assert (np.abs(tau) / planner.limits.torque).max() <= 1 + ALLOWED


# Constraints, each by a path of its own


def tool_motion(arm, motion):
    """Return the tool's velocity by Pinocchio and its acceleration by differences of that, 1e-5 s apart."""
    model = pinocchio_model(arm)
    data = model.createData()
    frame = model.getFrameId("tool")

    def velocity(t):
        pin.forwardKinematics(model, data, motion.q(t), motion.qd(t))
        return pin.getFrameVelocity(
            model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        ).linear.copy()

    h = 1e-5
    inside = (
        motion.breaks[:-1, None] + np.diff(motion.breaks)[:, None] * np.linspace(0.05, 0.95, 7)
    ).ravel()
    v = np.array([velocity(t) for t in inside])
    a = np.array([(velocity(t + h) - velocity(t - h)) / (2 * h) for t in inside])
    return v, a


def test_the_tools_speed():
    motion = Planner(PUMA, constraints=[ToolSpeed(0.5)], intervals=24).solve(START, GOAL)
    speed = np.linalg.norm(tool_motion(PUMA, motion)[0], axis=1)
    assert speed.max() <= 0.5 * (1 + ALLOWED)
    assert speed.max() > 0.499


@pytest.mark.slow
@pytest.mark.parametrize(("name", "speed"), [("puma560", 0.01), ("puma560", 1e-4), ("ur5", 0.01)])
def test_a_tool_speed_far_below_the_joints_speeds_is_kept(name, speed):
    """From rest to rest the slowed motion is a solution."""
    arm = dhkit.Arm.load(name)
    start = np.array(arm.configurations["ready"])
    motion = arm.plan(
        start,
        start + np.array([0.8, -0.2, 0.3, 0.1, 0.2, 0.3]),
        constraints=[dhkit.ToolSpeed(speed)],
        compare=False,
        max_iterations=100,
    )
    assert motion.report.certificate.ok
    assert np.linalg.norm(tool_motion(arm.description, motion)[0], axis=1).max() <= speed * (
        1 + ALLOWED
    )


@pytest.mark.slow
def test_the_tools_acceleration():
    motion = Planner(PUMA, constraints=[ToolAcceleration(3.0)], intervals=24).solve(START, GOAL)
    a = np.linalg.norm(tool_motion(PUMA, motion)[1], axis=1)
    assert a.max() <= 3.0 * (1 + 1e-5)
    assert a.max() > 2.9


@dataclass(frozen=True)
class Wall(Constraint):
    """A plane that the tool of planar2r stays behind, as a user writes a constraint of their own."""

    x: float
    moving = False
    what = "wall"

    def rows(self, point, parameters):
        first, second = point.description.numbers.a
        return (
            first * casadi.cos(point.q[0]) + second * casadi.cos(point.q[0] + point.q[1])
        ) / self.x

    def measured(self, states, parameters):
        return states.T_world_tool[:, :1, 3] / self.x


@pytest.mark.slow
def test_a_constraint_of_ones_own_is_kept_and_certified():
    arm = dhkit.Arm.load("planar2r")
    start, goal, wall = [-1.0, 1.2], [1.0, -1.2], Wall(0.88)
    for constraints in ((), (wall,)):
        motion = arm.plan(start, goal, constraints=constraints, intervals=20, compare=False)
        x = arm.fk(motion.q(np.linspace(0, motion.duration, 2001)))[:, 0, 3].max()
        assert bool(constraints) == (x <= wall.x * (1 + ALLOWED))
        assert bool(constraints) == ("wall" in dict(motion.report.active_limits()))


@pytest.mark.parametrize(
    ("changed", "error", "message"),
    [
        (
            {"measured": lambda self, s, p: np.where(abs(s.qd) > 0.5, np.nan, s.qd)},
            PlanningError,
            "is not a number at",
        ),
        (
            {"measured": lambda self, s, p: s.qd[:, 0]},
            ValueError,
            r"shape \((\d+),\); expected \(\1, k\)",
        ),
        ({"measured": lambda self, s, p: None}, TypeError, "Own.measured: found NoneType"),
        ({"measured": lambda self, s, p: s.qd > 2}, TypeError, "Own.measured: found"),
        (
            {"measured": lambda self, s, p: s.qd * 1j},
            TypeError,
            "Own.measured: found complex numbers",
        ),
        ({"measured": Constraint.measured}, NotImplementedError, "Own has no method measured"),
        (
            {"rows": lambda self, p, x: 5},
            TypeError,
            r"Own.rows returned int; expected casadi.SX of shape \(k, 1\)",
        ),
        ({"rows": lambda self, p, x: p.qd.T}, TypeError, r"Own.rows returned \(1, 2\); expected"),
        ({"what": Constraint.what}, NotImplementedError, "Own has no property what"),
    ],
)
def test_a_constraint_of_ones_own_that_cannot_be_certified_is_refused(changed, error, message):
    members = {
        "what": "own",
        "rows": lambda self, point, parameters: point.qd / 20,
        "measured": lambda self, states, parameters: states.qd / 20,
    }
    own = type("Own", (Constraint,), members | changed)()
    with pytest.raises(error, match=message):
        Planner(library_robot("planar2r"), constraints=[own], intervals=12).solve(
            [0, 0], [0.6, -0.5]
        )


def test_both_sides_of_a_constraint_are_certified():
    class Rate(Constraint):
        two_sided = True
        what = "rate"

        def rows(self, point, parameters):
            return point.qd / 2

        def measured(self, states, parameters):
            return states.qd / 2

    arm = library_robot("planar2r")
    motion = Planner(arm, constraints=[Rate()], intervals=12).solve([0, 0], [0.6, -0.5])
    limits = Limits.of(arm)
    assert Checker(arm, limits, (Rate(),), (np.zeros(0),)).check(motion).ok
    faster = motion.slowed(0.9)
    checks = Checker(arm, limits, (Rate(),), (np.zeros(0),)).check(faster).checks
    assert next(check.excess for check in checks if check.what == "rate") == pytest.approx(
        1 / 0.9 - 1, rel=1e-3
    )


def test_a_state_that_is_not_a_number_is_not_certified(monkeypatch):
    arm = library_robot("planar2r")
    motion = Planner(arm, intervals=12).solve([0, 0], [0.6, -0.5])
    measured = Checker.measured

    def with_one_unknown(self, states):
        found = measured(self, states)
        found[max(found)][5, 0] = np.nan
        return found

    assert Checker(arm, Limits.of(arm)).check(motion).ok
    monkeypatch.setattr(Checker, "measured", with_one_unknown)
    certificate = Checker(arm, Limits.of(arm)).check(motion)
    assert not certificate.ok
    assert certificate.violation == np.inf


@pytest.mark.slow
def test_motors():
    effort, speed = PUMA.numbers.effort, PUMA.numbers.velocity
    motion = Planner(PUMA, constraints=[MotorPower(60.0)], intervals=24).solve(START, GOAL)
    q, qd, qdd = grids(motion)
    assert np.abs(inverse_dynamics(PUMA, q, qd, qdd) * qd).max() <= 60 * (1 + ALLOWED)
    line = TorqueSpeedLine(tuple(effort), tuple(1.2 * speed))
    motion = Planner(PUMA, constraints=[line], intervals=24).solve(START, GOAL)
    q, qd, qdd = grids(motion)
    assert (
        np.abs(inverse_dynamics(PUMA, q, qd, qdd) / effort + qd / (1.2 * speed)).max()
        <= 1 + ALLOWED
    )


@pytest.mark.slow
def test_the_tools_orientation():
    arm = library_robot("ur5")
    start = np.array([0.0, -1.2, 1.5, -1.8, -1.57, 0.0])
    T = world_to_tool(arm, start)
    there = pose(T[:3, 3] + [-0.15, 0.25, 0.1]) @ np.block(
        [[T[:3, :3], np.zeros((3, 1))], [np.zeros((1, 3)), 1]]
    )
    tolerance = np.radians(2)
    for constraint in (ToolOrientation(tolerance), ToolDirection((0, 0, 1), None, tolerance)):
        motion = Planner(arm, constraints=[constraint], intervals=24).solve(start, there)
        seen = np.array(
            [world_to_tool(arm, q)[:3, :3] for q in motion.q(np.linspace(0, motion.duration, 800))]
        )
        if isinstance(constraint, ToolOrientation):
            cosine = (np.einsum("kij,ij->k", seen, T[:3, :3]) - 1) / 2
        else:
            cosine = seen[:, :, 2] @ T[:3, 2]
        assert np.arccos(np.clip(cosine, -1, 1)).max() <= tolerance * (1 + 1e-5)


# Objectives


@pytest.mark.slow
def test_each_objective_is_best_at_what_it_asks_for():
    options = {"duration": 1.5}
    objectives = {
        "effort": Effort(),
        "jerk": Jerk(),
        "energy": Energy(regenerates=True, motor_constants=(2.0,)),
    }
    motions = {
        name: Planner(PUMA, term, intervals=16).solve(START, GOAL, **options)
        for name, term in objectives.items()
    }
    for name, term in objectives.items():
        costs = {other: own_cost(term, motion) for other, motion in motions.items()}
        assert costs[name] == pytest.approx(motions[name].report.cost, rel=1e-3)
        best = min(costs.values())
        assert costs[name] <= best + 1e-3 * abs(best), (name, costs)


def own_cost(term, motion):
    t = np.linspace(0, motion.duration, 4001)
    q, qd, qdd = motion.q(t), motion.qd(t), motion.qdd(t)
    tau = inverse_dynamics(PUMA, q, qd, qdd)
    if isinstance(term, Effort):
        rate = np.sum(tau**2, axis=1)
    elif isinstance(term, Jerk):
        rate = np.sum(motion.jerk(t) ** 2, axis=1)
    else:
        gear = np.array([float(joint.drive.gear) for joint in PUMA.joints])
        rate = np.sum(tau * qd + (tau / (2.0 * gear)) ** 2, axis=1)
    return np.trapezoid(rate, t)


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["effort", "jerk", "energy"])
@pytest.mark.parametrize("duration", [1.5, 3.0])
def test_smooth_motions_keep_limits_of_acceleration(objective, duration):
    limits = Limits.of(PUMA, acceleration=5.0)
    motion = Planner(PUMA, objective, limits=limits).solve(START, GOAL, duration=duration)
    kept(PUMA, motion, limits)


@pytest.mark.slow
def test_positions_are_kept_between_the_certificates_states():
    """Joint 5 of this motion touches its limit for a millisecond, between two states of the grid."""
    arm = library_robot("puma560_cao_printed")
    start = [-0.2942808, 1.63715262, -1.50380625, -0.46176704, -0.65634352, -1.0132854]
    goal = [1.25518414, 1.33496595, -3.31011531, 0.33676141, -0.83395294, -3.62185984]
    speeds = [0.70216542, 0.63366148, 1.04468514, 1.95236238, 2.06368129, 1.95236238]
    limits = Limits.of(arm, velocity=speeds)
    motion = Planner(arm, "energy", limits=limits).solve(start, goal, duration=3.085088552547613)
    q = motion.q(np.linspace(0, motion.duration, 200_001))
    assert np.maximum(limits.lower - q, q - limits.upper).max() < 1e-6


def test_a_pose_by_iteration_where_there_is_no_closed_form():
    arm = dhkit.Arm.from_dh([(0, 0, 0.5, 0)])
    limits = Limits.of(arm.description, velocity=1.0, acceleration=2.0, torque=np.inf)
    motion = Planner(arm.description, limits=limits).solve([0.1], arm.fk([0.5]))
    assert motion.q(motion.duration) == pytest.approx(0.5)
    assert motion.duration == pytest.approx(2 * np.sqrt(0.4 / 2), rel=1e-4)


def test_terms_add():
    objective = Time() + 0.5 * Effort(2.0) + 2 * (Jerk() + Time())
    assert [(type(term).__name__, term.weight) for term in objective.terms] == [
        ("Time", 1.0),
        ("Effort", 1.0),
        ("Jerk", 2.0),
        ("Time", 2.0),
    ]
    assert str(Time() + 0.5 * Effort()) == "1 time + 0.5 effort"


def test_effort_trades_for_time(planner):
    fast = planner.solve(START, GOAL)
    calm = Planner(PUMA, Time() + 1e-4 * Effort(), intervals=24).solve(START, GOAL)
    assert calm.duration > fast.duration
    assert own_cost(Effort(), calm) < own_cost(Effort(), fast)


def test_without_a_duration_smooth_motions_take_twice_the_fastest_cubic():
    motion = Planner(PUMA, "jerk", intervals=16).solve(START, GOAL)
    cubic = dhkit.Arm(PUMA).cubic(START, GOAL)
    assert motion.duration == pytest.approx(2 * cubic.duration, rel=0.1)


# Solving


def test_one_optimum_from_many_starts(planner):
    best = planner.solve(START, GOAL).duration
    rng = np.random.default_rng(0)
    for _ in range(4):
        via = (START + GOAL) / 2 + rng.normal(0, 0.2, 6)
        warm = dhkit.Arm(PUMA).spline(np.array([START, via, GOAL]), [0, 1, 2])
        assert planner.solve(START, GOAL, warm=warm).duration == pytest.approx(best, rel=5e-4)


def test_progress_is_told_and_can_interrupt(planner):
    seen = []
    planner.solve(START, GOAL, progress=seen.append)
    assert [step.iteration for step in seen] == list(range(len(seen))) and len(seen) > 5
    assert seen[-1].infeasibility < 1e-4 < seen[0].infeasibility or seen[-1].infeasibility < 1e-4

    class Enough(Exception):
        pass

    def enough(step):
        if step.iteration == 3:
            raise Enough

    with pytest.raises(Enough):
        planner.solve(START, GOAL, progress=enough)
    with pytest.raises(KeyboardInterrupt):
        planner.solve(START, GOAL, progress=lambda step: (_ for _ in ()).throw(KeyboardInterrupt))
    assert planner.solve(START, GOAL).report.certificate.ok


@pytest.mark.slow
def test_threads_take_turns(planner):
    goals = [GOAL + 0.05 * k * np.array([0, 1, 0, 1, 0, 1]) for k in range(4)]
    expected = [planner.solve(START, goal).duration for goal in goals]
    found = [None] * 4

    def work(k):
        found[k] = planner.solve(START, goals[k]).duration

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == expected


def test_the_report(planner):
    motion = planner.solve(START, GOAL, compare=True)
    report = motion.report
    assert pickle.loads(pickle.dumps(motion)) == motion
    assert report.certificate.reference == "Pinocchio"
    assert report.certificate.states >= 20 * report.intervals
    assert 0.9 < report.certificate.any_active <= 1
    names = {motion.name: motion.duration for motion in report.classical}
    assert names["quintic"] > names["best trapezoid"] > motion.duration
    assert report.sensitivity is not None and -1e-4 < report.sensitivity < 0.02
    assert report.active_limits()[0][1] > 0.5
    text = str(report)
    for word in ("certified by Pinocchio", "quintic", "some limit is active", "intervals"):
        assert word in text
    assert report.as_dict()["certified"] is True


def test_a_report_where_nothing_is_limited():
    motion = Planner(slide(), "effort", intervals=12).solve([0.0], [1.0], duration=1.0)
    assert motion.report.certificate.ok and "nothing is limited" in str(motion.report)


def test_an_arm_keeps_its_planners():
    arm = dhkit.Arm.load("planar2r")
    first = arm.plan([0, 0], [1, 0.5], intervals=12, compare=False)
    again = arm.plan([0, 0], [1, 0.4], intervals=12, compare=False)
    assert first.report.build_seconds > 0 and again.report.build_seconds == 0
    assert arm == dhkit.Arm.load("planar2r") and pickle.loads(pickle.dumps(arm)) == arm


def test_without_pinocchio_our_own_dynamics_certify(monkeypatch):
    from dhkit.planning.criteria import states

    monkeypatch.setattr(states, "_model", lambda description: None)
    arm = library_robot("planar2r")
    motion = Planner(arm, intervals=12, constraints=[ToolSpeed(1.0)]).solve([0, 0], [1, 0.5])
    assert motion.report.certificate.reference == "dhkit"
    monkeypatch.undo()
    kept(arm, motion, Limits.of(arm))


def test_nothing_is_printed(planner, capfd):
    planner.solve(START, GOAL)
    with pytest.raises(PlanningError):
        planner.solve(START, GOAL, max_iterations=1)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("move", [1e-9, 1e-6, 1e-3])
def test_small_moves_take_the_square_root_of_their_size(move):
    """Gravity and inertia hardly change, so that the fastest motion of any small move is the same but for its scale."""
    arm = library_robot("planar2r")
    planner, q = Planner(arm, intervals=48), np.array([0.4, 0.4])
    small, larger = (planner.solve(q, q + size * np.array([1.0, -0.5])) for size in (move, 1e-2))
    assert small.duration == pytest.approx(larger.duration * np.sqrt(move / 1e-2), rel=0.01)
    assert small.report.certificate.ok and small.report.is_resolved
    assert np.abs(small.q(small.duration) - q - move * np.array([1.0, -0.5])).max() < 1e-15


def test_a_move_too_small_to_be_optimized_is_certified_and_the_report_says_so():
    arm = library_robot("planar2r")
    motion = Planner(arm).solve([0.4, 0.4], [0.4 + 1e-12, 0.4])
    assert motion.report.certificate.ok and not motion.report.is_resolved
    assert "too small to be optimized" in str(motion.report)
    assert motion.q(motion.duration).tolist() == [0.4 + 1e-12, 0.4]
    kept(arm, motion, Limits.of(arm))


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["effort", "energy", "jerk"])
def test_smooth_objectives_in_little_more_than_the_least_time(objective):
    """Torques nearly jump there, which parabolas exceed between their points."""
    arm = library_robot("planar2r")
    quick, planner = Planner(arm, intervals=48), Planner(arm, objective, intervals=48)
    rng = np.random.default_rng(3)
    for _ in range(3):
        start, goal = rng.uniform(-1, 1, (2, 2))
        least = quick.solve(start, goal).duration
        motion = planner.solve(start, goal, duration=1.03 * least)
        assert motion.report.certificate.ok and motion.duration == pytest.approx(1.03 * least)
        kept(arm, motion, Limits.of(arm))


@pytest.mark.slow
def test_least_energy_is_below_that_of_smooth_motions():
    arm = library_robot("puma560")
    start, goal = np.zeros(6), np.array([0.5, -0.4, 0.6, 0.3, 0.5, -0.2])
    energy = Planner(arm, "energy").solve(start, goal, duration=2.0)
    for other in ("effort", "jerk"):
        smooth = Planner(arm, other).solve(start, goal, duration=2.0)
        assert energy.report.cost < cost_of(Objective.of("energy"), smooth, arm)


@pytest.mark.slow
def test_a_coarser_mesh_is_of_the_curve_that_led_to_the_motion_and_none_among_obstacles():
    """The effort of planar2r near its least time is found with constant accelerations, after parabolas fail."""
    arm = library_robot("planar2r")
    start, goal = [0.0, 0.0], [0.6, -0.4]
    least = Planner(arm).solve(start, goal).duration
    planner = Planner(arm, "effort")
    motion = planner.solve(start, goal, duration=1.02 * least, compare=True)
    half, cost = motion.report.coarse
    assert half == motion.report.intervals // 2 and cost == pytest.approx(
        motion.report.cost, rel=0.01
    )
    far = planner.solve(
        start, goal, duration=3.0, obstacles=[Obstacle.sphere(0.1, (5, 5, 5))], compare=True
    )
    assert far.report.coarse is None
