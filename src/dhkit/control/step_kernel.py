"""A Runge-Kutta step as one compiled program, alone or after a control law, for one arm or a batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dhkit.control.law import Law, Symbols
from dhkit.description import Array, Description
from dhkit.dynamics import Friction
from dhkit.kernels import Kernel, kernel
from dhkit.symbolic import (
    Graph,
    InertialTable,
    friction_parameters,
    friction_torque,
    inertial_pattern,
    joint_symbols,
    recursive_forward_dynamics,
)

if TYPE_CHECKING:
    import casadi

WORKS = ("drives", "turnover", "friction")
"""Energies integrated in a step, J: work of the drive torques, integral of their absolute power, friction loss."""
NO_LIMIT = 1e300
"""Torque (N m or N) that stands for no limit: with infinity, the programs would return NaN."""


@dataclass(frozen=True, eq=False)
class StepKernel:
    """The classical method of order 4 (Kutta 1901) for states without stops, with no friction or a smooth one.

    Parameters
    ----------
    kernel
        The program.
    shared
        Inputs that all runs share, shape (p,); the setpoint's 3n come first if ``setpoint_shared``.
    own
        Inputs of each run, shape (B, p); the setpoint's 3n come first unless it is shared. None for none.
    closed
        Whether the program includes a control law: it then takes a setpoint instead of torques.
    setpoint_shared
        Whether all runs have the same setpoint.
    """

    kernel: Kernel
    shared: Array
    own: Array | None
    closed: bool
    setpoint_shared: bool

    @classmethod
    def open(cls, arms: Sequence[Description], friction: Friction | None, h: float) -> StepKernel:
        """Return a step of length h (s) under constant torques, for one arm of all states or for one arm of each."""
        pattern, numbers = _plant(arms, friction, h)
        return cls._of(pattern, numbers, arms, None)

    @classmethod
    def closed_loop(
        cls,
        arms: Sequence[Description],
        friction: Friction | None,
        h: float,
        law: Law,
        effort_limits: Array,
        setpoint: Array,
    ) -> StepKernel:
        """Return a step under the torques that a control law commands at its beginning.

        Parameters
        ----------
        arms, friction, h
            As for :meth:`open`.
        law
            The controller.
        effort_limits
            Largest torques of the drives, shape (n,) or (B, n), N m and N.
        setpoint
            Joint values, rates and accelerations in a row, shape (3n,) for all runs or (B, 3n) of each.
        """
        pattern, plant = _plant(arms, friction, h)
        numbers = {"setpoint": setpoint, **plant, "gains": law.gains}
        numbers["effort_limits"] = np.minimum(effort_limits, NO_LIMIT)
        model_pattern = ""
        # A controller whose model is the arm that moves shares its symbols.
        if list(arms) != [law.description]:
            model_pattern, numbers["model"] = inertial_pattern(law.description)
        return cls._of(f"{pattern} {law.name} {model_pattern}", numbers, arms, law)

    @classmethod
    def _of(
        cls,
        pattern: str,
        numbers: Mapping[str, Array],
        arms: Sequence[Description],
        law: Law | None,
    ) -> StepKernel:
        """Return the step whose program has these inputs: shape (p,) for all runs, or (B, p)."""
        shared = {name: values for name, values in numbers.items() if values.ndim == 1}
        own = {name: values for name, values in numbers.items() if values.ndim == 2}
        sizes = {name: values.shape[-1] for name, values in numbers.items()}
        program = kernel(
            "runge_kutta_step",
            f"{pattern}, of each run: {' '.join(own) or 'nothing'}",
            lambda: _graph(arms, law, sizes, list(own)),
            ("float64",) * (3 if law is None else 4),
        )
        return cls(
            program,
            np.concatenate(list(shared.values())),
            np.ascontiguousarray(np.concatenate(list(own.values()), axis=1)) if own else None,
            law is not None,
            "setpoint" in shared,
        )

    def with_length(self, h: float) -> StepKernel:
        """Return the step under constant torques with another length h, s."""
        # The length is the first shared input of a step without a law, see _plant.
        shared = self.shared.copy()
        shared[0] = h
        return replace(self, shared=shared)

    def rows(self, rows: slice) -> StepKernel:
        """Return the step of some of the runs."""
        return replace(
            self, shared=self.shared.copy(), own=None if self.own is None else self.own[rows]
        )

    def __call__(
        self, states: Sequence[Array], drive: Array, into: Sequence[Array], threads: int = 1
    ) -> None:
        """Write the joint values (B, n), rates (B, n) and works (B, 3) after a step, and with a law its torques (B, n).

        Parameters
        ----------
        states
            Joint values, rates and works at the beginning of the step.
        drive
            Torques, shape (B, n), N m and N; with a law the setpoint, shape (3n,), ignored unless it is shared.
        into
            Arrays that the results are written to.
        threads
            Number of threads that share the step.
        """
        own = () if self.own is None else (self.own,)
        if not self.closed:
            self.kernel(self.shared, [*states, drive, *own], list(into), threads)
            return
        if self.setpoint_shared:
            self.shared[: len(drive)] = drive
        self.kernel(self.shared, [*states, *own], list(into), threads)


def _plant(
    arms: Sequence[Description], friction: Friction | None, h: float
) -> tuple[str, dict[str, Array]]:
    """Return the pattern of a plant's program, and its inputs by name."""
    pattern, values = inertial_pattern(*arms)
    numbers = {"step": np.array([h]), "arm": values}
    if friction is None:
        return pattern, numbers
    losses = np.array([friction_parameters(arm.numbers, friction.width) for arm in arms])
    return f"{pattern} friction", numbers | {"friction": losses[0] if len(arms) == 1 else losses}


