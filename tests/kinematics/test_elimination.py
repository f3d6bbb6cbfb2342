"""Laws of inverse kinematics by elimination: what is returned closes, nothing is missed, the status is honest."""

import subprocess
import sys
import zipfile
from dataclasses import replace

import numpy as np
import pytest

import acceptance
from arms_without_closed_form import GENERAL, LEFT, RIGHT, SIX
from dhkit import Arm
from dhkit.description import from_dh, pose, with_base, with_tool
from dhkit.errors import ModelError
from dhkit.kinematics import IKFlag, classify, inverse_kinematics, solve_numerically
from dhkit.kinematics.eliminated import (
    _solved_with_care,
    _SurePoses,
    elimination_kernels,
    solve_by_elimination,
)
from dhkit.kinematics.eliminated_call import EliminatedPoseCall, are_different
from dhkit.kinematics.polynomial.general import CompiledGeneral
from dhkit.kinematics.polynomial.root_kinds import DEGREE, ROOTS
from dhkit.kinematics.polynomial.six_joints import six_joints
from dhkit.kinematics.polynomial.solve import SAME_ANGLE, are_distinct, solve
from dhkit.kinematics.polynomial.trigonometric import real_roots
from dhkit.kinematics.polynomial.two_parallel_pose import pose_program
from dhkit.symbolic import operation_count
from ssik_peer import solutions_of

CLOSES = 1e-12  # share of the reach and rad, away from singularities
REGULAR = 1e-3
"""Smallest singular value of the Jacobian at states that count as regular."""
ALL = {**SIX, **GENERAL}


def distance(found, q):
    """Return how far the nearest solution is from joint values (N, n), rad, shape (N,)."""
    apart = np.abs(np.angle(np.exp(1j * (found.q - q[:, None])))).max(axis=-1)
    return np.where(np.isnan(apart), np.pi, apart).min(axis=-1)


def regularity(arm, q):
    return np.linalg.svd(arm.jacobian(q), compute_uv=False)[..., -1]


def closure(arm, found, T):
    errors = np.abs(arm.fk(np.where(found.valid[..., None], found.q, 0.0)) - T[:, None])
    return errors.max(axis=(2, 3), where=found.valid[..., None, None], initial=0.0).max()


@pytest.mark.parametrize("name", ALL)
def test_the_joint_values_that_made_a_pose_are_found(name, law):
    arm = ALL[name]
    count = law.samples(1_000_000 if name in SIX else 100_000) // 100
    for k in range(100 if acceptance.ACCEPTING else 1):
        q = np.random.default_rng(k).uniform(-np.pi, np.pi, (count, 6))
        T = arm.fk(q)
        found = arm.ik(T)
        away = distance(found, q)
        regular = regularity(arm, q) > REGULAR
        law.holds("regular states missed", int(np.sum(away[regular] > 1e-6)), 0, name)
        law.holds("poses without a solution", int(np.sum(~found.valid.any(axis=1))), 0, name)
        law.holds("closure by the reach", closure(arm, found, T) / arm.description.reach, 1e-10)
        angles = found.q[found.valid]
        assert np.all((angles > -np.pi) & (angles <= np.pi))
        assert np.isnan(found.q[~found.valid]).all()


@pytest.mark.parametrize("name", ALL)
def test_solutions_are_different_and_in_order(name, law):
    arm = ALL[name]
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (law.samples(2000), 6))
    found = arm.ik(arm.fk(q))
    assert found.branches == tuple(f"solution {k + 1}" for k in range(found.q.shape[-2]))
    counts = found.valid.sum(axis=1)
    assert max(1, counts.max()) == len(found.branches) <= 16
    assert np.array_equal(found.valid, np.arange(len(found.branches)) < counts[:, None])
    first = np.where(found.valid, found.q[..., 0], 2 * np.pi)
    assert np.all(np.diff(first, axis=1) > -2 * SAME_ANGLE)
    between = np.abs(np.exp(1j * found.q[:, :, None]) - np.exp(1j * found.q[:, None])).max(axis=-1)
    twins = np.nan_to_num(between, nan=np.inf) + 9 * np.eye(len(found.branches))
    assert twins.min() > 1e-6


