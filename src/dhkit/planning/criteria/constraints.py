"""Constraints of a motion as immutable value objects: the limits of joints, and further ones of motors and the tool.

A constraint is written twice: as CasADi expressions for the optimizer, and as numbers at samples of a motion, from
Pinocchio's kinematics and dynamics, for the certificate. Both are scaled so that 1 is the limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, is_dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.display import value_line
from dhkit.errors import PlanningError
from dhkit.planning.criteria.states import Point, States
from dhkit.trajectories import Limits

if TYPE_CHECKING:
    import casadi


def require_value(thing: object) -> None:
    """Refuse a constraint or term that its fields do not determine: one with other values would be taken for it.

    Raises
    ------
    TypeError
        Attributes that are not fields of a frozen dataclass, or a field that cannot be hashed.
    """
    kind = type(thing).__name__
    known = {field.name for field in fields(thing)} if is_dataclass(thing) else set()
    others = sorted({*getattr(thing, "__dict__", ())} - known)
    if others:
        raise TypeError(
            f"{kind} has an attribute {others[0]} that is not a dataclass field; declare it in the body of a class "
            f"with @dataclass(frozen=True)"
        )
    try:
        hash(thing)
    except TypeError as error:
        raise TypeError(
            f"{kind}: {error}; expected @dataclass(frozen=True) with numbers and tuples as fields"
        ) from None


@dataclass(frozen=True)
class Constraint:
    """A quantity that must stay below 1, or between -1 and 1, in every state of a motion."""

    moving: ClassVar[bool] = True
    """Whether the quantity depends on velocity, so that a motion keeps the constraint if it is slow enough."""
    two_sided: ClassVar[bool] = False
    """Whether the quantity must stay between -1 and 1, not only below 1."""
    of_joints: ClassVar[bool] = False
    """Whether there is one row for each joint."""
    active_share: ClassVar[float] = 0.99
    """Share of the limit from which a report calls the constraint active."""

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        raise NotImplementedError(
            f"{type(self).__name__} has no property what, the name of the limited quantity"
        )

    @property
    def is_limiting(self) -> bool:
        """Whether the constraint limits motions at all."""
        return True

    def use_text(self, use: float) -> str:
        """Return a use of the limit (1 at the limit) as text.

        Parameters
        ----------
        use
            Value over the limit.
        """
        return f"{100 * use:.4g} % of its limit"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit, 1 at the limit.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        parameters
            Values of the constraint, in CasADi expressions.
        """
        raise NotImplementedError(
            f"{type(self).__name__} has no method rows, the expressions for the optimizer"
        )

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k), without unit, 1 at the limit.

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states, with the tool's velocities.
        parameters
            Values of the constraint.
        """
        raise NotImplementedError(
            f"{type(self).__name__} has no method measured, the numbers for the certificate"
        )

    def checked_rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return ``rows``, checked.

        Raises
        ------
        TypeError
            They are not a column of CasADi's symbols.
        """
        import casadi

        rows: object = self.rows(point, parameters)
        if not isinstance(rows, casadi.SX) or rows.shape[1] != 1:
            kind = getattr(rows, "shape", type(rows).__name__)
            raise TypeError(
                f"{type(self).__name__}.rows returned {kind}; expected casadi.SX of shape (k, 1)"
            )
        return rows

    def use(self, states: States, parameters: Array) -> Array:
        """Return the use of the limit at samples, shape (N, k), 1 at the limit: ``measured``, checked.

        Raises
        ------
        ValueError, TypeError
            ``measured`` returned another shape, or values that are not real numbers.
        PlanningError
            It returned NaN: whether the limit is kept cannot be decided.
        """
        name = f"{type(self).__name__}.measured"
        values = number_array(self.measured(states, parameters), name, "(N, k)")
        if values.ndim != 2 or len(values) != len(states.times) or not values.size:
            raise ValueError(f"{name} has shape {values.shape}; expected ({len(states.times)}, k)")
        if np.isnan(values).any():
            t = states.times[int(np.isnan(values).any(axis=1).argmax())]
            raise PlanningError(
                f"{self.what} is not a number at {t:.3g} s, so that no motion can be certified"
            )
        return np.abs(values) if self.two_sided else values

    def bounds(self, parameters: Array, shares: Array) -> tuple[Array, Array]:
        """Return the bounds of ``rows`` for the optimizer, shape (P, k) each, less margins.

        Parameters
        ----------
        shares
            Margins at P points as shares of the limit, shape (P, k).
        """
        high = 1 - shares
        low = -high if self.two_sided else np.full_like(high, -np.inf)
        return low, high

    def size(self, description: Description) -> int:
        """Return the number of parameters."""
        return 0

    def values(self, description: Description, T_start: Array) -> Array:
        """Return the parameters of a motion that starts at the tool's pose ``T_start`` (4, 4), shape (size,).

        Parameters
        ----------
        T_start
            Pose of the tool at the start, shape (4, 4), m.
        """
        return np.zeros(0)


