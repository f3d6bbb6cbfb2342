"""Equations in LaTeX (amsmath) that latex2mathml converts to MathML without loss."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise

import numpy as np

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.latex_document import escaped
from dhkit.symbolic.equations.latex_names import TypesetName, typeset_names
from dhkit.symbolic.equations.quantities import Quantity, check_length, elements_of
from dhkit.symbolic.equations.writing import Printer, readable_decimal
from dhkit.symbolic.ring import Element, Generator, Ring
from dhkit.symbolic.ring.notation import (
    Notation,
    SineOrCosine,
    angles_of,
    entry_names,
    generators_of,
    notation,
    renamings,
    variables,
)

_LINE = 62
"""Symbols of a line: one is 0.4 to 0.5 em wide, and a line of an article in 11 points is 32.8 em."""
SYMBOLS_PER_EM = 2
"""Number of symbols that take the width of an em."""
_FRACTION = re.compile(r"\\t?frac\{((?:[^{}]|\{[^{}]*\})*)\}\{((?:[^{}]|\{[^{}]*\})*)\}")
_INVISIBLE = re.compile(
    r"\\(?:d?dot|[bB]ig[lr]|left|right|mathrm|mathit|sqrt|,|(?=(?:arc)?(?:sin|cos|tan)))"
)
"""Commands that print nothing beside other symbols; of a function's name, the backslash."""
_INDENT = r"\qquad "
BREAK = "\n"
"""Mark before a sign at which a line may be broken."""
FUNCTIONS = {"asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan", "atan2": r"\mathrm{atan2}"}
"""Functions that have another name in LaTeX."""
_ZEROS = 6
"""Names per line in the list of entries that are zero."""
_HEADS = {"tau": r"\tau"}
"""Quantities whose name is a Greek letter."""
_WHOLE = {
    "T": "T(q)",
    "J": "J(q)",
    "M": "M(q)",
    "C": r"C(q,\dot{q})",
    "h": r"h(q,\dot{q})",
    "g": "g(q)",
}
"""Matrices and vectors with their arguments, which also distinguish the vector g from the constant."""


class LatexWriter:
    """Writes LaTeX, with marks where lines may be broken."""

    def __init__(self, names: Mapping[str, str], written: Notation) -> None:
        self._names = names
        self._notation = written

    def symbol(self, name: str) -> str:  # noqa: D102 - see Writer
        return self._names[self._notation(name)]

    def variable(self, generator: Generator) -> str:  # noqa: D102
        return _variable_latex(generator.text)

    def pi(self) -> str:  # noqa: D102
        return r"\pi"

    def call(self, function: str, arguments: Sequence[str]) -> str:  # noqa: D102
        inner = ", ".join(arguments).replace(BREAK, "")
        if function == "sqrt":
            return rf"\sqrt{{{inner}}}"
        if function == "abs":
            return rf"\left|{inner}\right|"
        command = FUNCTIONS.get(function, "\\" + function)
        return f"{command}{_bracketed(inner)}"

    def power(self, base: str, exponent: int) -> str:  # noqa: D102
        function = re.match(r"(\\(?:sin|cos|tan))(?=[\\(])", base)
        if function:
            return f"{function[1]}^{{{exponent}}}{base[function.end() :]}"
        if base.startswith("\\sqrt"):
            return f"{_bracketed(base)}^{{{exponent}}}"
        return f"{base}^{{{exponent}}}"

    def brackets(self, inner: str) -> str:  # noqa: D102
        return _bracketed(inner)

    def product(  # noqa: D102
        self, coefficient: Fraction, numerator: Sequence[str], denominator: Sequence[str]
    ) -> str:
        decimal = readable_decimal(coefficient)
        number = _number(coefficient) if decimal is None else _scientific(decimal)
        factors = list(numerator)

        # The first factor, or the number alone, is written over the denominator.
        if denominator:
            divisor = (
                _without_brackets(denominator[0])
                if len(denominator) == 1
                else " ".join(denominator)
            )
            dividend = factors.pop(0) if factors else number
            if dividend == number:
                number = ""
            fraction = rf"\frac{{{_without_brackets(dividend)}}}{{{divisor}}}"
            factors.insert(0, fraction.replace(BREAK, ""))

        if number and (number != "1" or not factors):
            factors.insert(0, number + r"\," if decimal and factors else number)
        return _spaced(factors)

    def total(self, terms: Sequence[tuple[bool, str]]) -> str:  # noqa: D102
        signed = BREAK.join(f" {'-' if negative else '+'} {term}" for negative, term in terms)
        return f"-{signed[3:]}" if signed.startswith(" - ") else signed[3:]


def _variable_latex(text: str) -> str:
    r"""Return a joint's variable in LaTeX: qdd1 is \ddot{q}_{1}, c23 is c_{23}."""
    kind, number = re.fullmatch(r"(qdd|qd|q|s|c)(\d[\d_]*)", text).groups()  # type: ignore[union-attr]
    symbol = {"qdd": r"\ddot{q}", "qd": r"\dot{q}"}.get(kind, kind)
    return f"{symbol}_{{{number.replace('_', ',')}}}"


