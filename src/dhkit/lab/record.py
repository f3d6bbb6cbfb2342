"""Records of a person's work on an assignment: the goals that were reached, when, and what shows it.

A record is sealed: a keyed hash of its content (HMAC-SHA-256, RFC 2104) tells that nobody has edited the file. The key
follows from the assignment, which a student has, so that the seal keeps out edits by hand and not a program that makes
records. Goals of states, motions and numbers are checked again from their evidence when they are collected; judged
answers, scores of own programs and controlled runs are taken from the record, and are counted as such.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.description import Array, write_atomically
from dhkit.description.files import read_bounded
from dhkit.display import counted, plain, repr_line
from dhkit.errors import AnswerError, DescriptionError
from dhkit.lab.assignment import (
    Assignment,
    Condition,
    JointsAt,
    MotionBetween,
    NumberIs,
    Place,
    ToolAt,
)
from dhkit.trajectories import Trajectory
from dhkit.trajectories.bounds import BOUNDS
from dhkit.viewer.motion import exceeded_limit

SUFFIX = ".lab.json"
"""End of a record's name."""
MAX_BYTES = 2_000_000
MAX_NAME_LENGTH = 100
"""Longest name of a student, characters."""
LIMIT_SAMPLES = 401
"""Samples of a motion at equal steps at which its limits are looked at; the lab plots these."""
PIECE_SHARES = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9)
"""Places in each piece of a motion at which they are looked at too, as shares of the piece."""
_KEY = b"dhkit record of an assignment, format 1, "


def now() -> str:
    """Return the time in UTC, in ISO 8601 with seconds."""
    return datetime.now(UTC).isoformat(timespec="seconds")


@dataclass(frozen=True, eq=False)
class Reached:
    """A goal that was reached."""

    time: str
    """When: ISO 8601, UTC."""
    evidence: Mapping[str, Any]
    """What shows it: joint values, a motion, a number, an answer, a score or a run."""


@dataclass(frozen=True, eq=False)
class Record:
    """A person's work on an assignment.

    Attributes
    ----------
    digest
        That of the assignment.
    student
        Name as typed.
    begun
        When the lab was opened for the first time: ISO 8601, UTC.
    reached
        The goals reached, by their places.
    """

    digest: str
    student: str = ""
    begun: str = field(default_factory=now)
    reached: Mapping[Place, Reached] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Write the record; an earlier one of that name is replaced at once, or not at all."""
        goals = []
        for place in sorted(self.reached):
            found = self.reached[place]
            goals.append(
                {
                    "step": place.step + 1,
                    "goal": place.goal + 1,
                    "time": found.time,
                    "evidence": dict(found.evidence),
                }
            )
        content = {
            "kind": "lab record",
            "format": 1,
            "assignment": self.digest,
            "student": self.student,
            "begun": self.begun,
            "goals": goals,
        }
        write_atomically(
            path,
            json.dumps(content | {"seal": _seal(content)}, indent=1, ensure_ascii=False) + "\n",
        )

    @classmethod
    def read(cls, path: Path) -> Record:
        """Read a record.

        Raises
        ------
        AnswerError
            It is not a record, it is too large, or it was edited: its seal does not fit.
        """
        try:
            content = json.loads(read_bounded(path, MAX_BYTES, "a lab's record"))
            seal = content.pop("seal")
            if content["kind"] != "lab record" or content["format"] != 1:
                raise ValueError("another kind or format")
            reached = {}
            for goal in content["goals"]:
                place = Place(_number(goal["step"]) - 1, _number(goal["goal"]) - 1)
                reached[place] = Reached(str(goal["time"]), dict(goal["evidence"]))
            student = plain(str(content["student"]), MAX_NAME_LENGTH)
            record = cls(str(content["assignment"]), student, str(content["begun"]), reached)
            is_whole = isinstance(seal, str) and hmac.compare_digest(
                seal.encode("ascii"), _seal(content).encode()
            )
        except DescriptionError as error:
            raise AnswerError(str(error)) from None
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError):
            raise AnswerError(
                f"{path}: no record of a lab; expected the file that dhkit lab --record wrote"
            ) from None
        if not is_whole:
            raise AnswerError(
                f"{path}: the seal does not fit; the record was edited after the lab wrote it"
            )
        return record

    def __repr__(self) -> str:
        return repr_line(
            "Record", self.student or "without a name", counted(len(self.reached), "goal")
        )


def record_path(folder: Path, assignment_file: Path) -> Path:
    """Return the file in a folder in which the work on an assignment is recorded."""
    return folder / f"{assignment_file.stem}{SUFFIX}"


def taken_up(file: Path, assignment: Assignment) -> Record:
    """Return the record in a file, or a new one where there is none.

    Raises
    ------
    AnswerError
        The record cannot be read, or was edited.
    DescriptionError
        It is about another assignment.
    """
    if not file.exists():
        return Record(assignment.digest)
    record = Record.read(file)
    if record.digest != assignment.digest:
        raise DescriptionError(
            f"{file}: a record of another assignment; expected another folder for this one"
        )
    reached = {
        place: record.reached[place] for place in assignment.places if place in record.reached
    }
    return replace(record, reached=reached)


def motion_evidence(motion: Trajectory) -> dict[str, Any]:
    """Return a motion's polynomials as evidence."""
    return {"breaks": motion.breaks.tolist(), "coefficients": motion.coefficients.tolist()}


def is_confirmed(
    assignment: Assignment, condition: Condition, evidence: Mapping[str, Any]
) -> bool | None:
    """Return whether the evidence shows that a goal was reached; None for evidence that cannot be checked again.

    Raises
    ------
    ValueError, KeyError, TypeError
        The evidence is not that of such a goal.
    """
    arm = assignment.arm
    if isinstance(condition, (ToolAt, JointsAt)):
        q = np.array(evidence["q"], dtype=float)
        if q.shape != (arm.n,) or not np.isfinite(q).all():
            raise ValueError("joint values of another arm")
        return condition.is_reached(arm.fk(q) if isinstance(condition, ToolAt) else q)
    if isinstance(condition, MotionBetween):
        breaks = np.array(evidence["breaks"], dtype=float)
        coefficients = np.array(evidence["coefficients"], dtype=float)
        if coefficients.ndim != 3 or coefficients.shape[1] > BOUNDS.coefficients:
            raise ValueError("polynomials of another form")
        motion = Trajectory(arm.description, breaks, coefficients)
        times = limit_times(motion)
        excess = exceeded_limit(arm.description, motion.q(times), motion.qd(times), None)
        return condition.is_reached(motion, excess)
    if isinstance(condition, NumberIs):
        return condition.is_reached(float(evidence["number"]))
    return None


def limit_times(motion: Trajectory) -> Array:
    """Return times at which a motion's limits are looked at, s: at equal steps, and inside each of its pieces."""
    inside = [motion.breaks[:-1] + share * np.diff(motion.breaks) for share in PIECE_SHARES]
    steps = np.linspace(0.0, motion.duration, LIMIT_SAMPLES)
    return np.unique(np.concatenate([steps, *inside]))


def _number(value: object) -> int:
    """Return a step's or a goal's number, from 1."""
    if type(value) is not int or value < 1:
        raise ValueError("a number of a step or a goal")
    return value


def _seal(content: Mapping[str, Any]) -> str:
    """Return the keyed hash of a record's content."""
    key = hashlib.sha256(_KEY + str(content["assignment"]).encode()).digest()
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hmac.new(key, text.encode(), hashlib.sha256).hexdigest()
