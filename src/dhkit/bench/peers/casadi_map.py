"""CasADi's own virtual machine, mapped over a batch: the same derivation without compiled kernels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dhkit.bench.contenders import Call, Contender, Mode, Task, Workload
from dhkit.description import Array


def contenders() -> tuple[Contender, ...]:
    """Return a contender for each quantity of dynamics."""
    return tuple(
        Contender("CasADi map", quantity, Mode.BATCH, _mapped(quantity))
        for quantity in ("inverse_dynamics", "mass_matrix", "forward_dynamics")
    )


def _mapped(quantity: str) -> Callable[[Workload], Task]:
    def setup(workload: Workload) -> Task:
        function, inputs, n = getattr(workload.arm.casadi, quantity), workload.inputs(quantity), workload.arm.n

        def prepare(items: int) -> Call:
            mapped = function.map(items)
            columns = [np.asfortranarray(x[:items].T) for x in inputs]
            return lambda: mapped(*columns)

        def answers(k: int) -> list[Array]:
            result = np.array(prepare(k)())
            return list(result.T) if result.shape == (n, k) else list(result.reshape(n, k, n).swapaxes(0, 1))

        return Task(prepare, answers)

    return setup
