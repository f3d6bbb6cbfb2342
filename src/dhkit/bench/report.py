"""What a benchmark found, for people (text, Markdown) and machines (JSON)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any, TypeAlias

from dhkit.bench.agreement import Verdict
from dhkit.bench.contenders import Mode
from dhkit.bench.derivations import Derivation, Operations
from dhkit.bench.machine import Machine
from dhkit.bench.probes import FirstCall, PeakMemory, ThreadScaling
from dhkit.display import counted, html_block, html_lines, html_table, repr_line

BATCH = 100_000
"""Items of the batch that the figures are asked at."""

Table: TypeAlias = tuple[str, Sequence[str], list[list[str]]]
RATIO_MEANING = (
    "x batch and x single: how many times as long as dhkit's batch call with out=, and as its single call; "
    "medians over the rounds. Error: largest difference from dhkit's answers (of dynamics over their "
    "largest); a solution is one that closes to 1e-9."
)


@dataclass(frozen=True)
class Row:
    """One contender's figures.

    Attributes
    ----------
    quantity, contender, mode
        What was timed and how it was called.
    own
        Whether it is dhkit itself.
    items, rounds
        Items a batch call, or a loop of single calls; rounds.
    seconds, lower, upper
        Median and quartiles over the rounds, s an item.
    verdict
        Whether its answers agree with dhkit's.
    times_batch, times_single
        Its time over that of dhkit's batch call with ``out=``, and over that of dhkit's single call; None where dhkit
        was not measured.
    """

    quantity: str
    contender: str
    mode: Mode
    own: bool
    items: int
    rounds: int
    seconds: float
    lower: float
    upper: float
    verdict: Verdict
    times_batch: float | None
    times_single: float | None

    def __repr__(self) -> str:
        said = f"{self.mode.value}, {duration(self.seconds)} an item"
        return repr_line("Row", f"{self.quantity} by {self.contender}", said)


@dataclass(frozen=True)
class Missing:
    """A contender or a probe that did not take part, and why.

    Attributes
    ----------
    quantity, name, reason
        What it was to compute or to measure, whose or what it is, why there are no figures of it.
    failed
        Whether it raised an error; otherwise it is not installed, or is not made for this arm or machine.
    own
        Whether it is one of dhkit's own contenders.
    """

    quantity: str
    name: str
    reason: str
    failed: bool = False
    own: bool = False

    def __repr__(self) -> str:
        return repr_line("Missing", f"{self.quantity} by {self.name}", self.reason)


class Ending(Enum):
    """How the comparison of a quantity ended, in words."""

    COMPLETE = "every contender that took part agrees"
    PEERS_FAILED = "peers failed"
    OWN_FAILED = "dhkit itself failed"
    OWN_MISSING = "dhkit itself could not be timed"
    ALL_FAILED = "every contender failed"
    NOTHING_TIMED = "nothing could be timed"


@dataclass(frozen=True)
class Outcome:
    """How the comparison of a quantity ended, and why.

    Attributes
    ----------
    quantity
        What was compared.
    ending
        How it ended.
    causes
        The contenders that brought it about, each with its reason; none where all is well.
    """

    quantity: str
    ending: Ending
    causes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether dhkit was timed and agrees, whatever its peers did."""
        return self.ending in (Ending.COMPLETE, Ending.PEERS_FAILED)

    @property
    def derived(self) -> dict[str, Any]:
        """What JSON carries beside the quantity and the causes."""
        return {"ending": self.ending.name.lower(), "ok": self.ok}

    def __str__(self) -> str:
        more = f" (and {len(self.causes) - 1} more)" if len(self.causes) > 1 else ""
        cause = f"; {self.causes[0]}{more}" if self.causes else ""
        return f"{self.quantity}: {self.ending.value}{cause}"

    def __repr__(self) -> str:
        return repr_line("Outcome", said=str(self))


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
    conditions
        What these are.
    """

    quantity: str
    what: str
    required: float
    at_most: bool
    measured: float | None
    judged: bool = True
    target: float | None = None
    conditions: str = f"batches of {BATCH}, one thread"

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
        unjudged = "" if self.measured is None else f"asked at {self.conditions}"
        return (
            f"{self.quantity}: {self.what}",
            bound,
            measured,
            {True: "met", False: "MISSED", None: unjudged}[self.met],
        )

    def __repr__(self) -> str:
        what, required, measured, verdict = self.cells
        return repr_line("Requirement", said=", ".join(filter(None, (what, required, measured, verdict))))


@dataclass(frozen=True)
class BenchReport:
    """dhkit beside its peers, one robot, one process.

    Attributes
    ----------
    robot
        Its name.
    batch, threads, seed
        Items of a batch, threads a batch call may use, seed of the states.
    rows, missing
        The contenders' figures; who did not take part, and why.
    outcomes
        How the comparison of each quantity ended; an interrupted run has those that it finished.
    scaling, memory, starts
        Two threads against one, peak memory, time of a second process.
    machine
        Where it ran.
    interrupted
        Whether it was stopped before the end.
    derivations, operations
        How long equations take to derive, and how many operations they are.
    requirements
        Targets that the run was held against, beside what was measured; none unless asked for.
    """

    robot: str
    batch: int
    threads: int
    seed: int
    rows: tuple[Row, ...]
    missing: tuple[Missing, ...]
    outcomes: tuple[Outcome, ...]
    scaling: tuple[ThreadScaling, ...]
    memory: tuple[PeakMemory, ...]
    starts: tuple[FirstCall, ...]
    machine: Machine
    interrupted: bool = False
    derivations: tuple[Derivation, ...] = ()
    operations: tuple[Operations, ...] = ()
    requirements: tuple[Requirement, ...] = ()

    def json(self) -> dict[str, Any]:
        """Return everything as what JSON knows: no NaN, no tuples, no classes."""
        plain = asdict(self)
        for entry, row in zip(plain["rows"], self.rows, strict=True):
            verdict = entry.pop("verdict")
            entry |= verdict | {"mode": row.mode.value, "agrees": row.verdict.ok}
        for key in ("outcomes", "requirements", "scaling", "memory"):
            for entry, value in zip(plain[key], getattr(self, key), strict=True):
                entry |= value.derived
        listed: dict[str, Any] = listed_values(plain)
        return listed

    def markdown(self) -> str:
        """Return the report as Markdown."""
        return report_markdown(self._title, self.machine.facts, self._tables, RATIO_MEANING)

    def __str__(self) -> str:
        return report_text(self._title, self.machine.facts, self._tables, RATIO_MEANING)

    def __repr__(self) -> str:
        return repr_line("BenchReport", self.robot, f"{counted(len(self.rows), 'row')}, {standing(self.requirements)}")

    def _repr_html_(self) -> str:
        endings = {outcome.quantity: outcome.ending.value for outcome in self.outcomes}
        rows = [(quantity, *self._fastest(quantity), endings.get(quantity, "")) for quantity in self.quantities]
        headings = ("quantity", "dhkit, an item", "the fastest peer", "an item", "ended")
        return report_html(
            self._title, self.machine.facts, html_table(headings, rows, align="lrlrl"), self.requirements
        )

    @property
    def quantities(self) -> tuple[str, ...]:
        """The quantities that were timed."""
        return tuple(dict.fromkeys(row.quantity for row in self.rows))

    def _fastest(self, quantity: str) -> tuple[str, str, str]:
        """Return dhkit's least time, and who of the peers that agree has the least, with it."""
        rows = [row for row in self.rows if row.quantity == quantity]
        own = min((row.seconds for row in rows if row.own), default=None)
        peer = min((row for row in rows if not row.own and row.verdict.ok), key=lambda row: row.seconds, default=None)
        least = "–" if own is None else duration(own)
        return (least, "–", "–") if peer is None else (least, peer.contender, duration(peer.seconds))

    @property
    def _title(self) -> str:
        threads = "1 thread" if self.threads == 1 else f"{self.threads} threads"
        ending = " (interrupted)" if self.interrupted else ""
        return f"{self.robot}: dhkit beside its peers, batches of {self.batch}, {threads}{ending}"

    @property
    def _tables(self) -> list[Table]:
        """Headings, columns and cells of the tables that have something to show."""
        columns = ("contender", "called", "items", "time", "quartiles", "x batch", "x single", "solutions", "error")
        tables: list[Table] = [
            (quantity, columns, [_cells(row) for row in self.rows if row.quantity == quantity])
            for quantity in self.quantities
        ]
        tables += [
            ("Required", ("what", "required", "measured", ""), [list(line.cells) for line in self.requirements]),
            ("Two threads", ThreadScaling.COLUMNS, [list(line.cells) for line in self.scaling]),
            ("Peak memory", PeakMemory.COLUMNS, [list(line.cells) for line in self.memory]),
            ("A new process", FirstCall.COLUMNS, [list(line.cells) for line in self.starts]),
            ("Operations", Operations.COLUMNS, [list(line.cells) for line in self.operations]),
            ("Derivations", Derivation.COLUMNS, [list(line.cells) for line in self.derivations]),
            (
                "Did not take part",
                ("quantity", "who", "why"),
                [[gap.quantity, gap.name, gap.reason] for gap in self.missing],
            ),
        ]
        return [table for table in tables if table[2]]


