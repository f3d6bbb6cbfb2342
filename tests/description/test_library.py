"""The library: complete, sourced, within its own limits; and how its four PUMA tables relate."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dhkit.description import (
    Convention,
    library_robot,
    lock,
    pose,
    robots,
    with_base,
    with_tool,
    world_to_frames,
    world_to_tool,
)
from dhkit.errors import DescriptionError
from dhkit.expressions import exact

EXPECTED = [
    "adept_viper_s850",
    "al5d",
    "ax12_arm",
    "cart_pendulum",
    "cobra600",
    "irb140",
    "jaco",
    "kr5",
    "kuka_kr30_3",
    "manutec_r3",
    "pan_tilt",
    "panda",
    "planar2r",
    "planar3r",
    "polar_rp",
    "puma560",
    "puma560_akb",
    "puma560_cao",
    "puma560_cao_printed",
    "stanford",
    "ur10",
    "ur3",
    "ur5",
]
PUBLISHED_BODIES = {"manutec_r3", "puma560", "puma560_akb", "ur10", "panda"}
ROUNDED = 1e-15  # of coordinates of about 1 m, a few roundings


def test_the_robots_are_there():
    assert list(robots()) == EXPECTED


def test_an_unknown_robot_is_named_with_what_comes_near():
    with pytest.raises(
        DescriptionError, match="no robot 'puma56' in the library; did you mean 'puma560'"
    ):
        library_robot("puma56")
    with pytest.raises(DescriptionError, match="there are adept_viper_s850, al5d"):
        library_robot("../../etc/passwd")


@pytest.mark.parametrize("name", EXPECTED)
def test_a_robot_is_complete_and_says_where_it_comes_from(name):
    arm = library_robot(name)
    assert arm.name == name
    assert arm.source
    assert {"zero", "ready"} <= set(arm.configurations)
    assert not np.any(arm.numbers.configurations["zero"])
    for joint in arm.joints:
        for key in ("limits", "velocity", "effort", "body", "drive"):
            assert getattr(joint, key) is not None, (joint.name, key)
        if name not in PUBLISHED_BODIES:
            assert "body" in joint.assumed
        else:
            assert "body" not in joint.assumed
    if any(joint.assumed for joint in arm.joints):
        assert arm.notes


@pytest.mark.parametrize("name", sorted(set(EXPECTED) - PUBLISHED_BODIES))
def test_assumed_bodies_are_possible(name):
    assert not [
        warning
        for warning in library_robot(name).warnings
        if not warning.startswith("configurations.")
    ]


@pytest.mark.parametrize("name", EXPECTED)
def test_the_motors_can_hold_the_arm(name):
    """Gravity's torque stays below the effort: computed from the frames alone, as the moment of the links' weights."""
    arm = library_robot(name)
    numbers = arm.numbers
    q = np.random.default_rng(0).uniform(
        np.maximum(numbers.lower, -np.pi), np.minimum(numbers.upper, np.pi), (300, arm.n)
    )
    T = world_to_frames(arm, q)
    first = 0 if arm.convention is Convention.STANDARD else 1
    com = np.einsum("...ijk,ik->...ij", T[:, 1:, :3, :3], numbers.com) + T[:, 1:, :3, 3]
    for i in range(arm.n):
        axis, point = T[:, i + first, :3, 2], T[:, i + first, :3, 3]
        weight = numbers.mass[i:, None] * numbers.gravity
        if numbers.prismatic[i]:
            load = -(axis @ weight.sum(axis=0))
        else:
            load = -np.sum(
                np.cross(com[:, i:] - point[:, None], weight).sum(axis=1) * axis, axis=-1
            )
        assert np.abs(load).max() < numbers.effort[i] / 1.5


def test_published_numbers_are_kept_as_published():
    puma = library_robot("puma560")
    assert puma.joints[0].d == exact(0.67183)
    assert [float(j.body.mass) for j in puma.joints] == [0, 17.4, 4.8, 0.82, 0.34, 0.09]
    assert [float(j.drive.gear) for j in puma.joints] == [
        -62.6111,
        107.815,
        -53.7063,
        76.0364,
        71.923,
        76.686,
    ]
    assert np.degrees(puma.numbers.lower).round(9).tolist() == [-160, -45, -225, -110, -100, -266]
    assert puma.joints[1].effort == exact(186.4)
    assert library_robot("puma560_cao").joints[3].d == exact(19.58) * exact(0.0254)
    assert "-16.39" in str(library_robot("puma560_cao").joints[1].a / exact(0.0254))


def test_every_number_of_the_collected_data_is_here():
    """Against the project's collection of published parameters, where it is at hand."""
    data = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "robots.json"
    if not data.is_file():
        pytest.skip("the collection is not part of the repository")
    for name, robot in json.loads(data.read_text())["robots"].items():
        if name not in EXPECTED:
            continue
        numbers = library_robot(name).numbers
        rows = robot["joints"]
        for key, ours in (("a", numbers.a), ("d", numbers.d), ("alpha", numbers.alpha)):
            assert np.allclose(ours, [row[key] for row in rows], rtol=0, atol=1e-12), (name, key)
        assert np.allclose(
            numbers.theta, [row["theta"] + row["offset"] for row in rows], rtol=0, atol=1e-12
        )
        for i, row in enumerate(rows):
            if row["limits"] is not None:
                assert np.allclose(
                    [numbers.lower[i], numbers.upper[i]], row["limits"], rtol=0, atol=1e-12
                )
            if "body" in row and name in PUBLISHED_BODIES:
                assert numbers.mass[i] == row["body"]["mass"]
                assert np.array_equal(numbers.com[i], row["body"]["com"])
                assert np.array_equal(numbers.inertia[i], row["body"]["inertia"])


