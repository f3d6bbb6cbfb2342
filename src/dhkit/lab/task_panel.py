"""The panel of an assignment: its texts, its goals, and which goals have been reached."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, Description
from dhkit.description.frames import has_same_geometry
from dhkit.errors import DhkitError, ExpressionError
from dhkit.expressions import parse
from dhkit.lab.answers_panel import AnswersPanel
from dhkit.lab.assignment import (
    AnswerRight,
    Assignment,
    Condition,
    ControlWithin,
    JointsAt,
    MotionBetween,
    NumberIs,
    OwnScore,
    Place,
    ToolAt,
)
from dhkit.lab.assignment_form import MAX_GOALS, MAX_STEPS
from dhkit.lab.control_panel import ControlPanel
from dhkit.lab.desk import Desk
from dhkit.lab.motion_panel import MotionPanel
from dhkit.lab.own_panel import OwnPanel
from dhkit.lab.record import MAX_NAME_LENGTH, Reached, Record, motion_evidence, now, taken_up
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.lab.table_panel import plain_expression

LEAST_STROKE = 5.0
"""Stroke of a joint's desired values, as a multiple of the largest error, from which a run counts as following them."""


class KeptRun(NamedTuple):
    """The part of a run in which its errors have been small."""

    begin: float
    """s"""
    lowest: Array
    """Smallest desired values since then, shape (k,), rad and m."""
    highest: Array
    """Largest ones."""


