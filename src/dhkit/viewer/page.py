"""The viewer's page: its files as the server sends them, and the same page as one offline file."""

from __future__ import annotations

import base64
import html
import json
import posixpath
import re
import string
from collections.abc import Mapping, Sequence
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import quote

from dhkit.errors import ModelError

MODULES = (
    "main.js",
    "stage.js",
    "boxes.js",
    "colors.js",
    "player.js",
    "trace.js",
    "outlines.js",
    "overlays.js",
    "obstacles.js",
    "person.js",
    "labels.js",
    "smooth.js",
    "quality.js",
    "readout.js",
    "messages.js",
    "connection.js",
)
"""The page's ES modules; ``main.js`` imports the others."""

_LAB_FILES = (
    "around.js",
    "lab.js",
    "lab.css",
    "card.js",
    "memory.js",
    "dock.js",
    "edge.js",
    "icons.js",
    "panels.js",
    "recording.js",
    "requests.js",
    "dom.js",
    "joints.js",
    "tool.js",
    "redundancy.js",
    "gizmo.js",
    "table.js",
    "motion.js",
    "motion_file.js",
    "curves.js",
    "own.js",
    "control.js",
    "following.js",
    "dynamics.js",
    "workspace.js",
    "transforms.js",
    "answers.js",
    "formula.js",
    "task.js",
    "plot.js",
    "uplot.js",
    "uplot.css",
)
"""Files of the panels, in the folder ``lab``, for pages whose requests Python answers. uPlot is 1.6.32 from npm."""

_OFFLINE_MODULES = (
    "offline/panels.js",
    "offline/desk.js",
    "offline/kinematics.js",
    "offline/expressions.js",
    "offline/solids.js",
    "offline/about.js",
    "offline/recorded.js",
    "lab/lab.js",
    "lab/card.js",
    "lab/memory.js",
    "lab/dock.js",
    "lab/edge.js",
    "lab/icons.js",
    "lab/dom.js",
    "lab/joints.js",
    "lab/tool.js",
    "lab/gizmo.js",
    "lab/table.js",
    "lab/curves.js",
    "lab/plot.js",
)
"""Modules of a page with panels and without Python."""

_IMPORT = re.compile(r'(\bfrom |\bimport\()"(\.\.?/[^"]+)"')
_UNQUOTED = string.punctuation.translate({ord(mark): None for mark in "%#"}) + " "
"""Characters that a ``data:`` address has unquoted: base64 would be a quarter longer."""
_INDENTATION = re.compile(r"(?<=[{};,])\n\s*|^[ \t]+", re.MULTILINE)
"""Line ends after braces, semicolons and commas of a style sheet, and indentation; none of them stands in a string."""
_LINE_ENDS = re.compile(r"^((?:(?!//)[^\n])*[{;,(])\n", re.MULTILINE)
"""Lines of a module without a comment, of which the next can be the continuation."""
_REMOVED = re.compile(r"""^[ \t]*(?://.*)?\n?|[ \t]+// [^"'`\n]*$""", re.MULTILINE)
"""Indentation, empty lines and comments, which offline modules lack; no string has several lines, and what looks like a
comment in a string is followed by a quotation mark."""
_CONTENT_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}

SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src data: blob:; font-src 'self'; connect-src 'self'"
)
"""Policy of the live page: it loads nothing from other hosts. meshcat's bundle writes style elements."""

_OFFLINE_POLICY = "default-src 'none'; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'; img-src data: blob:"


def meshcat_bundle() -> bytes:
    """Return the viewer's JavaScript from the installed meshcat wheel.

    Raises
    ------
    ModelError
        meshcat is not installed, or its viewer is not that of meshcat 0.3.
    """
    spec = find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise ModelError(
            "the viewer needs the package meshcat, which is not installed: pip install meshcat"
        )
    path = Path(spec.origin).parent / "viewer" / "dist" / "main.min.js"
    try:
        bundle = path.read_bytes()
    except OSError as error:
        expected = "meshcat's viewer: pip install --force-reinstall meshcat"
        raise ModelError(f"{path}: {error.strerror}; expected {expected}") from None
    if b"MeshCat" not in bundle or b"handle_command_bytearray" not in bundle:
        raise ModelError(
            f"{path} is not the viewer of meshcat 0.3: pip install --force-reinstall 'meshcat>=0.3.2,<0.4'"
        )
    return bundle


