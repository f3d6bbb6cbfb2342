"""Programs of :mod:`dhkit.kinematics.polynomial.two_parallel`: the polynomial, and the joints at one of its roots."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.closed_form.formulas import turned_about_x, turned_about_z
from dhkit.kinematics.polynomial.extension import SIGNS, Element, Extension, Root
from dhkit.kinematics.polynomial.pivots import newton_step
from dhkit.symbolic import Graph

SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
Pair: TypeAlias = "tuple[Element, Element]"
"""Cosine and sine of an angle."""
Vector: TypeAlias = "tuple[Element, Element, Element]"
TakeRoot: TypeAlias = Callable[[Element, int], Element]
"""Returns the root of a square, the first (1) or the second (2) that is taken."""

COUNT = 1 + 6 + 5 + 5 + 10 + 12 + 12
"""Number of parameters."""
_POLISHING_STEPS = 1
"""Newton steps from a root of the polynomial, whose error is about 1e-10 rad, to rounding."""
_LARGEST_STEP = 1e-3
"""Larger steps, rad, are not taken: near a double root they lead elsewhere."""
_ALSO_FITS = 1e-6
"""Residual, a share of the squared reach, of combinations of signs that may also be solutions: two at the same q1."""


def polynomial_value(p: Numbers, meeting: tuple[int, int], T: SX, theta_1: Pair) -> SX:
    """Return the polynomial's value at theta_1 for the pose T of the tool, 4 x 4.

    It is the product of F over both signs of both roots, times the denominators in F.
    """
    arm = _assembled(
        p, meeting, T[:3, :], theta_1, lambda square, level: Root(square, level).element
    )
    square_of_h, square_of_u = arm.denominators
    return arm.F.norm.norm * square_of_h.norm * square_of_u * square_of_u


def fitting_signs(p: Numbers, meeting: tuple[int, int], T: SX, q_1: SX) -> tuple[SX, SX]:
    """Return which signs fit at q1 near a root of F, NaN if there are none, and which others do.

    The signs are those with the least residual: |F| and by how much squares are negative. The second result tells of
    each combination in ``SIGNS``, but for that one, whether it fits too.
    """
    # A comparison with NaN is false: residuals that are no numbers fit nothing.
    least = ca.SX(math.inf)
    signs = ca.SX([math.nan, math.nan])
    residuals = []
    for some in SIGNS:
        arm, deficit = _real(p, meeting, T, q_1, some)
        residual = ca.fabs(arm.F) + deficit
        residuals.append(residual)
        is_better = residual < least
        signs = ca.if_else(is_better, ca.SX(some), signs)
        least = ca.if_else(is_better, residual, least)
    also = []
    for some, residual in zip(SIGNS, residuals, strict=True):
        is_chosen = ca.logic_and(signs[0] == some[0], signs[1] == some[1])
        also.append(ca.logic_and(residual <= _ALSO_FITS, ca.logic_not(is_chosen)))
    return signs, ca.vertcat(*also)


def joints_program(meeting: tuple[int, int]) -> Graph:
    """Return the program of the joints: T, q1 near a root of F, and the signs, to q with q1 at the root, and its error.

    It takes Newton steps q1 - F / F'. Angles are in (-pi, pi]. The error is the larger one of position, a share of the
    reach, and rotation, rad, for which its sine is taken.
    """
    parameters, T = symbols()
    q_1 = ca.SX.sym("q_1")
    signs = ca.SX.sym("signs", 2)
    q, error, _ = solution_function(meeting)(parameters, T, q_1, signs)
    inputs = {"parameters": parameters, "T": T, "q_1": q_1, "signs": signs}
    return Graph.of("two_parallel_joints", inputs, {"q": q, "error": error})


def solution_function(meeting: tuple[int, int]) -> ca.Function:
    """Return the function of :func:`joints_program`: parameters, T, q1 and signs to q, its error, and if it is regular.

    Solutions at nearly equal roots of the polynomial may well be regular: those of an elbow above and below are.
    """
    parameters, T = symbols()
    q_1 = ca.SX.sym("q_1")
    signs = ca.SX.sym("signs", 2)
    p = Numbers.read(parameters)

    arm, _ = _real(p, meeting, T, q_1, (signs[0], signs[1]))
    step = arm.F / ca.jacobian(arm.F, q_1)
    is_small = ca.fabs(step) < _LARGEST_STEP
    better = ca.Function(
        "better", [parameters, T, q_1, signs], [ca.if_else(is_small, q_1 - step, q_1)]
    )
    x = q_1
    for _ in range(_POLISHING_STEPS):
        x = better(parameters, T, x, signs)

    arm, _ = _real(p, meeting, T, x, (signs[0], signs[1]))
    # Link 2 has the direction q2, link 3 that of q2 + sense q3.
    sense = p.alpha[2][0]
    theta_2 = ca.atan2(arm.link_2[1], arm.link_2[0])
    c, s = arm.link_3
    theta_3 = ca.atan2(
        (arm.link_2[0] * s - arm.link_2[1] * c) * sense, arm.link_2[0] * c + arm.link_2[1] * s
    )
    thetas = [theta_2, theta_3, *(ca.atan2(sine, cosine) for cosine, sine in arm.wrist)]
    q = [x, *(theta - p.offset[k] for k, theta in enumerate(thetas, start=1))]
    q = [angle + math.tau * ca.floor((math.pi - angle) / math.tau) for angle in q]
    # q1 alone was polished, to which the others follow: one step of all of them closes to rounding.
    twist, J = _twist_and_jacobian(p, T, q)
    step, is_regular = newton_step(J, twist)
    is_small = ca.mmax(ca.fabs(step)) < _LARGEST_STEP
    q = [ca.if_else(is_small, angle + step[k], angle) for k, angle in enumerate(q)]
    q = [angle + math.tau * ca.floor((math.pi - angle) / math.tau) for angle in q]
    outputs = [ca.vertcat(*q), _error(p, T, q), is_regular]
    return ca.Function("solution", [parameters, T, q_1, signs], outputs)


def _twist_and_jacobian(p: Numbers, T: SX, q: list[SX]) -> tuple[SX, SX]:
    """Return the error of the tool's pose at joint values as a twist, 6 x 1, and the geometric Jacobian, 6 x 6.

    Linear parts come first, with lengths as shares of the reach.
    """
    R, shift, axes, end = _forward(p, T, q)
    R_goal, _ = last_frame(p, T)
    # sin(t) times the axis of R_goal R^T, t its angle.
    turn = sum((ca.cross(R[:, k], R_goal[:, k]) for k in range(3)), ca.SX.zeros(3)) / 2.0
    columns = [ca.vertcat(ca.cross(axis, end - origin), axis) for axis, origin in axes]
    return ca.vertcat(shift, turn), ca.horzcat(*columns)


def _error(p: Numbers, T: SX, q: list[SX]) -> SX:
    """Return the error of the tool's pose at joint values: the larger one of a share of the reach, and rad."""
    R, shift, *_ = _forward(p, T, q)
    R_goal, _ = last_frame(p, T)
    # |R_g - R|_F = sqrt(8) sin(t / 2) for rotations that are t apart: over sqrt(2) it is t for small ones.
    return ca.sqrt(ca.fmax(ca.sumsqr(shift), ca.sumsqr(R_goal - R) / 2.0))


