"""Equations in LaTeX (amsmath) that latex2mathml converts to MathML without loss."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.latex_document import escaped
from dhkit.symbolic.equations.latex_names import latex_names
from dhkit.symbolic.equations.quantities import Quantity, check_length
from dhkit.symbolic.equations.writing import Printer, readable_decimal
from dhkit.symbolic.ring import Element, Generator, Ring
from dhkit.symbolic.ring.notation import (
    Angle,
    Notation,
    angles_of,
    entry_names,
    generators_of,
    notation,
    renamings,
    variables,
)

_LINE = 62
"""Symbols of a line: one is 0.4 to 0.5 em wide, and a line of an article in 11 points is 32.8 em."""
_SYMBOLS_PER_EM = 2
_FRACTION = re.compile(r"\\t?frac\{((?:[^{}]|\{[^{}]*\})*)\}\{((?:[^{}]|\{[^{}]*\})*)\}")
_INVISIBLE = re.compile(r"\\(?:d?dot|[bB]ig[lr]|left|right|mathrm|mathit|sqrt|,|(?=(?:arc)?(?:sin|cos|tan)))")
"""Commands that print nothing beside other symbols; of a function's name, the backslash."""
_INDENT = r"\qquad "
_BREAK = "\n"
"""Marks a place in front of a sign where a line may be broken; doubled outside of brackets."""
FUNCTIONS = {"asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan", "atan2": r"\mathrm{atan2}"}
_ZEROS = 6
"""Names per line in the list of entries that are zero."""
_HEADS = {"tau": r"\tau"}
_WHOLE = {"T": "T(q)", "J": "J(q)", "M": "M(q)", "C": r"C(q,\dot{q})", "h": r"h(q,\dot{q})", "g": "g(q)"}
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
        inner = ", ".join(arguments).replace(_BREAK, "")
        if function == "sqrt":
            return rf"\sqrt{{{inner}}}"
        if function == "abs":
            return rf"\left|{inner}\right|"
        return f"{FUNCTIONS.get(function, chr(92) + function)}{_bracketed(inner)}"

    def power(self, base: str, exponent: int) -> str:  # noqa: D102
        function = re.match(r"(\\(?:sin|cos|tan))(?=[\\(])", base)
        if function:
            return f"{function[1]}^{{{exponent}}}{base[function.end() :]}"
        return f"{base}^{{{exponent}}}" if not base.startswith("\\sqrt") else f"{_bracketed(base)}^{{{exponent}}}"

    def brackets(self, inner: str) -> str:  # noqa: D102
        return _bracketed(inner)

    def product(self, coefficient: Fraction, numerator: Sequence[str], denominator: Sequence[str]) -> str:  # noqa: D102
        decimal = readable_decimal(coefficient)
        number = _number(coefficient) if decimal is None else _scientific(decimal)
        factors = list(numerator)
        if denominator:
            divisor = _without_brackets(denominator[0]) if len(denominator) == 1 else " ".join(denominator)
            dividend = factors.pop(0) if factors else number
            number = "" if dividend == number else number
            factors[:0] = [rf"\frac{{{_without_brackets(dividend)}}}{{{divisor}}}".replace(_BREAK, "")]
        if number and (number != "1" or not factors):
            factors[:0] = [number + r"\,"] if decimal and factors else [number]
        return _spaced(factors)

    def total(self, terms: Sequence[tuple[bool, str]]) -> str:  # noqa: D102
        signed = _BREAK.join(f" {'-' if negative else '+'} {term}" for negative, term in terms)
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
    return _marked(element).replace(_BREAK, "")


def latex_lines(element: Element, room: float) -> list[str]:
    """Return an element in LaTeX as lines of about ``room`` em at most, broken in front of terms."""
    return _lines(_marked(element), int(_SYMBOLS_PER_EM * room))


def displays(quantities: Sequence[Quantity]) -> list[str]:
    """Return displayed equations: matrices that fit a line as such, others entry by entry; then the angles of c_{23}.

    Raises
    ------
    RingError
        An entry is too long to be read.
    """
    check_length(quantities)
    shown = [_matrix(quantity) or _entries(quantity) for quantity in quantities]
    angles = angles_of(generators_of(_elements(quantities)))
    return shown + ([_where(angles)] if angles else [])


def equations_latex(quantities: Sequence[Quantity]) -> str:
    """Return quantities in LaTeX, for a page that loads amsmath; see :func:`displays`."""
    notes = [f"% {escaped(note)}" for note in renamings(_elements(quantities))]
    return "\n".join([*displays(quantities), *notes]) + "\n"


def constant_latex(ring: Ring, name: str) -> str:
    """Return a constant's name in LaTeX."""
    return _writer(ring).symbol(name)


def _elements(quantities: Sequence[Quantity]) -> list[Element]:
    return [element for quantity in quantities for element in quantity.elements.flat]


def _marked(element: Element) -> str:
    return Printer(element.ring.generators, _writer(element.ring)).sum(collected(element))


