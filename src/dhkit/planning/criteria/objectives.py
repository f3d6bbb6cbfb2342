"""Objectives (time, effort, energy, jerk) as immutable value objects with weights, which can be added.

An objective is written twice, as a constraint is: as CasADi expressions for the optimizer, and as numbers at samples of
a motion, which are integrated for reports.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from numbers import Real
from typing import TYPE_CHECKING, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.display import value_line
from dhkit.planning.criteria.constraints import require_value
from dhkit.planning.criteria.states import LoadedArm, Point, States, gear_ratios
from dhkit.symbolic import Friction
from dhkit.trajectories import Trajectory

if TYPE_CHECKING:
    import casadi

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
"""Nodes and weights of the Gauss-Legendre rule of 5 points on [-1, 1]. It is exact to degree 9: for squared jerk, and
nearly so for squared torques."""


@dataclass(frozen=True)
class Term:
    """One quantity to minimize, with a weight; terms add to an :class:`Objective`."""

    weight: float = 1.0

    has_integrand: ClassVar[bool] = False
    """Whether the term is the integral of a function of the state; such functions depend on torques."""
    is_time: ClassVar[bool] = False
    """Whether the term is the duration."""
    is_jerk: ClassVar[bool] = False
    """Whether the term is the integral of the squared jerks."""
    units: ClassVar[tuple[str, str]] = ("", "")
    """Unit of its value for arms whose joints are all revolute, and for those whose joints are all prismatic."""
    is_flat: ClassVar[bool] = False
    """Whether motions of equal cost may differ, so that accelerations have to be smoothed."""

    def __post_init__(self) -> None:
        if not isinstance(self.weight, Real) or not math.isfinite(self.weight) or self.weight <= 0:
            raise ValueError(
                f"{type(self).__name__}: weight is {self.weight!r}; expected a positive number"
            )

    @property
    def is_smooth(self) -> bool:
        """Whether torques of optimal motions do not jump where no limit is reached."""
        return True

    def integrand(self, point: Point) -> casadi.SX:
        """Return the integrand over time, 1 x 1, unit of the term over s, of terms that have one."""
        raise NotImplementedError(
            f"{type(self).__name__} is not an integral of a function of the state"
        )

    def positive_parts(self, point: Point) -> casadi.SX:
        """Return quantities whose positive parts are added to the integrand, k x 1, unit of the term over s.

        They have no derivative at zero; programs have a variable for each, at least zero and at least the quantity.
        """
        import casadi

        return casadi.SX(0, 1)

    def measured(self, states: States) -> Array:
        """Return the integrand at a motion's states, shape (N,)."""
        raise NotImplementedError

    def __add__(self, other: Term | Objective) -> Objective:
        return Objective.of(self) + other

    def __mul__(self, factor: float) -> Term:
        return replace(self, weight=self.weight * factor)

    __rmul__ = __mul__


@dataclass(frozen=True)
class Time(Term):
    """The duration, s."""

    is_time = True
    units = ("s", "s")

    @property
    def is_smooth(self) -> bool:
        """Whether torques do not jump: they do."""
        return False

    def measured(self, states: States) -> Array:
        """Return ones, shape (N,).

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states.
        """
        return np.ones(len(states.times))


@dataclass(frozen=True)
class Effort(Term):
    """The integral of the squared torques, N^2 m^2 s (for a prismatic joint N^2 s), each multiplied by a weight."""

    joint_weights: float | tuple[float, ...] = ()
    """Weights of the joints' squared torques, such as 1 / limit^2: one for each joint, without unit; empty for 1."""
    has_integrand = True
    units = ("N² m² s", "N² s")

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(
            self, "joint_weights", _numbers("Effort", "joint weights", self.joint_weights)
        )

    def _weights(self, n: int) -> Array:
        return _each("Effort", "joint weights", self.joint_weights or 1.0, n)

    def integrand(self, point: Point) -> casadi.SX:
        """Return the sum of weight tau^2, 1 x 1, N^2 m^2.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        """
        import casadi

        return casadi.dot(self._weights(point.n), point.tau**2)

    def measured(self, states: States) -> Array:
        """Return the sum of weight tau^2, shape (N,), N^2 m^2.

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states.
        """
        squares: Array = states.tau**2 @ self._weights(states.n)
        return squares

    def __repr__(self) -> str:
        weights = f", joint_weights={self.joint_weights}" if self.joint_weights else ""
        return f"Effort(weight={self.weight}{weights})"


@dataclass(frozen=True)
class Jerk(Term):
    """The integral of the squared jerks, rad^2/s^5 or m^2/s^5; such motions begin and end with zero acceleration."""

    is_jerk = True
    units = ("rad²/s⁵", "m²/s⁵")

    def measured(self, states: States) -> Array:
        """Return the sum of the squared jerks, shape (N,).

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states.
        """
        squares: Array = np.sum(states.jerk**2, axis=1)
        return squares


