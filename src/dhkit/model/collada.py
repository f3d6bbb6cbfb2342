"""COLLADA files as triangles in metres with z up: geometry, nodes, units, and each material's diffuse colour.

Exporters of robots write little of COLLADA 1.4.1 (Khronos 2008), and only that is read: triangles, polylists and
polygons of ``<library_geometries>``, placed by the nodes of the visual scene. No other file, such as a texture, is
opened.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.errors import ModelError
from dhkit.model.bounds import BOUNDS
from dhkit.model.polygons import triangles_of
from dhkit.model.triangle_mesh import TriangleMesh, joined_meshes

_Element = ElementTree.Element
_TO_Z_UP = {
    "X_UP": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]),
    "Y_UP": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "Z_UP": np.eye(3),
}
"""Rotations from a file's axes to those of Z_UP, x to the right and z up: X_UP has -y, Y_UP x to the right (ibid.)."""
_POLYGON_TAGS = ("triangles", "polylist", "polygons")
_TRANSFORM_LENGTHS = {"matrix": 16, "translate": 3, "rotate": 4, "scale": 3}
"""Numbers of a node's transform elements."""


def collada_mesh(content: bytes) -> TriangleMesh:
    """Return the triangles of a COLLADA file that :func:`dhkit.description.mesh_files.check_mesh_file` accepts, m.

    Raises
    ------
    ModelError
        A reference to nothing, a number that is none, or more pieces than ``BOUNDS.collada_pieces``.
    """
    return _Document(content).mesh()


def collada_unit(content: bytes) -> float | None:
    """Return the unit that a COLLADA file states, m; None if it states none.

    Raises
    ------
    ModelError
        No XML, or a unit that is not a positive number.
    """
    return _Document(content).unit()


class _Document:
    """A parsed file, its elements found by their identifiers."""

    def __init__(self, content: bytes) -> None:
        self.root = _without_namespaces(content)
        self.by_id = {
            element.get("id", ""): element for element in self.root.iter() if element.get("id")
        }
        self.geometries: dict[str, list[tuple[str, TriangleMesh]]] = {}
        self.pieces = 0

    def unit(self) -> float | None:
        unit = self.root.find("asset/unit")
        text = None if unit is None else unit.get("meter")
        if text is None:
            return None
        numbers = _numbers(text)
        if len(numbers) != 1 or not (np.isfinite(numbers[0]) and numbers[0] > 0):
            raise ModelError(f"<unit meter> is {text[:20]}; expected a positive number")
        return float(numbers[0])

    def mesh(self) -> TriangleMesh:
        instance = self.root.find("scene/instance_visual_scene")
        scene = (
            self._named(instance)
            if instance is not None
            else self.root.find("library_visual_scenes/visual_scene")
        )
        pieces: list[TriangleMesh] = []
        if scene is not None:
            for node in scene.findall("node"):
                pieces += self._node(node, np.eye(4), 0)
        else:
            for geometry in self.root.iter("geometry"):
                pieces += [mesh for _, mesh in self._geometry(geometry)]
        if not pieces:
            raise ModelError("no triangles")
        mesh = joined_meshes(pieces)
        scale = self.unit() or 1.0
        up = (self.root.findtext("asset/up_axis") or "Y_UP").strip()
        if up not in _TO_Z_UP:
            raise ModelError(f"<up_axis> is {up[:20]!r}; expected X_UP, Y_UP or Z_UP")
        T = np.eye(4)
        T[:3, :3] = _TO_Z_UP[up]
        return mesh.scaled(scale).moved(T)

    def _named(self, element: _Element) -> _Element:
        """Return the element of this file that an element's url or source names."""
        url = element.get("url") or element.get("source") or ""
        named = self.by_id.get(url.removeprefix("#"))
        if not url.startswith("#") or named is None:
            raise ModelError(
                f"<{element.tag}> names {url[:60]!r}; expected an element of this file"
            )
        return named

    def _node(self, node: _Element, T: Array, depth: int) -> Iterator[TriangleMesh]:
        """Yield the geometries of a node and the nodes in it, T the pose of the node around it."""
        if depth > BOUNDS.collada_nesting:
            raise ModelError(f"nodes that name each other more than {BOUNDS.collada_nesting} deep")
        for element in node:
            T = T @ _transform(element)
        linear = T[:3, :3]
        for instance in node.findall("instance_geometry"):
            colours = self._material_colours(instance)
            for symbol, mesh in self._geometry(self._named(instance)):
                self.pieces += 1
                if self.pieces > BOUNDS.collada_pieces:
                    raise ModelError(f"more than {BOUNDS.collada_pieces} pieces")
                placed = mesh.turned() if np.linalg.det(linear) < 0 else mesh
                colour = colours.get(symbol)
                face_colours = None if colour is None else np.tile(colour, (len(mesh.faces), 1))
                yield TriangleMesh(
                    placed.vertices @ linear.T + T[:3, 3], placed.faces, face_colours
                )
        for child in (*node.findall("node"), *map(self._named, node.findall("instance_node"))):
            yield from self._node(child, T, depth + 1)

    def _material_colours(self, instance: _Element) -> dict[str, NDArray[np.uint8]]:
        """Return the diffuse colour of each material symbol of a geometry."""
        colours = {}
        for bound in instance.iter("instance_material"):
            material = self._named_or_none(bound, "target")
            instance_effect = None if material is None else material.find("instance_effect")
            effect = (
                None if instance_effect is None else self._named_or_none(instance_effect, "url")
            )
            color = (
                None
                if effect is None
                else next((e.find("color") for e in effect.iter("diffuse")), None)
            )
            if color is not None and color.text:
                rgb = np.clip(_numbers(color.text)[:3], 0, 1)
                colours[bound.get("symbol", "")] = np.round(255 * rgb).astype(np.uint8)
        return colours

    def _named_or_none(self, element: _Element, key: str) -> _Element | None:
        return self.by_id.get((element.get(key) or "").removeprefix("#"))

    def _geometry(self, geometry: _Element) -> list[tuple[str, TriangleMesh]]:
        """Return a geometry's triangles for each material symbol, in its own coordinates."""
        key = geometry.get("id", "")
        if key not in self.geometries:
            mesh = geometry.find("mesh")
            elements = (
                []
                if mesh is None
                else [element for element in mesh if element.tag in _POLYGON_TAGS]
            )
            self.geometries[key] = [
                (element.get("material", ""), self._polygons(element)) for element in elements
            ]
        return self.geometries[key]

    def _polygons(self, element: _Element) -> TriangleMesh:
        inputs = {source.get("semantic"): source for source in element.findall("input")}
        if "VERTEX" not in inputs:
            raise ModelError(f"<{element.tag}> without an input of vertices")
        offsets = [_whole_number(source.get("offset", "0")) for source in element.findall("input")]
        stride = max(offsets) + 1
        offset = _whole_number(inputs["VERTEX"].get("offset", "0"))
        vertices = self._positions(self._named(inputs["VERTEX"]))
        corners, counts = _corners(element, stride, offset)
        if len(corners) and (corners.min() < 0 or corners.max() >= len(vertices)):
            raise ModelError(
                f"a face with vertex {corners.max()}; the file has vertices 0 to {len(vertices) - 1}"
            )
        return TriangleMesh(vertices, triangles_of(vertices, corners, counts))

    def _positions(self, vertices: _Element) -> Array:
        inputs = {source.get("semantic"): source for source in reversed(vertices.findall("input"))}
        position = inputs.get("POSITION")
        if position is None:
            raise ModelError("<vertices> without an input of positions")
        source = self._named(position)
        accessor = source.find("technique_common/accessor")
        stride = 3 if accessor is None else _whole_number(accessor.get("stride", "3"))
        numbers = _numbers(source.findtext("float_array") or "")
        if stride < 3 or len(numbers) % stride:
            raise ModelError(
                f"{len(numbers)} coordinates with a stride of {stride}; expected whole points"
            )
        return numbers.reshape(-1, stride)[:, :3]


