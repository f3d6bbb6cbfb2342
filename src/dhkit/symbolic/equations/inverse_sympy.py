"""Derivations of inverse kinematics as sympy objects."""

from __future__ import annotations

from typing import Any

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.sympy_objects import SympyWriter
from dhkit.symbolic.equations.writing import Printer
from dhkit.symbolic.inverse.derivation import InverseDerivation
from dhkit.symbolic.inverse.forms import (
    Circle,
    CosineAndSquare,
    Direction,
    Flip,
    Form,
    Line,
    Remainder,
    Sliding,
    Square,
)
from dhkit.symbolic.ring import Element, Generator
from dhkit.symbolic.ring.notation import notation


class _Writer(SympyWriter):
    """Writes sines and cosines of the table's angles theta1, theta2 ..."""

    def variable(self, generator: Generator) -> Any:
        if generator.kind not in ("sine", "cosine"):
            return super().variable(generator)
        angle = self._sympy.Symbol(f"theta{generator.joint + 1}")
        return self._sympy.sin(angle) if generator.kind == "sine" else self._sympy.cos(angle)


def inverse_sympy(derivation: InverseDerivation) -> dict[str, Any]:
    """Return sympy expressions.

    Returns
    -------
    dict
        Defined quantities by name (wx, x, c23 as cphi ...): expressions; unknowns by name (theta1, q3, phi): tuples of
        solutions; ``"equations"``: tuples of ``sympy.Eq`` by unknown. All in theta1 ... and the entries of the pose.
    """
    import sympy

    ring = derivation.chain.ring
    printer: Printer[Any] = Printer(ring.generators, _Writer(notation(ring)))

    def expression(element: Element) -> Any:
        return printer.sum(collected(element))

    found: dict[str, Any] = {"equations": {}}
    for step in derivation.steps:
        for definition in step.definitions:
            found[definition.name] = expression(definition.element)
        if step.form is not None:
            name = step.form.unknown.name
            letters = {letter: expression(element) for letter, element in step.form.letters.items()}
            found[name] = tuple(_solutions(sympy, step.form, letters))
            equations = []
            for left, right in step.form.equations:
                equations.append(sympy.Eq(expression(left), expression(right), evaluate=False))
            found["equations"][name] = tuple(equations)
    return found


def _solutions(sympy: Any, form: Form, known: dict[str, Any]) -> list[Any]:
    """Return the solutions of a form, from the values of its letters."""
    atan2 = sympy.atan2
    sqrt = sympy.sqrt
    if isinstance(form, Remainder):
        return [sympy.Add(*(sign * sympy.Symbol(name) for name, sign in form.terms))]
    if isinstance(form, Sliding):
        return [known["Z"]]
    if isinstance(form, Circle):
        A, B, C = (known[k] for k in "ABC")
        difference = atan2(sqrt(A**2 + B**2 - C**2), C)
        return [atan2(B, A) + difference, atan2(B, A) - difference]
    if isinstance(form, Square):
        M, S = (known[k] for k in "MS")
        return [-M + sqrt(S), -M - sqrt(S)]
    if isinstance(form, CosineAndSquare):
        X, S = (known[k] for k in "XS")
        return [atan2(sqrt(S), X), atan2(-sqrt(S), X)]
    if isinstance(form, Line | Flip):
        X, Y = (known[k] for k in "XY")
        return [atan2(Y, X), atan2(-Y, -X)]
    if isinstance(form, Direction):
        k, X, Y = (known[letter] for letter in "kXY")
        return [atan2(k * Y, k * X)]

    # Turned
    U, V, X, Y = (known[k] for k in "UVXY")
    return [atan2(U * Y - V * X, U * X + V * Y)]
