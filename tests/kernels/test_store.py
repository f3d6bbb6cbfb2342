"""Machine code on disk: found by later processes, made anew when damaged, and never shared with strangers."""

import errno
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from acceptance import ACCEPTING, only_accepting
from conftest import require
from dhkit import Arm
from dhkit.errors import DhkitError
from dhkit.kernels import store

CALL = """
import logging, sys
logging.basicConfig(level=logging.INFO, format="%(name)s %(message)s", stream=sys.stderr)
import dhkit, numpy as np
arm = dhkit.Arm.load("planar2r")
q = np.random.default_rng(0).normal(size=(70_000, 2))
T = arm.fk(q)
a1, a2 = arm.description.numbers.a
assert abs(T[:, 0, 3] - a1 * np.cos(q[:, 0]) - a2 * np.cos(q.sum(axis=1))).max() < 1e-14
print(*sorted({"casadi", "numba", "llvmlite"} & set(sys.modules)))
"""


def in_new_process(code, folder, *arguments, **environment):
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "DHKIT_CACHE_DIR": str(folder), **environment},
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A cache that one process has filled, and that process; to be copied, not changed."""
    folder = tmp_path_factory.mktemp("filled")
    return folder, in_new_process(CALL, folder)


def copied(first, folder):
    """Return a copy of a filled cache."""
    return shutil.copytree(first[0], folder / "cache")


def test_the_second_process_neither_derives_nor_compiles(first, tmp_path):
    assert first[1].stderr.count("compiling forward_kinematics") == 1
    assert first[1].stdout.split() == ["casadi", "llvmlite"]
    assert (first[0] / "kernels").stat().st_mode & 0o777 == 0o700
    second = in_new_process(CALL, copied(first, tmp_path))
    assert "compiling" not in second.stderr
    assert second.stdout.split() == ["llvmlite"]


def test_switched_off_nothing_is_compiled_or_written(tmp_path):
    done = in_new_process(CALL, tmp_path, DHKIT_KERNELS="off")
    assert done.stdout.split() == ["casadi"]
    assert not list(Path(tmp_path).rglob("*"))


def damage(path, how):
    whole = path.read_bytes()
    path.unlink()
    if how == "folder":
        (path / "with something in it").mkdir(parents=True)
    elif how == "unreadable":
        path.symlink_to("nowhere")
    else:
        path.write_bytes(
            {
                "empty": b"",
                "half": whole[: len(whole) // 2],
                "one bit": whole[:-9] + bytes([whole[-9] ^ 4]) + whole[-8:],
                "longer": whole + b"\0",
                "Python": b"raise SystemExit",
                "number": b"kernel = 1\n",
            }[how]
        )
    return whole


@pytest.mark.slow
@pytest.mark.parametrize(
    "how",
    [
        *("half", "one bit", "folder"),
        *(
            pytest.param(x, marks=only_accepting)
            for x in ("empty", "longer", "Python", "number", "unreadable")
        ),
    ],
)
def test_a_damaged_entry_is_made_anew(first, tmp_path, how):
    """The same bytes again: those that the test above reads in a second process."""
    cache = copied(first, tmp_path)
    (path,) = (cache / "kernels").glob("forward_kinematics_*.kernel")
    whole = damage(path, how)
    again = in_new_process(CALL, cache)
    assert again.stderr.count("compiling forward_kinematics") == 1
    assert path.read_bytes() == whole


def test_every_source_that_can_matter_is_in_the_key(tmp_path, monkeypatch):
    """Among them what closed forms bake in: the numbers of statuses and flags."""
    root = tmp_path / "dhkit"
    shutil.copytree(
        Path(store.__file__).parents[1], root, ignore=shutil.ignore_patterns("__pycache__", "*.so")
    )
    monkeypatch.setattr(store, "__file__", str(root / "kernels" / "store.py"))

    def key():
        store._circumstances.cache_clear()
        return store.digest("ik", "")

    before = key()
    for place in (
        "kinematics/solutions.py",
        "kinematics/closed_form/program.py",
        "kinematics/newton_program.py",
        "dynamics/loads.py",
        "description/poses.py",
        "symbolic/differentiable/frames.py",
        "symbolic/programs/graph.py",
        "kernels/elementary.py",
    ):
        path = root / place
        path.write_text(path.read_text() + "\n# changed\n")
        now = key()
        assert now != before, place
        before = now
    monkeypatch.undo()
    store._circumstances.cache_clear()
    assert store.digest("ik", "") != store.digest("ik", "x")


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.parametrize("level", ["kernels", "cache", "above"])
@pytest.mark.parametrize("mode", [0o777, 0o770])
def test_a_folder_that_others_can_write_is_not_used(tmp_path, monkeypatch, caplog, level, mode):
    monkeypatch.setattr(store, "_own_group", lambda gid: False)
    cache = tmp_path / "above" / "cache"
    (cache / "kernels").mkdir(mode=0o700, parents=True)
    monkeypatch.setenv("DHKIT_CACHE_DIR", str(cache))
    store._warn_once.cache_clear()
    assert store.cache_folder() == cache / "kernels"
    open_folder = {"kernels": cache / "kernels", "cache": cache, "above": tmp_path / "above"}[level]
    open_folder.chmod(mode)
    assert store.cache_folder() is None
    assert f"{open_folder} can be written by other users" in caplog.text
    open_folder.chmod(mode | 0o1000)
    # In a sticky folder others cannot move what is ours, but they can add what we would run.
    assert store.cache_folder() == (None if level == "kernels" else cache / "kernels")


def test_a_user_that_does_not_exist_is_one_line(monkeypatch):
    monkeypatch.setenv("DHKIT_CACHE_DIR", "~nobody-of-this-name/x")
    with pytest.raises(
        DhkitError,
        match=r"^DHKIT_CACHE_DIR is '~nobody-of-this-name/x': there is no such user; expected a folder$",
    ):
        store.cache_folder()
    arm, q = Arm.load("planar2r").with_tool(np.eye(4) + 0.07 * np.eye(4, k=3)), np.zeros((64, 2))
    for _ in range(3):
        with pytest.raises(DhkitError, match="there is no such user"):
            arm.fk(q)
    command = [sys.executable, "-m", "dhkit", "workspace", "planar2r"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 2, done.stderr
    assert re.fullmatch(r".*DHKIT_CACHE_DIR.*\n", done.stderr)


def test_an_unwritable_home_means_memory_only(tmp_path):
    (tmp_path / "file").write_text("")
    assert "compiling forward_kinematics" in in_new_process(CALL, tmp_path / "file").stderr


def assert_private(home):
    """Hold entries, and the folders above them, to the user alone; return the entries."""
    entries = list(home.rglob("*.kernel"))
    for path in (*entries, *entries[0].parents[:3]):
        assert path.stat().st_mode & 0o077 == 0, path
    return entries


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_folders_and_entries_of_a_process_are_the_users_own(tmp_path):
    home = tmp_path / "home"
    home.mkdir(mode=0o700)
    code = "import os; os.umask(0); import dhkit; dhkit.Arm.load('planar2r').compile()"
    environment = {
        key: value for key, value in os.environ.items() if not key.startswith(("DHKIT_", "XDG_"))
    }
    subprocess.run(
        [sys.executable, "-c", code],
        env={**environment, "HOME": str(home)},
        check=True,
        timeout=120,
    )
    assert len(assert_private(home)) > 10


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.parametrize("umask", [0o000, 0o002, 0o022, 0o077])
def test_folders_and_entries_are_the_users_own_whatever_the_umask(tmp_path, monkeypatch, umask):
    home = tmp_path / "home"
    home.mkdir(mode=0o700)
    for name in ("DHKIT_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(home))
    before = os.umask(umask)
    try:
        store.write("test", "key", b"code")
    finally:
        os.umask(before)
    assert len(assert_private(home)) == 1


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.parametrize("what", ["writable by others", "a link", "a pipe"])
def test_an_entry_that_somebody_else_may_have_written_is_not_run(tmp_path, monkeypatch, what):
    monkeypatch.setenv("DHKIT_CACHE_DIR", str(tmp_path))
    store.write("test", "key", b"code")
    assert store.read("test", "key") == b"code"
    (path,) = (tmp_path / "kernels").iterdir()
    if what == "writable by others":
        path.chmod(0o666)
    else:
        path.rename(tmp_path / "elsewhere")
        os.mkfifo(path) if what == "a pipe" else path.symlink_to(tmp_path / "elsewhere")
    assert store.read("test", "key") is None
    store.write("test", "key", b"code")
    assert store.read("test", "key") == b"code"
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_cache_that_cannot_be_written_can_be_read(tmp_path, monkeypatch):
    monkeypatch.setenv("DHKIT_CACHE_DIR", str(tmp_path))
    store.write("test", "key", b"code")
    (tmp_path / "kernels").chmod(0o500)
    try:
        assert store.read("test", "key") == b"code"
        store.write("test", "other", b"code")
    finally:
        (tmp_path / "kernels").chmod(0o700)


def test_without_a_home_kernels_are_compiled_in_memory(monkeypatch):
    monkeypatch.delenv("DHKIT_CACHE_DIR", raising=False)

    def homeless(*_, **__):
        raise RuntimeError("could not determine the home directory")

    monkeypatch.setattr(store.platformdirs, "user_cache_dir", homeless)
    assert store.cache_folder() is None


FULL = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
def test_a_full_disk_means_memory_only(tmp_path):
    done = in_new_process(FULL + CALL, tmp_path)
    assert "kernels are not cached" in done.stderr
    assert os.strerror(errno.EFBIG) in done.stderr
    assert not [path for path in tmp_path.rglob("*") if path.is_file()], (
        "a half-written file was left"
    )


THREADS = """
import threading, numpy as np, dhkit
arm = dhkit.Arm.load("puma560")
q = np.random.default_rng(0).normal(size=(4_000, 6))
start, results = threading.Barrier(32), []
def work():
    start.wait()
    small = [arm.inverse_dynamics(q[k], q[k], q[k]) for k in range(20)]
    results.append((arm.inverse_dynamics(q, q, q), np.array(small)))
