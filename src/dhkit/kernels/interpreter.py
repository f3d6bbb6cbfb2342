"""Programs run by CasADi's virtual machine: ready in milliseconds, fast for single items and small batches."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.kernels.elementary import EXACT_RANGE, atan2
from dhkit.kernels.lowering import FLOAT, SMALL_INTEGER
from dhkit.kernels.stages import Stage, Stages
from dhkit.symbolic import Graph, Loop, Pipeline
from dhkit.symbolic.programs.pipeline import INDEX

if TYPE_CHECKING:
    import casadi

_LANES = 64
"""Number of items that one call of the virtual machine computes in a larger batch."""
_MAX_SINGLE_ITEMS = 16
"""Up to this number, items at the end of a batch are computed one by one, which is faster than idle lanes."""


class Interpreter:
    """A program as a function of batches, with the rules of a compiled kernel for NaN and small integers.

    Elementary functions are the C library's, and products are not fused into sums: results agree with those of a
    compiled kernel to rounding. Programs with small integers are rounded alike in both, so that both decide alike.
    Several threads may call at once: each has staging arrays of its own.
    """

    def __init__(self, graph: Graph, types: Sequence[str]) -> None:
        one = _function(graph, types)
        self._functions = {1: one, _LANES: one.map("lanes", "serial", _LANES, [0, 1], [])}
        self._inputs = [variable.size for variable in graph.inputs]
        self._outputs = [variable.size for variable in graph.outputs]
        self._stages = Stages(self._staged)

    def __call__(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]
    ) -> None:
        """Fill ``outputs``; all are arrays (N, size), as for :class:`dhkit.kernels.Kernel`."""
        count = len(inputs[0])
        if count == 1:
            self._stages.work(1, parameters, inputs, outputs)
            return
        start = 0
        while count - start >= _LANES:
            rows = slice(start, start + _LANES)
            self._stages.work(
                _LANES, parameters, [x[rows] for x in inputs], [y[rows] for y in outputs]
            )
            start += _LANES
        if count - start > _MAX_SINGLE_ITEMS:
            rows = slice(start, count)
            padded = [
                np.concatenate([x[rows], np.zeros((start + _LANES - count, x.shape[1]))])
                for x in inputs
            ]
            results = [np.empty((_LANES, y.shape[1]), y.dtype) for y in outputs]
            self._stages.work(_LANES, parameters, padded, results)
            for y, result in zip(outputs, results, strict=True):
                y[rows] = result[: count - start]
            return
        for k in range(start, count):
            self._stages.work(1, parameters, [x[k] for x in inputs], [y[k] for y in outputs])

    def _staged(self, lanes: int) -> Stage:
        buffer: Any
        buffer, run = self._functions[lanes].buffer()
        zero = np.zeros(1)
        parameters = np.zeros(self._inputs[0])
        inputs = [np.zeros((lanes, size)) for size in self._inputs[1:]]
        outputs: list[NDArray[Any]] = [np.zeros((lanes, size)) for size in self._outputs]
        for k, array in enumerate((zero, parameters, *inputs)):
            buffer.set_arg(k, array.data)
        for k, array in enumerate(outputs):
            buffer.set_res(k, array.data)
        return Stage(parameters, inputs, outputs, run, kept=(buffer, zero))


class LoopInterpreter:
    """A loop as a function of batches: the steps of all items together, until the last one is done."""

    def __init__(self, loop: Loop) -> None:
        self._loop = loop
        self._start = Interpreter(loop.begin, [FLOAT, FLOAT])
        self._step = Interpreter(loop.step, [FLOAT, FLOAT])
        self._finish = Interpreter(loop.finish, [FLOAT] * len(loop.outputs))

    def __call__(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]
    ) -> None:
        """Fill ``outputs``; all are arrays (N, size), as for :class:`dhkit.kernels.Kernel`."""
        count = len(inputs[0])
        state, fixed = (np.empty((count, output.size)) for output in self._loop.begin.outputs)
        self._start(parameters, inputs, [state, fixed])
        active = np.arange(count)
        for _ in range(self._loop.most):
            after = np.empty((len(active), state.shape[1]))
            goes_on = np.empty((len(active), 1))
            of_active = [np.ascontiguousarray(x[active]) for x in (*inputs, fixed, state)]
            self._step(parameters, of_active, [after, goes_on])
            state[active] = after
            active = active[goes_on[:, 0] == 1.0]
            if not len(active):
                break
        self._finish(parameters, [*inputs, fixed, state], outputs)


class PipelineInterpreter:
    """A pipeline as a function of batches, item after item."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = pipeline
        self._steps = [
            Interpreter(step.graph, [FLOAT] * len(step.graph.outputs)) for step in pipeline.steps
        ]

    def __call__(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]
    ) -> None:
        """Fill ``outputs``; all are arrays (N, size), as for :class:`dhkit.kernels.Kernel`."""
        for row in range(len(inputs[0])):
            is_finite = all(np.isfinite(x[row]).all() for x in inputs)
            found = self._item(parameters, [x[row] for x in inputs])
            for name, output in zip(self._pipeline.results, outputs, strict=True):
                output[row] = found[name].ravel() if is_finite else nan

    def _item(self, parameters: Array, inputs: Sequence[Array]) -> dict[str, Array]:
        """Return inputs and outputs of all steps, shape (items, entries), by their names, for one item."""
        pipeline = self._pipeline
        names = [variable.name for variable in pipeline.inputs[1:]]
        known = {name: x[None] for name, x in zip(names, inputs, strict=True)}
        for step, run in zip(pipeline.steps, self._steps, strict=True):
            for _ in range(step.most):
                rows = []
                for variable in step.graph.inputs[1:]:
                    source, is_shared = pipeline.source(step, variable.name)
                    if source == INDEX:
                        x = np.arange(float(step.items))[:, None]
                    elif is_shared:
                        x = np.tile(known[source].T.ravel(), (step.items, 1))
                    else:
                        x = known[source].T.reshape(variable.size, step.items).T
                    rows.append(np.ascontiguousarray(x))
                results = [np.empty((step.items, one.size)) for one in step.graph.outputs]
                run(parameters, rows, results)
                found = dict(zip((one.name for one in step.graph.outputs), results, strict=True))
                if step.skips:
                    is_skipped = known[step.skips].ravel() != 0.0
                    for x in results:
                        x[is_skipped] = 0.0
                if step.places:
                    items = np.argsort(found[step.places][:, 0])
                    found = {name: x[items] for name, x in found.items()}
                known.update((one.name, found[one.name]) for one in step.outputs)
                if step.most == 1 or not results[-1].any():
                    break
        return known