@dataclass(frozen=True)
class Energy(Term):
    """Electrical energy, J: losses in the windings plus mechanical work; negative power counts only if regenerated.

    A motor of torque tau_m and motor constant k loses (tau_m / k)^2 watts in its windings; the joint's torque is
    gear tau_m.
    """

    motor_constants: float | tuple[float, ...] = ()
    """Motor constants k, N m per square root of W: one for all joints or one for each; empty for no losses."""
    regenerates: bool = False
    """Whether the drives feed the power of braking back."""
    is_flat = True
    has_integrand = True
    units = ("J", "J")

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(
            self, "motor_constants", _numbers("Energy", "motor constants", self.motor_constants)
        )

    @property
    def is_smooth(self) -> bool:
        """Whether torques do not jump: losses in the windings prevent it."""
        return bool(self.motor_constants)

    @property
    def constants(self) -> tuple[float, ...]:
        """The motor constants, one for all joints or one for each."""
        constants = self.motor_constants
        return constants if isinstance(constants, tuple) else (constants,)

    def integrand(self, point: Point) -> casadi.SX:
        """Return the electrical power less :meth:`positive_parts`, 1 x 1, W; its integral up to a constant.

        With the joints' power P = tau . qd and the power D that friction takes, the work is the arm's gain of energy
        and the loss,

            integral P dt = E_end - E_begin + integral D dt,

        and the ends are given. Fed back, P therefore costs as much as D. If not, the sum of the positive parts P+ of
        the joints' powers costs as much as P+ + (D - P) / 2, since P+ = (P + abs P) / 2 and abs P = 2 P+ - P. With P or
        P+ alone, the optimizer would find motions for which the quadrature is inaccurate.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        """
        import casadi

        n = point.n
        constants = self.constants
        if self.regenerates and not constants and point.friction is None:
            raise ValueError(
                "Energy: without motor constants, friction or power that is lost all motions cost the same"
            )
        D = point.dissipation
        if self.regenerates:
            total = D
        else:
            P = casadi.dot(point.tau, point.qd)
            total = (D - P) / 2
        if constants:
            # A winding loses (tau_m / k)^2 with the motor's torque tau_m = tau / gear.
            total += casadi.sumsqr(
                point.tau / (_each("Energy", "motor constants", constants, n) * point.gear)
            )
        return total

    def positive_parts(self, point: Point) -> casadi.SX:
        """Return the joints' power, n x 1, W, or nothing if negative power is fed back.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        """
        import casadi

        return casadi.SX(0, 1) if self.regenerates else point.tau * point.qd

    def measured(self, states: States) -> Array:
        """Return the electrical power, shape (N,), W.

        Parameters
        ----------
        states
            Joint values, rates, accelerations and torques of N states.
        """
        # P_i = tau_i qd_i, or its positive part, and in the winding (tau_i / (gear_i k_i))^2.
        power = states.tau * states.qd
        if not self.regenerates:
            power = np.maximum(power, 0.0)
        if self.constants:
            power = (
                power
                + (states.tau / (np.array(self.constants) * gear_ratios(states.description))) ** 2
            )
        total: Array = np.sum(power, axis=1)
        return total

    __repr__ = value_line


def _numbers(name: str, what: str, given: float | tuple[float, ...]) -> tuple[float, ...]:
    """Return positive numbers as a tuple, empty if none are given."""
    if isinstance(given, str):
        raise TypeError(f"{name}: {what} are {given!r}; expected positive numbers")
    numbers = (float(given),) if isinstance(given, float | int) else tuple(float(k) for k in given)
    if any(not math.isfinite(k) or k <= 0 for k in numbers):
        raise ValueError(f"{name}: {what} are {numbers}; expected positive numbers")
    return numbers


def _each(name: str, what: str, numbers: float | tuple[float, ...], n: int) -> Array:
    array = np.atleast_1d(np.array(numbers, dtype=float))
    if array.size not in (1, n):
        raise ValueError(f"{name}: {array.size} {what}; expected 1 or {n}")
    return np.broadcast_to(array, n)


