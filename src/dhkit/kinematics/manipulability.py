"""Ability to move the tool at a configuration: manipulability, isotropy and their ellipsoids."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.display import listed, repr_line
from dhkit.kinematics.forward import forward_kinematics
from dhkit.kinematics.jacobian import jacobian

Motion: TypeAlias = Literal["translational", "rotational", "whole"]
"""Part of the tool's velocity: that of its origin, its angular velocity, or both (m and rad, unweighted)."""

_ROWS = {"translational": slice(0, 3), "rotational": slice(3, 6), "whole": slice(0, 6)}
_RANK_TOLERANCE = 1e-9
"""Singular values below this share of the largest count as 0: far above rounding, far below those of regular states."""
_RANK_SAMPLES = 4
"""Number of random configurations that determine the generic rank; each has it with probability 1."""
_FLATNESS = 6 * np.finfo(float).eps
"""An ellipsoid is flat if its shortest axis is at most this share of its longest, the rounding of an SVD."""


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """Ellipsoids in the world, one or a batch; NaN where the configuration is.

    A point of the surface is center + axes @ (lengths * u) with a unit vector u.
    """

    center: Array
    """The tool's origin, shape (..., 3), m."""
    axes: Array
    """Directions of the half axes in columns, the longest first, right-handed, shape (..., 3, 3)."""
    lengths: Array
    """Their lengths, shape (..., 3): (m/s or rad/s) per unit of joint rates, or (N or N m) per unit of joint torques;
    0 or infinite in a direction that the tool cannot move in."""

    def __repr__(self) -> str:
        shape = self.lengths.shape[:-1]
        if shape:
            return repr_line("Ellipsoid", summary=f"a batch of shape {shape}")
        return repr_line(
            "Ellipsoid", summary=f"half axes {listed(self.lengths)} about {listed(self.center)} m"
        )


@takes_robot
def manipulability(
    description: Description, q: ArrayLike, motion: Motion = "translational"
) -> Array:
    """Return Yoshikawa's manipulability: the volume of the velocity ellipsoid for joint rates of unit norm, unscaled.

    It is sqrt(det(J J^T)) (Yoshikawa, Manipulability of Robotic Mechanisms, 1985, eq. 9). For an arm that can never
    move its tool in all directions, it is the product of the :func:`freedoms` largest singular values: a planar arm
    with links l1 and l2 has l1 l2 abs(sin q2).

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.
    motion
        Rows of the Jacobian that are used. ``"whole"`` mixes m and rad: its values depend on the unit of length.

    Returns
    -------
    Array
        Shape (...), m/rad and m/m (rad/rad) to the power of the freedoms; 0 where singular, NaN where q is.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n); another motion.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> round(float(manipulability(library_robot("planar2r"), [0.2, 3.14159265 / 2])), 6)  # 0.5 m and 0.4 m long
    0.2
    """
    rank = freedoms(description, motion)
    if motion == "whole":
        sigma = singular_values(description, q, motion)
        return np.asarray(np.prod(sigma[..., :rank], axis=-1)) if rank else 0.0 * sigma[..., 0]
    return _volume(_rows(description, q, motion), rank)


@takes_robot
def isotropy(description: Description, q: ArrayLike, motion: Motion = "translational") -> Array:
    """Return the reciprocal of the condition number: 1 where all directions are alike, 0 where singular.

    Arguments are those of :func:`manipulability`. The smallest singular value that counts is that of the arm's
    :func:`freedoms` (Salisbury and Craig, Articulated Hands, 1982); an arm with none has 0.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.
    motion
        Rows of the Jacobian that are used: ``"translational"``, ``"rotational"`` or ``"whole"``, which
        mixes m and rad.

    Returns
    -------
    Array
        Shape (...), from 0 to 1; NaN where q is.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> float(isotropy(arm, [0.2, 0.0]).round(6))                      # stretched
    0.0
    """
    rank = freedoms(description, motion)
    sigma = singular_values(description, q, motion)
    if not rank:
        return 0.0 * sigma[..., 0]
    largest = sigma[..., 0]
    smallest = sigma[..., rank - 1]
    # A flat ellipsoid has the isotropy 0, and so has a Jacobian of zeros, where the quotient would be 0 / 0.
    flat = smallest <= _FLATNESS * largest
    return np.divide(np.where(flat, 0.0, smallest), np.where(flat, 1.0, largest))


