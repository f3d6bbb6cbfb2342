"""Read a .mat file by SciPy, and write its variables as JSON.

This file is executed by its path in a process of its own, and imports nothing of dhkit: SciPy's reader does not check a
file's lengths and types, and damaged files have crashed the process. The file is read from standard input. Standard
output has ``{"variables": [...]}``, each with name, kind and text, array or records; or ``{"error": "..."}``.

Arguments: the largest size of all variables together, bytes; the largest nesting depth of structs.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
import warnings
from typing import Any

import numpy as np
from scipy.io import matlab
from scipy.sparse import issparse

MEMORY = 1 << 30
"""Address space for SciPy itself, bytes."""
SECONDS = 60
CLASSES = {"f8": "double", "f4": "single", "b1": "logical", "O": "cell"}


def main(max_bytes: int, max_depth: int) -> None:
    """Read standard input within limits, and write what it has."""
    limit(max_bytes)
    try:
        answer: dict[str, object] = {"variables": Reader(max_bytes, max_depth).variables(sys.stdin.buffer.read())}
    except TooLargeError as error:
        answer = {"error": str(error)}
    except MemoryError:
        answer = {"error": f"unpacks to more than the {max_bytes / 1e6:g} MB that are read"}
    except Exception as error:
        answer = {"error": f"damaged: {' '.join(str(error).split())[:120] or type(error).__name__}"}
    json.dump(answer, sys.stdout)


def limit(max_bytes: int) -> None:
    """Limit this process's memory and time, where the system can."""
    with contextlib.suppress(ImportError):
        import resource

        # Unpacked data, arrays and the JSON text of a file are there together.
        memory = MEMORY + 8 * max_bytes
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))


class TooLargeError(Exception):
    """A file that is larger, or nested deeper, than is read."""


class Reader:
    """Reads variables, counting their bytes."""

    def __init__(self, max_bytes: int, max_depth: int) -> None:
        self.max_bytes = max_bytes
        self.max_depth = max_depth
        self.left = max_bytes

    def variables(self, content: bytes) -> list[dict[str, object]]:
        """Return the variables of a file in its order."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", message="Duplicate variable name.*")
            # Numbers of whole types have their class only if they are not made doubles.
            found = matlab.loadmat(io.BytesIO(content), mat_dtype=False, verify_compressed_data_integrity=True)
        named = {name: value for name, value in found.items() if not name.startswith("__")}
        return [self.variable(name, value, 1) for name, value in named.items() if name or value is not None]

    def variable(self, name: str, value: Any, depth: int) -> dict[str, object]:
        """Return a variable, or a field of a struct, by name and class, with its content if it is read."""
        if depth > self.max_depth:
            raise TooLargeError("variables nested too deep, or too many")
        if isinstance(value, matlab.MatlabOpaque):
            own, kind = value[0]["s0"], value[0]["s2"]
            return {"name": text_of(own) or name, "kind": text_of(kind)}
        if isinstance(value, matlab.MatlabObject):
            return {"name": name, "kind": str(value.classname)}
        if isinstance(value, matlab.MatlabFunction):
            return {"name": name, "kind": "function"}
        if issparse(value):
            return {"name": name, "kind": "sparse matrix"}
        array = np.asarray(value)
        if array.dtype.names is not None:
            return self.records(name, array, depth)
        if array.dtype.kind == "U":
            text = "".join(array.ravel().tolist())
            self.count(4 * len(text))
            return {"name": name, "kind": "char", "text": text}
        if array.dtype.kind == "c":
            return {"name": name, "kind": "complex matrix"}
        kind = CLASSES.get(array.dtype.str.lstrip("<>|="), array.dtype.name)
        if array.dtype.kind not in "fiub":
            return {"name": name, "kind": kind}
        self.count(8 * array.size)
        return {"name": name, "kind": kind, "shape": list(array.shape), "array": array.ravel().astype(float).tolist()}

    def records(self, name: str, array: Any, depth: int) -> dict[str, object]:
        """Return a struct, or an array of structs in MATLAB's order."""
        fields = array.dtype.names
        listed = [
            [self.variable(field, record[field], depth + 1) for field in fields] for record in array.ravel(order="F")
        ]
        return {"name": name, "kind": "struct", "records": listed}

    def count(self, size: int) -> None:
        """Count bytes."""
        self.left -= size
        if self.left < 0:
            raise TooLargeError(f"unpacks to more than the {self.max_bytes / 1e6:g} MB that are read")


def text_of(value: Any) -> str:
    """Return the name of an object of one of MATLAB's classes."""
    return value.decode("latin-1") if isinstance(value, bytes) else str(value)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
