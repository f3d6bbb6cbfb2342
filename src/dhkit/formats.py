"""Registry of printers, readers and writers by name, so that values need not import them.

Packages register functions when they are imported; a function's module is imported when it is first used.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

_MODULES: dict[str, str] = {}


def register_formats(module: str, *functions: str) -> None:
    """Register functions of a module by their names."""
    _MODULES.update(dict.fromkeys(functions, module))


def format_function(name: str) -> Callable[..., Any]:
    """Return the function registered under a name."""
    function: Callable[..., Any] = getattr(importlib.import_module(_MODULES[name]), name)
    return function
