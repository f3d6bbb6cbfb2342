"""MATLAB and Octave programs: a closed list of statements and expressions is read, and nothing is run."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, chain

from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.programs.library import called
from dhkit.grading.answers.programs.matlab_tokens import (
    CHANGING,
    STEPPING,
    MatlabStatement,
    MatlabToken,
    Tokens,
    closing,
    is_call,
    matlab_statements,
    split_rows,
)
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
    Structure,
    Text,
    Unread,
    UnreadError,
    Value,
    calculated,
    matrix_of,
    number,
    opposite,
    transposed,
)
from dhkit.grading.answers.tokens import rate_name, word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, plain_name

_BLOCK_BEGINNINGS = word_set(
    "if for while switch try parfor spmd unwind_protect do classdef methods properties events enumeration"
)
_BLOCK_BRANCHES = frozenset(["else", "elseif", "case", "otherwise", "catch", "unwind_protect_cleanup"])
_BLOCK_ENDS = word_set(
    "end endif endfor endwhile endswitch end_try_catch endfunction endparfor end_unwind_protect until"
)

_UNBOUNDED = word_set(
    """
    eval evalc evalin assignin load run source feval builtin str2func inputname import cellfun arrayfun evalAt
    rehash dbstop keyboard inline matlabFunction_eval script
    """
)
"""Functions with which a program may change any name."""

COMMANDS = word_set(
    """
    clc close clear clearvars format hold warning more pkg figure grid axis disp display fprintf printf pretty
    tic toc drawnow plot save diary echo help doc graphics_toolkit addpath digits assume assumeAlso latex
    simplify expand beep pause xlabel ylabel title legend assert error sympref return puts fdisp sympy reset
    """
)
"""Commands, and functions without a value, that assign nothing."""

FUNCTIONS = frozenset(FUNCTION_NAMES) - {"square", "pow", "S", "Float", "Integer", "Rational", "number"}
_KNOWN_WORDS = COMMANDS | FUNCTIONS | {"ans", "break", "continue", "pi"}
"""Words that, as a statement of their own, run no other file."""

_SYNTAX = word_set(
    """
    syms sym vpa str2sym symfun plus minus times mtimes rdivide mrdivide power mpower uminus uplus ctranspose
    transpose horzcat vertcat subsref subsasgn colon subsindex end nargin
    """
)
"""Functions that signs and brackets of formulas stand for, and those that make symbols."""

_ASSUMPTIONS = frozenset(["real", "positive", "integer", "rational", "clear", "nonnegative", "matrix"])
"""Words that may follow the names of ``syms``."""

_PLAIN_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_SUMS = ("+", "-", ".+", ".-")
_PRODUCTS = ("*", "/", ".*", "./")
_POWERS = {"^": "^", "**": "^", ".^": ".^", ".**": ".^"}


@dataclass(frozen=True)
class _Definition:
    """The text of a function: its statements, or the formula of a handle, and the names of its results."""

    statements: tuple[MatlabStatement, ...] = ()
    results: tuple[str, ...] = ()
    formula: Tokens = ()


class MatlabProgram:
    """A program of MATLAB's or Octave's, read as bindings of names.

    Parameters
    ----------
    text
        The program.
    file
        Beginning of messages.
    line_name
        How messages name a line, which counts from 1.
    record
        What is known of the program.

    Raises
    ------
    AnswerError
        No MATLAB, more statements than are read, or one that may change any name.
    """

    def __init__(self, text: str, file: str, line_name: Callable[[int], str], record: Record) -> None:
        if "\0" in text:
            raise AnswerError(f"{file}: no MATLAB: a NUL character")
        self.file = file
        self.line_name = line_name
        self.record = record
        self.main = Scope(record)
        self.own = Scope(record)
        """The functions of the file, which functions see besides their own names."""
        self.functions: list[Function] = []
        self.count = 0
        self.depth = 0
        self.bound: set[str] = set()
        """Names that the program assigns anywhere: they are not functions."""
        self.signature_names: set[str] = set()
        """Names in the first lines of the file's functions."""
        statements = []
        for statement in matlab_statements(text, file, line_name):
            statements.append(statement)
            if len(statements) > BOUNDS.statements:
                raise AnswerError(f"{file}: more than {BOUNDS.statements} statements")
        self.statements = statements
        for statement in statements:
            self.bound |= statement.assigned_names()
            if statement.keyword == "function":
                self.signature_names |= {token.text for token in statement.tokens if token.kind == "name"}
        for statement in statements:
            self._refuse_unbounded(statement)
        try:
            main = self._without_functions(statements)
            self._block(main, self.main)
        except RecursionError:
            raise AnswerError(f"{file}: nested too deep to be read; write long sums in parts") from None

    def _refuse(self, statement: MatlabStatement, what: str, expected: str = "") -> AnswerError:
        more = f"; expected {expected}" if expected else ""
        return AnswerError(f"{self.file}: {self.line_name(statement.line)}: {what}{more}")

    def _refuse_unbounded(self, statement: MatlabStatement) -> None:
        for k, token in enumerate(statement.tokens):
            is_field = k > 0 and statement.tokens[k - 1].text == "."
            if token.kind == "name" and token.text in _UNBOUNDED and not is_field and token.text not in self.bound:
                raise self._refuse(
                    statement,
                    f"found {token.text!r}, which may change any name; a program is read, not run (--execute)",
                )
        if statement.keyword in _UNBOUNDED:
            raise self._refuse(statement, f"found {statement.keyword!r}, which may change any name")

    # Functions

    def _without_functions(self, statements: Sequence[MatlabStatement]) -> list[MatlabStatement]:
        """Define the file's functions, and return the statements outside them."""
        has_ends = self._functions_have_ends(statements)
        main: list[MatlabStatement] = []
        k = 0
        while k < len(statements):
            statement = statements[k]
            if statement.keyword == "classdef":
                raise self._refuse(statement, "found 'classdef'", "a script or functions")
            if statement.keyword != "function":
                main.append(statement)
                k += 1
                continue
            end = k + 1
            depth = 0
            while end < len(statements):
                word = statements[end].keyword
                if word == "function":
                    if has_ends:
                        raise self._refuse(
                            statements[end], "found a function inside a function or a block", "functions side by side"
                        )
                    break
                if word in _BLOCK_ENDS:
                    if depth == 0:
                        break
                    depth -= 1
                depth += word in _BLOCK_BEGINNINGS
                end += 1
            self._define(statement, statements[k + 1 : end])
            k = end + has_ends
        return main

    def _functions_have_ends(self, statements: Sequence[MatlabStatement]) -> bool:
        """Whether functions close with an end of their own, as all or none of a file do."""
        words = [statement.tokens[0].text for statement in statements]
        functions = words.count("function")
        openers = sum(word in _BLOCK_BEGINNINGS for word in words)
        closers = sum(word in _BLOCK_ENDS for word in words)
        if functions and closers == openers + functions:
            return True
        if closers == openers:
            return False
        raise AnswerError(f"{self.file}: {openers + functions} blocks begin and {closers} end")

    def _define(self, statement: MatlabStatement, body: Sequence[MatlabStatement]) -> None:
        tokens = statement.tokens[1:]
        equals = next((k for k, token in enumerate(tokens) if token.is_sign("=")), -1)
        results = tuple(token.text for token in tokens[: max(equals, 0)] if token.kind == "name")
        right = tokens[equals + 1 :]
        if not right or right[0].kind != "name":
            raise self._refuse(statement, "found a function without a name")
        name = right[0].text
        if name in _SYNTAX:
            raise self._refuse(statement, f"found a function {name!r}, which changes what formulas mean")
        if any(token.text == "=" for token in right[1:]):
            raise self._refuse(statement, "found a default of an argument", "arguments by name alone")
        parameters = tuple(token.text for token in right[1:] if token.kind == "name")
        line = self.line_name(statement.line)
        function = Function(name, parameters, _Definition(tuple(body), results), line)
        self.functions.append(function)
        self.own.bind(name, function, line)
        self.main.bind(name, function, line)

    def arguments_as_given(self, function: Function) -> dict[str, Value]:
        """Return a function's arguments as themselves."""
        values: dict[str, Value] = {name: self.record.argument(name) for name in function.parameters}
        if function.name in function.definition.results:
            values = {}
        for name in set(function.definition.results) & set(values):
            values[name] = Unread(f"{name} is an argument and an output, in {function.line}")
        return values

    def applied(self, function: Function, arguments: dict[str, Value]) -> tuple[Value, Scope]:
        """Return what a function returns for some arguments, and its local names.

        Raises
        ------
        UnreadError
            The function is not read.
        """
        if function.name in function.definition.results:
            raise UnreadError(f"{function.name} is the name of a function and of its result, in {function.line}")
        if self.depth >= BOUNDS.call_depth:
            raise UnreadError(f"{function.name} calls itself, or functions nested too deep")
        definition: _Definition = function.definition
        local = set(function.parameters)
        for statement in definition.statements:
            local |= statement.assigned_names()
        # A handle sees the program's names as they are, a function only the file's functions.
        outer = self.main if definition.formula else self.own
        scope = Scope(self.record, outer, frozenset(local))
        for name, value in {**function.captured, **arguments}.items():
            scope.set_argument(name, value, function.line)
        self._refuse_later_names(function)
        self.depth += 1
        try:
            if definition.formula:
                try:
                    return self.value(definition.formula, scope), scope
                except UnreadError as error:
                    return Unread(f"{function.line}: {error}"), scope
            self._block(self._without_defaults(definition.statements, function), scope)
        finally:
            self.depth -= 1
        values: list[Value] = []
        names: list[str] = []
        for result in definition.results:
            bound = scope.names.get(result)
            names.append(result if bound is not None else "")
            values.append(bound.value if bound is not None else Unread(f"{result} is not assigned, in {function.line}"))
        return Several(tuple(values), tuple(names)), scope

    def _refuse_later_names(self, function: Function) -> None:
        """Refuse a handle that reads a name which the program assigns only after it."""
        known = {*function.captured, *function.parameters, *self.own.names}
        for token in function.definition.formula:
            if token.kind == "name" and token.text in self.bound and token.text not in known:
                raise UnreadError(
                    f"{token.text} is assigned after the handle of {function.line}, which does not see it"
                )

    @staticmethod
    def returned_names(function: Function) -> list[str]:
        """Return the names in what a function returns."""
        definition: _Definition = function.definition
        return [*definition.results, *(token.text for token in definition.formula if token.kind == "name")]

    def _without_defaults(self, statements: Sequence[MatlabStatement], function: Function) -> list[MatlabStatement]:
        """Leave out ``if nargin < 2, p = NAME_parameters(); end``: a default of an argument."""
        kept: list[MatlabStatement] = []
        k = 0
        while k < len(statements):
            match [statement.texts for statement in statements[k : k + 3]]:
                case [["if", "nargin", "<", count], [argument, "=", default, "(", ")"], ["end"]] if (
                    argument in function.parameters
                    and count.isdecimal()
                    and int(count[:4]) <= len(function.parameters)
                    and (default in self.own.names or default.endswith("_parameters"))
                ):
                    k += 3
                    continue
            kept.append(statements[k])
            k += 1
        return kept

    # Statements

    def _block(self, statements: Sequence[MatlabStatement], scope: Scope) -> None:
        blocks: list[str] = []
        has_returned = False
        for statement in statements:
            self.count += 1
            if self.count > BOUNDS.statements:
                raise AnswerError(f"{self.file}: more than {BOUNDS.statements} statements")
            word = statement.keyword
            line = self.line_name(statement.line)
            if word in _BLOCK_BEGINNINGS:
                blocks.append(word)
                self._change(statement, scope, repr(word), line)
            elif word in _BLOCK_ENDS:
                if not blocks:
                    raise self._refuse(statement, f"found {word!r}, which closes nothing")
                blocks.pop()
            elif word in _BLOCK_BRANCHES and blocks:
                self._change(statement, scope, repr(word), line)
            elif word == "return":
                if scope is self.main:
                    raise self._refuse(statement, "found 'return' outside a function", "statements that are all run")
                has_returned = True
                if blocks:
                    for name in scope.local:
                        scope.change(name, f"{name} may be changed by 'return' in {line}", only_matrices=False)
            elif blocks or has_returned:
                where = repr(blocks[-1]) if blocks else "a statement after 'return'"
                self._refuse_script(statement, word)
                self._change(statement, scope, where, line)
            else:
                self._statement(statement, word, scope, line)

    def _change(self, statement: MatlabStatement, scope: Scope, what: str, line: str) -> None:
        """Note that a statement changes names in a way that is not read."""
        for name in sorted(statement.assigned_names()):
            scope.change(name, f"{name[:40]} is changed by {what} in {line}", only_matrices=False)

    def _refuse_script(self, statement: MatlabStatement, word: str) -> None:
        known = {*_KNOWN_WORDS, *self.bound, *self.signature_names}
        if len(statement.tokens) == 1 and word and word not in known:
            raise self._refuse(statement, f"found {word!r}, which may be a script that changes any name", "assignments")

    def assigned_anywhere(self) -> Iterator[tuple[str, str]]:
        """Yield what the program assigns: names and fields, those in what is not read too, with their lines."""
        for statement in self.statements:
            line = self.line_name(statement.line)
            for name in sorted(statement.assigned_names() | statement.assigned_fields()):
                yield name, line

    def _statement(self, statement: MatlabStatement, word: str, scope: Scope, line: str) -> None:
        tokens = statement.tokens
        equals = [k for k, token in enumerate(tokens) if token.is_sign("=")]
        depths = list(accumulate(token.nesting for token in tokens))
        assigning = next((k for k in equals if depths[k] == 0), None)
        changing = next((k for k, token in enumerate(tokens) if token.is_sign(*CHANGING)), None)
        is_change = changing is not None or tokens[0].text in STEPPING or tokens[-1].text in STEPPING
        if word in ("global", "persistent"):
            for name in statement.command_names:
                scope.change(name, f"{name[:40]} is changed by {word!r} in {line}", only_matrices=False)
        elif word in ("clear", "clearvars"):
            named = [name for name in statement.command_names if name in scope.names]
            bound = [name for name, one in scope.names.items() if not isinstance(one.value, Function)]
            for name in named if statement.command_names else bound:
                scope.change(name, f"{name[:40]} is cleared in {line}", only_matrices=False)
        elif word == "syms":
            self._syms(tokens[0].words, scope, line)
        elif len(equals) > 1 or (equals and (is_change or assigning is None)):
            self._change(statement, scope, "an assignment inside an expression", line)
        elif assigning is not None:
            self._assign(statement, tokens[:assigning], tokens[assigning + 1 :], scope, line)
        elif is_change:
            name, index = _target(tokens[: changing or 0])
            if changing is not None and tokens[changing].text == "+=" and name and index is not None:
                self._assign_entry(name, index, tokens[changing + 1 :], scope, line, is_added=True)
            else:
                self._change(statement, scope, "an assignment that adds to it", line)
        else:
            self._refuse_script(statement, word)

    def _syms(self, words: str, scope: Scope, line: str) -> None:
        """Read ``syms q1(t) m [2 1] real``."""
        words = re.sub(r"^\s*\((.*)\)\s*$", r"\1", words)
        words = re.sub(r"['\",]", " ", words)
        for match in re.finditer(r"([A-Za-z]\w*)(\s*\([^)]*\))?(\s*\[[^\]]*\])?", words, re.ASCII):
            name, arguments, shape = match.groups()
            if name in _ASSUMPTIONS:
                continue
            if shape:
                lengths = [int(k) for k in re.findall(r"\d{1,3}", shape)]
                if len(lengths) != 2 or min(lengths) != 1:
                    scope.change(name, f"{name[:40]} is made by 'syms' of a matrix in {line}", only_matrices=False)
                    continue
                scope.bind(name, self._symbols(name, lengths, scope, line), line)
            elif arguments and arguments.replace(" ", "") != "(t)":
                reason = f"{name[:40]} is made by 'syms' of a function of other names than t in {line}"
                scope.change(name, reason, only_matrices=False)
            else:
                scope.bind(name, Given(name, is_symbol=True, is_constant=not arguments), line)

    def _symbols(self, name: str, lengths: Sequence[int], scope: Scope, line: str) -> Matrix:
        """Return the row or the column of symbols of ``syms q [2 1]``."""
        names = [f"{name}{k + 1}" for k in range(max(lengths))]
        for one in names:
            scope.bind(one, Given(one, is_symbol=True, is_constant=True), line)
        scalars = [Scalar(one, uses=frozenset((scope.key(one),))) for one in names]
        return matrix_of([[x] for x in scalars] if lengths[0] > 1 else [scalars])

    def _assign(self, statement: MatlabStatement, left: Tokens, right: Tokens, scope: Scope, line: str) -> None:
        if not left:
            self._change(statement, scope, "an assignment without a name", line)
            return
        if left[0].is_sign("[") and closing(left, 0) == len(left) - 1:
            self._assign_several(statement, left, right, scope, line)
            return
        name, index = _target(left)
        if right and self._is_symbolic_function(left, scope):
            name = left[0].text
            index = None
        if right and (place := _row_or_column(left)):
            self._assign_line(left[0].text, place, right, scope, line)
            return
        if not name or not right:
            self._change(statement, scope, "an assignment that is not read", line)
            return
        if index is not None:
            self._assign_entry(name, index, right, scope, line)
            return
        try:
            value = self.value(right, scope, name)
        except UnreadError as error:
            names = frozenset(token.text for token in right if token.kind == "name")
            value = Unread(f"{line}: {error}", names, any(token.is_sign("[") for token in right))
        if "." not in name:
            if isinstance(value, Function) and scope is self.main:
                self.functions.append(value)
            scope.bind(name, value, line)
            return
        structure, _, member = name.partition(".")
        bound = scope.names.get(structure)
        fields = dict(bound.value.fields) if bound is not None and isinstance(bound.value, Structure) else {}
        if bound is not None and not isinstance(bound.value, Structure | Given):
            scope.change(structure, f"{structure[:40]} is changed in {line}", only_matrices=False)
        elif member in fields and fields[member] != value:
            scope.change(structure, f"{name[:40]} is assigned twice, in {line}", only_matrices=False)
        else:
            scope.set_argument(structure, Structure({**fields, member: value}), line)

    def _assign_several(self, statement: MatlabStatement, left: Tokens, right: Tokens, scope: Scope, line: str) -> None:
        """Read ``[M, C] = dynamics(q, qd)`` and ``[a, b] = deal(1, 2)``."""
        if not right:
            raise self._refuse(statement, "found nothing after '='")
        targets = list(chain.from_iterable(split_rows(left[1:-1])))
        names = [entry[0].text if len(entry) == 1 else "" for entry in targets]
        values: Sequence[Value] = ()
        try:
            if is_call(right, "deal") and "deal" not in self.own.names and "deal" not in self.bound:
                values = [self.value(x, scope) for x in _arguments(right[2:-1])]
            else:
                value = self.value(right, scope, "", count=len(names))
                values = value.values if isinstance(value, Several) else ()
        except UnreadError as error:
            values = [Unread(f"{line}: {error}")] * len(names)
        if len(values) < len(names) or not all(names):
            self._change(statement, scope, "an assignment that is not read", line)
            return
        for name, value in zip(names, values, strict=False):
            if name != "~":
                scope.bind(name, value, line)

    @staticmethod
    def _is_symbolic_function(left: Tokens, scope: Scope) -> bool:
        """Whether a left-hand side is V(q1, q2) of symbols: in a formula it is what it is assigned."""
        if not is_call(left, left[0].text) or left[0].text in scope.names:
            return False
        arguments = [entry[0].text if len(entry) == 1 else "" for entry in _arguments(left[2:-1])]
        bound = [scope.names.get(name) for name in arguments]
        return all(one is not None and isinstance(one.value, Given) and one.value.is_symbol for one in bound)

    def _assign_line(
        self, name: str, place: tuple[int | None, int | None], right: Tokens, scope: Scope, line: str
    ) -> None:
        """Read ``M(1, :) = [a b]``: an entry for each number of the vector."""
        row, column = place
        bound = scope.names.get(name)
        try:
            value = self.value(right, scope)
            if not isinstance(value, Matrix) or (not value.is_flat and 1 not in value.shape):
                raise UnreadError(f"{name} is changed by an assignment to a part of it")
            entries = list(value.entries.values())
            made = bound.value if bound is not None else None
            is_matrix = isinstance(made, Matrix) and not made.is_flat
            if isinstance(made, Matrix) and is_matrix and len(entries) != made.shape[0 if row is None else 1]:
                raise UnreadError(f"{name} is assigned a row or column of another length")
        except UnreadError as error:
            scope.change(name, f"{line}: {error}", only_matrices=False)
            return
        for k, entry in enumerate(entries):
            index = (k if row is None else row, k if column is None else column)
            scope.bind_entry(name, index, entry, line)

    def _assign_entry(
        self, name: str, index: Index, right: Tokens, scope: Scope, line: str, is_added: bool = False
    ) -> None:
        bound = scope.names.get(name)
        try:
            value = self.value(right, scope)
            if isinstance(value, Matrix) and len(value.entries) > 1:
                raise UnreadError(f"{name} is changed by an assignment of a matrix to a part of it")
            scalar = scope.scalar(value)
        except UnreadError as error:
            scope.change(name, f"{line}: {error}", only_matrices=False)
            return
        if not is_added and bound is not None:
            scalar, is_added = _added_part(name, index, right, scalar, self, scope)
        scope.bind_entry(name, index, scalar, line, is_added)

    # Expressions

    def value(self, tokens: Tokens, scope: Scope, name: str = "", count: int = 1) -> Value:
        """Return the value of an expression; ``name`` is what it is assigned to.

        Raises
        ------
        UnreadError
            It is not read.
        """
        if not tokens:
            raise UnreadError("an expression is missing")
        if tokens[0].text == "@":
            return self._handle(tokens, name, scope)
        parser = _Expression(self, tokens, scope, count)
        value = parser.sum()
        if parser.at < len(tokens):
            found = tokens[parser.at]
            if found.kind in ("number", "name") or found.text == "(":
                raise UnreadError(f"an operator is missing in front of {found.text[:20]!r}")
            raise UnreadError(f"{_text(tokens)[:40]!r} is not read")
        return value

    def _handle(self, tokens: Tokens, name: str, scope: Scope) -> Value:
        """Return M = @(q1, q2) [...] as a function, and s = @sin as another name of one."""
        if len(tokens) == 2 and tokens[1].kind == "name":
            function = tokens[1].text
            if function in self.own.names:
                return self.own.value(function)
            return Library(function)
        if len(tokens) < 3 or tokens[1].text != "(" or scope is not self.main:
            raise UnreadError("'@' is not read")
        end = closing(tokens, 1)
        parameters = tuple(token.text for token in tokens[2:end] if token.kind == "name")
        if not tokens[end + 1 :]:
            raise UnreadError("'@' is not read")
        line = self.line_name(tokens[0].line)
        formula = tuple(tokens[end + 1 :])
        captured: dict[str, Value] = {}
        for token in formula:
            if token.kind == "name" and token.text in scope.names and token.text not in parameters:
                try:
                    captured[token.text] = scope.value(token.text)
                except UnreadError as error:
                    captured[token.text] = Unread(str(error))
        return Function(name, parameters, _Definition(formula=formula), line, captured=captured)

    def call(self, function: Function, arguments: Sequence[Value], scope: Scope, name: str, count: int) -> Value:
        """Return the value of a call of one of the program's functions."""
        if len(arguments) > len(function.parameters):
            raise UnreadError(f"{name}(...) is called with too many arguments")
        values = dict(zip(function.parameters, arguments, strict=False))
        value, _ = self.applied(function, values)
        if isinstance(value, Several):
            if not value.values:
                raise UnreadError(f"{name}(...) returns nothing")
            if count == 1:
                value = value.values[0]
        if isinstance(value, Unread):
            raise UnreadError(value.reason)
        return _with_use(value, scope.key_of(name))


