"""Figures in the width of a paper's column or page: text in points of print, diagrams below each other in a column."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

_MM = 1 / 25.4
"""Inches."""
_NARROW = 130.0
"""Width below which diagrams that were side by side are below each other, mm."""
_LEAST, _MOST = 60.0, 500.0
"""Smallest and largest width, mm."""
_TEXT = 7.0
_TITLE = 8.0
"""Largest size of text and of titles, points, as in a paper's captions."""
_ROW = 0.52
"""Height of a diagram in a column, over the column's width."""
_REST = 16.0
"""Height of title and legend, mm."""
_LINES = 0.7
"""Factor of the widths of lines and of the sizes of markers."""
_LETTER = 1.45
_TITLE_LETTER = 1.85
_HANDLE = 7.0
"""Width of a letter of text and of titles, and of a line in a legend with the space about it, mm."""
_NAMES = 0.3
"""Share of the figure's width that names beside a diagram may take."""
_LEAST_LETTERS = 8
"""Smallest number of letters of a line."""
_ZOOM = 0.86
_ZOOM_BY_WIDTH = 0.0083
"""Largest zoom of a drawing in space, and the zoom for each mm, at which the labels of its axes are not cut off."""


def fit_to_width(figure: Figure, width: float) -> None:
    """Change a figure so that it can be printed in a width, mm, without being scaled.

    Parameters
    ----------
    figure
        The figure.
    width
        Width, mm: 88 for a column of many journals, 180 for a page.

    Raises
    ------
    ValueError
        ``width`` is below 60 or above 500 mm.
    """
    if not _LEAST <= width <= _MOST:
        raise ValueError(f"width is {width} mm; expected {_LEAST:g} to {_MOST:g} mm")
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

    before, height = figure.get_size_inches()
    inches = width * _MM
    # A colour bar has no place of its own, but stands beside the diagrams.
    places: dict[tuple[int, int], list[Axes]] = {}
    for axes in figure.axes:
        place = axes.get_subplotspec()
        if place is not None:
            # Diagrams with two scales are two that share a place.
            places.setdefault((place.colspan.start, place.rowspan.start), []).append(axes)
    columns = len({column for column, _ in places})
    if width < _NARROW and columns > 1:
        height = _stacked(figure, [places[place] for place in sorted(places)], width) * _MM
        columns = 1
    else:
        height *= inches / before
    figure.set_size_inches(inches, height)
    _print_text(figure, width, columns)
    for axes in figure.axes:
        if isinstance(axes, Axes3D):
            axes.set_box_aspect(axes.get_box_aspect(), zoom=min(_ZOOM, width * _ZOOM_BY_WIDTH))
    _thin_lines(figure)
    for legend in list(figure.legends):
        _refill(figure, legend, width)


def _stacked(figure: Figure, diagrams: list[list[Axes]], width: float) -> float:
    """Put diagrams below each other, and return the figure's height, mm."""
    from matplotlib.gridspec import GridSpec

    heights = [width if group[0].name == "3d" else _ROW * width for group in diagrams]
    grid = GridSpec(len(diagrams), 1, figure=figure, height_ratios=heights)
    for row, group in enumerate(diagrams):
        for panel in group:
            panel.set_subplotspec(grid[row, 0])
            panel.set_anchor("C")
            panel.tick_params(labelbottom=panel.name == "3d" or bool(panel.get_xlabel()))
    return sum(heights) + _REST


def _print_text(figure: Figure, width: float, columns: int) -> None:
    """Reduce text to the sizes of print, and break titles into lines."""
    from matplotlib.text import Text

    titles = [axes.title for axes in figure.axes]
    has_bar = any(axes.get_subplotspec() is None for axes in figure.axes)
    for title in titles:
        letters = int((0.6 if has_bar else 1.0) * width / columns / _TITLE_LETTER)
        title.set_text(textwrap.fill(title.get_text(), letters))
    if figure.get_suptitle():
        letters = int(width / _TITLE_LETTER)
        titles.append(figure.suptitle(textwrap.fill(figure.get_suptitle(), letters), weight="bold"))
    for axes in figure.axes:
        _wrap_names(axes, width, figure.get_figheight() / _MM)
    for text in figure.findobj(Text):
        largest = _TITLE if text in titles else _TEXT
        text.set_fontsize(min(text.get_fontsize(), largest))
    for axes in figure.axes:
        axes.tick_params(labelsize=_TEXT - 0.5, length=2.5, pad=2)
        for axis in (axes.xaxis, axes.yaxis):
            axis.labelpad = min(axis.labelpad, 2)


def _wrap_names(axes: Axes, width: float, height: float) -> None:
    """Break the names of axes, and names at the ticks of one, such as those of controllers, into lines that fit.

    Parameters
    ----------
    axes
        A diagram.
    width, height
        Of the figure, mm.
    """
    box = axes.get_position()
    letters = max(_LEAST_LETTERS, int(_NAMES * width / _LETTER))
    names = [label.get_text() for label in axes.yaxis.get_ticklabels()]
    is_formula = any("$" in name for name in names)
    if max(map(len, names), default=0) > letters and not is_formula:
        wrapped = [textwrap.fill(one, letters, max_lines=2, placeholder=" …") for one in names]
        axes.set_yticks(axes.get_yticks(), wrapped)
    for label, length in (
        (axes.xaxis.label, box.width * width),
        (axes.yaxis.label, box.height * height),
    ):
        letters = max(_LEAST_LETTERS, int(length / _LETTER))
        label.set_text(textwrap.fill(label.get_text(), letters))


def _refill(figure: Figure, legend: Legend, width: float) -> None:
    """Make a legend again, with as many columns as fit."""
    labels = [text.get_text() for text in legend.get_texts()]
    letters = int((width - _HANDLE) / _LETTER)
    labels = [textwrap.fill(label, letters) for label in labels]
    entry = _HANDLE + _LETTER * max(len(line) for label in labels for line in label.split("\n"))
    handles = [handle for handle in legend.legend_handles if handle is not None]
    legend.remove()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=max(1, min(len(labels), int(width / entry))),
        frameon=False,
        fontsize=_TEXT,
        handlelength=1.4,
        columnspacing=1.2,
    )


def _thin_lines(figure: Figure) -> None:
    """Reduce lines and markers to the size of print."""
    from matplotlib.lines import Line2D

    for line in figure.findobj(Line2D):
        line.set_linewidth(_LINES * line.get_linewidth())
        line.set_markersize(_LINES * line.get_markersize())
