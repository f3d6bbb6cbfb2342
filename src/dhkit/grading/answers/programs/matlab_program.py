"""MATLAB and Octave programs as bindings: a closed list of statements is understood, others are noted as changes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

from dhkit.errors import AnswerError
from dhkit.grading.answers.programs.bindings import (
    MAX_STATEMENTS,
    RETURNED_FORMULA,
    Formula,
    Index,
    LibraryFunction,
    NotUnderstood,
    OwnFunction,
    Program,
    ReturnValue,
    Scope,
    Structure,
    Symbol,
    Value,
    vector_of_names,
)
from dhkit.grading.answers.programs.matlab_formulas import FUNCTIONS, MatlabFormulas, constant_index
from dhkit.grading.answers.programs.matlab_statements import (
    CHANGING,
    STEPPING,
    MatlabStatement,
    Tokens,
    closing,
    is_call,
    matlab_statements,
)
from dhkit.grading.answers.tokens import word_set

BLOCK_BEGINNINGS = word_set(
    "if for while switch try parfor spmd unwind_protect do classdef methods properties events enumeration"
)
BLOCK_BRANCHES = frozenset(["else", "elseif", "case", "otherwise", "catch", "unwind_protect_cleanup"])
BLOCK_ENDS = word_set(
    "end endif endfor endwhile endswitch end_try_catch endfunction endparfor end_unwind_protect until"
)

UNBOUNDED_NAMES = word_set(
    """
    eval evalc evalin assignin load run source feval builtin str2func inputname import cellfun arrayfun evalAt
    rehash dbstop keyboard inline matlabFunction_eval script
    """
)
"""Functions with which a program may change any name."""

HARMLESS = word_set(
    """
    clc close clear clearvars format hold warning more pkg figure grid axis disp display fprintf printf pretty
    tic toc drawnow plot save diary echo help doc graphics_toolkit addpath digits assume assumeAlso latex
    simplify expand beep pause xlabel ylabel title legend assert error sympref return puts fdisp sympy reset
    """
)
"""Commands, and functions without a value, that assign nothing."""

KNOWN_WORDS = HARMLESS | FUNCTIONS | {"ans", "break", "continue", "pi"}
"""Words that, as a statement of their own, run no other file."""

SYNTAX = word_set(
    """
    syms sym vpa str2sym symfun plus minus times mtimes rdivide mrdivide power mpower uminus uplus ctranspose
    transpose horzcat vertcat subsref subsasgn colon subsindex end nargin
    """
)
"""Functions that signs and brackets of formulas stand for, and those that make symbols."""

ASSUMPTIONS = frozenset(["real", "positive", "integer", "rational", "clear", "nonnegative", "matrix"])
"""Words behind the names of ``syms``."""


def matlab_program(text: str, file: str, line_name: Callable[[int], str]) -> Program:
    """Read a program of MATLAB's or Octave's; nothing in it is run.

    Parameters
    ----------
    text
        The program.
    file
        What messages begin with.
    line_name
        How messages name a line, which counts from 1.

    Raises
    ------
    AnswerError
        No MATLAB, more statements than are read, or one that may change any name.
    """
    if "\0" in text:
        raise AnswerError(f"{file}: no MATLAB: a NUL character")
    statements: list[MatlabStatement] = []
    for statement in matlab_statements(text, file, line_name):
        statements.append(statement)
        if len(statements) > MAX_STATEMENTS:
            raise AnswerError(f"{file}: more than {MAX_STATEMENTS} statements")
    return _ProgramReader(file, line_name).read(statements)


@dataclass
class _Function:
    """A function that is being read: its name, outputs and scope, and whether ``return`` was passed."""

    name: str
    outputs: tuple[str, ...]
    scope: Scope
    has_returned: bool = False


class _ProgramReader:
    """Reads statement after statement; ``statement`` is the current one, and ``blocks`` the words of open blocks."""

    def __init__(self, file: str, line_name: Callable[[int], str]) -> None:
        self.file = file
        self.line_name = line_name
        self.program = Program()
        self.statement = MatlabStatement(())
        self.blocks: list[str] = []
        self.function: _Function | None = None
        self.bound: set[str] = set()
        """Names that the program assigns anywhere."""
        self.function_line_names: set[str] = set()
        """Names in the first lines of the file's functions."""
        self.functions: set[str] = set()
        """Names of the file's functions, which go before those of MATLAB's everywhere in the file."""
        self.single_zeros: set[tuple[int, str]] = set()
        """Scopes and names of zeros(1, 1)."""
        self.formulas = MatlabFormulas(self.bound.__contains__)

    def read(self, statements: Sequence[MatlabStatement]) -> Program:
        for statement in statements:
            self.bound |= statement.assigned_names()
            if statement.tokens[0].text == "function":
                self.function_line_names |= {token.text for token in statement.tokens if token.kind == "name"}
        has_ends = self._functions_have_ends(statements)
        k = 0
        while k < len(statements):
            if self._is_default(statements[k : k + 3]):
                k += 3
                continue
            self.statement = statements[k]
            self._refuse_unbounded()
            self._read_statement(has_ends)
            k += 1
        self._end_function()
        everywhere = Scope(
            {
                name: [b for b in bindings if isinstance(b.value, OwnFunction)]
                for name, bindings in self.program.main.bindings.items()
                if name in self.functions
            }
        )
        for scope in self.program.functions:
            scope.outer = scope.outer or everywhere
        return self.program

    @property
    def scope(self) -> Scope:
        return self.function.scope if self.function is not None else self.program.main

    @property
    def line(self) -> str:
        return self.line_name(self.statement.line)

    def _refuse(self, what: str, expected: str = "") -> AnswerError:
        more = f"; expected {expected}" if expected else ""
        return AnswerError(f"{self.file}: {self.line}: {what}{more}")

    def _bind(self, name: str, value: Value, index: Index | None = None, is_added: bool = False) -> None:
        if self.function is not None and self.function.has_returned:
            value, index = NotUnderstood(f"{name} is assigned behind 'return', in {self.line}"), None
        if self.blocks:
            value, index = NotUnderstood(f"{name[:40]} is changed by {self.blocks[-1]!r} in {self.line}"), None
        self.program.bind(self.scope, name, self.line, value, index, is_added and index is not None)

    def _bind_changed(self, names: Iterable[str], what: str) -> None:
        """Note that the statement changes names in a way that is not read."""
        for name in sorted(names):
            self._bind(name, NotUnderstood(f"{name[:40]} is changed by {what} in {self.line}"))

    # Blocks

    def _functions_have_ends(self, statements: Sequence[MatlabStatement]) -> bool:
        """Whether functions close with an end of their own, as all or none of a file do."""
        words = [statement.tokens[0].text for statement in statements]
        functions = words.count("function")
        openers = sum(word in BLOCK_BEGINNINGS for word in words)
        closers = sum(word in BLOCK_ENDS for word in words)
        if functions and closers == openers + functions:
            return True
        if closers == openers:
            return False
        raise AnswerError(f"{self.file}: {openers + functions} blocks begin and {closers} end")

    def _is_default(self, statements: Sequence[MatlabStatement]) -> bool:
        """Whether statements are ``if nargin < 2, p = NAME_parameters(); end``: a default of an argument."""
        if self.function is None or self.blocks or statements[0].keyword != "if":
            return False
        match [statement.texts for statement in statements]:
            case [["if", "nargin", "<", _], [argument, "=", function, "(", ")"], ["end"]]:
                bindings = self.scope.bindings.get(argument, [])
                is_parameters = function in self.function_line_names or function.endswith("_parameters")
                return is_parameters and len(bindings) == 1 and bindings[0].is_argument
        return False

    def _read_statement(self, has_ends: bool) -> None:
        word = self.statement.keyword
        if word == "function":
            self._begin_function(has_ends)
        elif word == "classdef":
            raise self._refuse("found 'classdef'", "a script or functions")
        elif word in BLOCK_BEGINNINGS or (word in BLOCK_BRANCHES and self.blocks):
            self.blocks += [word] if word in BLOCK_BEGINNINGS else []
            self._bind_changed(self.statement.assigned_names(), repr(word))
        elif word in BLOCK_ENDS:
            if self.blocks:
                self.blocks.pop()
            elif has_ends and self.function is not None:
                self._end_function()
            else:
                raise self._refuse(f"found {word!r}, which closes nothing")
        elif word == "return":
            if self.function is None:
                raise self._refuse("found 'return' outside a function", "statements that are all run")
            if self.blocks:
                self._bind_changed(self.function.outputs, "'return'")
            else:
                self.function.has_returned = True
        else:
            self._read_simple(word)

    def _begin_function(self, has_ends: bool) -> None:
        if self.blocks or (self.function is not None and has_ends):
            raise self._refuse("found a function inside a function or a block", "functions side by side")
        self._end_function()
        tokens = self.statement.tokens[1:]
        equals = next((k for k, token in enumerate(tokens) if token.is_sign("=")), -1)
        outputs = tuple(token.text for token in tokens[: max(equals, 0)] if token.kind == "name")
        right = tokens[equals + 1 :]
        if not right or right[0].kind != "name":
            raise self._refuse("found a function without a name")
        name = right[0].text
        if name in SYNTAX:
            raise self._refuse(f"found a function {name!r}, which changes what formulas mean")
        self.functions.add(name)
        self.program.bind(self.program.main, name, self.line, OwnFunction())
        self.function = _Function(name, outputs, self.program.add_function())
        for argument in [token.text for token in right[1:] if token.kind == "name"]:
            value: Value = Symbol(argument, is_argument=True)
            if argument in outputs:
                value = NotUnderstood(f"{argument} is an argument and an output, in {self.line}")
            self.program.bind(self.scope, argument, self.line, value)
        if any(token.text == "=" for token in right[1:]):
            raise self._refuse("found a default of an argument", "arguments by name alone")

    def _end_function(self) -> None:
        if self.function is not None:
            name, scope = self.function.name, self.function.scope
            outputs = [output for output in self.function.outputs if output in scope.bindings]
            scope.return_values += [ReturnValue(name, output, is_only=False) for output in outputs]
        self.function = None

    # Statements

    def _refuse_unbounded(self) -> None:
        """Refuse a statement that may change any name."""
        tokens = self.statement.tokens
        for k, token in enumerate(tokens):
            is_field = k > 0 and tokens[k - 1].text == "."
            is_unbounded = token.kind == "name" and token.text in UNBOUNDED_NAMES
            if is_unbounded and not is_field and token.text not in self.bound:
                raise self._refuse(f"found {token.text!r}, which may change any name; a program is read, not run")
        if self.statement.keyword in UNBOUNDED_NAMES:
            raise self._refuse(f"found {self.statement.keyword!r}, which may change any name")

    def _read_simple(self, word: str) -> None:
        """Read a statement outside or inside a block: an assignment, a command, or a call for its effects."""
        statement, tokens = self.statement, self.statement.tokens
        equals = [k for k, token in enumerate(tokens) if token.is_sign("=")]
        depths = list(accumulate(token.nesting for token in tokens))
        assigning = next((k for k in equals if depths[k] == 0), None)
        changing = next((k for k, token in enumerate(tokens) if token.is_sign(*CHANGING)), None)
        is_change = changing is not None or tokens[0].text in STEPPING or tokens[-1].text in STEPPING
        if word in ("global", "persistent"):
            self._bind_changed(statement.command_names, repr(word))
        elif word == "syms":
            self._syms()
        elif len(equals) > 1 or (equals and (is_change or assigning is None)):
            self._bind_changed(statement.assigned_names(), "an assignment inside an expression")
        elif assigning is not None:
            self._assign(tokens[:assigning], tokens[assigning + 1 :])
        elif is_change:
            self._change(changing)
        elif len(tokens) == 1 and word and word not in {*KNOWN_WORDS, *self.bound, *self.function_line_names}:
            raise self._refuse(f"found {word!r}, which may be a script that changes any name", "assignments")

    def _syms(self) -> None:
        """Read ``syms q1(t) m [2 1] real``."""
        words = re.sub(r"^\s*\((.*)\)\s*$", r"\1", self.statement.tokens[0].words)
        words = re.sub(r"['\",]", " ", words)
        for match in re.finditer(r"([A-Za-z]\w*)(\s*\([^)]*\))?(\s*\[[^\]]*\])?", words, re.ASCII):
            name, arguments, shape = match.groups()
            if name in ASSUMPTIONS:
                continue
            if shape:
                lengths = [int(k) for k in re.findall(r"\d{1,3}", shape)]
                if len(lengths) > 2 or (len(lengths) == 2 and min(lengths) > 1):
                    self._bind_changed([name], "'syms' of a matrix")
                    continue
                entries = [f"{name}{k + 1}" for k in range(max(lengths, default=0))]
                for entry in entries:
                    self._bind(entry, Symbol(entry))
                self._bind(name, vector_of_names(entries))
            elif arguments and arguments.replace(" ", "") != "(t)":
                self._bind_changed([name], "'syms' of a function of other names than t")
            else:
                self._bind(name, Symbol(name))

    def _change(self, changing: int | None) -> None:
        """Read M(1,1) += formula; other changes are not understood."""
        tokens = self.statement.tokens
        if changing is not None and tokens[changing].text == "+=":
            name, index = _target(tokens[:changing])
            formula = self.formulas.formula(tokens[changing + 1 :])
            if name and index is not None and not formula.is_matrix:
                self._bind(name, formula, index, is_added=True)
                return
        for name in sorted(self.statement.assigned_names()):
            self._bind(name, NotUnderstood(f"{name} is changed after it is assigned, in {self.line}"))

    def _assign(self, left: Tokens, right: Tokens) -> None:
        name, index = _target(left)
        if not name or not right:
            self._bind_changed(self.statement.assigned_names(), "an assignment that is not read")
            return
        if right[0].text == "@":
            self._assign_handle(name, index, right)
            return
        if index is None and (symbol := self._symbol(right)):
            self._bind(name, Symbol(symbol))
            return
        formula = self.formulas.formula(right)
        if index is None and formula.text == name and not formula.problem:
            return  # M = simplify(M)
        if index is not None and formula.is_matrix:
            self._bind_changed([name], "an assignment of a matrix to a part of it")
            return
        key = (id(self.scope), name)
        if formula.is_zeros and re.fullmatch(r"zeros\(1(, ?1)?\)", formula.text):
            self.single_zeros.add(key)
        elif index is None and key in self.single_zeros and not formula.is_matrix:
            index = ()  # the one entry of zeros(1, 1)
        added = _added_part(name, index, formula)
        if "." in name:
            self._bind(name.partition(".")[0], Structure())
        self._bind(name, added or formula, index, is_added=added is not None)

    def _symbol(self, right: Tokens) -> str:
        """Return the name of the symbol that sym('q1', 'real') makes; empty of another value."""
        if len(right) < 4 or not is_call(right, "sym") or right[2].kind != "string" or "sym" in self.bound:
            return ""
        match = re.fullmatch(r"([A-Za-z]\w*)(\(t\))?", right[2].text[1:-1], re.ASCII)
        return match[1] if match and all(token.text != "[" for token in right) else ""

    def _assign_handle(self, name: str, index: Index | None, right: Tokens) -> None:
        """Read M = @(q1, q2) [...] as a function, and s = @sin as another name of one."""
        if len(right) == 2 and right[1].kind == "name" and index is None:
            function = right[1].text
            self._bind(name, OwnFunction() if function in self.function_line_names else LibraryFunction(function))
            return
        if index is not None or len(right) < 3 or right[1].text != "(" or self.blocks or self.function is not None:
            self._bind_changed([name], "'@'")
            return
        end = closing(right, 1)
        self._bind(name, OwnFunction())
        scope = self.program.add_function(outer=self.program.main)
        for token in right[2:end]:
            if token.kind == "name":
                self.program.bind(scope, token.text, self.line, Symbol(token.text, is_argument=True))
        self.program.bind(scope, RETURNED_FORMULA, self.line, self.formulas.formula(right[end + 1 :]))
        scope.return_values.append(ReturnValue(name, RETURNED_FORMULA))


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


def _added_part(name: str, index: Index | None, formula: Formula) -> Formula | None:
    """Return what M(1,1) = M(1,1) + rest adds to the entry; None of another formula."""
    own = [read for read in formula.reads if read.name == name and (read.index or ()) == (index or ())]
    if index is None or len(own) != 1 or own[0].start != 0 or formula.problem:
        return None
    sign = re.match(r"\s*([-+])", formula.text[own[0].end :])
    if sign is None:
        return None
    start = own[0].end + (sign.end() if sign[1] == "+" else sign.start(1))
    reads = (replace(read, start=read.start - start, end=read.end - start) for read in formula.reads)
    return Formula(formula.text[start:], tuple(read for read in reads if read.start >= 0))
