"""What a hostile reader found: states that show nothing, unknown attributes, numbers that only look rounded."""

from __future__ import annotations

import time

import numpy as np
import pytest

from dhkit import Arm
from dhkit.description import write_robot
from dhkit.errors import DhkitError, ModelError
from dhkit.model import extract_dh, link_parts
from dhkit.model.urdf_reader import read_urdf
from dhkit.verification import verify_urdf

LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
BODY = (
    '<inertial><mass value="1"/><origin xyz="0.1 0 0"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
)


def link(name: str, inner: str = "") -> str:
    return f'<link name="{name}">{inner}</link>'


def joint(
    name,
    parent,
    child,
    *,
    kind="revolute",
    xyz="0.3 0 0.1",
    rpy="0.2 0 0",
    axis="0 0 1",
    limit=LIMIT,
    more="",
):
    origin = (
        f'<origin xyz="{xyz}" rpy="{rpy}"/>' if rpy is not None else f'<origin xyz="{xyz}" {more}/>'
    )
    inner = "" if rpy is None else more
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{origin}'
        f'<axis xyz="{axis}"/>{limit}{inner}</joint>'
    )


def robot(*parts: str, version: str = "1.0") -> str:
    return f'<robot name="r" version="{version}">{"".join(parts)}</robot>'


def chain(count: int, kinds: str = "revolute", **options) -> str:
    links = [link(f"l{k}") for k in range(count + 1)]
    return robot(
        *links, *(joint(f"j{k}", f"l{k}", f"l{k + 1}", kind=kinds, **options) for k in range(count))
    )


