"""Figures of derivations of inverse kinematics as SVG, drawn from an arm's numbers at one pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TypeAlias

import numpy as np

from dhkit.description import Array
from dhkit.symbolic.inverse.derivation import InverseDerivation, Values
from dhkit.symbolic.inverse.forms import Circle, Form
from dhkit.symbolic.inverse.steps import DerivationStep, View

_WIDTH = 340
"""Width of a figure, in pixels."""
_HEIGHT = 250
"""Height of a figure, in pixels."""
_MARGIN = 46
"""Width of a figure's margin, for labels, in pixels."""
_FIRST = "var(--mark, #0b5cad)"
"""Colour of the first solution."""
_SECOND = "#c2570c"
"""Colour of the second solution."""
_PLAIN = "currentColor"
"""Colour of points."""
_FAINT = "#8c959f"
"""Colour of auxiliary lines."""
_LETTER = 6.8
"""Mean width of a letter, in pixels."""
_SHORT = 1e-9
"""Shortest length that is drawn, as a share of the figure's size."""

_Pixel: TypeAlias = tuple[float, float]
"""A point of the figure, in pixels from the top left corner."""


@dataclass
class _Drawing:
    """Lines, circles and labels in the arm's metres."""

    points: list[Array] = field(default_factory=list)
    """Points that the figure contains, shape (2,) each, m."""
    items: list[tuple[str, tuple[Array, ...], str, str]] = field(default_factory=list)
    """Parts of the drawing: kind, points, colour, and text or style."""

    def line(self, a: Array, b: Array, colour: str, style: str = "") -> None:
        """Add a line."""
        self.points += [a, b]
        self.items.append(("line", (a, b), colour, style))

    def dot(self, at: Array, label: str, colour: str = _PLAIN) -> None:
        """Add a point with its name."""
        self.points.append(at)
        self.items.append(("dot", (at,), colour, label))

    def name(self, at: Array, text: str, colour: str) -> None:
        """Add a text at a point."""
        self.items.append(("name", (at,), colour, text))

    def label(self, a: Array, b: Array, text: str, colour: str) -> None:
        """Add a text beside the middle of a line."""
        self.items.append(("label", (a, b), colour, text))

    def circle(self, centre: Array, radius: float) -> None:
        """Add a dashed circle."""
        self.points += [centre - radius, centre + radius]
        self.items.append(("circle", (centre, np.array([radius, 0.0])), _FAINT, ""))

    def svg(self, title: str) -> str:
        """Return the picture."""
        # Pixels per metre, so that all points are within the margins; a flat figure counts as 5 % as high as wide.
        low = np.min(self.points, axis=0)
        high = np.max(self.points, axis=0)
        longest = max(float((high - low).max()), 1e-9)
        size = np.maximum(high - low, 0.05 * longest)
        scale = float(min((_WIDTH - 2 * _MARGIN) / size[0], (_HEIGHT - 2 * _MARGIN) / size[1]))
        middle = (low + high) / 2

        def at(point: Array) -> _Pixel:
            x, y = (point - middle) * scale
            return round(_WIDTH / 2 + x, 1), round(_HEIGHT / 2 - y, 1)

        lines: list[tuple[_Pixel, _Pixel]] = []
        for kind, points, *_ in self.items:
            if kind == "line":
                a, b = points
                lines.append((at(a), at(b)))

        texts = []
        parts = [
            f'<svg class="figure" role="img" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" height="{_HEIGHT}" '
            f'xmlns="http://www.w3.org/2000/svg"><title>{escape(title)}</title>'
        ]
        for kind, points, colour, text in self.items:
            places = [at(point) for point in points]
            if kind == "line":
                (x1, y1), (x2, y2) = places
                dash = ' stroke-dasharray="5 4"' if text == "dashed" else ""
                width = 1.2 if text == "dashed" else 3
                parts.append(
                    f'<path d="M{x1} {y1}L{x2} {y2}" stroke="{colour}" stroke-width="{width}"{dash}/>'
                )
            elif kind == "circle":
                x, y = places[0]
                radius = round(float(points[1][0]) * scale, 1)
                parts.append(
                    f'<circle cx="{x}" cy="{y}" r="{radius}" fill="none" stroke="{colour}" stroke-dasharray="3 3"/>'
                )
            elif kind == "dot":
                ((x, y),) = places
                parts.append(f'<circle cx="{x}" cy="{y}" r="4.5" fill="{colour}"/>')
                texts.append(_text((x, y), text, colour, lines))
            elif kind == "name":
                texts.append(_text(places[0], text, colour, lines))
            else:
                texts.append(_beside(places[0], places[1], text, colour))
        return "".join([*parts, *texts, "</svg>"])


