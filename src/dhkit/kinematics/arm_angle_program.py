"""The parts of a turn of the arm angle in which an arm of seven joints is inside its limits, as one program.

The rotations of the shoulder and of the wrist are a fixed rotation before and after a turn by the arm angle psi about
the line from the shoulder to the wrist, so that all their entries are a + b cos(psi) + c sin(psi). So are

    cos(theta_1) sin(theta_2),  sin(theta_1) sin(theta_2),  cos(theta_2),
    cos(theta_3) sin(theta_2),  sin(theta_3) sin(theta_2),

and the same of theta_5, theta_6 and theta_7. A joint at its limit makes one of them, or a combination of two, a known
number (Shimizu et al. 2008, see :mod:`dhkit.kinematics.closed_form.arm_angle`): its roots divide the turn into parts,
and what is true in the middle of a part is true in all of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.closed_form.arm_angle import BentArm, bent_arms
from dhkit.kinematics.closed_form.family import Fit, Vector
from dhkit.kinematics.closed_form.formulas import SINGULAR, angle, hypot
from dhkit.kinematics.closed_form.program import is_pose
from dhkit.kinematics.limit_symbols import ArmSymbols, Limits, wave_root
from dhkit.kinematics.polynomial.root_steps import place_in_order
from dhkit.kinematics.turn_parts import (
    ARM_ANGLE_PARTS as PARTS,
    BEYOND,
    KNOWN,
    NO_POSE,
    UNKNOWN,
)
from dhkit.symbolic import Graph, Pipeline, PipelineStep

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_Wave: TypeAlias = tuple[_SX, _SX, _SX]
"""The numbers of a + b cos(psi) + c sin(psi)."""

_EQUATIONS = PARTS // 2
_TRIPLES = ((0, 1, 2), (4, 5, 6))
"""Joints of the shoulder and of the wrist, counted from 0."""
_WAVES = 5
"""Number of waves of a triple of joints."""


def arm_angle_program(fit: Fit) -> Pipeline:
    """Return the program of an arm with an arm angle: the tool's pose to ``RESULTS``.

    Parameters
    ----------
    fit
        The arm as a member of its family.
    """
    arm = ArmSymbols(fit)
    steps = (_equations(arm), _roots(arm.parameters), _parts(arm.parameters, arm.limits))
    return arm.pipeline("arm_angle_parts", steps)


def _equations(arm: ArmSymbols) -> PipelineStep:
    """Return the step that finds the waves, and the equations of joints at their limits."""
    T = ca.SX.sym("T", 4, 4)
    p = arm.p
    limits = arm.limits
    arms = bent_arms(p, arm.pose(T))
    twists = [(p["alpha1"][1], p["alpha2"][1]), (p["alpha5"][1], p["alpha6"][1])]

    # Waves at cos(psi) = sin(psi) = 0, which is no angle, are a; at 1 and 0 they are a + b, at 0 and 1 they are a + c.
    a, a_and_b, a_and_c = (
        _wave_values(bent_arms(p, arm.pose(T, free)), twists)
        for free in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    )
    waves = [(x, y - x, z - x) for x, y, z in zip(a, a_and_b, a_and_c, strict=True)]
    of_triples = [waves[k : k + _WAVES] for k in range(0, len(waves), _WAVES)]
    equations = [
        equation
        for k, of_triple in enumerate(of_triples)
        for equation in _at_limits(of_triple, limits, _TRIPLES[k % 2])
    ]
    # Equations without roots fill up the vectors.
    equations += [(1.0, 0.0, 0.0)] * (_EQUATIONS - len(equations))
    columns = [ca.vertcat(*column) for column in zip(*equations, strict=True)]

    is_aligned = ca.logic_or(*(_is_aligned(of_triples[k::2]) for k in range(2)))
    state = ca.if_else(is_aligned, float(UNKNOWN), float(KNOWN))
    state = ca.if_else(arms[0].elbow.miss == 0, state, float(BEYOND))
    state = ca.if_else(is_pose(T), state, float(NO_POSE))
    elbows = [limits.inside(3, angle(bent.elbow.theta_4)) for bent in arms]
    outputs = {
        # Each equation is there for either of its roots.
        "equation": ca.vertcat(*(ca.vertcat(column, column) for column in columns)),
        "waves": ca.vertcat(*(ca.vertcat(*wave) for wave in waves)),
        "elbows": ca.vertcat(*(ca.if_else(is_inside, 1.0, 0.0) for is_inside in elbows)),
        "state": state,
    }
    return PipelineStep(Graph.of("equations", {"parameters": arm.parameters, "T": T}, outputs))


def _wave_values(arms: Sequence[BentArm], twists: Sequence[tuple[_SX, _SX]]) -> list[_SX]:
    """Return the values of all waves: joint 4 bent to either side, the shoulder and the wrist, five of each."""
    return [
        value
        for arm in arms
        for axes, sines in zip((arm.shoulder, arm.wrist), twists, strict=True)
        for value in _of_triple(axes, sines)
    ]


def _of_triple(axes: tuple[Vector, Vector, Vector], twists: tuple[_SX, _SX]) -> tuple[_SX, ...]:
    """Return cos and sin(theta_1) sin(theta_2), cos(theta_2), cos and sin(theta_3) sin(theta_2) of three joints.

    The rotation Rz(theta_1) Rx(alpha_1) Rz(theta_2) Rx(alpha_2) Rz(theta_3) has, with twists of +-90 degrees, the third
    column and the third row

        (cos(theta_1) sin(theta_2) sin(alpha_2), sin(theta_1) sin(theta_2) sin(alpha_2),
         -cos(theta_2) sin(alpha_1) sin(alpha_2)),
        (cos(theta_3) sin(theta_2) sin(alpha_1), -sin(theta_3) sin(theta_2) sin(alpha_1), the same).

    Parameters
    ----------
    axes
        The rotation's columns.
    twists
        sin(alpha_1) and sin(alpha_2).
    """
    x, y, z = axes
    sin_1, sin_2 = twists
    return z[0] * sin_2, z[1] * sin_2, -z[2] * sin_1 * sin_2, x[2] * sin_1, -y[2] * sin_1


def _at_limits(waves: Sequence[_Wave], limits: Limits, joints: Sequence[int]) -> list[_Wave]:
    """Return the waves that are zero where a joint of a triple is at a limit, or where the outer ones may jump."""
    first_along, first_across, polar, last_along, last_across = waves
    first, middle, last = joints
    equations = []
    for ends in limits.ends:
        # sin(theta - end) sin(theta_2) of the outer joints, cos(theta_2) - cos(end) of the one between them.
        for along, across, joint in (
            (first_along, first_across, first),
            (last_along, last_across, last),
        ):
            cosine, sine = ends[joint]
            equations.append(
                tuple(y * cosine - x * sine for x, y in zip(along, across, strict=True))
            )
        a, b, c = polar
        equations.append((a - ends[middle][0], b, c))
    # The outer joints may jump where the one between them lines them up, at an extreme of cos(theta_2).
    _, b, c = polar
    equations.append((0.0, c, -b))
    return equations


def _is_aligned(of_bends: Sequence[Sequence[_Wave]]) -> _SX:
    """Return whether the outer joints of a triple turn about one line at every arm angle."""
    entries = [ca.fabs(x) for waves in of_bends for wave in waves[:2] for x in wave]
    return reduce(ca.fmax, entries) < SINGULAR


def _roots(parameters: _SX) -> PipelineStep:
    """Return the step of the roots: item k has one of equation k modulo 32, or pi."""
    equation = ca.SX.sym("equation", 3)
    index = ca.SX.sym("index")
    a, b, c = ca.vertsplit(equation)
    psi = wave_root((a, b, c), ca.if_else(index < float(_EQUATIONS), 1.0, -1.0))
    # The turn begins at the last number of the first half, which has no equation.
    psi = ca.if_else(index == _EQUATIONS - 1.0, -math.pi, psi)
    inputs = {"parameters": parameters, "equation": equation, "index": index}
    return PipelineStep(Graph.of("roots", inputs, {"root": psi}), PARTS, each={"index": "index"})


def _parts(parameters: _SX, limits: Limits) -> PipelineStep:
    """Return the step that tells of the part from each root to the next one whether the arm is inside its limits."""
    index = ca.SX.sym("index")
    own = ca.SX.sym("root")
    roots = ca.SX.sym("roots", PARTS)
    waves = ca.SX.sym("waves", 4 * _WAVES * 3)
    elbows = ca.SX.sym("elbows", 2)

    following = ca.SX(math.pi)
    for other in ca.vertsplit(roots):
        following = ca.if_else(other > own, ca.fmin(other, following), following)

    middle = (own + following) / 2.0
    c, s = ca.cos(middle), ca.sin(middle)
    values = [a + b * c + d * s for a, b, d in map(ca.vertsplit, ca.vertsplit(waves, 3))]
    of_triples = [
        _is_inside(values[k * _WAVES : (k + 1) * _WAVES], limits, _TRIPLES[k % 2]) for k in range(4)
    ]
    of_bends = [
        ca.logic_and(elbows[k] != 0, ca.logic_and(*of_triples[2 * k : 2 * k + 2])) for k in range(2)
    ]
    is_inside = ca.if_else(ca.logic_or(*of_bends), 1.0, 0.0)
    inputs = {
        "parameters": parameters,
        "index": index,
        "root": own,
        "roots": roots,
        "waves": waves,
        "elbows": elbows,
    }
    outputs = {
        "sorted_begin": own,
        "sorted_inside": is_inside,
        "place": place_in_order(own, index, roots),
    }
    return PipelineStep(
        Graph.of("parts", inputs, outputs),
        PARTS,
        each={"index": "index"},
        shared={"roots": "root", "waves": "waves", "elbows": "elbows"},
        places="place",
    )


def _is_inside(values: Sequence[_SX], limits: Limits, joints: Sequence[int]) -> _SX:
    """Return whether three joints are inside their limits for sin(theta_2) of either sign."""
    first_along, first_across, polar, last_along, last_across = values
    first = ca.atan2(first_across, first_along)
    middle = ca.atan2(hypot(first_along, first_across), polar)
    last = ca.atan2(last_across, last_along)
    # With the other sign, the outer joints turn by half a turn.
    solutions = ((first, middle, last), (first + math.pi, -middle, last + math.pi))
    are_inside = [
        reduce(ca.logic_and, map(limits.inside, joints, solution)) for solution in solutions
    ]
    return ca.logic_or(*are_inside)
