"""frankik (He and Liu 2021): the Panda's and the FR3's solutions at a given joint 7, in C++."""

from __future__ import annotations

from typing import Any

import numpy as np

from dhkit.bench.contenders import (
    Contender,
    Mode,
    Task,
    UnavailableError,
    Workload,
    import_peer,
    one_by_one,
    single_task,
)
from dhkit.description import Array
from dhkit.description.poses import inverse_pose

_SAME_TOOL = 1e-9
"""Largest difference of an entry of the tool's transform between states, m."""


def contenders() -> tuple[Contender, ...]:
    """Return frankik's contenders; each call takes one state or pose."""
    return (
        Contender("frankik fk", "fk", Mode.SINGLE, _forward),
        Contender("frankik ik_full, joint 7 given", "ik", Mode.SINGLE, _single),
    )


def _forward(workload: Workload) -> Task:
    package = import_peer("frankik")
    # Its forward kinematics is that of the hand.
    to_arm = package.FrankaKinematics.FrankaHandTCPOffset @ inverse_pose(_tool(workload, package))
    return single_task(package._core.fk, workload.q, lambda T: T @ inverse_pose(to_arm))


def _single(workload: Workload) -> Task:
    package = import_peer("frankik")
    core = package._core
    poses = workload.T @ _tool(workload, package)
    starts = workload.q
    items = list(zip(poses, starts, starts[:, 6].tolist(), strict=True))

    def answers(count: int) -> list[Array]:
        found = [np.asarray(core.ik_full(*item)) for item in items[:count]]
        return [q[~np.isnan(q).any(axis=1)] for q in found]

    return Task(one_by_one(core.ik_full, items), answers)


def _tool(workload: Workload, package: Any) -> Array:
    """Return the transform from the arm's tool to the frame that frankik's inverse kinematics places, shape (4, 4).

    Its forward kinematics is that of the hand, its inverse kinematics that of the flange.
    """
    if workload.arm.n != 7:
        raise UnavailableError("takes a Panda or an FR3")
    q = workload.q[:8]
    flange = np.linalg.inv(package.FrankaKinematics.FrankaHandTCPOffset)
    theirs = np.array([package._core.fk(x) for x in q]) @ flange
    transforms = np.linalg.inv(workload.arm.fk(q)) @ theirs
    if np.abs(transforms - transforms[0]).max() > _SAME_TOOL:
        raise UnavailableError("takes a Panda or an FR3; this arm moves otherwise")
    tool: Array = transforms[0]
    return tool
