"""A kernel as text of LLVM's intermediate representation: blocks of items in lanes, as a structure of arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, groupby, islice

from dhkit.kernels.lowering import SMALL_INTEGER, STORED, loop_values, result_values
from dhkit.kernels.vectors import EXACT, FUSING, WIDTH, Body, Vector
from dhkit.symbolic import Graph, Loop

_BLOCK = 64
"""Largest number of items of a block: 8 vectors of 8 doubles."""
_BLOCK_BYTES = 16 * 1024
"""Largest size of a block of more than one vector.

A first-level cache, 32 KB or more, has to hold the block, the program's spilled registers and the arrays' lines.
"""

_SIZES = {"double": 8, "i8": 1}
"""Size of an array's entry by LLVM's name of its type, bytes."""


@dataclass(frozen=True)
class _Layout:
    """Rows of a block for the entries of a program's variables; a row has ``block`` doubles.

    Entries of an output that are the same node, such as those that are always 0 and both triangles of a symmetric
    matrix, share a row.
    """

    program: Graph | Loop

    @cached_property
    def inputs(self) -> list[list[int]]:
        """The row of each entry of each input after the parameters."""
        variables = self.program.inputs[1:]
        rows = iter(range(sum(variable.size for variable in variables)))
        return [list(islice(rows, variable.size)) for variable in variables]

    @cached_property
    def outputs(self) -> list[list[int]]:
        """The row of each entry of each output."""
        first = sum(map(len, self.inputs))
        rows: dict[tuple[int, int], int] = {}
        outputs = []
        last = self.program.finish if isinstance(self.program, Loop) else self.program
        for k, places in enumerate(last.results):
            outputs.append([rows.setdefault((k, place), first + len(rows)) for place in places])
        return outputs

    @property
    def block(self) -> int:
        """Number of items of a block: its rows fill at most ``_BLOCK_BYTES``, in whole vectors."""
        rows = 1 + max(chain.from_iterable((*self.inputs, *self.outputs)))
        fitting = _BLOCK_BYTES // (8 * rows) // WIDTH * WIDTH
        return max(WIDTH, min(fitting, _BLOCK))


def work_size(columns: int) -> int:
    """Return the size of a kernel's work array, in doubles, from the number of all its inputs' and outputs' columns."""
    # A block has at most a row for each column; it is one vector wide, or fills at most _BLOCK_BYTES.
    return max(WIDTH * columns, _BLOCK_BYTES // 8)


def llvm_source(program: Graph | Loop, types: Sequence[str]) -> str:
    """Return a module with ``void kernel(double *parameters, void **arrays, double *work, int64 count)``.

    ``arrays`` holds the addresses of inputs, then outputs: (count, size) each, row by row. They are transposed block by
    block in ``work`` (of :func:`work_size` doubles, aligned to 64 bytes), so that every load and store of the program
    is of neighbouring items. Where an item's input is not finite, its float results are NaN.

    Parameters
    ----------
    program
        The program; its first input holds the parameters, which all items share.
    types
        Type of each output: ``FLOAT``, or ``SMALL_INTEGER`` for whole numbers from 0 to 255.
    """
    # Programs that decide small integers round every operation as the interpreter does, so that both decide alike.
    layout = _Layout(program)
    body = Body(EXACT if SMALL_INTEGER in types else FUSING)
    results = _results(program, layout, body, types)
    inputs = [f"%x{k}" for k in range(len(program.inputs) - 1)]
    outputs = [f"%y{k}" for k in range(len(program.outputs))]
    lines = [
        *body.declarations(),
        "define void @kernel(ptr %parameters, ptr %arrays, ptr %work, i64 %count) {",
        "entry:",
        *chain.from_iterable(_array(k, name) for k, name in enumerate((*inputs, *outputs))),
        *chain.from_iterable(map(_broadcast, range(program.inputs[0].size))),
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
        f"  %item = phi i64 [0, %read{len(inputs) - 1}_end], [%next_item, %computed]",
        *body.lines,
        *results,
        "  br label %computed",
        "computed:",
        f"  %next_item = add i64 %item, {WIDTH}",
        "  %computing = icmp slt i64 %next_item, %size",
        "  br i1 %computing, label %compute, label %write0",
    ]
    for k, name in enumerate(outputs):
        before = f"write{k - 1}_end" if k else "computed"
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


def _results(program: Graph | Loop, layout: _Layout, body: Body, types: Sequence[str]) -> list[str]:
    """Write the program's operations into ``body`` and return the lines that store its results."""
    states = [_loaded(body, rows, layout.block) for rows in layout.inputs]
    parameters = [Vector(body, f"%p{k}") for k in range(program.inputs[0].size)]
    results: dict[int, Vector] = {}
    if isinstance(program, Loop):
        outputs = loop_values(program, body, [parameters, *states], _lanes_with_items(body))
    else:
        outputs = result_values(program, body, [parameters, *states], types)
    for rows, entries in zip(layout.outputs, outputs, strict=True):
        results.update(zip(rows, entries, strict=True))
    lines = []
    for row, result in results.items():
        address = _address(body, row, layout.block)
        lines.append(f"  store {body.number_type} {result.name}, ptr {address}, align 64")
    return lines


def _lanes_with_items(body: Body) -> str:
    """Return the name of the truth values that tell which lanes have an item: the last vector may be partly filled."""
    numbers = f"<{WIDTH} x i64>"
    filled = []
    for name in ("%item", "%size"):
        lane = body.define(f"insertelement {numbers} poison, i64 {name}, i64 0")
        shuffle = f"shufflevector {numbers} {lane}, {numbers} poison, <{WIDTH} x i32>"
        filled.append(body.define(f"{shuffle} zeroinitializer"))
    first, end = filled
    lanes = ", ".join(f"i64 {lane}" for lane in range(WIDTH))
    item = body.define(f"add {numbers} {first}, <{lanes}>")
    return body.define(f"icmp slt {numbers} {item}, {end}")


def _broadcast(k: int) -> Iterator[str]:
    """Yield the lines that copy parameter K into all lanes of ``%pK``."""
    yield f"  %p{k}_at = getelementptr double, ptr %parameters, i64 {k}"
    yield f"  %p{k}_value = load double, ptr %p{k}_at"
    yield from _copies(f"%p{k}", f"%p{k}_value", "double", WIDTH)


def _copies(name: str, value: str, kind: str, lanes: int) -> Iterator[str]:
    """Yield the lines that copy a value into all lanes of the vector ``name``."""
    vector = f"<{lanes} x {kind}>"
    yield f"  {name}_lane = insertelement {vector} poison, {kind} {value}, i64 0"
    shuffle = f"shufflevector {vector} {name}_lane, {vector} poison"
    yield f"  {name} = {shuffle}, <{lanes} x i32> zeroinitializer"


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
    for k, row, length in _runs(rows):
        outer = f"%{label}_outer{k}"
        inner = f"%{label}_inner{k}"
        value = f"%{label}_value{k}"
        yield f"  {outer} = getelementptr {kind}, ptr %{label}_entries, i64 {k}"
        yield f"  {inner} = getelementptr double, ptr %{label}_column, i64 {row * block}"
        yield f"  {value} = load double, ptr {outer if reading else inner}"
        stored = kind
        if kind != "double":
            # In two steps, because the processor's instruction converts to 32 bits.
            yield f"  {value}_wide = fptosi double {value} to i32"
            yield f"  {value}_whole = trunc i32 {value}_wide to {kind}"
            value = f"{value}_whole"
        if length > 1:
            yield from _copies(f"{value}_copies", value, kind, length)
            value = f"{value}_copies"
            stored = f"<{length} x {kind}>"
        yield f"  store {stored} {value}, ptr {inner if reading else outer}, align {_SIZES[kind]}"
    yield f"  %{label}_next = add i64 %{label}_i, 1"
    yield f"  %{label}_more = icmp slt i64 %{label}_next, %size"
    yield f"  br i1 %{label}_more, label %{label}, label %{label}_end"
    yield f"{label}_end:"


def _runs(rows: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """Yield the first entry, the row and the length of each run of entries that share a row."""
    first = 0
    for row, run in groupby(rows):
        length = len(list(run))
        yield first, row, length
        first += length