def _graph(
    arms: Sequence[Description], law: Law | None, sizes: Mapping[str, int], own: Sequence[str]
) -> Graph:
    """Return the program; ``sizes`` are lengths of inputs by name, ``own`` the names of each run's own inputs."""
    import casadi

    n = arms[0].n
    symbols = {name: casadi.SX.sym(name, size) for name, size in sizes.items()}
    table, symbols["arm"] = InertialTable.parametric(*arms)
    q = joint_symbols("q", n)
    qd = joint_symbols("qd", n)
    tau = joint_symbols("tau", n)
    works = casadi.SX.sym("works", len(WORKS))

    applied = tau
    asked = {}
    if law is not None:
        known = table
        if "model" in sizes:
            known, symbols["model"] = InertialTable.parametric(law.description)
        q_d, qd_d, qdd_d = casadi.vertsplit(symbols["setpoint"], n)
        torques = law.torques(known, Symbols(q, qd, q_d, qd_d, qdd_d), symbols["gains"])
        # The drives saturate.
        limit = symbols["effort_limits"]
        applied = casadi.fmin(casadi.fmax(torques, -limit), limit)
        asked = {"asked": torques}

    later = _runge_kutta_step(table, q, qd, applied, symbols["step"], symbols.get("friction"))
    shared = [symbol for name, symbol in symbols.items() if name not in own]
    inputs = {"shared": casadi.vertcat(*shared), "q": q, "qd": qd, "works": works}
    if law is None:
        inputs["tau"] = tau
    if own:
        inputs["own"] = casadi.vertcat(*(symbols[name] for name in sizes if name in own))
    outputs = {"q": later.q, "qd": later.qd, "works": works + later.works, **asked}
    return Graph.of("runge_kutta_step", inputs, outputs)


class _After(NamedTuple):
    """State after a step, and the energies of ``WORKS`` that were integrated in it."""

    q: casadi.SX
    qd: casadi.SX
    works: casadi.SX


def _runge_kutta_step(
    table: InertialTable,
    q: casadi.SX,
    qd: casadi.SX,
    tau: casadi.SX,
    h: casadi.SX,
    friction: casadi.SX | None,
) -> _After:
    """Return the state after a step of length h under constant torques.

    The classical method of order 4 (Kutta 1901) for the state (q, qd) with qdd = M^-1 (tau - r(qd) - C qd - g), where
    the stages k = 1 ... 4 have rates v_k, accelerations a_k and powers p_k = v_k . r(v_k) that friction takes.
    """
    import casadi

    def derivative(x: casadi.SX, v: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
        """Return the acceleration at a state, and the power that friction takes there."""
        resistance = (
            casadi.SX.zeros(table.n)
            if friction is None
            else friction_torque(v, friction, smooth=True)
        )
        return recursive_forward_dynamics(table, x, v, tau - resistance), casadi.dot(v, resistance)

    v1 = qd
    a1, p1 = derivative(q, v1)

    v2 = qd + h / 2 * a1
    a2, p2 = derivative(q + h / 2 * v1, v2)

    v3 = qd + h / 2 * a2
    a3, p3 = derivative(q + h / 2 * v2, v3)

    v4 = qd + h * a3
    a4, p4 = derivative(q + h * v3, v4)

    # Simpson's weights: x(t + h) = x + h/6 (k_1 + 2 k_2 + 2 k_3 + k_4).
    displacement = h / 6 * (v1 + 2 * (v2 + v3) + v4)
    change_of_rate = h / 6 * (a1 + 2 * (a2 + a3) + a4)
    friction_loss = h / 6 * (p1 + 2 * (p2 + p3) + p4)

    # Torques are constant, so that the work of each drive is tau_i (q_i(t + h) - q_i(t)).
    work = tau * displacement
    works = casadi.vertcat(casadi.sum1(work), casadi.sum1(casadi.fabs(work)), friction_loss)
    return _After(q + displacement, qd + change_of_rate, works)