def figure_of(derivation: InverseDerivation, step: DerivationStep, T: Array) -> str:
    """Return the figure of a step at a pose T (4, 4), m; empty if it has none, or the pose has no solution."""
    if step.figure is None or step.form is None:
        return ""
    found = [values for values, solved in derivation.candidates(T[None]) if solved[0]]
    if not found:
        return ""
    draw = {View.TOP: _top, View.TRIANGLE: _triangle, View.SLIDE: _slide}[step.figure.view]
    return draw(derivation, step, step.form, found[0]).svg(
        f"{step.title}: {', '.join(step.figure.labels)}"
    )


def _named_roots(
    step: DerivationStep, form: Form, values: Values
) -> list[tuple[float, str, list[float]]]:
    """Return the two roots of a step at the pose: value, name, and the values of the factors of the rule."""
    if step.choice is None:
        return []
    letters = {letter: np.array(value) for letter, value in _letters(form, values).items()}
    roots = []
    for sign in (1.0, -1.0):
        root, _ = form.solve(letters, sign)
        values.set_unknown(form.unknown, np.ravel(root))
        factors = [_first(values.of(factor)) for factor in step.choice.factors]
        product_is_positive = sum(factor < 0 for factor in factors) % 2 == 0
        name = step.choice.names[0 if product_is_positive else 1]
        roots.append((_first(root), name, factors))
    return roots


def _first(values: Array) -> float:
    """Return the value at the first pose, of an array of shape (N,) or ()."""
    return float(np.ravel(values)[0])


def sample_pose(derivation: InverseDerivation) -> Array:
    """Return a pose that the figures show, shape (4, 4), m: the nominal one, or one away from singularities."""
    from dhkit.description import world_to_tool

    description = derivation.description
    named = description.numbers.configurations
    q = named.get("nominal")
    if q is None or not np.all(np.abs(q) > 0.05):
        # Angles theta_i from 0.05 to 0.65 rad, and 0.4 of the reach.
        theta = 0.35 + 0.3 * np.cos(np.arange(description.n) * 2.0)
        q = np.where(description.numbers.prismatic, 0.4 * max(description.reach, 0.1), theta)
        q = q - np.array([_offset(derivation, i) for i in range(description.n)])
    return world_to_tool(description, np.asarray(q))


def _offset(derivation: InverseDerivation, i: int) -> float:
    """Return theta_i minus the value of a revolute joint i, from 0, rad; 0 for a prismatic one."""
    is_revolute = derivation.description.kinds[i] == "R"
    return derivation.chain.number(derivation.chain.offsets[i]) if is_revolute else 0.0


def _letters(form: Form, values: Values) -> dict[str, float]:
    """Return the values of a form's letters at the first pose."""
    return {letter: _first(values.of(element)) for letter, element in form.letters.items()}


def _top(
    derivation: InverseDerivation, step: DerivationStep, form: Form, values: Values
) -> _Drawing:
    """Draw the arm's plane seen along axis 1: the point, and for each solution the line in which the arm points."""
    drawing = _Drawing()
    letters = _letters(form, values)
    origin = np.zeros(2)
    axis, who = _labels(step)

    # The point, and its distance from the line in which the arm points; see turn_the_plane.
    if isinstance(form, Circle):
        point = np.array([letters["B"], -letters["A"]])
        distance = abs(letters["C"])
    else:
        point = np.array([letters["X"], letters["Y"]])
        distance = 0.0
    radius = float(np.linalg.norm(point))

    roots = _named_roots(step, form, values)
    for k, ((angle, name, _), colour) in enumerate(zip(roots, (_FIRST, _SECOND), strict=True)):
        ahead = np.array([np.cos(angle), np.sin(angle)])
        foot = point - (point @ ahead) * ahead
        if distance > _SHORT * radius:
            drawing.line(origin, foot, colour, "dashed")
            drawing.line(foot, point, colour)
        elif k == 0:
            drawing.line(origin, point, colour)
        tip = foot + 0.35 * radius * ahead
        drawing.line(foot, tip, colour, "dashed")
        drawing.name(tip, f"theta1, {name}", colour)

    if distance:
        drawing.circle(origin, distance)
    drawing.dot(origin, axis)
    drawing.dot(point, who)
    return drawing


def _labels(step: DerivationStep) -> tuple[str, ...]:
    """Return the names of the axes and of the point."""
    return step.figure.labels if step.figure is not None else ()


def _place(derivation: InverseDerivation, values: Values) -> Array:
    """Return the point (x, y) that the step reaches, shape (2,), m."""
    x = _first(values.of(derivation.chain.symbol("x")))
    y = _first(values.of(derivation.chain.symbol("y")))
    return np.array([x, y])


