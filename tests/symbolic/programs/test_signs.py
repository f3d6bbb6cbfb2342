"""Signs in programs: negated values cost nothing in sums, and which way a number goes."""

import casadi
import numpy as np
import pytest

from dhkit.kernels.interpreter import Interpreter
from dhkit.symbolic import Graph, operation_count


def run(expression, x, values):
    graph = Graph.of("program", {"p": casadi.SX(0, 1), "x": x}, {"y": expression})
    y = np.empty((len(values), expression.numel()))
    Interpreter(graph, ["float64"])(np.zeros(0), [np.asarray(values, dtype=float)], [y])
    return y, operation_count(graph)


@pytest.mark.parametrize(
    ("expression", "value", "negations"),
    [
        (lambda a, b, c: a + (-b) * c, 1 - 6, 0),
        (lambda a, b, c: a - (-b) * c, 1 + 6, 0),
        (lambda a, b, c: (-a) * b - c, -2 - 3, 1),
        (lambda a, b, c: (-a) * (-b) + c, 2 + 3, 0),
        (lambda a, b, c: c - (-(a * b)) / (-c), 3 - 2 / 3, 0),
        (lambda a, b, c: (-a) * b + (-c), -5, 1),
        (lambda a, b, c: 0 - (-(a * b)), 2, 0),
        (lambda a, b, c: c + (-(-a * b)) - (-c) * b, 3 + 2 + 6, 0),
    ],
)
def test_signs_go_into_sums(expression, value, negations):
    x = casadi.SX.sym("x", 3)
    y, counts = run(expression(x[0], x[1], x[2]), x, [[1, 2, 3]])
    assert y[0, 0] == value
    assert counts.get("negations", 0) == negations


def test_sign():
    x = casadi.SX.sym("x")
    y, _ = run(casadi.sign(x), x, [[-2.0], [0.0], [1e-300], [np.nan]])
    assert y[:3, 0].tolist() == [-1.0, 0.0, 1.0]
    assert np.isnan(y[3, 0])
