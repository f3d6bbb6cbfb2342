"""Inertia from shape: closed forms, invariance, hollow, inverted, open and hopeless meshes."""

import time

import numpy as np
import pytest
from hypothesis import given, strategies as st

from acceptance import slow_if
from dhkit.errors import ModelError
from dhkit.model.shape_inertia import InertiaMethod, convex_hull, shape_inertia
from dhkit.model.triangle_mesh import TriangleMesh, joined_meshes
from mesh_shapes import box, pose, prism, sphere

EXACT = 1e-14
"""Relative: a box of twelve triangles, whose integrals are exact up to rounding."""
INVARIANT = 1e-12
"""Relative: rounding where a mesh is turned and moved by a few of its sizes."""
DISCRETE = 0.02
"""Relative: what a polyhedron of 48 sides lacks of its ball or cylinder, (pi/48)^2 times a few."""


def moments(mass, size):
    x, y, z = np.array(size) ** 2
    return mass / 12 * np.diag([y + z, x + z, x + y])


@given(
    st.tuples(*[st.floats(0.05, 3.0)] * 3),
    st.floats(0.5, 9000.0),
    st.tuples(*[st.floats(-5, 5)] * 3),
)
def test_a_box_is_exact(size, density, centre):
    found = shape_inertia(box(size, centre), density=density)
    mass = density * np.prod(size)
    reach = np.linalg.norm(size) + np.linalg.norm(centre)
    assert found.method is InertiaMethod.CLOSED and found.notes == ()
    assert found.mass == pytest.approx(mass, rel=100 * EXACT * reach / min(size))
    assert np.abs(found.com - centre).max() <= 100 * EXACT * reach
    assert np.abs(found.inertia - moments(mass, size)).max() <= 1e3 * EXACT * mass * reach**2


def test_balls_and_cylinders_are_right_to_their_meshes():
    ball = shape_inertia(sphere(), density=1.0)
    assert ball.volume == pytest.approx(4 / 3 * np.pi, rel=DISCRETE)
    assert ball.inertia == pytest.approx(0.4 * ball.mass * np.eye(3), rel=DISCRETE, abs=1e-12)
    n, r, h = 96, 0.7, 1.3
    found = shape_inertia(prism(n, r, h), density=2.0)
    area = n / 2 * r**2 * np.sin(2 * np.pi / n)
    # Of a regular polygon with n corners.
    about_axis = found.mass * r**2 / 6 * (2 + np.cos(2 * np.pi / n))
    assert found.mass == pytest.approx(2 * area * h, rel=EXACT * 10)
    assert found.inertia[2, 2] == pytest.approx(about_axis, rel=1e-13)
    assert found.inertia[0, 0] == pytest.approx(about_axis / 2 + found.mass * h**2 / 12, rel=1e-13)


def test_it_turns_moves_and_grows_with_the_mesh(law):
    rng = np.random.default_rng(2)
    for _ in range(law.samples(1000)):
        mesh, T, scale = (
            TriangleMesh(sphere(6, 8).vertices * rng.uniform(0.2, 2, 3), sphere(6, 8).faces),
            pose(rng),
            10 ** rng.uniform(-9, 6),
        )
        one, other = (
            shape_inertia(mesh, density=1.0).moved(T),
            shape_inertia(mesh.moved(T), density=1.0),
        )
        law.holds("centre of mass, m", np.abs(one.com - other.com).max(), INVARIANT)
        law.holds(
            "inertia, relative",
            np.abs(one.inertia - other.inertia).max() / np.abs(one.inertia).max(),
            INVARIANT,
        )
        grown = shape_inertia(mesh.scaled(scale), density=1.0)
        plain = shape_inertia(mesh, density=1.0)
        law.holds("scaled mass, relative", abs(grown.mass / plain.mass / scale**3 - 1), INVARIANT)
        law.holds(
            "scaled inertia, relative",
            np.abs(grown.inertia / scale**5 - plain.inertia).max() / plain.mass,
            INVARIANT,
        )


def test_a_mirrored_mesh_is_a_mirrored_body():
    mesh = box((1, 2, 3), (0.3, 0.4, 0.5)).moved(pose(np.random.default_rng(0)))
    mirror = np.diag([1.0, -1.0, 1.0])
    plain, mirrored = (
        shape_inertia(mesh, mass=2.0),
        shape_inertia(mesh.scaled([1, -1, 1]), mass=2.0),
    )
    assert mirrored.notes == ()
    assert mirrored.com == pytest.approx(mirror @ plain.com, abs=INVARIANT)
    assert mirrored.inertia == pytest.approx(mirror @ plain.inertia @ mirror, abs=INVARIANT)


