"""Packages that an installation may lack: a core installation has none of them (``requirements-core.txt``)."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from dhkit.errors import MissingPackageError


def imported(module: str, purpose: str, install: str = "") -> Any:
    """Return a module of a package that may be missing.

    Parameters
    ----------
    module
        Name of the module, such as ``matplotlib.figure``.
    purpose
        What it is needed for, as the subject of a sentence.
    install
        The command that installs it; ``pip install`` with the package's name if not given.

    Raises
    ------
    MissingPackageError
        The module cannot be imported.

    Examples
    --------
    >>> imported("json", "reading JSON").loads("1")
    1
    >>> imported("nowhere", "a flight to the moon")
    Traceback (most recent call last):
        ...
    dhkit.errors.MissingPackageError: a flight to the moon needs nowhere, which is not installed: pip install nowhere
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        command = install or f"pip install {package}"
        # A package that is there and does not load says why.
        is_missing = isinstance(error, ModuleNotFoundError) and error.name in (module, package)
        why = "is not installed" if is_missing else f"cannot be imported ({error})"
        raise MissingPackageError(f"{purpose} needs {package}, which {why}: {command}") from None
