"""Relations of axes in an exact chain, joints counted from 1, and names that steps share."""

from __future__ import annotations

from collections.abc import Sequence

from dhkit.symbolic.inverse.chain import ExactChain
from dhkit.symbolic.ring import Element, Elements

CENTRE = "the wrist centre"
"""Name of the wrist centre in sentences."""
TOOL = "the tool"
"""Name of the tool's origin in sentences."""
IN_THE_PLANE = "The arm moves in a plane: the pose has to lie in it."
"""Sentence of the condition on poses of planar arms."""


def parallel(chain: ExactChain, i: int) -> bool:
    """Return whether axes i and i + 1 are parallel."""
    return chain.alpha[i - 1][1].is_zero


def perpendicular(chain: ExactChain, i: int) -> bool:
    """Return whether axes i and i + 1 are at right angles."""
    return chain.alpha[i - 1][0].is_zero


def relative_sense(chain: ExactChain, i: int) -> Element:
    """Return 1 if parallel axes i and i + 1 have the same direction, -1 if opposite ones: cos(alpha_i)."""
    return chain.alpha[i - 1][0]


def origin(T: Elements) -> Elements:
    """Return the origin of a frame, shape (3,), m."""
    point: Elements = T[:3, 3]
    return point


def is_long(vector: Elements) -> bool:
    """Return whether a vector is not zero."""
    return any(not entry.is_zero for entry in vector)


def flipped(chain: ExactChain, sense: Element) -> Elements:
    """Return the rotation by 0 or pi about x, shape (3, 3): diag(1, sense, sense)."""
    R = chain.part(1, 0)[:3, :3].copy()
    R[1, 1] = R[2, 2] = sense
    return R


def sum_text(senses: Sequence[tuple[int, int]]) -> str:
    """Return a sentence on the sum phi of joint angles, each with 1 or -1."""
    # The first joint has the sense 1: its " + " is cut off.
    terms = "".join(f" {'+' if sense > 0 else '-'} theta{i}" for i, sense in senses)
    return f"Angles about parallel axes add up: phi = {terms[3:]}."