class TaskPanel(Panel):
    """Requests ``task.…``; goals are checked when something happens that they ask for.

    That is a state on show, a motion, the score of a program, a judged answer, a typed number, or a frame of a run.

    A goal stays reached once it was. A state counts as reached only after another state was shown: a goal that the arm
    begins in has to be left first.
    """

    def __init__(
        self,
        desk: Desk,
        motions: MotionPanel,
        own: OwnPanel,
        answered: AnswersPanel,
        control: ControlPanel,
        assignment: Assignment | None,
        file: Path | None = None,
        record: Record | None = None,
    ) -> None:
        super().__init__(desk)
        self.motions = motions
        self.own = own
        self.control = control
        self.assignment = assignment
        self._lock = threading.Lock()
        self._file = file
        """The file that the work is recorded in, if it is."""
        self._record = Record("") if record is None else record
        self._fault: str | None = None
        """Why the record could not be written the last time, in words."""
        self._reached: dict[Place, Reached] = dict(self._record.reached)
        self._kept: dict[Place, KeptRun] = {}
        """Runs whose errors have been as small as a goal asks for up to now."""
        self._left: set[Place] = set()
        """Goals that are states, and that the arm has been away from."""
        self._arm = desk.arm
        self._is_assigned_arm = True
        """Whether the arm on show moves as the assignment's arm: its table may have been edited."""
        if assignment is not None:
            desk.on_show.append(self._check_state)
            motions.on_change.append(self._check_motion)
            own.on_score.append(self._check_score)
            answered.on_verdict.append(self._check_answer)
            control.on_frame.append(self._check_run)

    @answers("task.reset")
    def reset(self, _: Fields) -> None:
        """Forget which goals have been reached."""
        if self.assignment is None:
            raise ValueError(
                "task.reset: there is no assignment; expected a lab that was opened with one"
            )
        if self._file is not None:
            raise ValueError(
                "task.reset: the work is recorded; expected --record with another folder to begin anew"
            )
        with self._lock:
            self._reached.clear()
            self._left.clear()
            self._kept.clear()
        self._check_state(self.desk.q)
        self.publish()

    @answers("task.name", "name")
    def set_name(self, fields: Fields) -> None:
        """Write the student's name into the record."""
        if self._file is None:
            raise ValueError("task.name: nothing is recorded; expected a lab with --record FOLDER")
        name = " ".join(fields.text("name", MAX_NAME_LENGTH).split())
        if not name.isprintable():
            raise ValueError("task.name: found control characters; expected a name")
        self._record = replace(self._record, student=name)
        self._write()
        self.publish()

    @answers("task.number", "step", "goal", "text")
    def take_number(self, fields: Fields) -> JsonObject:
        """Compare a typed number, an expression such as 0.6 or pi/2, with a goal's; tell whether it is right."""
        place = Place(
            fields.integer("step", 0, MAX_STEPS - 1), fields.integer("goal", 0, MAX_GOALS - 1)
        )
        condition = dict(self._conditions()).get(place)
        if not isinstance(condition, NumberIs):
            raise ValueError("task.number: that goal asks for no number")
        try:
            number = float(parse(plain_expression(fields.text("text").strip())))
        except (ExpressionError, OverflowError) as error:
            raise ValueError(f"task.number: {' '.join(str(error).split())[:150]}") from None
        is_right = condition.is_reached(number)
        if is_right:
            self._take({place: {"number": number}})
        return {"right": is_right}

    def publish(self) -> None:
        """Send the assignment, and the goals reached, to the pages."""
        with self._lock:
            self.desk.view.panel(
                "task", None if self.assignment is None else self._state(self.assignment)
            )

    def _state(self, assignment: Assignment) -> dict[str, object]:
        steps = []
        for i, step in enumerate(assignment.steps):
            goals = []
            for j, goal in enumerate(step.goals):
                asks_number = isinstance(goal.condition, NumberIs)
                is_met = Place(i, j) in self._reached
                goals.append(
                    {"text": goal.text, "points": goal.points, "met": is_met, "number": asks_number}
                )
            steps.append(
                {"title": step.title, "text": step.text, "panel": step.panel, "goals": goals}
            )
        return {
            "title": assignment.title,
            "panels": None if assignment.panels is None else list(assignment.panels),
            "points": sum(
                assignment.steps[place.step].goals[place.goal].points
                for place in sorted(self._reached)
            ),
            "most": assignment.points,
            "note": self._note(),
            "steps": steps,
            "file": None if self._file is None else str(self._file),
            "student": self._record.student,
        }

    def _note(self) -> str | None:
        if self._fault is not None:
            return self._fault
        if not self._is_assigned_arm:
            return "The table was edited: goals count again after its Reset."
        if self.own.source is None and any(
            isinstance(condition, OwnScore) for _, condition in self._conditions()
        ):
            return "Some goals ask for a program of your own: start the lab with --mine FILE."
        return None

    def _conditions(self) -> Iterator[tuple[Place, Condition]]:
        for i, step in enumerate(() if self.assignment is None else self.assignment.steps):
            for j, goal in enumerate(step.goals):
                yield Place(i, j), goal.condition

    def _check_state(self, q: Array) -> None:
        """Check goals of poses and joint values at a state on show, shape (n,), rad and m."""
        if self._update_arm():
            self.publish()
        reached: dict[Place, JsonObject] = {}
        with self._lock:
            T: Array | None = None
            for place, condition in self._conditions() if self._is_assigned_arm else ():
                if place in self._reached or not isinstance(condition, (ToolAt, JointsAt)):
                    continue
                if isinstance(condition, JointsAt):
                    is_reached = condition.is_reached(q)
                else:
                    T = self.desk.arm.fk(q) if T is None else T
                    is_reached = condition.is_reached(T)
                if not is_reached:
                    self._left.add(place)
                elif place in self._left:
                    reached[place] = {"q": q.tolist()}
        self._take(reached)

    def _check_motion(self) -> None:
        """Check goals of motions."""
        motion = self.motions.motion
        excess = self.motions.excess
        if motion is not None and self._is_assigned_arm:
            evidence = motion_evidence(motion)
            self._check(
                lambda goal: isinstance(goal, MotionBetween) and goal.is_reached(motion, excess),
                evidence,
            )

    def _check_score(self, arm: Arm, report: Mapping[str, object]) -> None:
        """Check goals of a program at its score beside an arm."""
        if self.assignment is not None and _moves_alike(
            arm.description, self.assignment.arm.description
        ):
            evidence = {"functions": report.get("functions", {})}
            self._check(
                lambda goal: isinstance(goal, OwnScore) and goal.is_reached(report), evidence
            )

    def _check_answer(self, text: str, right: Collection[str]) -> None:
        """Check goals of answers: ``text`` is what was judged, and ``right`` the names of its right entries."""
        if (
            self.assignment is not None
            and self.desk.arm.description == self.assignment.arm.description
        ):
            self._check(
                lambda goal: isinstance(goal, AnswerRight) and goal.name in right, {"answer": text}
            )

    def _check_run(self, t: float, desired: Array, errors: Array) -> None:
        """Check goals of controllers at a time of a run, s, its desired values and errors, shape (k,), rad and m."""
        if not self._is_assigned_arm or len(errors) != self.desk.arm.n:  # some joints are locked
            return
        settings = self.control.settings
        reached: dict[Place, JsonObject] = {}
        for place, condition in self._conditions():
            if not isinstance(condition, ControlWithin) or place in self._reached:
                continue
            run_so_far = self._kept.get(place)
            if not condition.is_kept(settings, errors):
                self._kept.pop(place, None)
                continue
            if run_so_far is None or t < run_so_far.begin:  # a run that begins anew begins at 0
                self._kept[place] = KeptRun(t, desired, desired)
                continue
            lowest = np.minimum(run_so_far.lowest, desired)
            highest = np.maximum(run_so_far.highest, desired)
            self._kept[place] = KeptRun(run_so_far.begin, lowest, highest)
            # What stands still is followed by any controller.
            moves = (highest - lowest).max() >= LEAST_STROKE * condition.error
            if t - run_so_far.begin >= condition.seconds and moves:
                run = {
                    "controller": settings.controller,
                    "bandwidth": settings.bandwidth,
                    "payload": settings.payload,
                }
                reached[place] = {"run": run}
        self._take(reached)

    def _check(self, is_reached: Callable[[Condition], bool], evidence: JsonObject) -> None:
        with self._lock:
            reached = {
                place: evidence
                for place, goal in self._conditions()
                if place not in self._reached and is_reached(goal)
            }
        self._take(reached)

    def _take(self, reached: Mapping[Place, JsonObject]) -> None:
        if reached:
            time = now()
            with self._lock:
                self._reached |= {
                    place: Reached(time, evidence) for place, evidence in reached.items()
                }
            self._write()
            self.publish()

    def _write(self) -> None:
        """Write the record, if there is one."""
        if self._file is not None:
            with self._lock:
                try:
                    # Another lab may have written into the same file meanwhile.
                    assert self.assignment is not None  # noqa: S101 - for mypy: a record is of an assignment
                    earlier = taken_up(self._file, self.assignment).reached
                    self._reached = {**self._reached, **earlier}
                    self._record = replace(self._record, reached=dict(self._reached))
                    self._record.write(self._file)
                    self._fault = None
                except (OSError, DhkitError) as error:
                    self._fault = f"The work is not recorded: {error}"

    def _update_arm(self) -> bool:
        """Compare an arm that has replaced another with the assignment's; return whether the result has changed."""
        arm = self.desk.arm
        was_assigned_arm = self._is_assigned_arm
        if arm is not self._arm and self.assignment is not None:
            self._arm = arm
            self._is_assigned_arm = _moves_alike(arm.description, self.assignment.arm.description)
        return self._is_assigned_arm is not was_assigned_arm


def _moves_alike(first: Description, second: Description) -> bool:
    """Return whether two arms have the same table, base, tool and limits; their bodies may differ."""
    limits = ("lower", "upper", "velocity", "effort")
    return has_same_geometry(first, second) and all(
        np.array_equal(getattr(first.numbers, name), getattr(second.numbers, name))
        for name in limits
    )