@pytest.mark.parametrize("name", ALL)
def test_states_at_and_near_singularities(name, law):
    """Joints at multiples of 45 degrees, and off them by 1e-16 to 0.1 rad: stretched, folded and aligned axes."""
    arm = ALL[name]
    rng = np.random.default_rng(1)
    count = law.samples(20_000, 300)
    grid = rng.integers(-4, 5, (count, 6)) * (np.pi / 4)
    q = grid + rng.normal(0, 1, grid.shape) * 10.0 ** rng.uniform(-16, -1, (count, 1))
    T = arm.fk(q)
    found = arm.ik(T)
    away = distance(found, q)
    regular = regularity(arm, q) > 2e-2
    law.holds("regular states missed in 10,000", 1e4 * np.mean(away[regular] > 1e-5), 5, name)
    law.holds("poses without a solution, share", np.mean(~found.valid.any(axis=1)), 2e-3, name)
    law.holds("closure by the reach", closure(arm, found, T) / arm.description.reach, 1e-9)


@pytest.mark.parametrize("name", ["FANUC CRX-10iA", "general"])
def test_iteration_from_many_starts_finds_no_other_solution(name, law):
    arm = ALL[name]
    rng = np.random.default_rng(3)
    q = rng.uniform(-np.pi, np.pi, (law.samples(500, 20), 6))
    T = arm.fk(q)
    ours = arm.ik(T)
    assert ours.complete
    for _ in range(20):
        starts = rng.uniform(-np.pi, np.pi, q.shape)
        found = solve_numerically(arm.description, T, starts, restarts=0, limits=False)
        reached = found.valid[:, 0]
        ends = found.q[reached, 0]
        apart = np.abs(np.angle(np.exp(1j * (ours.q[reached] - ends[:, None])))).max(axis=-1)
        assert np.nanmin(apart, axis=1).max() < 1e-5


@acceptance.only_accepting
def test_ssik_finds_no_other_solution(law):
    pytest.importorskip("ssik")
    arm = SIX["UFACTORY xArm 6"]
    q = np.random.default_rng(4).uniform(-np.pi, np.pi, (law.samples(200), 6))
    T = arm.fk(q)
    ours = arm.ik(T)
    for k, theirs in enumerate(solutions_of(arm.description, T)):
        theirs = theirs[np.abs(arm.fk(theirs) - T[k]).max(axis=(1, 2)) < 1e-8]
        apart = np.abs(np.angle(np.exp(1j * (ours.q[k][ours.valid[k]][:, None] - theirs))))
        assert apart.max(axis=-1).min(axis=0).max() < 1e-5


def test_base_and_tool_change_nothing():
    arm = SIX["oblique wrist"]
    placed = Arm(
        with_tool(
            with_base(arm.description, pose((0.1, 0.2, 0.3), euler=(0.3, 0.2, 0.1))),
            pose((0, 0.1, 0.2), euler=(1, 2, 3)),
        )
    )
    q = np.random.default_rng(2).uniform(-3, 3, (50, 6))
    assert distance(placed.ik(placed.fk(q)), q).max() < 1e-6


def test_poses_that_are_not_reached_or_none():
    arm = SIX["FANUC CRX-10iA"]
    T = arm.fk(np.random.default_rng(0).uniform(-2, 2, (5, 6)))
    T[1, :3, 3] += 5
    T[2, 0, 0] = np.nan
    T[3, :3, 3] = 1e300
    T[4, :3, 3] *= 1.3 / np.linalg.norm(T[4, :3, 3])
    found = arm.ik(T)
    assert found.status.tolist()[:4] == ["ok", "out_of_reach", "not_a_pose", "out_of_reach"]
    # Beyond reach with this rotation: its polynomial has no real root, and iteration finds nothing.
    assert found.status[4] == "out_of_reach"
    assert not arm.ik_numeric(T[4], limits=False).valid.any()

    # Just beyond reach, where roots are nearly real, nothing is claimed.
    def moved(length):
        moved = T[4].copy()
        moved[:3, 3] *= length / np.linalg.norm(moved[:3, 3])
        return moved

    inside, beyond = 0.5, 1.3
    assert arm.ik(moved(inside)).valid.any()
    for _ in range(50):
        middle = (inside + beyond) / 2
        inside, beyond = (middle, beyond) if arm.ik(moved(middle)).valid.any() else (inside, middle)
    assert arm.ik(moved(beyond)).status == "not_found"
    assert arm.ik(moved(beyond + 1e-11)).status == "not_found"
    assert np.isnan(found.distance[1:4]).all() and found.distance[0] == 0
    alone = arm.ik(T[1])
    assert alone.q.shape == (1, 6) and np.isnan(alone.q).all() and len(alone) == 1
    assert solve_by_elimination(arm.description, T[:0]).q.shape == (0, 1, 6)
    shaped = arm.ik(T[:4].reshape(2, 2, 4, 4))
    whole = arm.ik(T[:4])
    assert np.array_equal(shaped.q.reshape(whole.q.shape), whole.q, equal_nan=True)