def latex_text(element: Element) -> str:
    r"""Return an element in LaTeX, in one line.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.symbolic.exact.lagrangian import lagrangian
    >>> print(latex_text(lagrangian(library_robot("planar2r")).M[1, 1]))
    \tfrac{1}{3} m_{2} l_{2}^{2}
    """
    return marked_latex(element).replace(BREAK, "")


def latex_lines(element: Element, room: float) -> list[str]:
    """Return an element in LaTeX as lines of about ``room`` em at most, broken before terms."""
    return _lines(marked_latex(element), int(SYMBOLS_PER_EM * room))


def displays(quantities: Sequence[Quantity]) -> list[str]:
    """Return displayed equations: matrices that fit a line as such, others entry by entry; then the angles of c_{23}.

    Raises
    ------
    RingError
        An entry is too long to be read.
    """
    check_length(quantities)
    shown = []
    for quantity in quantities:
        matrix = matrix_latex(quantity)
        shown.append(
            f"\\begin{{equation*}}\n{matrix}\n\\end{{equation*}}" if matrix else _entries(quantity)
        )
    angles = angles_of(generators_of(elements_of(quantities)))
    if angles:
        shown.append(_where(angles))
    return shown


def equations_latex(quantities: Sequence[Quantity]) -> str:
    """Return quantities in LaTeX, for a page that loads amsmath; see :func:`displays`."""
    notes = [f"% {escaped(note)}" for note in renamings(elements_of(quantities))]
    return "\n".join([*displays(quantities), *notes]) + "\n"


def constant_latex(ring: Ring, name: str) -> str:
    """Return a constant's name in LaTeX."""
    return constant_typeset(ring, name).latex


def constant_typeset(ring: Ring, name: str) -> TypesetName:
    """Return a constant's name as a symbol with subscripts."""
    return typeset_constants(ring)[notation(ring)(name)]


def marked_latex(element: Element) -> str:
    """Return an element in LaTeX with marks at which lines may be broken."""
    printer = Printer(element.ring.generators, _writer(element.ring))
    return printer.sum(collected(element))


@lru_cache(maxsize=64)
def _writer(ring: Ring) -> LatexWriter:
    """Return the writer of a ring's elements."""
    latex = {name: typeset.latex for name, typeset in typeset_constants(ring).items()}
    return LatexWriter(latex, notation(ring))


@lru_cache(maxsize=64)
def typeset_constants(ring: Ring) -> dict[str, TypesetName]:
    """Return the constants of a ring as symbols, by their printed names; none looks like a variable or an entry."""
    taken = {_variable_latex(name) for name in variables(ring)}
    taken |= {head_latex(name) for name in entry_names(ring.n)}
    return typeset_names(notation(ring).names.values(), taken)


def matrix_latex(quantity: Quantity) -> str:
    """Return an equation of a matrix or a column in brackets; empty if it is wider than a line, or a scalar."""
    if not quantity.elements.ndim or quantity.labels:
        return ""
    table = quantity.elements.reshape(len(quantity.elements), -1)
    if sum(len(element) for element in table.flat) > 40 * table.shape[1]:
        return ""

    cells = np.empty(table.shape, dtype=object)
    symbols = np.empty(table.shape, dtype=int)
    for place, element in np.ndenumerate(table):
        cell = latex_text(element)
        cells[place] = cell
        symbols[place] = symbols_wide(cell)

    head = _WHOLE.get(quantity.name) or _HEADS.get(quantity.name) or head_latex(quantity.name)
    width_of_columns = int(symbols.max(axis=0).sum())
    gaps = SYMBOLS_PER_EM * (table.shape[1] + 1)  # an em between columns, and for each bracket
    if symbols_wide(f"{head} =") + width_of_columns + gaps > _LINE:
        return ""

    rows = cells.tolist()
    body = " \\\\\n".join(" & ".join(row) for row in rows)
    return f"{head} = \\begin{{pmatrix}}\n{body}\n\\end{{pmatrix}}"


def _entries(quantity: Quantity) -> str:
    """Return the entries one after another, broken over lines."""
    heads: list[str] = []
    elements: list[Element] = []
    for names, element in quantity.entries:
        heads.append(" = ".join(head_latex(name) for name in names))
        elements.append(element)

    lines: list[str] = []
    room = _LINE - max((symbols_wide(f"{head} =") for head in heads), default=0)
    for head, element in zip(heads, elements, strict=True):
        first, *more = _lines(marked_latex(element), room)
        lines += [f"{head} &= {first}", *(f"&{_INDENT}{line}" for line in more)]

    zeros = [head_latex(name) for name in quantity.zeros]
    if len(zeros) == 1:
        lines.append(f"{zeros[0]} &= 0")
    else:
        rows = [" = ".join(zeros[k : k + _ZEROS]) for k in range(0, len(zeros), _ZEROS)]
        lines += ["&" + row + " = 0" for row in rows]
    body = " \\\\\n".join(lines)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def head_latex(name: str) -> str:
    r"""Return the name of a quantity or an entry in LaTeX: M12 is M_{12}, A1_12 is (A_{1})_{12}."""
    link = re.fullmatch(r"A(\d+)_(\d+)", name)
    if link:
        return rf"(A_{{{link[1]}}})_{{{link[2]}}}"

    letters, number = re.fullmatch(r"([A-Za-z]+)([\d_]*)", name).groups()  # type: ignore[union-attr]
    symbol = letters if len(letters) == 1 else rf"\mathit{{{letters}}}"
    head = _HEADS.get(letters, symbol)
    subscript = number.replace("_", ",")
    return f"{head}_{{{subscript}}}" if subscript else head


