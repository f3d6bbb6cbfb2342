"""What dhkit must reach beside its peers, and whether it did."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from dhkit.bench.derivations import CASADI, INVERSE_DYNAMICS, PROOFS, Derivation, Operations
from dhkit.bench.peers import eaik, pinocchio
from dhkit.bench.probes import FirstCall, PeakMemory, ThreadScaling
from dhkit.bench.report import Requirement, Row

PIN_CALL = 0.25
"""µs of a pin.forwardKinematics call on the machine that a single call's figure is asked on."""


@dataclass(frozen=True)
class _Comparison:
    """A requirement on a peer's row."""

    quantity: str
    what: str
    peer: str
    required: float
    figure: Callable[[Row], float | None]
    at_most: bool = False
    target: float | None = None


DERIVED = {CASADI: 0.5, PROOFS: 5.0}
"""s that derivations may take."""
COMPARISONS = (
    _Comparison(
        "fk",
        "times a loop over pin.forwardKinematics",
        pinocchio.FORWARD,
        8.0,
        lambda row: row.times_batch,
        target=12.0,
    ),
    _Comparison(
        "fk",
        f"µs a single call where Pinocchio's takes {PIN_CALL:g} µs",
        pinocchio.FORWARD,
        10.0,
        lambda row: PIN_CALL / row.times_single if row.times_single else None,
        at_most=True,
    ),
    _Comparison(
        "ik", "times EAIK's batch call, all branches", eaik.BATCH, 12.0, lambda row: row.times_batch, target=20.0
    ),
    _Comparison(
        "ik",
        "a single call over EAIK's single call",
        eaik.SINGLE,
        3.0,
        lambda row: 1 / row.times_single if row.times_single else None,
        at_most=True,
    ),
    _Comparison(
        "jacobian",
        "times a loop over pin.computeJointJacobians",
        pinocchio.JACOBIANS,
        6.0,
        lambda row: row.times_batch,
    ),
    _Comparison(
        "inverse_dynamics",
        "times pin.rneaInParallel on one thread",
        pinocchio.RNEA_BATCH,
        15.0,
        lambda row: row.times_batch,
        target=30.0,
    ),
    _Comparison("mass_matrix", "times a loop over pin.crba", pinocchio.CRBA, 8.0, lambda row: row.times_batch),
    _Comparison(
        "forward_dynamics",
        "times pin.abaInParallel on one thread",
        pinocchio.ABA_BATCH,
        20.0,
        lambda row: row.times_batch,
    ),
)


def requirements(
    rows: Iterable[Row],
    quantities: Iterable[str],
    scaling: Iterable[ThreadScaling],
    memory: Iterable[PeakMemory],
    starts: Iterable[FirstCall],
    derived: Iterable[Derivation] = (),
    counted: Iterable[Operations] = (),
    *,
    as_asked: bool,
) -> tuple[Requirement, ...]:
    """Return what is asked of the quantities, beside what was measured.

    Parameters
    ----------
    rows, scaling, memory, starts, derived, counted
        What was measured.
    quantities
        What the run was about.
    as_asked
        Whether batch and threads are those that the figures are asked at.
    """
    by_name = {(row.quantity, row.contender): row for row in rows}
    wanted = set(quantities)
    return (
        *(_compared(line, by_name, as_asked) for line in COMPARISONS if line.quantity in wanted),
        *(
            Requirement(
                line.quantity, "scaling to two threads over a control loop's", 0.85, False, line.share, as_asked
            )
            for line in scaling
        ),
        *(
            Requirement(
                line.quantity, f"peak memory over inputs and outputs ({line.called})", 3.0, True, line.share, as_asked
            )
            for line in memory
        ),
        *(
            Requirement(
                line.quantity, "s from the start of a second process to its first batch", 2.0, True, line.second
            )
            for line in starts
        ),
        *(
            Requirement(line.robot, f"s: {line.what}", DERIVED[line.what], True, line.seconds)
            for line in derived
            if line.what in DERIVED
        ),
        *(
            Requirement("inverse_dynamics", "additions and multiplications", 400, True, line.total, target=305)
            for line in counted
            if line.program == INVERSE_DYNAMICS
        ),
    )


def _compared(line: _Comparison, rows: Mapping[tuple[str, str], Row], as_asked: bool) -> Requirement:
    row = rows.get((line.quantity, line.peer))
    measured = line.figure(row) if row else None
    return Requirement(line.quantity, line.what, line.required, line.at_most, measured, as_asked, line.target)
