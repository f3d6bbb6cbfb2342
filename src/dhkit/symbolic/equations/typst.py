"""Equations in LaTeX and in typst at once: formulas of documents that are printed in both notations.

Both notations are written by one traversal, so that a sum has the same places for breaks in both: lines are chosen by
the width in LaTeX, and hold the same terms in both.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.latex import (
    BREAK,
    SYMBOLS_PER_EM,
    constant_typeset,
    head_latex,
    latex_text,
    line_starts,
    marked_latex,
    matrix_latex,
    symbols_wide,
    typeset_constants,
)
from dhkit.symbolic.equations.latex_names import TypesetName
from dhkit.symbolic.equations.quantities import Quantity
from dhkit.symbolic.equations.writing import Printer, readable_decimal
from dhkit.symbolic.ring import Element, Generator, Ring
from dhkit.symbolic.ring.notation import Notation, SineOrCosine, notation

_FUNCTIONS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": 'op("atan2")'}
"""Functions that have another name in typst."""
_WHOLE = {
    "T": "T (q)",
    "J": "J (q)",
    "M": "M (q)",
    "C": "C (q, dot(q))",
    "h": "h (q, dot(q))",
    "g": "g (q)",
}
"""Matrices and vectors with their arguments, as in LaTeX."""
_LETTERS = {"tau": "tau"}
"""Quantities whose name is a Greek letter."""


@dataclass(frozen=True)
class Math:
    """A formula in two notations.

    Attributes
    ----------
    latex
        The formula in LaTeX with amsmath, as it stands between dollar signs.
    typst
        The formula in typst, as it stands between dollar signs.
    """

    latex: str
    typst: str

    def __add__(self, other: Math) -> Math:
        return Math(f"{self.latex} {other.latex}", f"{self.typst} {other.typst}")


@dataclass(frozen=True)
class Row:
    """A line of a display: the left side of an equation and its right side; the left is empty on further lines."""

    left: Math | None
    right: Math


class TypstWriter:
    """Writes typst, with marks where lines may be broken."""

    def __init__(self, names: Mapping[str, str], written: Notation) -> None:
        self._names = names
        self._notation = written

    def symbol(self, name: str) -> str:  # noqa: D102 - see Writer
        return self._names[self._notation(name)]

    def variable(self, generator: Generator) -> str:  # noqa: D102
        return _variable(generator.text)

    def pi(self) -> str:  # noqa: D102
        return "pi"

    def call(self, function: str, arguments: Sequence[str]) -> str:  # noqa: D102
        inner = ", ".join(arguments).replace(BREAK, "")
        if function in ("sqrt", "abs"):
            return f"{function}({inner})"
        return f"{_FUNCTIONS.get(function, function)} ({inner})"

    def power(self, base: str, exponent: int) -> str:  # noqa: D102
        function = re.match(r"(sin|cos|tan) (?=\()", base)
        if function:
            return f"{function[1]}^{exponent} {base[function.end() :]}"
        if base.startswith("sqrt"):
            return rf"\({base}\)^{exponent}"
        return f"{base}^{exponent}"

    def brackets(self, inner: str) -> str:
        r"""Return a sum in brackets, which are escaped: unlike matching ones they may stand on two lines."""
        return rf"\({inner}\)"

    def product(  # noqa: D102
        self, coefficient: Fraction, numerator: Sequence[str], denominator: Sequence[str]
    ) -> str:
        decimal = readable_decimal(coefficient)
        number = _number(coefficient) if decimal is None else _scientific(decimal)
        factors = list(numerator)

        # The first factor, or the number alone, is written over the denominator, as in LaTeX.
        if denominator:
            divisor = (
                _without_brackets(denominator[0])
                if len(denominator) == 1
                else " ".join(denominator)
            )
            dividend = factors.pop(0) if factors else number
            if dividend == number:
                number = ""
            fraction = f"frac({_without_brackets(dividend)}, {divisor})"
            factors.insert(0, fraction.replace(BREAK, ""))

        if number and (number != "1" or not factors):
            factors.insert(0, f"{number} thin" if decimal and factors else number)
        return _spaced(factors)

    def total(self, terms: Sequence[tuple[bool, str]]) -> str:  # noqa: D102
        signed = BREAK.join(f" {'-' if negative else '+'} {term}" for negative, term in terms)
        return f"-{signed[3:]}" if signed.startswith(" - ") else signed[3:]


def math_text(element: Element) -> Math:
    """Return an element in one line.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.symbolic.exact.lagrangian import lagrangian
    >>> math_text(lagrangian(library_robot("planar2r")).M[1, 1]).typst
    'inline(frac(1, 3)) m_(2) l_(2)^2'
    """
    return Math(latex_text(element), _marked(element).replace(BREAK, ""))


def math_lines(element: Element, room: float) -> list[Math]:
    """Return an element as lines of about ``room`` em at most, broken before terms; 38 em fit a page of 12 points."""
    return broken(Math(marked_latex(element), _marked(element)), SYMBOLS_PER_EM * room)


def broken(marked: Math, symbols: float) -> list[Math]:
    """Return a sum with marks as lines.

    Parameters
    ----------
    marked
        The sum; both notations have marks at the same places.
    symbols
        Length of a line in symbols.
    """
    latex = marked.latex.split(BREAK)
    typst = marked.typst.split(BREAK)
    if len(latex) != len(typst):
        return [Math("".join(latex).strip(), "".join(typst).strip())]
    starts = [*line_starts(marked.latex, symbols), len(latex)]
    return [
        Math("".join(latex[a:b]).strip(), "".join(typst[a:b]).strip()) for a, b in pairwise(starts)
    ]


def equation_rows(left: Math, element: Element, room: float) -> list[Row]:
    """Return the lines of the equation ``left = element``, each ``room`` em wide at most."""
    own = symbols_wide(f"{left.latex} =") / SYMBOLS_PER_EM
    first, *more = math_lines(element, room - own)
    return [Row(left, first), *(Row(None, line) for line in more)]


def quantity_rows(quantity: Quantity, room: float) -> list[Row]:
    """Return a quantity as one matrix if it fits a line, else entry by entry, then the names of those that are zero.

    Parameters
    ----------
    quantity
        The matrix, vector or scalar.
    room
        Width of a line, em.
    """
    matrix = matrix_math(quantity)
    if matrix is not None:
        return [matrix]
    rows: list[Row] = []
    for names, element in quantity.entries:
        heads = [head_math(name) for name in names]
        left = Math(" = ".join(h.latex for h in heads), " = ".join(h.typst for h in heads))
        rows += equation_rows(left, element, room)

    zeros = [head_math(name) for name in quantity.zeros]
    per_line = max(1, int(SYMBOLS_PER_EM * room) // 9)  # a name with indices and an equals sign
    for k in range(0, len(zeros), per_line):
        left, *others = zeros[k : k + per_line]
        latex = " = ".join([*(head.latex for head in others), "0"])
        typst = " = ".join([*(head.typst for head in others), "0"])
        rows.append(Row(left, Math(latex, typst)))
    return rows


def matrix_math(quantity: Quantity) -> Row | None:
    """Return a matrix or a column in brackets; None if it is wider than a line, or a scalar."""
    latex = matrix_latex(quantity)
    if not latex:
        return None
    table = quantity.elements.reshape(len(quantity.elements), -1)
    rows = []
    for row in table:
        cells = [_marked(element).replace(BREAK, "").replace(";", "") for element in row]
        rows.append(", ".join(cells))
    head, _, body = latex.partition(" = ")
    whole = _WHOLE.get(quantity.name) or head_math(quantity.name).typst
    return Row(Math(head, whole), Math(body, f'mat(delim: "(", {"; ".join(rows)})'))


def angle_rows(angles: Sequence[SineOrCosine]) -> list[Row]:
    """Return the definitions of sines and cosines: of single joints together, and of each sum of joints."""
    rows = []
    if any(len(angle.joints) == 1 for angle in angles):
        rows.append(
            Row(
                Math(r"s_{i} = \sin(q_{i}), \quad c_{i}", "s_i = sin(q_i), quad c_i"),
                Math(r"\cos(q_{i})", "cos(q_i)"),
            )
        )
    for angle in angles:
        if len(angle.joints) > 1:
            latex = " + ".join(f"q_{{{joint + 1}}}" for joint in angle.joints)
            typst = " + ".join(f"q_{joint + 1}" for joint in angle.joints)
            left = Math(head_of_angle(angle.name), _variable(angle.name))
            right = Math(rf"\{angle.function}({latex})", f"{angle.function}({typst})")
            rows.append(Row(left, right))
    return rows


def head_of_angle(name: str) -> str:
    """Return the name of a sine or cosine in LaTeX: c23 is c_{23}."""
    return f"{name[0]}_{{{name[1:].replace('_', ',')}}}"


def head_math(name: str) -> Math:
    """Return the name of a quantity or an entry: M12 is M_{12}, A1_12 is (A_{1})_{12}."""
    link = re.fullmatch(r"A(\d+)_(\d+)", name)
    if link:
        return Math(head_latex(name), f"(A_{link[1]})_({link[2]})")
    letters, number = re.fullmatch(r"([A-Za-z]+)([\d_]*)", name).groups()  # type: ignore[union-attr]
    symbol = letters if len(letters) == 1 else f'italic("{letters}")'
    head = _LETTERS.get(letters, symbol)
    subscript = number.replace("_", ",")
    return Math(head_latex(name), f"{head}_({subscript})" if subscript else head)


def constant_math(ring: Ring, name: str) -> Math:
    """Return a constant's name."""
    typeset = constant_typeset(ring, name)
    return Math(typeset.latex, typeset.typst)


