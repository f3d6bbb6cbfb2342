"""Messages from a page to Python: text from outside, whose size and types are checked."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NoReturn

from dhkit.viewer.bounds import BOUNDS
from dhkit.viewer.protocol import MAX_SEQUENCE, ProtocolError


@dataclass(frozen=True)
class Shown:
    """The page has drawn the message of this sequence number."""

    sequence: int


@dataclass(frozen=True)
class Request:
    """A request of a page; the answer has the same number."""

    id: int
    name: str
    data: dict[str, object]


def decode_message(text: str | bytes) -> Shown | Request:
    """Return the message of a page.

    Raises
    ------
    ProtocolError
        The text is not a JSON object of these types, or a field is missing or of another type; one line.
    """
    try:
        message = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError):
        raise ProtocolError("message is not JSON") from None
    if not isinstance(message, dict):
        raise ProtocolError(f"message is {type(message).__name__}; expected an object")
    kind = message.get("type")
    if kind == "shown":
        return Shown(_integer(message, "sequence", 0))
    if kind != "request":
        raise ProtocolError(f"message type is {str(kind)[:40]!r}; expected 'shown' or 'request'")
    number = _integer(message, "id", 1)
    name = message.get("name")
    data = message.get("data", {})
    if not isinstance(name, str) or not 0 < len(name) <= BOUNDS.name_characters:
        raise ProtocolError(f"name is {str(name)[:40]!r}; expected the name of a request")
    if not isinstance(data, dict) or _is_deeper(data, BOUNDS.nesting):
        raise ProtocolError(
            f"data is {type(data).__name__}; expected an object, nested {BOUNDS.nesting} levels at most"
        )
    return Request(number, name, data)


def _integer(message: dict[str, object], name: str, least: int) -> int:
    value = message.get(name)
    if type(value) is not int or not least <= value < MAX_SEQUENCE:
        raise ProtocolError(
            f"{name} is {str(value)[:40]}; expected a whole number from {least} to 2^32 - 1"
        )
    return value


def _refuse_constant(text: str) -> NoReturn:
    """Refuse NaN and infinity, which are not JSON."""
    raise ValueError(text)


def _is_deeper(value: object, levels: int) -> bool:
    """Return whether lists and objects are nested more than so many levels."""
    inner: Iterable[object] = ()
    if isinstance(value, dict):
        inner = value.values()
    elif isinstance(value, list):
        inner = value
    return levels < 0 or any(_is_deeper(entry, levels - 1) for entry in inner)
