"""The ``dhkit`` command: the library for the terminal, with ``--json`` for machines.

Exit status 0: fine; 1: the answer is no; 2: unusable input, which one line on stderr names; 130: interrupted.
"""

import gc
import sys
from collections.abc import Sequence
from typing import NoReturn

from dhkit.cli.exit_status import ExitStatus

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command and exit with its status; modules are imported here, so that Ctrl-C always ends in one line."""
    # A command imports thousands of objects that all stay: collecting garbage among them is a tenth of its start.
    gc.set_threshold(50_000, 20, 50)
    try:
        from dhkit.cli.app import run

        status = run(arguments)
    except BaseException as error:
        if not _is_interruption(error):
            raise
        sys.stderr.write("dhkit: interrupted\n")
        status = ExitStatus.INTERRUPTED
    sys.exit(status)


def _is_interruption(error: BaseException | None) -> bool:
    """Return whether Ctrl-C caused an error: while classes are made, Python raises another error from it."""
    for _ in range(20):
        if error is None or isinstance(error, KeyboardInterrupt):
            break
        error = error.__cause__ or error.__context__
    return isinstance(error, KeyboardInterrupt)
