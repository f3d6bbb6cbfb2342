"""Hypothesis strategies for arms: any table, any bodies."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
from hypothesis import strategies as st

from dhkit.description import Body, Description, Drive, Inertia, from_dh, pose, with_base, with_tool
from dhkit.expressions import exact

length = st.one_of(
    st.just(0.0),
    st.floats(-1.0, 1.0).map(lambda x: round(x, 12)),
    st.integers(-(10**6), 10**6).map(lambda um: um * 1e-6),
)
"""m"""
right_angle = st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi])
near_right_angle = st.builds(
    lambda side, off: side * np.pi / 2 + off, st.sampled_from([-1, 1]), st.floats(-1e-9, 1e-9)
)
angle = st.one_of(
    right_angle,
    near_right_angle,
    st.floats(-np.pi, np.pi),
    st.sampled_from(["pi/6", "-pi/4", "1e-9"]),
)
"""rad; what makes reading angles back out of matrices hard is drawn often"""


@st.composite
def tables(draw: st.DrawFn, least: int = 1, most: int = 9) -> Description:
    """Draw a kinematic description: table, base and tool."""
    rows = draw(st.lists(st.tuples(angle, length, length, angle), min_size=least, max_size=most))
    arm = from_dh(
        rows,
        kinds="".join(draw(st.sampled_from("RRP")) for _ in rows),
        convention=draw(st.sampled_from(["standard", "modified"])),
    )
    for change in (with_base, with_tool):
        if draw(st.booleans()):
            xyz = [draw(length) for _ in range(3)]
            euler = [draw(st.one_of(right_angle, st.floats(-np.pi, np.pi))) for _ in range(3)]
            arm = change(arm, pose(xyz, euler=euler))
    return arm


@st.composite
def arms(draw: st.DrawFn, least: int = 1, most: int = 7) -> Description:
    """Draw an arm with a body and a drive on every link."""
    arm = draw(tables(least, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    joints = tuple(
        replace(joint, bodies=(random_body(rng),), drive=random_drive(rng)) for joint in arm.joints
    )
    return replace(arm, joints=joints)


def random_body(rng: np.random.Generator) -> Body:
    """Return a body made of point masses, so that it is possible."""
    points, masses = rng.uniform(-0.3, 0.3, (5, 3)), rng.uniform(0.1, 2.0, 5)
    com = masses @ points / masses.sum()
    levers = points - com
    I = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, levers, strict=True))  # noqa: E741
    I = I + 0.01 * np.eye(3)  # noqa: E741
    numbers = {
        key: exact(Fraction(float(I[ij])))
        for key, ij in {
            "xx": (0, 0),
            "yy": (1, 1),
            "zz": (2, 2),
            "xy": (0, 1),
            "yz": (1, 2),
            "xz": (0, 2),
        }.items()
    }
    return Body(exact(float(masses.sum())), tuple(exact(float(x)) for x in com), Inertia(**numbers))


def random_drive(rng: np.random.Generator) -> Drive:
    """Return a drive with a reflected inertia of up to 1 kg m^2."""
    return Drive(exact(float(rng.uniform(-70, 70)) or 1.0), exact(float(rng.uniform(0, 2e-4))))


# Arms whose inverse kinematics have a closed form.

signed = st.sampled_from([-1, 1])
link = st.one_of(st.floats(0.05, 1.0), st.just(0.3)).map(lambda x: round(x, 6))
shift = st.one_of(st.just(0.0), st.floats(-0.5, 0.5).map(lambda x: round(x, 6)))
turn = st.one_of(st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi]), st.floats(-3.1, 3.1))


@st.composite
def placed(draw, arm):
    for change in (with_base, with_tool):
        if draw(st.booleans()):
            xyz = [draw(shift) for _ in range(3)]
            arm = change(arm, pose(xyz, euler=[draw(turn) for _ in range(3)]))
    return arm


@st.composite
def elbow_arms(draw):
    """Draw an arm of the PUMA's family: twists of any signs, offsets, either convention."""
    right = [draw(signed) * np.pi / 2 for _ in range(4)]
    a1, a3, d1, d2, d3, d6 = (draw(shift) for _ in range(6))
    a2, d4 = draw(signed) * draw(link), draw(signed) * draw(link)
    theta = [draw(turn) for _ in range(6)]
    flat = draw(st.sampled_from([0.0, np.pi]))
    last = draw(turn)
    if draw(st.booleans()):
        alpha, a, d = (
            [right[0], flat, *right[1:], last],
            [a1, a2, a3, 0, 0, draw(shift)],
            [d1, d2, d3, d4, 0, d6],
        )
        arm = from_dh(list(zip(theta, d, a, alpha, strict=True)))
    else:
        alpha, a, d = (
            [0, right[0], flat, *right[1:]],
            [0, a1, a2, a3, 0, 0],
            [d1, d2, d3, d4, 0, d6],
        )
        arm = from_dh(list(zip(theta, d, a, alpha, strict=True)), convention="modified")
    return draw(placed(arm))