def _function(graph: Graph, types: Sequence[str]) -> casadi.Function:
    """Return a program as a CasADi function of (0, parameters, inputs ...), flat.

    The first argument is a symbol for 0. CasADi would simplify x - x, y + 0 and x (1 / y); with a symbol the first is
    NaN where x is not finite, the second has no negative zero, and the third remains a product.
    """
    import casadi

    zero = casadi.SX.sym("zero")
    inputs = [casadi.SX.sym(variable.name, variable.size) for variable in graph.inputs]
    entries = [casadi.vertsplit(x) if x.numel() else [] for x in inputs]
    values = _values(graph, entries, zero, alike=SMALL_INTEGER in types)

    # 0 times each input is 0, or NaN where the input is not finite: added to a float, it makes that NaN too.
    missing = sum((x * zero for x in chain.from_iterable(entries[1:])), casadi.SX(0))
    results = []
    for places, kind in zip(graph.results, types, strict=True):
        entries_of_result = [values[k] + missing if kind == FLOAT else values[k] for k in places]
        results.append(casadi.vertcat(*entries_of_result))
    return casadi.Function(
        graph.name, [zero, *inputs], [casadi.densify(casadi.SX(x)) for x in results]
    )


def _values(
    graph: Graph, entries: Sequence[Sequence[casadi.SX]], zero: casadi.SX, *, alike: bool
) -> list[casadi.SX]:
    """Return the value of every node; ``alike`` with the arc tangent of compiled kernels, not the C library's."""
    import casadi

    def quotient(x: casadi.SX, y: casadi.SX) -> casadi.SX:
        # Of a product with 1 / y CasADi would make a quotient.
        return (x + zero if x.is_one() else x) / y

    def library_atan2(y: casadi.SX, x: casadi.SX) -> casadi.SX:
        return casadi.atan2(y + zero, x + zero)

    def kernel_atan2(y: casadi.SX, x: casadi.SX) -> casadi.SX:
        angle: casadi.SX = atan2(y, x, casadi.if_else, casadi.fabs)
        return angle

    apply: Mapping[str, Callable[..., casadi.SX]] = {
        "add": operator.add,
        "subtract": operator.sub,
        "multiply": operator.mul,
        "divide": quotient,
        "negate": operator.neg,
        "absolute": casadi.fabs,
        "floor": casadi.floor,
        "sqrt": casadi.sqrt,
        "atan2": kernel_atan2 if alike else library_atan2,
        "minimum": lambda a, b: casadi.if_else(a < b, a, b),
        "maximum": lambda a, b: casadi.if_else(a > b, a, b),
        "less": operator.lt,
        "less_equal": operator.le,
        "equal": operator.eq,
        "unequal": operator.ne,
        "logical_and": casadi.logic_and,
        "logical_or": casadi.logic_or,
        "logical_not": casadi.logic_not,
        "select": casadi.if_else,
    }
    values: list[casadi.SX] = []
    angles: dict[int, casadi.SX] = {}
    for node in graph.nodes:
        if node.operation == "constant":
            values.append(casadi.SX(node.value))
        elif node.operation == "input":
            variable, entry = node.arguments
            values.append(entries[variable][entry])
        elif node.operation in ("sin", "cos"):
            k = node.arguments[0]
            if k not in angles:
                beyond = casadi.fabs(values[k]) > EXACT_RANGE
                angles[k] = values[k] + casadi.if_else(beyond, nan, 0.0)
            values.append(getattr(casadi, node.operation)(angles[k]))
        else:
            values.append(apply[node.operation](*(values[k] for k in node.arguments)))
    return values
