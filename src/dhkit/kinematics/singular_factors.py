"""The factors of a Jacobian's determinant that vanish at the singularities of arms with a closed form.

A factor is its :attr:`size` times a measure without unit that is at most about 1, and that flags of inverse kinematics
are set by (:class:`dhkit.kinematics.IKFlag`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

Kind: TypeAlias = Literal["shoulder", "elbow", "wrist"]
TURN = 2 * np.pi
NOTHING = 1e-12
"""Share of the lengths at hand below which a number is rounding and not worth a term."""


@dataclass(frozen=True)
class Turn:
    """A factor size abs(sin(sense q + zero)) of one revolute joint."""

    kind: Kind
    joint: int
    """From 0."""
    sense: float
    """+1 or -1."""
    zero: float
    """The angle at q = 0, rad."""
    size: float
    """m^2, or 1."""
    becomes: tuple[str, str]
    """What is so where the angle is 0, and where it is pi."""

    def measure(self, q: Array) -> Array:
        """Return abs(sin) for joint values (..., n), shape (...)."""
        return np.asarray(np.abs(np.sin(self.sense * q[..., self.joint] + self.zero)))

    @property
    def values(self) -> tuple[float, ...]:
        """The two joint values where it vanishes, rad, in (-pi, pi]: at the angle 0, then at pi."""
        return _wrapped(-self.sense * self.zero), _wrapped(self.sense * (np.pi - self.zero))

    def words(self, point: str) -> str:
        """Return where it vanishes."""
        first, second = (_degrees(value) for value in self.values)
        name, (at_zero, at_pi) = f"q{self.joint + 1}", self.becomes
        if at_zero == at_pi:
            return f"{name} = {first} or {second}: {at_zero}"
        return f"{name} = {first} ({at_zero}) or {second} ({at_pi})"

    def met(self, q: Array, lower: Array, upper: Array, rng: np.random.Generator) -> Array:
        """Return joint values (k, n) with this joint's moved to where it vanishes, inside limits if possible."""
        low, high = lower[self.joint], upper[self.joint]
        values = _wound(np.array(self.values), low, high)
        inside = values[(values >= low) & (values <= high)]
        moved = q.copy()
        moved[:, self.joint] = rng.choice(inside if len(inside) else values, len(q))
        return moved


@dataclass(frozen=True)
class Slide:
    """A factor abs(q + start) of a prismatic joint."""

    kind: ClassVar[Kind] = "elbow"
    joint: int
    """From 0."""
    start: float
    """m."""
    lift: float
    """Distance from axis to point that stays, m."""
    size: float
    """The reach, m."""

    def measure(self, q: Array) -> Array:
        """Return the length that is left, as a share of the reach, for joint values (..., n)."""
        return np.abs(q[..., self.joint] + self.start) / self.size

    @property
    def values(self) -> tuple[float, ...]:
        """The joint value where it vanishes, m."""
        return (-self.start + 0.0,)

    def words(self, point: str) -> str:
        """Return where it vanishes."""
        axis = f"axis {self.joint}"
        near = f"{self.lift:.6g} m from {axis}, as near as it gets" if self.lift else f"on {axis}"
        return f"q{self.joint + 1} = {self.values[0]:.6g} m: {point} is {near}"

    def met(self, q: Array, lower: Array, upper: Array, rng: np.random.Generator) -> Array:
        """Return joint values (k, n) with this joint's moved to where it vanishes."""
        moved = q.copy()
        moved[:, self.joint] = self.values[0]
        return moved


@dataclass(frozen=True)
class Link:
    """A vector e^(i (q2 + turns)) c in an arm's plane, or that times a slide's length."""

    c: complex
    """The vector at zero joint values, x + i u, m; for a slide its direction."""
    senses: tuple[float, ...] = ()
    """How joint 3, 4 ... turn it beyond joint 2: +1 or -1."""
    slide: int | None = None
    """The prismatic joint, from 0, whose value is a factor."""

    def value(self, q: Array) -> NDArray[np.complex128]:
        """Return the vector before joint 2 turns it, for joint values (..., n), shape (...)."""
        turned = self.c * np.exp(1j * (q[..., 2 : 2 + len(self.senses)] @ np.array(self.senses)))
        return np.asarray(turned if self.slide is None else turned * q[..., self.slide])

    def terms(self, least: float) -> list[tuple[float, str]]:
        """Return the summands of its x as numbers, at least so large, and what they are multiplied by."""
        names = "".join(f" {'+' if s > 0 else '-'} q{k + 3}" for k, s in enumerate(self.senses))
        angle = f"(q2{names})" if names else " q2"
        slide = "" if self.slide is None else f"q{self.slide + 1} "
        parts = [(self.c.real, f"{slide}cos{angle}"), (-self.c.imag, f"{slide}sin{angle}")]
        return [(number, text) for number, text in parts if abs(number) > least]


