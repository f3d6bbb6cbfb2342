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
"""Largest difference of two equal A_i in doubles, relative to the largest entry: a few roundings of sines."""

Row: TypeAlias = tuple[Expression, Expression, Expression, Expression]
"""theta, d, a, alpha, with the joint variable in theta or d; rad and m."""


def parameter_values(description: Description, factors: Array) -> dict[str, float]:
    """Return the values of parameters by name, SI units and rad, independent ones times factors of shape (k,).

    A parameter of value 0 becomes its factor less 1, so that it differs from 0 where it is varied.
    """
    if not np.any(factors != 1):
        return {name: float(value) for name, value in resolved(description.parameters).items()}

    changed: dict[str, Expression] = {}
    for (name, value), factor in zip(description.parameters.items(), factors, strict=True):
        if value.symbols:
            changed[name] = value
        elif value.is_zero:
            changed[name] = exact(float(factor) - 1.0)
        else:
            changed[name] = exact(float(value) * float(factor))
    return {name: float(value) for name, value in resolved(Named(changed)).items()}


def row_numbers(row: Sequence[Tree], values: Mapping[str, float]) -> list[float]:
    """Return the entries of a row, rad and m."""
    return [float(doubles(tree, values)) for tree in row]


def number_of(entry: Expression, values: Mapping[str, float]) -> float:
    """Return the value of an exact entry, rad or m."""
    return float(substitute(entry, {name: exact(values[name]) for name in entry.symbols}))


def link_entries(
    convention: Convention,
    theta: tuple[_T, _T],
    d: _T,
    a: _T,
    alpha: tuple[_T, _T],
    unit: tuple[_T, _T],
) -> list[list[_T]]:
    """Return the entries of A_i, four rows of four, in doubles, arrays of them or elements of a ring.

    A_i = Rz(theta) Tz(d) Tx(a) Rx(alpha) in the standard convention, Rx(alpha) Tx(a) Rz(theta) Tz(d) in the modified
    one (Craig, Introduction to Robotics, ch. 3), where a and alpha are those of the link before.

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
    c, s = theta
    ca, sa = alpha
    zero, one = unit
    if convention is Convention.STANDARD:
        return [
            [c, -s * ca, s * sa, a * c],
            [s, c * ca, -c * sa, a * s],
            [zero, sa, ca, d],
            [zero, zero, zero, one],
        ]
    return [
        [c, -s, zero, a],
        [s * ca, c * ca, -sa, -sa * d],
        [s * sa, c * sa, ca, ca * d],
        [zero, zero, zero, one],
    ]


def link_in_doubles(
    convention: Convention, theta: ArrayLike, d: ArrayLike, a: ArrayLike, alpha: ArrayLike
) -> Array:
    """Return A_i in doubles, shape (..., 4, 4), of angles in rad and lengths in m of shape (...)."""
    theta, d, a, alpha = np.broadcast_arrays(theta, d, a, alpha)
    unit = (np.zeros(theta.shape), np.ones(theta.shape))
    theta_direction = (np.cos(theta), np.sin(theta))
    alpha_direction = (np.cos(alpha), np.sin(alpha))
    entries = np.array(link_entries(convention, theta_direction, d, a, alpha_direction, unit))
    return np.moveaxis(entries, (0, 1), (-2, -1))


@dataclass(frozen=True, eq=False)
class TableArm:
    """A table in doubles.

    Attributes
    ----------
    convention
        Convention of the table.
    kinds
        Letter of each joint: R for a revolute one, P for a prismatic one.
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
    def of_rows(
        cls, rows: Sequence[Row], kinds: str, convention: Convention, values: Mapping[str, float]
    ) -> TableArm:
        """Return the arm of exact rows, at given values of parameters."""
        at_zero = dict(values) | {f"q{i + 1}": 0.0 for i in range(len(kinds))}
        entries = np.empty((len(rows), 4))
        for i, row in enumerate(rows):
            entries[i] = [number_of(entry, at_zero) for entry in row]
        return cls(convention, kinds, entries, np.ones(len(kinds)))

    @classmethod
    def of_trees(
        cls,
        rows: Sequence[Sequence[Tree]],
        kinds: str,
        convention: Convention,
        values: Mapping[str, float],
    ) -> TableArm | None:
        """Return the arm of an answer; None unless each row has its own variable, and no other, in the right column."""
        n = len(kinds)
        own = np.array([[kind == "R", kind != "R", False, False] for kind in kinds], dtype=float)

        def entries_at(q: Array) -> Array:
            """Return the entries of the table at joint values, shape (n, 4), rad and m."""
            named = dict(values) | {f"q{i + 1}": float(x) for i, x in enumerate(q)}
            return np.array([row_numbers(row, named) for row in rows])

        entries = entries_at(np.zeros(n))
        if not np.all(np.abs(entries) < BOUNDS.table_entry):
            return None

        # The slope of an entry in its own variable is the variable's sign.
        senses = np.sum((entries_at(np.ones(n)) - entries) * own, axis=1)
        if not np.allclose(np.abs(senses), 1, atol=SAME_TRANSFORM):
            return None

        # With these signs alone the entries follow at other joint values.
        q = np.linspace(0.3, 0.9, n)
        expected = entries + own * (senses * q)[:, None]
        if not np.allclose(entries_at(q), expected, atol=SAME_TRANSFORM):
            return None
        return cls(convention, kinds, entries, senses)

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
        travel = self.senses * q
        is_revolute = np.array([kind == "R" for kind in self.kinds])
        theta, d, a, alpha = self.entries.T
        links = link_in_doubles(
            self.convention, theta + travel * is_revolute, d + travel * ~is_revolute, a, alpha
        )

        # T_0i = T_0(i-1) A_i
        frames = [np.eye(4)]
        for A in links:
            frames.append(frames[-1] @ A)
        return np.array(frames)

    def screws(self, q: Array, scale: float) -> Array:
        """Return the joint axes in frame 0 as screws (direction; moment / scale), without unit, shape (n, 6).

        Joint i moves along z of frame i - 1 in the standard convention, and of frame i in the modified one. With this z
        and the frame's origin p, the screw is (z; p x z / scale) of a revolute and (0; z) of a prismatic joint.
        """
        frames = self.frames(q)
        carrying = frames[:-1] if self.convention is Convention.STANDARD else frames[1:]
        z = carrying[:, :3, 2] * self.senses[:, None]
        p = carrying[:, :3, 3]
        moments = np.cross(p, z) / scale
        is_revolute = np.array([[kind == "R"] for kind in self.kinds])
        return np.hstack([np.where(is_revolute, z, 0), np.where(is_revolute, moments, z)])
