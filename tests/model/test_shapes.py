"""Laws of what arms look like."""

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from dhkit.description import (
    Base,
    Box,
    Capsule,
    Convention,
    Cylinder,
    Mesh,
    Placement,
    Shape,
    Sphere,
    Tool,
)
from dhkit.description.frames import world_to_frames
from dhkit.description.library import library_robot, robots
from dhkit.description.numbers import matrix
from dhkit.description.table_rows import from_dh
from dhkit.expressions import ZERO, exact, parse
from dhkit.model.shapes import link_parts, missing_shapes

ROUNDING = 1e-12  # of a product of a few matrices
TOUCH = 2e-6  # share of the reach: sizes are rounded to six digits
millimetres = st.sampled_from([0, 0, 10, 80, 350, 700, -10, -80, -350])
angles = st.sampled_from(["0", "pi/2", "-pi/2", "pi", "pi/3"])
rows = st.tuples(angles, millimetres, millimetres, angles)


@st.composite
def arms(draw):
    """Tables of both conventions and both kinds of joints, some with limits and a tool."""
    table = draw(st.lists(rows, min_size=1, max_size=6))
    kinds = "".join(draw(st.sampled_from("RRP")) for _ in table)
    arm = from_dh(
        table, kinds=kinds, convention=draw(st.sampled_from(["standard", "modified"])), length="mm"
    )
    limits = draw(st.sampled_from([None, (0, 0), (0, 0.5), (0.2, 0.5), (-0.5, 0), (-0.4, 0.6)]))
    if limits:
        low, high = map(exact, limits)
        arm = replace(arm, joints=tuple(replace(joint, limits=(low, high)) for joint in arm.joints))
    xyz = draw(st.sampled_from([(0, 0, 0), (0, 0, 0.1), (0.05, -0.3, 0.1)]))
    height = draw(st.sampled_from([0, 0.6]))
    return replace(
        arm,
        tool=Tool(Placement(tuple(map(exact, xyz)))),
        base=Base(Placement((ZERO, ZERO, exact(height)))),
    )


LIBRARY = [library_robot(name) for name in robots()]
ON_THE_FLOOR = ("al5d", "cobra600", "irb140", "jaco", "kr5", "panda", "stanford", "ur5")
DRAWN = [arm for arm in LIBRARY if not any(joint.shapes for joint in arm.joints)]


def check_parts(arm):
    """What holds for the parts of every arm."""
    parts = link_parts(arm)
    assert {part.link for part in parts} == set(range(arm.n + 1))
    for part in parts:
        R, t = part.T_link_part[:3, :3], part.T_link_part[:3, 3]
        assert np.abs(R @ R.T - np.eye(3)).max() < ROUNDING and np.linalg.det(R) > 0
        assert np.isfinite(t).all() and (part.T_link_part[3] == (0, 0, 0, 1)).all()
        assert all(np.isfinite(size) and size > 0 for size in sizes(part.geometry))
        assert re.fullmatch("#[0-9a-f]{6}", part.color)
        assert (part.file is not None) == isinstance(part.geometry, Mesh)


def sizes(geometry):
    match geometry:
        case Box(size):
            return [float(edge) for edge in size]
        case Cylinder(radius, length) | Capsule(radius, length):
            return [float(radius), float(length)]
        case Sphere(size) | Mesh(_, (size, _, _)):
            return [float(size)]


def distance(part, points):
    """How far points of the part's link are outside the part, shape (N,); 0 inside."""
    R, t = part.T_link_part[:3, :3], part.T_link_part[:3, 3]
    local = (points - t) @ R
    match part.geometry:
        case Box():
            beyond = np.abs(local) - np.array(sizes(part.geometry)) / 2
        case Cylinder():
            radius, length = sizes(part.geometry)
            beyond = np.stack(
                [np.hypot(local[:, 0], local[:, 1]) - radius, np.abs(local[:, 2]) - length / 2],
                axis=1,
            )
        case Sphere():
            beyond = np.linalg.norm(local, axis=1, keepdims=True) - sizes(part.geometry)
    return np.linalg.norm(np.maximum(beyond, 0), axis=1)


def spine(part):
    """Points on the part's z axis, from end to end, in its link's frame."""
    length = sizes(part.geometry)[-1] if not isinstance(part.geometry, Sphere) else 0.0
    z = np.linspace(-length / 2, length / 2, 41)[:, None]
    return part.T_link_part[:3, 3] + z * part.T_link_part[:3, 2]


