"""A step of Runge and Kutta's method as one program, alone or with a control law before it, for one arm or many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dhkit.control.law import Law, Symbols
from dhkit.description import Array, Description
from dhkit.dynamics import Friction
from dhkit.kernels import Kernel, kernel
from dhkit.symbolic import (
    Graph,
    InertialTable,
    friction_torque,
    inertial_pattern,
    joint_symbols,
    recursive_forward_dynamics,
    smooth_direction,
)

if TYPE_CHECKING:
    import casadi

WORKS = ("drives", "turnover", "friction")
"""What is added up for each arm, J: done by the drives' torques, the same without its sign, and taken by friction."""
NO_LIMIT = 1e300
"""N m: in place of infinity, which programs answer with NaN."""


@dataclass(frozen=True, eq=False)
class StepKernel:
    """The classical method of order 4 (Kutta 1901) for states without stops, with no friction or a smooth one.

    Parameters
    ----------
    kernel
        The program.
    shared
        Numbers that all runs share; the setpoint's 3 n come first where ``setpoint_shared``.
    own
        Numbers of each run, shape (B, p); the setpoint's 3 n come first where it is not shared. None for none.
    closed
        Whether the program has a control law: it is then given a setpoint in place of torques.
    setpoint_shared
        Whether one setpoint is for all runs.
    """

    kernel: Kernel
    shared: Array
    own: Array | None
    closed: bool
    setpoint_shared: bool

    @classmethod
    def open(cls, arms: Sequence[Description], friction: Friction | None, h: float) -> StepKernel:
        """Return a step of length h (s) under torques that are given, of one arm for all states, or of one for each."""
        pattern, numbers = _plant(arms, friction, h)
        return cls._of(pattern, numbers, arms, None)

    @classmethod
    def closed_loop(
        cls, arms: Sequence[Description], friction: Friction | None, h: float, law: Law, most: Array, setpoint: Array
    ) -> StepKernel:
        """Return a step under the torques of a law at its beginning.

        Parameters
        ----------
        arms, friction, h
            As for :meth:`open`.
        law
            The controller.
        most
            Largest torques, shape (n,) or (B, n).
        setpoint
            Joint values, rates and accelerations in a row, shape (3n,) for all runs or (B, 3n) of each.
        """
        pattern, plant = _plant(arms, friction, h)
        model_pattern, model = ("", None) if _same(arms, law) else inertial_pattern(law.description)
        numbers = {"setpoint": setpoint} | plant | {"gains": law.gains, "most": np.minimum(most, NO_LIMIT)}
        if model is not None:
            numbers["model"] = model
        return cls._of(f"{pattern} {law.name} {model_pattern}", numbers, arms, law)

    @classmethod
    def _of(
        cls, pattern: str, numbers: Mapping[str, Array], arms: Sequence[Description], law: Law | None
    ) -> StepKernel:
        """Return the step whose program has these numbers, shape (p,) of all runs or (B, p) of each."""
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

    def lasting(self, h: float) -> StepKernel:
        """Return the step under given torques with another length, s."""
        shared = self.shared.copy()
        shared[0] = h
        return replace(self, shared=shared)

    def rows(self, rows: slice) -> StepKernel:
        """Return the step of some of the runs, with numbers of its own."""
        return replace(self, shared=self.shared.copy(), own=None if self.own is None else self.own[rows])

    def __call__(self, states: Sequence[Array], drive: Array, into: Sequence[Array], threads: int = 1) -> None:
        """Fill joint values (B, n), rates (B, n) and works (B, 3) of after a step, and with a law its torques (B, n).

        Parameters
        ----------
        states
            Joint values, rates and works before.
        drive
            Torques (B, n); or with a law the setpoint, (3n,) where it is shared, and otherwise ignored.
        into
            Arrays to fill.
        threads
            How many threads share it.
        """
        own = () if self.own is None else (self.own,)
        if not self.closed:
            self.kernel(self.shared, [*states, drive, *own], list(into), threads)
            return
        if self.setpoint_shared:
            self.shared[: len(drive)] = drive
        self.kernel(self.shared, [*states, *own], list(into), threads)