def test_a_hollow_link_stays_hollow():
    outer, inner = box((2, 2, 2)), box((1, 1, 1), (0.2, 0, 0))
    hollow = joined_meshes([outer, inner.turned()])
    expected = moments(8, (2, 2, 2)) - moments(1, (1, 1, 1))
    com = np.array([-0.2 / 7, 0, 0])
    lever = np.diag([0, 1, 1]) * (8 * com[0] ** 2 - (0.2 - com[0]) ** 2)
    rng = np.random.default_rng(5)
    broken = hollow.faces.copy()
    turned = rng.permutation(len(broken))[:7]
    broken[turned] = broken[turned, ::-1]
    for mesh in (hollow, hollow.turned(), TriangleMesh(hollow.vertices, broken)):
        found = shape_inertia(mesh, density=1.0)
        assert found.mass == pytest.approx(7.0, rel=1e-13)
        assert found.com == pytest.approx(com, abs=1e-13)
        assert found.inertia == pytest.approx(expected + lever, abs=1e-12)
        assert any("1 cavity" in note for note in found.notes)


def test_inverted_and_mixed_faces_are_turned_and_it_is_said():
    inverted = shape_inertia(box().turned(), density=1.0)
    assert inverted.mass == pytest.approx(6.0) and "inside out" in inverted.notes[0]
    faces = box().faces.copy()
    faces[4] = faces[4, ::-1]
    mixed = shape_inertia(TriangleMesh(box().vertices, faces), density=1.0)
    assert mixed.mass == pytest.approx(6.0) and "1 triangles were turned" in mixed.notes[0]
    beside = joined_meshes([box(), box((1, 1, 1), (9, 0, 0)).turned()])
    two = shape_inertia(beside, density=1.0)
    assert two.mass == pytest.approx(7.0) and "1 of 2 shells were inside out" in two.notes[0]
    doubled = shape_inertia(joined_meshes([box(), box((0.5, 0.5, 0.5))]), density=1.0)
    assert doubled.mass == pytest.approx(6.125) and "counts twice" in doubled.notes[0]
    crossed = shape_inertia(joined_meshes([box(), prism(24, 0.2, 6.0)]), density=1.0)
    assert "reach into others" in crossed.notes[0]
    apart = shape_inertia(joined_meshes([box(), box(centre=(1, 0, 0))]), density=1.0)
    assert apart.notes == () and apart.mass == pytest.approx(12.0)


def bars():
    """Two bars of volume 0.1 that cross in a cube of volume 0.001, no corner of one inside the other."""
    return box((10.0, 0.1, 0.1)), box((0.1, 10.0, 0.1))


def test_shells_that_share_volume_are_warned_of_with_its_share():
    one, other = bars()
    for scale in (1e-3, 1.0):
        for found in (joined_meshes([one, other]), [one, other]):
            meshes = [found] if isinstance(found, TriangleMesh) else found
            crossed = shape_inertia([mesh.scaled(scale) for mesh in meshes], density=1.0)
            assert len(crossed.notes) == 1
            assert "where the material counts twice (0.5 % of the volume)" in crossed.notes[0]
    raised = other.moved(
        np.block([[np.eye(3), np.array([[0], [0], [0.1]])], [np.zeros(3), np.ones(1)]])
    )
    assert shape_inertia([one, raised], density=1.0).notes == ()  # they touch


def test_parts_of_one_body_are_judged_together():
    twice = shape_inertia([box(), box()], density=1.0)
    assert (
        twice.mass == pytest.approx(12.0)
        and "2 of 2 shells" in twice.notes[0]
        and "50 %" in twice.notes[0]
    )
    end = shape_inertia([box((4, 1, 1)), box((1, 1, 1), (2, 0.3, 0))], density=1.0)
    assert "counts twice" in end.notes[0]
    within = shape_inertia([box((0.2, 0.2, 0.2)), box()], density=1.0)
    assert "1 of 2 shells" in within.notes[0]
    hollow = shape_inertia([box((2, 2, 2)), box((1, 1, 1)).turned()], density=1.0)
    assert hollow.mass == pytest.approx(7.0) and hollow.notes == ("1 cavity inside",)
    beside = shape_inertia([box(), box((1, 1, 1), (9, 0, 0)).turned()], density=1.0)
    assert beside.mass == pytest.approx(7.0) and "1 of 2 shells were inside out" in beside.notes[0]
    bowl = TriangleMesh(box().vertices, box().faces[2:])
    mixed = shape_inertia([bowl, box(centre=(5, 0, 0))], density=1.0)
    assert mixed.method is InertiaMethod.HULL and mixed.mass == pytest.approx(12.0)


