"""The tool keeps to its path, by kinematics of the table's own matrices; what is in the way is named."""

import numpy as np
import pytest

from dhkit.description import library_robot, pose, world_to_tool
from dhkit.errors import PlanningError
from dhkit.kinematics import inverse_kinematics
from dhkit.trajectories import (
    Limits,
    circle,
    joint_path,
    least_slowdown,
    straight_line,
    tool_circle,
    tool_line,
)

PROMISED = 1e-7  # m and rad
REQUIRED = 1e-6
NUMERIC = 1e-6
WHOLE = {
    "puma560": "nominal",
    "ur5": "nominal",
    "panda": "ready",
    "cobra600": "nominal",
    "stanford": "nominal",
}
PUMA, ARM = library_robot("puma560"), library_robot("planar2r")


def start_of(name):
    return library_robot(name), library_robot(name).numbers.configurations[WHOLE[name]]


def a_line(arm, q):
    """Return two poses that the arm can lead its tool between: up or down, aside, and turned about the vertical."""
    T0 = world_to_tool(arm, q)
    T1 = pose([0, 0, 0], euler=[0, 0, 0.3]) @ T0
    T1[:3, 3] = T0[:3, 3] + ([0.03, -0.15, 0.05] if arm.n == 4 else [-0.1, -0.12, 0.05])
    return T0, T1


def off(arm, q, T):
    """Return how far the tool is off, m or rad, at the worst."""
    found = world_to_tool(arm, q)
    turn = np.swapaxes(found[:, :3, :3], 1, 2) @ T[:, :3, :3]
    skew = (
        np.stack(
            [
                turn[:, 2, 1] - turn[:, 1, 2],
                turn[:, 0, 2] - turn[:, 2, 0],
                turn[:, 1, 0] - turn[:, 0, 1],
            ]
        )
        / 2
    )
    return max(
        np.linalg.norm((found - T)[:, :3, 3], axis=1).max(), np.linalg.norm(skew, axis=0).max()
    )


@pytest.mark.parametrize("name", WHOLE)
def test_the_tool_moves_straight(name):
    arm, q = start_of(name)
    T0, T1 = a_line(arm, q)
    motion = straight_line(arm, T0, T1, q)
    t = np.linspace(0, motion.duration, 10_000)
    x = t / motion.duration
    s = 10 * x**3 - 15 * x**4 + 6 * x**5
    assert off(arm, motion.q(t), tool_line(T0, T1).poses(s)) < PROMISED < REQUIRED
    assert np.abs(motion.q(0.0) - q).max() < 1e-9
    assert np.abs([motion.qd([0, motion.duration]), motion.qdd([0, motion.duration])]).max() < 1e-8
    assert least_slowdown(motion, Limits.of(arm)) == pytest.approx(1, rel=1e-6)


@pytest.mark.parametrize("turning", [False, True])
@pytest.mark.parametrize("name", WHOLE)
def test_the_tool_moves_round(name, turning):
    arm, q = start_of(name)
    T0 = world_to_tool(arm, q)
    centre, axis, angle = T0[:3, 3] + [-0.02, -0.015, 0.0], [0, 0, 1], 1.5 if turning else 2 * np.pi
    motion = circle(arm, T0, centre, axis, angle, q0=q, turning=turning, duration=3.0)
    t = np.linspace(0, 3.0, 10_000)
    s = 10 * (t / 3) ** 3 - 15 * (t / 3) ** 4 + 6 * (t / 3) ** 5
    assert off(arm, motion.q(t), tool_circle(T0, centre, axis, angle, turning).poses(s)) < PROMISED


@pytest.mark.parametrize("name", WHOLE)
def test_derivatives_at_knots_are_those_of_neighbouring_knots(name):
    """Knots satisfy q' and q'' of the path that they lie on: a spline through q alone has nearly the same."""
    from scipy.interpolate import CubicSpline

    arm, q = start_of(name)
    path = joint_path(arm, tool_line(*a_line(arm, q)), q)
    s = np.linspace(0, 1, 801)
    spline = CubicSpline(s, path.q(s))
    assert np.abs(spline(s, 1) - path.qs(s))[5:-5].max() < NUMERIC
    jumps = path.qss(path.breaks[1:-1]) - path.pieces.derivative.derivative(
        path.breaks[1:-1], "left"
    )
    assert np.abs(jumps).max() < 1e-9 * max(1, np.abs(path.qss(s)).max())


