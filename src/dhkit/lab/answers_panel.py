"""The panel of answers: a derivation for this robot is judged in a process of its own."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from pathlib import Path

import tomlkit
from tomlkit.exceptions import TOMLKitError

from dhkit.description import Description, to_toml
from dhkit.errors import AnswerError
from dhkit.grading.grade_report import Entry, GradeReport
from dhkit.grading.reports.json import report_of
from dhkit.grading.reports.mathml import mathml
from dhkit.grading.reports.notes import note_text
from dhkit.grading.reports.sentences import witness_sentence
from dhkit.lab.desk import Desk
from dhkit.lab.jobs import Job, Jobs, JobState
from dhkit.lab.requests import Fields, JsonObject, Panel, answers

MAX_ANSWER_LENGTH = 60_000
"""Longest answer, characters."""
MAX_JUDGING_TIME = 120.0
"""Longest time of judging an answer, s."""
SUFFIXES = {"lines": ".toml", "latex": ".tex", "python": ".py", "matlab": ".m", "sheet": ".toml"}
"""The suffix of an answer's file, by the kind of the answer."""
GRADE_SCRIPT = """import ctypes, sys
if sys.platform == "linux":
    ctypes.CDLL(None).prctl(1, 9)  # ends with the lab
from dhkit.cli import main
main(sys.argv[1:])
"""
"""Runs the command ``dhkit``; the process is killed when the lab ends."""
ENTRY_BEGIN = re.compile(r"^\s*([A-Za-z][A-Za-z0-9_]*)\s*=\s*(.*)$")
"""A line that begins an entry, such as ``M11 = …``; other lines continue the entry before them."""


class AnswersPanel(Panel):
    """Requests ``answers.…``."""

    def __init__(self, desk: Desk, lock: AbstractContextManager[object]) -> None:
        super().__init__(desk)
        self.jobs: Jobs = Jobs(self._publish_failure, lock)
        self.on_verdict: list[Callable[[str, Collection[str]], None]] = []
        """Called with an answer's text and the names of its right entries."""
        desk.on_replace.append(self._clear)

    @answers("answers.grade", "kind", "text")
    def grade(self, fields: Fields) -> None:
        """Judge an answer in the background; it is read as text, and never run."""
        kind = fields.choice("kind", SUFFIXES)
        text = fields.text("text", MAX_ANSWER_LENGTH)
        self._clear()  # an answer that is refused must not leave the verdict of another
        if not text.strip():
            raise ValueError(
                "answers.grade: the answer is empty; expected M, C, g, tau, A1, T, J, ... of this robot"
            )
        text = text.encode("utf-8", "replace").decode()  # UTF-8 has no lone surrogates
        content = _sheet(text) if kind == "lines" else text
        description = self.desk.arm.description
        if kind == "sheet":
            _require_robot(content, description.name)
        self.desk.view.panel("verdict", {"running": True})
        self.jobs.start(
            "answers",
            lambda job: _judge(description, content, SUFFIXES[kind], job),
            lambda state: self._take(text, state),
        )

    @answers("answers.cancel")
    def cancel(self, _: Fields) -> None:
        """Stop judging."""
        self._clear()

    def _take(self, text: str, state: JsonObject) -> None:
        self.desk.view.panel("verdict", state)
        entries = state["entries"]
        assert isinstance(entries, list)  # noqa: S101 - for mypy: see _report_state
        right = [entry["name"] for entry in entries if entry["passes"]]
        for call in self.on_verdict:
            call(text, right)

    def _publish_failure(self, state: JobState | None) -> None:
        if state is not None and state["error"]:
            self.desk.view.panel("verdict", {"running": False, "error": state["error"]})

    def _clear(self) -> None:
        """Stop judging, and take the verdict away."""
        self.jobs.cancel()
        self.desk.view.panel("verdict", None)