def _forward(p: Numbers, T: SX, q: list[SX]) -> tuple[SX, SX, list[tuple[SX, SX]], SX]:
    """Return the last frame's rotation, the shift to the tool's goal, the axes with their origins, and the tool."""
    R_goal, p_goal = last_frame(p, T)
    R = ca.SX.eye(3)
    position = ca.SX.zeros(3)
    axes = []
    for k, angle in enumerate(q, start=1):
        axes.append((R[:, 2], position))
        # Joint k turns about z, link k leads along z and x, and turns about x.
        R = R @ _rotation(2, *_pair(angle + p.offset[k - 1]))
        if k < len(q):
            position = position + R @ ca.vertcat(p.a[k], 0.0, p.d[k])
            R = R @ _rotation(0, *p.alpha[k])

    # The tool is at -R_t^T p_t in the last frame, with the last frame (R_t, p_t) as seen from the tool.
    tool = p.T_tool_last[:, :3].T @ -p.T_tool_last[:, 3]
    shift = p_goal - position + (R_goal - R) @ tool
    return R, shift, axes, position + R @ tool


def _pair(angle: SX) -> Pair:
    return ca.cos(angle), ca.sin(angle)


def _rotation(axis: int, cosine: SX, sine: SX) -> SX:
    """Return a rotation about axis x (0) or z (2), 3 x 3."""
    turn = ca.blockcat([[cosine, -sine], [sine, cosine]])
    return ca.diagcat(turn, 1.0) if axis == 2 else ca.diagcat(1.0, turn)


def symbols() -> tuple[SX, SX]:
    """Return symbols for the parameters and the tool's pose."""
    return ca.SX.sym("parameters", COUNT), ca.SX.sym("T", 4, 4)


