"""Programs that do harm, lie or dawdle: the parent says what happened and on which line; nothing is left behind."""

# ruff: noqa: E501 - programs in one line

import os
import socket
import sys
import tempfile
import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from shutil import copytree, ignore_patterns

import numpy as np
import psutil
import pytest

import dhkit.arm
from acceptance import ACCEPTING
from conftest import require
from dhkit import Arm
from dhkit.execution import (
    child as child_module,
    isolated_commands,
    isolation as isolation_module,
    other_user,
)
from dhkit.execution.bubblewrap import package_paths
from dhkit.execution.isolation import Isolation, IsolationError, Kind, find_isolation
from dhkit.execution.process import Failure, Limits, ProgramError
from dhkit.programs import check
from dhkit.programs.bounds import BOUNDS
from dhkit.programs.caller import Caller
from dhkit.programs.program import Program
from waiting import HANGS, wait_for

NAMED = "DHKIT_TEST_PROCESS"
LIMITS = Limits(seconds=1.0, memory=400 << 20)
SLEEPERS = "stops itself", "ignores signals"
VIOLENT = (
    "allocates",
    "crashes",
    "is a fork bomb",
    "floods",
    "closes its answers",
    "stops itself",
    "ignores signals",
)
"""After these a program is started anew; after all of them another one runs on."""
UNPROTECTED = Isolation(Kind.NONE, "as a test wants it")
isolated = pytest.mark.skipif(not find_isolation(), reason=f"{find_isolation()}")
SHORT = Limits(seconds=0.5, memory=400 << 20)
"""For programs that only wait: they are late after four times as long on the clock."""

HARMFUL = {
    "loops": ("def fk(q):\n    while True:\n        pass\n", "late", "no answer within 1 s of processor time"),
    "allocates": ("import numpy as np\ndef fk(q):\n    x = []\n    while True:\n        x.append(np.ones(10**6))\n", "memory", "0.391 GB"),
    "allocates 10 GB at once": ("import numpy as np\ndef fk(q):\n    return np.ones(10**10 // 8)\n", "raised", "line 3: MemoryError"),
    "exits": ("import sys\ndef fk(q):\n    sys.exit(3)\n", "raised", "line 3: SystemExit: 3"),
    "exits at once": ("import os\ndef fk(q):\n    os._exit(3)\n", "ended", "the program ended with status 3"),
    "raises": ("def fk(q):\n\n    return 1 / 0\n", "raised", "line 3: ZeroDivisionError: division by zero"),
    "crashes": ("import ctypes\ndef fk(q):\n    ctypes.string_at(0)\n", "ended", "by SIGSEGV"),
    "recurses": ("def fk(q):\n    return fk(q)\n", "raised", "line 2: RecursionError"),
    "is a fork bomb": ("import os\ndef fk(q):\n    while True:\n        os.fork()\n", None, "needed more than|started more than"),
    "writes garbage": ("import os\nos.write(4, b'hello\\n')\ndef fk(q):\n    return 1.0\n", "garbage", "not an answer"),
    "floods": ("import os\ndef fk(q):\n    while True:\n        os.write(4, b'{\"id\": 0}\\n')\n", "garbage", "not an answer"),
    "writes an endless line": ("import os\ndef fk(q):\n    while True:\n        os.write(4, b'x' * 65536)\n", "garbage", "not an answer"),
    "nests deeply": ("import os\ndef fk(q):\n    os.write(4, b'[' * 100000 + b'\\n')\n", "garbage", "not an answer"),
    "closes its answers": ("import os, time\ndef fk(q):\n    os.close(4)\n    time.sleep(50)\n", "ended", "ended"),
    "stops itself": ("import os, signal\ndef fk(q):\n    os.kill(os.getpid(), signal.SIGSTOP)\n", "late", "no answer within 2 s$"),
    "ignores signals": ("import signal, time\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\ndef fk(q):\n    while True:\n        time.sleep(1)\n", "late", "no answer within 2 s$"),
    "returns text": ("def fk(q):\n    return 'abc'\n", "raised", "expected real numbers"),
    "returns complex numbers": ("def fk(q):\n    return 1j\n", "raised", "returned complex"),
    "is no Python": ("def fk(q)\n    return 1\n", "unreadable", "line 1: SyntaxError"),
    "raises when loaded": ("x = 1\nfk = y\n", "unreadable", "line 2: NameError"),
    "has no function": ("x = 1\n", "unreadable", "defines none of fk, ik, controller"),
    "has a NUL": ("def fk(q):\n    return 1\n\0", "unreadable", "null bytes"),
}  # fmt: skip

