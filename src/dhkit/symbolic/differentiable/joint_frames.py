"""Joint frames: one chain of rows for both DH conventions."""

from __future__ import annotations

from dataclasses import dataclass

from dhkit.description import Convention, Description
from dhkit.symbolic.differentiable.vectors import Scalar


@dataclass(frozen=True)
class JointRow:
    """The transform from joint frame i-1 to i: Rx(alpha) Tx(a) Rz(theta) Tz(d), q added to theta or d; m and rad.

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
        """The six numbers a, d, cos alpha, sin alpha, cos theta, sin theta, as a flat table has them."""
        return (self.a, self.d, self.cos_alpha, self.sin_alpha, self.cos_theta, self.sin_theta)


def joint_rows(description: Description) -> list[JointRow]:
    """Return an arm's joint frames; a and alpha of a standard table's row belong to the next joint's transform."""
    numbers = description.numbers
    a = numbers.a.tolist()
    cos_alpha = numbers.cos_alpha.tolist()
    sin_alpha = numbers.sin_alpha.tolist()
    if description.convention is Convention.STANDARD:
        a = [0.0, *a[:-1]]
        cos_alpha = [1.0, *cos_alpha[:-1]]
        sin_alpha = [0.0, *sin_alpha[:-1]]

    rows = []
    for i in range(description.n):
        row = JointRow(
            prismatic=bool(numbers.prismatic[i]),
            a=a[i],
            d=float(numbers.d[i]),
            cos_alpha=cos_alpha[i],
            sin_alpha=sin_alpha[i],
            cos_theta=float(numbers.cos_theta[i]),
            sin_theta=float(numbers.sin_theta[i]),
        )
        rows.append(row)
    return rows
