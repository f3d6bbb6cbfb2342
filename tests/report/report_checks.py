"""Checks of documents that several tests share: LaTeX by a parser of its own, HTML by the standard library's."""

from __future__ import annotations

import re
from html.parser import HTMLParser

VOID = {"meta", "br", "img", "hr", "link", "input"}


def without_verbatim(text: str) -> str:
    """Return LaTeX without its programs."""
    return re.sub(r"\\begin\{verbatim\}\n.*?\n\\end\{verbatim\}", "", text, flags=re.DOTALL)


def check_latex(text: str) -> list[str]:
    """Check braces, dollar signs and environments of a document, and return its environments in order.

    Verbatim text is left out, as LaTeX leaves it.
    """
    body = without_verbatim(text)
    assert body.count(r"\end{document}") == 1 and body.endswith("\\end{document}\n")
    assert not re.search(r"[^\x00-\x7fÀ-ÖØ-öø-ž]", body), "a sign that pdflatex does not know"
    found = []
    stack: list[str] = []
    depth = 0
    is_math = False
    for token in re.findall(r"\\begin\{\w+\*?\}|\\end\{\w+\*?\}|\\.|[{}$]", body, re.DOTALL):
        environment = re.fullmatch(r"\\(begin|end)\{(\w+\*?)\}", token)
        if environment and environment[1] == "begin":
            stack.append(environment[2])
            found.append(environment[2])
        elif environment:
            assert stack and stack.pop() == environment[2], token
        elif token == "{":
            depth += 1
        elif token == "}":
            depth -= 1
            assert depth >= 0, "a closing brace too many"
        elif token == "$":
            is_math = not is_math
    assert not stack and depth == 0 and not is_math
    return found


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        assert not any(name.startswith("on") for name, _ in attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag, tag

    def handle_data(self, data):
        self.texts.append(data)


def check_html(text: str) -> tuple[list[str], str]:
    """Check that all elements of a page end where they should, and return its tags and its text."""
    page = _Page()
    page.feed(text)
    page.close()
    assert not page.open
    assert "script" not in page.tags and "merror" not in page.tags
    return page.tags, " ".join(page.texts)
