"""Joint paths without timing, and their exact composition with a time law."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, description_of
from dhkit.display import counted, repr_line
from dhkit.trajectories.pieces import Pieces, shift
from dhkit.trajectories.timing import configuration
from dhkit.trajectories.trajectory import Trajectory

_BISECTIONS = 60
"""Number of bisections that reduce an interval to rounding."""
_SAME_BREAK = 1e-12
"""Breaks closer to each other than this share of the duration are merged."""
_LAW_SLACK = 1e-9
"""Largest distance by which a time law may leave [0, 1], go back or jump: rounding."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """A path q(s) = sum_j coefficients[k, j] (s - breaks[k])^j of the joints over s in [0, 1].

    Parameters
    ----------
    description
        The robot.
    breaks
        Shape (K+1,), from 0 to 1, increasing.
    coefficients
        Shape (K, p+1, n), ascending powers, rad and m.

    Raises
    ------
    ValueError
        Other shapes, values that are not finite, or breaks that do not go from 0 to 1.
    TypeError
        Not numbers.
    """

    description: Description
    breaks: Array
    coefficients: Array
    pieces: Pieces = field(init=False)
    """The same polynomials, without the robot."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "description", description_of(self.description))
        pieces = Pieces.of(self.breaks, self.coefficients, self.description.n)
        if pieces.end != 1.0:
            raise ValueError(f"breaks end with {pieces.end:g}; expected 1")
        for name, value in (
            ("breaks", pieces.breaks),
            ("coefficients", pieces.coefficients),
            ("pieces", pieces),
        ):
            object.__setattr__(self, name, value)

    @classmethod
    def straight(cls, description: Description, q0: ArrayLike, q1: ArrayLike) -> JointPath:
        """Return the straight line between two configurations, shape (n,), rad and m.

        Parameters
        ----------
        description
            The arm.
        q0, q1
            Start and goal, shape (n,), rad and m.

        Raises
        ------
        ValueError
            Other shapes, or values that are not finite.
        TypeError
            Not numbers.

        Examples
        --------
        >>> from dhkit.description import library_robot
        >>> JointPath.straight(library_robot("planar2r"), [0, 1], [1, 3]).q(0.5)
        array([0.5, 2. ])
        """
        start = configuration(description, q0, "q0")
        goal = configuration(description, q1, "q1")
        return cls(description, np.array([0.0, 1.0]), np.stack([start, goal - start])[None])

    def q(self, s: ArrayLike) -> Array:
        """Return joint values, shape (..., n), rad and m, for s of shape (...).

        Parameters
        ----------
        s
            Places on the path, shape (...), from 0 to 1.
        """
        return self.pieces(s)

    def qs(self, s: ArrayLike) -> Array:
        """Return the first derivatives by s, shape (..., n).

        Parameters
        ----------
        s
            Places on the path, shape (...), from 0 to 1.
        """
        return self.pieces.derivative(s)

    def qss(self, s: ArrayLike) -> Array:
        """Return the second derivatives by s, shape (..., n).

        Parameters
        ----------
        s
            Places on the path, shape (...), from 0 to 1.
        """
        return self.pieces.derivative.derivative(s)

    def timed(self, breaks: ArrayLike, coefficients: ArrayLike) -> Trajectory:
        """Return the motion q(s(t)) exactly: degrees multiply, and the breaks of both are breaks of the motion.

        Parameters
        ----------
        breaks
            Breaks of s(t), shape (K+1,), s, from 0, increasing.
        coefficients
            Shape (K, p+1), ascending powers from each break: s(t) goes from 0 to 1 and never back.

        Raises
        ------
        ValueError
            Other shapes, values that are not finite, or an s that goes back or does not go from 0 to 1.
        TypeError
            Not numbers.
        """
        rows = np.asarray(coefficients)
        if rows.ndim != 2:
            raise ValueError(f"coefficients has shape {rows.shape}; expected (K, p+1)")
        law = Pieces.of(breaks, rows[..., None], 1)
        _check_law(law)

        # Between merged breaks, s(t) is one piece k of the law, and q(s) one piece m of the path.
        merged = self._merged_breaks(law)
        starts = merged[:-1]
        middles = (merged[:-1] + merged[1:]) / 2
        k = np.searchsorted(law.breaks, middles) - 1
        m = np.searchsorted(self.breaks, law(middles)[..., 0]) - 1
        m = np.clip(m, 0, len(self.breaks) - 2)

        # Both about the beginning of the piece: s = s_0 + inner(t - t_0), q = outer(s - s_0).
        inner = shift(law.coefficients[k], starts - law.breaks[k])[..., 0]
        outer = shift(self.coefficients[m], inner[:, 0] - self.breaks[m])
        inner[:, 0] = 0.0
        return Trajectory(self.description, merged, _compose(outer, inner))

    def __repr__(self) -> str:
        pieces, powers = self.coefficients.shape[:2]
        return repr_line(
            "JointPath", self.description.name, f"{counted(pieces, 'piece')} of degree {powers - 1}"
        )

    def _merged_breaks(self, law: Pieces) -> Array:
        """Return the law's breaks together with the times at which s passes breaks of the path."""
        # The times of all inner breaks at once: s never goes back.
        low = np.zeros(len(self.breaks) - 2)
        high = np.full(len(self.breaks) - 2, law.end)
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            below = law(middle)[..., 0] < self.breaks[1:-1]
            low = np.where(below, middle, low)
            high = np.where(below, high, middle)
        crossings = (low + high) / 2

        gaps = np.abs(crossings[:, None] - law.breaks).min(axis=1, initial=np.inf)
        new = crossings[gaps > _SAME_BREAK * law.end]
        merged = np.sort(np.concatenate([law.breaks, new]))
        distinct: Array = merged[np.concatenate([[True], np.diff(merged) > 0])]
        return distinct


