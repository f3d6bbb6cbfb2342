"""Programs written against the reader: names, aliases, effects, scopes and notebooks that hide what an answer is.

Every program is labelled with the verdicts that are right where Python or MATLAB executes it. A right program may be
refused, since a sheet can be written instead; how many are is bounded.
"""

import json
from pathlib import Path
from zlib import crc32

import pytest

import acceptance
from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import grade

DATA = Path(__file__).with_name("data") / "programs.jsonl"
PROGRAMS = [json.loads(line) for line in DATA.read_text("utf-8").splitlines()]
SHARE = 8
"""One program of so many is read unless all are."""
MOST_UNREAD = 0.04
"""Share of the right programs that may be refused."""


def taken(program):
    return acceptance.ACCEPTING or crc32(program["file"].encode()) % SHARE == 0


def verdict_and_left_out(program, folder):
    path = folder / program["file"]
    path.write_text(program["text"])
    try:
        report = grade(path, library_robot(program["robot"]), explain=False)
    except AnswerError:
        return "unreadable", ()
    return report.verdict.value, report.left_out


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Every program that this run takes, with its verdict and what was left out."""
    folder = tmp_path_factory.mktemp("programs")
    return [
        (program, *verdict_and_left_out(program, folder)) for program in PROGRAMS if taken(program)
    ]


def test_no_verdict_is_another_than_that_of_the_program_run(results):
    allowed = {"unreadable", "incomplete"}
    other = [
        (program["file"], program["about"], verdict, program["accept"])
        for program, verdict, _ in results
        if verdict not in program["accept"]
        and verdict not in allowed
        and not program.get("names_unjudged")
    ]
    assert not other


def test_few_right_programs_are_refused(results):
    right = [
        (program["file"], verdict)
        for program, verdict, _ in results
        if "correct" in program["accept"]
    ]
    unread = [
        program["file"]
        for program, verdict, _ in results
        if verdict in ("unreadable", "incomplete") and verdict not in program["accept"]
    ]
    assert len(unread) <= MOST_UNREAD * len(right), unread


def test_quantities_that_are_not_judged_are_named(results):
    assert not [
        program["file"]
        for program, verdict, left_out in results
        if program.get("names_unjudged") and verdict == "correct" and not left_out
    ]
