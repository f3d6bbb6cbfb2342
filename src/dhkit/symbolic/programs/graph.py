"""Straight-line programs: expressions as a sequence of operations without branches and without repeated work."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

from dhkit.display import counted, repr_line

if TYPE_CHECKING:
    import casadi


_COUNTED_AS = {
    "add": "additions",
    "subtract": "additions",
    "multiply": "multiplications",
    "divide": "divisions",
    "negate": "negations",
    "sqrt": "square roots",
    "sin": "sines and cosines",
    "cos": "sines and cosines",
    "atan2": "arctangents",
}
"""Names under which :func:`operation_count` counts operations; all others count as ``others``."""


@dataclass(frozen=True)
class Variable:
    """A named input or output of a program, an array of doubles stored row by row."""

    name: str
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """The number of entries."""
        return math.prod(self.shape)


@dataclass(frozen=True)
class Node:
    """One operation of a program.

    ``constant`` has a value, ``input`` the indices (variable, entry) as arguments; other operations have earlier nodes:
    add, subtract, multiply, divide, negate, absolute, floor, sqrt, sin, cos, atan2, minimum, maximum, less, less_equal,
    equal, unequal, logical_and, logical_or, logical_not, and select (condition, where true, where false).
    """

    operation: str
    arguments: tuple[int, ...] = ()
    value: float = 0.0


_FOLDING: Mapping[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negate": lambda a: -a,
    "absolute": abs,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "atan2": math.atan2,
    "minimum": min,
    "maximum": max,
    "floor": math.floor,
}
"""Operations that are evaluated while a program is built when all arguments are constants."""

_SIGNED = {"add", "subtract", "multiply", "divide", "negate"}
"""Operations from which a negative sign can be taken out."""
_LOGICAL = {"select", "logical_and", "logical_or", "logical_not"}
"""Operations whose result a constant condition may decide."""
_COMMUTATIVE = {
    "add",
    "multiply",
    "minimum",
    "maximum",
    "equal",
    "unequal",
    "logical_and",
    "logical_or",
}
"""Operations with f(x, y) = f(y, x), which are merged in either order of their arguments."""


@cache
def _operations() -> dict[int, str]:
    """Return our names of CasADi's operations, by CasADi's numbers; names with a colon have a rule of their own."""
    import casadi

    names = {
        "ASSIGN": ":same",
        "ADD": "add",
        "SUB": "subtract",
        "MUL": "multiply",
        "DIV": "divide",
        "NEG": "negate",
        "SQ": ":square",
        "TWICE": ":twice",
        "INV": ":inverse",
        "FABS": "absolute",
        "SQRT": "sqrt",
        "SIN": "sin",
        "COS": "cos",
        "ATAN2": "atan2",
        "FMIN": "minimum",
        "FMAX": "maximum",
        "FLOOR": "floor",
        "LT": "less",
        "LE": "less_equal",
        "EQ": "equal",
        "NE": "unequal",
        "AND": "logical_and",
        "OR": "logical_or",
        "NOT": "logical_not",
        "IF_ELSE_ZERO": ":gate",
        "SIGN": ":sign",
    }
    return {getattr(casadi, f"OP_{key}"): name for key, name in names.items()}


@dataclass(frozen=True)
class Graph:
    """A straight-line program: nodes in an order in which each node follows its arguments.

    Examples
    --------
    >>> import casadi
    >>> x = casadi.SX.sym("x")
    >>> graph = Graph.of("square_twice", {"x": x}, {"y": (x * x) * (x * x)}, shapes={"x": (1,), "y": (1,)})
    >>> [node.operation for node in graph.nodes]
    ['input', 'multiply', 'multiply']
    """

    name: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    nodes: tuple[Node, ...]
    results: tuple[tuple[int, ...], ...]
    """Nodes of each output's entries, row by row."""
    branches: int = 0
    """Number of branches, whose operations are alike but for signs: outputs with as many rows have a row for each."""

    @classmethod
    def of(
        cls,
        name: str,
        inputs: Mapping[str, casadi.SX],
        outputs: Mapping[str, casadi.SX],
        shapes: Mapping[str, tuple[int, ...]] | None = None,
        branches: int = 0,
    ) -> Graph:
        """Return the program of CasADi expressions; equal operations are merged, operations on constants evaluated.

        Parameters
        ----------
        name
            An identifier.
        inputs, outputs
            Symbols and expressions by name; matrices are taken row by row.
        shapes
            Shapes to state instead of CasADi's (rows, columns).
        branches
            See the class.

        Raises
        ------
        ValueError
            An operation that a straight-line program does not have.
        """
        import casadi

        shapes = shapes or {}

        # CasADi stores matrices column by column; ours are row by row.
        function = casadi.Function(
            "program",
            [casadi.vec(x.T) for x in map(casadi.SX, inputs.values())],
            [casadi.densify(casadi.vec(y.T)) for y in map(casadi.SX, outputs.values())],
        )
        builder = _Builder()
        entries = builder.read(function)
        results = tuple(tuple(entries[k]) for k in range(len(outputs)))
        nodes, results = _pruned(builder.nodes, results)
        return cls(
            name,
            inputs=tuple(
                Variable(key, shapes.get(key, tuple(x.shape))) for key, x in inputs.items()
            ),
            outputs=tuple(
                Variable(key, shapes.get(key, tuple(y.shape))) for key, y in outputs.items()
            ),
            nodes=nodes,
            results=results,
            branches=branches,
        )

    @property
    def angle_pairs(self) -> dict[int, tuple[int, int]]:
        """Nodes of the sine and the cosine of each angle, by the angle's node; -1 where one of them is not needed."""
        pairs: dict[int, tuple[int, int]] = {}
        for k, node in enumerate(self.nodes):
            if node.operation in ("sin", "cos"):
                angle = node.arguments[0]
                sine, cosine = pairs.get(angle, (-1, -1))
                pairs[angle] = (k, cosine) if node.operation == "sin" else (sine, k)
        return pairs

    def with_reciprocals(self) -> Graph:
        """Return the program with one division by each number by which several numbers are divided.

        A division takes as long as some 16 products. CasADi makes x / y of x times 1 / y, even where 1 / y is at hand.
        Results may differ in their last bit.
        """
        divided_by = Counter(node.arguments[1] for node in self.nodes if node.operation == "divide")
        if max(divided_by.values(), default=0) < 2:
            return self
        builder = _Builder()
        places: list[int] = []
        for node in self.nodes:
            if node.operation == "input":  # whose arguments are not nodes
                places.append(builder.add(node))
                continue
            arguments = tuple(places[k] for k in node.arguments)
            if node.operation == "divide" and divided_by[node.arguments[1]] > 1:
                places.append(builder.product_with_reciprocal(*arguments))
            else:
                places.append(builder.add(Node(node.operation, arguments, node.value)))
        results = tuple(tuple(places[k] for k in entries) for entries in self.results)
        nodes, results = _pruned(builder.nodes, results)
        return replace(self, nodes=nodes, results=results)

    def renamed(self, name: str) -> Graph:
        """Return the same program under another name."""
        return replace(self, name=name)

    def __repr__(self) -> str:
        inputs = ", ".join(variable.name for variable in self.inputs)
        outputs = ", ".join(variable.name for variable in self.outputs)
        size = counted(len(self.nodes), "node")
        return repr_line(f"Graph {self.name}", summary=f"{size}, ({inputs}) -> ({outputs})")


