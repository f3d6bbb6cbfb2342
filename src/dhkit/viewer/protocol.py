"""Messages from Python to a page, as bytes; nothing here does input or output.

Messages are binary, little-endian. Every message begins with a header of 16 bytes: type (u8), flags (u8), number of
joints n (u16), sequence (u32), time (f64, s). What follows depends on the type:

- scene: length (u32) and JSON about the arm; then, to the end, length (u32) and a meshcat command in msgpack;
- pose: q (f32, n), transforms (f32, (n + 2) x 12);
- animation: count N (u32), zero (u32), times (f64, N), q (f32, N x n), transforms (f32, N x (n + 2) x 12); flag 1
  draws the tool's path; with flag 2 a ghost moves along: its transforms (f32, N x (n + 2) x 12) and tint (u8, 3);
- trace: points in the world (f32, N x 3);
- frames: nothing; flag 1 shows them;
- points: count N (u32), then points in the world (f32, N x 3) and their colors (u8, N x 3);
- ellipsoids: count k (u32), then transforms of the unit ball (f32, k x 12);
- ghosts: count k (u32), then transforms (f32, k x (n + 2) x 12) and tints (u8, k x 3);
- obstacles: count k (u32), then of each a transform (f32, 12), half edges (f32, 3) and a radius (f32);
- state: JSON ``{"name": ..., "data": ...}`` to the end, for a panel;
- samples: length (u32) and JSON ``{"name": ..., "columns": [...], "restart": false}``, padded to a multiple of 4, then
  rows (f32) to the end.

A transform is the upper three rows of a node's pose in the world, row by row: links 0 ... n, then the tool. Encoders
take transforms of shape (..., 4, 4). Page to Python: JSON ``{"type": "shown", "sequence": 7}`` once a message has been
drawn, and where there are panels requests (:mod:`dhkit.viewer.requests`), each with an answer as JSON text.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.viewer.bounds import BOUNDS

if TYPE_CHECKING:
    from dhkit.viewer.scene import Scene

HEADER = struct.Struct("<BBHId")
LENGTH = struct.Struct("<I")
MAX_SEQUENCE = 2**32
VISIBLE_FLAG = 1
"""Flag of a message: the frames or the tool's path are drawn."""
GHOST_FLAG = 2
"""Flag of a message: a ghost moves along."""
_WORD = 4
"""Bytes of a float: samples begin at a multiple of them."""


class ProtocolError(ValueError):
    """Bytes or text that are not message."""


class MessageType(IntEnum):
    """The type of a message to a page."""

    SCENE = 1
    POSE = 2
    ANIMATION = 3
    TRACE = 4
    FRAMES = 5
    POINTS = 6
    ELLIPSOIDS = 7
    GHOSTS = 8
    OBSTACLES = 9
    STATE = 10
    SAMPLES = 11


def encode_scene(scene: Scene) -> bytes:
    """Return a scene message."""
    import msgpack

    def packed_array(value: Any) -> Any:
        """Return what meshcat gives for an array as msgpack writes it."""
        return msgpack.ExtType(value.type, value.data)

    blocks = [
        _json(scene.about),
        *(msgpack.packb(command, default=packed_array) for command in scene.commands),
    ]
    body = b"".join(LENGTH.pack(len(block)) + block for block in blocks)
    return _message(MessageType.SCENE, body, joints=len(scene.about["joints"]))


def encode_pose(q: Array, transforms: Array, time: float = 0.0) -> bytes:
    """Return a pose message.

    Parameters
    ----------
    q
        Joint values, shape (n,), rad and m.
    transforms
        Poses of links and tool, shape (n + 2, 4, 4), m, world.
    time
        Time of the state, s.
    """
    return _message(MessageType.POSE, q, transforms[:, :3], joints=len(q), time=time)


def encode_animation(
    times: Array,
    q: Array,
    transforms: Array,
    *,
    trace: bool,
    ghost: tuple[Array, NDArray[np.uint8]] | None = None,
) -> bytes:
    """Return an animation message.

    Parameters
    ----------
    times
        Times, shape (N,), s, increasing.
    q
        Joint values, shape (N, n), rad and m.
    transforms
        Poses of links and tool, shape (N, n + 2, 4, 4), m, world.
    trace
        Whether the tool's path is drawn as it plays.
    ghost
        A second, translucent arm that moves along: poses of the same shape, and red, green and blue, shape (3,).
    """
    flags = VISIBLE_FLAG * trace + GHOST_FLAG * (ghost is not None)
    count = LENGTH.pack(len(times)) + LENGTH.pack(0)  # the zero keeps the times on a multiple of 8
    ghost_parts = () if ghost is None else (ghost[0][:, :, :3], ghost[1])
    parts = (count, times.astype("<f8").tobytes(), q, transforms[:, :, :3], *ghost_parts)
    return _message(MessageType.ANIMATION, *parts, flags=flags, joints=q.shape[1])


