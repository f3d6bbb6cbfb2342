"""How much work a program is."""

from __future__ import annotations

from collections import Counter

from dhkit.symbolic.programs.graph import Graph

NAMES = {
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


def operation_count(graph: Graph) -> dict[str, int]:
    """Return how many operations of each kind a program has.

    Subtractions count as additions; comparisons, choices and the like are ``"others"``; inputs and constants are free.

    Examples
    --------
    >>> import casadi
    >>> x = casadi.SX.sym("x")
    >>> operation_count(Graph.of("line", {"x": x}, {"y": 3 * casadi.sin(x) - 1}))
    {'additions': 1, 'multiplications': 1, 'sines and cosines': 1}
    """
    counts = Counter(NAMES.get(x.operation, "others") for x in graph.nodes if x.operation not in ("input", "constant"))
    return dict(sorted(counts.items()))
