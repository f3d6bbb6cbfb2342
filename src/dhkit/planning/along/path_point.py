"""One state of a motion along a path as CasADi symbols, in which constraints and objectives are written."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from dhkit.description import Description
from dhkit.description.robot import require_bodies
from dhkit.planning.criteria import Point
from dhkit.symbolic import Friction
from dhkit.symbolic.differentiable.friction import friction_parameters, friction_torque
from dhkit.trajectories import Limits

if TYPE_CHECKING:
    import casadi


class PathPoint(Point):
    """A state on a path: its speed and acceleration sd and sdd along it, and the path's coefficients there.

    The coefficients are those of :class:`PathStates`, 7 n + 6.
    """

    def __init__(self, description: Description, limits: Limits, friction: Friction | None) -> None:
        import casadi

        n = description.n
        self.description, self.limits, self.n, self.friction = description, limits, n, friction
        self.b, self.speed, self.sdd = (casadi.SX.sym(name) for name in ("b", "speed", "sdd"))
        self.path = casadi.SX.sym("path", 7 * n + 6)
        edges = [*range(0, 6 * n + 1, n), 6 * n + 3, 6 * n + 6, 7 * n + 6]
        q, qs, qss, m, c, g, ps, pss, _ = casadi.vertsplit(self.path, edges)
        self.q, self.qd, self.qdd = q, qs * self.speed, qs * self.sdd + qss * self.b
        self.load = casadi.SX(0, 1)  # torques along the path include the payload
        self._rigid = m * self.sdd + c * self.b + g
        self._tool = ps * self.speed, ps * self.sdd + pss * self.b

    @cached_property
    def tau(self) -> casadi.SX:
        """Joint torques, n x 1, N m and N."""
        require_bodies(self.description)
        return self._rigid + self._friction_torque

    @cached_property
    def dissipation(self) -> casadi.SX:
        """The power lost to friction, 1 x 1, W."""
        import casadi

        return casadi.dot(self._friction_torque, self.qd)

    @cached_property
    def _friction_torque(self) -> casadi.SX:
        import casadi

        if self.friction is None:
            return casadi.SX(self.n, 1)
        parameters = friction_parameters(self.description.numbers, self.friction.width)
        return friction_torque(self.qd, casadi.SX(casadi.DM(parameters)), smooth=self.friction.width > 0)

    @cached_property
    def tool_velocity(self) -> casadi.SX:
        """The velocity of the tool's origin, 3 x 1, m/s."""
        return self._tool[0]

    @cached_property
    def tool_acceleration(self) -> casadi.SX:
        """The acceleration of the tool's origin, 3 x 1, m/s^2."""
        return self._tool[1]
