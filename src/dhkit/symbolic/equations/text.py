"""Equations as plain text; :func:`dhkit.expressions.parse` reads each right-hand side that is written out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.quantities import Quantity, check_length, elements_of
from dhkit.symbolic.equations.writing import Printer, readable_decimal
from dhkit.symbolic.ring import Element, Generator
from dhkit.symbolic.ring.notation import Notation, angles_of, generators_of, notation, renamings

WIDTH = 100
"""Columns of a line."""
_INDENT = "      "
_SHOWN_TERMS = 12
"""Number of terms printed of an element that is too long to read."""
_READABLE = 2_000
"""Largest number of terms of an element that is collected for a message."""


class TextWriter:
    """Writes text with ``*``, ``/`` and ``^``."""

    def __init__(self, names: Notation) -> None:
        self._names = names

    def symbol(self, name: str) -> str:  # noqa: D102 - see Writer
        return self._names(name)

    def variable(self, generator: Generator) -> str:  # noqa: D102
        return generator.text

    def pi(self) -> str:  # noqa: D102
        return "pi"

    def call(self, function: str, arguments: Sequence[str]) -> str:  # noqa: D102
        return f"{function}({', '.join(arguments)})"

    def power(self, base: str, exponent: int) -> str:  # noqa: D102
        return f"{base}^{exponent}"

    def brackets(self, inner: str) -> str:  # noqa: D102
        return f"({inner})"

    def product(  # noqa: D102
        self, coefficient: Fraction, numerator: Sequence[str], denominator: Sequence[str]
    ) -> str:
        factors = list(numerator)
        divisors = list(denominator)
        decimal = readable_decimal(coefficient)
        if decimal is not None:
            factors.insert(0, decimal)
        else:
            if coefficient.numerator != 1 or not numerator:
                factors.insert(0, str(coefficient.numerator))
            if coefficient.denominator != 1:
                divisors.insert(0, str(coefficient.denominator))
        return "*".join(factors) + "".join(f"/{divisor}" for divisor in divisors)

    def total(self, terms: Sequence[tuple[bool, str]]) -> str:  # noqa: D102
        signed = "".join(f" {'-' if negative else '+'} {term}" for negative, term in terms)
        return f"-{signed[3:]}" if signed.startswith(" - ") else signed[3:]


def plain_text(element: Element) -> str:
    """Return an element as text; if it is too long to read, its first terms and their number.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.symbolic.exact.lagrangian import lagrangian
    >>> plain_text(lagrangian(library_robot("planar2r")).M[0, 0])
    'm1*l1^2/3 + m2*(l1^2 + l2^2/3 + l1*l2*c2)'
    """
    ring = element.ring
    printer = Printer(ring.generators, TextWriter(notation(ring)))
    if len(element) <= _READABLE:
        return printer.sum(collected(element))
    first = dict(list(element.terms.items())[:_SHOWN_TERMS])
    return f"{printer.sum(collected(ring.from_terms(first)))} + ... ({len(element)} terms)"


def equations_text(quantities: Sequence[Quantity]) -> str:
    """Return quantities as text, entry by entry, followed by the angles of their sines and cosines.

    Raises
    ------
    RingError
        An entry is too long to be read.
    """
    check_length(quantities)
    blocks = ["\n".join(_entry_lines(quantity)) for quantity in quantities]
    elements = elements_of(quantities)
    angles = [
        f"{angle.name} = {angle.function}({angle.text})"
        for angle in angles_of(generators_of(elements))
    ]
    if angles:
        blocks.append("\n".join(_filled_lines("where ", angles)))
    notes = renamings(elements)
    if notes:
        blocks.append("\n".join(f"note: {note}" for note in notes))
    return "\n\n".join(blocks)


def _entry_lines(quantity: Quantity) -> list[str]:
    """Return the lines of a quantity's entries; those that are zero share lines."""
    lines: list[str] = []
    for heads, element in quantity.entries:
        lines += broken_lines(f"{' = '.join(heads)} = ", plain_text(element))
    if quantity.zeros:
        lines += _filled_lines("", [f"{head} =" for head in quantity.zeros], "0", separator=" ")
    return lines


def broken_lines(head: str, text: str) -> list[str]:
    """Return a sum after a head, broken before terms, and inside those that are longer than a line."""
    lines = []
    line = head
    for term in _terms(text):
        room = WIDTH - len(line)
        if len(term) <= room:
            line += term
        elif len(_INDENT) + len(term) <= WIDTH and line != head:
            lines.append(line)
            line = _INDENT + term.lstrip()
        else:
            for piece in re.split(r"(?= [+-] )", term):
                if len(line) + len(piece) > WIDTH:
                    lines.append(line)
                    line = _INDENT + piece.lstrip()
                else:
                    line += piece
    return [*lines, line]


def _terms(text: str) -> list[str]:
    """Split a sum before the signs outside of brackets."""
    terms = [""]
    depth = 0
    for piece in re.split(r"(?= [+-] )", text):
        if depth == 0:
            terms.append("")
        terms[-1] += piece
        depth += piece.count("(") - piece.count(")")
    return [term for term in terms if term]


def _filled_lines(
    head: str, words: Sequence[str], tail: str = "", separator: str = ", "
) -> list[str]:
    """Return words after a head, with as many on a line as it holds."""
    following = list(words[1:])
    if tail:
        following.append(tail)

    lines = []
    line = head + words[0]
    for word in following:
        if len(line) + len(separator) + len(word) > WIDTH:
            lines.append(line + separator.rstrip())
            line = _INDENT + word
        else:
            line += separator + word
    return [*lines, line]
