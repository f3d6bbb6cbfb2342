"""Straight-line programs as source text: Python lines for kernels and NumPy, and C99."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from dhkit.description import write_atomically
from dhkit.symbolic.programs.graph import Graph, Node

__all__ = ["c_source", "export_c", "python_lines"]

PYTHON = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "negate": "-{}",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "equal": "{} == {}",
    "unequal": "{} != {}",
    "logical_and": "{} & {}",
    "logical_or": "{} | {}",
}
"""Operations with a sign; the others are calls of a function of their name."""

C = PYTHON | {
    "absolute": "fabs({})",
    "floor": "floor({})",
    "sqrt": "sqrt({})",
    "sin": "sin({})",
    "cos": "cos({})",
    "atan2": "atan2({}, {})",
    "minimum": "fmin({}, {})",
    "maximum": "fmax({}, {})",
    "logical_and": "{} && {}",
    "logical_or": "{} || {}",
    "logical_not": "!{}",
    "select": "{} ? {} : {}",
}


C_NUMBERS = {"nan": "NAN", "inf": "INFINITY", "-inf": "-INFINITY"}


def python_lines(graph: Graph, load: Callable[[int, int], str], store: Callable[[int, int, str], str]) -> Iterator[str]:
    """Yield assignments ``v0 = ...``; sine and cosine of one angle are one call of ``sincos``.

    The text knows ``nan`` and ``inf``, and a function for every operation that has no sign.

    Parameters
    ----------
    graph
        The program.
    load
        Text that reads an entry of an input, from its number and the entry's.
    store
        A line that writes an entry of an output, from its number, the entry's and the text of the value.
    """
    pairs = _angle_pairs(graph)
    written: set[int] = set()
    for k, node in enumerate(graph.nodes):
        if node.operation == "constant" or k in written:
            continue
        if node.operation in ("sin", "cos"):
            sine, cosine = pairs[node.arguments[0]]
            written |= {sine, cosine}
            targets = ", ".join(f"v{place}" if place >= 0 else "_" for place in (sine, cosine))
            yield f"{targets} = sincos({_python_value(graph, node.arguments[0])})"
        elif node.operation == "input":
            yield f"v{k} = {load(*node.arguments)}"
        else:
            arguments = [_python_value(graph, j) for j in node.arguments]
            pattern = PYTHON.get(node.operation, f"{node.operation}({', '.join(['{}'] * len(arguments))})")
            yield f"v{k} = {pattern.format(*arguments)}"
    for output, entries in enumerate(graph.results):
        for entry, k in enumerate(entries):
            yield store(output, entry, _python_value(graph, k))


def c_source(graph: Graph) -> str:
    """Return a C99 function ``void NAME(const double *input, ..., double *output, ...)``; arrays are row by row.

    Inputs and outputs must not overlap. Beyond the standard mathematical functions it needs nothing.
    """
    used = {node.arguments[0] for node in graph.nodes if node.operation == "input"}
    lines = [f"{_c_signature(graph)}\n{{"]
    lines += [f"    (void){x.name};" for k, x in enumerate(graph.inputs) if x.size and k not in used]
    for k, node in enumerate(graph.nodes):
        lines.append(f"    const double v{k} = {_c_expression(graph, node)};")
    for variable, entries in zip(graph.outputs, graph.results, strict=True):
        lines += [f"    {variable.name}[{entry}] = v{k};" for entry, k in enumerate(entries)]
    return "\n".join([*lines, "}"]) + "\n"


def export_c(graphs: Sequence[Graph], folder: str | Path, name: str, remark: str = "") -> tuple[Path, Path]:
    """Write programs as ``NAME.c`` and ``NAME.h``, self-contained C99 (link with -lm); return both paths.

    Parameters
    ----------
    graphs
        Programs of different names.
    folder
        An existing folder.
    name
        An identifier: the files' name.
    remark
        What stands in the files' first comment.

    Raises
    ------
    ValueError
        ``name`` is no identifier.
    """
    if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        raise ValueError(f"name is {name!r}; expected an identifier of C")
    header = Path(folder) / f"{name}.h"
    source = header.with_suffix(".c")
    guard = f"{name.upper()}_H"
    comment = re.sub(r"[^ -~\n]", "?", remark).replace("*/", "* /") or name
    shapes = "".join(_c_comment(graph) + _c_signature(graph) + ";\n\n" for graph in graphs)
    write_atomically(
        header,
        f"/* {comment} */\n#ifndef {guard}\n#define {guard}\n\n"
        f'#ifdef __cplusplus\nextern "C" {{\n#endif\n\n{shapes}#ifdef __cplusplus\n}}\n#endif\n\n#endif\n',
    )
    body = "\n".join(c_source(graph) for graph in graphs)
    write_atomically(source, f'/* {comment} */\n#include "{name}.h"\n\n#include <math.h>\n\n{body}')
    return source, header


def _angle_pairs(graph: Graph) -> dict[int, tuple[int, int]]:
    """Return where the sine and the cosine of each angle are, -1 for one that nobody needs."""
    pairs: dict[int, tuple[int, int]] = {}
    for k, node in enumerate(graph.nodes):
        if node.operation in ("sin", "cos"):
            sine, cosine = pairs.get(node.arguments[0], (-1, -1))
            pairs[node.arguments[0]] = (k, cosine) if node.operation == "sin" else (sine, k)
    return pairs


def _python_value(graph: Graph, k: int) -> str:
    node = graph.nodes[k]
    return f"({node.value!r})" if node.operation == "constant" else f"v{k}"


def _c_expression(graph: Graph, node: Node) -> str:
    if node.operation == "constant":
        return C_NUMBERS.get(repr(node.value), repr(node.value))
    if node.operation == "input":
        return f"{graph.inputs[node.arguments[0]].name}[{node.arguments[1]}]"
    return C[node.operation].format(*(f"v{k}" for k in node.arguments))


def _c_signature(graph: Graph) -> str:
    inputs = [f"const double *{variable.name}" for variable in graph.inputs if variable.size]
    outputs = [f"double *{variable.name}" for variable in graph.outputs]
    return f"void {graph.name}({', '.join([*inputs, *outputs])})"


def _c_comment(graph: Graph) -> str:
    shapes = (f"{v.name}: {' x '.join(map(str, v.shape))}" for v in (*graph.inputs, *graph.outputs) if v.size)
    return f"/* {'; '.join(shapes)}; row by row, SI and radians */\n"
