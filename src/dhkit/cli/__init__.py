"""The ``dhkit`` command: the library for the terminal, with ``--json`` for machines.

Exit status 0: fine; 1: the answer is no; 2: unusable input, said in one line on stderr.
"""

from dhkit.cli.main import main

__all__ = ["main"]
