"""MATLAB and Octave as statements: tokens without comments, joined where lines go on, split outside brackets."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain
from typing import TypeAlias

from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.tokens import word_set

_TOKEN = re.compile(
    r"(?P<number>0[xXbB][0-9A-Fa-f]+\w*|(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?[ij]?(?![\w]))"
    r"|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<sign>\.\^'|\.\*\*|\.\^|\.\*|\./|\.\\|\.'|\+\+|--|\*\*|\+=|-=|\*=|/=|\^=|\|=|&=|==|~=|!=|<=|>=|&&|\|\|"
    r"|[-+*/\\^()\[\]{},;:=<>&|~!@.'?])",
    re.ASCII,
)
_STRING = re.compile(r"""(?P<string>'(?:[^']|'')*'|"(?:[^"\\]|""|\\.)*")""")
_SPACE = re.compile(r"[ \t\f\v\r\u00a0]+")


_OPENING = "([{"
_CLOSING = ")]}"
CHANGING = ("+=", "-=", "*=", "/=", "^=", "|=", "&=")
STEPPING = ("++", "--")
_ASSIGNING = ("=", *CHANGING, *STEPPING)

COMMANDS = word_set(
    """
    syms clear clearvars close clc format hold warning more pkg global persistent load save figure grid axis
    diary echo disp help doc graphics_toolkit addpath run source digits reset tic toc import
    """
)
"""Commands that take the rest of their line as words: ``syms q1 q2 real``."""


@dataclass(frozen=True)
class MatlabToken:
    """A number, a name, a sign, a string, or the end of a row.

    Attributes
    ----------
    kind
        number, name, sign, string or row.
    text
        As typed; the end of a line for a row.
    line
        Line, from 1.
    is_spaced
        Whether a space stands before it.
    words
        Rest of the line, of a command at the beginning of a statement.
    """

    kind: str
    text: str
    line: int
    is_spaced: bool
    words: str = ""

    @property
    def nesting(self) -> int:
        """Change of the depth of brackets: 1, -1 or 0."""
        return (self.text in _OPENING) - (self.text in _CLOSING) if self.kind == "sign" else 0

    def is_sign(self, *texts: str) -> bool:
        """Whether it is one of some signs, and no string or name."""
        return self.kind == "sign" and self.text in texts

    @property
    def ends_operand(self) -> bool:
        """Whether an operand of a formula may end with it."""
        return self.kind in ("name", "number", "string") or self.text in (")", "]", "}", "'", ".'")


Tokens: TypeAlias = Sequence[MatlabToken]


@dataclass(frozen=True)
class MatlabStatement:
    """One statement.

    Attributes
    ----------
    tokens
        One or more.
    """

    tokens: tuple[MatlabToken, ...]

    @property
    def line(self) -> int:
        """Line in which it begins, from 1."""
        return self.tokens[0].line

    @property
    def keyword(self) -> str:
        """The name that it begins with; empty where it begins with something else."""
        return self.tokens[0].text if self.tokens[0].kind == "name" else ""

    @property
    def texts(self) -> list[str]:
        """The texts of its tokens."""
        return [token.text for token in self.tokens]

    @property
    def command_names(self) -> list[str]:
        """Names among the words of a command."""
        return re.findall(r"[A-Za-z]\w*", self.tokens[0].words)

    def assigned_names(self) -> set[str]:
        """Return the names that it may assign."""
        tokens = self.tokens
        keyword = self.tokens[0].text
        names: set[str] = set()
        if keyword in ("syms", "global", "persistent"):
            names |= set(self.command_names)
        if keyword in ("for", "parfor", "catch"):
            names |= set([token.text for token in tokens[1:] if token.kind == "name"][:1])
        for k, token in enumerate(tokens):
            if token.is_sign(*_ASSIGNING):
                names |= _names_assigned_before(tokens, k)
            if token.is_sign(*STEPPING):
                names |= {after.text for after in tokens[k + 1 : k + 2] if after.kind == "name"}
        return names

    def assigned_fields(self) -> set[str]:
        """Return the last fields of structures that it assigns: V of ``out.V = ...``."""
        tokens = self.tokens
        fields: set[str] = set()
        for before, token, after in zip(tokens, tokens[1:], tokens[2:], strict=False):
            if before.text == "." and token.kind == "name" and after.is_sign(*_ASSIGNING):
                fields.add(token.text)
        return fields


