"""Bounds on mathematical text, and on the exact numbers that it is worked out to."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes of an expression; larger ones raise an ExpressionError that names the bound."""

    characters: int = 10_000
    """Characters of an expression: longer than any derivation that a person types."""
    nesting: int = 50
    """Depth of brackets, signs and powers inside one another."""
    digits: int = 400
    """Digits of a number, and its decimal exponent: no finite double has more."""
    terms: int = 2_000
    """Terms of a sum; the longest entry of a robot file has a few dozen."""
    exponent: int = 64
    """Whole exponent; it bounds a power's expansion and digits."""
    coefficient_bits: int = 8_192
    """Size of a coefficient in bits. Doubles need 1,100; products of 8,192 bits still take microseconds."""
    atom_characters: int = 4_000
    """Characters of a function with its arguments."""


BOUNDS = Bounds()
