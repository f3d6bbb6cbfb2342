"""The parts of a document: blocks one after another, whose texts are plain and whose formulas have two notations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from dhkit.symbolic.equations.typst import Math, Row

Inline: TypeAlias = str | Math
"""A piece of a line: plain text, or a formula."""


@dataclass(frozen=True)
class Heading:
    """A heading.

    Attributes
    ----------
    text
        Plain text.
    level
        1 for a section, 2 for a part of one.
    is_numbered
        Whether it has a number.
    """

    text: str
    level: int = 1
    is_numbered: bool = True


@dataclass(frozen=True)
class Paragraph:
    """A paragraph of texts and formulas.

    Examples
    --------
    >>> Paragraph("a ", Math("b", "b")).parts[0]
    'a '
    """

    parts: tuple[Inline, ...]

    def __init__(self, *parts: Inline) -> None:
        object.__setattr__(self, "parts", parts)


@dataclass(frozen=True)
class Prompt:
    """A place that its reader fills: what belongs there, in a sentence of plain text."""

    text: str


@dataclass(frozen=True)
class Items:
    """A list of paragraphs of one line each."""

    items: tuple[tuple[Inline, ...], ...]


@dataclass(frozen=True)
class Formulas:
    """Displayed equations, aligned at their equals signs; a row is a line."""

    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    headings
        Headings of the columns; empty without them.
    rows
        Cells, a row after another.
    caption
        Plain text; empty without a caption, and then without a number.
    align
        A letter for each column, ``l`` or ``r``; the last one applies to all that follow.
    is_small
        Whether it is set in small type, for wide tables.
    """

    headings: tuple[Inline, ...]
    rows: tuple[tuple[Inline, ...], ...]
    caption: str = ""
    align: str = "l"
    is_small: bool = False

    def alignment(self, column: int) -> str:
        """Return the letter of a column, counted from 0."""
        return self.align[min(column, len(self.align) - 1)]

    @property
    def width(self) -> int:
        """The number of columns."""
        return max(len(self.headings), *(len(row) for row in self.rows), 1)


@dataclass(frozen=True)
class Image:
    """A picture.

    Attributes
    ----------
    png
        Content of a PNG file.
    title
        Plain text that stands below it, and for it where it is not shown.
    """

    png: bytes
    title: str = ""


@dataclass(frozen=True)
class Figure:
    """Pictures side by side with one caption.

    Attributes
    ----------
    images
        The pictures, from left to right.
    caption
        Plain text.
    width
        Width of all of them together, as a share of the line.
    """

    images: tuple[Image, ...]
    caption: str
    width: float = 1.0


@dataclass(frozen=True)
class Code:
    """Lines of a program."""

    text: str
    title: str = ""


@dataclass(frozen=True)
class References:
    """Sources, which are numbered from 1; each is a line of plain text."""

    entries: tuple[str, ...]


Block: TypeAlias = (
    Heading | Paragraph | Prompt | Items | Formulas | Table | Figure | Code | References
)


@dataclass(frozen=True)
class Document:
    """A document.

    Attributes
    ----------
    title
        Plain text.
    blocks
        Its parts in order.
    byline
        What stands below the title: sentences for the author to replace.
    is_wide
        Whether lines are set 1.5 apart, as an article for correction; else single.
    """

    title: str
    blocks: tuple[Block, ...]
    byline: str = ""
    is_wide: bool = True
