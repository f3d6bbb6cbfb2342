"""What Python and a page say to each other, as bytes; nothing here does input or output.

Python to page: binary, little-endian. Every message begins with a header of 16 bytes: type (u8), flags (u8), number
of joints n (u16), sequence (u32), time (f64, s). What follows depends on the type:

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

A transform is the upper three rows of a node's pose in the world, row by row: links 0 ... n, then the tool. Page to
Python: JSON ``{"type": "shown", "sequence": 7}`` once a message has been drawn, and where there are panels requests
(:mod:`dhkit.viewer.requests`), each with an answer as JSON text.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

if TYPE_CHECKING:
    from dhkit.viewer.drawables import Lowered
    from dhkit.viewer.scene import Scene

HEADER = struct.Struct("<BBHId")
LENGTH = struct.Struct("<I")
MAX_SEQUENCE = 2**32
FLAG, GHOST_FLAG = 1, 2


class ProtocolError(ValueError):
    """Bytes or text that are no message."""


class MessageType(IntEnum):
    """What a message to a page is about."""

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


@dataclass(frozen=True)
class Header:
    """The first 16 bytes of a message."""

    type: MessageType
    flags: int
    joints: int
    sequence: int
    time: float


@dataclass(frozen=True, eq=False)
class Pose:
    """One state of the arm."""

    q: Array
    """Shape (n,), rad and m."""
    transforms: Array
    """Shape (n + 2, 3, 4): links and tool in the world."""


@dataclass(frozen=True, eq=False)
class Animation:
    """States of the arm over time."""

    times: Array
    """Shape (N,), s."""
    q: Array
    """Shape (N, n), rad and m."""
    transforms: Array
    """Shape (N, n + 2, 3, 4)."""
    trace: bool
    """Whether the tool's path is drawn as it plays."""
    ghost: Array | None
    """A second arm that moves along, translucent: shape (N, n + 2, 3, 4), or None."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """Colored points."""

    points: Array
    """Shape (N, 3), m, in the world."""
    colors: NDArray[np.uint8]
    """Shape (N, 3): red, green and blue."""


@dataclass(frozen=True, eq=False)
class Ghosts:
    """Further states of the arm, shown beside the one that moves."""

    transforms: Array
    """Shape (k, n + 2, 3, 4): links and tool in the world."""
    tints: NDArray[np.uint8]
    """Shape (k, 3): red, green and blue."""


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Solids that stand still: all that is within a radius of a box.

    A ball has no edges, a capsule only one along z; a level square without a third edge stands for a floor.
    """

    transforms: Array
    """Shape (k, 3, 4): the boxes in the world."""
    half_edges: Array
    """Shape (k, 3), m."""
    radii: Array
    """Shape (k,), m."""


def encode_scene(scene: Scene) -> bytes:
    """Return a scene message."""
    import msgpack

    def array(value: Any) -> Any:
        """Return what meshcat gives for an array as msgpack writes it."""
        return msgpack.ExtType(value.type, value.data)

    about = json.dumps(scene.about, separators=(",", ":"), allow_nan=False).encode()
    blocks = [about, *(msgpack.packb(command, default=array) for command in scene.commands)]
    body = b"".join(LENGTH.pack(len(block)) + block for block in blocks)
    return message_header(MessageType.SCENE, joints=len(scene.about["joints"])) + body


def decode_scene(message: bytes) -> tuple[Lowered, list[Lowered]]:
    """Return what a scene message says about the arm, and its commands."""
    import umsgpack

    _expect(message, MessageType.SCENE)
    about, *commands = _blocks(message[HEADER.size :])
    return json.loads(about), [umsgpack.unpackb(command) for command in commands]


def encode_pose(q: Array, transforms: Array, time: float = 0.0) -> bytes:
    """Return a pose message.

    Parameters
    ----------
    q
        Shape (n,), rad and m.
    transforms
        Shape (n + 2, 4, 4): links and tool in the world.
    time
        When, s.
    """
    return message_header(MessageType.POSE, joints=len(q), time=time) + _floats(q) + _floats(transforms[:, :3, :])


