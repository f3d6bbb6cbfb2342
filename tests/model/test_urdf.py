"""What the URDF says beyond frames and masses, and where it goes."""

import math
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from tools.assets import library_urdf

from dhkit.description import Convention, asset, from_dh, library_robot, lock, robots
from dhkit.errors import DescriptionError, ModelError
from dhkit.model import pinocchio_model, urdf_text, write_urdf
from dhkit.model.urdf import UNLIMITED

SAME = 1e-12


def parsed(arm):
    return ElementTree.fromstring(urdf_text(arm))


@pytest.mark.parametrize("name", robots())
def test_the_checked_in_urdfs_are_fresh(name):
    """Run `make assets` when this fails. Numbers may differ by another machine's rounding."""
    old, new = (
        text.replace('"', " ").split()
        for text in (asset(f"urdf/{name}.urdf").read_text(), library_urdf(name))
    )
    assert len(old) == len(new)
    for a, b in zip(old, new, strict=True):
        if a != b:
            assert abs(float(a) - float(b)) < SAME


@pytest.mark.parametrize("name", robots())
def test_every_origin_of_a_joint_is_alpha_and_theta(name):
    arm = library_robot(name)
    rows = {joint.name: i for i, joint in enumerate(arm.joints)}
    shift = 1 if arm.convention is Convention.STANDARD else 0
    for joint in parsed(arm).findall("joint"):
        if joint.get("name") in rows:
            roll, pitch, yaw = map(float, joint.find("origin").get("rpy").split())
            i = rows[joint.get("name")]
            assert pitch == 0.0
            assert roll == (arm.numbers.alpha[i - shift] if i - shift >= 0 else 0.0)
            assert yaw == (arm.numbers.theta[i - 1] if i else 0.0)


def test_limits_and_friction_are_those_of_the_description():
    arm = library_robot("puma560")
    joints = {joint.get("name"): joint for joint in parsed(arm).findall("joint")}
    limit, dynamics = joints["waist"].find("limit"), joints["waist"].find("dynamics")
    assert float(limit.get("upper")) == math.radians(160)
    assert float(limit.get("effort")) == 97.6
    assert float(dynamics.get("damping")) == pytest.approx(62.6111**2 * 0.00148, rel=1e-15)
    assert float(dynamics.get("friction")) == pytest.approx(
        62.6111 * (0.395 + 0.435) / 2, rel=1e-15
    )


def test_what_is_unlimited_gets_numbers_in_the_urdf_and_none_in_the_model():
    arm = from_dh([(0, 0, 3, 0), (0, 0, 0, 0)], kinds="RP")
    revolute, prismatic = (
        joint.find("limit")
        for joint in parsed(arm).findall("joint")
        if joint.find("limit") is not None
    )
    assert float(revolute.get("upper")) == 2 * math.pi
    assert float(prismatic.get("lower")) == -3.0
    assert float(prismatic.get("effort")) == UNLIMITED
    model = pinocchio_model(arm)
    assert np.all(np.isinf(model.effortLimit))
    assert np.all(np.isinf(model.velocityLimit))
    assert parsed(arm).find("link[@name='link1']/inertial") is None


def test_the_model_has_what_a_urdf_cannot_say():
    arm = library_robot("puma560")
    model = pinocchio_model(arm)
    gear, rotor = (
        np.array([-62.6111, 107.815, -53.7063, 76.0364, 71.923, 76.686]),
        [2e-4] * 3 + [3.3e-5] * 3,
    )
    assert np.allclose(model.armature, gear**2 * rotor, rtol=1e-15)
    assert np.array_equal(model.gravity.linear, [0, 0, -9.81])
    assert np.array_equal(pinocchio_model(library_robot("planar2r")).gravity.linear, [0, -9.81, 0])
    assert np.allclose(model.upperDryFrictionLimit[:1], 62.6111 * 0.395)
    assert np.allclose(model.lowerDryFrictionLimit[:1], -62.6111 * 0.435)
    assert np.array_equal(model.effortLimit, arm.numbers.effort)
    assert [model.names[i + 1] for i in range(6)] == [joint.name for joint in arm.joints]


@pytest.mark.parametrize(
    "source",
    [
        "<!-- & ]]> -- rods -",
        'x --->\n<link name="evil"/>',
        "----><joint/>",
        "ends in -",
        "---",
        "--> <link/> <!--",
    ],
)
def test_text_in_sources_stays_text(source):
    arm = replace(library_robot("planar2r"), source=source)
    root = parsed(arm)
    assert root.get("name") == "planar2r"
    assert {link.get("name") for link in root.findall("link")} == {
        "world",
        "dh0",
        "link1",
        "dh1",
        "link2",
        "dh2",
        "tool",
    }
    assert len(root.findall("joint")) == 6
    assert pinocchio_model(arm).nq == 2


def test_a_locked_links_mass_stays_on_the_base():
    arm = library_robot("ur5")
    root = parsed(lock(arm, {0: 0.3}))
    masses = [float(mass.get("value")) for mass in root.iter("mass")]
    assert sum(masses) == pytest.approx(arm.numbers.mass.sum(), rel=1e-15)
    assert root.find("link[@name='dh0']/inertial") is not None


def test_meshes_are_written_beside_the_urdf(tmp_path):
    files = write_urdf(library_robot("puma560"), tmp_path / "puma.urdf")
    assert len(files) == 8
    root = ElementTree.parse(tmp_path / "puma.urdf").getroot()
    names = {mesh.get("filename") for mesh in root.iter("mesh")}
    assert len(names) == 7
    for name in names:
        assert (tmp_path / name).is_file()
        assert not name.startswith("/")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["meshes", "puma.urdf"]


def test_folders_are_created_and_what_is_none_is_said(tmp_path):
    (path,) = write_urdf(library_robot("planar2r"), tmp_path / "new" / "folder" / "arm.urdf")
    assert path.is_file()
    with pytest.raises(ModelError, match=r"Not a directory|File exists"):
        write_urdf(library_robot("planar2r"), path / "arm.urdf")


def test_meshes_may_be_named_as_ros_names_them(tmp_path):
    files = write_urdf(
        library_robot("puma560"), tmp_path / "puma.urdf", mesh_prefix="package://my_robot/meshes/"
    )
    names = re.findall(r'filename="([^"]*)"', files[0].read_text())
    assert names
    assert all(name.startswith("package://my_robot/meshes/puma560/") for name in names)
    assert all(file.is_file() for file in files)


@pytest.mark.parametrize(
    "name", ["meshes/../../../etc/passwd", "urdf/none.urdf", "src", "", "/etc/passwd"]
)
def test_assets_are_only_our_own(name):
    with pytest.raises(DescriptionError, match="no packaged file"):
        asset(name)
