"""Programs of steps with different numbers of items: interpreted, compiled, and as NumPy computes them."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from dhkit.kernels import SingleCall, kernel
from dhkit.symbolic import Graph, Pipeline, PipelineStep
from dhkit.symbolic.programs.graph import Variable

ITEMS = 11
"""Not a multiple of a vector's lanes."""
POWER = 3.0


def square_roots(most=40):
    """Return the program of the roots of x, x + 1, ... by Newton's method, and of their sum times a parameter."""
    factor = ca.SX.sym("factor")
    x = ca.SX.sym("x")
    index = ca.SX.sym("index")
    root = ca.SX.sym("root")
    square = ca.SX.sym("square")
    roots = ca.SX.sym("roots", ITEMS)
    better = (root + square / root) / 2
    goes_on = ca.if_else(ca.fabs(better - root) > 1e-15 * root, 1.0, 0.0)
    parameters = {"parameters": factor}
    steps = (
        PipelineStep(
            Graph.of(
                "first",
                {**parameters, "x": x, "index": index},
                {"square": x + index, "root": ca.SX(1.0)},
            ),
            ITEMS,
            each={"index": "index"},
            shared={"x": "x"},
        ),
        PipelineStep(
            Graph.of(
                "better",
                {**parameters, "root": root, "square": square},
                {"root": better, "goes_on": goes_on},
            ),
            ITEMS,
            most=most,
        ),
        PipelineStep(
            Graph.of("sum", {**parameters, "roots": roots}, {"sum": factor * ca.sum1(roots)}),
            shared={"roots": "root"},
        ),
    )
    inputs = (Variable("parameters", (1,)), Variable("x", (1,)))
    return Pipeline("square_roots", inputs, steps, ("root", "sum"))


def run_all(run, x):
    roots = np.empty((len(x), ITEMS))
    total = np.empty((len(x), 1))
    run(np.array([POWER]), [x.reshape(-1, 1)], [roots, total])
    return roots, total[:, 0]


@pytest.fixture(scope="module")
def of_roots():
    return kernel("test_square_roots", "", square_roots, ("float64",) * 2, is_loop=True)


def expected(x):
    roots = np.sqrt(x[:, None] + np.arange(ITEMS))
    return roots, POWER * roots.sum(axis=1)


def test_interpreted_and_compiled_results_are_those_of_numpy(of_roots):
    x = np.linspace(0.5, 200.0, 30)
    for found in (run_all(of_roots._interpreted(), x), run_all(of_roots, x)):
        for one, other in zip(found, expected(x), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-14)
    of_roots.compile()
    assert "compiled" in repr(of_roots)
    for one, other in zip(run_all(of_roots, x), expected(x), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-14)


def test_results_are_nan_where_an_input_is_not_finite(of_roots):
    of_roots.compile()
    x = np.array([2.0, np.nan, np.inf, 3.0])
    for run in (of_roots, of_roots._interpreted()):
        roots, total = run_all(run, x)
        assert np.isnan(roots[1:3]).all() and np.isnan(total[1:3]).all()
        assert np.isfinite(roots[[0, 3]]).all() and np.isfinite(total[[0, 3]]).all()


def test_a_step_is_repeated_so_often_at_most():
    few = kernel("test_two_steps", "", lambda: square_roots(most=2), ("float64",) * 2)
    x = np.array([100.0])
    once = (1 + 100.0) / 2
    second = (once + 100.0 / once) / 2
    for _ in range(2):
        assert run_all(few, x)[0][0, 0] == pytest.approx(second, rel=1e-14)
        few.compile()


def test_single_calls_give_the_same(of_roots):
    made = []
    call = SingleCall(
        of_roots, np.array([POWER]), (ITEMS,), install=made.append, example=[np.array([4.0])]
    )
    call.compile()
    (function,) = made
    roots, packed = function(np.array([7.0]), None)
    np.testing.assert_allclose(roots, np.sqrt(7.0 + np.arange(ITEMS)), rtol=1e-14)
    assert np.frombuffer(packed)[0] == pytest.approx(POWER * roots.sum(), rel=1e-14)


