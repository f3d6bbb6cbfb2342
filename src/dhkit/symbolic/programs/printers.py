"""Straight-line programs as C99."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from dhkit.description import write_atomically
from dhkit.symbolic.languages.printing import C, c_lines
from dhkit.symbolic.languages.statements import Let, Store
from dhkit.symbolic.programs.graph import Graph, Node

_OPERATORS = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "negate": "-{}",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "equal": "{} == {}",
    "unequal": "{} != {}",
    "logical_and": "{} && {}",
    "logical_or": "{} || {}",
    "logical_not": "!{}",
    "select": "{} ? {} : {}",
}
"""Operations that C writes with operators; the others are functions."""


def c_source(graph: Graph) -> str:
    """Return a C99 function ``void NAME(const double *input, ..., double *output, ...)``; arrays are row by row.

    Inputs and outputs must not overlap. The function needs only the standard mathematical functions.

    Parameters
    ----------
    graph
        Program.

    Returns
    -------
    str
        Source of one function, without ``#include``.

    Examples
    --------
    >>> import casadi
    >>> from dhkit.symbolic import Graph
    >>> x = casadi.SX.sym("x")
    >>> print(c_source(Graph.of("line", {"x": x}, {"y": 3 * casadi.sin(x) - 1})).rstrip())
    void line(const double *x, double *y)
    {
        const double v0 = 3.0;
        const double v1 = x[0];
        const double v2 = sin(v1);
        const double v3 = v0 * v2;
        const double v4 = 1.0;
        const double v5 = v3 - v4;
        y[0] = v5;
    }
    """
    used = {node.arguments[0] for node in graph.nodes if node.operation == "input"}
    unused = [x for k, x in enumerate(graph.inputs) if x.size and k not in used]

    lines = [f"{_c_signature(graph)}\n{{"]
    lines += [f"    (void){x.name};" for x in unused]
    for k, node in enumerate(graph.nodes):
        lines += c_lines(Let(f"v{k}", _c_expression(graph, node)), "    ")
    for variable, entries in zip(graph.outputs, graph.results, strict=True):
        for entry, k in enumerate(entries):
            lines += c_lines(Store(variable.name, ((entry,),), (f"v{k}",)), "    ", (len(entries),))
    return "\n".join([*lines, "}"]) + "\n"


def export_c(
    graphs: Sequence[Graph],
    folder: str | Path,
    name: str,
    remark: str = "",
    explanations: Mapping[str, Sequence[str]] | None = None,
) -> tuple[Path, Path]:
    """Write programs as ``NAME.c`` and ``NAME.h``, self-contained C99 (link with -lm); return both paths.

    Parameters
    ----------
    graphs
        Programs with different names.
    folder
        An existing folder.
    name
        The files' name, an identifier.
    remark
        Text of the files' first comment.
    explanations
        Lines that the header has below the shapes of a function, by the program's name.

    Returns
    -------
    tuple[Path, Path]
        Source and header.

    Raises
    ------
    ValueError
        ``name`` is not an identifier.

    Examples
    --------
    >>> import casadi
    >>> from dhkit.symbolic import Graph
    >>> x = casadi.SX.sym("x")
    >>> export_c([Graph.of("line", {"x": x}, {"y": 3 * x - 1})], ".", "line")[1].name
    'line.h'
    """
    if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        raise ValueError(f"name is {name!r}; expected an identifier of C")
    header = Path(folder) / f"{name}.h"
    source = header.with_suffix(".c")

    comment = _comment_text(remark) or name
    explained = explanations or {}

    guard = f"{name.upper()}_H"
    declarations = "".join(
        _c_comment(graph, explained.get(graph.name, ())) + _c_signature(graph) + ";\n\n"
        for graph in graphs
    )
    write_atomically(
        header,
        f"/* {comment} */\n#ifndef {guard}\n#define {guard}\n\n"
        f'#ifdef __cplusplus\nextern "C" {{\n#endif\n\n{declarations}#ifdef __cplusplus\n}}\n#endif\n\n#endif\n',
    )

    body = "\n".join(c_source(graph) for graph in graphs)
    write_atomically(source, f'/* {comment} */\n#include "{name}.h"\n\n#include <math.h>\n\n{body}')
    return source, header


def _c_expression(graph: Graph, node: Node) -> str:
    """Return the right side of a node's assignment; node k is the variable vk."""
    if node.operation == "constant":
        return C.number(node.value)
    if node.operation == "input":
        variable, entry = node.arguments
        return C.entry(graph.inputs[variable].name, entry)
    arguments = [f"v{k}" for k in node.arguments]
    if node.operation in _OPERATORS:
        return _OPERATORS[node.operation].format(*arguments)
    return C.call(node.operation, arguments)


def _c_signature(graph: Graph) -> str:
    inputs = [f"const double *{variable.name}" for variable in graph.inputs if variable.size]
    outputs = [f"double *{variable.name}" for variable in graph.outputs]
    return f"void {graph.name}({', '.join([*inputs, *outputs])})"


def _c_comment(graph: Graph, explanation: Sequence[str]) -> str:
    """Return a comment with the shapes of a program's inputs and outputs, and lines that explain them."""
    variables = [variable for variable in (*graph.inputs, *graph.outputs) if variable.size]
    shapes = [f"{variable.name}: {' x '.join(map(str, variable.shape))}" for variable in variables]
    first = f"/* {'; '.join(shapes)}; row by row, SI and radians"
    lines = [f" * {_comment_text(line)}".rstrip() for line in explanation]
    return "\n".join([first, *lines]) + ("\n */\n" if lines else " */\n")


def _comment_text(text: str) -> str:
    """Return text as a comment of C may hold it: ASCII only, and without the end of a comment."""
    return re.sub(r"[^ -~\n]", "?", text).replace("*/", "* /")
