"""The text of a kernel: a straight-line program over structure-of-arrays blocks, or over NumPy arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate

from dhkit.symbolic import Graph, Variable, python_lines

__all__ = ["BLOCK", "array_source", "loop_source"]

BLOCK = 64
"""Items of one block: 8 vectors of 8 doubles; all rows of a block, inverse kinematics included, fit the first cache."""

FUNCTIONS = "absolute, atan2, floor, logical_not, maximum, minimum, select, sincos, sqrt"


@dataclass(frozen=True)
class Layout:
    """Where the entries of a program's variables lie: parameters first, then rows of a block."""

    graph: Graph

    @property
    def parameters(self) -> Variable:
        return self.graph.inputs[0]

    @property
    def items(self) -> tuple[Variable, ...]:
        return self.graph.inputs[1:]

    @property
    def input_rows(self) -> list[int]:
        return [0, *accumulate(variable.size for variable in self.items)]

    @property
    def output_rows(self) -> list[int]:
        start = self.input_rows[-1]
        return [start, *(start + x for x in accumulate(variable.size for variable in self.graph.outputs))]


def loop_source(graph: Graph, types: Sequence[str], *, cache: bool = True) -> str:
    """Return a module with ``kernel(parameters, x0, ..., y0, ...)`` for Numba.

    Inputs and outputs are arrays (N, size), row by row; they are transposed block by block, so that every load and
    store of the program is of neighbouring items. Where an item's input is not finite, its float results are NaN.

    Parameters
    ----------
    graph
        The program; its first input holds the parameters, which all items share.
    types
        Of each output: float64, or uint8 for small whole numbers.
    cache
        Whether Numba keeps the machine code beside the module, which then must be a file.
    """
    layout = Layout(graph)
    inputs, outputs = layout.input_rows, layout.output_rows

    def load(variable: int, entry: int) -> str:
        return f"p{entry}" if variable == 0 else f"w[{(inputs[variable - 1] + entry) * BLOCK} + i]"

    def store(output: int, entry: int, value: str) -> str:
        poisoned = f"{value} + missing" if types[output] == "float64" else value
        return f"w[{(outputs[output] + entry) * BLOCK} + i] = {poisoned}"

    arguments = ["parameters", *(f"x{k}" for k in range(len(inputs) - 1)), *(f"y{k}" for k in range(len(types)))]
    lines = [
        f'"""{graph.name}: written by dhkit.kernels."""',
        "import numpy as np",
        "from numpy import inf, nan",
        f"from dhkit.kernels.compiler import compiled, {FUNCTIONS}",
        "",
        f"@compiled({len(layout.items)}, {list(types)}, cache={cache})",
        f"def kernel({', '.join(arguments)}):",
        f"    w = np.empty({outputs[-1] * BLOCK})",
        *(f"    p{entry} = parameters[{entry}]" for entry in range(layout.parameters.size)),
        f"    for start in range(0, x0.shape[0], {BLOCK}):",
        f"        count = min({BLOCK}, x0.shape[0] - start)",
    ]
    for k, variable in enumerate(layout.items):
        lines += _copy(f"w[{inputs[k] * BLOCK} + i + j * {BLOCK}] = x{k}[start + i, j]", variable.size)
    lines += ["        for i in range(count):", f"            missing = {_missing(layout, load)}"]
    lines += [f"            {line}" for line in python_lines(graph, load, store)]
    for k, variable in enumerate(graph.outputs):
        value = f"w[{outputs[k] * BLOCK} + i + j * {BLOCK}]"
        stored = value if types[k] == "float64" else f"np.{types[k]}({value})"
        lines += _copy(f"y{k}[start + i, j] = {stored}", variable.size)
    return "\n".join(lines) + "\n"


def array_source(graph: Graph, types: Sequence[str]) -> str:
    """Return a module with the same function for plain NumPy: every operation works on a whole block."""
    layout = Layout(graph)

    def load(variable: int, entry: int) -> str:
        return f"parameters[{entry}]" if variable == 0 else f"x{variable - 1}[:, {entry}]"

    def store(output: int, entry: int, value: str) -> str:
        return f"y{output}[:, {entry}] = {value}{' + missing' if types[output] == 'float64' else ''}"

    arguments = ["parameters", *(f"x{k}" for k in range(len(layout.items))), *(f"y{k}" for k in range(len(types)))]
    lines = [
        "from numpy import inf, nan",
        f"from dhkit.kernels.elementary import {FUNCTIONS}",
        f"def kernel({', '.join(arguments)}):",
        f"    missing = {_missing(layout, load)}",
        *(f"    {line}" for line in python_lines(graph, load, store)),
    ]
    return "\n".join(lines) + "\n"


def _missing(layout: Layout, load: Callable[[int, int], str]) -> str:
    """Return text that is 0, or NaN where an input is not finite."""
    entries = [load(k, entry) for k, variable in enumerate(layout.items, start=1) for entry in range(variable.size)]
    return " + ".join(f"({entry} - {entry})" for entry in entries)


def _copy(line: str, size: int) -> list[str]:
    return ["        for i in range(count):", f"            for j in range({size}):", f"                {line}"]
