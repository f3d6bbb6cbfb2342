"""roboticstoolbox-python: a DHRobot of the same table, and the elementary transforms (ETS) compiled from it."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from dhkit.bench.contenders import Call, Contender, Mode, Task, UnavailableError, Workload, import_peer, one_by_one
from dhkit.bench.geometry import has_spherical_wrist, joint_axes
from dhkit.description import Convention, Description

CONVERGED = 1e-20
"""Where ik_LM stops: its default of 1e-6, half a squared error, leaves the tool a millimetre off."""
SAME_ARM = 1e-12
"""m: poses of the toolbox's own PUMA closer than this to ours make it the same arm."""


def contenders() -> tuple[Contender, ...]:
    """Return the toolbox's contenders."""
    return (
        Contender("roboticstoolbox fkine", "fk", Mode.SINGLE, _fkine),
        Contender("roboticstoolbox fkine (batch)", "fk", Mode.BATCH, _fkine_batch),
        Contender("roboticstoolbox ets.eval", "fk", Mode.SINGLE, _eval),
        Contender("roboticstoolbox ets.eval (batch)", "fk", Mode.BATCH, _eval_batch),
        Contender("roboticstoolbox jacob0", "jacobian", Mode.SINGLE, _jacob0),
        Contender("roboticstoolbox ets.jacob0", "jacobian", Mode.SINGLE, _ets_jacob0),
        Contender("roboticstoolbox ikine_a", "ik", Mode.SINGLE, _ikine_a),
        Contender("roboticstoolbox analytic_ik", "ik", Mode.SINGLE, _analytic_ik),
        Contender("roboticstoolbox ik_LM", "ik", Mode.SINGLE, _ik_LM),
        Contender("roboticstoolbox rne", "inverse_dynamics", Mode.SINGLE, _rne),
        Contender("roboticstoolbox inertia", "mass_matrix", Mode.SINGLE, _inertia),
        Contender("roboticstoolbox accel", "forward_dynamics", Mode.SINGLE, _accel),
    )


def _fkine(workload: Workload) -> Task:
    robot = toolbox_robot(workload.arm.description)
    return Task(one_by_one(robot.fkine, list(workload.q)), lambda k: [robot.fkine(q).A for q in workload.q[:k]])


def _fkine_batch(workload: Workload) -> Task:
    robot = toolbox_robot(workload.arm.description)
    return Task(_on_slices(robot.fkine, workload), lambda k: [T.A for T in robot.fkine(workload.q[:k])])


def _eval(workload: Workload) -> Task:
    ets = toolbox_robot(workload.arm.description).ets()
    return Task(one_by_one(ets.eval, list(workload.q)), lambda k: [ets.eval(q) for q in workload.q[:k]])


def _eval_batch(workload: Workload) -> Task:
    ets = toolbox_robot(workload.arm.description).ets()
    return Task(_on_slices(ets.eval, workload), lambda k: list(ets.eval(workload.q[:k])))


def _jacob0(workload: Workload) -> Task:
    robot = toolbox_robot(workload.arm.description)
    return Task(one_by_one(robot.jacob0, list(workload.q)), lambda k: [robot.jacob0(q) for q in workload.q[:k]])


def _ets_jacob0(workload: Workload) -> Task:
    ets = toolbox_robot(workload.arm.description).ets()
    return Task(one_by_one(ets.jacob0, list(workload.q)), lambda k: [ets.jacob0(q) for q in workload.q[:k]])


def _ikine_a(workload: Workload) -> Task:
    import_peer("roboticstoolbox")
    puma = import_peer("roboticstoolbox.models.DH").Puma560()
    states = workload.q[:3]
    if workload.arm.n != 6 or any(np.abs(puma.fkine(q).A - workload.arm.fk(q)).max() > SAME_ARM for q in states):
        raise UnavailableError("written for the toolbox's own PUMA 560 only; this arm is another one")
    return Task(
        one_by_one(puma.ikine_a, list(workload.T)),
        lambda k: [_found(puma.ikine_a(T)) for T in workload.T[:k]],
    )


