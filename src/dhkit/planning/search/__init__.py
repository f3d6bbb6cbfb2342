"""Search: solve a program, certify its motion, tighten exceeded limits, solve again; around obstacles likewise."""

from dhkit.planning.search.avoiding import FINER, motion_around
from dhkit.planning.search.search import (
    RESOLUTION,
    TIME_SCALING_MARGIN,
    MotionSearch,
    PlannedMotion,
    coarser,
)

__all__ = [
    "FINER",
    "RESOLUTION",
    "TIME_SCALING_MARGIN",
    "MotionSearch",
    "PlannedMotion",
    "coarser",
    "motion_around",
]
