"""Laws of arms of seven joints: all solutions at a given redundancy, values that are chosen, paths that close."""

import numpy as np
import pytest

import acceptance
from arms_without_closed_form import GEN3, SEVEN
from dhkit import Arm
from dhkit.errors import UnreachableError
from dhkit.kinematics import IKStatus
from dhkit.kinematics.redundant import redundancy_of, redundancy_range
from dhkit.kinematics.root_intervals import intervals_by_roots
from dhkit.kinematics.solver import solver_for

CLOSES = 1e-12


def states(count, seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 7))


def distance(found, q):
    apart = np.abs(np.angle(np.exp(1j * (found.q - q[..., None, :])))).max(axis=-1)
    return np.where(np.isnan(apart), np.pi, apart).min(axis=-1)


def closure(arm, found, T):
    errors = np.abs(arm.fk(np.where(found.valid[..., None], found.q, 0.0)) - T[..., None, :, :])
    return errors.max(axis=(-1, -2))[found.valid].max(initial=0.0)


@pytest.mark.parametrize("name", SEVEN)
def test_all_solutions_at_the_redundancy_of_a_state(name, law):
    arm = SEVEN[name]
    for seed in range(10 if acceptance.ACCEPTING else 1):
        q = states(law.samples(100_000), seed)
        T = arm.fk(q)
        found = arm.ik(T, redundancy=redundancy_of(arm.description, q))
        law.holds(
            "rad to the joint values that made the pose", distance(found, q).max(), 1e-5, name
        )
        law.holds("closure by the reach", closure(arm, found, T) / arm.description.reach, CLOSES)
        assert not found.complete and found.valid.any(axis=1).all()
    again = redundancy_of(arm.description, found.q[found.valid])
    wanted = np.repeat(found.redundancy, found.valid.sum(axis=1))
    apart = np.abs(np.angle(np.exp(1j * (again - wanted))))
    # At a singularity of the shoulder or of the arm's line the angle is less certain.
    assert np.quantile(apart, 0.99) < 1e-9


@pytest.mark.parametrize("name", SEVEN)
def test_states_at_and_near_singularities(name, law):
    arm = SEVEN[name]
    rng = np.random.default_rng(1)
    count = law.samples(100_000, 2000)
    grid = rng.integers(-4, 5, (count, 7)) * (np.pi / 4)
    q = grid + rng.normal(0, 1, grid.shape) * 10.0 ** rng.uniform(-16, -1, (count, 1))
    T = arm.fk(q)
    found = arm.ik(T, redundancy=redundancy_of(arm.description, q))
    law.holds("closure by the reach", closure(arm, found, T) / arm.description.reach, 1e-11, name)
    law.holds("poses without a solution, share", np.mean(~found.valid.any(axis=1)), 1e-3, name)


@pytest.mark.parametrize("name", SEVEN)
def test_without_a_redundancy_one_is_chosen_inside_the_limits(name):
    arm = SEVEN[name]
    numbers = arm.description.numbers
    lower, upper = np.maximum(numbers.lower, -np.pi), np.minimum(numbers.upper, np.pi)
    q = np.random.default_rng(2).uniform(lower, upper, (200, 7))
    T = arm.fk(q)
    found = arm.ik(T)
    assert found.allowed.any(axis=1).mean() > 0.99
    assert found.valid.any(axis=1).all()
    assert closure(arm, found, T) < 1e-11
    alone = arm.ik(T[3])
    assert np.array_equal(alone.q, found.q[3], equal_nan=True)
    assert alone.redundancy == found.redundancy[3]
    seeded = arm.ik(T, seed=q)
    assert distance(seeded, q).max() < 1e-6


def test_names_of_branches_tell_the_signs_of_joints():
    iiwa = SEVEN["KUKA iiwa 14"]
    q = states(200, 3)
    found = iiwa.ik(iiwa.fk(q), seed=q)
    for k, name in enumerate(found.branches):
        for word in name.split():
            joint = int(word[1]) - 1
            sign = np.sign(found.q[:, k, joint][found.valid[:, k]])
            assert np.all(sign == (1 if word[2] == "+" else -1))
    panda = SEVEN["Franka Panda"]
    found = panda.ik(panda.fk("ready"), seed="ready")
    assert np.abs(found.branch("q2- q4- front") - panda.configurations["ready"]).max() < 1e-9