def test_four_axes_that_meet_have_a_status():
    """Axes 3 to 6 meet in one point: solutions are curves, and what is found closes."""
    rows = [
        (0, 0, 0.3, -np.pi / 2),
        (0, 1.0, 0.4, np.pi / 2),
        (0, 0.65, 0, np.pi / 2),
        (0, 0, 0, np.pi / 2),
        (0, 0, 0, np.pi / 2),
        (0, 0, 0.15, -np.pi / 2),
    ]
    arm = Arm.from_dh(rows)
    T = arm.fk([0.3, 0.4, -0.5, 0.6, 0.7, 0.2])
    found = arm.ik(T)
    assert found.valid.any() and not found.complete
    assert np.abs(arm.fk(found.q[found.valid]) - T).max() < 1e-9


SPECIAL = {
    "three parallel axes": [
        (0, 0.3, 0.1, LEFT),
        (0, 0.05, 0.5, 0),
        (0, 0.1, 0.4, 0),
        (0, 0.1, 0, RIGHT),
        (0, 0.1, 0.1, LEFT),
        (0, 0.1, 0, 0),
    ],
    "a UR with an offset wrist": [
        (0, 0.1, 0, RIGHT),
        (0, 0, -0.4, 0),
        (0, 0, -0.4, 0),
        (0, 0.1, 0, RIGHT),
        (0, 0.1, 0.03, LEFT),
        (0, 0.1, 0, 0),
    ],
    "planar": [(0, 0, length, 0) for length in (0.3, 0.2, 0.1, 0.2, 0.1, 0.1)],
    "one centre": [(0, 0, 0, RIGHT)] * 6,
    "one axis": [(0, 0.3, 0, 0)] * 6,
    "spherical wrist on a twisted arm": [
        (0, 0.36, 0, LEFT),
        (0, 0, 0.42, RIGHT),
        (0, 0, 0, LEFT),
        (0, 0.4, 0, RIGHT),
        (0, 0, 0, LEFT),
        (0, 0.126, 0, 0),
    ],
}


@pytest.mark.parametrize("name", SPECIAL)
def test_a_pose_that_was_made_is_never_said_to_be_out_of_reach(name, law):
    """States where polynomials vanish, or where poses beside them are not reached."""
    arm = Arm.from_dh(SPECIAL[name], name="special")
    rng = np.random.default_rng(6)
    count = law.samples(2000, 20)
    q = rng.integers(-4, 5, (count, 6)) * (np.pi / 4)
    q[::2, :5] = 0.0
    found = arm.ik(arm.fk(q))
    assert not np.any(found.status == "out_of_reach")
    assert not found.complete
    assert np.mean(found.valid.any(axis=1)) > 0.9
    assert closure(arm, found, arm.fk(q)) < 1e-8


def test_a_step_of_the_estimates_divides_four_times():
    """Of the differences of the roots it takes one reciprocal for eight, unless CasADi undoes it."""
    steps = {step.graph.name: step.graph for step in pose_program((5, 6)).with_reciprocals().steps}
    assert operation_count(steps["better_estimates"])["divisions"] == 4


def test_a_missing_solution_is_not_called_complete(law):
    """The two flips of a spherical wrist share joints 1 to 3, so that roots are double at every pose."""
    arm = Arm.from_dh(SPECIAL["spherical wrist on a twisted arm"], name="twisted")
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (law.samples(2000, 20), 6))
    for state in q:
        T = arm.fk(state)
        found = arm.ik(T)
        missed = distance(replace(found, q=found.q[None]), state[None])[0] > 1e-5
        assert not (missed and found.complete)


@pytest.mark.law
@pytest.mark.parametrize("name", ALL)
def test_nearly_all_poses_are_complete(name, law):
    """Where some roots of one polynomial nearly coincide, those of another one lie apart."""
    arm = ALL[name]
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (law.samples(20_000, 300), 6))
    found = six_joints(arm.description)(arm.fk(q).reshape(-1, 16))
    law.holds("share of poses that are not", float(np.mean(~found.is_complete)), 0.005, name)


@pytest.mark.parametrize("kinds", ["RRRRR", "RRPRRR", "RRRRRRRR"])
def test_other_arms_are_refused(kinds):
    arm = from_dh([(0, 0.1 * (k + 1), 0.2, 0.3 * k + 0.1) for k in range(len(kinds))], kinds=kinds)
    assert classify(arm).family is None
    with pytest.raises(ModelError, match="no closed form known; ik_numeric solves any arm"):
        inverse_kinematics(arm, np.eye(4))


