"""Sums, products, transposes and powers of matrices in one text: M1 + m2*[a, b; b, c], J'*M*J, A1*A2, Y*theta.

The grammar is that of :mod:`dhkit.expressions.syntax`, with matrices among the factors of a product::

    sum     = product (("+" | "-") product)*
    product = factor (("*" | "/" | nothing) factor)*
    factor  = (matrix | "(" sum with a matrix ")" | name of a matrix) (transpose | "^" number)*
            | formula of numbers

A vector of one row in a place where only a column fits is a column.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import chain
from typing import TypeAlias

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Number, Product, Sum, Token, Tree
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.latex import is_latex
from dhkit.grading.answers.matrices import TRANSPOSES, matrix_rows, matrix_tokens
from dhkit.grading.answers.reading import answer_tree
from dhkit.grading.answers.tokens import begins_with, closing_bracket, fail, nesting, quote
from dhkit.grading.answers.vocabulary import Vocabulary

Rows: TypeAlias = list[list[Tree]]
"""A matrix by rows."""
_Value: TypeAlias = Tree | Rows
"""A number, or a matrix."""
MatrixOf: TypeAlias = Callable[[str], Rows | None]
"""Matrix that a name stands for; None for another name."""

_TIMES = ("*", "@", "\\,")
_OVER = ("/",)
_NUMPY = re.compile(r"\b(?:np|numpy)\b|\barray\s*\(")
"""Text in numpy's notation, in which * multiplies matrices entry by entry."""


def no_names(name: str) -> Rows | None:
    """Return None: no name stands for a matrix."""
    del name
    return None


def is_algebra(text: str, vocabulary: Vocabulary, matrix_of: MatrixOf = no_names) -> bool:
    """Whether a text has more than one matrix, a power of one, or names of matrices."""
    try:
        tokens, _ = matrix_tokens(text, vocabulary)
    except AnswerError:
        return False
    outermost = 0
    is_power = False
    k = 0
    while k < len(tokens):
        if _is_named_matrix(tokens, k, matrix_of):
            return True
        if not _begins_matrix(tokens, k, text):
            k += 1
            continue
        outermost += 1
        k = closing_bracket(tokens, k) + 1
        is_power |= (
            begins_with(tokens, k, "^") and k + 1 < len(tokens) and tokens[k + 1].kind == "number"
        )
    return outermost > 1 or is_power


def _begins_matrix(tokens: Sequence[Token], k: int, text: str) -> bool:
    """Whether the bracket at k encloses a matrix: q[0] is an index, and Sin[q1[t]] a call of Mathematica's."""
    if tokens[k].text != "[":
        return False
    before = tokens[k - 1] if k else None
    is_behind_operand = before is not None and (
        before.kind == "name" or before.text in ("'", ")", "]")
    )
    return not is_behind_operand or is_latex(text)


def _is_named_matrix(tokens: Sequence[Token], k: int, matrix_of: MatrixOf) -> bool:
    """Whether the token at k is the name of a whole matrix, and not of one of its entries, as in qd(1)."""
    if tokens[k].kind != "name" or matrix_of(tokens[k].text) is None:
        return False
    is_before_bracket = begins_with(tokens, k + 1, "(") or begins_with(tokens, k + 1, "[")
    return not is_before_bracket or _end_of_arguments(tokens, k, matrix_of) > k + 1


def _end_of_arguments(tokens: Sequence[Token], k: int, matrix_of: MatrixOf) -> int:
    """Return the place after the name at k and its arguments, if it has any, as in M(q) and C(q, qd)."""
    if not begins_with(tokens, k + 1, "("):
        return k + 1
    end = closing_bracket(tokens, k + 1)
    arguments = tokens[k + 2 : end]
    are_vectors = all(
        x.text == "," or (x.kind == "name" and matrix_of(x.text) is not None) for x in arguments
    )
    return end + 1 if arguments and are_vectors else k + 1


def read_algebra(text: str, vocabulary: Vocabulary, matrix_of: MatrixOf = no_names) -> Rows:
    """Read a formula with matrices; a number is one row of one entry.

    Parameters
    ----------
    text
        The student's text; it is never evaluated.
    vocabulary
        Meanings of names.
    matrix_of
        Which names stand for matrices.

    Returns
    -------
    Rows
        Entries by rows, which share what is used several times.

    Raises
    ------
    AnswerError
        Sizes that do not fit, an operation that matrices do not have, or a formula that cannot be read.
    """
    tokens, plain = matrix_tokens(text, vocabulary)
    return _as_matrix(_MatrixReader(vocabulary, plain, matrix_of).value(tokens))


