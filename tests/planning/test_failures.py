"""Every way in which there is no motion, and what is said of it."""

import itertools
import math
import re
import time
from dataclasses import dataclass

import casadi
import numpy as np
import pytest

import dhkit
from acceptance import only_accepting
from dhkit.description import from_dh, library_robot, pose
from dhkit.errors import DescriptionError, PlanningError, UnreachableError
from dhkit.planning import (
    Constraint,
    MotorPower,
    Obstacle,
    Payload,
    Planner,
    ToolDirection,
    ToolOrientation,
    ToolSpeed,
)
from dhkit.trajectories import Limits, Trajectory
from planning_reference import bare, slide

PUMA = library_robot("puma560")
START = np.array([0.0, 0.8, -1.0, 0.0, 0.5, 0.0])
GOAL = np.array([1.2, 0.3, -0.8, 0.5, -0.6, 1.0])


@pytest.fixture(scope="module")
def planner():
    return Planner(PUMA, intervals=16)


def refused(message, call, kind=PlanningError):
    with pytest.raises(kind) as raised:
        call()
    assert re.search(message, str(raised.value)), str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_start_or_goal_outside_the_limits(planner):
    outside = np.add(GOAL, [3.0, 0, 0, 0, 0, 0])
    refused(
        r"^goal: joint waist is at 4.2 rad, above its upper limit, 2.79253 rad$",
        lambda: planner.solve(START, outside),
    )
    low = np.subtract(START, [0, 2.0, 0, 0, 0, 0])
    refused(
        r"^start: joint shoulder is at -1.2 rad, below its lower limit, -0.785398 rad$",
        lambda: planner.solve(low, GOAL),
    )
    refused(r"^via 1: joint waist", lambda: planner.solve(START, GOAL, via=[outside]))


def test_a_speed_beyond_its_limit(planner):
    fast = [0, 0, 5.0, 0, 0, 0]
    refused(
        r"^goal: joint elbow moves with 5 rad/s, above its limit, 2.1293 rad/s$",
        lambda: planner.solve(START, GOAL, goal_velocity=fast),
    )


def test_too_weak_to_hold_the_arm(planner):
    refused(
        r"^start: joint shoulder cannot hold the arm there: it takes 186.7 N m, its limit is 186.4 N m$",
        lambda: planner.solve(START, GOAL, payload=Payload(40.0)),
    )


def test_a_pose_out_of_reach(planner):
    T = pose((3.0, 0, 0))
    refused(
        r"^goal: no joint values bring the tool to this pose; \(3, 0, 0\) m is out of reach$",
        lambda: planner.solve(START, T),
    )
    with pytest.raises(UnreachableError):
        planner.solve(START, T)


def test_a_pose_for_which_nothing_was_found_is_not_called_out_of_reach():
    rows = [(0, 0.3, 0, "pi/2"), (0, 0, 0.4, 1e-6), (0, 0.1, 0.05, "-pi/2"), (0, 0.4, 0, "pi/2")]
    tilted = from_dh([*rows, (0, 0, 0, "-pi/2"), (0, 0.1, 0, 0)])
    refused(
        r"^goal: no joint values were found that bring the tool to this pose, at \(0, 0, 0.3\) m; that does not prove",
        lambda: Planner(
            tilted, limits=Limits.of(tilted, lower=-3.0, upper=3.0, velocity=2.0)
        ).solve(START, pose((0, 0, 0.3))),
    )


def test_a_pose_that_is_reached_outside_the_limits_alone():
    limits = Limits.of(PUMA, lower=START - 0.01, upper=START + 0.01)
    T = dhkit.Arm(PUMA).fk(GOAL)
    refused(
        r"^goal: \d solutions of the pose at \(.*\) m, all outside the joint limits: at best joint \w+ by [\d.]+ rad$",
        lambda: Planner(PUMA, limits=limits).solve(START, T),
    )


def test_what_is_no_pose_or_configuration(planner):
    T = np.eye(4)
    T[0, 0] = 2.0
    refused(r"^goal: ", lambda: planner.solve(START, T))
    refused(
        r"^goal: puma560 has no configuration 'redy'; it has .*ready",
        lambda: planner.solve(START, "redy"),
    )
    refused(r"goal has shape \(5,\); expected", lambda: planner.solve(START, GOAL[:5]), ValueError)
    refused(
        r"goal has values that are not finite",
        lambda: planner.solve(START, np.full(6, np.nan)),
        ValueError,
    )
    refused(r"start is a pose", lambda: planner.solve(np.eye(4), GOAL), ValueError)


