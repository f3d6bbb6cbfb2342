"""TOML text from untrusted files: bounded in depth and size of numbers, decimals kept digit by digit."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from decimal import Decimal, InvalidOperation
from typing import Any, TypeAlias

from dhkit.description.bounds import BOUNDS
from dhkit.errors import DescriptionError

Document: TypeAlias = dict[str, Any]
"""A parsed document: tables, lists, texts, whole numbers, Decimal, booleans and dates, not checked further."""

_DOTTED_KEY = re.compile(r"(?<![\w\-\"'])[\w\-\"']++(?:[ \t]*+\.[ \t]*+[\w\-\"']++){9}")
"""A key of ten dotted parts or more, which no file of ours has; tomllib takes quadratic time over such keys.

Possessive quantifiers keep this expression itself linear."""
_LINE = re.compile(r"\(at line (\d+),")
_UNQUOTED = re.compile(
    r"[=,\[]\s*(?!(?:true|false|inf|nan)\b)([^\s\"'\[{,#]*[A-Za-z*/][^\"',\]}#]{0,200})"
)
"""A value, of a key or in a list, that is neither text nor a number."""


def toml_document(text: str) -> Document:
    """Return a TOML document.

    Raises
    ------
    DescriptionError
        Not TOML, nested too deep, or a number beyond the range of a double.
    """
    if deep := _DOTTED_KEY.search(text):
        raise DescriptionError(f"the key {deep.group()[:40]}... is nested too deep")
    try:
        document = tomllib.loads(text, parse_float=_decimal)
        _check_numbers(document)
    except RecursionError:
        raise DescriptionError("nested too deep") from None
    except ValueError as error:
        raise DescriptionError(
            f"not TOML: {str(error)[:200]}{_unquoted(text, str(error))}"
        ) from None
    return document


def _unquoted(text: str, message: str) -> str:
    """Return a hint if the parser stopped in a line with an expression or a name that lacks its quotes."""
    place = _LINE.search(message)
    value = (
        _UNQUOTED.search(text.split("\n")[int(place[1]) - 1][: BOUNDS.hint_characters])
        if place
        else None
    )
    return f'; names and expressions are in quotes: "{value[1].strip()[:40]}"' if value else ""


def plain_numbers(document: Document) -> Document:
    """Return a document with doubles instead of decimals."""

    def plain(value: object) -> object:
        if isinstance(value, Mapping):
            return {key: plain(entry) for key, entry in value.items()}
        if isinstance(value, list):
            return [plain(entry) for entry in value]
        return float(value) if isinstance(value, Decimal) else value

    return {key: plain(value) for key, value in document.items()}


def _decimal(text: str) -> Decimal:
    try:
        return Decimal(text)
    except InvalidOperation:
        raise DescriptionError(f"{text[:40]} is beyond the range of a double") from None


def _check_numbers(value: object) -> None:
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list):
        for entry in value:
            _check_numbers(entry)
    elif isinstance(value, int) and value.bit_length() > BOUNDS.integer_bits:
        raise DescriptionError("a whole number beyond the range of a double")
