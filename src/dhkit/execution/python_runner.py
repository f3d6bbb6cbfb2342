"""Answer requests with the functions of a Python file.

This file is executed by its path in a process of its own, and imports nothing of dhkit. Requests are lines of JSON on
descriptor 3, answers lines of JSON on descriptor 4: docs/own-code.md has the protocol. The file's printed output goes
to standard output.

Arguments: the folder of the packages that the file may import, empty where it may import all; the file.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

REQUESTS = 3
ANSWERS = 4
FUNCTIONS = ("fk", "ik", "controller")


def main(packages: str, path: str) -> None:
    """Load the file, name the functions that it defines, and answer requests until they end."""
    if packages:
        sys.path.append(packages)
    sys.addaudithook(import_hook())
    import numpy as np

    requests = os.fdopen(REQUESTS, "rb")
    answers = os.fdopen(ANSWERS, "wb", 0)
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


def import_hook() -> Callable[[str, tuple[Any, ...]], None]:
    """Return an audit hook that says when dhkit is imported: a hint for readers of the report, and no defence."""
    write = os.write
    said = list[str]()

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "import" and not said and str(arguments[0]).partition(".")[0] == "dhkit":
            said.append("dhkit")
            write(ANSWERS, b'{"imported": ["dhkit"]}\n')

    return hook


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
