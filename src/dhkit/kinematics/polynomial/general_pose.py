"""All solutions of one pose of an arm of six revolute joints, by the elimination of Raghavan and Roth, as one program.

It is that of :mod:`dhkit.kinematics.polynomial.general`, for roots that lie apart, in real numbers: the six equations
without the far joints are multiplied by the cosine and the sine of half the angle of joint i + 1, and are then linear
in 12 products

    (cos x/2, sin x/2, cos 3x/2, sin 3x/2)  times  (1, cos y, sin y)

with the angles x and y of joints i + 1 and i + 2. Newton's method ends each solution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.closed_form.program import is_pose
from dhkit.kinematics.descent_program import BASE_DAMPING, orthonormal_goal
from dhkit.kinematics.newton_program import levenberg_step, pose_error
from dhkit.kinematics.polynomial.pivots import (
    back_substituted,
    eliminated,
    newton_step,
    not_zero,
)
from dhkit.kinematics.polynomial.pose_steps import RESULTS, known_solutions, solving_steps
from dhkit.kinematics.polynomial.root_kinds import SAMPLES
from dhkit.kinematics.polynomial.root_steps import root_steps
from dhkit.symbolic import Graph, Pipeline, PipelineStep
from dhkit.symbolic.programs.graph import Variable

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_Line: TypeAlias = "tuple[_SX, _SX]"
"""A point and the direction, 3 x 1 each."""

_EQUATIONS = 14
_FAR = 8
"""Number of products of cosines and sines of the two far joints, without 1."""
_WITHOUT = _EQUATIONS - _FAR
"""Number of equations without the far joints."""
_NEAR = 9
"""Number of products of 1, cosines and sines of joints i + 1 and i + 2."""
_SIZES = (1, 12, 18, 18, 3 * _EQUATIONS * _NEAR, 12)
"""Numbers of parameters: see :class:`_Arm`."""
_REFLECTIONS = sum(_EQUATIONS - k for k in range(_FAR))
"""Number of entries of all vectors of reflections: each is one shorter than the one before."""
_SHARED = ("goal", "motion", "six", "reflections", "constant", "R")
"""What the solutions at all roots use."""
_FIRST_ANGLE = 0.1
"""First angle at which the polynomial is evaluated, rad."""
_LARGEST_STEP = 1e-3
"""Larger steps of Newton's method, rad, are not taken."""
_SINGULAR = 1e-11
"""Ratio of the smallest pivot to the largest one of a matrix that is singular up to rounding."""
_TINY = 1e-300
"""Added to denominators to avoid 0 / 0."""


@dataclass(frozen=True)
class _Arm:
    """The parameters by name, and the joint that the polynomial is in."""

    joint: int
    is_reversed: bool
    per_length: _SX
    T_tool_world: _SX
    """The world in the tool at zero joint positions, 3 x 4, m."""
    directions: list[_SX]
    """Of the axes in the order of the elimination, 3 x 1 each."""
    points: list[_SX]
    """A point of each axis, shares of the reach."""
    near: list[_SX]
    """What 1, cosine and sine of joint i are multiplied by, 14 x 9 each."""

    @classmethod
    def read(cls, parameters: _SX, joint: int, is_reversed: bool) -> _Arm:
        """Return the parameters by name."""
        ends = [sum(_SIZES[:k]) for k in range(len(_SIZES) + 1)]
        per_length, T, directions, points, near, _ = ca.vertsplit(parameters, ends)
        size = _EQUATIONS * _NEAR
        return cls(
            joint,
            is_reversed,
            per_length,
            ca.reshape(T, 4, 3).T,
            ca.vertsplit(directions, 3),
            ca.vertsplit(points, 3),
            [ca.reshape(x, _NEAR, _EQUATIONS).T for x in ca.vertsplit(near, size)],
        )

    @property
    def i(self) -> int:
        """Index of joint i, from 0."""
        return self.joint - 1

    @property
    def far(self) -> tuple[int, int]:
        """Indices of the two joints that are eliminated."""
        return {1: (4, 5), 2: (5, 0), 3: (0, 1)}[self.joint]

    def turned(self, place: int, cosine: _SX, sine: _SX, line: _Line) -> _Line:
        """Return a line turned about an axis."""
        R = _rotation(self.directions[place], cosine, sine)
        origin = self.points[place]
        return origin + R @ (line[0] - origin), R @ line[1]

    def motion(self, T: _SX) -> tuple[_SX, _SX]:
        """Return the motion from zero joint positions to a pose, shares of the reach, in the elimination's order."""
        R = T[:3, :3] @ self.T_tool_world[:, :3]
        p = (T[:3, :3] @ self.T_tool_world[:, 3] + T[:3, 3]) * self.per_length
        return (R.T, -R.T @ p) if self.is_reversed else (R, p)


