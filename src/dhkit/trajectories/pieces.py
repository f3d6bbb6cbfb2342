"""Piecewise polynomials with several columns, for trajectories, joint paths and time laws."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array
from dhkit.description.arrays import number_array
from dhkit.display import counted, repr_line

Side: TypeAlias = Literal["right", "left"]
"""The piece that is evaluated at a break: the one that begins there (right) or ends there (left)."""
_MAX_HALVINGS = 60
"""Number of times that a piece is halved for a bound: from 2^-26 of a piece on, hulls are exact to rounding."""


class Bounds(NamedTuple):
    """Proved bounds of m functions, and the arguments at which they are nearly reached, shape (m,) each."""

    lowest: Array
    """Lower bounds."""
    at_lowest: Array
    """Arguments of the lowest values."""
    highest: Array
    """Upper bounds."""
    at_highest: Array
    """Arguments of the highest values."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """A piecewise polynomial f(x) = sum_j coefficients[k, j] (x - breaks[k])^j for breaks[k] <= x <= breaks[k + 1]."""

    breaks: Array
    """Shape (K+1,), from 0, increasing, read-only."""
    coefficients: Array
    """Shape (K, p+1, m), read-only."""

    @classmethod
    def of(cls, breaks: ArrayLike, coefficients: ArrayLike, columns: int) -> Pieces:
        """Return pieces from copies of breaks (K+1,), s, and coefficients (K, p+1, columns), which are checked.

        Raises
        ------
        ValueError
            Shapes other than (K+1,) and (K, p+1, columns), values that are not finite, or breaks that do not begin
            with 0 and increase.
        TypeError
            Not numbers.
        """
        b = np.array(number_array(breaks, "breaks", "(K+1,)"))
        c = np.array(number_array(coefficients, "coefficients", f"(K, p+1, {columns})"), order="C")
        if b.ndim != 1 or len(b) < 2:
            raise ValueError(f"breaks has shape {b.shape}; expected (K+1,) with K >= 1")
        if c.ndim != 3 or c.shape[0] != len(b) - 1 or c.shape[1] < 1 or c.shape[2] != columns:
            raise ValueError(
                f"coefficients has shape {c.shape}; expected ({len(b) - 1}, p+1, {columns})"
            )
        for name, array in (("breaks", b), ("coefficients", c)):
            if not np.isfinite(array).all():
                place = tuple(map(int, np.argwhere(~np.isfinite(array))[0]))
                raise ValueError(f"{name} has {array[place]} at {place}; expected finite values")
        if b[0] != 0.0:
            raise ValueError(f"breaks begin with {b[0]:g}; expected 0")
        if (np.diff(b) <= 0).any():
            k = int(np.flatnonzero(np.diff(b) <= 0)[0])
            raise ValueError(
                f"breaks do not increase: breaks[{k}] is {b[k]:g}, breaks[{k + 1}] is {b[k + 1]:g}"
            )
        b.flags.writeable = c.flags.writeable = False
        return cls(b, c)

    @property
    def end(self) -> float:
        """The last break."""
        return float(self.breaks[-1])

    @cached_property
    def derivative(self) -> Pieces:
        """The first derivative."""
        # d/du sum of c_j u^j = sum of j c_j u^(j-1)
        j = np.arange(1, self.coefficients.shape[1])[:, None]
        if not len(j):
            return Pieces(self.breaks, np.zeros_like(self.coefficients))
        return Pieces(self.breaks, self.coefficients[:, 1:] * j)

    def differentiated(self, order: int) -> Pieces:
        """Return a derivative; order 0 is the function itself."""
        return self.derivative.differentiated(order - 1) if order else self

    def __call__(self, x: ArrayLike, side: Side = "right") -> Array:
        """Return values, shape (..., m), for x of shape (...); outside, the first and last polynomials continue."""
        x = np.asarray(x, dtype=float)
        if side not in ("right", "left"):
            raise ValueError(f"side is {side!r}; expected 'right' or 'left'")
        k = np.clip(np.searchsorted(self.breaks, x, side) - 1, 0, len(self.coefficients) - 1)
        values = self.on(k, x - self.breaks[k])
        values[np.isnan(x)] = np.nan
        return values

    def on(self, piece: NDArray[np.intp], u: Array) -> Array:
        """Return values, shape (..., m), of given pieces at u after their beginnings, shapes (...)."""
        # Horner's rule.
        value: Array = self.coefficients[piece, -1] + 0.0 * u[..., None]
        for power in range(self.coefficients.shape[1] - 2, -1, -1):
            value = value * u[..., None] + self.coefficients[piece, power]
        return value

    def backwards(self) -> Pieces:
        """Return f(end - x)."""
        # Each piece in powers of u from its end, and with -u instead of u.
        from_end = shift(self.coefficients, np.diff(self.breaks))[::-1]
        signs = (-1.0) ** np.arange(from_end.shape[1])[:, None]
        return Pieces(self.end - self.breaks[::-1], from_end * signs)

    def divided(self, parts: int) -> Pieces:
        """Return the same function with each piece divided into equal parts."""
        width = np.repeat(np.diff(self.breaks) / parts, parts)
        begin = np.tile(np.arange(parts), len(self.coefficients)) * width
        breaks = np.append(np.repeat(self.breaks[:-1], parts) + begin, self.end)
        return Pieces(breaks, shift(np.repeat(self.coefficients, parts, axis=0), begin))

    def with_breaks(self, breaks: Array) -> Pieces:
        """Return the same function with other breaks, shape (K+1,), among which its own are."""
        piece = np.searchsorted(self.breaks, breaks[:-1], side="right") - 1
        return Pieces(breaks, shift(self.coefficients[piece], breaks[:-1] - self.breaks[piece]))

    @property
    def bernstein(self) -> Array:
        """Bernstein coefficients of each piece, shape (K, p+1, m).

        On a piece of width w the function lies between the smallest and the largest of them (Farin 2002, ch. 5):

            b_i = sum_j binomial(i, j) / binomial(p, j) w^j c_j.
        """
        p = self.coefficients.shape[1] - 1
        powers = np.diff(self.breaks)[:, None] ** np.arange(p + 1)
        matrix = np.zeros((p + 1, p + 1))
        for i in range(p + 1):
            for j in range(p + 1):
                matrix[i, j] = comb(i, j) / comb(p, j)
        return np.asarray(np.einsum("ij,kj,kjm->kim", matrix, powers, self.coefficients))

    def bounds(self, tolerance: ArrayLike) -> Bounds:
        """Return bounds of the values of each column.

        They are proved: the smallest and largest Bernstein coefficients of pieces that are halved until these are
        within ``tolerance``, shape () or (m,), of values of the function.
        """
        # Rounding of the powers' sum, which the function's values have too: it matters above degree 12.
        powers = np.diff(self.breaks)[:, None] ** np.arange(self.coefficients.shape[1])
        size = np.einsum("kp,kpm->km", powers, np.abs(self.coefficients)).max(axis=0)
        rounding = self.coefficients.shape[1] * np.finfo(float).eps * size

        # The upper bounds of f and of -f, in 2 m columns.
        of_f = self.bernstein
        b = np.concatenate([of_f, -of_f], axis=2)
        columns = b.shape[2]
        allowed = np.tile(np.broadcast_to(tolerance, of_f.shape[2]), 2)
        begin = self.breaks[:-1]
        width = np.diff(self.breaks)
        reached = np.full(columns, -np.inf)  # largest values at ends of pieces so far
        reached_at = np.zeros(columns)
        bound = np.full(columns, -np.inf)  # largest hulls of the pieces that are decided
        for _ in range(_MAX_HALVINGS):
            # The first and the last Bernstein coefficient are the values at the ends.
            for values, x in ((b[:, 0], begin), (b[:, -1], begin + width)):
                k = values.argmax(axis=0)
                highest = np.take_along_axis(values, k[None], axis=0)[0]
                reached_at = np.where(highest > reached, x[k], reached_at)
                reached = np.maximum(reached, highest)

            # A piece is open while its hull exceeds the values reached by more than the tolerance.
            hulls = b.max(axis=1)
            is_open = (hulls > reached + allowed).any(axis=1)
            bound = np.maximum(bound, hulls[~is_open].max(axis=0, initial=-np.inf))
            if not is_open.any():
                break

            b = np.concatenate(_halves(b[is_open]))
            begin = begin[is_open]
            width = width[is_open] / 2
            begin = np.concatenate([begin, begin + width])
            width = np.concatenate([width, width])
        else:
            bound = np.maximum(bound, b.max(axis=(0, 1)))

        highest, negated_lowest = np.split(bound + np.tile(rounding, 2), 2)
        at_highest, at_lowest = np.split(reached_at, 2)
        return Bounds(-negated_lowest, at_lowest, highest, at_highest)

    def inside(self, points: int) -> tuple[Array, Array]:
        """Return times (K, points) evenly spread over each piece, both its ends included, and values (K, points, m)."""
        width = np.diff(self.breaks)[:, None]
        u = width * np.linspace(0.0, 1.0, points)
        return self.breaks[:-1, None] + u, self.at(u)

    def at(self, u: Array) -> Array:
        """Return values, shape (K, P, m), at u (K, P) or (K, P, m) after each piece's beginning."""
        u = u if u.ndim == 3 else u[..., None]
        value: Array = self.coefficients[:, None, -1] + 0.0 * u
        for power in range(self.coefficients.shape[1] - 2, -1, -1):
            value = value * u + self.coefficients[:, None, power]
        return value

    def __repr__(self) -> str:
        pieces, powers, columns = self.coefficients.shape
        return repr_line(
            "Pieces", summary=f"{pieces} of degree {powers - 1} in {counted(columns, 'column')}"
        )


