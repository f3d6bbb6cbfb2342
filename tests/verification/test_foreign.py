"""Somebody's URDF against a table: what agrees, what differs and how, and files that are not to be trusted."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest

import dhkit
from dhkit import Arm
from dhkit.cli import main
from dhkit.description import asset, library_robot
from dhkit.errors import ModelError
from dhkit.model.bounds import BOUNDS
from dhkit.model.urdf_chain import read_chain
from dhkit.verification import verify_urdf


@pytest.mark.parametrize("name", dhkit.robots())
def test_our_own_urdfs_agree(name, law):
    report = verify_urdf(library_robot(name), asset(f"urdf/{name}.urdf"), samples=law.samples(1000))
    for agreement in report.agreements:
        law.holds(f"URDF, {agreement.quantity}", agreement.error, 1e-12, name)
    assert not any("limits" in note for note in report.notes)


def test_constant_differences_of_tool_and_base_are_said():
    T = dhkit.pose((0.1, 0, 0.2), euler=(0, 0, 90), degrees=True)
    puma, file = Arm.load("puma560"), asset("urdf/puma560.urdf")
    report = verify_urdf(puma.with_tool(T).description, file, samples=20)
    assert not report
    assert any("constant tool" in note and "degrees" in note for note in report.notes)
    report = verify_urdf(puma.with_base(T).description, file, samples=20)
    assert any(
        "constant base: the URDF's arm stands" in note and "(0, 0, -90)" in note
        for note in report.notes
    )


def test_a_wrong_mass_and_a_wrong_length_are_found(tmp_path):
    puma, text = library_robot("puma560"), asset("urdf/puma560.urdf").read_text()
    file = tmp_path / "puma.urdf"
    file.write_text(text.replace('value="17.4"', 'value="17.41"'))
    report = verify_urdf(puma, file, samples=20)
    wrong = {agreement.quantity for agreement in report.agreements if not agreement.ok}
    assert wrong == {"mass matrix M", "gravity torque g", "inverse dynamics tau"}
    file.write_text(text.replace("0.15005", "0.15"))
    wrong = {a.quantity for a in verify_urdf(puma, file, samples=20).agreements if not a.ok}
    assert "tool position" in wrong
    assert "tool rotation" not in wrong


SIMPLE = """<robot name="r"><link name="a"/>
<link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="{axis}"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>{more}</robot>"""


def simple(kind="revolute", axis="0 0 1", more="") -> str:
    return SIMPLE.format(kind=kind, axis=axis, more=more)


def test_a_continuous_joint_is_one_number(tmp_path):
    file = tmp_path / "c.urdf"
    file.write_text(simple("continuous"))
    arm = dhkit.Arm.from_dh([(0, 0, 0, 0)])
    assert verify_urdf(arm.description, file, samples=5).ok


def test_a_gripper_is_locked_and_a_tip_can_be_chosen(tmp_path):
    branches = "".join(
        f'<link name="f{k}"/><joint name="g{k}" type="prismatic"><parent link="b"/><child link="f{k}"/>'
        '<axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>'
        for k in range(2)
    )
    file = tmp_path / "gripper.urdf"
    file.write_text(simple(more=branches))
    ends = r"chains end at b \(1 joint\), f0 \(2 joints\), f1 \(2 joints\); choose one \(tip\)"
    with pytest.raises(ModelError, match=ends):
        read_chain(file)
    chain = read_chain(file, tip="b")
    assert (chain.names, chain.kinds, chain.frozen) == (("j",), "R", ("g0", "g1"))
    assert verify_urdf(dhkit.Arm.from_dh([(0, 0, 0, 0)]).description, file, tip="b", samples=5).ok
    with pytest.raises(ModelError, match="tip: no link 'c'; it has a, b, f0, f1"):
        read_chain(file, tip="c")


BAD = {
    "entities": ('<!DOCTYPE r [<!ENTITY x "y">]><robot name="&x;"/>', "document type or entities"),
    "no xml": ("hello", "not well-formed XML"),
    "truncated": (simple()[:200], "not well-formed XML"),
    "another root": ("<sdf/>", "found <sdf>; expected <robot>"),
    "deep": ("<robot>" + "<a>" * 100 + "</a>" * 100 + "</robot>", "nested more than 64 deep"),
    "two parents": (
        simple(
            more='<link name="c"/><joint name="k" type="fixed"><parent link="c"/><child link="b"/></joint>'
        ),
        "link 'b' has two parents, by joints 'j' and 'k'",
    ),
    "cycle": (
        simple(
            more='<link name="c"/><link name="d"/><joint name="k" type="fixed"><parent link="c"/><child link="d"/>'
            '</joint><joint name="l" type="fixed"><parent link="d"/><child link="c"/></joint>'
        ),
        "links c, d go round in a circle",
    ),
    "no such link": (
        simple().replace('child link="b"', 'child link="x"'),
        "joint 'j': <child> is 'x', which is not a link",
    ),
    "same names": (simple(more='<link name="b"/>'), "two links have the name 'b'"),
    "nan": (
        simple().replace('mass value="1"', 'mass value="nan"'),
        "link 'b': <mass value>: found 'nan'",
    ),
    "no number": (simple().replace('ixx="1"', 'ixx="one"'), "link 'b': <inertia ixx>: found 'one'"),
    "zero axis": (simple(axis="0 0 0"), "joint 'j': <axis xyz>: found 0 0 0; expected a direction"),
    "short axis": (simple(axis="0 1"), "joint 'j': <axis xyz> has 2 numbers; expected 3"),
    "negative mass": (
        simple().replace('mass value="1"', 'mass value="-1"'),
        "link 'b': mass is -1",
    ),
    "mimic": (
        simple().replace("<limit", '<mimic joint="x"/><limit'),
        "no moving joints below link 'a' that do not follow others (mimic)",
    ),
    "hinge": (
        simple("hinge"),
        "joint 'j' is 'hinge'; expected one of revolute, continuous, prismatic, fixed",
    ),
    "no mass": (simple().replace('<mass value="1"/>', ""), "link 'b': <inertial> lacks mass"),
    "many joints": (
        "<robot><link name='l0'/>"
        + "".join(
            f"<link name='l{k}'/><joint name='j{k}' type='fixed'><parent link='l{k - 1}'/><child link='l{k}'/></joint>"
            for k in range(1, 4000)
        )
        + "</robot>",
        "4000 links; expected 500 at most",
    ),
    "too large": ("<robot>" + " " * BOUNDS.urdf_bytes + "</robot>", "more than 5 MB"),
    "sliding": (simple("prismatic"), "joints j are P; expected R as in"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_get_one_line(name, tmp_path, capsys):
    text, message = BAD[name]
    file = tmp_path / "bad.urdf"
    file.write_text(text)
    with pytest.raises(ModelError, match=r"bad\.urdf: ") as caught:
        verify_urdf(dhkit.Arm.from_dh([(0, 0, 0, 0)]).description, file, samples=5)
    assert "\n" not in str(caught.value)
    assert message in str(caught.value)
    with pytest.raises(SystemExit) as stopped:
        main(["verify", "planar2r", "--urdf", str(file)])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("path", ["/dev/zero", "folder", "pipe"])
def test_what_is_no_file_is_not_read(path, tmp_path):
    path = tmp_path / path if path != "/dev/zero" else Path(path)
    if path.name == "folder":
        path.mkdir()
    if path.name == "pipe":
        os.mkfifo(path)
    with pytest.raises(ModelError, match=r"a folder|not a regular file"):
        read_chain(path)


def changed(tmp_path, old, new, *, joint=None):
    """Return how the Stanford arm differs from its URDF with one text replaced, after a joint's name if given."""
    text = asset("urdf/stanford.urdf").read_text()
    start = text.index(f'<joint name="{joint}"') if joint else 0
    assert old in text[start:]
    file = tmp_path / "changed.urdf"
    file.write_text(text[:start] + text[start:].replace(old, new, 1))
    report = verify_urdf(library_robot("stanford"), file, samples=10)
    return report.ok, " | ".join(
        note for note in report.notes[1:] if not note.startswith("yourdfpy")
    )


