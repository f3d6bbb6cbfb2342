"""Equations on pages of HTML: LaTeX as MathML, and the page around it, without scripts or other files."""

from __future__ import annotations

import re
from html import escape

_EQUATION = re.compile(r"\\begin\{equation\*\}\n(.*)\n\\end\{equation\*\}", re.DOTALL)
_MATRIX = re.compile(
    r"<mo>(\(|&#x00028;)</mo><mtable>(.*?)</mtable><mo>(\)|&#x00029;)</mo>", re.DOTALL
)
_STYLE = """
body { font: 16px/1.5 "Source Sans 3", "Noto Sans", "DejaVu Sans", sans-serif; color: #1b1f24; background: #fff;
       max-width: 66rem; margin: 2.5rem auto; padding: 0 1.5rem; }
h1 { font-size: 1.7rem; margin-bottom: .2rem; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .4rem; }
.source, .note { color: #57606a; margin: .2rem 0; }
.display { overflow-x: auto; overflow-y: hidden; padding: .5rem 0; }
math { font-size: 1.08rem; font-family: "STIX Two Math", "Latin Modern Math", "Cambria Math", math; }
math[display="block"] { width: fit-content; margin: 0; } .display { padding-left: 1.2rem; }
mtd { padding: .18em .45em; } mtable[columnspacing] mtd { padding: .25em 0; }
mtd[columnalign="left"] { text-align: left; } mtd[columnalign="right"] { text-align: right; }
/* Brackets of matrices as borders: without a font for mathematics a browser cannot stretch them. */
mo.bracket { display: none; }
mtable.matrix { border: solid currentColor; border-width: 0 1.5px; border-radius: .9em / 50%;
                padding: .2em .5em; margin-left: .35em; }
table { border-collapse: collapse; margin: .8rem 0; } caption { text-align: left; color: #57606a; }
th, td { text-align: left; padding: .25rem 1.1rem .25rem 0; border-bottom: 1px solid #d8dee4; font-weight: normal; }
th { color: #57606a; } td.number { text-align: right; font-variant-numeric: tabular-nums; }
"""


def equation_mathml(latex: str) -> str:
    """Return a displayed equation that dhkit printed as MathML, brackets of matrices marked for a style sheet.

    Not for LaTeX of strangers: latex2mathml passes on text and links as they are; see :func:`mathml`.
    """
    from latex2mathml.converter import convert

    display = _EQUATION.fullmatch(latex)
    converted: str = convert(display[1] if display else latex, display="block")
    return _MATRIX.sub(
        r'<mo class="bracket">\1</mo><mtable class="matrix">\2</mtable><mo class="bracket">\3</mo>',
        converted,
    )


def html_page(title: str, body: str) -> str:
    """Return a page with a title around a body of HTML."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )
