"""What statements of Python may change besides the names that they assign: by calls, by :=, through another name."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from dhkit.grading.answers.programs.python_formulas import MATRIX_CALLS
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

ANYTHING = frozenset(
    (
        "exec",
        "eval",
        "compile",
        "globals",
        "locals",
        "vars",
        "setattr",
        "delattr",
        "getattr",
        "execfile",
        "run_line_magic",
        "import_module",
        "get_ipython",
        "run_cell_magic",
        "run_path",
        "run_module",
        "modules",
        "builtins",
        "inspect",
        "gc",
    )
)
"""Names with which a program may change any name of its own, or read it in another way than by that name."""
FRAMES = frozenset(("f_globals", "f_locals", "f_back", "modules", "import_module", "run_line_magic", "user_ns"))
"""Attributes through which a program may change any name."""
HARMLESS_DUNDER = frozenset(("__name__", "__file__", "__doc__", "__version__", "__all__", "__init__"))
HARMLESS = frozenset(
    (
        "print",
        "display",
        "pprint",
        "len",
        "range",
        "str",
        "repr",
        "float",
        "int",
        "round",
        "abs",
        "sum",
        "list",
        "tuple",
        "zip",
        "enumerate",
        "type",
        "isinstance",
        "latex",
        "init_printing",
        "init_session",
        "init_vprinting",
        "mprint",
        "vprint",
        "vlatex",
        "lambdify",
        "symbols",
        "Symbol",
        "dynamicsymbols",
        "Function",
        "diff",
        "Derivative",
        "solve",
        "simplify",
        "expand",
        "trigsimp",
        "factor",
        "collect",
        "zeros",
        "eye",
        "ones",
        "diag",
        "var",
        "Eq",
        "Math",
        "set",
        "Markdown",
        "Latex",
        "dict",
        "sorted",
        "all",
        "any",
        "super",
        "format",
        "Exception",
        "ValueError",
        "nsimplify",
        "cancel",
        "together",
        "powsimp",
        "expand_trig",
        "radsimp",
        "N",
        "time",
        "perf_counter",
        "pretty_print",
        "pretty",
        *tuple(MATRIX_CALLS),
        *tuple(FUNCTION_NAMES),
    )
)
"""Functions that change nothing that they are given."""
SHARING = frozenset(
    (
        *("asarray", "matrix", "list", "tuple", "dict", "sorted", "zip", "max", "min", "Max", "Min", "fmin", "fmax"),
        *("sum", "S", "sympify", "set", "enumerate", "super", "N", "collect", "simplify", "expand", "diag", "all"),
        *("any", "abs", "round", "nsimplify", "together", "cancel", "factor", "trigsimp", "powsimp", "radsimp"),
    )
)
"""Harmless functions whose value may be what they are given, or share entries with it."""
COPIES = HARMLESS - SHARING
PURE_METHODS = frozenset(
    (
        "subs",
        "diff",
        "simplify",
        "expand",
        "evalf",
        "transpose",
        "inv",
        "det",
        "jacobian",
        "doit",
        "copy",
        "dot",
        "cross",
        "norm",
        "tolist",
        "format",
        "join",
        "trigsimp",
        "factor",
        "applyfunc",
        "xreplace",
        "rewrite",
        "coeff",
        "collect",
        "as_immutable",
        "as_mutable",
        "n",
        "row",
        "col",
        "rank",
        "trace",
        "eigenvals",
        "is_symmetric",
        "conjugate",
        "show",
        "flatten",
        "mean",
        "max",
        "min",
        "sum",
        "astype",
        "T",
        "values",
        "keys",
        "items",
        "get",
        "split",
        "strip",
        "lower",
        "has",
        "free_symbols",
        "equals",
        "multiply",
        "adjugate",
        "cofactor",
        "LUsolve",
        "solve",
        "applyfunc",
        "together",
    )
)
MUTATORS = frozenset(
    ("fill_diagonal", "put", "copyto", "place", "putmask", "put_along_axis", "shuffle", "at", "setfield", "sort")
)
"""numpy's functions that change what they are given."""
CHANGING_ARGUMENTS = frozenset(("out", "copy", "inplace", "overwrite_a", "overwrite_b", None))
MAX_OTHERS = 200


@dataclass
class Found:
    """What a statement may change.

    Attributes
    ----------
    anything
        An expression that may change any name; None without one.
    changed
        Names of matrices that calls may change, each with the call.
    walrus
        Names that := assigns.
    """

    anything: ast.expr | None = None
    changed: dict[str, ast.expr] = field(default_factory=dict)
    walrus: list[str] = field(default_factory=list)