def test_triangles_written_twice_count_once():
    mesh = box()
    rng = np.random.default_rng(1)
    doubled = np.concatenate([mesh.faces, np.roll(mesh.faces, 1, axis=1)])[rng.permutation(24)]
    both_ways = np.concatenate([mesh.faces, mesh.faces[:, ::-1]])
    one_more = np.concatenate([mesh.faces, mesh.faces[3:4]])
    one_back = np.concatenate([mesh.faces, mesh.faces[3:4, ::-1]])
    for faces, dropped in ((doubled, 12), (both_ways, 12), (one_more, 1), (one_back, 1)):
        for made in (
            TriangleMesh(mesh.vertices, faces),
            TriangleMesh.of_corners(mesh.vertices[faces]),
        ):
            found = shape_inertia(made, density=1.0)
            assert found.method is InertiaMethod.CLOSED and found.mass == pytest.approx(6.0)
            assert (
                f"{dropped} triangle" in found.notes[0]
                and "written more than once" in found.notes[0]
            )


def test_cavities_that_touch_stay_and_one_that_reaches_out_is_warned_of():
    block = box((6, 6, 6))
    first, second = box((1, 1, 1), (-0.5, 0, 0)).turned(), box((1, 1, 1), (0.5, 0, 0)).turned()
    for cavities in (
        (first, second),
        (second, first),
        (first.scaled(1.0), box((1, 2, 1), (0.5, 0, 0)).turned()),
    ):
        found = shape_inertia(joined_meshes([block, *cavities]), density=1.0)
        lacking = sum(abs(shape_inertia(cavity, density=1.0).volume) for cavity in cavities)
        assert found.mass == pytest.approx(216 - lacking) and found.notes == ("2 cavities inside",)
    poking = shape_inertia(
        joined_meshes([block, box((1, 1, 1), (2.9, 0, 0)).turned()]), density=1.0
    )
    assert (
        poking.notes[0] == "1 cavity inside"
        and "a cavity reaches out of the material" in poking.notes[1]
    )
    island = shape_inertia(
        joined_meshes([block, box((4, 4, 4)).turned(), box((2, 2, 2))]), density=1.0
    )
    assert island.mass == pytest.approx(216 - 64 + 8) and island.notes == ("1 cavity inside",)
    touching = shape_inertia(
        joined_meshes([block, box((2, 2, 2), (4, 0, 0)).turned()]), density=1.0
    )
    assert (
        touching.mass == pytest.approx(224) and "1 of 2 shells were inside out" in touching.notes[0]
    )


def test_only_a_mesh_that_is_turned_as_a_whole_is_called_inside_out():
    large, small = box((2, 2, 2)).turned(), box((1, 1, 1), (9, 0, 0))
    found = shape_inertia(joined_meshes([large, small]), density=1.0)
    assert found.mass == pytest.approx(9.0) and found.notes == (
        "1 of 2 shells were inside out and were turned",
    )
    three = shape_inertia(
        joined_meshes([box(), small.turned(), box((0.5, 0.5, 0.5), (9, 0, 0))]), density=1.0
    )
    assert (
        "1 of 3 shells were inside out" in three.notes[0]
        and "1 of 3 shells lie in" in three.notes[1]
    )
    both = shape_inertia(joined_meshes([large, small.turned()]), density=1.0)
    assert both.notes == ("inside out: all triangles were turned",)


@pytest.mark.parametrize(
    "place", [lambda k: (2 * k, 0, 0), slow_if(True, lambda k: (0.8 * k, 0.8 * k, 0.8 * k))]
)
def test_hundreds_of_shells_take_little_time(place, law):
    balls = joined_meshes([sphere(12, 16, 0.6).moved(shifted(place(k))) for k in range(250)])
    start = time.process_time()
    found = shape_inertia(balls, density=1.0)
    law.takes("250 shells, s", time.process_time() - start, 2)
    assert found.notes == () and found.mass == pytest.approx(
        250 * shape_inertia(sphere(12, 16, 0.6), density=1.0).mass
    )


