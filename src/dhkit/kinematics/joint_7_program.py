"""The parts of a turn of joint 7 in which an arm of seven joints can be inside its limits, as one program.

Let an arm of :mod:`dhkit.kinematics.closed_form.spherical_shoulder` have joint 7 at q7. The sine of joint 4 is a square
root r of a trigonometric polynomial in q7, with either sign, and joints 5 and 6 have a second root w, whose square
contains r. Every entry of the arm's rotations is x + y r + (u + v r) w over two denominators. So is a function that
vanishes where a joint is at its limit, such as, for joint 1,

    (cos(limit) sin(theta_1) - sin(limit) cos(theta_1)) sin(theta_2).

Its product over all signs of r and w has no roots left. Times the denominators that remain, it is a trigonometric
polynomial in q7: of degree 8 for joints 1, 2 and 3, as a pose has up to 16 solutions with one of them given, and of
degree 4 for joints 5 and 6. (The degrees were found by evaluation; that the coefficients beyond them vanish is checked
at every pose.) Joint 4 at its limit is one equation a + b cos(q7) + c sin(q7) = 0. These roots, and those where
solutions appear, divide the turn into parts: what is true in the middle of a part is true in all of it.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.closed_form.family import Fit, PoseSymbols, Vector
from dhkit.kinematics.closed_form.formulas import (
    Pair,
    add_angles,
    turned_about_x,
    turned_about_z,
    weighted_sum,
    wrap_angle,
)
from dhkit.kinematics.closed_form.program import is_pose
from dhkit.kinematics.closed_form.spherical_shoulder import (
    at_joint_7,
    spherical_shoulder_formulas,
)
from dhkit.kinematics.limit_symbols import ArmSymbols, wave_root
from dhkit.kinematics.polynomial.estimate_steps import (
    PolynomialSource,
    estimate_steps,
    total_of,
)
from dhkit.kinematics.polynomial.extension import Extension, Root
from dhkit.kinematics.polynomial.root_steps import place_in_order
from dhkit.kinematics.polynomial.root_symbols import (
    BEYOND as NO_ANGLE,
    coefficients,
    complex_of,
    nearly_real,
    polynomial_of,
)
from dhkit.kinematics.redundant import JOINTS
from dhkit.kinematics.turn_parts import (
    JOINT_7_PARTS as PARTS,
    KNOWN,
    NO_POSE,
    TOUCHING,
    UNKNOWN,
)
from dhkit.symbolic import Graph, Pipeline, PipelineStep
from dhkit.symbolic.differentiable.vectors import dot

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_Number: TypeAlias = Any
"""A CasADi SX scalar, or an :class:`Extension`."""

SAMPLES = 20
"""Number of angles at which polynomials are evaluated."""
_FIRST = 0.1
"""First one of them, rad: where the two denominators vanish is hardly ever near such an angle."""
_LANES = 8
"""Polynomials whose coefficients are computed together, some of them twice."""
_DEGREES = {"greater": 8, "lesser": 4}
_COUNTS = {"greater": 6, "lesser": 5}
"""Degrees of the polynomials of two kinds, and how many there are of each."""
_INEXACT = 1e-10
"""Largest coefficient beyond the degree, relative to the others, of a polynomial that is known; most have 1e-15."""


def joint_7_program(fit: Fit) -> Pipeline:
    """Return the program of an arm whose redundancy is joint 7: the tool's pose to ``RESULTS``, joint 7's limits apart.

    Parameters
    ----------
    fit
        The arm as a member of its family.
    """
    arm = ArmSymbols(fit)
    parameters = arm.parameters
    steps = (
        _values(arm),
        _tables(parameters),
        *(_known_coefficients(parameters, name) for name in _COUNTS),
        *(
            step
            for name, count in _COUNTS.items()
            for lane in range(count)
            for step in _root_steps(parameters, name, lane)
        ),
        _all_roots(arm),
        _ordered(parameters),
        _ends(parameters),
        _parts(arm),
    )
    return arm.pipeline("joint_7_parts", steps)


def _at_angle(arm: ArmSymbols, T: _SX, q_7: _SX) -> PoseSymbols:
    """Return a pose with an angle of joint 7, rad."""
    return arm.pose(T, (ca.cos(q_7), ca.sin(q_7)))


def _values(arm: ArmSymbols) -> PipelineStep:
    """Return the step that evaluates the polynomials at equally spaced angles, and the cosine of joint 4's bend."""
    p = arm.p
    T = ca.SX.sym("T", 4, 4)
    index = ca.SX.sym("index")
    link_6, centre, seen = at_joint_7(p, _at_angle(arm, T, _FIRST + index * (math.tau / SAMPLES)))

    # Joint 4, as in elbow_bent: the law of cosines across its axis.
    along = p["fore"][2] - p["upper"][2]
    across_squared = dot(centre, centre) - along * along
    cos_bend = (across_squared - p["L2"] * p["L2"] - p["L3"] * p["L3"]) * (
        0.5 / (p["L2"] * p["L3"])
    )
    sin_bend = Root(1.0 - cos_bend * cos_bend).element
    theta_4 = add_angles((cos_bend, sin_bend), p["straight"])
    upper = turned_about_z(p["upper"], theta_4, -1.0)
    g = turned_about_x(weighted_sum((1.0, -1.0), (upper, p["fore"])), p["alpha4"], -1.0)

    # Joints 5 and 6, as in _wrist: pairs of g over h, and of w over s, times |h|^2 = |g|^2 and |w|^2 = |s|^2.
    cos_5, sin_5 = p["alpha5"]
    w_y = (g[2] - cos_5 * seen[2]) * (1.0 / sin_5)
    h_y = cos_5 * w_y - sin_5 * seen[2]
    across_6 = seen[0] * seen[0] + seen[1] * seen[1]
    across_5 = g[0] * g[0] + g[1] * g[1]
    w_squared = across_6 - w_y * w_y
    w_x = Root(w_squared, level=2).element
    theta_6 = (w_x * seen[0] + w_y * seen[1], w_y * seen[0] - w_x * seen[1])
    theta_5 = (g[0] * w_x + g[1] * h_y, g[1] * w_x - g[0] * h_y)

    def in_frame_0(vector: Vector) -> Vector:
        """Return a vector of link 3 times |g|^2 |s|^2 in frame 0."""
        turns = ((theta_4, 1.0), (theta_5, across_5), (theta_6, across_6))
        for (turn, size), twist in zip(turns, ("alpha4", "alpha5", "alpha6"), strict=True):
            x, y, z = turned_about_z(vector, turn, -1.0)
            vector = turned_about_x((x, y, z * size), p[twist], -1.0)
        return weighted_sum(vector, link_6)

    x_3, y_3, z_3 = (
        in_frame_0(turned_about_x(axis, p["alpha3"], -1.0))
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    )
    sin_1 = p["alpha1"][1]
    sin_2 = p["alpha2"][1]
    # Over these denominators the products over all signs are polynomials of the least degrees.
    of_5 = 1.0 / across_5.norm
    of_6 = 1.0 / (across_6 * across_6)
    greater = []
    lesser = []
    for ends in arm.limits.ends:
        # As in dhkit.kinematics.arm_angle_program: theta_1 and theta_2 in the third column, theta_3 in the third row.
        first = _at(ends[0], (z_3[0], z_3[1]))
        second = z_3[2] * (-sin_1 * sin_2) - (across_5 * across_6) * ends[1][0]
        third = _at(ends[2], (x_3[2] * sin_1, y_3[2] * -sin_1))
        greater += [_norm(x) * (of_5 * of_6) for x in (first, second, third)]
        lesser += [_norm(_at(ends[4], theta_5)) * of_5, _norm(_at(ends[5], theta_6)) * of_6]
    lesser.append(_norm(w_squared))
    inputs = {"parameters": arm.parameters, "T": T, "index": index}
    outputs = {"greater": ca.vertcat(*greater), "lesser": ca.vertcat(*lesser), "bend": cos_bend}
    return PipelineStep(Graph.of("values", inputs, outputs), SAMPLES, each={"index": "index"})