def test_nowhere_to_go(planner):
    refused("^start and goal are the same configuration$", lambda: planner.solve(START, START))


def test_an_obstacle_around_start_or_goal(planner):
    tool = dhkit.Arm(PUMA).fk(GOAL)[:3, 3]
    around = [Obstacle.sphere(0.05, tool, name="ball")]
    refused(
        r"^goal: link \d is [\d.]+ mm inside ball, 10 mm are asked for$",
        lambda: planner.solve(START, GOAL, obstacles=around),
    )
    beside = [Obstacle.sphere(0.05, dhkit.Arm(PUMA).fk(START)[:3, 3], name="ball")]
    refused(r"^start: link \d is .* ball", lambda: planner.solve(START, GOAL, obstacles=beside))


def test_an_obstacle_around_the_only_branch_of_a_pose():
    arm = dhkit.Arm.load("polar_rp")
    T = arm.fk([0.5, 0.6])
    around = [Obstacle.sphere(0.05, T[:3, 3], name="ball")]
    refused(
        r"goal: link \d is [\d.]+ mm inside ball",
        lambda: arm.planner(intervals=12).solve([-0.5, 0.6], T, obstacles=around),
    )


WALL = [Obstacle.capsule(0.03, (0.2, 0, 0), (3.0, 0, 0), name="wall")]
"""Over the whole reach of planar2r, which cannot pass it."""


@pytest.mark.slow
@pytest.mark.parametrize("iterations", [pytest.param(1000, marks=only_accepting), 200])
def test_no_way_around_an_obstacle(law, iterations):
    """It is said within the limit of work, the same twice."""
    arm = library_robot("planar2r")
    began = time.perf_counter()
    messages = set()
    for _ in range(2):
        with pytest.raises(PlanningError) as refusal:
            Planner(arm, intervals=24).solve(
                [-0.8, 0.0], [0.8, 0.0], obstacles=WALL, max_iterations=iterations
            )
        messages.add(str(refusal.value))
    (message,) = messages
    assert re.match(
        rf"no motion found that keeps 10 mm clear of wall( within {iterations} iterations)?, "
        r"(in \d+ start|sampling found no)",
        message,
    )
    law.takes("seconds until it is said twice", time.perf_counter() - began, 60.0)


def test_not_converged():
    """Too fast to stop before the wall."""
    arm = slide()
    limits = Limits.of(arm, acceleration=1.0, upper=2.0, lower=-2.0)
    refused(
        r"^not converged \(.*, \d+ iterations\): [\w ]+ joint1 misses its bound by [\d.e+-]+ at \d+ % of the way",
        lambda: Planner(arm, limits=limits, intervals=24).solve(
            [0.0], [1.0], start_velocity=[10.0]
        ),
    )


def test_a_duration_below_what_speeds_allow():
    refused(
        r"^a duration of 0.5 s is too short: the speed limits alone ask for 0.838475 s$",
        lambda: Planner(PUMA, "effort").solve(START, GOAL, duration=0.5),
    )


@pytest.mark.slow
def test_a_duration_below_what_limits_allow():
    limits = Limits.of(PUMA, acceleration=5.0)
    refused(
        r"^a duration of 0.95 s is too short: the fastest motion found takes 1.1\d+ s$",
        lambda: Planner(PUMA, "effort", limits=limits, intervals=16).solve(
            START, GOAL, duration=0.95
        ),
    )


def test_nothing_that_limits_a_smooth_motion():
    refused(
        r"^nothing limits how fast jerk may be: give a duration, or limits such as arm = arm\.with_limits\(",
        lambda: Planner(bare(1), "jerk").solve([0.0], [1.0]),
    )


def test_the_limit_of_iterations_is_kept_exactly(planner):
    """A motion is found with as many iterations as it takes, and not with one less."""
    needed = planner.solve(START, GOAL).report.iterations
    assert planner.solve(START, GOAL, max_iterations=needed + 1).report.iterations == needed
    less = needed - 1
    refused(
        f"^no motion found within {less} iterations, in 1 start$",
        lambda: planner.solve(START, GOAL, max_iterations=less),
    )


def test_a_limit_of_time_is_there_for_those_who_ask(planner):
    refused(
        "^no motion found within 1000 iterations and 0.0001 s, in 1 start$",
        lambda: planner.solve(START, GOAL, time_limit=1e-4),
    )


