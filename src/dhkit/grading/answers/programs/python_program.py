"""Python programs as bindings: a closed list of statements is understood, and every other one is noted as a change."""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Callable, Iterable, Sequence

from dhkit.errors import AnswerError
from dhkit.grading.answers.programs.bindings import (
    Default,
    Formula,
    FunctionNamed,
    ModuleNamed,
    NotUnderstood,
    Program,
    Read,
    Returned,
    Scope,
    Symbol,
    Use,
    Value,
)
from dhkit.grading.answers.programs.python_effects import Effects, bound_names, part_names
from dhkit.grading.answers.programs.python_formulas import EXACT, VECTORS, PythonFormulas, constant_index, spelled
from dhkit.grading.answers.tokens import dotted
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, plain_name

MAX_STATEMENTS = 5_000
MAX_SYMBOLS = 1_000
MODULES = frozenset(
    (
        "numpy",
        "sympy",
        "math",
        "cmath",
        "mpmath",
        "casadi",
        "jax.numpy",
        "autograd.numpy",
        "numpy.lib.scimath",
        "sympy.physics.mechanics",
        "sympy.physics.vector",
        "sympy.matrices",
        "sympy.abc",
        "symengine",
        "pylab",
    )
)
"""Modules whose sin is the sine, and whose other functions mean what their names say."""
SYMBOL_CALLS = frozenset(("symbols", "Symbol", "dynamicsymbols", "var", "Dummy"))
LATER = frozenset("EINOQSe")
"""Names of one letter that modules export."""


