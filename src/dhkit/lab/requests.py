"""Requests of a page: the methods of panels that answer them, and their fields, checked before they are used."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from dhkit.description import Array
from dhkit.lab.desk import Desk
from dhkit.lab.jobs import Jobs

JsonObject: TypeAlias = Mapping[str, object]
"""An object of JSON, as Python reads or writes it."""

MAX_JOINT_VALUE = 1e6
"""Largest joint value that a page may send, rad or m."""
MAX_TEXT_LENGTH = 200
"""Largest length of a text field in characters, unless the request allows more."""
ROTATION_TOLERANCE = 1e-4
"""Largest error of an entry of R^T R for a rotation R that a page sends: the page computes in single precision, and
adds up many small turns."""


class Fields:
    """The fields of one request.

    Parameters
    ----------
    request
        The request's name, for messages.
    data
        The object that the page sent.
    known
        Names of all fields that the request may have.

    Raises
    ------
    ValueError
        The data has another field.
    """

    def __init__(self, request: str, data: JsonObject, known: Collection[str]) -> None:
        self.request = request
        self.data = data
        unknown = next((name for name in data if name not in known), None)
        if unknown is not None:
            raise ValueError(
                f"{request}: found field {str(unknown)[:40]!r}; expected {', '.join(known) or 'none'}"
            )

    def __contains__(self, name: str) -> bool:
        return self.data.get(name) is not None

    def number(
        self,
        name: str,
        lower: float = -math.inf,
        upper: float = math.inf,
        default: float | None = None,
    ) -> float:
        """Return a finite number.

        Raises
        ------
        ValueError
            The field is missing and has no default, is not a number, or is out of bounds. The other methods raise the
            same error in the same cases.
        """
        value = self.data.get(name, default)
        if not _is_double(value):
            raise self._error(name, "a finite number")
        if not lower <= value <= upper:  # type: ignore[operator]  # a number, as was checked
            raise self._error(name, f"{lower:g} to {upper:g}")
        return float(value)  # type: ignore[arg-type]

    def integer(self, name: str, lower: int, upper: int) -> int:
        """Return an integer."""
        value = self.data.get(name)
        if type(value) is not int or not lower <= value <= upper:
            raise self._error(name, f"a whole number from {lower} to {upper}")
        return value

    def vector(self, name: str, size: int, upper: float = math.inf) -> Array:
        """Return finite numbers, shape (size,), none of a magnitude above ``upper``."""
        value = self.data.get(name)
        if not isinstance(value, list) or len(value) != size or not all(map(_is_double, value)):
            raise self._error(name, f"{size} finite numbers")
        array = np.array(value, dtype=float)
        if np.abs(array).max(initial=0.0) > upper:
            raise self._error(name, f"numbers of at most {upper:g}")
        return array

    def joint_values(self, name: str, size: int) -> Array:
        """Return joint values, shape (size,), rad and m, none of a magnitude above :data:`MAX_JOINT_VALUE`."""
        return self.vector(name, size, MAX_JOINT_VALUE)

    def pose(self, name: str) -> Array:
        """Return a pose, shape (4, 4), m, given by row; its rotation is replaced by the nearest exact one.

        Raises
        ------
        ValueError
            The field is not 16 finite numbers, or not a pose.
        """
        T = self.vector(name, 16).reshape(4, 4)
        R = T[:3, :3]
        if (
            max(np.abs(T[3] - [0, 0, 0, 1]).max(), np.abs(R.T @ R - np.eye(3)).max())
            > ROTATION_TOLERANCE
        ):
            raise self._error(name, "a pose: a rotation and a position, by row")
        if np.linalg.det(R) < 0:
            raise self._error(name, "a right-handed frame")
        U, _, Vt = np.linalg.svd(R)
        exact = np.eye(4)
        exact[:3, :3] = U @ Vt
        exact[:3, 3] = T[:3, 3]
        return exact

    def text(self, name: str, max_length: int = MAX_TEXT_LENGTH) -> str:
        """Return a text."""
        value = self.data.get(name)
        if not isinstance(value, str) or len(value) > max_length:
            raise self._error(name, f"a text of at most {max_length} characters")
        return value

    def choice(self, name: str, options: Collection[str], default: str | None = None) -> str:
        """Return a text that is one of the options."""
        value = self.data.get(name, default)
        if not isinstance(value, str) or value not in options:
            raise self._error(name, f"one of {', '.join(options)}")
        return value

    def flag(self, name: str, default: bool | None = None) -> bool:
        """Return true or false."""
        value = self.data.get(name, default)
        if not isinstance(value, bool):
            raise self._error(name, "true or false")
        return value

    def _error(self, name: str, expected: str) -> ValueError:
        return ValueError(
            f"{self.request}: {name} is {str(self.data.get(name))[:60]!r}; expected {expected}"
        )


def _is_double(value: object) -> bool:
    """Return whether a value is a number that a double can hold: integers of JSON have any number of digits."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max  # type: ignore[arg-type]


@dataclass(frozen=True)
class RequestHandler:
    """A method of a panel that answers a request."""

    request: str
    """Name of the request."""
    fields: tuple[str, ...]
    """Names of all fields that the request may have."""
    method: Callable[..., JsonObject | None]
    """Called with the panel and the fields; None is sent as an empty object."""


def answers(
    request: str, *fields: str
) -> Callable[[Callable[..., JsonObject | None]], RequestHandler]:
    """Return a decorator that declares a panel's method as the handler of a request with these fields."""
    return lambda method: RequestHandler(request, fields, method)


class Panel:
    """A panel of the lab: its methods that are declared by :func:`answers` answer requests of the pages.

    Parameters
    ----------
    desk
        The arm, its state, and the view that shows them.
    """

    jobs: Jobs | None = None
    """Work of the panel that takes long, if it has any."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk

    def handlers(self) -> dict[str, Callable[[JsonObject], JsonObject]]:
        """Return the handlers of this panel's requests, by the requests' names."""

        def bound(handler: RequestHandler) -> Callable[[JsonObject], JsonObject]:
            return lambda data: (
                handler.method(self, Fields(handler.request, data, handler.fields)) or {}
            )

        declared = [
            value for value in vars(type(self)).values() if isinstance(value, RequestHandler)
        ]
        return {handler.request: bound(handler) for handler in declared}

    def publish(self) -> None:
        """Send the panel's state to the pages; a panel without state sends nothing."""

    def close(self) -> None:
        """End the background work of the panel."""
        if self.jobs is not None:
            self.jobs.close()