def check_touching(arm, share):
    """Each link is one piece, and shares a point of their joint's axis with the link before it."""
    numbers, parts = arm.numbers, link_parts(arm)
    low, high = (
        np.clip(numbers.lower, -arm.reach, arm.reach),
        np.clip(numbers.upper, -arm.reach, arm.reach),
    )
    tolerance = TOUCH * (max(arm.reach, np.linalg.norm(numbers.T_last_tool[:3, 3])) or 1.0)
    frames = world_to_frames(arm, low + share * (high - low))
    links = [[part for part in parts if part.link == i] for i in range(arm.n + 1)]
    for link in links:
        found, left = [link[0]], link[1:]
        while near := [
            p for p in left if any(near_each_other(p, other) < tolerance for other in found)
        ]:
            found += near
            left = [p for p in left if p not in near]
        assert not left, f"loose parts on link {link[0].link}"
    for i in range(1, arm.n + 1):
        T = frames[i - 1 if arm.convention is Convention.STANDARD else i]
        origin, axis = T[:3, 3], T[:3, 2]
        both = links[i - 1] + links[i]
        spines = np.concatenate(
            [spine(part) @ frames[part.link, :3, :3].T + frames[part.link, :3, 3] for part in both]
        )
        on_axis = origin + np.outer((spines - origin) @ axis, axis)
        gap = [
            np.min(
                [distance(p, (on_axis - frames[k, :3, 3]) @ frames[k, :3, :3]) for p in links[k]],
                axis=0,
            )
            for k in (i - 1, i)
        ]
        assert np.maximum(*gap).min() < tolerance, f"a gap at joint {i}"


def near_each_other(part, other):
    return min(distance(part, spine(other)).min(), distance(other, spine(part)).min())


@pytest.mark.parametrize("arm", LIBRARY, ids=lambda arm: arm.name)
def test_every_link_of_the_library_has_sound_parts(arm):
    check_parts(arm)


@pytest.mark.parametrize("arm", DRAWN, ids=lambda arm: arm.name)
def test_drawn_links_of_the_library_hold_together(arm):
    check_touching(arm, 0.3)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(arms(), st.sampled_from([0.0, 0.5, 1.0]))
def test_any_table_is_drawn_and_holds_together(arm, share):
    check_parts(arm)
    check_touching(arm, share)


@settings(max_examples=20, deadline=None)
@given(st.lists(rows, min_size=1, max_size=6), st.sampled_from(["standard", "modified"]))
def test_units_do_not_matter_and_a_doubled_arm_looks_the_same(table, convention):
    def drawn(factor, length):
        table_then = [(theta, factor * d, factor * a, alpha) for theta, d, a, alpha in table]
        return link_parts(from_dh(table_then, convention=convention, length=length))

    millimetre, metre, double = drawn(1, "mm"), drawn(Fraction(1, 1000), "m"), drawn(2, "mm")
    factor = 2.0 if any(d or a for _, d, a, _ in table) else 1.0
    for part, same, twice in zip(millimetre, metre, double, strict=True):
        assert part.geometry == same.geometry and np.array_equal(part.T_link_part, same.T_link_part)
        assert sizes(twice.geometry) == pytest.approx(
            [factor * size for size in sizes(part.geometry)], rel=1e-5
        )
        assert np.allclose(
            twice.T_link_part[:3, 3], factor * part.T_link_part[:3, 3], rtol=1e-9, atol=1e-12
        )


@pytest.mark.parametrize("name", ON_THE_FLOOR)
@pytest.mark.parametrize("height", [0, 0.5])
def test_an_arm_that_rises_stands_on_the_floor(name, height):
    arm = library_robot(name)
    base = replace(arm, base=Base(Placement((ZERO, ZERO, exact(height)))))
    heights = (
        np.concatenate([spine(part)[:, 2] for part in link_parts(base) if part.link == 0]) + height
    )
    assert abs(heights.min()) < TOUCH * arm.reach


def test_each_drum_of_a_spherical_wrist_is_seen_behind_the_one_before():
    """The drums that links 4 and 5 of the IRB 140 carry for joints 5 and 6."""
    at_wrist = [
        part
        for part in link_parts(library_robot("irb140"))
        if np.allclose(part.T_link_part, np.eye(4))
    ]
    (fifth, length5), (sixth, length6) = (
        max(sizes(part.geometry) for part in at_wrist if part.link == i) for i in (4, 5)
    )
    assert sixth < fifth and length6 > max(2 * fifth, length5)


