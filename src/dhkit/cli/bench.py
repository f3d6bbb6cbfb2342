"""`dhkit bench`: kinematics and dynamics beside its peers, with progress on stderr."""

from __future__ import annotations

import json as json_format
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from dhkit.arm import Arm
from dhkit.bench import BenchReport, Ending, Requirement
from dhkit.bench import run as run_bench
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.output import print_json, say
from dhkit.description import write_atomically
from dhkit.description.files import check_place


def run(
    arm: Arm,
    quantities: Sequence[str],
    *,
    batch: int,
    threads: int,
    repeats: int,
    seed: int,
    probes: bool,
    output: Path | None,
    json: bool,
    targets: Callable[[BenchReport], tuple[Requirement, ...]] | None = None,
) -> int:
    """Run the benchmark, print its report, and say on stderr which quantities failed.

    Returns 0; 1 where dhkit itself, or every contender of a quantity, failed or could not be timed; 130 where Ctrl-C
    ended the run early. Peers that fail beside dhkit are noted.
    """
    if output is not None:
        check_place(output)
    progress = _Progress()
    report = run_bench(arm, quantities, batch, threads, repeats, seed, progress.show, probes=probes, targets=targets)
    progress.clear()
    for path in write(report, output) if output else ():
        sys.stderr.write(f"dhkit: wrote {path}\n")
    if json:
        print_json(report.json())
    else:
        say(str(report))
    for outcome in report.outcomes:
        if outcome.ending is not Ending.COMPLETE:
            sys.stderr.write(f"dhkit: {'note: ' if outcome.ok else ''}{outcome}\n")
    if report.interrupted:
        return ExitStatus.INTERRUPTED
    return 0 if all(outcome.ok for outcome in report.outcomes) else 1


class Report(Protocol):
    """A report that can be written: of quantities, motions or simulations."""

    def markdown(self) -> str:
        """Return the report as Markdown."""

    def json(self) -> dict[str, object]:
        """Return the report as plain data."""


def write(report: Report, path: Path) -> tuple[Path, Path]:
    """Write a report as Markdown and as JSON, whatever the path's ending; return the two files."""
    files = path.with_suffix(".md"), path.with_suffix(".json")
    write_atomically(files[0], report.markdown())
    write_atomically(files[1], json_format.dumps(report.json(), ensure_ascii=False, allow_nan=False, indent=1) + "\n")
    return files


class _Progress:
    """One line on stderr that is written over in a terminal; a line a step elsewhere."""

    def __init__(self) -> None:
        self.terminal = sys.stderr.isatty()

    def show(self, line: str) -> None:
        """Show what is being done."""
        sys.stderr.write(f"\r\x1b[K{line}" if self.terminal else f"{line}\n")
        sys.stderr.flush()

    def clear(self) -> None:
        """Leave the terminal's line empty."""
        if self.terminal:
            sys.stderr.write("\r\x1b[K")
