"""Tables found in URDFs: random tables come back, published ones are found, degenerate axes have tidy ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import dhkit
from acceptance import different_robots_first
from dhkit.description import (
    Base,
    Description,
    Placement,
    Tool,
    from_dh,
    library_robot,
    world_to_tool,
)
from dhkit.expressions import exact
from dhkit.model import extract_dh, urdf_text
from dhkit.model.urdf import write_urdf

CLOSE = 1e-10
"""m and rotation entries, of tables that are written with 9 decimals and more."""
SEEN = 1e-9
"""m or rad: a smaller entry is rounding."""

length = st.one_of(
    st.just(0.0),
    st.sampled_from([0.1, 0.25, -0.3, 0.4]),
    st.floats(0.05, 0.9).map(lambda x: round(x, 6)),
)
turn = st.one_of(
    st.sampled_from([0.0, 0.0, "pi/2", "-pi/2", "pi", "pi/4"]),
    st.floats(0.1, 1.4).map(lambda x: round(x, 6)),
    st.floats(-3.0, -1.7).map(lambda x: round(x, 6)),
)
rarely = st.one_of(st.just(0.0), st.just(0.0), st.floats(0.1, 1.2).map(lambda x: round(x, 6)))


@st.composite
def placements(draw):
    xyz, rpy = (tuple(exact(draw(rarely)) for _ in range(3)) for _ in range(2))
    return Placement(xyz, rpy)


@st.composite
def degenerate_arms(draw, least=2, most=7) -> Description:
    """Draw an arm with axes that are often parallel, coincident or intersecting, and with prismatic joints inside."""
    rows = draw(st.lists(st.tuples(turn, length, length, turn), min_size=least, max_size=most))
    arm = from_dh(
        rows,
        kinds="".join(draw(st.sampled_from("RRRP")) for _ in rows),
        convention=draw(st.sampled_from(["standard", "modified"])),
    )
    base = Base(draw(placements())) if draw(st.booleans()) else arm.base
    tool = Tool(draw(placements())) if draw(st.booleans()) else arm.tool
    return replace(arm, base=base, tool=tool)


def entries(description: Description) -> int:
    """Return how many numbers of table, base and tool are not zero."""
    n = description.numbers
    poses = [
        float(value)
        for placement in (description.base.placement, description.tool.placement)
        for value in (*placement.xyz, *placement.rpy)
    ]
    values = np.concatenate([n.theta, n.d, n.a, n.alpha, poses])
    return int(np.sum(np.abs(values) > SEEN))


def states(description: Description, count: int, seed: int = 0):
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (count, description.n))


def test_random_tables_come_back_and_are_as_tidy(law, tmp_path_factory):
    file = tmp_path_factory.mktemp("random") / "arm.urdf"

    @settings(max_examples=law.samples(1000, quick=10))
    @given(degenerate_arms(), st.sampled_from(["standard", "modified"]))
    def check(arm, convention):
        file.write_text(urdf_text(arm))
        extraction = extract_dh(file, tip="tool", convention=convention)
        found = extraction.description
        q = states(arm, 10)
        law.holds("tool", np.abs(world_to_tool(found, q) - world_to_tool(arm, q)).max(), CLOSE, arm)
        if convention == arm.convention.value:
            law.holds("entries more than the generator's", entries(found) - entries(arm), 0, arm)

    check()


@pytest.mark.parametrize("name", different_robots_first(dhkit.robots()))
def test_the_library_comes_back(name, tmp_path):
    arm = library_robot(name)
    write_urdf(arm, tmp_path / "arm.urdf")
    found = extract_dh(tmp_path / "arm.urdf", convention=arm.convention.value).description
    assert entries(found) <= entries(arm)
    q = states(arm, 20)
    assert np.abs(world_to_tool(found, q) - world_to_tool(arm, q)).max() < CLOSE
    assert [joint.name for joint in found.joints] == [joint.name for joint in arm.joints]
    assert (
        np.allclose(found.numbers.mass, np.nan_to_num(arm.numbers.mass))
        or np.isnan(arm.numbers.mass).any()
    )


def urdf_of(joints) -> str:
    """Return a URDF of joints in a row: xyz, rpy, axis, kind."""
    parts = ['<robot name="chain"><link name="l0"/>']
    for k, (xyz, rpy, axis, kind) in enumerate(joints, start=1):
        limit = '<limit lower="-3" upper="3" effort="10" velocity="2"/>' if kind != "fixed" else ""
        parts.append(
            f'<link name="l{k}"/><joint name="j{k}" type="{kind}"><parent link="l{k - 1}"/><child link="l{k}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}</joint>'
        )
    return "".join(parts) + "</robot>"


H = "1.5707963267948966"
UR5 = [
    # ur_description of ROS-Industrial, from Universal Robots' own table
    ("0 0 0.089159", "0 0 0", "0 0 1", "revolute"),
    ("0 0.13585 0", f"0 {H} 0", "0 1 0", "revolute"),
    ("0 -0.1197 0.425", "0 0 0", "0 1 0", "revolute"),
    ("0 0 0.39225", f"0 {H} 0", "0 1 0", "revolute"),
    ("0 0.093 0", "0 0 0", "0 0 1", "revolute"),
    ("0 0 0.09465", "0 0 0", "0 1 0", "revolute"),
    ("0 0.0823 0", f"-{H} 0 0", "1 0 0", "fixed"),
]
PANDA = [
    # franka_description; Franka's table is in Craig's convention
    ("0 0 0.333", "0 0 0", "0 0 1", "revolute"),
    ("0 0 0", f"-{H} 0 0", "0 0 1", "revolute"),
    ("0 -0.316 0", f"{H} 0 0", "0 0 1", "revolute"),
    ("0.0825 0 0", f"{H} 0 0", "0 0 1", "revolute"),
    ("-0.0825 0.384 0", f"-{H} 0 0", "0 0 1", "revolute"),
    ("0 0 0", f"{H} 0 0", "0 0 1", "revolute"),
    ("0.088 0 0", f"{H} 0 0", "0 0 1", "revolute"),
    ("0 0 0.107", "0 0 0", "1 0 0", "fixed"),
]
IIWA = [
    # KUKA LBR iiwa 7 R800: lengths 0.34, 0.4, 0.4 and 0.126 m of its data sheet
    ("0 0 0.15", "0 0 0", "0 0 1", "revolute"),
    ("0 0 0.19", f"{H} 0 3.141592653589793", "0 0 1", "revolute"),
    ("0 0.21 0", f"{H} 0 3.141592653589793", "0 0 1", "revolute"),
    ("0 0 0.19", f"{H} 0 0", "0 0 1", "revolute"),
    ("0 0.21 0", f"-{H} 3.141592653589793 0", "0 0 1", "revolute"),
    ("0 0.06070 0.19", f"{H} 0 0", "0 0 1", "revolute"),
    ("0 0.081 0.06070", f"-{H} 3.141592653589793 0", "0 0 1", "revolute"),
    ("0 0 0.045", "0 0 0", "1 0 0", "fixed"),
]


def table_of(joints, tmp_path, **options) -> Description:
    (tmp_path / "arm.urdf").write_text(urdf_of(joints))
    extraction = extract_dh(tmp_path / "arm.urdf", **options)
    assert extraction.residual.largest < 5e-10
    return extraction.description


@pytest.mark.parametrize(
    ("lengths", "published"),
    [
        ((0.089159, 0.425, 0.39225, 0.10915, 0.09465, 0.0823), "ur5"),
        ((0.1519, 0.24365, 0.21325, 0.11235, 0.08535, 0.0819), "ur3"),
        ((0.1273, 0.612, 0.5723, 0.163941, 0.1157, 0.0922), "ur10"),
    ],
)
def test_universal_robots_tables_are_found(lengths, published, tmp_path):
    d1, a2, a3, d4, d5, d6 = lengths
    joints = list(UR5)
    shoulder, elbow = d4 + 0.03, 0.02
    joints[0] = (f"0 0 {d1}", *joints[0][1:])
    joints[1] = (f"0 {shoulder} 0", *joints[1][1:])
    joints[2] = (f"0 -{shoulder - elbow} {a2}", *joints[2][1:])
    joints[3] = (f"0 0 {a3}", *joints[3][1:])
    joints[4] = (f"0 {d4 - elbow} 0", *joints[4][1:])
    joints[5] = (f"0 0 {d5}", *joints[5][1:])
    joints[6] = (f"0 {d6} 0", *joints[6][1:])
    found = table_of(joints, tmp_path).numbers
    # Free: the side that x_2 ... points to, and with it signs of a and alpha; the tool's turn about z_6.
    assert found.d == pytest.approx([d1, 0, 0, d4, d5, d6], abs=1e-12)
    assert np.abs(found.a) == pytest.approx([0, a2, a3, 0, 0, 0], abs=1e-12)
    assert np.abs(found.cos_alpha) == pytest.approx([0, 1, 1, 0, 0, 1], abs=1e-12)
    library = library_robot(published).numbers
    assert np.abs(found.a) == pytest.approx(np.abs(library.a), abs=1e-12)


def test_the_pandas_table_is_found_digit_for_digit(tmp_path):
    found = table_of(PANDA, tmp_path, convention="modified")
    n, h = found.numbers, np.pi / 2
    assert n.a.tolist() == [0, 0, 0, 0.0825, -0.0825, 0, 0.088]
    assert n.d.tolist() == [0.333, 0, 0.316, 0, 0.384, 0, 0]
    assert n.alpha.tolist() == [0, -h, h, h, -h, h, h]
    assert not n.theta.any()
    assert np.array_equal(n.T_world_base, np.eye(4))
    assert np.array_equal(n.T_last_tool, dhkit.pose((0, 0, 0.107)))


def test_the_iiwas_table_is_found(tmp_path):
    found = table_of(IIWA, tmp_path).numbers
    assert found.d == pytest.approx([0.34, 0, 0.4, 0, 0.4, 0, 0.126], abs=1e-12)
    assert not found.a.any()
    assert np.abs(found.sin_alpha).tolist() == [1, 1, 1, 1, 1, 1, 0]
    assert np.array_equal(found.T_world_base, np.eye(4))


AXES = {
    "parallel": (
        [
            ("0 0 0", "0 0 0", "0 0 1"),
            ("0.3 0.4 0.2", "0 0 0", "0 0 1"),
            ("0.1 0 0.5", "0 0 0", "0 0 1"),
        ],
        3,
    ),
    "anti-parallel": (
        [
            ("0 0 0", "0 0 0", "0 0 1"),
            ("0.3 0 0", "0 0 0", "0 0 -1"),
            ("0.2 0 0", "0 0 0", "0 0 1"),
        ],
        4,
    ),
    "coincident": (
        [
            ("0 0 0.1", "0 0 0", "0 0 1"),
            ("0 0 0.2", "0 0 0", "0 0 1"),
            ("0 0 0.3", "0 0 0", "0 0 1"),
        ],
        1,
    ),
    "intersecting": (
        [("0 0 0", "0 0 0", "0 0 1"), ("0 0 0", "0 0 0", "1 0 0"), ("0 0 0", "0 0 0", "0 1 0")],
        5,
    ),
}


@pytest.mark.parametrize("name", AXES)
@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_degenerate_axes_have_tidy_tables(name, convention, tmp_path):
    joints, most = AXES[name]
    found = table_of([(*joint, "revolute") for joint in joints], tmp_path, convention=convention)
    assert entries(found) <= most + 2


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_one_joint_is_a_chain(convention, kind, tmp_path):
    found = table_of([("0.1 0.2 0.3", "0.4 0 0", "0 1 0", kind)], tmp_path, convention=convention)
    assert found.n == 1


def tilted(eps: float):
    """Return two axes with a lever of 0.4 m, eps from parallel, and a third."""
    return [
        ("0 0 0", "0 0 0", "0 0 1", "revolute"),
        ("0.4 0 0", f"{eps!r} 0 0", "0 0 1", "revolute"),
        ("0.3 0 0.1", f"{H} 0 0", "0 0 1", "revolute"),
    ]


@pytest.mark.parametrize("eps", [1e-12, 1e-11, 1e-7, 1e-6, 3.7e-6, 1e-3])
def test_nearly_parallel_axes_take_the_better_treatment(eps, tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf_of(tilted(eps)))
    extraction = extract_dh(tmp_path / "arm.urdf")
    assert extraction.residual.tool < 1e-9
    said = any("from parallel" in note for note in extraction.notes)
    assert said == (1e-13 < eps < 1e-5)


@pytest.mark.parametrize("eps", [1e-9, 1e-8, 3e-8])
def test_no_table_of_doubles_holds_these_tilts_and_the_residual_says_so(eps, tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf_of(tilted(eps)))
    extraction = extract_dh(tmp_path / "arm.urdf")
    # the parallel table misses by about eps times the lever, the exact normal by 2.6e-17 / eps
    assert extraction.residual.tool < 3 * min(0.8 * eps, 1e-16 / eps)
    assert any("from parallel" in note and "tool within" in note for note in extraction.notes)


def test_a_true_offset_of_hundreds_of_metres_stays(tmp_path):
    # calibrated arms of Universal Robots have axes 2, 3 and 4 a milliradian from parallel
    joints = list(UR5)
    joints[2] = (joints[2][0], "0.0007 0 0.0005", *joints[2][2:])
    joints[3] = (joints[3][0], f"0.0004 {H} 0.0006", *joints[3][2:])
    (tmp_path / "arm.urdf").write_text(urdf_of(joints))
    extraction = extract_dh(tmp_path / "arm.urdf")
    assert extraction.residual.tool < 1e-10
    assert np.abs(extraction.description.numbers.d).max() > 50


def test_as_designed_reads_rounded_right_angles(tmp_path):
    joints = [(xyz, rpy.replace(H, "1.5708"), axis, kind) for xyz, rpy, axis, kind in PANDA]
    (tmp_path / "arm.urdf").write_text(urdf_of(joints))
    written = extract_dh(tmp_path / "arm.urdf", convention="modified")
    assert written.residual.largest < 5e-10
    # A micrometre, as the file has it.
    assert 1e-7 < np.abs(written.description.numbers.d[1]) < 1e-5
    designed = extract_dh(tmp_path / "arm.urdf", convention="modified", as_designed=True)
    assert designed.description.numbers.d.tolist() == [0.333, 0, 0.316, 0, 0.384, 0, 0]
    assert len(designed.changes) == 6
    assert 1e-6 < designed.residual.tool < 1e-4
    assert any("read as designed: 6 numbers" in note for note in designed.notes)
