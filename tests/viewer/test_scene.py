"""Laws of the scene: every part stands where the table says, in any state."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.description import (
    Capsule,
    Cylinder,
    Mesh,
    from_dh,
    library_robot,
    robots,
    world_to_frames,
    world_to_tool,
)
from dhkit.model.shapes import link_parts
from dhkit.viewer.scene import (
    build_scene,
    first_configuration,
    frame_labels,
    node_transforms,
    scene_size,
)
from random_arms import states, tables

ROUNDING = 1e-13  # times the arm's size: two orders of one product of a dozen matrices
EVERY_STATE = 5


def transforms_by_path(commands):
    """Return the last transform set at every path."""
    return {
        c["path"]: np.reshape(c["matrix"], (4, 4)).T
        for c in commands
        if c["type"] == "set_transform"
    }


def objects_by_path(commands):
    return {c["path"]: c["object"] for c in commands if c["type"] == "set_object"}


def landmarks(part, drawn):
    """Return the same points of a part's solid in the axes of its meshcat object and in its own, (k, 3) each."""
    geometry = drawn["geometries"][0]
    if isinstance(part.geometry, Cylinder):  # three.js: along y
        r, h = geometry["radiusTop"], geometry["height"] / 2
        assert (r, h) == (float(part.geometry.radius), float(part.geometry.length) / 2)
        return [[0, h, 0], [0, -h, 0], [r, 0, 0]], [[0, 0, h], [0, 0, -h], [r, 0, 0]]
    if isinstance(part.geometry, Capsule):
        top = max(point["y"] for point in geometry["points"])
        tip = float(part.geometry.length) / 2 + float(part.geometry.radius)
        return [[0, top, 0], [0, -top, 0]], [[0, 0, tip], [0, 0, -tip]]
    scale = [float(x) for x in part.geometry.scale] if isinstance(part.geometry, Mesh) else 1.0
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    return corners, scale * corners


def moved(T, points):
    return np.asarray(points, dtype=float) @ T[:3, :3].T + T[:3, 3]


def check_parts(arm, q):
    """Compose the drawn transforms, node by node, and hold them against the frames' own product."""
    parts = link_parts(arm)
    commands = build_scene(arm, parts).commands
    fixed, drawn = transforms_by_path(commands), objects_by_path(commands)
    nodes, frames = node_transforms(arm, q), world_to_frames(arm, q)
    paths = iter(
        sorted((path for path in drawn if "/part" in path), key=lambda path: by_number(path))
    )
    by_link = sorted(range(len(parts)), key=lambda k: parts[k].link)
    for part in (parts[k] for k in by_link):
        path = next(paths)
        assert path.startswith(f"/dhkit/link{part.link}/")
        in_meshcat, in_part = landmarks(part, drawn[path])
        seen = moved(nodes[part.link] @ fixed[path], in_meshcat)
        expected = moved(frames[part.link] @ part.T_link_part, in_part)
        assert np.abs(seen - expected).max() <= ROUNDING * max(1.0, scene_size(arm))


def by_number(path):
    link, part = path.removeprefix("/dhkit/link").split("/part")
    return int(link), int(part)


@given(tables(most=5), st.integers(0, 1000))
def test_every_part_of_any_arm_stands_at_its_frame(arm, seed):
    check_parts(arm, states(arm, 1, seed)[0])


@pytest.mark.parametrize("name", robots())
def test_every_part_of_the_library_stands_at_its_frame(name):
    arm = library_robot(name)
    for q in states(arm, EVERY_STATE):
        check_parts(arm, q)


def test_shapes_of_a_file_keep_their_axis_and_color(signal_arm):
    check_parts(signal_arm, np.array([0.3, -0.7]))
    drawn = objects_by_path(build_scene(signal_arm, link_parts(signal_arm)).commands)
    assert drawn["/dhkit/link1/part0"]["materials"][0]["color"] == 0xC000C0


@given(tables(most=4))
def test_nodes_begin_in_the_first_configuration(arm):
    fixed = transforms_by_path(build_scene(arm, link_parts(arm)).commands)
    nodes = node_transforms(arm, first_configuration(arm))
    for path, T in zip(
        [*(f"/dhkit/link{i}" for i in range(arm.n + 1)), "/dhkit/tool"], nodes, strict=True
    ):
        assert np.array_equal(fixed[path], T)


def test_a_batch_of_nodes_ends_with_the_tool():
    arm = library_robot("panda")
    q = states(arm, 6).reshape(2, 3, arm.n)
    nodes = node_transforms(arm, q)
    assert nodes.shape == (2, 3, arm.n + 2, 4, 4)
    assert np.allclose(nodes[..., -1, :, :], world_to_tool(arm, q), rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("planar2r", ["0", "1", "2 = tool"]),
        ("puma560", ["0", "1", "2", "3", "4, 5, 6 = tool"]),  # a spherical wrist has one centre
        ("stanford", ["0", "1", "2", "3, 4, 5, 6 = tool"]),
    ],
)
def test_frames_at_one_place_share_a_label(name, labels):
    assert [label.text for label in frame_labels(library_robot(name))] == labels


def test_frames_that_are_one_are_equal_and_frames_that_turn_are_not():
    arm = from_dh([(0, 0, 0, 0), (0, 0.3, 0, 0)])
    assert [label.text for label in frame_labels(arm)] == ["0, 1", "2 = tool"]


def test_up_is_against_gravity():
    assert build_scene(library_robot("planar2r"), ()).about["up"] == [0, 1, 0]
    assert build_scene(library_robot("puma560"), ()).about["up"] == [0, 0, 1]


def test_triads_are_hidden_at_first():
    commands = build_scene(library_robot("ur5"), ()).commands
    triads = {
        c["path"] for c in commands if c["type"] == "set_object" and c["path"].endswith("/frame")
    }
    hidden = {c["path"] for c in commands if c["type"] == "set_property" and c["value"] is False}
    assert triads == hidden
    assert triads


def test_equal_arms_are_equal_bytes():
    from dhkit.viewer.protocol import encode_scene

    arm = library_robot("ur5")
    assert encode_scene(build_scene(arm, link_parts(arm))) == encode_scene(
        build_scene(arm, link_parts(arm))
    )
