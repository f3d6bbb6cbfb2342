"""Side effects of a piece of a Python program, beyond the assignments that are read.

A piece that only calculates changes nothing. Which functions only calculate is a closed list, and a name counts as such
a function only where the program has not bound it to anything else. Any other call may change whatever it is given, or
can reach: the names in the bodies of the program's own functions, and those in what is not read.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain

from dhkit.errors import AnswerError
from dhkit.grading.answers.programs.library import UNCHANGED
from dhkit.grading.answers.programs.scope import Scope
from dhkit.grading.answers.programs.values import (
    Function,
    Given,
    Library,
    Matrix,
    Module,
    Several,
    Structure,
    Unread,
    Value,
)
from dhkit.grading.answers.rewriting import MODULES as USUAL_MODULES
from dhkit.grading.answers.tokens import to_ascii, word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

_UNBOUNDED = word_set(
    """
    exec eval compile globals locals vars setattr delattr getattr execfile run_line_magic import_module get_ipython
    run_cell_magic run_path run_module modules builtins inspect gc f_globals f_locals f_back user_ns
    """
)
"""Names and attributes with which a program may change any name of its own."""

_HARMLESS_DUNDER = frozenset(
    ("__name__", "__file__", "__doc__", "__version__", "__all__", "__init__")
)

_NEW = (frozenset(FUNCTION_NAMES) - {"max", "min"}) | word_set(
    """
    Matrix ImmutableMatrix array matrix zeros eye ones full zeros_like ones_like identity arange linspace diag symbols
    Symbol dynamicsymbols Function diff Derivative lambdify latex pycode ccode fcode octave_code srepr inv pinv solve
    lstsq det cross dot matmul norm cond eig eigh eigvals eigvalsh trace rank concatenate vstack hstack stack
    column_stack block_diag outer kron DM SX MX vertcat horzcat jacobian gradient hessian mtimes print len range str
    repr float int round abs bool complex isinstance type allclose isclose deg2rad rad2deg N nsimplify Rational Integer
    Float S integrate solve_ivp odeint time perf_counter random seed format ValueError Exception
    """
)
"""Functions that only calculate, and whose result shares no entry with their arguments."""

_QUIET = (
    _NEW
    | UNCHANGED
    | word_set(
        """
    display pprint pretty_print pretty mprint vprint vlatex init_printing init_session init_vprinting sum max min sorted
    list tuple dict set zip enumerate reversed all any super map transpose clip reshape squeeze ravel flatten where
    Eq Math Markdown Latex HTML broadcast_arrays figure plot subplots show legend xlabel ylabel title grid savefig axis
    tight_layout xlim ylim scatter cse open close write set_printoptions filterwarnings Path
    """
    )
)
"""Functions that only calculate, draw or print."""

_QUIET_METHODS = _QUIET | word_set(
    """
    subs evalf T tolist join xreplace rewrite coeff n row col is_symmetric conjugate mean astype values keys items get
    split strip lower upper has free_symbols equals multiply adjugate cofactor LUsolve LDLsolve minor charpoly
    applyfunc sym as_expr args eigenvals eigenvects singular_values nullspace columnspace rref copy set_xlabel
    set_ylabel set_title set_xlim set_ylim add_subplot
    """
)
"""Methods of libraries' objects that change neither their object nor their arguments."""

_CHANGING_KEYWORDS = frozenset(("out", "inplace", "overwrite_a", "overwrite_b", "where", None))
"""Keywords with which a function may change its arguments; None is the keyword of ``**options``."""

_MOST_ARGUMENTS = dict.fromkeys(FUNCTION_NAMES, 1) | {
    **dict.fromkeys(
        (
            "atan2",
            "arctan2",
            "hypot",
            "power",
            "dot",
            "matmul",
            "round",
            "solve",
            "transpose",
            "cond",
        ),
        2,
    ),
    **dict.fromkeys(("clip", "sum", "max", "min", "reshape", "where", "trace", "outer", "mean"), 3),
    **dict.fromkeys(("diff", "Rational", "Eq", "pow", "sqrt", "root", "atan", "log"), 5),
}
"""Largest number of arguments: numpy takes one more for the result, ``sin(M, M)``."""


