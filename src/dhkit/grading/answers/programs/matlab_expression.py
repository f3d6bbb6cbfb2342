"""Expressions of MATLAB and Octave, read by the rules of precedence into the values that they have."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate, chain
from typing import Protocol

from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.programs.library import called
from dhkit.grading.answers.programs.matlab_tokens import MatlabToken, Tokens, closing, split_rows
from dhkit.grading.answers.programs.scope import Record, Scope
from dhkit.grading.answers.programs.values import (
    Function,
    Given,
    Index,
    Library,
    Matrix,
    Part,
    Scalar,
    Several,
    Text,
    UnreadError,
    Value,
    calculated,
    matrix_of,
    number,
    opposite,
    row_or_column,
    transposed,
)
from dhkit.grading.answers.tokens import rate_name, word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, plain_name

FUNCTIONS = frozenset(FUNCTION_NAMES) - {
    "square",
    "pow",
    "S",
    "Float",
    "Integer",
    "Rational",
    "number",
}
"""Functions of numbers; the names left out are sympy's and numpy's."""

_OTHER_FUNCTIONS = word_set(
    "zeros eye diff sym vpa simplify expand collect combine simplifyFraction transpose ctranspose"
)
"""Functions of MATLAB's, besides those of numbers, that are read."""

_PLAIN_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_SUMS = ("+", "-", ".+", ".-")
_PRODUCTS = ("*", "/", ".*", "./")
_INDEX_DIGITS = 5
"""Largest number of digits of an index."""
_FIRST_ARGUMENT_ONLY = frozenset(
    ["simplify", "vpa", "expand", "collect", "combine", "simplifyFraction"]
)
"""Functions whose value is that of their first argument; the others say how it is written."""
_POWERS = {"^": "^", "**": "^", ".^": ".^", ".**": ".^"}


class Program(Protocol):
    """The program, as its expressions see it."""

    record: Record
    assigned_names: set[str]
    """Names that the program assigns anywhere."""

    def value(self, tokens: Tokens, scope: Scope, name: str = "", count: int = 1) -> Value: ...  # noqa: D102

    def call(  # noqa: D102
        self, function: Function, arguments: Sequence[Value], scope: Scope, name: str, count: int
    ) -> Value: ...


