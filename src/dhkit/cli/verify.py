"""`dhkit verify` and `dhkit check`: mechanics against Pinocchio's, a URDF against a table, a program against an arm."""

from __future__ import annotations

import json as jsons
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.extract import chain_words
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
) -> int:
    """Verify, print the report and perhaps write it; return 0, or 1 where something disagrees.

    Raises
    ------
    DescriptionError
        An output file of another kind.
    """
    if output is not None and output.suffix not in (".md", ".tex", ".json"):
        raise DescriptionError(f"{output}: expected a report that ends in .md, .tex or .json")
    if urdf is None:
        report = arm.verify(samples, seed)
    else:
        path, base, tip = chain_words(urdf, base, tip)
        report = verify_urdf(arm.description, path, tip, samples, seed, tolerance, base=base)
    if output is not None:
        write_atomically(output, _text(report, output.suffix))
    if json:
        print_json(report.json())
    else:
        say(str(report))
        if output is not None:
            say(f"wrote {output}")
    return 0 if report.ok else 1


def _text(report: VerificationReport, suffix: str) -> str:
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
