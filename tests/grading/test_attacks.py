"""Hostile answers: each is refused or judged in seconds, nothing is executed, the rest of a batch is unharmed."""

import contextlib
import csv
import html.parser
import importlib
import json
import os
import pkgutil
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings, strategies as st

import acceptance
import dhkit.grading
import dhkit.symbolic
from acceptance import only_accepting
from dhkit.cli import main
from dhkit.description import library_robot
from dhkit.errors import AnswerError, DescriptionError, DhkitError
from dhkit.grading import grade
from dhkit.grading.answers.matrices import read_matrix
from dhkit.grading.answers.reading import read_answer
from dhkit.grading.answers.vocabulary import Vocabulary
from dhkit.grading.batch import GIGABYTE, grade_all
from dhkit.grading.entry_points import grade_answers, prepare
from dhkit.grading.grade_report import GradeReport, Verdict
from dhkit.grading.marks import marks
from dhkit.grading.rubric import Rubric
from dhkit.grading.sheets import Sheet, find_sheets
from grading_attacks import (
    A1,
    ADDED,
    CANARY,
    ENDLESS,
    NINE,
    OBJECTS,
    REFUSED,
    RIGHT_V,
    ROBOTS,
    SECRET,
    SHEETS,
    SLOW,
    SOURCES,
    TOUCH,
    WRONG,
    made,
    quoted,
    sheet,
    symbolic,
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="no os.fork: no attack is stopped there"),
]

PLANAR = library_robot("planar2r")
SECONDS = 20.0
"""What the bounds of reading and judging leave of any one attack; the limits of `dhkit grade` lie far above."""
MEMORY = GIGABYTE
LONGEST = 1_000
"""Characters of an error that is still clear."""
EXECUTED = 86
"""Exit status of a process in which something was executed, written or read that never may be."""

FORBIDDEN = [
    "os.system",
    "os.exec",
    "os.fork",
    "os.forkpty",
    "os.posix_spawn",
    "os.spawn",
    "os.remove",
    "os.rename",
    "os.rmdir",
    "os.mkdir",
    "os.chmod",
    "os.symlink",
    "os.link",
    "os.kill",
    "os.putenv",
    "subprocess.Popen",
    "pty.spawn",
    "shutil.rmtree",
    "socket.connect",
    "socket.bind",
    "webbrowser.open",
    "pickle.find_class",
    "code.__new__",
    "builtins.input",
    "ctypes.dlopen",
]


@pytest.fixture(scope="module", autouse=True)
def prepared():
    """Import and compile all that judging needs: later an import is not a disguise for an attack's code."""
    prepare(PLANAR)
    V = f"{RIGHT_V} + 0.12345*m1"
    inverse = {"branches": [["atan2(py, px) - acos(px)", "acos(py)"]]}
    table = {"rows": [["q1", "0", "l1", "0"], ["q2 + 1", "0", "2*l2", "0"]]}
    for answers in (
        {"V": V},
        {"V": "m1"},
        {"V": f"sqrt(m1^2) + {RIGHT_V}"},
        {"ik": inverse},
        {"dh": table},
    ):
        grade_answers(PLANAR, answers)
    for package in (dhkit.grading, dhkit.symbolic):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    for library in ("casadi", "sympy.printing"):
        importlib.import_module(library)
    SECRET.write_text('format = 1\nname = "secret"\n')
    yield
    SECRET.unlink()
    assert not CANARY.exists()


def watch(may_fork=False):
    """End this process if anything is executed, started, written or spied on."""
    allowed = ("__pycache__", os.environ.get("DHKIT_CACHE_DIR", "__pycache__"), os.devnull)

    def hook(event, arguments):
        if event in FORBIDDEN and not (may_fork and event in ("os.fork", "os.kill")):
            os._exit(EXECUTED)
        if event in ("compile", "exec"):
            code = (
                arguments[1]
                if event == "compile"
                else getattr(arguments[0], "co_filename", "<string>")
            )
            if str(code).startswith("<") and not str(code).startswith("<frozen"):
                os._exit(EXECUTED)
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            path, flags = os.fsdecode(arguments[0]), arguments[2] or 0
            writes = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) and not any(
                place in path for place in allowed
            )
            if writes or SECRET.name in path or path.startswith("/etc/pass"):
                os._exit(EXECUTED)

    sys.addaudithook(hook)


def judged(judge, seconds=SECONDS, memory=MEMORY, may_fork=False):
    """Return the report of a judge that is watched, in a process with limits."""

    def watched(path):
        watch(may_fork)
        try:
            return judge()
        except (AnswerError, DescriptionError):
            raise
        except DhkitError as error:
            raise RuntimeError(f"{type(error).__name__}: {error}") from None

    (report,) = grade_all([Sheet(Path("sheet"))], watched, seconds=seconds, memory=memory)
    return report


