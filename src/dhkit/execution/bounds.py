"""Bounds on programs of others and on their answers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes and times; the process of a program that exceeds one is ended.

    ``launcher.py`` and the runners are executed by their path, import nothing of dhkit, and state their own.
    """

    source_bytes: int = 1_000_000
    """Size of a program's file."""
    start_time: float = 30.0
    """Processor time from the start to the first line, s: importing numpy may take some seconds."""
    end_time: float = 5.0
    """Time that processes may take to end when they are killed, s."""
    error_characters: int = 500
    """Characters kept of an error that a program reports."""
    line_number: int = 10**7
    """Number of a line in an error."""
    answer_bytes: int = 1 << 22
    """Size of one answer."""
    unread_answers: int = 1_000
    """Answers that wait to be read."""
    output_bytes: int = 1 << 16
    """Bytes that are kept of a program's printed output: the last ones."""
    written_bytes: int = 128 << 20
    """Size together of a program's files in its folder and of those without a name."""


BOUNDS = Bounds()