def ascii_name(name: str) -> str:
    """Return an identifier in ASCII: Greek letters by their names, as the reader of formulas has them."""
    if name.isascii():
        return name
    try:
        plain, _ = to_ascii(name)
    except AnswerError:
        plain = ""
    return (
        plain
        if plain.isidentifier() and plain.isascii()
        else "u" + name.encode("unicode_escape").hex()
    )


def is_unbounded(node: ast.AST) -> bool:
    """Whether a name or an attribute may change any name of the program."""
    match node:
        case ast.Name(name) | ast.Attribute(_, name):
            is_dunder = (
                name.startswith("__") and name.endswith("__") and name not in _HARMLESS_DUNDER
            )
            return is_dunder or name in _UNBOUNDED
        case ast.alias(name):
            return name.split(".")[0] in _UNBOUNDED or name == "__main__"
        case ast.ImportFrom(module):
            return module == "__main__"
    return False


def names_in(node: ast.AST) -> list[str]:
    """Return the names in a piece of a program."""
    return [x.id for x in ast.walk(node) if isinstance(x, ast.Name)]


def assigned_names(node: ast.AST) -> Iterator[str]:
    """Yield all names that a piece of a program binds or deletes, or whose parts it assigns, however deep."""
    yield from bound_names(node)
    for inner in without_functions(node):
        match inner:
            case ast.Subscript(_, _, ast.Store() | ast.Del()) | ast.Attribute(
                _, _, ast.Store() | ast.Del()
            ):
                yield from names_in(inner)[:1]


def bound_names(node: ast.AST) -> Iterator[str]:
    """Yield all names that a piece of a program binds or deletes, however deep, but not inside functions."""
    for inner in without_functions(node):
        match inner:
            case ast.Name(name, ast.Store() | ast.Del()):
                yield name
            case ast.FunctionDef(name) | ast.AsyncFunctionDef(name) | ast.ClassDef(name):
                yield name
            case ast.alias(name, other):
                yield other or name.split(".")[0]
            case (
                ast.ExceptHandler(_, str(name))
                | ast.MatchAs(_, str(name))
                | ast.MatchStar(str(name))
            ):
                yield name
            case ast.MatchMapping(rest=str(name)):
                yield name
            case ast.Global(several) | ast.Nonlocal(several):
                yield from several


@dataclass
class Effects:
    """Side effects of a piece of a program on names, beyond binding them.

    Attributes
    ----------
    changed
        Names whose matrices it may change.
    shared
        Names that may be bound to the same lists and matrices as others, by name.
    """

    changed: set[str] = field(default_factory=set)
    shared: dict[str, set[str]] = field(default_factory=dict)

    def share(self, name: str, others: Iterable[str]) -> None:
        """Note that a name may be the same object as others, or hold them."""
        for other in others:
            if other != name:
                self.shared.setdefault(name, set()).add(other)
                self.shared.setdefault(other, set()).add(name)

    def reached(self) -> set[str]:
        """Return the names that may be changed by way of others."""
        found = set(self.changed)
        waiting = list(self.changed)
        while waiting:
            for other in self.shared.get(waiting.pop(), ()):
                if other not in found:
                    found.add(other)
                    waiting.append(other)
        return found


