"""A program as text of LLVM's intermediate representation of a C function that Python calls with arrays.

It serves calls for one state or a few, whose cost is Python's: checking and converting arguments and allocating the
result take twenty times as long as the program. Here they are loads and comparisons on NumPy's array struct.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import prod

from dhkit.kernels.llvm_source import FLOAT, result_values
from dhkit.kernels.vectors import FUSING, Body, Vector
from dhkit.symbolic import Graph

MAX_ITEMS = 64
"""Largest number of items of a call; for larger batches, the vector kernel is faster."""

CONTEXT = (
    "array_type",
    "float_type",
    "new_array",
    "add_reference",
    "drop_reference",
    "none",
    "parameters",
)
"""Addresses that the function reads from its context, the array that Python binds to it, in this order.

The class ``numpy.ndarray``, the object of the type float64, the functions ``PyArray_New``, ``Py_IncRef`` and
``Py_DecRef``, the object ``None``, and the arm's parameters. They differ between processes, so that machine code, which
is kept on disk, contains none of them.
"""

# Byte offsets in NumPy's PyArrayObject_fields on 64-bit machines: ob_refcnt and ob_type of the object's header first.
TYPE_OFFSET = 8
DATA_OFFSET = 16
AXES_OFFSET = 24
SHAPE_OFFSET = 32
DTYPE_OFFSET = 56
FLAGS_OFFSET = 64

_C_CONTIGUOUS = 0x0001
_ALIGNED = 0x0100
_WRITEABLE = 0x0400
_WARN_ON_WRITE = 0x80000000
"""Flags of NumPy's arrays; the last one is set on arrays that only seem to be writeable."""

_FLOAT64 = 12
"""NumPy's number of the type float64."""


@dataclass
class _Function:
    """Lines of a function in which checks jump to the label ``other``."""

    lines: list[str] = field(default_factory=list)
    checks: int = 0

    def label(self, name: str) -> None:
        self.lines.append(f"{name}:")

    def add(self, *lines: str) -> None:
        self.lines += [f"  {line}" for line in lines]

    def require(self, condition: str) -> None:
        """Jump to ``other`` unless a truth value holds."""
        self.checks += 1
        passed = f"checked{self.checks}"
        self.add(f"br i1 {condition}, label %{passed}, label %other")
        self.label(passed)

    def load(self, name: str, kind: str, base: str, offset: int) -> None:
        """Define %NAME as the value at a byte offset from a pointer."""
        self.add(
            f"%{name}_at = getelementptr i8, ptr {base}, i64 {offset}",
            f"%{name} = load {kind}, ptr %{name}_at",
        )

    def require_array(self, name: str, pointer: str, *, writeable: bool = False) -> None:
        """Check that an object is an ndarray of float64, contiguous; define %NAME_data, _axes and _shape."""
        self.load(f"{name}_type", "ptr", pointer, TYPE_OFFSET)
        self.add(f"%{name}_is_array = icmp eq ptr %{name}_type, %array_type")
        self.require(f"%{name}_is_array")
        self.load(f"{name}_dtype", "ptr", pointer, DTYPE_OFFSET)
        self.load(f"{name}_flags", "i32", pointer, FLAGS_OFFSET)
        wanted = _C_CONTIGUOUS | _ALIGNED | (_WRITEABLE if writeable else 0)
        looked_at = wanted | (_WARN_ON_WRITE if writeable else 0)
        self.add(
            f"%{name}_is_float = icmp eq ptr %{name}_dtype, %float_type",
            f"%{name}_kept = and i32 %{name}_flags, {looked_at}",
            f"%{name}_has_layout = icmp eq i32 %{name}_kept, {wanted}",
            f"%{name}_fits = and i1 %{name}_is_float, %{name}_has_layout",
        )
        self.require(f"%{name}_fits")
        self.load(f"{name}_data", "ptr", pointer, DATA_OFFSET)
        self.load(f"{name}_axes", "i32", pointer, AXES_OFFSET)
        self.load(f"{name}_shape", "ptr", pointer, SHAPE_OFFSET)


def call_source(graph: Graph, tail: Sequence[int], *, refuses_nan: bool) -> str:
    """Return a module with ``PyObject *call(PyObject *context, PyObject *const *arguments, Py_ssize_t count)``.

    The arguments are one array for each input after the parameters, and ``out`` or None. Taken are arrays of float64,
    C-contiguous, of shape (size,), or (N, size) with N from 1 to ``MAX_ITEMS``, all alike, and an ``out`` of the
    result's shape. The result is ``out`` or a new array; None of arguments that are not taken, which stay unchanged.
    Results are NaN by the rule of :func:`dhkit.kernels.llvm_source.llvm_source`.

    Parameters
    ----------
    graph
        A program with one output; its first input holds the parameters.
    tail
        Axes of the result after those of the batch.
    refuses_nan
        Whether a result with an entry that is not finite counts as arguments that are not taken.
    """
    return "\n".join([*_program(graph, refuses_nan), *_call(graph, tail), ""])


