"""Right-hand sides of Python: which are formulas and matrices, and which names they read; the text stays as typed."""

from __future__ import annotations

import ast
import io
import math
import re
import tokenize
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import accumulate

from dhkit.errors import AnswerError
from dhkit.grading.answers.programs.bindings import Formula, Read, Use
from dhkit.grading.answers.rewriting import MODULES
from dhkit.grading.answers.tokens import folded
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
UNCHANGED = frozenset(
    ("simplify", "expand", "trigsimp", "factor", "cancel", "together", "powsimp", "expand_trig", "radsimp", "collect")
)
"""sympy's functions and methods that write an expression in another way."""
UNCHANGED_METHODS = UNCHANGED | {"doit", "applyfunc", "copy", "as_immutable", "as_mutable"}
MATRIX_CALLS = frozenset(
    (
        "Matrix",
        "ImmutableMatrix",
        "MutableDenseMatrix",
        "ImmutableDenseMatrix",
        "array",
        "matrix",
        "asarray",
        "DM",
        "SX",
    )
)
EXACT = frozenset(("Integer", "Rational", "int", "round", "floor", "ceil", "trunc"))
"""Functions that make another number of a quotient of floating-point numbers: Integer(1/3) is 0."""
ZEROS = frozenset(("zeros", "zeros_like"))
VECTORS = ("asarray", "array", "ravel", "squeeze", "flatten", "list", "tuple", "Matrix", "atleast_1d", "asanyarray")
"""Functions that turn a vector into the same vector."""
OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)
MAX_ENTRIES = 1_024
MAX_INDEX = 1_000


def spelled(name: str) -> str:
    """Return an identifier in ASCII: Greek letters by their names, as the reader of formulas has them."""
    if name.isascii():
        return name
    try:
        plain, _ = folded(name)
    except AnswerError:
        plain = ""
    return plain if plain.isidentifier() and plain.isascii() else "u" + name.encode("unicode_escape").hex()


def constant_index(node: ast.expr) -> tuple[int, ...] | None:
    """Return the numbers of an index; ``[..., 0, 1]`` counts behind leading axes. None of any other index."""
    parts = node.elts if isinstance(node, ast.Tuple) else [node]
    if parts and isinstance(parts[0], ast.Constant) and parts[0].value is Ellipsis:
        parts = parts[1:]
    found: list[int] = []
    for part in parts:
        value = part.value if isinstance(part, ast.Constant) else None
        if type(value) is not int or not 0 <= value <= MAX_INDEX:
            return None
        found.append(value)
    return tuple(found)


def joined(pieces: Sequence[str | Formula]) -> Formula:
    """Return texts and formulas side by side, as one formula."""
    texts: list[str] = []
    reads: list[Read] = []
    at, problem = 0, ""
    for piece in pieces:
        text = piece if isinstance(piece, str) else piece.text
        if isinstance(piece, Formula):
            reads += [replace(read, start=read.start + at, end=read.end + at) for read in piece.reads]
            problem = problem or piece.problem
        texts.append(text)
        at += len(text)
    return Formula("".join(texts), tuple(reads), problem=problem)


