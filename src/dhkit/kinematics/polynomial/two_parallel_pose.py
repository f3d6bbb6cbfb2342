"""All solutions of one pose of an arm of :mod:`dhkit.kinematics.polynomial.two_parallel`, as one program.

The 20 angles at which the pose's polynomial is evaluated lie in the lanes of vectors, then its 16 roots, then the 16
solutions at them.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.closed_form.program import is_pose
from dhkit.kinematics.descent_program import orthonormal_goal
from dhkit.kinematics.polynomial.extension import SIGNS
from dhkit.kinematics.polynomial.pose_steps import RESULTS, known_solutions, solving_steps
from dhkit.kinematics.polynomial.root_kinds import SAMPLES
from dhkit.kinematics.polynomial.root_steps import root_steps
from dhkit.kinematics.polynomial.two_parallel_program import (
    COUNT,
    Numbers,
    fitting_signs,
    last_frame,
    polynomial_value,
    solution_function,
)
from dhkit.symbolic import Graph, Pipeline, PipelineStep
from dhkit.symbolic.programs.graph import Variable

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_LIMITS = 12


def pose_program(meeting: tuple[int, int]) -> Pipeline:
    """Return the program: the tool's pose to solutions, as :data:`dhkit.kinematics.polynomial.pose_steps.RESULTS`.

    Parameters are those of :class:`dhkit.kinematics.polynomial.two_parallel.TwoParallel`, then lower and upper limits.
    The last detail of a root tells which other combinations of signs fit, as bits of a number, see
    :func:`dhkit.kinematics.polynomial.two_parallel_program.fitting_signs`.
    """
    parameters = ca.SX.sym("parameters", COUNT + _LIMITS)
    steps = (
        _prepared(parameters),
        _values(parameters, meeting),
        *root_steps(parameters),
        *solving_steps(parameters, _solutions(parameters, meeting), ("goal",)),
    )
    inputs = (Variable("parameters", (COUNT + _LIMITS,)), Variable("T", (4, 4)))
    return Pipeline("two_parallel_pose", inputs, steps, RESULTS)


def _prepared(parameters: _SX) -> PipelineStep:
    """Return the step that makes the rotation orthonormal, and takes the polynomial's first angle.

    Where k and axis 6 are parallel, a denominator is 0. The two angles at which they are nearest to parallel, pi apart,
    lie in the middle between two of the angles.
    """
    T = ca.SX.sym("T", 4, 4)
    goal = ca.vertcat(orthonormal_goal(T), ca.SX([[0.0, 0.0, 0.0, 1.0]]))
    p = Numbers.read(parameters[:COUNT])
    R, _ = last_frame(p, goal)
    # Axis 6 in the first frame, in which k at q1 = 0 is Rx(alpha_1) (0, 0, 1), and joint 1 turns it about z.
    _, sine_1 = p.alpha[1]
    nearest = ca.atan2(R[1, 2], R[0, 2]) - ca.atan2(-sine_1, 0.0)
    outputs = {
        "goal": goal,
        "first": nearest + math.pi / SAMPLES,
        "posed": ca.if_else(is_pose(T), 1.0, 0.0),
    }
    return PipelineStep(Graph.of("prepared", {"parameters": parameters, "T": T}, outputs))


def _values(parameters: _SX, meeting: tuple[int, int]) -> PipelineStep:
    """Return the step that evaluates the polynomial at equally spaced angles of joint 1."""
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


def _solutions(parameters: _SX, meeting: tuple[int, int]) -> Graph:
    """Return the program from a root to its solution."""
    goal = ca.SX.sym("goal", 4, 4)
    angle = ca.SX.sym("angle")
    of_root = [ca.SX.sym(name) for name in ("is_tried", "is_real", "closeness")]
    is_tried, is_real, closeness = of_root
    signs, also = fitting_signs(Numbers.read(parameters[:COUNT]), meeting, goal, angle)
    others = ca.dot(ca.DM([2.0**k for k in range(len(SIGNS))]), also)
    q, error, is_regular = solution_function(meeting)(parameters[:COUNT], goal, angle, signs)
    is_delicate = ca.logic_not(is_regular)
    inputs = {
        "parameters": parameters,
        "goal": goal,
        "angle": angle,
        **{symbol.name(): symbol for symbol in of_root},
    }
    return known_solutions(
        parameters,
        inputs,
        (is_tried, is_real),
        q,
        error,
        closeness,
        is_delicate,
        0,
        others,
    )
