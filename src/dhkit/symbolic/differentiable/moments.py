"""A link's mass distribution as ten numbers that enter the dynamics linearly, and its base parameters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from dhkit.display import repr_line
from dhkit.symbolic.differentiable.joint_frames import JointRow
from dhkit.symbolic.differentiable.vectors import Scalar, Vector3, about_x, about_z, plus, times


@dataclass(frozen=True)
class Moments:
    """The integrals of 1, r and r r^T over a link's mass; r is the position from the origin of its joint frame.

    S, the integral of r r^T, gives the inertia tensor J = tr(S) 1 - S about the same origin. All numbers may be floats,
    exact fractions or expressions.
    """

    mass: Scalar
    """kg."""
    first: Vector3
    """Mass times centre of mass, kg m."""
    difference: Scalar
    """S_xx - S_yy, kg m^2. It stands instead of S_xx because it is 0 for links that are symmetric about their axis."""
    yy: Scalar
    """S_yy, kg m^2."""
    zz: Scalar
    """S_zz, kg m^2."""
    xy: Scalar
    """S_xy, kg m^2."""
    xz: Scalar
    """S_xz, kg m^2."""
    yz: Scalar
    """S_yz, kg m^2."""

    @classmethod
    def none(cls) -> Moments:
        """Return the moments of no mass."""
        return cls(0, (0, 0, 0), 0, 0, 0, 0, 0, 0)

    @classmethod
    def of_body(cls, mass: Scalar, com: Vector3, inertia: Sequence[Sequence[Scalar]]) -> Moments:
        """Return a body's moments from its mass, kg, centre of mass, m, and inertia (3, 3) about it, kg m^2."""
        # J = tr(S) 1 - S about the centre of mass gives tr(S) = tr(J) / 2; about the origin, S gains m c c^T.
        S = []
        half_trace = (inertia[0][0] + inertia[1][1] + inertia[2][2]) / 2
        for i in range(3):
            row = [
                (half_trace if i == j else 0) - inertia[i][j] + mass * com[i] * com[j]
                for j in range(3)
            ]
            S.append(row)
        return cls.of_tensor(mass, times(mass, com), S)

    @classmethod
    def of_tensor(cls, mass: Scalar, first: Vector3, S: Sequence[Sequence[Scalar]]) -> Moments:
        """Return moments from mass, kg, first moment, kg m, and S, (3, 3), kg m^2."""
        return cls(
            mass,
            first,
            difference=S[0][0] - S[1][1],
            yy=S[1][1],
            zz=S[2][2],
            xy=S[0][1],
            xz=S[0][2],
            yz=S[1][2],
        )

    @property
    def xx(self) -> Scalar:
        """S_xx, kg m^2."""
        return self.difference + self.yy

    @property
    def tensor(self) -> tuple[Vector3, Vector3, Vector3]:
        """S, row by row, kg m^2."""
        return (
            (self.xx, self.xy, self.xz),
            (self.xy, self.yy, self.yz),
            (self.xz, self.yz, self.zz),
        )

    @property
    def entries(self) -> tuple[Scalar, ...]:
        """All ten numbers, in the order of the fields."""
        return (
            self.mass,
            *self.first,
            self.difference,
            self.yy,
            self.zz,
            self.xy,
            self.xz,
            self.yz,
        )

    @classmethod
    def of_entries(cls, entries: Sequence[Scalar]) -> Moments:
        """Return moments from ten numbers in the order of :attr:`entries`."""
        mass, x, y, z, difference, yy, zz, xy, xz, yz = entries
        return cls(mass, (x, y, z), difference, yy, zz, xy, xz, yz)

    def joined(self, other: Moments) -> Moments:
        """Return the moments of two bodies together, both given in the same frame."""
        return Moments.of_entries([a + b for a, b in zip(self.entries, other.entries, strict=True)])

    def about_z(self, c: Scalar, s: Scalar) -> Moments:
        """Return the moments in axes in which this frame is turned about z by the angle of cosine c and sine s."""
        xz, yz, _ = about_z(c, s, (self.xz, self.yz, 0))

        # S_xx' = S_yy + c t, S_yy' = S_xx - c t, S_xy' = S_xy + s t with t = c (S_xx - S_yy) - 2 s S_xy:
        # four products instead of eight.
        t = c * self.difference - s * (2 * self.xy)
        ct = c * t
        return Moments(
            self.mass,
            about_z(c, s, self.first),
            difference=ct + ct - self.difference,
            yy=self.xx - ct,
            zz=self.zz,
            xy=self.xy + s * t,
            xz=xz,
            yz=yz,
        )

    def about_x(self, c: Scalar, s: Scalar) -> Moments:
        """Return the moments in axes in which this frame is turned about x by the angle of cosine c and sine s."""
        # S' = Rx S Rx^T: first the rows, S Rx^T, then the columns.
        rows = [about_x(c, s, row) for row in self.tensor]
        columns = [about_x(c, s, column) for column in zip(*rows, strict=True)]
        S = list(zip(*columns, strict=True))
        return Moments.of_tensor(self.mass, about_x(c, s, self.first), S)

    def moved(self, p: Vector3) -> Moments:
        """Return the moments about the origin of a parallel frame in which this frame's origin is at p, m."""
        # h' = h + m p,  S' = S + h p^T + p h^T + m p p^T = S + h' p^T + p h^T
        h = self.first
        h_new = plus(h, times(self.mass, p))
        x, y, z = p
        return Moments(
            self.mass,
            h_new,
            difference=self.difference + (x * (h_new[0] + h[0]) - y * (h_new[1] + h[1])),
            yy=self.yy + y * (h_new[1] + h[1]),
            zz=self.zz + z * (h_new[2] + h[2]),
            xy=self.xy + (x * h_new[1] + y * h[0]),
            xz=self.xz + (x * h_new[2] + z * h[0]),
            yz=self.yz + (y * h_new[2] + z * h[1]),
        )

    def __repr__(self) -> str:
        is_numeric = all(isinstance(entry, int | float | Fraction) for entry in self.entries)
        return repr_line(
            "Moments", summary=f"mass {float(self.mass):.4g} kg" if is_numeric else "of symbols"
        )


