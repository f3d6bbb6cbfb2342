"""A page of LaTeX around equations."""

from __future__ import annotations

import re

_PREAMBLE = r"""\documentclass[11pt]{article}
\usepackage{amsmath}
\allowdisplaybreaks
\setcounter{MaxMatrixCols}{40}
\begin{document}
"""


def latex_document(equations: str, title: str) -> str:
    """Return a page of LaTeX that shows equations.

    Parameters
    ----------
    equations
        Displayed equations, as :func:`equations_latex` returns them.
    title
        Plain text.
    """
    return f"{_PREAMBLE}\\section*{{{escaped(title)}}}\n{equations}\\end{{document}}\n"


def escaped(text: str) -> str:
    """Return plain text for LaTeX, printable ASCII alone."""
    spelled = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    spelled |= {x: f"\\{x}" for x in "&%$#_{}"}
    printable = re.sub(r"[^ -~]", "?", text)
    return "".join(spelled.get(x, x) for x in printable)
