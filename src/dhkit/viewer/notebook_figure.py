"""Figures that show themselves in a notebook, which figures made without pyplot do not."""

from __future__ import annotations

import io
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESOLUTION = 100
"""Dots per inch in a notebook."""


def new_figure(**options: Any) -> Figure:
    """Return an empty ``matplotlib.figure.Figure``, with its options, that Jupyter shows as a picture."""
    return _figure_class()(**options)


@lru_cache(maxsize=1)
def _figure_class() -> type[Figure]:
    """Return the class, made when first needed: matplotlib takes 0.3 s to import."""
    from matplotlib.figure import Figure

    class NotebookFigure(Figure):
        def _repr_png_(self) -> bytes:
            picture = io.BytesIO()
            self.savefig(picture, format="png", dpi=RESOLUTION)
            return picture.getvalue()

    return NotebookFigure
