"""Every format reads as the same triangles; units, up axes, colours and mirrors are those of the file and the scale."""

import numpy as np
import pytest
import trimesh

from dhkit.description import Mesh
from dhkit.description.mesh_files import check_mesh_file
from dhkit.errors import ModelError
from dhkit.expressions import exact
from dhkit.model.mesh_reader import read_mesh, read_part
from dhkit.model.shape_inertia import shape_inertia
from dhkit.model.shapes import Part
from dhkit.model.stl import ascii_stl, binary_stl
from dhkit.model.triangle_mesh import TriangleMesh, joined_meshes, same_vertices
from mesh_shapes import box, dae, ply, pose

SINGLE = 1e-6
"""Relative: a binary STL has single precision."""


def sorted_corners(mesh):
    corners = mesh.corners.reshape(-1, 9)
    return corners[np.lexsort(np.round(corners, 4).T)]


def obj(mesh):
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    return "\n".join([*rows, *(f"f {a + 1}//1 {b + 1} {c + 1}/2/3" for a, b, c in mesh.faces)])


def test_all_formats_give_the_same_triangles(tmp_path):
    mesh = box().moved(pose(np.random.default_rng(1)))
    files = {
        "binary.stl": binary_stl("solid thing", mesh.corners),
        "text.STL": ascii_stl("thing", mesh.corners).encode(),
        "a.obj": obj(mesh).encode(),
        "a.ply": trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(file_type="ply"),
        "a.dae": dae(
            " ".join(f"{x:.9g}" for x in mesh.vertices.ravel()),
            " ".join(map(str, mesh.faces.ravel())),
        ).encode(),
    }
    formats = ["stl", "stl_ascii", "obj", "ply", "dae"]
    for (name, content), form in zip(files.items(), formats, strict=True):
        (tmp_path / name).write_bytes(content)
        assert check_mesh_file(tmp_path / name).format == form
        found = read_mesh(tmp_path / name)
        assert np.abs(sorted_corners(found) - sorted_corners(mesh)).max() < 10 * SINGLE


def test_a_binary_file_that_begins_with_solid_is_binary(tmp_path):
    (tmp_path / "a.stl").write_bytes(binary_stl("solid made by a CAD program", box().corners))
    header = check_mesh_file(tmp_path / "a.stl")
    assert (header.format, header.triangles) == ("stl", 12)


@pytest.mark.parametrize(
    ("unit", "up", "node", "expected"),
    [
        ("1", "Z_UP", "", (1, 2, 3)),
        ("0.001", "Z_UP", "", (0.001, 0.002, 0.003)),
        ("1", "Y_UP", "", (1, -3, 2)),
        ("1", "X_UP", "", (-2, -3, 1)),
        ("1", "Z_UP", "<translate>1 0 0</translate><scale>2 2 2</scale>", (3, 4, 6)),
        ("1", "Z_UP", "<rotate>0 0 1 90</rotate>", (-2, 1, 3)),
        ("1", "Z_UP", "<matrix>0 -1 0 5 1 0 0 0 0 0 1 0 0 0 0 1</matrix>", (3, 1, 3)),
    ],
)
def test_units_axes_and_nodes_of_collada_are_applied(tmp_path, unit, up, node, expected):
    path = tmp_path / "a.dae"
    path.write_text(dae("1 2 3 0 0 0 0 0 1", unit=unit, up=up, node=node))
    mesh = read_mesh(path)
    assert mesh.vertices[0] == pytest.approx(expected, abs=1e-12)
    assert mesh.colour == "#ff8000"


def test_polygons_of_obj_and_indices_from_the_end(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(
        "# a square\nmtllib ../../etc/passwd\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4 # all\nf -1 -2 -3\n"
    )
    assert read_mesh(path).faces.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 1]]


L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
"""Area 3; a fan about its fourth corner alone would cover it."""


def area(mesh):
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


