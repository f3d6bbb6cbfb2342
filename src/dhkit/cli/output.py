"""Output of the command: rich tables for people, JSON for machines, and files."""

from __future__ import annotations

import io
import json
import os
import shutil
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from rich.console import Console
from rich.table import Table
from rich.text import Text

from dhkit.cli.streams import UNSAFE, styled, visible
from dhkit.description import write_atomically
from dhkit.description.files import check_place
from dhkit.errors import DescriptionError

if TYPE_CHECKING:
    from dhkit.arm import Arm
    from dhkit.control import SimulationResult
    from dhkit.planning.obstacles import Scene
    from dhkit.trajectories import Trajectory

PIPE_WIDTH = 200
"""Width of the output where it is not a terminal, columns: tables then do not break."""
FIGURES = (".png", ".svg", ".pdf")
PAGES = (".html", ".htm")
RESOLUTION = 120
"""Resolution of a figure, dots per inch."""


class Figure(Protocol):
    """A figure of matplotlib, which only the viewer imports."""

    def savefig(self, fname: io.BytesIO, *, format: str, dpi: int) -> object:
        """Write the figure."""


class ReaderGone(Exception):  # noqa: N818 - no error: the reader had enough
    """The reader of the pipe that the output goes to has closed it."""


class _Output(Console):
    def on_broken_pipe(self) -> None:
        raise _reader_gone()


def _reader_gone() -> ReaderGone:
    """Return the exception that ends the command, and discard everything that is written from now on."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return ReaderGone()


def console() -> Console:
    """Return a console on the present stdout, as wide as the terminal."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else PIPE_WIDTH
    return _Output(file=styled(sys.stdout), width=width, highlight=False, soft_wrap=True)


def say(text: str, style: str = "") -> None:
    """Print a line of plain text, in which brackets are not markup."""
    console().print(Text(visible(text), style=style))


def say_written(files: Iterable[object]) -> None:
    """Print the paths of written files, a line each."""
    say("\n".join(f"wrote {file}" for file in files))


def report_files(files: Iterable[object], *, json: bool) -> None:
    """Print the paths of written files, as JSON or a line each."""
    if json:
        print_json({"files": [str(file) for file in files]})
    else:
        say_written(files)


def print_json(value: object, indent: int | None = None) -> None:
    """Print a value as one JSON document, in which NaN and infinity are null."""
    # A letter that is replaced would be another text.
    plain = "utf" not in (sys.stdout.encoding or "").lower()
    try:
        text = json.dumps(finite(value), ensure_ascii=plain, allow_nan=False, indent=indent)
        # Unsafe characters stand in strings alone, where JSON has escapes for them.
        sys.stdout.write(UNSAFE.sub(lambda match: f"\\u{ord(match[0]):04x}", text) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        raise _reader_gone() from None


def print_table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], title: str | None = None
) -> None:
    """Print a table, with columns of numbers aligned to the right."""
    table = Table(
        title=None if title is None else visible(title),
        title_justify="left",
        box=None,
        pad_edge=False,
        padding=(0, 2, 0, 0),
    )
    cells = [list(row) for row in rows]
    for k, heading in enumerate(headings):
        numeric = bool(cells) and all(_is_number(row[k]) for row in cells)
        table.add_column(
            Text(visible(heading)), justify="right" if numeric else "left", overflow="fold"
        )
    for row in cells:
        table.add_row(*(Text(visible(cell)) for cell in row))
    console().print(table)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def finite(value: object) -> object:
    """Return a value for JSON, in which NaN and infinity are null."""
    if isinstance(value, float):
        return value if value == value and abs(value) != float("inf") else None
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    return value


def check_outputs(outputs: Iterable[tuple[Path | None, Sequence[str]]]) -> None:
    """Refuse files that could not be written.

    Parameters
    ----------
    outputs
        Paths, and the suffixes that each may have; None for a file that is not asked for.

    Raises
    ------
    DescriptionError
        A path has another suffix, or its place cannot be written to.
    """
    for path, expected in outputs:
        if path is None:
            continue
        if path.suffix.lower() not in expected:
            raise DescriptionError(
                f"{path}: ends in {path.suffix!r}; expected {', '.join(expected)}"
            )
        check_place(path)


def write_figure(figure: Figure, path: Path) -> Path:
    """Write a figure in the format of the path's suffix, whole or not at all, and return the path."""
    content = io.BytesIO()
    figure.savefig(content, format=path.suffix[1:].lower(), dpi=RESOLUTION)
    write_atomically(path, content.getvalue())
    return path


def output_folder(output: Path | None, name: str) -> Path:
    """Return the folder that a command writes into: ``output``, or ``out/NAME``.

    Raises
    ------
    DescriptionError
        It is a file.
    """
    folder = output or Path("out") / name
    if folder.exists() and not folder.is_dir():
        raise DescriptionError(f"{folder}: not a folder")
    return folder


@dataclass(frozen=True)
class MotionFiles:
    """Files of a motion or a simulation that a command writes; None for those that are not asked for.

    Attributes
    ----------
    data
        The motion or the simulation itself.
    page
        A page that plays it.
    figure
        A figure of it.
    """

    data: Path | None
    page: Path | None
    figure: Path | None

    def check(self, suffixes: Sequence[str]) -> None:
        """Refuse files that could not be written, before anybody waits for them.

        Raises
        ------
        DescriptionError
            A path has another suffix, or its place cannot be written to.
        """
        check_outputs(((self.data, suffixes), (self.page, PAGES), (self.figure, FIGURES)))

    def write(
        self,
        arm: Arm,
        motion: Trajectory | SimulationResult,
        name: str,
        caption: str,
        obstacles: Scene | None = None,
    ) -> list[str]:
        """Write the files of a motion, and return their paths; the name and the caption are those on the page."""
        written = [] if self.data is None else [motion.save(self.data)]
        if self.page is not None:
            with arm.view() as view:
                if obstacles is not None:
                    view.obstacles(obstacles)
                view.play(motion)
                written.append(
                    view.save_html(
                        self.page, interactive=True, motions={name: motion}, caption=caption
                    )
                )
        if self.figure is not None:
            from dhkit.viewer import plot

            written.append(write_figure(plot(motion), self.figure))
        return [str(path) for path in written]