def encode_trace(points: Array) -> bytes:
    """Return a trace message: a line through points, shape (N, 3), m, world; no points take it away."""
    return _message(MessageType.TRACE, points)


def encode_points(points: Array, colors: NDArray[np.uint8]) -> bytes:
    """Return a message of points, shape (N, 3), m, world, with colors, shape (N, 3); no points take them away."""
    return _message(MessageType.POINTS, LENGTH.pack(len(points)), points, colors)


def encode_ellipsoids(transforms: Array) -> bytes:
    """Return a message of ellipsoids: the maps of the unit ball to them, shape (k, 4, 4), m; none take them away."""
    return _message(MessageType.ELLIPSOIDS, LENGTH.pack(len(transforms)), transforms[:, :3])


def encode_ghosts(transforms: Array, tints: NDArray[np.uint8]) -> bytes:
    """Return a message of further states of the arm.

    Parameters
    ----------
    transforms
        Poses of links and tool, shape (k, n + 2, 4, 4), m, world; none take the ghosts away.
    tints
        Red, green and blue, shape (k, 3).
    """
    count = LENGTH.pack(len(transforms))
    return _message(
        MessageType.GHOSTS, count, transforms[:, :, :3], tints, joints=transforms.shape[1] - 2
    )


def encode_obstacles(transforms: Array, half_edges: Array, radii: Array) -> bytes:
    """Return a message of solids that stand still: all that is within a radius of a box; none take them away.

    A ball has no edges, a capsule only one along z; a level square without a third edge stands for a floor.

    Parameters
    ----------
    transforms
        Poses of the boxes, shape (k, 4, 4), m, world.
    half_edges
        Half edges of the boxes, shape (k, 3), m.
    radii
        Radii, shape (k,), m.
    """
    rows = np.concatenate(
        [transforms[:, :3, :].reshape(-1, 12), half_edges, radii[:, None]], axis=1
    )
    return _message(MessageType.OBSTACLES, LENGTH.pack(len(rows)), rows)


def encode_frames(visible: bool) -> bytes:
    """Return a message that shows or hides the triads with their labels."""
    return _message(MessageType.FRAMES, flags=VISIBLE_FLAG * visible)


def encode_state(name: str, data: object) -> bytes:
    """Return a message with a panel's state, of values that JSON can hold: it replaces the state of the same name."""
    return _message(MessageType.STATE, _json({"name": name, "data": data}))


@dataclass(frozen=True, eq=False)
class Samples:
    """Rows of numbers, added to those of the same name.

    Attributes
    ----------
    name, columns
        Names of the samples and of the numbers of a row.
    rows
        The numbers, shape (k, columns).
    restart
        Whether the rows replace all earlier ones.
    """

    name: str
    columns: tuple[str, ...]
    rows: NDArray[np.float32]
    restart: bool = False

    def followed_by(self, later: Samples) -> Samples:
        """Return the rows of both; of more than ``BOUNDS.sample_numbers`` numbers the oldest rows are dropped."""
        if later.restart or later.columns != self.columns:
            return replace(later, restart=True)
        rows = np.concatenate([self.rows, later.rows])
        return replace(
            self, rows=rows[-max(1, BOUNDS.sample_numbers // max(1, len(self.columns))) :]
        )

    def encoded(self) -> bytes:
        """Return the samples as a message."""
        text = _json({"name": self.name, "columns": self.columns, "restart": self.restart})
        text += b" " * (-len(text) % _WORD)
        return _message(MessageType.SAMPLES, LENGTH.pack(len(text)), text, self.rows)


def stamped(message: bytes, sequence: int) -> bytes:
    """Return a message with its sequence number, modulo 2^32."""
    return message[:4] + LENGTH.pack(sequence % MAX_SEQUENCE) + message[8:]


def _message(
    kind: MessageType,
    *parts: bytes | NDArray[Any],
    flags: int = 0,
    joints: int = 0,
    time: float = 0.0,
) -> bytes:
    """Return a message with sequence 0; arrays become floats of four bytes, except those of bytes."""
    arrays = (part if isinstance(part, bytes) else _bytes(part) for part in parts)
    return HEADER.pack(kind, flags, joints, 0, time) + b"".join(arrays)


def _bytes(array: NDArray[Any]) -> bytes:
    return (array if array.dtype == np.uint8 else array.astype("<f4")).tobytes()


def _json(data: object) -> bytes:
    return json.dumps(data, separators=(",", ":"), allow_nan=False).encode()
