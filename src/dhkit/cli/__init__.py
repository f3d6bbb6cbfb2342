"""The ``dhkit`` command: the library for the terminal, with ``--json`` for machines.

Exit status 0: fine; 1: the answer is no; 2: unusable input, said in one line on stderr; 130: interrupted.
"""

import gc
import sys
from collections.abc import Sequence
from typing import NoReturn

from dhkit.cli.exit_status import ExitStatus

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command and exit with its status; what it needs is imported here, so that Ctrl-C is told in one line."""
    # A command imports thousands of objects that all stay: looking through them for garbage is a tenth of its start.
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
    """Whether Ctrl-C is behind an error: while classes are made, Python raises another one from it."""
    seen = 0
    while error is not None and seen < 20:
        if isinstance(error, KeyboardInterrupt):
            return True
        error, seen = error.__cause__ or error.__context__, seen + 1
    return False
