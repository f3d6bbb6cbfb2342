"""Variables of the program of a motion, by their indices, and the points at which its states are limited."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.planning.program.blocks import Indices
from dhkit.planning.program.mesh import Curve, Mesh


@dataclass(frozen=True, eq=False)
class Variables:
    """Indices of a program's variables: a row for each joint, a column for each point; empty where there are none."""

    durations: Indices
    """Of each leg, shape (legs,)."""
    q: Indices
    """At the knots, shape (n, intervals + 1)."""
    qd: Indices
    qdd: Indices
    """Shape (n, columns), see :class:`Curve`."""
    middles: tuple[Indices, Indices, Indices]
    """Joint values, rates and accelerations at the middles of intervals, shape (n, intervals) each or empty."""
    positive_parts: Indices
    """Of the objective's quantities at the points of the states, shape (k, P)."""

    @classmethod
    def of(cls, n: int, mesh: Mesh, middles: tuple[bool, bool, bool]) -> Variables:
        """Return the indices of variables in the order of the fields, point by point."""
        K = mesh.intervals
        counts = (K + 1, K + 1, mesh.curve.columns(K), *(K * is_there for is_there in middles))
        edges = len(mesh.legs) + n * np.cumsum([0, *counts])
        q, qd, qdd, *rest = (
            np.arange(edge, edge + n * count).reshape(n, count, order="F")
            for edge, count in zip(edges[:-1], counts, strict=True)
        )
        none = np.zeros((0, 0), dtype=int)
        return cls(np.arange(len(mesh.legs)), q, qd, qdd, (rest[0], rest[1], rest[2]), none)

    def with_positive_parts(self, quantities: int, points: int) -> Variables:
        """Return the same with the positive parts of so many quantities at so many points of the states."""
        indices = self.count + np.arange(quantities * points)
        return replace(self, positive_parts=indices.reshape(quantities, points, order="F"))

    @property
    def count(self) -> int:
        """The number of variables."""
        rest = (self.q, self.qd, self.qdd, *self.middles, self.positive_parts)
        return len(self.durations) + sum(indices.size for indices in rest)


@dataclass(frozen=True, eq=False)
class StatePoints:
    """Points of a motion: the indices of their variables, their intervals, and their weights in an integral."""

    q: Indices
    """Shape (n, P)."""
    qd: Indices
    qdd: Indices
    intervals: Indices
    """First and last interval of each point, shape (P, 2)."""
    weights: Array
    """Shape (P,), shares of the leg's duration."""
    leg: Indices
    """Shape (P,)."""
    is_limited: NDArray[np.bool_]
    """Whether limits apply, shape (P,): a point that appears twice is limited once."""

    @classmethod
    def of(cls, mesh: Mesh, at: Variables, *, with_middles: bool) -> StatePoints:
        """Return the ends of intervals, and their middles on request; a curve without jumps has both ends in common."""
        K, step = mesh.intervals, np.arange(mesh.intervals)
        columns = np.array([mesh.curve.columns_of(k) for k in range(K)])
        each = np.stack([step, step], axis=1)
        if mesh.curve in (Curve.CONSTANT, Curve.JUMPING):
            ends = cls._of(
                np.hstack([at.q[:, :-1], at.q[:, 1:]]),
                np.hstack([at.qd[:, :-1], at.qd[:, 1:]]),
                np.hstack([at.qdd[:, columns[:, 0]], at.qdd[:, columns[:, -1]]]),
                np.vstack([each, each]),
                np.tile(mesh.shares, 2) * (1 / 6 if with_middles else 1 / 2),
                np.tile(mesh.leg, 2),
            )
        else:
            # A knot between two legs appears once for each, since its weights depend on both durations.
            leg, shares = mesh.leg, mesh.shares
            knots = [(leg[0], 0, 0, 0, shares[0] / 6)]
            for k in range(1, K):
                before, after = shares[k - 1] / 6, shares[k] / 6
                if leg[k] == leg[k - 1]:
                    knots.append((leg[k], k, k - 1, k, before + after))
                else:
                    knots += [(leg[k - 1], k, k - 1, k, before), (leg[k], k, k - 1, k, after)]
            knots.append((leg[-1], K, K - 1, K - 1, shares[-1] / 6))
            which = np.array([knot[:4] for knot in knots], dtype=int)
            at_knot = np.append(columns[:, 0], columns[-1, -1])
            ends = cls._of(
                at.q[:, which[:, 1]],
                at.qd[:, which[:, 1]],
                at.qdd[:, at_knot[which[:, 1]]],
                which[:, 2:],
                np.array([knot[4] for knot in knots]),
                which[:, 0],
                np.append(True, np.diff(which[:, 1]) > 0),
            )
        if not with_middles:
            return ends
        q, qd, qdd = at.middles
        qdd = qdd if qdd.size else at.qdd[:, columns[:, 1]]
        return ends._with_points(cls._of(q, qd, qdd, each, 2 / 3 * mesh.shares, mesh.leg))

    @classmethod
    def _of(
        cls,
        q: Indices,
        qd: Indices,
        qdd: Indices,
        intervals: Indices,
        weights: Array,
        leg: Indices,
        is_limited: NDArray[np.bool_] | None = None,
    ) -> StatePoints:
        """Return points that are all limited, unless told otherwise."""
        is_limited = np.ones(len(leg), dtype=bool) if is_limited is None else is_limited
        return cls(q, qd, qdd, intervals, weights, leg, is_limited)

    @property
    def count(self) -> int:
        """The number of points."""
        return len(self.leg)

    def _with_points(self, other: StatePoints) -> StatePoints:
        """Return these points followed by others."""
        return StatePoints(
            np.hstack([self.q, other.q]),
            np.hstack([self.qd, other.qd]),
            np.hstack([self.qdd, other.qdd]),
            np.vstack([self.intervals, other.intervals]),
            np.append(self.weights, other.weights),
            np.append(self.leg, other.leg),
            np.append(self.is_limited, other.is_limited),
        )
