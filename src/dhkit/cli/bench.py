"""`dhkit bench`: times of kinematics and dynamics beside peers, with progress on stderr."""

from __future__ import annotations

import json as json_format
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from dhkit.arm import Arm
from dhkit.bench import QUANTITIES, BenchReport, Ending, Requirement, run as run_bench
from dhkit.bench.benchmark_report import Report
from dhkit.bench.problems import files_in, run_problems
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import Json, Seed, read_arm
from dhkit.cli.output import print_json, say
from dhkit.cli.streams import styled, visible
from dhkit.description import write_atomically
from dhkit.description.files import check_place

app = typer.Typer(rich_markup_mode=None)

_ERASE_LINE = "\r\x1b[K"
"""Terminals' control sequence: to the beginning of the line, and erase it."""


@app.command()
def bench(
    quantities: Annotated[
        list[str] | None, typer.Argument(help="Quantities to time; default: all.")
    ] = None,
    robot: Annotated[str, typer.Option(help="A library name or a robot file.")] = "puma560",
    batch: Annotated[
        int, typer.Option(min=1, max=10_000_000, help="Configurations or poses in a batch.")
    ] = 100_000,
    threads: Annotated[
        int, typer.Option(min=1, max=1024, help="Number of threads that batch calls may use.")
    ] = 1,
    repeats: Annotated[
        int, typer.Option(min=1, max=1000, help="Number of interleaved rounds.")
    ] = 9,
    seed: Seed = 0,
    probes: Annotated[
        bool, typer.Option(help="Measure thread scaling, memory and first calls too.")
    ] = True,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="NAME",
            help="Write NAME.md and NAME.json as well; of NAME.tex also a table in LaTeX.",
        ),
    ] = None,
    problems: Annotated[
        Path | None,
        typer.Option(
            help="Score inverse kinematics and motions on these problems instead: a folder or a file (.json)."
        ),
    ] = None,
    json: Json = False,
) -> ExitStatus:
    """Time our kinematics and dynamics beside every installed peer: median, spread and ratios.

    Exit status 1: dhkit itself, or every contender of a quantity, disagreed, failed or could not be timed.

    Quantities: fk, ik, jacobian, inverse_dynamics, mass_matrix, forward_dynamics.
    """
    if problems is not None:
        return run_on_problems(problems, output, json=json)
    return run(
        read_arm(robot),
        quantities or QUANTITIES,
        batch=batch,
        threads=threads,
        repeats=repeats,
        seed=seed,
        probes=probes,
        output=output,
        json=json,
    )


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
) -> ExitStatus:
    """Run the benchmark, print its report, judged by ``targets``, and name the quantities that failed on stderr.

    The status is NO if dhkit itself, or every contender of a quantity, disagreed, failed or could not be timed;
    INTERRUPTED if Ctrl-C ended the run early. Peers that fail beside dhkit are noted.
    """
    _check_places(output)
    progress = _Progress()
    report = run_bench(
        arm,
        quantities,
        batch=batch,
        threads=threads,
        repeats=repeats,
        seed=seed,
        progress=progress.show,
        probes=probes,
        targets=targets,
    )
    progress.clear()
    _deliver(report, output, json=json)
    for outcome in report.outcomes:
        if outcome.ending is not Ending.COMPLETE:
            note = "note: " if outcome.ok else ""  # peers failed, and dhkit did not
            sys.stderr.write(f"dhkit: {note}{outcome}\n")
    if report.interrupted:
        return ExitStatus.INTERRUPTED
    return ExitStatus.FINE if all(outcome.ok for outcome in report.outcomes) else ExitStatus.NO


def run_on_problems(path: Path, output: Path | None, *, json: bool) -> ExitStatus:
    """Score every solver on problems, and print the report; the status is NO if dhkit misses or invents an answer."""
    files = files_in(path)
    _check_places(output)
    progress = _Progress()
    report = run_problems(files, progress.show)
    progress.clear()
    _deliver(report, output, json=json)
    are_right = all(row.is_right for row in report.rows if row.own)
    are_right = are_right and all(row.is_right for row in report.motions)
    return ExitStatus.FINE if are_right else ExitStatus.NO


def _check_places(output: Path | None) -> None:
    """Refuse an output that cannot be written, before anything is measured."""
    for file in _files(output) if output is not None else ():
        check_place(file)


def _deliver(report: Report, output: Path | None, *, json: bool) -> None:
    """Print a report, and write it if there is an output."""
    if output is not None:
        for file in write(report, output):
            sys.stderr.write(f"dhkit: wrote {file}\n")
    if json:
        print_json(report.json())
    else:
        say(str(report))


def write(report: Report, path: Path) -> tuple[Path, ...]:
    """Write a report as Markdown and as JSON, and as LaTeX for a path that ends in ``.tex``; return the files."""
    files = _files(path)
    for file in files:
        match file.suffix.lower():
            case ".md":
                text = report.markdown()
            case ".json":
                text = _as_json(report)
            case _:
                text = report.latex()
        write_atomically(file, text)
    return files


def _as_json(report: Report) -> str:
    return json_format.dumps(report.json(), ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def _files(path: Path) -> tuple[Path, ...]:
    """Return the Markdown, the JSON and, for a path that ends in ``.tex``, the LaTeX file of a report."""
    latex = (path,) if path.suffix.lower() == ".tex" else ()
    return path.with_suffix(".md"), path.with_suffix(".json"), *latex


class _Progress:
    """Progress on stderr: one line that is overwritten in a terminal; a line for each step elsewhere."""

    def __init__(self) -> None:
        self.terminal = sys.stderr.isatty()

    def show(self, line: str) -> None:
        """Show the present step."""
        line = visible(line)
        styled(sys.stderr).write(f"{_ERASE_LINE}{line}" if self.terminal else f"{line}\n")
        sys.stderr.flush()

    def clear(self) -> None:
        """Clear the terminal's line."""
        if self.terminal:
            styled(sys.stderr).write(_ERASE_LINE)
