"""Answer requests with the functions of a Python file.

This file is executed by its path in a process of its own, and imports nothing of dhkit. Requests are lines of JSON on
descriptor 3, answers lines of JSON on descriptor 4: docs/own-code.md has the protocol. The file's printed output goes
to standard output.

Arguments: the file; ``with-dhkit`` if it may import dhkit.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

REQUESTS, ANSWERS = 3, 4
FUNCTIONS = ("fk", "ik", "controller")


def main(path: str, *options: str) -> None:
    """Load the file, name the functions that it defines, and answer requests until they end."""
    import numpy as np

    if not options:
        sys.addaudithook(dhkit_hook())

    requests, answers = os.fdopen(REQUESTS, "rb"), os.fdopen(ANSWERS, "wb", 0)
    name = os.path.basename(path)  # noqa: PTH119

    def write(message: dict[str, object]) -> None:
        answers.write(json.dumps(message).encode() + b"\n")

    def error_fields(error: BaseException) -> dict[str, object]:
        """Return the text of an exception, and the last line of the file in its traceback."""
        line = error.lineno if isinstance(error, SyntaxError) and error.filename == name else None
        for frame in traceback.extract_tb(error.__traceback__):
            if frame.filename == name:
                line = frame.lineno
        text = error.msg if isinstance(error, SyntaxError) else str(error)
        return {"error": f"{type(error).__name__}: {text}"[:500].rstrip(": "), "line": line}

    namespace: dict[str, Any] = {"__name__": "student", "__file__": name}
    try:
        with open(path, "rb") as file:  # noqa: PTH123
            exec(compile(file.read(), name, "exec"), namespace)  # noqa: S102 - this process is made for it
    except BaseException as error:
        write(error_fields(error))
        return
    write({"functions": [function for function in FUNCTIONS if callable(namespace.get(function))]})
    for line in requests:
        if not line.strip():
            continue
        request = json.loads(line)
        answer: dict[str, object] = {"id": request["id"]}
        try:
            values = [argument(np, value) for value in request["arguments"].values()]
            answer["value"] = plain(np, namespace[request["call"]](*values))
        except BaseException as error:
            answer |= error_fields(error)
        write(answer)


def dhkit_hook() -> Callable[[str, tuple[Any, ...]], None]:
    """Return an audit hook that says when dhkit is imported or one of its files is opened, and ends this process.

    dhkit then starts the file anew with the right to import it. An audit hook cannot be removed, but what a file does
    in another process is not seen here: there, dhkit's files cannot be read.
    """
    own = os.path.realpath(__file__)
    packages = tuple(f"{package}{os.sep}" for package in dhkit_packages())
    realpath = os.path.realpath
    write = os.write
    leave = os._exit

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "import":
            uses_dhkit = arguments[0] == "dhkit" or str(arguments[0]).startswith("dhkit.")
        elif event == "open" and isinstance(arguments[0], (str, bytes)):
            try:
                opened = realpath(os.fsdecode(arguments[0]))
            except ValueError:
                return
            uses_dhkit = opened.startswith(packages) and opened != own  # tracebacks read this file
        else:
            return
        if uses_dhkit:
            write(ANSWERS, b'{"imported": ["dhkit"]}\n')
            leave(0)

    return hook


def dhkit_packages() -> list[str]:
    """Return the folders of dhkit: the one with this file, and those from which Python may import it."""
    packages = {os.path.dirname(os.path.dirname(os.path.realpath(__file__)))}  # noqa: PTH120
    for folder in sys.path:
        if os.path.isfile(os.path.join(folder, "dhkit", "__init__.py")):  # noqa: PTH113, PTH118
            packages.add(os.path.realpath(os.path.join(folder, "dhkit")))  # noqa: PTH118
    return sorted(packages)


def argument(np: Any, value: Any) -> Any:
    """Return an argument of a request as a function gets it: lists as arrays, objects with attributes."""
    if isinstance(value, dict):
        return SimpleNamespace(**{name: argument(np, part) for name, part in value.items()})
    return np.array(value, dtype=float) if isinstance(value, list) else value


def plain(np: Any, value: Any) -> Any:
    """Return a function's value for JSON: nested lists of numbers, in which NaN and infinity are null."""
    array = np.asarray([] if value is None else value)
    if array.dtype.kind not in "fiub":
        raise TypeError(f"returned {type(value).__name__} of {array.dtype}; expected real numbers")
    array = array.astype(float)
    return np.where(np.isfinite(array), array.astype(object), None).tolist()


if __name__ == "__main__":
    main(*sys.argv[1:])
