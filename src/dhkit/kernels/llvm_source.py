"""A kernel as text of LLVM's intermediate representation: a straight-line program over structure-of-arrays blocks."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, islice
from typing import TypeAlias

from dhkit.kernels.elementary import atan2, maximum, minimum, sincos
from dhkit.kernels.vectors import (
    EXACT,
    FUSING,
    WIDTH,
    Body,
    Mask,
    Vector,
    absolute,
    floor,
    select,
    sqrt,
)
from dhkit.symbolic import Graph

BLOCK = 64
"""Largest number of items of a block: 8 vectors of 8 doubles."""
_BLOCK_BYTES = 44 * 1024
"""Largest size of a block of more than one vector, so that it fits into a first-level cache of 48 KB."""

FLOAT = "float64"
"""Type of an output's entries, by NumPy's name."""
SMALL_INTEGER = "uint8"
"""Type of the entries of an output of flags, by NumPy's name."""
STORED = {FLOAT: "double", SMALL_INTEGER: "i8"}
"""LLVM's names of these types."""

_Value: TypeAlias = Vector | Mask

_NUMERIC: Mapping[str, Callable[..., _Value]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "negate": operator.neg,
    "absolute": absolute,
    "floor": floor,
    "sqrt": sqrt,
    "atan2": atan2,
    "minimum": minimum,
    "maximum": maximum,
    "less": operator.lt,
    "less_equal": operator.le,
    "equal": Vector.equals,
    "unequal": Vector.differs,
}
"""Operations of a program on numbers."""
_LOGICAL: Mapping[str, Callable[..., Mask]] = {
    "logical_and": operator.and_,
    "logical_or": operator.or_,
    "logical_not": operator.invert,
}
"""Operations on truth values."""


@dataclass(frozen=True)
class _Layout:
    """Rows of a block for the entries of a program's variables; a row has ``block`` doubles.

    Entries of an output that are the same node, such as those that are always 0 and both triangles of a symmetric
    matrix, share a row.
    """

    graph: Graph

    @cached_property
    def inputs(self) -> list[list[int]]:
        """The row of each entry of each input after the parameters."""
        rows = iter(range(sum(variable.size for variable in self.graph.inputs[1:])))
        return [list(islice(rows, variable.size)) for variable in self.graph.inputs[1:]]

    @cached_property
    def outputs(self) -> list[list[int]]:
        """The row of each entry of each output."""
        first = sum(map(len, self.inputs))
        rows: dict[tuple[int, int], int] = {}
        outputs = []
        for k, places in enumerate(self.graph.results):
            outputs.append([rows.setdefault((k, place), first + len(rows)) for place in places])
        return outputs

    @property
    def block(self) -> int:
        """Number of items of a block: its rows fill at most ``_BLOCK_BYTES``, in whole vectors."""
        rows = 1 + max(chain.from_iterable((*self.inputs, *self.outputs)))
        fitting = _BLOCK_BYTES // (8 * rows) // WIDTH * WIDTH
        return max(WIDTH, min(fitting, BLOCK))


