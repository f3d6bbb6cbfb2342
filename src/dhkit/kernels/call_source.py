"""A program as text of LLVM's intermediate representation of a C function that Python calls with arrays.

It serves calls for one state or a short batch, whose cost is Python's: checking and converting arguments and allocating
the result take twenty times as long as the program. Here they are loads and comparisons on NumPy's array struct.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import prod

from dhkit.kernels.llvm_source import work_size
from dhkit.kernels.lowering import FLOAT, SMALL_INTEGER
from dhkit.kernels.scalar_source import run_source
from dhkit.symbolic import Graph, Program

MAX_ITEMS = 64
"""Largest number of items of a call that computes them one after the other, or while it holds Python's lock."""
MAX_IN_LANES = 1_024
"""Largest number of items of a call that passes them to the vector kernel."""
_FEWEST_IN_LANES = 4
"""Smallest number of items for the vector kernel; fewer are faster one after the other."""
_MOST_NEW_BYTES = 4 << 20
"""Largest new result: the ordinary way uses the memory of larger ones again."""

CONTEXT = (
    "array_type",
    "float_type",
    "none",
    "parameters",
    "PyArray_New",
    "python_float",
    "PyBytes_FromStringAndSize",
    "PyTuple_Pack",
    "Py_IncRef",
    "Py_DecRef",
    "PyEval_SaveThread",
    "PyEval_RestoreThread",
    "PyMem_RawMalloc",
    "PyMem_RawFree",
    "kernel",
)
"""Addresses that the function reads from its context, the array that Python binds to it, in this order.

The class ``numpy.ndarray``, the object of the type float64, ``None``, the arm's parameters, functions of NumPy and
Python, and the vector kernel where :func:`takes_lanes`. They differ between processes, so that machine code, which is
kept on disk, contains none of them.
"""

# Byte offsets in NumPy's PyArrayObject_fields on 64-bit machines: ob_refcnt and ob_type of the object's header first.
TYPE_OFFSET = 8
DATA_OFFSET = 16
AXES_OFFSET = 24
SHAPE_OFFSET = 32
DTYPE_OFFSET = 56
FLAGS_OFFSET = 64
FLOAT_OFFSET = 16
"""Where the value of a Python ``float`` lies."""
_BYTES_OFFSET = 32
"""Where the content of a ``bytes`` object begins."""

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

    def require_number(self, name: str, pointer: str) -> None:
        """Check that an object is a float of a single item, or an array of shape () or (%items,); define %NAME_data."""
        self.load(f"{name}_class", "ptr", pointer, TYPE_OFFSET)
        self.add(
            f"%{name}_is_number = icmp eq ptr %{name}_class, %python_float",
            f"br i1 %{name}_is_number, label %{name}_number, label %{name}_array",
        )
        self.label(f"{name}_number")
        self.require("%is_single")
        self.add(
            f"%{name}_own = getelementptr i8, ptr {pointer}, i64 {FLOAT_OFFSET}",
            f"br label %{name}_own_end",
        )
        self.label(f"{name}_own_end")
        self.add(f"br label %{name}_known")

        self.label(f"{name}_array")
        self.require_array(f"{name}_in_array", pointer)
        self.require_shape(f"{name}_in_array", ())
        self.add(f"br label %{name}_array_end")
        self.label(f"{name}_array_end")
        self.add(f"br label %{name}_known")

        self.label(f"{name}_known")
        self.add(
            f"%{name}_data = phi ptr [%{name}_own, %{name}_own_end], [%{name}_in_array_data, %{name}_array_end]"
        )

    def require_shape(self, name: str, shape: Sequence[int]) -> None:
        """Check the shape of an array: (*shape) of a single item, (%items, *shape) of a batch."""
        self.add(
            f"%{name}_wanted_axes = add i32 %batch_axes, {len(shape)}",
            f"%{name}_has_axes = icmp eq i32 %{name}_axes, %{name}_wanted_axes",
        )
        self.require(f"%{name}_has_axes")
        self.add(
            f"%{name}_first = load i64, ptr %{name}_shape",
            f"%{name}_items = select i1 %is_single, i64 1, i64 %{name}_first",
            f"%{name}_has_items = icmp eq i64 %{name}_items, %items",
        )
        self.require(f"%{name}_has_items")
        self.add(f"%{name}_sizes = getelementptr i64, ptr %{name}_shape, i64 %batch_axes_wide")
        for k, size in enumerate(shape):
            self.add(
                f"%{name}_size{k}_at = getelementptr i64, ptr %{name}_sizes, i64 {k}",
                f"%{name}_size{k} = load i64, ptr %{name}_size{k}_at",
                f"%{name}_has_size{k} = icmp eq i64 %{name}_size{k}, {size}",
            )
            self.require(f"%{name}_has_size{k}")


