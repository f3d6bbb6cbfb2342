"""EAIK (Ostermeier et al. 2024): closed-form inverse kinematics in C++, built from joint axes and offsets."""

from __future__ import annotations

from typing import Any

import numpy as np

from dhkit.bench.contenders import (
    Call,
    Contender,
    Mode,
    Task,
    UnavailableError,
    Workload,
    import_peer,
    single_task,
)
from dhkit.bench.geometry import JointAxes, joint_axes
from dhkit.description import Array

BATCH = "EAIK IK_batched"
SINGLE = "EAIK IK"


def contenders() -> tuple[Contender, ...]:
    """Return EAIK's contenders; its forward kinematics has no batch call."""
    return (
        Contender("EAIK fwdKin", "fk", Mode.SINGLE, _forward),
        Contender(SINGLE, "ik", Mode.SINGLE, _single),
        Contender(BATCH, "ik", Mode.BATCH, _batch),
    )


def _forward(workload: Workload) -> Task:
    robot, axes = _robot(workload)
    return single_task(robot.fwdKin, workload.q, axes.with_tool_rotation)


def _single(workload: Workload) -> Task:
    robot, axes = _solver(workload)
    return single_task(robot.IK, axes.without_tool_rotation(workload.T), _solutions)


def _batch(workload: Workload) -> Task:
    robot, axes = _solver(workload)
    # The call would convert an array into a list.
    poses = list(axes.without_tool_rotation(workload.T))

    def prepare(items: int) -> Call:
        chosen = poses[:items]
        return lambda: robot.IK_batched(chosen, num_worker_threads=workload.threads)

    return Task(
        prepare,
        lambda k: [_solutions(result) for result in robot.IK_batched(poses[:k], workload.threads)],
    )


def _robot(workload: Workload) -> tuple[Any, JointAxes]:
    package = import_peer("eaik.IK_HP")
    axes = joint_axes(workload.arm.description)
    if len(axes.points) > 6:
        raise UnavailableError(f"takes up to 6 joints; this arm has {len(axes.points)}")
    return package.HPRobot(axes.directions, axes.offsets), axes


def _solver(workload: Workload) -> tuple[Any, JointAxes]:
    robot, axes = _robot(workload)
    if not robot.hasKnownDecomposition():
        raise UnavailableError("knows no decomposition of this arm")
    return robot, axes


def _solutions(result: Any) -> Array:
    """Return the solutions, shape (m, n), rad, without those that EAIK marks as least-squares approximations."""
    if not result.num_solutions():
        return np.empty((0, 0))
    solutions: Array = np.asarray(result.Q, dtype=float)
    exact: Array = solutions[~np.asarray(result.is_LS, dtype=bool)]
    return exact
