"""Right-hand sides of Python: formulas and matrices as typed, and the names that they read."""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

from dhkit.grading.answers.programs.bindings import (
    MAX_ENTRIES,
    MAX_INDEX,
    PLAIN_NUMBER,
    Formula,
    Index,
    Read,
    Use,
    join_formulas,
)
from dhkit.grading.answers.programs.python_text import PythonText, ascii_name
from dhkit.grading.answers.rewriting import MODULES
from dhkit.grading.answers.tokens import word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

UNCHANGED = word_set("simplify expand trigsimp factor cancel together powsimp expand_trig radsimp collect")
"""sympy's functions and methods that write an expression in another way."""

UNCHANGED_METHODS = UNCHANGED | {"doit", "applyfunc", "copy", "as_immutable", "as_mutable"}

MATRIX_CALLS = word_set("Matrix ImmutableMatrix MutableDenseMatrix ImmutableDenseMatrix array matrix asarray DM SX")
"""Functions that make a matrix of lists of rows."""

EXACT = frozenset(("Integer", "Rational", "int", "round", "floor", "ceil", "trunc"))
"""Functions that make another number of a quotient of floating-point numbers: Integer(1/3) is 0."""

ZEROS = frozenset(("zeros", "zeros_like"))

OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)


def constant_index(node: ast.expr) -> Index | None:
    """Return the numbers of an index; ``[..., 0, 1]`` counts behind leading axes. None of any other index."""
    parts = node.elts if isinstance(node, ast.Tuple) else [node]
    if parts and isinstance(parts[0], ast.Constant) and parts[0].value is Ellipsis:
        parts = parts[1:]
    numbers = [part.value if isinstance(part, ast.Constant) else None for part in parts]
    index = tuple(k for k in numbers if type(k) is int and 0 <= k <= MAX_INDEX)
    return index if len(index) == len(parts) else None


def has_starred(nodes: Sequence[ast.expr]) -> bool:
    """Whether a ``*`` unpacks one of several expressions."""
    return any(isinstance(node, ast.Starred) for node in nodes)


class PythonFormulas:
    r"""Reads expressions of one program's text.

    Parameters
    ----------
    text
        The program, with ``\n`` alone between lines.
    """

    def __init__(self, text: str) -> None:
        self.source = PythonText(text)

    def formula(self, node: ast.expr) -> Formula:
        """Return an expression as a formula, a matrix, or why it cannot be read."""
        inner, wrapper_reads = _unwrap(node)
        return (self._matrix(inner) or self._scalar(inner)).after_reads(wrapper_reads)

    def _scalar(self, node: ast.expr) -> Formula:
        return _ScalarReader(self.source, node).formula()

    def _matrix(self, node: ast.expr) -> Formula | None:
        """Return a matrix or a vector in brackets, perhaps with a factor; None where there is none."""
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            return self._scaled_matrix(node)
        called = _called(node)
        rows: ast.expr | None = node
        if called in ZEROS:
            return Formula(self.source.segment(node), tuple(_function_reads(node)), is_zeros=True)
        if called in MATRIX_CALLS and isinstance(node, ast.Call):
            if any(keyword.arg != "dtype" for keyword in node.keywords) or has_starred(node.args):
                return None
            rows = node.args[0] if len(node.args) == 1 else _reshape(node.args)
        entries = self._entries(rows) if isinstance(rows, ast.List | ast.Tuple) else None
        return _matrix_of(entries).after_reads(_function_reads(node)) if entries else None

    def _entries(self, rows: ast.List | ast.Tuple) -> dict[Index, Formula] | None:
        """Return the entries of a list, or of a list of lists, by index from 0."""
        is_nested = [isinstance(row, ast.List | ast.Tuple) for row in rows.elts]
        if has_starred(rows.elts) or len(rows.elts) > MAX_ENTRIES or (any(is_nested) and not all(is_nested)):
            return None
        entries: dict[Index, Formula] = {}
        for i, row in enumerate(rows.elts):
            if not isinstance(row, ast.List | ast.Tuple):
                entries[(i,)] = self._scalar_entry(row)
                continue
            if not row.elts or has_starred(row.elts) or any(isinstance(x, ast.List | ast.Tuple) for x in row.elts):
                return None
            entries |= {(i, j): self._scalar_entry(element) for j, element in enumerate(row.elts)}
            if len(entries) > MAX_ENTRIES:
                return None
        return entries

    def _scalar_entry(self, node: ast.expr) -> Formula:
        inner, wrapper_reads = _unwrap(node)
        return self._scalar(inner).after_reads(wrapper_reads)

    def _scaled_matrix(self, node: ast.BinOp) -> Formula | None:
        """Return a matrix times a formula, or divided by one, multiplied out."""
        is_product = isinstance(node.op, ast.Mult)
        is_left = _called(node.left) in MATRIX_CALLS
        if is_left == (is_product and _called(node.right) in MATRIX_CALLS):
            return None
        matrix = self._matrix(node.left if is_left else node.right)
        factor = self._scalar(node.right if is_left else node.left)
        if matrix is None or matrix.entries is None or matrix.problem or factor.problem:
            return None

        def scale(entry: Formula) -> Formula:
            if is_left:
                return join_formulas(["(", entry, ")*(" if is_product else ")/(", factor, ")"])
            return join_formulas(["(", factor, ")*(", entry, ")"])

        scaled = _matrix_of({index: scale(entry) for index, entry in matrix.entries.items()})
        return scaled.after_reads([read for read in matrix.reads if read.start == read.end])


