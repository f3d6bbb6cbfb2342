"""Pinocchio's algorithms in a Python loop, as its users call them; it has no batch call for kinematics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle, islice
from typing import Any

import numpy as np

from dhkit.bench.contenders import Call, Contender, Mode, Task, Workload, import_peer
from dhkit.description import Array

__all__ = ["FORWARD", "JACOBIANS", "contenders"]

FORWARD = "pin.forwardKinematics"
JACOBIANS = "pin.computeJointJacobians"


def contenders() -> tuple[Contender, ...]:
    """Return Pinocchio's contenders: the bare algorithms, and with the tool's placement and Jacobian read."""
    return (
        Contender(FORWARD, "fk", Mode.SINGLE, _forward),
        Contender(JACOBIANS, "jacobian", Mode.SINGLE, _joint_jacobians),
        Contender("pin.computeFrameJacobian", "jacobian", Mode.SINGLE, _frame_jacobian),
    )


def _forward(workload: Workload) -> Task:
    pin, model, tool = _model(workload)
    data = model.createData()

    def answer(q: Array) -> Array:
        pin.framesForwardKinematics(model, data, q)
        return np.array(data.oMf[tool].homogeneous)

    return Task(_loop(pin.forwardKinematics, model, workload.q), _each(answer, workload))


def _joint_jacobians(workload: Workload) -> Task:
    pin, model, tool = _model(workload)
    data = model.createData()

    def answer(q: Array) -> Array:
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        J = pin.getFrameJacobian(model, data, tool, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        return np.reshape(J, (6, model.nv))

    return Task(_loop(pin.computeJointJacobians, model, workload.q), _each(answer, workload))


def _frame_jacobian(workload: Workload) -> Task:
    pin, model, tool = _model(workload)
    data, axes = model.createData(), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    compute = pin.computeFrameJacobian

    def prepare(items: int) -> Call:
        states = list(islice(cycle(workload.q), items))

        def loop() -> None:
            for q in states:
                compute(model, data, q, tool, axes)

        return loop

    return Task(prepare, _each(lambda q: np.reshape(compute(model, data, q, tool, axes), (6, model.nv)), workload))


def _model(workload: Workload) -> tuple[Any, Any, int]:
    pin = import_peer("pinocchio")
    model = workload.arm.model
    return pin, model, model.getFrameId("tool")


def _loop(algorithm: Callable[..., object], model: Any, states: Array) -> Callable[[int], Call]:
    data = model.createData()

    def prepare(items: int) -> Call:
        chosen = list(islice(cycle(states), items))

        def loop() -> None:
            for q in chosen:
                algorithm(model, data, q)

        return loop

    return prepare


def _each(answer: Callable[[Array], Array], workload: Workload) -> Callable[[int], Sequence[Array]]:
    return lambda k: [answer(q).copy() for q in workload.q[:k]]
