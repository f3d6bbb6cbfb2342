"""Execute a Python file, and answer what its names are and what its functions return, as text.

This file is executed by its path in a process of its own, and imports nothing of dhkit. Requests are lines of JSON on
descriptor 3, answers lines of JSON on descriptor 4. What is answered is text that dhkit reads like any answer: a file
which changes sympy, numpy or this program only changes its own answer.

The first answer is ``{"functions": [...], "names": {name: line}}``, or ``{"error": text, "line": number}`` where the
file failed. Each request has an ``id``, which its answer repeats; blank lines are skipped. Requests and their answers
are

- ``{"value": name}``: the value of a name, ``{"tree": value, "definitions": {name: text}}``;
- ``{"call": name, "arguments": {...}, "as": kind, "locals": [name, ...]}``: a function's result for symbols, and the
  local names asked for, ``{"tree": value, "locals": {name: value}, "definitions": {...}}``. Arguments are names of
  symbols, lists of them, or objects of them, made as sympy symbols in arrays of numpy's ("numpy") or in matrices
  ("sympy"), or as CasADi's ("casadi");
- ``{"call": name, "samples": [{...}, ...], "local": name}``: its result for numbers, or, where ``local`` is not empty,
  the local variable of this name; ``{"values": [...]}``: numbers, null where they are not finite.

Symbolic values are text, lists of it, or objects ``{"fields": {...}}``; ``{"error": text}`` stands for a value that is
not an answer. ``{"imported": ["dhkit"]}`` is a line of its own, which may come at any time. Arguments are passed by
position, in the order of the object. The process's ``math``, ``numpy``, ``sympy`` and ``casadi`` are changed so that
they calculate with symbols.

Arguments: the folder of the packages that the file may import, empty where it may import all; the file.
"""

from __future__ import annotations

import ast
import builtins
import contextlib
import inspect
import json
import math
import numbers
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from types import CodeType, SimpleNamespace
from typing import Any

REQUESTS = 3
ANSWERS = 4
MAX_NAMES = 2_000
MAX_NODES = 20_000
"""Largest number of nodes of an expression: a PUMA's inverse dynamics in CasADi has 1,100."""
MAX_CHARACTERS = 1_000_000
"""Largest length of a value's text, in characters."""
MAX_ENTRIES = 10_000
MAX_BITS = 4_000
"""Largest number of bits of a whole number, about 1,200 decimal digits."""
DIGITS = 15
"""Digits to which doubles are written: a decimal number of 15 digits comes back from a double unchanged. It rounds by
up to 5e-15, relatively, so that 0.1 + 0.2 is read as 0.3."""
ELEMENTARY = "sin cos tan sinh cosh tanh sqrt exp log"
INVERSES = {"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2"}
"""numpy's names of sympy's functions."""
KNOWN = frozenset((*ELEMENTARY.split(), *INVERSES.values(), "pi"))
"""Names that are sympy's where a file does not define them."""


def main(packages: str, path: str) -> None:
    """Execute the file, and answer requests until they end."""
    if packages:
        sys.path.append(packages)
    sys.addaudithook(import_hook())
    requests = os.fdopen(REQUESTS, "rb")
    answers = os.fdopen(ANSWERS, "wb", 0)

    def write(message: Mapping[str, object]) -> None:
        answers.write(json.dumps(message).encode() + b"\n")

    name = os.path.basename(path)  # noqa: PTH119
    symbolic = Symbolic()
    try:
        with open(path, "rb") as file:  # noqa: PTH123
            source = file.read()
        code = compile(source, name, "exec")
        lines = assigned_lines(source)
        symbolic.install()
        if b"casadi" in source:  # importing CasADi takes time
            number_symbols_from_one()
        namespace = Namespace(symbolic)
        namespace |= {"__name__": "__main__", "__file__": name}
        with symbolic.calculating():
            exec(code, namespace)  # noqa: S102 - this process is made for it
    except BaseException as error:  # SystemExit and KeyboardInterrupt of the file too
        write(error_fields(error, name))
        return
    program = ExecutedFile(namespace, name, symbolic)
    write({"functions": program.functions(), "names": program.names(lines)})
    for line in requests:
        if not line.strip():  # empty lines stand between requests, for Octave
            continue
        request = json.loads(line)
        answer: dict[str, object] = {"id": request["id"]}
        try:
            answer |= program.answer(request)
        except BaseException as error:
            answer |= error_fields(error, name)
        write(answer)


