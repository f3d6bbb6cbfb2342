"""A run over a class: marks as expected, whoever hands in what; stopped, it goes on; equal results however it runs."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

from acceptance import ACCEPTING
from dhkit.cli import main
from grading.class_of_variants import KINDS, write_class

LONGEST_RUN = 3_600.0 if ACCEPTING else 120.0
"""Time that no run takes, s."""
RUBRIC = """
[late]
due = 2026-11-20T23:59:00+01:00
per_day = 0.1
"""
METADATA = """
submission_1:
  :submitters: [{":name": Ada, ":sid": ada}]
  :created_at: 2026-11-22 10:00:00 Z
submission_2:
  :submitters: [{":name": Bob, ":sid": bob}]
"""
RIGHT = (
    "g1 = 9.81*((m1/2 + m2)*l1*cos(q1) + m2*l2*cos(q1 + q2)/2)\ng2 = 9.81*m2*l2*cos(q1 + q2)/2\n"
)


def arguments(out, *options):
    """Return the arguments of `dhkit grade` for the class of the folder in which it runs."""
    return ["class.zip", "--task", "key", "--seed", "5", "-o", str(out), *options]


def grade(*arguments):
    """Run `dhkit grade` in this process; return its status."""
    with pytest.raises(SystemExit) as exit:
        main(["grade", *map(str, arguments)])
    return exit.value.code


def results(folder):
    """Return the content of every file of results, by name, without the time that judging took."""
    found = {}
    for path in sorted(folder.rglob("*.*")):
        text = path.read_text("utf-8")
        if path.suffix == ".json":
            record = json.loads(text)
            del record["seconds"]
            text = json.dumps(record)
        found[path.relative_to(folder).as_posix()] = text
    return found


def records(out):
    return list((out / "records").glob("*.json"))


@pytest.mark.law
@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no os.fork: one sheet after the other")
def test_a_class_is_judged_alike_whether_it_is_killed_or_not(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    students, files = (300, len(KINDS)) if ACCEPTING else (12, 1)
    expected = write_class(tmp_path, students, files)
    whole = tmp_path / "whole"
    begin = time.monotonic()
    assert grade(*arguments(whole, "--jobs", "2" if ACCEPTING else "1")) == 1
    seconds = time.monotonic() - begin

    with (whole / "marks.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    seen = {Path(row["sheet"]).name: float(row["points"]) for row in rows}
    assert seen == expected
    assert all(Path(row["sheet"]).name.startswith(row["student"]) for row in rows)
    assert sum(points < 10 for points in seen.values()) == len(expected) // 3

    stopped = tmp_path / "stopped"
    running = subprocess.Popen(
        [sys.executable, "-m", "dhkit", "grade", *arguments(stopped, "--jobs", "2")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + LONGEST_RUN
    while len(records(stopped)) < len(expected) // 2 and running.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    running.send_signal(signal.SIGKILL)
    assert running.wait() == -signal.SIGKILL
    assert not (stopped / "marks.csv").exists()
    taken = len(records(stopped))
    assert len(expected) // 2 <= taken < len(expected)

    capsys.readouterr()
    assert grade(*arguments(stopped, "--jobs", "2")) == 1
    said = capsys.readouterr().err
    assert f"{taken} of {len(expected)} sheets were judged before, and are taken up" in said
    assert results(stopped) == results(whole)
    if not ACCEPTING:
        return
    begin = time.monotonic()
    distributed = tmp_path / "distributed"
    assert grade(*arguments(distributed, "--scheduler", "local:2")) == 1
    assert results(distributed) == results(whole)
    with capsys.disabled():
        print(f"\n{len(expected)} files judged in {seconds:.0f} s")
        print(f"on two workers of a cluster in {time.monotonic() - begin:.0f} s")


def test_without_times_nothing_is_late_and_stdout_is_json_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rubric.toml").write_text(RUBRIC)
    for name in ("class/ada/a.py", "class/bob/a.py"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text(RIGHT)
    options = ("--robot", "planar2r", "--rubric", "rubric.toml", "--json")
    assert grade("class", *options) == 0
    out, err = capsys.readouterr()
    assert [json.loads(line)["points"] for line in out.splitlines()] == [100, 100]
    assert err == (
        "dhkit: due 2026-11-20T23:59:00+01:00: nothing says when the sheets were handed in, and none counts as late\n"
    )
    Path("class/submission_metadata.yml").write_text(METADATA)
    Path("class/ada").rename("class/submission_1")
    Path("class/bob").rename("class/submission_2")
    assert grade("class", *options) == 0
    out, err = capsys.readouterr()
    assert [json.loads(line)["points"] for line in out.splitlines()] == [80, 100]
    assert "nothing says when 1 of 2 sheets were handed in; they count as in time" in err


def test_an_export_is_named_by_a_list_of_students(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("students.csv").write_text('Student,ID,SIS Login ID\n"Lovelace, Ada",101,ada@x.edu\n')
    with zipfile.ZipFile("c.zip", "w") as archive:
        for name in ("lovelaceada_101_1_a.py", "babbagecharles_102_2_a.py"):
            archive.writestr(name, RIGHT)
    options = ("--robot", "planar2r", "--students", "students.csv", "-o", "out")
    assert grade("c.zip", *options) == 0
    rows = csv.DictReader(Path("out/marks.csv").read_text().splitlines())
    assert sorted(row["student"] for row in rows) == ["ada@x.edu", "babbagecharles_102"]
    said = capsys.readouterr().err
    assert "students.csv: nobody, or no single row, is babbagecharles_102" in said
    # Another layout than the files have: a row for each file that says so.
    assert grade("c.zip", *options, "--export", "moodle") == 2