class MatlabExpression:
    r"""Reads one expression; ``at`` is the next token, ``count`` the number of results that are assigned.

    All symbols are real, so that a conjugate transpose is a transpose.

        sum      =  product {(+ | -) product}
        product  =  signed {(* | /) signed}
        signed   =  (+ | -) signed  |  power
        power    =  postfix [^ [+ | -] primary {'}]
        postfix  =  primary {'}
        primary  =  number  |  'text'  |  (sum)  |  [matrix]  |  name, name(arguments), name.field

    ``.*``, ``./`` and ``.^`` stand where ``*``, ``/`` and ``^`` do. Comparisons, ``\\`` and ranges outside of an index
    are not read.
    """

    def __init__(self, program: Program, tokens: Tokens, scope: Scope, count: int = 1) -> None:
        self.program = program
        self.tokens = tokens
        self.scope = scope
        self.count = count
        self.at = 0

    def _next(self, *texts: str) -> str:
        """Take the next token if it is one of some signs; return its text, or an empty one."""
        if self.at < len(self.tokens) and self.tokens[self.at].is_sign(*texts):
            self.at += 1
            return self.tokens[self.at - 1].text
        return ""

    def _operand(self, value: Value) -> Value:
        """Return a value as an operand: q as the column of its entries, 1 x 1 as a scalar, a flat vector as a row."""
        robot = self.program.record.robot
        if (
            isinstance(value, Given)
            and not robot.vocabulary.knows(value.name)
            and robot.is_vector(value.name)
        ):
            entries = [self.scope.scalar(self.scope.entry(value, (k,))) for k in range(robot.n)]
            return matrix_of([[entry] for entry in entries])
        if isinstance(value, Matrix):
            return next(iter(value.entries.values())) if len(value.entries) == 1 else _as_row(value)
        return self.scope.scalar(value)

    def sum(self) -> Value:
        """Read a sum, or one operand as it is."""
        value = self.product()
        while sign := self._next(*_SUMS):
            value = calculated(self._operand(value), sign[-1], self._operand(self.product()), "^")
        return value

    def product(self) -> Value:
        """Read a product, or one operand as it is."""
        value = self.signed()
        while sign := self._next(*_PRODUCTS):
            value = calculated(self._operand(value), sign, self._operand(self.signed()), "^")
        return value

    def signed(self) -> Value:
        """Read an operand with signs before it."""
        sign = self._next("+", "-")
        if not sign:
            return self.power()
        value = self._operand(self.signed())
        return opposite(value) if sign == "-" else value

    def power(self) -> Value:
        """Read a power, or one operand as it is."""
        value = self.postfix()
        has_power = False
        while sign := self._next(*_POWERS):
            if has_power:
                raise UnreadError("a power of a power without brackets is not read")
            has_power = True
            minus = self._next("+", "-")
            exponent = self._operand(self.primary())
            exponent = opposite(exponent) if minus == "-" else exponent
            # Powers and transposes bind alike, from the left: B^2' is (B^2)'.
            value = self._transposed(calculated(self._operand(value), _POWERS[sign], exponent, "^"))
        return value

    def postfix(self) -> Value:
        """Read an operand with transposes after it."""
        return self._transposed(self.primary())

    def _transposed(self, value: Value) -> Value:
        """Return a value with the transposes after it."""
        while self._next("'", ".'"):
            value = self._operand(value)
            value = transposed(value) if isinstance(value, Matrix) else value
        return value

    def primary(self) -> Value:
        """Read a number, a text, a name with its suffixes, or brackets."""
        if self.at >= len(self.tokens):
            raise UnreadError(
                f"{text_of(self.tokens)[:40]!r} ends where a number or a name was expected"
            )
        token = self.tokens[self.at]
        self.at += 1
        match token.kind, token.text:
            case "number", text:
                if _PLAIN_NUMBER.fullmatch(text) is None:
                    raise UnreadError(f"the number {text[:20]!r} is not read")
                return number(text)
            case "string", text:
                return Text(text[1:-1])
            case "name", name:
                return self._name(name)
            case "sign", "(":
                end = closing(self.tokens, self.at - 1)
                inside = self.tokens[self.at : end]
                if not inside:
                    raise UnreadError("empty brackets are not read")
                value = self.program.value(inside, self.scope)
                self.at = end + 1
                return value
            case "sign", "[":
                end = closing(self.tokens, self.at - 1)
                value = self._matrix(self.tokens[self.at : end])
                self.at = end + 1
                return value
        raise UnreadError(f"{text_of(self.tokens)[:40]!r} is not read")

    def _matrix(self, inside: Tokens) -> Value:
        """Read a matrix by rows; its entries may be matrices themselves."""
        rows: list[list[Scalar]] = []
        for row in split_rows(inside):
            blocks = [self._submatrix(entry) for entry in row]
            heights = {len(block) for block in blocks}
            if len(heights) != 1:
                raise UnreadError("the blocks in a row of a matrix differ in height")
            # Row k of the joined blocks is row k of each, one after the other.
            rows += [list(chain(*parts)) for parts in zip(*blocks, strict=True)]
        if not rows or len({len(row) for row in rows}) != 1:
            raise UnreadError("the rows of a matrix differ in length, or are not read")
        return matrix_of(rows)

    def _submatrix(self, entry: Tokens) -> list[list[Scalar]]:
        value = self._operand(self.program.value(entry, self.scope))
        if isinstance(value, Matrix):
            return value.rows
        return [[self.scope.scalar(value)]]

    def _name(self, name: str) -> Value:
        """Read a name with its suffixes: fields, indices or arguments."""
        value: Value
        if self._next("."):
            if self.at >= len(self.tokens) or self.tokens[self.at].kind != "name":
                raise UnreadError(f"{name}.(...) is not read")
            member = self.tokens[self.at].text
            self.at += 1
            value = self.scope.field(self.scope.value(name), member)
            return self._indexed(value, f"{name}.{member}") if self._is_bracket() else value
        if self.at < len(self.tokens) and self.tokens[self.at].is_sign("{"):
            raise UnreadError(f"{name}{{...}} is not read")
        if not self._is_bracket():
            return self.scope.value(name)
        return self._indexed(self._called(name), name)

    def _called(self, name: str) -> Value:
        """Return the function of a library, or the value, that a name in front of brackets stands for."""
        is_library = name in FUNCTIONS or name in _OTHER_FUNCTIONS
        if (
            is_library
            and name not in self.program.assigned_names
            and self.scope.owner(name) is None
        ):
            # Notes that the name is read, so that binding it later is refused.
            self.scope.value(name)
            return Library(name)
        return self.scope.value(name)

    def _is_bracket(self) -> bool:
        return self.at < len(self.tokens) and self.tokens[self.at].is_sign("(")

    def _indexed(self, value: Value, name: str) -> Value:
        end = closing(self.tokens, self.at)
        inside = self.tokens[self.at + 1 : end]
        self.at = end + 1
        if isinstance(value, Given) and [token.text for token in inside] == ["t"]:
            self.scope.key_of("t")  # notes that t is read
            return value
        match value:
            case Library(function):
                return with_use(self._library(function, inside), self.scope.key_of(name))
            case Function():
                arguments = [self.program.value(x, self.scope) for x in arguments_of(inside)]
                return self.program.call(value, arguments, self.scope, name, self.count)
        return self._entry(value, inside, name)

    def _entry(self, value: Value, inside: Tokens, name: str) -> Value:
        index = constant_index(inside)
        if index is None:
            index = self._index_by_names(inside)
        if index is not None:
            if (
                isinstance(value, Matrix)
                and len(index) == 1
                and not value.is_flat
                and 1 not in value.shape
            ):
                raise UnreadError(f"one index into the matrix {name} is not read")
            return self.scope.entry(value, index)
        places = [_places(part) for part in arguments_of(inside)]
        match value, places:
            case Given(vector, number=call), [range() as one] if (
                not self.program.record.robot.vocabulary.knows(vector)
            ):
                if one:
                    return Part(vector, tuple(one), is_slice=True, number=call)
            case Matrix(), [rows, columns] if not value.is_flat:
                m, n = value.shape
                row_places = _places_within(rows, m)
                column_places = _places_within(columns, n)
                if row_places is not None and column_places is not None:
                    return matrix_of(value.part(row_places, column_places))
            case Matrix(), [range() as one] if one and (value.is_flat or 1 in value.shape):
                # v(1:2).
                entries = [self.scope.scalar(self.scope.entry(value, (k,))) for k in one]
                # A vector that was assigned entry by entry is a row in MATLAB.
                is_row = value.is_flat or value.shape[0] == 1
                return row_or_column(entries, is_column=not is_row)
        raise UnreadError(f"{text_of([*inside])[:40]!r} as an index is not read")

    def _index_by_names(self, inside: Tokens) -> Index | None:
        """Return an index that is made of names of whole numbers."""
        numbers: list[int] = []
        for part in arguments_of(inside):
            if len(part) != 1 or part[0].kind not in ("name", "number"):
                return None
            try:
                value = self.program.value(part, self.scope)
            except UnreadError:
                return None
            index = one_based(value.text) if isinstance(value, Scalar) else None
            if index is None:
                return None
            numbers.append(index)
        return tuple(numbers) if numbers else None

    def _library(self, function: str, inside: Tokens) -> Value:
        """Return the value of a function of MATLAB's."""
        text = "".join(token.text for token in inside)
        if function == "diff":
            return self._time_derivative(text)
        if function == "sym":
            return self._symbol(inside, text)
        arguments = [self.program.value(part, self.scope) for part in arguments_of(inside)]
        if function in ("zeros", "eye") and len(arguments) == 1:
            arguments = (
                [*arguments, *arguments] if not isinstance(arguments[0], Matrix) else arguments
            )
        if function in _FIRST_ARGUMENT_ONLY:
            arguments = arguments[:1]
        arguments = [x if isinstance(x, Matrix) else self.scope.scalar(x) for x in arguments]
        return called(self.scope, function, arguments, of_numpy=False)

    def _time_derivative(self, text: str) -> Value:
        """Return the rate that diff(q1, t), diff(q1(t), t, 2) and diff(q1, t, t) are."""
        match = re.fullmatch(r"([A-Za-z]\w*)(?:\(t\))?,t(,[2t])?", text, re.ASCII)
        if match is None:
            raise UnreadError(f"{f'diff({text})'[:40]!r} is not read")
        for name in (match[1], "t"):
            self.scope.key_of(name)
        value = self.scope.value(match[1])
        if isinstance(value, Given) and value.is_constant:
            raise UnreadError(
                f"diff({text[:40]}): {match[1]} is a symbol and no function of t: its derivative is 0"
            )
        name = ""
        if isinstance(value, Given):
            name = value.name
        elif isinstance(value, Scalar):
            name = value.text
        vocabulary = self.program.record.robot.vocabulary
        plain = plain_name(name)
        order = 2 if match[2] else 1
        # The derivative of q1, or of its rate qdot1: of at most the second order in all.
        for base, own_order in ((plain, 0), (plain.replace("dot", ""), 1)):
            if order + own_order > 2:
                continue
            known = rate_name(base, "dot" if order + own_order == 1 else "ddot")
            if vocabulary.is_position(base) and vocabulary.is_state(known):
                return with_use(self.scope.known(known), self.scope.key_of(match[1]))
        raise UnreadError(
            f"diff({text[:40]}): {name} is the program's own name, of which no rate is read"
        )

    def _symbol(self, inside: Tokens, text: str) -> Value:
        """Return the symbol of sym('q1', 'real'), the number of sym(1/3), and the vector of sym('q', [2 1])."""
        if inside and inside[0].kind == "string":
            quoted = inside[0].text[1:-1]
            rest = inside[2:]  # after the text and a comma
            match = re.fullmatch(r"([A-Za-z]\w*)(\(t\))?", quoted, re.ASCII)
            if match and rest and rest[0].is_sign("["):
                indices = [one_based(token.text) for token in rest if token.kind == "number"]
                lengths = [index + 1 for index in indices if index is not None]
                if len(lengths) == len(indices) == 2 and min(lengths) == 1:
                    scalars = [self.scope.known(f"{match[1]}{k + 1}") for k in range(max(lengths))]
                    return row_or_column(scalars, is_column=lengths[0] > 1)
            if match and not any(token.is_sign("[") or token.kind == "number" for token in inside):
                return Given(match[1], is_symbol=True, is_constant=not match[2])
            text = quoted
        elif inside:
            value = self.program.value(inside, self.scope)
            if isinstance(value, Matrix) or (
                isinstance(value, Scalar) and value.number is not None
            ):
                return value
        match = re.fullmatch(r"(\d+(?:\.\d+)?)(?:/(\d+(?:\.\d+)?))?", text, re.ASCII)
        if match is None:
            raise UnreadError(f"{f'sym({text})'[:40]!r} is not read")
        return calculated(number(match[1]), "/", number(match[2])) if match[2] else number(match[1])


