"""Steps of a pipeline from the values of a trigonometric polynomial to its roots, sorted, and what is known of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.polynomial.estimate_steps import (
    PolynomialSource,
    estimate_steps,
    total_of,
)
from dhkit.kinematics.polynomial.root_kinds import DEGREE, NONE, ROOTS, SAMPLES
from dhkit.kinematics.polynomial.root_symbols import (
    BEYOND,
    NEAR_ROOTS,
    coefficients,
    complex_of,
    nearly_real,
    polynomial_of,
    square_of_distance,
)
from dhkit.symbolic import Graph, Pipeline, PipelineStep
from dhkit.symbolic.programs.graph import Variable

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
OF_ROOT = ("angle", "is_tried", "is_real", "closeness")
"""Outputs for each root."""
_ON_CIRCLE = 1e-6
"""Imaginary part of a root, rad, above which it is not surely real."""


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
        sorted_step(parameters, "sorted_roots", "is_idle", dict.fromkeys((*OF_ROOT, "is_idle"), 1)),
    )


def roots_program() -> Pipeline:
    """Return the program from the values of a polynomial, and their first angle, to what is known of its roots.

    The outputs are those of :func:`root_steps` before they are sorted.
    """
    parameters = ca.SX.sym("none")
    inputs = (Variable("parameters", (1,)), Variable("value", (SAMPLES,)), Variable("first", (1,)))
    *steps, _ = root_steps(parameters)
    return Pipeline("trigonometric_roots", inputs, tuple(steps), (*OF_ROOT, "error"))


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
    numbers = ca.SX.sym("numbers", PolynomialSource(DEGREE).coefficients)
    error = ca.SX.sym("error")
    first = ca.SX.sym("first")
    index = ca.SX.sym("index")
    root = complex_of(ca.SX.sym("x"), ca.SX.sym("y"))
    xs = ca.SX.sym("xs", ROOTS)
    ys = ca.SX.sym("ys", ROOTS)
    angle, height, is_real = nearly_real(polynomial_of(numbers, DEGREE), root, error)
    nearest = ca.SX(math.inf)
    for j, (x, y) in enumerate(zip(ca.vertsplit(xs), ca.vertsplit(ys), strict=True)):
        distance = square_of_distance(root, complex_of(x, y))
        nearest = ca.fmin(nearest, ca.if_else(index != float(j), distance, math.inf))
    # A complex root that is not tried has no solution that could be that of its neighbour.
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
        "index": index,
        "x": root.x,
        "y": root.y,
        "xs": xs,
        "ys": ys,
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


def sorted_step(
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
