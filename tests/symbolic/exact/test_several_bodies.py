"""Links of several bodies: both derivations agree exactly, and with the arm whose links are one body each."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from acceptance import sample_size
from dhkit import Arm
from dhkit.description import (
    Body,
    Description,
    Inertia,
    Named,
    from_toml,
    library_robot,
    with_payload,
)
from dhkit.expressions import exact, substitute
from dhkit.symbolic.exact.base_parameters import base_parameters
from dhkit.symbolic.exact.lagrangian import lagrangian
from dhkit.symbolic.mistakes import LINK_MISTAKES, MadeAt
from dhkit.symbolic.ring import translated
from dhkit.symbolic.textbook import derive
from exact_checks import errors
from random_arms import arms, random_body

TOLERANCE = 1e-12
"""As for links of one body, in the measure of verification."""

HEAD = """
format = 1
name = "{name}"
convention = "{convention}"
gravity = [0, "-g", 0]
[parameters]
g = 9.81
l1 = 0.5
l2 = 0.4
m1 = 2.0
m2 = 1.5
mp = 0.7
r = 0.1
"""
ROW = """
[[joint]]
type = "{type}"
a = {a}
alpha = {alpha}
d = {d}
theta = 0
bodies = [{bodies}]
"""
ROD = '{{ name = "rod", mass = "{m}", com = ["{c}", 0, 0], inertia = {{ yy = "{m}*{l}^2/12", zz = "{m}*{l}^2/12" }} }}'
FULL = (
    '{ mass = "m1", com = ["r", "l1/3", "-r/2"], inertia = { xx = "m1*r^2", yy = "m1*r^2*2", zz = "m1*r^2*5/2", '
    'xy = "m1*r^2/7", yz = "-m1*r^2/9", xz = "m1*r^2/11" } }'
)
MOTOR = '{ name = "motor", mass = 0.4, com = [0, 0.02, "r"], inertia = { xx = 1e-3, yy = 1e-3, zz = 2e-3 } }'


def rod(m, c, length):
    return ROD.format(m=m, c=c, l=length)


def load(x, y="0"):
    return f'{{ name = "payload", mass = "mp", com = ["{x}", "{y}", 0] }}'


def robot(name, convention, *rows):
    """Return a robot of rows (type, a, alpha, d, bodies)."""
    keys = ("type", "a", "alpha", "d")
    joints = (
        ROW.format(**dict(zip(keys, row, strict=False)), bodies=", ".join(row[4:])) for row in rows
    )
    return from_toml(HEAD.format(name=name, convention=convention) + "".join(joints))


ROBOTS = {
    arm.name: arm
    for arm in (
        robot(
            "two_rods",
            "standard",
            ("revolute", '"l1"', 0, 0, rod("m1", "-l1/2", "l1"), MOTOR),
            ("revolute", '"l2"', 0, 0, rod("m2", "-l2/2", "l2"), load("0")),
        ),
        robot(
            "two_rods_modified",
            "modified",
            ("revolute", 0, 0, 0, rod("m1", "l1/2", "l1"), MOTOR),
            ("revolute", '"l1"', 0, 0, rod("m2", "l2/2", "l2"), load("l2"), FULL),
        ),
        robot("pendulum", "modified", ("revolute", 0, 0, 0, rod("m1", "l1/2", "l1"), load("l1"))),
        robot(
            "polar",
            "standard",
            ("revolute", 0, '"pi/2"', 0, FULL, MOTOR),
            ("prismatic", 0, 0, '"l1"', rod("m2", "-l2/2", "l2"), load("r", "l2")),
        ),
        robot(
            "cart",
            "modified",
            ("prismatic", 0, '"-pi/2"', 0, FULL, MOTOR, load("l1")),
            ("revolute", '"l2"', '"pi/3"', 0, rod("m2", "l2/2", "l2"), load("l2", "r")),
        ),
        robot(
            "spatial",
            "standard",
            ("revolute", 0, '"pi/2"', '"l1"', FULL, MOTOR, load("r")),
            ("revolute", '"l2"', 0, 0, rod("m2", "-l2/2", "l2"), MOTOR),
            ("revolute", 0.3, 0, 0, rod("m1", "-l1/2", "l1"), load("0", "r")),
        ),
    )
}


def joined_by_hand(description: Description) -> Description:
    """Return the arm with one body a link: masses added, moments added, tensors moved by Steiner's theorem."""

    def number(x):
        return substitute(x, description.parameters).rational

    joints = []
    for joint in description.joints:
        parts = []
        for body in joint.bodies:
            tensor = [[number(x) for x in row] for row in body.inertia.rows]
            parts.append((number(body.mass), [number(x) for x in body.com], tensor))
        mass = sum(m for m, _, _ in parts)
        com = [sum(m * c[k] for m, c, _ in parts) / mass for k in range(3)]

        def entry(i, j, parts=parts, com=com):
            total = Fraction(0)
            for m, c, tensor in parts:
                lever = [x - y for x, y in zip(c, com, strict=True)]
                total += (
                    tensor[i][j]
                    - m * lever[i] * lever[j]
                    + (m * sum(x * x for x in lever) if i == j else 0)
                )
            return exact(total)

        inertia = Inertia(
            entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(1, 2), entry(0, 2)
        )
        joints.append(
            replace(joint, bodies=(Body(exact(mass), tuple(exact(x) for x in com), inertia),))
        )
    return replace(description, joints=tuple(joints))