def regroup(links: Iterable[Moments], rows: Sequence[JointRow]) -> tuple[Moments, list[Moments]]:
    """Return the base parameters of a chain: moments of equal dynamics with more zeros (Khalil & Gautier 1987).

    The part of a link that does not move against the link before is added to the link before: of a revolute joint's
    link its mass, the first moment along z and S_zz; of a prismatic joint's link all second moments, because that link
    rotates with the one before.

    Parameters
    ----------
    links
        Moments in the joint frames, as exact fractions: a rounding would change the equations.
    rows
        The joints, floats.

    Returns
    -------
    tuple
        The moments added to the base, in frame 0, and the links' remaining moments.
    """
    remaining = list(links)
    base = Moments.none()
    for i in reversed(range(len(remaining))):
        row = rows[i]
        shared, remaining[i] = _split(remaining[i], row.prismatic)

        # To the frame before, by Rx(alpha) Tx(a) Rz(theta) Tz(d). Second moments without mass do not change with the
        # origin (prismatic), and moments that are symmetric about z do not change with theta (revolute).
        a, d, ca, sa, ct, st = (Fraction(x) for x in row.entries)
        if row.prismatic:
            shared = shared.about_z(ct, st).about_x(ca, sa)
        else:
            shared = shared.about_x(ca, sa).moved((a, -sa * d, ca * d))

        if i:
            remaining[i - 1] = remaining[i - 1].joined(shared)
        else:
            base = shared
    return base, remaining


def _split(link: Moments, prismatic: bool) -> tuple[Moments, Moments]:
    """Return the part of a link's moments that the link before may hold as well, and the rest."""
    nothing = Moments.none()
    if prismatic:
        shared = replace(link, mass=0, first=(0, 0, 0))
        rest = replace(nothing, mass=link.mass, first=link.first)
    else:
        x, y, z = link.first
        shared = replace(nothing, mass=link.mass, first=(0, 0, z), zz=link.zz)
        rest = replace(link, mass=0, first=(x, y, 0), zz=0)
    return shared, rest
