"""What `dhkit verify` prints and writes: our own mechanics against Pinocchio's, or a URDF against a table."""

from __future__ import annotations

import json as jsons
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.extract import chain_words
from dhkit.cli.output import finite, print_json, say
from dhkit.description import write_atomically
from dhkit.errors import DescriptionError
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
