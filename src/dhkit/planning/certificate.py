"""Certificates: the limits of a motion checked on a dense grid with Pinocchio, and the slow-down they require."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dhkit.description import Array, Description, Payload, takes_robot
from dhkit.display import html_block, html_table, repr_line, value_line
from dhkit.planning.collision_avoidance import NO_AVOIDANCE, CollisionAvoidance
from dhkit.planning.constraints import Constraint
from dhkit.planning.states import States
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits, Trajectory
from dhkit.trajectories.timing import default_limits

POINTS = 24
"""Number of states in an interval, with both ends: dense, since users sample a motion at any times."""
POINTS_PER_COEFFICIENT = 4
"""Number of states in an interval for each coefficient of its polynomials, whose extremes lie close together."""
ACCEPTED_EXCESS = 5e-7
"""Largest excess of a certified motion, as a share of the limit: half of the documented 1e-6."""
ACTIVE_SHARE = 0.99
"""Share of a limit from which it counts as active."""
HALVINGS = 40
MIN_REACH = 1e-9
"""Smallest reach (m) used as a scale of lengths, for arms without reach."""


@dataclass(frozen=True)
class Check:
    """Result of one kind of limit on one motion."""

    what: str
    excess: float
    """Largest excess as a share of the limit; negative if the limit is kept."""
    row: int
    """Joint (from 0) or row of a constraint that comes nearest to its limit."""
    time: float
    """Time of the largest excess, s."""

    __repr__ = value_line


@dataclass(frozen=True)
class Certificate:
    """Limits of a motion, checked on a dense grid."""

    checks: tuple[Check, ...]
    states: int
    reference: str
    """Name of the library that computed torques and poses: Pinocchio, or dhkit if it is not installed."""
    active: tuple[tuple[str, int, float], ...]
    """Active limits: the kind, the joint from 0, and the share of time for which the joint is at it."""
    any_active: float
    """Share of time for which at least one joint is at a limit."""

    @property
    def violation(self) -> float:
        """Largest excess, as a share of its limit; 0 without limits."""
        return 0.0 if self.worst is None else self.worst.excess

    @property
    def ok(self) -> bool:
        """Whether all limits are kept, up to 5e-7 of each."""
        return self.violation <= ACCEPTED_EXCESS

    def with_worse_checks(self, checks: Sequence[Check]) -> Certificate:
        """Return the certificate with checks of the same limits replaced where the given ones are worse."""
        by_name = {check.what: check for check in self.checks}
        for check in checks:
            if check.what not in by_name or check.excess > by_name[check.what].excess:
                by_name[check.what] = check
        return replace(self, checks=tuple(by_name.values()))

    @property
    def worst(self) -> Check | None:
        """The check with the largest excess; None without limits."""
        return max(self.checks, key=lambda check: check.excess, default=None)

    def __repr__(self) -> str:
        return repr_line("Certificate", summary=self._summary)

    def _repr_html_(self) -> str:
        rows = [
            (
                check.what,
                str(check.row + 1),
                f"exceeded by {100 * check.excess:.2g} %" if check.excess > 0 else f"{-100 * check.excess:.2g} % left",
                f"{check.time:.4g} s",
            )
            for check in sorted(self.checks, key=lambda check: -check.excess)
        ]
        headings = ("limit", "joint or row", "at worst", "at")
        return html_block(f"Certificate: {self._summary}", html_table(headings, rows, align="lr"))

    @property
    def _summary(self) -> str:
        if self.worst is None:
            return f"nothing is limited, {self.states} states"
        kept = "all limits kept" if self.ok else f"{self.worst.what} exceeded by {100 * self.violation:.2g} %"
        return f"{kept}, in {self.states} states by {self.reference}"


@takes_robot
def certify(
    description: Description,
    motion: Trajectory,
    limits: Limits | None = None,
    friction: bool | Friction | None = None,
    payload: Payload | None = None,
) -> Certificate:
    """Check any motion against limits, with the checks that planned motions pass.

    Parameters
    ----------
    description
        The robot.
    motion
        A motion of the robot.
    limits
        Limits of position, velocity, acceleration, jerk and torque; the robot's own unless given.
    friction
        Friction that the drives' torques include, False for none; the motion's own unless given.
    payload
        Payload of the tool; the motion's own unless given.

    Raises
    ------
    DescriptionError
        A motion of another robot.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.trajectories import quintic
    >>> arm = library_robot("planar2r")
    >>> certify(arm, quintic(arm, [0, 0], [1.0, 0.5])).ok
    True
    """
    if not isinstance(motion, Trajectory):
        raise TypeError(f"motion is {type(motion).__name__}; expected a Trajectory")
    for name, value, kind in (("limits", limits, Limits), ("payload", payload, Payload)):
        if value is not None and not isinstance(value, kind):
            raise TypeError(f"{name} is {type(value).__name__}; expected {kind.__name__}(...)")
    motion.require(description)
    limits = limits or default_limits(description)
    if limits.velocity.shape != (description.n,):
        raise ValueError(f"limits are of {len(limits.velocity)} joints; expected {description.n}")
    carried = motion.payload if payload is None else payload
    loaded = description if carried is None else carried.carried(description)
    chosen = motion.friction if friction is None else Friction.chosen(friction)
    points = max(POINTS, POINTS_PER_COEFFICIENT * motion.coefficients.shape[1])
    certificate = Checker(loaded, limits, friction=chosen, points=points).check(motion)
    return certificate.with_worse_checks(_extremes(motion, limits, points))


@dataclass(frozen=True, eq=False)
class Checker:
    """Limits and constraints of a motion, for checking trajectories against them."""

    description: Description
    """The robot with its payload."""
    limits: Limits
    constraints: tuple[Constraint, ...] = ()
    parameters: tuple[Array, ...] = ()
    friction: Friction | None = None
    avoidance: CollisionAvoidance = NO_AVOIDANCE
    points: int = POINTS
    """Number of states in an interval, with both ends."""

    def states(self, trajectory: Trajectory) -> States:
        """Return the states of a motion on the grid, on both sides of each break."""
        s = np.linspace(0.0, 1.0, self.points)
        breaks = trajectory.breaks
        t = breaks[:-1, None] + np.diff(breaks)[:, None] * s
        # A break belongs to both its intervals: the last state of each comes from the left.
        inside = States.of(self.description, trajectory, t[:, :-1], self.friction, "right")
        return inside.beside(States.of(self.description, trajectory, t[:, -1:], self.friction, "left"), self.points)

    def measured(self, states: States) -> list[tuple[str, Array]]:
        """Return each kind of limit with its use, shape (N, k), which is 1 at the limit."""
        limits, found = self.limits, []
        for what, values, limit in (
            ("velocity", states.qd, limits.velocity),
            ("acceleration", states.qdd, limits.acceleration),
        ):
            if np.isfinite(limit).any():
                found.append((what, np.abs(values) / limit))
        if np.isfinite(limits.torque).any():
            found.append(("torque", np.abs(states.tau) / limits.torque))
        for constraint, parameters in zip(self.constraints, self.parameters, strict=True):
            found.append((constraint.what, constraint.use(states, parameters)))
        if self.avoidance:
            short = self.avoidance.shortfalls(self.description, states.q)
            found.append(("clearance", 1 + short[:, None] / max(self.description.reach, MIN_REACH)))
        return found

    def peaks(self, states: States) -> list[tuple[str, Array]]:
        """Return each kind of limit with its use at the grid's states, shape (N, k), raised to its peak between states.

        The peak is that of the parabola through three neighbouring states of an interval.
        """
        return [(what, use + _parabola_rises(use, self.points)) for what, use in self.measured(states)]

    def positions(self, states: States) -> Array:
        """Return the excess of each joint value over its limits at the grid's states, shape (N, n); negative inside.

        In shares of the limit (:func:`position_sizes`), raised to peaks between states as in :meth:`peaks`.
        """
        lower, upper = self.limits.lower, self.limits.upper
        size = position_sizes(self.limits)
        if not (np.isfinite(lower) | np.isfinite(upper)).any():
            return np.full(states.q.shape, -np.inf)
        with np.errstate(invalid="ignore"):
            excess = np.stack([(lower - states.q) / size, (states.q - upper) / size])
            raised = [np.where(np.isfinite(side), side + _parabola_rises(side, self.points), side) for side in excess]
        worst: Array = np.maximum(*raised)
        return worst

    def check(self, trajectory: Trajectory, states: States | None = None) -> Certificate:
        """Return the certificate of a motion; ``states`` are its states on the grid, if they are known."""
        states = self.states(trajectory) if states is None else states
        checks, active, anywhere = [], [], np.zeros(len(states.times), dtype=bool)
        share = _time_shares(trajectory, states)
        if (jump := _largest_jump(trajectory, self.limits)) is not None:
            checks.append(jump)
        excess = self.positions(states)
        if np.isfinite(excess).any():
            checks.append(_check("position", excess, states.times))
        if np.isfinite(self.limits.jerk).any():
            checks.append(_largest_jerk(trajectory, self.limits.jerk))
        for what, use in self.peaks(states):
            checks.append(_check(what, use - 1, states.times))
            reached = use >= ACTIVE_SHARE
            anywhere |= reached.any(axis=1)
            active += [(what, i, float(share @ reached[:, i])) for i in range(use.shape[1]) if reached[:, i].any()]
        return Certificate(tuple(checks), len(states.times), states.reference, tuple(active), float(share @ anywhere))

    def slow_down(self, states: States) -> float:
        """Return the smallest factor c >= 1 of the duration with which limits that depend on velocity are kept.

        Infinite if a limit is exceeded even at rest. Only for motions from rest to rest.
        """

        def keeps(c: float) -> bool:
            return all(np.max(use, initial=0.0) <= 1.0 for _, use in self._velocity_dependent(states.slowed(c)))

        if keeps(1.0):
            return 1.0
        high = 1.001
        while not keeps(high):
            high = 1 + 4 * (high - 1)
            if high > 1e3:
                return np.inf
        low = 1 + (high - 1) / 4 if high > 1.0011 else 1.0
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if keeps(middle) else (middle, high)
            if high - low < 1e-9:
                break
        return high

    def _velocity_dependent(self, states: States) -> list[tuple[str, Array]]:
        resting = {constraint.what for constraint in self.constraints if not constraint.moving}
        moving = replace(self, avoidance=NO_AVOIDANCE)
        return [(what, use) for what, use in moving.peaks(states) if what not in resting]


def position_sizes(limits: Limits) -> Array:
    """Return the scales of positions outside their limits, shape (n,): the larger limit, at least 1 rad or m."""
    size = np.maximum(np.abs(limits.lower), np.abs(limits.upper))
    return np.where(np.isfinite(size) & (size > 0), size, 1.0)


def _parabola_rises(use: Array, points: int) -> Array:
    """Return the height of the parabola's vertex over each value, shape (N, k), through it and its neighbours."""
    values = use.reshape(-1, points, use.shape[1])
    slope, bend = (values[:, 2:] - values[:, :-2]) / 2, np.diff(values, 2, axis=1)
    inside = (bend < 0) & (np.abs(slope) < np.abs(bend))
    rises = np.divide(slope**2, -2 * bend, out=np.zeros_like(bend), where=inside)
    return np.pad(rises, ((0, 0), (1, 1), (0, 0))).reshape(use.shape)


