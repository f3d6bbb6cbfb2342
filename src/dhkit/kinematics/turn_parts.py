"""What the programs of intervals of the redundancy take and return: the parts of a turn.

See :mod:`dhkit.kinematics.arm_angle_program` and :mod:`dhkit.kinematics.joint_7_program`.
"""

from __future__ import annotations

import math
import struct
from bisect import bisect_left
from collections.abc import Sequence

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.closed_form.family import Fit, limit_parameters
from dhkit.kinematics.redundant import JOINTS

RESULTS = ("sorted_begin", "sorted_inside", "state")
"""Outputs of a program:

- where each part begins, rad, in ascending order from -pi to pi, where the last one is empty, as others are;
- whether the arm can be inside its limits in it, 1 or 0;
- ``state``: ``KNOWN``, or why the parts are without meaning.
"""
ARM_ANGLE_PARTS = 64
"""Number of parts, many of them empty: two roots of 28 equations, and room to fill vectors."""
JOINT_7_PARTS = 152
"""Likewise: 16 roots of 6 polynomials, 8 of 5, 2 of 4 equations, and room."""
KNOWN, UNKNOWN, BEYOND, NO_POSE = range(4)
"""States; ``UNKNOWN``: of an arm angle, the outer joints of the shoulder or of the wrist turn about one line at every
value; of joint 7, the polynomials are not known well enough."""
OUTSIDE, INSIDE = (struct.pack("<d", value)[-1:] for value in (0.0, 1.0))
"""The bytes that tell the numbers 0 and 1 apart, the highest of each."""
TOUCHING = 1e-12
"""Share by which a root may be missed by rounding, and angle, rad, between two that are taken as one."""


def interval_parameters(fit: Fit, offset: Array, lower: Array, upper: Array) -> Array:
    """Return a program's parameters: those of the fit, and those that ``limit_symbols.Limits`` reads.

    Parameters
    ----------
    fit
        The arm as a member of its family.
    offset, lower, upper
        Offsets and limits of the joints, shape (7,), rad.
    """
    begin, width = limit_parameters(lower, upper, [False] * JOINTS).reshape(JOINTS, 2).T
    limits = math.tau * np.stack([begin, begin + width]) + offset
    turns = (begin, width, offset / math.tau)
    return np.concatenate([fit.vector(), *turns, *np.cos(limits), *np.sin(limits)])


def joined(begins: Array, are_inside: bytes) -> list[tuple[float, float]]:
    """Return the intervals of parts, neighbours joined.

    Parameters
    ----------
    begins
        Where the parts begin, shape (K,), rad.
    are_inside
        Whether the arm is inside its limits in them: ``INSIDE`` or ``OUTSIDE`` for each.
    """
    begin_of = begins.item
    # Those that begin at pi are empty.
    count = bisect_left(begins, math.pi)
    intervals = []
    first = are_inside.find(INSIDE, 0, count)
    while first >= 0:
        if _is_empty(begins, first):
            first = are_inside.find(INSIDE, first + 1, count)
            continue
        after = are_inside.find(OUTSIDE, first + 1, count)
        while after >= 0 and _is_empty(begins, after):
            after = are_inside.find(OUTSIDE, after + 1, count)
        if after < 0:
            intervals.append((begin_of(first), math.pi))
            break
        intervals.append((begin_of(first), begin_of(after)))
        first = are_inside.find(INSIDE, after + 1, count)
    return intervals


def _is_empty(begins: Array, k: int) -> bool:
    """Return whether a part before the last one is empty, or so small that rounding may have made it."""
    length: float = begins.item(k + 1) - begins.item(k)
    return length <= TOUCHING


def unrolled(
    intervals: Sequence[tuple[float, float]], lower: float, upper: float
) -> list[tuple[float, float]]:
    """Return the intervals of all turns between two limits, of those of one turn, [-pi, pi].

    Parameters
    ----------
    intervals
        Intervals in ascending order, rad.
    lower, upper
        The limits, rad.
    """
    found: list[tuple[float, float]] = []
    first = math.floor((lower + math.pi) / math.tau)
    last = math.floor((upper + math.pi) / math.tau)
    for turn in range(first, last + 1):
        for begin, end in intervals:
            begin_here = max(begin + turn * math.tau, lower)
            end_here = min(end + turn * math.tau, upper)
            if end_here - begin_here <= TOUCHING:
                continue
            # The end of one turn is the beginning of the next one.
            if found and begin_here - found[-1][1] <= TOUCHING:
                begin_here = found.pop()[0]
            found.append((begin_here, end_here))
    return found