@dataclass(frozen=True)
class MotorPower(Constraint):
    """Limit of the mechanical power abs(tau qd) of each joint, W."""

    watts: float | tuple[float, ...]
    two_sided = True
    of_joints = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "watts", _positive("MotorPower", self.watts))

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "motor power"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        parameters
            Values of the constraint, in CasADi expressions.
        """
        return point.tau * point.qd / _each(self.watts, point.n)

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k), without unit, 1 at the limit.

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states, with the tool's velocities.
        parameters
            Values of the constraint.
        """
        return states.tau * states.qd / _each(self.watts, states.n)

    __repr__ = value_line


@dataclass(frozen=True)
class TorqueSpeedLine(Constraint):
    """Torque-speed line of a motor: tau / stall torque + qd / no-load speed stays between -1 and 1."""

    stall_torque: float | tuple[float, ...]
    """Stall torque at the joint, N m or N: one number, or one for each joint."""
    no_load_speed: float | tuple[float, ...]
    """No-load speed at the joint, rad/s or m/s, likewise."""
    two_sided = True
    of_joints = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "stall_torque", _positive("TorqueSpeedLine", self.stall_torque))
        object.__setattr__(self, "no_load_speed", _positive("TorqueSpeedLine", self.no_load_speed))

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "torque-speed line"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        parameters
            Values of the constraint, in CasADi expressions.
        """
        n = point.n
        return point.tau / _each(self.stall_torque, n) + point.qd / _each(self.no_load_speed, n)

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k), without unit, 1 at the limit.

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states, with the tool's velocities.
        parameters
            Values of the constraint.
        """
        n = states.n
        measured: Array = states.tau / _each(self.stall_torque, n) + states.qd / _each(
            self.no_load_speed, n
        )
        return measured

    __repr__ = value_line


def _each(value: float | tuple[float, ...], n: int) -> Array:
    array = np.atleast_1d(np.array(value, dtype=float))
    if array.size not in (1, n):
        raise ValueError(f"{array.size} numbers for {n} joints; expected 1 or {n}")
    return np.broadcast_to(array, n)


def _positive(name: str, value: float | ArrayLike) -> float | tuple[float, ...]:
    """Return a positive number or a tuple of shape (n,), of any unit; a ValueError names the argument."""
    array = number_array(value, name, "(n,)")
    if array.ndim > 1 or not array.size or not (array > 0).all():
        raise ValueError(f"{name}: {value!r}; expected positive numbers")
    return float(array) if array.ndim == 0 else tuple(array.tolist())


class Limit(IntEnum):
    """Places of the limits that every motion has among its constraints; further constraints follow."""

    POSITION = 0
    VELOCITY = 1
    ACCELERATION = 2
    JERK = 3
    TORQUE = 4
    CLEARANCE = 5

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return self.name.lower()


QUANTITIES = {
    Limit.VELOCITY: "qd",
    Limit.ACCELERATION: "qdd",
    Limit.JERK: "jerk",
    Limit.TORQUE: "tau",
}
"""Attributes of points and states that are limited."""


@dataclass(frozen=True, eq=False)
class JointLimit(Constraint):
    """A limit of the magnitude of one quantity of each joint; its parameters are the reciprocals, 0 if unlimited."""

    kind: Limit
    limit: Array
    """Limit of each joint in the unit of the quantity, shape (n,); infinite where there is none."""
    two_sided = True
    of_joints = True

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return self.kind.what

    @property
    def is_limiting(self) -> bool:
        """Whether any joint has this limit."""
        return bool(np.isfinite(self.limit).any())

    def size(self, description: Description) -> int:
        """Return the number of parameters."""
        return description.n

    def values(self, description: Description, T_start: Array) -> Array:
        """Return the reciprocals of the limits, shape (n,)."""
        return 1 / self.limit

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, n x 1, without unit, 1 at the limit."""
        rows: casadi.SX = getattr(point, QUANTITIES[self.kind]) * parameters
        return rows

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, n), without unit, 1 at the limit."""
        return np.asarray(getattr(states, QUANTITIES[self.kind]) * parameters)


