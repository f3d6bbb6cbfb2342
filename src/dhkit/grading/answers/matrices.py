"""Matrices and vectors in one text, in any of the notations that students write."""

from __future__ import annotations

import re
import unicodedata
from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate, chain, pairwise
from typing import NamedTuple

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Token, Tree
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.computer_algebra import is_mathematica
from dhkit.grading.answers.latex import is_latex
from dhkit.grading.answers.pretty import in_one_line
from dhkit.grading.answers.reading import answer_tokens, answer_tree, without_comments
from dhkit.grading.answers.tokens import (
    begins_with,
    check_depth,
    closing_bracket,
    fail,
    in_brackets,
    nesting,
    places_outside_brackets,
    quote,
    sign,
    word_set,
)
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Vocabulary

_MATRIX_WORDS = word_set(
    "sym Matrix array matrix simplify transpose MutableDenseMatrix ImmutableMatrix DM SX"
)
"""Functions that give a matrix of the one in their brackets."""

TRANSPOSES = (
    ["'"],
    [".'"],
    [".", "T"],
    ["^", "T"],
    ["^", "top"],
    ["^", "(", "T", ")"],
    ["^", "(", "top", ")"],
)
"""Signs of a transpose, in tokens."""

_COLUMN_SIGNS = (",", "&")
"""Signs between the entries of a row."""
_ROW_SIGNS = (";", "\\\\")
"""Signs between rows."""

_NOWHERE = -1
"""Place of the zeros beside a diagonal, which nobody typed."""


def read_matrix(text: str, vocabulary: Vocabulary) -> list[list[tuple[str, Tree]]]:
    """Read a matrix or a vector out of one text: [[a, b], [c, d]], [a, b; c, d], Matrix([...]) or pmatrix.

    Parameters
    ----------
    text
        The student's text; it is never evaluated.
    vocabulary
        Meanings of names.

    Returns
    -------
    list
        Rows of pairs: an entry's text, and its tree; a vector is a column or a row, as it was written.

    Raises
    ------
    AnswerError
        As for :func:`read_answer`, or no matrix.
    """
    tokens, text = _tokens(text, vocabulary)
    places = [token.at for token in tokens]
    tokens = _with_diagonal(_unwrap(_with_column_brackets(tokens, text), text), text)
    start = next((k for k, token in enumerate(tokens) if token.text == "["), len(tokens))
    end = max((k for k, token in enumerate(tokens) if token.text == "]"), default=-1)
    if end < start:
        hint = (
            "; a matrix that it names is not on the sheet" if re.search(r"[A-Za-z]", text) else ""
        )
        raise AnswerError(f"expected a matrix in brackets, found {text[:60]!r}{hint}")
    factors = _factors(tokens[:start], tokens[end + 1 :], text)
    entry_count = sum(token.text in (*_COLUMN_SIGNS, *_ROW_SIGNS) for token in tokens)
    rows = _rows(tokens[start : end + 1], text) if entry_count <= BOUNDS.matrix_entries else []
    if entry_count > BOUNDS.matrix_entries or sum(map(len, rows)) > BOUNDS.matrix_entries:
        raise AnswerError(f"a matrix of more than {BOUNDS.matrix_entries} entries")
    if factors.is_transposed and len(rows) > 1 and max(map(len, rows)) > 1:
        if len(set(map(len, rows))) > 1:
            raise AnswerError(f"{quote(text)}: rows of different lengths, transposed")
        rows = [list(column) for column in zip(*rows, strict=True)]

    def read_entry(entry: Sequence[Token]) -> tuple[str, Tree]:
        """Return the text of an entry, and its tree with the factors before and after the matrix."""
        factors_and_entry = entry
        if entry and (factors.before or factors.after):
            factors_and_entry = [*factors.before, *in_brackets(entry, entry[0].at), *factors.after]
        return _typed(entry, places, text), answer_tree(factors_and_entry, vocabulary, text)

    pairs = []
    for row in rows:
        entries = [read_entry(entry) for entry in row]
        pairs.append(entries)
    return pairs


