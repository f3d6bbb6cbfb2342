"""The panel of an assignment: its texts, its goals, and which of them have been met."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, Description
from dhkit.lab.assignment import Assignment, Goal, JointsAt, MotionBetween, OwnScore, ToolAt
from dhkit.lab.desk import Desk
from dhkit.lab.fields import Fields
from dhkit.lab.motion_panel import MotionPanel
from dhkit.lab.own_panel import OwnPanel

Place = tuple[int, int]
"""Of a goal: its step and its number there, from 0."""


class TaskPanel:
    """Request ``task.reset``; goals are checked when a state is shown, a motion is made, or a program is scored.

    A goal stays met once it was. A state counts as reached only after another one was shown: a goal that the arm
    begins in has to be left first.
    """

    def __init__(self, desk: Desk, motions: MotionPanel, own: OwnPanel, assignment: Assignment | None) -> None:
        self.desk, self.motions, self.own, self.assignment = desk, motions, own, assignment
        self._lock = threading.Lock()
        self._met: set[Place] = set()
        self._left: set[Place] = set()
        """Goals of states that have been away from."""
        self._arm = desk.arm
        self._same = True
        """Whether the arm on show moves as the assignment's: its table may have been edited."""
        if assignment is not None:
            desk.shown.append(self._shown)
            motions.changed.append(self._planned)
            own.scored.append(self._scored)

    def reset(self, data: dict[str, Any]) -> dict[str, Any]:
        """Forget which goals have been met."""
        Fields("task.reset", data, [])
        if self.assignment is None:
            raise ValueError("task.reset: there is no assignment; expected a lab that was opened with one")
        with self._lock:
            self._met.clear()
            self._left.clear()
        self._shown(self.desk.q)
        self.publish()
        return {}

    def publish(self) -> None:
        """Tell the pages the assignment, and what has been met."""
        with self._lock:
            self.desk.view.panel("task", None if self.assignment is None else self._state(self.assignment))

    def _state(self, assignment: Assignment) -> dict[str, Any]:
        return {
            "title": assignment.title,
            "panels": None if assignment.panels is None else list(assignment.panels),
            "points": sum(goal.points for place, goal in self._goals() if place in self._met),
            "most": assignment.points,
            "note": self._note(),
            "steps": [
                {
                    "title": step.title,
                    "text": step.text,
                    "panel": step.panel,
                    "goals": [
                        {"text": goal.text, "points": goal.points, "met": (i, j) in self._met}
                        for j, goal in enumerate(step.goals)
                    ],
                }
                for i, step in enumerate(assignment.steps)
            ],
        }

    def _note(self) -> str | None:
        if not self._same:
            return "The table was edited: goals count again after its Reset."
        wants_program = any(isinstance(goal.condition, OwnScore) for _, goal in self._goals())
        if wants_program and self.own.source is None:
            return "Some goals ask for a program of your own: start the lab with --mine FILE."
        return None

    def _goals(self) -> Iterator[tuple[Place, Goal]]:
        steps = () if self.assignment is None else self.assignment.steps
        for i, step in enumerate(steps):
            for j, goal in enumerate(step.goals):
                yield (i, j), goal

    def _open(self) -> list[tuple[Place, Goal]]:
        """Return the goals that have not been met; none while the arm on show is not the assignment's."""
        return [(place, goal) for place, goal in self._goals() if place not in self._met] if self._same else []

    def _shown(self, q: Array) -> None:
        """Check goals of poses and joint values at a state on show, shape (n,)."""
        if self._watch_arm():
            self.publish()
        found: set[Place] = set()
        with self._lock:
            T: Array | None = None
            for place, goal in self._open():
                if isinstance(goal.condition, ToolAt):
                    T = self.desk.arm.fk(q) if T is None else T
                    there = goal.condition.met(T)
                elif isinstance(goal.condition, JointsAt):
                    there = goal.condition.met(q)
                else:
                    continue
                if not there:
                    self._left.add(place)
                elif place in self._left:
                    found.add(place)
        self._take(found)

    def _planned(self) -> None:
        """Check goals of motions."""
        motion, excess = self.motions.motion, self.motions.excess
        if motion is None:
            return
        with self._lock:
            goals = [(place, goal.condition) for place, goal in self._open()]
            found = {p for p, one in goals if isinstance(one, MotionBetween) and one.met(motion, excess)}
        self._take(found)

    def _scored(self, arm: Arm, report: Mapping[str, Any]) -> None:
        """Check goals of a program at its score beside an arm."""
        if self.assignment is None or not moves_alike(arm.description, self.assignment.arm.description):
            return
        with self._lock:
            goals = [(place, goal.condition) for place, goal in self._goals()]
            found = {p for p, one in goals if isinstance(one, OwnScore) and p not in self._met and one.met(report)}
        self._take(found)

    def _take(self, found: set[Place]) -> None:
        if found:
            with self._lock:
                self._met |= found
            self.publish()

    def _watch_arm(self) -> bool:
        """Compare an arm that has come in place of another with the assignment's; return whether that changed."""
        arm, before = self.desk.arm, self._same
        if arm is self._arm or self.assignment is None:
            return False
        self._arm = arm
        self._same = moves_alike(arm.description, self.assignment.arm.description)
        return self._same is not before


def moves_alike(one: Description, other: Description) -> bool:
    """Return whether two arms have the same table, base, tool and limits; bodies may differ."""
    if one.convention is not other.convention or one.kinds != other.kinds:
        return False
    names = ("theta", "d", "a", "alpha", "T_world_base", "T_last_tool", "lower", "upper", "velocity", "effort")
    return all(np.array_equal(getattr(one.numbers, name), getattr(other.numbers, name)) for name in names)
