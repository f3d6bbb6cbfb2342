"""Many sheets: one that hangs, crashes, floods or starves is reported so, and the rest goes on."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from dhkit.errors import AnswerError
from dhkit.grading.batch import GIGABYTE, grade_all
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.grade_report import Entry, GradeReport, Verdict
from dhkit.grading.isolation import WorkerLimits
from dhkit.grading.sheets import Sheet, find_sheets
from grading.judged import REPORT

pytestmark = pytest.mark.slow

SHORT = 0.25  # seconds of processor time that a judge that hangs is given; four times as long on the clock
LONG = 120.0  # seconds that nothing here takes, unless something is wrong

forking = pytest.mark.skipif(
    not hasattr(os, "fork"), reason="no os.fork: sheets are judged in the process itself"
)


def sheets(*names):
    return [Sheet(Path(name), Path(name).stem) for name in names]


def right(path):
    return GradeReport("planar2r", entries=(Entry("V", (), Verdict.CORRECT, path.stem),))


def hang(path):
    time.sleep(LONG)


def spin(path):
    while True:
        pass


def crash(path):
    os.kill(os.getpid(), signal.SIGSEGV)


def dereference(path):
    ctypes.string_at(0)


def leave(path):
    os._exit(3)


def eat(path):
    return [bytearray(100_000_000) for _ in range(100)]


def flood(path):
    return replace(REPORT, left_out=("x" * 30_000_000,))


def stumble(path):
    raise KeyError("no\nsuch")


def refuse(path):
    raise AnswerError(f"{path}: answer.M: found 3; expected a list")


def quit_python(path):
    sys.exit("enough")


def babble(path):
    for file in range(3, 64):
        try:
            os.write(file, b"cos\nsystem\n(S'true'\ntR.")
        except OSError:
            continue
    os._exit(0)


def close_and_hang(path):
    os.closerange(3, 64)
    time.sleep(LONG)


def not_finite(path):
    return replace(REPORT, seconds=float("nan"))


def none(path):
    return None


@forking
@pytest.mark.parametrize(
    ("judge", "error"),
    [
        (hang, "took longer than 0.25 s"),
        (spin, "took longer than 0.25 s"),
        (crash, "the judge stopped: signal 11 (SIGSEGV)"),
        (dereference, "the judge stopped: signal 11 (SIGSEGV)"),
        (leave, "the judge stopped: status 3"),
        (eat, "needed more than 1 GB"),
        (flood, "the judge wrote more than 20 MB"),
        (stumble, "KeyError: 'no\\nsuch'; please report this"),
        (refuse, "bad.toml: answer.M: found 3; expected a list"),
        (quit_python, "SystemExit: enough; please report this"),
        (babble, "the judge's answer cannot be read"),
        (close_and_hang, "the judge stopped: signal 9 (SIGKILL)"),
        (not_finite, "ValueError: Out of range float values are not JSON compliant"),
        (none, "AttributeError: 'NoneType' object has no attribute 'to_json'; please report this"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_what_goes_wrong_is_said_and_the_rest_goes_on(judge, error):
    def some(path):
        return judge(path) if path.stem == "bad" else right(path)

    seconds = SHORT if judge in (hang, spin) else LONG
    begin = time.monotonic()
    reports = list(
        grade_all(
            sheets("a.toml", "bad.toml", "z.toml"), some, jobs=2, seconds=seconds, memory=GIGABYTE
        )
    )
    assert time.monotonic() - begin < LONG / 2
    assert [report.student for report in reports] == ["a", "bad", "z"]
    assert [report.sheet for report in reports] == ["a.toml", "bad.toml", "z.toml"]
    assert reports[1].error.startswith(error)
    assert [bool(report) for report in reports] == [True, False, True]


@pytest.mark.parametrize("jobs", [1, 3, 20])
def test_reports_come_in_the_order_of_the_sheets(jobs):
    def judge(path):
        time.sleep(0.02 * (7 - int(path.stem)) * (jobs > 1))
        return right(path)

    seen = []
    names = [f"{k}.toml" for k in range(8)]
    reports = grade_all(
        sheets(*names), judge, jobs=jobs, progress=lambda done, total: seen.append((done, total))
    )
    assert [report.entries[0].answer for report in reports] == [str(k) for k in range(8)]
    assert seen == [(k + 1, 8) for k in range(8)]


@forking
def test_each_has_a_process_and_no_files_of_its_own(capfd):
    def judge(path):
        print("hello")
        os.system("echo hello; echo hello >&2")
        assert sys.stdin.read() == ""
        import resource

        facts = (
            os.getpid(),
            os.getpgid(0),
            resource.getrlimit(resource.RLIMIT_CORE)[0],
            len(list(Path("/dev/fd").iterdir())),
        )
        return replace(right(path), left_out=tuple(map(str, facts)))

    first, second = grade_all(sheets("a.toml", "b.toml"), judge, jobs=2)
    assert capfd.readouterr() == ("", "")
    pid, group, core, files = map(int, first.left_out)
    assert pid == group != os.getpid()
    assert core == 0
    assert files <= 5  # 0, 1, 2, the pipe, and the folder that is being listed
    assert first.left_out[0] != second.left_out[0]


@forking
def test_a_parent_without_standard_files():
    program = (
        "import os; os.closerange(0, 3)\n"
        "from pathlib import Path\n"
        "from dhkit.grading.batch import grade_all\n"
        "from dhkit.grading.sheets import Sheet\n"
        "from dhkit.grading.grade_report import GradeReport\n"
        "(report,) = grade_all([Sheet(Path('a'))], lambda path: GradeReport('planar2r'))\n"
        "os._exit(7 if report.robot == 'planar2r' else 1)\n"
    )
    assert subprocess.run([sys.executable, "-c", program]).returncode == 7


@forking
def test_what_a_judge_started_ends_with_it(tmp_path):
    def judge(path):
        child = subprocess.Popen(["sleep", str(LONG)])
        (tmp_path / "pid").write_text(str(child.pid))
        time.sleep(LONG)

    (report,) = grade_all(sheets("a.toml"), judge, seconds=0.5)
    assert report.error == "took longer than 0.5 s"
    assert ends(int((tmp_path / "pid").read_text()))


def ends(pid):
    """Whether a process is gone, or no more than an entry that nobody has asked for, within some seconds."""
    for _ in range(1000):
        try:
            os.kill(pid, 0)
            status = Path(f"/proc/{pid}/stat")
            if status.exists() and status.read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.05)
    return False


@forking
def test_later_processes_inherit_what_is_prepared():
    cache = []

    def judge(path):
        return replace(right(path), left_out=tuple(cache))

    reports = grade_all(
        sheets("a.toml", "b.toml", "c.toml"), judge, prepare=lambda r: cache.append(r.student)
    )
    assert [report.left_out for report in reports] == [(), ("a",), ("a", "b")]


@forking
@pytest.mark.parametrize("stop", [KeyboardInterrupt, RuntimeError])
def test_an_interrupt_leaves_no_process_behind(tmp_path, stop):
    def judge(path):
        if path.stem == "a":
            return right(path)
        (tmp_path / "written").write_text(str(os.getpid()))
        (tmp_path / "written").rename(tmp_path / path.stem)  # never seen empty
        time.sleep(LONG)
        return None

    def progress(done, total):
        while not (tmp_path / "b").exists():
            time.sleep(0.01)
        raise stop

    begin = time.monotonic()
    with pytest.raises(stop):
        list(grade_all(sheets("a.toml", "b.toml"), judge, jobs=2, progress=progress))
    assert time.monotonic() - begin < LONG / 2
    assert ends(int((tmp_path / "b").read_text()))


@pytest.mark.slow
@forking
def test_who_is_slow_to_read_makes_nobody_late():
    def judge(path):
        return replace(right(path), left_out=("x" * 1_000_000,))  # more than a pipe holds

    limit = WorkerLimits(seconds=1.0, memory=GIGABYTE)
    reports = grade_all(sheets("a.toml", "b.toml", "c.toml"), judge, jobs=3, seconds=limit.seconds)
    errors = [next(reports).error]
    time.sleep(limit.longest + 0.1)  # the others have written a part and wait
    errors += [report.error for report in reports]
    assert errors == ["", "", ""]


@forking
def test_no_process_to_be_had(monkeypatch):
    monkeypatch.setattr(
        os, "fork", lambda: (_ for _ in ()).throw(BlockingIOError(11, "Resource unavailable"))
    )
    (report,) = grade_all(sheets("a.toml"), right)
    assert report.error == "no process to judge it in: Resource unavailable"


def test_without_fork_in_the_process_itself(monkeypatch):
    monkeypatch.delattr(os, "fork", raising=False)

    def judge(path):
        return (
            stumble(path)
            if path.stem == "b"
            else replace(right(path), left_out=(str(os.getpid()),))
        )

    first, second = grade_all(sheets("a.toml", "b.toml"), judge)
    assert first.left_out == (str(os.getpid()),)
    assert second.error == "KeyError: 'no\\nsuch'; please report this"


def test_limits_that_cannot_be():
    with pytest.raises(ValueError, match="jobs 0"):
        grade_all([], right, jobs=0)


def test_files_are_taken_as_they_are_and_folders_searched(tmp_path):
    for name in (
        "b.toml",
        "a.py",
        "c.txt",
        ".hidden.toml",
        "ada/q1.toml",
        "ada/deep/q2.m",
        ".git/x.toml",
        "one.txt",
    ):
        path = tmp_path / "class" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("[answer]\n")
    folder = tmp_path / "class"
    (folder / "robot.toml").write_text('format = 1\n[[joint]]\ntype = "revolute"\n')
    (folder / "rubric.toml").write_text("points = 10\n")
    found = find_sheets(
        [folder / "one.txt", folder, folder / "b.toml"], exclude=[folder / "rubric.toml"]
    )
    assert [
        (str(sheet.path.relative_to(folder)), sheet.student, sheet.error) for sheet in found
    ] == [
        ("one.txt", "one", ""),
        ("a.py", "a", ""),
        ("ada/deep/q2.m", "ada", ""),
        ("ada/q1.toml", "ada", ""),
        ("b.toml", "b", ""),
        ("c.txt", "c", "not read: .txt; expected .ipynb, .m, .py, .tex, .toml"),
    ]


@pytest.mark.parametrize(
    "name", ["notes.txt", "answer.docx", "scan.PDF", "answer.mlx", "answer", "data.csv", "a.py.bak"]
)
def test_what_is_not_read_is_said(tmp_path, name):
    (tmp_path / "ada").mkdir()
    (tmp_path / "bob").mkdir()
    (tmp_path / "ada" / "answer.toml").write_text("[answer]\n")
    for student in ("ada", "bob"):
        (tmp_path / student / name).write_text("M = 1")
    ada, bob = find_sheets([tmp_path])
    assert ada.beside == (name,) and not ada.error
    assert bob.error.startswith("not read: ") and bob.student == "bob"
    report, unread = grade_all([ada, bob], right)
    assert f"not read: {name}" in report.left_out and unread.verdict is Verdict.UNREADABLE


def test_files_alike_in_name_are_by_their_folders(tmp_path):
    files = [tmp_path / name / "answer.toml" for name in ("ada", "bob")]
    for file in files:
        file.parent.mkdir()
        file.touch()
    assert [sheet.student for sheet in find_sheets(files)] == ["ada", "bob"]
    # What it says itself counts then.
    assert [sheet.student for sheet in find_sheets(files[:1])] == [""]


def test_links_out_of_the_folder_are_not_followed(tmp_path):
    folder = tmp_path / "class"
    (folder / "inner").mkdir(parents=True)
    (tmp_path / "secret.toml").write_text("[answer]\n")
    (tmp_path / "secrets").mkdir()
    (folder / "inner" / "a.toml").write_text("[answer]\n")
    links = {
        "out.toml": "../secret.toml",
        "gone.toml": "nothing",
        "within.toml": "inner/a.toml",
        "self.toml": ".",
    }
    for name, target in (
        links | {"folder": "../secrets", "back": "inner", "passwd": "/etc/passwd"}
    ).items():
        (folder / name).symlink_to(target)
    assert {sheet.path.name: sheet.error for sheet in find_sheets([folder])} == {
        "folder": "a link out of the folder; it is not followed",
        "gone.toml": "a link that leads nowhere",
        "out.toml": "a link out of the folder; it is not followed",
        "within.toml": "",
        "a.toml": "",
        "passwd": "not read: passwd; expected .ipynb, .m, .py, .tex, .toml",
    }
    refused = [report for report in grade_all(find_sheets([folder]), right) if report.error]
    assert [report.verdict for report in refused] == [Verdict.UNREADABLE] * 4


def test_a_link_in_a_students_folder_does_not_lead_to_another_students_sheet(tmp_path):
    for student in ("ann", "bob", "cem"):
        (tmp_path / student).mkdir()
    (tmp_path / "ann" / "sheet.toml").write_text("[answer]\n")
    (tmp_path / "bob" / "sheet.toml").symlink_to("../ann/sheet.toml")
    (tmp_path / "cem" / "own.toml").write_text("[answer]\n")
    (tmp_path / "cem" / "sheet.toml").symlink_to("own.toml")
    errors = {(sheet.student, sheet.path.name): sheet.error for sheet in find_sheets([tmp_path])}
    assert errors == {
        ("ann", "sheet.toml"): "",
        ("bob", "sheet.toml"): "a link out of the folder; it is not followed",
        ("cem", "own.toml"): "",
        ("cem", "sheet.toml"): "",
    }


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_what_is_no_file_and_what_is_too_deep(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "/".join("abcdefghij")).mkdir(parents=True)
    pipe, deep = sorted(find_sheets([tmp_path]), key=lambda sheet: -len(sheet.student))
    assert pipe.error == "not a regular file"
    assert (deep.student, deep.error) == ("a", "nested deeper than 8 folders; not looked into")


def test_no_sheets_and_too_many(tmp_path, monkeypatch):
    with pytest.raises(AnswerError, match="no such file"):
        find_sheets([tmp_path / "none.toml"])
    with pytest.raises(
        AnswerError,
        match=r"no answer sheet; expected files that end in \.ipynb, \.m, \.py, \.tex, \.toml",
    ):
        find_sheets([tmp_path])
    for k in range(4):
        (tmp_path / f"{k}.toml").touch()
    monkeypatch.setattr("dhkit.grading.sheets.BOUNDS", replace(BOUNDS, sheets=3))
    with pytest.raises(AnswerError, match="more than 3 answer sheets"):
        find_sheets([tmp_path])
