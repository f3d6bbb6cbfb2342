"""Arms of five joints: every pose that one reaches is solved, and no other."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import acceptance
from dhkit import Arm
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.arm_plane import ArmPlane

pytestmark = pytest.mark.filterwarnings("error")

LINKS = {"length": "mm", "angle": "deg"}
SO101 = Arm.from_dh(
    # Lengths of an SO-101 as its URDF has them, to a millimetre: pan, lift, elbow, wrist and roll.
    [
        [0, 62, 30, 90],
        [76, 18, 116, 0],
        [-76, 0, 135, 0],
        [90, 0, 0, 90],
        [0, 61, 0, 0],
    ],
    name="so101",
    **LINKS,
).with_tool([[1, 0, 0, 0.008], [0, 1, 0, 0], [0, 0, 1, 0.098], [0, 0, 0, 1]])
SCORBOT = Arm.from_dh(
    [[0, 349, 16, -90], [0, 0, 221, 0], [0, 0, 221, 0], [90, 0, 0, 90], [0, 145, 0, 0]],
    name="scorbot",
    **LINKS,
)
MODIFIED = Arm.from_dh(
    [[0, 100, 0, 0], [0, 5, 20, -90], [10, -9, 200, 0], [80, 2, 180, 180], [0, 60, 7, 90]],
    name="modified",
    convention="modified",
    **LINKS,
)
TILTED = SO101.with_base(
    [[0, 0, 1, 0.1], [1, 0, 0, 0.2], [0, 1, 0, 0.3], [0, 0, 0, 1]],
)
ARMS = {arm.name: arm for arm in (SO101, SCORBOT, MODIFIED)} | {"tilted": TILTED}


def random_states(count, seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 5))


@pytest.mark.law
@pytest.mark.parametrize("name", ARMS)
def test_states_are_found_at_their_poses(name, law):
    arm = ARMS[name]
    assert str(arm.family).endswith("axis 5 across them: closed form, 4 branches")
    q = random_states(law.samples(1_000_000, 20_000))
    found = arm.ik(arm.fk(q))
    apart = 2 * np.abs(np.sin((found.q - q[:, None]) / 2)).max(axis=-1)
    nearest = np.where(found.valid, apart, np.inf).min(axis=-1)
    regular = ~(found.status == "singular")
    law.holds("regular states missed", int(np.sum(nearest[regular] > 1e-6)), 0, name)
    law.holds("poses without a solution", int(np.sum(~found.valid.any(axis=-1))), 0, name)
    law.holds("closure by the reach", closure(arm, found, arm.fk(q)), 1e-11, name)


def closure(arm, found, T):
    """Return the largest error of all branches, lengths over the reach."""
    pose, branch = np.nonzero(found.valid)
    error = np.abs(arm.fk(found.q[pose, branch]) - T[pose])
    error[:, :3, 3] /= arm.description.reach
    return error.max()


@pytest.mark.parametrize("noise", [0.0, 1e-16, 1e-14, 1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("bend", [0.0, 0.7])
def test_axis_5_may_stand_on_the_vertical_beside_axis_1(bend, noise):
    """There neither the position nor axis 5 gives joint 1 well: rounding decides which of them is better."""
    rows = [[0, 349, 0, -90], [0, 30, 221, 0], [0, 0, 221, 0], [90, 0, 0, 90], [0, 145, 0, 0]]
    arm = Arm.from_dh(rows, **LINKS)
    q = random_states(400, seed=8)
    q[:, 1:4] = np.array([-np.pi / 2 - bend, 2 * bend, -bend])
    q[:, 1:4] += noise * np.random.default_rng(9).normal(size=(400, 3))
    assert arm.ik(arm.fk(q)).valid.any(axis=-1).all()


@pytest.mark.parametrize("name", ARMS)
def test_the_tool_may_be_on_axis_1(name):
    """There the position leaves joint 1 free, and axis 5 decides."""
    arm = ARMS[name]
    q = random_states(400, seed=4)
    for size in (0.0, 1e-14, 1e-11, 1e-8, 1e-5, 1e-3):
        for k in range(len(q)):
            q[k, 1:3] = _over_axis_1(arm, q[k], size)
        regular = np.isfinite(q).all(axis=1)
        T = arm.fk(q[regular])
        found = arm.ik(T, seed=q[regular])
        apart = 2 * np.abs(np.sin((found.q - q[regular][:, None]) / 2)).max(axis=-1)
        assert np.where(found.valid, apart, np.inf).min(axis=-1).max() < 1e-5, size
        assert closure(arm, found, T) < 1e-9
        q = random_states(400, seed=4)


def _over_axis_1(arm, q, distance):
    """Return joints 2 and 3 that put the foot of the tool's origin this far from axis 1 in the plane; NaN if none."""
    plane = ArmPlane.of(Axes.of(arm.description))
    fit = classify(arm.description).fit
    foot = np.asarray(fit.parameters["foot"])
    if fit.parameters["offset"]:
        return q[1:3]

    def place(joints):
        T = arm.fk([0.0, *joints, *q[3:]])
        return plane.coordinates(T[:3, 3] + T[:3, :3] @ foot)[0]

    # Joint 2 alone, by bisection between two places on both sides.
    q3 = q[2]
    grid = np.linspace(-np.pi, np.pi, 25)
    values = [place([q2, q3]) - distance for q2 in grid]
    for low, high, a, b in zip(grid, grid[1:], values, values[1:], strict=False):
        if a * b < 0:
            return [brentq(lambda q2: place([q2, q3]) - distance, low, high, xtol=1e-16), q3]
    return [np.nan, np.nan]


