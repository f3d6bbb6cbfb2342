"""URDFs that are not to be trusted: each is refused with one line, or read by a rule that is said."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

import numpy as np
import pytest

from dhkit import Arm
from dhkit.errors import ModelError
from dhkit.model import extract_dh
from dhkit.model.bounds import BOUNDS
from dhkit.model.urdf_chain import read_chain

INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
BODY = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def arm(
    *,
    body=BODY,
    limit=LIMIT,
    axis='<axis xyz="0 0 1"/>',
    kind="revolute",
    origin="",
    inner="",
    more="",
) -> str:
    """Return a URDF of two revolute joints, the second of which can be changed."""
    return (
        f'<robot name="r"><link name="a"/><link name="b">{BODY}</link><link name="c">{body}</link>'
        f'<joint name="i" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>{LIMIT}</joint>'
        f'<joint name="j" type="{kind}"><parent link="b"/><child link="c"/>{origin}{axis}{limit}{inner}</joint>'
        f"{more}</robot>"
    )


def chain_of_fixed_joints(count: int) -> str:
    links = "".join(
        f'<link name="l{k}"/><joint name="f{k}" type="fixed"><parent link="{f"l{k - 1}" if k else "c"}"/>'
        f'<child link="l{k}"/></joint>'
        for k in range(count)
    )
    return arm(more=links)


BOMB = (
    '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">'
    '<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>'
)
REFUSED = {
    "entity bomb in text": (f"{BOMB}<robot>&c;</robot>", "document type or entities"),
    "entity bomb in an attribute": (f'{BOMB}<robot name="&c;"/>', "document type or entities"),
    "external entity": (
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot>&x;</robot>',
        "document type",
    ),
    "external DTD": (
        '<!DOCTYPE robot SYSTEM "http://example.org/robot.dtd"><robot/>',
        "document type",
    ),
    "depth 20,000": (
        "<robot>" + "<a>" * 20_000 + "</a>" * 20_000 + "</robot>",
        "nested more than 64 deep",
    ),
    "truncated": (arm()[:300], "not well-formed XML"),
    "truncated in a tag": (arm()[:-12], "not well-formed XML"),
    "two documents": (arm() + arm(), "not well-formed XML"),
    "empty": ("", "not well-formed XML"),
    "binary": ("\x00\x01\x02", "not well-formed XML"),
    "text": ("a robot", "not well-formed XML"),
    "xacro left in": (
        arm(origin='<origin xyz="${x} 0 0"/>'),
        "joint 'j': <origin xyz>: found '${x}'",
    ),
    "another format": ('<sdf version="1.6"/>', "found <sdf>; expected <robot>"),
    "xacro": (
        '<robot xmlns:xacro="x"><xacro:macro name="m"/></robot>',
        "has elements of xacro; run xacro on it first",
    ),
    "too large": ("<robot>" + " " * BOUNDS.urdf_bytes + "</robot>", "more than 5 MB"),
    "many elements": ("<robot>" + "<a/>" * 150_000 + "</robot>", "more than 100000 elements"),
    "a long attribute": (f'<robot name="{"x" * 2000}"/>', "<robot name> has 2000 characters"),
    "no links": ('<robot name="r"/>', "no links; expected a robot"),
    "4,000 fixed joints": (chain_of_fixed_joints(4000), "4003 links; expected 500 at most"),
    "cycle beside the tree": (
        arm(
            more='<link name="x"/><link name="y"/><joint name="k" type="fixed"><parent link="x"/><child link="y"/>'
            '</joint><joint name="l" type="fixed"><parent link="y"/><child link="x"/></joint>'
        ),
        "links x, y go round in a circle; expected a tree",
    ),
    "cycle of all": (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="i" type="fixed"><parent link="a"/>'
        '<child link="b"/></joint><joint name="j" type="fixed"><parent link="b"/><child link="a"/></joint></robot>',
        "links a, b go round in a circle",
    ),
    "own parent": (
        '<robot name="r"><link name="a"/><joint name="i" type="fixed"><parent link="a"/>'
        '<child link="a"/></joint></robot>',
        "links a go round in a circle",
    ),
    "two parents": (
        arm(more='<joint name="k" type="fixed"><parent link="a"/><child link="c"/></joint>'),
        "link 'c' has two parents, by joints 'j' and 'k'",
    ),
    "two links of one name": (arm(more='<link name="b"/>'), "two links have the name 'b'"),
    "two joints of one name": (
        arm(
            more='<link name="d"/><joint name="j" type="fixed"><parent link="c"/><child link="d"/></joint>'
        ),
        "two joints have the name 'j'",
    ),
    "a link without a name": (arm(more="<link/>"), "a link has the name ''; expected text"),
    "a name with a line break": (
        arm(more='<link name="a&#10;b"/>'),
        "a link has the name 'a\\nb'; expected text",
    ),
    "no such parent": (
        arm().replace('parent link="b"', 'parent link="x"'),
        "joint 'j': <parent> is 'x', which is not a link",
    ),
    "no child": (
        arm().replace('<child link="c"/>', ""),
        "joint 'j': <child> is '', which is not a link",
    ),
    "unknown type": (arm(kind="hinge"), "joint 'j' is 'hinge'; expected one of revolute"),
    "zero axis": (
        arm(axis='<axis xyz="0 0 0"/>'),
        "joint 'j': <axis xyz>: found 0 0 0; expected a direction",
    ),
    "axis of two numbers": (
        arm(axis='<axis xyz="0 1"/>'),
        "joint 'j': <axis xyz> has 2 numbers; expected 3",
    ),
    "NaN axis": (
        arm(axis='<axis xyz="0 nan 1"/>'),
        "joint 'j': <axis xyz>: found 'nan'; expected a finite number",
    ),
    "infinite origin": (
        arm(origin='<origin xyz="inf 0 0"/>'),
        "joint 'j': <origin xyz>: found 'inf'",
    ),
    "comma decimals": (
        arm(origin='<origin xyz="0,5 0 0"/>'),
        "joint 'j': <origin xyz>: found '0,5'",
    ),
    "underscored number": (
        arm(origin='<origin xyz="1_0 0 0"/>'),
        "found '1_0'; expected a finite number",
    ),
    "degrees in rpy": (
        arm(origin='<origin rpy="90deg 0 0"/>'),
        "joint 'j': <origin rpy>: found '90deg'",
    ),
    "limits the wrong way": (
        arm(limit='<limit lower="1" upper="-1"/>'),
        "limits [1, -1] are the wrong way round",
    ),
    "NaN limit": (
        arm(limit='<limit lower="nan" upper="1"/>'),
        "joint 'j': <limit lower>: found 'nan'",
    ),
    "negative effort": (
        arm(limit='<limit lower="-1" upper="1" effort="-5"/>'),
        "joint 'j': effort is -5",
    ),
    "NaN mass": (
        arm(body=BODY.replace('value="1"', 'value="nan"')),
        "link 'c': <mass value>: found 'nan'",
    ),
    "missing mass": (
        arm(body=f"<inertial>{INERTIA}</inertial>"),
        "link 'c': <inertial> lacks mass or inertia",
    ),
    "missing inertia": (
        arm(body='<inertial><mass value="1"/></inertial>'),
        "link 'c': <inertial> lacks mass or inertia",
    ),
    "missing izz": (
        arm(body=BODY.replace(' izz="1"', "")),
        "link 'c': <inertial> lacks mass or inertia",
    ),
    "negative mass": (
        arm(body=BODY.replace('value="1"', 'value="-1"')),
        "link 'c': mass is -1; expected none below 0",
    ),
    "inertia in words": (
        arm(body=BODY.replace('ixx="1"', 'ixx="one"')),
        "link 'c': <inertia ixx>: found 'one'",
    ),
    "mimic in the chain": (arm(inner='<mimic joint="i"/>'), "joint 'j' follows joint 'i' (mimic)"),
    "floating in the chain": (
        arm(kind="floating", limit=""),
        "joint 'j' is floating; expected revolute, continuous",
    ),
    "planar in the chain": (
        arm(kind="planar"),
        "joint 'j' is planar; expected revolute, continuous",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_files_get_one_line_and_soon(name, tmp_path):
    text, message = REFUSED[name]
    file = tmp_path / "bad.urdf"
    file.write_text(text)
    begin = time.process_time()
    with pytest.raises(ModelError) as caught:
        extract_dh(file, tip="c" if "chain" in name else None)
    assert time.process_time() - begin < 5
    assert str(caught.value).startswith(f"{file}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("path", ["/dev/zero", "folder", "pipe", "missing.urdf", "\0"])
def test_what_is_no_file_is_not_read(path, tmp_path):
    target = tmp_path / path if path not in ("/dev/zero", "\0") else Path(path)
    if path == "folder":
        target.mkdir()
    if path == "pipe":
        os.mkfifo(target)
    with pytest.raises(
        ModelError, match=r"a folder|not a regular file|No such file|null (?:byte|character)"
    ):
        read_chain(target)


READ = {
    "a second root": (
        arm(more='<link name="z"/>'),
        "links that no joint connects with 'a' left out: z",
    ),
    "effort -1": (
        arm(limit='<limit lower="-1" upper="1" effort="-1" velocity="1"/>'),
        "effort -1; read as unlimited",
    ),
    "a finger with reversed limits": (
        arm(
            more='<link name="d"/><joint name="k" type="revolute"><parent link="c"/><child link="d"/>'
            '<axis xyz="0 0 1"/><limit lower="1" upper="-1"/><mimic joint="i"/></joint>'
        ),
        "limits [1, -1] are the wrong way round; the chain does not use it",
    ),
    "no limits": (arm(limit=""), "joint 'j': no limits; read as unlimited"),
    "an empty range": (
        arm(limit='<limit lower="0" upper="0" effort="1" velocity="1"/>'),
        "limits [0, 0]; read as unlimited",
    ),
    "limit without range": (
        arm(limit='<limit effort="1" velocity="1"/>'),
        "joint 'j': no limits; read as unlimited",
    ),
    "effort 0": (
        arm(limit='<limit lower="-1" upper="1" effort="0" velocity="1"/>'),
        "effort 0; read as unlimited",
    ),
    "non-unit axis": (
        arm(axis='<axis xyz="0 0 2"/>'),
        "joint 'j': axis has length 2; read as a direction",
    ),
    "no inertial": (arm(body=""), "links without <inertial> are bodies of mass 0: c"),
    "impossible inertia": (
        arm(body=BODY.replace('ixx="1"', 'ixx="-1"')),
        "link 'c': no body has this inertia: a principal moment is -1 kg m^2",
    ),
    "unknown geometry": (
        arm(body=f"{BODY}<visual><geometry><cone/></geometry></visual>"),
        "link 'c': visual has no geometry that dhkit knows; left out",
    ),
    "mimic off the chain": (
        arm(
            more='<link name="d"/><joint name="k" type="revolute"><parent link="c"/><child link="d"/>'
            f'<axis xyz="0 0 1"/>{LIMIT}<mimic joint="i"/></joint>'
        ),
        "joints off the chain stand at zero, their links carried along: k",
    ),
}


@pytest.mark.parametrize("name", READ)
def test_what_is_read_by_a_rule_is_said(name, tmp_path):
    text, note = READ[name]
    (tmp_path / "odd.urdf").write_text(text)
    extraction = extract_dh(tmp_path / "odd.urdf", tip="c")
    assert any(note in one for one in extraction.notes)
    assert note in extraction.description.notes
    assert extraction.residual.largest < 5e-10


def test_a_link_that_the_chain_does_not_use_may_be_wrong(tmp_path):
    """With side="drop" it is left out; carried along, its mass counts."""
    finger = (
        '<link name="d"><inertial><mass value="nan"/></inertial></link><joint name="k" type="revolute">'
        f'<parent link="c"/><child link="d"/><axis xyz="0 0 1"/>{LIMIT}</joint>'
    )
    (tmp_path / "odd.urdf").write_text(arm(more=finger))
    dropped = extract_dh(tmp_path / "odd.urdf", tip="c", side="drop")
    assert any(
        "<mass value>: found 'nan'" in note and "does not use it" in note for note in dropped.notes
    )
    with pytest.raises(ModelError, match="link 'd': <mass value>: found 'nan'"):
        extract_dh(tmp_path / "odd.urdf", tip="c")


def test_the_largest_tree_is_read(tmp_path):
    links = "".join(f'<link name="x{k}"/>' for k in range(5))
    joints = "".join(
        f'<joint name="y{k}" type="revolute"><parent link="x{k}"/><child link="x{k + 1}"/>{LIMIT}</joint>'
        for k in range(4)
    )
    (tmp_path / "two.urdf").write_text(arm(more=links + joints))
    found = extract_dh(tmp_path / "two.urdf")
    assert found.description.n == 4
    assert "links that no joint connects with 'x0' left out: a, b, c" in found.notes


ENCODED = {
    "blank lines before the header": ("\n  \n" + '<?xml version="1.0"?>' + arm()).encode(),
    "utf-16": ('<?xml version="1.0" encoding="utf-16"?>' + arm()).encode("utf-16"),
    "utf-16 without a mark": ('<?xml version="1.0" encoding="utf-16"?>' + arm()).encode(
        "utf-16-le"
    ),
    "utf-8 that says utf-16": ('<?xml version="1.0" encoding="utf-16"?>' + arm()).encode(),
    "latin-1": ('<?xml version="1.0" encoding="ISO-8859-1"?><!-- \u00fc -->' + arm()).encode(
        "latin-1"
    ),
    "gb2312": ('<?xml version="1.0" encoding="gb2312"?><!-- \u673a -->' + arm()).encode("gb2312"),
    "undeclared prefixes": arm(more='<sensor:camera a:b="c"><gazebo:x/></sensor:camera>').encode(),
    "a namespace": arm().replace("<robot ", '<robot xmlns="urn:x" xmlns:s="urn:s" ').encode(),
}


@pytest.mark.parametrize("name", ENCODED)
def test_what_other_readers_take_is_read(name, tmp_path):
    (tmp_path / "arm.urdf").write_bytes(ENCODED[name])
    extraction = extract_dh(tmp_path / "arm.urdf")
    assert extraction.description.n == 2
    assert extraction.residual.largest < 1e-12


@pytest.mark.parametrize("encoding", ["idna", "punycode", "zlib", "rot13", "nonsense"])
def test_encodings_that_are_none_are_refused(encoding, tmp_path):
    (tmp_path / "arm.urdf").write_bytes(
        f'<?xml version="1.0" encoding="{encoding}"?>'.encode() + b"\xff" * 1000
    )
    with pytest.raises(ModelError, match="not UTF-8 text, and"):
        read_chain(tmp_path / "arm.urdf")


def test_a_xacro_file_is_sent_to_xacro(tmp_path):
    (tmp_path / "arm.urdf.xacro").write_text(REFUSED["xacro"][0])
    with pytest.raises(ModelError, match="run xacro on it first, and give its output"):
        Arm.load(str(tmp_path / "arm.urdf.xacro"))


def test_rules_for_limits(tmp_path):
    (tmp_path / "one.urdf").write_text(arm(limit='<limit upper="2" effort="1" velocity="1"/>'))
    numbers = extract_dh(tmp_path / "one.urdf").description.numbers
    assert (numbers.lower[1], numbers.upper[1]) == (0, 2)  # a missing bound is 0 by URDF's rule
    (tmp_path / "none.urdf").write_text(arm(kind="continuous"))
    numbers = extract_dh(tmp_path / "none.urdf").description.numbers
    assert (numbers.lower[1], numbers.upper[1]) == (-np.inf, np.inf)


def test_a_link_and_a_joint_may_share_a_name(tmp_path):
    (tmp_path / "shared.urdf").write_text(arm().replace('"j"', '"c"'))
    extraction = extract_dh(tmp_path / "shared.urdf")
    assert extraction.residual.largest < 1e-12
    assert [joint.name for joint in extraction.description.joints] == ["i", "c"]


def test_names_that_a_robot_file_does_not_take_are_changed(tmp_path):
    text = (
        arm()
        .replace('name="i"', 'name="joint 1/a"')
        .replace('name="j"', 'name="tool"')
        .replace('"r"', '"7 axes"')
    )
    (tmp_path / "names.urdf").write_text(text)
    found = extract_dh(tmp_path / "names.urdf").description
    assert found.name == "robot_7_axes"
    assert [joint.name for joint in found.joints] == ["joint_1_a", "tool_joint"]


def test_impossible_inertias_stay_and_are_marked(tmp_path):
    (tmp_path / "odd.urdf").write_text(arm(body=BODY.replace('ixx="1"', 'ixx="-1"')))
    found = extract_dh(tmp_path / "odd.urdf").description
    assert found.joints[1].bodies[0].unphysical
    assert any("eigenvalue" in warning for warning in found.warnings)


MESH = '<visual><geometry><mesh filename="{uri}"/></geometry></visual>'
OUTSIDE = {
    "../../etc/passwd": "outside the robot's folder",
    "/etc/passwd": "an absolute path",
    "file:///etc/passwd": "expected package:// or a path relative",
    "http://example.org/x.stl": "expected package:// or a path relative",
    "https://example.org/x.stl": "expected package:// or a path relative",
    "C:\\\\robots\\\\x.stl": "expected package:// or a path relative",
    "package://../../etc/passwd": "expected package://NAME/path",
    "package://other/x.stl": "no package 'other'",
    "package://": "expected package://NAME/path",
    "missing.stl": "is not there",
    "link.stl": "outside the robot's folder",
    "folder.stl": "is not there",
    "cut.stl": "cut.stl",
    "empty.stl": "empty.stl",
    "x.step": "x.step",
}


@pytest.mark.parametrize("uri", OUTSIDE)
def test_meshes_outside_the_folder_are_left_out_and_said(uri, tmp_path):
    folder = tmp_path / "robot"
    folder.mkdir()
    (tmp_path / "secret.stl").write_text("solid s\nfacet normal 0 0 1\nendsolid s\n")
    (folder / "link.stl").symlink_to(tmp_path / "secret.stl")
    (folder / "folder.stl").mkdir()
    (folder / "cut.stl").write_bytes(b"\0" * 80 + (1000).to_bytes(4, "little") + b"\0" * 50)
    (folder / "empty.stl").touch()
    (folder / "x.step").write_text("ISO-10303-21;")
    (folder / "arm.urdf").write_text(arm(body=BODY + MESH.format(uri=uri)))
    extraction = extract_dh(folder / "arm.urdf")
    said = [note for note in extraction.notes if note.startswith("link 'c': ")]
    assert len(said) == 1
    assert OUTSIDE[uri] in said[0]
    assert said[0].endswith("left out")
    assert extraction.description.n == 2
    assert not extraction.description.joints[1].shapes


TRIANGLE = (
    b"\0" * 80
    + (1).to_bytes(4, "little")
    + np.array([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0], "<f4").tobytes()
    + b"\0\0"
)


@pytest.mark.parametrize(
    ("uri", "scale"),
    [
        ("package://my_robot/meshes/c.stl", "0.001 0.001 0.001"),
        ("../meshes/c.stl", "1 -1 1"),
        ("package://elsewhere/c.stl", "1 1 1"),
    ],
)
def test_meshes_are_found_as_yourdfpy_finds_them(uri, scale, tmp_path):
    import yourdfpy

    root = tmp_path / "my_robot_src"
    for folder in ("urdf", "meshes"):
        (root / folder).mkdir(parents=True)
    (root / "package.xml").write_text("<package><name>my_robot</name></package>")
    (root / "meshes" / "c.stl").write_bytes(TRIANGLE)
    (tmp_path / "ws" / "elsewhere").mkdir(parents=True)
    (tmp_path / "ws" / "elsewhere" / "c.stl").write_bytes(TRIANGLE)
    file = root / "urdf" / "arm.urdf"
    visual = f'<visual><origin xyz="0 0 0.1"/><geometry><mesh filename="{uri}" scale="{scale}"/></geometry></visual>'
    file.write_text(arm(body=BODY + visual, origin='<origin xyz="0.3 0 0" rpy="0.4 0 0"/>'))
    found = extract_dh(
        file, package_dirs=[tmp_path / "ws"] if "elsewhere" in uri else ()
    ).description
    (shape,) = found.joints[1].shapes
    mesh = found.mesh_folder / shape.geometry.path
    assert mesh.read_bytes() == TRIANGLE
    assert [float(x) for x in shape.geometry.scale] == [float(x) for x in scale.split()]

    names = {
        "package://my_robot": str(root),
        "package://elsewhere": str(tmp_path / "ws" / "elsewhere"),
    }

    def handler(fname):
        for package, place in names.items():
            fname = fname.replace(package, place)
        return fname if fname.startswith("/") else str(file.parent / fname)

    robot = yourdfpy.URDF.load(str(file), filename_handler=handler)
    robot.update_cfg([0.3, -0.5])
    (name,) = robot.scene.graph.nodes_geometry
    theirs = robot.scene.graph.get(name)[0]
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]) * [float(x) for x in scale.split()]
    frame = Arm(found).frames([0.3, -0.5])[2]
    from dhkit.description.numbers import matrix

    T = frame @ matrix(shape.placement, {})
    ours = vertices @ T[:3, :3].T + T[:3, 3]
    geometry = robot.scene.geometry[robot.scene.graph.get(name)[1]]
    seen = geometry.vertices @ theirs[:3, :3].T + theirs[:3, 3]
    assert np.abs(np.sort(ours, axis=0) - np.sort(seen, axis=0)).max() < 1e-9


def test_nothing_of_a_refused_file_is_written(tmp_path, capsys):
    from dhkit.cli import main

    (tmp_path / "bad.urdf").write_text(arm(kind="hinge"))
    with pytest.raises(SystemExit) as stopped:
        main(["extract", str(tmp_path / "bad.urdf"), "-o", str(tmp_path / "out.toml")])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.urdf"]
    assert not re.search("Traceback", capsys.readouterr().err)
