"""`dhkit plan`: the best motion to a place, what it is worth beside others, and files, a page and a figure of it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.output import FIGURES, PAGES, check_outputs, print_json, print_table, say, write_figure
from dhkit.cli.progress import ProgressBar
from dhkit.cli.units import joint_entry
from dhkit.description import Array
from dhkit.errors import DescriptionError, PlanningError
from dhkit.planning import Floor, Objective, Obstacle, Payload, PlanReport, Progress, ToolSpeed
from dhkit.trajectories import Limits, Trajectory, joint_path, tool_line
from dhkit.trajectories.archives import ARCHIVES
from dhkit.trajectories.files import TABLES

SAMPLES = 801
"""By which a motion's largest rates and torques are told."""
SEEN = 0.005
"""Share of the time from which on an active limit is told."""


@dataclass(frozen=True, eq=False)
class Task:
    """A motion that is asked for."""

    arm: Arm
    start: Array
    """Joint values, shape (n,), rad and m."""
    goal: Array
    """The same, or a pose of the tool, shape (4, 4)."""
    via: Sequence[Array]
    objective: Objective
    duration: float | None
    limits: Limits
    payload: Payload | None
    tool_speed: float | None
    """m/s."""
    obstacles: Sequence[Obstacle | Floor]
    clearance: float
    """m."""
    self_collision: bool
    intervals: int | None
    time_limit: float
    """s."""

    @property
    def shared(self) -> dict[str, Any]:
        """What a motion between configurations and one along a path are both given."""
        given = {
            "objective": self.objective,
            "constraints": () if self.tool_speed is None else (ToolSpeed(self.tool_speed),),
            "duration": self.duration,
            "limits": self.limits,
            "time_limit": self.time_limit,
        }
        return given if self.intervals is None else {**given, "intervals": self.intervals}


@dataclass(frozen=True)
class Files:
    """What is to be written."""

    motion: Path | None
    page: Path | None
    figure: Path | None

    def check(self) -> None:
        """Refuse what could not be written, before anybody waits for it.

        Raises
        ------
        DescriptionError
            Another suffix, or a place that cannot be written to.
        """
        check_outputs(((self.motion, (*ARCHIVES, *TABLES)), (self.page, PAGES), (self.figure, FIGURES)))

    def write(self, task: Task, motion: Trajectory) -> Iterator[Path]:
        """Write them, and yield each path."""
        if self.motion is not None:
            yield motion.save(self.motion)
        if self.page is not None:
            with task.arm.view() as view:
                view.obstacles(task.obstacles)
                view.play(motion)
                caption = f"A planned motion of {motion.duration:.4g} s; its curves are under Motions, with the limits."
                yield view.save_html(self.page, interactive=True, motions={"planned": motion}, caption=caption)
        if self.figure is not None:
            from dhkit.viewer import plot

            yield write_figure(plot(motion), self.figure)


def run(task: Task, files: Files, *, line: bool, degrees: bool, json: bool) -> int:
    """Plan a motion, print what it is worth and write its files; return 0, or 1 where there is no such motion.

    Parameters
    ----------
    line
        Whether the tool goes straight.
    degrees
        Whether angles are printed in degrees.
    """
    files.check()
    try:
        with ProgressBar("making the program") as bar:
            began = time.monotonic()

            def watch(now: Progress) -> None:
                said = f"iteration {now.iteration}: {now.duration:.4f} s, limits missed by {now.infeasibility:.1e}"
                bar.show(time.monotonic() - began, task.time_limit, f"{said}, of {task.time_limit:g} s to search")

            motion = _along_line(task, watch) if line else _anyhow(task, watch)
    except PlanningError as error:
        if json:
            print_json({"robot": task.arm.name, "found": False, "reason": str(error), "files": []})
        else:
            sys.stderr.write(f"dhkit: {' '.join(str(error).split())}\n")
        return 1
    if not json:
        _print(task, motion, line=line, degrees=degrees)
    written = [str(path) for path in files.write(task, motion)]
    if json:
        print_json(_facts(task, motion, line=line, degrees=degrees) | {"files": written})
    elif written:
        say("\n" + "\n".join(f"wrote {path}" for path in written))
    return 0


def _anyhow(task: Task, watch: Callable[[Progress], None]) -> Trajectory:
    return task.arm.plan(
        task.start,
        task.goal,
        via=task.via,
        payload=task.payload,
        obstacles=task.obstacles,
        clearance=task.clearance,
        self_collision=task.self_collision,
        progress=watch,
        **task.shared,
    )


