"""LaTeX of an answer as MathML of which nothing is left but mathematics."""

from __future__ import annotations

import html
import re
from xml.etree.ElementTree import Element, ParseError, SubElement, fromstring, tostring

MOST = 4000
"""Characters of LaTeX that are set: a longer equation nobody reads, and converting it takes seconds."""
NAMESPACE = re.compile(r"\{.*?\}")
ELEMENTS = re.compile(
    "math|mrow|mi|mn|mo|mtext|mspace|mfrac|msqrt|mroot|msub|msup|msubsup|munder|mover|munderover|mtable|mtr|mtd|"
    "mstyle|mpadded|mphantom|menclose"
)
ATTRIBUTES = re.compile(
    "display|stretchy|fence|separator|lspace|rspace|width|height|linethickness|mathvariant|minsize|maxsize|form|"
    "columnalign|rowspacing|columnspacing"
)
VALUE = re.compile(r"[A-Za-z0-9.%+ -]{0,60}")


def mathml(latex: str) -> str | None:
    r"""Return displayed LaTeX as MathML; None where it cannot be converted.

    latex2mathml puts text into its result unescaped, and lets ``\href``, ``\class`` and ``\style`` through; so its
    result is parsed, and only known elements with harmless attributes are written anew.

    Examples
    --------
    >>> mathml("2")
    '<math display="block"><mrow><mn>2</mn></mrow></math>'
    """
    from latex2mathml.converter import convert

    if not latex.strip() or len(latex) > MOST or "<" in latex or "&lt" in latex:
        return None
    try:
        found = fromstring(convert(latex, display="block"))  # noqa: S314 - no "<" in it: no declarations
        return tostring(_harmless(found, None), encoding="unicode", short_empty_elements=False)
    except (ParseError, RecursionError):
        return None
    except Exception:  # latex2mathml raises IndexError and others of text that is no LaTeX
        return None


def _harmless(found: Element, parent: Element | None) -> Element:
    """Return a copy with known elements and attributes alone; an unknown element becomes a row."""
    tag = NAMESPACE.sub("", str(found.tag))
    tag = tag if ELEMENTS.fullmatch(tag) else "mrow"
    allowed = {
        key: value for key, value in found.attrib.items() if ATTRIBUTES.fullmatch(key) and VALUE.fullmatch(value)
    }
    made = Element(tag, allowed) if parent is None else SubElement(parent, tag, allowed)
    made.text = html.unescape(found.text or "")
    for child in found:
        _harmless(child, made)
    return made
