"""A path on a grid, and the arm's states along it, as numbers and as CasADi symbols.

With q(s), its derivatives q' and q'' by s, and the speed sd and the acceleration sdd along the path,

    qd = q' sd,    qdd = q' sdd + q'' sd^2,    tau = m sdd + c sd^2 + g

(Bobrow, Dubowsky and Gibson 1985, Time-optimal control of robotic manipulators along specified paths). The grid is
finer where the arm has to move slowly, with knots where the path's curvature jumps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dhkit import dynamics, kinematics
from dhkit.description import Array, Description
from dhkit.description.robot import require_bodies
from dhkit.planning.criteria import LoadedArm, Point
from dhkit.symbolic import Friction
from dhkit.symbolic.differentiable.friction import friction_parameters, friction_torque
from dhkit.trajectories import JointPath, Limits

if TYPE_CHECKING:
    import casadi

JUMP_ROUNDING = 1e-6
"""Jump of a derivative, relative to its largest value, that counts as rounding."""
EVEN_SHARE = 0.3
"""Share of the grid's density that is even in s; the rest is even in time."""
MIN_TIME = 1e-12
"""Smallest duration of a path, s, by which the times of its intervals are divided."""
CANCELLED_SHARE = 1e-9
"""Magnitude of a sum relative to that of its parts below which it counts as zero."""


def jumps(path: JointPath, order: int) -> Array:
    """Return the jumps of a derivative by s at the inner breaks, shape (K-1, n), rad and m."""
    pieces = path.pieces.differentiated(order)
    inside = path.breaks[1:-1]
    steps: Array = pieces(inside) - pieces(inside, "left")
    return steps


def knots_of(path: JointPath, intervals: int, rough: Array, speeds: Array) -> Array:
    """Return a grid whose intervals take about the same time, with knots where the path's curvature jumps.

    From rest, s and the first knots grow as t^2; where joints have to move slowly, near singularities, the grid is
    finer. The knots are those at which the cumulative share of a blend of time and s, 0 to 1, is
    (1 - cos(pi k / K)) / 2.

    Parameters
    ----------
    rough, speeds
        A first grid, shape (K+1,), and the largest constant speed in its intervals, shape (K,), 1/s.
    """
    steps = np.diff(rough)
    times = steps / speeds

    # Share of interval k: (1 - EVEN_SHARE) t_k / sum(t) + EVEN_SHARE ds_k, where sum(ds) = 1.
    share = (1 - EVEN_SHARE) * times / max(float(times.sum()), MIN_TIME) + EVEN_SHARE * steps
    covered = np.concatenate([[0.0], np.cumsum(share) / share.sum()])
    x = (1 - np.cos(np.linspace(0.0, np.pi, intervals + 1))) / 2
    knots = np.interp(x, covered, rough)

    # The nearest knot moves to a jump of the curvature; a knot is added if that one is at another jump.
    taken = set()
    bends = np.abs(jumps(path, 2)).max(axis=1)
    is_bend = bends > JUMP_ROUNDING * np.abs(path.qss(path.breaks)).max()
    for s in path.breaks[1:-1][is_bend]:
        k = int(np.argmin(np.abs(knots[1:-1] - s))) + 1
        if knots[k] in taken:
            knots = np.insert(knots, np.searchsorted(knots, s), s)
        else:
            knots[k] = s
        taken.add(s)
    return knots


