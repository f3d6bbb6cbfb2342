"""Side effects of Python statements: what they may change besides the names that they assign.

Changes come from calls, from ``:=``, and from assignments to parts of a list or matrix that has another name too.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from dhkit.grading.answers.programs.python_formulas import MATRIX_CALLS
from dhkit.grading.answers.tokens import word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

UNBOUNDED_NAMES = word_set(
    """
    exec eval compile globals locals vars setattr delattr getattr execfile run_line_magic import_module
    get_ipython run_cell_magic run_path run_module modules builtins inspect gc
    """
)
"""Names with which a program may change any name of its own, or read it in another way than by that name."""

UNBOUNDED_ATTRIBUTES = word_set("f_globals f_locals f_back modules import_module run_line_magic user_ns")
"""Attributes through which a program may change any name."""

HARMLESS_DUNDER = frozenset(("__name__", "__file__", "__doc__", "__version__", "__all__", "__init__"))

HARMLESS = frozenset((*MATRIX_CALLS, *FUNCTION_NAMES)) | word_set(
    """
    print display pprint len range str repr float int round abs sum list tuple zip enumerate type isinstance
    latex init_printing init_session init_vprinting mprint vprint vlatex lambdify symbols Symbol dynamicsymbols
    Function diff Derivative solve simplify expand trigsimp factor collect zeros eye ones diag var Eq Math set
    Markdown Latex dict sorted all any super format Exception ValueError nsimplify cancel together powsimp
    expand_trig radsimp N time perf_counter pretty_print pretty
    """
)
"""Functions that change nothing that they are given."""

SHARING = word_set(
    """
    asarray matrix list tuple dict sorted zip max min Max Min fmin fmax sum S sympify set enumerate super N
    collect simplify expand diag all any abs round nsimplify together cancel factor trigsimp powsimp radsimp
    """
)
"""Harmless functions whose value may be their argument, or share entries with it."""

COPYING = HARMLESS - SHARING

PURE_METHODS = word_set(
    """
    subs diff simplify expand evalf transpose inv det jacobian doit copy dot cross norm tolist format join
    trigsimp factor applyfunc xreplace rewrite coeff collect as_immutable as_mutable n row col rank trace
    eigenvals is_symmetric conjugate show flatten mean max min sum astype T values keys items get split strip
    lower has free_symbols equals multiply adjugate cofactor LUsolve solve together
    """
)
"""Methods that change neither their object nor their arguments."""

MUTATORS = word_set("fill_diagonal put copyto place putmask put_along_axis shuffle at setfield sort")
"""numpy's functions that change their arguments."""

CHANGING_ARGUMENTS = frozenset(("out", "copy", "inplace", "overwrite_a", "overwrite_b", None))
"""Keywords with which a function may change its arguments; None is the keyword of ``**options``."""

MAX_SHARING_NAMES = 200
"""Largest number of names that are followed as names of one matrix."""


@dataclass
class SideEffects:
    """What a statement may change besides the names that it assigns.

    Attributes
    ----------
    unbounded
        An expression that may change any name; None without one.
    changed
        Names of matrices that calls may change, each with the call.
    walrus_names
        Names that ``:=`` assigns.
    """

    unbounded: ast.expr | None = None
    changed: dict[str, ast.expr] = field(default_factory=dict)
    walrus_names: list[str] = field(default_factory=list)


