"""Laws of the parts that descriptions are built from."""

from dataclasses import replace

import numpy as np
import pytest

from dhkit.description.arrays import number_array
from dhkit.description.assets import asset, inside
from dhkit.description.bodies import Body, Inertia, joined, moved_body, rod
from dhkit.description.changes import with_parameters, with_payload, with_uniform_links
from dhkit.description.exact_poses import fixed_row, identity, inverse, moved, placement_of, pose_of
from dhkit.description.files import check_place, read_bounded
from dhkit.description.frames import link_transforms
from dhkit.description.joint_text import DEGREES, joint_text, violated_limit_text
from dhkit.description.library import library_robot, robots
from dhkit.description.locking import lock
from dhkit.description.mesh_files import MeshFileError, check_mesh_file
from dhkit.description.named import Named
from dhkit.description.numbers import Numbers, matrix
from dhkit.description.parameters import check_parameter_name, needs, resolved
from dhkit.description.payload import Payload
from dhkit.description.poses import check_pose, pose
from dhkit.description.robot import Description
from dhkit.description.robot_data import data_of
from dhkit.description.robot_file import from_toml
from dhkit.description.table import angle, length
from dhkit.description.toml_text import plain_numbers, toml_document
from dhkit.description.toml_writer import toml_text
from dhkit.description.traversal import expressions_in, names_in, with_values
from dhkit.description.validation import check, check_body
from dhkit.description.values import Placement, Units
from dhkit.errors import DescriptionError, ModelError
from dhkit.expressions import PI, exact, parse

ROUNDING = 1e-12  # products of four matrices of numbers of size 1


def floats(T):
    return np.array([[float(entry) for entry in row] for row in T])


@pytest.mark.parametrize("name", robots())
def test_two_derivations_of_a_row_agree(name):
    robot = with_parameters(library_robot(name))
    q = np.linspace(-0.7, 0.9, robot.n)
    values = resolved(robot.parameters)
    rows = [
        floats(
            with_values(
                tuple(map(tuple, fixed_row(joint, robot.convention, exact(float(x))))), values
            )
        )
        for joint, x in zip(robot.joints, q, strict=True)
    ]
    assert np.allclose(rows, link_transforms(robot, q), atol=ROUNDING)


def test_bodies_may_be_joined_before_or_after_they_are_moved():
    T = pose_of(Placement((exact(1), exact(2), exact(3)), (PI / 2, PI / 6, -PI / 4)))
    ball = Body(exact(2), (exact(0), exact(1), exact(0)), Inertia(exact(1), exact(2), exact(3)))
    bodies = [ball, rod(exact(3), (exact(0),) * 3, (exact(1), exact(0), exact(2)))]
    first, second = moved_body(joined(bodies), T), joined([moved_body(body, T) for body in bodies])
    assert float(first.mass) == float(second.mass) == 5
    assert np.allclose([float(x) for x in first.com], [float(x) for x in second.com], atol=ROUNDING)
    assert np.allclose(floats(first.inertia.rows), floats(second.inertia.rows), atol=ROUNDING)


def test_exact_poses_invert_and_read_back():
    placement = Placement((exact(1), exact(-2), exact(0.5)), (PI / 3, -PI / 6, PI / 4))
    T = pose_of(placement)
    assert np.allclose(floats(T @ inverse(T)), np.eye(4), atol=ROUNDING)
    assert placement_of(T) == placement == moved(placement, identity())
    assert np.allclose(matrix(placement, {}), check_pose(floats(T)), atol=ROUNDING)
    assert np.allclose(
        pose((1, -2, 0.5), euler=(60, -30, 45), order="xyz", degrees=True), floats(T), atol=ROUNDING
    )


