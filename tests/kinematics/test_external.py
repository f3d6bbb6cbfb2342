"""Laws of inverse kinematics by ssik: what is returned closes, nothing is lost on the way, errors say what to do."""

import logging
import os
import sys

import numpy as np
import pytest

import acceptance
from dhkit import Arm
from dhkit.description import from_dh, library_robot, pose, with_base, with_tool
from dhkit.errors import ModelError
from dhkit.kinematics import IKFlag, classify, external, forward_kinematics, inverse_kinematics
from dhkit.kinematics.external import solve_externally

CLOSES = 1e-10  # share of the reach and rad: what solve_externally promises

# Two axes meet at the wrist only, axes 2 and 3 are not parallel: no closed form of ours, and one of ssik's.
TWISTED = [
    (0, 0.3, 0, "pi/2"),
    (0, 0, 0.4, "pi/2"),
    (0, 0.1, 0, "pi/2"),
    (0, 0.4, 0, "pi/2"),
    (0, 0, 0, "pi/2"),
]
TWISTED = [*TWISTED, (0, 0.1, 0, 0)]


@pytest.fixture
def ssik():
    return pytest.importorskip("ssik")


def twisted():
    arm = from_dh(TWISTED, name="twisted")
    return with_tool(
        with_base(arm, pose((0.1, 0.2, 0.3), euler=(0.3, 0.2, 0.1))),
        pose((0, 0.1, 0.2), euler=(1, 2, 3)),
    )


def poses(arm, count, seed=0):
    numbers = arm.numbers
    lower, upper = np.maximum(numbers.lower, -np.pi), np.minimum(numbers.upper, np.pi)
    q = np.random.default_rng(seed).uniform(lower, upper, (count, arm.n))
    return q, forward_kinematics(arm, q)


def check(arm, found, T):
    """Hold what is returned to what is promised of it."""
    apart = np.abs(forward_kinematics(arm, found.q) - T[:, None])[found.valid]
    assert apart.max() <= CLOSES * max(1.0, arm.reach)
    angles = found.q[found.valid]
    assert np.all((angles > -np.pi) & (angles <= np.pi))
    assert np.isnan(found.q[~found.valid]).all()
    assert found.branches == tuple(f"solution {k + 1}" for k in range(found.q.shape[-2]))
    # Valid rows come first, in the order of their joint values.
    counts = found.valid.sum(axis=1)
    assert np.array_equal(found.valid, np.arange(len(found.branches)) < counts[:, None])
    assert max(1, counts.max()) == len(found.branches)
    first = np.where(found.valid, found.q[..., 0], 2 * np.pi)
    assert np.all(np.diff(first, axis=1) > -2 * external.SAME_ANGLE)


def test_all_solutions_of_six_joints(ssik):
    """The joint values that made a pose are among its solutions, and no two are the same."""
    arm = twisted()
    assert classify(arm).family is None
    q, T = poses(arm, 25)
    found = inverse_kinematics(arm, T)
    check(arm, found, T)
    assert (found.status == "ok").all() and not found.distance.any()
    assert np.abs(found.nearest(q) - q).max() < 1e-9
    between = np.abs(np.exp(1j * found.q[:, :, None]) - np.exp(1j * found.q[:, None])).max(axis=-1)
    twins = np.nan_to_num(between, nan=np.inf) + 9 * np.eye(len(found.branches))
    assert twins.min() > 1e-4


def test_solutions_of_a_redundant_arm(ssik):
    """The Panda has curves of solutions: many points of them close, some of them inside its limits."""
    arm = library_robot("panda")
    _, T = poses(arm, 6)
    found = Arm(arm).ik(T)
    check(arm, found, T)
    assert found.valid.sum(axis=1).min() >= 8
    outside = found.flags[found.valid] == IKFlag.out_of_limits
    windings = found.q[found.valid][:, None] + 2 * np.pi * np.arange(-1, 2)[:, None]
    fits = (windings >= arm.numbers.lower) & (windings <= arm.numbers.upper)
    assert np.array_equal(fits.any(axis=1).all(axis=1), ~outside)
    assert outside.any() and not outside.all()


def prepared():
    """Whether ssik has derived the Jaco's solver on this machine before: that takes a minute."""
    from ssik._prep_cache import cache_dir

    folder = cache_dir()
    return folder is not None and folder.is_dir() and any(folder.iterdir())


@pytest.mark.slow
def test_the_jaco_has_the_solutions_that_ssik_counts(ssik, law):
    if not (acceptance.ACCEPTING or prepared() or "ssik" in os.environ.get("DHKIT_REQUIRE", "")):
        pytest.skip("ssik would derive a solver for a minute; `make accept` does")
    arm = library_robot("jaco")
    q, T = poses(arm, law.samples(400))
    found = inverse_kinematics(arm, T)
    check(arm, found, T)
    law.holds(
        "rad to the joint values that made the pose", np.abs(found.nearest(q) - q).max(), 1e-6
    )
    solver = external._solver(arm)
    theirs = [
        len(solver.solve(goal, respect_limits=False)) for goal in T @ external._tool_axes(arm)
    ]
    law.holds("solutions lost", np.max(theirs - found.valid.sum(axis=1)), 0)


