"""`dhkit plan`: the best motion to a place beside classical ones, and files, a page and a figure of it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from dhkit.arm import Arm
from dhkit.cli.arguments import (
    joint_limits,
    objective as parse_objective,
    obstacles,
    option_values,
    payload as parse_payload,
    target,
    with_long_options,
)
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import Degrees, EulerAngles, EulerOrder, Json, Robot, Uniform, load_arm
from dhkit.cli.output import MotionFiles, print_json, print_table, say, say_written
from dhkit.cli.progress import ProgressBar
from dhkit.cli.units import joint_entry
from dhkit.description import Array
from dhkit.errors import DescriptionError, PlanningError
from dhkit.planning import PlanOptions, PlanReport, Progress, ToolSpeed
from dhkit.planning.along.path_motion import DEFAULT_INTERVALS as PATH_INTERVALS
from dhkit.planning.certificate.collision_avoidance import NOT_LOOKED_FOR
from dhkit.planning.plan_report import more_text, seconds_text
from dhkit.planning.program import MAX_ITERATIONS
from dhkit.trajectories import JointPath, Limits, Trajectory, joint_path, tool_line
from dhkit.trajectories.archives import ARCHIVES
from dhkit.trajectories.files import TABLES

SAMPLES = 801
"""Samples of a motion of which the largest rates and torques are printed."""
MIN_ACTIVE_SHARE = 0.005
"""Smallest share of the time for which an active limit is printed."""
SUFFIXES = (*ARCHIVES, *TABLES)
LONG_OPTIONS: dict[str, int | None] = {
    **dict.fromkeys(
        (
            "--from",
            "--to",
            "--via",
            "--matrix",
            "--like",
            "--objective",
            "--payload",
            "--box",
            "--sphere",
        )
    ),
    **dict.fromkeys(("--velocity", "--acceleration", "--jerk", "--torque")),
    "--xyz": 3,
    "--euler": 3,
    "--floor": 1,
}
"""Options that take several words; the count of values where it is fixed."""

app = typer.Typer(rich_markup_mode=None)


@app.command(cls=with_long_options(LONG_OPTIONS))
def plan(
    robot: Robot,
    start: Annotated[
        str,
        typer.Option(
            "--from", metavar="Q ...", help="Joint values at the start, or a configuration's name."
        ),
    ] = "ready",
    to: Annotated[
        str | None,
        typer.Option(
            metavar="Q ...", help="Joint values at the goal, or the name of a configuration."
        ),
    ] = None,
    xyz: Annotated[
        str | None, typer.Option(metavar="X Y Z", help="Tool position at the goal, m.")
    ] = None,
    euler: EulerAngles = "0 0 0",
    order: EulerOrder = "XYZ",
    matrix: Annotated[
        str | None,
        typer.Option(
            metavar="M11 ... M44",
            help="Tool pose at the goal by row, 16 or 12 numbers; or a file of them.",
        ),
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            metavar="Q ...", help="Goal: the tool pose of these joint values, by any branch."
        ),
    ] = None,
    via: Annotated[
        list[str] | None,
        typer.Option(metavar="Q ...", help="Joint values to pass on the way; may be given again."),
    ] = None,
    coordinates: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,...",
            help="Coordinates of the pose that count, for arms that meet no more; see dhkit ik.",
        ),
    ] = None,
    wanted: Annotated[
        str,
        typer.Option(
            "--objective",
            help='Objective: time, effort, energy, jerk, or a sum such as "time + 1e-4 effort".',
        ),
    ] = "time",
    duration: Annotated[
        float | None, typer.Option(help="Duration, s, for objectives without time.")
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.001, max=1, help="Share of the velocity limits that may be used.")
    ] = 1.0,
    velocity: Annotated[
        str | None,
        typer.Option(
            metavar="V ...",
            help="Velocity limits instead of the robot's, one or one for each joint; rad/s.",
        ),
    ] = None,
    acceleration: Annotated[
        str | None,
        typer.Option(
            metavar="A ...", help="Acceleration limits, one or one for each joint; rad/s^2."
        ),
    ] = None,
    jerk: Annotated[
        str | None,
        typer.Option(metavar="J ...", help="Jerk limits, one or one for each joint; rad/s^3."),
    ] = None,
    torque: Annotated[
        str | None,
        typer.Option(
            metavar="T ...",
            help="Torque limits instead of the robot's, one or one for each joint; N m.",
        ),
    ] = None,
    load: Annotated[
        str | None,
        typer.Option(
            "--payload",
            metavar="KG [@ X Y Z]",
            help="Payload, kg, and its centre of mass in the tool's frame, m.",
        ),
    ] = None,
    tool_speed: Annotated[
        float | None, typer.Option(help="Limit of the tool's speed, m/s.")
    ] = None,
    box: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SX SY SZ @ X Y Z",
            help="Box to avoid: edge lengths and centre, m; may be given again.",
        ),
    ] = None,
    sphere: Annotated[
        list[str] | None,
        typer.Option(
            metavar="R @ X Y Z", help="Sphere to avoid: radius and centre, m; may be given again."
        ),
    ] = None,
    floor: Annotated[
        str | None, typer.Option(metavar="Z", help="Height of a floor to stay above, m.")
    ] = None,
    clearance: Annotated[
        float, typer.Option(min=0, help="Smallest distance from obstacles, m.")
    ] = 0.01,
    self_collision: Annotated[
        bool, typer.Option("--self-collision", help="Avoid collisions between links too.")
    ] = False,
    line: Annotated[
        bool, typer.Option("--line", help="Move the tool along a straight line.")
    ] = False,
    intervals: Annotated[
        int | None, typer.Option(min=6, max=2000, help="Number of mesh intervals.")
    ] = None,
    max_iterations: Annotated[
        int, typer.Option(min=1, help="Limit of the search, iterations of the optimizer.")
    ] = MAX_ITERATIONS,
    time_limit: Annotated[
        float | None,
        typer.Option(
            min=0.01, help="Limit of the search besides, s; the result then depends on it."
        ),
    ] = None,
    degrees: Degrees = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Write the motion: .npz, .mat, .csv or .yaml."),
    ] = None,
    html: Annotated[Path | None, typer.Option(help="Write a page that plays the motion.")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Write a figure of the motion: .png, .svg or .pdf.")
    ] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> ExitStatus:
    """Plan the best motion to joint values or a pose, certified; exit status 1 where there is none.

    Prismatic joints are in m and N. Numbers may be expressions such as 17*inch, 20*mm or pi/2.
    """
    arm = load_arm(robot, uniform)
    pose = {"xyz": xyz, "matrix": matrix, "like": like}
    if sum(given is not None for given in (to, *pose.values())) != 1:
        raise DescriptionError("no single goal; expected one of --to, --xyz, --matrix and --like")
    begin_q = option_values(arm, start, "--from", degrees)
    if to is None:
        goal = target(arm, **pose, euler=euler, order=order, degrees=degrees)
    else:
        goal = option_values(arm, to, "--to", degrees)
    given = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk, "torque": torque}
    limits = joint_limits(arm, given, degrees, speed)
    sought = parse_objective(wanted)
    constraints = () if tool_speed is None else (ToolSpeed(tool_speed),)
    scene = obstacles(box or (), sphere or (), floor)
    options = PlanOptions(
        via=tuple(option_values(arm, place, "--via", degrees) for place in via or ()),
        coordinates=None
        if coordinates is None
        else tuple(name.strip() for name in coordinates.split(",")),
        duration=duration,
        limits=limits,
        payload=parse_payload(load),
        obstacles=scene,
        clearance=clearance,
        self_collision=self_collision,
        max_iterations=max_iterations,
        time_limit=time_limit,
        compare=not line,
    )
    files = MotionFiles(output, html, figure)
    files.check(SUFFIXES)
    try:
        with ProgressBar("making the program") as bar:

            def report(now: Progress) -> None:
                state = f"iteration {now.iteration}: {now.duration:.4f} s, limits missed by {now.infeasibility:.1e}"
                bar.show(now.spent, 1.0, f"{state}; {100 * now.spent:.0f} % of the search's limit")

            options = replace(options, progress=report)
            if line:
                path = _line(arm, begin_q, goal, options)
                fineness = PATH_INTERVALS if intervals is None else intervals
                motion = arm.plan_path(
                    path, sought, constraints=constraints, intervals=fineness, options=options
                )
            else:
                motion = arm.plan(
                    begin_q,
                    goal,
                    sought,
                    constraints=constraints,
                    intervals=intervals,
                    options=options,
                )
    except PlanningError as error:
        if json:
            print_json({"robot": arm.name, "found": False, "reason": str(error), "files": []})
        else:
            sys.stderr.write(f"dhkit: {' '.join(str(error).split())}\n")
        return ExitStatus.NO
    if not json:
        _print(arm, motion, limits, line=line, only_time=sought.only_time, degrees=degrees)
    caption = _caption(motion.report)
    written = files.write(arm, motion, "planned", caption, scene)
    if json:
        ends = joint_entry(arm, "start", motion.q(0.0), degrees=degrees)
        ends |= joint_entry(arm, "goal", motion.q(motion.duration), degrees=degrees)
        facts = {"robot": arm.name, "found": True, "line": line, **ends, **motion.report.as_dict()}
        print_json(facts | {"files": written})
    elif written:
        say("")
        say_written(written)
    return ExitStatus.FINE


def _line(arm: Arm, start: Array, goal: Array, options: PlanOptions) -> JointPath:
    """Return the path whose tool moves along a straight line.

    Parameters
    ----------
    arm
        The arm.
    start
        Joint values, shape (n,), rad and m.
    goal
        Joint values, shape (n,), rad and m, or a pose of the tool, shape (4, 4), m, world.
    options
        Options of the motion along it.

    Raises
    ------
    DescriptionError
        An option that such motions do not have is given.
    PlanningError
        There is no such path.
    """
    if options.via:
        raise DescriptionError(
            "--line: found --via too; expected a motion straight from start to goal, without"
        )
    if options.coordinates is not None:
        raise DescriptionError(
            "--line: found --coordinates too; expected a line, on which all coordinates count"
        )
    T_goal = goal if goal.shape == (4, 4) else arm.fk(goal)
    return joint_path(arm.description, tool_line(arm.fk(start), T_goal), start, options.limits)


def _caption(report: PlanReport) -> str:
    """Return a page's text about a motion: its kind, its constraints, and the limits that are active."""
    active = ", ".join(
        f"{name} ({100 * share:.0f} % of the time)" for name, share in report.active_limits()[:3]
    )
    sentences = [
        f"A planned motion: {report.title}, certified by {report.certificate.reference}.",
        f"At its limits: {active}." if active else "",
        *(f"{note[0].upper()}{note[1:]}." for note in report.notes),
        "The play bar below moves the arm along it; Motions plots joint values, rates and torques with their limits.",
    ]
    return " ".join(sentence for sentence in sentences if sentence)


