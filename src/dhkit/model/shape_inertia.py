"""Mass, centre of mass and inertia of a link from its shape and a stated density or mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Body, Inertia
from dhkit.display import listed, repr_line
from dhkit.errors import ModelError
from dhkit.expressions import exact
from dhkit.model.closed_surface import MIN_VOLUME, outwards, repaired, signed_volume, tetrahedra
from dhkit.model.triangle_mesh import TriangleMesh, joined_meshes


class InertiaMethod(Enum):
    """The surface that a link's volume was computed from; the last member is the roughest."""

    CLOSED = "the closed mesh"
    FILLED = "the mesh with its holes capped"
    HULL = "the convex hull of an open mesh"


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Mass, centre of mass and inertia of a rigid body, in one frame."""

    mass: float
    """kg."""
    com: Array
    """Shape (3,), m."""
    inertia: Array
    """Shape (3, 3), kg m^2, about the centre of mass; products with the tensor's sign, xy = -integral of x y dm."""

    def moved(self, T: ArrayLike) -> MassProperties:
        """Return the properties in another frame; T, shape (4, 4), m, takes points of their own frame to it.

        Parameters
        ----------
        T
            Pose of the present frame in the new one, shape (4, 4), m.
        """
        # c' = R c + p,  I' = R I R^T, without a Steiner term: I is about the centre of mass, which moves with the body.
        matrix = np.asarray(T, dtype=float)
        R = matrix[:3, :3]
        com = R @ self.com + matrix[:3, 3]
        tensor = R @ self.inertia @ R.T
        return MassProperties(self.mass, com, (tensor + tensor.T) / 2)

    def body(self, name: str = "") -> Body:
        """Return the properties as a body of a description, in the same frame."""
        x, y, z = (exact(float(entry)) for entry in self.com)
        return Body(exact(float(self.mass)), (x, y, z), Inertia.of_tensor(self.inertia), name=name)

    def __repr__(self) -> str:
        return repr_line(
            type(self).__name__, "", f"{self.mass:.4g} kg, centre of mass {listed(self.com)} m"
        )


@dataclass(frozen=True, eq=False)
class ShapeInertia(MassProperties):
    """Mass properties of a homogeneous body from its shape, with the volume and how it was computed."""

    volume: float
    """m^3."""
    method: InertiaMethod
    notes: tuple[str, ...]
    """Changes of the mesh, for printing."""

    def __repr__(self) -> str:
        volume = f"{self.volume:.4g} m^3 of {self.method.value}"
        return repr_line(
            "ShapeInertia", "", f"{self.mass:.4g} kg, centre of mass {listed(self.com)} m, {volume}"
        )


def shape_inertia(
    mesh: TriangleMesh | Sequence[TriangleMesh],
    *,
    density: float | None = None,
    mass: float | None = None,
) -> ShapeInertia:
    """Return mass, centre of mass and inertia of a homogeneous body of a mesh's shape.

    Integrals over a closed mesh are exact up to rounding: the body is a sum of signed tetrahedra between its triangles
    and its centre, whose second moments are Tonon's (2004, "Explicit exact formulas for the 3-D tetrahedron inertia
    tensor", section 2): with corners 0, a, b, c and volume v, and s = a + b + c,

        integral of x x^T = v / 20 (a a^T + b b^T + c c^T + s s^T).

    Parameters
    ----------
    mesh
        Vertices in m; the result is in their frame. Several meshes are parts of one body, and one may be the inner
        wall of another. If a mesh is open, its holes are capped if that adds little area, and
        otherwise its convex hull is taken; ``method`` and ``notes`` state this.
    density, mass
        kg/m^3, or kg; exactly one of them.

    Returns
    -------
    ShapeInertia
        Mass, kg, centre of mass, m, inertia about it, kg m^2, and how a mesh that is open was closed.

    Raises
    ------
    ModelError
        Neither or both of density and mass, one that is not positive, no mesh, or one that encloses no volume.

    Examples
    --------
    >>> import numpy as np
    >>> tetrahedron = TriangleMesh(
    ...     np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    ...     np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
    ... )
    >>> body = shape_inertia(tetrahedron, density=6.0)
    >>> round(body.mass, 12), body.com.round(12).tolist()
    (1.0, [0.25, 0.25, 0.25])
    """
    stated = [
        (name, value) for name, value in (("density", density), ("mass", mass)) if value is not None
    ]
    if len(stated) != 1:
        raise ModelError(
            f"{'both' if stated else 'neither'} of density and mass; expected exactly one, nothing is assumed"
        )
    name, value = stated[0]
    if not (np.isfinite(value) and value > 0):
        raise ModelError(
            f"{name} is {value:g}; expected a positive number of {'kg/m^3' if name == 'density' else 'kg'}"
        )
    meshes = [mesh] if isinstance(mesh, TriangleMesh) else list(mesh)
    if not meshes:
        raise ModelError("no meshes; expected at least one")
    closed_meshes, methods, repairs = zip(*map(_closed, meshes), strict=True)

    # Outer walls are oriented outwards and inner walls inwards, so that cavities count negatively.
    whole, orientation_notes = outwards(joined_meshes(closed_meshes))
    roughest = next(method for method in reversed(InertiaMethod) if method in methods)
    notes = tuple(dict.fromkeys(chain(*repairs, orientation_notes)))
    volume, com, second_moment = _moments(whole)
    if volume <= MIN_VOLUME * whole.size**3:
        raise ModelError(f"the mesh encloses no volume ({volume:.3g} m^3); expected a solid")
    rho = value if name == "density" else value / volume
    # I = rho (tr(S) 1 - S), with S the integral of r r^T about the centre
    inertia = rho * (np.trace(second_moment) * np.eye(3) - second_moment)
    return ShapeInertia(rho * volume, com, inertia, volume, roughest, notes)


