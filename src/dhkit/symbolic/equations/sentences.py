r"""Formulas in sentences of derivations: px, theta2, abs(d3) - sqrt(px^2 + py^2), for LaTeX, typst and MathML.

Sentences are written once, as plain text; printers of mathematics take its names apart from its words.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from dhkit.symbolic.equations.typst import Math

_NAME = r"(?:theta\d+|(?:theta|q|A)_(?:[in]|\d+)|phi|[pwnoa][xyz]|r\d\d|[adq]\d|[sc]\d+)"
_FACTOR = rf"(?:(?:abs|sqrt)\([^()]*\)|\b{_NAME}\b(?:\^2)?)"
_FORMULA = re.compile(rf"{_FACTOR}(?: [-+=] (?:{_FACTOR}|\d+(?:\.\d+)?\b))*")
"""Names, absolute values and roots, with signs between them."""
_CALL = re.compile(r"((?:abs|sqrt)\([^()]*\))")
_SUBSCRIPT = re.compile(r"\b(theta|phi|[a-zA-Z])_?(\d+|[xyzin])?\b")
_LATEX = {"theta": r"\theta", "phi": r"\varphi"}


def sentence_parts(text: str) -> Iterator[str | Math]:
    r"""Yield the words and the formulas of a sentence in their order.

    Examples
    --------
    >>> from dhkit.symbolic.equations.sentences import sentence_parts
    >>> words, formula, end = sentence_parts("It is abs(d3) - sqrt(px^2 + py^2).")
    >>> words, formula.latex, end
    ('It is ', '\\left| d_{3} \\right| - \\sqrt{p_{x}^2 + p_{y}^2}', '.')
    """
    at = 0
    for match in _FORMULA.finditer(text):
        if match.start() > at:
            yield text[at : match.start()]
        yield _formula(match[0])
        at = match.end()
    if at < len(text):
        yield text[at:]


def _formula(text: str) -> Math:
    """Return a formula of a sentence in both notations: with bars, roots and subscripts."""
    latex = ""
    typst = ""
    for part in _CALL.split(text):
        function, is_call, argument = part.partition("(")
        inner = argument.removesuffix(")") if is_call else part
        in_latex = _SUBSCRIPT.sub(_latex_name, inner)
        in_typst = _SUBSCRIPT.sub(_typst_name, inner)
        if not is_call:
            latex += in_latex
            typst += in_typst
        elif function == "abs":
            latex += rf"\left| {in_latex} \right|"
            typst += f"abs({in_typst})"
        else:
            latex += rf"\sqrt{{{in_latex}}}"
            typst += f"sqrt({in_typst})"
    return Math(latex, typst)


def _latex_name(match: re.Match[str]) -> str:
    letter = _LATEX.get(match[1], match[1])
    return f"{letter}_{{{match[2]}}}" if match[2] else letter


def _typst_name(match: re.Match[str]) -> str:
    return f"{match[1]}_({match[2]})" if match[2] else match[1]
