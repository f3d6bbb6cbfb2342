"""Laws of boundaries in closed form: nothing is beyond them, and the arm comes as near as it likes."""

import numpy as np
import pytest

import dhkit
from dhkit.description import from_dh, library_robot, robots
from dhkit.description.poses import inverse_pose
from dhkit.kinematics import classify, forward_kinematics, inverse_kinematics
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.boundaries import boundaries
from dhkit.kinematics.workspace import first_axis, workspace
from random_arms import states

BEYOND = 1e-9  # m
STEP = 1e-4  # of the reach
MOSTLY = 0.95  # of the points of a curve: beside its corners, a step may end beyond another curve
NEAR = 0.03  # of the reach: how near 50,000 random states of up to three joints come to a boundary
BOUNDED = [name for name in robots() if boundaries(library_robot(name))]
SPHERICAL = [name for name in BOUNDED if classify(library_robot(name)).family.name == "elbow_wrist"]


def bounded(arm, q):
    """Return where the point is that the boundaries are about, shape (..., 3)."""
    T = forward_kinematics(arm, q)
    to_wrist = classify(arm).fit.parameters.get("T_tool_wrist", np.eye(4)[:3])
    return T[..., :3, :3] @ to_wrist[:, 3] + T[..., :3, 3]


def section(arm, points):
    """Return distances from axis 1 and heights along it, shape (..., 2), m."""
    T = first_axis(arm)
    x, y, z = np.moveaxis((points - T[:3, 3]) @ T[:3, :3], -1, 0)
    return np.stack([np.hypot(x, y), z], axis=-1)


def free_states(arm, count):
    """Return joint values over full turns; slides stay inside their limits."""
    q, numbers = states(arm, count), arm.numbers
    share = (q + np.pi) / (2 * np.pi)
    with np.errstate(invalid="ignore"):
        return np.where(
            numbers.prismatic, numbers.lower + share * (numbers.upper - numbers.lower), q
        )


@pytest.mark.parametrize("name", BOUNDED)
def test_nothing_is_beyond_and_the_arm_comes_near(name):
    arm = library_robot(name)
    found = {boundary.name: boundary for boundary in boundaries(arm)}
    seen = section(arm, bounded(arm, free_states(arm, 50_000)))
    radii = section(arm, found["outer"].circle)[:, 0]
    assert np.ptp(radii) < BEYOND
    assert 0 <= radii[0] - seen[:, 0].max() + BEYOND < NEAR * arm.reach
    if "shoulder" in found:
        radii = section(arm, found["shoulder"].circle)[:, 0]
        assert np.ptp(radii) < BEYOND
        assert 0 <= seen[:, 0].min() - radii[0] + BEYOND < NEAR * arm.reach
        assert np.nanmax(np.abs(section(arm, found["shoulder"].section)[:, 0] - radii[0])) < BEYOND


@pytest.mark.parametrize("name", [*SPHERICAL, "stanford", "ax12_arm", "al5d", "wide", "widest"])
def test_a_boundary_has_one_side_that_is_reached(name):
    arm = {"wide": turntable(0.25), "widest": turntable(1.5)}.get(name) or library_robot(name)
    to_wrist = np.vstack(
        [classify(arm).fit.parameters.get("T_tool_wrist", np.eye(4)[:3]), [0, 0, 0, 1]]
    )
    for boundary in boundaries(arm):
        across = np.tile(Axes.of(arm).direction(2), (len(boundary.section), 1))
        if boundary.name != "shoulder":
            across = np.cross(across, np.gradient(boundary.section, axis=0))
        normals = across / np.linalg.norm(across, axis=1, keepdims=True)
        usable = np.isfinite(normals[:, 0] + boundary.section[:, 0])
        points, normals = boundary.section[usable], normals[usable]
        reached = []
        for step in (-STEP * arm.reach, STEP * arm.reach):
            T = np.tile(np.eye(4), (len(points), 1, 1))
            T[:, :3, 3] = points + step * normals
            solutions = inverse_kinematics(arm, T @ inverse_pose(to_wrist))
            # Limits of revolute joints do not count, those of slides do.
            slides = arm.numbers.prismatic
            outside = (solutions.q < arm.numbers.lower) | (solutions.q > arm.numbers.upper)
            reached.append((solutions.valid & ~(outside & slides).any(axis=-1)).any(axis=-1))
        assert np.mean(reached[0] != reached[1]) > MOSTLY, boundary.name


def turntable(a1):
    """Return an arm of links 0.9 m and 0.3 m on a turntable of radius a1, with a spherical wrist."""
    right = np.pi / 2
    rows = [
        (0, 0, a1, right),
        (0, 0, 0.9, 0),
        (0, 0, 0, right),
        (0, 0.3, 0, right),
        (0, 0, 0, -right),
        (0, 0, 0, 0),
    ]
    return from_dh(rows)


def test_holes_that_the_arm_reaches_from_behind_are_none():
    """About its turntable's axis 2 an arm may leave a hole that it reaches with joint 1 turned by 180 degrees."""
    assert [boundary.name for boundary in boundaries(turntable(0.0))] == ["outer", "inner"]
    assert [boundary.name for boundary in boundaries(turntable(0.25))] == ["outer", "inner"]
    assert [boundary.name for boundary in boundaries(library_robot("irb140"))] == ["outer"]
    height = {
        a1: np.nanmax(section(turntable(a1), boundaries(turntable(a1))[1].section)[:, 0])
        for a1 in (0.0, 0.25)
    }
    assert height[0.0] == pytest.approx(0.6)
    assert height[0.25] == pytest.approx(0.6 - 0.25)


def test_published_reaches():
    """Of planar arms: the sum and the difference of their links."""
    arm = library_robot("planar2r")
    outer, inner = boundaries(arm)
    l1, l2 = arm.numbers.a
    assert np.linalg.norm(outer.circle, axis=1) == pytest.approx(
        np.full(len(outer.circle), l1 + l2)
    )
    assert np.linalg.norm(inner.circle, axis=1) == pytest.approx(
        np.full(len(inner.circle), abs(l1 - l2))
    )


def test_what_has_no_boundary_in_closed_form_has_none():
    """A slide without limits has no outer one."""
    assert boundaries(from_dh([(0, 0, 0, "pi/2"), (0, 0, 0, 0)], kinds="RP")) == ()
    (inner,) = boundaries(from_dh([(0, 0, 0, "pi/2"), (0, 0, 0.2, 0)], kinds="RP"))
    assert np.linalg.norm(inner.circle, axis=1) == pytest.approx(np.full(len(inner.circle), 0.2))
    assert boundaries(library_robot("panda")) == boundaries(library_robot("cart_pendulum")) == ()


@pytest.mark.parametrize("name", BOUNDED)
def test_the_figure_of_a_workspace_draws_them(name):
    arm = library_robot(name)
    found = boundaries(arm)
    figure = dhkit.plot(workspace(arm, 500))
    views = figure.axes[:-1]
    for boundary, curve in zip(
        found, [line.get_xydata() for line in views[0].lines[3:]], strict=True
    ):
        shown = section(arm, boundary.section) if len(views) == 2 else boundary.circle[:, :2]
        assert np.allclose(curve, shown, rtol=0, atol=BEYOND, equal_nan=True)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(names) == 2 + len(found)
    assert any(text.startswith("outer boundary of the") for text in names)