def _analytic_ik(workload: Workload) -> Task:
    if not has_spherical_wrist(joint_axes(workload.arm.description)):
        raise UnavailableError("derives its equations for minutes where there is no spherical wrist")
    import_peer("sympy")
    robot = toolbox_robot(workload.arm.description)
    if workload.arm.n != 6 or workload.arm.description.convention is not Convention.STANDARD:
        raise UnavailableError("takes 6 joints in the standard convention")
    try:
        solver = robot.analytic_ik()
    except (ValueError, NotImplementedError) as error:
        raise UnavailableError(str(error)) from None
    return Task(one_by_one(solver.solve, list(workload.T)), lambda k: [_found(solver.solve(T)) for T in workload.T[:k]])


def _ik_LM(workload: Workload) -> Task:
    ets = toolbox_robot(workload.arm.description).ets()
    solve = partial(ets.ik_LM, joint_limits=False, tol=CONVERGED)
    return Task(one_by_one(solve, list(workload.T)), lambda k: [_found(solve(T)) for T in workload.T[:k]])


def _rne(workload: Workload) -> Task:
    robot = toolbox_robot(workload.arm.description)
    states = list(zip(workload.q, workload.qd, workload.qdd, strict=True))
    return Task(one_by_one(robot.rne, states), lambda k: [np.ravel(robot.rne(*state)) for state in states[:k]])


def _inertia(workload: Workload) -> Task:
    robot = toolbox_robot(workload.arm.description)
    return Task(one_by_one(robot.inertia, list(workload.q)), lambda k: [robot.inertia(q) for q in workload.q[:k]])


def _accel(workload: Workload) -> Task:
    robot = toolbox_robot(workload.arm.description).nofriction()
    states = list(zip(workload.q, workload.qd, workload.tau, strict=True))
    return Task(one_by_one(robot.accel, states), lambda k: [robot.accel(*state) for state in states[:k]])


def _found(solution: Any) -> Any:
    """Return the joint values of an IKSolution that succeeded, shape (m, n)."""
    q = np.atleast_2d(np.asarray(solution.q, dtype=float))
    return q if np.all(solution.success) else q[:0]


def _on_slices(function: Any, workload: Workload) -> Any:
    def prepare(items: int) -> Call:
        chosen = workload.q[:items]
        return lambda: function(chosen)

    return prepare


def toolbox_robot(description: Description) -> Any:
    """Return the toolbox's DHRobot of a description, without friction.

    Raises
    ------
    UnavailableError
        The toolbox is not installed.
    """
    toolbox, SE3 = import_peer("roboticstoolbox"), import_peer("spatialmath").SE3
    numbers = description.numbers
    ending = "DH" if description.convention is Convention.STANDARD else "MDH"
    revolute, prismatic = getattr(toolbox, f"Revolute{ending}"), getattr(toolbox, f"Prismatic{ending}")
    links = []
    for i in range(description.n):
        shared: dict[str, Any] = {"a": float(numbers.a[i]), "alpha": float(numbers.alpha[i])}
        if np.isfinite(numbers.mass[i]):
            # The reflected inertia is what counts: as a rotor behind a gear of 1.
            shared |= {"m": float(numbers.mass[i]), "r": numbers.com[i], "I": np.array(numbers.inertia[i])}
            shared |= {"Jm": float(numbers.armature[i]), "G": 1.0, "B": 0.0, "Tc": [0.0, 0.0]}
        d, theta = float(numbers.d[i]), float(numbers.theta[i])
        if numbers.prismatic[i]:
            links.append(prismatic(theta=theta, offset=d, **shared))
        else:
            links.append(revolute(d=d, offset=theta, **shared))
    base, tool = (SE3(np.array(T), check=False) for T in (numbers.T_world_base, numbers.T_last_tool))
    return toolbox.DHRobot(links, name=description.name, base=base, tool=tool, gravity=np.array(numbers.gravity))