LEFT_BEHIND = {
    "children": "import os, time\ndef fk(q):\n    for k in range(5):\n        if os.fork() == 0:\n            time.sleep(1000)\n    return 1.0\n",
    "daemons": (
        "import os, time\ndef fk(q):\n    if os.fork() == 0:\n        os.setsid()\n        if os.fork() == 0:\n"
        "            os.setsid()\n            time.sleep(1000)\n        os._exit(0)\n    return 1.0\n"
    ),
    "who kills its supervisor": (
        "import os, time\ndef fk(q):\n    if os.fork() == 0:\n        os.setsid()\n        time.sleep(1000)\n"
        "    time.sleep(0.3)\n    os.kill(os.getppid(), 9)\n    return 1.0\n"
    ),
}  # fmt: skip


def left():
    """Return the processes of programs that run."""
    found = []
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            if process.status() != psutil.STATUS_ZOMBIE and any(
                "_runner." in word for word in process.cmdline()
            ):
                found.append(process)
    return found


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Return what makes a program of a text, closed at the end; nothing of it is left."""
    made, before = [], left()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def make(text, name="student.py", **options):
        path = tmp_path / name
        path.write_text(text)
        made.append(Program(path, **({"limits": LIMITS} | options)))
        return made[-1]

    yield make
    for one in made:
        one.close()
    wait_for(lambda: not {one for one in left() if one not in before}, "the end of all processes")


GOOD = "import numpy as np\ndef fk(q):\n    print('called')\n    return np.eye(4) * q[0]\n"


@pytest.fixture(scope="module")
def neighbour(tmp_path_factory):
    """A program that runs beside all others."""
    path = tmp_path_factory.mktemp("neighbour") / "student.py"
    path.write_text(GOOD)
    with Program(path) as one:
        one.call("fk", q=[1.0])
        yield one


@pytest.mark.parametrize("name", HARMFUL)
@pytest.mark.slow
def test_harm_is_said_and_other_programs_run(name, program, neighbour):
    text, failure, said = HARMFUL[name]
    limits = SHORT if name in SLEEPERS else LIMITS
    with pytest.raises(ProgramError, match=said) as caught:
        program(text, limits=limits).call("fk", q=[1.0, 2.0])
    assert failure in (None, caught.value.failure) and isinstance(caught.value.failure, Failure)
    assert neighbour.call("fk", q=[2.0])[0][0] == 2.0
    if name in VIOLENT:
        assert program(GOOD).call("fk", q=[2.0])[0][0] == 2.0


@isolated
@pytest.mark.parametrize("name", LEFT_BEHIND)
def test_what_it_starts_ends_with_it(name, program):
    one = program(LEFT_BEHIND[name])
    # Who kills the first process of his root ends himself, perhaps before he has answered.
    with suppress(ProgramError):
        assert one.call("fk", q=[1.0]) == 1.0


def test_children_of_a_program_that_is_not_isolated_end_with_it(program):
    assert program(LEFT_BEHIND["children"], isolation=UNPROTECTED).call("fk", q=[1.0]) == 1.0


def test_a_program_goes_on_after_an_exception_and_is_started_anew_after_its_end(program):
    text = "count = 0\ndef fk(q):\n    global count\n    count += 1\n    if q[0] < 0:\n        raise ValueError(q[0])\n    if q[0] > 9:\n        import os; os._exit(1)\n    return count\n"
    one = program(text)
    assert one.call("fk", q=[1.0]) == 1
    with pytest.raises(ProgramError, match=r"line 6: ValueError: -1.0") as caught:
        one.call("fk", q=[-1.0])
    assert caught.value.line == 6
    assert one.call("fk", q=[1.0]) == 3
    with pytest.raises(ProgramError, match="status 1"):
        one.call("fk", q=[10.0])
    assert one.call("fk", q=[1.0]) == 1


def test_many_lines_are_read_and_their_end_is_kept(program):
    last = 10**6 if ACCEPTING else 10**5
    text = f"def fk(q):\n    for k in range({last}):\n        print(k)\n    return 1.0\n"
    one = program(text, limits=Limits(60.0))
    assert one.call("fk", q=[1.0]) == 1.0
    # It has a pipe of its own.
    wait_for(lambda: one.output.endswith(f"{last - 1}\n"), "the end of the output")
    assert len(one.output) < 100_000


def test_a_program_that_is_closed_while_it_starts_is_not_waited_for(program, monkeypatch):
    """Its process may be made after another thread has closed it."""
    one = program("import time\ntime.sleep(1000)\n")
    make = child_module.Process

    def closed_meanwhile(*arguments):
        closing.start()
        wait_for(lambda: one._child._closed)
        return make(*arguments)

    closing = threading.Thread(target=one.close)
    monkeypatch.setattr(child_module, "Process", closed_meanwhile)
    with pytest.raises(ProgramError, match="was closed"):
        one.start()
    closing.join(HANGS)
    assert not closing.is_alive()


def test_values_are_told_as_they_are(program):
    one = program(
        "def fk(q):\n    return [float('nan'), float('inf'), -0.0, 1e-320, True]\ndef ik(T):\n    return None\n"
    )
    assert one.call("fk", q=[1.0]) == [None, None, 0.0, 1e-320, 1.0]
    assert one.call("ik", T=[[1.0]]) == []


def test_nothing_of_ours_is_handed_over(program, monkeypatch):
    monkeypatch.setenv("SECRET", "secret")
    text = (
        "import os, sys\ndef fk(q):\n    return [len(os.environ), 'SECRET' in os.environ, len(sys.argv),"
        f" os.getcwd() == {str(Path.cwd())!r}, max(int(n) for n in os.listdir('/proc/self/fd'))]\n"
    )
    variables, secret, arguments, folder, descriptor = program(text).call("fk", q=[1.0])
    assert (secret, arguments, folder) == (0, 3, 0) and variables < 12 and descriptor <= 5


ATTACKS = {
    "imports dhkit": "import dhkit",
    "imports Pinocchio": "import pinocchio",
    "imports it in another process": "subprocess.run([sys.executable, '-c', 'import dhkit'], check=True)",
    "imports it with another interpreter": "subprocess.run(['python3', '-c', 'import dhkit'], check=True)",
    "reads dhkit": "open({arm!r})",
    "reads the rubric": "open({rubric!r})",
    "lists our folders": "assert os.listdir({folder!r})",
    "writes beside it": "open({outside!r}, 'w')",
    "opens the network": "socket.create_connection(('127.0.0.1', {port}), 0.5)",
    "signals dhkit": "os.kill({pid}, 0)",
    "reads dhkit's memory": "open('/proc/{pid}/maps').read()",
    "makes devices": "os.mknod('disk', 0o600 | stat.S_IFBLK, os.makedev(8, 0))",
    "mounts": "assert ctypes.CDLL(None).mount(b'none', b'/tmp', b'tmpfs', 0, None) == 0",
}
"""Statements that an isolated program cannot execute."""


@isolated
@pytest.mark.parametrize("name", ATTACKS)
def test_an_isolated_program_cannot(name, program, tmp_path):
    (tmp_path / "rubric.toml").write_text("[points]\n")
    with socket.create_server(("127.0.0.1", 0)) as server:
        places = {
            "arm": dhkit.arm.__file__,
            "rubric": str(tmp_path / "rubric.toml"),
            "folder": str(tmp_path),
            "outside": str(tmp_path / "written"),
            "port": server.getsockname()[1],
            "pid": os.getpid(),
        }
        attack = ATTACKS[name].format(**places)
        imports = "import ctypes, os, socket, stat, subprocess, sys\n"
        text = f"{imports}def fk(q):\n    try:\n        {attack}\n    except Exception:\n        return 0.0\n    return 1.0\n"
        assert program(text, limits=Limits(20.0)).call("fk", q=[1.0]) == 0.0
    assert not (tmp_path / "written").exists()


@isolated
def test_allowed_packages_are_there_and_others_are_not(program):
    names = ["numpy", "scipy", "sympy", "mpmath", "casadi", "trimesh", "meshcat", "pip"]
    text = f"import importlib.util\ndef fk(q):\n    return [importlib.util.find_spec(name) is not None for name in {names}]\n"
    few = find_isolation(packages=("sympy",))
    assert program(text).call("fk", q=[1.0]) == [1, 1, 1, 1, 1, 0, 0, 0]
    assert program(text, isolation=few).call("fk", q=[1.0]) == [1, 0, 1, 1, 0, 0, 0, 0]


def test_who_imports_dhkit_openly_is_reported(program):
    one = program(
        "import dhkit\ndef fk(q):\n    return 1\n", limits=Limits(20.0), isolation=UNPROTECTED
    )
    one.call("fk", q=[1.0])
    assert one.imported == ("dhkit",)


def test_a_program_that_is_not_isolated_is_named_in_the_report(program):
    report = check(Arm.load("planar2r"), program(GOOD, isolation=UNPROTECTED), samples=1)
    assert any("not isolated (as a test wants it)" in note for note in report.notes)


def test_programs_of_others_are_refused_where_nothing_isolates_them(monkeypatch):
    monkeypatch.setattr(isolation_module.shutil, "which", lambda name: None)
    monkeypatch.setattr(isolation_module.os, "geteuid", lambda: 1000)
    with pytest.raises(IsolationError, match="bubblewrap is not installed"):
        find_isolation(packages=("sympy", "of-this-test"), required=True)
    assert find_isolation(packages=("sympy", "of-this-test")).kind is Kind.NONE


@pytest.fixture
def open_folder():
    """A folder that every user may enter: pytest closes its own to all others, at each start of any session."""
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)


SYSTEM_PYTHON = f"/usr/bin/python3.{sys.version_info.minor}"


@pytest.mark.skipif(
    os.geteuid() != 0 or not Path(SYSTEM_PYTHON).exists(),
    reason="only root runs it as another user",
)
def test_another_user_reads_nothing_of_ours_and_leaves_nothing(program, open_folder, monkeypatch):
    monkeypatch.setattr(sys, "_base_executable", SYSTEM_PYTHON)
    # The checkout may lie where no other user may enter.
    packages = {
        open_folder / path.name: inside for path, inside in package_paths(("numpy",)).items()
    }
    for path in package_paths(("numpy",)):
        copytree(path, open_folder / path.name, ignore=ignore_patterns("tests"))
    monkeypatch.setattr(isolated_commands, "package_paths", lambda names: packages)
    monkeypatch.setattr(tempfile, "tempdir", str(open_folder))
    task = open_folder / "task.toml"
    task.write_text("")
    task.chmod(0o600)
    text = (
        f"{LEFT_BEHIND['daemons'].replace('def fk', 'def daemon')}\n"
        "import numpy as np, pathlib\n"
        "def fk(q):\n    daemon(q)\n    open('/var/tmp/dhkit-left', 'w').close()\n"
        f"    try:\n        open({str(task)!r})\n        return 1.0\n    except PermissionError:\n        return float(os.getuid())\n"
    )
    one = program(text, isolation=Isolation(Kind.USER), limits=Limits(20.0))
    user = one.call("fk", q=[1.0])
    assert user >= other_user.FIRST_USER and other_user.processes_of(int(user))
    one.close()
    assert not other_user.processes_of(int(user)) and not Path("/var/tmp/dhkit-left").exists()
    problem = isolation_module._problem_of_user
    assert "can read" in problem([str(open_folder)], [])
    assert f"cannot read {task}" in problem([], [str(task)])
    assert not problem([str(task)], [str(path) for path in packages])


@isolated
def test_a_file_that_bubblewrap_would_show_prevents_isolation():
    """A task among the system's files can be read by every program."""
    found = find_isolation(hidden=[Path("/usr/bin/env")])
    assert not found and "bubblewrap shows" in found.reason


