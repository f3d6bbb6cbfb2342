"""A link's mass distribution as ten numbers that enter the dynamics linearly, and how they are regrouped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from dhkit.display import repr_line
from dhkit.symbolic.differentiable.vectors import Scalar, Vector3, about_x, about_z, plus, times

if TYPE_CHECKING:
    from dhkit.symbolic.differentiable.joint_frames import JointRow


@dataclass(frozen=True)
class Moments:
    """The integrals of 1, r and r r^T over a link's mass, r from its joint frame's origin, in some axes.

    The second moments are those of position: the inertia tensor is J = tr(S) 1 - S. All numbers may be floats, exact
    fractions or expressions.
    """

    mass: Scalar
    """kg."""
    first: Vector3
    """Mass times centre of mass, kg m."""
    difference: Scalar
    """S_xx - S_yy, kg m^2; kept in place of S_xx, for it is 0 of links that are symmetric about their axis."""
    yy: Scalar
    zz: Scalar
    xy: Scalar
    xz: Scalar
    yz: Scalar

    @classmethod
    def none(cls) -> Moments:
        """Return those of no mass."""
        return cls(0, (0, 0, 0), 0, 0, 0, 0, 0, 0)

    @classmethod
    def of_body(cls, mass: Scalar, com: Vector3, inertia: Sequence[Sequence[Scalar]]) -> Moments:
        """Return those of a body, from its tensor about the centre of mass, (3, 3)."""
        half = (inertia[0][0] + inertia[1][1] + inertia[2][2]) / 2
        return cls.of_tensor(
            mass,
            times(mass, com),
            [[(half if i == j else 0) - inertia[i][j] + mass * com[i] * com[j] for j in range(3)] for i in range(3)],
        )

    @classmethod
    def of_tensor(cls, mass: Scalar, first: Vector3, S: Sequence[Sequence[Scalar]]) -> Moments:
        """Return those of second moments S, (3, 3), of position."""
        return cls(mass, first, S[0][0] - S[1][1], S[1][1], S[2][2], S[0][1], S[0][2], S[1][2])

    @property
    def xx(self) -> Scalar:
        """S_xx."""
        return self.difference + self.yy

    @property
    def tensor(self) -> tuple[Vector3, Vector3, Vector3]:
        """S, row by row."""
        return (self.xx, self.xy, self.xz), (self.xy, self.yy, self.yz), (self.xz, self.yz, self.zz)

    @property
    def entries(self) -> tuple[Scalar, ...]:
        """All ten, in the order of the fields."""
        return (self.mass, *self.first, self.difference, self.yy, self.zz, self.xy, self.xz, self.yz)

    @classmethod
    def of_entries(cls, entries: Sequence[Scalar]) -> Moments:
        """Return those of ten numbers in the order of :attr:`entries`."""
        mass, x, y, z, difference, yy, zz, xy, xz, yz = entries
        return cls(mass, (x, y, z), difference, yy, zz, xy, xz, yz)

    def joined(self, other: Moments) -> Moments:
        """Return those of both, in the same frame."""
        return Moments.of_entries([a + b for a, b in zip(self.entries, other.entries, strict=True)])

    def about_z(self, c: Scalar, s: Scalar) -> Moments:
        """Return them in axes in which this frame is turned about z."""
        x, y, z = about_z(c, s, self.first)
        xz, yz, _ = about_z(c, s, (self.xz, self.yz, 0))
        # S_xx' = S_yy + c t, S_xy' = S_xy + s t with t = c (S_xx - S_yy) - 2 s S_xy: four products in place of eight.
        t = c * self.difference - s * (2 * self.xy)
        ct = c * t
        return Moments(self.mass, (x, y, z), ct + ct - self.difference, self.xx - ct, self.zz, self.xy + s * t, xz, yz)

    def about_x(self, c: Scalar, s: Scalar) -> Moments:
        """Return them in axes in which this frame is turned about x."""
        rows = [about_x(c, s, row) for row in self.tensor]  # S Rx^T, then Rx of its columns
        turned = [about_x(c, s, column) for column in zip(*rows, strict=True)]
        return Moments.of_tensor(self.mass, about_x(c, s, self.first), list(zip(*turned, strict=True)))

    def moved(self, p: Vector3) -> Moments:
        """Return them about the origin of a frame in which this one's is at p."""
        h = self.first
        rest = plus(h, times(self.mass, p))  # S + h p^T + p h^T + m p p^T = S + (h + m p) p^T + p h^T
        x, y, z = p
        return Moments(
            self.mass,
            rest,
            self.difference + (x * (rest[0] + h[0]) - y * (rest[1] + h[1])),
            self.yy + y * (rest[1] + h[1]),
            self.zz + z * (rest[2] + h[2]),
            self.xy + (x * rest[1] + y * h[0]),
            self.xz + (x * rest[2] + z * h[0]),
            self.yz + (y * rest[2] + z * h[1]),
        )

    def __repr__(self) -> str:
        numbers = all(isinstance(entry, int | float | Fraction) for entry in self.entries)
        return repr_line("Moments", said=f"mass {float(self.mass):.4g} kg" if numbers else "of symbols")


def regrouped(links: Iterable[Moments], rows: Sequence[JointRow]) -> tuple[Moments, list[Moments]]:
    """Return the base parameters of a chain: the same dynamics from fewer numbers (Khalil & Gautier 1987).

    Of a revolute joint's link the mass on its axis may as well belong to the link before: mass, first moment along z
    and second moment S_zz. Of a prismatic joint's link so may all second moments, for it turns with the link before.

    Parameters
    ----------
    links
        Moments in the joint frames, exact fractions: the equations must not change by a rounding.
    rows
        The joints, floats.

    Returns
    -------
    tuple
        What has come to the base, in frame 0, and the links' moments.
    """
    rest = list(links)
    base = Moments.none()
    for i in reversed(range(len(rest))):
        moving, rest[i] = _parted(rest[i], rows[i].prismatic)
        a, d, ca, sa, ct, st = (Fraction(x) for x in rows[i].entries)
        if rows[i].prismatic:
            moving = moving.about_z(ct, st).about_x(ca, sa)
        else:
            moving = moving.about_x(ca, sa).moved((a, -sa * d, ca * d))
        if i:
            rest[i - 1] = rest[i - 1].joined(moving)
        else:
            base = moving
    return base, rest


def _parted(link: Moments, prismatic: bool) -> tuple[Moments, Moments]:
    x, y, z = link.first
    second = (link.difference, link.yy, link.zz, link.xy, link.xz, link.yz)
    if prismatic:
        return Moments(0, (0, 0, 0), *second), Moments(link.mass, link.first, 0, 0, 0, 0, 0, 0)
    moving = Moments(link.mass, (0, 0, z), 0, 0, link.zz, 0, 0, 0)
    return moving, Moments(0, (x, y, 0), link.difference, link.yy, 0, link.xy, link.xz, link.yz)
