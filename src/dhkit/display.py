"""How values show themselves as a prompt's or a notebook cell's last expression: in one line, and as a small table.

Texts come from files and from people: all of them are made one line of printable characters, cut and escaped here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from html import escape
from typing import Any

LONGEST_LINE = 120
"""Characters of a repr."""
SHORTEST_NAME = 40
"""Characters that a name keeps in a repr, however much there is to say."""
MOST_ROWS = 12
"""Rows of a table in a notebook."""
LONGEST_CELL = 80
"""Characters of a table's cell."""
MOST_LINES = 6
"""Lines below a table."""
LONGEST_TEXT = 200
"""Characters of a heading, and of a line below a table."""
ALIGNMENTS = {"l": "left", "r": "right"}


def plain(text: str, most: int) -> str:
    """Return text as one line of printable characters: no escapes, no controls, nothing that turns its direction.

    Examples
    --------
    >>> plain(" much   room ", 20), plain("0123456789", 5)
    ('much room', '0123…')
    """
    line = " ".join(text[: 2 * most].split())
    line = "".join(character if character.isprintable() else "?" for character in line)
    return line if len(line) <= most and len(text) <= 2 * most else f"{line[: most - 1]}…"


def listed(values: Iterable[Any]) -> str:
    """Return numbers as a person reads them, four digits.

    Examples
    --------
    >>> listed([0.25, 1 / 3])
    '[0.25, 0.3333]'
    """
    return "[" + ", ".join(f"{float(x):.4g}" for x in values) + "]"


def counted(count: float, noun: str) -> str:
    """Return how many there are, such as ``1 pose``, ``2 branches`` and ``2.5 points``."""
    number = str(int(count)) if float(count).is_integer() else f"{count:.4g}"
    return f"{number} {noun}" if count == 1 else f"{number} {noun}{'es' if noun.endswith(('ch', 'sh')) else 's'}"


def repr_line(kind: str, of: str = "", said: str = "") -> str:
    """Return ``<kind of name: what is said>`` in 120 characters; a long name is cut before what is said.

    Examples
    --------
    >>> repr_line("Samples", "puma560", "500 from 0 to 2 s")
    '<Samples of puma560: 500 from 0 to 2 s>'
    """
    room = LONGEST_LINE - len(f"<{kind} of : {said}>")
    name = f" of {plain(of, max(room, SHORTEST_NAME))}" if of else ""
    return f"<{plain(kind + name + (f': {said}' if said else ''), LONGEST_LINE - 2)}>"


def value_line(value: Any) -> str:
    """Return a dataclass as its constructor is written, in 120 characters; arrays as lists.

    Numbers are rounded to four digits where the line is too long otherwise, and of long lists the beginning is left.
    """
    for number, most in (repr, LONGEST_LINE), (_rounded, LONGEST_LINE), (_rounded, 3):
        named = (f"{item.name}={_written(getattr(value, item.name), number, most)}" for item in fields(value))
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
    longest: int = LONGEST_CELL,
) -> str:
    """Return a table of texts as HTML, without colours, so that it suits light and dark pages.

    Parameters
    ----------
    headings
        Of the columns; none for a table without.
    rows
        Their cells; below the first ``most`` rows it says how many more there are.
    caption
        What the table is.
    align
        A letter a column, ``l`` or ``r``, as in LaTeX; the last one counts for all that follow.
    count
        How many rows there are, where ``rows`` are only the first.
    most, longest
        Rows that are shown, and characters of a cell.

    Examples
    --------
    >>> html_table((), [("a < b", "1")], align="lr")[7:]
    '<tbody><tr><td style="text-align:left">a &lt; b</td><td style="text-align:right">1</td></tr></tbody></table>'
    """

    def line(cells: Sequence[str], tag: str) -> str:
        shown = (
            f'<{tag} style="text-align:{ALIGNMENTS[align[min(k, len(align) - 1)]]}">{_escaped(cell, longest)}</{tag}>'
            for k, cell in enumerate(cells)
        )
        return f"<tr>{''.join(shown)}</tr>"

    body = [line(row, "td") for row in rows[:most]]
    hidden = (len(rows) if count is None else count) - len(body)
    if hidden > 0:
        width = max(len(headings), max(map(len, rows), default=1))
        body.append(f'<tr><td colspan="{width}" style="text-align:left">… and {hidden} more</td></tr>')
    head = f"<thead>{line(headings, 'th')}</thead>" if headings else ""
    title = f'<caption style="text-align:left">{_escaped(caption, LONGEST_TEXT)}</caption>' if caption else ""
    return f"<table>{title}{head}<tbody>{''.join(body)}</tbody></table>"


def html_lines(lines: Sequence[str]) -> str:
    """Return texts as a list, nothing where there are none."""
    shown = [_escaped(line, LONGEST_TEXT) for line in lines[:MOST_LINES]]
    if len(lines) > MOST_LINES:
        shown.append(f"… and {len(lines) - MOST_LINES} more")
    return f"<ul>{''.join(f'<li>{line}</li>' for line in shown)}</ul>" if shown else ""


def html_block(heading: str, *parts: str) -> str:
    """Return a heading above what is HTML already; MathJax leaves it alone, so that LaTeX is seen as it was written."""
    head = f"<b>{_escaped(heading, LONGEST_TEXT)}</b>"
    return f'<div class="mathjax_ignore tex2jax_ignore">{head}{"".join(parts)}</div>'


def _escaped(text: str, most: int) -> str:
    return escape(plain(text, most), quote=False)


def _rounded(number: float) -> str:
    return f"{number:.4g}"


def _written(value: Any, number: Callable[[float], str], most: int) -> str:
    """Return a field's value, of arrays and sequences at most so many entries."""
    if hasattr(value, "tolist"):
        value = (value[: most + 1] if value.ndim else value).tolist()
    if isinstance(value, float):
        return number(value)
    if isinstance(value, list | tuple):
        entries = [_written(x, number, most) for x in value[:most]] + ["…"] * (len(value) > most)
        inside = ", ".join(entries)
        return f"[{inside}]" if isinstance(value, list) else f"({inside}{',' * (len(value) == 1)})"
    return repr(value)