def import_hook() -> Callable[[str, tuple[Any, ...]], None]:
    """Return an audit hook that says when dhkit is imported: a hint for readers of the report, and no defence."""
    write = os.write
    said = list[str]()

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "import" and not said and str(arguments[0]).partition(".")[0] == "dhkit":
            said.append("dhkit")
            write(ANSWERS, b'{"imported": ["dhkit"]}\n')

    return hook


def error_fields(error: BaseException, file: str) -> dict[str, object]:
    """Return the text of an exception, and the last line of the file in its traceback."""
    line = error.lineno if isinstance(error, SyntaxError) and error.filename == file else None
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename == file:
            line = frame.lineno
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    return {"error": f"{type(error).__name__}: {text}"[:500].rstrip(": "), "line": line}


def assigned_lines(source: bytes) -> dict[str, int]:
    """Return the line of the last assignment of each name outside functions and classes."""
    lines: dict[str, int] = {}
    waiting: list[ast.AST] = [ast.parse(source)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            lines[node.id] = max(node.lineno, lines.get(node.id, 0))
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda | ast.ClassDef):
            waiting += ast.iter_child_nodes(node)
    return lines


# Symbols instead of numbers


class Symbolic:
    """Symbols for names that a file does not define, and functions of numpy and math that take symbols."""

    def __init__(self) -> None:
        self.is_on = False
        self.sympy: Any = None
        self.numpy: Any = None
        with contextlib.suppress(ImportError):
            import sympy

            self.sympy = sympy
        with contextlib.suppress(ImportError):
            import numpy as np

            self.numpy = np

    @contextlib.contextmanager
    def calculating(self) -> Iterator[None]:
        """Within this context numpy.zeros and its like return arrays of objects, which hold symbols."""
        before = self.is_on
        self.is_on = True
        try:
            yield
        finally:
            self.is_on = before

    def install(self) -> None:
        """Let functions of numpy and math take symbols, and numpy's zeros hold them.

        numpy calls the method ``cos`` of what it cannot calculate with; math would ask for a float.
        """
        if self.sympy is None:
            return
        names = {name: name for name in ELEMENTARY.split()} | INVERSES
        for name, own in names.items():
            self._add_method(name, getattr(self.sympy, own))
            # math has asin, as sympy has, and not arcsin.
            for math_name in {name, own} & set(dir(math)):
                setattr(
                    math,
                    math_name,
                    self._of_symbols(getattr(math, math_name), getattr(self.sympy, own)),
                )
        self._add_method("deg2rad", self.sympy.rad)
        self._add_method("rad2deg", self.sympy.deg)
        for name in ("zeros", "ones", "eye", "identity", "empty") if self.numpy is not None else ():
            setattr(self.numpy, name, self._holding_symbols(getattr(self.numpy, name)))

    def _add_method(self, name: str, function: Callable[..., Any]) -> None:
        if not hasattr(self.sympy.Expr, name):
            setattr(self.sympy.Expr, name, lambda self, *others: function(self, *others))

    def _of_symbols(
        self, of_numbers: Callable[..., Any], function: Callable[..., Any]
    ) -> Callable[..., Any]:
        Basic = self.sympy.Basic

        def either(*arguments: Any) -> Any:
            return (function if any(isinstance(x, Basic) for x in arguments) else of_numbers)(
                *arguments
            )

        return either

    def _holding_symbols(self, make: Callable[..., Any]) -> Callable[..., Any]:
        def made(*arguments: Any, **keywords: Any) -> Any:
            array = make(*arguments, **keywords)
            # eye has the type as its fourth argument, the others as their second.
            has_type = "dtype" in keywords or len(arguments) > (3 if make.__name__ == "eye" else 1)
            if not self.is_on or has_type or array.dtype.kind != "f":
                return array
            if make.__name__ == "empty":
                return array.astype(object)
            # Zeros and ones as whole numbers: a double 0.0 would make 0.0*m1 of an entry.
            return array.astype(int).astype(object)

        return made


