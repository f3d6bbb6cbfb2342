"""An arm's mechanics as expressions: CasADi frames and Jacobians, straight-line programs, and their source text."""

from dhkit.symbolic.frames import (
    ReferenceAxes,
    SymbolicTable,
    jacobian,
    jacobian_dot,
    joint_symbols,
    table_pattern,
)
from dhkit.symbolic.graph import Graph, Node, Variable
from dhkit.symbolic.printers import c_source, export_c, python_lines

__all__ = [
    "Graph",
    "Node",
    "ReferenceAxes",
    "SymbolicTable",
    "Variable",
    "c_source",
    "export_c",
    "jacobian",
    "jacobian_dot",
    "joint_symbols",
    "python_lines",
    "table_pattern",
]