class Changes:
    """Finds what pieces of a program may change.

    Parameters
    ----------
    main
        The names of the program.
    """

    def __init__(self, main: Scope) -> None:
        self.main = main
        self.classes: set[str] = set()
        """Names of the program's classes: what their methods do is not read."""
        self.imported: dict[str, str] = {}
        """Functions of libraries that are not read, by the names that they are imported under."""
        self.compiled: set[str] = set()
        """Names of functions that ``lambdify`` has made."""
        self._visited: set[int] = set()
        self._known: dict[tuple[int, int], frozenset[str]] = {}
        """Names that functions change, by function and by the number of names that the program has bound."""

    def of(self, nodes: Iterable[ast.AST], scope: Scope, local: Iterable[str] = ()) -> Effects:
        """Return the effects of pieces of a program.

        Parameters
        ----------
        nodes
            The pieces.
        scope
            Where their names are looked up.
        local
            Names that the pieces bind, which are not functions of libraries.
        """
        piece = _Piece(self, scope, frozenset(local))
        for node in nodes:
            for inner in without_functions(node):
                piece.note(inner)
        return piece.effects

    def of_function(self, function: Function) -> frozenset[str]:
        """Return the names outside a function, and its arguments, that it may change."""
        key = id(function), len(self.main.names)
        if id(function) in self._visited:
            return frozenset()
        if key not in self._known:
            self._visited.add(id(function))
            try:
                self._known[key] = self._of_function(function)
            finally:
                self._visited.discard(id(function))
        return self._known[key]

    def _of_function(self, function: Function) -> frozenset[str]:
        nodes = _body_nodes(function)
        local: set[str] = set()
        outer: set[str] = set()
        for node in nodes:
            local |= {ascii_name(name) for name in bound_names(node)}
            for inner in ast.walk(node):
                if isinstance(inner, ast.Global | ast.Nonlocal):
                    outer.update(inner.names)
        effects = self.of(nodes, self.main, local | set(function.parameters))
        for name, value in function.defaults.items():
            effects.share(
                name, value.names if isinstance(value, Unread) else function.default_names
            )
        kept = (local - set(function.parameters)) - outer
        return frozenset(effects.reached() - kept) | frozenset(outer)

    def mentioned(self, names: Iterable[str], scope: Scope) -> set[str]:
        """Return names, with those in the functions' bodies and in the unread statements that they stand for."""
        found: set[str] = set()
        waiting = [ascii_name(name) for name in names]
        while waiting:
            name = waiting.pop()
            if name in found:
                continue
            found.add(name)
            match value_of(name, scope):
                case Function() as function:
                    for node in _body_nodes(function):
                        waiting += [ascii_name(x) for x in names_in(node)]
                    waiting += function.default_names
                case Unread(_, inside):
                    waiting += inside
                case Several(values, inside):
                    waiting += [name for name in inside if name]
                    waiting += list(chain.from_iterable(map(_names_of, values)))
                case Structure(fields):
                    waiting += list(chain.from_iterable(map(_names_of, fields.values())))
        return found


def _names_of(value: Value) -> Iterator[str]:
    """Yield the names in a function, or in an unread statement."""
    match value:
        case Function():
            nodes = (
                [value.definition] if isinstance(value.definition, ast.expr) else value.definition
            )
            for node in nodes:
                yield from map(ascii_name, names_in(node))
        case Unread(_, inside):
            yield from inside