def _program(graph: Graph, refuses_nan: bool) -> list[str]:
    """Return the lines of ``run``, which computes one item; of a refused NaN it writes nothing and returns false."""
    body = Body(FUSING, width=1)

    def loaded(pointer: str, size: int) -> list[Vector]:
        values = []
        for k in range(size):
            place = body.define(f"getelementptr double, ptr {pointer}, i64 {k}")
            values.append(Vector(body, body.define(f"load double, ptr {place}")))
        return values

    pointers = ["%parameters", *(f"%x{k}" for k in range(len(graph.inputs) - 1))]
    inputs = [
        loaded(pointer, variable.size)
        for pointer, variable in zip(pointers, graph.inputs, strict=True)
    ]
    (results,) = result_values(graph, body, inputs, [FLOAT])
    stores = ["  br label %store"]
    if refuses_nan:
        # x - x is 0, and NaN where x is not finite.
        total = results[0] - results[0]
        for x in results[1:]:
            total = total + (x - x)
        stores = [f"  br i1 {total.equals(0.0).name}, label %store, label %refused"]
    stores.append("store:")
    for k, result in enumerate(results):
        stores += [
            f"  %y{k} = getelementptr double, ptr %y, i64 {k}",
            f"  store double {result.name}, ptr %y{k}",
        ]
    signature = ", ".join(f"ptr {pointer}" for pointer in (*pointers, "%y"))
    return [
        *body.declarations(),
        *Body().declarations(),
        f"define internal i1 @run({signature}) {{",
        *body.lines,
        *stores,
        "  ret i1 true",
        "refused:",
        "  ret i1 false",
        "}",
    ]


