"""Inverse kinematics along a path: one branch followed from pose to pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.cached_property import cached_property
from dhkit.description import Array, Description, joint_vector, lock, takes_robot
from dhkit.display import counted, html_block, html_table, repr_line
from dhkit.errors import UnreachableError
from dhkit.kernels import pose_rows
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.inverse import inverse_kinematics
from dhkit.kinematics.jacobian import jacobian
from dhkit.kinematics.manipulability import Motion, freedoms
from dhkit.kinematics.numeric import RESTARTS, solve_numerically
from dhkit.kinematics.numeric_call import numeric_call
from dhkit.kinematics.singular_values import has_small_singular_value
from dhkit.kinematics.solutions import LIMIT_SLACK, IKFlag, IKSolutions
from dhkit.kinematics.solver import solver_of

_MAX_STEP = np.pi / 4
"""Largest motion of a joint between two poses, rad or share of the reach; a larger one means another branch."""
_RESTARTS_AFTER_LOST = 7
"""Number of restarts of the search for a pose that comes after a lost one."""
_ALIKE = 9.0
"""Branches are told apart by the last step if their squared steps are at most so many times the least.

Next to a singularity two branches nearly coincide: the path goes through it to the other one, or stays in its own.
"""
_CHUNK = 4096
"""Poses whose branches are compared together, some 15 MB."""
_WHOLE = 6
"""Fewest joints of an arm that reaches whole poses."""
_TOLERANCE = 1e-12
"""Largest error of poses that are reached by iteration: share of the reach, and rad."""
_NEAR_SINGULAR = 0.02
"""A pose counts as near a singularity if a singular value of its Jacobian, lengths over the reach, is below this."""


@dataclass(frozen=True, eq=False)
class IKPath:
    """Joint positions along a path of poses, and the poses where they are not smooth."""

    q: Array
    """Shape (N, n), rad and m, continuous through whole turns; NaN where no branch reaches."""
    branch: tuple[str, ...]
    """Name of the branch at each pose; empty where no branch reaches."""
    switches: tuple[int, ...]
    """Indices of poses before which a joint jumps, because the branch ended or left its limits."""
    lost: tuple[int, ...]
    """Indices of poses that no branch reaches inside the limits."""
    start: float
    """Largest difference between ``q0`` and the joint positions at the first pose that is reached, rad or m."""
    near_singular: tuple[int, ...]
    """Indices of poses at which a singular value of the Jacobian, lengths over the reach, is below 0.02 (values that
    are always 0 left out): joints there may have to turn fifty times as fast as the tool."""

    @property
    def ok(self) -> bool:
        """Whether every pose is reached without a jump."""
        return not self.switches and not self.lost

    def require(self) -> Array:
        """Return the joint values, shape (N, n).

        Raises
        ------
        UnreachableError
            A pose is not reached, or the branch had to be switched; names the pose.
        """
        if self.lost:
            raise UnreachableError(
                f"{len(self.lost)} poses of the path are not reached, the first is pose {self.lost[0]}"
            )
        if self.switches:
            places = ", ".join(map(str, self.switches[:5]))
            raise UnreachableError(
                f"the path has to switch branches {len(self.switches)} times, before pose {places}"
            )
        return self.q

    def __repr__(self) -> str:
        return repr_line("IKPath", counted(len(self.q), "pose"), self._summary)

    def _repr_html_(self) -> str:
        named = dict.fromkeys(self.near_singular, "near a singularity")
        named |= dict.fromkeys(self.switches, "switched") | dict.fromkeys(self.lost, "lost")
        # Consecutive poses with the same note share a line.
        runs = groupby(
            enumerate(sorted(named)), lambda at: (at[1] - at[0], named[at[1]], self.branch[at[1]])
        )
        rows = []
        for (_, what, branch), run in runs:
            places = [place for _, place in run]
            where = str(places[0]) if len(places) == 1 else f"{places[0]} to {places[-1]}"
            rows.append((where, what, branch or "–"))
        table = html_table(("pose", "what", "branch"), rows) if rows else ""
        return html_block(f"{counted(len(self.q), 'pose')}: {self._summary}", table)

    @property
    def _summary(self) -> str:
        lost = len(self.lost)
        near = len(self.near_singular)
        return f"{counted(len(self.switches), 'switch')}, {lost} lost, {near} near a singularity"


@takes_robot
def follow_path(
    description: Description,
    T: ArrayLike,
    q0: ArrayLike,
    *,
    limits: bool = True,
    redundancy: ArrayLike | None = None,
) -> IKPath:
    """Follow one branch along a path of poses.

    At the first pose the branch nearest to ``q0`` is taken, then at each pose the solution nearest to the last one,
    whole turns added. Nearest means the least sum of squared joint differences. Of solutions within three times the
    least distance, as there are next to a singularity, the one nearest to where the last step leads is taken.

    Parameters
    ----------
    description
        The robot. One of seven joints keeps the redundancy of ``q0``, so that a closed path ends where it began. Where
        that leads nowhere, and for other arms of six joints or more without a closed form, each pose is reached by
        iteration from the one before; a redundant arm then moves by the shortest joint steps, and a closed path need
        not close.
    T
        Poses of the tool in the world, shape (N, 4, 4), near enough to each other for joints to move less than 45
        degrees (or an eighth of the reach) between them.
    q0
        Joint values, shape (n,), rad and m, near which the path starts.
    limits
        Whether solutions outside the joint limits are left out.
    redundancy
        For an arm of seven joints the redundancy at the poses, shape () or (N,), rad, instead of that of ``q0``. Poses
        that have no solution there are lost.

    Returns
    -------
    IKPath
        Joint positions, and the poses where the branch had to be switched, was lost, or came near a singularity.

    Raises
    ------
    ValueError
        T has not shape (N, 4, 4), or q0 not (n,) or not finite; ``redundancy`` does not fit, or the arm has not seven
        joints.
    ModelError
        The arm has no closed form and fewer than six joints.

    Examples
    --------
    >>> import numpy as np
    >>> from dhkit.description import library_robot, pose
    >>> arm = library_robot("planar2r")
    >>> T = np.array([pose((x, 0.5, 0)) for x in np.linspace(0.2, 0.5, 4)])
    >>> follow_path(arm, T, [0.0, 1.0])
    <IKPath of 4 poses: 0 switches, 0 lost, 0 near a singularity>
    """
    poses = pose_rows(T)
    if poses.ndim != 3:
        raise ValueError(f"T has shape {poses.shape}; expected (N, 4, 4)")
    q0 = joint_vector(description, q0, "q0")
    if redundancy is not None:
        return _followed_by_branches(description, poses, q0, limits, redundancy)
    if description.kinds == "RRRRRRR":
        has_closed_form = classify(description).redundant is not None
        keep = _followed_by_branches if has_closed_form else _followed_at_joint_7
        kept = keep(description, poses, q0, limits)
        if kept.ok:
            return kept
        searched = _followed_by_iteration(description, poses, q0, limits)
        return min(kept, searched, key=lambda path: len(path.lost) + len(path.switches))
    if solver_of(description) is None and description.n >= _WHOLE:
        return _followed_by_iteration(description, poses, q0, limits)
    return _followed_by_branches(description, poses, q0, limits)


def _followed_by_branches(
    description: Description,
    poses: Array,
    q0: Array,
    limits: bool,
    redundancy: ArrayLike | None = None,
) -> IKPath:
    """Return the path by the solutions of each pose, of which the one nearest to the last is taken."""
    seed = q0 if redundancy is None else None
    solutions = inverse_kinematics(description, poses, seed, redundancy=redundancy)
    usable = solutions.allowed if limits else solutions.valid
    at_singularity = solutions.flags & (IKFlag.wrist | IKFlag.shoulder) != 0
    has_free_joint = np.asarray(at_singularity.any(axis=-1))
    is_usable = np.asarray(usable.any(axis=-1))
    near = _NearestBranch.of(solutions, usable, q0, limits)
    motion: Motion = "whole" if len(solutions.met) == 6 else "translational"
    if len(poses) and is_usable.all() and not has_free_joint.any():
        chain = near.chained(q0)
        if chain is not None:
            q, places = chain
            names = [solutions.branches[place] for place in places]
            return _path_of(description, q, names, q0, motion)
    q = np.full((len(poses), description.n), np.nan)
    branch = [""] * len(poses)
    at = q0
    before: Array | None = None
    for k in range(len(poses)):
        if has_free_joint[k] and redundancy is None:
            # Where the wrist is straight, or its centre on axis 1, one joint is free and keeps its angle.
            here = inverse_kinematics(description, poses[k], seed=at)
            allowed = here.allowed if limits else here.valid
            chosen = near.of_one(here.q, allowed, at, before)
        else:
            chosen = near(k, at, before) if is_usable[k] else None
        # After a lost pose, and at the first one, no step leads anywhere.
        before = at if chosen is not None and k and branch[k - 1] else None
        if chosen is not None:
            place, at = chosen
            q[k] = at
            branch[k] = solutions.branches[place]
    return _path_of(description, q, branch, q0, motion)


def _followed_at_joint_7(description: Description, poses: Array, q0: Array, limits: bool) -> IKPath:
    """Return the path of an arm of seven joints with joint 7 at rest, by iteration of the six others."""
    last = description.n - 1
    # Iteration keeps within limits, which here are one value; q0 may be outside those of joint 7.
    numbers = description.numbers
    at = float(np.clip(q0[last], numbers.lower[last], numbers.upper[last]) if limits else q0[last])
    path = _followed_by_iteration(lock(description, {last: at}), poses, q0[:last], limits)
    q = np.column_stack([path.q, np.where(np.isnan(path.q[:, 0]), np.nan, at)])
    return _path_of(description, q, path.branch, q0, "whole")


def _path_of(
    description: Description, q: Array, branch: Sequence[str], q0: Array, motion: Motion
) -> IKPath:
    """Return a path by its joint values (N, n), NaN where a pose is lost, and the names of its branches."""
    is_lost = np.isnan(q).any(axis=1)
    # After a lost pose joints may have moved by more than a step, which is not a jump: the difference is NaN.
    jumps = (np.abs(np.diff(q, axis=0)) > _largest_steps(description)).any(axis=1)
    reached = q[~is_lost]
    return IKPath(
        q=q,
        branch=tuple(branch),
        switches=tuple((np.flatnonzero(jumps) + 1).tolist()),
        lost=tuple(np.flatnonzero(is_lost).tolist()),
        start=float(np.abs(reached[0] - q0).max()) if len(reached) else float("nan"),
        near_singular=_near_singular(description, q, motion),
    )


def _largest_steps(description: Description) -> Array:
    """Return the largest motion of each joint between two poses, shape (n,), rad and m."""
    # pi/4 rad, or for a prismatic joint pi/4 (reach / (2 pi)): an eighth of the reach.
    in_length = description.reach / 2 / np.pi
    steps: Array = _MAX_STEP * np.where(description.numbers.prismatic, in_length, 1.0)
    return steps


def _followed_by_iteration(
    description: Description, poses: Array, q0: Array, limits: bool
) -> IKPath:
    """Return the path of an arm without a closed form: each pose is searched for from the joint values before."""
    numbers = description.numbers
    is_endless = ~numbers.prismatic
    if limits:
        is_endless = is_endless & np.isinf(numbers.upper - numbers.lower)
    call = numeric_call(description)
    q = np.full((len(poses), description.n), np.nan)
    branch = [""] * len(poses)
    at = q0
    for k, T in enumerate(poses):
        # Next to a lost pose others are probably lost as well, which many restarts would take long to say.
        is_after_lost = k > 0 and not branch[k - 1]
        found = call(T, at, _TOLERANCE, 0) if limits and not is_after_lost else None
        if found is None:
            restarts = _RESTARTS_AFTER_LOST if is_after_lost else RESTARTS
            found = solve_numerically(
                description, T, at, restarts=restarts, tolerance=_TOLERANCE, limits=limits
            )
        if found.valid[0]:
            # Angles of joints without limits are in (-pi, pi]: the whole turns of the joints before are added.
            turns = np.rint((at - found.q[0]) / math.tau)
            at = found.q[0] + np.where(is_endless, math.tau * turns, 0.0)
            q[k] = at
            branch[k] = "numeric"
    return _path_of(description, q, branch, q0, "whole")


@dataclass(frozen=True, eq=False)
class _NearestBranch:
    """The nearest branch at each pose of a path."""

    solutions: IKSolutions
    usable: NDArray[np.bool_]
    """Shape (N, B)."""
    limits: bool
    q: Array
    """Joint values inside the limits, shape (N, B, n); those of branches that are not usable are 0."""
    turn: Array
    """2 pi for joints of which every whole turn, or several, are allowed, 0 for others, shape (n,), rad and m."""
    has_several: bool
    """Whether a joint has several whole turns inside its limits, of which the last pose decides."""

    @cached_property
    def has_turns(self) -> bool:
        """Whether there is a joint of which every whole turn is allowed."""
        return bool(self.turn.any())

    @classmethod
    def of(
        cls, solutions: IKSolutions, usable: NDArray[np.bool_], q0: Array, limits: bool
    ) -> _NearestBranch:
        """Return the branches of a path; ``q0`` are any joint values, shape (n,)."""
        width = solutions.upper - solutions.lower
        is_endless = ~solutions.prismatic & (np.isinf(width) if limits else True)
        has_one_winding = solutions.prismatic | (width < math.tau)
        is_several = ~(is_endless | has_one_winding)
        turn = np.where(is_endless | is_several, math.tau, 0.0)
        wound = solutions.wound(solutions.q, q0, limits=limits)
        q = np.where(usable[..., None], wound, 0.0)
        return cls(solutions, usable, limits, q, turn, bool(is_several.any()))

    def chained(self, at: Array) -> tuple[Array, list[int]] | None:
        """Return joint values (N, n) and branches of a path whose poses all have some, each nearest to the one before.

        None if whole turns would lead out of the limits, or two branches are nearly as near: the poses must then be
        followed one by one.

        Parameters
        ----------
        at
            Joint values before the first pose, shape (n,).
        """
        q = self.q
        first, at_first = self(0, at) or (0, at)
        places = [first]
        for begin in range(0, len(q) - 1, _CHUNK):
            some = q[begin : begin + _CHUNK + 1]
            # The nearest branch of each pose, from each branch of the pose before: (k, B).
            steps = some[1:, None] - some[:-1, :, None]
            if self.has_turns:
                steps -= self.turn * np.rint(steps / math.tau)
            squares = np.einsum("kabn,kabn->kab", steps, steps)
            is_usable = self.usable[begin + 1 : begin + 1 + len(steps), None]
            squares = np.where(is_usable, squares, np.inf)
            following = squares.argmin(axis=-1)
            least = squares.min(axis=-1, keepdims=True)
            is_open = np.count_nonzero(squares <= _ALIKE * least, axis=-1) > 1
            for nearest, is_doubtful in zip(following.tolist(), is_open.tolist(), strict=True):
                if is_doubtful[places[-1]]:
                    return None
                places.append(nearest[places[-1]])
        chosen = q[np.arange(len(q)), places]
        # Whole turns since the first pose, whose own are right.
        steps = np.diff(chosen, axis=0, prepend=at_first[None])
        chosen -= self.turn * np.cumsum(np.rint(steps / math.tau), axis=0)
        if self.has_several and self.limits:
            lower = self.solutions.lower - LIMIT_SLACK
            upper = self.solutions.upper + LIMIT_SLACK
            if ((chosen < lower) | (chosen > upper)).any():
                return None
        return chosen, places

    def __call__(self, k: int, at: Array, before: Array | None = None) -> tuple[int, Array] | None:
        """Return the branch of pose k that is nearest to joint values (n,), and its joint values.

        ``before`` are the joint values at the pose before those, shape (n,), or None.
        """
        if self.has_several:
            return self.of_one(self.solutions.q[k], self.usable[k], at, before)
        step = self.q[k] - at
        if self.has_turns:
            step -= self.turn * np.rint(step / math.tau)
        step[~self.usable[k]] = np.nan
        best = _likely(step, None if before is None else at - before)
        return best, at + step[best]

    def of_one(
        self, candidates: Array, allowed: NDArray[np.bool_], at: Array, before: Array | None
    ) -> tuple[int, Array] | None:
        """Return the same of the solutions (B, n) of one pose, of which some (B,) are allowed; None if none is."""
        if not allowed.any():
            return None
        wound = self.solutions.wound(candidates, at, limits=self.limits)
        step = np.where(allowed[:, None], wound - at, np.nan)
        best = _likely(step, None if before is None else at - before)
        return best, wound[best]


def _likely(steps: Array, last: Array | None) -> int:
    """Return which of the steps (B, n), some of them NaN, continues a path whose last step is (n,), or None."""
    squares = np.einsum("bn,bn->b", steps, steps)
    least = np.nanmin(squares)
    if last is None:
        return int(np.nanargmin(squares))
    changes = steps - last
    differences = np.einsum("bn,bn->b", changes, changes)
    # Comparisons with NaN are false.
    return int(np.where(squares <= _ALIKE * least, differences, np.inf).argmin())


def _near_singular(description: Description, q: Array, motion: Motion) -> tuple[int, ...]:
    # Without units: velocities over the reach L, diag(1/L, 1) J. Of its singular values those beyond the number of
    # freedoms are always 0, so that the last one that counts is the smallest.
    J = jacobian(description, np.nan_to_num(q))
    J[:, :3] /= description.reach or 1.0
    J = J if motion == "whole" else J[:, :3]
    count = freedoms(description, motion)
    if count == J.shape[1] <= J.shape[2]:
        is_near = has_small_singular_value(J, _NEAR_SINGULAR)
    else:
        is_near = np.linalg.svd(J, compute_uv=False)[:, count - 1] < _NEAR_SINGULAR
    return tuple(np.flatnonzero(is_near & ~np.isnan(q).any(axis=-1)).tolist())