def _print(
    arm: Arm, motion: Trajectory, limits: Limits, *, line: bool, only_time: bool, degrees: bool
) -> None:
    report: PlanReport = motion.report
    certificate = report.certificate
    along = ", the tool along a straight line" if line else ""
    say(f"{arm.name}: least {report.objective}{along}", "bold")
    cost = "" if only_time else f", {report.objective} = {report.cost_text}"
    say(f"{seconds_text(report.duration)}{cost}\n")
    _print_joints(arm, motion, limits, degrees)
    worst = certificate.worst
    active = [(name, share) for name, share in report.active_limits() if share >= MIN_ACTIVE_SHARE]
    active_text = ", ".join(f"{name} {100 * share:.0f} %" for name, share in active) or "none"
    say(
        f"\ncertificate: {certificate.verdict} in {certificate.states} states, by {certificate.reference}"
    )
    if worst is not None:
        say(f"nearest to its limit: {worst.what}, {worst.margin} at {worst.time:.3f} s")
    say(f"some limit reached in {100 * certificate.any_active:.0f} % of the time: {active_text}")
    if report.unlimited:
        say(f"not limited: {', '.join(report.unlimited)}")
    if report.collisions_not_asked_for:
        say(f"{NOT_LOOKED_FOR}: {report.collisions_not_asked_for}")
    if report.slow_down > 1:
        say(f"slowed down by {100 * (report.slow_down - 1):.3g} % to keep its limits between knots")
    if report.tightened:
        say(f"solved again with tightened limits: {', '.join(report.tightened)}")
    for note in report.notes:
        say(note)
    if report.coarse is not None and report.sensitivity is not None:
        say(
            f"mesh: {report.intervals} intervals; {report.coarse[0]} would cost {more_text(report.sensitivity)}"
        )
    say(
        f"search: {report.solves} program{'s' * (report.solves != 1)}, {report.iterations} iterations, "
        f"{report.solve_seconds:.2f} s, and {report.build_seconds:.2f} s to make them"
    )
    if report.classical:
        say("")
        print_table(("along the straight joint path", "", ""), report.comparisons)
    if report.branches:
        say("")
        branches = [
            (
                "→" if branch.chosen else "",
                branch.branch,
                f"{branch.duration:.4f}" if np.isfinite(branch.duration) else "",
                branch.reason or ("" if branch.solved else "at least, so not tried"),
            )
            for branch in report.branches
        ]
        print_table(("", "branch of the goal", "[s]", ""), branches)


