"""Targets of dhkit beside its peers, and a run of `dhkit bench` that is compared with them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dhkit.arm import Arm
from dhkit.bench import BenchReport, Requirement, Row
from dhkit.bench.benchmark_report import BATCH
from dhkit.bench.derivations import CASADI, INVERSE_DYNAMICS, PROOFS
from dhkit.bench.peers import eaik, pinocchio
from dhkit.bench.runner import REPEATS
from dhkit.cli.bench import run


@dataclass(frozen=True)
class _Comparison:
    """A target for the ratio of a peer's time to dhkit's."""

    quantity: str
    what: str
    peer: str
    required: float
    measured: Callable[[Row], float | None]
    at_most: bool = False
    target: float | None = None


def _single(quantity: str, peer: str, required: float, target: float | None = None) -> _Comparison:
    """Return the target for a single call, as a share of a peer's, see issue 21's table of both on one machine."""
    return _Comparison(
        quantity,
        f"a single call over {peer}",
        peer,
        required,
        lambda row: 1 / row.times_single if row.times_single else None,
        at_most=True,
        target=target,
    )


MAX_DERIVATION_TIMES = {CASADI: 0.5, PROOFS: 5.0}
"""Longest times of derivations, s, by name."""
COMPARISONS = (
    _Comparison(
        "fk",
        "times a loop over pin.forwardKinematics",
        pinocchio.FORWARD,
        8.0,
        lambda row: row.times_batch,
        target=12.0,
    ),
    _single("fk", pinocchio.FORWARD, 1.07),
    _Comparison(
        "ik",
        "times EAIK's batch call, all branches",
        eaik.BATCH,
        12.0,
        lambda row: row.times_batch,
        target=20.0,
    ),
    _single("ik", eaik.SINGLE, 0.56),
    _single("ik_numeric", "roboticstoolbox ik_LM", 1.0, target=0.045),
    _single("jacobian", pinocchio.FRAME_JACOBIAN, 0.7),
    _single("inverse_dynamics", pinocchio.RNEA, 0.45),
    _single("mass_matrix", pinocchio.CRBA, 0.57),
    _single("forward_dynamics", pinocchio.ABA, 0.33),
    _single("inverse_dynamics_derivatives", pinocchio.DERIVATIVES, 0.41),
    _single("regressor", pinocchio.REGRESSOR, 0.44),
    _Comparison(
        "inverse_dynamics_derivatives",
        "times a loop over pin.computeRNEADerivatives",
        pinocchio.DERIVATIVES,
        5.8,
        lambda row: row.times_batch,
        target=19.0,
    ),
    _Comparison(
        "regressor",
        "times a loop over pin.computeJointTorqueRegressor",
        pinocchio.REGRESSOR,
        2.1,
        lambda row: row.times_batch,
        target=9.0,
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
    _Comparison(
        "mass_matrix",
        "times a loop over pin.crba",
        pinocchio.CRBA,
        8.0,
        lambda row: row.times_batch,
    ),
    _Comparison(
        "forward_dynamics",
        "times pin.abaInParallel on one thread",
        pinocchio.ABA_BATCH,
        20.0,
        lambda row: row.times_batch,
    ),
)


def targets(report: BenchReport) -> tuple[Requirement, ...]:
    """Return the targets for the quantities of a report, beside the measured numbers."""
    is_judged = report.batch >= BATCH and report.threads == 1
    rows = {(row.quantity, row.contender): row for row in report.rows}
    return (
        *(
            _compared(line, rows, is_judged)
            for line in COMPARISONS
            if line.quantity in report.quantities
        ),
        *(
            Requirement(
                line.quantity,
                "scaling to two threads over a control loop's",
                0.85,
                False,
                line.share,
                is_judged,
            )
            for line in report.scaling
        ),
        *(
            Requirement(
                line.quantity,
                f"peak memory over inputs and outputs ({line.called})",
                3.0,
                True,
                line.share,
                is_judged,
            )
            for line in report.memory
        ),
        *(
            Requirement(
                line.quantity,
                "s from the start of a second process to its first batch",
                2.0,
                True,
                line.second,
            )
            for line in report.starts
        ),
        *(
            Requirement(
                line.robot, f"s: {line.what}", MAX_DERIVATION_TIMES[line.what], True, line.seconds
            )
            for line in report.derivations
            if line.what in MAX_DERIVATION_TIMES
        ),
        *(
            Requirement(
                "inverse_dynamics",
                "additions and multiplications",
                400,
                True,
                line.total,
                target=305,
            )
            for line in report.operations
            if line.program == INVERSE_DYNAMICS
        ),
    )


def _compared(
    line: _Comparison, rows: Mapping[tuple[str, str], Row], is_judged: bool
) -> Requirement:
    row = rows.get((line.quantity, line.peer))
    measured = line.measured(row) if row else None
    return Requirement(
        line.quantity, line.what, line.required, line.at_most, measured, is_judged, line.target
    )


def main(quantities: Sequence[str], result: Path, arguments: Sequence[str] | None = None) -> None:
    """Run `dhkit bench` on some quantities, and write the report with the targets."""
    parser = argparse.ArgumentParser(
        description=f"dhkit beside its peers: {', '.join(quantities)}."
    )
    parser.add_argument(
        "--robot", default="puma560", help="of the library, or a robot file (default: puma560)"
    )
    parser.add_argument(
        "--batch", type=int, default=BATCH, help="items of a batch (default: %(default)s)"
    )
    parser.add_argument(
        "--threads", type=int, default=1, help="that batch calls may use (default: 1)"
    )
    parser.add_argument(
        "--repeats", type=int, default=REPEATS, help="rounds (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--no-probes", dest="probes", action="store_false", help="no threads, memory and processes"
    )
    parser.add_argument(
        "--output", type=Path, default=result, help="path of the results, without ending"
    )
    chosen = vars(parser.parse_args(arguments))
    arm = Arm.load(chosen.pop("robot"))
    sys.exit(run(arm, quantities, **chosen, json=False, targets=targets))