def quintic_law() -> tuple[Array, Array]:
    """Return breaks (2,), s, and coefficients (1, 6) of s(t) = 10 t^3 - 15 t^4 + 6 t^5: from rest to rest in 1 s."""
    return np.array([0.0, 1.0]), np.array([[0.0, 0.0, 0.0, 10.0, -15.0, 6.0]])


def _check_law(law: Pieces) -> None:
    """Check that s(t) goes from 0 to 1, continuously and never back.

    Raises
    ------
    ValueError
        It does not.
    """
    start = float(law(0.0)[0])
    end = float(law(law.end)[0])
    if max(abs(start), abs(end - 1.0)) > _LAW_SLACK:
        raise ValueError(f"s goes from {start:.9g} to {end:.9g}; expected from 0 to 1")
    inside = law.breaks[1:-1]
    jump = np.abs(law(inside) - law(inside, "left")).max(initial=0.0)
    if jump > _LAW_SLACK:
        raise ValueError(f"s jumps by {jump:.3g} at a break; expected a continuous s(t)")
    rate = law.derivative.bounds(_LAW_SLACK / law.end / 2)
    if rate.lowest[0] * law.end < -_LAW_SLACK:
        raise ValueError(
            f"s goes back at {rate.at_lowest[0]:.4g} s; expected an s(t) that never does"
        )


def _compose(outer: Array, inner: Array) -> Array:
    """Return the coefficients of outer(inner(u)), by Horner's rule, shape (K, p r + 1, n).

    Parameters
    ----------
    outer
        Coefficients of K polynomials of degree p, shape (K, p+1, n).
    inner
        Coefficients of K polynomials of degree r, shape (K, r+1).
    """
    p = outer.shape[1] - 1
    r = inner.shape[1] - 1
    result = np.zeros((len(outer), p * r + 1, outer.shape[2]))
    result[:, 0] = outer[:, p]
    for j in range(p - 1, -1, -1):
        # result <- inner * result + outer_j; the result so far has this degree
        degree = (p - 1 - j) * r
        product = np.zeros_like(result)
        for i in range(r + 1):
            product[:, i : i + degree + 1] += inner[:, i, None, None] * result[:, : degree + 1]
        product[:, 0] += outer[:, j]
        result = product
    return result