def matrix_tokens(text: str, vocabulary: Vocabulary) -> tuple[list[Token], str]:
    """Return the tokens of a formula with matrices, all of them in square brackets, and the text of their places.

    Raises
    ------
    AnswerError
        As for :func:`read_answer`.
    """
    tokens, text = _tokens(text, vocabulary)
    tokens = _unwrap(_with_column_brackets(tokens, text), text)
    while any(begins_with(tokens, k, "diag", "(") for k in range(len(tokens))):
        tokens = _with_diagonal(tokens, text)
    return tokens, text


def matrix_rows(tokens: Sequence[Token], text: str) -> list[list[list[Token]]]:
    """Return the entries of a matrix in square brackets by rows, each as its tokens.

    Raises
    ------
    AnswerError
        More than ``BOUNDS.matrix_entries``, or brackets that do not match.
    """
    if sum(token.text in (*_COLUMN_SIGNS, *_ROW_SIGNS) for token in tokens) > BOUNDS.matrix_entries:
        raise AnswerError(f"a matrix of more than {BOUNDS.matrix_entries} entries")
    return _rows(tokens, text)


def _tokens(text: str, vocabulary: Vocabulary) -> tuple[list[Token], str]:
    """Return the tokens of a text without signs at its end, and the text of their places."""
    text = _with_row_signs(without_comments(in_one_line(unicodedata.normalize("NFD", text))))
    tokens = answer_tokens(text, vocabulary)
    check_depth(tokens, text)
    while tokens and tokens[-1].text in (";", ",", "."):
        tokens.pop()
    return tokens, text


def _with_row_signs(text: str) -> str:
    """Return a text with ; where MATLAB begins a row by a new line, and without its ..."""
    if is_latex(text) or is_mathematica(text):
        return text
    lines = [line.strip() for line in re.sub(r"\.\.\.[^\n]*\n", " ", text.strip()).splitlines()]
    joined = ""
    for line in filter(None, lines):
        is_nested = joined.count("[") - joined.count("]") > 1
        joined += (" " if is_nested or joined[-1:] in (",", ";", "[", "(", "") else "; ") + line
    return joined.strip() if joined.count("[") == 1 else " ".join(lines).strip()


def _with_column_brackets(tokens: list[Token], text: str) -> list[Token]:
    """Return Maple's <a, b> as a column in brackets."""
    start = next((k for k, token in enumerate(tokens) if token.text == "<"), len(tokens))
    end = max((k for k, token in enumerate(tokens) if token.text == ">"), default=-1)
    if end < start:
        return tokens
    first = tokens[start].at
    last = tokens[end].at
    column: list[Token] = []
    for entry in _split(tokens[start + 1 : end], (",",), text):
        column += [sign(";", first), *entry]
    return [*tokens[:start], sign("[", first), *column[1:], sign("]", last), *tokens[end + 1 :]]


def _unwrap(tokens: list[Token], text: str) -> list[Token]:
    """Return Matrix(...), np.array(...) and the like as the text in their brackets; transpose(...) with a prime."""
    result: list[Token] = []
    k = 0
    while k < len(tokens):
        token = tokens[k]
        if (
            token.kind != "name"
            or token.text not in _MATRIX_WORDS
            or not begins_with(tokens, k + 1, "(")
        ):
            result.append(token)
            k += 1
            continue
        end = closing_bracket(tokens, k + 1)
        if len(result) > 1 and result[-1].text == "." and result[-2].kind == "name":
            del result[-2:]
        inner = _unwrap(tokens[k + 2 : end], text)
        pieces = _split(inner, (",",), text)
        if len(pieces) == 3 and all(
            len(size) == 1 and size[0].text.isdecimal() for size in pieces[:2]
        ):
            inner = _reshape(
                int(pieces[0][0].text[:4]), int(pieces[1][0].text[:4]), pieces[2], text
            )
        elif len(pieces) > 1 and all(piece and piece[0].text == "[" for piece in pieces):
            inner = [sign("[", token.at), *inner, sign("]", tokens[end - 1].at)]
        result += [
            sign("(", tokens[k + 1].at),
            *inner,
            sign(")", tokens[min(end, len(tokens) - 1)].at),
        ]
        result += [sign("'", token.at)] if token.text == "transpose" else []
        k = end + 1
    return result


