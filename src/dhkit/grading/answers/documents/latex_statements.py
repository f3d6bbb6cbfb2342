r"""Statements of LaTeX displays: rows that go on, chains ``V = a = b``, systems, and words between formulas."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.documents.latex_rows import Row, rows_of
from dhkit.grading.answers.documents.statements import (
    SPACE,
    Statement,
    left_hand_name,
    statement_of,
)
from dhkit.grading.answers.tokens import word_set

_EQUAL = re.compile(
    r":=|=:|=(?!=)|\\(?:equiv|approx|coloneqq|triangleq|doteq|simeq|cong|eqqcolon|colonequals)(?![A-Za-z])"
    r"|\\(?:stackrel|overset)\{[^{}]*\}\{=\}"
)
_OTHER_RELATIONS = re.compile(
    r"\\(?:neq|ne|leq|le|geq|ge|ll|gg|in|subset|propto|sim|to|rightarrow|mapsto|succ|prec|perp|mid|pm|mp)(?![A-Za-z])"
    r"|[<>]"
)
"""Other relations, and signs with two values: a statement with one outside all brackets is not graded."""
_TWO_VALUED = re.compile(r"\\(?:pm|mp)(?![A-Za-z])")
_CONNECTIVES = re.compile(
    r"\\(?:Rightarrow|implies|iff|Leftrightarrow|therefore|Longrightarrow|because|land|wedge|and)(?![A-Za-z])"
)
"""Logical signs between two statements: implication, equivalence, therefore, because, and."""
_WORDS = re.compile(
    r"\\(?:text|textrm|mbox|textit|textbf|intertext|shortintertext|textnormal)\s*\{((?:[^{}]|\{[^{}]*\})*)\}"
)
_DROPPED = re.compile(
    r"\\(?:label|tag\*?|ref|eqref|cite|vspace\*?|hspace\*?|phantom|vphantom|hphantom|color|textcolor)\s*\{[^{}]*\}"
    r"|\\(?:nonumber|notag|IEEEnonumber|IEEEyesnumber|yesnumber|displaystyle|textstyle|allowbreak|centering|noindent|hfill|smallskip|medskip|bigskip)(?![A-Za-z])"
)
"""Macros that say nothing about a formula."""

_LEADING = re.compile(rf"(?:{SPACE}|\\therefore(?![A-Za-z])|[,;]|\.(?!\d))")
"""Text in front of a formula that is not a part of it."""

_TRAILING = (
    *(
        "\\,",
        "\\;",
        "\\:",
        "\\!",
        "\\>",
        "\\ ",
        "\\quad",
        "\\qquad",
        "\\enspace",
        "\\thinspace",
        "\\space",
    ),
    *("\\therefore", "{}", " ", "\t", "\n", "~", ",", ";", "."),
)
"""Text after a formula that is not a part of it."""

STARTS = re.compile(
    rf"(?:{SPACE}|\\left\.)*(?:[-+/*)\]^_']|\\(?:cdot|times|div|right|over|rVert|pm|mp|ast)(?![A-Za-z])"
    rf"|\\bigr|\\Bigr|\\biggr|\\Biggr|{_EQUAL.pattern})"
)
"""Beginning of a row that continues the formula of the row before."""

STARTS_WITH_RELATION = re.compile(rf"(?:{SPACE}|\\left\.)*(?:{_EQUAL.pattern})")
_ENDS = re.compile(
    rf"(?:[-+/*=(\[]|\\(?:cdot|times|div|equiv|approx|coloneqq|pm)){SPACE}*(?:\\right\.{SPACE}*)?$"
)
"""End of a row whose formula the next row continues."""

_BRACKET = re.compile(
    r"\\begin\s*\{(?P<begin>\w+)\*?\}|\\end\s*\{(?P<end>\w+)\*?\}"
    r"|\\(?P<side>left|right)(?![A-Za-z])\s*(?:\\?.)?|\\[{}]|\\.|[(){}\[\]]",
    re.DOTALL,
)
_OPENING = ("(", "[", "{", r"\{")
_CLOSING = (")", "]", "}", r"\}")

_SYMMETRIC = re.compile(
    r"\\(?:text|textrm|mbox|mathrm|textit)\s*\{\s*(?:[Ss]ymm?\.?|[Ss]ymmetric|SYM\.?)\s*\}"
)
_UNIT = re.compile(r"(?:[/ .*]*+(?>kg|mm|cm|Nm|rad|deg|[msNJWg])(?:\^?-?\d)?+)++", re.ASCII)
"""A unit such as kg m^2 or N m/rad. Groups are atomic: "mm" reads two ways, and all of them take exponential time."""
_PROSE_WORDS = word_set("and or for if as so let we now is at on in by of to the not all are")

_DOUBTFUL = re.compile(
    r"if|iff|when|whenever|unless|otherwise|else|provided|assuming|assume|except|only|not|near|at|small|large"
    r"|plus|minus|times|divided|over|multiplied|squared|cubed|square|cube|root|twice|thrice|half|double"
    r"|negative|without|add|added|subtract|subtracted|reduced|increased|sine?|cosine?|cos"
    r"|one|two|three|four|five|six|seven|eight|nine|ten|third|quarter|wrong|incorrect|false|modulo|mod|pi|theta",
    re.IGNORECASE,
)
"""Words that may change the meaning of a formula in front of them."""

_PROSE = re.compile(r"(?:[A-Za-z~\s.,:;()'`?!]|\\[ ,]|(?<=[A-Za-z])-(?=[A-Za-z]))*", re.ASCII)


def latex_statements(text: str, line: int) -> Iterator[Statement]:
    """Yield the statements of one display; a row that continues the formula of the row before is joined to it.

    Parameters
    ----------
    text
        The inside of a display, environments included, without comments.
    line
        Line number of the display's first line in the document, from 1.
    """
    held: list[Row] = []
    # Finished statements of the current row of the display; they are yielded together, since a later row may make them
    # ambiguous.
    row_statements: list[Statement] = []
    problem = ""
    depth = 0
    is_new_row = True
    for row in rows_of(text, line):
        is_new_row = is_new_row or row.is_first
        plain = re.sub(r"\s+", " ", _without_words(row.text))
        if not _bare(plain):
            continue
        row = replace(row, text=plain)
        goes_on = bool(held) and _goes_on(held[-1].text, depth, row)
        if goes_on and _is_ambiguous(row):
            problem = "a row that begins with a sign and has an = of its own"
        if goes_on and held[0].column > row.column:
            problem = "a row that may go on with either of two equations"
            row_statements = [
                replace(statement, problem=statement.problem or problem)
                for statement in row_statements
            ]
        if held and not goes_on:
            is_aside = _ends_statement(held[-1].text) and bool(_places(plain, _OTHER_RELATIONS))
            if not has_relation(plain) and not is_aside:
                problem = problem or "a row that neither begins with an operator nor has an ="
            else:
                statements = _statements_of_rows(held, problem)
                if is_new_row:
                    yield from row_statements
                    yield from statements
                    row_statements = []
                else:
                    row_statements += statements
                held = []
                problem = ""
                depth = 0
        held.append(row)
        depth += sum(map(_nesting, _BRACKET.finditer(plain)))
        is_new_row = False
    if held:
        yield from row_statements
        yield from _statements_of_rows(held, problem)


# Words


def _without_words(text: str) -> str:
    """Take labels and words away; words between formulas separate them."""
    text = _DROPPED.sub(" ", text)
    if _WORDS.search(text) is None:
        return text
    outside = {start for start, _ in _places(text, _WORDS)}

    def separator(match: re.Match[str]) -> str:
        is_outside = match.start() in outside
        is_kept = _is_part(match, text) or (
            _is_doubtful(match, text) if is_outside else _SYMMETRIC.match(match[0])
        )
        return match[0] if is_kept else r" \quad\therefore "

    return _WORDS.sub(separator, text)


def _is_part(match: re.Match[str], text: str) -> bool:
    """Whether words are part of a formula: a name, or a unit after a number."""
    inside = match[1].strip()
    if re.fullmatch(r"[A-Za-z]{1,3}\d*", inside, re.ASCII):
        return inside.lower() not in _PROSE_WORDS
    is_behind_number = re.search(
        r"\d(?:[~\s]|\\[,;: ])*$", text[max(0, match.start() - 20) : match.start()]
    )
    return _UNIT.fullmatch(inside) is not None and is_behind_number is not None


def _is_doubtful(match: re.Match[str], text: str) -> bool:
    """Whether text may be more than words between formulas: signs, numbers, formulas, conditions."""
    inside = match[1]
    if "$" in inside or "\\(" in inside:
        return True
    if "intertext" in match[0][:20]:
        return False
    words = re.findall("[A-Za-z]+", inside)
    if _PROSE.fullmatch(inside) is None or any(_DOUBTFUL.fullmatch(word) for word in words):
        return True
    return bool(words) and words[-1].lower() in ("for", "as") and _is_condition(text[match.end() :])


def _is_condition(text: str) -> bool:
    """Whether a text begins with a condition, q_1 > 0, rather than with an equation."""
    text = re.split(r"\\therefore|\\text|,", text, maxsplit=1)[0]
    return not has_relation(text) and bool(_places(text, _OTHER_RELATIONS))


# Rows


def _bare(text: str) -> str:
    """Return text without the spaces and punctuation at its ends."""
    start = 0
    end = len(text)
    while match := _LEADING.match(text, start, end):
        start = match.end()
    while end > start:
        mark = next((mark for mark in _TRAILING if text.endswith(mark, start, end)), "")
        is_delimiter = mark in (",", ";", ".") and text.endswith(
            ("\\left.", "\\right."), start, end
        )
        if not mark or is_delimiter:
            break
        end -= len(mark)
    return text[start:end]


def _goes_on(last: str, depth: int, row: Row) -> bool:
    """Whether a row continues the formula of the row before, ``last``, at whose end ``depth`` brackets are open."""
    # Text, or an empty cell of a later pair of columns, before the &.
    has_own_left_side = re.search(r"[A-Za-z\d]", row.before) is not None or row.before.isspace()
    if STARTS_WITH_RELATION.match(row.text):
        return True
    if STARTS.match(row.text) and not (has_own_left_side and has_relation(row.text)):
        return True
    return depth > 0 or _ENDS.search(last[-BOUNDS.row_ending_characters :]) is not None


def _is_ambiguous(row: Row) -> bool:
    """Whether a row may go on or be a statement of its own: - b = c."""
    return (
        STARTS.match(row.text) is not None
        and not STARTS_WITH_RELATION.match(row.text)
        and not row.is_after_mark
        and (not row.before or re.search(r"[A-Za-z\d]", row.before) is not None)
        and has_relation(row.text)
    )


def _ends_statement(text: str) -> bool:
    return (
        re.search(rf"(?:[,;.]|\\therefore){SPACE}*$", text[-BOUNDS.row_ending_characters :])
        is not None
    )


def _nesting(bracket: re.Match[str]) -> int:
    """Return by how much a bracket changes the depth of brackets and environments: 1, -1 or 0."""
    if bracket["begin"] or bracket["side"] == "left" or bracket[0] in _OPENING:
        return 1
    return -bool(bracket["end"] or bracket["side"] == "right" or bracket[0] in _CLOSING)


def _places(text: str, pattern: re.Pattern[str]) -> list[tuple[int, int]]:
    """Return where a pattern matches outside all brackets and environments."""
    if pattern.search(text) is None:
        return []
    depth = 0
    places: list[tuple[int, int]] = []
    brackets = _BRACKET.finditer(text)
    bracket = next(brackets, None)
    for match in pattern.finditer(text):
        while bracket is not None and bracket.start() < match.start():
            depth += _nesting(bracket)
            bracket = next(brackets, None)
        if depth == 0:
            places.append(match.span())
    return places


def has_relation(text: str) -> bool:
    r"""Whether a sign of equality (=, :=, \equiv, \approx ...) stands outside all brackets of a text."""
    return bool(_places(text, _EQUAL))


# Statements


def _statements_of_rows(rows: Sequence[Row], problem: str) -> list[Statement]:
    """Return the statements of rows that belong together: separated by words, arrows, and commas between equations."""
    line = rows[0].line
    text = re.sub(r"\s+", " ", " ".join(row.text for row in rows))
    statements: list[Statement] = []
    words = "words or an arrow next to a part of a formula that is not an equation: "
    refused = 0  # number of statements already refused because a part that is not an equation follows them
    alone = ""  # the part before a connective if it is not an equation: the next statement is refused because of it
    for part in _split(text, _places(text, _CONNECTIVES)):
        bare_part = _bare(part)
        if not bare_part:
            continue
        is_whole = has_relation(part) and not STARTS_WITH_RELATION.match(bare_part)
        if not is_whole and statements and not _places(part, _OTHER_RELATIONS):
            why = words + bare_part[:60]
            statements[refused:] = [
                replace(s, problem=s.problem or why) for s in statements[refused:]
            ]
            refused = len(statements)
        own = problem or (words + alone if alone else "")
        equations = [_bare(piece) for piece in _equations(part)]
        statements += [_statement(equation, line, own) for equation in equations if equation]
        alone = "" if is_whole else bare_part[:60]
    return statements


def _equations(text: str) -> list[str]:
    """Return the equations that commas or semicolons separate; other pieces stay with the equation before them."""
    first, *parts = _split(text, _places(text, re.compile(r"(?<!\\)[,;]")))
    equations = [first]
    for part in parts:
        if (
            has_relation(part)
            and has_relation(equations[-1])
            and not STARTS_WITH_RELATION.match(part)
        ):
            equations.append(part)
        elif _bare(part):
            equations[-1] += "," + part
    return equations


def _split(text: str, places: Sequence[tuple[int, int]]) -> list[str]:
    starts = [0, *(end for _, end in places)]
    ends = [*(start for start, _ in places), len(text)]
    return [text[start:end] for start, end in zip(starts, ends, strict=True)]


def _statement(text: str, line: int, problem: str) -> Statement:
    sides = [_bare(side) for side in _split(text, _places(text, _EQUAL))]
    doubtful = [
        match[0]
        for match in _WORDS.finditer(text)
        if _is_doubtful(match, text) and not _is_part(match, text)
    ]
    if not problem and sum(map(_nesting, _BRACKET.finditer(text))) != 0:
        problem = "brackets that do not close"
    if not problem and doubtful:
        problem = f"text that may change what is stated: {doubtful[0][:60]}"
    if len(sides) > 1 and not problem and (signs := _places(text, _TWO_VALUED)):
        problem = f"a sign {text[slice(*signs[0])]}, which stands for two values"
    if len(sides) > 1 and not problem and _places(text, _OTHER_RELATIONS):
        problem = "another relation than ="
    if len(sides) > 1 and not problem and not all(sides):
        problem = "an = with nothing on one side"
    return statement_of(line, sides, [left_hand_name(side) for side in sides], problem, text)
