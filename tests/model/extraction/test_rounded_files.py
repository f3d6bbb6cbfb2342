"""Tables of URDFs whose angles are rounded: no lengths of kilometres, and residuals no larger than the rounding."""

import re

import numpy as np
import pytest

from acceptance import ACCEPTING, slow_if
from dhkit import Arm
from dhkit.description import asset, library_robot, robots, world_to_tool
from dhkit.errors import ModelError
from dhkit.model import example_chains, extract_dh
from dhkit.model.extraction.extraction import extracted
from dhkit.model.extraction.residual import Original
from dhkit.model.urdf_chain import chain_of
from dhkit.model.urdf_reader import read_urdf
from dhkit.verification import verify_urdf

LENGTHS = 3.0
"""Largest length of a table, in lengths of the longest offset of the file."""


def with_rounded_angles(text, decimals):
    """Return a URDF with all angles rounded."""

    def rounded(match):
        if "$" in match[2]:
            return match[0]
        words = [
            f"{float(word):.{decimals}f}" if abs(float(word) - round(float(word))) > 1e-12 else word
            for word in match[2].split()
        ]
        return f'{match[1]}"{" ".join(words)}"'

    return re.sub(r"(rpy\s*=\s*)[\"']([^\"']*)[\"']", rounded, text)


def library_urdfs():
    return [
        (name, asset(f"urdf/{name}.urdf"), None, None)
        for name in robots()
        if library_robot(name).n > 1
    ]


def example_urdfs():
    try:
        chains = list(example_chains()) if ACCEPTING else []
    except ModelError:
        return []
    return [(one.name, one.path, one.base, one.tip) for one in chains if 2 <= len(one.joints) <= 7]


@pytest.mark.parametrize("decimals", [3, slow_if(True, 4), slow_if(True, 5), slow_if(True, 6)])
def test_tables_of_rounded_files_are_as_large_as_the_arm(law, decimals, tmp_path):
    file = tmp_path / "rounded.urdf"
    every = [*library_urdfs(), *example_urdfs()]
    for name, path, base, tip in every if ACCEPTING else every[decimals % 4 :: 4]:
        file.write_text(with_rounded_angles(path.read_text(), decimals))
        chain = chain_of(read_urdf(file), base, tip)
        extraction = extracted(chain)
        arm = extraction.description
        path_to_tip = chain.tree.joints_to(chain.tip, chain.base)
        own = max(float(np.linalg.norm(joint.T_parent_joint[:3, 3])) for joint in path_to_tip)
        longest = float(max(np.abs(arm.numbers.a).max(), np.abs(arm.numbers.d).max()))
        law.holds(
            "largest length over the file's own", longest / own if own else longest, LENGTHS, name
        )
        original = Original(chain)
        off = np.linalg.norm(
            (world_to_tool(arm, original.q) - original.tool)[:, :3, 3], axis=1
        ).max()
        rounding = 10.0**-decimals * max(arm.reach, original.size)
        law.holds(
            "residual over reach times a unit of the last decimal", float(off) / rounding, 1.0, name
        )


@pytest.mark.parametrize("name", ["ur5", slow_if(True, "panda"), slow_if(True, "irb140")])
def test_what_is_computed_of_a_rounded_file_agrees(name, tmp_path):
    """verify, the comparison with the file, and inverse kinematics by iteration, as for the exact file."""
    file = tmp_path / "rounded.urdf"
    file.write_text(with_rounded_angles(asset(f"urdf/{name}.urdf").read_text(), 4))
    arm = Arm.load(file)
    assert arm.verify(samples=50).ok
    assert verify_urdf(arm.description, file, samples=50).ok
    assert verify_urdf(library_robot(name), file, tip="tool", samples=50).ok
    exact = Arm.load(name)
    low = exact.limits.lower.clip(-np.pi)
    high = exact.limits.upper.clip(None, np.pi)
    q = np.random.default_rng(0).uniform(low, high, (40, exact.n))
    found = arm.ik_numeric(arm.fk(q))
    expected = exact.ik_numeric(exact.fk(q))
    assert found.valid.sum() >= expected.valid.sum() - 1


def test_exact_keeps_the_axes_of_the_file(tmp_path):
    """Two axes of the SO-100 kind: 1.5708 leaves them 3.7e-6 rad from parallel."""
    file = tmp_path / "rounded.urdf"
    file.write_text(
        with_rounded_angles(asset("urdf/ur5.urdf").read_text(), 4).replace(
            'rpy="0 0 0"', 'rpy="1e-5 0 0"'
        )
    )
    kept = extract_dh(file, exact=True)
    made = extract_dh(file)
    assert kept.residual.tool < 1e-8
    assert kept.turned == 0
    assert any("made parallel" in note for note in made.notes) == (made.turned > 0)