FILLS_ITS_FOLDER = """
import numpy as np
def fk(q):
    k = 0
    while True:
        with open(f"file-{k}", "wb") as file:
            file.write(b"x" * 2**20)
        k += 1
"""
FILLS_FILES_WITHOUT_A_NAME = """
import os
files = []
def fk(q):
    while True:
        file = {new}
        for k in range(40):
            os.write(file, b"x" * 2**20)
        files.append(file)
"""
IN_MEMORY = FILLS_FILES_WITHOUT_A_NAME.format(new='os.memfd_create("file")')
DELETED = FILLS_FILES_WITHOUT_A_NAME.format(
    new='os.open("file", os.O_RDWR | os.O_CREAT); os.unlink("file")'
)


@pytest.mark.skipif(sys.platform != "linux", reason="files without a name are found in /proc")
@pytest.mark.parametrize(
    "text",
    [FILLS_ITS_FOLDER, IN_MEMORY, DELETED],
    ids=["folder", "memory", "deleted"],
)
def test_files_are_bounded_together(text, program):
    with pytest.raises(ProgramError, match="wrote more than 128 MB to files") as caught:
        program(text, limits=Limits(60.0), isolation=UNPROTECTED).call("fk", q=[1.0])
    assert caught.value.failure == Failure.FILES


