"""How long equations of motion take to derive, here and by sympy.physics.mechanics, and how long they are."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import ClassVar

from dhkit.arm import Arm
from dhkit.bench.geometry import bare
from dhkit.bench.peers.sympy_mechanics import lagranges_equations
from dhkit.description import write_robot
from dhkit.display import value_line
from dhkit.dynamics import dynamics_graph
from dhkit.symbolic import CasadiFunctions, derive, lagrangian, operation_count
from dhkit.symbolic.exact.exact_arm import exact_arm

PEER = "sympy.physics.mechanics LagrangesMethod"
CASADI = "dhkit, CasADi functions, all of them"
EXACT = "dhkit, exact M, C, g, tau in numbers"
INERTIAL = "dhkit, exact, all inertial parameters symbols"
PROOFS = "dhkit, both proofs of that"
INVERSE_DYNAMICS = "inverse dynamics"
FUNCTIONS = ("mass_matrix", "coriolis_matrix", "gravity_torque", "inverse_dynamics", "forward_dynamics", "lagrange")


@dataclass(frozen=True)
class Derivation:
    """A time of deriving; None where it took longer than the limit."""

    COLUMNS: ClassVar[tuple[str, ...]] = ("robot", "who and what", "time")
    robot: str
    what: str
    seconds: float | None
    limit: float

    @property
    def cells(self) -> tuple[str, ...]:
        """A line of a table under :attr:`COLUMNS`."""
        time = f"{self.seconds:.3g} s" if self.seconds is not None else f"not within {self.limit:g} s"
        return self.robot, self.what, time

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True)
class Operations:
    """What a program is made of; sines, cosines and constants are free, gravity and rotor inertia are in."""

    COLUMNS: ClassVar[tuple[str, ...]] = ("program", "+ and -", "×", "sum", "sines and cosines")
    program: str
    additions: int
    multiplications: int
    trigonometric: int

    @property
    def total(self) -> int:
        """Additions, subtractions and multiplications."""
        return self.additions + self.multiplications

    @property
    def cells(self) -> tuple[str, ...]:
        """A line of a table under :attr:`COLUMNS`."""
        counts = (self.additions, self.multiplications, self.total, self.trigonometric)
        return self.program, *map(str, counts)

    def __repr__(self) -> str:
        return value_line(self)


def operations(arm: Arm) -> list[Operations]:
    """Return the operations of inverse dynamics, gravity torque and mass matrix."""
    programs = (
        (INVERSE_DYNAMICS, "inverse_dynamics"),
        ("gravity torque", "gravity_torque"),
        ("mass matrix", "mass_matrix"),
    )
    found = []
    for name, quantity in programs:
        counts = operation_count(dynamics_graph(quantity, arm.description))
        additions = counts.get("additions", 0) + counts.get("negations", 0)
        found.append(Operations(name, additions, counts.get("multiplications", 0), counts.get("sines and cosines", 0)))
    return found


def derivations(arm: Arm, limit: float) -> list[Derivation]:
    """Time our derivations of an arm, and the peer's of it and of two planar ones, each within a time limit, s."""
    description = arm.description

    def casadi() -> None:
        functions = CasadiFunctions(description)
        for name in FUNCTIONS:
            getattr(functions, name)

    def exact(symbols: str) -> Callable[[], None]:
        def run() -> None:
            exact_arm.cache_clear()
            found = lagrangian(description, symbols)  # type: ignore[arg-type]
            found.C, found.g, found.tau  # noqa: B018 - derived when first asked for

        return run

    def proofs() -> None:
        found = lagrangian(description, "inertial")
        if not (found.prove_euler_lagrange(derive(description, symbols="inertial")) and found.prove_skew_symmetry()):
            raise AssertionError("the two derivations differ")

    own = ((CASADI, casadi), (EXACT, exact("none")), (INERTIAL, exact("inertial")), (PROOFS, proofs))
    found = [Derivation(arm.name, what, _seconds(run), limit) for what, run in own]
    peers = [Arm.load(name) for name in ("planar2r", "planar3r")]
    peers += [] if arm.name in ("planar2r", "planar3r") else [arm]
    return [*found, *(Derivation(peer.name, PEER, _peer_seconds(peer, limit), limit) for peer in peers)]


def _seconds(run: Callable[[], None]) -> float:
    run()  # imports, and what the interpreter learns
    start = perf_counter()
    run()
    return perf_counter() - start


def _peer_seconds(arm: Arm, limit: float) -> float | None:
    """Time the peer in a process of its own, which a limit can end."""
    with tempfile.TemporaryDirectory() as folder:
        robot = Path(folder) / "robot.toml"
        write_robot(bare(arm.description), robot)
        command = [sys.executable, "-c", "from dhkit.bench import derivations as d; d.report_peer()", str(robot)]
        try:
            done = subprocess.run(  # noqa: S603 - our own code
                command, capture_output=True, text=True, timeout=limit + 10, check=True
            )
        except subprocess.TimeoutExpired:
            return None
    seconds = float(done.stdout)
    return seconds if seconds <= limit else None


def report_peer() -> None:
    """Print how long the peer takes for the robot file named in the arguments, s."""
    description = Arm.load(sys.argv[1]).description
    lagranges_equations(Arm.load("polar_rp").description)  # imports
    start = perf_counter()
    lagranges_equations(description)
    sys.stdout.write(str(perf_counter() - start))
