"""Steps of programs for one pose that all ways of elimination share: from values to roots, then to sorted solutions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.polynomial.estimate_steps import (
    PolynomialSource,
    estimate_steps,
    total_of,
)
from dhkit.kinematics.polynomial.extension import Extension
from dhkit.kinematics.polynomial.root_symbols import (
    BEYOND,
    NEAR_ROOTS,
    coefficients,
    complex_of,
    nearly_real,
    polynomial_of,
    square_of_distance,
)
from dhkit.kinematics.polynomial.solve import CLOSES, INEXACT, SAME_ANGLE, SORTED_BY, sorting_key
from dhkit.kinematics.polynomial.trigonometric import (
    DEGREE,
    DOUBTFUL,
    IS_BESIDE,
    IS_DELICATE,
    IS_REAL,
    IS_TRIED,
    NEAR_SOLUTION,
    NONE,
    ROOTS,
    SAMPLES,
    SOLUTION,
)
from dhkit.kinematics.solutions import LIMIT_SLACK
from dhkit.symbolic import Graph, Pipeline, PipelineStep
from dhkit.symbolic.programs.graph import Variable

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
RESULTS = ("sorted_q", "sorted_is_outside", "sorted_details", "verdict", "error")
"""Outputs of a pose's program; the roots are sorted by their joint values, and those without a solution are the last.

- joint values, 16 times 6, rad, NaN where there is no solution;
- whether a joint is outside its limits, 16 times;
- details of the root, 16 times 4: what is known of it, as the sum of ``IS_TRIED``, ``IS_REAL``, ``IS_BESIDE`` and
  ``IS_DELICATE``; the error of its joint values; its angle, rad; and a number that the way of elimination reads, 0
  where the root has just one solution;
- ``verdict``, the number of solutions if all are known, plus a fraction if some lie so near that they may be the same
  one; 0 if they are not known, or T is no pose;