def check(report):
    """Hold a report to what any attack must end in: a verdict, or an error in a line."""
    assert f"status {EXECUTED}" not in report.error, "something was executed, written or spied on"
    for fault in ("took longer than", "needed more than", "the judge ", "please report this"):
        assert fault not in report.error, report.error
    assert report.error == "" or report.verdict is Verdict.UNREADABLE
    assert report.error.isprintable() and len(report.error) <= LONGEST, report.error[:200]
    assert bool(report.error) or report.entries


# The watch itself


@pytest.mark.parametrize(
    "crime",
    [
        lambda: eval("1 + 1"),
        lambda: exec("x = 1"),
        lambda: compile("1 + 1", "<answer>", "eval"),
        lambda: os.system("true"),
        lambda: subprocess.run(["true"], check=True),
        lambda: CANARY.write_text("x"),
        lambda: CANARY.mkdir(),
        lambda: SECRET.read_text(),
        lambda: Path("/etc/passwd").read_text(),
    ],
)
def test_the_watch_sees_what_is_done(crime):
    assert judged(lambda: crime() and None).error == f"the judge stopped: status {EXECUTED}"
    assert not CANARY.exists()


def test_the_watch_lets_honest_answers_pass():
    assert judged(lambda: grade_answers(PLANAR, {"V": RIGHT_V})).verdict is Verdict.CORRECT


# Entries


FLOODS = frozenset(
    [
        *(
            "closing braces",
            "closing brackets",
            "LaTeX braces",
            "transposes of a matrix",
            "many spaces",
        ),
        *("rows of rows", "many semicolons", "table of long sums", "names that flood a name"),
        *("names that flood an entry", "long key"),
        *(
            "Python's assignments",
            "LaTeX's dollars",
            "LaTeX's brackets",
            "LaTeX's rows",
            "LaTeX's comments",
        ),
    ]
)
"""Attacks of half a second and more whose runs are ten times as long as their refusal needs."""
RUN = re.compile(r"(.{1,60}?)\1{999,}", re.DOTALL)


def attack(name, value):
    """Return what an attack is; outside `make accept` the runs of a flood are a tenth as long."""
    value = made(value)
    if acceptance.ACCEPTING or name not in FLOODS:
        return value
    return RUN.sub(lambda run: run[1] * (len(run[0]) // len(run[1]) // 10), value)


TRIED = ("large power", "power of nine", "negative power", "cosine of many", "cosine of too many")


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_answer_is_refused(name):
    report = judged(lambda: grade_answers(PLANAR, {"V": attack(name, REFUSED[name])}))
    check(report)
    # What is too long for the exact ring is tried at random states: one that differs is wrong.
    assert report.verdict is (Verdict.WRONG if name in TRIED else Verdict.UNREADABLE)


@only_accepting
@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_found_so_in_seconds(name):
    report = judged(lambda: grade_answers(PLANAR, {"V": WRONG[name]}))
    check(report)
    assert report.verdict in (Verdict.WRONG, Verdict.UNREADABLE)


@only_accepting
@pytest.mark.parametrize("name", SLOW)
def test_what_is_right_and_slow_is_judged_or_refused(name):
    report = judged(lambda: grade_answers(PLANAR, {"V": SLOW[name]}))
    check(report)
    assert report.verdict in (Verdict.UNDECIDED, Verdict.UNREADABLE)


@pytest.mark.parametrize("notation", ["text", "matrix", "table", "inverse", "name"])
def test_code_is_refused_wherever_it_stands(notation):
    code = f"__import__('os').system('{TOUCH}')"
    answers, names = {
        "text": ({"K": code}, {}),
        "matrix": ({"M": f"Matrix([[{code}, 1], [1, 1]])"}, {}),
        "table": ({"dh": {"rows": [["q1", code, "l1", "0"], ["q2", "0", "l2", "0"]]}}, {}),
        "inverse": ({"ik": {"branches": [["q2", code]]}}, {}),
        "name": ({"V": "a"}, {"parameters": {"a": code}}),
    }[notation]
    report = judged(lambda: grade_answers(PLANAR, answers, names))
    check(report)
    assert report.verdict is Verdict.UNREADABLE


# Sheets, programs, robots


@pytest.fixture
def folder():
    """A folder beside the secret."""
    path = Path(tempfile.mkdtemp(prefix="dhkit-attack-"))
    yield path
    shutil.rmtree(path)


def written(path, text):
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "replace"))
    return path


