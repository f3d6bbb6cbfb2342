"""Python programs: a closed list of statements and expressions is read, and nothing is run."""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.programs.library import SCALAR, as_matrix, called, flat, unchanged
from dhkit.grading.answers.programs.python_changes import (
    Changes,
    Effects,
    ascii_name,
    assigned_names,
    bound_names,
    is_unbounded,
    names_in,
    value_of,
    without_functions,
)
from dhkit.grading.answers.programs.scope import Record, Scope
from dhkit.grading.answers.programs.values import (
    ONE,
    ZERO,
    Function,
    Given,
    Index,
    Level,
    Library,
    Matrix,
    Module,
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
    vector_of,
)
from dhkit.grading.answers.rewriting import MODULES as USUAL_MODULES
from dhkit.grading.answers.tokens import rate_name, word_set
from dhkit.grading.answers.vocabulary import plain_name

_MODULES = word_set(
    """
    numpy sympy math cmath mpmath casadi jax.numpy autograd.numpy numpy.lib.scimath sympy.physics.mechanics
    sympy.physics.vector sympy.matrices sympy.abc symengine pylab sympy.functions sympy.core numpy.linalg
    """
)
"""Modules whose sin is the sine, and whose other functions mean what their names say."""
_KNOWN_PACKAGES = (
    "numpy",
    "scipy",
    "sympy",
    "casadi",
    "matplotlib",
    "IPython",
    "mpmath",
    "math",
    "time",
    "pprint",
)
"""Packages whose functions are told by their names."""
_NUMPY = ("numpy", "jax.numpy", "autograd.numpy", "numpy.lib.scimath", "pylab", "np")
"""Modules whose matrices multiply entry by entry."""
_EXPORTED_LETTERS = frozenset("EINOQSe")
"""Names of one letter that these modules export."""

_ASSUMPTIONS = word_set("cls real positive nonnegative nonzero integer commutative finite seq")
"""Keywords of symbols that change no verdict."""
_KNOWN_KEYWORDS = word_set(
    "deep ratio trig force inverse rational method measure power_base power_exp mul log syms dtype"
)
"""Keywords with which a function writes an expression in another way."""
_MATRICES = word_set(
    "Matrix ImmutableMatrix MutableDenseMatrix ImmutableDenseMatrix DM SX MX matrix vertcat"
)
_ARRAYS = word_set("array asarray asanyarray")
_CASADI = word_set("DM SX MX vertcat horzcat")
"""Matrices of casadi, which multiply entry by entry."""
_SYMBOLS = frozenset(("symbols", "Symbol", "dynamicsymbols", "var", "Dummy"))
_NUMBERS_OF_SYMPY = {
    "Half": Scalar("1/2", Level.PRODUCT, 0.5),
    "One": ONE,
    "Zero": ZERO,
    "Pi": Scalar("pi"),
}
_SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "^", ast.MatMult: "@"}
_PLAIN_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


