"""The branches of one item in the lanes of a vector.

A program with branches, such as the eight solutions of an arm, does nearly the same operations for each of them, with
other signs. Here the same operation of all branches is one operation on vectors, with a branch in each lane. Numbers
that all branches share are computed once and copied into the lanes.

The program tells only which of its results belong together. From them the operands are compared backwards: the nodes of
a pack, one for each lane, have the same operation, but for signs, and their operands are packs again. Operations are
rounded as in the program itself, so that the results are the same numbers.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from dhkit.kernels.elementary import sincos
from dhkit.kernels.lowering import (
    FLOAT,
    Value,
    apply,
    as_number,
    sines_and_cosines,
    zero_or_missing,
)
from dhkit.kernels.vectors import Body, Mask, Vector, chosen_lanes, gathered, spread
from dhkit.symbolic import Graph

_Pack: TypeAlias = tuple[int, ...]
"""The nodes whose values are the lanes of a vector."""
_Term: TypeAlias = tuple[float, int]
"""A node with a sign."""

_COMPARED_DEPTH = 4
"""Number of levels of operands by which the arguments of a sum or a product are matched between lanes."""
_EXCHANGEABLE = ("multiply", "minimum", "maximum", "equal", "unequal", "logical_and", "logical_or")
"""Operations whose arguments are matched in either order; sums are so too, with their signs."""


def branch_results(
    graph: Graph, body: Body, inputs: Sequence[Sequence[Vector]], types: Sequence[str]
) -> list[list[Vector]]:
    """Write one item's operations of a program with branches, as :func:`dhkit.kernels.lowering.result_values` does."""
    outputs = _Writer(graph, body, inputs).results()
    missing = zero_or_missing(inputs)
    for k, kind in enumerate(types):
        columns = outputs[k]
        in_lanes = columns[0].body is not body
        if missing is not None and kind == FLOAT:
            added = spread(columns[0].body, missing) if in_lanes else missing
            columns = [column + added for column in columns]
        if in_lanes:
            columns = [
                column.lane(body, row) for row in range(graph.branches) for column in columns
            ]
        outputs[k] = columns
    return outputs


@dataclass(frozen=True)
class _Step:
    """How the vector of a pack is computed."""

    operands: tuple[_Pack, ...]
    write: Callable[[list[Value]], Value]
    """Writes the operations, and returns the vector, from those of the operands."""