def test_corkes_and_the_seeds_puma_are_the_same_kind_of_arm_with_other_numbers_and_the_shoulder_on_the_other_side():
    """Same twists up to sign, so the same handedness of the wrist; lengths of two models of the 560."""
    corke, cao = library_robot("puma560"), library_robot("puma560_cao")
    assert np.array_equal(np.abs(np.sin(corke.numbers.alpha)), np.abs(np.sin(cao.numbers.alpha)))
    # The waist's twist has the other sign: the seed's z1 points to +y0, Corke's to -y0; the offsets have too.
    assert corke.numbers.alpha[0] == -cao.numbers.alpha[0]
    z1 = [world_to_frames(arm, np.zeros(6))[1, :3, 2] for arm in (corke, cao)]
    assert np.array_equal(z1, [[0, -1, 0], [0, 1, 0]])
    # Both put the wrist centre on the same side of the waist's plane, -y0, by 0.15005 and 6.75 in = 0.17145 m.
    wrist = [world_to_frames(arm, np.zeros(6))[4, :3, 3] for arm in (corke, cao)]
    assert wrist[0][1] == pytest.approx(-0.15005, abs=ROUNDED)
    assert wrist[1][1] == pytest.approx(-0.17145, abs=ROUNDED)
    # Upper arm 17 in against 16.39 in, forearm 17 in against 19.58 in, 0.8 in of elbow offset against none.
    assert (corke.joints[1].a, cao.joints[1].a) == (
        exact(17) * exact(0.0254),
        exact(-16.39) * exact(0.0254),
    )
    assert (corke.joints[3].d, cao.joints[3].d) == (
        exact(17) * exact(0.0254),
        exact(19.58) * exact(0.0254),
    )
    assert (float(corke.joints[2].a), cao.joints[2].a) == (0.0203, exact(0))
    # At zero Corke's upper arm points along +x0, the seed's along -x0 (its a2 is negative).
    elbow = [world_to_frames(arm, np.zeros(6))[2, 0, 3] for arm in (corke, cao)]
    assert elbow == [0.4318, -0.416306]


def with_lengths(arm, lengths):
    """Return Corke's table with other lengths: {(row from 0, key): metres}."""
    joints = list(arm.joints)
    for (row, key), value in lengths.items():
        joints[row] = replace(joints[row], **{key: value})
    return replace(arm, joints=tuple(joints))


def test_the_seeds_table_is_corkes_with_its_own_lengths_and_three_joints_turned():
    """The same motion: q1, 180 - q2, 180 - q3, q4, -q5, q6."""
    inch = exact(0.0254)
    lengths = {
        (0, "d"): 0,
        (1, "a"): 16.39,
        (2, "d"): 6.75,
        (2, "a"): 0,
        (3, "d"): 19.58,
        (5, "d"): 2.2,
    }
    corke = with_lengths(
        library_robot("puma560"), {key: exact(x) * inch for key, x in lengths.items()}
    )
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (100, 6))
    turned = q * [1, -1, -1, 1, -1, 1] + [0, np.pi, np.pi, 0, 0, 0]
    assert (
        np.abs(world_to_tool(corke, turned) - world_to_tool(library_robot("puma560_cao"), q)).max()
        < 4 * ROUNDED
    )