def pose_program(joint: int, is_reversed: bool) -> Pipeline:
    """Return the program: the tool's pose to solutions, as :data:`dhkit.kinematics.polynomial.pose_steps.RESULTS`.

    Parameters
    ----------
    joint, is_reversed
        See :class:`dhkit.kinematics.polynomial.general.General`.
    """
    parameters = ca.SX.sym("parameters", sum(_SIZES))
    arm = _Arm.read(parameters, joint, is_reversed)
    steps = (
        _prepared(parameters, arm),
        _far_values(parameters, arm),
        _far_side(parameters),
        _six_equations(parameters, arm),
        _determinants(parameters),
        _values(parameters),
        *root_steps(parameters),
        *solving_steps(parameters, _solutions(parameters, arm), _SHARED),
    )
    inputs = (Variable("parameters", (sum(_SIZES),)), Variable("T", (4, 4)))
    return Pipeline("general_pose", inputs, steps, RESULTS)


def _prepared(parameters: _SX, arm: _Arm) -> PipelineStep:
    """Return the step that makes the rotation orthonormal, and the motion from zero joint positions."""
    T = ca.SX.sym("T", 4, 4)
    goal = ca.vertcat(orthonormal_goal(T), ca.SX([[0.0, 0.0, 0.0, 1.0]]))
    R, p = arm.motion(goal)
    outputs = {
        "goal": goal,
        "motion": ca.horzcat(R, p),
        "first": ca.SX(_FIRST_ANGLE),
        "posed": ca.if_else(is_pose(T), 1.0, 0.0),
    }
    return PipelineStep(Graph.of("prepared", {"parameters": parameters, "T": T}, outputs))


def _far_values(parameters: _SX, arm: _Arm) -> PipelineStep:
    """Return the step with the equations' far side at nine pairs of angles, multiples of 120 degrees."""
    motion = ca.SX.sym("motion", 3, 4)
    index = ca.SX.sym("index")
    first = ca.floor(index / 3.0)
    angles = [first * (math.tau / 3), (index - 3.0 * first) * (math.tau / 3)]
    i = arm.i
    joints = list(zip(arm.far, angles, strict=True))
    line = (arm.points[i + 3], arm.directions[i + 3])
    # From the line outwards: joints behind it, from axis 5 on, then the motion, then joints 1 and 2.
    for place, angle in joints:
        if place > i + 3:
            line = arm.turned(place, ca.cos(angle), -ca.sin(angle), line)
    R = motion[:, :3]
    line = (R @ line[0] + motion[:, 3], R @ line[1])
    for place, angle in joints:
        if place < i:
            line = arm.turned(place, ca.cos(angle), -ca.sin(angle), line)
    values = _equations(line[0] - arm.points[i], line[1])
    inputs = {"parameters": parameters, "motion": motion, "index": index}
    return PipelineStep(
        Graph.of("far_values", inputs, {"far_values": values}),
        items=9,
        each={"index": "index"},
        shared={"motion": "motion"},
    )