class _MatrixReader:
    def __init__(self, vocabulary: Vocabulary, text: str, matrix_of: MatrixOf) -> None:
        self.vocabulary = vocabulary
        self.text = text
        self.matrix_of = matrix_of
        self.products = 0
        self.chain = 0

    def value(self, tokens: Sequence[Token]) -> _Value:
        """Return the value of a sum."""
        terms = [(added, self._product(term)) for added, term in self._terms(tokens)]
        if len(terms) == 1 and terms[0][0]:
            return terms[0][1]
        if not any(isinstance(value, list) for _, value in terms):
            return Sum(
                tuple((added, value) for added, value in terms if not isinstance(value, list))
            )
        matrices = [(added, _as_matrix(value)) for added, value in terms]
        sizes = {_size(rows) for _, rows in matrices}
        if len(sizes) > 1 and _are_vectors(sizes):
            matrices = [(added, _as_column(rows)) for added, rows in matrices]
            sizes = {_size(rows) for _, rows in matrices}
        if len(sizes) > 1:
            found = " and ".join(f"{m} x {n}" for m, n in sorted(sizes))
            is_gravity = any(token.text == "g" for token in tokens) and (1, 1) in sizes
            hint = "; g is the parameter, write G for the answer to g" if is_gravity else ""
            raise AnswerError(f"{quote(self.text)}: a sum of matrices of {found}{hint}")
        ((m, n),) = sizes
        total: Rows = []
        for i in range(m):
            row: list[Tree] = []
            for j in range(n):
                entries = tuple((added, rows[i][j]) for added, rows in matrices)
                row.append(Sum(entries))
            total.append(row)
        return total

    def _terms(self, tokens: Sequence[Token]) -> list[tuple[bool, list[Token]]]:
        """Split a sum at the signs between its terms: each is added or subtracted."""
        terms: list[tuple[bool, list[Token]]] = [(True, [])]
        depth = 0
        for token in tokens:
            depth += nesting(token.text)
            added, term = terms[-1]
            is_sign = depth == 0 and token.kind == "sign" and token.text in "+-"
            if is_sign and not term:
                terms[-1] = added == (token.text == "+"), term
            elif is_sign and not (
                term[-1].kind == "sign" and term[-1].text in (*_TIMES, *_OVER, "^")
            ):
                terms.append((token.text == "+", []))
            else:
                term.append(token)
        if not terms[-1][1]:
            raise AnswerError(f"{quote(self.text)}: ends where a term is expected")
        return terms

    def _product(self, tokens: Sequence[Token]) -> _Value:
        """Return the value of a product."""
        result: _Value | None = None
        run: list[Token] = []
        k = 0
        while k < len(tokens):
            token = tokens[k]
            end = closing_bracket(tokens, k) if token.text in ("[", "(") else k
            if _is_named_matrix(tokens, k, self.matrix_of):
                end = _end_of_arguments(tokens, k, self.matrix_of) - 1
            inside = tokens[k : end + 1]
            matrix = self._matrix(tokens, k, inside)
            if matrix is None:
                run += inside
                k = end + 1
                continue
            self._refuse_entrywise(result, run, matrix)
            result = self._times(result, self._numbers(run, is_before_matrix=True))
            run = []
            matrix, k = self._with_postfix(matrix, tokens, end + 1)
            result = self._times(result, matrix)
        result = self._times(result, self._numbers(run, is_before_matrix=False))
        if result is None:
            raise AnswerError(f"{quote(self.text)}: a term is empty")
        return result

    def _matrix(self, tokens: Sequence[Token], k: int, inside: Sequence[Token]) -> _Value | None:
        """Return the value of the factor at k if it is, or contains, a matrix; None of numbers."""
        first = tokens[k]
        if _begins_matrix(tokens, k, self.text):
            rows: Rows = []
            for row in matrix_rows(inside, self.text):
                entries = [self._entry(entry, first) for entry in row]
                rows.append(entries)
            if len(set(map(len, rows))) != 1:
                fail(self.text, first.at, "a matrix whose rows have different lengths")
            return rows
        if first.text == "(" and self._contains_matrix(inside):
            return self.value(inside[1:-1])
        return self.matrix_of(first.text) if _is_named_matrix(tokens, k, self.matrix_of) else None

    def _contains_matrix(self, tokens: Sequence[Token]) -> bool:
        places = range(len(tokens))
        return any(
            _begins_matrix(tokens, k, self.text) or _is_named_matrix(tokens, k, self.matrix_of)
            for k in places
        )

    def _entry(self, entry: Sequence[Token], first: Token) -> Tree:
        if not entry:
            fail(self.text, first.at, "a matrix with an empty entry")
        return answer_tree(entry, self.vocabulary, self.text)

    def _with_postfix(self, value: _Value, tokens: Sequence[Token], k: int) -> tuple[_Value, int]:
        """Return a factor with the transposes and powers after it, and where they end."""
        before = tokens[k - 1]
        if (
            begins_with(tokens, k, "'")
            and before.kind == "name"
            and self.vocabulary.is_position(f"{before.text}1")
        ):
            name = before.text
            fail(
                self.text,
                before.at,
                f"{name}' may be the transpose of {name} or its rate; write transpose({name}): it",
            )
        while k < len(tokens):
            transpose = next(
                (texts for texts in TRANSPOSES if begins_with(tokens, k, *texts)), None
            )
            if transpose is not None and isinstance(value, list):
                value = [list(column) for column in zip(*value, strict=True)]
                k += len(transpose)
            elif tokens[k].text == "^":
                power = tokens[k + 1] if k + 1 < len(tokens) else tokens[k]
                if self._is_entrywise(tokens[k]):
                    fail(
                        self.text,
                        tokens[k].at,
                        "'.^' raises entry by entry; write ^ for the power of the matrix: it",
                    )
                if (
                    power.kind != "number"
                    or not power.text.isdecimal()
                    or not 1 <= int(power.text[:3]) <= BOUNDS.matrix_power
                ):
                    fail(
                        self.text,
                        tokens[k].at,
                        "a power of a matrix that is not a small whole number",
                    )
                base = value
                result = value
                for _ in range(int(power.text) - 1):
                    result = self._times(result, base) or result
                value = result
                k = k + 2
            else:
                break
        return value, k

    def _refuse_entrywise(self, left: _Value | None, signs: Sequence[Token], right: _Value) -> None:
        """Refuse * between numpy's arrays, and signs of products entry by entry."""
        if left is None or _is_number(left) or _is_number(right):
            return
        is_of_numpy = [token.text for token in signs] == ["*"] and _NUMPY.search(self.text)
        if is_of_numpy or (len(signs) == 1 and self._is_entrywise(signs[0])):
            fail(
                self.text,
                signs[0].at,
                f"{signs[0].text!r} multiplies entry by entry; write @ for the product: it",
            )

    def _is_entrywise(self, token: Token) -> bool:
        """Whether a sign was typed with MATLAB's dot: .* and .^ are those of entries."""
        return self.text[token.at : token.at + 1] == "."

    def _numbers(self, run: Sequence[Token], is_before_matrix: bool) -> Tree | None:
        """Return the factor of the numbers between matrices, with the signs beside them; None if there is none."""
        run = list(run)
        if run and run[0].text in _TIMES:
            del run[0]
        elif run and run[0].text in _OVER:
            run.insert(0, Token("number", "1", run[0].at))
        if is_before_matrix and run and run[-1].text in _TIMES:
            del run[-1]
        elif run and run[-1].text in _OVER:
            fail(self.text, run[-1].at, "a division by a matrix")
        return answer_tree(run, self.vocabulary, self.text) if run else None

    def _times(self, left: _Value | None, right: _Value | None) -> _Value | None:
        """Return a product; None stands for nothing."""
        if left is None or right is None:
            return right if left is None else left
        if not isinstance(left, list) and not isinstance(right, list):
            return Product(((True, left), (True, right)))
        if _is_number(left) or _is_number(right):
            number, rows = (left, right) if _is_number(left) else (right, left)
            factor = number[0][0] if isinstance(number, list) else number
            return _scaled(factor, _as_matrix(rows))
        return self._product_of(_as_matrix(left), _as_matrix(right))

    def _product_of(self, left: Rows, right: Rows) -> Rows:
        if len(left[0]) != len(right) and len(right) == 1 and len(right[0]) == len(left[0]):
            right = _as_column(right)
        if len(left[0]) != len(right):
            m, n = _size(left)
            p, q = _size(right)
            raise AnswerError(
                f"{quote(self.text)}: a product of matrices of {m} x {n} and {p} x {q}"
            )
        self.chain += 1
        self.products += len(left) * len(right) * len(right[0])
        if self.chain > BOUNDS.matrix_products or self.products > BOUNDS.entry_products:
            raise AnswerError(
                f"{quote(self.text)}: more than {BOUNDS.matrix_products} products of matrices, or too large ones"
            )
        columns = list(zip(*right, strict=True))
        product: Rows = []
        for row in left:
            entries = [_dot(row, column) for column in columns]
            product.append(entries)
        return product


