"""What a page asks Python for: text from outside, read with bounds and without trust."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from dhkit.viewer.protocol import MAX_SEQUENCE, ProtocolError

LONGEST_NAME = 40
DEEPEST = 6
"""Levels of lists and objects in a request."""


@dataclass(frozen=True)
class Shown:
    """A page has drawn a message."""

    sequence: int


@dataclass(frozen=True)
class Request:
    """A page asks for something, and wants an answer with the same number."""

    id: int
    name: str
    data: dict[str, Any]


def decode_message(text: str | bytes) -> Shown | Request:
    """Return what a page says.

    Raises
    ------
    ProtocolError
        No JSON object of these types, or a field that is missing or of another type; one line.
    """
    try:
        message = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise ProtocolError("message is no JSON") from None
    if not isinstance(message, dict):
        raise ProtocolError(f"message is {type(message).__name__}; expected an object")
    kind = message.get("type")
    if kind == "shown":
        return Shown(_whole(message, "sequence", 0))
    if kind != "request":
        raise ProtocolError(f"message type is {str(kind)[:40]!r}; expected 'shown' or 'request'")
    number = _whole(message, "id", 1)
    name, data = message.get("name"), message.get("data", {})
    if not isinstance(name, str) or not 0 < len(name) <= LONGEST_NAME:
        raise ProtocolError(f"name is {str(name)[:40]!r}; expected the name of a request")
    if not isinstance(data, dict) or _deeper(data, DEEPEST):
        raise ProtocolError(f"data is {type(data).__name__}; expected an object, nested {DEEPEST} levels at most")
    return Request(number, name, data)


def _whole(message: dict[str, Any], name: str, least: int) -> int:
    value = message.get(name)
    if type(value) is not int or not least <= value < MAX_SEQUENCE:
        raise ProtocolError(f"{name} is {str(value)[:40]}; expected a whole number from {least} to 2^32 - 1")
    return value


def _no_number(text: str) -> None:
    raise ValueError(text)


def _deeper(value: Any, levels: int) -> bool:
    """Return whether lists and objects are nested more than so many levels."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return levels < 0 or any(_deeper(entry, levels - 1) for entry in inner)