def llvm_source(graph: Graph, types: Sequence[str]) -> str:
    """Return a module with ``void kernel(double *parameters, void **arrays, double *work, int64 count)``.

    ``arrays`` holds the addresses of inputs, then outputs: (count, size) each, row by row. They are transposed block by
    block in ``work`` (at most ``BLOCK`` doubles for each of their columns, aligned to 64 bytes), so that every load and
    store of the program is of neighbouring items. Where an item's input is not finite, its float results are NaN.

    Parameters
    ----------
    graph
        The program; its first input holds the parameters, which all items share.
    types
        Type of each output: ``FLOAT``, or ``SMALL_INTEGER`` for whole numbers from 0 to 255.
    """
    # Programs that decide small integers round every operation as the interpreter does, so that both decide alike.
    layout = _Layout(graph)
    body = Body(EXACT if SMALL_INTEGER in types else FUSING)
    results = _results(graph, layout, body, types)
    inputs = [f"%x{k}" for k in range(len(graph.inputs) - 1)]
    outputs = [f"%y{k}" for k in range(len(graph.outputs))]
    lines = [
        *body.declarations(),
        "define void @kernel(ptr %parameters, ptr %arrays, ptr %work, i64 %count) {",
        "entry:",
        *chain.from_iterable(_array(k, name) for k, name in enumerate((*inputs, *outputs))),
        *chain.from_iterable(map(_broadcast, range(graph.inputs[0].size))),
        "  %none = icmp sle i64 %count, 0",
        "  br i1 %none, label %end, label %block",
        "block:",
        "  %start = phi i64 [0, %entry], [%next_start, %written]",
        "  %left = sub i64 %count, %start",
        f"  %partial = icmp slt i64 %left, {layout.block}",
        f"  %size = select i1 %partial, i64 %left, i64 {layout.block}",
        "  br label %read0",
    ]
    for k, name in enumerate(inputs):
        before = f"read{k - 1}_end" if k else "block"
        lines += _copied(
            f"read{k}",
            before,
            name,
            layout.inputs[k],
            layout.block,
            "double",
            reading=True,
        )
        lines += [f"  br label %{f'read{k + 1}' if k + 1 < len(inputs) else 'compute'}"]
    lines += [
        "compute:",
        f"  %item = phi i64 [0, %read{len(inputs) - 1}_end], [%next_item, %compute]",
        *body.lines,
        *results,
        f"  %next_item = add i64 %item, {WIDTH}",
        "  %computing = icmp slt i64 %next_item, %size",
        "  br i1 %computing, label %compute, label %write0",
    ]
    for k, name in enumerate(outputs):
        before = f"write{k - 1}_end" if k else "compute"
        kind = STORED[types[k]]
        lines += _copied(
            f"write{k}", before, name, layout.outputs[k], layout.block, kind, reading=False
        )
        lines += [f"  br label %{f'write{k + 1}' if k + 1 < len(outputs) else 'written'}"]
    lines += [
        "written:",
        f"  %next_start = add i64 %start, {layout.block}",
        "  %more = icmp slt i64 %next_start, %count",
        "  br i1 %more, label %block, label %end",
        "end:",
        "  ret void",
        "}",
    ]
    return "\n".join(lines) + "\n"


def _results(graph: Graph, layout: _Layout, body: Body, types: Sequence[str]) -> list[str]:
    """Write the program's operations into ``body`` and return the lines that store its results."""
    states = [_loaded(body, rows, layout.block) for rows in layout.inputs]
    parameters = [Vector(body, f"%p{k}") for k in range(graph.inputs[0].size)]
    results: dict[int, Vector] = {}
    outputs = result_values(graph, body, [parameters, *states], types)
    for rows, entries in zip(layout.outputs, outputs, strict=True):
        results.update(zip(rows, entries, strict=True))
    lines = []
    for row, result in results.items():
        address = _address(body, row, layout.block)
        lines.append(f"  store {body.number_type} {result.name}, ptr {address}, align 64")
    return lines


def result_values(
    graph: Graph, body: Body, inputs: Sequence[Sequence[Vector]], types: Sequence[str]
) -> list[list[Vector]]:
    """Write a program's operations into ``body`` and return the entries of its outputs.

    Parameters
    ----------
    graph, types
        The program, and the type of each output; see :func:`llvm_source`.
    body
        Where the operations are written, and how many items they work on.
    inputs
        The entries of each input, the parameters first.

    Returns
    -------
    list
        The entries of each output; of float outputs they are NaN where an entry of an input after the parameters is
        not finite.
    """
    outputs = plain_results(graph, body, inputs)
    missing: Vector | None = None  # 0, or NaN where an input is not finite
    for x in chain.from_iterable(inputs[1:]):
        missing = x - x if missing is None else missing + (x - x)
    if missing is None:
        return outputs
    for k, kind in enumerate(types):
        if kind == FLOAT:
            outputs[k] = [entry + missing for entry in outputs[k]]
    return outputs


