"""A family of closed forms: how arms are recognized, their parameters, and the pose that the formulas start from."""

from __future__ import annotations

import math
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

ALL_COORDINATES = ("x", "y", "z", "rx", "ry", "rz")
"""The coordinates of a pose: position, and rotation about the axes."""
OUTPUT_TYPES = ("float64", "float64", "uint8", "uint8", "uint8")
"""Types of joint positions, distance, valid, flags and status."""
LAST_JOINT = "joint 7"
ARM_ANGLE = "arm angle"
"""Redundancies of seven joints."""
Vector: TypeAlias = tuple[SX, SX, SX]
Parameter: TypeAlias = "Array | float | np.floating[Any] | tuple[float, ...]"


def limit_parameters(lower: Array, upper: Array, prismatic: Sequence[bool]) -> Array:
    """Return lower limit and range of each joint, shape (2 n,): m, or turns (rad / 2 pi).

    A joint without limits has the range of a whole turn, or 2e300 m.
    """
    begin = np.where(np.isfinite(lower), lower - LIMIT_SLACK, -1e300)
    width = np.where(np.isfinite(upper), upper + LIMIT_SLACK - begin, 2e300)

    # A revolute joint without a limit on either side may have any angle.
    revolute = ~np.asarray(prismatic)
    unlimited = ~(np.isfinite(lower) & np.isfinite(upper))
    begin = np.where(revolute & unlimited, 0.0, begin)
    width = np.where(revolute & unlimited, math.tau, width)

    ranges = np.stack([begin, width])
    return np.where(revolute, ranges / math.tau, ranges).T.ravel()


@dataclass(frozen=True, eq=False)
class Fit:
    """An arm as a member of a family."""

    geometry: str
    """Arrangement of the axes, as text."""
    parameters: Mapping[str, Parameter]
    """The numbers that the family's formulas work with, by name; ``reach``, m, is required of every family."""
    branches: tuple[str, ...]
    coordinates: tuple[str, ...] = ALL_COORDINATES
    """Coordinates of a pose that the arm can reach: those of ``ALL_COORDINATES``, and yaw for its turn in the plane."""
    structure: str = ""
    """Variant of the formulas that their parameters do not tell, such as the order of the joints."""
    free_joint: int | None = None
    """Index, from 0, of the joint that is free where two axes of the wrist coincide; None if there is none."""
    wrist_distances: tuple[float, float] | None = None
    """Least and largest distance of a spherical wrist's centre from axis 2 in the arm's plane, m; None without one."""

    def vector(self) -> Array:
        """Return all parameters, shape (parameters,), rad and m."""
        return np.concatenate([np.ravel(value) for value in self.parameters.values()]).astype(float)

    def named(self, row: ca.SX) -> dict[str, SX]:
        """Return the entries of a column of parameters by name: pairs as tuples, matrices as matrices."""
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
    """Returns an arm's fit from its axes at zero joint positions; None if it is not a member."""
    formulas: Callable[[Mapping[str, SX], PoseSymbols], list[Branch]]
    """Returns the branches in the order of ``Fit.branches``, from named parameters and the pose."""
    redundancy: str = ""
    """What is given besides the pose, for seven joints: ``LAST_JOINT`` or ``ARM_ANGLE``; it is ``PoseSymbols.free``."""

    @property
    def free_angles(self) -> tuple[str, ...]:
        """Names of the angles in :class:`PoseSymbols` that are given besides the pose."""
        return ("free_1", "free", "free_5") if self.redundancy else ("free_1", "free")


@dataclass(frozen=True)
class FramedPose:
    """A pose in another frame: its three axes and its origin, m."""

    rotation: tuple[Vector, Vector, Vector]
    position: Vector


@dataclass(frozen=True)
class PoseSymbols:
    """Symbols of the required pose of the tool in the world."""

    T: ca.SX
    """The pose without its last row, 3 x 4."""
    scale: SX
    """Length scale of rounding errors of positions, m: the reach plus the sum of the absolute coordinates."""
    structure: str = ""
    """Structure of the fit."""
    free: Pair = (1.0, 0.0)
    """Angle of the free joint at a wrist singularity, or the redundancy of seven joints, as a pair."""
    free_1: Pair = (1.0, 0.0)
    """Angle of joint 1 where the point that it turns is on its axis, as a pair."""
    free_5: Pair = (1.0, 0.0)
    """Angle of joint 5 of seven where axes 5 and 7 coincide, as a pair."""
    noise: SX = 0.0
    """Largest entry of R^T R - 1, which tells how exactly the pose is known."""

    def seen(self, left: SX, right: SX) -> FramedPose:
        """Return left T right; all are 3 x 4 with an implied last row 0 0 0 1."""
        T = _product(_product(left, self.T), right)
        x, y, z, position = ((T[0, k], T[1, k], T[2, k]) for k in range(4))
        return FramedPose((x, y, z), position)


def _product(A: SX, B: SX) -> SX:
    """Return the product of two poses (R, p) without last rows: (R_A R_B, R_A p_B + p_A)."""
    import casadi as ca

    R_A = A[:, :3]
    p_A = A[:, 3]
    R_B = B[:, :3]
    p_B = B[:, 3]
    return ca.horzcat(R_A @ R_B, R_A @ p_B + p_A)
