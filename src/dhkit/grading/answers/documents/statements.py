r"""Statements of formulas, ``M_{12} = M_{21} = f``, in LaTeX and in plain text: rows that go on, chains, systems."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from dhkit.grading.answers.documents.latex_rows import Row, rows_of
from dhkit.grading.answers.latex import GREEK, is_latex
from dhkit.grading.answers.sheet import ALIASES
from dhkit.grading.answers.vocabulary import plain_name


@dataclass(frozen=True)
class Statement:
    """Names and formulas that are said to be equal.

    Attributes
    ----------
    line
        From 1, where it begins.
    targets
        Names on its sides, without marks of typesetting and without arguments: M12, tau1, g, theta1.
    formulas
        The other sides, in order, as typed.
    problem
        Why it cannot be read; empty where it can.
    text
        The whole, for messages.
    """

    line: int
    targets: tuple[str, ...]
    formulas: tuple[str, ...]
    problem: str = ""
    text: str = ""


def statements_of(text: str, suffix: str = ".tex") -> list[Statement]:
    """Return the statements of an answer's entry, or of lines of ``name = formula``.

    Parameters
    ----------
    text
        LaTeX with or without environments, or plain text as programs and `dhkit equations` write it.
    suffix
        ``.tex`` of LaTeX; of other suffixes, text without a backslash or a brace is plain.

    Returns
    -------
    list
        One without targets where the text is a formula alone.
    """
    if is_latex(text) or (suffix == ".tex" and "&" in text):
        return list(latex_statements(LATEX_COMMENT.sub("", text), 1))
    return list(_plain_statements(text))


LATEX_COMMENT = re.compile(r"(?<!\\)%(?!(?:pi|e|i)(?![A-Za-z0-9_]))[^\n]*")
PLAIN_COMMENT = re.compile(r"#.*|%(?!(?:pi|e|i|gamma|phi)(?![A-Za-z0-9_])).*")
"""Comments of Python, MATLAB and LaTeX; %pi, %e and %i are Maxima's numbers."""


# LaTeX

EQUAL = re.compile(
    r":=|=:|=(?!=)|\\(?:equiv|approx|coloneqq|triangleq|doteq|simeq|cong|eqqcolon|colonequals)(?![A-Za-z])"
    r"|\\(?:stackrel|overset)\{[^{}]*\}\{=\}"
)
OTHER_RELATIONS = re.compile(
    r"\\(?:neq|ne|leq|le|geq|ge|ll|gg|in|subset|propto|sim|to|rightarrow|mapsto|succ|prec|perp|mid|pm|mp)(?![A-Za-z])"
    r"|[<>]"
)
THEREFORE = re.compile(
    r"\\(?:Rightarrow|implies|iff|Leftrightarrow|therefore|Longrightarrow|because|land|wedge|and)(?![A-Za-z])"
)
WORDS = re.compile(
    r"\\(?:text|textrm|mbox|textit|textbf|intertext|shortintertext|textnormal)\s*\{((?:[^{}]|\{[^{}]*\})*)\}"
)
DROPPED = re.compile(
    r"\\(?:label|tag\*?|ref|eqref|cite|vspace\*?|hspace\*?|phantom|vphantom|hphantom|color|textcolor)\s*\{[^{}]*\}"
    r"|\\(?:nonumber|notag|IEEEnonumber|IEEEyesnumber|yesnumber|displaystyle|textstyle|allowbreak|centering|noindent|hfill|smallskip|medskip|bigskip)(?![A-Za-z])"
)
SPACE = r"(?:\s|~|\\[,;:!> ]|\\q?quad(?![A-Za-z])|\\(?:enspace|thinspace|space)(?![A-Za-z])|\{\})"
LEADING = re.compile(rf"(?:{SPACE}|\\therefore(?![A-Za-z])|[,;]|\.(?!\d))")
TRAILING = (
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
        "\\therefore",
    ),
    *("{}", " ", "\t", "\n", "~", ",", ";", "."),
)
"""What stands behind a formula and is no part of it."""
STARTS = re.compile(
    rf"(?:{SPACE}|\\left\.)*(?:[-+/*)\]^_']|\\(?:cdot|times|div|right|over|rVert|pm|mp|ast)(?![A-Za-z])"
    rf"|\\bigr|\\Bigr|\\biggr|\\Biggr|{EQUAL.pattern})"
)
STARTS_WITH_RELATION = re.compile(rf"(?:{SPACE}|\\left\.)*(?:{EQUAL.pattern})")
ENDS = re.compile(rf"(?:[-+/*=(\[]|\\(?:cdot|times|div|equiv|approx|coloneqq|pm)){SPACE}*(?:\\right\.{SPACE}*)?$")
PIECE = re.compile(
    r"\\begin\s*\{(\w+)\*?\}|\\end\s*\{(\w+)\*?\}|\\(left|right)(?![A-Za-z])\s*(?:\\?.)?|\\[{}]|\\.|[(){}\[\]]",
    re.DOTALL,
)
OPENS, CLOSES = ("(", "[", "{"), (")", "]", "}")


