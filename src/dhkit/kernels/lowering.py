"""Operations of programs as lines of LLVM's intermediate representation, for one item or for the lanes of a vector."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import TypeAlias

from dhkit.kernels.elementary import atan2, maximum, minimum, sincos
from dhkit.kernels.vectors import (
    WIDTH,
    Body,
    Mask,
    Vector,
    absolute,
    floor,
    gathered,
    select,
    sqrt,
)
from dhkit.symbolic import Graph, Loop

FLOAT = "float64"
"""Type of an output's entries, by NumPy's name."""
SMALL_INTEGER = "uint8"
"""Type of the entries of an output of flags, by NumPy's name."""
STORED = {FLOAT: "double", SMALL_INTEGER: "i8"}
"""LLVM's names of these types."""

Value: TypeAlias = Vector | Mask
"""Numbers, or truth values."""

_NUMERIC: Mapping[str, Callable[..., Value]] = {
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
    missing = zero_or_missing(inputs)
    if missing is None:
        return outputs
    for k, kind in enumerate(types):
        if kind == FLOAT:
            outputs[k] = [entry + missing for entry in outputs[k]]
    return outputs


def zero_or_missing(inputs: Sequence[Sequence[Vector]]) -> Vector | None:
    """Return 0, or NaN where an entry of an input after the parameters is not finite; None without such inputs."""
    missing: Vector | None = None
    for x in chain.from_iterable(inputs[1:]):
        missing = x - x if missing is None else missing + (x - x)
    return missing


def plain_results(
    graph: Graph, body: Body, inputs: Sequence[Sequence[Vector]]
) -> list[list[Vector]]:
    """Write a program's operations into ``body``, as :func:`result_values`, without its rule for NaN."""
    values = _node_values(graph, body, inputs)
    return [_numbers(values, places) for places in graph.results]


def loop_values(
    loop: Loop, body: Body, inputs: Sequence[Sequence[Vector]], items: str = ""
) -> list[list[Vector]]:
    """Write a loop into ``body`` and return the entries of its outputs, which are known in the block ``finish``.

    In the lanes of a vector all items go on until the last is done; the states of those that are done stay.

    Parameters
    ----------
    loop
        The program.
    body
        Where the operations are written. The block that it is in becomes ``before``.
    inputs
        The entries of each input, the parameters first.
    items
        In lanes, the name of the truth values that tell which lanes have an item.
    """
    # Where an input is not finite, the start is NaN, and all that follows from it.
    first, fixed = result_values(loop.begin, body, inputs, [FLOAT, FLOAT])
    body.lines += ["  br label %before", "before:", "  br label %step", "step:"]

    # The state's values and the number of steps come from the start, and then from the step before, whose values are
    # known only after the step is written.
    state = [Vector(body, f"%state{k}") for k in range(len(first))]
    active = Mask(body, "%active")
    place = len(body.lines)
    body.lines.append("")
    after, (goes_on,) = plain_results(loop.step, body, [*inputs, fixed, state])
    origins = ["  %steps = phi i64 [0, %before], [%steps_after, %step]"]
    still = goes_on.differs(0.0)
    if body.width > 1:
        after = [select(active, new, now) for new, now in zip(after, state, strict=True)]
        still = active & still
        origins.append(
            f"  {active.name} = phi {body.truth_type} [{items}, %before], [{still.name}, %step]"
        )
        bits = body.define(f"bitcast {body.truth_type} {still.name} to i{body.width}")
        is_any = body.define(f"icmp ne i{body.width} {bits}, 0")
    else:
        is_any = still.name
    for now, old, new in zip(state, first, after, strict=True):
        kind = body.number_type
        origins.append(f"  {now.name} = phi {kind} [{old.name}, %before], [{new.name}, %step]")
    body.lines[place] = "\n".join(origins)

    body.lines += [
        "  %steps_after = add i64 %steps, 1",
        f"  %has_steps = icmp slt i64 %steps_after, {loop.most}",
        f"  %goes_on = and i1 {is_any}, %has_steps",
        "  br i1 %goes_on, label %step, label %finish",
        "finish:",
    ]
    return plain_results(loop.finish, body, [*inputs, fixed, after])


def _node_values(graph: Graph, body: Body, inputs: Sequence[Sequence[Vector]]) -> list[Value]:
    """Return the value of every node."""
    values: dict[int, Value] = {}
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
            values.update(zip(pairs[angle], sincos(as_number(values[angle])), strict=True))
        else:
            values[k] = apply(node.operation, [values[j] for j in node.arguments])

    if body.width == 1:
        # The sines of one item's angles are computed together, an angle in each lane of a vector.
        first = _before_sines(graph)
        for k in first:
            evaluate(k)
        angles = [angle for angle in pairs if angle in first]
        values.update(sines_and_cosines(graph, body, values, angles))
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


def sines_and_cosines(
    graph: Graph, body: Body, values: Mapping[int, Value], angles: Sequence[int]
) -> dict[int, Value]:
    """Return the nodes of sine and cosine of one item's angles with their values, computed in the lanes of vectors.

    Parameters
    ----------
    graph, body
        The program, and where the operations are written.
    values
        The values of nodes that are known.
    angles
        The angles' nodes.
    """
    found: dict[int, Value] = {}
    lanes = Body(body.liberties, WIDTH, body.lines)
    for start in range(0, len(angles), WIDTH):
        part = angles[start : start + WIDTH]
        # Lanes that are left over repeat the last angle.
        filled = [*part, *[part[-1]] * (WIDTH - len(part))]
        sine, cosine = sincos(gathered(lanes, [as_number(values[k]) for k in filled]))
        for lane, angle in enumerate(part):
            both = (sine.lane(body, lane), cosine.lane(body, lane))
            found.update(zip(graph.angle_pairs[angle], both, strict=True))
    return found


def apply(operation: str, arguments: Sequence[Value]) -> Value:
    """Write an operation of a program, but for sine and cosine, and return its value."""
    if operation == "select":
        condition, true, false = arguments
        return select(_mask(condition), as_number(true), as_number(false))
    if operation in _LOGICAL:
        return _LOGICAL[operation](*map(_mask, arguments))
    return _NUMERIC[operation](*map(as_number, arguments))


def as_number(value: Value) -> Vector:
    """Return a value as numbers: 1 for true, 0 for false."""
    return (
        value
        if isinstance(value, Vector)
        else select(value, Vector(value.body, value.body.constant(1.0)), 0.0)
    )


def _numbers(values: Sequence[Value], places: Sequence[int]) -> list[Vector]:
    return [as_number(values[place]) for place in places]


def _mask(value: Value) -> Mask:
    """Return a value as truth values: numbers other than 0 are true."""
    return value if isinstance(value, Mask) else value.differs(0.0)
