"""Intervals of the redundancy in which an arm of seven joints reaches a pose inside its limits.

With a spherical shoulder and a spherical wrist they end at roots of equations in the arm angle psi. The rotations of
link 3 and link 4 are a fixed rotation after a turn by psi about the line from the shoulder to the wrist, so that every
entry of their matrices is a + b cos(psi) + c sin(psi), and with it the components of axis 3 in frame 0, of axis 1 in
link 3, and those of axes 5 and 7 likewise:

    cos(theta_1) sin(theta_2),  sin(theta_1) sin(theta_2),  cos(theta_2),
    cos(theta_3) sin(theta_2),  sin(theta_3) sin(theta_2),

and the same of theta_5, theta_6 and theta_7. A joint at its limit makes one of them, or a combination of two, a known
number (Shimizu et al. 2008, see :mod:`dhkit.kinematics.closed_form.arm_angle`).

For other arms joint 7 is sampled.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description, takes_robot
from dhkit.kernels import pose_rows
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.candidates import are_poses
from dhkit.kinematics.chain import Chain
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.formulas import SINGULAR
from dhkit.kinematics.redundant import LAST_JOINT, AtRedundancy, check_seven, values_to_try

_STEP = np.pi / 360
_ACCURACY = 1e-9
"""Steps in which intervals of the redundancy are looked for, and accuracy of their ends, rad."""
_PARTS = 16
"""Parts into which the place of an end is divided again and again: a call takes about as long as 100 values in it."""
_THIRDS = np.array([0.0, 2 * np.pi / 3, 4 * np.pi / 3])
"""Arm angles from which a + b cos(psi) + c sin(psi) is known."""
_FROM_THIRDS = np.stack([np.full(3, 1 / 3), 2 / 3 * np.cos(_THIRDS), 2 / 3 * np.sin(_THIRDS)])
"""Maps values there to (a, b, c)."""
_TRIPLES = np.array([[0, 1, 2], [4, 5, 6]])
"""Joints of the shoulder and of the wrist, counted from 0."""
_TOUCHING = 1e-12
"""Share by which a root may be missed by rounding, and angle, rad, between two that are taken as one."""


@takes_robot
def redundancy_intervals(
    description: Description, T: ArrayLike, *, limits: bool = True
) -> list[tuple[float, float]]:
    """Return the intervals of the redundancy in which an arm of seven joints reaches a pose.

    Of an arm with a spherical shoulder and a spherical wrist their ends are roots of equations, to rounding; an
    interval narrower than 3e-6 rad may be missing. For other arms joint 7 is tried at steps of half a degree, and the
    ends are found to 1e-9 rad: an interval that is narrower than a step may be missing. So is the arm angle where the
    arm is stretched along axis 1, or axis 7, so that joints 1 and 3, or 5 and 7, turn about one line at every angle.

    Parameters
    ----------
    description
        The robot; seven revolute joints.
    T
        Pose of the tool in the world, shape (4, 4), m.
    limits
        Whether all joints must be inside their limits.

    Returns
    -------
    list[tuple[float, float]]
        Beginning and end of each interval, rad, in ascending order; of an arm angle in [-pi, pi], where one that goes
        through pi is in two parts.

    Raises
    ------
    ModelError, ValueError, TypeError
        As for :func:`solve_redundant`; T has not shape (4, 4).

    Examples
    --------
    >>> from dhkit.description import library_robot, world_to_tool
    >>> panda = library_robot("panda")
    >>> T = world_to_tool(panda, [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    >>> [(round(begin, 3), round(end, 3)) for begin, end in redundancy_intervals(panda, T)]
    [(-0.684, 2.254)]
    """
    pose = pose_rows(T)
    if pose.ndim != 2:
        raise ValueError(f"T has shape {pose.shape}; expected (4, 4)")
    if not are_poses(pose):
        raise ValueError("T is not a pose; expected a finite position and an orthonormal rotation")
    check_seven(description)
    solver = AtRedundancy.of(description)

    def is_reached(values: Array) -> NDArray[np.bool_]:
        found = solver(np.broadcast_to(pose, (len(values), 4, 4)), values)
        usable = found.allowed if limits else found.valid
        return np.asarray(usable.any(axis=-1))

    found = classify(description).redundant
    if found is None or found[0].redundancy == LAST_JOINT:
        return _sampled(is_reached, values_to_try(description))
    ends = np.array([-np.pi, np.pi])
    if limits:
        q = solver(np.broadcast_to(pose, (3, 4, 4)), _THIRDS).q
        theta = q + Chain.of(Axes.of(description)).offset
        is_aligned = np.abs(np.sin(theta[..., _TRIPLES[:, 1]])) < SINGULAR
        if np.isnan(q).any() or is_aligned.all(axis=(0, 1)).any():
            # Out of reach; or the outer joints of a triple turn about one line, so that their sum alone is known.
            return _sampled(is_reached, values_to_try(description))
        ends = np.sort(np.append(ends, _possible_ends(description, theta)))
        ends = ends[np.diff(ends, append=np.inf) > _TOUCHING]
    return _between(is_reached, ends)


def _between(
    is_reached: Callable[[Array], NDArray[np.bool_]], ends: Array
) -> list[tuple[float, float]]:
    """Return the intervals between ascending values (N,) in whose middle a pose is reached, neighbours joined."""
    inside = np.concatenate([[False], is_reached((ends[1:] + ends[:-1]) / 2), [False]])
    begins = ends[inside[1:] & ~inside[:-1]]
    stops = ends[inside[:-1] & ~inside[1:]]
    return list(zip(begins.tolist(), stops.tolist(), strict=True))


def _possible_ends(description: Description, theta: Array) -> Array:
    """Return the arm angles in (-pi, pi] at which a joint is at a limit, or may jump, shape (N,), rad.

    ``theta`` has the joints' angles at ``_THIRDS``, shape (3, 8, 7).
    """
    numbers = description.numbers
    offset = Chain.of(Axes.of(description)).offset[_TRIPLES]
    at_limits = np.stack([numbers.lower[_TRIPLES], numbers.upper[_TRIPLES]]) + offset
    at_limits = np.where(np.isfinite(at_limits), at_limits, np.nan)[:, None]

    # (a, b, c) of the components, first axis, for each sign of joint 4 and each triple, shape (3, 2, 2, 1 or 2).
    # One branch of each sign of joint 4 is enough: the others have the same components.
    angles = theta[:, [0, 4]][..., _TRIPLES]
    c, s = np.cos(angles), np.sin(angles)
    middle, outer = [1], [0, 2]
    polar = _coefficients(c[..., middle])
    along = _coefficients(c[..., outer] * s[..., middle])
    across = _coefficients(s[..., outer] * s[..., middle])

    # Zero where a joint is at a limit, one axis more for the two limits.
    limit = at_limits[..., outer]
    of_outer = np.cos(limit) * across[:, None] - np.sin(limit) * along[:, None]
    of_middle = np.broadcast_to(polar[:, None], (3, 2, 2, 2, 1)).copy()
    of_middle[0] -= np.cos(at_limits[..., middle])
    roots = _roots(np.concatenate([of_outer, of_middle], axis=-1).reshape(3, -1))
    # Joints 1 and 3, or 5 and 7, may jump where joint 2 or 6 lines them up, which is an extreme of its cosine.
    extreme = np.arctan2(polar[2], polar[1])
    found = np.concatenate([roots, extreme, extreme + np.pi], axis=None)
    # In (-pi, pi]; limits that are infinite are never met.
    ends: Array = np.pi - np.mod(np.pi - found[np.isfinite(found)], 2 * np.pi)
    return ends


def _coefficients(values: Array) -> Array:
    """Return a, b and c of functions a + b cos(psi) + c sin(psi) from values at ``_THIRDS``, both (3, ...)."""
    coefficients: Array = np.tensordot(_FROM_THIRDS, values, axes=1)
    return coefficients


def _roots(coefficients: Array) -> Array:
    """Return the roots of a + b cos(x) + c sin(x), of coefficients (3, N), shape (2, N), rad; NaN where it has none."""
    a, b, c = coefficients
    size = np.hypot(b, c)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = -a / size
    is_touching = np.abs(np.abs(cosine) - 1.0) < _TOUCHING
    cosine = np.where(is_touching, np.sign(cosine), cosine)
    is_root = np.abs(cosine) <= 1.0
    half = np.where(is_root, np.arccos(np.where(is_root, cosine, 0.0)), np.nan)
    roots: Array = np.arctan2(c, b) + np.stack([half, -half])
    return roots


def _sampled(
    is_reached: Callable[[Array], NDArray[np.bool_]], tried: Array
) -> list[tuple[float, float]]:
    """Return the intervals between the least and the largest of ``tried`` by samples, and their ends by bisection."""
    tried = np.sort(tried)
    count = int(np.ceil((tried[-1] - tried[0]) / _STEP)) + 1
    grid = np.linspace(tried[0], tried[-1], count)
    inside = is_reached(grid)
    change = np.flatnonzero(inside[1:] != inside[:-1])
    within = np.where(inside[change], grid[change], grid[change + 1])
    beyond = np.where(inside[change], grid[change + 1], grid[change])
    shares = np.arange(_PARTS + 1) / _PARTS
    while len(change) and np.abs(within - beyond).max() > _ACCURACY:
        places = within[:, None] + (beyond - within)[:, None] * shares
        reached = np.ones(places.shape, dtype=bool)
        reached[:, 1:-1] = is_reached(places[:, 1:-1].ravel()).reshape(len(change), -1)
        reached[:, -1] = False
        # The first place that is not reached, and the one before it.
        first = reached.argmin(axis=1)
        rows = np.arange(len(change))
        within = places[rows, first - 1]
        beyond = places[rows, first]

    ends = [*grid[:1][inside[:1]], *within, *grid[-1:][inside[-1:]]]
    return [(float(a), float(b)) for a, b in zip(ends[::2], ends[1::2], strict=True)]
