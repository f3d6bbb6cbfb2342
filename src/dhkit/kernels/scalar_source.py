"""Text of LLVM's intermediate representation for one item: a straight-line program, or one that repeats a step.

For single calls, where a vector would have idle lanes, and for loops, whose items end after different numbers of steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from dhkit.kernels.branch_lanes import branch_results
from dhkit.kernels.lowering import FLOAT, SMALL_INTEGER, STORED, loop_values, result_values
from dhkit.kernels.pipeline_source import pipeline_source
from dhkit.kernels.vectors import EXACT, FUSING, WIDTH, Body, Vector
from dhkit.symbolic import Graph, Loop, Pipeline, Program


def run_source(program: Program, types: Sequence[str], *, refuses_nan: bool = False) -> list[str]:
    """Return the lines of ``i1 run(ptr parameters, ptr x0, ..., ptr y0, ...)``, which computes one item.

    It reads an item's inputs before it writes its outputs, so that they may share memory. Float outputs are NaN where
    an input is not finite.

    Parameters
    ----------
    program
        The program; its first input holds the parameters.
    types
        Types of its outputs, see :func:`dhkit.kernels.llvm_source.llvm_source`.
    refuses_nan
        Whether it writes nothing and returns false where an entry of the first output is not finite; not of a pipeline.
    """
    if isinstance(program, Pipeline):
        return pipeline_source(program)
    # As in the vector kernel: programs that decide small integers round every operation.
    body = Body(EXACT if SMALL_INTEGER in types else FUSING, width=1)
    inputs = [
        _loaded(body, f"%{name}", variable.size)
        for name, variable in zip(_input_names(program), program.inputs, strict=True)
    ]
    if isinstance(program, Loop):
        outputs = loop_values(program, body, inputs)
    elif program.branches > 1:
        outputs = branch_results(program, body, inputs, types)
    else:
        outputs = result_values(program, body, inputs, types)

    if refuses_nan:
        # x - x is 0, and NaN where x is not finite.
        total = outputs[0][0] - outputs[0][0]
        for x in outputs[0][1:]:
            total = total + (x - x)
        body.lines.append(f"  br i1 {total.equals(0.0).name}, label %store, label %refused")
    else:
        body.lines.append("  br label %store")
    pointers = [*_input_names(program), *(f"y{k}" for k in range(len(outputs)))]
    return [
        *_declarations(program),
        f"define internal i1 @run({', '.join(f'ptr %{pointer}' for pointer in pointers)}) {{",
        "begin:",
        *body.lines,
        "store:",
        *chain.from_iterable(
            _stored(f"y{k}", entries, kind)
            for k, (entries, kind) in enumerate(zip(outputs, types, strict=True))
        ),
        "  ret i1 true",
        "refused:",
        "  ret i1 false",
        "}",
    ]


def _declarations(program: Program) -> list[str]:
    """Return the declarations of LLVM's functions for single numbers, vectors and branches in lanes."""
    widths = {1, WIDTH}
    if isinstance(program, Graph):
        widths.add(max(program.branches, 1))
    return [line for width in sorted(widths) for line in Body(width=width).declarations()]


def item_source(program: Loop | Pipeline, types: Sequence[str]) -> str:
    """Return a module with the function ``kernel`` of :func:`dhkit.kernels.llvm_source.llvm_source`, item by item."""
    sizes = [variable.size for variable in (*program.inputs[1:], *program.outputs)]
    kinds = ["double"] * (len(program.inputs) - 1) + [STORED[kind] for kind in types]
    lines = [
        *run_source(program, types),
        "define void @kernel(ptr %parameters, ptr %arrays, ptr %work, i64 %count) {",
        "entry:",
        "  %none = icmp sle i64 %count, 0",
        "  br i1 %none, label %end, label %item",
        "item:",
        "  %k = phi i64 [0, %entry], [%next, %item]",
    ]
    for j, (size, kind) in enumerate(zip(sizes, kinds, strict=True)):
        lines += [
            f"  %array{j}_at = getelementptr ptr, ptr %arrays, i64 {j}",
            f"  %array{j} = load ptr, ptr %array{j}_at",
            f"  %offset{j} = mul i64 %k, {size}",
            f"  %row{j} = getelementptr {kind}, ptr %array{j}, i64 %offset{j}",
        ]
    rows = ", ".join(f"ptr %row{j}" for j in range(len(sizes)))
    return "\n".join(
        [
            *lines,
            f"  %done = call i1 @run(ptr %parameters, {rows})",
            "  %next = add i64 %k, 1",
            "  %more = icmp slt i64 %next, %count",
            "  br i1 %more, label %item, label %end",
            "end:",
            "  ret void",
            "}",
            "",
        ]
    )


def _input_names(program: Program) -> list[str]:
    return ["parameters", *(f"x{k}" for k in range(len(program.inputs) - 1))]


def _loaded(body: Body, pointer: str, size: int) -> list[Vector]:
    values = []
    for k in range(size):
        place = body.define(f"getelementptr double, ptr {pointer}, i64 {k}")
        values.append(Vector(body, body.define(f"load double, ptr {place}")))
    return values


def _stored(pointer: str, entries: Sequence[Vector], kind: str) -> list[str]:
    """Return the lines that write the entries of an output; its place may be unaligned."""
    lines = []
    for k, entry in enumerate(entries):
        place = f"%{pointer}_{k}"
        value = entry.name
        lines.append(f"  {place} = getelementptr {STORED[kind]}, ptr %{pointer}, i64 {k}")
        if kind != FLOAT:
            # In two steps, because the processor's instruction converts to 32 bits.
            lines += [
                f"  {place}_wide = fptosi double {value} to i32",
                f"  {place}_small = trunc i32 {place}_wide to {STORED[kind]}",
            ]
            value = f"{place}_small"
        lines.append(f"  store {STORED[kind]} {value}, ptr {place}, align 1")
    return lines
