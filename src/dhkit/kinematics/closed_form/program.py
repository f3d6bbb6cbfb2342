"""A family's formulas as one program: from a pose to all branches with distance, validity, flags and status."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from dhkit.description import Array
from dhkit.description.poses import ORTHONORMAL
from dhkit.kinematics.closed_form.family import Family, Fit, PoseSymbols
from dhkit.kinematics.closed_form.formulas import SX, Branch, if_else
from dhkit.kinematics.solutions import IKFlag, IKStatus
from dhkit.symbolic import Graph


def program(family: Family, fit: Fit, prismatic: Sequence[bool]) -> Graph:
    """Return the program of a family: T (4 x 4) and its free angles, rad, to q, distance, valid, flags and status.

    The program's parameters are ``fit.vector()`` followed by ``limit_parameters``.
    """
    symbols = ca.SX.sym("p", len(fit.vector()))
    limits = ca.SX.sym("limits", 2 * len(prismatic))
    T = ca.SX.sym("T", 4, 4)
    free = {name: ca.SX.sym(name) for name in family.free_angles}
    return Graph.of(
        "inverse_kinematics",
        {"parameters": ca.vertcat(symbols, limits), "T": T, **free},
        _outputs(family, fit, prismatic, fit.named(symbols), limits, T, free),
        dict.fromkeys(free, ()),
        branches=len(fit.branches),
    )


def arm_program(family: Family, fit: Fit, prismatic: Sequence[bool], limits: Array) -> Graph:
    """Return the program with an arm's parameters and ``limits`` (2n,), rad and m, as constants.

    The free angles are one input.
    """
    T = ca.SX.sym("T", 4, 4)
    names = family.free_angles
    free = ca.SX.sym("free", len(names))
    angles = dict(zip(names, ca.vertsplit(free), strict=True))
    named = fit.named(ca.SX(fit.vector()))
    return Graph.of(
        "inverse_kinematics",
        {"T": T, "free": free},
        _outputs(family, fit, prismatic, named, ca.SX(limits), T, angles),
    )


def _outputs(
    family: Family,
    fit: Fit,
    prismatic: Sequence[bool],
    named: Mapping[str, SX],
    limits: ca.SX,
    T: ca.SX,
    free: Mapping[str, SX],
) -> dict[str, ca.SX]:
    """Return q, distance, valid, flags and status of all branches."""
    posed = is_pose(T)
    scale = named["reach"] + ca.norm_1(T[:3, 3])
    pose = PoseSymbols(
        T=T[:3, :],
        scale=scale,
        structure=fit.structure,
        **{name: (ca.cos(angle), ca.sin(angle)) for name, angle in free.items()},
        noise=reduce(ca.fmax, map(ca.fabs, _defects(T))),
    )
    branches = family.formulas(named, pose)
    if len(branches) != len(fit.branches):
        raise ValueError(
            f"{family.name}: {len(branches)} branches with {len(fit.branches)} names; expected as many"
        )

    valid = []
    q = []
    flags: list[Any] = []
    singular = []
    distances = []
    for branch in branches:
        is_valid = ca.logic_and(posed, ca.logic_and(branch.miss == 0, _is_finite(branch)))
        valid.append(is_valid)
        q.append(ca.horzcat(*(if_else(is_valid, x, np.nan) for x in branch.q)))
        flags.append(if_else(is_valid, _flags(branch, limits, prismatic), 0.0))
        singular.append(ca.logic_and(is_valid, _singular(branch)))
        distances.append(branch.miss if branch.distance is None else branch.distance)

    some = reduce(ca.logic_or, valid)
    reached = if_else(reduce(ca.logic_or, singular), float(IKStatus.singular), float(IKStatus.ok))
    status = if_else(some, reached, float(IKStatus.out_of_reach))
    distance = if_else(some, 0.0, reduce(ca.fmin, distances))
    return {
        "q": ca.vertcat(*q),
        "distance": if_else(posed, distance, np.nan),
        "valid": ca.vertcat(*(if_else(is_valid, 1.0, 0.0) for is_valid in valid)),
        "flags": ca.vertcat(*flags),
        "status": if_else(posed, status, float(IKStatus.not_a_pose)),
    }


def _is_finite(branch: Branch) -> Any:
    """Return whether all joint positions are finite; squares of coordinates above 1e150 overflow."""
    return ca.fabs(sum(branch.q)) < 1e300


def is_pose(T: ca.SX) -> Any:
    """Return whether T is a pose: R^T R = 1 with a positive determinant, a last row 0 0 0 1, finite coordinates."""
    R = T[:3, :3]
    entries = [*_defects(T), T[3, 0], T[3, 1], T[3, 2], T[3, 3] - 1.0]
    rigid = reduce(ca.logic_and, (ca.fabs(entry) <= ORTHONORMAL for entry in entries))
    # det R = (r_1 x r_2) . r_3 of the columns r_k.
    proper = ca.dot(ca.cross(R[:, 0], R[:, 1]), R[:, 2]) > 0
    finite = ca.norm_1(T[:3, 3]) < 1e300
    return ca.logic_and(ca.logic_and(rigid, proper), finite)


def _defects(T: ca.SX) -> list[Any]:
    """Return the six different entries of the symmetric matrix R^T R - 1."""
    defect = T[:3, :3].T @ T[:3, :3] - ca.SX.eye(3)
    return [defect[0, 0], defect[1, 0], defect[1, 1], defect[2, 0], defect[2, 1], defect[2, 2]]


def _singular(branch: Branch) -> Any:
    """Return whether a branch is singular anywhere."""
    return reduce(ca.logic_or, (branch.shoulder, branch.elbow, branch.wrist))


def _flags(branch: Branch, limits: ca.SX, prismatic: Sequence[bool]) -> Any:
    """Return the sum of the flags of a branch, as the integer that :class:`IKFlag` makes of them."""
    inside = reduce(
        ca.logic_and,
        (
            _inside(x, limits[2 * i], limits[2 * i + 1], prismatic[i])
            for i, x in enumerate(branch.q)
        ),
    )
    conditions = {
        IKFlag.shoulder: branch.shoulder,
        IKFlag.elbow: branch.elbow,
        IKFlag.wrist: branch.wrist,
        IKFlag.clamped: branch.clamped,
        IKFlag.out_of_limits: ca.logic_not(inside),
    }
    return sum(if_else(condition, float(flag), 0.0) for flag, condition in conditions.items())


def _inside(x: Any, begin: Any, width: Any, is_prismatic: bool) -> Any:
    """Return whether a joint is inside its limits: begin <= x <= begin + width, for angles up to whole turns.

    Angles x are in rad, their limits in turns (``limit_parameters``).
    """
    if is_prismatic:
        return ca.logic_and(x >= begin, x - begin <= width)
    # For some whole k, 0 <= x / (2 pi) - begin + k <= width: the smallest such number that is not negative is the
    # fractional part. Multiplied by 1 / (2 pi), for a division costs as much as an arc tangent.
    turns = x * (1.0 / math.tau) - begin
    return turns - ca.floor(turns) <= width