def _far_side(parameters: _SX) -> PipelineStep:
    """Return the step from values to the far side in products of the far joints, constant + Q R p.

    Q is a product of Householder's reflections 1 - w w^T, whose vectors w are the outputs.
    """
    flat = ca.SX.sym("far_values", _EQUATIONS * 9)
    # Entry by entry, of all items.
    values = ca.reshape(flat, 9, _EQUATIONS)
    side = _of_two_angles(values).T
    constant = side[:, 0]
    A = [[side[row, column] for column in range(1, _NEAR)] for row in range(_EQUATIONS)]
    vectors = []
    for k in range(_FAR):
        # The reflection takes column k, from row k on, to (end, 0, ..., 0).
        x = [A[row][k] for row in range(k, _EQUATIONS)]
        length = ca.sqrt(sum(entry * entry for entry in x))
        end = ca.if_else(x[0] > 0.0, -length, length)
        w = [x[0] - end, *x[1:]]
        # |w|^2 = 2 |x| (|x| + |x_0|), and has to be 2.
        factor = 1.0 / (ca.sqrt(length * (length + ca.fabs(x[0]))) + _TINY)
        w = [entry * factor for entry in w]
        for column in range(k, _FAR):
            along = sum(w[m] * A[k + m][column] for m in range(len(w)))
            for m in range(len(w)):
                A[k + m][column] = A[k + m][column] - along * w[m]
        vectors.append(w)
    outputs = {
        "constant": constant,
        "reflections": ca.vertcat(*(entry for w in vectors for entry in w)),
        "R": ca.vertcat(*(A[row][column] for row in range(_FAR) for column in range(row, _FAR))),
    }
    graph = Graph.of("far_side", {"parameters": parameters, "far_values": flat}, outputs)
    return PipelineStep(graph, shared={"far_values": "far_values"})


def _of_two_angles(values: _SX) -> _SX:
    """Return factors of 1, cosine and sine of two angles from values (9 x m) at multiples of 120 degrees."""
    of_values = ca.DM(
        [
            [1 / 3, 1 / 3, 1 / 3],
            [2 / 3, -1 / 3, -1 / 3],
            [0.0, 1 / math.sqrt(3), -1 / math.sqrt(3)],
        ]
    )
    # First the second angle, which changes from value to value, then the first one.
    of_second = [of_values @ values[3 * k : 3 * k + 3, :] for k in range(3)]
    return ca.vertcat(
        *(sum(of_values[factor, k] * of_second[k] for k in range(3)) for factor in range(3))
    )


def _reflected(vectors: Sequence[list[_SX]], x: list[_SX]) -> list[_SX]:
    """Return a vector after reflections, the first one of which is applied first."""
    for w in vectors:
        start = len(x) - len(w)
        along = sum(w[m] * x[start + m] for m in range(len(w)))
        x = [*x[:start], *(x[start + m] - along * w[m] for m in range(len(w)))]
    return x


def _read_reflections(flat: _SX) -> list[list[_SX]]:
    """Return the vectors of the reflections."""
    entries = ca.vertsplit(flat)
    vectors = []
    for k in range(_FAR):
        vectors.append(entries[: _EQUATIONS - k])
        entries = entries[_EQUATIONS - k :]
    return vectors


def _six_equations(parameters: _SX, arm: _Arm) -> PipelineStep:
    """Return the step with the six equations without the far joints: factors of the near products, 27 each.

    Those that 1 is multiplied by, then those of the cosine and of the sine of joint i.
    """
    index = ca.SX.sym("index")
    reflections = ca.SX.sym("reflections", _REFLECTIONS)
    constant = ca.SX.sym("constant", _EQUATIONS)
    # Column 8 + index of Q is the reflections of a unit vector, the last one first.
    unit = [ca.SX(0.0)] * _FAR
    unit += [ca.if_else(index == float(k), 1.0, 0.0) for k in range(_WITHOUT)]
    null = ca.SX(ca.vertcat(*_reflected(_read_reflections(reflections)[::-1], unit)))
    factors: list[_SX] = [null.T @ side for side in arm.near]
    factors[0][0, 0] = factors[0][0, 0] - ca.dot(null, constant)
    inputs = {
        "parameters": parameters,
        "index": index,
        "reflections": reflections,
        "constant": constant,
    }
    return PipelineStep(
        Graph.of("six_equations", inputs, {"six": ca.SX(ca.horzcat(*factors))}),
        items=_WITHOUT,
        each={"index": "index"},
        shared={"reflections": "reflections", "constant": "constant"},
    )