def _real(
    p: Numbers, meeting: tuple[int, int], T: SX, q_1: SX, signs: tuple[SX, SX]
) -> tuple[_Arms, SX]:
    """Return the arm with roots of given signs, and the sum of the negative squares, which count as 0."""
    squares = []

    def take_root(square: Element, level: int) -> Element:
        squares.append(square)
        return signs[level - 1] * ca.sqrt(ca.fmax(square, 0.0))

    theta_1 = (ca.cos(q_1), ca.sin(q_1))
    arm = _assembled(p, meeting, T[:3, :], theta_1, take_root)
    first, second = squares
    return arm, ca.fmax(-first, 0.0) + ca.fmax(-second, 0.0)


@dataclass(frozen=True)
class Numbers:
    """The parameters by name; dictionaries count joints from 1."""

    per_length: SX
    offset: list[SX]
    d: dict[int, SX]
    a: dict[int, SX]
    alpha: dict[int, Pair]
    """Cosine and sine of the twist."""
    T_first_world: SX
    """3 x 4."""
    T_tool_last: SX
    """3 x 4."""

    @classmethod
    def read(cls, parameters: SX) -> Numbers:
        """Return the parameters by name."""
        sizes = (1, 6, 5, 5, 10, 12, 12)
        ends = [sum(sizes[: k + 1]) for k in range(len(sizes))]
        per_length, offset, d, a, twists, first, last = ca.vertsplit(parameters, [0, *ends])
        cosines_and_sines = ca.vertsplit(twists)
        return cls(
            per_length,
            ca.vertsplit(offset),
            dict(enumerate(ca.vertsplit(d), start=1)),
            dict(enumerate(ca.vertsplit(a), start=1)),
            dict(enumerate(zip(cosines_and_sines[::2], cosines_and_sines[1::2], strict=True), 1)),
            ca.reshape(first, 4, 3).T,
            ca.reshape(last, 4, 3).T,
        )


@dataclass(frozen=True)
class _Arms:
    """What remains of the arm with q1 and two roots known."""

    F: Element
    """Square of the length that link 2 would need, less that of link 2; both as shares of the reach."""
    denominators: tuple[Element, Element]
    """sin^2 of the angles between k and axis 5, and between k and axis 6."""
    link_2: Pair
    """Link 2 in the plane of joints 2 and 3, as a vector."""
    link_3: Pair
    """Direction of link 3 there."""
    wrist: tuple[Pair, Pair, Pair]
    """Joint angles 4, 5 and 6."""


def _assembled(
    p: Numbers, meeting: tuple[int, int], T: SX, theta_1: Pair, take_root: TakeRoot
) -> _Arms:
    """Return the arm with joint 1 at theta_1 and a choice of the roots."""
    R, position = _seen_from_link_1(p, T, theta_1)
    c_3, s_3 = p.alpha[3]
    c_4, s_4 = p.alpha[4]
    c_5, s_5 = p.alpha[5]
    sense = p.alpha[2][0]

    # k as seen from the last frame, u = R^T (0, 0, 1), and from frame 3, m = sense (0, sin alpha_3, cos alpha_3).
    u = (R[2, 0], R[2, 1], R[2, 2])
    m_1 = sense * s_3
    m_2 = sense * c_3
    square_of_u = u[0] * u[0] + u[1] * u[1]

    # Seen from frame 5 it is w = Rz(theta_6) u, with w_2 = u_2; before the twist of link 5, h = Rx(alpha_5) w. Seen
    # from frame 4 it is y = Rx(-alpha_4) Rz(-theta_4) m, and Rz(theta_5) h = y, so that h_2 = y_2:
    #     sin(alpha_5) w_1 + cos(alpha_5) u_2 = cos(alpha_4) m_2 - sin(alpha_4) m_1 cos(theta_4).             (1)
    # Along k the position is d_2 + sense d_3 + d_4 m_2 + a_4 m_1 sin(theta_4) + d_5 h_2 + a_5 w_0.          (2)
    along = position[2] - p.d[2] - sense * p.d[3] - p.d[4] * m_2
    if meeting == (4, 5):
        # a_4 = 0: (2) is a line in the plane of (w_0, w_1), which are on a circle.
        line = (p.a[5], p.d[5] * s_5)
        w_0, w_1 = _on_circle(line, along - p.d[5] * c_5 * u[2], square_of_u, take_root)
        h_2 = w_1 * s_5 + c_5 * u[2]
        cosine_4 = (h_2 - c_4 * m_2) * (-1.0 / (s_4 * m_1))
        theta_4 = (cosine_4, take_root(1.0 - cosine_4 * cosine_4, 2))
    else:
        # a_5 = 0: (2) is a line in the plane of cosine and sine of theta_4.
        line = (-p.d[5] * s_4 * m_1, p.a[4] * m_1)
        theta_4 = _on_circle(line, along - p.d[5] * c_4 * m_2, 1.0, take_root)
        h_2 = c_4 * m_2 - theta_4[0] * (s_4 * m_1)
        w_1 = (h_2 - c_5 * u[2]) * (1.0 / s_5)
        w_0 = take_root(square_of_u - w_1 * w_1, 2)

    over_u = 1.0 / square_of_u
    cosine_6 = (w_0 * u[0] + w_1 * u[1]) * over_u
    sine_6 = (w_1 * u[0] - w_0 * u[1]) * over_u
    theta_6 = (cosine_6, sine_6)

    h_0 = w_0
    h_1 = w_1 * c_5 - s_5 * u[2]
    y_0 = theta_4[1] * m_1
    y_1 = theta_4[0] * (c_4 * m_1) + s_4 * m_2
    square_of_h = 1.0 - h_2 * h_2
    over_h = _inverse(square_of_h)
    cosine_5 = (h_0 * y_0 + h_1 * y_1) * over_h
    sine_5 = (h_0 * y_1 - h_1 * y_0) * over_h
    theta_5 = (cosine_5, sine_5)

    # The direction of link 3, its x axis, is turned from frame 3 to the last frame, and then into the plane.
    x_3: Vector = (theta_4[0], -theta_4[1], 0.0)
    x_3 = turned_about_z(turned_about_x(x_3, p.alpha[4], -1.0), theta_5, -1.0)
    x_3 = turned_about_z(turned_about_x(x_3, p.alpha[5], -1.0), theta_6, -1.0)
    link_3 = (_row(R, 0, x_3), _row(R, 1, x_3))

    # From the end of link 3 to the last frame, as seen from frame 3, then turned by alpha_3, whose x and y count.
    local = (
        p.a[4] + cosine_5 * p.a[5],
        sine_5 * (c_4 * p.a[5]) - s_4 * p.d[5],
        p.d[4] + sine_5 * (s_4 * p.a[5]) + c_4 * p.d[5],
    )
    reach_x = p.a[3] + theta_4[0] * local[0] - theta_4[1] * local[1]
    lateral = theta_4[1] * local[0] + theta_4[0] * local[1]
    reach_y = (lateral * c_3 - local[2] * s_3) * sense

    link_2 = (
        position[0] - (link_3[0] * reach_x - link_3[1] * reach_y),
        position[1] - (link_3[1] * reach_x + link_3[0] * reach_y),
    )
    F = link_2[0] * link_2[0] + link_2[1] * link_2[1] - p.a[2] * p.a[2]
    return _Arms(F, (square_of_h, square_of_u), link_2, link_3, (theta_4, theta_5, theta_6))


