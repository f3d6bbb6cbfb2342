"""Matrices and vectors in one text, in any of the notations that students write."""

from __future__ import annotations

import re
import unicodedata
from bisect import bisect_right
from collections.abc import Sequence

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Token, Tree
from dhkit.grading.answers.computer_algebra import is_mathematica
from dhkit.grading.answers.latex import is_latex
from dhkit.grading.answers.pretty import in_one_line
from dhkit.grading.answers.reading import answer_tokens, answer_tree, without_comments
from dhkit.grading.answers.tokens import check_depth, closing_bracket, fail, nesting, shown
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Vocabulary

MATRIX_WORDS = frozenset(
    ("sym", "Matrix", "array", "matrix", "simplify", "transpose", "MutableDenseMatrix", "ImmutableMatrix", "DM", "SX")
)
TRANSPOSES = (["'"], [".'"], [".", "T"], ["^", "T"], ["^", "top"], ["^", "(", "T", ")"], ["^", "(", "top", ")"])
"""Signs of a transpose, in tokens."""
NOWHERE = -1
"""Where the zeros beside a diagonal stand."""
MAX_DIAGONAL = 30
"""Rows of a matrix that is given by its diagonal: arms have fewer joints."""
MAX_ENTRIES = 1_024


def read_matrix(text: str, vocabulary: Vocabulary) -> list[list[tuple[str, Tree]]]:
    """Read a matrix or a vector out of one text: [[a, b], [c, d]], [a, b; c, d], Matrix([...]) or pmatrix.

    Returns
    -------
    list
        Rows of pairs: an entry's text, and its tree; a vector is a column or a row, as it was written.

    Raises
    ------
    AnswerError
        As for :func:`read_answer`, or no matrix.
    """
    text = _in_rows(without_comments(in_one_line(unicodedata.normalize("NFD", text))))
    found = answer_tokens(text, vocabulary)
    check_depth(found, text)
    while found and found[-1].text in (";", ",", "."):
        found.pop()
    places = [token.at for token in found]
    found = _with_diagonals(_unwrapped(_maples_column(found, text), text), text)
    start, end = _matrix_in(found, text)
    before, after, is_transposed = _around(found[:start], found[end + 1 :], text)
    if sum(token.text in (",", ";", "&", "\\\\") for token in found) > MAX_ENTRIES:
        raise AnswerError(f"a matrix of more than {MAX_ENTRIES} entries")
    rows = _rows(found[start : end + 1], text)
    if sum(map(len, rows)) > MAX_ENTRIES:
        raise AnswerError(f"a matrix of more than {MAX_ENTRIES} entries")
    if is_transposed and len(rows) > 1 and max(map(len, rows)) > 1:
        if len(set(map(len, rows))) > 1:
            raise AnswerError(f"{shown(text)}: rows of different lengths, transposed")
        rows = [list(column) for column in zip(*rows, strict=True)]
    return [
        [(_written(entry, places, text), answer_tree(_scaled(before, entry, after), vocabulary, text)) for entry in row]
        for row in rows
    ]


def _in_rows(text: str) -> str:
    """Return a text with ; where MATLAB begins a row by a new line, and without its ..."""
    if is_latex(text) or is_mathematica(text):
        return text
    lines = [line.strip() for line in re.sub(r"\.\.\.[^\n]*\n", " ", text.strip()).splitlines()]
    joined = ""
    for line in filter(None, lines):
        nested = joined.count("[") - joined.count("]") > 1
        joined += (" " if nested or joined[-1:] in (",", ";", "[", "(", "") else "; ") + line
    return joined.strip() if joined.count("[") == 1 else " ".join(lines).strip()


def _matrix_in(found: Sequence[Token], text: str) -> tuple[int, int]:
    """Return where the one matrix of a text begins and ends; a factor may stand before or behind it."""
    opening = [k for k, token in enumerate(found) if token.text == "["]
    end = max((k for k, token in enumerate(found) if token.text == "]"), default=-1)
    if not opening or end < opening[0]:
        raise AnswerError(f"expected a matrix in brackets, found {text[:60]!r}")
    return opening[0], end