def _matrix_of(entries: dict[Index, Formula]) -> Formula:
    """Return a matrix, or a vector, of its entries, written as lists."""
    pieces: list[str | Formula] = ["["]
    for i, row in groupby(entries.items(), key=lambda item: item[0][0]):
        pieces += [", "] if i else []
        for (_, *column), entry in row:
            pieces += [", " if column[0] else "["] if column else []
            pieces.append(entry)
        pieces += ["]"] if column else []
    return replace(join_formulas([*pieces, "]"]), entries=entries)


def _unwrap(node: ast.expr) -> tuple[ast.expr, list[Read]]:
    """Take simplify(...) and the like off an expression; return also their names, which must be the library's."""
    reads: list[Read] = []
    while isinstance(node, ast.Call):
        if any(keyword.arg in (None, "inplace") for keyword in node.keywords) or has_starred(node.args):
            break
        match node:
            case ast.Call(ast.Name(name), [inner, *_]) if name in UNCHANGED:
                reads += _function_reads(node)
            case ast.Call(ast.Attribute(ast.Name(module), name), [inner, *_]) if (
                name in UNCHANGED and module in MODULES
            ):
                reads += _function_reads(node)
            case ast.Call(ast.Attribute(inner, method), arguments) if method in UNCHANGED_METHODS:
                functions = [x.id if isinstance(x, ast.Name) else getattr(x, "attr", "") for x in arguments]
                if not all(name in UNCHANGED for name in functions) or (method == "applyfunc" and not functions):
                    break
            case _:
                break
        node = inner
    return node, reads


def _function_reads(call: ast.expr) -> list[Read]:
    """Return the read of the function's name, or of its module's, in a call."""
    match call:
        case ast.Call(ast.Name(name)):
            return [Read(ascii_name(name), 0, 0, use=Use.CALL)]
        case ast.Call(ast.Attribute(ast.Name(module))):
            return [Read(ascii_name(module), 0, 0, use=Use.MODULE)]
    return []


def _reshape(arguments: Sequence[ast.expr]) -> ast.List | None:
    """Return the rows of Matrix(2, 2, [a, b, c, d])."""
    match arguments:
        case [ast.Constant(int(rows)), ast.Constant(int(columns)), ast.List(entries) | ast.Tuple(entries)] if (
            0 < rows <= MAX_INDEX and 0 < columns <= MAX_INDEX and len(entries) == rows * columns
        ):
            starts = range(0, len(entries), columns)
            return ast.List([ast.List(entries[k : k + columns], ast.Load()) for k in starts], ast.Load())
    return None


class _UnreadableError(Exception):
    """An expression that is not read; the message says why."""