class _Writer:
    """Writes one item's operations, on single numbers and on vectors with a lane for each branch."""

    def __init__(self, graph: Graph, body: Body, inputs: Sequence[Sequence[Vector]]) -> None:
        self._graph = graph
        self._nodes = graph.nodes
        self._body = body
        self._inputs = inputs
        self._lanes = Body(body.liberties, graph.branches, body.lines)
        self._shapes = _shapes(graph)
        # Sines of angles that are inputs are computed together.
        angles = [k for k in graph.angle_pairs if graph.nodes[k].operation == "input"]
        self._single: dict[int, Value] = {k: self._input(k) for k in angles}
        self._single.update(sines_and_cosines(graph, body, self._single, angles))
        self._vectors: dict[_Pack, Value] = {}
        self._lane_of: dict[int, tuple[_Pack, int]] = {}

    def results(self) -> list[list[Vector]]:
        """Write all operations; return the outputs: vectors, one for each column, or the entries as single numbers."""
        graph = self._graph
        packs = [
            self._columns(places) if variable.shape[0] == graph.branches else None
            for variable, places in zip(graph.outputs, graph.results, strict=True)
        ]
        self._write_packs([pack for columns in packs for pack in columns or ()])
        return [
            [as_number(self._one(k)) for k in places]
            if columns is None
            else [as_number(self._vectors[pack]) for pack in columns]
            for columns, places in zip(packs, graph.results, strict=True)
        ]

    def _columns(self, places: Sequence[int]) -> list[_Pack]:
        """Return the packs of an output's columns; ``places`` are its nodes row by row."""
        size = len(places) // self._graph.branches
        return [tuple(places[column::size]) for column in range(size)]

    def _write_packs(self, wanted: Sequence[_Pack]) -> None:
        """Compute the vectors of packs, and of all packs that they need."""
        steps: dict[_Pack, _Step] = {}
        waiting = [(_order(pack), pack) for pack in dict.fromkeys(wanted)]
        heapq.heapify(waiting)
        # Operands come later in this order than all packs that need them.
        while waiting:
            _, pack = heapq.heappop(waiting)
            if pack in steps:
                continue
            steps[pack] = self._step(pack)
            for operand in steps[pack].operands:
                heapq.heappush(waiting, (_order(operand), operand))
        for pack, step in reversed(steps.items()):
            self._vectors[pack] = step.write([self._vectors[operand] for operand in step.operands])
            for lane, node in enumerate(pack):
                self._lane_of.setdefault(node, (pack, lane))

    def _step(self, pack: _Pack) -> _Step:
        """Return how a pack is computed."""
        nodes = [self._nodes[k] for k in pack]
        operations = {node.operation for node in nodes}
        if len(set(pack)) == 1:
            return _Step((), lambda _: spread(self._lanes, self._one(pack[0])))
        if operations == {"constant"}:
            values = [node.value for node in nodes]
            return _Step((), lambda _: Vector(self._lanes, self._lanes.constants(values)))

        terms = [self._without_sign(k) for k in pack]
        if "negate" in operations:
            return _Step((_pack_of(terms),), lambda values: self._signed(_signs(terms), *values))
        if operations <= {"add", "subtract"}:
            return self._sum(pack)
        if len(operations) == 1 and "input" not in operations:
            return self._operation(pack)
        if len(operations) > 1 and len(set(pack)) > 2:
            return self._mixture(pack)
        return _Step((), lambda _: self._gathered(pack))

    def _sum(self, pack: _Pack) -> _Step:
        """Return how sums and differences are computed: as sums of terms with signs."""
        rows = []
        for k in pack:
            sign = -1.0 if self._nodes[k].operation == "subtract" else 1.0
            first, second = map(self._without_sign, self._nodes[k].arguments)
            rows.append([first, (sign * second[0], second[1])])
        self._match(rows)
        first_terms, second_terms = ([row[j] for row in rows] for j in (0, 1))

        def write(values: list[Value]) -> Value:
            x, y = map(as_number, values)
            signs = _signs(second_terms)
            if len(set(signs)) == 1:
                x = self._signed(_signs(first_terms), x)
                return x + y if signs[0] > 0 else x - y
            return self._signed(_signs(first_terms), x) + self._signed(signs, y)

        return _Step((_pack_of(first_terms), _pack_of(second_terms)), write)

    def _operation(self, pack: _Pack) -> _Step:
        """Return how one operation of all lanes is computed."""
        operation = self._nodes[pack[0]].operation
        rows = [[(1.0, j) for j in self._nodes[k].arguments] for k in pack]
        if operation in _EXCHANGEABLE:
            self._match(rows)
        operands = tuple(tuple(row[j][1] for row in rows) for j in range(len(rows[0])))
        if operation in ("sin", "cos"):
            which = ("sin", "cos").index(operation)
            return _Step(operands, lambda values: sincos(as_number(values[0]))[which])
        return _Step(operands, lambda values: apply(operation, values))

    def _mixture(self, pack: _Pack) -> _Step:
        """Return how lanes with different operations are put together: each operation in all lanes, then chosen."""
        kinds = [self._nodes[k].operation for k in pack]
        names = list(dict.fromkeys(kinds))
        operands = []
        for name in names:
            # Lanes of another operation repeat the one before, or the first.
            node = pack[kinds.index(name)]
            filled = []
            for own, kind in zip(pack, kinds, strict=True):
                node = own if kind == name else node
                filled.append(node)
            operands.append(tuple(filled))

        def write(values: list[Value]) -> Value:
            mixed, *others = _of_one_kind(values)
            for name, value in zip(names[1:], others, strict=True):
                mixed = chosen_lanes([kind == name for kind in kinds], value, mixed)
            return mixed

        return _Step(tuple(operands), write)

    def _gathered(self, pack: _Pack) -> Value:
        return gathered(self._lanes, _of_one_kind([self._one(k) for k in pack]))

    def _signed(self, signs: Sequence[float], value: Value) -> Vector:
        """Return numbers times signs."""
        number = as_number(value)
        if min(signs) > 0:
            return number
        return (
            -number
            if max(signs) < 0
            else number * Vector(self._lanes, self._lanes.constants(signs))
        )

    def _without_sign(self, k: int) -> _Term:
        """Return the sign of a node and the node that it negates, or 1 and the node itself."""
        node = self._nodes[k]
        return (-1.0, node.arguments[0]) if node.operation == "negate" else (1.0, k)

    def _match(self, rows: Sequence[list[_Term]]) -> None:
        """Exchange both terms of a row where they fit those of the first row better."""
        first = rows[0]
        for row in rows[1:]:
            as_they_are = sum(map(self._likeness, first, row))
            exchanged = sum(map(self._likeness, first, reversed(row)))
            if exchanged > as_they_are:
                row.reverse()

    def _likeness(self, one: _Term, other: _Term) -> int:
        """Return how much two terms are alike: 3 for the same node, 2 for the same operations, 1 for the last one."""
        if one[1] == other[1]:
            return 3
        if self._shapes[one[1]] == self._shapes[other[1]]:
            return 2
        return int(self._nodes[one[1]].operation == self._nodes[other[1]].operation)

    def _one(self, k: int) -> Value:
        """Return a node as a single value: from a lane of a vector, or computed with all that it needs."""
        needed: set[int] = set()
        waiting = [k]
        while waiting:
            j = waiting.pop()
            if j in self._single or j in needed:
                continue
            needed.add(j)
            if j not in self._lane_of and self._nodes[j].operation != "input":
                waiting += self._nodes[j].arguments
        for j in sorted(needed):
            if j not in self._single:
                self._compute(j)
        return self._single[k]

    def _input(self, k: int) -> Vector:
        variable, entry = self._nodes[k].arguments
        return self._inputs[variable][entry]

    def _compute(self, k: int) -> None:
        """Compute a node whose arguments are known."""
        node = self._nodes[k]
        if k in self._lane_of:
            pack, lane = self._lane_of[k]
            self._single[k] = self._vectors[pack].lane(self._body, lane)
        elif node.operation == "constant":
            self._single[k] = Vector(self._body, self._body.constant(node.value))
        elif node.operation == "input":
            self._single[k] = self._input(k)
        elif node.operation in ("sin", "cos"):
            both = sines_and_cosines(self._graph, self._body, self._single, node.arguments)
            self._single.update(both)
        else:
            self._single[k] = apply(node.operation, [self._single[j] for j in node.arguments])