def test_the_seeds_table_as_printed_only_lifts_the_base():
    """d_2 in row 1 moves the arm along z0, in row 2 along z1: the tools differ by just that."""
    printed, meant = library_robot("puma560_cao_printed"), library_robot("puma560_cao")
    q = np.random.default_rng(2).uniform(-np.pi, np.pi, (100, 6))
    d2 = float(exact(-6.75) * exact(0.0254))
    lowered = world_to_tool(printed, q)[:, :3, 3] - [0, 0, d2]
    z1 = world_to_frames(meant, q)[:, 1, :3, 2]
    shifted = world_to_tool(meant, q)[:, :3, 3] - d2 * z1
    assert np.abs(lowered - shifted).max() < 4 * ROUNDED
    assert (
        np.abs(world_to_tool(printed, q)[:, :3, :3] - world_to_tool(meant, q)[:, :3, :3]).max()
        < 4 * ROUNDED
    )


def test_the_modified_table_is_corkes_arm_with_its_offsets_on_the_other_side_and_three_joints_reversed():
    """Armstrong, Khatib & Burdick: joints 2, 3, 5 turn the other way; offset 0.1501 on +y0; d4 is 0.4331 for 0.4318."""
    akb, corke = library_robot("puma560_akb"), library_robot("puma560")
    assert (akb.convention, corke.convention) == (Convention.MODIFIED, Convention.STANDARD)
    d3, d4, a3 = akb.numbers.d[1] + akb.numbers.d[2], akb.numbers.d[3], akb.numbers.a[3]
    assert d3 == pytest.approx(0.1501, abs=ROUNDED)
    assert abs(d3 - corke.numbers.d[2]) < 6e-5
    assert abs(d4 - corke.numbers.d[3]) < 1.4e-3
    assert a3 == -corke.numbers.a[2]
    # The same motion with joints 2, 3, 5 reversed, once Corke's table has AKB's lengths and its offsets' signs.
    lengths = {(0, "d"): 0, (2, "d"): -0.1501, (2, "a"): -0.0203, (3, "d"): 0.4331}
    same = with_lengths(corke, {key: exact(x) for key, x in lengths.items()})
    q = np.random.default_rng(3).uniform(-np.pi, np.pi, (100, 6))
    assert (
        np.abs(world_to_tool(same, q * [1, -1, -1, 1, -1, 1]) - world_to_tool(akb, q)).max()
        < 4 * ROUNDED
    )


def test_the_seeds_option_2_is_a_planar_two_link_arm():
    """Tool at the wrist centre, waist and wrist frozen: links 2 and 3 in a vertical plane."""
    cao = library_robot("puma560_cao")
    planar = lock(
        with_tool(cao, pose((0, 0, float(exact(-2.2) * exact(0.0254))))), {0: 0, 3: 0, 4: 0, 5: 0}
    )
    assert planar.n == 2
    assert [float(j.alpha) for j in planar.joints[:1]] == [0.0]
    l1, l2 = 0.416306, 0.497332
    q = np.random.default_rng(4).uniform(-np.pi, np.pi, (200, 2))
    T = world_to_tool(planar, q)
    # q1 = q2 = 0: upper arm along -x0, forearm along +z0; z1 = +y0, so positive angles turn x0 towards -z0.
    x = -l1 * np.cos(q[:, 0]) + l2 * np.sin(q.sum(axis=1))
    z = l1 * np.sin(q[:, 0]) + l2 * np.cos(q.sum(axis=1))
    assert np.abs(T[:, 0, 3] - x).max() < 4 * ROUNDED
    assert np.abs(T[:, 2, 3] - z).max() < 4 * ROUNDED
    assert np.abs(T[:, 1, 3] + 0.17145).max() < ROUNDED
    full = np.zeros((200, 6))
    full[:, 1:3] = q
    original = world_to_frames(cao, full)[:, 4, :3, 3]
    assert np.abs(T[:, :3, 3] - original).max() < 4 * ROUNDED
    assert with_base(planar, np.eye(4)).n == 2
