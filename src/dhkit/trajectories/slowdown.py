"""The factor by which a motion must be slowed down, or may be sped up, to just keep its limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.description.joint_text import degrees_hint, joint_text
from dhkit.dynamics import gravity_torque, inverse_dynamics
from dhkit.errors import PlanningError
from dhkit.trajectories.limits import ADVICE_ON_LIMITS, Limits, farthest_outside
from dhkit.trajectories.torque_peaks import torque_peaks
from dhkit.trajectories.trajectory import Trajectory

Torques: TypeAlias = Callable[[Array, Array, Array], Array]
"""Function from q, qd and qdd, shape (N, n) each, to joint torques, shape (N, n), N m and N."""

_TORQUE_NOISE = 1e-12
"""Differences of torque below this share of the largest torque are rounding and limit nothing."""
_MIN_JUMP = 1e-6
"""Smallest change of a velocity or acceleration at a break that is a jump, as a share of its largest value."""
_PROVED = 1e-12
"""Distance of a derivative's proved bound from values that are reached, as a share of its size."""
_LIMIT_SLACK = 1e-9
"""Distance by which rounding may exceed joint limits, rad and m."""
_REFINEMENTS = 2
"""Number of refinement passes, in which the neighbourhoods of critical samples are sampled more finely."""
_TIGHTEST_SAMPLES = 3
"""Number of critical samples of each joint that a pass refines."""
_ACCEPTED_TORQUE = 1e-7
"""Share by which a torque may exceed its limit."""
_MAX_ROUNDS = 20
"""Number of times that a motion is slowed down for a torque between samples."""
_ORDERS = {"velocity": 1, "acceleration": 2, "jerk": 3}
"""Order of the derivative that each limit is of."""


def least_slowdown(
    trajectory: Trajectory,
    limits: Limits,
    torques: Torques | None = None,
    points: int = 20,
    *,
    may_be_unlimited: bool = False,
) -> float:
    """Return the smallest c for which ``trajectory.slowed(c)`` keeps its limits; for c < 1 it may be sped up.

    A motion c times as slow has velocities over c, accelerations over c^2 and jerks over c^3, and torques
    g + (tau - g) / c^2, where g are the torques that hold the arm (Hollerbach 1984, Dynamic scaling of manipulator
    trajectories). This is exact without friction. Motions are assumed to go from rest to rest: accelerations at both
    ends are not jumps, those at breaks inside are.

    Parameters
    ----------
    trajectory
        The motion.
    limits
        Limits of velocity, acceleration, jerk and torque to keep; positions do not change.
    torques
        Function from q, qd and qdd, shape (N, n) each, to torques (N, n), without friction; inverse dynamics if not
        given. Not called if no torque is limited.
    points
        Number of times per interval, both ends included, at which torques are checked, and more finely about the
        tightest; velocities, accelerations and jerks are checked at their extremes.
    may_be_unlimited
        Whether a motion that no limit slows down is not an error.

    Returns
    -------
    float
        0 for a motion that stands still, or may be as fast as one likes.

    Raises
    ------
    PlanningError
        The arm cannot hold itself at some state, or not while it moves; a quantity jumps whose derivative is limited;
        or nothing limits the motion, and that is not allowed.
    DescriptionError
        Torques are limited, and a link has no body.
    ValueError
        The limits are of another number of joints.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> motion = Trajectory(arm, [0, 1], [[[0, 0], [0, 0], [3, 0], [-2, 0]]])
    >>> round(least_slowdown(motion, Limits.of(arm, velocity=0.5, torque=np.inf)), 12)
    3.0
    """
    c = float(
        least_slowdowns([trajectory], limits, torques, points, may_be_unlimited=may_be_unlimited)[0]
    )
    if torques is not None or c == 0 or np.isinf(limits.torque).all():
        return c
    return _with_torques_between(trajectory, limits, c)


def _with_torques_between(trajectory: Trajectory, limits: Limits, c: float) -> float:
    """Return the slowdown with which torques between the samples keep their limits too, from one that may be too small.

    If a torque tau of the motion, slowed down c times, exceeds its limit, with g that holds the arm there, it keeps the
    limit with c^2 (tau - g) / (limit - g) instead of c^2, for positive tau. The largest excess is removed until none is
    left.
    """
    description = trajectory.description
    for _ in range(_MAX_ROUNDS):
        slower = trajectory.slowed(c)
        peaks = torque_peaks(description, slower, limits.torque)
        use = np.where(peaks.is_proved, peaks.largest, peaks.seen)
        i = int(use.argmax())
        if use[i] <= 1 + _ACCEPTED_TORQUE:
            return c

        t = peaks.times[i]
        q = slower.q(t)
        g = float(gravity_torque(description, q)[i])
        tau = float(inverse_dynamics(description, q, slower.qd(t), slower.qdd(t))[i])
        limit = float(limits.torque[i])
        sign = np.sign(tau)
        if sign * g >= limit:
            _refuse_holding(description, i, g, limit, float(t))
        largest = max(sign * tau, use[i] * limit)
        c *= float(np.sqrt((largest - sign * g) / (limit - sign * g))) * (1 + _ACCEPTED_TORQUE / 4)
    raise PlanningError(
        f"torque of {description.joints[i].name} is above its limit at {t:.4g} s after {_MAX_ROUNDS} slow-downs; give a"
        " duration"
    )


