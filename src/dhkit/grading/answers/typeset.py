"""Syntax trees as text and as LaTeX, to show a student how an entry was read."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.grading.judging.numeric import parts_of
from dhkit.symbolic.equations.latex_names import latex_names

MAX_NODES = 600
"""Nodes of an entry that is typeset: a longer one fills a page."""
VARIABLE = re.compile(r"(qdd|qd|q)(\d+)")
LATEX_FUNCTIONS = {"asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan"}
LATEX_MARKS = {"qdd": r"\ddot{q}", "qd": r"\dot{q}", "q": "q"}
SUM, PRODUCT, POWER = 0, 1, 2
"""How tightly what surrounds a part binds."""


def typeset(tree: Tree) -> tuple[str, str]:
    r"""Return a tree as plain text and as LaTeX, in the robot's own names; both empty where it is too long.

    Examples
    --------
    >>> from dhkit.expressions import read
    >>> typeset(read("m1/2*cos(q1)^2"))
    ('m1/2*cos(q1)^2', '\\frac{m_{1}}{2} \\cos(q_{1})^{2}')
    """
    if _size(tree, MAX_NODES) > MAX_NODES:
        return "", ""
    names = {part.text for part in parts_of(tree) if isinstance(part, Name)}
    symbols = latex_names([name for name in names if not VARIABLE.fullmatch(name)])
    text = _Writer(_plain_name, _plain_call, _plain_product, lambda a, b: f"{a}^{b}")
    latex = _Writer(lambda name: _latex_name(name, symbols), _latex_call, _latex_product, _latex_power)
    return text.of(tree, SUM), latex.of(tree, SUM)


def _size(tree: Tree, most: int) -> int:
    """Return how many nodes are written, those that are shared each time; counting ends beyond the most."""
    count, left = 0, [tree]
    while left and count <= most:
        part = left.pop()
        count += 1
        match part:
            case Sum(parts) | Product(parts):
                left += [inner for _, inner in parts]
            case Power(base, exponent):
                left += [base, exponent]
            case Call(_, arguments):
                left += arguments
    return count


@dataclass(frozen=True)
class _Writer:
    """One notation."""

    name: Callable[[str], str]
    call: Callable[[str, Sequence[str]], str]
    product: Callable[[Sequence[tuple[bool, str]]], str]
    power: Callable[[str, str], str]

    def of(self, tree: Tree, around: int) -> str:
        match tree:
            case Number(text=text):
                return text
            case Name(text):
                return self.name(text)
            case Call(function, arguments):
                return self.call(function, [self.of(argument, SUM) for argument in arguments])
            case Power(base, exponent):
                return self.power(self.of(base, POWER), self.of(exponent, POWER))
            case Product(factors):
                written = self.product([(multiplied, self.of(factor, PRODUCT)) for multiplied, factor in factors])
                return f"({written})" if around == POWER else written
            case Sum(terms):
                signed = "".join(
                    f" {'+' if added else '-'} {self.of(term, PRODUCT if not added else SUM)}" for added, term in terms
                )
                written = signed[3:] if signed.startswith(" + ") else f"-{signed[3:]}"
                return f"({written})" if around != SUM else written


def _plain_name(name: str) -> str:
    return name


def _plain_call(function: str, arguments: Sequence[str]) -> str:
    return f"{function}({', '.join(arguments)})"


def _plain_product(factors: Sequence[tuple[bool, str]]) -> str:
    written = factors[0][1] if factors[0][0] else f"1/{_single(factors[0][1])}"
    for multiplied, factor in factors[1:]:
        written += f"*{factor}" if multiplied else f"/{_single(factor)}"
    return written


def _single(factor: str) -> str:
    """Return a divisor in brackets where it is a product itself."""
    return f"({factor})" if re.search(r"[*/]", re.sub(r"\([^()]*\)", "", factor)) else factor


def _latex_name(name: str, symbols: dict[str, str]) -> str:
    match = VARIABLE.fullmatch(name)
    if match:
        return f"{LATEX_MARKS[match[1]]}_{{{match[2]}}}"
    return r"\pi" if name == "pi" else symbols[name]


def _latex_call(function: str, arguments: Sequence[str]) -> str:
    if function == "sqrt":
        return rf"\sqrt{{{arguments[0]}}}"
    if function in ("sin", "cos", "tan", "exp", "min", "max"):
        head = rf"\{function}"
    else:
        head = LATEX_FUNCTIONS.get(function, rf"\mathrm{{{function}}}")
    return f"{head}({', '.join(arguments)})"


def _latex_product(factors: Sequence[tuple[bool, str]]) -> str:
    """Write a product from left to right: what follows a division is a factor of the fraction."""
    written = ""
    above: list[str] = []
    for multiplied, factor in factors:
        if multiplied:
            above.append(factor)
            continue
        dividend = " ".join(above) or "1"
        written = rf"\frac{{{_joined(written, dividend)}}}{{{factor}}}"
        above = []
    return _joined(written, " ".join(above))


def _joined(left: str, right: str) -> str:
    if not left or not right:
        return left or right
    return rf"{left} \cdot {right}" if right[0].isdigit() else f"{left} {right}"


def _latex_power(base: str, exponent: str) -> str:
    inner = exponent[1:-1] if exponent.startswith("(") and exponent.endswith(")") else exponent
    return f"{base}^{{{inner}}}"
