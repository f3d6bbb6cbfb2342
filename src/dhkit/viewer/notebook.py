"""A view in a notebook: its page in a frame that reaches nothing else, moved by Python where anywidget is installed."""

from __future__ import annotations

import html
from functools import cache
from importlib import resources
from importlib.util import find_spec
from typing import Any

STYLE = "width: 100%; height: 560px; border: 0; border-radius: 8px"
NOTE = (
    "A copy of the state when this cell ran. With the package anywidget "
    "(<code>pip install anywidget</code>) <code>view.show(q)</code> moves it."
)


def framed_page(page: str, title: str) -> str:
    """Return a page as an element of another page: a frame with scripts, without storage, address or network."""
    source, name = html.escape(page), html.escape(title)
    frame = f'<iframe sandbox="allow-scripts" srcdoc="{source}" title="{name}" style="{STYLE}"></iframe>'
    return f'{frame}<p style="margin: 2px 0; opacity: 0.7; font-size: 90%">{NOTE}</p>'


def notebook_widget(page: str, title: str) -> Any:
    """Return what shows a page in a notebook and relays messages to it; None where anywidget is not installed."""
    make = _widget_class()
    return None if make is None else make(page=page, title=title)


@cache
def _widget_class() -> Any:
    """Return the widget's class: its package is not needed elsewhere, and imports a second of others."""
    if find_spec("anywidget") is None:
        return None
    import anywidget
    import traitlets

    class NotebookView(anywidget.AnyWidget):
        """A page in a frame. Messages: ``{"q": [...]}``, or one of :mod:`dhkit.viewer.protocol` as a buffer."""

        _esm = (resources.files("dhkit.viewer") / "static" / "notebook.js").read_text("utf-8")
        page = traitlets.Unicode().tag(sync=True)
        title = traitlets.Unicode().tag(sync=True)
        style = traitlets.Unicode(STYLE).tag(sync=True)

    return NotebookView
