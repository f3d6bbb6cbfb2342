"""Parts of an arm, triads and the floor's grid as meshcat objects, written as plain data."""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dhkit.description import Array, Box, Capsule, Cylinder, Mesh, Sphere
from dhkit.errors import ModelError
from dhkit.model.mesh_reader import mesh_header, read_mesh
from dhkit.model.stl import binary_stl
from dhkit.packages import imported
from dhkit.viewer.overlays import AXIS_COLORS, rgb_bytes

if TYPE_CHECKING:
    from dhkit.model.shapes import Part

Lowered: TypeAlias = dict[str, Any]
"""A meshcat object or command as dictionaries, lists, numbers and bytes."""

_Y_TO_Z = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=float)
"""meshcat's cylinders stand along y, dhkit's along z: a quarter turn about x."""

_ROUND_SIDES = 48
"""Sides of round solids; a multiple of 4, so that the silhouette has the true radius."""

_FRONT_SIDE = 0
"""three.js's number for drawing the front of triangles."""
_BOTH_SIDES = 2
"""three.js's number for drawing both sides, at twice the cost: triangles of a file may be reversed."""

_ARROW_SIDES = 8
_HALF_LINE_PIECES = 3
"""Pieces of half a grid line: opacity is linear along each, and each costs time without a graphics processor."""


def part_object(part: Part, name: str) -> Lowered:
    """Return a part's meshcat object, in meshcat's axes for its geometry.

    Parameters
    ----------
    part
        A drawn part of a link.
    name
        Name of its pieces, instead of meshcat's random identifiers, so that equal scenes are equal bytes.

    Raises
    ------
    ModelError
        A mesh has no readable file.
    """
    meshcat = _meshcat()
    side = _BOTH_SIDES if isinstance(part.geometry, Mesh) else _FRONT_SIDE
    material = meshcat.MeshPhongMaterial(
        color=int(part.color[1:], 16), shininess=40, specular=0x222222, side=side
    )
    return _lowered("Mesh", _geometry(part), material, name)


def part_transform(part: Part) -> Array:
    """Return the map from the coordinates of a part's meshcat object to its link's DH frame, shape (4, 4), m.

    It is the part's own pose with the mesh's scale or, for cylinders and capsules, the turn from y to z.
    """
    T = part.T_link_part.copy()
    if isinstance(part.geometry, Mesh):
        # May mirror: both sides are drawn.
        T[:3, :3] *= [float(factor) for factor in part.geometry.scale]
    if isinstance(part.geometry, Cylinder | Capsule):
        T = np.matmul(T, _Y_TO_Z)
    return T


def triad_object(length: float, name: str) -> Lowered:
    """Return three arrows along x, y and z, red, green and blue, drawn over everything in front of them.

    Parameters
    ----------
    length
        Length of the arrows, m.
    name
        As for :func:`part_object`.
    """
    meshcat = _meshcat()
    vertices, faces = _arrow()
    # A cyclic change of axes keeps the triangles' sense.
    along = [np.roll(vertices, axis, axis=1) for axis in range(3)]
    geometry = meshcat.TriangularMeshGeometry(
        length * np.concatenate(along),
        np.concatenate([faces + axis * len(vertices) for axis in range(3)]),
        np.repeat(rgb_bytes(AXIS_COLORS) / 255, len(vertices), axis=0),
    )
    material = meshcat.MeshBasicMaterial(vertexColors=True, depthTest=False, transparent=True)
    return _lowered("Mesh", geometry, material, name)


def grid_step(size: float) -> float:
    """Return the distance between grid lines, m: about a sixth of a size (m), and 1, 2 or 5 times a power of ten.

    Examples
    --------
    >>> grid_step(1.5), grid_step(0.2)
    (0.2, 0.05)
    """
    power = 10.0 ** np.floor(np.log10(size / 6))
    steps = [round(float(power * digit), 12) for digit in (1, 2, 5, 10)]
    return min(steps, key=lambda step: abs(np.log(step * 6 / size)))


def grid_object(size: float, name: str) -> Lowered:
    """Return a square grid in the plane z = 0 that fades towards its edge; the page gives it its color.

    Parameters
    ----------
    size
        The arm's size, m: the grid reaches a little beyond it on every side.
    name
        As for :func:`part_object`.
    """
    meshcat = _meshcat()
    step = grid_step(size)
    lines = int(np.ceil(1.3 * size / step))
    half = lines * step
    across = step * np.arange(-lines, lines + 1)
    along = np.linspace(-half, half, 2 * _HALF_LINE_PIECES + 1)
    x, y = np.meshgrid(along, across)
    line = np.stack([x, y, np.zeros_like(x)], axis=-1)
    segments = np.stack([line[:, :-1], line[:, 1:]], axis=2).reshape(-1, 2, 3)
    # The corners are fully faded.
    segments = segments[np.linalg.norm(segments, axis=2).min(axis=1) < half]
    points = np.concatenate([segments, segments[..., [1, 0, 2]]]).reshape(-1, 3)
    opacity = np.clip(1 - np.hypot(points[:, 0], points[:, 1]) / half, 0, 1)
    colors = np.concatenate([np.ones((3, len(points))), opacity[None]])
    geometry = meshcat.PointsGeometry(points.T.astype(np.float32), colors.astype(np.float32))
    return _lowered(
        "LineSegments",
        geometry,
        meshcat.LineBasicMaterial(vertexColors=True, transparent=True),
        name,
    )