def number_symbols_from_one() -> None:
    """Let ``SX.sym("q", 2)`` have the symbols q1 and q2: CasADi calls them q_0 and q_1, and q_1 would be read as q1."""
    try:
        import casadi
    except ImportError:
        return
    of_casadi = casadi.SX.sym

    def sym(name: str, *size: Any) -> Any:
        """Return a symbol, a vector of numbered ones, or a matrix of those with two numbers."""
        # sym(name), sym(name, m), sym(name, m, n), sym(name, (m, n)) or sym(name, sparsity)
        first = size[0] if size else 1
        stated = first if isinstance(first, tuple) else size
        shape = first.shape if hasattr(first, "shape") else stated
        m, n = (*shape, 1, 1)[:2]
        if (m, n) == (1, 1) or len(shape) > 2:
            return of_casadi(name, *size)
        if 1 in (m, n):
            entries = [of_casadi(f"{name}{k + 1}") for k in range(m * n)]
            return casadi.vertcat(*entries) if n == 1 else casadi.horzcat(*entries)
        rows = []
        for i in range(1, m + 1):
            entries = [of_casadi(f"{name}_{i}_{j}") for j in range(1, n + 1)]
            rows.append(casadi.horzcat(*entries))
        return casadi.vertcat(*rows)

    casadi.SX.sym = staticmethod(sym)  # type: ignore[method-assign, assignment]


class Namespace(dict[str, Any]):
    """The names of a file; one that neither it nor Python defines is a symbol, or sympy's sine.

    Python looks up a global name with ``__missing__`` where globals are of a subclass of dict, and among its builtins
    after a KeyError.
    """

    def __init__(self, symbolic: Symbolic) -> None:
        super().__init__()
        self._symbolic = symbolic

    def __missing__(self, name: str) -> Any:
        if hasattr(builtins, name) or name.startswith("__") or self._symbolic.sympy is None:
            raise KeyError(name)
        if name in KNOWN:
            return getattr(self._symbolic.sympy, name)
        return self._symbolic.sympy.Symbol(name)


class Parameters:
    """An argument with fields and keys of any name, each the symbol of this name."""

    def __init__(self, symbol: Callable[[str], Any]) -> None:
        self._symbol = symbol

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return self._symbol(name)

    def __getitem__(self, name: str) -> Any:
        if not isinstance(name, str):
            raise TypeError("parameters have names and no numbers")
        return self._symbol(name)


# The executed file