def _at(end: Pair, pair: tuple[_Number, _Number]) -> _Number:
    """Return the sine of an angle less that of a limit, times the length of the angle's pair."""
    cosine, sine = pair
    return sine * end[0] - cosine * end[1]


def _norm(x: _Number) -> _SX:
    """Return the product of a number's values for all signs of its roots."""
    while isinstance(x, Extension):
        x = x.norm
    return x


def _tables(parameters: _SX) -> PipelineStep:
    """Return the step that writes each polynomial's values next to each other, and the wave of joint 4's bend."""
    inputs: dict[str, _SX] = {"parameters": parameters}
    outputs: dict[str, _SX] = {}
    for name, count in _COUNTS.items():
        values = ca.SX.sym(name, count * SAMPLES)
        inputs[name] = values
        rows = [values[k * SAMPLES : (k + 1) * SAMPLES] for k in range(count)]
        # Lanes that are left over repeat the last polynomial.
        rows += [rows[-1]] * (_LANES - count)
        outputs[f"{name}_table"] = ca.vertcat(*(row[j] for j in range(SAMPLES) for row in rows))
    bend = ca.SX.sym("bend", SAMPLES)
    inputs["bend"] = bend
    angles = [_FIRST + math.tau / SAMPLES * j for j in range(SAMPLES)]
    outputs["wave"] = ca.vertcat(
        ca.sum1(bend) / SAMPLES,
        ca.dot(bend, ca.DM([math.cos(x) for x in angles])) * (2.0 / SAMPLES),
        ca.dot(bend, ca.DM([math.sin(x) for x in angles])) * (2.0 / SAMPLES),
    )
    shared = {name: name for name in ("greater", "lesser", "bend")}
    return PipelineStep(Graph.of("tables", inputs, outputs), shared=shared)