def test_poses_that_are_not_reached_or_none(ssik):
    arm = twisted()
    _, T = poses(arm, 4)
    T[1, :3, 3] += 5
    T[2, 0, 0] = np.nan
    T[3, :3, 3] = 1e300
    found = solve_externally(arm, T)
    assert found.status.tolist() == ["ok", "out_of_reach", "not_a_pose", "out_of_reach"]
    assert np.isnan(found.distance[1:]).all() and found.distance[0] == 0
    alone = solve_externally(arm, T[1])
    assert alone.q.shape == (1, 6) and np.isnan(alone.q).all() and len(alone) == 1
    assert solve_externally(arm, T[:0]).q.shape == (0, 1, 6)
    shaped = solve_externally(arm, T.reshape(2, 2, 4, 4))
    assert np.array_equal(shaped.q.reshape(found.q.shape), found.q, equal_nan=True)


def test_a_failure_of_the_solver_is_logged(ssik, caplog):
    class Fails:
        def solve(self, goal, **options):
            raise np.linalg.LinAlgError("singular matrix")

    with caplog.at_level(logging.WARNING):
        assert external._solutions(Fails(), np.eye(4), 7).shape == (0, 7)
    assert "singular matrix" in caplog.text


def test_the_solver_is_prepared_once(ssik, caplog):
    arm = from_dh([*TWISTED[:-1], (0, 0.123, 0, 0)], name="once")
    _, T = poses(arm, 1)
    with caplog.at_level(logging.INFO, logger="dhkit.kinematics.external"):
        solve_externally(arm, T)
        solve_externally(arm, T)
    assert [
        record.message for record in caplog.records if record.name == "dhkit.kinematics.external"
    ] == ["preparing ssik for once, which may take a minute the first time"]


def test_without_ssik_the_error_says_how_to_get_it_and_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "ssik", None)
    arm = from_dh([*TWISTED[:-1], (0, 0.321, 0, 0)], name="plain")
    with pytest.raises(
        ModelError,
        match=r"plain is 6R: no closed form known; `\.venv/bin/pip install -e '\.\[ik\]'`.*ik_numeric",
    ):
        inverse_kinematics(arm, np.eye(4))
    assert Arm(arm).ik_numeric(forward_kinematics(arm, np.full(6, 0.3))).valid.all()


@pytest.mark.parametrize("kinds", ["RRRRR", "RRPRRR", "RRRRRRRR"])
def test_arms_that_ssik_does_not_take(kinds):
    arm = from_dh([(0, 0.1 * (k + 1), 0.2, 0.3 * k + 0.1) for k in range(len(kinds))], kinds=kinds)
    assert classify(arm).family is None
    with pytest.raises(ModelError, match="no closed form known; ik_numeric solves any arm"):
        inverse_kinematics(arm, np.eye(4))


def test_arguments_that_do_not_fit_are_said():
    arm = twisted()
    with pytest.raises(ValueError, match="out is given, but twisted is 6R"):
        inverse_kinematics(arm, np.eye(4), out=np.zeros((8, 6)))
    with pytest.raises(ValueError, match=r"T has shape \(3, 3\)"):
        solve_externally(arm, np.eye(3))


@pytest.mark.slow
def test_what_ssik_misses_is_found_by_iteration(ssik):
    """The published table of the Kinova Gen3 Lite: of 200 poses 6 lacked the joint values that they were made of."""
    rows = [
        (0, 0, 0, 243.3),
        (90, 0, 90, 30),
        (180, 280, 90, 20),
        (90, 0, 90, 245),
        (90, 0, 180, 57),
        (90, 0, 90, 235),
    ]
    arm = Arm.from_dh(
        rows,
        order=("alpha", "a", "theta", "d"),
        angle="deg",
        length="mm",
        convention="modified",
        name="gen3_lite",
    )
    q = np.random.default_rng(0).uniform(-2.5, 2.5, (200, 6))[:: 1 if acceptance.ACCEPTING else 5]
    found = arm.ik(arm.fk(q))
    nearest = np.nanmin(np.abs(np.angle(np.exp(1j * (found.q - q[:, None])))).max(axis=-1), axis=-1)
    regular = np.linalg.svd(arm.jacobian(q), compute_uv=False)[:, -1] > 1e-3
    assert not np.any(regular & (nearest > 1e-6))
    assert not found.complete and "may be incomplete" in repr(found)
    closing = np.abs(arm.fk(np.where(found.valid[..., None], found.q, 0)) - arm.fk(q)[:, None]).max(
        axis=(2, 3)
    )
    assert closing[found.valid].max() < CLOSES


def test_an_arm_that_ssik_refuses_is_solved_by_iteration(ssik):
    """Four axes meet in one point."""
    right = np.pi / 2
    rows = [
        (0, 0, 0.3, -right),
        (0, 1.0, 0.4, right),
        (0, 0.65, 0, right),
        (0, 0, 0, right),
        (0, 0, 0, right),
    ]
    arm = Arm.from_dh([*rows, (0, 0, 0.15, -right)])
    T = arm.fk([0.3, 0.4, -0.5, 0.6, 0.7, 0.2])
    found = arm.ik(T)
    assert found.valid.any()
    assert np.abs(arm.fk(found.q[found.valid]) - T).max() < 1e-9
