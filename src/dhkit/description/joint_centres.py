"""Joint centres of an arm whose table has lengths far beyond its size: points on its axes that lie close together.

The common normal of two nearly parallel axes may be kilometres away, and a and d with it. The arm itself is where its
joints are: on the axis of joint i, i = 1 to n, the point p_i is taken such that the sum over i = 0 to n of
|p_(i+1) - p_i|^2 is smallest, where p_0 is the origin of frame 0 and p_(n+1) the tool's origin. Each term is the length
of a link, which joint angles do not change.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dhkit.description.arrays import Array

FAR = 4.0
"""Ratio of the sum of abs(a) + abs(d) to the length along the joint centres from which a and d are not sizes."""
_Z = np.array([0.0, 0.0, 1.0])


class LinkEnds(NamedTuple):
    """The points at which each link, 0 to n, begins and ends, in its own DH frame, m: joint centres p_i and p_(i+1)."""

    begin: Array
    """Shape (n+1, 3); row 0 is the origin of frame 0."""
    end: Array
    """Shape (n+1, 3); row n is the tool's origin."""

    @property
    def lengths(self) -> Array:
        """Distances of both, shape (n+1,), m."""
        lengths: Array = np.linalg.norm(self.end - self.begin, axis=1)
        return lengths


def link_ends(
    a: Array, d: Array, cos_alpha: Array, sin_alpha: Array, *, is_standard: bool, tool: Array
) -> LinkEnds:
    """Return the ends of links at the joint centres of a table.

    Joint i turns about z of frame i - 1 (standard) or i (modified), and s_i is the height of its centre in that frame.
    In the frame of the link that it moves, and in that of the link before, it is at

        standard:  begin_i = (-a_i, (s_i - d_i) sin alpha_i, (s_i - d_i) cos alpha_i),    end_(i-1) = (0, 0, s_i),
        modified:  begin_i = (0, 0, s_i),    end_(i-1) = (a_i, -(s_i + d_i) sin alpha_i, (s_i + d_i) cos alpha_i),

    where a_i and alpha_i are those of row i. The heights minimise the sum of (end_i - begin_i)^2.

    Parameters
    ----------
    a, d, cos_alpha, sin_alpha
        Columns of the table, shape (n,), m; d of prismatic joints at zero.
    is_standard
        Whether the table is in the standard convention.
    tool
        The tool's origin in frame n, shape (3,), m.
    """
    n = len(a)
    # Points of joint i: offset + oblique s_i on the side of its row, and (0, 0, s_i) on the other side.
    sign = 1.0 if is_standard else -1.0
    oblique = np.stack([np.zeros(n), sign * sin_alpha, cos_alpha], axis=1)
    along_x = np.stack([a, np.zeros(n), np.zeros(n)], axis=1)
    offset = -sign * (along_x + d[:, None] * oblique)
    begin_offset = np.zeros((n + 1, 3))
    end_offset = np.zeros((n + 1, 3))
    end_offset[n] = tool
    begin_slope = np.zeros((n + 1, n, 3))
    end_slope = np.zeros((n + 1, n, 3))
    for i in range(n):
        if is_standard:
            begin_offset[i + 1] = offset[i]
            begin_slope[i + 1, i] = oblique[i]
            end_slope[i, i] = _Z
        else:
            begin_slope[i + 1, i] = _Z
            end_offset[i] = offset[i]
            end_slope[i, i] = oblique[i]

    # Ends are begin_offset + begin_slope s and end_offset + end_slope s: a linear least-squares problem in s.
    slopes = (end_slope - begin_slope).transpose(0, 2, 1).reshape(-1, n)
    constants = (end_offset - begin_offset).reshape(-1)
    s = np.linalg.lstsq(slopes, -constants, rcond=None)[0]
    begin = begin_offset + np.einsum("kix,i->kx", begin_slope, s)
    end = end_offset + np.einsum("kix,i->kx", end_slope, s)
    return LinkEnds(begin, end)