def test_a_path_stays_in_its_folder(tmp_path):
    (tmp_path / "out").symlink_to("/")
    assert inside(tmp_path, "a/b.stl", "mesh") == tmp_path / "a" / "b.stl"
    assert inside(None, "a/b.stl", "mesh") is None
    for path in ("../b.stl", "/b.stl", "a/../../b", "http://b", "", "x" * 501):
        with pytest.raises(
            DescriptionError, match=r"a part is .*; expected a relative path inside the folder"
        ):
            inside(tmp_path, path, "a part", "the folder")
    with pytest.raises(DescriptionError, match="a link that leaves the robot's folder"):
        inside(tmp_path, "out/etc", "mesh")
    with pytest.raises(DescriptionError, match="no packaged file"):
        asset("../pyproject.toml")


def test_files_are_read_up_to_a_size_and_written_where_they_can_be(tmp_path):
    file = tmp_path / "file"
    file.write_bytes(b"12345")
    assert read_bounded(file, 5) == b"12345"
    with pytest.raises(ModelError, match="expected a report"):
        read_bounded(file, 4, "a report", ModelError)
    check_place(tmp_path / "new" / "file")
    with pytest.raises(DescriptionError, match="a file; expected a folder"):
        check_place(file / "below")


def test_a_mesh_file_is_refused_with_its_reason(tmp_path):
    (tmp_path / "a.stl").touch()
    with pytest.raises(MeshFileError) as error:
        check_mesh_file(tmp_path / "a.stl")
    assert str(error.value) == f"{tmp_path / 'a.stl'}: {error.value.reason}"


def test_joint_values_have_units():
    assert violated_limit_text(2.0, -1.0, 1.0, slides=True) == "2 m, above its upper limit, 1 m"
    assert violated_limit_text(1.0 + 1e-10, -1.0, 1.0, slides=False) == ""
    token = DEGREES.set(True)
    assert joint_text(np.pi, slides=False) == "180°"
    DEGREES.reset(token)


@pytest.mark.parametrize("value", [1j, "1", np.ma.array([1.0]), [[1], [1, 2]]])
def test_only_numbers_become_arrays(value):
    with pytest.raises(TypeError, match="expected numbers, shape"):
        number_array(value, "q", "(n,)")


def test_parameters_depend_on_each_other():
    parameters = Named({"a": exact(2), "b": parse("2*a", ["a"]), "c": parse("b+1", ["b"])})
    assert needs("c", parameters) == {"a", "b"}
    assert float(resolved(parameters)["c"]) == 5
    with pytest.raises(DescriptionError, match="taken"):
        check_parameter_name("pi")


def test_values_replace_every_name():
    robot = with_uniform_links(library_robot("polar_rp"))
    values = resolved(robot.parameters)
    assert {"m1", "m2"} <= names_in(robot.joints)
    joints = with_values(robot.joints, values)
    assert not names_in(joints)
    assert len(list(expressions_in(joints))) == len(list(expressions_in(robot.joints)))


def test_text_and_data_of_a_robot_agree():
    robot = library_robot("polar_rp")
    document = plain_numbers(toml_document(toml_text(robot)))
    assert [row["name"] for row in document["joint"]] == [
        joint.name for joint in data_of(robot).joints
    ]
    again = from_toml(toml_text(robot), mesh_folder=robot.mesh_folder)
    assert isinstance(again, Description) and again == robot
    assert check(again) == again.warnings
    assert Numbers.of(again).reach == again.reach
    assert (length(exact(0.5), Units("mm")), angle(PI / 2)) == ("500", "90°")


def test_a_load_is_checked_as_a_body():
    robot = with_uniform_links(library_robot("polar_rp"))
    load = Payload(2.0, (0, 0, 0.1))
    assert load.carried(robot) == with_payload(robot, 2.0, (0, 0, 0.1))
    assert Payload.of_numbers(load.numbers) == load
    with pytest.raises(DescriptionError, match="eigenvalue"):
        check_body(Body(exact(1), inertia=Inertia(exact(-1))), "load", {})
    locked = lock(robot, {0: 0})
    assert replace(locked).n == robot.n - 1
