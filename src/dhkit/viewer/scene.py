"""An arm as a meshcat scene: objects, their paths, and the poses of its nodes at joint values.

Links are nodes ``/dhkit/link0`` ... ``/dhkit/linkn`` that stand at their DH frames in the world; their parts and
triads are children that never move. ``/dhkit/tool`` stands at the tool's frame.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.frames import world_to_frames
from dhkit.errors import ModelError
from dhkit.viewer.drawables import Lowered, grid_object, part_object, part_transform, triad_object

if TYPE_CHECKING:
    from dhkit.model.shapes import Part

log = logging.getLogger(__name__)

_ROOT = "/dhkit"
_COINCIDENCE = 1e-9
"""Largest distance of origins, as a share of the arm's size, and largest difference of rotation entries, of frames that
coincide: far above the rounding of a chain, far below what is seen."""
_TRIAD_SHARE = 0.13
"""Length of a triad in the browser, as a share of the arm's size."""
PICTURE_TRIAD_SHARE = 0.11
"""Length of a triad in figures and pictures, as a share of the arm's size."""
_NESTED_RATIO = 0.72
"""Length of a triad over that of the one before it at the same origin, so that both are seen."""
_SIZES_PER_OCTAVE = 8
"""Sizes of grid and triads within a factor of 2: an edit that changes the reach a little does not change them."""
_MIN_SIZE = 0.1
"""Smallest size of an arm, m, for one without lengths."""