def _seen_from_link_1(p: Numbers, T: SX, theta_1: Pair) -> tuple[SX, Vector]:
    """Return rotation (3 x 3) and position of the last frame behind joint 1 and link 1."""
    R, position = last_frame(p, T)

    def seen(vector: Vector) -> Vector:
        """Return a vector of frame 0 as seen behind joint 1."""
        return turned_about_z(vector, theta_1, -1.0)

    twist = p.alpha[1]
    columns = [turned_about_x(seen((R[0, k], R[1, k], R[2, k])), twist, -1.0) for k in range(3)]
    x, y, z = seen((position[0], position[1], position[2] - p.d[1]))
    return (
        ca.horzcat(*(ca.vertcat(*column) for column in columns)),
        turned_about_x((x - p.a[1], y, z), twist, -1.0),
    )


def last_frame(p: Numbers, T: SX) -> tuple[SX, SX]:
    """Return rotation (3 x 3) and position (3 x 1) of the last frame in frame 0, from the tool's pose in the world."""
    R = p.T_first_world[:, :3] @ T[:3, :3]
    position = p.T_first_world[:, :3] @ (T[:3, 3] * p.per_length) + p.T_first_world[:, 3]
    position = position + R @ p.T_tool_last[:, 3]
    return R @ p.T_tool_last[:, :3], position


def _on_circle(
    line: tuple[SX, SX], value: SX, square: SX, take_root: TakeRoot
) -> tuple[Element, Element]:
    """Return a point (x, y) with A x + B y = value and x^2 + y^2 = square, line = (A, B).

    With l^2 = A^2 + B^2 and r^2 = l^2 square - value^2, it is ((A, B) value + (-B, A) r) / l^2.
    """
    A, B = line
    over = 1.0 / (A * A + B * B)
    root = take_root((A * A + B * B) * square - value * value, 1)
    return root * (-B * over) + A * over * value, root * (A * over) + B * over * value


def _row(R: SX, k: int, vector: Vector) -> Element:
    """Return entry k of R vector."""
    return vector[0] * R[k, 0] + vector[1] * R[k, 1] + vector[2] * R[k, 2]


def _inverse(x: Element) -> Element:
    """Return 1 / x."""
    return x.inverse if isinstance(x, Extension) else 1.0 / x
