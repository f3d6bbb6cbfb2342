"""Arms whose axes are nearly those of a family: what is reached is found, closes by Pinocchio, and is flagged."""

import numpy as np
import pinocchio
import pytest

from dhkit import Arm, IKFlag, UnreachableError
from dhkit.kinematics import classify

TILTS = (1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10)
"""rad: deviations of axes from parallel or perpendicular."""
CLOSES = 1e-9
"""m and 1: solutions close to 1e-10 of the reach."""
SAME = 1e-5
"""rad: distance to the joint values that made a pose; a regular solution of residual 1e-10 is nearer."""
RIGHT = np.pi / 2


def tilted_elbow(tilt):
    """Return a PUMA-like arm whose axes 2 and 3 are off parallel."""
    rows = [
        (0, 0.3, 0, RIGHT),
        (0, 0, 0.4, tilt),
        (0, 0.1, 0.05, -RIGHT),
        (0, 0.4, 0, RIGHT),
        (0, 0, 0, -RIGHT),
    ]
    return Arm.from_dh([*rows, (0, 0.1, 0, 0)], name="tilted_elbow")


def scattered_wrist(tilt):
    """Return a PUMA-like arm whose axes 4, 5 and 6 do not quite meet, and are not quite perpendicular."""
    rows = [(0, 0.3, 0.1, RIGHT), (0, 0, 0.4, 0), (0, 0.1, 0.05, tilt - RIGHT), (0, 0.4, 0, RIGHT)]
    return Arm.from_dh(
        [*rows, (0, 0.4 * tilt, 0.3 * tilt, -RIGHT), (0, 0.1, 0, 0)], name="scattered_wrist"
    )


def calibrated_ur(tilt):
    """Return an arm like a UR5 after calibration, with every twist a little off."""
    rows = [
        (0, 0.089, 0, RIGHT + tilt),
        (0, tilt, -0.425, tilt),
        (0, 0, -0.392, -tilt),
        (0, 0.109, 0, RIGHT),
    ]
    return Arm.from_dh([*rows, (0, 0.0946, 0, tilt - RIGHT), (0, 0.08, 0, 0)], name="calibrated_ur")


ARMS = (tilted_elbow, scattered_wrist, calibrated_ur)


def poses_by_pinocchio(arm, q):
    """Return the poses of the tool, shape (N, 4, 4), by Pinocchio."""
    model = arm.model
    data = model.createData()
    tool = model.getFrameId("tool")
    poses = np.empty((len(q), 4, 4))
    for k, state in enumerate(q):
        pinocchio.framesForwardKinematics(model, data, state)
        poses[k] = data.oMf[tool].homogeneous
    return poses


def nearest_gaps(solutions, q):
    """Return the largest joint difference from states (N, n) to the nearest solution, shape (N,), rad."""
    turned = np.abs(np.remainder(solutions.q - q[:, None] + np.pi, 2 * np.pi) - np.pi).max(axis=-1)
    return np.where(solutions.valid, turned, np.inf).min(axis=1)


@pytest.mark.parametrize("make", ARMS)
@pytest.mark.parametrize("tilt", TILTS)
def test_the_joint_values_that_made_a_pose_are_among_its_solutions(make, tilt):
    arm = make(tilt)
    assert not classify(arm.description).closed_form
    q = np.random.default_rng(0).uniform(-3, 3, (30, 6))
    T = poses_by_pinocchio(arm, q)
    found = arm.ik(T)
    assert set(found.status) <= {"ok", "singular"}
    assert nearest_gaps(found, q).max() < SAME
    row, branch = np.nonzero(found.valid)
    assert np.abs(poses_by_pinocchio(arm, found.q[row, branch]) - T[row]).max() < CLOSES
    assert np.all(found.flags[found.valid] & IKFlag.refined)
    assert np.isnan(found.q[~found.valid]).all()
    assert np.all(found.flags[~found.valid] == 0)


@pytest.mark.parametrize("make", ARMS)
@pytest.mark.parametrize("tilt", [1e-3, 1e-6])
def test_poses_near_the_boundary_are_reached(make, tilt):
    """Where the arm is stretched but for 1e-4 rad or less, its neighbour may be too short."""
    arm = make(tilt)
    rng = np.random.default_rng(1)
    q = rng.uniform(-3, 3, (60, 6))
    stretched = 0.0 if make is calibrated_ur else np.arctan2(0.4, 0.05) - np.pi
    q[:, 2] = stretched + rng.uniform(-1e-4, 1e-4, 60)
    found = arm.ik(poses_by_pinocchio(arm, q))
    assert set(found.status) <= {"ok", "singular"}