threads = [threading.Thread(target=work) for _ in range(32)]
[t.start() for t in threads]
[t.join() for t in threads]
M = arm.mass_matrix(q)
expected = np.einsum("kij,kj->ki", M, q) + arm.bias(q, q)
assert len(results) == 32
for large, small in results:
    assert abs(large - expected).max() < 1e-12
    assert abs(small - expected[:20]).max() < 1e-12
"""


@pytest.mark.slow
def test_processes_and_threads_that_ask_for_the_same_new_kernel(tmp_path):
    environment = {**os.environ, "DHKIT_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", THREADS]
    running = [
        subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    for process in running:
        _, errors = process.communicate(timeout=120)
        assert process.returncode == 0, errors


FORK = """
import multiprocessing, sys, threading, numpy as np, dhkit
arm = dhkit.Arm.load("puma560")
q = np.random.default_rng(0).normal(size=(10, 6))
expected = arm.fk(q)
arm.compile()  # what Python imports in one thread, a fork of another must not need
arms = [dhkit.Arm.load(name) for name in sys.argv[1:]]
def child():
    ok = abs(arm.fk(q) - expected).max() < 1e-14
    for other in arms[::-1]:
        other.compile()
        ok &= bool(np.isfinite(other.fk(np.zeros((100, other.n)))).all())
    raise SystemExit(0 if ok else 3)
compiling = threading.Thread(target=lambda: [other.compile() for other in arms])
compiling.start()
context = multiprocessing.get_context("fork")
codes = []
while compiling.is_alive():
    process = context.Process(target=child)
    process.start()
    process.join(60)
    codes.append(process.exitcode)
print(*set(codes))
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="fork of POSIX")
def test_forks_while_another_thread_compiles_do_not_hang(tmp_path):
    arms = ("stanford", "panda", "ur5", "planar2r") if ACCEPTING else ("cobra600", "planar2r")
    assert in_new_process(FORK, tmp_path, *arms).stdout.strip() == "0"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="object files of ELF")
def test_machine_code_needs_no_symbols_from_outside(tmp_path):
    """Cached code is linked into a process that may not have what the compiling one had."""
    nm = require("nm", "Debian's binutils have it")
    in_new_process("import dhkit; dhkit.Arm.load('puma560').compile()", tmp_path)
    for path in (tmp_path / "kernels").glob("*.kernel"):
        path.with_suffix(".o").write_bytes(path.read_bytes()[store._SEAL_BYTES :])
        done = subprocess.run(
            [nm, "-u", str(path.with_suffix(".o"))], capture_output=True, text=True, check=True
        )
        assert done.stdout == "", path.name
