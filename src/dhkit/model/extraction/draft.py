"""Doubles as numbers of a robot file: rounded where that changes nothing that matters, angles as parts of a turn."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from dhkit.description import INERTIA_PLACES, Array, Body, Inertia, Placement, pose_parts
from dhkit.description.bodies import Vector
from dhkit.expressions import PI, Expression, exact, exact_angle

ROUNDINGS = (9, 10, 11, 12, 13, None)
"""Decimals that numbers are rounded to, the coarsest first; None: not at all."""
SIGNIFICANT = 12
"""Significant digits of masses and inertias that are rounded; centres of mass are rounded to a tenth of a picometre."""
STEP = math.pi / 12
LOCKED = 1e-12
"""Cosine of a pitch that counts as 90 degrees."""


def length(value: float, decimals: int | None) -> Expression:
    """Return a length, m."""
    return exact(float(value) + 0.0 if decimals is None else round(float(value), decimals) + 0.0)


def angle(value: float, decimals: int | None) -> Expression:
    """Return an angle, rad; one within the last decimal of a multiple of 15 degrees is that multiple."""
    if decimals is None:
        return exact_angle(exact(float(value) + 0.0))
    steps = round(value / STEP)
    if abs(value - steps * STEP) <= 10.0**-decimals:
        return PI * Fraction(steps, 12)
    return exact(round(float(value), decimals) + 0.0)


def vector(values: Array, decimals: int | None) -> Vector:
    """Return three lengths, m."""
    x, y, z = (length(value, decimals) for value in values)
    return x, y, z


def placement(T: Array, decimals: int | None) -> Placement:
    """Return a pose as origin and fixed-axis roll, pitch, yaw."""
    xyz, (yaw, pitch, roll) = pose_parts(T, order="ZYX")
    if np.hypot(T[0, 0], T[1, 0]) < max(LOCKED, 0.0 if decimals is None else 10.0**-decimals):
        # roll and yaw turn about one axis: rounding alone would share the angle out between them
        roll, yaw = np.arctan2(-T[1, 2], T[1, 1]), 0.0
    r, p, y = (angle(float(value), decimals) for value in (roll, pitch, yaw))
    return Placement(vector(xyz, decimals), (r, p, y))


def body(mass: float, com: Array, inertia: Array, decimals: int | None) -> Body:
    """Return a body; one whose inertia no body can have is marked ``unphysical``."""
    largest = float(np.abs(inertia).max())
    if decimals is None or not largest:
        entries = {key: exact(float(inertia[place]) + 0.0) for key, place in INERTIA_PLACES.items()}
    else:
        places = SIGNIFICANT - 1 - math.floor(math.log10(largest))
        entries = {key: exact(round(float(inertia[place]), places) + 0.0) for key, place in INERTIA_PLACES.items()}
    weight = mass if decimals is None else float(f"{mass:.{SIGNIFICANT}g}")
    lowest, _, highest = np.linalg.eigvalsh(inertia)
    impossible = lowest < -(1e-12 + 1e-9 * abs(highest)) / 2  # half of what a description allows: rounding comes yet
    center = vector(com, None if decimals is None else SIGNIFICANT + 1)
    return Body(exact(weight), center, Inertia(**entries), unphysical=bool(impossible))
