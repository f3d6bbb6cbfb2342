"""Bounds on robot files, and on the files of meshes and MATLAB that belong to robots."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes of a description and of its files; larger ones are refused with a message that names the bound."""

    # Robots.
    joints: int = 32
    """Joints of an arm."""
    parameters: int = 200
    """Named parameters."""
    configurations: int = 100
    """Named configurations."""
    shapes: int = 200
    """Shapes of a link: a humanoid's trunk with both arms locked has 110."""
    bodies: int = 16
    """Rigid bodies of a link."""
    number: float = 1e12
    """Absolute value of a number, SI units: products of several such numbers are finite doubles."""
    name_characters: int = 64
    """Characters of the name of a robot, joint, body or configuration."""
    message_characters: int = 300
    """Characters kept of an expression's own message, which may quote the whole expression."""

    # Robot files.
    file_bytes: int = 1_000_000
    """Size of a robot file."""
    integer_bits: int = 2_048
    """Size of a whole number, in bits: beyond the range of a double."""
    hint_characters: int = 500
    """Characters of a line that are searched for a value without quotes, for the message."""
    path_characters: int = 500
    """Characters of a relative path."""
    path_part_characters: int = 120
    """Characters of a file or folder in a path: 255 bytes is the limit of common file systems."""

    # Mesh files.
    mesh_bytes: int = 50_000_000
    """Size of a mesh file: 50 MB are a million triangles of a binary STL, more than a browser shows well."""
    obj_head_bytes: int = 1_000_000
    """Bytes at the beginning of an OBJ file in which a vertex must stand."""
    ply_header_bytes: int = 65_536
    """Bytes of the header of a PLY file."""
    collada_nesting: int = 64
    """Nesting depth of elements in a COLLADA file; exporters write about 12 levels."""

    # MAT files.
    mat_axes: int = 8
    """Axes of an array."""
    mat_name_characters: int = 63
    """Characters of a name, MATLAB's own bound."""
    mat_nesting: int = 6
    """Nesting depth of structs."""
    mat_variables: int = 20_000
    """Variables of a file, fields of structs included."""


BOUNDS = Bounds()