class ExecutedFile:
    """An executed file, and the answers to requests about it."""

    def __init__(self, namespace: Namespace, file: str, symbolic: Symbolic) -> None:
        self.namespace = namespace
        self.file = file
        self.symbolic = symbolic

    def functions(self) -> list[dict[str, object]]:
        """Return the functions that the file defines, with their lines and parameters."""
        found: list[dict[str, object]] = []
        for name, value in list(self.namespace.items())[:MAX_NAMES]:
            code = getattr(value, "__code__", None)
            if code is None or not self._is_own(value):
                continue
            try:
                parameters = inspect.signature(value).parameters.values()
            except (TypeError, ValueError):
                continue
            if any(one.kind in (one.VAR_POSITIONAL, one.VAR_KEYWORD) for one in parameters):
                continue
            needed = [one.name for one in parameters if one.default is one.empty]
            line = code.co_firstlineno if code.co_filename == self.file else 0
            # Texts in the function that may be keys of a parameter: p["m1"]
            keys = [one for one in code.co_consts if isinstance(one, str) and one.isidentifier()]
            described = {"parameters": needed, "locals": list(code.co_varnames), "keys": keys}
            found.append({"name": name, "line": line, **described})
        return found

    def _is_own(self, value: Any) -> bool:
        """Whether a function is the file's, or was made by lambdify."""
        file = value.__code__.co_filename
        return bool(file == self.file or file.startswith("<lambdifygenerated"))

    def names(self, lines: Mapping[str, int]) -> dict[str, int]:
        """Return the names that the file assigns, with their lines; those that it imports are not its own."""
        return {
            name: lines[name]
            for name, value in self.namespace.items()
            if name in lines and not inspect.ismodule(value) and not callable_object(value)
        }

    def answer(self, request: Mapping[str, Any]) -> dict[str, object]:
        """Return the answer to a request."""
        if "value" in request:
            writer = Writer()
            return {
                "tree": writer.tree(self.namespace[request["value"]]),
                "definitions": writer.definitions,
            }
        function = self.namespace[request["call"]]
        if "samples" in request:
            return {
                "values": [
                    self._sampled(function, one, request["local"]) for one in request["samples"]
                ]
            }
        with self.symbolic.calculating():
            arguments = [self._symbols(x, request["as"]) for x in request["arguments"].values()]
            value, local_values = called(function, arguments)
        writer = Writer()
        wanted = request.get("locals", ())
        trees = {name: writer.tree(one) for name, one in local_values.items() if name in wanted}
        return {"tree": writer.tree(value), "locals": trees, "definitions": writer.definitions}

    def _symbols(self, names: Any, kind: str) -> Any:
        """Return an argument made of symbols."""
        if kind == "casadi":
            import casadi

            symbol: Any = casadi.SX.sym
            vector: Any = lambda entries: casadi.vertcat(*entries)  # noqa: E731
        else:
            symbol = self.symbolic.sympy.Symbol
            vector = self.symbolic.sympy.Matrix if kind == "sympy" else self.symbolic.numpy.array
        if isinstance(names, list):
            return vector([symbol(name) for name in names])
        return Parameters(symbol) if isinstance(names, dict) else symbol(names)

    def _sampled(
        self, function: Callable[..., Any], arguments: Mapping[str, Any], local: str
    ) -> object:
        """Return the numbers that a function returns, or those of one of its local names; None where not finite."""
        np = self.symbolic.numpy
        value, local_values = called(function, [self._numbers(x) for x in arguments.values()])
        sampled = local_values[local] if local else value
        array = np.asarray(sampled)
        is_real = array.dtype.kind in "fiub"
        if array.dtype.kind == "O":
            is_real = all(isinstance(x, numbers.Real) for x in array.ravel().tolist())
        if not is_real:
            raise TypeError(
                f"returned {type(sampled).__name__} of {array.dtype}; expected real numbers"
            )
        array = array.astype(float)
        return np.where(np.isfinite(array), array.astype(object), None).tolist()

    def _numbers(self, value: Any) -> Any:
        if isinstance(value, dict):
            return Values({name: self._numbers(part) for name, part in value.items()})
        return self.symbolic.numpy.array(value, dtype=float) if isinstance(value, list) else value


class Values(dict[str, Any]):
    """Numbers by name, as keys and as attributes."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(name) from None


def callable_object(value: object) -> bool:
    """Whether a value is a function or a class, as ``sympy.Function("f")`` is; sympy's symbols are callable too."""
    return inspect.isroutine(value) or inspect.isclass(value)


def called(function: Callable[..., Any], arguments: list[Any]) -> tuple[Any, dict[str, Any]]:
    """Return a function's result, and the values of its local variables when it returns."""
    code: CodeType | None = getattr(function, "__code__", None)
    local: dict[str, Any] = {}

    def note(frame: Any, event: str, _: object) -> None:
        if event == "return" and frame.f_code is code:
            local.clear()
            local.update(frame.f_locals)

    sys.setprofile(note)
    try:
        return function(*arguments), local
    finally:
        sys.setprofile(None)


# Values as text