def _call(graph: Graph, tail: Sequence[int]) -> list[str]:
    """Return the lines of ``call``."""
    sizes = [variable.size for variable in graph.inputs[1:]]
    function = _Function()
    function.add(f"%has_count = icmp eq i64 %count, {len(sizes) + 1}")
    function.require("%has_count")
    function.load("context_data", "ptr", "%context", DATA_OFFSET)
    for k, name in enumerate(CONTEXT):
        function.load(name, "ptr", "%context_data", 8 * k)

    # Inputs: (size,) or (N, size), with the same batch axis.
    for k, size in enumerate(sizes):
        function.load(f"x{k}", "ptr", "%arguments", 8 * k)
        function.require_array(f"x{k}", f"%x{k}")
        if k == 0:
            function.add(
                "%is_single = icmp eq i32 %x0_axes, 1",
                "%is_batch = icmp eq i32 %x0_axes, 2",
                "%has_axes = or i1 %is_single, %is_batch",
            )
        else:
            function.add(f"%x{k}_has_axes = icmp eq i32 %x{k}_axes, %x0_axes")
        function.require("%has_axes" if k == 0 else f"%x{k}_has_axes")
        function.add(
            f"%x{k}_last = select i1 %is_single, i64 0, i64 1",
            f"%x{k}_size_at = getelementptr i64, ptr %x{k}_shape, i64 %x{k}_last",
            f"%x{k}_size = load i64, ptr %x{k}_size_at",
            f"%x{k}_has_size = icmp eq i64 %x{k}_size, {size}",
            f"%x{k}_first = load i64, ptr %x{k}_shape",
            f"%x{k}_items = select i1 %is_single, i64 1, i64 %x{k}_first",
        )
        function.require(f"%x{k}_has_size")
        if k == 0:
            # One comparison without sign for 1 <= N <= MAX_ITEMS.
            function.add(
                "%x0_items_less_1 = sub i64 %x0_items, 1",
                f"%x0_has_items = icmp ult i64 %x0_items_less_1, {MAX_ITEMS}",
            )
        else:
            function.add(f"%x{k}_has_items = icmp eq i64 %x{k}_items, %x0_items")
        function.require(f"%x{k}_has_items")

    # The result: out, or a new array of shape (*tail) or (N, *tail).
    function.load("out", "ptr", "%arguments", 8 * len(sizes))
    function.add(
        "%is_new = icmp eq ptr %out, %none", "br i1 %is_new, label %allocate, label %check_out"
    )
    function.label("check_out")
    function.require_array("out", "%out", writeable=True)
    function.add(
        f"%out_item_axes = add i32 %x0_axes, {len(tail) - 1}",
        "%out_has_axes = icmp eq i32 %out_axes, %out_item_axes",
    )
    function.require("%out_has_axes")
    function.add("%out_start = select i1 %is_single, i64 0, i64 1")
    for k, size in enumerate(tail):
        function.add(
            f"%out_axis{k} = add i64 %out_start, {k}",
            f"%out_size{k}_at = getelementptr i64, ptr %out_shape, i64 %out_axis{k}",
            f"%out_size{k} = load i64, ptr %out_size{k}_at",
            f"%out_has_size{k} = icmp eq i64 %out_size{k}, {size}",
        )
        function.require(f"%out_has_size{k}")
    function.add(
        "%out_first = load i64, ptr %out_shape",
        "%out_items = select i1 %is_single, i64 1, i64 %out_first",
        "%out_has_items = icmp eq i64 %out_items, %x0_items",
    )
    function.require("%out_has_items")
    function.add("br i1 %is_single, label %use_out, label %check_overlap")

    # One item is read before it is written. Of a batch, memory that out shares with an input would be read too late.
    function.label("check_overlap")
    _require_no_overlap(function, sizes, prod(tail))
    function.add("br label %use_out")
    function.label("use_out")
    function.add("call void %add_reference(ptr %out)", "br label %compute")

    function.label("allocate")
    function.add(
        f"%shape = alloca i64, i64 {len(tail) + 1}",
        "store i64 %x0_items, ptr %shape",
        *_stored_sizes(tail),
        f"%new_axes = select i1 %is_single, i32 {len(tail)}, i32 {len(tail) + 1}",
        "%new_start = select i1 %is_single, i64 1, i64 0",
        "%new_shape = getelementptr i64, ptr %shape, i64 %new_start",
        f"%new = call ptr %new_array(ptr %array_type, i32 %new_axes, ptr %new_shape, i32 {_FLOAT64},"
        " ptr null, ptr null, i32 0, i32 0, ptr null)",
        "%is_out_of_memory = icmp eq ptr %new, null",
        "br i1 %is_out_of_memory, label %failed, label %compute",
    )

    function.label("compute")
    function.add("%result = phi ptr [%out, %use_out], [%new, %allocate]")
    function.load("y", "ptr", "%result", DATA_OFFSET)
    function.add("br label %item")
    function.label("item")
    function.add("%k = phi i64 [0, %compute], [%next, %computed]")
    for name, size in (*((f"x{k}", size) for k, size in enumerate(sizes)), ("y", prod(tail))):
        pointer = "%y" if name == "y" else f"%{name}_data"
        function.add(
            f"%{name}_offset = mul i64 %k, {size}",
            f"%{name}_item = getelementptr double, ptr {pointer}, i64 %{name}_offset",
        )
    items = ", ".join(f"ptr %x{k}_item" for k in range(len(sizes)))
    function.add(
        f"%is_done = call i1 @run(ptr %parameters, {items}, ptr %y_item)",
        "br i1 %is_done, label %computed, label %refused",
    )
    function.label("computed")
    function.add(
        "%next = add i64 %k, 1",
        "%has_more = icmp slt i64 %next, %x0_items",
        "br i1 %has_more, label %item, label %finished",
    )
    function.label("finished")
    function.add("ret ptr %result")
    function.label("failed")
    function.add("ret ptr null")
    function.label("refused")
    function.add("call void %drop_reference(ptr %result)", "br label %other")
    function.label("other")
    # Checks before the context was read end here too.
    function.load("own_data", "ptr", "%context", DATA_OFFSET)
    for name in ("none", "add_reference"):
        function.load(f"own_{name}", "ptr", "%own_data", 8 * CONTEXT.index(name))
    function.add("call void %own_add_reference(ptr %own_none)", "ret ptr %own_none")
    return [
        "define ptr @call(ptr %context, ptr %arguments, i64 %count) {",
        "entry:",
        *function.lines,
        "}",
    ]


def _stored_sizes(tail: Sequence[int]) -> list[str]:
    lines = []
    for k, size in enumerate(tail):
        lines += [
            f"%shape{k} = getelementptr i64, ptr %shape, i64 {k + 1}",
            f"store i64 {size}, ptr %shape{k}",
        ]
    return lines


def _require_no_overlap(function: _Function, sizes: Sequence[int], result_size: int) -> None:
    """Check that a batch's ``out`` and its inputs lie in different memory: one ends before the other begins."""
    function.add(
        f"%out_count = mul i64 %x0_items, {result_size}",
        "%out_end = getelementptr double, ptr %out_data, i64 %out_count",
    )
    for k, size in enumerate(sizes):
        function.add(
            f"%x{k}_count = mul i64 %x0_items, {size}",
            f"%x{k}_end = getelementptr double, ptr %x{k}_data, i64 %x{k}_count",
            f"%x{k}_is_before = icmp ule ptr %x{k}_end, %out_data",
            f"%x{k}_is_after = icmp ule ptr %out_end, %x{k}_data",
            f"%x{k}_is_apart = or i1 %x{k}_is_before, %x{k}_is_after",
        )
        function.require(f"%x{k}_is_apart")