def _maples_column(found: list[Token], text: str) -> list[Token]:
    """Return Maple's <a, b> as a column in brackets."""
    opening = next((k for k, token in enumerate(found) if token.text == "<"), None)
    closing = next((k for k in range(len(found) - 1, -1, -1) if found[k].text == ">"), -1)
    if opening is None or closing < opening:
        return found
    rows = _separated(found[opening + 1 : closing], (",",), text)
    first, last = found[opening].at, found[closing].at
    column = [token for row in rows for token in (Token("sign", ";", first), *row)]
    inside = [Token("sign", "[", first), *column[1:], Token("sign", "]", last)]
    return [*found[:opening], *inside, *found[closing + 1 :]]


def _unwrapped(found: list[Token], text: str) -> list[Token]:
    """Return Matrix(...), np.array(...) and the like as what is in their brackets; transpose(...) with a prime."""
    result: list[Token] = []
    k = 0
    while k < len(found):
        token = found[k]
        is_matrix = token.kind == "name" and token.text in MATRIX_WORDS and found[k + 1 : k + 2] != []
        if not is_matrix or found[k + 1].text != "(":
            result.append(token)
            k += 1
            continue
        end = closing_bracket(found, k + 1)
        if len(result) > 1 and result[-1].text == "." and result[-2].kind == "name":
            del result[-2:]
        inner = _unwrapped(found[k + 2 : end], text)
        pieces = _separated(inner, (",",), text)
        if len(pieces) == 3 and all(len(size) == 1 and size[0].text.isdecimal() for size in pieces[:2]):
            inner = _shaped(int(pieces[0][0].text[:4]), int(pieces[1][0].text[:4]), pieces[2], text)
        elif len(pieces) > 1 and all(piece and piece[0].text == "[" for piece in pieces):
            inner = [Token("sign", "[", token.at), *inner, Token("sign", "]", found[end - 1].at)]
        result += [Token("sign", "(", found[k + 1].at), *inner, Token("sign", ")", found[min(end, len(found) - 1)].at)]
        result += [Token("sign", "'", token.at)] if token.text == "transpose" else []
        k = end + 1
    return result


def _shaped(rows: int, columns: int, entries: Sequence[Token], text: str) -> list[Token]:
    """Return sympy's Matrix(2, 2, [a, b, c, d]) in rows."""
    pieces = _separated(entries[1:-1], (",",), text) if entries and entries[0].text == "[" else []
    if len(pieces) != rows * columns:
        raise AnswerError(f"{shown(text)}: {len(pieces)} entries in a matrix of {rows} times {columns}")
    at, shaped = entries[0].at, list[Token]()
    for k, piece in enumerate(pieces):
        shaped += [Token("sign", "," if k % columns else ";", at), *piece]
    return [Token("sign", "[", at), *shaped[1:], Token("sign", "]", entries[-1].at)]


def _with_diagonals(found: list[Token], text: str) -> list[Token]:
    """Return a matrix diag(a, b) that is given by its diagonal in full."""
    k = next((k for k, token in enumerate(found[:-1]) if token.text == "diag" and found[k + 1].text == "("), None)
    if k is None:
        return found
    at, end = found[k].at, closing_bracket(found, k + 1)
    inner = _stripped(found[k + 2 : end])
    if inner and inner[0].text == "[" and inner[-1].text == "]":
        entries = [entry for row in _rows(inner, text) for entry in row]
    else:
        entries = _separated(inner, (",",), text)
    if len(entries) > MAX_DIAGONAL:
        raise AnswerError(f"a matrix of more than {MAX_DIAGONAL} rows")
    zero, comma, semicolon = Token("number", "0", NOWHERE), Token("sign", ",", at), Token("sign", ";", at)
    matrix: list[Token] = []
    for i, entry in enumerate(entries):
        for j in range(len(entries)):
            matrix += [comma if j else semicolon, *(entry if j == i else [zero])]
    before = found[: k - 2] if k > 1 and found[k - 1].text == "." and found[k - 2].kind == "name" else found[:k]
    return [*before, Token("sign", "[", at), *matrix[1:], Token("sign", "]", at), *found[end + 1 :]]