class Writer:
    """Writes values as text, with definitions of the subexpressions that a CasADi scalar contains several times."""

    def __init__(self) -> None:
        self.definitions: dict[str, str] = {}
        self._left = MAX_CHARACTERS
        self._entries = MAX_ENTRIES

    def tree(self, value: Any) -> object:
        """Return a value as text, lists of text or fields; an error for a value that is not an answer."""
        try:
            return self._tree(value)
        except RecursionError:
            return {"error": "nested too deep"}
        except Exception as error:
            return {"error": f"{type(error).__name__}: {error}"[:300]}

    def _tree(self, value: Any) -> object:
        module = (type(value).__module__ or "").partition(".")[0]
        if module == "casadi":
            return self._casadi(value)
        if hasattr(value, "tolist") and module != "sympy":  # numpy's arrays and numbers
            value = value.tolist()
        if value is None or isinstance(value, bool | str | bytes):
            raise TypeError(f"found {type(value).__name__}; expected formulas or numbers")
        if isinstance(value, list | tuple):
            return [self._tree(entry) for entry in value]
        if isinstance(value, dict | SimpleNamespace):
            fields = value if isinstance(value, dict) else vars(value)
            return {
                "fields": {
                    name: self.tree(one) for name, one in fields.items() if isinstance(name, str)
                }
            }
        # sympy's numbers are numbers.Real too.
        if isinstance(value, numbers.Real | Fraction) and not hasattr(value, "free_symbols"):
            return self._counted(number_text(value))
        if hasattr(value, "free_symbols"):
            return self._sympy(value)
        raise TypeError(f"found {type(value).__name__}; expected formulas or numbers")

    def _counted(self, text: str) -> str:
        self._left -= len(text)
        self._entries -= 1
        if self._left < 0 or self._entries < 0:
            raise ValueError(f"more than {MAX_CHARACTERS} characters or {MAX_ENTRIES} entries")
        return text

    def _sympy(self, value: Any) -> object:
        is_formula = hasattr(value, "as_explicit")  # of matrices: A*B of MatrixSymbols
        if getattr(value, "is_Matrix", False) or is_formula:
            explicit = value.doit().as_explicit() if is_formula else value
            rows = []
            for row in explicit.tolist():
                entries = [self._sympy(entry) for entry in row]
                rows.append(entries)
            is_column = bool(rows) and len(rows[0]) == 1
            return [row[0] for row in rows] if is_column else rows
        value = value.doit()  # Derivative(V, q1) is written out; that of q1(t) stays
        import sympy

        for symbol in value.free_symbols:
            checked_name(str(symbol))
        for call in value.atoms(sympy.core.function.AppliedUndef):
            if len(call.args) != 1 or not call.args[0].is_Symbol:
                raise ValueError(f"{call} is not a joint variable as a function of time")
            checked_name(call.func.__name__)
        for count, _ in enumerate(sympy.preorder_traversal(value)):
            if count > MAX_NODES:
                raise ValueError(f"an expression of more than {MAX_NODES} nodes")
        return self._counted(sympy.sstr(value))

    def _casadi(self, value: Any) -> object:
        import casadi

        if isinstance(value, casadi.DM):
            return rows_of(
                value.shape, [self._counted(number_text(float(x))) for x in value.full().ravel("F")]
            )
        if isinstance(value, casadi.MX):
            symbols = casadi.symvar(value)
            expanded = casadi.Function("f", symbols, [value]).expand()
            value = expanded(*(casadi.SX.sym(x.name(), *x.shape) for x in symbols))
        if not isinstance(value, casadi.SX):
            raise TypeError(f"found casadi.{type(value).__name__}; expected SX, MX or DM")
        dense = casadi.densify(value)
        return rows_of(
            value.shape, [self._counted(self._casadi_text(entry)) for entry in dense.elements()]
        )

    def _casadi_text(self, root: Any) -> str:
        """Return a CasADi scalar as text; a subexpression used several times becomes a definition."""
        import casadi

        if casadi.n_nodes(root) > MAX_NODES:
            raise ValueError(f"an expression of more than {MAX_NODES} nodes")
        texts: dict[int, str] = {}
        uses = used_counts(root)
        waiting = [root]
        while waiting:
            node = waiting[-1]
            key = node.element_hash()  # address of the node, which expressions share
            inside = [node.dep(k) for k in range(node.n_dep())]
            missing = [one for one in inside if one.element_hash() not in texts]
            if missing and key not in texts:
                waiting += missing
                continue
            waiting.pop()
            if key in texts:
                continue
            text = casadi_operation(node, [texts[one.element_hash()] for one in inside])
            if inside and uses.get(key, 0) > 1:
                name = f"casadi{len(self.definitions) + 1}"
                self.definitions[name] = self._counted(text)
                text = name
            texts[key] = text
        return texts[root.element_hash()]


