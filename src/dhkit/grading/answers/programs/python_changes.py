"""What a piece of a Python program may change, beyond the plain assignments that are read."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator

from dhkit.grading.answers.programs.library import UNCHANGED
from dhkit.grading.answers.tokens import word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

UNBOUNDED = word_set(
    """
    exec eval compile globals locals vars setattr delattr getattr execfile run_line_magic import_module
    get_ipython run_cell_magic run_path run_module modules builtins inspect gc f_globals f_locals f_back user_ns
    """
)
"""Names and attributes with which a program may change any name of its own."""

HARMLESS_DUNDER = frozenset(("__name__", "__file__", "__doc__", "__version__", "__all__", "__init__"))

PURE = (
    frozenset(FUNCTION_NAMES)
    | UNCHANGED
    | word_set(
        """
    print display pprint len range str repr float int round abs sum list tuple zip enumerate type isinstance
    latex init_printing init_session init_vprinting mprint vprint vlatex lambdify symbols Symbol dynamicsymbols var
    Function diff Derivative solve zeros eye ones diag Eq Math set Markdown Latex dict sorted all any super format
    Exception ValueError N time perf_counter pretty_print pretty Matrix ImmutableMatrix array matrix asarray DM SX
    broadcast_arrays dot matmul transpose cross det inv linspace arange vstack hstack column_stack block_diag figure
    plot subplots show legend xlabel ylabel title grid savefig clip deg2rad rad2deg allclose isclose random seed
    solve_ivp odeint
    """
    )
)
"""Functions, of a library or of Python, that change nothing that they are given."""

PURE_METHODS = PURE | word_set(
    """
    subs evalf T norm tolist join xreplace rewrite coeff as_immutable as_mutable n row col rank trace jacobian
    eigenvals is_symmetric conjugate flatten ravel squeeze mean max min astype values keys items get split strip lower
    has free_symbols equals multiply adjugate cofactor LUsolve together dot cross reshape inv det transpose
    """
)
"""Methods that change neither their object nor their arguments."""

MAKING = word_set("Matrix array symbols print lambdify zeros eye ones")
"""Functions whose result shares no entry with their arguments."""

CHANGING_KEYWORDS = frozenset(("out", "copy", "inplace", "overwrite_a", "overwrite_b", None))
"""Keywords with which a function may change its arguments; None is the keyword of ``**options``."""


def is_unbounded(node: ast.AST) -> bool:
    """Whether a name or an attribute may change any name of the program."""
    match node:
        case ast.Name(name) | ast.Attribute(_, name):
            is_dunder = name.startswith("__") and name.endswith("__") and name not in HARMLESS_DUNDER
            return is_dunder or name in UNBOUNDED
        case ast.alias(name):
            return name.split(".")[0] in UNBOUNDED
    return False


def names_in(node: ast.AST) -> list[str]:
    """Return the names in a piece of a program."""
    return [x.id for x in ast.walk(node) if isinstance(x, ast.Name)]


def assigned_names(node: ast.AST) -> Iterator[str]:
    """Yield all names that a piece of a program binds or deletes, or whose parts it assigns, however deep."""
    for inner in ast.walk(node):
        match inner:
            case ast.Name(name, ast.Store() | ast.Del()):
                yield name
            case ast.Subscript(_, _, ast.Store() | ast.Del()) | ast.Attribute(_, _, ast.Store() | ast.Del()):
                yield from root_name(inner)
            case ast.AugAssign(target):
                yield from root_name(target)
            case ast.FunctionDef(name) | ast.AsyncFunctionDef(name) | ast.ClassDef(name):
                yield name
            case ast.alias(name, other):
                yield other or name.split(".")[0]
            case ast.ExceptHandler(_, str(name)) | ast.MatchAs(_, str(name)) | ast.MatchStar(str(name)):
                yield name
            case ast.MatchMapping(rest=str(name)):
                yield name
            case ast.Global(several) | ast.Nonlocal(several):
                yield from several


def changed_parts(node: ast.AST) -> Iterator[str]:
    """Yield names of which parts are assigned or deleted, or that are changed in place, however deep."""
    for inner in ast.walk(node):
        match inner:
            case ast.Subscript(_, _, ast.Store() | ast.Del()) | ast.Attribute(_, _, ast.Store() | ast.Del()):
                yield from root_name(inner)
            case ast.AugAssign(target):
                yield from root_name(target)


def root_name(target: ast.AST) -> Iterator[str]:
    """Yield the name whose part a target is: M for M[0].T."""
    while isinstance(target, ast.Subscript | ast.Attribute | ast.Call):
        target = target.func if isinstance(target, ast.Call) else target.value
    if isinstance(target, ast.Name):
        yield target.id


def changed_by_calls(node: ast.AST, is_pure: Callable[[str], bool], is_module: Callable[[str], bool]) -> Iterator[str]:
    """Yield names whose matrices the calls in a piece of a program may change.

    Parameters
    ----------
    node
        The piece of the program.
    is_pure
        Whether a function, by its name in the program, changes nothing that it is given.
    is_module
        Whether a name is that of a module.
    """
    for call in ast.walk(node):
        if not isinstance(call, ast.Call):
            continue
        keywords = {keyword.arg for keyword in call.keywords}
        arguments = [*call.args, *(keyword.value for keyword in call.keywords)]
        has_function = any(isinstance(x, ast.Lambda) for argument in arguments for x in ast.walk(argument))
        match call.func:
            case ast.Name(name) if is_pure(name) and not (keywords & {"out"} or has_function):
                continue
            case ast.Call(ast.Name("Function") | ast.Attribute(_, "Function")):
                continue
            case ast.Attribute(ast.Name(base), method) if is_module(base):
                if method in PURE and not keywords & {"out", "inplace"} and not has_function:
                    continue
            case ast.Attribute(value, method):
                if method in PURE_METHODS and not keywords & {"out", "inplace"} and not has_function:
                    continue
                yield from names_in(value)
            case function:
                yield from names_in(function)
        for argument in arguments:
            yield from names_in(argument)


def shared_names(value: ast.expr) -> set[str]:
    """Return names of lists and matrices that a value may be, or share entries with.

    A calculation makes a matrix of its own; everything else may hand on what it was given.
    """
    match value:
        case ast.BinOp() | ast.UnaryOp() | ast.Compare() | ast.Constant() | ast.JoinedStr():
            return set()
        case ast.Call(ast.Name(name) | ast.Attribute(_, name)) if name in MAKING:
            return set()
        case ast.Name(name):
            return {name}
        case ast.Attribute(inner) | ast.Subscript(inner) | ast.Starred(inner):
            return shared_names(inner)
        case ast.Call(function, arguments, keywords):
            shared = set().union(*map(shared_names, arguments), *(shared_names(k.value) for k in keywords))
            shared |= {function.id} if isinstance(function, ast.Name) else set()
            return shared | (shared_names(function.value) if isinstance(function, ast.Attribute) else set())
        case ast.List(parts) | ast.Tuple(parts):
            return set().union(*map(shared_names, parts))
    return set(names_in(value))