@pytest.mark.parametrize("name", SHEETS)
def test_hostile_sheets_are_unreadable_or_wrong(folder, name):
    path = written(folder / "sheet.toml", attack(name, SHEETS[name]))
    report = judged(lambda: grade(path))
    check(report)
    assert report.verdict in (Verdict.WRONG, Verdict.UNREADABLE)


@pytest.mark.parametrize("name", ADDED)
def test_sheets_with_more_than_answers_are_judged(folder, name):
    path = written(folder / "sheet.toml", ADDED[name])
    check(judged(lambda: grade(path)))


@pytest.mark.parametrize("name", SOURCES)
def test_hostile_programs_are_unreadable_or_wrong(folder, name):
    suffix, text = SOURCES[name]
    path = written(folder / f"sheet{suffix}", attack(name, text))
    report = judged(lambda: grade(path, PLANAR))
    check(report)
    assert report.verdict in (Verdict.WRONG, Verdict.UNREADABLE)


@pytest.mark.parametrize("name", ROBOTS)
def test_hostile_robots_are_refused_or_judged_by(folder, name):
    text, answer = ROBOTS[name]
    written(folder / "robot.toml", text)
    path = written(folder / "sheet.toml", sheet(answer, "robot.toml"))
    check(judged(lambda: grade(path)))


@only_accepting
@pytest.mark.parametrize("name", ENDLESS)
def test_endless_robots_cost_their_sheet_alone(folder, name):
    text, answer = ENDLESS[name]
    written(folder / "robot.toml", text)
    written(folder / "a.toml", sheet(answer, "robot.toml"))
    written(folder / "b.toml", sheet(f"V = {quoted(RIGHT_V)}"))
    begin = time.monotonic()
    attack, honest = grade_all(find_sheets([folder]), grade, jobs=2, seconds=5.0, memory=MEMORY)
    assert time.monotonic() - begin < 2 * SECONDS
    assert attack.verdict in (Verdict.WRONG, Verdict.UNREADABLE)
    assert (
        attack.error.isprintable()
        and len(attack.error) <= LONGEST
        and "please report" not in attack.error
    )
    assert honest.verdict is Verdict.CORRECT


def test_what_is_no_regular_file_is_not_read(folder):
    os.mkfifo(folder / "pipe.toml")
    (folder / "device.toml").symlink_to("/dev/zero")
    (folder / "secret.toml").symlink_to(SECRET)
    (folder / "loop.toml").symlink_to("loop.toml")
    (folder / "folder.toml").mkdir()
    for name in ("pipe", "device", "folder"):
        path = folder / f"{name}.toml"
        assert "not a regular file" in judged(lambda path=path: grade(path)).error
    found = {each.path.stem: each.error for each in find_sheets([folder])}
    assert set(found) == {"pipe", "device", "secret", "loop"}
    assert all(found.values())


@pytest.mark.parametrize("kind", ["pipe", "device", "secret", "loop", "folder", "inside"])
def test_robots_that_are_no_files_of_the_folder(folder, kind):
    robot = folder / "robot.toml"
    match kind:
        case "pipe":
            os.mkfifo(robot)
        case "folder":
            robot.mkdir()
        case "inside":
            (folder / "inner").symlink_to(SECRET.parent)
            robot = f"inner/{SECRET.name}"
        case _:
            robot.symlink_to({"device": "/dev/zero", "secret": SECRET, "loop": robot}[kind])
    name = robot if isinstance(robot, str) else robot.name
    path = written(folder / "sheet.toml", sheet(A1, name))
    report = judged(lambda: grade(path))
    check(report)
    assert report.verdict is Verdict.UNREADABLE


# Objects


@pytest.mark.parametrize("name", OBJECTS)
def test_hostile_objects_are_unreadable_or_wrong(name):
    try:
        answer = OBJECTS[name]()
    except RecursionError:
        pytest.skip("not even made")
    # A function is called in a process of its own.
    report = judged(lambda: grade_answers(PLANAR, {"V": answer}), may_fork=callable(answer))
    check(report)
    assert report.verdict in (Verdict.WRONG, Verdict.UNREADABLE)


# A class


RIGHT_A1 = (
    "[['cos(q1)', '-sin(q1)', '0', 'l1*cos(q1)'], ['sin(q1)', 'cos(q1)', '0', 'l1*sin(q1)'], "
    "['0', '0', '1', '0'], ['0', '0', '0', '1']]"
)
HONEST = {
    "ada": (sheet(f"V = {quoted(RIGHT_V)}"), Verdict.CORRECT),
    "bea": (sheet(f"V = {quoted(RIGHT_V)}\nA1 = {RIGHT_A1}"), Verdict.CORRECT),
    "cem": (sheet(f"V = {quoted('-(' + RIGHT_V + ')')}"), Verdict.WRONG),
    "dan": (sheet(f"V = {quoted(RIGHT_V + ' + 5')}"), Verdict.CORRECT),
    "eva": (sheet(f"V = {quoted(RIGHT_V)}\nK = 'm1'"), Verdict.WRONG),
}