@pytest.mark.parametrize("name", ARMS)
def test_other_poses_are_out_of_reach(name):
    arm = ARMS[name]
    T = arm.fk(random_states(300))
    T[:, :3, :3] = Rotation.random(300, random_state=1).as_matrix()
    found = arm.ik(T)
    assert not found.valid.any()
    assert (found.status == "out_of_reach").all()
    assert (found.distance > 0).all()


def test_a_plane_that_does_not_hold_axis_5_does_not_reach():
    """With the plane beside axis 1 only one of the two shoulders can turn it along axis 5."""
    T = SO101.fk(random_states(100, seed=6))
    found = SO101.ik(T)
    assert closure(SO101, found, T) < 1e-12
    assert (found.valid.sum(axis=-1) == 2).mean() > 0.9


def test_poses_beyond_reach_and_none():
    T = SO101.fk(np.full(5, 0.3))
    far = T.copy()
    far[:3, 3] *= 10
    broken = T.copy()
    broken[0, 0] = np.nan
    assert SO101.ik(np.stack([T, far, broken])).status.tolist() == [
        "ok",
        "out_of_reach",
        "not_a_pose",
    ]


def test_a_path_of_five_joints_is_followed():
    q = np.linspace([0.2, 0.4, -0.8, 0.3, 0.1], [0.9, 0.1, -0.4, 0.5, 1.1], 50)
    path = SO101.ik_path(SO101.fk(q), q[0])
    assert np.allclose(SO101.fk(path.q), SO101.fk(q), atol=1e-10)


SO101_ORIGINS = """\
0.0207909 -0.0230745 0.0948817  -3.14159 6.03684e-16 1.5708
-0.0303992 -0.0182778 -0.0542  -1.5708 -1.5708 0
-0.11257 -0.028 2.46331e-16  -1.22818e-15 5.75928e-16 1.5708
-0.1349 0.0052 1.65232e-16  3.2474e-15 2.86219e-15 -1.5708
0 -0.0611 0.0181  1.5708 -9.38083e-08 3.14159
-0.0079 -0.000218121 -0.0981274  1.5708 1.22465e-16 1.5708"""
"""Joints' origins, xyz and rpy, and the tool's: TheRobotStudio/SO-ARM100, Simulation/SO101/so101_new_calib.urdf."""


def test_the_urdf_of_an_so101_is_one_as_designed(tmp_path):
    """Its right angles have five digits: dhkit says so, and reads them as right angles where it is told to."""
    lines = ["<robot name='so101'>", *(f"<link name='l{k}'/>" for k in range(7))]
    for k, origin in enumerate(SO101_ORIGINS.splitlines()):
        xyz, rpy = origin.split("  ")
        kind = "fixed" if k == 5 else "revolute"
        lines += [
            f"<joint name='j{k}' type='{kind}'><origin xyz='{xyz}' rpy='{rpy}'/>",
            f"<parent link='l{k}'/><child link='l{k + 1}'/><axis xyz='0 0 1'/>",
            "<limit lower='-2' upper='2' effort='10' velocity='10'/></joint>",
        ]
    path = tmp_path / "so101.urdf"
    path.write_text("\n".join([*lines, "</robot>"]))
    assert "are its angles rounded?" in str(Arm.from_urdf(path).family)
    arm = Arm.from_urdf(path, as_designed=True)
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (200, 5))
    found = arm.ik(arm.fk(q))
    apart = np.abs(found.q - q[:, None]).max(axis=-1)
    assert np.where(found.valid, apart, np.inf).min(axis=-1).max() < 1e-9


@acceptance.only_accepting
def test_right_angles_and_zeros():
    """Exact multiples of 45 degrees, where joints 1 and 5 are free or links are stretched."""
    values = np.arange(-3, 5) * np.pi / 4
    q = np.array(np.meshgrid(*[values] * 5)).reshape(5, -1).T
    for arm in ARMS.values():
        found = arm.ik(arm.fk(q))
        assert found.valid.any(axis=-1).all(), arm.name