@pytest.mark.parametrize("make", ARMS)
@pytest.mark.parametrize("tilt", [1e-3, 1e-6])
def test_no_solution_is_returned_twice(make, tilt):
    arm = make(tilt)
    q = np.random.default_rng(2).uniform(-3, 3, (50, 6))
    found = arm.ik(arm.fk(q))
    between = np.abs(np.exp(1j * found.q[:, :, None]) - np.exp(1j * found.q[:, None])).max(axis=-1)
    assert (np.nan_to_num(between, nan=np.inf) + 9 * np.eye(len(found))).min() > 1e-7


def test_only_what_is_proved_is_out_of_reach():
    arm = tilted_elbow(1e-6)
    T = np.tile(arm.fk(np.full(6, 0.3)), (5, 1, 1))
    T[1, :3, 3] = [0, 0, 0.3]  # between both shoulders, where the wrist does not come
    T[2, :3, 3] = [3, 0, 0]
    T[3, :3, 3] = 1e200
    T[4, 0, 0] = np.nan
    found = arm.ik(T)
    assert found.status.tolist() == [
        "ok",
        "not_found",
        "out_of_reach",
        "out_of_reach",
        "not_a_pose",
    ]
    assert np.array_equal(found.valid.any(axis=1), [True, False, False, False, False])
    assert found.distance[0] == 0
    assert np.isnan(found.distance[1:]).all()
    with pytest.raises(
        UnreachableError, match="no solution was found, which does not prove that there is none"
    ):
        arm.ik(T[1]).require()


def test_branches_are_those_of_the_neighbour_and_one_for_others():
    exact, tilted = tilted_elbow(0), tilted_elbow(1e-7)
    q = np.array([0.3, 0.5, -1.2, 0.4, 0.9, -0.2])
    at_exact, at_tilted = exact.ik(exact.fk(q)), tilted.ik(tilted.fk(q))
    assert at_tilted.branches == (*at_exact.branches, "other")
    assert np.allclose(at_tilted.q[:-1], at_exact.q, rtol=0, atol=1e-5, equal_nan=True)
    assert at_tilted.met == at_exact.met


def test_shapes_and_batches():
    arm = calibrated_ur(1e-4)
    T = arm.fk(np.random.default_rng(3).uniform(-3, 3, (2, 3, 6)))
    found = arm.ik(T)
    assert found.q.shape == (2, 3, 9, 6)
    assert np.allclose(arm.ik(T[1, 2]).q, found.q[1, 2], rtol=0, atol=1e-9, equal_nan=True)
    assert arm.ik(T[:0]).q.shape == (0, 3, 9, 6)


def test_the_free_joint_of_the_neighbour_comes_from_the_seed():
    """Where axes 4 and 6 coincide, joint 4 starts at the seed's."""
    arm = tilted_elbow(1e-8)
    q = np.array([0.3, 0.5, -1.2, 0.7, 0.0, 0.2])
    near = arm.ik(arm.fk(q), seed=q).nearest(q)
    assert np.abs(arm.fk(near) - arm.fk(q)).max() < CLOSES


@pytest.mark.parametrize(
    ("twist", "offset"),
    [(1e-15, 0), (1e-14, 0), (9e-13, 0), (0, 1e-15), (0, 1e-14), (0, 9e-13), (0, 0)],
)
def test_poses_at_the_boundary_of_an_arm_that_nearly_is_of_a_family_are_reached(law, twist, offset):
    """Stretched and folded: the family's member is 1e-6 of the reach too short for an arm that misses it by 1e-12."""
    right = np.pi / 2
    rows = [
        (0, 0.3, 0, right),
        (0, 0, 0.4, twist),
        (0, 0.1, 0.05, -right),
        (0, 0.4, offset, right),
        (0, 0, 0, -right),
        (0, 0.1, 0, 0),
    ]
    arm = Arm.from_dh(rows)
    assert arm.family.closed_form
    rng = np.random.default_rng(0)
    count = law.samples(300, quick=40)
    q = rng.uniform(-np.pi, np.pi, (count, 6))
    q[:, 2] = (
        rng.choice([-right, right], count)
        + np.arctan2(0.05, 0.4)
        + rng.choice([0, 1e-9, 1e-6], count)
    )
    T = arm.fk(q)
    found = arm.ik(T)
    law.holds("poses that are not reached", int(np.sum(~found.valid.any(axis=1))), 0)
    back = arm.fk(np.where(found.valid[..., None], found.q, 0.0))
    law.holds(
        "closing", float(np.abs(back - T[:, None]).max(axis=(2, 3))[found.valid].max()), 1e-10
    )
