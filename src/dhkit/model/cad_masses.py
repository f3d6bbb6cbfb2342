"""Bodies of imported links: from density and shape, from a stated mass and shape, or from a CAD program's report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dhkit.description import Array
from dhkit.errors import ModelError
from dhkit.model.cad_files import link_number
from dhkit.model.mass_report import ReportedMass, read_mass_report
from dhkit.model.shape_inertia import InertiaMethod, MassProperties, shape_inertia
from dhkit.model.triangle_mesh import TriangleMesh

__all__ = ["LinkBody", "StatedMasses", "combined"]

ROUNDING = 1e-13
"""Coordinates and products below this share of a link's size and moments are 0: integrals are exact to some 1e-15."""
OUTSIDE = 0.1
"""How far a reported centre of mass may lie outside the box around its link, as a share of the link's size."""


@dataclass(frozen=True, eq=False)
class LinkBody:
    """A link's mass properties in its DH frame, SI, and what they rest on."""

    properties: MassProperties
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class StatedMasses:
    """What the user states about masses: a density for all links, masses of some, reports of some.

    A report goes before a mass, and a mass before the density; a link may not have both a mass and a report.
    """

    density: float | None
    """kg/m^3."""
    masses: Mapping[int, float]
    """kg, by link."""
    reports: Mapping[int, ReportedMass]
    """By link, in assembly coordinates."""

    @classmethod
    def of(
        cls, links: int, density: float | None, masses: Mapping[int, float] | None, reports: Sequence[Path]
    ) -> StatedMasses:
        """Read reports, and check everything against the number of joints.

        Raises
        ------
        ModelError
            A number that is not positive, a link that is none, stated twice, or a report of no known link.
        """
        masses = dict(masses or {})
        for what, value in (("density", density), *((f"mass of link {i}", mass) for i, mass in masses.items())):
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ModelError(f"{what} is {value:g}; expected a positive number")
        found: dict[int, ReportedMass] = {}
        for path in reports:
            parts = read_mass_report(path)
            for part in parts:
                number = link_number(part.part)
                if number is None:
                    raise ModelError(
                        f"{part.source}: part {part.part[:60]!r} has no link number; expected such as link3"
                    )
                if number in found:
                    raise ModelError(f"{part.source}: link {number} is reported twice, in {found[number].source} too")
                found[number] = part
        for number in (*masses, *found):
            if not 0 <= number <= links:
                raise ModelError(f"a mass of link {number}; the table has links 0 to {links}")
        if both := sorted(set(masses) & set(found)):
            raise ModelError(
                f"link {both[0]} has a stated mass and the report {found[both[0]].source}; expected one of them"
            )
        return cls(density, masses, found)

    def body(self, link: int, meshes: Sequence[TriangleMesh], T_frame_world: Array) -> LinkBody | None:
        """Return the body of a link, None where nothing is stated about it.

        Parameters
        ----------
        link
            Its number.
        meshes
            In the link's DH frame, m; several are one body.
        T_frame_world
            Assembly coordinates to the link's DH frame, shape (4, 4).

        Raises
        ------
        ModelError
            A mesh without volume; names the link.
        """
        if link in self.reports:
            return self._reported(self.reports[link], meshes, T_frame_world)
        if link not in self.masses and self.density is None:
            return None
        try:
            shapes = [shape_inertia(mesh, density=1.0) for mesh in meshes]
        except ModelError as error:
            raise ModelError(f"link {link}: {error}") from None
        one, volume = combined(shapes), sum(shape.volume for shape in shapes)
        stated = self.masses.get(link)
        density = self.density if stated is None else stated / volume
        if density is None:
            raise ModelError(f"link {link}: neither a density nor a mass")
        size = max(mesh.size for mesh in meshes)
        properties = _without_rounding(MassProperties(density * one.mass, one.com, density * one.inertia), size)
        basis = f"{density:.6g} kg/m^3" if stated is None else f"{stated:.6g} kg"
        methods = {shape.method for shape in shapes}
        worst = next(method for method in reversed(InertiaMethod) if method in methods)
        notes = tuple(dict.fromkeys(note for shape in shapes for note in shape.notes))
        return LinkBody(properties, (f"body from {worst.value} and {basis}", *notes))

    @staticmethod
    def _reported(report: ReportedMass, meshes: Sequence[TriangleMesh], T_frame_world: Array) -> LinkBody:
        properties = report.properties.moved(T_frame_world)
        notes = [f"body from {report.source}", *report.notes]
        if meshes:
            low = np.min([mesh.bounds[0] for mesh in meshes], axis=0)
            high = np.max([mesh.bounds[1] for mesh in meshes], axis=0)
            beyond = np.maximum(np.maximum(low - properties.com, properties.com - high), 0)
            if np.linalg.norm(beyond) > OUTSIDE * np.linalg.norm(high - low):
                notes.append(
                    f"warning: its centre of mass lies {np.linalg.norm(beyond):.3g} m outside the link; was the report "
                    "made in the coordinates of the assembly?"
                )
        return LinkBody(properties, tuple(notes))


def _without_rounding(body: MassProperties, size: float) -> MassProperties:
    """Return mass properties with 0 for coordinates and products that are rounding alone: people read the file."""
    com = np.where(np.abs(body.com) < ROUNDING * size, 0.0, body.com)
    products = (np.abs(body.inertia) < ROUNDING * np.trace(body.inertia)) & ~np.eye(3, dtype=bool)
    return MassProperties(body.mass, com, np.where(products, 0.0, body.inertia))


def combined(bodies: Sequence[MassProperties]) -> MassProperties:
    """Return rigid bodies of one frame as one, by Steiner's theorem about the common centre of mass."""
    mass = sum(body.mass for body in bodies)
    com = np.sum([body.mass * body.com for body in bodies], axis=0) / mass
    inertia = np.zeros((3, 3))
    for body in bodies:
        r = body.com - com
        inertia += body.inertia + body.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return MassProperties(float(mass), com, inertia)
