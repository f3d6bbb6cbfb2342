"""Serving a lab: in the foreground until it is interrupted, or beside a running program."""

from __future__ import annotations

import os
import secrets
import stat
import time
from collections.abc import Sequence
from pathlib import Path

from dhkit.description import Robot, write_atomically
from dhkit.errors import ModelError
from dhkit.lab.assignment import Assignment
from dhkit.lab.lab import Lab
from dhkit.lab.record import record_path
from dhkit.model.robot_folder import model_errors
from dhkit.programs import Isolation
from dhkit.viewer.opening import open_in_browser

TOKEN_LENGTH = 22
"""Smallest length of a token, characters: 16 random bytes in base64."""
MAX_TOKEN_LENGTH = 100
"""Number of bytes at the beginning of a token file that are used; the rest is ignored."""


def serve(
    arm: Robot,
    *,
    block: bool = True,
    port: int | None = None,
    open_browser: bool = True,
    own: str | Path | Sequence[str] | None = None,
    isolation: Isolation | None = None,
    solid: str | Path | None = None,
    assignment: Assignment | str | Path | None = None,
    loaded_from: str | None = None,
    record: str | Path | None = None,
) -> Lab:
    """Open a lab in the browser.

    Parameters
    ----------
    arm
        The arm.
    block
        Whether to return only when the lab is interrupted (Ctrl-C); otherwise it returns at once, with the lab running.
    port
        Port of the page, for pages that are to find it again after Python was started anew: its token is then kept
        for this port, in a file that this user alone can read. By default any free port, and a new token.
    open_browser
        Whether the page is opened in the default browser.
    own, isolation
        A program that is compared with the arm, and its isolation: see :class:`Lab`.
    solid
        An ``.stl`` file for the panel of transforms; by default a box.
    assignment
        Texts and goals about this arm, or the file that has them.
    loaded_from
        Name or path that the arm was loaded from, for "Copy as Python": see :class:`Lab`.
    record
        Folder in which the work on the assignment is recorded, as ``NAME.lab.json`` for the assignment ``NAME.toml``;
        work in it is taken up again. The file is handed in, and ``dhkit grade`` collects it.

    Returns
    -------
    Lab
        The lab: running, or closed after it was interrupted.

    Raises
    ------
    ModelError
        The server did not start, or others can write where the port's token is kept.
    DescriptionError
        The assignment cannot be read, or is about another robot.
    ValueError
        The port is not from 1024 to 65535, or there is a record and no assignment's file.
    AnswerError
        The record cannot be read, or was edited.

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
    if record is not None and not isinstance(assignment, (str, Path)):
        raise ValueError(
            "record is given without the file of an assignment; expected assignment=PATH beside it"
        )
    file = None
    if isinstance(assignment, (str, Path)):
        if record is not None:
            file = record_path(Path(record), Path(assignment))
            with model_errors(file):
                file.parent.mkdir(parents=True, exist_ok=True)
        assignment = Assignment.read(assignment)
    token = None if port is None else kept_token(port)
    lab = Lab(arm, port or 0, token, own, isolation, solid, assignment, loaded_from, file)
    try:
        if open_browser:
            open_in_browser(lab.url)
        while block:
            time.sleep(3600)
    except KeyboardInterrupt:
        if not block:
            raise
    finally:
        if block:
            lab.close()
    return lab


def kept_token(port: int) -> str:
    """Return the token of a port, the same each time; a new one is kept in a file of mode 0600.

    A token that others could have read or written is not used again: a new one takes its place.

    Raises
    ------
    ModelError
        The folder of tokens belongs to another user, others can write to it, or it cannot be written.
    """
    home = os.environ.get("XDG_STATE_HOME")
    folder = (Path(home) if home else Path.home() / ".local" / "state") / "dhkit"
    path = folder / f"lab-{port}.token"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if os.name == "posix" and (
            folder.stat().st_uid != os.getuid() or folder.stat().st_mode & 0o022
        ):
            raise ModelError(
                f"{folder} can be written by others; expected a folder that this user owns and nobody else can write to"
            )
        if _is_private(path):
            token = path.read_bytes()[:MAX_TOKEN_LENGTH].decode("ascii", errors="replace").strip()
            if (
                len(token) >= TOKEN_LENGTH
                and token.replace("-", "").replace("_", "").isalnum()
                and token.isascii()
            ):
                return token
        token = secrets.token_urlsafe(16)
        write_atomically(path, token, private=True)
        return token
    except OSError as error:
        raise ModelError(
            f"{path}: {error.strerror}; expected a place for the lab's token, or no --port"
        ) from None


def _is_private(path: Path) -> bool:
    """Return whether a path is a file of this user's that nobody else may read or write."""
    try:
        status = path.lstat()
    except FileNotFoundError:
        return False
    if not stat.S_ISREG(status.st_mode):
        return False
    return os.name != "posix" or (status.st_uid == os.getuid() and not status.st_mode & 0o077)