@pytest.fixture
def file(tmp_path):
    def write(text: str, name: str = "arm.urdf"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def truth(path, description, count=200):
    """Return the tool's largest difference from the product of the file's own transforms, over whole turns."""
    from dhkit.description import world_to_tool
    from dhkit.model.extraction import Original
    from dhkit.model.urdf_chain import read_chain, tip_in_base

    original = Original(read_chain(path), states=count, seed=5)
    own = np.array([tip_in_base(original.chain, q) for q in original.q])
    return float(np.abs(world_to_tool(description, original.q) - own).max())


@pytest.mark.parametrize("limits", [(10, 20), (90, 270), (-1000, -900), (0.5, 0.7)])
def test_limits_do_not_decide_what_a_table_is_held_to(limits, file):
    low, high = limits
    limit = f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/>'
    path = file(
        robot(
            link("base"),
            link("a"),
            link("b"),
            joint("j1", "base", "a", limit=limit),
            joint("j2", "a", "b", xyz="0.5 0.2 0", rpy="5e-6 0 0", limit=limit),
        )
    )
    extraction = extract_dh(path)
    assert truth(path, extraction.description) < 1e-9
    assert extraction.residual.tool < 1e-9
    assert "zero" not in extraction.description.configurations
    assert extraction.description.numbers.configurations["middle"][0] == pytest.approx(
        (low + high) / 2
    )


def test_a_long_rail_is_sampled_along_its_stroke(file):
    rail = '<limit lower="0" upper="100" effort="1" velocity="1"/>'
    path = file(
        robot(
            link("a"),
            link("b"),
            link("c"),
            joint("j", "a", "b", kind="prismatic", axis="1 2 3", limit=rail),
            joint("k", "b", "c"),
        )
    )
    assert truth(path, extract_dh(path).description) < 1e-9


def test_quaternions_of_urdf_1_2_are_read(file):
    half = 0.7071067811865476
    turned = joint("j", "a", "b", rpy=None, more=f'quat_xyzw="{half!r} 0 0 {half!r}"')
    path = file(robot(link("a"), link("b"), turned, version="1.2"))
    assert extract_dh(path).residual.tool < 1e-10
    assert np.allclose(read_urdf(path).joints["j"].T_parent_joint[:3, 2], [0, -1, 0])
    both = turned.replace("<origin", '<origin rpy="0 0 0"')
    with pytest.raises(ModelError, match="has both rpy and quat_xyzw"):
        extract_dh(file(robot(link("a"), link("b"), both, version="1.2")))


def test_a_file_that_pinocchio_reads_otherwise_is_no_arm(file, monkeypatch):
    from dhkit.model.extraction import residual

    path = file(robot(link("a"), link("b"), joint("j", "a", "b", rpy="1.5708 0 0")))
    product = residual.tip_in_base
    monkeypatch.setattr(
        residual, "tip_in_base", lambda chain, q: product(chain, q) @ np.diag([1.0, -1, -1, 1])
    )
    for as_designed in (False, True):
        with pytest.raises(
            ModelError, match="Pinocchio puts the tool 2 away from where dhkit reads it"
        ):
            extract_dh(path, as_designed=as_designed)


def test_nothing_is_invented_where_a_urdf_has_shapes(file):
    box = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
    path = file(
        robot(
            link("a", box),
            link("b"),
            link("c", box),
            link("tool"),
            joint("j", "a", "b"),
            joint("k", "b", "c"),
            joint("f", "c", "tool", kind="fixed", limit=""),
        )
    )
    for convention in ("standard", "modified"):
        arm = Arm.from_urdf(path, convention=convention)
        assert [part.link for part in link_parts(arm.description)] == [0, 2]
        assert arm.urdf().count("<visual>") == 2
    arm.save(path.parent / "arm.toml")
    assert not Arm.load(path.parent / "arm.toml").description.drawn
    bare = Arm.from_urdf(file(path.read_text().replace(box, "")))
    assert len(link_parts(bare.description)) > 5  # no shape at all: drawn from the table


def test_a_turned_base_makes_no_false_differences(file):
    text = robot(
        link("pelvis", BODY),
        link("torso", BODY),
        link("b", BODY),
        link("c", BODY),
        joint("waist", "pelvis", "torso", rpy="0.4 0.5 0.6"),
        joint("j1", "torso", "b"),
        joint("j2", "b", "c", axis="1 0 0"),
    )
    path = file(text)
    arm = Arm.from_urdf(path, base="torso", tip="c")
    report = verify_urdf(arm.description, path, "c", samples=20, base="torso")
    assert report.ok
    assert not any("axis" in note or "turned" in note for note in report.notes), report.notes
    heavy = file(
        text.replace(
            '<link name="c"><inertial><mass value="1"/>',
            '<link name="c"><inertial><mass value="2"/>',
        )
    )
    report = verify_urdf(arm.description, heavy, "c", samples=20, base="torso")
    assert any("mass is 2 kg" in note for note in report.notes), report.notes


KEPT = "1.58 3.15 4.72 6.29 0.786 2.357 158e-2 11.0 22 1.310 8e-6 -7e-6 0.5 1.0 0.26 1.5 3.1 0.001"
READ = {
    "1.5708": 90, "-1.5708": -90, "1.57": 90, "3.14": 180, "3.1416": 180, "1.5707": 90, "0.7854": 45, "0.785": 45,
    "1.309": 75, "2.3562": 135, "3.67320510341448E-06": 0, "-7.3464e-06": 0, "4.712389": 270, "157.08e-2": 90,
}  # fmt: skip


@pytest.mark.parametrize("word", KEPT.split())
def test_what_rounds_nothing_is_left_alone(word, file):
    path = file(robot(link("a"), link("b"), joint("j", "a", "b", rpy=f"{word} 0 0")))
    assert read_urdf(path, as_designed=True).changes == ()


@pytest.mark.parametrize("word", READ)
def test_what_rounds_or_cuts_a_multiple_of_15_degrees_is_read_as_it(word, file):
    path = file(robot(link("a"), link("b"), joint("j", "a", "b", rpy=f"{word} 0 0")))
    (change,) = read_urdf(path, as_designed=True).changes
    assert f"read as {READ[word]} degrees" in change


@pytest.mark.parametrize(
    "dynamics", ['damping="-3"', 'friction="-2"', 'damping="-1" friction="-2"']
)
def test_negative_friction_is_refused(dynamics, file):
    text = robot(link("a"), link("b"), joint("j", "a", "b", more=f"<dynamics {dynamics}/>"))
    with pytest.raises(ModelError, match="expected none below 0"):
        extract_dh(file(text))


def test_a_gripper_of_one_finger_and_its_mimic_is_not_the_arm(file):
    fingers = [
        joint("c", "hand", "c"),
        joint("d", "hand", "d", more='<mimic joint="c" offset="0.5"/>'),
    ]
    text = robot(link("a"), link("hand"), link("c"), link("d"), joint("j", "a", "hand"), *fingers)
    with pytest.raises(
        ModelError, match=r"chains end at hand \(1 joint\), c \(2 joints\); choose one"
    ):
        extract_dh(file(text))
    assert any(
        "'d' follows 'c' in the file; here it stands at zero" in n
        for n in extract_dh(file(text), tip="c").notes
    )


@pytest.mark.parametrize("name", ["loop.stl", "x" * 900, "x" * 300 + "/y.stl", "a\u2028b.stl"])
def test_mesh_names_that_no_file_has_are_left_out(name, file, tmp_path):
    (tmp_path / "loop.stl").symlink_to("loop.stl")
    visual = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    extraction = extract_dh(file(robot(link("a"), link("b", visual), joint("j", "a", "b"))))
    assert any(
        note.startswith("link 'b': mesh") and note.endswith("left out") for note in extraction.notes
    )


def test_mesh_names_that_a_robot_file_does_not_take_are_left_out(file, tmp_path):
    for name in ("a:b.stl", "n" * 200 + ".stl"):
        (tmp_path / name).write_bytes(b"\0" * 84)
        visual = f'<visual><geometry><mesh filename="./{name}"/></geometry></visual>'
        extraction = extract_dh(file(robot(link("a"), link("b", visual), joint("j", "a", "b"))))
        assert any(note.endswith("left out") for note in extraction.notes)


@pytest.mark.parametrize(
    "shape",
    [
        '<geometry><mesh filename="m.stl" scale="1e300 1 1"/></geometry>',
        '<geometry><box size="1e300 1 1"/></geometry>',
        '<origin xyz="1e300 0 0"/><geometry><sphere radius="1"/></geometry>',
    ],
)
def test_shapes_of_odd_sizes_are_left_out(shape, file):
    extraction = extract_dh(
        file(robot(link("a"), link("b", f"<visual>{shape}</visual>"), joint("j", "a", "b")))
    )
    assert any(
        "link 'b': visual is larger than 1e+06 m or farther away; left out" in n
        for n in extraction.notes
    )


def test_names_that_clash_after_cleaning_are_told_apart(file):
    links = [link(name) for name in "abcd"]
    names = ["a_b_3", "a b", "a_b", "a/b"]
    text = robot(
        *links, link("e"), *(joint(n, p, c) for n, p, c in zip(names, "abcd", "bcde", strict=True))
    )
    found = [one.name for one in extract_dh(file(text)).description.joints]
    assert len(set(found)) == 4
    assert found[:2] == ["a_b_3", "a_b"]


def test_a_hash_in_a_path_is_part_of_it(file):
    path = file(robot(link("a"), link("b"), joint("j", "a", "b")), "c#/arm.urdf")
    for name in (path, str(path), f"{path}#b"):
        assert Arm.load(name).n == 1


def test_reserved_names_and_wrong_types_are_said(file):
    path = file(robot(link("a"), link("b"), joint("j", "a", "b")))
    with pytest.raises(ModelError, match="a link has the name 'dhkit:base'"):
        extract_dh(file(robot(link("dhkit:base")), "own.urdf"))
    with pytest.raises(TypeError, match="tip is \\['c'\\]; expected the name of a link"):
        extract_dh(path, tip=["c"])
    with pytest.raises(ModelError, match="convention is 'x'; expected one of standard, modified"):
        extract_dh(path, convention="x")
    with pytest.raises(ModelError, match="package_dirs"):
        extract_dh(path, package_dirs=["a\0b"])
    assert extract_dh(path, package_dirs=str(path.parent)).description.n == 1


@pytest.mark.parametrize("count", [33, 200, 498])
def test_too_many_joints_are_refused_at_once(count, file):
    path, begin = file(chain(count)), time.process_time()
    with pytest.raises(ModelError, match=f"{count} joints; expected 1 to 32"):
        extract_dh(path)
    assert time.process_time() - begin < 5


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("rpy", ["0 0 0", "0.3 0.2 0.1"])
def test_long_chains_are_read_within_bounds(kind, rpy, file):
    path, begin = file(chain(16, kind, rpy=rpy)), time.process_time()
    assert extract_dh(path).residual.tool < 1e-9
    assert time.process_time() - begin < 20


def test_notes_are_bounded(file):
    many = "<visual/>" * 500
    path = file(robot(link("a", many), link("b", many + "<collision/>"), joint("j", "a", "b")))
    arm = Arm.from_urdf(path)
    assert len(arm.description.notes) < 20_001
    write_robot(arm.description, path.parent / "arm.toml")
    assert Arm.load(path.parent / "arm.toml") == arm


def test_a_tiny_arm_keeps_its_digits_and_a_huge_one_its_verdict(file):
    small = file(chain(3, xyz="3.87738925e-07 1.2345678e-07 0", rpy="0.3 0.2 0"))
    extraction = extract_dh(small)
    assert truth(small, extraction.description) < 1e-9 * 1e-6
    huge = file(chain(3, xyz="1e9 2e8 0", rpy="0.3 0.2 0"))
    assert extract_dh(huge).residual.tool < 1e-9 * 1e9


@pytest.mark.parametrize("axis", ["1e-200 0 0", "1e300 0 1e300", "1e300 0 0"])
def test_axes_of_any_length_are_directions(axis, file):
    extraction = extract_dh(file(robot(link("a"), link("b"), joint("j", "a", "b", axis=axis))))
    assert any("axis has length" in note for note in extraction.notes)


@pytest.mark.parametrize(
    "xyz", ["٠.٤ 0 0", "０.4 0 0", ".4\u00a00\u00a00", "0x1 0 0", "1e99999 0 0"]
)
def test_only_ascii_numbers_are_numbers(xyz, file):
    with pytest.raises(ModelError, match="expected a finite number"):
        extract_dh(file(robot(link("a"), link("b"), joint("j", "a", "b", xyz=xyz))))


def test_infinite_effort_is_unlimited(file):
    limit = '<limit lower="-1" upper="1" effort="inf" velocity="Infinity"/>'
    extraction = extract_dh(file(robot(link("a"), link("b"), joint("j", "a", "b", limit=limit))))
    assert extraction.description.numbers.effort.tolist() == [np.inf]
    assert sum("read as unlimited" in note for note in extraction.notes) == 2


def test_hints_for_xacro(file):
    for text, hint in (
        (
            '<robot xmlns:xacro="x"><xacro:macro name="m"/></robot>',
            "has elements of xacro; run xacro on it first",
        ),
        (robot(link("a"), link("b"), joint("j", "a", "b", xyz="${l1} 0 0")), "run xacro first"),
    ):
        with pytest.raises(ModelError, match=hint.replace("$", r"\$")):
            extract_dh(file(text))


def test_a_parallel_table_is_parallel(file):
    path = file(
        robot(
            link("a"),
            link("b"),
            link("c"),
            joint("j", "a", "b"),
            joint("k", "b", "c", xyz="0.4 0 0", rpy="2e-11 0 0"),
        )
    )
    extraction = extract_dh(path)
    assert any("taken as parallel" in note and "otherwise" in note for note in extraction.notes)
    assert extraction.description.numbers.alpha[0] == 0


def test_links_given_twice_are_said(file, capsys):
    from dhkit.cli import main

    path = file(robot(link("a"), link("b"), joint("j", "a", "b")))
    for arguments in (
        ["extract", f"{path}#b", "--tip", "a"],
        ["extract", str(path), "--base", "", "--tip", "b"],
    ):
        with pytest.raises((SystemExit, DhkitError)) as stopped:
            main(arguments)
        assert stopped.value.code == 2
        assert capsys.readouterr().err.count("\n") == 1