def _reshape(rows: int, columns: int, entries: Sequence[Token], text: str) -> list[Token]:
    """Return sympy's Matrix(2, 2, [a, b, c, d]) in rows."""
    pieces = _split(entries[1:-1], (",",), text) if entries and entries[0].text == "[" else []
    if len(pieces) != rows * columns:
        raise AnswerError(
            f"{quote(text)}: {len(pieces)} entries in a matrix of {rows} times {columns}"
        )
    at = entries[0].at
    matrix: list[Token] = []
    for k, piece in enumerate(pieces):
        separator = "," if k % columns else ";"
        matrix += [sign(separator, at), *piece]
    return [sign("[", at), *matrix[1:], sign("]", entries[-1].at)]


def _with_diagonal(tokens: list[Token], text: str) -> list[Token]:
    """Return a matrix diag(a, b) that is given by its diagonal in full."""
    k = next((k for k in range(len(tokens)) if begins_with(tokens, k, "diag", "(")), None)
    if k is None:
        return tokens
    at = tokens[k].at
    end = closing_bracket(tokens, k + 1)
    inner = _strip(tokens[k + 2 : end])
    if inner and inner[0].text == "[" and inner[-1].text == "]":
        entries = list(chain.from_iterable(_rows(inner, text)))
    else:
        entries = _split(inner, (",",), text)
    if len(entries) > BOUNDS.diagonal_rows:
        raise AnswerError(f"a matrix of more than {BOUNDS.diagonal_rows} rows")
    zero = [Token("number", "0", _NOWHERE)]
    matrix: list[Token] = []
    for i, entry in enumerate(entries):
        for j in range(len(entries)):
            separator = "," if j else ";"
            matrix.append(sign(separator, at))
            matrix += entry if j == i else zero
    is_of_module = k > 1 and tokens[k - 1].text == "." and tokens[k - 2].kind == "name"
    return [
        *tokens[: k - 2 * is_of_module],
        sign("[", at),
        *matrix[1:],
        sign("]", at),
        *tokens[end + 1 :],
    ]


class _Factors(NamedTuple):
    """Factors of a matrix in brackets."""

    before: list[Token]
    """Tokens of the factors before it."""
    after: list[Token]
    """Tokens of the factors after it."""
    is_transposed: bool
    """Whether a sign after it transposes it."""


def _factors(before: list[Token], after: list[Token], text: str) -> _Factors:
    """Return the factors before and after a matrix, and whether it is transposed.

    Raises
    ------
    AnswerError
        Anything but factors: a power of a matrix is not that of its entries.
    """
    is_transposed = False
    start = 0
    end = len(before)
    while True:
        transpose = next((texts for texts in TRANSPOSES if begins_with(after, start, *texts)), None)
        if transpose is not None:
            is_transposed = not is_transposed
            start = start + len(transpose)
        elif end and before[end - 1].text == "(" and begins_with(after, start, ")"):
            start = start + 1
            end = end - 1
        else:
            break
    before = before[:end]
    after = after[start:]
    if (
        after
        and after[0].kind == "sign"
        and after[0].text not in ("*", "/", "+", "-", "(", ".*", "./", "\\,")
    ):
        fail(text, after[0].at, f"{after[0].text!r} after a matrix, which is not read,")
    if before and before[-1].text in ("^", "/", ".", "./"):
        fail(text, before[-1].at, f"{before[-1].text!r} before a matrix, which is not read,")
    for tokens in (before[1:], after):
        depths = accumulate(nesting(token.text) for token in tokens)
        for token, depth in zip(tokens, depths, strict=True):
            if depth == 0 and token.kind == "sign" and token.text in ("+", "-"):
                fail(
                    text,
                    token.at,
                    "a matrix in a sum with a number (write it into the entries that have it)",
                )
    return _Factors(before, after, is_transposed)