def _known_coefficients(parameters: _SX, name: str) -> PipelineStep:
    """Return the step from the values of polynomials, one in each lane, to their coefficients."""
    degree = _DEGREES[name]
    values = ca.SX.sym("values", SAMPLES)
    numbers, error = coefficients(values, degree)
    outputs = {
        f"{name}_numbers": numbers,
        f"{name}_total": total_of(numbers, degree),
        f"{name}_error": error,
    }
    graph = Graph.of(f"{name}_coefficients", {"parameters": parameters, "values": values}, outputs)
    return PipelineStep(graph, _LANES, each={"values": f"{name}_table"})


def _root_steps(parameters: _SX, name: str, lane: int) -> tuple[PipelineStep, ...]:
    """Return the steps from the coefficients of a polynomial to its real roots."""
    own = f"{name}{lane}"
    source = PolynomialSource(
        _DEGREES[name],
        f"{name}_numbers",
        f"{name}_total",
        lane,
        _LANES,
        f"{own}_x",
        f"{own}_y",
    )
    every_number, numbers = source.symbol("numbers", source.coefficients)
    errors = ca.SX.sym("errors", _LANES)
    x = ca.SX.sym("x")
    y = ca.SX.sym("y")
    polynomial = polynomial_of(numbers, source.degree)
    angle, _, _ = nearly_real(polynomial, complex_of(x, y), errors[lane])
    root = ca.if_else(angle < NO_ANGLE, wrap_angle(angle + _FIRST), math.pi)
    inputs = {"parameters": parameters, "numbers": every_number, "errors": errors, "x": x, "y": y}
    real = PipelineStep(
        Graph.of(f"{own}_roots", inputs, {f"{own}_root": root}),
        source.roots,
        each={"x": source.x, "y": source.y},
        shared={"numbers": source.numbers, "errors": f"{name}_error"},
    )
    return (*estimate_steps(parameters, source), real)


