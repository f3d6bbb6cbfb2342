"""Result of inverse kinematics: every branch of every pose, and why some are missing."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from itertools import islice, product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description, joint_array
from dhkit.display import MOST_ROWS, counted, html_block, html_table, repr_line
from dhkit.errors import UnreachableError

LIMIT_SLACK = 1e-9
"""rad or m: how far outside its limits a joint still counts as inside, for rounding."""
_SLACK = LIMIT_SLACK * 1.001
"""The same for whole turns that are added to angles that count as inside: more, for their own rounding."""
_FIRST = 5
"""Poses of a batch that a notebook shows."""


class IKStatus(IntEnum):
    """Outcome of a pose: the numbers of ``IKSolutions.status_code``."""

    ok = 0
    singular = 1
    """Reached, but a branch is at a singularity: see its flags."""
    out_of_reach = 2
    """No solution exists: by a closed form, because the arm is too short, or because the polynomial of six joints,
    computed in floating-point numbers, has no real root."""
    not_a_pose = 3
    """The matrix has NaN, or its rotation is not orthonormal to 2e-6."""
    not_found = 4
    """No solution was found, which does not prove that there is none."""


class IKFlag(IntFlag):
    """Special properties of a branch; several may hold."""

    shoulder = 1
    """The wrist centre is where joint 1 cannot move it out of the arm's plane."""
    elbow = 2
    """The arm is stretched or folded."""
    wrist = 4
    """Two axes of the wrist coincide."""
    clamped = 8
    """The pose was beyond reach by no more than rounding, and counts as on the boundary."""
    out_of_limits = 16
    """Some joint is outside its limits, whatever whole turns are added."""
    refined = 32
    """Found by Newton's method from a solution of a neighbouring arm, as its own has no closed form: see
    :mod:`dhkit.kinematics.neighbour`."""
    singular = 64
    """The smallest singular value of the Jacobian, lengths over the reach, is below 1e-5: of arms without a closed
    form, whose singularities have no names."""


