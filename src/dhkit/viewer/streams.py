"""What a page with panels is told besides the scene: states of panels as JSON, and rows of numbers."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.viewer.protocol import HEADER, MessageType, message_header

LENGTH = struct.Struct("<I")
MOST_FLOATS = 100_000
"""Of samples that wait for a slow page, and that a new page is told: half an hour of a robot's errors are 60 kB."""
WORD = 4


def encode_state(name: str, data: Any) -> bytes:
    """Return a message with a panel's state: it replaces the one of the same name."""
    text = json.dumps({"name": name, "data": data}, separators=(",", ":"), allow_nan=False)
    return message_header(MessageType.STATE) + text.encode()


def decode_state(message: bytes) -> tuple[str, Any]:
    """Return the name and the data of a panel's state."""
    found = json.loads(message[HEADER.size :])
    return found["name"], found["data"]


@dataclass(frozen=True, eq=False)
class Samples:
    """Rows of numbers, added to those of the same name."""

    name: str
    columns: tuple[str, ...]
    rows: NDArray[np.float32]
    """Shape (k, columns)."""
    restart: bool = False
    """Whether they take the place of all before."""

    def followed_by(self, later: Samples) -> Samples:
        """Return both in one; of too many rows the oldest are dropped."""
        if later.restart or later.columns != self.columns:
            return replace(later, restart=True)
        rows = np.concatenate([self.rows, later.rows])
        return replace(self, rows=rows[-max(1, MOST_FLOATS // max(1, len(self.columns))) :])

    def encoded(self) -> bytes:
        """Return the message."""
        about = {"name": self.name, "columns": self.columns, "restart": self.restart}
        text = json.dumps(about, separators=(",", ":")).encode()
        text += b" " * (-len(text) % WORD)
        return message_header(MessageType.SAMPLES) + LENGTH.pack(len(text)) + text + self.rows.astype("<f4").tobytes()


def decode_samples(message: bytes) -> Samples:
    """Return the rows in a message of them."""
    start = HEADER.size + LENGTH.size
    (length,) = LENGTH.unpack_from(message, HEADER.size)
    about = json.loads(message[start : start + length])
    rows = np.frombuffer(message[start + length :], dtype="<f4").reshape(-1, len(about["columns"]))
    return Samples(about["name"], tuple(about["columns"]), rows, about["restart"])