@st.composite
def three_parallel_arms(draw):
    """Draw an arm of the UR's family."""
    right = [draw(signed) * np.pi / 2 for _ in range(3)]
    flat = [draw(st.sampled_from([0.0, np.pi])) for _ in range(2)]
    a1, d1, d2, d3, d4, d5, d6 = (draw(shift) for _ in range(7))
    a = [a1, draw(signed) * draw(link), draw(signed) * draw(link), 0, 0, draw(shift)]
    theta = [draw(turn) for _ in range(6)]
    alpha = [right[0], *flat, right[1], right[2], draw(turn)]
    return draw(placed(from_dh(list(zip(theta, [d1, d2, d3, d4, d5, d6], a, alpha, strict=True)))))


@st.composite
def five_joint_arms(draw):
    """Draw a turntable with three parallel joints and a last one across them."""
    right = [draw(signed) * np.pi / 2 for _ in range(2)]
    flat = [draw(st.sampled_from([0.0, np.pi])) for _ in range(2)]
    a = [draw(shift), draw(signed) * draw(link), draw(signed) * draw(link), draw(shift)]
    rows = [
        (draw(turn), draw(shift), *of_link)
        for of_link in zip([*a, draw(shift)], [right[0], *flat, right[1], draw(turn)], strict=True)
    ]
    return draw(placed(from_dh(rows)))


@st.composite
def slide_arms(draw):
    """Draw an arm of the Stanford's family."""
    right = [draw(signed) * np.pi / 2 for _ in range(4)]
    a = [draw(shift), draw(shift), draw(shift), 0, 0, draw(shift)]
    d = [draw(shift), draw(shift), 0, draw(shift), 0, draw(shift)]
    theta = [draw(turn) for _ in range(6)]
    alpha = [
        right[0],
        right[1],
        draw(st.sampled_from([0.0, np.pi])),
        right[2],
        right[3],
        draw(turn),
    ]
    return draw(placed(from_dh(list(zip(theta, d, a, alpha, strict=True)), kinds="RRPRRR")))


@st.composite
def few_joint_arms(draw):
    """Draw a planar arm, a SCARA, a turret, or one with a slide."""
    kinds = draw(
        st.sampled_from(
            ["RR", "RRR", "RRPR", "RRRP", "PRRR", "turret2", "turret3", "pan", "RP", "PR"]
        )
    )
    flats = [draw(st.sampled_from([0.0, np.pi])) for _ in range(4)]
    right = draw(signed) * np.pi / 2
    lengths = [draw(signed) * draw(link) for _ in range(4)]
    theta, d = [draw(turn) for _ in range(4)], [draw(shift) for _ in range(4)]
    if kinds in ("turret2", "turret3", "pan"):
        n = {"turret2": 3, "turret3": 4, "pan": 2}[kinds]
        a, alpha = [draw(shift), *lengths[1:]], [right, *flats[1:]]
        rows = [(theta[i], d[i], a[i], alpha[i]) for i in range(n)]
        return draw(placed(from_dh(rows)))
    if kinds in ("RP", "PR"):
        rows = [
            (theta[0], d[0], 0.0 if kinds == "RP" else draw(shift), right),
            (theta[1], d[1], lengths[1], flats[0]),
        ]
        return draw(placed(from_dh(rows, kinds=kinds)))
    # A slide's length keeps the axes around it apart, or there would be two coincident ones.
    rows = [(theta[i], d[i], lengths[i], flats[i]) for i in range(len(kinds))]
    return draw(placed(from_dh(rows, kinds=kinds)))


def states(arm: Description, count: int, seed: int = 0) -> np.ndarray:
    """Return joint values, shape (count, n)."""
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, arm.n))
