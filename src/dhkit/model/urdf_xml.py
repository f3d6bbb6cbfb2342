"""The text of URDFs, checked before any reader sees it: bounded XML without entities, attributes of finite numbers."""

from __future__ import annotations

import io
import math
import re
import stat
from pathlib import Path
from xml.etree import ElementTree

from dhkit.description.files import error_reason
from dhkit.errors import ModelError

Element = ElementTree.Element

MAX_BYTES = 5_000_000
MAX_DEPTH = 64
"""Largest nesting depth of elements."""
MAX_ELEMENTS = 100_000
"""Largest number of elements; a humanoid with hands has 5,000."""
MAX_ATTRIBUTE_LENGTH = 1_000
"""Longest attribute, in characters: a name, a path or a list of numbers."""
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,4})?", re.ASCII)


def parse_urdf(path: Path) -> Element:
    """Return the root of a URDF, read as UTF-8 without entities, bounded in size and depth.

    Raises
    ------
    ModelError
        The file cannot be read or is no such XML; the message does not name the file.
    """
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise ModelError(f"{'a folder' if stat.S_ISDIR(mode) else 'not a regular file'}; expected a URDF")
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ModelError(error_reason(error)) from None
    if len(content) > MAX_BYTES:
        raise ModelError(f"more than {MAX_BYTES // 1_000_000} MB; expected a URDF")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ModelError("not UTF-8 text; expected a URDF") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ModelError("has a document type or entities, which a URDF does not need and dhkit does not read")
    try:
        _check_size(text)
        robot = ElementTree.fromstring(text.encode())  # noqa: S314 - no entities, bounded
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ModelError(
            f"not well-formed XML: {error}{_cause(text, is_unbound='unbound prefix' in str(error))}"
        ) from None
    if robot.tag != "robot":
        raise ModelError(f"found <{robot.tag[:40]}>; expected <robot>")
    return robot


def _cause(text: str, *, is_unbound: bool) -> str:
    """Return the usual cause of an error of the XML parser, such as an unbound namespace prefix."""
    if is_unbound:
        declared = {"xml", *re.findall(r"xmlns:(\w+)", text)}
        prefix = next((name for name in re.findall(r"</?(\w+):", text) if name not in declared), None)
        return f"; no xmlns declares {prefix}:" if prefix else ""
    return "; expected the output of xacro" if "xacro:" in text else ""


def _check_size(text: str) -> None:
    """Refuse XML that is deep or has many elements before a tree of it is built."""
    depth = count = 0
    for event, element in ElementTree.iterparse(io.BytesIO(text.encode()), events=("start", "end")):  # noqa: S314
        if event == "end":
            depth -= 1
            element.clear()
            continue
        depth, count = depth + 1, count + 1
        if depth > MAX_DEPTH:
            raise ModelError(f"elements nested more than {MAX_DEPTH} deep")
        if count > MAX_ELEMENTS:
            raise ModelError(f"more than {MAX_ELEMENTS} elements; expected a URDF")
        for key, value in element.attrib.items():
            if len(value) > MAX_ATTRIBUTE_LENGTH:
                raise ModelError(f"<{element.tag[:40]} {key[:40]}> has {len(value)} characters; expected fewer")


def child_name(joint: Element, tag: str) -> str:
    """Return the name of a joint's parent or child link; empty if there is none."""
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def numbers(where: str, element: Element | None, key: str, count: int) -> list[float]:
    """Return an attribute's numbers; an empty list if element or attribute is missing.

    Pinocchio reads words that are no numbers as 0 or as the number that they begin with; here they are refused.

    Raises
    ------
    ModelError
        Another count, or a word that is no finite number; begins with ``where``.
    """
    text = None if element is None else element.get(key)
    if element is None or text is None:
        return []
    values = []
    for word in re.split(r"[ \t\r\n]+", text.strip(" \t\r\n")):
        value = float(word) if NUMBER.fullmatch(word) else math.nan
        if not math.isfinite(value):
            hint = " (run xacro first)" if "${" in word else ""
            raise ModelError(f"{where}: <{element.tag} {key}>: found {word[:40]!r}; expected a finite number{hint}")
        values.append(value)
    if len(values) != count:
        raise ModelError(f"{where}: <{element.tag} {key}> has {len(values)} numbers; expected {count}")
    return values


def number(where: str, element: Element | None, key: str) -> float | None:
    """Return an attribute's only number, None if element or attribute is missing; see :func:`numbers`."""
    values = numbers(where, element, key, 1)
    return values[0] if values else None