def test_poses_beyond_reach_and_no_poses():
    arm = SEVEN["Franka Panda"]
    T = np.repeat(arm.fk("ready")[None], 3, axis=0)
    T[1, :3, 3] = (5.0, 0.0, 0.0)
    T[2, 0, 0] = np.nan
    for options in ({}, {"redundancy": 0.5}, {"redundancy": [0.5, 0.1, 0.2]}):
        found = arm.ik(T, **options)
        assert found.valid.any(axis=1).tolist() == [True, False, False]
        assert found.status_code[2] == IKStatus.not_a_pose


def test_arguments_that_do_not_fit_are_said():
    arm = SEVEN["Franka Panda"]
    T = np.repeat(arm.fk("ready")[None], 3, axis=0)
    with pytest.raises(ValueError, match=r"redundancy has shape \(2,\); expected \(\) or \(3,\)"):
        arm.ik(T, redundancy=[0.1, 0.2])
    with pytest.raises(ValueError, match="redundancy is not finite"):
        arm.ik(T, redundancy=np.nan)
    with pytest.raises(ValueError, match="out is given, but gen3 is 7R"):
        GEN3.ik(T, out=np.zeros((3, 8, 7)), redundancy=0.1)
    out = np.zeros((3, 8, 7))
    for options in ({}, {"redundancy": 0.5}, {"prefer": "limits"}, {"seed": "ready"}):
        found = arm.ik(T, out=out, **options)
        assert found.q is out
        assert np.array_equal(out, arm.ik(T, **options).q, equal_nan=True)
    for wrong in ("0.5", 2j, np.ma.masked_array([0.1], [True])):
        with pytest.raises(TypeError, match=r"redundancy: found .* expected numbers"):
            arm.ik(T, redundancy=wrong)
    for wrong in (1e300, np.inf):
        with pytest.raises(ValueError, match="redundancy is not finite or too large"):
            arm.ik(T, redundancy=wrong)
    with pytest.raises(ValueError, match=r"redundancy has shape \(1,\); expected \(\)$"):
        arm.ik(T[0], redundancy=[0.5])
    with pytest.raises(ValueError, match="redundancy and seed are given"):
        arm.ik(T, redundancy=0.5, seed="ready")
    with pytest.raises(ValueError, match="T is not a pose"):
        arm.redundancy_intervals(np.full((4, 4), np.nan))
    assert arm.ik(T, redundancy=0.5).redundancy.flags.writeable
    with pytest.raises(ValueError, match="redundancy is given, but puma560 has 6 joints"):
        Arm.load("puma560").ik(T, redundancy=0.0)


def test_gen3_whose_shoulder_has_offsets_is_solved_by_elimination(law):
    assert GEN3.family.redundant is None
    q = np.random.default_rng(1).uniform(-2, 2, (law.samples(1000, 30), 7))
    T = GEN3.fk(q)
    found = GEN3.ik(T, redundancy=q[:, 6])
    assert distance(found, q).max() < 1e-6
    assert closure(GEN3, found, T) < 1e-11
    assert np.array_equal(found.redundancy, q[:, 6])


@pytest.mark.parametrize("name", ["Franka Panda", "KUKA iiwa 14"])
def test_a_closed_path_ends_where_it_began(name):
    arm = SEVEN[name]
    q0 = np.array([0.1, -0.7, 0.2, -2.2, 0.1, 1.6, 0.8])
    angle = np.linspace(0, 2 * np.pi, 101)
    T = np.repeat(arm.fk(q0)[None], 101, axis=0)
    T[:, 0, 3] += 0.05 * (np.cos(angle) - 1)
    T[:, 2, 3] += 0.05 * np.sin(angle)
    path = arm.ik_path(T, q0)
    assert path.ok and "" not in path.branch
    assert np.abs(path.q[-1] - path.q[0]).max() < 1e-9
    assert np.abs(path.q[0] - q0).max() < 1e-9
    assert np.abs(arm.fk(path.q) - T).max() < 1e-12
    redundancy = redundancy_of(arm.description, path.q)
    assert np.ptp(redundancy) < 1e-9


@pytest.mark.parametrize("name", SEVEN)
def test_intervals_of_the_redundancy_have_solutions_inside_and_none_at_their_ends(name):
    arm = SEVEN[name]
    numbers = arm.description.numbers
    lower, upper = np.maximum(numbers.lower, -np.pi), np.minimum(numbers.upper, np.pi)
    rng = np.random.default_rng(4)
    for q in rng.uniform(lower, upper, (5, 7)):
        T = arm.fk(q)
        intervals = arm.redundancy_intervals(T)
        value = float(arm.redundancy(q))
        assert any(begin - 1e-6 <= value <= end + 1e-6 for begin, end in intervals)
        for begin, end in intervals:
            inside = rng.uniform(begin, end, 20)
            found = arm.ik(np.repeat(T[None], 20, axis=0), redundancy=inside)
            assert found.allowed.any(axis=1).all()
            for beyond in (begin - 1e-6, end + 1e-6):
                if -np.pi < beyond < np.pi and lower[6] < beyond < upper[6]:
                    assert not arm.ik(T, redundancy=beyond).allowed.any()


