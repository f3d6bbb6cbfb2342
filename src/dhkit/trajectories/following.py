"""Joint paths for paths of the tool: followed step by step, then refined until the tool stays on its path."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description, takes_robot
from dhkit.description.joint_text import degrees_hint, joint_text
from dhkit.display import listed
from dhkit.errors import PlanningError
from dhkit.kinematics import (
    classify,
    freedoms,
    inverse_kinematics,
    jacobian,
    jacobian_dot,
    solve_numerically,
)
from dhkit.kinematics.newton import Newton
from dhkit.trajectories.interpolation import quintic_hermite
from dhkit.trajectories.limits import Limits, farthest_outside
from dhkit.trajectories.paths import JointPath
from dhkit.trajectories.pieces import Pieces
from dhkit.trajectories.timing import configuration
from dhkit.trajectories.tool_paths import ToolPath

_MAX_DEVIATION = 5e-8
"""Largest deviation of the tool from its path between knots, m and rad: half of what :func:`joint_path` promises."""
_CHECKED_POINTS = 9
"""Number of points between two knots at which the deviation is checked."""
_KNOT_ERROR = 1e-12
"""Largest error at a knot, rad and shares of the reach; rounding leaves 1e-15."""
_NEWTON_STEPS = 8
"""Largest number of Newton's steps to a knot."""
_DAMPING = 1e-13
"""Damping lambda of Newton's steps, A^T (A A^T + lambda 1)^-1 error, with A the Jacobian over the reach: far below
_SINGULAR squared, it changes a step only beside a singularity, which is refused."""
_FIRST_STEP = 1 / 16
"""First and largest step of s along the path."""
_MIN_STEP = 1e-9
"""Smallest step of s along the path; a path that needs a smaller one cannot be followed."""
_MAX_SECOND_ORDER = 0.25
"""Largest share of a step's second-order part, or of its error, in the step: near a singularity, where another branch
is close, this share grows, and steps become short enough to stay on the branch."""
_MAX_CORRECTION = 0.02
"""Largest distance of a knot from its prediction, rad and shares of the reach."""
_SINGULAR = 1e-6
"""Smallest singular value of the Jacobian, lengths over the reach, of a direction in which the tool can move."""
_NEAR_SINGULAR = 0.05
"""Singular value below which a singularity is named as the reason that a path cannot be followed further."""
_LOOK_AHEAD = np.array([0.0, 0.01, 0.03])
"""Distances of s ahead of a point that cannot be passed at which reachability is tested, to name the cause."""
_POSE_COORDINATES = 6
"""Number of independent coordinates of a pose."""
_MOST_KNOTS = 4097
"""Largest number of knots of a path."""
_LIMIT_SLACK = 1e-9
"""Distance by which rounding may exceed joint limits, rad and m."""


@takes_robot
def joint_path(
    description: Description,
    tool: ToolPath,
    q0: ArrayLike | None = None,
    limits: Limits | None = None,
) -> JointPath:
    """Return the joint path along which the tool follows a path, everywhere within 1e-7 m and 1e-7 rad.

    Newton's method follows the path from its beginning in steps short enough to stay on one branch. At knots q,
    q' = J^-1 v and q'' = J^-1 (v' - J' q') are exact, with quintic polynomials between them; knots are added where the
    tool leaves its path. A redundant arm moves with the least norm of joint rates, q' = J^+ v. Arms with no further
    freedom of orientation once the position is given (planar2r, for example) follow the positions alone.

    Parameters
    ----------
    description
        The robot, with any joints, with or without closed form.
    tool
        The path: :func:`tool_line`, :func:`tool_circle`, or an object with their methods.
    q0
        Joint values near which the path begins, shape (n,), rad and m. If not given, the branches that reach the first
        pose are tried in turn.
    limits
        Limits whose joint ranges are kept; the robot's own if not given.

    Returns
    -------
    JointPath
        Joint values over the path's parameter from 0 to 1, with derivatives.

    Raises
    ------
    PlanningError
        The first pose is not reached, or the path leaves the workspace, meets a singularity or the end of its branch,
        or leaves the joint limits; the message names the place.
    ValueError
        q0 has another shape.

    Examples
    --------
    >>> from dhkit.description import library_robot, world_to_tool
    >>> from dhkit.trajectories import tool_line
    >>> arm = library_robot("planar2r")
    >>> T0, T1 = world_to_tool(arm, [[0.2, 1.2], [0.8, 1.0]])
    >>> joint_path(arm, tool_line(T0, T1), q0=[0.2, 1.2]).q(1.0).round(6)
    array([0.8, 1. ])
    """
    limits = limits or Limits.of(description)
    starts = _starts(description, tool, q0)
    problem: PlanningError | None = None
    for start in starts:
        try:
            path = _Follower.of(description, tool).path(start)
            _require_inside(path, limits)
        except PlanningError as error:
            problem = problem or error
        else:
            return path
    raise problem or PlanningError(
        f"{description.name} does not reach the path's first pose, {_place(tool, 0.0)}"
    )