class _Builder:
    """Builds nodes from a CasADi function; equal operations on equal arguments get the same node."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._places: dict[Hashable, int] = {}

    def read(self, function: casadi.Function) -> list[list[int]]:
        """Return the nodes of each output's entries."""
        import casadi

        operations = _operations()
        work: dict[int, int] = {}  # node of each place in CasADi's work vector
        outputs = [[-1] * function.numel_out(k) for k in range(function.n_out())]
        for k in range(function.n_instructions()):
            code = function.instruction_id(k)
            into = function.instruction_output(k)
            sources = function.instruction_input(k)
            if code == casadi.OP_CONST:
                work[into[0]] = self.constant(function.instruction_constant(k))
            elif code == casadi.OP_INPUT:
                work[into[0]] = self.add(Node("input", (sources[0], sources[1])))
            elif code == casadi.OP_OUTPUT:
                outputs[into[0]][into[1]] = work[sources[0]]
            elif code in operations:
                work[into[0]] = self.apply(operations[code], [work[source] for source in sources])
            else:
                raise ValueError(
                    f"operation {code} of CasADi is not one of a straight-line program"
                )
        return outputs

    def apply(self, operation: str, arguments: Sequence[int]) -> int:
        """Return the node of an operation on earlier nodes, simplified; see ``_operations`` for names with a colon."""
        first = arguments[0]
        if operation == ":same":
            return first
        if operation == ":square":
            return self.apply("multiply", (first, first))
        if operation == ":twice":
            return self.apply("add", (first, first))
        if operation == ":inverse":
            return self.apply("divide", (self.constant(1.0), first))
        if operation == ":gate":
            return self.apply("select", (*arguments, self.constant(0.0)))
        if operation == ":sign":
            return self._sign(first)

        # Simplifications, of which the first that applies is taken.
        if operation in _SIGNED and (signed := self._signed(operation, arguments)) is not None:
            return signed
        operands = [self.nodes[k] for k in arguments]
        if operation in _FOLDING and all(node.operation == "constant" for node in operands):
            return self.constant(_FOLDING[operation](*(node.value for node in operands)))
        if operation in _LOGICAL and (known := self._decided(operation, arguments)) is not None:
            return known
        if operation == "add" and (chosen := self._selected(arguments)) is not None:
            return chosen
        if operation in _COMMUTATIVE:
            arguments = sorted(arguments)
        return self.add(Node(operation, tuple(arguments)))

    def product_with_reciprocal(self, x: int, y: int) -> int:
        """Return the node of x (1 / y)."""
        one = self.constant(1.0)
        reciprocal = self.apply("divide", (one, y))
        return reciprocal if x == one else self.apply("multiply", (x, reciprocal))

    def _sign(self, x: int) -> int:
        """Return the sign of x: 1 if 0 < x, else -1 if x < 0, else x itself, which is 0 or NaN."""
        zero = self.constant(0.0)
        is_negative = self.apply("less", (x, zero))
        unless_positive = self.apply("select", (is_negative, self.constant(-1.0), x))
        is_positive = self.apply("less", (zero, x))
        return self.apply("select", (is_positive, self.constant(1.0), unless_positive))

    def _signed(self, operation: str, arguments: Sequence[int]) -> int | None:
        """Return the node of an operation on negated values, with the sign moved to where it costs no operation.

            -(-x) = x,    (-x) y = -(x y),    (-x) / y = -(x / y),    (-x) (-y) = x y,
            -x + y = y - x,    x - (-y) = x + y,    -x - y = -(x + y).

        None if no argument is negated.
        """
        plain = [self._without_sign(k) for k in arguments]
        negated = [k != own for k, own in zip(plain, arguments, strict=True)]
        if not any(negated):
            return None
        if operation == "negate":
            return plain[0]

        if operation in ("multiply", "divide"):
            result = self.apply(operation, plain)
            return result if all(negated) else self.apply("negate", (result,))

        # The signs of x and y in their sum; subtraction changes that of y.
        x, y = plain
        x_is_subtracted = negated[0]
        y_is_subtracted = negated[1] != (operation == "subtract")
        if x_is_subtracted and y_is_subtracted:
            total = self.apply("add", (x, y))
            return self.apply("negate", (total,))
        if x_is_subtracted:
            return self.apply("subtract", (y, x))
        return self.apply("subtract" if y_is_subtracted else "add", (x, y))

    def _without_sign(self, k: int) -> int:
        """Return the node that node k negates, or k itself."""
        node = self.nodes[k]
        return node.arguments[0] if node.operation == "negate" else k

    def _decided(self, operation: str, arguments: Sequence[int]) -> int | None:
        """Return the result of a selection or logical operation that a constant condition decides, else None."""
        first, *others = arguments
        if self.nodes[first].operation != "constant":
            # "and" and "or" are decided by a constant second argument too.
            if operation == "select" or not others or self.nodes[others[0]].operation != "constant":
                return None
            first, others = others[0], [first]
        is_true = self.nodes[first].value != 0.0

        if operation == "select":
            return others[0] if is_true else others[1]
        if operation == "logical_not":
            return self.constant(0.0 if is_true else 1.0)

        # 1 and x = x, 0 and x = 0; 0 or x = x, 1 or x = 1.
        if is_true == (operation == "logical_and"):
            return others[0]
        return self.constant(1.0 if is_true else 0.0)

    def _selected(self, arguments: Sequence[int]) -> int | None:
        """Return the selection that CasADi writes as (a if c else 0) + (b if not c else 0)."""
        first, second = (self.nodes[k] for k in arguments)
        if first.operation != "select" or second.operation != "select":
            return None

        condition_1, value_1, otherwise_1 = first.arguments
        condition_2, value_2, otherwise_2 = second.arguments
        zero = self.constant(0.0)
        if otherwise_1 != zero or otherwise_2 != zero:
            return None
        if self.nodes[condition_2] == Node("logical_not", (condition_1,)):
            return self.add(Node("select", (condition_1, value_1, value_2)))
        if self.nodes[condition_1] == Node("logical_not", (condition_2,)):
            return self.add(Node("select", (condition_2, value_2, value_1)))
        return None

    def constant(self, value: float) -> int:
        """Return the node of a constant; -0.0 becomes 0.0."""
        return self.add(Node("constant", (), float(value) + 0.0))

    def add(self, node: Node) -> int:
        """Return the number of a node, which is appended unless an equal one is there."""
        # NaN differs from itself; as text all NaN are equal. Only constants have values.
        value = repr(node.value) if node.operation == "constant" else ""
        key = (node.operation, node.arguments, value)
        if key not in self._places:
            self._places[key] = len(self.nodes)
            self.nodes.append(node)
        return self._places[key]