class PythonFormulas:
    r"""Reads expressions of one program's text.

    Parameters
    ----------
    text
        The program, with ``\n`` alone between lines.
    """

    def __init__(self, text: str) -> None:
        self.lines = text.split("\n")
        self._columns: dict[int, list[int]] = {}
        self.encoded = [None if line.isascii() else line.encode() for line in self.lines]

    # Text

    def _column(self, line: int, offset: int) -> int:
        """Return a column in characters: the parser counts bytes."""
        encoded = self.encoded[line - 1]
        if encoded is None:
            return offset
        if line not in self._columns:
            widths = accumulate((byte & 0xC0) != 0x80 for byte in encoded)  # bytes that begin a character
            self._columns = {line: [0, *widths]}
        return self._columns[line][offset]

    def segment(self, node: ast.expr) -> str:
        """Return an expression's text in one line: no comments, no line breaks, characters where they were."""
        end_line, end_offset = node.end_lineno or node.lineno, node.end_col_offset or 0
        first, last = self._column(node.lineno, node.col_offset), self._column(end_line, end_offset)
        if node.lineno == end_line:
            return self.lines[node.lineno - 1][first:last]
        lines = [self.lines[node.lineno - 1][first:], *self.lines[node.lineno : end_line - 1]]
        return _one_line("\n".join([*lines, self.lines[end_line - 1][:last]]))

    def _offsets(self, root: ast.expr) -> dict[int, int]:
        """Return where each line of an expression begins in its text."""
        start = self._column(root.lineno, root.col_offset)
        found = {root.lineno: -start}
        at = len(self.lines[root.lineno - 1]) - start + 1
        for line in range(root.lineno + 1, (root.end_lineno or root.lineno) + 1):
            found[line] = at
            at += len(self.lines[line - 1]) + 1
        return found

    # Formulas

    def formula(self, node: ast.expr) -> Formula:
        """Return an expression as a formula, a matrix, or why it cannot be read."""
        wrappers: list[Read] = []
        node = self._unwrapped(node, wrappers)
        found = self._matrix(node) or self._scalar(node)
        return replace(found, reads=(*wrappers, *found.reads)) if wrappers else found

    def _unwrapped(self, node: ast.expr, wrappers: list[Read]) -> ast.expr:
        """Take simplify(...) and the like away; their names must be the library's."""
        while isinstance(node, ast.Call):
            function = node.func
            if any(keyword.arg in (None, "inplace") for keyword in node.keywords) or _has_starred(node.args):
                return node
            if isinstance(function, ast.Name) and function.id in UNCHANGED and node.args:
                wrappers.append(Read(function.id, 0, 0, use=Use.CALL))
                node = node.args[0]
            elif isinstance(function, ast.Attribute) and _is_module_call(function, UNCHANGED) and node.args:
                assert isinstance(function.value, ast.Name)  # noqa: S101
                wrappers.append(Read(spelled(function.value.id), 0, 0, use=Use.MODULE))
                node = node.args[0]
            elif isinstance(function, ast.Attribute) and function.attr in UNCHANGED_METHODS:
                simple = [arg.id if isinstance(arg, ast.Name) else getattr(arg, "attr", "") for arg in node.args]
                if not all(name in UNCHANGED for name in simple) or (function.attr == "applyfunc" and not simple):
                    return node
                if _is_derivative(function.value):
                    node = function.value
                    continue
                node = function.value
            else:
                return node
        return node

    # Matrices

    def _matrix(self, node: ast.expr) -> Formula | None:
        """Return a matrix or a vector in brackets, perhaps with a factor; nothing where there is none."""
        wrappers: list[Read] = []
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            return self._scaled(node)
        called = _called(node)
        if called in ZEROS and isinstance(node, ast.Call):
            self._function_read(node.func, wrappers)
            return Formula(self.segment(node), tuple(wrappers), is_zeros=True)
        rows: ast.expr | None = node
        if called in MATRIX_CALLS and isinstance(node, ast.Call):
            self._function_read(node.func, wrappers)
            if any(keyword.arg != "dtype" for keyword in node.keywords) or _has_starred(node.args):
                return None
            rows = node.args[0] if len(node.args) == 1 else self._reshaped(node.args)
        if not isinstance(rows, ast.List | ast.Tuple):
            return None
        found = self._listed(rows)
        return None if found is None else replace(found, reads=(*wrappers, *found.reads))

    @staticmethod
    def _function_read(function: ast.expr, wrappers: list[Read]) -> None:
        if isinstance(function, ast.Name):
            wrappers.append(Read(spelled(function.id), 0, 0, use=Use.CALL))
        elif isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
            wrappers.append(Read(spelled(function.value.id), 0, 0, use=Use.MODULE))

    @staticmethod
    def _reshaped(arguments: Sequence[ast.expr]) -> ast.expr | None:
        """Return the rows of Matrix(2, 2, [a, b, c, d])."""
        if len(arguments) != 3 or not isinstance(arguments[2], ast.List | ast.Tuple):
            return None
        shape = [x.value for x in arguments[:2] if isinstance(x, ast.Constant) and isinstance(x.value, int)]
        entries = arguments[2].elts
        if len(shape) != 2 or not all(0 < k <= MAX_INDEX for k in shape):
            return None
        rows, columns = shape
        if len(entries) != rows * columns:
            return None
        at = [ast.List(entries[i * columns : (i + 1) * columns], ast.Load()) for i in range(rows)]
        return ast.List(list[ast.expr](at), ast.Load())

    def _listed(self, rows: ast.List | ast.Tuple) -> Formula | None:
        entries: dict[tuple[int, ...], Formula] = {}
        pieces: list[str | Formula] = ["["]
        if not rows.elts or _has_starred(rows.elts) or len(rows.elts) > MAX_ENTRIES:
            return None
        nested = [isinstance(row, ast.List | ast.Tuple) for row in rows.elts]
        if any(nested) and not all(nested):
            return None
        for i, row in enumerate(rows.elts):
            pieces += [", "] if i else []
            if not isinstance(row, ast.List | ast.Tuple):
                entries[(i,)] = self._scalar_unwrapped(row)
                pieces.append(entries[(i,)])
                continue
            if not row.elts or _has_starred(row.elts):
                return None
            pieces.append("[")
            for j, element in enumerate(row.elts):
                if isinstance(element, ast.List | ast.Tuple):
                    return None
                entries[(i, j)] = self._scalar_unwrapped(element)
                pieces += [", ", entries[(i, j)]] if j else [entries[(i, j)]]
            pieces.append("]")
            if len(entries) > MAX_ENTRIES:
                return None
        return replace(joined([*pieces, "]"]), entries=entries)

    def _scalar_unwrapped(self, node: ast.expr) -> Formula:
        wrappers: list[Read] = []
        found = self._scalar(self._unwrapped(node, wrappers))
        return replace(found, reads=(*wrappers, *found.reads)) if wrappers else found

    def _scaled(self, node: ast.BinOp) -> Formula | None:
        """Return a matrix times a formula, or divided by one, multiplied out."""
        left = _called(node.left) in MATRIX_CALLS and isinstance(node.left, ast.Call)
        right = _called(node.right) in MATRIX_CALLS and isinstance(node.op, ast.Mult)
        if left == right:
            return None
        matrix = self._matrix(node.left if left else node.right)
        scalar = self._scalar(node.right if left else node.left)
        if matrix is None or matrix.entries is None or matrix.problem or scalar.problem:
            return None
        before: list[str | Formula] = [] if left else ["(", scalar, ")*"]
        after: list[str | Formula] = [")*(" if isinstance(node.op, ast.Mult) else ")/(", scalar, ")"]
        after = after if left else [")"]
        entries = {index: joined([*before, "(", entry, *after]) for index, entry in matrix.entries.items()}
        rows: dict[int, list[Formula]] = {}
        for index, entry in entries.items():
            rows.setdefault(index[0], []).append(entry)
        is_flat = len(next(iter(entries))) == 1
        pieces: list[str | Formula] = ["["]
        for i, row in rows.items():
            pieces += ([", "] if i else []) + ([] if is_flat else ["["])
            for j, entry in enumerate(row):
                pieces += [", ", entry] if j else [entry]
            pieces += [] if is_flat else ["]"]
        reads = tuple(read for read in matrix.reads if read.start == read.end)
        whole = joined([*pieces, "]"])
        return replace(whole, entries=entries, reads=(*reads, *whole.reads))

    # Scalars

    def _scalar(self, root: ast.expr) -> Formula:
        """Return an expression without brackets, its names, and their places."""
        text = self.segment(root)
        offsets = self._offsets(root)
        reads: list[Read] = []
        changes: list[tuple[int, int, str]] = []
        waiting: list[ast.expr] = [root]

        def span(node: ast.expr) -> tuple[int, int]:
            end_line = node.end_lineno or node.lineno
            return (
                offsets[node.lineno] + self._column(node.lineno, node.col_offset),
                offsets[end_line] + self._column(end_line, node.end_col_offset or 0),
            )

        while waiting:
            node = waiting.pop()
            start, end = span(node)
            match node:
                case ast.BinOp(left, op, right) if isinstance(op, OPERATORS):
                    waiting += [left, right]
                case ast.UnaryOp(ast.UAdd() | ast.USub(), operand):
                    waiting.append(operand)
                case ast.Constant(value) if type(value) in (int, float):
                    if NUMBER.fullmatch(text[start:end]) is None:
                        return _problem(text, f"the number {text[start:end][:20]!r} is not read")
                    if text[start:end].endswith("."):
                        changes.append((start, end, f"{text[start:end]}0"))
                case ast.Name(name):
                    reads.append(Read(spelled(name), start, end))
                case ast.Subscript(ast.Name(name), index):
                    if isinstance(index, ast.Constant) and isinstance(index.value, str):
                        reads.append(Read(spelled(name), start, end, member=index.value))
                        continue
                    numbers = constant_index(index)
                    if numbers is None or numbers == ():
                        return _problem(text, f"{text[start:end][:40]!r} is not read")
                    reads.append(Read(spelled(name), start, end, index=numbers))
                case ast.Subscript(ast.Subscript(ast.Name(name), first), second):
                    i, j = constant_index(first), constant_index(second)
                    if i is None or j is None or len(i) != 1 or len(j) != 1:
                        return _problem(text, f"{text[start:end][:40]!r} is not read")
                    reads.append(Read(spelled(name), start, end, index=(*i, *j)))
                case ast.Attribute(ast.Name(base), member):
                    if member == "pi":
                        reads.append(Read(spelled(base), start, start, use=Use.MODULE))
                        changes.append((start, end, "pi"))
                    else:
                        reads.append(Read(spelled(base), start, end, member=spelled(member)))
                case ast.Call():
                    why = self._call(node, span, text, reads, changes, waiting)
                    if why:
                        return _problem(text, why)
                case _:
                    return _problem(text, f"{text[start:end][:40]!r} is not read")
        return replace(_changed(text, reads, changes), number=_number(root))

    def _call(
        self,
        node: ast.Call,
        span: Callable[[ast.expr], tuple[int, int]],
        text: str,
        reads: list[Read],
        changes: list[tuple[int, int, str]],
        waiting: list[ast.expr],
    ) -> str:
        """Read a call; return why it cannot be."""
        start, end = span(node)
        what = f"{text[start:end][:40]!r} is not read"
        function = node.func
        if _has_starred(node.args) or node.keywords:
            return what
        if timed := self._by_time(node):
            name, order, uses = timed
            reads.append(Read(spelled(name), start, start))
            reads += [Read(use.name, start, start, use=use.use) for use in uses]
            changes.append((start, end, f"diff({spelled(name)}, t{', 2' if order == 2 else ''})"))
            return ""
        if problem := _exact_problem(node):
            return problem
        if isinstance(function, ast.Name):
            of_time = len(node.args) == 1 and isinstance(node.args[0], ast.Name) and node.args[0].id == "t"
            if of_time and function.id not in FUNCTION_NAMES:
                first, last = span(function)
                reads.append(Read(spelled(function.id), first, last))
                first, last = span(node.args[0])
                reads.append(Read("t", first, last, use=Use.TIME))
                return ""
            first, last = span(function)
            reads.append(Read(spelled(function.id), first, last, use=Use.CALL))
            waiting += node.args
            return ""
        if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
            if function.attr not in FUNCTION_NAMES or (len(function.attr) == 1 and function.attr != "S"):
                return what
            first, last = span(function)
            module = spelled(function.value.id)
            reads.append(Read(module, first, first, use=Use.MODULE))
            if module not in MODULES:
                changes.append((first, last, function.attr))
            waiting += node.args
            return ""
        return what

    @staticmethod
    def _by_time(node: ast.Call) -> tuple[str, int, list[Read]] | None:
        """Return the name, the order and further names of diff(q1, t), q1.diff(t, 2) and Derivative(q1(t), t)."""
        function, arguments = node.func, list(node.args)
        uses: list[Read] = []
        match function:
            case ast.Name("diff" | "Derivative" as called):
                uses.append(Read(called, 0, 0, use=Use.CALL))
            case ast.Attribute(ast.Name(module), "diff" | "Derivative") if len(arguments) > 1 and not _is_time(
                arguments[0]
            ):
                uses.append(Read(spelled(module), 0, 0, use=Use.MODULE))
            case ast.Attribute(value, "diff"):
                arguments.insert(0, value)
            case _:
                return None
        if len(arguments) < 2:
            return None
        inner, *rest = arguments
        order = 1
        if isinstance(inner, ast.Call) and len(inner.args) == 1 and _is_time(inner.args[0]):
            inner = inner.func
        if isinstance(inner, ast.Call) and (before := PythonFormulas._by_time(inner)):
            name, order, more = before
            uses += more
            order += 1
        elif isinstance(inner, ast.Name):
            name = inner.id
        else:
            return None
        match rest:
            case [time] if _is_time(time):
                pass
            case [time, ast.Constant(2)] if _is_time(time):
                order += 1
            case [time, again] if _is_time(time) and _is_time(again):
                order += 1
            case [ast.Tuple([time, ast.Constant(2)])] if _is_time(time):
                order += 1
            case _:
                return None
        return (name, order, [*uses, Read("t", 0, 0, use=Use.TIME)]) if order <= 2 else None


