"""The benchmark: set contenders up, check their answers, time them in turns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.agreement import Verdict, judge
from dhkit.bench.contenders import QUANTITIES, Call, Contender, Task, UnavailableError, Workload
from dhkit.bench.derivations import Derivation, Operations, derivations, operations
from dhkit.bench.machine import Machine
from dhkit.bench.peers import all_contenders, dhkit_arm
from dhkit.bench.probes import FirstCall, PeakMemory, ThreadScaling, first_call, peak_memory, thread_scaling
from dhkit.bench.report import BATCH, BenchReport, Ending, Missing, Outcome, Requirement, Row
from dhkit.bench.rounds import calm, items_within, lasting, repeated, rounds
from dhkit.description import Array

DYNAMICS = {"inverse_dynamics", "mass_matrix", "forward_dynamics"}
DERIVING = 90.0
"""s that a peer may derive: one that takes longer would not be waited for."""
REPEATS = 9
"""Rounds: odd, so that the median is one of them."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class _Entrant:
    """A contender that takes part: a call of ``times`` times ``items`` items."""

    contender: Contender
    verdict: Verdict
    items: int
    times: int
    call: Call


@dataclass
class _Findings:
    """What was measured so far; an interrupted run reports it."""

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
        Items of a batch; slow contenders get fewer, as their rows say.
    threads
        How many threads batch calls that offer threads may use.
    repeats
        Rounds.
    seed
        Of the random states.
    progress
        Gets a line before each step.
    probes
        Whether to measure threads, memory and new processes too, and with dynamics derivations.
    contenders
        Who takes part; everyone unless given.
    targets
        Returns the requirements that the report is held against; none unless given.

    Returns
    -------
    BenchReport
        What was measured; when interrupted from the keyboard, what was measured until then.

    Raises
    ------
    ValueError
        An unknown quantity, or a count below 1.

    Examples
    --------
    >>> own = dhkit_arm.contenders()
    >>> report = run(Arm.load("planar2r"), ["fk"], batch=100, repeats=1, probes=False, contenders=own)
    >>> report.rows[0].contender, report.rows[0].items
    ('dhkit, out=', 100)
    """
    _check(quantities, batch=batch, threads=threads, repeats=repeats)
    tell = progress or (lambda line: None)
    chosen = all_contenders() if contenders is None else contenders
    findings, interrupted = _Findings(), False
    try:
        with calm():
            workload = Workload.of(arm, batch, threads, seed)
            tell("compiling")
            arm.compile()
            for quantity in quantities:
                _compare(workload, [c for c in chosen if c.quantity == quantity], repeats, findings, tell)
                findings.outcomes.append(outcome_of(quantity, findings.rows, findings.missing))
            for quantity in quantities if probes else ():
                _probe(workload, quantity, repeats, findings, tell)
            if probes and not DYNAMICS.isdisjoint(quantities):
                tell("derivations")
                _derive(arm, findings)
    except KeyboardInterrupt:
        interrupted = True
    report = BenchReport(
        robot=arm.name,
        batch=batch,
        threads=threads,
        seed=seed,
        rows=tuple(findings.rows),
        missing=tuple(findings.missing),
        outcomes=tuple(findings.outcomes),
        scaling=tuple(findings.scaling),
        memory=tuple(findings.memory),
        starts=tuple(findings.starts),
        derivations=tuple(findings.derivations),
        operations=tuple(findings.operations),
        machine=Machine.here(),
        interrupted=interrupted,
    )
    return replace(report, requirements=targets(report)) if targets else report


def outcome_of(quantity: str, rows: Iterable[Row], missing: Iterable[Missing]) -> Outcome:
    """Return how the comparison of a quantity ended.

    A contender fails where it raises an error, and where its answers disagree with the reference. One that is not
    installed, or not made for the arm, does not fail: it counts only where dhkit itself, or every contender, is so.

    Parameters
    ----------
    quantity
        What was compared.
    rows
        Figures of contenders; those of other quantities do not count.
    missing
        Contenders without figures, likewise.

    Examples
    --------
    >>> print(outcome_of("fk", [], [Missing("fk", "peer", "failed: TypeError: 7 arguments", failed=True)]))
    fk: every contender failed; peer: failed: TypeError: 7 arguments
    """
    rows = [row for row in rows if row.quantity == quantity]
    missing = [gap for gap in missing if gap.quantity == quantity]
    raised = [(gap.own, f"{gap.name}: {gap.reason}") for gap in missing if gap.failed]
    disagreeing = [(row.own, f"{row.contender}: {row.verdict}") for row in rows if not row.verdict.ok]
    own_failed = tuple(cause for own, cause in (*raised, *disagreeing) if own)
    peers_failed = tuple(cause for own, cause in (*raised, *disagreeing) if not own)
    own_unavailable = tuple(f"{gap.name}: {gap.reason}" for gap in missing if gap.own and not gap.failed)

    if not any(row.verdict.ok for row in rows):
        if own_failed or peers_failed:
            return Outcome(quantity, Ending.ALL_FAILED, (*own_unavailable, *own_failed, *peers_failed))
        return Outcome(quantity, Ending.NOTHING_TIMED, tuple(f"{gap.name}: {gap.reason}" for gap in missing))
    if own_failed:
        return Outcome(quantity, Ending.OWN_FAILED, own_failed)
    if own_unavailable and not any(row.own for row in rows):
        return Outcome(quantity, Ending.OWN_MISSING, own_unavailable)
    return Outcome(quantity, Ending.PEERS_FAILED if peers_failed else Ending.COMPLETE, peers_failed)


def _check(quantities: Sequence[str], **counts: int) -> None:
    for quantity in quantities:
        if quantity not in QUANTITIES:
            raise ValueError(f"no quantity {quantity!r}; expected {', '.join(QUANTITIES)}")
    for name, count in counts.items():
        if count < 1:
            raise ValueError(f"{name} is {count}; expected 1 or more")


def _compare(
    workload: Workload, contenders: Sequence[Contender], repeats: int, findings: _Findings, tell: Progress
) -> None:
    """Check and time the contenders of one quantity; what an interrupted run has seen is kept."""
    entrants = list(_entrants(workload, contenders, findings, tell))
    if not entrants:
        return
    seconds: list[Array] = []
    try:
        for measured in rounds([entrant.call for entrant in entrants], repeats):
            seconds.append(measured)
            tell(f"{entrants[0].contender.quantity}: round {len(seconds)} of {repeats}")
    finally:
        if seconds:
            findings.rows += _rows(entrants, np.array(seconds))


def _entrants(
    workload: Workload, contenders: Sequence[Contender], findings: _Findings, tell: Progress
) -> Iterator[_Entrant]:
    for contender in contenders:
        tell(f"{contender.quantity}: {contender.name}")
        try:
            task = contender.setup(workload)
            verdict = judge(workload, contender.quantity, task)
            yield _prepared(contender, task, verdict, len(workload.q))
        except Exception as error:  # a peer may fail in any way; the benchmark goes on and says so
            findings.missing.append(_missing(contender.quantity, contender.name, error, own=contender.own))


def _prepared(contender: Contender, task: Task, verdict: Verdict, most: int) -> _Entrant:
    items = items_within(task, contender.mode, most)
    call = task.prepare(items)
    times = lasting(call)
    return _Entrant(contender, verdict, items, times, repeated(call, times))


def _missing(quantity: str, name: str, error: Exception, *, own: bool = False) -> Missing:
    text = " ".join(str(error).split())
    if isinstance(error, UnavailableError):
        return Missing(quantity, name, text, failed=False, own=own)
    return Missing(quantity, name, f"failed: {type(error).__name__}: {text}", failed=True, own=own)


def _rows(entrants: Sequence[_Entrant], seconds: Array) -> list[Row]:
    """Return rows of seconds, shape (rounds, entrants); ratios are taken within a round."""
    each = seconds / np.array([entrant.items * entrant.times for entrant in entrants])
    lower, middle, upper = np.quantile(each, [0.25, 0.5, 0.75], axis=0)
    names = [entrant.contender.name for entrant in entrants]

    def times(k: int, reference: str) -> float | None:
        return float(np.median(each[:, k] / each[:, names.index(reference)])) if reference in names else None

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
            times_batch=times(k, dhkit_arm.BATCH),
            times_single=times(k, dhkit_arm.SINGLE),
        )
        for k, entrant in enumerate(entrants)
    ]


def _derive(arm: Arm, findings: _Findings) -> None:
    """Count operations and time derivations."""
    try:
        findings.operations += operations(arm)
        findings.derivations += derivations(arm, DERIVING)
    except Exception as error:  # as for the contenders
        findings.missing.append(_missing("dynamics", "derivations", error))


def _probe(workload: Workload, quantity: str, repeats: int, findings: _Findings, tell: Progress) -> None:
    """Measure what the ratio table does not show; a probe that cannot is listed as missing."""
    steps: tuple[tuple[str, Callable[[], None]], ...] = (
        ("two threads", lambda: findings.scaling.append(thread_scaling(workload, quantity, repeats))),
        *(
            (f"memory, {called}", lambda called=called: findings.memory.append(peak_memory(workload, quantity, called)))
            for called in PeakMemory.CALLED
        ),
        ("a new process", lambda: findings.starts.append(first_call(workload, quantity))),
    )
    for name, step in steps:
        tell(f"{quantity}: {name}")
        try:
            step()
        except Exception as error:  # as for the contenders
            findings.missing.append(_missing(quantity, name, error))
