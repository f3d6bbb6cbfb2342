"""dhkit itself: one call for a batch, for a few states, and for one, with and without an array to write into."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import cycle, islice
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.agreement import stacked
from dhkit.bench.contenders import (
    INVERSE_KINEMATICS,
    QUANTITIES,
    Call,
    Contender,
    Mode,
    Task,
    UnavailableError,
    Workload,
    one_by_one,
)
from dhkit.description import Array
from dhkit.errors import DhkitError

BATCH = "dhkit, out="
_NEW_ARRAYS = "dhkit"
SINGLE = "dhkit, one call"
SINGLE_INTO_OUT = "dhkit, one call, out="
NEAR = "dhkit, one call, from 0.05 rad"
GIVEN = "dhkit, out=, redundancy given"
GIVEN_ONE = "dhkit, one call, redundancy given"
NEAR_BY = 0.05
"""How far a start of numeric inverse kinematics is from a solution, each joint, rad and m."""
FEW = (2, 8, 64)
"""Sizes of small batches."""
_BLOCK = 1_000
"""Number of states of a block, whose results are written over those of the block before."""


def contenders() -> tuple[Contender, ...]:
    """Return dhkit's contenders for each quantity."""
    setups: tuple[tuple[str, Mode, Callable[[str], Callable[[Workload], Task]]], ...] = (
        (BATCH, Mode.BATCH, _into_out),
        (_NEW_ARRAYS, Mode.BATCH, _into_new_arrays),
        (f"dhkit, blocks of {_BLOCK:,}, out=", Mode.BATCH, _in_blocks),
        (SINGLE, Mode.SINGLE, _single),
        (SINGLE_INTO_OUT, Mode.SINGLE, _single_into_out),
        *((f"dhkit, {size} a call", Mode.FEW, partial(_few, size)) for size in FEW),
    )
    found = []
    for quantity in QUANTITIES:
        for name, mode, setup in setups:
            found.append(Contender(name, quantity, mode, setup(quantity), own=True))
    found.append(Contender(NEAR, "ik_numeric", Mode.SINGLE, _from_near, own=True))
    found.append(Contender(GIVEN, "ik", Mode.BATCH, _given_redundancy, own=True))
    found.append(Contender(GIVEN_ONE, "ik", Mode.SINGLE, _given_redundancy_one_by_one, own=True))
    return tuple(found)


def method(arm: Arm, quantity: str) -> Callable[..., Any]:
    """Return the arm's method of a quantity.

    Raises
    ------
    UnavailableError
        This dhkit has no such method, or the method refuses the arm.
    """
    function: Callable[..., Any] | None = getattr(arm, quantity, None)
    if function is None:
        raise UnavailableError(f"this dhkit has no arm.{quantity}")
    workload = Workload.of(arm, batch=1, threads=1, seed=0)
    try:
        function(*workload.inputs(quantity))
    except (DhkitError, NotImplementedError) as error:
        raise UnavailableError(f"arm.{quantity}: {error}") from None
    return function


def new_output(function: Callable[..., Any], inputs: Sequence[Array]) -> Array:
    """Return an array to write a batch's results into, whose pages are already mapped."""
    result = function(*(x[:1] for x in inputs))
    one = stacked(result) if isinstance(result, np.ndarray | tuple) else result.q
    return np.full((len(inputs[0]), *one.shape[1:]), np.nan)


def _into_out(quantity: str) -> Callable[[Workload], Task]:
    def setup(workload: Workload) -> Task:
        function = method(workload.arm, quantity)
        inputs = workload.inputs(quantity)
        _refuse_open_form(workload, quantity)

        def prepare(items: int) -> Callable[[], Any]:
            chosen = [x[:items] for x in inputs]
            out = new_output(function, chosen)
            return lambda: function(*chosen, out=out, threads=workload.threads)

        return Task(prepare, lambda k: _answers(quantity, prepare(k)()))

    return setup


