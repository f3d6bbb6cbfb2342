"""External wrenches on the tool or on a link, over a time window."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.description.frames import carrying
from dhkit.display import value_line
from dhkit.kinematics import forward_kinematics, frames


@dataclass(frozen=True, eq=False)
class Push:
    """A force and a moment on the arm, constant in world axes during a time window.

    Raises
    ------
    ValueError
        Shapes other than (3,), values that are not finite, a link below 1, or an end before the beginning.
    """

    force: ArrayLike
    """Force, world axes, shape (3,), N."""
    moment: ArrayLike = (0.0, 0.0, 0.0)
    """Moment, world axes, shape (3,), N m."""
    link: int | None = None
    """Number of the pushed link, from 1; None for the tool."""
    point: ArrayLike = (0.0, 0.0, 0.0)
    """Point of the force in the link's DH frame or the tool's frame, shape (3,), m."""
    begin: float = 0.0
    """Time at which the push begins, s."""
    end: float = inf
    """Time at which the push ends, s; it does not act at that time."""

    def __post_init__(self) -> None:
        for name in ("force", "moment", "point"):
            value = number_array(getattr(self, name), name, "(3,)")
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ValueError(
                    f"{name} is {getattr(self, name)!r}; expected three finite numbers"
                )
            object.__setattr__(self, name, value)
        if self.link is not None and type(self.link) is not int:
            raise TypeError(f"link is {self.link!r}; expected a whole number, or None for the tool")
        if self.link is not None and self.link < 1:
            raise ValueError(f"link is {self.link}; expected 1 or more, or None for the tool")
        if not self.begin <= self.end:
            raise ValueError(
                f"the push ends at {self.end:g} s, before it begins at {self.begin:g} s"
            )

    def torque(self, description: Description, q: Array) -> Array:
        """Return the joint torques of the push at joint values q (n,), shape (n,), N m and N.

        Parameters
        ----------
        description
            The arm.
        q
            Joint values, shape (n,), rad and m.
        """
        n = description.n
        if self.link is not None and self.link > n:
            raise ValueError(f"link is {self.link}; {description.name} has {n}")
        force, moment, point = (
            np.asarray(x, dtype=float) for x in (self.force, self.moment, self.point)
        )
        T = frames(description, q)
        frame = forward_kinematics(description, q) if self.link is None else T[self.link]
        place = frame[:3, :3] @ point + frame[:3, 3]
        moved = n if self.link is None else self.link

        # tau = J^T w for the wrench w of the force f at p and the moment m, with the axis z_i through o_i of joint i:
        #     revolute:  tau_i = z_i . ((p - o_i) x f + m),    prismatic:  tau_i = z_i . f.
        # Joints after the pushed link do not move it, and feel nothing.
        tau = np.zeros(n)
        for i, axes in enumerate(carrying(description.convention, list(T))[:moved]):
            z = axes[:3, 2]
            lever = place - axes[:3, 3]
            tau[i] = z @ (
                force if description.numbers.prismatic[i] else np.cross(lever, force) + moment
            )
        return tau

    __repr__ = value_line