def _without_namespaces(content: bytes) -> _Element:
    """Return the root of an XML document, its tags without namespaces."""
    try:
        iterator = ElementTree.iterparse(io.BytesIO(content), events=("end",))  # noqa: S314 - no entities, bounded
        for _, element in iterator:
            element.tag = element.tag.rpartition("}")[2]
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ModelError(f"no XML: {error}") from None
    root: _Element = iterator.root  # type: ignore[attr-defined]
    return root


def _corners(
    element: _Element, stride: int, offset: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the vertex indices of an element's polygons, one after the other, and how many each polygon has."""
    lists = [_numbers(p.text or "").astype(np.intp) for p in element.findall("p")]
    if any(len(p) % stride for p in lists):
        raise ModelError(f"<{element.tag}> with an incomplete list of indices")
    corners = [p.reshape(-1, stride)[:, offset] for p in lists]
    if element.tag == "polygons":
        counts = np.array([len(p) for p in corners], dtype=np.intp)
    elif element.tag == "polylist":
        counts = _numbers(element.findtext("vcount") or "").astype(np.intp)
    else:
        counts = np.full(sum(len(p) for p in corners) // 3, 3, dtype=np.intp)
    indices = np.concatenate([np.zeros(0, dtype=np.intp), *corners])
    if len(indices) != counts.sum() or (counts < 0).any():
        raise ModelError(
            f"<{element.tag}> with {len(indices)} corners; its counts say {counts.sum()}"
        )
    return indices, counts


def _transform(element: _Element) -> Array:
    """Return the (4, 4) matrix of a node's transform element, the identity for any other."""
    T = np.eye(4)
    if element.tag not in _TRANSFORM_LENGTHS:
        return T
    numbers = _numbers(element.text or "")
    if len(numbers) != _TRANSFORM_LENGTHS[element.tag]:
        raise ModelError(f"<{element.tag}> has {len(numbers)} numbers")
    if element.tag == "matrix":
        T = numbers.reshape(4, 4)
    elif element.tag == "translate":
        T[:3, 3] = numbers
    elif element.tag == "scale":
        T[:3, :3] = np.diag(numbers)
    elif np.any(numbers[:3]):
        # Rodrigues' formula for the unit vector u: R = 1 + sin(angle) [u]x + (1 - cos(angle)) [u]x^2.
        x, y, z = numbers[:3] / np.linalg.norm(numbers[:3])
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = np.radians(numbers[3])
        T[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return T


def _numbers(text: str) -> Array:
    try:
        return np.array(text.split(), dtype=np.float64)
    except ValueError as error:
        raise ModelError(f"{' '.join(str(error).split())[:80]}; expected a number") from None


def _whole_number(text: str) -> int:
    if not (text.isdecimal() and len(text) < 4):
        raise ModelError(f"found {text[:20]!r}; expected a small whole number")
    return int(text)