def decode_pose(message: bytes) -> Pose:
    """Return the state in a pose message."""
    n = _expect(message, MessageType.POSE).joints
    numbers = _array(message[HEADER.size :], "<f4")
    return Pose(numbers[:n], numbers[n:].reshape(n + 2, 3, 4))


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
        Shape (N,), s, increasing.
    q
        Shape (N, n), rad and m.
    transforms
        Shape (N, n + 2, 4, 4).
    trace
        Whether the tool's path is drawn as it plays.
    ghost
        A second arm that moves along: transforms of the same shape, and red, green and blue, shape (3,).
    """
    flags = FLAG * trace + GHOST_FLAG * (ghost is not None)
    header = message_header(MessageType.ANIMATION, flags=flags, joints=q.shape[1])
    count = LENGTH.pack(len(times)) + LENGTH.pack(0)  # the zero keeps the times on a multiple of 8
    body = header + count + times.astype("<f8").tobytes() + _floats(q) + _floats(transforms[:, :, :3, :])
    return body if ghost is None else body + _floats(ghost[0][:, :, :3, :]) + _bytes(ghost[1])


def decode_animation(message: bytes) -> Animation:
    """Return the states in an animation message."""
    header = _expect(message, MessageType.ANIMATION)
    (count,) = LENGTH.unpack_from(message, HEADER.size)
    n, start = header.joints, HEADER.size + 2 * LENGTH.size
    times = _array(message[start : start + 8 * count], "<f8")
    floats, placed = start + 8 * count, (count, n + 2, 3, 4)
    arms = 2 if header.flags & GHOST_FLAG else 1
    numbers = _array(message[floats : floats + 4 * count * (n + arms * 12 * (n + 2))], "<f4")
    q, transforms, ghost = np.split(numbers, [count * n, count * (n + 12 * (n + 2))])
    return Animation(
        times,
        q.reshape(count, n),
        transforms.reshape(placed),
        bool(header.flags & FLAG),
        ghost.reshape(placed) if arms == 2 else None,
    )


def encode_trace(points: Array) -> bytes:
    """Return a trace message: a polyline in the world, shape (N, 3), m; no points take it away."""
    return message_header(MessageType.TRACE) + _floats(points)


def decode_trace(message: bytes) -> Array:
    """Return the points of a trace message, shape (N, 3), m."""
    _expect(message, MessageType.TRACE)
    return _array(message[HEADER.size :], "<f4").reshape(-1, 3)


def encode_points(points: Array, colors: NDArray[np.uint8]) -> bytes:
    """Return a message of colored points, shapes (N, 3), m and red, green, blue; none take them away."""
    return message_header(MessageType.POINTS) + LENGTH.pack(len(points)) + _floats(points) + _bytes(colors)


def decode_points(message: bytes) -> Cloud:
    """Return the points in a message of them."""
    _expect(message, MessageType.POINTS)
    numbers, colors = _counted(message, 3)
    return Cloud(numbers, colors)


def encode_ellipsoids(transforms: Array) -> bytes:
    """Return a message of ellipsoids: what maps the unit ball to each, shape (k, 4, 4); none take them away."""
    return message_header(MessageType.ELLIPSOIDS) + LENGTH.pack(len(transforms)) + _floats(transforms[:, :3, :])


def decode_ellipsoids(message: bytes) -> Array:
    """Return the transforms in a message of ellipsoids, shape (k, 3, 4)."""
    _expect(message, MessageType.ELLIPSOIDS)
    return _counted(message, 12)[0].reshape(-1, 3, 4)


def encode_ghosts(transforms: Array, tints: NDArray[np.uint8]) -> bytes:
    """Return a message of further states of the arm.

    Parameters
    ----------
    transforms
        Shape (k, n + 2, 4, 4): links and tool in the world; none take the ghosts away.
    tints
        Shape (k, 3): red, green and blue.
    """
    header = message_header(MessageType.GHOSTS, joints=transforms.shape[1] - 2)
    return header + LENGTH.pack(len(transforms)) + _floats(transforms[:, :, :3, :]) + _bytes(tints)


def decode_ghosts(message: bytes) -> Ghosts:
    """Return the states in a message of ghosts."""
    nodes = _expect(message, MessageType.GHOSTS).joints + 2
    transforms, tints = _counted(message, 12 * nodes)
    return Ghosts(transforms.reshape(-1, nodes, 3, 4), tints)


def encode_obstacles(transforms: Array, half_edges: Array, radii: Array) -> bytes:
    """Return a message of :class:`Obstacles`, shapes (k, 4, 4), (k, 3) and (k,), m; none take them away."""
    rows = np.concatenate([transforms[:, :3, :].reshape(-1, 12), half_edges, radii[:, None]], axis=1)
    return message_header(MessageType.OBSTACLES) + LENGTH.pack(len(rows)) + _floats(rows)


def decode_obstacles(message: bytes) -> Obstacles:
    """Return the solids in a message of them."""
    _expect(message, MessageType.OBSTACLES)
    rows = _counted(message, 16)[0]
    return Obstacles(rows[:, :12].reshape(-1, 3, 4), rows[:, 12:15], rows[:, 15])


def encode_frames(visible: bool) -> bytes:
    """Return a message that shows or hides the triads with their labels."""
    return message_header(MessageType.FRAMES, flags=FLAG * visible)


def decode_frames(message: bytes) -> bool:
    """Return whether a message shows the triads."""
    return bool(_expect(message, MessageType.FRAMES).flags & FLAG)


def stamped(message: bytes, sequence: int) -> bytes:
    """Return a message with its sequence number, modulo 2^32."""
    return message[:4] + LENGTH.pack(sequence % MAX_SEQUENCE) + message[8:]


def decode_header(message: bytes) -> Header:
    """Return a message's header.

    Raises
    ------
    ProtocolError
        Too short, or of an unknown type.
    """
    try:
        kind, flags, joints, sequence, time = HEADER.unpack_from(message)
        return Header(MessageType(kind), flags, joints, sequence, time)
    except (struct.error, ValueError) as error:
        raise ProtocolError(f"no message: {error}") from None


def message_header(kind: MessageType, flags: int = 0, joints: int = 0, time: float = 0.0) -> bytes:
    """Return the first 16 bytes of a message that is not stamped yet."""
    return HEADER.pack(kind, flags, joints, 0, time)


def _expect(message: bytes, kind: MessageType) -> Header:
    header = decode_header(message)
    if header.type is not kind:
        raise ProtocolError(f"message type is {header.type.name}; expected {kind.name}")
    return header


def _floats(array: Array) -> bytes:
    return array.astype("<f4").tobytes()


def _array(content: bytes, kind: str) -> Array:
    return np.frombuffer(content, dtype=kind).astype(float)


def _bytes(colors: NDArray[np.uint8]) -> bytes:
    return colors.astype(np.uint8).tobytes()


def _counted(message: bytes, width: int) -> tuple[Array, NDArray[np.uint8]]:
    """Return a message's floats, so many for each of what it counts, and its colors, shapes (k, width) and (., 3)."""
    (count,) = LENGTH.unpack_from(message, HEADER.size)
    start = HEADER.size + LENGTH.size
    end = start + 4 * width * count
    colors = np.frombuffer(message[end:], dtype=np.uint8).reshape(-1, 3)
    return _array(message[start:end], "<f4").reshape(count, width), colors


def _blocks(body: bytes) -> Iterable[bytes]:
    at = 0
    while at < len(body):
        (length,) = LENGTH.unpack_from(body, at)
        at += LENGTH.size
        yield body[at : at + length]
        at += length