def _in_blocks(quantity: str) -> Callable[[Workload], Task]:
    def setup(workload: Workload) -> Task:
        function = method(workload.arm, quantity)
        inputs = workload.inputs(quantity)
        _refuse_open_form(workload, quantity)
        out = new_output(function, [x[:_BLOCK] for x in inputs])

        def prepare(items: int) -> Call:
            starts = range(0, items, _BLOCK)
            blocks = [[x[:items][start : start + _BLOCK] for x in inputs] for start in starts]

            def loop() -> None:
                for block in blocks:
                    function(*block, out=out[: len(block[0])], threads=workload.threads)

            return loop

        def first_answers(wanted: int) -> list[Array]:
            chosen = [x[: min(wanted, _BLOCK)] for x in inputs]
            return list(_answers(quantity, function(*chosen, out=out[: len(chosen[0])])))

        return Task(prepare, first_answers)

    return setup


def _into_new_arrays(quantity: str) -> Callable[[Workload], Task]:
    def setup(workload: Workload) -> Task:
        function = method(workload.arm, quantity)
        inputs = workload.inputs(quantity)

        def prepare(items: int) -> Callable[[], Any]:
            chosen = [x[:items] for x in inputs]
            return lambda: function(*chosen, threads=workload.threads)

        return Task(prepare, lambda k: _answers(quantity, prepare(k)()))

    return setup


def _single(quantity: str) -> Callable[[Workload], Task]:
    def setup(workload: Workload) -> Task:
        function = method(workload.arm, quantity)
        inputs = workload.inputs(quantity)
        items = list(zip(*inputs, strict=True))

        def first_answers(count: int) -> list[Array]:
            return [_answer(quantity, function(*item)) for item in items[:count]]

        return Task(one_by_one(function, items), first_answers)

    return setup


def _single_into_out(quantity: str) -> Callable[[Workload], Task]:
    def setup(workload: Workload) -> Task:
        _refuse_open_form(workload, quantity)
        function = method(workload.arm, quantity)
        inputs = workload.inputs(quantity)
        items = list(zip(*inputs, strict=True))
        out = new_output(function, [x[:1] for x in inputs])[0]

        def prepare(count: int) -> Call:
            chosen = list(islice(cycle(items), count))

            def loop() -> None:
                for item in chosen:
                    function(*item, out=out)

            return loop

        def first_answers(count: int) -> list[Array]:
            return [np.copy(_answer(quantity, function(*item, out=out))) for item in items[:count]]

        return Task(prepare, first_answers)

    return setup


