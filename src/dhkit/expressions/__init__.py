"""Arithmetic and trigonometric text, read without ever evaluating it, and the exact numbers it stands for."""

from dhkit.expressions.exact import PI, ZERO, Atom, Expression, exact, exact_angle
from dhkit.expressions.functions import FUNCTIONS, arc_tangent, call, cos, sin, sqrt, substitute
from dhkit.expressions.parser import CONSTANTS, Budget, parse
from dhkit.expressions.syntax import decimal_fraction, read

__all__ = [
    "CONSTANTS",
    "FUNCTIONS",
    "PI",
    "ZERO",
    "Atom",
    "Budget",
    "Expression",
    "arc_tangent",
    "call",
    "cos",
    "decimal_fraction",
    "exact",
    "exact_angle",
    "parse",
    "read",
    "sin",
    "sqrt",
    "substitute",
]
