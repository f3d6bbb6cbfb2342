"""The report of a benchmark, for people (text, Markdown, HTML) and for machines (JSON)."""

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
from dhkit.symbolic.equations.latex_document import escaped

BATCH = 100_000
"""Items of the batch that requirements are about."""

Table: TypeAlias = tuple[str, Sequence[str], list[list[str]]]
"""Heading, names of the columns, and cells of a table."""
_RATIO_MEANING = (
    "x batch and x single: how many times as long as dhkit's batch call with out=, and as its single call; "
    "medians over the rounds. Error: largest difference from dhkit's answers (of dynamics over their "
    "largest); a solution is one that closes to 1e-9."
)


@dataclass(frozen=True)
class Row:
    """The timings of one contender.

    Attributes
    ----------
    quantity, contender, mode
        Quantity, name of the contender, and how it was called.
    own
        Whether the contender is dhkit itself.
    items, rounds
        Items of a batch call, or of a loop of single calls; number of rounds.
    seconds, lower, upper
        Median and quartiles over the rounds, s for each item.
    verdict
        Agreement of the answers with dhkit's.
    times_batch, times_single
        The time over that of dhkit's batch call with ``out=``, and over that of dhkit's single call; None if dhkit was
        not measured.
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
        timing = f"{self.mode.value}, {duration(self.seconds)} an item"
        return repr_line("Row", f"{self.quantity} by {self.contender}", timing)


@dataclass(frozen=True)
class Missing:
    """A contender or a probe that did not take part.

    Attributes
    ----------
    quantity, name, reason
        Quantity, name of the contender or the probe, and why there are no timings.
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
    """Result of the comparison of a quantity; the value is the text in reports."""

    COMPLETE = "every contender that took part agrees"
    PEERS_FAILED = "peers failed"
    OWN_FAILED = "dhkit itself failed"
    OWN_MISSING = "dhkit itself could not be timed"
    ALL_FAILED = "every contender failed"
    NOTHING_TIMED = "nothing could be timed"


