"""Equations on pages of HTML: LaTeX as MathML, and the page around it, without scripts or other files."""

from __future__ import annotations

import re

from dhkit.page_style import PAGE_STYLE, font_style, page

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
    """Return a page of formulas, with the font for them, around a body of HTML."""
    return page(title, body, font_style() + PAGE_STYLE)
