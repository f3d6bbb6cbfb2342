"""What an arm's axes are like, in words."""

import numpy as np
import pytest

from dhkit import Arm, pose
from dhkit.kinematics import classify

SPHERICAL = "6R, spherical wrist, axes 2 and 3 parallel: closed form, 8 branches"
THREE = "6R, axes 2, 3 and 4 parallel, 5 and 6 meet: closed form, 8 branches"
EXPECTED = {
    **dict.fromkeys(["puma560", "puma560_akb", "puma560_cao", "puma560_cao_printed"], SPHERICAL),
    **dict.fromkeys(["irb140", "kr5", "kuka_kr30_3", "adept_viper_s850"], SPHERICAL),
    **dict.fromkeys(["ur3", "ur5", "ur10"], THREE),
    "stanford": "RRPRRR, spherical wrist, joint 3 slides at right angles to axis 2: closed form, 8 branches",
    "jaco": "6R: no closed form known, solved by elimination",
    "panda": "7R, spherical shoulder, axes 5 and 6 meet: closed form at a given joint 7, 8 branches",
}


@pytest.mark.parametrize("name", EXPECTED)
def test_library_robots(name):
    assert str(Arm.load(name).family) == EXPECTED[name]


@pytest.mark.parametrize(
    "name", ["planar2r", "planar3r", "cobra600", "polar_rp", "cart_pendulum", "pan_tilt", "al5d"]
)
def test_arms_of_few_joints_say_what_they_meet(name):
    words = Arm.load(name).family.words
    assert "closed form" in words
    assert "meets" in words


def rows(right=np.pi / 2, tilt=0.0):
    alphas = [right, tilt, -right, right, -right, 0]
    return [
        (0, d, a, x)
        for d, a, x in zip(
            [0.6, 0, 0.15, 0.43, 0, 0.1], [0, 0.43, 0.02, 0, 0, 0], alphas, strict=True
        )
    ]


def test_angles_typed_with_few_digits_are_said():
    """1.5708 is not a right angle: axes 4 to 6 still meet, but joint 1's is off by 4e-6."""
    words = Arm.from_dh(rows(1.5708)).family.words
    assert words.startswith("6R: no closed form known (nearly")
    assert "are its angles rounded? as_designed=True" in words
    assert str(Arm.from_dh(rows(1.5707963267948966)).family) == SPHERICAL


def test_a_tilt_beyond_the_tolerance_ends_the_family():
    assert classify(Arm.from_dh(rows(tilt=1e-13)).description).family is not None
    assert classify(Arm.from_dh(rows(tilt=1e-11)).description).family is None
    assert str(Arm.from_dh(rows(tilt=0.3)).family) == EXPECTED["jaco"]


def test_base_tool_units_and_convention_change_nothing():
    arm = Arm.load("kr5")
    moved = arm.with_base(pose((1, 2, 3), euler=(0.1, 0.2, 0.3))).with_tool(
        pose((0.1, 0, 0.2), euler=(1, 2, 3))
    )
    assert str(moved.family) == str(arm.family) == SPHERICAL
    locked = Arm.load("panda").lock({2: 0.0})  # without its third joint axes 2 and 4 are parallel
    assert "6R" in str(locked.family)


def test_a_family_is_an_object_that_prints_as_words():
    family = Arm.load("puma560").family
    assert (family.closed_form, family.name, len(family.branches)) == (True, "elbow_wrist", 8)
    assert family.branches == Arm.load("puma560").ik(np.eye(4)).branches
    assert str(family) == repr(family) == f"{family}" == SPHERICAL
    none = Arm.load("panda").family
    assert (none.closed_form, none.name, none.branches) == (False, "", ())
