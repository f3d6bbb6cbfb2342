"""MATLAB and Octave programs as bindings: a closed list of statements is understood, others are noted as changes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from dhkit.errors import AnswerError
from dhkit.grading.answers.programs.bindings import (
    STRUCTURE,
    Formula,
    FunctionNamed,
    ModuleNamed,
    NotUnderstood,
    Program,
    Returned,
    Scope,
    Symbol,
    Value,
)
from dhkit.grading.answers.programs.matlab_formulas import FUNCTIONS, MatlabFormulas, closing, split_rows
from dhkit.grading.answers.programs.matlab_statements import MatlabToken, Statement, statements

MAX_STATEMENTS = 5_000
OPENERS = frozenset(
    (
        "if",
        "for",
        "while",
        "switch",
        "try",
        "parfor",
        "spmd",
        "unwind_protect",
        "do",
        "classdef",
        "methods",
        "properties",
        "events",
        "enumeration",
    )
)
MIDDLE = frozenset(("else", "elseif", "case", "otherwise", "catch", "unwind_protect_cleanup"))
CLOSERS = frozenset(
    (
        "end",
        "endif",
        "endfor",
        "endwhile",
        "endswitch",
        "end_try_catch",
        "endfunction",
        "endparfor",
        "end_unwind_protect",
        "until",
    )
)
ANYTHING = frozenset(
    (
        "eval",
        "evalc",
        "evalin",
        "assignin",
        "load",
        "run",
        "source",
        "feval",
        "builtin",
        "str2func",
        "inputname",
        "import",
        "cellfun",
        "arrayfun",
        "evalAt",
        "rehash",
        "dbstop",
        "keyboard",
        "inline",
        "matlabFunction_eval",
        "script",
    )
)
"""Functions with which a program may change any name."""
HARMLESS = frozenset(
    (
        "clc",
        "close",
        "clear",
        "clearvars",
        "format",
        "hold",
        "warning",
        "more",
        "pkg",
        "figure",
        "grid",
        "axis",
        "disp",
        "display",
        "fprintf",
        "printf",
        "pretty",
        "tic",
        "toc",
        "drawnow",
        "plot",
        "save",
        "diary",
        "echo",
        "help",
        "doc",
        "graphics_toolkit",
        "addpath",
        "digits",
        "assume",
        "assumeAlso",
        "latex",
        "simplify",
        "expand",
        "beep",
        "pause",
        "xlabel",
        "ylabel",
        "title",
        "legend",
        "assert",
        "error",
        "sympref",
        "return",
        "puts",
        "fdisp",
        "sympy",
        "reset",
    )
)
"""Commands, and functions without a value, that assign nothing."""
SYNTAX = frozenset(
    (
        *("syms", "sym", "vpa", "str2sym", "symfun", "plus", "minus", "times", "mtimes", "rdivide", "mrdivide"),
        *("power", "mpower", "uminus", "uplus", "ctranspose", "transpose", "horzcat", "vertcat", "subsref"),
        *("subsasgn", "colon", "subsindex", "end", "nargin"),
    )
)
"""Functions that signs and brackets of formulas stand for, and those that make symbols."""
ASSIGNING = frozenset(("+=", "-=", "*=", "/=", "^=", "|=", "&="))


def matlab_program(text: str, file: str, line_name: Callable[[int], str], n: int) -> Program:
    """Read a program of MATLAB's or Octave's; nothing in it is run.

    Parameters
    ----------
    text
        The program.
    file
        What messages begin with.
    line_name
        How messages name a line.
    n
        The number of joints.

    Raises
    ------
    AnswerError
        No MATLAB, more statements than are read, or one that may change any name.
    """
    if "\0" in text:
        raise AnswerError(f"{file}: no MATLAB: a NUL character")
    found: list[Statement] = []
    for statement in statements(text, file, line_name):
        found.append(statement)
        if len(found) > MAX_STATEMENTS:
            raise AnswerError(f"{file}: more than {MAX_STATEMENTS} statements")
    return _Reader(file, line_name).read(found)


@dataclass
class _Function:
    """A function that is being read: its scope, its outputs, and where it began."""

    name: str
    outputs: tuple[str, ...]
    scope: Scope
    line: str
    has_returned: bool = False


class _Reader:
    def __init__(self, file: str, line_name: Callable[[int], str]) -> None:
        self.file = file
        self.line_name = line_name
        self.program = Program()
        self.bound: set[str] = set()
        self.formulas = MatlabFormulas(self.bound.__contains__)
        self.blocks: list[tuple[str, str]] = []
        self.function: _Function | None = None
        self.owns: set[str] = set()
        self.single: set[tuple[int, str]] = set()
        self.functions: set[str] = set()
        """Names of the file's functions, which go before those of MATLAB's everywhere in the file."""

    def read(self, found: list[Statement]) -> Program:
        for statement in found:
            self.bound |= _targets(statement)
            if statement.tokens[0].text == "function":
                self.owns |= {t.text for t in statement.tokens if t.kind == "name"}
        has_ends = self._functions_end(found)
        k = 0
        while k < len(found):
            defaults = self._defaults(found, k)
            if defaults:
                k += defaults
                continue
            self._check(found[k])
            self._statement(found[k], has_ends)
            k += 1
        self._finish()
        own = {
            name: [b for b in bindings if b.value == FunctionNamed("") and name in self.functions]
            for name, bindings in self.program.main.bindings.items()
        }
        everywhere = Scope({name: bindings for name, bindings in own.items() if bindings})
        for scope in self.program.functions:
            scope.outer = scope.outer or everywhere
        return self.program

    @property
    def scope(self) -> Scope:
        return self.function.scope if self.function is not None else self.program.main

    def _line(self, statement: Statement) -> str:
        return self.line_name(statement.line)

    def _refuse(self, statement: Statement, what: str, expected: str = "") -> AnswerError:
        more = f"; expected {expected}" if expected else ""
        return AnswerError(f"{self.file}: {self._line(statement)}: {what}{more}")

    def _bind(
        self,
        name: str,
        statement: Statement,
        value: Value,
        index: tuple[int, ...] | None = None,
        is_added: bool = False,
    ) -> None:
        line = self._line(statement)
        if self.function is not None and self.function.has_returned:
            value, index = NotUnderstood(f"{name} is assigned behind 'return', in {line}"), None
        if self.blocks:
            kind, _ = self.blocks[-1]
            value, index = NotUnderstood(f"{name[:40]} is changed by {kind!r} in {line}"), None
        self.program.bind(self.scope, name, line, value, index, is_added and index is not None)

    def _not_understood(self, names: Iterable[str], statement: Statement, what: str) -> None:
        for name in sorted(names):
            self._bind(name, statement, NotUnderstood(f"{name[:40]} is changed by {what} in {self._line(statement)}"))

    # Blocks

    def _functions_end(self, found: list[Statement]) -> bool:
        """Whether functions close with an end of their own, as all or none of a file do."""
        words = [statement.tokens[0].text for statement in found]
        functions = words.count("function")
        openers = sum(word in OPENERS for word in words)
        closers = sum(word in CLOSERS for word in words)
        if functions and closers == openers + functions:
            return True
        if closers == openers:
            return False
        raise AnswerError(f"{self.file}: {openers + functions} blocks begin and {closers} end")

    def _defaults(self, found: list[Statement], k: int) -> int:
        """Return how many statements ``if nargin < 2, p = NAME_parameters(); end`` has: a default of an argument."""
        if self.function is None or self.blocks or k + 2 >= len(found) or found[k].tokens[0].text != "if":
            return 0
        test = [t.text for t in found[k].tokens]
        body = [t.text for t in found[k + 1].tokens]
        if len(test) != 4 or test[1:3] != ["nargin", "<"] or [t.text for t in found[k + 2].tokens] != ["end"]:
            return 0
        argument = next(iter(body), "")
        bindings = self.scope.bindings.get(argument, [])
        is_argument = [b for b in bindings if isinstance(b.value, Symbol) and b.value.is_argument]
        is_call = (
            len(body) == 5
            and body[1] == "="
            and body[3:] == ["(", ")"]
            and (body[2] in self.owns or body[2].endswith("_parameters"))
        )
        return 3 if is_call and is_argument and len(bindings) == 1 else 0

    def _statement(self, statement: Statement, has_ends: bool) -> None:
        tokens = statement.tokens
        word = tokens[0].text if tokens[0].kind == "name" else ""
        if word == "function":
            self._begin_function(statement, has_ends)
        elif word in OPENERS:
            if word == "classdef":
                raise self._refuse(statement, "found 'classdef'", "a script or functions")
            self.blocks.append((word, self._line(statement)))
            self._not_understood(_targets(statement), statement, repr(word))
        elif word in MIDDLE and self.blocks:
            self._not_understood(_targets(statement), statement, repr(word))
        elif word in CLOSERS:
            if self.blocks:
                self.blocks.pop()
            elif has_ends and self.function is not None:
                self._finish()
            else:
                raise self._refuse(statement, f"found {word!r}, which closes nothing")
        elif word == "return":
            self._return(statement)
        else:
            self._simple(statement, word)

    def _return(self, statement: Statement) -> None:
        if self.function is None:
            raise self._refuse(statement, "found 'return' outside a function", "statements that are all run")
        if self.blocks:
            self._not_understood(self.function.outputs, statement, "'return'")
        else:
            self.function.has_returned = True

    def _begin_function(self, statement: Statement, has_ends: bool) -> None:
        if self.blocks or (self.function is not None and has_ends):
            raise self._refuse(statement, "found a function inside a function or a block", "functions side by side")
        self._finish()
        tokens = statement.tokens[1:]
        equals = next((k for k, t in enumerate(tokens) if t.text == "=" and t.kind == "sign"), None)
        left = [t.text for t in tokens[:equals] if t.kind == "name"] if equals is not None else []
        right = tokens[equals + 1 :] if equals is not None else tokens
        if not right or right[0].kind != "name":
            raise self._refuse(statement, "found a function without a name")
        if right[0].text in SYNTAX:
            raise self._refuse(statement, f"found a function {right[0].text!r}, which changes what formulas mean")
        self.functions.add(right[0].text)
        scope = Scope()
        self.program.functions.append(scope)
        line = self._line(statement)
        self.program.bind(self.program.main, right[0].text, line, FunctionNamed(""))
        self.function = _Function(right[0].text, tuple(left), scope, line)
        for token in right[1:]:
            if token.kind == "name":
                value: Value = Symbol(token.text, is_argument=True)
                if token.text in left:
                    value = NotUnderstood(f"{token.text} is an argument and an output, in {line}")
                self.program.bind(scope, token.text, line, value)
        if any(t.text == "=" for t in right[1:]):
            raise self._refuse(statement, "found a default of an argument", "arguments by name alone")

    def _finish(self) -> None:
        if self.function is None:
            return
        function = self.function
        for output in function.outputs:
            if output in function.scope.bindings:
                function.scope.returned.append(Returned(function.name, output, is_only=False))
        self.function = None

    # Statements

    def _check(self, statement: Statement) -> None:
        """Refuse statements that may change any name."""
        for k, token in enumerate(statement.tokens):
            behind_dot = k > 0 and statement.tokens[k - 1].text == "."
            if token.kind == "name" and token.text in ANYTHING and not behind_dot and token.text not in self.bound:
                found = f"found {token.text!r}, which may change any name; a program is read, not run"
                raise self._refuse(statement, found)
        names = {t.text for t in statement.tokens if t.kind == "name"}
        if names & ANYTHING and statement.tokens[0].text in ANYTHING:
            raise self._refuse(statement, f"found {statement.tokens[0].text!r}, which may change any name")

    def _simple(self, statement: Statement, word: str) -> None:
        tokens = statement.tokens
        signs = [k for k, t in enumerate(tokens) if t.kind == "sign" and t.text == "="]
        outside = _outside(tokens)
        equals = next((k for k in signs if outside[k]), None)
        changing = next((k for k, t in enumerate(tokens) if t.kind == "sign" and t.text in ASSIGNING), None)
        stepped = tokens[0].text in ("++", "--") or tokens[-1].text in ("++", "--")
        if word in ("global", "persistent"):
            self._not_understood(re.findall(r"[A-Za-z]\w*", statement.words), statement, repr(word))
        elif word == "syms":
            self._syms(statement)
        elif equals is None and changing is None and not stepped:
            if signs:
                self._not_understood(_targets(statement), statement, "an assignment inside an expression")
            else:
                self._bare(statement, word)
        elif len(signs) > 1 or (signs and (changing is not None or stepped)):
            self._not_understood(_targets(statement), statement, "an assignment inside an expression")
        elif equals is not None:
            self._assign(statement, tokens[:equals], tokens[equals + 1 :])
        else:
            self._change(statement, changing)

    def _bare(self, statement: Statement, word: str) -> None:
        """Read a statement without =: a display, a command, or a call for its effects."""
        tokens = statement.tokens
        if len(tokens) == 1 and word and word not in HARMLESS and word not in self.bound and word not in self.owns:
            is_known = word in FUNCTIONS or word in ("ans", "break", "continue", "pi")
            if not is_known and any(value for value in (self.scope.bindings, self.program.main.bindings)):
                pass
            if not is_known:
                raise self._refuse(
                    statement, f"found {word!r}, which may be a script that changes any name", "assignments"
                )
        if word in ("clear", "clearvars", "sympref"):
            return

    def _syms(self, statement: Statement) -> None:
        words = (
            re.sub(r"^\s*\((.*)\)\s*$", r"\1", statement.words).replace("'", " ").replace('"', " ").replace(",", " ")
        )
        for match in re.finditer(r"([A-Za-z]\w*)(\s*\([^)]*\))?(\s*\[[^\]]*\])?", words, re.ASCII):
            name, arguments, shape = match.groups()
            if name in ("real", "positive", "integer", "rational", "clear", "nonnegative", "matrix"):
                continue
            if shape:
                numbers = [int(k) for k in re.findall(r"\d{1,3}", shape)]
                length = max(numbers, default=0)
                if len(numbers) > 2 or (len(numbers) == 2 and min(numbers) > 1):
                    self._not_understood([name], statement, "'syms' of a matrix")
                    continue
                entries: dict[tuple[int, ...], Formula] = {(k,): Formula(f"{name}{k + 1}") for k in range(length)}
                for entry in entries.values():
                    self._bind(entry.text, statement, Symbol(entry.text))
                self._bind(
                    name, statement, Formula(f"[{', '.join(e.text for e in entries.values())}]", entries=entries)
                )
                continue
            if arguments and arguments.replace(" ", "") != "(t)":
                self._not_understood([name], statement, "'syms' of a function of other names than t")
                continue
            self._bind(name, statement, Symbol(name))

    def _change(self, statement: Statement, changing: int | None) -> None:
        """Read M(1,1) += formula; other changes are not understood."""
        tokens = statement.tokens
        if changing is not None and tokens[changing].text == "+=":
            target = self._target(tokens[:changing])
            if target is not None and target[1] is not None:
                formula = self.formulas.formula(tokens[changing + 1 :])
                if not formula.is_matrix:
                    self._bind(target[0], statement, formula, target[1], is_added=True)
                    return
        line = self._line(statement)
        for name in sorted(_targets(statement)):
            self._bind(name, statement, NotUnderstood(f"{name} is changed after it is assigned, in {line}"))

    @staticmethod
    def _target(tokens: Sequence[MatlabToken]) -> tuple[str, tuple[int, ...] | None] | None:
        """Return the name and the index that are assigned; nothing where the left-hand side is not read."""
        if not tokens or tokens[0].kind != "name":
            return None
        name = tokens[0].text
        if len(tokens) == 1:
            return name, None
        if len(tokens) == 3 and tokens[1].text == "." and tokens[2].kind == "name":
            return f"{name}.{tokens[2].text}", None
        if tokens[1].text != "(" or closing(tokens, 1) != len(tokens) - 1:
            return None
        inside = tokens[2:-1]
        numbers = [t.text for t in inside[::2]]
        commas = [t.text for t in inside[1::2]]
        plain = numbers and all(k.isdecimal() and 0 < int(k[:5]) <= 1000 for k in numbers)
        if not plain or set(commas) - {","} or len(inside) % 2 == 0:
            return None
        return name, tuple(int(k) - 1 for k in numbers)

    def _assign(self, statement: Statement, left: Sequence[MatlabToken], right: Sequence[MatlabToken]) -> None:
        target = self._target(left)
        if target is None or not right:
            self._not_understood(_targets(statement), statement, "an assignment that is not read")
            return
        name, index = target
        if right[0].text == "@":
            self._handle(name, index, statement, right)
            return
        if index is None and self._symbol(name, statement, right):
            return
        formula = self.formulas.formula(right)
        if index is None and formula.text == name and not formula.problem:
            return  # M = simplify(M)
        if index is None and formula.problem and (alias := self._function_alias(right)):
            self._bind(name, statement, FunctionNamed(alias))
            return
        if index is not None and formula.is_matrix:
            self._not_understood([name], statement, "an assignment of a matrix to a part of it")
            return
        single = (id(self.scope), name)
        if formula.is_zeros and re.fullmatch(r"zeros\(1(, ?1)?\)", formula.text):
            self.single.add(single)
        elif index is None and single in self.single and not formula.is_matrix:
            index = ()  # the one entry of zeros(1, 1)
        added = self._added(name, index, formula)
        if "." in name:
            self._bind(name.partition(".")[0], statement, ModuleNamed(STRUCTURE))
        self._bind(name, statement, added or formula, index, is_added=added is not None)

    @staticmethod
    def _function_alias(right: Sequence[MatlabToken]) -> str:
        return right[1].text if len(right) == 2 and right[0].text == "@" else ""

    def _added(self, name: str, index: tuple[int, ...] | None, formula: Formula) -> Formula | None:
        """Return what M(1,1) = M(1,1) + rest adds to the entry."""
        own = [read for read in formula.reads if read.name == name and (read.index or ()) == (index or ())]
        if index is None or len(own) != 1 or own[0].start != 0 or formula.problem:
            return None
        rest = formula.text[own[0].end :]
        if not re.match(r"\s*[-+]", rest):
            return None
        end = own[0].end + (len(rest) - len(rest.lstrip()))
        sign = formula.text[end]
        start = end + (sign == "+")
        reads = tuple(
            type(r)(r.name, r.start - start, r.end - start, r.index, r.member, r.use)
            for r in formula.reads
            if r.start >= start
        )
        return Formula(formula.text[start:], reads)

    def _symbol(self, name: str, statement: Statement, right: Sequence[MatlabToken]) -> bool:
        """Read q1 = sym('q1', 'real')."""
        words = [t.text for t in right]
        if len(words) < 4 or words[:2] != ["sym", "("] or right[2].kind != "string" or "sym" in self.bound:
            return False
        if closing(right, 1) != len(right) - 1 or "[" in words:
            return False
        match = re.fullmatch(r"([A-Za-z]\w*)(\(t\))?", right[2].text[1:-1], re.ASCII)
        if match is None:
            return False
        self._bind(name, statement, Symbol(match[1]))
        return True

    def _handle(
        self, name: str, index: tuple[int, ...] | None, statement: Statement, right: Sequence[MatlabToken]
    ) -> None:
        """Read M = @(q1, q2) [...] as a function, and s = @sin as another name of one."""
        if len(right) == 2 and right[1].kind == "name" and index is None:
            self._bind(name, statement, FunctionNamed(right[1].text if right[1].text not in self.owns else ""))
            return
        if index is not None or len(right) < 3 or right[1].text != "(" or self.blocks or self.function is not None:
            self._not_understood([name], statement, "'@'")
            return
        end = closing(right, 1)
        self._bind(name, statement, FunctionNamed(""))
        scope = Scope(outer=self.program.main)
        self.program.functions.append(scope)
        for token in right[2:end]:
            if token.kind == "name":
                self.program.bind(scope, token.text, self._line(statement), Symbol(token.text, is_argument=True))
        self.program.bind(scope, "return", self._line(statement), self.formulas.formula(right[end + 1 :]))
        scope.returned.append(Returned(name, "return"))


def _outside(tokens: Sequence[MatlabToken]) -> list[bool]:
    """Return of each token whether it stands in no brackets."""
    depth, found = 0, []
    for token in tokens:
        depth += min(token.nesting, 0)
        found.append(depth == 0)
        depth += max(token.nesting, 0)
    return found


def _targets(statement: Statement) -> set[str]:
    """Return the names that a statement may assign."""
    tokens = statement.tokens
    found: set[str] = set()
    word = tokens[0].text
    if word in ("syms", "global", "persistent"):
        found |= set(re.findall(r"[A-Za-z]\w*", statement.words))
    if word in ("for", "parfor", "catch") and len(tokens) > 1:
        names = [t.text for t in tokens[1:] if t.kind == "name"]
        found |= set(names[:1])
    for k, token in enumerate(tokens):
        if token.kind != "sign" or (
            token.text != "=" and token.text not in ASSIGNING and token.text not in ("++", "--")
        ):
            continue
        before = k - 1
        if token.text in ("++", "--") and k + 1 < len(tokens) and tokens[k + 1].kind == "name":
            found.add(tokens[k + 1].text)
        if before < 0:
            continue
        found |= _assigned_before(tokens, before)
    return found


def _assigned_before(tokens: Sequence[MatlabToken], k: int) -> set[str]:
    """Return the names that a left-hand side that ends at k assigns."""
    if tokens[k].text == "]" and tokens[k].kind == "sign":
        depth, start = 0, k
        for at in range(k, -1, -1):
            depth -= tokens[at].nesting
            start = at
            if depth == 0:
                break
        entries = [entry for row in split_rows(tokens[start + 1 : k]) for entry in row]
        return {entry[0].text for entry in entries if entry[0].kind == "name"}
    depth = 0
    for at in range(k, -1, -1):
        token = tokens[at]
        depth -= token.nesting
        if depth < 0:
            return set()
        is_head = token.kind == "name" and depth == 0 and (at == 0 or tokens[at - 1].text != ".")
        if is_head:
            return {token.text}
    return set()