def latex_statements(text: str, line: int) -> Iterator[Statement]:
    """Yield the statements of one display: rows that go on belong together.

    Parameters
    ----------
    text
        The inside of a display, environments and all, without comments.
    line
        Its first line.
    """
    held: list[Row] = []
    same: list[Statement] = []  # begun in the row in which what is held begins
    problem, depth, is_new_row = "", 0, True
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
            same = [replace(statement, problem=statement.problem or problem) for statement in same]
        if held and not goes_on:
            is_aside = _ends_statement(held[-1].text) and bool(_places(plain, OTHER_RELATIONS))
            if not has_relation(plain) and not is_aside:
                problem = problem or "a row that neither begins with an operator nor has an ="
            else:
                if is_new_row:
                    yield from same
                    same = []
                same += _statements_in(held, problem)
                if is_new_row:
                    yield from same
                    same = []
                held, problem, depth = [], "", 0
        held.append(row)
        depth += _depth(plain)
        is_new_row = False
    if held:
        yield from same
        yield from _statements_in(held, problem)


def _without_words(text: str) -> str:
    """Take labels and words away; words between formulas part them."""
    text = DROPPED.sub(" ", text)
    if WORDS.search(text) is None:
        return text
    outside = {start for start, _ in _places(text, WORDS)}

    def worded(match: re.Match[str]) -> str:
        is_outside = match.start() in outside
        is_kept = _is_part(match, text) or (_is_doubtful(match, text) if is_outside else SYMMETRIC.match(match[0]))
        return match[0] if is_kept else r" \quad\therefore "

    return WORDS.sub(worded, text)


SYMMETRIC = re.compile(r"\\(?:text|textrm|mbox|mathrm|textit)\s*\{\s*(?:[Ss]ymm?\.?|[Ss]ymmetric|SYM\.?)\s*\}")
UNIT = re.compile(r"(?:[/ .*]*(?:kg|m|s|N|J|W|rad|cm|mm|g|deg|Nm)(?:\^?-?\d)?)+", re.ASCII)
PROSE_WORDS = frozenset(
    [
        "and",
        "or",
        "for",
        "if",
        "as",
        "so",
        "let",
        "we",
        "now",
        "is",
        "at",
        "on",
        "in",
        "by",
        "of",
        "to",
        "the",
        "not",
        "all",
        "are",
    ]
)
DOUBTFUL = re.compile(
    r"if|iff|when|whenever|unless|otherwise|else|provided|assuming|assume|except|only|not|near|at|small|large"
    r"|plus|minus|times|divided|over|multiplied|squared|cubed|square|cube|root|twice|thrice|half|double"
    r"|negative|without|add|added|subtract|subtracted|reduced|increased|sine?|cosine?|cos"
    r"|one|two|three|four|five|six|seven|eight|nine|ten|third|quarter|wrong|incorrect|false|modulo|mod|pi|theta",
    re.IGNORECASE,
)
"""Words that may change what a formula in front of them states."""
PROSE = re.compile(r"(?:[A-Za-z~\s.,:;()'`?!]|\\[ ,]|(?<=[A-Za-z])-(?=[A-Za-z]))*", re.ASCII)


def _is_part(match: re.Match[str], text: str) -> bool:
    """Whether text is part of a formula: a name, or a unit behind a number."""
    inside = match[1].strip()
    if re.fullmatch(r"[A-Za-z]{1,3}\d*", inside, re.ASCII):
        return inside.lower() not in PROSE_WORDS
    behind_number = re.search(r"\d(?:[~\s]|\\[,;: ])*$", text[max(0, match.start() - 20) : match.start()])
    return UNIT.fullmatch(inside) is not None and behind_number is not None


def _is_doubtful(match: re.Match[str], text: str) -> bool:
    """Whether text may be more than words between formulas: signs, numbers, formulas, conditions."""
    inside = match[1]
    if "$" in inside or "\\(" in inside:
        return True
    if "intertext" in match[0][:20]:
        return False
    words = re.findall("[A-Za-z]+", inside)
    if PROSE.fullmatch(inside) is None or any(DOUBTFUL.fullmatch(word) for word in words):
        return True
    if words and words[-1].lower() in ("for", "with", "where", "as"):
        return words[-1].lower() in ("for", "as") and _is_bounded(text[match.end() :])
    return False