class _ScalarReader:
    """Reads one expression without brackets of lists: the names in it and their places in its text."""

    def __init__(self, source: PythonText, root: ast.expr) -> None:
        self.root = root
        self.text = source.segment(root)
        self.span = source.spans(root)
        self.reads: list[Read] = []
        self.respellings: list[tuple[int, int, str]] = []
        """Pieces of the text, by start and end, and what is written in place of each."""
        self.waiting: list[ast.expr] = [root]

    def formula(self) -> Formula:
        try:
            while self.waiting:
                self._read(self.waiting.pop())
        except _UnreadableError as error:
            return Formula(self.text, problem=str(error))
        return replace(_respell(self.text, self.reads, self.respellings), number=_number(self.root))

    def _read(self, node: ast.expr) -> None:
        start, end = self.span(node)
        match node:
            case ast.BinOp(left, op, right) if isinstance(op, OPERATORS):
                self.waiting += [left, right]
            case ast.UnaryOp(ast.UAdd() | ast.USub(), operand):
                self.waiting.append(operand)
            case ast.Constant(value) if type(value) in (int, float):
                typed = self.text[start:end]
                if PLAIN_NUMBER.fullmatch(typed) is None:
                    raise _UnreadableError(f"the number {typed[:20]!r} is not read")
                if typed.endswith("."):
                    self.respellings.append((start, end, f"{typed}0"))
            case ast.Name(name):
                self.reads.append(Read(ascii_name(name), start, end))
            case ast.Subscript(ast.Name(name), ast.Constant(str(member))):
                self.reads.append(Read(ascii_name(name), start, end, member=member))
            case ast.Subscript(ast.Name(name), index) if numbers := constant_index(index):
                self.reads.append(Read(ascii_name(name), start, end, index=numbers))
            case ast.Subscript(ast.Subscript(ast.Name(name), first), second):
                i, j = constant_index(first), constant_index(second)
                if i is None or j is None or len(i) != 1 or len(j) != 1:
                    raise self._unreadable(node)
                self.reads.append(Read(ascii_name(name), start, end, index=(*i, *j)))
            case ast.Attribute(ast.Name(base), "pi"):
                self.reads.append(Read(ascii_name(base), start, start, use=Use.MODULE))
                self.respellings.append((start, end, "pi"))
            case ast.Attribute(ast.Name(base), member):
                self.reads.append(Read(ascii_name(base), start, end, member=ascii_name(member)))
            case ast.Call():
                self._read_call(node)
            case _:
                raise self._unreadable(node)

    def _unreadable(self, node: ast.expr) -> _UnreadableError:
        start, end = self.span(node)
        return _UnreadableError(f"{self.text[start:end][:40]!r} is not read")

    def _read_call(self, node: ast.Call) -> None:
        start, end = self.span(node)
        if has_starred(node.args) or node.keywords:
            raise self._unreadable(node)
        if derivative := _time_derivative(node):
            name, order, uses = derivative
            self.reads.append(Read(ascii_name(name), start, start))
            self.reads += [replace(read, start=start, end=start) for read in uses]
            self.respellings.append((start, end, f"diff({ascii_name(name)}, t{', 2' if order == 2 else ''})"))
            return
        if problem := _exact_problem(node):
            raise _UnreadableError(problem)
        first, last = self.span(node.func)
        match node:
            case ast.Call(ast.Name(name), [ast.Name("t") as time]) if name not in FUNCTION_NAMES:
                self.reads.append(Read(ascii_name(name), first, last))
                self.reads.append(Read("t", *self.span(time), use=Use.TIME))
            case ast.Call(ast.Name(name)):
                self.reads.append(Read(ascii_name(name), first, last, use=Use.CALL))
                self.waiting += node.args
            case ast.Call(ast.Attribute(ast.Name(module), name)) if name in FUNCTION_NAMES and (
                len(name) > 1 or name == "S"
            ):
                self.reads.append(Read(ascii_name(module), first, first, use=Use.MODULE))
                if ascii_name(module) not in MODULES:
                    self.respellings.append((first, last, name))
                self.waiting += node.args
            case _:
                raise self._unreadable(node)


