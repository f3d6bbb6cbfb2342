"""Times of deriving equations of motion, here and by sympy.physics.mechanics, and the lengths of the equations."""

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
from dhkit.errors import DhkitError
from dhkit.symbolic import CasadiFunctions, derive, lagrangian, operation_count
from dhkit.symbolic.exact.exact_arm import exact_arm

PEER = "sympy.physics.mechanics LagrangesMethod"
CASADI = "dhkit, CasADi functions, all of them"
_EXACT = "dhkit, exact M, C, g, tau in numbers"
_INERTIAL = "dhkit, exact, with symbols for inertial parameters"
PROOFS = "dhkit, both proofs of that"
INVERSE_DYNAMICS = "inverse dynamics"
FUNCTIONS = (
    "mass_matrix",
    "coriolis_matrix",
    "gravity_torque",
    "inverse_dynamics",
    "forward_dynamics",
    "lagrange",
)


@dataclass(frozen=True)
class Derivation:
    """The time of a derivation, s; None if it took longer than the limit, s."""

    COLUMNS: ClassVar[tuple[str, ...]] = ("robot", "who and what", "time")
    robot: str
    what: str
    seconds: float | None
    limit: float

    @property
    def cells(self) -> tuple[str, ...]:
        """The cells of a row under :attr:`COLUMNS`."""
        time = (
            f"{self.seconds:.3g} s" if self.seconds is not None else f"not within {self.limit:g} s"
        )
        return self.robot, self.what, time

    __repr__ = value_line


@dataclass(frozen=True)
class Operations:
    """The operations of a program, with gravity and rotor inertia; sines, cosines and constants are not counted."""

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
        """The cells of a row under :attr:`COLUMNS`."""
        counts = (self.additions, self.multiplications, self.total, self.trigonometric)
        return self.program, *map(str, counts)

    __repr__ = value_line


def operations(arm: Arm) -> list[Operations]:
    """Return the operations of inverse dynamics, gravity torque and mass matrix."""
    programs = (
        (INVERSE_DYNAMICS, "inverse_dynamics"),
        ("gravity torque", "gravity_torque"),
        ("mass matrix", "mass_matrix"),
    )
    counted = []
    for name, quantity in programs:
        counts = operation_count(dynamics_graph(quantity, arm.description))
        additions = counts.get("additions", 0) + counts.get("negations", 0)
        counted.append(
            Operations(
                name,
                additions,
                counts.get("multiplications", 0),
                counts.get("sines and cosines", 0),
            )
        )
    return counted


def derivations(arm: Arm, limit: float) -> list[Derivation]:
    """Time our derivations of an arm, and the peer's of this arm and of two planar ones, each within a limit, s."""
    description = arm.description

    def casadi() -> None:
        functions = CasadiFunctions(description)
        for name in FUNCTIONS:
            getattr(functions, name)

    def exact(symbols: str) -> Callable[[], None]:
        def run() -> None:
            exact_arm.cache_clear()
            lag = lagrangian(description, symbols)  # type: ignore[arg-type]
            lag.C, lag.g, lag.tau  # noqa: B018 - they are derived when they are first read

        return run

    def proofs() -> None:
        lag = lagrangian(description, "inertial")
        if not (
            lag.prove_euler_lagrange(derive(description, symbols="inertial"))
            and lag.prove_skew_symmetry()
        ):
            raise DhkitError("the two derivations differ")

    own = (
        (CASADI, casadi),
        (_EXACT, exact("none")),
        (_INERTIAL, exact("inertial")),
        (PROOFS, proofs),
    )
    timed = [Derivation(arm.name, what, _seconds(run), limit) for what, run in own]
    peers = [Arm.load(name) for name in ("planar2r", "planar3r")]
    peers += [] if arm.name in ("planar2r", "planar3r") else [arm]
    return [
        *timed,
        *(Derivation(peer.name, PEER, _peer_seconds(peer, limit), limit) for peer in peers),
    ]


def _seconds(run: Callable[[], None]) -> float:
    run()  # imports modules, and warms the interpreter up
    start = perf_counter()
    run()
    return perf_counter() - start


def _peer_seconds(arm: Arm, limit: float) -> float | None:
    """Return the time of the peer in a process of its own, s; None if it exceeds the limit, s."""
    with tempfile.TemporaryDirectory() as folder:
        robot = Path(folder) / "robot.toml"
        write_robot(bare(arm.description), robot)
        command = [
            sys.executable,
            "-c",
            "from dhkit.bench import derivations as d; d.report_peer()",
            str(robot),
        ]
        try:
            process = subprocess.run(  # noqa: S603 - our own code
                command, capture_output=True, text=True, timeout=limit + 10, check=True
            )
        except subprocess.TimeoutExpired:
            return None
    seconds = float(process.stdout)
    return seconds if seconds <= limit else None


def report_peer() -> None:
    """Print the time of the peer, s, for the robot file in the arguments."""
    description = Arm.load(sys.argv[1]).description
    lagranges_equations(Arm.load("polar_rp").description)  # imports modules
    start = perf_counter()
    lagranges_equations(description)
    sys.stdout.write(str(perf_counter() - start))
