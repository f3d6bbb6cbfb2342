"""Reports of planned motions: cost, certificate, branches, counts, and classical motions to compare with."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.display import html_block, html_lines, html_table, repr_line
from dhkit.errors import PlanningError
from dhkit.planning.certificate import Certificate
from dhkit.planning.certificate.collision_avoidance import (
    NOT_LOOKED_FOR,
    collisions_not_asked_for,
)
from dhkit.planning.criteria import Limit, States, cost_of
from dhkit.planning.program import Task, Work
from dhkit.planning.search import PlannedMotion
from dhkit.trajectories import quintic, trapezoidal

MAX_LISTED_LIMITS = 3
"""Largest number of active limits that are listed as text."""
SHORT_DURATION = 0.1
"""Durations (s) below which 0.1 ms is too coarse."""
NO_DIFFERENCE = 1e-6
"""Relative difference of two costs or durations below which they are told as equal."""
MANY_TIMES = 9.0
"""Relative difference of two costs or durations above which it is told as a factor, not in percent."""


@dataclass(frozen=True)
class BranchReport:
    """Result of another branch of inverse kinematics at a goal pose."""

    branch: str
    duration: float
    """Duration, s; a lower bound if ``solved`` is False, infinite if there is no motion."""
    solved: bool
    chosen: bool = False
    reason: str = ""
    """Reason why there is no motion; empty if there is one."""

    def __str__(self) -> str:
        return f"{self.branch}: {'no motion: ' if self.reason else ''}{_duration_text(self)}"

    def __repr__(self) -> str:
        return repr_line("BranchReport", summary=str(self))


@dataclass(frozen=True)
class ClassicalMotion:
    """A motion of textbooks along the straight joint path under the same limits."""

    name: str
    duration: float
    """Duration, s: the given one, or else the least."""
    cost: float
    """Value of the objective."""


@dataclass(frozen=True)
class PlanReport:
    """Report of a planned motion: cost, certificate and how it was found."""

    objective: str
    cost: float
    """Value of the objective."""
    unit: str
    """Unit of the cost; empty for a sum of terms, and for terms of joints of both types."""
    duration: float
    """Duration of the motion, s."""
    is_duration_given: bool
    """Whether the duration was given."""
    is_least_time: bool
    """Whether the objective is the duration alone."""
    certificate: Certificate
    joints: tuple[str, ...]
    intervals: int
    iterations: int
    solves: int
    """Number of programs solved, including those of other branches."""
    build_seconds: float
    """Time for building programs, s; 0 if they existed."""
    solve_seconds: float
    slow_down: float = 1.0
    """Factor by which the solution was slowed down to keep its limits between the points of the program."""
    tightened: tuple[str, ...] = ()
    """Limits that were tightened for another solution, for the same reason."""
    coarse: tuple[int, float] | None = None
    """Number of intervals and cost on a coarser mesh."""
    classical: tuple[ClassicalMotion, ...] = ()
    """Motions of textbooks to compare with."""
    branches: tuple[BranchReport, ...] = ()
    unlimited: tuple[str, ...] = ()
    """Kinds of limits that the motion was planned without, such as ``acceleration``: these quantities may jump."""
    is_resolved: bool = True
    """Whether the motion was optimized; a move below 1e-10 rad or m is a quintic that keeps the limits."""
    is_converged: bool = True
    """Whether the motion is optimal to the solver's tolerance; with friction or energy it may be only feasible."""
    failure: str = ""
    """Why the optimizer found nothing: the motion is then a path slowed down, the straight one or a sampled one."""
    clearance: float | None = None
    """Distance that was asked for from obstacles, m; None without obstacles."""
    clear_of: str = ""
    """Bodies from or between which the clearance is kept, in words: obstacles, links."""
    spare_clearance: float = 0.0
    """Smallest distance beyond that, m."""
    reduced_clearances: tuple[str, ...] = ()
    """Distances at the start or the goal that are below the clearance, which is reduced to them there."""
    coordinates: tuple[str, ...] = ()
    """Coordinates of the places' poses that counted; empty if all did."""
    not_checked: tuple[str, ...] = ()
    """Parts without a measured distance: links without a shape, or that overlap in all sampled configurations."""
    is_clearance_reduced_throughout: bool = False
    """Whether the clearance is reduced during the whole motion: none was found that keeps it away from the ends."""

    @property
    def collisions_not_asked_for(self) -> str:
        """Bodies whose contact nobody asked to avoid, in words; empty if obstacles and links were both asked for."""
        return collisions_not_asked_for(self.clear_of if self.clearance is not None else "")

    @property
    def sensitivity(self) -> float | None:
        """Relative excess of the cost on half as many intervals over this one."""
        return None if self.coarse is None else self.coarse[1] / self.cost - 1

    @property
    def notes(self) -> list[str]:
        """Notes on the motion and its certificate for a reader, a sentence each."""
        notes = []
        if self.coordinates:
            notes.append(
                f"of the poses to go to, {', '.join(self.coordinates)} counted and no other coordinates"
            )
        if self.clearance is not None:
            asked = 1000 * self.clearance
            spare = 1000 * max(self.spare_clearance, 0.0)
            notes.append(
                f"clearance: {asked:.3g} mm kept {self.clear_of}, and at least {spare:.3g} mm more"
            )
        if self.reduced_clearances:
            less = ", ".join(self.reduced_clearances)
            where = "all the way" if self.is_clearance_reduced_throughout else "near the ends"
            notes[-1] += f", but less {where}: {less}"
        if self.not_checked:
            notes.append(f"not checked for collisions: {'; '.join(self.not_checked)}")
        if self.failure:
            path = (
                "the straight path"
                if self.clearance is None
                else "a sampled path around the obstacles"
            )
            notes.append(
                f"not optimal: {path}, slowed down; the optimizer found nothing ({self.failure})"
            )
        elif not self.is_converged:
            notes.append(
                "not optimal to the solver's tolerance: it stopped at a motion that keeps all limits"
            )
        if not self.is_resolved:
            notes.append("the move is too small to be optimized: a quintic that keeps the limits")
        elif self.is_duration_given and self.is_least_time:
            notes.append(
                "the duration is given, so that least time has no choice left: one of many such motions"
            )
        return notes

    @property
    def cost_text(self) -> str:
        """The cost as text, with its unit."""
        return self._with_unit(self.cost)

    def _with_unit(self, cost: float) -> str:
        return f"{cost:.6g} {self.unit}".rstrip()

    @property
    def title(self) -> str:
        """The motion in a few words: its duration and its objective."""
        aim = f"least {self.objective}" if self.is_resolved else "not optimized"
        return f"{seconds_text(self.duration)}, {aim}"

    @property
    def comparisons(self) -> list[tuple[str, str, str]]:
        """Names of the classical motions, their durations or costs, and by how much these are larger, as texts."""
        rows = []
        for motion in self.classical:
            if self.is_least_time:
                value = seconds_text(motion.duration)
                ratio = motion.duration / self.duration
            else:
                value = self._with_unit(motion.cost)
                ratio = motion.cost / self.cost if self.cost > 0 else math.nan
            rows.append((motion.name, value, "" if math.isnan(ratio) else more_text(ratio - 1)))
        return rows

    def active_limits(self) -> list[tuple[str, float]]:
        """Return the active limits and their shares of time, the most active first."""
        named = [
            (
                f"{limit.what} of {self.joints[limit.row]}" if limit.of_joint else limit.what,
                limit.share,
            )
            for limit in self.certificate.active
        ]
        return sorted(named, key=lambda item: -item[1])

    def __repr__(self) -> str:
        return repr_line("PlanReport", summary=f"{self.title}, {self._certified}")

    def _repr_html_(self) -> str:
        facts = [
            ("duration", seconds_text(self.duration)),
            (f"cost ({self.objective})", self.cost_text),
        ]
        facts.append(
            ("some limit is active", f"{100 * self.certificate.any_active:.0f} % of the time")
        )
        facts += [
            (f"{name} active", f"{100 * share:.0f} % of the time")
            for name, share in self.active_limits()[:MAX_LISTED_LIMITS]
        ]
        if self.unlimited:
            facts.append(("not limited", ", ".join(self.unlimited)))
        if self.collisions_not_asked_for:
            facts.append((NOT_LOOKED_FOR, self.collisions_not_asked_for))
        if self.slow_down > 1:
            facts.append(("slowed down by", f"{100 * (self.slow_down - 1):.3g} %"))
        if self.coarse is not None:
            facts.append((f"{self.coarse[0]} intervals cost", more_text(self.sensitivity or 0.0)))
        facts += [
            (f"{name}, straight joint path", ", ".join(filter(None, of)))
            for name, *of in self.comparisons
        ]
        facts.append(("solved in", f"{self.solve_seconds:.3f} s, {self.iterations} iterations"))
        branches = [
            (branch.branch, _duration_text(branch), "chosen" if branch.chosen else "")
            for branch in self.branches
        ]
        return html_block(
            f"{self.title}, {self._certified}",
            html_table((), facts),
            html_table(("branch", "duration", ""), branches) if branches else "",
            html_lines(
                [f"tightened: {', '.join(self.tightened)}"] * bool(self.tightened) + self.notes
            ),
        )

    @property
    def _certified(self) -> str:
        return "certified" if self.certificate.ok else self.certificate.verdict

    def as_dict(self) -> dict[str, object]:
        """Return the report as numbers and texts, for JSON."""
        certificate = self.certificate
        return {
            "objective": self.objective,
            "cost": self.cost,
            "unit": self.unit,
            "duration_s": self.duration,
            "duration_given": self.is_duration_given,
            "certified": certificate.ok,
            "violation": certificate.violation,
            "reference": certificate.reference,
            "states": certificate.states,
            "limits": [
                {
                    "what": check.what,
                    "joint": self.joints[check.row] if check.of_joint else None,
                    "excess": check.excess,
                    "time_s": check.time,
                }
                for check in certificate.checks
            ],
            "active": [{"limit": name, "share": share} for name, share in self.active_limits()],
            "any_active": certificate.any_active,
            "sampled": list(certificate.sampled),
            "not_checked": list(self.not_checked),
            "unlimited": list(self.unlimited),
            "clearance_m": self.clearance,
            "spare_clearance_m": None if self.clearance is None else self.spare_clearance,
            "reduced_clearances": list(self.reduced_clearances),
            "clearance_reduced_throughout": self.is_clearance_reduced_throughout,
            "resolved": self.is_resolved,
            "converged": self.is_converged,
            "failure": self.failure or None,
            "slow_down": self.slow_down,
            "tightened": list(self.tightened),
            "intervals": self.intervals,
            "coarse": None
            if self.coarse is None
            else {"intervals": self.coarse[0], "cost": self.coarse[1]},
            "classical_s": {motion.name: motion.duration for motion in self.classical},
            "classical_cost": {motion.name: motion.cost for motion in self.classical},
            "branches": [
                {
                    "branch": b.branch,
                    "duration_s": b.duration,
                    "solved": b.solved,
                    "chosen": b.chosen,
                    "reason": b.reason,
                }
                for b in self.branches
            ],
            "iterations": self.iterations,
            "solves": self.solves,
            "build_s": self.build_seconds,
            "solve_s": self.solve_seconds,
        }

    def __str__(self) -> str:
        certificate = self.certificate
        lines = []
        lines.append(f"{self.title}: {self.cost_text}")
        kept = f"certified by {certificate.reference} in {certificate.states} states"
        if certificate.worst is None:
            lines.append(f"{kept}: nothing is limited")
        else:
            worst = certificate.worst
            lines.append(
                f"{kept}: {certificate.verdict}; nearest to its limit: {worst.what} ({worst.margin}) at "
                f"{worst.time:.3f} s"
            )
        if certificate.sampled:
            lines.append(
                f"checked at these states, and not proved between them: {', '.join(certificate.sampled)}"
            )
        if self.slow_down > 1:
            lines.append(
                f"slowed down by {100 * (self.slow_down - 1):.3g} % to keep its limits between knots"
            )
        if self.tightened:
            lines.append(f"solved again with tightened limits: {', '.join(self.tightened)}")
        active = (
            ", ".join(
                f"{name} {100 * share:.0f} %"
                for name, share in self.active_limits()[:MAX_LISTED_LIMITS]
            )
            or "none"
        )
        lines.append(
            f"some limit is active in {100 * certificate.any_active:.0f} % of the time: {active}"
        )
        if self.unlimited:
            lines.append(f"not limited: {', '.join(self.unlimited)}")
        if self.collisions_not_asked_for:
            lines.append(f"{NOT_LOOKED_FOR}: {self.collisions_not_asked_for}")
        lines += self.notes
        if self.coarse is not None:
            more = more_text(self.sensitivity or 0.0)
            lines.append(f"mesh: {self.coarse[0]} intervals cost {more} than {self.intervals}")
        for name, *of in self.comparisons:
            lines.append(f"{name} along the straight joint path: {', '.join(filter(None, of))}")
        lines += [f"{'->' if branch.chosen else '  '} {branch}" for branch in self.branches]
        lines.append(
            f"{self.solves} program{'s' * (self.solves != 1)}, {self.iterations} iterations, "
            f"{self.solve_seconds:.3f} s (and {self.build_seconds:.2f} s to build)"
        )
        return "\n".join(lines)


