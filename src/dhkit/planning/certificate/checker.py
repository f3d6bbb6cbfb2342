"""Certificates: the limits of a motion checked on a dense grid with Pinocchio, and the slow-down they require."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dhkit.description import Array, Description, Payload, takes_robot
from dhkit.description.robot import require_bodies
from dhkit.display import counted, html_block, html_lines, html_table, repr_line, value_line
from dhkit.planning.certificate.collision_avoidance import (
    NO_AVOIDANCE,
    NOT_LOOKED_FOR,
    CollisionAvoidance,
    collisions_not_asked_for,
    motion_constraints,
)
from dhkit.planning.criteria import Constraint, Limit, LoadedArm, PositionLimit, States, loaded
from dhkit.planning.obstacles import Scene, not_checked
from dhkit.planning.second_check import Recheck, recheck
from dhkit.planning.second_check.result import distance_text
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits, Trajectory
from dhkit.trajectories.timing import default_limits
from dhkit.trajectories.torque_peaks import cubic_peaks, torque_peaks

POINTS = 24
"""Number of states in an interval, with both ends: dense, since users sample a motion at any times."""
POINTS_PER_COEFFICIENT = 4
"""Number of states in an interval for each coefficient of its polynomials, whose extremes lie close together."""
LARGEST_TURN = 0.2
"""Largest turn of a joint between two states, rad: torques change with sines and cosines of the joint values."""
MAX_POINTS = 20_000
"""Largest number of states in an interval."""
ACCEPTED_EXCESS = 5e-7
"""Largest excess of a certified motion, as a share of the limit: half of the documented 1e-6."""
SMALL = 1e-2
"""Smallest size of joint values and rates, in rad, m and per second, of which a jump is taken as a share."""
SMALL_ACCELERATION = 1e-3
"""Smallest size of accelerations, rad/s^2 and m/s^2, of which a jump is taken as a share."""
MAX_SLOW_DOWN = 1e9
"""Largest factor by which a motion is slowed down."""
SLOW_DOWN_TOLERANCE = 1e-9
"""Absolute tolerance of the factor by which a motion is slowed down, and of the excess at that factor."""
PROVED = 2e-8
"""Largest distance of a proved bound of positions and their derivatives from the truth, as a share of the limit."""


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
    of_joint: bool = True
    """Whether ``row`` is a joint."""
    limit: int | None = None
    """Place among the constraints of the motion, see :class:`dhkit.planning.criteria.Limit`; None for jumps."""
    clearance: float | None = None
    """Distance asked for, m, of a check of distances, whose excess is what is missing of it, m; None for others."""
    is_clearance_reduced: bool = False
    """Whether less than the clearance was asked for near the ends, so that the excess alone gives no distance."""

    @property
    def margin(self) -> str:
        """What is left up to the limit, in words; nothing of a limit that is exceeded."""
        left = max(-self.excess, 0.0)
        if self.clearance is not None:
            return f"{1000 * left:.3g} mm to spare"
        return f"{100 * left:.2g} % left"

    @property
    def place(self) -> str:
        """Joint or row, and time, of the largest excess, in words."""
        row = f"{'joint' if self.of_joint else 'row'} {self.row + 1}, "
        return f"{'' if self.clearance is not None else row}at {self.time:.4g} s"

    @property
    def statement(self) -> str:
        """Whether the limit is kept, and by how much it is exceeded, in words."""
        if self.excess <= 0:
            return f"{self.what} kept"
        if self.limit is None:
            return f"{self.what}: {100 * self.excess:.3g} % of the motion's own size"
        if self.clearance is None:
            return f"{self.what} exceeded by {100 * self.excess:.3g} %"
        found = ""
        if not self.is_clearance_reduced:
            found = f"{distance_text(self.clearance - self.excess)} found, "
        asked = f"{1000 * self.clearance:.3g} mm asked for"
        return f"{self.what} missed by {1000 * self.excess:.3g} mm ({found}{asked})"

    __repr__ = value_line


class ActiveLimit(NamedTuple):
    """A limit that a motion reaches."""

    what: str
    row: int
    """Joint (from 0) or row of a constraint."""
    share: float
    """Share of time at the limit."""
    of_joint: bool


@dataclass(frozen=True)
class Certificate:
    """Limits of a motion, checked on a dense grid."""

    checks: tuple[Check, ...]
    states: int
    reference: str
    """Name of the library that computed torques and poses: Pinocchio, or dhkit if it is not installed."""
    active: tuple[ActiveLimit, ...]
    any_active: float
    """Share of time for which at least one joint is at a limit."""
    sampled: tuple[str, ...] = ()
    """Limits of which nothing is proved between the states."""
    not_checked: tuple[str, ...] = ()
    """Quantities of which nothing is known: torques of links without a body, and distances that were not measured."""
    independent: Recheck | None = None
    """Result of the second check; None unless asked for."""
    collisions_not_asked_for: str = ""
    """Bodies whose contact nobody asked to look for, in words; empty if obstacles and links were both asked for."""

    @property
    def violation(self) -> float:
        """Largest excess, as a share of its limit, or of a clearance what is missing of it, m; 0 without limits."""
        return 0.0 if self.worst is None else self.worst.excess

    @property
    def ok(self) -> bool:
        """Whether all limits are kept, up to 5e-7 of each, and the second check, if there was one, found nothing."""
        return self.violation <= ACCEPTED_EXCESS and (
            self.independent is None or self.independent.ok
        )

    def excess_of(self, limit: int) -> float:
        """Return the largest excess of a constraint, by its place, as :attr:`violation` has it; -inf without it.

        Parameters
        ----------
        limit
            Place of the constraint, from 0.
        """
        return max((check.excess for check in self.checks if check.limit == limit), default=-np.inf)

    @property
    def worst(self) -> Check | None:
        """The check with the largest excess; None without limits."""
        return max(self.checks, key=lambda check: check.excess, default=None)

    def __repr__(self) -> str:
        return repr_line("Certificate", summary="; ".join(self._sentences))

    def __str__(self) -> str:
        first, *others = self._sentences
        exceeded = [check for check in self.checks if check.excess > ACCEPTED_EXCESS]
        if exceeded:
            first = f"{counted(len(exceeded), 'limit')} exceeded, in {self._grid}"
        lines = [first]
        exceeded.sort(key=lambda check: -check.excess)
        lines += [f"{check.statement}, {check.place}" for check in exceeded]
        if self.worst is not None and not exceeded:
            worst = self.worst
            lines.append(f"nearest to its limit: {worst.what}, {worst.margin}, {worst.place}")
        return "\n".join([*lines, *others])

    def _repr_html_(self) -> str:
        rows = []
        for check in sorted(self.checks, key=lambda check: -check.excess):
            state = check.statement if check.excess > 0 else check.margin
            rows.append((check.what, str(check.row + 1), state, f"{check.time:.4g} s"))
        headings = ("limit", "joint or row", "at worst", "at")
        first, *others = self._sentences
        table = html_table(headings, rows, align="lr") if rows else ""
        return html_block(f"Certificate: {first}", table, html_lines(others))

    @property
    def verdict(self) -> str:
        """Whether the limits are kept, in words: all of them, or by how much the worst is exceeded."""
        if self.worst is None and self.ok:
            return "nothing is limited"
        if self.worst is not None and self.violation > ACCEPTED_EXCESS:
            return self.worst.statement
        return "all limits kept" if self.ok else "refuted by the second check"

    @property
    def _grid(self) -> str:
        """Where the limits were checked, and by what, in words."""
        return f"{self.states} states by {self.reference}"

    @property
    def _sentences(self) -> list[str]:
        """The statement of the certificate, a sentence each: the verdict, and how far it reaches."""
        sentences = [f"{self.verdict}, in {self._grid}"]
        if self.independent is not None:
            sentences.append(f"second check: {self.independent}")
        if self.collisions_not_asked_for:
            sentences.append(f"{NOT_LOOKED_FOR}: {self.collisions_not_asked_for}")
        if self.sampled:
            sentences.append(f"not proved between the states: {', '.join(self.sampled)}")
        if self.not_checked:
            sentences.append(f"not checked: {'; '.join(self.not_checked)}")
        return sentences


@takes_robot
def certify(
    description: Description,
    motion: Trajectory,
    limits: Limits | None = None,
    friction: bool | Friction | None = None,
    payload: Payload | None = None,
    *,
    obstacles: Scene = (),
    clearance: float = 0.01,
    self_collision: bool = False,
    independent: bool = False,
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
    obstacles, clearance, self_collision
        Obstacles, the distance from them, m, and whether links keep it from each other, as for
        :meth:`dhkit.planning.Planner.solve`: links that are nearer at the start or the goal keep less there.
    independent
        Whether a second check, which shares no code with the first, searches the motion for violations that the first
        has overlooked: see :mod:`dhkit.planning.second_check`. It takes 0.05 to 1 s.

    Returns
    -------
    Certificate
        The worst use of each limit with its joint and time, what was proved, and what was sampled; ``.ok``.

    Raises
    ------
    DescriptionError
        A motion of another robot, or limits of torques of an arm without bodies.
    PlanningError
        A clearance larger than the space in which the arm moves.
    ModelError
        Pinocchio or coal is needed and not installed.

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
    if np.isfinite(limits.torque).any():
        require_bodies(description)
    if limits.velocity.shape != (description.n,):
        raise ValueError(f"limits are of {len(limits.velocity)} joints; expected {description.n}")
    carried = motion.payload if payload is None else payload
    chosen = motion.friction if friction is None else Friction.chosen(friction)
    points = max(
        POINTS,
        POINTS_PER_COEFFICIENT * motion.coefficients.shape[1],
        _points_of_turns(description, motion),
    )
    avoidance = CollisionAvoidance.of(obstacles, clearance, self_collision)
    if avoidance:
        avoidance = avoidance.between(description, motion.q(0.0), motion.q(motion.duration))
    checker = Checker(
        loaded(description, carried), limits, friction=chosen, avoidance=avoidance, points=points
    )
    certificate = checker.check(motion)
    if not independent:
        return certificate
    claims = avoidance.claims(description) if avoidance else ()
    return replace(
        certificate, independent=recheck(description, motion, limits, carried, chosen, claims)
    )


def _not_checked(
    description: Description, limits: Limits, avoidance: CollisionAvoidance
) -> tuple[str, ...]:
    """Return the robot's limits, and the distances from the motion's obstacles, that a certificate leaves out."""
    bare = [joint.name for joint in description.joints if not joint.bodies]
    has_efforts = bool(np.isfinite(description.numbers.effort).any())
    found: list[str] = []
    has_torque_limits = bool(np.isfinite(limits.torque).any())
    if bare and has_efforts and not has_torque_limits:
        found.append(f"torques, as the links of {', '.join(bare)} have no body")
    if avoidance:
        found += not_checked(
            description, avoidance.obstacles, avoidance.self_collision, avoidance.clearance
        )
        found += avoidance.kept_in_part
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Checker:
    """Limits and constraints of a motion, for checking trajectories against them."""

    description: LoadedArm
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
        last = States.of(self.description, trajectory, t[:, -1:], self.friction, "left")
        return replace(
            inside.beside(last, self.points), motion=trajectory.pieces, points=self.points
        )

    @cached_property
    def every(self) -> tuple[tuple[Constraint, Array], ...]:
        """All constraints of the motion with their parameters: first those of :class:`Limit`."""
        every = motion_constraints(self.limits, self.avoidance, self.constraints)
        own = [limit.values(self.description, np.eye(4)) for limit in every[: len(Limit)]]
        return tuple(zip(every, (*own, *self.parameters), strict=True))

    @cached_property
    def limiting(self) -> dict[int, tuple[Constraint, Array]]:
        """Those that limit motions, by their places."""
        return {k: pair for k, pair in enumerate(self.every) if pair[0].is_limiting}

    def measured(self, states: States) -> dict[int, Array]:
        """Return the use of each limit, shape (N, k), which is 1 at the limit."""
        return {
            k: constraint.use(states, given) for k, (constraint, given) in self.limiting.items()
        }

    def peaks(self, states: States) -> dict[int, Array]:
        """Return the use of each limit at the grid's states, shape (N, k), raised to its peak between states.

        The peak is that of the cubic through four neighbouring states of an interval.
        """
        return {
            k: _with_peaks_between(use, self.points) for k, use in self.measured(states).items()
        }

    def check(self, trajectory: Trajectory, states: States | None = None) -> Certificate:
        """Return the certificate of a motion; ``states`` are its states on the grid, if they are known."""
        states = self.states(trajectory) if states is None else states
        share = _time_shares(trajectory, states)
        jump = _largest_jump(trajectory, self.limits)
        checks = [] if jump is None else [jump]
        sampled: list[str] = []
        active: list[ActiveLimit] = []
        anywhere = np.zeros(len(states.times), dtype=bool)
        for k, at_states in self.measured(states).items():
            constraint, _ = self.limiting[k]
            use = _with_peaks_between(at_states, self.points)
            if k <= Limit.JERK:
                check = _proved_check(trajectory, self.limits, Limit(k))
            elif k == Limit.TORQUE:
                check, unproved = self._check_of_torques(trajectory, at_states, use, states.times)
                sampled += unproved
            else:
                check = _check(constraint, k, use - 1, states.times)
            if k == Limit.CLEARANCE:
                check = replace(
                    check,
                    clearance=self.avoidance.clearance,
                    is_clearance_reduced=self.avoidance.is_reduced,
                )
            if k > Limit.CLEARANCE:
                sampled.append(constraint.what)
            checks.append(check)

            if k == Limit.POSITION:
                continue  # a joint may rest anywhere in its range
            reached = use >= constraint.active_share
            anywhere |= reached.any(axis=1)
            active += [
                ActiveLimit(constraint.what, i, float(share @ reached[:, i]), constraint.of_joints)
                for i in np.flatnonzero(reached.any(axis=0)).tolist()
            ]
        return Certificate(
            checks=tuple(checks),
            states=len(states.times),
            reference=states.reference,
            active=tuple(active),
            any_active=min(float(share @ anywhere), 1.0),
            sampled=tuple(sampled),
            not_checked=_not_checked(self.description, self.limits, self.avoidance),
            collisions_not_asked_for=collisions_not_asked_for(self.avoidance.clear_of),
        )

    def _check_of_torques(
        self, trajectory: Trajectory, at_states: Array, with_peaks: Array, times: Array
    ) -> tuple[Check, list[str]]:
        """Return the check of torques, and those of which nothing is proved between the states.

        Where the proof succeeds, it decides on the torques between the states; elsewhere the peaks of cubics do.

        Parameters
        ----------
        at_states, with_peaks
            Uses at the states, and raised to the peaks of cubics between them, shape (N, n).
        times
            Times of the states, shape (N,), s.
        """
        peaks = torque_peaks(self.description, trajectory, self.limits.torque, self.friction)
        use = np.where(peaks.is_proved, at_states, with_peaks)
        check = _check(self.limiting[Limit.TORQUE][0], Limit.TORQUE, use - 1, times)
        excess = np.where(peaks.is_proved, peaks.largest, peaks.seen) - 1
        i = int(excess.argmax())
        if excess[i] > max(check.excess, 0.0):
            check = replace(check, excess=float(excess[i]), row=i, time=float(peaks.times[i]))
        names = [self.description.joints[j].name for j in np.flatnonzero(~peaks.is_proved)]
        return check, [f"torque of {name}" for name in names]

    def slow_down(self, states: States) -> float:
        """Return the smallest factor c >= 1 of the duration with which limits that depend on velocity are kept.

        Infinite if a limit is exceeded even at rest. Only for motions from rest to rest.

        The excess e(c), largest use less 1, is bracketed by e(low) > 0 >= e(high), and its root found by the Illinois
        variant of regula falsi (Dowell and Jarratt 1971): where the same end is kept twice, its excess is halved. The
        result is ``high``, at which the limits are kept. SciPy's brentq takes 0.2 s to be imported.
        """
        moving = [pair for pair in self.limiting.values() if pair[0].moving]

        def excess(c: float) -> float:
            slower = states.slowed(c)
            uses = (constraint.use(slower, given) for constraint, given in moving)
            return max(
                (float(np.max(_with_peaks_between(use, self.points))) - 1 for use in uses),
                default=-1.0,
            )

        low = 1.0
        e_low = excess(low)
        if e_low <= 0:
            return 1.0

        # The distance of the factor from 1 grows fourfold until the limits are kept.
        high = 1.001
        e_high = excess(high)
        while e_high > 0:
            low = high
            e_low = e_high
            high = 1 + 4 * (high - 1)
            if high > MAX_SLOW_DOWN:
                return np.inf
            e_high = excess(high)

        low_kept = 0
        high_kept = 0
        while high - low > SLOW_DOWN_TOLERANCE and e_high < -SLOW_DOWN_TOLERANCE:
            # The secant through (low, e_low) and (high, e_high) is 0 at c.
            c = high - e_high * (high - low) / (e_high - e_low)
            e = excess(c)
            if e > 0:
                low = c
                e_low = e
                low_kept = 0
                high_kept += 1
                if high_kept > 1:
                    e_high /= 2
            else:
                high = c
                e_high = e
                high_kept = 0
                low_kept += 1
                if low_kept > 1:
                    e_low /= 2
        return high


def _with_peaks_between(use: Array, points: int) -> Array:
    """Return values at states, shape (N, k), raised to the peak before the next one of cubics through four states."""
    # Peak k, of the cubic through states k to k + 3, raises the value at state k + 1. The cubic counts up to the next
    # state; the first and the last one also count to the ends of the interval.
    values = use.reshape(-1, points, use.shape[1])
    peaks, _ = cubic_peaks(values)
    raised = values.copy()
    raised[:, 1:-2] = np.maximum(raised[:, 1:-2], peaks)
    return raised.reshape(use.shape)


def _check(constraint: Constraint, limit: int, excess: Array, times: Array) -> Check:
    """Return the check of a constraint with excesses (N, k) at times (N,), s: the largest one."""
    # A limit whose use is not a number is not kept.
    excess = np.where(np.isnan(excess), np.inf, excess)
    k, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
    return Check(
        constraint.what, float(excess[k, i]), int(i), float(times[k]), constraint.of_joints, limit
    )


def _largest_jump(trajectory: Trajectory, limits: Limits) -> Check | None:
    """Return the largest jump of positions or velocities between pieces of a motion; None if there is none."""
    inner = trajectory.breaks[1:-1]
    if not len(inner):
        return None

    # Jumps are shares of the motion's own sizes: limits may be far larger.
    fastest = np.abs(trajectory.qd(trajectory.breaks)).max(axis=0)
    widest = np.abs(trajectory.q(trajectory.breaks)).max(axis=0)
    strongest = float(np.abs(trajectory.qdd(trajectory.breaks)).max())
    size_of_q = np.minimum(PositionLimit(limits).sizes, np.maximum(widest, SMALL))
    size_of_qd = np.minimum(limits.velocity, np.maximum(fastest, SMALL))
    size_of_qdd = np.where(np.isfinite(limits.jerk), max(strongest, SMALL_ACCELERATION), np.inf)

    found: list[Check] = []
    for what, values, size in (
        ("jump of position", trajectory.q, size_of_q),
        ("jump of velocity", trajectory.qd, size_of_qd),
        ("jump of acceleration", trajectory.qdd, size_of_qdd),
    ):
        jumps = np.abs(values(inner, "right") - values(inner, "left")) / size
        k, i = np.unravel_index(int(np.argmax(jumps)), jumps.shape)
        found.append(Check(what, float(jumps[k, i]), int(i), float(inner[k])))
    worst = max(found, key=lambda check: check.excess)
    return worst if worst.excess > ACCEPTED_EXCESS else None


def _points_of_turns(description: Description, motion: Trajectory) -> int:
    """Return the number of states of a piece with which no joint turns by more than ``LARGEST_TURN`` between two."""
    _, rates = motion.pieces.differentiated(1).inside(POINTS)
    # A joint turns by the mean of |qd| times the piece's duration.
    turns = np.abs(rates).mean(axis=1) * np.diff(motion.breaks)[:, None]
    most = float(turns[:, ~description.numbers.prismatic].max(initial=0.0))
    return int(min(most / LARGEST_TURN + 2, MAX_POINTS))


def _proved_check(motion: Trajectory, limits: Limits, kind: Limit) -> Check:
    """Return the check of positions or one of their derivatives: bounds of the polynomials, not samples."""
    pieces = motion.pieces.differentiated(int(kind))
    if kind is Limit.POSITION:
        lower = limits.lower
        upper = limits.upper
        size = PositionLimit(limits).sizes
    else:
        size = getattr(limits, kind.what)
        lower = -size
        upper = size
    found = pieces.bounds(PROVED * size)
    unit = np.where(np.isfinite(size), size, 1.0)  # joints without a limit: -inf
    above = (found.highest - upper) / unit
    below = (lower - found.lowest) / unit
    excess = np.maximum(above, below)
    excess = np.where(np.isnan(excess), np.inf, excess)  # of polynomials that overflow: not kept
    i = int(np.argmax(excess))
    time = found.at_highest[i] if above[i] >= below[i] else found.at_lowest[i]
    return Check(kind.what, float(excess[i]), i, float(time), limit=kind)


def _time_shares(trajectory: Trajectory, states: States) -> Array:
    """Return the share of the duration that each state stands for by the trapezoidal rule, shape (N,)."""
    # A piece of N states has the weights (1/2, 1, ..., 1, 1/2) / (N - 1), times its share of the duration.
    K = len(trajectory.breaks) - 1
    weights = np.ones(len(states.times) // K)
    weights[[0, -1]] = 0.5
    weights /= weights.sum()
    shares: Array = np.outer(np.diff(trajectory.breaks), weights).ravel() / trajectory.duration
    return shares
