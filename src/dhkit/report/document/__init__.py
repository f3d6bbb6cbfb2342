"""Documents as values, and their printing as typst (and PDF), LaTeX and HTML.

A document is a tree of blocks: headings, paragraphs, formulas, tables, figures, code. Texts in it are plain: each
printer escapes them, so that names and file names of others are shown as they are typed and do nothing else.
"""

from dhkit.report.document.html import html_blocks, html_text
from dhkit.report.document.latex import latex_text
from dhkit.report.document.pdf import Pdf, pdf
from dhkit.report.document.tree import (
    Block,
    Code,
    Document,
    Figure,
    Formulas,
    Heading,
    Image,
    Inline,
    Items,
    Paragraph,
    Prompt,
    References,
    Table,
)
from dhkit.report.document.typst import typst_text

__all__ = [
    "Block",
    "Code",
    "Document",
    "Figure",
    "Formulas",
    "Heading",
    "Image",
    "Inline",
    "Items",
    "Paragraph",
    "Pdf",
    "Prompt",
    "References",
    "Table",
    "html_blocks",
    "html_text",
    "latex_text",
    "pdf",
    "typst_text",
]
