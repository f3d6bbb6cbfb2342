"""Certificates that an attack made lie once: each is a sample of a class."""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev, Polynomial

import dhkit
from dhkit import Limits, Obstacle, Trajectory
from dhkit.description import from_toml
from dhkit.planning import Floor

ROD = """format = 1
name = "rod"
convention = "standard"
{units}
[[joint]]
type = "revolute"
a = 1
alpha = 0
d = 0
theta = 0
{limits}
shape = {{ capsule = {{ radius = 0.01, length = 1.0 }}, xyz = [-0.5, 0, 0], rpy = [0, "pi/2", 0] }}
"""
SLIDE = """format = 1
name = "slide"
convention = "standard"
[[joint]]
type = "prismatic"
a = 0
alpha = 0
d = 0
theta = 0
shape = { sphere = { radius = 0.05 } }
"""
WITHOUT_A_BASE = """format = 1
name = "bare base"
convention = "{convention}"
drawn = false
[[joint]]
type = "{kind}"
a = {before}
alpha = 0
d = 0.1
theta = 0
shape = {{ capsule = {{ radius = 0.03, length = 0.5 }}, xyz = [{middle}, 0, 0], rpy = [0, "pi/2", 0] }}
[[joint]]
type = "revolute"
a = {after}
alpha = 0
d = 0
theta = 0
shape = {{ capsule = {{ radius = 0.03, length = 0.4 }}, rpy = [0, "pi/2", 0] }}
"""


def rod(units="", limits=""):
    return dhkit.Arm(from_toml(ROD.format(units=units, limits=limits)))


def turn(arm, start, rate, duration=1.0):
    return Trajectory(arm.description, [0, duration], [[[start], [rate]]])


def chebyshev(degree):
    """Return the coefficients of T(1 - 2 t), which is 1 at t = 0 and swings between -1 and 1."""
    return Chebyshev.basis(degree).convert(kind=Polynomial)(Polynomial([1, -2])).coef


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize(
    ("convention", "place"), [("standard", (0.5, 0.4, -0.25)), ("modified", (0, 0.5, 0.25))]
)
def test_links_locked_to_a_base_without_shapes_are_checked(kind, convention, place, tmp_path):
    before, after, middle = place
    text = WITHOUT_A_BASE.format(
        convention=convention, kind=kind, before=before, after=after, middle=middle
    )
    whole = dhkit.Arm(from_toml(text.replace("bare base", "bare_base")))
    ball = Obstacle.sphere(0.05, (0.25, 0, 0.1))
    locked = whole.lock({0: 0.0})
    locked.save(tmp_path / "locked.toml")
    expected = whole.distance([0.0, 1.0], [ball]).distance
    for arm in (locked, dhkit.Arm.load(tmp_path / "locked.toml")):
        assert arm.distance([1.0], [ball]).distance == pytest.approx(expected, abs=1e-9)
        assert not arm.certify(arm.cubic([0.1], [1.0], duration=2), obstacles=[ball]).ok


def test_an_arm_below_a_floor_is_named():
    arm = dhkit.Arm.from_dh([(0, 0.4, 0.3, 0), (0, 0, 0.25, 0)])
    motion = arm.cubic([0.1, 0.2], [0.6, 0.7], duration=1)
    found = arm.certify(motion, obstacles=[Floor(0.9)]).not_checked
    assert [words.split(",")[0] for words in found] == [
        "part of link 1 and floor",
        "part of link 2 and floor",
    ]


def test_a_clearance_that_is_reduced_at_an_end_holds_between_states():
    """The rod starts 4.5 mm from the ball, and passes it again after a turn: 0.1 mm, between two states."""
    arm = rod()
    ball = Obstacle.sphere(0.001, (0.9, 0, 0.0111))
    assert not arm.certify(turn(arm, 0.012, 2.5 * np.pi), obstacles=[ball]).ok
    kept = arm.certify(turn(arm, 0.012, 0.5), obstacles=[ball])
    assert any("near the ends" in words for words in kept.not_checked)


@pytest.mark.parametrize("wide", [1e6, 1e7])
def test_jumps_count_beside_what_the_motion_does(wide):
    arm = rod()
    leap = Trajectory(arm.description, [0, 1, 2], [[[0.0]], [[0.4]]])
    assert not arm.certify(leap, Limits.of(arm, lower=-wide, upper=wide)).ok
    kick = Trajectory(arm.description, [0, 1, 2], [[[0.0], [100.0]], [[100.0], [-100.0]]])
    assert not arm.certify(kick, Limits.of(arm, velocity=1e9, acceleration=1.0)).ok
    steady = Trajectory(arm.description, [0, 1, 2], [[[0.0], [100.0]], [[100.0], [100.0]]])
    assert arm.certify(steady, Limits.of(arm, velocity=1e9, acceleration=1.0)).ok


@pytest.mark.parametrize("limits", ["limits = [0, 0]", "limits = [0, 1e-12]"])
def test_a_range_that_is_a_point_does_not_make_a_link_stand(limits):
    arm = rod(limits=limits)
    ball = Obstacle.sphere(0.1, (0, 0.8, 0))
    assert not arm.certify(
        turn(arm, 0.0, 3.0), Limits.of(arm, lower=-4, upper=4), obstacles=[ball]
    ).ok
    assert arm.distance([np.pi / 2], [ball]).distance == pytest.approx(-0.11)


@pytest.mark.parametrize(("degree", "size"), [(8, 3.0), (14, 30.0), (18, 1.0)])
def test_distances_between_states_are_those_of_the_motion(degree, size):
    """Of high polynomials a quintic through the states is another motion."""
    arm = dhkit.Arm(from_toml(SLIDE))
    k = size * chebyshev(degree)
    k[1] += size
    motion = Trajectory(arm.description, [0, 1], k[None, :, None])
    lowest = motion.q(np.linspace(0, 1, 200_001)).min()
    for gap, is_kept in ((0.0101, True), (0.008, False)):
        floor = Obstacle.box((1, 1, 1), (0, 0, lowest - 0.05 - gap - 0.5))
        assert arm.certify(motion, obstacles=[floor], clearance=0.01).ok == is_kept


@pytest.mark.parametrize("clearance", [0.0, 1e-6, 1e-5, 2e-5])
def test_an_arm_of_a_millimetre_passes_nothing(clearance):
    arm = rod(units='units = { length = "mm", angle = "rad" }')
    ball = Obstacle.sphere(5e-6, (0, 0.9e-3, 0))
    assert not arm.certify(turn(arm, 0.02, 3.1), obstacles=[ball], clearance=clearance).ok


@pytest.mark.parametrize("degree", [16, 18, 20])
def test_bounds_of_positions_contain_the_rounding_of_their_polynomials(degree):
    arm = dhkit.Arm(from_toml(SLIDE))
    motion = Trajectory(arm.description, [0, 1], chebyshev(degree)[None, :, None])
    most = np.abs(motion.q(np.linspace(0, 1, 200_001))).max()
    limit = most * (1 - 1e-6)
    assert not arm.certify(motion, Limits.of(arm, lower=-limit, upper=limit)).ok


def test_a_torque_that_is_proved_is_not_refused_for_its_cubics():
    arm = dhkit.Arm.load("ur5")
    motion = Trajectory(
        arm.description, [0, 1], [[[0] * 6, [-5, 6, 6, 4, 6, -3], [-7, 7, 1, -7, 4, -3]]]
    )
    most = np.abs(motion.tau(np.linspace(0, 1, 20_001))).max(axis=0)
    free = {"lower": -np.inf, "upper": np.inf, "velocity": np.inf}
    assert arm.certify(motion, Limits.of(arm, torque=most * (1 + 1e-5), **free)).ok
    assert not arm.certify(motion, Limits.of(arm, torque=most * (1 - 1e-5), **free)).ok