@takes_robot
def condition_number(
    description: Description, q: ArrayLike, motion: Motion = "translational"
) -> Array:
    """Return the ratio of the largest to the smallest singular value, infinite where singular; see :func:`isotropy`.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.
    motion
        Rows of the Jacobian that are used: ``"translational"``, ``"rotational"`` or ``"whole"``, which
        mixes m and rad.

    Returns
    -------
    Array
        Shape (...), 1 at least.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> bool(condition_number(arm, [0.2, 0.0]) > 1e15)                 # stretched
    True
    """
    with np.errstate(divide="ignore"):
        return 1.0 / isotropy(description, q, motion)


@takes_robot
def singular_values(
    description: Description, q: ArrayLike, motion: Motion = "translational"
) -> Array:
    """Return the Jacobian's singular values, the largest first.

    Arguments are those of :func:`manipulability`.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.
    motion
        Rows of the Jacobian that are used: ``"translational"``, ``"rotational"`` or ``"whole"``, which
        mixes m and rad.

    Returns
    -------
    Array
        Shape (..., min(n, 3)), or (..., min(n, 6)) for the whole motion; NaN where q is.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> singular_values(arm, [0.2, 1.0]).shape
    (2,)
    """
    J, missing = _known(_rows(description, q, motion))
    sigma = np.asarray(np.linalg.svd(J, compute_uv=False), dtype=float)
    sigma[missing] = np.nan
    return sigma


@takes_robot
def freedoms(description: Description, motion: Motion = "translational") -> int:
    """Return the number of independent directions in which the tool can move: the generic rank of the Jacobian.

    Parameters
    ----------
    description
        The arm.
    motion
        Rows of the Jacobian that are used: ``"translational"``, ``"rotational"`` or ``"whole"``, which
        mixes m and rad.

    Returns
    -------
    int
        0 to 3; to 6 for ``"whole"``.

    Raises
    ------
    ValueError
        Another motion.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> freedoms(library_robot("planar3r")), freedoms(library_robot("planar3r"), "whole")
    (2, 3)
    """
    return _freedoms(description, motion)


@lru_cache(maxsize=256)
def _freedoms(description: Description, motion: Motion) -> int:
    q = np.random.default_rng(0).uniform(0.3, 1.2, (_RANK_SAMPLES, description.n))
    sigma = singular_values(description, q, motion)
    return int(np.sum(sigma > _RANK_TOLERANCE * sigma.max(initial=0.0), axis=-1).max())


@takes_robot
def velocity_ellipsoid(
    description: Description, q: ArrayLike, motion: Motion = "translational"
) -> Ellipsoid:
    """Return the tool's velocities for joint rates of unit norm: the ellipsoid v^T (J J^T)^-1 v = 1.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.
    motion
        ``"translational"`` or ``"rotational"``.

    Returns
    -------
    Ellipsoid
        Of shape (...), in world axes, m/s or rad/s.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n); another motion.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> ellipsoid = velocity_ellipsoid(library_robot("planar2r"), [0.0, 1.0])
    >>> ellipsoid.lengths.round(3)  # half axes, m/s; the third is across the plane
    array([0.865, 0.195, 0.   ])
    """
    if motion not in ("translational", "rotational"):
        raise ValueError(f"motion is {motion!r}; expected 'translational' or 'rotational'")
    J, missing = _known(_rows(description, q, motion))

    # With J = U diag(sigma) V^T the unit sphere of joint rates is mapped onto the ellipsoid with half axes sigma_i u_i.
    U, sigma, _ = np.linalg.svd(J)

    # The sign of a half axis is free: u_3 takes the one that makes U right-handed, det U = 1.
    U[..., 2] *= np.linalg.det(U)[..., None]

    # An arm with one or two joints has fewer than three singular values: the other half axes are 0.
    lengths = np.zeros((*U.shape[:-2], 3))
    lengths[..., : sigma.shape[-1]] = np.where(sigma <= _FLATNESS * sigma[..., :1], 0.0, sigma)
    for array in (U, lengths):
        array[missing] = np.nan
    return Ellipsoid(forward_kinematics(description, q)[..., :3, 3], U, lengths)