class PythonProgram:
    """A program of Python's, read as bindings of names.

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
        No Python, more statements than are read, or one that may change any name.
    """

    def __init__(
        self, text: str, file: str, line_name: Callable[[int], str], record: Record
    ) -> None:
        self.text = text.replace("\r\n", "\n").replace("\r", "\n")
        self.lines = self.text.split("\n")
        self.file = file
        self.line_name = line_name
        self.record = record
        self.main = Scope(record)
        self.changes = Changes(self.main)
        self.functions: list[Function] = []
        self.statements = 0
        self.depth = 0
        self.star_modules: list[str] = []
        self.tree = self._parsed()
        try:
            self._refuse_unbounded(self.tree)
            self._block(self.tree.body, self.main)
        except RecursionError:
            raise AnswerError(
                f"{file}: nested too deep to be read; write long sums in parts"
            ) from None

    def _parsed(self) -> ast.Module:
        for line_text in self.lines[:2]:
            coding = re.match(r"[ \t\f]*#.*?coding[:=][ \t]*([-\w.]+)", line_text)
            if coding and coding[1].lower().replace("_", "-") not in (
                "utf-8",
                "utf8",
                "utf-8-sig",
                "ascii",
                "us-ascii",
            ):
                raise AnswerError(
                    f"{self.file}: {self.line_name(1)}: written in {coding[1][:20]!r}; expected UTF-8"
                )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return ast.parse(self.text, filename=self.file or "program")
        except SyntaxError as error:
            at = self.line_name(error.lineno) if error.lineno else "the program"
            raise AnswerError(f"{self.file}: {at}: no Python: {str(error.msg)[:100]}") from None
        except (RecursionError, MemoryError):
            raise AnswerError(
                f"{self.file}: brackets or sums nested too deep to be read; write long sums in parts"
            ) from None
        except ValueError as error:
            raise AnswerError(f"{self.file}: no Python: {str(error)[:100]}") from None

    def _refuse_unbounded(self, tree: ast.Module) -> None:
        for node in ast.walk(tree):
            if is_unbounded(node):
                name = (
                    getattr(node, "id", "")
                    or getattr(node, "attr", "")
                    or getattr(node, "name", "")
                )
                raise AnswerError(
                    f"{self.file}: {self.line_name(getattr(node, 'lineno', 1))}: found {name[:40]!r}, which may change "
                    "any name; a program is read, not run (--execute)"
                )

    def where(self, node: ast.stmt | ast.expr) -> str:
        """Return how messages name the line of a node."""
        return self.line_name(node.lineno)

    def assigned_anywhere(self) -> Iterator[tuple[str, str]]:
        """Yield names, keys and attributes that are assigned, also where nothing is read, with their lines."""
        found: list[tuple[int, str]] = []
        for node in ast.walk(self.tree):
            line_number = getattr(node, "lineno", 1)
            found += [(line_number, name) for name in _assigned_by(node)]
        for line_number, name in sorted(found):
            yield ascii_name(name), self.line_name(line_number)

    # Statements

    def _block(self, statements: Sequence[ast.stmt], scope: Scope) -> None:
        for statement in statements:
            self.statements += 1
            if self.statements > BOUNDS.statements:
                raise AnswerError(f"{self.file}: more than {BOUNDS.statements} statements")
            self._statement(statement, scope)

    def _statement(self, statement: ast.stmt, scope: Scope) -> None:
        where = self.where(statement)
        match statement:
            case ast.Assign(targets, value):
                for target in targets:
                    self._assign(target, value, scope, where)
            case ast.AnnAssign(target, _, ast.expr() as value):
                self._assign(target, value, scope, where)
            case ast.AugAssign(ast.Subscript(ast.Name(name), index), ast.Add(), value):
                self._assign_entry(name, [index], value, scope, where, is_added=True)
            case ast.Import(aliases):
                for alias in aliases:
                    self._import(alias, scope, where)
            case ast.ImportFrom(module, aliases):
                for alias in aliases:
                    self._import_from(module or ".", alias, scope, where)
            case ast.FunctionDef(name, arguments, body, []):
                self._define(name, arguments, body, scope, where)
            case ast.If(test, body, []) if scope is self.main and _is_main(test):
                self._block(body, scope)
                return
            case ast.Expr(
                ast.Call(ast.Name("var") | ast.Attribute(_, "var"), [ast.Constant(str(text)), *_])
            ):
                for name in _symbol_names(text):
                    scope.bind(
                        ascii_name(name), Given(name, is_symbol=True, is_constant=True), where
                    )
            case ast.Expr() | ast.Pass() | ast.AnnAssign() | ast.Assert() | ast.Return():
                pass
            case _:
                self._leave(statement, scope, where)
                return
        pieces = _executed(statement)
        for node in chain.from_iterable(map(ast.walk, pieces)):
            if isinstance(node, ast.NamedExpr):
                for one in names_in(node.target):
                    scope.change(
                        ascii_name(one),
                        f"{one[:40]} is changed by := in {where}",
                        only_matrices=False,
                    )
        self._note(self.changes.of(pieces, scope, scope.local), scope, where)

    def _note(self, effects: Effects, scope: Scope, where: str) -> None:
        """Note the names whose values a statement may change, and those that may be the same matrix after it."""
        for name, others in effects.shared.items():
            if scope.is_mutable(name) or not isinstance(
                value_of(name, scope), Scalar | Function | Module | Library
            ):
                scope.add_alias(name, others)
        for name in sorted(effects.changed):
            scope.change(name, f"{name[:40]} may be changed in {where}")

    def _leave(self, statement: ast.stmt, scope: Scope, where: str) -> None:
        """Note the names whose values an unread statement may change."""
        if isinstance(statement, ast.ClassDef):
            self._leave_class(statement, scope, where)
            return
        kind = {"FunctionDef": "a function", "Delete": "'del'"}
        what = kind.get(type(statement).__name__, repr(type(statement).__name__.lower()))
        for name in dict.fromkeys(map(ascii_name, assigned_names(statement))):
            after = (
                "after it is assigned, " if isinstance(statement, ast.AugAssign) else f"by {what} "
            )
            scope.change(name, f"{name[:40]} is changed {after}in {where}", only_matrices=False)
        self._note(self.changes.of([statement], scope, scope.local), scope, where)

    def _leave_class(self, statement: ast.ClassDef, scope: Scope, where: str) -> None:
        """Read a class of fields alone as a structure; of another one note the names whose values it may change."""
        name = ascii_name(statement.name)
        if _is_plain_class(statement) and (fields := self._fields(statement, scope)) is not None:
            scope.bind(name, Structure(fields), where)
            return
        self.changes.classes.add(name)
        reached = {ascii_name(x) for x in names_in(statement)}
        inside: set[str] = set()
        for inner in statement.body:
            if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef):
                self.record.note_left_out(f"{where}: class {statement.name[:40]}")
                arguments = {
                    ascii_name(x.arg) for x in ast.walk(inner.args) if isinstance(x, ast.arg)
                }
                inside |= arguments | {ascii_name(x) for x in assigned_names(inner)}
        scope.bind(
            name,
            Unread(f"{statement.name[:40]} is a class, in {where}", frozenset(reached - inside)),
            where,
        )
        for node in ast.walk(statement):
            if isinstance(node, ast.Global):
                for one in node.names:
                    scope.change(
                        ascii_name(one),
                        f"{one[:40]} is changed in a class, in {where}",
                        only_matrices=False,
                    )
        self._note(self.changes.of([statement], scope, scope.local), scope, where)

    def _fields(self, statement: ast.ClassDef, scope: Scope) -> dict[str, Value] | None:
        """Return the assignments in a class's body, as its objects' fields; None where it has other statements."""
        fields: dict[str, Value] = {}
        for inner in statement.body:
            match inner:
                case ast.AnnAssign(ast.Name(name), _, ast.expr() as value) | ast.Assign(
                    [ast.Name(name)], value
                ):
                    if name in fields or fields.keys() & set(names_in(value)):
                        return None
                    fields[name] = self._right_side(value, scope, self.where(inner))
                case ast.Expr(ast.Constant()) | ast.Pass():
                    pass
                case _:
                    return None
        return fields

    # Assignments

    def _assign(self, target: ast.expr, value: ast.expr, scope: Scope, where: str) -> None:
        match target:
            case ast.Name(name) if isinstance(value, ast.Lambda):
                self._define(name, value.args, value.body, scope, where)
            case ast.Name(name):
                if (
                    isinstance(value, ast.Call)
                    and _last(value.func) == "lambdify"
                    and self._is_library(value.func, scope)
                ):
                    self.changes.compiled.add(name)
                scope.bind(ascii_name(name), self._right_side(value, scope, where), where)
            case ast.Tuple(targets) | ast.List(targets):
                self._assign_several(targets, value, scope, where)
            case ast.Subscript(ast.Name(name), index):
                self._assign_entry(name, [index], value, scope, where)
            case ast.Subscript(ast.Subscript(ast.Name(name), first), second):
                self._assign_entry(name, [first, second], value, scope, where)
            case _:
                for name in dict.fromkeys(assigned_names(target)):
                    reason = f"{name[:40]} is changed by an assignment to a part of it in {where}"
                    scope.change(ascii_name(name), reason, only_matrices=False)
                self._note(
                    self.changes.of([ast.Assign([target], value)], scope, scope.local), scope, where
                )

    def _right_side(self, value: ast.expr, scope: Scope, where: str) -> Value:
        try:
            return self.value(value, scope)
        except UnreadError as error:
            return Unread(
                f"{where}: {error}",
                frozenset(map(ascii_name, names_in(value))),
                _is_written_out(value),
            )

    def _assign_several(
        self, targets: Sequence[ast.expr], value: ast.expr, scope: Scope, where: str
    ) -> None:
        names = [target.id for target in targets if isinstance(target, ast.Name)]
        if len(names) != len(targets):
            for name in dict.fromkeys(chain.from_iterable(map(assigned_names, targets))):
                scope.change(
                    ascii_name(name),
                    f"{name[:40]} is changed by an unpacking in {where}",
                    only_matrices=False,
                )
            return
        if isinstance(value, ast.Tuple | ast.List) and len(value.elts) == len(names):
            values = [self._right_side(one, scope, where) for one in value.elts]
        else:
            values = self._taken_apart(
                self._right_side(value, scope, where), len(names), scope, where
            )
        for name, one in zip(names, values, strict=True):
            scope.bind(ascii_name(name), one, where)

    def _taken_apart(self, value: Value, count: int, scope: Scope, where: str) -> list[Value]:
        match value:
            case Several(values) if len(values) == count:
                return list(values)
            case Matrix() if len(value.rows) * len(value.rows[0]) == count:
                return list(chain.from_iterable(value.rows))
            case Given(vector) if not self.record.robot.vocabulary.knows(vector) or count > 1:
                try:
                    return [scope.entry(value, (k,)) for k in range(count)]
                except UnreadError as error:
                    return [Unread(f"{where}: {error}")] * count
            case Unread():
                return [value] * count
        return [Unread(f"{where}: an unpacking that is not read")] * count

    def _assign_entry(
        self,
        name: str,
        indices: Sequence[ast.expr],
        value: ast.expr,
        scope: Scope,
        where: str,
        is_added: bool = False,
    ) -> None:
        name = ascii_name(name)
        owner = scope.owner(name)
        if owner is not None and owner is not scope:
            scope.change(name, f"{name[:40]} is changed inside a function, in {where}")
            return
        try:
            stored = self.value(value, scope)
            if _is_ellipsis(indices) and scope.is_bare_zero(name):
                scope.bind(name, stored, where)
                return
            parts = [constant_index(index) for index in indices]
            if any(part is None for part in parts):
                raise UnreadError(f"{name[:40]} is changed by an assignment to a part of it")
            scalar = scope.scalar(stored)
        except UnreadError as error:
            self._share_entry(name, value, scope, where)
            scope.change(name, f"{error}, in {where}", only_matrices=False)
            return
        if isinstance(stored, Matrix):
            self._share_entry(name, value, scope, where)
        for other in list(scope.same_matrices(name)):
            scope.change(
                other,
                f"{other[:40]} may be the same matrix as {name[:40]}, which is changed in {where}",
            )
        index = tuple(chain.from_iterable(part for part in parts if part is not None))
        scope.bind_entry(name, index, scalar, where, is_added)

    def _share_entry(self, name: str, value: ast.expr, scope: Scope, where: str) -> None:
        """Note that a matrix or list may hold others after an entry is assigned."""
        target = ast.Name(name, ast.Store())
        self._note(self.changes.of([ast.Assign([target], value)], scope, scope.local), scope, where)

    # Imports

    def _import(self, alias: ast.alias, scope: Scope, where: str) -> None:
        first = alias.name.split(".")[0]
        name = alias.asname or first
        module = alias.name if alias.asname else first
        harmless = module.split(".")[0] in (*_KNOWN_PACKAGES, "os", "sys")
        if module in _MODULES or harmless:
            scope.bind(ascii_name(name), Module(module), where)
        else:
            scope.bind(
                ascii_name(name),
                Unread(f"{name[:40]} is the module {module[:40]} since {where}"),
                where,
            )

    def _import_from(self, module: str, alias: ast.alias, scope: Scope, where: str) -> None:
        name = ascii_name(alias.asname or alias.name)
        full_name = f"{module}.{alias.name}"
        value: Value
        if alias.name == "*":
            self._import_everything(module, where)
            return
        if module == "sympy.abc":
            value = Given(alias.name)
        elif full_name in _MODULES:
            value = Module(full_name)
        elif module in _MODULES:
            value = Scalar("pi") if alias.name == "pi" else Library(alias.name)
            if module in _NUMPY and alias.name in (*_ARRAYS, "zeros", "eye"):
                value = Library(f"numpy.{alias.name}")
        else:
            value = Unread(f"{name[:40]} comes from {module[:40]} in {where}")
            if module.split(".")[0] in _KNOWN_PACKAGES:
                self.changes.imported[name] = alias.name
        scope.bind(name, value, where)

    def _import_everything(self, module: str, where: str) -> None:
        """Note which names ``from module import *`` may replace; the module's own names are its functions."""
        if module not in _MODULES or module == "sympy.abc":
            raise AnswerError(
                f"{self.file}: {where}: found 'from {module[:40]} import *', which may change any name; expected "
                "numpy, sympy or math"
            )
        self.star_modules.append(module)
        for name, binding in list(self.main.names.items()):
            is_exported = (
                name in _EXPORTED_LETTERS if len(name) == 1 else not any(c.isdigit() for c in name)
            )
            has_value = not isinstance(binding.value, Module | Library | Unread)
            if module == "math":
                is_exported = name in ("tau", "e", "pi", "inf", "nan") or name in SCALAR
            elif name in ("tau", "KE", "PE", "Tau", "Jac"):
                is_exported = False
            if is_exported and has_value:
                self.main.change(
                    name,
                    f"{name} is changed by 'from {module} import *' in {where}",
                    only_matrices=False,
                )

    # Functions

    def _define(
        self,
        name: str,
        arguments: ast.arguments,
        body: Sequence[ast.stmt] | ast.expr,
        scope: Scope,
        where: str,
    ) -> None:
        function = self._function(name, arguments, body, scope, where)
        if scope is self.main:
            self.functions.append(function)
        scope.bind(ascii_name(name), function, where)
        pieces: Sequence[ast.AST] = [body] if isinstance(body, ast.expr) else body
        for node in chain.from_iterable(map(ast.walk, pieces)):
            if isinstance(node, ast.Global | ast.Nonlocal):
                for one in node.names:
                    reason = f"{one[:40]} is changed by 'global' in a function, in {where}"
                    scope.change(ascii_name(one), reason, only_matrices=False)

    def _function(
        self,
        name: str,
        arguments: ast.arguments,
        body: Sequence[ast.stmt] | ast.expr,
        scope: Scope,
        where: str,
    ) -> Function:
        positional = [*arguments.posonlyargs, *arguments.args]
        parameters = [argument.arg for argument in [*positional, *arguments.kwonlyargs]]
        pairs = [
            *zip(reversed(positional), reversed(arguments.defaults), strict=False),
            *zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True),
        ]
        defaults: dict[str, Value] = {}
        for argument, default in pairs:
            if default is not None:
                defaults[ascii_name(argument.arg)] = self._right_side(default, scope, where)
        problem = ""
        if arguments.vararg is not None or arguments.kwarg is not None:
            problem = f"{name} takes any arguments, in {where}"
        elif not isinstance(body, ast.expr) and any(map(_ends, body)):
            problem = f"{name} ends by an exception, in {where}"
        elif not isinstance(body, ast.expr):
            kinds = ast.Return | ast.Yield
            before_last = chain.from_iterable(map(without_functions, body[:-1]))
            returns = [node for node in before_last if isinstance(node, kinds)]
            if returns or isinstance(body[-1], ast.If | ast.For | ast.While | ast.Try | ast.With):
                problem = (
                    f"{name} has 'return' in a branch or several, in {where}"
                    if _returns_inside(body)
                    else ""
                )
        default_names: list[str] = []
        for _, default in pairs:
            if default is not None:
                default_names += names_in(default)
        return Function(
            ascii_name(name),
            tuple(map(ascii_name, parameters)),
            body,
            where,
            defaults,
            problem,
            frozenset(map(ascii_name, default_names)),
            scope,
        )

    def arguments_as_given(self, function: Function) -> dict[str, Value]:
        """Return a function's arguments as themselves; those whose default changes the result are not read."""
        robot = self.record.robot
        values: dict[str, Value] = {}
        for name in function.parameters:
            values[name] = self.record.argument(name)
            default = function.defaults.get(name)
            if name in ("self", "cls"):
                values[name] = Unread(f"{name} is an object, in {function.where}")
            elif default is not None and not isinstance(default, Structure):
                try:
                    same = robot.is_reserved(name) and robot.keeps_meaning(name, default)
                except UnreadError as error:
                    values[name] = Unread(f"{error}, as a default in {function.where}")
                    continue
                if not same:
                    shown = default.text if isinstance(default, Scalar) else "something else"
                    values[name] = Unread(
                        f"an argument has the default {name} = {shown[:40]} in {function.where}"
                    )
            elif isinstance(default, Structure):
                values[name] = default
        return values

    def apply(self, function: Function, arguments: dict[str, Value]) -> Value:
        """Return the result of a function of the program for some arguments.

        Raises
        ------
        UnreadError
            The function is not read.
        """
        value, _ = self.applied(function, arguments)
        if isinstance(value, Unread):
            raise UnreadError(value.reason)
        return value

    def applied(self, function: Function, arguments: dict[str, Value]) -> tuple[Value, Scope]:
        """Return a function's result, and its local names."""
        if function.problem:
            raise UnreadError(function.problem)
        if self.depth >= BOUNDS.call_depth:
            raise UnreadError(f"{function.name} calls itself, or functions nested too deep")
        body = function.definition
        if isinstance(body, ast.expr):
            scope = Scope(self.record, function.outer or self.main, frozenset(function.parameters))
        else:
            local = set(function.parameters)
            for statement in body:
                local |= {ascii_name(name) for name in bound_names(statement)}
            scope = Scope(self.record, function.outer or self.main, frozenset(local))
        for name, value in arguments.items():
            scope.set_argument(name, value, function.where)
        self.depth += 1
        try:
            if isinstance(body, ast.expr):
                return self._right_side(body, scope, function.where), scope
            self._block(body, scope)
            last = body[-1]
            if not isinstance(last, ast.Return) or last.value is None:
                return Several(()), scope
            try:
                return self._returned(last.value, scope), scope
            except UnreadError as error:
                names = frozenset(map(ascii_name, names_in(last.value)))
                return Unread(
                    f"{self.where(last)}: {error}", names, _is_written_out(last.value)
                ), scope
        finally:
            self.depth -= 1

    def _returned(self, node: ast.expr, scope: Scope) -> Value:
        if isinstance(node, ast.Tuple):
            values = tuple(self._right_side(one, scope, self.where(node)) for one in node.elts)
            return Several(values, tuple(_local_name(one) for one in node.elts))
        return self.value(node, scope)

    @staticmethod
    def returned_names(function: Function) -> list[str]:
        """Return the names in a function's result."""
        body = function.definition
        last = body if isinstance(body, ast.expr) else body[-1]
        return (
            list(dict.fromkeys(map(ascii_name, names_in(last))))
            if isinstance(last, ast.expr | ast.Return)
            else []
        )

    @staticmethod
    def returned_name(function: Function) -> str:
        """Return the local name that a function returns, as it is or as an array; empty where it returns a formula."""
        body = function.definition
        last = body if isinstance(body, ast.expr) else body[-1]
        node = last.value if isinstance(last, ast.Return) else last
        return _local_name(node) if isinstance(node, ast.expr) else ""

    # Expressions

    def value(self, node: ast.expr, scope: Scope) -> Value:
        """Return the value of an expression.

        Raises
        ------
        UnreadError
            It is not read.
        """
        match node:
            case ast.Constant(value) if type(value) in (int, float):
                return self._number(node)
            case ast.Constant(str(text)):
                return Text(text)
            case ast.Name(name):
                return scope.value(ascii_name(name))
            case ast.BinOp(left, op, right) if type(op) in _SIGNS:
                values = self._operand(left, scope), self._operand(right, scope)
                return calculated(values[0], _SIGNS[type(op)], values[1], self.record.power)
            case ast.UnaryOp(ast.USub(), operand):
                return opposite(self._operand(operand, scope))
            case ast.UnaryOp(ast.UAdd(), operand):
                return self._operand(operand, scope)
            case ast.Tuple([one]) if not _is_batch_shape(one):
                raise UnreadError("a tuple of one value is not read")
            case ast.List(parts) | ast.Tuple(parts):
                return self._listed(parts, scope)
            case ast.Dict(keys, values) if all(isinstance(k, ast.Constant) for k in keys):
                where = self.where(node)
                fields = [self._right_side(one, scope, where) for one in values]
                names = [str(k.value) for k in keys if isinstance(k, ast.Constant)]
                return Structure(dict(zip(names, fields, strict=True)))
            case ast.Lambda(arguments, body):
                return self._function("lambda", arguments, body, scope, self.where(node))
            case ast.Attribute(inner, name):
                return self._attribute(self._object(inner, scope), name, scope)
            case ast.Subscript(inner, index):
                return self._subscript(inner, index, scope)
            case ast.Call():
                return self._call(node, scope)
        raise UnreadError(f"{self._quote(node)} is not read")

    def _quote(self, node: ast.expr) -> str:
        return repr((ast.get_source_segment(self.text, node) or "")[:40])

    def _number(self, node: ast.Constant) -> Scalar:
        where = self.lines[node.lineno - 1].encode()
        typed = where[node.col_offset : node.end_col_offset].decode()
        if _PLAIN_NUMBER.fullmatch(typed) is None:
            raise UnreadError(f"the number {typed[:20]!r} is not read")
        return number(f"{typed}0" if typed.endswith(".") else typed)

    def _object(self, node: ast.expr, scope: Scope) -> Value:
        """Return the value in front of a dot: a module by its usual name needs no import."""
        if isinstance(node, ast.Name) and node.id in USUAL_MODULES and scope.owner(node.id) is None:
            scope.value(node.id)
            return Module("numpy" if node.id in ("np", "numpy") else node.id)
        return self.value(node, scope)

    def _operand(self, node: ast.expr, scope: Scope) -> Value:
        """Return a value with which is calculated: a name of the robot's as a scalar, or as the vector that it is."""
        value = self.value(node, scope)
        if isinstance(value, Matrix):
            return value
        robot = self.record.robot
        if (
            isinstance(value, Given)
            and not robot.vocabulary.knows(value.name)
            and robot.is_vector(value.name)
        ):
            return vector_of([scope.scalar(scope.entry(value, (k,))) for k in range(robot.n)])
        return scope.scalar(value)

    def _listed(self, nodes: Sequence[ast.expr], scope: Scope) -> Value:
        # (*q.shape[:-1], 2, 2) is the shape of a batch of matrices.
        batch = [one for one in nodes if _is_batch_shape(one)]
        nodes = [one for one in nodes if one not in batch]
        if batch and not nodes:
            return Several(())
        values = [self.value(one, scope) for one in nodes]
        if (
            all(isinstance(value, Matrix) and value.is_flat and value.is_list for value in values)
            and values
        ):
            return matrix_of(
                [list(x.entries.values()) for x in values if isinstance(x, Matrix)], is_list=True
            )
        if any(
            isinstance(value, Matrix) and value.is_list and not value.is_flat for value in values
        ):
            raise UnreadError("lists nested more than twice are not read")
        if any(
            isinstance(value, Matrix | Function | Structure | Several | Text | Module)
            for value in values
        ):
            return Several(tuple(values), tuple(_local_name(one) for one in nodes))
        if all(isinstance(value, Part) for value in values) and values:
            return Several(tuple(values))
        return vector_of([scope.scalar(value) for value in values], is_list=True)

    def _attribute(self, value: Value, name: str, scope: Scope) -> Value:
        match value:
            case Module(module):
                if name == "pi":
                    return Scalar("pi")
                if f"{module}.{name}" in _MODULES or name in (
                    "linalg",
                    "physics",
                    "mechanics",
                    "matrices",
                ):
                    return Module(f"{module}.{name}")
                if module not in _MODULES and module not in USUAL_MODULES:
                    raise UnreadError(f"{module}.{name} is not read")
                return Library(f"numpy.{name}" if module in _NUMPY else name)
            case Matrix() if name == "T":
                return transposed(value)
            case Library("S") | Given("S") if name in _NUMBERS_OF_SYMPY:
                return _NUMBERS_OF_SYMPY[name]
        return scope.field(value, name)

    def _subscript(self, inner: ast.expr, index: ast.expr, scope: Scope) -> Value:
        value = self.value(inner, scope)
        if isinstance(index, ast.Constant) and isinstance(index.value, str):
            return scope.field(value, index.value)
        if isinstance(index, ast.Tuple) and not index.elts:
            return value
        numbers = constant_index(index)
        if numbers is None:
            return self._slice(value, self._with_numbers(index, scope), scope)
        if isinstance(value, Several) and len(numbers) == 1 and numbers[0] < len(value.values):
            return value.values[numbers[0]]
        if (
            isinstance(value, Matrix)
            and len(numbers) == 1
            and not value.is_flat
            and 1 not in value.shape
        ):
            k = numbers[0]
            # sympy and casadi count through the matrix.
            if not (value.multiplies_entries or value.is_list):
                return scope.scalar(_entry_counted(value, k))
            if k >= len(value.rows):
                raise UnreadError(f"{self._quote(index)} is an index that the matrix does not have")
            return vector_of(
                value.rows[k], is_list=value.is_list, multiplies_entries=value.multiplies_entries
            )
        return scope.entry(value, numbers)

    def _with_numbers(self, index: ast.expr, scope: Scope) -> ast.expr:
        """Return a slice with names of whole numbers as the numbers: ``:n`` as ``:2``."""
        if not isinstance(index, ast.Slice):
            return index
        ends: list[ast.expr | None] = []
        for end in (index.lower, index.upper):
            known = self._value_or_none(end, scope) if isinstance(end, ast.Name) else None
            is_whole = (
                isinstance(known, Scalar) and known.number is not None and known.text.isdecimal()
            )
            ends.append(
                ast.Constant(int(known.text[:6])) if isinstance(known, Scalar) and is_whole else end
            )
        return ast.copy_location(ast.Slice(ends[0], ends[1], index.step), index)

    def _slice(self, value: Value, index: ast.expr, scope: Scope) -> Value:
        """Return M[:3, 3] of a matrix, and x[:2] of a vector."""
        match value, index:
            case Given(name), ast.Slice(low, high, None) if not self.record.robot.vocabulary.knows(
                name
            ):
                ends = [end if end is None else constant_index(end) for end in (low, high)]
                if (low is not None and ends[0] is None) or (high is not None and ends[1] is None):
                    raise UnreadError(f"{self._quote(index)} as an index is not read")
                first = 0 if ends[0] is None else ends[0][0]
                last = first + self.record.robot.n if ends[1] is None else ends[1][0]
                return Part(
                    name,
                    tuple(range(first, min(last, BOUNDS.index))),
                    is_slice=True,
                    number=value.number,
                )
            case Matrix(), ast.Tuple([rows, columns]) if not value.is_flat:
                m, n = value.shape
                chosen = value.part(_chosen(rows, m), _chosen(columns, n))
                if isinstance(rows, ast.Slice) and isinstance(columns, ast.Slice):
                    return matrix_of(chosen, multiplies_entries=value.multiplies_entries)
                entries = list(chain.from_iterable(chosen))
                if value.multiplies_entries:
                    return vector_of(entries, multiplies_entries=True)
                return matrix_of(chosen)
            case Matrix(), ast.Slice() if value.is_flat:
                return vector_of([value.entries[(k,)] for k in _chosen(index, value.shape[0])])
        raise UnreadError(f"{self._quote(index)} as an index is not read")

    # Calls

    def _call(self, node: ast.Call, scope: Scope) -> Value:
        if any(k.arg is None for k in node.keywords):
            raise UnreadError(f"{self._quote(node)} is not read")
        derivative = self._time_derivative(node, scope)
        if derivative is not None:
            return derivative
        if isinstance(node.func, ast.Call):
            return self._of_time(node, scope)
        if isinstance(node.func, ast.Attribute):
            receiver = self._object(node.func.value, scope)
            if not isinstance(receiver, Module | Structure):
                return self._method(receiver, node.func.attr, node, scope)
            function = self._attribute(receiver, node.func.attr, scope)
        else:
            function = self.value(node.func, scope)
        match function:
            case Function():
                return self._own_call(function, node, scope)
            case Structure(fields) if not node.args:
                where = self.where(node)
                given = {str(k.arg): self._right_side(k.value, scope, where) for k in node.keywords}
                return Structure({**fields, **given})
            case Library() | Given() if any(isinstance(x, ast.Starred) for x in node.args):
                raise UnreadError(f"{self._quote(node)} is not read")
            case Library(name):
                return self._used(self._library_call(name, node, scope), node, scope)
            case Given(name) if isinstance(node.func, ast.Name):
                if [ast.dump(x) for x in node.args] == [
                    "Name(id='t', ctx=Load())"
                ] and name not in SCALAR:
                    return function
                if scope.owner(name) is None:
                    return self._used(self._library_call(name, node, scope), node, scope)
        raise UnreadError(f"{self._quote(node.func)}(...) is not read")

    def _used(self, value: Value, node: ast.Call, scope: Scope) -> Value:
        """Return a value that knows of which name its function was called."""
        root = node.func
        while isinstance(root, ast.Attribute):
            root = root.value
        if not isinstance(root, ast.Name):
            return value
        key = scope.key_of(ascii_name(root.id))
        if isinstance(value, Scalar):
            return replace(value, uses=value.uses | {key})
        if isinstance(value, Matrix):
            return replace(
                value,
                entries={k: replace(x, uses=x.uses | {key}) for k, x in value.entries.items()},
            )
        return value

    def _library_call(self, name: str, node: ast.Call, scope: Scope) -> Value:
        of_numpy = name.startswith("numpy.") or (
            bool(self.star_modules) and self.star_modules[-1] in _NUMPY
        )
        name = name.removeprefix("numpy.")
        keywords = {k.arg: k.value for k in node.keywords}
        if name in _SYMBOLS:
            if set(keywords) - _ASSUMPTIONS:
                raise UnreadError(f"{self._quote(node)} is not read")
            return self._symbols(name, node)
        if name in ("dict", "SimpleNamespace"):
            where = self.where(node)
            return Structure(
                {str(k): self._right_side(x, scope, where) for k, x in keywords.items()}
            )
        dtype = keywords.pop("dtype", None)
        if dtype is not None and not (
            isinstance(dtype, ast.Name | ast.Attribute)
            and _last(dtype) in ("object", "float", "float64")
        ):
            raise UnreadError(f"{self._quote(node)} is not read")
        if name in (*_MATRICES, *_ARRAYS):
            if keywords:
                raise UnreadError(f"{self._quote(node)} is not read")
            arguments = [self.value(x, scope) for x in node.args]
            return self._matrix(name, arguments, scope)
        if name == "broadcast_arrays" and not keywords:
            return Several(tuple(self.value(x, scope) for x in node.args))
        if set(keywords) - _KNOWN_KEYWORDS:
            raise UnreadError(f"{self._quote(node)} is not read")
        arguments = [self._operand_or_list(x, scope) for x in node.args]
        return called(scope, name, arguments, of_numpy)

    def _operand_or_list(self, node: ast.expr, scope: Scope) -> Value:
        value = self.value(node, scope)
        if isinstance(value, Given) and not self.record.robot.vocabulary.knows(value.name):
            return value
        return scope.scalar(value) if isinstance(value, Given | Part) else value

    def _matrix(self, name: str, arguments: Sequence[Value], scope: Scope) -> Value:
        of_numpy = name in (*_ARRAYS, *_CASADI)
        match arguments:
            case [Scalar() as m, Scalar() as n, Matrix() as entries] if (
                m.text.isdecimal() and n.text.isdecimal()
            ):
                row_count = int(m.text[:6])
                columns = int(n.text[:6])
                flat_entries = list(chain.from_iterable(entries.rows))
                if row_count * columns != len(flat_entries):
                    raise UnreadError("a matrix whose entries do not fit its size is not read")
                return matrix_of(
                    [flat_entries[k * columns : (k + 1) * columns] for k in range(row_count)]
                )
            case [Matrix() as entries]:
                return as_matrix(entries, of_numpy)
            case [Several(values)] if values and all(isinstance(x, Matrix) for x in values):
                rows = []
                for x in values:
                    if isinstance(x, Matrix):
                        rows += [list(x.entries.values())] if x.is_flat else x.rows
                return matrix_of(rows, multiplies_entries=of_numpy)
            case [Several(values)] if (
                not of_numpy and values and all(isinstance(x, Given) for x in values)
            ):
                return matrix_of([[scope.scalar(x)] for x in values])
            case [Given() as vector] if of_numpy:
                return vector
        if name == "vertcat" and arguments:
            return matrix_of([[scope.scalar(x)] for x in arguments], multiplies_entries=True)
        raise UnreadError("a matrix of something else than rows of numbers is not read")

    def _own_call(self, function: Function, node: ast.Call, scope: Scope) -> Value:
        """Return the value of a call of one of the program's functions."""
        if self.changes.of_function(function):
            raise UnreadError(
                f"{function.name}(...) is a function that may change other names, and is not read"
            )
        values: dict[str, Value] = dict(function.defaults)
        arguments: list[Value] = []
        for argument in node.args:
            arguments += self._arguments(argument, scope)
        if len(arguments) > len(function.parameters):
            raise UnreadError(f"{function.name}(...) is called with too many arguments")
        values |= dict(zip(function.parameters, arguments, strict=False))
        for keyword in node.keywords:
            name = ascii_name(str(keyword.arg))
            if name not in function.parameters[len(arguments) :]:
                raise UnreadError(
                    f"{function.name}(...) is called with {name[:40]}, which it does not take"
                )
            values[name] = self.value(keyword.value, scope)
        missing = [name for name in function.parameters if name not in values]
        if missing:
            raise UnreadError(f"{function.name}(...) is called without {missing[0]}")
        return self._used(self.apply(function, values), node, scope)

    def _arguments(self, node: ast.expr, scope: Scope) -> list[Value]:
        """Return an argument, or several of ``*row``."""
        if not isinstance(node, ast.Starred):
            return [self.value(node, scope)]
        match self.value(node.value, scope):
            case Matrix() as row if row.is_flat:
                return list(row.entries.values())
            case Several(values):
                return list(values)
        raise UnreadError(f"{self._quote(node)} is not read")

    def _method(self, value: Value, method: str, node: ast.Call, scope: Scope) -> Value:
        arguments = node.args
        match value, method:
            case Matrix(), "transpose" if not arguments:
                return transposed(value)
            case Library("SX" | "MX" | "DM") | Given("SX" | "MX" | "DM"), "sym":
                return self._casadi_symbol(node, scope)
            case Matrix(), "dot" if (
                len(arguments) == 1 and not value.multiplies_entries and 1 in value.shape
            ):
                other = self._operand(arguments[0], scope)
                if not isinstance(other, Matrix) or other.entries.keys() != value.entries.keys():
                    raise UnreadError(f"{self._quote(node)} is not read")
                return calculated(transposed(value), "@", other, self.record.power)
            case Matrix(), "dot" if len(arguments) == 1:
                return calculated(value, "@", self._operand(arguments[0], scope), self.record.power)
            case _, "flatten" | "ravel" | "squeeze" if not arguments:
                return flat(value)
            case Library("Matrix") | Given("Matrix"), "zeros" | "eye":
                return called(scope, method, [self.value(x, scope) for x in arguments], False)
            case _, "applyfunc" if len(arguments) == 1 and self._is_unchanging(arguments[0], scope):
                return unchanged(value)
            case Matrix(), "simplify":
                raise UnreadError(
                    "the method simplify() of a matrix changes it and returns nothing"
                )
            case _, name if name in _UNCHANGED_METHODS and name != "applyfunc":
                plain = all(self._is_unchanging(x, scope) for x in arguments)
                if plain and not {k.arg for k in node.keywords} & _NOT_UNCHANGING:
                    return unchanged(value)
        raise UnreadError(f"{self._quote(node)} is not read")

    def _is_time(self, node: ast.expr, scope: Scope) -> bool:
        """Whether an expression is the time: t, unless the program gives this name to something else."""
        match node:
            case ast.Name("t"):
                value_of_t = value_of("t", scope)
                return value_of_t is None or (
                    isinstance(value_of_t, Given) and value_of_t.name == "t"
                )
            case ast.Attribute(ast.Name(), "_t"):
                return True
        return False

    def _is_library(self, node: ast.expr, scope: Scope) -> bool:
        """Whether an expression is a library's function."""
        return isinstance(self._value_or_none(node, scope), Library | Given)

    def _is_unchanging(self, node: ast.expr, scope: Scope) -> bool:
        """Whether an argument is a library's function that writes an expression in another way."""
        value = self._value_or_none(node, scope)
        return (
            isinstance(value, Library | Given)
            and value.name.removeprefix("numpy.") in _UNCHANGED_METHODS
        )

    # Symbols and time

    def _symbols(self, function: str, node: ast.Call) -> Value:
        """Return the names of symbols('q1 q2'), Symbol('m1') and dynamicsymbols('q1', 1)."""
        match node.args:
            case [ast.Constant(str(text)), *rest]:
                names = _symbol_names(text)
            case _:
                raise UnreadError(f"{self._quote(node)} is not read")
        match rest:
            case []:
                pass
            case [ast.Constant(int(order))] if function == "dynamicsymbols" and order in (0, 1, 2):
                marks = ("", "dot", "ddot")[order]
                names = [rate_name(plain_name(name), marks) for name in names] if order else names
            case _:
                raise UnreadError(f"{self._quote(node)} is not read")
        of_time = function == "dynamicsymbols" or any(k.arg == "cls" for k in node.keywords)
        symbols = tuple(Given(name, is_symbol=True, is_constant=not of_time) for name in names)
        if len(symbols) == 1:
            return symbols[0]
        return Several(symbols, tuple(names))

    def _casadi_symbol(self, node: ast.Call, scope: Scope) -> Value:
        """Return the symbol of SX.sym("q1"), and the robot's vector of SX.sym("q", 2)."""
        match node.args:
            case [ast.Constant(str(name))]:
                return Given(name, is_symbol=True, is_constant=True)
            case [ast.Constant(str(name)), ast.Constant(int(n))] if n == self.record.robot.n:
                vector = Given(name, is_symbol=True)
                rows = [[scope.scalar(scope.entry(vector, (k,)))] for k in range(n)]
                return matrix_of(rows, multiplies_entries=True)
        raise UnreadError(f"{self._quote(node)} is not read")

    def _of_time(self, node: ast.Call, scope: Scope) -> Value:
        """Return Function('q1')(t), and symbols('q1', cls=Function)(t)."""
        inner = node.func
        assert isinstance(inner, ast.Call)  # noqa: S101
        is_time = [ast.dump(x) for x in node.args] == ["Name(id='t', ctx=Load())"]
        if (
            is_time
            and _last(inner.func) == "Function"
            and inner.args
            and isinstance(inner.args[0], ast.Constant)
        ):
            names = _symbol_names(str(inner.args[0].value))
            if len(names) == 1:
                self._used(Scalar("0"), inner, scope)
                return Given(names[0], is_symbol=True)
        raise UnreadError(f"{self._quote(node)} is not read")

    def _time_derivative(self, node: ast.Call, scope: Scope) -> Value | None:
        """Return the rate that diff(q1, t), q1.diff(t, 2) and Derivative(q1(t), t) are; None of another call."""
        arguments = list(node.args)
        match node.func:
            case ast.Name("diff" | "Derivative"):
                pass
            case ast.Attribute(ast.Name(module), "diff" | "Derivative") if isinstance(
                self._value_or_none(ast.Name(module, ast.Load()), scope), Module
            ):
                pass
            case ast.Attribute(inner, "diff"):
                arguments.insert(0, inner)
            case _:
                return None
        order = 0
        match arguments[1:]:
            case [time] if self._is_time(time, scope):
                order = 1
            case [time, ast.Constant(2)] | [ast.Tuple([time, ast.Constant(2)])] if self._is_time(
                time, scope
            ):
                order = 2
            case [time, other] if self._is_time(time, scope) and self._is_time(other, scope):
                order = 2
        if not order:
            raise UnreadError(f"{self._quote(node)} is not read")
        value = self.value(arguments[0], scope)
        if isinstance(value, Given) and value.is_constant:
            reason = f"{value.name} is a symbol and no function of t, so that its derivative is 0"
            raise UnreadError(f"{self._quote(node)}: {reason}")
        name = ""
        if isinstance(value, Given):
            name = value.name
        elif isinstance(value, Scalar) and value.is_name:
            name = value.text
        if not name:
            raise UnreadError(f"{self._quote(node)} is not read")
        vocabulary = self.record.robot.vocabulary
        plain = plain_name(name)
        for base in (plain, plain.replace("dot", "")):
            known = rate_name(base, ("dot", "ddot")[order - 1 if base == plain else min(order, 1)])
            if vocabulary.is_position(base) and vocabulary.is_state(known):
                return self._used(scope.known(known), node, scope)
        raise UnreadError(
            f"{self._quote(node)}: {name} is the program's own name, of which no rate is read"
        )

    def _value_or_none(self, node: ast.expr, scope: Scope) -> Value | None:
        try:
            return self.value(node, scope)
        except UnreadError:
            return None