@lru_cache(maxsize=64)
def _writer(ring: Ring) -> LatexWriter:
    written = notation(ring)
    taken = {_variable_latex(name) for name in variables(ring)} | {_head(name) for name in entry_names(ring.n)}
    return LatexWriter(latex_names(written.names.values(), taken), written)


def _matrix(quantity: Quantity) -> str:
    """Return a matrix or a column in brackets; empty if it is wider than a line, or a scalar."""
    if not quantity.elements.ndim or quantity.labels:
        return ""
    table = quantity.elements.reshape(len(quantity.elements), -1)
    if sum(len(element) for element in table.flat) > 40 * table.shape[1]:
        return ""
    rows = [[latex_text(element) for element in row] for row in table]
    head = _WHOLE.get(quantity.name) or _HEADS.get(quantity.name) or _head(quantity.name)
    widths = [max(_symbols(row[k]) for row in rows) for k in range(table.shape[1])]
    gaps = _SYMBOLS_PER_EM * (len(widths) + 1)  # an em between columns, and for each bracket
    if _symbols(f"{head} =") + sum(widths) + gaps > _LINE:
        return ""
    body = " \\\\\n".join(" & ".join(row) for row in rows)
    return f"\\begin{{equation*}}\n{head} = \\begin{{pmatrix}}\n{body}\n\\end{{pmatrix}}\n\\end{{equation*}}"


def _entries(quantity: Quantity) -> str:
    """Return the entries one after another, broken over lines."""
    lines: list[str] = []
    entries = [(" = ".join(_head(name) for name in names), element) for names, element in quantity.entries]
    room = _LINE - max((_symbols(f"{head} =") for head, _ in entries), default=0)
    for head, element in entries:
        first, *more = _lines(_marked(element), room)
        lines += [f"{head} &= {first}", *(f"&{_INDENT}{line}" for line in more)]
    zeros = [_head(name) for name in quantity.zeros]
    if len(zeros) == 1:
        lines.append(f"{zeros[0]} &= 0")
    else:
        rows = [" = ".join(zeros[k : k + _ZEROS]) for k in range(0, len(zeros), _ZEROS)]
        lines += ["&" + row + " = 0" for row in rows]
    body = " \\\\\n".join(lines)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def _head(name: str) -> str:
    if link := re.fullmatch(r"A(\d+)_(\d+)", name):
        return rf"(A_{{{link[1]}}})_{{{link[2]}}}"
    letters, number = re.fullmatch(r"([A-Za-z]+)([\d_]*)", name).groups()  # type: ignore[union-attr]
    head = _HEADS.get(letters, letters if len(letters) == 1 else rf"\mathit{{{letters}}}")
    return head + (f"_{{{number.replace('_', ',')}}}" if number else "")


def _symbols(latex: str) -> int:
    """Count the symbols side by side: a sign counts for three with its space, a fraction as its longer part."""
    latex = _FRACTION.sub(lambda match: max(match.groups(), key=_symbols), latex)
    latex = latex.replace(r"\qquad", "xxxx")
    latex = _INVISIBLE.sub("", latex)
    latex = re.sub(r"\\(?:[A-Za-z]+|.)", "x", latex)
    latex = re.sub(r"[\s{}_^]", "", latex)
    return len(latex) + 2 * len(re.findall(r"[-+=]", latex))


def _lines(marked: str, room: int) -> list[str]:
    """Break a sum in front of terms, and inside those that are longer than a line."""
    lines = []
    line = ""
    for term in _terms(marked):
        whole = term.replace(_BREAK, "")
        if not line or _symbols(line + whole) <= room:
            pieces = [whole] if _symbols(line + whole) <= room else term.split(_BREAK)
        elif _symbols(whole) <= room:
            lines.append(line)
            line = ""
            pieces = [whole]
        else:
            pieces = term.split(_BREAK)
        for piece in pieces:
            if line and _symbols(line + piece) > room:
                lines.append(line)
                line = ""
            line += piece
    return [text.strip() for text in [*lines, line]]


def _terms(marked: str) -> list[str]:
    """Split a sum in front of the signs outside of brackets; breaks inside stay marked."""
    terms = []
    depth = 0
    for piece in marked.split(_BREAK):
        if depth == 0:
            terms.append(piece)
        else:
            terms[-1] += _BREAK + piece
        depth += piece.count("(") - piece.count(")")
    return terms


def _where(angles: Sequence[Angle]) -> str:
    """Return the angles of the sines and cosines."""
    own = [r"s_{i} = \sin(q_{i})", r"c_{i} = \cos(q_{i})"] if any(len(angle.joints) == 1 for angle in angles) else []
    sums = [
        f"{_variable_latex(angle.name)} = \\{angle.function}({' + '.join(f'q_{{{j + 1}}}' for j in angle.joints)})"
        for angle in angles
        if len(angle.joints) > 1
    ]
    lines: list[str] = []
    for definition in own + sums:
        if lines and _symbols(f"{lines[-1]},{_INDENT}{definition}") <= _LINE:
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
    if value.denominator == 1:
        return str(value.numerator)
    return rf"\tfrac{{{value.numerator}}}{{{value.denominator}}}"


def _scientific(decimal: str) -> str:
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
