r"""LaTeX documents as statements: displays and formulas in the text, with the document's macros put in."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.documents.latex_rows import ROWS
from dhkit.grading.answers.documents.latex_statements import (
    STARTS,
    STARTS_WITH_RELATION,
    has_relation,
    latex_statements,
)
from dhkit.grading.answers.documents.statements import Statement
from dhkit.grading.answers.latex import (
    DOT_MACROS,
    FRACTIONS,
    GREEK,
    SIZES,
    SPACE_NAMES,
    STYLE_MACROS,
    SYMBOL_MACROS,
)
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

_MACRO = re.compile(
    r"\\(?:(?:re)?newcommand|providecommand|DeclareMathOperator|DeclareRobustCommand"
    r"|(?:New|Renew|Declare|Provide)DocumentCommand|DeclareMathSymbol|DeclareMathAccent"
    r"|(?:New|Renew|Declare)CommandCopy)(?![A-Za-z])\*?"
    r"\s*\{?\s*\\([A-Za-z]+)\s*\}?|\\(?:[gex]?def|let|futurelet|mathchardef|chardef)\s*\\([A-Za-z]+)"
)
"""The definition of a macro of letters, up to its name."""

_CHANGES = re.compile(
    r"\\(?:catcode|mathcode|lccode|uccode|csname|endcsname|expandafter|scantokens|lowercase|uppercase|aftergroup)"
    r"(?![A-Za-z])|\\renewenvironment\s*\{(?:"
    + "|".join(sorted(ROWS))
    + r"|[bpvBV]?matrix|smallmatrix|array|document)\*?\}"
    + r"|\\(?:[gex]?def|let|renewcommand|futurelet|mathchardef|chardef)(?![A-Za-z])"
)
"""Commands that may change the meaning of all that follows, and definitions, also of macros that are not letters."""

_READ_MACROS = frozenset(
    {
        *GREEK,
        *FUNCTION_NAMES,
        *FRACTIONS,
        *SYMBOL_MACROS,
        *DOT_MACROS,
        *STYLE_MACROS,
        *SIZES,
        *SPACE_NAMES,
    }
    | {
        "sqrt",
        "over",
        "partial",
        "top",
        "begin",
        "end",
        "label",
        "tag",
        "equiv",
        "approx",
        "pm",
        "mp",
        "mbox",
    }
)
"""Macros that have a meaning, which no document should change."""

_SYMBOL = re.compile(
    r"(?:\\[A-Za-z]+|[A-Za-z])(?:\s*\{\s*\\?[A-Za-z]+(?:_(?:\w|\{\w+\}))?\s*\})?(?:_(?:[A-Za-z0-9]|\{[A-Za-z0-9,]+\}))?",
    re.ASCII,
)
"""One symbol, perhaps with an accent and an index: a macro that stands for it is replaced by it."""

_HIDDEN = re.compile(
    r"\\begin\s*\{(verbatim\*?|comment|lstlisting|minted|filecontents\*?)\}|\\iffalse(?![A-Za-z])"
)

_INNER_ROWS = frozenset(
    ["cases", "dcases", "rcases", "split", "aligned", "gathered", "multlined", "alignedat"]
)
"""Environments that stand inside displays."""

_OPENING = re.compile(
    r"(?<!\\)\$\$?|(?<!\\)\\\[|\\\(|\\begin\{(?P<name>(?:"
    + "|".join(sorted(ROWS - _INNER_ROWS))
    + r")\*?)\}"
)
_CLOSERS = {"$": "$", "$$": "$$", "\\[": "\\]", "\\(": "\\)"}


class _Display(NamedTuple):
    """A display, or a formula in the text."""

    line: int
    """Line in which its inside begins, from 1."""
    inside: str
    is_inline: bool
    """Whether it stands in the text."""


class _Macro(NamedTuple):
    """A macro that a document defines."""

    line: int
    """Line of the definition, from 1."""
    symbol: str | None
    """The one symbol that it stands for; None for any other macro, and for one that is defined twice."""


def document_statements(text: str) -> Iterator[Statement]:
    r"""Yield the statements of a document's mathematics; of text without dollars and displays, of all of it.

    Raises
    ------
    AnswerError
        More statements than are read, or a command that may change the meaning of anything after it.
    """
    for count, statement in enumerate(_statements(text)):
        if count >= BOUNDS.statements:
            raise AnswerError(f"more than {BOUNDS.statements} equations")
        yield statement


def _statements(text: str) -> Iterator[Statement]:
    text = text.replace("\r\n", "\n").replace("\r", "\n").replace("\f", " ")
    text = re.sub(r"(?<!\\)((?:\\\\)*)%[^\n]*", r"\1", text)
    text = _blank(text, _HIDDEN, _end_of_hidden)
    _refuse_changes(text)
    macros = _macros(text)
    preamble, begins, body = text.partition("\\begin{document}")
    if begins:
        text = re.sub(r"[^\n]", "", preamble) + body.partition("\\end{document}")[0]
    text = _blank(text, _MACRO, _end_of_definition)
    # A display is held back until the next one is seen: it may continue an equation that this one began.
    held: Statement | None = None
    for display in _displays(text):
        for k, statement in enumerate(_display_statements(display, macros)):
            if held is not None and k == 0 and _continues(statement, display):
                problem = f"it goes on in another display, in line {display.line}"
                yield replace(held, problem=problem)
                held = None
                continue
            if held is not None:
                yield held
            held = statement
    if held is not None:
        yield held


def _display_statements(display: _Display, macros: Mapping[str, _Macro]) -> list[Statement]:
    """Return a display's statements, with the document's macros put in.

    Statements that use a macro that is not read get that as their problem. A macro that no statement's text shows was
    used between the statements (it may have dropped a row, or a sign between two): then it is the problem of all.
    """
    inside, problems = _expand(display.inside, macros)
    statements = list(latex_statements(inside, display.line))
    whole_text = "\n".join(statement.text for statement in statements)
    between = [why for name, why in problems.items() if f"\\{name}" not in whole_text]
    marked = []
    for statement in statements:
        used = [why for name, why in problems.items() if _uses(statement.text, name)]
        if used:
            marked.append(replace(statement, problem=used[0]))
        elif between:
            marked.append(replace(statement, problem=statement.problem or between[0]))
        else:
            marked.append(statement)
    return marked


def _continues(statement: Statement, display: _Display) -> bool:
    """Whether the first statement of a display continues the equation of the display before: it starts with a sign."""
    if display.is_inline or statement.targets:
        return False
    if STARTS.match(statement.text) is None:
        return False
    is_relation = STARTS_WITH_RELATION.match(statement.text) is not None
    return is_relation or not has_relation(statement.text)


def _blank(text: str, pattern: re.Pattern[str], end_of: Callable[[re.Match[str]], int]) -> str:
    """Return a text with line breaks alone from each match to its end; matches inside another one do not count."""
    pieces: list[str] = []
    at = 0
    for match in pattern.finditer(text):
        if match.start() >= at:
            end = end_of(match)
            pieces += [text[at : match.start()], "\n" * text.count("\n", match.start(), end)]
            at = end
    return "".join([*pieces, text[at:]])


def _end_of_hidden(match: re.Match[str]) -> int:
    """Return where a listing or a comment ends."""
    closer = f"\\end{{{match[1]}}}" if match[1] else "\\fi"
    end = match.string.find(closer, match.end())
    return len(match.string) if end < 0 else end + len(closer)


def _end_of_definition(match: re.Match[str]) -> int:
    """Return where the body of a macro ends: it is not a statement."""
    text = match.string
    end = match.end()
    if body := re.compile(r"(?:\s*\[[^\]\n]*\]|#\d|\s)*\{").match(text, end):
        depth = 1
        end = body.end()
        while depth and end < len(text):
            depth += (text[end] == "{") - (text[end] == "}")
            end += 1
    return end


def _displays(text: str) -> Iterator[_Display]:
    """Yield displays and formulas in the text; paragraphs where there are none."""
    line = 1
    counted = 0
    at = 0
    has_math = False
    absent: set[str] = set()
    while match := _OPENING.search(text, at):
        name = match["name"]
        closer = f"\\end{{{name}}}" if name else _CLOSERS[match[0]]
        end = -1 if closer in absent else text.find(closer, match.end())
        while match[0] in ("$", "$$") and end > 0 and text[end - 1] == "\\":
            end = text.find(closer, end + 1)
        if end < 0:
            absent.add(closer)
            at = match.end()
            continue
        has_math = True
        inside = text[match.end() : end]
        line += text.count("\n", counted, match.end())
        counted = match.end()
        environment = name.rstrip("*") if name else ""
        if environment in ("alignat", "xalignat", "IEEEeqnarray"):
            inside = re.sub(r"\A\s*(?:\[[^\]\n]*\])?\s*\{[^{}]*\}", "", inside)
        if environment in ("eqnarray", "IEEEeqnarray"):
            inside = rf"\begin{{eqnarray}}{inside}\end{{eqnarray}}"
        yield _Display(line, inside, match[0] in ("$", "\\("))
        at = end + len(closer)
    if has_math:
        return
    line = 1
    for paragraph in re.split(r"(\n[ \t]*\n)", text):
        yield _Display(line, paragraph, False)
        line += paragraph.count("\n")


# Macros


def _refuse_changes(text: str) -> None:
    """Refuse what may change the meaning of signs, or of macros whose names are not read.

    Raises
    ------
    AnswerError
        Such a command, with its line.
    """
    definitions = {match.start() for match in _MACRO.finditer(text)}
    for match in _CHANGES.finditer(text):
        if match.start() not in definitions:
            line = text.count("\n", 0, match.start()) + 1
            raise AnswerError(
                f"line {line}: {match[0]} may change what formulas mean, and is not read"
            )


def _macros(text: str) -> dict[str, _Macro]:
    """Return the macros that a document defines, by name.

    Raises
    ------
    AnswerError
        More than ``BOUNDS.macros``.
    """
    macros: dict[str, _Macro] = {}
    line = 1
    at = 0
    for match in _MACRO.finditer(text):
        line += text.count("\n", at, match.start())
        at = match.start()
        name = match[1] or match[2]
        body = re.compile(r"\s*\{([^{}]*(?:\{[^{}]*\}[^{}]*)*)\}").match(text, match.end())
        symbol = body[1].strip() if body else ""
        is_command = text.startswith(
            ("\\newcommand", "\\renewcommand", "\\providecommand", "\\def"), match.start()
        )
        is_symbol = _SYMBOL.fullmatch(symbol) is not None and is_command
        # A macro with a meaning may not get another one, but \theta and \vartheta are read as the same letter.
        same_letter = (f"\\var{name}", f"\\{name.removeprefix('var')}")
        if name in _READ_MACROS and symbol not in same_letter:
            is_symbol = False
        if name not in macros and len(macros) == BOUNDS.macros:
            raise AnswerError(f"more than {BOUNDS.macros} macros")
        macros[name] = _Macro(line, symbol if is_symbol and name not in macros else None)
    return macros


def _uses(text: str, macro: str) -> bool:
    return re.search(rf"\\{macro}(?![A-Za-z])", text) is not None


def _expand(text: str, macros: Mapping[str, _Macro]) -> tuple[str, dict[str, str]]:
    """Return a display with macros for one symbol put in, and why those that are used otherwise are not read."""
    problems: dict[str, str] = {}
    for name, (line, symbol) in macros.items():
        if not _uses(text, name):
            continue
        if symbol is None or any(other in macros for other in re.findall(r"\\([A-Za-z]+)", symbol)):
            problems[name] = f"the macro \\{name}, which line {line} defines, is not read"
        else:
            text = re.sub(rf"\\{name}(?![A-Za-z])", f"{{{symbol}}}".replace("\\", r"\\"), text)
    return text, problems