def _order(pack: _Pack) -> tuple[int, int, int]:
    """Return a key that is greater for all packs that this one may need."""
    return -max(pack), -len(set(pack)), -sum(pack)


def _of_one_kind(values: Sequence[Value]) -> Sequence[Value]:
    """Return values as numbers, unless all are truth values."""
    are_truths = all(isinstance(value, Mask) for value in values)
    return values if are_truths else [as_number(value) for value in values]


def _pack_of(terms: Iterable[_Term]) -> _Pack:
    return tuple(node for _, node in terms)


def _signs(terms: Iterable[_Term]) -> list[float]:
    return [sign for sign, _ in terms]


def _shapes(graph: Graph) -> list[int]:
    """Return numbers that are equal for nodes with the same operations at the ends of their paths, but for signs."""
    numbers: dict[object, int] = {}
    shapes = [0] * len(graph.nodes)
    for _ in range(_COMPARED_DEPTH):
        deeper: list[int] = []
        for node in graph.nodes:
            if node.operation == "negate":
                deeper.append(deeper[node.arguments[0]])
                continue
            key: object = (node.operation, node.arguments)
            if node.operation == "constant":
                key = node.operation
            elif node.operation in ("add", "subtract"):
                key = ("add", *sorted(shapes[k] for k in node.arguments))
            elif node.operation in _EXCHANGEABLE:
                key = (node.operation, *sorted(shapes[k] for k in node.arguments))
            elif node.operation != "input":
                key = (node.operation, *(shapes[k] for k in node.arguments))
            deeper.append(numbers.setdefault(key, len(numbers)))
        shapes = deeper
    return shapes
