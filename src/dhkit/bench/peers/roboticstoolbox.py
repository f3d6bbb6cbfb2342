"""roboticstoolbox-python: a DHRobot of the same table, and the elementary transforms (ETS) compiled from it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
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
from dhkit.bench.geometry import has_spherical_wrist, joint_axes
from dhkit.bench.peers.dhkit_arm import NEAR_BY
from dhkit.description import Array, Convention, Description

_IK_OPTIONS = {"joint_limits": False, "tol": 1e-20}
"""Half the squared error at which ik_LM stops: its default of 1e-6 leaves the tool a millimetre off."""
_IK_INSIDE_OPTIONS = {"joint_limits": True, "tol": 1e-20}
_SAME_ARM = 1e-12
"""Largest difference of poses, m, of the toolbox's own PUMA and ours if they are the same arm."""

_Setup = Callable[[Workload], Task]


def contenders() -> tuple[Contender, ...]:
    """Return the toolbox's contenders."""
    setups: tuple[tuple[str, str, Mode, _Setup], ...] = (
        ("fkine", "fk", Mode.SINGLE, _single("fk", lambda robot: robot.fkine, lambda T: T.A)),
        (
            "fkine (batch)",
            "fk",
            Mode.BATCH,
            _batch(lambda robot: robot.fkine, lambda poses: [T.A for T in poses]),
        ),
        ("ets.eval", "fk", Mode.SINGLE, _single("fk", lambda robot: robot.ets().eval)),
        ("ets.eval (batch)", "fk", Mode.BATCH, _batch(lambda robot: robot.ets().eval, list)),
        ("jacob0", "jacobian", Mode.SINGLE, _single("jacobian", lambda robot: robot.jacob0)),
        (
            "ets.jacob0",
            "jacobian",
            Mode.SINGLE,
            _single("jacobian", lambda robot: robot.ets().jacob0),
        ),
        ("ikine_a", "ik", Mode.SINGLE, _ikine_a),
        ("analytic_ik", "ik", Mode.SINGLE, _analytic_ik),
        (
            "ik_LM",
            "ik",
            Mode.SINGLE,
            _single("ik", lambda robot: partial(robot.ets().ik_LM, **_IK_OPTIONS), _successful),
        ),
        (
            "ik_LM",
            "ik_numeric",
            Mode.SINGLE,
            _single(
                "ik_numeric",
                lambda robot: partial(robot.ets().ik_LM, **_IK_INSIDE_OPTIONS),
                _successful,
            ),
        ),
        ("ik_LM, from 0.05 rad", "ik_numeric", Mode.SINGLE, _ik_from_near),
        (
            "rne",
            "inverse_dynamics",
            Mode.SINGLE,
            _single("inverse_dynamics", lambda robot: robot.rne, np.ravel),
        ),
        (
            "inertia",
            "mass_matrix",
            Mode.SINGLE,
            _single("mass_matrix", lambda robot: robot.inertia),
        ),
        (
            "accel",
            "forward_dynamics",
            Mode.SINGLE,
            _single("forward_dynamics", lambda robot: robot.nofriction().accel),
        ),
    )
    return tuple(
        Contender(f"roboticstoolbox {name}", quantity, mode, setup)
        for name, quantity, mode, setup in setups
    )


def _single(
    quantity: str,
    function_of: Callable[[Any], Callable[..., Any]],
    answer: Callable[[Any], Array] = lambda x: x,
) -> _Setup:
    """Return the setup of a function of the toolbox's robot that is called state by state."""

    def setup(workload: Workload) -> Task:
        function = function_of(toolbox_robot(workload.arm.description))
        return single_task(function, zip(*workload.inputs(quantity), strict=True), answer)

    return setup


