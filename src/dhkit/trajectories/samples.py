"""A motion at points in time, for plots, tables and comparisons."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from dhkit.description import Array, Description, Payload
from dhkit.display import counted, html_table, repr_line
from dhkit.symbolic import Friction

_SHOWN_TIMES = 5
"""Number of times that a notebook shows."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Joint values, rates and accelerations at N times; where an acceleration jumps, the later one."""

    description: Description
    times: Array
    """Times, shape (N,), s."""
    q: Array
    """Joint values, shape (N, n), rad and m."""
    qd: Array
    """Joint rates, shape (N, n), rad/s and m/s."""
    qdd: Array
    """Joint accelerations, shape (N, n), rad/s^2 and m/s^2."""
    payload: Payload | None = None
    """The load that the tool carries; None: none."""
    friction: Friction | None = None
    """Friction that the torques overcome; None: none."""

    @cached_property
    def tau(self) -> Array:
        """Joint torques with the payload and friction, shape (N, n), N m and N.

        Raises
        ------
        DescriptionError
            A link without a body.
        """
        from dhkit.dynamics import inverse_dynamics

        loaded = (
            self.description if self.payload is None else self.payload.carried(self.description)
        )
        return inverse_dynamics(loaded, self.q, self.qd, self.qdd, friction=self.friction or False)

    def __repr__(self) -> str:
        return repr_line("Samples", self.description.name, self._summary)

    def _repr_html_(self) -> str:
        headings = ["t [s]"]
        for joint, is_prismatic in zip(
            self.description.joints, self.description.numbers.prismatic, strict=True
        ):
            headings.append(f"{joint.name} [{'m' if is_prismatic else 'rad'}]")

        rows = []
        for t, q in zip(self.times[:_SHOWN_TIMES], self.q[:_SHOWN_TIMES], strict=True):
            values = [f"{x:.4f}" for x in q]
            rows.append((f"{t:.4g}", *values))
        caption = (
            f"Samples of {self.description.name}: q, {self._summary}; qd, qdd and tau beside it"
        )
        return html_table(headings, rows, caption, align="r", count=len(self.times))

    @property
    def _summary(self) -> str:
        if not len(self.times):
            return "0 times"
        return (
            f"{counted(len(self.times), 'time')} from {self.times[0]:.4g} to {self.times[-1]:.4g} s"
        )