class SideEffectAnalysis:
    """Knows the names of one program that decide what its calls may change.

    Attributes
    ----------
    own
        Names that the program binds anywhere.
    imported
        Names that it imports from known modules.
    modules
        Names of known modules.
    """

    def __init__(self) -> None:
        self.own: set[str] = set()
        self.imported: set[str] = set()
        self.modules: set[str] = set()
        self._sharing: dict[str, set[str]] = {}

    def is_redefined(self, name: str) -> bool:
        """Whether a name of a library's function may be something else in the program."""
        return name in self.own and name not in self.imported

    def add_alias(self, name: str, others: Iterable[str]) -> None:
        """Note that a name may be the same list or matrix as others, or a part of them."""
        for other in others:
            if other != name:
                self._sharing.setdefault(name, set()).add(other)
                self._sharing.setdefault(other, set()).add(name)

    def aliases(self, name: str) -> list[str]:
        """Return the other names that may be the same list or matrix, sorted."""
        reached, waiting = {name}, [name]
        while waiting and len(reached) <= MAX_SHARING_NAMES:
            for other in self._sharing.get(waiting.pop(), ()):
                if other not in reached:
                    reached.add(other)
                    waiting.append(other)
        return sorted(reached - {name})

    def effects_of(self, statement: ast.stmt) -> SideEffects:
        """Return the side effects of a statement; the body of a function is not part of its definition's."""
        effects = SideEffects()
        for node in _nodes_without_function_body(statement):
            match node:
                case ast.comprehension(target, iterated):
                    self._alias_targets(target, iterated)
                case ast.NamedExpr(target, value):
                    self._alias_targets(target, value)
                    effects.walrus_names += names_in(target)
                case ast.Name() | ast.Attribute() if _is_unbounded(node):
                    effects.unbounded = effects.unbounded or node
                case ast.Call():
                    for changed in self._changed(node):
                        for name in (changed, *self.aliases(changed)):
                            effects.changed.setdefault(name, node)
        return effects

    def _alias_targets(self, target: ast.expr, value: ast.expr) -> None:
        others = set(names_in(value)) - self.modules
        for name in names_in(target):
            self.add_alias(name, others)

    def changed_by_block(self, statement: ast.stmt) -> list[str]:
        """Return names whose matrices a block may change by assigning parts of them, under any name.

        Names that the block binds may from then on be the same matrices as names that it reads.
        """
        read = set(names_in(statement)) - self.modules
        for name in bound_names([statement]):
            self.add_alias(name, read)
        changed = part_names(statement)
        return sorted({*changed, *(other for name in changed for other in self.aliases(name))})

    def changed_by_class(self, statement: ast.ClassDef) -> list[str]:
        """Return names of the program whose matrices the body of a class, or one of its methods, may change."""
        changed: list[str] = []
        for inner in statement.body:
            if not isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef):
                changed += self.changed_by_block(inner)
                continue
            arguments = {x.arg for x in ast.walk(inner.args) if isinstance(x, ast.arg)}
            if any(name not in arguments for name in part_names(inner)):
                changed += sorted(set(names_in(inner)) - self.modules - arguments)
        return changed

    def _changed(self, call: ast.Call) -> Iterator[str]:
        """Yield the names of what a call may change."""
        argument_names = [name for argument in _arguments(call) for name in names_in(argument)]
        keywords = {keyword.arg for keyword in call.keywords}
        match call.func:
            case ast.Name(name):
                if any(isinstance(x, ast.Lambda) for argument in _arguments(call) for x in ast.walk(argument)):
                    yield from argument_names
                    return
                if name in HARMLESS and not self.is_redefined(name) and "out" not in keywords:
                    return
                if name in self.imported and name not in MUTATORS and not keywords & CHANGING_ARGUMENTS:
                    return
                yield name
            case ast.Attribute(ast.Name(base), method) if base in self.modules:
                if method not in MUTATORS and not keywords & CHANGING_ARGUMENTS:
                    return
            case ast.Attribute(value, method):
                if method in PURE_METHODS and not keywords & {"out", "inplace"}:
                    return
                yield from (name for name in names_in(value) if name not in self.modules)
            case function:
                yield from argument_names
                yield from names_in(function)
                return
        yield from argument_names

    def shared_names(self, value: ast.expr) -> set[str]:
        """Return names of lists and matrices that a value may be, or share entries with."""
        match value:
            case ast.Name(name):
                return {name}
            case ast.Attribute(inner) | ast.Subscript(inner) | ast.Starred(inner) | ast.NamedExpr(_, inner):
                return self.shared_names(inner)
            case ast.List(parts) | ast.Tuple(parts) | ast.Set(parts) | ast.BoolOp(_, parts):
                return self._shared_by_any(parts)
            case ast.IfExp(_, body, other):
                return self._shared_by_any([body, other])
            case ast.Dict() | ast.ListComp() | ast.GeneratorExp() | ast.SetComp() | ast.DictComp() | ast.Lambda():
                return set(names_in(value))
            case ast.Call(function):
                is_method = isinstance(function, ast.Attribute)
                name = function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")
                is_own = self.is_redefined(name) and not is_method
                keywords = {keyword.arg for keyword in value.keywords}
                if name in COPYING and not is_own and not keywords & CHANGING_ARGUMENTS:
                    return set()
                names = self._shared_by_any(_arguments(value))
                if isinstance(function, ast.Attribute):
                    return names | (self.shared_names(function.value) - self.modules)
                return names | ({name} if name and is_own else set())
        return set()

    def _shared_by_any(self, values: Iterable[ast.expr]) -> set[str]:
        return {name for value in values for name in self.shared_names(value)}


