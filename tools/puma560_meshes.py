"""Link meshes of the Unimation PUMA 560 (500 series), drawn by our own code.

Each mesh is in metres in its link's own standard Denavit-Hartenberg frame (Corke & Armstrong-Helouvry 1994; frame 0
on the floor, z up). Along the shoulder axis z1 = z2 the upper arm's slab is centred at the shoulder offset of
Armstrong, Khatib & Burdick 1986 (0.2435 m), and the forearm comes back to d3 = 0.15005 m, where frame 3 has y = 0.
Joint axes and offsets are the published ones; the castings around them resemble those of the arm, not measured.

Solids are lofts of rounded outlines joined by manifold3d. Coordinates are rounded before and after the Booleans, and
vertices and faces are sorted, so that every run gives the same bytes.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from manifold3d import Manifold, Mesh64

from dhkit.description import Array, write_atomically
from dhkit.model.stl import binary_stl

Axis = Literal["x", "y", "z"]
Disc = tuple[float, float, float]
"""Centre (u, v) and radius of a disc, m."""

UPPER_ARM_LENGTH = 0.4318
"""a2: the shoulder axis to the elbow axis, m."""
ELBOW_SETBACK = -0.0203
"""-a3: the elbow axis along x of frame 3, m."""
FLANGE_FACE = 0.05625
"""The wrist centre to the tool flange's face, along z of frame 6, m (d6 of Fu, Gonzalez & Lee 1987)."""
BALL_EDGE = float(np.arcsin(0.0255 / 0.035))
"""Latitude at which the wrist's ball is cut flat, 1 mm inside the fork's cheeks, rad."""

SIDES = 32
"""Directions per outline: it looks round, and every link stays under 50 kB."""
SMALL_SIDES = 12
"""Directions per outline of a hole or a bolt's head."""
DECIMALS = 6
"""Decimals of coordinates, m: micrometres are invisible, and far above the rounding errors of sines on any machine."""

STL_TITLE = "PUMA 560, dhkit, metres, standard DH link frame: "


def puma560_meshes() -> dict[str, trimesh.Trimesh]:
    """Make the seven link meshes of a PUMA 560.

    Returns
    -------
    dict
        Watertight meshes, m, from link 0 to link 6: base, shoulder, upper_arm, forearm, wrist_roll, wrist_pitch,
        flange; each in the standard DH frame of its link. Vertices are sorted, the same on every run.
    """
    links = (_base, _shoulder, _upper_arm, _forearm, _wrist_roll, _wrist_pitch, _flange)
    return {link.__name__.removeprefix("_"): _canonical(link()) for link in links}


def write_puma560_meshes(folder: Path) -> list[Path]:
    """Write the meshes as binary STL, folder/NAME.stl, m, each whole or not at all.

    Parameters
    ----------
    folder
        Created if it does not exist; files of the same names are replaced.

    Returns
    -------
    list of Path
        The files, from link 0 to link 6.
    """
    meshes = {folder / f"{name}.stl": (name, mesh) for name, mesh in puma560_meshes().items()}
    for path, (name, mesh) in meshes.items():
        write_atomically(path, binary_stl(STL_TITLE + name, np.asarray(mesh.vertices)[mesh.faces]))
    return list(meshes)


def _base() -> Manifold:
    """Return link 0: a bolted foot, a flared column and the connector box behind it; frame 0, z up from the floor."""
    foot = _revolve(
        [
            (0.160, 0.0),
            (0.160, 0.020),
            (0.155, 0.025),
            (0.118, 0.025),
            (0.103, 0.060),
            (0.095, 0.085),
        ]
    )
    column = _revolve([(0.095, 0.080), (0.095, 0.535), (0.090, 0.540)])
    box = _plate(
        [(z, x, 0.012) for z in (0.075, 0.185) for x in (-0.128, -0.060)], -0.062, 0.062, 0.006, "y"
    )
    duct = _plate(
        [(z, x, 0.012) for z in (0.100, 0.440) for x in (-0.100, -0.060)], -0.024, 0.024, 0.006, "y"
    )
    bolts = _copies_around_z(
        _revolve([(0.011, 0.020), (0.011, 0.034)], SMALL_SIDES), radius=0.139, count=4
    )
    return foot + column + box + duct + bolts


