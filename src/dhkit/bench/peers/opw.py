"""py-opw-kinematics (rs-opw-kinematics in Rust): ortho-parallel arms with a spherical wrist."""

from __future__ import annotations

from typing import Any

import numpy as np

from dhkit.bench.contenders import Call, Contender, Mode, Task, Workload, import_peer, single_task
from dhkit.bench.geometry import OrthoParallel
from dhkit.description import Array

_UNMET_LIMITS = [(10.0, 11.0)] * 6
"""Joint limits, rad, that no branch is inside: `reach` returns every branch all the same, and computes no singular
values of branches outside the limits."""


def contenders() -> tuple[Contender, ...]:
    """Return py-opw-kinematics' contenders."""
    return (
        Contender("py-opw-kinematics forward", "fk", Mode.SINGLE, _forward),
        Contender("py-opw-kinematics batch_forward", "fk", Mode.BATCH, _batch_forward),
        Contender("py-opw-kinematics inverse", "ik", Mode.SINGLE, _inverse),
        Contender("py-opw-kinematics reach", "ik", Mode.BATCH, _reach),
    )


def _forward(workload: Workload) -> Task:
    robot, family, _ = _robot(workload)
    states = [tuple(angles) for angles in family.angles(workload.q).tolist()]
    inputs = [(state,) for state in states]  # one argument, a tuple of six
    return single_task(robot.forward, inputs, lambda pose: family.tool_poses(pose.as_matrix()))


def _batch_forward(workload: Workload) -> Task:
    robot, family, _ = _robot(workload)
    angles = family.angles(workload.q)

    def prepare(items: int) -> Call:
        chosen = np.ascontiguousarray(angles[:items])
        return lambda: robot.batch_forward(chosen)

    return Task(
        prepare, lambda k: list(family.tool_poses(robot.batch_forward(angles[:k]).as_matrix()))
    )


def _inverse(workload: Workload) -> Task:
    robot, family, transform = _robot(workload)
    poses = [transform(T) for T in family.poses(workload.T[:10_000])]
    return single_task(
        robot.inverse, poses, lambda solutions: family.ours(np.reshape(solutions, (-1, 6)))
    )


def _reach(workload: Workload) -> Task:
    robot, family, transform = _robot(workload)
    poses = family.poses(workload.T)

    def prepare(items: int) -> Call:
        chosen = transform(poses[:items])
        return lambda: robot.reach(chosen, joint_limits=_UNMET_LIMITS, threads=workload.threads)

    def answers(k: int) -> list[Array]:
        branches = family.ours(robot.reach(transform(poses[:k]), joint_limits=_UNMET_LIMITS).joints)
        return [solutions[~np.isnan(solutions).any(axis=1)] for solutions in branches]

    return Task(prepare, answers)


def _robot(workload: Workload) -> tuple[Any, OrthoParallel, Any]:
    """Return the package's robot, the arm's parameters, and the function that converts poses."""
    package = import_peer("py_opw_kinematics")
    family = OrthoParallel.of(workload.arm.description)
    model = package.KinematicModel(
        a1=family.a1, a2=family.a2, b=family.b, c2=family.c2, c3=family.c3
    )
    return package.Robot(model, degrees=False), family, package.RigidTransform.from_matrix
