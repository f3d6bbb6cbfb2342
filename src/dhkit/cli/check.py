"""`dhkit check`: score a file's fk, ik and controller against an arm."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.output import print_json
from dhkit.programs import CheckRubric, Limits, Program, ProgramError, check, protect_from_children


def run(
    arm: Arm,
    source: Path | Sequence[str],
    rubric: Path | None = None,
    seed: int | None = None,
    samples: int = 200,
    sandbox: str | None = None,
    seconds: float = 5.0,
    json: bool = False,
) -> int:
    """Check a program and print its score.

    Returns
    -------
    int
        0 for full marks, 1 for fewer, 2 where it cannot be loaded.
    """
    protect_from_children()
    points = None if rubric is None else CheckRubric.read(rubric)
    with Program(source, Limits(seconds=seconds), sandbox) as program:
        try:
            report = check(arm, program, points, seed, samples)
        except ProgramError as error:
            printed = program.output.strip()
            if json:
                print_json({"error": str(error), "line": error.line, "output": printed[-2000:]})
            else:
                said = str(error) if str(error).startswith(f"{source}") else f"{program.name}: {error}"
                sys.stderr.write(f"dhkit: {said}{os.linesep}")
            return 2
    if json:
        print_json(report.to_dict(), indent=2)
    else:
        sys.stdout.write(f"{report}\n")
    return 0 if report.full else 1
