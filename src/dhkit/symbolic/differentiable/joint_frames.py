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
        """a, d, cos alpha, sin alpha, cos theta, sin theta."""
        return self.a, self.d, self.cos_alpha, self.sin_alpha, self.cos_theta, self.sin_theta


def joint_rows(description: Description) -> list[JointRow]:
    """Return an arm's joint frames; a standard table's row gives its a and alpha to the joint behind it."""
    numbers = description.numbers
    columns = (numbers.a, numbers.cos_alpha, numbers.sin_alpha)
    a, cos_alpha, sin_alpha = (column.tolist() for column in columns)
    if description.convention is Convention.STANDARD:
        a = [0.0, *a[:-1]]
        cos_alpha = [1.0, *cos_alpha[:-1]]
        sin_alpha = [0.0, *sin_alpha[:-1]]
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