def plain_results(
    graph: Graph, body: Body, inputs: Sequence[Sequence[Vector]]
) -> list[list[Vector]]:
    """Write a program's operations into ``body``, as :func:`result_values`, without its rule for NaN."""
    values = _node_values(graph, body, inputs)
    return [_numbers(values, places) for places in graph.results]


def _node_values(graph: Graph, body: Body, inputs: Sequence[Sequence[Vector]]) -> list[_Value]:
    """Return the value of every node."""
    values: dict[int, _Value] = {}
    pairs = graph.angle_pairs

    def evaluate(k: int) -> None:
        node = graph.nodes[k]
        if node.operation == "constant":
            values[k] = Vector(body, body.constant(node.value))
        elif node.operation == "input":
            variable, entry = node.arguments
            values[k] = inputs[variable][entry]
        elif node.operation in ("sin", "cos"):
            angle = node.arguments[0]
            values.update(zip(pairs[angle], sincos(_number(values[angle])), strict=True))
        else:
            values[k] = _apply(node.operation, [values[j] for j in node.arguments])

    if body.width == 1:
        # The sines of one item's angles are computed together, an angle in each lane of a vector.
        first = _before_sines(graph)
        for k in first:
            evaluate(k)
        angles = [angle for angle in pairs if angle in first]
        results = _sincos_in_lanes(body, [_number(values[angle]) for angle in angles])
        for angle, both in zip(angles, results, strict=True):
            values.update(zip(pairs[angle], both, strict=True))
    for k in range(len(graph.nodes)):
        if k not in values:
            evaluate(k)
    return [values[k] for k in range(len(graph.nodes))]


def _before_sines(graph: Graph) -> list[int]:
    """Return the nodes that no sine or cosine goes into, in order."""
    found: set[int] = set()
    for k, node in enumerate(graph.nodes):
        is_source = node.operation in ("constant", "input")
        is_sine = node.operation in ("sin", "cos")
        if is_source or (not is_sine and found.issuperset(node.arguments)):
            found.add(k)
    return sorted(found)


def _sincos_in_lanes(body: Body, angles: Sequence[Vector]) -> list[tuple[Vector, Vector]]:
    """Return sine and cosine of single numbers, computed as the lanes of vectors."""
    results: list[tuple[Vector, Vector]] = []
    lanes = Body(body.liberties, WIDTH, body.lines)
    for start in range(0, len(angles), WIDTH):
        part = angles[start : start + WIDTH]
        name = "poison"
        for lane in range(WIDTH):
            # Lanes that are left over repeat the last angle.
            angle = part[min(lane, len(part) - 1)]
            insert = f"insertelement {lanes.number_type} {name}, double {angle.name}, i64 {lane}"
            name = body.define(insert)
        sine, cosine = sincos(Vector(lanes, name))

        def entry(of: Vector, lane: int) -> Vector:
            extract = f"extractelement {lanes.number_type} {of.name}, i64 {lane}"
            return Vector(body, body.define(extract))

        results += [(entry(sine, lane), entry(cosine, lane)) for lane in range(len(part))]
    return results


def _apply(operation: str, arguments: Sequence[_Value]) -> _Value:
    if operation == "select":
        condition, true, false = arguments
        return select(_mask(condition), _number(true), _number(false))
    if operation in _LOGICAL:
        return _LOGICAL[operation](*map(_mask, arguments))
    return _NUMERIC[operation](*map(_number, arguments))


def _number(value: _Value) -> Vector:
    """Return a value as numbers: 1 for true, 0 for false."""
    return (
        value
        if isinstance(value, Vector)
        else select(value, Vector(value.body, value.body.constant(1.0)), 0.0)
    )


def _numbers(values: Sequence[_Value], places: Sequence[int]) -> list[Vector]:
    return [_number(values[place]) for place in places]


