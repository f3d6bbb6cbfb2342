"""LaTeX of students' answers as MathML, in which nothing but mathematics is kept."""

from __future__ import annotations

import html
import re
from xml.etree.ElementTree import Element, SubElement, fromstring, tostring

from dhkit.grading.bounds import BOUNDS

_NAMESPACE = re.compile(r"\{.*?\}")
_ELEMENTS = re.compile(
    "math|mrow|mi|mn|mo|mtext|mspace|mfrac|msqrt|mroot|msub|msup|msubsup|munder|mover|munderover|mtable|mtr|mtd|"
    "mstyle|mpadded|mphantom|menclose"
)
_ATTRIBUTES = re.compile(
    "display|stretchy|fence|separator|lspace|rspace|width|height|linethickness|mathvariant|minsize|maxsize|form|"
    "columnalign|rowspacing|columnspacing"
)
_VALUE = re.compile(r"[A-Za-z0-9.%+ -]{0,60}")


def mathml(latex: str) -> str | None:
    r"""Return the LaTeX of an answer as displayed MathML; None if it cannot be converted.

    latex2mathml puts text into its result unescaped, and lets ``\href``, ``\class`` and ``\style`` through. Its result
    is therefore parsed, and only known elements with harmless attributes are written again.

    Examples
    --------
    >>> mathml("2")
    '<math display="block"><mrow><mn>2</mn></mrow></math>'
    """
    from latex2mathml.converter import convert

    if (
        not latex.strip()
        or len(latex) > BOUNDS.converted_characters
        or "<" in latex
        or "&lt" in latex
    ):
        return None
    try:
        root = fromstring(convert(latex, display="block"))  # noqa: S314 - no "<" in it: no declarations
        return tostring(_copy_harmless(root, None), encoding="unicode", short_empty_elements=False)
    except Exception:  # latex2mathml raises IndexError and others for text that is not LaTeX
        return None


def _copy_harmless(element: Element, parent: Element | None) -> Element:
    """Return a copy with known elements and attributes alone; an unknown element becomes a row."""
    tag = _NAMESPACE.sub("", str(element.tag))
    tag = tag if _ELEMENTS.fullmatch(tag) else "mrow"
    allowed = {
        key: value
        for key, value in element.attrib.items()
        if _ATTRIBUTES.fullmatch(key) and _VALUE.fullmatch(value)
    }
    copy = Element(tag, allowed) if parent is None else SubElement(parent, tag, allowed)
    copy.text = html.unescape(element.text or "")
    for child in element:
        _copy_harmless(child, copy)
    return copy