def test_compiled_kernels_give_the_same(monkeypatch):
    """Poses that broadcasting repeats have no memory of their own, which kernels need."""
    for name in ("Franka Panda", "KUKA iiwa 14"):
        arm = SEVEN[name]
        T = arm.fk(np.full(7, 0.3))
        intervals = arm.redundancy_intervals(T)
        preferred = arm.ik(T, prefer="limits")
        family, fit = arm.family.redundant
        solver_for(arm.description, family, fit).kernel.compile()
        assert np.allclose(arm.redundancy_intervals(T), intervals, atol=1e-8)
        again = arm.ik(T, prefer="limits")
        assert again.redundancy == preferred.redundancy
        assert np.allclose(again.q, preferred.q, atol=1e-12, equal_nan=True)
        repeated = np.broadcast_to(T, (5, 4, 4))
        assert arm.ik(repeated, redundancy=0.5).q.shape == (5, 8, 7)


def test_a_path_with_many_lost_poses_ends_soon():
    arm = SEVEN["Franka Panda"]
    T = np.repeat(arm.fk("ready")[None], 60, axis=0)
    T[:, 0, 3] += np.linspace(0, 2, 60)
    path = arm.ik_path(T, "ready")
    assert 20 < len(path.lost) < 60


def test_a_preference_chooses_the_best_of_the_tried_values():
    arm = SEVEN["Franka Panda"]
    numbers = arm.description.numbers
    q = np.random.default_rng(5).uniform(numbers.lower, numbers.upper, (20, 7))
    T = arm.fk(q)
    half = (numbers.upper - numbers.lower) / 2

    def margin(found):
        inside = found.within_limits()
        shares = np.minimum(inside - numbers.lower, numbers.upper - inside) / half
        return np.nan_to_num(shares.min(axis=-1), nan=-1.0).max(axis=-1)

    plain = arm.ik(T)
    far = arm.ik(T, prefer="limits")
    assert np.all(margin(far) >= margin(plain) - 1e-12)
    assert np.mean(margin(far)) > np.mean(margin(plain)) + 0.05
    free = arm.ik(T, prefer="manipulability")

    def best(found):
        inside = found.within_limits()
        measure = arm.manipulability(np.nan_to_num(inside), "whole")
        return np.where(found.allowed, measure, 0.0).max(axis=-1)

    assert np.all(best(free) >= best(plain) - 1e-12)
    posture = arm.configurations["ready"]
    near = arm.ik(T, prefer=posture)
    gaps = [
        np.nanmin(np.sum((found.within_limits(posture) - posture) ** 2, axis=-1), axis=-1)
        for found in (near, plain)
    ]
    assert np.all(gaps[0] <= gaps[1] + 1e-12)
    with pytest.raises(ValueError, match="prefer is 'speed'; expected 'limits', 'manip"):
        arm.ik(T, prefer="speed")
    with pytest.raises(ValueError, match="prefer is given with redundancy or seed"):
        arm.ik(T, prefer="limits", redundancy=0.1)


def angles_on_the_wrong_side(arm, T):
    """Return how many values of a fine grid are inside an interval but not allowed, or the other way round."""
    grid = np.linspace(*redundancy_range(arm.description), 20_001)
    intervals = arm.redundancy_intervals(T)
    found = arm.ik(np.broadcast_to(T, (len(grid), 4, 4)), redundancy=grid)
    inside = np.zeros(len(grid), dtype=bool)
    is_near = np.zeros(len(grid), dtype=bool)
    for begin, end in intervals:
        inside |= (grid >= begin) & (grid <= end)
        # A joint may be beyond its limit by 1e-9 rad; where it only touches its limit, that is a wide step of psi.
        is_near |= (np.abs(grid - begin) < 1e-4) | (np.abs(grid - end) < 1e-4)
    return np.count_nonzero((inside != found.allowed.any(axis=-1)) & ~is_near)


@pytest.mark.law
@pytest.mark.parametrize("name", ["KUKA iiwa 14", "an iiwa with offsets"])
def test_intervals_of_an_arm_angle_are_those_of_a_fine_grid(name, law):
    """None is too narrow, and none is joined across a narrow gap: their ends are roots."""
    limit = np.radians([170, 120, 170, 120, 170, 120, 175]) * (0.5 if "offsets" in name else 1.0)
    arm = SEVEN[name].with_limits(lower=-limit, upper=limit)
    rng = np.random.default_rng(8)
    wrong = sum(
        angles_on_the_wrong_side(arm, arm.fk(q))
        for q in rng.uniform(-limit, limit, (law.samples(1_000, 20), 7))
    )
    law.holds("angles on the wrong side of an end", wrong, 0, name)


