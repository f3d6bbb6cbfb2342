"""Files that a command writes beside what it prints: checked before anybody waits for them."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from dhkit.description import write_atomically
from dhkit.description.files import check_place
from dhkit.errors import DescriptionError

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
