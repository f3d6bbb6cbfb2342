"""Python programs as bindings: a closed list of statements is understood, and every other one is noted as a change."""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence

from dhkit.errors import AnswerError
from dhkit.grading.answers.programs.bindings import (
    MAX_STATEMENTS,
    RETURNED_FORMULA,
    DefaultArgument,
    Formula,
    LibraryFunction,
    Module,
    NotUnderstood,
    OwnFunction,
    Program,
    Read,
    ReturnValue,
    Scope,
    Symbol,
    Value,
    vector_of_names,
)
from dhkit.grading.answers.programs.python_effects import SideEffectAnalysis, bound_names, names_in, part_names
from dhkit.grading.answers.programs.python_formulas import EXACT, PythonFormulas, constant_index, has_starred
from dhkit.grading.answers.programs.python_text import ascii_name
from dhkit.grading.answers.programs.python_values import PythonValues, class_fields
from dhkit.grading.answers.tokens import word_set
from dhkit.grading.answers.vocabulary import plain_name

MODULES = word_set(
    """
    numpy sympy math cmath mpmath casadi jax.numpy autograd.numpy numpy.lib.scimath sympy.physics.mechanics
    sympy.physics.vector sympy.matrices sympy.abc symengine pylab
    """
)
"""Modules whose sin is the sine, and whose other functions mean what their names say."""

EXPORTED_LETTERS = frozenset("EINOQSe")
"""Names of one letter that these modules export."""


def python_program(text: str, file: str, line_name: Callable[[int], str], n: int) -> Program:
    """Read a program of Python's; nothing in it is run.

    Parameters
    ----------
    text
        The program.
    file
        What messages begin with.
    line_name
        How messages name a line, which counts from 1.
    n
        The number of joints: ``q1, q2 = q`` takes a vector of them apart.

    Raises
    ------
    AnswerError
        No Python, more statements than are read, or one that may change any name.
    """
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    for line in text.split("\n")[:2]:
        coding = re.match(r"[ \t\f]*#.*?coding[:=][ \t]*([-\w.]+)", line)
        if coding and coding[1].lower().replace("_", "-") not in ("utf-8", "utf8", "utf-8-sig", "ascii", "us-ascii"):
            raise AnswerError(f"{file}: {line_name(1)}: written in {coding[1][:20]!r}; expected UTF-8")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(text, filename=file or "program")
    except SyntaxError as error:
        at = line_name(error.lineno) if error.lineno else "the program"
        raise AnswerError(f"{file}: {at}: no Python: {str(error.msg)[:100]}") from None
    except (RecursionError, MemoryError):
        raise AnswerError(f"{file}: brackets or sums nested too deep to be read; write long sums in parts") from None
    except ValueError as error:
        raise AnswerError(f"{file}: no Python: {str(error)[:100]}") from None
    try:
        return _ProgramReader(text, file, line_name, n).read(tree)
    except RecursionError:
        raise AnswerError(f"{file}: statements nested too deep to be read") from None