def _mask(value: _Value) -> Mask:
    """Return a value as truth values: numbers other than 0 are true."""
    return value if isinstance(value, Mask) else value.differs(0.0)


def _broadcast(k: int) -> Iterator[str]:
    """Yield the lines that copy parameter K into all lanes of ``%pK``."""
    yield f"  %p{k}_at = getelementptr double, ptr %parameters, i64 {k}"
    yield f"  %p{k}_value = load double, ptr %p{k}_at"
    vector = f"<{WIDTH} x double>"
    yield f"  %p{k}_lane = insertelement {vector} poison, double %p{k}_value, i64 0"
    yield f"  %p{k} = shufflevector {vector} %p{k}_lane, {vector} poison, <{WIDTH} x i32> zeroinitializer"


def _array(k: int, name: str) -> Iterator[str]:
    """Yield the lines that read an array's address."""
    yield f"  {name}_at = getelementptr ptr, ptr %arrays, i64 {k}"
    yield f"  {name} = load ptr, ptr {name}_at"


def _address(body: Body, row: int, block: int) -> str:
    """Return the address of the current vector in a row."""
    # work[row block + item], of doubles: the items of a row are neighbours.
    start = body.define(f"getelementptr double, ptr %work, i64 {row * block}")
    return body.define(f"getelementptr double, ptr {start}, i64 %item")


def _loaded(body: Body, rows: Sequence[int], block: int) -> list[Vector]:
    """Return the current vectors of rows."""
    values = []
    for row in rows:
        address = _address(body, row, block)
        load = f"load {body.number_type}, ptr {address}, align 64"
        values.append(Vector(body, body.define(load)))
    return values


def _copied(
    label: str,
    before: str,
    array: str,
    rows: Sequence[int],
    block: int,
    kind: str,
    *,
    reading: bool,
) -> Iterator[str]:
    """Yield a loop over a block's items that copies rows of ``array`` into the block, or back.

    Parameters
    ----------
    label
        Label of the loop; it ends in LABEL_end, from where the caller jumps on.
    before
        The label that jumps here.
    array
        The array's pointer.
    rows
        The block's row for each entry of an item.
    block
        Number of items of a block.
    kind
        LLVM's type of the array's entries.
    reading
        Whether the array is copied into the block; otherwise the block is copied back.
    """
    yield f"{label}:"
    yield f"  %{label}_i = phi i64 [0, %{before}], [%{label}_next, %{label}]"
    yield f"  %{label}_item = add i64 %start, %{label}_i"
    yield f"  %{label}_offset = mul i64 %{label}_item, {len(rows)}"
    yield f"  %{label}_entries = getelementptr {kind}, ptr {array}, i64 %{label}_offset"
    yield f"  %{label}_column = getelementptr double, ptr %work, i64 %{label}_i"
    # array[(start + i) size + k] <-> work[row_k block + i] for item i of the block and entry k: a transposition.
    for k, row in enumerate(rows):
        outer = f"%{label}_outer{k}"
        inner = f"%{label}_inner{k}"
        value = f"%{label}_value{k}"
        yield f"  {outer} = getelementptr {kind}, ptr %{label}_entries, i64 {k}"
        yield f"  {inner} = getelementptr double, ptr %{label}_column, i64 {row * block}"
        yield f"  {value} = load double, ptr {outer if reading else inner}"
        if kind != "double":
            # In two steps, because the processor's instruction converts to 32 bits.
            yield f"  {value}_wide = fptosi double {value} to i32"
            value = f"{value}_whole"
            yield f"  {value} = trunc i32 %{label}_value{k}_wide to {kind}"
        yield f"  store {kind} {value}, ptr {inner if reading else outer}"
    yield f"  %{label}_next = add i64 %{label}_i, 1"
    yield f"  %{label}_more = icmp slt i64 %{label}_next, %size"
    yield f"  br i1 %{label}_more, label %{label}, label %{label}_end"
    yield f"{label}_end:"
