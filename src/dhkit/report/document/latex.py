"""Documents as LaTeX (pdflatex, with amsmath, graphicx, geometry, setspace and longtable)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

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
from dhkit.symbolic.equations.latex_document import escaped
from dhkit.symbolic.equations.typst import Math

_PREAMBLE = r"""\documentclass[12pt,a4paper]{article}
\usepackage[T1]{fontenc}
\usepackage[utf8]{inputenc}
\usepackage{amsmath,graphicx,longtable,setspace,textcomp}
\usepackage[margin=25mm]{geometry}
\allowdisplaybreaks
\setcounter{MaxMatrixCols}{40}
\setlength{\parindent}{0pt}
\setlength{\parskip}{0.6em}
"""
_SIGNS = {
    "°": r"\textdegree{}",
    "²": r"\textsuperscript{2}",
    "³": r"\textsuperscript{3}",
    "±": r"\textpm{}",
    "µ": r"\textmu{}",
    "·": r"$\cdot$",
    "×": r"$\times$",
    "θ": r"$\theta$",
    "α": r"$\alpha$",
    "π": r"$\pi$",
    "τ": r"$\tau$",
    "−": r"$-$",
    "–": "--",
    "…": r"\ldots{}",
    "₋": r"$_{-}$",
    "φ": r"$\varphi$",
    "≤": r"$\le$",
    "→": r"$\to$",
} | {digit: f"$_{{{k}}}$" for k, digit in enumerate("₀₁₂₃₄₅₆₇₈₉")}
"""LaTeX of signs outside ASCII that dhkit writes."""
_LETTER = re.compile("[À-ÖØ-öø-ž]")
"""Letters that pdflatex knows."""


def latex_text(document: Document, folder: str = "") -> tuple[str, Mapping[str, bytes]]:
    r"""Return a document as LaTeX, and the files that it includes, by name.

    Parameters
    ----------
    document
        The document.
    folder
        Folder of the files beside the document, as the document names it; letters, digits and ``-`` alone.

    Examples
    --------
    >>> text, files = latex_text(Document("50 % of a_b", ()))
    >>> r"50 \% of a\_b" in text, text.endswith("\\end{document}\n")
    (True, True)
    """
    files: dict[str, bytes] = {}
    parts = [_PREAMBLE + r"\begin{document}"]
    parts += [r"\begin{center}", rf"{{\LARGE\bfseries {plain(document.title)}\par}}"]
    if document.byline:
        parts.append(rf"\textit{{{plain(document.byline)}}}\par")
    parts.append(r"\end{center}")
    if document.is_wide:
        parts.append(r"\onehalfspacing")
    for block in document.blocks:
        parts += ["", *_block(block, files, folder)]
    parts += ["", r"\end{document}", ""]
    return "\n".join(parts), files


def plain(text: str) -> str:
    r"""Return a text for LaTeX; signs that pdflatex does not have become question marks.

    Examples
    --------
    >>> plain("90° & Müller\\x"), plain("机")
    ('90\\textdegree{} \\& Müller\\textbackslash{}x', '?')
    """
    return "".join(
        _SIGNS.get(c) or (c if _LETTER.fullmatch(c) else escaped(c))
        for c in text.replace("\n", " ")
    )


def _block(block: Block, files: dict[str, bytes], folder: str) -> Iterator[str]:
    match block:
        case Heading():
            command = ("section", "subsection", "subsubsection")[block.level - 1]
            yield rf"\{command}{'' if block.is_numbered else '*'}{{{plain(block.text)}}}"
        case Paragraph():
            yield _inline(block.parts)
        case Prompt():
            yield rf"\begin{{quote}}\itshape {plain(block.text)}\end{{quote}}"
        case Items():
            items = "\n".join(rf"\item {_inline(item)}" for item in block.items)
            yield f"\\begin{{itemize}}\n{items}\n\\end{{itemize}}"
        case Formulas():
            yield _formulas(block)
        case Table():
            yield _table(block)
        case Figure():
            yield _figure(block, files, folder)
        case Code():
            if block.title:
                yield rf"\textbf{{{plain(block.title)}}}"
            yield _code(block.text)
        case References():
            items = "\n".join(
                rf"\bibitem{{dhkit{k}}} {plain(entry)}" for k, entry in enumerate(block.entries, 1)
            )
            yield (
                "\\begingroup\\renewcommand{\\section}[2]{}\n"
                f"\\begin{{thebibliography}}{{99}}\n{items}\n\\end{{thebibliography}}\n\\endgroup"
            )


def _inline(parts: Sequence[Inline]) -> str:
    return "".join(f"${part.latex}$" if isinstance(part, Math) else plain(part) for part in parts)


def _formulas(formulas: Formulas) -> str:
    lines = []
    for row in formulas.rows:
        if row.left is None:
            lines.append(rf"&\qquad {row.right.latex}")
        else:
            lines.append(f"{row.left.latex} &= {row.right.latex}")
    body = " \\\\\n".join(lines)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def _table(table: Table) -> str:
    columns = "".join(table.alignment(k) for k in range(table.width))
    lines = []
    if table.headings:
        lines += [" & ".join(_inline((cell,)) for cell in table.headings) + r" \\", r"\hline"]
        lines.append(r"\endhead")
    for row in table.rows:
        lines.append(" & ".join(_inline((cell,)) for cell in row) + r" \\")
    caption = rf"\caption{{{plain(table.caption)}}} \\" if table.caption else ""
    size = r"\scriptsize" if table.is_small else r"\small"
    rows = "\n".join(filter(None, [caption, r"\hline", *lines, r"\hline"]))
    return (
        f"\\begingroup{size}\\setlength{{\\tabcolsep}}{{4pt}}\\singlespacing\n"
        f"\\begin{{longtable}}{{{columns}}}\n{rows}\n\\end{{longtable}}\n\\endgroup"
    )


def _figure(figure: Figure, files: dict[str, bytes], folder: str) -> str:
    count = len(figure.images)
    share = 0.97 * figure.width / count
    cells = []
    for image in figure.images:
        name = f"{folder}/figure{len(files) + 1}.png" if folder else f"figure{len(files) + 1}.png"
        files[name] = image.png
        title = rf"\\ \footnotesize {plain(image.title)}" if image.title else ""
        cells.append(
            rf"\begin{{minipage}}[b]{{{share:.3f}\linewidth}}\centering"
            rf"\includegraphics[width=\linewidth]{{{name}}}{title}\end{{minipage}}"
        )
    body = "\\hfill\n".join(cells)
    return f"\\begin{{figure}}[htbp]\\centering\n{body}\n\\caption{{{plain(figure.caption)}}}\n\\end{{figure}}"


def _code(text: str) -> str:
    """Return lines in small type as they are typed; the words that would end them are taken apart."""
    lines = []
    for line in text.rstrip("\n").split("\n"):
        ascii_line = re.sub(r"[^ -~]", "?", line)
        lines.append(ascii_line.replace(r"\end{verbatim}", r"\end {verbatim}"))
    body = "\n".join(lines)
    return f"\\begingroup\\singlespacing\\scriptsize\n\\begin{{verbatim}}\n{body}\n\\end{{verbatim}}\n\\endgroup"
