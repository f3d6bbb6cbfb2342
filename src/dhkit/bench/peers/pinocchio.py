"""Pinocchio's algorithms in a Python loop, as its users call them, and its batch calls, which only dynamics have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle, islice
from typing import Any

import numpy as np

from dhkit.bench.contenders import Call, Contender, Mode, Task, Workload, import_peer
from dhkit.description import Array
from dhkit.verification import JointStates
from dhkit.verification.reference import PinocchioResults

FORWARD = "pin.forwardKinematics"
JACOBIANS = "pin.computeJointJacobians"
CRBA = "pin.crba"
RNEA_BATCH = "pin.rneaInParallel"
ABA_BATCH = "pin.abaInParallel"
RNEA = "pin.rnea"
ABA = "pin.aba"
FRAME_JACOBIAN = "pin.computeFrameJacobian"
DERIVATIVES = "pin.computeRNEADerivatives"
REGRESSOR = "pin.computeJointTorqueRegressor"


def contenders() -> tuple[Contender, ...]:
    """Return Pinocchio's contenders: the algorithms alone, and those that also read the tool's Jacobian."""
    return (
        Contender(FORWARD, "fk", Mode.SINGLE, _forward),
        Contender(JACOBIANS, "jacobian", Mode.SINGLE, _joint_jacobians),
        Contender(FRAME_JACOBIAN, "jacobian", Mode.SINGLE, _frame_jacobian),
        Contender(RNEA, "inverse_dynamics", Mode.SINGLE, _algorithm("rnea", "inverse_dynamics")),
        Contender(
            RNEA_BATCH,
            "inverse_dynamics",
            Mode.BATCH,
            _in_parallel("rneaInParallel", "inverse_dynamics"),
        ),
        Contender(CRBA, "mass_matrix", Mode.SINGLE, _algorithm("crba", "mass_matrix")),
        Contender(ABA, "forward_dynamics", Mode.SINGLE, _algorithm("aba", "forward_dynamics")),
        Contender(
            ABA_BATCH,
            "forward_dynamics",
            Mode.BATCH,
            _in_parallel("abaInParallel", "forward_dynamics"),
        ),
        Contender(DERIVATIVES, "inverse_dynamics_derivatives", Mode.SINGLE, _derivatives),
        Contender(REGRESSOR, "regressor", Mode.SINGLE, _regressor),
    )


def _forward(workload: Workload) -> Task:
    pin, model, tool = _model(workload)
    data = model.createData()

    def answer(q: Array) -> Array:
        pin.framesForwardKinematics(model, data, q)
        return np.array(data.oMf[tool].homogeneous)

    return Task(_loop(pin.forwardKinematics, model, workload.q), _answers(answer, workload))


def _joint_jacobians(workload: Workload) -> Task:
    pin, model, tool = _model(workload)
    data = model.createData()

    def answer(q: Array) -> Array:
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        J = pin.getFrameJacobian(model, data, tool, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        return np.reshape(J, (6, model.nv))

    return Task(_loop(pin.computeJointJacobians, model, workload.q), _answers(answer, workload))


def _frame_jacobian(workload: Workload) -> Task:
    pin, model, tool = _model(workload)
    data = model.createData()
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    compute = pin.computeFrameJacobian

    def prepare(items: int) -> Call:
        states = list(islice(cycle(workload.q), items))

        def loop() -> None:
            for q in states:
                compute(model, data, q, tool, axes)

        return loop

    return Task(
        prepare,
        _answers(
            lambda q: np.reshape(compute(model, data, q, tool, axes), (6, model.nv)), workload
        ),
    )


def _algorithm(name: str, quantity: str) -> Callable[[Workload], Task]:
    """Return the setup of an algorithm of dynamics that is called state by state."""

    def setup(workload: Workload) -> Task:
        pin, model, _ = _model(workload)
        data = model.createData()
        compute = getattr(pin, name)
        states = list(zip(*workload.inputs(quantity), strict=True))

        def answer(state: tuple[Array, ...]) -> Array:
            result = np.array(compute(model, data, *state))
            if quantity != "mass_matrix":
                return result
            upper = np.triu(np.reshape(result, (model.nv, model.nv)))
            return upper + np.triu(upper, 1).T

        def prepare(items: int) -> Call:
            chosen = list(islice(cycle(states), items))

            def loop() -> None:
                for state in chosen:
                    compute(model, data, *state)

            return loop

        return Task(prepare, lambda k: [answer(state) for state in states[:k]])

    return setup


def _derivatives(workload: Workload) -> Task:
    pin, model, _ = _model(workload)
    data = model.createData()
    states = list(zip(*workload.inputs("inverse_dynamics"), strict=True))

    def answer(state: tuple[Array, ...]) -> Array:
        pin.computeRNEADerivatives(model, data, *state)
        upper = np.triu(np.reshape(data.M, (model.nv, model.nv)))
        M = upper + np.triu(upper, 1).T
        return np.array([np.array(data.dtau_dq), np.array(data.dtau_dv), M])

    return Task(
        _loop_over(pin.computeRNEADerivatives, model, states),
        lambda k: [answer(state) for state in states[:k]],
    )


def _regressor(workload: Workload) -> Task:
    pin, model, _ = _model(workload)
    states = list(zip(*workload.inputs("regressor"), strict=True))

    def answers(count: int) -> list[Array]:
        # In the parameters of dhkit, which are about other origins and in another order.
        motion = JointStates(*(x[:count] for x in workload.inputs("regressor")))
        return list(PinocchioResults(model, motion).regressor())

    return Task(_loop_over(pin.computeJointTorqueRegressor, model, states), answers)


def _loop_over(
    algorithm: Callable[..., object], model: Any, states: Sequence[tuple[Array, ...]]
) -> Callable[[int], Call]:
    data = model.createData()

    def prepare(items: int) -> Call:
        chosen = list(islice(cycle(states), items))

        def loop() -> None:
            for state in chosen:
                algorithm(model, data, *state)

        return loop

    return prepare


def _in_parallel(name: str, quantity: str) -> Callable[[Workload], Task]:
    """Return the setup of a batch call, which takes a column for each state and writes into an array."""

    def setup(workload: Workload) -> Task:
        pin, model, _ = _model(workload)
        pool = pin.ModelPool(model, workload.threads)
        compute = getattr(pin, name)
        inputs = workload.inputs(quantity)

        def prepare(items: int) -> Call:
            columns = [np.asfortranarray(x[:items].T) for x in inputs]
            result = np.empty((model.nv, items), order="F")

            def batch() -> Array:
                compute(workload.threads, pool, *columns, result)
                return result

            return batch

        return Task(prepare, lambda k: list(np.asarray(prepare(k)()).T))

    return setup


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


def _answers(
    answer: Callable[[Array], Array], workload: Workload
) -> Callable[[int], Sequence[Array]]:
    return lambda k: [answer(q).copy() for q in workload.q[:k]]