def test_arguments_that_do_not_fit_are_said():
    arm = SIX["oblique wrist"].description
    with pytest.raises(ValueError, match="out is given, but oblique is 6R"):
        inverse_kinematics(arm, np.eye(4), out=np.zeros((8, 6)))
    with pytest.raises(ValueError, match=r"T has shape \(3, 3\)"):
        inverse_kinematics(arm, np.eye(3))
    with pytest.raises(ValueError, match="redundancy is given, but oblique has 6 joints"):
        inverse_kinematics(arm, np.eye(4), redundancy=0.1)
    with pytest.raises(ValueError, match=r"seed has shape \(5,\)|\(5,\)"):
        inverse_kinematics(arm, np.eye(4), seed=np.zeros(5))


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """Tables of 929 robots that are sold, from the wheel of ikdh 1.2.0; its files never enter the repository."""
    yaml = pytest.importorskip("yaml")
    folder = tmp_path_factory.mktemp("ikdh")
    download = [sys.executable, "-m", "pip", "download", "--no-deps", "-q", "-d", str(folder)]
    if subprocess.run([*download, "ikdh==1.2.0"], check=False).returncode:
        pytest.skip("the wheel of ikdh cannot be downloaded")
    (wheel,) = folder.glob("*.whl")
    tables = {}
    with zipfile.ZipFile(wheel) as archive:
        for file in sorted(archive.namelist()):
            if file.endswith(".yaml"):
                table = yaml.safe_load(archive.read(file))["dh"]
                tables.setdefault(repr(table), (file, table))
    return list(tables.values())


@acceptance.only_accepting
def test_every_published_table_is_solved(published, law):
    assert len(published) == 929
    for file, table in published:
        rows = [tuple(str(table[key][i]) for key in ("theta", "d", "a", "alpha")) for i in range(6)]
        arm = Arm.from_dh(rows, name="published")
        q = np.random.default_rng(0).uniform(-np.pi, np.pi, (100, 6))
        T = arm.fk(q)
        found = arm.ik(T)
        regular = regularity(arm, q) > REGULAR
        missed = np.sum(distance(found, q)[regular] > 1e-6)
        law.holds("regular states missed of published tables", int(missed), 0, file)
        law.holds(
            "closure by the reach, tables", closure(arm, found, T) / arm.description.reach, 1e-10
        )


def test_a_pose_far_beyond_leaves_the_others_complete():
    arm = Arm.load("jaco")
    T = arm.fk(np.random.default_rng(0).uniform(-2, 2, (3, 6)))
    assert arm.ik(T).complete
    T[1, :3, 3] = 1e6
    found = arm.ik(T)
    assert found.complete
    assert found.status.tolist() == ["ok", "out_of_reach", "ok"]


def test_nearly_folded_wrists_are_complete_or_said_not_to_be():
    """There the polynomial's coefficients cancel: roots that are real may look complex."""
    arm = SIX["FANUC CRX-10iA"]
    rng = np.random.default_rng(0)
    count = 60
    quarter = rng.integers(-3, 5, (count, 6)) * np.pi / 4
    q = quarter.copy()
    q[:, 1] = np.pi * rng.integers(0, 2, count)
    q[:, 2] = np.pi / 2
    q[:, 4] = np.pi * rng.integers(0, 2, count)
    q += 10 ** rng.uniform(-4, -2, (count, 1)) * rng.normal(size=(count, 6))
    for state in q:
        smallest = np.linalg.svd(arm.jacobian(state))[1][-1]
        if smallest < 1e-5 * arm.description.reach:
            continue
        found = arm.ik(arm.fk(state))
        apart = 2 * np.abs(np.sin((found.q - state) / 2)).max(axis=-1)
        assert not found.complete or np.nanmin(apart) < 1e-4


@pytest.mark.parametrize("name", GENERAL)
def test_the_compiled_elimination_finds_what_lapack_finds(name, law):
    """States with equal or nearly equal roots too, which the program leaves to LAPACK."""
    arm = GENERAL[name]
    elimination = six_joints(arm.description).elimination
    for one in elimination.kernels:
        one.compile()
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (law.samples(20_000, quick=300), 6))
    q[::9, 4] = 0.0
    q[1::9, 2] = 1e-4
    T = arm.fk(q).reshape(-1, 16)
    # Poses that are not reached.
    T[5, 3] += 10 * arm.description.reach
    compiled = six_joints(arm.description)(T)
    by_lapack = solve(arm.description, elimination.lapack.candidates, T)
    assert np.mean(compiled.counts >= by_lapack.counts) > 0.98
    found = np.abs(np.angle(np.exp(1j * (compiled.q - q[compiled.owner])))).max(axis=1) < 1e-6
    is_found = np.isin(np.arange(len(q)), compiled.owner[found])
    regular = (regularity(arm, q) > REGULAR) & (np.arange(len(q)) != 5)
    law.holds("regular states missed", int(np.sum(~is_found[regular])), 0, name)
    assert compiled.counts[5] == 0
    closed = np.abs(arm.fk(compiled.q).reshape(-1, 16) - T[compiled.owner]).max()
    law.holds("closure by the reach", closed / arm.description.reach, 1e-10)


