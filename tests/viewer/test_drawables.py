"""Facts of drawn objects: sizes, files, and messages about files that cannot be read."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.description import Capsule, Mesh, Sphere, library_robot
from dhkit.errors import ModelError
from dhkit.expressions import exact
from dhkit.model.mesh_reader import read_mesh
from dhkit.model.shapes import Part, link_parts
from dhkit.model.stl import binary_stl
from dhkit.viewer.drawables import grid_object, grid_step, part_object, part_transform, triad_object

FLOAT32 = 1e-6


def points(drawn):
    attribute = drawn["geometries"][0]["data"]["attributes"]["position"]
    return np.frombuffer(attribute["array"].data, dtype="<f4").reshape(-1, attribute["itemSize"])


@given(st.floats(1e-3, 1e3))
def test_a_grid_has_a_handful_of_round_steps(size):
    step = grid_step(size)
    assert 3 <= size / step <= 12
    mantissa = step / 10.0 ** np.floor(np.log10(step) + 1e-9)
    assert min(abs(mantissa - digit) for digit in (1, 2, 5)) < 1e-6


@given(st.floats(0.05, 20.0))
def test_a_grid_lies_on_the_floor_and_reaches_beyond_the_arm(size):
    grid = points(grid_object(size, "grid"))
    assert np.all(grid[:, 2] == 0)
    assert np.abs(grid).max() >= 1.3 * size * (1 - FLOAT32)


def test_a_triad_has_its_arrows_along_the_axes():
    triad = points(triad_object(0.2, "triad"))
    assert np.allclose(triad.max(axis=0), 0.2, rtol=FLOAT32)
    colors = triad_object(0.2, "triad")["geometries"][0]["data"]["attributes"]["color"]
    rgb = np.frombuffer(colors["array"].data, dtype="<f4").reshape(-1, 3)
    for axis in range(3):  # red is x, green is y, blue is z
        assert rgb[np.argmax(triad[:, axis])].argmax() == axis


@given(st.floats(0.01, 2.0), st.floats(0.0, 2.0))
def test_a_capsule_and_a_ball_have_their_sizes(radius, length):
    for geometry, tip in (
        (Sphere(exact(radius)), radius),
        (Capsule(exact(radius), exact(length)), radius + length / 2),
    ):
        outline = part_object(Part(0, geometry, np.eye(4), "#123456"), "x")["geometries"][0][
            "points"
        ]
        assert max(point["x"] for point in outline) == pytest.approx(radius, rel=1e-12)
        assert max(point["y"] for point in outline) == pytest.approx(tip, rel=1e-12)
        assert outline[0]["x"] == pytest.approx(0, abs=1e-12 * radius)
        assert outline[-1]["x"] == pytest.approx(0, abs=1e-12 * radius)


def test_a_mesh_is_its_file_and_keeps_its_scale():
    part = next(
        part for part in link_parts(library_robot("puma560")) if isinstance(part.geometry, Mesh)
    )
    lowered = part_object(part, "x")["geometries"][0]
    assert lowered["format"] == "stl"
    assert lowered["data"].data == part.file.read_bytes()
    in_mm = replace(part, geometry=Mesh(part.geometry.path, (exact(0.001),) * 3))
    assert np.array_equal(part_transform(in_mm)[:3, :3], 0.001 * part.T_link_part[:3, :3])


def test_a_mirrored_mesh_is_drawn_mirrored_and_other_formats_as_stl(tmp_path):
    (tmp_path / "a.obj").write_text("v 1 2 3\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scale = (exact(1), exact(-2), exact(0.5))
    part = Part(1, Mesh("a.obj", scale), np.eye(4), "#123456", tmp_path / "a.obj")
    assert np.array_equal(part_transform(part), np.diag([1, -2, 0.5, 1]))
    lowered = part_object(part, "x")["geometries"][0]
    assert lowered["format"] == "stl"
    assert lowered["data"].data == binary_stl("dhkit", read_mesh(tmp_path / "a.obj").corners)


@pytest.mark.parametrize(
    ("file", "complaint"),
    [
        (None, r"link 3: mesh 'arm.stl' has no folder"),
        ("gone.stl", r"link 3: mesh .*gone.stl: No such file"),
        ("arm.step", r"link 3: mesh .*arm.step: No such file"),
    ],
)
def test_a_mesh_that_cannot_be_read_is_named(tmp_path, file, complaint):
    part = Part(3, Mesh("arm.stl"), np.eye(4), "#123456", file and tmp_path / file)
    with pytest.raises(ModelError, match=complaint):
        part_object(part, "x")