def page_files() -> dict[str, tuple[str, bytes]]:
    """Return the content type and the bytes of the live page's files, by name; the page itself is ``""``.

    Raises
    ------
    ModelError
        As :func:`meshcat_bundle`.
    """
    names = (
        "index.html",
        "viewer.css",
        *MODULES,
        *(f"lab/{name}" for name in _LAB_FILES),
        "offline/kinematics.js",
    )
    files = {
        name: (f"{_CONTENT_TYPES[Path(name).suffix]}; charset=utf-8", _static(name).encode())
        for name in names
    }
    files[""] = files.pop("index.html")
    font = (resources.files("dhkit") / "fonts" / "math.woff2").read_bytes()
    files["lab/math.woff2"] = ("font/woff2", font)
    files["meshcat.js"] = ("text/javascript; charset=utf-8", meshcat_bundle())
    return files


def offline_page(
    messages: Sequence[bytes], title: str, interactive: Mapping[str, object] | None = None
) -> str:
    """Return one HTML file that shows messages without a server; it makes no requests.

    Parameters
    ----------
    messages
        Messages of :mod:`dhkit.viewer.protocol`, in the order a page needs them.
    title
        The page's title.
    interactive
        Data of the panels, as :func:`dhkit.viewer.interactive.interactive_data` returns it; None for a page without
        panels.
    """
    data = [base64.b64encode(message).decode() for message in messages]
    style = _static("viewer.css")
    extra = ""
    modules = list(MODULES)
    if interactive is not None:
        style += _static("lab/lab.css")
        extra = _script(_json(interactive), ' type="application/json" id="offline"')
        if interactive["motions"]:  # the page draws their curves
            style += _static("lab/uplot.css")
            extra += _script(_static("lab/uplot.js"))
        modules += _OFFLINE_MODULES
    return _replace_marks(
        _static("index.html"),
        {
            "<!-- policy -->": f'<meta http-equiv="Content-Security-Policy" content="{_OFFLINE_POLICY}">',
            "<title>dhkit</title>": f"<title>{html.escape(title)}</title>",
            '<link rel="stylesheet" href="viewer.css">': f"<style>\n{_INDENTATION.sub('', style)}</style>",
            '<script src="meshcat.js"></script>': _script(meshcat_bundle().decode()),
            '<script type="module" src="main.js"></script>': _modules(modules),
            "<!-- messages -->": _script(_json(data), ' type="application/json" id="messages"')
            + extra,
        },
    )


def _modules(names: Sequence[str]) -> str:
    """Return modules as an import map of ``data:`` addresses, and ``main.js`` as an inline script."""
    sources = {name: _with_absolute_imports(name, _static(name)) for name in names}
    first = sources.pop("main.js")
    imports = {
        f"dhkit/{name}": f"data:text/javascript,{quote(source, safe=_UNQUOTED)}"
        for name, source in sources.items()
    }
    return _script(json.dumps({"imports": imports}), ' type="importmap"') + _script(
        first, ' type="module"'
    )


def _with_absolute_imports(name: str, source: str) -> str:
    """Return a module whose imports are named as in the import map, without comments, indentation, most line ends."""
    folder = posixpath.dirname(name)

    def absolute(match: re.Match[str]) -> str:
        return f'{match[1]}"dhkit/{posixpath.normpath(posixpath.join(folder, match[2]))}"'

    return _IMPORT.sub(absolute, _LINE_ENDS.sub(r"\1", _REMOVED.sub("", source)))


def _json(data: Any) -> str:
    """Return data as JSON that cannot end or change the script element that it stands in."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _script(content: str, attributes: str = "") -> str:
    inert = content.replace("</script", r"<\/script")
    return f"<script{attributes}>{inert}</script>"


def _replace_marks(text: str, pieces: dict[str, str]) -> str:
    for mark, piece in pieces.items():
        before, after = text.split(mark)
        text = before + piece + after
    return text


def _static(name: str) -> str:
    return (resources.files("dhkit.viewer") / "static" / name).read_text("utf-8")