_NOT_UNCHANGING = frozenset(("inplace", "evaluate", "func", "exact", "out"))
"""Keywords with which these functions return something else: ``collect(V, g, evaluate=False)`` a dictionary."""

_UNCHANGED_METHODS = word_set(
    """
    simplify expand trigsimp factor cancel together powsimp expand_trig radsimp collect doit applyfunc copy
    as_immutable as_mutable
    """
)
"""Methods that write an expression in another way, or copy it."""


def constant_index(node: ast.expr) -> Index | None:
    """Return the numbers of an index; ``[..., 0, 1]`` counts after leading axes. None of any other index."""
    parts = node.elts if isinstance(node, ast.Tuple) else [node]
    if parts and isinstance(parts[0], ast.Constant) and parts[0].value is Ellipsis:
        parts = parts[1:]
    numbers = [part.value if isinstance(part, ast.Constant) else None for part in parts]
    index = tuple(k for k in numbers if type(k) is int and 0 <= k <= BOUNDS.index)
    return index if index and len(index) == len(parts) else None


def _is_written_out(node: ast.expr) -> bool:
    """Whether an expression is a matrix in brackets, perhaps with a factor, or simplified."""
    match node:
        case ast.List() | ast.Tuple():
            return True
        case ast.BinOp(left, ast.Mult() | ast.Div(), right):
            return _is_written_out(left) or _is_written_out(right)
        case ast.Call(function, arguments):
            if _last(function) in (*_MATRICES, *_ARRAYS):
                return True
            inner = [*arguments, *([function.value] if isinstance(function, ast.Attribute) else [])]
            return any(_is_written_out(x) for x in inner)
    return False