def _triangle(
    derivation: InverseDerivation, step: DerivationStep, form: Form, values: Values
) -> _Drawing:
    """Draw two links and the point that they reach, for both solutions, seen along their axes."""
    drawing = _Drawing()
    letters = _letters(form, values)
    origin = np.zeros(2)
    point = _place(derivation, values)

    # The triangle's sides: R to the point, L1 and L2 the links. In the equation of the law of cosines,
    # A cos(theta) + B sin(theta) = C, the amplitude is sqrt(A^2 + B^2) = 2 L1 L2.
    R = float(np.linalg.norm(point))
    amplitude = float(np.hypot(letters["A"], letters["B"]))
    x1, y1 = step.figure.first if step.figure is not None else ()
    L1 = float(np.hypot(_first(values.of(x1)), _first(values.of(y1))))
    L2 = amplitude / (2 * L1)

    # Angle between the line to the point and the first link.
    opening = np.arccos(np.clip((L1 * L1 + R * R - L2 * L2) / (2 * L1 * R), -1.0, 1.0))

    # The first factor of the rule is positive where the elbow is on the left of the line to the point.
    first_axis, second_axis, who = _labels(step)
    elbows = {}
    for _, name, factors in _named_roots(step, form, values):
        angle = opening if factors[0] > 0 else -opening
        elbows[name] = _rotated(point, angle) * L1 / R
    if "up" in elbows and "down" in elbows and elbows["up"][1] < elbows["down"][1]:
        # The plane's y axis points down: the figure is seen from the other side of y.
        point = point * [1, -1]
        elbows = {name: elbow * [1, -1] for name, elbow in elbows.items()}
    for (name, elbow), colour in zip(elbows.items(), (_FIRST, _SECOND), strict=True):
        drawing.line(origin, elbow, colour)
        drawing.line(elbow, point, colour)
        drawing.dot(elbow, f"{second_axis}, {name}", colour)
    drawing.line(origin, point, _FAINT, "dashed")
    drawing.label(origin, point, "sqrt(x^2 + y^2)", _FAINT)
    drawing.dot(origin, first_axis)
    drawing.dot(point, who)
    return drawing


def _slide(
    derivation: InverseDerivation, step: DerivationStep, form: Form, values: Values
) -> _Drawing:
    """Draw the line on which a prismatic joint moves the point, for both solutions, seen along the revolute axis."""
    drawing = _Drawing()
    letters = _letters(form, values)
    origin = np.zeros(2)
    point = _place(derivation, values)

    # Q = R^2 is the squared distance of the point from the axis, S the square of its way along the line from the
    # line's nearest point.
    R = float(np.linalg.norm(point))
    nearest = float(np.sqrt(max(letters["Q"] - letters["S"], 0.0)))
    axis, who = _labels(step)
    if nearest > _SHORT * R:
        for sign, colour in ((1.0, _FIRST), (-1.0, _SECOND)):
            foot = _rotated(point, sign * np.arccos(nearest / R)) * nearest / R
            drawing.line(origin, foot, colour, "dashed")
            drawing.line(foot, point, colour)
        drawing.line(origin, point, _FAINT, "dashed")
    else:
        drawing.line(origin, point, _FIRST)
    drawing.label(origin, point, "sqrt(x^2 + y^2)", _FAINT)
    drawing.dot(origin, axis)
    drawing.dot(point, who)
    return drawing


def _rotated(vector: Array, angle: float) -> Array:
    """Return a vector, shape (2,), rotated by an angle, rad."""
    x, y = vector
    c = np.cos(angle)
    s = np.sin(angle)
    return np.array([c * x - s * y, s * x + c * y])


def _text(at: _Pixel, text: str, colour: str, lines: Sequence[tuple[_Pixel, _Pixel]]) -> str:
    """Return a text above or below a point, where fewer of its lines lead, inside the figure."""
    # The other ends of the lines that begin or end at the point.
    others = []
    for a, b in lines:
        if a == at:
            others.append(b)
        if b == at:
            others.append(a)

    # Sum of the downward components of their directions; y is down.
    x, y = at
    downwards = sum((v - y) / max(float(np.hypot(u - x, v - y)), 1.0) for u, v in others)
    half_width = _LETTER * len(text) / 2
    x = min(max(x, half_width), _WIDTH - half_width)
    y += -10 if downwards > 0 else 18
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="middle" fill="{colour}">{escape(text)}</text>'
    )


def _beside(a: _Pixel, b: _Pixel, text: str, colour: str) -> str:
    """Return a text beside the middle of a line, on its right where it rises and on its left where it falls."""
    x1, y1 = a
    x2, y2 = b
    x = (x1 + x2) / 2
    y = (y1 + y2) / 2

    # 12 pixels along the line's normal.
    length = max(float(np.hypot(x2 - x1, y2 - y1)), 1.0)
    nx = 12 * (y2 - y1) / length
    ny = -12 * (x2 - x1) / length
    anchor = "middle"
    if nx > 4:
        anchor = "start"
    elif nx < -4:
        anchor = "end"
    return f'<text x="{x + nx:.1f}" y="{y + ny + 4:.1f}" text-anchor="{anchor}" fill="{colour}">{escape(text)}</text>'
