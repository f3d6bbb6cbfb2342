"""`dhkit docs`: serve the built documentation on this machine, since its search needs a server."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Annotated

import typer

import dhkit
from dhkit.cli.browser import until_interrupted
from dhkit.cli.exit_status import ExitStatus
from dhkit.errors import DescriptionError

HOST = "127.0.0.1"
BUILT = Path("out") / "docs"
"""Folder that `make docs` builds, in the folder of the sources."""

app = typer.Typer(rich_markup_mode=None)


class QuietHandler(SimpleHTTPRequestHandler):
    """Serves files of a folder; lists no folders and logs no requests."""

    def list_directory(self, path: object) -> None:
        """Answer that there is no page."""
        self.send_error(404)

    def log_message(self, format: str, *arguments: object) -> None:
        """Log nothing."""


@contextmanager
def served(folder: Path, port: int = 0) -> Iterator[str]:
    """Serve a folder on 127.0.0.1 while the context lasts, and yield the address.

    Parameters
    ----------
    folder
        Folder with ``index.html``.
    port
        Port; a free one for 0.

    Raises
    ------
    OSError
        The port is in use.
    """
    server = ThreadingHTTPServer((HOST, port), partial(QuietHandler, directory=str(folder)))
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://{HOST}:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()


def built_folder(folder: Path | None) -> Path:
    """Return the folder with the built site: the one given, else out/docs here or beside the sources.

    Raises
    ------
    DescriptionError
        It has no ``index.html``.
    """
    sources = Path(dhkit.__file__).resolve().parents[2]
    places = [folder] if folder is not None else [BUILT, sources / BUILT]
    for place in places:
        if (place / "index.html").is_file():
            return place
    raise DescriptionError(
        f"{places[0]}: has no index.html; expected the folder that `make docs` builds"
    )


@app.command()
def docs(
    folder: Annotated[
        Path | None, typer.Argument(help="Folder of the built site; out/docs unless given.")
    ] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the address; a free one for 0.")
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address, and open no browser.")
    ] = False,
) -> ExitStatus:
    """Serve the documentation that `make docs` has built, on this machine alone; Ctrl-C ends it."""
    with served(built_folder(folder), port) as url:
        return until_interrupted(url, "the documentation", open_browser=not no_browser)