def halves(items):
    """Return the program of the halves of numbers from the largest to the smallest, of negative ones 0 instead."""
    factor = ca.SX.sym("factor")
    x = ca.SX.sym("x", items)
    index = ca.SX.sym("index")
    number = ca.SX.sym("number")
    numbers = ca.SX.sym("numbers", items)
    half = ca.SX.sym("half")
    chosen = sum(
        (ca.if_else(index == float(k), one, 0.0) for k, one in enumerate(ca.vertsplit(x))), ca.SX(0)
    )
    larger = sum(
        (ca.if_else(other > number, 1.0, 0.0) for other in ca.vertsplit(numbers)), ca.SX(0)
    )
    parameters = {"parameters": factor}
    steps = (
        PipelineStep(
            Graph.of(
                "numbers",
                {**parameters, "index": index, "x": x},
                {"number": chosen, "is_negative": ca.if_else(chosen < 0.0, 1.0, 0.0)},
            ),
            items,
            each={"index": "index"},
            shared={"x": "x"},
        ),
        PipelineStep(
            Graph.of("half", {**parameters, "number": number}, {"half": number / factor}),
            items,
            skips="is_negative",
        ),
        PipelineStep(
            Graph.of(
                "sorted",
                {**parameters, "number": number, "numbers": numbers, "half": half},
                {"sorted_half": half, "place": larger},
            ),
            items,
            shared={"numbers": "number"},
            places="place",
        ),
    )
    inputs = (Variable("parameters", (1,)), Variable("x", (items,)))
    return Pipeline("halves", inputs, steps, ("half", "sorted_half"))


@pytest.mark.parametrize("items", [3, 8, 11, 24])
def test_items_are_skipped_and_sorted(items):
    of_halves = kernel("test_halves", f"{items}", lambda: halves(items), ("float64",) * 2)
    rng = np.random.default_rng(5)
    x = np.stack([rng.permutation(items) - shift for shift in (0.0, items / 2 + 0.1, items + 1.0)])
    half = np.where(x < 0, 0.0, x / 2)
    expected = half, np.take_along_axis(half, np.argsort(-x, axis=1), axis=1)
    for run in (of_halves._interpreted(), of_halves):
        found = [np.empty((len(x), items)) for _ in range(2)]
        run(np.array([2.0]), [x], found)
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)
        of_halves.compile()
    assert "compiled" in repr(of_halves)


def test_a_repeated_step_neither_skips_nor_sorts():
    with pytest.raises(ValueError, match="better: a step that is repeated has all items"):
        replace(square_roots().steps[1], skips="square")


def test_inputs_that_do_not_fit_are_refused():
    factor = ca.SX.sym("factor")
    x = ca.SX.sym("x", 2)
    graph = Graph.of("step", {"parameters": factor, "x": x}, {"y": x})
    with pytest.raises(ValueError, match="step: x has 2 entries, but x has 1 times 3"):
        Pipeline(
            "wrong",
            (Variable("parameters", (1,)), Variable("x", (3,))),
            (PipelineStep(graph),),
            ("y",),
        )


def test_names_that_no_step_has_are_refused():
    whole = square_roots()
    first, *others = whole.steps
    with pytest.raises(ValueError, match="nonsense is not one number of each of"):
        replace(whole, steps=(replace(first, skips="nonsense"), *others))
    with pytest.raises(ValueError, match="nothing is not one number of each of"):
        replace(whole, steps=(replace(first, places="nothing"), *others))
    with pytest.raises(ValueError, match="no step has the output missing"):
        replace(whole, results=("missing",))


def test_inputs_of_all_items_may_be_one_output_of_a_single_item():
    factor, x, own = ca.SX.sym("factor"), ca.SX.sym("x", 16), ca.SX.sym("pair", 2)
    first = Graph.of("first", {"parameters": factor, "x": x}, {"pairs": factor * x})
    second = Graph.of("second", {"parameters": factor, "pair": own}, {"y": own[0] - own[1]})
    pipeline = Pipeline(
        "differences",
        (Variable("parameters", (1,)), Variable("x", (16,))),
        (PipelineStep(first), PipelineStep(second, 8, each={"pair": "pairs"})),
        ("y",),
    )
    rows = np.random.default_rng(0).uniform(-1, 1, (3, 16))
    expected = 2.0 * (rows[:, :8] - rows[:, 8:])
    run = kernel("test_differences", "", lambda: pipeline)
    for prepare in (lambda: None, run.compile):
        prepare()
        found = np.empty((3, 8))
        run(np.array([2.0]), [rows], [found])
        assert np.allclose(found, expected, rtol=0, atol=1e-15)
    assert "compiled" in repr(run)
