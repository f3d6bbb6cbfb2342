"""Branches of one item in the lanes of a vector: the numbers of the same program without lanes, bit for bit."""

import casadi as ca
import numpy as np
import pytest

from dhkit.kernels import SingleCall, kernel
from dhkit.kernels.branch_lanes import branch_results
from dhkit.kernels.single_calls import unpacked
from dhkit.kernels.vectors import EXACT, Body, Vector
from dhkit.symbolic import Graph
from random_graphs import branches_of

TYPES = ("float64", "uint8", "float64")
fresh = iter(range(10**9))


def program(rows, counts, total, symbols, branches):
    p, x, angle = symbols
    return Graph.of(
        "alternatives",
        {"p": p, "x": x, "angle": angle},
        {"rows": ca.vertcat(*rows), "counts": ca.vertcat(*counts), "total": total},
        {"angle": ()},
        branches=branches,
    )


def answers(graph, parameters, x, angle, tmp_path, monkeypatch):
    """Return the outputs of a single call, of x as an array and of the angle as a float."""
    monkeypatch.setenv("DHKIT_CACHE_DIR", str(tmp_path))
    run = kernel("test_branches", str(next(fresh)), lambda: graph, TYPES)
    call = SingleCall(run, parameters, graph.outputs[0].shape, install=lambda _: None).compile()
    rows, packed = call(x, angle, None)
    return [rows.ravel(), *unpacked(packed, graph, TYPES)]


@pytest.mark.parametrize("branches", [2, 3, 4, 8, 16])
@pytest.mark.parametrize("seed", range(4))
def test_lanes_give_the_bits_of_single_numbers(branches, seed, tmp_path, monkeypatch):
    """Of branches that are alike, that differ in signs, in operations or in all."""
    symbols = (ca.SX.sym("p", 3), ca.SX.sym("x", 5), ca.SX.sym("angle"))
    rng = np.random.default_rng(100 * branches + seed)
    rows, counts, total = branches_of(rng, symbols, branches)
    in_lanes = program(rows, counts, total, symbols, branches)
    alone = program(rows, counts, total, symbols, 0)

    parameters = rng.uniform(-2, 2, 3)
    for x in (*rng.uniform(-2, 2, (5, 5)), np.zeros(5), np.array([1.0, np.nan, 0.0, 1.0, 2.0])):
        angle = float(rng.uniform(-3, 3))
        found = answers(in_lanes, parameters, x, angle, tmp_path, monkeypatch)
        expected = answers(alone, parameters, x, angle, tmp_path, monkeypatch)
        for one, other in zip(found, expected, strict=True):
            assert np.array_equal(one, other, equal_nan=one.dtype == float)


def test_alike_branches_are_computed_once():
    """The operations of eight branches are as many as those of one, and no single number is put into a lane."""
    symbols = (ca.SX.sym("p", 3), ca.SX.sym("x", 5), ca.SX.sym("angle"))
    p, x, _ = symbols

    def lines_of(branches):
        rows = []
        for k in range(branches):
            side = (1.0, -1.0)[k % 2]
            tilt = (1.0, -1.0)[k // 2 % 2]
            radius = ca.sqrt(x[0] ** 2 + x[1] ** 2 + 0.5 * side * tilt)
            rows.append(ca.horzcat(ca.atan2(side * radius - x[2], p[0]), tilt * radius + x[3]))
        graph = program(rows, [0.0] * branches, x[4], symbols, branches)
        body = Body(EXACT, width=1)
        inputs = [
            [Vector(body, f"%a{j}_{k}") for k in range(size)] for j, size in enumerate((3, 5, 1))
        ]
        branch_results(graph, body, inputs, TYPES)
        return [line for line in body.lines if "extractelement" not in line]

    assert len(lines_of(8)) <= len(lines_of(4)) + 2
    assert not any("insertelement" in line and "poison" not in line for line in lines_of(8))


def test_an_input_of_one_number_may_be_a_float(tmp_path, monkeypatch):
    symbols = (ca.SX.sym("p"), ca.SX.sym("x", 2), ca.SX.sym("angle"))
    p, x, angle = symbols
    graph = Graph.of(
        "sum", {"p": p, "x": x, "angle": angle}, {"y": p * x[0] + x[1] + angle}, {"angle": ()}
    )
    monkeypatch.setenv("DHKIT_CACHE_DIR", str(tmp_path))
    run = kernel("test_numbers", str(next(fresh)), lambda: graph)
    call = SingleCall(run, np.array([2.0]), (1,), install=lambda _: None).compile()
    state = np.array([1.0, 10.0])
    assert call(state, 0.5, None) == call(state, np.array(0.5), None) == [12.5]

    batch = np.stack([state, state])
    assert call(batch, np.array([0.5, 1.5]), None).ravel().tolist() == [12.5, 13.5]
    for number in (1, True, np.float32(0.5), "0.5", None, np.zeros(1), np.zeros(2)):
        assert call(state, number, None) is None
    assert call(batch, 0.5, None) is None
    assert call(batch, np.zeros(3), None) is None