@dataclass(frozen=True)
class Side:
    """The factor abs(x): how far a point is from axis 1 along the arm's plane.

    x = a1 + Re(sum of links) (:mod:`dhkit.kinematics.closed_form.arm_plane`).
    """

    kind: ClassVar[Kind] = "shoulder"
    a1: float
    """m."""
    links: tuple[Link, ...]
    offset: float
    """The point's distance from axis 1 across the plane, m, with a sign."""
    size: float
    """The reach, m."""
    values: ClassVar[tuple[float, ...]] = ()

    def measure(self, q: Array) -> Array:
        """Return abs(x) as a share of the reach for joint values (..., n), shape (...)."""
        return np.asarray(np.abs(self.a1 + (np.exp(1j * q[..., 1]) * self._arm(q)).real) / self.size)

    def radii(self, lower: Array, upper: Array) -> tuple[float, float]:
        """Return the least and the largest distance of the point from axis 2, m, with slides inside limits (n,)."""
        fixed = [link.c for link in self.links if link.slide is None]
        slides = [(link.c, link.slide) for link in self.links if link.slide is not None]
        if not slides:
            return link_radii([abs(c) for c in fixed])
        ((direction, joint),) = slides
        start = sum(fixed) / direction
        return slide_radii(start.real, start.imag, float(lower[joint]), float(upper[joint]))

    @property
    def missed(self) -> bool:
        """Whether the factor never vanishes: the turntable is wider than the arm is long."""
        if any(link.slide is not None for link in self.links):
            return False
        return abs(self.a1) > sum(abs(link.c) for link in self.links)

    def words(self, point: str) -> str:
        """Return where it vanishes."""
        if self.missed:
            return f"never: {point} cannot come to axis 1"
        place = f"on the cylinder of radius {abs(self.offset):.6g} m about axis 1" if self.offset else "on axis 1"
        return f"{point} is {place}: {self.equation}"

    @property
    def equation(self) -> str:
        """That x is 0, with the arm's numbers, m, the first one positive."""
        least = NOTHING * self.size
        terms = [(self.a1, "")] if abs(self.a1) > least else []
        terms += [term for link in self.links for term in link.terms(least)]
        turned = np.sign(terms[0][0])
        text = "".join(f" {'+' if turned * c > 0 else '-'} {_product(abs(c), name)}" for c, name in terms)
        return text.removeprefix(" + ") + " = 0"

    def met(self, q: Array, lower: Array, upper: Array, rng: np.random.Generator) -> Array:
        """Return joint values (k, n) with joint 2 moved to where x = 0, inside its limits if possible; else NaN."""
        arm = self._arm(q)
        length = np.abs(arm)
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = np.arccos(-self.a1 / length) if self.a1 else np.full(len(q), np.pi / 2)
        side = rng.choice([-1.0, 1.0], len(q))
        both = _wound(np.stack([side * apart, -side * apart]) - np.angle(arm), lower[1], upper[1])
        inside = (both[0] >= lower[1]) & (both[0] <= upper[1])
        moved = q.copy()
        moved[:, 1] = np.where(inside, both[0], both[1])
        return moved

    def _arm(self, q: Array) -> NDArray[np.complex128]:
        return np.asarray(sum(link.value(q) for link in self.links))


Factor: TypeAlias = Turn | Slide | Side


def link_radii(lengths: Sequence[float]) -> tuple[float, float]:
    """Return the least and the largest distance that links of these lengths, m, reach in a plane."""
    return max(0.0, 2 * max(lengths) - sum(lengths)), sum(lengths)


def slide_radii(start: float, lift: float, lower: float, upper: float) -> tuple[float, float]:
    """Return the least and the largest of abs(start + q + i lift) for q inside limits, m."""
    ends = (start + lower, start + upper)
    near = 0.0 if ends[0] <= 0 <= ends[1] else min(abs(end) for end in ends)
    return float(np.hypot(near, lift)), float(np.hypot(max(abs(end) for end in ends), lift))


def _degrees(angle: float) -> str:
    """Return an angle in words, to a hundredth of a degree."""
    return f"{round(float(np.degrees(angle)), 2) + 0.0:g}°"


def _product(number: float, name: str) -> str:
    if not name:
        return f"{number:.6g}"
    return name if name.startswith("q") and abs(number - 1) < NOTHING else f"{number:.6g} {name}"


def _wrapped(angle: float) -> float:
    """Return an angle in (-pi, pi]."""
    turned = float(angle - TURN * np.ceil(angle / TURN - 0.5))
    return turned + 0.0


def _wound(angles: Array, lower: float, upper: float) -> Array:
    """Return angles with the whole turns that bring them inside limits, or in (-pi, pi] where none do."""
    near = angles - TURN * np.ceil(angles / TURN - 0.5)
    first = near + TURN * np.ceil((lower - near) / TURN)
    return np.where((near < lower) | (near > upper), np.where(first <= upper, first, near), near)