def test_angles_of_half_a_turn_less_a_rounded_right_angle_are_designed(tmp_path):
    """The files of Universal Robots write 1.570796327 beside 1.570796326589793 = pi - 1.570796327."""
    file = tmp_path / "arm.urdf"
    text = asset("urdf/ur5.urdf").read_text()
    assert '"1.5707963267948966' in text
    file.write_text(text.replace('"1.5707963267948966', '"1.570796326589793'))
    assert "closed form, 8 branches" in str(Arm.load(file, as_designed=True).family)
    assert "as_designed=True (--as-designed)" in str(Arm.load(file).family)


@pytest.mark.slow
def test_a_smaller_table_as_designed_is_recommended(tmp_path):
    file = tmp_path / "rounded.urdf"
    advice = "as_designed=True (--as-designed) gives a smaller table"
    for name in robots() if ACCEPTING else robots()[::3]:
        if library_robot(name).n < 2:
            continue
        file.write_text(with_rounded_angles(asset(f"urdf/{name}.urdf").read_text(), 3))
        written = extract_dh(file)
        designed = extract_dh(file, as_designed=True)

        def lengths(extraction):
            numbers = extraction.description.numbers
            return np.count_nonzero(np.concatenate([numbers.a, numbers.d]))

        assert any(advice in note for note in written.notes) == (
            lengths(designed) < lengths(written)
        ), name
        assert not any(advice in note for note in designed.notes)


def chain_text(joints):
    """Return a URDF of a chain of continuous joints about z, each with an xyz and an rpy."""
    links = "".join(f'<link name="l{k}"/>' for k in range(len(joints) + 1))
    parts = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k - 1}"/><child link="l{k}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/></joint>'
        for k, (xyz, rpy) in enumerate(joints, start=1)
    )
    return f'<robot name="r">{links}{parts}</robot>'


def longest_length(path):
    numbers = extract_dh(path).description.numbers
    return float(np.abs([numbers.a, numbers.d]).max())


@pytest.mark.parametrize(
    "joints",
    [
        [("0 0 0", "3.1416 0 3.1416"), ("0 0 0", "-3.1416 0 0"), ("0 -0.1 0.3", "0 0 0")],
        [
            ("0 0 0", "0 0 3.14159"),
            ("0.1 0.2 0", "-3.14159 0 0"),
            ("0.3 0 0.1", "0 0 0"),
            ("0 0.2 0", "0 3.14159 0"),
        ],
        [
            ("0 0 0", "0 0 1.570796"),
            ("0.4 0 0", "1.570796 1.570796 0"),
            ("0 -0.4 0", "1.570796 0 0"),
        ],
    ],
)
def test_axes_that_are_parallel_in_the_file_follow_one_that_is_made_parallel(joints, tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(chain_text(joints))
    assert longest_length(file) < 1


def test_a_tilt_that_is_written_stays_though_another_angle_is_rounded(tmp_path):
    file = tmp_path / "arm.urdf"
    for right_angle in ("1.571", "1.5707963", "-1.571"):
        file.write_text(
            chain_text(
                [("0 0 0.1", "0 0 0"), ("0.4 0 0", f"0.001 0 {right_angle}"), ("0 0.2 0", "0 0 0")]
            )
        )
        extraction = extract_dh(file)
        assert extraction.turned == 0
        assert extraction.residual.tool < 1e-9


@pytest.mark.slow
def test_random_arms_with_parallel_axes_and_rounded_angles_have_short_tables(law, tmp_path):
    rng = np.random.default_rng(4)
    file = tmp_path / "arm.urdf"
    for _ in range(law.samples(300, quick=8)):
        digits = int(rng.integers(3, 7))
        joints = []
        for _ in range(int(rng.integers(2, 8))):
            xyz = " ".join(f"{x:.4f}" for x in rng.uniform(-0.5, 0.5, 3) * rng.integers(0, 2, 3))
            rpy = " ".join(f"{np.pi * k:.{digits}f}" for k in rng.integers(-1, 2, 3))
            joints.append((xyz, rpy))
        file.write_text(chain_text(joints))
        law.holds("longest length, m", longest_length(file), 3.0, joints)