def _is_bounded(behind: str) -> bool:
    """Whether a text begins with a condition, q_1 > 0, rather than with an equation."""
    behind = re.split(r"\\therefore|\\text|,", behind, maxsplit=1)[0]
    return not has_relation(behind) and bool(_places(behind, OTHER_RELATIONS))


def _bare(text: str) -> str:
    """Return text without the spaces and punctuation at its ends."""
    start, end = 0, len(text)
    while match := LEADING.match(text, start, end):
        start = match.end()
    while end > start:
        found = next((mark for mark in TRAILING if text.endswith(mark, start, end)), "")
        is_part = found in (",", ";", ".", ":", "!", ">") and text.endswith(("\\left.", "\\right."), start, end)
        if not found or is_part:
            break
        end -= len(found)
    return text[start:end]


def _goes_on(last: str, depth: int, row: Row) -> bool:
    is_statement = re.search(r"[A-Za-z\d]", row.before) is not None or row.before.isspace()
    if STARTS_WITH_RELATION.match(row.text):
        return True
    if STARTS.match(row.text) and not (is_statement and has_relation(row.text)):
        return True
    return depth > 0 or ENDS.search(last[-200:]) is not None


def _is_ambiguous(row: Row) -> bool:
    """Whether a row may go on or be a statement of its own: - b = c."""
    return (
        STARTS.match(row.text) is not None
        and not STARTS_WITH_RELATION.match(row.text)
        and not row.after_mark
        and (not row.before or re.search(r"[A-Za-z\d]", row.before) is not None)
        and has_relation(row.text)
    )


def _ends_statement(text: str) -> bool:
    return re.search(rf"(?:[,;.]|\\therefore){SPACE}*$", text[-200:]) is not None


def _depth(text: str) -> int:
    """Return how many brackets are open at the end of a text."""
    depth = 0
    for match in PIECE.finditer(text):
        depth += _nesting(match)
    return depth


def _nesting(piece: re.Match[str]) -> int:
    """Return by how much a piece changes the depth of brackets and environments: 1, -1 or 0."""
    if piece[1] or piece[3] == "left" or piece[0] in OPENS or piece[0] == r"\{":
        return 1
    return -bool(piece[2] or piece[3] == "right" or piece[0] in CLOSES or piece[0] == r"\}")


def _places(text: str, pattern: re.Pattern[str]) -> list[tuple[int, int]]:
    """Return where a pattern stands outside all brackets and environments."""
    depth = 0
    found: list[tuple[int, int]] = []
    if pattern.search(text) is None:
        return found
    pieces = PIECE.finditer(text)
    piece = next(pieces, None)
    for match in pattern.finditer(text):
        while piece is not None and piece.start() < match.start():
            depth += _nesting(piece)
            piece = next(pieces, None)
        if depth == 0:
            found.append(match.span())
    return found


def has_relation(text: str) -> bool:
    """Whether an = stands in a text outside all brackets."""
    return bool(_places(text, EQUAL))


def _statements_in(held: Sequence[Row], problem: str) -> Iterator[Statement]:
    """Yield the statements of rows that belong together: parted by words, arrows, and commas between equations."""
    line, text = held[0].line, re.sub(r"\s+", " ", " ".join(row.text for row in held))
    found: list[Statement] = []
    words = "words, or an arrow, and something of a formula that is no equation: "
    marked = 0
    is_open = ""  # what stands alone in front of words
    for part in _split(text, _places(text, THEREFORE)):
        if not _bare(part):
            continue
        is_whole = has_relation(part) and not STARTS_WITH_RELATION.match(_bare(part))
        if not is_whole and found and not _places(part, OTHER_RELATIONS):
            for at in range(marked, len(found)):
                found[at] = replace(found[at], problem=found[at].problem or words + _bare(part)[:60])
            marked = len(found)
        own = problem or (words + is_open if is_open else "")
        found += [_statement(bare, line, own) for piece in _parted(part) if (bare := _bare(piece))]
        is_open = "" if is_whole else _bare(part)[:60]
    yield from found


def _parted(piece: str) -> Iterator[str]:
    """Yield the equations that commas part."""
    commas = _places(piece, re.compile(r"(?<!\\)[,;]"))
    parts = _split(piece, commas)
    joined = [parts[0]]
    for part in parts[1:]:
        if has_relation(part) and has_relation(joined[-1]) and not STARTS_WITH_RELATION.match(part):
            joined.append(part)
        elif not _bare(part):
            continue
        else:
            joined[-1] += "," + part
    yield from joined