def _names_assigned_before(tokens: Tokens, end: int) -> set[str]:
    """Return the names that the left-hand side in front of ``end`` assigns."""
    is_list = end > 0 and tokens[end - 1].is_sign("]")
    depth = 0
    for k in range(end - 1, -1, -1):
        depth -= tokens[k].nesting
        if is_list and (depth == 0 or k == 0):
            entries = list(chain.from_iterable(split_rows(tokens[k + 1 : end - 1])))
            return {entry[0].text for entry in entries if entry[0].kind == "name"}
        if not is_list and depth < 0:
            return set()
        if (
            not is_list
            and depth == 0
            and tokens[k].kind == "name"
            and (k == 0 or tokens[k - 1].text != ".")
        ):
            return {tokens[k].text}
    return set()


def closing(tokens: Tokens, k: int) -> int:
    """Return where the bracket at k closes; the tokenizer has checked that it does."""
    depth = 0
    for end in range(k, len(tokens)):
        depth += tokens[end].nesting
        if depth == 0:
            return end
    return len(tokens) - 1


def is_call(tokens: Tokens, *names: str) -> bool:
    """Whether tokens are the call of a function of one of some names, and nothing else."""
    is_named = len(tokens) > 2 and tokens[0].kind == "name" and tokens[0].text in names
    return is_named and tokens[1].text == "(" and closing(tokens, 1) == len(tokens) - 1


def split_rows(tokens: Tokens) -> list[list[Tokens]]:
    """Split the inside of a matrix: at ; and new lines into rows, at commas and spaces into entries."""
    rows: list[list[list[MatlabToken]]] = [[[]]]
    depth = 0
    for k, token in enumerate(tokens):
        entry = rows[-1][-1]
        if depth == 0 and (token.kind == "row" or token.is_sign(";")):
            rows.append([[]])
            continue
        if depth == 0 and token.is_sign(","):
            rows[-1].append([])
            continue
        if (
            depth == 0
            and token.is_spaced
            and entry
            and entry[-1].ends_operand
            and _begins_entry(tokens[k : k + 2])
        ):
            rows[-1].append([])
        depth += token.nesting
        rows[-1][-1].append(token)
    filled_rows: list[list[Tokens]] = []
    for row in rows:
        filled: list[Tokens] = [entry for entry in row if entry]
        if filled:
            filled_rows.append(filled)
    return filled_rows


def _begins_entry(tokens: Tokens) -> bool:
    """Whether the first token, after a space, begins an entry: also a sign that stands close to what follows."""
    token = tokens[0]
    after = tokens[1] if len(tokens) > 1 else None
    if token.kind != "sign" or token.text in ("(", "[", "{", "@"):
        return True
    return (
        token.text in ("+", "-", "~", "!")
        and after is not None
        and not after.is_spaced
        and after.kind != "row"
    )


def matlab_statements(
    text: str, file: str, line_name: Callable[[int], str]
) -> Iterator[MatlabStatement]:
    """Yield the statements of a program.

    Parameters
    ----------
    text
        The program.
    file
        Beginning of messages.
    line_name
        How messages name a line, which counts from 1.

    Raises
    ------
    AnswerError
        Brackets or strings that do not close, or a character that MATLAB does not have.
    """
    return _Tokenizer(file, line_name).statements(text)


