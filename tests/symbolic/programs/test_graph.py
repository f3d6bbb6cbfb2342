"""Straight-line programs compute what CasADi computes, with nothing done twice."""

import casadi
import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.description import library_robot, robots, world_to_frames, world_to_tool
from dhkit.symbolic import (
    Graph,
    SymbolicTable,
    jacobian,
    jacobian_dot,
    joint_symbols,
    operation_count,
    table_pattern,
)
from random_arms import states, tables


def evaluate(graph, *inputs):
    """Work a program off node by node, with plain Python."""
    values = []
    for node in graph.nodes:
        a = [values[k] for k in node.arguments] if node.operation != "input" else node.arguments
        match node.operation:
            case "constant":
                value = node.value
            case "input":
                value = np.ravel(inputs[a[0]])[a[1]]
            case "select":
                value = a[1] if a[0] else a[2]
            case "logical_and" | "logical_or" | "logical_not" as name:
                value = float(getattr(np, name)(*a))
            case "less" | "less_equal" | "equal" as name:
                value = float(getattr(np, name)(*a))
            case "unequal":
                value = float(a[0] != a[1])
            case "atan2":
                value = np.arctan2(*a)
            case "negate":
                value = -a[0]
            case name:
                value = getattr(np, name)(*a)
        values.append(float(value))
    return [
        np.array([values[k] for k in entries]).reshape(variable.shape)
        for variable, entries in zip(graph.outputs, graph.results, strict=True)
    ]


x = casadi.SX.sym("x", 3)
EXPRESSIONS = {
    "arithmetic": (x[0] + x[1]) * (x[0] - x[2]) / (1 + x[1] ** 2) - 2 * x[2],
    "sine and cosine": casadi.sin(x[0]) * casadi.cos(x[0]) + casadi.cos(x[1]),
    "roots": casadi.sqrt(casadi.fabs(x[0])) + 1 / (2 + casadi.fabs(x[1])),
    "arc tangent": casadi.atan2(x[0], x[1] + x[2]),
    "choice": casadi.if_else(x[0] < x[1], x[2], casadi.if_else(x[0] <= 0, x[1], 3.0)),
    "choice of roots": casadi.if_else(x[0] > 0, casadi.sqrt(x[0]), casadi.sqrt(-x[0])),
    "logic": casadi.if_else(casadi.logic_and(x[0] > 0, casadi.logic_not(x[1] > 0)), 1.0, 2.0),
    "logic with constants": casadi.if_else(
        casadi.logic_or(casadi.SX(0.0), x[1] == x[2]), 1.0, x[0]
    ),
    "extremes": casadi.fmin(x[0], x[1]) + casadi.fmax(x[1], x[2]) + casadi.floor(x[0]),
    "not equal": casadi.if_else(x[0] != x[1], x[2], 0.0),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_a_program_computes_its_expression(name):
    graph = Graph.of("program", {"x": x}, {"y": EXPRESSIONS[name]})
    reference = casadi.Function("f", [x], [EXPRESSIONS[name]])
    for value in np.random.default_rng(1).normal(size=(20, 3)):
        with np.errstate(invalid="ignore"):  # both sides of a choice are worked out
            seen = evaluate(graph, value)[0]
        assert seen == pytest.approx(float(reference(value)), rel=1e-14, abs=1e-14)


def test_common_subexpressions_are_one_node_and_constants_are_worked_out():
    graph = Graph.of(
        "program", {"x": x}, {"y": (x[0] * x[1] + 1) * (x[1] * x[0] + 1), "z": casadi.SX(2) * 3}
    )
    assert [node.operation for node in graph.nodes].count("multiply") == 2
    assert len(set(graph.nodes)) == len(graph.nodes)
    assert evaluate(graph, [1, 2, 3])[1] == 6


def test_unused_work_is_dropped_and_matrices_are_row_by_row():
    A = casadi.SX.sym("A", 2, 3)
    graph = Graph.of("program", {"A": A, "x": x}, {"B": A[:, 1:]})
    assert {node.operation for node in graph.nodes} == {"input"}
    assert np.array_equal(evaluate(graph, np.arange(6), np.zeros(3))[0], [[1, 2], [4, 5]])


def test_an_operation_without_a_place_in_programs_is_refused():
    with pytest.raises(ValueError, match="not one of a straight-line program"):
        Graph.of("program", {"x": x}, {"y": casadi.exp(x[0])})


def test_kernels_divide_once_by_a_number():
    length = casadi.sqrt(casadi.sumsqr(x))
    exact = Graph.of(
        "unit", {"x": x}, {"unit": x / length, "inverse": 1 / length, "half": x[0] / 2}
    )
    fast = exact.with_reciprocals()
    assert operation_count(exact)["divisions"] == 5
    assert operation_count(fast)["divisions"] == 2
    for value in np.random.default_rng(2).normal(size=(20, 3)):
        for one, other in zip(evaluate(exact, value), evaluate(fast, value), strict=True):
            np.testing.assert_allclose(one, other, rtol=5e-16)
    assert fast.with_reciprocals() == fast


def test_sine_and_cosine_of_one_angle_are_a_pair():
    graph = Graph.of("program", {"x": x}, {"y": EXPRESSIONS["sine and cosine"]})
    assert len(graph.angle_pairs) == 2
    for angle, (sine, cosine) in graph.angle_pairs.items():
        assert sine == -1 or graph.nodes[sine].arguments == (angle,)
        assert graph.nodes[cosine].arguments == (angle,)
    assert sorted(sine for sine, _ in graph.angle_pairs.values())[0] == -1


@given(tables(), st.integers(0, 2**32 - 1))
def test_symbolic_frames_are_those_of_the_table(arm, seed):
    q = states(arm, 1, seed)[0]
    table, symbols = joint_symbols("q", arm.n), SymbolicTable.of(arm)
    frames = casadi.Function("f", [table], symbols.world_to_frames(table))(q)
    frames = [frames] if arm.n == 0 else frames
    assert np.allclose([np.array(T) for T in frames], world_to_frames(arm, q), rtol=0, atol=1e-13)
    parametric, parameters = SymbolicTable.parametric(arm)
    values = table_pattern(arm)[1]
    T = casadi.Function("T", [parameters, table], [parametric.world_to_tool(table)])(values, q)
    assert np.allclose(np.array(T), world_to_tool(arm, q), rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", robots())
def test_symbolic_jacobians_differentiate_the_tool(name):
    arm = library_robot(name)
    q, qd = joint_symbols("q", arm.n), joint_symbols("qd", arm.n)
    table = SymbolicTable.of(arm)
    T, J = table.world_to_tool(q), jacobian(table, q)
    velocity = casadi.jtimes(T[:3, 3], q, qd) - J[:3, :] @ qd
    spin = casadi.jtimes(casadi.vec(T[:3, :3]), q, qd) - casadi.vec(
        casadi.skew(J[3:, :] @ qd) @ T[:3, :3]
    )
    rate = casadi.vec(jacobian_dot(table, q, qd)) - casadi.jtimes(casadi.vec(J), q, qd)
    f = casadi.Function("f", [q, qd], [casadi.vertcat(velocity, spin, rate)])
    for state, rates in zip(states(arm, 5), states(arm, 5, 1), strict=True):
        assert np.abs(np.array(f(state, rates))).max() < 1e-13 * max(1.0, arm.reach) * arm.n
