"""Right-hand sides of Python that are no formulas: symbols, functions of libraries, structures, the name itself."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping

from dhkit.grading.answers.programs.bindings import Scope, Use
from dhkit.grading.answers.programs.python_effects import SideEffectAnalysis
from dhkit.grading.answers.programs.python_formulas import EXACT, PythonFormulas
from dhkit.grading.answers.programs.python_text import ascii_name
from dhkit.grading.answers.tokens import rate_name, word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, plain_name

MAX_SYMBOLS = 1_000
"""Largest index in symbols('q1:4')."""

SYMBOL_CALLS = frozenset(("symbols", "Symbol", "dynamicsymbols", "var", "Dummy"))

VECTORS = word_set("asarray array ravel squeeze flatten list tuple Matrix atleast_1d asanyarray")
"""Functions that turn a vector into the same vector."""


class PythonValues:
    """Tells what right-hand sides of one program are besides formulas.

    Parameters
    ----------
    analysis
        Which names the program binds and imports.
    formulas
        The reader of the program's formulas.

    Attributes
    ----------
    structures
        Fields of the program's structures and classes, by name.
    """

    def __init__(self, analysis: SideEffectAnalysis, formulas: PythonFormulas) -> None:
        self.analysis = analysis
        self.formulas = formulas
        self.structures: dict[str, Mapping[str, ast.expr]] = {}

    def library_function(self, value: ast.expr) -> str:
        """Return the name of the library's function that a value is; empty of another value."""
        match value:
            case ast.Name(name) if not self.analysis.is_redefined(name):
                function = str(name)
            case ast.Attribute(ast.Name(module), name) if module in self.analysis.modules:
                function = str(name)
            case _:
                return ""
        return function if function in FUNCTION_NAMES and len(function) > 1 and function not in EXACT else ""

    def is_unchanged(self, name: str, value: ast.expr) -> bool:
        """Whether a value is the name itself, simplified, or as an array."""
        formula = self.formulas.formula(value)
        inner = value
        while True:
            match inner:
                case ast.Call(ast.Attribute(vector, "flatten" | "ravel" | "squeeze" | "copy"), []):
                    inner = vector
                case ast.Call(ast.Name(function), [vector]) if self._is_vector_function(function):
                    inner = vector
                case ast.Call(ast.Attribute(ast.Name(module), function), [vector]) if (
                    module in self.analysis.modules and self._is_vector_function(function)
                ):
                    inner = vector
                case _:
                    break
        if isinstance(inner, ast.Name) and ascii_name(inner.id) == ascii_name(name):
            return True
        reads = [read for read in formula.reads if read.use is Use.VALUE]
        return formula.text == name and len(reads) == 1 and not formula.problem and formula.entries is None

    def _is_vector_function(self, name: str) -> bool:
        return name in VECTORS and not self.analysis.is_redefined(name)

    def local_name(self, value: ast.expr, scope: Scope) -> str:
        """Return the local name that a value is, as it is or as an array; empty of another value."""
        modules = self.analysis.modules
        while True:
            match value:
                case ast.Name(name):
                    return ascii_name(name) if ascii_name(name) in scope.bindings else ""
                case ast.Subscript(inner, ast.Tuple([])):
                    value = inner
                case ast.Call(ast.Name(function), [inner]) if function in VECTORS and not value.keywords:
                    value = inner
                case ast.Call(ast.Attribute(ast.Name(module), function), [inner]) if module in modules and (
                    function in VECTORS or function == "simplify"
                ):
                    value = inner
                case ast.Call(ast.Attribute(inner, "flatten" | "ravel" | "squeeze" | "copy" | "simplify"), []) if (
                    not isinstance(inner, ast.Name) or inner.id not in modules
                ):
                    value = inner
                case ast.Call(ast.Name("simplify"), [inner]) if not self.analysis.is_redefined("simplify"):
                    value = inner
                case _:
                    return ""

    # Symbols

    def symbols(self, value: ast.expr) -> list[str] | None:
        """Return the names of symbols('q1 q2'), Symbol('m1'), Function('q1')(t) and dynamicsymbols('q1', 1)."""
        match value:
            case ast.Call(ast.Call() as function, [ast.Name("t")], []):
                return self._symbol_names(function, frozenset(("Function",)))
            case ast.Call(ast.Call()):
                return None
            case ast.Call(function, [_, *arguments]):
                names = self._symbol_names(value, SYMBOL_CALLS)
            case _:
                return None
        if names is None or not arguments:
            return names
        called = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
        match arguments:
            case [ast.Constant(int(order))] if called == "dynamicsymbols" and order in (0, 1, 2):
                marks = ("dot", "ddot")[order - 1]
                return [rate_name(plain_name(name), marks) for name in names] if order else names
        return None

    def _symbol_names(self, call: ast.Call, functions: frozenset[str]) -> list[str] | None:
        match call:
            case ast.Call(ast.Name(name), [ast.Constant(str(text)), *_]) if name in functions:
                if self.analysis.is_redefined(name):
                    return None
            case ast.Call(ast.Attribute(base, name), [ast.Constant(str(text)), *_]) if name in functions:
                while isinstance(base, ast.Attribute):
                    base = base.value
                if not isinstance(base, ast.Name) or base.id not in self.analysis.modules:
                    return None
            case _:
                return None
        names: list[str] = []
        for piece in re.split(r"[\s,]+", text.strip().strip(",")):
            span = re.fullmatch(r"(\w*?)\(?(\d*):(\d+)\)?", piece)
            if span and int(span[3][:6]) <= MAX_SYMBOLS:
                names += [f"{span[1]}{k}" for k in range(int(span[2] or 0), int(span[3]))]
            else:
                names.append(piece)
        return names if names and all(re.fullmatch(r"[\w\\{}]+", name) for name in names) else None

    # Structures

    def fields(self, value: ast.expr) -> Mapping[str, ast.expr]:
        """Return the fields of a structure: a dictionary, an object of a class of the file, or a name of one."""
        match value:
            case ast.Name(name):
                return self.structures.get(name, {})
            case ast.Dict(keys, values) if all(isinstance(k, ast.Constant) for k in keys):
                return {str(k.value): v for k, v in zip(keys, values, strict=True) if isinstance(k, ast.Constant)}
            case ast.Call(ast.Name(name), [], keywords) if (
                name in self.structures or name in ("dict", "SimpleNamespace")
            ) and all(keyword.arg for keyword in keywords):
                return {**self.structures.get(name, {}), **{str(keyword.arg): keyword.value for keyword in keywords}}
        return {}


def class_fields(statement: ast.ClassDef) -> dict[str, ast.expr]:
    """Return what the body of a class assigns, as the fields of its objects; nothing where it has methods."""
    fields: dict[str, ast.expr] = {}
    for inner in statement.body:
        match inner:
            case ast.AnnAssign(ast.Name(name), _, ast.expr() as value) | ast.Assign([ast.Name(name)], value):
                if name in fields:
                    return {}
                fields[name] = value
            case ast.Expr(ast.Constant()) | ast.Pass():
                pass
            case _:
                return {}
    return fields