def _split(text: str, places: Sequence[tuple[int, int]]) -> list[str]:
    pieces, at = [], 0
    for start, end in places:
        pieces.append(text[at:start])
        at = end
    return [*pieces, text[at:]]


def _statement(text: str, line: int, problem: str) -> Statement:
    sides = [_bare(side) for side in _split(text, _places(text, EQUAL))]
    if _depth(text) != 0:
        problem = problem or "brackets that do not close"
    doubtful = [match for match in WORDS.finditer(text) if _is_doubtful(match, text) and not _is_part(match, text)]
    if doubtful:
        problem = problem or f"text that may change what is stated: {doubtful[0][0][:60]}"
    if len(sides) > 1 and _places(text, OTHER_RELATIONS):
        problem = problem or "another relation than ="
    if len(sides) == 1:
        return Statement(line, (), (sides[0],), problem, text)
    if not all(sides):
        problem = problem or "an = with nothing on one side"
    targets = [left_hand_name(side) for side in sides]
    if not targets[0]:
        return Statement(line, (), tuple(sides), problem, text)
    return _sorted(line, sides, targets, problem, text)


def _sorted(line: int, sides: Sequence[str], names: Sequence[str], problem: str, text: str) -> Statement:
    """Tell the names that a statement is about from its formulas: M12 = M21 = f is about both, V = a = f about V."""
    last = len(sides) - 1
    about = [k < last and _is_also(name, names[0]) for k, name in enumerate(names)]
    targets = tuple(dict.fromkeys(name for name, is_target in zip(names, about, strict=True) if is_target))
    formulas = tuple(side for side, is_target in zip(sides, about, strict=True) if not is_target)
    return Statement(line, targets, formulas, problem, text)


def _is_also(name: str, first: str) -> bool:
    """Whether a name is that of another entry, or another name of the quantity."""
    if not name or name == first:
        return bool(name)
    letters = name.rstrip("0123456789_")
    return letters == first.rstrip("0123456789_") or (name in QUANTITIES and first in QUANTITIES)


LONGEST_NAME = 200
"""Characters of a side that may be a name."""
QUANTITIES = frozenset(("M", "C", "h", "g", "tau", "K", "V", "L", "T", "J", *ALIASES))
STYLES = re.compile(
    r"\\(?:mathbf|mathrm|mathit|mathsf|mathcal|mathscr|boldsymbol|bm|textbf|textrm|text|vec|operatorname|mathnormal|pmb|bf|rm)(?![A-Za-z])"
)
NAME = re.compile(
    r"\[?(?P<letters>\\?[A-Za-z]+)\]?(?:_(?:(?P<one>[A-Za-z0-9])|\{(?P<below>[\\A-Za-z0-9, ]*)\}))?", re.ASCII
)
ARGUMENT = re.compile(
    r"(?:\\d?dot|dot)?\{?(?:q|\\theta|\\vartheta|\\phi|\\varphi|\\Theta|theta|phi|x|y|z|t|d|r|qd|dq|qdd|th|qdot)\}?"
    r"(?:_\{?\d*\}?|\d*)(?:\(t\))?",
    re.ASCII,
)


def left_hand_name(side: str) -> str:
    r"""Return the name that a side is, with arguments such as (q, \dot q) left out; empty where it is none.

    ``M_{12}(q)`` is M12, ``\mathbf{g}(\theta)`` g, ``M_{10,2}`` M10_2; ``\dot V``, ``V'`` and ``M^{-1}`` are no names.
    """
    if len(side) > LONGEST_NAME:
        return ""
    text = re.sub(r"\\(?:left|right|bigl?|bigr|Bigl?|Bigr)(?![A-Za-z])", "", side)
    text = re.sub(rf"{SPACE}+", " ", text)
    while True:
        opened = STYLES.sub("", text).strip()
        opened = re.sub(r"^\{\s*([^{}]*?)\s*\}", r"\1", opened) if opened.startswith("{") else opened
        if opened == text:
            break
        text = opened
    text = re.sub(r"\s+", "", re.sub(r"\{\s*(\\?[A-Za-z]+)\s*\}", r"{\1}", text))
    match = NAME.match(text)
    if match is None or (text.startswith("[") != text[: match.end()].count("]")):
        return ""
    letters = match["letters"]
    if letters.startswith("\\") and plain_name(letters) not in _GREEK:
        return ""
    below = match["one"] or match["below"] or ""
    rest = text[match.end() :]
    if rest.startswith("("):
        inside, closes, behind = rest[1:].partition(")")
        while inside.count("(") > inside.count(")"):
            more, closes, behind = behind.partition(")")
            inside += ")" + more
            if not closes:
                return ""
        arguments = inside.split(",")
        if not closes:
            return ""
        if all(argument.isdecimal() for argument in arguments) and not below:
            below = ",".join(arguments)
        elif not all(ARGUMENT.fullmatch(argument) for argument in arguments):
            return ""
        rest = behind
    if rest and not below and (under := re.fullmatch(r"_(?:(\w)|\{([\w,]*)\})", rest)):
        below, rest = under[1] or under[2], ""
    if rest:
        return ""
    below = below.replace("\\", "")
    is_pair = re.fullmatch(r"(\d+),(\d+)", below)
    if is_pair:
        one_digit = len(is_pair[1]) == len(is_pair[2]) == 1
        below = is_pair[1] + ("" if one_digit else "_") + is_pair[2]
    return plain_name(letters) + below.replace(",", "")


