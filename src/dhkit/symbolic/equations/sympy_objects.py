"""Equations as sympy objects in symbols q1, qd1, m2 without assumptions.

They are not simplified, because that would take minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.quantities import Quantity
from dhkit.symbolic.equations.writing import Printer
from dhkit.symbolic.ring import Element, Generator
from dhkit.symbolic.ring.notation import Notation, notation

_SYMPY_NAMES = {"abs": "Abs"}
"""Functions that have another name in sympy."""


class SympyWriter:
    """Builds sympy expressions; see :class:`dhkit.symbolic.equations.writing.Writer` for the meaning of its methods.

    ``names`` gives constants that would have a variable's name another one.
    """

    def __init__(self, names: Notation) -> None:
        import sympy

        self._sympy = sympy
        self._names = names

    def symbol(self, name: str) -> Any:  # noqa: D102 - see Writer
        return self._sympy.Symbol(self._names(name))

    def variable(self, generator: Generator) -> Any:  # noqa: D102
        if not generator.joints:  # a rate, an acceleration, or the position of a prismatic joint
            return self._sympy.Symbol(generator.text)
        # The sine or cosine of a sum of joint angles.
        angle = self._sympy.Add(
            *(self._sympy.Symbol(f"q{joint + 1}") for joint in generator.joints)
        )
        return self._sympy.sin(angle) if generator.kind == "sine" else self._sympy.cos(angle)

    def pi(self) -> Any:  # noqa: D102
        return self._sympy.pi

    def call(self, function: str, arguments: Sequence[Any]) -> Any:  # noqa: D102
        return getattr(self._sympy, _SYMPY_NAMES.get(function, function))(*arguments)

    def power(self, base: Any, exponent: int) -> Any:  # noqa: D102
        return base**exponent

    def brackets(self, inner: Any) -> Any:  # noqa: D102
        return inner  # an expression tree needs none

    def product(  # noqa: D102
        self, coefficient: Fraction, numerator: Sequence[Any], denominator: Sequence[Any]
    ) -> Any:
        number = self._sympy.Rational(coefficient.numerator, coefficient.denominator)
        return self._sympy.Mul(number, *numerator, *(divisor**-1 for divisor in denominator))

    def total(self, terms: Sequence[tuple[bool, Any]]) -> Any:  # noqa: D102
        return self._sympy.Add(*(-term if negative else term for negative, term in terms))


def sympy_object(element: Element) -> Any:
    """Return an element as a sympy expression.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.symbolic.exact.lagrangian import lagrangian
    >>> sympy_object(lagrangian(library_robot("planar2r")).M[1, 1])
    l2**2*m2/3
    """
    ring = element.ring
    printer: Printer[Any] = Printer(ring.generators, SympyWriter(notation(ring)))
    return printer.sum(collected(element))


def equations_sympy(quantities: Sequence[Quantity]) -> dict[str, object]:
    """Return matrices (``sympy.Matrix``; vectors are columns), and expressions of K, V and L, by name."""
    import sympy

    found = {}
    for quantity in quantities:
        # vectorize also takes an array without axes, that of a scalar.
        entries = np.vectorize(sympy_object, otypes=[object])(quantity.elements)
        found[quantity.name] = (
            sympy.Matrix(entries.tolist()) if quantity.elements.ndim else entries.item()
        )
    return found