def without_functions(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a node and all inside it, but of functions only themselves: their bodies are not executed with it."""
    waiting = [node]
    while waiting:
        one = waiting.pop()
        yield one
        match one:
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                waiting += [
                    *one.decorator_list,
                    *one.args.defaults,
                    *(x for x in one.args.kw_defaults if x is not None),
                ]
            case ast.Lambda():
                waiting += one.args.defaults
            case _:
                waiting += ast.iter_child_nodes(one)


def _body_nodes(function: Function) -> Sequence[ast.AST]:
    """Return the statements of a function, or the expression of a lambda."""
    body: ast.expr | Sequence[ast.stmt] = function.definition
    return [body] if isinstance(body, ast.expr) else body


def value_of(name: str, scope: Scope) -> Value | None:
    """Return the value that a name is bound to; None where the program does not bind it."""
    owner = scope.owner(name)
    binding = owner.names.get(name) if owner is not None else None
    return binding.value if binding is not None else None


class _Piece:
    """One piece of a program, whose nodes are looked at one by one."""

    def __init__(self, changes: Changes, scope: Scope, local: frozenset[str]) -> None:
        self.changes = changes
        self.scope = scope
        self.local = local
        self.effects = Effects()

    def note(self, node: ast.AST) -> None:
        """Note what one node does."""
        match node:
            case ast.Subscript(_, _, ast.Store() | ast.Del()) | ast.Attribute(
                _, _, ast.Store() | ast.Del()
            ):
                self.effects.changed |= self._stored_in(node)
            case ast.AugAssign(target, _, value):
                self.effects.changed |= self.mentioned(target)
                self._bind(
                    target, self.shared(value) if not _calculates(value) else set(names_in(value))
                )
            case ast.Call():
                if not self._is_quiet(node):
                    self.effects.changed |= self.mentioned(node)
            case ast.Assign(targets, value):
                for target in targets:
                    self._bind(target, self.shared(value))
                if len(targets) > 1:
                    names = list(chain.from_iterable(map(names_in, targets)))
                    self._bind(targets[0], set(names))
            case ast.AnnAssign(target, _, ast.expr() as value) | ast.NamedExpr(target, value):
                self._bind(target, self.shared(value))
            case (
                ast.For(target, value)
                | ast.AsyncFor(target, value)
                | ast.comprehension(target, value)
            ):
                self._bind(target, set(names_in(value)))
            case ast.withitem(value, ast.expr() as target):
                self._bind(target, set(names_in(value)))
            case ast.Match(value):
                for name in assigned_names(node):
                    self.effects.share(
                        ascii_name(name), self.changes.mentioned(names_in(value), self.scope)
                    )
            case ast.Try(handlers=handlers):
                for handler in handlers:
                    if handler.name:
                        self.effects.share(ascii_name(handler.name), self.mentioned(node))
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                self._note_decorators(node)
                parameters = tuple(
                    ascii_name(x.arg) for x in ast.walk(node.args) if isinstance(x, ast.arg)
                )
                inner = Function(ascii_name(node.name), parameters, node.body, "")
                self.effects.changed |= self.changes.of_function(inner) - set(parameters)
            case ast.Lambda(_, body):
                self.effects.changed |= self.changes.of([body], self.scope, self.local).changed
            case ast.ClassDef():
                self._note_decorators(node)

    def _note_decorators(self, node: ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) -> None:
        for decorator in node.decorator_list:
            self.effects.changed |= self.mentioned(decorator) - self.modules()

    def mentioned(self, node: ast.AST) -> set[str]:
        """Return the names that a piece can reach."""
        return self.changes.mentioned(names_in(node), self.scope)

    def modules(self) -> set[str]:
        """Return the names of modules."""
        main = self.changes.main
        return {
            name
            for name, binding in main.names.items()
            if isinstance(binding.value, Module | Library)
        }

    def _stored_in(self, target: ast.AST) -> set[str]:
        """Return the names that an assignment to a part changes: M of M[0, 0], all that it names of (M, 0)[0][0, 0]."""
        inner = target
        while isinstance(inner, ast.Subscript | ast.Attribute):
            inner = inner.value
        return {ascii_name(inner.id)} if isinstance(inner, ast.Name) else self.mentioned(target)

    def _bind(self, target: ast.expr, shared: set[str]) -> None:
        others = self.changes.mentioned(shared, self.scope) - self.modules()
        inner: ast.expr = target
        while isinstance(inner, ast.Subscript | ast.Attribute | ast.Starred):
            inner = inner.value
        for name in names_in(inner):
            self.effects.share(ascii_name(name), others)

    def shared(self, value: ast.expr) -> set[str]:
        """Return names of lists and matrices that a value may be, or hold."""
        match value:
            case ast.UnaryOp() | ast.Compare() | ast.Constant() | ast.JoinedStr():
                return set()
            case ast.BinOp(left, _, right):
                return (
                    set()
                    if _calculates(value) and not self._has_list(left, right)
                    else set(names_in(value))
                )
            case ast.Name(name):
                return {name}
            case ast.Attribute(inner) | ast.Subscript(inner) | ast.Starred(inner):
                return self.shared(inner)
            case ast.Call(function, arguments, keywords):
                is_new = (
                    self._library_name(function) in _NEW
                    and not {k.arg for k in keywords} & _CHANGING_KEYWORDS
                )
                if is_new and not any(k.arg == "copy" for k in keywords):
                    return set()
                shared = set().union(
                    *map(self.shared, arguments), *(self.shared(k.value) for k in keywords)
                )
                return shared | set(names_in(function))
            case ast.List(parts) | ast.Tuple(parts):
                return set().union(*map(self.shared, parts))
        return set(names_in(value))

    def _has_list(self, *sides: ast.expr) -> bool:
        """Whether an operand is a name of what may be a list: two lists are joined, not added."""
        for side in sides:
            if isinstance(side, ast.Name):
                value = value_of(ascii_name(side.id), self.scope)
                if isinstance(value, Unread | Several) or (
                    isinstance(value, Matrix) and value.is_list
                ):
                    return True
        return False

    def _library_name(self, function: ast.expr) -> str:
        """Return the name of a library's function; empty for one that may be the program's own."""
        match function:
            case ast.Name(name):
                if name in self.local:
                    return ""
                if name in self.changes.imported and isinstance(
                    value_of(ascii_name(name), self.scope), Unread
                ):
                    return self.changes.imported[name]
                match value_of(ascii_name(name), self.scope):
                    case None:
                        return "" if self.scope.owner(ascii_name(name)) is not None else name
                    case Library(known):
                        return known.removeprefix("numpy.")
                    case Given(known, False):
                        return known
            case ast.Attribute(inner, name) if self._is_module(inner):
                return name
        return ""

    def _is_module(self, node: ast.expr) -> bool:
        match node:
            case ast.Name(name):
                value = value_of(ascii_name(name), self.scope)
                return isinstance(value, Module) or (value is None and name in USUAL_MODULES)
            case ast.Attribute(inner):
                return self._is_module(inner)
        return False

    def _is_quiet(self, call: ast.Call) -> bool:
        """Whether a call only calculates, draws or prints."""
        if {k.arg for k in call.keywords} & _CHANGING_KEYWORDS:
            return False
        arguments = [*call.args, *(k.value for k in call.keywords)]
        parts_of_arguments = chain.from_iterable(map(ast.walk, arguments))
        if any(self._is_loud_function(part) for part in parts_of_arguments):
            return False
        if library := self._library_name(call.func):
            most = _MOST_ARGUMENTS.get(library, 100)
            if isinstance(call.func, ast.Name) and library in ("max", "min", "sum"):
                most = 100  # Python's own
            return library in _QUIET and len(call.args) <= most
        match call.func:
            case ast.Name(name) if name not in self.local or self._is_bound_here(name):
                match value_of(ascii_name(name), self.scope):
                    case Function() as function:
                        return not self.changes.of_function(function)
                    case Unread() if name in self.changes.compiled:
                        return True
                    case Structure():  # a class of fields alone makes objects
                        return True
            case ast.Attribute(inner, method):
                reached = self.mentioned(inner)
                is_own = bool(reached & self.changes.classes)
                most = (
                    _MOST_ARGUMENTS.get(method, 100) - 1
                    if method in ("clip", "dot", "round")
                    else 100
                )
                return method in _QUIET_METHODS and not is_own and len(call.args) <= most
            case ast.Call(function):
                return self._library_name(function) == "Function"
        return False

    def _is_bound_here(self, name: str) -> bool:
        """Whether a function's local name is bound already."""
        return self.scope is not self.changes.main and ascii_name(name) in self.scope.names

    def _is_loud_function(self, node: ast.AST) -> bool:
        """Whether an argument is a function that may change something, and that the callee may call."""
        match node:
            case ast.Name(name):
                value = value_of(ascii_name(name), self.scope)
                return isinstance(value, Function) and bool(self.changes.of_function(value))
            case ast.Lambda(_, body):
                return bool(self.changes.of([body], self.scope, self.local).changed)
        return False


def _calculates(value: ast.expr) -> bool:
    """Whether an expression is an operation whose operands are not lists: [M]*2 holds M twice."""
    match value:
        case ast.BinOp(left, _, right):
            return _calculates(left) and _calculates(right)
        case (
            ast.List()
            | ast.Tuple()
            | ast.ListComp()
            | ast.IfExp()
            | ast.BoolOp()
            | ast.Dict()
            | ast.Set()
        ):
            return False
    return True