def test_differences_are_said_joint_by_joint(tmp_path):
    axis, other = '<axis xyz="0 0 1" />', '<axis xyz="0 0 -1" />'
    assert changed(tmp_path, axis, other, joint="shoulder") == (
        False,
        "joint 2 (shoulder) moves the other way in the URDF",
    )
    assert changed(tmp_path, axis, other, joint="boom") == (
        False,
        "joint 3 (boom) moves the other way in the URDF",
    )
    ok, said = changed(
        tmp_path,
        'rpy="-1.5707963267948966 0 0"',
        'rpy="-1.5707963267948966 0.2 0"',
        joint="shoulder",
    )
    assert (ok, said) == (
        False,
        "joint 2 (shoulder): the URDF's zero is at 11.4592 degrees of the table's",
    )
    ok, said = changed(tmp_path, axis, '<axis xyz="0 0.6 0.8" />', joint="wrist_pitch")
    assert (ok, said) == (
        False,
        "joint 5 (wrist_pitch): with all joints at zero its axis is turned by 36.8699 degrees",
    )


def test_differences_are_said_link_by_link(tmp_path):
    assert changed(tmp_path, '<mass value="5.01"', '<mass value="5.02"') == (
        False,
        "link 2 (shoulder): mass is 5.02 kg in the URDF, 5.01 kg in the table",
    )
    # The mass of the first link, which turns about the axis that its centre lies on, moves nothing.
    _, said = changed(tmp_path, '<mass value="9.29"', '<mass value="9.3"')
    assert "link 1 (waist): mass is 9.3 kg" in said


