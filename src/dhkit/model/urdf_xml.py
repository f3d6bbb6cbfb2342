"""The text of URDFs, checked before any reader sees it: bounded XML without entities, attributes of finite numbers."""

from __future__ import annotations

import codecs
import math
import re
import stat
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from dhkit.description.files import error_reason
from dhkit.description.quantities import NUMBER
from dhkit.errors import ModelError
from dhkit.model.bounds import BOUNDS

Element = ElementTree.Element

_RUN_XACRO = "run xacro on it first, and give its output"
_DECLARED_ENCODING = re.compile(
    rb"\s*<\?xml[^>]{0,100}?encoding\s*=\s*[\"']([A-Za-z0-9_.\-]{1,40})[\"']"
)
_REFUSED_ENCODINGS = {"idna", "punycode"}
"""Encodings of names, not of texts: long ones take quadratic time."""


def parse_urdf(path: Path) -> Element:
    """Return the root of a URDF without entities, bounded in size and depth.

    Prefixes of namespaces stay part of the names: the parts of a URDF have none, and files do not always declare them.

    Raises
    ------
    ModelError
        The file cannot be read, or its XML has a document type or is too deep or too large. The message does not
        name the file.
    """
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise ModelError(
                f"{'a folder' if stat.S_ISDIR(mode) else 'not a regular file'}; expected a URDF"
            )
        with path.open("rb") as file:
            content = file.read(BOUNDS.urdf_bytes + 1)
    except (OSError, ValueError) as error:
        raise ModelError(error_reason(error)) from None
    if len(content) > BOUNDS.urdf_bytes:
        raise ModelError(f"more than {BOUNDS.urdf_bytes // 1_000_000} MB; expected a URDF")
    text = _decoded(content).lstrip()  # blank lines before <?xml, which other readers skip
    try:
        robot = _BoundedTree().read(text)
    except expat.ExpatError as error:
        hint = f"; {_RUN_XACRO}" if "xacro:" in text else ""
        raise ModelError(f"not well-formed XML: {error}{hint}") from None
    if any(element.tag.startswith("xacro:") for element in robot.iter()):
        raise ModelError(f"has elements of xacro; {_RUN_XACRO}")
    if robot.tag != "robot":
        raise ModelError(f"found <{robot.tag[:40]}>; expected <robot>")
    return robot


def _decoded(content: bytes) -> str:
    """Return the text of an XML file: by its byte order mark, as UTF-8, or in the encoding that it declares."""
    begins = {
        codecs.BOM_UTF16_LE: "utf-16",
        codecs.BOM_UTF16_BE: "utf-16",
        b"<\0": "utf-16-le",
        b"\0<": "utf-16-be",
    }
    declared = _DECLARED_ENCODING.match(content)
    encodings = [name for begin, name in begins.items() if content.startswith(begin)] or [
        "utf-8-sig"
    ]
    if declared and declared[1].decode().lower() not in _REFUSED_ENCODINGS:
        encodings.append(declared[1].decode())
    for encoding in encodings:
        try:
            return content.decode(encoding)
        except (UnicodeError, LookupError):
            continue
    said = (
        f"the encoding that it declares is {encodings[-1][:40]}"
        if declared
        else "it declares no other encoding"
    )
    raise ModelError(f"not UTF-8 text, and {said}; expected a URDF")


class _BoundedTree:
    """Builds the tree of an XML text, and refuses what is deep, large or has a document type while it is read."""

    def __init__(self) -> None:
        self._builder = ElementTree.TreeBuilder()
        self._depth = 0
        self._count = 0
        # The text is given as UTF-8, whatever it declares.
        self._parser = expat.ParserCreate("utf-8")
        self._parser.buffer_text = True
        self._parser.StartDoctypeDeclHandler = self._refuse_document_type
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._builder.data

    def read(self, text: str) -> Element:
        """Return the root of the tree."""
        self._parser.Parse(text.encode(errors="replace"), True)
        return self._builder.close()

    def _refuse_document_type(self, *_: object) -> None:
        raise ModelError(
            "has a document type or entities, which a URDF does not need and dhkit does not read"
        )

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._count += 1
        if self._depth > BOUNDS.xml_nesting:
            raise ModelError(f"elements nested more than {BOUNDS.xml_nesting} deep")
        if self._count > BOUNDS.xml_elements:
            raise ModelError(f"more than {BOUNDS.xml_elements} elements; expected a URDF")
        for key, value in attributes.items():
            if len(value) > BOUNDS.attribute_characters:
                raise ModelError(
                    f"<{tag[:40]} {key[:40]}> has {len(value)} characters; expected fewer"
                )
        self._builder.start(tag, attributes)

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._builder.end(tag)


def child_name(joint: Element, tag: str) -> str:
    """Return the name of a joint's parent or child link; empty if there is none."""
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def numbers(where: str, element: Element | None, key: str, count: int) -> list[float]:
    """Return an attribute's numbers; an empty list if element or attribute is missing.

    Pinocchio reads words that are not numbers as 0 or as the number that they begin with; here they are refused.

    Raises
    ------
    ModelError
        Another count, or a word that is not a finite number; begins with ``where``.
    """
    text = None if element is None else element.get(key)
    if element is None or text is None:
        return []
    values = []
    for word in re.split(r"[ \t\r\n]+", text.strip(" \t\r\n")):
        value = float(word) if NUMBER.fullmatch(word) else math.nan
        if not math.isfinite(value):
            hint = " (run xacro first)" if "${" in word else ""
            raise ModelError(
                f"{where}: <{element.tag} {key}>: found {word[:40]!r}; expected a finite number{hint}"
            )
        values.append(value)
    if len(values) != count:
        raise ModelError(
            f"{where}: <{element.tag} {key}> has {len(values)} numbers; expected {count}"
        )
    return values


def number(where: str, element: Element | None, key: str) -> float | None:
    """Return an attribute's only number, None if element or attribute is missing; see :func:`numbers`."""
    values = numbers(where, element, key, 1)
    return values[0] if values else None
