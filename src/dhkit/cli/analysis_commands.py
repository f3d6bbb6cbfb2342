"""Commands that show, check and measure: lab, view, verify, extract, workspace, equations, grade, check, bench."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from dhkit.arm import Arm
from dhkit.cli.options import Json, Robot, Uniform, load_arm
from dhkit.cli.output import print_json
from dhkit.errors import DescriptionError

app = typer.Typer()


@app.command()
def lab(
    robot: Annotated[str, typer.Argument(help="A library name, a robot file or an assignment (.toml).")],
    port: Annotated[int | None, typer.Option(min=1024, max=65535, help="Keep this address, token included.")] = None,
    mine: Annotated[Path | None, typer.Option(help="Your file (.py, .m) with fk, ik or controller.")] = None,
    run: Annotated[
        str | None, typer.Option(help="Your program in place of a file; ARGUMENTS follow the robot.")
    ] = None,
    arguments: Annotated[list[str] | None, typer.Argument(help="Of the program of --run.")] = None,
    sandbox: Annotated[str | None, typer.Option(help="bwrap: your program in bubblewrap.")] = None,
    solid: Annotated[Path | None, typer.Option(help="An STL file for the panel of transforms.")] = None,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
) -> int:
    """Open an arm in the browser: move, drive, edit, plan and control it; Ctrl-C ends it."""
    from dhkit.cli import browser

    if mine is not None and run is not None:
        raise DescriptionError("--mine and --run; expected one of them")
    if arguments and run is None:
        raise DescriptionError(f"{arguments[0]!r} behind the robot; expected --run PROGRAM for arguments")
    own = mine if run is None else [run, *(arguments or [])]
    return browser.run_lab(robot, port, open_browser=not no_browser, own=own, sandbox=sandbox, solid=solid)


@app.command()
def view(
    robot: Robot,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
    html: Annotated[Path | None, typer.Option(help="Write a page in place of it.")] = None,
) -> int:
    """Show an arm in the browser, to look at; Ctrl-C ends it."""
    from dhkit.cli import browser

    return browser.run_view(Arm.load(robot), html, open_browser=not no_browser)


@app.command()
def verify(
    robot: Robot,
    samples: Annotated[int, typer.Option(min=1, max=1_000_000, help="How many random states.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Of the random states.")] = 0,
    urdf: Annotated[str | None, typer.Option(help="Somebody's URDF to hold against the robot's table.")] = None,
    base: Annotated[str | None, typer.Option(help="Its link that is the world; the root.")] = None,
    tip: Annotated[str | None, typer.Option(help="Its link that is the tool; the end of the only chain.")] = None,
    tolerance: Annotated[float, typer.Option(help="The largest error that agrees, with --urdf.")] = 1e-9,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write a report: .md, .tex or .json.")] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> int:
    """Hold our kinematics and dynamics against Pinocchio's; exit status 1 where they disagree.

    With --urdf hold somebody's URDF against the table: tool, mass matrix and torques at equal joint values.
    """
    from dhkit.cli import verify as verify_command

    return verify_command.run(
        load_arm(robot, uniform),
        samples,
        seed,
        urdf=urdf,
        base=base,
        tip=tip,
        tolerance=tolerance,
        output=output,
        json=json,
    )


@app.command()
def extract(
    urdf: Annotated[str, typer.Argument(metavar="FILE", help="A URDF, or example:NAME of example-robot-data.")],
    base: Annotated[str | None, typer.Option(help="The chain's first link, which becomes the world; the root.")] = None,
    tip: Annotated[str | None, typer.Option(help="Its last link; may be left out where there is one chain.")] = None,
    modified: Annotated[bool, typer.Option("--modified", help="Craig's table instead of the standard one.")] = False,
    as_designed: Annotated[
        bool, typer.Option("--as-designed", help="Read 1.5708 as a right angle, and say what that changes.")
    ] = False,
    drop: Annotated[
        bool, typer.Option("--drop-side", help="Leave out links behind joints beside the chain; else they are frozen.")
    ] = False,
    package_dir: Annotated[
        list[Path] | None, typer.Option(help="Folder with packages that package:// names; may be given again.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The robot file to write (.toml).")] = None,
    json: Json = False,
) -> int:
    """Find the Denavit-Hartenberg table of a URDF's chain, with its bodies, limits and meshes.

    Prints how far the table is from the file; exit status 1 where that is more than 1e-9.
    """
    from dhkit.cli import extract as extract_command

    return extract_command.run(
        urdf,
        base=base,
        tip=tip,
        modified=modified,
        as_designed=as_designed,
        drop=drop,
        package_dirs=package_dir or (),
        output=output,
        json=json,
    )


@app.command()
def workspace(
    robot: Robot,
    samples: Annotated[int, typer.Option(min=1, max=10_000_000, help="How many random states.")] = 100_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the random states.")] = 0,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder to write; out/NAME.")] = None,
    json: Json = False,
) -> None:
    """Show where a robot's tool can be and how well it moves there, in numbers, a figure and a page."""
    from dhkit.cli import workspace as workspace_command

    workspace_command.run(Arm.load(robot), samples, seed, output, json=json)


