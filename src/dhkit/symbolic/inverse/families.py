"""Families of arms whose inverse kinematics is derived, with their tests on the exact table and their steps.

The families are those of ``dhkit.kinematics.closed_form``, read anew from the table: axes i and i + 1 are parallel
where sin(alpha_i) is 0, at right angles where cos(alpha_i) is 0, and meet where a_i is 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dhkit.symbolic.inverse.chain import ExactChain
from dhkit.symbolic.inverse.planar import chain_fits, parallel_chain, polar, slider, slider_fits
from dhkit.symbolic.inverse.relations import perpendicular
from dhkit.symbolic.inverse.steps import Workbench
from dhkit.symbolic.inverse.turning_planes import (
    elbow,
    elbow_fits,
    five_joints,
    five_joints_fit,
    pan_tilt,
    pan_tilt_fits,
    parallel_fits,
    slide,
    slide_fits,
    three_parallel,
    turntable_fits,
    yaw_three,
    yaw_two,
)

_CHAINS = ("RR", "RRR", "RRPR", "RRRP", "PRRR", "RPRR", "RRP", "RPR", "PRR")
"""Kinds of joints of arms in parallel planes: two or three revolute joints and at most one prismatic one."""


@dataclass(frozen=True)
class Derivable:
    """A family of arms that share a derivation.

    Attributes
    ----------
    name
        Its identifier, as ``arm.family.name``.
    kinds
        Kinds of joints of its arms, one letter a joint.
    geometry
        The arrangement of its axes in words.
    fits
        Test whether an arm of these kinds belongs to it.
    derive
        Function that writes its steps on a workbench.
    undoes_tool
        Whether the constant transform after the last joint is divided out of the pose; arms with a wrist, or of five
        joints.
    aims
        Whether the derivation only points the tool at the pose's origin.
    """

    name: str
    kinds: tuple[str, ...]
    geometry: str
    fits: Callable[[ExactChain], bool]
    derive: Callable[[Workbench], None]
    undoes_tool: bool = False
    aims: bool = False


def family_of(chain: ExactChain) -> Derivable | None:
    """Return the family of an arm; None if it has none."""
    for family in FAMILIES:
        if chain.description.kinds in family.kinds and family.fits(chain):
            return family
    return None


FAMILIES = (
    Derivable(
        "elbow_wrist",
        ("RRRRRR",),
        "spherical wrist, axes 2 and 3 parallel",
        elbow_fits,
        elbow,
        True,
    ),
    Derivable(
        "slide_wrist",
        ("RRPRRR",),
        "spherical wrist, joint 3 slides at right angles to axis 2",
        slide_fits,
        slide,
        True,
    ),
    Derivable(
        "three_parallel",
        ("RRRRRR",),
        "axes 2, 3 and 4 parallel, 5 and 6 meet",
        parallel_fits,
        three_parallel,
        True,
    ),
    Derivable(
        "five_joints",
        ("RRRRR",),
        "a turntable, axes 2, 3 and 4 parallel, axis 5 across them",
        five_joints_fit,
        five_joints,
        True,
    ),
    Derivable(
        "yaw_three", ("RRRR",), "a turntable, axes 2, 3 and 4 parallel", turntable_fits, yaw_three
    ),
    Derivable("yaw_two", ("RRR",), "a turntable, axes 2 and 3 parallel", turntable_fits, yaw_two),
    Derivable(
        "pan_tilt",
        ("RR",),
        "pan and tilt: axes 1 and 2 at right angles",
        pan_tilt_fits,
        pan_tilt,
        aims=True,
    ),
    Derivable("parallel_chain", _CHAINS, "parallel axes", chain_fits, parallel_chain),
    Derivable(
        "polar",
        ("RP",),
        "a slide at right angles to a revolute axis",
        lambda chain: perpendicular(chain, 1),
        polar,
    ),
    Derivable("slider", ("PR",), "a revolute axis at right angles to a slide", slider_fits, slider),
)
"""All families, in the order in which they are tried."""
