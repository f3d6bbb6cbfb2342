"""Laws of the PUMA 560's link meshes, which tools/puma560_meshes.py draws."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from tools.puma560_meshes import puma560_meshes, write_puma560_meshes

CHECKED_IN = Path(__file__).parents[2] / "meshes" / "puma560"
MAX_BYTES = 50_000  # a browser loads seven such files at once
MICROMETRE = 1e-6  # coordinates are rounded to it
OFF_AXIS = 5e-4  # m: facets make a pin's centroid miss its axis, a misplaced pin misses by more
CRUMB = 1e-9  # m^3: 1 mm^3, less than any pin and more than the Booleans' rounding

STANDARD_DH = [  # d, a [m], alpha [deg]: Corke & Armstrong-Helouvry 1994, frame 0 on the floor
    (0.67183, 0.0, 90),
    (0.0, 0.4318, 0),
    (0.15005, 0.0203, -90),
    (0.4318, 0.0, 90),
    (0.0, 0.0, -90),
    (0.0, 0.0, 0),
]
POSES = {
    "zero": (0, 0, 0, 0, 0, 0),
    "ready": (0, 90, -90, 0, 0, 0),
    "nominal": (0, 45, 180, 0, 45, 0),
}
CENTRES_OF_MASS = {  # m, link frames: Corke & Armstrong-Helouvry 1994; none is published for link 1
    "upper_arm": (-0.3638, 0.006, 0.2275),
    "forearm": (-0.0203, -0.0141, 0.070),
    "wrist_roll": (0.0, 0.019, 0.0),
    "wrist_pitch": (0.0, 0.0, 0.0),
    "flange": (0.0, 0.0, 0.032),
}

MESHES = puma560_meshes()
NAMES = list(MESHES)


def link_frames(joint_angles) -> list[np.ndarray]:
    """T_world_link of links 0 to 6, angles in deg."""
    frames = [np.eye(4)]
    for theta, (d, a, alpha) in zip(np.radians(joint_angles), STANDARD_DH, strict=True):
        about_z = trimesh.transformations.rotation_matrix(theta, [0, 0, 1])
        about_x = trimesh.transformations.rotation_matrix(np.radians(alpha), [1, 0, 0])
        move = trimesh.transformations.translation_matrix([a, 0, d])
        frames.append(frames[-1] @ about_z @ move @ about_x)
    return frames


def posed(joint_angles) -> list[trimesh.Trimesh]:
    """The links in the world."""
    frames = link_frames(joint_angles)
    return [mesh.copy().apply_transform(T) for mesh, T in zip(MESHES.values(), frames, strict=True)]


def overlap(one: trimesh.Trimesh, other: trimesh.Trimesh) -> trimesh.Trimesh:
    """The solid that two links share."""
    return trimesh.boolean.intersection([one, other], engine="manifold")


def test_links_are_named_from_the_base_to_the_flange():
    assert NAMES == [
        "base",
        "shoulder",
        "upper_arm",
        "forearm",
        "wrist_roll",
        "wrist_pitch",
        "flange",
    ]


@pytest.mark.parametrize("name", NAMES)
def test_a_link_is_one_closed_solid(name):
    mesh = MESHES[name]
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.body_count == 1


@pytest.mark.parametrize("name", NAMES)
def test_vertices_are_distinct_whole_micrometres(name):
    vertices = MESHES[name].vertices
    assert np.abs(vertices / MICROMETRE - np.round(vertices / MICROMETRE)).max() < MICROMETRE
    assert len(np.unique(vertices, axis=0)) == len(vertices)


def test_files_are_small_binary_stl_and_read_back_the_same(tmp_path):
    paths = write_puma560_meshes(tmp_path / "new" / "puma560")
    assert [path.stem for path in paths] == NAMES
    assert sorted(paths) == sorted((tmp_path / "new" / "puma560").iterdir())
    for path in paths:
        content = path.read_bytes()
        assert len(content) < MAX_BYTES
        assert not content.startswith(b"solid")
        mesh = trimesh.load_mesh(path)
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(MESHES[path.stem].volume, rel=MICROMETRE)


def test_two_runs_and_the_checked_in_files_agree_to_the_byte(tmp_path):
    one, other = write_puma560_meshes(tmp_path / "one"), write_puma560_meshes(tmp_path / "other")
    for first, second in zip(one, other, strict=True):
        assert first.read_bytes() == second.read_bytes() == (CHECKED_IN / first.name).read_bytes()


def test_the_ready_arm_stands_as_high_as_its_table_says():
    top = max(mesh.bounds[1, 2] for mesh in posed(POSES["ready"]))
    assert top == pytest.approx(0.67183 + 0.4318 + 0.4318 + 0.05625, abs=MICROMETRE)


@pytest.mark.parametrize("pose", POSES)
def test_the_arm_stands_on_the_floor(pose):
    assert min(mesh.bounds[0, 2] for mesh in posed(POSES[pose])) == 0.0


@pytest.mark.parametrize("joint", range(1, 7))
@pytest.mark.parametrize("pose", POSES)
def test_neighbours_meet_on_their_joint_axis(pose, joint):
    links, frames = posed(POSES[pose]), link_frames(POSES[pose])
    pin = overlap(links[joint - 1], links[joint])
    assert pin.volume > CRUMB
    in_joint = np.linalg.inv(frames[joint - 1]) @ [*pin.center_mass, 1]
    assert np.hypot(in_joint[0], in_joint[1]) < OFF_AXIS


@pytest.mark.parametrize("pose", POSES)
def test_links_that_are_not_neighbours_stay_apart(pose):
    links = posed(POSES[pose])
    for i, one in enumerate(links):
        for other in links[i + 2 :]:
            assert overlap(one, other).is_empty


@pytest.mark.parametrize("name", CENTRES_OF_MASS)
def test_published_centres_of_mass_lie_in_their_links_box(name):
    low, high = MESHES[name].bounds
    assert np.all(low <= CENTRES_OF_MASS[name]) and np.all(CENTRES_OF_MASS[name] <= high)


def test_the_wrist_centre_lies_on_the_forearms_axis():
    low, high = MESHES["wrist_roll"].bounds
    assert (low + high)[[0, 2]] == pytest.approx(0.0, abs=MICROMETRE)
    outlet = MESHES["forearm"].slice_plane([0, 0, 0.325], [0, 0, 1], cap=False).bounds
    assert outlet.mean(axis=0)[:2] == pytest.approx(0.0, abs=MICROMETRE)