def state_shapes(program: Program) -> list[tuple[int, ...]]:
    """Return the shapes of a program's inputs after the parameters; CasADi's columns are vectors."""
    shapes = [variable.shape for variable in program.inputs[1:]]
    return [shape[:1] if shape[1:] == (1,) else shape for shape in shapes]


def takes_lanes(program: Program) -> bool:
    """Return whether a call of a program passes batches to the vector kernel."""
    return isinstance(program, Graph) and len(program.outputs) == 1


def call_source(
    program: Program, types: Sequence[str], tail: Sequence[int], *, refuses_nan: bool
) -> str:
    """Return a module with ``PyObject *call(PyObject *context, PyObject *const *arguments, Py_ssize_t count)``.

    The arguments are one array for each input after the parameters, and ``out`` or None. Taken are arrays of float64,
    C-contiguous, of the inputs' shapes, or all with a batch axis of 1 to ``MAX_ITEMS`` items before it
    (``MAX_IN_LANES`` where :func:`takes_lanes`), and an ``out`` of the result's shape. An input of shape (), but not
    the first one, may be a float where the others are of a single item. The result is ``out`` or a new array; None of
    arguments that are not taken, which stay unchanged. Results are NaN by the rule of
    :func:`dhkit.kernels.llvm_source.llvm_source`.

    Of a program with several outputs, the first one is that array, and the others are the content of a ``bytes``
    object, item after item. The result is the pair of both.

    Parameters
    ----------
    program
        A program; its first input holds the parameters.
    types
        Types of its outputs, see :func:`dhkit.kernels.llvm_source.llvm_source`; the first is float64.
    tail
        Axes of the result after those of the batch.
    refuses_nan
        Whether a result with an entry that is not finite counts as arguments that are not taken.
    """
    run = run_source(program, types, refuses_nan=refuses_nan)
    return "\n".join([*run, *_call(program, types, tail, refuses_nan), ""])


_BYTES = {FLOAT: 8, SMALL_INTEGER: 1}
"""Sizes of an entry in bytes, by type."""