@dataclass(frozen=True)
class Outcome:
    """Result of the comparison of a quantity, with its causes.

    Attributes
    ----------
    quantity
        The quantity.
    ending
        Result of the comparison.
    causes
        The contenders that caused it, each with its reason; none if all contenders agree.
    """

    quantity: str
    ending: Ending
    causes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether dhkit was timed and agrees, with or without failures of peers."""
        return self.ending in (Ending.COMPLETE, Ending.PEERS_FAILED)

    @property
    def derived(self) -> dict[str, object]:
        """Entries in JSON besides the quantity and the causes."""
        return {"ending": self.ending.name.lower(), "ok": self.ok}

    def __str__(self) -> str:
        more = f" (and {len(self.causes) - 1} more)" if len(self.causes) > 1 else ""
        cause = f"; {self.causes[0]}{more}" if self.causes else ""
        return f"{self.quantity}: {self.ending.value}{cause}"

    def __repr__(self) -> str:
        return repr_line("Outcome", summary=str(self))


@dataclass(frozen=True)
class Requirement:
    """A number that dhkit must reach.

    Attributes
    ----------
    quantity, what
        The quantity, and the property that is compared.
    required, target
        The required number, and a better one that is aimed at.
    at_most
        Whether ``required`` is an upper bound, rather than a lower one.
    measured
        The measured number; None if a contender did not take part.
    judged
        Whether it was measured under the conditions of the requirement.
    conditions
        Description of these conditions.
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
        """Whether the requirement is met; None if that cannot be judged."""
        if self.measured is None or not self.judged:
            return None
        return self.measured <= self.required if self.at_most else self.measured >= self.required

    @property
    def derived(self) -> dict[str, object]:
        """Entries in JSON besides the fields."""
        return {"met": self.met}

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Cells of a row: compared property, required number, measured number, verdict."""
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
        return repr_line(
            "Requirement", summary=", ".join(filter(None, (what, required, measured, verdict)))
        )


class Report:
    """Base of the reports of benchmarks: a title and tables, printed as text, Markdown, HTML and JSON.

    A report is a dataclass with the machine, and perhaps with requirements; it gives its title, its tables and the
    meaning of their columns.
    """

    machine: Machine

    @property
    def title(self) -> str:
        """The measured subject, in a line."""
        raise NotImplementedError

    @property
    def meaning(self) -> str:
        """Meaning of the columns."""
        raise NotImplementedError

    @property
    def tables(self) -> list[Table]:
        """The tables; those without rows are not shown."""
        raise NotImplementedError

    @property
    def main_table(self) -> str:
        """The table that a notebook shows, as HTML."""
        raise NotImplementedError

    @property
    def _shown(self) -> list[Table]:
        return [table for table in self.tables if table[2]]

    def json(self) -> dict[str, object]:
        """Return the report as plain data for JSON, without tuples and classes."""
        plain = asdict(self)  # type: ignore[call-overload]
        for key, listed in vars(self).items():
            if isinstance(listed, tuple):
                for entry, value in zip(plain[key], listed, strict=True):
                    if hasattr(value, "derived"):
                        entry |= value.derived
        data: dict[str, object] = _with_lists(plain)
        return data

    def markdown(self) -> str:
        """Return the report as Markdown."""
        parts = [f"# {self.title}", *(f"- {fact}" for fact in self.machine.facts), ""]
        for heading, columns, cells in self._shown:
            parts += [f"## {heading}", "", *_markdown_table(columns, cells), ""]
        return "\n".join([*parts, self.meaning, ""])

    def latex(self) -> str:
        """Return the tables as LaTeX for a document that uses booktabs; the machine's facts are comments."""
        lines = [f"% {self.title}", *(f"% {fact}" for fact in self.machine.facts)]
        for heading, columns, cells in self._shown:
            lines += ["", f"% {heading}", *_latex_table(columns, cells)]
        return "\n".join([*lines, "", f"% {self.meaning}", ""])

    def __str__(self) -> str:
        parts = [self.title, *(f"  {fact}" for fact in self.machine.facts), ""]
        for heading, columns, cells in self._shown:
            parts += [heading, *_text_table(columns, cells), ""]
        return "\n".join([*parts, self.meaning])

    def _repr_html_(self) -> str:
        requirements: Sequence[Requirement] = getattr(self, "requirements", ())
        cells = [requirement.cells for requirement in requirements]
        required = html_table(("what", "required", "measured", ""), cells) if cells else ""
        return html_block(
            self.title, self.main_table, required, html_lines(list(self.machine.facts))
        )


