"""Syntax trees as text and as LaTeX, to show a student how an entry was read."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import reduce
from typing import NamedTuple

from dhkit.expressions.syntax import Call, Name, Number, Power, Tree
from dhkit.expressions.trees import Algebra, node_count, parts_of
from dhkit.symbolic.equations.latex_names import latex_names

_MAX_NODES = 600
"""Largest number of nodes of an entry that is typeset: a longer one fills a page."""

_VARIABLE = re.compile(r"(qdd|qd|q)(\d+)")
_LATEX_FUNCTIONS = {"asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan"}
_LATEX_NAMES = ("sin", "cos", "tan", "exp", "min", "max")
_LATEX_MARKS = {"qdd": r"\ddot{q}", "qd": r"\dot{q}", "q": "q"}
_SUM = 0
_PRODUCT = 1
_POWER = 2
_ATOM = 3
"""Binding strengths of operations: a weaker one stands in brackets inside a stronger one."""


def typeset(tree: Tree) -> tuple[str, str]:
    r"""Return a tree as plain text and as LaTeX, in the robot's own names; both empty where it is too long.

    Examples
    --------
    >>> from dhkit.expressions import read
    >>> typeset(read("m1/2*cos(q1)^2"))
    ('m1/2*cos(q1)^2', '\\frac{m_{1}}{2} \\cos(q_{1})^{2}')
    """
    if node_count(tree, _MAX_NODES) > _MAX_NODES:
        return "", ""
    names = {part.text for part in parts_of(tree) if isinstance(part, Name)}
    symbols = latex_names([name for name in names if not _VARIABLE.fullmatch(name)])
    text = _Writer(str, _plain_call, _plain_product, lambda base, exponent: f"{base}^{exponent}")
    latex = _Writer(
        lambda name: _latex_name(name, symbols), _latex_call, _latex_product, _latex_power
    )
    return text.of(tree).text, latex.of(tree).text


def typeset_equations(equations: Sequence[tuple[Tree, Tree]]) -> tuple[str, str]:
    r"""Return equations, pairs of their sides, as plain text and as LaTeX; both empty where one is too long.

    Examples
    --------
    >>> from dhkit.expressions import read
    >>> typeset_equations([(read("q1"), read("atan2(py, px)")), (read("q2"), read("pz"))])
    ('q1 = atan2(py, px); q2 = pz', 'q_{1} = \\mathrm{atan2}(p_{y}, p_{x}), \\quad q_{2} = p_{z}')
    """
    plain = []
    latex = []
    for left, right in equations:
        left_text, left_latex = typeset(left)
        right_text, right_latex = typeset(right)
        if not left_text or not right_text:
            return "", ""
        plain.append(f"{left_text} = {right_text}")
        latex.append(f"{left_latex} = {right_latex}")
    return "; ".join(plain), r", \quad ".join(latex)


class _Text(NamedTuple):
    """A part of a formula as text, and how tightly its operation binds: _SUM, _PRODUCT, _POWER or _ATOM."""

    text: str
    level: int

    def inside(self, around: int) -> str:
        """Return the text inside another operation, in brackets where it binds less tightly."""
        return self.text if self.level >= around else f"({self.text})"


class _Writer(Algebra[_Text]):
    """One notation, made of how it writes names, calls, products and powers."""

    def __init__(
        self,
        write_name: Callable[[str], str],
        write_call: Callable[[str, Sequence[str]], str],
        write_product: Callable[[Sequence[tuple[bool, _Text]]], str],
        write_power: Callable[[str, str], str],
    ) -> None:
        super().__init__()
        self._write_name = write_name
        self._write_call = write_call
        self._write_product = write_product
        self._write_power = write_power

    def number(self, tree: Number) -> _Text:
        return _Text(tree.text, _ATOM)

    def name(self, tree: Name) -> _Text:
        return _Text(self._write_name(tree.text), _ATOM)

    def call(self, tree: Call) -> _Text:
        return _Text(
            self._write_call(tree.function, [self.of(one).text for one in tree.arguments]), _ATOM
        )

    def power(self, tree: Power) -> _Text:
        base = self.of(tree.base)
        exponent = self.of(tree.exponent)
        return _Text(self._write_power(base.inside(_ATOM), exponent.inside(_ATOM)), _POWER)

    def product(self, factors: Sequence[tuple[bool, _Text]]) -> _Text:
        return _Text(self._write_product(factors), _PRODUCT)

    def sum(self, terms: Sequence[tuple[bool, _Text]]) -> _Text:
        signed = "".join(
            f" + {one.text}" if added else f" - {one.inside(_PRODUCT)}" for added, one in terms
        )
        return _Text(signed[3:] if signed.startswith(" + ") else f"-{signed[3:]}", _SUM)


def _plain_call(function: str, arguments: Sequence[str]) -> str:
    return f"{function}({', '.join(arguments)})"


def _plain_product(factors: Sequence[tuple[bool, _Text]]) -> str:
    text = "" if factors[0][0] else "1"
    for multiplied, factor in factors:
        if not multiplied:
            text += f"/{factor.inside(_POWER)}"  # brackets around a product: a/(b*c)
        elif text:
            text += f"*{factor.inside(_PRODUCT)}"
        else:
            text = factor.inside(_PRODUCT)
    return text


def _latex_name(name: str, symbols: dict[str, str]) -> str:
    if match := _VARIABLE.fullmatch(name):
        return f"{_LATEX_MARKS[match[1]]}_{{{match[2]}}}"
    return r"\pi" if name == "pi" else symbols[name]


def _latex_call(function: str, arguments: Sequence[str]) -> str:
    if function == "sqrt":
        return rf"\sqrt{{{arguments[0]}}}"
    name = rf"\{function}" if function in _LATEX_NAMES else rf"\mathrm{{{function}}}"
    return f"{_LATEX_FUNCTIONS.get(function, name)}({', '.join(arguments)})"


def _latex_product(factors: Sequence[tuple[bool, _Text]]) -> str:
    """Write a product from left to right: a factor after a division stands beside the fraction, a/b*c."""
    text = ""
    above: list[str] = []
    for multiplied, part in factors:
        factor = part.inside(_PRODUCT)
        if multiplied:
            above.append(factor)
        else:
            numerator = reduce(_join, above, text) or "1"
            text = rf"\frac{{{numerator}}}{{{factor}}}"
            above = []
    return reduce(_join, above, text)


def _join(left: str, right: str) -> str:
    if not left or not right:
        return left or right
    return rf"{left} \cdot {right}" if right[0].isdigit() else f"{left} {right}"


def _latex_power(base: str, exponent: str) -> str:
    inner = exponent[1:-1] if exponent.startswith("(") and exponent.endswith(")") else exponent
    return f"{base}^{{{inner}}}"
