"""Documents as one page of HTML, with MathML and pictures inside it, without scripts and without the network."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from html import escape

from dhkit.page_style import MATH_STYLE, page
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
from dhkit.symbolic.equations.html import equation_mathml
from dhkit.symbolic.equations.typst import Math

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
"""Content security policy of the page."""
_STYLE = """
body { font: 12pt/1.5 "Latin Modern Roman", "STIX Two Text", "Source Serif 4", "DejaVu Serif", serif; color: #1b1f24;
       background: #fff; max-width: 46rem; margin: 2.5rem auto; padding: 0 1.2rem; overflow-wrap: anywhere; }
h1 { font-size: 1.7rem; text-align: center; line-height: 1.25; } h2 { font-size: 1.3rem; margin: 2rem 0 .5rem; }
h3 { font-size: 1.08rem; margin: 1.4rem 0 .4rem; } .byline { text-align: center; font-style: italic; color: #57606a; }
.prompt { font-style: italic; color: #57606a; border-left: 3px solid #c4ccd4; padding-left: .8rem; margin: .6rem 0; }
.display { overflow-x: auto; overflow-y: hidden; padding: .4rem 0; }
math { font-size: 1em; } math[display="block"] { margin: 0 auto; } mtd { padding: .15em .35em; }
figure { margin: 1.2rem 0; text-align: center; } figure img { max-width: 100%; height: auto; }
.row { display: flex; gap: .8rem; justify-content: center; } .row > div { flex: 1; font-size: .85rem; }
figcaption, caption { font-size: .9rem; color: #3a424c; caption-side: top; text-align: left; padding-bottom: .3rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .8rem auto; font-size: .92rem; line-height: 1.3; }
table.data { border-top: 1.5px solid #1b1f24; border-bottom: 1.5px solid #1b1f24; }
table.data th { border-bottom: 1px solid #1b1f24; font-weight: normal; }
table.data th, table.data td { padding: .2rem .7rem; overflow-wrap: normal; }
table.data.small { font-size: .78rem; } .l { text-align: left; } .r { text-align: right; white-space: nowrap; }
pre { font: .72rem/1.35 "DejaVu Sans Mono", monospace; overflow-x: auto; background: #f6f8fa; padding: .7rem; }
@media print { body { max-width: none; margin: 0; } figure, table.data { break-inside: avoid; }
               pre { white-space: pre-wrap; } }
"""


_TABLE_STYLE = "margin: 0.8em 0; border-collapse: collapse; text-align: left"


def html_text(document: Document) -> str:
    """Return a document as a page of HTML.

    Examples
    --------
    >>> "<h1>a &lt; b</h1>" in html_text(Document("a < b", ()))
    True
    """
    body = [f"<h1>{escape(document.title)}</h1>"]
    if document.byline:
        body.append(f'<p class="byline">{escape(document.byline)}</p>')
    numbers = _Numbers()
    for block in document.blocks:
        body += _block(block, numbers)
    return page(document.title, "\n".join(body), MATH_STYLE + _STYLE, _POLICY)


def html_blocks(blocks: Sequence[Block]) -> str:
    """Return blocks as HTML for a page of somebody else, which has no style sheet for them: tables bring their spacing.

    Examples
    --------
    >>> html_blocks([Paragraph("a < b")])
    '<p>a &lt; b</p>'
    """
    numbers = _Numbers()
    text = "\n".join(line for block in blocks for line in _block(block, numbers))
    return text.replace("<table ", f'<table cellpadding="4" style="{_TABLE_STYLE}" ')


class _Numbers:
    """Counts headings, tables and figures."""

    def __init__(self) -> None:
        self.headings = [0, 0, 0]
        self.tables = 0
        self.figures = 0

    def heading(self, level: int) -> str:
        """Return the number of the next heading of a level, from 1."""
        self.headings[level - 1] += 1
        self.headings[level:] = [0] * (len(self.headings) - level)
        return ".".join(map(str, self.headings[:level]))


def _block(block: Block, numbers: _Numbers) -> Iterator[str]:
    match block:
        case Heading():
            number = f"{numbers.heading(block.level)} " if block.is_numbered else ""
            tag = f"h{block.level + 1}"
            yield f"<{tag}>{number}{escape(block.text)}</{tag}>"
        case Paragraph():
            yield f"<p>{_inline(block.parts)}</p>"
        case Prompt():
            yield f'<p class="prompt">{escape(block.text)}</p>'
        case Items():
            items = "".join(f"<li>{_inline(item)}</li>" for item in block.items)
            yield f"<ul>{items}</ul>"
        case Formulas():
            yield f'<div class="display">{equation_mathml(_aligned(block))}</div>'
        case Table():
            yield _table(block, numbers)
        case Figure():
            yield _figure(block, numbers)
        case Code():
            if block.title:
                yield f"<p><strong>{escape(block.title)}</strong></p>"
            yield f"<pre>{escape(block.text)}</pre>"
        case References():
            items = "".join(f"<li>{escape(entry)}</li>" for entry in block.entries)
            yield f"<ol>{items}</ol>"


def _inline(parts: Sequence[Inline]) -> str:
    shown = []
    for part in parts:
        if isinstance(part, Math):
            mathml = equation_mathml(part.latex)
            shown.append(mathml.replace('display="block"', 'display="inline"'))
        else:
            shown.append(escape(part))
    return "".join(shown)


def _aligned(formulas: Formulas) -> str:
    """Return equations in LaTeX, aligned if there are several."""
    if len(formulas.rows) == 1:
        (row,) = formulas.rows
        return f"{row.left.latex} = {row.right.latex}" if row.left else row.right.latex
    lines = []
    for row in formulas.rows:
        if row.left is None:
            lines.append(rf"&\qquad {row.right.latex}")
        else:
            lines.append(f"{row.left.latex} &= {row.right.latex}")
    body = " \\\\\n".join(lines)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def _table(table: Table, numbers: _Numbers) -> str:
    def line(cells: Sequence[Inline], tag: str) -> str:
        shown = "".join(
            f'<{tag} class="{table.alignment(k)}">{_inline((cell,))}</{tag}>'
            for k, cell in enumerate(cells)
        )
        return f"<tr>{shown}</tr>"

    caption = ""
    if table.caption:
        numbers.tables += 1
        caption = f"<caption>Table {numbers.tables}: {escape(table.caption)}</caption>"
    head = f"<thead>{line(table.headings, 'th')}</thead>" if table.headings else ""
    body = "".join(line(row, "td") for row in table.rows)
    kind = "data small" if table.is_small else "data"
    return f'<div class="wide"><table class="{kind}">{caption}{head}<tbody>{body}</tbody></table></div>'


def _figure(figure: Figure, numbers: _Numbers) -> str:
    numbers.figures += 1
    cells = []
    for image in figure.images:
        data = base64.b64encode(image.png).decode("ascii")
        alt = escape(image.title or figure.caption, quote=True)
        title = f"<br>{escape(image.title)}" if image.title else ""
        cells.append(f'<div><img alt="{alt}" src="data:image/png;base64,{data}">{title}</div>')
    row = f'<div class="row" style="width:{100 * figure.width:.0f}%;margin:auto">{"".join(cells)}</div>'
    caption = f"<figcaption>Figure {numbers.figures}: {escape(figure.caption)}</figcaption>"
    return f"<figure>{row}{caption}</figure>"