def seconds_text(duration: float) -> str:
    """Return a duration (s) as text: to 0.1 ms, and short ones to four digits."""
    return f"{duration:.4f} s" if duration >= SHORT_DURATION else f"{duration:.4g} s"


def more_text(share: float) -> str:
    """Return by how much something is more than another, as a share of it, in words."""
    if abs(share) < NO_DIFFERENCE:
        return "0 % more"
    if share >= MANY_TIMES:
        return f"{1 + share:.3g} times as much"
    return f"{100 * abs(share):.3g} % {'less' if share < 0 else 'more'}"


def _duration_text(branch: BranchReport) -> str:
    """Return a branch's duration as text, or the reason why it has none."""
    return (
        branch.reason
        or f"{'' if branch.solved else 'not tried, at least '}{seconds_text(branch.duration)}"
    )


def report_of(task: Task, best: PlannedMotion, work: Work) -> PlanReport:
    """Return the report of a task's motion."""
    arm = task.arm
    return PlanReport(
        objective=str(task.objective),
        cost=best.cost,
        unit=task.objective.unit(arm.numbers.prismatic),
        duration=best.trajectory.duration,
        is_duration_given=task.duration is not None,
        is_least_time=task.objective.only_time,
        certificate=best.certificate,
        joints=tuple(joint.name for joint in arm.joints),
        intervals=best.intervals,
        iterations=work.iterations,
        solves=work.solves,
        build_seconds=work.build_seconds,
        solve_seconds=time.perf_counter() - work.began - work.build_seconds,
        slow_down=best.slow_down,
        tightened=best.tightened,
        unlimited=task.limits.unlimited,
        is_resolved=best.is_resolved,
        is_converged=best.is_converged,
        failure=best.failure,
        **task.avoidance.report(arm, best.certificate.excess_of(Limit.CLEARANCE)),
    )


def classical_motions(task: Task) -> tuple[ClassicalMotion, ...]:
    """Return the best trapezoid and quintic along the straight joint path, slowed down to the task's duration.

    Empty for motions that they cannot follow: with via points, ends not at rest, obstacles, or friction. Those that
    take longer than the task's duration are left out.
    """
    if (
        len(task.points) > 2
        or not task.rests
        or task.friction is not None
        or task.avoidance
        or task.checker.constraints
    ):
        return ()

    def torques(q: Array, qd: Array, qdd: Array) -> Array:
        return States(task.loaded, np.zeros(len(q)), q, qd, qdd).tau

    motions = []
    for name, make in (("best trapezoid", trapezoidal), ("quintic", quintic)):
        try:
            motion = make(
                task.arm, task.points[0], task.points[1], limits=task.limits, torques=torques
            )
        except PlanningError:
            continue  # the straight path may need more than the torque limits
        if task.duration is not None:
            if motion.duration > task.duration:
                continue
            motion = motion.slowed(task.duration / motion.duration)
        cost = cost_of(task.objective, motion, task.loaded)
        motions.append(ClassicalMotion(name, motion.duration, cost))
    return tuple(motions)