def test_a_bar_is_not_twisted_in_its_block():
    arm = from_dh([(0, 0.3, 0, "pi/2"), ("pi/3", 0.1, 0, 0)], kinds="RP")
    T = world_to_frames(arm, [0.4, 0.2])
    block, bar, *_ = [part for part in link_parts(arm) if isinstance(part.geometry, Box)]
    assert (block.link, bar.link) == (1, 2)
    block_axes, bar_axes = ((T[part.link] @ part.T_link_part)[:3, :3] for part in (block, bar))
    assert np.allclose(block_axes, bar_axes, atol=ROUNDING)


def test_given_shapes_keep_their_place_color_and_parameters():
    turned = Placement((exact(0.1), ZERO, parse("h", ("h",))), (ZERO, parse("pi/2"), ZERO))
    ball, box = (
        Shape(Sphere(parse("h", ("h",))), turned, "#c8102e"),
        Shape(Box((parse("h/2", ("h",)),) * 3)),
    )
    capsule = Shape(Capsule(exact(0.1), parse("2*h", ("h",))), turned)
    arm = from_dh([(0, 0.4, 0, "pi/2"), (0, 0, 0.3, 0)], parameters={"h": 0.2})
    shaped = replace(
        arm,
        base=Base(shapes=(box,)),
        joints=(replace(arm.joints[0], shapes=(ball, box)), arm.joints[1]),
        tool=Tool(turned, (capsule,)),
    )
    values = {"h": exact(0.2)}
    parts = link_parts(shaped)
    on = {i: [part for part in parts if part.link == i] for i in range(3)}
    assert [part.geometry for part in on[0]] == [Box((exact(0.1),) * 3)]
    assert [part.geometry for part in on[1]] == [Sphere(exact(0.2)), Box((exact(0.1),) * 3)]
    assert on[1][0].color == "#c8102e" and np.array_equal(
        on[1][0].T_link_part, matrix(turned, values)
    )
    assert on[2][-1].geometry == Capsule(exact(0.1), exact(0.4))
    assert np.allclose(
        on[2][-1].T_link_part, shaped.numbers.T_last_tool @ matrix(turned, values), atol=ROUNDING
    )
    check_parts(shaped)


def test_a_link_whose_mesh_is_missing_is_drawn_from_the_table(tmp_path: Path):
    arm = from_dh([(0, 0.4, 0, "pi/2"), (0, 0, 0.3, 0)])
    shapes = (Shape(Mesh("arm.stl", (exact(0.001),) * 3), color="#c8102e"),)
    meshed = replace(
        arm, joints=(replace(arm.joints[0], shapes=shapes), arm.joints[1]), mesh_folder=tmp_path
    )
    for one, other in zip(link_parts(meshed), link_parts(arm), strict=True):
        assert one.geometry == other.geometry and one.color == other.color
    assert missing_shapes(meshed) == ("mesh 'arm.stl' of link 1, which cannot be read",)
    # What it has beside the mesh stays, and is all that is drawn.
    beside = (Shape(Sphere(exact(0.1))), *shapes)
    with_ball = replace(meshed, joints=(replace(arm.joints[0], shapes=beside), arm.joints[1]))
    assert [part.geometry for part in link_parts(with_ball) if part.link == 1] == [
        Sphere(exact(0.1))
    ]
    assert missing_shapes(with_ball) == missing_shapes(meshed)
    (tmp_path / "arm.stl").write_text("solid arm\nfacet normal 0 0 1\nendfacet\nendsolid\n")
    files = [part.file for part in link_parts(meshed) if isinstance(part.geometry, Mesh)]
    assert files == [tmp_path / "arm.stl"]


def test_a_shaped_arm_gets_a_gripper_only_where_it_has_a_tool():
    ball = (Shape(Sphere(exact(0.1))),)
    arm = from_dh([(0, 0.4, 0.1, 0)])
    shaped = replace(arm, joints=(replace(arm.joints[0], shapes=ball),))
    tooled = replace(shaped, tool=Tool(Placement((ZERO, ZERO, exact(0.1)))))
    assert [part.link for part in link_parts(shaped)].count(1) == 1
    assert [part.link for part in link_parts(tooled)].count(1) > 1