class _ProgramReader:
    """Reads statement after statement; ``scope`` and ``statement`` are the current ones."""

    def __init__(self, text: str, file: str, line_name: Callable[[int], str], n: int) -> None:
        self.n = n
        self.file = file
        self.line_name = line_name
        self.program = Program()
        self.scope = self.program.main
        self.statement: ast.stmt = ast.Pass(lineno=1, col_offset=0)
        self.statement_count = 0
        self.analysis = SideEffectAnalysis()
        self.formulas = PythonFormulas(text)
        self.values = PythonValues(self.analysis, self.formulas)

    def read(self, tree: ast.Module) -> Program:
        self.analysis.own |= {ascii_name(name) for name in bound_names(tree.body)}
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                for returned in _returns([node]):
                    if returned.value is not None:
                        self.analysis.add_alias(node.name, self.analysis.shared_names(returned.value))
        self._block(tree.body)
        for scope in self.program.functions:
            self._take_changes_outside(scope)
        return self.program

    @property
    def is_in_main(self) -> bool:
        return self.scope is self.program.main

    def _line(self, node: ast.stmt | ast.expr | None = None) -> str:
        return self.line_name((node or self.statement).lineno)

    def _bind(self, name: str, value: Value) -> None:
        self.program.bind(self.scope, ascii_name(name), self._line(), value)

    def _bind_changed(
        self, names: Iterable[str], what: str, scope: Scope | None = None, node: ast.stmt | None = None
    ) -> None:
        """Note that a statement changes names, whatever they stand for, in a way that is not read."""
        line = self._line(node)
        for name in names:
            reason = f"{ascii_name(name)[:40]} is changed by {what} in {line}"
            self.program.bind(scope or self.scope, ascii_name(name), line, NotUnderstood(reason))

    def _bind_changed_matrix(self, name: str, change: str, node: ast.expr | None = None) -> None:
        """Note that a name may be changed in a way that is not read, where it stands for a matrix or a list."""
        value = NotUnderstood(f"{ascii_name(name)[:40]} {change}", only_matrices=True)
        self.program.bind(self.scope, ascii_name(name), self._line(node), value)

    def _bind_changed_aliases(self, name: str) -> None:
        """Note that other names of a matrix change with it."""
        for other in self.analysis.aliases(name):
            reason = f"{other[:40]} may be the same matrix as {name[:40]}, which is changed in {self._line()}"
            self._bind(other, NotUnderstood(reason, only_matrices=True))

    def _take_changes_outside(self, scope: Scope) -> None:
        """Bind what a function changes of the program's matrices in the program."""
        for name, bindings in list(scope.bindings.items()):
            is_local = any(b.index is None and not isinstance(b.value, NotUnderstood) for b in bindings)
            if is_local or name == RETURNED_FORMULA or scope.outer is None:
                continue
            for binding in bindings:
                value = binding.value
                if not isinstance(value, NotUnderstood):
                    value = NotUnderstood(f"{name} is changed inside a function, in {binding.line}")
                self.program.bind(scope.outer, name, binding.line, value)

    # Statements

    def _block(self, statements: Sequence[ast.stmt]) -> None:
        outer = self.statement
        for statement in statements:
            self.statement = statement
            self.statement_count += 1
            if self.statement_count > MAX_STATEMENTS:
                raise AnswerError(f"{self.file}: more than {MAX_STATEMENTS} statements")
            self._side_effects(statement)
            self._statement(statement)
        self.statement = outer

    def _side_effects(self, statement: ast.stmt) -> None:
        """Note what the calls of a statement may change."""
        effects = self.analysis.effects_of(statement)
        if effects.unbounded:
            raise AnswerError(
                f"{self.file}: {self._line(effects.unbounded)}: found {self._quote(effects.unbounded)}, which may "
                "change any name; a program is read, not run"
            )
        for name, call in effects.changed.items():
            self._bind_changed_matrix(name, f"may be changed by {self._quote(call)} in {self._line(call)}", call)
        if not isinstance(statement, ast.FunctionDef | ast.ClassDef):
            self._bind_changed(effects.walrus_names, ":=", node=statement)

    def _quote(self, node: ast.expr) -> str:
        return repr(self.formulas.source.segment(node)[:40])

    def _statement(self, statement: ast.stmt) -> None:
        match statement:
            case ast.Expr() | ast.Pass() | ast.Assert() | ast.Raise() | ast.Return() | ast.Global() | ast.Nonlocal():
                return
            case ast.Assign(targets, value):
                for target in targets:
                    self._assign(target, value)
                    if len(targets) > 1 and isinstance(target, ast.Name) and not isinstance(value, ast.Constant):
                        self.analysis.add_alias(target.id, [name for other in targets for name in names_in(other)])
            case ast.AnnAssign(target, _, value):
                if value is not None:
                    self._assign(target, value)
            case ast.AugAssign(ast.Subscript(ast.Name(name), index), ast.Add(), value):
                self._assign_entry(name, [index], value, is_added=True)
            case ast.AugAssign():
                for name in bound_names([statement]):
                    self._bind_changed_aliases(name)
                    reason = f"{ascii_name(name)[:40]} is changed after it is assigned, in {self._line()}"
                    self._bind(name, NotUnderstood(reason))
            case ast.Import(aliases):
                for alias in aliases:
                    self._import(alias)
            case ast.ImportFrom(module, aliases):
                for alias in aliases:
                    self._import_from(module or ".", alias)
            case ast.FunctionDef(name, arguments, body, decorators) if self.is_in_main:
                self._function(name, arguments, body, bool(decorators))
            case ast.ClassDef():
                self._class(statement)
            case _:
                self._bind_changed_parts(self.analysis.changed_by_block(statement))
                kind = {"FunctionDef": "a function of this name", "Delete": "'del'"}.get(type(statement).__name__)
                self._bind_changed(bound_names([statement]), kind or f"{type(statement).__name__.lower()!r}")

    def _class(self, statement: ast.ClassDef) -> None:
        if self.is_in_main:
            self.values.structures[statement.name] = class_fields(statement)
        self._bind_changed([statement.name], "a class of this name")
        self._bind_changed(_global_names(statement.body), "'global'")
        self._bind_changed_parts(self.analysis.changed_by_class(statement))
        if self.is_in_main and any(isinstance(x, ast.FunctionDef) for x in statement.body):
            self.program.left_out.append(f"{self._line()}: class {statement.name[:40]}")

    def _bind_changed_parts(self, names: Iterable[str]) -> None:
        """Note what a block that is not understood may change under another name."""
        for name in names:
            self._bind_changed_matrix(name, f"may be changed in the block of {self._line()}")

    # Assignments

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        match target:
            case ast.Name(name):
                self._assign_name(name, value)
            case ast.Tuple(targets) | ast.List(targets):
                self._assign_several(targets, value)
            case ast.Subscript(ast.Name(name), index):
                self._assign_entry(name, [index], value)
            case ast.Subscript(ast.Subscript(ast.Name(name), first), second):
                self._assign_entry(name, [first, second], value)
            case _:
                names = bound_names([self.statement])
                shared = sorted(self.analysis.shared_names(value))
                self._alias_parts(names, shared)
                self._bind_changed(names, "an assignment to a part of it")
                for name in shared:
                    change = f"is stored in a part of {names[0] if names else 'another'}"
                    self._bind_changed_matrix(name, f"{change} in {self._line()}, and may be changed there")

    def _alias_parts(self, names: Iterable[str], shared: Iterable[str]) -> None:
        """Note other names of the matrices whose parts the statement assigns, and those that it makes."""
        for name in part_names(self.statement):
            self._bind_changed_aliases(name)
        for name in names:
            self.analysis.add_alias(name, shared)

    def _assign_name(self, name: str, value: ast.expr) -> None:
        if self.values.is_unchanged(name, value):
            return
        self.analysis.add_alias(name, self.analysis.shared_names(value))
        structures = self.values.structures
        if self.is_in_main and (fields := self.values.fields(value)):
            structures[name] = {} if name in structures else fields
        if isinstance(value, ast.Lambda) and self.is_in_main:
            self._function(name, value.args, value.body, False)
        elif symbols := self.values.symbols(value):
            vector = vector_of_names([plain_name(symbol) for symbol in symbols], symbols)
            self._bind(name, Symbol(symbols[0]) if len(symbols) == 1 else vector)
        else:
            function = self.values.library_function(value)
            self._bind(name, LibraryFunction(function) if function else self.formulas.formula(value))

    def _assign_several(self, targets: Sequence[ast.expr], value: ast.expr) -> None:
        names = [target.id for target in targets if isinstance(target, ast.Name)]
        everything = bound_names([self.statement])
        self._alias_parts(everything, self.analysis.shared_names(value))
        symbols = self.values.symbols(value)
        if len(names) == len(targets):
            if symbols is not None and len(symbols) == len(names):
                for name, symbol in zip(names, symbols, strict=True):
                    self._bind(name, Symbol(symbol))
                return
            match value:
                case ast.Tuple(values) | ast.List(values) if len(values) == len(names) and not has_starred(values):
                    self._assign_pairwise(names, values)
                    return
                case ast.Call(ast.Attribute(ast.Name(module), "broadcast_arrays"), values) if (
                    len(values) == len(names) and module in self.analysis.modules
                ):
                    self._assign_pairwise(names, values)
                    return
                case ast.Name(vector) if len(names) == self.n:
                    for k, name in enumerate(names):
                        text = f"{ascii_name(vector)}[{k}]"
                        self._bind(name, Formula(text, (Read(ascii_name(vector), 0, len(text), (k,)),)))
                    return
        self._bind_changed(everything, "an unpacking that is not read")

    def _assign_pairwise(self, names: Sequence[str], values: Sequence[ast.expr]) -> None:
        """Bind several names at once: what is read on the right was bound before."""
        order = self.program.order
        for name, value in zip(names, values, strict=True):
            self.program.order = order
            self._assign_name(name, value)
        self.program.order = order + 1

    def _assign_entry(self, name: str, indices: Sequence[ast.expr], value: ast.expr, is_added: bool = False) -> None:
        formula = self.formulas.formula(value)
        self._bind_changed_aliases(name)
        self.analysis.add_alias(name, self.analysis.shared_names(value) if not isinstance(value, ast.Subscript) else ())
        numbers = [constant_index(index) for index in indices]
        if any(index is None for index in numbers) or formula.is_matrix:
            self._bind_changed([name], "an assignment to a part of it")
            return
        index = tuple(k for part in numbers if part is not None for k in part)
        self.program.bind(self.scope, ascii_name(name), self._line(), formula, index, is_added)

    # Imports

    def _import(self, alias: ast.alias) -> None:
        first = alias.name.split(".")[0]
        name, module = alias.asname or first, alias.name if alias.asname else first
        if module in MODULES:
            self.analysis.modules.add(name)
            self._bind(name, Module(module))
        else:
            self._bind(name, NotUnderstood(f"{name[:40]} is the module {module[:40]} since {self._line()}"))

    def _import_from(self, module: str, alias: ast.alias) -> None:
        name, full_name = alias.asname or alias.name, f"{module}.{alias.name}"
        if alias.name == "*":
            self._import_everything(module)
        elif module == "sympy.abc":
            self._bind(name, Symbol(alias.name))
        elif module in MODULES or module in ("sympy.functions", "sympy.core"):
            self.analysis.imported.add(name)
            if alias.name in EXACT and alias.name != name:
                reason = f"{name[:40]} is {alias.name} in {self._line()}, which is read by its own name"
                self._bind(name, NotUnderstood(reason))
            else:
                self._bind(name, Symbol("pi") if alias.name == "pi" else LibraryFunction(alias.name))
        elif full_name in MODULES:
            self.analysis.modules.add(name)
            self._bind(name, Module(full_name))
        else:
            self._bind(name, NotUnderstood(f"{name[:40]} comes from {module[:40]} in {self._line()}"))

    def _import_everything(self, module: str) -> None:
        """Note which names ``from module import *`` may replace; the names of the module mean what they say."""
        if module not in MODULES or module == "sympy.abc":
            raise AnswerError(
                f"{self.file}: {self._line()}: found 'from {module[:40]} import *', which may change any "
                "name; expected numpy, sympy or math"
            )
        main = self.program.main
        for name, bindings in list(main.bindings.items()):
            is_exported = name in EXPORTED_LETTERS if len(name) == 1 else not any(c.isdigit() for c in name)
            has_value = any(isinstance(b.value, Formula | Symbol | OwnFunction) for b in bindings)
            if is_exported and has_value and name not in ("tau", "KE", "PE", "Tau", "Jac"):
                self._bind_changed([name], f"'from {module} import *'", main)

    # Functions

    def _function(
        self, name: str, arguments: ast.arguments, body: Sequence[ast.stmt] | ast.expr, is_decorated: bool
    ) -> None:
        self._bind(name, OwnFunction())
        main, self.scope = self.scope, self.program.add_function(outer=self.scope)
        self._arguments(arguments)
        if isinstance(body, ast.expr):
            self._side_effects(ast.copy_location(ast.Expr(body), body))
            self._return_value(name, body, self.statement)
        else:
            self._bind_changed(_global_names(body), "'global' in a function", main)
            self._function_body(name, body, is_decorated)
        self.scope = main

    def _arguments(self, arguments: ast.arguments) -> None:
        positional = [*arguments.posonlyargs, *arguments.args]
        for argument in [*positional, *arguments.kwonlyargs]:
            is_object = argument.arg in ("self", "cls")
            reason = f"{argument.arg} is an object, in {self._line()}"
            symbol = Symbol(ascii_name(argument.arg), is_argument=True)
            self._bind(argument.arg, NotUnderstood(reason) if is_object else symbol)
        defaults = [
            *zip(reversed(positional), reversed(arguments.defaults), strict=False),
            *zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True),
        ]
        for argument, default in defaults:
            if default is None:
                continue
            self.analysis.add_alias(argument.arg, self.analysis.shared_names(default))
            fields = self.values.fields(default)
            for field, value in fields.items():
                self._bind(f"{ascii_name(argument.arg)}.{ascii_name(field)}", self.formulas.formula(value))
            self._bind(argument.arg, DefaultArgument(self.formulas.formula(default), bool(fields)))
        for rest in (arguments.vararg, arguments.kwarg):
            if rest is not None:
                self._bind_changed([rest.arg], "'*'")

    def _function_body(self, name: str, body: Sequence[ast.stmt], is_decorated: bool) -> None:
        *before, last = body
        early = _returns(before)
        self._block(body)
        for global_name in _global_names(body):
            self.scope.bindings.pop(ascii_name(global_name), None)
        if isinstance(last, ast.Return) and last.value is not None and not is_decorated and not early:
            self._return_value(name, last.value, last)
        elif isinstance(last, ast.Return) or early:
            cause = "a decorator" if is_decorated else "several 'return'" if early else "'return'"
            where = self._line(early[0] if early and isinstance(early[0], ast.stmt) else self.statement)
            self._bind(RETURNED_FORMULA, NotUnderstood(f"{name} has {cause}, in {where}"))
            self.scope.return_values.append(ReturnValue(name, RETURNED_FORMULA))

    def _return_value(self, name: str, value: ast.expr, statement: ast.stmt) -> None:
        """Note what a function returns: local names, or a formula."""
        match value:
            case ast.Tuple(values) | ast.Dict(_, values):
                is_only = False
            case _:
                values, is_only = [value], True
        locals_ = [self.values.local_name(x, self.scope) for x in values]
        if all(locals_):
            self.scope.return_values += [ReturnValue(name, local, is_only) for local in locals_]
            return
        self.program.bind(self.scope, RETURNED_FORMULA, self._line(statement), self.formulas.formula(value))
        names = dict.fromkeys(ascii_name(x) for x in names_in(value))
        self.scope.return_values.append(ReturnValue(name, RETURNED_FORMULA, names=tuple(names)))


def _nodes(statements: Sequence[ast.stmt]) -> Iterator[ast.AST]:
    return (node for statement in statements for node in ast.walk(statement))


def _returns(statements: Sequence[ast.stmt]) -> list[ast.Return | ast.Yield | ast.YieldFrom]:
    return [node for node in _nodes(statements) if isinstance(node, ast.Return | ast.Yield | ast.YieldFrom)]


def _global_names(statements: Sequence[ast.stmt]) -> list[str]:
    return [name for node in _nodes(statements) if isinstance(node, ast.Global | ast.Nonlocal) for name in node.names]
