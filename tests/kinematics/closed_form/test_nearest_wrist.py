"""Distances of poses out of reach, beside SciPy's least squares from the nearest of many sampled states.

Module: nearest_wrist.
"""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import dhkit

STATES = 20_000
EXACT = 1e-8
"""m: least squares end where the squared distance changes no more."""


@pytest.fixture(scope="module", params=["puma560", "stanford", "puma560_cao"])
def arm(request):
    return dhkit.Arm.load(request.param)


def wrist_centres(arm, q):
    """Return the wrist's centres, shape (N, 3), m: where axes 4, 5 and 6 meet is the origin of frame 4."""
    return arm.frames(q)[..., 4, :3, 3]


def any_joints(arm, rng, count):
    """Return random joint values; limits do not count for ``distance``."""
    q = rng.uniform(-np.pi, np.pi, (count, arm.n))
    slides = arm.description.numbers.prismatic
    q[:, slides] = rng.uniform(-3, 3, (count, int(slides.sum())))
    return q


def poses_beyond(arm, rng, count):
    """Return poses of the tool, shape (N, 4, 4), that are out of reach, and the wrist's centres that they need (N, 3).

    A Stanford arm, whose boom has any length, reaches all but points near axis 1.
    """
    spread = (
        np.array([0.15, 0.15, 1.0]) if arm.description.numbers.prismatic.any() else np.full(3, 1.5)
    )
    zero = np.zeros(arm.n)
    t_tool_wrist = (np.linalg.inv(arm.fk(zero)) @ np.r_[wrist_centres(arm, zero), 1])[:3]
    wanted = rng.uniform(-1, 1, (count, 3)) * spread
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = Rotation.random(count, rng=rng).as_matrix()
    T[:, :3, 3] = wanted - T[:, :3, :3] @ t_tool_wrist
    beyond = arm.ik(T).distance > 0
    return T[beyond], wanted[beyond]


def nearest(off, first):
    """Return the least distance that SciPy finds from ``first``, m.

    Where the wrist is nearly on axis 1, J^T J is singular at the minimum and steps converge linearly: 1,300 evaluations
    were seen, where SciPy's own limit is 300.
    """
    found = least_squares(off, first, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=10_000)
    return np.linalg.norm(found.fun)


@pytest.mark.slow
def test_no_state_is_nearer_and_one_is_as_near(arm, law):
    rng = np.random.default_rng(0)
    sampled = any_joints(arm, rng, STATES)
    reached = wrist_centres(arm, sampled)
    poses, centres = poses_beyond(arm, rng, law.samples(2000))
    assert len(poses) > 5
    for trial, (T, wanted) in enumerate(zip(poses, centres, strict=True)):
        distance = float(arm.ik(T).distance)
        away = np.linalg.norm(reached - wanted, axis=1)
        law.holds("m nearer by sampling", distance - away.min(), EXACT, trial)

        def off(first, wanted=wanted):
            return wrist_centres(arm, np.r_[first, 0, 0, 0]) - wanted

        best = min(nearest(off, sampled[k, :3]) for k in np.argsort(away)[:2])
        law.holds("m beside least squares", abs(best - distance), EXACT, trial)


def test_batches_have_the_distances_of_single_poses(arm):
    rng = np.random.default_rng(1)
    poses, _ = poses_beyond(arm, rng, 60_000 if arm.name == "stanford" else 20_000)
    assert len(poses) > 5000
    every = arm.ik(poses).distance
    some = rng.choice(len(poses), 20)
    np.testing.assert_allclose(every[some], [arm.ik(poses[k]).distance for k in some], atol=1e-14)
