"""Control of the tool's pose: along lines, through singularities, with fewer and with more than six joints."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dhkit import Arm, OperationalSpace
from dhkit.control import Setpoint
from dhkit.control.operational_space import pose_error
from dhkit.description import pose
from dhkit.errors import DescriptionError

PUMA = Arm.load("puma560")
NOMINAL = PUMA.configurations["nominal"]
PANDA = Arm.load("panda")


def tool_errors(run, arm):
    """Return the largest errors of the tool's position, m, and orientation, rad."""
    pairs = zip(arm.fk(run.q), arm.fk(run.reference_q), strict=True)
    errors = np.array([pose_error(T, goal) for T, goal in pairs])
    return np.linalg.norm(errors[:, :3], axis=1).max(), np.linalg.norm(errors[:, 3:], axis=1).max()


@pytest.mark.slow
def test_it_follows_a_line(law):
    """The bounds are twice what was seen: torques are held for 1 ms, in which the setpoint goes on."""
    law.samples(1)
    T0 = PUMA.fk(NOMINAL)
    T1 = T0.copy()
    T1[:3, 3] += [-0.15, 0.2, 0.1]
    motion = PUMA.straight_line(T0, T1, q0=NOMINAL, duration=2.0)
    run = PUMA.simulate(OperationalSpace.tuned(PUMA), motion, restitution=None)
    position, rotation = tool_errors(run, PUMA)
    law.holds("m, a line in 2 s", position, 6e-6)
    law.holds("rad, a line in 2 s", rotation, 7e-6)


@pytest.mark.slow
def test_it_passes_a_wrist_singularity(law):
    """The wrist is straightened and bent the other way; q5 crosses 0 at about 0.3 rad/s."""
    law.samples(1)
    first, last = NOMINAL.copy(), NOMINAL + np.array([0.3, 0.2, -0.2, 0.5, 0.0, 0.0])
    first[4], last[4] = 0.6, -0.5
    run = PUMA.simulate(
        OperationalSpace.tuned(PUMA), PUMA.quintic(first, last, duration=2.0), restitution=None
    )
    position, rotation = tool_errors(run, PUMA)
    law.holds("m, through a wrist singularity", position, 3e-6)
    law.holds("rad, through a wrist singularity", rotation, 2e-5)
    ahead = PUMA.inverse_dynamics(
        run.reference_q, run.reference_qd, PUMA.quintic(first, last, duration=2.0).qdd(run.t)
    )
    law.holds("N m, torques against those of the motion", np.abs(run.tau_asked - ahead).max(), 0.01)


def test_torques_stay_bounded_at_a_singularity(law):
    """Beside a straight wrist the tool is asked to turn as the wrist cannot: without damping torques grow as 1 / q5."""
    controller = OperationalSpace.tuned(PUMA)
    undamped = OperationalSpace.tuned(PUMA, threshold=1e-12)
    goal = NOMINAL + np.array([0.05, 0.02, -0.03, 0.1, 0.02, -0.1])
    effort = PUMA.description.numbers.effort
    largest, wild = 0.0, 0.0
    for q5 in [0.0, *np.geomspace(1e-9, 0.1, law.samples(200))]:
        q = NOMINAL.copy()
        q[4], goal[4] = q5, q5 + 0.02
        at = Setpoint(PUMA.description, goal, np.zeros(6), np.zeros(6))
        largest = max(largest, np.abs(controller(0.0, q, np.zeros(6), at) / effort).max())
        wild = max(wild, np.abs(undamped(0.0, q, np.zeros(6), at) / effort).max() if q5 else 0.0)
    law.holds("torques over the drives' limits", largest, 1.0)
    assert wild > 1e3


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.0, 0.05])
def test_it_comes_to_rest_at_a_singularity(offset, law):
    law.samples(1)
    q = NOMINAL.copy()
    q[4] = 0.0
    begin = q + offset * np.array([1, 0.4, -0.6, 2, 0.4, -2])
    run = PUMA.simulate(OperationalSpace.tuned(PUMA), q, 2.0, q0=begin, restitution=None)
    law.holds("rad, at rest at a wrist singularity", np.abs(run.q[-1] - q).max(), 1e-9)
    assert not run.saturated.any()


@pytest.mark.parametrize(
    ("name", "first", "last", "required"),
    [
        ("planar2r", [0.2, 1.2], [0.8, 0.6], 6e-5),
        ("planar2r", [0.2, 1.2], [0.8, -0.6], 3e-4),  # through the stretched arm
        ("cobra600", [0.1, 0.6, 0.05, 0.2], [0.6, 1.0, 0.1, 0.9], 2e-5),
        ("stanford", [0.1, 0.6, 0.4, 0.2, 0.8, 0.1], [0.5, 1.0, 0.5, 0.6, 1.2, 0.5], 2e-5),
        ("cart_pendulum", [0.1, 0.3], [0.3, 0.6], 2e-5),
        (
            "panda",
            [0.0, -0.3, 0.0, -2.2, 0.0, 2.0, 0.8],
            [0.3, -0.6, 0.3, -1.9, -0.3, 2.3, 1.1],
            2e-5,
        ),
    ],
)
@pytest.mark.slow
def test_arms_of_other_joints_follow(name, first, last, required, law):
    """The bounds are at least twice what was seen; joints of less inertia are further off."""
    law.samples(1)
    arm = Arm.load(name)
    run = arm.simulate(
        OperationalSpace.tuned(arm), arm.quintic(first, last, duration=2.0), restitution=None
    )
    law.holds("m and rad, tool", max(tool_errors(run, arm)), required)
    law.holds("rad and m, joints", np.abs(run.q - run.reference_q).max(), required)
    assert not run.saturated.any()


