"""The ``dhkit`` command: the library for the terminal, with ``--json`` for machines.

Exit status 0: fine; 1: the answer is no; 2: unusable input, said in one line on stderr.
"""

import gc

# A command imports thousands of objects that all stay: looking through them for garbage is a tenth of its start.
gc.set_threshold(50_000, 20, 50)

from dhkit.cli.main import main  # noqa: E402 - the line above is about this import

__all__ = ["main"]
