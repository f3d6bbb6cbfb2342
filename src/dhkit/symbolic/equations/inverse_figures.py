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
_HEIGHT = 250
_MARGIN = 46
"""Width, height and margin of a figure, px."""
_FIRST = "#0b5cad"
_SECOND = "#c2570c"
_PLAIN = "#1b1f24"
_FAINT = "#8c959f"
"""Colours of the two solutions, of points, and of helping lines."""
_LETTER = 6.8
"""Mean width of a letter, in pixels."""
_SHORT = 1e-9
"""Share of the figure's size below which a length is not drawn."""


_Pixel: TypeAlias = tuple[float, float]


@dataclass
class _Drawing:
    """Lines, circles and labels in the arm's metres."""

    points: list[Array] = field(default_factory=list)
    items: list[tuple[str, tuple[Array, ...], str, str]] = field(default_factory=list)

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
        low = np.min(self.points, axis=0)
        high = np.max(self.points, axis=0)
        size = np.maximum(high - low, max(float((high - low).max()), 1e-9) * 0.05)
        scale = float(min((_WIDTH - 2 * _MARGIN) / size[0], (_HEIGHT - 2 * _MARGIN) / size[1]))
        middle = (low + high) / 2

        def at(point: Array) -> tuple[float, float]:
            x, y = (point - middle) * scale
            return round(_WIDTH / 2 + x, 1), round(_HEIGHT / 2 - y, 1)

        lines = [[at(point) for point in points] for kind, points, *_ in self.items if kind == "line"]
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
                parts.append(f'<path d="M{x1} {y1}L{x2} {y2}" stroke="{colour}" stroke-width="{width}"{dash}/>')
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
    return draw(derivation, step, step.form, found[0]).svg(f"{step.title}: {', '.join(step.figure.labels)}")


def _named_roots(step: DerivationStep, form: Form, values: Values) -> list[tuple[float, str, list[float]]]:
    """Return the two roots of a step at the pose: value, name, and the values of the factors of the rule."""
    if step.choice is None:
        return []
    letters = {k: np.array(v) for k, v in _letters(form, values).items()}
    roots = []
    for sign in (1.0, -1.0):
        found, _ = form.solve(letters, sign)
        values.set_unknown(form.unknown, np.ravel(found))
        factors = [float(np.ravel(values.of(factor))[0]) for factor in step.choice.factors]
        is_first = sum(factor < 0 for factor in factors) % 2 == 0
        roots.append((float(np.ravel(found)[0]), step.choice.names[0 if is_first else 1], factors))
    return roots


def sample_pose(derivation: InverseDerivation) -> Array:
    """Return a pose that the figures show, shape (4, 4), m: of a typical configuration."""
    from dhkit.description import world_to_tool

    description = derivation.description
    named = description.numbers.configurations
    q = named.get("nominal")
    if q is None or not np.all(np.abs(q) > 0.05):
        q = 0.35 + 0.3 * np.cos(np.arange(description.n) * 2.0)
        q = np.where(description.numbers.prismatic, 0.4 * max(description.reach, 0.1), q)
        q = q - np.array([_offset(derivation, i) for i in range(description.n)])
    return world_to_tool(description, np.asarray(q))


def _offset(derivation: InverseDerivation, i: int) -> float:
    is_turning = derivation.description.kinds[i] == "R"
    return derivation.chain.number(derivation.chain.offsets[i]) if is_turning else 0.0


def _letters(form: Form, values: Values) -> dict[str, float]:
    return {letter: float(np.ravel(values.of(element))[0]) for letter, element in form.letters.items()}


def _top(derivation: InverseDerivation, step: DerivationStep, form: Form, values: Values) -> _Drawing:
    drawing = _Drawing()
    letters = _letters(form, values)
    origin = np.zeros(2)
    axis, who = _labels(step)
    is_beside = isinstance(form, Circle)
    point = np.array([letters["B"], -letters["A"]] if is_beside else [letters["X"], letters["Y"]])
    beside = abs(letters["C"]) if is_beside else 0.0
    for (angle, name, _), sign, colour in zip(
        _named_roots(step, form, values), (1.0, -1.0), (_FIRST, _SECOND), strict=True
    ):
        ahead = np.array([np.cos(angle), np.sin(angle)])
        foot = point - (point @ ahead) * ahead
        if beside > _SHORT * float(np.linalg.norm(point)):
            drawing.line(origin, foot, colour, "dashed")
            drawing.line(foot, point, colour)
        elif sign > 0:
            drawing.line(origin, point, colour)
        tip = foot + 0.35 * float(np.linalg.norm(point)) * ahead
        drawing.line(foot, tip, colour, "dashed")
        drawing.name(tip, f"theta1, {name}", colour)
    if beside:
        drawing.circle(origin, beside)
    drawing.dot(origin, axis)
    drawing.dot(point, who)
    return drawing


