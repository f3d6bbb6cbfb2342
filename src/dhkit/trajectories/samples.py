"""A motion at points in time: what is plotted, written into tables and compared."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from dhkit.description import Array, Description

__all__ = ["Samples"]


@dataclass(frozen=True, eq=False)
class Samples:
    """Joint values, rates and accelerations at N times; where an acceleration jumps, the one from then on."""

    description: Description
    times: Array
    """Shape (N,), s."""
    q: Array
    """Shape (N, n), rad and m."""
    qd: Array
    """Shape (N, n), per second."""
    qdd: Array
    """Shape (N, n), per second squared."""

    @cached_property
    def tau(self) -> Array:
        """Joint torques without friction, shape (N, n), N m and N.

        Raises
        ------
        DescriptionError
            A link without a body.
        """
        from dhkit.dynamics import inverse_dynamics

        return inverse_dynamics(self.description, self.q, self.qd, self.qdd)