def _closed(mesh: TriangleMesh) -> tuple[TriangleMesh, InertiaMethod, tuple[str, ...]]:
    """Return a closed mesh, the method that closed it, and notes of the changes."""
    if not np.isfinite(mesh.vertices).all():
        raise ModelError("vertices that are not finite; expected numbers")
    surface = repaired(mesh)
    if not surface.is_closed:
        note = "open: judged by its convex hull, whose volume is not smaller than the link's"
        return convex_hull(mesh), InertiaMethod.HULL, (note,)
    volume = signed_volume(surface.mesh)
    if abs(volume) <= MIN_VOLUME * mesh.size**3:
        raise ModelError(f"the mesh encloses no volume ({volume:.3g} m^3); expected a solid")
    method = InertiaMethod.FILLED if surface.is_filled else InertiaMethod.CLOSED
    return surface.mesh, method, surface.notes


def convex_hull(mesh: TriangleMesh) -> TriangleMesh:
    """Return the convex hull of a mesh's vertices, in their unit, oriented outwards.

    Raises
    ------
    ModelError
        The vertices lie in a plane.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(mesh.vertices)
    except QhullError:
        raise ModelError(
            "the mesh encloses no volume: its vertices lie in a plane or on a line"
        ) from None

    # Qhull's triangles have no common orientation: those with (b - a) x (c - a) against the outward normal are turned.
    faces = np.asarray(hull.simplices, dtype=np.intp)
    a, b, c = np.moveaxis(mesh.vertices[faces], 1, 0)
    outward_normals = hull.equations[:, :3]
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), outward_normals) < 0
    return TriangleMesh(mesh.vertices, np.where(inwards[:, None], faces[:, ::-1], faces)).merged()


def _moments(mesh: TriangleMesh) -> tuple[float, Array, Array]:
    """Return volume, m^3, centre, (3,), m, and integral of r r^T about it, (3, 3), m^5, of a closed mesh.

    Coordinates are relative to the mesh's middle and to its size: about a distant origin, the differences of large
    moments would keep few digits, and a mesh of nanometres would underflow.
    """
    size = mesh.size or 1.0
    middle = mesh.bounds.mean(axis=0)
    scaled = TriangleMesh((mesh.vertices - middle) / size, mesh.faces)

    # The solid is the sum of the signed tetrahedra (0, a, b, c) of its triangles, of volumes v (Tonon 2004).
    a, b, c = scaled.corners_about(np.zeros(3))
    v = tetrahedra(a, b, c)
    volume = float(v.sum())
    if volume <= MIN_VOLUME:
        return volume * size**3, middle, np.zeros((3, 3))

    # A tetrahedron's centre is (a + b + c) / 4.
    centre = v @ (a + b + c) / (4 * volume)
    a, b, c = scaled.corners_about(centre)
    v = tetrahedra(a, b, c)

    # Integral of r r^T over a tetrahedron with one corner at 0, with s = a + b + c:
    #     v (a a^T + b b^T + c c^T + s s^T) / 20.
    s = a + b + c
    remainder = v @ s / (4 * volume)  # the rounding error of the centre
    second = np.sum([(x * v[:, None]).T @ x for x in (a, b, c, s)], axis=0) / 20
    second_moment = (second + second.T) / 2 - volume * np.outer(remainder, remainder)
    return volume * size**3, middle + size * (centre + remainder), second_moment * size**5