def _along_line(task: Task, watch: Callable[[Progress], None]) -> Trajectory:
    """Return the best motion with the tool on a straight line.

    Raises
    ------
    DescriptionError
        What such motions cannot do is asked for.
    PlanningError
        There is no such motion.
    """
    refused = {"--via": task.via, "obstacles": task.obstacles, "--self-collision": task.self_collision}
    if found := next((name for name, given in refused.items() if given), None):
        raise DescriptionError(f"--line: found {found} too; expected a motion straight from start to goal, without")
    arm = task.arm
    T_goal = task.goal if task.goal.shape == (4, 4) else arm.fk(task.goal)
    path = joint_path(arm.description, tool_line(arm.fk(task.start), T_goal), task.start, task.limits)
    return arm.plan_path(path, progress=watch, payload=task.payload, **task.shared)


def _print(task: Task, motion: Trajectory, *, line: bool, degrees: bool) -> None:
    report: PlanReport = motion.report
    certificate = report.certificate
    along = ", the tool along a straight line" if line else ""
    say(f"{task.arm.name}: least {report.objective}{along}", "bold")
    cost = "" if task.objective.only_time else f", {report.objective} = {report.cost:.6g}"
    say(f"{report.duration:.4f} s{cost}\n")
    _print_joints(task, motion, degrees)
    worst = certificate.worst
    verdict = "all limits kept" if certificate.ok else f"limits exceeded by {certificate.violation:.1e}"
    active = [(name, share) for name, share in report.active_limits() if share >= SEEN]
    reached = ", ".join(f"{name} {100 * share:.0f} %" for name, share in active) or "none"
    say(f"\ncertificate: {verdict} in {certificate.states} states, by {certificate.reference}")
    if worst is not None:
        say(f"nearest to its limit: {worst.what}, {max(-100 * worst.excess, 0.0):.2g} % left at {worst.time:.3f} s")
    say(f"some limit reached in {100 * certificate.any_active:.0f} % of the time: {reached}")
    if report.unlimited:
        say(f"not limited: {', '.join(report.unlimited)}")
    if report.slow_down > 1:
        say(f"slowed down by {100 * (report.slow_down - 1):.3f} % to keep its limits between knots")
    if report.tightened:
        say(f"solved again with tightened limits: {', '.join(report.tightened)}")
    if report.coarse is not None and report.sensitivity is not None:
        more = 100 * report.sensitivity
        say(f"mesh: {report.intervals} intervals; {report.coarse[0]} would cost {more:.2f} % more")
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


def _print_joints(task: Task, motion: Trajectory, degrees: bool) -> None:
    """Print where each joint begins and ends, and its largest rate and torque as shares of their limits."""
    numbers = task.arm.description.numbers
    samples = motion.sample(n=SAMPLES)
    shares = [_shares(samples.qd, task.limits.velocity)]
    if np.isfinite(numbers.mass).all():
        shares.append(_shares(samples.tau, task.limits.torque))
    scale = np.where(numbers.prismatic | (not degrees), 1.0, 180 / np.pi)
    rows = []
    for i, joint in enumerate(task.arm.description.joints):
        unit = "m" if numbers.prismatic[i] else "°" if degrees else "rad"
        ends = [f"{round(float(scale[i] * q[i]), 4) + 0.0:.4f}" for q in (samples.q[0], samples.q[-1])]
        rows.append((joint.name, *ends, unit, *(column[i] for column in shares)))
    headings = ("joint", "from", "to", "", "largest rate [%]", "largest torque [% of limit]")
    print_table(headings[: len(rows[0])], rows)


def _shares(values: Array, limits: Array) -> list[str]:
    largest = np.abs(values).max(axis=0) / limits
    known = zip(largest, np.isfinite(limits), strict=True)
    return [f"{100 * share:.0f}" if limited else "no limit" for share, limited in known]


def _facts(task: Task, motion: Trajectory, *, line: bool, degrees: bool) -> dict[str, Any]:
    ends = joint_entry(task.arm, "start", motion.q(0.0), degrees=degrees)
    ends |= joint_entry(task.arm, "goal", motion.q(motion.duration), degrees=degrees)
    return {"robot": task.arm.name, "found": True, "line": line, **ends, **motion.report.as_dict()}