@isolated
def test_the_folder_of_an_isolated_program_is_bounded(program):
    with pytest.raises(ProgramError, match="No space left on device"):
        program(FILLS_ITS_FOLDER, limits=Limits(60.0)).call("fk", q=[1.0])
    with pytest.raises(ProgramError, match="wrote more than 128 MB to files"):
        program(IN_MEMORY, limits=Limits(60.0)).call("fk", q=[1.0])


def test_files_that_are_none(tmp_path):
    (tmp_path / "large.py").write_bytes(b"#" * 2_000_000)
    (tmp_path / "folder.py").mkdir()
    os.mkfifo(tmp_path / "pipe.py")
    (tmp_path / "text.txt").write_text("fk")
    for name, said in (("large.py", "1000000 bytes"), ("folder.py", "a file"), ("pipe.py", "a file"), ("no.py", "a file"), ("text.txt", ".py or .m")):  # fmt: skip
        with pytest.raises(ProgramError, match=said):
            Program(tmp_path / name).start()
    with pytest.raises(ProgramError, match="no such program"):
        Program(["no-such-program"]).start()


FOREIGN = """
import json, os
requests, answers = os.fdopen(3), os.fdopen(4, "w", buffering=1)
print(json.dumps({"functions": ["fk"]}), file=answers)
for line in requests:
    if line.strip():
        request = json.loads(line)
        print(json.dumps({"id": 10**9, "value": 0}), file=answers)  # of no request
        print(json.dumps({"id": request["id"], "value": sum(request["arguments"]["q"])}), file=answers)
"""