TAGS = {
    "formula": "student = \"=cmd|'/c calc'!A1\"",
    "at": 'student = "@SUM(1+1)*cmd"',
    "tab": 'student = "\\t=1+1"',
    "script": 'student = "</title><script>alert(1)</script>"',
    "image": 'student = "\\"><img src=x onerror=alert(1)>"',
    "escape": 'student = "\\u001b[2J\\u001b]0;pwned\\u0007\\r\\nada"',
    "path": 'student = "../../../../tmp/x"',
    "markup": 'student = "[link=javascript:alert(1)]bob[/link]"',
}
ATTACKERS = {
    **{
        f"tag-{name}.toml": sheet('V = "<script>alert(1)</script>"', more=tag)
        for name, tag in TAGS.items()
    },
    "code.toml": sheet(f"V = {quoted(REFUSED['import'])}"),
    "bomb.toml": sheet(f"V = '{NINE}^60'"),
    "large.toml": attack("names that flood an entry", SHEETS["names that flood an entry"]),
    "exponentials.toml": sheet("V = 'exp(exp(exp(1e9)))'"),
    "link.toml": sheet(r"V = '\href{javascript:alert(1)}{m_1}'"),
    "answer.toml": sheet(
        'V = "[bold]m1[/bold] \\u001b[2J <img src=x onerror=alert(1)>"\nK = "=cmd|\'/c calc\'!A1"'
    ),
    "=1+1.toml": sheet('V = "m1"'),
    "=cmd|'calc'!A1.toml": sheet('V = "m1"'),
    "<b onmouseover=alert(1)>.toml": sheet('V = "m1"'),
    "javascript:alert(1).toml": sheet('V = "m1"'),
    "\x1b[31mred\n\x07.toml": sheet('V = "m1"'),
    "-o.toml": sheet('V = "m1"'),
    "@SUM(1+1)/answer.toml": sheet('V = "zzz"'),
    "endless/answer.toml": sheet('V = "1"', "robot.toml"),
    "endless/robot.toml": symbolic(32 if acceptance.ACCEPTING else 12),
    "paper.tex": "\\input{/etc/passwd}",
}


def graded(folder, out, *options):
    """Return what the command says, and its status."""
    command = [
        sys.executable,
        "-m",
        "dhkit",
        "grade",
        str(folder),
        "--jobs",
        "2",
        "--seconds",
        str(SECONDS),
    ]
    environment = {**os.environ, "DHKIT_ATTACKED": "no"}
    return subprocess.run(
        [*command, "-o", str(out), *options],
        capture_output=True,
        cwd=folder.parent,
        env=environment,
        timeout=300,
    )


def graded_here(folder, *options):
    """Run the command in this process; return its status."""
    with pytest.raises(SystemExit) as end:
        main(["grade", str(folder), "--jobs", "2", *map(str, options)])
    return end.value.code