def python_program(text: str, file: str, line_name: Callable[[int], str], n: int) -> Program:
    """Read a program of Python's; nothing in it is run.

    Parameters
    ----------
    text
        The program.
    file
        What messages begin with.
    line_name
        How messages name a line.
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
        return _Reader(text, file, line_name, n).read(tree)
    except RecursionError:
        raise AnswerError(f"{file}: statements nested too deep to be read") from None


class _Reader:
    def __init__(self, text: str, file: str, line_name: Callable[[int], str], n: int) -> None:
        self.n = n
        self.formulas = PythonFormulas(text)
        self.file = file
        self.line_name = line_name
        self.program = Program()
        self.effects = Effects()
        self.statements = 0
        self.fields: dict[str, dict[str, ast.expr]] = {}

    def read(self, tree: ast.Module) -> Program:
        self.effects.own |= {spelled(name) for name in bound_names(tree.body)}
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                given = [x.value for x in ast.walk(node) if isinstance(x, ast.Return | ast.Yield | ast.YieldFrom)]
                for value in given:
                    self.effects.alias(node.name, self.effects.parts(value) if value is not None else ())
        self._block(tree.body, self.program.main)
        for scope in self.program.functions:
            self._changes_outside(scope)
        return self.program

    def _line(self, node: ast.stmt | ast.expr) -> str:
        return self.line_name(node.lineno)

    def _bind(self, scope: Scope, name: str, node: ast.stmt | ast.expr, value: Value) -> None:
        self.program.bind(scope, spelled(name), self._line(node), value)

    def _not_understood(self, scope: Scope, names: Iterable[str], node: ast.stmt | ast.expr, what: str) -> None:
        for name in names:
            reason = f"{spelled(name)[:40]} is changed by {what} in {self._line(node)}"
            self._bind(scope, name, node, NotUnderstood(reason))

    def _changes_outside(self, scope: Scope) -> None:
        """Take what a function changes of the program's matrices to the program."""
        for name, bindings in list(scope.bindings.items()):
            whole = [b for b in bindings if b.index is None and not isinstance(b.value, NotUnderstood)]
            if whole or not bindings or name == "return":
                continue
            outer = scope.outer
            for binding in bindings:
                reason = f"{name} is changed inside a function, in {binding.line}"
                value = binding.value if isinstance(binding.value, NotUnderstood) else NotUnderstood(reason)
                if outer is not None and (binding.index is not None or isinstance(binding.value, NotUnderstood)):
                    self.program.bind(outer, name, binding.line, value)

    # Statements

    def _block(self, statements: Sequence[ast.stmt], scope: Scope) -> None:
        for statement in statements:
            self.statements += 1
            if self.statements > MAX_STATEMENTS:
                raise AnswerError(f"{self.file}: more than {MAX_STATEMENTS} statements")
            self._side_effects(statement, scope)
            self._statement(statement, scope)

    def _side_effects(self, statement: ast.stmt, scope: Scope) -> None:
        """Note what the calls of a statement may change."""
        found = self.effects.of(statement)
        if found.anything:
            what = self._line(found.anything)
            raise AnswerError(
                f"{self.file}: {what}: found {self._shown(found.anything)}, which may change any name; "
                "a program is read, not run"
            )
        for name, node in found.changed.items():
            reason = f"{spelled(name)[:40]} may be changed by {self._shown(node)} in {self._line(node)}"
            self.program.bind(scope, spelled(name), self._line(node), NotUnderstood(reason, only_matrices=True))
        if not isinstance(statement, ast.FunctionDef | ast.ClassDef):
            self._not_understood(scope, found.walrus, statement, ":=")

    def _shown(self, node: ast.expr) -> str:
        return repr(self.formulas.segment(node)[:40])

    def _statement(self, statement: ast.stmt, scope: Scope) -> None:
        match statement:
            case ast.Expr() | ast.Pass() | ast.Assert() | ast.Raise() | ast.Return() | ast.Global() | ast.Nonlocal():
                return
            case ast.Assign(targets, value):
                for target in targets:
                    self._assign(target, value, statement, scope, shared=len(targets) > 1)
            case ast.AnnAssign(target, _, value):
                if value is not None:
                    self._assign(target, value, statement, scope)
            case ast.AugAssign():
                self._augmented(statement, scope)
            case ast.Import() | ast.ImportFrom():
                self._imported(statement, scope)
            case ast.FunctionDef() if scope is self.program.main:
                self._function(
                    statement.name, statement.args, statement.body, statement, bool(statement.decorator_list)
                )
            case ast.ClassDef():
                if scope is self.program.main:
                    self.fields[statement.name] = _class_fields(statement)
                self._not_understood(scope, [statement.name], statement, "a class of this name")
                self._not_understood(scope, _globals(statement.body), statement, "'global'")
                self._block_changes(statement, scope)
                if scope is self.program.main and any(isinstance(x, ast.FunctionDef) for x in statement.body):
                    self.program.left_out.append(f"{self._line(statement)}: class {statement.name[:40]}")
            case _:
                self._block_changes(statement, scope)
                names = bound_names([statement])
                kind = {"FunctionDef": "a function of this name", "Delete": "'del'"}.get(type(statement).__name__)
                self._not_understood(scope, names, statement, kind or f"{type(statement).__name__.lower()!r}")

    def _block_changes(self, statement: ast.stmt, scope: Scope) -> None:
        """Note what a block that is not understood may change under another name."""
        line = self._line(statement)
        if isinstance(statement, ast.ClassDef):
            names = self.effects.of_class(statement)
        else:
            names = self.effects.of_block(statement)
        for name in names:
            reason = f"{spelled(name)[:40]} may be changed in the block of {line}"
            self._bind(scope, name, statement, NotUnderstood(reason, only_matrices=True))

    # Assignments

    def _assign(
        self, target: ast.expr, value: ast.expr, statement: ast.stmt, scope: Scope, shared: bool = False
    ) -> None:
        match target:
            case ast.Name(name):
                self._assign_name(name, value, statement, scope)
                if shared and not isinstance(value, ast.Constant):
                    self.effects.alias(name, [other for t in getattr(statement, "targets", []) for other in _names(t)])
            case ast.Tuple(elements) | ast.List(elements):
                self._assign_several(elements, value, statement, scope)
            case ast.Subscript(ast.Name(name), index):
                self._assign_entry(name, [index], value, statement, scope)
            case ast.Subscript(ast.Subscript(ast.Name(name), first), second):
                self._assign_entry(name, [first, second], value, statement, scope)
            case _:
                names = bound_names([statement])
                self._parts_changed(statement, scope)
                shared_with = sorted(self.effects.parts(value))
                for name in names:
                    self.effects.alias(name, shared_with)
                self._not_understood(scope, names, statement, "an assignment to a part of it")
                for other in shared_with:
                    reason = f"{spelled(other)[:40]} is stored in a part of {names[0] if names else 'another'}"
                    reason += f" in {self._line(statement)}, and may be changed there"
                    self._bind(scope, other, statement, NotUnderstood(reason, only_matrices=True))

    def _parts_changed(self, statement: ast.stmt, scope: Scope) -> None:
        """Note that other names of the matrices change whose parts a statement assigns."""
        for name in part_names(statement):
            self._alias_changed(name, statement, scope)

    def _assign_name(self, name: str, value: ast.expr, statement: ast.stmt, scope: Scope) -> None:
        if self._is_same(name, value):
            return
        self.effects.alias(name, self.effects.parts(value))
        if scope is self.program.main and (fields := self._fields(value)):
            self.fields[name] = {} if name in self.fields else fields
        if isinstance(value, ast.Lambda) and scope is self.program.main:
            self._function(name, value.args, value.body, statement, False)
            return
        found = self._symbols(value)
        if found is not None:
            if len(found) == 1:
                self._bind(scope, name, statement, Symbol(found[0]))
            else:
                entries: dict[tuple[int, ...], Formula] = {
                    (k,): Formula(plain_name(symbol)) for k, symbol in enumerate(found)
                }
                self._bind(scope, name, statement, Formula(f"[{', '.join(found)}]", entries=entries))
            return
        function = self._function_name(value)
        self._bind(scope, name, statement, FunctionNamed(function) if function else self.formulas.formula(value))

    def _function_name(self, value: ast.expr) -> str:
        """Return the library's function that a value is; empty of another value."""
        match value:
            case ast.Name(name) if name not in self.effects.own or name in self.effects.imported:
                function = name
            case ast.Attribute(ast.Name(module), name) if module in self.effects.modules:
                function = name
            case _:
                return ""
        return str(function) if function in FUNCTION_NAMES and len(function) > 1 and function not in EXACT else ""

    def _is_same(self, name: str, value: ast.expr) -> bool:
        """Whether a value is the name itself, simplified, or as an array."""
        formula = self.formulas.formula(value)
        inner = value
        while isinstance(inner, ast.Call):
            called = inner.func.id if isinstance(inner.func, ast.Name) else getattr(inner.func, "attr", "")
            is_module = isinstance(inner.func, ast.Name) or (
                isinstance(inner.func, ast.Attribute)
                and isinstance(inner.func.value, ast.Name)
                and inner.func.value.id in self.effects.modules
            )
            if (
                called in ("flatten", "ravel", "squeeze", "copy")
                and not inner.args
                and isinstance(inner.func, ast.Attribute)
            ):
                inner = inner.func.value
                continue
            if (
                called not in VECTORS
                or not is_module
                or len(inner.args) != 1
                or called in self.effects.own - self.effects.imported
            ):
                break
            inner = inner.args[0]
        if isinstance(inner, ast.Name) and spelled(inner.id) == spelled(name):
            return True
        reads = [read for read in formula.reads if read.use is Use.VALUE]
        return formula.text == name and len(reads) == 1 and not formula.problem and formula.entries is None

    def _assign_several(self, targets: Sequence[ast.expr], value: ast.expr, statement: ast.stmt, scope: Scope) -> None:
        names = [target.id for target in targets if isinstance(target, ast.Name)]
        everything = bound_names([statement])
        shared_with = self.effects.parts(value)
        self._parts_changed(statement, scope)
        for name in everything:
            self.effects.alias(name, shared_with)
        if len(names) != len(targets):
            self._not_understood(scope, everything, statement, "an unpacking that is not read")
            return
        found = self._symbols(value)
        if found is not None and len(found) == len(names):
            for name, symbol in zip(names, found, strict=True):
                self._bind(scope, name, statement, Symbol(symbol))
            return
        match value:
            case ast.Tuple(values) | ast.List(values) if len(values) == len(names) and not _starred(values):
                self._assign_pairwise(names, values, statement, scope)
                return
            case ast.Call(ast.Attribute(ast.Name(module), "broadcast_arrays"), values) if (
                len(values) == len(names) and module in self.effects.modules
            ):
                self._assign_pairwise(names, values, statement, scope)
                return
            case ast.Name(vector) if found is None and len(names) == self.n:
                for k, name in enumerate(names):
                    text = f"{spelled(vector)}[{k}]"
                    entry = Formula(text, (Read(spelled(vector), 0, len(text), (k,)),))
                    self._bind(scope, name, statement, entry)
                return
        self._not_understood(scope, everything, statement, "an unpacking that is not read")

    def _assign_pairwise(
        self, names: Sequence[str], values: Sequence[ast.expr], statement: ast.stmt, scope: Scope
    ) -> None:
        """Bind several names at once: what is read on the right was bound before."""
        place = self.program.place
        for name, value in zip(names, values, strict=True):
            self.program.place = place
            self._assign_name(name, value, statement, scope)
        self.program.place = place + 1

    def _assign_entry(
        self,
        name: str,
        indices: Sequence[ast.expr],
        value: ast.expr,
        statement: ast.stmt,
        scope: Scope,
        is_added: bool = False,
    ) -> None:
        numbers = [constant_index(index) for index in indices]
        formula = self.formulas.formula(value)
        self._alias_changed(name, statement, scope)
        self.effects.alias(name, self.effects.parts(value) if not isinstance(value, ast.Subscript) else ())
        if any(index is None for index in numbers) or formula.is_matrix:
            self._not_understood(scope, [name], statement, "an assignment to a part of it")
            return
        index = tuple(k for part in numbers if part is not None for k in part)
        self.program.bind(scope, spelled(name), self._line(statement), formula, index, is_added)

    def _alias_changed(self, name: str, statement: ast.stmt, scope: Scope) -> None:
        """Note that other names of a matrix change with it."""
        for other in self.effects.others(name):
            reason = f"{other[:40]} may be the same matrix as {name[:40]}, which is changed in {self._line(statement)}"
            self._bind(scope, other, statement, NotUnderstood(reason, only_matrices=True))

    def _augmented(self, statement: ast.AugAssign, scope: Scope) -> None:
        match statement.target:
            case ast.Subscript(ast.Name(name), index) if isinstance(statement.op, ast.Add):
                self._assign_entry(name, [index], statement.value, statement, scope, is_added=True)
            case _:
                names = bound_names([statement])
                for name in names:
                    self._alias_changed(name, statement, scope)
                    reason = f"{spelled(name)[:40]} is changed after it is assigned, in {self._line(statement)}"
                    self._bind(scope, name, statement, NotUnderstood(reason))

    def _symbols(self, value: ast.expr) -> list[str] | None:
        """Return the names of symbols('q1 q2'), Symbol('m1'), Function('q1')(t) and dynamicsymbols('q1', 1)."""
        if not isinstance(value, ast.Call):
            return None
        function = value.func
        if isinstance(function, ast.Call):
            inner = self._symbol_call(function, frozenset(("Function",)))
            of_time = len(value.args) == 1 and isinstance(value.args[0], ast.Name) and value.args[0].id == "t"
            return inner if inner is not None and of_time and not value.keywords else None
        found = self._symbol_call(value, SYMBOL_CALLS)
        if found is None or len(value.args) == 1:
            return found
        order = value.args[1].value if len(value.args) == 2 and isinstance(value.args[1], ast.Constant) else None
        called = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
        if called != "dynamicsymbols" or not isinstance(order, int) or order not in (0, 1, 2):
            return None
        return found if order == 0 else [dotted(plain_name(name), ("dot", "ddot")[order - 1]) for name in found]

    def _symbol_call(self, call: ast.Call, names: frozenset[str]) -> list[str] | None:
        match call:
            case ast.Call(ast.Name(name), [ast.Constant(str(text)), *_]) if name in names:
                if name in self.effects.own - self.effects.imported:
                    return None
            case ast.Call(ast.Attribute(_, name), [ast.Constant(str(text)), *_]) if name in names:
                base = call.func.value if isinstance(call.func, ast.Attribute) else None
                while isinstance(base, ast.Attribute):
                    base = base.value
                if not isinstance(base, ast.Name) or base.id not in self.effects.modules:
                    return None
            case _:
                return None
        found: list[str] = []
        for piece in re.split(r"[\s,]+", text.strip().strip(",")):
            span = re.fullmatch(r"(\w*?)\(?(\d*):(\d+)\)?", piece)
            if span and int(span[3][:6]) <= MAX_SYMBOLS:
                found += [f"{span[1]}{k}" for k in range(int(span[2] or 0), int(span[3]))]
            else:
                found.append(piece)
        return found if found and all(re.fullmatch(r"[\w\\{}]+", name) for name in found) else None

    # Imports

    def _imported(self, statement: ast.Import | ast.ImportFrom, scope: Scope) -> None:
        if isinstance(statement, ast.Import):
            for alias in statement.names:
                name = alias.asname or alias.name.split(".")[0]
                module = alias.name if alias.asname else alias.name.split(".")[0]
                known = module in MODULES
                if known:
                    self.effects.modules.add(name)
                value = (
                    ModuleNamed(module)
                    if known
                    else NotUnderstood(f"{name[:40]} is the module {module[:40]} since {self._line(statement)}")
                )
                self._bind(scope, name, statement, value)
            return
        module = statement.module or "."
        for alias in statement.names:
            name = alias.asname or alias.name
            if alias.name == "*":
                self._star(module, statement)
            elif module == "sympy.abc":
                self._bind(scope, name, statement, Symbol(alias.name))
            elif module in MODULES or module in ("sympy.functions", "sympy.core"):
                self.effects.imported.add(name)
                if alias.name in EXACT and alias.name != name:
                    reason = f"{name[:40]} is {alias.name} in {self._line(statement)}, which is read by its own name"
                    self._bind(scope, name, statement, NotUnderstood(reason))
                elif alias.name == "pi":
                    self._bind(scope, name, statement, Symbol("pi"))
                else:
                    self._bind(scope, name, statement, FunctionNamed(alias.name))
            elif f"{module}.{alias.name}" in MODULES:
                self.effects.modules.add(name)
                self._bind(scope, name, statement, ModuleNamed(f"{module}.{alias.name}"))
            else:
                reason = f"{name[:40]} comes from {module[:40]} in {self._line(statement)}"
                self._bind(scope, name, statement, NotUnderstood(reason))

    def _star(self, module: str, statement: ast.ImportFrom) -> None:
        """Take the names of a known module for what they are; those assigned before may be replaced by it."""
        if module not in MODULES or module == "sympy.abc":
            raise AnswerError(
                f"{self.file}: {self._line(statement)}: found 'from {module[:40]} import *', which may change any "
                "name; expected numpy, sympy or math"
            )
        main = self.program.main
        for name, bindings in list(main.bindings.items()):
            is_exported = name in LATER if len(name) == 1 else not any(c.isdigit() for c in name)
            is_value = any(isinstance(b.value, Formula | Symbol) or b.value == FunctionNamed("") for b in bindings)
            if is_exported and is_value and name not in ("tau", "KE", "PE", "Tau", "Jac"):
                self._not_understood(main, [name], statement, f"'from {module} import *'")

    # Functions

    def _function(
        self,
        name: str,
        arguments: ast.arguments,
        body: Sequence[ast.stmt] | ast.expr,
        statement: ast.stmt,
        is_decorated: bool,
    ) -> None:
        main = self.program.main
        self._bind(main, name, statement, FunctionNamed(""))
        scope = Scope(outer=main)
        self.program.functions.append(scope)
        for argument in [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]:
            own = argument.arg in ("self", "cls")
            value: Value = Symbol(spelled(argument.arg), is_argument=True)
            if own:
                value = NotUnderstood(f"{argument.arg} is an object, in {self._line(statement)}")
            self._bind(scope, argument.arg, statement, value)
        positional = [*arguments.posonlyargs, *arguments.args]
        with_defaults = [
            *zip(reversed(positional), reversed(arguments.defaults), strict=False),
            *zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True),
        ]
        for argument, default in with_defaults:
            if default is not None:
                self.effects.alias(argument.arg, self.effects.parts(default))
                self._default(argument.arg, default, statement, scope)
        for rest in (arguments.vararg, arguments.kwarg):
            if rest is not None:
                self._not_understood(scope, [rest.arg], statement, "'*'")
        if isinstance(body, ast.expr):
            self._side_effects(ast.copy_location(ast.Expr(body), body), scope)
            self._returned(name, body, statement, scope)
            return
        global_names = _globals(body)
        self._not_understood(main, global_names, statement, "'global' in a function")
        *before, last = body
        returns = [x for s in before for x in ast.walk(s) if isinstance(x, ast.Return | ast.Yield | ast.YieldFrom)]
        self._block(body, scope)
        for name_ in global_names:
            scope.bindings.pop(spelled(name_), None)
        if is_decorated or returns or not isinstance(last, ast.Return) or last.value is None:
            if isinstance(last, ast.Return) or returns:
                reason = "a decorator" if is_decorated else "several 'return'" if returns else "'return'"
                where = self._line(returns[0] if returns and isinstance(returns[0], ast.stmt) else statement)
                value = NotUnderstood(f"{name} has {reason}, in {where}")
                self.program.bind(scope, "return", self._line(statement), value)
                scope.returned.append(Returned(name, "return"))
            return
        self._returned(name, last.value, last, scope)

    def _default(self, name: str, default: ast.expr, statement: ast.stmt, scope: Scope) -> None:
        """Note the default of an argument; of a structure its fields."""
        fields = self._fields(default)
        for field_name, value in fields.items():
            self._bind(scope, f"{spelled(name)}.{spelled(field_name)}", statement, self.formulas.formula(value))
        self._bind(scope, name, statement, Default(self.formulas.formula(default), bool(fields)))

    def _fields(self, value: ast.expr) -> dict[str, ast.expr]:
        """Return the fields of a structure: a dictionary, an object of a class of the file, or a name of one."""
        match value:
            case ast.Name(name):
                return self.fields.get(name, {})
            case ast.Dict(keys, values) if all(isinstance(k, ast.Constant) for k in keys):
                return {str(k.value): v for k, v in zip(keys, values, strict=True) if isinstance(k, ast.Constant)}
            case ast.Call(ast.Name(name), [], keywords) if name in self.fields or name in ("dict", "SimpleNamespace"):
                if all(keyword.arg for keyword in keywords):
                    given = {keyword.arg: keyword.value for keyword in keywords if keyword.arg}
                    return {**self.fields.get(name, {}), **given}
        return {}

    def _returned(self, name: str, value: ast.expr, statement: ast.stmt, scope: Scope) -> None:
        """Note what a function returns: local names, or a formula."""
        is_several = isinstance(value, ast.Tuple | ast.Dict)
        values = (
            value.elts if isinstance(value, ast.Tuple) else value.values if isinstance(value, ast.Dict) else [value]
        )
        locals_ = [self._local(x, scope) for x in values]
        if all(locals_):
            scope.returned += [Returned(name, local, is_only=not is_several) for local in locals_]
            return
        self.program.bind(scope, "return", self._line(statement), self.formulas.formula(value))
        names = dict.fromkeys(spelled(x.id) for x in ast.walk(value) if isinstance(x, ast.Name))
        scope.returned.append(Returned(name, "return", names=tuple(names)))

    def _local(self, value: ast.expr, scope: Scope) -> str:
        """Return the local name that a value is, as it is or as an array; nothing for another value."""
        while True:
            match value:
                case ast.Name(name):
                    return spelled(name) if spelled(name) in scope.bindings else ""
                case ast.Subscript(inner, ast.Tuple([])):
                    value = inner
                case ast.Call(ast.Name(function), [inner]) if function in VECTORS and not value.keywords:
                    value = inner
                case ast.Call(ast.Attribute(ast.Name(module), function), [inner]) if (
                    module in self.effects.modules and function in (*VECTORS, "simplify")
                ):
                    value = inner
                case ast.Call(ast.Attribute(inner, "flatten" | "ravel" | "squeeze" | "copy" | "simplify"), []) if (
                    not isinstance(inner, ast.Name) or inner.id not in self.effects.modules
                ):
                    value = inner
                case ast.Call(ast.Name("simplify"), [inner]) if (
                    "simplify" not in self.effects.own - self.effects.imported
                ):
                    value = inner
                case _:
                    return ""


def _class_fields(statement: ast.ClassDef) -> dict[str, ast.expr]:
    """Return what the body of a class assigns, as the fields of its objects; nothing where it has methods."""
    found: dict[str, ast.expr] = {}
    for inner in statement.body:
        match inner:
            case ast.AnnAssign(ast.Name(name), _, ast.expr() as value) | ast.Assign([ast.Name(name)], value):
                if name in found:
                    return {}
                found[name] = value
            case ast.Expr(ast.Constant()) | ast.Pass():
                pass
            case _:
                return {}
    return found


def _globals(statements: Sequence[ast.stmt]) -> list[str]:
    return [
        name
        for statement in statements
        for node in ast.walk(statement)
        if isinstance(node, ast.Global | ast.Nonlocal)
        for name in node.names
    ]


def _names(target: ast.expr) -> list[str]:
    return [x.id for x in ast.walk(target) if isinstance(x, ast.Name)]


def _starred(nodes: Sequence[ast.expr]) -> bool:
    return any(isinstance(node, ast.Starred) for node in nodes)