@dataclass(frozen=True)
class Label:
    """A text at the origin of a frame."""

    frame: int
    """Number of the frame, 0 ... n, or n + 1 for the tool."""
    text: str


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene that a page builds once, and then only moves.

    Attributes
    ----------
    about
        What the page shows of the arm: name, joints, labels, size (m), the upward direction (world); and the node that
        each command gives an object, empty for other commands.
    commands
        meshcat's commands, in order.
    """

    about: Lowered
    commands: tuple[Lowered, ...]


def build_scene(description: Description, parts: Sequence[Part]) -> Scene:
    """Return the scene of an arm in its first configuration, with hidden triads.

    Parameters
    ----------
    description
        The arm.
    parts
        The parts of its links, as ``dhkit.model.shapes.link_parts`` returns them.

    Raises
    ------
    ModelError
        A mesh cannot be read.
    """
    # The next of the sizes that grow in equal ratios.
    steps = math.ceil(_SIZES_PER_OCTAVE * math.log2(scene_size(description)))
    size = float(2.0 ** (steps / _SIZES_PER_OCTAVE))
    places = _shared_origins(description)
    commands = [_set_object(f"{_ROOT}/grid", grid_object(size, "grid"))]
    commands += _part_commands(parts)
    commands += _triad_commands(description, places, size)
    nodes = [f"{_ROOT}/link{i}" for i in range(description.n + 1)] + [f"{_ROOT}/tool"]
    transforms = node_transforms(description, first_configuration(description))
    commands += [_set_transform(path, T) for path, T in zip(nodes, transforms, strict=True)]
    about = {
        "name": description.name,
        "joints": [
            {"name": j.name, "unit": "deg" if j.is_revolute else "m"} for j in description.joints
        ],
        "labels": [
            {"frame": label.frame, "text": label.text} for label in _labels(description, places)
        ],
        "size": size,
        "up": _upward(description),
        "nodes": [
            c["path"].removeprefix(f"{_ROOT}/") if c["type"] == "set_object" else ""
            for c in commands
        ],
    }
    return Scene(about, tuple(commands))


def node_transforms(description: Description, q: ArrayLike) -> Array:
    """Return the poses of the nodes: links 0 ... n and the tool.

    Parameters
    ----------
    q
        Joint values, shape (..., n), rad and m.

    Returns
    -------
    Array
        Poses, shape (..., n + 2, 4, 4), m, world.
    """
    frames = world_to_frames(description, q)
    tool = frames[..., -1:, :, :] @ description.numbers.T_last_tool
    return np.concatenate([frames, tool], axis=-3)


def first_configuration(description: Description) -> Array:
    """Return the joint values that an arm is first shown at, shape (n,), rad and m: its ``ready``, or else zero."""
    ready = description.configurations.get("ready")
    return np.zeros(description.n) if ready is None else np.array([float(value) for value in ready])


def scene_size(description: Description) -> float:
    """Return a bound of the tool's distance from the world's origin, m."""
    numbers = description.numbers
    offsets = np.linalg.norm([numbers.T_world_base[:3, 3], numbers.T_last_tool[:3, 3]], axis=1)
    return max(float(numbers.reach + offsets.sum()), _MIN_SIZE)


def frame_labels(description: Description) -> tuple[Label, ...]:
    """Return one label for each place that frames share in every configuration.

    Frames that coincide are joined by ``=``, those that share only their origin by a comma: ``4, 5, 6 = tool`` at a
    wrist's centre.
    """
    return _labels(description, _shared_origins(description))


def _labels(description: Description, places: list[list[list[int]]]) -> tuple[Label, ...]:
    def names_of_equal(frames: list[int]) -> str:
        return " = ".join(_frame_name(description, i) for i in frames)

    labels = []
    for place in places:
        text = ", ".join(names_of_equal(frames) for frames in place)
        labels.append(Label(place[0][0], text))
    return tuple(labels)


def _shared_origins(description: Description) -> list[list[list[int]]]:
    """Return frames 0 ... n + 1, grouped by common origin and, within a group, by common axes.

    Frames are compared in two random configurations, where a coincidence by chance has probability 0.
    """
    q = np.random.default_rng(0).uniform(0.3, 1.2, (2, description.n))
    T = node_transforms(description, q)
    near = _COINCIDENCE * scene_size(description)
    places: list[list[list[int]]] = []
    for i in range(description.n + 2):
        place = next(
            (p for p in places if np.abs(T[:, p[0][0], :3, 3] - T[:, i, :3, 3]).max() < near), None
        )
        if place is None:
            places.append([[i]])
            continue
        same = next(
            (s for s in place if np.abs(T[:, s[0], :3, :3] - T[:, i, :3, :3]).max() < _COINCIDENCE),
            None,
        )
        if same is None:
            place.append([i])
        else:
            same.append(i)
    return places


def _frame_name(description: Description, frame: int) -> str:
    return "tool" if frame == description.n + 1 else str(frame)


def _part_commands(parts: Sequence[Part]) -> Iterator[Lowered]:
    count: dict[int, int] = {}
    for part in parts:
        k = count[part.link] = count.get(part.link, -1) + 1
        path = f"{_ROOT}/link{part.link}/part{k}"
        try:
            drawn = part_object(part, f"link{part.link}/part{k}")
        except ModelError as error:  # the mesh has a valid header, and content that is not valid
            log.warning("%s; it is left out", error)
            continue
        yield _set_object(path, drawn)
        yield _set_transform(path, part_transform(part))


def _triad_commands(
    description: Description, places: list[list[list[int]]], size: float
) -> Iterator[Lowered]:
    for place in places:
        for k, same in enumerate(place):
            name = _frame_name(description, same[0])
            node = "tool" if name == "tool" else f"link{name}"
            triad = triad_object(_TRIAD_SHARE * size * _NESTED_RATIO**k, f"{node}/frame")
            yield _set_object(f"{_ROOT}/{node}/frame", triad)
            yield {
                "type": "set_property",
                "path": f"{_ROOT}/{node}/frame",
                "property": "visible",
                "value": False,
            }


def _upward(description: Description) -> list[float]:
    """Return the unit vector against gravity, world; z if there is no gravity."""
    gravity = description.numbers.gravity
    strength = float(np.linalg.norm(gravity))
    return [0.0, 0.0, 1.0] if strength == 0 else [float(0.0 - g) / strength for g in gravity]


def _set_object(path: str, drawn: Lowered) -> Lowered:
    return {"type": "set_object", "path": path, "object": drawn}


def _set_transform(path: str, T: Array) -> Lowered:
    return {"type": "set_transform", "path": path, "matrix": [float(entry) for entry in T.T.flat]}
