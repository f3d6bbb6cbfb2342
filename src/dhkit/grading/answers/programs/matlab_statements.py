"""MATLAB and Octave as statements: without comments, joined where they go on, told apart outside brackets."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from dhkit.errors import AnswerError

TOKEN = re.compile(
    r"(?P<number>0[xXbB][0-9A-Fa-f]+\w*|(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?[ij]?(?![\w]))"
    r"|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<sign>\.\^'|\.\*\*|\.\^|\.\*|\./|\.\\|\.'|\+\+|--|\*\*|\+=|-=|\*=|/=|\^=|\|=|&=|==|~=|!=|<=|>=|&&|\|\|"
    r"|[-+*/\\^()\[\]{},;:=<>&|~!@.'?])",
    re.ASCII,
)
SPACE = re.compile(r"[ \t\f\v\r\u00a0]+")
MAX_TOKENS = 200_000
OPENING, CLOSING = "([{", ")]}"


@dataclass(frozen=True)
class MatlabToken:
    """A number, a name, a sign, a string, or the end of a row.

    Attributes
    ----------
    kind
        number, name, sign, string or row.
    text
        As typed; ``;`` of a row.
    line
        From 1.
    spaced
        Whether a space stands before it.
    """

    kind: str
    text: str
    line: int
    spaced: bool

    @property
    def nesting(self) -> int:
        """By how much it changes the depth of brackets: 1, -1 or 0."""
        return (self.text in OPENING) - (self.text in CLOSING) if self.kind == "sign" else 0


@dataclass(frozen=True)
class Statement:
    """Tokens of one statement, and its text where it begins like a command: ``syms q1 q2 real``.

    Attributes
    ----------
    tokens
        One or more.
    words
        The rest of its line, which commands take as words.
    """

    tokens: tuple[MatlabToken, ...]
    words: str

    @property
    def line(self) -> int:
        """Where it begins, from 1."""
        return self.tokens[0].line


def statements(text: str, file: str, line_name: object) -> Iterator[Statement]:
    """Yield the statements of a program.

    Raises
    ------
    AnswerError
        Brackets or strings that do not close, or a character that MATLAB does not have.
    """
    name = line_name if callable(line_name) else str
    found: list[MatlabToken] = []
    brackets: list[tuple[str, int]] = []
    words = ""
    for token in _tokens(text, file, name, brackets):
        ends = not brackets and (token.kind == "row" or (token.kind == "sign" and token.text in (";", ",")))
        if ends:
            if found:
                yield Statement(tuple(found), words)
            found = []
            continue
        if token.kind == "words":
            words = token.text
            continue
        found.append(token)
        if len(found) > MAX_TOKENS:
            raise AnswerError(f"{file}: {name(found[0].line)}: a statement of more than {MAX_TOKENS} signs")
    if brackets:
        sign, line = brackets[-1]
        raise AnswerError(f"{file}: {name(line)}: {sign!r} does not close")
    if found:
        yield Statement(tuple(found), words)


def _tokens(  # type: ignore[no-untyped-def]
    text: str, file: str, name, brackets: list[tuple[str, int]]
) -> Iterator[MatlabToken]:
    """Yield tokens; ``brackets`` holds those that are open, and the end of a line inside them is a row or a space."""
    block = 0
    before = MatlabToken("row", "\n", 0, False)
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1):
        mark = line.strip()
        if mark in ("%{", "#{"):
            block += 1
            continue
        if block:
            block -= mark in ("%}", "#}")
            continue
        at, spaced, goes_on = 0, True, False
        while at < len(line):
            if match := SPACE.match(line, at):
                at, spaced = match.end(), True
                continue
            character = line[at]
            if character in "%#":
                break
            if line.startswith("...", at):
                goes_on = True
                break
            if character == "!" and before.kind == "row" and not brackets:
                break  # a command of the system's
            at_start = not brackets and (before.kind == "row" or before.text in (";", ","))
            is_quote = character == '"' or (character == "'" and not _is_transpose(before, spaced, brackets))
            if is_quote:
                match = re.compile(r"""'(?:[^']|'')*'|"(?:[^"\\]|""|\\.)*\"""").match(line, at)
                if match is None:
                    raise AnswerError(f"{file}: {name(number)}: a string that does not end")
                token = MatlabToken("string", match[0], number, spaced)
            else:
                match = TOKEN.match(line, at)
                if match is None:
                    raise AnswerError(f"{file}: {name(number)}: found {character!r}, which no statement has")
                token = MatlabToken(str(match.lastgroup), match[0], number, spaced)
            at, spaced = match.end(), False
            if token.kind == "sign" and token.text in OPENING:
                brackets.append((token.text, number))
            elif token.kind == "sign" and token.text in CLOSING:
                if not brackets or OPENING.index(brackets[-1][0]) != CLOSING.index(token.text):
                    raise AnswerError(f"{file}: {name(number)}: {token.text!r} without its opening bracket")
                brackets.pop()
            if at_start and token.kind == "name":
                rest = line[at:] if token.text in COMMANDS else ""
                yield MatlabToken("words", _words(rest), number, False)
                if _is_command(token.text, rest):
                    yield token
                    before = token
                    at = len(line) - len(_rest(rest))
                    continue
            yield token
            before = token
        if goes_on:
            before = MatlabToken("space", " ", number, True) if not brackets else before
            continue
        if not brackets or brackets[-1][0] in "[{":
            before = MatlabToken("row", "\n", number, True)
            yield before
    if block:
        raise AnswerError(f"{file}: a comment that %{{ begins does not end")


def _is_transpose(before: MatlabToken, spaced: bool, brackets: list[tuple[str, int]]) -> bool:
    ends = before.kind in ("name", "number", "string") or before.text in (")", "]", "}", "'", ".'")
    return ends and before.kind != "row" and not (spaced and brackets and brackets[-1][0] in "[{")


COMMANDS = frozenset(
    (
        "syms",
        "clear",
        "clearvars",
        "close",
        "clc",
        "format",
        "hold",
        "warning",
        "more",
        "pkg",
        "global",
        "persistent",
        "load",
        "save",
        "figure",
        "grid",
        "axis",
        "diary",
        "echo",
        "disp",
        "help",
        "doc",
        "graphics_toolkit",
        "addpath",
        "run",
        "source",
        "digits",
        "reset",
        "tic",
        "toc",
        "import",
    )
)


def _is_command(word: str, rest: str) -> bool:
    """Whether a statement is a command with words: the word, a space, another word, and no = after it."""
    return re.match(r"[ \t]+(?:[A-Za-z_\-*'\"]|\d)", rest) is not None and (
        word in COMMANDS and re.match(r"[ \t]+\w*[ \t]*(?:=[^=]|\()", rest.replace("(t)", "")) is None
    )


def _words(rest: str) -> str:
    return rest[: len(rest) - len(_rest(rest))]


def _rest(rest: str) -> str:
    """Return what follows a command's words."""
    depth = 0
    for k, character in enumerate(rest):
        depth += (character in OPENING) - (character in CLOSING)
        if (character in ";," and depth <= 0) or character in "%#":
            return rest[k:]
    return ""