def typst_printer(ring: Ring, names: Mapping[str, TypesetName], written: Notation) -> Printer[str]:
    """Return the printer of a ring's elements in typst, with these names of constants."""
    typst = {name: typeset.typst for name, typeset in names.items()}
    return Printer(ring.generators, TypstWriter(typst, written))


def _marked(element: Element) -> str:
    """Return an element in typst with marks at which lines may be broken."""
    return _printer(element.ring).sum(collected(element))


@lru_cache(maxsize=64)
def _printer(ring: Ring) -> Printer[str]:
    """Return the printer of a ring's elements."""
    return typst_printer(ring, typeset_constants(ring), notation(ring))


def _variable(text: str) -> str:
    """Return a joint's variable: qdd1 is dot.double(q)_1, c23 is c_23."""
    kind, number = re.fullmatch(r"(qdd|qd|q|s|c)(\d[\d_]*)", text).groups()  # type: ignore[union-attr]
    symbol = {"qdd": "dot.double(q)", "qd": "dot(q)"}.get(kind, kind)
    return f"{symbol}_({number.replace('_', ',')})"


def _spaced(factors: Sequence[str]) -> str:
    """Return factors one after another, with a thin space around names of several letters."""
    text = factors[0]
    for before, factor in pairwise(factors):
        is_word = any(name.startswith(("upright", "italic")) for name in (before, factor))
        text += (" thin " if is_word else " ") + factor
    return text


def _number(value: Fraction) -> str:
    """Return a rational number."""
    if value.denominator == 1:
        return str(value.numerator)
    return f"inline(frac({value.numerator}, {value.denominator}))"


def _scientific(decimal: str) -> str:
    """Return a decimal: 1e-9 is 1 times 10^(-9)."""
    mantissa, _, exponent = decimal.partition("e")
    return f"{mantissa} times 10^({int(exponent)})" if exponent else mantissa


def _without_brackets(text: str) -> str:
    """Return a text without the brackets around all of it, if it has any."""
    match = re.fullmatch(r"\\\((.*)\\\)", text, re.DOTALL)
    if match is None:
        return text
    depth = 0
    for sign in re.findall(r"\\[()]", match[1]):
        depth += 1 if sign == r"\(" else -1
        if depth < 0:
            return text
    return match[1]
