"""Replace this process by a program of another person, within limits.

This file is executed by its path and imports only the standard library.

Arguments: the descriptors from which the program reads requests and to which it writes answers, which become its
descriptors 3 and 4; the bytes of memory that each of its processes may address; the number of the user that it runs as,
0 for this one; then the program and its arguments.
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
from contextlib import suppress
from typing import NoReturn

DEATH_SIGNAL = 1
"""Option of Linux's prctl(2): the signal that the process gets when its parent ends."""
NO_NEW_PRIVILEGES = 38
"""Option of prctl(2): programs that it executes get no further rights."""
MAX_FILE_BYTES = 64 << 20
"""Largest file that the program may write, bytes."""
MAX_OPEN_FILES = 256
MAX_PROCESSES = 64
REQUESTS = 3
ANSWERS = 4


def main(arguments: list[str]) -> NoReturn:
    """Limit this process, and replace it by the program."""
    requests, answers, memory, user = map(int, arguments[:4])
    program = arguments[4:]
    try:
        spare = [os.dup(os.dup(descriptor)) for descriptor in (requests, answers)]
        for descriptor, wanted in zip(spare, (REQUESTS, ANSWERS), strict=True):
            os.dup2(descriptor, wanted)
        os.closerange(ANSWERS + 1, MAX_OPEN_FILES)
        limits = {
            resource.RLIMIT_CORE: 0,
            resource.RLIMIT_FSIZE: MAX_FILE_BYTES,
            resource.RLIMIT_NOFILE: MAX_OPEN_FILES,
            resource.RLIMIT_AS: memory,
        }
        if user:
            limits[resource.RLIMIT_NPROC] = MAX_PROCESSES
        for kind, bound in limits.items():
            with suppress(OSError, ValueError):  # macOS knows no limit of addresses
                resource.setrlimit(kind, (bound, bound))
        if user:
            os.setgroups([])
            os.setgid(user)
            os.setuid(user)
        if sys.platform == "linux":
            prctl = ctypes.CDLL(None).prctl
            if os.path.basename(program[0]) != "bwrap":  # noqa: PTH119 - which sets it itself, and may need rights
                prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
            # When dhkit dies; a change of the user would undo it.
            prctl(DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        os.execvp(program[0], program)  # noqa: S606 - no shell is wanted
    except OSError as error:
        os.write(2, f"{program[0]}: {error.strerror}\n".encode())
    finally:
        os._exit(127)


if __name__ == "__main__":
    main(sys.argv[1:])