class _Expression:
    """Reads one expression by the rules of precedence; ``at`` is the next token."""

    def __init__(self, program: MatlabProgram, tokens: Tokens, scope: Scope, count: int = 1) -> None:
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
        """Return a value with which is calculated."""
        robot = self.program.record.robot
        if isinstance(value, Given) and not robot.vocabulary.knows(value.name) and robot.is_vector(value.name):
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
        value = self.signed()
        while sign := self._next(*_PRODUCTS):
            value = calculated(self._operand(value), sign, self._operand(self.signed()), "^")
        return value

    def signed(self) -> Value:
        sign = self._next("+", "-")
        if not sign:
            return self.power()
        value = self._operand(self.signed())
        return opposite(value) if sign == "-" else value

    def power(self) -> Value:
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
        return self._transposed(self.primary())

    def _transposed(self, value: Value) -> Value:
        """Return a value with the transposes after it."""
        while self._next("'", ".'"):
            value = self._operand(value)
            value = transposed(value) if isinstance(value, Matrix) else value
        return value

    def primary(self) -> Value:
        if self.at >= len(self.tokens):
            raise UnreadError(f"{_text(self.tokens)[:40]!r} ends where a number or a name was expected")
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
        raise UnreadError(f"{_text(self.tokens)[:40]!r} is not read")

    def _matrix(self, inside: Tokens) -> Value:
        """Read a matrix by rows; its entries may be matrices themselves."""
        rows: list[list[Scalar]] = []
        for row in split_rows(inside):
            blocks = [self._block_of(entry) for entry in row]
            heights = {len(block) for block in blocks}
            if len(heights) != 1:
                raise UnreadError("the rows of a matrix differ in length, or are not read")
            # Row k of the joined blocks is row k of each, one after the other.
            rows += [list(chain(*parts)) for parts in zip(*blocks, strict=True)]
        if not rows or len({len(row) for row in rows}) != 1:
            raise UnreadError("the rows of a matrix differ in length, or are not read")
        return matrix_of(rows)

    def _block_of(self, entry: Tokens) -> list[list[Scalar]]:
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
        """Return what a name in front of brackets stands for: a function of a library, or a value."""
        is_library = name in FUNCTIONS or name in _OTHER_FUNCTIONS
        if is_library and name not in self.program.bound and self.scope.owner(name) is None:
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
            self.scope.key_of("t")
            return value
        match value:
            case Library(function):
                return _with_use(self._library(function, inside), self.scope.key_of(name))
            case Function():
                arguments = [self.program.value(x, self.scope) for x in _arguments(inside)]
                return self.program.call(value, arguments, self.scope, name, self.count)
        return self._entry(value, inside, name)

    def _entry(self, value: Value, inside: Tokens, name: str) -> Value:
        index = _constant_index(inside)
        if index is None:
            index = self._index_by_names(inside)
        if index is not None:
            if isinstance(value, Matrix) and len(index) == 1 and not value.is_flat and 1 not in value.shape:
                raise UnreadError(f"one index into the matrix {name} is not read")
            return self.scope.entry(value, index)
        places = [_places(part) for part in _arguments(inside)]
        match value, places:
            case Given(vector, number=call), [range() as one] if not self.program.record.robot.vocabulary.knows(vector):
                if one:
                    return Part(vector, tuple(one), is_slice=True, number=call)
            case Matrix(), [rows, columns] if not value.is_flat:
                m, n = value.shape
                i = range(m) if rows == "all" else rows
                j = range(n) if columns == "all" else columns
                if isinstance(i, range) and isinstance(j, range) and i and j and i[-1] < m and j[-1] < n:
                    return matrix_of([[value.entries[(a, b)] for b in j] for a in i])
            case Matrix(), [range() as one] if one and (value.is_flat or 1 in value.shape):
                return matrix_of([[self.scope.scalar(self.scope.entry(value, (k,)))] for k in one])
        raise UnreadError(f"{_text([*inside])[:40]!r} as an index is not read")

    def _index_by_names(self, inside: Tokens) -> Index | None:
        """Return an index that is made of names of whole numbers."""
        numbers: list[int] = []
        for part in _arguments(inside):
            if len(part) != 1 or part[0].kind not in ("name", "number"):
                return None
            try:
                value = self.program.value(part, self.scope)
            except UnreadError:
                return None
            if (
                not isinstance(value, Scalar)
                or not value.text.isdecimal()
                or not 0 < int(value.text[:5]) <= BOUNDS.index
            ):
                return None
            numbers.append(int(value.text) - 1)
        return tuple(numbers) if numbers else None

    def _library(self, function: str, inside: Tokens) -> Value:
        """Return the value of a function of MATLAB's."""
        text = "".join(token.text for token in inside)
        if function == "diff":
            return self._time_derivative(text)
        if function == "sym":
            return self._symbol(inside, text)
        arguments = [self.program.value(part, self.scope) for part in _arguments(inside)]
        if function in ("zeros", "eye") and len(arguments) == 1:
            arguments = [*arguments, *arguments] if not isinstance(arguments[0], Matrix) else arguments
        if function in ("simplify", "vpa", "expand", "collect", "combine", "simplifyFraction"):
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
            raise UnreadError(f"diff({text[:40]}): {match[1]} is a symbol and no function of t: its derivative is 0")
        name = ""
        if isinstance(value, Given):
            name = value.name
        elif isinstance(value, Scalar):
            name = value.text
        vocabulary = self.program.record.robot.vocabulary
        plain = plain_name(name)
        order = 2 if match[2] else 1
        for base in (plain, plain.replace("dot", "")):
            known = rate_name(base, ("dot", "ddot")[order - 1 if base == plain else min(order, 1)])
            if vocabulary.is_position(base) and vocabulary.is_state(known):
                return _with_use(self.scope.known(known), self.scope.key_of(match[1]))
        raise UnreadError(f"diff({text[:40]}): {name} is the program's own name, of which no rate is read")

    def _symbol(self, inside: Tokens, text: str) -> Value:
        """Return the symbol of sym('q1', 'real'), the number of sym(1/3), and the vector of sym('q', [2 1])."""
        if inside and inside[0].kind == "string":
            quoted = inside[0].text[1:-1]
            rest = inside[2:]
            match = re.fullmatch(r"([A-Za-z]\w*)(\(t\))?", quoted, re.ASCII)
            if match and rest and rest[0].is_sign("["):
                lengths = [int(token.text[:4]) for token in rest if token.kind == "number" and token.text.isdecimal()]
                if len(lengths) == 2 and min(lengths) == 1:
                    scalars = [self.scope.known(f"{match[1]}{k + 1}") for k in range(max(lengths))]
                    return matrix_of([[x] for x in scalars] if lengths[0] > 1 else [scalars])
            if match and not any(token.is_sign("[") or token.kind == "number" for token in inside):
                return Given(match[1], is_symbol=True, is_constant=not match[2])
            text = quoted
        elif inside:
            value = self.program.value(inside, self.scope)
            if isinstance(value, Matrix) or (isinstance(value, Scalar) and value.number is not None):
                return value
        match = re.fullmatch(r"(\d+(?:\.\d+)?)(?:/(\d+(?:\.\d+)?))?", text, re.ASCII)
        if match is None:
            raise UnreadError(f"{f'sym({text})'[:40]!r} is not read")
        return calculated(number(match[1]), "/", number(match[2])) if match[2] else number(match[1])