def _sheet(text: str) -> str:
    """Return lines ``name = expression`` as the text of a sheet.

    Raises
    ------
    ValueError
        A line stands before the first name, or a name is there twice.
    """
    entries: dict[str, str] = {}
    name = None
    for number, line in enumerate(text.splitlines(), start=1):
        begin = ENTRY_BEGIN.match(line)
        if begin is not None:
            name = begin[1]
            if name in entries:
                raise ValueError(f"answers.grade: line {number}: {name} is there twice")
            entries[name] = begin[2].strip()
        elif name is not None:
            entries[name] = f"{entries[name]} {line.strip()}".strip()
        elif line.strip():
            raise ValueError(
                f"answers.grade: line {number}: found {line.strip()[:40]!r}; expected such as M11 = ..."
            )
    return tomlkit.dumps({"format": 1, "answer": entries})


def _require_robot(text: str, name: str) -> None:
    """Refuse a sheet about another robot; a text that is not a sheet is refused where it is judged."""
    with suppress(TOMLKitError):
        robot = tomlkit.parse(text).get("robot")
        if isinstance(robot, str) and Path(robot).stem != name:
            raise ValueError(
                f"answers.grade: the sheet is about {str(robot)[:60]!r}; the arm here is {name}"
            )


def _judge(description: Description, text: str, suffix: str, job: Job) -> JsonObject:
    """Return the verdict that ``dhkit grade`` makes in a process, which is killed when the job is cancelled."""
    job.progress("judging")
    # Shapes do not count for a verdict, and their files would be missing.
    bare = replace(
        description,
        joints=tuple(replace(joint, shapes=()) for joint in description.joints),
        base=replace(description.base, shapes=()),
        tool=replace(description.tool, shapes=()),
    )
    with tempfile.TemporaryDirectory(prefix="dhkit-lab-") as folder:
        names = "robot.toml", f"answer{suffix}", "report.json", "errors.txt"
        robot, answer, report, errors = (Path(folder) / name for name in names)
        robot.write_text(to_toml(bare), "utf-8")
        answer.write_text(text, "utf-8")
        command = [
            sys.executable,
            "-c",
            GRADE_SCRIPT,
            "grade",
            str(answer),
            "--robot",
            str(robot),
            "--format",
            "json",
        ]
        with report.open("wb") as out, errors.open("wb") as err:
            process = subprocess.Popen(  # noqa: S603 - our own program, with files of ours
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                start_new_session=True,
            )
        deadline = time.monotonic() + MAX_JUDGING_TIME
        try:
            while process.poll() is None:
                job.wait(0.05)
                if time.monotonic() > deadline:
                    raise AnswerError(f"judging took longer than {MAX_JUDGING_TIME:g} s")
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        if not report.stat().st_size:
            line = " ".join(errors.read_text("utf-8", "replace").split()).removeprefix("dhkit: ")
            raise AnswerError(line.replace(str(answer), "the answer")[:500] or "judging failed")
        return _report_state(report_of(report.read_bytes()), folder)


def _report_state(report: GradeReport, folder: str) -> JsonObject:
    """Return the parts of a report that the page shows, without the name of the folder that it was made in."""
    return {
        "running": False,
        "error": report.error.replace(f"{folder}{os.sep}answer", "the answer") or None,
        "verdict": report.verdict.value,
        "entries": [_entry_state(entry) for entry in report.entries if entry.answer],
        "missing": list(report.missing),
        "diagnosis": [
            {"place": found.place, "sentence": found.sentence, "hint": found.hint}
            for found in report.diagnosis
        ],
        "notes": [note_text(note) for note in report.notes],
    }


def _entry_state(entry: Entry) -> JsonObject:
    return {
        "name": entry.name,
        "verdict": entry.verdict.value,
        "passes": entry.verdict.passes,
        "read": mathml(entry.latex) if entry.latex else None,
        "text": entry.read,
        "statement": entry.statement,
        "difference": mathml(entry.difference_latex) if entry.difference_latex else None,
        "difference_text": entry.difference,
        "witness": None if entry.witness is None else witness_sentence(entry.witness),
    }
