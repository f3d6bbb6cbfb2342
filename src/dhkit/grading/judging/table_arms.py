"""Denavit-Hartenberg tables in doubles: link transforms, frames and joint axes for given values of parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Convention, Description, Named
from dhkit.description.parameters import resolved
from dhkit.expressions import Expression, exact, substitute
from dhkit.expressions.syntax import Tree
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.numeric import doubles
from dhkit.symbolic.ring import Element

_T = TypeVar("_T", Array, Element)

SAME_TRANSFORM = 1e-12
"""Relative tolerance, to the largest entry, within which two A_i are taken for equal in doubles."""

Row: TypeAlias = tuple[Expression, Expression, Expression, Expression]
"""theta, d, a, alpha, with the joint variable in theta or d; rad and m."""


def parameter_values(description: Description, factors: Array) -> dict[str, float]:
    """Return the values of parameters by name, SI units and rad, independent ones times factors of shape (k,).

    One that is 0 becomes its factor less 1: a letter of value 0 is a letter.
    """
    changed = {
        name: value if value.symbols else exact(float(factor) - 1.0 if value.is_zero else float(value) * float(factor))
        for (name, value), factor in zip(description.parameters.items(), factors, strict=True)
    }
    known = resolved(Named(changed)) if np.any(factors != 1) else resolved(description.parameters)
    return {name: float(value) for name, value in known.items()}


def row_numbers(row: Sequence[Tree], values: Mapping[str, float]) -> list[float]:
    """Return the entries of a row, rad and m."""
    return [float(doubles(tree, values)) for tree in row]


def number_of(entry: Expression, values: Mapping[str, float]) -> float:
    """Return the value of an exact entry, rad or m."""
    return float(substitute(entry, {name: exact(values[name]) for name in entry.symbols}))


def link_entries(
    convention: Convention, theta: tuple[_T, _T], d: _T, a: _T, alpha: tuple[_T, _T], unit: tuple[_T, _T]
) -> list[list[_T]]:
    """Return the entries of A_i, four rows of four, in doubles, arrays of them or elements of a ring.

    Parameters
    ----------
    convention
        Convention of the table.
    theta, alpha
        Cosine and sine of each angle.
    d, a
        Lengths, m.
    unit
        0 and 1 in the same arithmetic.
    """
    (c, s) = theta
    (ca, sa) = alpha
    (zero, one) = unit
    rows: list[list[_T]]
    if convention is Convention.STANDARD:
        rows = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [zero, sa, ca, d]]
    else:
        rows = [[c, -s, zero, a], [s * ca, c * ca, -sa, -sa * d], [s * sa, c * sa, ca, ca * d]]
    rows.append([zero, zero, zero, one])
    return rows


def link_in_doubles(convention: Convention, theta: ArrayLike, d: ArrayLike, a: ArrayLike, alpha: ArrayLike) -> Array:
    """Return A_i in doubles, shape (..., 4, 4), of angles in rad and lengths in m of shape (...)."""
    theta, d, a, alpha = np.broadcast_arrays(theta, d, a, alpha)
    unit = np.zeros(theta.shape), np.ones(theta.shape)
    angles = [(np.cos(angle), np.sin(angle)) for angle in (theta, alpha)]
    return np.moveaxis(np.array(link_entries(convention, angles[0], d, a, angles[1], unit)), (0, 1), (-2, -1))


@dataclass(frozen=True, eq=False)
class TableArm:
    """A table in doubles.

    Attributes
    ----------
    convention
        Convention of the table.
    kinds
        A letter for each joint: R for a revolute one.
    entries
        theta, d, a, alpha at joint values 0, shape (n, 4), rad and m.
    senses
        +1 or -1 for each joint, shape (n,): the sign of its variable in theta or d.
    """

    convention: Convention
    kinds: str
    entries: Array
    senses: Array

    @classmethod
    def of_rows(cls, rows: Sequence[Row], kinds: str, convention: Convention, values: Mapping[str, float]) -> TableArm:
        """Return the arm of exact rows, at given values of parameters."""
        at_zero = dict(values) | {f"q{i + 1}": 0.0 for i in range(len(kinds))}
        entries = np.array([[number_of(entry, at_zero) for entry in row] for row in rows])
        return cls(convention, kinds, entries, np.ones(len(kinds)))

    @classmethod
    def of_trees(
        cls, rows: Sequence[Sequence[Tree]], kinds: str, convention: Convention, values: Mapping[str, float]
    ) -> TableArm | None:
        """Return the arm of an answer; None unless each row has its own variable, and no other, in the right column."""
        n = len(kinds)
        own = np.array([[kind == "R", kind != "R", False, False] for kind in kinds], dtype=float)

        def at(q: Array) -> Array:
            named = dict(values) | {f"q{i + 1}": float(x) for i, x in enumerate(q)}
            return np.array([row_numbers(row, named) for row in rows])

        entries = at(np.zeros(n))
        q = np.linspace(0.3, 0.9, n)
        if not np.all(np.abs(entries) < BOUNDS.table_entry):
            return None
        senses = np.sum((at(np.ones(n)) - entries) * own, axis=1)
        moved = entries + own * (senses * q)[:, None]
        if not np.allclose(np.abs(senses), 1, atol=SAME_TRANSFORM):
            return None
        return cls(convention, kinds, entries, senses) if np.allclose(at(q), moved, atol=SAME_TRANSFORM) else None

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.kinds)

    @cached_property
    def scale(self) -> float:
        """Sum of the arm's lengths, m; 1 if it has none."""
        return float(np.sum(np.abs(self.entries[:, 1:3]))) or 1.0

    def frames(self, q: Array) -> Array:
        """Return frames 0 ... n in frame 0, shape (n + 1, 4, 4), m, at joint values of shape (n,), rad and m."""
        change = self.senses * q
        turning = np.array([kind == "R" for kind in self.kinds])
        theta, d, a, alpha = self.entries.T
        links = link_in_doubles(self.convention, theta + change * turning, d + change * ~turning, a, alpha)
        frames = [np.eye(4)]
        for A in links:
            frames.append(frames[-1] @ A)
        return np.array(frames)

    def screws(self, q: Array, scale: float) -> Array:
        """Return the joint axes as screws (direction; moment / scale), without unit, shape (n, 6), in frame 0."""
        frames = self.frames(q)
        moving = frames[:-1] if self.convention is Convention.STANDARD else frames[1:]
        z = moving[:, :3, 2] * self.senses[:, None]
        turning = np.array([[kind == "R"] for kind in self.kinds])
        moments = np.cross(moving[:, :3, 3], z) / scale
        return np.hstack([np.where(turning, z, 0), np.where(turning, moments, z)])
