"""The panel of answers: what somebody derived for this robot is judged in a process of its own."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from dhkit.description import Description, to_toml
from dhkit.errors import AnswerError
from dhkit.grading.report import Diagnosis, Entry, GradeReport
from dhkit.grading.reports.json import report_of
from dhkit.grading.reports.mathml import mathml
from dhkit.grading.reports.notes import note_text
from dhkit.grading.reports.sentences import witness_sentence
from dhkit.lab.desk import Desk
from dhkit.lab.fields import Fields
from dhkit.lab.jobs import Job, Jobs

LONGEST = 60_000
"""Characters of an answer."""
SECONDS = 120.0
"""What judging may take."""
SUFFIXES = {"lines": ".toml", "latex": ".tex", "python": ".py", "matlab": ".m", "sheet": ".toml"}
GRADE = """import ctypes, sys
if sys.platform == "linux":
    ctypes.CDLL(None).prctl(1, 9)  # ends with the lab
from dhkit.cli import main
main(sys.argv[1:])
"""
"""Judges in a process of its own."""
ASSIGNED = re.compile(r"^\s*([A-Za-z][A-Za-z0-9_]*)\s*=\s*(.*)$")
"""A line that begins an entry, such as ``M11 = …``; others go on with the one before."""


class SubmitPanel:
    """Requests ``submit.…``."""

    def __init__(self, desk: Desk, lock: AbstractContextManager[Any]) -> None:
        self.desk = desk
        self._jobs = Jobs(self._told, lock)
        desk.changed.append(self._clear)

    def grade(self, data: dict[str, Any]) -> dict[str, Any]:
        """Judge an answer in the background; it is read as text, and never run."""
        fields = Fields("submit.grade", data, ["kind", "text"])
        kind, text = fields.choice("kind", SUFFIXES), fields.text("text", LONGEST)
        self._clear()  # an answer that cannot be sent leaves no verdict of another
        if not text.strip():
            raise ValueError("submit.grade: the answer is empty; expected M, C, g, tau, A1, T, J, ... of this robot")
        text = text.encode("utf-8", "replace").decode()  # lone surrogates are no text
        content = _sheet(text) if kind == "lines" else text
        description = self.desk.arm.description
        if kind == "sheet":
            _require_robot(content, description.name)
        self.desk.view.panel("verdict", {"running": True})
        self._jobs.start(
            "submit",
            lambda job: _judged(description, content, SUFFIXES[kind], job),
            lambda report: self.desk.view.panel("verdict", report),
        )
        return {}

    def cancel(self, data: dict[str, Any]) -> dict[str, Any]:
        """Judge no longer."""
        Fields("submit.cancel", data, [])
        self._clear()
        return {}

    def close(self) -> None:
        """End what runs."""
        self._jobs.close()

    def _told(self, state: dict[str, Any] | None) -> None:
        if state is not None and state.get("error"):
            self.desk.view.panel("verdict", {"running": False, "error": state["error"]})

    def _clear(self) -> None:
        """Judge no longer, and take the verdict away."""
        self._jobs.cancel()
        self.desk.view.panel("verdict", None)


def _sheet(text: str) -> str:
    """Return lines ``name = expression`` as a sheet's text.

    Raises
    ------
    ValueError
        A text before the first name.
    """
    entries: dict[str, str] = {}
    name = None
    for number, line in enumerate(text.splitlines(), start=1):
        found = ASSIGNED.match(line)
        if found is not None:
            name = found[1]
            if name in entries:
                raise ValueError(f"submit.grade: line {number}: {name} is there twice")
            entries[name] = found[2].strip()
        elif line.strip() and name is None:
            raise ValueError(f"submit.grade: line {number}: found {line.strip()[:40]!r}; expected such as M11 = ...")
        elif name is not None:
            entries[name] = f"{entries[name]} {line.strip()}".strip()
    return tomlkit.dumps({"format": 1, "answer": entries})


def _require_robot(text: str, name: str) -> None:
    """Refuse a sheet about another robot; a text that is no sheet is refused where it is judged."""
    with suppress(TOMLKitError):
        robot = tomlkit.parse(text).get("robot")
        if isinstance(robot, str) and Path(robot).stem != name:
            raise ValueError(f"submit.grade: the sheet is about {str(robot)[:60]!r}; the arm here is {name}")


def _judged(description: Description, text: str, suffix: str, job: Job) -> dict[str, Any]:
    """Return a report, made by ``dhkit grade`` in a process that is ended when nobody wants it any more."""
    job.progress("judging")
    bare = replace(description, joints=tuple(replace(joint, shapes=()) for joint in description.joints))
    bare = replace(bare, base=replace(bare.base, shapes=()), tool=replace(bare.tool, shapes=()))
    with tempfile.TemporaryDirectory(prefix="dhkit-lab-") as folder:
        names = "robot.toml", f"answer{suffix}", "report.json", "errors.txt"
        robot, answer, report, errors = (Path(folder) / name for name in names)
        robot.write_text(to_toml(bare), "utf-8")
        answer.write_text(text, "utf-8")
        command = [sys.executable, "-c", GRADE, "grade", str(answer), "--robot", str(robot), "--format", "json"]
        with report.open("wb") as out, errors.open("wb") as err:
            process = subprocess.Popen(  # noqa: S603 - our own program, with files of ours
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                start_new_session=True,
            )
        deadline = time.monotonic() + SECONDS
        try:
            while process.poll() is None:
                job.wait(0.05)
                if time.monotonic() > deadline:
                    raise AnswerError(f"judging took longer than {SECONDS:g} s")
        finally:
            _end(process)
        if not report.stat().st_size:
            line = " ".join(errors.read_text("utf-8", "replace").split()).removeprefix("dhkit: ")
            raise AnswerError(line.replace(str(answer), "the answer")[:500] or "judging failed")
        return _state(report_of(report.read_bytes()), folder)


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _state(report: GradeReport, folder: str) -> dict[str, Any]:
    """Return what the page shows of a report, which does not name the folder that it was made in."""
    return {
        "running": False,
        "error": report.error.replace(f"{folder}{os.sep}answer", "the answer") or None,
        "verdict": report.verdict.value,
        "entries": [_entry(entry) for entry in report.entries if entry.answer],
        "missing": list(report.missing),
        "diagnosis": [_diagnosis(one) for one in report.diagnosis],
        "notes": [note_text(note) for note in report.notes],
    }


def _entry(entry: Entry) -> dict[str, Any]:
    difference = mathml(entry.difference_latex) if entry.difference_latex else None
    return {
        "name": entry.name,
        "verdict": entry.verdict.value,
        "passes": entry.verdict.passes,
        "read": mathml(entry.latex) if entry.latex else None,
        "text": entry.read,
        "statement": entry.statement,
        "difference": difference,
        "difference_text": entry.difference,
        "witness": None if entry.witness is None else witness_sentence(entry.witness),
    }


def _diagnosis(found: Diagnosis) -> dict[str, Any]:
    return {"place": found.place, "sentence": found.sentence, "hint": found.hint}