def _cells(row: Row) -> list[str]:
    verdict = row.verdict
    return [
        row.contender,
        row.mode.value,
        str(row.items),
        duration(row.seconds),
        f"{duration(row.lower)} to {duration(row.upper)}",
        _ratio(row.times_batch),
        _ratio(row.times_single),
        "" if verdict.solutions is None else f"{verdict.solutions:.2f}",
        str(verdict),
    ]


def duration(seconds: float) -> str:
    """Return a time in the unit that suits it, three digits."""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def _ratio(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def report_text(title: str, facts: Iterable[str], tables: Iterable[Table], meaning: str) -> str:
    """Return a report as text: what ran where, its tables, and what their columns mean."""
    parts = [title, *(f"  {fact}" for fact in facts), ""]
    for heading, columns, cells in tables:
        parts += [heading, *text_table(columns, cells), ""]
    return "\n".join([*parts, meaning])


def report_markdown(title: str, facts: Iterable[str], tables: Iterable[Table], meaning: str) -> str:
    """Return the same as Markdown."""
    parts = [f"# {title}", *(f"- {fact}" for fact in facts), ""]
    for heading, columns, cells in tables:
        parts += [f"## {heading}", "", *markdown_table(columns, cells), ""]
    return "\n".join([*parts, meaning, ""])


def report_html(title: str, facts: Iterable[str], table: str, requirements: Sequence[Requirement] = ()) -> str:
    """Return a report for a notebook: its main table, which is HTML already, and what is required."""
    cells = [requirement.cells for requirement in requirements]
    required = html_table(("what", "required", "measured", ""), cells) if cells else ""
    return html_block(title, table, required, html_lines(list(facts)))


def standing(requirements: Sequence[Requirement]) -> str:
    """Return how many of what is required is met, of what could be judged."""
    judged = [requirement.met for requirement in requirements if requirement.met is not None]
    return f"{sum(judged)} of {counted(len(judged), 'requirement')} met"


def text_table(columns: Sequence[str], cells: Iterable[Sequence[str]]) -> list[str]:
    """Return a table's lines for a terminal."""
    lines = [list(columns), *map(list, cells)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    return [
        "  " + "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines
    ]


def markdown_table(columns: Sequence[str], cells: Iterable[Sequence[str]]) -> list[str]:
    """Return a table's lines in Markdown."""
    lines = [columns, ["---"] * len(columns), *cells]
    return ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]


def listed_values(value: Any) -> Any:
    """Return plain data with tuples as lists, as JSON has them."""
    if isinstance(value, dict):
        return {key: listed_values(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [listed_values(entry) for entry in value]
    return value