def test_axes_of_fixed_joints_and_limits_of_continuous_ones_do_not_matter(tmp_path):
    assert changed(
        tmp_path, '<child link="tool" />', '<child link="tool" /><axis xyz="0 0 0"/>'
    ) == (True, "")
    assert changed(tmp_path, 'type="revolute"', 'type="continuous"') == (True, "")


def test_a_joint_without_limits_is_unlimited_and_that_is_said(tmp_path):
    file = tmp_path / "unlimited.urdf"
    file.write_text(re.sub(r"<limit [^>]*>", "", simple()))
    report = verify_urdf(dhkit.Arm.from_dh([(0, 0, 0, 0)]).description, file, samples=3)
    assert report.ok
    assert "joint 'j': no limits; read as unlimited" in report.notes


def test_names_cannot_break_a_report(tmp_path):
    file = tmp_path / "names.urdf"
    file.write_text(simple().replace('name="j"', 'name="a|&lt;c>"'))
    report = verify_urdf(dhkit.Arm.from_dh([(0, 0, 0, 0)]).description, file, samples=3)
    assert any(
        note.startswith("yourdfpy") and "reads the same frames" in note for note in report.notes
    )
    assert "joints in order: a|<c>" in str(report)
    assert "a\\|&lt;c>" in report.markdown()
    file.write_text(simple().replace('name="j"', 'name="a&#10;b&#155;c"'))
    with pytest.raises(ModelError, match=r"a joint has the name 'a\\nb\\x9bc'; expected text"):
        read_chain(file)


def test_other_encodings_and_missing_files(tmp_path):
    file = tmp_path / "utf16.urdf"
    file.write_bytes(simple().encode("latin-1") + b"\xff")
    with pytest.raises(ModelError, match="not UTF-8"):
        read_chain(file)
    with pytest.raises(ModelError, match="No such file"):
        read_chain(tmp_path / "none.urdf")


def test_command(tmp_path, capsys):
    file = tmp_path / "report.tex"
    with pytest.raises(SystemExit) as stopped:
        main(
            [
                "verify",
                "planar2r",
                "--urdf",
                str(asset("urdf/planar2r.urdf")),
                "--samples",
                "5",
                "-o",
                str(file),
            ]
        )
    assert stopped.value.code == 0
    assert "tool position" in capsys.readouterr().out
    assert file.read_text().startswith("% needs")
    with pytest.raises(SystemExit) as stopped:
        main(
            ["verify", "puma560", "--urdf", str(asset("urdf/ur5.urdf")), "--samples", "5", "--json"]
        )
    assert stopped.value.code == 1
    with pytest.raises(SystemExit) as stopped:
        main(["verify", "planar2r", "-o", "x.pdf"])
    assert stopped.value.code == 2
    assert "ends in .md, .tex or .json" in capsys.readouterr().err
    with pytest.raises(ValueError, match="tolerance is nan"):
        verify_urdf(library_robot("planar2r"), asset("urdf/planar2r.urdf"), tolerance=np.nan)
