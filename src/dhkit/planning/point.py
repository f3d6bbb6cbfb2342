"""One state of a motion as CasADi symbols, in which constraints and objectives are written."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.parameters import resolved
from dhkit.expressions import substitute
from dhkit.symbolic import CasadiFunctions, Friction, SymbolicTable, jacobian, joint_symbols
from dhkit.trajectories import Limits

if TYPE_CHECKING:
    import casadi

LOAD = 10
"""Number of parameters of a payload: mass, centre of mass (3), inertia (6)."""


class Point:
    """q, qd and qdd of an arm as SX symbols, and quantities derived from them on first use."""

    def __init__(self, description: Description, limits: Limits, friction: Friction | None, payload: bool) -> None:
        self.description = description
        self.limits = limits
        self.n = description.n
        self.q = joint_symbols("q", self.n)
        self.qd = joint_symbols("qd", self.n)
        self.qdd = joint_symbols("qdd", self.n)
        self.load = joint_symbols("load", LOAD if payload else 0)
        self.friction = friction
        self._functions = CasadiFunctions(description, friction=friction, payload=payload)

    @cached_property
    def tau(self) -> casadi.SX:
        """Joint torques, n x 1, N m and N."""
        return self._torque(self._functions)

    @cached_property
    def dissipation(self) -> casadi.SX:
        """The power lost to friction, 1 x 1, W."""
        import casadi

        if self.friction is None:
            return casadi.SX(0)
        return casadi.dot(self.tau - self._torque(self._functions.layered(payload=bool(self.load.numel()))), self.qd)

    def _torque(self, functions: CasadiFunctions) -> casadi.SX:
        load = self.load
        loads = (load[0], load[1:4], load[4:10]) if load.numel() else ()
        return functions.inverse_dynamics(self.q, self.qd, self.qdd, *loads)

    @cached_property
    def T_world_tool(self) -> casadi.SX:
        """The pose of the tool in the world, 4 x 4, m."""
        return SymbolicTable.of(self.description).world_to_tool(self.q)

    @cached_property
    def tool_velocity(self) -> casadi.SX:
        """The velocity of the tool's origin, 3 x 1, m/s, world axes."""
        return jacobian(SymbolicTable.of(self.description), self.q)[:3, :] @ self.qd

    @cached_property
    def tool_acceleration(self) -> casadi.SX:
        """The acceleration of the tool's origin, 3 x 1, m/s^2, world axes."""
        import casadi

        v = self.tool_velocity
        return casadi.jtimes(v, self.q, self.qd) + casadi.jtimes(v, self.qd, self.qdd)

    @property
    def gear(self) -> Array:
        """Gear ratios, shape (n,), without unit; 1 without a drive."""
        return gear_ratios(self.description)


def gear_ratios(description: Description) -> Array:
    """Return the drives' gear ratios, shape (n,), without unit; 1 without a drive."""
    values = resolved(description.parameters)
    drives = [joint.drive for joint in description.joints]
    return np.array([float(substitute(drive.gear, values)) if drive else 1.0 for drive in drives])
