"""All solutions of one pose of an arm of :mod:`dhkit.kinematics.polynomial.two_parallel`, as one program.

In batches, poses are the lanes of vectors. Of a single pose, the 20 angles at which its polynomial is evaluated are,
then its 16 roots, then the 16 solutions at them.
"""

from __future__ import annotations

import math
import operator
from functools import reduce
from itertools import accumulate
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.closed_form.program import is_pose
from dhkit.kinematics.descent_program import orthonormal_goal
from dhkit.kinematics.polynomial.extension import Extension
from dhkit.kinematics.polynomial.roots_program import (
    BEYOND,
    CONVERGED,
    ERROR_OF_VALUE,
    FIRST_ANGLE,
    FIRST_RADII,
    MOST_STEPS,
    NEAR_ROOTS,
    aberth_step,
    are_near,
    coefficients,
    complex_of,
    nearly_real,
    polynomial_of,
    sizes_of,
)
from dhkit.kinematics.polynomial.solve import CLOSES, SAME_ANGLE
from dhkit.kinematics.polynomial.trigonometric import (
    DEGREE,
    DOUBTFUL,
    NONE,
    ROOTS,
    SAMPLES,
    SOLUTION,
)
from dhkit.kinematics.polynomial.two_parallel_program import (
    COUNT,
    Numbers,
    fitting_signs,
    last_frame,
    polynomial_value,
    solution_function,
)
from dhkit.kinematics.solutions import LIMIT_SLACK
from dhkit.symbolic import Graph, Pipeline, PipelineStep
from dhkit.symbolic.programs.graph import Variable

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_COEFFICIENTS = 2 * DEGREE + 1
_TOGETHER = 8
"""Numbers whose reciprocals are computed together."""


def pose_program(meeting: tuple[int, int]) -> Pipeline:
    """Return the program: the tool's pose to solutions.

    Parameters are those of :class:`dhkit.kinematics.polynomial.two_parallel.TwoParallel`, then lower and upper limits.
    The outputs are

    - ``q``, 16 times 6, rad;
    - ``summary``, 16 times 3: what is known of the root (``NONE``, ``SOLUTION`` or ``DOUBTFUL``), the number by which
      solutions are sorted, and whether a joint is outside its limits;
    - ``details``, 16 times 8: whether it is nearly real, real, and so near to another that its solution may be
      singular; the error of its joint values; and which other combinations of signs fit, see :func:`fitting_signs`;
    - ``posed``, whether T is a pose;
    - ``error``, the largest coefficient beyond the degree of the polynomial, relative to the others.
    """
    steps = (
        _prepared(),
        _values(meeting),
        _known_coefficients(),
        _first_estimates(),
        _better_estimates(),
        _angles(),
        _solutions(meeting),
    )
    inputs = (Variable("parameters", (COUNT + 12,)), Variable("T", (4, 4)))
    return Pipeline(
        "two_parallel_pose", inputs, steps, ("q", "summary", "details", "posed", "error")
    )


def _parameters() -> _SX:
    return ca.SX.sym("parameters", COUNT + 12)


def _prepared() -> PipelineStep:
    """Return the step that makes the rotation orthonormal, and takes the polynomial's first angle."""
    parameters = _parameters()
    T = ca.SX.sym("T", 4, 4)
    goal = ca.vertcat(orthonormal_goal(T), ca.SX([[0.0, 0.0, 0.0, 1.0]]))
    # As TwoParallel.first_angle has it.
    p = Numbers.read(parameters[:COUNT])
    R, _ = last_frame(p, goal)
    _, sine_1 = p.alpha[1]
    nearest = ca.atan2(R[1, 2], R[0, 2]) - ca.atan2(-sine_1, 0.0)
    outputs = {
        "goal": goal,
        "first": nearest + math.pi / SAMPLES,
        "posed": ca.if_else(is_pose(T), 1.0, 0.0),
    }
    return PipelineStep(Graph.of("prepared", {"parameters": parameters, "T": T}, outputs))


