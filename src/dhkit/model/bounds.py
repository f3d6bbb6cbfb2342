"""Bounds on files of others that become models: URDFs, meshes, CAD parts and reports of CAD programs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes that are read; larger ones are refused with a message that names the bound, or left out."""

    # URDFs.
    urdf_bytes: int = 5_000_000
    """Size of a URDF."""
    xml_nesting: int = 64
    """Nesting depth of elements."""
    xml_elements: int = 100_000
    """Elements of a file; a humanoid with hands has 5,000."""
    attribute_characters: int = 1_000
    """Characters of an attribute: a name, a path or a list of numbers."""
    links: int = 500
    """Links, and joints: thousands of fixed joints in a row crash Pinocchio."""
    shape_elements: int = 2_000
    """Visual or collision elements of a link."""
    shape_distance: float = 1e6
    """Size and distance of a shape, m."""
    listed_warnings: int = 50
    """Warnings of the reader that are listed; ``notes_characters`` bounds them too."""
    notes_characters: int = 20_000
    """Characters of notes that the robot file of an extracted table holds."""
    parent_folders: int = 20
    """Folders above a URDF that are searched for a package.xml."""
    package_bytes: int = 100_000
    """Size of a package.xml."""

    # Meshes.
    triangles: int = 2_000_000
    """Triangles of a file that is drawn or measured; 50 MB of binary STL hold a million."""
    coordinate: float = 1e12
    """Absolute value of a coordinate, in a file's units: squares and cubes of it are finite doubles."""
    polygon_corners: int = 1_000
    """Corners of a face in a text file."""
    coordinate_characters: int = 64
    """Characters of a coordinate in an STL; 17 significant digits, a sign and an exponent have 24."""
    collada_pieces: int = 5_000
    """Geometries that a COLLADA file's nodes may place: nodes can repeat each other without a limit."""
    collada_nesting: int = 64
    """Nesting depth of nodes, nodes that name other nodes included."""
    shells: int = 400
    """Shells of a mesh that are tested for lying inside others."""
    boolean_triangles: int = 3_000_000
    """Triangles given to manifold3d in all; for more, the test points alone decide."""

    # CAD assemblies.
    cad_files: int = 500
    """Files of an assembly."""
    cad_bytes: int = 600_000_000
    """Size of a part's file."""
    cad_triangles: int = 200_000
    """Triangles of a part without ``simplify``: a browser draws seven such parts well."""
    simplified_triangles: int = 6_000_000
    """Triangles of a part before it is simplified."""
    report_bytes: int = 1_000_000
    """Size of a CAD program's report on masses."""
    report_rows: int = 200
    """Lines of a table of masses, and reports in a text."""
    mat_bytes: int = 100_000_000
    """Size of a MAT file of parts."""
    mat_unpacked_bytes: int = 400_000_000
    """Size of its contents when they are unpacked."""
    mat_parts: int = 100
    """Parts of a MAT file."""
    mat_face_columns: int = 16
    """Columns of a matrix of faces."""


BOUNDS = Bounds()
