"""Serving a lab: in the foreground until it is interrupted, or beside what a program does."""

from __future__ import annotations

import os
import secrets
import stat
import time
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from dhkit.description import Robot, write_atomically
from dhkit.errors import ModelError
from dhkit.lab.assignment import Assignment
from dhkit.lab.lab import Lab

TOKEN_LENGTH = 22
"""Characters of a token."""
LONGEST_TOKEN = 100
"""Characters that are read where one is kept."""


def serve(
    arm: Robot,
    *,
    block: bool = True,
    port: int | None = None,
    open_browser: bool = True,
    own: str | Path | Sequence[str] | None = None,
    sandbox: str | None = None,
    solid: str | Path | None = None,
    assignment: Assignment | str | Path | None = None,
) -> Lab:
    """Open a lab in the browser.

    Parameters
    ----------
    arm
        The arm.
    block
        Whether to return only when it is interrupted (Ctrl-C); otherwise at once, with the lab running.
    port
        Where the page is, for pages that are to find it again after Python was started anew: its token is then kept
        for this port, readable by this user alone. Any free port, and a new token, unless given.
    open_browser
        Whether the page is opened in the default browser.
    own, sandbox
        A program that is held against the arm, and what it runs in: see :class:`Lab`.
    solid
        An ``.stl`` file for the panel of transforms; a box unless given.
    assignment
        Texts and goals about this arm: read, or the file.

    Returns
    -------
    Lab
        Running, or closed where it was waited for.

    Raises
    ------
    ModelError
        The server did not start, or the place where a port's token is kept can be written by others.
    DescriptionError
        The assignment cannot be read, or is about another robot.
    ValueError
        A port that is none for programs of users.

    Examples
    --------
    >>> import dhkit
    >>> lab = dhkit.lab.serve(dhkit.Arm.load("puma560"), block=False, open_browser=False)
    >>> lab.url.startswith("http://127.0.0.1:")
    True
    >>> lab.close()
    """
    if port is not None and not 1024 <= port < 65_536:
        raise ValueError(f"port is {port}; expected 1024 to 65535")
    given = Assignment.read(assignment) if isinstance(assignment, (str, Path)) else assignment
    lab = Lab(arm, port or 0, None if port is None else kept_token(port), own, sandbox, solid, given)
    if not block:
        if open_browser:
            webbrowser.open(lab.url)
        return lab
    try:
        if open_browser:
            webbrowser.open(lab.url)
        while True:
            time.sleep(3600)
    except KeyboardInterrupt:
        return lab
    finally:
        lab.close()


def kept_token(port: int) -> str:
    """Return the token of a port, the same each time; made and kept with mode 0600 where there is none.

    A token that others could have read or written is not used again: a new one takes its place.

    Raises
    ------
    ModelError
        The folder for it is not this user's alone, or cannot be written.
    """
    folder = _state_folder()
    path = folder / f"lab-{port}.token"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if os.name == "posix" and (folder.stat().st_uid != os.getuid() or folder.stat().st_mode & 0o022):
            raise ModelError(f"{folder} can be written by others; expected a folder of this user's alone")
        if _is_private(path):
            token = path.read_bytes()[:LONGEST_TOKEN].decode("ascii", errors="replace").strip()
            if len(token) >= TOKEN_LENGTH and token.replace("-", "").replace("_", "").isalnum() and token.isascii():
                return token
        token = secrets.token_urlsafe(16)
        write_atomically(path, token, private=True)
        return token
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror}; expected a place for the lab's token, or no --port") from None


def _is_private(path: Path) -> bool:
    """Whether a path is a file of this user's that nobody else may read or write."""
    try:
        about = path.lstat()
    except FileNotFoundError:
        return False
    if not stat.S_ISREG(about.st_mode):
        return False
    return os.name != "posix" or (about.st_uid == os.getuid() and not about.st_mode & 0o077)


def _state_folder() -> Path:
    home = os.environ.get("XDG_STATE_HOME")
    return (Path(home) if home else Path.home() / ".local" / "state") / "dhkit"
