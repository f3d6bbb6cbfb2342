"""From rows and gaps to how the comparison of a quantity ended."""

from __future__ import annotations

from collections.abc import Iterable

from dhkit.bench.report import Ending, Missing, Outcome, Row


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