@pytest.mark.parametrize("name", ALL)
def test_single_calls_find_what_batches_find(name, law):
    """A single pose is solved by a compiled function, or the ordinary way where two solutions nearly coincide."""
    arm = ALL[name]
    q = np.random.default_rng(11).uniform(-np.pi, np.pi, (law.samples(20_000, quick=80), 6))
    # Beside random states some near singularities, and poses that are not reached or none.
    q[::10, 4] = 1e-5
    T = arm.fk(q)
    T[3, :3, 3] *= 10.0
    T[5, 0, 0] = np.nan
    batch = solve_by_elimination(arm.description, T)
    call = EliminatedPoseCall(arm.description, six_joints(arm.description).elimination)
    call.compile()
    is_regular = regularity(arm, q) > REGULAR
    taken = 0
    for k, pose_of_tool in enumerate(T):
        alone = call(pose_of_tool, None)
        if alone is None:
            continue
        taken += 1
        count = int(batch.valid[k].sum())
        assert alone.q.shape == (count, 6)
        # Both close to rounding, which singular neighbourhoods amplify.
        apart = np.abs(alone.q - batch.q[k, :count]).max()
        assert apart < (1e-9 if is_regular[k] else SAME_ANGLE)
        assert alone.valid.all() and alone.complete
        assert alone.distance == 0.0
        if is_regular[k]:
            assert alone.status == batch.status[k] == "ok"
            assert (alone.flags == batch.flags[k, :count]).all()
        assert alone.branches == batch.branches[:count]
    # Of three parallel axes with an offset wrist about half of the poses have roots that nearly coincide.
    assert taken > 0.3 * len(T)


@pytest.mark.parametrize("name", SIX)
def test_few_poses_are_solved_as_each_alone(name):
    limit = np.radians([170.0, 120.0, 150.0, 200.0, 120.0, 360.0])
    arm = SIX[name].with_limits(lower=-limit, upper=limit)
    call = EliminatedPoseCall(arm.description, six_joints(arm.description).elimination)
    call.compile()
    T = arm.fk(np.random.default_rng(12).uniform(-np.pi, np.pi, (60, 6)))
    alone = [call(pose_of_tool, None) for pose_of_tool in T]
    taken = [k for k, one in enumerate(alone) if one is not None][:16]
    few = call(T[taken], None)
    assert few.q.shape[0] == len(few.status) == len(taken)
    for row, k in enumerate(taken):
        count = len(alone[k].branches)
        assert np.array_equal(few.q[row, :count], alone[k].q)
        assert np.array_equal(few.flags[row, :count], alone[k].flags)
        assert few.valid[row].tolist() == [True] * count + [False] * (len(few.branches) - count)
    assert (few.status == "ok").all() and few.complete and (few.distance == 0).all()
    if len(taken) < len(T):
        assert call(T[:16], None) is None or None not in alone[:16]
    bad = T[taken[:3]].copy()
    bad[1, 0, 0] = np.nan
    assert call(bad, None) is None


@pytest.mark.law
@pytest.mark.parametrize("name", ALL)
def test_sure_poses_of_a_batch_are_solved_as_with_care(name, law):
    limit = np.radians([170.0, 120.0, 150.0, 200.0, 120.0, 360.0])
    arm = ALL[name].with_limits(lower=-limit, upper=limit)
    description = arm.description
    programs = [way.pose_kernel for way in six_joints(description).ways]
    for one in [*elimination_kernels(description), *programs]:
        one.compile()
    q = np.random.default_rng(13).uniform(-np.pi, np.pi, (law.samples(20_000, quick=500), 6))
    q[::10, 4] = 1e-5
    T = arm.fk(q)
    T[3, :3, 3] *= 10.0
    T[5, 0, 0] = np.nan
    found = solve_by_elimination(description, T)
    expected = _solved_with_care(description, T)
    assert found.branches == expected.branches and found.q.flags.c_contiguous
    is_regular = regularity(arm, q) > REGULAR
    assert np.array_equal(found.valid[is_regular], expected.valid[is_regular])
    apart = np.nan_to_num(2 * np.sin(np.abs(found.q - expected.q)[is_regular] / 2))
    law.holds("difference of regular solutions", float(apart.max()), 1e-9, name)
    for field in ("flags", "status_code"):
        of_found, of_expected = getattr(found, field), getattr(expected, field)
        assert np.array_equal(of_found[is_regular], of_expected[is_regular])
    # Care may find a solution more, never one less.
    assert (found.valid.sum(axis=1) == expected.valid.sum(axis=1)).mean() > 0.999
    assert found.complete == expected.complete
    again = solve_by_elimination(description, T[:6].reshape(2, 3, 4, 4))
    assert again.q.shape[:2] == (2, 3) and again.status.shape == (2, 3)
    assert solve_by_elimination(description, np.empty((0, 4, 4))).q.shape[0] == 0