class Effects:
    """Knows the names of one program that matter for what its calls do.

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
        self._same: dict[str, set[str]] = {}

    def alias(self, name: str, others: Iterable[str]) -> None:
        """Note that a name may be the same list or matrix as others, or a part of them."""
        for other in others:
            if other != name:
                self._same.setdefault(name, set()).add(other)
                self._same.setdefault(other, set()).add(name)

    def others(self, name: str) -> list[str]:
        """Return names that may be the same list or matrix."""
        found, waiting = {name}, [name]
        while waiting and len(found) <= MAX_OTHERS:
            for other in self._same.get(waiting.pop(), ()):
                if other not in found:
                    found.add(other)
                    waiting.append(other)
        return sorted(found - {name})

    def of(self, statement: ast.stmt) -> Found:
        """Return what a statement may change besides what it assigns; functions' bodies are asked for themselves."""
        found = Found()
        for node in _inside(statement):
            if isinstance(node, ast.comprehension):
                self._alias_targets(node.target, node.iter)
            if isinstance(node, ast.NamedExpr):
                self._alias_targets(node.target, node.value)
                found.walrus += [x.id for x in ast.walk(node.target) if isinstance(x, ast.Name)]
            name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
            if isinstance(node, ast.expr) and name and self._may_be_anything(node, name):
                found.anything = found.anything or node
            if isinstance(node, ast.Call):
                for changed in self._changed(node):
                    found.changed.setdefault(changed, node)
                    for other in self.others(changed):
                        found.changed.setdefault(other, node)
        return found

    def _alias_targets(self, target: ast.expr, value: ast.expr) -> None:
        others = {x.id for x in ast.walk(value) if isinstance(x, ast.Name)} - self.modules
        for name in (x.id for x in ast.walk(target) if isinstance(x, ast.Name)):
            self.alias(name, others)

    def of_block(self, statement: ast.stmt) -> list[str]:
        """Return names whose matrices a block may change by assigning parts of them, under any name.

        Names that the block binds may from then on be the same matrices as names that it reads.
        """
        bound = bound_names([statement])
        read = {x.id for x in ast.walk(statement) if isinstance(x, ast.Name)} - self.modules
        for name in bound:
            self.alias(name, read)
        changed = part_names(statement)
        return sorted({*changed, *(other for name in changed for other in self.others(name))})

    def of_class(self, statement: ast.ClassDef) -> list[str]:
        """Return names of the program whose matrices the body of a class, or one of its methods, may change."""
        found: list[str] = []
        for inner in statement.body:
            if not isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef):
                found += self.of_block(inner)
                continue
            arguments = {x.arg for x in ast.walk(inner.args) if isinstance(x, ast.arg)}
            read = {x.id for x in ast.walk(inner) if isinstance(x, ast.Name)} - self.modules - arguments
            changed = part_names(inner)
            if any(name not in arguments for name in changed):
                found += sorted(read)
        return found

    @staticmethod
    def _may_be_anything(node: ast.expr, name: str) -> bool:
        is_dunder = name.startswith("__") and name.endswith("__") and name not in HARMLESS_DUNDER
        if isinstance(node, ast.Name):
            return is_dunder or name in ANYTHING
        return is_dunder or name in FRAMES

    def _changed(self, call: ast.Call) -> Iterator[str]:
        """Yield names of what a call may change."""
        function = call.func
        argument_names = [x.id for argument in self._arguments(call) for x in _outer_names(argument)]
        keywords = {keyword.arg for keyword in call.keywords}
        match function:
            case ast.Name(name):
                has_function = any(isinstance(x, ast.Lambda) for a in self._arguments(call) for x in ast.walk(a))
                if has_function:
                    yield from argument_names
                    return
                if name in HARMLESS and (name not in self.own or name in self.imported) and "out" not in keywords:
                    return
                if name in self.imported and name not in MUTATORS and not keywords & CHANGING_ARGUMENTS:
                    return
                yield name
                yield from argument_names
            case ast.Attribute(ast.Name(base), method) if base in self.modules:
                if method in MUTATORS or keywords & CHANGING_ARGUMENTS:
                    yield from argument_names
            case ast.Attribute(ast.Name(base), method):
                if method in PURE_METHODS and not keywords & {"out", "inplace"}:
                    return
                yield base
                yield from argument_names
            case ast.Attribute(value, method):
                if method in PURE_METHODS and not keywords & {"out", "inplace"}:
                    return
                yield from (x.id for x in ast.walk(value) if isinstance(x, ast.Name) and x.id not in self.modules)
                yield from argument_names
            case _:
                yield from argument_names
                yield from (x.id for x in ast.walk(function) if isinstance(x, ast.Name))

    @staticmethod
    def _arguments(call: ast.Call) -> list[ast.expr]:
        return [*call.args, *(keyword.value for keyword in call.keywords)]

    def parts(self, value: ast.expr) -> set[str]:
        """Return names of lists and matrices that a value may be, or share entries with."""
        match value:
            case ast.Name(name):
                return {name}
            case ast.Attribute(inner) | ast.Subscript(inner) | ast.Starred(inner) | ast.NamedExpr(_, inner):
                return self.parts(inner)
            case ast.List(elements) | ast.Tuple(elements) | ast.Set(elements):
                return {name for element in elements for name in self.parts(element)}
            case ast.IfExp(_, body, other):
                return self.parts(body) | self.parts(other)
            case ast.BoolOp(_, values):
                return {name for inner in values for name in self.parts(inner)}
            case ast.Dict() | ast.ListComp() | ast.GeneratorExp() | ast.SetComp() | ast.DictComp() | ast.Lambda():
                return {x.id for x in ast.walk(value) if isinstance(x, ast.Name)}
            case ast.Call(function):
                name = function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")
                is_own = name in self.own and name not in self.imported and not isinstance(function, ast.Attribute)
                keywords = {keyword.arg for keyword in value.keywords}
                if name in COPIES and not is_own and not keywords & CHANGING_ARGUMENTS:
                    return set()
                names = {name for argument in self._arguments(value) for name in self.parts(argument)}
                if isinstance(function, ast.Attribute):
                    return names | (self.parts(function.value) - self.modules)
                return names | ({name} if name and is_own else set())
        return set()