def symbols_wide(latex: str) -> int:
    """Count the symbols side by side: a sign counts for three with its space, a fraction as its longer part."""
    latex = _FRACTION.sub(lambda match: max(match.groups(), key=symbols_wide), latex)
    latex = latex.replace(r"\qquad", "xxxx")
    latex = _INVISIBLE.sub("", latex)
    latex = re.sub(r"\\(?:[A-Za-z]+|.)", "x", latex)
    latex = re.sub(r"[\s{}_^]", "", latex)
    return len(latex) + 2 * len(re.findall(r"[-+=]", latex))


def _lines(marked: str, room: int) -> list[str]:
    """Break a sum before terms, and inside those that are longer than a line."""
    pieces = marked.split(BREAK)
    starts = line_starts(marked, room)
    return ["".join(pieces[a:b]).strip() for a, b in pairwise([*starts, len(pieces)])]


def line_starts(marked: str, room: float) -> list[int]:
    """Return which of the pieces between marks begin a line: terms, and pieces of terms that are longer than a line.

    Parameters
    ----------
    marked
        A sum in LaTeX with marks at which lines may be broken.
    room
        Length of a line in symbols.
    """
    starts = [0]
    line = ""
    at = 0
    for term in _terms(marked):
        whole = "".join(term)
        if symbols_wide(line + whole) <= room:
            line += whole
        elif line and symbols_wide(whole) <= room:
            # A line of its own.
            starts.append(at)
            line = whole
        else:
            for k, piece in enumerate(term):
                if line and symbols_wide(line + piece) > room:
                    starts.append(at + k)
                    line = ""
                line += piece
        at += len(term)
    return starts


def _terms(marked: str) -> list[list[str]]:
    """Split a sum before the signs outside of brackets: the pieces between marks of each term."""
    terms: list[list[str]] = []
    depth = 0
    for piece in marked.split(BREAK):
        if depth == 0:
            terms.append([])
        terms[-1].append(piece)
        depth += piece.count("(") - piece.count(")")
    return terms


def _where(angles: Sequence[SineOrCosine]) -> str:
    """Return the angles of the sines and cosines."""
    definitions: list[str] = []
    if any(len(angle.joints) == 1 for angle in angles):
        definitions += [r"s_{i} = \sin(q_{i})", r"c_{i} = \cos(q_{i})"]
    for angle in angles:
        if len(angle.joints) > 1:
            total = " + ".join(f"q_{{{joint + 1}}}" for joint in angle.joints)
            definitions.append(f"{_variable_latex(angle.name)} = \\{angle.function}({total})")

    lines: list[str] = []
    for definition in definitions:
        if lines and symbols_wide(f"{lines[-1]},{_INDENT}{definition}") <= _LINE:
            lines[-1] += f",{_INDENT}{definition}"
        else:
            lines.append(f"&{definition}")
    return "\\begin{align*}\n" + ", \\\\\n".join(lines) + "\n\\end{align*}"


def _spaced(factors: Sequence[str]) -> str:
    """Return factors one after another, with a thin space around names of several letters."""
    text = factors[0]
    for before, factor in pairwise(factors):
        is_word = any(name.startswith((r"\mathrm", r"\mathit")) for name in (before, factor))
        text += (r"\, " if is_word else " ") + factor
    return text


def _number(value: Fraction) -> str:
    """Return a rational number in LaTeX."""
    if value.denominator == 1:
        return str(value.numerator)
    return rf"\tfrac{{{value.numerator}}}{{{value.denominator}}}"


def _scientific(decimal: str) -> str:
    r"""Return a decimal in LaTeX: 1e-9 is 1\times 10^{-9}."""
    mantissa, _, exponent = decimal.partition("e")
    return rf"{mantissa}\times 10^{{{int(exponent)}}}" if exponent else mantissa


def _bracketed(inner: str) -> str:
    """Return a text in brackets of its height, inside which lines may be broken."""
    if "\\bigl(" in inner:
        return rf"\Bigl({inner}\Bigr)"
    return rf"\bigl({inner}\bigr)" if "(" in inner or "frac" in inner else f"({inner})"


def _without_brackets(text: str) -> str:
    """Return a text without the brackets around all of it, if it has any."""
    match = re.fullmatch(r"(?:\\[bB]igl)?\((.*?)(?:\\[bB]igr)?\)", text, re.DOTALL)
    if match is None:
        return text
    depth = 0
    for sign in re.findall(r"[()]", match[1]):
        depth += 1 if sign == "(" else -1
        if depth < 0:
            return text
    return match[1]