def _halves(b: Array) -> tuple[Array, Array]:
    """Return the Bernstein coefficients (K, p+1, m) of both halves of pieces, by de Casteljau's algorithm."""
    # b_i^(r) = (b_i^(r-1) + b_(i+1)^(r-1)) / 2. The left half has the coefficients b_0^(0), b_0^(1) ... b_0^(p), the
    # right half b_0^(p) ... b_(p-1)^(1), b_p^(0): the first and the last of each round.
    left = [b[:, 0]]
    right = [b[:, -1]]
    while b.shape[1] > 1:
        b = (b[:, :-1] + b[:, 1:]) / 2
        left.append(b[:, 0])
        right.append(b[:, -1])
    return np.stack(left, axis=1), np.stack(right[::-1], axis=1)


def join(first: Pieces, second: Pieces) -> tuple[Array, Array]:
    """Return breaks (K+1,), s, and coefficients (K, p+1, m) of one function followed by another."""
    both = (first.coefficients, second.coefficients)
    degrees = max(c.shape[1] for c in both)
    padded = [np.pad(c, ((0, 0), (0, degrees - c.shape[1]), (0, 0))) for c in both]
    return np.concatenate([first.breaks, first.end + second.breaks[1:]]), np.concatenate(padded)


def shift(coefficients: Array, u: Array) -> Array:
    """Return the coefficients (K, p+1, m) of polynomials in x - u instead of x, u of shape (K,)."""
    # With y = x - u: c_j (y + u)^j = sum of c_j binomial(j, i) u^(j-i) y^i
    count = coefficients.shape[1]
    matrix = np.zeros((len(coefficients), count, count))
    for i in range(count):
        for j in range(i, count):
            matrix[:, i, j] = comb(j, i) * u ** (j - i)
    return np.asarray(matrix @ coefficients)