def test_arms_without_a_free_orientation_follow_positions():
    T0, T1 = world_to_tool(ARM, [[0.2, 1.2], [1.0, 0.8]])
    motion = straight_line(ARM, T0, T1, [0.2, 1.2], duration=2.0)
    t = np.linspace(0, 2, 1000)
    s = 10 * (t / 2) ** 3 - 15 * (t / 2) ** 4 + 6 * (t / 2) ** 5
    expected = (1 - s)[:, None] * T0[:3, 3] + s[:, None] * T1[:3, 3]
    assert np.abs(world_to_tool(ARM, motion.q(t))[:, :3, 3] - expected).max() < PROMISED


@pytest.mark.parametrize("name", ["puma560", "panda"])
def test_without_a_start_some_branch_inside_the_limits_is_found(name):
    arm, q = start_of(name)
    T0, T1 = a_line(arm, q)
    path = joint_path(arm, tool_line(T0, T1))
    s = np.linspace(0, 1, 1000)
    values = path.q(s)
    assert off(arm, values, tool_line(T0, T1).poses(s)) < PROMISED
    assert ((values >= arm.numbers.lower - 1e-9) & (values <= arm.numbers.upper + 1e-9)).all()


def test_a_line_out_of_reach_is_named():
    T0 = world_to_tool(ARM, [0.3, 0.8])
    T1 = T0.copy()
    T1[:3, 3] *= 2
    with pytest.raises(
        PlanningError, match=r"the path leaves the workspace at s = 0\.\d+, the tool at \(.*\) m"
    ):
        straight_line(ARM, T0, T1, [0.3, 0.8])
    with pytest.raises(PlanningError, match=r"planar2r does not reach the path's first pose"):
        straight_line(ARM, T1, T0)


def test_a_line_on_which_a_branch_ends_is_named():
    """Beyond this place the closed form has four solutions instead of eight: the followed one is among those lost."""
    arm = library_robot("kr5")
    q = np.array([[-1.56, -0.44, 1.87, 1.58, -1.47, 0.29], [-1.77, -0.55, 1.56, 1.25, -1.08, 0.17]])
    T0, T1 = world_to_tool(arm, q)
    with pytest.raises(
        PlanningError, match="the path meets a singularity, and only a jump leads on, at s = "
    ) as error:
        straight_line(arm, T0, T1, q[0])
    end = float(str(error.value).split("s = ")[1].split(",")[0])
    beside = tool_line(T0, T1).poses(np.array([end - 0.01, end + 0.01]))
    assert np.array_equal(inverse_kinematics(arm, beside).valid.sum(axis=1), [8, 4])


def test_a_line_that_begins_near_a_singularity_keeps_its_branch():
    """The elbow is 2 degrees from stretched, where another branch is so near that a long step would end on it."""
    q = np.array([2.0, 0.2, -1.5, -1.2, -0.7, 1.1])
    T = tool_line(*world_to_tool(PUMA, [q, [2.2, -0.1, -1.6, -1.3, -0.6, 1.1]]))
    path = joint_path(PUMA, T, q)
    s = np.linspace(0, 1, 2001)
    solutions = inverse_kinematics(PUMA, T.poses(s))
    branches = [
        np.abs(np.nan_to_num(row, nan=9) - at).max(axis=1).argmin()
        for row, at in zip(solutions.q, path.q(s), strict=True)
    ]
    assert len(set(branches)) == 1


def test_a_beginning_at_a_singularity_is_named():
    q = PUMA.numbers.configurations["ready"]
    T0 = world_to_tool(PUMA, q)
    T1 = T0.copy()
    T1[2, 3] -= 0.2
    with pytest.raises(PlanningError, match=r"the path meets a singularity at s = 0, the tool at"):
        straight_line(PUMA, T0, T1, q)


def test_a_joint_limit_along_the_path_is_named():
    arm, q = start_of("cobra600")
    T0, T1 = a_line(arm, q)
    T1[2, 3] = T0[2, 3] + 0.2  # its quill moves downwards
    with pytest.raises(
        PlanningError, match=r"quill leaves its limit, 0 m, along the path: it comes to -0.1 m"
    ):
        straight_line(arm, T0, T1, q)


def test_an_orientation_that_the_arm_has_not_is_named():
    arm, q = start_of("cobra600")
    T0 = world_to_tool(arm, q)
    T1 = T0 @ pose(euler=[0.3, 0, 0])
    with pytest.raises(
        PlanningError, match="the arm cannot turn its tool as the path asks at s = "
    ):
        straight_line(arm, T0, T1, q)


def test_a_duration_is_checked_first():
    with pytest.raises(ValueError, match="duration is -1"):
        straight_line(ARM, np.eye(4), np.eye(4), duration=-1)
