"""References given by poses of the tool: one pose, or poses reached at given times."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, Robot, check_pose, description_of, joint_vector
from dhkit.description.arrays import number_array
from dhkit.description.poses import one_pose
from dhkit.display import counted, repr_line
from dhkit.errors import PlanningError, UnreachableError
from dhkit.kinematics import classify, forward_kinematics, inverse_kinematics, solve_numerically
from dhkit.trajectories import Trajectory, straight_line


@dataclass(frozen=True, eq=False)
class ToolPoses:
    """Poses of the tool reached at given times, with straight motions in between that come to rest at each pose.

    On the way from one pose to the next the tool's origin stays on a line and the tool turns evenly about one axis, at
    s(t) = 10 t^3 - 15 t^4 + 6 t^5 (:func:`dhkit.trajectories.straight_line`). The first pose is held before its time,
    the last one after its own.

    Parameters
    ----------
    robot
        The arm, or its description.
    poses
        Poses in the world, shape (k, 4, 4); or positions of the tool's origin, shape (k, 3), m, for which the tool
        keeps the orientation that it has at ``q0``. Arms that turn their tool only as its position asks for, such as
        planar2r, follow the positions alone on the way.
    times
        Times at which the poses are reached, shape (k,), s, ascending, the first not below 0.
    q0
        Joint values, shape (n,), rad and m, for choosing the nearest solution at the first pose; the middle of the
        joint limits unless given.

    Raises
    ------
    ValueError
        Other shapes, matrices that are not poses, times that do not ascend, positions without ``q0``.
    TypeError
        Not an arm, or gains that are not numbers.
    UnreachableError
        The arm does not reach the first pose inside its limits.
    PlanningError
        The arm cannot follow one of the lines, or not in the given time: names the line and the place.

    Examples
    --------
    >>> from dhkit import Arm
    >>> arm = Arm.load("planar2r")
    >>> corners = [[0.6, 0.3, 0.0], [0.3, 0.6, 0.0], [0.6, 0.3, 0.0]]
    >>> run = arm.simulate(reference=ToolPoses(arm, corners, [0.0, 1.0, 2.0], q0=[0.1, 0.9]), duration=0.01)
    >>> arm.fk(run.reference_q[0])[:2, 3].round(6).tolist()
    [0.6, 0.3]
    """

    robot: Robot
    poses: ArrayLike
    times: ArrayLike
    q0: ArrayLike | None = None
    _first: Array = field(init=False, repr=False)
    _motions: tuple[Trajectory, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        description = description_of(self.robot)
        q0 = None if self.q0 is None else joint_vector(description, self.q0, "q0")
        poses = _poses(description, self.poses, q0)
        times = _times(self.times, len(poses))
        first = joints_at_pose(description, poses[0], q0, "pose 0")
        motions: list[Trajectory] = []
        q = first
        for k, (T0, T1) in enumerate(pairwise(poses)):
            try:
                motion = straight_line(
                    description, T0, T1, q, duration=float(times[k + 1] - times[k])
                )
            except PlanningError as error:
                raise PlanningError(f"from pose {k} to pose {k + 1}: {error}") from None
            motions.append(motion)
            q = motion.q(motion.duration)
        for name, value in (
            ("poses", poses),
            ("times", times),
            ("_first", first),
            ("_motions", tuple(motions)),
        ):
            object.__setattr__(self, name, value)

    @property
    def duration(self) -> float:
        """Time at which the last pose is reached, s."""
        return float(self._knots[-1])

    @property
    def jumps(self) -> Array:
        """Times at which the jerk jumps, shape (jumps,), s: at the poses, and between pieces of the joints' motion."""
        return np.concatenate(
            [self._knots, *(self._knots[k] + m.breaks for k, m in enumerate(self._motions))]
        )

    def __repr__(self) -> str:
        poses = (
            f"{counted(len(self._knots), 'pose')} from {self._knots[0]:g} to {self.duration:g} s"
        )
        return repr_line("ToolPoses", description_of(self.robot).name, poses)

    @cached_property
    def _knots(self) -> Array:
        return np.asarray(self.times, dtype=float)

    def sampled(self, t: Array) -> tuple[Array, Array, Array]:
        """Return joint values, rates and accelerations at times (N,), shape (N, n) each.

        Parameters
        ----------
        t
            Times, shape (N,), s.
        """
        q = np.zeros((len(t), len(self._first))) + self._first
        qd = np.zeros_like(q)
        qdd = np.zeros_like(q)
        # Each motion writes all rows from its beginning on, at its end where it is over, and the next overwrites those.
        for k, motion in enumerate(self._motions):
            rows = np.flatnonzero(t >= self._knots[k])
            within = np.minimum(t[rows] - self._knots[k], motion.duration)
            q[rows] = motion.q(within)
            qd[rows] = motion.qd(within)
            qdd[rows] = motion.qdd(within)
        after = t >= self._knots[-1]
        qd[after] = 0.0
        qdd[after] = 0.0
        return q, qd, qdd


def joints_at_pose(description: Description, T: ArrayLike, near: Array | None, name: str) -> Array:
    """Return joint values that put the tool at a pose, shape (n,), inside the limits.

    The closed-form solution nearest to ``near`` (n,), rad and m, by default the middle of the limits; for arms without
    one, the solution that an iteration from ``near`` converges to.

    Raises
    ------
    ValueError
        T is not a pose of shape (4, 4).
    UnreachableError
        The arm does not reach the pose: says why.
    """
    pose = one_pose(T, name)
    closed = classify(description).fit is not None
    found = (
        inverse_kinematics(description, pose, near)
        if closed
        else solve_numerically(description, pose, near)
    )
    try:
        return found.require(near)
    except UnreachableError as error:
        raise UnreachableError(f"{name}: {description.name} cannot hold it: {error}") from None


def _poses(description: Description, given: ArrayLike, q0: Array | None) -> Array:
    array = number_array(given, "poses", "(k, 4, 4) or (k, 3)")
    positions = array.ndim == 2
    if array.shape[1:] not in ((3,), (4, 4)) or not len(array):
        raise ValueError(f"poses has shape {array.shape}; expected (k, 4, 4), or positions (k, 3)")
    if not np.isfinite(array).all():
        raise ValueError("poses has values that are not finite")
    if not positions:
        return check_pose(array, "poses").copy()
    if q0 is None:
        raise ValueError(
            "q0 is not given; expected joint values whose orientation of the tool the positions keep"
        )
    poses = np.tile(forward_kinematics(description, q0), (len(array), 1, 1))
    poses[:, :3, 3] = array
    return poses


def _times(given: ArrayLike, count: int) -> Array:
    times = number_array(given, "times", "(k,)")
    if times.shape != (count,):
        raise ValueError(f"times has shape {times.shape}; expected ({count},), one for each pose")
    if not np.isfinite(times).all() or times[0] < 0 or (np.diff(times) <= 0).any():
        raise ValueError(f"times is {times.tolist()}; expected seconds that ascend, from 0 on")
    return times.copy()
