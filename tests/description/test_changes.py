"""New arms from old."""

import numpy as np
import pytest
from hypothesis import given

from dhkit.description import (
    from_dh,
    from_toml,
    library_robot,
    pose,
    to_toml,
    with_base,
    with_parameters,
    with_tool,
    with_uniform_links,
    world_to_frames,
    world_to_tool,
)
from dhkit.errors import DescriptionError
from dhkit.expressions import PI
from random_arms import states, tables

ROUNDED = 3e-15


@given(tables())
def test_base_and_tool_multiply_from_the_left_and_right(arm):
    left, right = (
        pose((1, 2, 3), euler=(0.1, 1.5, -2)),
        pose((0, -0.2, 0.1), euler=(3, np.pi / 2, 1), order="ZYX"),
    )
    bare = with_tool(with_base(arm, np.eye(4)), np.eye(4))
    q = states(arm, 3)
    moved = world_to_tool(with_tool(with_base(arm, left), right), q)
    assert np.abs(moved - left @ world_to_tool(bare, q) @ right).max() < ROUNDED * max(1, arm.reach)


def test_right_angles_of_a_tool_stay_exact():
    arm = with_tool(library_robot("puma560"), pose((0, 0, 0.1), euler=(0, 90, 0), degrees=True))
    assert arm.tool.placement.rpy[1] == PI / 2
    assert np.array_equal(
        np.abs(arm.numbers.T_last_tool[:3, :3]), [[0, 0, 1], [0, 1, 0], [1, 0, 0]]
    )
    assert from_toml(to_toml(arm), mesh_folder=arm.mesh_folder) == arm


@pytest.mark.parametrize(
    "T", [np.eye(3), 2 * np.eye(4), np.full((4, 4), np.nan), np.ones((2, 4, 4))]
)
def test_what_is_no_pose_is_no_tool(T):
    for change in (with_tool, with_base):
        with pytest.raises(ValueError, match="pose"):
            change(library_robot("puma560"), T)


def test_parameters_change_the_arm_and_nothing_else():
    arm = library_robot("planar2r")
    longer = with_parameters(arm, l1=0.6, m1="2*m2")
    assert longer.numbers.a[0] == 0.6
    assert longer.numbers.mass[0] == 2 * arm.numbers.mass[1]
    assert longer.joints == arm.joints
    assert arm.numbers.a[0] == 0.5
    assert with_parameters(longer, l1=0.5, m1=2) == arm
    with pytest.raises(DescriptionError, match="has no parameter 'l9'; it has g, l1"):
        with_parameters(arm, l9=1)
    with pytest.raises(DescriptionError, match=r"l1 -> l2 -> l1 is a cycle"):
        with_parameters(arm, l1="l2", l2="l1")
    with pytest.raises(DescriptionError, match=r"body\.mass is -1"):
        with_parameters(arm, m1=-1)


def test_uniform_links_are_rods_between_the_frames():
    arm = with_uniform_links(
        from_dh([(0, 0, "l1", 0), (0, 0, "l2", 0)], parameters={"l1": 0.5, "l2": 0.3}), [2, 1.5]
    )
    first = arm.joints[0].body
    assert first.com[0].text == "-l1/2"
    assert first.inertia.zz.text == "l1^2*m1/12"
    assert first.inertia.xx.is_zero
    assert arm.numbers.mass.tolist() == [2, 1.5]
    assert "body" in arm.joints[0].assumed
    planar = library_robot("planar2r")
    assert [joint.body for joint in arm.joints] == [joint.body for joint in planar.joints]


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_a_uniform_link_lies_halfway_between_its_ends_with_the_inertia_of_many_points(convention):
    arm = from_dh(
        [(0, 0.3, 0.2, "pi/2"), (0.4, 0.1, 0.5, 0.7), (0, 0.2, 0.1, 0)], convention=convention
    )
    arm = with_uniform_links(with_tool(arm, pose((0.1, 0.2, 0.3))))
    T = world_to_frames(arm, np.zeros(3))
    ends = [*T[:, :3, 3], world_to_tool(arm, np.zeros(3))[:3, 3]]
    pairs = [(0, 1), (1, 2), (2, 4)] if convention == "standard" else [(1, 2), (2, 3), (3, 4)]
    for i, (start, end) in enumerate(pairs):
        R, p = T[i + 1, :3, :3], T[i + 1, :3, 3]
        assert np.allclose(R @ arm.numbers.com[i] + p, (ends[start] + ends[end]) / 2, atol=ROUNDED)
        points = ends[start] + np.linspace(0, 1, 2001)[:, None] * (ends[end] - ends[start])
        levers = points - points.mean(axis=0)
        tensor = np.mean([r @ r * np.eye(3) - np.outer(r, r) for r in levers], axis=0)
        assert np.allclose(R @ arm.numbers.inertia[i] @ R.T, tensor, rtol=2e-3, atol=1e-6)


def test_uniform_links_are_refused_where_their_names_mean_something_else():
    arm = from_dh([(0, 0, "m1", 0)], parameters={"m1": 1})
    with pytest.raises(DescriptionError, match="uses m1 for something else"):
        with_uniform_links(arm)
    arm = from_dh([(0, 0, "L", 0)], parameters={"m1": 0.25, "L": "2*m1"})
    with pytest.raises(DescriptionError, match="uses m1 for something else"):
        with_uniform_links(arm)
    with pytest.raises(DescriptionError, match="3 masses; expected 2"):
        with_uniform_links(library_robot("planar2r"), [1, 2, 3])
