"""The sketch of a report: an arm's skeleton with its joints' axes, DH frames and the lengths of its table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from dhkit.description import Array, Convention, Description, Units, world_to_frames, world_to_tool
from dhkit.report.pictures import PAGE_WIDTH
from dhkit.viewer.notebook import new_figure
from dhkit.viewer.overlays import AXIS_COLORS
from dhkit.viewer.scene import scene_size

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEIGHT = 5.2
"""Height of the sketch, inches."""
_MARGIN = 0.45
"""Room around the arm for labels, inches."""
_TRIAD = 0.42
"""Length of the frames' axes, inches."""
_AZIMUTH = np.radians(-62.0)
_ELEVATION = np.radians(22.0)
_LINK_COLOR = "#8a93a1"
_DIMENSION_COLOR = "#1b1f24"
_SHORTEST = 1e-6
"""Shortest length with a dimension, as a share of the arm's size."""
_LETTER = 0.078
"""Width of a letter of a label, inches."""
_LINE = 0.17
"""Height of a label, inches."""
_RADII = (0.16, 0.26, 0.38, 0.55, 0.75)
"""Distances of a label from its point that are tried, inches."""
_DIRECTIONS = 16
"""Number of directions from its point in which a label is tried."""
_PER_INCH = 12
"""Points of a line, for each inch, that labels keep off."""


@dataclass(frozen=True, eq=False)
class _Length:
    """A length of the table, drawn between two points."""

    name: str
    value: float
    begin: Array
    end: Array


@dataclass
class _Sketch:
    """Lines in inches on the page, and labels that keep off them and off each other."""

    axes: Any
    obstacles: list[Array] = field(default_factory=list)
    """Points that labels keep off, shape (k, 2) each, inches."""
    boxes: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Left, low, right and high end of each label, inches."""

    def line(self, a: Array, b: Array, color: str, *, avoid: bool = True, **style: Any) -> None:
        """Draw a line, shape (2,) each end; labels keep off it."""
        self.axes.plot([a[0], b[0]], [a[1], b[1]], color=color, **style)
        if avoid:
            count = max(2, int(_PER_INCH * float(np.linalg.norm(b - a))))
            self.obstacles.append(np.linspace(a, b, count))

    def label(self, at: Array, text: str, letters: int, color: str, size: int = 9) -> None:
        """Write a text near a point, where the fewest lines and labels are; far texts get a line to their point."""
        width = _LETTER * letters
        points = np.concatenate(self.obstacles) if self.obstacles else np.zeros((0, 2))
        best = at
        least = np.inf
        for k, radius in enumerate(_RADII):
            for angle in np.arange(_DIRECTIONS) * 2 * np.pi / _DIRECTIONS:
                ahead = np.array([np.cos(angle), np.sin(angle)])
                centre = at + (radius + abs(ahead[0]) * width / 2) * ahead
                cost = self._cost(centre, width, points) + 0.5 * k
                if cost < least:
                    least = cost
                    best = centre
        half = np.array([width, _LINE]) / 2
        self.boxes.append((*(best - half), *(best + half)))
        if np.linalg.norm(best - at) - width / 2 > _RADII[1]:
            self.axes.plot([at[0], best[0]], [at[1], best[1]], color=color, lw=0.5, alpha=0.5)
        box = {"boxstyle": "square,pad=0.08", "fc": "white", "ec": "none", "alpha": 0.85}
        self.axes.text(*best, text, ha="center", va="center", fontsize=size, color=color, bbox=box)

    def _cost(self, centre: Array, width: float, points: Array) -> float:
        """Return how much a label covers: points of lines, and 10 for each label."""
        low = centre - np.array([width, _LINE]) / 2
        high = centre + np.array([width, _LINE]) / 2
        covered = np.all((points > low) & (points < high), axis=1).sum()
        others = sum(
            low[0] < right and high[0] > left and low[1] < top and high[1] > bottom
            for left, bottom, right, top in self.boxes
        )
        return float(covered + 10 * others)


def frame_sketch(description: Description, q: Array) -> Figure:
    """Return a sketch of an arm's frames with the lengths d and a of its table.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (n,), rad and m.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> figure = frame_sketch(library_robot("planar2r"), np.zeros(2))
    >>> [text.get_text() for text in figure.axes[0].texts if "=" in text.get_text()]
    ['$a_{1}$ = 0.5 m', '$a_{2}$ = 0.4 m']
    """
    frames = world_to_frames(description, q)
    tool = world_to_tool(description, q)
    lengths = list(_lengths(description, frames))
    tips = [frames[:, :3, 3], tool[None, :3, 3]]
    tips += [np.stack([length.begin, length.end]) for length in lengths]
    points = np.concatenate(tips)

    # Orthographic projection: rows of R are right and up on the page.
    flat = float(np.ptp(points[:, 2])) < _SHORTEST * scene_size(description)
    R = np.eye(3)[:2] if flat else _view()
    pages = points @ R.T
    low = pages.min(axis=0)
    span = np.maximum(np.ptp(pages, axis=0), 1e-9)
    room = np.array([PAGE_WIDTH, _HEIGHT]) - 2 * (_MARGIN + _TRIAD)
    scale = float((room / span).min())
    height = min(_HEIGHT, float(span[1]) * scale + 2 * (_MARGIN + _TRIAD))
    middle = low + span / 2
    centre = np.array([PAGE_WIDTH, height]) / 2

    def place(point: Array) -> Array:
        """Return a point on the page, inches."""
        return np.asarray((R @ point - middle) * scale + centre)

    figure = new_figure(figsize=(PAGE_WIDTH, height))
    axes: Any = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, PAGE_WIDTH), ylim=(0, height), aspect="equal")
    axes.set_axis_off()
    sketch = _Sketch(axes)
    _draw(sketch, description, frames, tool, lengths, R, place)
    return figure


def _view() -> Array:
    """Return the directions right and up on the page, shape (2, 3), world."""
    ca, sa = np.cos(_AZIMUTH), np.sin(_AZIMUTH)
    ce, se = np.cos(_ELEVATION), np.sin(_ELEVATION)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce]])


def _lengths(description: Description, frames: Array) -> Iterator[_Length]:
    """Yield the lengths of the table as they lie at a pose: d along the joint's axis, a along the common normal."""
    standard = description.convention is Convention.STANDARD
    for i, (before, after) in enumerate(pairwise(frames), start=1):
        step = after[:3, 3] - before[:3, 3]
        z = (before if standard else after)[:3, 2]
        d = float(step @ z)
        x = (after if standard else before)[:3, 0]
        a = float(step @ x)
        if standard:
            corner = before[:3, 3] + d * z
            yield _Length(f"d_{{{i}}}", d, before[:3, 3], corner)
            yield _Length(f"a_{{{i}}}", a, corner, after[:3, 3])
        else:
            corner = before[:3, 3] + a * x
            yield _Length(f"a_{{{i - 1}}}", a, before[:3, 3], corner)
            yield _Length(f"d_{{{i}}}", d, corner, after[:3, 3])