def _pruned(
    nodes: Sequence[Node], results: tuple[tuple[int, ...], ...]
) -> tuple[tuple[Node, ...], tuple[tuple[int, ...], ...]]:
    """Return nodes and results without the nodes that no result needs."""
    # Nodes follow their arguments, so that one pass from the last node to the first finds all that are needed.
    needed: set[int] = set()
    for entries in results:
        needed.update(entries)
    for k in range(len(nodes) - 1, -1, -1):
        if k in needed and nodes[k].operation != "input":
            needed.update(nodes[k].arguments)

    order = sorted(needed)
    new_number = {k: i for i, k in enumerate(order)}

    def renumbered(numbers: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(new_number[k] for k in numbers)

    kept: list[Node] = []
    for k in order:
        node = nodes[k]
        if node.operation != "input":  # whose arguments are not nodes
            node = Node(node.operation, renumbered(node.arguments), node.value)
        kept.append(node)
    return tuple(kept), tuple(map(renumbered, results))


def operation_count(graph: Graph) -> dict[str, int]:
    """Return how many operations of each kind a program has.

    Subtractions count as additions; comparisons, choices and the like are ``"others"``; inputs and constants are free.

    Parameters
    ----------
    graph
        Program.

    Returns
    -------
    dict[str, int]
        Numbers by kind, sorted by name; kinds that do not occur are left out.

    Examples
    --------
    >>> import casadi
    >>> x = casadi.SX.sym("x")
    >>> operation_count(Graph.of("line", {"x": x}, {"y": 3 * casadi.sin(x) - 1}))
    {'additions': 1, 'multiplications': 1, 'sines and cosines': 1}
    """
    operations = [
        node.operation for node in graph.nodes if node.operation not in ("input", "constant")
    ]
    counts = Counter(_COUNTED_AS.get(operation, "others") for operation in operations)
    return dict(sorted(counts.items()))