def _check(what: str, excess: Array, times: Array) -> Check:
    excess = np.where(np.isnan(excess), np.inf, excess)  # a limit whose use is not a number is not kept
    k, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
    return Check(what, float(excess[k, i]), int(i), float(times[k]))


def _largest_jump(trajectory: Trajectory, limits: Limits) -> Check | None:
    """Return the largest jump of positions or velocities between pieces of a motion; None if there is none."""
    inner = trajectory.breaks[1:-1]
    if not len(inner):
        return None
    found: list[Check] = []
    speeds = np.abs(trajectory.qd(trajectory.breaks)).max(axis=0)
    fastest = np.where(np.isfinite(limits.velocity), limits.velocity, np.maximum(speeds, 1e-3))
    largest = max(float(np.abs(trajectory.qdd(trajectory.breaks)).max()), 1e-3)
    for what, values, size in (
        ("jump of position", trajectory.q, position_sizes(limits)),
        ("jump of velocity", trajectory.qd, fastest),
        ("jump of acceleration", trajectory.qdd, np.where(np.isfinite(limits.jerk), largest, np.inf)),
    ):
        jumps = np.abs(values(inner, "right") - values(inner, "left")) / size
        k, i = np.unravel_index(int(np.argmax(jumps)), jumps.shape)
        found.append(Check(what, float(jumps[k, i]), int(i), float(inner[k])))
    worst = max(found, key=lambda check: check.excess)
    return worst if worst.excess > ACCEPTED_EXCESS else None


