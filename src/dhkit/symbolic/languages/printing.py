"""C99, Python and MATLAB: the syntax of their expressions, and their statements."""

from __future__ import annotations

import math
from collections.abc import Sequence

from dhkit.symbolic.languages.layout import comment_block, wrapped
from dhkit.symbolic.languages.statements import Comment, Digit, Guard, Let, Statement, Store
from dhkit.symbolic.languages.syntax import Syntax

# C

C = Syntax(
    item="{array}[{k}]",
    first_index=0,
    pi=repr(math.pi),
    functions={"abs": "fabs", "absolute": "fabs", "minimum": "fmin", "maximum": "fmax"},
    nan="NAN",
    infinity="INFINITY",
)


def c_lines(statement: Statement, indent: str, shape: Sequence[int] = ()) -> list[str]:
    """Return the lines of a statement; an array of some shape is stored row by row."""
    match statement:
        case Comment(text):
            return ["", *comment_block([text], f"{indent}/* ", f"{indent} * ", " */")]
        case Let(name, expression, remark):
            line = wrapped(expression, f"{indent}const double {name} = ", f"{indent}    ") + ";"
            return [line + (f" /* {remark} */" if remark else "")]
        case Store(array, places, parts):
            first, *others = [
                f"{array}[{_offset(place, shape)}]" if place else array for place in places
            ]
            lines = []
            for k, part in enumerate(parts):
                sign = "=" if k == 0 else "+="
                lines.append(wrapped(part, f"{indent}{first} {sign} ", f"{indent}    ") + ";")
            return [*lines, *(f"{indent}{other} = {first};" for other in others)]
        case Guard(expression, least):
            return [f"{indent}if ({expression} < {least}) continue;"]
        case Digit(expressions, is_inverted):
            is_odd, *others = [f"(({expression}) < 0.0)" for expression in expressions]
            for other in others:
                is_odd = f"({is_odd} != {other})"
            return [f"{indent}b = 2*b + {'!' if is_inverted else ''}{is_odd};"]


def _offset(place: Sequence[int], shape: Sequence[int]) -> int:
    """Return the offset of an entry, row by row."""
    offset = 0
    for k, length in zip(place, shape, strict=True):
        offset = offset * length + k
    return offset


# Python

_NUMPY_NAMES = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"}
NUMPY = Syntax(
    item="{array}[..., {k}]",
    first_index=0,
    pi="np.pi",
    functions={
        name: f"np.{_NUMPY_NAMES.get(name, name)}" for name in (*_NUMPY_NAMES, "tan", "sqrt", "abs")
    },
    nan="1e999 - 1e999",  # so that generated modules import nothing for it
    infinity="1e999",
)
"""Expressions of arrays with leading batch axes."""
PYTHON = Syntax(
    item="{array}[{k}]", first_index=0, pi="pi", functions={}, nan="nan", infinity="inf"
)
"""Expressions of numbers, with the functions of the standard library."""


def python_lines(statement: Statement, indent: str) -> list[str]:
    """Return the lines of a statement; entries of arrays have leading batch axes."""
    match statement:
        case Comment(text):
            return ["", *comment_block([text], f"{indent}# ", f"{indent}# ", "")]
        case Let(name, expression, remark):
            return [
                _assigned(expression, f"{indent}{name} = ", indent)
                + (f"  # {remark}" if remark else "")
            ]
        case Store(array, places, parts):
            first, *others = [
                f"{array}[{', '.join(['...', *map(str, place)])}]" for place in places
            ]
            lines = []
            for k, part in enumerate(parts):
                sign = "=" if k == 0 else "+="
                lines.append(_assigned(part, f"{indent}{first} {sign} ", indent))
            return [*lines, *(f"{indent}{other} = {first}" for other in others)]
        case Guard(expression, least):
            return [f"{indent}if {expression} < {least}:", f"{indent}    continue"]
        case Digit(expressions, is_inverted):
            is_odd, *others = [f"(({expression}) < 0)" for expression in expressions]
            for other in others:
                is_odd = f"({is_odd} != {other})"
            digit = f"(not {is_odd})" if is_inverted else is_odd
            return [f"{indent}b = 2*b + int{digit}"]


def _assigned(expression: str, head: str, indent: str) -> str:
    """Return an assignment, in brackets where it is longer than a line."""
    line = wrapped(expression, head, "")
    if "\n" not in line:
        return line
    return wrapped(expression, f"{head}(", f"{indent}    ") + ")"


# MATLAB, and GNU Octave

MATLAB = Syntax(
    item="{array}({k})", first_index=1, pi="pi", functions={}, nan="NaN", infinity="Inf"
)


def matlab_lines(statement: Statement, indent: str) -> list[str]:
    """Return the lines of a statement."""
    match statement:
        case Comment(text):
            return ["", *comment_block([text], f"{indent}% ", f"{indent}% ", "")]
        case Let(name, expression, remark):
            line = wrapped(expression, f"{indent}{name} = ", f"{indent}    ", ending=" ...") + ";"
            return [line + (f"  % {remark}" if remark else "")]
        case Store(array, places, parts):
            first, *others = [_matlab_entry(array, place) for place in places]
            lines = []
            for k, part in enumerate(parts):
                # There is no "+=": the entry is added to the next part.
                if k == 0:
                    sum_so_far = ""
                elif part.startswith("-"):
                    sum_so_far = f"{first} "
                else:
                    sum_so_far = f"{first} + "
                lines.append(
                    wrapped(part, f"{indent}{first} = {sum_so_far}", f"{indent}    ", ending=" ...")
                    + ";"
                )
            return [*lines, *(f"{indent}{other} = {first};" for other in others)]
        case Guard(expression, least):
            return [f"{indent}if {expression} < {least}", f"{indent}    continue", f"{indent}end"]
        case Digit(expressions, is_inverted):
            is_odd, *others = [f"(({expression}) < 0)" for expression in expressions]
            for other in others:
                is_odd = f"xor({is_odd}, {other})"
            return [f"{indent}b = 2*b + double({'~' if is_inverted else ''}{is_odd});"]


def _matlab_entry(array: str, place: Sequence[int]) -> str:
    """Return an entry of an array by its indices from 0, or the name of a scalar."""
    if not place:
        return array
    return f"{array}({', '.join(str(k + 1) for k in place)})"