def least_slowdowns(
    trajectories: Sequence[Trajectory],
    limits: Limits,
    torques: Torques | None = None,
    points: int = 20,
    *,
    may_be_unlimited: bool = False,
) -> Array:
    """Return :func:`least_slowdown` of several motions of one robot, shape (m,), their torques in one batch."""
    _check_joints(trajectories[0], limits)
    slowest = np.array([_by_derivatives(trajectory, limits) for trajectory in trajectories])
    if np.isfinite(limits.torque).any():
        slowest = np.maximum(slowest, _by_torques(trajectories, limits, torques, points))
    for trajectory, c in zip(trajectories, slowest, strict=True):
        moves = np.abs(trajectory.coefficients[:, 1:]).max(axis=(0, 1), initial=0.0) > 0
        if c == 0 and moves.any() and not may_be_unlimited:
            name = trajectory.description.joints[int(np.flatnonzero(moves)[0])].name
            raise PlanningError(
                f"nothing limits the motion: {name} moves, and has neither a velocity, acceleration, jerk nor torque"
                f" limit that it could reach; {ADVICE_ON_LIMITS}"
            )
    return slowest


def require_inside(trajectory: Trajectory, limits: Limits) -> None:
    """Check that a motion stays inside the joint limits.

    Parameters
    ----------
    trajectory
        The motion.
    limits
        Limits whose joint ranges are kept.

    Raises
    ------
    PlanningError
        It leaves them; the message names the joint, the limit and the time.
    ValueError
        The limits are of another number of joints.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.trajectories import Limits, quintic
    >>> arm = library_robot("puma560")
    >>> require_inside(quintic(arm, "ready", "nominal", duration=2.0), Limits.of(arm))
    """
    _check_joints(trajectory, limits)
    farthest = farthest_outside(limits, trajectory.pieces)
    if farthest.excess <= _LIMIT_SLACK:
        return
    i = farthest.joint
    q = farthest.value
    side = "lower" if farthest.is_below else "upper"
    limit = limits.lower[i] if farthest.is_below else limits.upper[i]
    slides = bool(trajectory.description.numbers.prismatic[i])
    bound = joint_text(limit, slides=slides)
    found = joint_text(q, slides=slides)
    raise PlanningError(
        f"{trajectory.description.joints[i].name} leaves its {side} limit, {bound}: it comes to {found}"
        f"{degrees_hint(q, slides=slides)} at {farthest.place:.4g} s"
    )


def _check_joints(trajectory: Trajectory, limits: Limits) -> None:
    """Check that a motion and limits are of the same number of joints."""
    if limits.velocity.shape != (trajectory.n,):
        raise ValueError(f"limits are of {len(limits.velocity)} joints; expected {trajectory.n}")


def _by_derivatives(trajectory: Trajectory, limits: Limits) -> float:
    """Return the least slowdown by velocities, accelerations and jerks."""
    slowest = 0.0
    for name, order in _ORDERS.items():
        limit = getattr(limits, name)
        if np.isinf(limit).all():
            continue
        _refuse_jumps(trajectory, order - 1, name, limit)

        # A motion c times as slow has the k-th derivative over c^k: c^k = largest / limit
        values = trajectory.pieces.differentiated(order)
        found = values.bounds(_PROVED * np.abs(values.bernstein).max(axis=(0, 1)))
        largest = np.maximum(found.highest, -found.lowest)
        slowest = max(slowest, float((largest / limit).max() ** (1 / order)))
    return slowest


def _refuse_jumps(trajectory: Trajectory, order: int, limited: str, limit: Array) -> None:
    """Raise an error if a derivative of this order jumps while the next one is limited."""
    if not order:
        return
    values = trajectory.pieces.differentiated(order)
    inside = trajectory.breaks[1:-1]
    jumps = np.abs(values(inside) - values(inside, "left"))
    largest = np.abs(values.inside(2)[1]).max()
    wrong = (jumps > _MIN_JUMP * largest) & np.isfinite(limit)
    if wrong.any():
        row, i = np.argwhere(wrong)[0]
        what = {1: "velocity", 2: "acceleration"}[order]
        raise PlanningError(
            f"the {what} of {trajectory.description.joints[int(i)].name} jumps at {inside[row]:.4g} s; at no speed does"
            f" that keep a limit of {limited}"
        )