@pytest.fixture(scope="module")
def classroom(tmp_path_factory):
    """A class of honest and hostile sheets, judged by the command."""
    root = tmp_path_factory.mktemp("school")
    folder = root / "class"
    for name, text in {
        **{f"{name}.toml": text for name, (text, _) in HONEST.items()},
        **ATTACKERS,
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        written(folder / name, text)
    (folder / "secret.toml").symlink_to(SECRET)
    os.mkfifo(folder / "pipe.toml")
    before = sorted(str(path) for path in root.rglob("*"))
    done = graded(folder, root / "out")
    after = sorted(
        str(path) for path in root.rglob("*") if root / "out" not in (path, *path.parents)
    )
    assert before == after
    return root, done


def rows_of(root):
    with (root / "out" / "marks.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_command_ends_well(classroom):
    _, done = classroom
    assert done.returncode == 2
    assert b"Traceback" not in done.stderr + done.stdout
    assert not CANARY.exists()


def test_the_honest_have_their_marks(classroom):
    root, _ = classroom
    rows = {row["student"]: row for row in rows_of(root)}
    for name, (_, verdict) in HONEST.items():
        alone = grade(root / "class" / f"{name}.toml")
        assert alone.verdict is verdict
        assert (rows[name]["verdict"], rows[name]["error"]) == (verdict.value, "")
        assert float(rows[name]["points"]) == pytest.approx(
            marks(alone, Rubric()).points, abs=0.005
        )
        assert (root / "out" / "students" / f"{name}.html").is_file()


def test_each_attack_has_a_row_and_none_is_right(classroom):
    root, _ = classroom
    rows = rows_of(root)
    hostile = [row for row in rows if row["student"] not in HONEST]
    sheets = len(ATTACKERS) - 1 + 2  # one is a robot; a link and a pipe
    assert len(rows) == len(HONEST) + sheets
    assert {row["verdict"] for row in hostile} == {"wrong", "unreadable"}
    assert all(row["error"] for row in hostile if row["verdict"] == "unreadable")
    assert not [row for row in hostile if "please report" in row["error"]]


def test_no_cell_is_computed(classroom):
    root, _ = classroom
    with (root / "out" / "marks.csv").open(newline="") as file:
        cells = [cell for row in csv.reader(file) for cell in row]
    assert any("=cmd" in cell for cell in cells)
    number = re.compile(r"[+-]?\d+(\.\d+)?")
    assert not [
        cell
        for cell in cells
        if cell.strip()[:1] in tuple("=+-@|%\t\r") and cell and not number.fullmatch(cell)
    ]
    assert all(cell.isprintable() for cell in cells)


class Page(html.parser.HTMLParser):
    """What of a page could do something."""

    HARMLESS = frozenset(
        [
            "html",
            "head",
            "meta",
            "title",
            "style",
            "body",
            "h1",
            "h2",
            "h3",
            "p",
            "span",
            "div",
            "table",
            "thead",
            "tbody",
            "tr",
            "th",
            "td",
            "details",
            "summary",
            "article",
            "code",
            "ul",
            "li",
            "math",
            "mrow",
            "mi",
            "mn",
            "mo",
            "mtext",
            "mspace",
            "mfrac",
            "msqrt",
            "mroot",
            "msub",
            "msup",
            "msubsup",
            "munder",
            "mover",
            "munderover",
            "mtable",
            "mtr",
            "mtd",
            "mstyle",
            "mpadded",
            "mphantom",
            "menclose",
            "b",
            "strong",
            "em",
            "small",
            "pre",
            "section",
            "header",
            "footer",
            "br",
            "hr",
            "i",
            "a",
            "svg",
            "rect",
            "line",
            "text",
        ]
    )

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attributes):
        if tag not in self.HARMLESS:
            self.found.append(tag)
        for name, value in attributes:
            if name == "style" and not re.fullmatch(r"width: ?[\d.]+%", value or ""):
                self.found.append((tag, name, value))
            if name.startswith("on") or name in ("src", "srcdoc", "formaction", "action"):
                self.found.append((tag, name, value))
            if name in ("href", "xlink:href") and not re.fullmatch(r"#?[\w./%-]*", value or ""):
                self.found.append((tag, name, value))
            if ":" in (value or "") and tag != "meta" and name not in ("class", "style"):
                self.found.append((tag, name, value))


def test_no_page_does_anything(classroom):
    root, _ = classroom
    pages = list((root / "out").rglob("*.html"))
    assert len(pages) == len(rows_of(root)) + 1
    for path in pages:
        text = path.read_text()
        page = Page()
        page.feed(text)
        assert page.found == [], path
        assert "Content-Security-Policy" in text
        assert all(character.isprintable() or character == "\n" for character in text), path


def test_the_terminal_is_commanded_by_nobody(classroom):
    _, done = classroom
    for stream in (done.stdout, done.stderr):
        assert all(character.isprintable() or character == "\n" for character in stream.decode())


def test_names_of_files_stay_in_the_folder(classroom):
    root, _ = classroom
    assert {path.name for path in (root / "out").iterdir()} == {
        "students",
        "records",
        "marks.csv",
        "class.html",
    }
    for path in (root / "out").rglob("*"):
        assert re.fullmatch(r"[\w.-]+", path.name), path
        assert not path.name.startswith("."), path
    names = {path.stem for path in (root / "out" / "records").iterdir()}
    assert names == {path.stem for path in (root / "out" / "students").iterdir()}
    for path in (root / "out" / "records").iterdir():
        json.loads(path.read_text())


@pytest.mark.parametrize(
    "attack",
    ["file that is not UTF-8", "long student", "long student of wide letters", "half a letter"],
)
def test_no_name_ends_a_batch(tmp_path, capfdbinary, attack):
    folder = tmp_path / "class"
    folder.mkdir()
    written(folder / "ada.toml", HONEST["ada"][0])
    match attack:
        case "file that is not UTF-8":
            written(
                Path(os.fsdecode(os.fsencode(folder / "bad") + b"\xff.toml")), sheet('V = "m1"')
            )
        case "long student":
            written(folder / "long.toml", sheet('V = "m1"', more=f'student = "{"x" * 3_000_000}"'))
        case "long student of wide letters":
            written(
                folder / "long.toml", sheet('V = "m1"', more=f'student = "{chr(0x1D4B3) * 300}"')
            )
        case "half a letter":
            cells = [{"cell_type": "code", "source": "\ud800 = 1\nV = \ud800"}]
            written(folder / "half.ipynb", json.dumps({"cells": cells}))
    robot = ("--robot", "planar2r") if attack == "half a letter" else ()
    assert graded_here(folder, "-o", tmp_path / "out", *robot) in (1, 2), (
        capfdbinary.readouterr().err.decode()
    )
    rows = rows_of(tmp_path)
    assert len(rows) == 2
    assert next(row for row in rows if row["student"] == "ada")["verdict"] == "correct"


@pytest.mark.parametrize("form", ["text", "json", "junit", "html"])
def test_every_form_of_a_hostile_class_can_be_written(tmp_path, capfdbinary, form):
    folder = tmp_path / "class"
    folder.mkdir()
    for name in ("tag-escape.toml", "tag-script.toml", "answer.toml", "\x1b[31mred\n\x07.toml"):
        written(folder / name, ATTACKERS[name])
    assert graded_here(folder, "--format", form) == 2
    written_out, errors = capfdbinary.readouterr()
    assert errors == b""
    assert all(character.isprintable() or character == "\n" for character in written_out.decode())


def test_a_student_is_told_apart_from_another_of_that_name(tmp_path):
    """Who writes another's name on a sheet gets a page of his own: none is overwritten."""
    folder = tmp_path / "class"
    folder.mkdir()
    written(folder / "ada.toml", HONEST["ada"][0])
    written(folder / "bob.toml", sheet('V = "m1"', more='student = "ada"'))
    assert graded_here(folder, "-o", tmp_path / "out") == 1
    assert sorted(row["verdict"] for row in rows_of(tmp_path)) == ["correct", "wrong"]
    assert len(list((tmp_path / "out" / "students").iterdir())) == 2


def test_a_report_of_strangers_texts_survives_its_process():
    odd = replace(GradeReport("x"), student="\ud800\x00\x1b", left_out=("\udcff",))
    (report,) = grade_all([Sheet(Path("sheet"))], lambda path: odd)
    assert report.to_json().encode()


# The fuzz

GOOD = (
    RIGHT_V,
    "m1*l1^2/3 + m2*(l1**2 + l1*l2*cos(q2) + l2^2/3)",
    "1/2*m1*(l1/2)^2*th1d**2 + 0.5*m2*qd2^2",
    "-m2*l1*l2/2*sin(theta2)*(2*dq1*dq2 + dq2^2)",
    "np.sin(q[0]) + math.sqrt(l1**2 + l2**2) - sp.Rational(1, 2)*m1",
    "m1.*l1.^2./4 + q1' - 3.5e-2",
    "sin^2(q1) + cos q2 + 2 sin q1 cos q2 + c12 s1 + c_{1-2}",
    r"\frac{1}{2} m_1 \left(\frac{l_1}{2}\right)^2 \dot\theta_1^2 + m_2 g l_1 \sin\theta_1",
    r"\frac12 m_2 l_1 l_2 \cos(\theta_1 + \theta_2) \ddot{\theta}_{2} - \sqrt{l_1^2} \cdot s_{12}",
    "½ m₁ l₁² θ̇₁² − m₂·g·l₁ × sin(θ₁)",
    "diff(theta1(t), t)**2 + Derivative(q2, (t, 2)) + atan2(m1, l1) + abs(-l1) + min(q1, q2)",
    "sec(q1)*tand(30) + deg2rad(45) + pow(m1, 2) + exp(-q1)",
    "[[m1, l1], [q1, cos(q2)]]",
    "[m1 l1; q1 -cos(q2)]",
    "Matrix([[m1, l1*cos(q1)], [0, 1]])",
    r"\begin{pmatrix} m_1 & l_1 \\ q_1 & \cos q_2 \end{pmatrix}",
    "np.array([[m1, 0.5], [1e-3, q2]]).T",
)
PIECES = (
    *"+-*/^()[]{},;.&'\"\\_$%#=:<>|!?~@ \n\t\0\x1b",
    *(
        "**",
        "\\\\",
        ".*",
        "./",
        ".^",
        "1e",
        "e9",
        "0x1f",
        ".5",
        "5.",
        "..",
        "9**9",
        "^(-1)",
        "^(1/2)",
        "1/0",
        "0*",
        "(q1-q1)",
    ),
    *(
        "q1",
        "qdd2",
        "m1",
        "pi",
        "deg",
        "g",
        "c12",
        "s_{1+2}",
        "q[0]",
        "q(2)",
        "(t)",
        "nan",
        "inf",
        "lambda",
        "import",
    ),
    *(
        "sin",
        "cos ",
        "tan(",
        "atan2(1,",
        "sqrt",
        "abs(",
        "sign(",
        "exp(",
        "min(1,",
        "Rational(",
        "S(",
        "diff(",
        "cot(",
    ),
    *(
        "\\frac",
        "\\frac{1}",
        "\\sqrt{",
        "\\dot",
        "\\ddot{",
        "\\left(",
        "\\right.",
        "\\mathrm{",
        "\\text{a}",
        "\\begin{bmatrix}",
    ),
    *(
        "\\end{bmatrix}",
        "\\cdot",
        "\\theta",
        "\\quad",
        "_{1",
        "^{",
        "θ",
        "ω̇",
        "²",
        "⁻¹",
        "½",
        "−",
        "ｍ",
        "а",
        "\u202e",
        "\ud800",
        "😀",
        "\u0301",
    ),
    *(
        "[answer]\n",
        "[names]\n",
        "V = ",
        "M = [",
        "true",
        "''",
        '"""',
        "{ a = 1 }",
        "a.b.c = 1\n",
        "1979-05-27",
        "0b1",
        "+inf",
    ),
    *(
        "import os\n",
        "V = m1\n",
        "M11 = ",
        "h(1) = ",
        "...\n",
        "%",
        "\\[ V = ",
        "\\]",
        '{"cells": [',
        '"source":',
        "\\u0000",
    ),
)
SHEETS_FOLDER = Path(__file__).parent / "sheets"
CORPUS = sorted(
    path
    for path in (SHEETS_FOLDER / "planar2r").iterdir()
    if path.suffix in (".toml", ".py", ".m", ".tex", ".ipynb")
)
LASTS = 300.0
"""Seconds by the clock that `make accept` goes on for."""
EACH = 60
"""Seconds after which an example is one that hangs."""
VOCABULARY = Vocabulary(PLANAR)


@st.composite
def mutations(draw, good):
    """A good text with a few pieces put in, taken out, doubled, exchanged, or taken from another."""
    text = draw(st.sampled_from(good))
    for _ in range(draw(st.integers(1, 6))):
        a, b = sorted((draw(st.integers(0, len(text))), draw(st.integers(0, len(text)))))
        b = min(b, a + 40)
        match draw(st.integers(0, 6)):
            case 0 | 1:
                text = text[:a] + draw(st.sampled_from(PIECES)) + text[a:]
            case 2:
                text = text[:a] + text[b:]
            case 3:
                text = text[:a] + text[a:b] * draw(st.integers(2, 60)) + text[b:]
            case 4:
                other = draw(st.sampled_from(good))
                text = text[:a] + other[draw(st.integers(0, len(other))) :]
            case 5:
                text = (
                    text[:a] + draw(st.sampled_from(PIECES)) * draw(st.integers(2, 60)) + text[b:]
                )
            case 6:
                text = text[:a] + draw(st.text(max_size=4)) + text[b:]
    return text


def of_suffix(suffix):
    texts = [path.read_text() for path in CORPUS if path.suffix == suffix]
    return texts or [sheet(f"V = {quoted(RIGHT_V)}")]


PROGRAMS = {
    ".py": [
        "import numpy as np\nV = m1*l1 # a\nM = np.array([[1, 2],\n [3, 4]])\nh1 = V\nh2 = 2\n"
    ],
    ".m": [
        "% a\nsyms q1 q2\nV = m1*l1;\nM(1,1) = 2; M(1,2) = ...\n 3; M(2,2) = 4\ng = [m1; l1];\n"
    ],
    ".tex": [
        "\\begin{align}\nV &= m_1 l_1 \\\\\nM &= \\begin{bmatrix} 1 & 2 \\\\ 2 & q_1 \\end{bmatrix}\n\\end{align}\n"
    ],
    ".ipynb": [
        json.dumps(
            {"cells": [{"cell_type": "code", "source": ["V = m1\n", "K = 2"]}], "metadata": {}}
        )
    ],
}
CASES = st.one_of(
    st.tuples(st.just("entry"), mutations(GOOD)),
    st.tuples(st.just("entry"), st.text(max_size=60)),
    st.tuples(st.just("judged"), mutations(GOOD[:-5])),
    st.tuples(
        st.just("inverse"),
        mutations((*GOOD[:-5], "atan2(py, px)", "acos((px^2+py^2-l1^2-l2^2)/(2*l1*l2)) + q1")),
    ),
    st.tuples(st.just("table"), mutations(("q1", "q1 + pi/2", "l1*2", "-pi/2", "atan2(l1, l2)"))),
    st.tuples(st.just(".toml"), mutations(of_suffix(".toml"))),
    *(
        st.tuples(st.just(suffix), mutations([*texts, *of_suffix(suffix)]))
        for suffix, texts in PROGRAMS.items()
    ),
)


def tried(kind, text):
    """Read a text, and judge what can be read: only an AnswerError, of a robot a DescriptionError, comes out."""
    if kind == "entry":
        for read in (read_answer, read_matrix):
            with contextlib.suppress(AnswerError):
                read(text, VOCABULARY)
    elif kind in ("judged", "inverse", "table"):
        rows = {"rows": [[text, "0", "l1", "0"], ["q2", "0", "l2", "0"]]}
        answers = {
            "judged": {"V": text},
            "inverse": {"ik": {"branches": [[text, "q1"]]}},
            "table": {"dh": rows},
        }
        try:
            report = grade_answers(PLANAR, answers[kind])
        except AnswerError:
            pass
        else:
            assert report.entries and report.to_json()
    else:
        with tempfile.TemporaryDirectory(prefix="dhkit-fuzz-") as folder:
            path = written(Path(folder) / f"sheet{kind}", text)
            try:
                report = grade(path, PLANAR) if kind != ".toml" else grade(path)
            except (AnswerError, DescriptionError):
                pass
            else:
                assert report.entries and report.to_json()


def hangs(number, frame):
    raise RuntimeError(f"an example took longer than {EACH} s")


def fuzz(number, examples):
    """Try examples of one seed; return how many, and the longest that one took, in seconds."""
    times = []

    @seed(number)
    @settings(
        deadline=None,
        database=None,
        derandomize=False,
        max_examples=examples,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate, Phase.shrink),
    )
    @given(CASES)
    def holds(case):
        begin = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, EACH)
        try:
            tried(*case)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
            times.append(time.process_time() - begin)

    holds()
    return len(times), max(times)