@dataclass(frozen=True, eq=False)
class PositionLimit(Constraint):
    """The range of each joint; the rows are joint values."""

    limits: Limits
    moving = False
    of_joints = True

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return Limit.POSITION.what

    @property
    def is_limiting(self) -> bool:
        """Whether any joint has a limit."""
        return bool((np.isfinite(self.limits.lower) | np.isfinite(self.limits.upper)).any())

    @property
    def sizes(self) -> Array:
        """Lengths of which an excess is a share, shape (n,): the larger limit; 1 rad or m if it is 0 or infinite."""
        size = np.maximum(np.abs(self.limits.lower), np.abs(self.limits.upper))
        return np.where(np.isfinite(size) & (size > 0), size, 1.0)

    def measured(self, states: States, parameters: Array) -> Array:
        """Return 1 plus the distance outside the range in shares of :attr:`sizes`, shape (N, n); 0 if unlimited."""
        outside = np.maximum(self.limits.lower - states.q, states.q - self.limits.upper)
        return np.where(np.isfinite(outside), 1 + outside / self.sizes, 0.0)

    def bounds(self, parameters: Array, shares: Array) -> tuple[Array, Array]:
        """Return the bounds of joint values, shape (P, n) each, rad and m."""
        # 1 + outside / size <= 1 - share, where outside is lower - q or q - upper.
        return self.limits.lower + shares * self.sizes, self.limits.upper - shares * self.sizes


def joint_limits(limits: Limits) -> tuple[Constraint, ...]:
    """Return the constraints of the joint limits, in the order of :class:`Limit`."""
    of_magnitude = (Limit.VELOCITY, Limit.ACCELERATION, Limit.JERK, Limit.TORQUE)
    return (
        PositionLimit(limits),
        *(JointLimit(kind, getattr(limits, kind.what)) for kind in of_magnitude),
    )


@dataclass(frozen=True)
class ToolSpeed(Constraint):
    """Limit of the speed of the tool's origin, m/s: ``|v|^2 / limit^2 <= 1``, which has a derivative at v = 0."""

    limit: float

    def __post_init__(self) -> None:
        _positive("ToolSpeed", self.limit)

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "tool speed"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        parameters
            Values of the constraint, in CasADi expressions.
        """
        import casadi

        return casadi.sumsqr(point.tool_velocity) / self.limit**2

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k).

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states, with the tool's velocities.
        parameters
            Values of the constraint.
        """
        square: Array = np.sum(states.tool_velocity**2, axis=1, keepdims=True)
        return square / self.limit**2


@dataclass(frozen=True)
class ToolAcceleration(Constraint):
    """Limit of the acceleration of the tool's origin, m/s^2: ``|a|^2 / limit^2 <= 1``."""

    limit: float

    def __post_init__(self) -> None:
        _positive("ToolAcceleration", self.limit)

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "tool acceleration"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        parameters
            Values of the constraint, in CasADi expressions.
        """
        import casadi

        return casadi.sumsqr(point.tool_acceleration) / self.limit**2

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k).

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states, with the tool's velocities.
        parameters
            Values of the constraint.
        """
        square: Array = np.sum(states.tool_acceleration**2, axis=1, keepdims=True)
        return square / self.limit**2


