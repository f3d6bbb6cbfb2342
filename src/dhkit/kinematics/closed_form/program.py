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
    """Return the program of a family: T (4 x 4) and the free joints' angles to q, distance, valid, flags and status.

    The program's parameters are ``fit.vector()`` followed by ``limit_parameters``.
    """
    symbols = ca.SX.sym("p", len(fit.vector()))
    limits = ca.SX.sym("limits", 2 * len(prismatic))
    return _graph(family, fit, prismatic, fit.named(symbols), limits, {"parameters": ca.vertcat(symbols, limits)})


def arm_program(family: Family, fit: Fit, prismatic: Sequence[bool], limits: Array) -> Graph:
    """Return the program with an arm's parameters and ``limits`` (2n,), rad and m, as constants."""
    return _graph(family, fit, prismatic, fit.named(ca.SX(fit.vector())), ca.SX(limits), {})


def _graph(
    family: Family,
    fit: Fit,
    prismatic: Sequence[bool],
    named: Mapping[str, SX],
    limits: ca.SX,
    parameters: Mapping[str, ca.SX],
) -> Graph:
    T = ca.SX.sym("T", 4, 4)
    free = ca.SX.sym("free", 2)
    is_pose = _is_pose(T)
    scale = named["reach"] + ca.norm_1(T[:3, 3])
    pose = PoseSymbols(
        T=T[:3, :],
        scale=scale,
        structure=fit.structure,
        free_1=(ca.cos(free[0]), ca.sin(free[0])),
        free=(ca.cos(free[1]), ca.sin(free[1])),
        noise=reduce(ca.fmax, map(ca.fabs, _defects(T))),
    )
    branches = family.formulas(named, pose)
    if len(branches) != len(fit.branches):
        raise ValueError(f"{family.name}: {len(branches)} branches, {len(fit.branches)} names")

    valid = [ca.logic_and(is_pose, ca.logic_and(branch.miss == 0, _is_finite(branch))) for branch in branches]
    q = [[if_else(ok, x, np.nan) for x in branch.q] for ok, branch in zip(valid, branches, strict=True)]
    flags = [if_else(ok, _flags(branch, limits, prismatic), 0.0) for ok, branch in zip(valid, branches, strict=True)]
    some = reduce(ca.logic_or, valid)
    special = reduce(ca.logic_or, (ca.logic_and(ok, _singular(b)) for ok, b in zip(valid, branches, strict=True)))
    miss = reduce(ca.fmin, (b.miss if b.distance is None else b.distance for b in branches))
    reached = if_else(special, float(IKStatus.singular), float(IKStatus.ok))
    found = if_else(some, reached, float(IKStatus.out_of_reach))
    return Graph.of(
        "inverse_kinematics",
        {**parameters, "T": T, "free": free},
        {
            "q": ca.vertcat(*(ca.horzcat(*row) for row in q)),
            "distance": if_else(is_pose, if_else(some, 0.0, miss), np.nan),
            "valid": ca.vertcat(*(if_else(ok, 1.0, 0.0) for ok in valid)),
            "flags": ca.vertcat(*flags),
            "status": if_else(is_pose, found, float(IKStatus.not_a_pose)),
        },
    )


def _is_finite(branch: Branch) -> Any:
    """Return whether all joint positions are finite; squares of coordinates above 1e150 overflow."""
    return ca.fabs(sum(branch.q)) < 1e300


def _is_pose(T: ca.SX) -> Any:
    R = T[:3, :3]
    entries = [*_defects(T), T[3, 0], T[3, 1], T[3, 2], T[3, 3] - 1.0]
    rigid = reduce(ca.logic_and, (ca.fabs(entry) <= ORTHONORMAL for entry in entries))
    proper = ca.dot(ca.cross(R[:, 0], R[:, 1]), R[:, 2]) > 0
    finite = ca.norm_1(T[:3, 3]) < 1e300
    return ca.logic_and(ca.logic_and(rigid, proper), finite)


def _defects(T: ca.SX) -> list[Any]:
    """Return the entries of R^T R - 1."""
    defect = T[:3, :3].T @ T[:3, :3] - ca.SX.eye(3)
    return [defect[i, j] for i in range(3) for j in range(i + 1)]


def _singular(branch: Branch) -> Any:
    return reduce(ca.logic_or, (branch.shoulder, branch.elbow, branch.wrist))


def _flags(branch: Branch, limits: ca.SX, prismatic: Sequence[bool]) -> Any:
    inside = reduce(
        ca.logic_and,
        (_inside(x, limits[2 * i], limits[2 * i + 1], prismatic[i]) for i, x in enumerate(branch.q)),
    )
    conditions = {
        IKFlag.shoulder: branch.shoulder,
        IKFlag.elbow: branch.elbow,
        IKFlag.wrist: branch.wrist,
        IKFlag.clamped: branch.clamped,
        IKFlag.out_of_limits: ca.logic_not(inside),
    }
    return sum(if_else(condition, float(flag), 0.0) for flag, condition in conditions.items())


def _inside(x: Any, begin: Any, width: Any, slides: bool) -> Any:
    if slides:
        return ca.logic_and(x >= begin, x - begin <= width)
    turns = x * (1.0 / math.tau) - begin  # multiplied, for a division costs as much as an arc tangent
    return turns - ca.floor(turns) <= width
