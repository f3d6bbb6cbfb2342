"""Pictures and figures of dhkit as images of a report."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from dhkit.report.document import Figure, Image

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure
    from PIL.Image import Image as Picture

PAGE_WIDTH = 6.3
"""Width of the report's lines, inches."""
_RESOLUTION = 200
"""Resolution of figures on the page, dots per inch."""
_LEGEND_COLUMNS = 5
"""Largest number of names side by side in a legend below a figure."""
_ENLARGED = 1.3
"""Width of a figure over its width on the page: its labels of 9 points are set in 7."""


def image_png(image: Picture) -> bytes:
    """Return a picture as the content of a PNG file."""
    content = io.BytesIO()
    image.save(content, format="PNG", optimize=True)
    return content.getvalue()


def figure_block(
    figure: MatplotlibFigure, caption: str, *, width: float | None = None, most: float = 4.4
) -> Figure:
    """Return a figure as a block of a document.

    Parameters
    ----------
    figure, width
        As for :func:`figure_png`.
    caption
        Plain text.
    most
        Largest height on the page, inches: a higher figure is made narrower.
    """
    own_width, own_height = figure.get_size_inches()
    height = PAGE_WIDTH * float(own_height) / float(own_width)
    return Figure((Image(figure_png(figure, width=width)),), caption, min(1.0, most / height))


def figure_png(
    figure: MatplotlibFigure, *, width: float | None = None, height: float | None = None
) -> bytes:
    """Return a figure as the content of a PNG file.

    Parameters
    ----------
    figure
        The figure.
    width
        Width that it is drawn with, inches; that of the page, enlarged, if not given.
    height
        Height that it is drawn with, inches; as its own shape asks for if not given.
    """
    _wrap_legends(figure)
    own_width, own_height = figure.get_size_inches()
    width = width or _ENLARGED * PAGE_WIDTH
    figure.set_size_inches(width, height or float(own_height) * width / float(own_width))
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=_RESOLUTION * PAGE_WIDTH / width)
    return content.getvalue()


def _wrap_legends(figure: MatplotlibFigure) -> None:
    """Set legends below a figure in rows that fit the page."""
    for legend in list(figure.legends):
        handles: Any = legend.legend_handles
        labels = [text.get_text() for text in legend.get_texts()]
        if len(labels) <= _LEGEND_COLUMNS:
            continue
        legend.remove()
        figure.legend(
            handles,
            labels,
            loc="outside lower center",
            ncols=_LEGEND_COLUMNS,
            frameon=False,
            fontsize=9,
            handlelength=1.6,
        )