def bound_names(statements: Sequence[ast.stmt]) -> list[str]:
    """Return all names that statements bind or delete, or whose parts they assign, however deep."""
    found: dict[str, None] = {}
    waiting: list[ast.AST] = list(statements)
    while waiting:
        node = waiting.pop()
        match node:
            case ast.Name(name, ast.Store() | ast.Del()):
                found[name] = None
            case ast.Subscript(value, _, ast.Store() | ast.Del()) | ast.Attribute(value, _, ast.Store() | ast.Del()):
                while isinstance(value, ast.Subscript | ast.Attribute | ast.Call):
                    value = value.func if isinstance(value, ast.Call) else value.value
                if isinstance(value, ast.Name):
                    found[value.id] = None
            case ast.FunctionDef(name) | ast.AsyncFunctionDef(name) | ast.ClassDef(name):
                found[name] = None
            case ast.alias(name, other):
                found[other or name.split(".")[0]] = None
            case ast.ExceptHandler(_, name) | ast.MatchAs(_, name) | ast.MatchStar(name):
                if name:
                    found[name] = None
            case ast.MatchMapping(rest=rest):
                if rest:
                    found[rest] = None
            case ast.Global(names) | ast.Nonlocal(names):
                found.update(dict.fromkeys(names))
        waiting += ast.iter_child_nodes(node)
    return list(found)


def part_names(statement: ast.AST) -> list[str]:
    """Return names of which parts are assigned or deleted, or that are changed in place, however deep."""
    found: dict[str, None] = {}
    for node in ast.walk(statement):
        is_part = isinstance(node, ast.Subscript | ast.Attribute) and isinstance(node.ctx, ast.Store | ast.Del)
        target = node if is_part else node.target if isinstance(node, ast.AugAssign) else None
        while isinstance(target, ast.Subscript | ast.Attribute | ast.Call):
            target = target.func if isinstance(target, ast.Call) else target.value
        if isinstance(target, ast.Name):
            found[target.id] = None
    return list(found)


def _inside(statement: ast.stmt) -> Iterator[ast.AST]:
    """Yield a statement's nodes; of a function or a class its own header alone, of other blocks everything."""
    waiting: list[ast.AST] = [statement]
    while waiting:
        node = waiting.pop()
        yield node
        if isinstance(node, ast.FunctionDef) and node is statement:
            waiting += [*node.decorator_list, *node.args.defaults, *(d for d in node.args.kw_defaults if d is not None)]
            continue
        waiting += ast.iter_child_nodes(node)


def _outer_names(node: ast.expr) -> Iterator[ast.Name]:
    """Yield names in an argument: those whose value it may be, or hold."""
    return (x for x in ast.walk(node) if isinstance(x, ast.Name))