@app.command()
def equations(
    robot: Robot,
    what: Annotated[str, typer.Option(help="Any of M, C, h, g, tau, K, V; or of A (A1 ... An), T, J.")] = "M,C,g",
    form: Annotated[str, typer.Option("--format", help="text, latex, python, c, matlab or html.")] = "text",
    symbols: Annotated[
        str, typer.Option(help="none: numbers; file: the file's parameters; inertial: every inertial parameter.")
    ] = "file",
    base: Annotated[
        bool, typer.Option("--base-parameters", help="The fewest inertial parameters, and what they stand for.")
    ] = False,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write; a folder for matlab.")] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> None:
    """Print a robot's equations of motion, exactly: M(q) qdd + C(q, qd) qd + g(q) = tau."""
    from dhkit.cli import equations as equations_command

    equations_command.run(
        load_arm(robot, uniform), what=what, form=form, symbols=symbols, base=base, output=output, json=json
    )


@app.command()
def grade(
    sheets: Annotated[
        list[Path] | None, typer.Argument(help="Answer sheets (.toml, .py, .m, .tex, .ipynb), or folders of them.")
    ] = None,
    robot: Annotated[
        str | None, typer.Option(help="A library name or a robot file, in place of the sheets' own.")
    ] = None,
    task: Annotated[
        Path | None, typer.Option(help="The instructor's file: robot, [task], [names], [rubric] (.toml).")
    ] = None,
    rubric: Annotated[Path | None, typer.Option(help="What answers are worth (.toml).")] = None,
    read: Annotated[bool, typer.Option("--read", help="Show how each entry was read.")] = False,
    seed: Annotated[int | None, typer.Option(min=0, help="Of the random states, to replay a report.")] = None,
    form: Annotated[str, typer.Option("--format", help="text, json, gradescope, junit or html.")] = "text",
    feedback: Annotated[
        str | None, typer.Option(help="full, hint or verdict: how much is told; the rubric's unless given.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, max=1024, help="Sheets at once; one for each core.")] = None,
    seconds: Annotated[float, typer.Option(min=0.1, help="The longest that a sheet may take.")] = 60.0,
    remark: Annotated[
        bool, typer.Option("--remark", help="The files are reports written before (JSON): mark them again.")
    ] = False,
    template: Annotated[str | None, typer.Option(help="Print an empty sheet for this robot.")] = None,
    explain: Annotated[str | None, typer.Option(help="Print this robot's worked solution, step by step.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write; a folder for several sheets.")
    ] = None,
    json: Json = False,
) -> int:
    """Judge students' answers exactly, entry by entry.

    Exit status 0: all pass; 1: one is wrong or incomplete, or lacks the proof that is asked for; 2: one is unreadable.
    """
    from dhkit.cli import grade as grade_command

    if template is not None:
        return grade_command.write_template(template, output)
    if explain is not None:
        return grade_command.write_explanation(Arm.load(explain), form, output)
    if not sheets:
        raise DescriptionError("no answer sheet; expected files or folders, --template NAME or --explain NAME")
    options: dict[str, Any] = {"form": form, "feedback": feedback, "output": output, "json": json}
    if remark:
        return grade_command.remark(sheets, grade_command.rubric_of(rubric), **options)
    return grade_command.grade_files(
        sheets, robot, rubric, task, seed, jobs=jobs, seconds=seconds, read=read, **options
    )


@app.command()
def check(
    robot: Robot,
    program: Annotated[
        list[str],
        typer.Argument(help="A file (.py, .m) that defines fk, ik or controller; with --run a program, its arguments."),
    ],
    run: Annotated[
        bool, typer.Option("--run", help="Execute PROGRAM, which speaks the protocol of docs/own-code.md.")
    ] = False,
    rubric: Annotated[Path | None, typer.Option(help="What each part is worth (.toml).")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of the random states, to replay a report.")] = None,
    samples: Annotated[int, typer.Option(min=1, max=100_000, help="Random states.")] = 200,
    seconds: Annotated[float, typer.Option(min=0.01, max=3600, help="The longest that a call may take.")] = 5.0,
    sandbox: Annotated[str | None, typer.Option(help="bwrap: in bubblewrap, for strangers' files.")] = None,
    json: Json = False,
) -> int:
    """Score a program's forward and inverse kinematics and its controller, and say where it fails first.

    Exit status 0: full marks; 1: fewer; 2: it cannot be loaded.
    """
    from dhkit.cli import verify as check_command

    if not run and len(program) != 1:
        raise DescriptionError(f"{len(program)} files; expected one, or --run with a program and its arguments")
    source = program if run else Path(program[0])
    return check_command.check_program(Arm.load(robot), source, rubric, seed, samples, sandbox, seconds, json)


@app.command()
def bench(
    quantities: Annotated[list[str] | None, typer.Argument(help="What to time; all unless given.")] = None,
    robot: Annotated[str, typer.Option(help="A library name or a robot file.")] = "puma560",
    batch: Annotated[int, typer.Option(min=1, max=10_000_000, help="Items of a batch.")] = 100_000,
    threads: Annotated[int, typer.Option(min=1, max=1024, help="Threads that batch calls may use.")] = 1,
    repeats: Annotated[int, typer.Option(min=1, max=1000, help="Interleaved rounds.")] = 9,
    seed: Annotated[int, typer.Option(min=0, help="Of the random states.")] = 0,
    probes: Annotated[bool, typer.Option(help="Measure threads, memory and new processes too.")] = True,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write NAME.md and NAME.json as well.")] = None,
    json: Json = False,
) -> int:
    """Time our kinematics and dynamics beside every installed peer: median, spread and ratios.

    Exit status 1: dhkit itself, or every contender of a quantity, failed or could not be timed.

    Quantities: fk, ik, jacobian, inverse_dynamics, mass_matrix, forward_dynamics.
    """
    from dhkit.bench import QUANTITIES
    from dhkit.cli import bench as bench_command

    return bench_command.run(
        Arm.load(robot),
        quantities or QUANTITIES,
        batch=batch,
        threads=threads,
        repeats=repeats,
        seed=seed,
        probes=probes,
        output=output,
        json=json,
    )


SCHEMAS = {
    "robot": "dhkit.description.schema",
    "assignment": "dhkit.lab.assignment_form",
    "sheet": "dhkit.grading.schema",
    "rubric": "dhkit.grading.schema",
    "task": "dhkit.grading.schema",
    "motion": "dhkit.trajectories.schema",
}
"""Modules with a function ``NAME_schema``, by NAME."""


@app.command()
def schema(what: Annotated[str, typer.Argument(help=f"Which file: {', '.join(SCHEMAS)}.")]) -> None:
    """Print the JSON Schema of a file format."""
    if what not in SCHEMAS:
        raise DescriptionError(f"no schema {what!r}; expected {', '.join(SCHEMAS)}")
    print_json(getattr(import_module(SCHEMAS[what]), f"{what}_schema")(), indent=2)


@app.command()
def demo(
    robot: Annotated[str, typer.Option(help="A library name or a robot file.")] = "puma560",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder to write; out/NAME.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer samples.")] = False,
    json: Json = False,
) -> int:
    """Build a robot from its table, verify it, and write its URDF, a figure and an animated page."""
    from dhkit.cli import demo as demo_command

    return demo_command.run(Arm.load(robot), output, quick=quick, json=json)