@takes_robot
def force_ellipsoid(
    description: Description, q: ArrayLike, motion: Motion = "translational"
) -> Ellipsoid:
    """Return the tool's forces (moments) for joint torques of unit norm: the ellipsoid f^T J J^T f = 1.

    It has the axes of the :func:`velocity_ellipsoid` and reciprocal lengths: where the tool moves fast it holds
    little (Yoshikawa 1985, section 6). A direction without motion is held by the structure: its length is infinite.
    Arguments are those of :func:`velocity_ellipsoid`.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.
    motion
        Rows of the Jacobian that are used: ``"translational"``, ``"rotational"`` or ``"whole"``, which
        mixes m and rad.

    Returns
    -------
    Ellipsoid
        Axes and lengths, N or N m for unit torques.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> force_ellipsoid(arm, [0.2, 1.0]).lengths.shape
    (3,)
    """
    velocity = velocity_ellipsoid(description, q, motion)
    with np.errstate(divide="ignore"):
        lengths = 1.0 / velocity.lengths[..., ::-1]

    # The torques are tau = J^T f, so that |tau|^2 = f^T J J^T f = sum_i (sigma_i u_i . f)^2: half axes u_i / sigma_i.
    # The longest is that of the smallest sigma_i. Reversing three columns changes the sign of det U, and reversing the
    # direction of one of them changes it back.
    signs = (1.0, -1.0, 1.0)
    axes = velocity.axes[..., ::-1] * signs
    return Ellipsoid(velocity.center, axes, lengths)


def _rows(description: Description, q: ArrayLike, motion: Motion) -> Array:
    if motion not in _ROWS:
        raise ValueError(f"motion is {motion!r}; expected {', '.join(map(repr, _ROWS))}")
    return jacobian(description, joint_array(description, q))[..., _ROWS[motion], :]


def _known(J: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return matrices (..., m, n) with those that contain NaN, which LAPACK refuses, set to 0; and a mask of them."""
    missing = np.asarray(np.isnan(J).any(axis=(-2, -1)))
    return np.where(missing[..., None, None], 0.0, J), missing


def _volume(J: Array, rank: int) -> Array:
    """Return the product of the ``rank`` singular values of matrices (..., 3, n) of that rank.

    Its square is the sum of the squares of all minors of that size (Cauchy and Binet), which, unlike det(J J^T),
    loses no digits near singularities.
    """
    if rank == 0:
        return 0.0 * J[..., 0, 0]

    # One singular value: sigma_1^2 = |J|_F^2.
    if rank == 1:
        return np.asarray(np.linalg.norm(J, axis=(-2, -1)))

    # The minors of columns a, b, c: the entries of a x b for 2 x 2, and (a x b) . c for 3 x 3. Components are arrays of
    # their own, contiguous, which takes a quarter of the time of np.cross.
    x, y, z = np.ascontiguousarray(np.moveaxis(J, (-2, -1), (0, 1)))  # (n, ...) each
    n = len(x)
    squares = np.zeros(J.shape[:-2])
    for i, j in combinations(range(n), 2):
        normal_x = y[i] * z[j] - z[i] * y[j]
        normal_y = z[i] * x[j] - x[i] * z[j]
        normal_z = x[i] * y[j] - y[i] * x[j]
        if rank == 2:
            squares += normal_x**2 + normal_y**2 + normal_z**2
            continue
        for k in range(j + 1, n):
            squares += (normal_x * x[k] + normal_y * y[k] + normal_z * z[k]) ** 2
    return np.sqrt(squares)
