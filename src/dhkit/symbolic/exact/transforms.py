"""Rigid transforms with exact entries: the elementary motions that derivations multiply, and the inverse."""

from __future__ import annotations

import numpy as np

from dhkit.symbolic.ring import Direction, Element, Elements, Ring


def identity(ring: Ring) -> Elements:
    """Return the transform that moves nothing, shape (4, 4)."""
    T = np.full((4, 4), ring.zero, dtype=object)
    for i in range(4):
        T[i, i] = ring.one
    return T


def rotation(ring: Ring, first: int, second: int, direction: Direction) -> Elements:
    """Return the rotation by an angle (its cosine and sine) from one axis towards another, shape (4, 4).

    Axes count from 0: from y (1) to z (2) is a rotation about x.
    """
    T = identity(ring)
    c, s = direction
    T[first, first] = c
    T[first, second] = -s
    T[second, first] = s
    T[second, second] = c
    return T


def translation(ring: Ring, axis: int, length: Element) -> Elements:
    """Return the translation by a length (m) along an axis, shape (4, 4)."""
    T = identity(ring)
    T[axis, 3] = length
    return T


def inverse(T: Elements) -> Elements:
    """Return the inverse of a rigid transform, shape (4, 4)."""
    R = T[:3, :3]
    p = T[:3, 3]
    # The inverse of x -> R x + p is x -> R^T x - R^T p.
    result = T.copy()
    result[:3, :3] = R.T
    result[:3, 3] = -(R.T @ p)
    return result
