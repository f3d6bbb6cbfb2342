"""The gate in front of every reader of URDFs: bounded text without entities, and elements with finite numbers."""

from __future__ import annotations

import io
import math
import re
import stat
from pathlib import Path
from xml.etree import ElementTree

from dhkit.errors import ModelError

Element = ElementTree.Element

MAX_BYTES = 5_000_000
MAX_DEPTH = 64
MAX_ELEMENTS = 100_000
"""A humanoid with hands has 5,000."""
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,4})?", re.ASCII)
MAX_ATTRIBUTE = 1_000
"""Characters of a name, a path or a list of numbers."""


def parsed(path: Path) -> Element:
    """Return the root of a URDF, read as UTF-8 without entities, bounded in size and depth.

    Raises
    ------
    ModelError
        The file cannot be read or is no such XML; says which and why.
    """
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise ModelError(f"{path}: {'a folder' if stat.S_ISDIR(mode) else 'not a regular file'}; expected a URDF")
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ModelError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > MAX_BYTES:
        raise ModelError(f"{path}: more than {MAX_BYTES // 1_000_000} MB; expected a URDF")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ModelError(f"{path}: not UTF-8 text; expected a URDF") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ModelError(f"{path}: has a document type or entities, which a URDF does not need and dhkit does not read")
    try:
        _check_size(path, text)
        robot = ElementTree.fromstring(text.encode())  # noqa: S314 - no entities, bounded
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ModelError(f"{path}: no XML: {error}{_hint(text, str(error))}") from None
    if robot.tag != "robot":
        raise ModelError(f"{path}: found <{robot.tag[:40]}>; expected <robot>")
    return robot


def _hint(text: str, error: str) -> str:
    """Say what usually causes an error of the XML parser."""
    if "unbound prefix" in error:
        declared = {"xml", *re.findall(r"xmlns:(\w+)", text)}
        prefix = next((name for name in re.findall(r"</?(\w+):", text) if name not in declared), None)
        return f"; no xmlns declares {prefix}:" if prefix else ""
    return "; expected the output of xacro" if "xacro:" in text else ""


def _check_size(path: Path, text: str) -> None:
    """Refuse XML that is deep or has many elements before a tree of it is built."""
    depth = count = 0
    for event, element in ElementTree.iterparse(io.BytesIO(text.encode()), events=("start", "end")):  # noqa: S314
        if event == "end":
            depth -= 1
            element.clear()
            continue
        depth, count = depth + 1, count + 1
        if depth > MAX_DEPTH:
            raise ModelError(f"{path}: elements nested more than {MAX_DEPTH} deep")
        if count > MAX_ELEMENTS:
            raise ModelError(f"{path}: more than {MAX_ELEMENTS} elements; expected a URDF")
        for key, value in element.attrib.items():
            if len(value) > MAX_ATTRIBUTE:
                raise ModelError(f"{path}: <{element.tag[:40]} {key[:40]}> has {len(value)} characters; expected fewer")


def child_name(joint: Element, tag: str) -> str:
    """Return the name of a joint's parent or child link; empty where there is none."""
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def numbers(where: str, element: Element | None, key: str, count: int) -> list[float]:
    """Return an attribute's numbers, none where element or attribute is missing.

    Pinocchio reads words that are no numbers as 0 or as the number that they begin with.

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