def _is_time(node: ast.expr) -> bool:
    return (isinstance(node, ast.Name) and node.id == "t") or (
        isinstance(node, ast.Attribute) and node.attr == "_t" and isinstance(node.value, ast.Name)
    )


def _is_derivative(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and PythonFormulas._by_time(node) is not None


def _called(node: ast.expr) -> str:
    """Return the name of the function that is called, by itself or of a module."""
    match node:
        case ast.Call(ast.Name(name)) | ast.Call(ast.Attribute(ast.Name(), name)):
            return str(name)
    return ""


def _exact_problem(node: ast.Call) -> str:
    """Return why Integer(...) or Rational(...) is not read: its arguments have to be numbers as they stand."""
    called = _called(node)
    if called not in EXACT:
        return ""
    numbers = [x.operand if isinstance(x, ast.UnaryOp) and isinstance(x.op, ast.USub) else x for x in node.args]
    types = [type(x.value) if isinstance(x, ast.Constant) else None for x in numbers]
    if called in ("Integer", "int") and types == [int]:
        return ""
    if called == "Rational" and types in ([int], [float], [int, int]):
        return ""
    return f"{called}(...) of anything but whole numbers is not read"


def _is_module_call(function: ast.Attribute, names: frozenset[str]) -> bool:
    return isinstance(function.value, ast.Name) and function.attr in names and function.value.id in MODULES


def _has_starred(nodes: Sequence[ast.expr]) -> bool:
    return any(isinstance(node, ast.Starred) for node in nodes)


def _problem(text: str, why: str) -> Formula:
    return Formula(text, problem=why)


def _changed(text: str, reads: Sequence[Read], changes: Sequence[tuple[int, int, str]]) -> Formula:
    """Return a text with other spellings of some of its pieces, and its reads where they are then."""
    pieces: list[str] = []
    moved: list[Read] = []
    at = shift = 0
    kept = sorted(reads, key=lambda read: (read.start, read.end))
    k = 0
    for start, end, new in sorted(changes):
        while k < len(kept) and kept[k].start < start:
            moved.append(_moved(kept[k], shift))
            k += 1
        while k < len(kept) and kept[k].start < end:  # names inside what is spelled anew stand nowhere
            moved.append(replace(kept[k], start=start + shift, end=start + shift))
            k += 1
        pieces += [text[at:start], new]
        at = end
        shift += len(new) - (end - start)
    moved += [_moved(read, shift) for read in kept[k:]]
    return Formula("".join([*pieces, text[at:]]), tuple(moved))


def _moved(read: Read, shift: int) -> Read:
    return replace(read, start=read.start + shift, end=read.end + shift)


def _number(node: ast.expr) -> float | None:
    """Return the value of a number, of one with a sign, and of a quotient of two."""
    match node:
        case ast.Constant(value) if type(value) in (int, float):
            try:
                return float(str(value))
            except (ValueError, OverflowError):
                return None
        case ast.UnaryOp(ast.USub(), operand):
            inner = _number(operand)
            return None if inner is None else -inner
        case ast.BinOp(ast.Constant() as above, ast.Div(), ast.Constant() as below):
            dividend, divisor = _number(above), _number(below)
            return dividend / divisor if dividend is not None and divisor and math.isfinite(dividend) else None
        case ast.Call(ast.Name("Rational"), [above, below]):
            dividend, divisor = _number(above), _number(below)
            return dividend / divisor if dividend is not None and divisor else None
    return None


def _one_line(text: str) -> str:
    """Return text of several lines in one, with spaces for comments, continuation signs and line breaks."""
    lines = text.split("\n")
    if "#" in text:
        starts: dict[int, int] = {}
        try:
            for token in tokenize.generate_tokens(io.StringIO(f"({text}\n)").readline):
                if token.type == tokenize.COMMENT:
                    starts[token.start[0] - 1] = token.start[1] - (token.start[0] == 1)
        except (tokenize.TokenError, SyntaxError, IndentationError):
            pass
        for line, column in starts.items():
            if line < len(lines):
                lines[line] = lines[line][:column] + " " * (len(lines[line]) - column)
    return (
        " ".join(f"{line[:-1]} " if line.endswith("\\") else line for line in lines)
        .replace("\t", " ")
        .replace("\f", " ")
    )
