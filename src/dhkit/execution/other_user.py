"""Programs as a user without a name: its number, the processes and the files that it leaves behind."""

from __future__ import annotations

import itertools
import os
import shutil
import stat
import time
from contextlib import suppress
from pathlib import Path

import psutil

FIRST_USER = 61_000
"""First number of the users that a program runs as: those of Debian end below, and nobody is 65,534."""
_USERS = 3_000
_END_ROUNDS = 200
"""Rounds of killing all processes of a user, 10 ms apart."""

_numbers = itertools.count(os.getpid())


def next_user() -> int:
    """Return the number of a user for one program."""
    return FIRST_USER + next(_numbers) % _USERS


def processes_of(user: int) -> list[psutil.Process]:
    """Return the processes of a user that have not ended."""
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if process.uids().real == user and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
    return found


def end_processes_of(user: int) -> None:
    """Kill a user's processes until none is left that could start another."""
    for _ in range(_END_ROUNDS):
        left = processes_of(user)
        if not left:
            return
        for process in left:
            with suppress(psutil.Error):
                process.kill()
        time.sleep(0.01)


def remove_files_of(user: int) -> None:
    """Remove the files of a user in the folders to which everybody may write."""
    for folder in ("/tmp", "/var/tmp", "/dev/shm"):  # noqa: S108
        with suppress(OSError):
            for entry in list(os.scandir(folder)):
                if entry.stat(follow_symlinks=False).st_uid != user:
                    continue
                if stat.S_ISDIR(entry.stat(follow_symlinks=False).st_mode):
                    shutil.rmtree(entry.path, ignore_errors=True)
                else:
                    Path(entry.path).unlink(missing_ok=True)