@pytest.mark.slow
def test_the_default_limit_does_not_read_the_clock(monkeypatch):
    """On a machine that is busy for hours between two iterations the same motion is found, among obstacles too."""
    arm = library_robot("planar2r")
    ball = [Obstacle.sphere(0.05, (0.9, 0.0, 0.0))]

    planner = Planner(arm, intervals=12)

    def solve():
        return planner.solve([-0.8, 0.3], [0.8, 0.3], obstacles=ball)

    calm = solve()
    hours = itertools.count(step=3600.0)
    monkeypatch.setattr(time, "perf_counter", lambda: next(hours))
    busy = solve()
    assert np.array_equal(busy.sample(n=50).q, calm.sample(n=50).q)
    assert busy.report.iterations == calm.report.iterations


def test_a_constraint_that_an_end_breaks():
    flat = Planner(PUMA, constraints=[ToolDirection(tolerance=0.05)])
    refused(
        r"^goal: its tool direction is not allowed: [\d.]+ deg off, 2.865 deg are$",
        lambda: flat.solve(START, GOAL),
    )
    kept = Planner(PUMA, constraints=[ToolOrientation()])
    refused(r"^goal: its tool orientation is not allowed", lambda: kept.solve(START, GOAL))


def test_a_joint_without_limits():
    arm = slide()
    refused(
        r"^joint joint1 has neither a torque, an acceleration nor a jerk limit, so least time has no bound below; ",
        lambda: Planner(arm).solve([0], [1]),
    )


@pytest.mark.parametrize("links", ["bare", "uniform"])
@pytest.mark.parametrize("kind", ["least time", "quintic", "jerk"])
def test_an_arm_without_limits_gets_an_example_that_works(kind, links):
    """The message names with_limits; the calls in it, as they stand, make the motion possible."""
    arm = dhkit.Arm.from_dh([(0, 0, 0.5, 0), (0, 0, 0.4, 0)])
    if links == "uniform":
        arm = arm.with_uniform_links()
    move = {
        "least time": lambda arm, **given: arm.plan([0, 0], [1, 1], **given),
        "quintic": lambda arm, **given: arm.quintic([0, 0], [1, 1], **given),
        "jerk": lambda arm, **given: arm.plan([0, 0], [1, 1], "jerk", **given),
    }[kind]
    with pytest.raises(PlanningError, match="with_limits") as caught:
        move(arm)
    message = str(caught.value)
    (example,) = re.findall(r"arm = (arm\.with_limits\([^)]*\))", message)
    limited = eval(example, {"arm": arm})
    given = {}
    if kind == "least time" and links == "bare":
        (limits,) = re.findall(r"limits=(dhkit\.Limits\.of\([^)]*\))", message)
        given["limits"] = eval(limits, {"arm": limited, "dhkit": dhkit})
    assert move(limited, **given).duration > 0


def test_an_arm_without_bodies():
    arm = bare()
    motion = Planner(
        arm, limits=Limits.of(arm, velocity=1.0, acceleration=2.0), intervals=24
    ).solve([0, 0], [1, -0.5])
    assert motion.duration == pytest.approx(1 / 1.0 + 1.0 / 2.0, rel=5e-3)
    refused(
        "body", lambda: Planner(arm, "effort").solve([0, 0], [1, 1], duration=1.0), DescriptionError
    )


def test_other_robots_motions(planner):
    other = Trajectory.from_samples(library_robot("planar2r"), [0, 1], [[0, 0], [1, 1]])
    refused("planar2r", lambda: planner.solve(START, GOAL, warm=other), DescriptionError)


