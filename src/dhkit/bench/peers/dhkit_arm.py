"""dhkit itself: one call for a batch, with and without an array to write into, and one call for each state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.contenders import (
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


def contenders() -> tuple[Contender, ...]:
    """Return dhkit's contenders for each quantity."""
    setups = (
        (BATCH, Mode.BATCH, _into_out),
        (_NEW_ARRAYS, Mode.BATCH, _into_new_arrays),
        (SINGLE, Mode.SINGLE, _single),
    )
    found = []
    for quantity in QUANTITIES:
        for name, mode, setup in setups:
            found.append(Contender(name, quantity, mode, setup(quantity), own=True))
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
    one: Array = result if isinstance(result, np.ndarray) else result.q
    return np.full((len(inputs[0]), *one.shape[1:]), np.nan)


def _into_out(quantity: str) -> Callable[[Workload], Task]:
    def setup(workload: Workload) -> Task:
        function = method(workload.arm, quantity)
        inputs = workload.inputs(quantity)
        if quantity == "ik" and workload.arm.family.fit is None:
            raise UnavailableError(
                "arm.ik takes out= only where a closed form decides how many branches there are"
            )

        def prepare(items: int) -> Callable[[], Any]:
            chosen = [x[:items] for x in inputs]
            out = new_output(function, chosen)
            return lambda: function(*chosen, out=out, threads=workload.threads)

        return Task(prepare, lambda k: _answers(quantity, prepare(k)()))

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
            """Return the answers to the first items, each called as a batch of one."""
            found = []
            for item in items[:count]:
                batch_of_one = [x[None] for x in item]
                found.append(_answers(quantity, function(*batch_of_one))[0])
            return found

        return Task(one_by_one(function, items), first_answers)

    return setup


def _answers(quantity: str, result: Any) -> Sequence[Array]:
    if quantity != "ik":
        return list(result)
    return [q[valid] for q, valid in zip(result.q, result.valid, strict=True)]


def casadi_contenders() -> tuple[Contender, ...]:
    """Return CasADi's virtual machine mapped over a batch, for each quantity of dynamics."""
    return tuple(
        Contender("CasADi map", quantity, Mode.BATCH, _mapped(quantity))
        for quantity in ("inverse_dynamics", "mass_matrix", "forward_dynamics")
    )


def _mapped(quantity: str) -> Callable[[Workload], Task]:
    def setup(workload: Workload) -> Task:
        function = getattr(workload.arm.casadi, quantity)
        inputs = workload.inputs(quantity)
        n = workload.arm.n

        def prepare(items: int) -> Call:
            mapped = function.map(items)
            columns = [np.asfortranarray(x[:items].T) for x in inputs]
            return lambda: mapped(*columns)

        def answers(k: int) -> list[Array]:
            result = np.array(prepare(k)())
            return (
                list(result.T)
                if result.shape == (n, k)
                else list(result.reshape(n, k, n).swapaxes(0, 1))
            )

        return Task(prepare, answers)

    return setup