_OTHER_FUNCTIONS = word_set(
    "zeros eye diff sym vpa simplify expand collect combine simplifyFraction transpose ctranspose"
)
"""Functions of MATLAB's, besides those of numbers, that are read."""


def _with_use(value: Value, key: str) -> Value:
    """Return a value that knows that it is made of a name."""
    if isinstance(value, Scalar):
        return replace(value, uses=value.uses | {key})
    if isinstance(value, Matrix):
        return replace(value, entries={k: replace(x, uses=x.uses | {key}) for k, x in value.entries.items()})
    if isinstance(value, Several):
        return replace(value, values=tuple(_with_use(one, key) for one in value.values))
    return value


def _as_row(matrix: Matrix) -> Matrix:
    """Return a vector that was assigned entry by entry as the row that MATLAB makes of it."""
    if not matrix.is_flat:
        return matrix
    return matrix_of([[matrix.entries[(k,)] for k in range(matrix.shape[0])]])


def _target(tokens: Tokens) -> tuple[str, Index | None]:
    """Return the name and the index that are assigned; an empty name where the left-hand side is not read."""
    if not tokens or tokens[0].kind != "name":
        return "", None
    name = tokens[0].text
    if len(tokens) == 1:
        return name, None
    if len(tokens) == 3 and tokens[1].text == "." and tokens[2].kind == "name":
        return f"{name}.{tokens[2].text}", None
    index = _constant_index(tokens[2:-1]) if is_call(tokens, name) else None
    return ("", None) if index is None else (name, index)