@pytest.mark.parametrize(
    ("make", "kind", "message"),
    [
        (
            lambda: Planner(PUMA, "tome"),
            ValueError,
            "objective is 'tome'; expected one of time, effort, energy, jerk",
        ),
        (lambda: Planner(PUMA, 3), TypeError, "objective is 3"),
        (
            lambda: Planner(PUMA, intervals=3),
            ValueError,
            "intervals is 3; expected a whole number from 6 to 2000",
        ),
        (lambda: Planner(PUMA, constraints=["slow"]), TypeError, "constraints has 'slow'"),
        (lambda: Planner(PUMA, limits=3), TypeError, "limits is 3"),
        (
            lambda: Planner(PUMA, limits=Limits.of(slide())),
            ValueError,
            "limits are of 1 joints; puma560 has 6",
        ),
        (lambda: ToolSpeed(-1), ValueError, "ToolSpeed: -1; expected positive numbers"),
        (lambda: MotorPower((1, math.nan)), ValueError, "MotorPower"),
        (lambda: ToolDirection(axis=(0, 0, 0)), ValueError, "ToolDirection"),
        (lambda: ToolOrientation(4.0), ValueError, "tolerance is 4.0"),
        (lambda: dhkit.Time(-1), ValueError, "Time: weight is -1"),
        (lambda: dhkit.Energy(motor_constants=(0.0,)), ValueError, "Energy: motor constants"),
    ],
)
def test_what_is_no_planner(make, kind, message):
    refused(re.escape(message), make, kind)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration": -1.0}, "duration is -1.0"),
        ({"time_limit": 0}, "time_limit is 0; expected a positive number, s, or None"),
        ({"time_limit": "1"}, "time_limit is '1'"),
        ({"max_iterations": 0}, "max_iterations is 0; expected a positive whole number"),
        ({"max_iterations": 1e3}, "max_iterations is 1000.0; expected a positive whole number"),
        ({"max_iterations": True}, "max_iterations is True"),
        ({"clearance": -0.1}, "clearance is -0.1"),
        ({"start_velocity": [0, 0]}, "start_velocity"),
        ({"goal_velocity": [math.inf] * 6}, "goal_velocity"),
    ],
)
def test_what_is_no_wish(planner, options, message):
    refused(re.escape(message), lambda: planner.solve(START, GOAL, **options), ValueError)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"payload": 2.0}, "payload is 2.0; expected Payload(mass, com, inertia)"),
        ({"warm": "x"}, "warm is str; expected a Trajectory"),
        ({"progress": "x"}, "progress is 'x'; expected a function"),
    ],
)
def test_what_is_of_another_type(planner, options, message):
    refused(re.escape(message), lambda: planner.solve(START, GOAL, **options), TypeError)


def test_rows_that_are_not_numbers_are_named():
    class Undefined(Constraint):
        what = "undefined quantity"

        def rows(self, point, parameters):
            return casadi.log(-1 - point.q[0] ** 2)

        def measured(self, states, parameters):
            return np.zeros((len(states.times), 1))

    motion = Planner(PUMA, intervals=16, constraints=[Undefined()]).solve(START, GOAL)
    assert not motion.report.is_converged and motion.report.certificate.ok
    assert "undefined quantity is not a number" in motion.report.failure
    assert motion.report.notes == [
        f"not optimal: the straight path, slowed down; the optimizer found nothing ({motion.report.failure})"
    ]


def test_payloads_with_impossible_inertia():
    message = r"^payload: inertia has the eigenvalue -1 kg m\^2; expected none below 0$"
    refused(message, lambda: Payload(1.0, inertia=np.diag([-1.0, 1, 1])), DescriptionError)
    assert Payload(1.0, inertia=np.diag([-1e-13, 1, 1])).inertia[1][1] == 1.0


class PlainSpeed(Constraint):
    """A constraint of joint 1's speed whose class is no dataclass: two of them would count as equal."""

    what = "speed of joint 1"

    def __init__(self, most):
        self.most = most

    def rows(self, point, parameters):
        return point.qd[0] / self.most

    def measured(self, states, parameters):
        return states.qd[:, :1] / self.most


@dataclass(frozen=True)
class ListedSpeed(PlainSpeed):
    """One with a field that cannot be hashed."""

    most: list[float]


@dataclass(frozen=True)
class OwnSpeed(PlainSpeed):
    """As it should be."""

    most: float


@pytest.mark.slow
def test_constraints_that_are_no_values_are_refused():
    start, goal, arm = np.zeros(2), np.array([1.0, 0.5]), dhkit.Arm.load("planar2r")
    for planned in (
        lambda constraint: arm.plan(start, goal, constraints=constraint, intervals=24),
        lambda constraint: Planner(arm.description, constraints=[constraint]),
    ):
        with pytest.raises(
            TypeError,
            match=r"PlainSpeed has an attribute most that is not a dataclass field; declare it",
        ):
            planned(PlainSpeed(0.5))
        with pytest.raises(TypeError, match=r"ListedSpeed: .*unhashable.*; expected @dataclass"):
            planned(ListedSpeed([0.5]))
    for most in (0.5, 0.3):
        motion = arm.plan(start, goal, constraints=OwnSpeed(most), intervals=24, compare=False)
        speed = np.abs(motion.qd(np.linspace(0, motion.duration, 500))[:, 0]).max()
        assert 0.9 * most < speed < most * (1 + 1e-6)
