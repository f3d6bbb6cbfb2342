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
near_right_angle = st.builds(lambda side, off: side * np.pi / 2 + off, st.sampled_from([-1, 1]), st.floats(-1e-9, 1e-9))
angle = st.one_of(right_angle, near_right_angle, st.floats(-np.pi, np.pi), st.sampled_from(["pi/6", "-pi/4", "1e-9"]))
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
    joints = tuple(replace(joint, body=random_body(rng), drive=random_drive(rng)) for joint in arm.joints)
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
        for key, ij in {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}.items()
    }
    return Body(exact(float(masses.sum())), tuple(exact(float(x)) for x in com), Inertia(**numbers))


def random_drive(rng: np.random.Generator) -> Drive:
    """Return a drive with a reflected inertia of up to 1 kg m^2."""
    return Drive(exact(float(rng.uniform(-70, 70)) or 1.0), exact(float(rng.uniform(0, 2e-4))))


def states(arm: Description, count: int, seed: int = 0) -> np.ndarray:
    """Return joint values, shape (count, n)."""
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, arm.n))