def with_use(value: Value, key: str) -> Value:
    """Return a value with one more name in its ``uses``: those that it is made of."""
    if isinstance(value, Scalar):
        return replace(value, uses=value.uses | {key})
    if isinstance(value, Matrix):
        return replace(
            value, entries={k: replace(x, uses=x.uses | {key}) for k, x in value.entries.items()}
        )
    if isinstance(value, Several):
        return replace(value, values=tuple(with_use(one, key) for one in value.values))
    return value


def _as_row(matrix: Matrix) -> Matrix:
    """Return a vector that was assigned entry by entry as the row that MATLAB makes of it."""
    if not matrix.is_flat:
        return matrix
    return matrix_of([[matrix.entries[(k,)] for k in range(matrix.shape[0])]])


def constant_index(inside: Tokens) -> Index | None:
    """Return the index, from 0, between brackets; None where it is not made of whole numbers."""
    numbers = inside[::2]
    commas = inside[1::2]
    if len(inside) % 2 == 0 or any(token.text != "," for token in commas):
        return None
    indices = [one_based(token.text) if token.kind == "number" else None for token in numbers]
    if any(index is None for index in indices):
        return None
    return tuple(index for index in indices if index is not None)


def one_based(text: str) -> int | None:
    """Return the index, from 0, that a number counted from 1 stands for; None of another text or a large number."""
    # Long texts are not turned into numbers, which would take quadratic time.
    if not text.isdecimal() or len(text) > _INDEX_DIGITS or not 0 < int(text) <= BOUNDS.index:
        return None
    return int(text) - 1