def _all_roots(arm: ArmSymbols) -> PipelineStep:
    """Return the step that puts the roots together, with those of joint 4, and tells whether they are known."""
    T = ca.SX.sym("T", 4, 4)
    wave = ca.SX.sym("wave", 3)
    inputs = {"parameters": arm.parameters, "T": T, "wave": wave}
    a, b, c = ca.vertsplit(wave)
    roots: list[_SX] = [ca.SX(-math.pi)]
    # The bend is joint 4's angle less that of the stretched arm; it is 0 or pi where the arm is stretched or folded.
    cos_straight, sin_straight = arm.p["straight"]
    ends = [end[3] for end in arm.limits.ends]
    of_bends = [cosine * cos_straight + sine * sin_straight for cosine, sine in ends]
    for cosine in (*of_bends, 1.0, -1.0):
        roots += [wave_root((a - cosine, b, c), sign) for sign in (1.0, -1.0)]

    is_known = ca.SX(0.0) == 0.0
    for name, count in _COUNTS.items():
        error = ca.SX.sym(f"{name}_error", _LANES)
        inputs[f"{name}_error"] = error
        # False for NaN.
        is_known = ca.logic_and(is_known, ca.sum1(error) < _INEXACT)
        for lane in range(count):
            found = ca.SX.sym(f"{name}{lane}_root", 2 * _DEGREES[name])
            inputs[f"{name}{lane}_root"] = found
            roots += ca.vertsplit(found)
    roots += [ca.SX(math.pi)] * (PARTS - len(roots))
    state = ca.if_else(is_known, float(KNOWN), float(UNKNOWN))
    outputs: dict[str, _SX] = {
        "root": ca.vertcat(*roots),
        "state": ca.if_else(is_pose(T), state, float(NO_POSE)),
    }
    return PipelineStep(
        Graph.of("all_roots", inputs, outputs),
        shared={name: name for name in inputs if name not in ("parameters", "T")},
    )


def _ordered(parameters: _SX) -> PipelineStep:
    """Return the step that sorts the roots."""
    index = ca.SX.sym("index")
    root = ca.SX.sym("root")
    roots = ca.SX.sym("roots", PARTS)
    inputs = {"parameters": parameters, "index": index, "root": root, "roots": roots}
    outputs = {"sorted_begin": root, "place": place_in_order(root, index, roots)}
    return PipelineStep(
        Graph.of("ordered", inputs, outputs),
        PARTS,
        each={"index": "index"},
        shared={"roots": "root"},
        places="place",
    )


def _ends(parameters: _SX) -> PipelineStep:
    """Return the step that tells where each part ends, and which are empty."""
    begins = ca.SX.sym("begins", PARTS)
    ends = ca.vertcat(begins[1:], math.pi)
    lengths = ca.vertsplit(ends - begins)
    are_empty = [ca.if_else(length <= TOUCHING, 1.0, 0.0) for length in lengths]
    outputs = {"end": ends, "is_empty": ca.vertcat(*are_empty)}
    graph = Graph.of("ends", {"parameters": parameters, "begins": begins}, outputs)
    return PipelineStep(graph, shared={"begins": "sorted_begin"})


def _parts(arm: ArmSymbols) -> PipelineStep:
    """Return the step that tells whether some solution in the middle of a part is inside the limits."""
    T = ca.SX.sym("T", 4, 4)
    begin = ca.SX.sym("sorted_begin")
    end = ca.SX.sym("end")
    is_inside = ca.SX(0.0) > 0.0
    for branch in spherical_shoulder_formulas(arm.p, _at_angle(arm, T, (begin + end) / 2.0)):
        is_allowed = branch.miss == 0
        for k, q in enumerate(branch.q[: JOINTS - 1]):
            theta = q + arm.limits.offset[k] * math.tau
            is_allowed = ca.logic_and(is_allowed, arm.limits.inside(k, theta))
        is_inside = ca.logic_or(is_inside, is_allowed)
    inputs = {"parameters": arm.parameters, "T": T, "sorted_begin": begin, "end": end}
    outputs = {"sorted_inside": ca.if_else(is_inside, 1.0, 0.0)}
    return PipelineStep(Graph.of("parts", inputs, outputs), PARTS, skips="is_empty")
