"""Laws of the parts that meshes, CAD imports and extracted tables are built from."""

import numpy as np
import pytest
from scipy.io import savemat

from dhkit.description import Convention, from_dh, library_robot, world_to_frames
from dhkit.errors import ModelError
from dhkit.expressions import PI
from dhkit.model.cad_masses import StatedMasses
from dhkit.model.cad_parts import CadPart, simplified
from dhkit.model.cad_units import Assembly, check_positions
from dhkit.model.closed_surface import is_closed, outwards, repaired, signed_volume
from dhkit.model.collada import collada_unit
from dhkit.model.extraction.axes import angle_about, nearest_points
from dhkit.model.extraction.draft import Rounding, allowed_name
from dhkit.model.extraction.ends import frame, screw
from dhkit.model.extraction.extraction import extract_dh
from dhkit.model.extraction.table import chain_axes, nearly_parallel, tidiest_table
from dhkit.model.mat_parts import mat_parts
from dhkit.model.mesh_paths import MeshFinder
from dhkit.model.polygons import triangles_of
from dhkit.model.shells import Shells
from dhkit.model.solidworks_report import read_solidworks_report
from dhkit.model.triangle_mesh import (
    TriangleMesh,
    area_vectors,
    common_bounds,
    joined_meshes,
    unit_normals,
)
from dhkit.model.urdf_tree import ElementName, JointKind, UrdfWarning
from mesh_shapes import box

ROUNDING = 1e-12  # a few operations on numbers of size 1


def test_a_concave_polygon_keeps_its_area():
    ring = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]], dtype=float)
    triangles = triangles_of(ring, np.arange(5), np.array([5]))
    areas = area_vectors(ring[triangles])[:, 2] / 2
    assert (areas > 0).all() and areas.sum() == pytest.approx(10, abs=ROUNDING)
    assert np.allclose(unit_normals(ring[triangles]), (0, 0, 1))


def test_a_surface_is_repaired_and_its_shells_are_turned():
    outer, inner = box(2.0), box(1.0)
    faces = outer.faces.copy()
    faces[::3] = faces[::3, ::-1]
    surface = repaired(TriangleMesh(outer.vertices, faces))
    assert surface.is_closed and is_closed(surface.mesh) and not surface.is_filled
    assert abs(signed_volume(surface.mesh)) == pytest.approx(8)
    mesh, _ = outwards(joined_meshes([outer, inner.turned()]))
    shells = Shells(mesh)
    assert sorted(shells.volume.tolist()) == pytest.approx([-1, 8])
    low, high = common_bounds([outer, inner])
    assert np.array_equal([low, high], outer.bounds)


def test_nearest_points_are_joined_by_the_common_normal():
    z, z_other = np.array([0.0, 0, 1]), np.array([0.0, 0.6, 0.8])
    start, end = nearest_points(np.array([1.0, 2, 3]), z, np.array([-1.0, 5, 2]), z_other)
    assert (end - start) @ z == pytest.approx(0, abs=ROUNDING) == (end - start) @ z_other
    assert angle_about(np.array([1.0, 0, 0]), z, z_other) == pytest.approx(-np.arctan2(0.6, 0.8))


def test_a_screw_moves_along_the_axis_about_which_it_rotates():
    T = screw(2, np.pi / 3, 0.5)
    assert np.allclose(T, frame(T[:3, 0], T[:3, 2], T[:3, 3]), atol=ROUNDING)
    assert np.allclose(screw(2, 0.2, 0.1) @ screw(2, np.pi / 3 - 0.2, 0.4), T, atol=ROUNDING)


@pytest.mark.parametrize("convention", Convention)
def test_a_table_is_found_through_its_own_axes(convention):
    arm = from_dh(
        [(0, 0.4, 0, "pi/2"), (0, 0, 0.3, 0), (0, 0, 0.2, 0)], convention=convention.value
    )
    frames = world_to_frames(arm, np.zeros(3))
    carried = frames[:-1] if convention is Convention.STANDARD else frames[1:]
    axes = chain_axes(carried, carried[:, :3, 2], [False] * 3, frames[-1])
    assert nearly_parallel(axes) == []
    table = tidiest_table(axes, convention)
    given = [arm.numbers.theta, arm.numbers.d, arm.numbers.a, arm.numbers.alpha]
    assert np.count_nonzero(np.round(table.rows, 9)) <= np.count_nonzero(given)


def test_numbers_and_names_fit_into_a_robot_file():
    assert Rounding(9).angle(1.5707963268) == PI / 2
    assert allowed_name("3 axes/arm", "robot") == "robot_3_axes_arm"


def test_elements_of_a_urdf_are_named_in_warnings(tmp_path):
    assert (
        str(UrdfWarning(ElementName("joint", "elbow"), ": no limits")) == "joint 'elbow': no limits"
    )
    assert f"{JointKind.PLANAR}" == "planar"
    with pytest.raises(ModelError, match="absolute path"):
        MeshFinder(tmp_path / "a.urdf").path("/etc/passwd")
    with pytest.raises(ModelError, match="convention is"):
        extract_dh(tmp_path / "a.urdf", convention="other")


def test_an_assembly_is_measured_in_the_pose_of_its_export():
    puma = library_robot("puma560")
    assembly = Assembly(puma, world_to_frames(puma, np.zeros(6)), {0: [box(2.0)]}, "folder")
    assert assembly.size == pytest.approx(2 * np.sqrt(3))
    assert assembly.axis_distances(1.0)[1, 0] == pytest.approx(0, abs=ROUNDING)
    with pytest.raises(ModelError, match="positive space"):
        check_positions(
            {name: TriangleMesh(box(1.0).vertices + 0.5, box(1.0).faces) for name in "ab"}, "folder"
        )
    assert CadPart("a", box(1.0)).in_metres("mm", "m").size == pytest.approx(1e-3 * np.sqrt(3))
    assert simplified(box(1.0), 1000, "box").faces is not None
    assert "g/cm^3" in StatedMasses.of(6, 2.7, None, ()).notes[0]


def test_parts_of_an_array_of_structs_are_numbered_by_their_place(tmp_path):
    fields = [("F1", object), ("V1", object), ("F2", object), ("V2", object)]
    part = (np.array([[1.0, 2, 3]]), np.eye(3))
    savemat(tmp_path / "one.mat", {"s": np.array([part, part], dtype=fields[:2])})
    savemat(tmp_path / "two.mat", {"s": np.array([part * 2, part * 2], dtype=fields)})
    assert list(mat_parts(tmp_path / "one.mat")) == ["s1", "s2"]
    assert list(mat_parts(tmp_path / "two.mat")) == ["s1_1", "s1_2", "s2_1", "s2_2"]


def test_other_files_are_refused(tmp_path):
    assert collada_unit(b'<COLLADA><asset><unit meter="0.01"/></asset></COLLADA>') == 0.01
    with pytest.raises(ModelError, match="no such file"):
        mat_parts(tmp_path / "a.mat")
    with pytest.raises(ModelError, match=r"expected a line 'Mass = ... grams'"):
        read_solidworks_report("Mass properties of a", "file")