def _matrix(six: _SX, cosine: _SX, sine: _SX) -> list[list[_SX]]:
    """Return the matrix whose determinant is the polynomial, 12 rows of 12."""
    factors = ca.SX(ca.reshape(six, _WITHOUT, 3 * _NEAR))
    equations = factors[:, :_NEAR] + cosine * factors[:, _NEAR : 2 * _NEAR]
    equations = equations + sine * factors[:, 2 * _NEAR :]
    by_cosine = []
    by_sine = []
    for row in range(_WITHOUT):
        # With half = x / 2: cos x cos half = (cos 3 half + cos half) / 2, and so on.
        of_cosine = []
        of_sine = []
        for y in range(3):
            one, c, s = (equations[row, 3 * x + y] for x in range(3))
            c = 0.5 * c
            s = 0.5 * s
            of_cosine += [one + c, s, c, s]
            of_sine += [s, one - c, -s, c]
        by_cosine.append(of_cosine)
        by_sine.append(of_sine)
    return by_cosine + by_sine


def _determinants(parameters: _SX) -> PipelineStep:
    """Return the step with the determinants at equally spaced angles of joint i, and how far from singular they are."""
    six = ca.SX.sym("six", _WITHOUT * 3 * _NEAR)
    index = ca.SX.sym("index")
    angle = _FIRST_ANGLE + index * (math.tau / SAMPLES)
    A, _, determinant = eliminated(_matrix(six, ca.cos(angle), ca.sin(angle)))
    pivots = [ca.fabs(A[k][k]) for k in range(len(A))]
    for k in range(len(A)):
        determinant = determinant * A[k][k]
    regularity = reduce(ca.fmin, pivots) / (reduce(ca.fmax, pivots) + _TINY)
    inputs = {"parameters": parameters, "six": six, "index": index}
    outputs = {"determinant": determinant, "regularity": regularity}
    return PipelineStep(
        Graph.of("determinants", inputs, outputs),
        items=SAMPLES,
        each={"index": "index"},
        shared={"six": "six"},
    )


def _values(parameters: _SX) -> PipelineStep:
    """Return the step with the polynomial's values: 0 where all matrices are singular up to rounding."""
    determinant = ca.SX.sym("determinant")
    regularities = ca.SX.sym("regularities", SAMPLES)
    is_known = reduce(ca.fmax, ca.vertsplit(regularities)) > _SINGULAR
    inputs = {
        "parameters": parameters,
        "determinant": determinant,
        "regularities": regularities,
    }
    return PipelineStep(
        Graph.of("value", inputs, {"value": ca.if_else(is_known, determinant, 0.0)}),
        items=SAMPLES,
        shared={"regularities": "regularity"},
    )


