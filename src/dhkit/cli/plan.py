"""`dhkit plan`: the best motion to a place beside classical ones, and files, a page and a figure of it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.output import MotionFiles, print_json, print_table, say, say_written
from dhkit.cli.progress import ProgressBar
from dhkit.cli.units import joint_entry
from dhkit.description import Array
from dhkit.errors import DescriptionError, PlanningError
from dhkit.planning import Floor, Objective, Obstacle, Payload, PlanReport, Progress, ToolSpeed
from dhkit.trajectories import Limits, Trajectory, joint_path, tool_line
from dhkit.trajectories.archives import ARCHIVES
from dhkit.trajectories.files import TABLES

SAMPLES = 801
"""Samples of a motion of which the largest rates and torques are printed."""
MIN_ACTIVE_SHARE = 0.005
"""Smallest share of the time for which an active limit is printed."""
SUFFIXES = (*ARCHIVES, *TABLES)


@dataclass(frozen=True, eq=False)
class PlanSettings:
    """The motion that is asked for, as :meth:`dhkit.Arm.plan` takes it."""

    arm: Arm
    start: Array
    """Joint values, shape (n,), rad and m."""
    goal: Array
    """Joint values, shape (n,), rad and m, or a pose of the tool, shape (4, 4), m, world."""
    via: Sequence[Array]
    objective: Objective
    duration: float | None
    limits: Limits
    payload: Payload | None
    tool_speed: float | None
    """Largest speed of the tool, m/s."""
    obstacles: Sequence[Obstacle | Floor]
    clearance: float
    """Smallest distance from obstacles, m."""
    self_collision: bool
    intervals: int | None
    time_limit: float
    """Longest search, s."""
    line: bool
    """Whether the tool moves along a straight line."""

    @property
    def common_options(self) -> dict[str, Any]:
        """The options of both kinds of motions, between configurations and along a path."""
        options = {
            "objective": self.objective,
            "constraints": () if self.tool_speed is None else (ToolSpeed(self.tool_speed),),
            "duration": self.duration,
            "limits": self.limits,
            "time_limit": self.time_limit,
        }
        return options if self.intervals is None else {**options, "intervals": self.intervals}


def run(settings: PlanSettings, files: MotionFiles, *, degrees: bool, json: bool) -> ExitStatus:
    """Plan a motion, print its report and write its files; the status is NO if there is no such motion.

    Angles are printed in degrees if ``degrees``, else in rad.
    """
    files.check(SUFFIXES)
    try:
        with ProgressBar("making the program") as bar:
            begin = time.monotonic()

            def report(now: Progress) -> None:
                state = f"iteration {now.iteration}: {now.duration:.4f} s, limits missed by {now.infeasibility:.1e}"
                limit = settings.time_limit
                bar.show(time.monotonic() - begin, limit, f"{state}, of {limit:g} s to search")

            motion = _plan_along_line(settings, report) if settings.line else _plan(settings, report)
    except PlanningError as error:
        if json:
            print_json({"robot": settings.arm.name, "found": False, "reason": str(error), "files": []})
        else:
            sys.stderr.write(f"dhkit: {' '.join(str(error).split())}\n")
        return ExitStatus.NO
    if not json:
        _print(settings, motion, degrees=degrees)
    caption = f"A planned motion of {motion.duration:.4g} s; its curves are under Motions, with the limits."
    written = files.write(settings.arm, motion, "planned", caption, settings.obstacles)
    if json:
        print_json(_facts(settings, motion, degrees=degrees) | {"files": written})
    elif written:
        say("")
        say_written(written)
    return ExitStatus.FINE


def _plan(settings: PlanSettings, report: Callable[[Progress], None]) -> Trajectory:
    return settings.arm.plan(
        settings.start,
        settings.goal,
        via=settings.via,
        payload=settings.payload,
        obstacles=settings.obstacles,
        clearance=settings.clearance,
        self_collision=settings.self_collision,
        progress=report,
        **settings.common_options,
    )


def _plan_along_line(settings: PlanSettings, report: Callable[[Progress], None]) -> Trajectory:
    """Return the best motion with the tool on a straight line.

    Raises
    ------
    DescriptionError
        An option that such motions do not have is given.
    PlanningError
        There is no such motion.
    """
    refused = {"--via": settings.via, "obstacles": settings.obstacles, "--self-collision": settings.self_collision}
    if found := next((name for name, given in refused.items() if given), None):
        raise DescriptionError(f"--line: found {found} too; expected a motion straight from start to goal, without")
    arm = settings.arm
    T_goal = settings.goal if settings.goal.shape == (4, 4) else arm.fk(settings.goal)
    path = joint_path(arm.description, tool_line(arm.fk(settings.start), T_goal), settings.start, settings.limits)
    return arm.plan_path(path, progress=report, payload=settings.payload, **settings.common_options)


def _print(settings: PlanSettings, motion: Trajectory, *, degrees: bool) -> None:
    report: PlanReport = motion.report
    certificate = report.certificate
    along = ", the tool along a straight line" if settings.line else ""
    say(f"{settings.arm.name}: least {report.objective}{along}", "bold")
    cost = "" if settings.objective.only_time else f", {report.objective} = {report.cost:.6g}"
    say(f"{report.duration:.4f} s{cost}\n")
    _print_joints(settings, motion, degrees)
    worst = certificate.worst
    verdict = "all limits kept" if certificate.ok else f"limits exceeded by {certificate.violation:.1e}"
    active = [(name, share) for name, share in report.active_limits() if share >= MIN_ACTIVE_SHARE]
    active_text = ", ".join(f"{name} {100 * share:.0f} %" for name, share in active) or "none"
    say(f"\ncertificate: {verdict} in {certificate.states} states, by {certificate.reference}")
    if worst is not None:
        say(f"nearest to its limit: {worst.what}, {max(-100 * worst.excess, 0.0):.2g} % left at {worst.time:.3f} s")
    say(f"some limit reached in {100 * certificate.any_active:.0f} % of the time: {active_text}")
    if report.unlimited:
        say(f"not limited: {', '.join(report.unlimited)}")
    if report.slow_down > 1:
        say(f"slowed down by {100 * (report.slow_down - 1):.3f} % to keep its limits between knots")
    if report.tightened:
        say(f"solved again with tightened limits: {', '.join(report.tightened)}")
    if report.coarse is not None and report.sensitivity is not None:
        excess = 100 * report.sensitivity
        say(f"mesh: {report.intervals} intervals; {report.coarse[0]} would cost {excess:.2f} % more")
    say(
        f"search: {report.solves} program{'s' * (report.solves != 1)}, {report.iterations} iterations, "
        f"{report.solve_seconds:.2f} s, and {report.build_seconds:.2f} s to make them"
    )
    if report.classical:
        say("")
        rows = [(name, f"{d:.4f}", f"{100 * (d / report.duration - 1):.1f}") for name, d in report.classical]
        print_table(("along the straight joint path", "[s]", "longer by [%]"), rows)
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


def _print_joints(settings: PlanSettings, motion: Trajectory, degrees: bool) -> None:
    """Print the values of each joint at both ends, and its largest rate and torque as shares of their limits."""
    numbers = settings.arm.description.numbers
    samples = motion.sample(n=SAMPLES)
    shares = [_shares(samples.qd, settings.limits.velocity)]
    if np.isfinite(numbers.mass).all():
        shares.append(_shares(samples.tau, settings.limits.torque))
    scale = np.where(numbers.prismatic | (not degrees), 1.0, 180 / np.pi)
    rows = []
    for i, joint in enumerate(settings.arm.description.joints):
        unit = "m" if numbers.prismatic[i] else "°" if degrees else "rad"
        ends = [f"{round(float(scale[i] * q[i]), 4) + 0.0:.4f}" for q in (samples.q[0], samples.q[-1])]
        rows.append((joint.name, *ends, unit, *(column[i] for column in shares)))
    headings = ("joint", "from", "to", "", "largest rate [%]", "largest torque [% of limit]")
    print_table(headings[: len(rows[0])], rows)


def _shares(values: Array, limits: Array) -> list[str]:
    shares = np.abs(values).max(axis=0) / limits
    return [f"{100 * x:.0f}" if limit < np.inf else "no limit" for x, limit in zip(shares, limits, strict=True)]


def _facts(settings: PlanSettings, motion: Trajectory, *, degrees: bool) -> dict[str, Any]:
    ends = joint_entry(settings.arm, "start", motion.q(0.0), degrees=degrees)
    ends |= joint_entry(settings.arm, "goal", motion.q(motion.duration), degrees=degrees)
    return {"robot": settings.arm.name, "found": True, "line": settings.line, **ends, **motion.report.as_dict()}