@pytest.mark.parametrize("first", range(6))
def test_concave_polygons_keep_their_area_and_their_side(tmp_path, first):
    T = pose(np.random.default_rng(4))
    ring = np.roll(np.column_stack([L_SHAPE, np.zeros(6)]), -first, axis=0) @ T[:3, :3].T + T[:3, 3]
    square = np.array([(5, 5, 0), (6, 5, 0), (6, 6, 0), (5, 6, 0)])
    points = np.concatenate([ring, square])
    text = "".join(f"v {x:.15g} {y:.15g} {z:.15g}\n" for x, y, z in points)
    (tmp_path / "a.obj").write_text(text + "f 7 8 9 10\nf 1 2 3 4 5 6\n")
    listed = " ".join(f"{x:.15g}" for x in points.ravel())
    whole = dae(listed, "0 1 2")
    old = whole[whole.index("<triangles") : whole.index("</triangles>") + len("</triangles>")]
    vertex = '<input semantic="VERTEX" source="#v" offset="0"/>'
    lists = f'<polylist count="2" material="paint">{vertex}<vcount>4 6</vcount><p>6 7 8 9 0 1 2 3 4 5</p></polylist>'
    loose = (
        f'<polygons count="2" material="paint">{vertex}<p>6 7 8 9</p><p>0 1 2 3 4 5</p></polygons>'
    )
    (tmp_path / "a.dae").write_text(whole.replace(old, lists))
    (tmp_path / "b.dae").write_text(whole.replace(old, loose))
    for name in ("a.obj", "a.dae", "b.dae"):
        mesh = read_mesh(tmp_path / name)
        assert len(mesh.faces) == 6 and area(mesh) == pytest.approx(4.0)
        assert mesh.faces[:2].tolist() == [[6, 7, 8], [6, 8, 9]]
        a, b, c = np.moveaxis(mesh.corners[2:], 1, 0)
        assert (np.cross(b - a, c - a) @ T[:3, 2] > 0).all()


def test_a_path_may_be_a_string(tmp_path):
    (tmp_path / "a.stl").write_bytes(binary_stl("box", box().corners))
    assert len(read_mesh(str(tmp_path / "a.stl")).faces) == 12


def test_colours_of_ply_are_read(tmp_path):
    coloured = trimesh.Trimesh(box().vertices, box().faces, process=False)
    coloured.visual.face_colors = [255, 128, 0, 255]
    (tmp_path / "a.ply").write_bytes(coloured.export(file_type="ply"))
    assert read_mesh(tmp_path / "a.ply").colour == "#ff8000"
    (tmp_path / "b.ply").write_text(ply())
    assert read_mesh(tmp_path / "b.ply").colour is None


def test_a_mirrored_part_keeps_its_outside(tmp_path):
    (tmp_path / "a.stl").write_bytes(binary_stl("box", box((1, 2, 3), (1, 1, 1)).corners))
    scale = tuple(exact(x) for x in (0.001, -0.001, 0.002))
    mesh = read_part(Part(1, Mesh("a.stl", scale), np.eye(4), "#000000", tmp_path / "a.stl"))
    found = shape_inertia(mesh, density=1.0)
    assert found.notes == ()
    assert found.com == pytest.approx([0.001, -0.001, 0.002], abs=1e-9)


def test_equal_vertices_become_one_and_minus_zero_is_zero():
    rows = np.array([[0.0, 1, 2], [-0.0, 1, 2], [1, 0, 2], [0, 1, 2]])
    chosen, kinds = same_vertices(rows)
    assert len(chosen) == 2 and kinds[0] == kinds[1] == kinds[3] != kinds[2]
    soup = TriangleMesh.of_corners(box().corners)
    assert soup.merged().vertices.shape == (8, 3) and soup.merged().faces.shape == (12, 3)
    two = joined_meshes([box(), box(centre=(9, 0, 0))])
    assert two.faces.max() == 15 and two.size == pytest.approx(np.linalg.norm([10, 2, 3]))


def test_arrays_of_other_shapes_are_no_mesh():
    with pytest.raises(ValueError, match="vertices has shape"):
        TriangleMesh(np.zeros((3, 2)), np.zeros((1, 3), dtype=int))
    with pytest.raises(ValueError, match="colours has shape"):
        TriangleMesh(
            np.zeros((3, 3)), np.zeros((1, 3), dtype=int), np.zeros((2, 3), dtype=np.uint8)
        )


TRIANGLE = (
    "solid {name}\nfacet normal 0 0 1\n outer loop\n"
    " vertex {x} 0 0\n vertex 1 0 0\n vertex 0 1 0\n endloop\nendfacet\n"
)


@pytest.mark.parametrize("name", ["a", "vertex 1 2 3", "endfacet", "facet"])
@pytest.mark.parametrize("x", ["0.001", "1.000000000000000020816681711721685132943093776703e-03"])
def test_long_coordinates_and_keywords_in_the_name_of_a_text(tmp_path, name, x):
    file = tmp_path / "part.stl"
    file.write_text(TRIANGLE.format(name=name, x=x) + f"endsolid {name}\n")
    assert read_mesh(file).corners[0, 0, 0] == pytest.approx(0.001)


@pytest.mark.parametrize("x", ["1_0", "1" + "0" * 80])
def test_coordinates_that_are_no_numbers_are_refused(tmp_path, x):
    file = tmp_path / "part.stl"
    file.write_text(TRIANGLE.format(name="a", x=x) + "endsolid a\n")
    with pytest.raises(ModelError, match="expected a coordinate"):
        read_mesh(file)