def _strip(tokens: list[Token]) -> list[Token]:
    """Take round brackets around a row away, and signs after it."""
    start = 0
    end = len(tokens)
    while start < end:
        if tokens[end - 1].text in (";", ",", "."):
            end -= 1
        elif tokens[start].text == "(" and closing_bracket(tokens[:end], start) == end - 1:
            start = start + 1
            end = end - 1
        else:
            break
    return tokens[start:end]


def _rows(tokens: Sequence[Token], text: str) -> list[list[list[Token]]]:
    """Split the inside of a matrix into rows of entries."""
    inner = tokens[1:-1]
    if inner and inner[0].text == "[":
        rows = [_strip(row) for row in _split(inner, (",", ";"), text)]
        for row in rows:
            if not row or row[0].text != "[" or closing_bracket(row, 0) != len(row) - 1:
                fail(
                    text,
                    row[0].at if row else inner[-1].at,
                    "a row that is not in brackets, beside rows that are,",
                )
        return [_split(row[1:-1], _COLUMN_SIGNS, text) for row in rows]
    may_have_spaces = not is_latex(text) and not is_mathematica(text)
    rows_of_entries = []
    for row in _split(inner, _ROW_SIGNS, text):
        if not row:
            continue
        if may_have_spaces and not places_outside_brackets(row, *_COLUMN_SIGNS):
            rows_of_entries.append(_split_at_spaces(row, text))
        else:
            rows_of_entries.append(_split(row, _COLUMN_SIGNS, text))
    return rows_of_entries


def _split(tokens: Sequence[Token], signs: Sequence[str], text: str) -> list[list[Token]]:
    """Split at signs that stand in no brackets; a last empty piece is dropped."""
    pieces: list[list[Token]] = [[]]
    depth = 0
    for token in tokens:
        depth += nesting(token.text)
        if depth < 0:
            fail(text, token.at, f"{token.text!r} without an opening bracket")
        if depth == 0 and token.kind == "sign" and token.text in signs:
            pieces.append([])
        else:
            pieces[-1].append(token)
    return pieces if pieces[-1] or len(pieces) == 1 else pieces[:-1]


def _split_at_spaces(row: Sequence[Token], text: str) -> list[list[Token]]:
    """Split a row of MATLAB's at spaces: [a -b] has two entries, [a - b] one."""
    pieces = [[row[0]]]
    depth = {"(": 1, ")": -1}.get(row[0].text, 0)
    for before, token in pairwise(row):
        if text[token.at - 1 : token.at].isspace() and depth == 0:
            is_function = before.text in FUNCTION_NAMES and len(before.text) > 1
            ends = not is_function and (before.kind != "sign" or before.text in (")", "'"))
            is_unary = token.text in "+-" and not text[token.at + 1 : token.at + 2].isspace()
            if ends and (is_unary or token.kind != "sign" or token.text == "("):
                pieces.append([])
        depth += {"(": 1, ")": -1}.get(token.text, 0)
        pieces[-1].append(token)
    return pieces


def _typed(entry: Sequence[Token], places: Sequence[int], text: str) -> str:
    """Return an entry as it was typed: up to where the next token after it begins."""
    if not entry or entry[0].at == _NOWHERE:
        return "".join(token.text for token in entry)
    following = bisect_right(places, entry[-1].at)
    return text[entry[0].at : places[following] if following < len(places) else len(text)].strip()