def _around(before: list[Token], after: list[Token], text: str) -> tuple[list[Token], list[Token], bool]:
    """Return the factors before and behind a matrix, and whether it is transposed.

    Raises
    ------
    AnswerError
        Anything but factors: a power of a matrix is not that of its entries.
    """
    is_transposed, start, end = False, 0, len(before)
    while True:
        behind = [token.text for token in after[start : start + 4]]
        sign = next((sign for sign in TRANSPOSES if behind[: len(sign)] == sign), None)
        if sign is not None:
            is_transposed, start = not is_transposed, start + len(sign)
        elif end and behind and before[end - 1].text == "(" and behind[0] == ")":
            start, end = start + 1, end - 1
        else:
            break
    before, after = before[:end], after[start:]
    if after and after[0].kind == "sign" and after[0].text not in ("*", "/", "+", "-", "(", ".*", "./", "\\,"):
        fail(text, after[0].at, f"{after[0].text!r} behind a matrix, which is not read,")
    if before and before[-1].text in ("^", "/", ".", "./"):
        fail(text, before[-1].at, f"{before[-1].text!r} before a matrix, which is not read,")
    return before, after, is_transposed


def _scaled(before: Sequence[Token], entry: Sequence[Token], after: Sequence[Token]) -> list[Token]:
    """Return an entry with the factors of its matrix."""
    if (not before and not after) or not entry:
        return list(entry)
    at = entry[0].at
    return [*before, Token("sign", "(", at), *entry, Token("sign", ")", at), *after]


def _stripped(found: list[Token]) -> list[Token]:
    """Take round brackets around a row away, and signs behind it."""
    low, high = 0, len(found)
    while low < high:
        if found[high - 1].text in (";", ",", "."):
            high -= 1
        elif found[low].text == "(" and closing_bracket(found[:high], low) == high - 1:
            low, high = low + 1, high - 1
        else:
            break
    return found[low:high]


def _rows(found: Sequence[Token], text: str) -> list[list[list[Token]]]:
    """Split the inside of a matrix into rows of entries."""
    inner = found[1:-1]
    if inner and inner[0].text == "[":
        rows = [_stripped(list(row)) for row in _separated(inner, (",", ";"), text)]
        for row in rows:
            if not row or row[0].text != "[" or closing_bracket(row, 0) != len(row) - 1:
                fail(text, row[0].at if row else inner[-1].at, "a row that is not in brackets, beside rows that are,")
        return [_separated(row[1:-1], (",", "&"), text) for row in rows]
    rows = _separated(inner, (";", "\\\\"), text)
    spaced = not is_latex(text) and not is_mathematica(text)
    return [
        _by_spaces(row, text) if spaced and not _has(row, ",&") else _separated(row, (",", "&"), text)
        for row in rows
        if row
    ]


def _has(row: Sequence[Token], signs: str) -> bool:
    depth = 0
    for token in row:
        depth += nesting(token.text)
        if depth == 0 and token.kind == "sign" and token.text in signs:
            return True
    return False


def _separated(found: Sequence[Token], signs: Sequence[str], text: str) -> list[list[Token]]:
    """Split at signs that stand in no brackets; a last empty piece is dropped."""
    pieces: list[list[Token]] = [[]]
    depth = 0
    for token in found:
        depth += nesting(token.text)
        if depth < 0:
            fail(text, token.at, f"{token.text!r} without an opening bracket")
        if depth == 0 and token.kind == "sign" and token.text in signs:
            pieces.append([])
        else:
            pieces[-1].append(token)
    return pieces if pieces[-1] or len(pieces) == 1 else pieces[:-1]


def _by_spaces(row: Sequence[Token], text: str) -> list[list[Token]]:
    """Split a row of MATLAB's at spaces: [a -b] has two entries, [a - b] one."""
    pieces: list[list[Token]] = [[]]
    depth = 0
    for before, token in zip([None, *row], row, strict=False):
        spaced = text[token.at - 1 : token.at].isspace() and depth == 0
        if before is not None and spaced:
            is_function = before.text in FUNCTION_NAMES and len(before.text) > 1
            ends = not is_function and (before.kind != "sign" or before.text in (")", "'"))
            unary = token.text in "+-" and not text[token.at + 1 : token.at + 2].isspace()
            if ends and (unary or token.kind != "sign" or token.text == "("):
                pieces.append([])
        depth += {"(": 1, ")": -1}.get(token.text, 0)
        pieces[-1].append(token)
    return pieces


def _written(entry: Sequence[Token], places: Sequence[int], text: str) -> str:
    """Return an entry as it was typed: up to where the next token after it begins."""
    if not entry or entry[0].at == NOWHERE:
        return "".join(token.text for token in entry)
    behind = bisect_right(places, entry[-1].at)
    return text[entry[0].at : places[behind] if behind < len(places) else len(text)].strip()