@dataclass(frozen=True, eq=False)
class _Follower:
    """An arm and the path of its tool."""

    tool: ToolPath
    newton: Newton
    rank: int
    """Number of independent coordinates of the pose that the arm moves."""

    @classmethod
    def of(cls, description: Description, tool: ToolPath) -> _Follower:
        """Return the follower of a path; it follows positions alone if they determine the orientation."""
        position_only = _aims_position(description)
        rank = freedoms(description, "translational" if position_only else "whole")
        return cls(tool, Newton.of(description, position_only=position_only, limits=False), rank)

    def path(self, start: Array) -> JointPath:
        """Return the path from joint values at its beginning, shape (n,)."""
        s, q = self._follow(start)
        while True:
            qs, qss = self.derivatives(s, q)
            pieces = Pieces(s, quintic_hermite(s, q, qs, qss))
            too_long = np.flatnonzero(self._deviations(pieces) > _MAX_DEVIATION)
            if not len(too_long):
                return JointPath(self.newton.description, s, pieces.coefficients)
            if len(s) + len(too_long) > _MOST_KNOTS:
                k = too_long[0]
                raise PlanningError(f"the joints turn ever faster {self._where(float(s[k]), q[k])}")

            # A knot in the middle of each interval in which the tool leaves its path.
            middles = (s[too_long] + s[too_long + 1]) / 2
            found, closed = self.closed(middles, pieces(middles))
            if not closed.all():
                raise self._lost(float(middles[~closed][0]), found[~closed][0])
            s = np.insert(s, too_long + 1, middles)
            q = np.insert(q, too_long + 1, found, axis=0)

    def derivatives(self, s: Array, q: Array) -> tuple[Array, Array]:
        """Return q' and q'' on the path, shape (N, n) each, by the least norm of q' for a redundant arm.

        J^+ is the pseudoinverse of J, taken from its ``rank`` largest singular values; v is the pose's derivative.
        With w = (J J^T)^+ v the least-norm solution is q' = J^+ v = J^T w, and its derivative

            q'' = J^+ (v' - J' q') + (1 - J^+ J) J'^T w.
        """
        # Rows of the pose are scaled by 1 / reach for lengths, columns by the joints' units.
        newton = self.newton
        rows = self._rows
        units = newton.units
        J = self._jacobian(q)
        v = rows[:, 0] * self.tool.twists(s)[:, : newton.size]
        v_rate = rows[:, 0] * self.tool.twist_rates(s)[:, : newton.size]

        # J^+ = V sigma^-1 U^T
        U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
        is_singular = sigma[:, self.rank - 1] < _SINGULAR
        if is_singular.any():
            k = int(np.argmax(is_singular))
            raise PlanningError(f"the path meets a singularity {self._where(float(s[k]), q[k])}")
        U = U[:, :, : self.rank]
        sigma = sigma[:, : self.rank]
        Vt = Vt[:, : self.rank]
        J_plus = np.swapaxes(Vt, 1, 2) / sigma[:, None] @ np.swapaxes(U, 1, 2)

        # q' = J^+ v
        first = np.einsum("kij,kj->ki", J_plus, v)

        # w = J^+T q', and (1 - V V^T) J'^T w is the part of q'' that moves the redundant arm alone.
        J_rate = rows * jacobian_dot(newton.description, q, units * first)[:, : newton.size] * units
        w = np.einsum("kji,kj->ki", J_plus, first)
        redundant = np.einsum("kji,kj->ki", J_rate, w)
        redundant -= np.einsum("kji,kjl,kl->ki", Vt, Vt, redundant)

        second = (
            np.einsum("kij,kj->ki", J_plus, v_rate - np.einsum("kij,kj->ki", J_rate, first))
            + redundant
        )
        return units * first, units * second

    @property
    def _rows(self) -> Array:
        """Factors of the coordinates of a pose, shape (size, 1): 1 / reach for positions, 1 for rotations."""
        return np.repeat([1 / self.newton.length, 1.0], 3)[: self.newton.size, None]

    def _jacobian(self, q: Array) -> Array:
        """Return Jacobians, shape (N, size, n), lengths over the reach."""
        return (
            self._rows
            * jacobian(self.newton.description, q)[:, : self.newton.size]
            * self.newton.units
        )

    def closed(self, s: Array, q: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return joint values on the path, (N, n), from nearby ones q, and whether each was reached without a jump."""
        goals = self.tool.poses(s).reshape(-1, 16)
        found = np.ascontiguousarray(q)
        damping = np.full(len(s), _DAMPING)
        error = self.newton.error(found, goals)
        for _ in range(_NEWTON_STEPS):
            step = self.newton.step(found, error, damping)
            step_error = self.newton.error(step, goals)
            # Stop when rounding prevents a further improvement.
            better = np.linalg.norm(step_error, axis=1) < np.linalg.norm(error, axis=1)
            if not better.any():
                break
            found = np.where(better[:, None], step, found)
            error = np.where(better[:, None], step_error, error)
        moved = np.abs((found - q) / self.newton.units).max(axis=1)
        return found, (np.abs(error).max(axis=1) < _KNOT_ERROR) & (moved < _MAX_CORRECTION)

    def _follow(self, start: Array) -> tuple[Array, Array]:
        """Return knots (K,) and joint values (K, n), followed from the beginning to the end."""
        s = [0.0]
        q = [start]
        step = _FIRST_STEP
        while s[-1] < 1.0:
            # Prediction: q + h q' + h^2 / 2 q''
            here = q[-1][None]
            qs, qss = self.derivatives(np.array(s[-1:]), here)
            next_s = min(s[-1] + step, 1.0)
            h = next_s - s[-1]
            first = (h * qs)[0]
            second = (h**2 / 2 * qss)[0]
            allowed = _MAX_SECOND_ORDER * self._largest(first)

            # Correction; the step is taken if prediction and correction are small against its first-order part.
            if self._largest(second) <= allowed:
                expected = here + first + second
                found, closed = self.closed(np.array([next_s]), expected)
                if closed[0] and self._largest(found - expected) <= allowed + _KNOT_ERROR:
                    s.append(next_s)
                    q.append(found[0])
                    step = min(2 * step, _FIRST_STEP)
                    continue

            step = h / 2
            if step < _MIN_STEP:
                raise self._lost(next_s, q[-1])
        return np.array(s), np.array(q)

    def _largest(self, moves: Array) -> float:
        """Return the largest motion of a joint, rad or shares of the reach."""
        return float(np.abs(moves / self.newton.units).max())

    def _deviations(self, pieces: Pieces) -> Array:
        """Return the largest deviation of the tool from its path in each interval, m or rad, shape (K,)."""
        shares = np.arange(1, _CHECKED_POINTS + 1) / (_CHECKED_POINTS + 1)
        s = pieces.breaks[:-1, None] + np.diff(pieces.breaks)[:, None] * shares
        q = pieces.at(s - pieces.breaks[:-1, None]).reshape(-1, self.newton.description.n)
        error = self.newton.error(q, self.tool.poses(s.ravel()).reshape(-1, 16))
        # Newton's errors have positions over the reach: back to m.
        error[:, :3] *= self.newton.length
        norms = np.maximum(
            np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1)
        )
        return np.asarray(norms.reshape(s.shape).max(axis=1))

    def _lost(self, s: float, q: Array) -> PlanningError:
        """Return the error that explains why the path ends at joint values near s."""
        position_only = self.newton.size == 3
        if self._reached(s, q, position_only=position_only):
            near = (
                np.linalg.svd(self._jacobian(q[None]), compute_uv=False)[0, self.rank - 1]
                < _NEAR_SINGULAR
            )
            met = "the path meets a singularity" if near else "the branch of joint values ends"
            why = f"{met}, and only a jump leads on,"
        elif (
            not position_only
            and self.rank < _POSE_COORDINATES
            and self._reached(s, q, position_only=True)
        ):
            why = "the arm cannot turn its tool as the path asks"
        else:
            why = "the path leaves the workspace"
        return PlanningError(f"{why} {self._where(s, q)}")

    def _reached(self, s: float, q: Array, *, position_only: bool) -> bool:
        """Return whether a few poses ahead of s are within reach."""
        T = self.tool.poses(np.minimum(s + _LOOK_AHEAD, 1.0))
        found = solve_numerically(
            self.newton.description, T, q, position_only=position_only, limits=False
        )
        return bool(found.valid.all())

    def _where(self, s: float, q: Array) -> str:
        """Return the place on the path and the joint values in words."""
        return f"at s = {s:.4g}, {_place(self.tool, s)}; q is {listed(np.round(q, 12))}"


def _starts(description: Description, tool: ToolPath, q0: ArrayLike | None) -> Iterator[Array]:
    """Yield joint values for the path's beginning: near q0 if given, else all branches, nearest to the middle first."""
    T = tool.poses(np.array([0.0]))[0]
    position_only = _aims_position(description)
    if q0 is not None:
        near = configuration(description, q0, "q0")
        found = solve_numerically(
            description, T, near, position_only=position_only, restarts=0, limits=False
        )
        yield from _wind_near(found.q[found.valid], near, description)
        if found.valid.any():
            return
    fit = classify(description).fit
    if fit is not None:
        solutions = inverse_kinematics(description, T)
        middle = Newton.of(description, position_only=True, limits=True).middle
        near = middle if q0 is None else configuration(description, q0, "q0")
        usable = solutions.q[solutions.allowed if q0 is None else solutions.valid]
        yield from sorted(
            _wind_near(usable, near, description), key=lambda q: float(np.sum((q - near) ** 2))
        )
        return
    found = solve_numerically(description, T, q0, position_only=position_only)
    yield from found.q[found.valid]


def _wind_near(q: Array, near: Array, description: Description) -> list[Array]:
    """Return joint values (N, n) with the whole turns added that bring them nearest to ``near``."""
    whole_turns = 2 * np.pi * np.rint((near - q) / (2 * np.pi))
    return list(q + np.where(description.numbers.prismatic, 0.0, whole_turns))


def _aims_position(description: Description) -> bool:
    """Return whether the arm has as many freedoms in position as in pose, so that a path's positions suffice.

    The orientation then follows from the position, but for a choice of branch.
    """
    return freedoms(description, "translational") == freedoms(description, "whole")


def _require_inside(path: JointPath, limits: Limits) -> None:
    """Check that a path stays inside the joint limits.

    Raises
    ------
    PlanningError
        It leaves them; the message names the joint, the limit and the place.
    """
    farthest = farthest_outside(limits, path.pieces)
    if farthest.excess <= _LIMIT_SLACK:
        return
    i = farthest.joint
    q = farthest.value
    limit = limits.lower[i] if farthest.is_below else limits.upper[i]
    name = path.description.joints[i].name
    slides = bool(path.description.numbers.prismatic[i])
    bound = joint_text(limit, slides=slides)
    found = joint_text(q, slides=slides)
    raise PlanningError(
        f"{name} leaves its limit, {bound}, along the path: it comes to {found}"
        f"{degrees_hint(q, slides=slides)} at s = {farthest.place:.4g}"
    )


def _place(tool: ToolPath, s: float) -> str:
    """Return the tool's position on the path in words."""
    x, y, z = tool.poses(np.array([s]))[0, :3, 3]
    return f"the tool at ({x:.4g}, {y:.4g}, {z:.4g}) m"
