"""Pieces of a motion as CasADi expressions: accelerations integrated exactly, and bounds inside intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dhkit.planning.mesh import Curve

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True, eq=False)
class MotionPieces:
    """Pieces of a motion with K intervals as MX expressions."""

    q_end: casadi.MX
    """Joint values at the ends of intervals, n x K."""
    qd_end: casadi.MX
    q_inside: casadi.MX
    """Bernstein coefficients that bound positions inside intervals, n x any number."""
    qd_inside: casadi.MX | None
    """Coefficients that bound velocities inside intervals; None if the knots bound them."""
    qdd_inside: casadi.MX | None
    """Coefficients that bound accelerations inside intervals; None if knots and midpoints bound them."""
    q_middle: casadi.MX
    """Joint values at the midpoints of intervals, n x K."""
    jerk: casadi.MX
    """Jerks at the ends of intervals, n x any number."""
    squared_jerk: casadi.MX
    """Integral of the squared jerk."""
    states: tuple[casadi.MX, casadi.MX, casadi.MX]
    """q, qd and qdd at the P points where torques are limited, n x P."""
    weights: casadi.MX
    """Weights of these points in an integral over time, 1 x P, s."""

    @classmethod
    def of(cls, curve: Curve, Q: casadi.MX, V: casadi.MX, A: casadi.MX, H: casadi.MX, *, dense: bool) -> MotionPieces:
        """Return the pieces of a curve; with ``dense``, midpoints are among the states."""
        import casadi

        q, v, h = Q[:, :-1], V[:, :-1], H[0, :]
        if curve is Curve.CONSTANT:
            # Positions are parabolas, inside the hull of their Bernstein coefficients: the ends and q + h v / 2.
            return cls(
                q_end=q + H * v + H * H / 2 * A,
                qd_end=v + H * A,
                q_inside=q + H / 2 * v,
                qd_inside=None,
                qdd_inside=None,
                q_middle=q + H / 2 * v + H * H / 8 * A,
                jerk=casadi.MX(Q.shape[0], 0),
                squared_jerk=casadi.MX(0),
                states=(casadi.horzcat(q, Q[:, 1:]), casadi.horzcat(v, V[:, 1:]), casadi.horzcat(A, A)),
                weights=casadi.horzcat(h / 2, h / 2),
            )
        if curve is Curve.JUMPING:
            a, c = A[:, 0::2], A[:, 1::2]
            middle = (
                q + H / 2 * v + H * H * (5 * a + c) / 48,
                v + H * (3 * a + c) / 8,
                (a + c) / 2,
            )
            sides = ((q, Q[:, 1:]), (v, V[:, 1:]), (a, c))
            at = [[*pair, x] if dense else list(pair) for pair, x in zip(sides, middle, strict=True)]
            weights = [h / 6, h / 6, 2 * h / 3] if dense else [h / 2, h / 2]
            # Positions are cubics, velocities parabolas: both inside the hulls of their Bernstein coefficients.
            return cls(
                q_end=q + H * v + H * H * (a / 3 + c / 6),
                qd_end=v + H * (a + c) / 2,
                q_inside=casadi.horzcat(q + H / 3 * v, Q[:, 1:] - H / 3 * V[:, 1:]),
                qd_inside=v + H / 2 * a,
                qdd_inside=None,
                q_middle=middle[0],
                jerk=(c - a) / H,
                squared_jerk=casadi.MX(0),
                states=(casadi.horzcat(*at[0]), casadi.horzcat(*at[1]), casadi.horzcat(*at[2])),
                weights=casadi.horzcat(*weights),
            )
        if curve is Curve.LINEAR:
            a, c = A[:, :-1], A[:, 1:]
            b = (a + c) / 2
        else:
            a, b, c = A[:, 0:-1:2], A[:, 1::2], A[:, 2::2]
        q_middle = q + H / 2 * v + H * H * (7 * a + 6 * b - c) / 96
        qd_middle = v + H * (5 * a + 8 * b - c) / 24
        first, last = (-3 * a + 4 * b - c) / H, (a - 4 * b + 3 * c) / H
        ends = casadi.MX(1, 1)
        around = (casadi.horzcat(h, ends) + casadi.horzcat(ends, h)) / 6
        return cls(
            q_end=q + H * v + H * H * (a / 6 + b / 3),
            qd_end=v + H * (a + 4 * b + c) / 6,
            q_inside=q_middle,
            # Velocities are parabolas or cubics, inside the hulls of their Bernstein coefficients.
            qd_inside=v + H / 2 * a if curve is Curve.LINEAR else casadi.horzcat(v + H / 3 * a, V[:, 1:] - H / 3 * c),
            qdd_inside=None if curve is Curve.LINEAR else 2 * b - (a + c) / 2,
            q_middle=q_middle,
            jerk=first if curve is Curve.LINEAR else casadi.horzcat(first, last),
            squared_jerk=casadi.sum2(casadi.sum1(H / 3 * (first * first + first * last + last * last))),
            states=(
                casadi.horzcat(Q, q_middle),
                casadi.horzcat(V, qd_middle),
                casadi.horzcat(_knots_of(curve, A), b),
            ),
            weights=casadi.horzcat(around, 2 * h / 3),
        )


def _knots_of(curve: Curve, A: casadi.MX) -> casadi.MX:
    """Return the accelerations at the knots, n x (K + 1)."""
    return A if curve is Curve.LINEAR else A[:, 0::2]
