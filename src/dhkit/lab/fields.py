"""Fields of a request: what a page sends is from outside, and every field is checked before it is used."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from dhkit.description import Array

LARGEST_JOINT_VALUE = 1e6
"""rad or m."""

LONGEST_TEXT = 200
"""Characters of a text."""


class Fields:
    """The data of a request.

    Parameters
    ----------
    request
        Its name, for messages.
    data
        What the page sent.
    known
        Names of all fields that it may have.

    Raises
    ------
    ValueError
        Another field.
    """

    def __init__(self, request: str, data: Mapping[str, Any], known: Collection[str]) -> None:
        self.request, self.data = request, data
        other = next((name for name in data if name not in known), None)
        if other is not None:
            raise ValueError(f"{request}: found field {str(other)[:40]!r}; expected {', '.join(known) or 'none'}")

    def __contains__(self, name: str) -> bool:
        return self.data.get(name) is not None

    def number(
        self, name: str, least: float = -math.inf, most: float = math.inf, default: float | None = None
    ) -> float:
        """Return a finite number.

        Raises
        ------
        ValueError
            Missing without a default, no number, or out of bounds; so too below.
        """
        value = self.data.get(name, default)
        if not _is_number(value):
            raise self._wrong(name, "a finite number")
        if not least <= value <= most:
            raise self._wrong(name, f"{least:g} to {most:g}")
        return float(value)

    def whole(self, name: str, least: int, most: int) -> int:
        """Return a whole number."""
        value = self.data.get(name)
        if type(value) is not int or not least <= value <= most:
            raise self._wrong(name, f"a whole number from {least} to {most}")
        return value

    def vector(self, name: str, size: int, most: float = math.inf) -> Array:
        """Return finite numbers, shape (size,), none larger than ``most``."""
        value = self.data.get(name)
        right = isinstance(value, list) and len(value) == size
        if not right or not all(map(_is_number, value or ())):
            raise self._wrong(name, f"{size} finite numbers")
        array = np.array(value, dtype=float)
        if np.abs(array).max(initial=0.0) > most:
            raise self._wrong(name, f"numbers of at most {most:g}")
        return array

    def pose(self, name: str) -> Array:
        """Return a pose, shape (4, 4), its rotation made exact to rounding.

        Raises
        ------
        ValueError
            Not 16 finite numbers by row, or no pose.
        """
        T = self.vector(name, 16).reshape(4, 4)
        if np.abs(T[3] - [0, 0, 0, 1]).max() > ROUNDING or np.abs(T[:3, :3].T @ T[:3, :3] - np.eye(3)).max() > ROUNDING:
            raise self._wrong(name, "a pose: a rotation and a position, by row")
        if np.linalg.det(T[:3, :3]) < 0:
            raise self._wrong(name, "a right-handed frame")
        U, _, Vt = np.linalg.svd(T[:3, :3])
        exact = np.eye(4)
        exact[:3, :3], exact[:3, 3] = U @ Vt, T[:3, 3]
        return exact

    def text(self, name: str, most: int = LONGEST_TEXT) -> str:
        """Return a text."""
        value = self.data.get(name)
        if not isinstance(value, str) or len(value) > most:
            raise self._wrong(name, f"a text of at most {most} characters")
        return value

    def choice(self, name: str, options: Collection[str], default: str | None = None) -> str:
        """Return one of some texts."""
        value = self.data.get(name, default)
        if not isinstance(value, str) or value not in options:
            raise self._wrong(name, f"one of {', '.join(options)}")
        return value

    def flag(self, name: str, default: bool | None = None) -> bool:
        """Return true or false."""
        value = self.data.get(name, default)
        if not isinstance(value, bool):
            raise self._wrong(name, "true or false")
        return value

    def _wrong(self, name: str, expected: str) -> ValueError:
        return ValueError(f"{self.request}: {name} is {str(self.data.get(name))[:60]!r}; expected {expected}")


def _is_number(value: object) -> bool:
    """Whether a value is a number that a double can hold; JSON's whole numbers have any number of digits."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max  # type: ignore[arg-type]


ROUNDING = 1e-4
"""Of a rotation that has gone through a page's single precision and many small turns."""