def _meshcat() -> Any:
    """Return meshcat's geometry module; importing the package takes half a second, and warns about zmq."""
    import warnings

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=DeprecationWarning, message="zmq")
        return imported("meshcat.geometry", "the viewer")


def _lowered(kind: str, geometry: Any, material: Any, name: str) -> Lowered:
    drawn = getattr(_meshcat(), kind)(geometry, material)
    geometry.uuid = f"{name}/geometry"
    material.uuid = f"{name}/material"
    drawn.uuid = name
    lowered: Lowered = drawn.lower()
    return lowered


def _geometry(part: Part) -> Any:
    meshcat = _meshcat()
    shape = part.geometry
    match shape:
        case Mesh():
            return _mesh(part, shape)
        case Box():
            return meshcat.Box([float(edge) for edge in shape.size])
        case Sphere():
            return _lathe(_arc(float(shape.radius), 0.0, -90, 90))
        case Cylinder():
            cylinder = meshcat.Cylinder(float(shape.length), float(shape.radius))
            cylinder.radialSegments = _ROUND_SIDES
            return cylinder
        case Capsule():
            radius = float(shape.radius)
            half = float(shape.length) / 2
            return _lathe(np.concatenate([_arc(radius, -half, -90, 0), _arc(radius, half, 0, 90)]))


def _mesh(part: Part, shape: Mesh) -> Any:
    """Return a binary STL of a mesh in its file's own scale: a page reads no other format.

    So a COLLADA file has its unit and up axis applied, and the page opens nothing that a file names.
    """
    if part.file is None:
        raise ModelError(
            f"link {part.link}: mesh {shape.path!r} has no folder; expected a robot read from a file"
        )
    try:
        mesh = read_mesh(part.file)
        is_binary = mesh_header(part.file).format == "stl"
        content = part.file.read_bytes() if is_binary else binary_stl("dhkit", mesh.corners)
    except ModelError as error:
        raise ModelError(f"link {part.link}: mesh {error}") from None
    except OSError as error:
        raise ModelError(f"link {part.link}: mesh {part.file}: {error.strerror or error}") from None
    return _meshcat().StlMeshGeometry.from_stream(io.BytesIO(content))


def _lathe(outline: Array) -> Any:
    """Return three.js's surface of revolution about y of an outline, shape (k, 2), m: distance from y, and height."""

    class Lathe(_meshcat().Geometry):  # type: ignore[misc]  # meshcat-python has none
        def lower(self, object_data: Lowered) -> Lowered:
            points = [{"x": float(x), "y": float(y)} for x, y in outline]
            return {
                "uuid": self.uuid,
                "type": "LatheGeometry",
                "points": points,
                "segments": _ROUND_SIDES,
            }

    return Lathe()


def _arc(radius: float, height: float, start: float, stop: float) -> Array:
    """Return points of a circle between two latitudes, degrees, shape (k, 2), m: distance from the axis, and height."""
    steps = round(abs(stop - start) / 360 * _ROUND_SIDES)
    latitude = np.radians(np.linspace(start, stop, steps + 1))
    return np.stack(
        [radius * np.maximum(np.cos(latitude), 0), height + radius * np.sin(latitude)], axis=1
    )


def _arrow() -> tuple[Array, np.ndarray[Any, np.dtype[np.uint32]]]:
    """Return an arrow of length 1 along x, a rod with a cone: vertices, shape (k, 3), and triangles, shape (m, 3)."""
    turn = math.tau * np.arange(_ARROW_SIDES) / _ARROW_SIDES
    rings = [(0.0, 0.02), (0.8, 0.02), (0.8, 0.055), (1.0, 0.0)]
    vertices = np.concatenate(
        [
            np.stack([np.full(_ARROW_SIDES, x), r * np.cos(turn), r * np.sin(turn)], axis=1)
            for x, r in rings
        ]
    )
    i = np.arange(_ARROW_SIDES)
    j = (i + 1) % _ARROW_SIDES
    bands = [
        k * _ARROW_SIDES
        + np.array([[i, j, j + _ARROW_SIDES], [i, j + _ARROW_SIDES, i + _ARROW_SIDES]])
        for k in range(3)
    ]
    faces = np.concatenate([band.transpose(0, 2, 1).reshape(-1, 3) for band in bands])
    return vertices, faces.astype(np.uint32)