@dataclass(frozen=True)
class Objective:
    """A sum of terms.

    Examples
    --------
    >>> Objective.of(Time() + 0.01 * Effort())
    Objective(terms=(Time(weight=1.0), Effort(weight=0.01)))
    """

    terms: tuple[Term, ...]

    @classmethod
    def of(cls, objective: ObjectiveLike) -> Objective:
        """Return the objective of an argument ``objective=``: a name, a term, or a sum of terms.

        Raises
        ------
        ValueError
            An unknown name.
        TypeError
            Something else.
        """
        if isinstance(objective, Objective):
            return objective
        if isinstance(objective, Term):
            require_value(objective)
            return cls((objective,))
        if isinstance(objective, str):
            if objective not in OBJECTIVES:
                raise ValueError(
                    f"objective is {objective!r}; expected one of {', '.join(OBJECTIVES)}, or Time() and the like"
                )
            return cls((OBJECTIVES[objective],))
        raise TypeError(
            f"objective is {objective!r}; expected one of {', '.join(OBJECTIVES)}, or Time() and the like"
        )

    @property
    def has_time(self) -> bool:
        """Whether the duration is a term; otherwise it must be given."""
        return any(term.is_time for term in self.terms)

    @property
    def has_jerk(self) -> bool:
        """Whether the jerk is a term."""
        return any(term.is_jerk for term in self.terms)

    @property
    def only_time(self) -> bool:
        """Whether the duration is the only term."""
        return all(term.is_time for term in self.terms)

    @property
    def needs_smoothing(self) -> bool:
        """Whether the optimum may not be unique, because joints have spare time or power is regenerated."""
        return self.only_time or any(term.is_flat for term in self.terms)

    @property
    def is_smooth(self) -> bool:
        """Whether torques of optimal motions do not jump where no limit is reached."""
        return all(term.is_smooth for term in self.terms)

    @property
    def has_integral(self) -> bool:
        """Whether a term is the integral of a function of the state, which depends on torques."""
        return any(term.has_integrand for term in self.terms)

    def unit(self, prismatic: NDArray[np.bool_]) -> str:
        """Return the unit of the value for an arm with such joints, shape (n,); empty for a sum and mixed joints."""
        if len(self.terms) > 1:
            return ""
        if_revolute, if_prismatic = self.terms[0].units
        if not prismatic.any() or if_revolute == if_prismatic:
            return if_revolute
        return if_prismatic if prismatic.all() else ""

    @property
    def time_weight(self) -> float:
        """Weight of the duration."""
        return sum(term.weight for term in self.terms if term.is_time)

    @property
    def jerk_weight(self) -> float:
        """Weight of the squared jerks."""
        return sum(term.weight for term in self.terms if term.is_jerk)

    def integrand(self, point: Point) -> casadi.SX:
        """Return the sum of the integrands that are functions of the state, 1 x 1.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        """
        import casadi

        each = [term.weight * term.integrand(point) for term in self.terms if term.has_integrand]
        return sum(each, casadi.SX(0))

    def positive_parts(self, point: Point) -> casadi.SX:
        """Return all terms' quantities whose positive parts are added to the integrand, k x 1.

        Parameters
        ----------
        point
            Joint values, rates, accelerations and torques at one point, in CasADi expressions.
        """
        import casadi

        each = [
            term.weight * term.positive_parts(point) for term in self.terms if term.has_integrand
        ]
        return casadi.vertcat(casadi.SX(0, 1), *each)

    def __add__(self, other: Term | Objective) -> Objective:
        if not isinstance(other, Term | Objective):
            return NotImplemented
        return Objective(self.terms + Objective.of(other).terms)

    def __mul__(self, factor: float) -> Objective:
        return Objective(tuple(term * factor for term in self.terms))

    __rmul__ = __mul__

    def __str__(self) -> str:
        names = [type(term).__name__.lower() for term in self.terms]
        if all(term.weight == 1 for term in self.terms):
            return " + ".join(names)
        return " + ".join(
            f"{term.weight:g} {name}" for term, name in zip(self.terms, names, strict=True)
        )

    __repr__ = value_line


ObjectiveLike: TypeAlias = "str | Term | Objective"

OBJECTIVES: dict[str, Term] = {
    "time": Time(),
    "effort": Effort(),
    "energy": Energy(),
    "jerk": Jerk(),
}


def cost_of(
    objective: Objective, trajectory: Trajectory, arm: LoadedArm, friction: Friction | None = None
) -> float:
    """Return an objective's value for a motion, in the units of its terms."""
    rates, weights = _rates(objective, trajectory, arm, friction)
    return float(weights @ sum(rates))


def size_of(
    objective: Objective, trajectory: Trajectory, arm: LoadedArm, friction: Friction | None = None
) -> float:
    """Return the magnitude of an objective along a motion: the integral of its terms' absolute values."""
    rates, weights = _rates(objective, trajectory, arm, friction)
    return float(weights @ sum(np.abs(rate) for rate in rates))


def _rates(
    objective: Objective, trajectory: Trajectory, arm: LoadedArm, friction: Friction | None
) -> tuple[list[Array], Array]:
    """Return each term's integrand at the quadrature's nodes, shape (N,), and the weights of the nodes, s.

    In a piece of duration h from t0, integral f dt = h/2 sum_i w_i f(t0 + h (x_i + 1) / 2).
    """
    h = np.diff(trajectory.breaks)[:, None]
    times = trajectory.breaks[:-1, None] + h * (NODES + 1) / 2
    weights = (h * WEIGHTS / 2).ravel()
    states = States.of(arm, trajectory, times, friction)
    return [term.weight * term.measured(states) for term in objective.terms], weights