def _shoulder() -> Manifold:
    """Return link 1: a collar on the column and a horizontal barrel with a cap; frame 1, y up, z along the barrel."""
    collar = _revolve(
        [(0.082, -0.150), (0.082, -0.122), (0.095, -0.122), (0.095, -0.080), (0.085, -0.030)],
        axis="y",
    )
    barrel = _revolve([(0.086, -0.142), (0.098, -0.130), (0.098, 0.182), (0.092, 0.188)])
    cap = _revolve([(0.068, -0.156), (0.072, -0.152), (0.072, -0.130)])
    return collar + barrel + cap - _revolve([(0.054, -0.160), (0.054, -0.148)])


def _upper_arm() -> Manifold:
    """Return link 2: a tapered slab with the motors' tail behind the shoulder; frame 2, the shoulder at x = -a2."""
    shoulder = -UPPER_ARM_LENGTH
    tail = [(shoulder - 0.125, v, 0.035) for v in (-0.085, 0.085)]
    slab = _plate([*tail, (shoulder, 0.0, 0.128), (0.0, 0.0, 0.080)], 0.196, 0.300, 0.010)
    cover = _plate([(shoulder + 0.155, 0.0, 0.074), (-0.115, 0.0, 0.056)], 0.296, 0.304, 0.003)
    hub = _revolve([(0.080, 0.160), (0.080, 0.308)], at=(shoulder, 0.0, 0.0))
    recess = _revolve([(0.060, 0.302), (0.060, 0.320)], at=(shoulder, 0.0, 0.0))
    elbow_cap = _revolve([(0.055, 0.296), (0.055, 0.306)])
    return slab + cover + hub - recess + elbow_cap


def _forearm() -> Manifold:
    """Return link 3: a slab with a small tail, tapering from elbow to wrist; frame 3, z to the wrist, y inward."""
    profile = [(-0.055, ELBOW_SETBACK, 0.050), (0.0, ELBOW_SETBACK, 0.078), (0.275, 0.0, 0.046)]
    slab = _plate(profile, -0.040, 0.044, 0.008, "y")
    hub = _revolve(
        [(0.060, -0.060), (0.060, 0.046), (0.056, 0.050)], axis="y", at=(ELBOW_SETBACK, 0.0, 0.0)
    )
    nose = _revolve([(0.041, 0.240), (0.041, 0.330), (0.038, 0.333)])
    return slab + hub + nose


def _wrist_roll() -> Manifold:
    """Return link 4: the roll cylinder, forked for the pitch axis; frame 4, y along the forearm, z the pitch axis."""
    neck = _revolve([(0.030, -0.115), (0.030, -0.090)], axis="y")
    cylinder = _revolve([(0.037, -0.095), (0.040, -0.092), (0.040, 0.040)], axis="y")
    rounded = _plate(
        [(-0.020, -0.095, 0.028), (0.020, -0.095, 0.028), (0.0, 0.0, 0.032)], -0.050, 0.050, 0.0
    )
    slot = _plate(
        [(x, y, 0.001) for x in (-0.060, 0.060) for y in (-0.040, 0.060)], -0.0265, 0.0265, 0.0
    )
    return neck + (cylinder ^ rounded) - slot


def _wrist_pitch() -> Manifold:
    """Return link 5: the ball in the fork with its trunnions and the neck; frame 5, y the pitch axis, z to the tool."""
    # A sphere of 35 mm, cut flat where the fork's cheeks pass.
    latitude = np.linspace(-BALL_EDGE, BALL_EDGE, 7)
    ball = _revolve(
        [(0.035 * np.cos(angle), 0.035 * np.sin(angle)) for angle in latitude], axis="y"
    )
    trunnion = _revolve(
        [(0.014, -0.0435), (0.016, -0.0415), (0.016, 0.0415), (0.014, 0.0435)], axis="y"
    )
    return ball + trunnion + _revolve([(0.024, 0.0), (0.024, 0.040)])


def _flange() -> Manifold:
    """Return link 6: the tool flange with its pilot bore and four bolt holes; frame 6, z out of the flange."""
    spigot = _revolve([(0.018, 0.028), (0.018, 0.044)])
    disc = _revolve(
        [(0.030, 0.042), (0.0315, 0.0435), (0.0315, FLANGE_FACE - 0.0015), (0.030, FLANGE_FACE)]
    )
    bore = _revolve([(0.010, FLANGE_FACE - 0.006), (0.010, FLANGE_FACE + 0.010)])
    hole = _revolve([(0.0035, FLANGE_FACE - 0.008), (0.0035, FLANGE_FACE + 0.010)], SMALL_SIDES)
    return spigot + disc - bore - _copies_around_z(hole, radius=0.021, count=4)