@dataclass(frozen=True)
class BenchReport(Report):
    """Timings of dhkit beside its peers, for one robot in one process.

    Attributes
    ----------
    robot
        Name of the robot.
    batch, threads, seed
        Items of a batch, threads that a batch call may use, seed of the states.
    rows, missing
        Timings of the contenders; contenders that did not take part.
    outcomes
        How the comparison of each quantity ended; an interrupted run has those that it finished.
    scaling, memory, starts
        Two threads against one, peak memory, first call of a new process.
    machine
        The machine that the benchmark ran on.
    interrupted
        Whether the run was stopped before its end.
    derivations, operations
        Times of deriving equations, and numbers of their operations.
    requirements
        Requirements beside the measured numbers; by default none.
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

    @property
    def meaning(self) -> str:
        """Meaning of the columns."""
        return _RATIO_MEANING

    def json(self) -> dict[str, object]:
        """Return the report as plain data for JSON, without NaN, tuples and classes."""
        data = super().json()
        for entry, row in zip(data["rows"], self.rows, strict=True):  # type: ignore[call-overload]
            verdict = entry.pop("verdict")
            entry |= verdict | {"mode": row.mode.value, "agrees": row.verdict.ok}
        return data

    def __repr__(self) -> str:
        return repr_line(
            "BenchReport",
            self.robot,
            f"{counted(len(self.rows), 'row')}, {requirements_text(self.requirements)}",
        )

    @property
    def main_table(self) -> str:
        """The fastest peer of each quantity, as HTML."""
        endings = {outcome.quantity: outcome.ending.value for outcome in self.outcomes}
        rows = [
            (quantity, *self._fastest(quantity), endings.get(quantity, ""))
            for quantity in self.quantities
        ]
        return html_table(
            ("quantity", "dhkit, an item", "the fastest peer", "an item", "ended"),
            rows,
            align="lrlrl",
        )

    @property
    def quantities(self) -> tuple[str, ...]:
        """The quantities that were timed, in their order."""
        return tuple(dict.fromkeys(row.quantity for row in self.rows))

    def _fastest(self, quantity: str) -> tuple[str, str, str]:
        """Return dhkit's shortest time, and the fastest of the peers that agree with its time, as text."""
        rows = [row for row in self.rows if row.quantity == quantity]
        own = min((row.seconds for row in rows if row.own), default=None)
        peer = min(
            (row for row in rows if not row.own and row.verdict.ok),
            key=lambda row: row.seconds,
            default=None,
        )
        own_text = "–" if own is None else duration(own)
        return (
            (own_text, "–", "–")
            if peer is None
            else (own_text, peer.contender, duration(peer.seconds))
        )

    @property
    def title(self) -> str:
        """The measured subject, in a line."""
        threads = "1 thread" if self.threads == 1 else f"{self.threads} threads"
        ending = " (interrupted)" if self.interrupted else ""
        return f"{self.robot}: dhkit beside its peers, batches of {self.batch}, {threads}{ending}"

    @property
    def tables(self) -> list[Table]:
        """Timings by quantity, requirements, and results of the probes."""
        columns = (
            "contender",
            "called",
            "items",
            "time",
            "quartiles",
            "x batch",
            "x single",
            "solutions",
            "error",
        )
        tables: list[Table] = []
        for quantity in self.quantities:
            timings = [_cells(row) for row in self.rows if row.quantity == quantity]
            tables.append((quantity, columns, timings))
        others = (
            ("Required", ("what", "required", "measured", ""), self.requirements),
            ("Two threads", ThreadScaling.COLUMNS, self.scaling),
            ("Peak memory", PeakMemory.COLUMNS, self.memory),
            ("A new process", FirstCall.COLUMNS, self.starts),
            ("Operations", Operations.COLUMNS, self.operations),
            ("Derivations", Derivation.COLUMNS, self.derivations),
        )
        for heading, other_columns, rows in others:
            cells = [list(row.cells) for row in rows]
            tables.append((heading, other_columns, cells))
        gaps = [[gap.quantity, gap.name, gap.reason] for gap in self.missing]
        return [*tables, ("Did not take part", ("quantity", "who", "why"), gaps)]


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
    """Return a time, s, as text with three digits in a suitable unit."""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def _ratio(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def requirements_text(requirements: Sequence[Requirement]) -> str:
    """Return the number of requirements that are met, of those that could be judged, as text."""
    judged = [requirement.met for requirement in requirements if requirement.met is not None]
    return f"{sum(judged)} of {counted(len(judged), 'requirement')} met"


def _text_table(columns: Sequence[str], cells: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table for a terminal."""
    lines = [list(columns), *map(list, cells)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    aligned = []
    for line in lines:
        padded = [cell.ljust(width) for cell, width in zip(line, widths, strict=True)]
        aligned.append(f"  {'  '.join(padded)}".rstrip())
    return aligned


def _markdown_table(columns: Sequence[str], cells: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    lines = [columns, ["---"] * len(columns), *cells]
    written = []
    for line in lines:
        escaped = [cell.replace("|", "\\|") for cell in line]
        written.append(f"| {' | '.join(escaped)} |")
    return written


def _latex_table(columns: Sequence[str], cells: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table in LaTeX."""
    rows = [" & ".join(map(_latex_cell, line)) + r" \\" for line in cells]
    return [
        rf"\begin{{tabular}}{{{'l' * len(columns)}}}",
        r"\toprule",
        " & ".join(map(_latex_cell, columns)) + r" \\",
        r"\midrule",
        *rows,
        r"\bottomrule",
        r"\end{tabular}",
    ]


def _latex_cell(text: str) -> str:
    """Return a cell for LaTeX; the micro sign of times is a command there."""
    return r"\textmu{}".join(map(escaped, text.split("µ")))


def _with_lists(value: Any) -> Any:
    """Return plain data with lists instead of tuples, as JSON reads it back."""
    if isinstance(value, dict):
        return {key: _with_lists(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_with_lists(entry) for entry in value]
    return value