def _solutions(parameters: _SX, arm: _Arm) -> Graph:
    """Return the program from a root to its solution."""
    goal = ca.SX.sym("goal", 4, 4)
    motion = ca.SX.sym("motion", 3, 4)
    six = ca.SX.sym("six", _WITHOUT * 3 * _NEAR)
    reflections = ca.SX.sym("reflections", _REFLECTIONS)
    constant = ca.SX.sym("constant", _EQUATIONS)
    R = ca.SX.sym("R", _FAR * (_FAR + 1) // 2)
    angle = ca.SX.sym("angle")
    of_root = [ca.SX.sym(name) for name in ("is_tried", "is_real", "closeness")]
    is_tried, is_real, closeness = of_root

    cosine = ca.cos(angle)
    sine = ca.sin(angle)
    second, third = _near_angles(_matrix(six, cosine, sine))
    factors = arm.near[0] + cosine * arm.near[1] + sine * arm.near[2]
    near = factors @ _products(second, third)
    a, b = _far_angles(near - constant, reflections, R)
    q = _joints(arm, motion, {arm.i: angle, arm.i + 1: second, arm.i + 2: third}, (a, b))
    q, error, is_regular = _polished(parameters, arm, goal, q)
    is_delicate = ca.logic_or(closeness > 0.0, ca.logic_not(is_regular))
    inputs = {
        "parameters": parameters,
        "goal": goal,
        "motion": motion,
        "six": six,
        "reflections": reflections,
        "constant": constant,
        "R": R,
        "angle": angle,
        **{symbol.name(): symbol for symbol in of_root},
    }
    place = 5 - arm.i if arm.is_reversed else arm.i
    return known_solutions(
        parameters, inputs, (is_tried, is_real), q, error, closeness, is_delicate, place
    )


def _near_angles(matrix: list[list[_SX]]) -> tuple[_SX, _SX]:
    """Return the angles of joints i + 1 and i + 2, from the vector that the matrix takes nearly to 0.

    A solution of A x = b is long in that direction, for nearly any b.
    """
    size = len(matrix)
    b = [ca.SX(math.cos(2.0 + 5.0 * k)) for k in range(size)]
    A, right, _ = eliminated(matrix, b)
    x = back_substituted(A, right)
    largest = x[0] * 0.0
    for entry in x:
        largest = ca.fmax(largest, ca.fabs(entry))
    # (cos x/2, sin x/2, cos 3x/2, sin 3x/2) for 1, cos y and sin y.
    x = [entry / (largest + _TINY) for entry in x]
    half = [x[4 * y : 4 * y + 2] for y in range(3)]
    second = 2.0 * ca.atan2(half[0][1], half[0][0])
    c, s = (half[0][0] * half[y][0] + half[0][1] * half[y][1] for y in (1, 2))
    return second, ca.atan2(s, c)


def _products(second: _SX, third: _SX) -> _SX:
    """Return the products of 1, cosine and sine of two angles, 9 x 1."""
    of_second = (1.0, ca.cos(second), ca.sin(second))
    of_third = (1.0, ca.cos(third), ca.sin(third))
    return ca.vertcat(*(x * y for x in of_second for y in of_third))


def _far_angles(right: _SX, reflections: _SX, R: _SX) -> tuple[_SX, _SX]:
    """Return the angles of the far joints from Q R p = right, p = (cos b, sin b, cos a, ..., sin a, ...)."""
    turned = _reflected(_read_reflections(reflections), ca.vertsplit(right))
    entries = iter(ca.vertsplit(R))
    rows = [[next(entries) for _ in range(row, _FAR)] for row in range(_FAR)]
    p: list[_SX] = [ca.SX(0.0)] * _FAR
    for k in reversed(range(_FAR)):
        rest = turned[k] - sum((rows[k][m - k] * p[m] for m in range(k + 1, _FAR)), ca.SX(0.0))
        p[k] = rest / not_zero(rows[k][0])
    return ca.atan2(p[5], p[2]), ca.atan2(p[1], p[0])


def _joints(arm: _Arm, motion: _SX, known: dict[int, _SX], far: tuple[_SX, _SX]) -> list[_SX]:
    """Return all joint values in the elimination's order, the last one from the rotation."""
    i = arm.i
    angles = dict(known)
    angles.update(zip(arm.far, far, strict=True))

    def rotation(k: int) -> _SX:
        return _rotation(arm.directions[k], ca.cos(angles[k]), ca.sin(angles[k]))

    # E_i E_(i+1) E_(i+2) E_(i+3) = E_(i-1)^-1 ... M ... E_(i+4)^-1.
    rest = motion[:, :3]
    for k in range(i + 3):
        rest = rotation(k).T @ rest
    for k in reversed(range(i + 4, 6)):
        rest = rest @ rotation(k).T
    # rest = n n^T + cos (1 - n n^T) + sin [n], whose trace is 1 + 2 cos.
    n = arm.directions[i + 3]
    twice_sine = ca.dot(
        n,
        ca.vertcat(rest[2, 1] - rest[1, 2], rest[0, 2] - rest[2, 0], rest[1, 0] - rest[0, 1]),
    )
    angles[i + 3] = ca.atan2(twice_sine, ca.trace(rest) - 1.0)
    return [angles[k] for k in range(6)]


def _polished(parameters: _SX, arm: _Arm, goal: _SX, q: list[_SX]) -> tuple[_SX, _SX, _SX]:
    """Return joint values in the robot's order after Newton's method, in (-pi, pi], their error, and if it is regular.

    Two steps lead from the elimination's solution, whose error is some 1e-9 rad, to rounding.
    """
    # From the tool, the axes of the robot are met in the opposite order, with opposite directions.
    order = range(5, -1, -1) if arm.is_reversed else range(6)
    sense = -1.0 if arm.is_reversed else 1.0
    directions = [sense * arm.directions[k] for k in order]
    points = [arm.points[k] for k in order]
    length = 1.0 / arm.per_length

    symbol = ca.SX.sym("q", 6)
    T, J = _tool_and_jacobian(arm, directions, points, symbol)
    goal_symbol = ca.SX.sym("goal", 4, 4)
    error = pose_error(T, goal_symbol, length)
    inputs = [parameters, goal_symbol, symbol]
    step = levenberg_step(J, error, ca.SX(BASE_DAMPING), [ca.SX(0.0)] * 6)
    damped = ca.Function("damped", inputs, [symbol + step])
    step, is_regular = newton_step(J, error)
    is_small = ca.mmax(ca.fabs(step)) < _LARGEST_STEP
    better = ca.if_else(is_small, symbol + step, symbol)
    newton = ca.Function("newton", inputs, [better, is_regular])

    x = damped(parameters, goal, ca.vertcat(*(q[k] for k in order)))
    x, is_regular = newton(parameters, goal, x)
    of_pose = ca.Function("error", inputs, [error])(parameters, goal, x)
    largest = ca.sqrt(ca.fmax(ca.sumsqr(of_pose[:3]), ca.sumsqr(of_pose[3:])))
    return x + math.tau * ca.floor((math.pi - x) / math.tau), largest, is_regular


def _tool_and_jacobian(
    arm: _Arm, directions: list[_SX], points: list[_SX], q: _SX
) -> tuple[_SX, _SX]:
    """Return the tool's pose, 4 x 4, m, and the geometric Jacobian, 6 x 6, with lengths as shares of the reach."""
    R = ca.SX.eye(3)
    p = ca.SX.zeros(3, 1)
    axes = []
    for k in range(6):
        # E = (R, p) so far; it moves axis k to where it is now.
        axes.append((R @ directions[k], R @ points[k] + p))
        turn = _rotation(directions[k], ca.cos(q[k]), ca.sin(q[k]))
        p = p + R @ (points[k] - turn @ points[k])
        R = R @ turn
    # The tool at zero joint positions is the inverse of the world in it.
    R_0 = arm.T_tool_world[:, :3].T
    p_0 = -R_0 @ arm.T_tool_world[:, 3] * arm.per_length
    position = R @ p_0 + p
    columns = [
        ca.vertcat(ca.cross(direction, position - point), direction) for direction, point in axes
    ]
    T = ca.vertcat(ca.horzcat(R @ R_0, position / arm.per_length), ca.SX([[0.0, 0.0, 0.0, 1.0]]))
    return T, ca.horzcat(*columns)


def _rotation(axis: _SX, cosine: _SX, sine: _SX) -> _SX:
    """Return the rotation about a unit vector, 3 x 3."""
    along = axis @ axis.T
    return along + cosine * (ca.SX.eye(3) - along) + sine * ca.skew(axis)


def _equations(point: _SX, direction: _SX) -> _SX:
    """Return one side of the equations for a line, 14 x 1."""
    f_f = ca.sumsqr(point)
    f_n = ca.dot(point, direction)
    mixed = f_f * direction - 2.0 * f_n * point
    return ca.vertcat(point, direction, ca.cross(point, direction), mixed, f_f, f_n)
