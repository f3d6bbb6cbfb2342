"""What the command prints: rich tables for people, JSON for machines."""

from __future__ import annotations

import io
import json
import os
import shutil
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from dhkit.description import write_atomically
from dhkit.description.files import check_place
from dhkit.errors import DescriptionError

PIPE_WIDTH = 200
"""Columns where the output is no terminal: tables then do not break."""


class ReaderGone(Exception):  # noqa: N818 - no error: whoever read had enough
    """The output goes to a pipe that nobody reads any more."""


class _Output(Console):
    def on_broken_pipe(self) -> None:
        raise _gone()


def _gone() -> ReaderGone:
    """Return what ends the command; what is written from now on goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return ReaderGone()


def console() -> Console:
    """Return a console on today's stdout, as wide as the terminal."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else PIPE_WIDTH
    return _Output(width=width, highlight=False, soft_wrap=True)


def say(text: str, style: str = "") -> None:
    """Print a line of plain text: brackets in it are no markup."""
    console().print(Text(text, style=style))


def print_json(value: Any, indent: int | None = None) -> None:
    """Print a value as one JSON document; NaN and infinities are null."""
    plain = "utf" not in (sys.stdout.encoding or "").lower()  # a letter that is replaced would be another text
    try:
        sys.stdout.write(json.dumps(finite(value), ensure_ascii=plain, allow_nan=False, indent=indent) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        raise _gone() from None


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]], title: str | None = None) -> None:
    """Print a table, numbers to the right."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 2, 0, 0))
    listed = [list(row) for row in rows]
    for k, heading in enumerate(headings):
        numeric = bool(listed) and all(_is_number(row[k]) for row in listed)
        table.add_column(Text(heading), justify="right" if numeric else "left", overflow="fold")
    for row in listed:
        table.add_row(*(Text(cell) for cell in row))
    console().print(table)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def finite(value: Any) -> Any:
    """Return a value as JSON has it: NaN and infinities are null."""
    if isinstance(value, float):
        return value if value == value and abs(value) != float("inf") else None
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    return value


FIGURES = (".png", ".svg", ".pdf")
PAGES = (".html", ".htm")
RESOLUTION = 120
"""Dots an inch."""


def check_outputs(outputs: Iterable[tuple[Path | None, Sequence[str]]]) -> None:
    """Refuse what could not be written.

    Parameters
    ----------
    outputs
        Paths, and the suffixes that each may have; None for what is not asked for.

    Raises
    ------
    DescriptionError
        Another suffix, or a place that cannot be written to.
    """
    for path, expected in outputs:
        if path is None:
            continue
        if path.suffix.lower() not in expected:
            raise DescriptionError(f"{path}: ends in {path.suffix!r}; expected {', '.join(expected)}")
        check_place(path)


def write_figure(figure: Any, path: Path) -> Path:
    """Write a figure of matplotlib in the format of the path's suffix, whole or not at all, and return the path."""
    picture = io.BytesIO()
    figure.savefig(picture, format=path.suffix[1:].lower(), dpi=RESOLUTION)
    write_atomically(path, picture.getvalue())
    return path
