"""What the commands of all benchmarks do: a line for each step, and the report as files and text."""

from __future__ import annotations

import sys
from pathlib import Path

from dhkit.bench.benchmark_report import Report
from dhkit.cli.bench import write


def tell(line: str) -> None:
    """Write a line about the progress."""
    print(line, file=sys.stderr, flush=True)


def publish(report: Report, path: Path) -> None:
    """Write a report as Markdown and as JSON, and print it; ``path`` is that of the files, without ending."""
    for written in write(report, path):
        tell(f"wrote {written}")
    print(report)