def _call(
    program: Program, types: Sequence[str], tail: Sequence[int], refuses_nan: bool
) -> list[str]:
    """Return the lines of ``call``."""
    shapes = state_shapes(program)
    is_packing = len(types) > 1
    in_lanes = takes_lanes(program)
    variables = list(zip(types[1:], program.outputs[1:], strict=True))
    item_bytes = 0
    function = _Function()
    function.add(f"%has_count = icmp eq i64 %count, {len(shapes) + 1}")
    function.require("%has_count")
    function.load("context_data", "ptr", "%context", DATA_OFFSET)
    for k, name in enumerate(CONTEXT):
        function.load(name, "ptr", "%context_data", 8 * k)

    # Whether the first input is a single item or a batch decides about all.
    function.load("x0", "ptr", "%arguments", 0)
    function.require_array("x0", "%x0")
    function.add(
        f"%is_single = icmp eq i32 %x0_axes, {len(shapes[0])}",
        "%batch_axes = select i1 %is_single, i32 0, i32 1",
        "%batch_axes_wide = zext i32 %batch_axes to i64",
        "%x0_has_first_axis = icmp sgt i32 %x0_axes, 0",
    )
    function.require("%x0_has_first_axis")
    function.add(
        "%x0_first_size = load i64, ptr %x0_shape",
        "%items = select i1 %is_single, i64 1, i64 %x0_first_size",
        # One comparison without sign for 1 <= items <= most.
        "%items_less_1 = sub i64 %items, 1",
        f"%has_few_items = icmp ult i64 %items_less_1, {MAX_IN_LANES if in_lanes else MAX_ITEMS}",
    )
    function.require("%has_few_items")
    for k, shape in enumerate(shapes):
        if k:
            function.load(f"x{k}", "ptr", "%arguments", 8 * k)
            if not shape:
                function.require_number(f"x{k}", f"%x{k}")
                continue
            function.require_array(f"x{k}", f"%x{k}")
        function.require_shape(f"x{k}", shape)

    # The result: out, or a new array of shape (*tail) or (items, *tail).
    function.load("out", "ptr", "%arguments", 8 * len(shapes))
    function.add(
        "%is_new = icmp eq ptr %out, %none", "br i1 %is_new, label %allocate, label %check_out"
    )
    function.label("check_out")
    function.require_array("out", "%out", writeable=True)
    function.require_shape("out", tail)
    function.add("br i1 %is_single, label %use_out, label %check_overlap")

    # One item is read before it is written. Of a batch, memory that out shares with an input would be read too late.
    function.label("check_overlap")
    _require_no_overlap(function, [prod(shape) for shape in shapes], prod(tail))
    function.add("br label %use_out")
    function.label("use_out")
    function.add("call void %Py_IncRef(ptr %out)", "br label %compute")

    function.label("allocate")
    most_new = _MOST_NEW_BYTES // (8 * max(1, prod(tail)))
    function.add(f"%is_small = icmp ule i64 %items, {most_new}")
    function.require("%is_small")
    function.add(
        f"%shape = alloca i64, i64 {len(tail) + 1}",
        "store i64 %items, ptr %shape",
        *_stored_sizes(tail),
        f"%new_axes = add i32 %batch_axes, {len(tail)}",
        "%new_start = sub i64 1, %batch_axes_wide",
        "%new_shape = getelementptr i64, ptr %shape, i64 %new_start",
        f"%new = call ptr %PyArray_New(ptr %array_type, i32 %new_axes, ptr %new_shape, i32 {_FLOAT64},"
        " ptr null, ptr null, i32 0, i32 0, ptr null)",
        "%is_out_of_memory = icmp eq ptr %new, null",
        "br i1 %is_out_of_memory, label %failed, label %new_array",
    )
    function.label("new_array")
    function.add("br label %compute")

    function.label("compute")
    function.add("%array = phi ptr [%out, %use_out], [%new, %new_array]")
    function.load("y", "ptr", "%array", DATA_OFFSET)
    if is_packing:
        item_bytes = sum(_BYTES[kind] * variable.size for kind, variable in variables)
        function.add(
            f"%byte_count = mul i64 %items, {item_bytes}",
            "%bytes = call ptr %PyBytes_FromStringAndSize(ptr null, i64 %byte_count)",
            "%has_no_bytes = icmp eq ptr %bytes, null",
            "br i1 %has_no_bytes, label %failed_after_array, label %with_bytes",
        )
        function.label("failed_after_array")
        function.add("call void %Py_DecRef(ptr %array)", "br label %failed")
        function.label("with_bytes")
        function.add(
            f"%packed = getelementptr i8, ptr %bytes, i64 {_BYTES_OFFSET}", "br label %first_item"
        )
    elif in_lanes:
        _compute_in_lanes(function, shapes, prod(tail), refuses_nan)
    else:
        function.add("br label %first_item")
    function.label("first_item")
    function.add("br label %item")
    function.label("item")
    function.add("%k = phi i64 [0, %first_item], [%next, %computed]")
    for name, size in (
        *((f"x{k}", prod(shape)) for k, shape in enumerate(shapes)),
        ("y", prod(tail)),
    ):
        pointer = "%y" if name == "y" else f"%{name}_data"
        function.add(
            f"%{name}_offset = mul i64 %k, {size}",
            f"%{name}_item = getelementptr double, ptr {pointer}, i64 %{name}_offset",
        )
    items = ", ".join(f"ptr %x{k}_item" for k in range(len(shapes)))
    outputs = ["ptr %y_item"]
    if is_packing:
        function.add(
            f"%packed_offset = mul i64 %k, {item_bytes}",
            "%packed_item = getelementptr i8, ptr %packed, i64 %packed_offset",
        )
        start = 0
        for k, (kind, variable) in enumerate(variables):
            function.add(f"%packed{k} = getelementptr i8, ptr %packed_item, i64 {start}")
            outputs.append(f"ptr %packed{k}")
            start += _BYTES[kind] * variable.size
    function.add(
        f"%is_done = call i1 @run(ptr %parameters, {items}, {', '.join(outputs)})",
        "br i1 %is_done, label %computed, label %refused",
    )
    function.label("computed")
    function.add(
        "%next = add i64 %k, 1",
        "%has_more = icmp slt i64 %next, %items",
        "br i1 %has_more, label %item, label %finished",
    )
    function.label("finished")
    if is_packing:
        function.add(
            "%pair = call ptr (i64, ...) %PyTuple_Pack(i64 2, ptr %array, ptr %bytes)",
            "call void %Py_DecRef(ptr %array)",
            "call void %Py_DecRef(ptr %bytes)",
            "ret ptr %pair",
        )
    else:
        function.add("ret ptr %array")
    function.label("failed")
    function.add("ret ptr null")
    function.label("refused")
    function.add("call void %Py_DecRef(ptr %array)")
    if is_packing:
        function.add("call void %Py_DecRef(ptr %bytes)")
    function.add("br label %other")
    function.label("other")
    # Checks before the context was read end here too.
    function.load("own_data", "ptr", "%context", DATA_OFFSET)
    function.load("own_none", "ptr", "%own_data", 8 * CONTEXT.index("none"))
    function.load("own_incref", "ptr", "%own_data", 8 * CONTEXT.index("Py_IncRef"))
    function.add("call void %own_incref(ptr %own_none)", "ret ptr %own_none")
    return [
        "define ptr @call(ptr %context, ptr %arguments, i64 %count) {",
        "entry:",
        *function.lines,
        "}",
    ]


