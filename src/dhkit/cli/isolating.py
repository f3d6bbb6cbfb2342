"""Isolation of the programs that a command runs: asked for by an option, and said where there is none."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from dhkit.execution import Isolation, find_isolation

Isolated = Annotated[
    bool,
    typer.Option(
        "--isolated",
        help="For programs of others: refuse to run what cannot be isolated on this system.",
    ),
]


def isolation_for(
    program: str, required: bool, hidden: Iterable[Path] = (), packages: Sequence[str] = ()
) -> Isolation:
    """Return how a program is run; where it is not isolated, say so on stderr.

    Parameters
    ----------
    program
        Its name.
    required
        Whether it may be run only isolated.
    hidden
        Files that it must not read, beside dhkit itself.
    packages
        Packages that it may import; the usual ones where there are none.

    Raises
    ------
    IsolationError
        It must be isolated, and cannot be.
    """
    found = find_isolation(hidden, packages, required=required)
    if not found:
        sys.stderr.write(
            f"dhkit: {program} is {found}: it can do everything that you can; run only programs that you trust\n"
        )
    return found