def _local_name(node: ast.expr) -> str:
    """Return the name that an expression is, as it is or as an array; empty of another expression."""
    while True:
        match node:
            case ast.Name(name):
                return ascii_name(name)
            case ast.Subscript(inner, ast.Tuple([])):
                node = inner
            case ast.Call(ast.Name(), [inner], []) | ast.Call(
                ast.Attribute(ast.Name()), [inner], []
            ):
                node = inner
            case ast.Call(ast.Attribute(inner), [], []):
                node = inner
            case _:
                return ""


def _chosen(index: ast.expr, length: int) -> range:
    """Return the places that a slice or a number chooses."""
    if isinstance(index, ast.Slice) and index.step is None:
        ends = []
        for end, default in ((index.lower, 0), (index.upper, length)):
            found = (default,) if end is None else constant_index(end)
            if found is None or len(found) != 1:
                raise UnreadError("a slice of other numbers than whole ones is not read")
            ends.append(found[0])
        return range(min(ends[0], length), min(ends[1], length))
    found = constant_index(index)
    if found is None or len(found) != 1 or found[0] >= length:
        raise UnreadError("an index that the matrix does not have is read")
    return range(found[0], found[0] + 1)


def _symbol_names(text: str) -> list[str]:
    names: list[str] = []
    for piece in map(ascii_name, re.split(r"[\s,]+", text.strip().strip(","))):
        span = re.fullmatch(r"(\w*?)\(?(\d*):(\d+)\)?", piece)
        if span and int(span[3][:6]) <= BOUNDS.symbol_index:
            names += [f"{span[1]}{k}" for k in range(int(span[2] or 0), int(span[3]))]
        else:
            names.append(piece)
    if not names or not all(re.fullmatch(r"[\w\\{}]+", name) for name in names):
        raise UnreadError(f"symbols of {text[:40]!r} are not read")
    return names


