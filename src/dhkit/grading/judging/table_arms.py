"""Tables in doubles: their links, frames and joint axes, for given values of parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Convention, Description, Named
from dhkit.description.parameters import resolved
from dhkit.expressions import Expression, exact, substitute
from dhkit.expressions.syntax import Tree
from dhkit.grading.judging.numeric import doubles

ROUNDING = 1e-12
"""Share of the largest entry: two A_i that differ by less in doubles may well be equal."""
FAR = 1e6
"""m or rad: no arm has such entries, and laying axes over one another would lose its digits."""

Row: TypeAlias = tuple[Expression, Expression, Expression, Expression]
"""theta, d, a, alpha with the joint's variable in its place."""


def parameter_values(description: Description, factors: Array) -> dict[str, float]:
    """Return values of parameters, those that are no others' times factors, and of units."""
    changed = {
        name: value if value.symbols else exact(float(value) * float(factor))
        for (name, value), factor in zip(description.parameters.items(), factors, strict=True)
    }
    known = resolved(Named(changed)) if np.any(factors != 1) else resolved(description.parameters)
    return {name: float(value) for name, value in known.items()}


def row_numbers(row: Sequence[Tree], values: Mapping[str, float]) -> list[float]:
    """Return a row's entries."""
    return [float(doubles(tree, values)) for tree in row]


def number_of(entry: Expression, values: Mapping[str, float]) -> float:
    """Return an exact entry's number."""
    return float(substitute(entry, {name: exact(values[name]) for name in entry.symbols}))


def link_in_doubles(convention: Convention, theta: ArrayLike, d: ArrayLike, a: ArrayLike, alpha: ArrayLike) -> Array:
    """Return A_i in doubles, shape (..., 4, 4), of entries of shape (...)."""
    along_z, along_x = np.zeros((2, *np.shape(theta), 4, 4))
    along_z[..., 0, 0] = along_z[..., 1, 1] = np.cos(theta)
    along_z[..., 1, 0] = np.sin(theta)
    along_z[..., 0, 1] = -along_z[..., 1, 0]
    along_z[..., 2, 2] = along_z[..., 3, 3] = along_x[..., 0, 0] = along_x[..., 3, 3] = 1
    along_z[..., 2, 3] = d
    along_x[..., 1, 1] = along_x[..., 2, 2] = np.cos(alpha)
    along_x[..., 2, 1] = np.sin(alpha)
    along_x[..., 1, 2] = -along_x[..., 2, 1]
    along_x[..., 0, 3] = a
    A: Array = along_z @ along_x if convention is Convention.STANDARD else along_x @ along_z
    return A


@dataclass(frozen=True, eq=False)
class TableArm:
    """A table in doubles: entries at joint values 0, and the sense in which each variable counts."""

    convention: Convention
    kinds: str
    entries: Array
    """Shape (n, 4): theta, d, a, alpha."""
    senses: Array
    """Shape (n,): +1 or -1."""

    @classmethod
    def of_rows(cls, rows: Sequence[Row], kinds: str, convention: Convention, values: Mapping[str, float]) -> TableArm:
        """Return the arm of a table that is known."""
        at_zero = dict(values) | {f"q{i + 1}": 0.0 for i in range(len(kinds))}
        entries = np.array([[number_of(entry, at_zero) for entry in row] for row in rows])
        return cls(convention, kinds, entries, np.ones(len(kinds)))

    @classmethod
    def of_trees(
        cls, rows: Sequence[Sequence[Tree]], kinds: str, convention: Convention, values: Mapping[str, float]
    ) -> TableArm | None:
        """Return an answer's arm; None where its rows are no joints: each its own variable in the right column."""
        n = len(kinds)
        own = np.array([[kind == "R", kind != "R", False, False] for kind in kinds], dtype=float)

        def at(q: Array) -> Array:
            named = dict(values) | {f"q{i + 1}": float(x) for i, x in enumerate(q)}
            return np.array([row_numbers(row, named) for row in rows])

        entries, q = at(np.zeros(n)), np.linspace(0.3, 0.9, n)
        if not np.all(np.abs(entries) < FAR):
            return None
        senses = np.sum((at(np.ones(n)) - entries) * own, axis=1)
        moved = entries + own * (senses * q)[:, None]
        if not np.allclose(np.abs(senses), 1, atol=ROUNDING):
            return None
        return cls(convention, kinds, entries, senses) if np.allclose(at(q), moved, atol=ROUNDING) else None

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.kinds)

    def frames(self, q: Array) -> Array:
        """Return frames 0 ... n in frame 0, shape (n + 1, 4, 4)."""
        change, turning = self.senses * q, np.array([kind == "R" for kind in self.kinds])
        theta, d, a, alpha = self.entries.T
        links = link_in_doubles(self.convention, theta + change * turning, d + change * ~turning, a, alpha)
        frames = [np.eye(4)]
        for A in links:
            frames.append(frames[-1] @ A)
        return np.array(frames)

    def screws(self, q: Array, scale: float) -> Array:
        """Return the joints' axes as screws (direction; moment / scale), shape (n, 6)."""
        frames = self.frames(q)
        moving = frames[:-1] if self.convention is Convention.STANDARD else frames[1:]
        z = moving[:, :3, 2] * self.senses[:, None]
        turning = np.array([[kind == "R"] for kind in self.kinds])
        moments = np.cross(moving[:, :3, 3], z) / scale
        return np.hstack([np.where(turning, z, 0), np.where(turning, moments, z)])