class _Tokenizer:
    """Reads a program line by line; ``brackets`` are those that are open, each with its line."""

    def __init__(self, file: str, line_name: Callable[[int], str]) -> None:
        self.file = file
        self.line_name = line_name
        self.brackets: list[tuple[str, int]] = []
        self.previous = MatlabToken("row", "\n", 0, False)

    def _error(self, line: int, problem: str) -> AnswerError:
        return AnswerError(f"{self.file}: {self.line_name(line)}: {problem}")

    def statements(self, text: str) -> Iterator[MatlabStatement]:
        tokens: list[MatlabToken] = []
        for token in self._tokens(text):
            if not self.brackets and (token.kind == "row" or token.is_sign(";", ",")):
                if tokens:
                    yield MatlabStatement(tuple(tokens))
                tokens = []
                continue
            tokens.append(token)
            if len(tokens) > BOUNDS.matlab_tokens:
                raise self._error(
                    tokens[0].line, f"a statement of more than {BOUNDS.matlab_tokens} signs"
                )
        if self.brackets:
            sign, line = self.brackets[-1]
            raise self._error(line, f"{sign!r} does not close")
        if tokens:
            yield MatlabStatement(tuple(tokens))

    def _tokens(self, text: str) -> Iterator[MatlabToken]:
        """Yield the tokens outside block comments."""
        depth = 0
        for number, line_text in enumerate(
            text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1
        ):
            mark = line_text.strip()
            if mark in ("%{", "#{"):
                depth += 1
            elif depth:
                depth -= mark in ("%}", "#}")
            else:
                yield from self._line_tokens(line_text, number)
        if depth:
            raise AnswerError(f"{self.file}: a comment that %{{ begins does not end")

    def _line_tokens(self, line_text: str, number: int) -> Iterator[MatlabToken]:
        """Yield a line's tokens, and its end where it ends a statement or a row of a matrix."""
        at = 0
        is_spaced = True
        while at < len(line_text):
            if match := _SPACE.match(line_text, at):
                at = match.end()
                is_spaced = True
                continue
            is_at_row = self.previous.kind == "row" and not self.brackets
            if line_text[at] in "%#" or (line_text[at] == "!" and is_at_row):
                break  # a comment, or a command of the system's
            if line_text.startswith("...", at):
                self.previous = (
                    self.previous if self.brackets else MatlabToken("space", " ", number, True)
                )
                return
            begins_statement = is_at_row or (not self.brackets and self.previous.text in (";", ","))
            match = self._match(line_text, at, number, is_spaced)
            kind = str(match.lastgroup)
            text = match[0]
            at = match.end()
            is_command = begins_statement and kind == "name" and text in COMMANDS
            rest = line_text[at:] if is_command else ""
            end = len(line_text) - len(_behind_words(rest))
            token = MatlabToken(
                kind, text, number, is_spaced, line_text[at:end] if is_command else ""
            )
            self._count_bracket(token)
            yield token
            self.previous = token
            is_spaced = False
            if _takes_words(rest):
                at = end
        if not self.brackets or self.brackets[-1][0] in "[{":
            self.previous = MatlabToken("row", "\n", number, True)
            yield self.previous

    def _match(self, line_text: str, at: int, number: int, is_spaced: bool) -> re.Match[str]:
        """Match the token that begins in a column of a line."""
        is_in_matrix = bool(self.brackets) and self.brackets[-1][0] in "[{"
        is_transpose = self.previous.ends_operand and not (is_spaced and is_in_matrix)
        pattern = _TOKEN
        problem = f"found {line_text[at]!r}, which no statement has"
        if line_text[at] == '"' or (line_text[at] == "'" and not is_transpose):
            pattern = _STRING
            problem = "a string that does not end"
        match = pattern.match(line_text, at)
        if match is None:
            raise self._error(number, problem)
        return match

    def _count_bracket(self, token: MatlabToken) -> None:
        if token.nesting > 0:
            self.brackets.append((token.text, token.line))
        elif token.nesting < 0:
            if not self.brackets or _OPENING.index(self.brackets[-1][0]) != _CLOSING.index(
                token.text
            ):
                raise self._error(token.line, f"{token.text!r} without its opening bracket")
            self.brackets.pop()


def _takes_words(rest: str) -> bool:
    """Whether a command is followed by words: a space, another word, and no = after it."""
    has_word = re.match(r"[ \t]+(?:[A-Za-z_\-*'\"]|\d)", rest) is not None
    return has_word and re.match(r"[ \t]+\w*[ \t]*(?:=[^=]|\()", rest.replace("(t)", "")) is None


def _behind_words(rest: str) -> str:
    """Return what follows a command's words in its line."""
    depths = accumulate((character in _OPENING) - (character in _CLOSING) for character in rest)
    ends = (
        k for k, depth in enumerate(depths) if rest[k] in "%#" or (rest[k] in ";," and depth <= 0)
    )
    return rest[next(ends, len(rest)) :]
