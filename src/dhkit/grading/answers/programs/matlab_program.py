"""MATLAB and Octave programs: a closed list of statements is read, and nothing is run.

A program is read as bindings: each name stands for one value, the one that is assigned to it. A statement that is not
read (a loop, a branch, a second assignment) breaks the names that it may change: what is made of a broken name is not
read either, with the reason and the line. Names and their values are kept by :class:`~.scope.Scope`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain

from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.programs.matlab_expression import (
    FUNCTIONS,
    MatlabExpression,
    arguments_of,
    constant_index,
    one_based,
    text_of,
    with_use,
)
from dhkit.grading.answers.programs.matlab_tokens import (
    CHANGING,
    STEPPING,
    MatlabStatement,
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
    Scalar,
    Several,
    Structure,
    Unread,
    UnreadError,
    Value,
    row_or_column,
)
from dhkit.grading.answers.tokens import word_set

_BLOCK_BEGINNINGS = word_set(
    "if for while switch try parfor spmd unwind_protect do classdef methods properties events enumeration"
)
_BLOCK_BRANCHES = frozenset(
    ["else", "elseif", "case", "otherwise", "catch", "unwind_protect_cleanup"]
)
_BLOCK_ENDS = word_set(
    "end endif endfor endwhile endswitch end_try_catch endfunction endparfor end_unwind_protect until"
)

_RUNS_OTHER_CODE = word_set(
    """
    eval evalc evalin assignin load run source feval builtin str2func inputname import cellfun arrayfun evalAt
    rehash dbstop keyboard inline matlabFunction_eval script
    """
)
"""Functions that run texts, files or functions given by name, so that any name may change."""

_WITHOUT_EFFECT = word_set(
    """
    clc close clear clearvars format hold warning more pkg figure grid axis disp display fprintf printf pretty
    tic toc drawnow plot save diary echo help doc graphics_toolkit addpath digits assume assumeAlso latex
    simplify expand beep pause xlabel ylabel title legend assert error sympref return puts fdisp sympy reset
    """
)
"""Commands, and functions without a value, that assign nothing."""

_KNOWN_WORDS = _WITHOUT_EFFECT | FUNCTIONS | {"ans", "break", "continue", "pi"}
"""Words that, as a statement of their own, run no other file."""

_SYNTAX = word_set(
    """
    syms sym vpa str2sym symfun plus minus times mtimes rdivide mrdivide power mpower uminus uplus ctranspose
    transpose horzcat vertcat subsref subsasgn colon subsindex end nargin
    """
)
"""Functions that signs and brackets of formulas stand for, those that make symbols, and words of expressions."""

_ASSUMPTIONS = frozenset(
    ["real", "positive", "integer", "rational", "clear", "nonnegative", "matrix"]
)
"""Words that may follow the names of ``syms``."""


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
        The text is not MATLAB, or has more statements than are read, or one that may change any name.
    """

    def __init__(
        self, text: str, file: str, line_name: Callable[[int], str], record: Record
    ) -> None:
        if "\0" in text:
            raise AnswerError(f"{file}: not MATLAB: a NUL character")
        self.file = file
        self.line_name = line_name
        self.record = record
        self.main = Scope(record)
        """The names outside functions."""
        self.own = Scope(record)
        """The functions of the file, which functions see besides their own names."""
        self.functions: list[Function] = []
        self.count = 0
        """Number of statements read so far, those of functions at each call."""
        self.depth = 0
        """Number of calls inside each other."""
        self.assigned_names: set[str] = set()
        """Names that the program assigns anywhere: they are not functions."""
        self.signature_names: set[str] = set()
        """Names in the first lines of the file's functions."""
        statements = []  # counted while they are read, so that a long file ends early
        for statement in matlab_statements(text, file, line_name):
            statements.append(statement)
            if len(statements) > BOUNDS.statements:
                raise AnswerError(f"{file}: more than {BOUNDS.statements} statements")
        self.statements = statements
        for statement in statements:
            self.assigned_names |= statement.assigned_names()
            if statement.keyword == "function":
                self.signature_names |= {
                    token.text for token in statement.tokens if token.kind == "name"
                }
        for statement in statements:
            self._refuse_other_code(statement)
        try:
            main = self._without_functions(statements)
            self._read_statements(main, self.main)
        except RecursionError:
            raise AnswerError(
                f"{file}: nested too deep to be read; write long sums in parts"
            ) from None

    def _refusal(self, statement: MatlabStatement, what: str, expected: str = "") -> AnswerError:
        more = f"; expected {expected}" if expected else ""
        return AnswerError(f"{self.file}: {self.line_name(statement.line)}: {what}{more}")

    def _refuse_other_code(self, statement: MatlabStatement) -> None:
        for k, token in enumerate(statement.tokens):
            is_field = k > 0 and statement.tokens[k - 1].text == "."
            if (
                token.kind == "name"
                and token.text in _RUNS_OTHER_CODE
                and not is_field
                and token.text not in self.assigned_names
            ):
                raise self._refusal(
                    statement,
                    f"found {token.text!r}, which may change any name; a program is read, not run (--execute)",
                )
        # ``load = 2`` assigns a name, ``load data`` is a command.
        if (
            statement.keyword in _RUNS_OTHER_CODE
            and statement.keyword not in statement.assigned_names()
        ):
            raise self._refusal(
                statement, f"found {statement.keyword!r}, which may change any name"
            )

    # Functions

    def _without_functions(self, statements: Sequence[MatlabStatement]) -> list[MatlabStatement]:
        """Define the file's functions, and return the statements outside them."""
        has_ends = self._functions_have_ends(statements)
        main: list[MatlabStatement] = []
        k = 0
        while k < len(statements):
            statement = statements[k]
            if statement.keyword == "classdef":
                raise self._refusal(statement, "found 'classdef'", "a script or functions")
            if statement.keyword != "function":
                main.append(statement)
                k += 1
                continue
            end = self._end_of_function(statements, k, has_ends=has_ends)
            self._define(statement, statements[k + 1 : end])
            k = end + 1 if has_ends else end
        return main

    def _end_of_function(
        self, statements: Sequence[MatlabStatement], start: int, *, has_ends: bool
    ) -> int:
        """Return the index of a function's own end, or of the next function where functions have none."""
        depth = 0
        for k in range(start + 1, len(statements)):
            word = statements[k].keyword
            if word == "function":
                if has_ends:
                    raise self._refusal(
                        statements[k],
                        "found a function inside a function or a block",
                        "functions side by side",
                    )
                return k
            if word in _BLOCK_ENDS:
                if depth == 0:
                    return k
                depth -= 1
            if word in _BLOCK_BEGINNINGS:
                depth += 1
        return len(statements)

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
        """Keep a function by its first line, ``function [a, b] = name(x, y)``, and its statements."""
        tokens = statement.tokens[1:]
        equals = next((k for k, token in enumerate(tokens) if token.is_sign("=")), None)
        left = () if equals is None else tokens[:equals]
        right = tokens if equals is None else tokens[equals + 1 :]
        results = tuple(token.text for token in left if token.kind == "name")
        if not right or right[0].kind != "name":
            raise self._refusal(statement, "found a function without a name")
        name = right[0].text
        if name in _SYNTAX:
            raise self._refusal(
                statement, f"found a function {name!r}, which changes what formulas mean"
            )
        if any(token.text == "=" for token in right[1:]):
            raise self._refusal(
                statement, "found a default of an argument", "arguments by name alone"
            )
        parameters = tuple(token.text for token in right[1:] if token.kind == "name")
        where = self.line_name(statement.line)
        function = Function(name, parameters, _Definition(tuple(body), results), where)
        self.functions.append(function)
        # Functions see each other in ``own``, handles see them among the names of ``main``.
        self.own.bind(name, function, where)
        self.main.bind(name, function, where)

    def arguments_as_given(self, function: Function) -> dict[str, Value]:
        """Return a function's arguments as themselves."""
        values: dict[str, Value] = {
            name: self.record.argument(name) for name in function.parameters
        }
        if function.name in function.definition.results:  # ``applied`` refuses it
            values = {}
        for name in set(function.definition.results) & set(values):
            values[name] = Unread(f"{name} is an argument and an output, in {function.where}")
        return values

    def applied(self, function: Function, arguments: dict[str, Value]) -> tuple[Value, Scope]:
        """Return the result of a call, and the scope with its local names.

        The result is a ``Several`` for a function, and one value for a handle.

        Raises
        ------
        UnreadError
            The function is not read.
        """
        if function.name in function.definition.results:
            raise UnreadError(
                f"{function.name} is the name of a function and of its result, in {function.where}"
            )
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
            scope.set_argument(name, value, function.where)
        self._refuse_later_names(function)
        self.depth += 1
        try:
            if definition.formula:
                try:
                    return self.value(definition.formula, scope), scope
                except UnreadError as error:
                    return Unread(f"{function.where}: {error}"), scope
            self._read_statements(self._without_defaults(definition.statements, function), scope)
        finally:
            self.depth -= 1
        values: list[Value] = []
        names: list[str] = []
        for result in definition.results:
            binding = scope.names.get(result)
            if binding is None:
                names.append("")
                values.append(Unread(f"{result} is not assigned, in {function.where}"))
            else:
                names.append(result)
                values.append(binding.value)
        return Several(tuple(values), tuple(names)), scope

    def _refuse_later_names(self, function: Function) -> None:
        """Refuse a handle that reads a name which the program assigns only after it."""
        known = {*function.captured, *function.parameters, *self.own.names}
        formula = function.definition.formula  # empty for a function
        for k, token in enumerate(formula):
            is_field = k > 0 and formula[k - 1].text == "."
            if (
                token.kind == "name"
                and not is_field
                and token.text in self.assigned_names
                and token.text not in known
            ):
                raise UnreadError(
                    f"{token.text} is assigned after the handle of {function.where}, which does not see it"
                )

    @staticmethod
    def returned_names(function: Function) -> list[str]:
        """Return the names in a function's results."""
        definition: _Definition = function.definition
        return [
            *definition.results,
            *(token.text for token in definition.formula if token.kind == "name"),
        ]

    def _without_defaults(
        self, statements: Sequence[MatlabStatement], function: Function
    ) -> list[MatlabStatement]:
        """Leave out ``if nargin < 2, p = NAME_parameters(); end``, with which `dhkit equations` gives p a default."""
        kept: list[MatlabStatement] = []
        k = 0
        while k < len(statements):
            match [statement.texts for statement in statements[k : k + 3]]:
                case [
                    ["if", "nargin", "<", count],
                    [argument, "=", default, "(", ")"],
                    ["end"],
                ] if (
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

    def _read_statements(self, statements: Sequence[MatlabStatement], scope: Scope) -> None:
        """Bind the names that statements assign; break those in blocks, and after a ``return``."""
        blocks: list[str] = []
        has_returned = False
        for statement in statements:
            self.count += 1
            if self.count > BOUNDS.statements:
                raise AnswerError(f"{self.file}: more than {BOUNDS.statements} statements")
            word = statement.keyword
            where = self.line_name(statement.line)
            if word in _BLOCK_BEGINNINGS:
                blocks.append(word)
                self._break(statement, scope, repr(word), where)
            elif word in _BLOCK_ENDS:
                if not blocks:
                    raise self._refusal(statement, f"found {word!r}, which closes nothing")
                blocks.pop()
            elif word in _BLOCK_BRANCHES and blocks:
                self._break(statement, scope, repr(word), where)
            elif word == "return":
                if scope is self.main:
                    raise self._refusal(
                        statement,
                        "found 'return' outside a function",
                        "statements that are all run",
                    )
                has_returned = True
                if blocks:  # the statements after it may not be run
                    for name in scope.local:
                        scope.change(
                            name,
                            f"{name} may be changed by 'return' in {where}",
                            only_matrices=False,
                        )
            elif blocks or has_returned:
                what = repr(blocks[-1]) if blocks else "a statement after 'return'"
                self._refuse_script(statement, word)
                self._break(statement, scope, what, where)
            else:
                try:
                    self._read_statement(statement, word, scope, where)
                except UnreadError as error:
                    self._break(statement, scope, f"a statement in which {error}", where)

    def _break(self, statement: MatlabStatement, scope: Scope, what: str, where: str) -> None:
        """Note that a statement changes names in a way that is not read."""
        for name in sorted(statement.assigned_names()):
            scope.change(name, f"{name[:40]} is changed by {what} in {where}", only_matrices=False)

    def _refuse_script(self, statement: MatlabStatement, word: str) -> None:
        """Refuse a word of its own that may be the name of a file, which would be run."""
        known = {*_KNOWN_WORDS, *self.assigned_names, *self.signature_names}
        if len(statement.tokens) == 1 and word and word not in known:
            raise self._refusal(
                statement,
                f"found {word!r}, which may be a script that changes any name",
                "assignments",
            )

    def assigned_anywhere(self) -> Iterator[tuple[str, str]]:
        """Yield the targets of assignments, with their lines: names and fields, those in unread statements too."""
        for statement in self.statements:
            where = self.line_name(statement.line)
            for name in sorted(statement.assigned_names() | statement.assigned_fields()):
                yield name, where

    def _read_statement(
        self, statement: MatlabStatement, word: str, scope: Scope, where: str
    ) -> None:
        """Read a statement outside blocks: ``global``, ``clear``, ``syms``, an assignment, a change or a command."""
        tokens = statement.tokens
        equals = [k for k, token in enumerate(tokens) if token.is_sign("=")]
        depths = list(accumulate(token.nesting for token in tokens))
        assigning = next((k for k in equals if depths[k] == 0), None)
        changing = next((k for k, token in enumerate(tokens) if token.is_sign(*CHANGING)), None)
        is_change = (
            changing is not None or tokens[0].text in STEPPING or tokens[-1].text in STEPPING
        )
        if word in ("global", "persistent"):
            for name in statement.command_names:
                scope.change(
                    name, f"{name[:40]} is changed by {word!r} in {where}", only_matrices=False
                )
        elif word in ("clear", "clearvars"):
            named = [name for name in statement.command_names if name in scope.names]
            variables = [
                name for name, one in scope.names.items() if not isinstance(one.value, Function)
            ]
            for name in named if statement.command_names else variables:
                scope.change(name, f"{name[:40]} is cleared in {where}", only_matrices=False)
        elif word == "syms":
            self._syms(tokens[0].words, scope, where)
        elif len(equals) > 1 or (equals and (is_change or assigning is None)):
            self._break(statement, scope, "an assignment inside an expression", where)
        elif assigning is not None:
            self._assign(statement, tokens[:assigning], tokens[assigning + 1 :], scope, where)
        elif is_change:
            name, index = _target(tokens[: changing or 0])
            if (
                changing is not None
                and tokens[changing].text == "+="
                and name
                and index is not None
            ):
                self._assign_entry(name, index, tokens[changing + 1 :], scope, where, is_added=True)
            else:
                self._break(statement, scope, "an assignment that changes it", where)
        else:
            self._refuse_script(statement, word)

    def _syms(self, words: str, scope: Scope, where: str) -> None:
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
                    scope.change(
                        name,
                        f"{name[:40]} is made by 'syms' of a matrix in {where}",
                        only_matrices=False,
                    )
                    continue
                scope.bind(name, self._symbols(name, lengths, scope, where), where)
            elif arguments and arguments.replace(" ", "") != "(t)":
                reason = (
                    f"{name[:40]} is made by 'syms' of a function of other names than t in {where}"
                )
                scope.change(name, reason, only_matrices=False)
            else:
                scope.bind(name, Given(name, is_symbol=True, is_constant=not arguments), where)

    def _symbols(self, name: str, lengths: Sequence[int], scope: Scope, where: str) -> Matrix:
        """Return the row or the column of symbols of ``syms q [2 1]``."""
        names = [f"{name}{k + 1}" for k in range(max(lengths))]
        for one in names:
            scope.bind(one, Given(one, is_symbol=True, is_constant=True), where)
        scalars = [Scalar(one, uses=frozenset((scope.key(one),))) for one in names]
        return row_or_column(scalars, is_column=lengths[0] > 1)

    def _assign(
        self, statement: MatlabStatement, left: Tokens, right: Tokens, scope: Scope, where: str
    ) -> None:
        """Read ``[M, C] = f(q)``, ``V(q1, q2) = x``, ``M(1, :) = x``, ``M(1, 2) = x``, ``V = x`` and ``p.m1 = x``."""
        if not left:
            self._break(statement, scope, "an assignment without a name", where)
            return
        if left[0].is_sign("[") and closing(left, 0) == len(left) - 1:
            self._assign_several(statement, left, right, scope, where)
            return
        name, index = _target(left)
        if right and self._is_symbolic_function(left, scope):
            name = left[0].text
            index = None
        if right and (place := _row_or_column(left)):
            self._assign_row_or_column(left[0].text, place, right, scope, where)
            return
        if not name or not right:
            self._break(statement, scope, "an assignment that is not read", where)
            return
        if index is not None:
            self._assign_entry(name, index, right, scope, where)
            return
        try:
            value = self.value(right, scope, name)
        except UnreadError as error:
            names = frozenset(token.text for token in right if token.kind == "name")
            value = Unread(f"{where}: {error}", names, any(token.is_sign("[") for token in right))
        if "." not in name:
            if isinstance(value, Function) and scope is self.main:
                self.functions.append(value)
            scope.bind(name, value, where)
            return
        # A field, too, is assigned once.
        structure, _, member = name.partition(".")
        binding = scope.names.get(structure)
        fields = (
            dict(binding.value.fields)
            if binding is not None and isinstance(binding.value, Structure)
            else {}
        )
        if binding is not None and not isinstance(binding.value, Structure | Given):
            scope.change(structure, f"{structure[:40]} is changed in {where}", only_matrices=False)
        elif member in fields and fields[member] != value:
            scope.change(
                structure, f"{name[:40]} is assigned twice, in {where}", only_matrices=False
            )
        else:
            scope.set_argument(structure, Structure({**fields, member: value}), where)

    def _assign_several(
        self, statement: MatlabStatement, left: Tokens, right: Tokens, scope: Scope, where: str
    ) -> None:
        """Read ``[M, C] = dynamics(q, qd)`` and ``[a, b] = deal(1, 2)``."""
        if not right:
            raise self._refusal(statement, "found nothing after '='")
        targets = list(chain.from_iterable(split_rows(left[1:-1])))
        names = [entry[0].text if len(entry) == 1 else "" for entry in targets]
        values: Sequence[Value] = ()
        try:
            if (
                is_call(right, "deal")
                and "deal" not in self.own.names
                and "deal" not in self.assigned_names
            ):
                values = [self.value(x, scope) for x in arguments_of(right[2:-1])]
            else:
                value = self.value(right, scope, "", count=len(names))
                values = value.values if isinstance(value, Several) else ()
        except UnreadError as error:
            values = [Unread(f"{where}: {error}")] * len(names)
        if len(values) < len(names) or not all(names):
            self._break(statement, scope, "an assignment that is not read", where)
            return
        for name, value in zip(names, values, strict=False):
            if name != "~":
                scope.bind(name, value, where)

    @staticmethod
    def _is_symbolic_function(left: Tokens, scope: Scope) -> bool:
        """Whether a left-hand side is V(q1, q2) of symbols: in a formula it stands for the assigned value."""
        if not is_call(left, left[0].text) or left[0].text in scope.names:
            return False
        arguments = [entry[0].text if len(entry) == 1 else "" for entry in arguments_of(left[2:-1])]
        bindings = [scope.names.get(name) for name in arguments]
        return all(
            one is not None and isinstance(one.value, Given) and one.value.is_symbol
            for one in bindings
        )

    def _assign_row_or_column(
        self,
        name: str,
        place: tuple[int | None, int | None],
        right: Tokens,
        scope: Scope,
        where: str,
    ) -> None:
        """Read ``M(1, :) = [a b]``: an entry for each number of the vector."""
        row, column = place
        binding = scope.names.get(name)
        try:
            value = self.value(right, scope)
            if not isinstance(value, Matrix) or (not value.is_flat and 1 not in value.shape):
                raise UnreadError(f"{name} is changed by an assignment to a part of it")
            entries = list(value.entries.values())
            made = binding.value if binding is not None else None
            if isinstance(made, Matrix) and not made.is_flat:
                rows, columns = made.shape
                if len(entries) != (rows if row is None else columns):
                    raise UnreadError(f"{name} is assigned a row or column of another length")
        except UnreadError as error:
            scope.change(name, f"{where}: {error}", only_matrices=False)
            return
        for k, entry in enumerate(entries):
            i = k if row is None else row
            j = k if column is None else column
            scope.bind_entry(name, (i, j), entry, where)

    def _assign_entry(
        self,
        name: str,
        index: Index,
        right: Tokens,
        scope: Scope,
        where: str,
        is_added: bool = False,
    ) -> None:
        """Read ``M(1, 2) = ...``; ``is_added`` where the value is added to the entry."""
        binding = scope.names.get(name)
        try:
            value = self.value(right, scope)
            if isinstance(value, Matrix) and len(value.entries) > 1:
                raise UnreadError(f"{name} is changed by an assignment of a matrix to a part of it")
            scalar = scope.scalar(value)
        except UnreadError as error:
            scope.change(name, f"{where}: {error}", only_matrices=False)
            return
        if not is_added and binding is not None:
            scalar, is_added = _added_part(name, index, right, scalar, self, scope)
        scope.bind_entry(name, index, scalar, where, is_added)

    # Expressions

    def value(self, tokens: Tokens, scope: Scope, name: str = "", count: int = 1) -> Value:
        """Return the value of an expression; ``name`` is the target of its assignment.

        Raises
        ------
        UnreadError
            It is not read.
        """
        if not tokens:
            raise UnreadError("an expression is missing")
        if tokens[0].text == "@":
            return self._handle(tokens, name, scope)
        parser = MatlabExpression(self, tokens, scope, count)
        value = parser.sum()
        if parser.at < len(tokens):
            found = tokens[parser.at]
            if found.kind in ("number", "name") or found.text == "(":
                raise UnreadError(f"an operator is missing in front of {found.text[:20]!r}")
            raise UnreadError(f"{text_of(tokens)[:40]!r} is not read")
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
        where = self.line_name(tokens[0].line)
        formula = tuple(tokens[end + 1 :])
        captured: dict[str, Value] = {}
        for token in formula:
            if token.kind == "name" and token.text in scope.names and token.text not in parameters:
                try:
                    captured[token.text] = scope.value(token.text)
                except UnreadError as error:
                    captured[token.text] = Unread(str(error))
        return Function(name, parameters, _Definition(formula=formula), where, captured=captured)

    def call(
        self, function: Function, arguments: Sequence[Value], scope: Scope, name: str, count: int
    ) -> Value:
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
        return with_use(value, scope.key_of(name))


def _target(tokens: Tokens) -> tuple[str, Index | None]:
    """Return the name and the index that are assigned; an empty name where the left-hand side is not read."""
    if not tokens or tokens[0].kind != "name":
        return "", None
    name = tokens[0].text
    if len(tokens) == 1:
        return name, None
    if len(tokens) == 3 and tokens[1].text == "." and tokens[2].kind == "name":
        return f"{name}.{tokens[2].text}", None
    index = constant_index(tokens[2:-1]) if is_call(tokens, name) else None
    return ("", None) if index is None else (name, index)


def _row_or_column(left: Tokens) -> tuple[int | None, int | None] | None:
    """Return the row or the column, from 0, of the left-hand side M(1, :) or M(:, 2); None of another one."""
    match [token.text for token in left]:
        case [_, "(", number, ",", ":", ")"] if (row := one_based(number)) is not None:
            return row, None
        case [_, "(", ":", ",", number, ")"] if (column := one_based(number)) is not None:
            return None, column
    return None


def _added_part(
    name: str, index: Index, right: Tokens, scalar: Scalar, program: MatlabProgram, scope: Scope
) -> tuple[Scalar, bool]:
    """Return what M(1,1) = M(1,1) + rest adds to the entry, and True; another right-hand side as it is."""
    if len(right) < 3 or right[0].text != name or not right[1].is_sign("("):
        return scalar, False
    end = closing(right, 1)
    is_own = constant_index(right[2:end]) == index
    if not is_own or end + 1 >= len(right) or not right[end + 1].is_sign("+", "-"):
        return scalar, False
    # A minus stays, as the sign of the rest.
    rest = right[end + 2 :] if right[end + 1].text == "+" else right[end + 1 :]
    return scope.scalar(program.value(rest, scope)), True