def _assigned_by(node: ast.AST) -> Iterator[str]:
    """Yield the names, keys and attributes that one node assigns."""
    match node:
        case ast.Name(name, ast.Store()) | ast.Attribute(_, name, ast.Store()):
            yield name
        case ast.Subscript(_, ast.Constant(str(key)), ast.Store()):
            yield key
        case ast.Dict(keys):
            yield from (
                key.value
                for key in keys
                if isinstance(key, ast.Constant) and isinstance(key.value, str)
            )


def _ends(statement: ast.stmt) -> bool:
    """Whether a statement ends a function by an exception whatever is computed."""
    match statement:
        case ast.Raise() | ast.Assert(ast.Constant(False | 0 | None)):
            return True
    return False


def _executed(statement: ast.stmt) -> list[ast.AST]:
    """Return the parts of a statement whose effects are not those of the assignments that are read."""
    match statement:
        case ast.FunctionDef(_, arguments):
            return [*arguments.defaults, *(x for x in arguments.kw_defaults if x is not None)]
        case ast.Assign(targets, value) if any(isinstance(x, ast.Subscript) for x in targets):
            return [value, *(x.slice for x in targets if isinstance(x, ast.Subscript))]
        case ast.AugAssign(ast.Subscript(_, index), _, value):
            return [value, index]
        case ast.Assign([ast.Name()], ast.Lambda(arguments)):
            return [*arguments.defaults]
    return [statement]


