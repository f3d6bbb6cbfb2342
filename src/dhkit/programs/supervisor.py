"""Run a program such that all processes that it starts can be ended.

This file is executed by its path, imports only the standard library, and is the parent process of a program that dhkit
did not write. Processes that lose their parent become children of this one (Linux: a subreaper), also those with a
session of their own, so that ending its descendants ends them all. It ends when the program and all its processes have
ended. When it is terminated, or when dhkit dies, it ends them and removes the program's folder.

Arguments: the descriptors from which the program reads requests and to which it writes answers, which become its
descriptors 3 and 4; the bytes of memory that each process may address; the program's folder, which was made for it;
then the program and its arguments.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

DEATH_SIGNAL, SUBREAPER = 1, 36
"""Options of Linux's prctl(2)."""
MAX_FILE_BYTES = 64 << 20
"""Largest file that the program may write, bytes."""
MAX_OPEN_FILES = 256
END_ROUNDS = 200
"""Rounds of ending all descendants, 10 ms apart: they may start others meanwhile."""
EMPTY_ROUNDS = 2
"""Rounds in a row that find nobody, after which nobody is left.

One is not enough: a process whose parent ends while parents are read may be missed.
"""
END_SIGNALS = (signal.SIGSTOP, signal.SIGKILL)
"""Signals that end a descendant: a stopped process starts no others."""
REQUESTS, ANSWERS = 3, 4


def main(arguments: list[str]) -> NoReturn:
    """Run the program, and wait until all its processes have ended."""
    requests, answers, memory = map(int, arguments[:3])
    folder = arguments[3]
    program = arguments[4:]
    if sys.platform == "linux":
        prctl = ctypes.CDLL(None).prctl
        prctl(SUBREAPER, 1, 0, 0, 0)
        prctl(DEATH_SIGNAL, signal.SIGTERM, 0, 0, 0)
    signal.signal(signal.SIGTERM, lambda *_: end_all(folder))
    child = os.fork()
    if child == 0:
        run(program, requests, answers, memory)
    os.close(requests)
    os.close(answers)
    status = 0
    while True:
        try:
            pid, code = os.wait()
        except ChildProcessError:
            break
        if pid == child:
            status = os.waitstatus_to_exitcode(code)
    sys.exit(status if status >= 0 else 128 - status)


def run(program: list[str], requests: int, answers: int, memory: int) -> NoReturn:
    """Replace this process by the program, within limits."""
    import resource

    try:
        if sys.platform == "linux":  # a program that ends this supervisor ends itself
            ctypes.CDLL(None).prctl(DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.setsid()
        spare = [os.dup(os.dup(fd)) for fd in (requests, answers)]
        for fd, wanted in zip(spare, (REQUESTS, ANSWERS), strict=True):
            os.dup2(fd, wanted)
        os.closerange(ANSWERS + 1, MAX_OPEN_FILES)
        limits = {
            resource.RLIMIT_CORE: 0,
            resource.RLIMIT_FSIZE: MAX_FILE_BYTES,
            resource.RLIMIT_NOFILE: MAX_OPEN_FILES,
        }
        for kind, bound in (limits | {resource.RLIMIT_AS: memory}).items():
            with suppress(OSError, ValueError):  # macOS knows no limit of addresses
                resource.setrlimit(kind, (bound, bound))
        os.execvp(program[0], program)  # noqa: S606 - no shell is wanted
    except OSError as error:
        os.write(2, f"{program[0]}: {error.strerror}\n".encode())
    finally:
        os._exit(127)


def end_all(folder: str) -> NoReturn:
    """End every descendant, remove the program's folder, and end this process."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    end_processes(lambda: descendants([os.getpid()]))
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


def end_processes(find: Callable[[], list[int]]) -> None:
    """End processes, and reap those that become children of this process, until none is found any more."""
    empty = 0
    for _ in range(END_ROUNDS):
        left = find()
        empty = 0 if left else empty + 1
        if empty == EMPTY_ROUNDS:
            return
        for number in END_SIGNALS:
            for pid in left:
                with suppress(OSError):
                    os.kill(pid, number)
        for pid in left:
            with suppress(ChildProcessError):
                os.waitpid(pid, os.WNOHANG)
        if left:
            time.sleep(0.01)


def descendants(ancestors: list[int]) -> list[int]:
    """Return the processes that some processes and their descendants started; none on systems without /proc."""
    parents = parents_of_processes()
    family = set(ancestors)
    while more := {pid for pid, parent in parents.items() if parent in family} - family:
        family |= more
    return sorted(family - set(ancestors))


def parents_of_processes() -> dict[int, int]:
    """Return the parent of every process, also of those that have ended and are not reaped; none without /proc."""
    parents: dict[int, int] = {}
    with suppress(OSError):
        for entry in os.listdir("/proc"):  # noqa: PTH208 - names alone
            if not entry.isdigit():
                continue
            with suppress(OSError, IndexError, ValueError):
                with open(f"/proc/{entry}/stat", "rb") as file:  # noqa: PTH123
                    fields = file.read().rpartition(b")")[2].split()
                parents[int(entry)] = int(fields[1])
    return parents


if __name__ == "__main__":
    main(sys.argv[1:])
