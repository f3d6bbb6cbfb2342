"""Objectives and constraints along a path that are not linear in b = sd^2, as expressions in its states."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from dhkit.description import Description
from dhkit.planning.constraints import Constraint
from dhkit.planning.objectives import Objective
from dhkit.planning.point import LOAD, Point
from dhkit.trajectories import Limits

if TYPE_CHECKING:
    import casadi


class PathPoint(Point):
    """A state on a path as symbols, in which constraints and objectives are written."""

    def __init__(self, description: Description, limits: Limits) -> None:
        import casadi

        n = description.n
        self.description, self.limits, self.n = description, limits, n
        self.b, self.speed, self.sdd = (casadi.SX.sym(name) for name in ("b", "speed", "sdd"))
        self.path = casadi.SX.sym("path", 6 * n + 6)
        q, qs, qss, m, c, g, ps, pss = casadi.vertsplit(self.path, [*range(0, 6 * n + 1, n), 6 * n + 3, 6 * n + 6])
        self.q, self.qd, self.qdd = q, qs * self.speed, qs * self.sdd + qss * self.b
        self.load = casadi.SX(LOAD, 0)
        self._tau = m * self.sdd + c * self.b + g
        self._tool = ps * self.speed, ps * self.sdd + pss * self.b

    @cached_property
    def tau(self) -> casadi.SX:
        """Joint torques, n x 1, N m and N."""
        return self._tau

    @cached_property
    def tool_velocity(self) -> casadi.SX:
        """The velocity of the tool's origin, 3 x 1, m/s."""
        return self._tool[0]

    @cached_property
    def tool_acceleration(self) -> casadi.SX:
        """The acceleration of the tool's origin, 3 x 1, m/s^2."""
        return self._tool[1]


@dataclass(frozen=True)
class Terms:
    """Terms that are not linear in b, as expressions in a :class:`PathPoint`."""

    description: Description
    objective: Objective
    constraints: tuple[Constraint, ...]
    torque: tuple[float, ...]
    velocity: tuple[float, ...]
    """Velocity limits, which scale the terms, rad/s and m/s."""

    @classmethod
    def of(
        cls, description: Description, objective: Objective, constraints: tuple[Constraint, ...], limits: Limits
    ) -> Terms | None:
        """Return the terms of an objective and of constraints, or None if all are linear."""
        if objective.only_time and not constraints:
            return None
        return cls(description, objective, constraints, tuple(limits.torque.tolist()), tuple(limits.velocity.tolist()))

    @cached_property
    def point(self) -> PathPoint:
        """The symbols of the terms."""
        limits = Limits.of(self.description, torque=self.torque, velocity=self.velocity)
        return PathPoint(self.description, limits)

    @cached_property
    def rows(self) -> list[casadi.SX]:
        """The rows of each constraint, k x 1 each, without unit."""
        import casadi

        return [constraint.checked_rows(self.point, casadi.SX(0, 1)) for constraint in self.constraints]

    @property
    def counts(self) -> tuple[int, ...]:
        """The number of rows of each constraint."""
        return tuple(int(row.numel()) for row in self.rows)

    @cached_property
    def function(self) -> casadi.Function:
        """Function of sdd, b, speed and a path's coefficients that returns the rows and the cost per second."""
        import casadi

        point = self.point
        cost = casadi.SX(0)
        for term in self.objective.terms:
            integrand = term.integrand(point)
            if integrand is not None:
                cost += term.weight * integrand
        inputs = [point.sdd, point.b, point.speed, point.path]
        return casadi.Function("on_path", inputs, [casadi.vertcat(*self.rows), cost], {"cse": True})