def names_in(node: ast.AST) -> list[str]:
    """Return the names in a piece of a program, in the order of :func:`ast.walk`."""
    return [x.id for x in ast.walk(node) if isinstance(x, ast.Name)]


def bound_names(statements: Sequence[ast.stmt]) -> list[str]:
    """Return all names that statements bind or delete, or whose parts they assign, however deep."""
    names: list[str | None] = []
    waiting: list[ast.AST] = list(statements)
    while waiting:
        node = waiting.pop()
        match node:
            case ast.Name(name, ast.Store() | ast.Del()):
                names.append(name)
            case ast.Subscript(_, _, ast.Store() | ast.Del()) | ast.Attribute(_, _, ast.Store() | ast.Del()):
                names.append(_root_name(node))
            case ast.FunctionDef(name) | ast.AsyncFunctionDef(name) | ast.ClassDef(name):
                names.append(name)
            case ast.alias(name, other):
                names.append(other or name.split(".")[0])
            case ast.ExceptHandler(_, name) | ast.MatchAs(_, name) | ast.MatchStar(name) | ast.MatchMapping(rest=name):
                names.append(name)
            case ast.Global(several) | ast.Nonlocal(several):
                names += several
        waiting += ast.iter_child_nodes(node)
    return list(dict.fromkeys(name for name in names if name))


def part_names(statement: ast.AST) -> list[str]:
    """Return names of which parts are assigned or deleted, or that are changed in place, however deep."""
    names: list[str | None] = []
    for node in ast.walk(statement):
        if isinstance(node, ast.Subscript | ast.Attribute) and isinstance(node.ctx, ast.Store | ast.Del):
            names.append(_root_name(node))
        elif isinstance(node, ast.AugAssign):
            names.append(_root_name(node.target))
    return list(dict.fromkeys(name for name in names if name))


def _root_name(target: ast.AST) -> str | None:
    """Return the name whose part a target is: M for M[0].T; None where the root is no name."""
    while isinstance(target, ast.Subscript | ast.Attribute | ast.Call):
        target = target.func if isinstance(target, ast.Call) else target.value
    return target.id if isinstance(target, ast.Name) else None


def _is_unbounded(node: ast.Name | ast.Attribute) -> bool:
    """Whether a name or an attribute may change any name of the program."""
    name = node.id if isinstance(node, ast.Name) else node.attr
    is_dunder = name.startswith("__") and name.endswith("__") and name not in HARMLESS_DUNDER
    return is_dunder or name in (UNBOUNDED_NAMES if isinstance(node, ast.Name) else UNBOUNDED_ATTRIBUTES)


def _arguments(call: ast.Call) -> list[ast.expr]:
    return [*call.args, *(keyword.value for keyword in call.keywords)]


def _nodes_without_function_body(statement: ast.stmt) -> Iterator[ast.AST]:
    """Yield a statement's nodes; of a function its decorators and defaults alone."""
    waiting: list[ast.AST] = [statement]
    while waiting:
        node = waiting.pop()
        yield node
        if isinstance(node, ast.FunctionDef) and node is statement:
            waiting += [*node.decorator_list, *node.args.defaults, *(d for d in node.args.kw_defaults if d is not None)]
            continue
        waiting += ast.iter_child_nodes(node)
