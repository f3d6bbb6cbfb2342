"""Distances between shapes of links, beside coal with poses of our own, and what of an arm nothing checks."""

import coal
import numpy as np
import pytest

import dhkit
from dhkit.description import Box, Capsule, Cylinder, Sphere, library_robot
from dhkit.description.table_rows import from_dh
from dhkit.model.mesh_reader import read_part
from dhkit.model.shapes import link_parts, links_without_shapes
from dhkit.planning.obstacles import LinkBody, distance, link_pairs, shape_distances
from dhkit.planning.obstacles.solids import distance_request, signed_distance

COAL = 1e-6
"""m: the default tolerance of coal's iterations, which the second way uses."""


def pinocchios_frames(arm, q):
    """Return the poses of the DH frames in the world by Pinocchio, shape (n + 1, 4, 4)."""
    model = arm.model
    data = model.createData()
    import pinocchio as pin

    pin.framesForwardKinematics(model, data, q)
    return [data.oMf[model.getFrameId(f"dh{i}")].homogeneous for i in range(arm.n + 1)]


def solid(part):
    match part.geometry:
        case Sphere(radius):
            return coal.Sphere(float(radius))
        case Capsule(radius, length):
            return coal.Capsule(float(radius), float(length))
        case Cylinder(radius, length):
            return coal.Cylinder(float(radius), float(length))
        case Box(size):
            return coal.Box(*map(float, size))
    points = coal.StdVec_Vec3s()
    points.extend(read_part(part).vertices)
    return coal.ConvexBase.convexHull(points, False, "")


@pytest.mark.parametrize(
    ("name", "links"), [("al5d", (0, 2)), ("stanford", (1, 3)), ("puma560", (0, 4))]
)
def test_shapes_are_as_far_apart_as_coal_says_at_pinocchios_poses(name, links):
    arm = dhkit.Arm.load(name)
    rng = np.random.default_rng(0)
    lower, upper = arm.limits.lower.clip(-np.pi), arm.limits.upper.clip(None, np.pi)
    q = rng.uniform(lower, upper, (20, arm.n))
    bodies = tuple(LinkBody(link) for link in links)
    found = shape_distances(arm.description, q, bodies)
    parts = link_parts(arm.description)
    for k, state in enumerate(q):
        frames, least = pinocchios_frames(arm, state), np.inf
        for first in (part for part in parts if part.link == links[0]):
            for second in (part for part in parts if part.link == links[1]):
                T1, T2 = (frames[part.link] @ part.T_link_part for part in (first, second))
                places = [coal.Transform3s(T[:3, :3].copy(), T[:3, 3].copy()) for T in (T1, T2)]
                request, result = coal.DistanceRequest(), coal.DistanceResult()
                least = min(
                    least,
                    coal.distance(
                        solid(first), places[0], solid(second), places[1], request, result
                    ),
                )
        if least > -1e-3:  # depths are measured less exactly
            assert found[k] == pytest.approx(least, abs=COAL)
        else:
            assert found[k] < 0


def test_a_depth_that_coal_does_not_find_is_a_penetration():
    """al5d's base and upper arm are so placed at times."""
    arm = library_robot("al5d")
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (200, 4))
    found = shape_distances(arm, q, (LinkBody(0), LinkBody(2)))
    assert np.isfinite(found).all() and found.min() > -1.0
    one = coal.Cylinder(0.1, 0.2)
    place = coal.Transform3s()
    same = signed_distance(
        coal, one, place, coal.Cylinder(0.1, 0.2), place, distance_request(), coal.DistanceResult()
    )
    assert -0.3 < same < 0


def test_what_is_not_checked_is_said():
    found = distance(library_robot("panda"), np.zeros(7), self_collision=True)
    assert found.not_checked == (
        "link 1 and link 3, link 3 and link 5, which overlap in all sampled configurations",
    )
    assert "not checked: link 1 and link 3" in repr(found)
    near = "parts of the base and link 2, 8.57 mm apart in all configurations"
    assert distance(library_robot("al5d"), np.zeros(4), self_collision=True).not_checked == (near,)


def test_links_that_touch_by_construction_alone_are_left_out():
    """A slide whose link is drawn apart from the base is checked against it."""
    assert link_pairs(library_robot("planar2r")).capsules
    assert links_without_shapes(from_dh([(0, 0.4, 0, "pi/2"), (0, 0, 0.3, 0)])) == ()