@pytest.mark.law
@pytest.mark.parametrize("name", [*ALL, *SPECIAL])
def test_different_eliminations_find_the_same_solutions(name, law):
    """Their polynomials are in different joints: of poses that two of them are sure of, both find all solutions."""
    description = ALL[name].description if name in ALL else from_dh(SPECIAL[name])
    q = np.random.default_rng(21).uniform(-np.pi, np.pi, (law.samples(20_000, quick=100), 6))
    q[::7, 4] *= 1e-5
    q[::11, 2] *= 1e-4
    T = Arm(description).fk(q)
    largest = np.zeros(len(q), dtype=int)
    found = []
    for way in six_joints(description).ways:
        way.pose_kernel.compile()
        sure = _SurePoses.of(description, way, T.reshape(-1, 16))
        is_sure = sure.counts > 0
        # At two singularities at once solutions within 1e-4 close to rounding.
        missed = distance(sure, q) > 1e-3
        law.holds("sure, and missed", int(np.sum(is_sure & missed)), 0, name)
        found.append(sure.counts)
        largest = np.maximum(largest, sure.counts)
    unequal = sum(int(np.sum((counts > 0) & (counts != largest))) for counts in found)
    law.holds("poses with other numbers of solutions", unequal, 0, name)


def test_single_calls_leave_other_arguments_to_the_ordinary_way():
    arm = SIX["FANUC CRX-10iA"]
    call = EliminatedPoseCall(arm.description, six_joints(arm.description).two_parallel)
    call.compile()
    T = arm.fk(np.array([0.3, 1.0, -0.5, 0.7, 0.2, 0.4]))
    assert call(T, None) is not None
    others = [
        T.tolist(),
        np.stack([T] * 17),
        T[None, None],
        np.asfortranarray(T),
        T.astype(np.float32),
        np.eye(3),
        None,
    ]
    for other in [*others, np.full((4, 4), np.nan), np.diag([1.0, 1.0, -1.0, 1.0])]:
        assert call(other, None) is None
    assert call(T, np.empty((8, 6))) is None


@pytest.mark.parametrize("name", SPECIAL)
def test_compiled_eliminations_call_no_missing_solution_complete(name, law):
    """Some arms have ways whose polynomial is always 0, or whose roots are always double."""
    description = from_dh(SPECIAL[name])
    q = np.random.default_rng(2).uniform(-np.pi, np.pi, (law.samples(2_000, quick=100), 6))
    T = Arm(description).fk(q).reshape(-1, 16)
    first, *others = six_joints(description).ways
    for elimination in (first, *others):
        for one in elimination.kernels:
            one.compile()
        found = solve(description, elimination.candidates, T)
        near = np.abs(np.angle(np.exp(1j * (found.q - q[found.owner])))).max(axis=1) < 1e-5
        is_missed = ~np.isin(np.arange(len(q)), found.owner[near])
        # Of the other ways, only solutions that lie at their roots count.
        is_claimed = found.is_complete & (found.is_settled | (elimination is first))
        law.holds("missed and said complete", int(np.sum(is_missed & is_claimed)), 0, name)


@pytest.mark.parametrize("offset", [0.1, 0.02, 0.001])
def test_of_nearly_spherical_wrists_no_solution_is_missed_in_silence(offset, law):
    """Their polynomial is nearly the square of one of half the degree, and its roots are badly known."""
    rows = [
        (0, 0.31, 0.11, RIGHT),
        (0, 0.15, 0.23, 0),
        (0, 0.3, 0, RIGHT),
        (0, 0.19, 0, RIGHT),
        (0, 0, offset, 1.68),
        (0, -0.06, -0.22, 0),
    ]
    arm = Arm.from_dh(rows, name="offset")
    arm.compile()
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (law.samples(3_000, quick=40), 6))
    T = arm.fk(q)
    found = [arm.ik(pose_of_tool) for pose_of_tool in T]
    missed = np.array(
        [
            distance(replace(one, q=one.q[None]), x[None])[0] > 1e-3
            for one, x in zip(found, q, strict=True)
        ]
    )
    complete = np.array([one.complete for one in found])
    law.holds("missed and said complete", int(np.sum(missed & complete)), 0, offset)
    law.holds("share that is missed", float(missed.mean()), 0.01, offset)


