"""Reprs of values: one line at a prompt, a small table in a notebook.

Texts may come from files and users: all are reduced to one line of printable characters, shortened and escaped here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from html import escape
from typing import Any

LONGEST_LINE = 120
"""Largest length of a repr, characters."""
_SHORTEST_NAME = 40
"""Length that a name keeps in a repr in any case, characters."""
MOST_ROWS = 12
"""Largest number of rows of a table in a notebook."""
_LONGEST_CELL = 80
"""Largest length of a cell of a table, characters."""
_MOST_LINES = 6
"""Largest number of lines below a table."""
_LONGEST_TEXT = 200
"""Largest length of a heading and of a line below a table, characters."""
_ALIGNMENTS = {"l": "left", "r": "right"}


def plain(text: str, most: int) -> str:
    """Return text as one line of printable characters: without escapes, control characters and marks of direction.

    Examples
    --------
    >>> plain(" much   room ", 20), plain("0123456789", 5)
    ('much room', '0123…')
    """
    line = " ".join(text[: 2 * most].split())
    line = "".join(character if character.isprintable() else "?" for character in line)
    return line if len(line) <= most and len(text) <= 2 * most else f"{line[: most - 1]}…"


def listed(values: Iterable[float]) -> str:
    """Return numbers as text with four digits.

    Examples
    --------
    >>> listed([0.25, 1 / 3])
    '[0.25, 0.3333]'
    """
    return "[" + ", ".join(f"{float(x):.4g}" for x in values) + "]"


def counted(count: float, noun: str) -> str:
    """Return a count with its noun, such as ``1 pose``, ``2 branches`` and ``2.5 points``."""
    number = str(int(count)) if float(count).is_integer() else f"{count:.4g}"
    if count == 1:
        return f"{number} {noun}"
    ending = "es" if noun.endswith(("ch", "sh")) else "s"
    return f"{number} {noun}{ending}"


def repr_line(kind: str, name: str = "", summary: str = "") -> str:
    """Return ``<kind of name: summary>`` in 120 characters; a long name is shortened first.

    Examples
    --------
    >>> repr_line("Samples", "puma560", "500 from 0 to 2 s")
    '<Samples of puma560: 500 from 0 to 2 s>'
    """
    room = LONGEST_LINE - len(f"<{kind} of : {summary}>")
    of = f" of {plain(name, max(room, _SHORTEST_NAME))}" if name else ""
    return f"<{plain(kind + of + (f': {summary}' if summary else ''), LONGEST_LINE - 2)}>"


def value_line(value: Any) -> str:
    """Return a dataclass as its constructor is written, in 120 characters; arrays as lists.

    If the line is too long, numbers are rounded to four digits and lists are shortened.
    """
    for number, most in (repr, LONGEST_LINE), (_rounded, LONGEST_LINE), (_rounded, 3):
        named = (
            f"{item.name}={_written(getattr(value, item.name), number, most)}"
            for item in fields(value)
        )
        line = f"{type(value).__qualname__}({', '.join(named)})"
        if len(line) <= LONGEST_LINE and line.isprintable():
            return line
    return plain(line, LONGEST_LINE)


def html_table(
    headings: Sequence[str],
    rows: Sequence[Sequence[str]],
    caption: str = "",
    align: str = "l",
    *,
    count: int | None = None,
    most: int = MOST_ROWS,
    longest: int = _LONGEST_CELL,
) -> str:
    """Return a table of texts as HTML, without colours, so that it suits light and dark pages.

    Parameters
    ----------
    headings
        Headings of the columns; empty for a table without headings.
    rows
        Cells of the rows; a line below the first ``most`` rows gives the number of the others.
    caption
        Caption of the table.
    align
        A letter for each column, ``l`` or ``r``, as in LaTeX; the last one applies to all that follow.
    count
        Number of all rows, if ``rows`` has only the first.
    most, longest
        Largest number of rows, and largest length of a cell.

    Examples
    --------
    >>> html_table((), [("a < b", "1")], align="lr")[7:]
    '<tbody><tr><td style="text-align:left">a &lt; b</td><td style="text-align:right">1</td></tr></tbody></table>'
    """

    def line(cells: Sequence[str], tag: str) -> str:
        shown = (
            f'<{tag} style="text-align:{_ALIGNMENTS[align[min(k, len(align) - 1)]]}">{_escaped(cell, longest)}</{tag}>'
            for k, cell in enumerate(cells)
        )
        return f"<tr>{''.join(shown)}</tr>"

    body = [line(row, "td") for row in rows[:most]]
    hidden = (len(rows) if count is None else count) - len(body)
    if hidden > 0:
        width = max(len(headings), max(map(len, rows), default=1))
        body.append(
            f'<tr><td colspan="{width}" style="text-align:left">… and {hidden} more</td></tr>'
        )
    head = f"<thead>{line(headings, 'th')}</thead>" if headings else ""
    title = (
        f'<caption style="text-align:left">{_escaped(caption, _LONGEST_TEXT)}</caption>'
        if caption
        else ""
    )
    return f"<table>{title}{head}<tbody>{''.join(body)}</tbody></table>"


def html_lines(lines: Sequence[str]) -> str:
    """Return texts as an HTML list; empty without texts."""
    shown = [_escaped(line, _LONGEST_TEXT) for line in lines[:_MOST_LINES]]
    if len(lines) > _MOST_LINES:
        shown.append(f"… and {len(lines) - _MOST_LINES} more")
    return f"<ul>{''.join(f'<li>{line}</li>' for line in shown)}</ul>" if shown else ""


def html_block(heading: str, *parts: str) -> str:
    """Return HTML parts below a heading, which MathJax does not change, so that LaTeX is shown as source."""
    head = f"<b>{_escaped(heading, _LONGEST_TEXT)}</b>"
    return f'<div class="mathjax_ignore tex2jax_ignore">{head}{"".join(parts)}</div>'


def _escaped(text: str, most: int) -> str:
    return escape(plain(text, most), quote=False)


def _rounded(number: float) -> str:
    return f"{number:.4g}"


def _written(value: Any, number: Callable[[float], str], most: int) -> str:
    """Return a field's value as text, with at most ``most`` entries of arrays and sequences."""
    if hasattr(value, "tolist"):
        value = (value[: most + 1] if value.ndim else value).tolist()
    if isinstance(value, float):
        return number(value)
    if isinstance(value, list | tuple):
        entries = [_written(x, number, most) for x in value[:most]] + ["…"] * (len(value) > most)
        inside = ", ".join(entries)
        return f"[{inside}]" if isinstance(value, list) else f"({inside}{',' * (len(value) == 1)})"
    return repr(value)
