"""Joint frames: one chain for both conventions, and the axes in which its equations are shortest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dhkit.description import Convention, Description
from dhkit.symbolic.differentiable.bodies import Moments
from dhkit.symbolic.differentiable.vectors import Scalar, Vector3, about_x, about_x_back, about_z, about_z_back

if TYPE_CHECKING:
    import casadi

    from dhkit.symbolic.differentiable.inertial_table import InertialTable


@dataclass(frozen=True)
class JointRow:
    """How joint frame i lies in frame i-1: Rx(alpha) Tx(a) Rz(theta) Tz(d), the joint's value in theta or d.

    Joint frame i has its z axis along joint i's axis and moves with link i: it is frame i of a modified table (Craig),
    and frame i-1 of a standard one, turned with joint i.
    """

    prismatic: bool
    a: Scalar
    d: Scalar
    cos_alpha: Scalar
    sin_alpha: Scalar
    cos_theta: Scalar
    sin_theta: Scalar

    @property
    def entries(self) -> tuple[Scalar, ...]:
        """a, d, cos alpha, sin alpha, cos theta, sin theta."""
        return self.a, self.d, self.cos_alpha, self.sin_alpha, self.cos_theta, self.sin_theta


def joint_rows(description: Description) -> list[JointRow]:
    """Return an arm's joint frames; a standard table's row gives its a and alpha to the joint behind it."""
    numbers = description.numbers
    columns = (numbers.a, numbers.cos_alpha, numbers.sin_alpha)
    a, cos_alpha, sin_alpha = (column.tolist() for column in columns)
    if description.convention is Convention.STANDARD:
        a, cos_alpha, sin_alpha = [0.0, *a[:-1]], [1.0, *cos_alpha[:-1]], [0.0, *sin_alpha[:-1]]
    return [
        JointRow(*entries)
        for entries in zip(
            numbers.prismatic.tolist(),
            a,
            numbers.d.tolist(),
            cos_alpha,
            sin_alpha,
            numbers.cos_theta.tolist(),
            numbers.sin_theta.tolist(),
            strict=True,
        )
    ]


@dataclass(frozen=True)
class Station:
    """Joint i and its link, at a state, and the axes that its equations are written in.

    Vectors cross joint i in the *approach*: axes that are turned against those before by the twist alone, so that
    they do not turn with joint i. Where joint i+1 is parallel to joint i, or there is none, link i's equations stay in
    the approach and its own numbers are turned, by the sum of the angles since the axes were parallel; otherwise they
    are in the link's axes. So the links of parallel joints share their axes, and nothing is turned twice.
    """

    prismatic: bool
    cos_alpha: Scalar
    sin_alpha: Scalar
    lever: Vector3
    """From joint i-1's origin to joint i's, in the axes of link i-1's equations."""
    turn: tuple[Scalar, Scalar]
    """Cosine and sine of the angle from the approach to the axes of link i's equations."""
    own: Moments
    """The link's moments in those axes."""

    def down(self, a: Vector3) -> Vector3:
        """Return a vector of the axes of link i's equations in those of link i-1's."""
        return self.from_approach(about_z(*self.turn, a))

    def from_approach(self, a: Vector3) -> Vector3:
        """Return a vector of the approach in the axes of link i-1's equations."""
        return about_x(self.cos_alpha, self.sin_alpha, a)

    def to_approach(self, a: Vector3) -> Vector3:
        """Return a vector of link i-1's equations in the approach."""
        return about_x_back(self.cos_alpha, self.sin_alpha, a)

    def to_link(self, a: Vector3) -> Vector3:
        """Return a vector of the approach in the axes of link i's equations."""
        return about_z_back(*self.turn, a)


def stations(table: InertialTable, q: casadi.SX) -> list[Station]:
    """Return an arm's joints and links at joint values q (n x 1), rad and m."""
    made: list[Station] = []
    spin: tuple[Scalar, Scalar, Scalar] = (0.0, 1.0, 0.0)  # sum of joint angles; cosine and sine of the table's own
    lies = (1.0, 0.0)  # how link i-1 lies in the axes of its equations
    for i, (row, link) in enumerate(zip(table.rows, table.links, strict=True)):
        d = row.d + q[i] if row.prismatic else row.d
        lever = about_z(*lies, (row.a, -row.sin_alpha * d, row.cos_alpha * d))
        spin = _spin(row, spin, q[i])
        turned = _turned(spin)
        stays = i + 1 == len(table.rows) or _is_zero(table.rows[i + 1].sin_alpha)
        made.append(
            Station(
                row.prismatic,
                row.cos_alpha,
                row.sin_alpha,
                lever,
                (1.0, 0.0) if stays else turned,
                link.about_z(*turned) if stays else link,
            )
        )
        lies = turned if stays else (1.0, 0.0)
        if not stays:
            spin = (0.0, 1.0, 0.0)
    return made


def _spin(row: JointRow, before: tuple[Scalar, Scalar, Scalar], q: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Return how a link lies in its approach: the angle before, reversed where the axes are opposed, and its own."""
    angle, c, s = before
    opposed = _is_zero(row.sin_alpha) and float(row.cos_alpha) < 0
    if opposed:
        angle, s = -angle, -s
    c, s = c * row.cos_theta - s * row.sin_theta, s * row.cos_theta + c * row.sin_theta
    return (angle if row.prismatic else q + angle), c, s


def _turned(spin: tuple[Scalar, Scalar, Scalar]) -> tuple[Scalar, Scalar]:
    """Return cosine and sine of a sum of angles: the joints' own angles are added, the table's enter by the formula."""
    import casadi

    angle, c, s = spin
    if isinstance(angle, float):
        return c, s
    cos_q, sin_q = casadi.cos(angle), casadi.sin(angle)
    return cos_q * c - sin_q * s, sin_q * c + cos_q * s


def _is_zero(x: Scalar) -> bool:
    return isinstance(x, float) and x == 0.0
