"""What the program of :mod:`dhkit.kinematics.interval_program` takes and returns: the parts of a turn."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.closed_form.family import Fit, limit_parameters

JOINTS = 7
PARTS = 64
"""Number of parts of a turn, many of them empty: two roots of 28 equations, and room to fill vectors."""
RESULTS = ("sorted_part", "state")
"""Outputs of the program:

- of each part, in ascending order, where it begins, rad, and whether the arm is inside its limits in it; the first one
  begins at -pi, and the last one is empty;
- ``state``: ``KNOWN``, or why the parts are without meaning.
"""
KNOWN, ALIGNED, BEYOND, NO_POSE = range(4)
"""States; ``ALIGNED``: the outer joints of the shoulder or of the wrist turn about one line at every arm angle."""
TOUCHING = 1e-12
"""Share by which a root may be missed by rounding, and angle, rad, between two that are taken as one."""


def interval_parameters(fit: Fit, offset: Array, lower: Array, upper: Array) -> Array:
    """Return the program's parameters: those of the fit, and the limits of the angles theta = q + offset.

    Parameters
    ----------
    fit
        The arm as a member of its family.
    offset, lower, upper
        Offsets and limits of the joints, shape (7,), rad.
    """
    begin, width = limit_parameters(lower, upper, [False] * JOINTS).reshape(JOINTS, 2).T
    begin = begin + offset / math.tau
    limits = math.tau * np.stack([begin, begin + width])
    return np.concatenate(
        [fit.vector(), begin, width, np.cos(limits).ravel(), np.sin(limits).ravel()]
    )


def joined(parts: Array, state: float) -> list[tuple[float, float]] | None:
    """Return the intervals of ``RESULTS``, parts that are neighbours joined; None where they have no meaning.

    Parameters
    ----------
    parts
        The parts, shape (64, 2): where they begin, rad, and whether the arm is inside its limits.
    state
        The state.
    """
    if state == BEYOND:
        return []
    if state != KNOWN:
        return None
    intervals = []
    rows = parts.tolist()
    start = None
    for (begin, is_inside), (end, _) in pairwise(rows):
        if end - begin <= TOUCHING:
            continue
        if is_inside and start is None:
            start = begin
        elif not is_inside and start is not None:
            intervals.append((start, begin))
            start = None
    if start is not None:
        intervals.append((start, np.pi))
    return intervals