- ``error``, the largest coefficient beyond the degree of the polynomial, relative to the others.
"""
_ON_CIRCLE = 1e-6
"""Imaginary part of a root, rad, above which it is not surely real."""
_AT_ROOT = 1e-5
"""Half the distance of a solution from its root, rad, above which it may be that of another root."""
_COEFFICIENTS = 2 * DEGREE + 1
_OF_ROOT = ("angle", "is_tried", "is_real", "closeness")
_OF_SOLUTION = ("q", "is_outside", "details", "kind")
_BELOW_ALL = 8.0
"""More than any number by which solutions are sorted, whose largest are near pi."""


def root_steps(parameters: _SX) -> tuple[PipelineStep, ...]:
    """Return the steps from ``value``, of equally spaced angles from ``first`` on, to what is known of the roots.

    Their outputs are ``error``, and of each root ``sorted_angle``, rad, ``sorted_is_tried``, ``sorted_is_real``,
    ``sorted_closeness``, 1 where another root is nearer than ``NEAR_ROOTS`` or at the same angle, else 0, and
    ``sorted_is_idle``, 1 of a root that is surely complex, else 0. The roots that are surely complex are the last.

    Parameters
    ----------
    parameters
        Symbols of the pipeline's parameters.
    """
    return (
        _known_coefficients(parameters),
        *estimate_steps(parameters, PolynomialSource(DEGREE)),
        _angles(parameters),
        _sorted(parameters, "sorted_roots", "is_idle", dict.fromkeys((*_OF_ROOT, "is_idle"), 1)),
    )


def roots_program() -> Pipeline:
    """Return the program from the values of a polynomial, and their first angle, to what is known of its roots.

    The outputs are those of :func:`root_steps` before they are sorted.
    """
    parameters = ca.SX.sym("none")
    inputs = (Variable("parameters", (1,)), Variable("value", (SAMPLES,)), Variable("first", (1,)))
    *steps, _ = root_steps(parameters)
    return Pipeline("trigonometric_roots", inputs, tuple(steps), (*_OF_ROOT, "error"))


def solving_steps(
    parameters: _SX, solutions: Graph, shared: Sequence[str]
) -> tuple[PipelineStep, ...]:
    """Return the steps from the outputs of :func:`root_steps` to the sorted results.

    Roots that are surely complex, about half of them all, are skipped.

    Parameters
    ----------
    parameters
        Symbols of the pipeline's parameters.
    solutions
        Program of :func:`known_solutions`.
    shared
        Outputs of earlier steps that it uses for all roots.
    """
    sizes = {one.name: one.size for one in solutions.outputs}
    return (
        PipelineStep(
            solutions,
            ROOTS,
            each={name: f"sorted_{name}" for name in _OF_ROOT},
            shared={name: name for name in shared},
            skips="sorted_is_idle",
        ),
        _sorted(
            parameters,
            "sorted_solutions",
            "key",
            {name: sizes[name] for name in _OF_SOLUTION},
            missing=("q", "kind"),
        ),
        _verdict(parameters),
    )


def _known_coefficients(parameters: _SX) -> PipelineStep:
    """Return the step from values to coefficients, and the largest one beyond the degree."""
    values = ca.SX.sym("values", SAMPLES)
    numbers, error = coefficients(values, DEGREE)
    inputs = {"parameters": parameters, "values": values}
    outputs = {"numbers": numbers, "total": total_of(numbers, DEGREE), "error": error}
    graph = Graph.of("coefficients", inputs, outputs)
    return PipelineStep(graph, shared={"values": "value"})


def _angles(parameters: _SX) -> PipelineStep:
    """Return the step that tells which roots are real, and their angles."""
    numbers = ca.SX.sym("numbers", _COEFFICIENTS)
    error = ca.SX.sym("error")
    first = ca.SX.sym("first")
    index, root, others = _root_and_others(ROOTS)
    angle, height, is_real = nearly_real(polynomial_of(numbers, DEGREE), root, error)
    nearest = ca.SX(math.inf)
    for j, other in enumerate(others):
        nearest = ca.fmin(
            nearest, ca.if_else(index != float(j), square_of_distance(root, other), math.inf)
        )
    # A root that far from the real axis has no solution that could be the same as that of its neighbour.
    nearest = ca.fmax(nearest, height * height)
    is_tried = angle < BEYOND
    # The root 1 / conj(z) is at the same angle: both lead to one solution.
    is_double = ca.logic_and(is_tried, height > _ON_CIRCLE)
    closeness = ca.if_else(ca.logic_or(nearest < NEAR_ROOTS**2, is_double), 1.0, 0.0)
    inputs = {
        "parameters": parameters,
        "numbers": numbers,
        "error": error,
        "first": first,
        **_inputs_of(index, root, others),
    }
    # A root that is not tried, but perhaps real, makes its pose doubtful.
    is_idle = ca.logic_not(ca.logic_or(is_tried, is_real != 0.0))
    outputs = {
        "angle": ca.if_else(is_tried, angle, 0.0) + first,
        "is_tried": ca.if_else(is_tried, 1.0, 0.0),
        "is_real": is_real,
        "closeness": closeness,
        "is_idle": ca.if_else(is_idle, 1.0, 0.0),
    }
    return PipelineStep(
        Graph.of("angles", inputs, outputs),
        ROOTS,
        each={"index": "index"},
        shared={"numbers": "numbers", "error": "error", "first": "first", "xs": "x", "ys": "y"},
    )


def _verdict(parameters: _SX) -> PipelineStep:
    """Return the step that tells whether all solutions are known, as ``verdict`` of :data:`RESULTS`."""
    kinds = ca.SX.sym("kinds", ROOTS)
    posed = ca.SX.sym("posed")
    error = ca.SX.sym("error")
    terms = ca.vertsplit(kinds)
    while len(terms) > 1:
        terms = [sum(terms[k + 1 : k + 2], terms[k]) for k in range(0, len(terms), 2)]
    (total,) = terms
    # Complex roots come in pairs: an odd number is not all.
    pairs = ca.floor(total / 2.0)
    is_even = total - 2.0 * pairs < 1.0
    is_known = ca.logic_and(posed == 1.0, error < INEXACT)
    is_sure = ca.logic_and(ca.logic_and(is_known, total < DOUBTFUL), is_even)
    verdict = ca.if_else(is_sure, total, 0.0)
    inputs = {"parameters": parameters, "kinds": kinds, "posed": posed, "error": error}
    return PipelineStep(
        Graph.of("verdict", inputs, {"verdict": verdict}),
        shared={"kinds": "sorted_kind", "posed": "posed", "error": "error"},
    )


def _sorted(
    parameters: _SX,
    name: str,
    key: str,
    sizes: Mapping[str, int],
    missing: tuple[str, str] | None = None,
) -> PipelineStep:
    """Return the step that sorts roots by a key, with outputs ``sorted_...`` for those of earlier steps.

    Parameters
    ----------
    parameters
        Symbols of the pipeline's parameters.
    name
        Name of its program.
    key
        Output of an earlier step: a number of each root.
    sizes
        Numbers of entries of the outputs that are sorted, by their names.
    missing
        An output that becomes NaN, and the one with the kind of a root, where that is ``NONE``.
    """
    index = ca.SX.sym("index")
    own = ca.SX.sym("own_key")
    keys = ca.SX.sym("keys", ROOTS)
    place = place_in_order(own, index, keys)
    values = {source: ca.SX.sym(source, size) for source, size in sizes.items()}
    inputs = {"parameters": parameters, "index": index, "own_key": own, "keys": keys, **values}
    outputs = {f"sorted_{source}": value for source, value in values.items()}
    if missing:
        joints, kind = missing
        outputs[f"sorted_{joints}"] = ca.if_else(values[kind] != NONE, values[joints], math.nan)
    return PipelineStep(
        Graph.of(name, inputs, {**outputs, "place": place}),
        ROOTS,
        each={"index": "index", "own_key": key},
        shared={"keys": key},
        places="place",
    )


def place_in_order(own: _SX, index: _SX, keys: _SX) -> _SX:
    """Return the place of an item among all in ascending order of their keys; equal ones stay in their order.

    Parameters
    ----------
    own, index
        The item's key and number.
    keys
        The keys of all items.
    """
    place = ca.SX(0.0)
    for j, other in enumerate(ca.vertsplit(keys)):
        is_earlier = ca.logic_and(other == own, float(j) < index)
        place = place + ca.if_else(ca.logic_or(other < own, is_earlier), 1.0, 0.0)
    return place


def known_solutions(
    parameters: _SX,
    inputs: dict[str, _SX],
    of_root: Sequence[_SX],
    q: _SX,
    error: _SX,
    closeness: _SX,
    is_delicate: _SX,
    place: int,
    more: _SX = 0.0,
) -> Graph:
    """Return the program of the last step: joint values at roots, and what is known of them.

    Parameters
    ----------
    parameters
        Symbols of the parameters; the last twelve are lower and upper limits.
    inputs
        Inputs of the step, the root's ``angle`` among them, rad, besides ``is_tried`` and ``is_real``.
    of_root
        Symbols of ``is_tried`` and ``is_real``.
    q, error
        Joint values, 6 x 1, rad, and their error.
    closeness, is_delicate
        Whether another root is near, and whether the solution may be singular.
    place
        Index of the joint that the polynomial is in.
    more
        The last detail, above 0 at a root that has further solutions.
    """
    is_tried, is_real = of_root
    # Iteration from joint values that are not those of the root may lead to the solution of another root.
    away = ca.fabs(ca.sin((q[place] - inputs["angle"]) / 2.0))
    is_delicate = ca.logic_or(is_delicate, ca.logic_not(away < _AT_ROOT))
    is_alone = ca.logic_not(ca.logic_or(is_delicate, more > 0.0))
    is_sure = ca.logic_and(ca.logic_and(is_real != 0.0, error <= CLOSES), is_alone)
    of_complex = ca.if_else(is_real != 0.0, DOUBTFUL, NONE)
    one = ca.if_else(closeness > 0.0, NEAR_SOLUTION, SOLUTION)
    kind = ca.if_else(is_tried != 0.0, ca.if_else(is_sure, one, DOUBTFUL), of_complex)
    # As dhkit.kinematics.eliminated.ordered has it. Angles at -pi are those at pi.
    some = ca.vertsplit(q[:SORTED_BY])
    around = [ca.if_else(x < SAME_ANGLE - math.pi, x + math.tau, x) for x in some]
    order = sorting_key([ca.floor(x / SAME_ANGLE + 0.5) * SAME_ANGLE for x in around])
    # Finite even where q is NaN: the place at which a root is stored follows from it.
    order = ca.if_else(ca.fabs(order) < _BELOW_ALL, order, 0.0)

    # lower <= q + 2 pi k <= upper for some whole k.
    lower = parameters[-12:-6] - LIMIT_SLACK
    upper = parameters[-6:] + LIMIT_SLACK
    windings = ca.floor((upper - q) / math.tau) + ca.floor((q - lower) / math.tau)
    is_outside = reduce(ca.fmin, ca.vertsplit(windings)) < 0.0

    def at_tried(x: _SX) -> _SX:
        """Return 0 where the root is complex: what follows from it is without meaning."""
        return ca.if_else(is_tried != 0.0, x, 0.0)

    known = [
        (is_tried != 0.0, IS_TRIED),
        (is_real != 0.0, IS_REAL),
        (closeness > 0.0, IS_BESIDE),
        (is_delicate, IS_DELICATE),
    ]
    state = sum(ca.if_else(is_so, float(bit), 0.0) for is_so, bit in known)
    details = [state, *map(at_tried, (error, inputs["angle"], more))]
    outputs = {
        "q": ca.vertcat(*map(at_tried, ca.vertsplit(q))),
        "is_outside": at_tried(is_outside),
        "details": ca.vertcat(*details),
        "kind": kind,
        # Roots without a solution come last, with the key 0, as skipped ones have: all other keys are negative.
        "key": ca.if_else(kind != NONE, at_tried(order) - _BELOW_ALL, 0.0),
    }
    return Graph.of("solutions", inputs, outputs)


def _root_and_others(count: int) -> tuple[_SX, Extension, list[Extension]]:
    """Return symbols of a root's number, of the root, and of all roots."""
    index = ca.SX.sym("index")
    root = complex_of(ca.SX.sym("x"), ca.SX.sym("y"))
    xs = ca.vertsplit(ca.SX.sym("xs", count))
    ys = ca.vertsplit(ca.SX.sym("ys", count))
    return index, root, [complex_of(x, y) for x, y in zip(xs, ys, strict=True)]


def _inputs_of(index: _SX, root: Extension, others: list[Extension]) -> dict[str, _SX]:
    """Return the symbols of :func:`_root_and_others` as inputs of a step."""
    return {
        "index": index,
        "x": root.x,
        "y": root.y,
        "xs": ca.vertcat(*(other.x for other in others)),
        "ys": ca.vertcat(*(other.y for other in others)),
    }