def _largest_jerk(trajectory: Trajectory, limit: Array) -> Check:
    """Return the largest use of the jerk limits: at ends of intervals, and inside pieces of high degree."""
    pieces = trajectory.pieces.differentiated(3)
    degree = pieces.coefficients.shape[1] - 1
    t, values = pieces.inside(2) if degree < 2 else pieces.extremes(POINTS_PER_COEFFICIENT * (degree + 1))
    use = np.abs(values) / limit
    k, p, i = np.unravel_index(int(np.argmax(use)), use.shape)
    return Check("jerk", float(use[k, p, i] - 1), int(i), float(t[k, p] if t.ndim == 2 else t[k, p, i]))


def _extremes(motion: Trajectory, limits: Limits, points: int) -> list[Check]:
    """Return the checks of the extremes of positions, rates and accelerations, searched from ``points`` in a piece."""
    found = []
    size = position_sizes(limits)
    for order, what in enumerate(("position", "velocity", "acceleration")):
        t, values = motion.pieces.differentiated(order).extremes(points)
        if order == 0:
            excess = np.maximum(limits.lower - values, values - limits.upper) / size
        else:
            excess = np.abs(values) / getattr(limits, what) - 1
        if np.isfinite(getattr(limits, what) if order else np.minimum(-limits.lower, limits.upper)).any():
            k, p, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
            found.append(Check(what, float(excess[k, p, i]), int(i), float(t[k, p, i])))
    return found


def _time_shares(trajectory: Trajectory, states: States) -> Array:
    """Return the share of the duration of each state by the trapezoidal rule, shape (N,)."""
    K = len(trajectory.breaks) - 1
    weights = np.ones(len(states.times) // K)
    weights[[0, -1]] = 0.5
    weights /= weights.sum()
    shares: Array = np.outer(np.diff(trajectory.breaks), weights).ravel() / trajectory.duration
    return shares
