"""The benchmark: contenders are set up, their answers are checked, and they are timed in turns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.agreement import Verdict, judge
from dhkit.bench.benchmark_report import (
    BATCH,
    BenchReport,
    Ending,
    Missing,
    Outcome,
    Requirement,
    Row,
)
from dhkit.bench.contenders import (
    INVERSE_KINEMATICS,
    QUANTITIES,
    Call,
    Contender,
    UnavailableError,
    Workload,
)
from dhkit.bench.derivations import Derivation, Operations, derivations, operations
from dhkit.bench.machine import Machine
from dhkit.bench.peers import all_contenders, dhkit_arm
from dhkit.bench.probes import (
    FirstCall,
    PeakMemory,
    ThreadScaling,
    first_call,
    peak_memory,
    thread_scaling,
)
from dhkit.bench.rounds import calm, items_within, lasting, repeated, rounds
from dhkit.description import Array

_DYNAMICS = set(QUANTITIES) - {"fk", "jacobian", *INVERSE_KINEMATICS}
"""Quantities with which derivations are timed too."""
_MAX_DERIVATION_TIME = 90.0
"""Longest time of a peer's derivation, s: nobody would wait longer."""
REPEATS = 9
"""Number of rounds: odd, so that the median is one of them."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class _Entrant:
    """A contender that takes part, with a call that repeats a batch of ``items`` items ``repetitions`` times."""

    contender: Contender
    verdict: Verdict
    items: int
    repetitions: int
    call: Call


@dataclass
class _Measurements:
    """The measurements so far, kept if the run is interrupted; fields have the names of :class:`BenchReport`'s."""

    rows: list[Row] = field(default_factory=list)
    missing: list[Missing] = field(default_factory=list)
    outcomes: list[Outcome] = field(default_factory=list)
    scaling: list[ThreadScaling] = field(default_factory=list)
    memory: list[PeakMemory] = field(default_factory=list)
    starts: list[FirstCall] = field(default_factory=list)
    derivations: list[Derivation] = field(default_factory=list)
    operations: list[Operations] = field(default_factory=list)


def run(
    arm: Arm,
    quantities: Sequence[str] = QUANTITIES,
    batch: int = BATCH,
    threads: int = 1,
    repeats: int = REPEATS,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    probes: bool = True,
    contenders: Sequence[Contender] | None = None,
    targets: Callable[[BenchReport], tuple[Requirement, ...]] | None = None,
) -> BenchReport:
    """Time dhkit beside every peer that is installed, in one process and in interleaved rounds.

    Parameters
    ----------
    arm
        The robot.
    quantities
        Any of :data:`QUANTITIES`.
    batch
        Items of a batch; slow contenders get fewer, as their rows show.
    threads
        Number of threads that batch calls may use, if they have threads.
    repeats
        Number of rounds.
    seed
        Seed of the random states.
    progress
        Called with a line before each step.
    probes
        Whether threads, memory and first calls in new processes are measured too. For quantities of dynamics, peers'
        derivations are timed as well.
    contenders
        The contenders; by default all.
    targets
        Returns the requirements that the report is compared with; by default there are none.

    Returns
    -------
    BenchReport
        The measurements; after Ctrl-C those until then.

    Raises
    ------
    ValueError
        A quantity is unknown, or a count is below 1.

    Examples
    --------
    >>> own = dhkit_arm.contenders()
    >>> report = run(Arm.load("planar2r"), ["fk"], batch=100, repeats=1, probes=False, contenders=own)
    >>> report.rows[0].contender, report.rows[0].items
    ('dhkit, out=', 100)
    """
    _check_arguments(quantities, batch=batch, threads=threads, repeats=repeats)
    tell = progress or (lambda line: None)
    chosen = all_contenders() if contenders is None else contenders
    measurements = _Measurements()
    interrupted = False
    try:
        with calm():
            workload = Workload.of(arm, batch, threads, seed)
            tell("compiling")
            arm.compile()
            for quantity in quantities:
                _compare(
                    workload,
                    [c for c in chosen if c.quantity == quantity],
                    repeats,
                    measurements,
                    tell,
                )
                measurements.outcomes.append(
                    outcome_of(quantity, measurements.rows, measurements.missing)
                )
            for quantity in quantities if probes else ():
                _probe(workload, quantity, repeats, measurements, tell)
            if probes and not _DYNAMICS.isdisjoint(quantities):
                tell("derivations")
                _derive(arm, measurements)
    except KeyboardInterrupt:
        interrupted = True
    report = BenchReport(
        robot=arm.name,
        batch=batch,
        threads=threads,
        seed=seed,
        **{name: tuple(values) for name, values in vars(measurements).items()},
        machine=Machine.here(),
        interrupted=interrupted,
    )
    return replace(report, requirements=targets(report)) if targets else report