def _values(meeting: tuple[int, int]) -> PipelineStep:
    """Return the step that evaluates the polynomial at equally spaced angles of joint 1."""
    parameters = _parameters()
    goal = ca.SX.sym("goal", 4, 4)
    first = ca.SX.sym("first")
    index = ca.SX.sym("index")
    angle = first + index * (math.tau / SAMPLES)
    p = Numbers.read(parameters[:COUNT])
    value = polynomial_value(p, meeting, goal, (ca.cos(angle), ca.sin(angle)))
    inputs = {"parameters": parameters, "goal": goal, "first": first, "index": index}
    return PipelineStep(
        Graph.of("value", inputs, {"value": value}),
        items=SAMPLES,
        each={"index": "index"},
        shared={"goal": "goal", "first": "first"},
    )


def _known_coefficients() -> PipelineStep:
    """Return the step from values to coefficients, and the largest one beyond the degree."""
    values = ca.SX.sym("values", SAMPLES)
    numbers, error = coefficients(values, DEGREE)
    sizes = ca.vertcat(*sizes_of(polynomial_of(numbers, DEGREE)))
    inputs = {"parameters": _parameters(), "values": values}
    outputs = {"numbers": numbers, "sizes": sizes, "error": error}
    graph = Graph.of("coefficients", inputs, outputs)
    return PipelineStep(graph, shared={"values": "value"})


def _first_estimates() -> PipelineStep:
    """Return the step with the first estimates of the roots, beside the unit circle inside and outside in turn."""
    index = ca.SX.sym("index")
    is_odd = index - 2.0 * ca.floor(index / 2.0) > 0.5
    radius = ca.if_else(is_odd, FIRST_RADII[1], FIRST_RADII[0])
    angle = FIRST_ANGLE + index * (math.tau / ROOTS)
    inputs = {"parameters": _parameters(), "index": index}
    outputs = {"x": radius * ca.cos(angle), "y": radius * ca.sin(angle)}
    graph = Graph.of("first_estimates", inputs, outputs)
    return PipelineStep(graph, ROOTS, each={"index": "index"})


def _better_estimates() -> PipelineStep:
    """Return Aberth's step for each root, which is repeated until none moves."""
    numbers = ca.SX.sym("numbers", _COEFFICIENTS)
    index, root, others = _root_and_others()
    sizes = ca.SX.sym("sizes", _COEFFICIENTS)
    apart = [root - other for other in others]
    squares = []
    for j, z in enumerate(apart):
        is_other = index != float(j)
        squares.append(ca.if_else(is_other, z.x * z.x + z.y * z.y, 1.0))
    # 1 / z = (x - i y) / (x^2 + y^2), and 0 of the root itself, whose x and y are 0.
    repulsion = complex_of(ca.SX(0.0), ca.SX(0.0))
    for z, over in zip(apart, _reciprocals(squares), strict=True):
        repulsion = repulsion + complex_of(z.x * over, -z.y * over)
    polynomial = polynomial_of(numbers, DEGREE)
    moved, step = aberth_step(polynomial, ca.vertsplit(sizes), root, repulsion)
    inputs = {
        "parameters": _parameters(),
        "numbers": numbers,
        "sizes": sizes,
        **_inputs_of(index, root, others),
    }
    outputs = {"x": moved.x, "y": moved.y, "goes_on": ca.if_else(step >= CONVERGED, 1.0, 0.0)}
    return PipelineStep(
        Graph.of("better_estimates", inputs, outputs),
        ROOTS,
        each={"index": "index"},
        shared={"numbers": "numbers", "sizes": "sizes", "xs": "x", "ys": "y"},
        most=MOST_STEPS,
    )


def _angles() -> PipelineStep:
    """Return the step that tells which roots are real, and their angles of joint 1."""
    numbers = ca.SX.sym("numbers", _COEFFICIENTS)
    error = ca.SX.sym("error")
    first = ca.SX.sym("first")
    index, root, others = _root_and_others()
    tolerance = ca.fmax(ERROR_OF_VALUE, error)
    angle, height, is_real = nearly_real(polynomial_of(numbers, DEGREE), root, tolerance)
    is_double = ca.SX(0.0) > 0.0
    for j, other in enumerate(others):
        is_other = ca.logic_and(index != float(j), are_near(root, other))
        is_double = ca.logic_or(is_double, is_other)
    is_double = ca.logic_and(is_double, height < NEAR_ROOTS)

    is_tried = angle < BEYOND
    inputs = {
        "parameters": _parameters(),
        "numbers": numbers,
        "error": error,
        "first": first,
        **_inputs_of(index, root, others),
    }
    outputs = {
        "angle": ca.if_else(is_tried, angle, 0.0) + first,
        "is_tried": ca.if_else(is_tried, 1.0, 0.0),
        "is_real": is_real,
        "is_double": ca.if_else(is_double, 1.0, 0.0),
    }
    return PipelineStep(
        Graph.of("angles", inputs, outputs),
        ROOTS,
        each={"index": "index"},
        shared={"numbers": "numbers", "error": "error", "first": "first", "xs": "x", "ys": "y"},
    )