def test_no_exception_but_an_answer_error_comes_out(law):
    before = signal.signal(signal.SIGPROF, hangs)
    begin, count, number = time.monotonic(), 0, 0
    try:
        while number == 0 or (acceptance.ACCEPTING and time.monotonic() - begin < LASTS):
            tries, longest = fuzz(number, 300)
            count, number = count + tries, number + 1
            law.takes("seconds that one hostile text takes", longest, EACH)
    finally:
        signal.signal(signal.SIGPROF, before)
    law.size = count
    law.holds("exceptions other than AnswerError", 0, 0)


# Random tokens, which are no file of anybody: short statements reach places that edited files seldom do.

TOKENS = {
    ".m": "= M ( 1 , ) [ ] ; += ++ m1 * l1 ' syms function end ... { } . g V : @ if for ~ % - && == clear q(1)",
    ".py": '= M ( 1 , ) [ ] += m1 * l1 return . V g : if # " == ** @ with %time x lambda import for in def',
    ".tex": r"= M { } \begin{align} \end{align} & \\ _ ^ m_1 \frac \dot V $$ \left( \right) \newcommand \[ \] g 1 , +",
}
KNOWN_TOKENS = [
    (".m", " = m1*l1;\n"),
    (".m", "q(1) += ,"),
    (".m", "M(2,) = 4\nV(,q1) = m1\n[M, g] = deal(1,,2)"),
    (".m", "++ M * function \n q(1) += ; ="),
    (".tex", r"\begin{align} V &= $$\end{align}"),
]


def random_tokens(count, seed):
    rng = random.Random(seed)
    for _ in range(count):
        suffix = rng.choice(sorted(TOKENS))
        tokens = rng.choices(TOKENS[suffix].split(), k=rng.randint(1, 14))
        text = "".join(token + rng.choice(" \n") for token in tokens)
        yield (
            suffix,
            rf"\begin{{align}} V &= {text}\end{{align}}"
            if suffix == ".tex" and rng.random() < 0.7
            else text,
        )


def test_random_tokens_are_answers_or_are_refused(law, tmp_path):
    cases = [*KNOWN_TOKENS, *random_tokens(law.samples(100_000, quick=100), seed=4)]
    for suffix, text in cases:
        path = tmp_path / f"answer{suffix}"
        path.write_text(text)
        with contextlib.suppress(AnswerError):
            grade(path, PLANAR, explain=False)
