"""The YAML of ROS messages: a strict reader of what its tools print, and a writer of JointTrajectory."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from dhkit.description import Array
from dhkit.errors import DescriptionError

MESSAGE = ("header", "joint_names", "points")
"""Keys of a message."""
ROWS = ("positions", "velocities", "accelerations")
"""Keys of a point's rows, one number a joint."""
POINT = (*ROWS, "effort", "time_from_start")
"""Keys of a point."""
TIMES = (("sec", "nanosec"), ("secs", "nsecs"))
"""Keys of a duration, whole seconds and nanoseconds: of ROS 2, which is written, and of ROS 1."""

DEEPEST = 12
LONGEST_LIST = 10_000
"""Entries of a list within one line."""
KEY = re.compile(r"([A-Za-z_]\w*):(?:\s+(.*))?$")
PLAIN = re.compile(r"[A-Za-z][\w.-]*")
WORDS = {"true", "false", "yes", "no", "on", "off", "y", "n", "null", "nan", "inf"}
"""Plain scalars that YAML does not take for text."""


@dataclass(frozen=True)
class _Line:
    number: int
    indent: int
    text: str


def parse_message(text: str) -> dict[str, Any]:
    """Return a message of nested mappings and lists; scalars stay text.

    Read are block mappings and lists, lists in brackets within a line, quoted and plain scalars, comments, and one
    document, which ``---`` may begin and end. Anchors, tags, block scalars and other documents are refused.

    Raises
    ------
    DescriptionError
        Names the line, what was found and what was expected.
    """
    lines = _lines(text)
    if not lines:
        raise DescriptionError("empty; expected a JointTrajectory")
    value, end = _block(lines, 0, lines[0].indent, 0)
    if end < len(lines):
        raise _wrong(lines[end], "another indentation")
    if not isinstance(value, dict):
        raise _wrong(lines[0], "keys of a message")
    return value


def _lines(text: str) -> list[_Line]:
    lines: list[_Line] = []
    ended = False
    for number, raw in enumerate(text.splitlines(), start=1):
        stripped = raw.strip()
        if not stripped or stripped.startswith("#"):
            continue
        if stripped == "---":
            ended = bool(lines)
            continue
        line = _Line(number, len(raw) - len(raw.lstrip(" ")), stripped)
        if ended:
            raise _wrong(line, "one message, not several")
        if raw.lstrip(" ").startswith("\t"):
            raise _wrong(line, "spaces, not tabs")
        lines.append(line)
    return lines


def _block(lines: list[_Line], at: int, indent: int, depth: int) -> tuple[Any, int]:
    """Return the mapping or list that begins at a line, and the line behind it."""
    if depth > DEEPEST:
        raise _wrong(lines[at], f"at most {DEEPEST} levels")
    return (_list if _is_entry(lines[at]) else _mapping)(lines, at, indent, depth)


def _mapping(lines: list[_Line], at: int, indent: int, depth: int) -> tuple[dict[str, Any], int]:
    found: dict[str, Any] = {}
    while at < len(lines) and lines[at].indent == indent and not _is_entry(lines[at]):
        line = lines[at]
        match = KEY.match(line.text)
        if match is None:
            raise _wrong(line, "key: value")
        key, rest = match[1], _without_comment(match[2] or "")
        if key in found:
            raise _wrong(line, f"{key!r} once")
        at += 1
        if rest:
            found[key] = _scalar_or_list(line, rest)
        elif at < len(lines) and (lines[at].indent > indent or (lines[at].indent == indent and _is_entry(lines[at]))):
            found[key], at = _block(lines, at, lines[at].indent, depth + 1)
        else:
            found[key] = ""
    return found, at


def _list(lines: list[_Line], at: int, indent: int, depth: int) -> tuple[list[Any], int]:
    found: list[Any] = []
    while at < len(lines) and lines[at].indent == indent and _is_entry(lines[at]):
        line = lines[at]
        rest = _without_comment(line.text[1:].strip())
        inner = indent + len(line.text) - len(line.text[1:].lstrip())
        if not rest:
            at += 1
            if at == len(lines) or lines[at].indent <= indent:
                raise _wrong(line, "a value behind '-'")
            value, at = _block(lines, at, lines[at].indent, depth + 1)
        elif KEY.match(rest):
            # An entry's first key stands behind its dash: as if it began a line of its own.
            lines[at] = _Line(line.number, inner, rest)
            value, at = _mapping(lines, at, inner, depth + 1)
        else:
            value, at = _scalar_or_list(line, rest), at + 1
        found.append(value)
    return found, at


def _scalar_or_list(line: _Line, text: str) -> Any:
    if not text.startswith("["):
        return _scalar(line, text)
    if not text.endswith("]") or "[" in text[1:]:
        raise _wrong(line, "a list that ends with ']' in the same line")
    inside = text[1:-1].strip()
    entries = inside.split(",", LONGEST_LIST) if inside else []
    if len(entries) > LONGEST_LIST:
        raise _wrong(line, f"at most {LONGEST_LIST} entries")
    return [_scalar(line, entry.strip()) for entry in entries]


def _scalar(line: _Line, text: str) -> str:
    quote = text[:1]
    if quote and quote in "'\"":
        if len(text) < 2 or text[-1] != quote or quote in text[1:-1].replace("''", "") or "\\" in text:
            raise _wrong(line, "text in one pair of quotes")
        return text[1:-1].replace("''", "'")
    if not text or text[0] in "&*!|>%@`{}[],?" or text.startswith("- ") or ": " in text:
        raise _wrong(line, "a number or a name")
    return text


def _is_entry(line: _Line) -> bool:
    return line.text == "-" or line.text.startswith("- ")


def _without_comment(text: str) -> str:
    if text.startswith("#"):
        return ""
    return text if text[:1] in ("'", '"') else text.split(" #", 1)[0].rstrip()


def _wrong(line: _Line, expected: str) -> DescriptionError:
    return DescriptionError(f"line {line.number}: found {line.text[:60]!r}; expected {expected}")


def trajectory_text(
    names: tuple[str, ...], nanoseconds: list[int], q: Array, qd: Array, qdd: Array, comments: tuple[str, ...]
) -> str:
    """Return a JointTrajectory as ``ros2 topic pub`` takes it.

    Parameters
    ----------
    names
        Of n joints.
    nanoseconds
        N times from the start.
    q, qd, qdd
        Shape (N, n).
    comments
        Lines to begin with.
    """
    lines = [f"# {comment}" for comment in comments]
    lines += ["header:", "  stamp:", "    sec: 0", "    nanosec: 0", "  frame_id: ''", "joint_names:"]
    lines += [f"- {_name(name)}" for name in names]
    lines.append("points:")
    for time, *rows in zip(nanoseconds, q.tolist(), qd.tolist(), qdd.tolist(), strict=True):
        for k, (key, row) in enumerate(zip(ROWS, rows, strict=True)):
            lines.append(f"{'  ' if k else '- '}{key}: [{', '.join(map(_number, row))}]")
        sec, nanosec = divmod(time, 1_000_000_000)
        lines += ["  effort: []", "  time_from_start:", f"    sec: {sec}", f"    nanosec: {nanosec}"]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    # YAML 1.1 takes 1e-05 for text: a number has a point.
    text = f"{value:.17g}"
    mantissa, _, exponent = text.partition("e")
    return (mantissa if "." in mantissa else f"{mantissa}.0") + (f"e{exponent}" if exponent else "")


def _name(name: str) -> str:
    return name if PLAIN.fullmatch(name) and name.lower() not in WORDS else f"'{name}'"