def test_any_program_speaks_the_protocol(tmp_path):
    (tmp_path / "foreign.py").write_text(FOREIGN)
    with Program([sys.executable, str(tmp_path / "foreign.py"), "; touch /tmp/x"]) as one:
        assert one.call("fk", q=[1.0, 2.5]) == 3.5
        assert one.call("fk", q=[2.0]) == 2.0


def test_octave_runs_files_of_matlab(program):
    require("octave-cli", "Debian's octave runs MATLAB's language")
    text = "1;\nfunction T = fk(q)\n  if q(1) > 5\n    error('too far');\n  end\n  T = eye(4) * q(1);\nend\n"
    text += "function Q = ik(T)\n  if T(1, 1) > 3\n    Q = [];\n  else\n    Q = [T(1, :); NaN 1 2 3];\n  end\nend\n"
    text += "function u = controller(t, q, qd, setpoint)\n  u = 10 * (setpoint.q - q);\nend\n"
    one = program(text, "student.m", limits=Limits(20.0, 1 << 30))
    assert one.call("fk", q=[2.0, 0.0])[3][3] == 2.0
    with pytest.raises(ProgramError, match="line 4: too far"):
        one.call("fk", q=[9.0, 0.0])
    T = [[1.0, 2.0, 3.0, 4.0]] * 4
    assert one.call("ik", T=T) == [[1, 2, 3, 4], [None, 1, 2, 3]]
    assert one.call("ik", T=[[4.0] * 4] * 4) == []
    setpoint = {"q": [2.0, 3.0], "qd": [0.0, 0.0], "qdd": [0.0, 0.0]}
    assert one.call("controller", t=0.0, q=[1.0, 1.0], qd=[0.0, 0.0], setpoint=setpoint) == [10, 20]


BUSY = """
import time
def fk(q):
    begun = time.process_time()
    while time.process_time() < begun + 0.2:
        pass
    return [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
"""


@pytest.mark.slow
def test_all_calls_together_are_limited_by_processor_time(program, monkeypatch):
    monkeypatch.setattr("dhkit.programs.caller.BOUNDS", replace(BOUNDS, time=0.5))
    # Of the clock, on a busy machine.
    monkeypatch.setattr("dhkit.programs.caller.WAITING_FACTOR", HANGS)
    busy = program(BUSY)
    caller = Caller(busy, "fk")
    with pytest.raises(ProgramError, match="not called any more"):
        for _ in range(20):
            caller(np.zeros(2))
    assert 1 < len(caller.seconds) < 10
    assert busy.processor_time > 0.5
    assert caller.failure_texts() == (
        "scoring took longer than 0.5 s: not called any more (1 time)",
    )