def _draw(
    sketch: _Sketch,
    description: Description,
    frames: Array,
    tool: Array,
    lengths: Sequence[_Length],
    R: Array,
    place: Any,
) -> None:
    size = scene_size(description)
    shown = [length for length in lengths if abs(length.value) > _SHORTEST * size]
    for length in shown:
        sketch.line(
            place(length.begin),
            place(length.end),
            _LINK_COLOR,
            lw=5,
            solid_capstyle="round",
            zorder=1,
        )
    end = place(frames[-1, :3, 3])
    if np.linalg.norm(tool[:3, 3] - frames[-1, :3, 3]) > _SHORTEST * size:
        sketch.line(end, place(tool[:3, 3]), _LINK_COLOR, lw=2, ls="--", zorder=1)

    triads = _triads(frames, R, place)
    for triad in triads:
        color = AXIS_COLORS[triad.axis]
        if triad.is_towards_reader:
            sketch.axes.plot(*triad.begin, "o", mfc="white", mec=color, ms=8, zorder=4)
            sketch.axes.plot(*triad.begin, ".", color=color, ms=4, zorder=5)
            continue
        sketch.line(triad.begin, triad.end, color, lw=1.6, zorder=3)
        sketch.axes.annotate(
            "",
            triad.end,
            triad.begin,
            arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.2, "shrinkA": 0, "shrinkB": 0},
        )
    for origin in frames[:, :3, 3]:
        sketch.axes.plot(*place(origin), "o", mfc="white", mec="#3a4252", ms=4, zorder=6)

    # Lengths first: they have the least choice of places.
    units = _units(description)
    for length in shown:
        text = f"{abs(length.value) / float(units.metres):.4g} {units.length}"
        sketch.label(
            (place(length.begin) + place(length.end)) / 2,
            f"${length.name}$ = {'−' if length.value < 0 else ''}{text}",
            len(text) + 5,
            _DIMENSION_COLOR,
        )
    for triad in triads:
        names = ", ".join(f"{'xyz'[triad.axis]}_{{{k}}}" for k in triad.frames)
        sketch.label(triad.end, f"${names}$", 2 * len(triad.frames) + 1, AXIS_COLORS[triad.axis])


def _units(description: Description) -> Units:
    """Return the units of the table as it is printed: metres where lengths are symbols."""
    symbolic = any(joint.a.symbols or joint.d.symbols for joint in description.joints)
    return Units() if symbolic else description.units


@dataclass
class _Axis:
    """An axis x or z that some frames share."""

    axis: int
    begin: Array
    end: Array
    frames: list[int]
    is_towards_reader: bool


def _triads(frames: Array, R: Array, place: Any) -> list[_Axis]:
    """Return the axes x and z of frames on the page; those of equal origin and direction are one."""
    found: list[_Axis] = []
    for k, T in enumerate(frames):
        for axis in (0, 2):
            begin = place(T[:3, 3])
            direction = R @ T[:3, axis]
            end = begin + _TRIAD * direction
            same = next(
                (
                    other
                    for other in found
                    if other.axis == axis
                    and np.allclose(other.begin, begin, atol=1e-3)
                    and np.allclose(other.end, end, atol=1e-3)
                ),
                None,
            )
            if same is None:
                towards = float(np.linalg.norm(direction)) < 0.05
                found.append(_Axis(axis, begin, end, [k], towards))
            else:
                same.frames.append(k)
    return found