@dataclass(frozen=True)
class ToolDirection(Constraint):
    """Limit of the angle between an axis of the tool and a direction in the world, as for carrying a full glass.

    With the unit vectors a of the axis and n of the direction, cos angle = (R a) . n.
    """

    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Axis in the tool's frame."""
    direction: tuple[float, float, float] | None = None
    """Direction in the world; None for that of the axis at the start."""
    tolerance: float = math.radians(2)
    """Largest angle, rad."""
    moving = False

    def __post_init__(self) -> None:
        _angle("ToolDirection", self.tolerance)
        object.__setattr__(self, "axis", _unit("ToolDirection", self.axis))
        if self.direction is not None:
            object.__setattr__(self, "direction", _unit("ToolDirection", self.direction))

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "tool direction"

    def use_text(self, use: float) -> str:
        """Return a use of the limit as text.

        Parameters
        ----------
        use
            Value over the limit.
        """
        return _angle_use_text(use, self.tolerance)

    def size(self, description: Description) -> int:
        """Return the number of parameters."""
        return 3

    def values(self, description: Description, T_start: Array) -> Array:
        """Return the direction in the world, shape (3,), without unit.

        Parameters
        ----------
        T_start
            Pose of the tool at the start, shape (4, 4), m.
        """
        if self.direction is not None:
            return np.array(self.direction)
        at_start: Array = T_start[:3, :3] @ np.array(self.axis)
        return at_start

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        parameters
            Values of the constraint, in CasADi expressions.
        """
        import casadi

        axis = point.T_world_tool[:3, :3] @ casadi.DM(self.axis)
        share: casadi.SX = _share_of_angle(casadi.dot(axis, parameters), self.tolerance)
        return share

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k).

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states, with the tool's velocities.
        parameters
            Values of the constraint.
        """
        cosine = (states.T_world_tool[:, :3, :3] @ np.array(self.axis)) @ parameters
        return np.asarray(_share_of_angle(cosine, self.tolerance))[:, None]

    __repr__ = value_line


@dataclass(frozen=True)
class ToolOrientation(Constraint):
    """Limit of the angle between the tool's orientation and that at the start.

    The rotation R_start' R turns by the angle with trace(R_start' R) = 1 + 2 cos angle; the trace is the sum of the
    products of both matrices' elements.
    """

    tolerance: float = math.radians(2)
    """Largest angle, rad."""
    moving = False

    def __post_init__(self) -> None:
        _angle("ToolOrientation", self.tolerance)

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "tool orientation"

    def use_text(self, use: float) -> str:
        """Return a use of the limit as text.

        Parameters
        ----------
        use
            Value over the limit.
        """
        return _angle_use_text(use, self.tolerance)

    def size(self, description: Description) -> int:
        """Return the number of parameters."""
        return 9

    def values(self, description: Description, T_start: Array) -> Array:
        """Return the orientation at the start, column by column, shape (9,), without unit.

        Parameters
        ----------
        T_start
            Pose of the tool at the start, shape (4, 4), m.
        """
        return T_start[:3, :3].ravel(order="F")

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        parameters
            Values of the constraint, in CasADi expressions.
        """
        import casadi

        trace = casadi.dot(casadi.vec(point.T_world_tool[:3, :3]), parameters)
        share: casadi.SX = _share_of_angle((trace - 1) / 2, self.tolerance)
        return share

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k).

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states, with the tool's velocities.
        parameters
            Values of the constraint.
        """
        trace = np.einsum(
            "kij,ij->k", states.T_world_tool[:, :3, :3], parameters.reshape(3, 3, order="F")
        )
        return np.asarray(_share_of_angle((trace - 1) / 2, self.tolerance))[:, None]


def _share_of_angle(cosine: Any, tolerance: float) -> Any:
    """Return (1 - cos angle) / (1 - cos tolerance), which is smooth at the angle 0 and 1 at the tolerance."""
    return (1 - cosine) / (1 - math.cos(tolerance))


def _angle_use_text(use: float, tolerance: float) -> str:
    # The inverse of :func:`_share_of_angle`.
    cosine = 1 - use * (1 - math.cos(tolerance))
    angle = math.acos(max(-1.0, cosine))
    return f"{math.degrees(angle):.4g} deg off, {math.degrees(tolerance):.4g} deg are"


def _angle(name: str, value: float) -> None:
    if not 0 < value < math.pi:
        raise ValueError(f"{name}: tolerance is {value!r}; expected an angle between 0 and pi, rad")


def _unit(name: str, vector: ArrayLike) -> tuple[float, ...]:
    array = number_array(vector, name, "(3,)")
    length = float(np.linalg.norm(array)) if array.shape == (3,) else 0.0
    if not 0 < length < math.inf:
        raise ValueError(f"{name}: {vector!r}; expected a vector of three numbers, not all 0")
    return tuple((array / length).tolist())