def _scaled(factor: Tree, matrix: Rows) -> Rows:
    """Return a number times a matrix."""
    scaled: Rows = []
    for row in matrix:
        entries: list[Tree] = [Product(((True, factor), (True, entry))) for entry in row]
        scaled.append(entries)
    return scaled


def _dot(row: Sequence[Tree], column: Sequence[Tree]) -> Tree:
    """Return sum_k row_k column_k, without the products that are zero."""
    terms = tuple(
        (True, Product(((True, a), (True, b))))
        for a, b in zip(row, column, strict=True)
        if not _is_zero(a) and not _is_zero(b)
    )
    return Sum(terms) if terms else Number(Fraction(0), "0", 0)


def _is_zero(tree: Tree) -> bool:
    return isinstance(tree, Number) and tree.value == 0


def _is_number(value: _Value) -> bool:
    return not isinstance(value, list) or _size(value) == (1, 1)


def _as_matrix(value: _Value) -> Rows:
    return value if isinstance(value, list) else [[value]]


def _as_column(rows: Rows) -> Rows:
    return [[entry] for entry in chain.from_iterable(rows)]


def _are_vectors(sizes: set[tuple[int, int]]) -> bool:
    """Whether sizes are those of rows and columns of equal length."""
    return all(min(size) == 1 for size in sizes) and len({m * n for m, n in sizes}) == 1


def _size(rows: Rows) -> tuple[int, int]:
    return len(rows), len(rows[0])
