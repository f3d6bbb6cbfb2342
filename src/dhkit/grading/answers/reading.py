"""Answers as syntax trees, in any of the notations that students write."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from dhkit.errors import AnswerError, ExpressionError
from dhkit.expressions.syntax import Call, Name, Power, Product, Sum, Token, Tree, read_tokens
from dhkit.expressions.trees import operands, with_operands
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.computer_algebra import from_mathematica, from_maxima, is_mathematica
from dhkit.grading.answers.derivatives import number, quotient, time_derivative
from dhkit.grading.answers.latex import is_latex, latex_tokens
from dhkit.grading.answers.pretty import in_one_line
from dhkit.grading.answers.rewriting import to_plain_grammar
from dhkit.grading.answers.tokens import fail, nesting, quote, split_tokens, to_ascii
from dhkit.grading.answers.vocabulary import Meaning, Vocabulary

_COMMENT = re.compile(r"(?<!\\)%(?!pi\b|e\b|i\b|\s*$).*|#.*")
"""A comment after an answer, such as its unit: % N m."""

_STORAGE = re.compile(r",\s*storage\s*=\s*rectangular\s*(?=\)\s*$)")
"""Option that sympy's maple_code adds to a matrix."""


_BAR = re.compile(r"-{2,}")

_JOINED = re.compile(r"(?:[-+*/^(,;=\[{&]|\.\.\.|\\)\s*\n|\n\s*(?:[-+*/^),;=\]}&.]|\Z)")
"""A line's end that an operator, or a bracket, joins to the next line."""

_TWO_ARGUMENTS = ("atan2", "atan2d", "hypot", "pow", "Rational", "min", "max")
_RECIPROCALS = {"sec": "cos", "csc": "sin", "cot": "tan"}


def read_answer(text: str, vocabulary: Vocabulary) -> Tree:
    """Read an expression in Python's, MATLAB's, sympy's or LaTeX notation.

    The shorthand c1, s12 for cos(q1), sin(q1 + q2) is understood in all of them.

    Parameters
    ----------
    text
        The student's text; it is never evaluated.
    vocabulary
        Meanings of names.

    Returns
    -------
    Tree
        In the robot's own names: q1, qd1, qdd1, the file's parameters, pi.

    Raises
    ------
    AnswerError
        No expression, an unknown name, or more than the limits allow; with the place.
    """
    text = in_one_line(unicodedata.normalize("NFD", text))
    _refuse_lines_apart(text)
    return answer_tree(answer_tokens(text, vocabulary), vocabulary, text)


def meaning_of(text: str, vocabulary: Vocabulary) -> Meaning:
    """Return the tokens that a student's own name stands for, in brackets.

    Raises
    ------
    AnswerError
        As for :func:`read_answer`.
    """
    read_answer(text, vocabulary)
    plain = to_plain_grammar(answer_tokens(text, vocabulary), vocabulary, text)
    if len(plain) > BOUNDS.meaning_tokens:
        raise AnswerError(
            f"written out, {len(plain)} signs; expected at most {BOUNDS.meaning_tokens}"
        )
    return ("(", *(token.text for token in plain), ")")


def _refuse_lines_apart(text: str) -> None:
    """Refuse a formula whose lines do not follow one another: a power or a denominator may stand above or below.

    Raises
    ------
    AnswerError
        A bar of dashes, or two lines that no operator joins, outside brackets.
    """
    text = text.strip()
    if "\n" not in text or is_latex(text) or is_mathematica(text):
        return
    plain = re.sub(r"\s*\n\s*", "\n", _COMMENT.sub("", text).strip())
    depth = 0
    joined = {match.start() + match[0].index("\n") for match in _JOINED.finditer(plain)}
    for at, character in enumerate(plain):
        depth += nesting(character)
        is_apart = character == "\n" and depth <= 0 and at not in joined
        if is_apart or _BAR.match(plain, at):
            raise AnswerError(
                f"{quote(text)}: lines that no operator joins; print the formula in one line, with str()"
            )


def answer_tokens(text: str, vocabulary: Vocabulary) -> list[Token]:
    """Return the tokens of an answer, those of LaTeX and of computer algebra in the notation of all others."""
    plain, places = to_ascii(text)
    plain = without_comments(plain)
    if is_mathematica(plain):
        plain = plain.partition("//")[0]
        return from_mathematica(split_tokens(plain, places, text, allowed="{}\\"), text)
    if is_latex(plain):
        return latex_tokens(plain, vocabulary.knows)
    return from_maxima(split_tokens(_STORAGE.sub("", plain), places, text, allowed="{}%$@"))


def answer_tree(entry: Sequence[Token], vocabulary: Vocabulary, text: str) -> Tree:
    """Return the tree of an entry's tokens.

    Raises
    ------
    AnswerError
        As for :func:`read_answer`.
    """
    end = len(entry)
    while end and entry[end - 1].text in (",", ";", "."):
        end -= 1
    plain = to_plain_grammar(entry[:end], vocabulary, text)
    for token in plain:
        if token.kind == "sign" and token.text not in "+-*/^(),":
            fail(text, token.at, f"unexpected {token.text!r}")
    try:
        return _in_plain_functions(read_tokens(plain, text))
    except ExpressionError as error:
        raise AnswerError(str(error)) from None


def without_comments(text: str) -> str:
    """Return a text with spaces for the comments at the ends of its lines."""
    return _COMMENT.sub(lambda match: " " * len(match[0]), text)


# Functions that are written in terms of others


def _in_plain_functions(tree: Tree) -> Tree:
    """Return a tree without secants, degrees and the like."""
    plain = with_operands(tree, [_in_plain_functions(part) for part in operands(tree)])
    return (
        _plain_call(plain.function, plain.arguments, plain.at) if isinstance(plain, Call) else plain
    )


def _plain_call(function: str, arguments: tuple[Tree, ...], at: int) -> Tree:
    if function == "atan" and len(arguments) == 2:
        function = "atan2"  # Maple's arctan(y, x)
    if function == "Rational" and len(arguments) == 1:
        return arguments[0]
    expected = 1 + (function in _TWO_ARGUMENTS)
    if len(arguments) != expected:
        raise AnswerError(
            f"{function} of {len(arguments)} arguments at position {at + 1}; expected {expected}"
        )
    first = arguments[0]
    match function:
        case "sec" | "csc" | "cot":
            return quotient(number(1, at), Call(_RECIPROCALS[function], (first,), at))
        case "ddt":
            return time_derivative(first)
        case "sind" | "cosd" | "tand":
            return Call(function[:3], (_radians(first, at),), at)
        case "asind" | "acosd" | "atand" | "atan2d":
            return _degrees(Call(function[:-1], arguments, at), at)
        case "radians":
            return _radians(first, at)
        case "degrees":
            return _degrees(first, at)
        case "hypot":
            squares = tuple((True, Power(side, number(2, at), at)) for side in arguments)
            return Call("sqrt", (Sum(squares),), at)
        case "Rational":
            return quotient(first, arguments[1])
        case "number":
            return first
        case "pow":
            return Power(first, arguments[1], at)
        case "square":
            return Power(first, number(2, at), at)
    return Call(function, arguments, at)


def _degrees(angle: Tree, at: int) -> Tree:
    return Product(((True, angle), (True, number(180, at)), (False, Name("pi", at))))


def _radians(angle: Tree, at: int) -> Tree:
    return Product(((True, angle), (True, Name("pi", at)), (False, number(180, at))))
