"""`dhkit verify` and `dhkit check`: mechanics against Pinocchio's, a URDF against a table, a program against an arm."""

from __future__ import annotations

import json as jsons
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.extract import chain_of
from dhkit.cli.output import finite, print_json, say
from dhkit.description import write_atomically
from dhkit.errors import DescriptionError
from dhkit.programs import CheckRubric, Limits, Program, ProgramError, check, protect_from_children
from dhkit.verification import VerificationReport, verify_urdf


def run(
    arm: Arm,
    samples: int,
    seed: int,
    *,
    urdf: str | None,
    base: str | None,
    tip: str | None,
    tolerance: float,
    output: Path | None,
    json: bool,
) -> ExitStatus:
    """Verify, print the report and perhaps write it; the status is NO if something disagrees.

    Raises
    ------
    DescriptionError
        The output has another suffix.
    """
    if output is not None and output.suffix not in (".md", ".tex", ".json"):
        raise DescriptionError(f"{output}: expected a report that ends in .md, .tex or .json")
    if urdf is None:
        report = arm.verify(samples, seed)
    else:
        path, base, tip = chain_of(urdf, base, tip)
        report = verify_urdf(arm.description, path, tip, samples, seed, tolerance, base=base)
    if output is not None:
        write_atomically(output, _report_text(report, output.suffix))
    if json:
        print_json(report.json())
    else:
        say(str(report))
        if output is not None:
            say(f"wrote {output}")
    return ExitStatus.FINE if report.ok else ExitStatus.NO


def _report_text(report: VerificationReport, suffix: str) -> str:
    if suffix == ".json":
        return jsons.dumps(finite(report.json()), indent=2) + "\n"
    return report.markdown() if suffix == ".md" else report.latex()


def check_program(
    arm: Arm,
    source: Path | Sequence[str],
    rubric: Path | None = None,
    seed: int | None = None,
    samples: int = 200,
    sandbox: str | None = None,
    seconds: float = 5.0,
    json: bool = False,
) -> ExitStatus:
    """Check a program and print its score; the status is NO below full marks, UNUSABLE if it cannot be loaded."""
    protect_from_children()
    points = None if rubric is None else CheckRubric.read(rubric)
    with Program(source, Limits(seconds=seconds), sandbox) as program:
        try:
            report = check(arm, program, points, seed, samples)
        except ProgramError as error:
            output = program.output.strip()
            if json:
                print_json({"error": str(error), "line": error.line, "output": output[-2000:]})
            else:
                line = str(error) if str(error).startswith(f"{source}") else f"{program.name}: {error}"
                sys.stderr.write(f"dhkit: {line}{os.linesep}")
            return ExitStatus.UNUSABLE
    if json:
        print_json(report.to_dict(), indent=2)
    else:
        sys.stdout.write(f"{report}\n")
    return ExitStatus.FINE if report.full else ExitStatus.NO