def _few(size: int, quantity: str) -> Callable[[Workload], Task]:
    """Return the setup of calls for ``size`` states each, in new arrays."""

    def setup(workload: Workload) -> Task:
        function = method(workload.arm, quantity)
        inputs = workload.inputs(quantity)
        # The last block is filled with the first states.
        count = -(-len(inputs[0]) // size)
        filled = [np.resize(x, (count * size, *x.shape[1:])) for x in inputs]
        blocks = list(zip(*(np.split(x, count) for x in filled), strict=True))

        def prepare(items: int) -> Call:
            return one_by_one(function, blocks)(-(-items // size))

        def first_answers(wanted: int) -> list[Array]:
            answers: list[Array] = []
            for block in islice(cycle(blocks), -(-wanted // size)):
                answers += _answers(quantity, function(*block))
            return answers[:wanted]

        return Task(prepare, first_answers)

    return setup


def _from_near(workload: Workload) -> Task:
    """Return the task of numeric inverse kinematics from joint values that are 0.05 rad or m off each."""
    function = method(workload.arm, "ik_numeric")
    items = list(zip(workload.T_inside, workload.q_inside + NEAR_BY, strict=True))
    return Task(
        one_by_one(function, items),
        lambda count: [_answer("ik_numeric", function(*item)) for item in items[:count]],
    )


def _given_redundancy(workload: Workload) -> Task:
    """Return the task of all solutions at the redundancy of the joint values that made the poses, in a batch."""
    arm = workload.arm
    _refuse_all_but_redundant(arm)
    redundancy = arm.redundancy(workload.q)

    def prepare(items: int) -> Call:
        T = workload.T[:items]
        out = np.full_like(arm.ik(T, redundancy=redundancy[:items]).q, np.nan)
        return lambda: arm.ik(T, out=out, threads=workload.threads, redundancy=redundancy[:items])

    return Task(prepare, lambda k: _answers("ik", prepare(k)()))


def _given_redundancy_one_by_one(workload: Workload) -> Task:
    """Return the task of all solutions of one pose at the redundancy of the joint values that made it."""
    arm = workload.arm
    _refuse_all_but_redundant(arm)
    items = list(zip(workload.T, arm.redundancy(workload.q).tolist(), strict=True))

    def solve(T: Array, redundancy: float) -> Any:
        return arm.ik(T, redundancy=redundancy)

    return Task(
        one_by_one(solve, items),
        lambda count: [_answer("ik", solve(*item)) for item in items[:count]],
    )


def _refuse_all_but_redundant(arm: Arm) -> None:
    if arm.family.redundant is None:
        raise UnavailableError("takes arms of seven joints with a closed form at a redundancy")


def _refuse_open_form(workload: Workload, quantity: str) -> None:
    if quantity == "ik_numeric":
        raise UnavailableError("arm.ik_numeric has no out=")
    if quantity == "ik" and workload.arm.family.fit is None:
        raise UnavailableError(
            "arm.ik takes out= only where a closed form decides how many branches there are"
        )


def _answers(quantity: str, result: Any) -> Sequence[Array]:
    if quantity not in INVERSE_KINEMATICS:
        return list(stacked(result))
    return [q[valid] for q, valid in zip(result.q, result.valid, strict=True)]


def _answer(quantity: str, result: Any) -> Array:
    """Return the answer of a call for one state."""
    if quantity not in INVERSE_KINEMATICS:
        return stacked(result)
    reached: Array = result.q[result.valid]
    return reached


def casadi_contenders() -> tuple[Contender, ...]:
    """Return CasADi's virtual machine mapped over a batch, for each quantity of dynamics."""
    functions: dict[str, Callable[[Arm], Any]] = {
        "inverse_dynamics": lambda arm: arm.casadi.inverse_dynamics,
        "mass_matrix": lambda arm: arm.casadi.mass_matrix,
        "forward_dynamics": lambda arm: arm.casadi.forward_dynamics,
        "inverse_dynamics_derivatives": _casadi_derivatives,
    }
    return tuple(
        Contender("CasADi map", quantity, Mode.BATCH, _mapped(quantity, function))
        for quantity, function in functions.items()
    )


def _casadi_derivatives(arm: Arm) -> Any:
    """Return the derivatives of the torques by CasADi's own differentiation, n x 3 n."""
    import casadi

    states = [casadi.SX.sym(name, arm.n) for name in ("q", "qd", "qdd")]
    tau = arm.casadi.inverse_dynamics(*states)
    return casadi.Function("derivatives", states, [casadi.jacobian(tau, casadi.vertcat(*states))])


def _mapped(quantity: str, function_of: Callable[[Arm], Any]) -> Callable[[Workload], Task]:
    def setup(workload: Workload) -> Task:
        function = function_of(workload.arm)
        inputs = workload.inputs(quantity)
        n = workload.arm.n

        def prepare(items: int) -> Call:
            mapped = function.map(items)
            columns = [np.asfortranarray(x[:items].T) for x in inputs]
            return lambda: mapped(*columns)

        def answers(k: int) -> list[Array]:
            result = np.array(prepare(k)())
            if result.shape == (n, k):
                return list(result.T)
            # Matrices of the items beside each other.
            matrices = result.reshape(n, k, -1).swapaxes(0, 1)
            if matrices.shape[-1] == n:
                return list(matrices)
            return list(np.stack(np.split(matrices, 3, axis=-1), axis=-3))

        return Task(prepare, answers)

    return setup
