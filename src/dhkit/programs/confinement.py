"""Run a program that cannot read dhkit's files, and cannot send signals to processes that it did not start.

This file is executed by its path, imports only the standard library, and replaces itself by a program that dhkit did
not write. What it gives up is given up for good, by the program and by all that the program starts, also for root.

Files and signals are restricted by Linux's Landlock (Documentation/userspace-api/landlock.rst). Landlock knows only
what is allowed. Hidden folders are therefore left out: everything beside them, and beside each folder above them, is
allowed.

Arguments: a :class:`Confinement` as JSON; then the program and its arguments.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
from collections.abc import Iterator, Sequence
from typing import NamedTuple, NoReturn

CAPABILITY_DROP, NO_NEW_PRIVILEGES = 24, 38
"""Options of Linux's prctl(2)."""
RESOURCE_CAPABILITY = 24
"""Linux's CAP_SYS_RESOURCE: who has it raises limits that were lowered."""
CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
"""Numbers of Landlock's system calls, the same on all architectures."""
READ_FILE, REFER = 1 << 2, 1 << 13
"""Rights of Landlock: to read a file, and to move it to another folder."""
SIGNALS = 1 << 1
"""Landlock's scope of signals."""
REFER_VERSION, SIGNALS_VERSION = 2, 6
"""First versions of Landlock that know the right to move files (Linux 5.19) and the scope of signals (Linux 6.12)."""


class Confinement(NamedTuple):  # dataclasses take long to import
    """Rights that a program does not have.

    Attributes
    ----------
    landlock
        Version of Landlock that this system has; 0 for none, where nothing is hidden and signals go everywhere.
    hidden
        Folders whose files the program cannot read: absolute paths without links.
    readable
        Files in hidden folders that it can read all the same.
    """

    landlock: int
    hidden: tuple[str, ...] = ()
    readable: tuple[str, ...] = ()

    def command(self, program: Sequence[str]) -> list[str]:
        """Return the command that runs a program without these rights."""
        return [sys.executable, "-I", "-S", __file__, json.dumps(self), *program]


def landlock_version() -> int:
    """Return the version of Landlock that this system has; 0 for none."""
    if sys.platform != "linux":
        return 0
    return max(0, _system_call(CREATE_RULESET, None, ctypes.c_size_t(0), 1))


def main(arguments: list[str]) -> NoReturn:
    """Give up rights, and replace this process by the program."""
    program = arguments[1:]
    try:
        if sys.platform == "linux":
            give_up(Confinement(*json.loads(arguments[0])))
        os.execvp(program[0], program)  # noqa: S606 - no shell is wanted
    except OSError as error:
        os.write(2, f"{program[0]}: {error.strerror}\n".encode())
    finally:
        os._exit(127)


def give_up(rights: Confinement) -> None:
    """Give up rights for good.

    Raises
    ------
    OSError
        The system refuses to restrict this process.
    """
    prctl = ctypes.CDLL(None).prctl
    prctl(CAPABILITY_DROP, RESOURCE_CAPABILITY, 0, 0, 0)  # fails for all but root, who alone has it
    prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    if rights.landlock == 0:
        return

    handled = 0
    if rights.hidden:
        handled = READ_FILE | (REFER if rights.landlock >= REFER_VERSION else 0)
    scoped = SIGNALS if rights.landlock >= SIGNALS_VERSION else 0
    if not handled and not scoped:
        return

    # struct landlock_ruleset_attr: rights of files, of the network, and scopes. Older kernels know its beginning.
    attributes = (ctypes.c_uint64 * 3)(handled, 0, scoped)
    size = ctypes.sizeof(attributes) if scoped else ctypes.sizeof(ctypes.c_uint64)
    rules = _checked_call(CREATE_RULESET, attributes, ctypes.c_size_t(size), 0)
    if handled & REFER:
        # Files may be moved, unless that would make them readable.
        _allow(rules, "/", REFER)
    if handled:
        for path in paths_beside(rights.hidden):
            _allow(rules, path, READ_FILE)
        for path in rights.readable:
            _allow(rules, path, READ_FILE)
    _checked_call(RESTRICT_SELF, rules, 0)
    os.close(rules)


def paths_beside(hidden: Sequence[str]) -> Iterator[str]:
    """Return paths that together cover every file outside hidden folders."""
    outermost = [path for path in hidden if not any(path.startswith(f"{other}/") for other in hidden)]
    above = {path[:end] or "/" for path in outermost for end, letter in enumerate(path) if letter == "/"}
    for folder in sorted(above):
        try:
            entries = list(os.scandir(folder))
        except OSError:
            continue  # this user cannot list it: its other entries are hidden, too
        for entry in entries:
            # A link may lead to a hidden folder; what it leads to is covered where it is.
            if entry.path not in outermost and entry.path not in above and not entry.is_symlink():
                yield entry.path


def _allow(rules: int, path: str, rights: int) -> None:
    """Allow rights to a file, or to all below a folder; a path that has gone meanwhile is passed over."""
    try:
        descriptor = os.open(path, os.O_PATH | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return
    # struct landlock_path_beneath_attr, which is packed.
    attributes = rights.to_bytes(8, sys.byteorder) + descriptor.to_bytes(4, sys.byteorder)
    try:
        _checked_call(ADD_RULE, rules, 1, attributes, 0)
    finally:
        os.close(descriptor)


def _checked_call(*arguments: object) -> int:
    result = _system_call(*arguments)
    if result < 0:
        raise OSError(ctypes.get_errno(), "Landlock: " + os.strerror(ctypes.get_errno()))
    return result


def _system_call(*arguments: object) -> int:
    call = ctypes.CDLL(None, use_errno=True).syscall
    call.restype = ctypes.c_long
    return int(call(*arguments))


if __name__ == "__main__":
    main(sys.argv[1:])
