"""`dhkit verify` and `dhkit check`: mechanics against Pinocchio's, a URDF against a table, a program against an arm."""

from __future__ import annotations

import json as jsons
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from dhkit.cli.check_class import check_folder
from dhkit.cli.endings import end_in_order_on_signals
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.extract import chain_of
from dhkit.cli.isolating import Isolated, isolation_for
from dhkit.cli.options import Json, Robot, Seed, Uniform, load_arm, read_arm
from dhkit.cli.output import finite, print_json, say
from dhkit.description import write_atomically
from dhkit.errors import DescriptionError
from dhkit.grading.archives import is_archive
from dhkit.grading.exports import ExportKind, Keep
from dhkit.programs import (
    CheckRubric,
    Limits,
    Program,
    ProgramError,
    check as score,
    protect_from_children,
)
from dhkit.verification import VerificationReport, verify_urdf

app = typer.Typer(rich_markup_mode=None)


@app.command()
def verify(
    robot: Robot,
    samples: Annotated[
        int, typer.Option(min=1, max=1_000_000, help="Number of random states.")
    ] = 1000,
    seed: Seed = 0,
    urdf: Annotated[
        str | None, typer.Option(help="A URDF to compare with the robot's table.")
    ] = None,
    base: Annotated[
        str | None, typer.Option(help="Link of that URDF that is the world; default: the root.")
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option(
            help="Link of that URDF that is the tool; default: the end of the only chain."
        ),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Largest error that counts as agreement, with --urdf.")
    ] = 1e-9,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write a report: .md, .tex or .json.")
    ] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> ExitStatus:
    """Compare dhkit's kinematics and dynamics with Pinocchio's; exit status 1 where they disagree.

    With --urdf compare a URDF of another source with the table: tool, mass matrix and torques at equal joint values.
    """
    if output is not None and output.suffix not in (".md", ".tex", ".json"):
        raise DescriptionError(f"{output}: expected a report that ends in .md, .tex or .json")
    arm = load_arm(robot, uniform)
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


@app.command()
def check(
    robot: Robot,
    program: Annotated[
        list[str],
        typer.Argument(
            help="A file (.py, .m) that defines fk, ik or controller, or a class's folder or archive of them; "
            "with --run a program, its arguments."
        ),
    ],
    run: Annotated[
        bool,
        typer.Option(
            "--run", help="Execute PROGRAM, which speaks the protocol of docs/own-code.md."
        ),
    ] = False,
    rubric: Annotated[
        Path | None, typer.Option(help="Rubric: points of the parts (.toml).")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the random states, to repeat a report.")
    ] = None,
    samples: Annotated[
        int, typer.Option(min=1, max=100_000, help="Number of random states.")
    ] = 200,
    seconds: Annotated[
        float,
        typer.Option(
            min=0.01, max=3600, help="Processor time of a call, s; four times as long on the clock."
        ),
    ] = 5.0,
    isolated: Isolated = False,
    export: Annotated[
        ExportKind | None,
        typer.Option(help="Layout of a class's folder; default: recognized by its names."),
    ] = None,
    keep: Annotated[
        Keep | None,
        typer.Option(
            help="Which of a student's programs counts; default: the last where the export tells their order."
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Number of a class's programs that run at a time."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder for a class: marks.csv, class.html, records."),
    ] = None,
    json: Json = False,
) -> ExitStatus:
    """Score a program's forward and inverse kinematics and its controller, and say where it fails first.

    The programs of a class are always isolated. Exit status 0: full marks; 1: fewer; 2: it cannot be loaded.
    """
    if not run and len(program) != 1:
        raise DescriptionError(
            f"{len(program)} files; expected one, or --run with a program and its arguments"
        )
    arm = read_arm(robot)
    source = program if run else Path(program[0])
    protect_from_children()
    end_in_order_on_signals()
    first = Path(program[0])
    if not run and first.exists() and (first.is_dir() or is_archive(first)):
        return check_folder(
            arm,
            first,
            rubric,
            seed=seed,
            samples=samples,
            seconds=seconds,
            export=export,
            keep=keep or Keep.LAST,
            jobs=jobs,
            output=output,
            json=json,
        )
    if export is not None or keep is not None or output is not None:
        raise DescriptionError(
            "--export, --keep and --output are for the programs of a class, a folder"
        )
    points = None if rubric is None else CheckRubric.read(rubric)
    place = isolation_for(Path(program[0]).name, isolated, [] if rubric is None else [rubric])
    with Program(source, Limits(seconds=seconds), place) as loaded:
        try:
            report = score(arm, loaded, points, seed, samples)
        except ProgramError as error:
            printed = loaded.output.strip()
            if json:
                print_json({"error": str(error), "line": error.line, "output": printed[-2000:]})
            else:
                line = (
                    str(error) if str(error).startswith(f"{source}") else f"{loaded.name}: {error}"
                )
                sys.stderr.write(f"dhkit: {line}{os.linesep}")
            return ExitStatus.UNUSABLE
    if json:
        print_json(report.to_dict(), indent=2)
    else:
        sys.stdout.write(f"{report}\n")
    return ExitStatus.FINE if report.full else ExitStatus.NO