@pytest.mark.slow
def test_a_redundant_arm_keeps_its_tool_while_its_posture_moves(law):
    """The panda's elbow goes to the setpoint's from 0.2 rad away along the null space; the tool stays."""
    law.samples(1)
    q = PANDA.configurations["ready"]
    T = PANDA.fk(q)
    begin = PANDA.ik_numeric(T, q0=q + 0.3 * np.eye(7)[0], restarts=0).q[0]
    assert np.abs(begin - q).max() > 0.1
    run = PANDA.simulate(OperationalSpace.tuned(PANDA), q, 2.0, q0=begin, restitution=None)
    position, rotation = tool_errors(run, PANDA)
    law.holds("m, tool", position, 3e-6)
    law.holds("rad, tool", rotation, 5e-6)
    law.holds("rad, joints at the end", np.abs(run.q[-1] - q).max(), 1e-9)


@pytest.mark.slow
def test_directions_that_are_left_out_follow_the_joints():
    """Position alone: where the joints have no error of their own, the tool is driven in the others by the posture."""
    controller = OperationalSpace.tuned(PUMA, directions=[1, 1, 1, 0, 0, 0])
    q = NOMINAL + 0.02
    run = PUMA.simulate(controller, NOMINAL, 2.0, q0=q, restitution=None)
    assert np.abs(run.q[-1] - NOMINAL).max() < 1e-9
    # The tool's own inertia decides: with the right model its acceleration is what is asked for.
    at = Setpoint(PUMA.description, NOMINAL, np.zeros(6), np.zeros(6))
    tau = controller(0.0, q, np.zeros(6), at)
    acceleration = PUMA.jacobian(q) @ PUMA.forward_dynamics(q, np.zeros(6), tau)
    e = pose_error(PUMA.fk(q), PUMA.fk(NOMINAL))
    assert np.allclose(acceleration[:3], controller.kp * e[:3], atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 1.0, 3.0, np.pi - 1e-6, np.pi - 1e-9])
def test_the_error_of_a_rotation_is_its_vector(angle):
    rng = np.random.default_rng(0)
    for _ in range(20):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        T = pose(rng.normal(size=3), euler=rng.uniform(-3, 3, 3))
        goal = T.copy()
        goal[:3, :3] = Rotation.from_rotvec(angle * axis).as_matrix() @ T[:3, :3]
        goal[:3, 3] += axis
        assert np.allclose(pose_error(T, goal), [*axis, *(angle * axis)], atol=1e-7)
    opposite = pose_error(np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0]))
    assert np.allclose(np.abs(opposite), [0, 0, 0, np.pi, 0, 0])


def test_setpoints_know_how_the_tool_moves(law):
    motion = PUMA.quintic(NOMINAL, PUMA.configurations["ready"], duration=2.0)
    step = 1e-5
    for t in np.linspace(0.1, 1.9, law.samples(50)):
        before, at, after = (
            Setpoint(PUMA.description, motion.q(s), motion.qd(s), motion.qdd(s))
            for s in (t - step, t, t + step)
        )
        moved = pose_error(before.T, after.T) / (2 * step)
        law.holds("twist against differences", np.abs(at.twist - moved).max(), 1e-8)
        change = (after.twist - before.twist) / (2 * step)
        law.holds("acceleration against differences", np.abs(at.acceleration - change).max(), 1e-7)


BAD = {
    "no arm": (lambda: OperationalSpace.tuned(3), "found int; expected an arm"),
    "a negative gain": (lambda: OperationalSpace(PUMA, -1, 1), "kp is"),
    "gains of three": (
        lambda: OperationalSpace(PUMA, np.ones(3), 1),
        r"kp has shape \(3,\); expected a number, or \(6,\)",
    ),
    "gains that are words": (
        lambda: OperationalSpace(PUMA, "stiff", 1),
        "kp: found 'stiff'; expected numbers",
    ),
    "posture of another arm": (
        lambda: OperationalSpace(PUMA, 1, 1, posture_kp=np.ones(7)),
        r"posture_kp has shape \(7,\)",
    ),
    "no direction": (
        lambda: OperationalSpace(PUMA, 1, 1, directions=[0] * 6),
        "directions is .* one of them True",
    ),
    "three directions": (
        lambda: OperationalSpace(PUMA, 1, 1, directions=[1, 1, 1]),
        "expected six of True and False",
    ),
    "directions that the arm has not": (
        lambda: OperationalSpace(Arm.load("planar2r"), 1, 1, directions=[0, 0, 1, 0, 0, 0]),
        "planar2r moves its tool in none of the directions",
    ),
    "a threshold of 0": (
        lambda: OperationalSpace(PUMA, 1, 1, threshold=0),
        "threshold is 0; expected a positive number",
    ),
    "a bandwidth of 0": (lambda: OperationalSpace.tuned(PUMA, bandwidth=0.0), "bandwidth is 0.0"),
}


@pytest.mark.parametrize("name", BAD)
def test_it_is_refused_in_one_line(name):
    call, message = BAD[name]
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_an_arm_without_bodies():
    with pytest.raises(DescriptionError, match="no body"):
        OperationalSpace.tuned(Arm.from_dh([(0, 0, 1, 0)]))