@dataclass(frozen=True, eq=False)
class PathStates:
    """A path and the arm's dynamics at both ends of K intervals: shapes (2, K, ...), left ends first."""

    s: Array
    """Path parameter, shape (2, K)."""
    q: Array
    """Joint values, shape (2, K, n), rad and m."""
    qs: Array
    """First derivatives of q by s, shape (2, K, n)."""
    qss: Array
    """Second derivatives of q by s, shape (2, K, n)."""
    m: Array
    """Torque per sdd, shape (2, K, n); zeros without bodies."""
    c: Array
    """Torque per sd^2, shape (2, K, n)."""
    g: Array
    """Gravity torque, shape (2, K, n), N m and N."""
    ps: Array
    """Derivatives of the tool's position by s, shape (2, K, 3), m."""
    pss: Array
    """Second derivatives of the tool's position by s, shape (2, K, 3), m."""
    qsss: Array
    """Third derivatives of q by s, shape (2, K, n)."""

    @classmethod
    def of(cls, arm: LoadedArm, path: JointPath, knots: Array) -> PathStates:
        """Evaluate a path (rad and m) on knots (K+1,); at jumps of curvature each interval has its side's value.

        The torques of the states (q, qd, qdd) = (q, 0, q') and (q, q', q'') are M q' + g and M q'' + C q' + g, so that

            m = M q',    c = M q'' + C(q, q') q',

        and the tool's position p has p' = J q', p'' = J q'' + Jd q', with Jd for the rates q'.
        """

        def at_both_ends(order: int) -> Array:
            """Return the derivative of q by s of an order at both ends of each interval, shape (2, K, n)."""
            derivative = path.pieces.differentiated(order)
            return np.stack([derivative(knots[:-1], "right"), derivative(knots[1:], "left")])

        q = at_both_ends(0)
        qs = at_both_ends(1)
        qss = at_both_ends(2)
        qsss = at_both_ends(3)
        still = np.zeros_like(q)
        m = still
        c = still
        g = still
        if np.isfinite(arm.numbers.mass).all():
            g = dynamics.inverse_dynamics(arm, q, still, still)
            m = dynamics.inverse_dynamics(arm, q, still, qs) - g
            c = dynamics.inverse_dynamics(arm, q, qs, qss) - g
        J = kinematics.jacobian(arm, q)[..., :3, :]
        Jd = kinematics.jacobian_dot(arm, q, qs)[..., :3, :]
        ps = np.einsum("...ij,...j->...i", J, qs)
        pss = np.einsum("...ij,...j->...i", J, qss) + np.einsum("...ij,...j->...i", Jd, qs)
        return cls(np.stack([knots[:-1], knots[1:]]), q, qs, qss, m, c, g, ps, pss, qsss)

    @property
    def steps(self) -> Array:
        """Lengths of the intervals in s, shape (K,)."""
        steps: Array = self.s[1] - self.s[0]
        return steps

    @property
    def coefficients(self) -> Array:
        """Arguments of :class:`PathPoint` at both ends of the intervals, shape (2, K, 7 n + 6)."""
        parts = [self.q, self.qs, self.qss, self.m, self.c, self.g, self.ps, self.pss, self.qsss]
        return np.concatenate(parts, axis=-1)

    # Speeds without friction and further constraints, for grids and guesses

    def fastest(self, limits: Limits, shares: Array | float = 0.0) -> Array:
        """Return the largest sd^2 at each knot by the limits of joint rates, shape (K+1,), 1/s^2: (v / |q'|)^2.

        Parameters
        ----------
        shares
            Margins of each joint's speed limit, shape (K, n).
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            joints = ((1 - shares) * limits.velocity / np.abs(self.qs)) ** 2
            most = np.where(np.isnan(joints), np.inf, joints).min(axis=2)

        # An inner knot is the right end of one interval and the left end of the next: the smaller bound counts.
        bounds = np.full(most.shape[1] + 1, np.inf)
        bounds[:-1] = most[0]
        bounds[1:] = np.minimum(bounds[1:], most[1])
        return bounds

    def even_speeds(self, limits: Limits) -> Array:
        """Return the largest constant speed along the path in each interval, shape (K,), 1/s."""
        # A constant b has sdd = b' / 2 = 0, so that the largest factor of b = 1 is the largest b = sd^2.
        fastest = self.fastest(limits)
        ones = np.ones(len(fastest))
        most = np.minimum(
            np.minimum(fastest[:-1], fastest[1:]), self._factors(limits, ones).min(axis=0)
        )
        speeds: Array = np.sqrt(most)
        return speeds

    def largest(self, limits: Limits, shape: Array) -> float:
        """Return the largest factor of sd^2 = shape (K+1,), 1/s^2, with which all limits that rest keeps are kept."""
        with np.errstate(divide="ignore"):
            return min(
                float(np.min(self.fastest(limits) / shape)),
                float(self._factors(limits, shape).min()),
            )

    def _factors(self, limits: Limits, shape: Array) -> Array:
        """Return the largest factors of b = sd^2 = shape (K+1,) by limits of torque and acceleration, shape (2, K).

        With b linear in s, sdd = b' / 2. A factor k multiplies b and sdd alike, so that a torque is k u + g with
        u = m sdd + c b, and an acceleration k u with u = q' sdd + q'' b: the limit is kept up to

            k = (limit - sign(u) g) / |u|,    with g = 0 for accelerations.
        """
        b = np.stack([shape[:-1], shape[1:]])[..., None]
        sdd = (np.diff(shape) / (2 * self.steps))[:, None]
        found = np.full(self.s.shape, np.inf)
        for by_sdd, by_b, at_rest, limit in (
            (self.m, self.c, self.g, limits.torque),
            (self.qs, self.qss, 0 * self.q, limits.acceleration),
        ):
            # u, which is only rounding where it is tiny beside its terms and gravity: it limits nothing there.
            moving = by_sdd * sdd + by_b * b
            parts = np.abs(by_sdd * sdd) + np.abs(by_b * b) + np.abs(at_rest)
            moving[np.abs(moving) < CANCELLED_SHARE * parts] = 0.0

            # No factor keeps a limit that gravity alone reaches (spare <= 0): it is left out.
            spare = limit - np.sign(moving) * at_rest
            with np.errstate(divide="ignore", invalid="ignore"):
                most = np.where((spare > 0) & (moving != 0), spare / np.abs(moving), np.inf)
            found = np.minimum(found, most.min(axis=2))
        return found


class PathPoint(Point):
    """A state on a path: its speed and acceleration sd and sdd along it, and the path's coefficients there.

    The coefficients are those of :class:`PathStates`, 7 n + 6.
    """

    def __init__(self, description: Description, limits: Limits, friction: Friction | None) -> None:
        import casadi

        n = description.n
        self.description = description
        self.limits = limits
        self.n = n
        self.friction = friction
        self.b = casadi.SX.sym("b")
        self.speed = casadi.SX.sym("speed")
        self.sdd = casadi.SX.sym("sdd")
        self.path = casadi.SX.sym("path", 7 * n + 6)
        edges = [*range(0, 6 * n + 1, n), 6 * n + 3, 6 * n + 6, 7 * n + 6]
        q, qs, qss, m, c, g, ps, pss, _ = casadi.vertsplit(self.path, edges)

        # b = sd^2 is a variable of its own: the programs are written in it.
        #   qd = q' sd,  qdd = q' sdd + q'' b,  tau = m sdd + c b + g,  v = p' sd,  a = p' sdd + p'' b
        self.q = q
        self.qd = qs * self.speed
        self.qdd = qs * self.sdd + qss * self.b
        self.load = casadi.SX(0, 1)  # torques along the path include the payload
        self._rigid = m * self.sdd + c * self.b + g
        self._tool_velocity = ps * self.speed
        self._tool_acceleration = ps * self.sdd + pss * self.b

    @cached_property
    def tau(self) -> casadi.SX:
        """Joint torques, n x 1, N m and N."""
        require_bodies(self.description)
        return self._rigid + self._friction_torque

    @cached_property
    def dissipation(self) -> casadi.SX:
        """The power lost to friction, 1 x 1, W."""
        import casadi

        return casadi.dot(self._friction_torque, self.qd)

    @cached_property
    def _friction_torque(self) -> casadi.SX:
        import casadi

        if self.friction is None:
            return casadi.SX(self.n, 1)
        parameters = friction_parameters(self.description.numbers, self.friction.width)
        return friction_torque(
            self.qd, casadi.SX(casadi.DM(parameters)), smooth=self.friction.width > 0
        )

    @cached_property
    def tool_velocity(self) -> casadi.SX:
        """The velocity of the tool's origin, 3 x 1, m/s."""
        return self._tool_velocity

    @cached_property
    def tool_acceleration(self) -> casadi.SX:
        """The acceleration of the tool's origin, 3 x 1, m/s^2."""
        return self._tool_acceleration