def _compute_in_lanes(
    function: _Function, shapes: Sequence[Sequence[int]], size: int, refuses_nan: bool
) -> None:
    """Pass a batch of ``_FEWEST_IN_LANES`` items or more to the vector kernel; other items go to ``first_item``."""
    pointers = [*(f"%x{k}_data" for k in range(len(shapes))), "%y"]
    entries = sum(map(prod, shapes)) + size
    function.add(
        f"%is_batch = icmp uge i64 %items, {_FEWEST_IN_LANES}",
        "br i1 %is_batch, label %in_lanes, label %first_item",
    )
    function.label("in_lanes")
    function.add(
        f"%arrays = alloca ptr, i64 {len(pointers)}",
        # Not on the stack, which a thread may have little of. Without memory the items are computed one by one.
        f"%memory = call ptr %PyMem_RawMalloc(i64 {8 * work_size(entries) + 64})",
        "%has_no_memory = icmp eq ptr %memory, null",
        "br i1 %has_no_memory, label %first_item, label %with_memory",
    )
    function.label("with_memory")
    function.add(
        # The next address that is a multiple of 64.
        "%memory_address = ptrtoint ptr %memory to i64",
        "%negative_address = sub i64 0, %memory_address",
        "%skipped_bytes = and i64 %negative_address, 63",
        "%work = getelementptr i8, ptr %memory, i64 %skipped_bytes",
    )
    for k, pointer in enumerate(pointers):
        function.add(
            f"%array{k} = getelementptr ptr, ptr %arrays, i64 {k}",
            f"store ptr {pointer}, ptr %array{k}",
        )
    run = "call void %kernel(ptr %parameters, ptr %arrays, ptr %work, i64 %items)"
    function.add(
        f"%is_long = icmp ugt i64 %items, {MAX_ITEMS}",
        "br i1 %is_long, label %unlocked, label %locked",
    )
    function.label("locked")
    function.add(run, "br label %computed_in_lanes")
    # Other threads of Python run meanwhile, as in the ordinary way.
    function.label("unlocked")
    function.add(
        "%thread = call ptr %PyEval_SaveThread()",
        run,
        "call void %PyEval_RestoreThread(ptr %thread)",
        "br label %computed_in_lanes",
    )
    function.label("computed_in_lanes")
    function.add("call void %PyMem_RawFree(ptr %memory)")
    if not refuses_nan:
        function.add("br label %finished")
        return
    # The sum of y - y is 0, or NaN where an entry is not finite.
    function.add(f"%entries = mul i64 %items, {size}", "br label %entry_of_y")
    function.label("entry_of_y")
    function.add(
        "%j = phi i64 [0, %computed_in_lanes], [%next_j, %entry_of_y]",
        "%sum = phi double [0.0, %computed_in_lanes], [%next_sum, %entry_of_y]",
        "%yj_at = getelementptr double, ptr %y, i64 %j",
        "%yj = load double, ptr %yj_at",
        "%difference = fsub double %yj, %yj",
        "%next_sum = fadd double %sum, %difference",
        "%next_j = add i64 %j, 1",
        "%has_more_entries = icmp slt i64 %next_j, %entries",
        "br i1 %has_more_entries, label %entry_of_y, label %looked_at",
    )
    function.label("looked_at")
    function.add(
        "%is_finite = fcmp oeq double %next_sum, 0.0",
        "br i1 %is_finite, label %finished, label %refused",
    )


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
        f"%out_count = mul i64 %items, {result_size}",
        "%out_end = getelementptr double, ptr %out_data, i64 %out_count",
    )
    for k, size in enumerate(sizes):
        function.add(
            f"%x{k}_count = mul i64 %items, {size}",
            f"%x{k}_end = getelementptr double, ptr %x{k}_data, i64 %x{k}_count",
            f"%x{k}_is_before = icmp ule ptr %x{k}_end, %out_data",
            f"%x{k}_is_after = icmp ule ptr %out_end, %x{k}_data",
            f"%x{k}_is_apart = or i1 %x{k}_is_before, %x{k}_is_after",
        )
        function.require(f"%x{k}_is_apart")