@pytest.mark.law
def test_beside_a_curve_of_solutions_none_is_missed_in_silence(law):
    """Where four axes are nearly parallel, iteration closes at false solutions beside the curve they would have."""
    arm = GENERAL["three parallel axes, offset wrist"]
    rng = np.random.default_rng(5)
    missed = 0
    for _ in range(law.samples(1_000, 20)):
        q = rng.uniform(-3.0, 3.0, 6)
        q[4] = rng.choice([0.0, np.pi]) + rng.choice([-1, 1]) * 10 ** rng.uniform(-13, -2)
        T = arm.fk(q)
        found = arm.ik(T)
        if not found.complete:
            continue
        starts = rng.uniform(-np.pi, np.pi, (100, 6))
        search = arm.ik_numeric(np.broadcast_to(T, (100, 4, 4)), starts, limits=False)
        others = search.q[search.valid]
        others = others[regularity(arm, others) > REGULAR]
        apart = np.abs(np.angle(np.exp(1j * (others[:, None] - found.q[found.valid])))).max(axis=-1)
        missed += (apart.min(axis=1) > 1e-4).any()
    law.holds("complete without regular solutions", missed, 0)


def test_clusters_of_singular_solutions_are_not_called_complete():
    """Where many roots coincide, Newton's method closes at false solutions beside the true one."""
    right = np.pi / 2
    states = {
        "UFACTORY xArm 6": [0, -right, -right, np.pi, np.pi, 0],
        "axes 5 and 6 meet": [right, right, right, 0, 0, 0],
    }
    for name, state in states.items():
        arm = SIX[name]
        found = arm.ik(arm.fk(state))
        assert not found.complete
        assert found.status == "singular"


@pytest.mark.parametrize("name", SIX)
def test_the_order_does_not_depend_on_the_side_of_pi(name):
    arm = SIX[name]
    call = EliminatedPoseCall(arm.description, six_joints(arm.description).elimination)
    call.compile()
    rng = np.random.default_rng(3)
    for _ in range(100):
        q = np.array([np.pi, *rng.uniform(-3, 3, 5)])
        T = arm.fk(q)
        alone = call(T, None)
        if alone is not None:
            batch = solve_by_elimination(arm.description, T)
            assert np.abs(np.sin((alone.q - batch.q) / 2)).max() < 1e-7


SPHERICAL = [
    [(0, 0, 0.4, 0), (0, 0.6, 0, "pi/2"), (0, 0.2, 0.3, 1.0), (0, 0.8, 0, "-pi/2")],
    [(0, 0, 0.4, "pi"), (0, 0, 0, "pi/2"), (0, 0.7, 0.2, 0), (0, 0.4, 0, "pi/2")],
    [(0, 0, 0.4, 0), (0, 0.6, 0, "pi/3"), (0, 0, 0.3, "pi"), (0, 0.8, 0, "-pi/2")],
]
"""First rows of arms with a spherical wrist and no closed form; axes 1 and 2 of the last two are parallel."""


@pytest.mark.parametrize("rows", SPHERICAL)
def test_arms_with_multiple_roots_miss_nothing_that_they_call_complete(rows, law):
    """Solutions share joints 1 to 3 in pairs, or joint 1 in fours: roots of the polynomial coincide."""
    arm = Arm.from_dh([*rows, (0, 0, 0, "pi/2"), (0, 0.1, 0, 0)])
    q = np.random.default_rng(6).uniform(-3, 3, (law.samples(400, 15), 6))
    T = arm.fk(q)
    batch = arm.ik(T)
    missed = 0
    for k in range(len(T)):
        one = arm.ik(T[k])
        missed += bool(_away(one, q[k]) > 1e-5 and one.complete)
        count = int(one.valid.sum())
        assert count == batch.valid[k].sum()
        assert np.allclose(one.q[:count], batch.q[k, :count], rtol=0, atol=1e-6)
    law.holds("solutions missed where complete", missed, 0)


