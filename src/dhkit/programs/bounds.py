"""Bounds on programs of users and on the results of their functions."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes and times of calls; :mod:`dhkit.execution.bounds` has those of processes."""

    rubric_bytes: int = 100_000
    """Size of a rubric."""
    time: float = 600.0
    """Processor time of all calls of a function together, s; on the clock it may be four times as long."""
    fatal_failures: int = 3
    """Failures in a row that end a program, after which it is not called again."""
    listed_failures: int = 5
    """Kinds of failures that a report lists."""
    solutions: int = 64
    """Solutions of a pose: no arm of six joints has more than 16."""
    joint_value: float = 1e6
    """Joint value of a solution, rad and m."""


BOUNDS = Bounds()
