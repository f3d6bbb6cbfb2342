"""What the programs of intervals of the redundancy take and return: the parts of a turn.

See :mod:`dhkit.kinematics.arm_angle_program` and :mod:`dhkit.kinematics.joint_7_program`.
"""

from __future__ import annotations

import math
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


def joined(begins: Sequence[float], are_inside: Sequence[float]) -> list[tuple[float, float]]:
    """Return the intervals of parts, neighbours joined.

    Parameters
    ----------
    begins, are_inside
        Where the parts begin, rad, and whether the arm is inside its limits in them.
    """
    intervals = []
    start = None
    # Those that begin at pi are empty.
    count = bisect_left(begins, math.pi) + 1
    begins = begins[:count]
    for begin, end, is_inside in zip(begins, begins[1:], are_inside, strict=False):
        if end - begin <= TOUCHING:
            continue
        if is_inside and start is None:
            start = begin
        elif not is_inside and start is not None:
            intervals.append((start, begin))
            start = None
    if start is not None:
        intervals.append((start, math.pi))
    return intervals


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
