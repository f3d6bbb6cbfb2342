"""Arithmetic and trigonometric text, read without ever evaluating it, and the exact numbers it stands for."""

from dhkit.expressions.budget import Budget
from dhkit.expressions.exact import PI, PI_DIGITS, ZERO, Atom, Expression
from dhkit.expressions.functions import (
    FUNCTIONS,
    arc_tangent,
    call,
    cos,
    decimals,
    settled,
    sin,
    sqrt,
    substitute,
)
from dhkit.expressions.numbers import exact, exact_angle
from dhkit.expressions.parser import CONSTANTS, parse
from dhkit.expressions.syntax import decimal_fraction, read

__all__ = [
    "CONSTANTS",
    "FUNCTIONS",
    "PI",
    "PI_DIGITS",
    "ZERO",
    "Atom",
    "Budget",
    "Expression",
    "arc_tangent",
    "call",
    "cos",
    "decimal_fraction",
    "decimals",
    "exact",
    "exact_angle",
    "parse",
    "read",
    "settled",
    "sin",
    "sqrt",
    "substitute",
]