def used_counts(root: Any) -> dict[int, int]:
    """Return how often each node of a CasADi expression occurs as an operand: x of x*x twice."""
    counts: dict[int, int] = {}
    waiting = [root]
    seen = set[int]()
    while waiting:
        node = waiting.pop()
        if node.element_hash() in seen:
            continue
        seen.add(node.element_hash())
        for k in range(node.n_dep()):
            one = node.dep(k)
            counts[one.element_hash()] = counts.get(one.element_hash(), 0) + 1
            waiting.append(one)
    return counts


def casadi_operation(node: Any, arguments: list[str]) -> str:
    """Return an operation of CasADi's, with the text of its operands; negative numbers are in brackets."""
    import casadi

    if node.is_symbolic():
        return checked_name(str(node.name()))
    if node.is_constant():
        text = number_text(float(node))
        return f"({text})" if text.startswith("-") else text
    forms = {
        casadi.OP_ADD: "({}+{})",
        casadi.OP_SUB: "({}-{})",
        casadi.OP_MUL: "({}*{})",
        casadi.OP_DIV: "({}/{})",
        casadi.OP_NEG: "(-{})",
        casadi.OP_SQ: "({}**2)",
        casadi.OP_TWICE: "(2*{})",
        casadi.OP_INV: "(1/{})",
        casadi.OP_POW: "({}**{})",
        casadi.OP_CONSTPOW: "({}**{})",
        casadi.OP_SQRT: "sqrt({})",
        casadi.OP_SIN: "sin({})",
        casadi.OP_COS: "cos({})",
        casadi.OP_TAN: "tan({})",
        casadi.OP_ASIN: "asin({})",
        casadi.OP_ACOS: "acos({})",
        casadi.OP_ATAN: "atan({})",
        casadi.OP_ATAN2: "atan2({}, {})",
        casadi.OP_EXP: "exp({})",
        casadi.OP_LOG: "log({})",
        casadi.OP_FABS: "abs({})",
        casadi.OP_SIGN: "sign({})",
        casadi.OP_FMIN: "min({}, {})",
        casadi.OP_FMAX: "max({}, {})",
    }
    form = forms.get(node.op())
    if form is None:
        raise TypeError(f"CasADi's operation {node.op()} is not read")
    return form.format(*arguments)


def checked_name(name: str) -> str:
    """Return the name of a symbol, which must not read as a formula."""
    if re.fullmatch(r"[\w\\{}']+", name) is None:
        raise ValueError(f"a symbol called {name[:40]!r}; expected a name")
    return name


def rows_of(shape: tuple[int, int], entries: list[str]) -> object:
    """Return entries by columns as rows; one entry as itself, and a column as a list."""
    m, n = shape
    if (m, n) == (1, 1):
        return entries[0]
    if n == 1:
        return entries
    return [entries[i::m] for i in range(m)]


def number_text(value: Any) -> str:
    """Return a number as text; doubles are rounded to DIGITS."""
    if isinstance(value, int | Fraction):
        if max(abs(value.numerator), value.denominator).bit_length() > MAX_BITS:
            raise ValueError("a number of more than 1,200 digits")
        return str(value)
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{number} is not a number")
    return f"{number:.{DIGITS}g}"


if __name__ == "__main__":
    main(*sys.argv[1:])