def _solutions(meeting: tuple[int, int]) -> PipelineStep:
    """Return the step from roots to solutions."""
    parameters = _parameters()
    goal = ca.SX.sym("goal", 4, 4)
    angle = ca.SX.sym("angle")
    of_root = [ca.SX.sym(name) for name in ("is_tried", "is_real", "is_double")]
    is_tried, is_real, is_double = of_root
    p = Numbers.read(parameters[:COUNT])
    signs, also = fitting_signs(p, meeting, goal, angle)
    q, error, is_regular = solution_function(meeting)(parameters[:COUNT], goal, angle, signs)

    has_more = ca.SX(ca.sum1(also)) > 0.0
    is_delicate = ca.logic_and(is_double != 0.0, ca.logic_not(is_regular))
    is_alone = ca.logic_not(ca.logic_or(is_delicate, has_more))
    is_sure = ca.logic_and(ca.logic_and(is_real != 0.0, error <= CLOSES), is_alone)
    kind = ca.if_else(is_tried != 0.0, ca.if_else(is_sure, SOLUTION, DOUBTFUL), NONE)
    q_1, q_2, q_3 = (ca.floor(q[k] / SAME_ANGLE + 0.5) * SAME_ANGLE for k in range(3))
    order = q_1 + 0.1 * SAME_ANGLE * (q_2 + 0.1 * q_3)

    # lower <= q + 2 pi k <= upper for some whole k.
    lower = parameters[COUNT : COUNT + 6] - LIMIT_SLACK
    upper = parameters[COUNT + 6 :] + LIMIT_SLACK
    windings = ca.floor((upper - q) / math.tau) + ca.floor((q - lower) / math.tau)
    is_outside = reduce(ca.fmin, ca.vertsplit(windings)) < 0.0
    inputs = {
        "parameters": parameters,
        "goal": goal,
        "angle": angle,
        **{symbol.name(): symbol for symbol in of_root},
    }
    # What follows from complex roots is without meaning: 0.
    of_solution = [*ca.vertsplit(q), order, is_outside, error, *ca.vertsplit(also)]
    *joints, order, is_outside, error, also_1, also_2, also_3, also_4 = (
        ca.if_else(is_tried != 0.0, x, 0.0) for x in of_solution
    )
    outputs = {
        "q": ca.vertcat(*joints),
        "summary": ca.vertcat(kind, order, is_outside),
        "details": ca.vertcat(
            is_tried,
            is_real,
            ca.if_else(is_delicate, 1.0, 0.0),
            error,
            also_1,
            also_2,
            also_3,
            also_4,
        ),
    }
    return PipelineStep(
        Graph.of("solutions", inputs, outputs),
        ROOTS,
        shared={"goal": "goal"},
    )


def _reciprocals(numbers: list[_SX]) -> list[_SX]:
    """Return 1 / x of positive numbers, with one division for each eight, for it takes as long as some 16 products."""
    reciprocals: list[_SX] = []
    for begin in range(0, len(numbers), _TOGETHER):
        part = numbers[begin : begin + _TOGETHER]
        # before[k] is the product of those before k, and after that of those behind k over that of all.
        before = list(accumulate(part, operator.mul, initial=ca.SX(1.0)))
        after = 1.0 / before[-1]
        found = []
        for k in reversed(range(len(part))):
            found.append(before[k] * after)
            after = after * part[k]
        reciprocals += reversed(found)
    return reciprocals


def _root_and_others() -> tuple[_SX, Extension, list[Extension]]:
    """Return symbols of a root's number, of the root, and of all roots."""
    index = ca.SX.sym("index")
    root = complex_of(ca.SX.sym("x"), ca.SX.sym("y"))
    xs = ca.vertsplit(ca.SX.sym("xs", ROOTS))
    ys = ca.vertsplit(ca.SX.sym("ys", ROOTS))
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