def _outline(discs: Sequence[Disc], inset: float = 0.0, sides: int = SIDES) -> Array:
    """Return the convex outline around discs, shape (sides, 2), m: the support points of their hull."""
    # Half a step off the axes, and rounded, so that no last bit of a sine decides between two discs.
    angle = (np.arange(sides) + 0.5) * (2 * np.pi / sides)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    centre, radius = np.split(np.asarray(discs, dtype=float), [2], axis=-1)
    support = np.round(direction @ centre.T + radius.T, 9)
    farthest = np.argmax(support, axis=-1)
    outline: Array = centre[farthest] + (radius[farthest] - inset) * direction
    return outline


def _loft(
    sections: Sequence[tuple[Array, float]], axis: Axis = "z", at: Sequence[float] = (0, 0, 0)
) -> Manifold:
    """Return the solid between convex outlines, shape (sides, 2), at increasing heights along an axis through `at`, m.

    (u, v) of an outline is (x, y) along z, (y, z) along x and (z, x) along y.
    """
    sides = len(sections[0][0])
    levels = [np.column_stack([outline, np.full(sides, height)]) for outline, height in sections]
    vertices = np.roll(np.concatenate(levels), "zxy".index(axis), axis=-1) + np.asarray(at)
    faces = [*_caps(sides, len(levels)), *_walls(sides, len(levels))]
    return Manifold(Mesh64(np.round(vertices, DECIMALS), np.array(faces, dtype=np.uint64)))


def _caps(sides: int, levels: int) -> list[tuple[int, int, int]]:
    """Return fans of triangles over the lowest and the highest outline of a loft."""
    top = (levels - 1) * sides
    bottom = [(0, k + 1, k) for k in range(1, sides - 1)]
    return bottom + [(top, top + k, top + k + 1) for k in range(1, sides - 1)]


def _walls(sides: int, levels: int) -> list[tuple[int, int, int]]:
    """Return two triangles between each pair of neighbouring vertices and the pair above it."""
    faces = []
    for level in range(levels - 1):
        for k in range(sides):
            a, b = level * sides + k, level * sides + (k + 1) % sides
            faces += [(a, b, b + sides), (a, b + sides, a + sides)]
    return faces


def _revolve(
    profile: Sequence[tuple[float, float]],
    sides: int = SIDES,
    axis: Axis = "z",
    at: Sequence[float] = (0, 0, 0),
) -> Manifold:
    """Return the solid of revolution about an axis through `at`, from (radius, height) pairs, the lowest first, m."""
    return _loft(
        [(_outline([(0.0, 0.0, radius)], sides=sides), height) for radius, height in profile],
        axis,
        at,
    )


def _plate(
    discs: Sequence[Disc], low: float, high: float, chamfer: float, axis: Axis = "z"
) -> Manifold:
    """Return a plate with the convex outline of discs between two heights along an axis, its edges chamfered, m."""
    full, inner = _outline(discs), _outline(discs, inset=chamfer)
    if chamfer == 0:
        return _loft([(full, low), (full, high)], axis)
    return _loft([(inner, low), (full, low + chamfer), (full, high - chamfer), (inner, high)], axis)


def _copies_around_z(solid: Manifold, radius: float, count: int) -> Manifold:
    """Return copies of a solid around z at a radius, m, the first half a step from x."""
    angle = (np.arange(count) + 0.5) * (2 * np.pi / count)
    centres = np.round(
        radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=-1), DECIMALS
    )
    return Manifold.compose([solid.translate(tuple(centre)) for centre in centres])


def _canonical(solid: Manifold) -> trimesh.Trimesh:
    """Return a mesh of whole micrometres: vertices sorted, each face from its lowest vertex on, faces sorted."""
    mesh = solid.to_mesh64()
    # Adding zero turns -0.0 into 0.0: they compare equal but have other bytes.
    rounded = np.round(mesh.vert_properties[:, :3], DECIMALS) + 0.0
    vertices, index = np.unique(rounded, axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.tri_verts.astype(np.int64)]
    faces = faces[(faces != np.roll(faces, 1, axis=-1)).all(axis=-1)]
    from_lowest = (faces.argmin(axis=-1)[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(faces, from_lowest, axis=-1)
    return trimesh.Trimesh(vertices, faces[np.lexsort(faces.T[::-1])], process=False)
