"""Equations on pages of HTML: LaTeX as MathML, and the page around it, without scripts or other files."""

from __future__ import annotations

import re
from html import escape

from dhkit.page_style import PAGE_STYLE, font_style

_EQUATION = re.compile(r"\\begin\{equation\*\}\n(.*)\n\\end\{equation\*\}", re.DOTALL)
_MATRIX = re.compile(
    r"<mo>(\(|&#x00028;)</mo><mtable>(.*?)</mtable><mo>(\)|&#x00029;)</mo>", re.DOTALL
)


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
        f"<title>{escape(title)}</title>\n<style>{font_style()}{PAGE_STYLE}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )
