"""Which chain is cut out of a URDF, and what becomes of what hangs beside it, held to Pinocchio's reduced models."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from dhkit import Arm
from dhkit.description import read_robot
from dhkit.errors import DhkitError, ModelError
from dhkit.model import extract_dh, urdf_source
from dhkit.model.robot_folder import write_robot_with_meshes
from dhkit.model.urdf_chain import read_chain
from dhkit.verification import verify_urdf


def link(name: str, mass: float = 1.0, shape: str = "") -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="0.1 0.02 -0.03" rpy="0.1 0.2 0.3"/><mass value="{mass}"/>'
        f'<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0.002" izz="0.04"/></inertial>{shape}</link>'
    )


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    axis: str = "0 1 0",
    rpy: str = "0.3 0 0",
) -> str:
    limit = (
        '<limit lower="-1" upper="2" effort="7" velocity="3"/>'
        if kind in ("revolute", "prismatic")
        else ""
    )
    friction = '<dynamics damping="0.5" friction="0.2"/>' if name == "elbow" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.2 0.1 0.3" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}{friction}</joint>'
    )


BOX = '<visual><origin xyz="0 0 0.1"/><geometry><box size="0.1 0.1 0.2"/></geometry></visual>'
TREE = (
    '<robot name="two_arms">'
    + "".join(
        link(name, 1 + k, BOX)
        for k, name in enumerate(
            ["pelvis", "torso", "upper", "fore", "hand", "thumb", "head", "camera", "left"]
        )
    )
    + joint("waist", "pelvis", "torso", "prismatic", "0 0 1", "0.2 0.4 0")
    + joint("shoulder", "torso", "upper")
    + joint("elbow", "upper", "fore", "continuous", "0 0.6 0.8")
    + joint("wrist", "fore", "hand", "prismatic", "1 0 0")
    + joint("thumb_joint", "hand", "thumb", axis="1 0 0")
    + joint("neck", "torso", "head")
    + joint("mount", "fore", "camera", "fixed")
    + joint("left_shoulder", "torso", "left")
    + "</robot>"
)


@pytest.fixture
def tree(tmp_path):
    (tmp_path / "tree.urdf").write_text(TREE)
    return tmp_path / "tree.urdf"


def reduced(path, kept):
    """Return Pinocchio's own reduced model of the file with other joints at neutral."""
    model = pin.buildModelFromUrdf(str(path))
    locked = [model.getJointId(name) for name in model.names[1:] if name not in kept]
    return pin.buildReducedModel(model, locked, pin.neutral(model))


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize(
    ("base", "tip"),
    [("pelvis", "hand"), ("torso", "hand"), ("upper", "thumb"), ("torso", "camera")],
)
def test_a_chain_is_the_reduced_model(tree, base, tip, convention, law):
    extraction = extract_dh(tree, base, tip, convention=convention)
    arm, names = Arm(extraction.description), [one.name for one in extraction.description.joints]
    model = reduced(tree, names)
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in names]
    for q in np.random.default_rng(0).uniform(-1, 1, (law.samples(1000), arm.n)):
        full = pin.neutral(model)
        for name, value in zip(names, q, strict=True):
            one = model.joints[model.getJointId(name)]
            full[one.idx_q : one.idx_q + one.nq] = (
                [np.cos(value), np.sin(value)] if one.nq == 2 else [value]
            )
        pin.framesForwardKinematics(model, data, full)
        T = (
            data.oMf[model.getFrameId(base)].inverse() * data.oMf[model.getFrameId(tip)]
        ).homogeneous
        law.holds("tool", np.abs(arm.fk(q) - T).max(), 1e-9)
        M = pin.crba(model, data, full)
        M = (np.triu(M) + np.triu(M, 1).T)[np.ix_(order, order)]
        law.holds("M", np.abs(arm.mass_matrix(q) - M).max() / np.abs(M).max(), 1e-9)
        g = pin.computeGeneralizedGravity(model, data, full)[order]
        law.holds("g", np.abs(arm.gravity_torque(q) - g).max() / np.abs(g).max(), 1e-9)


def test_gravity_is_the_roots_seen_from_the_base(tree):
    gravity = extract_dh(tree, "upper", "hand").description.numbers.gravity
    chain = read_chain(tree, "upper", "hand")
    R = chain.tree.zero_poses()["upper"][:3, :3]
    assert gravity == pytest.approx(R.T @ (0, 0, -9.81), abs=1e-9)
    assert np.linalg.norm(gravity) == pytest.approx(9.81, abs=1e-9)


def test_what_hangs_beside_is_carried_along_or_dropped(tree):
    frozen, dropped = (extract_dh(tree, "torso", "hand", side=side) for side in ("freeze", "drop"))
    # pelvis 1, torso 2, upper 3, fore 4 with camera 8, hand 5 with thumb 6; head 7 and left 9 hang on the torso
    assert frozen.description.numbers.mass == pytest.approx([3, 4 + 8, 5 + 6])
    assert frozen.description.numbers.base_body[0] == pytest.approx(2 + 7 + 9)
    assert dropped.description.numbers.mass == pytest.approx([3, 4 + 8, 5])
    assert dropped.description.numbers.base_body[0] == pytest.approx(2)
    assert any(
        "stand at zero, their links carried along: thumb_joint, neck, left_shoulder" in n
        for n in frozen.notes
    )
    assert any("left out: head, left, thumb" in n for n in dropped.notes)
    assert dropped.residual.largest < 5e-10
    assert len(frozen.description.joints[2].shapes) == 2
    assert len(dropped.description.joints[2].shapes) == 1


def test_limits_friction_and_shapes_are_the_files(tree):
    found = extract_dh(tree, tip="hand").description
    numbers = found.numbers
    assert numbers.lower.tolist() == [-1, -1, -np.inf, -1]
    assert numbers.upper.tolist() == [2, 2, np.inf, 2]
    assert numbers.effort.tolist() == [7, 7, np.inf, 7]
    assert numbers.velocity.tolist() == [3, 3, np.inf, 3]
    assert (numbers.viscous[2], numbers.coulomb[2].tolist()) == (0.5, [0.2, -0.2])
    chain = read_chain(tree, tip="hand")
    arm = Arm(found)
    frame = arm.frames(np.zeros(4))[4]
    T = np.eye(4)
    from dhkit.description.numbers import matrix

    (box, *_), T[2, 3] = found.joints[3].shapes, 0.1
    assert frame @ matrix(box.placement, {}) == pytest.approx(
        chain.zero_poses["hand"] @ T, abs=1e-9
    )


@pytest.mark.slow
def test_several_tips_are_listed_and_none_is_taken_in_silence(tree):
    with pytest.raises(
        ModelError,
        match=r"chains end at torso \(1 joint\), thumb \(5 joints\), head \(2 joints\), camera \(3 joints\), left",
    ):
        extract_dh(tree)
    with pytest.raises(ModelError, match=r"choose one \(tip\)"):
        Arm.load(tree)
    assert Arm.load(tree, tip="hand").n == 4
    assert Arm.load(f"{tree}#hand") == Arm.load(tree, tip="hand")
    assert Arm.load(f"{tree}#torso..hand").n == 3
    assert Arm.from_urdf(tree, base="torso", tip="hand", convention="modified").n == 3
    assert extract_dh(tree, "fore").description.n == 2


def test_wrong_links_are_said(tree):
    with pytest.raises(ModelError, match="tip: no link 'x'; it has pelvis, torso"):
        extract_dh(tree, tip="x")
    with pytest.raises(
        ModelError, match="base 'head' is not on the way from the root to tip 'hand'"
    ):
        extract_dh(tree, "head", "hand")
    with pytest.raises(ModelError, match="tip 'torso'; swap base and tip"):
        extract_dh(tree, "hand", "torso")
    with pytest.raises(ModelError, match="no moving joints from link 'fore' to link 'camera'"):
        extract_dh(tree, "fore", "camera")
    with pytest.raises(ModelError, match="side is 'x'; expected 'freeze' or 'drop'"):
        extract_dh(tree, tip="hand", side="x")
    with pytest.raises(DhkitError, match="base and tip cut a chain out of a URDF"):
        Arm.load("puma560", tip="x")
    assert urdf_source("a/b.urdf#x..y")[1:] == ("x", "y")
    assert urdf_source("a/b.urdf#..y")[1:] == (None, "y")


def test_the_table_verifies_against_its_file(tree):
    found = extract_dh(tree, "torso", "hand").description
    report = verify_urdf(found, tree, "hand", samples=20, base="torso")
    assert report.ok, str(report)
    assert any("yourdfpy" in note and "same frames" in note for note in report.notes)


def test_frames_before_the_tool_do_not_make_several_chains(tmp_path):
    from dhkit.model import write_urdf

    write_urdf(Arm.load("puma560").description, tmp_path / "puma.urdf")
    assert Arm.load(tmp_path / "puma.urdf").n == 6


def test_an_arm_without_any_inertial_has_no_bodies(tmp_path):
    import re

    (tmp_path / "bare.urdf").write_text(re.sub(r"<inertial>.*?</inertial>", "", TREE))
    found = extract_dh(tmp_path / "bare.urdf", tip="hand")
    assert not any(joint.bodies for joint in found.description.joints)
    assert found.residual.mass_matrix is None


def test_a_robot_file_takes_its_meshes_along(tmp_path):
    puma = Arm.load("puma560").description
    files = write_robot_with_meshes(puma, tmp_path / "puma.toml")
    again = read_robot(tmp_path / "puma.toml")
    assert len(files) > 5
    assert again.mesh_folder == tmp_path
    assert all(
        (tmp_path / shape.geometry.path).is_file() for one in again.joints for shape in one.shapes
    )
    (tmp_path / "file").touch()
    with pytest.raises(ModelError, match=r"Not a directory|File exists"):
        write_robot_with_meshes(puma, tmp_path / "file" / "puma.toml")
    assert write_robot_with_meshes(puma, tmp_path / "new" / "folder" / "puma.toml")[0].is_file()


def test_without_pinocchio_the_tool_is_held_to_the_files_own_transforms(tree, monkeypatch):
    from dhkit.model.extraction import residual
    from dhkit.model.reference import NoPinocchioError

    def missing(chain):
        raise NoPinocchioError("Pinocchio cannot be imported (blocked)")

    monkeypatch.setattr(residual, "chain_model", missing)
    extraction = extract_dh(tree, tip="hand")
    assert extraction.residual.tool < 1e-10
    assert extraction.residual.mass_matrix is None
    assert any("Pinocchio is not installed" in note for note in extraction.notes)