@pytest.mark.law
@pytest.mark.parametrize(
    "name", ["Franka Panda", "UFACTORY xArm 7", "oblique elbow and wrist", "two turns"]
)
def test_intervals_of_joint_7_are_those_of_a_fine_grid(name, law):
    """Half a degree apart, samples had missed an interval or a gap at one pose in a hundred."""
    arm = SEVEN["Franka Panda" if name == "two turns" else name]
    numbers = arm.description.numbers
    lower, upper = np.maximum(numbers.lower, -2.6), np.minimum(numbers.upper, 2.6)
    lower[6], upper[6] = (-5.0, 6.1) if name == "two turns" else (-2.8, 2.8)
    arm = arm.with_limits(lower=lower, upper=upper)
    rng = np.random.default_rng(8)
    wrong = sum(
        angles_on_the_wrong_side(arm, arm.fk(q))
        for q in rng.uniform(lower, upper, (law.samples(1_000, 20), 7))
    )
    law.holds("values on the wrong side of an end", wrong, 0, name)


@pytest.mark.parametrize("name", ["Franka Panda", "KUKA iiwa 14"])
def test_compiled_intervals_are_those_of_the_interpreter(name):
    arm = SEVEN[name]
    limit = np.full(7, 2.2)
    arm = arm.with_limits(lower=-limit, upper=limit)
    by_roots = intervals_by_roots(arm.description)
    poses = [arm.fk(q) for q in np.random.default_rng(14).uniform(-limit, limit, (20, 7))]
    interpreted = [by_roots.interpreted(T) for T in poses]
    by_roots.compile()
    for T, (state, expected) in zip(poses, interpreted, strict=True):
        same, found = by_roots(T)
        assert state == same and np.allclose(found, expected, rtol=0, atol=1e-6)
        assert arm.redundancy_intervals(T) == found
        assert np.allclose(arm.redundancy_intervals(T.tolist()), found, rtol=0, atol=1e-6)
    assert by_roots(np.eye(3)) is None and by_roots(poses[0].tolist()) is None
    far = poses[0].copy()
    far[:3, 3] += 10
    assert by_roots(far)[1] == []
    for wrong in (np.full((4, 4), np.nan), np.ones((4, 4))):
        with pytest.raises(ValueError, match="T is not a pose"):
            arm.redundancy_intervals(wrong)
    for count in (1, 3):
        with pytest.raises(ValueError, match=rf"T has shape \({count}, 4, 4\); expected \(4, 4\)"):
            arm.redundancy_intervals(np.array(poses[:count]))


@pytest.mark.parametrize(
    "quarters", [(2, 0, 0, 0, 1, 2, 1), (-3, -2, -4, -2, -3, 0, -4), (1, 0, 1, -2, 0, 0, -1)]
)
def test_intervals_of_an_arm_stretched_along_its_first_axis(quarters):
    """Joints 1 and 3 turn about one line at every arm angle: no root tells where one of them is at a limit."""
    q = np.array(quarters) * np.pi / 2
    rng = np.random.default_rng(9)
    arm = SEVEN["KUKA iiwa 14"]
    for _ in range(5):
        arm = arm.with_limits(
            lower=q - rng.uniform(0.1, 3.0, 7), upper=q + rng.uniform(0.1, 3.0, 7)
        )
        assert angles_on_the_wrong_side(arm, arm.fk(q)) == 0


def test_the_posture_to_be_near_to_is_found_where_the_pose_is_its_own():
    arm = SEVEN["Franka Panda"]
    numbers = arm.description.numbers
    for q in np.random.default_rng(11).uniform(numbers.lower, numbers.upper, (10, 7)):
        found = arm.ik(arm.fk(q), prefer=q)
        assert np.abs(found.nearest(q, limits=True) - q).max() < 1e-9


def test_a_refined_preference_is_near_the_best_of_many_values():
    arm = SEVEN["Franka Panda"]
    numbers = arm.description.numbers
    posture = arm.configurations["ready"]
    values = np.linspace(numbers.lower[6], numbers.upper[6], 5001)
    gaps = []
    for q in np.random.default_rng(12).uniform(numbers.lower, numbers.upper, (10, 7)):
        T = arm.fk(q)
        every = arm.ik(np.broadcast_to(T, (len(values), 4, 4)), redundancy=values)
        near = arm.ik(T, prefer=posture).nearest(posture, limits=True)
        best = np.nanmin(np.sum((every.within_limits(posture) - posture) ** 2, axis=-1))
        gaps.append(np.sum((near - posture) ** 2) - best)
    assert np.median(gaps) < 1e-3