_GREEK = GREEK | {"ell", "Tau", "mathbf"}


# Plain text


PLAIN_START = re.compile(r"\s*(?:[-+*/^=)\].]|\*\*)")
PLAIN_END = re.compile(r"(?:[-+*/^=(\[,]|\.\.\.|\\)\s*$")


def _plain_statements(text: str) -> Iterator[Statement]:
    """Yield the statements of plain text: one a line, or between semicolons; lines that go on belong together."""
    held: list[str] = []
    start, depth = 1, 0
    for number, typed in enumerate(text.splitlines(), start=1):
        line = PLAIN_COMMENT.sub("", typed)
        if typed.strip() and not line.strip():
            continue
        if not line.strip():
            goes_on = depth > 0
        else:
            ended = not held or re.search(r";\s*$", held[-1]) is not None
            goes_on = depth > 0 or (
                not ended and (PLAIN_START.match(line) is not None or PLAIN_END.search(held[-1][-20:]) is not None)
            )
        if not goes_on:
            yield from _plain_held(held, start)
            held, start, depth = [], number, 0
        if line.strip():
            start = start if held else number
            held.append(line)
            depth += sum(map(line.count, "([{")) - sum(map(line.count, ")]}"))
    yield from _plain_held(held, start)


def _plain_held(held: Sequence[str], line: int) -> Iterator[Statement]:
    """Yield the statements of lines that belong together."""
    whole = " ".join(part.strip().removesuffix("...") for part in held)
    for piece in _plain_split(whole, ";"):
        if piece.strip():
            yield from _plain_line(piece.strip(), line)


def _plain_line(text: str, line: int) -> Iterator[Statement]:
    text = re.sub(r"^where\s+", "", text)
    parts = [text]
    pieces = _plain_split(text, ",")
    if len(pieces) > 1 and all(len(_plain_split(piece, "=")) > 1 for piece in pieces):
        parts = pieces
    for part in parts:
        sides = [side.strip() for side in _plain_split(part, "=")]
        if len(sides) == 1:
            yield Statement(line, (), (sides[0],), "", part)
            continue
        problem = "" if all(sides) else "an = with nothing on one side"
        if sum(map(part.count, "([{")) != sum(map(part.count, ")]}")):
            problem = "brackets that do not close"
        names = [_plain_target(side) for side in sides]
        if re.search(r"[<>~!]|[-+*/]=", part):
            problem = "another relation than ="
        if not names[0]:
            yield Statement(line, (), tuple(sides), problem, part)
            continue
        yield _sorted(line, sides, names, problem, part)


def _plain_split(text: str, sign: str) -> list[str]:
    pieces: list[list[str]] = [[]]
    depth = 0
    for character in text:
        depth += (character in "([{") - (character in ")]}")
        if depth == 0 and character == sign:
            pieces.append([])
        else:
            pieces[-1].append(character)
    return ["".join(piece) for piece in pieces]


def _plain_target(side: str) -> str:
    match = re.fullmatch(r"([A-Za-z]\w*)\s*(?:\(([^()]*)\)|\[(\d+)\]\[(\d+)\]|\[([\d,\s]+)\])?", side, re.ASCII)
    if match is None:
        return ""
    name, arguments, i, j, inside = match.groups()
    if arguments is not None:
        parts = [part.strip() for part in arguments.split(",")]
        if all(part.isdecimal() for part in parts):
            return name + "_".join(parts)
        usual = all(re.fullmatch(r"(?:d|dd)?(?:q|th|theta|t|x)(?:d|dd|dot|ddot)?\d*", part) for part in parts)
        return name if usual else ""
    if i is not None or inside is not None:
        numbers = [i, j] if i is not None else inside.split(",")
        return name + "_".join(str(int(k) + 1) for k in numbers if k.strip())
    return name
