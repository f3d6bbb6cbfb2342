"""Bounds on motion files."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes that are read; larger ones are refused with a message that names the bound."""

    coefficients: int = 65
    """Coefficients of a polynomial; evaluating a motion takes time in proportion."""
    digits: int = 20
    """Digits of seconds or nanoseconds."""
    columns: int = 1000
    """Columns of a table."""
    yaml_nesting: int = 12
    """Depth of lists and mappings inside one another."""
    format_bytes: int = 1_000
    """Size of the text ``format`` of an archive."""


BOUNDS = Bounds()