def test_a_pose_that_one_redundancy_misses_is_not_said_out_of_reach():
    arm = SEVEN["Franka Panda"]
    T = arm.fk("ready")
    found = arm.ik(T, redundancy=2.5)
    assert str(found.status) == "not_found" and not found.reached
    assert "not_found, 0 reached" in repr(found)
    with pytest.raises(UnreachableError, match=r"at the redundancy 2.5 rad.*redundancy_intervals"):
        found.require()
    T[:3, 3] *= 20
    for far in (arm.ik(T), arm.ik(T, redundancy=0.1)):
        assert str(far.status) == "out_of_reach" and "by" not in repr(far)


@pytest.mark.parametrize("name", [*SEVEN, "Kinova Gen3"])
def test_a_path_keeps_its_redundancy_or_has_the_one_that_is_given(name):
    arm = SEVEN.get(name, GEN3)
    q0 = np.array([0.1, 0.5, -0.3, 1.2, 0.4, -0.8, 0.6])
    T = np.repeat(arm.fk(q0)[None], 40, axis=0)
    T[:, 0, 3] += 0.05 * np.sin(np.linspace(0, 2 * np.pi, 40))
    path = arm.ik_path(T, q0, limits=False)
    assert path.ok and np.abs(path.q[-1] - path.q[0]).max() < 1e-9
    assert np.ptp(arm.redundancy(path.q)) < 1e-9

    given = arm.redundancy(q0) + np.linspace(0, 0.2, 40)
    path = arm.ik_path(T, q0, limits=False, redundancy=given)
    assert path.ok and np.abs(arm.redundancy(path.q) - given).max() < 1e-9
    assert np.abs(arm.fk(path.q) - T).max() < 1e-11
    puma = Arm.load("puma560")
    with pytest.raises(ValueError, match="redundancy is given, but puma560 has 6 joints"):
        puma.ik_path(puma.fk(np.zeros((2, 6))), np.zeros(6), redundancy=0.1)


def test_chunks_of_seven_joints_are_those_of_one_call():
    arm = SEVEN["Franka Panda"]
    q = np.random.default_rng(13).uniform(-1, 1, (50, 7))
    T = arm.fk(q)
    every = arm.ik(T, redundancy=q[:, 6])
    for rows, found in arm.ik_chunks(T, size=16, redundancy=q[:, 6]):
        assert np.array_equal(found.q, every.q[rows], equal_nan=True)


@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("Franka Panda", (0.5, 0.0, 0.3, -2.0, 0.0, 1.6, 0.8)),
        ("KUKA iiwa 14", (0.5, 0.0, 0.3, -1.0, 0.4, 0.7, 0.8)),
        ("KUKA iiwa 14", (0.5, 0.6, 0.3, -1.0, 0.4, 0.0, 0.8)),
        ("an iiwa with offsets", (0.5, 0.6, 0.3, -1.0, 0.4, 0.7, 0.8)),
    ],
)
def test_joints_that_a_singularity_leaves_free_come_from_the_seed(name, q):
    arm = SEVEN[name]
    q = np.array(q)
    T = arm.fk(q)
    assert np.abs(arm.ik(T, seed=q).nearest(q) - q).max() < 1e-9
    path = arm.ik_path(np.repeat(T[None], 3, axis=0), q, limits=False)
    assert path.ok and path.start < 1e-9


def test_narrow_intervals_are_found_where_equations_are_not_known_well():
    """Poses near several singularities; the intervals are narrower than the steps in which they are sampled."""
    limits = {
        "lower": [-0.0963, -0.0222, -2.5078, -0.9940, -1.7601, -0.0922, -0.3631],
        "upper": [0.0963, 0.0222, 0.6615, 0.9940, 1.7601, 0.0922, -0.3118],
    }
    arm = SEVEN["Franka Panda"].with_limits(**limits)
    q = [0.0745181818285851, 0.014759557901796408, -1.046256704765849, 0.3080921798132994]
    q += [1.2078944383482335, 0.05637581649646592, -0.31904501065750757]
    T = arm.fk(q)
    before = arm.redundancy_intervals(T)
    intervals_by_roots(arm.description).compile()
    for found in (before, arm.redundancy_intervals(T)):
        assert np.allclose(found, [(-0.319748, -0.314807)], rtol=0, atol=2e-6)
