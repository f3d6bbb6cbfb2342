"""What dhkit's kinematics must reach beside its peers, and whether they did."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dhkit.bench.peers import eaik, pinocchio
from dhkit.bench.probes import FirstCall, PeakMemory, ThreadScaling

if TYPE_CHECKING:
    from dhkit.bench.report import Row

__all__ = ["BATCH", "Requirement", "requirements"]

BATCH = 100_000
"""Items of the batch that the figures are asked at."""
PIN_CALL = 0.25
"""µs of a pin.forwardKinematics call on the machine that a single call's figure is asked on."""


@dataclass(frozen=True)
class Requirement:
    """A figure that dhkit must reach.

    Attributes
    ----------
    quantity, what
        What is compared.
    required, target
        The least (or most) that is asked, and what is hoped for.
    at_most
        Whether ``required`` is the most.
    measured
        What was seen; None where something did not take part.
    judged
        Whether it was measured under the conditions that it is asked under.
    """

    quantity: str
    what: str
    required: float
    at_most: bool
    measured: float | None
    judged: bool = True
    target: float | None = None

    @property
    def met(self) -> bool | None:
        """Whether it is reached; None where that cannot be told."""
        if self.measured is None or not self.judged:
            return None
        return self.measured <= self.required if self.at_most else self.measured >= self.required

    @property
    def derived(self) -> dict[str, Any]:
        """What JSON carries beyond the fields."""
        return {"met": self.met}

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """What, required, measured, verdict."""
        target = f" (target {self.target:g})" if self.target else ""
        bound = f"at {'most' if self.at_most else 'least'} {self.required:g}{target}"
        measured = "not measured" if self.measured is None else f"{self.measured:.3g}"
        unjudged = "" if self.measured is None else f"asked at batches of {BATCH}, one thread"
        return (
            f"{self.quantity}: {self.what}",
            bound,
            measured,
            {True: "met", False: "MISSED", None: unjudged}[self.met],
        )


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
)


def requirements(
    rows: Iterable[Row],
    quantities: Iterable[str],
    scaling: Iterable[ThreadScaling],
    memory: Iterable[PeakMemory],
    starts: Iterable[FirstCall],
    *,
    as_asked: bool,
) -> tuple[Requirement, ...]:
    """Return what is asked of the quantities, beside what was measured.

    Parameters
    ----------
    rows, scaling, memory, starts
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
    )


def _compared(line: _Comparison, rows: Mapping[tuple[str, str], Row], as_asked: bool) -> Requirement:
    row = rows.get((line.quantity, line.peer))
    measured = line.figure(row) if row else None
    return Requirement(line.quantity, line.what, line.required, line.at_most, measured, as_asked, line.target)