def _same(arms: Sequence[Description], law: Law) -> bool:
    """Return whether the controller knows the arm that moves, so that they share symbols and what they work out."""
    return len(arms) == 1 and arms[0] == law.description


def _plant(arms: Sequence[Description], friction: Friction | None, h: float) -> tuple[str, dict[str, Array]]:
    """Return the pattern of a plant's program, and its numbers."""
    pattern, values = inertial_pattern(*arms)
    numbers = {"step": np.array([h]), "arm": values}
    if friction is None:
        return pattern, numbers
    losses = np.array([[friction.width, *arm.numbers.viscous, *arm.numbers.coulomb.ravel()] for arm in arms])
    return f"{pattern} friction", numbers | {"friction": losses[0] if len(arms) == 1 else losses}


def _graph(arms: Sequence[Description], law: Law | None, sizes: Mapping[str, int], own: Sequence[str]) -> Graph:
    """Return the program; ``sizes`` are the counts of its numbers by name, and ``own`` names those of each run."""
    import casadi

    n = arms[0].n
    symbols = {name: casadi.SX.sym(name, size) for name, size in sizes.items()}
    table, symbols["arm"] = InertialTable.parametric(*arms)
    q, qd, tau = (joint_symbols(name, n) for name in ("q", "qd", "tau"))
    works = casadi.SX.sym("works", len(WORKS))
    given, asked = tau, {}
    if law is not None:
        known = table
        if "model" in sizes:
            known, symbols["model"] = InertialTable.parametric(law.description)
        wanted, most = symbols["setpoint"], symbols["most"]
        torques = law.torques(known, Symbols(q, qd, wanted[:n], wanted[n : 2 * n], wanted[2 * n :]), symbols["gains"])
        given = casadi.fmin(casadi.fmax(torques, -most), most)
        asked = {"asked": torques}
    later = _advanced(table, q, qd, given, symbols["step"], symbols.get("friction"))
    shared = [symbol for name, symbol in symbols.items() if name not in own]
    inputs = {"shared": casadi.vertcat(*shared), "q": q, "qd": qd, "works": works}
    if law is None:
        inputs["tau"] = tau
    if own:
        inputs["own"] = casadi.vertcat(*(symbols[name] for name in sizes if name in own))
    outputs = {"q": later[0], "qd": later[1], "works": works + later[2], **asked}
    return Graph.of("runge_kutta_step", inputs, outputs)


def _advanced(
    table: InertialTable, q: casadi.SX, qd: casadi.SX, tau: casadi.SX, h: casadi.SX, friction: casadi.SX | None
) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
    """Return joint values and rates after a step under torques, and the works of ``WORKS``."""
    import casadi

    n = table.n

    def loss(v: casadi.SX) -> casadi.SX:
        if friction is None:
            return casadi.SX.zeros(n)
        viscous = [friction[1 + i] for i in range(n)]
        coulomb = [(friction[1 + n + 2 * i], friction[2 + n + 2 * i]) for i in range(n)]
        return friction_torque(v, viscous, coulomb, [smooth_direction(v[i], friction[0]) for i in range(n)])

    def rate(x: casadi.SX, v: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
        lost = loss(v)
        return recursive_forward_dynamics(table, x, v, tau - lost), casadi.dot(v, lost)

    a1, p1 = rate(q, qd)
    v2 = qd + h / 2 * a1
    a2, p2 = rate(q + h / 2 * qd, v2)
    v3 = qd + h / 2 * a2
    a3, p3 = rate(q + h / 2 * v2, v3)
    v4 = qd + h * a3
    a4, p4 = rate(q + h * v3, v4)
    moved = h / 6 * (qd + 2 * (v2 + v3) + v4)
    work = tau * moved
    works = casadi.vertcat(casadi.sum1(work), casadi.sum1(casadi.fabs(work)), h / 6 * (p1 + 2 * (p2 + p3) + p4))
    return q + moved, qd + h / 6 * (a1 + 2 * (a2 + a3) + a4), works