def outcome_of(quantity: str, rows: Iterable[Row], missing: Iterable[Missing]) -> Outcome:
    """Return how the comparison of a quantity ended.

    A contender fails if it raises an error, or if its answers disagree with the reference. A contender that is not
    installed, or not made for the arm, does not fail: this matters only if dhkit is unavailable, or all contenders are.

    Parameters
    ----------
    quantity
        The quantity.
    rows
        Rows of contenders; those of other quantities are ignored.
    missing
        Contenders without rows; those of other quantities are ignored.

    Examples
    --------
    >>> print(outcome_of("fk", [], [Missing("fk", "peer", "failed: TypeError: 7 arguments", failed=True)]))
    fk: every contender failed; peer: failed: TypeError: 7 arguments
    """
    rows = [row for row in rows if row.quantity == quantity]
    absent = [one for one in missing if one.quantity == quantity]
    raised = [(one.own, f"{one.name}: {one.reason}") for one in absent if one.failed]
    disagreeing = [
        (row.own, f"{row.contender}: {row.verdict}") for row in rows if not row.verdict.ok
    ]
    own_failed = tuple(cause for own, cause in (*raised, *disagreeing) if own)
    peers_failed = tuple(cause for own, cause in (*raised, *disagreeing) if not own)
    own_unavailable = tuple(
        f"{one.name}: {one.reason}" for one in absent if one.own and not one.failed
    )

    if not any(row.verdict.ok for row in rows):
        if own_failed or peers_failed:
            return Outcome(
                quantity, Ending.ALL_FAILED, (*own_unavailable, *own_failed, *peers_failed)
            )
        return Outcome(
            quantity, Ending.NOTHING_TIMED, tuple(f"{one.name}: {one.reason}" for one in absent)
        )
    if own_failed:
        return Outcome(quantity, Ending.OWN_FAILED, own_failed)
    if own_unavailable and not any(row.own for row in rows):
        return Outcome(quantity, Ending.OWN_MISSING, own_unavailable)
    return Outcome(quantity, Ending.PEERS_FAILED if peers_failed else Ending.COMPLETE, peers_failed)


def _check_arguments(quantities: Sequence[str], **counts: int) -> None:
    for quantity in quantities:
        if quantity not in QUANTITIES:
            raise ValueError(f"no quantity {quantity!r}; expected {', '.join(QUANTITIES)}")
    for name, count in counts.items():
        if count < 1:
            raise ValueError(f"{name} is {count}; expected 1 or more")


def _compare(
    workload: Workload,
    contenders: Sequence[Contender],
    repeats: int,
    measurements: _Measurements,
    tell: Progress,
) -> None:
    """Check and time the contenders of one quantity; the rounds of an interrupted run are kept."""
    entrants = list(_entrants(workload, contenders, measurements, tell))
    if not entrants:
        return
    seconds: list[Array] = []
    try:
        for measured in rounds([entrant.call for entrant in entrants], repeats):
            seconds.append(measured)
            tell(f"{entrants[0].contender.quantity}: round {len(seconds)} of {repeats}")
    finally:
        if seconds:
            measurements.rows += _rows(entrants, np.array(seconds))


def _entrants(
    workload: Workload, contenders: Sequence[Contender], measurements: _Measurements, tell: Progress
) -> Iterator[_Entrant]:
    """Yield the contenders that can be timed; the others are added to the missing ones of ``measurements``."""
    for contender in contenders:
        tell(f"{contender.quantity}: {contender.name}")
        try:
            task = contender.setup(workload)
            verdict = judge(workload, contender.quantity, task)
            items = items_within(task, contender.mode, len(workload.q))
            call = task.prepare(items)
            repetitions = lasting(call)
            entrant = _Entrant(contender, verdict, items, repetitions, repeated(call, repetitions))
        except Exception as error:  # a peer may fail in any way; the report names it
            measurements.missing.append(
                _missing(contender.quantity, contender.name, error, own=contender.own)
            )
        else:
            yield entrant


def _missing(quantity: str, name: str, error: Exception, *, own: bool = False) -> Missing:
    text = " ".join(str(error).split())
    if isinstance(error, UnavailableError):
        return Missing(quantity, name, text, failed=False, own=own)
    return Missing(quantity, name, f"failed: {type(error).__name__}: {text}", failed=True, own=own)


def _rows(entrants: Sequence[_Entrant], seconds: Array) -> list[Row]:
    """Return the rows of timings, shape (rounds, entrants), s.

    A ratio is the median over the rounds of an entrant's time an item by that of dhkit's reference call.
    """
    per_item = seconds / np.array([entrant.items * entrant.repetitions for entrant in entrants])
    # Quartiles, s
    lower, middle, upper = np.quantile(per_item, [0.25, 0.5, 0.75], axis=0)
    names = [entrant.contender.name for entrant in entrants]

    def ratio(k: int, reference: str) -> float | None:
        return (
            float(np.median(per_item[:, k] / per_item[:, names.index(reference)]))
            if reference in names
            else None
        )

    return [
        Row(
            quantity=entrant.contender.quantity,
            contender=entrant.contender.name,
            mode=entrant.contender.mode,
            own=entrant.contender.own,
            items=entrant.items,
            rounds=len(seconds),
            seconds=float(middle[k]),
            lower=float(lower[k]),
            upper=float(upper[k]),
            verdict=entrant.verdict,
            times_batch=ratio(k, dhkit_arm.BATCH),
            times_single=ratio(k, dhkit_arm.SINGLE),
        )
        for k, entrant in enumerate(entrants)
    ]


def _derive(arm: Arm, measurements: _Measurements) -> None:
    """Count operations and time derivations."""
    try:
        measurements.operations += operations(arm)
        measurements.derivations += derivations(arm, _MAX_DERIVATION_TIME)
    except Exception as error:  # it may fail in any way, as contenders may
        measurements.missing.append(_missing("dynamics", "derivations", error))


def _probe(
    workload: Workload, quantity: str, repeats: int, measurements: _Measurements, tell: Progress
) -> None:
    """Measure the probes of a quantity; a probe that cannot be measured is listed as missing."""

    def probe(
        name: str, results: list[Any], measure: Callable[..., object], *options: object
    ) -> None:
        tell(f"{quantity}: {name}")
        try:
            results.append(measure(workload, quantity, *options))
        except Exception as error:  # it may fail in any way, as contenders may
            measurements.missing.append(_missing(quantity, name, error))

    probe("two threads", measurements.scaling, thread_scaling, repeats)
    for called in PeakMemory.CALLED:
        probe(f"memory, {called}", measurements.memory, peak_memory, called)
    probe("a new process", measurements.starts, first_call)
