"""The panel of an assignment: its texts, its goals, and which goals have been reached."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, Description
from dhkit.description.frames import has_same_geometry
from dhkit.lab.assignment import Assignment, Condition, JointsAt, MotionBetween, OwnScore, ToolAt
from dhkit.lab.desk import Desk
from dhkit.lab.motion_panel import MotionPanel
from dhkit.lab.own_panel import OwnPanel
from dhkit.lab.requests import Fields, Panel, answers


class Place(NamedTuple):
    """The place of a goal in an assignment, counted from 0."""

    step: int
    goal: int


class TaskPanel(Panel):
    """Request ``task.reset``; goals are checked when a state is shown, a motion is made, or a program is scored.

    A goal stays reached once it was. A state counts as reached only after another state was shown: a goal that the arm
    begins in has to be left first.
    """

    def __init__(self, desk: Desk, motions: MotionPanel, own: OwnPanel, assignment: Assignment | None) -> None:
        super().__init__(desk)
        self.motions = motions
        self.own = own
        self.assignment = assignment
        self._lock = threading.Lock()
        self._reached: set[Place] = set()
        self._left: set[Place] = set()
        """Goals that are states, and that the arm has been away from."""
        self._arm = desk.arm
        self._is_assigned_arm = True
        """Whether the arm on show moves as the assignment's arm: its table may have been edited."""
        if assignment is not None:
            desk.on_show.append(self._check_state)
            motions.on_change.append(self._check_motion)
            own.on_score.append(self._check_score)

    @answers("task.reset")
    def reset(self, _: Fields) -> None:
        """Forget which goals have been reached."""
        if self.assignment is None:
            raise ValueError("task.reset: there is no assignment; expected a lab that was opened with one")
        with self._lock:
            self._reached.clear()
            self._left.clear()
        self._check_state(self.desk.q)
        self.publish()

    def publish(self) -> None:
        """Send the assignment, and the goals reached, to the pages."""
        with self._lock:
            self.desk.view.panel("task", None if self.assignment is None else self._state(self.assignment))

    def _state(self, assignment: Assignment) -> dict[str, object]:
        steps = []
        for i, step in enumerate(assignment.steps):
            goals = []
            for j, goal in enumerate(step.goals):
                goals.append({"text": goal.text, "points": goal.points, "met": (i, j) in self._reached})
            steps.append({"title": step.title, "text": step.text, "panel": step.panel, "goals": goals})
        return {
            "title": assignment.title,
            "panels": None if assignment.panels is None else list(assignment.panels),
            "points": sum(assignment.steps[place.step].goals[place.goal].points for place in sorted(self._reached)),
            "most": assignment.points,
            "note": self._note(),
            "steps": steps,
        }

    def _note(self) -> str | None:
        if not self._is_assigned_arm:
            return "The table was edited: goals count again after its Reset."
        if self.own.source is None and any(isinstance(condition, OwnScore) for _, condition in self._conditions()):
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
        reached: set[Place] = set()
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
                    reached.add(place)
        self._take(reached)

    def _check_motion(self) -> None:
        """Check goals of motions."""
        motion = self.motions.motion
        excess = self.motions.excess
        if motion is not None and self._is_assigned_arm:
            self._check(lambda goal: isinstance(goal, MotionBetween) and goal.is_reached(motion, excess))

    def _check_score(self, arm: Arm, report: Mapping[str, object]) -> None:
        """Check goals of a program at its score beside an arm."""
        if self.assignment is not None and _moves_alike(arm.description, self.assignment.arm.description):
            self._check(lambda goal: isinstance(goal, OwnScore) and goal.is_reached(report))

    def _check(self, is_reached: Callable[[Condition], bool]) -> None:
        with self._lock:
            reached = {place for place, goal in self._conditions() if place not in self._reached and is_reached(goal)}
        self._take(reached)

    def _take(self, reached: set[Place]) -> None:
        if reached:
            with self._lock:
                self._reached |= reached
            self.publish()

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
        np.array_equal(getattr(first.numbers, name), getattr(second.numbers, name)) for name in limits
    )