@dataclass(frozen=True, eq=False)
class IKSolutions:
    """All solutions of a batch of poses, in B branches.

    In closed form the branches are the same for every pose, in a fixed order. By elimination they are the solutions,
    sorted by joint 1 and then by the others, and B is the largest number of them at a pose of the batch.

    Rows of branches that do not reach the pose are NaN. Angles are in (-pi, pi].
    """

    q: Array
    """Joint values, shape (..., B, n), rad and m."""
    valid: NDArray[np.bool_]
    """Whether the branch reaches the pose, shape (..., B); limits do not count."""
    flags: NDArray[np.uint8]
    """Sums of :class:`IKFlag`, shape (..., B)."""
    status_code: NDArray[np.uint8]
    """:class:`IKStatus` of each pose, shape (...)."""
    distance: Array
    """Distance, m, shape (...), from the point that decides the reach (the wrist's centre, or the tool) to the nearest
    reachable one: exact for arms with a spherical wrist, an upper bound for others, of seven joints at the redundancy
    that was taken. 0 where the pose is reached, NaN where it is not a pose, or not reached by an elimination or an
    iteration, which know no distance. Joint limits do not count."""
    branches: tuple[str, ...]
    """The branches' names, in words that :meth:`branch` understands."""
    met: tuple[str, ...]
    """Coordinates of a pose that the arm meets: all six, or fewer for arms of fewer freedoms."""
    description: Description
    """The robot."""
    complete: bool = True
    """Whether a pose that is reached has no other solutions than these; False where they were found by iteration, which
    may miss some, and for arms of seven joints, which have infinitely many."""
    redundancy: Array | None = None
    """For arms of seven joints the redundancy of each pose's solutions, joint 7 or the arm angle, shape (...), rad."""

    @classmethod
    def of_packed(
        cls,
        q: Array,
        packed: bytes,
        shared: Mapping[str, object],
        complete: bool = True,
        redundancy: Array | None = None,
    ) -> IKSolutions:
        """Return the solutions of few poses, whose other fields are made when one of them is first read.

        Parameters
        ----------
        q
            Joint values, shape (B, n) or (N, B, n), rad and m.
        packed
            Of each pose ``distance`` as a double, then B bytes of ``valid``, B of ``flags``, and ``status_code``.
        shared
            ``branches``, ``met`` and ``description``, which are the same for all poses; and ``batch``, the shape of the
            batch.
        complete, redundancy
            The fields of these names.
        """
        # Making an object as usual, and four arrays, would take longer than inverse kinematics.
        solutions = object.__new__(cls)
        own = solutions.__dict__
        own["q"] = q
        own["_packed"] = packed
        own["_shared"] = shared
        if not complete:
            own["complete"] = False
            own["redundancy"] = redundancy
        return solutions

    def with_later_distance(self, distance: Callable[[], Array]) -> IKSolutions:
        """Return the same solutions, whose distance is computed when it is first read, for it may take long.

        Parameters
        ----------
        distance
            Returns the distances, m, in an array of their shape.
        """
        solutions = object.__new__(type(self))
        own = {name: value for name, value in self.__dict__.items() if name != "distance"}
        object.__setattr__(solutions, "__dict__", {**own, "_later_distance": distance})
        return solutions

    def __getattr__(self, name: str) -> Any:
        """Return a field of :meth:`of_packed` or :meth:`with_later_distance` that is read for the first time."""
        if name == "distance" and (later := self.__dict__.get("_later_distance")) is not None:
            # Of two threads that read first, both get the same array.
            return self.__dict__.setdefault(name, later())
        packed = self.__dict__.get("_packed")
        is_packed = name in ("distance", "valid", "flags", "status_code")
        if packed is not None and name in ("branches", "met", "description"):
            return self.__dict__["_shared"][name]
        if packed is None or not is_packed:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        # Not that of ``q``: the caller may have changed the shape of the array given as out= meanwhile.
        batch = self.__dict__["_shared"]["batch"]
        B = len(self.branches)
        of_pose = [
            ("distance", np.float64),
            ("valid", np.bool_, (B,)),
            ("flags", np.uint8, (B,)),
            ("status_code", np.uint8),
        ]
        poses = np.frombuffer(packed, of_pose)
        for field in poses.dtype.names or ():
            values = poses[field].copy()
            # Of two threads that read first, both get the same arrays.
            self.__dict__.setdefault(field, values.reshape((*batch, *values.shape[1:])))
        return self.__dict__[name]

    @property
    def lower(self) -> Array:
        """The joints' lower limits, shape (n,), rad and m; -inf where there are none."""
        return self.description.numbers.lower

    @property
    def upper(self) -> Array:
        """The joints' upper limits, shape (n,), rad and m; inf where there are none."""
        return self.description.numbers.upper

    @property
    def prismatic(self) -> NDArray[np.bool_]:
        """Whether each joint is prismatic, shape (n,)."""
        return self.description.numbers.prismatic

    @property
    def status(self) -> NDArray[np.str_]:
        """Names of the status of the poses, shape (...): ok, singular, out_of_reach, not_a_pose or not_found."""
        return np.array([status.name for status in IKStatus])[self.status_code]

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether some branch reaches the pose, shape (...); the status is then ok or singular."""
        return np.asarray(self.valid.any(axis=-1))

    @property
    def allowed(self) -> NDArray[np.bool_]:
        """Whether the branch reaches the pose and is inside the limits, shape (..., B)."""
        inside: NDArray[np.bool_] = self.valid & (self.flags & IKFlag.out_of_limits == 0)
        return inside

    def branch(self, name: str) -> Array:
        """Return the joint values of one branch, shape (..., n), NaN where it does not reach.

        Parameters
        ----------
        name
            Words of the branch's name in any order, such as ``"left up flip"``, enough to tell it from the others.

        Raises
        ------
        ValueError
            No branch, or more than one, has all these words.
        """
        if not isinstance(name, str):
            raise TypeError(
                f"branch {name!r}; expected words of one of {', '.join(map(repr, self.branches))}"
            )
        words = (
            name.lower()
            .replace("no flip", "no-flip")
            .replace("noflip", "no-flip")
            .replace(",", " ")
            .split()
        )
        chosen = [k for k, branch in enumerate(self.branches) if set(words) <= set(branch.split())]
        if len(chosen) != 1:
            found = "no branch" if not chosen else f"{len(chosen)} branches"
            raise ValueError(
                f"{name!r} fits {found}; expected one of {', '.join(map(repr, self.branches))}"
            )
        return self.q[..., chosen[0], :]

    def nearest(self, q: ArrayLike, *, limits: bool = False) -> Array:
        """Return for each pose the solution nearest to ``q``, in the winding nearest to it.

        Parameters
        ----------
        q
            Joint values, shape (n,) or (..., n), rad and m.
        limits
            Whether it must be inside the joint limits, in a winding that they allow.

        Returns
        -------
        Array
            Shape (..., n): the branch of least sum of squared joint differences, angles the short way round, whole
            turns added so that it is near ``q``. NaN where no branch reaches; :meth:`require` raises instead.

        Raises
        ------
        ValueError
            ``q`` does not fit.
        """
        near = self._near(q)
        if limits:
            return self._closest(self.within_limits(near), near, self.allowed)
        return self._closest(self.wound(self.q, near[..., None, :], limits=False), near, self.valid)

    def within_limits(self, near: ArrayLike | None = None) -> Array:
        """Return all branches inside the joint limits, shape (..., B, n), rad and m, the others NaN.

        Parameters
        ----------
        near
            Joint values, shape (n,) or (..., n), rad and m: each angle gets the whole turns that bring it nearest to
            its entry, as far as the limits allow. Unless given, the middle of the limits, or 0 without limits.

        Raises
        ------
        ValueError
            ``near`` does not fit.
        """
        at = self._near(near)[..., None, :]
        return np.where(self.allowed[..., None], self.wound(self.q, at, limits=True), np.nan)

    def wound(self, q: Array, near: Array, *, limits: bool) -> Array:
        """Return joint values (..., n), rad and m, with whole turns added to bring each angle nearest to ``near``.

        With limits, as near as they allow; angles that no winding brings inside them stay outside.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m.
        near
            Joint values to come near to, shape (..., n).
        limits
            Whether angles stay inside the joint limits.
        """
        if limits:
            return wound(q, near, self.lower, self.upper, self.prismatic)
        anywhere = np.full(self.lower.shape, np.inf)
        return wound(q, near, -anywhere, anywhere, self.prismatic)

    def windings(self, branch: str) -> list[Array]:
        """Return all joint values (n,), rad and m, inside the limits that are one pose's branch plus whole turns.

        Joints without limits stay as they are.

        Parameters
        ----------
        branch
            Name of the branch.

        Raises
        ------
        ValueError
            A batch of poses, or no such branch.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("puma560")
        >>> solutions = arm.ik(arm.fk("nominal"))
        >>> len(solutions.windings("left up no-flip"))
        1
        """
        if self.status_code.shape != ():
            raise ValueError(
                f"windings of a batch of shape {self.status_code.shape}; expected one pose"
            )
        q = self.branch(branch)
        choices = [self._choices(i, float(q[i])) for i in range(len(q))]
        return [np.array(choice) for choice in product(*choices)]

    def require(self, near: ArrayLike | None = None) -> Array:
        """Return one solution inside the limits for each pose, shape (..., n), rad and m, the nearest to ``near``.

        Parameters
        ----------
        near
            Joint values to come near to, shape (n,) or (..., n), rad and m; the middle of the limits unless
            given.

        Raises
        ------
        UnreachableError
            Some pose has none: says which, and why.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("puma560")
        >>> q = arm.ik(arm.fk("nominal")).require(near=arm.configurations["nominal"])
        >>> bool(abs(q - arm.configurations["nominal"]).max() < 1e-9)
        True
        """
        at = self._near(near)
        chosen = self._closest(self.within_limits(at), at, self.allowed)
        missing = np.argwhere(np.isnan(chosen).any(axis=-1))
        if len(missing):
            raise UnreachableError(self._reason(tuple(int(k) for k in missing[0]), len(missing)))
        return chosen

    def __len__(self) -> int:
        return len(self.branches)

    def __repr__(self) -> str:
        of = f"{counted(self.status_code.size, 'pose')}, {counted(len(self), 'branch')}"
        if self.status_code.shape:
            counts = ", ".join(f"{count} {status.name}" for status, count in self._counts)
            return repr_line("IKSolutions", of, counts + self._doubt)
        return repr_line("IKSolutions", of, self._summary)

    def _repr_html_(self) -> str:
        return self._batch_html() if self.status_code.shape else self._pose_html()

    def _pose_html(self) -> str:
        """Return the branches of one pose: angles in degrees, lengths in m."""
        units = ["m" if slides else "°" for slides in self.prismatic]
        scale = np.where(self.prismatic, 1.0, 180 / np.pi)
        rows = []
        for k, branch in enumerate(self.branches):
            if self.valid[k]:
                values = zip(self.q[k] * scale, self.prismatic, strict=True)
                numbers = [
                    f"{round(x, 4) + 0.0:.4f}" if slides else f"{round(x, 2) + 0.0:.2f}"
                    for x, slides in values
                ]
                rows.append(
                    (
                        branch,
                        *numbers,
                        "inside" if self.allowed[k] else "outside",
                        _special(self.flags[k]),
                    )
                )
            elif len(self) <= MOST_ROWS:
                rows.append((branch, *("–" for _ in units), "", "not reached"))
        headings = (
            "branch",
            *(f"q{i} [{unit}]" for i, unit in enumerate(units, start=1)),
            "limits",
            "special",
        )
        table = (
            html_table(headings, rows, align="l" + "r" * len(units) + "l")
            if self.valid.any()
            else ""
        )
        return html_block(f"{counted(len(self), 'branch')}: {self._summary}", table)

    def _batch_html(self) -> str:
        """Return the number of poses with each status, and the outcome of the first poses."""
        counts = [(status.name, str(count)) for status, count in self._counts]
        first = list(islice(np.ndindex(self.status_code.shape), _FIRST))
        rows = [
            (
                str(place[0] if len(place) == 1 else place),
                IKStatus(int(self.status_code[place])).name,
                str(int(self.valid[place].sum())),
                str(int(self.allowed[place].sum())),
                f"{self.distance[place]:.4g}" if self.distance[place] > 0 else "",
            )
            for place in first
        ]
        headings = ("pose", "status", "branches reached", "inside limits", "out of reach by [m]")
        return html_block(
            f"{counted(self.status_code.size, 'pose')}, {counted(len(self), 'branch')}: q of shape {self.q.shape}",
            html_table(("status", "poses"), counts, align="lr"),
            html_table(headings, rows, align="llr", count=self.status_code.size),
        )

    @property
    def _summary(self) -> str:
        """Outcome of one pose, in words."""
        status = IKStatus(int(self.status_code))
        is_told = status is IKStatus.out_of_reach and self._knows_distance and self.distance > 0
        missed = f" by {float(self.distance):.4g} m" if is_told else ""
        return f"{status.name}{missed}, {self.valid.sum()} reached, {self.allowed.sum()} inside the limits{self._doubt}"

    @property
    def _knows_distance(self) -> bool:
        """Whether ``distance`` is that from the whole workspace: not of one redundancy."""
        return self.redundancy is None

    @property
    def _doubt(self) -> str:
        is_one_of_many = len(self) == 1  # of an iteration, which looks for one
        return "" if self.complete or is_one_of_many else ", may be incomplete"

    @property
    def _counts(self) -> list[tuple[IKStatus, int]]:
        """Number of poses with each status that occurs."""
        counts = [(status, int(np.sum(self.status_code == status))) for status in IKStatus]
        return [(status, count) for status, count in counts if count]

    def _near(self, q: ArrayLike | None) -> Array:
        """Return joint values of shape (..., n): given ones, or the middle of the limits, 0 where there are none."""
        if q is None:
            limited = np.isfinite(self.lower) & np.isfinite(self.upper)
            q = (np.where(limited, self.lower, 0.0) + np.where(limited, self.upper, 0.0)) / 2
        near = joint_array(self.description, q, "joint values")
        expected = (*self.status_code.shape, self.q.shape[-1])
        if near.shape[-1:] == expected[-1:] and near.ndim <= len(expected):
            with contextlib.suppress(ValueError):
                return np.broadcast_to(near, expected)
        raise ValueError(
            f"joint values have shape {near.shape}; expected {expected[-1:]} or {expected}"
        )

    def _closest(self, q: Array, near: Array, usable: NDArray[np.bool_]) -> Array:
        """Return the usable branch with the least squared distance from ``near``, (..., n); NaN if there is none."""
        gaps = np.where(usable, np.sum((q - near[..., None, :]) ** 2, axis=-1), np.inf)
        best = np.argmin(np.where(np.isnan(gaps), np.inf, gaps), axis=-1)
        chosen = np.take_along_axis(q, best[..., None, None], axis=-2)[..., 0, :]
        return np.where(np.any(usable, axis=-1, keepdims=True), chosen, np.nan)

    def _choices(self, i: int, value: float) -> list[float]:
        """Return the values of joint i (from 0) inside its limits that differ from one by whole turns."""
        lower = float(self.lower[i])
        upper = float(self.upper[i])
        if np.isnan(value):
            return []
        if self.prismatic[i] or not (np.isfinite(lower) and np.isfinite(upper)):
            return (
                [value]
                if lower - LIMIT_SLACK <= value <= upper + LIMIT_SLACK or np.isinf(upper - lower)
                else []
            )

        # All whole k with lower <= value + 2 pi k <= upper.
        first = int(np.ceil((lower - _SLACK - value) / math.tau))
        last = int(np.floor((upper + _SLACK - value) / math.tau))
        return [value + math.tau * k for k in range(first, last + 1)]

    def _reason(self, place: tuple[int, ...], count: int) -> str:
        index = place[0] if len(place) == 1 else place
        where = f"pose {index}" if place else "the pose"
        others = f" (one of {count} without a solution inside the limits)" if count > 1 else ""
        status = IKStatus(int(self.status_code[place]))
        if status is IKStatus.not_a_pose:
            return f"{where}{others} is not a pose: NaN, or a rotation that is not orthonormal"
        if status is IKStatus.not_found and self.redundancy is not None:
            value = float(self.redundancy[place])
            return (
                f"{where}{others}: no solution was found at the redundancy {value:.6g} rad, which does not prove that "
                "there is none at another; arm.redundancy_intervals tells where there are some"
            )
        if status is IKStatus.not_found:
            return (
                f"{where}{others}: no solution was found, which does not prove that there is none"
            )
        if status is IKStatus.out_of_reach:
            distance = float(self.distance[place])
            return f"{where}{others} is out of reach" + (
                f" by {distance:.4g} m" if self._knows_distance and distance > 0 else ""
            )
        return f"{where}{others} is reached only outside the joint limits"


def wound(q: Array, near: Array, lower: Array, upper: Array, prismatic: NDArray[np.bool_]) -> Array:
    """Return joint values (..., n), rad and m, with the whole turns that bring each angle nearest to ``near``.

    Parameters
    ----------
    q, near
        Joint values, and those to come near to, shape (..., n).
    lower, upper
        Limits that angles keep or come as near to as they can, shape (n,).
    prismatic
        Whether each joint is prismatic, shape (n,).
    """
    # q + 2 pi k with k the whole number nearest to (near - q) / (2 pi), and lower <= q + 2 pi k <= upper.
    with np.errstate(invalid="ignore"):
        turns = np.rint((near - q) / math.tau)
        first = np.ceil((lower - _SLACK - q) / math.tau)
        last = np.floor((upper + _SLACK - q) / math.tau)
        turns = np.clip(turns, first, last)
        # Where no turn leads inside, that of the smallest excess: the last is then one less than the first.
        is_outside = first > last
        excess = q + math.tau * first - upper
        lack = lower - (q + math.tau * last)
        turns = np.where(is_outside & (excess < lack), first, turns)
    return q + math.tau * np.where(prismatic | ~np.isfinite(turns), 0.0, turns)


def _special(flags: int) -> str:
    """Return the names of the flags of a branch besides that of its limits, separated by commas."""
    special = IKFlag(int(flags)) & ~IKFlag.out_of_limits
    return ", ".join(str(flag.name) for flag in special)
