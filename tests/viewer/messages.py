"""Messages of :mod:`dhkit.viewer.protocol` read back from their bytes, as a page reads them."""

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.viewer.drawables import Lowered
from dhkit.viewer.protocol import (
    GHOST_FLAG,
    HEADER,
    LENGTH,
    VISIBLE_FLAG as FLAG,
    MessageType,
    ProtocolError,
    Samples,
)


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


def decode_scene(message: bytes) -> tuple[Lowered, list[Lowered]]:
    """Return what a scene message says about the arm, and its commands."""
    import umsgpack

    _expect(message, MessageType.SCENE)
    about, *commands = _blocks(message[HEADER.size :])
    return json.loads(about), [umsgpack.unpackb(command) for command in commands]


def decode_pose(message: bytes) -> Pose:
    """Return the state in a pose message."""
    n = _expect(message, MessageType.POSE).joints
    numbers = _array(message[HEADER.size :], "<f4")
    return Pose(numbers[:n], numbers[n:].reshape(n + 2, 3, 4))


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


def decode_trace(message: bytes) -> Array:
    """Return the points of a trace message, shape (N, 3), m."""
    _expect(message, MessageType.TRACE)
    return _array(message[HEADER.size :], "<f4").reshape(-1, 3)


def decode_points(message: bytes) -> Cloud:
    """Return the points in a message of them."""
    _expect(message, MessageType.POINTS)
    numbers, colors = _counted(message, 3)
    return Cloud(numbers, colors)


def decode_ellipsoids(message: bytes) -> Array:
    """Return the transforms in a message of ellipsoids, shape (k, 3, 4)."""
    _expect(message, MessageType.ELLIPSOIDS)
    return _counted(message, 12)[0].reshape(-1, 3, 4)


def decode_ghosts(message: bytes) -> Ghosts:
    """Return the states in a message of ghosts."""
    nodes = _expect(message, MessageType.GHOSTS).joints + 2
    transforms, tints = _counted(message, 12 * nodes)
    return Ghosts(transforms.reshape(-1, nodes, 3, 4), tints)


def decode_obstacles(message: bytes) -> Obstacles:
    """Return the solids in a message of them."""
    _expect(message, MessageType.OBSTACLES)
    rows = _counted(message, 16)[0]
    return Obstacles(rows[:, :12].reshape(-1, 3, 4), rows[:, 12:15], rows[:, 15])


def decode_frames(message: bytes) -> bool:
    """Return whether a message shows the triads."""
    return bool(_expect(message, MessageType.FRAMES).flags & FLAG)


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


def _expect(message: bytes, kind: MessageType) -> Header:
    header = decode_header(message)
    if header.type is not kind:
        raise ProtocolError(f"message type is {header.type.name}; expected {kind.name}")
    return header


def _array(content: bytes, kind: str) -> Array:
    return np.frombuffer(content, dtype=kind).astype(float)


def _counted(message: bytes, width: int) -> tuple[Array, NDArray[np.uint8]]:
    """Return a message's floats, so many for each of what it counts, and its colors, shapes (k, width) and (., 3)."""
    (count,) = LENGTH.unpack_from(message, HEADER.size)
    start = HEADER.size + LENGTH.size
    end = start + 4 * width * count
    colors = np.frombuffer(message[end:], dtype=np.uint8).reshape(-1, 3)
    return _array(message[start:end], "<f4").reshape(count, width), colors


def _blocks(body: bytes) -> Iterator[bytes]:
    at = 0
    while at < len(body):
        (length,) = LENGTH.unpack_from(body, at)
        at += LENGTH.size
        yield body[at : at + length]
        at += length


def decode_state(message: bytes) -> tuple[str, Any]:
    """Return the name and the data of a panel's state."""
    found = json.loads(message[HEADER.size :])
    return found["name"], found["data"]


def decode_samples(message: bytes) -> Samples:
    """Return the rows in a message of them."""
    start = HEADER.size + LENGTH.size
    (length,) = LENGTH.unpack_from(message, HEADER.size)
    about = json.loads(message[start : start + length])
    rows = np.frombuffer(message[start + length :], dtype="<f4").reshape(-1, len(about["columns"]))
    return Samples(about["name"], tuple(about["columns"]), rows, about["restart"])
