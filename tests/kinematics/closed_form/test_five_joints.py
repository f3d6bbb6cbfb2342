"""Arms of five joints: every pose that one reaches is solved; of others the position is kept and the turn is least."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import acceptance
from dhkit import Arm

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


def turn_between(R, wanted):
    """Return the angles between rotations (..., 3, 3), rad."""
    relative = np.swapaxes(R, -1, -2) @ wanted
    return Rotation.from_matrix(relative.reshape(-1, 3, 3)).magnitude().reshape(R.shape[:-2])


def random_states(count, seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 5))


@pytest.mark.law
@pytest.mark.parametrize("name", ARMS)
def test_states_are_found_at_their_poses(name, law):
    arm = ARMS[name]
    assert "closed form, 4 branches; meets x, y, z, roll, pitch" in str(arm.family)
    q = random_states(law.samples(1_000_000, 20_000))
    found = arm.ik(arm.fk(q))
    apart = 2 * np.abs(np.sin((found.q - q[:, None]) / 2)).max(axis=-1)
    nearest = np.where(found.valid, apart, np.inf).min(axis=-1)
    regular = ~(found.status == "singular")
    law.holds("regular states missed", int(np.sum(nearest[regular] > 1e-6)), 0, name)
    law.holds("poses without a solution", int(np.sum(~found.valid.any(axis=-1))), 0, name)


@pytest.mark.parametrize("name", ARMS)
def test_the_position_is_kept_and_the_turn_least(name):
    """The turn is the angle between axis 5 and the plane: all rotations with axis 5 in the plane turn by more."""
    arm = ARMS[name]
    T = arm.fk(random_states(300))
    T[:, :3, :3] = Rotation.random(300, random_state=1).as_matrix()
    found = arm.ik(T)
    assert found.valid.any(axis=-1).mean() > 0.5
    pose, branch = np.nonzero(found.valid & (found.status == "ok")[:, None])
    q = found.q[pose, branch]
    reached = arm.fk(q)
    assert np.abs(reached[:, :3, 3] - T[pose, :3, 3]).max() < 1e-11 * arm.description.reach

    # Axis 2, across the plane, and the wanted axis 5.
    frames = arm.frames(q)
    shift = 1 if name == "modified" else 0
    across = frames[:, 1 + shift, :3, 2]
    in_tool = np.swapaxes(reached[:, :3, :3], 1, 2) @ frames[:, 4 + shift, :3, 2, None]
    wanted = (T[pose, :3, :3] @ in_tool)[..., 0]
    least = np.abs(np.arcsin(np.clip(np.sum(wanted * across, axis=-1), -1, 1)))
    turned = turn_between(reached[:, :3, :3], T[pose, :3, :3])
    assert np.abs(turned - least).max() < 1e-7


def test_iteration_finds_no_nearer_pose_with_the_same_position():
    arm = SCORBOT
    rng = np.random.default_rng(2)
    T = arm.fk(random_states(20, seed=2))
    T[:, :3, :3] = Rotation.random(20, random_state=3).as_matrix()
    found = arm.ik(T)
    for pose, goal in zip(found.q, T, strict=True):
        pose = pose[~np.isnan(pose).any(axis=1)]
        if not len(pose):
            continue
        best = turn_between(arm.fk(pose)[:, :3, :3], goal[:3, :3]).min()
        for _ in range(10):
            q = arm.ik_numeric(goal, q0=rng.uniform(-3, 3, 5), position_only=True).q[0]
            assert np.isnan(q).any() or turn_between(arm.fk(q)[:3, :3], goal[:3, :3]) > best - 1e-9


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
    # Axis 5 across the plane: any direction in it is as near.
    side = T.copy()
    side[:3, :3] = Rotation.from_euler("y", 90, degrees=True).as_matrix()
    assert np.isfinite(SO101.ik(side).distance)


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