def _is_plain_class(statement: ast.ClassDef) -> bool:
    """Whether a class is made by nothing else than its body: by no base or decorator but a dataclass's."""
    decorators = [x.func if isinstance(x, ast.Call) else x for x in statement.decorator_list]
    return (
        not statement.bases
        and not statement.keywords
        and all(_last(x) == "dataclass" for x in decorators)
    )


def _is_main(test: ast.expr) -> bool:
    """Whether a condition is ``__name__ == "__main__"``."""
    match test:
        case ast.Compare(ast.Name("__name__"), [ast.Eq()], [ast.Constant("__main__")]):
            return True
    return False


def _is_batch_shape(node: ast.expr) -> bool:
    """Whether an entry of a tuple is ``*q.shape[:-1]``."""
    match node:
        case ast.Starred(
            ast.Subscript(
                ast.Attribute(_, "shape"), ast.Slice(None, ast.UnaryOp(ast.USub(), ast.Constant(1)))
            )
        ):
            return True
    return False


def _is_ellipsis(indices: Sequence[ast.expr]) -> bool:
    """Whether an index is ``...`` alone."""
    match indices:
        case [ast.Constant(value)]:
            return value is Ellipsis
    return False


def _returns_inside(body: Sequence[ast.stmt]) -> bool:
    """Whether a function returns anywhere but at its end."""
    kinds = ast.Return | ast.Yield | ast.YieldFrom
    nodes = chain.from_iterable(map(without_functions, body))
    inner = [node for node in nodes if isinstance(node, kinds)]
    return len(inner) > (1 if isinstance(body[-1], ast.Return) else 0)


def _last(node: ast.expr) -> str:
    """Return the name, or the last attribute, that an expression is; empty of another expression."""
    match node:
        case ast.Name(name) | ast.Attribute(_, name):
            return str(name)
    return ""


def _entry_counted(matrix: Matrix, k: int) -> Scalar:
    """Return an entry of a matrix whose entries are counted by rows."""
    entries = list(chain.from_iterable(matrix.rows))
    if k >= len(entries):
        raise UnreadError("an index is read that the matrix does not have")
    return entries[k]