def _respell(text: str, reads: Sequence[Read], respellings: Sequence[tuple[int, int, str]]) -> Formula:
    """Return a text with other spellings of some of its pieces, and its reads where they are then."""
    pieces: list[str] = []
    moved: list[Read] = []
    at = shift = 0
    waiting = sorted(reads, key=lambda read: (read.start, read.end))[::-1]
    for start, end, spelling in sorted(respellings):
        while waiting and waiting[-1].start < start:
            moved.append(_move(waiting.pop(), shift))
        while waiting and waiting[-1].start < end:  # names inside what is respelled are not in the new text
            moved.append(replace(waiting.pop(), start=start + shift, end=start + shift))
        pieces += [text[at:start], spelling]
        at = end
        shift += len(spelling) - (end - start)
    moved += [_move(read, shift) for read in reversed(waiting)]
    return Formula("".join([*pieces, text[at:]]), tuple(moved))


def _move(read: Read, shift: int) -> Read:
    return replace(read, start=read.start + shift, end=read.end + shift)


# Calls


def _called(node: ast.expr) -> str:
    """Return the name of the function that is called, by itself or of a module."""
    match node:
        case ast.Call(ast.Name(name)) | ast.Call(ast.Attribute(ast.Name(), name)):
            return str(name)
    return ""


def _time_derivative(node: ast.Call) -> tuple[str, int, list[Read]] | None:
    """Return the name, the order and further names of diff(q1, t), q1.diff(t, 2) and Derivative(q1(t), t)."""
    arguments = list(node.args)
    uses: list[Read] = []
    match node.func:
        case ast.Name("diff" | "Derivative"):
            uses += _function_reads(node)
        case ast.Attribute(ast.Name(), "diff" | "Derivative") if len(arguments) > 1 and not _is_time(arguments[0]):
            uses += _function_reads(node)
        case ast.Attribute(value, "diff"):
            arguments.insert(0, value)
        case _:
            return None
    if len(arguments) < 2:
        return None
    inner, *rest = arguments
    name, order = "", 1
    if isinstance(inner, ast.Call) and len(inner.args) == 1 and _is_time(inner.args[0]):
        inner = inner.func
    if isinstance(inner, ast.Call) and (nested := _time_derivative(inner)):
        name, order, inner_uses = nested
        uses += inner_uses
        order += 1
    elif isinstance(inner, ast.Name):
        name = inner.id
    match rest:
        case [time, ast.Constant(2)] | [ast.Tuple([time, ast.Constant(2)])]:
            times = [time, time]
        case [_] | [_, _]:
            times = rest
        case _:
            return None
    order += len(times) - 1
    if not name or order > 2 or not all(map(_is_time, times)):
        return None
    return name, order, [*uses, Read("t", 0, 0, use=Use.TIME)]


def _is_time(node: ast.expr) -> bool:
    match node:
        case ast.Name("t") | ast.Attribute(ast.Name(), "_t"):
            return True
    return False


def _exact_problem(node: ast.Call) -> str:
    """Return why Integer(...) or Rational(...) is not read: its arguments have to be numbers as they stand."""
    called = _called(node)
    numbers = [x.operand if isinstance(x, ast.UnaryOp) and isinstance(x.op, ast.USub) else x for x in node.args]
    types = [type(x.value) if isinstance(x, ast.Constant) else None for x in numbers]
    is_exact = called in ("Integer", "int") and types == [int]
    is_exact = is_exact or (called == "Rational" and types in ([int], [float], [int, int]))
    return "" if is_exact or called not in EXACT else f"{called}(...) of anything but whole numbers is not read"


def _number(node: ast.expr) -> float | None:
    """Return the value of a number, of one with a sign, and of a quotient of two; None of any other expression."""
    match node:
        case ast.Constant(value) if type(value) in (int, float):
            try:
                return float(str(value))
            except (ValueError, OverflowError):
                return None
        case ast.UnaryOp(ast.USub(), operand):
            inner = _number(operand)
            return None if inner is None else -inner
        case ast.BinOp(ast.Constant() as left, ast.Div(), ast.Constant() as right):
            numerator, denominator = _number(left), _number(right)
            is_finite = numerator is not None and math.isfinite(numerator)
            return numerator / denominator if numerator is not None and is_finite and denominator else None
        case ast.Call(ast.Name("Rational"), [left, right]):
            numerator, denominator = _number(left), _number(right)
            return numerator / denominator if numerator is not None and denominator else None
    return None
