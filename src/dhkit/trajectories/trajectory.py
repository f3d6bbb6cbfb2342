"""A motion of an arm as piecewise polynomials of time, with exact derivatives, and torques."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, Payload, Robot, description_of
from dhkit.description.arrays import number_array
from dhkit.description.joint_text import joint_text
from dhkit.errors import DescriptionError
from dhkit.formats import format_function
from dhkit.kernels import check_whole
from dhkit.symbolic import Friction
from dhkit.trajectories.interpolation import interpolated
from dhkit.trajectories.pieces import Pieces, Side, join
from dhkit.trajectories.samples import Samples

_JOIN_TOLERANCE = 1e-9
"""Largest distance of the ends of two motions that may follow one another, rad and m."""
_MAX_SLOWDOWN = 1e12
"""Largest factor by which a motion is slowed down or sped up: the powers of it up to 25 are doubles."""
_MOST_SAMPLES = 1e8
_SAME_TIME = 1e-9
"""A last sample closer to the end than this share of the sampling interval is the end."""


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """A motion q(t) = sum_j coefficients[k, j] (t - breaks[k])^j on interval k; immutable, equal to its copies.

    Parameters
    ----------
    description
        The robot.
    breaks
        Shape (K+1,), s, from 0, increasing.
    coefficients
        Shape (K, p+1, n), ascending powers, rad and m.
    report
        Report of its planner; ignored by equality.
    payload
        Load that the tool carries in addition to the robot; included in torques.
    friction
        Friction that the drives overcome; included in torques.

    Raises
    ------
    ValueError
        Other shapes, values that are not finite, or breaks that do not begin with 0 and increase.
    TypeError
        Not numbers.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> motion = Trajectory(library_robot("planar2r"), [0, 2], [[[0, 1], [0.5, 0]]])
    >>> motion.q(1.0), motion.qd([0.0, 1.0]).shape, motion.duration
    (array([0.5, 1. ]), (2, 2), 2.0)
    """

    description: Description
    breaks: Array
    coefficients: Array
    report: Any = None
    payload: Payload | None = None
    friction: Friction | None = None
    pieces: Pieces = field(init=False)
    """The same polynomials, without the robot."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "description", description_of(self.description))
        object.__setattr__(self, "friction", Friction.chosen(self.friction))
        if self.payload is not None and not isinstance(self.payload, Payload):
            raise TypeError(f"payload is {self.payload!r}; expected Payload(mass, com, inertia)")
        pieces = Pieces.of(self.breaks, self.coefficients, self.description.n)
        for name, value in (
            ("breaks", pieces.breaks),
            ("coefficients", pieces.coefficients),
            ("pieces", pieces),
        ):
            object.__setattr__(self, name, value)

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.description.n

    @cached_property
    def loaded(self) -> Description:
        """The robot with the payload.

        Raises
        ------
        DescriptionError
            The last link has no body that the payload could be added to.
        """
        return self.description if self.payload is None else self.payload.carried(self.description)

    @property
    def duration(self) -> float:
        """Duration, s."""
        return self.pieces.end

    def q(self, t: ArrayLike, side: Side = "right") -> Array:
        """Return joint values, shape (..., n), rad and m, for times of shape (...), s.

        Before the beginning and after the end the arm stands still at these. NaN times give NaN rows.

        Parameters
        ----------
        t
            Times, any shape.
        side
            The piece that is evaluated at a break: the one that begins (``"right"``) or ends there (``"left"``).

        Raises
        ------
        ValueError
            Another side.
        TypeError
            Times that are not numbers.
        """
        t = number_array(t, "t", "(...)")
        return self.pieces(np.clip(t, 0.0, self.duration), side)

    def qd(self, t: ArrayLike, side: Side = "right") -> Array:
        """Return joint rates, shape (..., n), as :meth:`q`: 0 before 0 and after the duration.

        Parameters
        ----------
        t
            Times, shape (...), s.
        side
            Side of a jump whose value is returned: ``"right"`` or ``"left"``.

        Examples
        --------
        >>> from dhkit import Arm
        >>> motion = Arm.load("planar2r").cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> motion.qd(1.0)
        array([0.375, 0.75 ])
        """
        return self._derivative(t, 1, side)

    def qdd(self, t: ArrayLike, side: Side = "right") -> Array:
        """Return joint accelerations, shape (..., n), as :meth:`qd`.

        Parameters
        ----------
        t
            Times, shape (...), s.
        side
            Side of a jump whose value is returned: ``"right"`` or ``"left"``.

        Examples
        --------
        >>> from dhkit import Arm
        >>> motion = Arm.load("planar2r").cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> motion.qdd(1.0)
        array([0., 0.])
        """
        return self._derivative(t, 2, side)

    def jerk(self, t: ArrayLike, side: Side = "right") -> Array:
        """Return the derivatives of the accelerations, shape (..., n), as :meth:`qd`.

        Parameters
        ----------
        t
            Times, shape (...), s.
        side
            Side of a jump whose value is returned: ``"right"`` or ``"left"``.

        Examples
        --------
        >>> from dhkit import Arm
        >>> motion = Arm.load("planar2r").cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> motion.jerk(1.0)
        array([-0.75, -1.5 ])
        """
        return self._derivative(t, 3, side)

    def tau(
        self, t: ArrayLike, friction: bool | Friction | None = None, side: Side = "right"
    ) -> Array:
        """Return joint torques by inverse dynamics with the payload, shape (..., n), N m and N.

        Parameters
        ----------
        t
            Times, any shape, s.
        friction
            Replaces the motion's own; False: none.
        side
            As for :meth:`q`.

        Raises
        ------
        DescriptionError
            A link without a body.
        """
        from dhkit.dynamics import inverse_dynamics

        q = self.q(t, side)
        qd = self.qd(t, side)
        qdd = self.qdd(t, side)
        chosen = self.friction if friction is None else friction
        return inverse_dynamics(
            self.loaded, q, qd, qdd, friction=False if chosen is None else chosen
        )

    def carrying(
        self, payload: Payload | None = None, friction: bool | Friction | None = None
    ) -> Trajectory:
        """Return the same motion with another payload and friction, none unless given; without the report.

        Parameters
        ----------
        payload
            Payload of the tool.
        friction
            Friction that the drives' torques include.

        Examples
        --------
        >>> from dhkit import Arm
        >>> motion = Arm.load("planar2r").cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> from dhkit import Payload
        >>> motion.carrying(Payload(0.5)).payload.mass
        0.5
        """
        return replace(self, report=None, payload=payload, friction=Friction.chosen(friction))

    def _derivative(self, t: ArrayLike, order: int, side: Side) -> Array:
        t = number_array(t, "t", "(...)")
        values = self.pieces.differentiated(order)(np.clip(t, 0.0, self.duration), side)
        values[(t < 0.0) | (t > self.duration)] = 0.0
        return values

    def sample(self, rate: float | None = None, n: int | None = None) -> Samples:
        """Return the motion at points in time.

        Parameters
        ----------
        rate
            Samples per second from 0 on, and the end.
        n
            Or number of samples, evenly spread, both ends included.

        Raises
        ------
        ValueError
            Not exactly one of both is given, the rate is not positive and finite, or n is below 2.
        """
        times = self.sample_times(rate, n)
        values = self.q(times), self.qd(times), self.qdd(times)
        return Samples(self.description, times, *values, self.payload, self.friction)

    def sample_times(self, rate: float | None = None, n: int | None = None) -> Array:
        """Return the times of :meth:`sample`, shape (N,), s.

        Parameters
        ----------
        rate
            Samples a second, Hz.
        n
            Number of samples, instead of a rate.

        Examples
        --------
        >>> from dhkit import Arm
        >>> motion = Arm.load("planar2r").cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> motion.sample_times(n=5)
        array([0. , 0.5, 1. , 1.5, 2. ])
        """
        if (rate is None) == (n is None):
            raise ValueError(f"sample: found rate={rate!r} and n={n!r}; expected one of them")
        if n is not None:
            check_whole("n", n, 2)
            return np.linspace(0.0, self.duration, n)
        if rate is None or not 0 < rate < np.inf:
            raise ValueError(f"rate is {rate!r}; expected a positive number of samples a second")
        if rate * self.duration > _MOST_SAMPLES:
            raise ValueError(
                f"rate is {rate:g}: {rate * self.duration:.3g} samples; expected {_MOST_SAMPLES:g} at most"
            )
        return np.append(
            np.arange(max(int(np.ceil(self.duration * rate - _SAME_TIME)), 1)) / rate, self.duration
        )

    def slowed(self, c: float) -> Trajectory:
        """Return the same path c times as slow, q(t / c), without the report.

        Parameters
        ----------
        c
            Factor of the duration; below 1 the motion is faster.

        Raises
        ------
        ValueError
            c is not from 1e-12 to 1e12.

        Examples
        --------
        >>> from dhkit import Arm
        >>> motion = Arm.load("planar2r").cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> motion.slowed(2.0).duration, motion.slowed(2.0).qd(2.0)
        (4.0, array([0.1875, 0.375 ]))
        """
        if not isinstance(c, Real) or not 1 / _MAX_SLOWDOWN <= c <= _MAX_SLOWDOWN:
            raise ValueError(f"c is {c!r}; expected a number from 1e-12 to 1e12")

        # sum of c_j (t / c)^j = sum of (c_j / c^j) t^j
        powers = np.arange(self.coefficients.shape[1])[:, None]
        return self._moved(self.breaks * c, self.coefficients / float(c) ** powers)

    def reversed(self) -> Trajectory:
        """Return the reversed motion, q(duration - t)."""
        back = self.pieces.backwards()
        return self._moved(back.breaks, back.coefficients)

    def _moved(self, breaks: Array, coefficients: Array) -> Trajectory:
        """Return another motion of the same robot, payload and friction."""
        return replace(self, breaks=breaks, coefficients=coefficients, report=None)

    def then(self, other: Trajectory) -> Trajectory:
        """Return this motion followed by another.

        Parameters
        ----------
        other
            Motion that begins where this one ends.

        Raises
        ------
        DescriptionError
            The other is a motion of another robot.
        ValueError
            The other does not begin where this one ends, to 1e-9 rad or m; names the joint. Or it has another payload
            or friction; see :meth:`carrying`.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("planar2r")
        >>> there = arm.cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> there.then(arm.cubic([0.5, 1.0], [0, 0], duration=1.0)).duration
        3.0
        """
        other.require(self.description)
        for what, own, theirs in (
            ("payload", self.payload, other.payload),
            ("friction", self.friction, other.friction),
        ):
            if own != theirs:
                raise ValueError(
                    f"{what} is {own} and then {theirs}; expected one: .carrying(...) sets it"
                )
        end = self.q(self.duration)
        start = other.q(0.0)
        apart = np.flatnonzero(np.abs(end - start) > _JOIN_TOLERANCE)
        if len(apart):
            i = int(apart[0])
            name = self.description.joints[i].name
            slides = bool(self.description.numbers.prismatic[i])
            here, there = (joint_text(x, slides=slides, digits=9) for x in (end[i], start[i]))
            raise ValueError(
                f"{name} ends at {here} and goes on from {there}; expected the same value"
            )
        return self._moved(*join(self.pieces, other.pieces))

    @classmethod
    def from_samples(
        cls,
        description: Description,
        times: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
    ) -> Trajectory:
        """Return a motion through samples.

        From joint values alone it is a cubic spline with continuous accelerations and not-a-knot ends (de Boor 1978, A
        Practical Guide to Splines, chapter IV), a line for two and a parabola for three samples. With rates it is
        piecewise cubic, with accelerations piecewise quintic, each interval determined by its ends.

        Parameters
        ----------
        description
            The robot.
        times
            Times, shape (N,), s, N >= 2, increasing; the motion begins with the first, which becomes 0.
        q, qd, qdd
            Joint values, rates and accelerations, shape (N, n) each, rad, m and seconds.

        Raises
        ------
        ValueError
            Other shapes, values that are not finite, times that do not increase, or accelerations without rates.
        TypeError
            Not numbers.
        """
        return cls(description, *interpolated(description, times, q, qd, qdd))

    # Robot

    def matches(self, description: Description) -> bool:
        """Return whether this is a motion of a robot."""
        description = description_of(description)
        return self.description == description or self.description.digest == description.digest

    def require(self, description: Description) -> None:
        """Check that this is a motion of a robot.

        Raises
        ------
        DescriptionError
            It is a motion of another robot; names both.
        """
        if not self.matches(description):
            own = self.description
            raise DescriptionError(
                f"the trajectory is one of {own.name} ({own.digest}); expected one of {description.name}"
                f" ({description.digest})"
            )

    # Files

    def save(self, path: str | Path, rate: float | None = None) -> Path:
        """Write a file by its suffix and return its path; see :func:`dhkit.trajectories.files.save_trajectory`.

        Parameters
        ----------
        path
            File; ``.npz`` and ``.mat`` keep the motion without loss, ``.csv`` samples, ``.yaml`` is ROS 2's
            ``JointTrajectory``.
        rate
            Samples a second of files of samples, Hz; 1000 unless given.

        Examples
        --------
        >>> from dhkit import Arm
        >>> motion = Arm.load("planar2r").cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> motion.save("motion.npz").name
        'motion.npz'
        """
        saved: Path = format_function("save_trajectory")(self, path, rate)
        return saved

    @classmethod
    def load(cls, path: str | Path, robot: Robot | None = None) -> Trajectory:
        """Read a file of :meth:`save`; see :func:`dhkit.trajectories.files.load_trajectory`. A robot may be an arm.

        Parameters
        ----------
        path
            File of :meth:`save`, ``.npz`` or ``.mat``.
        robot
            Robot, or arm, of the motion; the one that the file holds unless given. The file is refused on
            another robot.

        Examples
        --------
        >>> from dhkit import Arm
        >>> motion = Arm.load("planar2r").cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> Trajectory.load(motion.save("motion.npz")) == motion
        True
        """
        motion: Trajectory = format_function("load_trajectory")(
            path, None if robot is None else description_of(robot)
        )
        return motion

    @classmethod
    def read(
        cls,
        path: str | Path,
        robot: Robot,
        degrees: bool = False,
        columns: Mapping[str, str] | None = None,
    ) -> Trajectory:
        """Read samples from elsewhere; see :func:`dhkit.trajectories.files.read_samples`. A robot may be an arm.

        Parameters
        ----------
        path
            File of samples with a header.
        robot
            Robot, or arm, that moves.
        degrees
            Whether angles are in degrees.
        columns
            Names of the file's columns, by the names that dhkit gives them.
        """
        read_samples = format_function("read_samples")
        motion: Trajectory = read_samples(
            path, description_of(robot), degrees=degrees, columns=columns
        )
        return motion

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Trajectory):
            return NotImplemented
        return (
            self.matches(other.description)
            and (self.payload, self.friction) == (other.payload, other.friction)
            and np.array_equal(self.breaks, other.breaks)
            and np.array_equal(self.coefficients, other.coefficients)
        )

    def __hash__(self) -> int:
        return hash((self.n, self.coefficients.shape, self.duration))

    def __reduce__(self) -> tuple[type[Trajectory], tuple[Any, ...]]:
        return Trajectory, (
            self.description,
            self.breaks,
            self.coefficients,
            self.report,
            self.payload,
            self.friction,
        )

    def __repr__(self) -> str:
        pieces, powers = self.coefficients.shape[:2]
        load = "" if self.payload is None else f", carrying {self.payload.mass:.4g} kg"
        return (
            f"<Trajectory of {self.description.name}: {self.duration:.4g} s, {pieces} "
            f"{'piece' if pieces == 1 else 'pieces'} of degree {powers - 1}{load}>"
        )
