"""Bounds on exact work: the ring's products, and the derivations that use them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes of exact work; larger work raises a RingError, or a less exact way is taken."""

    terms: int = 300_000
    """Largest number of terms of a product: ten times that of the library's longest (Jaco, symbols="inertial")."""
    pairs: int = 500_000
    """Largest number of pairs of terms in one multiplication: six times the Jaco's, some seconds in sympy's rings."""
    angle_multiple: int = 8
    """Largest multiple of an angle that is expanded into powers of the angle's own cosine and sine."""
    inertial_terms: int = 60_000
    """Largest number of terms of M in all inertial parameters: three times the Jaco's, a minute in sympy's rings."""
    angle_choices: int = 24
    """Largest number of choices of angles that are tried for an entry, to write it with fewer terms."""


BOUNDS = Bounds()
