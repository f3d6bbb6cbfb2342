"""Documents as typst.

Plain texts become string literals of typst's code (``#"..."``), in which nothing but a quote and a backslash has a
meaning: no text of others is read as markup.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest

from dhkit.report.document.tree import (
    Block,
    Code,
    Document,
    Figure,
    Formulas,
    Heading,
    Inline,
    Items,
    Paragraph,
    Prompt,
    References,
    Table,
)
from dhkit.symbolic.equations.typst import Math

PAGES_LABEL = "dhkit-pages"
"""Label of the number of pages, which a query reads."""
_MOST_WHOLE_ROWS = 24
"""Largest number of rows of a table that stands on one page."""
_PREAMBLE = """\
#set page(paper: "a4", margin: 25mm, numbering: "1")
#set text(font: ("New Computer Modern", "Libertinus Serif"), size: 12pt, lang: "en")
#set par(leading: LEADING, spacing: SPACING, justify: true)
#set heading(numbering: "1.1")
#show heading: it => block(above: 1.4em, below: 0.9em, sticky: true, {
  set par(justify: false, leading: 0.65em)
  set text(size: if it.level == 1 { 15pt } else { 12.5pt })
  it
})
#set math.mat(row-gap: 0.5em, column-gap: 0.8em)
#show math.equation: set block(breakable: true, above: 0.9em, below: 0.9em)
#show figure: set block(breakable: true, above: 1.4em, below: 1.4em)
#set figure(gap: 0.8em)
#show figure.caption: set text(size: 10pt)
#show figure.caption: set par(leading: 0.6em, justify: false)
#show figure.where(kind: table): set figure.caption(position: top)
// An equation that is wider than the line is made smaller, so that nothing is cut off.
#let fitted(body) = context {
  let share = 160mm / measure(body).width * 100%
  if share < 100% { align(center, scale(x: share, y: share, reflow: true, body)) } else { body }
}
#let prompt(body) = block(
  width: 100%, inset: (left: 8pt), stroke: (left: 1.5pt + luma(190)),
  text(style: "italic", fill: luma(90), body),
)
#let listing(body) = block(width: 100%, {
  set par(leading: 0.42em, justify: false)
  set text(size: 7.6pt)
  body
})
#let tabular(size, body) = {
  set par(leading: 0.55em, justify: false)
  set text(size: size, hyphenate: false)
  body
}
"""


def typst_text(document: Document) -> tuple[str, Mapping[str, bytes]]:
    """Return a document as typst, and the files that it shows, by name.

    Examples
    --------
    >>> text, files = typst_text(Document("A #title", (Paragraph("a $ sign"),)))
    >>> print(text.splitlines()[-3])
    #"a $ sign"
    """
    leading = "0.82em" if document.is_wide else "0.6em"
    spacing = "1.25em" if document.is_wide else "1em"
    files: dict[str, bytes] = {}
    parts = [
        _PREAMBLE.replace("LEADING", leading).replace("SPACING", spacing),
        f"#set document(title: {literal(document.title)})",
        f"#align(center, {{ set par(justify: false, leading: 0.65em); "
        f"text(size: 18pt, weight: 700, hyphenate: false, {literal(document.title)}) }})",
    ]
    if document.byline:
        byline = f'text(fill: luma(90), style: "italic", {literal(document.byline)})'
        parts.append(f"#align(center, {byline})")
    for block, following in zip_longest(document.blocks, document.blocks[1:]):
        lines = list(_block(block, files))
        if isinstance(block, Paragraph) and isinstance(following, Formulas | Items):
            # The words before a formula stay on its page.
            lines = [f"#block(sticky: true)[{line}]" for line in lines]
        parts += ["", *lines]
    parts += ["", f"#context [#metadata(counter(page).final().first()) <{PAGES_LABEL}>]", ""]
    return "\n".join(parts), files


def literal(text: str) -> str:
    r"""Return a text as a string literal of typst's code; control characters become spaces.

    Examples
    --------
    >>> print(literal('a "b" \\c'))
    "a \"b\" \\c"
    """
    plain = "".join(c if c.isprintable() else " " for c in text)
    escaped = plain.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _block(block: Block, files: dict[str, bytes]) -> Iterator[str]:
    match block:
        case Heading():
            numbering = "" if block.is_numbered else ", numbering: none"
            yield f"#heading(level: {block.level}{numbering}, {literal(block.text)})"
        case Paragraph():
            yield _inline(block.parts)
        case Prompt():
            yield f"#prompt({literal(block.text)})"
        case Items():
            items = ", ".join(f"[{_inline(item)}]" for item in block.items)
            yield f"#list({items})"
        case Formulas():
            yield f"#fitted($ {_rows(block)} $)"
        case Table():
            yield _table(block)
        case Figure():
            yield _figure(block, files)
        case Code():
            if block.title:
                yield f"#block(sticky: true, strong({literal(block.title)}))"
            lines = ", ".join(literal(line) for line in block.text.rstrip("\n").split("\n"))
            yield f'#listing(raw(block: true, ({lines},).join("\\n")))'
        case References():
            entries = ", ".join(f"[#{literal(entry)}]" for entry in block.entries)
            yield f'#enum(numbering: "[1]", {entries})'


def _inline(parts: Sequence[Inline]) -> str:
    """Return texts and formulas in one line of markup."""
    return "".join(
        f"${part.typst}$" if isinstance(part, Math) else f"#{literal(part)}" for part in parts
    )


def _rows(formulas: Formulas) -> str:
    """Return aligned equations; a line that goes on is indented."""
    lines = []
    for row in formulas.rows:
        if row.left is None:
            lines.append(f"& quad quad {row.right.typst}")
        else:
            lines.append(f"{row.left.typst} &= {row.right.typst}")
    return " \\\n  ".join(lines)


def _table_row(cells: Sequence[Inline]) -> str:
    return ", ".join(f"[{_inline((cell,))}]" for cell in cells)


def _table(table: Table) -> str:
    names = {"l": "left", "r": "right"}
    columns = ", ".join(names[table.alignment(k)] for k in range(table.width))
    cells = []
    if table.headings:
        heads = _table_row(table.headings)
        cells.append(f"table.header({heads}), table.hline(stroke: 0.6pt)")
    cells += [_table_row(row) for row in table.rows]
    body = (
        f"table(columns: {table.width}, align: ({columns},), stroke: none, inset: (x: 5pt, y: 3.2pt), "
        "table.hline(stroke: 0.8pt),\n  " + ",\n  ".join(cells) + ",\n  table.hline(stroke: 0.8pt))"
    )
    size = "8pt" if table.is_small else "10pt"
    body = f"tabular({size}, {body})"
    if not table.caption:
        return f"#align(center, {body})"
    figure = f'figure(kind: table, supplement: "Table", caption: {literal(table.caption)}, {body})'
    if len(table.rows) > _MOST_WHOLE_ROWS:
        return f"#{figure}"
    return f"#[#show figure: set block(breakable: false)\n#{figure}]"


def _figure(figure: Figure, files: dict[str, bytes]) -> str:
    cells = []
    for image in figure.images:
        name = f"figure{len(files) + 1}.png"
        files[name] = image.png
        shown = (
            f"image({literal(name)}, width: 100%, alt: {literal(image.title or figure.caption)})"
        )
        title = f", text(size: 9pt, {literal(image.title)})" if image.title else ""
        cells.append(f"stack(spacing: 4pt, {shown}{title})")
    grid = f"grid(columns: (1fr,) * {len(cells)}, column-gutter: 8pt, row-gutter: 8pt, {', '.join(cells)})"
    return (
        f'#figure(kind: image, placement: auto, supplement: "Figure", caption: {literal(figure.caption)}, '
        f"block(width: {100 * figure.width:.0f}%, breakable: false, {grid}))"
    )