def _ik_from_near(workload: Workload) -> Task:
    """Return the task of ik_LM from joint values that are 0.05 rad or m off each."""
    solve = toolbox_robot(workload.arm.description).ets().ik_LM

    def from_near(T: Array, q0: Array) -> Any:
        return solve(T, q0=q0, **_IK_INSIDE_OPTIONS)

    items = zip(workload.T_inside, workload.q_inside + NEAR_BY, strict=True)
    return single_task(from_near, items, _successful)


def _batch(
    function_of: Callable[[Any], Callable[..., Any]], answers: Callable[[Any], list[Array]]
) -> _Setup:
    """Return the setup of a function of the toolbox's robot that is called once for all states."""

    def setup(workload: Workload) -> Task:
        function = function_of(toolbox_robot(workload.arm.description))

        def prepare(items: int) -> Call:
            chosen = workload.q[:items]
            return lambda: function(chosen)

        return Task(prepare, lambda k: answers(function(workload.q[:k])))

    return setup


def _ikine_a(workload: Workload) -> Task:
    import_peer("roboticstoolbox")
    puma = import_peer("roboticstoolbox.models.DH").Puma560()
    states = workload.q[:3]
    if workload.arm.n != 6 or any(
        np.abs(puma.fkine(q).A - workload.arm.fk(q)).max() > _SAME_ARM for q in states
    ):
        raise UnavailableError(
            "written for the toolbox's own PUMA 560 only; this arm is another one"
        )
    return single_task(puma.ikine_a, workload.T, _successful)


def _analytic_ik(workload: Workload) -> Task:
    if not has_spherical_wrist(joint_axes(workload.arm.description)):
        raise UnavailableError(
            "derives its equations for minutes where there is no spherical wrist"
        )
    import_peer("sympy")
    robot = toolbox_robot(workload.arm.description)
    if workload.arm.n != 6 or workload.arm.description.convention is not Convention.STANDARD:
        raise UnavailableError("takes 6 joints in the standard convention")
    try:
        solver = robot.analytic_ik()
    except (ValueError, NotImplementedError) as error:
        raise UnavailableError(str(error)) from None
    return single_task(solver.solve, workload.T, _successful)


def _successful(solution: Any) -> Array:
    """Return the joint values of an IKSolution, shape (m, n), rad and m; none if it did not succeed."""
    q: Array = np.atleast_2d(np.asarray(solution.q, dtype=float))
    return q if np.all(solution.success) else q[:0]


def toolbox_robot(description: Description) -> Any:
    """Return the toolbox's DHRobot of a description, without friction.

    Raises
    ------
    UnavailableError
        The toolbox is not installed.
    """
    toolbox = import_peer("roboticstoolbox")
    SE3 = import_peer("spatialmath").SE3
    numbers = description.numbers
    ending = "DH" if description.convention is Convention.STANDARD else "MDH"
    revolute = getattr(toolbox, f"Revolute{ending}")
    prismatic = getattr(toolbox, f"Prismatic{ending}")
    links = []
    for i in range(description.n):
        shared: dict[str, Any] = {"a": float(numbers.a[i]), "alpha": float(numbers.alpha[i])}
        if np.isfinite(numbers.mass[i]):
            # The reflected inertia counts alone: it becomes a rotor with a gear of ratio 1.
            shared |= {
                "m": float(numbers.mass[i]),
                "r": numbers.com[i],
                "I": np.array(numbers.inertia[i]),
            }
            shared |= {"Jm": float(numbers.armature[i]), "G": 1.0, "B": 0.0, "Tc": [0.0, 0.0]}
        d = float(numbers.d[i])
        theta = float(numbers.theta[i])
        if numbers.prismatic[i]:
            links.append(prismatic(theta=theta, offset=d, **shared))
        else:
            links.append(revolute(d=d, offset=theta, **shared))
    base, tool = (
        SE3(np.array(T), check=False) for T in (numbers.T_world_base, numbers.T_last_tool)
    )
    return toolbox.DHRobot(
        links, name=description.name, base=base, tool=tool, gravity=np.array(numbers.gravity)
    )