@pytest.mark.parametrize("symbols", ["none", "file", "inertial"])
@pytest.mark.parametrize("name", ROBOTS)
def test_both_derivations_agree_exactly_and_with_pinocchio(name, symbols):
    lag = lagrangian(ROBOTS[name], symbols)
    other = derive(ROBOTS[name], symbols=symbols)
    assert lag.prove_euler_lagrange() and lag.prove_skew_symmetry()
    assert all(lag.M.flat[k] == other.M.flat[k] for k in range(lag.M.size))
    assert (lag.K, lag.V) == (other.K, other.V)
    assert max(errors(lag, 20).values()) < TOLERANCE


@pytest.mark.parametrize("name", ROBOTS)
def test_equations_are_polynomials_in_the_parameters(name):
    assert set(lagrangian(ROBOTS[name]).arm.ring.constants) <= {
        *ROBOTS[name].parameters,
        "sqrt(2)",
        "sqrt(3)",
    }


@settings(max_examples=sample_size(25, quick=8))
@given(arms(most=3), st.integers(2, 3), st.integers(0, 10**6))
def test_random_arms_with_bodies_agree(arm, count, seed):
    rng = np.random.default_rng(seed)
    joints = (
        replace(joint, bodies=tuple(random_body(rng) for _ in range(count))) for joint in arm.joints
    )
    lag = lagrangian(replace(arm, joints=tuple(joints)), "none")
    assert lag.prove_euler_lagrange()
    assert max(errors(lag, 5).values()) < TOLERANCE


@pytest.mark.parametrize("name", ROBOTS)
def test_an_arm_is_the_one_whose_links_are_joined_by_hand(name):
    ours, theirs = ROBOTS[name], joined_by_hand(ROBOTS[name])
    assert np.array_equal(ours.numbers.inertial_parameters, theirs.numbers.inertial_parameters)
    ours, theirs = lagrangian(ours, "none"), lagrangian(theirs, "none")
    ring = ours.arm.ring
    for quantity in ("M", "g", "tau", "K", "V"):
        pairs = zip(
            np.ravel(getattr(ours, quantity)), np.ravel(getattr(theirs, quantity)), strict=True
        )
        assert all(a == translated(b, ring, {}) for a, b in pairs), quantity


@pytest.mark.parametrize("name", ROBOTS)
def test_the_numeric_path_agrees_with_pinocchio(name):
    assert Arm(ROBOTS[name]).verify(20).ok


@pytest.mark.parametrize("name", ["two_rods", "polar"])
def test_base_parameters_are_those_of_the_joined_links(name):
    base = base_parameters(ROBOTS[name])
    assert base.prove()
    assert base.names == base_parameters(joined_by_hand(ROBOTS[name])).names


def test_a_payload_makes_no_reciprocal():
    planar = library_robot("planar2r")
    parameters = Named({**planar.parameters, "mp": exact(1)})
    lag = lagrangian(with_payload(replace(planar, parameters=parameters), "mp"))
    ring = lag.arm.ring
    m2, mp, l2 = (ring.constant(name) for name in ("m2", "mp", "l2"))
    assert lag.M[1, 1] == m2 * l2**2 * Fraction(1, 3) + mp * l2**2
    assert not any("/" in text for text in ring.constants)


# Mistakes at one body


@pytest.mark.parametrize("name", ["two_rods", "cart"])
@pytest.mark.parametrize("mistake", sorted(LINK_MISTAKES))
def test_mistakes_at_all_bodies_of_a_link_are_the_link_s(name, mistake):
    """Energies are sums over bodies, so what a mistake changes at a link is what it changes at its bodies."""
    description = ROBOTS[name]
    right = derive(description)
    bodies = [body.name for body in description.joints[1].bodies]
    link = derive(description, {MadeAt(mistake, 2)})
    parts = [derive(description, {MadeAt(mistake, 2, body)}) for body in bodies]
    together = derive(description, {MadeAt(mistake, 2, body) for body in bodies})
    assert (link.K, link.V) == (together.K, together.V)
    ring = right.arm.ring
    assert ring.sum(part.K - right.K for part in parts) == link.K - right.K
    assert ring.sum(part.V - right.V for part in parts) == link.V - right.V
    for one, part in enumerate(parts):
        others = [k for k in range(len(bodies)) if k != one]
        assert all(part.links[1].bodies[k].K == right.links[1].bodies[k].K for k in others)


def test_mistakes_at_bodies_are_checked():
    two = ROBOTS["two_rods"]
    assert str(MadeAt("mass_forgotten", 2, "payload")) == "mass_forgotten at link 2, payload"
    for made, complaint in (
        (MadeAt("mass_forgotten", 2, "motor"), "no body 'motor' of link 2; expected rod, payload"),
        (MadeAt("mass_forgotten", None, "rod"), "no body 'rod'; expected none"),
        (MadeAt("rotor_gear", 2, "rod"), "no body 'rod' of link 2"),
    ):
        with pytest.raises(ValueError, match=complaint):
            derive(two, {made})
    with pytest.raises(ValueError, match="no body 'rod' of link 1; expected none"):
        derive(library_robot("planar2r"), {MadeAt("mass_forgotten", 1, "rod")})
    with pytest.raises(ValueError, match="no body 'rod' of link 2; expected none"):
        derive(two, {MadeAt("mass_forgotten", 2, "rod")}, "inertial")
