"""The closed form of an arm, if it has one, with the reason in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from dhkit.description import Description, takes_robot
from dhkit.display import LONGEST_LINE, plain
from dhkit.kinematics.axes import TOLERANCE, Axes
from dhkit.kinematics.closed_form import (
    arm_angle,
    five_joints,
    planar,
    spherical_shoulder,
    spherical_wrist,
    three_parallel,
    turret,
)
from dhkit.kinematics.closed_form.family import (
    ALL_COORDINATES,
    ARM_ANGLE,
    LAST_JOINT,
    Family,
    Fit,
)

FAMILIES = (
    Family("elbow_wrist", spherical_wrist.elbow_fit, spherical_wrist.elbow_formulas),
    Family("slide_wrist", spherical_wrist.slide_fit, spherical_wrist.slide_formulas),
    Family(
        "three_parallel", three_parallel.three_parallel_fit, three_parallel.three_parallel_formulas
    ),
    Family("five_joints", five_joints.five_joints_fit, five_joints.five_joints_formulas),
    Family("yaw_three", turret.yaw_three_fit, turret.yaw_three_formulas),
    Family("yaw_two", turret.yaw_two_fit, turret.yaw_two_formulas),
    Family("pan_tilt", turret.pan_tilt_fit, turret.pan_tilt_formulas),
    Family("parallel_chain", planar.chain_fit, planar.chain_formulas),
    Family("polar", planar.polar_fit, planar.polar_formulas),
    Family("slider", planar.slider_fit, planar.slider_formulas),
)
"""Families of closed forms, in the order in which they are tried."""
REDUNDANT = (
    Family("arm_angle", arm_angle.arm_angle_fit, arm_angle.arm_angle_formulas, ARM_ANGLE),
    Family(
        "spherical_shoulder",
        spherical_shoulder.spherical_shoulder_fit,
        spherical_shoulder.spherical_shoulder_formulas,
        LAST_JOINT,
    ),
)
"""Families of arms of seven joints with a closed form at a given value, in the order in which they are tried."""
_ELIMINATED = {"6R": "", "7R": " at a given joint 7"}
"""Kinds of arms that are solved without a closed form, see :mod:`dhkit.kinematics.polynomial`."""
_EXACT_MEMBER = 2e-16
"""Tolerance within which an arm misses a family by rounding alone."""
_NEAR_MISSES = (1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
"""Tolerances (rad, share of the reach) within which an arm that misses a family probably has a typing error."""


@dataclass(frozen=True, eq=False)
class Classification:
    """The closed form that the geometry of an arm's axes allows; prints as its words."""

    words: str
    """Description, such as ``6R, spherical wrist, axes 2 and 3 parallel: closed form, 8 branches``."""
    family: Family | None
    """The family of arms that share its closed form; None if none is known."""
    fit: Fit | None
    """The arm's parameters in the family's formulas; None if there is no family."""
    neighbour: tuple[Family, Fit] | None = None
    """Family of six joints and parameters of its member that this arm misses by at most 1e-3; the arm's own family if
    it misses that by more than rounding; None if the arm is a member, or is not near a family."""
    redundant: tuple[Family, Fit] | None = None
    """Family of seven joints with a closed form at a given value, and the arm's parameters in it; None if the arm is no
    member."""

    @property
    def closed_form(self) -> bool:
        """Whether all solutions of a pose have a closed form; of seven joints, those at a redundancy: ``redundant``."""
        return self.family is not None

    @property
    def name(self) -> str:
        """The family's identifier, such as ``elbow_wrist``; empty without a family."""
        return "" if self.family is None else self.family.name

    @property
    def branches(self) -> tuple[str, ...]:
        """Labels of the branches, in the order of ``solutions.branches``."""
        return () if self.fit is None else tuple(self.fit.branches)

    def __str__(self) -> str:
        return self.words

    def __repr__(self) -> str:
        return plain(self.words, LONGEST_LINE)


@takes_robot
@lru_cache(maxsize=512)
def classify(description: Description) -> Classification:
    """Read the axes of an arm and return its closed form, if it has one.

    Axes count as parallel or perpendicular to 1e-12 rad, as intersecting to 1e-12 of the reach.

    Parameters
    ----------
    description
        The arm.

    Returns
    -------
    Classification
        The family with its numbers, or in words what is missing for a closed form.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> classify(library_robot("puma560")).family.name
    'elbow_wrist'
    >>> print(classify(library_robot("jaco")).words)
    6R: no closed form known, solved by elimination
    """
    axes = Axes.of(description)
    kinds = f"{axes.n}R" if set(axes.kinds) == {"R"} else axes.kinds
    found = _first(axes)
    if found is not None:
        family, fit = found
        count = len(fit.branches)
        branches = f"{count} branch{'es' if count > 1 else ''}"
        met = "" if len(fit.coordinates) == 6 else f"; meets {', '.join(fit.coordinates)}"
        words = f"{kinds}, {fit.geometry}: closed form, {branches}{met}"
        exactly = _first(Axes.of(description, _EXACT_MEMBER))
        is_exact = exactly is not None and exactly[0] is family
        is_refined = _has_neighbours(axes, fit) and not is_exact
        return Classification(words, family, fit, found if is_refined else None)
    redundant = _first(axes, REDUNDANT)
    if redundant is not None:
        family, fit = redundant
        value = f"closed form at a given {family.redundancy}, {len(fit.branches)} branches"
        return Classification(f"{kinds}, {fit.geometry}: {value}", None, None, redundant=redundant)
    words = f"{kinds}: no closed form known"
    near = _nearest_family(description)
    if near is not None:
        words += f" (nearly one of {kinds} with {near[1].geometry}, but not to {TOLERANCE:g}: are its angles rounded?"
        words += " as_designed=True (--as-designed) reads them as right angles)"
    elif kinds in _ELIMINATED:
        words += f", solved by elimination{_ELIMINATED[kinds]}"
    is_solved = near is not None and _has_neighbours(axes, near[1])
    return Classification(words, None, None, near if is_solved else None)


def _has_neighbours(axes: Axes, fit: Fit) -> bool:
    """Return whether arms that miss the family a little are solved from its members: those of six joints."""
    return axes.n == len(ALL_COORDINATES) and fit.coordinates == ALL_COORDINATES


def _nearest_family(description: Description) -> tuple[Family, Fit] | None:
    """Return the family that an arm misses by the smallest tolerance, with its member's fit; None if it is not near."""
    for tolerance in _NEAR_MISSES:
        near = _first(Axes.of(description, tolerance))
        if near is not None:
            return near
    return None


def _first(axes: Axes, families: Sequence[Family] = FAMILIES) -> tuple[Family, Fit] | None:
    """Return the first family that has these axes, and their fit; None if there is none."""
    for family in families:
        fit = family.fit(axes)
        if fit is not None:
            return family, fit
    return None
