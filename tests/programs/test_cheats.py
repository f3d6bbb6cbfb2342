"""No full marks for what is not right, no hang, and nothing left behind: programs that try."""

import os
import stat
from pathlib import Path

import numpy as np
import pytest

from acceptance import slow_if
from dhkit import Arm
from dhkit.errors import AnswerError
from dhkit.programs import CheckRubric, Limits, Program, ProgramError, check

PUMA = Arm.load("puma560")
RUN = Limits(seconds=3.0)


def score(arm, path, text, **options):
    """Return the share of the points that a program's text gets."""
    path.write_text(text)
    with Program(path, RUN) as program:
        report = check(arm, program, seed=1, samples=options.pop("samples", 20), **options)
    return report.points / report.most, report


@pytest.mark.parametrize(
    ("name", "torques"),
    [
        slow_if(True, "puma560_cao", [0, 49.00754232, 0, 0, 0, 0]),
        slow_if(True, "cobra600", [0, 0, -19.62, 0]),
    ],
)
def test_a_constant_torque_follows_nothing(tmp_path, name, torques):
    share, _ = score(
        Arm.load(name), tmp_path / "c.py", f"def controller(t, q, qd, s): return {torques}\n"
    )
    assert share < 0.2


def test_a_task_names_configurations_that_there_are(tmp_path):
    (tmp_path / "c.py").write_text("def controller(t, q, qd, s): return [0]*6\n")
    rubric = CheckRubric.from_dict({"controller": {"start": "raedy"}})
    with (
        Program(tmp_path / "c.py", RUN) as program,
        pytest.raises(
            AnswerError, match=r"controller\.start: puma560 has no configuration 'raedy'"
        ),
    ):
        check(PUMA, program, rubric, seed=1)


WRIST = Arm.from_dh([(0, 0, 0, "-pi/2"), (0, 0, 0, "pi/2"), (0, 0.1, 0, 0)], kinds="RRR")
INVENTED = """
from math import acos, atan2
def ik(T):
    p = [T[i][3] for i in range(3)]
    if sum(x*x for x in p) > .0101: return []
    return [[atan2(p[1], p[0]), acos(max(-1, min(1, p[2]/.1))), .123]]
"""


def test_a_joint_that_turns_the_tool_on_the_spot_cannot_be_invented(tmp_path):
    assert score(WRIST, tmp_path / "w.py", INVENTED)[0] < 0.2
    one = Arm.from_dh([(0, 0.3, 0, 0)])
    assert score(one, tmp_path / "one.py", "def ik(T): return [[0.0]]\n")[0] < 0.6


def test_a_planar_arm_is_still_asked_for_its_position_alone(tmp_path):
    arm = Arm.load("planar2r")
    l1, l2 = arm.description.numbers.a
    text = f"""
import math
def ik(T):
    x, y = T[0][3], T[1][3]
    c = (x*x + y*y - {l1}**2 - {l2}**2)/(2*{l1}*{l2})
    if abs(c) > 1: return []
    found = []
    for s in (1, -1):
        q2 = s*math.acos(c)
        found.append([math.atan2(y, x) - math.atan2({l2}*math.sin(q2), {l1} + {l2}*math.cos(q2)), q2])
    return found
"""
    share, report = score(arm, tmp_path / "p.py", text)
    assert share == 1, str(report)
    there = text.replace("x, y = T[0][3], T[1][3]", "x, y = T[0][3] - 3.0, T[1][3]")
    moved = arm.with_base(
        np.block([[np.eye(3), np.array([[3.0], [0], [0]])], [np.zeros((1, 3)), 1]])
    )
    share, report = score(moved, tmp_path / "m.py", there)
    assert share == 1, str(report)


@pytest.mark.parametrize("row", ["[float('nan')]*6", "[1.7e308]*6", "[float('inf')]*6"])
def test_rows_that_are_no_numbers_make_a_pose_wrong(tmp_path, row):
    right = (Path(__file__).parents[2] / "docs/examples/puma_ik.py").read_text()
    text = (
        right.replace("def ik(T)", "def solved(T)")
        + f"\ndef ik(T): return [*map(list, solved(T)), {row}]\n"
    )
    _, report = score(
        PUMA, tmp_path / "n.py", text, rubric=CheckRubric.from_dict({"ik": {}}), samples=5
    )
    (closes, *_) = report.functions["ik"]
    assert closes.points == 0


def test_many_rows_are_refused_and_judged_in_no_time(tmp_path):
    share, report = score(
        Arm.load("planar2r"), tmp_path / "m.py", "def ik(T): return [[0, 0]]*65\n"
    )
    assert share == 0
    assert "expected at most 64" in str(report)


@pytest.mark.slow
def test_who_never_reads_is_late_and_nobody_waits_for_ever(tmp_path):
    text = """
import json, os, time
def fk(q): pass
os.write(4, b'{"functions":["fk"]}\\n')
for k in range(1, 900): os.write(4, (json.dumps({"id": k, "value": []}) + "\\n").encode())
time.sleep(1e6)
"""
    (tmp_path / "d.py").write_text(text)
    with Program(tmp_path / "d.py", Limits(seconds=0.1)) as program:
        program.start()
        failures = set()
        for _ in range(2000):
            try:
                program.call("fk", q=[0.1] * 60)
            except ProgramError as error:
                failures.add(error.failure)
            if "late" in failures:
                return
    raise AssertionError(failures)


def test_numbers_that_no_double_holds_are_no_crash(tmp_path):
    text = """
import os, time
def fk(q): pass
os.write(4, b'{"functions":["fk"]}\\n{"id":1,"value":[[1' + b'0'*400 + b']]}\\n')
time.sleep(1e6)
"""
    (tmp_path / "h.py").write_text(text)
    with (
        Program(tmp_path / "h.py", RUN) as program,
        pytest.raises(ProgramError, match="not an array of numbers"),
    ):
        program.fk(np.zeros(2))


def test_what_a_program_says_commands_no_terminal(tmp_path):
    (tmp_path / "e.py").write_text(
        'def fk(q): raise ValueError("\\x1b[2J\\x1b[H 200 of 200 points \\x9b8m\\u202e")\n'
    )
    with Program(tmp_path / "e.py", RUN) as program, pytest.raises(ProgramError) as error:
        program.fk(np.zeros(2))
    assert str(error.value).isprintable()
    (tmp_path / "p.py").write_text(
        'def fk(q):\n    import os; print("\\x1b[2J gone"); os._exit(1)\n'
    )
    with (
        Program(tmp_path / "p.py", RUN) as program,
        pytest.raises(ProgramError, match="gone") as error,
    ):
        program.fk(np.zeros(2))
    assert str(error.value).isprintable()


def test_devices_and_pipes_are_written_to_and_links_followed(tmp_path):
    from dhkit.description import write_atomically

    pipe, target, link = tmp_path / "pipe", tmp_path / "target", tmp_path / "link"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_atomically(pipe, "text")
    assert os.read(reader, 100) == b"text"
    os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    target.write_text("old")
    link.symlink_to(target)
    write_atomically(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    write_atomically(Path("/dev/null"), "nothing")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
