"""What a family of closed forms is, and the pose that its formulas start from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.formulas import SX, Branch, Pair
from dhkit.kinematics.solutions import LIMIT_SLACK

if TYPE_CHECKING:
    import casadi as ca

ALL = ("x", "y", "z", "rx", "ry", "rz")
"""The coordinates of a pose: position, and rotation about the axes."""
OUTPUT_TYPES = ("float64", "float64", "uint8", "uint8", "uint8")
"""Of joint values, distance, valid, flags and status."""
TURN = 2 * np.pi
Vector: TypeAlias = tuple[SX, SX, SX]
Parameter: TypeAlias = "Array | float | np.floating[Any] | tuple[float, ...]"


def limit_parameters(lower: Array, upper: Array, prismatic: Sequence[bool]) -> Array:
    """Return two numbers a joint: where its limits begin and how wide they are, m, or rad over a turn.

    A joint without limits begins anywhere and is as wide as can be.
    """
    begin = np.where(np.isfinite(lower), lower - LIMIT_SLACK, -1e300)
    width = np.where(np.isfinite(upper), upper + LIMIT_SLACK - begin, 2e300)
    unlimited = ~(np.isfinite(lower) & np.isfinite(upper))
    turning = ~np.asarray(prismatic)
    begin = np.where(turning & unlimited, 0.0, begin)
    width = np.where(turning & unlimited, TURN, width)
    return np.where(turning, np.stack([begin, width]) / TURN, np.stack([begin, width])).T.ravel()


@dataclass(frozen=True, eq=False)
class Fit:
    """An arm seen as a member of a family."""

    words: str
    """What the axes are like."""
    parameters: Mapping[str, Parameter]
    """The numbers that the family's formulas work with, by name."""
    branches: tuple[str, ...]
    met: tuple[str, ...]
    """Coordinates of a pose that are met."""
    structure: str = ""
    """What the formulas look like beyond their parameters, such as the order of the joints."""
    free: int | None = None
    """The joint, from 0, that may take any angle where two axes of the wrist coincide."""

    def vector(self) -> Array:
        """Return all parameters in one row."""
        return np.concatenate([np.ravel(value) for value in self.parameters.values()]).astype(float)

    def named(self, row: ca.SX) -> dict[str, SX]:
        """Return a column of all parameters, or symbols for them, by name: pairs as tuples, matrices as matrices."""
        import casadi as ca

        named: dict[str, SX] = {}
        start = 0
        for name, value in self.parameters.items():
            part = row[start : start + np.size(value)]
            shape = np.shape(value)
            if len(shape) == 2:
                named[name] = ca.reshape(part, shape[1], shape[0]).T
            else:
                named[name] = tuple(ca.vertsplit(part)) if shape else part
            start += np.size(value)
        return named


@dataclass(frozen=True)
class Family:
    """Arms whose inverse kinematics share one closed form."""

    name: str
    """An identifier."""
    fit: Callable[[Axes], Fit | None]
    """Recognises an arm by its axes, at zero joint values."""
    formulas: Callable[[Mapping[str, SX], PoseSymbols], list[Branch]]
    """Return the branches, in the order of ``Fit.branches``."""


@dataclass(frozen=True)
class Seen:
    """A pose in another frame: its three axes and its origin."""

    rotation: tuple[Vector, Vector, Vector]
    position: Vector


@dataclass(frozen=True)
class PoseSymbols:
    """The pose asked for, of the tool in the world."""

    T: ca.SX
    """3 x 4."""
    scale: SX
    """What rounding of positions is measured by, m."""
    structure: str = ""
    """That of the fit."""
    free: Pair = (1.0, 0.0)
    """The angle that the free joint takes at a wrist singularity."""
    free_1: Pair = (1.0, 0.0)
    """The angle that joint 1 takes where the point that it turns is on its axis."""
    noise: SX = 0.0
    """By how much the rotation misses being orthonormal: how exactly the pose is known."""

    def seen(self, left: SX, right: SX) -> Seen:
        """Return left T right, all 3 x 4 with a last row 0 0 0 1."""
        T = _product(_product(left, self.T), right)
        columns = [tuple(T[i, k] for i in range(3)) for k in range(4)]
        return Seen((columns[0], columns[1], columns[2]), columns[3])


def _product(A: SX, B: SX) -> SX:
    import casadi as ca

    return ca.horzcat(A[:, :3] @ B[:, :3], A[:, :3] @ B[:, 3] + A[:, 3])