def _print_joints(arm: Arm, motion: Trajectory, limits: Limits, degrees: bool) -> None:
    """Print the values of each joint at both ends, and its largest rate and torque as shares of their limits."""
    numbers = arm.description.numbers
    samples = motion.sample(n=SAMPLES)
    shares = [_shares(samples.qd, limits.velocity)]
    if np.isfinite(numbers.mass).all():
        shares.append(_shares(samples.tau, limits.torque))
    scale = np.where(numbers.prismatic | (not degrees), 1.0, 180 / np.pi)
    rows = []
    for i, joint in enumerate(arm.description.joints):
        angle_unit = "°" if degrees else "rad"
        unit = "m" if numbers.prismatic[i] else angle_unit
        ends = [
            f"{round(float(scale[i] * q[i]), 4) + 0.0:.4f}" for q in (samples.q[0], samples.q[-1])
        ]
        rows.append((joint.name, *ends, unit, *(column[i] for column in shares)))
    headings = ("joint", "from", "to", "", "largest rate [%]", "largest torque [% of limit]")
    print_table(headings[: len(rows[0])], rows)


def _shares(values: Array, limits: Array) -> list[str]:
    shares = np.abs(values).max(axis=0) / limits
    return [
        f"{100 * x:.0f}" if limit < np.inf else "no limit"
        for x, limit in zip(shares, limits, strict=True)
    ]