@dataclass(frozen=True, eq=False)
class _SamplePoints:
    """Sample points of several motions; N rows, those of a motion together."""

    owner: NDArray[np.intp]
    """Index of each sample's motion, shape (N,)."""
    piece: NDArray[np.intp]
    """Index of its interval, shape (N,)."""
    u: Array
    """Time since the beginning of the interval, s, shape (N,)."""
    step: Array
    """Distance of samples in the interval, s, shape (N,)."""
    width: Array
    """Length of the interval, s, shape (N,)."""

    @classmethod
    def spread(cls, trajectories: Sequence[Trajectory], points: int) -> _SamplePoints:
        """Return sample points at both ends of every interval and between."""
        # One row an interval, then ``points`` rows an interval.
        counts = [len(trajectory.breaks) - 1 for trajectory in trajectories]
        owner = np.repeat(np.arange(len(trajectories)), counts)
        piece = np.concatenate([np.arange(count) for count in counts])
        width = np.concatenate([np.diff(trajectory.breaks) for trajectory in trajectories])
        return cls(
            owner=np.repeat(owner, points),
            piece=np.repeat(piece, points),
            u=np.outer(width, np.linspace(0, 1, points)).ravel(),
            step=np.repeat(width / (points - 1), points),
            width=np.repeat(width, points),
        )

    def around(self, rows: NDArray[np.intp], points: int) -> _SamplePoints:
        """Return sample points between the neighbours of some rows; rows are sorted by motion."""
        r = np.repeat(rows, points)
        step = self.step[r]
        width = self.width[r]
        u = self.u[r] + np.tile(np.linspace(-1, 1, points), len(rows)) * step
        return _SamplePoints(
            owner=self.owner[r],
            piece=self.piece[r],
            u=np.clip(u, 0.0, width),
            step=step * 2 / (points - 1),
            width=width,
        )

    def states(self, trajectories: Sequence[Trajectory]) -> tuple[Array, Array, Array]:
        """Return q, qd and qdd, shape (N, n) each."""
        q: list[Array] = []
        qd: list[Array] = []
        qdd: list[Array] = []
        first_rows = np.searchsorted(self.owner, np.arange(len(trajectories) + 1))
        for trajectory, (begin, end) in zip(trajectories, pairwise(first_rows), strict=True):
            piece = self.piece[begin:end]
            u = self.u[begin:end]
            q.append(trajectory.pieces.on(piece, u))
            qd.append(trajectory.pieces.differentiated(1).on(piece, u))
            qdd.append(trajectory.pieces.differentiated(2).on(piece, u))
        return np.concatenate(q), np.concatenate(qd), np.concatenate(qdd)


def _by_torques(
    trajectories: Sequence[Trajectory], limits: Limits, torques: Torques | None, points: int
) -> Array:
    """Return the least slowdown by torques, shape (m,)."""
    description = trajectories[0].description
    samples = _SamplePoints.spread(trajectories, points)
    smallest_room = np.full(len(trajectories), np.inf)
    for _ in range(_REFINEMENTS + 1):
        q, qd, qdd = samples.states(trajectories)
        if torques is None:
            tau = inverse_dynamics(description, q, qd, qdd)
            g = gravity_torque(description, q)
        else:
            tau = torques(q, qd, qdd)
            g = torques(q, 0 * q, 0 * q)

        # A motion c times as slow has torques g + (tau - g) / c^2, which keep the limit on the side of tau - g if
        #   1 / c^2 <= room = (limit - sign(tau - g) g) / |tau - g|
        moves = np.abs(tau - g) > _TORQUE_NOISE * np.abs(tau).max()
        spare = limits.torque - np.where(moves, np.sign(tau - g), np.sign(g)) * g
        cannot_hold = (np.abs(g) > limits.torque) | (moves & (spare <= 0))
        if cannot_hold.any():
            row, i = (int(k) for k in np.argwhere(cannot_hold)[0])
            when = trajectories[samples.owner[row]].breaks[samples.piece[row]] + samples.u[row]
            _refuse_holding(description, i, float(g[row, i]), float(limits.torque[i]), float(when))
        room = np.divide(spare, np.abs(tau - g), out=np.full_like(g, np.inf), where=moves)

        np.minimum.at(smallest_room, samples.owner, room.min(axis=1))
        samples = samples.around(_tightest(samples.owner, room, len(trajectories)), points)

    # 1 / c^2 <= room
    return np.asarray(1 / np.sqrt(smallest_room))


def _tightest(owner: NDArray[np.intp], room: Array, count: int) -> NDArray[np.intp]:
    """Return the rows of the smallest local minima of each joint's room in each of ``count`` motions."""
    beside = np.pad(room, ((1, 1), (0, 0)), constant_values=np.inf)
    is_minimum = (room <= beside[:-2]) & (room <= beside[2:])
    minima = np.where(is_minimum, room, np.inf)

    rows = []
    for begin, end in pairwise(np.searchsorted(owner, np.arange(count + 1))):
        in_order = np.argsort(minima[begin:end], axis=0, kind="stable")
        rows.append(begin + in_order[:_TIGHTEST_SAMPLES].ravel())
    return np.asarray(np.concatenate(rows), dtype=np.intp)


def _refuse_holding(
    description: Description, i: int, needed: float, limit: float, when: float
) -> None:
    """Raise the error that joint i, from 0, needs more than its limit to hold the arm."""
    unit = "N" if description.numbers.prismatic[i] else "N m"
    raise PlanningError(
        f"{description.joints[i].name} cannot hold the arm while it moves at {when:.4g} s, at any speed: that takes"
        f" {abs(needed):.6g} {unit} of {limit:.6g} {unit}"
    )
