"""The YAML of ROS messages: a reader of JointTrajectory as ROS prints it, within bounds, and a writer."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from typing import Any

import yaml

from dhkit.description import Array
from dhkit.errors import DescriptionError
from dhkit.trajectories.bounds import BOUNDS

MESSAGE = ("header", "joint_names", "points")
"""Keys of a message."""
ROWS = ("positions", "velocities", "accelerations")
"""Keys of a point's rows, one number a joint."""
POINT = (*ROWS, "effort", "time_from_start")
"""Keys of a point."""
TIMES = (("sec", "nanosec"), ("secs", "nsecs"))
"""Keys of a duration, whole seconds and nanoseconds: of ROS 2, which is written, and of ROS 1."""

_PLAIN = re.compile(r"[A-Za-z][\w.-]*")
_NO_TEXT = {"true", "false", "yes", "no", "on", "off", "y", "n", "null", "nan", "inf"}
"""Plain scalars that some readers of YAML take for something else than text: they are written in quotes."""


def parse_message(text: str) -> dict[str, Any]:
    """Return a message of nested mappings and lists; scalars stay text.

    The text is YAML of one document without anchors and tags.

    Raises
    ------
    DescriptionError
        Names the line, what was found and what was expected.
    """
    events = yaml.parse(text, Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader))
    try:
        message: Any = None
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                value = _value(next(events), events, 0)
                # ROS ends a message with ---, which begins an empty document.
                if message is not None and value:
                    raise _UnexpectedError(event, "one message, not several")
                message = value if message is None else message
    except _UnexpectedError as error:
        raise _wrong(text, error.event.start_mark, error.expected) from None
    except yaml.MarkedYAMLError as error:
        problem = " ".join(filter(None, (error.context, error.problem)))
        # For a quoted text that does not end, the line where it begins is more useful than the end of the file.
        begin = error.context_mark if isinstance(error, yaml.scanner.ScannerError) else None
        raise _wrong(text, begin or error.problem_mark, f"YAML ({problem})") from None
    except yaml.YAMLError as error:
        raise DescriptionError(f"no YAML: {' '.join(str(error).split())[:100]}") from None
    if not isinstance(message, dict):
        raise DescriptionError("no keys of a message in it; expected a JointTrajectory")
    return message


class _UnexpectedError(Exception):
    """An event of the YAML reader that a message does not have."""

    def __init__(self, event: yaml.Event, expected: str) -> None:
        self.event = event
        self.expected = expected


def _value(event: yaml.Event, events: Iterator[yaml.Event], depth: int) -> Any:
    """Return the text, list or mapping that begins with an event."""
    if depth > BOUNDS.yaml_nesting:
        raise _UnexpectedError(event, f"at most {BOUNDS.yaml_nesting} levels")
    if getattr(event, "anchor", None) or getattr(event, "tag", None):
        raise _UnexpectedError(event, "a number or a name")
    if isinstance(event, yaml.ScalarEvent):
        return event.value
    if isinstance(event, yaml.SequenceStartEvent):
        entries = itertools.takewhile(
            lambda entry: not isinstance(entry, yaml.SequenceEndEvent), events
        )
        return [_value(entry, events, depth + 1) for entry in entries]
    mapping: dict[str, Any] = {}
    while not isinstance(key := next(events), yaml.MappingEndEvent):
        if not isinstance(key, yaml.ScalarEvent):
            raise _UnexpectedError(key, "key: value")
        if key.value in mapping:
            raise _UnexpectedError(key, f"{key.value!r} once")
        mapping[key.value] = _value(next(events), events, depth + 1)
    return mapping


def _wrong(text: str, mark: yaml.Mark | None, expected: str) -> DescriptionError:
    lines = text.splitlines() or [""]
    number = min(0 if mark is None else mark.line, len(lines) - 1)
    return DescriptionError(
        f"line {number + 1}: found {lines[number].strip()[:60]!r}; expected {expected}"
    )


def trajectory_text(
    names: tuple[str, ...],
    nanoseconds: list[int],
    q: Array,
    qd: Array,
    qdd: Array,
    comments: tuple[str, ...],
) -> str:
    """Return a JointTrajectory as ``ros2 topic pub`` takes it.

    Parameters
    ----------
    names
        Names of the n joints.
    nanoseconds
        N times from the start, ns.
    q, qd, qdd
        Joint values, rates and accelerations, shape (N, n), rad, m and seconds.
    comments
        First lines of the file.
    """
    lines = [f"# {comment}" for comment in comments]
    lines += [
        "header:",
        "  stamp:",
        "    sec: 0",
        "    nanosec: 0",
        "  frame_id: ''",
        "joint_names:",
    ]
    lines += [f"- {_name(name)}" for name in names]
    lines.append("points:")
    for time, *rows in zip(nanoseconds, q.tolist(), qd.tolist(), qdd.tolist(), strict=True):
        for k, (key, row) in enumerate(zip(ROWS, rows, strict=True)):
            lines.append(f"{'  ' if k else '- '}{key}: [{', '.join(map(_number, row))}]")
        sec, nanosec = divmod(time, 1_000_000_000)
        lines += [
            "  effort: []",
            "  time_from_start:",
            f"    sec: {sec}",
            f"    nanosec: {nanosec}",
        ]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    # YAML 1.1 reads 1e-05 as text: its numbers with an exponent have a point.
    text = f"{value:.17g}"
    mantissa, _, exponent = text.partition("e")
    return (mantissa if "." in mantissa else f"{mantissa}.0") + (f"e{exponent}" if exponent else "")


def _name(name: str) -> str:
    return name if _PLAIN.fullmatch(name) and name.lower() not in _NO_TEXT else f"'{name}'"
