"""Processes of a program whose supervisor has ended before them: they become children of this process.

A program may end its supervisor, where the system does not keep it from that. On Linux its other processes are then
adopted by the nearest subreaper above them, which this process is while programs run. It has children of its own,
which must live on: those of a program are told by limits and rights that they cannot get back.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from contextlib import suppress
from pathlib import Path

from dhkit.programs.supervisor import MAX_OPEN_FILES, SUBREAPER, descendants, end_processes, parents_of_processes

_LOCK = threading.Lock()
_running = 0
"""Number of programs whose orphans this process adopts."""


def begin_adoption() -> None:
    """Make this process the parent of orphans, until :func:`end_adoption` is called as often."""
    global _running
    with _LOCK:
        _running += 1
        if _running == 1:
            _set_subreaper(True)


def end_adoption() -> None:
    """Leave orphans to the system again, after the last program has ended."""
    global _running
    with _LOCK:
        _running -= 1
        if _running == 0:
            _set_subreaper(False)


def end_orphans() -> None:
    """End all processes of programs that this process has adopted, and their descendants."""
    end_processes(orphans)


def orphans() -> list[int]:
    """Return the processes of programs that this process has adopted, and their descendants."""
    own = os.getpid()
    if not _parent_tells_programs(own):
        return []
    adopted = [pid for pid, parent in parents_of_processes().items() if parent == own and _is_program(pid)]
    return [*adopted, *descendants(adopted)]


def _parent_tells_programs(own: int) -> bool:
    """Return whether processes of programs differ from children that this process itself may have."""
    files = _open_files_limit(own)
    return files is not None and files > MAX_OPEN_FILES


def _is_program(pid: int) -> bool:
    """Return whether a process has the limits and rights of a program: those of its supervisor are this process's."""
    files = _open_files_limit(pid)
    return files is not None and files <= MAX_OPEN_FILES and _status(pid, "NoNewPrivs") == "1"


def _open_files_limit(pid: int) -> float | None:
    """Return the hard limit of open files of a process; None if it is not known."""
    with suppress(OSError):
        for line in Path(f"/proc/{pid}/limits").read_text().splitlines():
            if line.startswith("Max open files"):
                hard = line.split()[4]
                return float("inf") if hard == "unlimited" else float(hard)
    return None


def _status(pid: int, field: str) -> str | None:
    """Return a field of the status of a process; None if it is not known."""
    with suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text(errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name == field:
                return value.strip()
    return None


def _set_subreaper(adopts: bool) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(SUBREAPER, int(adopts), 0, 0, 0)