def _places(tokens: Tokens) -> range | str:
    """Return the places that 1:2, : or 3 choose, from 0; "all" for a colon alone."""
    match [token.text for token in tokens]:
        case [":"]:
            return "all"
        case [low, ":", high]:
            first = one_based(low)
            last = one_based(high)
            if first is not None and last is not None and first <= last:
                return range(first, last + 1)
        case [one]:
            place = one_based(one)
            if place is not None:
                return range(place, place + 1)
    raise UnreadError(f"{text_of(tokens)[:40]!r} as an index is not read")


def _places_within(chosen: range | str, length: int) -> range | None:
    """Return the places that an index chooses, a string being a colon alone; None beyond the end of the matrix."""
    places = range(length) if isinstance(chosen, str) else chosen
    return places if places and places[-1] < length else None


def arguments_of(inside: Tokens) -> list[Tokens]:
    """Return the arguments between brackets, split at commas."""
    depths = list(accumulate(token.nesting for token in inside))
    pieces: list[list[MatlabToken]] = [[]]
    for token, depth in zip(inside, depths, strict=True):
        if depth == 0 and token.is_sign(","):
            pieces.append([])
        else:
            pieces[-1].append(token)
    if pieces == [[]]:
        return []
    if not all(pieces):
        raise UnreadError("an empty argument is not read")
    return [*pieces]


def text_of(tokens: Tokens) -> str:
    """Return tokens in one line, with the spaces between them."""
    pieces = []
    for token in tokens:
        if token.is_spaced or token.kind == "row":
            pieces.append(" ")
        pieces.append(token.text.strip())
    return "".join(pieces).strip()
