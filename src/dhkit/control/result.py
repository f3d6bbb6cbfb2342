"""What a simulation found: states, torques, errors, and where the energy went."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dhkit.description import Array, Description
from dhkit.kinematics import forward_kinematics

__all__ = ["EnergyAudit", "SimulationResult"]


@dataclass(frozen=True)
class EnergyAudit:
    """Where the energy of a run went, J; ``remains`` would be 0 without rounding and integration errors."""

    change: float
    """Of kinetic and potential energy, from the first state to the last."""
    drives: float
    """Done by the torques given."""
    pushes: float
    """Done by wrenches from outside."""
    friction: float
    """Taken by friction."""
    impacts: float
    """Lost at stops."""
    turnover: float
    """What the drives gave and took, counted alike, and the largest kinetic energy: the measure of what remains."""

    @property
    def remains(self) -> float:
        """The change of energy that nothing accounts for."""
        return self.change - (self.drives + self.pushes - self.friction - self.impacts)

    @property
    def error(self) -> float:
        """What remains, over the energy that was turned over; 0 where none was."""
        return abs(self.remains) / self.turnover if self.turnover > 0 else 0.0


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """A simulated run of N steps: N+1 states, the first at time 0."""

    description: Description
    """The arm that moved."""
    t: Array
    """Shape (N+1,), s."""
    q: Array
    """Shape (N+1, n), rad and m."""
    qd: Array
    qdd: Array
    """Right after each time, under the torques given from then on."""
    tau: Array
    """What the drives gave from each time on, shape (N+1, n), N m and N; the last row was not yet acted on."""
    tau_asked: Array
    """What the controller asked for."""
    reference_q: Array
    """What was to be followed, shape (N+1, n)."""
    reference_qd: Array
    audit: EnergyAudit
    saturated: Array = field(default_factory=lambda: np.zeros(0))
    """Of each joint the share of steps in which its drive could not give what was asked, shape (n,)."""

    @property
    def error(self) -> Array:
        """The reference less the joint values, shape (N+1, n), rad and m."""
        return self.reference_q - self.q

    @property
    def peak_error(self) -> Array:
        """The largest error of each joint, shape (n,), rad and m."""
        peak: Array = np.abs(self.error).max(axis=0)
        return peak

    @property
    def rms_error(self) -> Array:
        """The root of the mean squared error of each joint, shape (n,), rad and m."""
        rms: Array = np.sqrt(np.mean(self.error**2, axis=0))
        return rms

    @property
    def final_error(self) -> Array:
        """The error of each joint at the end, shape (n,), rad and m."""
        final: Array = self.error[-1]
        return final

    @cached_property
    def T(self) -> Array:
        """The tool's poses in the world, shape (N+1, 4, 4)."""
        return forward_kinematics(self.description, self.q)

    @cached_property
    def tool_error(self) -> Array:
        """How far the tool is from where it should be, shape (N+1,), m."""
        wanted = forward_kinematics(self.description, self.reference_q)
        distance: Array = np.linalg.norm(self.T[:, :3, 3] - wanted[:, :3, 3], axis=1)
        return distance

    def __repr__(self) -> str:
        return (
            f"<SimulationResult of {self.description.name}: {self.t[-1]:g} s in {len(self.t) - 1} steps, largest error "
            f"{self.peak_error.max(initial=0.0):.3g}>"
        )