def shifted(centre):
    T = np.eye(4)
    T[:3, 3] = centre
    return T


def test_open_meshes_are_capped_or_judged_by_their_hull():
    whole = sphere(40, 80)
    pinhole = TriangleMesh(whole.vertices, whole.faces[:-4])
    capped = shape_inertia(pinhole, density=1.0)
    assert capped.method is InertiaMethod.FILLED and "capped" in capped.notes[0]
    assert capped.mass == pytest.approx(shape_inertia(whole, density=1.0).mass, rel=1e-3)
    bowl = TriangleMesh(box().vertices, box().faces[2:])
    hull = shape_inertia(bowl, density=1.0)
    assert hull.method is InertiaMethod.HULL and "hull" in hull.notes[0]
    assert hull.mass == pytest.approx(6.0)


def test_corners_that_files_round_each_by_itself_are_joined():
    soup = box().corners + np.random.default_rng(0).uniform(-1e-8, 1e-8, (12, 3, 3))
    found = shape_inertia(TriangleMesh.of_corners(soup), density=1.0)
    assert found.method is InertiaMethod.CLOSED and "joined" in found.notes[0]
    assert found.mass == pytest.approx(6.0, rel=1e-5)


@pytest.mark.parametrize(
    ("stated", "complaint"),
    [
        ({}, "neither of density and mass"),
        ({"density": 1.0, "mass": 1.0}, "both of density and mass"),
        ({"density": 0.0}, "density is 0"),
        ({"mass": -1.0}, "mass is -1"),
        ({"mass": float("nan")}, "mass is nan"),
    ],
)
def test_nothing_is_assumed(stated, complaint):
    with pytest.raises(ModelError, match=complaint):
        shape_inertia(box(), **stated)


@pytest.mark.parametrize(
    "mesh",
    [
        box().scaled([1, 1, 0]),
        TriangleMesh(np.zeros((3, 3)), np.array([[0, 1, 2]])),
        TriangleMesh(np.eye(3), np.array([[0, 1, 2]])),
        joined_meshes(
            [
                TriangleMesh(np.eye(3), np.array([[0, 1, 2]])),
                TriangleMesh(np.eye(3), np.array([[0, 2, 1]])),
            ]
        ),
    ],
)
def test_what_has_no_volume_is_refused(mesh):
    with pytest.raises(ModelError, match="encloses no volume"):
        shape_inertia(mesh, mass=1.0)


def test_a_body_reads_back():
    found = shape_inertia(box((0.1, 0.2, 0.3), (0.01, 0, 0)), density=2700.0)
    body = found.body("beam")
    assert float(body.mass) == found.mass and body.name == "beam"
    assert np.array([[float(x) for x in row] for row in body.inertia.rows]) == pytest.approx(
        found.inertia
    )


def test_a_hull_is_closed_and_outwards():
    hull = convex_hull(joined_meshes([box(), box((1, 1, 1), (5, 0, 0))]))
    found = shape_inertia(hull, density=1.0)
    assert found.method is InertiaMethod.CLOSED and found.notes == ()


def test_walls_that_two_bodies_share_are_no_duplicates():
    """A block with a pinhole, and half a block inside it: both have the wall x = 0, with the same triangles."""
    import trimesh

    def block(width):
        solid = trimesh.creation.box((width, 60, 100))
        solid.apply_translation((width / 2, 0, 0))
        return solid.subdivide().subdivide().subdivide()

    whole, half = block(80), block(40)
    top = int(np.argmax(whole.triangles_center[:, 0]))
    faces = np.vstack([np.delete(whole.faces, top, axis=0), half.faces + len(whole.vertices)])
    found = shape_inertia(
        TriangleMesh(np.vstack([whole.vertices, half.vertices]), faces), density=1.0
    )
    assert found.method is InertiaMethod.FILLED
    assert found.volume == pytest.approx(480_000 + 240_000, rel=0.01)


def test_a_surface_that_is_written_in_two_tessellations_warns():
    """The same cube twice, with the other diagonals of its faces: one shell that encloses twice."""
    cube = box((1, 1, 1))
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    other = np.array([t for a, b, c, d in quads for t in ((a, b, d), (b, c, d))])
    assert shape_inertia(TriangleMesh(cube.vertices, other), density=1.0).mass == pytest.approx(1.0)
    doubled = shape_inertia(
        TriangleMesh(cube.vertices, np.concatenate([cube.faces, other])), density=1.0
    )
    assert any("counts twice" in note for note in doubled.notes)