def _labels(step: DerivationStep) -> tuple[str, ...]:
    return step.figure.labels if step.figure is not None else ()


def _place(derivation: InverseDerivation, values: Values) -> Array:
    return np.array([float(np.ravel(values.of(derivation.chain.symbol(name)))[0]) for name in "xy"])


def _triangle(derivation: InverseDerivation, step: DerivationStep, form: Form, values: Values) -> _Drawing:
    drawing = _Drawing()
    letters = _letters(form, values)
    origin = np.zeros(2)
    point = _place(derivation, values)
    R = float(np.linalg.norm(point))
    N = float(np.hypot(letters["A"], letters["B"]))
    L1 = float(np.hypot(*(np.ravel(values.of(element))[0] for element in (step.figure.first if step.figure else ()))))
    L2 = N / (2 * L1)
    opening = np.arccos(np.clip((L1 * L1 + R * R - L2 * L2) / (2 * L1 * R), -1.0, 1.0))
    first_axis, second_axis, who = _labels(step)
    roots = _named_roots(step, form, values)
    # The first factor of the rule is positive where the elbow is on the left of the line to the point.
    elbows = {name: _turned(point, opening if side > 0 else -opening) * L1 / R for _, name, (side, *_) in roots}
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


def _slide(derivation: InverseDerivation, step: DerivationStep, form: Form, values: Values) -> _Drawing:
    drawing = _Drawing()
    letters = _letters(form, values)
    origin = np.zeros(2)
    point = _place(derivation, values)
    R = float(np.linalg.norm(point))
    near = float(np.sqrt(max(letters["Q"] - letters["S"], 0.0)))
    axis, who = _labels(step)
    if near > _SHORT * R:
        for sign, colour in ((1.0, _FIRST), (-1.0, _SECOND)):
            foot = _turned(point, sign * np.arccos(near / R)) * near / R
            drawing.line(origin, foot, colour, "dashed")
            drawing.line(foot, point, colour)
        drawing.line(origin, point, _FAINT, "dashed")
    else:
        drawing.line(origin, point, _FIRST)
    drawing.label(origin, point, "sqrt(x^2 + y^2)", _FAINT)
    drawing.dot(origin, axis)
    drawing.dot(point, who)
    return drawing


def _turned(vector: Array, angle: float) -> Array:
    c = np.cos(angle)
    s = np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _text(at: _Pixel, text: str, colour: str, lines: Sequence[Sequence[_Pixel]]) -> str:
    """Return a text above or below a point, where fewer of its lines lead, inside the figure."""
    x, y = at
    others = [other for a, b in lines for here, other in ((a, b), (b, a)) if here == at]
    downwards = sum((v - y) / max(float(np.hypot(u - x, v - y)), 1.0) for u, v in others)
    half = _LETTER * len(text) / 2
    x = min(max(x, half), _WIDTH - half)
    y += -10 if downwards > 0 else 18
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="middle" fill="{colour}">{escape(text)}</text>'


def _beside(a: _Pixel, b: _Pixel, text: str, colour: str) -> str:
    """Return a text beside the middle of a line, on its right where it rises and on its left where it falls."""
    x1, y1 = a
    x2, y2 = b
    x = (x1 + x2) / 2
    y = (y1 + y2) / 2
    length = max(float(np.hypot(x2 - x1, y2 - y1)), 1.0)
    nx = 12 * (y2 - y1) / length
    ny = -12 * (x2 - x1) / length
    anchor = "middle"
    if abs(nx) > 4:
        anchor = "start" if nx > 0 else "end"
    return f'<text x="{x + nx:.1f}" y="{y + ny + 4:.1f}" text-anchor="{anchor}" fill="{colour}">{escape(text)}</text>'
