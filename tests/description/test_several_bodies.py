"""Links of several bodies: read and written, joined to one where one is needed, kept apart where they stay apart."""

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from bad_robot_files import GOOD
from dhkit import Arm
from dhkit.description import (
    Body,
    from_dh,
    from_toml,
    library_robot,
    lock,
    pose,
    to_toml,
    with_parameters,
    with_payload,
    with_tool,
    with_uniform_links,
)
from dhkit.errors import DescriptionError
from dhkit.expressions import ZERO, exact
from random_arms import arms, random_body, states

ROUNDED = 1e-13
"""What sums of five products of doubles leave, in kg m^2."""

LOADED = """
format = 1
name = "loaded"
convention = "standard"
units = { length = "cm", angle = "deg" }
gravity = [0, -9.81, 0]
parameters = { m2 = 1.5, mp = 0.7, l2 = 0.4 }

[[joint]]
type = "revolute"
a = 50
alpha = 0
d = 0
theta = 0
body = { mass = 2, com = [-25, 0, 0], inertia = { yy = 0.04, zz = 0.04 } }

[[joint]]
type = "revolute"
a = "l2"
alpha = 0
d = 0
theta = 0
bodies = [
    { name = "rod", mass = "m2", com = ["-l2/2", 0, 0], inertia = { yy = "m2*l2^2/12", zz = "m2*l2^2/12" } },
    { mass = "mp", com = [10, 0, 5] },
]
"""


def test_bodies_survive_writing_and_reading():
    arm = from_toml(LOADED)
    rod, payload = arm.joints[1].bodies
    assert (rod.name, payload.name, payload.com[0], payload.mass.text) == (
        "rod",
        "body 2",
        exact(0.1),
        "mp",
    )
    assert arm.warnings == ()
    again = from_toml(to_toml(arm))
    assert again == arm and again.digest == arm.digest and to_toml(again) == to_toml(arm)


@given(arms(most=3), st.integers(1, 16), st.integers(0, 1000))
def test_any_bodies_survive_writing_and_reading(arm, count, seed):
    rng = np.random.default_rng(seed)
    bodies = tuple(random_body(rng) for _ in range(count))
    arm = replace(arm, joints=(*arm.joints[:-1], replace(arm.joints[-1], bodies=bodies)))
    assert from_toml(to_toml(arm)) == arm


def test_one_body_is_that_body_by_either_key():
    single = LOADED.replace("body = {", "bodies = [{").replace("zz = 0.04 } }", "zz = 0.04 } }]")
    assert from_toml(single) == from_toml(LOADED)
    joint = from_toml(LOADED).joints[0]
    assert joint.body is joint.bodies[0]
    assert from_toml(LOADED).joints[0].bodies[0].name == ""


@given(st.integers(2, 6), st.integers(0, 10**6))
def test_several_bodies_are_one_by_the_parallel_axis_theorem(count, seed):
    rng = np.random.default_rng(seed)
    bodies = tuple(random_body(rng) for _ in range(count))
    arm = from_dh([(0, 0, 0.3, 0)])
    arm = replace(arm, joints=(replace(arm.joints[0], bodies=bodies),))
    m = np.array([float(body.mass) for body in bodies])
    c = np.array([[float(x) for x in body.com] for body in bodies])
    tensors = np.array([[[float(x) for x in row] for row in body.inertia.rows] for body in bodies])
    com = m @ c / m.sum()
    levers = c - com
    expected = sum(
        tensor + w * (r @ r * np.eye(3) - np.outer(r, r))
        for tensor, w, r in zip(tensors, m, levers, strict=True)
    )
    assert np.abs(arm.numbers.mass - m.sum()).max() < ROUNDED
    assert np.abs(arm.numbers.com[0] - com).max() < ROUNDED
    assert np.abs(arm.numbers.inertia[0] - expected).max() < ROUNDED
    assert np.array_equal(
        arm.numbers.inertia[0], [[float(x) for x in row] for row in arm.joints[0].body.inertia.rows]
    )


def test_a_mass_that_is_zero_joins_as_nothing():
    arm = with_parameters(from_toml(LOADED), mp=0)
    rod = replace(arm.joints[1], bodies=arm.joints[1].bodies[:1])
    alone = replace(arm, joints=(arm.joints[0], rod))
    for name in ("mass", "com", "inertia"):
        assert np.array_equal(getattr(arm.numbers, name), getattr(alone.numbers, name))
    none = with_parameters(arm, m2=0)
    assert none.numbers.mass[1] == 0 and np.all(np.isfinite(none.numbers.inertia))


def test_a_payload_is_a_body_of_its_own():
    arm = with_tool(library_robot("planar2r"), pose((0.1, 0, 0)))
    loaded = with_payload(with_payload(arm, "m1/4"), 1, (0.2, 0, 0))
    assert [body.name for body in loaded.joints[1].bodies] == ["body 1", "payload", "payload 2"]
    assert [body.com[0] for body in loaded.joints[1].bodies[1:]] == [
        exact(0.1),
        exact(Fraction(3, 10)),
    ]
    assert loaded.joints[0] == arm.joints[0]
    assert loaded.warnings == arm.warnings
    assert from_toml(to_toml(loaded)) == loaded
    for _ in range(13):
        loaded = with_payload(loaded, 1)
    with pytest.raises(
        DescriptionError, match=r"joint 2 \(elbow\): 17 bodies; expected at most 16"
    ):
        with_payload(loaded, 1)


@pytest.mark.slow
def test_locking_keeps_bodies_apart_where_links_stay_apart():
    arm = with_uniform_links(from_dh([(0, 0, 0.3, 0)] * 3))
    bodies = (*arm.joints[0].bodies, Body(exact(1), (exact(-0.1), ZERO, ZERO), name="motor"))
    arm = replace(arm, joints=(replace(arm.joints[0], bodies=bodies), *arm.joints[1:]))
    assert lock(arm, {2: 0.5}).joints[0].bodies == arm.joints[0].bodies
    joined = lock(arm, {1: 0.5})
    assert len(joined.joints[0].bodies) == 1
    assert joined.joints[0].body.mass.text == "m1 + m2 + 1"
    apart = with_payload(arm, 2)
    whole = replace(
        apart, joints=tuple(replace(joint, bodies=(joint.body,)) for joint in apart.joints)
    )
    for held in ({0: 0.3}, {1: "pi/3"}, {2: -1}):
        q = states(lock(apart, held), 4)
        ours, theirs = (Arm(lock(one, held)).mass_matrix(q) for one in (apart, whole))
        assert np.abs(ours - theirs).max() < ROUNDED


def test_what_is_no_set_of_bodies_is_refused():
    arm = from_toml(LOADED)
    many = replace(arm.joints[0], bodies=arm.joints[0].bodies * 17)
    with pytest.raises(
        DescriptionError, match=r"joint 1 \(joint1\): 17 bodies; expected at most 16"
    ):
        replace(arm, joints=(many, arm.joints[1]))


def test_the_bodies_of_the_documentation_are_some():
    page = Path(__file__).resolve().parents[2] / "docs" / "robot-file.md"
    (snippet,) = re.findall(r"```toml\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    arm = from_toml(f"{GOOD}{snippet}[parameters]\nm1 = 2\nl1 = 0.5\nmp = 1\n")
    assert [body.name for body in arm.joints[0].bodies] == ["rod", "payload"]
    assert arm.numbers.com[0, 0] == pytest.approx(-1 / 6)
