"""Answers as syntax trees, in any of the notations that students write."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from fractions import Fraction

from dhkit.errors import AnswerError, ExpressionError
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Token, Tree, read_tokens
from dhkit.grading.answers.computer_algebra import from_mathematica, from_maxima, is_mathematica
from dhkit.grading.answers.derivatives import time_derivative
from dhkit.grading.answers.latex import is_latex, latex_tokens
from dhkit.grading.answers.pretty import in_one_line
from dhkit.grading.answers.rewriting import rewritten
from dhkit.grading.answers.tokens import fail, folded, nesting, shown, tokens
from dhkit.grading.answers.vocabulary import Meaning, Vocabulary

COMMENT = re.compile(r"(?<!\\)%(?!pi\b|e\b|i\b|\s*$).*|#.*")
"""A comment behind an answer, such as its unit: % N m."""
STORAGE = re.compile(r",\s*storage\s*=\s*rectangular\s*(?=\)\s*$)")
"""What sympy's maple_code adds to a matrix."""
MAX_MEANING = 20_000
"""Tokens of what a student's own name stands for, the names in it written out."""


def read_answer(text: str, vocabulary: Vocabulary) -> Tree:
    """Read an expression in Python's, MATLAB's, sympy's or LaTeX notation, or in the shorthand of the field.

    Parameters
    ----------
    text
        What a student typed; never evaluated.
    vocabulary
        What names mean.

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
    plain = rewritten(answer_tokens(text, vocabulary), vocabulary, text)
    if len(plain) > MAX_MEANING:
        raise AnswerError(f"written out, {len(plain)} signs; expected at most {MAX_MEANING}")
    return ("(", *(token.text for token in plain), ")")


BAR = re.compile(r"-{2,}")
JOINED = re.compile(r"(?:[-+*/^(,;=\[{&]|\.\.\.|\\)\s*\n|\n\s*(?:[-+*/^),;=\]}&.]|\Z)")
"""A line's end that an operator, or a bracket, joins to the next line."""


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
    plain = re.sub(r"\s*\n\s*", "\n", COMMENT.sub("", text).strip())
    depth, ends = 0, {found.start() + found[0].index("\n") for found in JOINED.finditer(plain)}
    for at, character in enumerate(plain):
        depth += nesting(character)
        apart = character == "\n" and depth <= 0 and at not in ends
        if apart or BAR.match(plain, at):
            raise AnswerError(f"{shown(text)}: lines that no operator joins; print the formula in one line, with str()")


def answer_tokens(text: str, vocabulary: Vocabulary) -> list[Token]:
    """Return the tokens of an answer, those of LaTeX and of computer algebra in the notation of all others."""
    plain, places = folded(text)
    plain = without_comments(plain)
    if is_mathematica(plain):
        plain = plain.partition("//")[0]
        return from_mathematica(tokens(plain, places, text, allowed="{}\\"), text)
    if is_latex(plain):
        return latex_tokens(plain, vocabulary.knows)
    return from_maxima(tokens(STORAGE.sub("", plain), places, text, allowed="{}%$"))


def answer_tree(found: Sequence[Token], vocabulary: Vocabulary, text: str) -> Tree:
    """Return the tree of an entry's tokens."""
    end = len(found)
    while end and found[end - 1].text in (",", ";", "."):
        end -= 1
    plain = rewritten(found[:end], vocabulary, text)
    for token in plain:
        if token.kind == "sign" and token.text not in "+-*/^(),":
            fail(text, token.at, f"unexpected {token.text!r}")
    try:
        return _known(read_tokens(plain, text))
    except ExpressionError as error:
        raise AnswerError(str(error)) from None


def without_comments(text: str) -> str:
    """Return a text with spaces for the comments at the ends of its lines."""
    return COMMENT.sub(lambda found: " " * len(found[0]), text)


# Functions that are written out in others


def _known(tree: Tree) -> Tree:
    """Return a tree without secants, degrees and the like."""
    match tree:
        case Number() | Name():
            return tree
        case Power(base, exponent, at):
            return Power(_known(base), _known(exponent), at)
        case Sum(terms):
            return Sum(tuple((added, _known(term)) for added, term in terms))
        case Product(factors):
            return Product(tuple((multiplied, _known(factor)) for multiplied, factor in factors))
        case Call(function, arguments, at):
            return _call(function, tuple(_known(argument) for argument in arguments), at)


def _call(function: str, arguments: tuple[Tree, ...], at: int) -> Tree:
    if function == "atan" and len(arguments) == 2:
        function = "atan2"  # Maple's arctan(y, x)
    two = function in ("atan2", "pow", "Rational", "min", "max")
    if len(arguments) != 1 + two:
        if function == "Rational" and len(arguments) == 1:
            return arguments[0]
        raise AnswerError(f"{function} of {len(arguments)} arguments at position {at + 1}; expected {1 + two}")
    first = arguments[0]
    match function:
        case "sec" | "csc" | "cot":
            name = {"sec": "cos", "csc": "sin", "cot": "tan"}[function]
            return Product(((True, _one(at)), (False, Call(name, (first,), at))))
        case "ddt":
            return time_derivative(first)
        case "sind" | "cosd" | "tand":
            return Call(function[:3], (_radians(first, at),), at)
        case "radians":
            return _radians(first, at)
        case "Rational":
            return Product(((True, first), (False, arguments[1])))
        case "number":
            return first
        case "pow":
            return Power(first, arguments[1], at)
        case "square":
            return Power(first, Number(Fraction(2), "2", at), at)
    return Call(function, arguments, at)


def _radians(angle: Tree, at: int) -> Tree:
    return Product(((True, angle), (True, Name("pi", at)), (False, Number(Fraction(180), "180", at))))


def _one(at: int) -> Tree:
    return Number(Fraction(1), "1", at)
