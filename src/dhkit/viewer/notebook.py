"""Views and figures in a notebook.

A view is its page in a frame that reaches nothing else; Python moves it where anywidget is installed. Figures that are
made without pyplot do not show themselves; those of :func:`new_figure` do.
"""

from __future__ import annotations

import html
import io
from functools import cache
from importlib import resources
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from dhkit.packages import imported

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RESOLUTION = 100
"""Resolution of a figure in a notebook, dots per inch."""
_STYLE = "width: 100%; height: 560px; border: 0; border-radius: 8px"
_NOTE = (
    "A copy of the state when this cell ran. With the package anywidget "
    "(<code>pip install anywidget</code>) <code>view.show(q)</code> moves it."
)


def framed_page(page: str, title: str) -> str:
    """Return a page as an element of another page: a frame with scripts, without storage, address or network."""
    source = html.escape(page)
    name = html.escape(title)
    frame = f'<iframe sandbox="allow-scripts" srcdoc="{source}" title="{name}" style="{_STYLE}"></iframe>'
    return f'{frame}<p style="margin: 2px 0; opacity: 0.7; font-size: 90%">{_NOTE}</p>'


def notebook_widget(page: str, title: str) -> Any:
    """Return a widget that shows a page in a notebook and relays messages to it; None without anywidget."""
    widget_class = _widget_class()
    return None if widget_class is None else widget_class(page=page, title=title)


@cache
def _widget_class() -> Any:
    """Return the class of widgets; its package is imported here, since that takes a second."""
    if find_spec("anywidget") is None:
        return None
    import anywidget
    import traitlets

    class NotebookView(anywidget.AnyWidget):
        """A page in a frame. Messages: ``{"q": [...]}``, or one of :mod:`dhkit.viewer.protocol` as a buffer."""

        _esm = (resources.files("dhkit.viewer") / "static" / "notebook.js").read_text("utf-8")
        page = traitlets.Unicode().tag(sync=True)
        title = traitlets.Unicode().tag(sync=True)
        style = traitlets.Unicode(_STYLE).tag(sync=True)

    return NotebookView


def new_figure(**options: Any) -> Figure:
    """Return an empty ``matplotlib.figure.Figure``, with its options, that Jupyter shows as a picture."""
    return _figure_class()(**options)


@cache
def _figure_class() -> type[Figure]:
    """Return the class of figures; matplotlib is imported here, since that takes 0.3 s."""
    base: type[Figure] = imported("matplotlib.figure", "a figure").Figure

    class NotebookFigure(base):  # type: ignore[valid-type, misc]
        def _repr_png_(self) -> bytes:
            picture = io.BytesIO()
            self.savefig(picture, format="png", dpi=_RESOLUTION)
            return picture.getvalue()

    return NotebookFigure