def _row_or_column(left: Tokens) -> tuple[int | None, int | None] | None:
    """Return the row or the column, from 0, of the left-hand side M(1, :) or M(:, 2); None of another one."""
    match [token.text for token in left]:
        case [_, "(", number, ",", ":", ")"] if number.isdecimal() and 0 < int(number[:5]) <= BOUNDS.index:
            return int(number) - 1, None
        case [_, "(", ":", ",", number, ")"] if number.isdecimal() and 0 < int(number[:5]) <= BOUNDS.index:
            return None, int(number) - 1
    return None


def _constant_index(inside: Tokens) -> Index | None:
    """Return the index, from 0, between brackets; None where it is not made of whole numbers."""
    numbers = inside[::2]
    commas = inside[1::2]
    if len(inside) % 2 == 0 or any(token.text != "," for token in commas):
        return None
    if not all(t.kind == "number" and t.text.isdecimal() and 0 < int(t.text[:5]) <= BOUNDS.index for t in numbers):
        return None
    return tuple(int(token.text) - 1 for token in numbers)


def _places(tokens: Tokens) -> range | str:
    """Return the places that 1:2, : or 3 choose, from 0; "all" for a colon alone."""
    match [token.text for token in tokens]:
        case [":"]:
            return "all"
        case [low, ":", high] if (
            low.isdecimal() and high.isdecimal() and 0 < int(low[:5]) <= int(high[:5]) <= BOUNDS.index
        ):
            return range(int(low) - 1, int(high))
        case [one] if one.isdecimal() and 0 < int(one[:5]) <= BOUNDS.index:
            return range(int(one) - 1, int(one))
    raise UnreadError(f"{_text(tokens)[:40]!r} as an index is not read")


def _arguments(inside: Tokens) -> list[Tokens]:
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


def _added_part(
    name: str, index: Index, right: Tokens, scalar: Scalar, program: MatlabProgram, scope: Scope
) -> tuple[Scalar, bool]:
    """Return what M(1,1) = M(1,1) + rest adds to the entry, and True; another right-hand side as it is."""
    end = closing(right, 1) if is_call(right[:1], name) or (len(right) > 2 and right[1].is_sign("(")) else 0
    is_own = right[0].text == name and end and _constant_index(right[2:end]) == index
    if not is_own or end + 1 >= len(right) or not right[end + 1].is_sign("+", "-"):
        return scalar, False
    rest = right[end + 2 :] if right[end + 1].text == "+" else right[end + 1 :]
    return scope.scalar(program.value(rest, scope)), True


def _text(tokens: Tokens) -> str:
    """Return tokens in one line, with the spaces between them."""
    pieces = [(" " if token.is_spaced or token.kind == "row" else "") + token.text.strip() for token in tokens]
    return "".join(pieces).strip()