def _away(found, q):
    """Return how far the nearest solution of a pose is from joint values, rad."""
    return np.abs(np.angle(np.exp(1j * (found.q - q)))).max(axis=-1).min()


def test_singular_solutions_have_their_flag_at_any_root():
    """Four of eight, at roots that are far apart."""
    rows = [
        (0, 0.16, 0, "pi/2"),
        (0, 0, -0.61, 0),
        (0, 0, -0.57, 0),
        (0, 0.17, 0.05, "pi/2"),
        (0, 0.12, 0.03, "-pi/2"),
        (0, 0.11, 0, 0),
    ]
    arm = Arm.from_dh(rows)
    q = [-2.208612363282847, -3.9183568243111213, -2.504056704437348]
    q += [1.407596291292775, -2.9668227854754523, 0.8642642704441499]
    found = arm.ik(arm.fk(q))
    J = arm.jacobian(found.q)
    J[:, :3] /= arm.description.reach
    is_singular = np.linalg.svd(J, compute_uv=False)[:, -1] < 1e-5
    assert is_singular.sum() == 4 and str(found.status) == "singular"
    assert np.array_equal(found.flags & IKFlag.singular > 0, is_singular)


def test_equal_solutions_of_a_call_are_those_of_a_batch():
    """The same angles count as equal, through pi too, whichever function compares them."""
    rng = np.random.default_rng(4)
    for _ in range(2_000):
        count = int(rng.integers(2, 17))
        q = rng.uniform(-np.pi, np.pi, (count, 6))
        if rng.random() < 0.3:
            q[:, 0] = np.pi + 1e-6 * rng.normal(size=count)
        first, second = rng.choice(count, 2, replace=False)
        q[first] = q[second] + rng.uniform(-1.0, 1.0, 6) * rng.choice([1e-7, 3e-6, 1e-4])
        q = np.angle(np.exp(1j * q))
        is_one = are_distinct(q, np.zeros(count, dtype=np.intp))
        assert are_different(q) == is_one.all()


@pytest.mark.law
@pytest.mark.parametrize("name", ALL)
def test_real_eigenvalues_of_a_companion_matrix_are_among_the_roots(name, law):
    """LAPACK's eigenvalues that lie on the unit circle, 1e-3 from any other."""
    arm = ALL[name]
    count = law.samples(20_000, quick=300)
    T = arm.fk(np.random.default_rng(31).uniform(-np.pi, np.pi, (count, 6)))
    way = next(x for x in six_joints(arm.description).ways if isinstance(x, CompiledGeneral))
    values = way.lapack.polynomial_values(T.reshape(-1, 16))
    found = real_roots(values, 0.0)

    upper = np.fft.fft(values, axis=1)[:, DEGREE::-1]
    coefficients = np.concatenate([upper, upper[:, -2::-1].conj()], axis=1)
    coefficients /= np.abs(coefficients).max(axis=1, keepdims=True)
    # Others have roots near infinity.
    usable = np.abs(coefficients[:, 0]) > 1e-9
    if usable.mean() < 0.5:
        pytest.skip(f"the polynomial of {name} has a lower degree")
    companion = np.zeros((count, ROOTS, ROOTS), dtype=complex)
    companion[usable, 0] = -coefficients[usable, 1:] / coefficients[usable, :1]
    companion[:, np.arange(1, ROOTS), np.arange(ROOTS - 1)] = 1.0
    eigenvalues = np.linalg.eigvals(companion)

    apart = np.abs(eigenvalues[:, :, None] - eigenvalues[:, None]) + 10.0 * np.eye(ROOTS)
    is_real = usable[:, None] & (np.abs(np.log(np.abs(eigenvalues) + 1e-300)) < 1e-9)
    owner, place = np.nonzero(is_real & (apart.min(axis=2) > 1e-3))
    root = eigenvalues[owner, place]
    nearest = np.full(len(owner), np.inf)
    starts = np.searchsorted(found.owner, np.arange(count + 1))
    for k in range(int(np.diff(starts).max())):
        index = np.minimum(starts[owner] + k, len(found.owner) - 1)
        away = np.abs(np.exp(1j * found.angle[index]) - root)
        nearest = np.where(found.owner[index] == owner, np.minimum(nearest, away), nearest)
    # Rounding of the coefficients moves a root by 1e-14 over the slope.
    powers = root[:, None] ** np.arange(ROOTS - 1, -1, -1)
    slope = np.abs((coefficients[owner, :-1] * np.arange(ROOTS, 0, -1) * powers).sum(axis=1))
    assert len(owner) > count / 10
    law.holds("real roots missed", int(np.sum(nearest > 1e-6 + 1e-14 / slope)), 0, name)
